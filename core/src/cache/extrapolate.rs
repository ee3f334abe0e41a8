//! What several records say about a point: Jarosz et al. 2008, Eq. 35; sheet § 1.10.

use glam::Vec3;

use crate::math::float;
use crate::spectrum::{Gradient, Spectrum};

/// How records are carried to another point, and mixed there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Extrapolation {
    /// `L + ½ (∇L + ∇̄L)·Δ` with the mean gradient `∇̄L` of all records that reach the point: exact for light
    /// that changes quadratically, where records surround the point. Linear in what the records hold, so
    /// that noise does not make it darker or brighter.
    #[default]
    Curved,
    /// `L e^{∇L·Δ/L}`, mixed by a weighted geometric mean: exact where light falls off
    /// exponentially, never negative (Eq. 35). A geometric mean of noise is darker than the truth
    /// by half its variance, and what is carried by noisy gradients is brighter.
    Exponential,
    /// `L + ∇L·Δ`, mixed by a weighted mean.
    Linear,
    /// `L`, mixed by a weighted mean.
    Constant,
}

/// Weight of a record at `1 − distance/radius`: `d² (3 − 2d)`, from 0 at the edge to 1.
///
/// ```
/// # use fogbow::cache::weight;
/// assert_eq!((weight(0.0), weight(0.5), weight(1.0)), (0.0, 0.5, 1.0));
/// ```
#[inline]
#[must_use]
pub fn weight(d: f32) -> f32 {
    d * d * (3.0 - 2.0 * d)
}

/// The largest exponent a record may be carried by: `max(4ε, 4)` (sheet § 1.10). Within its radius
/// it is at most `ε`, but for expansions that nearly vanish in the direction asked for.
///
/// ```
/// # use fogbow::cache::exponent_limit;
/// assert_eq!((exponent_limit(0.5), exponent_limit(2.0)), (4.0, 8.0));
/// ```
#[inline]
#[must_use]
pub fn exponent_limit(tolerance: f32) -> f32 {
    (4.0 * tolerance).max(4.0)
}

/// A mixture of records.
///
/// ```text
/// L = (W₊/W) exp(Σ_{L_k>0} w_k (ln L_k + ∇L_k·Δ_k/L_k) / W₊)
/// ```
///
/// per channel when carried exponentially, with `W = Σ w_k` and `W₊` the part of it from records with
/// `L_k > 0`: Eq. 35 where all are positive, and no blackening of everything by one black record where not.
///
/// ```text
/// L = Σ w_k (L_k + ½ ∇L_k·Δ_k) / W + ½ (Σ w_k ∇L_k / W)·(Σ w_k Δ_k / W)
/// ```
///
/// when curved: the error is that of `½ ∇²L` at the square of the mean `Δ_k`, not at the mean of their squares.
///
/// ```
/// # use fogbow::{cache::{Blend, Extrapolation}, math::Vec3, spectrum::{Gradient, Spectrum}};
/// let mut blend = Blend::new(Extrapolation::Exponential, 4.0);
/// blend.add(0.5, Spectrum::splat(2.0), &Gradient::ZERO, Vec3::ZERO);
/// blend.add(0.5, Spectrum::splat(8.0), &Gradient::ZERO, Vec3::ZERO);
/// assert!((blend.value().unwrap()[0] - 4.0).abs() < 1e-6);   // the geometric mean
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Blend {
    kind: Extrapolation,
    limit: f32,
    total: f32,
    sum: Spectrum,
    positive: Spectrum,
    slope: Gradient,
    offset: Vec3,
}

impl Blend {
    /// Nothing yet; `limit` bounds exponents, see [`exponent_limit`].
    #[inline]
    #[must_use]
    pub fn new(kind: Extrapolation, limit: f32) -> Self {
        Self {
            kind,
            limit,
            total: 0.0,
            sum: Spectrum::ZERO,
            positive: Spectrum::ZERO,
            slope: Gradient::ZERO,
            offset: Vec3::ZERO,
        }
    }

    /// Adds a record's value and gradient, and the way `Δ` (m) from it to the point.
    #[inline]
    pub fn add(&mut self, weight: f32, value: Spectrum, gradient: &Gradient, offset: Vec3) {
        self.total += weight;
        match self.kind {
            Extrapolation::Curved => {
                self.sum += (value + gradient.along(offset) * 0.5) * weight;
                self.slope += *gradient * weight;
                self.offset += offset * weight;
            }
            Extrapolation::Exponential => {
                let change = gradient.along(offset);
                for channel in 0..3 {
                    let l = value[channel];
                    if l > 0.0 {
                        let exponent = (change[channel] / l).clamp(-self.limit, self.limit);
                        self.sum[channel] += weight * (float::ln(l) + exponent);
                        self.positive[channel] += weight;
                    }
                }
            }
            Extrapolation::Linear => self.sum += (value + gradient.along(offset)) * weight,
            Extrapolation::Constant => self.sum += value * weight,
        }
    }

    /// Sum of the weights so far.
    ///
    /// ```
    /// # use fogbow::{cache::{Blend, Extrapolation}, math::Vec3, spectrum::{Gradient, Spectrum}};
    /// let mut blend = Blend::new(Extrapolation::Linear, 4.0);
    /// assert_eq!((blend.weight(), blend.value()), (0.0, None));
    /// blend.add(0.25, Spectrum::ONE, &Gradient::ZERO, Vec3::X);
    /// blend.add(0.5, Spectrum::ONE, &Gradient::ZERO, Vec3::Y);
    /// assert_eq!(blend.weight(), 0.75);
    /// ```
    #[inline]
    #[must_use]
    pub fn weight(&self) -> f32 {
        self.total
    }

    /// The mixture; `None` if nothing took part.
    #[inline]
    #[must_use]
    pub fn value(&self) -> Option<Spectrum> {
        if !(self.total > 0.0) {
            return None;
        }
        Some(match self.kind {
            Extrapolation::Curved => (self.sum + self.slope.along(self.offset / self.total) * 0.5) / self.total,
            Extrapolation::Exponential => self.sum.zip(self.positive, |sum, positive| {
                if positive > 0.0 { positive / self.total * float::exp(sum / positive) } else { 0.0 }
            }),
            Extrapolation::Linear | Extrapolation::Constant => self.sum / self.total,
        })
    }
}
