//! χ² tests of samplers against their densities.
//!
//! A sampler's counts in the bins of a partition are compared with the density's integral over each
//! bin. The density is integrated by quadrature, so that it is tested, too: its total must be the
//! probability that the sampler returns anything.

use fogbow::math::{Vec2, Vec3};
use fogbow::sampling::{Generator, uniform2};

use crate::tolerance;

/// Result of a χ² test.
#[derive(Debug, Clone, Copy)]
pub struct ChiSquare {
    /// `Σ (observed − expected)²/expected`.
    pub statistic: f64,
    /// Degrees of freedom.
    pub freedom: usize,
    /// Probability of a statistic at least this large if sampler and density agree.
    pub p_value: f64,
}

/// Compares counts with expected counts; bins that expect little are pooled.
///
/// # Panics
/// If a bin that expects nothing was hit more than rounding at its borders explains.
#[must_use]
pub fn compare(observed: &[u64], expected: &[f64]) -> ChiSquare {
    assert_eq!(observed.len(), expected.len());
    let mut order: Vec<usize> = (0..observed.len()).collect();
    order.sort_by(|&a, &b| expected[a].total_cmp(&expected[b]));
    let (mut statistic, mut freedom) = (0.0, 0_usize);
    let (mut pooled_observed, mut pooled_expected) = (0.0, 0.0);
    let mut add = |o: f64, e: f64| {
        statistic += (o - e) * (o - e) / e;
        freedom += 1;
    };
    for i in order {
        pooled_observed += observed[i] as f64;
        pooled_expected += expected[i];
        if pooled_expected >= tolerance::CHI_SQUARE_LEAST {
            add(pooled_observed, pooled_expected);
            (pooled_observed, pooled_expected) = (0.0, 0.0);
        }
    }
    assert!(
        pooled_observed <= pooled_expected + 20.0,
        "{pooled_observed} samples where {pooled_expected} are expected"
    );
    let freedom = freedom.saturating_sub(1).max(1);
    ChiSquare { statistic, freedom, p_value: upper_gamma(0.5 * freedom as f64, 0.5 * statistic) }
}

/// Asserts that a test does not fail at the significance of [`tolerance::CHI_SQUARE_FAMILY`].
///
/// # Panics
/// If it does.
pub fn assert_passes(name: &str, result: &ChiSquare) {
    let least = tolerance::CHI_SQUARE_FAMILY / tolerance::CHI_SQUARE_TESTS;
    assert!(result.p_value > least, "{name}: {result:?}");
}

/// Regularised upper incomplete gamma function `Q(a, x)`: series below `a + 1`, continued fraction
/// (Lentz) above.
#[must_use]
pub fn upper_gamma(a: f64, x: f64) -> f64 {
    if x <= 0.0 {
        return 1.0;
    }
    let front = (a * x.ln() - x - ln_gamma(a)).exp();
    if x < a + 1.0 {
        let (mut term, mut sum, mut n) = (1.0 / a, 1.0 / a, a);
        while term > 1e-17 * sum {
            n += 1.0;
            term *= x / n;
            sum += term;
        }
        return 1.0 - front * sum;
    }
    let mut b = x + 1.0 - a;
    let (mut c, mut d) = (1e300, 1.0 / b);
    let mut h = d;
    for i in 1..100_000 {
        let i = f64::from(i);
        let an = -i * (i - a);
        b += 2.0;
        d = 1.0 / (an * d + b);
        c = b + an / c;
        h *= d * c;
        if (d * c - 1.0).abs() < 1e-15 {
            break;
        }
    }
    front * h
}

/// Lanczos approximation (g = 7).
fn ln_gamma(x: f64) -> f64 {
    const COEFFICIENTS: [f64; 9] = [
        0.999_999_999_999_809_9,
        676.520_368_121_885_1,
        -1_259.139_216_722_402_8,
        771.323_428_777_653_1,
        -176.615_029_162_140_6,
        12.507_343_278_686_905,
        -0.138_571_095_265_720_12,
        9.984_369_578_019_572e-6,
        1.505_632_735_149_311_6e-7,
    ];
    let x = x - 1.0;
    let sum = COEFFICIENTS.iter().enumerate().skip(1).fold(COEFFICIENTS[0], |s, (i, c)| s + c / (x + i as f64));
    let t = x + 7.5;
    0.5 * (2.0 * std::f64::consts::PI).ln() + (x + 0.5) * t.ln() - t + sum.ln()
}

/// Tests a sampler over the sphere, in `rings × sectors` bins of `(cos θ, φ)` about `axis`.
///
/// Cosines are divided by `warp`: bin borders lie at `1 − 2 (1 − i/rings)^power`, so that a power
/// above 1 looks closely at the axis, where peaked densities live. `sample(u, rng)` may return
/// nothing; `pdf` is over solid angle.
pub fn sphere(
    name: &str,
    axis: Vec3,
    power: f64,
    samples: u32,
    mut sample: impl FnMut(Vec2, &mut Generator) -> Option<Vec3>,
    pdf: impl Fn(Vec3) -> f64,
) {
    const RINGS: usize = 24;
    const SECTORS: usize = 12;
    // Sub-cells per bin and direction: a discontinuity across a bin then costs little.
    const FINE: usize = 48;
    let frame = fogbow::math::Frame::around(axis);
    let border = |t: f64| 2.0 * (1.0 - t).powf(power);
    let mut rng = Generator::new(0x5eed ^ name.len() as u64);
    let mut observed = vec![0_u64; RINGS * SECTORS + 1];
    for _ in 0..samples {
        let u = uniform2(&mut rng);
        let bin = match sample(u, &mut rng) {
            None => RINGS * SECTORS,
            Some(direction) => {
                assert!((direction.length() - 1.0).abs() < 1e-5, "{name}: {direction} is no unit vector");
                // 1 − cos, from the difference: exact near the axis.
                let below = 0.5 * f64::from((direction - axis).length_squared());
                let t = 1.0 - (0.5 * below).clamp(0.0, 1.0).powf(1.0 / power);
                let local = frame.to_local(direction);
                let azimuth = f64::from(local.y).atan2(f64::from(local.x)) / std::f64::consts::TAU;
                let azimuth = azimuth - azimuth.floor();
                let ring = ((t * RINGS as f64) as usize).min(RINGS - 1);
                ring * SECTORS + ((azimuth * SECTORS as f64) as usize).min(SECTORS - 1)
            }
        };
        observed[bin] += 1;
    }
    let mut expected = Vec::with_capacity(observed.len());
    for ring in 0..RINGS {
        for sector in 0..SECTORS {
            let mut integral = 0.0;
            for i in 0..FINE {
                let t = |k: usize| (ring as f64 + (i + k) as f64 / FINE as f64) / RINGS as f64;
                let (high, low) = (border(t(0)), border(t(1)));
                let middle = border(0.5 * (t(0) + t(1)));
                let sine = (middle * (2.0 - middle)).sqrt();
                for j in 0..FINE {
                    let azimuth =
                        std::f64::consts::TAU * (sector as f64 + (j as f64 + 0.5) / FINE as f64) / SECTORS as f64;
                    let local =
                        Vec3::new((sine * azimuth.cos()) as f32, (sine * azimuth.sin()) as f32, (1.0 - middle) as f32);
                    integral += pdf(frame.to_world(local).normalize()) * (high - low);
                }
            }
            expected.push(integral * std::f64::consts::TAU / (FINE * SECTORS) as f64 * f64::from(samples));
        }
    }
    finish(name, observed, expected, samples);
}

/// Tests a sampler of the interval `[from, until]` in equal bins.
pub fn interval(
    name: &str,
    [from, until]: [f64; 2],
    samples: u32,
    mut sample: impl FnMut(Vec2, &mut Generator) -> Option<f64>,
    pdf: impl Fn(f64) -> f64,
) {
    const BINS: usize = 100;
    const FINE: usize = 64;
    let mut rng = Generator::new(0x11 ^ name.len() as u64);
    let mut observed = vec![0_u64; BINS + 1];
    for _ in 0..samples {
        let u = uniform2(&mut rng);
        let bin = match sample(u, &mut rng) {
            Some(x) if x >= from && x <= until => (((x - from) / (until - from) * BINS as f64) as usize).min(BINS - 1),
            _ => BINS,
        };
        observed[bin] += 1;
    }
    let width = (until - from) / (BINS * FINE) as f64;
    let cell = |bin: usize| (0..FINE).map(|i| pdf(from + ((bin * FINE + i) as f64 + 0.5) * width)).sum::<f64>() * width;
    let expected = (0..BINS).map(|bin| cell(bin) * f64::from(samples)).collect();
    finish(name, observed, expected, samples);
}

/// Tests a sampler of the unit square in equal cells.
pub fn square(
    name: &str,
    samples: u32,
    mut sample: impl FnMut(Vec2, &mut Generator) -> Option<Vec2>,
    pdf: impl Fn(Vec2) -> f64,
) {
    const SIDE: usize = 16;
    const FINE: usize = 16;
    let mut rng = Generator::new(0x22 ^ name.len() as u64);
    let mut observed = vec![0_u64; SIDE * SIDE + 1];
    for _ in 0..samples {
        let u = uniform2(&mut rng);
        let bin = match sample(u, &mut rng) {
            None => SIDE * SIDE,
            Some(p) => {
                let cell = |c: f32| ((c * SIDE as f32) as usize).min(SIDE - 1);
                cell(p.y) * SIDE + cell(p.x)
            }
        };
        observed[bin] += 1;
    }
    let expected = (0..SIDE * SIDE)
        .map(|bin| {
            let at = |cell: usize, i: usize| (cell as f32 + (i as f32 + 0.5) / FINE as f32) / SIDE as f32;
            let points = (0..FINE * FINE).map(|i| Vec2::new(at(bin % SIDE, i % FINE), at(bin / SIDE, i / FINE)));
            points.map(&pdf).sum::<f64>() / (FINE * FINE * SIDE * SIDE) as f64 * f64::from(samples)
        })
        .collect();
    finish(name, observed, expected, samples);
}

/// The last bin holds what the sampler refused: one minus the density's total.
fn finish(name: &str, observed: Vec<u64>, mut expected: Vec<f64>, samples: u32) {
    let total: f64 = expected.iter().sum();
    let samples = f64::from(samples);
    assert!(total <= samples * 1.002, "{name}: the density integrates to {}", total / samples);
    expected.push((samples - total).max(0.0));
    // What quadrature leaves over is no probability of refusal.
    if observed.last() == Some(&0) {
        assert!(total >= samples * 0.998, "{name}: the density integrates to {}", total / samples);
        let scale = samples / total;
        expected.iter_mut().for_each(|e| *e *= scale);
        expected.pop();
        assert_passes(name, &compare(&observed[..observed.len() - 1], &expected));
        return;
    }
    assert_passes(name, &compare(&observed, &expected));
}
