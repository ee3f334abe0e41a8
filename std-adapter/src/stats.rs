//! What a render took: the one clock, and the core's counters of queries of the host's world.

use core::ops::Add;
use core::time::Duration;
use std::time::Instant;

pub use fogbow::picture::{Counters, CountingMedium, CountingScene, Queries};

/// A length of time.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Seconds {
    /// On the clock on the wall.
    pub wall: f64,
    /// Of all threads of the process together; `None` where the system does not say.
    pub cpu: Option<f64>,
}

impl Add for Seconds {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { wall: self.wall + other.wall, cpu: self.cpu.zip(other.cpu).map(|(a, b)| a + b) }
    }
}

/// A running clock.
///
/// ```
/// let clock = fogbow_std::stats::Stopwatch::start();
/// assert!(clock.elapsed().wall >= 0.0);
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Stopwatch {
    wall: Instant,
    cpu: Option<f64>,
}

impl Stopwatch {
    /// Starts now.
    #[must_use]
    pub fn start() -> Self {
        Self { wall: Instant::now(), cpu: cpu_seconds() }
    }

    /// Time since the start, on the wall alone.
    pub(crate) fn wall(&self) -> Duration {
        self.wall.elapsed()
    }

    /// Time since the start.
    #[must_use]
    pub fn elapsed(&self) -> Seconds {
        let cpu = cpu_seconds().zip(self.cpu).map(|(now, then)| now - then);
        Seconds { wall: self.wall.elapsed().as_secs_f64(), cpu }
    }
}

/// CPU seconds of the process so far.
#[cfg(any(unix, windows))]
fn cpu_seconds() -> Option<f64> {
    cpu_time::ProcessTime::try_now().ok().map(|time| time.as_duration().as_secs_f64())
}

#[cfg(not(any(unix, windows)))]
fn cpu_seconds() -> Option<f64> {
    None
}
