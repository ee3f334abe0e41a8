//! Light of virtual lights at a point, and what compensation adds.

use super::bound::Bound;
use super::compensate::{Compensation, next_vertex};
use super::light::VirtualLight;
use super::scatterer::{Receiver, Scatterer};
use crate::host::{Hit, Medium, Scene};
use crate::math::{Ray, float};
use crate::path;
use crate::sampling::{Generator, uniform, uniform2};
use crate::spectrum::Spectrum;
use crate::transmittance::transmittance;
use crate::world::{World, leave, nearest_surface};

/// Steps of compensation that are told apart; what later ones add goes to the last.
pub const LEVELS: usize = 4;

/// Vertices of a compensation path after which roulette keeps it short.
const ROULETTE_AFTER: u32 = 4;

/// No compensation path is longer: the guard of those without limit.
const MAX_STEPS: u32 = 1000;

/// What is gathered, by how it was found; in a medium per metre, W·m⁻³·sr⁻¹, else W·m⁻²·sr⁻¹.
///
/// ```
/// # use fogbow::{spectrum::Spectrum, vpl::GatheredVpls};
/// let one = Spectrum::ONE;
/// let found = GatheredVpls { clamped: one, compensated: [one * 0.5, one * 0.25, one * 0.0, one * 0.0], ..GatheredVpls::default() };
/// assert_eq!(found.total(), one * 1.75);
/// let mut mean = GatheredVpls::default();
/// mean.add(&found, one * 0.5);
/// mean.add(&GatheredVpls::default(), one * 0.5);
/// assert_eq!(mean.total(), one * 0.875);   // over both samples
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct GatheredVpls {
    /// Of the virtual lights, clamped.
    pub clamped: Spectrum,
    /// What each step of compensation adds.
    pub compensated: [Spectrum; LEVELS],
    /// Of that, light that comes straight from the lights to a vertex: the part that needs no virtual light.
    pub straight: Spectrum,
    /// Light that comes by way of mirrors and glass, where no virtual light can be seen from.
    pub mirrored: Spectrum,
}

impl GatheredVpls {
    /// All of it.
    #[inline]
    #[must_use]
    pub fn total(&self) -> Spectrum {
        self.clamped + self.mirrored + self.compensated.into_iter().sum()
    }

    /// Adds `other`, times `weight`.
    #[inline]
    pub fn add(&mut self, other: &Self, weight: Spectrum) {
        self.clamped += other.clamped * weight;
        self.mirrored += other.mirrored * weight;
        self.straight += other.straight * weight;
        for (sum, part) in self.compensated.iter_mut().zip(other.compensated) {
            *sum += part * weight;
        }
    }

    #[inline]
    fn add_step(&mut self, step: u32, light: Spectrum) {
        self.compensated[(step as usize).clamp(1, LEVELS) - 1] += light;
    }
}

/// Gathers at points: the world, and how.
///
/// ```
/// # use fogbow::{host::{Empty, Medium}, math::{Vec3, float::INV_FOUR_PI}, medium::Homogeneous, phase::Phase};
/// # use fogbow::{sampling::Generator, spectrum::Spectrum};
/// # use fogbow::vpl::{Bound, Compensation, Gatherer, Receiver, VirtualLight};
/// # use fogbow::world::World;
/// // Thin fog, and a virtual light of 1 W at half the distance within which connections are clamped.
/// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::splat(1e-3), Phase::ISOTROPIC)?;
/// let world = World { medium: &fog, scene: &Empty, lights: (&[]).into() };
/// let bound = Bound::within(2.0)?;
/// let gatherer = Gatherer { world, bound, compensation: Some(Compensation::FULL), has_mirrors: false };
/// let receiver = Receiver::in_medium(Vec3::ZERO, Vec3::Z, &fog.properties(Vec3::ZERO)).unwrap();
/// let light = VirtualLight::in_medium(Vec3::X, Vec3::X, Spectrum::ONE, 1, &Phase::ISOTROPIC);
/// let mut rng = Generator::new(1);
/// let seen = gatherer.connected(&receiver, &light, &mut rng);
/// assert!((seen[0] / (1e-3 * INV_FOUR_PI * INV_FOUR_PI * 0.25) - 1.0).abs() < 0.01);   // b = ¼ m⁻², not 1/r² = 1 m⁻²
/// let gathered = gatherer.gather(&receiver, &[light], u32::MAX, &mut rng);
/// assert_eq!(gathered.clamped, seen);
/// assert_eq!(gatherer.of_the_lights(&receiver, 8, &mut rng).total(), Spectrum::ZERO);   // this world has none
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Gatherer<'a, M: ?Sized, S: ?Sized> {
    /// Medium, surfaces, lights.
    pub world: World<'a, M, S>,
    /// By which connections are clamped.
    pub bound: Bound,
    /// How what is lost is found again; `None` leaves it lost.
    pub compensation: Option<Compensation>,
    /// Whether the world has mirrors or glass. If not, no rays look for them.
    pub has_mirrors: bool,
}

impl<M: ?Sized, S: ?Sized> Clone for Gatherer<'_, M, S> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<M: ?Sized, S: ?Sized> Copy for Gatherer<'_, M, S> {}

impl<M: Medium + ?Sized, S: Scene + ?Sized> Gatherer<'_, M, S> {
    /// What one virtual light, clamped, makes `receiver` send to the eye: `E_k` of the sheet's § 3.2.
    #[inline]
    pub fn connected(&self, receiver: &Receiver, light: &VirtualLight, rng: &mut Generator) -> Spectrum {
        let Some(connection) = light.connect(receiver) else { return Spectrum::ZERO };
        if self.world.scene.is_blocked(&connection.shadow_ray()) {
            return Spectrum::ZERO;
        }
        connection.radiance(self.bound, transmittance(self.world.medium, &connection.way, rng))
    }

    fn sum(&self, receiver: &Receiver, lights: &[VirtualLight], most: u32, rng: &mut Generator) -> Spectrum {
        let lights = lights.iter().filter(|light| light.scatterings <= most);
        lights.map(|light| self.connected(receiver, light, rng)).sum()
    }

    /// Follows a compensation path from `receiver` and calls `visit(step, vertex, weight)` for each of its vertices, the
    /// first of which is step 1; at most `most` of them.
    fn compensate(
        &self,
        receiver: &Receiver,
        most: u32,
        rng: &mut Generator,
        mut visit: impl FnMut(u32, &Receiver, Spectrum, &mut Generator),
    ) {
        let Some(compensation) = self.compensation else { return };
        let (mut at, mut weight) = (*receiver, Spectrum::ONE);
        for step in 1..=compensation.steps.min(most).min(MAX_STEPS) {
            let Some((next, factor)) = next_vertex(&self.world, &at, self.bound, &compensation, rng) else { return };
            weight *= factor;
            if step > ROULETTE_AFTER {
                let survives = self.strength(&next, weight).min(1.0);
                if uniform(rng) >= survives {
                    return;
                }
                weight *= 1.0 / survives;
            }
            visit(step, &next, weight, rng);
            at = next;
        }
    }

    /// What is left of a path: its weight times the next vertex's albedo, about.
    fn strength(&self, vertex: &Receiver, weight: Spectrum) -> f32 {
        let share = match vertex.scatterer {
            Scatterer::Medium { scattering, .. } => scattering * self.bound.radius(),
            Scatterer::Surface { surface, .. } => surface.albedo(),
        };
        (weight * share).max_element()
    }

    /// What `lights` make `receiver` send to the eye, with what compensation adds for them; of light that was scattered
    /// `most` times at most before it comes to the receiver.
    ///
    /// Groups of [`Compensation::lights_per_path`] lights share a compensation path. Light that comes straight
    /// from the lights to a vertex is not in here: see [`Self::of_the_lights`].
    ///
    /// ```text
    /// Q_k(y) = K_B [E_k + Q_k]
    /// ```
    pub fn gather(&self, receiver: &Receiver, lights: &[VirtualLight], most: u32, rng: &mut Generator) -> GatheredVpls {
        let mut gathered = GatheredVpls { clamped: self.sum(receiver, lights, most, rng), ..GatheredVpls::default() };
        let Some(compensation) = self.compensation else { return gathered };
        for group in lights.chunks(compensation.lights_per_path.max(1) as usize) {
            // No vertex sees light that has been scattered before.
            let first = group.iter().map(|light| light.scatterings).min().unwrap_or(u32::MAX);
            self.compensate(receiver, most.saturating_sub(first), rng, |step, vertex, weight, rng| {
                gathered.add_step(step, weight * self.sum(vertex, group, most - step, rng));
            });
        }
        gathered
    }

    /// The part of compensation that needs no virtual lights, along one path: light that comes to its vertices straight
    /// from the lights; and light by way of mirrors and glass, to the receiver and to the vertices. Needed once for a
    /// point, however many lights there are.
    ///
    /// ```text
    /// P(y) = K_B [D + P]
    /// ```
    pub fn of_the_lights(&self, receiver: &Receiver, most: u32, rng: &mut Generator) -> GatheredVpls {
        let mut gathered = GatheredVpls { mirrored: self.mirrored(receiver, most, rng), ..GatheredVpls::default() };
        self.compensate(receiver, most, rng, |step, vertex, weight, rng| {
            let light = self.direct(vertex, rng) + self.mirrored(vertex, most - step, rng);
            gathered.straight += weight * light;
            gathered.add_step(step, weight * light);
        });
        gathered
    }

    /// Light of the lights that `receiver` sends to the eye, by connections.
    fn direct(&self, receiver: &Receiver, rng: &mut Generator) -> Spectrum {
        let (to_eye, scatterer) = (receiver.to_eye, &receiver.scatterer);
        let origin = |to_light| receiver.origin(to_light);
        let value = |to_light| scatterer.value(to_eye, to_light) * scatterer.cosine(to_light);
        path::direct(&self.world, receiver.point, origin, value, rng)
    }

    /// Light that comes to `receiver` from mirrors and glass, by a path.
    fn mirrored(&self, receiver: &Receiver, most: u32, rng: &mut Generator) -> Spectrum {
        if !self.has_mirrors || most == 0 {
            return Spectrum::ZERO;
        }
        let (choice, u) = (uniform(rng), uniform2(rng));
        let Some((direction, scattered)) = receiver.scatterer.sample(receiver.to_eye, choice, u) else {
            return Spectrum::ZERO;
        };
        let way = Ray::new(receiver.origin(direction), direction);
        let Some(hit) = nearest_surface(&way, self.world.scene).filter(|hit| hit.surface.is_followed()) else {
            return Spectrum::ZERO;
        };
        if !hit.surface.is_discrete() {
            return self.followed(&way, &hit, scattered / receiver.scatterer.unit(), most, rng)
                * receiver.scatterer.unit();
        }
        let Some(sample) = hit.sample(-direction, uniform(rng), uniform2(rng)) else {
            return Spectrum::ZERO;
        };
        let reach = transmittance(self.world.medium, &way.with_length(hit.distance), rng);
        let weight = scattered * reach * sample.weight;
        // Roulette: what is dim need not be followed. A coefficient per metre says nothing of that.
        let survives = float::min((weight / receiver.scatterer.unit()).max_element(), 1.0);
        if !(survives > 0.0) || uniform(rng) >= survives {
            return Spectrum::ZERO;
        }
        let origin = leave(way.at(hit.distance), hit.normal, sample.to_light, hit.distance);
        let settings = path::Settings { max_scatterings: most - 1, ..path::Settings::default() };
        let seen = path::radiance(&Ray::new(origin, sample.to_light), &self.world, &settings, rng);
        weight * seen.total() * (1.0 / survives)
    }

    /// Light that a surface with lobes sends back along `way`, but for its own emission, times `weight`: by a path, with
    /// connections from the surface to the lights.
    fn followed(&self, way: &Ray, hit: &Hit, weight: Spectrum, most: u32, rng: &mut Generator) -> Spectrum {
        let weight = weight * transmittance(self.world.medium, &way.with_length(hit.distance), rng);
        let survives = float::min((weight * hit.surface.albedo()).max_element(), 1.0);
        if !(survives > 0.0) || uniform(rng) >= survives {
            return Spectrum::ZERO;
        }
        let origin = leave(way.at(hit.distance), hit.normal, -way.direction, hit.distance);
        let settings = path::Settings { max_scatterings: most, ..path::Settings::default() };
        let seen = path::radiance(&Ray::new(origin, way.direction), &self.world, &settings, rng);
        weight * (seen.total() - seen.emitted) * (1.0 / survives)
    }
}
