//! The blur of a beam across its direction, and how it narrows from pass to pass.

use crate::math::float::{self, PI};

/// `a = ∫ x² K dA` of the kernel with radius 1: a blur by radius `r` adds `a r² ΔΦ/2`, with the Laplacian
/// across the beam.
pub const SECOND_MOMENT: f32 = 1.0 / 8.0;

/// `∫ (∫ K dt)² ds` of the kernel with radius 1, over the straight lines that pass the axis at `s` on either side: by it, light of
/// beams that come by at random varies. `(16/5π)² ∫ (1 − s²)⁵ ds`, from −1 to 1.
pub const NOISE: f32 = 0.766_55;

/// The biweight kernel (m⁻²) at `distance` (m) from the axis of a beam of `radius` (m); 0 outside.
///
/// ```text
/// K(s) = 3/(π r²) (1 − s²/r²)²
/// ```
///
/// Integrates to 1 over the disc. Smoother than Epanechnikov's at the border, where beams would
/// show as rings. Reference: Silverman 1986, *Density Estimation*, § 4.2.
///
/// ```
/// # use fogbow::beams::kernel::value;
/// let centre = value(0.0, 2.0);
/// assert!((centre - 3.0 / (core::f32::consts::PI * 4.0)).abs() < 1e-6);
/// assert!((value(1.0, 2.0) / centre - 0.5625).abs() < 1e-6);   // (1 − 1/4)²
/// assert_eq!(value(2.0, 2.0), 0.0);
/// ```
#[inline]
#[must_use]
pub fn value(distance: f32, radius: f32) -> f32 {
    let share = distance / radius;
    let rest = 1.0 - share * share;
    if rest > 0.0 { 3.0 / (PI * radius * radius) * rest * rest } else { 0.0 }
}

/// `∫ (w² − u²)² du` from `from` to `to`: the kernel along a straight line that passes the axis at
/// `√(1 − w²)` radii, in units of `3/(π r²)` and of radii across the beam.
#[inline]
pub(super) fn chord(w2: f32, from: f32, to: f32) -> f32 {
    // (w² − u²)² expanded about the middle, so that short parts do not cancel.
    let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
    let (m2, h2) = (middle * middle, half * half);
    let at = w2 - m2;
    // With u = m + v: (at − 2 m v − v²)², odd powers of v vanish.
    2.0 * half * (at * at + h2 * ((4.0 * m2 - 2.0 * at) * (1.0 / 3.0) + h2 * 0.2)).max(0.0)
}

/// Radius (m) of the pass with number `pass` (from 0), after `first` (m) in pass 0.
///
/// ```text
/// r²_{i+1} = r²_i (i + α)/(i + 1)        ⇒        r²_i ∝ i^{α−1}
/// ```
///
/// `alpha` in (0, 1]: smaller narrows faster, which leaves more noise and less blur; 1 does not narrow.
/// Since the blur is integrated along the eye ray, a pass has a variance like `1/r` (not `1/r²`, as
/// with photon points): noise and blur of an average shrink alike at α = 0.6, the one's variance and the
/// other's square like `i^−0.8`. Reference: Knaus and Zwicker 2011, *Progressive Photon Mapping: A Probabilistic
/// Approach*, for kernels in two dimensions; here in closed form by gamma functions.
///
/// ```
/// # use fogbow::beams::kernel::radius;
/// assert_eq!(radius(0.1, 0.6, 0), 0.1);
/// let (before, after) = (radius(0.1, 0.6, 7), radius(0.1, 0.6, 8));
/// assert!(((after / before).powi(2) - 8.6 / 9.0).abs() < 1e-5);
/// ```
#[must_use]
pub fn radius(first: f32, alpha: f32, pass: u32) -> f32 {
    if pass == 0 {
        return first;
    }
    let (alpha, n) = (f64::from(alpha), f64::from(pass));
    let log = libm::lgamma(n + 1.0 + alpha) - libm::lgamma(1.0 + alpha) - libm::lgamma(n + 2.0);
    first * float::exp(0.5 * log as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_kernel_integrates_to_one_and_has_its_second_moment() {
        let (mut whole, mut second) = (0.0_f64, 0.0_f64);
        const STEPS: u32 = 4000;
        for i in 0..STEPS {
            let s = (f64::from(i) + 0.5) / f64::from(STEPS) * 2.0;
            let ring = 2.0 * core::f64::consts::PI * s * 2.0 / f64::from(STEPS);
            whole += f64::from(value(s as f32, 2.0)) * ring;
            second += 0.5 * s * s * f64::from(value(s as f32, 2.0)) * ring;
        }
        assert!((whole - 1.0).abs() < 1e-5, "{whole}");
        assert!((second / 4.0 - f64::from(SECOND_MOMENT)).abs() < 1e-5, "{second}");
    }

    #[test]
    fn the_noise_of_a_kernel_is_the_mean_square_of_its_chords() {
        const STEPS: u32 = 4000;
        let mut sum = 0.0_f64;
        for i in 0..STEPS {
            let s = (f64::from(i) + 0.5) / f64::from(STEPS);
            let w2 = (1.0 - s * s) as f32;
            let w = float::sqrt(w2);
            let line = f64::from(3.0 / PI * chord(w2, -w, w));
            sum += 2.0 * line * line / f64::from(STEPS);
        }
        assert!((sum - f64::from(NOISE)).abs() < 1e-5, "{sum}");
    }

    #[test]
    fn chords_agree_with_sums_and_add_up() {
        for w in [0.05_f32, 0.5, 1.0] {
            let w2 = w * w;
            let full = chord(w2, -w, w);
            assert!((full - 16.0 / 15.0 * w2 * w2 * w).abs() < 1e-6 * full, "w = {w}");
            let parts = chord(w2, -w, 0.3 * w) + chord(w2, 0.3 * w, w);
            assert!((parts - full).abs() < 1e-5 * full, "w = {w}");
        }
    }
}
