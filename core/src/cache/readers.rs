//! What caches answer besides eye rays: light at a point, as coefficients, fluence, irradiance; one by one or many at a
//! time.
//!
//! All but [`RadianceCaches::in_scattered`], which samples what is not cached, answer from records alone, and say so where no record reaches, not even
//! twice as far as it is valid. Light straight from the lights and scattered once is in them where it is cached ([`Settings::single`](super::Settings::single));
//! otherwise a host adds it, from [`ScatteredLight::single`] or by its own shadow maps. It is never in irradiance. Light that a medium emits is in none.

use glam::Vec3;

use super::caches::RadianceCaches;
use super::extrapolate::{Blend, Extrapolation, exponent_limit, weight};
use super::kind::Kind;
use super::lookup::{Basis, Reading};
use super::record::Record;
use super::store::VolumeCache;
use super::{CachedRadiance, radiance};
use crate::host::{Medium, Rng, Scene};
use crate::math::{Ray, float::PI};
use crate::sampling::{Generator, GeneratorSource};
use crate::sh::Coefficient;
use crate::spectrum::Spectrum;
use crate::world::World;

/// The kinds of light scattered in a medium.
const SCATTERED: [Kind; 3] = [Kind::Single, Kind::Surface, Kind::Multiple];

/// Coefficients that are mixed in one visit of the records: all of degree 3, as probes have.
const BLOCK: usize = 16;

/// √(4π): the coefficient of degree 0 of a function whose mean over directions is 1.
const MEAN: f32 = 3.544_907_7;

/// In-scattered radiance (W·m⁻²·sr⁻¹) at a point towards a direction, per unit of the scattering coefficient (m⁻¹).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ScatteredLight {
    /// Light of the lights, scattered once.
    pub single: Spectrum,
    /// Light of surfaces and of a sky, scattered once.
    pub surface: Spectrum,
    /// Light scattered more than once.
    pub multiple: Spectrum,
    /// How many of the three were sampled because no record reaches or nothing is cached.
    pub sampled: u32,
}

impl ScatteredLight {
    /// All light together.
    ///
    /// ```
    /// # use fogbow::{cache::ScatteredLight, spectrum::Spectrum};
    /// let light = ScatteredLight { single: Spectrum::ONE, multiple: Spectrum::ONE, ..ScatteredLight::default() };
    /// assert_eq!(light.total(), Spectrum::splat(2.0));
    /// ```
    #[must_use]
    pub fn total(&self) -> Spectrum {
        self.single + self.surface + self.multiple
    }
}

impl VolumeCache<'_> {
    /// The expansion of in-scattered radiance at `point` in spherical harmonics: `coefficients[l² + l + m]` of degree `l` and
    /// order `m` (W·m⁻²·sr⁻¹), which times [`sh::evaluate`](crate::sh::evaluate) gives radiance in a direction. What the cache has no degree for is 0.
    /// Whether a record reaches; if not, all are 0.
    ///
    /// Coefficients have signs, so records that are carried exponentially are carried linearly here. For all other ways the
    /// expansion says in every direction what [`VolumeCache::lookup`] does, but for that being no less than 0.
    ///
    /// ```
    /// # use fogbow::{cache::{Basis, Cache, Reading, Record, VolumeCache}, math::Vec3, sh::{self, Coefficient}};
    /// # use fogbow::spectrum::{Gradient, Spectrum};
    /// # #[cfg(feature = "alloc")] {
    /// let mut cache: VolumeCache = Cache::growing(3);
    /// let gradient = Gradient::outer(Spectrum::ONE, Vec3::X);
    /// let record = Record { position: Vec3::ZERO, radius: 1.0, value: Spectrum::splat(2.0), gradient };
    /// let higher = Coefficient { value: Spectrum::ONE, gradient: Gradient::ZERO };
    /// cache.insert(record, &[Coefficient::ZERO, Coefficient::ZERO, higher])?;
    /// let (point, towards, reading) = (0.5 * Vec3::X, Vec3::new(0.6, 0.0, 0.8), Reading::new(0.5));
    /// let (mut c, mut y) = ([Spectrum::ZERO; 4], [0.0; 4]);
    /// assert!(cache.expansion(point, &reading, &mut c));
    /// sh::evaluate(towards, 1, &mut y);
    /// let light = c.iter().zip(y).map(|(&c, y)| c * y).sum::<Spectrum>();
    /// let looked_up = cache.lookup(point, &Basis::new(towards, 1), &reading).unwrap();
    /// assert!((light[0] - looked_up[0]).abs() < 1e-6);
    /// # }
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    #[doc(alias("probe", "spherical harmonics", "light probe"))]
    pub fn expansion(&self, point: Vec3, reading: &Reading, coefficients: &mut [Spectrum]) -> bool {
        coefficients.fill(Spectrum::ZERO);
        let extrapolation = match reading.extrapolation {
            Extrapolation::Exponential => Extrapolation::Linear,
            other => other,
        };
        let count = coefficients.len().min(self.coefficients() + 1);
        let mut reaches = false;
        for (block, sums) in coefficients[..count].chunks_mut(BLOCK).enumerate() {
            let coefficient = |record: u32, of: &Record, number: usize| match number.checked_sub(1) {
                None => Coefficient { value: of.value * MEAN, gradient: of.gradient * MEAN },
                Some(i) => self.attached(record).get(i).copied().unwrap_or(Coefficient::ZERO),
            };
            let mixed = |margin: f32, is_wide: bool| {
                let mut blends = [Blend::new(extrapolation, exponent_limit(reading.tolerance)); BLOCK];
                let mut add = |i: u32, record: &Record, share: f32| {
                    let d = 1.0 - share - margin;
                    if d > 0.0 {
                        for (k, blend) in blends.iter_mut().enumerate().take(sums.len()) {
                            let c = coefficient(i, record, block * BLOCK + k);
                            blend.add(weight(d), c.value, &c.gradient, point - record.position);
                        }
                    }
                };
                if is_wide {
                    self.visit_wide(point, &mut add)
                } else {
                    self.visit(point, &mut add)
                }
                (blends[0].weight() > 0.0).then_some(blends)
            };
            let Some(blends) = mixed(reading.margin, false).or_else(|| mixed(0.0, true)) else { return false };
            sums.iter_mut().zip(blends).for_each(|(sum, blend)| *sum = blend.value().unwrap_or_default());
            reaches = true;
        }
        reaches
    }
}

impl RadianceCaches<'_> {
    /// In-scattered radiance at `point` towards `to_eye` (unit), by part. Where a part has no record one sample of it is
    /// taken, so that gaps make noise and no holes.
    #[must_use]
    pub fn in_scattered<M: Medium + ?Sized, S: Scene + ?Sized>(
        &self,
        point: Vec3,
        to_eye: Vec3,
        world: &World<'_, M, S>,
        rng: &mut (impl Rng + ?Sized),
    ) -> ScatteredLight {
        let estimator = self.estimator(world);
        let (phase, mut rng) = (estimator.phase(point), Generator::child(rng));
        let mut light = ScatteredLight::default();
        for kind in SCATTERED {
            let known = self.volume(kind).and_then(|reader| {
                reader.cache.lookup(point, &Basis::new(to_eye, reader.cache.degree()), &reader.reading)
            });
            light.sampled += u32::from(known.is_none());
            let (part, sample): (&mut Spectrum, &dyn Fn(&mut Generator) -> Spectrum) = match kind {
                Kind::Single => (&mut light.single, &|rng| estimator.towards(point, to_eye, &phase, rng)),
                Kind::Surface => (&mut light.surface, &|rng| estimator.surface_towards(point, to_eye, &phase, rng)),
                _ => (&mut light.multiple, &|rng| estimator.multiple_towards(point, to_eye, &phase, rng)),
            };
            *part = known.unwrap_or_else(|| sample(&mut rng));
        }
        light
    }

    /// In-scattered radiance at `point` in spherical harmonics: what a probe in fog stores. See [`VolumeCache::expansion`] for the
    /// coefficients; their dot product with [`sh::evaluate`](crate::sh::evaluate) in the direction from `point` to the eye is radiance. As many are
    /// worth asking for as [`VolumeCache::degree`] says; those of higher degrees are 0. The phase function is in them, σₛ is not: they light fog, not
    /// surfaces (for these, see [`RadianceCaches::irradiance`]).
    ///
    /// The sum over the parts that are cached; `false`, and zeros, where one of them has no record. Light straight from the lights is
    /// among them only with [`Settings::with_single_cached`](super::Settings::with_single_cached); else add it yourself. Caches for
    /// probes are filled by [`Asked::Box`](super::Asked::Box), see the example at [`RadianceCaches`].
    #[doc(alias("probe", "spherical harmonics", "light probe"))]
    pub fn in_scattered_sh(&self, point: Vec3, coefficients: &mut [Spectrum]) -> bool {
        coefficients.fill(Spectrum::ZERO);
        let mut part = [Spectrum::ZERO; crate::sh::MAX_COEFFICIENTS];
        let count = coefficients.len().min(part.len());
        let mut is_known = false;
        for reader in SCATTERED.into_iter().filter_map(|kind| self.volume(kind)) {
            if !reader.cache.expansion(point, &reader.reading, &mut part[..count]) {
                coefficients.fill(Spectrum::ZERO);
                return false;
            }
            coefficients.iter_mut().zip(&part).for_each(|(sum, part)| *sum += *part);
            is_known = true;
        }
        is_known
    }

    /// As [`RadianceCaches::in_scattered_sh`] at many points: `coefficients` holds as many for each point, one after the other. How many points
    /// have no record.
    ///
    /// # Panics
    /// If `coefficients` cannot be dealt out evenly.
    pub fn in_scattered_sh_many(&self, points: &[Vec3], coefficients: &mut [Spectrum]) -> usize {
        if points.is_empty() {
            return 0;
        }
        assert!(coefficients.len().is_multiple_of(points.len()), "as many coefficients for every point");
        let each = (coefficients.len() / points.len()).max(1);
        let pairs = points.iter().zip(coefficients.chunks_exact_mut(each));
        pairs.filter_map(|(point, slots)| (!self.in_scattered_sh(*point, slots)).then_some(())).count()
    }

    /// Fluence (W·m⁻²), the integral of radiance over all directions, of the light whose scattering is cached at `point`; `None` where a part
    /// has no record. A phase function changes directions and not the mean: `φ = 4π ⟨L_i⟩`.
    #[must_use]
    pub fn fluence(&self, point: Vec3) -> Option<Spectrum> {
        let mut mean = [Spectrum::ZERO];
        self.in_scattered_sh(point, &mut mean).then(|| (mean[0] * (4.0 * PI / MEAN)).max(Spectrum::ZERO))
    }

    /// As [`RadianceCaches::fluence`] at many points, black where there is no record; how many those are.
    pub fn fluence_many(&self, points: &[Vec3], fluences: &mut [Spectrum]) -> usize {
        let mut missing = 0;
        for (point, slot) in points.iter().zip(fluences) {
            let known = self.fluence(*point);
            missing += usize::from(known.is_none());
            *slot = known.unwrap_or_default();
        }
        missing
    }

    /// Irradiance (W·m⁻²) at `point` on a surface with `normal` (unit), but for light straight from the lights; `None` where no record reaches.
    /// From the records of surfaces in sight, or else from those that light all others.
    #[must_use]
    pub fn irradiance(&self, point: Vec3, normal: Vec3) -> Option<Spectrum> {
        let of = |kind: Kind| {
            let reader = self.surface(kind)?;
            reader.cache.lookup(point, normal, &reader.reading)
        };
        of(Kind::Irradiance).or_else(|| of(Kind::CoarseIrradiance))
    }

    /// As [`RadianceCaches::irradiance`] at many points, black where there is no record; how many those are.
    pub fn irradiance_many(&self, points: &[(Vec3, Vec3)], irradiances: &mut [Spectrum]) -> usize {
        let mut missing = 0;
        for ((point, normal), slot) in points.iter().zip(irradiances) {
            let known = self.irradiance(*point, *normal);
            missing += usize::from(known.is_none());
            *slot = known.unwrap_or_default();
        }
        missing
    }

    /// As [`RadianceCaches::radiance`] of many rays, each with the random numbers of sample `sample` of its number in `source`.
    pub fn radiance_many<M: Medium + ?Sized, S: Scene + ?Sized>(
        &self,
        rays: &[Ray],
        seen: &mut [CachedRadiance],
        world: &World<'_, M, S>,
        sample: u32,
        source: &impl GeneratorSource,
    ) {
        let (estimator, reader) = (self.estimator(world), self.reader());
        for (number, (ray, slot)) in rays.iter().zip(seen).enumerate() {
            let mut rng = source.start(self.settings.seed, number as u64, sample);
            *slot = radiance(ray, &estimator, &reader, &self.settings.eye, &mut rng);
        }
    }
}
