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

/// Reach of the discs of [`steep_square`], over the side of the square. Larger: points that fall outside it; smaller: less is drawn to a centre than
/// rises towards it.
const STEEP: f32 = 0.5;

/// A point for which one of the unit square stands, and one over its density, at most 2: half of the points are uniform, the others lie within half a side of one of
/// the `centres`, each as often, uniform in their distance to it. Of points that fall outside the square nothing counts: 0. Without centres the point itself, and 1.
///
/// ```text
/// p = ½ + ½/n Σ 1/(π rᵢ)   over the centres that are less than ½ away
/// ```
///
/// What rays of a pixel see goes like `1/r` around a lamp without extent in fog; its square has no mean over the pixel, while samples drawn so have a bound. Where in the pixel lamps
/// are seen is for the host to say.
///
/// ```
/// # use fogbow::{math::{Vec2, float::PI}, sampling::warp::steep_square};
/// let lamp = Vec2::splat(0.5);
/// let (at, weight) = steep_square(Vec2::new(0.75, 0.0), &[lamp]);
/// assert_eq!(at, Vec2::new(0.75, 0.5));   // half of the way out
/// assert!((weight * (0.5 + 0.5 / (0.25 * PI)) - 1.0).abs() < 1e-6);
/// assert_eq!(steep_square(Vec2::new(0.75, 0.0), &[]), (Vec2::new(0.75, 0.0), 1.0));
/// ```
#[must_use]
pub fn steep_square(u: Vec2, centres: &[Vec2]) -> (Vec2, f32) {
    let count = centres.len() as f32;
    if centres.is_empty() {
        return (u, 1.0);
    }
    let point = if u.x < 0.5 {
        Vec2::new(2.0 * u.x, u.y)
    } else {
        // Casts saturate, and take NaN to 0.
        let which = (2.0 * u.x - 1.0) * count;
        let centre = (which as usize).min(centres.len() - 1);
        let (sin, cos) = float::sin_cos(2.0 * PI * u.y);
        centres[centre] + Vec2::new(cos, sin) * (STEEP * (which - centre as f32))
    };
    // Written so that NaN is outside.
    if !(point.cmpge(Vec2::ZERO).all() && point.cmplt(Vec2::ONE).all()) {
        return (point, 0.0);
    }
    let distances = centres.iter().map(|centre| point.distance(*centre)).filter(|distance| *distance < STEEP);
    let steep: f32 = distances.map(|distance| 1.0 / (2.0 * PI * STEEP * distance)).sum();
    (point, 1.0 / (0.5 + 0.5 * steep / count))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::{Generator, uniform2};

    /// 1/r around centres inside, at a border and outside: the mean over the square, within a bound.
    #[test]
    fn what_rises_like_one_over_r_has_a_bound_and_its_mean() {
        const SAMPLES: u32 = 400_000;
        let middle = Vec2::splat(0.5);
        // ∫ 1/r over the unit square: 4 asinh 1 about its middle, half of that at a corner.
        let about_middle = 4.0 * libm::asinh(1.0);
        for (centres, mean) in [
            (&[middle][..], about_middle),
            (&[Vec2::ZERO], 0.5 * about_middle),
            (&[middle, Vec2::X, Vec2::new(0.1, -0.2)], about_middle),
        ] {
            let mut rng = Generator::new(3);
            let (mut sum, mut squares, mut ones, mut most) = (0.0, 0.0, 0.0, 0.0_f32);
            for _ in 0..SAMPLES {
                let (point, weight) = steep_square(uniform2(&mut rng), centres);
                assert!((0.0..=2.0).contains(&weight), "{point} {weight}");
                let value = if weight > 0.0 { weight / point.distance(centres[0]) } else { 0.0 };
                most = most.max(value);
                (sum, squares) = (sum + f64::from(value), squares + f64::from(value * value));
                ones += f64::from(weight);
            }
            let count = f64::from(SAMPLES);
            let error = libm::sqrt((squares / count - (sum / count) * (sum / count)) / count);
            assert!((sum / count - mean).abs() < 4.0 * error, "{centres:?}: {} ± {error}", sum / count);
            // A weight is at most 2, so that its variance is at most 4.
            assert!((ones / count - 1.0).abs() < 4.0 * 2.0 / libm::sqrt(count), "{}", ones / count);
            assert!(most <= 2.0 * PI * centres.len() as f32 * 1.0001, "{most}");
        }
        let (_, weight) = steep_square(Vec2::splat(f32::NAN), &[middle]);
        assert_eq!(weight, 0.0);
    }
}
