//! Procedural density: fractal noise.

use glam::Vec3;

use super::MediumError;
use super::perlin::{self, MAX_CURVATURE, MAX_SLOPE, MAX_VALUE};
use crate::host::{Gradients, MajorantSegment, Medium, Properties};
use crate::math::Ray;
use crate::phase::Phase;
use crate::spectrum::{Gradient, Spectrum};

/// Most octaves of [`FractalNoise`].
pub const MAX_OCTAVES: u32 = 16;

/// Shape of a fractal noise.
///
/// ```text
/// d(x) = clamp(offset + amplitude · Σᵢ gainⁱ noise(frequency · lacunarityⁱ · x), 0, max_density)
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FractalNoise {
    /// Cells per metre of the first octave (m⁻¹).
    pub frequency: f32,
    /// Number of octaves, 1 to [`MAX_OCTAVES`].
    pub octaves: u32,
    /// Ratio of frequencies of one octave and the last; at least 1.
    pub lacunarity: f32,
    /// Ratio of amplitudes of one octave and the last; in [0, 1].
    pub gain: f32,
    /// Mean density before clamping; negative values leave islands of medium in vacuum.
    pub offset: f32,
    /// Amplitude of the first octave, of which values lie in about ±1.
    pub amplitude: f32,
    /// Largest density.
    pub max_density: f32,
    /// Noises of different seeds have nothing in common.
    pub seed: u32,
}

impl Default for FractalNoise {
    /// Three octaves of cells of 1 m, density around 1/2.
    fn default() -> Self {
        Self {
            frequency: 1.0,
            octaves: 3,
            lacunarity: 2.0,
            gain: 0.5,
            offset: 0.5,
            amplitude: 1.0,
            max_density: 1.0,
            seed: 0,
        }
    }
}

impl FractalNoise {
    fn check(self) -> Result<Self, MediumError> {
        // Not of four thousand million octaves, before it is known that there are few.
        let few = Self { octaves: self.octaves.min(MAX_OCTAVES), ..self };
        let highest = few.octave_scales().fold(0.0, |_, (frequency, _)| frequency);
        let is_positive = |v: f32| v > 0.0 && v < f32::INFINITY;
        let is_valid = (1..=MAX_OCTAVES).contains(&self.octaves)
            && is_positive(self.frequency)
            && self.lacunarity >= 1.0
            && is_positive(highest)
            && (1.0 / self.frequency).is_finite()
            && (0.0..=1.0).contains(&self.gain)
            && self.offset.is_finite()
            && self.amplitude >= 0.0
            && (self.amplitude * (MAX_SLOPE * MAX_OCTAVES as f32) * highest).is_finite()
            && is_positive(self.max_density);
        if is_valid { Ok(self) } else { Err(MediumError::Noise) }
    }

    /// Frequency (m⁻¹) and amplitude of each octave.
    #[inline]
    fn octave_scales(self) -> impl Iterator<Item = (f32, f32)> {
        let first = (self.frequency, self.amplitude);
        let next = move |&(f, a): &(f32, f32)| Some((f * self.lacunarity, a * self.gain));
        core::iter::successors(Some(first), next).take(self.octaves as usize)
    }

    /// Frequency (m⁻¹), amplitude and seed of each octave.
    #[inline]
    fn octaves(self) -> impl Iterator<Item = (f32, f32, u32)> {
        let seed = move |i: u32| self.seed.wrapping_add(i.wrapping_mul(0x9e37_79b9));
        (0_u32..).zip(self.octave_scales()).map(move |(i, (frequency, amplitude))| (frequency, amplitude, seed(i)))
    }

    /// Density at a point.
    ///
    /// ```
    /// # use fogbow::{math::Vec3, medium::FractalNoise};
    /// let even = FractalNoise { amplitude: 0.0, offset: 0.3, ..FractalNoise::default() };
    /// assert_eq!(even.density(Vec3::new(1.0, 2.0, 3.0)), 0.3);
    /// let clouds = FractalNoise { offset: -0.2, ..FractalNoise::default() };
    /// assert!((0..1000).any(|i| clouds.density(0.37 * i as f32 * Vec3::X) == 0.0));   // never negative: vacuum between
    /// ```
    #[inline]
    #[must_use]
    pub fn density(self, point: Vec3) -> f32 {
        let sum = self.octaves().map(|(f, amplitude, seed)| amplitude * perlin::value(point * f, seed)).sum::<f32>();
        (self.offset + sum).max(0.0).min(self.max_density)
    }

    /// Gradient of density (m⁻¹); zero where it is clamped.
    ///
    /// ```
    /// # use fogbow::{math::Vec3, medium::FractalNoise};
    /// let (clouds, point) = (FractalNoise::default(), Vec3::new(0.3, 0.4, 0.6));
    /// let difference = clouds.density(point + 1e-3 * Vec3::X) - clouds.density(point - 1e-3 * Vec3::X);
    /// assert!((clouds.density_gradient(point).x - difference / 2e-3).abs() < 1e-3);
    /// ```
    #[must_use]
    pub fn density_gradient(self, point: Vec3) -> Vec3 {
        let (mut sum, mut gradient) = (self.offset, Vec3::ZERO);
        for (frequency, amplitude, seed) in self.octaves() {
            let (value, slope) = perlin::noise(point * frequency, seed);
            sum += amplitude * value;
            gradient += slope * (amplitude * frequency);
        }
        if sum > 0.0 && sum < self.max_density { gradient } else { Vec3::ZERO }
    }

    /// Bounds of density on the line through `middle` along `direction`, up to `half` (m) to either
    /// side, when positions are uncertain by `blur` (m): of each octave, what its slope there and
    /// the largest curvature, or the steepest slope, leave possible.
    fn density_bounds(self, middle: Vec3, direction: Vec3, half: f32, blur: f32) -> (f32, f32) {
        // Rounding of one octave's value, slope and of the sums.
        const ROUNDING: f32 = 1e-5;
        let (mut low, mut high) = (self.offset, self.offset);
        for (frequency, amplitude, seed) in self.octaves() {
            let (value, gradient) = perlin::noise(middle * frequency, seed);
            let (length, uncertainty) = (frequency * half, frequency * blur);
            let change = if length < 1.0 {
                let slope = gradient.dot(direction).abs() + MAX_CURVATURE * uncertainty + ROUNDING;
                (MAX_SLOPE * length).min((slope + 0.5 * MAX_CURVATURE * length) * length)
            } else {
                2.0 * MAX_VALUE
            };
            let change = change + MAX_SLOPE * uncertainty + ROUNDING;
            low += amplitude * (value - change).max(-MAX_VALUE);
            high += amplitude * (value + change).min(MAX_VALUE);
        }
        self.clamped(low, high)
    }

    /// Bounds of density anywhere.
    fn widest_bounds(self) -> (f32, f32) {
        let reach = self.octave_scales().map(|(_, amplitude)| amplitude * MAX_VALUE).sum::<f32>();
        self.clamped(self.offset - reach, self.offset + reach)
    }

    fn clamped(self, low: f32, high: f32) -> (f32, f32) {
        let slack = 4.0 * f32::EPSILON * (low.abs() + high.abs());
        let clamp = |v: f32| v.max(0.0).min(self.max_density);
        (clamp(low - slack), clamp(high + slack))
    }
}

/// A medium whose density is fractal noise, everywhere.
///
/// ```text
/// σₛ(x) = d(x) · scattering,   σₐ(x) = d(x) · absorption
/// ```
///
/// ```
/// # use fogbow::host::Medium;
/// # use fogbow::math::{Ray, Vec3};
/// # use fogbow::medium::{FractalNoise, Noise};
/// # use fogbow::{phase::Phase, spectrum::Spectrum};
/// let shape = FractalNoise { frequency: 2.0, offset: -0.1, ..FractalNoise::default() };
/// let cloud = Noise::new(shape, Spectrum::ZERO, Spectrum::splat(5.0), Phase::ISOTROPIC).unwrap();
/// let ray = Ray::new(Vec3::ZERO, Vec3::X);
/// let segment = cloud.majorant_segment(&ray, 0.0);
/// let middle = cloud.extinction(ray.at(0.5 * segment.until));
/// assert!(segment.minorant[0] <= middle[0] && middle[0] <= segment.majorant[0]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    shape: FractalNoise,
    scattering: Spectrum,
    absorption: Spectrum,
    emission: Spectrum,
    phase: Phase,
    /// Length of a segment (m).
    step: f32,
    /// Whether density is 0 everywhere.
    is_void: bool,
}

impl Noise {
    /// From the shape of the density, and the coefficients (m⁻¹) where density is 1.
    ///
    /// # Errors
    /// A parameter out of its range.
    pub fn new(
        shape: FractalNoise,
        absorption: Spectrum,
        scattering: Spectrum,
        phase: impl Into<Phase>,
    ) -> Result<Self, MediumError> {
        let shape = shape.check()?;
        let largest = (absorption + scattering) * shape.max_density;
        if !(absorption.is_valid() && scattering.is_valid() && largest.is_finite()) {
            return Err(MediumError::Coefficients);
        }
        let phase = phase.into().check()?;
        // A segment costs about as much as a collision: long enough for one of each, short enough
        // for the first octave to be told from its extremes.
        let (_, dense) = shape.widest_bounds();
        let thickest = ((absorption + scattering) * dense).max_element();
        let cell = 1.0 / shape.frequency;
        let step = (1.0 / thickest).clamp(cell / 16.0, cell / 2.0);
        Ok(Self { shape, scattering, absorption, emission: Spectrum::ZERO, phase, step, is_void: dense == 0.0 })
    }

    /// The same medium, emitting `emission` (W·m⁻³·sr⁻¹) where density is 1, in proportion to it.
    ///
    /// # Errors
    /// Emission that is negative or not finite.
    ///
    /// ```
    /// # use fogbow::{host::Medium, math::Vec3, medium::{FractalNoise, Noise}, phase::Phase, spectrum::Spectrum};
    /// let (shape, point) = (FractalNoise::default(), Vec3::new(0.3, 0.4, 0.6));
    /// let flames = Noise::new(shape, Spectrum::ONE, Spectrum::ZERO, Phase::ISOTROPIC)?.with_emission(Spectrum::splat(10.0))?;
    /// assert_eq!(flames.properties(point).emission[0], 10.0 * shape.density(point));
    /// # Ok::<(), fogbow::medium::MediumError>(())
    /// ```
    pub fn with_emission(mut self, emission: Spectrum) -> Result<Self, MediumError> {
        if !(emission.is_valid() && (emission * self.shape.max_density).is_finite()) {
            return Err(MediumError::Emission);
        }
        self.emission = emission;
        Ok(self)
    }

    /// Angular law of scattering; the same everywhere.
    ///
    /// ```
    /// # use fogbow::{medium::{FractalNoise, Noise}, phase::{Lobe, Phase}, spectrum::Spectrum};
    /// let cloud = Noise::new(FractalNoise::default(), Spectrum::ZERO, Spectrum::ONE, Lobe::Rayleigh)?;
    /// assert_eq!(cloud.phase(), Phase::from(Lobe::Rayleigh));
    /// # Ok::<(), fogbow::medium::MediumError>(())
    /// ```
    #[inline]
    #[must_use]
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// Shape of the density.
    ///
    /// ```
    /// # use fogbow::{host::Medium, math::Vec3, medium::{FractalNoise, Noise}, phase::Phase, spectrum::Spectrum};
    /// let cloud = Noise::new(FractalNoise::default(), Spectrum::ZERO, Spectrum::splat(5.0), Phase::ISOTROPIC)?;
    /// let point = Vec3::new(0.3, 0.4, 0.6);
    /// assert_eq!(cloud.extinction(point)[0], 5.0 * cloud.shape().density(point));
    /// # Ok::<(), fogbow::medium::MediumError>(())
    /// ```
    #[inline]
    #[must_use]
    pub fn shape(&self) -> FractalNoise {
        self.shape
    }
}

impl Medium for Noise {
    fn properties(&self, point: Vec3) -> Properties {
        let density = self.shape.density(point);
        Properties {
            absorption: self.absorption * density,
            scattering: self.scattering * density,
            emission: self.emission * density,
            phase: self.phase,
        }
    }

    /// Bounds from the value in the middle of a step and the steepest slope of every octave; up to
    /// eight empty steps are merged.
    fn majorant_segment(&self, ray: &Ray, from: f32) -> MajorantSegment {
        const MERGED: u32 = 8;
        // Seven roundings of 2⁻²⁴ lie between a distance and a lattice coordinate.
        const ROUNDING: f32 = 1e-6;
        if self.is_void {
            return MajorantSegment::vacuum(f32::INFINITY);
        }
        let mut t = from;
        for _ in 0..MERGED {
            // Where positions are coarser than a step, the least step there is.
            let until = (t + self.step).max(t.next_up());
            let middle = ray.at(t + 0.5 * (until - t));
            let coordinate = ray.origin.abs().max_element() + until;
            let (half, blur) = (0.5 * (until - t), ROUNDING * coordinate);
            let (low, high) = self.shape.density_bounds(middle, ray.direction, half, blur);
            if high > 0.0 {
                return if t > from { MajorantSegment::vacuum(t) } else { self.bounded(until, low, high) };
            }
            t = until;
            if t > ray.length {
                break;
            }
        }
        MajorantSegment::vacuum(t)
    }

    fn extinction(&self, point: Vec3) -> Spectrum {
        (self.absorption + self.scattering) * self.shape.density(point)
    }

    /// A quarter of a cell of the last octave (m).
    fn resolution(&self) -> f32 {
        let highest = self.shape.octave_scales().fold(self.shape.frequency, |_, (frequency, _)| frequency);
        0.25 / highest
    }

    fn gradients(&self, point: Vec3) -> Gradients {
        let gradient = self.shape.density_gradient(point);
        Gradients {
            extinction: Gradient::outer(self.absorption + self.scattering, gradient),
            scattering: Gradient::outer(self.scattering, gradient),
        }
    }

    fn is_grey(&self) -> bool {
        (self.absorption + self.scattering).is_grey()
    }

    fn is_emissive(&self) -> bool {
        !self.emission.is_black()
    }
}

impl Noise {
    #[inline]
    fn bounded(&self, until: f32, low: f32, high: f32) -> MajorantSegment {
        let extinction = self.absorption + self.scattering;
        let mut segment = MajorantSegment { until, minorant: extinction * low, majorant: extinction * high };
        if segment.is_constant() && low < high && self.is_emissive() {
            // Only emission varies here, yet equal bounds would promise that nothing does.
            segment.majorant = segment.majorant.map(|c| c.max(f32::MIN_POSITIVE) * (1.0 + 2.0 * f32::EPSILON));
        }
        if segment.majorant.is_black() && self.is_emissive() {
            segment.majorant = Spectrum::splat(f32::MIN_POSITIVE);
        }
        segment
    }
}
