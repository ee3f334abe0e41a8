//! Directions towards lamps without extent.
//!
//! A ray that passes such a lamp at the distance `D` collects light in proportion to `1/D`, however the point on it is
//! drawn: a walk that happens to go straight for one has no bound. So a part of the directions is drawn like `1/D`, too.

use glam::{Vec2, Vec3};

use crate::light::Light;
use crate::math::Frame;
use crate::sampling::discrete::choose;
use crate::sampling::warp::{steep_cone, steep_cone_pdf};

/// Part of the directions of a walk that goes to lamps. Larger: walks learn less of everything else; smaller: the bound of a
/// sample, which goes like one over it, is higher.
pub(super) const SHARE: f32 = 0.25;

/// Half angle of the cone around a lamp (rad). Farther from it nothing is steep.
const WIDEST: f32 = 0.5;

/// Weight of a lamp and the unit direction to it: in proportion to `I/r`, what rays about it collect together.
fn aim(light: &Light<'_>, point: Vec3) -> Option<(f32, Vec3)> {
    let field = light.steep_field().filter(|field| field.radius().is_none())?;
    let offset = field.centre() - point;
    let distance = offset.length();
    let weight = light.importance(point) * distance;
    // Written so that NaN fails, too.
    (weight > 0.0 && weight < f32::INFINITY && distance > 0.0).then(|| (weight, offset / distance))
}

/// A direction from `point` to the surroundings of one of the lamps; `None` if there are none.
pub(super) fn sample(point: Vec3, lights: &[Light<'_>], u: f32, v: Vec2) -> Option<Vec3> {
    let (axis, _) = choose(lights.iter().filter_map(|light| aim(light, point)), u)?;
    Some(Frame::around(axis).to_world(steep_cone(v, WIDEST)).normalize())
}

/// Its density (sr⁻¹); `None` if there are no lamps.
pub(super) fn pdf(point: Vec3, lights: &[Light<'_>], direction: Vec3) -> Option<f32> {
    let (mut total, mut sum) = (0.0, 0.0);
    for (weight, axis) in lights.iter().filter_map(|light| aim(light, point)) {
        total += weight;
        sum += weight * steep_cone_pdf(axis.cross(direction).length(), axis.dot(direction), WIDEST);
    }
    (total > 0.0).then(|| sum / total)
}
