//! Rounds of photons: how many are due, which cells they are to light, and how much power they should have there.

use super::{LEAST_PATHS, PhotonCell, PhotonEffort, PhotonGrid};

/// Part of all photons that are only counted. Where walks end must not depend on the photons whose light they find: dark cells that many
/// happened to pass would be too bright. Larger: photons that bring no light; smaller: walks end nowhere but where light is known very well.
pub(super) const COUNTED: f64 = 0.25;

/// Part of the lit cells that photons are to know well. More: all wait for the darkest corner; less: dark parts of a picture are noisy.
const KNOWN: f64 = 0.9;

/// Photons of the first round.
pub(super) const FIRST: u32 = 4096;

/// Photons before them, that only see how far from the bounds something scatters. Fewer: cells end before walls do; more: time.
const SCOUTS: u32 = 256;

impl PhotonGrid<'_> {
    /// Photons of the next round, no more than all before it; `None` after the last. The first see how far cells reach ([`PhotonGrid::fit`]); the next are counted, so long that they are about [`COUNTED`]
    /// of all, then they bring light: as many as it takes until [`PhotonEffort::enough`] pass nearly every cell that walks may end in.
    pub(in crate::cache) fn next_round(&mut self, effort: &PhotonEffort) -> Option<u32> {
        if self.scouted.is_some() {
            if self.paths == 0 {
                return (effort.paths > 0 && effort.flights > 0).then_some(SCOUTS.min(effort.paths));
            }
            self.fit(&effort.bounds);
        }
        let (paths, counted) = (self.paths, self.counted);
        if paths == 0 {
            let first = f64::from(FIRST).min(COUNTED * f64::from(effort.paths)) as u32;
            return (effort.paths > 0 && effort.flights > 0).then_some(first.max(1));
        }
        if self.lit.is_none() {
            self.weigh();
        }
        // As many in all as flights allow. Casts saturate.
        let per_path = (self.flights as f64 / f64::from(paths)).max(1.0);
        let most = effort.paths.min((effort.flights as f64 / per_path) as u32);
        if self.lit.is_none() {
            let wanted = f64::from(counted) * (1.0 + self.times(effort.enough));
            let due = (COUNTED * wanted.min(f64::from(most))) as u32;
            if counted < due {
                return Some(counted.min(due - counted));
            }
            self.widen();
            self.lit = Some(most.min(wanted as u32));
        }
        let end = self.lit.map_or(0, |end| end.min(most));
        (paths < end).then(|| paths.min(end - paths))
    }

    /// Asks for light where something scatters and beside it, where slopes look. Ends of rows are beside beginnings: some cells more.
    fn widen(&mut self) {
        let ([nx, ny, _], brought) = (self.counts.map(|count| count as usize), self.brought());
        let cells = self.cells.as_mut_slice();
        for number in 0..cells.len() {
            let scatters = |number: usize| cells.get(number).is_some_and(|cell| cell.scatters);
            let beside = |stride| scatters(number.wrapping_sub(stride)) || scatters(number + stride);
            let is_lit = scatters(number) || beside(1) || beside(nx) || beside(nx * ny);
            if let Some(cell) = cells.get_mut(number).filter(|cell| is_lit && !cell.is_lit) {
                (cell.is_lit, cell.missed) = (true, brought);
            }
        }
    }

    /// How many times the counted paths it takes until `enough` photons have passed nearly every cell that walks may end in.
    /// Infinite if no cell has been passed by some, and 0 if there are none.
    fn times(&self, enough: u32) -> f64 {
        if !self.cells.as_slice().iter().any(|cell| cell.scatters) {
            return 0.0;
        }
        f64::from(enough) / f64::from(self.met_by_most())
    }

    /// By how many photons nearly every cell has been passed that walks may end in.
    fn met_by_most(&self) -> u32 {
        let is_known = |cell: &&PhotonCell| cell.scatters && cell.paths >= LEAST_PATHS;
        let met = || self.cells.as_slice().iter().filter(is_known).map(|cell| cell.paths);
        let (all, most) = met().fold((0_u32, 0), |(all, most), paths| (all + 1, most.max(paths)));
        let most_dark = (1.0 - KNOWN) * f64::from(all);
        let (mut low, mut high) = (0, most);
        while low < high {
            let middle = low + (high - low).div_ceil(2);
            let darker = met().filter(|&paths| paths < middle).count();
            if f64::from(darker as u32) <= most_dark { low = middle } else { high = middle - 1 }
        }
        low
    }

    /// Takes from the photons that are counted so far what power they should have: in proportion to the light of a cell, so that as many come to each cell that
    /// scatters, but to bright ones as they do. Not where too few were counted: windows that are far too low split photons without end.
    fn weigh(&mut self) {
        let lit = self.cells.as_slice().iter().filter(|cell| cell.scatters);
        let (sum, count) = lit.fold((0.0, 0_u32), |(sum, count), cell| (sum + f64::from(cell.light), count + 1));
        let usual = (sum / f64::from(count)) as f32;
        for cell in self.cells.as_mut_slice() {
            let is_known = cell.paths >= LEAST_PATHS && usual > 0.0;
            cell.wanted = if is_known { (cell.light / usual).min(1.0) } else { 0.0 };
        }
    }
}
