//! The procedural cloud of pbrt, drawn on a grid.

use crate::volume::{Values, Volume};

/// Cells along an edge. Of the five octaves of noise at the usual frequency, the finest has two cells to a lattice distance.
const CELLS: u32 = 160;

/// `"string type" "cloud"` within the unit cube of its medium.
pub(super) struct Cloud {
    pub(super) density: f32,
    pub(super) wispiness: f32,
    pub(super) frequency: f32,
}

impl Cloud {
    /// Densities at the centres of cells.
    pub(super) fn drawn(&self) -> Volume {
        let at = |i: u32| (i as f32 + 0.5) / CELLS as f32;
        let mut values = Vec::with_capacity((CELLS * CELLS * CELLS) as usize);
        for z in 0..CELLS {
            for y in 0..CELLS {
                values.extend((0..CELLS).map(|x| self.at([at(x), at(y), at(z)])));
            }
        }
        Volume { size: [CELLS; 3], values: Values::F32(values) }
    }

    fn at(&self, p: [f32; 3]) -> f32 {
        let mut moved = p.map(|c| c * self.frequency);
        if self.wispiness > 0.0 {
            let (mut share, mut scale) = (0.05 * self.wispiness, 10.0);
            for _ in 0..2 {
                let slope = slope(moved.map(|c| c * scale));
                moved = [0, 1, 2].map(|i| moved[i] + share * slope[i]);
                share *= 0.5;
                scale *= 1.99;
            }
        }
        let (mut sum, mut share, mut scale) = (0.0, 0.5, 1.0);
        for _ in 0..5 {
            sum += share * noise(moved.map(|c| c * scale));
            share *= 0.5;
            scale *= 1.99;
        }
        // Thinner with height.
        let sum = ((1.0 - p[1]) * 4.5 * self.density * sum).clamp(0.0, 1.0);
        (sum + 2.0 * (0.5 - p[1]).max(0.0)).clamp(0.0, 1.0)
    }
}

fn slope(p: [f32; 3]) -> [f32; 3] {
    const STEP: f32 = 0.01;
    let here = noise(p);
    [0, 1, 2].map(|i| {
        let mut beside = p;
        beside[i] += STEP;
        (noise(beside) - here) / STEP
    })
}

/// Perlin 2002, "Improving noise".
fn noise(p: [f32; 3]) -> f32 {
    let cell = p.map(|c| c.floor());
    let d = [0, 1, 2].map(|i| p[i] - cell[i]);
    let index = cell.map(|c| (c as i32 & 255) as usize);
    let hash = |x: usize, y: usize, z: usize| {
        let of = |i: usize| usize::from(PERMUTATION[i & 255]);
        of(of(of(index[0] + x) + index[1] + y) + index[2] + z)
    };
    let corner = |x: usize, y: usize, z: usize| {
        let [dx, dy, dz] = [d[0] - x as f32, d[1] - y as f32, d[2] - z as f32];
        let h = hash(x, y, z) & 15;
        let u = if h < 8 || h == 12 || h == 13 { dx } else { dy };
        let v = if h < 4 || h == 12 || h == 13 { dy } else { dz };
        (if h & 1 == 0 { u } else { -u }) + (if h & 2 == 0 { v } else { -v })
    };
    let [wx, wy, wz] = d.map(|t| t * t * t * (t * (t * 6.0 - 15.0) + 10.0));
    let mix = |t: f32, a: f32, b: f32| a + (b - a) * t;
    let edge = |y: usize, z: usize| mix(wx, corner(0, y, z), corner(1, y, z));
    mix(wz, mix(wy, edge(0, 0), edge(1, 0)), mix(wy, edge(0, 1), edge(1, 1)))
}

#[rustfmt::skip]
const PERMUTATION: [u8; 256] = [
    151, 160, 137, 91, 90, 15, 131, 13, 201, 95, 96, 53, 194, 233, 7, 225, 140, 36, 103, 30, 69, 142, 8, 99, 37, 240, 21, 10, 23,
    190, 6, 148, 247, 120, 234, 75, 0, 26, 197, 62, 94, 252, 219, 203, 117, 35, 11, 32, 57, 177, 33, 88, 237, 149, 56, 87, 174, 20,
    125, 136, 171, 168, 68, 175, 74, 165, 71, 134, 139, 48, 27, 166, 77, 146, 158, 231, 83, 111, 229, 122, 60, 211, 133, 230, 220,
    105, 92, 41, 55, 46, 245, 40, 244, 102, 143, 54, 65, 25, 63, 161, 1, 216, 80, 73, 209, 76, 132, 187, 208, 89, 18, 169, 200, 196,
    135, 130, 116, 188, 159, 86, 164, 100, 109, 198, 173, 186, 3, 64, 52, 217, 226, 250, 124, 123, 5, 202, 38, 147, 118, 126, 255,
    82, 85, 212, 207, 206, 59, 227, 47, 16, 58, 17, 182, 189, 28, 42, 223, 183, 170, 213, 119, 248, 152, 2, 44, 154, 163, 70, 221,
    153, 101, 155, 167, 43, 172, 9, 129, 22, 39, 253, 19, 98, 108, 110, 79, 113, 224, 232, 178, 185, 112, 104, 218, 246, 97, 228,
    251, 34, 242, 193, 238, 210, 144, 12, 191, 179, 162, 241, 81, 51, 145, 235, 249, 14, 239, 107, 49, 192, 214, 31, 181, 199, 106,
    157, 184, 84, 204, 176, 115, 121, 50, 45, 127, 4, 150, 254, 138, 236, 205, 93, 222, 114, 67, 29, 24, 72, 243, 141, 128, 195, 78,
    66, 215, 61, 156, 180,
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_0_on_a_lattice_and_of_mean_0() {
        let mut sorted = PERMUTATION;
        sorted.sort_unstable();
        assert!(sorted.iter().enumerate().all(|(i, p)| i == usize::from(*p)));
        // 0 on the lattice, of mean 0 between, and nowhere beyond 1.
        assert_eq!(noise([3.0, 42.0, 7.0]), 0.0);
        let values: Vec<f32> = (0..4000).map(|i| noise([0.37, 0.73, 0.59].map(|c| c * i as f32))).collect();
        assert!(values.iter().all(|v| v.abs() <= 1.0));
        assert!((values.iter().sum::<f32>() / 4000.0).abs() < 0.02);
    }
}
