//! Fig. 5: the same records, carried in three ways, on a slice through the light of a lamp.

use fogbow::cache::{Basis, Cache, Extrapolation, Limits, Reading, Record, VolumeCache};
use fogbow::host::Medium;
use fogbow::light::PointLight;
use fogbow::math::Vec3;
use fogbow::medium::{FractalNoise, Homogeneous, Noise};
use fogbow::phase::Phase;
use fogbow::single_scatter::{Sums, connect};
use fogbow::spectrum::Spectrum;
use fogbow::transmittance::thickness::{Marching, Steps};

/// `ε`.
pub const TOLERANCE: f32 = 0.5;

/// Half the edge of the slice (m).
pub const HALF: f32 = 1.0;

/// The lamp, beside the slice.
const LAMP: Vec3 = Vec3::new(-0.3, 0.2, 0.2);

const EXACT: Marching = Marching { steps: Steps::Gauss(12), offset: 0.0 };

/// The ways, from the coarsest to the one the paper proposes, and the one that pictures are made with.
pub const WAYS: [(&str, Extrapolation); 4] = [
    ("constant", Extrapolation::Constant),
    ("linear", Extrapolation::Linear),
    ("exponential", Extrapolation::Exponential),
    ("curved", Extrapolation::Curved),
];

/// A slice of `edge`² pixels, row by row from the top.
#[derive(Debug, Clone)]
pub struct Slice {
    /// Pixels along an edge.
    pub edge: u32,
    /// Number of records.
    pub records: usize,
    /// The true radiance.
    pub truth: Vec<f32>,
    /// Extrapolated radiance, for each of [`WAYS`].
    pub carried: [Vec<f32>; 4],
}

impl Slice {
    /// `Σ|L̂ − L| / ΣL` for each of [`WAYS`].
    #[must_use]
    pub fn errors(&self) -> [f64; 4] {
        let light: f64 = self.truth.iter().map(|l| f64::from(*l)).sum();
        [0, 1, 2, 3].map(|way| {
            let pairs = self.carried[way].iter().zip(&self.truth);
            pairs.map(|(a, b)| f64::from((a - b).abs())).sum::<f64>() / light
        })
    }
}

/// Where a pixel lies.
#[must_use]
pub fn place(edge: u32, x: u32, y: u32) -> Vec3 {
    let at = |i: u32| (2.0 * (i as f32 + 0.5) / edge as f32 - 1.0) * HALF;
    Vec3::new(at(x), -at(y), 0.0)
}

/// In even fog.
///
/// # Panics
/// Never: the medium's constants are valid.
#[must_use]
pub fn homogeneous(edge: u32) -> Slice {
    let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::splat(1.5), Phase::ISOTROPIC);
    slice(edge, &fog.expect("constants"))
}

/// In smoke.
///
/// # Panics
/// Never: the medium's constants are valid.
#[must_use]
pub fn heterogeneous(edge: u32) -> Slice {
    let shape =
        FractalNoise { frequency: 1.1, octaves: 2, offset: 0.25, amplitude: 0.8, seed: 3, ..Default::default() };
    let smoke = Noise::new(shape, Spectrum::ZERO, Spectrum::splat(5.0), Phase::ISOTROPIC);
    slice(edge, &smoke.expect("constants"))
}

fn sums(medium: &impl Medium, point: Vec3) -> Sums {
    let mut sums = Sums::default();
    if let Ok(lamp) = PointLight::new(LAMP, Spectrum::ONE) {
        sums.add(&connect(point, Vec3::Z, &Phase::ISOTROPIC, medium, &lamp.source(), EXACT), true);
    }
    sums
}

fn slice(edge: u32, medium: &impl Medium) -> Slice {
    let mut cache: VolumeCache<'static> = Cache::growing(0);
    let reading = |extrapolation| Reading { extrapolation, ..Reading::new(TOLERANCE) };
    let (count, limits) = (edge * edge, Limits { min: 1e-3, max: HALF });
    let pixel = |i: u32| place(edge, i % edge, i / edge);
    // In an order that leaps about the slice; again, because later records may shrink earlier ones.
    let step = (f64::from(count) * 0.618_034) as u32 | 1;
    let step = (step..).step_by(2).find(|s| gcd(*s, count) == 1).unwrap_or(1);
    loop {
        let before = cache.len();
        for k in 0..count {
            let point = pixel((u64::from(k) * u64::from(step) % u64::from(count)) as u32);
            if !cache.covers(point, &reading(Extrapolation::Constant))
                && let Some(record) = Record::new(point, &sums(medium, point), TOLERANCE, limits)
            {
                // Storage that grows is never full.
                let _ = cache.insert(record, &[]);
            }
        }
        if cache.len() == before {
            break;
        }
    }
    let basis = Basis::new(Vec3::Z, 0);
    let look = |way: Extrapolation| {
        (0..count).map(|i| cache.lookup(pixel(i), &basis, &reading(way)).unwrap_or_default()[0]).collect()
    };
    Slice {
        edge,
        records: cache.len(),
        truth: (0..count).map(|i| sums(medium, pixel(i)).value[0]).collect(),
        carried: WAYS.map(|(_, way)| look(way)),
    }
}

fn gcd(a: u32, b: u32) -> u32 {
    if b == 0 { a } else { gcd(b, a % b) }
}
