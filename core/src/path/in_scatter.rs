//! Light scattered at one point of the medium, for methods that choose their points themselves.

use glam::Vec3;

use super::{InScattered, Settings, World, connect, trace};
use crate::host::{Medium, Rng, Scene};
use crate::math::Ray;
use crate::phase::{Phase, deflection};
use crate::sampling::{Generator, uniform, uniform2};
use crate::spectrum::Spectrum;

/// Radiance `∫ p L dω` (W·m⁻²·sr⁻¹) scattered at `point` towards `to_eye` (unit), *without* `σₛ`: an unbiased
/// estimate from one connection to a light and, for light scattered before, one path.
///
/// Light is scattered [`Settings::max_scatterings`] times at most, here included. Next to lights without extent the
/// connection's `1/r²` has no bound. Light that a glowing medium sends here straight is left out.
///
/// ```
/// # use fogbow::{host::Empty, light::{Light, PointLight}, math::*, path::{self, Settings, World}};
/// # use fogbow::{phase::Phase, sampling::Generator, spectrum::Spectrum};
/// let lamp = [Light::Point(PointLight::new(Vec3::X * 2.0, Spectrum::ONE)?)];
/// let world = World { medium: &Empty, scene: &Empty, lights: &lamp };
/// let one = Settings { max_scatterings: 1, ..Settings::default() };
/// let seen = path::in_scattered(&world, Vec3::ZERO, Vec3::Y, &Phase::ISOTROPIC, &one, &mut Generator::new(1));
/// assert!((seen.single[0] - 0.25 / (4.0 * core::f32::consts::PI)).abs() < 1e-6);
/// # Ok::<(), fogbow::light::LightError>(())
/// ```
pub fn in_scattered<M: Medium + ?Sized, S: Scene + ?Sized>(
    world: &World<'_, M, S>,
    point: Vec3,
    to_eye: Vec3,
    phase: &Phase,
    settings: &Settings,
    rng: &mut (impl Rng + ?Sized),
) -> InScattered {
    let random = (uniform(rng), uniform2(rng));
    let u = uniform2(rng);
    if settings.max_scatterings == 0 {
        return InScattered::default();
    }
    let mut child = Generator::child(rng);
    // Of lights alone, so that nothing is weighed against their being hit: as for a surface, near fields included.
    let value = |to_light: Vec3| (phase.value(deflection(to_light, to_eye)), 0.0);
    let single = connect::next_event(world, point, false, |_| point, value, random, &mut child);
    let mut multiple = Spectrum::ZERO;
    if settings.max_scatterings > 1 {
        let sample = phase.sample(to_eye, u);
        let before = Settings { max_scatterings: settings.max_scatterings - 1, lights_visible: true, ..*settings };
        let seen = trace::radiance(&Ray::new(point, sample.to_light), world, &before, rng);
        // The lights themselves have been connected to.
        multiple = sample.weight * (seen.total() - seen.emitted);
    }
    InScattered { single, multiple }
}
