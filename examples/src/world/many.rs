//! Many analytic primitives, in a tree.

use core::time::Duration;

use fogbow::math::Ray;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::ray::RayHit;

use super::analytic::{Primitive, bounds};
use super::triangles::padded;

/// Primitives in the order of the leaves.
pub(super) struct Many {
    tree: Bvh2,
    primitives: Vec<Primitive>,
    order: Vec<u32>,
}

impl core::fmt::Debug for Many {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Many").field("count", &self.primitives.len()).finish_non_exhaustive()
    }
}

impl Many {
    pub(super) fn new(primitives: &[Primitive]) -> Self {
        let boxes: Vec<Aabb> = primitives.iter().map(|p| padded(&bounds(p))).collect();
        let settings = BvhBuildParams { pre_split: false, max_prims_per_leaf: 2, ..BvhBuildParams::slow_build() };
        let tree = build_bvh2(&boxes, settings, &mut Duration::default());
        let order = tree.primitive_indices.clone();
        let primitives = order.iter().filter_map(|i| primitives.get(*i as usize).copied()).collect();
        Self { tree, primitives, order }
    }

    /// The nearest hit within `(0, length)`: distance and number of the primitive.
    pub(super) fn closest(&self, ray: &Ray, length: f32) -> Option<(f32, u32)> {
        let mut hit = RayHit::none();
        let is_hit = self.tree.ray_traverse(tree_ray(ray, length), &mut hit, |limit, index| {
            self.primitives.get(index).map_or(f32::INFINITY, |p| p.distance(ray, limit.tmax))
        });
        let index = self.order.get(hit.primitive_id as usize)?;
        is_hit.then_some((hit.t, *index))
    }

    pub(super) fn is_hit(&self, ray: &Ray, length: f32) -> bool {
        !self.tree.ray_traverse_miss(tree_ray(ray, length), |limit, index| {
            self.primitives.get(index).map_or(f32::INFINITY, |p| p.distance(ray, limit.tmax))
        })
    }
}

fn tree_ray(ray: &Ray, length: f32) -> obvhs::ray::Ray {
    obvhs::ray::Ray::new(ray.origin.to_array().into(), ray.direction.to_array().into(), 0.0, length)
}
