//! What the caches are filled with: the light at a point, with the sums that Eq. 34 needs.

use glam::{Vec2, Vec3};

use super::aim::Aims;
use super::connect::Connection;
use super::evidence::Openings;
use super::eye::{Onward, known_base};
use super::guide::Looks;
use super::lobe::{self, Lobe, coefficients_of};
use super::lookup::Reading;
use super::mixture::{Mixture, third};
use super::photons::PhotonGrid;
use super::record::Facing;
use super::resolved::SHARPEST;
use super::store::SurfaceCache;
use crate::host::{Hit, Medium, Properties, Rng, Scene};
use crate::light::{FromPoint, Light};
use crate::math::{Frame, Ray, float};
use crate::multiple_scatter::{self, Cones, Incoming, Known, Start, Walk};
use crate::path;
use crate::phase::{Phase, deflection};
use crate::sampling::discrete::Choice;
use crate::sampling::{Generator, mis, uniform, uniform2, warp};
use crate::sh::Coefficient;
use crate::single_scatter::{self, Arrival, Contribution, Directional, Sums, Towards};
use crate::spectrum::{Gradient, Spectrum};
use crate::surface::{Surface, lambert};
use crate::transmittance::thickness::{Marching, Transmittance, transmittance, transmittance_with_gradients};
use crate::world::{World, leave, nearest_surface};

/// Least cosine in the gradient of an irradiance sample: at grazing directions `1/cos` has a
/// variance without bound.
const MIN_COSINE: f32 = 0.05;

/// How often the phase function has been applied to what a lobe holds, at least: light of surfaces comes from everywhere, but not evenly.
const SURFACE_POWER: u32 = 1;

/// See [`SURFACE_POWER`].
const MULTIPLE_POWER: u32 = 2;

/// How much light that is not scattered to the eye counts for what is learnt of directions: mirrors and other views look
/// from elsewhere.
const ELSEWHERE: f32 = 0.25;

/// Records for any direction reach less far in proportion to one less the absolute mean cosine of the phase function, and to this at least.
/// Less: more records than they mend.
const LEAST_BREADTH: f32 = 0.1;

/// Surfaces that send rays on, one after the other, behind which light is still looked up; behind more of them a path is traced. More: deeper calls, where mirrors face each other.
const MOST_MIRRORS: u32 = 4;

/// Light in cells, at which a walk ends.
struct Cells<'a> {
    photons: Option<&'a PhotonGrid<'a>>,
    /// How much is left of what cells do not resolve.
    sharp: f32,
}

impl Known for Cells<'_> {
    fn straight(&self, point: Vec3, properties: &Properties) -> f32 {
        let of = |photons: &PhotonGrid<'_>| {
            let ends = self.sharp * photons.unresolved(&properties.phase) <= SHARPEST && photons.knows(point);
            if ends { photons.straight(&properties.phase) } else { 0.0 }
        };
        self.photons.map_or(0.0, of)
    }

    fn light(&mut self, point: Vec3, to_eye: Vec3, properties: &Properties) -> Option<(Contribution, Gradient)> {
        let photons = self.photons?;
        self.sharp *= photons.unresolved(&properties.phase);
        if self.sharp > SHARPEST { None } else { photons.scattered(point, to_eye, properties) }
    }
}

/// How much light from a direction counts for a record that is looked at from `eye`.
fn counts(eye: Option<(Vec3, &Phase)>, direction: Vec3) -> f32 {
    eye.map_or(1.0, |(eye, phase)| {
        ELSEWHERE + (1.0 - ELSEWHERE) * 4.0 * float::PI * phase.pdf(deflection(direction, eye))
    })
}

/// Estimates the light that the caches hold.
///
/// Light from surfaces takes its direct part from one connection to the lights, its indirect part
/// from the surface cache, where that has something, and from one traced path where not: so caches
/// filled one after the other build on each other, and none needs another to be right.
///
/// ```
/// # use fogbow::{cache::Estimator, host::{Empty, Hit}, light::{Light, PointLight}, math::{Ray, Vec2, Vec3, float::PI}};
/// # use fogbow::{multiple_scatter, path, phase::Phase, sampling::Generator, spectrum::Spectrum, surface::Surface};
/// # use fogbow::transmittance::thickness::Steps;
/// # use fogbow::world::World;
/// // A lamp of 1 W/sr two metres above, and a grey floor; in vacuum, as if there were a last bit of fog.
/// let lamps = [Light::Point(PointLight::new(2.0 * Vec3::Z, Spectrum::ONE)?)];
/// let world = World { medium: &Empty, scene: &Empty, lights: (&lamps).into() };
/// # let walk = multiple_scatter::Settings::new(Steps::Length(0.1));
/// # let (paths, light_samples) = (path::Settings::default(), 1);
/// let estimator = Estimator { world, surfaces: None, photons: None, walk, paths, light_samples, finest: 1e-3 };
/// let surface = Surface::Lambert { reflectance: Spectrum::splat(0.5) };
/// let floor = Hit { distance: 1.0, normal: Vec3::Z, shading: Vec3::Z, surface, light: None };
/// # let near = |light: Spectrum, expected: f32| (light[0] / expected - 1.0).abs() < 1e-5;
/// let (at, phase, mut rng) = (Vec3::ZERO, estimator.phase(Vec3::ZERO), Generator::new(1));
/// // Irradiance is I/r² = ¼ W·m⁻²; scattered once 1/4π of it, reflected ρ/π.
/// assert!(near(estimator.single(at, &phase, &mut [], &mut rng).value, 0.25 / (4.0 * PI)));
/// assert!(near(estimator.towards(at, Vec3::X, &phase, &mut rng), 0.25 / (4.0 * PI)));
/// assert!(near(estimator.direct(at, &floor, &mut rng), 0.25));
/// let random = (0.5, Vec2::splat(0.5));   // chooses the light and the point on it
/// assert!(near(estimator.direct_at(at, &floor, false, random, &mut rng), 0.25));
/// assert!(near(estimator.outgoing(&Ray::new(Vec3::Z, Vec3::NEG_Z), &floor, &mut rng), 0.5 / PI * 0.25));
/// assert!(near(estimator.reflected(at, &floor, Vec3::Z, random, &mut rng), 0.5 / PI * 0.25));
/// // Nothing is scattered twice in vacuum.
/// assert!(estimator.multiple(at, &phase, 8, &mut [], &mut rng).value.is_black());
/// assert!(estimator.multiple_towards(at, Vec3::X, &phase, &mut rng).is_black());
/// // A sky of 1 counts as light of surfaces: it is scattered as 1, and a floor receives π.
/// let sky = [Light::Constant(Spectrum::ONE)];
/// let outside = Estimator { world: World { lights: (&sky).into(), ..world }, ..estimator };
/// assert!(near(outside.surface(at, &phase, 8, &mut [], &mut rng).value, 1.0));
/// assert!(near(outside.surface_towards(at, Vec3::X, &phase, &mut rng), 1.0));
/// assert!(near(outside.irradiance(at, Vec3::Z, 8, &mut rng).0.value, PI));
/// assert!(near(outside.indirect(at, &floor, &mut rng), PI));
/// # Ok::<(), fogbow::light::LightError>(())
/// ```
#[derive(Debug)]
pub struct Estimator<'a, M: ?Sized, S: ?Sized> {
    /// The world.
    pub world: World<'a, M, S>,
    /// Indirect irradiance known so far, and how it is read.
    pub surfaces: Option<(&'a SurfaceCache<'a>, Reading)>,
    /// Light in cells: walks end at their first vertex in a cell that knows.
    pub photons: Option<&'a PhotonGrid<'a>>,
    /// How random walks are made, and light marched to.
    pub walk: multiple_scatter::Settings,
    /// How paths are traced where nothing is cached.
    pub paths: path::Settings,
    /// Samples of every light with extent at a point.
    pub light_samples: u32,
    /// Length (m) below which changes of light are not asked for: the gradient of no sample is larger than its
    /// light over it. Close to walls and lights single samples have gradients without bound.
    pub finest: f32,
}

impl<M: ?Sized, S: ?Sized> Clone for Estimator<'_, M, S> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<M: ?Sized, S: ?Sized> Copy for Estimator<'_, M, S> {}

impl<M: Medium + ?Sized, S: Scene + ?Sized> Estimator<'_, M, S> {
    /// The phase function at `point`.
    #[must_use]
    pub fn phase(&self, point: Vec3) -> Phase {
        self.world.medium.properties(point).phase
    }

    /// Light from the lights but a sky, scattered once at `point`: mean over directions (W·m⁻²·sr⁻¹), with
    /// the expansion of `phase` of degree 1 and more added to `higher`.
    pub fn single(&self, point: Vec3, phase: &Phase, higher: &mut [Coefficient], rng: &mut impl Rng) -> Sums {
        self.expanded(phase, higher, None, |into, _| {
            let settings = single_scatter::Settings { samples: self.light_samples, steps: self.walk.steps };
            let mut sums = Sums::default();
            for lights in self.world.lights.but_sky() {
                let world = World { lights, ..self.world };
                sums.merge(&single_scatter::sample_directional(point, into, &world, &settings, rng));
            }
            sums
        })
    }

    /// Light from surfaces and the sky, scattered once at `point`, from `directions` directions. As
    /// [`Estimator::single`].
    pub fn surface<'g>(
        &self,
        point: Vec3,
        phase: &Phase,
        directions: impl Into<Looks<'g>>,
        higher: &mut [Coefficient],
        rng: &mut impl Rng,
    ) -> Sums {
        let (mut child, shift) = (Generator::child(rng), uniform2(rng));
        let Looks { count, guide, mut learnt, to_eye } = directions.into();
        let World { scene, lights, .. } = self.world;
        // Rectangles light what lies before them, not what surrounds them.
        let aims = Aims::new(point, &lights, scene, |light| !matches!(light, Light::Quad(_)));
        let eye = to_eye.filter(|_| !phase.is_isotropic()).map(|to_eye| (to_eye, phase));
        let mixture = Mixture { aims, eye, guide, count, shift };
        self.expanded(phase, higher, to_eye.map(|eye| (eye, SURFACE_POWER)), |into, seen| {
            let (mut sums, mut openings) = (Sums::default(), Openings::default());
            for j in 0..count {
                let (direction, pdf) = mixture.direction(j, &warp::uniform_sphere, &|_| warp::uniform_sphere_pdf());
                let ray = Ray::new(point, direction);
                let marching = Marching { steps: self.walk.steps, offset: uniform(rng) };
                let end = nearest_surface(&ray, scene);
                let through = || self.through(&ray, end.as_ref(), marching);
                let arrival = self.arriving(&ray, end.as_ref(), pdf * count as f32, through, &mut child);
                if let Some(learnt) = &mut learnt {
                    let found =
                        arrival.as_ref().map_or(0.0, |arrival| arrival.irradiance.mean()) * counts(eye, direction);
                    learnt.add(direction, found * count as f32, pdf, count);
                }
                if let Some(arrival) = arrival {
                    let arrival = self.steadied(arrival);
                    let light = arrival.scatter_directional(into.moments, 1.0, into.coefficients);
                    seen.add(&arrival, phase);
                    openings.add_sky(end.as_ref(), light.radiance);
                    sums.add(&light, true);
                }
                openings.add_surface(end.as_ref(), pdf);
            }
            sums.add_norm(openings.norm());
            sums
        })
    }

    /// Light scattered more than once, the last time at `point`, from `paths` random walks. As
    /// [`Estimator::single`].
    pub fn multiple<'g>(
        &self,
        point: Vec3,
        phase: &Phase,
        paths: impl Into<Looks<'g>>,
        higher: &mut [Coefficient],
        rng: &mut impl Rng,
    ) -> Sums {
        let (walk, shift, offset) = (self.walker(), uniform2(rng), uniform(rng));
        let Looks { count, guide, mut learnt, to_eye } = paths.into();
        let share = 1.0 / count.max(1) as f32;
        let aims = Aims::new(point, &self.world.lights, self.world.scene, |_| true);
        let eye = to_eye.filter(|_| !phase.is_isotropic()).map(|to_eye| (to_eye, phase));
        let mixture = Mixture { aims, eye, guide, count, shift };
        self.expanded(phase, higher, to_eye.map(|eye| (eye, MULTIPLE_POWER)), |into, towards| {
            let (mut cones, mut seen) = (Cones::default(), Cones::default());
            for j in 0..count {
                let (to_light, pdf) = mixture.direction(j, &warp::uniform_sphere, &|_| warp::uniform_sphere_pdf());
                let ray = Ray::new(point, to_light);
                let end = nearest_surface(&ray, self.world.scene);
                let collision = walk.first(&ray, end.as_ref(), third(j, offset), false, rng).collision;
                let incoming = self.walked(&walk, &Start { ray, end, pdf, collision }, MOST_MIRRORS, rng) * share;
                if let Some(learnt) = &mut learnt {
                    let found = incoming.irradiance.mean() * counts(eye, to_light);
                    learnt.add(to_light, found * count as f32, pdf, count);
                }
                let mean = incoming.scatter_directional(into.moments, 1.0, into.coefficients);
                cones.add(to_light, &mean);
                if let Some((to_eye, phase)) = eye {
                    let light = towards.add(&incoming, phase).unwrap_or_else(|| incoming.scatter(to_eye, phase));
                    seen.add(to_light, &light);
                }
            }
            let mut sums = cones.sums();
            if eye.is_none() {
                // Expansions change faster than their mean over directions.
                let faster = phase.mean_cosine().map(|g| 1.0 / (1.0 - g.abs()).max(LEAST_BREADTH));
                sums.gradient_norms *= faster;
                sums.unshadowed_gradient_norms *= faster;
            } else {
                // Radii by what is seen.
                let seen = seen.sums();
                let scale = seen.value.zip(sums.value, |seen, mean| if seen > 0.0 { mean / seen } else { 1.0 });
                (sums.gradient_norms, sums.unshadowed_gradient_norms) =
                    (seen.gradient_norms * scale, seen.unshadowed_gradient_norms * scale);
            }
            sums
        })
    }

    /// Light scattered in the medium along a ray, by one walk that ends where caches know the rest.
    fn walked(&self, walk: &Walk<'_, M, S>, start: &Start, mirrors: u32, rng: &mut impl Rng) -> Incoming {
        let mut child = Generator::child(rng);
        let outgoing = |ray: &Ray, hit: &Hit| self.sent_back(ray, hit, mirrors, &mut child);
        let mut cells = Cells { photons: self.photons, sharp: 1.0 };
        self.steadied(walk.along(start, outgoing, &mut cells, rng))
    }

    /// An arrival whose gradient is no larger than [`Estimator::finest`] lets it be.
    fn steadied(&self, arrival: Arrival) -> Arrival {
        // At 0 nothing is too steep; a black channel over it would be no number.
        if !(self.finest > 0.0) {
            return arrival;
        }
        let steepest = arrival.irradiance / self.finest;
        let scale = steepest.zip(arrival.gradient.norm(), |most, norm| if norm > most { most / norm } else { 1.0 });
        Arrival { gradient: arrival.gradient * scale, turning: arrival.turning.min(steepest), ..arrival }
    }

    /// Indirect irradiance (W·m⁻²) at `point` on a surface with `normal`, from `paths` directions:
    /// light from other surfaces and the sky through the medium, and light scattered in the medium. Its gradient
    /// is that of a move along the surface with the normal held.
    ///
    /// ```text
    /// E = ∫ cos θ (T L_surface + ∫ T σₛ L_i dt) dω,   ∇E: light from a surface as an area light that
    /// stays, light from the medium as Shift says, ∇(cos θ) included in both
    /// ```
    pub fn irradiance<'g>(
        &self,
        point: Vec3,
        normal: Vec3,
        paths: impl Into<Looks<'g>>,
        rng: &mut impl Rng,
    ) -> (Sums, Facing) {
        let Looks { count, guide, mut learnt, .. } = paths.into();
        let (mut sums, mut scattered, mut turn) = (Sums::default(), Cones::default(), Gradient::ZERO);
        let mut openings = Openings::default();
        let mut child = Generator::child(rng);
        let (frame, walk, shift, offset) = (Frame::around(normal), self.walker(), uniform2(rng), uniform(rng));
        let share = 1.0 / count.max(1) as f32;
        let outside = leave(point, normal, normal, 0.0);
        let aims = Aims::new(outside, &self.world.lights, self.world.scene, |_| true);
        let mixture = Mixture { aims, eye: None, guide, count, shift };
        for j in 0..count {
            let upwards = |u| frame.to_world(warp::cosine_hemisphere(u));
            let cosine_pdf = |direction| warp::cosine_hemisphere_pdf(normal.dot(direction).max(0.0));
            let (to_light, pdf) = mixture.direction(j, &upwards, &cosine_pdf);
            let cosine = normal.dot(to_light);
            if cosine <= 0.0 {
                if let Some(learnt) = &mut learnt {
                    learnt.add(to_light, 0.0, pdf, count);
                }
                continue;
            }
            let weight = share * cosine / pdf;
            let ray = Ray::new(leave(point, normal, to_light, 0.0), to_light);
            let mut total = Contribution::ZERO;
            let end = nearest_surface(&ray, self.world.scene);
            let shines = end.is_some() || !self.world.lights.sky(to_light).is_black();
            let flown = walk.first(&ray, end.as_ref(), third(j, offset), shines, rng);
            // How the cosine changes as what is seen stays.
            let tilt = (to_light * cosine - normal) / cosine.max(MIN_COSINE);
            let through = || flown.whole.unwrap_or_default().transmittance();
            if let Some(arrival) = self.arriving(&ray, end.as_ref(), 1.0, through, &mut child) {
                let light = tilted(&self.steadied(arrival), tilt) * weight;
                openings.add_sky(end.as_ref(), light.radiance);
                sums.add(&light, true);
                total += light;
            }
            openings.add_surface(end.as_ref(), pdf / cosine);
            let start = Start { ray, end, pdf: 1.0, collision: flown.collision };
            let light = tilted(&self.walked(&walk, &start, MOST_MIRRORS, rng), tilt) * weight;
            scattered.add(to_light, &light);
            total += light;
            if let Some(learnt) = &mut learnt {
                learnt.add(to_light, total.radiance.mean() * count as f32, pdf, count);
            }
            turn += Gradient::outer(total.radiance, to_light / cosine.max(MIN_COSINE));
        }
        sums.add_norm(openings.norm());
        sums.merge(&scattered.sums());
        (sums, Facing { normal, turn })
    }

    /// Transmittance of a ray up to its `end`.
    fn through(&self, ray: &Ray, end: Option<&Hit>, marching: Marching) -> Transmittance {
        let length = end.map_or(f32::INFINITY, |hit| hit.distance);
        transmittance_with_gradients(&ray.with_length(length), self.world.medium, marching)
    }

    /// Light that arrives along a ray from its `end`, the nearest surface, or without one from the sky.
    fn arriving(
        &self,
        ray: &Ray,
        end: Option<&Hit>,
        pdf: f32,
        through: impl FnOnce() -> Transmittance,
        rng: &mut Generator,
    ) -> Option<Arrival> {
        let sky = || self.world.lights.sky(ray.direction);
        let radiance = end.map_or_else(sky, |hit| self.outgoing(ray, hit, rng));
        Arrival::from_end(ray, end, radiance, pdf, through)
    }

    /// Radiance (W·m⁻²·sr⁻¹) that a surface sends back along a ray, but for its own emission.
    pub fn outgoing(&self, ray: &Ray, hit: &Hit, rng: &mut Generator) -> Spectrum {
        self.sent_back(ray, hit, MOST_MIRRORS, rng)
    }

    /// The same, past so many more surfaces that send rays on.
    fn sent_back(&self, ray: &Ray, hit: &Hit, mirrors: u32, rng: &mut Generator) -> Spectrum {
        let point = ray.at(hit.distance);
        let Surface::Lambert { reflectance } = hit.surface else {
            // What glows on the way of a path is in none of its parts alone.
            if self.world.medium.is_emissive() {
                let before = leave(point, hit.normal, -ray.direction, hit.distance);
                return self.traced(&Ray { origin: before, ..*ray }, rng);
            }
            return self.sent_on((point, hit, -ray.direction), mirrors, rng);
        };
        // One-sided: black from behind.
        if reflectance.is_black() || !hit.faces(-ray.direction) {
            return Spectrum::ZERO;
        }
        let direct = self.direct(point, hit, rng);
        let known = self.surfaces.and_then(|(cache, reading)| cache.lookup(point, hit.shading, &reading));
        let indirect = known.unwrap_or_else(|| self.indirect(point, hit, rng));
        lambert::value(reflectance) * (direct + indirect)
    }

    /// Radiance (W·m⁻²·sr⁻¹) that a surface which is not Lambertian sends `to_eye`, but for its own emission: by a connection, what is known of its diffuse base, and a ray that goes on.
    fn sent_on(&self, (point, hit, to_eye): (Vec3, &Hit, Vec3), mirrors: u32, rng: &mut Generator) -> Spectrum {
        let base = known_base(hit, to_eye);
        let look_up = || self.surfaces.and_then(|(cache, reading)| cache.lookup(point, hit.shading, &reading));
        let known = if base.is_black() { None } else { look_up() };
        let base = if known.is_some() { base } else { Spectrum::ZERO };
        let mut light = lambert::value(base) * known.unwrap_or_default();
        if !hit.surface.is_discrete() {
            let random = (uniform(rng), uniform2(rng));
            light += self.reflected_but(base, (point, hit, to_eye), random, rng);
        }
        let (choice, turn) = (uniform(rng), uniform2(rng));
        let Some(onward) = Onward::draw((point, hit, to_eye), base, choice, turn) else { return light };
        light += onward.straight(&self.world, Marching { steps: self.walk.steps, offset: uniform(rng) });
        light + onward.rest * self.seen_along(&onward.ray, mirrors, rng)
    }

    /// Radiance at the origin of a ray but for light straight from the lights and a sky: from the surface at its end and from the medium, or, past all `mirrors`, by one path.
    fn seen_along(&self, ray: &Ray, mirrors: u32, rng: &mut Generator) -> Spectrum {
        let Some(mirrors) = mirrors.checked_sub(1) else { return self.traced(ray, rng) };
        let (walk, end) = (self.walker(), nearest_surface(ray, self.world.scene));
        let flown = walk.first(ray, end.as_ref(), uniform(rng), end.is_some(), rng);
        let start = Start { ray: *ray, end, pdf: 1.0, collision: flown.collision };
        let scattered = self.walked(&walk, &start, mirrors, rng).irradiance;
        let Some(hit) = &end else { return scattered };
        let through = flown.whole.unwrap_or_default().value.transmitted();
        scattered + through * self.sent_back(ray, hit, mirrors, rng)
    }

    /// Irradiance (W·m⁻²) from the lights but a sky, by one connection.
    pub fn direct(&self, point: Vec3, hit: &Hit, rng: &mut Generator) -> Spectrum {
        let random = (uniform(rng), uniform2(rng));
        self.direct_at(point, hit, false, random, rng)
    }

    /// [`Estimator::direct`] with given random numbers for the choice of light and the point on it, and `with_sky` where
    /// nothing else brings its light.
    pub fn direct_at(
        &self,
        point: Vec3,
        hit: &Hit,
        with_sky: bool,
        random: (f32, Vec2),
        rng: &mut Generator,
    ) -> Spectrum {
        let weight = FromPoint { sky: with_sky, ..FromPoint::all(point) };
        let chosen = self.world.lights.pick(&weight, random.0);
        let offered = chosen.and_then(|chosen| self.offered_at((chosen, random.1), point, hit, None));
        offered.map_or(Spectrum::ZERO, |connection| self.arrived(&connection, uniform(rng)))
    }

    /// A connection of a surface with a light that was chosen: of what arrives, or of what is reflected to an eye, but for light of a sky that a base of this albedo reflects.
    pub(super) fn offered_at(
        &self,
        chosen: (Choice, Vec2),
        point: Vec3,
        hit: &Hit,
        to_eye: Option<(Vec3, Spectrum)>,
    ) -> Option<Connection> {
        let sky = self.world.lights[chosen.0.index].is_sky();
        let origin = |to_light: Vec3| leave(point, hit.normal, to_light, hit.distance);
        let value = |to_light: Vec3, pdf: f32| {
            let faces = hit.faces(to_light);
            let Some((to_eye, base)) = to_eye else {
                return Spectrum::splat(if faces { hit.cosine(to_light) } else { 0.0 });
            };
            let known = if sky && faces { lambert::value(base) } else { Spectrum::ZERO };
            let value = (hit.value(to_eye, to_light) - known) * hit.cosine(to_light).abs();
            if !hit.surface.is_followed() || pdf <= 0.0 || value.is_black() {
                return value;
            }
            value * mis::power(pdf, hit.pdf(to_eye, to_light))
        };
        self.offered(chosen, point, &origin, &value)
    }

    /// Irradiance (W·m⁻²) that is not straight from the lights but from a sky, by one path.
    pub fn indirect(&self, point: Vec3, hit: &Hit, rng: &mut Generator) -> Spectrum {
        let to_light = Frame::around(hit.shading).to_world(warp::cosine_hemisphere(uniform2(rng)));
        if !hit.faces(to_light) {
            return Spectrum::ZERO;
        }
        let origin = leave(point, hit.normal, to_light, hit.distance);
        let ray = Ray::new(origin, to_light);
        let mut light = self.traced(&ray, rng);
        let sky = self.world.lights.sky(to_light);
        if !sky.is_black() && nearest_surface(&ray, self.world.scene).is_none() {
            let marching = Marching { steps: self.walk.steps, offset: uniform(rng) };
            light += sky * transmittance(&ray, self.world.medium, marching);
        }
        light * float::PI
    }

    /// Radiance (W·m⁻²·sr⁻¹) that a surface of any kind sends `to_eye` from the lights, by one connection; weighed against
    /// what a ray that follows the surface's lobes runs into, where there is one ([`Surface::is_followed`]).
    pub fn reflected(
        &self,
        point: Vec3,
        hit: &Hit,
        to_eye: Vec3,
        random: (f32, Vec2),
        rng: &mut Generator,
    ) -> Spectrum {
        self.reflected_but(Spectrum::ZERO, (point, hit, to_eye), random, rng)
    }

    /// The same, but for light of a sky that a base of this albedo reflects.
    fn reflected_but(
        &self,
        base: Spectrum,
        (point, hit, to_eye): (Vec3, &Hit, Vec3),
        random: (f32, Vec2),
        rng: &mut Generator,
    ) -> Spectrum {
        let chosen = self.world.lights.pick(&FromPoint::all(point), random.0);
        let offered = chosen.and_then(|chosen| self.offered_at((chosen, random.1), point, hit, Some((to_eye, base))));
        offered.map_or(Spectrum::ZERO, |connection| self.arrived(&connection, uniform(rng)))
    }

    /// Light of all lights but a sky, scattered once at `point` towards `to_eye`: one sample of each, or of those that stand
    /// for many.
    pub fn towards(&self, point: Vec3, to_eye: Vec3, phase: &Phase, rng: &mut Generator) -> Spectrum {
        let (towards, world) = (Towards { to_eye, phase }, self.world);
        let settings = single_scatter::Settings { samples: 1, steps: self.walk.steps };
        let of = |lights| single_scatter::sample(point, &towards, &World { lights, ..world }, &settings, rng).value;
        self.world.lights.but_sky().map(of).sum()
    }

    /// Light of surfaces and the sky, scattered once at `point` towards `to_eye`: one direction.
    pub fn surface_towards(&self, point: Vec3, to_eye: Vec3, phase: &Phase, rng: &mut Generator) -> Spectrum {
        let mut child = Generator::child(rng);
        let sample = phase.sample(to_eye, uniform2(rng));
        let ray = Ray::new(point, sample.to_light);
        let marching = Marching { steps: self.walk.steps, offset: uniform(rng) };
        let end = nearest_surface(&ray, self.world.scene);
        let through = || self.through(&ray, end.as_ref(), marching);
        let arrival = self.arriving(&ray, end.as_ref(), sample.pdf, through, &mut child);
        arrival.map_or(Spectrum::ZERO, |arrival| arrival.scatter(to_eye, phase).radiance)
    }

    /// Light scattered more than once, the last time at `point` towards `to_eye`: one walk.
    pub fn multiple_towards(&self, point: Vec3, to_eye: Vec3, phase: &Phase, rng: &mut Generator) -> Spectrum {
        let (walk, sample) = (self.walker(), phase.sample(to_eye, uniform2(rng)));
        let ray = Ray::new(point, sample.to_light);
        let end = nearest_surface(&ray, self.world.scene);
        let collision = walk.first(&ray, end.as_ref(), uniform(rng), false, rng).collision;
        let incoming = self.walked(&walk, &Start { ray, end, pdf: sample.pdf, collision }, MOST_MIRRORS, rng);
        incoming.scatter(to_eye, phase).radiance
    }

    /// Radiance at the origin of a ray but for emission seen directly, by one path.
    fn traced(&self, ray: &Ray, rng: &mut Generator) -> Spectrum {
        let seen = path::radiance(&Ray::new(ray.origin, ray.direction), &self.world, &self.paths, rng);
        seen.total() - seen.emitted
    }

    fn walker(&self) -> Walk<'_, M, S> {
        Walk { world: self.world, settings: self.walk }
    }

    /// Runs a directional estimate and cuts off its degree 0, which the record itself holds. Where there is room for it and an eye that looks from a direction, what
    /// the expansion leaves out of the light that was scattered so many times towards it becomes a lobe.
    fn expanded(
        &self,
        phase: &Phase,
        attached: &mut [Coefficient],
        eye: Option<(Vec3, u32)>,
        estimate: impl FnOnce(&mut Directional<'_>, &mut Seen) -> Sums,
    ) -> Sums {
        attached.fill(Coefficient::ZERO);
        let (higher, lobe) = attached.split_at_mut(coefficients_of(attached.len()));
        // What there is no degree for stays 0.
        let degree = crate::sh::degree_of(higher.len() + 1).unwrap_or(0);
        let moments = single_scatter::moments(phase, degree);
        let mut all = [Coefficient::ZERO; crate::sh::MAX_COEFFICIENTS];
        let all = &mut all[..crate::sh::coefficient_count(degree)];
        let mut seen = Seen::default();
        let mut sharpness = 0.0;
        if let Some((to_eye, power)) = eye.filter(|_| !lobe.is_empty()) {
            sharpness = lobe::sharpness(phase, degree, power);
            seen.to_eye = (sharpness > 0.0).then_some(to_eye);
        }
        let sums = estimate(&mut Directional { moments: &moments[..=degree], coefficients: all }, &mut seen);
        if let Some(to_eye) = seen.to_eye {
            let known = Expanded::new(to_eye, all);
            let (value, gradient) = (seen.light.radiance - known.value, seen.light.gradient - known.gradient);
            let turn = seen.turn - known.turn;
            lobe.copy_from_slice(&Lobe { to_eye, sharpness, value, gradient, turn }.attached());
        }
        higher.iter_mut().zip(&all[1..]).for_each(|(slot, found)| *slot = *found);
        sums
    }
}

/// Light towards an eye, and how it changes as that direction turns.
#[derive(Debug, Default)]
struct Seen {
    to_eye: Option<Vec3>,
    light: Contribution,
    turn: Gradient,
}

impl Seen {
    /// Adds what a phase function makes of light that arrives; the light that is seen of it.
    #[inline]
    fn add(&mut self, arrival: &Arrival, phase: &Phase) -> Option<Contribution> {
        let to_eye = self.to_eye?;
        let light = arrival.scatter(to_eye, phase);
        self.light += light;
        self.turn += arrival.turned(to_eye, phase);
        Some(light)
    }
}

/// What an expansion says of one direction.
struct Expanded {
    value: Spectrum,
    gradient: Gradient,
    turn: Gradient,
}

impl Expanded {
    fn new(to_eye: Vec3, coefficients: &[Coefficient]) -> Self {
        let (mut basis, mut slopes) = ([0.0; crate::sh::MAX_COEFFICIENTS], [Vec3::ZERO; crate::sh::MAX_COEFFICIENTS]);
        let degree = crate::sh::degree_of(coefficients.len()).unwrap_or(0);
        crate::sh::evaluate_with_gradients(to_eye, degree, &mut basis, &mut slopes);
        let (mut value, mut gradient, mut turn) = (Spectrum::ZERO, Gradient::ZERO, Gradient::ZERO);
        for ((c, y), slope) in coefficients.iter().zip(basis).zip(slopes) {
            value += c.value * y;
            gradient += c.gradient * y;
            turn += Gradient::outer(c.value, slope);
        }
        Self { value, gradient, turn }
    }
}

/// Arriving light with the change of its cosine, relative to the cosine, as its direction turns.
fn tilted(arrival: &Arrival, tilt: Vec3) -> Contribution {
    let gradient = arrival.gradient + Gradient::outer(arrival.turning, tilt);
    Contribution { radiance: arrival.irradiance, gradient }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A red sky over a black floor, seen without a bound on steepness and with more coefficients than there are degrees for.
    #[test]
    fn no_bound_and_too_many_coefficients_leave_numbers() {
        let sky = [Light::Constant(Spectrum::new(1.0, 0.0, 0.0))];
        let world = World { medium: &crate::host::Empty, scene: &crate::host::Empty, lights: (&sky).into() };
        let walk = multiple_scatter::Settings::new(crate::transmittance::thickness::Steps::Length(0.1));
        let paths = path::Settings::default();
        let estimator = Estimator { world, surfaces: None, photons: None, walk, paths, light_samples: 1, finest: 0.0 };
        let mut higher = [Coefficient::ZERO; 399];
        let sums = estimator.surface(Vec3::ZERO, &Phase::ISOTROPIC, 8, &mut higher, &mut Generator::new(1));
        assert!((sums.value[0] - 1.0).abs() < 1e-5 && sums.value[1] == 0.0, "{sums:?}");
        assert!(sums.gradient.is_finite() && sums.gradient_norms.is_finite());
        assert!(higher.iter().all(|c| c.value.is_finite() && c.gradient.is_finite()));
        let (sums, facing) = estimator.irradiance(Vec3::ZERO, Vec3::Z, 8, &mut Generator::new(1));
        assert!(sums.gradient.is_finite() && facing.turn.is_finite());
    }

    /// Two mirrors, at x = ±1, between a floor and a ceiling, at z = ±1.
    struct Corridor;

    impl Scene for Corridor {
        fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
            let plane = |axis: Vec3, surface: Surface| {
                let along = axis.dot(ray.direction);
                let normal = -axis * along.signum();
                let distance = (along.signum() - axis.dot(ray.origin)) / along;
                (distance > 0.0).then_some(Hit { distance, normal, shading: normal, surface, light: None })
            };
            let mirror = plane(Vec3::X, Surface::Mirror { reflectance: Spectrum::splat(0.9) });
            let wall = plane(Vec3::Z, Surface::Lambert { reflectance: Spectrum::splat(0.6) });
            let nearest = mirror.into_iter().chain(wall).min_by(|a, b| a.distance.total_cmp(&b.distance));
            nearest.filter(|hit| hit.distance < ray.length)
        }
    }

    /// Of light that comes by few mirrors and by many, and of what fog scatters on the way.
    #[test]
    fn light_past_mirrors_is_that_of_paths_and_varies_less() {
        let fog =
            crate::medium::Homogeneous::new(Spectrum::splat(0.1), Spectrum::splat(0.3), Phase::ISOTROPIC).unwrap();
        let lamp = crate::light::SphereLight::new(Vec3::new(0.3, 0.5, 0.6), 0.1, Spectrum::splat(10.0)).unwrap();
        let lights = [Light::Sphere(lamp)];
        let world = World { medium: &fog, scene: &Corridor, lights: (&lights).into() };
        let walk = multiple_scatter::Settings::new(crate::transmittance::thickness::Steps::Length(0.1));
        let paths = path::Settings::default();
        let estimator = Estimator { world, surfaces: None, photons: None, walk, paths, light_samples: 1, finest: 0.0 };
        let mut rng = Generator::new(7);
        let (mut varies, mut of_paths) = (0.0, 0.0);
        for steepness in [0.6, 0.2, 0.05] {
            let ray = Ray::new(Vec3::ZERO, Vec3::new(1.0, 0.1, -steepness).normalize());
            let (hit, count) = (Corridor.closest_hit(&Ray::new(ray.origin, Vec3::X)).unwrap(), 20_000);
            let hit = Hit { distance: hit.distance / ray.direction.x, ..hit };
            let before = leave(ray.at(hit.distance), hit.normal, -ray.direction, hit.distance);
            let mut of = |sample: &mut dyn FnMut(&mut Generator) -> Spectrum| {
                let (mut sum, mut squares) = (0.0, 0.0);
                for _ in 0..count {
                    let light = f64::from(sample(&mut rng).mean());
                    (sum, squares) = (sum + light, squares + light * light);
                }
                let mean = sum / f64::from(count);
                (mean, squares / f64::from(count) - mean * mean)
            };
            let (found, variance) = of(&mut |rng| estimator.outgoing(&ray, &hit, rng));
            let (traced, by_paths) = of(&mut |rng| estimator.traced(&Ray { origin: before, ..ray }, rng));
            let error = ((variance + by_paths) / f64::from(count)).sqrt();
            assert!((found - traced).abs() < 3.5 * error && error < 0.04 * traced, "{found} {traced} ± {error}");
            (varies, of_paths) = (varies + variance, of_paths + by_paths);
        }
        assert!(varies < 0.7 * of_paths, "{varies} {of_paths}");
    }
}
