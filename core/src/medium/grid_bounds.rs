//! Bounds of a voxel grid along a ray.

use core::marker::PhantomData;

use super::DensityGrid;
use super::joining::{Found, Joining, Range, Span};
use super::majorant::{BlockSpan, Entry, Field, MinMax, Walk};
use super::region::LocalLine;
use crate::host::MajorantSegment;
use crate::math::Ray;
use crate::spectrum::Spectrum;

/// Bounds of all densities of a grid, or of its one density: most grids have no other, and asking for segments is a quarter of
/// the time of rays through smoke.
trait DensityBounds: Range {
    fn of(grid: &DensityGrid<'_>, block: Option<usize>) -> Self;
    fn all(&self) -> FieldBounds;
}

impl DensityBounds for MinMax {
    #[inline(always)]
    fn of(grid: &DensityGrid<'_>, block: Option<usize>) -> Self {
        grid.density.bounds(block)
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
    fn all(&self) -> FieldBounds {
        *self
    }
}

impl Range for FieldBounds {
    #[inline]
    fn union(&self, other: &Self) -> Self {
        Self {
            density: self.density.union(&other.density),
            absorption: self.absorption.union(&other.absorption),
            emission: self.emission.union(&other.emission),
        }
    }

    #[inline]
    fn is_constant(&self) -> bool {
        [self.density, self.absorption, self.emission].iter().all(Range::is_constant)
    }

    #[inline]
    fn is_empty(&self) -> bool {
        self.density.max == 0.0 && self.absorption.max == 0.0 && self.emission.max == 0.0
    }
}

/// The blocks along a ray, with their bounds. No closure, for a compiler leaves one that is called from two places where it is.
struct Blocks<'g, 'a, B> {
    grid: &'g DensityGrid<'a>,
    walk: Walk,
    bounds: PhantomData<B>,
}

impl<B: DensityBounds> Iterator for Blocks<'_, '_, B> {
    type Item = Span<B>;

    #[inline(always)]
    fn next(&mut self) -> Option<Span<B>> {
        let BlockSpan { block, begin, end } = self.walk.next()?;
        Some(Span { bounds: B::of(self.grid, Some(block)), begin, end })
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
        let walk = match Walk::enter(&line, self.size, from, origin, &self.reach) {
            Entry::Miss => return MajorantSegment::vacuum(f32::INFINITY),
            Entry::Coarse(near, _) if near > from => return MajorantSegment::vacuum(near),
            Entry::Coarse(_, far) => return self.segment_of(&B::of(self, None).all(), far),
            Entry::Blocks(walk) => walk,
        };
        let blocks = Blocks::<B> { grid: self, walk, bounds: PhantomData };
        let found = joining.join(ray, from, self.resolution, blocks, |bounds| self.thickest(&bounds.all()));
        match found {
            Found::Vacuum(until) => MajorantSegment::vacuum(until),
            Found::Matter(bounds, until) => self.segment_of(&bounds.all(), until),
        }
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
