//! The engine's job queue: some jobs a frame, on threads of its own.

use core::sync::atomic::{AtomicU32, Ordering};
use std::thread;

use fogbow::work::Rounds;

/// Workers, each with memory for the results of its jobs of a frame, and these jobs' numbers.
pub(crate) struct Queue<O> {
    workers: Vec<Vec<(u32, O)>>,
    jobs_per_frame: u32,
}

impl<O: Default + Send> Queue<O> {
    pub(crate) fn new(workers: usize, jobs_per_frame: u32) -> Self {
        Self { workers: (0..workers).map(|_| Vec::new()).collect(), jobs_per_frame }
    }

    /// Runs the jobs of one frame; whether more are due.
    ///
    /// Workers ask `goes_on` before each job. Once it says no they leave the job they have taken, and results of jobs
    /// behind that one are thrown away.
    pub(crate) fn frame<W, R>(&mut self, work: &mut R, world: &W, goes_on: impl Fn() -> bool + Sync) -> bool
    where
        W: Sync + ?Sized,
        R: Rounds<W, Output<'static> = O> + Sync,
    {
        let jobs = work.jobs();
        let end = jobs.end.min(jobs.start + self.jobs_per_frame);
        let (next, frozen, goes_on) = (AtomicU32::new(jobs.start), &*work, &goes_on);
        let worker = |results: &mut Vec<(u32, O)>| {
            let mut count = 0;
            loop {
                let job = next.fetch_add(1, Ordering::Relaxed);
                if job >= end || !goes_on() {
                    return count;
                }
                if results.len() == count {
                    results.push((job, O::default()));
                }
                let (number, output) = &mut results[count];
                *number = job;
                frozen.run(job, world, output);
                count += 1;
            }
        };
        let counts: Vec<usize> = thread::scope(|scope| {
            let running: Vec<_> = self.workers.iter_mut().map(|results| scope.spawn(|| worker(results))).collect();
            running.into_iter().map(|thread| thread.join().expect("jobs do not panic")).collect()
        });
        let done = self.workers.iter().zip(counts).flat_map(|(results, count)| &results[..count]);
        let mut done: Vec<_> = done.collect();
        done.sort_unstable_by_key(|(job, _)| *job);
        let in_a_row = done.iter().zip(jobs).take_while(|((job, _), due)| job == due);
        in_a_row.for_each(|((_, output), _)| work.accept(output));
        !work.jobs().is_empty()
    }

    /// Frame after frame, until all is done.
    pub(crate) fn finish<W, R>(&mut self, work: &mut R, world: &W)
    where
        W: Sync + ?Sized,
        R: Rounds<W, Output<'static> = O> + Sync,
    {
        while self.frame(work, world, || true) {}
    }
}
