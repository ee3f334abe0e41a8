//! Rounds of photons: until cells of light are known well enough.

use super::{Filling, Round};
use crate::cache::memory::FilledRecords;
use crate::cache::photons::{CELLS_PER_JOB, PATHS_PER_JOB};
use crate::host::{Medium, Scene};
use crate::world::World;

impl<F> Filling<'_, F> {
    /// The next round of photons, or after the last what follows.
    pub(super) fn shoot_more(&mut self) {
        let Some((effort, _)) = self.caches.photon_effort() else { return };
        let photons = &mut self.memory.photons;
        let (more, cells) = (photons.next_round(&effort), photons.len() as u32);
        self.photons_before = photons.paths();
        self.photons_of_round = more.unwrap_or(0);
        match more {
            Some(more) => self.enter(Round::Shoot, more.div_ceil(PATHS_PER_JOB)),
            None => self.enter(Round::Divide, cells.div_ceil(CELLS_PER_JOB).max(1)),
        }
    }

    pub(super) fn shoot<M: Medium + ?Sized, S: Scene + ?Sized>(
        &self,
        job: u32,
        world: &World<'_, M, S>,
        output: &mut FilledRecords<'_>,
    ) {
        let (photons, settings) = (&self.memory.photons, self.settings());
        let Some((effort, seed)) = self.caches.photon_effort() else { return };
        let first = job * PATHS_PER_JOB;
        for path in first..(first + PATHS_PER_JOB).min(self.photons_of_round) {
            let path = self.photons_before + path;
            match photons.shoot(path, world, (&effort, &settings.paths, seed), &mut output.deposits) {
                Ok(flights) => output.flights += u64::from(flights),
                Err(_) => output.is_cut = true,
            }
            output.paths += 1;
        }
    }

    pub(super) fn divide<M: Medium + ?Sized, S: Scene + ?Sized>(
        &self,
        job: u32,
        world: &World<'_, M, S>,
        output: &mut FilledRecords<'_>,
    ) {
        let cells = self.memory.photons.len() as u32;
        for cell in job * CELLS_PER_JOB..((job + 1) * CELLS_PER_JOB).min(cells) {
            if self.memory.photons.is_whole(cell, world.scene) {
                output.is_cut |= output.open.push(cell).is_err();
            }
        }
    }
}
