//! Parts of space a medium may be placed in.

use glam::{Affine3, Mat3, Vec3};

use super::MediumError;
use crate::math::{Bounds, Ray, float};

/// A part of space with faces.
///
/// ```
/// # use fogbow::{math::{Ray, Vec3}, medium::Region};
/// let ball = Region::sphere(Vec3::ZERO, 2.0).unwrap();
/// let ray = Ray::new(Vec3::new(-5.0, 0.0, 0.0), Vec3::X);
/// assert_eq!(ball.interval(&ray), Some((3.0, 7.0)));
/// assert!(ball.contains(Vec3::Y) && !ball.contains(Vec3::Y * 3.0));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Region {
    /// All of space: no faces.
    Everywhere,
    /// The image of the unit cube under an affine map.
    Box(BoxRegion),
    /// A ball.
    Sphere(SphereRegion),
}

/// A point where the line of a ray crosses the face of a region.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossing {
    /// Distance along the ray (m); negative behind its origin.
    pub distance: f32,
    /// Unit normal of the face, out of the region.
    pub normal: Vec3,
}

impl Region {
    /// The unit cube `[0, 1]³` under `local_to_world`.
    ///
    /// # Errors
    /// A map that is not finite or not invertible.
    ///
    /// ```
    /// # use fogbow::{math::{Affine3, Mat3, Vec3}, medium::Region};
    /// let flat = Affine3 { matrix3: Mat3::from_diagonal(Vec3::new(1.0, 1.0, 0.0)), translation: Vec3::ZERO };
    /// assert!(Region::unit_cube(flat).is_err());
    /// ```
    pub fn unit_cube(local_to_world: Affine3) -> Result<Self, MediumError> {
        Ok(Self::Box(BoxRegion::new(local_to_world)?))
    }

    /// An axis-aligned box. [`Bounds::EVERYTHING`] gives [`Region::Everywhere`].
    ///
    /// # Errors
    /// Bounds that are empty, flat, or infinite on some sides only.
    ///
    /// ```
    /// # use fogbow::{math::{Bounds, Vec3}, medium::Region};
    /// let room = Region::bounds(Bounds { min: Vec3::ZERO, max: Vec3::ONE })?;
    /// assert!(room.contains(Vec3::ONE) && !room.contains(Vec3::new(1.1, 0.5, 0.5)));
    /// assert_eq!(Region::bounds(Bounds::EVERYTHING), Ok(Region::Everywhere));
    /// # Ok::<(), fogbow::medium::MediumError>(())
    /// ```
    pub fn bounds(bounds: Bounds) -> Result<Self, MediumError> {
        if bounds == Bounds::EVERYTHING {
            return Ok(Self::Everywhere);
        }
        if bounds.min.cmpge(bounds.max).any() {
            return Err(MediumError::Placement);
        }
        Self::unit_cube(Affine3 { matrix3: Mat3::from_diagonal(bounds.size()), translation: bounds.min })
    }

    /// The ball around `centre` of `radius` (m).
    ///
    /// # Errors
    /// A centre that is not finite, a radius that is not positive and finite.
    pub fn sphere(centre: Vec3, radius: f32) -> Result<Self, MediumError> {
        if !(centre.is_finite() && radius.is_normal() && radius > 0.0 && (1.0 / radius).is_normal()) {
            return Err(MediumError::Placement);
        }
        Ok(Self::Sphere(SphereRegion { centre, radius, inverse_radius: 1.0 / radius }))
    }

    /// Whether `point` lies inside or on a face.
    #[inline]
    #[must_use]
    pub fn contains(&self, point: Vec3) -> bool {
        match self {
            Self::Everywhere => true,
            Self::Box(cube) => cube.contains(point),
            Self::Sphere(sphere) => sphere.contains(point),
        }
    }

    /// Whether all of a ball lies inside.
    pub(super) fn contains_ball(&self, centre: Vec3, radius: f32) -> bool {
        match self {
            Self::Everywhere => true,
            Self::Box(cube) => {
                let (p, extent) = cube.local_ball(centre, radius);
                (p - extent).cmpge(Vec3::ZERO).all() && (p + extent).cmple(Vec3::ONE).all()
            }
            Self::Sphere(sphere) => (centre - sphere.centre).length() + radius <= sphere.radius,
        }
    }

    /// Whether all of a ball certainly lies outside.
    pub(super) fn is_clear_of_ball(&self, centre: Vec3, radius: f32) -> bool {
        match self {
            Self::Everywhere => false,
            Self::Box(cube) => {
                let (p, extent) = cube.local_ball(centre, radius);
                (p + extent).cmplt(Vec3::ZERO).any() || (p - extent).cmpgt(Vec3::ONE).any()
            }
            Self::Sphere(sphere) => (centre - sphere.centre).length() > radius + sphere.radius,
        }
    }

    /// Distances (m) at which the infinite line of `ray` enters and leaves; `None` if it misses.
    ///
    /// The entry lies below the exit. Both are negative where the region lies behind the origin;
    /// infinite for [`Region::Everywhere`].
    #[inline]
    #[must_use]
    pub fn interval(&self, ray: &Ray) -> Option<(f32, f32)> {
        match self {
            Self::Everywhere => Some((f32::NEG_INFINITY, f32::INFINITY)),
            Self::Box(cube) => cube.interval(ray),
            Self::Sphere(sphere) => sphere.interval(ray),
        }
    }

    /// Where the infinite line of `ray` enters and leaves, with the faces' normals; `None` if it
    /// misses or there is no face.
    ///
    /// ```
    /// # use fogbow::{math::{Ray, Vec3}, medium::Region};
    /// let ball = Region::sphere(Vec3::ZERO, 2.0)?;
    /// let [enter, leave] = ball.crossings(&Ray::new(-5.0 * Vec3::X, Vec3::X)).unwrap();
    /// assert_eq!((enter.distance, enter.normal), (3.0, Vec3::NEG_X));
    /// assert_eq!((leave.distance, leave.normal), (7.0, Vec3::X));   // normals point out of the region
    /// # Ok::<(), fogbow::medium::MediumError>(())
    /// ```
    #[must_use]
    pub fn crossings(&self, ray: &Ray) -> Option<[Crossing; 2]> {
        match self {
            Self::Everywhere => None,
            Self::Box(cube) => cube.crossings(ray),
            Self::Sphere(sphere) => {
                let (entry, exit) = sphere.interval(ray)?;
                Some([entry, exit].map(|distance| {
                    let offset = (ray.at(distance) - sphere.centre) * sphere.inverse_radius;
                    Crossing { distance, normal: offset.normalize_or(-ray.direction) }
                }))
            }
        }
    }
}

/// The image of the unit cube under an affine map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoxRegion {
    local_from_world: Affine3,
}

impl BoxRegion {
    /// See [`Region::unit_cube`].
    pub(super) fn new(local_to_world: Affine3) -> Result<Self, MediumError> {
        Ok(Self { local_from_world: inverse(local_to_world).ok_or(MediumError::Placement)? })
    }

    /// From the world to the unit cube.
    ///
    /// ```
    /// # use fogbow::{math::{Affine3, Mat3, Vec3}, medium::Region};
    /// let place = Affine3 { matrix3: Mat3::from_diagonal(Vec3::splat(2.0)), translation: Vec3::X };
    /// let Region::Box(cube) = Region::unit_cube(place)? else { unreachable!() };
    /// assert_eq!(cube.local_from_world().transform_point3(Vec3::new(3.0, 0.0, 0.0)), Vec3::X);   // its corner
    /// # Ok::<(), fogbow::medium::MediumError>(())
    /// ```
    #[inline]
    #[must_use]
    pub fn local_from_world(&self) -> Affine3 {
        self.local_from_world
    }

    #[inline]
    pub(super) fn contains(&self, point: Vec3) -> bool {
        let p = self.local_from_world.transform_point3(point);
        p.cmpge(Vec3::ZERO).all() && p.cmple(Vec3::ONE).all()
    }

    /// Centre and half extents, in the unit cube's coordinates, of a ball.
    fn local_ball(&self, centre: Vec3, radius: f32) -> (Vec3, Vec3) {
        let m = &self.local_from_world.matrix3;
        let extent = Vec3::new(m.row(0).length(), m.row(1).length(), m.row(2).length()) * radius;
        (self.local_from_world.transform_point3(centre), extent)
    }

    #[inline]
    fn interval(&self, ray: &Ray) -> Option<(f32, f32)> {
        LocalLine::new(&self.local_from_world, ray).slabs(Vec3::ONE).interval()
    }

    pub(super) fn crossings(&self, ray: &Ray) -> Option<[Crossing; 2]> {
        let line = LocalLine::new(&self.local_from_world, ray);
        let slabs = line.slabs(Vec3::ONE);
        let (entry, exit) = slabs.interval()?;
        let crossing = |distances: Vec3, distance: f32, sign: f32| {
            let axis = (0..3).find(|&i| distances[i] == distance).unwrap_or(0);
            // The gradient of a local coordinate in the world is a row of the inverse map.
            let row = self.local_from_world.matrix3.row(axis);
            // Scaled before the square root, so that neither tiny nor huge boxes lose it.
            let normal = (row / row.abs().max_element()).normalize_or(ray.direction);
            Crossing { distance, normal: normal * sign.copysign(sign * line.direction[axis]) }
        };
        Some([crossing(slabs.near, entry, -1.0), crossing(slabs.far, exit, 1.0)])
    }
}

/// A ball.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SphereRegion {
    centre: Vec3,
    radius: f32,
    inverse_radius: f32,
}

impl SphereRegion {
    #[inline]
    fn contains(&self, point: Vec3) -> bool {
        ((point - self.centre) * self.inverse_radius).length_squared() <= 1.0
    }

    #[inline]
    fn interval(&self, ray: &Ray) -> Option<(f32, f32)> {
        let offset = (ray.origin - self.centre) * self.inverse_radius;
        let along = offset.dot(ray.direction);
        // From the point of the line nearest to the centre: |offset|² − along² would cancel.
        let nearest = offset - ray.direction * along;
        let half = float::safe_sqrt(1.0 - nearest.length_squared());
        let (entry, exit) = ((-along - half) * self.radius, (-along + half) * self.radius);
        (entry < exit).then_some((entry, exit))
    }
}

/// A ray in local coordinates, with reciprocals that are never infinite.
#[derive(Debug, Clone, Copy)]
pub(super) struct LocalLine {
    pub(super) origin: Vec3,
    pub(super) direction: Vec3,
    pub(super) inverse: Vec3,
}

impl LocalLine {
    #[inline(always)]
    pub(super) fn new(local_from_world: &Affine3, ray: &Ray) -> Self {
        let origin = local_from_world.transform_point3(ray.origin);
        let direction = local_from_world.matrix3 * ray.direction;
        // A component of zero makes 0·∞ = NaN for a ray in a face; a speed this small crosses
        // nothing within any distance an f32 scene has.
        const STILL: f32 = 1e-25;
        let tame = |d: f32| if d.abs() < STILL { STILL } else { d };
        let direction = Vec3::new(tame(direction.x), tame(direction.y), tame(direction.z));
        Self { origin, direction, inverse: direction.recip() }
    }

    /// Distances at which each pair of faces of the box `[0, size]` is crossed.
    #[inline]
    pub(super) fn slabs(&self, size: Vec3) -> Slabs {
        let (a, b) = (-self.origin * self.inverse, (size - self.origin) * self.inverse);
        let near = Vec3::new(float::min(a.x, b.x), float::min(a.y, b.y), float::min(a.z, b.z));
        let far = Vec3::new(float::max(a.x, b.x), float::max(a.y, b.y), float::max(a.z, b.z));
        Slabs { near, far }
    }
}

/// Distances at which a line crosses three pairs of parallel planes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slabs {
    near: Vec3,
    far: Vec3,
}

impl Slabs {
    #[inline]
    pub(super) fn interval(&self) -> Option<(f32, f32)> {
        let near = float::max(float::max(self.near.x, self.near.y), self.near.z);
        let far = float::min(float::min(self.far.x, self.far.y), self.far.z);
        (near < far).then_some((near, far))
    }
}

/// The inverse of a finite, invertible map, by cofactors in `f64`.
pub(super) fn inverse(map: Affine3) -> Option<Affine3> {
    let m = map.matrix3.to_cols_array().map(f64::from);
    let at = |row: usize, column: usize| m[column * 3 + row];
    let cofactor = |row: usize, column: usize| {
        let (r1, r2, c1, c2) = ((row + 1) % 3, (row + 2) % 3, (column + 1) % 3, (column + 2) % 3);
        at(r1, c1) * at(r2, c2) - at(r1, c2) * at(r2, c1)
    };
    let determinant = (0..3).map(|column| at(0, column) * cofactor(0, column)).sum::<f64>();
    // Beside what the columns could span, the determinant of a singular map is rounding.
    let span = (0..3).map(|c| (0..3).map(|r| at(r, c).abs()).sum::<f64>()).product::<f64>();
    if !(determinant.abs() > 1e-9 * span && determinant.is_finite() && map.translation.is_finite()) {
        return None;
    }
    // Adjugate: transposed cofactors.
    let entry = |row: usize, column: usize| cofactor(column, row) / determinant;
    let t = map.translation.to_array().map(f64::from);
    let offset = |row: usize| -(0..3).map(|c| entry(row, c) * t[c]).sum::<f64>();
    let column = |c: usize| Vec3::new(entry(0, c) as f32, entry(1, c) as f32, entry(2, c) as f32);
    let inverse = Affine3 {
        matrix3: Mat3::from_cols(column(0), column(1), column(2)),
        translation: Vec3::new(offset(0) as f32, offset(1) as f32, offset(2) as f32),
    };
    inverse.is_finite().then_some(inverse)
}
