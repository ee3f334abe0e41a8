//! The walk of a photon.

use super::Event;
use crate::host::{Hit, Medium, Rng, Scene};
use crate::math::{Bounds, Ray, Vec3};
use crate::path::Settings;
use crate::sampling::{Generator, uniform, uniform2};
use crate::spectrum::Spectrum;
use crate::surface::SurfaceSample;
use crate::transmittance::flight;
use crate::world::{World, leave, nearest_surface};

/// A walk longer than this ends: a guard against worlds that absorb nothing.
const MAX_SEGMENTS: u32 = 100_000;

/// Parts of a photon that wait while another flies. Fewer: those of much power stay whole.
const MOST_WAITING: usize = 64;

/// Parts into which a photon splits at once.
const MOST_PARTS: usize = 8;

/// Power over what is wanted below which roulette is played for a part. Larger: chance is spent twice, on ending parts and on splitting what is left.
const LEAST_POWER: f32 = 0.5;

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
/// * Where extinction is coloured, `power` along a flight is what [`for_each_piece`](super::for_each_piece) tells.
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
    walk(world, bounds, (settings, None), &mut &mut *rng, visit);
}

/// Sends one photon as [`trace()`] does, split where photons are wanted and ended where there are enough: by weight windows (Booth and Hendricks 1984).
///
/// `window` is what power photons should have at a point, over what they have as they leave a light; `None`, or what is no positive number, where that is not known: there
/// roulette is as [`trace()`] plays it, for what was wanted where they came from. Of at least twice the power, parts go on (up to eight), which leave the vertex the same way and
/// meet chances of their own; of less than half, roulette keeps that power. Sums over events stay unbiased whatever the windows. Where photons rarely come, few of much power say as little as
/// they are: windows in proportion to the light of a place bring as many everywhere. After `Emitted` come the events of all parts, one part after the other.
///
/// ```
/// # use fogbow::{host::Empty, light::{Light, PointLight}, math::*, medium::Homogeneous, phase::Lobe};
/// # use fogbow::{path::Settings, photon::{self, Event}, sampling::Generator, spectrum::Spectrum, world::World};
/// // Fog that absorbs half: photons that come far keep the half and meet it twice as often.
/// let fog = Homogeneous::new(Spectrum::ONE, Spectrum::ONE, Lobe::Isotropic)?;
/// let lamps = [Light::Point(PointLight::from_flux(Vec3::ZERO, Spectrum::ONE)?)];
/// let world = World { medium: &fog, scene: &Empty, lights: (&lamps).into() };
/// let bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
/// let window = |at: Vec3| Some((-at.length()).exp());
/// let (mut rng, mut absorbed, mut collisions) = (Generator::new(1), 0.0, 0);
/// for _ in 0..2000 {
///     photon::trace_split(&world, &bounds, &Settings::default(), &window, &mut rng, &mut |event| {
///         if let Event::Collided { power, .. } = event {
///             (absorbed, collisions) = (absorbed + 0.5 * power[0] / 2000.0, collisions + 1);
///         }
///     });
/// }
/// assert!((absorbed - 1.0).abs() < 0.05 && collisions > 3 * 2000, "{absorbed} {collisions}");
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
pub fn trace_split<M: Medium + ?Sized, S: Scene + ?Sized>(
    world: &World<'_, M, S>,
    bounds: &Bounds,
    settings: &Settings,
    window: &dyn Fn(Vec3) -> Option<f32>,
    rng: &mut (impl Rng + ?Sized),
    visit: &mut impl FnMut(&Event<'_>),
) {
    walk(world, bounds, (settings, Some(window)), &mut &mut *rng, visit);
}

/// What power photons should have at a point, over what they have as they leave a light.
type Window<'a> = dyn Fn(Vec3) -> Option<f32> + 'a;

/// What of a photon is still to fly.
struct Part {
    ray: Ray,
    power: Spectrum,
    scatterings: u32,
    /// What power it should have, over that of the whole as it left the light.
    wanted: f32,
}

/// One for all who listen, because it is long.
fn walk<M: Medium + ?Sized, S: Scene + ?Sized>(
    world: &World<'_, M, S>,
    bounds: &Bounds,
    (settings, window): (&Settings, Option<&Window<'_>>),
    rng: &mut dyn Rng,
    visit: &mut dyn FnMut(&Event<'_>),
) {
    let choice = uniform(rng);
    let (position, direction) = (uniform2(rng), uniform2(rng));
    if settings.max_scatterings == 0 {
        return;
    }
    let Some(chosen) = world.lights.emitting(bounds, choice) else { return };
    let Some(emission) = world.lights[chosen.index].emit(bounds, position, direction) else { return };
    let power = emission.power * (1.0 / chosen.probability);
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

    let mut waiting = heapless::Vec::<Part, MOST_WAITING>::new();
    let mut part = Part { ray, power, scatterings: 0, wanted: 1.0 };
    let mut segments = 0;
    loop {
        let Part { ray, power, scatterings, .. } = part;
        // Of a walk without end no more parts.
        let window = window.filter(|_| segments < MAX_SEGMENTS);
        // As far as the point that is met, rounded, lies along the ray.
        let along = |hit: Hit| Hit { distance: (ray.at(hit.distance) - ray.origin).dot(ray.direction).max(0.0), ..hit };
        let hit = nearest_surface(&ray, world.scene).map(along);
        let reach = hit.map_or(ray, |hit| ray.with_length(hit.distance));
        let u_distance = uniform(rng);
        let mut child = Generator::new(u64::from(rng.next_u32()) | u64::from(scatterings) << 32);
        let lobe_choice = uniform(rng);
        let lobe_u = uniform2(rng);
        let survival = uniform(rng);
        // As many as segments before: every segment but the last ends in one.
        let is_last = scatterings + 1 >= settings.max_scatterings.min(MAX_SEGMENTS);

        let flown = flight(world.medium, &reach, power, u_distance, &mut child);
        visit(&Event::Flew { reach: &reach, distance: flown.distance, power });
        let arrived = power * flown.weight;
        let asked = window.and_then(|window| window(reach.at(flown.distance)));
        // Anything else would end photons, or split them, for nothing.
        let asked = asked.filter(|asked| asked.is_finite() && *asked > 0.0);
        let wanted = asked.unwrap_or(part.wanted);
        let over = |power: Spectrum| power.max_element() / (usual * wanted);
        // Whether the walk goes on with `after`, and with what power.
        let roulette = |after: Spectrum| {
            if is_last || after.is_black() {
                return None;
            }
            if scatterings + 1 < settings.roulette_after {
                return Some(after);
            }
            let survives = match over(after) {
                over if asked.is_none() => over.min(MAX_SURVIVAL),
                over if over < LEAST_POWER => over,
                _ => return Some(after),
            };
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
        segments += 1;
        if let Some((power, ray)) = next {
            // Casts saturate, and take NaN to 0.
            let most = asked.map_or(1, |_| MOST_PARTS.min(MOST_WAITING - waiting.len() + 1));
            let parts = (over(power) as usize).clamp(1, most);
            let power = power * (1.0 / parts as f32);
            let part_of = || Part { ray, power, scatterings: scatterings + 1, wanted };
            // There is room for them.
            waiting.extend((1..parts).map(|_| part_of()));
            part = part_of();
        } else {
            let Some(next) = waiting.pop() else { return };
            part = next;
        }
    }
}

/// What a surface does to power, where a [`SurfaceSample`] says what it does to radiance.
#[inline]
fn weight_of_power(hit: &Hit, sample: &SurfaceSample, to_eye: Vec3) -> Spectrum {
    let weight = hit.surface.power_weight(hit.shading, to_eye, sample);
    if hit.shading == hit.normal {
        return weight;
    }
    // The adjoint: see `Hit::power_factor`.
    let going = hit.power_factor(sample.to_light);
    weight * if going > 0.0 { (hit.power_factor(to_eye) / going).min(MOST_POWER) } else { 0.0 }
}
