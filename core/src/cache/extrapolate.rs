//! What several records say about a point: Jarosz et al. 2008, Eq. 35; sheet § 1.10.

use crate::math::float;
use crate::spectrum::{Gradient, Spectrum};
use glam::Vec3;

/// How a record is carried to another point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Extrapolation {
    /// `L e^{∇L·Δ/L}`, mixed by a weighted geometric mean: exact where light falls off
    /// exponentially, never negative (Eq. 35).
    #[default]
    Exponential,
    /// `L e^{∇L·Δ/L}`, mixed by a weighted mean. Records are noisy, and a geometric mean of noise is
    /// darker than the truth by half its variance, again at every bounce that is read from a cache.
    ExponentialMean,
    /// `L + ∇L·Δ`, mixed by a weighted mean.
    Linear,
    /// `L`, mixed by a weighted mean.
    Constant,
    /// Linear, second order.
    Curved,
    /// Log, second order.
    CurvedExponential,
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
/// per channel, with `W = Σ w_k` and `W₊` the part of it from records with `L_k > 0`: Eq. 35 where
/// all are positive, and no blackening of everything by one black record where not.
///
/// ```
/// # use fogbow::{cache::{Blend, Extrapolation}, spectrum::Spectrum};
/// let mut blend = Blend::new(Extrapolation::Exponential, 4.0);
/// blend.add(0.5, Spectrum::splat(2.0), Spectrum::splat(0.0));
/// blend.add(0.5, Spectrum::splat(8.0), Spectrum::splat(0.0));
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
        Self { kind, limit, total: 0.0, sum: Spectrum::ZERO, positive: Spectrum::ZERO, slope: Gradient::ZERO, offset: Vec3::ZERO }
    }

    /// Adds a record's value and its change `∇L·Δ` on the way to the point.
    #[inline]
    pub fn add(&mut self, weight: f32, value: Spectrum, gradient: &Gradient, offset: Vec3) {
        self.total += weight;
        let change = gradient.along(offset);
        match self.kind {
            Extrapolation::Curved => {
                self.sum += (value + change * 0.5) * weight;
                self.slope += *gradient * weight;
                self.offset += offset * weight;
            }
            Extrapolation::CurvedExponential => {
                self.offset += offset * weight;
                let mut inverse = Spectrum::ZERO;
                for channel in 0..3 {
                    let l = value[channel];
                    if l > 0.0 {
                        let exponent = (change[channel] / l).clamp(-self.limit, self.limit);
                        self.sum[channel] += weight * (float::ln(l) + 0.5 * exponent);
                        self.positive[channel] += weight;
                        inverse[channel] = weight / l;
                    }
                }
                self.slope += *gradient * inverse;
            }
            Extrapolation::Exponential => {
                for channel in 0..3 {
                    let l = value[channel];
                    if l > 0.0 {
                        let exponent = (change[channel] / l).clamp(-self.limit, self.limit);
                        self.sum[channel] += weight * (float::ln(l) + exponent);
                        self.positive[channel] += weight;
                    }
                }
            }
            Extrapolation::ExponentialMean => {
                for channel in 0..3 {
                    let (l, change) = (value[channel], change[channel]);
                    // Negative lobes of truncated expansions are part of the mean.
                    let carried = if l > 0.0 { l * grown(change / l) } else { l };
                    self.sum[channel] += weight * carried;
                }
            }
            Extrapolation::Linear => self.sum += (value + change) * weight,
            Extrapolation::Constant => self.sum += value * weight,
        }
    }

    /// Sum of the weights so far.
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
            Extrapolation::Curved => (self.sum + self.slope.along(self.offset) * (0.5 / self.total)) / self.total,
            Extrapolation::CurvedExponential => {
                let bend = self.slope.along(self.offset) * (0.5 / self.total);
                (self.sum + bend).zip(self.positive, |sum, positive| {
                    if positive > 0.0 { positive / self.total * float::exp(sum / positive) } else { 0.0 }
                })
            }
            Extrapolation::Exponential => self.sum.zip(self.positive, |sum, positive| {
                if positive > 0.0 { positive / self.total * float::exp(sum / positive) } else { 0.0 }
            }),
            Extrapolation::ExponentialMean => (self.sum / self.total).max(Spectrum::ZERO),
            Extrapolation::Linear | Extrapolation::Constant => self.sum / self.total,
        })
    }
}

/// `eˣ` up to `x = 1`, straight on beyond: a value that nearly vanishes in one direction must not explode
/// by what its slope is in that direction.
#[inline]
fn grown(x: f32) -> f32 {
    use core::f32::consts::E;
    if x > 1.0 {
        return E * x;
    }
    if x < -1.0 {
        return float::exp(x);
    }
    // The fourth power of a series: 10⁻⁶.
    let y = 0.25 * x;
    let e = 1.0 + y * (1.0 + y * (0.5 + y * (1.0 / 6.0 + y * (1.0 / 24.0 + y * (1.0 / 120.0)))));
    let e = e * e;
    e * e
}
