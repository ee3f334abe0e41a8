//! Quadrature in a ball.

use glam::{Mat3, Vec3};

use crate::math::float;
use crate::spectrum::Spectrum;

/// A rotation that lines up with nothing: the rows of points of a lattice would otherwise be
/// parallel to the faces of boxes, which then cut off whole layers at once.
const TWIST: Mat3 = Mat3::from_cols(
    Vec3::new(0.667_027_88, 0.650_773_32, -0.362_722_88),
    Vec3::new(-0.448_625_75, 0.739_533_05, 0.501_822_48),
    Vec3::new(0.594_818_24, -0.172_002_76, 0.785_242_83),
);

/// Mean of `f` over the ball around `centre` of `radius` (m).
///
/// Points of equal weight on a twisted cubic lattice, `per_axis` (even, at least 4) of them across
/// the ball: 32, 136, 280, 544 points in all for 4, 6, 8, 10. Scaled so that the mean is exact for
/// quadratic fields.
pub(super) fn mean(centre: Vec3, radius: f32, per_axis: u32, f: impl Fn(Vec3) -> Spectrum) -> Spectrum {
    let half = per_axis.clamp(4, MAX_PER_AXIS) / 2;
    let limit = 4 * half * half;
    let squared = |i: u32, j: u32, k: u32| [i, j, k].map(|n| (2 * n + 1) * (2 * n + 1)).iter().sum::<u32>();
    let octant = || (0..half * half * half).map(move |n| (n / (half * half), n / half % half, n % half));
    let (mut count, mut second) = (0_u32, 0_u32);
    for (i, j, k) in octant() {
        let r = squared(i, j, k);
        if r <= limit {
            count += 1;
            second += r;
        }
    }
    // <r²> over the unit ball is 3/5.
    let scale = radius * float::sqrt(0.6 * count as f32 / second as f32);
    let mut sum = Spectrum::ZERO;
    for (i, j, k) in octant() {
        if squared(i, j, k) > limit {
            continue;
        }
        let corner = Vec3::new((2 * i + 1) as f32, (2 * j + 1) as f32, (2 * k + 1) as f32) * scale;
        for signs in 0..8_u32 {
            let flip = |bit: u32, v: f32| if signs >> bit & 1 == 0 { v } else { -v };
            sum += f(centre + TWIST * Vec3::new(flip(0, corner.x), flip(1, corner.y), flip(2, corner.z)));
        }
    }
    sum / (8 * count) as f32
}

/// Most points across a ball: about 900 lookups.
pub(super) const MAX_PER_AXIS: u32 = 12;
