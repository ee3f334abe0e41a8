//! Vectors, boxes and maps as arrays: for hosts with vectors of their own, or of another glam.
//!
//! `[f32; 3]` and [`Vec3`] turn into each other by `into()`, and so do `[f32; 3]` and [`Spectrum`](crate::spectrum::Spectrum),
//! `[[f32; 3]; 2]` and
//! [`Bounds`]. For maps, rows or columns are in the name:
//!
//! ```
//! use fogbow::math::{Bounds, Ray, Vec3, affine_from_columns};
//! let (eye, forward) = ([0.0, 1.0, 5.0], [0.0, 0.0, -1.0]);
//! let ray = Ray::new(eye.into(), forward.into());
//! assert_eq!(<[f32; 3]>::from(ray.at(2.0)), [0.0, 1.0, 3.0]);
//! let bounds = Bounds::from([[-1.0; 3], [1.0; 3]]);
//! assert_eq!(bounds.size(), Vec3::splat(2.0));
//! ```
//!
//! What engines with glam inside have, and how to cross:
//!
//! | Bevy | glam | how to cross |
//! |---|---|---|
//! | 0.16 | 0.29 | `a.to_array().into()`, `Vec3::from_array(b.into())`; maps by [`affine_from_columns`] of `to_cols_array` |
//! | 0.17 | 0.30 | the same |
//! | 0.18 | 0.30 | the same |
//! | 0.19 | 0.32 | the same |
//! | 0.20 | 0.33 | nothing to cross, after `cargo update -p glam@0.34.3 --precise 0.33.12`: this crate takes 0.33.11 to 0.34 |
//!
//! `tests/bevy` compiles and runs this with the last three.

use glam::{Affine3, Mat3, Vec3};

use super::Bounds;

impl From<[[f32; 3]; 2]> for Bounds {
    /// From its least and its greatest corner.
    #[inline]
    fn from([min, max]: [[f32; 3]; 2]) -> Self {
        Self { min: Vec3::from_array(min), max: Vec3::from_array(max) }
    }
}

impl From<Bounds> for [[f32; 3]; 2] {
    #[inline]
    fn from(bounds: Bounds) -> Self {
        [bounds.min.to_array(), bounds.max.to_array()]
    }
}

/// The map of a 4 × 4 matrix, row after row: numbers 3, 7 and 11 are the translation. `None` if its last row is not `0 0 0 1`, as
/// that of a projection.
///
/// ```
/// # use fogbow::math::{Vec3, affine_from_rows, affine_to_rows};
/// let rows = [2.0, 0.0, 0.0, 5.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
/// let map = affine_from_rows(&rows).unwrap();
/// assert_eq!(map.transform_point3(Vec3::X), 7.0 * Vec3::X);   // twice as far, and five metres on
/// assert_eq!(affine_to_rows(&map), rows);
/// ```
#[must_use]
pub fn affine_from_rows(rows: &[f32; 16]) -> Option<Affine3> {
    affine_from_columns(&transposed(rows))
}

/// The map of a 4 × 4 matrix, column after column, as glam and OpenGL have it: numbers 12, 13 and 14 are the translation. `None` as
/// [`affine_from_rows`].
///
/// ```
/// # use fogbow::math::{Vec3, affine_from_columns, affine_to_columns};
/// let columns = [2.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 5.0, 0.0, 0.0, 1.0];
/// let map = affine_from_columns(&columns).unwrap();
/// assert_eq!(map.transform_point3(Vec3::X), 7.0 * Vec3::X);
/// assert_eq!(affine_to_columns(&map), columns);
/// let projection = [1.0; 16];
/// assert!(affine_from_columns(&projection).is_none());
/// ```
#[must_use]
pub fn affine_from_columns(columns: &[f32; 16]) -> Option<Affine3> {
    let column = |c: usize| Vec3::new(columns[4 * c], columns[4 * c + 1], columns[4 * c + 2]);
    let last = [columns[3], columns[7], columns[11], columns[15]];
    let map = Affine3 { matrix3: Mat3::from_cols(column(0), column(1), column(2)), translation: column(3) };
    (last == [0.0, 0.0, 0.0, 1.0]).then_some(map)
}

/// The 4 × 4 matrix of a map, row after row: see [`affine_from_rows`].
///
/// ```
/// # use fogbow::math::{Affine3, Vec3, affine_to_rows};
/// let moved = Affine3::from_translation(Vec3::new(1.0, 2.0, 3.0));
/// assert_eq!(affine_to_rows(&moved)[..8], [1.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 2.0]);
/// ```
#[must_use]
pub fn affine_to_rows(map: &Affine3) -> [f32; 16] {
    transposed(&affine_to_columns(map))
}

/// The 4 × 4 matrix of a map, column after column: see [`affine_from_columns`].
///
/// ```
/// # use fogbow::math::{Affine3, Vec3, affine_to_columns};
/// let moved = Affine3::from_translation(Vec3::new(1.0, 2.0, 3.0));
/// assert_eq!(affine_to_columns(&moved)[12..], [1.0, 2.0, 3.0, 1.0]);
/// ```
#[must_use]
pub fn affine_to_columns(map: &Affine3) -> [f32; 16] {
    let Affine3 { matrix3: m, translation: t } = map;
    let (x, y, z) = (m.x_axis, m.y_axis, m.z_axis);
    [x.x, x.y, x.z, 0.0, y.x, y.y, y.z, 0.0, z.x, z.y, z.z, 0.0, t.x, t.y, t.z, 1.0]
}

fn transposed(numbers: &[f32; 16]) -> [f32; 16] {
    core::array::from_fn(|i| numbers[4 * (i % 4) + i / 4])
}
