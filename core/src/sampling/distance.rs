//! Distances along rays.

use crate::math::float;

/// Exponential distance (m) with rate `extinction` (m⁻¹); infinite where the rate is 0.
#[inline]
#[must_use]
pub fn exponential(u: f32, extinction: f32) -> f32 {
    // u < 1, so the argument is never −1; 0/0 for u = 0 in vacuum must not become NaN.
    if extinction <= 0.0 { f32::INFINITY } else { -float::ln_1p(-u) / extinction }
}

/// Density (m⁻¹) of [`exponential`].
#[inline]
#[must_use]
pub fn exponential_pdf(distance: f32, extinction: f32) -> f32 {
    extinction * float::exp(-extinction * distance)
}

/// A distance drawn from an exponential law cut off at `limit`, with what an estimator needs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Truncated {
    /// The distance (m), in [0, `limit`].
    pub distance: f32,
    /// Its density (m⁻¹).
    pub pdf: f32,
    /// `e^{−σt} / pdf = (1 − e^{−σ·limit}) / σ` (m); the same for every distance.
    pub weight: f32,
}

/// Exponential distance with rate `extinction` (m⁻¹, ≥ 0) within [0, `limit`] (m, > 0).
///
/// ```text
/// p(t) = σ e^{−σt} / (1 − e^{−σd})
/// ```
///
/// Uniform for σ = 0; no cancellation for thin or thick limits. Source: Engelhardt et al. 2012,
/// Eq. 4–5 (the sheet's § 3.4 for the stable forms).
///
/// ```
/// # use fogbow::sampling::distance::truncated_exponential;
/// let sample = truncated_exponential(0.5, 2.0, 3.0);
/// assert!(sample.distance < 1.5);      // the near half is likelier
/// assert!((sample.pdf * sample.weight - (-2.0f32 * sample.distance).exp()).abs() < 1e-6);
/// ```
#[inline]
#[must_use]
pub fn truncated_exponential(u: f32, extinction: f32, limit: f32) -> Truncated {
    let a = extinction * limit;
    if a < 1e-4 {
        let weight = limit * (1.0 - 0.5 * a);
        let distance = (u * limit * (1.0 - 0.5 * a * (1.0 - u))).clamp(0.0, limit);
        return Truncated { distance, pdf: float::exp(-extinction * distance) / weight, weight };
    }
    let q = -float::exp_m1(-a);
    let z = u * q;
    let t = if z < 0.5 { -float::ln_1p(-z) } else { -float::ln((1.0 - u) + u * float::exp(-a)) } / extinction;
    let distance = t.clamp(0.0, limit);
    let weight = q / extinction;
    Truncated { distance, pdf: float::exp(-extinction * distance) / weight, weight }
}

/// Distances along a ray drawn in proportion to `1/r²`, `r` the distance to a point light: the
/// angle seen from the light is uniform (Kulla and Fajardo 2012).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Equiangular {
    /// Distance along the ray of the point nearest to the light (m).
    closest: f32,
    /// Distance between light and ray (m), at least a tiny fraction of the interval.
    height: f32,
    near_angle: f32,
    angle: f32,
}

impl Equiangular {
    /// For the part from `near` to `far` (m, may be infinite) of the ray `origin + t·direction`, and a light at
    /// `light`. `None` if the part has no length.
    #[inline]
    #[must_use]
    pub fn new(origin: glam::Vec3, direction: glam::Vec3, light: glam::Vec3, near: f32, far: f32) -> Option<Self> {
        if !(far > near && near.is_finite()) {
            return None;
        }
        let closest = direction.dot(light - origin);
        // A light on the ray itself would make all angles ±π/2; a millionth of the way keeps the map regular.
        let reach = if far.is_finite() { (far - closest).abs() } else { 0.0 };
        let floor = 1e-6 * reach.max((near - closest).abs()).max(1e-20);
        let height = (origin + direction * closest).distance(light).max(floor);
        let near_angle = float::atan((near - closest) / height);
        let angle = float::atan((far - closest) / height) - near_angle;
        // Far from the light the angle may round to nothing.
        (angle > 1e-7).then_some(Self { closest, height, near_angle, angle })
    }

    /// The distance (m) for the uniform number `u`.
    #[inline]
    #[must_use]
    pub fn sample(&self, u: f32) -> f32 {
        self.closest + self.height * float::tan(self.near_angle + u * self.angle)
    }

    /// Density (m⁻¹) of a distance inside the interval.
    #[inline]
    #[must_use]
    pub fn pdf(&self, distance: f32) -> f32 {
        let offset = distance - self.closest;
        self.height / (self.angle * (self.height * self.height + offset * offset))
    }
}

impl Equiangular {
    /// `∫ dt/r²` over the interval (m⁻¹): what a point light of intensity 1 sends to it.
    #[inline]
    #[must_use]
    pub fn weight(&self) -> f32 {
        self.angle / self.height
    }
}
