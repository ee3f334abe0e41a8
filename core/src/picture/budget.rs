//! How long a pass may be where time is limited.

use core::num::NonZero;
use core::time::Duration;

/// Share of the time left that is given to the next pass, as passes vary in speed: the rest follows by a better estimate. More: the
/// time granted is missed more often; less: more passes, each with its overhead.
const SHARE: f64 = 0.75;

/// Most samples at once, whatever the clock says: one too coarse may tell no time at all.
const MOST: f64 = 1e6;

/// How many samples of every pixel the rest of `budget` allows at `now` (both since the start), after `samples` took `taken`; `None` if
/// time is up.
///
/// ```
/// use core::time::Duration;
/// use fogbow::picture::affordable;
/// let [one, ten, forty] = [1, 10, 40].map(Duration::from_secs);
/// assert_eq!(affordable(Some(forty), ten * 2, ten, 10), Some(15));
/// assert_eq!(affordable(Some(ten), ten, one, 1), None);
/// assert_eq!(affordable(None, ten, one, 1), Some(u32::MAX));
/// ```
#[must_use]
pub fn affordable(budget: Option<Duration>, now: Duration, taken: Duration, samples: u32) -> Option<u32> {
    let Some(budget) = budget else { return Some(u32::MAX) };
    let per_sample = taken.as_secs_f64() / f64::from(samples);
    let affordable = (budget.saturating_sub(now).as_secs_f64() / per_sample).min(MOST);
    if now >= budget || affordable < 1.0 {
        return None;
    }
    Some(((SHARE * affordable) as u32).max(1))
}

/// So many samples, rounded up to whole passes of this length, `u32::MAX` included; no samples stay none.
///
/// ```
/// # use core::num::NonZero;
/// # use fogbow::picture::whole_passes;
/// let three = NonZero::new(3).unwrap();
/// assert_eq!([0, 1, 3, 4].map(|n| whole_passes(n, three)), [0, 3, 3, 6]);
/// ```
#[must_use]
pub fn whole_passes(samples: u32, length: NonZero<u32>) -> u32 {
    samples.checked_next_multiple_of(length.get()).unwrap_or(u32::MAX / length * length.get())
}
