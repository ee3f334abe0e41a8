//! A picture on its way as bytes: all that is needed to go on with it as if it had never been left.
//!
//! Little endian on every target, without gaps:
//!
//! | offset | bytes | what |
//! |---|---|---|
//! | 0 | 8 | [`MAGIC`] |
//! | 8 | 4 | [`VERSION`] |
//! | 12 | 8 | columns and rows |
//! | 20 | 4 | layers |
//! | 24 | 12 | the pass at hand: samples that it takes pixels to, jobs taken, pixels of a job |
//! | 36 | 4 | side of tiles |
//! | 40 | 8 | noise asked for as `f32`, samples at least; zeros without a goal |
//! | 48 | 4 | samples asked for |
//! | 52 | 4 | bit 0: all pixels have enough; bit 1: there is a goal |
//! | 56 | 8 | seed |
//! | 64 | 16 | samples taken, and those that were not finite |
//! | 80 | 8 | tag: what the picture was made for, a number of the host's choice |
//! | 88 | 16 | the part that is taken: 0 for all, 1 of tiles, 2 of samples; which, of how many; index of the first sample |
//! | 104 | 8 | bytes behind the header |
//! | 112 | 8 | [`Crc`](crate::bytes::Crc) of bytes 0 to 112 and of all from 120 on |
//! | 120 | 3 n l to 51 n l | sums of `l` layers of `n` pixels, each as below |
//! | | 4 n | samples of pixels |
//! | | 20 t | of `t` tiles, with a goal: bit 0 enough, bits 1 and 2 which of two `f64` are known: noise squared when samples were last doubled, and one doubling earlier |
//! | | 24 n | of pixels, with a goal: sum as `f64` and samples before a pass, and after it |
//! | | 8 n | of pixels, with a goal: variance that all doublings tell, as `f64` |
//!
//! A sum is an integer of 16 bytes, of which most are zeros or the sign again: a byte tells how many follow, times 16, and how many zeros come before
//! them; 0 is zero, and 1 all 16. A part of tiles has sums and samples of its own pixels alone.

use alloc::vec::Vec;
use core::convert::Infallible;
use core::fmt;

use super::integrand::Counts;
use super::noise::{Goal, Noise};
use super::share::Share;
use super::sum::PixelSum;
use super::tiles::{Settings, Tiles};
use crate::bytes::{Damage, Format, Sink, halves};
use crate::storage::{Full, List};

/// The first bytes: not text, and damaged by whatever changes ends of lines.
pub const MAGIC: [u8; 8] = *b"\x89FOGPIC\n";

/// Of the layout above.
pub const VERSION: u32 = 5;

/// Length of the header (bytes).
pub const HEADER_BYTES: usize = 120;

const FORMAT: Format = Format { magic: MAGIC, version: VERSION, header: HEADER_BYTES, what: "picture that was left" };

/// Where the words of the header begin, after the version (bytes).
const WORDS_AT: usize = 12;

/// Why bytes are not the picture asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum PictureBytesError {
    /// No such bytes, or damaged ones, or made for something else.
    Damage(Damage),
    /// Of another size, number of layers, seed or goal; in what it differs.
    Settings(&'static str),
    /// Sums or numbers that no passes leave.
    Content,
}

impl From<Damage> for PictureBytesError {
    fn from(damage: Damage) -> Self {
        Self::Damage(damage)
    }
}

impl fmt::Display for PictureBytesError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Damage(damage) => damage.fmt(f),
            Self::Settings(what) => write!(f, "is of a picture with another {what}"),
            Self::Content => f.write_str("holds sums or numbers of samples that no picture has"),
        }
    }
}

impl core::error::Error for PictureBytesError {}

/// Reads element after element.
pub(super) struct Reader<'b>(&'b [u8]);

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        let (head, rest) = self.0.split_first_chunk::<N>().unwrap_or((&[0; N], &[]));
        self.0 = rest;
        *head
    }

    pub(super) fn word(&mut self) -> u32 {
        u32::from_le_bytes(self.take())
    }

    pub(super) fn long(&mut self) -> u64 {
        u64::from_le_bytes(self.take())
    }

    pub(super) fn double(&mut self) -> f64 {
        f64::from_le_bytes(self.take())
    }

    /// What [`put`] has written.
    fn integer(&mut self) -> i128 {
        let [code] = self.take();
        let (count, zeros) = match code {
            0 => return 0,
            1 => (16, 0),
            code => (usize::from(code >> 4), usize::from(code & 15)),
        };
        let mut bytes = [0; 16];
        let (digits, rest) = self.0.split_at_checked(count).unwrap_or((self.0, &[]));
        self.0 = rest;
        let Some(own) = bytes.get_mut(zeros..zeros + digits.len()) else { return 0 };
        own.copy_from_slice(digits);
        if digits.last().is_some_and(|last| *last > 127) {
            bytes[zeros + digits.len()..].fill(255);
        }
        i128::from_le_bytes(bytes)
    }
}

/// Writes a sum: see above.
fn put(sum: i128, bytes: &mut Vec<u8>) {
    let all = sum.to_le_bytes();
    let zeros = (sum.trailing_zeros() / 8) as usize;
    // A sign bit belongs to the digits.
    let signs = (if sum < 0 { !sum } else { sum }).leading_zeros();
    let end = 16 - (signs.saturating_sub(1) / 8) as usize;
    match sum {
        0 => bytes.push(0),
        _ if end - zeros == 16 => {
            bytes.push(1);
            bytes.extend(all);
        }
        _ => {
            bytes.push(((end - zeros) << 4 | zeros) as u8);
            bytes.extend(&all[zeros..end]);
        }
    }
}

/// The fewest bytes behind the header.
fn least_bytes(settings: &Settings) -> Option<usize> {
    let pixels = settings.size[0].checked_mul(settings.size[1])? as usize;
    let room = settings.room();
    let sums = pixels.checked_mul(settings.layers as usize)?.checked_mul(3)?;
    sums.checked_add(pixels.checked_mul(4)?)?.checked_add(room.tiles * 20)?.checked_add(room.pixels.checked_mul(32)?)
}

impl<Q, C> Tiles<'_, Q, C> {
    /// The picture as it is now, in the middle of a pass or between two. `tag` says what it is made for: whoever reads it must give the
    /// same. What integrands have counted is not in it.
    ///
    /// ```
    /// use fogbow::picture::{Goal, Sample, Settings, TileOutput, Tiles};
    /// use fogbow::{sampling::{Generator, Independent, uniform}, spectrum::Spectrum, work};
    /// let goal = Some(Goal { noise: 0.05, least: 8 });
    /// let settings = Settings { size: [17, 8], layers: 1, samples: 4096, goal, seed: 0, tile: 8 };
    /// let ramp = |sample: &Sample<'_, ()>, rng: &mut Generator, layers: &mut [Spectrum]| {
    ///     layers[0] = Spectrum::splat(if sample.x < 8 { 1.0 } else { 2.0 * uniform(rng) });
    /// };
    /// // Left after some jobs, and taken up again by another run of the program.
    /// let mut left = Tiles::new(settings, Independent);
    /// for _ in 0..100 {
    ///     work::step(&mut left, &ramp, &mut TileOutput::default());
    /// }
    /// let bytes = left.to_bytes(7);
    /// let mut taken_up = Tiles::read(settings, Independent, 7, &bytes)?;
    /// work::finish(&mut taken_up, &ramp, &mut TileOutput::default());
    ///
    /// let mut whole: Tiles<'_, _, ()> = Tiles::new(settings, Independent);
    /// work::finish(&mut whole, &ramp, &mut TileOutput::default());
    /// assert_eq!(taken_up.into_sums(), whole.into_sums());
    /// # Ok::<(), fogbow::picture::PictureBytesError>(())
    /// ```
    #[must_use]
    pub fn to_bytes(&self, tag: u64) -> Vec<u8> {
        let Self { settings, until, taken_samples, .. } = self;
        // A finished one is the same bytes however it came about.
        let [taken, pixels_per_job] = if self.is_enough { [0, 1] } else { [self.taken, self.pixels_per_job] };
        let until = if self.is_enough { until.max(&settings.samples) } else { until };
        let goal = settings.goal.unwrap_or(Goal { noise: 0.0, least: 0 });
        let flags = u32::from(self.is_enough) | u32::from(settings.goal.is_some()) << 1;
        let [columns, rows] = settings.size;
        let share = match self.share {
            Share::Whole => [0; 3],
            Share::Tiles { part, of } => [1, part, of],
            Share::Samples { part, of } => [2, part, of],
        };
        let layers = settings.layers as usize;
        let own = || (0..settings.pixels()).filter(|&pixel| self.has(self.place(pixel))).map(|pixel| pixel as usize);
        let mut body = Vec::with_capacity(4 * least_bytes(settings).unwrap_or(0));
        for pixel in own() {
            let sums = &self.sums.as_slice()[pixel * layers..][..layers];
            sums.iter().flat_map(|sum| sum.0).for_each(|sum| put(sum, &mut body));
        }
        own().for_each(|pixel| body.extend(self.counts.as_slice()[pixel].to_le_bytes()));
        if let Some(noise) = &self.noise {
            noise.write(&mut body);
        }
        let asked = [settings.tile, goal.noise.to_bits(), goal.least, settings.samples, flags];
        let words = [columns, rows, settings.layers, *until, taken, pixels_per_job].into_iter().chain(asked);
        let longs = [settings.seed, taken_samples.samples, taken_samples.non_finite, tag].map(halves);
        let last = share.into_iter().chain([self.first]).chain(halves(body.len() as u64));
        let mut bytes = Vec::with_capacity(HEADER_BYTES + body.len());
        let write = |sink: Sink<'_, Infallible>| sink(&body);
        let Ok(()) = FORMAT.write(words.chain(longs.into_iter().flatten()).chain(last), &write, &mut |part| {
            bytes.extend(part);
            Ok(())
        });
        bytes
    }
}

/// What the bytes of a picture say of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Described {
    /// How it is sampled; of a part of samples, those of the part.
    pub settings: Settings,
    /// What it was made for.
    pub tag: u64,
    /// What of the picture it is.
    pub share: Share,
    /// Index of the first sample of a pixel.
    pub first: u32,
    /// Whether all samples were taken.
    pub is_done: bool,
    /// Samples that were taken.
    pub counts: Counts,
    /// The pass at hand.
    pass: [u32; 3],
}

/// What the bytes of a picture are of, for those that do not know.
///
/// # Errors
/// Bytes that are damaged, or no picture.
///
/// ```
/// use fogbow::picture::bytes::{VERSION, described};
/// use fogbow::picture::{PictureBytesError, Settings, Share, Tiles};
/// use fogbow::sampling::Independent;
/// let settings = Settings { size: [4, 3], layers: 1, samples: 64, goal: None, seed: 0, tile: 8 };
/// let share = Share::Samples { part: 1, of: 4 };
/// let bytes = Tiles::<'_, _, ()>::new(settings, Independent).of_share(share, 1).to_bytes(7);
/// let found = described(&bytes)?;
/// assert_eq!((found.tag, found.share, found.first, found.settings.samples), (7, share, 16, 16));
/// assert!(!found.is_done && described(b"a picture of another program").is_err());
/// # Ok::<(), PictureBytesError>(())
/// ```
pub fn described(bytes: &[u8]) -> Result<Described, PictureBytesError> {
    let sound = FORMAT.header(bytes)?;
    let mut header = Reader(&bytes[WORDS_AT..]);
    let [columns, rows, layers] = [(); 3].map(|()| header.word());
    let pass = [(); 3].map(|()| header.word());
    let [tile, noise, least, samples, flags] = [(); 5].map(|()| header.word());
    let [seed, all, non_finite, tag] = [(); 4].map(|()| header.long());
    let [kind, part, of, first] = [(); 4].map(|()| header.word());
    Damage::unless_length(bytes.len(), header.long().saturating_add(HEADER_BYTES as u64))?;
    sound.check(&bytes[HEADER_BYTES..])?;
    let goal = (flags & 2 != 0).then(|| Goal { noise: f32::from_bits(noise), least });
    let settings = Settings { size: [columns, rows], layers, samples, goal, seed, tile };
    let share = match kind {
        0 => Share::Whole,
        1 => Share::Tiles { part, of },
        2 => Share::Samples { part, of },
        _ => return Err(PictureBytesError::Content),
    };
    // Before anybody asks for the memory. A part of tiles has a tile at least, which at a corner may be a pixel, or none.
    let parts = if kind == 1 { u64::from(of.max(1)).saturating_mul(u64::from(tile) * u64::from(tile)) } else { 1 };
    let least = least_bytes(&settings).map(|least| least as u64 / parts.max(1));
    if least.is_none_or(|least| least > (bytes.len() - HEADER_BYTES) as u64 && !share.is_empty(&settings)) {
        return Err(PictureBytesError::Content);
    }
    let counts = Counts { samples: all, non_finite };
    Ok(Described { settings, tag, share, first, is_done: flags & 1 != 0, counts, pass })
}

impl<Q, C: Default> Tiles<'static, Q, C> {
    /// Goes on with what [`Tiles::to_bytes`] has left, to the bits of a picture that was never left. Without a goal, more samples may be asked
    /// for than before.
    ///
    /// # Errors
    /// Bytes that are damaged, or of another picture: another size, seed, goal or tag.
    ///
    /// ```
    /// # use fogbow::{bytes::Damage, picture::{PictureBytesError, Settings, Tiles}};
    /// # use fogbow::sampling::Independent;
    /// let settings = Settings { size: [4, 3], layers: 1, samples: 64, goal: None, seed: 0, tile: 8 };
    /// let bytes = Tiles::<'_, _, ()>::new(settings, Independent).to_bytes(7);
    /// let read = |settings, tag| Tiles::<'_, _, ()>::read(settings, Independent, tag, &bytes).err();
    /// assert_eq!(read(Settings { samples: 128, ..settings }, 7), None);
    /// assert_eq!(read(settings, 8), Some(Damage::Tag { found: 7, due: 8 }.into()));
    /// assert_eq!(read(Settings { seed: 1, ..settings }, 7), Some(PictureBytesError::Settings("seed")));
    /// ```
    pub fn read(settings: Settings, source: Q, tag: u64, bytes: &[u8]) -> Result<Self, PictureBytesError> {
        let Described { settings: of, tag: found, share, first, is_done, counts: taken_samples, pass } =
            described(bytes)?;
        Damage::unless_tag(found, tag)?;
        let has_tiles = settings.goal.is_some() || matches!(share, Share::Tiles { .. });
        let differs = [
            (of.size != settings.size, "size"),
            (of.layers != settings.layers, "number of layers"),
            (of.seed != settings.seed, "seed"),
            (of.goal != settings.goal, "noise asked for"),
            (has_tiles && of.tile != settings.tile, "size of tiles"),
            (settings.goal.is_some() && of.samples != settings.samples, "number of samples asked for"),
        ];
        if let Some((_, what)) = differs.into_iter().find(|(differs, _)| *differs) {
            return Err(PictureBytesError::Settings(what));
        }
        let room = settings.room();
        let mut body = Reader(&bytes[HEADER_BYTES..]);
        let (mut sums, mut counts) = (alloc::vec![PixelSum::ZERO; room.sums], alloc::vec![0; room.counts]);
        let own = || (0..settings.pixels()).filter(|&pixel| share.has(settings.tile_of(pixel))).map(|p| p as usize);
        let layers = settings.layers as usize;
        for pixel in own() {
            sums[pixel * layers..][..layers].fill_with(|| PixelSum([(); 3].map(|()| body.integer())));
        }
        own().for_each(|pixel| counts[pixel] = body.word());
        let noise = settings.goal.map(|goal| Noise::new(goal, List::default(), List::default()));
        let mut tiles = Self::start(settings, source, (sums.into(), counts.into()), noise)
            .map_err(|Full| PictureBytesError::Content)?;
        if let Some(noise) = &mut tiles.noise {
            noise.read(&mut body).ok_or(PictureBytesError::Content)?;
        }
        if !body.0.is_empty() {
            return Err(PictureBytesError::Content);
        }
        (tiles.taken_samples, tiles.share, tiles.first) = (taken_samples, share, first);
        // A goal is judged where passes end, so they have to end where they would have. More samples than there were to be begin anew.
        if !is_done || settings.samples <= of.samples {
            let [until, taken, pixels_per_job] = pass;
            (tiles.until, tiles.taken, tiles.is_enough) = (until.min(settings.samples), taken, is_done);
            tiles.pixels_per_job = pixels_per_job.max(1);
        }
        Ok(tiles)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::{Sample, TileOutput};
    use crate::sampling::{Generator, Independent, uniform};
    use crate::spectrum::Spectrum;
    use crate::work;

    const GOAL: Option<Goal> = Some(Goal { noise: 0.04, least: 8 });
    const SETTINGS: Settings = Settings { size: [19, 9], layers: 2, samples: 600, goal: None, seed: 5, tile: 4 };

    fn ramp(sample: &Sample<'_, ()>, rng: &mut Generator, layers: &mut [Spectrum]) {
        layers[0] = Spectrum::splat(uniform(rng) * sample.x as f32);
        layers[1] = Spectrum::new(uniform(rng), 0.0, 1.0);
    }

    /// Left and taken up again every so many jobs.
    fn left_every(settings: Settings, jobs: u32) -> (Vec<PixelSum>, Vec<u32>) {
        let mut tiles: Tiles<'_, _, ()> = Tiles::new(settings, Independent);
        let mut output = TileOutput::default();
        while !tiles.is_done() {
            for _ in 0..jobs {
                work::step(&mut tiles, &ramp, &mut output);
            }
            tiles = Tiles::read(settings, Independent, 1, &tiles.to_bytes(1)).unwrap();
        }
        tiles.into_sums()
    }

    #[test]
    fn a_picture_left_anywhere_has_the_bits_of_one_that_was_not() {
        for goal in [None, GOAL] {
            let settings = Settings { goal, ..SETTINGS };
            let mut whole: Tiles<'_, _, ()> = Tiles::new(settings, Independent);
            work::finish(&mut whole, &ramp, &mut TileOutput::default());
            let whole = whole.into_sums();
            if goal.is_some() {
                assert!(whole.1.iter().any(|count| *count < 600) && whole.1.iter().any(|count| *count > 8));
            }
            for jobs in [1, 7, 50] {
                assert_eq!(left_every(settings, jobs), whole, "{goal:?} {jobs}");
            }
        }
    }

    #[test]
    fn integers_of_any_length_are_read_as_they_were_written() {
        let near = |power: u32| [(1_i128 << power) - 1, 1 << power, (1 << power) + 1];
        let all = (0..127).flat_map(near).flat_map(|sum| [sum, -sum]).chain([0, i128::MAX, i128::MIN]);
        for sum in all {
            let mut bytes = Vec::new();
            put(sum, &mut bytes);
            let mut reader = Reader(&bytes);
            assert_eq!((reader.integer(), reader.0.len()), (sum, 0), "{bytes:?}");
        }
    }

    /// Fifteen machines, each left again and again and gone on with; of as many tiles, some of them cut by the border, and of samples that begin in the middle.
    #[test]
    fn parts_left_anywhere_merge_to_the_bits_of_the_whole() {
        let mut whole: Tiles<'_, _, ()> = Tiles::new(SETTINGS, Independent);
        work::finish(&mut whole, &ramp, &mut TileOutput::default());
        for share in [|part| Share::Tiles { part, of: 15 }, |part| Share::Samples { part, of: 15 }] {
            let mut merged: Tiles<'_, _, ()> = Tiles::new(SETTINGS, Independent);
            for part in (0..15).rev() {
                let mut tiles: Tiles<'_, _, ()> = Tiles::new(SETTINGS, Independent).of_share(share(part), 1);
                while !tiles.is_done() {
                    for _ in 0..5 {
                        work::step(&mut tiles, &ramp, &mut TileOutput::default());
                    }
                    tiles = Tiles::read(SETTINGS, Independent, 1, &tiles.to_bytes(1)).unwrap().of_share(share(part), 1);
                }
                merged.merge(&tiles);
            }
            assert!(merged.is_done() && merged.counts() == whole.counts());
            assert_eq!(merged.to_bytes(1), whole.to_bytes(1), "{:?}", share(0));
        }
    }

    #[test]
    fn damaged_bytes_are_an_error() {
        let settings = Settings { goal: GOAL, ..SETTINGS };
        let mut tiles: Tiles<'_, _, ()> = Tiles::new(settings, Independent);
        for _ in 0..60 {
            work::step(&mut tiles, &ramp, &mut TileOutput::default());
        }
        let bytes = tiles.to_bytes(3);
        let read = |bytes: &[u8]| Tiles::<'_, _, ()>::read(settings, Independent, 3, bytes).map(drop);
        assert_eq!(read(&bytes), Ok(()));
        for at in (0..bytes.len()).step_by(61).chain(0..HEADER_BYTES) {
            let mut damaged = bytes.clone();
            damaged[at] ^= 16;
            assert!(read(&damaged).is_err(), "{at}");
            assert!(read(&bytes[..at]).is_err(), "{at}");
        }
        assert!(read(&[&bytes[..], &[0]].concat()).is_err());
    }
}
