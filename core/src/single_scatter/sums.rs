//! Accumulation of contributions.

use super::Contribution;
use crate::spectrum::{Gradient, Spectrum};

/// What a cache record needs of an estimate `Σ_j L_j`, per channel.
///
/// The valid radius is `ε Σ L_j / Σ ‖∇L_j‖` (Jarosz et al. 2008, Eq. 34), once over what is visible
/// and once with every `V = 1` (sheet § 1.9): the norms are added, not the vectors, so that opposing
/// gradients do not cancel.
///
/// ```
/// # use fogbow::{math::Vec3, single_scatter::{Contribution, Sums}, spectrum::{Gradient, Spectrum}};
/// let towards = |axis| Contribution { radiance: Spectrum::ONE, gradient: Gradient::outer(Spectrum::ONE, axis) };
/// let mut sums = Sums::default();
/// sums.add(&towards(Vec3::X), true);
/// sums.add(&towards(Vec3::NEG_X), true);
/// assert_eq!((sums.gradient, sums.gradient_norms[0]), (Gradient::ZERO, 2.0));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sums {
    /// `Σ V_j L_j` (W·m⁻²·sr⁻¹).
    pub value: Spectrum,
    /// `Σ V_j ∇L_j` (W·m⁻³·sr⁻¹).
    pub gradient: Gradient,
    /// `Σ V_j ‖∇L_j‖`.
    pub gradient_norms: Spectrum,
    /// `Σ L_j`, shadows left out.
    pub unshadowed: Spectrum,
    /// `Σ ‖∇L_j‖`, shadows left out.
    pub unshadowed_gradient_norms: Spectrum,
}

impl Sums {
    /// Adds one summand, which was computed as if visible.
    #[inline]
    pub fn add(&mut self, contribution: &Contribution, visible: bool) {
        let norm = contribution.gradient.norm();
        self.unshadowed += contribution.radiance;
        self.unshadowed_gradient_norms += norm;
        if visible {
            self.value += contribution.radiance;
            self.gradient += contribution.gradient;
            self.gradient_norms += norm;
        }
    }

    /// Adds to the norms alone: change (W·m⁻³·sr⁻¹) of which no direction is known.
    ///
    /// ```
    /// # use fogbow::{single_scatter::Sums, spectrum::{Gradient, Spectrum}};
    /// let mut sums = Sums::default();
    /// sums.add_norm(Spectrum::ONE);
    /// assert_eq!((sums.gradient, sums.gradient_norms), (Gradient::ZERO, Spectrum::ONE));
    /// ```
    #[inline]
    pub fn add_norm(&mut self, norm: Spectrum) {
        self.gradient_norms += norm;
        self.unshadowed_gradient_norms += norm;
    }

    /// Adds the summands of another estimate.
    ///
    /// ```
    /// # use fogbow::{single_scatter::{Contribution, Sums}, spectrum::{Gradient, Spectrum}};
    /// let light = Contribution { radiance: Spectrum::ONE, gradient: Gradient::ZERO };
    /// let (mut lit, mut shadowed) = (Sums::default(), Sums::default());
    /// lit.add(&light, true);
    /// shadowed.add(&light, false);
    /// lit.merge(&shadowed);
    /// assert_eq!((lit.value, lit.unshadowed), (Spectrum::ONE, Spectrum::splat(2.0)));
    /// ```
    #[inline]
    pub fn merge(&mut self, other: &Self) {
        self.value += other.value;
        self.gradient += other.gradient;
        self.gradient_norms += other.gradient_norms;
        self.unshadowed += other.unshadowed;
        self.unshadowed_gradient_norms += other.unshadowed_gradient_norms;
    }
}
