//! Layer 2: surfaces, what happens to light where a medium meets matter.
//!
//! | file | holds |
//! |---|---|
//! | `mod` | [`Surface`]: the closed set; value, density and sampling behind one `match` |
//! | [`lambert`] | ideal diffuse reflection |
//! | [`phong`] | energy-normalised Phong lobe over a Lambertian base |
//! | [`specular`] | mirror directions, Snell's law, Fresnel reflectance |
//! | `microfacet` | [`Roughness`]: distributions of small facets, masking, visible normals |
//! | `conductor` | [`Conductor`], [`RoughConductor`]: metals by complex indices |
//! | `dielectric` | [`RoughDielectric`]; thin panes |
//! | `plastic` | [`Plastic`], [`RoughPlastic`]: a diffuse base under a coat |
//! | `principled` | [`Principled`], [`PrincipledThin`]: Burley's models |
//!
//! `normal` is the geometric normal; one-sided surfaces (all that light does not pass) are black from behind. All directions
//! leave the surface.

mod conductor;
mod dielectric;
pub mod lambert;
mod microfacet;
pub mod phong;
mod plastic;
mod principled;
pub mod specular;

use glam::{Vec2, Vec3};

pub use conductor::{Conductor, RoughConductor};
pub use dielectric::RoughDielectric;
pub use microfacet::{Distribution, Roughness};
pub use plastic::{Plastic, RoughPlastic, diffuse_reflectance};
pub use principled::{Principled, PrincipledThin};

use crate::math::{Frame, float};
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
    /// A thin pane of glass: both its faces, reflecting back and forth, as one. What passes goes straight on.
    ThinDielectric {
        /// Index of refraction of the glass over the one outside (> 0).
        eta: f32,
        /// Factor on reflected light.
        reflectance: Spectrum,
        /// Factor on transmitted light.
        transmittance: Spectrum,
    },
    /// A smooth metal, on the side of the normal.
    Conductor(Conductor),
    /// A rough metal, on the side of the normal.
    RoughConductor(RoughConductor),
    /// A rough interface between two dielectrics.
    RoughDielectric(RoughDielectric),
    /// A diffuse base under a smooth coat, on the side of the normal: a mirror direction and all others.
    Plastic(Plastic),
    /// A diffuse base under a rough coat, on the side of the normal.
    RoughPlastic(RoughPlastic),
    /// A body of many looks, by a few numbers; light passes it where it is glass.
    Principled(Principled),
    /// A thin sheet of many looks, the same on both sides.
    PrincipledThin(PrincipledThin),
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

/// How much of what arrives keeps its direction, about.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gloss {
    /// Exponent of a Phong lobe as wide as this one.
    pub exponent: f32,
    /// What part of the light sent on is in it, in [0, 1]; the rest is diffuse.
    pub share: f32,
}

impl Gloss {
    /// All is diffuse.
    pub const NONE: Self = Self { exponent: 0.0, share: 0.0 };
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
        matches!(
            self,
            Self::Mirror { .. }
                | Self::Dielectric { .. }
                | Self::ThinDielectric { .. }
                | Self::Conductor(_)
                | Self::Null
        )
    }

    /// Whether light may leave on the other side.
    ///
    /// ```
    /// # use fogbow::{spectrum::Spectrum, surface::Surface};
    /// assert!(Surface::Null.transmits() && !Surface::Mirror { reflectance: Spectrum::ONE }.transmits());
    /// ```
    #[inline]
    #[must_use]
    pub fn transmits(&self) -> bool {
        match self {
            Self::Dielectric { .. } | Self::ThinDielectric { .. } | Self::RoughDielectric(_) | Self::Null => true,
            Self::Lambert { .. } | Self::Phong { .. } | Self::Mirror { .. } => false,
            Self::Conductor(_) | Self::RoughConductor(_) | Self::Plastic(_) | Self::RoughPlastic(_) => false,
            Self::Principled(body) => body.spec_trans > 0.0 && body.metallic < 1.0,
            Self::PrincipledThin(sheet) => sheet.spec_trans > 0.0 || sheet.diff_trans > 0.0,
        }
    }

    /// Whether methods that gather light at surfaces follow it past this one instead: where a part leaves in discrete
    /// directions, in lobes that may be narrow, or on the other side.
    ///
    /// ```
    /// # use fogbow::{spectrum::Spectrum, surface::Surface};
    /// assert!(Surface::Mirror { reflectance: Spectrum::ONE }.is_followed() && Surface::Null.is_followed());
    /// assert!(!Surface::Lambert { reflectance: Spectrum::ONE }.is_followed());
    /// ```
    #[inline]
    #[must_use]
    pub fn is_followed(&self) -> bool {
        !matches!(self, Self::Lambert { .. } | Self::Phong { .. })
    }

    /// What [`Surface::sample`] does to power that comes from `to_eye` and leaves towards `to_light`, where the sample's
    /// weight says what happens to radiance: without the `1/η²` of refraction (Veach 1997, chapter 5).
    ///
    /// ```
    /// # use fogbow::{math::{Vec2, Vec3}, spectrum::Spectrum, surface::Surface};
    /// let glass = Surface::Dielectric { eta: 1.5, reflectance: Spectrum::ONE, transmittance: Spectrum::splat(0.9) };
    /// let sample = glass.sample(Vec3::Z, Vec3::Z, 0.5, Vec2::ZERO).unwrap();
    /// assert!((sample.weight[0] - 0.9 / 2.25).abs() < 1e-6);
    /// assert_eq!(glass.power_weight(Vec3::Z, Vec3::Z, &sample), Spectrum::splat(0.9));
    /// ```
    #[inline]
    #[must_use]
    pub fn power_weight(&self, normal: Vec3, to_eye: Vec3, sample: &SurfaceSample) -> Spectrum {
        let cosine = normal.dot(to_eye);
        if cosine * normal.dot(sample.to_light) >= 0.0 {
            return sample.weight;
        }
        match self {
            Self::Dielectric { transmittance, .. } => *transmittance,
            Self::RoughDielectric(RoughDielectric { eta, .. }) | Self::Principled(Principled { eta, .. }) => {
                sample.weight * if cosine > 0.0 { eta * eta } else { 1.0 / (eta * eta) }
            }
            _ => sample.weight,
        }
    }

    /// The lobe in which light from `to_light` is sent `to_eye`, for how much of its detail is left; `None` where that is a
    /// mirror's direction, which keeps all.
    ///
    /// ```
    /// # use fogbow::{math::Vec3, spectrum::Spectrum, surface::{Conductor, Distribution, RoughConductor, Roughness, Surface}};
    /// let (grey, up) = (Spectrum::splat(0.5), Vec3::Z);
    /// assert_eq!(Surface::Lambert { reflectance: grey }.lobe(up, up, up).unwrap().share, 0.0);
    /// assert!(Surface::Mirror { reflectance: grey }.lobe(up, up, up).is_none());
    /// let roughness = Roughness::even(Distribution::Ggx, 0.1);
    /// let metal = RoughConductor { conductor: Conductor::mirror(grey), roughness };
    /// assert!((Surface::RoughConductor(metal).lobe(up, up, up).unwrap().exponent - 50.0).abs() < 1e-3);
    /// ```
    #[inline]
    #[must_use]
    pub fn lobe(&self, normal: Vec3, to_eye: Vec3, to_light: Vec3) -> Option<Gloss> {
        let share = |gloss: f32, rest: f32| if gloss > 0.0 { gloss / (rest + gloss) } else { 0.0 };
        match *self {
            Self::Lambert { .. } => Some(Gloss::NONE),
            Self::Phong { diffuse, specular, exponent } => {
                let base = lambert::value(diffuse).mean();
                let gloss = specular.mean() * phong::value(normal, to_eye, to_light, exponent);
                Some(Gloss { exponent, share: share(gloss, base) })
            }
            Self::Mirror { .. }
            | Self::Conductor(_)
            | Self::Dielectric { .. }
            | Self::ThinDielectric { .. }
            | Self::Null => None,
            Self::RoughConductor(RoughConductor { roughness, .. })
            | Self::RoughDielectric(RoughDielectric { roughness, .. }) => {
                Some(Gloss { exponent: roughness.exponent(), share: 1.0 })
            }
            Self::Plastic(_) => {
                let is_mirrored = specular::mirrored(to_eye, normal).distance_squared(to_light) < 1e-8;
                if is_mirrored { None } else { Some(Gloss::NONE) }
            }
            Self::RoughPlastic(plastic) => {
                let frame = Frame::around(normal);
                let (eye, light) = (frame.to_local(to_eye), frame.to_local(to_light));
                let (all, base) = (plastic.value(eye, light).mean(), plastic.diffuse_value(eye, light).mean());
                Some(Gloss { exponent: plastic.roughness().exponent(), share: share(all - base, base) })
            }
            Self::Principled(body) => {
                let frame = Frame::along(normal, body.tangent);
                let (eye, light) = (frame.to_local(to_eye), frame.to_local(to_light));
                let (all, base) = (body.value(eye, light).mean(), body.base_value(eye, light).mean());
                Some(Gloss { exponent: body.facets().exponent(), share: share(all - base, base) })
            }
            Self::PrincipledThin(sheet) => {
                let frame = Frame::along(normal, sheet.tangent);
                let (eye, light) = (frame.to_local(to_eye), frame.to_local(to_light));
                let base =
                    PrincipledThin { spec_trans: 0.0, ..sheet }.value(eye, light).mean() * (1.0 - sheet.spec_trans);
                let all = sheet.value(eye, light).mean();
                Some(Gloss { exponent: sheet.facets().exponent(), share: share(all - base, base) })
            }
        }
    }

    /// Albedo (1) of the Lambertian surface that sends `to_eye` about what the diffuse base of this one does; black where there is none, from behind, and of thin sheets, whose light comes
    /// from both sides. Exact for Lambert and Phong. Of coated and principled surfaces it is `π` times the value of the base for light from the mean direction of a diffuse sky (a cosine of ⅔): bases hardly depend on it but
    /// at grazing angles. What is looked up by it is corrected for the difference (`cache/eye.rs`), so that nothing else need be exact.
    ///
    /// ```
    /// # use fogbow::{math::Vec3, spectrum::Spectrum, surface::{Plastic, Surface}};
    /// let (grey, up) = (Spectrum::splat(0.5), Vec3::Z);
    /// let floor = Surface::Phong { diffuse: grey, specular: Spectrum::splat(0.2), exponent: 20.0 };
    /// assert_eq!((floor.base(up, up), floor.base(up, -up)), (grey, Spectrum::ZERO));
    /// let coated = Surface::Plastic(Plastic { eta: 1.5, diffuse: grey, specular: Spectrum::ONE, nonlinear: false });
    /// assert!((coated.base(up, up)[0] - 0.5).abs() < 0.01);   // what the coat keeps in, the base sends again
    /// ```
    #[must_use]
    pub fn base(&self, normal: Vec3, to_eye: Vec3) -> Spectrum {
        /// As steep as directions of a diffuse sky are in the mean.
        const MEAN: Vec3 = Vec3::new(0.0, 0.745_356, 2.0 / 3.0);
        if normal.dot(to_eye) <= 0.0 {
            return Spectrum::ZERO;
        }
        match self {
            Self::Lambert { reflectance } => *reflectance,
            Self::Phong { diffuse, .. } => *diffuse,
            Self::Plastic(plastic) => plastic.value(Frame::around(normal).to_local(to_eye), MEAN) * float::PI,
            Self::RoughPlastic(plastic) => {
                plastic.diffuse_value(Frame::around(normal).to_local(to_eye), MEAN) * float::PI
            }
            Self::Principled(body) => {
                body.base_value(Frame::along(normal, body.tangent).to_local(to_eye), MEAN) * float::PI
            }
            _ => Spectrum::ZERO,
        }
    }

    /// What draws directions of light that its [`base`](Self::base) does not send: a Phong surface without that, all others as they are.
    ///
    /// ```
    /// # use fogbow::{math::Vec3, spectrum::Spectrum, surface::Surface};
    /// let floor = Surface::Phong { diffuse: Spectrum::ONE, specular: Spectrum::ONE, exponent: 20.0 };
    /// assert_eq!(floor.without_base().base(Vec3::Z, Vec3::Z), Spectrum::ZERO);
    /// ```
    #[must_use]
    pub fn without_base(&self) -> Self {
        match *self {
            Self::Phong { specular, exponent, .. } => Self::Phong { diffuse: Spectrum::ZERO, specular, exponent },
            other => other,
        }
    }

    /// Bidirectional scattering function (sr⁻¹), without the cosine; 0 for discrete surfaces.
    ///
    /// ```
    /// # use fogbow::{math::Vec3, spectrum::Spectrum, surface::Surface};
    /// let wall = Surface::Lambert { reflectance: Spectrum::splat(0.5) };
    /// let value = wall.value(Vec3::Z, Vec3::Z, Vec3::new(0.6, 0.0, 0.8));
    /// assert!((value[0] - 0.5 / core::f32::consts::PI).abs() < 1e-7);
    /// ```
    #[must_use]
    pub fn value(&self, normal: Vec3, to_eye: Vec3, to_light: Vec3) -> Spectrum {
        // What has two sides of its own.
        match self {
            Self::RoughDielectric(glass) => {
                let frame = glass.roughness.frame(normal);
                return glass.value(frame.to_local(to_eye), frame.to_local(to_light));
            }
            Self::Principled(body) => {
                let frame = Frame::along(normal, body.tangent);
                return body.value(frame.to_local(to_eye), frame.to_local(to_light));
            }
            Self::PrincipledThin(sheet) => {
                let frame = Frame::along(normal, sheet.tangent);
                return sheet.value(frame.to_local(to_eye), frame.to_local(to_light));
            }
            _ => {}
        }
        if normal.dot(to_eye) <= 0.0 || normal.dot(to_light) <= 0.0 {
            return Spectrum::ZERO;
        }
        match self {
            Self::Lambert { reflectance } => lambert::value(*reflectance),
            Self::Phong { diffuse, specular, exponent } => {
                lambert::value(*diffuse) + *specular * phong::value(normal, to_eye, to_light, *exponent)
            }
            Self::RoughConductor(metal) => {
                let frame = metal.roughness.frame(normal);
                metal.value(frame.to_local(to_eye), frame.to_local(to_light))
            }
            Self::Plastic(plastic) => {
                let frame = Frame::around(normal);
                plastic.value(frame.to_local(to_eye), frame.to_local(to_light))
            }
            Self::RoughPlastic(plastic) => {
                let frame = Frame::around(normal);
                plastic.value(frame.to_local(to_eye), frame.to_local(to_light))
            }
            _ => Spectrum::ZERO,
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
    #[must_use]
    pub fn pdf(&self, normal: Vec3, to_eye: Vec3, to_light: Vec3) -> f32 {
        match self {
            Self::RoughDielectric(glass) => {
                let frame = glass.roughness.frame(normal);
                return glass.pdf(frame.to_local(to_eye), frame.to_local(to_light));
            }
            Self::Principled(body) => {
                let frame = Frame::along(normal, body.tangent);
                return body.pdf(frame.to_local(to_eye), frame.to_local(to_light));
            }
            Self::PrincipledThin(sheet) => {
                let frame = Frame::along(normal, sheet.tangent);
                return sheet.pdf(frame.to_local(to_eye), frame.to_local(to_light));
            }
            _ => {}
        }
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
            Self::RoughConductor(metal) => {
                let frame = metal.roughness.frame(normal);
                metal.pdf(frame.to_local(to_eye), frame.to_local(to_light))
            }
            Self::Plastic(plastic) => {
                let frame = Frame::around(normal);
                plastic.pdf(frame.to_local(to_eye), frame.to_local(to_light))
            }
            Self::RoughPlastic(plastic) => {
                let frame = Frame::around(normal);
                plastic.pdf(frame.to_local(to_eye), frame.to_local(to_light))
            }
            _ => 0.0,
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
    #[must_use]
    pub fn sample(&self, normal: Vec3, to_eye: Vec3, choice: f32, u: Vec2) -> Option<SurfaceSample> {
        match *self {
            Self::Null => Some(SurfaceSample { to_light: -to_eye, weight: Spectrum::ONE, pdf: 0.0 }),
            Self::Dielectric { eta, reflectance, transmittance } => {
                specular::sample_dielectric(normal, to_eye, eta, reflectance, transmittance, choice)
            }
            Self::ThinDielectric { eta, reflectance, transmittance } => {
                dielectric::sample_thin(normal, to_eye, eta, reflectance, transmittance, choice)
            }
            Self::RoughDielectric(glass) => {
                let frame = glass.roughness.frame(normal);
                within(&frame, glass.sample(frame.to_local(to_eye), choice, u))
            }
            Self::Principled(body) => {
                let frame = Frame::along(normal, body.tangent);
                within(&frame, body.sample(frame.to_local(to_eye), choice, u))
            }
            Self::PrincipledThin(sheet) => {
                let frame = Frame::along(normal, sheet.tangent);
                within(&frame, sheet.sample(frame.to_local(to_eye), choice, u))
            }
            _ if normal.dot(to_eye) <= 0.0 => None,
            Self::Conductor(metal) => {
                let weight = metal.fresnel(normal.dot(to_eye));
                let to_light = specular::mirrored(to_eye, normal);
                (!weight.is_black()).then_some(SurfaceSample { to_light, weight, pdf: 0.0 })
            }
            Self::RoughConductor(metal) => {
                let frame = metal.roughness.frame(normal);
                within(&frame, metal.sample(frame.to_local(to_eye), u))
            }
            Self::Plastic(plastic) => {
                let frame = Frame::around(normal);
                within(&frame, plastic.sample(frame.to_local(to_eye), choice, u))
            }
            Self::RoughPlastic(plastic) => {
                let frame = Frame::around(normal);
                within(&frame, plastic.sample(frame.to_local(to_eye), choice, u))
            }
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
            Self::Dielectric { reflectance, transmittance, .. }
            | Self::ThinDielectric { reflectance, transmittance, .. } => reflectance.max(transmittance),
            Self::Conductor(metal) => metal.reflectance,
            Self::RoughConductor(metal) => metal.conductor.reflectance,
            Self::RoughDielectric(glass) => glass.reflectance.max(glass.transmittance),
            Self::Plastic(plastic) => plastic.diffuse.max(plastic.specular),
            Self::RoughPlastic(plastic) => plastic.plastic().diffuse.max(plastic.plastic().specular),
            // Sheen, coats and tints add to their bases.
            Self::Principled(_) | Self::PrincipledThin(_) | Self::Null => Spectrum::ONE,
        }
    }
}

/// A sample from the frame of the surface in the world.
#[inline]
fn within(frame: &Frame, sample: Option<SurfaceSample>) -> Option<SurfaceSample> {
    sample.map(|sample| SurfaceSample { to_light: frame.to_world(sample.to_light).normalize(), ..sample })
}
