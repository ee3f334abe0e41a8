//! Axis-aligned boxes.

use glam::Vec3;

use super::Ray;

/// An axis-aligned box.
///
/// ```
/// # use fogbow::math::{Bounds, Vec3};
/// let room = Bounds::of([Vec3::ZERO, Vec3::new(4.0, 3.0, 2.0)]);
/// assert_eq!((room.centre(), room.size()), (Vec3::new(2.0, 1.5, 1.0), Vec3::new(4.0, 3.0, 2.0)));
/// let lamp = Vec3::new(2.0, 1.5, 5.0);
/// assert!(!room.contains(lamp) && room.union(Bounds::of([lamp])).contains(lamp));
/// assert_eq!(room.union(Bounds::EMPTY), room);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Smallest corner (m).
    pub min: Vec3,
    /// Largest corner (m).
    pub max: Vec3,
}

impl Bounds {
    /// The box that contains nothing: the neutral element of [`Bounds::union`].
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };
    /// All of space.
    pub const EVERYTHING: Self = Self { min: Vec3::NEG_INFINITY, max: Vec3::INFINITY };

    /// The smallest box around `points`.
    #[must_use]
    pub fn of(points: impl IntoIterator<Item = Vec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, |b, p| Self { min: b.min.min(p), max: b.max.max(p) })
    }

    /// The smallest box around both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Centre (m).
    #[must_use]
    pub fn centre(&self) -> Vec3 {
        (self.min + self.max) * 0.5
    }

    /// Edge lengths (m).
    #[must_use]
    pub fn size(&self) -> Vec3 {
        self.max - self.min
    }

    /// Whether the point lies inside or on the faces.
    #[inline]
    #[must_use]
    pub fn contains(&self, point: Vec3) -> bool {
        point.cmpge(self.min).all() && point.cmple(self.max).all()
    }

    /// Distances (m) at which the infinite line of `ray` enters and leaves the box; `None` if it
    /// misses. The entry is negative when the origin lies inside or beyond.
    ///
    /// ```
    /// # use fogbow::math::{Bounds, Ray, Vec3};
    /// let unit = Bounds { min: Vec3::ZERO, max: Vec3::ONE };
    /// let ray = Ray::new(Vec3::new(-1.0, 0.5, 0.5), Vec3::X);
    /// assert_eq!(unit.intersect(&ray), Some((1.0, 2.0)));
    /// ```
    #[inline]
    #[must_use]
    pub fn intersect(&self, ray: &Ray) -> Option<(f32, f32)> {
        let (mut near, mut far) = (f32::NEG_INFINITY, f32::INFINITY);
        for axis in 0..3 {
            let (o, d) = (ray.origin[axis], ray.direction[axis]);
            if d == 0.0 {
                // 0/0 would be NaN for a ray that runs in a face.
                if o < self.min[axis] || o > self.max[axis] {
                    return None;
                }
                continue;
            }
            let inverse = 1.0 / d;
            let (a, b) = ((self.min[axis] - o) * inverse, (self.max[axis] - o) * inverse);
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        (near <= far).then_some((near, far))
    }
}
