//! What scatters light at a point: a medium or a surface.

use glam::{Vec2, Vec3};

use crate::host::{Hit, Properties};
use crate::phase::{Phase, deflection};
use crate::spectrum::Spectrum;
use crate::surface::Surface;
use crate::world::leave;

/// What scatters light at a point: `f̂` of Engelhardt et al. 2012, with its cosine `D`.
///
/// ```
/// # use fogbow::{math::{Vec2, Vec3, float::{INV_FOUR_PI, PI}}, phase::Phase, spectrum::Spectrum, surface::Surface};
/// # use fogbow::vpl::Scatterer;
/// let fog = Scatterer::Medium { scattering: Spectrum::splat(2.0), phase: Phase::ISOTROPIC };
/// let wall = Scatterer::Surface { normal: Vec3::Z, surface: Surface::Lambert { reflectance: Spectrum::splat(0.5) } };
/// let values = [fog, wall].map(|scatterer| scatterer.value(Vec3::Z, Vec3::new(0.6, 0.0, 0.8))[0]);
/// assert!((values[0] - 2.0 * INV_FOUR_PI).abs() < 1e-6 && (values[1] - 0.5 / PI).abs() < 1e-6);
/// assert_eq!([fog, wall].map(|scatterer| scatterer.cosine(Vec3::NEG_Z)), [1.0, 0.0]);
/// // Drawn in proportion to all of it, what is left is the scattering coefficient and the albedo.
/// let weights = [fog, wall].map(|scatterer| scatterer.sample(Vec3::Z, 0.5, Vec2::new(0.3, 0.6)).unwrap().1[0]);
/// assert_eq!(weights, [2.0, 0.5]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Scatterer {
    /// A medium: `f̂ = σₛ p`, `D = 1`.
    Medium {
        /// `σₛ` (m⁻¹).
        scattering: Spectrum,
        /// `p`.
        phase: Phase,
    },
    /// A surface: `f̂ = f_r`, `D = n·ω`.
    Surface {
        /// Its normal (unit).
        normal: Vec3,
        /// What it does to light.
        surface: Surface,
    },
}

impl Scatterer {
    /// `f̂` for light that comes from `to_light` and leaves towards `to_eye` (unit), per steradian (and metre, in a
    /// medium).
    #[inline]
    #[must_use]
    pub fn value(&self, to_eye: Vec3, to_light: Vec3) -> Spectrum {
        match self {
            Self::Medium { scattering, phase } => *scattering * phase.value(deflection(to_light, to_eye)),
            Self::Surface { normal, surface } => surface.value(*normal, to_eye, to_light),
        }
    }

    /// `D` of a direction that leaves the point: the cosine before a surface, 0 behind it, 1 in a medium.
    #[inline]
    #[must_use]
    pub fn cosine(&self, direction: Vec3) -> f32 {
        match self {
            Self::Medium { .. } => 1.0,
            Self::Surface { normal, .. } => normal.dot(direction).max(0.0),
        }
    }

    /// What weights of samples are measured in: the greatest scattering coefficient of a medium (m⁻¹), 1 on a surface.
    #[inline]
    pub(super) fn unit(&self) -> f32 {
        match self {
            Self::Medium { scattering, .. } => scattering.max_element(),
            Self::Surface { .. } => 1.0,
        }
    }

    /// Draws the direction from which light comes that leaves towards `to_eye`, with `f̂ D` over the density.
    #[inline]
    #[must_use]
    pub fn sample(&self, to_eye: Vec3, choice: f32, u: Vec2) -> Option<(Vec3, Spectrum)> {
        match self {
            Self::Medium { scattering, phase } => {
                let sample = phase.sample(to_eye, u);
                Some((sample.to_light, *scattering * sample.weight))
            }
            Self::Surface { normal, surface } => {
                let sample = surface.sample(*normal, to_eye, choice, u)?;
                Some((sample.to_light, sample.weight))
            }
        }
    }
}

/// A point that light is gathered for, and where that light goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Receiver {
    /// Where (m); on a surface the very point, which rays to it have to leave.
    pub point: Vec3,
    /// Where the light leaves to (unit).
    pub to_eye: Vec3,
    /// What scatters it there.
    pub scatterer: Scatterer,
}

impl Receiver {
    /// A point of a medium; `None` where nothing scatters.
    ///
    /// ```
    /// # use fogbow::{host::Properties, math::Vec3, spectrum::Spectrum, vpl::Receiver};
    /// let fog = Properties { scattering: Spectrum::ONE, ..Properties::VACUUM };
    /// let receiver = Receiver::in_medium(Vec3::X, Vec3::Z, &fog).unwrap();
    /// assert_eq!(receiver.scatterer.cosine(Vec3::Z), 1.0);
    /// assert!(Receiver::in_medium(Vec3::X, Vec3::Z, &Properties::VACUUM).is_none());
    /// ```
    #[inline]
    #[must_use]
    pub fn in_medium(point: Vec3, to_eye: Vec3, properties: &Properties) -> Option<Self> {
        let scattering = properties.scattering;
        (!scattering.is_black()).then_some(Self {
            point,
            to_eye,
            scatterer: Scatterer::Medium { scattering, phase: properties.phase },
        })
    }

    /// A point of a surface; `None` for surfaces that light is followed past ([`Surface::is_followed`]), and for black ones.
    ///
    /// ```
    /// # use fogbow::{host::Hit, math::Vec3, spectrum::Spectrum, surface::Surface, vpl::Receiver};
    /// let hit = |surface| Hit { distance: 1.0, normal: Vec3::Z, shading: Vec3::Z, surface, light: None };
    /// let wall = hit(Surface::Lambert { reflectance: Spectrum::ONE });
    /// assert!(Receiver::on_surface(Vec3::ZERO, Vec3::Z, &wall).is_some());
    /// assert!(Receiver::on_surface(Vec3::ZERO, Vec3::NEG_Z, &wall).is_none());   // from behind
    /// assert!(Receiver::on_surface(Vec3::ZERO, Vec3::Z, &hit(Surface::Mirror { reflectance: Spectrum::ONE })).is_none());
    /// ```
    #[inline]
    #[must_use]
    pub fn on_surface(point: Vec3, to_eye: Vec3, hit: &Hit) -> Option<Self> {
        let scatters = !hit.surface.is_followed() && !hit.surface.albedo().is_black();
        (scatters && hit.faces(to_eye)).then_some(Self {
            point,
            to_eye,
            scatterer: Scatterer::Surface { normal: hit.shading, surface: hit.surface },
        })
    }

    /// Where a ray towards `direction` starts (m).
    ///
    /// ```
    /// # use fogbow::{host::{Hit, Properties}, math::Vec3, spectrum::Spectrum, surface::Surface, vpl::Receiver};
    /// let surface = Surface::Lambert { reflectance: Spectrum::ONE };
    /// let hit = Hit { distance: 1.0, normal: Vec3::Z, shading: Vec3::Z, surface, light: None };
    /// let on_wall = Receiver::on_surface(4.0 * Vec3::Z, Vec3::Z, &hit).unwrap();
    /// let start = on_wall.origin(Vec3::Z).z;
    /// assert!(start > 4.0 && start < 4.001);   // off the wall, by a few roundings
    /// let fog = Properties { scattering: Spectrum::ONE, ..Properties::VACUUM };
    /// assert_eq!(Receiver::in_medium(Vec3::X, Vec3::Z, &fog).unwrap().origin(Vec3::Z), Vec3::X);
    /// ```
    #[inline]
    #[must_use]
    pub fn origin(&self, direction: Vec3) -> Vec3 {
        origin(self.point, &self.scatterer, direction)
    }
}

/// `point`, moved off its surface to the side of `direction`.
#[inline]
pub(super) fn origin(point: Vec3, scatterer: &Scatterer, direction: Vec3) -> Vec3 {
    match scatterer {
        Scatterer::Medium { .. } => point,
        Scatterer::Surface { normal, .. } => leave(point, *normal, direction, 0.0),
    }
}
