//! How many samples are enough, by the noise they still have.

use crate::storage::{Full, List};

/// Share of the picture's mean that is added, in square, to what a pixel's noise is measured against: black
/// corners need not be known to their own precision.
const FLOOR: f64 = 0.1;

/// [`Goal::least`] if nothing else is asked for. Fewer: noise is told too badly, and tiles stop early; more: smooth tiles cost more.
pub const LEAST_SAMPLES: u32 = 8;

/// The most samples per pixel for a given noise. More: a light seen through a keyhole takes forever; fewer: it stays noisy.
pub const MOST_SAMPLES: u32 = 65536;

/// When a tile has enough samples before it has [`Settings::samples`](super::Settings::samples).
///
/// ```text
/// ‖error‖ / √(mean² + (0.1 mean of the picture)²) ≤ noise,   root mean square over the pixels of the tile
/// ```
///
/// of layer 0, mean of the channels; and the same of the pixels' light together, `√Σ error²/√Σ (mean² + …)`, so that a few bright pixels are not lost
/// among dark ones. The error is told by how far the mean of `m` samples lies from that of
/// the `n` before them, times `√(nm)/(n + m)`. For independent samples that is exact in the mean square. Of an even sequence,
/// as one of low discrepancy, the halves differ by more than that: if doubling divides the variance `V` by `q`, then
///
/// ```text
/// ⟨(half − other half)²⟩/4 = V(n) − V(2n) = (q − 1) V(2n)
/// ```
///
/// as long as the halves are exchangeable, as those of an Owen-scrambled net are. So when samples have been doubled,
/// the square is divided by `q − 1`; `q`, from 2 (independent) to 4, is how much less the halves differ than at the doubling
/// before, over all tiles that still got samples. No tile counts as less noisy than one of the most even sequence, given
/// how far its halves differed at the doubling before: two halves may agree by chance. Where a single pixel makes most of a tile's noise they often do, so
/// each pixel also keeps what all its doublings tell together, and the more of both counts:
///
/// ```text
/// V ← ½ (V(2n) + V/q)
/// ```
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
pub(super) struct Part {
    sum: f64,
    count: u32,
}

impl Part {
    /// Of the sums of a pixel (layer 0) over so many samples.
    pub(super) fn of(sum: &[f64; 3], count: u32) -> Self {
        Self { sum: sum.iter().sum::<f64>() / 3.0, count }
    }

    fn mean(self) -> f64 {
        if self.count == 0 { 0.0 } else { self.sum / f64::from(self.count) }
    }
}

/// What a pixel had before some passes, and has after them: memory that is lent for a [`Goal`], see
/// [`TileSlots`](super::TileSlots).
#[derive(Debug, Clone, Copy, Default)]
pub struct PixelNoise {
    before: Part,
    after: Part,
    /// Variance of the mean when samples were last doubled, as if they were independent: what all doublings tell of it.
    told: f64,
}

impl PixelNoise {
    /// Variance of the mean after them: if a sample has variance `σ²`, the two parts' means are apart by
    /// `σ² (1/n + 1/m)` in square, and the whole's varies by `σ²/(n + m)`.
    fn error_squared(&self) -> f64 {
        let Self { before, after, .. } = *self;
        let new = Part { sum: after.sum - before.sum, count: after.count - before.count };
        if before.count == 0 || new.count == 0 {
            return f64::INFINITY;
        }
        let (n, m) = (f64::from(before.count), f64::from(new.count));
        let apart = before.mean() - new.mean();
        apart * apart * n * m / ((n + m) * (n + m))
    }

    /// The same as all doublings tell it, after one.
    fn told(&self) -> f64 {
        if self.is_doubled() { self.told } else { 0.0 }
    }

    /// Samples have been doubled, where variance falls by so much.
    fn doubled(&mut self, (is_first, falls): (bool, f64)) {
        let now = self.error_squared();
        self.told = if is_first { now } else { 0.5 * (now + self.told / falls) };
    }

    fn is_doubled(&self) -> bool {
        self.before.count > 0 && self.after.count - self.before.count == self.before.count
    }
}

/// What is known of a tile: memory that is lent for a [`Goal`], see [`TileSlots`](super::TileSlots).
#[derive(Debug, Clone, Copy, Default)]
pub struct TileNoise {
    is_enough: bool,
    /// Its pixels: from, and to.
    pixels: [u32; 2],
    /// Noise squared when the samples were last doubled, as if they were independent.
    when_doubled: Option<f64>,
    /// The same one doubling earlier.
    doubled_before: Option<f64>,
}

/// Variance that falls with the square of the number of samples is as even as pictures get.
const EVENNEST: f64 = 3.0;

/// Black tiles get so many times [`Goal::least`]: nothing tells how rarely light comes there.
const BLACK: u32 = 8;

/// The noise of a picture's tiles.
#[derive(Debug)]
pub(super) struct Noise<'s> {
    goal: Goal,
    tiles: List<'s, TileNoise>,
    pixels: List<'s, PixelNoise>,
}

impl<'s> Noise<'s> {
    /// Of no tile yet, in such memory.
    pub(super) fn new(
        goal: Goal,
        tiles: impl Into<List<'s, TileNoise>>,
        pixels: impl Into<List<'s, PixelNoise>>,
    ) -> Self {
        Self { goal, tiles: tiles.into(), pixels: pixels.into() }
    }

    /// All that is known, for [`Noise::read`].
    #[cfg(feature = "alloc")]
    pub(super) fn write(&self, bytes: &mut alloc::vec::Vec<u8>) {
        for tile in self.tiles.as_slice() {
            let doubled = [tile.when_doubled, tile.doubled_before];
            let flags = [tile.is_enough, doubled[0].is_some(), doubled[1].is_some()];
            let flags = flags.iter().rev().fold(0, |all: u32, flag| all << 1 | u32::from(*flag));
            bytes.extend(flags.to_le_bytes());
            doubled.iter().for_each(|noise| bytes.extend(noise.unwrap_or(0.0).to_le_bytes()));
        }
        for part in self.pixels.as_slice().iter().flat_map(|pixel| [pixel.before, pixel.after]) {
            bytes.extend(part.sum.to_le_bytes());
            bytes.extend(part.count.to_le_bytes());
        }
        self.pixels.as_slice().iter().for_each(|pixel| bytes.extend(pixel.told.to_le_bytes()));
    }

    /// Into tiles that were added anew. `None` if it is nothing that passes leave.
    #[cfg(feature = "alloc")]
    pub(super) fn read(&mut self, bytes: &mut super::bytes::Reader<'_>) -> Option<()> {
        for tile in self.tiles.as_mut_slice() {
            let (flags, doubled) = (bytes.word(), [bytes.double(), bytes.double()]);
            tile.is_enough = flags & 1 != 0;
            tile.when_doubled = (flags & 2 != 0).then_some(doubled[0]);
            tile.doubled_before = (flags & 4 != 0).then_some(doubled[1]);
        }
        for pixel in self.pixels.as_mut_slice() {
            let [before, after] = [(); 2].map(|()| Part { sum: bytes.double(), count: bytes.word() });
            if before.count > after.count || !before.sum.is_finite() || !after.sum.is_finite() {
                return None;
            }
            (pixel.before, pixel.after) = (before, after);
        }
        for pixel in self.pixels.as_mut_slice() {
            pixel.told = bytes.double();
            if !(pixel.told >= 0.0 && pixel.told.is_finite()) {
                return None;
            }
        }
        Some(())
    }

    pub(super) fn is_enough(&self, tile: u32) -> bool {
        self.tiles.as_slice().get(tile as usize).is_some_and(|tile| tile.is_enough)
    }

    /// Adds the next tile, with so many pixels.
    pub(super) fn add_tile(&mut self, count: u32) -> Result<(), Full> {
        let from = self.pixels.len() as u32;
        (0..count).try_for_each(|_| self.pixels.push(PixelNoise::default()))?;
        self.tiles.push(TileNoise { pixels: [from, from + count], ..TileNoise::default() })
    }

    fn pixels_of(&mut self, tile: u32) -> (&mut [PixelNoise], bool) {
        let Some(tile) = self.tiles.as_slice().get(tile as usize) else { return (&mut [], true) };
        let ([from, to], is_enough) = (tile.pixels, tile.is_enough);
        (&mut self.pixels.as_mut_slice()[from as usize..to as usize], is_enough)
    }

    /// A pass begins, and a tile's pixels are these. What was before stays what there was at the last power of
    /// two, so that samples are doubled again however long passes are.
    pub(super) fn begin(&mut self, tile: u32, parts: impl Iterator<Item = Part>) {
        let (pixels, is_enough) = self.pixels_of(tile);
        let mut parts = parts.peekable();
        let is_new = pixels.first().is_some_and(|pixel| pixel.after.count == 0);
        if !is_enough && (is_new || parts.peek().is_some_and(|part| part.count.is_power_of_two())) {
            pixels.iter_mut().zip(parts).for_each(|(pixel, before)| (pixel.before, pixel.after) = (before, before));
        }
    }

    /// A pass ends.
    pub(super) fn end(&mut self, tile: u32, parts: impl Iterator<Item = Part>) {
        let (pixels, is_enough) = self.pixels_of(tile);
        if !is_enough {
            pixels.iter_mut().zip(parts).for_each(|(pixel, after)| pixel.after = after);
        }
    }

    /// Decides for every tile, after a pass that left all others with `samples`; whether all have enough.
    pub(super) fn judge(&mut self, samples: u32) -> bool {
        let goal = f64::from(self.goal.noise.max(0.0));
        let pixels = self.pixels.as_slice();
        let total: f64 = pixels.iter().map(|pixel| pixel.after.mean()).sum();
        let floor = FLOOR * total.abs() / pixels.len().max(1) as f64;
        let noise_of = |of: &[PixelNoise], error_of: fn(&PixelNoise) -> f64| {
            let (mut shares, mut errors, mut light) = (0.0, 0.0, 0.0);
            for pixel in of {
                let (error, here) = (error_of(pixel), pixel.after.mean() * pixel.after.mean() + floor * floor);
                light += here;
                if error > 0.0 {
                    (shares, errors) = (shares + error / here, errors + error);
                }
            }
            // Of what is bright, and of all pixels alike.
            let by_light = if errors > 0.0 { errors / light } else { 0.0 };
            f64::max(shares / of.len().max(1) as f64, by_light)
        };
        let (mut last, mut now) = (0.0, 0.0);
        for tile in self.tiles.as_mut_slice().iter_mut().filter(|tile| !tile.is_enough) {
            let of = &pixels[tile.pixels[0] as usize..tile.pixels[1] as usize];
            if of.iter().all(PixelNoise::is_doubled) {
                let noise = noise_of(of, PixelNoise::error_squared);
                tile.doubled_before = tile.when_doubled.replace(noise);
                if let Some(before) = tile.doubled_before {
                    last += before;
                    now += noise;
                }
            }
        }
        let evenness = if now > 0.0 { (last / now - 1.0_f64).clamp(1.0, EVENNEST) } else { 1.0 };
        let pixels = self.pixels.as_mut_slice();
        for tile in self.tiles.as_slice().iter().filter(|tile| !tile.is_enough) {
            let [from, to] = tile.pixels.map(|at| at as usize);
            let doubled = pixels[from..to].iter_mut().filter(|pixel| pixel.is_doubled());
            doubled.for_each(|pixel| pixel.doubled((tile.doubled_before.is_none(), 1.0 + evenness)));
        }
        let pixels = self.pixels.as_slice();
        if samples < self.goal.least {
            return false;
        }
        for tile in self.tiles.as_mut_slice().iter_mut().filter(|tile| !tile.is_enough) {
            let pixels = &pixels[tile.pixels[0] as usize..tile.pixels[1] as usize];
            let is_known = samples / BLACK >= self.goal.least || pixels.iter().any(|pixel| pixel.after.sum != 0.0);
            let evenness = if pixels.iter().all(PixelNoise::is_doubled) { evenness } else { 1.0 };
            // Where one pixel varies most, its halves may agree by chance; twice in a row they rarely do.
            let at_least = tile.doubled_before.map_or(0.0, |before| before / (1.0 + EVENNEST));
            let noise = [PixelNoise::error_squared, PixelNoise::told].map(|error_of| noise_of(pixels, error_of));
            tile.is_enough = is_known && noise[0].max(noise[1]).max(at_least) <= goal * goal * evenness;
        }
        self.tiles.as_slice().iter().all(|tile| tile.is_enough)
    }
}

#[cfg(all(test, feature = "alloc"))]
mod tests {
    use super::*;

    fn noise(goal: Goal, tiles: &[u32]) -> Noise<'static> {
        let mut noise = Noise::new(goal, List::default(), List::default());
        tiles.iter().for_each(|count| noise.add_tile(*count).unwrap());
        noise
    }

    /// Pixels with these means before and in a pass of as many samples.
    fn pass(noise: &mut Noise<'_>, tile: u32, pixels: &[(f64, f64)]) {
        noise.begin(tile, pixels.iter().map(|p| Part::of(&[4.0 * p.0; 3], 4)));
        noise.end(tile, pixels.iter().map(|p| Part::of(&[4.0 * (p.0 + p.1); 3], 8)));
    }

    #[test]
    fn a_tile_is_enough_from_the_noise_asked_for() {
        let of = |noise| {
            let mut all = self::noise(Goal { noise, least: 8 }, &[2]);
            // Means of the pixels 1 and 1, errors ½·0.4 and ½·0.2.
            pass(&mut all, 0, &[(0.8, 1.2), (0.9, 1.1)]);
            (all.judge(4), all.judge(8))
        };
        let noise = libm::sqrtf((0.04_f32 + 0.01) / 2.0 / 1.01);
        assert_eq!(of(noise * 1.0001), (false, true));
        assert_eq!(of(noise * 0.9999), (false, false));
    }

    /// Three dark pixels without noise and a bright one: by pixels alike the noise is a half of its own, by light nearly all of it.
    #[test]
    fn a_bright_pixel_is_not_lost_among_dark_ones() {
        let is_enough = |noise| {
            let mut all = self::noise(Goal { noise, least: 8 }, &[4]);
            pass(&mut all, 0, &[(1.0, 1.0), (1.0, 1.0), (1.0, 1.0), (9.0, 11.0)]);
            all.judge(8)
        };
        // The error is 1 of 10; the mean of all pixels 3.25.
        let floor = 0.01 * 3.25 * 3.25_f32;
        let (alike, by_light) = (libm::sqrtf(1.0 / (100.0 + floor) / 4.0), libm::sqrtf(1.0 / (103.0 + 4.0 * floor)));
        assert!(by_light > 1.9 * alike);
        assert!(is_enough(by_light * 1.0001) && !is_enough(by_light * 0.9999));
    }

    #[test]
    fn samples_that_are_even_are_less_noisy_than_their_halves_say() {
        // Halves that differ as if the variance fell by `ratio` from pass to pass, the last by 2·0.1.
        let of = |ratio: f64, noise: f32| {
            let mut all = self::noise(Goal { noise, least: 8 }, &[1]);
            for (count, error) in [(2, 0.1 * libm::sqrt(ratio)), (4, 0.1)] {
                let parts = [(1.0 - error) * f64::from(count), 2.0 * f64::from(count)];
                all.begin(0, core::iter::once(Part::of(&[parts[0]; 3], count)));
                all.end(0, core::iter::once(Part::of(&[parts[1]; 3], 2 * count)));
                let is_enough = all.judge(2 * count);
                if count == 4 {
                    return is_enough;
                }
            }
            false
        };
        // What 2, 3 and 4 say, and that less and more than these are not believed: of 9 only 4.
        for (ratio, divisor) in [(0.5, 1.0), (2.0, 1.0), (3.0, 2.0), (4.0, 3.0), (9.0, 3.0 * 4.0 / 9.0)] {
            let noise = libm::sqrtf(0.01_f32 / 1.01 / divisor);
            assert!(of(ratio, noise * 1.0001), "{ratio}");
            assert!(!of(ratio, noise * 0.9999), "{ratio}");
        }
    }

    /// Of two pixels one has little noise. The other varies much, but its halves agree at two doublings by chance.
    #[test]
    fn halves_that_agree_by_chance_do_not_hide_what_earlier_ones_told() {
        let is_enough = |noise| {
            let mut all = self::noise(Goal { noise, least: 8 }, &[2]);
            for (count, errors) in [(1, [0.4, 0.02]), (2, [0.0, 0.01]), (4, [0.0, 0.005])] {
                let samples = f64::from(count);
                all.begin(0, errors.into_iter().map(|error| Part::of(&[samples * (1.0 - error); 3], count)));
                all.end(0, errors.into_iter().map(|_| Part::of(&[samples * 2.0; 3], 2 * count)));
                all.judge(2 * count);
            }
            all.is_enough(0)
        };
        // The noise has fallen to less than a quarter, so samples count as the most even there are, and a third of it is left.
        let told = |last: f64, before: f64| 0.5 * (last * last + before / 4.0);
        let of = |errors: [f64; 3]| told(errors[2], told(errors[1], errors[0] * errors[0]));
        let square = (of([0.4, 0.0, 0.0]) + of([0.02, 0.01, 0.005])) / 2.0 / 1.01 / EVENNEST;
        let noise = libm::sqrt(square) as f32;
        assert!(is_enough(1.0001 * noise) && !is_enough(0.9999 * noise));
    }

    #[test]
    fn the_error_of_uneven_parts_is_that_of_their_whole() {
        // Independent samples: the mean square of the estimate is the variance of the mean, 1/12/n.
        let mut rng = crate::sampling::Generator::new(5);
        let mut draw = |n: u32| (0..n).map(|_| f64::from(crate::sampling::uniform(&mut rng))).sum::<f64>();
        let runs = 20_000;
        let mut total = 0.0;
        for _ in 0..runs {
            let before = Part { sum: draw(6), count: 6 };
            let after = Part { sum: before.sum + draw(3), count: 9 };
            total += PixelNoise { before, after, told: 0.0 }.error_squared();
        }
        let ratio = total / f64::from(runs) * 12.0 * 9.0;
        // Relative standard deviation of a square of a normal number: √2.
        assert!((ratio - 1.0).abs() < 4.0 * libm::sqrt(2.0 / f64::from(runs)), "{ratio}");
    }

    #[test]
    fn black_tiles_are_enough_in_the_end_and_first_passes_are_not() {
        let mut all = noise(Goal { noise: 0.01, least: 8 }, &[1, 1]);
        pass(&mut all, 0, &[(0.0, 0.0)]);
        all.begin(1, core::iter::once(Part::of(&[0.0; 3], 0)));
        all.end(1, core::iter::once(Part::of(&[1.0; 3], 8)));
        assert!(!all.judge(63) && !all.is_enough(0));
        assert!(!all.judge(64));
        assert!(all.is_enough(0) && !all.is_enough(1));
    }
}
