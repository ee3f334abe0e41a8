//! Triangles in a tree of width four: built by the `obvhs` crate, widened and traversed here, because
//! four boxes and four triangles at a time are what baseline registers hold.

use core::time::Duration;

use fogbow::glam::Vec4;
use fogbow::math::{Bounds, Frame, Ray, Vec3};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;

const LANES: usize = 4;

/// Marks a child that is a leaf.
const LEAF: u32 = 1 << 31;

/// Distances to boxes are widened by a few roundings (Ize 2013, "Robust BVH Ray Traversal").
const WIDER: f32 = 1.0 + 4.0 * f32::EPSILON;

/// Triangles in leaves of up to four, under nodes of up to four children.
#[derive(Debug, Default)]
pub(super) struct Triangles {
    nodes: Vec<Node>,
    leaves: Vec<Leaf>,
}

/// The boxes of up to four children.
#[derive(Debug, Clone, Copy, Default)]
struct Node {
    low: [Vec4; 3],
    high: [Vec4; 3],
    children: [u32; LANES],
    /// A bit for each child.
    present: u32,
}

/// Up to four triangles; unused lanes have no area and are never hit.
#[derive(Debug, Clone, Copy, Default)]
struct Leaf {
    corners: [[Vec4; 3]; 3],
    index: [u32; LANES],
}

/// A box a little larger than `bounds`: a ray may be found to hit a triangle whose border it
/// misses by a rounding, and must then also meet its box.
pub(super) fn padded(bounds: &Bounds) -> Aabb {
    let largest = bounds.min.abs().max(bounds.max.abs()).max_element();
    let pad = Vec3::splat(largest * 1e-6 + 1e-30);
    Aabb::new((bounds.min - pad).to_array().into(), (bounds.max + pad).to_array().into())
}

/// Nodes still to be visited, with the distance at which the ray enters them: on the stack, and
/// beyond 128 (trees of absurd depth) on the heap.
struct Pending {
    near: heapless::Vec<(u32, f32), 128>,
    more: Vec<(u32, f32)>,
}

impl Pending {
    #[inline(always)]
    fn push(&mut self, entry: (u32, f32)) {
        if let Err(entry) = self.near.push(entry) {
            self.more.push(entry);
        }
    }

    #[inline(always)]
    fn pop(&mut self) -> Option<(u32, f32)> {
        if self.more.is_empty() { self.near.pop() } else { self.more.pop() }
    }
}

/// What of a ray boxes are tested with.
struct Slabs {
    origin: Vec3,
    inverse: Vec3,
}

impl Slabs {
    #[inline]
    fn new(ray: &Ray) -> Self {
        // Infinities would make 0 · ∞ of a ray that runs in a face.
        let finite = |d: f32| if d.abs() < 1e-30 { 1e30_f32.copysign(d) } else { 1.0 / d };
        let d = ray.direction;
        Self { origin: ray.origin, inverse: Vec3::new(finite(d.x), finite(d.y), finite(d.z)) }
    }
}

impl Node {
    /// Where the ray enters each child; a bit for each child that it enters before `limit`.
    #[inline(always)]
    fn enter(&self, slabs: &Slabs, limit: f32) -> (Vec4, u32) {
        let (mut near, mut far) = (Vec4::ZERO, Vec4::splat(limit));
        for axis in 0..3 {
            let a = (self.low[axis] - slabs.origin[axis]) * slabs.inverse[axis];
            let b = (self.high[axis] - slabs.origin[axis]) * slabs.inverse[axis];
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        (near, near.cmple(far * WIDER).bitmask() & self.present)
    }
}

impl Leaf {
    /// Distances along `frame.w` at which the triangles are hit within `(0, limit)`, or infinity.
    ///
    /// Watertight as in Woop et al. 2013, "Watertight Ray/Triangle Intersection": every corner is
    /// projected along the ray in a way that depends on the corner alone, so the sign of an edge is
    /// the same for both triangles that share it. (An orthonormal frame takes the place of their
    /// shear, and a ray that meets an edge exactly hits both.)
    #[inline(always)]
    fn distances(&self, origin: Vec3, frame: &Frame, limit: f32) -> Vec4 {
        let local = |[x, y, z]: &[Vec4; 3]| {
            let (x, y, z) = (*x - origin.x, *y - origin.y, *z - origin.z);
            let along = |axis: Vec3| x * axis.x + y * axis.y + z * axis.z;
            (along(frame.u), along(frame.v), along(frame.w))
        };
        let [(ax, ay, az), (bx, by, bz), (cx, cy, cz)] =
            [local(&self.corners[0]), local(&self.corners[1]), local(&self.corners[2])];
        let u = cx * by - cy * bx;
        let v = ax * cy - ay * cx;
        let w = bx * ay - by * ax;
        let is_inside = u.min(v).min(w).cmpge(Vec4::ZERO) | u.max(v).max(w).cmple(Vec4::ZERO);
        if !is_inside.any() {
            return Vec4::INFINITY;
        }
        // Without an area this is 0/0, for which no comparison holds.
        let t = (u * az + v * bz + w * cz) / (u + v + w);
        Vec4::select(is_inside & t.cmpgt(Vec4::ZERO) & t.cmplt(Vec4::splat(limit)), t, Vec4::INFINITY)
    }
}

impl Triangles {
    pub(super) fn new(triangles: &[[Vec3; 3]]) -> Self {
        let boxes: Vec<Aabb> = triangles.iter().map(|t| padded(&Bounds::of(*t))).collect();
        let settings = BvhBuildParams {
            pre_split: false,
            max_prims_per_leaf: LANES as u32,
            // Four triangles cost as much as one.
            collapse_traversal_cost: 8.0,
            ..BvhBuildParams::slow_build()
        };
        let tree = build_bvh2(&boxes, settings, &mut Duration::default());
        let mut wide = Self::default();
        wide.widen(&tree, triangles);
        wide
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&*self.nodes) + size_of_val(&*self.leaves)
    }

    /// Takes over a binary tree: children of large area are replaced by their own children until
    /// there are four.
    fn widen(&mut self, tree: &Bvh2, triangles: &[[Vec3; 3]]) {
        if tree.nodes.is_empty() {
            return;
        }
        self.nodes.push(Node::default());
        // Nodes of the binary tree whose place in the wide tree is reserved.
        let mut open = vec![(0_usize, 0_usize)];
        while let Some((slot, binary)) = open.pop() {
            let mut members = vec![binary];
            loop {
                let area = |i: &usize| tree.nodes.get(*i).map_or(0.0, |n| n.aabb().half_area());
                let is_inner = |i: &usize| tree.nodes.get(*i).is_some_and(|n| !n.is_leaf());
                let widest = (0..members.len())
                    .filter(|k| is_inner(&members[*k]))
                    .max_by(|a, b| area(&members[*a]).total_cmp(&area(&members[*b])));
                let Some(widest) = widest.filter(|_| members.len() < LANES) else { break };
                let first = tree.nodes.get(members[widest]).map_or(0, |n| n.first_index as usize);
                members[widest] = first;
                members.push(first + 1);
            }
            let mut node = Node::default();
            for (lane, member) in members.iter().enumerate() {
                let Some(inner) = tree.nodes.get(*member) else { continue };
                let bounds = inner.aabb();
                for axis in 0..3 {
                    node.low[axis][lane] = bounds.min[axis];
                    node.high[axis][lane] = bounds.max[axis];
                }
                node.present |= 1 << lane;
                node.children[lane] = if inner.is_leaf() {
                    let range = inner.first_index as usize..(inner.first_index + inner.prim_count) as usize;
                    let indices = tree.primitive_indices.get(range).unwrap_or_default();
                    self.leaves.push(leaf(indices, triangles));
                    LEAF | (self.leaves.len() - 1) as u32
                } else {
                    open.push((self.nodes.len(), *member));
                    self.nodes.push(Node::default());
                    (self.nodes.len() - 1) as u32
                };
            }
            if let Some(place) = self.nodes.get_mut(slot) {
                *place = node;
            }
        }
    }

    /// The nearest hit within `(0, length)`: distance and number of the triangle.
    #[inline]
    pub(super) fn closest(&self, ray: &Ray, length: f32) -> Option<(f32, u32)> {
        let mut best = (length, None);
        let (frame, slabs) = (Frame::around(ray.direction), Slabs::new(ray));
        let mut pending = Pending { near: heapless::Vec::new(), more: Vec::new() };
        let mut next = Some((0, 0.0));
        while let Some((at, entry)) = next {
            if entry > best.0 {
                next = pending.pop();
                continue;
            }
            if at & LEAF != 0 {
                if let Some(leaf) = self.leaves.get((at & !LEAF) as usize) {
                    let distances = leaf.distances(ray.origin, &frame, best.0);
                    let nearest = distances.min_element();
                    if nearest < best.0 {
                        let lane = distances.cmpeq(Vec4::splat(nearest)).bitmask().trailing_zeros() as usize;
                        best = (nearest, leaf.index.get(lane).copied());
                    }
                }
                next = pending.pop();
                continue;
            }
            let Some(node) = self.nodes.get(at as usize) else { break };
            let (near, mut hits) = node.enter(&slabs, best.0);
            let near = near.to_array();
            // The nearest child is visited next; the others wait, the farther the longer.
            let mut found = [(0_u32, f32::INFINITY); LANES];
            let mut count = 0;
            while hits != 0 {
                let lane = (hits.trailing_zeros() & 3) as usize;
                hits &= hits - 1;
                let entry = (node.children[lane], near[lane]);
                let mut place = count;
                while place > 0 && found[(place - 1) & 3].1 < entry.1 {
                    found[place & 3] = found[(place - 1) & 3];
                    place -= 1;
                }
                found[place & 3] = entry;
                count += 1;
            }
            if count == 0 {
                next = pending.pop();
                continue;
            }
            for entry in found.iter().take(count - 1) {
                pending.push(*entry);
            }
            next = found.get(count - 1).copied();
        }
        best.1.map(|index| (best.0, index))
    }

    /// Whether anything is hit within `(0, length)`.
    #[inline]
    pub(super) fn is_hit(&self, ray: &Ray, length: f32) -> bool {
        let (frame, slabs) = (Frame::around(ray.direction), Slabs::new(ray));
        let mut pending = Pending { near: heapless::Vec::new(), more: Vec::new() };
        let mut next = Some((0, 0.0));
        while let Some((at, _)) = next {
            if at & LEAF != 0 {
                if let Some(leaf) = self.leaves.get((at & !LEAF) as usize)
                    && leaf.distances(ray.origin, &frame, length).cmplt(Vec4::INFINITY).any()
                {
                    return true;
                }
            } else if let Some(node) = self.nodes.get(at as usize) {
                let (near, mut hits) = node.enter(&slabs, length);
                while hits != 0 {
                    let lane = (hits.trailing_zeros() & 3) as usize;
                    hits &= hits - 1;
                    pending.push((node.children[lane], near[lane]));
                }
            }
            next = pending.pop();
        }
        false
    }
}

fn leaf(indices: &[u32], triangles: &[[Vec3; 3]]) -> Leaf {
    let mut leaf = Leaf::default();
    for (lane, index) in indices.iter().take(LANES).enumerate() {
        let Some(corners) = triangles.get(*index as usize) else { continue };
        for (slot, corner) in leaf.corners.iter_mut().zip(corners) {
            for axis in 0..3 {
                slot[axis][lane] = corner[axis];
            }
        }
        leaf.index[lane] = *index;
    }
    leaf
}

/// Distance to a single triangle.
#[cfg(test)]
pub(super) fn distance(triangle: &[Vec3; 3], ray: &Ray, limit: f32) -> f32 {
    leaf(&[0], core::slice::from_ref(triangle)).distances(ray.origin, &Frame::around(ray.direction), limit)[0]
}
