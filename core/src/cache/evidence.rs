//! What an estimate's samples tell together and no single one knows: how far its gradient can be believed, and
//! where the edges of the sky are.

use crate::host::Hit;
use crate::spectrum::{Gradient, Spectrum};

/// Distance (m) at which surfaces before a sky count if they are nearer.
const NEAREST: f32 = 1e-12;

/// Light of a sky and what stands before it. Its edges, not the sky itself, change what arrives as a point moves,
/// by as much as if the sky were a surface at their distance. Which directions are edges no single
/// sample knows, so that the gradient lacks this; radii must not. An estimate of how much, no bound.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Openings {
    sky: Spectrum,
    /// Over the directions that meet a surface, each by 1/density (sr): sums of 1/distance (sr/m), and of 1.
    near: f32,
    met: f32,
}

impl Openings {
    /// Light that came along a ray, if from the sky.
    #[inline]
    pub(super) fn add_sky(&mut self, end: Option<&Hit>, light: Spectrum) {
        if end.is_none() {
            self.sky += light;
        }
    }

    /// What a ray met, whose direction was drawn with density `pdf`; black or not, it hides the sky.
    #[inline]
    pub(super) fn add_surface(&mut self, end: Option<&Hit>, pdf: f32) {
        if let Some(hit) = end {
            // A hit at the point itself must not leave the range of f32: infinity times a black sky is no number.
            self.near += 1.0 / (hit.distance.max(NEAREST) * pdf);
            self.met += 1.0 / pdf;
        }
    }

    /// `Σ‖∇L_j‖` over the directions to the sky: a surface that is faced at the harmonic mean distance has `2L/r`.
    pub(super) fn norm(&self) -> Spectrum {
        if self.met > 0.0 { self.sky * (2.0 * self.near / self.met) } else { Spectrum::ZERO }
    }
}

/// How far an estimated gradient can be believed: as far as two halves of its samples agree.
///
/// ```text
/// t = g₁·g₂ / ‖(g₁ + g₂)/2‖², in [0, 1], per channel
/// ```
///
/// The product is an unbiased estimate of the true square, the norm is too large by the noise.
/// Unbelieved, noise in gradients would brighten whatever is extrapolated with them, because
/// the exponential of noise is more than 1 in the mean.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Halves([Gradient; 2]);

impl Halves {
    /// Adds the gradient of a sample of the first half or the second: 0 or 1.
    #[inline]
    pub(super) fn add(&mut self, half: usize, gradient: &Gradient) {
        self.0[half] += *gradient;
    }

    pub(super) fn trust(&self) -> Spectrum {
        let [a, b] = self.0;
        // Scaled, so that squares stay in the range of f32.
        let largest = a.norm().max(b.norm());
        let dot = |a: &Gradient, b: &Gradient| {
            let part = |a: Spectrum, b: Spectrum| a.ratio(largest) * b.ratio(largest);
            part(a.x, b.x) + part(a.y, b.y) + part(a.z, b.z)
        };
        let sum = a + b;
        let square = dot(&sum, &sum) * 0.25;
        dot(&a, &b).zip(square, |ab, ss| if ss > 0.0 { (ab / ss).clamp(0.0, 1.0) } else { 0.0 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;
    use crate::surface::Surface;

    #[test]
    fn surfaces_at_the_point_itself_leave_numbers() {
        let hit = |distance| Hit { distance, normal: Vec3::Y, shading: Vec3::Y, surface: Surface::BLACK, light: None };
        let mut openings = Openings::default();
        (0..4096).for_each(|_| openings.add_surface(Some(&hit(0.0)), 0.08));
        assert_eq!(openings.norm(), Spectrum::ZERO, "without a sky");
        openings.add_sky(None, Spectrum::ONE);
        assert!(openings.norm().is_finite());
    }
}
