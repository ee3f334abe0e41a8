//! Flat pieces, spheres and boxes, four at a time.

use fogbow::glam::Vec4;
use fogbow::math::{Bounds, Ray, Symmetric3, Vec3};

/// How many primitives are tested at once: baseline x86-64 has registers of four.
const LANES: usize = 4;

/// By how much the unit square of a flat piece is enlarged, so that no ray slips between two that
/// share an edge: rounding moves a hit point by a few 10⁻⁷ of the piece. Invisible at 4 × 10⁻⁶.
const EDGE: f32 = 1.0 + 4e-6;

/// An analytic primitive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Primitive {
    /// A parallelogram, or an ellipse: points `p` with `normal·p = offset` whose coordinates
    /// `u·p + u0` and `v·p + v0` lie in the unit square (sides from −1 to 1) or disc.
    Flat {
        /// Unit normal.
        normal: Vec3,
        /// Signed distance of the plane from the origin (m).
        offset: f32,
        /// Gradient of the first coordinate, and its value at the origin.
        u: (Vec3, f32),
        /// The second.
        v: (Vec3, f32),
        /// Whether it is the disc.
        is_disc: bool,
    },
    /// A sphere.
    Sphere {
        /// Centre (m).
        centre: Vec3,
        /// Radius (m).
        radius: f32,
    },
    /// A parallelepiped: points whose three coordinates `rows[i].0·p + rows[i].1` lie in [−1, 1].
    Box {
        /// Gradients of the coordinates, and values at the origin.
        rows: [(Vec3, f32); 3],
    },
    /// An open cylinder: points whose coordinates, as of a box, have `x² + y² = 1` and `0 ≤ z ≤ 1`.
    Cylinder {
        /// Gradients of the coordinates, and values at the origin.
        rows: [(Vec3, f32); 3],
    },
}

impl Primitive {
    /// The outward normal (unit) at a point of the surface; any, where rounding of the point leaves none, as far away.
    #[inline]
    pub(super) fn normal(&self, point: Vec3) -> Vec3 {
        let outward = match self {
            Self::Flat { normal, .. } => return *normal,
            Self::Sphere { centre, radius } => (point - centre) / *radius,
            Self::Box { rows } => {
                // Of the three coordinates, the one nearest to ±1 tells the face.
                let (mut largest, mut outward) = (0.0_f32, Vec3::Z);
                for (gradient, start) in rows {
                    let coordinate = gradient.dot(point) + start;
                    if coordinate.abs() > largest {
                        (largest, outward) = (coordinate.abs(), *gradient * coordinate.signum());
                    }
                }
                outward
            }
            Self::Cylinder { rows: [x, y, _] } => (x.0 * (x.0.dot(point) + x.1)) + (y.0 * (y.0.dot(point) + y.1)),
        };
        outward.normalize_or(Vec3::Z)
    }

    /// The shape operator (m⁻¹) of a sphere, if `point` lies on it and `normal` is its normal there on either side.
    pub(super) fn curvature(&self, point: Vec3, normal: Vec3) -> Option<Symmetric3> {
        let Self::Sphere { centre, radius } = self else { return None };
        let outward = (point - centre) / *radius;
        let is_there = (outward.length_squared() - 1.0).abs() < 1e-3 && outward.dot(normal).abs() > 0.999;
        is_there.then(|| {
            let n = normal;
            let k = outward.dot(normal).signum() / radius;
            let flat = [1.0 - n.x * n.x, -n.x * n.y, -n.x * n.z, 1.0 - n.y * n.y, -n.y * n.z, 1.0 - n.z * n.z];
            Symmetric3::from_upper(flat).times(k)
        })
    }

    /// Distance to the nearest hit within `(0, length)`, or infinity.
    pub(super) fn distance(&self, ray: &Ray, length: f32) -> f32 {
        // One lane of four carries the primitive: what is measured alone is what is measured in
        // company.
        match self {
            Self::Flat { .. } => FlatChunk::of(core::slice::from_ref(self)).distances(ray, Vec4::splat(length))[0],
            Self::Sphere { .. } => SphereChunk::of(core::slice::from_ref(self)).distances(ray, Vec4::splat(length))[0],
            Self::Box { .. } => BoxChunk::of(core::slice::from_ref(self)).distances(ray, Vec4::splat(length))[0],
            Self::Cylinder { .. } => {
                CylinderChunk::of(core::slice::from_ref(self)).distances(ray, Vec4::splat(length))[0]
            }
        }
    }

    fn rank(&self) -> u8 {
        match self {
            Self::Flat { is_disc: false, .. } => 0,
            Self::Flat { is_disc: true, .. } => 1,
            Self::Sphere { .. } => 2,
            Self::Box { .. } => 3,
            Self::Cylinder { .. } => 4,
        }
    }
}

/// `distances` where `is_hit`, infinity elsewhere.
macro_rules! only_where {
    ($is_hit:expr, $distances:expr) => {
        Vec4::select($is_hit, $distances, Vec4::INFINITY)
    };
}

/// `x·a + y·b + z·c` in four lanes, for a vector that is the same in all.
#[inline(always)]
fn dot([a, b, c]: &[Vec4; 3], v: Vec3) -> Vec4 {
    *a * v.x + *b * v.y + *c * v.z
}

/// Up to four flat pieces.
#[derive(Debug, Clone, Copy, Default)]
struct FlatChunk {
    normal: [Vec4; 3],
    offset: Vec4,
    u: ([Vec4; 3], Vec4),
    v: ([Vec4; 3], Vec4),
    is_disc: bool,
}

impl FlatChunk {
    fn of(primitives: &[Primitive]) -> Self {
        // Unused lanes stay 0, which makes the distance 0/0: no comparison holds.
        let mut chunk = Self::default();
        for (lane, primitive) in primitives.iter().take(LANES).enumerate() {
            let Primitive::Flat { normal, offset, u, v, is_disc } = primitive else { continue };
            for axis in 0..3 {
                chunk.normal[axis][lane] = normal[axis];
                chunk.u.0[axis][lane] = u.0[axis];
                chunk.v.0[axis][lane] = v.0[axis];
            }
            chunk.offset[lane] = *offset;
            chunk.u.1[lane] = u.1;
            chunk.v.1[lane] = v.1;
            chunk.is_disc = *is_disc;
        }
        chunk
    }

    #[inline(always)]
    fn distances(&self, ray: &Ray, limit: Vec4) -> Vec4 {
        let (o, d) = (ray.origin, ray.direction);
        let t = (self.offset - dot(&self.normal, o)) / dot(&self.normal, d);
        let point = [t * d.x + o.x, t * d.y + o.y, t * d.z + o.z];
        let coordinate = |(gradient, start): &([Vec4; 3], Vec4)| {
            gradient[0] * point[0] + gradient[1] * point[1] + gradient[2] * point[2] + *start
        };
        let (u, v) = (coordinate(&self.u), coordinate(&self.v));
        let reach = if self.is_disc { u * u + v * v } else { u.abs().max(v.abs()) };
        only_where!(reach.cmple(Vec4::splat(EDGE)) & t.cmpgt(Vec4::ZERO) & t.cmplt(limit), t)
    }
}

/// Up to four spheres.
#[derive(Debug, Clone, Copy)]
struct SphereChunk {
    centre: [Vec4; 3],
    radius2: Vec4,
}

impl SphereChunk {
    fn of(primitives: &[Primitive]) -> Self {
        // A negative squared radius cannot be hit.
        let mut chunk = Self { centre: [Vec4::ZERO; 3], radius2: Vec4::NEG_ONE };
        for (lane, primitive) in primitives.iter().take(LANES).enumerate() {
            let Primitive::Sphere { centre, radius } = primitive else { continue };
            for axis in 0..3 {
                chunk.centre[axis][lane] = centre[axis];
            }
            chunk.radius2[lane] = radius * radius;
        }
        chunk
    }

    /// The stable form: the discriminant from the perpendicular offset, the smaller root from the
    /// product of both (Haines et al. 2019, "Precision Improvements for Ray/Sphere Intersection").
    #[inline(always)]
    fn distances(&self, ray: &Ray, limit: Vec4) -> Vec4 {
        let (o, d) = (ray.origin, ray.direction);
        let f = [o.x - self.centre[0], o.y - self.centre[1], o.z - self.centre[2]];
        let b = -dot(&f, d);
        let p = [f[0] + b * d.x, f[1] + b * d.y, f[2] + b * d.z];
        let discriminant = self.radius2 - (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
        let is_met = discriminant.cmpge(Vec4::ZERO);
        if !is_met.any() {
            return Vec4::INFINITY;
        }
        let clamped = discriminant.max(Vec4::ZERO).to_array();
        let root = Vec4::from_array(clamped.map(f32::sqrt));
        let q = b + root.copysign(b);
        let other = (f[0] * f[0] + f[1] * f[1] + f[2] * f[2] - self.radius2) / q;
        let (near, far) = (other.min(q), other.max(q));
        let t = Vec4::select(near.cmpgt(Vec4::ZERO), near, far);
        only_where!(is_met & t.cmpgt(Vec4::ZERO) & t.cmplt(limit), t)
    }
}

/// Local coordinates of up to four boxes or cylinders: gradients and offsets.
type LanesOfRows = [([Vec4; 3], Vec4); 3];

fn lanes_of_rows(primitives: &[Primitive]) -> LanesOfRows {
    // Unused lanes: every point has the coordinates (2, 2, 2).
    let mut lanes = [([Vec4::ZERO; 3], Vec4::splat(2.0)); 3];
    for (lane, primitive) in primitives.iter().take(LANES).enumerate() {
        let (Primitive::Box { rows } | Primitive::Cylinder { rows }) = primitive else { continue };
        for ((slot, offset), (gradient, start)) in lanes.iter_mut().zip(rows) {
            for axis in 0..3 {
                slot[axis][lane] = gradient[axis];
            }
            offset[lane] = *start;
        }
    }
    lanes
}

/// Up to four boxes.
#[derive(Debug, Clone, Copy)]
struct BoxChunk {
    rows: LanesOfRows,
}

impl BoxChunk {
    fn of(primitives: &[Primitive]) -> Self {
        Self { rows: lanes_of_rows(primitives) }
    }

    #[inline(always)]
    fn distances(&self, ray: &Ray, limit: Vec4) -> Vec4 {
        let (mut near, mut far) = (Vec4::NEG_INFINITY, Vec4::INFINITY);
        for (gradient, start) in &self.rows {
            let origin = dot(gradient, ray.origin) + *start;
            let inverse = 1.0 / dot(gradient, ray.direction);
            let (a, b) = ((-1.0 - origin) * inverse, (1.0 - origin) * inverse);
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        let t = Vec4::select(near.cmpgt(Vec4::ZERO), near, far);
        only_where!(near.cmple(far) & t.cmpgt(Vec4::ZERO) & t.cmplt(limit), t)
    }
}

/// Up to four cylinders.
#[derive(Debug, Clone, Copy)]
struct CylinderChunk {
    rows: LanesOfRows,
}

impl CylinderChunk {
    fn of(primitives: &[Primitive]) -> Self {
        Self { rows: lanes_of_rows(primitives) }
    }

    #[inline(always)]
    fn distances(&self, ray: &Ray, limit: Vec4) -> Vec4 {
        let local =
            |(gradient, start): &([Vec4; 3], Vec4)| (dot(gradient, ray.origin) + *start, dot(gradient, ray.direction));
        let [(ox, dx), (oy, dy), (oz, dz)] = [local(&self.rows[0]), local(&self.rows[1]), local(&self.rows[2])];
        // As for spheres: the discriminant from the distance to the axis.
        let a = dx * dx + dy * dy;
        let b = -(ox * dx + oy * dy);
        let (px, py) = (ox + dx * (b / a), oy + dy * (b / a));
        let discriminant = a * (1.0 - (px * px + py * py));
        let is_met = discriminant.cmpge(Vec4::ZERO);
        if !is_met.any() {
            return Vec4::INFINITY;
        }
        let root = Vec4::from_array(discriminant.max(Vec4::ZERO).to_array().map(f32::sqrt));
        let q = b + root.copysign(b);
        let (s, t) = ((ox * ox + oy * oy - 1.0) / q, q / a);
        let (near, far) = (s.min(t), s.max(t));
        let is_on = |t: Vec4| {
            let z = oz + dz * t;
            t.cmpgt(Vec4::ZERO) & z.cmpge(Vec4::ZERO) & z.cmple(Vec4::ONE) & t.cmplt(limit)
        };
        let t = Vec4::select(is_on(near), near, far);
        only_where!(is_met & is_on(t), t)
    }
}

/// A short list of primitives, all of which are tested.
#[derive(Debug, Clone, Default)]
pub(super) struct Few {
    flats: Vec<FlatChunk>,
    spheres: Vec<SphereChunk>,
    boxes: Vec<BoxChunk>,
    cylinders: Vec<CylinderChunk>,
    /// For each lane of all chunks in turn: which primitive it is.
    order: Vec<u32>,
}

impl Few {
    pub(super) fn new(primitives: &[Primitive]) -> Self {
        let mut few = Self::default();
        for rank in 0..5 {
            let chosen: Vec<(u32, Primitive)> =
                (0_u32..).zip(primitives.iter().copied()).filter(|(_, p)| p.rank() == rank).collect();
            for group in chosen.chunks(LANES) {
                let members: Vec<Primitive> = group.iter().map(|(_, p)| *p).collect();
                match rank {
                    0 | 1 => few.flats.push(FlatChunk::of(&members)),
                    2 => few.spheres.push(SphereChunk::of(&members)),
                    3 => few.boxes.push(BoxChunk::of(&members)),
                    _ => few.cylinders.push(CylinderChunk::of(&members)),
                }
                let mut order: Vec<u32> = group.iter().map(|(index, _)| *index).collect();
                order.resize(LANES, u32::MAX);
                few.order.append(&mut order);
            }
        }
        few
    }

    /// The nearest hit within `(0, length)`: distance and number of the primitive.
    #[inline]
    pub(super) fn closest(&self, ray: &Ray, length: f32) -> Option<(f32, u32)> {
        let mut best = Vec4::splat(length);
        // Numbers of chunks as floats, so that they can be selected like distances.
        let (mut chunk_of, mut number) = (Vec4::NEG_ONE, Vec4::ZERO);
        let mut take = |distances: Vec4, best: &mut Vec4| {
            let is_nearer = distances.cmplt(*best);
            *best = best.min(distances);
            chunk_of = Vec4::select(is_nearer, number, chunk_of);
            number += 1.0;
        };
        for chunk in &self.flats {
            take(chunk.distances(ray, best), &mut best);
        }
        for chunk in &self.spheres {
            take(chunk.distances(ray, best), &mut best);
        }
        for chunk in &self.boxes {
            take(chunk.distances(ray, best), &mut best);
        }
        for chunk in &self.cylinders {
            take(chunk.distances(ray, best), &mut best);
        }
        let nearest = best.min_element();
        if nearest >= length {
            return None;
        }
        let lane = best.cmpeq(Vec4::splat(nearest)).bitmask().trailing_zeros() as usize;
        let index = self.order.get(chunk_of[lane.min(LANES - 1)] as usize * LANES + lane)?;
        Some((nearest, *index))
    }

    /// Whether anything is hit within `(0, length)`.
    #[inline]
    pub(super) fn is_hit(&self, ray: &Ray, length: f32) -> bool {
        let limit = Vec4::splat(length);
        let is_any = |distances: Vec4| distances.cmplt(Vec4::INFINITY).any();
        self.boxes.iter().any(|c| is_any(c.distances(ray, limit)))
            || self.flats.iter().any(|c| is_any(c.distances(ray, limit)))
            || self.spheres.iter().any(|c| is_any(c.distances(ray, limit)))
            || self.cylinders.iter().any(|c| is_any(c.distances(ray, limit)))
    }
}

/// The smallest box around a primitive, given its corners or centre.
pub(super) fn bounds(primitive: &Primitive) -> Bounds {
    match primitive {
        Primitive::Sphere { centre, radius } => {
            Bounds { min: *centre - Vec3::splat(*radius), max: *centre + Vec3::splat(*radius) }
        }
        Primitive::Flat { normal, offset, u, v, .. } => {
            // The point with coordinates (u, v) in the plane: solve three linear equations.
            let matrix = fogbow::math::Mat3::from_cols(u.0, v.0, *normal).transpose().inverse();
            let corner = |a: f32, b: f32| matrix * Vec3::new(a - u.1, b - v.1, *offset);
            Bounds::of([corner(-1.0, -1.0), corner(1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0)])
        }
        Primitive::Box { rows } | Primitive::Cylinder { rows } => {
            // Of a cylinder, the lower end lies in the middle of the box.
            let bottom = if matches!(primitive, Primitive::Cylinder { .. }) { 0.0 } else { -1.0 };
            let matrix = fogbow::math::Mat3::from_cols(rows[0].0, rows[1].0, rows[2].0).transpose().inverse();
            let start = Vec3::new(rows[0].1, rows[1].1, rows[2].1);
            let corner = |i: u32| {
                let sign = |bit: u32, low: f32| if i & bit == 0 { low } else { 1.0 };
                matrix * (Vec3::new(sign(1, -1.0), sign(2, -1.0), sign(4, bottom)) - start)
            };
            Bounds::of((0..8).map(corner))
        }
    }
}
