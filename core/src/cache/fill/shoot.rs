//! Rounds of photons: until cells of light are known well enough.

use super::{Filling, Round};
use crate::cache::memory::FilledRecords;
use crate::cache::photons::{CELLS_PER_JOB, PATHS_PER_JOB, PhotonEffort};
use crate::cache::settings::Settings;
use crate::host::{Medium, Scene};
use crate::world::World;

/// Photons of the first round of them.
const FIRST_PHOTONS: u32 = 4096;

impl<F> Filling<'_, F> {
    /// The photons to shoot: none if nothing is made by walks.
    pub(super) fn photons(&self) -> Option<PhotonEffort> {
        let Settings { photons, multiple, irradiance, .. } = self.settings();
        photons.filter(|_| multiple.is_some() || irradiance.is_some())
    }

    /// The next round of photons, no larger than all before it, or after the last what follows.
    pub(super) fn shoot_more(&mut self, effort: &PhotonEffort) {
        let (paths, flights) = (self.memory.photons.paths(), self.memory.photons.flights());
        let mut more = if paths == 0 { FIRST_PHOTONS.min(effort.paths) } else { paths.min(effort.paths - paths) };
        if paths > 0 {
            let left = effort.flights.saturating_sub(flights) as f64 * f64::from(paths) / flights.max(1) as f64;
            // Casts saturate.
            more =
                more.min(left as u32).min((f64::from(paths) * (self.memory.photons.times(effort.enough) - 1.0)) as u32);
        }
        let jobs = more / PATHS_PER_JOB;
        self.photons_before = paths;
        if jobs > 0 {
            self.enter(Round::Shoot, jobs);
        } else {
            self.enter(Round::Divide, (self.memory.photons.len() as u32).div_ceil(CELLS_PER_JOB).max(1));
        }
    }

    pub(super) fn shoot<M: Medium + ?Sized, S: Scene + ?Sized>(
        &self,
        job: u32,
        world: &World<'_, M, S>,
        output: &mut FilledRecords<'_>,
    ) {
        let (photons, settings) = (&self.memory.photons, self.settings());
        let Some(effort) = &settings.photons else { return };
        for path in 0..PATHS_PER_JOB {
            let path = self.photons_before + job * PATHS_PER_JOB + path;
            match photons.shoot(path, world, (effort, &settings.paths, self.seed()), &mut output.deposits) {
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
