//! Parallel rendering whose result does not depend on the number of threads.
//!
//! The picture is split into fixed tiles and the work into passes over all of them, each pass a
//! few more samples per pixel. A pixel is only ever summed in the order of its samples, so
//! threads, tiles and passes change nothing.

use core::fmt;
use core::num::NonZero;
use core::time::Duration;
use std::sync::{Mutex, PoisonError};

use fogbow::spectrum::Spectrum;
use rayon::iter::{IndexedParallelIterator, IntoParallelIterator, ParallelIterator};

use crate::film::{Film, accumulate};
pub use crate::noise::Goal;
use crate::noise::Noise;
use crate::progress::{Control, Reporter};
use crate::seed::{SampleRng, Sequence, pixel_key};
use crate::stats::{Counters, Seconds, Stopwatch, Tally};

/// How to render.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Samples every pixel shall have in the end, those already in the film included; `u32::MAX`
    /// for as many as time allows.
    pub samples: u32,
    /// Ends a tile sooner, once its new samples leave less noise than this. [`render_prepared`], whose noise is that of
    /// passes and not of samples, takes no notice.
    pub goal: Option<Goal>,
    /// Time granted on the wall clock, if limited. Whole passes are done while they are expected
    /// to fit, so it is missed by part of a pass at most; the first sample of each pixel is always taken.
    pub time: Option<Duration>,
    /// Number of threads; 0 for one per processor.
    pub threads: usize,
    /// Changes all random numbers.
    pub seed: u64,
    /// Kind of random numbers.
    pub sequence: Sequence,
    /// Side of a tile in pixels. Larger: threads wait for each other at the end of a pass.
    /// Smaller: more locking of the film. Changes no result but with a [`Settings::goal`], which each tile reaches by itself.
    pub tile: u32,
}

impl Default for Settings {
    fn default() -> Self {
        Self { samples: 16, goal: None, time: None, threads: 0, seed: 0, sequence: Sequence::default(), tile: 8 }
    }
}

/// What the integrand is asked for: one sample of one pixel.
#[derive(Debug, Clone, Copy)]
pub struct Sample<'t> {
    /// Column, from the left.
    pub x: u32,
    /// Row, from the top.
    pub y: u32,
    /// Index of the sample in its pixel.
    pub index: u32,
    /// Counters of this tile, for [`crate::stats::CountingScene`] and [`crate::stats::CountingMedium`].
    pub tally: &'t Tally,
}

/// Why a render ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reason {
    /// Every pixel has its samples, or little enough noise.
    Done,
    /// The host asked to stop. The tiles finished by then are in the film, with their own counts.
    Cancelled,
    /// The time is used up; all pixels have the same number of new samples, but in tiles that have reached
    /// [`Settings::goal`].
    TimeUp,
}

/// What a render did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    /// Samples that every pixel of the film has at least.
    pub samples: u32,
    /// Why it ended.
    pub reason: Reason,
    /// What went into the film.
    pub counters: Counters,
    /// What it took.
    pub seconds: Seconds,
}

/// Why nothing was rendered.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum RenderError {
    /// No samples were asked for.
    NoSamples,
    /// The side of a tile is zero.
    NoTile,
    /// The system gave no threads; what it said.
    Threads(String),
}

impl fmt::Display for RenderError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoSamples => f.write_str("no samples were asked for"),
            Self::NoTile => f.write_str("the side of a tile is zero"),
            Self::Threads(why) => write!(f, "cannot start threads: {why}"),
        }
    }
}

impl core::error::Error for RenderError {}

/// Samples per pixel of the longest pass: longer ones would keep a cancelled picture uneven.
const LONGEST_PASS: u32 = 32;

/// Adds samples to `film` until every pixel has [`Settings::samples`] or its tile reaches [`Settings::goal`], or time or
/// host end it.
///
/// `integrand` writes one colour per layer into the slice it is given (black at first), from the
/// random numbers it is given and nothing else that changes: then the film's bits depend on
/// neither threads nor tiles nor passes, and (without a goal) a film rendered in two goes equals one rendered in one.
/// A sample with a value that is not finite counts as black and in [`Counters::non_finite`].
///
/// # Errors
/// Settings without samples or tiles, no threads; the film is then as before.
///
/// ```
/// use fogbow::{sampling::uniform2, spectrum::Spectrum};
/// use fogbow_std::{film::Film, progress::Control, tiles::{Reason, Settings, render}};
/// let mut film = Film::new(4, 3, &["total"]).unwrap();
/// let settings = Settings { samples: 64, ..Settings::default() };
/// let outcome = render(&mut film, &settings, &Control::default(), |sample, rng, layers| {
///     let jitter = uniform2(rng);
///     layers[0] = Spectrum::splat((sample.x as f32 + jitter.x) / 4.0);
/// }).unwrap();
/// assert_eq!((outcome.reason, outcome.samples), (Reason::Done, 64));
/// assert!((film.mean(0).unwrap().pixels[1].mean() - 1.5 / 4.0).abs() < 0.01);
/// ```
pub fn render<F>(
    film: &mut Film,
    settings: &Settings,
    control: &Control<'_>,
    integrand: F,
) -> Result<Outcome, RenderError>
where
    F: Fn(&Sample<'_>, &mut SampleRng, &mut [Spectrum]) + Sync,
{
    let pool = settings.pool()?;
    let clock = Stopwatch::start();
    let reporter = settings.reporter(film, control);
    let (reason, counters) = pool.install(|| passes(film, settings, control, &reporter, &integrand));
    reporter.finish();
    Ok(Outcome { samples: film.min_count(), reason, counters, seconds: clock.elapsed() })
}

/// Passes of samples that share something.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Passes {
    /// Samples of every pixel in a pass.
    pub length: NonZero<u32>,
    /// Whether time may end a render within a pass: the samples of a part of a pass make a picture, too.
    pub may_break: bool,
}

/// As [`render`], in `passes`, for methods whose samples share something that is
/// made anew for each pass: `prepare` is told the number of the pass, and what it makes is lent to `integrand`.
///
/// `prepare` may use all threads of the pool it is called in. For bits that do not depend on their number, let what it
/// makes depend on the number of the pass alone. Time ends a render between passes, unless these may break; the last is
/// cut short where [`Settings::samples`] says so.
///
/// # Errors
/// As [`render`], and what `prepare` fails with; the film then holds the passes up to there.
///
/// ```
/// use core::num::NonZero;
/// use fogbow::spectrum::Spectrum;
/// use fogbow_std::{film::Film, progress::Control, tiles::{Passes, RenderError, Settings, render_prepared}};
/// let mut film = Film::new(2, 2, &["total"]).unwrap();
/// let settings = Settings { samples: 6, ..Settings::default() };
/// let passes = Passes { length: NonZero::new(2).unwrap(), may_break: false };
/// render_prepared(&mut film, &settings, &Control::default(), passes,
///     |pass| Ok::<f32, RenderError>(pass as f32),
///     |prepared, _, _, layers| layers[0] = Spectrum::splat(*prepared),
/// ).unwrap();
/// assert_eq!(film.mean(0).unwrap().pixels[3], Spectrum::ONE);
/// ```
pub fn render_prepared<T, E, P, F>(
    film: &mut Film,
    settings: &Settings,
    control: &Control<'_>,
    passes: Passes,
    mut prepare: P,
    integrand: F,
) -> Result<Outcome, E>
where
    T: Sync,
    E: From<RenderError> + Send,
    P: FnMut(u32) -> Result<T, E> + Send,
    F: Fn(&T, &Sample<'_>, &mut SampleRng, &mut [Spectrum]) + Sync,
{
    let pool = settings.pool()?;
    let clock = Stopwatch::start();
    let reporter = settings.reporter(film, control);
    let (reason, counters) = pool.install(|| -> Result<_, E> {
        let mut counters = Counters::default();
        loop {
            let done = film.min_count();
            if done >= settings.samples {
                return Ok((Reason::Done, counters));
            }
            if control.is_cancelled() {
                return Ok((Reason::Cancelled, counters));
            }
            let before = reporter.elapsed();
            let pass = done / passes.length;
            let prepared = prepare(pass)?;
            let integrand = |sample: &Sample<'_>, rng: &mut SampleRng, layers: &mut [Spectrum]| {
                integrand(&prepared, sample, rng, layers);
            };
            let end = (pass * passes.length.get()).saturating_add(passes.length.get()).min(settings.samples);
            let mut until = if passes.may_break && settings.time.is_some() { done + 1 } else { end };
            loop {
                let (from, start) = (film.min_count(), reporter.elapsed());
                let (reporter, film_of) = (&reporter, Mutex::new(&mut *film));
                let pass =
                    Pass { film: film_of, settings, control, reporter, integrand: &integrand, until, noise: None };
                let (counted, is_complete) = pass.run();
                counters += counted;
                if !is_complete {
                    return Ok((Reason::Cancelled, counters));
                }
                let now = reporter.elapsed();
                if until == end {
                    // The next pass will take about as long as this one.
                    let next = if passes.may_break { Duration::ZERO } else { now - before };
                    if settings.time.is_some_and(|budget| until < settings.samples && now + next > budget) {
                        return Ok((Reason::TimeUp, counters));
                    }
                    break;
                }
                let (Some(affordable), true) = (affordable(settings, now, now - start, until - from), until < end)
                else {
                    return Ok((Reason::TimeUp, counters));
                };
                until = until.saturating_add(affordable.min(until)).min(end);
            }
        }
    })?;
    reporter.finish();
    Ok(Outcome { samples: film.min_count(), reason, counters, seconds: clock.elapsed() })
}

impl Settings {
    fn pool(&self) -> Result<rayon::ThreadPool, RenderError> {
        if self.samples == 0 {
            return Err(RenderError::NoSamples);
        }
        if self.tile == 0 {
            return Err(RenderError::NoTile);
        }
        rayon::ThreadPoolBuilder::new()
            .num_threads(self.threads)
            .build()
            .map_err(|error| RenderError::Threads(error.to_string()))
    }

    fn reporter<'a>(&self, film: &Film, control: &'a Control<'a>) -> Reporter<'a> {
        let pixels = u64::from(film.width()) * u64::from(film.height());
        Reporter::new(control, film.total_count(), pixels * u64::from(self.samples), self.time)
    }
}

fn passes<F>(
    film: &mut Film,
    settings: &Settings,
    control: &Control<'_>,
    reporter: &Reporter<'_>,
    integrand: &F,
) -> (Reason, Counters)
where
    F: Fn(&Sample<'_>, &mut SampleRng, &mut [Spectrum]) + Sync,
{
    let (mut counters, mut length, mut done) = (Counters::default(), 1, film.min_count());
    let tiles = film.width().div_ceil(settings.tile) * film.height().div_ceil(settings.tile);
    let mut noise = settings.goal.map(|goal| Noise::new(goal, tiles as usize));
    loop {
        if done >= settings.samples {
            return (Reason::Done, counters);
        }
        if control.is_cancelled() {
            return (Reason::Cancelled, counters);
        }
        let until = done.saturating_add(length).min(settings.samples);
        let before = reporter.elapsed();
        let noise_of = noise.as_ref();
        let pass = Pass { film: Mutex::new(film), settings, control, reporter, integrand, until, noise: noise_of };
        let (counted, is_complete) = pass.run();
        counters += counted;
        if !is_complete {
            return (Reason::Cancelled, counters);
        }
        if noise.as_mut().is_some_and(|noise| noise.judge(until)) {
            return (Reason::Done, counters);
        }
        let now = reporter.elapsed();
        length = until.min(LONGEST_PASS);
        if until < settings.samples {
            match affordable(settings, now, now - before, until - done) {
                Some(affordable) => length = length.min(affordable),
                None => return (Reason::TimeUp, counters),
            }
        }
        done = until;
    }
}

/// How many samples the time left allows, after `samples` took `taken`; `None` if it is up.
fn affordable(settings: &Settings, now: Duration, taken: Duration, samples: u32) -> Option<u32> {
    let Some(budget) = settings.time else { return Some(u32::MAX) };
    let per_sample = taken.as_secs_f64() / f64::from(samples);
    let affordable = (budget.saturating_sub(now).as_secs_f64() / per_sample).min(1e6);
    if now >= budget || affordable < 1.0 {
        return None;
    }
    // Passes vary in speed: most of what is left now, the rest by a better estimate.
    Some(((0.75 * affordable) as u32).max(1))
}

/// One pass: every pixel gets its samples up to `until`, but in tiles whose noise is little enough.
struct Pass<'a, F> {
    film: Mutex<&'a mut Film>,
    settings: &'a Settings,
    control: &'a Control<'a>,
    reporter: &'a Reporter<'a>,
    integrand: &'a F,
    until: u32,
    noise: Option<&'a Noise>,
}

/// Columns and rows of a tile: from (inclusive) and to (exclusive).
struct Tile {
    index: u32,
    x: [u32; 2],
    y: [u32; 2],
}

impl<F> Pass<'_, F>
where
    F: Fn(&Sample<'_>, &mut SampleRng, &mut [Spectrum]) + Sync,
{
    /// What was done, and whether all of it.
    fn run(&self) -> (Counters, bool) {
        let (width, height) = self.with_film(|film| (film.width(), film.height()));
        let side = self.settings.tile;
        let (columns, rows) = (width.div_ceil(side), height.div_ceil(side));
        // At most MAX_PIXELS tiles, so the product fits.
        (0..columns * rows)
            .into_par_iter()
            .with_max_len(1)
            .map(|i| {
                let span = |at: u32, end: u32| [at * side, (at * side).saturating_add(side).min(end)];
                let tile = Tile { index: i, x: span(i % columns, width), y: span(i / columns, height) };
                self.tile(&tile).map_or((Counters::default(), false), |counters| (counters, true))
            })
            // Integers: their sum is the same in any order.
            .reduce(|| (Counters::default(), true), |a, b| (a.0 + b.0, a.1 && b.1))
    }

    /// Works on a copy of the tile's sums and puts it back when complete; `None` if cancelled.
    fn tile(&self, tile: &Tile) -> Option<Counters> {
        let mut noise = self.noise.map(|noise| noise.tile(tile.index));
        if noise.as_ref().is_some_and(|noise| noise.is_enough()) {
            return Some(Counters::default());
        }
        let (mut sums, mut counts) = (Vec::new(), Vec::new());
        let layers = self.with_film(|film| {
            for y in tile.y[0]..tile.y[1] {
                let (row_sums, row_counts) = film.row(y, tile.x[0], tile.x[1]);
                sums.extend_from_slice(row_sums);
                counts.extend_from_slice(row_counts);
            }
            film.layers().len()
        });
        if let Some(noise) = &mut noise {
            noise.begin(sums.iter().step_by(layers).zip(counts.iter().copied()));
        }
        let (tally, mut colours) = (Tally::default(), vec![Spectrum::ZERO; layers]);
        let (mut samples, mut non_finite) = (0, 0);
        let width = (tile.x[1] - tile.x[0]) as usize;
        for (i, (sums, count)) in sums.chunks_exact_mut(layers).zip(&mut counts).enumerate() {
            let (x, y) = (tile.x[0] + (i % width) as u32, tile.y[0] + (i / width) as u32);
            for index in *count..self.until {
                if self.control.is_cancelled() {
                    return None;
                }
                let mut rng = self.settings.sequence.start(self.settings.seed, pixel_key(x, y), index);
                colours.fill(Spectrum::ZERO);
                (self.integrand)(&Sample { x, y, index, tally: &tally }, &mut rng, &mut colours);
                if colours.iter().all(|colour| colour.0.iter().all(|c| c.is_finite())) {
                    accumulate(sums, &colours);
                } else {
                    non_finite += 1;
                }
                samples += 1;
            }
            *count = self.until.max(*count);
        }
        if let Some(noise) = &mut noise {
            noise.end(sums.iter().step_by(layers).zip(counts.iter().copied()));
        }
        self.with_film(|film| {
            for (i, y) in (tile.y[0]..tile.y[1]).enumerate() {
                let (row_sums, row_counts) = film.row_mut(y, tile.x[0], tile.x[1]);
                row_sums.copy_from_slice(&sums[i * width * layers..][..width * layers]);
                row_counts.copy_from_slice(&counts[i * width..][..width]);
            }
        });
        self.reporter.add(samples);
        Some(Counters { samples, non_finite, ..tally.counters() })
    }

    fn with_film<T>(&self, work: impl FnOnce(&mut Film) -> T) -> T {
        work(&mut self.film.lock().unwrap_or_else(PoisonError::into_inner))
    }
}
