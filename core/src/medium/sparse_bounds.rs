//! Bounds of a sparse grid along a ray.

use glam::Vec3;

use super::SparseGrid;
use super::bricks::{BRICK, Bricks, NODE, NodeBounds};
use super::joining::{Found, Joining, Span};
use super::majorant::MinMax;
use super::region::LocalLine;
use crate::host::MajorantSegment;
use crate::math::{Ray, float};

/// A walk through bricks along a line, and in one step through gaps and through nodes that are not there; every distance is computed from the origin,
/// since a sum of steps would drift.
#[derive(Debug)]
struct Walk<'w> {
    line: &'w LocalLine,
    /// Where the line is, in bricks.
    at: [i32; 3],
    /// Bricks of the box.
    bricks: [i32; 3],
    t: f32,
    is_over: bool,
}

impl<'w> Walk<'w> {
    fn new(line: &'w LocalLine, start: Vec3, size: [u32; 3], t: f32) -> Self {
        let bricks = size.map(|n| n.div_ceil(BRICK) as i32);
        let start = start.to_array();
        let at = core::array::from_fn(|axis| ((start[axis] * (1.0 / BRICK as f32)) as i32).clamp(0, bricks[axis] - 1));
        Self { line, at, bricks, t, is_over: false }
    }

    /// The next part in which the line has a length; `None` beyond the last.
    #[inline]
    fn next(&mut self, table: &Bricks<'_>, bounds: &[NodeBounds]) -> Option<Span<MinMax>> {
        let (origin, direction, inverse) =
            (self.line.origin.to_array(), self.line.direction.to_array(), self.line.inverse.to_array());
        while !self.is_over {
            let brick = self.at.map(|c| c as u32);
            let node = table.node(brick.map(|c| c / NODE)).and_then(|node| bounds.get(node));
            let (step, found) = match node.map(|node| (node, node.gap(brick))) {
                Some((node, 0)) => (1, node.bounds(brick)),
                Some((_, gap)) => (gap as i32, MinMax::default()),
                None => (NODE as i32, MinMax::default()),
            };
            // What ends where: the first brick that is not in it any more, and the distance to the face between. Edges of gaps are
            // powers of two, and a mask takes a tenth of the time of a division.
            let aligned = !(step - 1);
            let mut behind = [0; 3];
            let mut exits = [0.0; 3];
            for axis in 0..3 {
                let first = self.at[axis] & aligned;
                let is_forward = direction[axis] > 0.0;
                let (face, next) = if is_forward { (first + step, first + step) } else { (first, first - 1) };
                // The last brick may be cut short, but nothing is in what lies beyond.
                let plane = (face.min(self.bricks[axis]) * BRICK as i32) as f32;
                behind[axis] = next;
                exits[axis] = (plane - origin[axis]) * inverse[axis];
            }
            let end = float::min(float::min(exits[0], exits[1]), exits[2]);
            let is_known = end == exits[0] || end == exits[1] || end == exits[2];
            for axis in 0..3 {
                if exits[axis] == end {
                    self.at[axis] = behind[axis];
                } else if step > 1 {
                    // Where in the node it is left; rounding must not lead out of it, nor back.
                    let first = self.at[axis] & aligned;
                    let place = ((origin[axis] + direction[axis] * end) * (1.0 / BRICK as f32)) as i32;
                    let (low, high) =
                        if direction[axis] > 0.0 { (self.at[axis], first + step - 1) } else { (first, self.at[axis]) };
                    self.at[axis] = place.clamp(low, high);
                }
            }
            // Where distances are no numbers, none is passed.
            self.is_over = !is_known || (0..3).any(|axis| self.at[axis] < 0 || self.at[axis] >= self.bricks[axis]);
            let begin = self.t;
            // Where rounding makes a part shorter than nothing, there is no distance to speak of.
            if end > begin {
                self.t = end;
                return Some(Span { bounds: found, begin, end });
            }
        }
        None
    }
}

impl SparseGrid<'_> {
    /// See [`Medium::majorant_segment`](crate::host::Medium::majorant_segment) and
    /// [`Medium::marching_segment`](crate::host::Medium::marching_segment): joined as those of a
    /// [`DensityGrid`](super::DensityGrid) are.
    pub(super) fn joined_segment(&self, ray: &Ray, from: f32, joining: Joining) -> MajorantSegment {
        let line = LocalLine::new(&self.cells_from_world, ray);
        let size = Vec3::from_array(self.bricks.size.map(|n| n as f32));
        let Some((near, far)) = line.slabs(size).interval() else { return MajorantSegment::vacuum(f32::INFINITY) };
        if far <= from {
            return MajorantSegment::vacuum(f32::INFINITY);
        }
        let start = near.max(from);
        if !self.reach.holds(ray.origin.abs().max_element() + start) {
            // Positions are too coarse to tell bricks apart.
            return if near > from { MajorantSegment::vacuum(near) } else { self.segment_of(self.whole, far) };
        }
        let mut walk = Walk::new(&line, line.origin + line.direction * start, self.bricks.size, start);
        let bricks = core::iter::from_fn(|| walk.next(&self.bricks, self.bounds));
        let most = self.extinction.max_element();
        match joining.join(ray, from, self.resolution, bricks, |bounds: &MinMax| most * bounds.max) {
            Found::Vacuum(until) => MajorantSegment::vacuum(until),
            Found::Matter(bounds, until) => self.segment_of(bounds, until),
        }
    }

    #[inline]
    fn segment_of(&self, bounds: MinMax, until: f32) -> MajorantSegment {
        MajorantSegment { until, minorant: self.extinction * bounds.min, majorant: self.extinction * bounds.max }
    }
}
