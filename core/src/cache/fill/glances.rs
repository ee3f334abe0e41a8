//! Rounds in which eye rays read what there is: how much noise of records a picture would show.

use super::{Filling, RAYS_PER_JOB, Round};
use crate::cache::asked::Asked;
use crate::cache::kind::Kind;
use crate::cache::memory::FilledRecords;
use crate::cache::noise::{self, Glance, READINGS, rounds_for};
use crate::cache::presets;
use crate::cache::seen::radiance;
use crate::host::{Medium, Scene};
use crate::math::Ray;
use crate::sampling::independent;
use crate::sampling::uniform::mix;
use crate::world::World;

impl<F> Filling<'_, F> {
    /// Begins a round of glances, if what they tell is of use.
    pub(super) fn begin_glances(&mut self, is_second: bool) -> bool {
        let Asked::View { .. } = self.asked else { return false };
        let is_new = |kind: Kind| self.caches.slots[kind].len() > self.before[kind];
        if !(self.settings().error > 0.0 && Kind::FINAL.into_iter().any(is_new)) {
            return false;
        }
        if is_second && self.memory.glances.is_empty() {
            return false;
        }
        if !is_second {
            self.memory.glances.clear();
        }
        let jobs = noise::readings(self.settings()).div_ceil(RAYS_PER_JOB);
        self.enter(Round::Glance { is_second }, jobs);
        true
    }

    /// What some eye rays read, between those that records were made for.
    pub(super) fn glance<M: Medium + ?Sized, S: Scene + ?Sized>(
        &self,
        job: u32,
        world: &World<'_, M, S>,
        output: &mut FilledRecords<'_>,
    ) where
        F: Fn([f32; 2]) -> Ray,
    {
        let Asked::View { ray, .. } = &self.asked else { return };
        let (settings, estimator) = (self.settings(), self.estimator(world));
        let seed = mix(settings.seed ^ 0x9_1a_ce);
        for (i, glance) in output.glances.iter_mut().enumerate() {
            let number = job * RAYS_PER_JOB + i as u32;
            let ray = ray(Asked::at(settings.rays.wrapping_add(number / READINGS as u32)));
            let mut rng = independent(seed, u64::from(number), 0);
            *glance = Glance::new(&radiance(&ray, &estimator, &self.caches.reader(), &settings.eye, &mut rng));
        }
    }

    /// Takes the readings of a job.
    pub(super) fn take_glances(&mut self, glances: &[Glance], is_second: bool) {
        if is_second {
            let first = self.taken * RAYS_PER_JOB;
            let before = self.memory.glances.as_slice().get(first as usize..).unwrap_or(&[]);
            let readings = before.as_chunks().0.iter().zip(glances.as_chunks().0);
            for (number, (before, after)) in (first / READINGS as u32..).zip(readings) {
                let at = Asked::at(self.caches.settings.rays.wrapping_add(number));
                self.noise.add(at, before, after, self.dark);
            }
        } else {
            self.is_cut |= self.memory.glances.extend_from_slice(glances).is_err();
        }
    }

    /// How often each kind is to be estimated once more in each region of the picture, for what the glances have told there. Work and its price are taken for
    /// those of a picture that is all as the region is.
    pub(super) fn plan_more(&mut self) {
        let most = presets::record_noise(self.settings().error);
        let efforts = Kind::FINAL.map(|kind| self.efforts[kind][0] / self.efforts[kind][1]);
        let costs = Kind::FINAL.map(|kind| {
            let samples = self.settings().effort(kind).map_or(0, |effort| effort.samples);
            self.efforts[kind][0] * f64::from(samples)
        });
        let left = self.noise.left(efforts);
        // Blind estimates, and second ones with all their samples; about, for nothing hangs on it but where it stops to pay.
        let spent = self.walks() as f64 + costs.iter().sum::<f64>();
        let coarser = Kind::FINAL.map(|kind| self.settings().coarser[kind as usize]);
        let mut variance = 0.0;
        for (region, left) in left.iter().enumerate() {
            let rounds = rounds_for(left, (costs, coarser), most * most, spent);
            Kind::FINAL.into_iter().zip(rounds).for_each(|(kind, rounds)| self.more[kind][region] = rounds);
            variance += noise::variance_after(left, rounds) / noise::REGIONS as f64;
        }
        self.left = Some(libm::sqrt(variance) as f32);
    }
}
