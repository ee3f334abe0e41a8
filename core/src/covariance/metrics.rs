//! What the covariance of the fluence is good for: bounds, steps, kernel radii, densities of samples and
//! filters (Belcour et al. 2014, § 5, Eq. 17–20).

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::light_field::LightField;
use super::matrix::{LIMIT, Symmetric4};
use super::operators::PER_HESSIAN;
use crate::math::float::{self, PI};
use crate::math::{Frame, Symmetric2, Symmetric3};

/// Largest energy of one contribution: with it, millions of the largest covariances have a finite sum.
const MOST_ENERGY: f32 = 1e20;

/// The covariance of the fluence at a place, as it is gathered: the sum of what light fields add to it, and of
/// the energy with which they do.
///
/// ```
/// # use fogbow::{covariance::Voxel, math::Symmetric3};
/// let sharp = Symmetric3::from_upper([8.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
/// let (mut voxel, mut other) = (Voxel::EMPTY, Voxel::EMPTY);
/// assert_eq!(voxel.covariance(), None);
/// voxel.add_covariance(&sharp, 1.0);
/// other.add_covariance(&Symmetric3::ZERO, 3.0);
/// voxel.merge(&other);
/// assert_eq!(voxel.covariance(), Some(sharp.times(0.25)));   // a quarter of the energy varies
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Voxel {
    /// `Σ I R S Rᵀ` (cycles²/m² times energy).
    pub sum: Symmetric3,
    /// `Σ I`: energy; in a grid, flux times length (W·m).
    pub weight: f32,
}

impl Voxel {
    /// Nothing gathered.
    pub const EMPTY: Self = Self { sum: Symmetric3::ZERO, weight: 0.0 };

    /// Adds a light field with energy `energy`; more than 10²⁰ counts as that.
    ///
    /// ```
    /// # use fogbow::{covariance::{LightField, Symmetric4, Voxel}, math::{Symmetric2, Vec3}};
    /// let place = Symmetric2::diagonal(4.0, 4.0);
    /// let light = LightField::around(Vec3::Z, Symmetric4::separable(place, Symmetric2::ZERO));
    /// let mut voxel = Voxel::EMPTY;
    /// voxel.add(&light, 2.0);
    /// assert_eq!((voxel.weight, voxel.covariance()), (2.0, Some(light.volumetric())));
    /// ```
    #[inline]
    pub fn add(&mut self, light: &LightField, energy: f32) {
        self.add_covariance(&light.volumetric(), energy);
    }

    /// Adds a covariance (cycles²/m²) with energy `energy`; more than 10²⁰ counts as that.
    #[inline]
    pub fn add_covariance(&mut self, covariance: &Symmetric3, energy: f32) {
        let energy = float::min(energy, MOST_ENERGY);
        self.sum = self.sum.plus(&covariance.times(energy));
        self.weight += energy;
    }

    /// Adds what another one gathered.
    #[inline]
    pub fn merge(&mut self, other: &Self) {
        self.sum = self.sum.plus(&other.sum);
        self.weight += other.weight;
    }

    /// `Γ` (cycles²/m²), the covariance of the fluence: the energy-weighted mean; `None` without energy.
    ///
    /// ```text
    /// Γ = Σ I R (X − C P⁺ Cᵀ) Rᵀ / Σ I
    /// ```
    ///
    /// Sheet § 2.5, in place of B Eq. 16. An upper bound where beams interfere.
    #[inline]
    #[must_use]
    pub fn covariance(&self) -> Option<Symmetric3> {
        (self.weight > 0.0).then(|| Symmetric3::from_upper(self.sum.to_upper().map(|x| x / self.weight)))
    }
}

/// Bound (per m²) on the absolute Hessian of a fluence `fluence` whose covariance is `covariance` (cycles²/m²):
/// `4π² F Γ` (B Eq. 2, 21); equality for Gaussians at their centre.
///
/// ```
/// # use fogbow::{covariance::hessian_bound, math::{Symmetric3, float::PI}};
/// // The fluence 3 exp(−x²/2s²) has the covariance 1/(4π²s²), and at its centre the second derivative −3/s².
/// let s = 0.5;
/// let gamma = Symmetric3::from_upper([1.0 / (4.0 * PI * PI * s * s), 0.0, 0.0, 0.0, 0.0, 0.0]);
/// assert!((hessian_bound(3.0, &gamma).xx - 3.0 / (s * s)).abs() < 1e-5);
/// ```
#[inline]
#[must_use]
pub fn hessian_bound(fluence: f32, covariance: &Symmetric3) -> Symmetric3 {
    covariance.times(float::min(4.0 * PI * PI * fluence, f32::MAX))
}

/// Covariance (cycles²/m²) of a fluence that falls as `1/r²` with the distance `distance` (m) from a light along
/// `direction` (unit): its relative Hessian, `6/r²` along the ray and `−2/r²` across, as B Eq. 2 turns it into one.
///
/// Covariance tracing itself is blind to it (sheet § 2.5): a diverging beam of one brightness has no content across.
/// `size` (m) is the radius of the light, within which there is no such fall-off.
///
/// ```
/// # use fogbow::{covariance::{divergence, hessian_bound}, math::Vec3};
/// let gamma = divergence(Vec3::Z, 2.0, 0.0);
/// let bound = hessian_bound(0.25, &gamma);   // F = 1/r²: F″ = 6/r⁴ along the ray, −2/r⁴ across
/// assert!((bound.zz - 6.0 / 16.0).abs() < 1e-6 && (bound.xx - 2.0 / 16.0).abs() < 1e-6);
/// ```
#[inline]
#[must_use]
pub fn divergence(direction: Vec3, distance: f32, size: f32) -> Symmetric3 {
    let across = float::min(2.0 * PER_HESSIAN / (distance * distance + size * size).max(1e-30), LIMIT);
    let w = direction;
    let along = 2.0 * across;
    Symmetric3::from_upper([
        across + along * w.x * w.x,
        along * w.x * w.y,
        along * w.x * w.z,
        across + along * w.y * w.y,
        along * w.y * w.z,
        across + along * w.z * w.z,
    ])
}

/// Length (m) of an integration step along the unit vector `direction`: `1/(2√v)` with `v = ωᵀΓω`, within
/// `least..=most` (B Eq. 18, Alg. 1). Where the light does not vary: `most`.
///
/// ```
/// # use fogbow::{covariance::step, math::{Symmetric3, Vec3}};
/// let shaft = Symmetric3::from_upper([4.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
/// assert_eq!(step(&shaft, Vec3::X, 0.01, 1.0), 0.25);
/// assert_eq!(step(&shaft, Vec3::Y, 0.01, 1.0), 1.0);
/// ```
#[inline]
#[must_use]
pub fn step(covariance: &Symmetric3, direction: Vec3, least: f32, most: f32) -> f32 {
    let variance = covariance.along(direction);
    if !(variance > 0.0) {
        return most;
    }
    (0.5 / float::sqrt(variance)).max(least).min(most)
}

/// Largest radius (m) of a density kernel whose relative bias stays below `relative_bias`, at most `most`.
///
/// ```text
/// |bias| ≤ 2π² h² a F tr Γ   ⇒   h = √(β / (2π² a tr Γ))
/// ```
///
/// `trace` is that of Γ (cycles²/m²), for kernels around beams within the plane across them; `moment` is
/// the kernel's `a = ∫ t₁² K(t) dt` at unit radius: disc 1/4, ball 1/5, Epanechnikov 1/6 (2D), 1/7 (3D).
/// B Eq. 19, Silverman 1986.
///
/// ```
/// # use fogbow::covariance::kernel_radius;
/// let sharp = kernel_radius(8.0, 0.1, 0.25, 5.0);
/// assert!((kernel_radius(2.0, 0.1, 0.25, 5.0) - 2.0 * sharp).abs() < 1e-6);
/// assert_eq!(kernel_radius(0.0, 0.1, 0.25, 5.0), 5.0);
/// ```
#[inline]
#[must_use]
pub fn kernel_radius(trace: f32, relative_bias: f32, moment: f32, most: f32) -> f32 {
    if !(trace > 0.0) {
        return most;
    }
    float::sqrt(relative_bias / (2.0 * PI * PI * moment * trace)).min(most)
}

/// Radius (m) that a kernel has best in the first of many passes, whose radii then go like `i^−1/5`, where
/// blur and noise of light are balanced; infinite where neither is known to limit it.
///
/// ```text
/// rᵢ = h i^{−1/5}:   E²(n) = (B h² · 5/3 · n^{−2/5})² + (V/h) · 5/6 · n^{−4/5}   least for   h = (3/40 · V/B²)^{1/5}
/// B = 2π² a tr Γ,   B r² the relative bias,   V/r the relative variance of a pass
/// ```
///
/// Both terms shrink like `n^{−4/5}`, so that the same `h` is best for any number of passes, and the mean of all passes goes
/// to the truth. `trace` (cycles²/m²) and `moment` are those of [`kernel_radius`]; `noise` (m) is `V`, for kernels
/// that are blurred along the eye ray, so that their variance goes like `1/r`. Silverman 1986, § 3.3, for kernels that narrow from pass
/// to pass (Knaus and Zwicker 2011).
///
/// ```
/// # use fogbow::covariance::balanced_radius;
/// let error = |h: f32, passes: f32| {
///     let b = 2.0 * core::f32::consts::PI.powi(2) * 0.125 * 3.0;
///     let bias = b * h * h * (5.0 / 3.0) * passes.powf(-0.4);
///     bias * bias + 0.01 / h * (5.0 / 6.0) * passes.powf(-0.8)
/// };
/// let best = balanced_radius(3.0, 0.01, 0.125);
/// for passes in [16.0, 256.0] {
///     assert!(error(best, passes) < error(0.9 * best, passes).min(error(1.1 * best, passes)));
/// }
/// ```
#[inline]
#[must_use]
pub fn balanced_radius(trace: f32, noise: f32, moment: f32) -> f32 {
    let blur = 2.0 * PI * PI * moment * trace;
    if !(blur > 0.0 && noise < f32::INFINITY) {
        return f32::INFINITY;
    }
    // Roots before the quotient: the square of a large blur would leave the range of f32.
    float::powf(0.075 * noise, 0.2) * float::powf(blur, -0.4)
}

/// The covariance of an image, gathered along an eye ray from the camera outwards: B Eq. 17, with the
/// attenuation on the way to the camera accumulated (sheet § 2.6).
///
/// ```text
/// Σ = ∫ K(t) [T_tᵀ pad(Γ_uv(t)) T_t + ∫₀ᵗ T_sᵀ pad(|H(s)|/4π²) T_s ds] dt / ∫ K dt
/// ```
///
/// ```
/// # use fogbow::{covariance::ImageCovariance, math::{Frame, Symmetric3, Vec3}};
/// let mut image = ImageCovariance::new(Frame { u: Vec3::X, v: Vec3::Y, w: Vec3::Z });
/// assert_eq!(image.value(), None);
/// // Half of the light comes from 3 m away and varies by 2 cycles per metre, the other half is even.
/// image.add(3.0, 0.1, 1.0, &Symmetric3::from_upper([4.0, 0.0, 0.0, 0.0, 0.0, 0.0]), None);
/// image.add(5.0, 0.1, 1.0, &Symmetric3::ZERO, None);
/// assert_eq!(image.angular().unwrap().xx, 0.5 * 4.0 * 9.0);   // cycles per radian: times the distance, squared
/// assert_eq!(image.value().unwrap().angular, image.angular().unwrap());
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImageCovariance {
    frame: Frame,
    attenuation: Symmetric4,
    sum: Symmetric4,
    weight: f32,
}

impl ImageCovariance {
    /// For an eye ray along `frame.w`; entries refer to `frame`.
    #[must_use]
    pub fn new(frame: Frame) -> Self {
        Self { frame, attenuation: Symmetric4::ZERO, sum: Symmetric4::ZERO, weight: 0.0 }
    }

    /// Adds a segment `length` (m) long at `distance` (m) from the camera, farther than the ones before.
    ///
    /// `contribution` is `K = T σₛ F · length`, what it adds to the pixel; `covariance` is Γ there
    /// (cycles²/m²), `hessian` that of extinction (m⁻³), `None` where the medium is even.
    pub fn add(
        &mut self,
        distance: f32,
        length: f32,
        contribution: f32,
        covariance: &Symmetric3,
        hessian: Option<&Symmetric3>,
    ) {
        let Frame { u, v, .. } = self.frame;
        let contribution = float::min(contribution, MOST_ENERGY);
        let seen = |spatial: Symmetric2| Symmetric4::separable(spatial, Symmetric2::ZERO).travelled(distance);
        if let Some(hessian) = hessian {
            let mask = hessian.bounded(1e30).within(u, v).absolute().bounded(1e30);
            let mask = seen(mask.times(PER_HESSIAN * float::min(length, 1e30)).bounded(LIMIT));
            self.attenuation = self.attenuation.plus(&mask);
        }
        let segment = seen(covariance.bounded(LIMIT).within(u, v)).plus(&self.attenuation);
        self.sum = self.sum.plus(&segment.times(contribution));
        self.weight += contribution;
    }

    /// The covariance at the camera; `None` if nothing contributes.
    #[must_use]
    pub fn value(&self) -> Option<Symmetric4> {
        (self.weight > 0.0).then(|| Symmetric4::from_upper(self.sum.to_upper().map(|x| x / self.weight)))
    }

    /// Its block over directions (cycles²/rad²), which for a pinhole is that of the image.
    #[must_use]
    pub fn angular(&self) -> Option<Symmetric2> {
        Some(self.value()?.angular)
    }
}

/// Density of samples in an image (per rad²) of covariance `image` (cycles²/rad²), but for a factor: `√det`
/// (B § 5.2).
///
/// ```
/// # use fogbow::{covariance::sample_density, math::Symmetric2};
/// assert_eq!(sample_density(&Symmetric2::diagonal(4.0, 9.0)), 6.0);   // √4 along one axis, √9 along the other
/// assert_eq!(sample_density(&Symmetric2::diagonal(4.0, 0.0)), 0.0);
/// ```
#[inline]
#[must_use]
pub fn sample_density(image: &Symmetric2) -> f32 {
    let Symmetric2 { xx, xy, yy } = *image;
    let [xx, xy, yy] = [xx, xy, yy].map(f64::from);
    libm::sqrt((xx * yy - xy * xy).max(0.0)) as f32
}

/// Precision matrix (rad⁻²) of the filter that an image of covariance `image` (cycles²/rad²) bears:
/// `4π² P`, for weights `exp(−½ xᵀ(4π²P)x)` (B Eq. 20 as corrected in sheet § 2.6).
///
/// Towards where the image does not vary the filter is infinitely wide: add `(1/(2π r))² I` to bound it by a
/// standard deviation `r`.
///
/// ```
/// # use fogbow::{covariance::filter_precision, math::{Symmetric2, float::PI}};
/// // A Gaussian blob of standard deviation s has the covariance 1/(4π²s²): the filter is as wide as the blob.
/// let s = 0.02;
/// let precision = filter_precision(&Symmetric2::diagonal(1.0 / (4.0 * PI * PI * s * s), 0.0));
/// assert!((precision.xx * s * s - 1.0).abs() < 1e-5);
/// ```
#[inline]
#[must_use]
pub fn filter_precision(image: &Symmetric2) -> Symmetric2 {
    image.times(4.0 * PI * PI)
}
