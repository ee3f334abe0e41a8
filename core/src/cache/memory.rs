//! What a fill of caches remembers, and what its jobs leave: growing, or lent.

use super::asked::Wanted;
use super::fill::RAYS_PER_JOB;
use super::guide::Guide;
use super::noise::Glance;
use super::photons::{PhotonDeposit, PhotonGrid};
use super::pilots::Pilots;
use super::places::Place;
use super::radius::Limits;
use super::record::Facing;
use super::room::Slots;
use super::slot::ByKind;
use crate::sh::Coefficient;
use crate::single_scatter::Sums;
use crate::spectrum::Spectrum;
use crate::storage::List;

/// An estimate for one record.
#[derive(Debug, Clone, Copy, Default)]
pub struct Estimate {
    /// Of which record: among those of a round, or those estimated anew.
    pub(super) number: u32,
    pub(super) place: Place,
    pub(super) sums: Sums,
    pub(super) facing: Facing,
    pub(super) limits: Limits,
    pub(super) learnt: Guide,
    /// How many times the samples of a usual one it took.
    pub(super) effort: f32,
    /// How many parts have been mixed into this one.
    pub(super) mixed: u32,
}

impl Estimate {
    /// Mixes in a further part with as many samples; what share of the mixture that is.
    pub(super) fn merge(&mut self, part: &Self) -> f32 {
        self.mixed += 1;
        let share = 1.0 / (self.mixed + 1) as f32;
        let kept = 1.0 - share;
        let (sums, new) = (&mut self.sums, &part.sums);
        let mix = |a: Spectrum, b: Spectrum| a * kept + b * share;
        sums.value = mix(sums.value, new.value);
        sums.gradient = sums.gradient * kept + new.gradient * share;
        sums.gradient_norms = mix(sums.gradient_norms, new.gradient_norms);
        sums.unshadowed = mix(sums.unshadowed, new.unshadowed);
        sums.unshadowed_gradient_norms = mix(sums.unshadowed_gradient_norms, new.unshadowed_gradient_norms);
        self.facing.turn = self.facing.turn * kept + part.facing.turn * share;
        self.learnt.merge(&part.learnt, 1.0);
        share
    }
}

/// What a job of a [`Filling`](super::Filling) leaves.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Default))]
pub struct FilledRecords<'o> {
    pub(super) wanted: List<'o, Wanted>,
    pub(super) open: List<'o, u32>,
    pub(super) estimate: Option<Estimate>,
    pub(super) higher: List<'o, Coefficient>,
    pub(super) deposits: List<'o, PhotonDeposit>,
    pub(super) paths: u32,
    pub(super) flights: u64,
    pub(super) pilots: Pilots,
    pub(super) glances: [Glance; RAYS_PER_JOB as usize],
    pub(super) is_cut: bool,
}

impl<'o> FilledRecords<'o> {
    /// In lent memory: for the places that a job finds, the numbers of those it looks up, and the coefficients of the estimate it
    /// makes, and for what its photons leave. [`room_for`](super::room_for) says how many; where that is too small, [`Filling::is_cut`](super::Filling::is_cut) says so.
    ///
    /// ```
    /// # #[cfg(feature = "alloc")] {
    /// # use fogbow::cache::{Asked, PhotonDeposit, FilledRecords, RadianceCaches, Settings, Wanted, room_for};
    /// # use fogbow::sh::Coefficient;
    /// # use fogbow::{host::Empty, math::{Bounds, Ray, Vec3}, medium::Homogeneous, phase::Phase, spectrum::Spectrum};
    /// # use fogbow::{work, world::{Outline, World}};
    /// # let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC)?;
    /// # let world = World { medium: &fog, scene: &Empty, lights: (&[]).into() };
    /// # let bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
    /// # let settings = Settings { rays: 20, ..Settings::for_outline(&Outline::of(&world, bounds), 0.02).with_walks(16) };
    /// # let asked = || Asked::anywhere_in(bounds);
    /// let room = room_for(&settings, 2000, 100);
    /// let (mut wanted, mut open) = (vec![Wanted::default(); room.of_job_wanted], vec![0; room.of_job_open]);
    /// let mut higher = vec![Coefficient::ZERO; room.of_job_higher];
    /// let mut deposits = vec![PhotonDeposit::default(); room.of_job_deposits];
    /// let mut filling = RadianceCaches::new(settings).fill(asked());
    /// work::finish(&mut filling, &world, &mut FilledRecords::lent(&mut wanted, &mut open, &mut higher, &mut deposits));
    /// assert!(!filling.is_cut());
    /// # }
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    #[must_use]
    pub fn lent(
        wanted: &'o mut [Wanted],
        open: &'o mut [u32],
        higher: &'o mut [Coefficient],
        deposits: &'o mut [PhotonDeposit],
    ) -> Self {
        Self {
            wanted: wanted.into(),
            open: open.into(),
            estimate: None,
            higher: higher.into(),
            deposits: deposits.into(),
            paths: 0,
            flights: 0,
            pilots: Pilots::default(),
            glances: Default::default(),
            is_cut: false,
        }
    }
}

/// What a fill remembers between its rounds, besides the caches.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Default))]
pub struct FillingMemory<'s> {
    pub(super) wanted: List<'s, Wanted>,
    /// Numbers of the places of a batch without a record; those that still have none after the round's look.
    pub(super) open: List<'s, u32>,
    pub(super) still_open: List<'s, u32>,
    /// The places of a round, with how far apart they must be.
    pub(super) chosen: List<'s, (u32, f32)>,
    pub(super) estimates: List<'s, Estimate>,
    pub(super) higher: List<'s, Coefficient>,
    /// What the records of this fill have learnt, kind by kind.
    pub(super) guides: ByKind<List<'s, Guide>>,
    pub(super) glances: List<'s, Glance>,
    pub(super) photons: PhotonGrid<'s>,
}

impl<'s> FillingMemory<'s> {
    /// In lent memory, whose size [`room_for`](super::room_for) tells; where that is too small, [`Filling::is_cut`](super::Filling::is_cut) says so.
    ///
    /// ```
    /// # #[cfg(feature = "alloc")] {
    /// # use fogbow::cache::{Asked, Estimate, FilledRecords, FillingMemory, Glance, Guide, PhotonCell, RadianceCaches, Settings, Slots, Wanted, room_for};
    /// # use fogbow::sh::Coefficient;
    /// # use fogbow::{host::Empty, math::{Bounds, Ray, Vec3}, medium::Homogeneous, phase::Phase, spectrum::Spectrum};
    /// # use fogbow::{work, world::{Outline, World}};
    /// # let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC)?;
    /// # let world = World { medium: &fog, scene: &Empty, lights: (&[]).into() };
    /// # let bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
    /// # let settings = Settings { rays: 20, ..Settings::for_outline(&Outline::of(&world, bounds), 0.02).with_walks(16) };
    /// # let asked = || Asked::anywhere_in(bounds);
    /// let room = room_for(&settings, 2000, 100);
    /// let mut wanted = vec![Wanted::default(); room.wanted];
    /// let [mut open, mut still_open] = [(); 2].map(|()| vec![0; room.open]);
    /// let mut chosen = vec![(0, 0.0); room.chosen];
    /// let (mut estimates, mut higher) = (vec![Estimate::default(); room.estimates], vec![Coefficient::ZERO; room.higher]);
    /// let (mut photons, mut photon_moments) = (vec![PhotonCell::default(); room.photons], vec![Spectrum::ZERO; room.photon_moments]);
    /// let mut glances = vec![Glance::default(); room.glances];
    /// let mut guides = room.guides.map(|count| vec![Guide::default(); count]);
    /// let memory = FillingMemory::lent(Slots {
    ///     wanted: &mut wanted,
    ///     open: [&mut open, &mut still_open],
    ///     chosen: &mut chosen,
    ///     estimates: &mut estimates,
    ///     higher: &mut higher,
    ///     photons: &mut photons,
    ///     photon_moments: &mut photon_moments,
    ///     glances: &mut glances,
    ///     guides: guides.each_mut().map(|guides| &mut guides[..]),
    /// });
    /// let mut filling = RadianceCaches::new(settings).fill_in(memory, asked());
    /// work::finish(&mut filling, &world, &mut FilledRecords::default());
    /// assert!(!filling.is_cut());
    /// # }
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    #[must_use]
    pub fn lent(slots: Slots<'s>) -> Self {
        let [open, still_open] = slots.open;
        Self {
            wanted: slots.wanted.into(),
            open: open.into(),
            still_open: still_open.into(),
            chosen: slots.chosen.into(),
            estimates: slots.estimates.into(),
            higher: slots.higher.into(),
            guides: ByKind(slots.guides.map(List::from)),
            glances: slots.glances.into(),
            photons: PhotonGrid::new(slots.photons.into(), slots.photon_moments.into()),
        }
    }

    pub(super) fn clear(&mut self) {
        self.wanted.clear();
        self.open.clear();
        self.still_open.clear();
        self.chosen.clear();
        self.estimates.clear();
        self.higher.clear();
        self.glances.clear();
        self.guides.0.iter_mut().for_each(List::clear);
    }
}
