//! All caches of a world together.

use super::eye::{Caches, Reader, Seen, radiance, radiance_beyond};
use super::kind::Kind;
use super::record::Record;
use super::settings::Settings;
use super::slot::{ByKind, Slot};
use super::{Estimator, SurfaceCache, VolumeCache};
use crate::host::{Medium, Rng, Scene};
use crate::math::Ray;
use crate::storage::List;
use crate::world::World;

/// The caches of a world, by kind. They may be filled again for another view ([`RadianceCaches::fill`]), and then gain
/// what is missing.
#[derive(Debug)]
pub struct RadianceCaches<'s> {
    pub(super) settings: Settings,
    pub(super) slots: ByKind<Slot<'s>>,
    /// Marks of the views that were filled to the end: for them nothing is missing.
    pub(super) views: List<'s, u64>,
    /// Records that no fill will estimate again.
    pub(super) settled: ByKind<usize>,
}

#[cfg(feature = "alloc")]
impl RadianceCaches<'static> {
    /// Empty caches in memory that grows.
    #[must_use]
    pub fn new(settings: Settings) -> Self {
        use crate::sh::coefficient_count;
        let slot = |kind: Kind| match settings.effort(kind) {
            None => Slot::Off,
            Some(_) if kind.is_on_surfaces() => Slot::Surface(SurfaceCache::growing(1)),
            Some(effort) => Slot::Volume(VolumeCache::growing(coefficient_count(effort.degree) - 1)),
        };
        Self { settings, slots: ByKind(Kind::ALL.map(slot)), views: List::default(), settled: ByKind([0; Kind::COUNT]) }
    }
}

impl RadianceCaches<'_> {
    /// What they are filled with.
    #[must_use]
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The records of a kind.
    #[must_use]
    pub fn records(&self, kind: Kind) -> &[Record] {
        self.slots[kind].records()
    }

    /// Bytes of memory that a kind holds.
    #[must_use]
    pub fn bytes(&self, kind: Kind) -> usize {
        self.slots[kind].bytes()
    }

    /// The cache of a kind in the medium, and how it is read.
    #[must_use]
    pub fn volume(&self, kind: Kind) -> Option<Reader<'_, VolumeCache<'_>>> {
        Some(Reader { cache: self.slots[kind].volume()?, reading: self.settings.reading(kind)? })
    }

    /// The cache of a kind on surfaces, and how it is read.
    #[must_use]
    pub fn surface(&self, kind: Kind) -> Option<Reader<'_, SurfaceCache<'_>>> {
        Some(Reader { cache: self.slots[kind].surface()?, reading: self.settings.reading(kind)? })
    }

    /// The caches that pictures are made from.
    #[must_use]
    pub fn reader(&self) -> Caches<'_> {
        Caches {
            single: self.volume(Kind::Single),
            surface: self.volume(Kind::Surface),
            multiple: self.volume(Kind::Multiple),
            irradiance: self.surface(Kind::Irradiance),
        }
    }

    /// An estimator in `world` as eye rays use it: one sample where caches have nothing.
    pub(super) fn estimator<'a, M: ?Sized, S: ?Sized>(&'a self, world: &World<'a, M, S>) -> Estimator<'a, M, S> {
        Estimator {
            world: *world,
            surfaces: self.surface(Kind::Irradiance).map(|reader| (reader.cache, reader.reading)),
            scattered: None,
            walk: self.settings.walk,
            paths: self.settings.paths,
            light_samples: 1,
            finest: self.settings.finest,
        }
    }

    /// Radiance that arrives at the origin of `ray`: a sample of a pixel. See [`radiance`].
    #[must_use]
    pub fn radiance<M: Medium + ?Sized, S: Scene + ?Sized>(
        &self,
        ray: &Ray,
        world: &World<'_, M, S>,
        rng: &mut (impl Rng + ?Sized),
    ) -> Seen {
        radiance(ray, &self.estimator(world), &self.reader(), &self.settings.eye, rng)
    }

    /// As [`RadianceCaches::radiance`], but for light that the medium scatters. See [`radiance_beyond`].
    #[must_use]
    pub fn radiance_beyond<M: Medium + ?Sized, S: Scene + ?Sized>(
        &self,
        ray: &Ray,
        world: &World<'_, M, S>,
        rng: &mut (impl Rng + ?Sized),
    ) -> Seen {
        radiance_beyond(ray, &self.estimator(world), &self.reader(), &self.settings.eye, rng)
    }

    /// Brings all records into the indices.
    pub(super) fn finish(&mut self) {
        // An index without room answers as it did, and records beside it are looked at one by one.
        self.slots.0.iter_mut().for_each(|slot| {
            let _ = slot.finish();
        });
    }

    /// Whether a fill was left before its end: what it has made will be estimated anew.
    #[must_use]
    pub fn is_open(&self) -> bool {
        Kind::ALL.into_iter().any(|kind| kind != Kind::Single && self.settled[kind] != self.slots[kind].len())
    }
}
