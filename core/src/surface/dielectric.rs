//! Glass other than a smooth interface: rough ones, and thin panes.

use glam::{Vec2, Vec3};

use super::SurfaceSample;
use super::microfacet::{GRAZING, Roughness};
use super::specular::{mirrored, refract};
use crate::spectrum::Spectrum;

/// A rough interface between two dielectrics: facets that reflect or refract once (Walter et al. 2007). For radiance: what is
/// refracted holds the `1/η²` by which its cone of directions changes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RoughDielectric {
    /// Index of refraction behind the normal over the one before it (> 0, not 1).
    pub eta: f32,
    /// Factor on reflected light.
    pub reflectance: Spectrum,
    /// Factor on transmitted light.
    pub transmittance: Spectrum,
    /// How the facets lie.
    pub roughness: Roughness,
}

/// A pair of directions at a rough interface.
pub(super) struct Facing {
    /// Normal of the facet that would send one into the other, on the side of the surface's normal.
    pub(super) m: Vec3,
    /// Whether both are on one side.
    pub(super) reflects: bool,
    /// Index on the far side over the one on the eye's.
    pub(super) eta: f32,
}

impl Facing {
    /// `None` where no facet sends one into the other.
    #[inline]
    pub(super) fn of(eye: Vec3, light: Vec3, eta: f32) -> Option<Self> {
        if !(eye.z.abs() > GRAZING && light.z.abs() > GRAZING) {
            return None;
        }
        let reflects = eye.z * light.z > 0.0;
        let eta = if eye.z > 0.0 { eta } else { 1.0 / eta };
        let half = (eye + light * if reflects { 1.0 } else { eta }).try_normalize()?;
        let m = if half.z < 0.0 { -half } else { half };
        // A facet has the sides that the surface has.
        (eye.dot(m) * eye.z > 0.0 && light.dot(m) * light.z > 0.0).then_some(Self { m, reflects, eta })
    }

    /// `|∂m/∂ω_light|`: densities of normals become densities of directions.
    #[inline]
    pub(super) fn jacobian(&self, eye: Vec3, light: Vec3) -> f32 {
        let cos = light.dot(self.m);
        if self.reflects {
            return 1.0 / (4.0 * cos.abs());
        }
        let sum = eye.dot(self.m) + self.eta * cos;
        self.eta * self.eta * cos.abs() / (sum * sum)
    }
}

impl RoughDielectric {
    #[inline]
    pub(super) fn value(&self, eye: Vec3, light: Vec3) -> Spectrum {
        let Some(facing) = Facing::of(eye, light, self.eta) else { return Spectrum::ZERO };
        let (m, rough) = (facing.m, &self.roughness);
        let fresnel = refract(eye, m, self.eta).reflectance;
        let shadowing = rough.masking(eye, m) * rough.masking(light, m);
        let common = rough.density(m) * shadowing / (eye.z * light.z).abs();
        if facing.reflects {
            // The cosines to the facet are equal: without them, nothing cancels at grazing angles.
            return self.reflectance * (0.25 * common * fresnel);
        }
        let bent = facing.jacobian(eye, light) * eye.dot(m).abs() / (facing.eta * facing.eta);
        self.transmittance * (common * (1.0 - fresnel) * bent)
    }

    #[inline]
    pub(super) fn pdf(&self, eye: Vec3, light: Vec3) -> f32 {
        let Some(facing) = Facing::of(eye, light, self.eta) else { return 0.0 };
        let fresnel = refract(eye, facing.m, self.eta).reflectance;
        let share = if facing.reflects { fresnel } else { 1.0 - fresnel };
        self.roughness.pdf(above(eye), facing.m) * share * facing.jacobian(eye, light)
    }

    #[inline]
    pub(super) fn sample(&self, eye: Vec3, choice: f32, u: Vec2) -> Option<SurfaceSample> {
        let (rough, seen_from) = (&self.roughness, above(eye));
        let m = rough.sample(seen_from, u);
        let refraction = refract(eye, m, self.eta);
        let (to_light, factor, share) = match refraction.transmitted {
            Some(transmitted) if choice >= refraction.reflectance => {
                let eta2 = refraction.relative_eta * refraction.relative_eta;
                (transmitted, self.transmittance / eta2, 1.0 - refraction.reflectance)
            }
            _ => (mirrored(eye, m), self.reflectance, refraction.reflectance),
        };
        let facing = Facing::of(eye, to_light, self.eta)?;
        let reflects = refraction.transmitted.is_none() || choice < refraction.reflectance;
        // What a facet sends to the wrong side of the surface is lost.
        if facing.reflects != reflects {
            return None;
        }
        let weight = factor * (rough.masking(to_light, m) * rough.misfit(seen_from));
        let pdf = rough.pdf(seen_from, m) * share * facing.jacobian(eye, to_light);
        (pdf > 0.0 && !weight.is_black()).then_some(SurfaceSample { to_light, weight, pdf })
    }
}

/// The direction, or its opposite, that leaves on the side of the normal: facets look the same from there.
#[inline]
pub(super) fn above(eye: Vec3) -> Vec3 {
    if eye.z < 0.0 { -eye } else { eye }
}

/// Both faces of a thin pane of glass, as one: light goes back and forth inside, and what passes goes straight on
/// (Mitsuba 3's `thindielectric`).
///
/// ```text
/// R' = R + T R T + T R³ T + … = 2R/(1 + R)
/// ```
#[inline]
pub(super) fn sample_thin(
    normal: Vec3,
    to_eye: Vec3,
    eta: f32,
    reflectance: Spectrum,
    transmittance: Spectrum,
    choice: f32,
) -> Option<SurfaceSample> {
    // Outside is on both sides.
    let facing = if normal.dot(to_eye) < 0.0 { -normal } else { normal };
    let once = refract(to_eye, facing, eta).reflectance;
    let reflected = 2.0 * once / (1.0 + once);
    let (to_light, weight) =
        if choice < reflected { (mirrored(to_eye, facing), reflectance) } else { (-to_eye, transmittance) };
    (!weight.is_black()).then_some(SurfaceSample { to_light, weight, pdf: 0.0 })
}
