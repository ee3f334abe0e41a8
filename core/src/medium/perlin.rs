//! Gradient noise in three dimensions.

use glam::Vec3;

use crate::math::float;

/// Bound of |noise|: the largest weighted sum of `|g·(x − corner)|` over a cell, 1.036 354 (found
/// by search over a fine lattice), for the twelve gradients towards the edges of a cube.
pub(super) const MAX_VALUE: f32 = 1.0365;

/// Bound of |∇noise| (per cell), found in the same way: 3.75, in the middle of a cell.
pub(super) const MAX_SLOPE: f32 = 3.76;

/// Bound of the second derivative along any direction (per cell²), found in the same way: 14.4652.
pub(super) const MAX_CURVATURE: f32 = 14.5;

/// Gradient noise at `p` (cells of edge 1), in ±[`MAX_VALUE`], and its gradient.
///
/// Twice continuously differentiable. Reference: Perlin 2002, "Improving Noise", with a hash in
/// place of the permutation table.
pub(super) fn noise(p: Vec3, seed: u32) -> (f32, Vec3) {
    let cell = [float::floor_i32(p.x), float::floor_i32(p.y), float::floor_i32(p.z)];
    let f = p - Vec3::new(cell[0] as f32, cell[1] as f32, cell[2] as f32);
    // Beyond ±2³¹ cells the index saturates; clamped, the noise is constant there, not infinite.
    let f = f.clamp(Vec3::ZERO, Vec3::ONE);
    let fade = |t: f32| t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
    let slope = |t: f32| 30.0 * t * t * (t * (t - 2.0) + 1.0);
    let upper = Vec3::new(fade(f.x), fade(f.y), fade(f.z));
    let change = Vec3::new(slope(f.x), slope(f.y), slope(f.z));
    let (mut value, mut gradient) = (0.0, Vec3::ZERO);
    for corner in 0..8_u32 {
        let bit = |axis: u32| corner >> axis & 1;
        let at = |axis: usize| cell[axis].wrapping_add(bit(axis as u32) as i32) as u32;
        let g = edge(hash(at(0), at(1), at(2), seed));
        let offset = f - Vec3::new(bit(0) as f32, bit(1) as f32, bit(2) as f32);
        let weight = |axis: usize| if bit(axis as u32) == 1 { upper[axis] } else { 1.0 - upper[axis] };
        let turn = |axis: usize| if bit(axis as u32) == 1 { change[axis] } else { -change[axis] };
        let (wx, wy, wz) = (weight(0), weight(1), weight(2));
        let along = g.dot(offset);
        value += wx * wy * wz * along;
        gradient += g * (wx * wy * wz) + Vec3::new(turn(0) * wy * wz, wx * turn(1) * wz, wx * wy * turn(2)) * along;
    }
    (value, gradient)
}

/// The value of [`noise`] alone.
#[inline]
pub(super) fn value(p: Vec3, seed: u32) -> f32 {
    let cell = [float::floor_i32(p.x), float::floor_i32(p.y), float::floor_i32(p.z)];
    let f = p - Vec3::new(cell[0] as f32, cell[1] as f32, cell[2] as f32);
    let f = f.clamp(Vec3::ZERO, Vec3::ONE);
    let fade = |t: f32| t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
    let lerp = |a: f32, b: f32, t: f32| a + (b - a) * t;
    let dot = |x: i32, y: i32, z: i32| {
        let at = |axis: usize, step: i32| cell[axis].wrapping_add(step) as u32;
        edge(hash(at(0, x), at(1, y), at(2, z), seed)).dot(f - Vec3::new(x as f32, y as f32, z as f32))
    };
    let (u, v, w) = (fade(f.x), fade(f.y), fade(f.z));
    let row = |y: i32, z: i32| lerp(dot(0, y, z), dot(1, y, z), u);
    lerp(lerp(row(0, 0), row(1, 0), v), lerp(row(0, 1), row(1, 1), v), w)
}

/// The twelve directions towards the edges of a cube.
const EDGES: [Vec3; 12] = [
    Vec3::new(1.0, 1.0, 0.0),
    Vec3::new(-1.0, 1.0, 0.0),
    Vec3::new(1.0, -1.0, 0.0),
    Vec3::new(-1.0, -1.0, 0.0),
    Vec3::new(1.0, 0.0, 1.0),
    Vec3::new(-1.0, 0.0, 1.0),
    Vec3::new(1.0, 0.0, -1.0),
    Vec3::new(-1.0, 0.0, -1.0),
    Vec3::new(0.0, 1.0, 1.0),
    Vec3::new(0.0, -1.0, 1.0),
    Vec3::new(0.0, 1.0, -1.0),
    Vec3::new(0.0, -1.0, -1.0),
];

/// One of [`EDGES`]. A table, because a branch would be mispredicted two times in three.
#[inline]
fn edge(hash: u32) -> Vec3 {
    // The upper bits times twelve: an even choice without a division.
    let choice = (u64::from(hash) * 12) >> 32;
    EDGES.get(choice as usize).copied().unwrap_or(Vec3::ZERO)
}

/// A hash of a lattice point in which every bit counts.
#[inline]
fn hash(x: u32, y: u32, z: u32, seed: u32) -> u32 {
    let h = x.wrapping_mul(0x9e37_79b1) ^ y.wrapping_mul(0x85eb_ca77) ^ z.wrapping_mul(0xc2b2_ae3d) ^ seed;
    // Finaliser "lowbias32" (Wellons 2018).
    let h = (h ^ (h >> 16)).wrapping_mul(0x7feb_352d);
    let h = (h ^ (h >> 15)).wrapping_mul(0x846c_a68b);
    h ^ (h >> 16)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::{Generator, uniform};

    fn point(rng: &mut Generator) -> Vec3 {
        let mut u = || 40.0 * uniform(rng) - 20.0;
        Vec3::new(u(), u(), u())
    }

    #[test]
    fn noise_keeps_its_bounds_and_is_centred() {
        let mut rng = Generator::new(1);
        let (mut sum, mut largest, mut steepest) = (0.0_f64, 0.0_f32, 0.0_f32);
        const N: u32 = 300_000;
        for i in 0..N {
            let p = point(&mut rng);
            let (value, gradient) = noise(p, i / 1000);
            assert!((value - super::value(p, i / 1000)).abs() < 2e-6);
            assert!(value.abs() <= MAX_VALUE && gradient.length() <= MAX_SLOPE);
            largest = largest.max(value.abs());
            steepest = steepest.max(gradient.length());
            sum += f64::from(value);
        }
        // Loose bounds would make the bounds useless.
        assert!(largest > 0.8 && steepest > 2.0, "{largest} {steepest}");
        // Standard deviation about 0.25, samples nearly independent.
        assert!((sum / f64::from(N)).abs() < 5.0 * 0.3 / f64::from(N).sqrt_by_newton());
    }

    trait Newton {
        fn sqrt_by_newton(self) -> f64;
    }
    impl Newton for f64 {
        fn sqrt_by_newton(self) -> f64 {
            (0..60).fold(self, |x, _| 0.5 * (x + self / x))
        }
    }

    #[test]
    fn gradient_of_noise_agrees_with_differences() {
        let mut rng = Generator::new(2);
        for _ in 0..2000 {
            let p = point(&mut rng);
            let (_, gradient) = noise(p, 5);
            const H: f32 = 4e-3;
            let difference = |axis: Vec3| (noise(p + axis * H, 5).0 - noise(p - axis * H, 5).0) / (2.0 * H);
            let numeric = Vec3::new(difference(Vec3::X), difference(Vec3::Y), difference(Vec3::Z));
            // Third derivatives reach some 100 per cell³, times H²/6; rounding 1e-6/H.
            assert!((numeric - gradient).length() < 3e-3, "{p}: {numeric} {gradient}");
        }
    }

    #[test]
    fn far_away_noise_is_still_a_number() {
        for p in [Vec3::splat(1e30), Vec3::splat(-1e30), Vec3::new(3e9, -3e9, 0.5)] {
            let (value, gradient) = noise(p, 1);
            assert!(value.is_finite() && gradient.is_finite());
        }
    }
}
