//! Lent memory of caches and of their filling, and how much of it is needed.

use super::fill::{PLACES_OF_JOB, PLACES_PER_JOB};
use super::guide::Guide;
use super::index::Index;
use super::kind::Kind;
use super::record::MAX_STRIDE;
use super::settings::Settings;
use super::{Estimate, Facing, Record, Wanted};
use crate::sh::{Coefficient, coefficient_count};

/// Lengths of the slices that a kind of caches lies in: [`KindSlots`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct KindRoom {
    /// Records.
    pub records: usize,
    /// Coefficients of expansions: none on surfaces.
    pub higher: usize,
    /// What records on surfaces have besides: none in the medium.
    pub facings: usize,
    /// What its index lies in.
    pub index: IndexRoom,
    /// What the index of its wider spheres lies in.
    pub wide: IndexRoom,
}

/// Lengths of the slices that an [`Index`] lies in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct IndexRoom {
    /// Inner nodes.
    pub nodes: usize,
    /// Entries.
    pub entries: usize,
    /// Spheres.
    pub spheres: usize,
    /// Blocks of four spheres.
    pub blocks: usize,
}

impl IndexRoom {
    /// For so many spheres, which are so many times as large as usual. Blocks have a bound that does not depend on it.
    const fn of(spheres: usize, wider: usize) -> Self {
        let few = if spheres == 0 { 0 } else { 16 };
        Self { nodes: wider * spheres + few, entries: 6 * wider * spheres + few, spheres, blocks: 4 * spheres + few }
    }
}

/// Lengths of all slices that a fill of lent caches needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Room {
    /// Of each kind, in the order of [`Kind::ALL`]: see [`RadianceCaches::lent`](super::RadianceCaches::lent).
    pub kinds: [KindRoom; Kind::COUNT],
    /// [`Slots::wanted`].
    pub wanted: usize,
    /// Each of [`Slots::open`].
    pub open: usize,
    /// [`Slots::chosen`].
    pub chosen: usize,
    /// [`Slots::estimates`].
    pub estimates: usize,
    /// [`Slots::higher`].
    pub higher: usize,
    /// Each of [`Slots::guides`], in the order of [`Kind::ALL`].
    pub guides: [usize; Kind::COUNT],
    /// Places that a job finds: the first of [`FilledRecords::lent`](super::FilledRecords::lent).
    pub of_job_wanted: usize,
    /// Places that a job looks up: the second.
    pub of_job_open: usize,
    /// Coefficients of the estimate that a job makes: the third.
    pub of_job_higher: usize,
}

/// Room for `records` of every kind that the settings use, made of `places` where light is asked for. Crowds of records within crowds may
/// want more nodes and entries; how many places a world has, only its eye rays can tell. What turns out too small is told by
/// [`Filling::is_cut`](super::Filling::is_cut).
///
/// ```
/// # use fogbow::cache::{Effort, Kind, Limits, Settings, room_for};
/// let limits = Limits { min: 0.1, max: 1.0 };
/// let effort = Effort { tolerance: 0.5, samples: 32, degree: 2, limits, clearance: f32::INFINITY, free_paths: f32::INFINITY };
/// let room = room_for(&Settings { surface: Some(effort), ..Settings::default() }, 1000, 50);
/// let [surface, multiple] = [Kind::Surface, Kind::Multiple].map(|kind| room.kinds[kind as usize]);
/// // Nine coefficients, the mean of which is the record itself.
/// assert_eq!((surface.records, surface.higher, surface.facings), (50, 400, 0));
/// assert_eq!((multiple.records, room.wanted), (0, 1000));
/// ```
#[must_use]
pub fn room_for(settings: &Settings, places: usize, records: usize) -> Room {
    let mut room = Room::default();
    let mut stride = 0;
    for (i, kind) in Kind::ALL.into_iter().enumerate() {
        let Some(of_kind) = stride_of(settings, kind) else { continue };
        room.kinds[i] = KindRoom {
            records,
            higher: if kind.is_on_surfaces() { 0 } else { records * of_kind },
            facings: if kind.is_on_surfaces() { records } else { 0 },
            index: IndexRoom::of(records, 1),
            wide: IndexRoom::of(records, 3),
        };
        room.guides[i] = records;
        if !kind.is_on_surfaces() {
            stride = of_kind.max(stride);
        }
    }
    room.wanted = places;
    room.open = places;
    room.chosen = settings.round as usize;
    room.estimates = room.chosen.max(records);
    room.higher = room.estimates * stride;
    room.of_job_wanted = places.min(PLACES_OF_JOB);
    room.of_job_open = places.min(PLACES_PER_JOB as usize);
    room.of_job_higher = stride;
    room
}

/// Attachments of each record of a kind; `None` if the settings do not use it.
pub(super) fn stride_of(settings: &Settings, kind: Kind) -> Option<usize> {
    let effort = settings.effort(kind)?;
    Some(if kind.is_on_surfaces() { 1 } else { (coefficient_count(effort.degree) - 1).min(MAX_STRIDE) })
}

/// Lent memory of the caches of one kind, as long as [`KindRoom`] says. None is [`KindSlots::default`].
#[derive(Debug)]
pub struct KindSlots<'s> {
    /// For records.
    pub records: &'s mut [Record],
    /// For coefficients of expansions: in the medium only.
    pub higher: &'s mut [Coefficient],
    /// For what records on surfaces have besides: there only.
    pub facings: &'s mut [Facing],
    /// Finds records.
    pub index: Index<'s>,
    /// Finds records by spheres twice as large.
    pub wide: Index<'s>,
}

impl Default for KindSlots<'_> {
    /// No memory.
    fn default() -> Self {
        let index = || Index::new(&mut [][..], &mut [][..], &mut [][..], &mut [][..]);
        Self { records: &mut [], higher: &mut [], facings: &mut [], index: index(), wide: index() }
    }
}

/// Lent memory of a fill, as long as [`Room`] says. None is [`Slots::default`].
#[derive(Debug, Default)]
pub struct Slots<'s> {
    /// For the places where light is asked for.
    pub wanted: &'s mut [Wanted],
    /// For the numbers of those without a record, at the beginning and at the end of a round.
    pub open: [&'s mut [u32]; 2],
    /// For the places of a round, with how far apart they must be (m).
    pub chosen: &'s mut [(u32, f32)],
    /// For the estimates of a round.
    pub estimates: &'s mut [Estimate],
    /// For the coefficients of these.
    pub higher: &'s mut [Coefficient],
    /// For what records have learnt, kind by kind in the order of [`Kind::ALL`].
    pub guides: [&'s mut [Guide]; Kind::COUNT],
}
