//! The light that arrives at a probe.

use glam::{Vec2, Vec3};

use super::basis::{AXES, MOST_COEFFICIENTS, Parts, ProbeBasis, Projection, Quantity};
use super::settings::BakeSettings;
use crate::cache::{Basis, Kind, RadianceCaches, Reader, VolumeCache};
use crate::host::{Medium, Scene};
use crate::light::Lights;
use crate::math::Ray;
use crate::math::float::{PI, floor, sqrt};
use crate::path;
use crate::phase::Phase;
use crate::sampling::{Generator, uniform, uniform2, warp};
use crate::single_scatter::lattice;
use crate::spectrum::Spectrum;
use crate::world::World;

/// Points of every light with extent that a pass connects to, spread evenly; of many lights as many connections to all together: next to a lamp, which fills half of what a probe sees, there is as much light as in
/// a thousand probes elsewhere, and photons serve all until the grid as a whole is good. More: shadow rays for less and less noise; fewer: bakes wait for such probes.
const CONNECTIONS: u32 = 16;

/// What knows the light of a probe.
pub(super) struct Sampler<'a, 'c> {
    pub(super) settings: &'a BakeSettings,
    pub(super) caches: Option<&'a RadianceCaches<'c>>,
    /// Whether photons bring all that was scattered before, and light of a sky.
    pub(super) has_photons: bool,
    /// Directions in which light is looked for.
    pub(super) directions: u32,
}

/// The phase function of a probe: that of the medium there, or the usual one beside it.
pub(super) fn phase_at<M: Medium + ?Sized, S: Scene + ?Sized>(
    point: Vec3,
    world: &World<'_, M, S>,
    settings: &BakeSettings,
) -> Phase {
    let properties = world.medium.properties(point);
    if properties.scattering.is_black() { settings.phase } else { properties.phase }
}

impl Sampler<'_, '_> {
    /// Adds to the numbers of a probe at `point`: an estimate from one pass, unbiased but for what caches know; all light but what photons have brought.
    pub(super) fn sample<M: Medium + ?Sized, S: Scene + ?Sized>(
        &self,
        point: Vec3,
        world: &World<'_, M, S>,
        rng: &mut Generator,
        held: &mut [Spectrum],
    ) {
        let BakeSettings { basis, quantity, orders, ref paths, .. } = *self.settings;
        if paths.max_scatterings == 0 {
            return;
        }
        let phase = phase_at(point, world, self.settings);
        let projection = Projection::new(basis, quantity, &phase);
        let mut due = Parts::from(orders);
        if self.has_photons {
            (due.surfaces, due.medium) = (false, false);
        }
        // Records of a medium do not know irradiance.
        if quantity == Quantity::InScattered || basis == ProbeBasis::Fluence {
            due.lights = due.lights && !self.read(Kind::Single, point, held);
            due.surfaces = due.surfaces && !self.read(Kind::Surface, point, held);
            due.medium = due.medium && !self.read(Kind::Multiple, point, held);
        }
        let mut add = |to_light: Vec3, irradiance: Spectrum| projection.add(to_light, irradiance, held);
        let mut even = |lights: Lights<'_>, connections: u32, (first, shift): (f32, Vec2), rng: &mut Generator| {
            let (share, world) = (1.0 / connections as f32, World { lights, ..*world });
            for j in 0..connections {
                // Which light goes by another sequence than where on it.
                let chosen = first + 0.754_877_7 * j as f32;
                let random = (chosen - floor(chosen), lattice(j, connections, shift));
                let (to_light, light) = path::arriving(&world, point, random, rng);
                if !light.is_black() {
                    add(to_light, light * share);
                }
            }
        };
        let mut connect = |lights: Lights<'_>, rng: &mut Generator| {
            let random = (uniform(rng), uniform2(rng));
            if lights.len() > path::FEW {
                even(lights, CONNECTIONS, random, rng);
                return;
            }
            for light in lights.iter() {
                let connections = if light.is_delta() { 1 } else { CONNECTIONS };
                even(core::slice::from_ref(light).into(), connections, random, rng);
            }
        };
        if due.lights {
            world.lights.but_sky().for_each(|lights| connect(lights, rng));
        }
        if due.surfaces {
            let skies = world.lights.iter().filter(|light| light.is_sky());
            skies.for_each(|sky| connect(core::slice::from_ref(sky).into(), rng));
        }
        if paths.max_scatterings == 1 || !(due.surfaces || due.medium) {
            return;
        }
        let count = self.directions;
        let weight = 4.0 * PI / count as f32;
        let shift = uniform2(rng);
        for j in 0..count {
            let to_light = warp::uniform_sphere(lattice(j, count, shift));
            let [surfaces, medium] = self.scattered(&Ray::new(point, to_light), world, rng);
            let of = |light: Spectrum, is_due: bool| if is_due { light } else { Spectrum::ZERO };
            let light = of(surfaces, due.surfaces) + of(medium, due.medium);
            if !light.is_black() {
                add(to_light, light * weight);
            }
        }
    }

    /// Radiance (W·m⁻²·sr⁻¹) at the origin of `ray` from surfaces, but for their own emission, and from the medium.
    fn scattered<M: Medium + ?Sized, S: Scene + ?Sized>(
        &self,
        ray: &Ray,
        world: &World<'_, M, S>,
        rng: &mut Generator,
    ) -> [Spectrum; 2] {
        let paths = self.settings.paths;
        // The probe's own scattering is one of them; what is emitted towards it is left to connections.
        let before = path::Settings { max_scatterings: paths.max_scatterings - 1, lights_visible: true, ..paths };
        let seen = path::radiance(ray, world, &before, rng);
        [seen.surface_direct + seen.surface_indirect, seen.medium_single + seen.medium_multiple]
    }

    /// Adds what caches know of a kind of light; whether they do.
    fn read(&self, kind: Kind, point: Vec3, held: &mut [Spectrum]) -> bool {
        let Some(Reader { cache, reading }) = self.caches.and_then(|caches| caches.volume(kind)) else { return false };
        let mut part = [Spectrum::ZERO; MOST_COEFFICIENTS];
        let part = &mut part[..held.len()];
        let is_known = match self.settings.basis {
            ProbeBasis::SphericalHarmonics { .. } => cache.expansion(point, &reading, part),
            ProbeBasis::Fluence => {
                let is_known = cache.expansion(point, &reading, part);
                // φ = 4π ⟨L_i⟩, and the mean of an expansion is c₀₀/√(4π).
                part[0] *= sqrt(4.0 * PI);
                is_known
            }
            ProbeBasis::AmbientCube => cube(cache, |basis| cache.lookup(point, basis, &reading), part),
        };
        if is_known {
            held.iter_mut().zip(part).for_each(|(sum, part)| *sum += *part);
        }
        is_known
    }
}

/// Looks towards all six directions; whether there was an answer for each.
fn cube(cache: &VolumeCache<'_>, look: impl Fn(&Basis) -> Option<Spectrum>, part: &mut [Spectrum]) -> bool {
    AXES.into_iter().zip(part).all(|(axis, slot)| {
        let known = look(&Basis::new(axis, cache.degree()));
        *slot = known.unwrap_or_default();
        known.is_some()
    })
}
