//! The walk of a photon.

use super::Event;
use crate::host::{Hit, Medium, Rng, Scene};
use crate::math::{Bounds, Ray};
use crate::path::Settings;
use crate::sampling::{Generator, uniform, uniform2};
use crate::spectrum::Spectrum;
use crate::surface::SurfaceSample;
use crate::transmittance::flight;
use crate::world::{World, leave, nearest_surface};

/// A walk longer than this ends: a guard against worlds that absorb nothing.
const MAX_SEGMENTS: u32 = 100_000;

/// Largest probability of going on where roulette is played. Larger: walks in worlds without absorption
/// take longer to end. Smaller: their powers spread.
const MAX_SURVIVAL: f32 = 0.99;

/// Largest factor of the adjoint at a shading normal. Larger: photons that graze a triangle may become as bright as a lamp. Smaller: light
/// is lost; of what arrives at grazing angles alone, a part in ten thousand at this.
const MOST_POWER: f32 = 100.0;

/// Sends one photon from the lights through the world and tells `visit` what happens to it.
///
/// A light is chosen in proportion to its [power](crate::light::Light::power), a ray drawn by
/// [`Light::emit`](crate::light::Light::emit); collisions come by delta tracking, powers are multiplied by
/// albedos, and after [`Settings::roulette_after`] scatterings roulette keeps them near what was emitted.
/// Sums over events of N walks, divided by N, are unbiased:
///
/// ```text
/// ∫ f Φ dV  =  E Σ_flights power ∫₀^distance f dt  =  E Σ_collisions power f/σₜ        Φ fluence (W·m⁻²)
/// ```
///
/// * Light that is scattered to an eye at the end of a flight was scattered at most
///   [`Settings::max_scatterings`] times: a walk has fewer scatterings by one, and with 0 there is none.
/// * Refraction changes radiance by `η²`, but no power; surfaces have geometric normals only, so no other
///   correction is due (Veach 1997, chapter 5).
/// * Null interfaces are passed within one flight. Every vertex draws as many numbers from `rng`.
/// * Glowing media send no photons.
///
/// `bounds` should hold all surfaces and media; by it, distant lights know where to shine.
///
/// ```
/// # use fogbow::{host::Empty, light::{Light, PointLight}, math::*, medium::Homogeneous, phase::Lobe};
/// # use fogbow::{path::Settings, photon::{self, Event}, sampling::Generator, spectrum::Spectrum, world::World};
/// // A lamp in fog that absorbs: of its power, all is absorbed, after 1/σₐ on average.
/// let fog = Homogeneous::new(Spectrum::splat(2.0), Spectrum::ZERO, Lobe::Isotropic)?;
/// let lamps = [Light::Point(PointLight::from_flux(Vec3::ZERO, Spectrum::ONE)?)];
/// let world = World { medium: &fog, scene: &Empty, lights: (&lamps).into() };
/// let bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
/// let (mut rng, mut absorbed, mut length) = (Generator::new(1), 0.0, 0.0);
/// for _ in 0..4000 {
///     photon::trace(&world, &bounds, &Settings::default(), &mut rng, &mut |event: &Event<'_>| match event {
///         Event::Flew { distance, .. } => length += distance / 4000.0,
///         Event::Collided { power, .. } => absorbed += power[0] / 4000.0,
///         _ => {}
///     });
/// }
/// assert!((absorbed - 1.0).abs() < 1e-4 && (length - 0.5).abs() < 0.03);
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
pub fn trace<M: Medium + ?Sized, S: Scene + ?Sized>(
    world: &World<'_, M, S>,
    bounds: &Bounds,
    settings: &Settings,
    rng: &mut (impl Rng + ?Sized),
    visit: &mut impl FnMut(&Event<'_>),
) {
    let choice = uniform(rng);
    let (position, direction) = (uniform2(rng), uniform2(rng));
    if settings.max_scatterings == 0 {
        return;
    }
    let Some(chosen) = world.lights.emitting(bounds, choice) else { return };
    let Some(emission) = world.lights[chosen.index].emit(bounds, position, direction) else { return };
    let mut power = emission.power * (1.0 / chosen.probability);
    if power.is_black() {
        return;
    }
    let mut ray = emission.ray;
    if let Some(normal) = emission.normal {
        ray.origin = leave(ray.origin, normal, ray.direction, 0.0);
    }
    visit(&Event::Emitted { light: chosen.index, ray: &ray, normal: emission.normal, power });
    // Roulette keeps powers near this one.
    let usual = power.max_element();

    // As many as segments before: every segment but the last ends in one.
    for scatterings in 0..MAX_SEGMENTS {
        // As far as the point that is met, rounded, lies along the ray.
        let along = |hit: Hit| Hit { distance: (ray.at(hit.distance) - ray.origin).dot(ray.direction).max(0.0), ..hit };
        let hit = nearest_surface(&ray, world.scene).map(along);
        let reach = hit.map_or(ray, |hit| ray.with_length(hit.distance));
        let u_distance = uniform(rng);
        let mut child = Generator::new(u64::from(rng.next_u32()) | u64::from(scatterings) << 32);
        let lobe_choice = uniform(rng);
        let lobe_u = uniform2(rng);
        let survival = uniform(rng);
        let is_last = scatterings + 1 >= settings.max_scatterings;

        let flown = flight(world.medium, &reach, power, u_distance, &mut child);
        visit(&Event::Flew { reach: &reach, distance: flown.distance, power });
        let arrived = power * flown.weight;
        // Whether the walk goes on with `after`, and with what power.
        let roulette = |after: Spectrum| {
            if is_last || after.is_black() {
                return None;
            }
            if scatterings + 1 < settings.roulette_after {
                return Some(after);
            }
            let survives = (after.max_element() / usual).min(MAX_SURVIVAL);
            (survival < survives).then(|| after * (1.0 / survives))
        };

        let next = if let Some(properties) = flown.collision {
            let point = reach.at(flown.distance);
            let sample = properties.phase.sample(-ray.direction, lobe_u);
            let after = roulette(arrived * properties.albedo() * sample.weight);
            visit(&Event::Collided {
                point,
                incoming: ray.direction,
                properties: &properties,
                power: arrived,
                outgoing: after.map(|_| sample.to_light),
            });
            after.map(|after| (after, Ray::new(point, sample.to_light)))
        } else if let Some(hit) = hit {
            let point = reach.at(hit.distance);
            let to_eye = -ray.direction;
            let sample = hit.sample(to_eye, lobe_choice, lobe_u);
            let after = sample.and_then(|sample| {
                let weight = weight_of_power(&hit, &sample, to_eye);
                Some((roulette(arrived * weight)?, sample.to_light))
            });
            let outgoing = after.map(|(_, outgoing)| outgoing);
            visit(&Event::Met { point, incoming: ray.direction, hit: &hit, power: arrived, outgoing });
            after.map(|(after, outgoing)| (after, Ray::new(leave(point, hit.normal, outgoing, hit.distance), outgoing)))
        } else {
            None
        };
        let Some((after, onward)) = next else { return };
        (power, ray) = (after, onward);
    }
}

/// What a surface does to power, where a [`SurfaceSample`] says what it does to radiance.
#[inline]
fn weight_of_power(hit: &Hit, sample: &SurfaceSample, to_eye: glam::Vec3) -> Spectrum {
    let weight = hit.surface.power_weight(hit.shading, to_eye, sample);
    if hit.shading == hit.normal {
        return weight;
    }
    // The adjoint: see `Hit::power_factor`.
    let going = hit.power_factor(sample.to_light);
    weight * if going > 0.0 { (hit.power_factor(to_eye) / going).min(MOST_POWER) } else { 0.0 }
}
