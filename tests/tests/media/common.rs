//! What the tests of media share.

use fogbow::host::{MajorantSegment, Medium, Properties};
use fogbow::math::{Affine3, Mat3, Ray, Vec3, float};
use fogbow::medium::{Density, DensityGrid, MediumError, MinMax};
use fogbow::sampling::{Generator, uniform, uniform2, warp};
use fogbow::spectrum::{Gradient, Spectrum};

pub(crate) const SCATTERING: Spectrum = Spectrum::new(0.9, 0.5, 2.0);

pub(crate) const ABSORPTION: Spectrum = Spectrum::new(0.1, 0.4, 0.0);

/// Coloured smoke.
pub(crate) const SMOKE: Properties =
    Properties { absorption: ABSORPTION, scattering: SCATTERING, ..Properties::VACUUM };

/// A grid with memory of its own.
pub(crate) struct Voxels {
    pub(crate) size: [u32; 3],
    pub(crate) values: Vec<f32>,
    pub(crate) blocks: Vec<MinMax>,
    pub(crate) placement: Affine3,
}

impl Voxels {
    pub(crate) fn new(size: [u32; 3], placement: Affine3, values: impl FnMut(usize) -> f32) -> Self {
        let count = size.iter().map(|&n| n as usize).product();
        let blocks = vec![MinMax::default(); DensityGrid::block_count(size)];
        Self { size, values: (0..count).map(values).collect(), blocks, placement }
    }

    pub(crate) fn grid(&mut self) -> DensityGrid<'_> {
        self.try_grid().expect("valid grid")
    }

    pub(crate) fn try_grid(&mut self) -> Result<DensityGrid<'_>, MediumError> {
        let density = Density::F32(&self.values);
        DensityGrid::new(self.size, density, &SMOKE, self.placement, &mut self.blocks)
    }
}

pub(crate) fn point(rng: &mut Generator, extent: f32) -> Vec3 {
    Vec3::new(uniform(rng), uniform(rng), uniform(rng)) * (2.0 * extent) - Vec3::splat(extent)
}

pub(crate) fn direction(rng: &mut Generator) -> Vec3 {
    warp::uniform_sphere(uniform2(rng))
}

/// Rotation, shear, unequal edges and an offset, of all sizes around `scale`.
pub(crate) fn placement(rng: &mut Generator, scale: f32) -> Affine3 {
    let rotation = |rng: &mut Generator| {
        let frame = fogbow::math::Frame::around(direction(rng));
        let (sin, cos) = float::sin_cos(6.0 * uniform(rng));
        Mat3::from_cols(frame.u * cos + frame.v * sin, frame.v * cos - frame.u * sin, frame.w)
    };
    let edges = Vec3::new(0.3 + uniform(rng), 0.3 + uniform(rng), 0.3 + uniform(rng));
    let matrix3 = rotation(rng) * Mat3::from_diagonal(edges * scale) * rotation(rng);
    Affine3 { matrix3, translation: point(rng, scale) }
}

/// Islands in empty space, with values over several orders of magnitude.
pub(crate) fn islands(rng: &mut Generator) -> impl FnMut(usize) -> f32 {
    let mut rng = Generator::child(rng);
    let mut run = (0_u32, 0.0);
    move |_| {
        if run.0 == 0 {
            let level = uniform(&mut rng);
            run = ((20.0 * uniform(&mut rng)) as u32, if level < 0.6 { 0.0 } else { level * level });
        }
        run.0 = run.0.saturating_sub(1);
        if run.1 == 0.0 { 0.0 } else { run.1 * (1e-3 + uniform(&mut rng)) }
    }
}

pub(crate) fn assert_near(a: f32, b: f32, tolerance: f32, what: &str) {
    assert!((a - b).abs() <= tolerance, "{what}: {a} and {b} differ by more than {tolerance}");
}

/// Walks along a ray and checks every promise of [`Medium::majorant_segment`] and of [`Medium::marching_segment`]; returns the number of
/// segments.
///
/// Within `blur` (m) of a face its two sides cannot be told apart, and either's value is right.
pub(crate) fn check_walk(medium: &impl Medium, ray: &Ray, end: f32, blur: f32, rng: &mut Generator) -> u32 {
    let segments = check_steps(medium, |t| medium.majorant_segment(ray, t), ray, end, blur, rng);
    check_steps(medium, |t| medium.marching_segment(ray, t), ray, end, blur, rng);
    segments
}

fn check_steps(
    medium: &impl Medium,
    next: impl Fn(f32) -> MajorantSegment,
    ray: &Ray,
    end: f32,
    blur: f32,
    rng: &mut Generator,
) -> u32 {
    let (mut t, mut steps) = (0.0_f32, 0);
    while t < end {
        let segment = next(t);
        steps += 1;
        assert!(segment.until > t, "no progress at {t}: {segment:?}, {ray:?}");
        assert!(steps < 20_000, "endless walk: {ray:?}");
        assert!(segment.minorant.is_valid() && segment.majorant.is_valid(), "{segment:?}");
        let until = segment.until.min(end);
        for i in 0..6 {
            let s = match i {
                0 => t,
                1 => until,
                _ => t + (until - t) * uniform(rng),
            };
            let sigma = medium.extinction(ray.at(s));
            let (value, gradient) = medium.extinction_with_gradient(ray.at(s));
            let apart = (gradient - medium.gradients(ray.at(s)).extinction).norm().max_element();
            assert!(value == sigma && apart <= 1e-5 * gradient.norm().max_element(), "{value:?}, {sigma:?}, {apart}");
            for channel in 0..3 {
                let (low, high) = (segment.minorant[channel], segment.majorant[channel]);
                assert!(low <= high, "{segment:?}");
                let keeps = |value: f32| value >= low && value <= high;
                let value = sigma[channel];
                // Where a face jumps within rounding of the point, the other side's value will do.
                let jumps_to_bounds = || {
                    around(ray.at(s), blur).any(|p| {
                        let other = medium.extinction(p)[channel];
                        keeps(other) && (other - value).abs() > 1e-3 * value.max(other)
                    })
                };
                assert!(keeps(value) || jumps_to_bounds(), "{value} outside {segment:?} at {s} of {ray:?}");
            }
            let near_end = (s - t).abs() <= blur || (s - until).abs() <= blur;
            if segment.is_constant() && !near_end {
                let middle = medium.properties(ray.at(t + 0.5 * (until - t)));
                let here = medium.properties(ray.at(s));
                if middle.scattering.is_black() || here.scattering.is_black() {
                    continue; // along a face
                }
                let difference = (middle.scattering - here.scattering).map(f32::abs).max_element();
                assert!(difference <= 1e-6 * here.scattering.max_element(), "{middle:?} {here:?}");
            }
        }
        t = until;
    }
    steps
}

/// Points around one, `distance` (m) away along each axis and diagonal.
pub(crate) fn around(point: Vec3, distance: f32) -> impl Iterator<Item = Vec3> {
    let offset = |i: i32| Vec3::new((i % 3 - 1) as f32, (i / 3 % 3 - 1) as f32, (i / 9 - 1) as f32);
    (0..27).map(move |i| point + offset(i) * distance)
}

/// A ray that starts somewhere around the placement, often parallel to its axes.
pub(crate) fn ray_around(rng: &mut Generator, placement: &Affine3) -> Ray {
    let local = Vec3::splat(0.5) + point(rng, 1.2);
    let along = match (8.0 * uniform(rng)) as u32 {
        0 => Vec3::X,
        1 => Vec3::NEG_Y,
        2 => Vec3::new(0.0, 1.0, -1.0),
        3 => Vec3::new(-1.0, 1e-9, 1e-20),
        _ => direction(rng),
    };
    // On planes between cells and blocks, too.
    let local = if uniform(rng) < 0.3 { (local * 8.0).round() / 8.0 } else { local };
    let direction = (placement.matrix3 * along).normalize();
    Ray::new(placement.transform_point3(local), direction)
}

/// Central differences of extinction, in `f32` with a step that balances rounding and curvature.
pub(crate) fn numeric_gradient(medium: &impl Medium, p: Vec3, step: f32) -> Gradient {
    let along = |axis: Vec3| (medium.extinction(p + axis * step) - medium.extinction(p - axis * step)) / (2.0 * step);
    Gradient { x: along(Vec3::X), y: along(Vec3::Y), z: along(Vec3::Z) }
}
