//! Estimates over all lights and over surfaces.

use glam::{Vec2, Vec3};

use super::{Arrival, Sums};
use crate::host::{Hit, Medium, Rng, Scene};
use crate::light::{Light, Source};
use crate::math::Ray;
use crate::phase::Phase;
use crate::sampling::uniform::ONE_MINUS_EPSILON;
use crate::sampling::{uniform, uniform2, warp};
use crate::sh::Coefficient;
use crate::spectrum::Spectrum;
use crate::transmittance::thickness::{Marching, Steps};
use crate::world::{nearest_surface, shadow_ray};

/// Where an expansion goes: Legendre moments of the phase function, and the caller's coefficients.
#[derive(Debug)]
pub struct Directional<'a> {
    /// `f_0 … f_L` per channel: [`super::moments`], cut after the degree wanted.
    pub moments: &'a [Spectrum],
    /// `(L + 1)²` coefficients, to which the estimate is added.
    pub coefficients: &'a mut [Coefficient],
}

/// A point of the lattice `(j/n, jφ)`, shifted: each is uniform by itself, together they are even.
pub(crate) fn lattice(j: u32, count: u32, shift: Vec2) -> Vec2 {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let wrap = |x: f64| ((x - libm::floor(x)) as f32).min(ONE_MINUS_EPSILON);
    Vec2::new(
        wrap(f64::from(j) / f64::from(count) + f64::from(shift.x)),
        wrap(f64::from(j) * GOLDEN + f64::from(shift.y)),
    )
}

/// Calls `visit(arrival, visible)` for `samples` samples of every light with extent and one of every
/// light without, each weighted so that the sum over the calls is the estimate.
///
/// Per-light samples form a randomly shifted lattice. Visibility is asked of `scene` along
/// [`shadow_ray`]; samples in shadow are visited, too, for the unshadowed sums.
pub fn visit_lights(
    point: Vec3,
    medium: &(impl Medium + ?Sized),
    scene: &(impl Scene + ?Sized),
    lights: &[Light<'_>],
    samples: u32,
    steps: Steps,
    rng: &mut (impl Rng + ?Sized),
    mut visit: impl FnMut(&Arrival, bool),
) {
    for light in lights {
        let count = match light {
            Light::Point(_) | Light::Phong(_) | Light::Spot(_) | Light::Sun(_) => 1,
            _ => samples.max(1),
        };
        let shift = uniform2(rng);
        for j in 0..count {
            let marching = Marching { steps, offset: uniform(rng) };
            let Some(sample) = light.sample(point, lattice(j, count, shift)) else { continue };
            let source = Source { weight: sample.source.weight / count as f32, ..sample.source };
            let Some(arrival) = Arrival::from_source(point, medium, &source, marching, 0.0) else { continue };
            let visible = !scene.is_blocked(&shadow_ray(point, &source));
            visit(&arrival, visible);
        }
    }
}

/// Calls `visit(arrival)` for every surface that `samples` uniformly sampled directions hit.
///
/// `outgoing(ray, hit)` is the *full* radiance (W·m⁻²·sr⁻¹) the surface sends back along the ray:
/// reflected light of every order, through the medium; and emission, unless the surface belongs to
/// one of the lights that [`visit_lights`] samples. Each arrival is weighted by `4π/N`.
pub fn visit_surfaces(
    point: Vec3,
    medium: &(impl Medium + ?Sized),
    scene: &(impl Scene + ?Sized),
    mut outgoing: impl FnMut(&Ray, &Hit) -> Spectrum,
    samples: u32,
    steps: Steps,
    rng: &mut (impl Rng + ?Sized),
    mut visit: impl FnMut(&Arrival),
) {
    let shift = uniform2(rng);
    let pdf = warp::uniform_sphere_pdf() * samples as f32;
    for j in 0..samples {
        let marching = Marching { steps, offset: uniform(rng) };
        let ray = Ray::new(point, warp::uniform_sphere(lattice(j, samples, shift)));
        let Some(hit) = nearest_surface(&ray, scene) else { continue };
        let radiance = outgoing(&ray, &hit);
        if let Some(arrival) = Arrival::from_surface(&ray, &hit, radiance, pdf, medium, marching) {
            visit(&arrival);
        }
    }
}

/// Single scattering of all lights at `point` towards `to_eye` (unit), with its gradient and the
/// sums of J's Eq. 34.
///
/// `samples` samples of every light with extent; noise comes from them and from marching only, so
/// that in a constant medium with point lights the result is exact.
///
/// ```
/// # use fogbow::{host::Empty, light::{Light, PointLight}, math::Vec3, phase::Phase, spectrum::Spectrum};
/// # use fogbow::{sampling::Generator, single_scatter::sample, transmittance::thickness::Steps};
/// let lamp = PointLight::new(Vec3::new(0.0, 0.0, 2.0), Spectrum::ONE).unwrap();
/// let (phase, mut rng) = (Phase::ISOTROPIC, Generator::new(1));
/// let lights = [Light::Point(lamp)];
/// let sums = sample(Vec3::ZERO, Vec3::X, &phase, &Empty, &Empty, &lights, 1, Steps::Length(0.1), &mut rng);
/// assert!((sums.value[0] - 0.0198943).abs() < 1e-6);
/// assert_eq!(sums.value, sums.unshadowed);
/// ```
#[must_use]
pub fn sample(
    point: Vec3,
    to_eye: Vec3,
    phase: &Phase,
    medium: &(impl Medium + ?Sized),
    scene: &(impl Scene + ?Sized),
    lights: &[Light<'_>],
    samples: u32,
    steps: Steps,
    rng: &mut (impl Rng + ?Sized),
) -> Sums {
    let mut sums = Sums::default();
    visit_lights(point, medium, scene, lights, samples, steps, rng, |arrival, visible| {
        sums.add(&arrival.scatter(to_eye, phase), visible);
    });
    sums
}

/// [`sample`] for all directions at once: adds to the expansion's coefficients; the sums returned
/// are of the mean over directions, `L₀₀ Y₀₀`.
///
/// ```
/// # use fogbow::{host::Empty, light::{Light, Sun}, math::Vec3, phase::{Lobe, Phase}, sampling::Generator};
/// # use fogbow::single_scatter::{Directional, moments, sample_directional};
/// # use fogbow::{sh::{Coefficient, expansion}, spectrum::Spectrum, transmittance::thickness::Steps};
/// let lights = [Light::Sun(Sun::new(Vec3::Z, Spectrum::ONE).unwrap())];
/// let f = moments(&Phase::from(Lobe::HenyeyGreenstein { g: 0.4 }), 2);
/// let mut coefficients = [Coefficient::ZERO; 9];
/// let mut into = Directional { moments: &f[..3], coefficients: &mut coefficients };
/// let steps = Steps::Length(0.1);
/// sample_directional(Vec3::ZERO, &Empty, &Empty, &lights, 1, steps, &mut Generator::new(1), &mut into);
/// let seen = |to_eye| expansion::value_with_gradient(&coefficients, to_eye).0[0];
/// assert!(seen(Vec3::NEG_Z) > seen(Vec3::Z));   // brighter against the light
/// ```
pub fn sample_directional(
    point: Vec3,
    medium: &(impl Medium + ?Sized),
    scene: &(impl Scene + ?Sized),
    lights: &[Light<'_>],
    samples: u32,
    steps: Steps,
    rng: &mut (impl Rng + ?Sized),
    into: &mut Directional<'_>,
) -> Sums {
    let mut sums = Sums::default();
    visit_lights(point, medium, scene, lights, samples, steps, rng, |arrival, visible| {
        let weight = if visible { 1.0 } else { 0.0 };
        sums.add(&arrival.scatter_directional(into.moments, weight, into.coefficients), visible);
    });
    sums
}

/// Light from surfaces, scattered once at `point` towards `to_eye`: see [`visit_surfaces`].
///
/// ```
/// # use fogbow::{host::Empty, math::Vec3, phase::Phase, sampling::Generator, spectrum::Spectrum};
/// # use fogbow::{single_scatter::sample_surfaces, transmittance::thickness::Steps};
/// let (phase, steps, mut rng) = (Phase::ISOTROPIC, Steps::Length(0.1), Generator::new(1));
/// let glow = |_: &_, _: &_| Spectrum::ONE;
/// let sums = sample_surfaces(Vec3::ZERO, Vec3::X, &phase, &Empty, &Empty, glow, 16, steps, &mut rng);
/// assert_eq!(sums.value, Spectrum::ZERO);   // a world without surfaces
/// ```
#[must_use]
pub fn sample_surfaces(
    point: Vec3,
    to_eye: Vec3,
    phase: &Phase,
    medium: &(impl Medium + ?Sized),
    scene: &(impl Scene + ?Sized),
    outgoing: impl FnMut(&Ray, &Hit) -> Spectrum,
    samples: u32,
    steps: Steps,
    rng: &mut (impl Rng + ?Sized),
) -> Sums {
    let mut sums = Sums::default();
    visit_surfaces(point, medium, scene, outgoing, samples, steps, rng, |arrival| {
        sums.add(&arrival.scatter(to_eye, phase), true);
    });
    sums
}

/// [`sample_surfaces`] for all directions at once, as [`sample_directional`].
pub fn sample_surfaces_directional(
    point: Vec3,
    medium: &(impl Medium + ?Sized),
    scene: &(impl Scene + ?Sized),
    outgoing: impl FnMut(&Ray, &Hit) -> Spectrum,
    samples: u32,
    steps: Steps,
    rng: &mut (impl Rng + ?Sized),
    into: &mut Directional<'_>,
) -> Sums {
    let mut sums = Sums::default();
    visit_surfaces(point, medium, scene, outgoing, samples, steps, rng, |arrival| {
        sums.add(&arrival.scatter_directional(into.moments, 1.0, into.coefficients), true);
    });
    sums
}
