//! Eye rays: where virtual lights are gathered.

use super::gather::{GatheredVpls, Gatherer, LEVELS};
use super::light::VirtualLight;
use super::scatterer::Receiver;
use super::single::{is_local, single};
use crate::host::{Hit, Medium, Rng, Scene};
use crate::march::scattering_points;
use crate::math::{Ray, float};
use crate::path::{self, Delegate, InScattered, Radiance};
use crate::sampling::{Generator, uniform};
use crate::spectrum::Spectrum;
use crate::transmittance::thickness::{Marching, optical_thickness};
use crate::world::{World, short_of_end};

/// Points on a segment of an eye ray that are held at once, 40 KB of stack; lights beyond half as many get points of
/// their own, by another march along the segment.
const POINTS: usize = 256;

/// How eye rays see virtual lights.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EyeSettings {
    /// How long paths may grow.
    pub paths: path::Settings,
    /// Points on a segment of the ray that each light is gathered at; on surfaces, how often each is, with compensation
    /// paths of its own.
    pub points: u32,
    /// Samples of light that the medium scatters once, for each segment.
    pub single: u32,
    /// Compensation paths for light that comes straight from the lights, for each segment and round of points.
    pub primary: u32,
    /// Whether the medium's light is wanted; if not, only that of surfaces behind it.
    pub sees_medium: bool,
}

impl EyeSettings {
    /// One point for each light, four samples of single scattering, two compensation paths.
    ///
    /// ```
    /// # use fogbow::{path::Settings, vpl::EyeSettings};
    /// let settings = EyeSettings { points: 4, ..EyeSettings::new(Settings::default()) };
    /// assert_eq!((settings.single, settings.primary, settings.sees_medium), (4, 2, true));
    /// ```
    #[must_use]
    pub fn new(paths: path::Settings) -> Self {
        Self { paths, points: 1, single: 4, primary: 2, sees_medium: true }
    }
}

/// What an eye ray sees.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct VplRadiance {
    /// Radiance by what the eye sees first.
    pub radiance: Radiance,
    /// Of that, light of virtual lights, clamped.
    pub clamped: Spectrum,
    /// Of that, what the steps of compensation added; from the last on all together.
    pub compensated: [Spectrum; LEVELS],
    /// Of what they added, light that came straight from the lights.
    pub straight: Spectrum,
}

/// Radiance that arrives at the origin of `ray`, from `lights` a part of all virtual lights: they count `share` times, so
/// that a host may show each ray a part of them, one of `share` equal ones.
///
/// Light that is scattered once comes from connections to the lights, at points of the ray where smoke is and light is near; where lights lie at
/// infinity, and for what is seen in mirrors, it comes as in path tracing. Light of surfaces and of the
/// medium scattered more often comes from the virtual lights. In segments through a medium, points are drawn by the light
/// they scatter ([`scattering_points`]).
///
/// ```
/// # use fogbow::{host::Empty, math::{Ray, Vec3}, medium::Homogeneous, path::Settings, phase::Phase, sampling::Generator};
/// # use fogbow::{spectrum::Spectrum, vpl::{Bound, EyeSettings, Gatherer, VirtualLight, radiance}};
/// # use fogbow::world::World;
/// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::splat(0.1), Phase::ISOTROPIC)?;
/// let world = World { medium: &fog, scene: &Empty, lights: (&[]).into() };
/// let gatherer = Gatherer { world, bound: Bound::NONE, compensation: None, has_mirrors: false };
/// let settings = EyeSettings::new(Settings::default());
/// let ray = Ray::between(Vec3::ZERO, 2.0 * Vec3::Z);
/// let light = VirtualLight::in_medium(Vec3::new(3.0, 0.0, 1.0), Vec3::X, Spectrum::ONE, 1, &Phase::ISOTROPIC);
/// let see = |lights: &[VirtualLight], share| radiance(&ray, &gatherer, lights, share, &settings, &mut Generator::new(1));
/// let seen = see(&[light], 1.0);
/// assert!(seen.clamped[0] > 0.0 && seen.radiance.total() == seen.clamped);   // this world has no other light
/// assert_eq!(see(&[light], 8.0).clamped, seen.clamped * 8.0);   // one of eight
/// # Ok::<(), fogbow::medium::MediumError>(())
/// ```
pub fn radiance<M: Medium + ?Sized, S: Scene + ?Sized>(
    ray: &Ray,
    gatherer: &Gatherer<'_, M, S>,
    lights: &[VirtualLight],
    share: f32,
    settings: &EyeSettings,
    rng: &mut (impl Rng + ?Sized),
) -> VplRadiance {
    let mut eye = Eye { gatherer, lights, share, settings, sum: GatheredVpls::default() };
    let radiance = path::radiance_beyond(ray, &gatherer.world, &settings.paths, rng, &mut eye);
    VplRadiance { radiance, clamped: eye.sum.clamped, compensated: eye.sum.compensated, straight: eye.sum.straight }
}

/// Calls `visit(receiver, weight)` for a point of the medium and the surface that an eye ray would gather at; `weight` is
/// what light from there counts for in the picture. For each segment, behind mirrors and glass, too.
///
/// By what lights send to a few such points it is seen which of them matter: see [`select`](super::select).
///
/// ```
/// # use fogbow::{host::Empty, math::{Ray, Vec3}, medium::Homogeneous, path::Settings, phase::Phase, sampling::Generator};
/// # use fogbow::{spectrum::Spectrum, vpl::receivers};
/// # use fogbow::world::World;
/// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::splat(0.5), Phase::ISOTROPIC)?;
/// let world = World { medium: &fog, scene: &Empty, lights: (&[]).into() };
/// let (ray, mut rng, mut opacity) = (Ray::between(Vec3::ZERO, 2.0 * Vec3::Z), Generator::new(1), 0.0);
/// for _ in 0..1000 {
///     receivers(&ray, &world, &Settings::default(), &mut rng, |receiver, weight| {
///         assert!(receiver.point.z < 2.0);
///         opacity += weight[0] * 0.5 / 1000.0;   // weight × σₛ
///     });
/// }
/// assert!((opacity - (1.0 - (-1.0_f32).exp())).abs() < 0.02);
/// # Ok::<(), fogbow::medium::MediumError>(())
/// ```
pub fn receivers<M: Medium + ?Sized, S: Scene + ?Sized>(
    ray: &Ray,
    world: &World<'_, M, S>,
    paths: &path::Settings,
    rng: &mut (impl Rng + ?Sized),
    visit: impl FnMut(&Receiver, Spectrum),
) {
    path::radiance_beyond(ray, world, paths, rng, Scout { medium: world.medium, visit });
}

struct Scout<'a, M: ?Sized, F> {
    medium: &'a M,
    visit: F,
}

impl<M: Medium + ?Sized, F: FnMut(&Receiver, Spectrum)> Delegate for Scout<'_, M, F> {
    fn in_scattered(&mut self, segment: &Ray, throughput: Spectrum, _: u32, rng: &mut Generator) -> InScattered {
        let opacity = opacity_of(segment, self.medium, rng);
        if opacity > INVISIBLE {
            for (receiver, weight) in &points_on(self.medium, segment, opacity, 1, rng) {
                (self.visit)(receiver, throughput * *weight);
            }
        }
        InScattered::default()
    }

    fn reflected(
        &mut self,
        segment: &Ray,
        hit: &Hit,
        throughput: Spectrum,
        _: u32,
        _: &mut Generator,
    ) -> Option<Spectrum> {
        if let Some(receiver) = Receiver::on_surface(segment.at(hit.distance), -segment.direction, hit) {
            (self.visit)(&receiver, throughput);
        }
        Some(Spectrum::ZERO)
    }
}

struct Eye<'a, M: ?Sized, S: ?Sized> {
    gatherer: &'a Gatherer<'a, M, S>,
    lights: &'a [VirtualLight],
    share: f32,
    settings: &'a EyeSettings,
    sum: GatheredVpls,
}

type Points = heapless::Vec<(Receiver, Spectrum), POINTS>;

/// Opacity of a segment below which its medium is not looked at.
const INVISIBLE: f32 = 1e-6;

/// Opacity of a segment, by the mean of the channels' optical thickness.
fn opacity_of(segment: &Ray, medium: &(impl Medium + ?Sized), rng: &mut Generator) -> f32 {
    let marching = Marching::new(medium.resolution(), uniform(rng));
    -float::exp_m1(-optical_thickness(segment, medium, marching).mean())
}

/// About `wanted` points of a segment of `opacity`, each with the weight that it has if it is drawn from them alone.
fn points_on(
    medium: &(impl Medium + ?Sized),
    segment: &Ray,
    opacity: f32,
    wanted: usize,
    rng: &mut Generator,
) -> Points {
    let mut points = Points::new();
    let mut count = 0_u32;
    let (u, jitter) = (uniform(rng), uniform(rng));
    scattering_points(segment, medium, wanted as f32 / opacity, u, jitter, |distance, properties, weight| {
        let Some(receiver) = Receiver::in_medium(segment.at(distance), -segment.direction, properties) else { return };
        count += 1;
        // What does not fit takes the place of another, so that each is as likely to be there.
        if let Err(point) = points.push((receiver, weight)) {
            let place = (uniform(rng) * count as f32) as usize;
            if let Some(slot) = points.get_mut(place) {
                *slot = point;
            }
        }
    });
    for (_, weight) in &mut points {
        *weight *= count as f32;
    }
    points
}

impl<M: Medium + ?Sized, S: Scene + ?Sized> Eye<'_, M, S> {
    fn single(&self, segment: &Ray, rng: &mut Generator) -> Spectrum {
        // It ends before the surface.
        let (way, world) = (short_of_end(segment), &self.gatherer.world);
        let count = self.settings.single.max(1);
        if is_local(&world.lights) {
            return single(&way, world, count, rng);
        }
        let once = path::Settings { max_scatterings: 1, lights_visible: false, ..self.settings.paths };
        let sum: Spectrum = (0..count).map(|_| path::radiance(&way, world, &once, rng).medium_single).sum();
        sum * (1.0 / count as f32)
    }

    fn add(&mut self, gathered: &GatheredVpls, throughput: Spectrum, weight: Spectrum) -> Spectrum {
        self.sum.add(gathered, throughput * weight);
        gathered.total() * weight
    }

    /// Light scattered more than once, that the medium sends towards the origin of `segment`.
    fn multiple(&mut self, segment: &Ray, throughput: Spectrum, before: u32, rng: &mut Generator) -> Spectrum {
        let medium = self.gatherer.world.medium;
        let opacity = opacity_of(segment, medium, rng);
        let mut light = Spectrum::ZERO;
        if !(opacity > INVISIBLE) {
            return light;
        }
        let rounds = self.settings.points.max(1);
        let mut left = self.settings.primary.max(1).saturating_mul(rounds) as usize;
        let all = left as f32;
        while left > 0 {
            let wanted = left.min(POINTS / 2);
            let points = points_on(medium, segment, opacity, wanted, rng);
            for (receiver, weight) in &points {
                let gathered = self.gatherer.of_the_lights(receiver, before, rng);
                let share = wanted as f32 / (points.len() as f32 * all);
                light += self.add(&gathered, throughput, *weight * share);
            }
            left -= wanted;
        }
        // Without compensation each light has a point of its own.
        let per_point = self.gatherer.compensation.map_or(1, |c| c.lights_per_point.max(1)) as usize;
        let share = Spectrum::splat(self.share / rounds as f32);
        let lights = self.lights;
        for _ in 0..rounds {
            for group in lights.chunks(per_point.saturating_mul(POINTS / 2)) {
                let points = points_on(medium, segment, opacity, group.len().div_ceil(per_point), rng);
                if points.is_empty() {
                    continue;
                }
                // The lights take one point after the other; which is the first must be left to chance.
                let first = (uniform(rng) * points.len() as f32) as usize;
                for (i, part) in group.chunks(per_point).enumerate() {
                    let (receiver, weight) = &points[(first + i) % points.len()];
                    let gathered = self.gatherer.gather(receiver, part, before, rng);
                    light += self.add(&gathered, throughput, *weight * share);
                }
            }
        }
        light
    }
}

impl<M: Medium + ?Sized, S: Scene + ?Sized> Delegate for &mut Eye<'_, M, S> {
    fn in_scattered(&mut self, segment: &Ray, throughput: Spectrum, most: u32, rng: &mut Generator) -> InScattered {
        if !self.settings.sees_medium {
            return InScattered::default();
        }
        let single = self.single(segment, rng);
        let multiple = if most > 1 { self.multiple(segment, throughput, most - 1, rng) } else { Spectrum::ZERO };
        InScattered { single, multiple }
    }

    fn reflected(
        &mut self,
        segment: &Ray,
        hit: &Hit,
        throughput: Spectrum,
        most: u32,
        rng: &mut Generator,
    ) -> Option<Spectrum> {
        let Some(receiver) = Receiver::on_surface(segment.at(hit.distance), -segment.direction, hit) else {
            return Some(Spectrum::ZERO);
        };
        let rounds = self.settings.points.max(1);
        let share = 1.0 / rounds as f32;
        let mut light = Spectrum::ZERO;
        for _ in 0..rounds {
            let primary = self.gatherer.of_the_lights(&receiver, most, rng);
            light += self.add(&primary, throughput, Spectrum::splat(share));
            let gathered = self.gatherer.gather(&receiver, self.lights, most, rng);
            light += self.add(&gathered, throughput, Spectrum::splat(self.share * share));
        }
        Some(light)
    }
}
