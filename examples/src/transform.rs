//! Affine transforms in double precision: a chain of rotations rounds once, at the end.

use fogbow::math::{Affine3, Mat3, Vec3};

/// An affine transform: three rows of a matrix whose fourth is `0 0 0 1`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transform {
    /// Rows: three factors and a translation each.
    pub rows: [[f64; 4]; 3],
}

impl Default for Transform {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl Transform {
    /// Leaves points where they are.
    pub const IDENTITY: Self = Self { rows: [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]] };

    /// From its columns: the images of the axes, and of the origin.
    #[must_use]
    pub fn from_columns(x: [f64; 3], y: [f64; 3], z: [f64; 3], origin: [f64; 3]) -> Self {
        Self { rows: [0, 1, 2].map(|i| [x[i], y[i], z[i], origin[i]]) }
    }

    /// Moves by `offset`.
    #[must_use]
    pub fn translation(offset: [f64; 3]) -> Self {
        Self::from_columns([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], offset)
    }

    /// Scales each axis.
    #[must_use]
    pub fn scaling(s: [f64; 3]) -> Self {
        Self::from_columns([s[0], 0.0, 0.0], [0.0, s[1], 0.0], [0.0, 0.0, s[2]], [0.0; 3])
    }

    /// Rotates by `degrees` around `axis`, counter-clockwise seen from its tip. `None` for an axis
    /// without length.
    #[must_use]
    pub fn rotation(axis: [f64; 3], degrees: f64) -> Option<Self> {
        Some(Self::rotation_about(normalized(axis)?, degrees))
    }

    /// The same by Rodrigues' formula alone, with the axis as it stands: one that is not of length 1 scales and shears too.
    #[must_use]
    pub fn rotation_about([x, y, z]: [f64; 3], degrees: f64) -> Self {
        let (s, c) = degrees.to_radians().sin_cos();
        let k = 1.0 - c;
        Self {
            rows: [
                [x * x * k + c, x * y * k - z * s, x * z * k + y * s, 0.0],
                [x * y * k + z * s, y * y * k + c, y * z * k - x * s, 0.0],
                [x * z * k - y * s, y * z * k + x * s, z * z * k + c, 0.0],
            ],
        }
    }

    /// Local +z looks from `origin` to `target`, local +y is up, local +x is left. `None` where
    /// both points coincide or `up` is parallel to the view.
    #[must_use]
    pub fn look_at(origin: [f64; 3], target: [f64; 3], up: [f64; 3]) -> Option<Self> {
        let forward = normalized([0, 1, 2].map(|i| target[i] - origin[i]))?;
        let side = cross(normalized(up)?, forward);
        if dot(side, side) < 1e-14 {
            return None;
        }
        let left = normalized(side)?;
        Some(Self::from_columns(left, cross(forward, left), forward, origin))
    }

    /// This transform first, then `next`.
    #[must_use]
    pub fn then(&self, next: &Self) -> Self {
        let entry = |row: &[f64; 4], column: usize| {
            let sum: f64 = (0..3).map(|k| row[k] * self.rows[k][column]).sum();
            if column == 3 { sum + row[3] } else { sum }
        };
        Self { rows: next.rows.map(|row| [0, 1, 2, 3].map(|column| entry(&row, column))) }
    }

    /// The image of a point.
    #[must_use]
    pub fn point(&self, p: [f64; 3]) -> [f64; 3] {
        self.rows.map(|r| r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + r[3])
    }

    /// The transform with its linear part transposed, without translation. That of the inverse maps normals: they stand upright on
    /// the images of their surfaces, but are not unit any more.
    #[must_use]
    pub fn transposed(&self) -> Self {
        let r = &self.rows;
        Self::from_columns(
            [r[0][0], r[0][1], r[0][2]],
            [r[1][0], r[1][1], r[1][2]],
            [r[2][0], r[2][1], r[2][2]],
            [0.0; 3],
        )
    }

    /// The image of an axis (0, 1 or 2), or of the origin (3).
    #[must_use]
    pub fn column(&self, index: usize) -> [f64; 3] {
        self.rows.map(|row| row[index])
    }

    /// Determinant of the linear part.
    #[must_use]
    pub fn determinant(&self) -> f64 {
        dot(self.column(0), cross(self.column(1), self.column(2)))
    }

    /// Whether every entry is finite, also in single precision, and the transform can be undone.
    #[must_use]
    pub fn is_regular(&self) -> bool {
        let is_small = self.rows.iter().flatten().all(|v| v.is_finite() && v.abs() < 1e18);
        let lengths: f64 = (0..3).map(|i| dot(self.column(i), self.column(i)).sqrt()).product();
        is_small && lengths > 1e-30 && self.determinant().abs() > 1e-9 * lengths
    }

    /// Whether lengths and angles stay as they are (a mirror image is allowed).
    #[must_use]
    pub fn is_rigid(&self) -> bool {
        self.is_similar() && (dot(self.column(0), self.column(0)) - 1.0).abs() < 2e-4
    }

    /// Whether angles stay as they are and all lengths change by one factor.
    #[must_use]
    pub fn is_similar(&self) -> bool {
        let square = dot(self.column(0), self.column(0));
        (0..3).all(|i| {
            (dot(self.column(i), self.column(i)) - square).abs() < 1e-4 * square
                && dot(self.column(i), self.column((i + 1) % 3)).abs() < 1e-4 * square
        })
    }

    /// The inverse; `None` for a transform that cannot be undone.
    #[must_use]
    pub fn inverse(&self) -> Option<Self> {
        if !self.is_regular() {
            return None;
        }
        let (x, y, z, o) = (self.column(0), self.column(1), self.column(2), self.column(3));
        let scale = 1.0 / self.determinant();
        let row = |a: [f64; 3]| {
            let a = a.map(|v| v * scale);
            [a[0], a[1], a[2], -dot(a, o)]
        };
        Some(Self { rows: [row(cross(y, z)), row(cross(z, x)), row(cross(x, y))] })
    }

    /// In single precision.
    #[must_use]
    pub fn to_affine(&self) -> Affine3 {
        Affine3 {
            matrix3: Mat3::from_cols(to_vec3(self.column(0)), to_vec3(self.column(1)), to_vec3(self.column(2))),
            translation: to_vec3(self.column(3)),
        }
    }
}

/// In single precision.
#[must_use]
pub fn to_vec3(v: [f64; 3]) -> Vec3 {
    Vec3::from_array(v.map(|c| c as f32))
}

/// In double precision.
#[must_use]
pub fn to_array(v: Vec3) -> [f64; 3] {
    v.to_array().map(f64::from)
}

/// Scalar product.
#[must_use]
pub fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Vector product.
#[must_use]
pub fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The unit vector along `v`; `None` for a vector without length.
#[must_use]
pub fn normalized(v: [f64; 3]) -> Option<[f64; 3]> {
    let length = dot(v, v).sqrt();
    (length.is_finite() && length > 1e-150).then(|| v.map(|c| c / length))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: [f64; 3], b: [f64; 3]) -> bool {
        (0..3).all(|i| (a[i] - b[i]).abs() < 1e-12)
    }

    #[test]
    fn what_is_written_first_acts_first() {
        let scale = Transform::scaling([2.0; 3]);
        let moved = Transform::translation([1.0, 0.0, 0.0]);
        assert!(close(scale.then(&moved).point([1.0; 3]), [3.0, 2.0, 2.0]));
        assert!(close(moved.then(&scale).point([1.0; 3]), [4.0, 2.0, 2.0]));
    }

    #[test]
    fn rotation_is_counter_clockwise() {
        let r = Transform::rotation([0.0, 1.0, 0.0], 90.0).unwrap();
        assert!(close(r.point([0.0, 0.0, 1.0]), [1.0, 0.0, 0.0]));
    }

    /// `mi.ScalarTransform4f().rotate` of Mitsuba 3.9.1.
    #[test]
    fn axes_of_other_lengths_shear_as_in_mitsuba() {
        let t = Transform::rotation_about([1.0, 1.0, 0.0], 90.0);
        assert!(close(t.column(0), [1.0, 1.0, -1.0]) && close(t.column(1), [1.0, 1.0, 1.0]));
        assert!(close(t.column(2), [1.0, -1.0, 0.0]));
        let t = Transform::rotation_about([0.0, 2.0, 0.0], 90.0);
        assert!(close(t.column(0), [0.0, 0.0, -2.0]) && close(t.column(1), [0.0, 4.0, 0.0]));
    }

    #[test]
    fn inverse_undoes() {
        let t = Transform::rotation([1.0, 2.0, 3.0], 40.0)
            .unwrap()
            .then(&Transform::scaling([1.0, 2.0, -3.0]))
            .then(&Transform::translation([4.0, 5.0, 6.0]));
        assert!(close(t.inverse().unwrap().point(t.point([0.3, -0.2, 7.0])), [0.3, -0.2, 7.0]));
        assert_eq!(Transform::scaling([1.0, 0.0, 1.0]).inverse(), None);
    }

    #[test]
    fn local_x_of_a_camera_is_left() {
        let t = Transform::look_at([0.0, 0.0, 4.0], [0.0; 3], [0.0, 1.0, 0.0]).unwrap();
        assert!(close(t.column(0), [-1.0, 0.0, 0.0]) && close(t.column(1), [0.0, 1.0, 0.0]));
        assert_eq!(Transform::look_at([0.0; 3], [0.0, 2.0, 0.0], [0.0, 1.0, 0.0]), None);
    }
}
