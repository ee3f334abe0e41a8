//! Light scattered at one point of the medium, for methods that choose their points themselves.

use core::cell::Cell;

use glam::{Vec2, Vec3};

use super::{InScattered, Settings, connect, trace};
use crate::host::{Medium, Rng, Scene};
use crate::math::Ray;
use crate::phase::{Phase, deflection};
use crate::sampling::{Generator, uniform, uniform2};
use crate::spectrum::Spectrum;
use crate::world::World;

/// Up to this number every light is connected to. More: choosing one at random would be cheaper, but which was chosen
/// is the most part of the noise.
pub(crate) const FEW: usize = 4;

/// What the lights alone send to `point` and is scattered there by `value(to_light)` (with the cosine, at a surface): a
/// connection to each, or to one of them where there are more than a few. Rays start at `origin(to_light)`.
pub(crate) fn direct<M: Medium + ?Sized, S: Scene + ?Sized>(
    world: &World<'_, M, S>,
    point: Vec3,
    origin: impl Fn(Vec3) -> Vec3,
    value: impl Fn(Vec3) -> Spectrum,
    rng: &mut Generator,
) -> Spectrum {
    let random = (uniform(rng), uniform2(rng));
    connected(world, point, origin, value, random, rng)
}

fn connected<M: Medium + ?Sized, S: Scene + ?Sized>(
    world: &World<'_, M, S>,
    point: Vec3,
    origin: impl Fn(Vec3) -> Vec3,
    value: impl Fn(Vec3) -> Spectrum,
    random: (f32, Vec2),
    rng: &mut Generator,
) -> Spectrum {
    // Of lights alone, so that nothing is weighed against their being hit: as for a surface, near fields included.
    let value = |to_light: Vec3| (value(to_light), 0.0);
    if world.lights.len() > FEW {
        return connect::next_event(world, point, false, origin, value, random, rng);
    }
    // The random numbers are shared: what differs from light to light is no noise between points then.
    let of = |light| {
        let world = World { lights: core::slice::from_ref(light).into(), ..*world };
        connect::next_event(&world, point, false, &origin, value, random, rng)
    };
    world.lights.iter().map(of).sum()
}

/// What one of the lights sends to `point`, over the probability of its choice: its direction, and irradiance across the light (W·m⁻²); unbiased. `random` chooses among the lights and on the
/// one chosen.
pub(crate) fn arriving<M: Medium + ?Sized, S: Scene + ?Sized>(
    world: &World<'_, M, S>,
    point: Vec3,
    random: (f32, Vec2),
    rng: &mut Generator,
) -> (Vec3, Spectrum) {
    let direction = Cell::new(Vec3::ZERO);
    let noted = |to_light: Vec3| {
        direction.set(to_light);
        (Spectrum::ONE, 0.0)
    };
    let light = connect::next_event(world, point, false, |_| point, noted, random, rng);
    (direction.get(), light)
}

/// Radiance `∫ p L dω` (W·m⁻²·sr⁻¹) scattered at `point` towards `to_eye` (unit), *without* `σₛ`: an unbiased
/// estimate from a connection to each light (one of them, where there are more than a few) and, for light scattered
/// before, one path.
///
/// Light is scattered [`Settings::max_scatterings`] times at most, here included. Next to lights without extent the
/// connection's `1/r²` has no bound. Light that a glowing medium sends here straight is left out.
///
/// ```
/// # use fogbow::{host::Empty, light::{Light, PointLight}, math::*, path::{self, Settings}};
/// # use fogbow::{phase::Phase, sampling::Generator, spectrum::Spectrum, world::World};
/// let lamp = [Light::Point(PointLight::new(Vec3::X * 2.0, Spectrum::ONE)?)];
/// let world = World { medium: &Empty, scene: &Empty, lights: (&lamp).into() };
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
    let value = |to_light: Vec3| phase.value(deflection(to_light, to_eye));
    let single = connected(world, point, |_| point, value, random, &mut child);
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
