//! Distances along rays.

use crate::math::float;

/// Exponential distance (m) with rate `extinction` (m⁻¹); infinite where the rate is 0.
///
/// ```
/// # use fogbow::sampling::distance::exponential;
/// let median = exponential(0.5, 2.0);
/// assert!(((-2.0 * median).exp() - 0.5).abs() < 1e-6);   // half of the light comes farther
/// assert_eq!(exponential(0.0, 0.0), f32::INFINITY);   // vacuum stops nothing
/// ```
#[inline]
#[must_use]
pub fn exponential(u: f32, extinction: f32) -> f32 {
    // u < 1, so the argument is never −1; 0/0 for u = 0 in vacuum must not become NaN.
    if extinction <= 0.0 { f32::INFINITY } else { -float::ln_1p(-u) / extinction }
}

/// Density (m⁻¹) of [`exponential`].
///
/// ```
/// # use fogbow::sampling::distance::exponential_pdf;
/// assert_eq!(exponential_pdf(0.0, 2.0), 2.0);   // the rate itself
/// let transmittance = exponential_pdf(1.5, 2.0) / exponential_pdf(0.0, 2.0);
/// assert!((transmittance - (-3.0_f32).exp()).abs() < 1e-7);
/// ```
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
///
/// ```
/// # use fogbow::{math::Vec3, sampling::distance::Equiangular};
/// // Two metres of a ray, and a lamp one metre beside their middle: seen from it they span a right angle.
/// let lamp = Vec3::new(1.0, 1.0, 0.0);
/// let part = Equiangular::new(Vec3::ZERO, Vec3::X, lamp, 0.0, 2.0).unwrap();
/// assert!((part.sample(0.5) - 1.0).abs() < 1e-6);
/// assert!((part.weight() - core::f32::consts::FRAC_PI_2).abs() < 1e-6);   // ∫ dt/(1 + t²) from −1 to 1
/// let t = part.sample(0.2);
/// let squared = (Vec3::X * t).distance_squared(lamp);
/// assert!((part.pdf(t) * part.weight() * squared - 1.0).abs() < 1e-5);   // proportional to 1/r²
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Equiangular {
    /// Distance along the ray of the point nearest to the light (m).
    closest: f32,
    /// Distance between light and ray (m), at least a tiny fraction of the interval.
    height: f32,
    /// Where angles are counted from: the end of the interval that is nearer to the light.
    pivot: f32,
    /// Tangent of the angle there, towards the interval; negative where the light is beside it.
    tangent: f32,
    /// Whether the interval leads from the pivot along the ray.
    is_forward: bool,
    angle: f32,
}

impl Equiangular {
    /// For the part from `near` to `far` (m, may be infinite) of the ray `origin + t·direction`, and a light at
    /// `light`. `None` if the part has no length.
    ///
    /// The angle seen is computed as a difference of tangents, so that it keeps its digits where the
    /// light is far away, or lies on the ray before or behind the interval.
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
        let is_forward = !(far < closest);
        let (pivot, tangent) =
            if is_forward { (near, (near - closest) / height) } else { (far, (closest - far) / height) };
        let angle = if far.is_finite() {
            let length = (far - near) / height;
            float::atan2(length, 1.0 + tangent * (tangent + length))
        } else {
            float::atan2(1.0, tangent)
        };
        // Written so that NaN fails, too.
        (angle > f32::MIN_POSITIVE).then_some(Self { closest, height, pivot, tangent, is_forward, angle })
    }

    /// The distance (m) for the uniform number `u`.
    #[inline]
    #[must_use]
    pub fn sample(&self, u: f32) -> f32 {
        if self.tangent < 0.0 {
            // The light is beside the interval.
            return self.closest + self.height * float::tan(float::atan(self.tangent) + u * self.angle);
        }
        // tan(α + φ) − tan α = tan φ (1 + tan² α)/(1 − tan α tan φ)
        let u = if self.is_forward { u } else { 1.0 - u };
        let step = float::tan(u * self.angle);
        let along = self.height * step * (1.0 + self.tangent * self.tangent) / (1.0 - self.tangent * step).max(1e-7);
        if self.is_forward { self.pivot + along } else { self.pivot - along }
    }

    /// Density (m⁻¹) of a distance inside the interval.
    #[inline]
    #[must_use]
    pub fn pdf(&self, distance: f32) -> f32 {
        // Squared only after the division: far away the square would leave the range of f32.
        let tangent = (distance - self.closest) / self.height;
        1.0 / (self.angle * self.height * (1.0 + tangent * tangent))
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
