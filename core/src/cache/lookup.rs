//! What a cache says of a point.

use glam::Vec3;

use super::extrapolate::{Blend, Extrapolation, exponent_limit, weight};
use super::lobe::{Lobe, coefficients_of};
use super::record::{Facing, Record};
use super::store::{SurfaceCache, VolumeCache, WIDE};
use crate::math::float;
use crate::sh::{self, Coefficient, MAX_COEFFICIENTS};
use crate::single_scatter::Contribution;
use crate::spectrum::{Gradient, Spectrum};

/// How sharply records on surfaces stop where the normal turns: at an angle of about `1/TURN` rad.
const TURN: f32 = 2.0;

/// How sharply they stop off their plane: at `1/OFFSET` of their radius.
const OFFSET: f32 = 40.0;

/// By how much spheres of irradiance are widened against noise, at most [`WIDE`]: twice is better where light comes
/// from fog, worse where it has sharp borders.
const READ_AT: f32 = 1.5;

/// How a cache is read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// How records are carried.
    pub extrapolation: Extrapolation,
    /// The tolerance they were made with.
    pub tolerance: f32,
    /// Share of every radius at its border that does not count, in [0, 1): above 0 while filling, so
    /// that spheres overlap and the eye rays of the picture find no gaps.
    pub margin: f32,
}

impl Reading {
    /// Records made with `tolerance`, carried in the best way there is.
    ///
    /// ```
    /// # use fogbow::cache::{Extrapolation, Reading};
    /// let reading = Reading::new(0.5);
    /// assert_eq!((reading.extrapolation, reading.margin), (Extrapolation::Curved, 0.0));
    /// ```
    #[must_use]
    pub fn new(tolerance: f32) -> Self {
        Self { extrapolation: Extrapolation::default(), tolerance, margin: 0.0 }
    }

    fn blend(&self) -> Blend {
        Blend::new(self.extrapolation, exponent_limit(self.tolerance))
    }
}

/// Basis functions in the direction to the eye: evaluated once per eye ray.
///
/// ```
/// # use fogbow::{cache::Basis, math::Vec3};
/// let basis = Basis::new(Vec3::Z, 2);
/// assert!(basis.covers(0) && basis.covers(2) && !basis.covers(3));
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Basis {
    to_eye: Vec3,
    values: [f32; MAX_COEFFICIENTS],
    count: usize,
}

impl Basis {
    /// Up to `degree`, towards `to_eye` (unit).
    #[must_use]
    pub fn new(to_eye: Vec3, degree: usize) -> Self {
        let mut values = [0.0; MAX_COEFFICIENTS];
        let count = sh::coefficient_count(degree.min(sh::MAX_DEGREE));
        sh::evaluate(to_eye, degree.min(sh::MAX_DEGREE), &mut values[..count]);
        Self { to_eye, values, count }
    }

    /// Without that of degree 0.
    #[inline]
    fn higher(&self) -> &[f32] {
        self.values.get(1..self.count).unwrap_or(&[])
    }

    /// An expansion in its direction, of this mean and coefficients of degree 1 and more, with the lobe attached.
    pub(super) fn expanded(&self, mean: Spectrum, attached: &[Coefficient]) -> Spectrum {
        let (higher, lobe) = attached.split_at(coefficients_of(attached.len()));
        let light = self.higher().iter().zip(higher).fold(mean, |sum, (&y, c)| sum + c.value * y);
        light + Lobe::read(lobe).map_or(Spectrum::ZERO, |lobe| lobe.seen(self.to_eye).0)
    }

    /// Whether it reaches up to `degree`.
    #[inline]
    #[must_use]
    pub fn covers(&self, degree: usize) -> bool {
        self.count >= sh::coefficient_count(degree)
    }
}

/// Highest degree of a [`TurningBasis`].
pub const TURNING_DEGREE: usize = 8;

const TURNING_COEFFICIENTS: usize = (TURNING_DEGREE + 1) * (TURNING_DEGREE + 1);

/// [`Basis`] up to degree [`TURNING_DEGREE`] with tangential gradients.
#[derive(Debug, Clone, Copy)]
pub struct TurningBasis {
    basis: Basis,
    slopes: [Vec3; TURNING_COEFFICIENTS],
}

impl TurningBasis {
    /// Up to `degree`, at most [`TURNING_DEGREE`], towards `to_eye` (unit).
    ///
    /// ```
    /// # use fogbow::{cache::{Cache, Reading, Record, TurningBasis, VolumeCache}, math::Vec3};
    /// # use fogbow::{sh::Coefficient, spectrum::{Gradient, Spectrum}};
    /// # #[cfg(feature = "alloc")] {
    /// // Light that goes with Y₁₁ = √(3/4π) x around a mean of 1.
    /// let mut cache: VolumeCache = Cache::growing(3);
    /// let record = Record { position: Vec3::ZERO, radius: 1.0, value: Spectrum::ONE, gradient: Gradient::ZERO };
    /// let higher = Coefficient { value: Spectrum::ONE, gradient: Gradient::ZERO };
    /// cache.insert(record, &[Coefficient::ZERO, Coefficient::ZERO, higher])?;
    /// let basis = TurningBasis::new(Vec3::Z, 1);
    /// let (light, turned) = cache.lookup_with_gradients(Vec3::ZERO, &basis, &Reading::new(0.5)).unwrap();
    /// assert_eq!(light.radiance, Spectrum::ONE);
    /// assert!((turned.x[0] - 0.48860251).abs() < 1e-6);   // per radian that the direction turns towards x
    /// # }
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    #[must_use]
    pub fn new(to_eye: Vec3, degree: usize) -> Self {
        let degree = degree.min(TURNING_DEGREE);
        let count = sh::coefficient_count(degree);
        let mut basis = Basis { to_eye, values: [0.0; MAX_COEFFICIENTS], count };
        let mut slopes = [Vec3::ZERO; TURNING_COEFFICIENTS];
        sh::evaluate_with_gradients(to_eye, degree, &mut basis.values[..count], &mut slopes[..count]);
        Self { basis, slopes }
    }

    /// The value of a function of the basis, and how it changes as the direction turns.
    #[inline]
    pub(super) fn value(&self, k: usize) -> f32 {
        self.basis.values[k]
    }

    /// See [`TurningBasis::value`].
    #[inline]
    pub(super) fn slope(&self, k: usize) -> Vec3 {
        self.slopes[k]
    }

    /// How an expansion changes as the direction turns.
    fn turned(&self, higher: &[Spectrum]) -> Gradient {
        let slopes = self.slopes.get(1..self.basis.count).unwrap_or(&[]);
        higher.iter().zip(slopes).fold(Gradient::ZERO, |sum, (&c, slope)| sum + Gradient::outer(c, *slope))
    }
}

impl VolumeCache<'_> {
    /// Highest degree of the expansions held; 0 in isotropic media.
    #[must_use]
    pub fn degree(&self) -> usize {
        sh::degree_of(self.coefficients() + 1).unwrap_or(0)
    }

    /// In-scattered radiance (W·m⁻²·sr⁻¹) at `point` in the direction of `basis`; `None` where no
    /// record reaches.
    ///
    /// An expansion is evaluated with its gradient first and then extrapolated, because coefficients
    /// are signed. Source: Jarosz et al. 2008, Eq. 35; sheet § 1.10.
    #[must_use]
    pub fn lookup(&self, point: Vec3, basis: &Basis, reading: &Reading) -> Option<Spectrum> {
        let mut blend = reading.blend();
        let mut add = |i, record: &Record, share| {
            if let Some((d, value, gradient)) = self.expanded(i, record, share + reading.margin, basis) {
                blend.add(weight(d), value, &gradient, point - record.position);
            }
        };
        self.visit(point, &mut add);
        blend.value().or_else(|| self.gap(point, basis, reading)).map(|light| light.max(Spectrum::ZERO))
    }

    /// Calls `visit(number, weight)` for the records that [`VolumeCache::lookup`] mixes.
    pub(super) fn visit_mixed(&self, point: Vec3, basis: &Basis, reading: &Reading, visit: &mut dyn FnMut(usize, f32)) {
        self.visit(point, |i, record, share| {
            if let Some((d, ..)) = self.expanded(i, record, share + reading.margin, basis) {
                visit(i as usize, weight(d));
            }
        });
    }

    /// The coefficients of a record, and its lobe.
    #[inline]
    fn parts(&self, number: u32) -> (&[Coefficient], Option<Lobe>) {
        let (higher, lobe) = self.attached(number).split_at_checked(self.coefficients()).unwrap_or_default();
        (higher, Lobe::read(lobe))
    }

    /// Where the eye is that a record has a lobe for (unit).
    pub(super) fn to_eye(&self, number: u32) -> Option<Vec3> {
        self.parts(number).1.map(|lobe| lobe.to_eye)
    }

    /// What a record says in one direction: `d`, 1 at its middle, less what the point and the direction are `away`, its light and its gradient;
    /// `None` if it does not reach.
    #[inline]
    fn expanded(&self, number: u32, record: &Record, away: f32, basis: &Basis) -> Option<(f32, Spectrum, Gradient)> {
        let (higher, lobe) = self.parts(number);
        let d = 1.0 - away - lobe.map_or(0.0, |lobe| lobe.apart(basis.to_eye));
        // Written so that NaN fails, too.
        if !(d > 0.0) {
            return None;
        }
        let seen = lobe.map_or((Spectrum::ZERO, Gradient::ZERO), |lobe| lobe.seen(basis.to_eye));
        let of_mean = (record.value + seen.0, record.gradient + seen.1);
        let (value, gradient) = higher
            .iter()
            .zip(basis.higher())
            .fold(of_mean, |(value, gradient), (c, &y)| (value + c.value * y, gradient + c.gradient * y));
        Some((d, value, gradient))
    }

    /// Between the spheres, the nearest count.
    #[cold]
    fn gap(&self, point: Vec3, basis: &Basis, reading: &Reading) -> Option<Spectrum> {
        let mut blend = reading.blend();
        self.visit_wide(point, |i, record, share| {
            if let Some((d, value, gradient)) = self.expanded(i, record, share, basis) {
                blend.add(weight(d), value, &gradient, point - record.position);
            }
        });
        blend.value()
    }

    /// [`VolumeCache::lookup`] with the gradients of the mixture, weights held, as the point moves and as the
    /// direction turns: what random walks that end at a record carry to their start.
    #[must_use]
    pub fn lookup_with_gradients(
        &self,
        point: Vec3,
        basis: &TurningBasis,
        reading: &Reading,
    ) -> Option<(Contribution, Gradient)> {
        let mut blend = reading.blend();
        let (mut slope, mut mixed) = (Gradient::ZERO, [Spectrum::ZERO; TURNING_COEFFICIENTS]);
        let mut turned = Gradient::ZERO;
        self.visit(point, |i, record, share| {
            let found = self.expanded(i, record, share + reading.margin, &basis.basis);
            let Some((d, value, gradient)) = found else { return };
            let weight = weight(d);
            blend.add(weight, value, &gradient, point - record.position);
            slope += gradient * weight;
            let (higher, lobe) = self.parts(i);
            mixed.iter_mut().zip(higher).for_each(|(sum, c)| *sum += c.value * weight);
            turned += lobe.map_or(Gradient::ZERO, |lobe| lobe.turned(basis.basis.to_eye) * weight);
        });
        let radiance = blend.value()?;
        let share = 1.0 / blend.weight();
        Some((Contribution { radiance, gradient: slope * share }, (turned + basis.turned(&mixed)) * share))
    }

    /// Whether a record reaches `point`.
    #[must_use]
    pub fn covers(&self, point: Vec3, reading: &Reading) -> bool {
        self.covers_towards(point, None, reading)
    }

    /// [`VolumeCache::covers`] where light is asked for towards an eye.
    pub(super) fn covers_towards(&self, point: Vec3, to_eye: Option<Vec3>, reading: &Reading) -> bool {
        let mut covered = false;
        self.visit(point, |i, _, share| {
            let apart = to_eye.and_then(|to_eye| Some(self.parts(i).1?.apart(to_eye))).unwrap_or(0.0);
            covered |= share + apart < 1.0 - reading.margin;
        });
        covered
    }
}

impl SurfaceCache<'_> {
    /// Indirect irradiance (W·m⁻²) at `point` on a surface with `normal`; `None` where no record
    /// reaches.
    ///
    /// A record counts less the farther it is, the more its normal differs and the more the point
    /// lies off its plane; its value changes with position and with the normal (vector irradiance). From
    /// [`Cache::finish`](super::Cache::finish) on, records reach half as far again, and in gaps twice as far: noise is
    /// averaged over twice as many.
    #[must_use]
    pub fn lookup(&self, point: Vec3, normal: Vec3, reading: &Reading) -> Option<Spectrum> {
        let at = |width: f32| self.mixed(point, normal, reading, width);
        let light = if self.is_finished() { at(READ_AT).or_else(|| at(WIDE)) } else { at(1.0) };
        light.map(|light| light.max(Spectrum::ZERO))
    }

    /// The mixture of all records whose spheres, as many times as wide as `width` (1, or up to [`WIDE`]) says, reach a point.
    #[inline]
    fn mixed(&self, point: Vec3, normal: Vec3, reading: &Reading, width: f32) -> Option<Spectrum> {
        let mut blend = reading.blend();
        let mut add = |i, record: &Record, share| {
            self.facing(i, record, share, (point, normal), reading.margin, |facing, d| {
                let turned = facing.turn.along(normal - facing.normal);
                blend.add(weight(d), record.value + turned, &record.gradient, point - record.position);
            });
        };
        if width > 1.0 {
            self.visit_wide(point, |i, record, share| add(i, record, share * (WIDE / width)));
        } else {
            self.visit(point, add);
        }
        blend.value()
    }

    /// Whether a record reaches `point` on a surface with `normal`.
    #[must_use]
    pub fn covers(&self, point: Vec3, normal: Vec3, reading: &Reading) -> bool {
        let mut covered = false;
        self.visit(point, |i, record, share| {
            self.facing(i, record, share, (point, normal), reading.margin, |_, _| covered = true);
        });
        covered
    }

    /// Calls `visit(facing, d)` if a record reaches a point with a normal, `d` being 1 at its middle and 0 at its edge.
    #[inline]
    fn facing(
        &self,
        number: u32,
        record: &Record,
        share: f32,
        (point, normal): (Vec3, Vec3),
        margin: f32,
        visit: impl FnOnce(&Facing, f32),
    ) {
        let Some(facing) = self.attached(number).first() else { return };
        let d = 1.0 - facing_distance(point, normal, record, facing, share) - margin;
        if d > 0.0 {
            visit(facing, d);
        }
    }
}

/// A surface record's distance over its radius, with what normals and planes differ by.
#[inline]
pub(super) fn facing_distance(point: Vec3, normal: Vec3, record: &Record, facing: &Facing, share: f32) -> f32 {
    let turn = float::safe_sqrt(2.0 - 2.0 * normal.dot(facing.normal));
    // On a bent surface points lie off the mean of their planes by up to a quarter of the bend.
    let offset = 0.5 * (facing.normal + normal).dot(point - record.position).abs() / record.radius;
    share + TURN * turn + OFFSET * (offset - 0.25 * turn * share).max(0.0)
}
