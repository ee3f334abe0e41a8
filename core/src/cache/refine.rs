//! Levels of falling error, where time is limited.

use core::time::Duration;

use crate::math::float;

/// The error of the first level. Larger: hardly less time, which then goes into finding places; smaller: nothing to see for longer.
const FIRST_ERROR: f32 = 0.16;

/// Power of one over the error by which the time of a level grows, before that has been measured: little, because a level starts from the one before. Larger:
/// time is left when none would be done in it; smaller: a level is begun that is not done.
const POWER: f64 = 0.7;

/// What is added to that power as two levels tell it, for the next: what does not depend on the error counts less and less. As above.
const STEEPER: f64 = 1.0;

/// Bounds of it: noise goes with the root of time, and smaller radii make more records.
const POWERS: [f64; 2] = [1.5, 3.0];

/// Levels that are considered, from one to the next by the fourth root of a half.
const LEVELS: i32 = 12;

/// Most of them at once: a half. More: steps that are foretold badly; fewer: levels that hardly differ.
const STEP: i32 = 4;

/// Part of the error of the picture that a level must be foretold to spare. Larger: samples of pixels where finer records would do more; smaller: levels for nothing.
const GAIN: f64 = 0.03;

/// Share of the time left that a next level may be foretold to take.
const TIMELY: f64 = 0.75;

/// Share of the time left that filling caches for a next level is granted, as it may take longer than foretold. More: hardly any samples are
/// taken from what there is then; less: fills are cut that would have been done.
const GRANTED: f64 = 0.9;

/// Share of the time of all fills that the audit of the last may take where time is limited. More: time that less noise would use better; less: it says nothing.
const AUDITED: f64 = 0.05;

/// Relative noise of one sample of a pixel, before it has been measured: most pictures have the usual error after 16.
const SAMPLE: f64 = 0.08;

/// Noise of records over the error that they are made for, before it has been measured.
const RECORDS: f64 = 0.7;

/// What is known of the picture of a level.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LevelPicture {
    /// Samples of each pixel so far.
    pub samples: u32,
    /// What one of all pixels takes.
    pub time: Duration,
    /// Relative noise of one sample of a pixel, if it has been measured.
    pub noise: Option<f32>,
    /// Relative noise that records and photons leave in the picture: [`Filling::record_noise`](super::Filling::record_noise).
    pub record_noise: Option<f32>,
}

/// Levels of falling error, one after the other: to which error caches are to be refined next ([`Filling::refine`](super::Filling::refine)), so that the
/// picture has the least error when time is up. More levels leave less time for samples of pixels; what both leave is foretold from what they took so far.
///
/// ```text
/// least of (error of records)² + (noise of a sample)²/samples,   time of a level ~ error^−p
/// ```
///
/// ```
/// use core::time::Duration;
/// use fogbow::cache::{ERROR_BOUNDS, LevelPicture, Refinement};
/// let mut refinement = Refinement::new(ERROR_BOUNDS[0]);
/// assert_eq!(refinement.error(), 0.16);
/// // Fill caches with settings for this error, and take a sample of each pixel. Of ten seconds nine are left: much finer records pay, in steps.
/// let seconds = Duration::from_secs;
/// let picture = LevelPicture { samples: 1, time: seconds(1) / 10, noise: None, record_noise: None };
/// assert!(refinement.advance(seconds(1), seconds(9), &picture));
/// assert_eq!(refinement.error(), 0.08);
/// // It took longer than that: the next one would not be done.
/// assert!(!refinement.advance(seconds(6), seconds(3), &picture));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Refinement {
    error: f32,
    finest: f32,
    power: f64,
    /// The error of the level before, and what it took (s).
    before: Option<(f32, f64)>,
}

impl Refinement {
    /// Down to an error of `finest`; see [`ERROR_BOUNDS`](super::ERROR_BOUNDS).
    #[must_use]
    pub fn new(finest: f32) -> Self {
        // Written so that NaN has no say.
        let error = if finest > FIRST_ERROR { finest } else { FIRST_ERROR };
        Self { error, finest, power: POWER, before: None }
    }

    /// The error of the level that is due, for [`Settings::for_outline`](super::Settings::for_outline).
    #[must_use]
    pub fn error(&self) -> f32 {
        self.error
    }

    /// How long filling caches for the level that is due may take, of the time `left`: without end if there is none before it.
    ///
    /// ```
    /// # use core::time::Duration;
    /// # use fogbow::cache::{ERROR_BOUNDS, LevelPicture, Refinement};
    /// let mut refinement = Refinement::new(ERROR_BOUNDS[0]);
    /// let seconds = Duration::from_secs;
    /// assert_eq!(refinement.granted(seconds(10)), Duration::MAX);
    /// let picture = LevelPicture { samples: 1, time: seconds(1), noise: None, record_noise: None };
    /// assert!(refinement.advance(seconds(1), seconds(50), &picture));
    /// assert!(refinement.granted(seconds(10)) < seconds(10));
    /// ```
    #[must_use]
    pub fn granted(&self, left: Duration) -> Duration {
        if self.before.is_some() { left.mul_f64(GRANTED) } else { Duration::MAX }
    }

    /// How long the audit may take after fills that `took` so long in all: a part of its rays are as good as all of a shorter one.
    ///
    /// ```
    /// # use core::time::Duration;
    /// # use fogbow::cache::Refinement;
    /// assert_eq!(Refinement::audit_time(Duration::from_secs(20)), Duration::from_secs(1));
    /// ```
    #[must_use]
    pub fn audit_time(took: Duration) -> Duration {
        took.mul_f64(AUDITED)
    }

    /// Goes on to the next level, after filling for this one `took` so long and while `left` is left; `false` if samples of pixels are a better use of the
    /// rest, or nothing finer is wanted.
    pub fn advance(&mut self, took: Duration, left: Duration, picture: &LevelPicture) -> bool {
        let (took, left) = (took.as_secs_f64().max(1e-9), left.as_secs_f64());
        if let Some((error, before)) = self.before {
            let halvings = libm::log(f64::from(error / self.error));
            self.power = (libm::log(took / before) / halvings + STEEPER).clamp(POWERS[0], POWERS[1]);
        }
        let finer = |level: i32| self.error * float::powf(0.5, level as f32 / STEP as f32);
        let cost = |error: f32| took * libm::pow(f64::from(self.error / error), self.power);
        let of_records = picture.record_noise.map_or(RECORDS, |noise| f64::from(noise / self.error));
        let of_sample = picture.noise.map_or(SAMPLE, f64::from);
        let square = |error: f32, time: f64| {
            let samples = f64::from(picture.samples) + time / picture.time.as_secs_f64().max(1e-9);
            let (records, noise) = (of_records * f64::from(error), of_sample * of_sample / samples.max(1.0));
            records * records + noise
        };
        let levels = (1..=LEVELS).map(|level| finer(level).max(self.finest)).filter(|&error| error < self.error);
        let timely = levels.filter(|&error| cost(error) <= TIMELY * left);
        let foretold = timely.map(|error| (error, square(error, left - cost(error))));
        let best = foretold.min_by(|(_, a), (_, b)| a.total_cmp(b));
        let stay = square(self.error, left) * (1.0 - GAIN) * (1.0 - GAIN);
        let Some((best, _)) = best.filter(|&(_, square)| square < stay) else { return false };
        self.before = Some((self.error, took));
        self.error = best.max(finer(STEP));
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PICTURE: LevelPicture =
        LevelPicture { samples: 1, time: Duration::from_millis(100), noise: None, record_noise: None };

    /// The error that is left, and the time used by fills, where a level takes so long (s) for its error.
    fn played(time: f64, finest: f32, cost: impl Fn(f32) -> f64) -> (f32, f64) {
        let (mut refinement, mut now) = (Refinement::new(finest), 0.0);
        loop {
            let took = cost(refinement.error());
            now += took;
            let left = time - now;
            assert!(left > 0.0, "{time}: {refinement:?} is late");
            if !refinement.advance(Duration::from_secs_f64(took), Duration::from_secs_f64(left), &PICTURE) {
                return (refinement.error(), now);
            }
        }
    }

    /// More time makes a smaller error, none is late, and neither fills nor samples take all the time.
    #[test]
    fn time_is_well_used() {
        let mut last = f64::INFINITY;
        for time in [1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0, 1000.0] {
            let cost = |error: f32| 0.4 + 1e-3 / f64::from(error * error);
            let (error, filled) = played(time, 1e-3, cost);
            let samples = 10.0 * (time - filled);
            let square = |error: f64, samples: f64| (RECORDS * error).powi(2) + SAMPLE * SAMPLE / samples;
            let reached = square(f64::from(error), samples);
            // One level, and as much error as there must be.
            let best = (1..1000).map(|i| f64::from(i) * 1e-3 * time).filter(|&fill| fill > 0.45 && fill < 0.99 * time);
            let best = best
                .map(|fill| square((1e-3 / (fill - 0.4)).sqrt(), 10.0 * (time - fill)))
                .fold(f64::INFINITY, f64::min);
            assert!(
                reached < 4.0 * best && reached < last,
                "{time}: {error} after {filled} s, {reached:e} of {best:e}"
            );
            last = reached;
        }
    }

    #[test]
    fn no_finer_than_is_asked_for() {
        let seconds = Duration::from_secs;
        let mut refinement = Refinement::new(0.1);
        assert!(refinement.advance(seconds(1), seconds(100), &PICTURE));
        assert_eq!(refinement.error(), 0.1);
        assert!(!refinement.advance(seconds(1), seconds(100), &PICTURE));
        assert_eq!((Refinement::new(0.3).error(), Refinement::new(f32::NAN).error()), (0.3, 0.16));
    }

    #[test]
    fn samples_pay_where_records_are_good() {
        let noisy = LevelPicture { noise: Some(1.0), record_noise: Some(0.01), ..PICTURE };
        let seconds = Duration::from_secs;
        assert!(!Refinement::new(1e-3).advance(seconds(1), seconds(10), &noisy));
        assert!(Refinement::new(1e-3).advance(seconds(1), seconds(10), &PICTURE));
    }
}
