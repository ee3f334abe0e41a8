//! What figures 4 and 5 of Jarosz et al. 2008 and figure 10 of Belcour et al. 2014 claim.

use fogbow::covariance::emitted;
use fogbow::light::{Light, PointLight};
use fogbow::math::{Ray, Symmetric3, Vec3};
use fogbow::spectrum::Spectrum;
use fogbow_examples::figures::extrapolation::{heterogeneous, homogeneous};
use fogbow_examples::figures::hessian;
use fogbow_examples::figures::radius::{claims, radii, twenty, two};

#[test]
fn valid_radii_stay_below_the_optimum_where_logarithmic_gradients_diverge() {
    for lamps in [two(), twenty()] {
        let radii = radii(&lamps, 1000);
        assert!(radii.len() > 900);
        let claims = claims(&radii);
        assert!(claims.ours[0] > 0.0 && claims.ours[1] < 1.0, "{claims:?}");
        assert!(claims.safe >= 0.95 && claims.safe_constant >= 0.95, "{claims:?}");
        // Between two neighbours is a saddle point; sampled, its radius is large instead of infinite.
        let mut order: Vec<f64> = lamps.iter().map(|lamp| lamp.0).collect();
        order.sort_by(f64::total_cmp);
        for pair in order.windows(2) {
            let between = radii.iter().filter(|r| (pair[0]..pair[1]).contains(&r.x));
            let (log, ours) = between.fold((0.0, 0.0), |m: (f64, f64), r| (m.0.max(r.log_gradient), m.1.max(r.ours)));
            assert!(log > 5.0 * ours && ours < 0.5 * (pair[1] - pair[0]), "{pair:?}: {log} and {ours}");
        }
    }
}

#[test]
fn exponential_extrapolation_beats_linear_and_linear_beats_constant() {
    for (name, slice) in [("even fog", homogeneous(96)), ("smoke", heterogeneous(96))] {
        let [constant, linear, exponential, _] = slice.errors();
        println!("{name}: {} records, {constant} {linear} {exponential}", slice.records);
        assert!(exponential < linear && linear < constant, "{name}: {constant} {linear} {exponential}");
        assert!(slice.carried.iter().flatten().all(|l| *l > 0.0), "{name}: holes");
    }
}

#[test]
fn second_derivatives_by_covariance_are_the_most_accurate_from_5000_paths_on() {
    let measured = hessian::measure(8, 20_000, 0);
    let from = [0, 1, 2].map(|place| hessian::best_from(&measured, place).unwrap());
    println!("beams of 3, 6 and 10 cells: from {from:?} paths on");
    // In a beam of ten cells few photons come to one of them, and the filter of 21 is narrow.
    assert!(from[0] <= 5000 && from[1] <= 5000 && from[2] <= 10_000, "{measured:?}");
}

#[test]
fn second_derivatives_across_a_beam_are_those_of_its_lobe() {
    for z in [0.5, 1.0, 1.5] {
        // −F/(s² z²), F the spot's light on its axis; the fog's light adds to F and hardly to F″.
        let (s2, sigma) = (f64::from(hessian::LOBE).powi(2), 2.0 * f64::from(hessian::FOG));
        let fluence = (1.0 / s2 + 1.0) / (2.0 * core::f64::consts::PI) * (-sigma * z).exp() / (z * z);
        let share = hessian::truth(z) / (-fluence / (s2 * z * z));
        assert!((share - 1.0).abs() < 0.04, "{share} at {z}");
    }
}

#[test]
fn an_isotropic_point_light_has_a_fall_off_and_no_covariance() {
    let lamp = Light::Point(PointLight::new(Vec3::ZERO, Spectrum::ONE).unwrap());
    let light = emitted(&lamp, &Ray::new(Vec3::ZERO, Vec3::Z), None, 1e-3).travelled(1.0);
    assert_eq!(light.volumetric(), Symmetric3::ZERO);
    // 6/r² of 6/r² + 4σ/r + σ², at 1 m with σ = 0.2 m⁻¹.
    let share = hessian::fall_off(200_000);
    assert!((share - 6.0 / 6.84).abs() < 0.03, "{share}");
}
