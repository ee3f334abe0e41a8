//! Flat pieces, spheres and boxes, eight at a time: loops over lanes that compile to SIMD.

use fogbow::math::{Bounds, Ray, Vec3};

/// Width of the loops: one register of x86-64-v3, two of the baseline's.
const LANES: usize = 8;

type Lanes = [f32; LANES];

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
            Self::Flat { .. } => FlatChunk::of(core::slice::from_ref(self)).distances(ray, &[length; LANES])[0],
            Self::Sphere { .. } => SphereChunk::of(core::slice::from_ref(self)).distances(ray, &[length; LANES])[0],
            Self::Box { .. } => BoxChunk::of(core::slice::from_ref(self)).distances(ray, &[length; LANES])[0],
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
#[derive(Debug, Clone, Copy, Default)]
#[repr(align(32))]
struct FlatChunk {
    normal: [Lanes; 3],
    offset: Lanes,
    u: [Lanes; 4],
    v: [Lanes; 4],
    /// 1 for a disc, 0 for a square.
    is_disc: bool,
}

impl FlatChunk {
    fn of(primitives: &[Primitive]) -> Self {
        // Unused lanes stay 0, which makes the distance 0/0: no comparison holds.
        let mut chunk = Self::default();
        for (lane, primitive) in primitives.iter().enumerate() {
            let Primitive::Flat { normal, offset, u, v, is_disc } = primitive else { continue };
            for axis in 0..3 {
                chunk.normal[axis][lane] = normal[axis];
                chunk.u[axis][lane] = u.0[axis];
                chunk.v[axis][lane] = v.0[axis];
            }
            chunk.offset[lane] = *offset;
            chunk.u[3][lane] = u.1;
            chunk.v[3][lane] = v.1;
            chunk.is_disc = *is_disc;
        }
        chunk
    }

    #[inline(always)]
    fn distances(&self, ray: &Ray, limit: &Lanes) -> Lanes {
        let (o, d) = (ray.origin, ray.direction);
        let [nx, ny, nz] = &self.normal;
        let mut found = [f32::INFINITY; LANES];
        let (mut t, mut u, mut v) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        for i in 0..LANES {
            let along = nx[i] * d.x + ny[i] * d.y + nz[i] * d.z;
            let height = self.offset[i] - (nx[i] * o.x + ny[i] * o.y + nz[i] * o.z);
            t[i] = height / along;
            let (x, y, z) = (o.x + t[i] * d.x, o.y + t[i] * d.y, o.z + t[i] * d.z);
            u[i] = self.u[0][i] * x + self.u[1][i] * y + self.u[2][i] * z + self.u[3][i];
            v[i] = self.v[0][i] * x + self.v[1][i] * y + self.v[2][i] * z + self.v[3][i];
        }
        if self.is_disc {
            for i in 0..LANES {
                let is_hit = (u[i] * u[i] + v[i] * v[i] <= 1.0) & (t[i] > 0.0) & (t[i] < limit[i]);
                found[i] = if is_hit { t[i] } else { f32::INFINITY };
            }
        } else {
            for i in 0..LANES {
                let is_inside = (u[i].abs() <= EDGE) & (v[i].abs() <= EDGE);
                let is_hit = is_inside & (t[i] > 0.0) & (t[i] < limit[i]);
                found[i] = if is_hit { t[i] } else { f32::INFINITY };
            }
        }
        found
    }
}

/// Up to eight spheres.
#[derive(Debug, Clone, Copy)]
#[repr(align(32))]
struct SphereChunk {
    centre: [Lanes; 3],
    radius2: Lanes,
}

impl SphereChunk {
    fn of(primitives: &[Primitive]) -> Self {
        // A negative squared radius cannot be hit.
        let mut chunk = Self { centre: [[0.0; LANES]; 3], radius2: [-1.0; LANES] };
        for (lane, primitive) in primitives.iter().enumerate() {
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
    fn distances(&self, ray: &Ray, limit: &Lanes) -> Lanes {
        let (o, d) = (ray.origin, ray.direction);
        let mut found = [f32::INFINITY; LANES];
        for i in 0..LANES {
            let (fx, fy, fz) = (o.x - self.centre[0][i], o.y - self.centre[1][i], o.z - self.centre[2][i]);
            let b = -(fx * d.x + fy * d.y + fz * d.z);
            let (px, py, pz) = (fx + b * d.x, fy + b * d.y, fz + b * d.z);
            let discriminant = self.radius2[i] - (px * px + py * py + pz * pz);
            let root = if discriminant > 0.0 { discriminant } else { 0.0 }.sqrt();
            let q = b + if b < 0.0 { -root } else { root };
            let c = fx * fx + fy * fy + fz * fz - self.radius2[i];
            let other = c / q;
            let near = if other < q { other } else { q };
            let far = if other < q { q } else { other };
            let t = if near > 0.0 { near } else { far };
            let is_hit = (discriminant >= 0.0) & (t > 0.0) & (t < limit[i]);
            found[i] = if is_hit { t } else { f32::INFINITY };
        }
        found
    }
}

/// Up to eight boxes.
#[derive(Debug, Clone, Copy)]
#[repr(align(32))]
struct BoxChunk {
    rows: [[Lanes; 4]; 3],
}

impl BoxChunk {
    fn of(primitives: &[Primitive]) -> Self {
        // Unused lanes: every point has the coordinates (2, 2, 2).
        let mut chunk = Self { rows: [[[0.0; LANES], [0.0; LANES], [0.0; LANES], [2.0; LANES]]; 3] };
        for (lane, primitive) in primitives.iter().enumerate() {
            let Primitive::Box { rows } = primitive else { continue };
            for (slot, (gradient, start)) in chunk.rows.iter_mut().zip(rows) {
                for axis in 0..3 {
                    slot[axis][lane] = gradient[axis];
                }
                slot[3][lane] = *start;
            }
        }
        chunk
    }

    #[inline(always)]
    fn distances(&self, ray: &Ray, limit: &Lanes) -> Lanes {
        let (o, d) = (ray.origin, ray.direction);
        let (mut near, mut far) = ([f32::NEG_INFINITY; LANES], [f32::INFINITY; LANES]);
        for [gx, gy, gz, start] in &self.rows {
            for i in 0..LANES {
                let origin = gx[i] * o.x + gy[i] * o.y + gz[i] * o.z + start[i];
                let inverse = 1.0 / (gx[i] * d.x + gy[i] * d.y + gz[i] * d.z);
                let (a, b) = ((-1.0 - origin) * inverse, (1.0 - origin) * inverse);
                let (low, high) = if a < b { (a, b) } else { (b, a) };
                near[i] = if low > near[i] { low } else { near[i] };
                far[i] = if high < far[i] { high } else { far[i] };
            }
        }
        let mut found = [f32::INFINITY; LANES];
        for i in 0..LANES {
            let t = if near[i] > 0.0 { near[i] } else { far[i] };
            let is_hit = (near[i] <= far[i]) & (t > 0.0) & (t < limit[i]);
            found[i] = if is_hit { t } else { f32::INFINITY };
        }
        found
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
        let mut best = [length; LANES];
        let mut chunk_of = [u32::MAX; LANES];
        let mut number = 0_u32;
        let mut take = |distances: Lanes, best: &mut Lanes| {
            for i in 0..LANES {
                let is_nearer = distances[i] < best[i];
                best[i] = if is_nearer { distances[i] } else { best[i] };
                chunk_of[i] = if is_nearer { number } else { chunk_of[i] };
            }
            number += 1;
        };
        for chunk in &self.flats {
            take(chunk.distances(ray, &best), &mut best);
        }
        for chunk in &self.spheres {
            take(chunk.distances(ray, &best), &mut best);
        }
        for chunk in &self.boxes {
            take(chunk.distances(ray, &best), &mut best);
        }
        let mut nearest = 0;
        for i in 1..LANES {
            if best[i] < best[nearest] {
                nearest = i;
            }
        }
        let chunk = chunk_of[nearest];
        let index = self.order.get((chunk as usize).checked_mul(LANES)? + nearest)?;
        Some((best[nearest], *index))
    }

    /// Whether anything is hit within `(0, length)`.
    #[inline]
    pub(super) fn is_hit(&self, ray: &Ray, length: f32) -> bool {
        let limit = [length; LANES];
        let is_any = |distances: Lanes| distances.iter().fold(false, |any, t| any | (*t < f32::INFINITY));
        self.boxes.iter().any(|c| is_any(c.distances(ray, &limit)))
            || self.flats.iter().any(|c| is_any(c.distances(ray, &limit)))
            || self.spheres.iter().any(|c| is_any(c.distances(ray, &limit)))
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
