//! Errors of pictures.

use fogbow::spectrum::Spectrum;
use fogbow_std::film::Image;

use super::{Plan, rendered};
use crate::cli::Failure;
use crate::compare::smooth;
use crate::picture::Picture;

/// Two pictures without bias, independent of each other and of all others, that stand in for the truth: with `R5` their
/// mean over 5 × 5 pixels,
///
/// ```text
/// relMSE = mean((I − a)(I − b) / (R5² + 0.01 mean(R)²)),
/// ```
///
/// which holds none of the judges' own noise.
pub(super) struct Judges {
    pictures: [Image; 2],
    /// One over the denominators.
    weights: Vec<[f64; 3]>,
    /// The half of the pixels around which light varies least.
    pub(super) is_smooth: Vec<bool>,
}

impl Judges {
    pub(super) fn new(pictures: [Image; 2]) -> Self {
        let mean = mean(&pictures);
        let (width, height) = (mean.width as usize, mean.height as usize);
        let pixels: Vec<[f32; 3]> = mean.pixels.iter().map(|p| [p[0], p[1], p[2]]).collect();
        let all: f64 = pixels.iter().flatten().map(|c| f64::from(*c)).sum();
        let floor = 0.01 * (all / (3 * pixels.len().max(1)) as f64).powi(2);
        let smoothed = smooth(&Picture { width, height, pixels });
        let weights = smoothed.iter().map(|p| p.map(|c| 1.0 / (c * c + floor).max(f64::MIN_POSITIVE))).collect();
        // How fast the smoothed picture varies, for its brightness.
        let grey: Vec<f64> = smoothed.iter().map(|p| p.iter().sum::<f64>() / 3.0).collect();
        let at = |x: usize, y: usize| grey[y.min(height - 1) * width + x.min(width - 1)];
        let slope = |i: usize| {
            let (x, y) = (i % width, i / width);
            let (dx, dy) = (at(x + 1, y) - at(x.saturating_sub(1), y), at(x, y + 1) - at(x, y.saturating_sub(1)));
            dx.hypot(dy) / (grey[i] + floor.sqrt())
        };
        let slopes: Vec<f64> = (0..grey.len()).map(slope).collect();
        let mut sorted = slopes.clone();
        sorted.sort_by(f64::total_cmp);
        let middle = sorted.get(sorted.len() / 2).copied().unwrap_or_default();
        Self { pictures, weights, is_smooth: slopes.iter().map(|s| *s <= middle).collect() }
    }

    /// Two renders with random numbers of their own.
    pub(super) fn rendered(
        plan: &Plan,
        scene: &str,
        size: [u32; 2],
        options: &[&str],
        of: fn(&rendered::Shot) -> Image,
    ) -> Result<Self, Failure> {
        let one = |seed: &str| {
            let options: Vec<&str> = options.iter().copied().chain(["--seed", seed]).collect();
            Ok::<_, Failure>(of(&rendered::shot(plan, &rendered::scene_of(plan, scene), size, &options)?))
        };
        Ok(Self::new([one("101")?, one("102")?]))
    }

    /// The mean of both: the best picture there is.
    pub(super) fn mean(&self) -> Image {
        mean(&self.pictures)
    }

    /// Mean squared relative error, over all pixels.
    pub(super) fn rel_mse(&self, image: &Image) -> f64 {
        self.over(image, |_| true)
    }

    /// The same in the half where light is smooth.
    pub(super) fn rel_mse_smooth(&self, image: &Image) -> f64 {
        self.over(image, |i| self.is_smooth[i])
    }

    /// The sum of all light over the truth's, minus one.
    pub(super) fn bias(&self, image: &Image) -> f64 {
        let sum = |image: &Image| image.pixels.iter().map(|p| f64::from(p.mean())).sum::<f64>();
        sum(image) / sum(&self.mean()).max(f64::MIN_POSITIVE) - 1.0
    }

    fn over(&self, image: &Image, is_counted: impl Fn(usize) -> bool) -> f64 {
        self.product([image, image], is_counted).max(0.0)
    }

    /// What two pictures of the same kind, with random numbers of their own, are both off by, squared: without
    /// their noise. Below 0 by chance.
    pub(super) fn common(&self, pictures: [&Image; 2]) -> f64 {
        self.product(pictures, |_| true)
    }

    /// Mean of `(p − a)(q − b)` over the pixels that count, relative.
    fn product(&self, [p, q]: [&Image; 2], is_counted: impl Fn(usize) -> bool) -> f64 {
        let [a, b] = &self.pictures;
        let (mut sum, mut count) = (0.0, 0);
        for i in (0..p.pixels.len()).filter(|i| is_counted(*i)) {
            for c in 0..3 {
                let [p, q, a, b] = [p, q, a, b].map(|of| f64::from(of.pixels[i][c]));
                sum += (p - a) * (q - b) * self.weights[i][c];
                count += 1;
            }
        }
        sum / f64::from(count.max(1))
    }
}

fn mean([a, b]: &[Image; 2]) -> Image {
    let pixels = a.pixels.iter().zip(&b.pixels).map(|(a, b): (&Spectrum, &Spectrum)| (*a + *b) * 0.5).collect();
    Image { width: a.width, height: a.height, pixels }
}
