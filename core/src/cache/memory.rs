//! What a fill of caches remembers, and what its jobs leave: growing, or lent.

use super::asked::Wanted;
use super::eye::Place;
use super::guide::Guide;
use super::radius::Limits;
use super::record::Facing;
use super::room::Slots;
use super::slot::ByKind;
use crate::sh::Coefficient;
use crate::single_scatter::Sums;
use crate::storage::List;

/// An estimate for one record.
#[derive(Debug, Clone, Copy, Default)]
pub struct Estimate {
    /// The number of its job.
    pub(super) job: u32,
    pub(super) place: Place,
    pub(super) sums: Sums,
    pub(super) facing: Facing,
    pub(super) limits: Limits,
    pub(super) learnt: Guide,
    /// How many times the samples of a usual one it took.
    pub(super) effort: f32,
}

/// What a job of a [`Filling`](super::Filling) leaves.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Default))]
pub struct FilledRecords<'o> {
    pub(super) wanted: List<'o, Wanted>,
    pub(super) open: List<'o, u32>,
    pub(super) estimate: Option<Estimate>,
    pub(super) higher: List<'o, Coefficient>,
    pub(super) is_cut: bool,
}

impl<'o> FilledRecords<'o> {
    /// In lent memory: for the places that a job finds, the numbers of those it looks up, and the coefficients of the estimate it
    /// makes. [`room_for`](super::room_for) says how many; where that is too small, [`Filling::is_cut`](super::Filling::is_cut) says so.
    ///
    /// ```
    /// # use fogbow::cache::{FilledRecords, Wanted};
    /// # use fogbow::sh::Coefficient;
    /// let (mut wanted, mut open) = ([Wanted::default(); 256], [0; 256]);
    /// let mut higher = [Coefficient::ZERO; 3];
    /// let output = FilledRecords::lent(&mut wanted, &mut open, &mut higher);
    /// # let _ = output;
    /// ```
    #[must_use]
    pub fn lent(wanted: &'o mut [Wanted], open: &'o mut [u32], higher: &'o mut [Coefficient]) -> Self {
        Self { wanted: wanted.into(), open: open.into(), estimate: None, higher: higher.into(), is_cut: false }
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
}

impl<'s> FillingMemory<'s> {
    /// In lent memory, whose size [`room_for`](super::room_for) tells; where that is too small, [`Filling::is_cut`](super::Filling::is_cut) says so.
    ///
    /// ```
    /// # use fogbow::cache::{FillingMemory, Guide, Slots, Wanted};
    /// let mut wanted = [Wanted::default(); 1000];
    /// let [mut open, mut still_open] = [[0; 1000]; 2];
    /// let mut guides = [[Guide::default(); 10]; 6];
    /// let memory = FillingMemory::lent(Slots {
    ///     wanted: &mut wanted,
    ///     open: [&mut open, &mut still_open],
    ///     guides: guides.each_mut().map(|guides| &mut guides[..]),
    ///     ..Slots::default() // and so on
    /// });
    /// # let _ = memory;
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
        }
    }

    pub(super) fn clear(&mut self) {
        self.wanted.clear();
        self.open.clear();
        self.still_open.clear();
        self.chosen.clear();
        self.estimates.clear();
        self.higher.clear();
        self.guides.0.iter_mut().for_each(List::clear);
    }
}
