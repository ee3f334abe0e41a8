//! Orthonormal frames.

use glam::Vec3;

/// A right-handed orthonormal frame `(u, v, w)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// First axis (unit).
    pub u: Vec3,
    /// Second axis (unit).
    pub v: Vec3,
    /// Third axis (unit); the direction the frame was built around.
    pub w: Vec3,
}

impl Frame {
    /// A frame around the unit vector `w`, continuous except where `w` passes `−z`.
    ///
    /// Branchless construction of Duff et al. 2017, "Building an Orthonormal Basis, Revisited".
    ///
    /// ```
    /// # use fogbow::math::{Frame, Vec3};
    /// let frame = Frame::around(Vec3::new(0.6, 0.0, -0.8));
    /// assert!((frame.u.cross(frame.v) - frame.w).length() < 1e-6);
    /// ```
    #[inline]
    #[must_use]
    pub fn around(w: Vec3) -> Self {
        let sign = 1.0_f32.copysign(w.z);
        let a = -1.0 / (sign + w.z);
        let b = w.x * w.y * a;
        Self {
            u: Vec3::new(1.0 + sign * w.x * w.x * a, sign * b, -sign * w.x),
            v: Vec3::new(b, sign + w.y * w.y * a, -w.y),
            w,
        }
    }

    /// A frame around the unit vector `w` whose first axis points towards `along`, as far as that lies across `w`;
    /// [`Frame::around`] where it does not.
    ///
    /// ```
    /// # use fogbow::math::{Frame, Vec3};
    /// let frame = Frame::along(Vec3::Z, Vec3::new(0.0, 3.0, 4.0));
    /// assert_eq!((frame.u, frame.v), (Vec3::Y, Vec3::NEG_X));
    /// assert_eq!(Frame::along(Vec3::Z, Vec3::ZERO), Frame::around(Vec3::Z));
    /// ```
    #[inline]
    #[must_use]
    pub fn along(w: Vec3, along: Vec3) -> Self {
        if along == Vec3::ZERO {
            return Self::around(w);
        }
        match (along - w * w.dot(along)).try_normalize() {
            Some(u) => Self { u, v: w.cross(u), w },
            None => Self::around(w),
        }
    }

    /// From frame coordinates to the world.
    ///
    /// ```
    /// # use fogbow::math::{Frame, Vec3};
    /// let axis = Vec3::new(0.6, 0.0, 0.8);
    /// assert_eq!(Frame::around(axis).to_world(Vec3::Z), axis);   // the third axis
    /// ```
    #[inline]
    #[must_use]
    pub fn to_world(&self, local: Vec3) -> Vec3 {
        self.u * local.x + self.v * local.y + self.w * local.z
    }

    /// From the world to frame coordinates.
    ///
    /// ```
    /// # use fogbow::math::{Frame, Vec3};
    /// let frame = Frame::around(Vec3::new(0.6, 0.0, 0.8));
    /// let wind = Vec3::new(1.0, 2.0, 3.0);
    /// assert!((frame.to_local(wind).z - 3.0).abs() < 1e-6);   // 0.6 · 1 + 0.8 · 3
    /// assert!((frame.to_world(frame.to_local(wind)) - wind).length() < 1e-6);
    /// ```
    #[inline]
    #[must_use]
    pub fn to_local(&self, world: Vec3) -> Vec3 {
        Vec3::new(world.dot(self.u), world.dot(self.v), world.dot(self.w))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_orthonormal_and_right_handed_at_both_poles() {
        for w in [Vec3::Z, Vec3::NEG_Z, Vec3::X, Vec3::new(1e-4, -1e-4, -1.0).normalize()] {
            let f = Frame::around(w);
            assert!(f.u.dot(f.v).abs() < 1e-6 && f.u.dot(f.w).abs() < 1e-6, "{w}");
            assert!((f.u.length() - 1.0).abs() < 1e-6 && (f.v.length() - 1.0).abs() < 1e-6, "{w}");
            assert!((f.u.cross(f.v) - f.w).length() < 1e-6, "{w}");
            let p = Vec3::new(0.3, -2.0, 5.0);
            assert!((f.to_world(f.to_local(p)) - p).length() < 1e-5, "{w}");
        }
    }
}
