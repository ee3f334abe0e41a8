//! Rays that run close by a light, joined to it.

use glam::{Vec2, Vec3};

use crate::light::{Light, LightSample, Source};
use crate::math::Ray;
use crate::sampling::distance::Equiangular;

/// A light in whose near field a part of a ray lies: see [`Light::near_field`].
///
/// There `1/r²` rules: light scattered into the ray is joined to the light not from wherever a walk collides, but from a
/// point drawn in proportion to `1/r²` along the ray, which takes that factor out of the estimate. Kulla and Fajardo 2012.
///
/// ```text
/// ∫ f(t) L(t) dt  ≈  f(t) L(t)/p(t),   p(t) ∝ 1/r(t)²
/// ```
///
/// ```
/// # use fogbow::{light::{Light, PointLight}, math::{Ray, Vec2, Vec3}, spectrum::Spectrum, world::NearLight};
/// // Irradiance of a lamp one metre beside an endless ray: ∫ dt/(1 + t²) = π/2, from any one point.
/// let lamp = Light::Point(PointLight::new(Vec3::Y, Spectrum::ONE)?);
/// let ray = Ray::new(Vec3::ZERO, Vec3::X);
/// let near = NearLight::of(&lamp, &ray, 0.0, f32::INFINITY).unwrap();
/// for u in [0.1, 0.5, 0.9] {
///     let joint = near.join(&ray, u, Vec2::ZERO).unwrap();
///     let light = joint.light(|| Vec2::ZERO).unwrap().incident;
///     assert!((light.irradiance[0] / joint.pdf - core::f32::consts::FRAC_PI_2).abs() < 1e-5);
/// }
/// # Ok::<(), fogbow::light::LightError>(())
/// ```
#[doc(alias("equiangular", "next-event estimation"))]
#[derive(Debug, Clone, Copy)]
pub struct NearLight<'a> {
    /// The light.
    pub light: &'a Light<'a>,
    /// From where to where (m) along the ray its near field reaches, and it shines.
    pub interval: (f32, f32),
}

/// A point of a ray, to be joined to a [`NearLight`].
#[derive(Debug, Clone, Copy)]
pub struct Joint<'a> {
    /// Distance along the ray (m).
    pub distance: f32,
    /// Where (m).
    pub point: Vec3,
    /// Density of the distance (m⁻¹).
    pub pdf: f32,
    light: &'a Light<'a>,
    /// The point of the light that the ray's was drawn around, where that is also the one to be joined to.
    anchor: Option<Source>,
}

impl<'a> NearLight<'a> {
    /// `light`, if it is near the part of `ray` between `near` and `far` (m; may be infinite).
    #[inline]
    #[must_use]
    pub fn of(light: &'a Light<'a>, ray: &Ray, near: f32, far: f32) -> Option<Self> {
        Some(Self { light, interval: light.near_interval(ray, near, far)? })
    }

    /// About what the light sends to its part of `ray`: see [`Light::sent_along`]. By it, one of several lights is chosen.
    ///
    /// ```
    /// # use fogbow::{light::{Light, PointLight}, math::{Ray, Vec3}, spectrum::Spectrum, world::NearLight};
    /// let lamp = Light::Point(PointLight::new(Vec3::Y, Spectrum::ONE)?);
    /// let ray = Ray::new(Vec3::ZERO, Vec3::X);
    /// let sent = NearLight::of(&lamp, &ray, 0.0, 1.0).unwrap().sent(&ray);
    /// assert!((sent - core::f32::consts::FRAC_PI_4).abs() < 1e-5);   // ∫₀¹ dt/(1 + t²)
    /// # Ok::<(), fogbow::light::LightError>(())
    /// ```
    #[inline]
    #[must_use]
    pub fn sent(&self, ray: &Ray) -> f32 {
        self.light.sent_along(ray, self.interval)
    }

    /// A point of `ray`: `u` in [0, 1) decides where, `on_light` in the unit square around which point of the light.
    /// `None` where the light has no points, or the part of the ray no length.
    #[inline]
    #[must_use]
    pub fn join(&self, ray: &Ray, u: f32, on_light: Vec2) -> Option<Joint<'a>> {
        let (pivot, anchor) = self.light.anchor(on_light)?;
        let (near, far) = self.interval;
        let law = Equiangular::new(ray.origin, ray.direction, pivot, near, far)?;
        let distance = law.sample(u).clamp(near, far);
        Some(Joint { distance, point: ray.at(distance), pdf: law.pdf(distance), light: self.light, anchor })
    }
}

impl Joint<'_> {
    /// The point of the light it is joined to, what that sends, and the density (sr⁻¹) of its direction as
    /// [`Light::anchor_pdf`] has it. `on_light` is asked where the point of the light has yet to be drawn. `None` where
    /// nothing arrives.
    ///
    /// ```
    /// # use fogbow::{light::{Light, PointLight}, math::{Ray, Vec2, Vec3}, spectrum::Spectrum, world::NearLight};
    /// let lamp = Light::Point(PointLight::new(Vec3::Y, Spectrum::ONE)?);
    /// let ray = Ray::new(Vec3::NEG_X, Vec3::X);
    /// let joint = NearLight::of(&lamp, &ray, 0.0, 2.0).unwrap().join(&ray, 0.3, Vec2::ZERO).unwrap();
    /// // A lamp that is a point is joined to where it is, with the light that falls off like 1/r².
    /// let light = joint.light(|| unreachable!()).unwrap().incident;
    /// let r = joint.point.distance(Vec3::Y);
    /// assert!((light.distance - r).abs() < 1e-6 && (light.irradiance[0] - 1.0 / (r * r)).abs() < 1e-6);
    /// # Ok::<(), fogbow::light::LightError>(())
    /// ```
    #[inline]
    #[must_use]
    pub fn light(&self, on_light: impl FnOnce() -> Vec2) -> Option<LightSample> {
        let Some(source) = self.anchor else { return self.light.sample(self.point, on_light()) };
        let incident = source.incident(self.point)?;
        let pdf = self.light.anchor_pdf(self.point, incident.to_light, incident.distance, source.normal);
        Some(LightSample { source, incident, pdf })
    }
}
