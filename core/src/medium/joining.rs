//! Bounds of parts of a ray, one after the other, become those of a segment.

use super::majorant::MinMax;
use crate::math::{Ray, float};

/// Expected null collisions a joined segment may add over its parts by themselves: asking for a
/// segment costs some three collisions. With 0 a ray through thin smoke takes twice the time; with
/// more, the bounds of thick clouds get loose.
const WASTE: f32 = 1.0;

/// Majorant thickness of a segment at which no more is joined: a walk has most likely ended by then.
const ENOUGH: f32 = 2.0;

/// Constant parts that a ray crosses on fewer cells than this are marched with those around them.
const SHORT: f32 = 4.0;

/// What bounds are for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Joining {
    /// Tracking: no looser than asking again is dear.
    Tight,
    /// Marching: only where it ends counts.
    Loose,
}

/// Bounds of the densities that make up a medium.
pub(super) trait Range: Copy + PartialEq {
    /// Bounds of both.
    fn union(&self, other: &Self) -> Self;
    /// Whether lower and upper bounds are the same.
    fn is_constant(&self) -> bool;
    /// Whether there is nothing.
    fn is_empty(&self) -> bool;
}

impl Range for MinMax {
    #[inline(always)]
    fn union(&self, other: &Self) -> Self {
        Self { min: float::min(self.min, other.min), max: float::max(self.max, other.max) }
    }

    #[inline(always)]
    fn is_constant(&self) -> bool {
        self.min == self.max
    }

    #[inline(always)]
    fn is_empty(&self) -> bool {
        self.max == 0.0
    }
}

/// A part of a ray, and what is known there.
#[derive(Debug, Clone, Copy)]
pub(super) struct Span<B> {
    pub(super) bounds: B,
    /// Distances (m) between which it lies; the second is greater.
    pub(super) begin: f32,
    pub(super) end: f32,
}

/// What a ray finds first.
#[derive(Debug, Clone, Copy)]
pub(super) enum Found<B> {
    /// Nothing, up to a distance (m).
    Vacuum(f32),
    /// Something within bounds, up to a distance (m).
    Matter(B, f32),
}

impl Joining {
    /// From distance `from` (m) along `ray` on, of parts that follow each other there. `thickest` tells the largest extinction (m⁻¹) of bounds;
    /// `cell` is the size (m) of what varies.
    #[inline(always)]
    pub(super) fn join<B: Range>(
        self,
        ray: &Ray,
        from: f32,
        cell: f32,
        mut parts: impl Iterator<Item = Span<B>>,
        thickest: impl Fn(&B) -> f32,
    ) -> Found<B> {
        let (mut found, mut until) = loop {
            let Some(span) = parts.next() else { return Found::Vacuum(f32::INFINITY) };
            if !span.bounds.is_empty() {
                if span.begin > from {
                    return Found::Vacuum(span.begin);
                }
                break (span.bounds, span.end);
            }
            if span.end > ray.length {
                return Found::Vacuum(span.end);
            }
        };
        let is_constant = found.is_constant();
        let mut thickness = thickest(&found) * (until - from);
        while until < ray.length && (is_constant || self == Self::Loose || thickness < ENOUGH) {
            let Some(span) = parts.next() else { break };
            let bounds = span.bounds;
            let joined = found.union(&bounds);
            if is_constant {
                if joined != found {
                    break;
                }
            } else if self == Self::Loose {
                if bounds.is_constant() && span.end - span.begin > SHORT * cell {
                    break;
                }
            } else {
                thickness += thickest(&bounds) * (span.end - until);
                let is_wasteful = thickest(&joined) * (span.end - from) - thickness > WASTE;
                if is_wasteful || bounds.is_constant() && !bounds.is_empty() {
                    break;
                }
            }
            found = joined;
            until = span.end;
        }
        Found::Matter(found, until)
    }
}
