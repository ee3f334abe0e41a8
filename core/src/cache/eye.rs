//! Eye rays: where they go, and what they meet.

use glam::{Vec2, Vec3};

use crate::host::{Hit, Medium, Properties, Rng, Scene};
use crate::light::{Light, Lights};
use crate::march::scattering_points;
use crate::math::Ray;
use crate::path::connection_pdf;
use crate::sampling::{mis, uniform, uniform2};
use crate::spectrum::Spectrum;
use crate::surface::{Surface, lambert};
use crate::transmittance::thickness::{Marching, transmittance, until_the_end};
use crate::world::{MAX_INTERFACES, World, beyond, leave};

/// Mirrors and panes of glass an eye ray follows: a hall of mirrors must end.
const MAX_BOUNCES: u32 = 32;

/// How far rays are followed, and with how many points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RaySettings {
    /// Points per sample on a ray through opaque fog: see [`scattering_points`].
    pub density: f32,
    /// Connections per segment of a ray to lights in whose near field it runs; as many, but four at most, from a surface where there are several lights. Of more than eight
    /// lights, several times as many are tried, from points in the medium as well, and as many as both together are followed (32 and 4 at most).
    pub connections: u32,
    /// Parts of a single light with extent that each surface looks at, four at most. More: less noise in each sample where smoke hides some parts and not others, for a connection each.
    pub lamp_parts: u32,
    /// Whether eye rays see area lights and the environment.
    pub lights_visible: bool,
    /// Whether light is followed beyond its first scattering.
    pub indirect: bool,
}

impl Default for RaySettings {
    /// Eight points where fog is opaque, eight connections to near lights, lamps as a whole, all light. More of both: less noise in each sample, for
    /// more time; fewer, and samples are spent on rays that bring little.
    fn default() -> Self {
        Self { density: 8.0, connections: 8, lamp_parts: 1, lights_visible: true, indirect: true }
    }
}

/// Eye rays end where less than this of the light beyond would be seen. Larger: glimpses of what is very bright behind dense
/// fog are lost; smaller: more look-ups that nobody sees.
const INVISIBLE: f32 = 1e-5;

/// What an eye ray meets.
pub(super) trait Sight {
    /// A segment of it, and the throughput at its start.
    fn segment(&mut self, _segment: &Ray, _throughput: Spectrum) {}
    /// A point in the medium: in-scattered radiance counts by `weight`.
    fn scatter(&mut self, point: Vec3, to_eye: Vec3, properties: &Properties, weight: Spectrum);
    /// A surface that scatters light diffusely or in a lobe: its reflected radiance counts by `weight`.
    fn surface(&mut self, ray: &Ray, hit: &Hit, weight: Spectrum);
    /// Light seen directly.
    fn emitted(&mut self, _light: Spectrum) {}
    /// The same, from lights past no mirror.
    fn straight(&mut self, _light: Spectrum) {}
}

/// How an eye ray came to go where it goes: what of the light that it runs into is not in a connection.
#[derive(Clone, Copy)]
pub(super) enum Last {
    /// By a mirror, through glass, or from the eye: all.
    Discrete,
    /// From a surface that was connected to all lights: nothing.
    Connected,
    /// By a lobe with a density (sr⁻¹), from a point: a share, by the power heuristic.
    Lobe {
        /// Where (m).
        point: Vec3,
        /// Density.
        pdf: f32,
    },
}

impl Last {
    fn distance(&self, to: Vec3) -> f32 {
        if let Self::Lobe { point, .. } = self { point.distance(to) } else { 0.0 }
    }

    /// Of the radiance of a light met at a distance (m) with a normal, what counts here.
    fn share(
        &self,
        radiance: Spectrum,
        lights: &Lights<'_>,
        index: usize,
        direction: Vec3,
        (distance, normal): (f32, Vec3),
    ) -> Spectrum {
        match *self {
            _ if radiance.is_black() => radiance,
            Self::Discrete => radiance,
            Self::Connected => Spectrum::ZERO,
            Self::Lobe { point, pdf } => {
                radiance * mis::power(pdf, connection_pdf(lights, index, (point, false), direction, distance, normal))
            }
        }
    }

    /// What counts of the lights at infinity, with factors on suns and on skies.
    #[inline(never)]
    fn distant(&self, lights: &Lights<'_>, direction: Vec3, (of_suns, of_skies): (Spectrum, Spectrum)) -> Spectrum {
        let of = |(index, light): (usize, &Light<'_>)| {
            let factor = if light.is_sky() { of_skies } else { of_suns };
            factor * self.share(light.background(direction), lights, index, direction, (f32::INFINITY, Vec3::ZERO))
        };
        lights.distant().map(of).sum()
    }

    /// What counts of the light of a surface that is met at a point, if it is one.
    #[inline(never)]
    fn met(&self, lights: &Lights<'_>, hit: &Hit, point: Vec3, direction: Vec3) -> Spectrum {
        let index = hit.light.map_or(usize::MAX, |index| index as usize);
        let Some(light) = lights.get(index) else { return Spectrum::ZERO };
        let radiance = light.radiance(point, hit.normal, -direction);
        self.share(radiance, lights, index, direction, (self.distance(point), hit.normal))
    }
}

/// Follows an eye ray through the medium and past mirrors and glass.
pub(super) fn look<M: Medium + ?Sized, S: Scene + ?Sized>(
    ray: &Ray,
    world: &World<'_, M, S>,
    settings: &RaySettings,
    rng: &mut (impl Rng + ?Sized),
    sight: &mut impl Sight,
) {
    // Of what lights send straight on, and of all else: what a diffuse base reflects of that is known.
    let (mut of_lights, mut throughput) = (Spectrum::ONE, Spectrum::ONE);
    // Until the first real scattering lights may be hidden; after a lobe they were connected to, but for a part.
    let (mut lights_visible, mut last) = (settings.lights_visible, Last::Discrete);
    let mut bounced = false;
    let mut ray = *ray;
    let (mut bounces, mut interfaces) = (0, 0);
    while bounces < MAX_BOUNCES && interfaces <= MAX_INTERFACES {
        let hit = world.scene.closest_hit(&ray);
        let segment = hit.map_or(ray, |hit| ray.with_length(hit.distance));
        let (u, jitter, choice) = (uniform(rng), uniform(rng), uniform(rng));
        let turn = uniform2(rng);
        let to_eye = -ray.direction;
        // Behind a mirror, direct light has been scattered twice.
        let scatters = settings.indirect || !bounced;
        if scatters {
            sight.segment(&until_the_end(&segment, world.medium), throughput);
        }
        let seen = scattering_points(&segment, world.medium, settings.density, u, jitter, |t, properties, weight| {
            if scatters && !properties.scattering.is_black() {
                sight.scatter(segment.at(t), to_eye, properties, throughput * weight * properties.scattering);
            }
        });
        sight.emitted(throughput * seen.radiance);
        (of_lights, throughput) = (of_lights * seen.transmittance, throughput * seen.transmittance);
        if strength(throughput, of_lights) < INVISIBLE {
            return;
        }
        let Some(hit) = hit else {
            if lights_visible {
                let light = last.distant(&world.lights, ray.direction, (of_lights, throughput));
                if bounces == 0 { sight.straight(light) } else { sight.emitted(light) }
            }
            return;
        };
        let hidden = !lights_visible && hit.light.is_some();
        let point = segment.at(hit.distance);
        if !hidden && hit.light.is_some() {
            let light = of_lights * last.met(&world.lights, &hit, point, ray.direction);
            if bounces == 0 { sight.straight(light) } else { sight.emitted(light) }
        }
        if hidden || hit.surface == Surface::Null {
            ray = beyond(&ray, &hit);
            interfaces += 1;
            continue;
        }
        if scatters && !hit.surface.is_discrete() {
            sight.surface(&segment, &hit, throughput);
        }
        if matches!(hit.surface, Surface::Lambert { .. }) {
            return;
        }
        let base = if settings.indirect { known_base(&hit, to_eye) } else { Spectrum::ZERO };
        let Some(onward) = Onward::draw((point, &hit, to_eye), base, choice, turn) else { return };
        // Without indirect light only what mirrors show of lights is seen, and that once.
        if !settings.indirect && (bounced || !hit.surface.is_followed()) {
            return;
        }
        (lights_visible, bounced, last) = (true, true, onward.last);
        (of_lights, throughput) = (throughput * onward.of_lights, throughput * onward.rest);
        if !base.is_black() {
            // Most is known already.
            let survives = (2.0 * strength(throughput, of_lights)).min(1.0);
            if uniform(rng) >= survives {
                return;
            }
            (throughput, of_lights) = (throughput / survives, of_lights / survives);
        }
        (ray, bounces, interfaces) = (onward.ray, bounces + 1, 0);
    }
}

/// Where a ray goes on from a surface of which some light is known.
pub(super) struct Onward {
    /// The ray.
    pub(super) ray: Ray,
    /// How it came there.
    pub(super) last: Last,
    /// Factor on what lights send straight along it.
    pub(super) of_lights: Spectrum,
    /// Factor on all else: without what a diffuse base reflects, if that is known.
    pub(super) rest: Spectrum,
}

impl Onward {
    /// `base` is the albedo of the base whose light is known. `None` where nothing is sent on.
    pub(super) fn draw(
        (point, hit, to_eye): (Vec3, &Hit, Vec3),
        base: Spectrum,
        choice: f32,
        turn: Vec2,
    ) -> Option<Self> {
        let drawn = if base.is_black() { *hit } else { Hit { surface: hit.surface.without_base(), ..*hit } };
        let sample = drawn.sample(to_eye, choice, turn)?;
        let last = match sample.pdf {
            _ if !hit.surface.is_followed() => Last::Connected,
            0.0 => Last::Discrete,
            pdf => Last::Lobe { point, pdf },
        };
        let mut rest = sample.weight;
        if !base.is_black() && sample.pdf > 0.0 {
            let known = if hit.faces(sample.to_light) { lambert::value(base) } else { Spectrum::ZERO };
            let value = hit.value(to_eye, sample.to_light) - known;
            rest = value * (hit.cosine(sample.to_light).abs() / sample.pdf);
        }
        // Between curved mirrors what a direction is longer or shorter than 1 by grows with every bounce.
        let to_light = sample.to_light.normalize();
        let ray = Ray::new(leave(point, hit.normal, to_light, hit.distance), to_light);
        Some(Self { ray, last, of_lights: sample.weight, rest })
    }

    /// Light that comes straight along the ray from lights and a sky.
    pub(super) fn straight<M: Medium + ?Sized, S: Scene + ?Sized>(
        &self,
        world: &World<'_, M, S>,
        marching: Marching,
    ) -> Spectrum {
        straight(&self.ray, world, marching, (self.last, self.of_lights, self.rest))
    }
}

/// The albedo of a surface's diffuse base that an eye sees: what it reflects of indirect light is looked up.
pub(super) fn known_base(hit: &Hit, to_eye: Vec3) -> Spectrum {
    if hit.faces(to_eye) { hit.surface.base(hit.shading, to_eye) } else { Spectrum::ZERO }
}

/// The largest channel of either, of whatever sign.
fn strength(a: Spectrum, b: Spectrum) -> f32 {
    let of = |spectrum: Spectrum| spectrum.map(f32::abs).max_element();
    of(a).max(of(b))
}

/// Light that comes straight along a ray from lights and a sky, through the medium and past null interfaces: of how it came there, with factors on that of lights and of skies.
#[inline(never)]
pub(super) fn straight<M: Medium + ?Sized, S: Scene + ?Sized>(
    ray: &Ray,
    world: &World<'_, M, S>,
    marching: Marching,
    (last, of_lights, of_skies): (Last, Spectrum, Spectrum),
) -> Spectrum {
    let (mut rest, mut sum) = (*ray, Spectrum::ZERO);
    if matches!(last, Last::Connected) {
        return sum;
    }
    for _ in 0..=MAX_INTERFACES {
        let hit = world.scene.closest_hit(&rest);
        let light = match &hit {
            None => last.distant(&world.lights, ray.direction, (of_lights, of_skies)),
            Some(hit) => of_lights * last.met(&world.lights, hit, rest.at(hit.distance), ray.direction),
        };
        if !light.is_black() {
            // Most rays meet no light, and need none of this.
            let end = hit.as_ref().map_or(rest.length, |hit| rest.at(hit.distance).distance(ray.origin));
            sum += light * transmittance(&ray.with_length(end), world.medium, marching);
        }
        match &hit {
            Some(hit) if hit.surface == Surface::Null => rest = beyond(&rest, hit),
            _ => break,
        }
    }
    sum
}
