//! Connections from a path to the lights.

use glam::{Vec2, Vec3};

use crate::host::{Medium, Scene};
use crate::light::{Except, Falloff, FromPoint, FromRay, Incident, Light, LightSample, Lights, Source};
use crate::math::Ray;
use crate::phase::deflection;
use crate::sampling::{Generator, mis};
use crate::spectrum::Spectrum;
use crate::transmittance::{Flight, transmittance};
use crate::world::{NearLight, World, short_of_end};

/// How important lights are for next-event estimation at `point`. In the medium, a light's near
/// field is left to [`along`].
#[inline]
fn importance(point: Vec3, in_medium: bool) -> FromPoint {
    FromPoint { except: if in_medium { Except::Near } else { Except::Nothing }, ..FromPoint::all(point) }
}

#[inline]
fn is_near(light: &Light<'_>, point: Vec3) -> bool {
    light.near_field().is_some_and(|field| field.contains(point))
}

/// Density (sr⁻¹) with which connections from a vertex choose and sample the light `index`, where
/// a ray from there meets it: what the weight of that hit is measured against.
///
/// For points in the near field the distance's density is left out on both sides: weights may be
/// any partition of 1.
#[inline]
pub(crate) fn pdf(
    lights: &Lights<'_>,
    index: usize,
    vertex: (Vec3, bool),
    to_light: Vec3,
    distance: f32,
    normal: Vec3,
) -> f32 {
    let (light, (point, in_medium)) = (&lights[index], vertex);
    if in_medium && is_near(light, point) {
        return light.anchor_pdf(point, to_light, distance, normal);
    }
    let pdf = light.pdf(point, to_light, distance, normal);
    if lights.len() == 1 || pdf <= 0.0 {
        return pdf;
    }
    pdf * lights.share(&importance(point, in_medium), index)
}

/// A light chosen and sampled for next-event estimation; `pdf` includes the choice.
#[inline]
pub(super) fn choose(
    lights: &Lights<'_>,
    point: Vec3,
    in_medium: bool,
    choice: f32,
    u: Vec2,
) -> Option<(LightSample, f32)> {
    if let [light] = &lights[..] {
        // What cannot be reached, sampling itself finds out.
        return if in_medium && is_near(light, point) { None } else { Some((light.sample(point, u)?, 1.0)) };
    }
    let chosen = lights.pick(&importance(point, in_medium), choice)?;
    Some((lights[chosen.index].sample(point, u)?, chosen.probability))
}

/// The way from `origin` to a light. A surface point is moved off its surface before, so direction
/// and length are taken anew: otherwise the ray would end as far behind the light's own surface.
#[inline]
fn way(origin: Vec3, point: Vec3, source: &Source, incident: &Incident) -> Ray {
    if origin == point || source.falloff == Falloff::Distant {
        return Ray { origin, direction: incident.to_light, length: incident.distance };
    }
    Ray::between(origin, source.position)
}

/// Transmittance times visibility on the way to a light, 0 or more per channel.
#[inline]
pub(super) fn reach<M: Medium + ?Sized, S: Scene + ?Sized>(
    world: &World<'_, M, S>,
    way: &Ray,
    rng: &mut Generator,
) -> Spectrum {
    if world.scene.is_blocked(&short_of_end(way)) { Spectrum::ZERO } else { transmittance(world.medium, way, rng) }
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
    let Some((sample, probability)) = choose(&world.lights, point, in_medium, random.0, random.1) else {
        return Spectrum::ZERO;
    };
    let incident = sample.incident;
    let (scattered, walk_pdf) = value(incident.to_light);
    if scattered.is_black() {
        return Spectrum::ZERO;
    }
    let weight = if sample.pdf > 0.0 { mis::power(sample.pdf * probability, walk_pdf) } else { 1.0 };
    let way = way(origin(incident.to_light), point, &sample.source, &incident);
    let arriving = reach(world, &way, rng);
    scattered * arriving * incident.irradiance * (weight / probability)
}

/// Light from the near field of a light, scattered towards the eye somewhere along a flight, over
/// the throughput at the flight's start: see [`NearLight`].
///
/// Grey media: the point lies on the part that was flown, whose survival already holds the
/// transmittance. Coloured ones: on the whole segment, with an estimate of the transmittance.
#[inline]
pub(super) fn along<M: Medium + ?Sized, S: Scene + ?Sized>(
    world: &World<'_, M, S>,
    segment: &Ray,
    flight: &Flight,
    random: (f32, f32, Vec2),
    rng: &mut Generator,
) -> Option<Spectrum> {
    let flown = world.medium.is_grey();
    let (near, far) = (flight.span.0, if flown { flight.span.1 } else { segment.length });
    let lights = &world.lights;
    let (light, probability) = if let [light] = &lights[..] {
        (light, 1.0)
    } else {
        let sent = FromRay { ray: *segment, near, far, steep: false, until: None };
        let chosen = lights.pick(&sent, random.0)?;
        (&lights[chosen.index], chosen.probability)
    };
    let light = NearLight::of(light, segment, near, far)?;
    let joint = light.join(segment, random.1, random.2)?;
    let LightSample { incident, pdf, .. } = joint.light(|| random.2)?;
    let properties = world.medium.properties(joint.point);
    let deflection = deflection(incident.to_light, -segment.direction);
    let scattered = properties.scattering * properties.phase.value(deflection);
    if scattered.is_black() {
        return None;
    }
    let weight = if pdf > 0.0 { mis::power(pdf, properties.phase.pdf(deflection)) } else { 1.0 };
    let way = Ray { origin: joint.point, direction: incident.to_light, length: incident.distance };
    let mut arriving = reach(world, &way, rng);
    if arriving.is_black() {
        return None;
    }
    if !flown {
        arriving *= transmittance(world.medium, &segment.with_length(joint.distance), rng);
    }
    Some(scattered * arriving * incident.irradiance * (weight / (joint.pdf * probability)))
}
