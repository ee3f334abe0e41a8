//! Bounds of a voxel grid along a ray.

use super::DensityGrid;
use super::majorant::{Entry, Field, MinMax, Walk};
use super::region::LocalLine;
use crate::host::MajorantSegment;
use crate::math::Ray;
use crate::spectrum::Spectrum;

/// Expected null collisions a joined segment may add over its blocks by themselves: asking for a
/// segment costs some three collisions. With 0 a ray through thin smoke takes twice the time; with
/// more, the bounds of thick clouds get loose.
pub(super) const WASTE: f32 = 1.0;

/// Majorant thickness of a segment at which no more is joined: a walk has most likely ended by then.
pub(super) const ENOUGH: f32 = 2.0;

/// Constant blocks that a ray crosses on fewer cells than this are marched with those around them.
pub(super) const SHORT: f32 = 4.0;

/// What bounds are for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Joining {
    /// Tracking: no looser than asking again is dear.
    Tight,
    /// Marching: only where it ends counts.
    Loose,
}

/// Bounds of all densities of a grid, or of its one density: most grids have no other, and asking for segments is a quarter of
/// the time of rays through smoke.
trait DensityBounds: Copy + PartialEq {
    fn of(grid: &DensityGrid<'_>, block: Option<usize>) -> Self;
    fn union(&self, other: &Self) -> Self;
    fn is_constant(&self) -> bool;
    fn is_empty(&self) -> bool;
    fn all(&self) -> FieldBounds;
}

impl DensityBounds for MinMax {
    #[inline(always)]
    fn of(grid: &DensityGrid<'_>, block: Option<usize>) -> Self {
        grid.density.bounds(block)
    }

    #[inline(always)]
    fn union(&self, other: &Self) -> Self {
        MinMax::union(*self, *other)
    }

    #[inline(always)]
    fn is_constant(&self) -> bool {
        self.min == self.max
    }

    #[inline(always)]
    fn is_empty(&self) -> bool {
        self.max == 0.0
    }

    #[inline(always)]
    fn all(&self) -> FieldBounds {
        FieldBounds { density: *self, absorption: *self, emission: *self }
    }
}

/// Bounds of the densities of a grid; those without a field repeat the first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FieldBounds {
    density: MinMax,
    absorption: MinMax,
    emission: MinMax,
}

impl DensityBounds for FieldBounds {
    #[inline]
    fn of(grid: &DensityGrid<'_>, block: Option<usize>) -> Self {
        let density = grid.density.bounds(block);
        let of = |field: &Option<Field<'_>>| field.as_ref().map_or(density, |f| f.bounds(block));
        Self { density, absorption: of(&grid.absorption_density), emission: of(&grid.emission_density) }
    }

    #[inline]
    fn union(&self, other: &Self) -> Self {
        Self {
            density: self.density.union(other.density),
            absorption: self.absorption.union(other.absorption),
            emission: self.emission.union(other.emission),
        }
    }

    #[inline]
    fn is_constant(&self) -> bool {
        [self.density, self.absorption, self.emission].iter().all(|b| b.min == b.max)
    }

    #[inline]
    fn is_empty(&self) -> bool {
        self.density.max == 0.0 && self.absorption.max == 0.0 && self.emission.max == 0.0
    }

    #[inline]
    fn all(&self) -> FieldBounds {
        *self
    }
}

impl DensityGrid<'_> {
    /// See [`Medium::majorant_segment`](crate::host::Medium::majorant_segment) and
    /// [`Medium::marching_segment`](crate::host::Medium::marching_segment) of a grid.
    #[inline]
    pub(super) fn joined_segment(&self, ray: &Ray, from: f32, joining: Joining) -> MajorantSegment {
        if self.absorption_density.is_none() && self.emission_density.is_none() {
            self.joined::<MinMax>(ray, from, joining)
        } else {
            self.joined::<FieldBounds>(ray, from, joining)
        }
    }

    #[inline]
    fn joined<B: DensityBounds>(&self, ray: &Ray, from: f32, joining: Joining) -> MajorantSegment {
        let line = LocalLine::new(&self.cells_from_world, ray);
        let origin = ray.origin.abs().max_element();
        let mut walk = match Walk::enter(&line, self.size, from, origin, &self.reach) {
            Entry::Miss => return MajorantSegment::vacuum(f32::INFINITY),
            Entry::Coarse(near, _) if near > from => return MajorantSegment::vacuum(near),
            Entry::Coarse(_, far) => return self.segment_of(&B::of(self, None).all(), far),
            Entry::Blocks(walk) => walk,
        };
        let (mut found, mut until) = loop {
            let Some(span) = walk.next() else { return MajorantSegment::vacuum(f32::INFINITY) };
            let bounds = B::of(self, Some(span.block));
            if !bounds.is_empty() {
                if span.begin > from {
                    return MajorantSegment::vacuum(span.begin);
                }
                break (bounds, span.end);
            }
            if span.end > ray.length {
                return MajorantSegment::vacuum(span.end);
            }
        };
        let is_constant = found.is_constant();
        let mut thickness = self.thickest(&found.all()) * (until - from);
        while until < ray.length && (is_constant || joining == Joining::Loose || thickness < ENOUGH) {
            let Some(span) = walk.next() else { break };
            let bounds = B::of(self, Some(span.block));
            let joined = found.union(&bounds);
            if is_constant {
                if joined != found {
                    break;
                }
            } else if joining == Joining::Loose {
                if bounds.is_constant() && span.end - span.begin > SHORT * self.resolution {
                    break;
                }
                found = joined;
            } else {
                let higher = self.thickest(&joined.all());
                thickness += self.thickest(&bounds.all()) * (span.end - until);
                let is_wasteful = higher * (span.end - from) - thickness > WASTE;
                if is_wasteful || bounds.is_constant() && !bounds.is_empty() {
                    break;
                }
                found = joined;
            }
            until = span.end;
        }
        self.segment_of(&found.all(), until)
    }

    /// Bounds of every density in a block, or in the whole grid.
    #[inline]
    pub(super) fn bounds(&self, block: Option<usize>) -> FieldBounds {
        FieldBounds::of(self, block)
    }

    /// Upper bound of extinction (m⁻¹) in any channel.
    #[inline]
    fn thickest(&self, bounds: &FieldBounds) -> f32 {
        self.thickest.0 * bounds.density.max + self.thickest.1 * bounds.absorption.max
    }

    #[inline]
    pub(super) fn segment_of(&self, bounds: &FieldBounds, until: f32) -> MajorantSegment {
        let sum = |s: f32, a: f32| match self.absorption_density {
            // Rounded as in a lookup.
            None => (self.absorption + self.scattering) * s,
            Some(_) => self.scattering * s + self.absorption * a,
        };
        let minorant = sum(bounds.density.min, bounds.absorption.min);
        let majorant = sum(bounds.density.max, bounds.absorption.max);
        let mut segment = MajorantSegment { until, minorant, majorant };
        if segment.is_constant() {
            self.keep_promises(bounds, &mut segment);
        }
        segment
    }

    /// Equal bounds promise that everything is constant: not so where only emission, or the two
    /// parts of extinction in a sum that rounding makes constant, vary.
    #[cold]
    fn keep_promises(&self, bounds: &FieldBounds, segment: &mut MajorantSegment) {
        let is_constant = |bounds: MinMax, coefficient: Spectrum| coefficient.is_black() || bounds.min == bounds.max;
        let emits = !self.emission.is_black() && bounds.emission.max > 0.0;
        let holds = is_constant(bounds.density, self.scattering)
            && is_constant(bounds.absorption, self.absorption)
            && is_constant(bounds.emission, self.emission)
            && !(emits && segment.majorant.is_black());
        if !holds {
            segment.majorant = segment.majorant.map(|c| c.max(f32::MIN_POSITIVE) * (1.0 + 2.0 * f32::EPSILON));
        }
    }
}
