//! Several media in the same space.

use glam::Vec3;

use super::MediumError;
use crate::host::{Face, Gradients, MajorantSegment, Medium, Properties};
use crate::math::{Ray, float};
use crate::phase::Phase;
use crate::spectrum::{Gradient, Hessian, Spectrum};

/// Media in the same space: coefficients and emission add, the phase function is the mixture
/// weighted by scattering. No media at all are vacuum.
///
/// ```text
/// σₐ = Σ σₐᵢ,   σₛ = Σ σₛᵢ,   p = Σ σₛᵢ pᵢ / Σ σₛᵢ
/// ```
///
/// ```
/// # use fogbow::{host::Medium, math::Vec3, phase::{Lobe, Phase}, spectrum::Spectrum};
/// # use fogbow::medium::{Homogeneous, Overlap};
/// let haze = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC).unwrap();
/// let smoke = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Lobe::HenyeyGreenstein { g: 0.5 }).unwrap();
/// let both = [haze, smoke];
/// let air = Overlap::new(&both, Homogeneous::phase).unwrap();
/// let there = air.properties(Vec3::ZERO);
/// assert_eq!(there.scattering, Spectrum::splat(2.0));
/// assert_eq!(there.phase.mean_cosine(), Spectrum::splat(0.25));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Overlap<'a, M>(&'a [M]);

impl<'a, M: Medium> Overlap<'a, M> {
    /// From `media`, each of which scatters by the one phase function that `phase` tells.
    ///
    /// # Errors
    /// More than [`MAX_LOBES`](crate::phase::MAX_LOBES) different lobes in all.
    pub fn new(media: &'a [M], phase: impl Fn(&M) -> Phase) -> Result<Self, MediumError> {
        Phase::mix(media.iter().map(|m| (Spectrum::ONE, phase(m)))).map_err(|_| MediumError::TooManyLobes)?;
        Ok(Self(media))
    }

    /// The media.
    ///
    /// ```
    /// # use fogbow::{medium::{Homogeneous, Overlap}, phase::Phase, spectrum::Spectrum};
    /// let both = [Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC)?; 2];
    /// assert_eq!(Overlap::new(&both, Homogeneous::phase)?.media(), both);
    /// # Ok::<(), fogbow::medium::MediumError>(())
    /// ```
    #[must_use]
    pub fn media(&self) -> &'a [M] {
        self.0
    }
}

/// No media: vacuum.
impl<M> Default for Overlap<'_, M> {
    fn default() -> Self {
        Self(&[])
    }
}

impl<M> Overlap<'_, M> {
    /// Bounds of the sum of all media.
    fn joined(&self, ask: impl Fn(&M) -> MajorantSegment) -> MajorantSegment {
        if let [only] = self.0 {
            return ask(only);
        }
        let mut sum = MajorantSegment::vacuum(f32::INFINITY);
        let mut is_constant = true;
        for segment in self.0.iter().map(ask) {
            is_constant &= segment.is_constant();
            sum.until = float::min(sum.until, segment.until);
            sum.minorant += segment.minorant;
            sum.majorant += segment.majorant;
        }
        if !is_constant {
            // Sums round; and a thin cloud in thick fog may leave no trace in them.
            sum.minorant *= 1.0 - 8.0 * f32::EPSILON;
            sum.majorant = sum.majorant.map(|c| c.max(f32::MIN_POSITIVE) * (1.0 + 8.0 * f32::EPSILON));
        }
        sum
    }
}

impl<M: Medium> Medium for Overlap<'_, M> {
    /// Should the mixture have too many lobes after all (the constructor was told otherwise), the
    /// phase function of the medium that scatters most stands for all.
    fn properties(&self, point: Vec3) -> Properties {
        let (first, rest) = match self.0 {
            [] => return Properties::VACUUM,
            [only] => return only.properties(point),
            [first, rest @ ..] => (first, rest),
        };
        let mut sum = first.properties(point);
        let mut most = sum.scattering.mean();
        for medium in rest {
            let other = medium.properties(point);
            if !other.scattering.is_black() {
                let parts = [(sum.scattering, sum.phase), (other.scattering, other.phase)];
                let share = other.scattering.mean();
                sum.phase = Phase::mix(parts).unwrap_or(if share > most { other.phase } else { sum.phase });
                most = most.max(share);
            }
            sum.absorption += other.absorption;
            sum.scattering += other.scattering;
            sum.emission += other.emission;
        }
        sum
    }

    fn majorant_segment(&self, ray: &Ray, from: f32) -> MajorantSegment {
        self.joined(|medium| medium.majorant_segment(ray, from))
    }

    fn marching_segment(&self, ray: &Ray, from: f32) -> MajorantSegment {
        self.joined(|medium| medium.marching_segment(ray, from))
    }

    fn extinction(&self, point: Vec3) -> Spectrum {
        self.0.iter().map(|m| m.extinction(point)).sum()
    }

    fn extinction_with_gradient(&self, point: Vec3) -> (Spectrum, Gradient) {
        let sum = |a: (Spectrum, Gradient), b: (Spectrum, Gradient)| (a.0 + b.0, a.1 + b.1);
        self.0.iter().map(|m| m.extinction_with_gradient(point)).fold((Spectrum::ZERO, Gradient::ZERO), sum)
    }

    /// The finest of all; 1 m without media.
    fn resolution(&self) -> f32 {
        if self.0.is_empty() {
            return 1.0;
        }
        self.0.iter().map(Medium::resolution).fold(f32::INFINITY, f32::min)
    }

    fn gradients(&self, point: Vec3) -> Gradients {
        let sum = |a: Gradients, b: Gradients| Gradients {
            extinction: a.extinction + b.extinction,
            scattering: a.scattering + b.scattering,
        };
        self.0.iter().map(|m| m.gradients(point)).fold(Gradients::default(), sum)
    }

    fn extinction_hessian(&self, point: Vec3) -> Hessian {
        self.0.iter().map(|m| m.extinction_hessian(point)).fold(Hessian::ZERO, |a, b| a + b)
    }

    fn mean_extinction(&self, centre: Vec3, radius: f32) -> Spectrum {
        self.0.iter().map(|m| m.mean_extinction(centre, radius)).sum()
    }

    fn faces(&self, ray: &Ray, visit: &mut dyn FnMut(Face)) {
        self.0.iter().for_each(|m| m.faces(ray, visit));
    }

    fn is_grey(&self) -> bool {
        self.0.iter().all(Medium::is_grey)
    }

    fn is_emissive(&self) -> bool {
        self.0.iter().any(Medium::is_emissive)
    }
}
