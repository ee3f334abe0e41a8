//! Random numbers of pixels: even, uniform, uncorrelated.

use fogbow::sampling::uniform::mix;
use fogbow::sampling::{pixel_seed, uniform};
use fogbow_std::seed::{LowDiscrepancy, Sequence, pixel_key};

/// Sets of four dimensions that are even, as the page of [`LowDiscrepancy`] says: 24 numbers.
const SETS: u32 = 6;

#[test]
fn agrees_with_the_crate_in_the_bits_it_keeps() {
    for sample in [0, 1, 77, 65_535] {
        let mut rng = LowDiscrepancy::new(3, pixel_key(4, 5), sample);
        // The sequence is scrambled by the high half of the hash of the pixel.
        let seed = (mix(pixel_seed(3, pixel_key(4, 5))) >> 32) as u32;
        for set in 0..SETS {
            for expected in sobol_burley::sample_4d(sample, set, seed) {
                let found = uniform(&mut rng);
                let beyond = found - expected;
                assert!((0.0..=f32::EPSILON / 2.0).contains(&beyond), "{found} {expected}");
            }
        }
    }
}

#[test]
fn numbers_lie_in_the_unit_interval_and_are_uniform_in_every_dimension() {
    const DIMENSIONS: usize = 40; // Beyond the even ones.
    const SAMPLES: u32 = 4096;
    let mut bins = vec![[0u32; 16]; DIMENSIONS];
    for sample in 0..SAMPLES {
        let mut rng = LowDiscrepancy::new(11, 0, sample);
        for bin in &mut bins {
            let u = uniform(&mut rng);
            assert!((0.0..1.0).contains(&u));
            bin[(u * 16.0) as usize] += 1;
        }
    }
    for (dimension, bin) in bins.iter().enumerate() {
        // The first exactly even; beyond, six standard deviations of a binomial.
        let slack = if dimension < 4 * SETS as usize { 0 } else { 94 };
        assert!(bin.iter().all(|&n| n.abs_diff(SAMPLES / 16) <= slack), "dimension {dimension}: {bin:?}");
    }
}

/// Error of the mean of a smooth function of dimensions 2 and 3, exact integral 1.
fn error(sequence: Sequence, pixel: u64, samples: u32) -> f64 {
    let mut sum = 0.0;
    for sample in 0..samples {
        let mut rng = sequence.start(5, pixel, sample);
        let [_, _, x, y] = [(); 4].map(|()| f64::from(uniform(&mut rng)));
        sum += 4.0 * x * y;
    }
    sum / f64::from(samples) - 1.0
}

fn rms(sequence: Sequence, samples: u32) -> f64 {
    ((0..200).map(|p| error(sequence, p, samples).powi(2)).sum::<f64>() / 200.0).sqrt()
}

#[test]
fn converges_faster_than_the_root_of_the_number_of_samples() {
    let (few, many) = (rms(Sequence::LowDiscrepancy, 16), rms(Sequence::LowDiscrepancy, 1024));
    // Independent samples gain a factor of 8; scrambled nets of a smooth function 64 and more.
    assert!(many < few / 40.0, "{few} {many}");
    assert!(many < rms(Sequence::Independent, 1024) / 20.0);
    let gain = rms(Sequence::Independent, 16) / rms(Sequence::Independent, 1024);
    assert!((6.0..11.0).contains(&gain), "{gain}");
}

#[test]
fn neighbouring_pixels_are_uncorrelated() {
    for sequence in [Sequence::Independent, Sequence::LowDiscrepancy] {
        for (dx, dy) in [(1, 0), (0, 1), (1, 1)] {
            let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
            for (x, y) in (0..64).flat_map(|y| (0..64).map(move |x| (2 * x, 2 * y))) {
                let a = error(sequence, pixel_key(x, y), 4);
                let b = error(sequence, pixel_key(x + dx, y + dy), 4);
                (ab, aa, bb) = (ab + a * b, aa + a * a, bb + b * b);
            }
            // 4096 pairs: standard error 1/64.
            let correlation = ab / f64::sqrt(aa * bb);
            assert!(correlation.abs() < 4.5 / 64.0, "{sequence:?}: {correlation}");
        }
    }
}

#[test]
fn samples_beyond_the_tables_differ_from_those_within() {
    let first = |sample| uniform(&mut LowDiscrepancy::new(1, 2, sample));
    let same = (0..1000).filter(|&i| first(i) == first(i + 65_536)).count();
    assert!(same < 3);
}
