//! Adaptive sampling of images: where light is smooth few pixels are computed, and the others filled in from them.
//!
//! Belcour et al. 2014, § 6.3: Gaussians of the shape that the image's covariance gives spread computed pixels, whose density
//! is the inverse of the Gaussians' area: `√det P`, as in B, where no border of depth cuts them. Pixel `i` is the mean of computed pixels `j`,
//!
//! ```text
//! Lᵢ = Σⱼ wᵢⱼ Lⱼ / Σⱼ wᵢⱼ,    wᵢⱼ = √(gᵢ(j) gⱼ(i)) / ρⱼ
//! ```
//!
//! with `g` the Gaussian of a pixel and `ρ` the density of computed pixels. Three things keep means of a picture what they are:
//! without `1/ρⱼ`, crowds of pixels around bright shafts outvote the dark pixels beside them; with `gᵢ` alone, wide filters
//! in the dark take light from narrow ones that give none back; and `ρ` follows the filters as they are used, bounded by
//! their neighbours' and by depth, for a narrow filter over few computed pixels finds one side of a border only.

use fogbow::covariance::filter_precision;
use fogbow::math::{Symmetric2, float};
use fogbow::spectrum::Spectrum;
use rayon::prelude::*;

use crate::film::Image;

/// By how much filters are narrower than the light itself varies. 1, as in B, blurs light by as much as it
/// varies; much more leaves noise. In the lantern at 16 samples per pixel, less than this evens out a few hundredths more
/// of the noise, and blurs the rims of its holes.
const SHARPER: f32 = 4.0;

/// Standard deviation (pixels) of the widest filter: where light does not vary at all.
const WIDEST: f32 = 4.0;

/// How much wider (pixels of standard deviation) a filter may be from pixel to pixel: as filters end at four deviations, one
/// of these stops short of the pixel that bounds it.
const WIDENING: f32 = 0.25;

/// Pixels a filter reaches on either side.
const REACH: i64 = 12;

/// Relative difference of depth, beyond what the slopes of surfaces explain, from which pixels see different things.
const SAME_DEPTH: f32 = 0.02;

/// Least share of pixels that a plan computes. With fewer, some filters would find no computed pixel in reach.
pub const LEAST_PLAN: f32 = 0.05;

/// Least share of computed pixels, where light does not vary.
const LEAST_SHARE: f32 = 1.0 / 12.0;

/// What is known of a pixel beforehand.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Outlook {
    /// Covariance of the image (cycles² per pixel²); `None` where nothing is known.
    pub covariance: Option<Symmetric2>,
    /// Distance (m) to the surface behind the medium; infinite where there is none.
    pub depth: f32,
}

/// Which pixels are computed, and how the others are filled in.
#[derive(Debug, Clone)]
pub struct Plan {
    filters: Filters,
    /// Pixel by pixel, row by row, whether it is computed.
    pub computed: Vec<bool>,
    /// The share of neighbours that should be computed.
    pub density: Vec<f32>,
}

impl Plan {
    /// Computes at most `share` of all pixels (from [`LEAST_PLAN`] on), densest where the image
    /// varies.
    ///
    /// ```
    /// use fogbow::math::Symmetric2;
    /// use fogbow_std::image_sampling::{Outlook, Plan};
    /// let smooth = Outlook { covariance: Some(Symmetric2::diagonal(1e-4, 1e-4)), depth: 1.0 };
    /// let sharp = Outlook { covariance: Some(Symmetric2::diagonal(0.1, 0.1)), depth: 1.0 };
    /// let plan = Plan::new(32, 32, 0.4, (0..1024).map(|i| if i % 32 < 16 { smooth } else { sharp }).collect());
    /// let count = |left: bool| (0..1024).filter(|i| plan.computed[*i] && (i % 32 < 16) == left).count();
    /// assert!(count(true) + count(false) <= 410 && count(false) > 2 * count(true));
    /// ```
    ///
    /// # Panics
    /// If there is not one outlook per pixel.
    #[must_use]
    pub fn new(width: u32, height: u32, share: f32, outlooks: Vec<Outlook>) -> Self {
        assert_eq!(outlooks.len(), width as usize * height as usize, "one outlook per pixel");
        let share = share.clamp(LEAST_PLAN, 1.0);
        let filters = Filters::new(width, height, outlooks);
        // As many computed pixels under every filter.
        let wanted: Vec<f32> = (0..filters.outlooks.len()).into_par_iter().map(|i| 1.0 / filters.area(i)).collect();
        // The factor at which the mean of the clamped densities is the share: by halving.
        let least = LEAST_SHARE.min(share);
        let density_at = |factor: f32| wanted.iter().map(move |d| (d * factor).clamp(least, 1.0));
        let count = wanted.len().max(1) as f32;
        let (mut low, mut high) = (0.0_f32, 1e9_f32);
        for _ in 0..96 {
            let middle = 0.5 * (low + high);
            if density_at(middle).sum::<f32>() / count > share { high = middle } else { low = middle }
        }
        let density: Vec<f32> = density_at(low).collect();
        let computed = dithered(width as usize, height as usize, &density, share);
        Self { filters, computed, density }
    }

    /// The share of computed pixels.
    #[must_use]
    pub fn share(&self) -> f32 {
        self.computed.iter().filter(|&&c| c).count() as f32 / self.computed.len().max(1) as f32
    }

    /// Covariance (cycles² per pixel²) whose Gaussian fills in a pixel.
    #[must_use]
    pub fn shape(&self, index: usize) -> Symmetric2 {
        self.filters.shapes[index]
    }

    /// The image that the computed pixels of `image` give; the others' values are not read.
    #[must_use]
    pub fn filled(&self, image: &Image) -> Image {
        let pixels = (0..self.computed.len())
            .into_par_iter()
            .map(|index| {
                let (mut sum, mut total) = (Spectrum::ZERO, 0.0_f32);
                // Where no filter reaches: whether it sees another surface, its distance, its colour.
                let mut nearest: Option<((bool, i64), Spectrum)> = None;
                for (other, at) in self.filters.around(index).filter(|&(other, _)| self.computed[other]) {
                    let colour = image.pixels[other];
                    let weight = self.filters.weight(index, other, at);
                    if let Some(weight) = weight.filter(|&w| w > 0.0) {
                        let weight = weight / self.density[other];
                        sum += colour * weight;
                        total += weight;
                    }
                    let key = (weight.is_none(), at[0] * at[0] + at[1] * at[1]);
                    if nearest.is_none_or(|(best, _)| key < best) {
                        nearest = Some((key, colour));
                    }
                }
                if total > 0.0 { sum / total } else { nearest.map_or(Spectrum::ZERO, |(_, colour)| colour) }
            })
            .collect();
        Image { width: self.filters.width, height: self.filters.height, pixels }
    }
}

/// What fills in the pixels of a picture, computed or not.
#[derive(Debug, Clone)]
struct Filters {
    width: u32,
    height: u32,
    outlooks: Vec<Outlook>,
    /// Covariance of each pixel's Gaussian.
    shapes: Vec<Symmetric2>,
    /// How depth changes (m) from a pixel to the next in the row, and to the one below.
    slopes: Vec<[f32; 2]>,
}

impl Filters {
    fn new(width: u32, height: u32, outlooks: Vec<Outlook>) -> Self {
        let shapes = shapes(width as usize, height as usize, &outlooks);
        let slopes = slopes(width as usize, height as usize, &outlooks);
        Self { width, height, outlooks, shapes, slopes }
    }

    /// Pixels in reach of one, itself included, and how far to the right and down they are.
    fn around(&self, index: usize) -> impl Iterator<Item = (usize, [i64; 2])> {
        let (width, height) = (i64::from(self.width), i64::from(self.height));
        let (x, y) = (index as i64 % width, index as i64 / width);
        let rows = (y - REACH).max(0)..=(y + REACH).min(height - 1);
        rows.flat_map(move |up| {
            let columns = (x - REACH).max(0)..=(x + REACH).min(width - 1);
            columns.map(move |at| ((up * width + at) as usize, [at - x, up - y]))
        })
    }

    /// By how much two pixels fill each other in, the second `at` from the first; `None` where they see different things.
    fn weight(&self, a: usize, b: usize, at: [i64; 2]) -> Option<f32> {
        let [dx, dy] = at.map(|n| n as f32);
        let (near, far) = (self.outlooks[a].depth, self.outlooks[b].depth);
        let [rise, other] = [a, b].map(|i| (self.slopes[i][0] * dx + self.slopes[i][1] * dy).abs());
        let is_same = near == far || (near - far).abs() < SAME_DEPTH * near.min(far) + rise.max(other);
        // Of the geometric mean of both Gaussians.
        let exponent = 0.25 * filter_precision(&self.shapes[a].plus(&self.shapes[b])).along(dx, dy);
        is_same.then(|| if exponent < 8.0 { float::exp(-exponent) } else { 0.0 })
    }

    /// Pixels under a pixel's filter, those counted in part that it weighs less than itself.
    fn area(&self, index: usize) -> f32 {
        self.around(index).filter_map(|(other, at)| self.weight(index, other, at)).sum::<f32>().max(1.0)
    }
}

/// With a least variation in every direction, so that filters end.
fn floored(p: &Symmetric2) -> Symmetric2 {
    let least = 1.0 / (2.0 * core::f32::consts::PI * WIDEST);
    let least = least * least / SHARPER;
    p.plus(&Symmetric2::diagonal(least, least))
}

/// Covariances whose Gaussians fill in pixels, no wider than those of pixels around let them be: a filter in darkness
/// must not reach into the light beside it.
fn shapes(width: usize, height: usize, outlooks: &[Outlook]) -> Vec<Symmetric2> {
    let mut shapes: Vec<Symmetric2> =
        outlooks.iter().map(|o| floored(&o.covariance.unwrap_or_default()).times(SHARPER)).collect();
    // The longer standard deviation (pixels) of each, bounded by its neighbours' in two sweeps.
    let longer = |p: &Symmetric2| 1.0 / (2.0 * core::f32::consts::PI * p.eigen().values[1].max(1e-12).sqrt());
    let own: Vec<f32> = shapes.iter().map(longer).collect();
    let mut bound = own.clone();
    let mut relax = |x: usize, y: usize, sign: i64| {
        let mut best = bound[y * width + x];
        for (dx, dy, distance) in [(-1, 0, 1.0), (0, -1, 1.0), (-1, -1, 1.414), (1, -1, 1.414_f32)] {
            let (at, up) = (x as i64 + sign * dx, y as i64 + sign * dy);
            if at >= 0 && up >= 0 && at < width as i64 && up < height as i64 {
                best = best.min(bound[up as usize * width + at as usize] + WIDENING * distance);
            }
        }
        bound[y * width + x] = best;
    };
    for y in 0..height {
        for x in 0..width {
            relax(x, y, 1);
        }
    }
    for y in (0..height).rev() {
        for x in (0..width).rev() {
            relax(x, y, -1);
        }
    }
    for ((shape, own), bound) in shapes.iter_mut().zip(own).zip(bound) {
        if bound < own {
            let variance = |s: f32| 1.0 / (2.0 * core::f32::consts::PI * s).powi(2);
            let more = variance(bound) - variance(own);
            *shape = shape.plus(&Symmetric2::diagonal(more, more));
        }
    }
    shapes
}

/// By how much depth changes from a pixel to the next along rows and columns, as far as it does so on both sides: at a
/// border where depth jumps, not at all.
fn slopes(width: usize, height: usize, outlooks: &[Outlook]) -> Vec<[f32; 2]> {
    let along = |index: usize, step: usize, place: usize, count: usize| {
        if place == 0 || place + 1 >= count {
            return 0.0;
        }
        let depth = |i: usize| outlooks[i].depth;
        let (before, after) = (depth(index) - depth(index - step), depth(index + step) - depth(index));
        let least = before.abs().min(after.abs());
        if before * after > 0.0 && least.is_finite() { least.copysign(after) } else { 0.0 }
    };
    (0..outlooks.len()).map(|i| [along(i, 1, i % width, width), along(i, width, i / width, height)]).collect()
}

/// Error diffusion (Floyd and Steinberg 1976) in snake lines: chosen pixels keep their distance from each other.
fn dithered(width: usize, height: usize, density: &[f32], share: f32) -> Vec<bool> {
    let mut chosen = vec![false; density.len()];
    let mut left = (share * density.len() as f32) as usize;
    let (mut line, mut next) = (vec![0.0_f32; width + 2], vec![0.0_f32; width + 2]);
    for y in 0..height {
        let forward = y % 2 == 0;
        for i in 0..width {
            let x = if forward { i } else { width - 1 - i };
            let want = density[y * width + x] + line[x + 1];
            let take = want > 0.5 && left > 0;
            chosen[y * width + x] = take;
            left -= usize::from(take);
            let error = want - f32::from(u8::from(take));
            let (ahead, behind) = if forward { (x + 2, x) } else { (x, x + 2) };
            line[ahead] += error * (7.0 / 16.0);
            next[behind] += error * (3.0 / 16.0);
            next[x + 1] += error * (5.0 / 16.0);
            next[ahead] += error * (1.0 / 16.0);
        }
        core::mem::swap(&mut line, &mut next);
        next.fill(0.0);
    }
    chosen
}

#[cfg(test)]
mod tests {
    use fogbow::sampling::{Generator, uniform};

    use super::*;

    fn plan(share: f32, outlook: impl Fn(u32, u32) -> Outlook) -> Plan {
        Plan::new(40, 40, share, (0..1600).map(|i| outlook(i % 40, i / 40)).collect())
    }

    #[test]
    fn even_light_is_filled_in_exactly_and_unread_pixels_do_not_count() {
        for share in [0.0, 0.05, 0.4, 1.0] {
            let even = Symmetric2::diagonal(1e-4, 1e-4);
            let plan = plan(share, |_, _| Outlook { covariance: Some(even), depth: f32::INFINITY });
            assert!(plan.share() <= share.max(LEAST_PLAN) && plan.share() > 0.5 * share, "{}", plan.share());
            let mut image = Image::new(40, 40, Spectrum::splat(3.0)).unwrap();
            for (pixel, computed) in image.pixels.iter_mut().zip(&plan.computed) {
                if !computed {
                    *pixel = Spectrum::splat(f32::NAN);
                }
            }
            assert!(plan.filled(&image).pixels.iter().all(|p| (p[0] - 3.0).abs() < 1e-5), "share {share}");
        }
    }

    #[test]
    fn light_does_not_leak_over_a_border_of_depth() {
        let near = |x: u32| if x < 20 { 1.0 } else { 2.0 };
        let plan = plan(0.3, |x, _| Outlook { covariance: Some(Symmetric2::ZERO), depth: near(x) });
        let mut image = Image::new(40, 40, Spectrum::ZERO).unwrap();
        for (i, pixel) in image.pixels.iter_mut().enumerate() {
            *pixel = Spectrum::splat(near(i as u32 % 40));
        }
        let filled = plan.filled(&image);
        assert!(filled.pixels.iter().zip(&image.pixels).all(|(a, b)| (a[0] - b[0]).abs() < 1e-5));
    }

    /// A shaft of light, three pixels of standard deviation across, in a dim fog; and its covariance, by the Hessian.
    fn shaft(x: f32, y: f32) -> (f32, Symmetric2) {
        let across = (x - 32.0 - 0.3 * (y - 32.0)) / 1.3_f32.hypot(0.3);
        let bell = (-0.5 * (across / 3.0).powi(2)).exp();
        let light = 0.02 + bell;
        let curvature = bell * ((across / 3.0).powi(2) - 1.0).abs() / 9.0 / light;
        let (u, v) = (0.958, -0.287);
        let p = curvature / (4.0 * core::f32::consts::PI.powi(2));
        (light, Symmetric2::new(p * u * u, p * u * v, p * v * v))
    }

    #[test]
    fn filling_in_makes_a_picture_neither_brighter_nor_darker() {
        let at = |i: u32| shaft((i % 64) as f32, (i / 64) as f32);
        let outlook = |i| Outlook { covariance: Some(at(i).1), depth: 1.0 };
        let plan = Plan::new(64, 64, 0.4, (0..4096).map(outlook).collect());
        let converged: f32 = (0..4096).map(|i| at(i).0).sum();
        let biases: Vec<f32> = (0..12_u64)
            .map(|seed| {
                let mut rng = Generator::new(seed);
                let mut image = Image::new(64, 64, Spectrum::ZERO).unwrap();
                for (i, pixel) in image.pixels.iter_mut().enumerate() {
                    *pixel = Spectrum::splat(at(i as u32).0 * (0.5 + uniform(&mut rng)));
                }
                plan.filled(&image).pixels.iter().map(|p| p[0]).sum::<f32>() / converged - 1.0
            })
            .collect();
        let mean = biases.iter().sum::<f32>() / 12.0;
        let error = (biases.iter().map(|b| (b - mean).powi(2)).sum::<f32>() / (11.0 * 12.0)).sqrt();
        assert!(error < 0.01, "too noisy to tell: {error}");
        // What a filter four times as sharp as the light takes from the crest it gives to the feet.
        assert!(mean.abs() < 3.5 * error + 0.005, "bias {mean} ± {error}");
    }

    #[test]
    fn walls_at_a_grazing_angle_even_out_noise_like_those_seen_from_the_front() {
        let spread = |depth: fn(f32) -> f32| {
            let even = Symmetric2::diagonal(1e-4, 1e-4);
            let plan = plan(0.4, |x, _| Outlook { covariance: Some(even), depth: depth(x as f32) });
            // Few filters fit into a picture, hence many.
            let of_seed = |seed: u64| {
                let mut rng = Generator::new(seed);
                let mut image = Image::new(40, 40, Spectrum::ZERO).unwrap();
                image.pixels.iter_mut().for_each(|p| *p = Spectrum::splat(uniform(&mut rng)));
                let filled = plan.filled(&image);
                filled.pixels.iter().map(|p| (p[0] - 0.5).powi(2)).sum::<f32>()
            };
            (0..64).map(of_seed).sum::<f32>()
        };
        let front = spread(|_| 5.0);
        // A wall whose depth falls by up to 4 % from pixel to pixel, alone and beside one seen from the front.
        for wall in [|x: f32| 100.0 / (20.0 + x), |x: f32| 5.0_f32.min(100.0 / x)] {
            let grazing = spread(wall);
            assert!(grazing < 1.1 * front, "{grazing} instead of {front}");
        }
    }

    #[test]
    fn a_wire_before_a_wall_stays_as_it_is() {
        let depth = |x: u32| if x == 20 { 1.0 } else { 2.0 };
        let plan = plan(0.6, |x, _| Outlook { covariance: Some(Symmetric2::ZERO), depth: depth(x) });
        let mut image = Image::new(40, 40, Spectrum::ZERO).unwrap();
        for (i, pixel) in image.pixels.iter_mut().enumerate() {
            *pixel = Spectrum::splat(depth(i as u32 % 40));
        }
        let filled = plan.filled(&image);
        assert!(filled.pixels.iter().zip(&image.pixels).all(|(a, b)| (a[0] - b[0]).abs() < 1e-5));
    }

    #[test]
    fn what_is_no_number_beforehand_gives_numbers() {
        let bad = Symmetric2::new(f32::NAN, f32::INFINITY, -1.0);
        let plan = plan(0.4, |x, _| Outlook { covariance: (x > 10).then_some(bad), depth: f32::NAN });
        let image = Image::new(40, 40, Spectrum::ONE).unwrap();
        assert!(plan.filled(&image).pixels.iter().all(|p| p.is_valid()));
    }
}
