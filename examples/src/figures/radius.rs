//! Fig. 4: three radii on a line past lights in even fog.

use fogbow::cache::{log_gradient_radius, valid_radius};
use fogbow::light::PointLight;
use fogbow::math::Vec3;
use fogbow::medium::Homogeneous;
use fogbow::phase::Phase;
use fogbow::single_scatter::{Sums, connect};
use fogbow::spectrum::Spectrum;
use fogbow::transmittance::thickness::{Marching, Steps};

/// Length of the line (m).
pub const LENGTH: f64 = 10.0;
/// Extinction of the fog (m⁻¹).
pub const EXTINCTION: f64 = 0.5;
/// `ε`.
pub const TOLERANCE: f64 = 0.2;

/// Growth of the interval from one step of the quadrature to the next.
const GROWTH: f64 = 1.02;

/// A light on the line: position (m) and intensity (W·sr⁻¹).
pub type Lamp = (f64, f64);

/// Two lights of differing strength.
#[must_use]
pub fn two() -> Vec<Lamp> {
    vec![(2.5, 1.0), (7.0, 4.0)]
}

/// Twenty equal lights, unevenly along the line.
#[must_use]
pub fn twenty() -> Vec<Lamp> {
    let turn = |k: u32| (f64::from(k) * 0.618_033_988_749_894_9).fract();
    (0..20).map(|k| (0.5 * (f64::from(k) + 0.15 + 0.7 * turn(k + 1)), 1.0)).collect()
}

/// The radii at a position (m).
#[derive(Debug, Clone, Copy)]
pub struct Radii {
    /// Position on the line.
    pub x: f64,
    /// J Eq. 34.
    pub ours: f64,
    /// `ε L/‖∇L‖`.
    pub log_gradient: f64,
    /// J Eq. 31 with the value carried as it is.
    pub optimal_constant: f64,
    /// J Eq. 31 with the value carried exponentially, as the cache does.
    pub optimal: f64,
}

/// Radii at `count` positions between the ends of the line; positions closer to a light than a thousandth of the
/// line are left out.
#[must_use]
pub fn radii(lamps: &[Lamp], count: u32) -> Vec<Radii> {
    let positions = (0..count).map(|k| LENGTH * (f64::from(k) + 0.5) / f64::from(count));
    let is_free = |x: &f64| lamps.iter().all(|lamp| (lamp.0 - x).abs() > 1e-3 * LENGTH);
    positions.filter(is_free).filter_map(|x| at(lamps, x)).collect()
}

fn at(lamps: &[Lamp], x: f64) -> Option<Radii> {
    let grey = |value: f64| Spectrum::splat(value as f32);
    let fog = Homogeneous::new(grey(0.0), grey(EXTINCTION), Phase::ISOTROPIC).ok()?;
    let mut sums = Sums::default();
    for (position, intensity) in lamps {
        let lamp = PointLight::new(Vec3::X * *position as f32, grey(*intensity)).ok()?;
        let exact = Marching { steps: Steps::Gauss(4), offset: 0.0 };
        let point = Vec3::X * x as f32;
        sums.add(&connect(point, Vec3::Y, &Phase::ISOTROPIC, &fog, &lamp.source(), exact), true);
    }
    let (value, slope) = field(lamps, x);
    Some(Radii {
        x,
        ours: f64::from(valid_radius(&sums, TOLERANCE as f32)?),
        log_gradient: f64::from(log_gradient_radius(sums.value, &sums.gradient, TOLERANCE as f32)),
        optimal_constant: optimal(lamps, x, |_| value),
        optimal: optimal(lamps, x, |offset| value * (slope * offset / value).exp()),
    })
}

/// In-scattered radiance on the line and its slope, in closed form: `Σ I e^(−σr)/(4πr²)`.
fn field(lamps: &[Lamp], x: f64) -> (f64, f64) {
    lamps.iter().fold((0.0, 0.0), |(value, slope), (position, intensity)| {
        let r = (x - position).abs();
        let l = intensity * (-EXTINCTION * r).exp() / (4.0 * core::f64::consts::PI * r * r);
        (value + l, slope - l * (EXTINCTION + 2.0 / r) * (x - position).signum())
    })
}

/// The least radius at which `∫|L − L̂| dx / ∫L dx` over `[x − r, x + r]` exceeds the tolerance: within it no
/// interval around `x` does. By the midpoint rule over intervals that grow by a fiftieth.
fn optimal(lamps: &[Lamp], x: f64, carried: impl Fn(f64) -> f64) -> f64 {
    let (mut error, mut light, mut r) = (0.0, 0.0, 0.0);
    let mut next = 1e-5 * LENGTH;
    while r < LENGTH {
        let (middle, width) = (0.5 * (r + next), next - r);
        for offset in [-middle, middle] {
            let truth = field(lamps, x + offset).0;
            error += (truth - carried(offset)).abs() * width;
            light += truth * width;
        }
        if error > TOLERANCE * light {
            return r;
        }
        (r, next) = (next, next * GROWTH);
    }
    LENGTH
}

/// What Fig. 4 claims, in numbers.
#[derive(Debug, Clone, Copy)]
pub struct Claims {
    /// Least and greatest radius of Eq. 34 (m).
    pub ours: [f64; 2],
    /// Greatest radius of the logarithmic gradient (m).
    pub log_gradient: f64,
    /// Share of positions where Eq. 34 is at most the optimal radius.
    pub safe: f64,
    /// The same for constant extrapolation.
    pub safe_constant: f64,
    /// The same of the logarithmic gradient and constant extrapolation.
    pub log_gradient_safe: f64,
}

/// Measures the claims.
#[must_use]
pub fn claims(radii: &[Radii]) -> Claims {
    let share = |is: &dyn Fn(&Radii) -> bool| radii.iter().filter(|r| is(r)).count() as f64 / radii.len() as f64;
    let most = |of: &dyn Fn(&Radii) -> f64| radii.iter().map(of).fold(0.0, f64::max);
    Claims {
        ours: [radii.iter().map(|r| r.ours).fold(f64::INFINITY, f64::min), most(&|r| r.ours)],
        log_gradient: most(&|r| r.log_gradient),
        safe: share(&|r| r.ours <= r.optimal),
        safe_constant: share(&|r| r.ours <= r.optimal_constant),
        log_gradient_safe: share(&|r| r.log_gradient <= r.optimal_constant),
    }
}
