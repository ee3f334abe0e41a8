//! Layer 2: surfaces, what happens to light where a medium meets matter.
//!
//! | file | holds |
//! |---|---|
//! | `mod` | [`Surface`]: the closed set; value, density and sampling behind one `match` |
//! | [`lambert`] | ideal diffuse reflection |
//! | [`phong`] | energy-normalised Phong lobe over a Lambertian base |
//! | [`specular`] | mirror directions, Snell's law, Fresnel reflectance |
//!
//! `normal` is the geometric normal; one-sided surfaces (all but the dielectric and the null
//! interface) are black from behind. All directions leave the surface.

pub mod lambert;
pub mod phong;
pub mod specular;

use glam::{Vec2, Vec3};

use crate::spectrum::Spectrum;

/// What a surface does to light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Surface {
    /// Ideal diffuse reflection on the side of the normal.
    Lambert {
        /// Albedo, in [0, 1].
        reflectance: Spectrum,
    },
    /// A Phong lobe around the mirror direction over a Lambertian base. The sum of both
    /// reflectances must not exceed 1.
    Phong {
        /// Albedo of the base.
        diffuse: Spectrum,
        /// Albedo of the lobe at normal incidence.
        specular: Spectrum,
        /// Exponent of the lobe (≥ 0).
        exponent: f32,
    },
    /// Ideal mirror on the side of the normal.
    Mirror {
        /// Share of light reflected, in [0, 1].
        reflectance: Spectrum,
    },
    /// Smooth interface between two dielectrics, Fresnel reflection and refraction on both sides.
    Dielectric {
        /// Index of refraction behind the normal over the one before it (> 0).
        eta: f32,
        /// Factor on reflected light.
        reflectance: Spectrum,
        /// Factor on transmitted light.
        transmittance: Spectrum,
    },
    /// An interface that light passes unchanged.
    Null,
}

/// A direction drawn from a surface's reflection or transmission.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceSample {
    /// Where the traced path goes on (unit).
    pub to_light: Vec3,
    /// `f |cos| / pdf`; for discrete directions the factor on radiance.
    pub weight: Spectrum,
    /// Density (sr⁻¹); 0 for a discrete direction (mirror, glass, null), which next-event
    /// estimation cannot reach.
    pub pdf: f32,
}

impl Surface {
    /// Reflects nothing.
    pub const BLACK: Self = Self::Lambert { reflectance: Spectrum::ZERO };

    /// Whether light leaves in discrete directions only.
    ///
    /// ```
    /// # use fogbow::{spectrum::Spectrum, surface::Surface};
    /// assert!(Surface::Mirror { reflectance: Spectrum::ONE }.is_discrete() && Surface::Null.is_discrete());
    /// assert!(!Surface::Lambert { reflectance: Spectrum::ONE }.is_discrete());
    /// ```
    #[inline]
    #[must_use]
    pub fn is_discrete(&self) -> bool {
        matches!(self, Self::Mirror { .. } | Self::Dielectric { .. } | Self::Null)
    }

    /// Bidirectional scattering function (sr⁻¹), without the cosine; 0 for discrete surfaces.
    ///
    /// ```
    /// # use fogbow::{math::Vec3, spectrum::Spectrum, surface::Surface};
    /// let wall = Surface::Lambert { reflectance: Spectrum::splat(0.5) };
    /// let value = wall.value(Vec3::Z, Vec3::Z, Vec3::new(0.6, 0.0, 0.8));
    /// assert!((value[0] - 0.5 / core::f32::consts::PI).abs() < 1e-7);
    /// ```
    #[inline]
    #[must_use]
    pub fn value(&self, normal: Vec3, to_eye: Vec3, to_light: Vec3) -> Spectrum {
        if normal.dot(to_eye) <= 0.0 || normal.dot(to_light) <= 0.0 {
            return Spectrum::ZERO;
        }
        match *self {
            Self::Lambert { reflectance } => lambert::value(reflectance),
            Self::Phong { diffuse, specular, exponent } => {
                lambert::value(diffuse) + specular * phong::value(normal, to_eye, to_light, exponent)
            }
            Self::Mirror { .. } | Self::Dielectric { .. } | Self::Null => Spectrum::ZERO,
        }
    }

    /// Density (sr⁻¹) with which [`Surface::sample`] draws `to_light`; 0 for discrete surfaces.
    ///
    /// ```
    /// # use fogbow::{math::{Vec2, Vec3}, spectrum::Spectrum, surface::Surface};
    /// let grey = Spectrum::splat(0.3);
    /// let floor = Surface::Phong { diffuse: grey, specular: grey, exponent: 20.0 };
    /// let to_eye = Vec3::new(0.6, 0.0, 0.8);
    /// let sample = floor.sample(Vec3::Z, to_eye, 0.9, Vec2::new(0.3, 0.6)).unwrap();
    /// assert_eq!(sample.pdf, floor.pdf(Vec3::Z, to_eye, sample.to_light));   // of both lobes, whichever was drawn
    /// assert_eq!(floor.pdf(Vec3::Z, to_eye, Vec3::NEG_Z), 0.0);
    /// ```
    #[inline]
    #[must_use]
    pub fn pdf(&self, normal: Vec3, to_eye: Vec3, to_light: Vec3) -> f32 {
        let cosine = normal.dot(to_light);
        if normal.dot(to_eye) <= 0.0 || cosine <= 0.0 {
            return 0.0;
        }
        match *self {
            Self::Lambert { .. } => lambert::pdf(cosine),
            Self::Phong { diffuse, specular, exponent } => {
                let share = phong::lobe_share(diffuse, specular);
                share * phong::pdf(normal, to_eye, to_light, exponent) + (1.0 - share) * lambert::pdf(cosine)
            }
            Self::Mirror { .. } | Self::Dielectric { .. } | Self::Null => 0.0,
        }
    }

    /// Draws the direction from which light is received. `None` where nothing is reflected.
    ///
    /// `choice` selects between lobes, or between reflection and refraction; `u` the direction.
    ///
    /// ```
    /// # use fogbow::{math::{Vec2, Vec3}, spectrum::Spectrum, surface::Surface};
    /// let mirror = Surface::Mirror { reflectance: Spectrum::splat(0.9) };
    /// let sample = mirror.sample(Vec3::Z, Vec3::new(0.6, 0.0, 0.8), 0.5, Vec2::ZERO).unwrap();
    /// assert_eq!(sample.weight, Spectrum::splat(0.9));
    /// assert!((sample.to_light - Vec3::new(-0.6, 0.0, 0.8)).length() < 1e-6 && sample.pdf == 0.0);
    /// assert!(mirror.sample(Vec3::Z, Vec3::NEG_Z, 0.5, Vec2::ZERO).is_none());   // from behind
    /// ```
    #[inline]
    #[must_use]
    pub fn sample(&self, normal: Vec3, to_eye: Vec3, choice: f32, u: Vec2) -> Option<SurfaceSample> {
        match *self {
            Self::Null => Some(SurfaceSample { to_light: -to_eye, weight: Spectrum::ONE, pdf: 0.0 }),
            Self::Dielectric { eta, reflectance, transmittance } => {
                specular::sample_dielectric(normal, to_eye, eta, reflectance, transmittance, choice)
            }
            _ if normal.dot(to_eye) <= 0.0 => None,
            Self::Lambert { reflectance } => lambert::sample(normal, reflectance, u),
            Self::Mirror { reflectance } => (!reflectance.is_black()).then(|| SurfaceSample {
                to_light: specular::mirrored(to_eye, normal),
                weight: reflectance,
                pdf: 0.0,
            }),
            Self::Phong { diffuse, specular, exponent } => {
                let share = phong::lobe_share(diffuse, specular);
                let to_light = if choice < share {
                    phong::sample(normal, to_eye, exponent, u)
                } else {
                    lambert::sample(normal, Spectrum::ONE, u)?.to_light
                };
                let pdf = self.pdf(normal, to_eye, to_light);
                (pdf > 0.0).then(|| SurfaceSample {
                    to_light,
                    weight: self.value(normal, to_eye, to_light) * (normal.dot(to_light) / pdf),
                    pdf,
                })
            }
        }
    }

    /// An upper bound of the share of light that goes on, whatever the directions.
    ///
    /// ```
    /// # use fogbow::{spectrum::Spectrum, surface::Surface};
    /// let (diffuse, specular) = (Spectrum::splat(0.5), Spectrum::splat(0.25));
    /// assert_eq!(Surface::Phong { diffuse, specular, exponent: 10.0 }.albedo(), Spectrum::splat(0.75));
    /// assert_eq!((Surface::Null.albedo(), Surface::BLACK.albedo()), (Spectrum::ONE, Spectrum::ZERO));
    /// ```
    #[inline]
    #[must_use]
    pub fn albedo(&self) -> Spectrum {
        match *self {
            Self::Lambert { reflectance } | Self::Mirror { reflectance } => reflectance,
            Self::Phong { diffuse, specular, .. } => diffuse + specular,
            Self::Dielectric { reflectance, transmittance, .. } => reflectance.max(transmittance),
            Self::Null => Spectrum::ONE,
        }
    }
}
