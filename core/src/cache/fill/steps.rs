//! Steps of a fill: batches of places, rounds of new records for those that have none, and what becomes of their estimates.

use super::estimates::{usual_radius, usual_value, where_bright};
use super::{Filling, PLACES_PER_JOB, Round};
use crate::cache::Record;
use crate::cache::asked::Wanted;
use crate::cache::kind::{FIRST_COUNTS, Kind, Pass, TURNS, Turn};
use crate::cache::memory::{Estimate, FillingMemory};
use crate::cache::slot::{Attached, Inserted};
use crate::sampling::uniform::mix;
use crate::sh::Coefficient;

/// Eye rays of the first batch; each next one has twice as many, up to [`LAST_BATCH`]: what first rays ask for lies far apart,
/// and what later ones find are the gaps.
const FIRST_BATCH: u32 = 64;

/// See [`FIRST_BATCH`].
const LAST_BATCH: u32 = 4096;

impl<F> Filling<'_, F> {
    /// The first step from number `from` on that has something to do.
    pub(super) fn begin(&mut self, from: usize) {
        for (number, turn) in TURNS.iter().enumerate().skip(from) {
            self.step = number;
            if let Turn::Glances { is_second } = *turn
                && self.begin_glances(is_second)
            {
                return;
            }
            if *turn == Turn::Doubt && self.begin_doubt() {
                return;
            }
            if let Turn::Ground { is_second } = *turn
                && self.begin_ground(is_second)
            {
                return;
            }
            let Some((step, effort)) = self.at_hand() else { continue };
            let slot = &self.caches.slots[step.kind];
            if slot.is_off() {
                continue;
            }
            match step.pass {
                Pass::Make => {
                    self.tighten((step, effort));
                    let slot = &self.caches.slots[step.kind];
                    // Records added later must not share the random numbers of the first.
                    (self.computed, self.first) = (0, if slot.len() == 0 { 0 } else { mix(slot.len() as u64) });
                    (self.batch, self.shrunk, self.parted) = ([0, 0], 0, 0);
                    if self.open_batch() {
                        return;
                    }
                }
                Pass::Anew { .. } | Pass::Again { .. } | Pass::More { .. } => {
                    let from = self.before[step.kind].min(slot.len());
                    self.again += u32::from(matches!(step.pass, Pass::More { .. }));
                    if self.begin_again((step, effort), from) {
                        return;
                    }
                    self.again = 0;
                }
                Pass::Smooth => {
                    let from = self.before[step.kind].min(slot.len());
                    if slot.len() > from {
                        self.begin_smooth(step, from);
                        return;
                    }
                }
            }
        }
        self.complete();
    }

    /// The next batch of places; after the last of them those that are open once records are parted, then pilots, and the next step.
    pub(super) fn next_batch(&mut self) {
        while !self.open_batch() {
            if !self.part_clashing() {
                if !self.send_pilots() {
                    self.begin(self.step + 1);
                }
                return;
            }
        }
    }

    /// The next batch of the step at hand that has places; `false` after the last.
    fn open_batch(&mut self) -> bool {
        let Some((step, _)) = self.at_hand() else { return false };
        let rays = self.settings().rays;
        let wanted = self.memory.wanted.as_slice();
        while self.batch[1] < rays {
            let size =
                if self.batch[1] == 0 { FIRST_BATCH } else { LAST_BATCH.min(2 * (self.batch[1] - self.batch[0])) };
            self.batch = [self.batch[1], rays.min(self.batch[1].saturating_add(size))];
            let at = |ray: u32| wanted.partition_point(|wanted| wanted.ray < ray);
            self.memory.open.clear();
            let (first, last) = (at(self.batch[0]), at(self.batch[1]));
            for (number, Wanted { place, .. }) in wanted.iter().enumerate().take(last).skip(first) {
                if step.kind.row().places.hold(place) {
                    self.is_cut |= self.memory.open.push(number as u32).is_err();
                }
            }
            if !self.memory.open.is_empty() {
                self.next_look();
                return true;
            }
        }
        self.is_cut |= !self.caches.slots[step.kind].finish();
        false
    }

    pub(super) fn next_look(&mut self) {
        self.memory.still_open.clear();
        self.enter(Round::Look, (self.memory.open.len() as u32).div_ceil(PLACES_PER_JOB));
    }

    /// The places of one round: the first open ones that are not too close to each other; `false` if none are open.
    pub(super) fn choose(&mut self) -> bool {
        let Some((step, effort)) = self.at_hand() else { return false };
        let FillingMemory { wanted, open, chosen, estimates, higher, .. } = &mut self.memory;
        let settings = &self.caches.settings;
        let slot = &self.caches.slots[step.kind];
        let wanted = wanted.as_slice();
        chosen.clear();
        for &number in open.as_slice() {
            if chosen.len() >= settings.round as usize {
                break;
            }
            let place = wanted[number as usize].place;
            let near = |&(other, radius): &(u32, f32)| {
                let other = wanted[other as usize].place;
                let same_side = match (place.normal, other.normal) {
                    // Records whose normals differ by more than this do not cover each other's places.
                    (Some(a), Some(b)) => a.dot(b) > 0.7,
                    _ => true,
                };
                same_side && other.point.distance_squared(place.point) < radius * radius
            };
            if chosen.as_slice().iter().any(near) {
                continue;
            }
            let guess = slot.radius_near(place.point).unwrap_or(0.5 * effort.limits.max);
            if chosen.push((number, guess * (1.0 - settings.margin))).is_err() {
                break;
            }
        }
        if chosen.is_empty() {
            return false;
        }
        estimates.clear();
        higher.clear();
        // Of a new record only the bound of its radius is known: twice as strict with it as with radii.
        self.usual = 3.0 * usual_radius(slot.records());
        let count = chosen.len() as u32;
        self.parts = self.parts_of_new(step);
        self.enter(Round::Make, count * self.parts);
        true
    }

    /// Stores the records of a round in order; how many.
    pub(super) fn insert(&mut self) -> u32 {
        let Some((step, effort)) = self.at_hand() else { return 0 };
        let Some(reading) = self.strict(step.kind) else { return 0 };
        let film = self.film;
        let FillingMemory { wanted, chosen, estimates, higher, guides, .. } = &mut self.memory;
        let (wanted, chosen) = (wanted.as_slice(), chosen.as_slice());
        let (shares, coarser) = (&self.caches.shares, self.caches.settings.coarser[step.kind as usize]);
        let slot = &mut self.caches.slots[step.kind];
        let (stride, bright) = (slot.stride(), usual_value(slot.records()));
        let mut added = 0;
        for (i, estimate) in estimates.as_slice().iter().enumerate() {
            self.computed += 1;
            self.all_computed[step.kind] += 1;
            let Estimate { place, sums, limits, .. } = estimate;
            let limits = where_bright(*limits, effort.limits.min, sums.value.mean() / bright);
            let Some(mut record) = Record::new(place.point, sums, effort.tolerance, limits) else { continue };
            let asked = chosen.get(estimate.number as usize).and_then(|(from, _)| wanted.get(*from as usize));
            let on_film = |radius| asked.map_or(estimate.learnt.film, |from| from.on_film(radius, film));
            let finer = shares.finer(step.kind, coarser, on_film(record.radius));
            record.radius = (record.radius * finer).max(effort.limits.min);
            if slot.covers(place, &reading) {
                continue;
            }
            let attached = attached(step.kind, estimate, higher.as_slice(), i, stride);
            match slot.insert(record, attached) {
                Inserted::Added => {
                    let mut guide = estimate.learnt;
                    guide.film = on_film(record.radius);
                    self.is_cut |= guides[step.kind].push(guide).is_err();
                    added += 1;
                }
                Inserted::LeftOut => {}
                Inserted::Full => self.is_cut = true,
            }
        }
        added
    }

    /// Mixes the estimates of a round into the records from a number on, and adds to what was learnt.
    pub(super) fn blend(&mut self, from: usize) {
        let Some((step, effort)) = self.at_hand() else { return };
        let slot = &mut self.caches.slots[step.kind];
        let stride = slot.stride();
        for (i, estimate) in self.memory.estimates.as_slice().iter().enumerate() {
            self.all_computed[step.kind] += 1;
            // Where memory was too small some jobs have left none.
            let offset = estimate.number as usize;
            let guide = self.memory.guides[step.kind].as_mut_slice().get_mut(offset);
            let held = guide.as_ref().map_or(FIRST_COUNTS, |guide| guide.held);
            let held = if let Pass::Anew { .. } = step.pass { 0.0 } else { held };
            let share = estimate.effort / (held + estimate.effort);
            if let Some(guide) = guide {
                guide.held = held + estimate.effort;
                guide.merge(&estimate.learnt, 1.0);
            }
            let attached = attached(step.kind, estimate, self.memory.higher.as_slice(), i, stride);
            if let Pass::Again { .. } = step.pass {
                let effort = f64::from(estimate.effort);
                let [sum, count] = &mut self.efforts[step.kind];
                (*sum, *count) = (*sum + effort, *count + 1.0);
            }
            slot.blend(from + offset, effort.tolerance, &estimate.sums, attached, share);
        }
    }
}

pub(super) fn attached<'a>(
    kind: Kind,
    estimate: &Estimate,
    higher: &'a [Coefficient],
    i: usize,
    stride: usize,
) -> Attached<'a> {
    if kind.is_on_surfaces() {
        Attached::Facing(estimate.facing)
    } else {
        Attached::Higher(higher.get(i * stride..(i + 1) * stride).unwrap_or(&[]))
    }
}
