//! What an estimate's samples tell together and no single one knows: where the edges of the sky are.

use crate::host::Hit;
use crate::spectrum::Spectrum;

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
