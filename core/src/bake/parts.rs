//! Parts of a grid, for several machines: bricks shared out, and grids put together.

use super::fill::Bake;
use super::grid::{BakeMemory, ProbeGrid};
use super::probe::{INNER, Probe};
use super::settings::BakeError;

impl Bake<'_, '_> {
    /// Bakes part number `part`, from 0, of so many parts of the bricks, which are spread evenly over the box; of all other probes nothing will be known. With
    /// [`BakeSettings::level`](super::BakeSettings::level) bricks do not depend on each other, and parts put together by [`ProbeGrid::merge`] are the bits of a
    /// bake in one piece. Not with photons, which serve all bricks at once. For bakes that have not begun.
    ///
    /// ```
    /// # use fogbow::{host::Empty, light::{Light, PointLight}, math::{Bounds, Vec3}, medium::Homogeneous, phase::Phase, spectrum::Spectrum};
    /// # use fogbow::{work, world::{Outline, World}};
    /// # use fogbow::bake::{Bake, BakeSettings, BakedProbes};
    /// # #[cfg(feature = "alloc")] {
    /// # let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC)?;
    /// # let lamps = [Light::Point(PointLight::from_flux(2.0 * Vec3::Y, Spectrum::ONE)?)];
    /// # let world = World { medium: &fog, scene: &Empty, lights: (&lamps).into() };
    /// # let outline = Outline::of(&world, Bounds { min: Vec3::ZERO, max: Vec3::ONE });
    /// # let mut settings = BakeSettings { error: 0.3, level: Some(0.01), ..BakeSettings::for_outline(&outline, [8, 5, 1]) };
    /// # settings.paths.max_scatterings = 2;
    /// // A machine each.
    /// let baked = |part| {
    ///     let mut bake = Bake::new(settings)?.of_part(part, 3);
    ///     work::finish(&mut bake, &world, &mut BakedProbes::default());
    ///     Ok::<_, fogbow::bake::BakeError>(bake.finish())
    /// };
    /// let mut merged = baked(2)?;
    /// merged.merge(&baked(0)?)?;
    /// merged.merge(&baked(1)?)?;
    ///
    /// let mut whole = Bake::new(settings)?;
    /// work::finish(&mut whole, &world, &mut BakedProbes::default());
    /// assert!((0..40).all(|probe| merged.held(probe) == whole.grid().held(probe)));
    /// # }
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    #[must_use]
    pub fn of_part(self, part: u32, of: u32) -> Self {
        let counts = self.grid().brick_counts();
        self.only(|brick| part_of(brick, counts, of) == part)
    }
}

/// The part that has a brick: every row, column and layer goes through all parts.
fn part_of(brick: usize, [columns, rows, _]: [u32; 3], of: u32) -> u32 {
    // Steps between rows and between layers as of the sequence R₂ (Roberts 2018), so that no part is some rows of the box.
    let of = u64::from(of.max(1));
    let [row, layer] = [0.754_877_67, 0.569_840_3].map(|share| ((of as f64 * share) as u64).max(1));
    let (columns, rows, brick) = (u64::from(columns.max(1)), u64::from(rows.max(1)), brick as u64);
    let [x, y, z] = [brick % columns, brick / columns % rows, brick / (columns * rows)];
    ((x + row * y + layer * z) % of) as u32
}

impl ProbeGrid<'_> {
    /// Takes all bricks that another grid knows and this one does not: see [`Bake::of_part`]. Those that nobody knows are due, if this is gone on
    /// with.
    ///
    /// # Errors
    /// [`BakeError::Grid`] for a grid of other cells or of other light, and nothing is taken then.
    ///
    /// ```
    /// # use fogbow::{host::Empty, math::{Bounds, Vec3}, world::{Outline, World}};
    /// # use fogbow::bake::{Bake, BakeError, BakeSettings};
    /// # #[cfg(feature = "alloc")] {
    /// # let bounds = Bounds { min: Vec3::ZERO, max: Vec3::ONE };
    /// # let outline = Outline::of(&World { medium: &Empty, scene: &Empty, lights: (&[]).into() }, bounds);
    /// let grid = |counts| Ok::<_, BakeError>(Bake::new(BakeSettings::for_outline(&outline, counts))?.finish());
    /// assert_eq!(grid([2, 2, 2])?.merge(&grid([2, 2, 3])?), Err(BakeError::Grid));
    /// # }
    /// # Ok::<(), fogbow::bake::BakeError>(())
    /// ```
    pub fn merge(&mut self, other: &ProbeGrid<'_>) -> Result<(), BakeError> {
        let light = |grid: &ProbeGrid<'_>| (grid.lattice, grid.basis, grid.quantity, grid.orders);
        if light(self) != light(other) {
            return Err(BakeError::Grid);
        }
        let each = self.basis.count();
        for brick in 0..self.memory.bricks.len() {
            let here = self.memory.bricks.as_slice()[brick];
            let there = other.brick_at(self.place(brick));
            let known = there.map(|there| (there, other.memory.bricks.as_slice()[there]));
            let Some((there, progress)) = known.filter(|(_, there)| here.passes == 0 && there.passes > 0) else {
                self.memory.bricks.as_mut_slice()[brick].due = here.due.max(1);
                continue;
            };
            for ((to, _), (from, _)) in self.in_brick(brick).zip(other.in_brick(there)) {
                let [to_numbers, from_numbers] = [to, from].map(|index| index * each..(index + 1) * each);
                let BakeMemory { values, deviations, probes, bricks: _, places: _ } = &mut self.memory;
                values.as_mut_slice()[to_numbers.clone()]
                    .copy_from_slice(&other.memory.values.as_slice()[from_numbers.clone()]);
                deviations.as_mut_slice()[to_numbers]
                    .copy_from_slice(&other.memory.deviations.as_slice()[from_numbers]);
                let (probe, from) = (&mut probes.as_mut_slice()[to], other.memory.probes.as_slice()[from]);
                *probe = Probe { state: from.state & !INNER | probe.state & INNER, ..from };
            }
            self.memory.bricks.as_mut_slice()[brick] = progress;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_brick_is_in_one_part_and_parts_are_as_large_as_each_other() {
        for counts in [[8, 8, 8], [1, 5, 7], [16, 4, 4], [3, 1, 1]] {
            for of in [1, 2, 5, 16] {
                let sizes = &mut [0_u32; 16][..of as usize];
                let bricks = counts.iter().product::<u32>();
                (0..bricks as usize).for_each(|brick| sizes[part_of(brick, counts, of) as usize] += 1);
                assert_eq!(sizes.iter().sum::<u32>(), bricks);
                // Of few bricks, some parts may have none.
                let (least, most) = (sizes.iter().min().unwrap(), sizes.iter().max().unwrap());
                assert!(bricks < 8 * of || 2 * least >= *most, "{counts:?} of {of}: {sizes:?}");
            }
        }
    }
}
