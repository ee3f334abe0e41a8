//! A covariance with the frame it lives in.

use glam::Vec3;

use super::lobe::phase_covariance;
use super::matrix::{LIMIT, Symmetric4};
use super::operators::phong_lobe;
use crate::math::{Frame, Symmetric2, Symmetric3, float};
use crate::phase::{self, Phase};
use crate::surface::Surface;

/// The light field around a ray: the covariance of its spectrum, and the frame that its entries refer to.
///
/// The frame's third axis is the direction of *travel*; `θ` turns it towards the first axis, `φ` towards the
/// second. All arguments are in world coordinates, so that frames cannot be mixed up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LightField {
    /// Covariance (cycles²/m², cycles²/(m·rad), cycles²/rad²).
    pub covariance: Symmetric4,
    /// Axes `u`, `v`, and the direction of travel `w`.
    pub frame: Frame,
}

/// A surface where a light field meets it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Patch {
    /// Normal (unit); which side it points to does not matter.
    pub normal: Vec3,
    /// Shape operator (m⁻¹): see [`Scene::curvature`](crate::host::Scene::curvature), for this normal.
    pub curvature: Symmetric3,
    /// Covariance (cycles²/m²) of the reflectance's texture, in space.
    pub texture: Symmetric3,
}

impl Patch {
    /// A flat surface of one colour.
    ///
    /// ```
    /// # use fogbow::{covariance::Patch, math::{Symmetric3, Vec3}};
    /// let floor = Patch::flat(Vec3::Z);
    /// assert_eq!((floor.normal, floor.curvature, floor.texture), (Vec3::Z, Symmetric3::ZERO, Symmetric3::ZERO));
    /// ```
    #[must_use]
    pub const fn flat(normal: Vec3) -> Self {
        Self { normal, curvature: Symmetric3::ZERO, texture: Symmetric3::ZERO }
    }

    /// With the normal on the side from which light travelling along `direction` comes.
    fn facing(&self, direction: Vec3) -> Self {
        if self.normal.dot(direction) > 0.0 {
            // Convex from one side is concave from the other.
            Self { normal: -self.normal, curvature: self.curvature.bounded(LIMIT).times(-1.0), ..*self }
        } else {
            Self { curvature: self.curvature.bounded(LIMIT), ..*self }
        }
    }
}

/// `v` without its part along the unit vector `w`, unit; `None` where little is left.
fn across(v: Vec3, w: Vec3) -> Option<Vec3> {
    let rest = v - w * v.dot(w);
    let length2 = rest.length_squared();
    if !(length2 > 1e-12) {
        return None;
    }
    let unit = rest / float::sqrt(length2);
    // Where little was left, its rounding was blown up: once more.
    Some(if length2 < 1e-2 { (unit - w * unit.dot(w)).normalize() } else { unit })
}

impl LightField {
    /// A covariance in a frame of its own around a direction of travel (unit).
    ///
    /// ```
    /// # use fogbow::{covariance::{LightField, Symmetric4}, math::Vec3};
    /// let light = LightField::around(Vec3::X, Symmetric4::ZERO);
    /// assert!(light.frame.w == Vec3::X && light.frame.u.dot(Vec3::X).abs() < 1e-6);
    /// ```
    #[must_use]
    pub fn around(direction: Vec3, covariance: Symmetric4) -> Self {
        Self { covariance, frame: Frame::around(direction) }
    }

    /// After a flight of `distance` (m): [`Symmetric4::travelled`].
    ///
    /// ```
    /// # use fogbow::{covariance::{LightField, Symmetric4}, math::{Symmetric2, Vec3}};
    /// let unit = Symmetric2::diagonal(1.0, 1.0);
    /// let light = LightField::around(Vec3::Z, Symmetric4::separable(unit, Symmetric2::ZERO));
    /// // Seen from 3 m away, one cycle per metre is three per radian.
    /// assert_eq!(light.travelled(3.0).covariance.angular, Symmetric2::diagonal(9.0, 9.0));
    /// ```
    #[inline]
    #[must_use]
    pub fn travelled(&self, distance: f32) -> Self {
        Self { covariance: self.covariance.travelled(distance), ..*self }
    }

    /// Past occluders of spatial covariance `occluders` (cycles²/m², in space): B Fig. 3.
    ///
    /// ```
    /// # use fogbow::{covariance::{LightField, Symmetric4}, math::{Symmetric3, Vec3}};
    /// let edge = Symmetric3::from_upper([4.0, 0.0, 0.0, 0.0, 0.0, 0.0]);   // across x
    /// let past = |direction: Vec3| LightField::around(direction, Symmetric4::ZERO).occluded(&edge).covariance.trace();
    /// assert_eq!((past(Vec3::Z), past(Vec3::X)), (4.0, 0.0));   // along x there is nothing to cut off
    /// ```
    #[inline]
    #[must_use]
    pub fn occluded(&self, occluders: &Symmetric3) -> Self {
        let mask = occluders.bounded(LIMIT).within(self.frame.u, self.frame.v);
        Self { covariance: self.covariance.masked(&mask), ..*self }
    }

    /// Attenuated along `distance` (m) of a medium whose extinction has this Hessian (m⁻³):
    /// [`Symmetric4::attenuated`].
    ///
    /// ```
    /// # use fogbow::{covariance::{LightField, Symmetric4}, math::{Symmetric3, Vec3, float::PI}};
    /// let smoke = Symmetric3::from_upper([4.0 * PI * PI, 0.0, 0.0, 0.0, 0.0, 0.0]);   // varies along x
    /// let through = |direction: Vec3| LightField::around(direction, Symmetric4::ZERO).attenuated(&smoke, 2.0);
    /// assert!((through(Vec3::Z).covariance.trace() - 2.0).abs() < 1e-5);
    /// assert_eq!(through(Vec3::X).covariance.trace(), 0.0);
    /// ```
    #[inline]
    #[must_use]
    pub fn attenuated(&self, hessian: &Symmetric3, distance: f32) -> Self {
        let hessian = hessian.bounded(1e30).within(self.frame.u, self.frame.v);
        Self { covariance: self.covariance.attenuated(&hessian, distance), ..*self }
    }

    /// The same light field in the frame turned about the ray so that `u` points along `axis` as far as it can;
    /// unchanged if `axis` is parallel to the ray.
    ///
    /// ```
    /// # use fogbow::{covariance::{LightField, Symmetric4}, math::{Symmetric2, Vec3}};
    /// let light = LightField::around(Vec3::Z, Symmetric4::separable(Symmetric2::diagonal(4.0, 1.0), Symmetric2::ZERO));
    /// let turned = light.turned_to(light.frame.v);
    /// assert!((turned.frame.u - light.frame.v).length() < 1e-6);
    /// assert!((turned.covariance.spatial.xx - 1.0).abs() < 1e-6);   // the same light, by other axes
    /// ```
    #[inline]
    #[must_use]
    pub fn turned_to(&self, axis: Vec3) -> Self {
        let w = self.frame.w;
        let Some(u) = across(axis, w) else { return *self };
        let (cos, sin) = (self.frame.u.dot(u), self.frame.v.dot(u));
        Self { covariance: self.covariance.rotated(cos, sin), frame: Frame { u, v: w.cross(u), w } }
    }

    /// Scattered by a phase function into `outgoing` (unit, direction of travel): B Eq. 8–14.
    ///
    /// The plane of scattering becomes that of `u`; straight on and straight back keep the frame.
    ///
    /// ```
    /// # use fogbow::{covariance::{LightField, Symmetric4}, math::{Symmetric2, Vec3}, phase::Phase};
    /// let unit = Symmetric2::diagonal(1.0, 1.0);
    /// let light = LightField::around(Vec3::Z, Symmetric4::separable(unit, unit));
    /// let seen = light.scattered(Vec3::X, &Phase::ISOTROPIC);
    /// // Isotropic scattering leaves no angular content; at a right angle only one spatial axis is seen.
    /// assert_eq!(seen.covariance.angular, Symmetric2::ZERO);
    /// assert!((seen.covariance.spatial.trace() - 1.0).abs() < 1e-6);
    /// ```
    #[inline]
    #[must_use]
    pub fn scattered(&self, outgoing: Vec3, phase: &Phase) -> Self {
        let deflection = phase::deflection(-self.frame.w, outgoing);
        let lobe = phase_covariance(phase, deflection);
        self.convolved(outgoing, deflection.cos, &lobe)
    }

    /// [`LightField::scattered`] by a lobe of known angular covariance (cycles²/rad²; `u` in the plane of
    /// scattering).
    ///
    /// ```
    /// # use fogbow::{covariance::{LightField, Symmetric4}, math::{Symmetric2, Vec3}};
    /// let (sharp, lobe) = (Symmetric2::diagonal(3.0, 3.0), Symmetric2::diagonal(1.5, 1.5));
    /// let light = LightField::around(Vec3::Z, Symmetric4::separable(sharp, sharp));
    /// let straight = light.convolved(Vec3::Z, 1.0, &lobe);
    /// assert!((straight.covariance.angular.xx - 1.0).abs() < 1e-6);   // 1/(1/3 + 1/1.5)
    /// ```
    #[inline]
    #[must_use]
    pub fn convolved(&self, outgoing: Vec3, cos_alpha: f32, lobe: &Symmetric2) -> Self {
        let incoming = self.frame.w;
        // Of a small difference, not of two long vectors: its rounding would tilt the plane.
        let normal =
            if cos_alpha > 0.0 { incoming.cross(outgoing - incoming) } else { incoming.cross(outgoing + incoming) };
        let length = normal.length();
        let (aligned, v) = if length < 1e-6 {
            // Straight on or back: any plane will do, the frame's own first axis changes least.
            (*self, across(self.frame.v, outgoing).unwrap_or(self.frame.v))
        } else {
            let v = normal / length;
            (self.turned_to(v.cross(incoming)), v)
        };
        let covariance = aligned.covariance.scattered(cos_alpha, lobe);
        Self { covariance, frame: Frame { u: v.cross(outgoing), v, w: outgoing } }
    }

    /// Reflected by `surface` into `outgoing` (unit, direction of travel): sheet § 2.2, steps 1–7.
    ///
    /// ```
    /// # use fogbow::covariance::{LightField, Patch, Symmetric4};
    /// # use fogbow::{math::{Symmetric2, Vec3}, spectrum::Spectrum, surface::Surface};
    /// let unit = Symmetric2::diagonal(1.0, 1.0);
    /// let light = LightField::around(Vec3::NEG_Z, Symmetric4::separable(unit, unit));
    /// let mirror = Surface::Mirror { reflectance: Spectrum::ONE };
    /// // A flat mirror changes nothing but the direction.
    /// let seen = light.reflected(Vec3::Z, &Patch::flat(Vec3::Z), &mirror);
    /// assert!((seen.covariance.trace() - light.covariance.trace()).abs() < 1e-5 && seen.frame.w == Vec3::Z);
    /// ```
    #[inline]
    #[must_use]
    pub fn reflected(&self, outgoing: Vec3, patch: &Patch, surface: &Surface) -> Self {
        let patch = patch.facing(self.frame.w);
        let n = patch.normal;
        let (cos_in, cos_out) = (-self.frame.w.dot(n), outgoing.dot(n));
        let tangent = across(self.frame.w, n).or_else(|| across(self.frame.u, n)).unwrap_or(self.frame.u);
        let other = tangent.cross(n);
        let mut covariance = self.turned_to(tangent).covariance.projected(cos_in);
        covariance = covariance.curved(&patch.curvature.within(tangent, other), cos_in);
        covariance = covariance.masked(&patch.texture.bounded(LIMIT).within(tangent, other));
        // Mirrors pass all; of several lobes each counts by what it sends this way.
        if let Some(lobe) = surface.lobe(n, outgoing, -self.frame.w) {
            covariance = covariance.reflected_in_lobe(&phong_lobe(lobe.exponent).times(lobe.share));
        }
        let tangent_out = across(outgoing, n).unwrap_or(tangent);
        covariance = covariance.rotated(tangent.dot(tangent_out), other.dot(tangent_out));
        let other_out = tangent_out.cross(n);
        covariance = covariance.curved(&patch.curvature.within(tangent_out, other_out), cos_out);
        covariance = covariance.unprojected(cos_out).flipped();
        // The outgoing frame is the mirror image of an incoming one, made right-handed.
        let v = -other_out;
        Self { covariance, frame: Frame { u: v.cross(outgoing), v, w: outgoing } }
    }

    /// Refracted into `outgoing` (unit, direction of travel) where the index of refraction changes from
    /// `indices.0` to `indices.1`: [`Symmetric4::refracted`].
    ///
    /// ```
    /// # use fogbow::{covariance::{LightField, Patch, Symmetric4}, math::{Symmetric2, Vec3}};
    /// let unit = Symmetric2::diagonal(1.0, 1.0);
    /// let light = LightField::around(Vec3::NEG_Z, Symmetric4::separable(unit, unit));
    /// let inside = light.refracted(Vec3::NEG_Z, &Patch::flat(Vec3::Z), (1.0, 1.5));
    /// // Head on into glass: angular frequencies grow by n, those in space stay.
    /// assert!((inside.covariance.angular.trace() - 2.0 * 2.25).abs() < 1e-5);
    /// assert!((inside.covariance.spatial.trace() - 2.0).abs() < 1e-5);
    /// ```
    #[inline]
    #[must_use]
    pub fn refracted(&self, outgoing: Vec3, patch: &Patch, indices: (f32, f32)) -> Self {
        let patch = patch.facing(self.frame.w);
        let n = patch.normal;
        let tangent = across(self.frame.w, n).or_else(|| across(self.frame.u, n)).unwrap_or(self.frame.u);
        let v = tangent.cross(n);
        let curvature = patch.curvature.within(tangent, v);
        let cosines = (self.frame.w.dot(n), outgoing.dot(n));
        let covariance = self.turned_to(tangent).covariance.refracted(&curvature, cosines, indices);
        let v = across(v, outgoing).unwrap_or(v);
        Self { covariance, frame: Frame { u: v.cross(outgoing), v, w: outgoing } }
    }

    /// Of two light fields that travel together, with energies `weight` and `other_weight`, in this frame:
    /// [`Symmetric4::combined`]. `None` if their directions differ by more than a thousandth.
    ///
    /// ```
    /// # use fogbow::{covariance::{LightField, Symmetric4}, math::{Symmetric2, Vec3}};
    /// let unit = Symmetric2::diagonal(1.0, 1.0);
    /// let (sharp, even) = (Symmetric4::separable(unit, unit), Symmetric4::ZERO);
    /// let light = LightField::around(Vec3::Z, sharp);
    /// let both = light.combined(1.0, &LightField::around(Vec3::Z, even), 1.0).unwrap();
    /// assert!((both.covariance.trace() - 2.0).abs() < 1e-6);   // the mean of 4 and 0
    /// assert!(light.combined(1.0, &LightField::around(Vec3::X, even), 1.0).is_none());
    /// ```
    #[must_use]
    pub fn combined(&self, weight: f32, other: &Self, other_weight: f32) -> Option<Self> {
        if !(self.frame.w.distance_squared(other.frame.w) < 1e-6) {
            return None;
        }
        let aligned = other.turned_to(self.frame.u);
        Some(Self { covariance: self.covariance.combined(weight, &aligned.covariance, other_weight), ..*self })
    }

    /// What it adds to the covariance (cycles²/m²) of the fluence in space: `R S Rᵀ`, zero along the ray
    /// (B Eq. 15–16 as corrected in sheet § 2.5).
    ///
    /// ```
    /// # use fogbow::{covariance::{LightField, Symmetric4}, math::{Symmetric2, Vec3}};
    /// let (place, unit) = (Symmetric2::diagonal(4.0, 4.0), Symmetric2::diagonal(1.0, 1.0));
    /// let gamma = LightField::around(Vec3::Y, Symmetric4::separable(place, unit)).volumetric();
    /// assert!((gamma.along(Vec3::X) - 4.0).abs() < 1e-5 && gamma.along(Vec3::Y).abs() < 1e-5);
    /// ```
    #[inline]
    #[must_use]
    pub fn volumetric(&self) -> Symmetric3 {
        Symmetric3::embedded(&self.covariance.slice(), self.frame.u, self.frame.v)
    }
}
