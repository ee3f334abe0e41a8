//! A cache of either sort, as filling needs it.

use super::guide::Guide;
use super::kind::Kind;
use super::lookup::{Basis, Reading};
use super::radius::clamp_gradient;
use super::record::MAX_STRIDE;
use super::store::{Cache, InsertError};
use super::{Attachment, Facing, Place, Record, SurfaceCache, VolumeCache};
use crate::math::Vec3;
use crate::sh::Coefficient;
use crate::single_scatter::Sums;
use crate::spectrum::Spectrum;

/// A cache of one kind.
#[derive(Debug)]
pub(super) enum Slot<'s> {
    /// The kind is not used.
    Off,
    Volume(VolumeCache<'s>),
    Surface(SurfaceCache<'s>),
}

/// What is attached to one estimate.
#[derive(Debug, Clone, Copy)]
pub(super) enum Attached<'a> {
    Higher(&'a [Coefficient]),
    Facing(Facing),
}

impl<'s> Slot<'s> {
    pub(super) fn is_off(&self) -> bool {
        matches!(self, Self::Off)
    }

    pub(super) fn volume(&self) -> Option<&VolumeCache<'s>> {
        match self {
            Self::Volume(cache) => Some(cache),
            Self::Off | Self::Surface(_) => None,
        }
    }

    pub(super) fn surface(&self) -> Option<&SurfaceCache<'s>> {
        match self {
            Self::Surface(cache) => Some(cache),
            Self::Off | Self::Volume(_) => None,
        }
    }

    pub(super) fn records(&self) -> &[Record] {
        match self {
            Self::Off => &[],
            Self::Volume(cache) => cache.records(),
            Self::Surface(cache) => cache.records(),
        }
    }

    pub(super) fn len(&self) -> usize {
        self.records().len()
    }

    pub(super) fn bytes(&self) -> usize {
        match self {
            Self::Off => 0,
            Self::Volume(cache) => cache.bytes(),
            Self::Surface(cache) => cache.bytes(),
        }
    }

    /// Attachments of a record.
    pub(super) fn stride(&self) -> usize {
        match self {
            Self::Off => 0,
            Self::Volume(cache) => cache.stride(),
            Self::Surface(cache) => cache.stride(),
        }
    }

    /// Whether a place has a record, or no such cache could have one there.
    pub(super) fn covers(&self, place: &Place, reading: &Reading) -> bool {
        match (self, place.normal) {
            (Self::Volume(cache), None) => cache.covers_towards(place.point, place.to_eye, reading),
            (Self::Surface(cache), Some(normal)) => cache.covers(place.point, normal, reading),
            _ => true,
        }
    }

    /// Highest degree of expansions.
    pub(super) fn degree(&self) -> usize {
        self.volume().map_or(0, VolumeCache::degree)
    }

    /// What is told of a place, in the medium in the direction of `basis`.
    pub(super) fn lookup(&self, place: &Place, basis: &Basis, reading: &Reading) -> Option<Spectrum> {
        match (self, place.normal) {
            (Self::Volume(cache), None) => cache.lookup(place.point, basis, reading),
            (Self::Surface(cache), Some(normal)) => cache.lookup(place.point, normal, reading),
            _ => None,
        }
    }

    /// Calls `visit(number, weight)` for records of a volume as [`Slot::lookup`] mixes them at a point, and for all of surfaces that reach it, whatever their normals.
    pub(super) fn visit_read(&self, point: Vec3, basis: &Basis, reading: &Reading, visit: &mut dyn FnMut(usize, f32)) {
        match self {
            Self::Volume(cache) => cache.visit_mixed(point, basis, reading, visit),
            _ => self.visit(point, visit),
        }
    }

    /// What a record tells of its own place, in the direction of `basis`.
    pub(super) fn told_by(&self, number: usize, basis: &Basis) -> Option<Spectrum> {
        let value = self.records().get(number)?.value;
        Some(match self {
            Self::Volume(cache) => basis.expanded(value, cache.attached(number as u32)),
            Self::Off | Self::Surface(_) => value,
        })
    }

    /// About how large the radius of a record at a point would be.
    pub(super) fn radius_near(&self, point: Vec3) -> Option<f32> {
        match self {
            Self::Off => None,
            Self::Volume(cache) => cache.radius_near(point),
            Self::Surface(cache) => cache.radius_near(point),
        }
    }

    /// Where a record is.
    pub(super) fn place(&self, number: usize) -> Option<Place> {
        let point = self.records().get(number)?.position;
        Some(match self {
            Self::Surface(cache) => {
                let normal = cache.attached(number as u32).first().map(|facing| facing.normal);
                Place { point, normal, share: 1.0, ..Place::default() }
            }
            Self::Off => Place { point, is_seen: true, share: 1.0, ..Place::default() },
            Self::Volume(cache) => {
                let to_eye = cache.to_eye(number as u32);
                Place { point, is_seen: true, share: 1.0, to_eye, ..Place::default() }
            }
        })
    }

    /// Calls `visit(number, weight)` for the records that reach `point`.
    pub(super) fn visit(&self, point: Vec3, visit: &mut dyn FnMut(usize, f32)) {
        let mut each = |number: u32, _: &Record, share: f32| visit(number as usize, 1.0 - share);
        match self {
            Self::Off => {}
            Self::Volume(cache) => cache.visit(point, &mut each),
            Self::Surface(cache) => cache.visit(point, &mut each),
        }
    }

    /// Calls `visit(number)` for the records that reach `point`, or would if they reached twice as far.
    pub(super) fn visit_wide(&self, point: Vec3, visit: &mut dyn FnMut(usize)) {
        let mut each = |number: u32, _: &Record, _| visit(number as usize);
        match self {
            Self::Off => {}
            Self::Volume(cache) => cache.visit_wide(point, &mut each),
            Self::Surface(cache) => cache.visit_wide(point, &mut each),
        }
    }

    /// What [`Slot::insert`] has done.
    pub(super) fn insert(&mut self, record: Record, attached: Attached<'_>) -> Inserted {
        let result = match (self, attached) {
            (Self::Volume(cache), Attached::Higher(higher)) => cache.insert(record, higher),
            (Self::Surface(cache), Attached::Facing(facing)) => cache.insert(record, &[facing]),
            // Lent memory was too small for the estimate.
            _ => Err(InsertError::Full),
        };
        match result {
            Ok(()) => Inserted::Added,
            Err(error) if error.is_invalid() => Inserted::LeftOut,
            Err(_) => Inserted::Full,
        }
    }

    /// Mixes a new estimate, of which the share `share` stays, into a record. `tolerance` is that of its radius.
    pub(super) fn blend(&mut self, number: usize, tolerance: f32, sums: &Sums, new: Attached<'_>, share: f32) {
        let Some(&record) = self.records().get(number) else { return };
        // Within its radius a record changes by a factor of e to the tolerance at most.
        let gradient = clamp_gradient(&sums.gradient, sums.value, record.radius / tolerance);
        let value = sums.value * share + record.value * (1.0 - share);
        let gradient = gradient * share + record.gradient * (1.0 - share);
        let mix = |a: Spectrum, b: Spectrum| a * share + b * (1.0 - share);
        match (self, new) {
            (Self::Volume(cache), Attached::Higher(higher)) => {
                let mut mixed = [Coefficient::ZERO; MAX_STRIDE];
                let stride = higher.len().min(mixed.len());
                for ((mixed, new), old) in mixed.iter_mut().zip(higher).zip(cache.attached(number as u32)) {
                    mixed.value = mix(new.value, old.value);
                    mixed.gradient = new.gradient * share + old.gradient * (1.0 - share);
                }
                // An estimate that is no number leaves the record as it is.
                let _ = cache.revise(number as u32, value, &gradient, &mixed[..stride]);
            }
            (Self::Surface(cache), Attached::Facing(mut facing)) => {
                if let Some(old) = cache.attached(number as u32).first() {
                    facing.turn = facing.turn * share + old.turn * (1.0 - share);
                }
                let _ = cache.revise(number as u32, value, &gradient, &[facing]);
            }
            _ => {}
        }
    }

    /// Takes `sums` in place of what a record on a surface says.
    pub(super) fn revise(&mut self, number: usize, sums: &Sums, new: Attached<'_>) {
        if let (Self::Surface(cache), Attached::Facing(facing)) = (self, new) {
            // What is no number leaves the record as it is.
            let _ = cache.revise(number as u32, sums.value, &sums.gradient, &[facing]);
        }
    }

    /// Makes radii smaller: see [`Cache::shrink`]. Whether the indices have room for them.
    pub(super) fn shrink(&mut self, radius: impl Fn(&Record) -> f32) -> bool {
        match self {
            Self::Off => true,
            Self::Volume(cache) => cache.shrink(radius).is_ok(),
            Self::Surface(cache) => cache.shrink(radius).is_ok(),
        }
    }

    /// Marks the records that reach a point, to be dropped.
    pub(super) fn doubt(&mut self, point: Vec3) {
        match self {
            Self::Off => {}
            Self::Volume(cache) => cache.doubt(point),
            Self::Surface(cache) => cache.doubt(point),
        }
    }

    /// Drops those that were marked; how many of the first `first` are left.
    pub(super) fn drop_doubted(&mut self, first: usize) -> usize {
        match self {
            Self::Off => 0,
            Self::Volume(cache) => cache.drop_doubted(first),
            Self::Surface(cache) => cache.drop_doubted(first),
        }
    }

    /// Forgets all records.
    pub(super) fn clear(&mut self) {
        match self {
            Self::Off => {}
            Self::Volume(cache) => cache.clear(),
            Self::Surface(cache) => cache.clear(),
        }
    }

    /// Brings all records into the indices; whether these have room for them.
    pub(super) fn finish(&mut self) -> bool {
        fn of<E: Attachment>(cache: &mut Cache<'_, E>) -> bool {
            cache.is_finished() || cache.finish().is_ok()
        }
        match self {
            Self::Off => true,
            Self::Volume(cache) => of(cache),
            Self::Surface(cache) => of(cache),
        }
    }
}

/// What became of a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Inserted {
    Added,
    /// It is no number.
    LeftOut,
    /// There is no memory for it.
    Full,
}

/// Caches by kind, and what is the same for one of each.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct ByKind<T>(pub(super) [T; Kind::COUNT]);

impl<T> core::ops::Index<Kind> for ByKind<T> {
    type Output = T;
    fn index(&self, kind: Kind) -> &T {
        &self.0[kind as usize]
    }
}

impl<T> core::ops::IndexMut<Kind> for ByKind<T> {
    fn index_mut(&mut self, kind: Kind) -> &mut T {
        &mut self.0[kind as usize]
    }
}

/// Guides of the records from a number on, those made or estimated anew by the fill at hand, that reach a point: the nearer, the more they count.
pub(super) fn learnt_near(slot: &Slot<'_>, guides: &[Guide], from: usize, point: Vec3) -> Guide {
    let mut around = Guide::default();
    slot.visit(point, &mut |number, weight| {
        if let Some(guide) = number.checked_sub(from).and_then(|i| guides.get(i)) {
            around.merge(guide, weight);
        }
    });
    around
}

/// As [`learnt_near`] of those within twice their radius, which count alike.
///
/// A record that is estimated once more because of what it has met itself is made darker by it, if that was bright; one that missed it stays as dark
/// as it is. So all that might have met it are asked together.
pub(super) fn learnt_around(slot: &Slot<'_>, guides: &[Guide], from: usize, point: Vec3) -> Guide {
    let mut around = Guide::default();
    slot.visit_wide(point, &mut |number| {
        if let Some(guide) = number.checked_sub(from).and_then(|i| guides.get(i)) {
            around.merge(guide, 1.0);
        }
    });
    around
}

#[cfg(all(test, feature = "alloc"))]
mod tests {
    use super::*;
    use crate::cache::lobe::Lobe;
    use crate::spectrum::Gradient;

    /// What one of two records within reach of each other has met is told of both as well, wherever it lies; one far off knows nothing of it.
    #[test]
    fn those_that_might_have_met_the_same_are_asked_together() {
        let mut cache: SurfaceCache = Cache::growing(1);
        let floor = Facing { normal: Vec3::Z, ..Facing::default() };
        let positions = [0.0, 0.15, 5.0].map(|x| Vec3::X * x);
        for position in positions {
            let record = Record { position, radius: 0.1, value: Spectrum::ONE, ..Record::default() };
            cache.insert(record, &[floor]).unwrap();
        }
        cache.finish().unwrap();
        let slot = Slot::Surface(cache);
        let mut guides = [Guide::default(); 3];
        for guide in &mut guides {
            (0..16).for_each(|_| guide.add(Vec3::Z, 1.0, 0.1, 16));
        }
        guides[0].add(Vec3::X, 400.0, 0.1, 16);
        let varies = |learnt: fn(&Slot<'_>, &[Guide], usize, Vec3) -> Guide| {
            positions.map(|position| learnt(&slot, &guides, 0, position).relative_variance())
        };
        let [here, beside, far] = varies(learnt_around);
        assert!(here > 5.0 && here == beside && far == 0.0, "{here} {beside} {far}");
        let [alone, untouched, _] = varies(learnt_near);
        assert!(alone > 5.0 && untouched == 0.0, "{alone} {untouched}");
    }

    /// What a look-up tells is the mean of what the records tell of their own places where their light is even, by the weights that they are visited with:
    /// those that have another eye in mind count less, or nothing.
    #[test]
    fn records_are_weighed_as_they_are_read() {
        let mut cache: VolumeCache = Cache::growing(5);
        let eyes = [Vec3::Z, Vec3::new(0.28, 0.0, 0.96), Vec3::X];
        for (i, (to_eye, value)) in eyes.into_iter().zip([1.0, 3.0, 20.0]).enumerate() {
            let value = Spectrum::splat(value);
            let lobe = Lobe { to_eye, sharpness: 9.0, value, gradient: Gradient::ZERO, turn: Gradient::ZERO };
            let mut attached = [Coefficient::ZERO; 5];
            attached[3..].copy_from_slice(&lobe.attached());
            let position = Vec3::X * (0.02 * i as f32);
            let record = Record { position, radius: 0.1, value: Spectrum::ONE, ..Record::default() };
            cache.insert(record, &attached).unwrap();
        }
        cache.finish().unwrap();
        let (slot, basis, reading) = (Slot::Volume(cache), Basis::new(Vec3::Z, 1), Reading::new(0.5));
        let place = Place { point: Vec3::ZERO, to_eye: Some(Vec3::Z), ..Place::default() };
        let (mut visited, mut sum, mut total) = (0, Spectrum::ZERO, 0.0);
        slot.visit_read(place.point, &basis, &reading, &mut |number, weight| {
            sum += slot.told_by(number, &basis).unwrap() * weight;
            (visited, total) = (visited + 1, total + weight);
        });
        let told = slot.lookup(&place, &basis, &reading).unwrap();
        assert!(visited == 2 && (sum[0] / total - told[0]).abs() < 1e-5, "{visited}: {sum:?} {total} {told:?}");
    }
}
