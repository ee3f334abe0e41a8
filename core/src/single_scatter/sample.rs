//! Estimates over all lights and over surfaces.

use glam::{Vec2, Vec3};

use super::{Arrival, Sums};
use crate::host::{Hit, Medium, Rng, Scene};
use crate::light::{FromPoint, Light, Source};
use crate::math::Ray;
use crate::phase::Phase;
use crate::sampling::uniform::ONE_MINUS_EPSILON;
use crate::sampling::{uniform, uniform2, warp};
use crate::sh::Coefficient;
use crate::spectrum::Spectrum;
use crate::transmittance::thickness::{Marching, Steps};
use crate::world::{World, nearest_surface, shadow_ray};

/// How light is sampled at a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Samples of every light with extent, or directions in which surfaces are looked for. More: less noise, in proportion
    /// to the root.
    pub samples: u32,
    /// How transmittance and its gradients are marched.
    pub steps: Steps,
}

/// Light that is scattered towards one direction.
#[derive(Debug, Clone, Copy)]
pub struct Towards<'a> {
    /// Where it goes (unit).
    pub to_eye: Vec3,
    /// How it is scattered.
    pub phase: &'a Phase,
}

/// Light that is scattered in all directions, as an expansion: Legendre moments of the phase function, and the
/// caller's coefficients.
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

/// Calls `visit(arrival, visible)` for [`Settings::samples`] samples of every light with extent and one of every
/// light without, each weighted so that the sum over the calls is the estimate. With a [tree](crate::light::LightTree) some dozens of lights,
/// chosen by what they send, stand for all.
///
/// Per-light samples form a randomly shifted lattice. Visibility is asked of the scene along
/// [`shadow_ray`]; samples in shadow are visited, too, for the unshadowed sums.
///
/// ```
/// # use fogbow::{host::Empty, light::{Light, Sun}, math::Vec3, sampling::Generator, spectrum::Spectrum};
/// # use fogbow::{single_scatter::{Settings, visit_lights}, transmittance::thickness::Steps, world::World};
/// let lights = [Light::Sun(Sun::new(Vec3::Z, Spectrum::ONE)?), Light::Constant(Spectrum::ONE)];
/// let world = World { medium: &Empty, scene: &Empty, lights: (&lights).into() };
/// let settings = Settings { samples: 8, steps: Steps::Length(0.1) };
/// let mut irradiance = Spectrum::ZERO;
/// visit_lights(Vec3::ZERO, &world, &settings, &mut Generator::new(1), |arrival, visible| {
///     irradiance += if visible { arrival.irradiance } else { Spectrum::ZERO };
/// });
/// // The sun's, and 4π of the sky.
/// assert!((irradiance[0] - 1.0 - 4.0 * core::f32::consts::PI).abs() < 1e-4);
/// # Ok::<(), fogbow::light::LightError>(())
/// ```
pub fn visit_lights<M: Medium + ?Sized, S: Scene + ?Sized>(
    point: Vec3,
    world: &World<'_, M, S>,
    settings: &Settings,
    rng: &mut (impl Rng + ?Sized),
    mut visit: impl FnMut(&Arrival, bool),
) {
    let question = FromPoint::all(point);
    world.lights.representatives(&question, rng, |light, share, rng| {
        let count = match light {
            Light::Point(_) | Light::Phong(_) | Light::Spot(_) | Light::Sun(_) => 1,
            _ => settings.samples.max(1),
        };
        let shift = uniform2(rng);
        for j in 0..count {
            let marching = Marching { steps: settings.steps, offset: uniform(rng) };
            let Some(sample) = light.sample(point, lattice(j, count, shift)) else { continue };
            let source = Source { weight: sample.source.weight / (count as f32 * share), ..sample.source };
            let Some(arrival) = Arrival::from_source(point, world.medium, &source, marching, 0.0) else { continue };
            let visible = !world.scene.is_blocked(&shadow_ray(point, &source));
            visit(&arrival, visible);
        }
    });
}

/// Calls `visit(arrival)` for every surface that [`Settings::samples`] uniformly sampled directions hit.
///
/// `outgoing(ray, hit)` is the *full* radiance (W·m⁻²·sr⁻¹) the surface sends back along the ray:
/// reflected light of every order, through the medium; and emission, unless the surface belongs to
/// one of the lights that [`visit_lights`] samples. Each arrival is weighted by `4π/N`.
///
/// ```
/// # use fogbow::{host::{Empty, Hit, Scene}, math::{Ray, Vec3}, sampling::Generator, spectrum::Spectrum, surface::Surface};
/// # use fogbow::{single_scatter::{Settings, visit_surfaces}, transmittance::thickness::Steps, world::World};
/// /// The inside of a ball.
/// struct Shell;
/// impl Scene for Shell {
///     fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
///         Some(Hit { distance: 2.0, normal: -ray.direction, shading: -ray.direction, surface: Surface::BLACK, light: None })
///     }
/// }
/// let world = World { medium: &Empty, scene: &Shell, lights: (&[]).into() };
/// let settings = Settings { samples: 8, steps: Steps::Length(0.1) };
/// let mut irradiance = 0.0;
/// let glow = |_: &Ray, _: &Hit| Spectrum::ONE;
/// visit_surfaces(Vec3::ZERO, &world, glow, &settings, &mut Generator::new(1), |arrival| irradiance += arrival.irradiance[0]);
/// assert!((irradiance - 4.0 * core::f32::consts::PI).abs() < 1e-4);
/// ```
pub fn visit_surfaces<M: Medium + ?Sized, S: Scene + ?Sized>(
    point: Vec3,
    world: &World<'_, M, S>,
    mut outgoing: impl FnMut(&Ray, &Hit) -> Spectrum,
    settings: &Settings,
    rng: &mut (impl Rng + ?Sized),
    mut visit: impl FnMut(&Arrival),
) {
    let count = settings.samples;
    let shift = uniform2(rng);
    let pdf = warp::uniform_sphere_pdf() * count as f32;
    for j in 0..count {
        let marching = Marching { steps: settings.steps, offset: uniform(rng) };
        let ray = Ray::new(point, warp::uniform_sphere(lattice(j, count, shift)));
        let Some(hit) = nearest_surface(&ray, world.scene) else { continue };
        let radiance = outgoing(&ray, &hit);
        if let Some(arrival) = Arrival::from_surface(&ray, &hit, radiance, pdf, world.medium, marching) {
            visit(&arrival);
        }
    }
}

/// Single scattering of all lights at `point`, with its gradient and the sums of J's Eq. 34.
///
/// [`Settings::samples`] samples of every light with extent; noise comes from them and from marching only, so
/// that in a constant medium with point lights the result is exact.
///
/// ```
/// # use fogbow::{host::Empty, light::{Light, PointLight}, math::Vec3, phase::Phase, spectrum::Spectrum};
/// # use fogbow::{sampling::Generator, single_scatter::{Settings, Towards, sample}};
/// # use fogbow::{transmittance::thickness::Steps, world::World};
/// let lights = [Light::Point(PointLight::new(Vec3::new(0.0, 0.0, 2.0), Spectrum::ONE)?)];
/// let world = World { medium: &Empty, scene: &Empty, lights: (&lights).into() };
/// let towards = Towards { to_eye: Vec3::X, phase: &Phase::ISOTROPIC };
/// let settings = Settings { samples: 1, steps: Steps::Length(0.1) };
/// let sums = sample(Vec3::ZERO, &towards, &world, &settings, &mut Generator::new(1));
/// assert!((sums.value[0] - 0.0198943).abs() < 1e-6);   // 1/4 m², over 4π sr
/// assert_eq!(sums.value, sums.unshadowed);
/// # Ok::<(), fogbow::light::LightError>(())
/// ```
#[must_use]
pub fn sample<M: Medium + ?Sized, S: Scene + ?Sized>(
    point: Vec3,
    towards: &Towards<'_>,
    world: &World<'_, M, S>,
    settings: &Settings,
    rng: &mut (impl Rng + ?Sized),
) -> Sums {
    let mut sums = Sums::default();
    visit_lights(point, world, settings, rng, |arrival, visible| {
        sums.add(&arrival.scatter(towards.to_eye, towards.phase), visible);
    });
    sums
}

/// [`sample`] for all directions at once: adds to the expansion's coefficients; the sums returned
/// are of the mean over directions, `L₀₀ Y₀₀`.
///
/// ```
/// # use fogbow::{host::Empty, light::{Light, Sun}, math::Vec3, phase::{Lobe, Phase}, sampling::Generator};
/// # use fogbow::single_scatter::{Directional, Settings, moments, sample_directional};
/// # use fogbow::{sh::{Coefficient, expansion}, spectrum::Spectrum, transmittance::thickness::Steps, world::World};
/// let lights = [Light::Sun(Sun::new(Vec3::Z, Spectrum::ONE)?)];
/// let world = World { medium: &Empty, scene: &Empty, lights: (&lights).into() };
/// let f = moments(&Phase::from(Lobe::HenyeyGreenstein { g: 0.4 }), 2);
/// let mut coefficients = [Coefficient::ZERO; 9];
/// let mut into = Directional { moments: &f[..3], coefficients: &mut coefficients };
/// let settings = Settings { samples: 1, steps: Steps::Length(0.1) };
/// sample_directional(Vec3::ZERO, &mut into, &world, &settings, &mut Generator::new(1));
/// let seen = |to_eye| expansion::value_with_gradient(&coefficients, to_eye).0[0];
/// assert!(seen(Vec3::NEG_Z) > seen(Vec3::Z));   // brighter against the light
/// # Ok::<(), fogbow::light::LightError>(())
/// ```
pub fn sample_directional<M: Medium + ?Sized, S: Scene + ?Sized>(
    point: Vec3,
    into: &mut Directional<'_>,
    world: &World<'_, M, S>,
    settings: &Settings,
    rng: &mut (impl Rng + ?Sized),
) -> Sums {
    let mut sums = Sums::default();
    visit_lights(point, world, settings, rng, |arrival, visible| {
        let weight = if visible { 1.0 } else { 0.0 };
        sums.add(&arrival.scatter_directional(into.moments, weight, into.coefficients), visible);
    });
    sums
}

/// Light from surfaces, scattered once at `point`: see [`visit_surfaces`].
///
/// ```
/// # use fogbow::{host::Empty, math::Vec3, phase::Phase, sampling::Generator, spectrum::Spectrum};
/// # use fogbow::single_scatter::{Settings, Towards, sample_surfaces};
/// # use fogbow::{transmittance::thickness::Steps, world::World};
/// let world = World { medium: &Empty, scene: &Empty, lights: (&[]).into() };
/// let towards = Towards { to_eye: Vec3::X, phase: &Phase::ISOTROPIC };
/// let settings = Settings { samples: 16, steps: Steps::Length(0.1) };
/// let sums = sample_surfaces(Vec3::ZERO, &towards, &world, |_, _| Spectrum::ONE, &settings, &mut Generator::new(1));
/// assert_eq!(sums.value, Spectrum::ZERO);   // a world without surfaces
/// ```
#[must_use]
pub fn sample_surfaces<M: Medium + ?Sized, S: Scene + ?Sized>(
    point: Vec3,
    towards: &Towards<'_>,
    world: &World<'_, M, S>,
    outgoing: impl FnMut(&Ray, &Hit) -> Spectrum,
    settings: &Settings,
    rng: &mut (impl Rng + ?Sized),
) -> Sums {
    let mut sums = Sums::default();
    visit_surfaces(point, world, outgoing, settings, rng, |arrival| {
        sums.add(&arrival.scatter(towards.to_eye, towards.phase), true);
    });
    sums
}

/// [`sample_surfaces`] for all directions at once, as [`sample_directional`].
///
/// ```
/// # use fogbow::{host::{Empty, Hit, Scene}, math::{Ray, Vec3}, phase::Phase, sampling::Generator, surface::Surface};
/// # use fogbow::single_scatter::{Directional, Settings, moments, sample_surfaces_directional};
/// # use fogbow::{sh::Coefficient, spectrum::Spectrum, transmittance::thickness::Steps, world::World};
/// /// The inside of a ball.
/// struct Shell;
/// impl Scene for Shell {
///     fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
///         Some(Hit { distance: 2.0, normal: -ray.direction, shading: -ray.direction, surface: Surface::BLACK, light: None })
///     }
/// }
/// let world = World { medium: &Empty, scene: &Shell, lights: (&[]).into() };
/// let f = moments(&Phase::ISOTROPIC, 0);
/// let mut into = Directional { moments: &f[..1], coefficients: &mut [Coefficient::ZERO] };
/// let settings = Settings { samples: 16, steps: Steps::Length(0.1) };
/// let glow = |_: &Ray, _: &Hit| Spectrum::ONE;
/// let sums = sample_surfaces_directional(Vec3::ZERO, &mut into, &world, glow, &settings, &mut Generator::new(1));
/// assert!((sums.value[0] - 1.0).abs() < 1e-5);   // as bright as what surrounds it
/// ```
pub fn sample_surfaces_directional<M: Medium + ?Sized, S: Scene + ?Sized>(
    point: Vec3,
    into: &mut Directional<'_>,
    world: &World<'_, M, S>,
    outgoing: impl FnMut(&Ray, &Hit) -> Spectrum,
    settings: &Settings,
    rng: &mut (impl Rng + ?Sized),
) -> Sums {
    let mut sums = Sums::default();
    visit_surfaces(point, world, outgoing, settings, rng, |arrival| {
        sums.add(&arrival.scatter_directional(into.moments, 1.0, into.coefficients), true);
    });
    sums
}
