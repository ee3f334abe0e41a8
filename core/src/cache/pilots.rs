//! Pilots: whether records reach too far, measured before they get their values.
//!
//! At some places that eye rays ask for, what the cache of a kind tells is compared with estimates of their own. The mean of the
//! differences is what extrapolation gets wrong there, records mixed and carried as pictures have them; noise has no mean. Where it is certainly
//! more than a part of the error that is asked for, and a second, larger round agrees, all radii of the kind shrink, and what then has no record gets one.
//!
//! Radii in free paths or of a tolerance cannot know this: how light bends within a free path depends on whether fog ends at a wall or in the open.

use crate::sent::packed;
use crate::spectrum::Spectrum;

/// Part of the error asked for that extrapolation of a kind may take, of its own light. Larger: a picture is too dark or too bright as a whole; smaller: more
/// records.
const SHARE: f64 = 0.25;

/// Standard errors beyond which a difference is no chance. Fewer: records for nothing.
const SURE: f64 = 2.0;

/// Bounds of the factor by which radii shrink at once: less says a single pilot too much, more changes nothing.
const FACTORS: [f64; 2] = [0.5, 0.85];

/// How often radii of a kind may shrink in a fill. More: time, where what is wrong does not come from radii.
pub(super) const MOST: u32 = 4;

/// To what part of it what is wrong must have fallen as radii shrank, for them to shrink again: by the square of half the radius it is a quarter. More: records
/// smaller than what eye rays can ask for, where what is wrong does not come from radii.
pub(super) const HELPS: f64 = 0.5;

/// Samples of each estimate. More: fewer places for the same time; fewer: estimates that start evenly over the sphere miss what lights it.
pub(super) const SAMPLES: u32 = 64;

/// Places of one job.
pub(super) const PLACES_PER_JOB: u32 = 2;

/// One over half of the part of the samples of a kind that pilots take, as each makes two estimates.
const PART: u64 = 10;

/// Jobs at least and at most. Fewer do not tell what is wrong from chance; more take time and tell no more.
const JOBS: [u32; 2] = [32, 1024];

/// Jobs of a second round over those of the first, where that says that radii must shrink: a fill has a dozen such verdicts, and one by chance makes five times
/// the records. More: time where the first was right; fewer: chance decides.
pub(super) const AGAIN: u32 = 3;

/// Jobs of the pilots of a kind, of which so many samples have been taken.
pub(super) fn jobs_for(samples: u64) -> u32 {
    let jobs = samples / (PART * u64::from(SAMPLES * PLACES_PER_JOB));
    u32::try_from(jobs).unwrap_or(u32::MAX).clamp(JOBS[0], JOBS[1])
}

/// Sums over places, of differences `d` and light `t`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Pilots {
    count: u32,
    d: f64,
    t: f64,
    dd: f64,
    dt: f64,
    tt: f64,
}

packed!(Pilots { count: u32, d: f64, t: f64, dd: f64, dt: f64, tt: f64 });

impl Pilots {
    /// What a cache tells at a place, and an estimate of its own.
    pub(super) fn add(&mut self, told: Spectrum, own: Spectrum) {
        let (t, d) = (f64::from(own.mean()), f64::from(told.mean()) - f64::from(own.mean()));
        if t.is_finite() && d.is_finite() {
            self.merge(&Self { count: 1, d, t, dd: d * d, dt: d * t, tt: t * t });
        }
    }

    pub(super) fn merge(&mut self, other: &Self) {
        self.count += other.count;
        self.d += other.d;
        self.t += other.t;
        self.dd += other.dd;
        self.dt += other.dt;
        self.tt += other.tt;
    }

    /// How far caches are off, over the light there is.
    pub(super) fn off(&self) -> f64 {
        (self.d / self.t).abs()
    }

    /// The factor by which radii should shrink for an error of `error`; `None` if they are right.
    ///
    /// By the ratio estimate `b = Σd/Σt` and its standard error, as that of audits. What extrapolation has wrong goes with the square of radii.
    pub(super) fn factor(&self, error: f32) -> Option<f32> {
        if self.count < 2 || !(self.t > 0.0) {
            return None;
        }
        let (n, b, most) = (f64::from(self.count), self.d / self.t, SHARE * f64::from(error));
        let squares = (self.dd - 2.0 * b * self.dt + b * b * self.tt).max(0.0);
        let standard_error = libm::sqrt(squares * n / (n - 1.0)) / self.t;
        let is_off = b.abs() - SURE * standard_error > most;
        is_off.then(|| libm::sqrt(most / b.abs()).clamp(FACTORS[0], FACTORS[1]) as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pilots(bias: f32, noise: f32) -> Pilots {
        let mut pilots = Pilots::default();
        for i in 0..400_u32 {
            let chance = if i % 2 == 0 { noise } else { -noise };
            pilots.add(Spectrum::splat(2.0 * (1.0 + bias)), Spectrum::splat(2.0 * (1.0 + chance)));
        }
        pilots
    }

    #[test]
    fn radii_shrink_by_the_root_of_what_is_certainly_wrong() {
        assert_eq!(pilots(0.0, 0.3).factor(0.02), None);
        // Standard error 1.5 %: 3 % may be chance, 5 % are not.
        assert_eq!(pilots(-0.03, 0.3).factor(0.02), None);
        assert_eq!(pilots(-0.05, 0.3).factor(0.02), Some(0.5));
        let little = pilots(-0.01, 0.001).factor(0.02).unwrap();
        assert!((little - 0.5_f32.sqrt()).abs() < 1e-3, "{little}");
        assert_eq!(pilots(0.0051, 0.0).factor(0.02), Some(0.85));
        assert_eq!(Pilots::default().factor(0.02), None);
    }
}
