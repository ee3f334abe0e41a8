//! Rounds of pilots: whether records reach too far.

use super::{Filling, Round};
use crate::cache::guide::{Guided, Looks};
use crate::cache::kind::Step;
use crate::cache::lookup::Basis;
use crate::cache::memory::{Estimate, FilledRecords};
use crate::cache::pilots::{self, Pilots};
use crate::cache::settings::Effort;
use crate::cache::slot::learnt_near;
use crate::host::{Medium, Scene};
use crate::math::Vec3;
use crate::sampling::uniform::mix;
use crate::sampling::{Generator, uniform};
use crate::world::World;

impl<F> Filling<'_, F> {
    /// Begins a round of pilots, if records were made and may still shrink.
    pub(super) fn send_pilots(&mut self) -> bool {
        let Some((step, effort)) = self.at_hand() else { return false };
        let may_shrink = self.settings().error > 0.0 && self.shrunk < pilots::MOST;
        if !may_shrink || step.kind.row().is_ground || self.computed == 0 {
            return false;
        }
        self.pilots = Pilots::default();
        self.enter(Round::Pilot { from: 0 }, pilots::jobs_for(self.computed * u64::from(effort.samples)));
        true
    }

    /// Compares what records tell with estimates, at some of the places that eye rays ask for.
    pub(super) fn pilot<M: Medium + ?Sized, S: Scene + ?Sized>(
        &self,
        job: u32,
        world: &World<'_, M, S>,
        output: &mut FilledRecords<'_>,
    ) {
        let Some((step, reading)) =
            self.at_hand().and_then(|(step, _)| Some((step, self.settings().reading(step.kind)?)))
        else {
            return;
        };
        let (row, slot, wanted) = (step.kind.row(), &self.caches.slots[step.kind], self.memory.wanted.as_slice());
        for pilot in job * pilots::PLACES_PER_JOB..(job + 1) * pilots::PLACES_PER_JOB {
            let mut rng = Generator::new(mix(self.seed() ^ mix(row.stream + 32)) ^ u64::from(pilot));
            let from = (uniform(&mut rng) * wanted.len() as f32) as usize;
            let all = wanted.iter().skip(from).chain(wanted).take(wanted.len());
            let Some(place) = all.map(|wanted| wanted.place).find(|place| place.is_seen && row.places.hold(place))
            else {
                return;
            };
            let to_eye = place.to_eye.filter(|_| !step.kind.is_on_surfaces());
            let basis = Basis::new(to_eye.unwrap_or(Vec3::Z), if to_eye.is_some() { slot.degree() } else { 0 });
            let Some(told) = slot.lookup(&place, &basis, &reading) else { continue };
            let guides = self.memory.guides[step.kind].as_slice();
            let guide = Guided::new(&learnt_near(slot, guides, self.before[step.kind], place.point));
            let looks = Looks { count: pilots::SAMPLES, guide: guide.as_ref(), learnt: None, to_eye: place.to_eye };
            // Both estimates draw the same random numbers, so that what differs between them is hardly noise.
            let mut same = rng.clone();
            let mut estimate = Estimate { place, ..Estimate::default() };
            if !self.estimate(step, world, looks, &mut estimate, &mut rng, output) {
                continue;
            }
            let own = basis.expanded(estimate.sums.value, output.higher.as_slice());
            output.higher.clear();
            // Records have been estimated once by now: one that is too bright by chance reaches less far, so that what is read is too dark
            // whatever the radii. By how much is told by one of those that are read, estimated anew where it is.
            // By the weights of what is read, or what records far from this direction tell of it would not cancel.
            let (mut sum, mut chosen) = (0.0, None);
            slot.visit_read(place.point, &basis, &reading, &mut |number, weight| {
                sum += weight;
                if uniform(&mut rng) * sum < weight {
                    chosen = Some(number);
                }
            });
            let found = chosen.and_then(|number| Some((slot.place(number)?, slot.told_by(number, &basis)?)));
            let Some((there, before)) = found else { continue };
            let looks = Looks { count: pilots::SAMPLES, guide: guide.as_ref(), learnt: None, to_eye: place.to_eye };
            let mut anew = Estimate { place: there, ..Estimate::default() };
            if self.estimate(step, world, looks, &mut anew, &mut same, output) {
                let anew = basis.expanded(anew.sums.value, output.higher.as_slice());
                output.pilots.add(told + anew - before, own);
            }
            output.higher.clear();
        }
    }

    /// Shrinks radii if pilots say so, those of two rounds, and makes records where then none reach.
    pub(super) fn take_pilots(&mut self, from: u32) {
        let found = self.at_hand().and_then(|at_hand| {
            let error = self.settings().error * self.settings().coarser[at_hand.0.kind as usize];
            let helps = self.shrunk == 0 || self.pilots.off() < pilots::HELPS * self.off;
            Some((at_hand, self.pilots.factor(error).filter(|_| helps)?))
        });
        let Some((at_hand, factor)) = found else {
            self.begin(self.step + 1);
            return;
        };
        if from == 0 {
            self.enter(Round::Pilot { from: self.jobs }, pilots::AGAIN * self.jobs);
        } else {
            self.shrink(at_hand, factor);
        }
    }

    fn shrink(&mut self, (step, effort): (Step, Effort), factor: f32) {
        self.shrunk += 1;
        self.off = self.pilots.off();
        if let Some(effort) = self.caches.settings.effort_mut(step.kind) {
            *effort = effort.nearer(factor);
        }
        self.is_cut |= !self.caches.slots[step.kind].shrink(|record| (record.radius * factor).max(effort.limits.min));
        self.batch = [0, 0];
        self.next_batch();
    }
}

#[cfg(all(test, feature = "alloc"))]
mod tests {
    use super::*;
    use crate::cache::{Asked, RadianceCaches, Settings};
    use crate::host::Empty;
    use crate::light::{Light, PointLight};
    use crate::math::Bounds;
    use crate::medium::{Homogeneous, Placed, Region};
    use crate::phase::Phase;
    use crate::spectrum::Spectrum;
    use crate::work;
    use crate::world::Outline;

    fn found(bias: f32) -> Pilots {
        let mut pilots = Pilots::default();
        (0..100).for_each(|_| pilots.add(Spectrum::splat(1.0 + bias), Spectrum::ONE));
        pilots
    }

    /// A verdict by chance costs a second look, and no records.
    #[test]
    fn radii_shrink_where_two_rounds_of_pilots_say_so() {
        let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC).unwrap();
        let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 1.0).unwrap());
        let lamps = [Light::Point(PointLight::from_flux(Vec3::Y * 2.0, Spectrum::ONE).unwrap())];
        let world = World { medium: &ball, scene: &Empty, lights: (&lamps).into() };
        let bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
        let settings =
            Settings { rays: 40, ..Settings::for_outline(&Outline::of(&world, bounds), 0.02).with_walks(16) };
        let at_pilots = || {
            let mut filling = RadianceCaches::new(settings).fill(Asked::anywhere_in(bounds));
            let mut output = FilledRecords::default();
            while !matches!(filling.round, Round::Pilot { from: 0 }) {
                assert!(work::step(&mut filling, &world, &mut output), "no pilots");
            }
            filling
        };
        for (second, shrunk) in [(found(0.0), 0), (found(0.1), 1)] {
            let mut filling = at_pilots();
            let (step, jobs) = (filling.step, filling.jobs);
            filling.pilots = found(0.1);
            filling.take_pilots(0);
            assert!(matches!(filling.round, Round::Pilot { from } if from == jobs) && filling.jobs == 3 * jobs);
            assert_eq!((filling.step, filling.shrunk), (step, 0));
            filling.pilots = second;
            filling.take_pilots(jobs);
            assert_eq!((filling.shrunk, filling.step == step), (shrunk, shrunk > 0));
        }
        // Once they have shrunk, only if that has helped.
        for (bias, helped) in [(0.04, true), (0.06, false)] {
            let mut filling = at_pilots();
            let step = filling.step;
            (filling.shrunk, filling.off) = (1, 0.1);
            filling.pilots = found(bias);
            filling.take_pilots(0);
            assert_eq!(filling.step == step, helped, "{bias}");
        }
    }
}
