//! Rotated grids whose border is not empty.
//!
//! Mitsuba evaluates a grid inside the axis-aligned box around its rotated cube, with the values of the border between
//! the two; a [`DensityGrid`](fogbow::medium::DensityGrid) ends with its cube. Where containers reach beyond the cube, the border's
//! cells are therefore repeated outwards as far as the containers and the box reach, which says the same: between cells of one
//! value the interpolant is that value.

use fogbow::medium::Region;

use super::media::{Refusal, region, straight};
use crate::scene_file::{Container, Place};
use crate::transform::Transform;
use crate::volume::{Values, Volume};

/// Most cells of a grid with its repeated border. More: long thin grids, rotated, may fill the memory.
const MOST_CELLS: u64 = 1 << 28;

/// Containers may reach beyond the grid by this part of it: scene files round.
const ROUNDING: f64 = 1e-4;

/// Lower and upper corner (m).
type Corners = [[f64; 3]; 2];

/// A grid with its border repeated.
#[derive(Debug)]
pub(super) struct Padded {
    pub(super) volume: Volume,
    /// From the unit cube of `volume` to the world.
    pub(super) to_world: Transform,
    /// The box around the grid before.
    around: Corners,
}

/// Whether the border of a grid shows where its cube and the box around that differ.
pub(super) fn shows_border(volume: &Volume, to_world: &Transform, places: &[Place]) -> bool {
    let is_straight = to_world.rows.iter().all(|row| {
        let largest = row.iter().take(3).fold(0.0_f64, |m, v| m.max(v.abs()));
        row.iter().take(3).filter(|v| v.abs() > 1e-6 * largest).count() == 1
    });
    let Some(to_local) = to_world.inverse() else { return false };
    let within = |place: &Place| {
        let [low, high] = extent(&place.container, &to_local);
        (0..3).all(|i| low[i] >= -ROUNDING && high[i] <= 1.0 + ROUNDING)
    };
    !is_straight && !places.iter().all(within) && !volume.has_empty_border()
}

impl Padded {
    /// `None` where that would be too many cells.
    pub(super) fn new(volume: &Volume, to_world: &Transform, places: &[Place]) -> Option<Self> {
        let to_local = to_world.inverse()?;
        let around = Container::Cube(centred().then(to_world)).bounds();
        // As far as the grid is seen, in its own coordinates.
        let (mut low, mut high) = ([0.0_f64; 3], [1.0_f64; 3]);
        for place in places {
            let seen = common(place.container.bounds(), around);
            for i in 0..8_u32 {
                let at = to_local.point([0, 1, 2].map(|axis| seen[(i >> axis & 1) as usize][axis]));
                low = [0, 1, 2].map(|axis| low[axis].min(at[axis]));
                high = [0, 1, 2].map(|axis| high[axis].max(at[axis]));
            }
        }
        let cells = volume.size.map(f64::from);
        let before = [0, 1, 2].map(|i| (-low[i] * cells[i]).ceil());
        let after = [0, 1, 2].map(|i| ((high[i] - 1.0) * cells[i]).ceil());
        let sides = [0, 1, 2].map(|i| before[i] + cells[i] + after[i]);
        if !(sides.iter().product::<f64>() <= MOST_CELLS as f64) {
            return None;
        }
        // Whole numbers no larger than that.
        let [before, size] = [before, sides].map(|numbers| numbers.map(|n| n as u32));
        let values = match &volume.values {
            Values::F32(values) => Values::F32(repeated(values, volume.size, before, size)),
            Values::U8(values) => Values::U8(repeated(values, volume.size, before, size)),
        };
        let grown = Transform::scaling([0, 1, 2].map(|i| sides[i] / cells[i]));
        let moved = Transform::translation([0, 1, 2].map(|i| -f64::from(before[i]) / cells[i]));
        Some(Self { volume: Volume { size, values }, to_world: grown.then(&moved).then(to_world), around })
    }

    /// The box around the grid before.
    pub(super) fn around(&self) -> Result<Region, fogbow::medium::MediumError> {
        let [low, high] = self.around;
        straight(low, high)
    }

    /// Where the medium is that a container holds: in the part of it that lies in the box around the grid.
    pub(super) fn region(&self, container: &Container) -> Result<Region, Refusal> {
        let [low, high] = self.around;
        let reach = (0..3).map(|i| high[i] - low[i]).fold(0.0, f64::max) * ROUNDING;
        let [from, to] = container.bounds();
        if (0..3).all(|i| from[i] >= low[i] - reach && to[i] <= high[i] + reach) {
            return Ok(region(container)?);
        }
        let is_within = |i: u32| container.contains([0, 1, 2].map(|axis| self.around[(i >> axis & 1) as usize][axis]));
        if (0..8).all(is_within) {
            return Ok(self.around()?);
        }
        Err(Refusal::Border)
    }
}

/// From the cube `[−1, 1]³` to `[0, 1]³`.
fn centred() -> Transform {
    Transform::scaling([0.5; 3]).then(&Transform::translation([0.5; 3]))
}

/// The smallest box around a container, in the coordinates of a grid.
fn extent(container: &Container, to_local: &Transform) -> Corners {
    match container {
        Container::Everywhere => container.bounds(),
        Container::Body(_) => {
            let box_around = container.bounds();
            let corner = |i: u32| to_local.point([0, 1, 2].map(|axis| box_around[(i >> axis & 1) as usize][axis]));
            let corners: Vec<[f64; 3]> = (0..8).map(corner).collect();
            let least = |axis: usize| corners.iter().map(|c| c[axis]).fold(f64::INFINITY, f64::min);
            let most = |axis: usize| corners.iter().map(|c| c[axis]).fold(f64::NEG_INFINITY, f64::max);
            [[0, 1, 2].map(least), [0, 1, 2].map(most)]
        }
        Container::Cube(to_world) => Container::Cube(to_world.then(to_local)).bounds(),
        Container::Sphere { centre, radius } => {
            let middle = to_local.point(*centre);
            let reach = to_local.rows.map(|r| radius * (r[0] * r[0] + r[1] * r[1] + r[2] * r[2]).sqrt());
            [[0, 1, 2].map(|i| middle[i] - reach[i]), [0, 1, 2].map(|i| middle[i] + reach[i])]
        }
    }
}

/// What two boxes have in common; a point of the second where that is nothing.
fn common(a: Corners, b: Corners) -> Corners {
    let clamp = |corner: [f64; 3]| [0, 1, 2].map(|i| corner[i].clamp(b[0][i], b[1][i]));
    [clamp(a[0]), clamp(a[1])]
}

/// Cells with those of the border repeated outwards: `before` of them below along each axis, in all `to`.
fn repeated<T: Copy>(values: &[T], from: [u32; 3], before: [u32; 3], to: [u32; 3]) -> Vec<T> {
    let inner = |at: u32, axis: usize| at.saturating_sub(before[axis]).min(from[axis] - 1) as usize;
    let mut out = Vec::with_capacity(to.iter().map(|n| *n as usize).product());
    for z in 0..to[2] {
        for y in 0..to[1] {
            let row = (inner(z, 2) * from[1] as usize + inner(y, 1)) * from[0] as usize;
            out.extend((0..to[0]).filter_map(|x| values.get(row + inner(x, 0)).copied()));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use fogbow::host::Medium;
    use fogbow::math::Vec3;
    use fogbow::phase::Phase;
    use fogbow::sampling::{Generator, uniform};
    use fogbow::spectrum::Spectrum;

    use super::super::media::{Media, WithMedium, tables};
    use super::*;
    use crate::scene_file::{Matter, MediumDescription, SceneFile};
    use crate::transform::{to_array, to_vec3};

    const SIZE: [u32; 3] = [3, 2, 4];

    fn value(cell: [usize; 3]) -> f32 {
        0.25 + ((cell[0] + 2 * cell[1] + 5 * cell[2]) % 7) as f32
    }

    fn volume() -> Volume {
        let cells = (0..24).map(|i| value([i % 3, i / 3 % 2, i / 6]));
        Volume { size: SIZE, values: Values::F32(cells.collect()) }
    }

    fn turned() -> Transform {
        let turn = Transform::rotation([1.0, 2.0, 0.5], 35.0).unwrap();
        Transform::scaling([1.0, 2.0, 1.5]).then(&turn).then(&Transform::translation([0.3, -0.2, 0.1]))
    }

    /// Trilinear between centres, clamped to the grid, in the box around the turned cube.
    fn expected(point: [f64; 3]) -> f64 {
        let around = Container::Cube(centred().then(&turned())).bounds();
        if (0..3).any(|i| point[i] < around[0][i] || point[i] > around[1][i]) {
            return 0.0;
        }
        let local = turned().inverse().unwrap().point(point);
        let mut sum = 0.0;
        for corner in 0..8_u32 {
            let (mut weight, mut cell) = (1.0, [0; 3]);
            for axis in 0..3 {
                let at = local[axis] * f64::from(SIZE[axis]) - 0.5;
                let upper = corner >> axis & 1 == 1;
                let share = at - at.floor();
                weight *= if upper { share } else { 1.0 - share };
                cell[axis] = (at.floor() + f64::from(u8::from(upper))).clamp(0.0, f64::from(SIZE[axis] - 1)) as usize;
            }
            sum += weight * f64::from(value(cell));
        }
        sum
    }

    struct Differences<'c>(&'c Container);

    impl WithMedium for Differences<'_> {
        type Output = usize;

        /// Compares, and counts points with matter beyond the cube.
        fn with<M: Medium + Sync>(self, medium: &M) -> usize {
            let (rng, mut beyond) = (&mut Generator::new(1), 0);
            for _ in 0..20_000 {
                let [low, high] = self.0.bounds().map(to_vec3);
                let share = 1.2 * Vec3::new(uniform(rng), uniform(rng), uniform(rng)) - 0.1;
                let point = low + (high - low) * share;
                let at = to_array(point);
                let wanted = if self.0.contains(at) { expected(at) } else { 0.0 };
                let got = f64::from(medium.extinction(point)[0]);
                // On a face rounding decides.
                let near = [1e-5, -1e-5].map(|d| at.map(|c| c + d)).map(|at| self.0.contains(at) && expected(at) > 0.0);
                if near[0] == near[1] {
                    assert!((got - wanted).abs() < 1e-4, "{point}: {got} for {wanted}");
                }
                let local = turned().inverse().unwrap().point(at);
                beyond += usize::from(got > 0.0 && local.iter().any(|c| !(0.0..=1.0).contains(c)));
            }
            beyond
        }
    }

    fn with_container(container: Container) -> Result<usize, String> {
        let one = Spectrum::ONE;
        let matter = Matter::Grid {
            volume: Arc::new(volume()),
            to_world: turned(),
            absorption: Spectrum::ZERO,
            scattering: one,
            phase: Phase::ISOTROPIC,
        };
        let text = "<scene version=\"3.0.0\"><integrator type=\"volpath\"/><sensor type=\"perspective\"><float name=\"fov\" value=\"36\"/>\
            <film type=\"hdrfilm\"><rfilter type=\"box\"/></film></sensor></scene>";
        let mut scene = SceneFile::parse("test.xml".as_ref(), text).unwrap();
        let places = vec![Place { container: container.clone(), holes: Vec::new() }];
        scene.media.push(MediumDescription {
            id: "smoke".to_owned(),
            matter,
            places,
            limits: None,
            glow: Spectrum::ZERO,
            heat: None,
        });
        let mut tables = tables(&scene);
        Ok(Media::new(&scene, &mut tables).map_err(|e| e.to_string())?.with(Differences(&container)))
    }

    #[test]
    fn a_rotated_grid_reaches_as_far_as_the_box_around_it() {
        // Around all of it; within the box around the grid, and partly beyond the grid.
        let ball = |centre, radius| Container::Sphere { centre, radius };
        let middle = turned().point([0.5; 3]);
        assert!(with_container(ball(middle, 3.0)).unwrap() > 100);
        let around = Container::Cube(centred().then(&turned())).bounds();
        let corner = [0, 1, 2].map(|i| around[0][i] + 0.26);
        assert!(with_container(ball(corner, 0.25)).unwrap() > 1000);
    }

    #[test]
    fn a_container_that_is_the_grid_shows_the_grid() {
        assert_eq!(with_container(Container::Cube(centred().then(&turned()))), Ok(0));
    }

    #[test]
    fn a_container_across_the_box_shows_what_both_have() {
        let around = Container::Cube(centred().then(&turned())).bounds();
        let corner = [0, 1, 2].map(|i| around[1][i] - 0.1);
        assert!(with_container(Container::Sphere { centre: corner, radius: 0.5 }).unwrap() > 100);
    }
}
