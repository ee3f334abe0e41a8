//! Connections of eye rays to many lights: more are tried than are followed.

use glam::{Vec2, Vec3};

use super::connect::Connection;
use super::estimate::Estimator;
use crate::host::{Hit, Medium, Properties, Scene};
use crate::light::{Except, FromPoint, FromRay, LightSample, Question, scattered};
use crate::math::{Ray, float};
use crate::phase::{Lobe, Phase, deflection};
use crate::sampling::discrete::Choice;
use crate::sampling::{Generator, uniform, uniform2};
use crate::spectrum::Spectrum;
use crate::surface::Surface;
use crate::surface::specular::mirrored;
use crate::transmittance::thickness::{Marching, optical_thickness};
use crate::world::NearLight;

/// Most that wait to be drawn among. More: memory on the stack; fewer: where a ray has very many points, some are drawn for each part of them.
const MOST: usize = 64;

/// Tried along a segment for each that is followed. More: less noise of the light that was chosen and of where, for a look at the medium each.
const ALONG: u32 = 2;

/// Tried from a point, and from a surface for each that would be followed where lights are few. More: less noise of the light that was chosen; fewer: time.
const TRIED: u32 = 4;

/// Connections from a surface at most, where one is not as good as several. More: shadow rays for what samples of a pixel average as well; fewer: which light, and which part of it, makes most of the noise.
pub(super) const FROM_SURFACES: u32 = 4;

/// The golden ratio and the plastic numbers: multiples of them, wrapped, fill the unit interval and square evenly.
const STEPS: [f32; 3] = [0.618_034, 0.754_877_67, 0.569_840_3];

/// The `k`th number, in [0, 1), of the `i`th of three sequences, which begins at `start`.
pub(super) fn wrapped(start: f32, i: usize, k: u32) -> f32 {
    let x = start + STEPS[i] * k as f32;
    (x - libm::floorf(x)).min(1.0 - f32::EPSILON)
}

/// A Phong surface as a question about lights sees it: the phase function of a medium that scatters about as the surface reflects (a Henyey–Greenstein lobe as high as
/// the Phong lobe, `(1 − g)² ≈ 1/(s + 2)`, and an isotropic one), and the direction in which light from the mirror's goes straight on. Approximate: it decides what is tried, not
/// what that brings. None for surfaces that eye rays follow: light that is met there is weighed against connections by what arrives.
fn as_medium(hit: &Hit, to_eye: Vec3) -> Option<(Vec3, Phase)> {
    let Surface::Phong { diffuse, specular, exponent } = hit.surface else { return None };
    let g = 1.0 - 1.0 / float::sqrt(exponent + 2.0);
    let lobes = [(diffuse, Phase::ISOTROPIC), (specular, Phase::from(Lobe::HenyeyGreenstein { g }))];
    let phase = Phase::mix(lobes).ok()?;
    Some((-mirrored(to_eye, hit.shading), phase))
}

/// A connection that was tried.
struct Offer {
    connection: Connection,
    /// What of its light reaches the eye.
    weight: Spectrum,
    /// Whether a surface reflects it, rather than that the medium scatters it.
    is_reflected: bool,
    /// What it would bring if nothing lay in between.
    guess: f32,
}

/// Connections of an eye ray to lights that are too many to be looked at each by itself.
///
/// There, which light was chosen is most of the noise of a connection; what it would bring if nothing lay in between is known at a fraction of what it costs to see what
/// does lie there. So many are tried, and those that are followed are drawn among them, all along a ray, in proportion to that: resampled importance sampling (Talbot et al.
/// 2005), with evenly spread draws.
///
/// ```text
/// ∫ f V  ≈  Σ w/n · Σ V(drawn)      w = f/(m p) of each of m that are tried with density p; n are drawn, in the mean n w/Σ w times each
/// ```
pub(super) struct Offers<'a, M: ?Sized, S: ?Sized> {
    estimator: &'a Estimator<'a, M, S>,
    connections: u32,
    waiting: heapless::Vec<Offer, MOST>,
    /// Light of those that were followed (W·m⁻²·sr⁻¹): scattered by the medium, and reflected by surfaces.
    pub arrived: [Spectrum; 2],
}

impl<'a, M: Medium + ?Sized, S: Scene + ?Sized> Offers<'a, M, S> {
    /// Follows as many for each part of a ray as if lights were few.
    pub(super) fn new(estimator: &'a Estimator<'a, M, S>, connections: u32) -> Self {
        let connections = connections.clamp(1, MOST as u32 / ALONG);
        Self { estimator, connections, waiting: heapless::Vec::new(), arrived: [Spectrum::ZERO; 2] }
    }

    /// Tries lights within whose near fields a segment runs.
    pub(super) fn along(&mut self, segment: &Ray, throughput: Spectrum, start: [f32; 2], rng: &mut Generator) {
        let world = &self.estimator.world;
        let lights = world.lights;
        let tried = ALONG * self.connections;
        let sent = FromRay { ray: *segment, near: 0.0, far: segment.length, steep: true, until: None };
        let survey = lights.survey(&sent);
        let mut found = heapless::Vec::<(f32, Connection), MOST>::new();
        for k in 0..tried {
            let Some(chosen) = survey.pick(wrapped(start[0], 0, k)) else { continue };
            let near = NearLight::of(&lights[chosen.index], segment, 0.0, segment.length);
            let u = (k as f32 + start[1]) / tried as f32;
            let Some(joint) = near.and_then(|near| near.join(segment, u, uniform2(rng))) else { continue };
            let Some(LightSample { source, incident, .. }) = joint.light(|| uniform2(rng)) else { continue };
            let properties = world.medium.properties(joint.point);
            let value = properties.phase.value(deflection(incident.to_light, -segment.direction));
            let light = properties.scattering * value * incident.irradiance;
            let share = chosen.probability * joint.pdf * tried as f32;
            // By distance, so that transmittance is marched once for all.
            let at = found.iter().position(|(distance, _)| *distance > joint.distance).unwrap_or(found.len());
            let _ = found.insert(at, (joint.distance, Connection { from: joint.point, source, light, share }));
        }
        let marching = Marching { steps: self.estimator.walk.steps, offset: uniform(rng) };
        let (mut from, mut thickness) = (0.0, Spectrum::ZERO);
        for (distance, connection) in found {
            let part = Ray::new(segment.at(from), segment.direction).with_length(distance - from);
            thickness += optical_thickness(&part, world.medium, marching);
            from = distance;
            self.offer(connection, throughput * thickness.transmitted(), false, rng);
        }
    }

    /// Tries, from the `k`th point of a ray, lights in whose near fields it does not lie; `weight` is what of its scattering reaches the eye.
    pub(super) fn at_point(
        &mut self,
        (point, to_eye, properties): (Vec3, Vec3, &Properties),
        weight: Spectrum,
        sky: bool,
        (start, k): ([f32; 3], u32),
        rng: &mut Generator,
    ) {
        let (estimator, phase) = (self.estimator, &properties.phase);
        let to = FromPoint { except: Except::Steep, sky, ..FromPoint::all(point) };
        let question = scattered(to, to_eye, phase);
        let survey = estimator.world.lights.survey(&question);
        let connection = |chosen| estimator.offered_by_medium(chosen, point, to_eye, phase);
        let first = self.tried(&|u| survey.pick(u), &connection, (TRIED, k), (weight, false), start, rng);
        if let Some(chosen) = first {
            self.arrived[0] += weight * estimator.met(chosen, point, to_eye, phase, rng);
        }
    }

    /// Tries lights from a surface, of what arrives or, where an eye is given, of what is reflected to it; `weight` is what of that reaches the eye. `sky`: whether a sky counts among what
    /// arrives; it always does among what is reflected, but for what a base of the albedo given beside the eye reflects of it.
    pub(super) fn at_surface(
        &mut self,
        (point, hit, to_eye): (Vec3, &Hit, Option<(Vec3, Spectrum)>),
        weight: Spectrum,
        sky: bool,
        start: [f32; 3],
        rng: &mut Generator,
    ) {
        let estimator = self.estimator;
        let to = FromPoint { sky: sky || to_eye.is_some(), ..FromPoint::all(point) };
        let lobe = to_eye.and_then(|(to_eye, _)| as_medium(hit, to_eye));
        let shown = lobe.as_ref().map(|(from_mirror, phase)| scattered(to, *from_mirror, phase));
        let question: &dyn Question = if let Some(shown) = &shown { shown } else { &to };
        let survey = estimator.world.lights.survey(question);
        let connection = |chosen| estimator.offered_at(chosen, point, hit, to_eye);
        let count = TRIED * self.connections.min(FROM_SURFACES);
        self.tried(&|u| survey.pick(u), &connection, (count, 0), (weight, true), start, rng);
    }

    /// Tries so many lights from a place, and returns the first.
    fn tried(
        &mut self,
        pick: &dyn Fn(f32) -> Option<Choice>,
        connection: &dyn Fn((Choice, Vec2)) -> Option<Connection>,
        (count, group): (u32, u32),
        (weight, is_reflected): (Spectrum, bool),
        start: [f32; 3],
        rng: &mut Generator,
    ) -> Option<Choice> {
        let mut first = None;
        for k in count * group..count * (group + 1) {
            let [choice, u, v] = [0, 1, 2].map(|i| wrapped(start[i], i, k));
            let Some(chosen) = pick(choice) else { continue };
            first = first.or(Some(chosen));
            if let Some(connection) = connection((chosen, Vec2::new(u, v))) {
                self.offer(connection, weight / count as f32, is_reflected, rng);
            }
        }
        first
    }

    fn offer(&mut self, connection: Connection, weight: Spectrum, is_reflected: bool, rng: &mut Generator) {
        let guess = (weight * connection.light).map(f32::abs).mean() / connection.share;
        if guess > 0.0 && guess.is_finite() {
            if self.waiting.is_full() {
                self.settle(rng);
            }
            let _ = self.waiting.push(Offer { connection, weight, is_reflected, guess });
        }
    }

    /// Follows some of those that were tried.
    pub(super) fn settle(&mut self, rng: &mut Generator) {
        let count = self.connections + self.connections.min(FROM_SURFACES);
        let total: f32 = self.waiting.iter().map(|offer| offer.guess).sum();
        let step = total / count as f32;
        let (mut sum, mut next) = (0.0, uniform(rng) * step);
        for Offer { connection, weight, is_reflected, guess } in &self.waiting {
            sum += guess;
            let mut times = 0.0;
            while next < sum && times < count as f32 {
                (next, times) = (next + step, times + 1.0);
            }
            if times > 0.0 {
                let light = self.estimator.arrived(connection, uniform(rng));
                self.arrived[usize::from(*is_reflected)] += *weight * light * (times * step / guess);
            }
        }
        self.waiting.clear();
    }
}

#[cfg(all(test, feature = "alloc"))]
mod tests {
    use alloc::vec::Vec;

    use super::*;
    use crate::cache::{Caches, RaySettings, radiance};
    use crate::light::{Light, LightTree, Lights, PointLight, SphereLight, SpotLight, Sun};
    use crate::medium::Homogeneous;
    use crate::transmittance::thickness::Steps;
    use crate::world::World;
    use crate::{multiple_scatter, path};

    /// A floor at height 0, a plate above a part of it, and balls of light, of which one may be the only light.
    struct Room<'a> {
        floor: Surface,
        lights: &'a [Light<'a>],
        only: Option<usize>,
    }

    impl Scene for Room<'_> {
        fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
            let mut nearest: Option<Hit> = None;
            let mut meet = |distance: f32, normal, surface, light| {
                if distance > 0.0 && distance < nearest.map_or(ray.length, |hit| hit.distance) {
                    nearest = Some(Hit { distance, normal, shading: normal, surface, light });
                }
            };
            meet(-ray.origin.z / ray.direction.z, Vec3::Z, self.floor, None);
            let plate = (0.8 - ray.origin.z) / ray.direction.z;
            if ray.at(plate).truncate().abs().max_element() < 0.4 {
                meet(plate, Vec3::Z, Surface::BLACK, None);
            }
            for (i, light) in self.lights.iter().enumerate() {
                let Light::Sphere(ball) = light else { continue };
                let closest = ray.direction.dot(ball.centre - ray.origin);
                let half2 = ball.radius * ball.radius - ray.at(closest).distance_squared(ball.centre);
                if half2 > 0.0 {
                    let distance = closest - half2.sqrt();
                    let index = self.only.map_or(Some(i as u32), |only| (only == i).then_some(0));
                    meet(distance, (ray.at(distance) - ball.centre).normalize(), Surface::BLACK, index);
                }
            }
            nearest
        }
    }

    fn lamps() -> Vec<Light<'static>> {
        let rng = &mut Generator::new(5);
        let mut lights = Vec::new();
        for i in 0..14 {
            let at = Vec3::new(3.0 * uniform(rng) - 1.5, 3.0 * uniform(rng) - 1.5, 0.5 + uniform(rng));
            let strength = Spectrum::new(0.5 + uniform(rng), 1.0, 0.5);
            lights.push(match i % 3 {
                0 => Light::Sphere(SphereLight::new(at, 0.06, strength * 60.0).unwrap()),
                1 => Light::Point(PointLight::new(at, strength).unwrap()),
                _ => Light::Spot(SpotLight::new(at, Vec3::new(0.2, 0.1, -1.0), 0.6, 0.9, strength * 2.0).unwrap()),
            });
        }
        lights.push(Light::Sun(Sun::new(Vec3::new(0.3, 0.5, 1.0), Spectrum::ONE).unwrap()));
        lights.push(Light::Constant(Spectrum::splat(0.3)));
        lights
    }

    fn estimator<'a>(world: World<'a, Homogeneous, Room<'a>>) -> Estimator<'a, Homogeneous, Room<'a>> {
        let walk = multiple_scatter::Settings::new(Steps::Length(0.1));
        let paths = path::Settings::default();
        Estimator { world, surfaces: None, photons: None, walk, paths, light_samples: 1, finest: 0.0 }
    }

    /// Means of some samples of something, and the squared errors of these means.
    fn mean(samples: u32, sample: &dyn Fn(&mut Generator) -> [f32; 2]) -> [[f64; 2]; 2] {
        let count = f64::from(samples);
        let mut sums = [[0.0; 2]; 2];
        for i in 0..samples {
            let found = sample(&mut Generator::new(u64::from(i)));
            for (sum, value) in sums.iter_mut().zip(found.map(f64::from)) {
                (sum[0], sum[1]) = (sum[0] + value / count, sum[1] + value * value / count);
            }
        }
        sums.map(|[mean, squares]| [mean, (squares - mean * mean) / count])
    }

    /// Each light alone is looked at by itself, not as one of many.
    #[test]
    fn many_lights_together_bring_what_each_alone_does() {
        let lamps = lamps();
        let tree = LightTree::new(&lamps, Vec::new()).unwrap();
        let grey = |albedo| Spectrum::splat(albedo);
        let floors = [
            Surface::Lambert { reflectance: grey(0.6) },
            Surface::Phong { diffuse: grey(0.2), specular: grey(0.5), exponent: 30.0 },
        ];
        let settings = RaySettings { lights_visible: false, indirect: false, ..RaySettings::default() };
        let ray = Ray::between(Vec3::new(-2.0, -0.7, 1.3), Vec3::new(0.3, 0.2, 0.0));
        let ray = ray.with_length(f32::INFINITY);
        for (g, floor) in [(0.4, floors[0]), (0.8, floors[1])] {
            let fog = Homogeneous::new(grey(0.1), grey(0.5), Lobe::HenyeyGreenstein { g }).unwrap();
            let seen = |scene: &Room<'_>, lights, rng: &mut Generator| {
                let world = World { medium: &fog, scene, lights };
                let seen = radiance(&ray, &estimator(world), &Caches::default(), &settings, rng);
                [seen.medium_single.mean(), seen.surface_direct.mean()]
            };
            let mut alone = [[0.0; 2]; 2];
            for (i, lamp) in lamps.iter().enumerate() {
                let scene = Room { floor, lights: &lamps, only: Some(i) };
                let of_one = mean(4000, &|rng| seen(&scene, core::slice::from_ref(lamp).into(), rng));
                for (sum, part) in alone.iter_mut().zip(of_one) {
                    (sum[0], sum[1]) = (sum[0] + part[0], sum[1] + part[1]);
                }
            }
            let scene = Room { floor, lights: &lamps, only: None };
            for lights in [Lights::from(&lamps), Lights::with_tree(&lamps, &tree)] {
                let together = mean(20_000, &|rng| seen(&scene, lights, rng));
                for (together, alone) in together.iter().zip(alone) {
                    let error = (together[1] + alone[1]).sqrt();
                    assert!(error < 0.01 * alone[0], "too noisy to tell: {error} of {}", alone[0]);
                    let off = together[0] - alone[0];
                    assert!(off.abs() < 4.0 * error, "{g}: {} instead of {}, ± {error}", together[0], alone[0]);
                }
            }
        }
    }
    /// The same number of shadow rays, at a surface that shines: by arrival alone, lights are chosen of which it shows little.
    #[test]
    fn lights_that_are_drawn_among_those_tried_make_less_noise() {
        let rng = &mut Generator::new(6);
        let lamps: Vec<_> = (0..60)
            .map(|_| {
                let at = Vec3::new(4.0 * uniform(rng) - 2.0, 4.0 * uniform(rng) - 2.0, 1.0 + uniform(rng));
                Light::Point(PointLight::new(at, Spectrum::ONE).unwrap())
            })
            .collect();
        let tree = LightTree::new(&lamps, Vec::new()).unwrap();
        let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::splat(0.1), Lobe::Isotropic).unwrap();
        let (diffuse, specular) = (Spectrum::splat(0.05), Spectrum::splat(0.3));
        let floor = Surface::Phong { diffuse, specular, exponent: 20.0 };
        let scene = Room { floor, lights: &lamps, only: None };
        let estimator = estimator(World { medium: &fog, scene: &scene, lights: Lights::with_tree(&lamps, &tree) });
        let (point, to_eye) = (Vec3::new(0.9, 0.8, 0.0), Vec3::new(0.5, 0.3, 0.6).normalize());
        let hit = Hit { distance: 3.0, normal: Vec3::Z, shading: Vec3::Z, surface: floor, light: None };
        let of_tried = |rng: &mut Generator| {
            let mut offers = Offers::new(&estimator, 4);
            let start = [0; 3].map(|_| uniform(rng));
            offers.at_surface((point, &hit, Some((to_eye, Spectrum::ZERO))), Spectrum::ONE, false, start, rng);
            offers.settle(rng);
            let single = |rng: &mut Generator| {
                let random = (uniform(rng), uniform2(rng));
                estimator.reflected(point, &hit, to_eye, random, rng).mean()
            };
            [offers.arrived[1].mean(), (0..8).map(|_| single(rng)).sum::<f32>() / 8.0]
        };
        let [[tried, of_tried], [single, of_single]] = mean(20_000, &of_tried);
        let error = (of_tried + of_single).sqrt();
        assert!(error < 0.02 * single, "too noisy to tell: {error} of {single}");
        assert!((tried - single).abs() < 4.0 * error, "{tried} instead of {single}, ± {error}");
        assert!(of_single > 1.7 * of_tried, "{} times less variance", of_single / of_tried);
    }
}
