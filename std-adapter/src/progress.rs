//! How far a render is, and how to stop it.

use core::fmt;
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;

use crate::stats::Stopwatch;
use crate::tiles::Watch;

/// How far a render is.
///
/// ```
/// use core::time::Duration;
/// use fogbow_std::progress::Progress;
/// let elapsed = Duration::from_secs(3);
/// let progress = Progress { done: 30, total: 90, before: 0, elapsed, budget: None };
/// assert_eq!(progress.remaining().unwrap().as_secs_f64().round(), 6.0);
/// // A resumed render counts from where it began; limited time counts where it is further.
/// assert_eq!(Progress { before: 30, ..progress }.fraction(), 0.0);
/// assert_eq!(Progress { budget: Some(elapsed), ..progress }.fraction(), 1.0);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Samples in the film, over all pixels.
    pub done: u64,
    /// Samples asked for, over all pixels.
    pub total: u64,
    /// Samples that were in the film at the start.
    pub before: u64,
    /// Time since the start.
    pub elapsed: Duration,
    /// Time granted.
    pub budget: Option<Duration>,
}

impl Progress {
    /// Part of the work done, in [0, 1]: of the samples or of the time, whichever is further.
    #[must_use]
    pub fn fraction(&self) -> f64 {
        let part = |a: f64, b: f64| if b > 0.0 { (a / b).min(1.0) } else { 1.0 };
        let samples =
            part((self.done.saturating_sub(self.before)) as f64, self.total.saturating_sub(self.before) as f64);
        self.budget.map_or(samples, |budget| samples.max(part(self.elapsed.as_secs_f64(), budget.as_secs_f64())))
    }

    /// Time left, by the speed so far; `None` before there is one.
    #[must_use]
    pub fn remaining(&self) -> Option<Duration> {
        let fraction = self.fraction();
        (fraction > 0.0)
            .then(|| self.elapsed.as_secs_f64() * (1.0 - fraction) / fraction)
            .and_then(|seconds| Duration::try_from_secs_f64(seconds).ok())
    }
}

/// The host's hands on a running render. The default has none.
///
/// ```
/// use core::sync::atomic::{AtomicBool, Ordering};
/// use fogbow_std::progress::Control;
/// let flag = AtomicBool::new(false);
/// let control = Control { cancel: Some(&flag), ..Control::default() };
/// flag.store(true, Ordering::Relaxed);
/// assert!(control.is_cancelled());
/// ```
#[derive(Clone, Copy, Default)]
pub struct Control<'a> {
    /// Set by the host (from another thread, a signal handler, the progress function) to stop soon.
    pub cancel: Option<&'a AtomicBool>,
    /// Called at most twenty times a second, by the thread that renders, and once at the end.
    pub progress: Option<&'a dyn Fn(&Progress)>,
    /// Called by the thread that renders after every batch of jobs, some milliseconds apart, with the picture as it is, and once at the end,
    /// with `true`: to show it, or to save it by [`Tiles::to_bytes`](fogbow::picture::Tiles::to_bytes).
    pub watch: Option<Watch<'a>>,
    /// What [`Tiles::to_bytes`](fogbow::picture::Tiles::to_bytes) has saved, and its tag: the picture goes on from there, to the same bits.
    pub resume: Option<(&'a [u8], u64)>,
}

impl Control<'_> {
    /// Whether the host wants to stop.
    #[must_use]
    pub fn is_cancelled(&self) -> bool {
        self.cancel.is_some_and(|flag| flag.load(Ordering::Relaxed))
    }
}

impl fmt::Debug for Control<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Control")
            .field("cancel", &self.cancel)
            .field("progress", &self.progress.is_some())
            .field("watch", &self.watch.is_some())
            .field("resume", &self.resume.map(|(bytes, tag)| (bytes.len(), tag)))
            .finish()
    }
}

/// Counts finished samples and tells the host, but not too often.
#[derive(Debug)]
pub(crate) struct Reporter<'a> {
    control: &'a Control<'a>,
    done: u64,
    total: u64,
    before: u64,
    budget: Option<Duration>,
    clock: Stopwatch,
    last: Duration,
}

impl<'a> Reporter<'a> {
    /// Between two calls of the host: often enough to look smooth, too seldom to cost anything.
    const INTERVAL: Duration = Duration::from_millis(50);

    pub(crate) fn new(control: &'a Control<'a>, before: u64, total: u64, budget: Option<Duration>) -> Self {
        Self { control, done: before, total, before, budget, clock: Stopwatch::start(), last: Duration::ZERO }
    }

    pub(crate) fn elapsed(&self) -> Duration {
        self.clock.wall()
    }

    /// Adds finished samples.
    pub(crate) fn add(&mut self, samples: u64) {
        self.done += samples;
        if self.elapsed() - self.last >= Self::INTERVAL {
            self.tell();
            self.last = self.elapsed();
        }
    }

    /// Says how far the render is; the last word, too.
    pub(crate) fn tell(&self) {
        let Some(progress) = self.control.progress else { return };
        let Self { done, total, before, budget, .. } = *self;
        progress(&Progress { done, total, before, elapsed: self.elapsed(), budget });
    }
}
