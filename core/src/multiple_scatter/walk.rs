//! One random walk.

use glam::{Vec2, Vec3};

use super::flight::{Collision, Flown, Flying, Lengths, fly, own};
use super::lamps;
use super::weight::{Shift, Weight};
use crate::host::{Hit, Medium, Properties, Rng, Scene};
use crate::light::{Except, Falloff, FromPoint, FromRay, Light, Question, scattered};
use crate::math::{Ray, float};
use crate::phase::{Phase, deflection};
use crate::sampling::{Generator, mis, uniform, uniform2, warp};
use crate::single_scatter::{Arrival, Contribution};
use crate::spectrum::{Gradient, Spectrum};
use crate::transmittance::thickness::{Marching, Steps, optical_thickness_with_gradients, until_the_end};
use crate::world::{NearLight, World, nearest_surface, shadow_ray};

/// Beyond this many distances to the light an endless segment is not sampled equiangularly: 10⁻⁴ of
/// the angle lies there, and `tan` loses its digits.
const ENDLESS: f32 = 1e4;

/// Absolute mean cosine from which on walks meet lights as well as connect to them. More: rare samples stand for much light; less: rays that
/// find nothing.
const SHARP: f32 = 0.5;

/// Least probability of survival: below, the weights of the rare survivors show as fireflies.
const MIN_SURVIVAL: f32 = 0.05;

/// Greatest part of what is scattered that may count as going straight on. More: walks that fly on without an end; less: nothing, as any part is right.
pub(crate) const MOST_STRAIGHT: f32 = 0.95;

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

/// A random walk through a world: the paths by which light comes to a point.
#[derive(Debug)]
pub struct Walk<'a, M: ?Sized, S: ?Sized> {
    /// The world. A sky ([`Light::is_sky`](crate::light::Light::is_sky)) is met by walks that leave it, all other lights are connected to.
    pub world: World<'a, M, S>,
    /// How to walk.
    pub settings: Settings,
}

impl<M: ?Sized, S: ?Sized> Clone for Walk<'_, M, S> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<M: ?Sized, S: ?Sized> Copy for Walk<'_, M, S> {}

/// Where a walk starts: see [`Walk::along`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Start {
    /// From where, and in which direction.
    pub ray: Ray,
    /// The nearest surface along it: [`nearest_surface`].
    pub end: Option<Hit>,
    /// Density (sr⁻¹) of the ray's direction.
    pub pdf: f32,
    /// Where light collides before it comes to the end: [`Walk::first`]. `None` if it gets through.
    pub collision: Option<Collision>,
}

/// What is known of the light in a medium, so that a walk may end: see [`Walk::along`].
pub trait Known {
    /// Part of the light scattered at `point` that counts as going straight on, in [0, 0.95]: what [`Known::light`] leaves out. 0 unless told otherwise, and wherever
    /// [`Known::light`] has no answer; of more, 0.95 is taken. Any part is right, and may be another at each point (decision 92).
    ///
    /// ```
    /// # use fogbow::{host::Properties, math::Vec3, multiple_scatter::Known, phase::Phase, spectrum::Spectrum};
    /// # let [absorption, scattering] = [Spectrum::ZERO, Spectrum::ONE];
    /// # let fog = Properties { absorption, scattering, emission: Spectrum::ZERO, phase: Phase::ISOTROPIC };
    /// assert_eq!(().straight(Vec3::ZERO, &fog), 0.0);
    /// ```
    fn straight(&self, point: Vec3, properties: &Properties) -> f32 {
        let _ = (point, properties);
        0.0
    }

    /// Light that is scattered towards `to_eye` at `point` (W·m⁻²·sr⁻¹), without the lights that walks connect to and without
    /// what goes straight on, with its gradients as the point moves and as `to_eye` turns. `None` where nothing is known.
    ///
    /// ```
    /// # use fogbow::{host::Properties, math::Vec3, multiple_scatter::Known, phase::Phase, spectrum::{Gradient, Spectrum}};
    /// # use fogbow::single_scatter::Contribution;
    /// struct Even;   // light of radiance 1 from everywhere, half of which goes straight on
    /// impl Known for Even {
    ///     fn straight(&self, _: Vec3, _: &Properties) -> f32 {
    ///         0.5
    ///     }
    ///     fn light(&mut self, _: Vec3, _: Vec3, _: &Properties) -> Option<(Contribution, Gradient)> {
    ///         Some((Contribution { radiance: Spectrum::splat(0.5), gradient: Gradient::ZERO }, Gradient::ZERO))
    ///     }
    /// }
    /// # let [absorption, scattering] = [Spectrum::ZERO, Spectrum::ONE];
    /// # let fog = Properties { absorption, scattering, emission: Spectrum::ZERO, phase: Phase::ISOTROPIC };
    /// let (light, _) = Even.light(Vec3::ZERO, Vec3::X, &fog).unwrap();
    /// assert_eq!(light.radiance[0] + Even.straight(Vec3::ZERO, &fog), 1.0);
    /// ```
    fn light(&mut self, point: Vec3, to_eye: Vec3, properties: &Properties) -> Option<(Contribution, Gradient)>;
}

/// Nothing.
impl Known for () {
    fn light(&mut self, _: Vec3, _: Vec3, _: &Properties) -> Option<(Contribution, Gradient)> {
        None
    }
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
    /// # use fogbow::{host::Empty, light::{Light, Sun}, math::{Vec2, Vec3}, medium::{Homogeneous, Placed, Region}};
    /// # use fogbow::{multiple_scatter::{Settings, Walk}, phase::Phase, sampling::Generator, spectrum::Spectrum};
    /// # use fogbow::{transmittance::thickness::Steps, world::World};
    /// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC)?;
    /// let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 2.0)?);
    /// let lights = [Light::Sun(Sun::new(Vec3::Z, Spectrum::ONE)?)];
    /// let world = World { medium: &ball, scene: &Empty, lights: (&lights).into() };
    /// let walk = Walk { world, settings: Settings::new(Steps::Length(0.1)) };
    /// // The mean over many paths is the light that was scattered before it came to the middle of the ball.
    /// let rng = &mut Generator::new(1);
    /// let paths = (0..1000).map(|i| walk.path(Vec3::ZERO, Vec2::new(i as f32 / 1000.0, 0.5), |_, _| Spectrum::ZERO, rng));
    /// let fluence = paths.map(|incoming| incoming.irradiance[0]).sum::<f32>() / 1000.0;
    /// assert!(fluence > 0.2 && fluence < 1.0);
    /// # Ok::<(), Box<dyn core::error::Error>>(())
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
        let end = nearest_surface(&ray, self.world.scene);
        let u = uniform(rng);
        let collision = self.first(&ray, end.as_ref(), u, false, rng).collision;
        let start = Start { ray, end, pdf: warp::uniform_sphere_pdf(), collision };
        self.along(&start, outgoing, &mut (), rng)
    }

    /// The flight on the first segment, on `ray` up to its `end`, decided by `u` in [0, 1); with the thickness of the
    /// whole segment where light comes to its `end`, too (`to_end`).
    ///
    /// ```
    /// # use fogbow::{host::Empty, math::{Ray, Vec3}, medium::Homogeneous, phase::Lobe, sampling::Generator};
    /// # use fogbow::{multiple_scatter::{Settings, Walk}, spectrum::Spectrum, transmittance::thickness::Steps, world::World};
    /// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::splat(2.0), Lobe::Isotropic).unwrap();
    /// let settings = Settings::new(Steps::Length(0.1));
    /// let walk = Walk { world: World { medium: &fog, scene: &Empty, lights: (&[]).into() }, settings };
    /// let flown = walk.first(&Ray::new(Vec3::ZERO, Vec3::X), None, 0.5, false, &mut Generator::new(1));
    /// let median = flown.collision.unwrap().distance;
    /// assert!((median - core::f32::consts::LN_2 / 2.0).abs() < 1e-6);   // half of all light comes farther
    /// ```
    pub fn first(&self, ray: &Ray, end: Option<&Hit>, u: f32, to_end: bool, rng: &mut (impl Rng + ?Sized)) -> Flown {
        let rng = &mut own(rng);
        let ray = ray.with_length(end.map_or(f32::INFINITY, |hit| hit.distance));
        fly(&ray, self.world.medium, &self.flying(to_end, rng), Spectrum::ONE, u, rng)
    }

    /// Light scattered on a path whose first segment is that of `start`, over the density of its direction: radiance at
    /// the ray's origin over `pdf`, and how it changes as the origin moves and the vertices with it ([`Shift`]).
    ///
    /// `known` may answer for all light but that straight from the lights walks connect to (those that are no sky): then the path ends
    /// there. A part `f` of what is scattered may count as going straight on ([`Known::straight`]), so that the equation of transfer
    /// becomes, with the same solution whatever `f` is at each point,
    ///
    /// ```text
    /// dL/ds = −(σₜ − f σₛ) L + σₛ (∫ p L dω − f L)
    /// ```
    ///
    /// and walks fly on from collisions that are none there. `outgoing` as for [`Walk::path`].
    ///
    /// A path ends where its weight is no number, and brings nothing at all if the light it has found is none: a lamp or a
    /// surface within rounding of a vertex may leave the range of `f32`. That darkens by what such paths would bring, which no
    /// number can say.
    ///
    /// ```
    /// # use fogbow::{host::Empty, math::{Ray, Vec3}, medium::Homogeneous, phase::Phase, sampling::{Generator, warp}};
    /// # use fogbow::{single_scatter::Contribution, spectrum::{Gradient, Spectrum}, transmittance::thickness::Steps, world::World};
    /// use fogbow::{host::Properties, multiple_scatter::{Known, Settings, Start, Walk}};
    /// struct Even;
    /// impl Known for Even {
    ///     fn light(&mut self, _: Vec3, _: Vec3, _: &Properties) -> Option<(Contribution, Gradient)> {
    ///         Some((Contribution { radiance: Spectrum::ONE, gradient: Gradient::ZERO }, Gradient::ZERO))
    ///     }
    /// }
    /// // Endless fog that absorbs nothing, in which light of radiance 1 is scattered into every direction, everywhere.
    /// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC)?;
    /// let world = World { medium: &fog, scene: &Empty, lights: (&[]).into() };
    /// let walk = Walk { world, settings: Settings::new(Steps::Length(0.1)) };
    /// let (ray, rng) = (Ray::new(Vec3::ZERO, Vec3::X), &mut Generator::new(1));
    /// let collision = walk.first(&ray, None, 0.5, false, rng).collision;
    /// let start = Start { ray, end: None, pdf: warp::uniform_sphere_pdf(), collision };
    /// let incoming = walk.along(&start, |_, _| Spectrum::ZERO, &mut Even, rng);
    /// // Then it arrives as radiance 1, from wherever it is asked: over the density of directions, 4π.
    /// assert!((incoming.irradiance[0] - 4.0 * core::f32::consts::PI).abs() < 1e-4);
    /// # Ok::<(), fogbow::medium::MediumError>(())
    /// ```
    pub fn along(
        &self,
        start: &Start,
        mut outgoing: impl FnMut(&Ray, &Hit) -> Spectrum,
        known: &mut impl Known,
        rng: &mut (impl Rng + ?Sized),
    ) -> Incoming {
        let rng = &mut own(rng);
        // Asked at two places.
        let outgoing: &mut dyn FnMut(&Ray, &Hit) -> Spectrum = &mut outgoing;
        let World { medium, scene, lights } = self.world;
        let mut total = Incoming {
            to_light: start.ray.direction,
            irradiance: Spectrum::ZERO,
            gradient: Gradient::ZERO,
            turning: Spectrum::ZERO,
        };
        let pdf = start.pdf;
        let mut carried = Carried { weight: Weight::ONE, last: None, pdf, kappa: Spectrum::splat(1.0 / pdf) };
        let (mut leg, mut first) = (self.leg(start.ray, start.end), Some(start.collision));
        let has_surfaces = lights.have_surfaces();
        for vertex in 1..=self.settings.max_vertices {
            let unscattered = carried.kappa;
            let (mut collision, mut passed);
            let straight = loop {
                self.near_lights(&leg, &carried, &mut total, rng);
                (collision, passed) = match first.take() {
                    Some(given) => (given, Spectrum::ONE),
                    None => self.next(&leg, &carried, rng),
                };
                let Some(here) = collision else { break 0.0 };
                let (peak, straight) = leg.straight(&here, known);
                if !(straight > 0.0 && uniform(rng) < straight) {
                    break straight;
                }
                carried.kappa *= here.factor * here.properties.scattering * (peak / straight);
                (leg.flown, leg.passes) = (here.distance, leg.passes + 1.0);
            };
            let Some(mut here) = collision else {
                // What comes without going straight on somewhere has been added with the vertex before.
                if leg.flown > 0.0 {
                    let light = leg.end.map_or_else(|| lights.sky(leg.ray.direction), |hit| outgoing(&leg.ray, &hit));
                    self.arrive(&leg, light * passed * carried.kappa.ratio(unscattered), &carried, &mut total, rng);
                }
                break;
            };
            let (at, properties) = (leg.ray.at(here.distance), here.properties);
            // What goes straight on dims nothing.
            here.factor *= 1.0 / (1.0 - straight);
            here.thickness = here.thickness.scaled(1.0 - straight);
            let step = carried.kappa * here.factor * properties.scattering;
            if step.is_black() || !step.is_finite() {
                break;
            }
            let mut weight = carried.at(&leg, &here, carried.kappa, &medium.gradients(at).scattering);
            if vertex >= self.settings.roulette_from {
                let survival = step.max_element().clamp(MIN_SURVIVAL, 1.0);
                if uniform(rng) >= survival {
                    break;
                }
                weight = weight.scaled(1.0 / survival);
            }
            let to_eye = -leg.ray.direction;
            let meets_lights = has_surfaces && is_sharp(&properties.phase);
            self.lights_at(at, &weight, (to_eye, &properties.phase), meets_lights, &mut total, rng);
            let light = known.light(at, to_eye, &properties);
            if let Some((light, turned)) = &light {
                add(&mut total, weight.turn, &weight.carry_turned(light, turned));
                if !meets_lights {
                    break;
                }
            }

            let extinction = properties.extinction().mean();
            let turn = lamps::turn((at, to_eye), &properties.phase, extinction, &lights, rng);
            carried = Carried { weight, last: Some((to_eye, properties.phase)), pdf: turn.pdf, kappa: turn.weight };
            let ray = Ray { origin: at, direction: turn.to_light, length: f32::INFINITY };
            leg = self.leg(ray, nearest_surface(&ray, scene));
            let mut radiance = match &leg.end {
                _ if light.is_some() => Spectrum::ZERO,
                Some(hit) => outgoing(&leg.ray, hit),
                None => lights.sky(ray.direction),
            };
            if meets_lights && let Some(hit) = &leg.end {
                radiance += self.met(&leg.ray, hit, (to_eye, &properties.phase));
            }
            if leg.end.is_some() || !radiance.is_black() {
                self.arrive(&leg, radiance, &carried, &mut total, rng);
            }
            if light.is_some() {
                break;
            }
        }
        // A light or a hit within rounding of a vertex may leave the range of f32.
        if !(total.irradiance.is_finite() && total.gradient.is_finite() && total.turning.is_finite()) {
            (total.irradiance, total.gradient, total.turning) = (Spectrum::ZERO, Gradient::ZERO, Spectrum::ZERO);
        }
        total
    }

    /// The next collision on a segment, and what light that gets through weighs.
    fn next(&self, leg: &Leg, carried: &Carried, rng: &mut Generator) -> (Option<Collision>, Spectrum) {
        let (flying, u) = (self.flying(false, rng), uniform(rng));
        let throughput = carried.weight.value * carried.kappa;
        let flown = fly(&leg.rest(), self.world.medium, &flying, throughput, u, rng);
        (flown.collision.map(|next| self.beyond(leg, next, rng)), flown.passed)
    }

    /// A point of the rest of a segment, as one of the whole.
    fn beyond(&self, leg: &Leg, mut point: Collision, rng: &mut Generator) -> Collision {
        if leg.flown > 0.0 {
            point.distance += leg.flown;
            let ray = leg.ray.with_length(point.distance);
            point.thickness = optical_thickness_with_gradients(&ray, self.world.medium, self.marching(rng));
        }
        point
    }

    /// Light from the end of a segment; if it has gone straight on at collisions, `radiance` is weighed by chance, and transmittance is in its gradient alone.
    fn arrive(&self, leg: &Leg, radiance: Spectrum, carried: &Carried, total: &mut Incoming, rng: &mut Generator) {
        let marching = self.marching(rng);
        if radiance.is_black() {
            return;
        }
        let whole = optical_thickness_with_gradients(&leg.ray, self.world.medium, marching);
        let mut through = whole.transmittance();
        if leg.flown > 0.0 {
            // Where light went straight on may lie anywhere on the segment: on one that is longer, at more places.
            let shorter = leg.ray.direction * (leg.passes / leg.ray.length);
            through.value = Spectrum::ONE;
            through.gradient_fixed = whole.gradient_fixed * -1.0 - Gradient::outer(Spectrum::ONE, shorter);
        }
        let arrival = Arrival::from_end(&leg.ray, leg.end.as_ref(), radiance, carried.pdf, || through);
        let Some(arrival) = arrival else { return };
        if let Some((to_eye, phase)) = &carried.last {
            add_scattered(total, &carried.weight, &arrival, (*to_eye, phase));
        } else {
            total.irradiance += arrival.irradiance;
            total.gradient += arrival.gradient;
            total.turning += arrival.turning;
        }
    }

    fn leg(&self, ray: Ray, end: Option<Hit>) -> Leg {
        let nearest2 = self.world.lights.nearest2(ray.origin);
        let ray = ray.with_length(end.map_or(f32::INFINITY, |hit| hit.distance));
        let mut wall = end.as_ref().map(|hit| (hit.distance, hit.normal));
        self.world.medium.faces(&ray, &mut |face| {
            if face.distance > 0.0 && wall.is_none_or(|(distance, _)| face.distance < distance) {
                wall = Some((face.distance, face.normal));
            }
        });
        Leg { ray, end, wall, reach: REACH * float::sqrt(nearest2), flown: 0.0, passes: 0.0 }
    }

    #[inline]
    fn marching(&self, rng: &mut Generator) -> Marching {
        Marching { steps: self.settings.steps, offset: uniform(rng) }
    }

    #[inline]
    fn flying(&self, to_end: bool, rng: &mut Generator) -> Flying {
        Flying { lengths: self.settings.lengths, marching: self.marching(rng), to_end }
    }

    /// Single scattering at a vertex of the lights in whose near field it does not lie. `is_shared` if the walk may meet them, too.
    fn lights_at(
        &self,
        at: Vec3,
        weight: &Weight,
        towards: (Vec3, &Phase),
        is_shared: bool,
        total: &mut Incoming,
        rng: &mut Generator,
    ) {
        let World { medium, scene, .. } = self.world;
        self.each(&at_vertex(at, towards), rng, |light, share, rng| {
            let mut sample = light.sample(at, uniform2(rng))?;
            sample.source.weight = sample.source.weight / share;
            if is_shared && sample.pdf > 0.0 {
                let other = towards.1.pdf(deflection(sample.incident.to_light, towards.0));
                sample.source.weight *= mis::power(share * sample.pdf, other);
            }
            let arrival = Arrival::from_source(at, medium, &sample.source, self.marching(rng), 0.0)?;
            if !scene.is_blocked(&shadow_ray(at, &sample.source)) {
                add_scattered(total, weight, &arrival, towards);
            }
            Some(())
        });
    }

    /// What a light that a ray from a vertex meets sends back along it, with its share of what [`Walk::lights_at`] connects to: directions
    /// at the vertex are those of the phase function. A phase function that is sharper than the light is large makes
    /// connections vary without a useful bound.
    fn met(&self, ray: &Ray, hit: &Hit, towards: (Vec3, &Phase)) -> Spectrum {
        let lights = &self.world.lights;
        let met = hit.light.and_then(|index| Some((index as usize, lights.get(index as usize)?)));
        let Some((index, light)) = met else { return Spectrum::ZERO };
        let radiance = light.radiance(ray.at(hit.distance), hit.normal, -ray.direction);
        if radiance.is_black() {
            return Spectrum::ZERO;
        }
        let question = at_vertex(ray.origin, towards);
        let share = match self.settings.one_light {
            true => lights.share(&question, index),
            false => f32::from(question.light(light) > 0.0),
        };
        if share <= 0.0 {
            return Spectrum::ZERO;
        }
        let pdf = towards.1.pdf(deflection(ray.direction, towards.0));
        radiance * mis::power(pdf, share * light.pdf(ray.origin, ray.direction, hit.distance, hit.normal))
    }

    /// Light scattered somewhere along a segment within a light's near field, carried to the start.
    fn near_lights(&self, leg: &Leg, carried: &Carried, total: &mut Incoming, rng: &mut Generator) {
        let World { medium, scene, .. } = self.world;
        let ray = &leg.rest();
        let lit = until_the_end(ray, medium);
        let until = Some((ENDLESS, medium.resolution()));
        let question = FromRay { ray: lit, near: 0.0, far: lit.length, steep: true, until };
        self.each(&question, rng, |light, share, rng| {
            let light = NearLight { light, interval: question.part(light)? };
            let on_light = uniform2(rng);
            let joint = light.join(ray, uniform(rng), on_light)?;
            let (at, distance, marching) = (joint.point, joint.distance, self.marching(rng));
            let properties = medium.properties(at);
            if properties.scattering.is_black() {
                return None;
            }
            let source = joint.light(|| uniform2(rng))?.source;
            let closest = if source.falloff == Falloff::Area { 0.0 } else { self.settings.closest };
            let arrival = Arrival::from_source(at, medium, &source, marching, closest)?;
            if scene.is_blocked(&shadow_ray(at, &source)) {
                return None;
            }
            let thickness = optical_thickness_with_gradients(&ray.with_length(distance), medium, marching);
            let frozen = carried.kappa / (joint.pdf * share);
            let here = Collision { distance, properties, factor: thickness.value.transmitted(), thickness };
            let here = self.beyond(leg, here, rng);
            let joined = carried.at(leg, &here, frozen, &medium.gradients(at).scattering);
            add_scattered(total, &joined, &arrival, (-ray.direction, &properties.phase));
            Some(())
        });
    }

    /// Calls `connect(light, probability)` for all lights with positive importance, or for one of them.
    fn each(
        &self,
        question: &dyn Question,
        rng: &mut Generator,
        mut connect: impl FnMut(&Light<'_>, f32, &mut Generator) -> Option<()>,
    ) {
        let lights = &self.world.lights;
        if self.settings.one_light {
            if let Some(choice) = lights.pick(question, uniform(rng)) {
                connect(&lights[choice.index], choice.probability, rng);
            }
            return;
        }
        for light in lights.iter().filter(|light| question.light(light) > 0.0) {
            connect(light, 1.0, rng);
        }
    }
}

/// What lights but those around which it lies send to a vertex, which scatters it on.
fn at_vertex<'p>(point: Vec3, (to_eye, phase): (Vec3, &'p Phase)) -> impl Question + use<'p> {
    scattered(FromPoint { except: Except::Steep, sky: false, ..FromPoint::all(point) }, to_eye, phase)
}

/// Whether walks may meet lights as they are scattered by a phase function: elsewhere connections do better, and spare a ray.
fn is_sharp(phase: &Phase) -> bool {
    phase.mean_cosine().map(f32::abs).max_element() > SHARP
}

/// A segment of a walk.
struct Leg {
    /// It ends at the surface.
    ray: Ray,
    end: Option<Hit>,
    /// What comes first that vertices must not cross, as [`Shift::new`] has it.
    wall: Option<(f32, Vec3)>,
    /// The reach of [`Shift`] at its origin.
    reach: f32,
    /// How far (m) light came that went straight on at a collision.
    flown: f32,
    /// At how many.
    passes: f32,
}

impl Leg {
    /// What is still to be flown.
    fn rest(&self) -> Ray {
        Ray { origin: self.ray.at(self.flown), direction: self.ray.direction, length: self.ray.length - self.flown }
    }

    /// Parts of what is scattered at a collision, and of its extinction, that count as going straight on.
    fn straight(&self, here: &Collision, known: &impl Known) -> (f32, f32) {
        let Properties { scattering, .. } = here.properties;
        let peak = known.straight(self.ray.at(here.distance), &here.properties).min(MOST_STRAIGHT);
        let extinction = here.properties.extinction().mean();
        (peak, if peak > 0.0 && extinction > 0.0 { peak * scattering.mean() / extinction } else { 0.0 })
    }
}

/// A path up to the start of a segment.
struct Carried {
    weight: Weight,
    /// The last vertex's direction to the eye and phase function.
    last: Option<(Vec3, Phase)>,
    /// Density of the segment's direction (sr⁻¹).
    pdf: f32,
    /// Phase function over that density, and weights of what went straight on.
    kappa: Spectrum,
}

impl Carried {
    /// The weight at a point of `leg`, where the gradient of scattering is `slope`; `kappa` is frozen.
    #[inline]
    fn at(&self, leg: &Leg, point: &Collision, kappa: Spectrum, slope: &Gradient) -> Weight {
        let shift = Shift::new(&leg.ray, leg.wall, leg.reach, point.distance);
        let Collision { factor, thickness, properties, .. } = point;
        self.bent(&leg.ray, &shift).advance_by(&shift, kappa, *factor, thickness, properties.scattering, slope)
    }

    /// The weight with the change of the phase function at its last vertex as the directions before and after turn.
    #[inline]
    fn bent(&self, ray: &Ray, shift: &Shift) -> Weight {
        let weight = self.weight;
        let Some((to_eye, phase)) = self.last.as_ref().filter(|(_, phase)| !phase.is_isotropic()) else {
            return weight;
        };
        let deflected = deflection(ray.direction, *to_eye);
        let cosine = to_eye.dot(ray.direction);
        let before = (*to_eye * cosine - ray.direction) * weight.last_turn;
        let after = (*to_eye - ray.direction * cosine) * (weight.moved * shift.turn);
        let slope = phase.derivative(deflected).ratio(phase.value(deflected));
        Weight { gradient: weight.gradient + Gradient::outer(weight.value * slope, before + after), ..weight }
    }
}

/// Adds what a path's last vertex scatters of an arrival.
fn add_scattered(total: &mut Incoming, weight: &Weight, arrival: &Arrival, (to_eye, phase): (Vec3, &Phase)) {
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
