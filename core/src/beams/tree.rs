//! A tree of boxes around pieces.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::Piece;
use crate::math::{Bounds, Ray};
use crate::storage::{Full, List};

/// Pieces of a leaf at most. Larger: more pieces are looked at. Smaller: more boxes.
const LEAF: usize = 4;

/// Levels at most: pieces are halved by number, so 2³² of them have 32.
pub(super) const DEPTH: usize = 33;

/// A box around pieces and their blur.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct BeamNode {
    /// Smallest corner (m).
    min: Vec3,
    /// The second child (the first follows its parent), or the first piece.
    next: u32,
    /// Largest corner (m).
    max: Vec3,
    /// Number of pieces; 0 for an inner node.
    count: u32,
}

impl BeamNode {
    pub(super) fn bounds(&self) -> Bounds {
        Bounds { min: self.min, max: self.max }
    }
}

/// Sorts `pieces` and writes the tree over them, the root first.
pub(super) fn build(pieces: &mut [Piece], nodes: &mut List<'_, BeamNode>) -> Result<(), Full> {
    nodes.clear();
    if pieces.is_empty() { Ok(()) } else { divide(pieces, 0, nodes) }
}

fn divide(pieces: &mut [Piece], first: usize, nodes: &mut List<'_, BeamNode>) -> Result<(), Full> {
    let (mut min, mut max) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let (mut low, mut high) = (min, max);
    for piece in pieces.iter() {
        let (a, b) = (piece.origin, piece.end());
        min = min.min(a.min(b) - piece.radius);
        max = max.max(a.max(b) + piece.radius);
        low = low.min(a + b);
        high = high.max(a + b);
    }
    let number = |n: usize| u32::try_from(n).map_err(|_| Full);
    let node = nodes.as_slice().len();
    if pieces.len() <= LEAF {
        return nodes.push(BeamNode { min, next: number(first)?, max, count: pieces.len() as u32 });
    }
    nodes.push(BeamNode { min, next: 0, max, count: 0 })?;
    let spread = high - low;
    let axis = if spread.x >= spread.max_element() {
        0
    } else if spread.y >= spread.z {
        1
    } else {
        2
    };
    let middle = pieces.len() / 2;
    let key = |piece: &Piece| piece.origin[axis] + piece.end()[axis];
    pieces.select_nth_unstable_by(middle, |a, b| key(a).total_cmp(&key(b)));
    let (left, right) = pieces.split_at_mut(middle);
    divide(left, first, nodes)?;
    let second = number(nodes.as_slice().len())?;
    nodes.as_mut_slice()[node].next = second;
    divide(right, first + middle, nodes)
}

/// Calls `visit` for every piece whose leaf `ray` meets, always in the same order.
#[inline]
pub(super) fn visit<'p>(nodes: &[BeamNode], pieces: &'p [Piece], ray: &Ray, mut visit: impl FnMut(&'p Piece)) {
    if nodes.is_empty() {
        return;
    }
    let inverse = ray.direction.map(|d| 1.0 / d);
    let mut stack = [0_u32; DEPTH];
    let mut top = 1;
    while top > 0 {
        top -= 1;
        let mut index = stack[top] as usize;
        loop {
            let node = &nodes[index];
            if !meets(node, ray, inverse) {
                break;
            }
            if node.count > 0 {
                for piece in &pieces[node.next as usize..][..node.count as usize] {
                    visit(piece);
                }
                break;
            }
            stack[top] = node.next;
            top += 1;
            index += 1;
        }
    }
}

/// Whether the ray comes into the box.
#[inline]
fn meets(node: &BeamNode, ray: &Ray, inverse: Vec3) -> bool {
    let a = (node.min - ray.origin) * inverse;
    let b = (node.max - ray.origin) * inverse;
    // A ray within a face makes 0·∞ = NaN and may miss the box; but then it is just as far from all
    // pieces as the blur reaches.
    let (mut near, mut far) = (0.0_f32, ray.length);
    for axis in 0..3 {
        near = near.max(a[axis].min(b[axis]));
        far = far.min(a[axis].max(b[axis]));
    }
    near <= far
}
