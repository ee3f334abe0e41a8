//! The one driver: runs any work in rounds ([`Rounds`]) on threads, until it is done, cancelled or out of time.
//!
//! Without feature `threads`, or where the system has none (`wasm32-unknown-unknown`), everything runs on the caller's.

use core::fmt;
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::sync::{Mutex, PoisonError};

use fogbow::work::Rounds;
#[cfg(feature = "threads")]
use rayon::iter::{IndexedParallelIterator, IntoParallelIterator, ParallelIterator};

use crate::progress::Control;
use crate::stats::{Seconds, Stopwatch};

/// Threads to run work on.
///
/// ```
/// use fogbow_std::threads::Threads;
/// assert_eq!(Threads::new(2)?.count(), if cfg!(feature = "threads") { 2 } else { 1 });
/// # Ok::<(), fogbow_std::threads::ThreadsError>(())
/// ```
#[derive(Debug)]
pub struct Threads {
    #[cfg(feature = "threads")]
    pool: rayon::ThreadPool,
}

/// The system gave no threads; what it said.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ThreadsError(String);

impl fmt::Display for ThreadsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "cannot start threads: {}", self.0)
    }
}

impl core::error::Error for ThreadsError {}

/// Why [`run`] returned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// Everything is done.
    Done,
    /// The host asked to stop.
    Cancelled,
    /// The time is used up.
    TimeUp,
}

/// What [`run`] has done.
#[derive(Debug, Clone, PartialEq)]
pub struct Ran {
    /// Why it ended.
    pub ending: Ending,
    /// Time by [`Rounds::stage`], in the order in which these began.
    pub stages: Vec<(&'static str, Seconds)>,
}

/// Jobs of a batch for each thread: results are taken between batches. More: more results are held at once; fewer: threads
/// wait for each other more often.
const BATCH: usize = 64;

impl Threads {
    /// So many threads; 0 for one per processor.
    ///
    /// # Errors
    /// What the system says if it gives none.
    pub fn new(count: usize) -> Result<Self, ThreadsError> {
        #[cfg(feature = "threads")]
        {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build();
            pool.map(|pool| Self { pool }).map_err(|error| ThreadsError(error.to_string()))
        }
        #[cfg(not(feature = "threads"))]
        {
            let _ = count;
            Ok(Self {})
        }
    }

    /// How many there are.
    #[must_use]
    pub fn count(&self) -> usize {
        #[cfg(feature = "threads")]
        {
            self.pool.current_num_threads()
        }
        #[cfg(not(feature = "threads"))]
        1
    }

    /// Calls `work` for every index below `count`, on all threads. Compiled once, whatever the work is.
    fn each(&self, count: usize, work: &(dyn Fn(usize) + Sync)) {
        #[cfg(feature = "threads")]
        if count > 1 {
            self.pool.install(|| (0..count).into_par_iter().with_max_len(1).for_each(work));
            return;
        }
        (0..count).for_each(work);
    }
}

/// Runs `work` in `world` until it is done, or `control` says stop, or `time` is up: the same bits for any number of
/// threads. Work that was stopped goes on where it was when it is run again.
///
/// `between` is called after every batch of jobs, for progress.
pub fn run<W, R>(
    work: &mut R,
    world: &W,
    threads: &Threads,
    control: &Control<'_>,
    time: Option<Duration>,
    mut between: impl FnMut(&R),
) -> Ran
where
    W: Sync + ?Sized,
    R: Rounds<W> + Sync,
    R::Output<'static>: Default + Send,
{
    let clock = Stopwatch::start();
    let mut stages: Vec<(&'static str, Seconds)> = Vec::new();
    // Nobody else has the index of a job, so that no lock is ever waited for.
    let mut outputs: Vec<Mutex<(bool, R::Output<'static>)>> = Vec::new();
    loop {
        let jobs = work.jobs();
        let is_late = || time.is_some_and(|time| clock.elapsed().wall >= time.as_secs_f64());
        let ending = if jobs.is_empty() {
            Some(Ending::Done)
        } else if control.is_cancelled() {
            Some(Ending::Cancelled)
        } else {
            is_late().then_some(Ending::TimeUp)
        };
        if let Some(ending) = ending {
            return Ran { ending, stages };
        }
        let (stage, began) = (work.stage(), Stopwatch::start());
        let count = jobs.len().min(BATCH * threads.count());
        while outputs.len() < count {
            outputs.push(Default::default());
        }
        let batch = &mut outputs[..count];
        let stop = AtomicBool::new(false);
        let (frozen, cancel) = (&*work, control.cancel);
        threads.each(count, &|i| {
            let (is_done, output) = &mut *batch[i].lock().unwrap_or_else(PoisonError::into_inner);
            *is_done = !stop.load(Ordering::Relaxed);
            if !*is_done {
                return;
            }
            frozen.run(jobs.start + i as u32, world, output);
            if cancel.is_some_and(|flag| flag.load(Ordering::Relaxed)) || is_late() {
                stop.store(true, Ordering::Relaxed);
            }
        });
        // What was not run is asked for again.
        let results = batch.iter_mut().map(|result| result.get_mut().unwrap_or_else(PoisonError::into_inner));
        results.take_while(|(is_done, _)| *is_done).for_each(|(_, output)| work.accept(output));
        let took = began.elapsed();
        match stages.iter_mut().find(|(name, _)| *name == stage) {
            Some((_, sum)) => *sum = *sum + took,
            None => stages.push((stage, took)),
        }
        between(work);
    }
}
