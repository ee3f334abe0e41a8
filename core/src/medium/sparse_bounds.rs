//! Bounds of a sparse grid along a ray.

use glam::Vec3;

use super::SparseGrid;
use super::bricks::{BRICK, Bricks, NODE, gap};
use super::grid_bounds::{ENOUGH, SHORT, WASTE};
use super::majorant::MinMax;
use super::region::{LocalLine, lesser};
use crate::host::MajorantSegment;
use crate::math::Ray;

pub(super) use super::grid_bounds::Joining;

/// The part of a line in one brick, or in a larger cube of them with nothing in it.
#[derive(Debug, Clone, Copy)]
struct Span {
    bounds: MinMax,
    /// Distances (m) between which it lies there; the second is greater.
    begin: f32,
    end: f32,
}

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
    fn next(&mut self, table: &Bricks<'_>, bounds: &[MinMax]) -> Option<Span> {
        let (origin, direction, inverse) =
            (self.line.origin.to_array(), self.line.direction.to_array(), self.line.inverse.to_array());
        while !self.is_over {
            let brick = self.at.map(|c| c as u32);
            let (step, found) = match table.slot(brick).and_then(|slot| bounds.get(slot)) {
                Some(bounds) if bounds.max > 0.0 => (1, *bounds),
                Some(nothing) => (gap(nothing), MinMax::default()),
                None => (NODE as i32, MinMax::default()),
            };
            // What ends where: the first brick that is not in it any more, and the distance to the face between.
            let mut behind = [0; 3];
            let mut exits = [0.0; 3];
            for axis in 0..3 {
                let first = self.at[axis] / step * step;
                let is_forward = direction[axis] > 0.0;
                let (face, next) = if is_forward { (first + step, first + step) } else { (first, first - 1) };
                // The last brick may be cut short, but nothing is in what lies beyond.
                let plane = (face.min(self.bricks[axis]) * BRICK as i32) as f32;
                behind[axis] = next;
                exits[axis] = (plane - origin[axis]) * inverse[axis];
            }
            let end = lesser(lesser(exits[0], exits[1]), exits[2]);
            let is_known = end == exits[0] || end == exits[1] || end == exits[2];
            for axis in 0..3 {
                if exits[axis] == end {
                    self.at[axis] = behind[axis];
                } else if step > 1 {
                    // Where in the node it is left; rounding must not lead out of it, nor back.
                    let first = self.at[axis] / step * step;
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
        let mut next = || walk.next(&self.bricks, self.bounds);
        let (mut found, mut until) = loop {
            let Some(span) = next() else { return MajorantSegment::vacuum(f32::INFINITY) };
            if span.bounds.max > 0.0 {
                if span.begin > from {
                    return MajorantSegment::vacuum(span.begin);
                }
                break (span.bounds, span.end);
            }
            if span.end > ray.length {
                return MajorantSegment::vacuum(span.end);
            }
        };
        let most = self.extinction.max_element();
        let is_constant = found.min == found.max;
        let mut thickness = most * found.max * (until - from);
        while until < ray.length && (is_constant || joining == Joining::Loose || thickness < ENOUGH) {
            let Some(span) = next() else { break };
            let is_same = span.bounds.min == span.bounds.max;
            let joined = found.union(span.bounds);
            if is_constant {
                if joined != found {
                    break;
                }
            } else if joining == Joining::Loose {
                if is_same && span.end - span.begin > SHORT * self.resolution {
                    break;
                }
            } else {
                thickness += most * span.bounds.max * (span.end - until);
                let is_wasteful = most * joined.max * (span.end - from) - thickness > WASTE;
                if is_wasteful || is_same && span.bounds.max > 0.0 {
                    break;
                }
            }
            found = joined;
            until = span.end;
        }
        self.segment_of(found, until)
    }

    #[inline]
    fn segment_of(&self, bounds: MinMax, until: f32) -> MajorantSegment {
        MajorantSegment { until, minorant: self.extinction * bounds.min, majorant: self.extinction * bounds.max }
    }
}
