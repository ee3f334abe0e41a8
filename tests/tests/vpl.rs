//! Many virtual lights: energy, agreement of strategies, sampling.

use fogbow::host::Empty;
use fogbow::light::{Light, PointLight};
use fogbow::math::{Bounds, Vec3};
use fogbow::medium::Homogeneous;
use fogbow::path::{Settings, World};
use fogbow::phase::Phase;
use fogbow::spectrum::Spectrum;
use fogbow::vpl::{self, Bound, Compensation, Flights, Gatherer, Receiver, VirtualLight};
use fogbow_tests::estimate::estimate;

/// The infinite medium of the sheet's § 3.3: a lamp of 1 W, seen at 1.5 m, clamped within 1.2 m.
const DISTANCE: f32 = 1.5;
const RADIUS: f32 = 1.2;
/// In-scattered radiance of light scattered twice or more, and what n steps of compensation recover of it: exact
/// quadrature.
const EXACT: f64 = 2.336_49e-3;
const STEPS: [(u32, f64); 5] = [(1, 1.777_62e-3), (2, 2.087_82e-3), (3, 2.226_84e-3), (6, 2.327_72e-3), (12, EXACT)];

/// In-scattered radiance times `σₛ` at the point, light of one path from the lamp.
fn estimate_with(compensation: Option<Compensation>, samples: u32) -> fogbow_tests::estimate::Estimate {
    let fog = Homogeneous::new(Spectrum::splat(0.2), Spectrum::splat(0.8), Phase::ISOTROPIC).unwrap();
    let lamps = [Light::Point(PointLight::from_flux(Vec3::ZERO, Spectrum::ONE).unwrap())];
    let world = World { medium: &fog, scene: &Empty, lights: &lamps };
    let bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
    let properties = fogbow::host::Medium::properties(&fog, Vec3::ZERO);
    let receiver = Receiver::in_medium(Vec3::X * DISTANCE, Vec3::Y, &properties).unwrap();
    let gatherer = Gatherer { world, bound: Bound::within(RADIUS).unwrap(), compensation, has_mirrors: false };
    let paths = Settings { roulette_after: 4, ..Settings::default() };
    let mut lights: Vec<VirtualLight> = Vec::new();
    estimate(samples, |rng| {
        lights.clear();
        vpl::shoot(&world, &bounds, &paths, rng, &mut |light| lights.push(light));
        let mut sum = gatherer.gather(&receiver, &lights, u32::MAX, rng);
        sum.add(&gatherer.of_the_lights(&receiver, u32::MAX, rng), Spectrum::ONE);
        sum.total()
    })
}

#[test]
fn compensation_recovers_the_energy_that_it_should() {
    let strategies = [
        ("1-to-N", Compensation::FULL),
        ("N-to-1", Compensation::N_TO_ONE),
        ("1-to-1", Compensation { flights: Flights::Truncated, ..Compensation::ONE_TO_ONE }),
        ("1-to-1, locally homogeneous", Compensation::APPROXIMATE),
    ];
    for (name, strategy) in strategies {
        for (steps, truth) in STEPS {
            let found = estimate_with(Some(Compensation { steps, ..strategy }), 40_000);
            println!("{name}, {steps} steps: {:.5e} ± {:.1e}, should be {truth:.5e}", found.mean[0], found.error[0]);
            assert!(found.error[0] < 0.02 * truth, "{name}: too noisy to tell");
            assert!((found.mean[0] - truth).abs() < 3.0 * found.error[0], "{name}, {steps} steps");
        }
    }
    let clamped = estimate_with(None, 40_000);
    println!("clamped: {:.5e} ± {:.1e}", clamped.mean[0], clamped.error[0]);
    // Without the path for light straight from the lamp, too.
    clamped.assert_is([1.0824e-3; 3], 0.001, "clamped");
}
