//! The basis up to degree 2, as constants: no loop, no table.

use glam::Vec3;

/// `½ √(1/π)`.
const Y0: f32 = 0.282_094_791_773_878_14;
/// `√(3/(4π))`.
const Y1: f32 = 0.488_602_511_902_919_9;
/// `½ √(15/π)`.
const Y2: f32 = 1.092_548_430_592_079_1;
/// `¼ √(5/π)`.
const Y2_0: f32 = 0.315_391_565_252_520_05;

/// Up to `degree` (≤ 2); `values` has room.
#[inline]
pub(super) fn evaluate(direction: Vec3, degree: usize, values: &mut [f32]) {
    let Vec3 { x, y, z } = direction;
    values[0] = Y0;
    if degree >= 1 {
        values[1..4].copy_from_slice(&[Y1 * y, Y1 * z, Y1 * x]);
    }
    if degree >= 2 {
        values[4..9].copy_from_slice(&[
            Y2 * x * y,
            Y2 * y * z,
            Y2_0 * (3.0 * z * z - 1.0),
            Y2 * z * x,
            0.5 * Y2 * (x - y) * (x + y),
        ]);
    }
}

/// Tangential gradients: `∇R − l Y u` with `R` the solid harmonics `(y, z, x)`, `xy`, `yz`,
/// `2z² − x² − y²`, `zx`, `x² − y²`.
#[inline]
pub(super) fn gradients(direction: Vec3, degree: usize, gradients: &mut [Vec3]) {
    let Vec3 { x, y, z } = direction;
    gradients[0] = Vec3::ZERO;
    let tangential = |g: Vec3| g - direction * direction.dot(g);
    if degree >= 1 {
        let [a, b, c] = [Vec3::Y, Vec3::Z, Vec3::X].map(|axis| tangential(axis) * Y1);
        gradients[1..4].copy_from_slice(&[a, b, c]);
    }
    if degree >= 2 {
        gradients[4..9].copy_from_slice(&[
            tangential(Vec3::new(y, x, 0.0)) * Y2,
            tangential(Vec3::new(0.0, z, y)) * Y2,
            tangential(Vec3::new(-x, -y, 2.0 * z)) * (2.0 * Y2_0),
            tangential(Vec3::new(z, 0.0, x)) * Y2,
            tangential(Vec3::new(x, -y, 0.0)) * Y2,
        ]);
    }
}
