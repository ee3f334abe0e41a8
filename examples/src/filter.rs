//! Reconstruction filters: how much of what is seen near a pixel counts for it.
//!
//! Filters are sampled (Ernst et al. 2006, *Filter importance sampling*): a sample of a pixel looks through a point drawn in
//! proportion to the absolute value of the filter around the pixel's centre, and counts with its sign times a constant. So a film
//! keeps nothing but sums of the samples of each pixel; films of one scene can be added, and no pixel depends on the samples of
//! another. Decision 59.

use core::f64::consts::PI;

use fogbow::math::Vec2;

/// A separable filter around the centre of a pixel; lengths in pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Filter {
    /// 1 within the radius. With ½, every sample counts for the pixel it falls in.
    Box {
        /// Half its width.
        radius: f64,
    },
    /// Falls linearly.
    Tent {
        /// Where it ends.
        radius: f64,
    },
    /// A Gaussian, lowered so that it ends at four standard deviations.
    Gaussian {
        /// Standard deviation.
        deviation: f64,
    },
    /// The cubic of Mitchell and Netravali 1988, which ends at 2 and is negative from about 1.
    Mitchell {
        /// Their B.
        b: f64,
        /// Their C.
        c: f64,
    },
    /// A sinc windowed by another: the ideal low-pass filter as far as its radius lets it.
    Lanczos {
        /// Where it ends.
        radius: f64,
    },
}

impl Filter {
    /// Every sample counts for its own pixel alone.
    pub const PIXEL: Self = Self::Box { radius: 0.5 };
    /// What Mitsuba 3 takes where a film names none.
    pub const USUAL: Self = Self::Gaussian { deviation: 0.5 };
    /// The cubic that goes through samples (Catmull and Rom 1974).
    pub const CATMULL_ROM: Self = Self::Mitchell { b: 0.0, c: 0.5 };

    /// Where it ends.
    #[must_use]
    pub fn radius(&self) -> f64 {
        match *self {
            Self::Box { radius } | Self::Tent { radius } | Self::Lanczos { radius } => radius,
            Self::Gaussian { deviation } => 4.0 * deviation,
            Self::Mitchell { .. } => 2.0,
        }
    }

    /// Its value along one axis, not normalised.
    ///
    /// ```
    /// # use fogbow_examples::filter::Filter;
    /// assert_eq!(Filter::Tent { radius: 1.0 }.value(0.25), 0.75);
    /// assert!(Filter::CATMULL_ROM.value(1.5) < 0.0);
    /// ```
    #[must_use]
    pub fn value(&self, x: f64) -> f64 {
        let x = x.abs();
        if x >= self.radius() {
            return 0.0;
        }
        match *self {
            Self::Box { .. } => 1.0,
            Self::Tent { radius } => 1.0 - x / radius,
            Self::Gaussian { deviation } => {
                let bell = |x: f64| (-0.5 * (x / deviation).powi(2)).exp();
                bell(x) - bell(4.0 * deviation)
            }
            Self::Mitchell { b, c } => {
                let cubic = |k: [f64; 4]| (k[0] + x * (k[1] + x * (k[2] + x * k[3]))) / 6.0;
                if x < 1.0 {
                    cubic([6.0 - 2.0 * b, 0.0, -18.0 + 12.0 * b + 6.0 * c, 12.0 - 9.0 * b - 6.0 * c])
                } else {
                    cubic([8.0 * b + 24.0 * c, -12.0 * b - 48.0 * c, 6.0 * b + 30.0 * c, -b - 6.0 * c])
                }
            }
            Self::Lanczos { radius } => {
                let sinc = |x: f64| if x < 1e-6 { 1.0 } else { (PI * x).sin() / (PI * x) };
                sinc(x) * sinc(x / radius)
            }
        }
    }
}

/// Steps of a table per pixel: so fine that a step is a hundredth of what a picture of 8 bits shows of the sharpest edge.
const STEPS: usize = 1024;

/// A filter, ready to be sampled.
#[derive(Debug, Clone)]
pub struct FilterTable {
    /// Half the number of steps.
    half: usize,
    /// Per step: ∫|f| and ∫f of all steps before it; one more at the end.
    sums: Vec<[f64; 2]>,
    is_box: bool,
}

impl FilterTable {
    /// The table of a filter.
    #[must_use]
    pub fn new(filter: Filter) -> Self {
        if filter == Filter::PIXEL {
            return Self { half: 0, sums: Vec::new(), is_box: true };
        }
        let half = ((filter.radius() * STEPS as f64).ceil() as usize).max(1);
        let mut sums = vec![[0.0; 2]];
        let mut sum = [0.0; 2];
        for step in 0..2 * half {
            let value = filter.value((step as f64 + 0.5 - half as f64) / STEPS as f64);
            sum = [sum[0] + value.abs(), sum[1] + value];
            sums.push(sum);
        }
        Self { half, sums, is_box: false }
    }

    /// A point of the film (pixels) for a sample of pixel `(x, y)` of a film of some size, from two uniform numbers, and how much what is
    /// seen there counts. Points beyond the border are not drawn: there the filter is cut off and made up for, as in Mitsuba.
    #[must_use]
    pub fn sample(&self, pixel: [u32; 2], size: [u32; 2], random: Vec2) -> (Vec2, f32) {
        let corner = Vec2::new(pixel[0] as f32, pixel[1] as f32);
        if self.is_box {
            return (corner + random, 1.0);
        }
        let (x, of_x) = self.along(pixel[0], size[0], random.x);
        let (y, of_y) = self.along(pixel[1], size[1], random.y);
        (Vec2::new(x, y), of_x * of_y)
    }

    /// Its radius (pixels).
    #[must_use]
    pub fn radius(&self) -> f32 {
        if self.is_box { 0.5 } else { self.half as f32 / STEPS as f32 }
    }

    /// For which random numbers [`FilterTable::sample`] finds a point of the film (pixels); `None` if it never does.
    #[must_use]
    pub fn within(&self, pixel: [u32; 2], size: [u32; 2], at: Vec2) -> Option<Vec2> {
        let along = |pixel: u32, size: u32, at: f32| {
            if self.is_box {
                return at - pixel as f32;
            }
            let (first, last) = self.cut(pixel, size);
            let steps = (f64::from(at) - f64::from(pixel) - 0.5) * STEPS as f64 + self.half as f64;
            // Casts saturate, and take NaN to 0.
            let step = (steps as usize).clamp(first, last - 1);
            let (low, high) = (self.sums[first][0], self.sums[last][0]);
            let (before, after) = (self.sums[step][0], self.sums[step + 1][0]);
            let sum = before + (steps - step as f64) * (after - before);
            ((sum - low) / (high - low)) as f32
        };
        let found = Vec2::new(along(pixel[0], size[0], at.x), along(pixel[1], size[1], at.y));
        (found.cmpge(Vec2::ZERO).all() && found.cmplt(Vec2::ONE).all()).then_some(found)
    }

    /// The first step of a pixel's filter that lies on the film, and the first beyond.
    fn cut(&self, pixel: u32, size: u32) -> (usize, usize) {
        // Steps from the centre of the pixel to both borders of the film.
        let to_low = pixel as usize * STEPS + STEPS / 2;
        let to_high = (size - pixel) as usize * STEPS - STEPS / 2;
        (self.half - to_low.min(self.half), self.half + to_high.min(self.half))
    }

    fn along(&self, pixel: u32, size: u32, random: f32) -> (f32, f32) {
        let (first, last) = self.cut(pixel, size);
        let (low, high) = (self.sums[first], self.sums[last]);
        let wanted = low[0] + f64::from(random) * (high[0] - low[0]);
        // The step whose share of the sum holds the number: never one without a share.
        let within = &self.sums[first..last];
        let step = (first + within.partition_point(|sum| sum[0] <= wanted)).saturating_sub(1).max(first);
        let (before, after) = (self.sums[step], self.sums[step + 1]);
        let share = ((wanted - before[0]) / (after[0] - before[0])).clamp(0.0, 1.0);
        let offset = (step as f64 + share - self.half as f64) / STEPS as f64;
        let sign = if after[1] < before[1] { -1.0 } else { 1.0 };
        let weight = sign * (high[0] - low[0]) / (high[1] - low[1]);
        // Rounding must not carry a point beyond the border.
        let at = (f64::from(pixel) + 0.5 + offset).clamp(0.0, f64::from(size)) as f32;
        (at, weight as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Filter; 6] = [
        Filter::Box { radius: 1.25 },
        Filter::Tent { radius: 1.0 },
        Filter::USUAL,
        Filter::Mitchell { b: 1.0 / 3.0, c: 1.0 / 3.0 },
        Filter::CATMULL_ROM,
        Filter::Lanczos { radius: 3.0 },
    ];

    /// Mitsuba 3.9.1: `rfilter.eval` of `scalar_rgb` at 0, ¼ … 2¾.
    #[test]
    fn values_are_those_of_mitsuba() {
        let due: [(Filter, [f64; 12]); 5] = [
            (Filter::Tent { radius: 1.0 }, [1.0, 0.75, 0.5, 0.25, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
            (
                Filter::USUAL,
                [
                    0.999_247, 0.882_167, 0.606_423, 0.324_243, 0.134_96, 0.043_603, 0.010_758, 0.001_843, 0.0, 0.0,
                    0.0, 0.0,
                ],
            ),
            (
                Filter::Mitchell { b: 1.0 / 3.0, c: 1.0 / 3.0 },
                [
                    0.888_889, 0.782_118, 0.534_722, 0.256_076, 0.055_556, -0.023_437, -0.034_722, -0.014_757, 0.0,
                    0.0, 0.0, 0.0,
                ],
            ),
            (
                Filter::CATMULL_ROM,
                [1.0, 0.867_188, 0.5625, 0.226_562, 0.0, -0.070_312, -0.0625, -0.023_438, 0.0, 0.0, 0.0, 0.0],
            ),
            (
                Filter::Lanczos { radius: 3.0 },
                [
                    1.0, 0.890_067, 0.607_927, 0.270_19, 0.0, -0.132_871, -0.135_095, -0.067_791, 0.0, 0.030_021,
                    0.024_317, 0.007_356,
                ],
            ),
        ];
        for (filter, values) in due {
            for (index, due) in values.iter().enumerate() {
                let value = filter.value(0.25 * index as f64);
                // Its Gaussian is a polynomial in single precision, off by up to 0.0006.
                let tolerance = if filter == Filter::USUAL { 1e-3 } else { 2e-6 };
                assert!((value - due).abs() < tolerance, "{filter:?} {index}: {value} and not {due}");
            }
        }
    }

    /// Means over the pixel's samples are integrals with the normalised filter: of 1, x and x², inside and at both borders.
    #[test]
    fn samples_follow_the_filter_and_stay_on_the_film() {
        let size = 4;
        for filter in ALL {
            let table = FilterTable::new(filter);
            for pixel in 0..size {
                let integral = |weight: &dyn Fn(f64) -> f64| -> f64 {
                    let steps = 40_000;
                    let x = |i: usize| (i as f64 + 0.5) / steps as f64 * f64::from(size);
                    (0..steps).map(|i| filter.value(x(i) - f64::from(pixel) - 0.5) * weight(x(i))).sum()
                };
                let whole = integral(&|_| 1.0);
                let count = 100_000;
                let mut means = [0.0; 3];
                for i in 0..count {
                    let (at, weight) = table.along(pixel, size, (i as f32 + 0.5) / count as f32);
                    assert!((0.0..=size as f32).contains(&at), "{filter:?}");
                    let (x, weight) = (f64::from(at), f64::from(weight) / f64::from(count));
                    means = [means[0] + weight, means[1] + weight * x, means[2] + weight * x * x];
                }
                let due = [1.0, integral(&|x| x) / whole, integral(&|x| x * x) / whole];
                for (mean, due) in means.iter().zip(due) {
                    assert!((mean - due).abs() < 2e-3, "{filter:?} at {pixel}: {means:?} and not {due:?}");
                }
            }
        }
    }

    #[test]
    fn points_of_the_film_are_found_again() {
        let size = [7, 5];
        for filter in ALL.into_iter().chain([Filter::PIXEL]) {
            let table = FilterTable::new(filter);
            for pixel in [[0, 0], [3, 2], [6, 4]] {
                for random in [Vec2::new(0.1, 0.9), Vec2::splat(0.5), Vec2::new(0.999, 0.3)] {
                    let found = table.within(pixel, size, table.sample(pixel, size, random).0).unwrap();
                    assert!((found - random).abs().max_element() < 1e-3, "{filter:?} {pixel:?}: {random} {found}");
                }
                let beyond = Vec2::splat(2.0 * table.radius() + 9.0);
                assert_eq!(table.within(pixel, size, beyond), None);
                assert_eq!(table.within(pixel, size, Vec2::splat(f32::NAN)), None);
            }
        }
    }

    /// Black left of 8.3 on a film 16 pixels wide, white right of it: pixels 5 to 10 as Mitsuba 3.9.1 renders them
    /// (`llvm_ad_rgb`, 2 million samples a column; standard error 0.0002).
    #[test]
    fn an_edge_looks_as_in_mitsuba() {
        let due: [(Filter, [f64; 6]); 6] = [
            (Filter::PIXEL, [0.0, 0.0, 0.0, 0.700_11, 1.0, 1.0]),
            (Filter::Tent { radius: 1.0 }, [0.0, 0.0, 0.019_91, 0.679_96, 1.0, 1.0]),
            (Filter::USUAL, [0.0, 0.000_07, 0.0544, 0.655_53, 0.992_07, 1.0]),
            (Filter::Mitchell { b: 1.0 / 3.0, c: 1.0 / 3.0 }, [0.0, -0.000_73, 0.010_62, 0.6729, 1.017_08, 1.0]),
            (Filter::CATMULL_ROM, [0.0, -0.001_13, -0.027_08, 0.693_91, 1.034_13, 1.0]),
            (Filter::Lanczos { radius: 3.0 }, [0.000_31, 0.011_67, -0.0538, 0.695_74, 1.059_61, 0.986_67]),
        ];
        for (filter, due) in due {
            let table = FilterTable::new(filter);
            for (pixel, due) in (5..).zip(due) {
                let count = 20_000;
                let of_axis = |i: u32| {
                    let random = (i as f32 + 0.5) / count as f32;
                    let (at, weight) = match filter {
                        Filter::PIXEL => (table.sample([pixel, 0], [16, 16], Vec2::new(random, 0.5)).0.x, 1.0),
                        _ => table.along(pixel, 16, random),
                    };
                    if at > 8.3 { f64::from(weight) } else { 0.0 }
                };
                let mean: f64 = (0..count).map(of_axis).sum::<f64>() / f64::from(count);
                // Five standard errors.
                assert!((mean - due).abs() < 1e-3, "{filter:?} at {pixel}: {mean} and not {due}");
            }
        }
    }

    #[test]
    fn a_box_of_a_pixel_is_the_pixel() {
        let table = FilterTable::new(Filter::PIXEL);
        assert_eq!(table.sample([3, 5], [8, 8], Vec2::new(0.25, 0.5)), (Vec2::new(3.25, 5.5), 1.0));
    }
}
