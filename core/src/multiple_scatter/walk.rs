//! One random walk.

use glam::{Vec2, Vec3};

use super::flight::{Collision, Flown, Lengths, fly, own};
use super::weight::{Shift, Weight};
use crate::host::{Hit, Medium, Properties, Rng, Scene};
use crate::light::{Falloff, Light, sky};
use crate::math::{Ray, float};
use crate::phase::{Phase, deflection};
use crate::sampling::discrete::choose;
use crate::sampling::{Generator, uniform, uniform2, warp};
use crate::single_scatter::{Arrival, Contribution};
use crate::spectrum::{Gradient, Spectrum};
use crate::transmittance::thickness::{
    Marching, Steps, optical_thickness_with_gradients, transmittance_with_gradients, until_the_end,
};
use crate::world::{NearLight, nearest_surface, shadow_ray};

/// Beyond this many distances to the light an endless segment is not sampled equiangularly: 10⁻⁴ of
/// the angle lies there, and `tan` loses its digits.
const ENDLESS: f32 = 1e4;

/// Least probability of survival: below, the weights of the rare survivors show as fireflies.
const MIN_SURVIVAL: f32 = 0.05;

/// How to walk.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Most vertices of a path.
    pub max_vertices: u32,
    /// Vertex (from 1) from which Russian roulette is played with the weight of each step.
    pub roulette_from: u32,
    /// How segments get their lengths.
    pub lengths: Lengths,
    /// How transmittance towards lights and its gradients are marched.
    pub steps: Steps,
    /// Connect one light per vertex, chosen by importance, rather than all.
    pub one_light: bool,
    /// Within this distance (m) of a light without extent the fall-off is held constant. At most
    /// 10⁻³ mean free paths: the loss is about `(2/3) σₛ` times it, relative to first-collision light.
    pub closest: f32,
}

impl Settings {
    /// Walks of up to 64 vertices, tracked, with roulette from the fourth vertex on.
    ///
    /// ```
    /// # use fogbow::{multiple_scatter::{Lengths, Settings}, transmittance::thickness::Steps};
    /// let settings = Settings { max_vertices: 8, ..Settings::new(Steps::Length(0.1)) };
    /// assert_eq!((settings.roulette_from, settings.lengths), (4, Lengths::Tracking));
    /// ```
    #[must_use]
    pub const fn new(steps: Steps) -> Self {
        Self { max_vertices: 64, roulette_from: 4, lengths: Lengths::Tracking, steps, one_light: false, closest: 0.0 }
    }
}

/// What a walk needs of the world.
#[derive(Debug, Clone, Copy)]
pub struct Walk<'a, M: ?Sized, S: ?Sized> {
    /// The medium.
    pub medium: &'a M,
    /// The surfaces.
    pub scene: &'a S,
    /// The lights; a sky ([`Light::is_sky`]) is met by walks that leave the world, all others are connected to.
    pub lights: &'a [Light<'a>],
    /// How to walk.
    pub settings: Settings,
}

/// `D`, the reach of [`Shift`], over the distance of the nearest light of finite size.
const REACH: f32 = 0.5;

/// The light one path brings to its start, over the density of its first direction.
///
/// Without the phase function at the start: that is applied by [`Arrival::scatter`] for one direction, or
/// [`Arrival::scatter_directional`] for all.
pub type Incoming = Arrival;

impl<M: Medium + ?Sized, S: Scene + ?Sized> Walk<'_, M, S> {
    /// One path from `point`; `first` makes its first direction, uniform over the sphere.
    ///
    /// `outgoing(ray, hit)` is the radiance a surface sends back along the ray, as for
    /// [`crate::single_scatter::visit_surfaces`]; it is asked where the walk meets a surface after its first
    /// collision.
    ///
    /// ```
    /// # use fogbow::{host::Empty, light::{Light, PointLight}, math::{Vec2, Vec3}, sampling::{Generator, warp}};
    /// # use fogbow::{multiple_scatter::{Settings, Walk}, spectrum::Spectrum, transmittance::thickness::Steps};
    /// let lights = [Light::Point(PointLight::new(Vec3::Z, Spectrum::ONE).unwrap())];
    /// let settings = Settings::new(Steps::Length(0.1));
    /// let walk = Walk { medium: &Empty, scene: &Empty, lights: &lights, settings };
    /// let first = Vec2::new(0.3, 0.6);
    /// let incoming = walk.path(Vec3::ZERO, first, |_, _| Spectrum::ONE, &mut Generator::new(1));
    /// assert_eq!(incoming.to_light, warp::uniform_sphere(first));
    /// assert_eq!(incoming.irradiance, Spectrum::ZERO);   // in vacuum nothing is scattered on the way
    /// ```
    pub fn path(
        &self,
        point: Vec3,
        first: Vec2,
        outgoing: impl FnMut(&Ray, &Hit) -> Spectrum,
        rng: &mut (impl Rng + ?Sized),
    ) -> Incoming {
        let to_light = warp::uniform_sphere(first);
        let ray = Ray::new(point, to_light);
        let end = nearest_surface(&ray, self.scene);
        let u = uniform(rng);
        let flown = self.first(&ray, end.as_ref(), u, false, rng);
        self.along(ray, end.as_ref(), warp::uniform_sphere_pdf(), flown.collision, outgoing, |_, _, _| None, rng)
    }

    /// The flight on the first segment, on `ray` up to its `end`, decided by `u` in [0, 1); with the thickness of the
    /// whole segment where light comes to its `end`, too (`to_end`).
    ///
    /// ```
    /// # use fogbow::{host::Empty, math::{Ray, Vec3}, medium::Homogeneous, phase::Lobe, sampling::Generator};
    /// # use fogbow::{multiple_scatter::{Settings, Walk}, spectrum::Spectrum, transmittance::thickness::Steps};
    /// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::splat(2.0), Lobe::Isotropic).unwrap();
    /// let settings = Settings::new(Steps::Length(0.1));
    /// let walk = Walk { medium: &fog, scene: &Empty, lights: &[], settings };
    /// let flown = walk.first(&Ray::new(Vec3::ZERO, Vec3::X), None, 0.5, false, &mut Generator::new(1));
    /// let median = flown.collision.unwrap().distance;
    /// assert!((median - core::f32::consts::LN_2 / 2.0).abs() < 1e-6);   // half of all light comes farther
    /// ```
    pub fn first(&self, ray: &Ray, end: Option<&Hit>, u: f32, to_end: bool, rng: &mut (impl Rng + ?Sized)) -> Flown {
        let rng = &mut own(rng);
        let ray = ray.with_length(end.map_or(f32::INFINITY, |hit| hit.distance));
        let marching = self.marching(rng);
        fly(&ray, self.medium, self.settings.lengths, Spectrum::ONE, marching, u, to_end, rng)
    }

    /// Light scattered on a path whose first segment lies on `ray`, up to its `end`, the nearest surface, over
    /// the density `pdf` (sr⁻¹) of its direction: radiance at the ray's origin over `pdf`, and how it
    /// changes as the origin moves and the vertices with it ([`Shift`]). `first` is where [`Walk::first`] ended.
    ///
    /// `known(point, to_eye, properties)` may answer for all light but that straight from the lights walks
    /// connect to (those that are no sky) that is scattered towards `to_eye` at a collision (W·m⁻²·sr⁻¹), with its gradients as the point moves
    /// and as `to_eye` turns: then the path ends there. Other arguments as for [`Walk::path`].
    ///
    /// ```
    /// # use fogbow::{host::Empty, math::{Ray, Vec3, float::PI}, medium::Homogeneous, phase::Lobe, sampling::Generator};
    /// # use fogbow::{multiple_scatter::{Settings, Walk}, single_scatter::Contribution, spectrum::{Gradient, Spectrum}};
    /// # use fogbow::{sampling::warp, transmittance::thickness::Steps};
    /// // Fog that absorbs nothing, where all light is known: 1 from everywhere.
    /// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::splat(2.0), Lobe::Isotropic).unwrap();
    /// let settings = Settings::new(Steps::Length(0.1));
    /// let walk = Walk { medium: &fog, scene: &Empty, lights: &[], settings };
    /// let (ray, mut rng) = (Ray::new(Vec3::ZERO, Vec3::X), Generator::new(1));
    /// let first = walk.first(&ray, None, 0.3, false, &mut rng).collision;
    /// let one = (Contribution { radiance: Spectrum::ONE, gradient: Gradient::ZERO }, Gradient::ZERO);
    /// let dark = |_: &_, _: &_| Spectrum::ZERO;
    /// let pdf = warp::uniform_sphere_pdf();
    /// let incoming = walk.along(ray, None, pdf, first, dark, |_, _, _| Some(one), &mut rng);
    /// assert!((incoming.irradiance[0] - 4.0 * PI).abs() < 1e-4);   // then it is 1 from here, too
    /// ```
    pub fn along(
        &self,
        mut ray: Ray,
        end: Option<&Hit>,
        pdf: f32,
        first: Option<Collision>,
        mut outgoing: impl FnMut(&Ray, &Hit) -> Spectrum,
        mut known: impl FnMut(Vec3, Vec3, &Properties) -> Option<(Contribution, Gradient)>,
        rng: &mut (impl Rng + ?Sized),
    ) -> Incoming {
        let rng = &mut own(rng);
        let mut kappa = Spectrum::splat(1.0 / pdf);
        let mut weight = Weight::ONE;
        let mut total = Incoming {
            to_light: ray.direction,
            irradiance: Spectrum::ZERO,
            gradient: Gradient::ZERO,
            turning: Spectrum::ZERO,
        };
        let mut end = end.copied();
        // The last vertex's direction to the eye and phase function, if that depends on directions.
        let mut bend = None;
        ray.length = end.map_or(f32::INFINITY, |hit| hit.distance);
        let mut collision = first;
        for vertex in 1..=self.settings.max_vertices {
            let reach = self.reach(ray.origin);
            self.near_lights(&ray, end.as_ref(), reach, &weight, bend.as_ref(), kappa, &mut total, rng);
            if vertex > 1 {
                let (lengths, marching, u) = (self.settings.lengths, self.marching(rng), uniform(rng));
                collision = fly(&ray, self.medium, lengths, weight.value * kappa, marching, u, false, rng).collision;
            }
            let Some(Collision { distance, properties, factor, thickness }) = collision else { break };
            let at = ray.at(distance);
            let step = kappa * factor * properties.scattering;
            if step.is_black() || !step.is_finite() {
                break;
            }
            let next = self.medium.gradients(at).scattering;
            let shift = Shift::new(&ray, end.as_ref(), reach, distance);
            weight = bent(&weight, bend.as_ref(), &ray, &shift).advance_by(
                &shift,
                kappa,
                factor,
                &thickness,
                properties.scattering,
                &next,
            );
            if vertex >= self.settings.roulette_from {
                let survival = step.max_element().clamp(MIN_SURVIVAL, 1.0);
                if uniform(rng) >= survival {
                    break;
                }
                weight = weight.scaled(1.0 / survival);
            }
            let to_eye = -ray.direction;
            self.lights_at(at, to_eye, &properties, &weight, &mut total, rng);
            if let Some((light, turned)) = known(at, to_eye, &properties) {
                add(&mut total, weight.turn, &weight.carry_turned(&light, &turned));
                break;
            }

            let turn = properties.phase.sample(to_eye, uniform2(rng));
            kappa = turn.weight;
            bend = (!properties.phase.is_isotropic()).then_some((to_eye, properties.phase));
            ray = Ray { origin: at, direction: turn.to_light, length: f32::INFINITY };
            end = nearest_surface(&ray, self.scene);
            ray.length = end.map_or(f32::INFINITY, |hit| hit.distance);
            let radiance = end.as_ref().map_or_else(|| sky(self.lights, ray.direction), |hit| outgoing(&ray, hit));
            if end.is_none() && radiance.is_black() {
                continue;
            }
            let marching = self.marching(rng);
            let through = || transmittance_with_gradients(&ray, self.medium, marching);
            if let Some(arrival) = Arrival::from_end(&ray, end.as_ref(), radiance, turn.pdf, through) {
                add_scattered(&mut total, &weight, &arrival, to_eye, &properties.phase);
            }
        }
        // A light or a hit within rounding of a vertex may leave the range of f32.
        if !(total.irradiance.is_finite() && total.gradient.is_finite() && total.turning.is_finite()) {
            (total.irradiance, total.gradient, total.turning) = (Spectrum::ZERO, Gradient::ZERO, Spectrum::ZERO);
        }
        total
    }

    /// The reach of [`Shift`] at a point.
    fn reach(&self, point: Vec3) -> f32 {
        let away = |light: &Light<'_>| light.near_field().map(|field| field.centre().distance_squared(point));
        let nearest2 = self.lights.iter().filter_map(away).fold(f32::INFINITY, f32::min);
        REACH * float::sqrt(nearest2)
    }

    #[inline]
    fn marching(&self, rng: &mut Generator) -> Marching {
        Marching { steps: self.settings.steps, offset: uniform(rng) }
    }

    /// Single scattering at a vertex of the lights in whose near field it does not lie.
    fn lights_at(
        &self,
        at: Vec3,
        to_eye: Vec3,
        properties: &Properties,
        weight: &Weight,
        total: &mut Incoming,
        rng: &mut Generator,
    ) {
        let lights = self.lights.iter().filter_map(|light| {
            let near = light.steep_field().is_some_and(|field| field.contains(at));
            (!near && !light.is_sky()).then(|| (light.importance(at), light))
        });
        self.each(lights, rng, |light, share, rng| {
            let mut sample = light.sample(at, uniform2(rng))?;
            sample.source.weight = sample.source.weight / share;
            let arrival = Arrival::from_source(at, self.medium, &sample.source, self.marching(rng), 0.0)?;
            if !self.scene.is_blocked(&shadow_ray(at, &sample.source)) {
                add_scattered(total, weight, &arrival, to_eye, &properties.phase);
            }
            Some(())
        });
    }

    /// Light scattered somewhere along a segment within a light's near field, carried to the start.
    fn near_lights(
        &self,
        ray: &Ray,
        end: Option<&Hit>,
        reach: f32,
        weight: &Weight,
        bend: Option<&(Vec3, Phase)>,
        kappa: Spectrum,
        total: &mut Incoming,
        rng: &mut Generator,
    ) {
        let lit = until_the_end(ray, self.medium);
        let lights = self.lights.iter().filter_map(|light| {
            let centre = light.steep_field()?.centre();
            let farthest = lit.length.min(ENDLESS * ray.origin.distance(centre).max(self.medium.resolution()));
            let light = NearLight::of(light, &lit, 0.0, farthest)?;
            Some((light.sent(&lit), light))
        });
        self.each(lights, rng, |light, share, rng| {
            let on_light = uniform2(rng);
            let joint = light.join(ray, uniform(rng), on_light)?;
            let (at, distance, marching) = (joint.point, joint.distance, self.marching(rng));
            let properties = self.medium.properties(at);
            if properties.scattering.is_black() {
                return None;
            }
            let source = joint.light(|| uniform2(rng))?.source;
            let closest = if source.falloff == Falloff::Area { 0.0 } else { self.settings.closest };
            let arrival = Arrival::from_source(at, self.medium, &source, marching, closest)?;
            if self.scene.is_blocked(&shadow_ray(at, &source)) {
                return None;
            }
            let segment = optical_thickness_with_gradients(&ray.with_length(distance), self.medium, marching);
            let frozen = kappa / (joint.pdf * share);
            let slope = self.medium.gradients(at).scattering;
            let through = segment.value.transmitted();
            let shift = Shift::new(ray, end, reach, distance);
            let joined = bent(weight, bend, ray, &shift).advance_by(
                &shift,
                frozen,
                through,
                &segment,
                properties.scattering,
                &slope,
            );
            add_scattered(total, &joined, &arrival, -ray.direction, &properties.phase);
            Some(())
        });
    }

    /// Calls `connect(light, probability)` for all lights with positive importance, or for one of them.
    fn each<L>(
        &self,
        lights: impl Iterator<Item = (f32, L)>,
        rng: &mut Generator,
        mut connect: impl FnMut(L, f32, &mut Generator) -> Option<()>,
    ) {
        if self.settings.one_light {
            if let Some((light, choice)) = choose(lights, uniform(rng)) {
                connect(light, choice.probability, rng);
            }
            return;
        }
        for (importance, light) in lights {
            if importance > 0.0 {
                connect(light, 1.0, rng);
            }
        }
    }
}

/// A weight with the change of the phase function at its last vertex as the directions before and after turn.
fn bent(weight: &Weight, bend: Option<&(Vec3, Phase)>, ray: &Ray, shift: &Shift) -> Weight {
    let Some((to_eye, phase)) = bend else { return *weight };
    let deflected = deflection(ray.direction, *to_eye);
    let cosine = to_eye.dot(ray.direction);
    let before = (*to_eye * cosine - ray.direction) * weight.last_turn;
    let after = (*to_eye - ray.direction * cosine) * (weight.moved * shift.turn);
    let slope = phase.derivative(deflected).ratio(phase.value(deflected));
    Weight { gradient: weight.gradient + Gradient::outer(weight.value * slope, before + after), ..*weight }
}

/// Adds what a path's last vertex scatters of an arrival.
fn add_scattered(total: &mut Incoming, weight: &Weight, arrival: &Arrival, to_eye: Vec3, phase: &Phase) {
    let light = arrival.scatter(to_eye, phase);
    let carried = if phase.is_isotropic() {
        weight.carry(&light)
    } else {
        weight.carry_turned(&light, &arrival.turned(to_eye, phase))
    };
    add(total, weight.turn, &carried);
}

/// Adds light that has been carried to the start.
#[inline]
fn add(total: &mut Incoming, turn: Option<f32>, carried: &Contribution) {
    total.irradiance += carried.radiance;
    total.gradient += carried.gradient;
    total.turning += carried.radiance * turn.unwrap_or(0.0);
}
