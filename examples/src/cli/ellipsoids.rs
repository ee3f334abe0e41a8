//! A picture of a covariance grid: ellipsoids of how far light stays alike.

use fogbow::covariance::{GridView, Voxel};
use fogbow::host::Scene;
use fogbow::math::{Ray, Symmetric3, Vec2, Vec3};
use fogbow::spectrum::Spectrum;
use fogbow_std::film::Film;

use super::Failure;
use crate::camera::Camera;
use crate::world::World;

/// Name of the layer.
pub(super) const LAYER: &str = "ellipsoids";

/// Ellipsoids along the grid's longest side, about.
const ALONG: u32 = 10;

/// Longest half axis, in distances of ellipsoids.
const REACH: f32 = 0.45;

/// Smallest eigenvalue, in the largest: needles no thinner than a twentieth of their length.
const LEAST: f32 = 2.5e-3;

struct Ellipsoid {
    centre: Vec3,
    /// The points with `xᵀ form x = 1` around the centre.
    form: Symmetric3,
    /// Logarithm of `√tr Γ` (m⁻¹).
    frequency: f32,
}

struct Picture {
    ellipsoids: Vec<Ellipsoid>,
    /// Longest half axis (m).
    reach: f32,
    /// Range of logarithms.
    range: (f32, f32),
}

impl Picture {
    fn new(grid: &GridView<'_>) -> Self {
        let lattice = grid.lattice();
        let size = lattice.size();
        let stride = size.into_iter().max().unwrap_or(1).div_ceil(ALONG).max(1);
        let reach = REACH * stride as f32 * lattice.cell().max_element();
        let blocks = size.map(|n| n.div_ceil(stride));
        let count: u32 = blocks.iter().product();
        let mut ellipsoids = Vec::new();
        for block in 0..count {
            let [bx, by, _] = blocks;
            let first = [block % bx, block / bx % by, block / (bx * by)].map(|b| b * stride);
            let mut sum = Voxel::EMPTY;
            let (mut centre, mut cells) = (Vec3::ZERO, 0.0);
            let range = |axis: usize| first[axis]..(first[axis] + stride).min(size[axis]);
            for (z, y) in range(2).flat_map(|z| range(1).map(move |y| (z, y))) {
                for x in range(0) {
                    let index = (x + size[0] * (y + size[1] * z)) as usize;
                    sum.merge(&grid.voxels()[index]);
                    centre += lattice.centre(index);
                    cells += 1.0;
                }
            }
            let Some(gamma) = sum.covariance().filter(|gamma| gamma.trace() > 0.0) else { continue };
            let [smallest, _, largest] = sorted(gamma.eigen().values);
            let least = LEAST * largest;
            let even = Symmetric3::from_upper([least, 0.0, 0.0, least, 0.0, least]);
            let form = gamma.plus(&even).times(1.0 / (reach * reach * (smallest.max(0.0) + least)));
            ellipsoids.push(Ellipsoid { centre: centre / cells, form, frequency: 0.5 * gamma.trace().ln() });
        }
        let logs = || ellipsoids.iter().map(|e| e.frequency);
        let range = (logs().fold(f32::INFINITY, f32::min), logs().fold(f32::NEG_INFINITY, f32::max));
        Self { ellipsoids, reach, range }
    }

    /// The nearest ellipsoid along `ray`, lit from the eye: red where light varies fast, blue where it is smooth.
    fn seen(&self, ray: &Ray) -> Spectrum {
        let (mut nearest, mut colour) = (ray.length, Spectrum::ZERO);
        for Ellipsoid { centre, form, frequency } in &self.ellipsoids {
            let from = ray.origin - *centre;
            let along = from.dot(ray.direction);
            if from.length_squared() - along * along > self.reach * self.reach {
                continue;
            }
            let applied = form.applied(from);
            let (a, b, c) = (form.along(ray.direction), applied.dot(ray.direction), from.dot(applied) - 1.0);
            let discriminant = b * b - a * c;
            if discriminant <= 0.0 {
                continue;
            }
            let distance = (-b - discriminant.sqrt()) / a;
            if distance > 0.0 && distance < nearest {
                nearest = distance;
                let facing = -form.applied(from + ray.direction * distance).normalize().dot(ray.direction);
                let (low, high) = self.range;
                let share = (frequency - low) / (high - low).max(1e-6);
                let shade = 0.15 + 0.85 * facing.max(0.0);
                colour = Spectrum::new(share, 0.25 + 0.3 * (share * (1.0 - share)), 1.0 - share) * shade;
            }
        }
        colour
    }
}

fn sorted(mut values: [f32; 3]) -> [f32; 3] {
    values.sort_by(f32::total_cmp);
    values
}

/// The film with a layer of ellipsoids in front of what is not hidden by surfaces. Their axes are those of the covariances,
/// the longest where light varies least; all are drawn with one longest axis, and their colour tells how fast light varies.
pub(super) fn drawn(film: &Film, grid: &GridView<'_>, camera: &Camera, world: &World<'_>) -> Result<Film, Failure> {
    let names: Vec<&str> = film.layers().iter().map(String::as_str).chain([LAYER]).collect();
    let mut out = Film::new(film.width(), film.height(), &names)?;
    let layers: Vec<_> = (0..film.layers().len()).filter_map(|i| film.mean(i)).collect();
    if layers.len() < film.layers().len() {
        // Nothing was rendered.
        return Ok(out);
    }
    let picture = Picture::new(grid);
    let size = Vec2::new(film.width() as f32, film.height() as f32);
    for index in 0..film.width() * film.height() {
        let (x, y) = (index % film.width(), index / film.width());
        let ray = camera.ray((Vec2::new(x as f32, y as f32) + 0.5) / size);
        let ray = world.closest_hit(&ray).map_or(ray, |hit| ray.with_length(hit.distance));
        let colours = layers.iter().map(|layer| layer.pixels[index as usize]);
        let colours: Vec<Spectrum> = colours.chain([picture.seen(&ray)]).collect();
        out.add(x, y, &colours);
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use fogbow::covariance::Lattice;
    use fogbow::math::Bounds;

    use super::*;

    /// One voxel in which light varies fast along x, seen along z.
    #[test]
    fn ellipsoids_are_long_where_light_varies_least() {
        let bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
        let lattice = Lattice::new(bounds, [1; 3]).unwrap();
        let mut voxel = Voxel::EMPTY;
        voxel.add_covariance(&Symmetric3::from_upper([100.0, 0.0, 0.0, 4.0, 0.0, 1.0]), 2.0);
        let voxels = [voxel];
        let picture = Picture::new(&GridView::new(lattice, &voxels, 1).unwrap());
        let [ellipsoid] = &picture.ellipsoids[..] else { panic!("one ellipsoid") };
        assert_eq!(ellipsoid.centre, Vec3::ZERO);
        let half_axis = |axis: Vec3| 1.0 / ellipsoid.form.along(axis).sqrt();
        // √(λ + least) apart, the longest 0.45 of two metres.
        assert!((half_axis(Vec3::Z) - 0.9).abs() < 1e-5);
        assert!((half_axis(Vec3::Y) - 0.9 * (1.25_f32 / 4.25).sqrt()).abs() < 1e-5);
        assert!((half_axis(Vec3::X) - 0.9 * (1.25_f32 / 100.25).sqrt()).abs() < 1e-5);
        let towards = |x: f32, y: f32| Ray::new(Vec3::new(x, y, 5.0), Vec3::NEG_Z);
        assert!(picture.seen(&towards(0.0, 0.4)) != Spectrum::ZERO);
        assert!(picture.seen(&towards(0.2, 0.0)) == Spectrum::ZERO);
        // A wall before it.
        assert!(picture.seen(&towards(0.0, 0.0).with_length(3.0)) == Spectrum::ZERO);
    }
}
