//! What the covariance of the fluence is good for: bounds, steps, kernel radii, densities of samples and
//! filters (Belcour et al. 2014, § 5, Eq. 17–20).

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::light_field::LightField;
use super::matrix::Symmetric4;
use super::operators::PER_HESSIAN;
use crate::math::float::{self, PI};
use crate::math::{Frame, Symmetric2, Symmetric3};

/// The covariance of the fluence at a place, as it is gathered: the sum of what light fields add to it, and of
/// the energy with which they do.
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

    /// Adds a light field with energy `energy`.
    #[inline]
    pub fn add(&mut self, light: &LightField, energy: f32) {
        self.sum = self.sum.plus(&light.volumetric().times(energy));
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
        (self.weight > 0.0).then(|| self.sum.times(1.0 / self.weight))
    }
}

/// Bound (per m²) on the absolute Hessian of a fluence `fluence` whose covariance is `covariance` (cycles²/m²):
/// `4π² F Γ` (B Eq. 2, 21); equality for Gaussians at their centre.
#[inline]
#[must_use]
pub fn hessian_bound(fluence: f32, covariance: &Symmetric3) -> Symmetric3 {
    covariance.times(4.0 * PI * PI * fluence)
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

/// The covariance of an image, gathered along an eye ray from the camera outwards: B Eq. 17, with the
/// attenuation on the way to the camera accumulated (sheet § 2.6).
///
/// ```text
/// Σ = ∫ K(t) [T_tᵀ pad(Γ_uv(t)) T_t + ∫₀ᵗ T_sᵀ pad(|H(s)|/4π²) T_s ds] dt / ∫ K dt
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
        let seen = |spatial: Symmetric2| Symmetric4::separable(spatial, Symmetric2::ZERO).travelled(distance);
        if let Some(hessian) = hessian {
            let mask = seen(hessian.within(u, v).absolute().times(length * PER_HESSIAN));
            self.attenuation = self.attenuation.plus(&mask);
        }
        let segment = seen(covariance.within(u, v)).plus(&self.attenuation);
        self.sum = self.sum.plus(&segment.times(contribution));
        self.weight += contribution;
    }

    /// The covariance at the camera; `None` if nothing contributes.
    #[must_use]
    pub fn value(&self) -> Option<Symmetric4> {
        (self.weight > 0.0).then(|| self.sum.times(1.0 / self.weight))
    }

    /// Its block over directions (cycles²/rad²), which for a pinhole is that of the image.
    #[must_use]
    pub fn angular(&self) -> Option<Symmetric2> {
        Some(self.value()?.angular)
    }
}

/// Density of samples in an image (per rad²) of covariance `image` (cycles²/rad²), but for a factor: `√det`
/// (B § 5.2).
#[inline]
#[must_use]
pub fn sample_density(image: &Symmetric2) -> f32 {
    float::safe_sqrt(image.determinant())
}

/// Precision matrix (rad⁻²) of the filter that an image of covariance `image` (cycles²/rad²) bears:
/// `4π² P`, for weights `exp(−½ xᵀ(4π²P)x)` (B Eq. 20 as corrected in sheet § 2.6).
///
/// Towards where the image does not vary the filter is infinitely wide: add `(1/(2π r))² I` to bound it by a
/// standard deviation `r`.
#[inline]
#[must_use]
pub fn filter_precision(image: &Symmetric2) -> Symmetric2 {
    image.times(4.0 * PI * PI)
}
