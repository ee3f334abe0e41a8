//! What a run of the program did, phase by phase.

use fogbow_std::stats::{Counters, Seconds, Stopwatch};

/// What a program did, phase by phase: plain fields, for the host to print as it likes.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Statistics {
    /// Phases with their times, in the order in which they first ended.
    pub phases: Vec<(String, Seconds)>,
    /// Queries of the world.
    pub counters: Counters,
    /// Bytes held by named things: film, grids, trees.
    pub bytes: Vec<(String, u64)>,
    /// Records of caches.
    pub records: Vec<(String, u64)>,
    /// The relative noise that records leave in the picture, where it was measured.
    pub record_noise: Option<f32>,
    /// How many times the error asked for kinds of caches may have of their own light.
    pub coarser: Vec<(String, f32)>,
}

impl Statistics {
    /// Does `work` and adds its time to phase `name`.
    ///
    /// ```
    /// let mut statistics = fogbow_examples::statistics::Statistics::default();
    /// assert_eq!(statistics.time("read", || 42), 42);
    /// assert_eq!(statistics.phases[0].0, "read");
    /// ```
    pub fn time<T>(&mut self, name: &str, work: impl FnOnce() -> T) -> T {
        let clock = Stopwatch::start();
        let result = work();
        self.add(name, clock.elapsed());
        result
    }

    /// Adds to the time of phase `name`.
    pub fn add(&mut self, name: &str, seconds: Seconds) {
        match self.phases.iter_mut().find(|(n, _)| n == name) {
            Some((_, sum)) => *sum = *sum + seconds,
            None => self.phases.push((name.to_owned(), seconds)),
        }
    }
}
