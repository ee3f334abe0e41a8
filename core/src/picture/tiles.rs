//! Passes over all pixels, as work in rounds.

use core::ops::Range;

use super::integrand::{Counts, Integrand, Sample, Tally};
use super::noise::{Goal, Noise, Part, PixelNoise, TileNoise};
use super::share::Share;
use super::sum::PixelSum;
use crate::sampling::{GeneratorSource, pixel_key};
use crate::spectrum::Spectrum;
use crate::storage::{Full, List};
use crate::work::Rounds;

/// How a picture is sampled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Columns and rows.
    pub size: [u32; 2],
    /// Layers: colours that a sample writes.
    pub layers: u32,
    /// Samples that every pixel shall have in the end, those it has already included; at least 1.
    pub samples: u32,
    /// Ends a tile sooner, once its new samples leave less noise than this.
    pub goal: Option<Goal>,
    /// Changes all random numbers.
    pub seed: u64,
    /// Side of a tile in pixels, at least 1. Matters with a [`Settings::goal`], which each tile reaches by itself: larger, and an edge
    /// is sampled with its surroundings; smaller, and noise is told from few pixels.
    pub tile: u32,
}

/// What a job leaves: the new sums of some pixels.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Default))]
pub struct TileOutput<'o, T> {
    sums: List<'o, PixelSum>,
    colours: List<'o, Spectrum>,
    counts: Counts,
    tally: T,
    is_cut: bool,
}

impl<'o, T: Default> TileOutput<'o, T> {
    /// In lent memory: for the sums of a job's pixels, and for the colours of a sample. [`Settings::room`] says how many; where that is
    /// too small, [`Tiles::is_cut`] says so.
    ///
    /// ```
    /// use fogbow::picture::{PixelSum, Sample, Settings, TileOutput, TileSlots, Tiles};
    /// use fogbow::{sampling::{Generator, Independent}, spectrum::Spectrum, storage::Full, work};
    /// let settings = Settings { size: [4, 1], layers: 1, samples: 8, goal: None, seed: 0, tile: 8 };
    /// let white = |_: &Sample<'_, ()>, _: &mut Generator, layers: &mut [Spectrum]| layers[0] = Spectrum::ONE;
    /// let (mut sums, mut counts) = ([PixelSum::ZERO; 4], [0; 4]);
    /// let slots = TileSlots { sums: &mut sums, counts: &mut counts, ..TileSlots::default() };
    /// let mut tiles = Tiles::lent(settings, Independent, slots)?;
    /// let (mut of_job, mut colours) = ([PixelSum::ZERO; 8], [Spectrum::ZERO; 1]);
    /// assert!(of_job.len() >= settings.room().of_job_sums && colours.len() == settings.room().of_job_colours);
    /// work::finish(&mut tiles, &white, &mut TileOutput::lent(&mut of_job, &mut colours));
    /// assert!(!tiles.is_cut() && tiles.counts().samples == 4 * 8);
    /// # Ok::<(), Full>(())
    /// ```
    #[must_use]
    pub fn lent(sums: &'o mut [PixelSum], colours: &'o mut [Spectrum]) -> Self {
        Self {
            sums: sums.into(),
            colours: colours.into(),
            counts: Counts::default(),
            tally: T::default(),
            is_cut: false,
        }
    }
}

/// Lengths of the slices that a picture in lent memory needs: [`Settings::room`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TileRoom {
    /// [`TileSlots::sums`].
    pub sums: usize,
    /// [`TileSlots::counts`].
    pub counts: usize,
    /// [`TileSlots::tiles`].
    pub tiles: usize,
    /// [`TileSlots::pixels`].
    pub pixels: usize,
    /// Sums of a job's pixels: the first of [`TileOutput::lent`].
    pub of_job_sums: usize,
    /// Colours of a sample: the second.
    pub of_job_colours: usize,
}

/// Lent memory of a picture, as long as [`Settings::room`] says. None is [`TileSlots::default`].
#[derive(Debug, Default)]
pub struct TileSlots<'s> {
    /// Sums of samples: pixel by pixel from the top left, within each layer by layer.
    pub sums: &'s mut [PixelSum],
    /// Numbers of samples of the pixels.
    pub counts: &'s mut [u32],
    /// What is known of the noise of tiles: only for a [`Settings::goal`].
    pub tiles: &'s mut [TileNoise],
    /// What is known of the noise of pixels: only for a [`Settings::goal`].
    pub pixels: &'s mut [PixelNoise],
}

/// Most pixels of a job.
const PIXELS_PER_JOB: u32 = 8;

/// Samples per pixel of the longest pass: longer ones would keep a picture that was left uneven.
const LONGEST_PASS: u32 = 32;

/// Samples of a job, about: some milliseconds.
const SAMPLES_PER_JOB: u32 = 64;

/// Samples of a picture, pass by pass, each a round of [`Rounds`]: the same bits for any number of threads, tiles and
/// lengths of passes (without a goal). The "world" of its jobs is the [`Integrand`].
///
/// ```
/// # #[cfg(feature = "alloc")] {
/// use fogbow::picture::{Sample, Settings, TileOutput, Tiles};
/// use fogbow::{sampling::{Generator, Independent, uniform}, spectrum::Spectrum, work};
/// let settings = Settings { size: [4, 3], layers: 1, samples: 64, goal: None, seed: 0, tile: 8 };
/// let mut tiles = Tiles::new(settings, Independent);
/// let ramp = |sample: &Sample<'_, ()>, rng: &mut Generator, layers: &mut [Spectrum]| {
///     layers[0] = Spectrum::splat((sample.x as f32 + uniform(rng)) / 4.0);
/// };
/// work::finish(&mut tiles, &ramp, &mut TileOutput::default());
/// assert_eq!((tiles.count(1, 0), tiles.counts().samples), (64, 64 * 12));
/// assert!((tiles.mean(1, 0, 0).mean() - 1.5 / 4.0).abs() < 0.05);
/// # }
/// ```
///
/// A host may decide pass by pass how many samples come next, and end where it likes:
///
/// ```
/// # #[cfg(feature = "alloc")] {
/// # use fogbow::picture::{Sample, Settings, TileOutput, Tiles};
/// # use fogbow::{sampling::{Generator, Independent, uniform}, spectrum::Spectrum, work};
/// # let settings = Settings { size: [4, 3], layers: 1, samples: 64, goal: None, seed: 0, tile: 8 };
/// # let ramp = |sample: &Sample<'_, ()>, rng: &mut Generator, layers: &mut [Spectrum]| {
/// #     layers[0] = Spectrum::splat((sample.x as f32 + uniform(rng)) / 4.0);
/// # };
/// let mut tiles = Tiles::new(Settings { samples: 14, ..settings }, Independent).by_pass();
/// let mut passes = Vec::new();
/// while !tiles.is_done() {
///     work::finish(&mut tiles, &ramp, &mut TileOutput::default());
///     assert_eq!(tiles.least_count(), tiles.until());
///     passes.push(tiles.until());
///     tiles.begin(tiles.next_until(5)); // at most five more
/// }
/// assert_eq!(passes, [1, 2, 4, 8, 13, 14]);
/// # }
/// ```
#[derive(Debug)]
pub struct Tiles<'s, Q, C = ()> {
    pub(super) settings: Settings,
    source: Q,
    /// Pixel by pixel, within each layer by layer; and samples of each pixel.
    pub(super) sums: List<'s, PixelSum>,
    pub(super) counts: List<'s, u32>,
    pub(super) noise: Option<Noise<'s>>,
    /// The pass at hand takes every pixel to so many samples, so many pixels a job.
    pub(super) until: u32,
    pub(super) pixels_per_job: u32,
    /// Jobs whose results were taken.
    pub(super) taken: u32,
    pub(super) taken_samples: Counts,
    pub(super) share: Share,
    /// Index of a pixel's first sample.
    pub(super) first: u32,
    total: C,
    is_by_pass: bool,
    pub(super) is_enough: bool,
    is_cut: bool,
}

impl<'s, Q, C: Default> Tiles<'s, Q, C> {
    /// Goes on with what lent memory holds: with zeros, a black picture; with the sums and numbers of samples of a picture
    /// that was left, that one. When it is dropped, they are the host's again.
    ///
    /// # Errors
    /// [`Full`] if there is less memory than [`Settings::room`] says.
    ///
    /// ```
    /// use fogbow::picture::{Goal, PixelNoise, PixelSum, Sample, Settings, TileNoise, TileOutput, TileRoom, TileSlots, Tiles};
    /// use fogbow::{sampling::{Generator, Independent, uniform}, spectrum::Spectrum, storage::Full, work};
    ///
    /// // Known beforehand, so that everything may lie in arrays, or be `static`.
    /// const SETTINGS: Settings = Settings {
    ///     size: [16, 8], layers: 1, samples: 4096, goal: Some(Goal { noise: 0.05, least: 8 }), seed: 0, tile: 8,
    /// };
    /// const ROOM: TileRoom = SETTINGS.room();
    /// let (mut sums, mut counts) = ([PixelSum::ZERO; ROOM.sums], [0; ROOM.counts]);
    /// let (mut noise, mut pixels) = ([TileNoise::default(); ROOM.tiles], [PixelNoise::default(); ROOM.pixels]);
    /// let slots = TileSlots { sums: &mut sums, counts: &mut counts, tiles: &mut noise, pixels: &mut pixels };
    /// let mut tiles = Tiles::lent(SETTINGS, Independent, slots)?;
    ///
    /// // Even on the left, noisy on the right.
    /// let ramp = |sample: &Sample<'_, ()>, rng: &mut Generator, layers: &mut [Spectrum]| {
    ///     layers[0] = Spectrum::splat(if sample.x < 8 { 1.0 } else { 2.0 * uniform(rng) });
    /// };
    /// let (mut of_job, mut colours) = ([PixelSum::ZERO; ROOM.of_job_sums], [Spectrum::ZERO; ROOM.of_job_colours]);
    /// work::finish(&mut tiles, &ramp, &mut TileOutput::lent(&mut of_job, &mut colours));
    /// assert!(tiles.is_done() && !tiles.is_cut());
    /// assert!(counts[0] == 8 && counts[15] > 100 && counts[15] < 4096, "{counts:?}");
    /// assert_eq!(sums[0].values(), [8.0; 3]);
    /// # Ok::<(), Full>(())
    /// ```
    pub fn lent(settings: Settings, source: Q, slots: TileSlots<'s>) -> Result<Self, Full> {
        let room = settings.room();
        let TileSlots { sums, counts, tiles, pixels } = slots;
        let sums = List::holding(sums.get_mut(..room.sums).ok_or(Full)?);
        let counts = List::holding(counts.get_mut(..room.counts).ok_or(Full)?);
        let noise = settings.goal.map(|goal| Noise::new(goal, tiles, pixels));
        Self::start(settings, source, (sums, counts), noise)
    }

    /// Begins the first pass over a picture of which there are sums and numbers of samples; of the noise nothing is known.
    pub(super) fn start(
        settings: Settings,
        source: Q,
        (sums, counts): (List<'s, PixelSum>, List<'s, u32>),
        mut noise: Option<Noise<'s>>,
    ) -> Result<Self, Full> {
        if let Some(noise) = &mut noise {
            let [columns, rows] = settings.grid();
            for tile in 0..columns * rows {
                let [x, y] = settings.span(tile);
                noise.add_tile((x.end - x.start) * (y.end - y.start))?;
            }
        }
        let mut tiles = Self {
            settings,
            source,
            sums,
            counts,
            noise,
            until: 0,
            pixels_per_job: 1,
            taken: 0,
            taken_samples: Counts::default(),
            share: Share::Whole,
            first: 0,
            total: C::default(),
            is_by_pass: false,
            is_enough: settings.samples == 0,
            is_cut: false,
        };
        let done = tiles.least_count();
        tiles.begin(done.saturating_add(1));
        Ok(tiles)
    }
}

#[cfg(feature = "alloc")]
impl<Q, C: Default> Tiles<'static, Q, C> {
    /// A black picture.
    #[must_use]
    pub fn new(settings: Settings, source: Q) -> Self {
        let room = settings.room();
        Self::of(settings, source, alloc::vec![PixelSum::ZERO; room.sums], alloc::vec![0; room.counts])
    }

    /// Goes on with a picture of which there are sums (pixel by pixel from the top left, within each layer by layer) and
    /// numbers of samples.
    ///
    /// # Panics
    /// If there are not as many as the size says.
    ///
    /// ```
    /// # use fogbow::picture::{Sample, Settings, TileOutput, Tiles};
    /// # use fogbow::{sampling::{Generator, Independent, uniform}, spectrum::Spectrum, work};
    /// # let settings = |samples| Settings { size: [4, 3], layers: 1, samples, goal: None, seed: 0, tile: 8 };
    /// # let noise = |_: &Sample<'_, ()>, rng: &mut Generator, layers: &mut [Spectrum]| layers[0] = Spectrum::splat(uniform(rng));
    /// let finished = |mut tiles: Tiles<'static, Independent>| {
    ///     work::finish(&mut tiles, &noise, &mut TileOutput::default());
    ///     tiles.into_sums()
    /// };
    /// let (sums, counts) = finished(Tiles::new(settings(10), Independent));
    /// let continued = finished(Tiles::of(settings(16), Independent, sums, counts));
    /// // The bits of a picture that was never left.
    /// assert_eq!(continued, finished(Tiles::new(settings(16), Independent)));
    /// ```
    #[must_use]
    pub fn of(settings: Settings, source: Q, sums: alloc::vec::Vec<PixelSum>, counts: alloc::vec::Vec<u32>) -> Self {
        let room = settings.room();
        assert!(counts.len() == room.counts && sums.len() == room.sums, "sums of another picture");
        let noise = settings.goal.map(|goal| Noise::new(goal, List::default(), List::default()));
        // Growing storage is never full.
        Self::start(settings, source, (sums.into(), counts.into()), noise).unwrap_or_else(|Full| unreachable!())
    }

    /// Sums and numbers of samples, as [`Tiles::of`] takes them.
    ///
    /// ```
    /// # use fogbow::picture::{Sample, Settings, TileOutput, Tiles};
    /// # use fogbow::{sampling::{Generator, Independent}, spectrum::Spectrum, work};
    /// # let settings = Settings { size: [2, 1], layers: 1, samples: 8, goal: None, seed: 0, tile: 8 };
    /// let mut tiles = Tiles::new(settings, Independent);
    /// let white = |_: &Sample<'_, ()>, _: &mut Generator, layers: &mut [Spectrum]| layers[0] = Spectrum::ONE;
    /// work::finish(&mut tiles, &white, &mut TileOutput::default());
    /// let (sums, counts) = tiles.into_sums();
    /// assert_eq!((sums[1].values(), counts), ([8.0; 3], vec![8; 2]));
    /// ```
    #[must_use]
    pub fn into_sums(self) -> (alloc::vec::Vec<PixelSum>, alloc::vec::Vec<u32>) {
        (self.sums.into_vec(), self.counts.into_vec())
    }
}

impl Settings {
    /// How much lent memory a picture needs: see [`Tiles::lent`].
    ///
    /// ```
    /// # use fogbow::picture::{Goal, Settings};
    /// let settings = Settings { size: [17, 8], layers: 2, samples: 64, goal: None, seed: 0, tile: 8 };
    /// let room = settings.room();
    /// assert_eq!((room.counts, room.sums, room.tiles, room.pixels), (17 * 8, 2 * 17 * 8, 0, 0));
    /// let room = Settings { goal: Some(Goal { noise: 0.1, least: 8 }), ..settings }.room();
    /// assert_eq!((room.tiles, room.pixels), (3, 17 * 8));   // only a goal wants to know of noise
    /// ```
    #[must_use]
    pub const fn room(&self) -> TileRoom {
        let [columns, rows] = self.grid();
        let (pixels, layers) = (self.size[0] as usize * self.size[1] as usize, self.layers as usize);
        let (of_tiles, of_pixels) =
            if self.goal.is_some() { (columns as usize * rows as usize, pixels) } else { (0, 0) };
        let of_job = if pixels < PIXELS_PER_JOB as usize { pixels } else { PIXELS_PER_JOB as usize };
        TileRoom {
            sums: pixels * layers,
            counts: pixels,
            tiles: of_tiles,
            pixels: of_pixels,
            of_job_sums: of_job * layers,
            of_job_colours: layers,
        }
    }

    /// Columns and rows of tiles.
    pub(super) const fn grid(&self) -> [u32; 2] {
        let side = if self.tile == 0 { 1 } else { self.tile };
        [self.size[0].div_ceil(side), self.size[1].div_ceil(side)]
    }

    /// Columns and rows of pixels of a tile.
    fn span(&self, tile: u32) -> [Range<u32>; 2] {
        let columns = self.grid()[0].max(1);
        let side = self.tile.max(1);
        let span = |at: u32, end: u32| at * side..(at * side).saturating_add(side).min(end);
        [span(tile % columns, self.size[0]), span(tile / columns, self.size[1])]
    }

    /// Column and row of the tile of a pixel.
    pub(super) fn tile_of(&self, pixel: u32) -> [u32; 2] {
        let side = self.tile.max(1);
        [pixel % self.size[0] / side, pixel / self.size[0] / side]
    }

    pub(super) fn pixels(&self) -> u32 {
        self.size[0] * self.size[1]
    }
}

impl<Q, C> Tiles<'_, Q, C> {
    /// Ends after every pass, until [`Tiles::begin`]: for hosts that decide how long the next may be.
    #[must_use]
    pub fn by_pass(mut self) -> Self {
        self.is_by_pass = true;
        self
    }

    /// Begins a pass that takes every pixel of a tile without enough samples to `until` samples, or to
    /// [`Settings::samples`] if that is less. A pass that is not done is left as it is.
    pub fn begin(&mut self, until: u32) {
        if self.is_enough {
            return;
        }
        let from = self.least_count();
        self.until = until.min(self.settings.samples);
        self.pixels_per_job = (SAMPLES_PER_JOB / self.until.saturating_sub(from).max(1)).clamp(1, PIXELS_PER_JOB);
        self.taken = 0;
        if let Some(noise) = &mut self.noise {
            each_tile(&self.settings, self.sums.as_slice(), self.counts.as_slice(), |tile, parts| {
                noise.begin(tile, parts)
            });
        }
    }

    /// Samples to which the pass at hand takes pixels.
    #[must_use]
    pub fn until(&self) -> u32 {
        self.until
    }

    /// Whether every pixel has its samples, or little enough noise.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.is_enough
    }

    /// Whether a job's lent [`TileOutput`] was too small: its pixels lack samples.
    ///
    /// ```
    /// # use fogbow::picture::{PixelSum, Sample, Settings, TileOutput, TileSlots, Tiles};
    /// # use fogbow::{sampling::{Generator, Independent}, spectrum::Spectrum, storage::Full, work};
    /// # let settings = Settings { size: [2, 1], layers: 1, samples: 1, goal: None, seed: 0, tile: 8 };
    /// # let white = |_: &Sample<'_, ()>, _: &mut Generator, layers: &mut [Spectrum]| layers[0] = Spectrum::ONE;
    /// let (mut sums, mut counts) = ([PixelSum::ZERO; 2], [0; 2]);
    /// let slots = TileSlots { sums: &mut sums, counts: &mut counts, ..TileSlots::default() };
    /// let mut tiles = Tiles::lent(settings, Independent, slots)?;
    /// work::finish(&mut tiles, &white, &mut TileOutput::lent(&mut [], &mut []));
    /// assert!(tiles.is_cut() && tiles.count(0, 0) == 0);
    /// # Ok::<(), Full>(())
    /// ```
    #[must_use]
    pub fn is_cut(&self) -> bool {
        self.is_cut
    }

    /// The smallest number of samples of any pixel that is to have some: 0 without pixels.
    #[must_use]
    pub fn least_count(&self) -> u32 {
        let counts = self.counts.as_slice();
        if !matches!(self.share, Share::Tiles { .. }) {
            return counts.iter().copied().min().unwrap_or(0);
        }
        let own = (0..self.settings.pixels()).filter(|&pixel| self.has(self.place(pixel)));
        own.map(|pixel| counts[pixel as usize]).min().unwrap_or(self.settings.samples)
    }

    /// Samples of a pixel; 0 outside.
    #[must_use]
    pub fn count(&self, x: u32, y: u32) -> u32 {
        let index = (y as usize * self.settings.size[0] as usize).saturating_add(x as usize);
        if x < self.settings.size[0] { self.counts.as_slice().get(index).copied().unwrap_or(0) } else { 0 }
    }

    /// The mean of a pixel's samples in a layer; black without samples or outside.
    #[must_use]
    pub fn mean(&self, x: u32, y: u32, layer: u32) -> Spectrum {
        let count = self.count(x, y);
        let index = (y as usize * self.settings.size[0] as usize + x as usize) * self.settings.layers as usize;
        match self.sums.as_slice().get(index + layer as usize) {
            Some(sum) if layer < self.settings.layers => sum.mean(count),
            _ => Spectrum::ZERO,
        }
    }

    /// Samples taken so far, by these passes.
    #[must_use]
    pub fn counts(&self) -> Counts {
        self.taken_samples
    }

    /// What integrands have counted.
    ///
    /// ```
    /// # #[cfg(feature = "alloc")] {
    /// # use core::cell::Cell;
    /// # use fogbow::picture::{Integrand, Sample, Settings, Tally, TileOutput, Tiles};
    /// # use fogbow::{sampling::{Generator, Independent}, spectrum::Spectrum, work};
    /// # #[derive(Default)]
    /// # struct Rays(Cell<u64>);
    /// # impl Tally for Rays {
    /// #     type Total = u64;
    /// #     fn add_to(&self, total: &mut u64) { *total += self.0.get() }
    /// # }
    /// # struct Camera;
    /// # impl Integrand<Generator> for Camera {
    /// #     type Tally = Rays;
    /// #     fn sample(&self, sample: &Sample<'_, Rays>, _: &mut Generator, _: &mut [Spectrum]) {
    /// #         sample.tally.0.set(sample.tally.0.get() + 1);
    /// #     }
    /// # }
    /// # let settings = Settings { size: [5, 3], layers: 1, samples: 10, goal: None, seed: 0, tile: 8 };
    /// let mut tiles = Tiles::new(settings, Independent).by_pass();
    /// work::finish(&mut tiles, &Camera, &mut TileOutput::default());
    /// // `Camera` counts a ray for each sample; the first pass takes one of each pixel.
    /// assert_eq!((*tiles.total(), tiles.counts().samples), (15, 15));
    /// # }
    /// ```
    #[must_use]
    pub fn total(&self) -> &C {
        &self.total
    }

    /// Column and row of a pixel.
    pub(super) fn place(&self, pixel: u32) -> [u32; 2] {
        [pixel % self.settings.size[0], pixel / self.settings.size[0]]
    }

    /// Whether a pixel is to have samples at all.
    pub(super) fn has(&self, place: [u32; 2]) -> bool {
        let side = self.settings.tile.max(1);
        self.share.has(place.map(|at| at / side))
    }

    fn is_open(&self, x: u32, y: u32) -> bool {
        if !self.has([x, y]) {
            return false;
        }
        let Some(noise) = &self.noise else { return true };
        let side = self.settings.tile.max(1);
        !noise.is_enough(y / side * self.settings.grid()[0] + x / side)
    }

    fn end(&mut self) {
        if let Some(noise) = &mut self.noise {
            each_tile(&self.settings, self.sums.as_slice(), self.counts.as_slice(), |tile, parts| {
                noise.end(tile, parts)
            });
            self.is_enough |= noise.judge(self.until);
        }
        self.is_enough |= self.until >= self.settings.samples;
        if !self.is_enough && !self.is_by_pass {
            self.begin(self.until.saturating_add(self.until.min(LONGEST_PASS)));
        }
    }

    /// The samples that the next pass should take every pixel to, if it may take `most` more.
    #[must_use]
    pub fn next_until(&self, most: u32) -> u32 {
        let done = if self.is_running() { self.until } else { self.until.max(self.least_count()) };
        done.saturating_add(done.clamp(1, LONGEST_PASS).min(most.max(1)))
    }

    fn is_running(&self) -> bool {
        !self.is_enough && self.taken < self.job_count()
    }
}

/// Calls `each` with every tile and what its pixels have, row by row.
fn each_tile(
    settings: &Settings,
    sums: &[PixelSum],
    counts: &[u32],
    mut each: impl FnMut(u32, &mut dyn Iterator<Item = Part>),
) {
    let [columns, rows] = settings.grid();
    for tile in 0..columns * rows {
        let [xs, ys] = settings.span(tile);
        let mut parts = ys.flat_map(|y| xs.clone().map(move |x| (x, y))).map(|(x, y)| {
            let index = y as usize * settings.size[0] as usize + x as usize;
            Part::of(&sums[index * settings.layers as usize].values(), counts[index])
        });
        each(tile, &mut parts);
    }
}

impl<I, Q> Rounds<I> for Tiles<'_, Q, <I::Tally as Tally>::Total>
where
    Q: GeneratorSource,
    I: Integrand<Q::Rng> + ?Sized,
{
    type Output<'o> = TileOutput<'o, I::Tally>;

    fn jobs(&self) -> Range<u32> {
        if self.is_enough { 0..0 } else { self.taken..self.job_count() }
    }

    fn run(&self, job: u32, integrand: &I, output: &mut TileOutput<'_, I::Tally>) {
        output.sums.clear();
        output.colours.clear();
        (output.counts, output.tally) = (Counts::default(), I::Tally::default());
        let layers = self.settings.layers as usize;
        let pixels = self.pixels_of(job);
        output.is_cut =
            output.sums.room() < pixels.len() * layers || output.colours.reset(layers, Spectrum::ZERO).is_err();
        if output.is_cut {
            return;
        }
        let TileOutput { sums: new, colours, counts, tally, .. } = output;
        for pixel in pixels {
            let [x, y] = self.place(pixel);
            let from = pixel as usize * layers;
            let start = new.len();
            if new.extend_from_slice(&self.sums.as_slice()[from..from + layers]).is_err() || !self.is_open(x, y) {
                continue;
            }
            let sums = &mut new.as_mut_slice()[start..];
            let colours = colours.as_mut_slice();
            for index in self.counts.as_slice()[pixel as usize]..self.until {
                let index = self.first + index;
                let mut rng = self.source.start(self.settings.seed, pixel_key(x, y), index);
                colours.fill(Spectrum::ZERO);
                integrand.sample(&Sample { x, y, index, tally: &*tally }, &mut rng, colours);
                if !accumulate(sums, colours) {
                    counts.non_finite += 1;
                }
                counts.samples += 1;
            }
        }
    }

    fn accept(&mut self, output: &TileOutput<'_, I::Tally>) {
        if !self.is_running() {
            return;
        }
        self.is_cut |= output.is_cut;
        let layers = self.settings.layers as usize;
        let pixels = self.pixels_of(self.taken);
        for (pixel, sums) in pixels.zip(output.sums.as_slice().chunks_exact(layers.max(1))) {
            let [x, y] = self.place(pixel);
            if !self.is_open(x, y) {
                continue;
            }
            self.sums.as_mut_slice()[pixel as usize * layers..][..layers].copy_from_slice(sums);
            let count = &mut self.counts.as_mut_slice()[pixel as usize];
            *count = self.until.max(*count);
        }
        self.taken_samples.samples += output.counts.samples;
        self.taken_samples.non_finite += output.counts.non_finite;
        output.tally.add_to(&mut self.total);
        self.taken += 1;
        if self.taken >= self.job_count() {
            self.end();
        }
    }

    fn stage(&self) -> &'static str {
        "render"
    }
}

/// Adds a sample to the sums of one pixel, layer by layer; whether it could be. A sample with a channel that [`PixelSum`] does not hold adds nothing
/// to any layer.
///
/// ```
/// use fogbow::{picture::{PixelSum, accumulate}, spectrum::Spectrum};
/// let mut sums = [PixelSum::ZERO; 2];
/// assert!(accumulate(&mut sums, &[Spectrum::splat(1e9), Spectrum::ONE]));
/// assert!(!accumulate(&mut sums, &[Spectrum::ONE, Spectrum::splat(f32::INFINITY)]));
/// assert_eq!(sums.map(|sum| sum.values()[0]), [1e9, 1.0]);
/// ```
#[inline]
pub fn accumulate(sums: &mut [PixelSum], colours: &[Spectrum]) -> bool {
    let holds = colours.iter().all(PixelSum::holds);
    if holds {
        sums.iter_mut().zip(colours).for_each(|(sum, colour)| _ = sum.add(*colour));
    }
    holds
}
