//! Spherical harmonics: identities up to the highest degree.

use fogbow::math::{Vec2, Vec3};
use fogbow::phase::{Deflection, Lobe, Phase};
use fogbow::sampling::warp::uniform_sphere;
use fogbow::sh::{self, Coefficient, MAX_COEFFICIENTS, MAX_DEGREE, expansion, zonal};
use fogbow::single_scatter::moments;
use fogbow::spectrum::Spectrum;
use fogbow_tests::tolerance;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

fn direction() -> impl Strategy<Value = Vec3> {
    (0.0..1.0_f32, 0.0..1.0_f32).prop_map(|(a, b)| uniform_sphere(Vec2::new(a, b)))
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, rng_seed: RngSeed::Fixed(1), ..ProptestConfig::default() })]

    #[test]
    fn addition_theorem_holds_at_every_degree(a in direction(), b in direction()) {
        let (mut ya, mut yb) = ([0.0; MAX_COEFFICIENTS], [0.0; MAX_COEFFICIENTS]);
        sh::evaluate(a, MAX_DEGREE, &mut ya);
        sh::evaluate(b, MAX_DEGREE, &mut yb);
        let c: f64 = (0..3).map(|i| f64::from(a[i]) * f64::from(b[i])).sum();
        let (mut before, mut legendre) = (0.0, 1.0);
        for l in 0..=MAX_DEGREE {
            let sum: f32 = (l * l..(l + 1) * (l + 1)).map(|k| ya[k] * yb[k]).sum();
            let whole = (2 * l + 1) as f64 / (4.0 * std::f64::consts::PI);
            prop_assert!((f64::from(sum) - whole * legendre).abs() < whole * f64::from(tolerance::SH), "l = {l}");
            let n = l as f64;
            (before, legendre) = (legendre, ((2.0 * n + 1.0) * c * legendre - n * before) / (n + 1.0));
        }
    }

    #[test]
    fn gradients_are_tangential_and_have_the_norm_of_the_laplacian(u in direction()) {
        let (mut y, mut g) = ([0.0; MAX_COEFFICIENTS], [Vec3::ZERO; MAX_COEFFICIENTS]);
        sh::evaluate_with_gradients(u, MAX_DEGREE, &mut y, &mut g);
        for l in 0..=MAX_DEGREE {
            let of_degree = l * l..(l + 1) * (l + 1);
            let whole = ((2 * l + 1) * l * (l + 1)) as f32 / (4.0 * std::f32::consts::PI);
            let sum: f32 = g[of_degree.clone()].iter().map(|v| v.length_squared()).sum();
            prop_assert!((sum - whole).abs() <= whole * tolerance::SH, "l = {l}: {sum} is not {whole}");
            for slope in &g[of_degree] {
                prop_assert!(slope.dot(u).abs() <= 1e-6 * (1.0 + whole), "l = {l}");
            }
        }
    }

    #[test]
    fn constants_agree_with_the_recurrences(u in direction()) {
        let (mut low, mut high) = ([0.0; 9], [0.0; 16]);
        let (mut low_g, mut high_g) = ([Vec3::ZERO; 9], [Vec3::ZERO; 16]);
        sh::evaluate_with_gradients(u, 2, &mut low, &mut low_g);
        sh::evaluate_with_gradients(u, 3, &mut high, &mut high_g);
        for k in 0..9 {
            prop_assert!((low[k] - high[k]).abs() < 1e-6 && (low_g[k] - high_g[k]).length() < 2e-6, "k = {k}");
        }
    }
}

#[test]
fn basis_is_orthonormal_at_every_degree() {
    for k in [0, 2, 7, 48, 100, MAX_COEFFICIENTS - 1] {
        let mut out = [Spectrum::ZERO; MAX_COEFFICIENTS];
        let basis = |u: Vec3| {
            let mut y = [0.0; MAX_COEFFICIENTS];
            sh::evaluate(u, MAX_DEGREE, &mut y);
            Spectrum::splat(y[k])
        };
        sh::project(MAX_DEGREE + 1, basis, &mut out);
        for (j, c) in out.iter().enumerate() {
            let expected = if j == k { 1.0 } else { 0.0 };
            assert!((c[0] - expected).abs() < tolerance::SH, "<{k}, {j}> = {}", c[0]);
        }
    }
}

#[test]
fn zonal_coefficients_equal_the_projection_of_every_phase_function() {
    let axis = Vec3::new(0.36, -0.48, 0.8);
    let lobes = [
        Lobe::Isotropic,
        Lobe::Rayleigh,
        Lobe::HenyeyGreenstein { g: 0.6 },
        Lobe::Schlick { k: -0.7 },
        Lobe::Draine { g: 0.5, alpha: 3.0 },
    ];
    for lobe in lobes {
        let f = moments(&Phase::from(lobe), 6);
        let (mut exact, mut numeric) = ([Spectrum::ZERO; 49], [Spectrum::ZERO; 49]);
        zonal::coefficients(&f[..7], axis, &mut exact);
        sh::project(48, |u| Spectrum::splat(lobe.value(Deflection::from_cos(axis.dot(u)))), &mut numeric);
        for k in 0..49 {
            assert!((exact[k][0] - numeric[k][0]).abs() < tolerance::SH, "{lobe:?}, k = {k}");
        }
    }
}

#[test]
fn too_little_room_and_too_high_degrees_are_cut_to_whole_degrees() {
    let mut y = [7.0; 8];
    sh::evaluate(Vec3::X, 2, &mut y);
    assert_eq!(y[4], 7.0, "degree 2 does not fit");
    sh::evaluate(Vec3::X, 2, &mut []);
    let mut all = vec![f32::NAN; MAX_COEFFICIENTS + 40];
    sh::evaluate(Vec3::Z, 100, &mut all);
    assert!(all[..MAX_COEFFICIENTS].iter().all(|v| v.is_finite()) && all[MAX_COEFFICIENTS].is_nan());
    let expansion = [Coefficient::ZERO; 5];
    assert_eq!(expansion::value_with_gradient(&expansion, Vec3::X).0, Spectrum::ZERO);
}
