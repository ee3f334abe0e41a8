//! The weight of a path and its gradient.

use crate::single_scatter::Contribution;
use crate::spectrum::{Gradient, Spectrum};

/// `(W, ∇W)`: weight of the path so far, and how it changes when the whole path is translated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weight {
    /// `W_k = Π a_i`.
    pub value: Spectrum,
    /// `∇W_k` (m⁻¹).
    pub gradient: Gradient,
}

impl Default for Weight {
    fn default() -> Self {
        Self::ONE
    }
}

impl Weight {
    /// Of a path without vertices.
    pub const ONE: Self = Self { value: Spectrum::ONE, gradient: Gradient::ZERO };

    /// One vertex on.
    ///
    /// ```text
    /// a = κ T σₛ,   ∇a = κ T (∇σₛ − σₛ ∇τ),   (W, ∇W) ← (W a, a ∇W + W ∇a)
    /// ```
    ///
    /// `kappa` holds what is frozen: phase function over the densities of direction and length and
    /// the probability of survival. `transmittance` and `thickness_gradient` (joint translation) are
    /// those of the segment, the rest belongs to the new vertex. No division by `σₛ`: where it is 0
    /// the weight is 0, and only its gradient may remain. Source: sheet § 1.7 (J, Eq. 30).
    ///
    /// ```
    /// # use fogbow::{math::Vec3, multiple_scatter::Weight, spectrum::{Gradient, Spectrum}};
    /// let half = Spectrum::splat(0.5);
    /// let thicker = Gradient::outer(Spectrum::ONE, Vec3::X);
    /// let w = Weight::ONE.advance(Spectrum::ONE, half, &thicker, Spectrum::ONE, &Gradient::ZERO);
    /// assert_eq!((w.value, w.gradient.x), (half, -half));
    /// ```
    #[inline]
    #[must_use]
    pub fn advance(
        &self,
        kappa: Spectrum,
        transmittance: Spectrum,
        thickness_gradient: &Gradient,
        scattering: Spectrum,
        scattering_gradient: &Gradient,
    ) -> Self {
        let frozen = kappa * transmittance;
        let step = frozen * scattering;
        let slope = (*scattering_gradient - *thickness_gradient * scattering) * frozen;
        Self { value: self.value * step, gradient: self.gradient * step + slope * self.value }
    }

    /// Light at the last vertex, carried to the first: `(W L, L ∇W + W ∇L)`.
    #[inline]
    #[must_use]
    pub fn carry(&self, light: &Contribution) -> Contribution {
        Contribution {
            radiance: self.value * light.radiance,
            gradient: self.gradient * light.radiance + light.gradient * self.value,
        }
    }

    /// Both parts times a factor: one over a probability of survival.
    #[inline]
    #[must_use]
    pub fn scaled(&self, factor: f32) -> Self {
        Self { value: self.value * factor, gradient: self.gradient * factor }
    }
}
