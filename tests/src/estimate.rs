//! Monte Carlo estimates with error bars.

use fogbow::sampling::Generator;
use fogbow::spectrum::Spectrum;

/// Mean and standard error per channel.
#[derive(Debug, Clone, Copy)]
pub struct Estimate {
    /// Mean of the samples.
    pub mean: [f64; 3],
    /// Standard error of the mean.
    pub error: [f64; 3],
}

/// Averages `samples` values, each from a generator of its own.
///
/// # Panics
/// When a sample is no finite number.
pub fn estimate(samples: u32, mut sample: impl FnMut(&mut Generator) -> Spectrum) -> Estimate {
    let (mut sum, mut squares) = ([0.0; 3], [0.0; 3]);
    for i in 0..samples {
        let value = sample(&mut Generator::new(u64::from(i) + 77));
        assert!(value.is_finite(), "sample {i}: {value:?}");
        for c in 0..3 {
            sum[c] += f64::from(value[c]);
            squares[c] += f64::from(value[c]).powi(2);
        }
    }
    let n = f64::from(samples);
    let mean = sum.map(|s| s / n);
    let error = [0, 1, 2].map(|c| ((squares[c] / n - mean[c] * mean[c]).max(0.0) / n).sqrt());
    Estimate { mean, error }
}

impl Estimate {
    /// Asserts that the truth lies within 4.5 standard errors (missed once in 150 000 by chance),
    /// widened by `floor` relative to the truth where the estimator has no noise.
    ///
    /// # Panics
    /// When it does not.
    #[track_caller]
    pub fn assert_is(&self, truth: [f64; 3], floor: f64, what: &str) {
        for (channel, ((mean, error), truth)) in self.mean.iter().zip(self.error).zip(truth).enumerate() {
            let allowed = 4.5 * error + floor * truth.abs();
            assert!((mean - truth).abs() <= allowed, "{what}, channel {channel}: {mean} ± {error} instead of {truth}");
        }
    }
}
