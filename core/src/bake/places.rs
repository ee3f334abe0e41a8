//! Which probes have light to hold.

use glam::Vec3;

use super::basis::{ProbeBasis, Quantity};
use super::probe::ProbeState;
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

/// Longest plane vector: of a surface a thousandth of a cell away.
const NEAREST: f32 = 1024.0;

/// Probes around another one.
const AROUND: usize = 26;

/// Planes of surfaces that are kept of a probe: look-ups have two of them. Fewer: photons count behind the walls of a pillar.
pub(super) const PLANES: usize = 4;

/// Surfaces around a probe: bits for x, y and z where one stands before the next probe, and the planes of some.
///
/// Rays to all probes around tell which of them a surface hides, each with its plane. Taken is the plane that hides most of those that are hidden and fewest of
/// those that are seen; then those that do most for the rest. Any number of surfaces in two planes, as a wall, a pane, or the edge of two, are told exactly by the first two.
pub(super) fn walls(point: Vec3, cell: Vec3, scene: &(impl Scene + ?Sized)) -> (u32, [Vec3; PLANES]) {
    let offsets: [Vec3; AROUND] = core::array::from_fn(|i| {
        // Without the probe itself, number 13 of 27.
        let i = i + usize::from(i >= AROUND / 2);
        Vec3::new((i % 3) as f32 - 1.0, (i / 3 % 3) as f32 - 1.0, (i / 9) as f32 - 1.0)
    });
    let met = offsets.map(|offset| {
        let ray = Ray::between(point, point + offset * cell);
        let hit = nearest_surface(&ray, scene)?;
        // In cells, planes have normals that are as much longer as cells are.
        let normal = hit.normal * cell;
        let along = normal.dot(offset) * (hit.distance / ray.length);
        let plane = normal / along;
        let size = plane.abs().max_element();
        // Along the surface itself there is no telling.
        size.is_finite().then(|| half(plane * (NEAREST / size).min(1.0)))
    });
    let bits =
        [14, 16, 22].into_iter().zip(0..).fold(0, |bits, (i, axis)| bits | u32::from(met[i - 1].is_some()) << axis);
    if met.iter().all(Option::is_none) {
        return (bits, [Vec3::ZERO; PLANES]);
    }
    let mut planes = [Vec3::ZERO; PLANES];
    for number in 0..planes.len() {
        let is_told = |offset: Vec3| planes[..number].iter().any(|plane| plane.dot(offset) > 1.0);
        let worth = |plane: &Vec3| {
            let of = |(offset, met): (&Vec3, &Option<Vec3>)| match (plane.dot(*offset) > 1.0, met.is_some()) {
                (true, true) if !is_told(*offset) => 1,
                (true, false) if !is_told(*offset) => -1,
                _ => 0,
            };
            offsets.iter().zip(&met).map(of).sum::<i32>()
        };
        // Of equals the first.
        let best =
            met.iter().flatten().map(|plane| (worth(plane), *plane)).reduce(|a, b| if b.0 > a.0 { b } else { a });
        if let Some((1.., plane)) = best {
            planes[number] = plane;
        }
    }
    (bits, planes)
}

/// Numbers that half floats hold, so that shaders see surfaces where the core does.
fn half(plane: Vec3) -> Vec3 {
    const REST: u32 = (1 << 13) - 1;
    let round = |number: f32| {
        // What is smaller than half floats hold exactly makes no difference.
        let number = if number.abs() < 1e-4 { 0.0 } else { number };
        f32::from_bits((number.to_bits() + REST / 2 + 1) & !REST)
    };
    Vec3::from_array(plane.to_array().map(round))
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
