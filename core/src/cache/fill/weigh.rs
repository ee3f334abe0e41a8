//! A round in which eye rays sample all light, to tell how much of it each kind brings.

use super::{Filling, RAYS_PER_JOB, Round};
use crate::cache::Caches;
use crate::cache::asked::Asked;
use crate::cache::kind::Kind;
use crate::cache::memory::FilledRecords;
use crate::cache::noise::Glance;
use crate::cache::seen::radiance;
use crate::cache::shares::{RAYS, SCATTERINGS, Shares};
use crate::host::{Medium, Scene};
use crate::math::Ray;
use crate::path;
use crate::sampling::independent;
use crate::sampling::uniform::mix;
use crate::world::World;

impl<F> Filling<'_, F> {
    /// Begins what follows photons: a round that weighs kinds, or records where that is not known or of no use.
    pub(super) fn begin_weighing(&mut self) {
        let is_asked = matches!(self.asked, Asked::View { .. }) && self.settings().error > 0.0;
        // What is made in place of what an audit has found wrong is weighed already, and so is what finer levels go on with.
        if !is_asked || self.caches.dropped > 0 || self.level > 0 {
            return self.begin(0);
        }
        self.memory.glances.clear();
        let rays = RAYS.min(self.settings().rays);
        self.enter(Round::Weigh, rays.div_ceil(RAYS_PER_JOB));
    }

    /// All light along some eye rays, without records.
    pub(super) fn weigh<M: Medium + ?Sized, S: Scene + ?Sized>(
        &self,
        job: u32,
        world: &World<'_, M, S>,
        output: &mut FilledRecords<'_>,
    ) where
        F: Fn([f32; 2]) -> Ray,
    {
        let Asked::View { ray, .. } = &self.asked else { return };
        let (settings, mut estimator) = (self.settings(), self.estimator(world));
        let path::Settings { max_scatterings, .. } = settings.paths;
        estimator.paths = path::Settings { max_scatterings: max_scatterings.min(SCATTERINGS), ..settings.paths };
        let seed = mix(settings.seed ^ 0x3e_1a_57);
        for (i, glance) in output.glances.iter_mut().enumerate() {
            let number = job * RAYS_PER_JOB + i as u32;
            let mut rng = independent(seed, u64::from(number), 0);
            let seen = radiance(&ray(Asked::at(number)), &estimator, &Caches::default(), &settings.eye, &mut rng);
            *glance = Glance::scattered(&seen);
        }
    }

    /// Takes what eye rays have found: how coarse each kind may be.
    pub(super) fn take_shares(&mut self) {
        self.caches.shares = Shares::new(self.memory.glances.as_slice());
        let coarser = self.caches.shares.coarser();
        self.memory.glances.clear();
        let all = &mut self.caches.settings.coarser;
        for (kind, (factor, new)) in Kind::ALL.into_iter().zip(all.iter_mut().zip(coarser)) {
            // Records of other views that ask for more stay as fine as they are.
            *factor = if self.caches.slots[kind].len() > 0 { new.min(*factor) } else { new };
        }
    }
}
