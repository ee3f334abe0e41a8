//! Parallel rendering whose result does not depend on the number of threads.
//!
//! The picture is split into fixed tiles and the work into passes over all of them, each pass a
//! few more samples per pixel. A pixel is only ever summed in the order of its samples, so
//! threads, tiles and passes change nothing.

use core::fmt;
use core::num::NonZero;
use core::time::Duration;

use fogbow::picture::{self, Integrand, PictureBytesError, Tiles, affordable};
pub use fogbow::picture::{Goal, Share};
use fogbow::spectrum::Spectrum;

use crate::film::Film;
use crate::progress::{Control, Reporter};
use crate::seed::{SampleRng, Sequence};
use crate::stats::{Counters, Queries, Seconds, Stopwatch};
use crate::threads::{Ending, Threads, ThreadsError, run};

/// How to render.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Samples every pixel shall have in the end, those already in the film included; `u32::MAX`
    /// for as many as time allows.
    pub samples: u32,
    /// Ends a tile sooner, once its new samples leave less noise than this. [`crate::progressive::render`], whose noise is that of
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
    /// Smaller: more jobs, each with its overhead. Changes no result but with a [`Settings::goal`], which each tile reaches by itself.
    pub tile: u32,
    /// What of the picture is rendered; without a goal, parts add up to the whole.
    pub share: Share,
}

impl Default for Settings {
    fn default() -> Self {
        let share = Share::Whole;
        Self { samples: 16, goal: None, time: None, threads: 0, seed: 0, sequence: Sequence::default(), tile: 8, share }
    }
}

/// What the integrand is asked for: one sample of one pixel, with counters for [`crate::stats::CountingScene`] and
/// [`crate::stats::CountingMedium`].
pub type Sample<'t> = picture::Sample<'t, Queries>;

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
    /// The system gave no threads.
    Threads(ThreadsError),
    /// What [`Control::resume`] holds is damaged, or of another picture.
    Resume(PictureBytesError),
}

impl From<ThreadsError> for RenderError {
    fn from(error: ThreadsError) -> Self {
        Self::Threads(error)
    }
}

impl fmt::Display for RenderError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoSamples => f.write_str("no samples were asked for"),
            Self::NoTile => f.write_str("the side of a tile is zero"),
            Self::Threads(error) => error.fmt(f),
            Self::Resume(error) => write!(f, "the picture to go on with {error}"),
        }
    }
}

impl core::error::Error for RenderError {}

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
    let mut render = Render::new(film, settings, control, 1)?;
    let reason = render.passes(&integrand);
    Ok(render.outcome(reason))
}

/// Passes of samples that share something.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Passes {
    /// Samples of every pixel in a pass.
    pub length: NonZero<u32>,
    /// Whether time may end a render within a pass: the samples of a part of a pass make a picture, too.
    pub may_break: bool,
}

/// The picture as it is between two batches of jobs: for [`Control::watch`].
///
/// ```
/// use core::cell::RefCell;
/// use fogbow::{sampling::uniform, spectrum::Spectrum};
/// use fogbow_std::{film::Film, progress::Control, tiles::{Sample, Settings, Watched, render}, seed::SampleRng};
/// let noise = |_: &Sample<'_>, rng: &mut SampleRng, layers: &mut [Spectrum]| layers[0] = Spectrum::splat(uniform(rng));
/// let settings = Settings { samples: 64, ..Settings::default() };
/// // Saved once half the samples are there.
/// let saved = RefCell::new(Vec::new());
/// let watch = |tiles: &Watched, _: bool| {
///     if tiles.least_count() == 32 {
///         *saved.borrow_mut() = tiles.to_bytes(7);
///     }
/// };
/// let (mut whole, mut resumed) = (Film::new(8, 8, &["total"])?, Film::new(8, 8, &["total"])?);
/// render(&mut whole, &settings, &Control { watch: Some(&watch), ..Control::default() }, noise)?;
/// // The program was killed; the next run goes on.
/// let saved = saved.into_inner();
/// render(&mut resumed, &settings, &Control { resume: Some((&saved, 7)), ..Control::default() }, noise)?;
/// assert_eq!(resumed, whole);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub type Watched = Tiles<'static, Sequence, Counters>;

/// Is shown the picture, and whether the render ends with it.
pub type Watch<'a> = &'a dyn Fn(&Watched, bool);

/// An integrand whose queries of the world are counted.
struct Counted<F>(F);

impl<F: Fn(&Sample<'_>, &mut SampleRng, &mut [Spectrum])> Integrand<SampleRng> for Counted<F> {
    type Tally = Queries;

    #[inline]
    fn sample(&self, sample: &Sample<'_>, rng: &mut SampleRng, layers: &mut [Spectrum]) {
        (self.0)(sample, rng, layers);
    }
}

/// A render on its way; the film gets its samples back when it is dropped.
pub(crate) struct Render<'a> {
    film: &'a mut Film,
    settings: &'a Settings,
    control: &'a Control<'a>,
    threads: Threads,
    samples: u32,
    tiles: Option<Tiles<'static, Sequence, Counters>>,
    clock: Stopwatch,
    reporter: Reporter<'a>,
}

impl Drop for Render<'_> {
    fn drop(&mut self) {
        if let Some(tiles) = self.tiles.take() {
            self.film.replace(tiles.into_sums());
        }
    }
}

impl<'a> Render<'a> {
    pub(crate) fn new(
        film: &'a mut Film,
        settings: &'a Settings,
        control: &'a Control<'a>,
        pass: u32,
    ) -> Result<Self, RenderError> {
        if settings.samples == 0 {
            return Err(RenderError::NoSamples);
        }
        if settings.tile == 0 {
            return Err(RenderError::NoTile);
        }
        let threads = Threads::new(settings.threads)?;
        let clock = Stopwatch::start();
        let of = picture::Settings {
            size: [film.width(), film.height()],
            layers: film.layers().len() as u32,
            samples: settings.samples,
            goal: settings.goal,
            seed: settings.seed,
            tile: settings.tile,
        };
        let before = film.total_count();
        let tiles = match control.resume {
            Some((bytes, tag)) => Tiles::read(of, settings.sequence, tag, bytes).map_err(RenderError::Resume)?,
            None => {
                let (sums, counts) = film.take();
                Tiles::of(of, settings.sequence, sums, counts)
            }
        };
        let tiles = tiles.of_share(settings.share, pass);
        let [first, end] = settings.share.samples(settings.samples, pass);
        let samples = end - first;
        let total = u64::from(tiles.pixel_count()) * u64::from(samples);
        let before = if control.resume.is_some() { tiles.counts().samples } else { before };
        let reporter = Reporter::new(control, before, total, settings.time);
        let tiles = Some(tiles.by_pass());
        Ok(Self { film, settings, control, threads, samples, tiles, clock, reporter })
    }

    pub(crate) fn outcome(self, reason: Reason) -> Outcome {
        self.reporter.tell();
        if let (Some(watch), Some(tiles)) = (self.control.watch, &self.tiles) {
            watch(tiles, true);
        }
        let counters = self.tiles.as_ref().map_or_else(Counters::default, |tiles| {
            let picture::Counts { samples, non_finite } = tiles.counts();
            Counters { samples, non_finite, ..*tiles.total() }
        });
        Outcome { samples: self.done(), reason, counters, seconds: self.clock.elapsed() }
    }

    fn done(&self) -> u32 {
        self.tiles.as_ref().map_or(0, Tiles::least_count)
    }

    /// Takes every pixel to `until` samples, or without that the pass at hand to its end; whether it was not stopped.
    fn pass<F>(&mut self, until: Option<u32>, integrand: &Counted<F>) -> bool
    where
        F: Fn(&Sample<'_>, &mut SampleRng, &mut [Spectrum]) + Sync,
    {
        let control = self.control;
        let Some(tiles) = &mut self.tiles else { return false };
        if let Some(until) = until {
            tiles.begin(until);
        }
        let mut before = tiles.counts().samples;
        let reporter = &mut self.reporter;
        let ran = run(tiles, integrand, &self.threads, self.control, None, |tiles| {
            reporter.add(tiles.counts().samples - before);
            before = tiles.counts().samples;
            if let Some(watch) = control.watch {
                watch(tiles, false);
            }
        });
        ran.ending == Ending::Done
    }

    fn passes<F>(&mut self, integrand: &F) -> Reason
    where
        F: Fn(&Sample<'_>, &mut SampleRng, &mut [Spectrum]) + Sync,
    {
        let integrand = Counted(integrand);
        let mut done = self.done();
        if done >= self.samples || self.tiles.as_ref().is_none_or(Tiles::is_done) {
            return Reason::Done;
        }
        // A part is no picture to look at on the way, and samples of one pixel in a row find more in the processor's caches.
        let is_whole = self.settings.share == Share::Whole;
        let mut until = if is_whole { done.saturating_add(1).min(self.samples) } else { self.samples };
        let mut is_begun = false;
        if let (Some(_), Some(tiles)) = (self.control.resume, &self.tiles) {
            // A goal is judged where passes end: so that which was left is taken to its end.
            (until, done, is_begun) = (tiles.until(), done.min(tiles.until()), true);
        }
        loop {
            let before = self.reporter.elapsed();
            if self.control.is_cancelled() || !self.pass((!is_begun).then_some(until), &integrand) {
                return Reason::Cancelled;
            }
            is_begun = false;
            let Some(tiles) = self.tiles.as_ref().filter(|tiles| !tiles.is_done()) else { return Reason::Done };
            let now = self.reporter.elapsed();
            let Some(most) = affordable(self.settings.time, now, now - before, until - done) else {
                return Reason::TimeUp;
            };
            done = until;
            until = tiles.next_until(most).min(self.samples);
        }
    }

    /// Samples in `passes`, each with what `prepare` makes for it, given its number. Time ends them between passes, unless these
    /// may break.
    pub(crate) fn prepared_passes<T, E, F>(
        &mut self,
        passes: Passes,
        mut prepare: impl FnMut(u32, &Threads) -> Result<T, E>,
        integrand: &F,
    ) -> Result<Reason, E>
    where
        T: Sync,
        F: Fn(&T, &Sample<'_>, &mut SampleRng, &mut [Spectrum]) + Sync,
    {
        let settings = &Settings { samples: self.samples, ..*self.settings };
        let first = self.tiles.as_ref().map_or(0, Tiles::first);
        loop {
            let done = self.done();
            if done >= settings.samples {
                return Ok(Reason::Done);
            }
            if self.control.is_cancelled() {
                return Ok(Reason::Cancelled);
            }
            let before = self.reporter.elapsed();
            let pass = (first + done) / passes.length;
            let prepared = prepare(pass, &self.threads)?;
            let integrand = Counted(|sample: &Sample<'_>, rng: &mut SampleRng, layers: &mut [Spectrum]| {
                integrand(&prepared, sample, rng, layers);
            });
            let end = (pass * passes.length.get()).saturating_add(passes.length.get()) - first;
            let end = end.min(settings.samples);
            let mut until = if passes.may_break && settings.time.is_some() { done + 1 } else { end };
            loop {
                let (from, start) = (self.done(), self.reporter.elapsed());
                if !self.pass(Some(until), &integrand) {
                    return Ok(Reason::Cancelled);
                }
                let now = self.reporter.elapsed();
                if until == end {
                    // The next pass will take about as long as this one.
                    let next = if passes.may_break { Duration::ZERO } else { now - before };
                    if settings.time.is_some_and(|budget| until < settings.samples && now + next > budget) {
                        return Ok(Reason::TimeUp);
                    }
                    break;
                }
                let (Some(affordable), true) = (affordable(settings.time, now, now - start, until - from), until < end)
                else {
                    return Ok(Reason::TimeUp);
                };
                until = until.saturating_add(affordable.min(until)).min(end);
            }
        }
    }
}
