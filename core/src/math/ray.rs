//! Rays of finite or infinite length.

use glam::Vec3;

/// A straight path from `origin` along the unit vector `direction`, `length` metres long.
///
/// ```
/// # use fogbow::math::{Ray, Vec3};
/// let view = Ray::new(Vec3::ZERO, Vec3::X);
/// assert_eq!(view.length, f32::INFINITY);
/// let to_wall = view.with_length(3.0);
/// assert_eq!(to_wall.at(to_wall.length), Vec3::new(3.0, 0.0, 0.0));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Start (m).
    pub origin: Vec3,
    /// Direction of travel (unit).
    pub direction: Vec3,
    /// Length (m); may be infinite.
    pub length: f32,
}

impl Ray {
    /// A ray without end.
    #[inline]
    #[must_use]
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        debug_assert!((direction.length_squared() - 1.0).abs() < 1e-3, "direction {direction} is not a unit vector");
        Self { origin, direction, length: f32::INFINITY }
    }

    /// The ray from one point to another. Where both coincide: length 0, direction `+z`.
    ///
    /// ```
    /// # use fogbow::math::{Ray, Vec3};
    /// let ray = Ray::between(Vec3::ZERO, Vec3::new(3.0, 0.0, 4.0));
    /// assert!((ray.length - 5.0).abs() < 1e-6 && (ray.at(5.0).z - 4.0).abs() < 1e-5);
    /// ```
    #[inline]
    #[must_use]
    pub fn between(from: Vec3, to: Vec3) -> Self {
        let offset = to - from;
        // Scaled by the largest component, so that neither tiny nor huge distances lose their square.
        let largest = offset.abs().max_element();
        if largest <= 0.0 || !largest.is_finite() {
            return Self { origin: from, direction: Vec3::Z, length: 0.0 };
        }
        let scaled = offset / largest;
        let length = scaled.length();
        Self { origin: from, direction: scaled / length, length: length * largest }
    }

    /// The same ray, `length` metres long.
    #[inline]
    #[must_use]
    pub fn with_length(self, length: f32) -> Self {
        Self { length, ..self }
    }

    /// The point `distance` metres from the origin.
    #[inline]
    #[must_use]
    pub fn at(&self, distance: f32) -> Vec3 {
        self.origin + self.direction * distance
    }
}
