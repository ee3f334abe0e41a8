//! Connections from a path to the lights.

use glam::{Vec2, Vec3};

use super::World;
use crate::host::{Medium, Scene};
use crate::light::{Incident, Light, LightSample};
use crate::math::Ray;
use crate::phase::deflection;
use crate::sampling::distance::Equiangular;
use crate::sampling::{Generator, discrete, mis};
use crate::spectrum::Spectrum;
use crate::transmittance::{Flight, transmittance};

/// A shadow ray ends this share of its length before the light's own surface.
const SHADOW_MARGIN: f32 = 1e-4;

/// How important a light is for next-event estimation at `point`. In the medium, lights without
/// extent are reached by equiangular connections instead.
#[inline]
fn importance(light: &Light<'_>, point: Vec3, in_medium: bool) -> f32 {
    if in_medium && light.position().is_some() { 0.0 } else { light.importance(point) }
}

/// Probability with which [`choose`] picks light `index`.
#[inline]
pub(super) fn probability(lights: &[Light<'_>], index: usize, point: Vec3, in_medium: bool) -> f32 {
    let own = importance(&lights[index], point, in_medium);
    if lights.len() == 1 {
        return f32::from(u8::from(own > 0.0));
    }
    let total: f32 = lights.iter().map(|light| importance(light, point, in_medium)).sum();
    if total > 0.0 { own / total } else { 0.0 }
}

/// A light chosen and sampled for next-event estimation; `pdf` includes the choice.
#[inline]
pub(super) fn choose(
    lights: &[Light<'_>],
    point: Vec3,
    in_medium: bool,
    choice: f32,
    u: Vec2,
) -> Option<(LightSample, f32)> {
    let chosen = discrete::choose(lights.len(), |i| importance(&lights[i], point, in_medium), choice)?;
    let sample = lights[chosen.index].sample(point, u)?;
    Some((sample, chosen.probability))
}

/// Transmittance times visibility between `origin` and a light, 0 or more per channel.
#[inline]
pub(super) fn reach<M: Medium + ?Sized, S: Scene + ?Sized>(
    world: &World<'_, M, S>,
    origin: Vec3,
    incident: &Incident,
    rng: &mut Generator,
) -> Spectrum {
    let ray = Ray { origin, direction: incident.to_light, length: incident.distance };
    let shadow = ray.with_length(incident.distance * (1.0 - SHADOW_MARGIN));
    if world.scene.is_blocked(&shadow) { Spectrum::ZERO } else { transmittance(world.medium, &ray, rng) }
}

/// Next-event estimation: `value(to_light)` gives the scattering function (with the cosine, at a
/// surface) and the density with which the walk itself would go there.
#[inline]
pub(super) fn next_event<M: Medium + ?Sized, S: Scene + ?Sized>(
    world: &World<'_, M, S>,
    point: Vec3,
    in_medium: bool,
    origin: impl Fn(Vec3) -> Vec3,
    value: impl Fn(Vec3) -> (Spectrum, f32),
    random: (f32, Vec2),
    rng: &mut Generator,
) -> Spectrum {
    let Some((sample, probability)) = choose(world.lights, point, in_medium, random.0, random.1) else {
        return Spectrum::ZERO;
    };
    let incident = sample.incident;
    let (scattered, walk_pdf) = value(incident.to_light);
    if scattered.is_black() {
        return Spectrum::ZERO;
    }
    let weight = if sample.pdf > 0.0 { mis::power(sample.pdf * probability, walk_pdf) } else { 1.0 };
    let arriving = reach(world, origin(incident.to_light), &incident, rng);
    scattered * arriving * incident.irradiance * (weight / probability)
}

/// Light without extent scattered towards the eye somewhere along a flight, over the throughput at
/// the flight's start.
///
/// Grey media: the point lies on the part that was flown, whose survival already holds the
/// transmittance. Coloured ones: on the whole segment, with an estimate of the transmittance.
#[inline]
pub(super) fn along<M: Medium + ?Sized, S: Scene + ?Sized>(
    world: &World<'_, M, S>,
    segment: &Ray,
    flight: &Flight,
    random: (f32, f32),
    rng: &mut Generator,
) -> Spectrum {
    let flown = world.medium.is_grey();
    let (near, far) = (flight.span.0, if flown { flight.span.1 } else { segment.length });
    let interval = |light: &Light<'_>| {
        let position = light.position()?;
        let (near, far) = light.lit_interval(segment, near, far)?;
        Equiangular::new(segment.origin, segment.direction, position, near, far)
    };
    let strength =
        |i: usize| interval(&world.lights[i]).map_or(0.0, |e| e.weight() * world.lights[i].intensity().mean());
    let Some(chosen) = discrete::choose(world.lights.len(), strength, random.0) else {
        return Spectrum::ZERO;
    };
    let light = &world.lights[chosen.index];
    let Some(equiangular) = interval(light) else {
        return Spectrum::ZERO;
    };
    let distance = equiangular.sample(random.1).clamp(near, far);
    let point = segment.at(distance);
    let Some(LightSample { incident, .. }) = light.sample(point, Vec2::ZERO) else {
        return Spectrum::ZERO;
    };
    let properties = world.medium.properties(point);
    let scattered = properties.scattering * properties.phase.value(deflection(incident.to_light, -segment.direction));
    if scattered.is_black() {
        return Spectrum::ZERO;
    }
    let mut arriving = reach(world, point, &incident, rng);
    if arriving.is_black() {
        return Spectrum::ZERO;
    }
    if !flown {
        arriving *= transmittance(world.medium, &segment.with_length(distance), rng);
    }
    scattered * arriving * incident.irradiance / (equiangular.pdf(distance) * chosen.probability)
}
