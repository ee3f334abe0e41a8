//! Which probes have light to hold.

use glam::Vec3;

use super::basis::{ProbeBasis, Quantity};
use super::grid::ProbeState;
use super::settings::BakeSettings;
use crate::host::{Medium, Scene};
use crate::math::Ray;
use crate::sampling::{even2, warp};
use crate::transmittance::segments;
use crate::world::{World, nearest_surface};

/// Rays that look for back sides. Fewer: probes near the edge of a wall are told by chance.
const RAYS: u32 = 32;

/// Share of the rays that meet back sides first, from which on a probe counts as in a wall: below a floor it is a half, and in a room with
/// some one-sided thing turned away much less.
const MOST_BEHIND: f32 = 0.25;

/// What becomes of a probe: where it has no part in any look-up, nothing is baked.
///
/// In a wall is where many rays meet the back of a surface first, as [`Hit::normal`](crate::host::Hit::normal) tells it. Two-sided
/// surfaces have no back, and glass may have fog on both sides.
pub(super) fn state<M: Medium + ?Sized, S: Scene + ?Sized>(
    point: Vec3,
    cell: Vec3,
    world: &World<'_, M, S>,
    settings: &BakeSettings,
) -> ProbeState {
    let mut behind = 0;
    for i in 0..RAYS {
        let direction = warp::uniform_sphere(even2(i + 1).into());
        let hit = nearest_surface(&Ray::new(point, direction), world.scene);
        let is_back = |hit: &crate::host::Hit| hit.normal.dot(direction) > 0.0 && !hit.surface.transmits();
        behind += u32::from(hit.as_ref().is_some_and(is_back));
    }
    if behind as f32 > MOST_BEHIND * RAYS as f32 {
        return ProbeState::InWall;
    }
    let lights_surfaces = settings.quantity == Quantity::Irradiance && settings.basis != ProbeBasis::Fluence;
    if lights_surfaces || has_medium_near(point, cell, world.medium) { ProbeState::Valid } else { ProbeState::Empty }
}

/// Bits for x, y and z: whether a surface stands between a probe and the next one.
pub(super) fn walls(point: Vec3, cell: Vec3, scene: &(impl Scene + ?Sized)) -> u32 {
    let bit = |axis: usize| {
        let next = point + Vec3::from_array(core::array::from_fn(|i| if i == axis { cell[i] } else { 0.0 }));
        u32::from(scene.is_blocked(&Ray::between(point, next))) << axis
    };
    bit(0) | bit(1) | bit(2)
}

/// Whether there may be any medium where the probe has a part in look-ups: up to its neighbours.
fn has_medium_near(point: Vec3, cell: Vec3, medium: &(impl Medium + ?Sized)) -> bool {
    if !medium.mean_extinction(point, cell.length()).is_black() {
        return true;
    }
    // A mean from a few points misses wisps; majorants along lines do not.
    let directions = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1), (1, 1, -1), (1, -1, 1), (-1, 1, 1)];
    directions.into_iter().any(|(x, y, z)| {
        let half = cell * Vec3::new(x as f32, y as f32, z as f32);
        let ray = Ray::between(point - half, point + half);
        segments(medium, &ray).any(|(_, segment)| !segment.majorant.is_black())
    })
}
