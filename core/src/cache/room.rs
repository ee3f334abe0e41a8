//! Lent memory of caches and of their filling, and how much of it is needed.

use super::fill::{MOST_PARTS, PLACES_OF_JOB, PLACES_PER_JOB, RAYS_PER_JOB};
use super::guide::Guide;
use super::kind::Kind;
use super::lobe;
use super::noise::{self, Glance};
use super::photons::{DEPOSITS_OF_JOB, PhotonCell};
use super::record::MAX_STRIDE;
use super::settings::Settings;
use super::{Estimate, SurfaceCache, VolumeCache, Wanted};
use crate::sh::{Coefficient, coefficient_count};
use crate::spectrum::Spectrum;

/// Lengths of all lent memory that caches and their filling need.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Room {
    /// Of all caches together: see [`RadianceCaches::lent`](super::RadianceCaches::lent).
    pub chunks: usize,
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
    /// What the photons of a job leave: the fourth. In fog so dense that they leave more, the rest is lost.
    pub of_job_deposits: usize,
    /// [`Slots::photons`].
    pub photons: usize,
    /// [`Slots::glances`].
    pub glances: usize,
    /// [`Slots::photon_moments`].
    pub photon_moments: usize,
}

/// Room for `records` of every kind that the settings use, made of `places` where light is asked for. Crowds of records within crowds may
/// want more nodes and entries; how many places a world has, only its eye rays can tell. What turns out too small is told by
/// [`Filling::is_cut`](super::Filling::is_cut).
///
/// ```
/// # use fogbow::cache::{Effort, Kind, Limits, Settings, VolumeCache, room_for};
/// let limits = Limits { min: 0.1, max: 1.0 };
/// let effort = Effort { tolerance: 0.5, samples: 32, degree: 2, limits, clearance: f32::INFINITY, free_paths: f32::INFINITY };
/// let room = room_for(&Settings { surface: Some(effort), ..Settings::default() }, 1000, 50);
/// // One cache. Of nine coefficients the mean is the record itself; two hold what the others leave out towards the eye.
/// assert_eq!(room.chunks, VolumeCache::chunks(50, 8 + 2));
/// assert_eq!((room.wanted, room.guides[Kind::Surface as usize], room.guides[Kind::Multiple as usize]), (1000, 50, 0));
/// ```
#[must_use]
pub fn room_for(settings: &Settings, places: usize, records: usize) -> Room {
    let mut room = Room::default();
    let mut stride = 0;
    for (i, kind) in Kind::ALL.into_iter().enumerate() {
        let Some(of_kind) = stride_of(settings, kind) else { continue };
        room.guides[i] = records;
        if !kind.is_on_surfaces() {
            stride = of_kind.max(stride);
        }
    }
    room.chunks = Kind::ALL.into_iter().map(|kind| chunks_of(settings, kind, records)).sum();
    room.wanted = places;
    // Records that are estimated anew, once for each of their parts.
    room.open = places.max(records * MOST_PARTS);
    room.chosen = settings.round as usize;
    room.estimates = room.chosen.max(records);
    room.higher = room.estimates * stride;
    if settings.error > 0.0 {
        room.glances = noise::readings(settings).next_multiple_of(RAYS_PER_JOB) as usize;
    }
    room.of_job_wanted = places.min(PLACES_OF_JOB);
    room.of_job_open = places.min(PLACES_PER_JOB as usize);
    room.of_job_higher = stride;
    if let Some(effort) = &settings.photons {
        (room.photons, room.photon_moments) = effort.room();
        room.of_job_deposits = DEPOSITS_OF_JOB;
    }
    room
}

/// Attachments of each record of a kind; `None` if the settings do not use it.
pub(super) fn stride_of(settings: &Settings, kind: Kind) -> Option<usize> {
    let effort = settings.asked(kind)?;
    if kind.is_on_surfaces() {
        return Some(1);
    }
    let has_lobe = effort.degree > 0 && kind != Kind::Single;
    Some((coefficient_count(effort.degree) - 1 + if has_lobe { lobe::ATTACHED } else { 0 }).min(MAX_STRIDE))
}

/// Chunks of a cache of a kind with room for so many records; none if the settings do not use it.
pub(super) fn chunks_of(settings: &Settings, kind: Kind, records: usize) -> usize {
    match stride_of(settings, kind) {
        None => 0,
        Some(stride) if kind.is_on_surfaces() => SurfaceCache::chunks(records, stride),
        Some(stride) => VolumeCache::chunks(records, stride),
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
    /// For the cells that photons light.
    pub photons: &'s mut [PhotonCell],
    /// For the light in them, and what that of halves differs by.
    pub photon_moments: &'s mut [Spectrum],
    /// What eye rays read before records are estimated anew.
    pub glances: &'s mut [Glance],
}
