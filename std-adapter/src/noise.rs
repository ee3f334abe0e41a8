//! How many samples are enough, by the noise they still have.

use std::sync::{Mutex, MutexGuard, PoisonError};

/// Share of the picture's mean that is added, in square, to what a pixel's noise is measured against: black
/// corners need not be known to their own precision.
const FLOOR: f64 = 0.1;

/// When a tile has enough samples before it has [`Settings::samples`](crate::tiles::Settings::samples).
///
/// ```text
/// ‖error‖ / √(mean² + (0.1 mean of the picture)²) ≤ noise,   root mean square over the pixels of the tile
/// ```
///
/// of layer 0, mean of the channels. The error is told by how far the mean of `m` samples lies from that of
/// the `n` before them, times `√(nm)/(n + m)`. For independent samples that is exact in the mean square. Of an even sequence,
/// as one of low discrepancy, the halves differ by more than that: if doubling divides the variance `V` by `q`, then
///
/// ```text
/// ⟨(half − other half)²⟩/4 = V(n) − V(2n) = (q − 1) V(2n)
/// ```
///
/// as long as the halves are exchangeable, as those of an Owen-scrambled net are. So when samples have been doubled,
/// the square is divided by `q − 1`; `q`, from 2 (independent) to 4, is how much less the halves differ than at the doubling
/// before, over all tiles that still got samples.
///
/// Tiles that a rare bright sample has not met yet stop early: where light has such samples the picture gets darker
/// by what they would bring, so that methods without them profit most.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Goal {
    /// Relative standard error of a pixel; at 0 or less only tiles without any noise have enough.
    pub noise: f32,
    /// Samples of every pixel in any case: fewer do not tell their noise. Black tiles get eight times as many.
    pub least: u32,
}

/// Sum over some samples of a pixel.
#[derive(Debug, Clone, Copy, Default)]
struct Part {
    sum: f64,
    count: u32,
}

impl Part {
    fn mean(self) -> f64 {
        if self.count == 0 { 0.0 } else { self.sum / f64::from(self.count) }
    }
}

/// What a pixel had before some passes, and has after them.
#[derive(Debug, Clone, Copy, Default)]
struct Pixel {
    before: Part,
    after: Part,
}

impl Pixel {
    /// Variance of the mean after them: if a sample has variance `σ²`, the two parts' means are apart by
    /// `σ² (1/n + 1/m)` in square, and the whole's varies by `σ²/(n + m)`.
    fn error_squared(&self) -> f64 {
        let Self { before, after } = *self;
        let new = Part { sum: after.sum - before.sum, count: after.count - before.count };
        if before.count == 0 || new.count == 0 {
            return f64::INFINITY;
        }
        let (n, m) = (f64::from(before.count), f64::from(new.count));
        (before.mean() - new.mean()).powi(2) * n * m / ((n + m) * (n + m))
    }
}

/// What is known of a tile.
#[derive(Debug, Default)]
pub(crate) struct Tile {
    pixels: Vec<Pixel>,
    is_enough: bool,
    /// Noise squared when the samples were last doubled, as if they were independent.
    when_doubled: Option<f64>,
}

impl Tile {
    pub(crate) fn is_enough(&self) -> bool {
        self.is_enough
    }

    /// A pass begins; its pixels have these sums (layer 0) and counts. What was before stays what there was at the last power of
    /// two, so that samples are doubled again however long passes are.
    pub(crate) fn begin<'a>(&mut self, pixels: impl Iterator<Item = (&'a [f64; 3], u32)>) {
        let mut pixels = pixels.peekable();
        if self.pixels.is_empty() || pixels.peek().is_some_and(|(_, count)| count.is_power_of_two()) {
            self.pixels.clear();
            self.pixels.extend(pixels.map(|pixel| Pixel { before: part(pixel), ..Pixel::default() }));
        }
    }

    /// A pass ends.
    pub(crate) fn end<'a>(&mut self, pixels: impl Iterator<Item = (&'a [f64; 3], u32)>) {
        for (pixel, now) in self.pixels.iter_mut().zip(pixels) {
            pixel.after = part(now);
        }
    }

    /// Whether there are twice as many samples as before.
    fn is_doubled(&self) -> bool {
        self.pixels
            .iter()
            .all(|pixel| pixel.before.count > 0 && pixel.after.count - pixel.before.count == pixel.before.count)
    }

    fn noise_squared(&self, floor: f64) -> f64 {
        let of = |pixel: &Pixel| match pixel.error_squared() {
            0.0 => 0.0,
            error => error / (pixel.after.mean().powi(2) + floor * floor),
        };
        self.pixels.iter().map(of).sum::<f64>() / self.pixels.len().max(1) as f64
    }
}

fn part((sum, count): (&[f64; 3], u32)) -> Part {
    Part { sum: sum.iter().sum::<f64>() / 3.0, count }
}

/// Variance that falls with the square of the number of samples is as even as pictures get.
const EVENNEST: f64 = 3.0;

/// Black tiles get so many times [`Goal::least`]: nothing tells how rarely light comes there.
const BLACK: u32 = 8;

/// The noise of a picture's tiles.
#[derive(Debug)]
pub(crate) struct Noise {
    goal: Goal,
    tiles: Vec<Mutex<Tile>>,
}

impl Noise {
    pub(crate) fn new(goal: Goal, tiles: usize) -> Self {
        Self { goal, tiles: (0..tiles).map(|_| Mutex::default()).collect() }
    }

    pub(crate) fn tile(&self, index: u32) -> MutexGuard<'_, Tile> {
        self.tiles[index as usize].lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Decides for every tile, after a pass that left all others with `samples`; whether all have enough.
    pub(crate) fn judge(&mut self, samples: u32) -> bool {
        let goal = f64::from(self.goal.noise.max(0.0)).powi(2);
        let mut tiles: Vec<&mut Tile> =
            self.tiles.iter_mut().map(|tile| tile.get_mut().unwrap_or_else(PoisonError::into_inner)).collect();
        let pixels = tiles.iter().map(|tile| tile.pixels.len()).sum::<usize>();
        let total: f64 = tiles.iter().flat_map(|tile| &tile.pixels).map(|pixel| pixel.after.mean()).sum();
        let floor = FLOOR * total.abs() / pixels.max(1) as f64;
        tiles.retain(|tile| !tile.is_enough);
        let (mut last, mut now) = (0.0, 0.0);
        let mut measure = |tile: &mut Tile| {
            let (noise, is_doubled) = (tile.noise_squared(floor), tile.is_doubled());
            if is_doubled && let Some(before) = tile.when_doubled.replace(noise) {
                last += before;
                now += noise;
            }
            (noise, is_doubled)
        };
        let measured: Vec<(f64, bool)> = tiles.iter_mut().map(|tile| measure(tile)).collect();
        if samples < self.goal.least {
            return false;
        }
        let evenness = if now > 0.0 { (last / now - 1.0).clamp(1.0, EVENNEST) } else { 1.0 };
        for (tile, (noise, is_doubled)) in tiles.iter_mut().zip(measured) {
            let is_known = samples / BLACK >= self.goal.least || tile.pixels.iter().any(|pixel| pixel.after.sum != 0.0);
            tile.is_enough = is_known && noise <= goal * if is_doubled { evenness } else { 1.0 };
        }
        tiles.iter().all(|tile| tile.is_enough)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pixels with these means before and in a pass of as many samples.
    fn pass(tile: &mut Tile, pixels: &[(f64, f64)]) {
        let before: Vec<[f64; 3]> = pixels.iter().map(|p| [4.0 * p.0; 3]).collect();
        let after: Vec<[f64; 3]> = pixels.iter().map(|p| [4.0 * (p.0 + p.1); 3]).collect();
        tile.begin(before.iter().map(|sum| (sum, 4)));
        tile.end(after.iter().map(|sum| (sum, 8)));
    }

    #[test]
    fn a_tile_is_enough_from_the_noise_asked_for() {
        let of = |noise| {
            let mut all = Noise::new(Goal { noise, least: 8 }, 1);
            // Means of the pixels 1 and 1, errors ½·0.4 and ½·0.2.
            pass(&mut all.tile(0), &[(0.8, 1.2), (0.9, 1.1)]);
            (all.judge(4), all.judge(8))
        };
        let noise = ((0.04_f32 + 0.01) / 2.0 / 1.01).sqrt();
        assert_eq!(of(noise * 1.0001), (false, true));
        assert_eq!(of(noise * 0.9999), (false, false));
    }

    #[test]
    fn samples_that_are_even_are_less_noisy_than_their_halves_say() {
        // Halves that differ as if the variance fell by `ratio` from pass to pass, the last by 2·0.1.
        let of = |ratio: f64, noise: f32| {
            let mut all = Noise::new(Goal { noise, least: 8 }, 1);
            for (count, error) in [(2, 0.1 * ratio.sqrt()), (4, 0.1)] {
                let parts = [(1.0 - error) * f64::from(count), 2.0 * f64::from(count)];
                all.tile(0).begin([(&[parts[0]; 3], count)].into_iter());
                all.tile(0).end([(&[parts[1]; 3], 2 * count)].into_iter());
                let is_enough = all.judge(2 * count);
                if count == 4 {
                    return is_enough;
                }
            }
            false
        };
        // What 2, 3 and 4 say, and that less and more than these are not believed.
        for (ratio, divisor) in [(0.5, 1.0), (2.0, 1.0), (3.0, 2.0), (4.0, 3.0), (9.0, 3.0)] {
            let noise = (0.01_f32 / 1.01 / divisor).sqrt();
            assert!(of(ratio, noise * 1.0001), "{ratio}");
            assert!(!of(ratio, noise * 0.9999), "{ratio}");
        }
    }

    #[test]
    fn the_error_of_uneven_parts_is_that_of_their_whole() {
        // Independent samples: the mean square of the estimate is the variance of the mean, 1/12/n.
        let mut rng = fogbow::sampling::Generator::new(5);
        let mut draw = |n: u32| (0..n).map(|_| f64::from(fogbow::sampling::uniform(&mut rng))).sum::<f64>();
        let runs = 20_000;
        let mut total = 0.0;
        for _ in 0..runs {
            let before = Part { sum: draw(6), count: 6 };
            let after = Part { sum: before.sum + draw(3), count: 9 };
            total += Pixel { before, after }.error_squared();
        }
        let ratio = total / f64::from(runs) * 12.0 * 9.0;
        // Relative standard deviation of a square of a normal number: √2.
        assert!((ratio - 1.0).abs() < 4.0 * (2.0 / f64::from(runs)).sqrt(), "{ratio}");
    }

    #[test]
    fn black_tiles_are_enough_in_the_end_and_first_passes_are_not() {
        let mut all = Noise::new(Goal { noise: 0.01, least: 8 }, 2);
        pass(&mut all.tile(0), &[(0.0, 0.0)]);
        all.tile(1).begin([(&[0.0; 3], 0)].into_iter());
        all.tile(1).end([(&[1.0; 3], 8)].into_iter());
        assert!(!all.judge(63) && !all.tile(0).is_enough());
        assert!(!all.judge(64));
        assert!(all.tile(0).is_enough() && !all.tile(1).is_enough());
    }
}
