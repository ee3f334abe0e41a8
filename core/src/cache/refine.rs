//! Pictures of falling error, where time is limited.

use core::time::Duration;

/// The error of the first picture. Larger: hardly less time, which then goes into finding places; smaller: nothing to see for longer.
const FIRST_ERROR: f32 = 0.16;

/// How many times as long a picture takes whose error is half as large, before that has been measured, and at least. Larger: time is left when none would be
/// done in it; smaller: a picture is begun that is not done.
const LONGER: f64 = 1.5;

/// By how much that grows from halving to halving: what does not depend on the error counts less and less. Larger: time is left; smaller: as above.
const STEEPER: f64 = 2.0;

/// Most that it grows to: noise goes with the root of time.
const LONGEST: f64 = 4.0;

/// How many times the error is halved at once, at most. More: steps that are foretold badly; fewer: pictures that are soon thrown away.
const HALVINGS: i32 = 2;

/// Share of the time left that a next picture may be foretold to take.
const TIMELY: f64 = 0.8;

/// Share of the time left that filling caches for a next picture is granted, as it may take longer than foretold. More: less is left for the picture that
/// there is, if the next is not done; less: fills are cut that would have been done.
const GRANTED: f64 = 0.9;

/// Share of the time of a fill that its audit may take where time is limited. More: time that less noise would use better; less: it says nothing.
const AUDITED: f64 = 0.05;

/// Pictures of falling error, one after the other: each is filled caches for half the error of the one before, or a quarter, if that is
/// foretold to be done in time. As time goes with the square of the error, all before the last take a part of its time.
///
/// ```
/// use core::time::Duration;
/// use fogbow::cache::{ERROR_BOUNDS, Refinement};
/// let mut refinement = Refinement::new(ERROR_BOUNDS[0]);
/// assert_eq!(refinement.error(), 0.16);
/// // Fill caches with settings for this error and make a picture: one second. Ten are left, and a picture of half the error would
/// // take one and a half, of a quarter some four or five.
/// let seconds = Duration::from_secs;
/// assert!(refinement.advance(seconds(1), seconds(10)));
/// assert_eq!(refinement.error(), 0.04);
/// // It took longer than that: the next one would not be done.
/// assert!(!refinement.advance(seconds(6), seconds(4)));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Refinement {
    error: f32,
    finest: f32,
    longer: f64,
    /// What the picture before took (s), and how many halvings it lies back.
    before: Option<(f64, i32)>,
}

impl Refinement {
    /// Down to an error of `finest`; see [`ERROR_BOUNDS`](super::ERROR_BOUNDS).
    #[must_use]
    pub fn new(finest: f32) -> Self {
        // Written so that NaN has no say.
        let error = if finest > FIRST_ERROR { finest } else { FIRST_ERROR };
        Self { error, finest, longer: LONGER, before: None }
    }

    /// The error of the picture that is due, for [`Settings::for_outline`](super::Settings::for_outline).
    #[must_use]
    pub fn error(&self) -> f32 {
        self.error
    }

    /// How long filling caches for the picture that is due may take, of the time `left`, before there is more use in going on with the one before: without
    /// end if there is none.
    ///
    /// ```
    /// # use core::time::Duration;
    /// # use fogbow::cache::{ERROR_BOUNDS, Refinement};
    /// let mut refinement = Refinement::new(ERROR_BOUNDS[0]);
    /// let seconds = Duration::from_secs;
    /// assert_eq!(refinement.granted(seconds(10)), Duration::MAX);
    /// assert!(refinement.advance(seconds(1), seconds(10)));
    /// assert!(refinement.granted(seconds(10)) < seconds(10));
    /// ```
    #[must_use]
    pub fn granted(&self, left: Duration) -> Duration {
        if self.before.is_some() { left.mul_f64(GRANTED) } else { Duration::MAX }
    }

    /// How long an audit may take after a fill that `took` so long: a part of its rays are as good as all of a shorter one.
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

    /// Goes on to the next picture, after this one `took` so long and while `left` is left; `false` if it would not be done in time, or
    /// nothing finer is wanted.
    pub fn advance(&mut self, took: Duration, left: Duration) -> bool {
        let (took, left) = (took.as_secs_f64(), left.as_secs_f64());
        if let Some((before, halvings)) = self.before {
            let measured = libm::pow(took / before.max(1e-9), 1.0 / f64::from(halvings));
            self.longer = (STEEPER * measured).clamp(LONGER, LONGEST);
        }
        let then = |(took, longer): (f64, f64), _| (took * longer, (STEEPER * longer).min(LONGEST));
        let is_timely = |halvings: &i32| (0..*halvings).fold((took, self.longer), then).0 <= TIMELY * left;
        let Some(halvings) = (1..=HALVINGS).rev().find(is_timely).filter(|_| self.error > self.finest) else {
            return false;
        };
        self.before = Some((took, halvings));
        self.error = (self.error / (1 << halvings) as f32).max(self.finest);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where time goes with the inverse square of the error (on top of some that does not), the pictures thrown away take no more than half of
    /// the time, none is late, and more time makes a smaller error.
    #[test]
    fn little_time_is_lost() {
        let mut last = f32::INFINITY;
        for time in [1.0, 2.0, 5.0, 10.0, 30.0, 100.0, 1000.0] {
            let cost = |error: f32| 0.5 + 1e-3 / f64::from(error * error);
            let mut refinement = Refinement::new(1e-3);
            let mut now = 0.0;
            let useful = loop {
                let took = cost(refinement.error());
                now += took;
                assert!(now <= time, "{time}: {refinement:?} is late at {now}");
                if !refinement.advance(Duration::from_secs_f64(took), Duration::from_secs_f64(time - now)) {
                    break took;
                }
            };
            assert!(useful > 0.5 * now && useful > 0.1 * time, "{useful} of {now} of {time}");
            assert!(refinement.error() <= last);
            last = refinement.error();
        }
        assert!(last < 0.01);
    }

    #[test]
    fn no_finer_than_is_asked_for() {
        let seconds = Duration::from_secs;
        let mut refinement = Refinement::new(0.1);
        assert!(refinement.advance(seconds(1), seconds(100)));
        assert_eq!(refinement.error(), 0.1);
        assert!(!refinement.advance(seconds(1), seconds(100)));
        assert_eq!((Refinement::new(0.3).error(), Refinement::new(f32::NAN).error()), (0.3, 0.16));
    }
}
