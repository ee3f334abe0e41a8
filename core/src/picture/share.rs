//! What of a picture is taken, where several machines share it out.

use core::ops::Range;

#[cfg(feature = "alloc")]
use super::tiles::Settings;
use super::tiles::Tiles;

/// The part of a picture that [`Tiles`](super::Tiles) take.
///
/// Parts of tiles have all samples of some of the pixels, parts of samples some of the samples of all pixels; either way every sample of the
/// picture is in one part, and sums of parts merged ([`Tiles::merge`](super::Tiles::merge)) are those of the whole, to the bit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Share {
    /// All of it.
    #[default]
    Whole,
    /// Number `part`, from 0, of so many parts of the tiles, which are spread evenly over the picture.
    Tiles {
        /// Which.
        part: u32,
        /// Of how many.
        of: u32,
    },
    /// Number `part`, from 0, of so many parts of the samples of every pixel, each a run of them.
    Samples {
        /// Which.
        part: u32,
        /// Of how many.
        of: u32,
    },
}

impl Share {
    /// Indices of the first of its samples of a pixel, and of the one behind its last, if there are to be so many in passes of this length.
    /// Passes stay whole where there are enough of them for all parts: what their samples share is then made once.
    ///
    /// ```
    /// use fogbow::picture::Share;
    /// let ranges = |samples, pass| [0, 1, 2].map(|part| Share::Samples { part, of: 3 }.samples(samples, pass));
    /// assert_eq!(ranges(16, 1), [[0, 5], [5, 10], [10, 16]]);
    /// assert_eq!(ranges(30, 8), [[0, 8], [8, 16], [16, 30]]);
    /// assert_eq!(ranges(16, 8), ranges(16, 1));
    /// assert_eq!(Share::Tiles { part: 1, of: 3 }.samples(16, 1), [0, 16]);
    /// ```
    #[must_use]
    pub fn samples(self, samples: u32, pass: u32) -> [u32; 2] {
        let Self::Samples { part, of } = self else { return [0, samples] };
        let (pass, of) = (pass.max(1), of.max(1));
        let length = if samples.div_ceil(pass) >= of { pass } else { 1 };
        let runs = u64::from(samples.div_ceil(length));
        [part, part.saturating_add(1)].map(|end| {
            let run = runs * u64::from(end.min(of)) / u64::from(of);
            (run * u64::from(length)).min(u64::from(samples)) as u32
        })
    }

    /// Whether it has the tile of this column and row.
    ///
    /// ```
    /// use fogbow::picture::Share;
    /// // Neighbours in a row, and in a column, belong to different parts.
    /// let has = |x, y| Share::Tiles { part: 0, of: 4 }.has([x, y]);
    /// assert!(has(0, 0) && !has(1, 0) && !has(0, 1) && has(4, 0));
    /// assert!(Share::Whole.has([3, 3]));
    /// ```
    #[must_use]
    pub fn has(self, [column, row]: [u32; 2]) -> bool {
        let Self::Tiles { part, of } = self else { return true };
        (u64::from(column) + Self::later(of, row)) % u64::from(of.max(1)) == u64::from(part)
    }

    /// By how many tiles a row begins later than the first: by the golden ratio of a period more than the row before, so that no part is a few columns.
    fn later(of: u32, row: u32) -> u64 {
        (u64::from(of.max(1)) * 618 / 1000).max(1) * u64::from(row)
    }

    /// Of the tiles of a row, of so many columns, the first that it has and how many it has, each a period behind the one before.
    fn in_row(part: u32, of: u32, columns: u32, row: u32) -> [u32; 2] {
        let of = u64::from(of.max(1));
        let first = (u64::from(part) + of - Self::later(of as u32, row) % of) % of;
        let count = if u64::from(part) < of { u64::from(columns).saturating_sub(first).div_ceil(of) } else { 0 };
        [first, count].map(|number| number as u32)
    }
}

impl Share {
    /// Whether it has no tile of a picture at all, as one of more parts than a row has tiles may.
    #[cfg(feature = "alloc")]
    pub(super) fn is_empty(self, settings: &Settings) -> bool {
        /// Rows of tiles beyond which every part has some, and bytes are not worth a look.
        const MOST_ROWS: u32 = 1 << 16;
        let Self::Tiles { part, of } = self else { return false };
        let [columns, rows] = settings.grid();
        columns < of && rows <= MOST_ROWS && (0..rows).all(|row| Self::in_row(part, of, columns, row)[1] == 0)
    }
}

impl<Q, C> Tiles<'_, Q, C> {
    /// Jobs of a pass.
    pub(super) fn job_count(&self) -> u32 {
        let Share::Tiles { part, of } = self.share else { return self.settings.pixels().div_ceil(self.pixels_per_job) };
        let [columns, rows] = self.settings.grid();
        let tiles: u32 = (0..rows).map(|row| Share::in_row(part, of, columns, row)[1]).sum();
        tiles * self.jobs_of_tile()
    }

    /// Jobs of a tile of a part: pieces of rows of pixels.
    fn jobs_of_tile(&self) -> u32 {
        let side = self.settings.tile.max(1);
        side * side.div_ceil(self.pixels_per_job)
    }

    /// The pixels of a job: their numbers, row by row. None beyond the edge of the picture.
    pub(super) fn pixels_of(&self, job: u32) -> Range<u32> {
        let Share::Tiles { part, of } = self.share else {
            let from = job * self.pixels_per_job;
            return from..(from + self.pixels_per_job).min(self.settings.pixels());
        };
        let ([columns, rows], [width, height], side) =
            (self.settings.grid(), self.settings.size, self.settings.tile.max(1));
        let (mut tile, piece) = (job / self.jobs_of_tile(), job % self.jobs_of_tile());
        for row in 0..rows {
            let [first, count] = Share::in_row(part, of, columns, row);
            if tile >= count {
                tile -= count;
                continue;
            }
            let pieces = side.div_ceil(self.pixels_per_job);
            let [left, y] = [(first + tile * of) * side, row * side + piece / pieces];
            let from = left + piece % pieces * self.pixels_per_job;
            let until = (from + self.pixels_per_job).min(left + side).min(width);
            return if y < height && from < until { y * width + from..y * width + until } else { 0..0 };
        }
        0..0
    }
}

impl<Q, C> Tiles<'_, Q, C> {
    /// Takes a part of the picture only: the same that was taken before, if this one was left. [`Settings::samples`](super::Settings::samples) are those of the whole
    /// picture, in passes of `pass` samples that share something, or of 1. A [`Settings::goal`](super::Settings::goal) would be judged by the tiles that are taken, so
    /// with one, parts are not those of the whole.
    ///
    /// ```
    /// # #[cfg(feature = "alloc")] {
    /// use fogbow::picture::{Sample, Settings, Share, TileOutput, Tiles};
    /// use fogbow::{sampling::{Generator, Independent, uniform}, spectrum::Spectrum, work};
    /// let settings = Settings { size: [19, 9], layers: 1, samples: 50, goal: None, seed: 0, tile: 4 };
    /// let noise = |_: &Sample<'_, ()>, rng: &mut Generator, layers: &mut [Spectrum]| layers[0] = Spectrum::splat(uniform(rng));
    /// let taken = |share| {
    ///     let mut tiles: Tiles<'_, _, ()> = Tiles::new(settings, Independent).of_share(share, 1);
    ///     work::finish(&mut tiles, &noise, &mut TileOutput::default());
    ///     tiles
    /// };
    /// // A machine each; put together in any order.
    /// let mut merged: Tiles<'_, _, ()> = Tiles::new(settings, Independent);
    /// [2, 0, 1].iter().for_each(|&part| merged.merge(&taken(Share::Samples { part, of: 3 })));
    /// assert_eq!(merged.into_sums(), taken(Share::Whole).into_sums());
    /// # }
    /// ```
    #[must_use]
    pub fn of_share(mut self, share: Share, pass: u32) -> Self {
        let [first, end] = share.samples(self.settings.samples, pass);
        let is_left = (self.share, self.first) == (share, first);
        (self.share, self.first) = (share, first);
        self.settings.samples = end - first;
        let done = self.least_count();
        self.is_enough |= done >= self.settings.samples;
        if !is_left {
            self.begin(done.saturating_add(1));
        }
        self
    }

    /// Index of the first sample of a pixel that is taken: 0 but for parts of samples.
    ///
    /// ```
    /// # #[cfg(feature = "alloc")] {
    /// # use fogbow::{picture::{Settings, Share, Tiles}, sampling::Independent};
    /// # let settings = Settings { size: [16, 8], layers: 1, samples: 64, goal: None, seed: 0, tile: 8 };
    /// let tiles = Tiles::<'_, _, ()>::new(settings, Independent).of_share(Share::Samples { part: 1, of: 4 }, 1);
    /// assert_eq!(tiles.first(), 16);
    /// # }
    /// ```
    #[must_use]
    pub fn first(&self) -> u32 {
        self.first
    }

    /// Adds the samples of a part to a whole picture, which has none of them yet: see [`Tiles::of_share`]. A picture of another size or with other
    /// layers adds nothing. Noise is not known of merged pictures: without a [`Settings::goal`](super::Settings::goal).
    ///
    /// ```
    /// # #[cfg(feature = "alloc")] {
    /// # use fogbow::picture::{Sample, Settings, Share, TileOutput, Tiles};
    /// # use fogbow::{sampling::{Generator, Independent}, spectrum::Spectrum, work};
    /// # let settings = Settings { size: [5, 4], layers: 1, samples: 3, goal: None, seed: 0, tile: 2 };
    /// # let white = |_: &Sample<'_, ()>, _: &mut Generator, layers: &mut [Spectrum]| layers[0] = Spectrum::ONE;
    /// let part = |part| {
    ///     let mut tiles: Tiles<'_, _, ()> = Tiles::new(settings, Independent).of_share(Share::Tiles { part, of: 2 }, 1);
    ///     work::finish(&mut tiles, &white, &mut TileOutput::default());
    ///     tiles
    /// };
    /// let mut merged: Tiles<'_, _, ()> = Tiles::new(settings, Independent);
    /// merged.merge(&part(1));
    /// assert_eq!((merged.least_count(), merged.counts().samples), (0, 3 * 10));
    /// merged.merge(&part(0));
    /// assert!(merged.is_done() && merged.mean(4, 3, 0) == Spectrum::ONE);
    /// # }
    /// ```
    pub fn merge<P>(&mut self, other: &Tiles<'_, P, C>) {
        let is_same = (self.settings.size, self.settings.layers) == (other.settings.size, other.settings.layers);
        if !is_same {
            return;
        }
        let layers = self.settings.layers as usize;
        let own = (0..other.settings.pixels()).filter(|&pixel| other.share.has(other.settings.tile_of(pixel)));
        for pixel in own.map(|pixel| pixel as usize) {
            let all = pixel * layers..(pixel + 1) * layers;
            let sums = self.sums.as_mut_slice()[all.clone()].iter_mut();
            sums.zip(&other.sums.as_slice()[all]).for_each(|(sum, more)| sum.merge(more));
            let count = &mut self.counts.as_mut_slice()[pixel];
            *count = count.saturating_add(other.counts.as_slice()[pixel]);
        }
        self.taken_samples.samples += other.taken_samples.samples;
        self.taken_samples.non_finite += other.taken_samples.non_finite;
        self.taken = 0;
        self.is_enough |= self.least_count() >= self.settings.samples;
    }

    /// How many pixels are to have samples.
    ///
    /// ```
    /// # #[cfg(feature = "alloc")] {
    /// # use fogbow::{picture::{Settings, Share, Tiles}, sampling::Independent};
    /// # let settings = Settings { size: [16, 8], layers: 1, samples: 64, goal: None, seed: 0, tile: 8 };
    /// let tiles = Tiles::<'_, _, ()>::new(settings, Independent).of_share(Share::Tiles { part: 1, of: 2 }, 1);
    /// assert_eq!(tiles.pixel_count(), 64);
    /// # }
    /// ```
    #[must_use]
    pub fn pixel_count(&self) -> u32 {
        (0..self.settings.pixels()).filter(|&pixel| self.has(self.place(pixel))).count() as u32
    }
}

#[cfg(all(test, feature = "alloc"))]
mod tests {
    use super::*;
    use crate::picture::bytes::described;
    use crate::sampling::Independent;

    #[test]
    fn jobs_of_all_parts_have_every_pixel_once() {
        for (size, tile, of) in [([40, 28], 8, 16), ([19, 9], 4, 3), ([5, 4], 2, 2), ([70, 3], 8, 5), ([16, 16], 5, 1)]
        {
            for samples in [1, 7, 64] {
                let settings = Settings { size, layers: 1, samples, goal: None, seed: 0, tile };
                let mut seen = alloc::vec![0; (size[0] * size[1]) as usize];
                for part in 0..of {
                    let mut tiles: Tiles<'_, _, ()> =
                        Tiles::new(settings, Independent).of_share(Share::Tiles { part, of }, 1);
                    tiles.begin(samples);
                    for pixel in (0..tiles.job_count()).flat_map(|job| tiles.pixels_of(job)) {
                        assert!(tiles.has(tiles.place(pixel)));
                        seen[pixel as usize] += 1;
                    }
                    let is_empty = tiles.job_count() == 0;
                    assert!(!is_empty || tiles.is_done(), "nothing to do is done");
                    // Of 16 parts of 5 × 4 tiles, two have none.
                    let found = described(&tiles.to_bytes(7)).unwrap();
                    assert_eq!((found.is_done, found.share.is_empty(&settings)), (is_empty, is_empty));
                    let read = Tiles::<'_, _, ()>::read(settings, Independent, 7, &tiles.to_bytes(7));
                    assert_eq!(read.unwrap().to_bytes(7), tiles.to_bytes(7));
                }
                assert!(seen.iter().all(|&count| count == 1), "{size:?} {tile} {of} {samples}: {seen:?}");
            }
        }
    }
}
