//! Triangles in a bounding volume hierarchy of the `obvhs` crate.

use core::time::Duration;

use fogbow::math::{Bounds, Frame, Ray, Vec3};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::ray::RayHit;

/// Triangles, in the order of the leaves.
pub(super) struct Triangles {
    tree: Bvh2,
    corners: Vec<[Vec3; 3]>,
    /// Which triangle of the list given this is.
    order: Vec<u32>,
}

/// A box a little larger than `bounds`, so that the rounding of its intersection with a ray
/// cannot lose what lies in its faces: flat walls have flat boxes.
pub(super) fn padded(bounds: &Bounds) -> Aabb {
    let largest = bounds.min.abs().max(bounds.max.abs()).max_element();
    let pad = Vec3::splat(largest * 1e-6 + 1e-30);
    let corner = |v: Vec3| glam_of(v);
    Aabb::new(corner(bounds.min - pad), corner(bounds.max + pad))
}

/// `obvhs` uses its own version of `glam`; arrays pass between the two.
fn glam_of<V: From<[f32; 3]>>(v: Vec3) -> V {
    V::from(v.to_array())
}

pub(super) fn tree_ray(ray: &Ray, length: f32) -> obvhs::ray::Ray {
    obvhs::ray::Ray::new(glam_of(ray.origin), glam_of(ray.direction), 0.0, length)
}

impl core::fmt::Debug for Triangles {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Triangles").field("count", &self.corners.len()).finish_non_exhaustive()
    }
}

impl Triangles {
    pub(super) fn new(triangles: &[[Vec3; 3]]) -> Self {
        let boxes: Vec<Aabb> = triangles.iter().map(|t| padded(&Bounds::of(*t))).collect();
        let settings = BvhBuildParams { pre_split: false, ..BvhBuildParams::slow_build() };
        let tree = build_bvh2(&boxes, settings, &mut Duration::default());
        let order = tree.primitive_indices.clone();
        let corners = order.iter().filter_map(|i| triangles.get(*i as usize).copied()).collect();
        Self { tree, corners, order }
    }

    /// Bytes of the tree.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&*self.tree.nodes) + size_of_val(&*self.order)
    }

    /// The nearest hit within `(0, length)`: distance and number of the triangle.
    #[inline]
    pub(super) fn closest(&self, ray: &Ray, length: f32) -> Option<(f32, u32)> {
        if self.corners.is_empty() {
            return None;
        }
        let frame = Frame::around(ray.direction);
        let mut hit = RayHit::none();
        let is_hit = self.tree.ray_traverse(tree_ray(ray, length), &mut hit, |limit, index| {
            self.corners.get(index).map_or(f32::INFINITY, |t| distance(t, ray.origin, &frame, limit.tmax))
        });
        let index = self.order.get(hit.primitive_id as usize)?;
        is_hit.then_some((hit.t, *index))
    }

    /// Whether anything is hit within `(0, length)`.
    #[inline]
    pub(super) fn is_hit(&self, ray: &Ray, length: f32) -> bool {
        if self.corners.is_empty() {
            return false;
        }
        let frame = Frame::around(ray.direction);
        !self.tree.ray_traverse_miss(tree_ray(ray, length), |limit, index| {
            self.corners.get(index).map_or(f32::INFINITY, |t| distance(t, ray.origin, &frame, limit.tmax))
        })
    }
}

/// Distance along `frame.w` at which a triangle is hit within `(0, limit)`, or infinity.
///
/// Watertight as in Woop et al. 2013, "Watertight Ray/Triangle Intersection": every corner is
/// projected along the ray in a way that depends on the corner alone, so the sign of an edge is
/// the same for both triangles that share it. (An orthonormal frame takes the place of their
/// shear, and a ray that meets an edge exactly hits both.)
#[inline(always)]
pub(super) fn distance(corners: &[Vec3; 3], origin: Vec3, frame: &Frame, limit: f32) -> f32 {
    let [a, b, c] = corners.map(|corner| frame.to_local(corner - origin));
    let u = c.x * b.y - c.y * b.x;
    let v = a.x * c.y - a.y * c.x;
    let w = b.x * a.y - b.y * a.x;
    let has_negative = (u < 0.0) | (v < 0.0) | (w < 0.0);
    let has_positive = (u > 0.0) | (v > 0.0) | (w > 0.0);
    if has_negative & has_positive {
        return f32::INFINITY;
    }
    let determinant = u + v + w;
    if determinant == 0.0 {
        return f32::INFINITY;
    }
    let t = (u * a.z + v * b.z + w * c.z) / determinant;
    if t > 0.0 && t < limit { t } else { f32::INFINITY }
}
