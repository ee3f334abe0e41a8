//! Flat pieces, spheres and boxes, eight at a time.

use fogbow::math::{Bounds, Ray, Vec3};
use wide::{CmpGe, CmpGt, CmpLe, CmpLt, f32x8};

/// One register of x86-64-v3, two of the baseline's.
type Lanes = f32x8;
const LANES: usize = 8;

/// One vector per axis: the same in every lane, or one primitive a lane.
type Lanes3 = [Lanes; 3];

#[inline(always)]
fn broadcast(v: Vec3) -> Lanes3 {
    [Lanes::splat(v.x), Lanes::splat(v.y), Lanes::splat(v.z)]
}

#[inline(always)]
fn dot(a: &Lanes3, b: &Lanes3) -> Lanes {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Distances where `is_hit`, infinity elsewhere.
#[inline(always)]
fn where_hit(is_hit: Lanes, distances: Lanes) -> Lanes {
    is_hit.blend(distances, Lanes::splat(f32::INFINITY))
}

/// Lane by lane from a table of one array a primitive.
fn gather<const N: usize>(rows: &[[f32; N]], unused: [f32; N]) -> [Lanes; N] {
    core::array::from_fn(|column| {
        Lanes::from(core::array::from_fn(|lane| rows.get(lane).map_or(unused[column], |row| row[column])))
    })
}

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
}

impl Primitive {
    /// The outward normal (unit) at a point of the surface.
    pub(super) fn normal(&self, point: Vec3) -> Vec3 {
        match self {
            Self::Flat { normal, .. } => *normal,
            Self::Sphere { centre, radius } => ((point - centre) / *radius).normalize(),
            Self::Box { rows } => {
                // Of the three coordinates, the one nearest to ±1 tells the face.
                let (mut largest, mut outward) = (0.0_f32, Vec3::Z);
                for (gradient, start) in rows {
                    let coordinate = gradient.dot(point) + start;
                    if coordinate.abs() > largest {
                        (largest, outward) = (coordinate.abs(), *gradient * coordinate.signum());
                    }
                }
                outward.normalize()
            }
        }
    }

    /// Distance to the nearest hit within `(0, length)`, or infinity.
    pub(super) fn distance(&self, ray: &Ray, length: f32) -> f32 {
        // One lane of eight carries the primitive: what is measured alone is what is measured in
        // company.
        match self {
            Self::Flat { .. } => {
                FlatChunk::of(core::slice::from_ref(self)).distances(ray, Lanes::splat(length)).to_array()[0]
            }
            Self::Sphere { .. } => {
                SphereChunk::of(core::slice::from_ref(self)).distances(ray, Lanes::splat(length)).to_array()[0]
            }
            Self::Box { .. } => {
                BoxChunk::of(core::slice::from_ref(self)).distances(ray, Lanes::splat(length)).to_array()[0]
            }
        }
    }

    fn rank(&self) -> u8 {
        match self {
            Self::Flat { is_disc: false, .. } => 0,
            Self::Flat { is_disc: true, .. } => 1,
            Self::Sphere { .. } => 2,
            Self::Box { .. } => 3,
        }
    }
}

/// Up to eight flat pieces.
#[derive(Debug, Clone, Copy)]
struct FlatChunk {
    /// Normal and offset.
    plane: [Lanes; 4],
    u: [Lanes; 4],
    v: [Lanes; 4],
    is_disc: bool,
}

impl FlatChunk {
    fn of(primitives: &[Primitive]) -> Self {
        let (mut planes, mut us, mut vs) = (Vec::new(), Vec::new(), Vec::new());
        let mut is_any_disc = false;
        for primitive in primitives {
            let Primitive::Flat { normal, offset, u, v, is_disc } = primitive else { continue };
            let row = |a: Vec3, b: f32| [a.x, a.y, a.z, b];
            planes.push(row(*normal, *offset));
            us.push(row(u.0, u.1));
            vs.push(row(v.0, v.1));
            is_any_disc |= *is_disc;
        }
        // Unused lanes stay 0, which makes the distance 0/0: no comparison holds.
        let unused = [0.0; 4];
        Self { plane: gather(&planes, unused), u: gather(&us, unused), v: gather(&vs, unused), is_disc: is_any_disc }
    }

    #[inline(always)]
    fn distances(&self, ray: &Ray, limit: Lanes) -> Lanes {
        let (o, d) = (broadcast(ray.origin), broadcast(ray.direction));
        let [nx, ny, nz, offset] = self.plane;
        let normal = [nx, ny, nz];
        let t = (offset - dot(&normal, &o)) / dot(&normal, &d);
        let p = [o[0] + t * d[0], o[1] + t * d[1], o[2] + t * d[2]];
        let along = |[x, y, z, start]: [Lanes; 4]| dot(&[x, y, z], &p) + start;
        let (u, v) = (along(self.u), along(self.v));
        let is_inside = if self.is_disc {
            (u * u + v * v).cmp_le(Lanes::ONE)
        } else {
            let edge = Lanes::splat(EDGE);
            u.abs().cmp_le(edge) & v.abs().cmp_le(edge)
        };
        where_hit(is_inside & t.cmp_gt(Lanes::ZERO) & t.cmp_lt(limit), t)
    }
}

/// Up to eight spheres.
#[derive(Debug, Clone, Copy)]
struct SphereChunk {
    /// Centre and squared radius.
    ball: [Lanes; 4],
}

impl SphereChunk {
    fn of(primitives: &[Primitive]) -> Self {
        let rows: Vec<[f32; 4]> = primitives
            .iter()
            .filter_map(|primitive| match primitive {
                Primitive::Sphere { centre, radius } => Some([centre.x, centre.y, centre.z, radius * radius]),
                _ => None,
            })
            .collect();
        // A negative squared radius cannot be hit.
        Self { ball: gather(&rows, [0.0, 0.0, 0.0, -1.0]) }
    }

    /// The stable form: the discriminant from the perpendicular offset, the smaller root from the
    /// product of both (Haines et al. 2019, "Precision Improvements for Ray/Sphere Intersection").
    #[inline(always)]
    fn distances(&self, ray: &Ray, limit: Lanes) -> Lanes {
        let (o, d) = (broadcast(ray.origin), broadcast(ray.direction));
        let [cx, cy, cz, radius2] = self.ball;
        let f = [o[0] - cx, o[1] - cy, o[2] - cz];
        let b = -dot(&f, &d);
        let p = [f[0] + b * d[0], f[1] + b * d[1], f[2] + b * d[2]];
        let discriminant = radius2 - dot(&p, &p);
        let root = discriminant.fast_max(Lanes::ZERO).sqrt();
        let q = b + b.cmp_lt(Lanes::ZERO).blend(-root, root);
        let other = (dot(&f, &f) - radius2) / q;
        let (near, far) = (other.fast_min(q), other.fast_max(q));
        let t = near.cmp_gt(Lanes::ZERO).blend(near, far);
        where_hit(discriminant.cmp_ge(Lanes::ZERO) & t.cmp_gt(Lanes::ZERO) & t.cmp_lt(limit), t)
    }
}

/// Up to eight boxes.
#[derive(Debug, Clone, Copy)]
struct BoxChunk {
    rows: [[Lanes; 4]; 3],
}

impl BoxChunk {
    fn of(primitives: &[Primitive]) -> Self {
        let column = |axis: usize| {
            let rows: Vec<[f32; 4]> = primitives
                .iter()
                .filter_map(|primitive| match primitive {
                    Primitive::Box { rows } => {
                        let (gradient, start) = rows[axis];
                        Some([gradient.x, gradient.y, gradient.z, start])
                    }
                    _ => None,
                })
                .collect();
            // Unused lanes: every point has the coordinates (2, 2, 2).
            gather(&rows, [0.0, 0.0, 0.0, 2.0])
        };
        Self { rows: [column(0), column(1), column(2)] }
    }

    #[inline(always)]
    fn distances(&self, ray: &Ray, limit: Lanes) -> Lanes {
        let (o, d) = (broadcast(ray.origin), broadcast(ray.direction));
        let (mut near, mut far) = (Lanes::splat(f32::NEG_INFINITY), Lanes::splat(f32::INFINITY));
        for [x, y, z, start] in self.rows {
            let row = [x, y, z];
            let origin = dot(&row, &o) + start;
            let inverse = Lanes::ONE / dot(&row, &d);
            let (a, b) = ((-Lanes::ONE - origin) * inverse, (Lanes::ONE - origin) * inverse);
            // The second operand wins where the first is NaN, so a ray in a face's plane keeps the bounds.
            near = a.fast_min(b).fast_max(near);
            far = a.fast_max(b).fast_min(far);
        }
        let t = near.cmp_gt(Lanes::ZERO).blend(near, far);
        where_hit(near.cmp_le(far) & t.cmp_gt(Lanes::ZERO) & t.cmp_lt(limit), t)
    }
}

/// A short list of primitives, all of which are tested.
#[derive(Debug, Clone, Default)]
pub(super) struct Few {
    flats: Vec<FlatChunk>,
    spheres: Vec<SphereChunk>,
    boxes: Vec<BoxChunk>,
    /// For each lane of all chunks in turn: which primitive it is.
    order: Vec<u32>,
}

impl Few {
    pub(super) fn new(primitives: &[Primitive]) -> Self {
        let mut few = Self::default();
        for rank in 0..4 {
            let chosen: Vec<(u32, Primitive)> =
                (0_u32..).zip(primitives.iter().copied()).filter(|(_, p)| p.rank() == rank).collect();
            for group in chosen.chunks(LANES) {
                let members: Vec<Primitive> = group.iter().map(|(_, p)| *p).collect();
                match rank {
                    0 | 1 => few.flats.push(FlatChunk::of(&members)),
                    2 => few.spheres.push(SphereChunk::of(&members)),
                    _ => few.boxes.push(BoxChunk::of(&members)),
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
        let mut best = Lanes::splat(length);
        // Numbers of chunks, as floats: lanes of one kind blend in one instruction.
        let mut chunk_of = Lanes::splat(-1.0);
        let mut number = Lanes::ZERO;
        let mut take = |distances: Lanes| {
            let is_nearer = distances.cmp_lt(best);
            best = is_nearer.blend(distances, best);
            chunk_of = is_nearer.blend(number, chunk_of);
            number += Lanes::ONE;
            best
        };
        let mut limit = Lanes::splat(length);
        for chunk in &self.flats {
            limit = take(chunk.distances(ray, limit));
        }
        for chunk in &self.spheres {
            limit = take(chunk.distances(ray, limit));
        }
        for chunk in &self.boxes {
            limit = take(chunk.distances(ray, limit));
        }
        let best = best.to_array();
        let nearest = (1..LANES).fold(0, |nearest, i| if best[i] < best[nearest] { i } else { nearest });
        let chunk = chunk_of.to_array()[nearest];
        if chunk < 0.0 {
            return None;
        }
        let index = self.order.get(chunk as usize * LANES + nearest)?;
        Some((best[nearest], *index))
    }

    /// Whether anything is hit within `(0, length)`.
    #[inline]
    pub(super) fn is_hit(&self, ray: &Ray, length: f32) -> bool {
        let limit = Lanes::splat(length);
        let is_any = |distances: Lanes| distances.cmp_lt(Lanes::splat(f32::INFINITY)).any();
        self.boxes.iter().any(|c| is_any(c.distances(ray, limit)))
            || self.flats.iter().any(|c| is_any(c.distances(ray, limit)))
            || self.spheres.iter().any(|c| is_any(c.distances(ray, limit)))
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
        Primitive::Box { rows } => {
            let matrix = fogbow::math::Mat3::from_cols(rows[0].0, rows[1].0, rows[2].0).transpose().inverse();
            let start = Vec3::new(rows[0].1, rows[1].1, rows[2].1);
            let corner = |i: u32| {
                let sign = |bit: u32| if i & bit == 0 { -1.0 } else { 1.0 };
                matrix * (Vec3::new(sign(1), sign(2), sign(4)) - start)
            };
            Bounds::of((0..8).map(corner))
        }
    }
}
