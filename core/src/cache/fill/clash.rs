//! Records that contradict each other are parted, before pilots look at all.

use super::Filling;
use crate::cache::clashes::{ROUNDS, reach};
use crate::cache::slot::Slot;

impl<F> Filling<'_, F> {
    /// Makes records in the medium reach less far where they contradict others; whether any do, so that places may be left that none reaches.
    pub(super) fn part_clashing(&mut self) -> bool {
        let Some((step, effort)) = self.at_hand() else { return false };
        let may_clash = self.settings().error > 0.0 && self.parted < ROUNDS && self.computed > 0;
        let Slot::Volume(cache) = &mut self.caches.slots[step.kind] else { return false };
        if !may_clash {
            return false;
        }
        self.parted += 1;
        let (guides, from) = (self.memory.guides[step.kind].as_slice(), self.before[step.kind]);
        // Of those of earlier fills noise is known to be small.
        let variance = |number: usize| {
            let guide = number.checked_sub(from).and_then(|i| guides.get(i));
            guide.map_or(0.0, |guide| guide.relative_variance() / effort.samples as f32)
        };
        let limit = |[a, b]: [usize; 2], [here, there]: [&_; 2]| {
            reach(here, there, variance(a) + variance(b)).max(effort.limits.min)
        };
        let parted = cache.limit(&limit);
        self.is_cut |= parted.is_err();
        // Without room for the index, too, places may be left open.
        let is_parted = parted != Ok(0);
        if is_parted {
            self.batch = [0, 0];
        }
        is_parted
    }
}
