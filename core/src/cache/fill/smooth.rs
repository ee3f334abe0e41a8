//! Rounds in which records on surfaces are averaged with their neighbours.

use super::steps::attached;
use super::{Filling, Round};
use crate::cache::kind::Step;
use crate::cache::memory::{Estimate, FilledRecords};

impl<F> Filling<'_, F> {
    /// Begins a round for all records from a number on.
    pub(super) fn begin_smooth(&mut self, step: Step, from: usize) {
        self.memory.estimates.clear();
        self.memory.higher.clear();
        let count = self.caches.slots[step.kind].len() - from;
        self.enter(Round::Smooth { from: from as u32 }, count as u32);
    }

    /// A record as it and its neighbours say.
    pub(super) fn smooth(&self, from: u32, job: u32, output: &mut FilledRecords<'_>) {
        let Some((step, _)) = self.at_hand() else { return };
        let smoothed = self.caches.slots[step.kind].surface().and_then(|cache| cache.smoothed(from + job));
        output.estimate = smoothed.map(|(record, facing)| {
            let mut estimate = Estimate { number: job, facing, ..Estimate::default() };
            (estimate.sums.value, estimate.sums.gradient) = (record.value, record.gradient);
            estimate
        });
    }

    /// Takes the means in place of the records.
    pub(super) fn take_means(&mut self, from: u32) {
        let Some((step, _)) = self.at_hand() else { return };
        let slot = &mut self.caches.slots[step.kind];
        for (i, estimate) in self.memory.estimates.as_slice().iter().enumerate() {
            let attached = attached(step.kind, estimate, &[], i, slot.stride());
            slot.revise((from + estimate.number) as usize, &estimate.sums, attached);
        }
    }
}
