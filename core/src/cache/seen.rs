//! What eye rays see with the caches.

use glam::{Vec2, Vec3};

use super::estimate::Estimator;
use super::eye::{RaySettings, Sight, known_base, look};
use super::lookup::{Basis, Reading};
use super::offers::{FROM_SURFACES, Offers, wrapped};
use super::store::{SurfaceCache, VolumeCache};
use crate::host::{Hit, Medium, Properties, Rng, Scene};
use crate::light::{Except, FromPoint, LightSample, scattered};
use crate::math::Ray;
use crate::phase::deflection;
use crate::sampling::{Generator, uniform, uniform2};
use crate::spectrum::Spectrum;
use crate::surface::{Surface, lambert};
use crate::transmittance::thickness::{Marching, transmittance};
use crate::world::{Joint, NearLights, shadow_ray};

/// What a cache is for, and how it is read.
#[derive(Debug)]
pub struct Reader<'a, C> {
    /// The cache.
    pub cache: &'a C,
    /// How it is read.
    pub reading: Reading,
}

impl<C> Clone for Reader<'_, C> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<C> Copy for Reader<'_, C> {}

/// The caches an image is made from; what is `None` is estimated anew at every point.
#[derive(Debug, Clone, Copy, Default)]
pub struct Caches<'a> {
    /// Light of the lights, scattered once.
    pub single: Option<Reader<'a, VolumeCache<'a>>>,
    /// Light of surfaces, scattered once.
    pub surface: Option<Reader<'a, VolumeCache<'a>>>,
    /// Light scattered more than once.
    pub multiple: Option<Reader<'a, VolumeCache<'a>>>,
    /// Indirect irradiance on surfaces.
    pub irradiance: Option<Reader<'a, SurfaceCache<'a>>>,
}

/// Radiance (W·m⁻²·sr⁻¹) by where it comes from, and what it took.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CachedRadiance {
    /// Lights, the environment and glowing media.
    pub emitted: Spectrum,
    /// Of what is emitted, what comes straight from lights, past no mirror: [`RadianceCaches::straight`](super::RadianceCaches::straight).
    pub straight: Spectrum,
    /// Surfaces lit by the lights; diffuse ones but for a sky ([`Light::is_sky`](crate::light::Light::is_sky)), whose light is indirect.
    pub surface_direct: Spectrum,
    /// Surfaces lit by anything else.
    pub surface_indirect: Spectrum,
    /// Light of the lights but a sky, scattered once in the medium.
    pub medium_single: Spectrum,
    /// Light of surfaces and a sky, scattered once in the medium.
    pub medium_surface: Spectrum,
    /// Light scattered more than once, the last time in the medium.
    pub medium_multiple: Spectrum,
    /// Questions asked of caches.
    pub lookups: u32,
    /// Of these, questions no record answered.
    pub misses: u32,
}

impl CachedRadiance {
    /// Light by the cache that may hold it, in the order of [`Kind::FINAL`].
    pub(super) fn by_kind(&self) -> [Spectrum; 4] {
        [self.medium_single, self.medium_surface, self.medium_multiple, self.surface_indirect]
    }

    /// All light together.
    ///
    /// ```
    /// # use fogbow::{cache::CachedRadiance, spectrum::Spectrum};
    /// let seen = CachedRadiance { emitted: Spectrum::ONE, medium_multiple: Spectrum::splat(0.5), lookups: 3, ..CachedRadiance::default() };
    /// assert_eq!(seen.total(), Spectrum::splat(1.5));
    /// ```
    #[must_use]
    pub fn total(&self) -> Spectrum {
        self.emitted
            + self.surface_direct
            + self.surface_indirect
            + self.medium_single
            + self.medium_surface
            + self.medium_multiple
    }
}

/// Radiance that arrives at the origin of `ray`, read from caches.
///
/// Light of the lights but a sky is connected to at the points of the ray unless [`Caches::single`] is there: to
/// lights within whose [`Light::steep_field`](crate::light::Light::steep_field) it lies by equiangular connections along each segment. Of more than eight lights,
/// connections are tried first, and those that are followed are drawn among them by what they would bring (resampled importance sampling, Talbot et al. 2005).
/// Where a cache has no record at a point, one sample of what it would hold takes its place, so that
/// gaps make noise and no holes. Of a sequence of low discrepancy the first numbers are spread best: the first two say where on a lamp the surface looks. `estimator` brings the world; its surface cache is what such
/// samples use. The ray ends where less than 10⁻⁵ of the light behind would be seen, and what is behind is left out.
///
/// ```
/// # use fogbow::{cache::{Basis, Cache, Caches, Estimator, RaySettings, Reader, Reading, Record, VolumeCache, radiance}};
/// # use fogbow::{host::Empty, math::{Ray, Vec3}, medium::Homogeneous, multiple_scatter, path, phase::Phase};
/// # use fogbow::{sampling::Generator, spectrum::{Gradient, Spectrum}, transmittance::thickness::Steps};
/// # use fogbow::world::World;
/// # #[cfg(feature = "alloc")] {
/// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC)?;
/// let world = World { medium: &fog, scene: &Empty, lights: (&[]).into() };
/// # let walk = multiple_scatter::Settings::new(Steps::Length(0.1));
/// # let (paths, light_samples) = (path::Settings::default(), 1);
/// # let estimator = Estimator { world, surfaces: None, photons: None, walk, paths, light_samples, finest: 1e-3 };
/// // One record says that light of 1 is scattered in from the lights, 50 m around.
/// let mut cache: VolumeCache = Cache::growing(0);
/// let record = Record { position: Vec3::ZERO, radius: 50.0, value: Spectrum::ONE, gradient: Gradient::ZERO };
/// cache.insert(record, &[])?;
/// let caches = Caches { single: Some(Reader { cache: &cache, reading: Reading::new(0.5) }), ..Caches::default() };
/// let settings = RaySettings { density: 64.0, connections: 1, lamp_parts: 1, lights_visible: true, indirect: true };
/// let ray = Ray::new(Vec3::ZERO, Vec3::X);
/// let seen = radiance(&ray, &estimator, &caches, &settings, &mut Generator::new(1));
/// assert!((seen.medium_single[0] - 1.0).abs() < 0.02 && seen.misses == 0);   // so opaque fog looks like 1
/// # }
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
pub fn radiance<M: Medium + ?Sized, S: Scene + ?Sized>(
    ray: &Ray,
    estimator: &Estimator<'_, M, S>,
    caches: &Caches<'_>,
    settings: &RaySettings,
    rng: &mut (impl Rng + ?Sized),
) -> CachedRadiance {
    gathered(ray, estimator, caches, settings, true, rng)
}

/// As [`radiance`], but for light that the medium scatters: emission, and surfaces seen through the medium.
///
/// ```
/// # use fogbow::{cache::{Caches, Estimator, RaySettings, radiance_beyond}, host::Empty, light::Light};
/// # use fogbow::{math::{Ray, Vec3}, medium::{Homogeneous, Placed, Region}, multiple_scatter, path, phase::Phase};
/// # use fogbow::{sampling::Generator, spectrum::Spectrum, transmittance::thickness::Steps};
/// # use fogbow::world::World;
/// // A sky of 1, seen through a ball of fog two metres wide.
/// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC)?;
/// let (ball, lights) = (Placed::new(fog, Region::sphere(Vec3::ZERO, 1.0)?), [Light::Constant(Spectrum::ONE)]);
/// let world = World { medium: &ball, scene: &Empty, lights: (&lights).into() };
/// # let walk = multiple_scatter::Settings::new(Steps::Length(0.1));
/// # let (paths, light_samples) = (path::Settings::default(), 1);
/// # let estimator = Estimator { world, surfaces: None, photons: None, walk, paths, light_samples, finest: 1e-3 };
/// let settings = RaySettings { density: 8.0, connections: 1, lamp_parts: 1, lights_visible: true, indirect: true };
/// let ray = Ray::new(-5.0 * Vec3::X, Vec3::X);
/// let seen = radiance_beyond(&ray, &estimator, &Caches::default(), &settings, &mut Generator::new(1));
/// assert!((seen.emitted[0] - (-2.0_f32).exp()).abs() < 1e-6);
/// assert_eq!(seen.total(), seen.emitted);   // what the fog scatters is left to others
/// # Ok::<(), fogbow::medium::MediumError>(())
/// ```
pub fn radiance_beyond<M: Medium + ?Sized, S: Scene + ?Sized>(
    ray: &Ray,
    estimator: &Estimator<'_, M, S>,
    caches: &Caches<'_>,
    settings: &RaySettings,
    rng: &mut (impl Rng + ?Sized),
) -> CachedRadiance {
    gathered(ray, estimator, caches, settings, false, rng)
}

fn gathered<M: Medium + ?Sized, S: Scene + ?Sized>(
    ray: &Ray,
    estimator: &Estimator<'_, M, S>,
    caches: &Caches<'_>,
    settings: &RaySettings,
    in_scattered: bool,
    rng: &mut (impl Rng + ?Sized),
) -> CachedRadiance {
    // The first numbers of a sequence are spread best. Where on a lamp a surface looks makes the most noise, where it marches on the way the least.
    let seen_by_surface = uniform2(rng);
    let along = [uniform(rng), uniform(rng)];
    let seen_by_medium = uniform2(rng);
    let chosen = uniform2(rng);
    let offset = uniform2(rng).x;
    let light = [chosen.x, seen_by_medium.x, seen_by_medium.y];
    let surface = (chosen.y, seen_by_surface);
    let mut gather = Gather {
        estimator,
        caches,
        settings,
        in_scattered,
        many: NearLights::are_many(&estimator.world.lights).then(|| Offers::new(estimator, settings.connections)),
        seen: CachedRadiance::default(),
        along,
        light,
        surface,
        offset,
        points: 0,
        basis: None,
        rng: Generator::child(rng),
    };
    look(ray, &estimator.world, settings, rng, &mut gather);
    if let Some(many) = &mut gather.many {
        many.settle(&mut gather.rng);
        gather.seen.medium_single += many.arrived[0];
        gather.seen.surface_direct += many.arrived[1];
    }
    gather.seen
}

struct Gather<'a, M: ?Sized, S: ?Sized> {
    estimator: &'a Estimator<'a, M, S>,
    caches: &'a Caches<'a>,
    settings: &'a RaySettings,
    /// Whether light that the medium scatters counts.
    in_scattered: bool,
    /// Where lights are many.
    many: Option<Offers<'a, M, S>>,
    seen: CachedRadiance,
    /// Random numbers of the sample: for connections along segments, from points, from surfaces.
    along: [f32; 2],
    light: [f32; 3],
    surface: (f32, Vec2),
    /// A random number for marching along connections.
    offset: f32,
    /// Points so far.
    points: u32,
    /// Basis functions towards the eye, for the direction they belong to.
    basis: Option<(Vec3, Basis)>,
    rng: Generator,
}

impl<M: Medium + ?Sized, S: Scene + ?Sized> Gather<'_, M, S> {
    /// Single scattering at a point of the ray of one light, in whose near field it does not lie.
    fn connected(&mut self, point: Vec3, to_eye: Vec3, properties: &Properties, k: u32) -> Spectrum {
        let [choice, u, v] = [0, 1, 2].map(|i| wrapped(self.light[i], i, k));
        let (to, phase) = (
            FromPoint { except: Except::Steep, sky: !self.settings.indirect, ..FromPoint::all(point) },
            &properties.phase,
        );
        let weight = scattered(to, to_eye, phase);
        self.estimator.scattered((&weight, point), to_eye, phase, (choice, Vec2::new(u, v)), &mut self.rng)
    }

    /// Single scattering along a segment of one light within its near field.
    fn near(&self, segment: &Ray, joint: &Joint<'_>, k: u32) -> Option<Spectrum> {
        let world = &self.estimator.world;
        let properties = world.medium.properties(joint.point);
        if properties.scattering.is_black() {
            return None;
        }
        let LightSample { source, incident, .. } =
            joint.light(|| Vec2::new(wrapped(self.light[1], 1, k), wrapped(self.light[2], 2, k)))?;
        let value = properties.phase.value(deflection(incident.to_light, -segment.direction));
        let shadow = shadow_ray(joint.point, &source);
        if world.scene.is_blocked(&shadow) {
            return None;
        }
        let marching = Marching { steps: self.estimator.walk.steps, offset: wrapped(self.offset, 0, k) };
        let through = transmittance(&segment.with_length(joint.distance), world.medium, marching)
            * transmittance(&shadow.with_length(incident.distance), world.medium, marching);
        let light = properties.scattering * value * through * incident.irradiance / joint.pdf;
        light.is_finite().then_some(light)
    }

    /// The mean of some connections from a surface, of what arrives or of what is reflected to an eye: which of several lights was chosen, or, behind smoke that lets more of one part
    /// of a lamp through than of another, which part, is most of the noise. Elsewhere samples of a pixel average that as well.
    fn several(&self, point: Vec3, hit: &Hit, to_eye: Option<(Vec3, Spectrum)>) -> Spectrum {
        let (lights, (choice, at)) = (self.estimator.world.lights, self.surface);
        let count = match &lights[..] {
            [light] if light.is_delta() => 1,
            [_] => self.settings.lamp_parts.clamp(1, FROM_SURFACES),
            _ => self.settings.connections.clamp(1, FROM_SURFACES),
        };
        // As many parts of a lamp, each by the same even sequence.
        let columns = 2 - count % 2;
        let rows = count / columns;
        let sky = to_eye.is_some() || !self.settings.indirect;
        let question = FromPoint { sky, ..FromPoint::all(point) };
        let survey = lights.survey(&question);
        let mut sum = Spectrum::ZERO;
        for k in 0..count {
            let choice = wrapped(choice + k as f32 / count as f32, 0, 0);
            let part = Vec2::new((k % columns) as f32, (k / columns) as f32);
            let at = ((at + part) / Vec2::new(columns as f32, rows as f32)).min(Vec2::splat(1.0 - f32::EPSILON));
            let chosen = survey.pick(choice).map(|chosen| (chosen, at));
            let offered = chosen.and_then(|chosen| self.estimator.offered_at(chosen, point, hit, to_eye));
            sum += offered
                .map_or(Spectrum::ZERO, |connection| self.estimator.arrived(&connection, wrapped(self.offset, 0, k)));
        }
        sum / count as f32
    }

    /// Looks up one cache; where it has nothing, one sample.
    fn cached(
        &mut self,
        reader: Option<&Reader<'_, VolumeCache<'_>>>,
        point: Vec3,
        to_eye: Vec3,
        sample: impl FnOnce(&mut Self) -> Spectrum,
    ) -> Spectrum {
        let Some(reader) = reader else { return sample(self) };
        let degree = reader.cache.degree();
        let basis = match &self.basis {
            Some((towards, basis)) if *towards == to_eye && basis.covers(degree) => basis,
            _ => &self.basis.insert((to_eye, Basis::new(to_eye, degree))).1,
        };
        self.seen.lookups += 1;
        if let Some(light) = reader.cache.lookup(point, basis, &reader.reading) {
            return light;
        }
        self.seen.misses += 1;
        sample(self)
    }
}

impl<M: Medium + ?Sized, S: Scene + ?Sized> Sight for Gather<'_, M, S> {
    fn segment(&mut self, segment: &Ray, throughput: Spectrum) {
        if self.caches.single.is_some() || !self.in_scattered {
            return;
        }
        if let Some(many) = &mut self.many {
            many.along(segment, throughput, self.along, &mut self.rng);
            return;
        }
        let few = NearLights::of(&self.estimator.world.lights, segment, Vec2::new(self.light[1], self.light[2]));
        let count = self.settings.connections.max(1);
        for k in 0..count {
            let u = (k as f32 + self.along[1]) / count as f32;
            if let Some(light) = few.join(segment, u).and_then(|joint| self.near(segment, &joint, k)) {
                self.seen.medium_single += throughput * light / count as f32;
            }
        }
    }

    #[inline]
    fn scatter(&mut self, point: Vec3, to_eye: Vec3, properties: &Properties, weight: Spectrum) {
        if !self.in_scattered {
            return;
        }
        let k = self.points;
        self.points += 1;
        let (caches, estimator) = (self.caches, self.estimator);
        let phase = &properties.phase;
        let single = match &caches.single {
            None => match &mut self.many {
                Some(many) => {
                    let at = (point, to_eye, properties);
                    many.at_point(at, weight, !self.settings.indirect, (self.light, k), &mut self.rng);
                    Spectrum::ZERO
                }
                None => self.connected(point, to_eye, properties, k),
            },
            Some(_) => self.cached(caches.single.as_ref(), point, to_eye, |gather| {
                estimator.towards(point, to_eye, phase, &mut gather.rng)
            }),
        };
        self.seen.medium_single += weight * single;
        if !self.settings.indirect {
            return;
        }
        let surface = self.cached(caches.surface.as_ref(), point, to_eye, |gather| {
            estimator.surface_towards(point, to_eye, phase, &mut gather.rng)
        });
        self.seen.medium_surface += weight * surface;
        let multiple = self.cached(caches.multiple.as_ref(), point, to_eye, |gather| {
            estimator.multiple_towards(point, to_eye, phase, &mut gather.rng)
        });
        self.seen.medium_multiple += weight * multiple;
    }

    fn surface(&mut self, ray: &Ray, hit: &Hit, weight: Spectrum) {
        let point = ray.at(hit.distance);
        let to_eye = -ray.direction;
        let indirect = self.settings.indirect;
        let is_plain = matches!(hit.surface, Surface::Lambert { .. });
        let base = if indirect || is_plain { known_base(hit, to_eye) } else { Spectrum::ZERO };
        if is_plain && base.is_black() {
            return;
        }
        let towards = (!is_plain).then_some((to_eye, base));
        let base = weight * lambert::value(base);
        let reflected = if is_plain { base } else { weight };
        if let Some(many) = &mut self.many {
            let start = [self.surface.0, self.surface.1.x, self.surface.1.y];
            many.at_surface((point, hit, towards), reflected, !indirect, start, &mut self.rng);
        } else {
            let light = self.several(point, hit, towards);
            self.seen.surface_direct += reflected * light;
        }
        if !indirect || base.is_black() {
            return;
        }
        let indirect = match &self.caches.irradiance {
            None => None,
            Some(reader) => {
                self.seen.lookups += 1;
                let known = reader.cache.lookup(point, hit.shading, &reader.reading);
                self.seen.misses += u32::from(known.is_none());
                known
            }
        };
        let indirect = indirect.unwrap_or_else(|| self.estimator.indirect(point, hit, &mut self.rng));
        self.seen.surface_indirect += base * indirect;
    }

    fn emitted(&mut self, light: Spectrum) {
        self.seen.emitted += light;
    }

    fn straight(&mut self, light: Spectrum) {
        self.seen.emitted += light;
        self.seen.straight += light;
    }
}
