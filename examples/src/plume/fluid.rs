//! Smoke in a closed cube: a small fluid solver.
//!
//! ```text
//! ∂u/∂t = −(u·∇)u − ∇p + buoyancy + confinement,   ∇·u = 0,   ∂d/∂t = −(u·∇)d + source
//! ```
//!
//! Values at the centres of cells. Advection along characteristics (Stam 1999), corrected by MacCormack's scheme
//! (Selle et al. 2008); vorticity confinement (Fedkiw et al. 2001); successive over-relaxation for
//! the pressure. One thread and no functions but √, so the same bits everywhere.

/// Sweeps over the pressure: twice as many change no frame visibly, half as many let the column swell.
const SWEEPS: u32 = 24;
/// Over-relaxation of the sweeps; converges for any value in (0, 2).
const RELAXATION: f32 = 1.7;

/// A cube of edge 1 with smoke in it.
#[derive(Debug, Clone)]
pub(super) struct Fluid {
    /// Cells along each axis.
    cells: usize,
    /// Velocity (edges per second) along x, y and z.
    velocity: [Vec<f32>; 3],
    /// Density of the smoke.
    pub(super) density: Vec<f32>,
    pressure: Vec<f32>,
    /// Room for one field.
    spare: [Vec<f32>; 3],
}

/// What drives the smoke.
#[derive(Debug, Clone, Copy)]
pub(super) struct Forces {
    /// Upward acceleration of smoke of density 1 (edges per second squared).
    pub(super) buoyancy: f32,
    /// How much of the swirl lost in advection is put back.
    pub(super) confinement: f32,
    /// Share of density lost per second.
    pub(super) decay: f32,
}

impl Fluid {
    pub(super) fn new(cells: usize) -> Self {
        let field = || vec![0.0; cells * cells * cells];
        Self {
            cells,
            velocity: [field(), field(), field()],
            density: field(),
            pressure: field(),
            spare: [field(), field(), field()],
        }
    }

    /// The middle of every cell, with its density.
    pub(super) fn sources(&mut self) -> impl Iterator<Item = ([f32; 3], &mut f32)> {
        let cells = self.cells;
        let middle = move |c: usize| (c as f32 + 0.5) / cells as f32;
        self.density.iter_mut().enumerate().map(move |(at, density)| {
            ([middle(at % cells), middle(at / cells % cells), middle(at / (cells * cells))], density)
        })
    }

    /// Moves on by `step` seconds.
    pub(super) fn advance(&mut self, step: f32, forces: &Forces) {
        for (v, d) in self.velocity[1].iter_mut().zip(&self.density) {
            *v += step * forces.buoyancy * d;
        }
        self.confine(step * forces.confinement);
        self.project();
        let moved = [0, 1, 2].map(|axis| self.advected(&self.velocity[axis], step));
        let mut density = self.advected(&self.density, step);
        let kept = 1.0 - forces.decay * step;
        density.iter_mut().for_each(|d| *d = (*d * kept).clamp(0.0, 1.0));
        self.velocity = moved;
        self.density = density;
    }

    /// Calls `work` with the index and the place of every cell.
    fn each(cells: usize, mut work: impl FnMut(usize, [usize; 3])) {
        let mut at = 0;
        for z in 0..cells {
            for y in 0..cells {
                for x in 0..cells {
                    work(at, [x, y, z]);
                    at += 1;
                }
            }
        }
    }

    fn stride(&self, axis: usize) -> usize {
        [1, self.cells, self.cells * self.cells][axis]
    }

    /// The neighbours below and above along an axis; at a wall, the cell itself.
    fn neighbours(&self, at: usize, place: [usize; 3], axis: usize) -> (usize, usize) {
        let stride = self.stride(axis);
        let below = if place[axis] > 0 { at - stride } else { at };
        let above = if place[axis] + 1 < self.cells { at + stride } else { at };
        (below, above)
    }

    /// The sum of a field over a cell's neighbours, and their number.
    fn sum_around(&self, field: &[f32], at: usize, place: [usize; 3]) -> (f32, f32) {
        let (mut sum, mut count) = (0.0, 0.0);
        for axis in 0..3 {
            let (below, above) = self.neighbours(at, place, axis);
            for other in [below, above] {
                if other != at {
                    sum += field[other];
                    count += 1.0;
                }
            }
        }
        (sum, count)
    }

    /// Takes the divergence out of the velocity; nothing passes the walls.
    fn project(&mut self) {
        let cells = self.cells;
        let mut divergence = core::mem::take(&mut self.spare[0]);
        Self::each(cells, |at, place| {
            let flow = |axis: usize| {
                let (below, above) = self.neighbours(at, place, axis);
                let field = &self.velocity[axis];
                // Beyond a wall the velocity is that before it, mirrored: none at the wall.
                let low = if below == at { -field[at] } else { field[below] };
                let high = if above == at { -field[at] } else { field[above] };
                0.5 * (high - low)
            };
            divergence[at] = flow(0) + flow(1) + flow(2);
        });
        let mut pressure = core::mem::take(&mut self.pressure);
        for _ in 0..SWEEPS {
            Self::each(cells, |at, place| {
                let is_inner = place.iter().all(|c| (1..cells - 1).contains(c));
                let (sum, count) = if is_inner {
                    let pair = |stride: usize| pressure[at - stride] + pressure[at + stride];
                    (pair(1) + pair(cells) + pair(cells * cells), 6.0)
                } else {
                    self.sum_around(&pressure, at, place)
                };
                let settled = (sum - divergence[at]) / count;
                pressure[at] += RELAXATION * (settled - pressure[at]);
            });
        }
        // Only differences count: without this the mean may wander off.
        let mean = pressure.iter().sum::<f32>() / pressure.len() as f32;
        pressure.iter_mut().for_each(|p| *p -= mean);
        self.pressure = pressure;
        for axis in 0..3 {
            let mut field = core::mem::take(&mut self.velocity[axis]);
            Self::each(cells, |at, place| {
                let (below, above) = self.neighbours(at, place, axis);
                field[at] -= 0.5 * (self.pressure[above] - self.pressure[below]);
            });
            self.velocity[axis] = field;
        }
        self.spare[0] = divergence;
    }

    /// Pushes towards where swirls are strongest.
    fn confine(&mut self, strength: f32) {
        let cells = self.cells;
        let mut curl = core::mem::take(&mut self.spare);
        Self::each(cells, |at, place| {
            let slope = |of: usize, along: usize| {
                let (below, above) = self.neighbours(at, place, along);
                self.velocity[of][above] - self.velocity[of][below]
            };
            curl[0][at] = slope(2, 1) - slope(1, 2);
            curl[1][at] = slope(0, 2) - slope(2, 0);
            curl[2][at] = slope(1, 0) - slope(0, 1);
        });
        let length = |at: usize| {
            let [x, y, z] = [0, 1, 2].map(|axis| curl[axis][at]);
            (x * x + y * y + z * z).sqrt()
        };
        let mut velocity = core::mem::take(&mut self.velocity);
        Self::each(cells, |at, place| {
            let uphill = [0, 1, 2].map(|axis| {
                let (below, above) = self.neighbours(at, place, axis);
                length(above) - length(below)
            });
            let steepness = (uphill[0] * uphill[0] + uphill[1] * uphill[1] + uphill[2] * uphill[2]).sqrt();
            if steepness > 1e-9 {
                let n = uphill.map(|u| strength * u / steepness);
                let w = [0, 1, 2].map(|axis| curl[axis][at]);
                velocity[0][at] += n[1] * w[2] - n[2] * w[1];
                velocity[1][at] += n[2] * w[0] - n[0] * w[2];
                velocity[2][at] += n[0] * w[1] - n[1] * w[0];
            }
        });
        self.velocity = velocity;
        self.spare = curl;
    }

    /// A field carried along by the velocity for `step` seconds.
    fn advected(&self, field: &[f32], step: f32) -> Vec<f32> {
        let way =
            |at: usize, sign: f32| [0, 1, 2].map(|axis| sign * step * self.cells as f32 * self.velocity[axis][at]);
        let mut moved = vec![0.0; field.len()];
        let mut bounds = vec![(0.0, 0.0); field.len()];
        Self::each(self.cells, |at, place| {
            let (value, low, high) = self.sampled(field, place, way(at, -1.0));
            moved[at] = value;
            bounds[at] = (low, high);
        });
        let mut corrected = vec![0.0; field.len()];
        Self::each(self.cells, |at, place| {
            let (back, _, _) = self.sampled(&moved, place, way(at, 1.0));
            // The error made twice, there and back, is taken off once.
            corrected[at] = (moved[at] + 0.5 * (field[at] - back)).clamp(bounds[at].0, bounds[at].1);
        });
        corrected
    }

    /// A field `offset` cells from the middle of a cell, between its eight neighbours there; and
    /// the smallest and largest of them.
    fn sampled(&self, field: &[f32], place: [usize; 3], offset: [f32; 3]) -> (f32, f32, f32) {
        let last = self.cells - 1;
        let (mut first, mut steps, mut parts) = (0, [0; 3], [0.0; 3]);
        for axis in 0..3 {
            let position = (place[axis] as f32 + offset[axis]).clamp(0.0, last as f32);
            let cell = (position as usize).min(last);
            first += cell * self.stride(axis);
            steps[axis] = if cell < last { self.stride(axis) } else { 0 };
            parts[axis] = position - cell as f32;
        }
        let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
        let mut value = |at: usize| {
            low = low.min(field[at]);
            high = high.max(field[at]);
            field[at]
        };
        let mix = |a: f32, b: f32, part: f32| a + part * (b - a);
        let [x, y, z] = steps;
        let mut row = |at: usize| mix(value(at), value(at + x), parts[0]);
        let mut face = |at: usize| mix(row(at), row(at + y), parts[1]);
        let value = mix(face(first), face(first + z), parts[2]);
        (value, low, high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FORCES: Forces = Forces { buoyancy: 4.0, confinement: 0.3, decay: 0.0 };

    fn with_ball(cells: usize) -> Fluid {
        let mut fluid = Fluid::new(cells);
        for (place, density) in fluid.sources() {
            let squared: f32 = place.iter().zip([0.5, 0.25, 0.5]).map(|(a, b)| (a - b) * (a - b)).sum();
            *density = if squared < 0.02 { 1.0 } else { 0.0 };
        }
        fluid
    }

    fn height(fluid: &mut Fluid) -> f32 {
        let (mut sum, mut moment) = (0.0, 0.0);
        for (place, density) in fluid.sources() {
            sum += *density;
            moment += place[1] * *density;
        }
        moment / sum
    }

    #[test]
    fn smoke_rises_and_stays() {
        let mut fluid = with_ball(16);
        let (low, before) = (height(&mut fluid), fluid.density.iter().sum::<f32>());
        (0..20).for_each(|_| fluid.advance(1.0 / 48.0, &FORCES));
        let after = fluid.density.iter().sum::<f32>();
        assert!(height(&mut fluid) > low + 0.05);
        // Advection conserves density only roughly.
        assert!((after / before - 1.0).abs() < 0.2, "{before} became {after}");
    }

    #[test]
    fn still_air_stays_still() {
        let mut fluid = Fluid::new(8);
        (0..4).for_each(|_| fluid.advance(0.02, &FORCES));
        assert!(fluid.density.iter().chain(fluid.velocity.iter().flatten()).all(|v| *v == 0.0));
    }

    #[test]
    fn projection_takes_most_of_the_divergence() {
        let mut fluid = with_ball(16);
        let divergence = |fluid: &Fluid| {
            let mut sum = 0.0;
            Fluid::each(16, |at, place| {
                if place.iter().all(|c| (1..15).contains(c)) {
                    let part = |axis: usize| {
                        let (below, above) = fluid.neighbours(at, place, axis);
                        fluid.velocity[axis][above] - fluid.velocity[axis][below]
                    };
                    sum += (part(0) + part(1) + part(2)).abs();
                }
            });
            sum
        };
        // Smooth: centred differences do not see what alternates from cell to cell.
        for (place, density) in fluid.sources() {
            let squared: f32 = place.iter().map(|c| (c - 0.5) * (c - 0.5)).sum();
            *density = (1.0 - 8.0 * squared).max(0.0).powi(2);
        }
        fluid.velocity[1] = fluid.density.clone();
        let before = divergence(&fluid);
        (0..3).for_each(|_| fluid.project());
        assert!(divergence(&fluid) < 0.1 * before, "{} of {before}", divergence(&fluid));
    }
}
