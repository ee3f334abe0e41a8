//! Directions and points from uniform numbers. Local directions have their axis along +z.

use glam::{Vec2, Vec3};

use crate::math::float::{self, INV_FOUR_PI, PI};

/// Unit vector with the given cosine to +z and azimuth `2π·u`.
///
/// `sine` is an argument because callers know it without cancellation.
///
/// ```
/// # use fogbow::{math::Vec3, sampling::warp::spherical};
/// assert!((spherical(0.0, 1.0, 0.25) - Vec3::Y).length() < 1e-6);   // a quarter turn from +x
/// ```
#[inline]
#[must_use]
pub fn spherical(cosine: f32, sine: f32, u: f32) -> Vec3 {
    let (s, c) = float::sin_cos(2.0 * PI * u);
    Vec3::new(sine * c, sine * s, cosine)
}

/// A direction uniform over the sphere.
///
/// ```
/// # use fogbow::{math::Vec2, sampling::warp::uniform_sphere};
/// let direction = uniform_sphere(Vec2::new(0.2, 0.7));
/// assert!((direction.z - 0.6).abs() < 1e-6);   // heights are uniform (Archimedes): z = 1 − 2 u.x
/// assert!((direction.length() - 1.0).abs() < 1e-6);
/// ```
#[inline]
#[must_use]
pub fn uniform_sphere(u: Vec2) -> Vec3 {
    let cosine = 1.0 - 2.0 * u.x;
    spherical(cosine, 2.0 * float::safe_sqrt(u.x * (1.0 - u.x)), u.y)
}

/// Density (sr⁻¹) of [`uniform_sphere`].
///
/// ```
/// # use fogbow::{math::float::PI, sampling::warp::uniform_sphere_pdf};
/// assert!((4.0 * PI * uniform_sphere_pdf() - 1.0).abs() < 1e-6);   // over 4π steradians
/// ```
#[inline]
#[must_use]
pub fn uniform_sphere_pdf() -> f32 {
    INV_FOUR_PI
}

/// A direction in the upper hemisphere with density proportional to its cosine.
///
/// ```
/// # use fogbow::{math::Vec2, sampling::warp::cosine_hemisphere};
/// let direction = cosine_hemisphere(Vec2::new(0.75, 0.1));
/// assert!((direction.z - 0.5).abs() < 1e-6);   // z² is uniform: a disc, seen from above
/// ```
#[inline]
#[must_use]
pub fn cosine_hemisphere(u: Vec2) -> Vec3 {
    spherical(float::safe_sqrt(1.0 - u.x), float::sqrt(u.x), u.y)
}

/// Density (sr⁻¹) of [`cosine_hemisphere`].
///
/// ```
/// # use fogbow::{math::{float::PI, quadrature::integrate}, sampling::warp::cosine_hemisphere_pdf};
/// let total = 2.0 * PI * integrate(0.0, 1.0, cosine_hemisphere_pdf);   // over the hemisphere: dω = 2π d cos
/// assert!((total - 1.0).abs() < 1e-6);
/// assert_eq!(cosine_hemisphere_pdf(-0.5), 0.0);
/// ```
#[inline]
#[must_use]
pub fn cosine_hemisphere_pdf(cosine: f32) -> f32 {
    cosine.max(0.0) / PI
}

/// A direction in the upper hemisphere with density proportional to `cosⁿ`.
///
/// ```
/// # use fogbow::{math::Vec2, sampling::warp::{cosine_hemisphere, cosine_power}};
/// let u = Vec2::new(0.3, 0.6);
/// assert!((cosine_power(u, 1.0) - cosine_hemisphere(u)).length() < 1e-6);   // exponent 1
/// assert!(cosine_power(u, 1000.0).z > 0.999);   // large exponents: close to the axis
/// ```
#[inline]
#[must_use]
pub fn cosine_power(u: Vec2, exponent: f32) -> Vec3 {
    let cosine = float::powf(1.0 - u.x, 1.0 / (exponent + 1.0));
    spherical(cosine, float::safe_sqrt((1.0 - cosine) * (1.0 + cosine)), u.y)
}

/// Density (sr⁻¹) of [`cosine_power`].
///
/// ```
/// # use fogbow::{math::{float::PI, quadrature::integrate}, sampling::warp::cosine_power_pdf};
/// let total = 2.0 * PI * integrate(0.0, 1.0, |cosine| cosine_power_pdf(cosine, 6.0));
/// assert!((total - 1.0).abs() < 1e-6);
/// ```
#[inline]
#[must_use]
pub fn cosine_power_pdf(cosine: f32, exponent: f32) -> f32 {
    if cosine <= 0.0 { 0.0 } else { (exponent + 1.0) / (2.0 * PI) * float::powf(cosine, exponent) }
}

/// A direction uniform within a cone around +z; `one_minus_cos` is `1 − cos` of its half angle,
/// which narrow cones know without cancellation.
///
/// ```
/// # use fogbow::{math::Vec2, sampling::warp::{uniform_cone, uniform_sphere}};
/// let u = Vec2::new(0.3, 0.6);
/// assert!((uniform_cone(u, 2.0) - uniform_sphere(u)).length() < 1e-6);   // half angle π: the whole sphere
/// assert!((uniform_cone(Vec2::X, 1e-8).x / 2e-8_f32.sqrt() - 1.0).abs() < 1e-6);   // sin² ≈ 2 (1 − cos)
/// ```
#[inline]
#[must_use]
pub fn uniform_cone(u: Vec2, one_minus_cos: f32) -> Vec3 {
    let below = u.x * one_minus_cos;
    spherical(1.0 - below, float::safe_sqrt(below * (2.0 - below)), u.y)
}

/// Density (sr⁻¹) of [`uniform_cone`] inside the cone.
///
/// ```
/// # use fogbow::{math::float::PI, sampling::warp::uniform_cone_pdf};
/// assert!((2.0 * PI * uniform_cone_pdf(1.0) - 1.0).abs() < 1e-6);   // the hemisphere has 2π steradians
/// ```
#[inline]
#[must_use]
pub fn uniform_cone_pdf(one_minus_cos: f32) -> f32 {
    1.0 / (2.0 * PI * one_minus_cos)
}

/// A direction within a cone around +z of half angle `widest` (rad), uniform in its angle θ to the axis: the denser, the
/// closer to it. As light that rays collect from a lamp that they pass goes like `1/sin θ`, too, samples of it have a bound.
///
/// ```
/// # use fogbow::{math::Vec2, sampling::warp::steep_cone};
/// let direction = steep_cone(Vec2::new(0.5, 0.0), 1.0);
/// assert!((direction.x - 0.5f32.sin()).abs() < 1e-6);
/// ```
#[inline]
#[must_use]
pub fn steep_cone(u: Vec2, widest: f32) -> Vec3 {
    let (sin, cos) = float::sin_cos(u.x * widest);
    spherical(cos, sin, u.y)
}

/// Density (sr⁻¹) of [`steep_cone`] in a unit direction whose cross product with the axis is `across`, and dot product `along`.
///
/// ```text
/// p = 1/(2π θ_max sin θ)
/// ```
///
/// ```
/// # use fogbow::{math::{Vec3, float::PI}, sampling::warp::steep_cone_pdf};
/// let axis = Vec3::Z;
/// let pdf = |direction: Vec3| steep_cone_pdf(axis.cross(direction).length(), axis.dot(direction), 0.5 * PI);
/// assert!((pdf(Vec3::new(0.6, 0.0, 0.8)) * 2.0 * PI * 0.5 * PI * 0.6 - 1.0).abs() < 1e-6);
/// assert_eq!(pdf(Vec3::NEG_Z), 0.0);   // outside
/// ```
#[inline]
#[must_use]
pub fn steep_cone_pdf(across: f32, along: f32, widest: f32) -> f32 {
    if libm::atan2f(across, along) > widest {
        return 0.0;
    }
    1.0 / (2.0 * PI * widest * across.max(f32::MIN_POSITIVE))
}

/// Barycentric coordinates `(b₁, b₂)` of a uniform point in a triangle, without a fold
/// (Heitz 2019); area density 1 / area.
///
/// ```
/// # use fogbow::{math::Vec2, sampling::warp::uniform_triangle};
/// assert_eq!((uniform_triangle(Vec2::X), uniform_triangle(Vec2::Y)), (Vec2::X, Vec2::Y));   // two corners
/// assert_eq!(uniform_triangle(Vec2::ONE), Vec2::splat(0.5));   // the middle of the edge between them
/// ```
#[inline]
#[must_use]
pub fn uniform_triangle(u: Vec2) -> Vec2 {
    if u.y > u.x {
        let x = u.x * 0.5;
        Vec2::new(x, u.y - x)
    } else {
        let y = u.y * 0.5;
        Vec2::new(u.x - y, y)
    }
}
