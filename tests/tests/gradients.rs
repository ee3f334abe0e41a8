//! Every analytic gradient against central differences, over random configurations.

use fogbow::host::{Medium, Properties};
use fogbow::light::{Falloff, Source};
use fogbow::math::{Affine3, Bounds, Frame, Mat3, Ray, Vec2, Vec3};
use fogbow::medium::{Density, DensityGrid, Homogeneous, MinMax, Placed, Region};
use fogbow::multiple_scatter::Weight;
use fogbow::phase::{Deflection, Lobe, Phase, deflection};
use fogbow::sampling::warp::uniform_sphere;
use fogbow::sh::{self, Coefficient};
use fogbow::single_scatter::{Arrival, Contribution, connect, moments};
use fogbow::spectrum::{Gradient, Spectrum};
use fogbow::surface::Surface;
use fogbow::transmittance::thickness::{
    Marching, Steps, optical_thickness, optical_thickness_with_gradients, transmittance,
};
use fogbow_tests::analytic::{differences, disagreement};
use fogbow_tests::hosts::{Analytic, Body, Complaining, Field, Filled};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

/// As good as exact for the smooth fields used here.
const EXACT: Marching = Marching { steps: Steps::Gauss(4), offset: 0.0 };

fn vector(size: f32) -> impl Strategy<Value = Vec3> {
    (-size..size, -size..size, -size..size).prop_map(|(x, y, z)| Vec3::new(x, y, z))
}

fn direction() -> impl Strategy<Value = Vec3> {
    (0.0..1.0_f32, 0.0..1.0_f32).prop_map(|(a, b)| uniform_sphere(Vec2::new(a, b)))
}

fn lobe() -> impl Strategy<Value = Lobe> {
    prop_oneof![
        Just(Lobe::Isotropic),
        Just(Lobe::Rayleigh),
        (-0.85..0.85_f32).prop_map(|g| Lobe::HenyeyGreenstein { g }),
        (-0.85..0.85_f32).prop_map(|k| Lobe::Schlick { k }),
        (-0.7..0.7_f32, 0.0..10.0_f32).prop_map(|(g, alpha)| Lobe::Draine { g, alpha }),
    ]
}

fn phase() -> impl Strategy<Value = Phase> {
    (lobe(), lobe()).prop_map(|(a, b)| {
        let (red, blue) = (Spectrum::new(0.8, 0.2, 0.1), Spectrum::new(0.1, 0.3, 0.7));
        Phase::mix([(red, a.into()), (blue, b.into())]).unwrap()
    })
}

fn source() -> impl Strategy<Value = Source> {
    let falloff = prop_oneof![
        Just(Falloff::Uniform),
        Just(Falloff::Area),
        Just(Falloff::Distant),
        prop_oneof![Just(0.0_f32), Just(1.0), 2.0..30.0_f32].prop_map(|exponent| Falloff::Phong { exponent }),
        (0.1..0.6_f32, 0.2..1.0_f32).prop_map(|(beam, more)| Falloff::Spot { beam, cutoff: beam + more }),
    ];
    (vector(3.0), vector(0.6), falloff).prop_map(|(position, aside, falloff)| {
        // Roughly towards the origin, where the lit points are.
        let normal = (aside - position).try_normalize().unwrap_or(Vec3::Z);
        Source { position, normal, weight: Spectrum::new(3.0, 1.0, 0.2), falloff }
    })
}

fn field() -> impl Strategy<Value = Field> {
    prop_oneof![
        (0.0..2.0_f32).prop_map(|a| Field::Homogeneous { a }),
        vector(0.2).prop_map(|b| Field::Linear { a: 3.0, b }),
        (0.1..1.0_f32, vector(0.6)).prop_map(|(a, b)| Field::Exponential { a, b }),
        (0.02..0.3_f32, 0.3..2.0_f32, vector(1.0), 0.7..1.5_f32).prop_map(|(a, k, c, s)| Field::Gaussian {
            a,
            k,
            c,
            s
        }),
    ]
}

fn medium() -> impl Strategy<Value = Analytic> {
    (field(), phase()).prop_map(|(field, phase)| Analytic {
        field,
        tint: Spectrum::new(1.0, 0.6, 0.3),
        albedo: Spectrum::new(0.9, 0.7, 0.5),
        phase,
    })
}

fn body() -> impl Strategy<Value = Body> {
    prop_oneof![
        (vector(0.5), 0.5..1.5_f32, 0.5..1.5_f32, 0.5..1.5_f32).prop_map(|(c, x, y, z)| {
            Body::Box(Bounds { min: c - Vec3::new(x, y, z), max: c + Vec3::new(x, y, z) })
        }),
        (vector(0.5), 0.5..1.5_f32).prop_map(|(centre, radius)| Body::Sphere { centre, radius }),
    ]
}

/// The same cases in every run; no more may be set aside than are judged.
fn config(cases: u32, seed: u64) -> ProptestConfig {
    ProptestConfig {
        cases,
        max_global_rejects: cases,
        failure_persistence: None,
        rng_seed: RngSeed::Fixed(seed),
        ..ProptestConfig::default()
    }
}

/// Compares an analytic gradient with differences of `f` at `x`; cases at an edge are set aside.
macro_rules! check {
    ($gradient:expr, $f:expr, $x:expr, $size:expr) => {{
        let f = $f;
        let numeric = differences(&f, $x, $size);
        prop_assume!(numeric.is_some());
        let wrong = disagreement(&$gradient, &numeric.unwrap(), f($x), $size);
        prop_assert!(wrong.is_none(), "{}", wrong.unwrap());
    }};
}

/// Both gradients of the optical thickness between `x` and `far`.
fn check_thickness(medium: &impl Medium, x: Vec3, far: Vec3, marching: Marching) -> Result<(), TestCaseError> {
    let ray = Ray::between(x, far);
    let size = ray.length.min(1.0);
    let tau = optical_thickness_with_gradients(&ray, medium, marching);
    check!(tau.gradient_fixed, |p| optical_thickness(&Ray::between(p, far), medium, marching), x, size);
    check!(tau.gradient_joint, |p| optical_thickness(&Ray { origin: p, ..ray }, medium, marching), x, size);
    let t = tau.transmittance();
    check!(t.gradient_fixed, |p| transmittance(&Ray::between(p, far), medium, marching), x, size);
    Ok(())
}

proptest! {
    #![proptest_config(config(1000, 1))]

    #[test]
    fn falloff_of_every_kind_of_source(source in source(), x in vector(1.0)) {
        let size = x.distance(source.position).min(1.0);
        prop_assume!(size > 0.05);
        let gradient = source.irradiance(x).unwrap().1;
        check!(gradient, |p| source.irradiance(p).unwrap().0, x, 0.5 * size);
    }

    #[test]
    fn phase_function_of_every_kind(phase in phase(), light in vector(2.0), x in vector(2.0), to_eye in direction()) {
        let ray = Ray::between(x, light);
        prop_assume!(ray.length > 0.1);
        let f = |p| phase.value(deflection(Ray::between(p, light).direction, to_eye));
        check!(phase.gradient(ray.direction, to_eye, ray.length), f, x, 0.3 * ray.length);
    }

    #[test]
    fn second_derivative_of_every_phase_function(phase in phase(), cos in -0.98..0.98_f32) {
        let at = |p: Vec3| Deflection::from_cos(p.x);
        let gradient = Gradient { x: phase.second_derivative(at(Vec3::X * cos)), ..Gradient::ZERO };
        check!(gradient, |p| phase.derivative(at(p)), Vec3::X * cos, 0.1);
    }

    #[test]
    fn optical_thickness_without_bounds(medium in medium(), x in vector(2.0), far in vector(2.0), offset in 0.0..1.0_f32) {
        prop_assume!(x.distance(far) > 0.1);
        check_thickness(&medium, x, far, EXACT)?;
        // The same samples for value and gradients: marching agrees with its own differences.
        check_thickness(&medium, x, far, Marching { steps: Steps::Count(7), offset })?;
    }

    #[test]
    fn optical_thickness_across_the_faces_of_a_body(
        medium in medium(), body in body(), x in vector(2.0), far in vector(2.0),
    ) {
        prop_assume!(x.distance(far) > 0.1);
        check_thickness(&Complaining::new(Filled { medium, body }), x, far, EXACT)?;
    }

    #[test]
    fn optical_thickness_across_the_faces_of_a_placed_medium_with_holes(
        x in vector(2.0), far in vector(2.0), turn in direction(), hole in vector(0.5), ball in any::<bool>(),
    ) {
        prop_assume!(x.distance(far) > 0.1);
        let fog = Homogeneous::new(Spectrum::new(0.1, 0.5, 0.0), Spectrum::new(0.7, 0.3, 0.1), Lobe::Isotropic).unwrap();
        let region = if ball {
            Region::sphere(Vec3::ZERO, 1.2).unwrap()
        } else {
            let frame = Frame::around(turn);
            let axes = Mat3::from_cols(frame.u * 1.5, frame.v * 2.0, frame.w * 1.8);
            Region::unit_cube(Affine3::from_mat3_translation(axes, -(frame.u * 0.75 + frame.v + frame.w * 0.9))).unwrap()
        };
        let holes = [Region::sphere(hole, 0.4).unwrap()];
        check_thickness(&Placed::new(fog, region).with_holes(&holes), x, far, EXACT)?;
    }

    #[test]
    fn single_scattering_from_every_kind_of_source(
        medium in medium(), source in source(), x in vector(1.0), to_eye in direction(),
    ) {
        let size = x.distance(source.position).min(1.0);
        prop_assume!(size > 0.1);
        // Endless fog hides a distant source.
        prop_assume!(source.falloff != Falloff::Distant);
        let phase = medium.phase;
        let at = |p| connect(p, to_eye, &phase, &medium, &source, EXACT);
        check!(at(x).gradient, |p| at(p).radiance, x, 0.3 * size);
    }

    #[test]
    fn single_scattering_from_outside_a_body_and_from_the_sun(
        medium in medium(), body in body(), source in source(), x in vector(1.0), to_eye in direction(),
    ) {
        prop_assume!(x.distance(source.position) > 0.2);
        let phase = medium.phase;
        let medium = Complaining::new(Filled { medium, body });
        let at = |p| connect(p, to_eye, &phase, &medium, &source, EXACT);
        check!(at(x).gradient, |p| at(p).radiance, x, 0.2);
    }

    #[test]
    fn light_from_a_surface_whose_point_stays(
        medium in medium(), x in vector(1.0), at in vector(2.0), normal in direction(), to_eye in direction(),
    ) {
        let ray = Ray::between(x, at);
        let normal = if normal.dot(ray.direction) > 0.0 { -normal } else { normal };
        let cosine = -normal.dot(ray.direction);
        prop_assume!(ray.length > 0.3 && cosine > 0.1);
        let hit = fogbow::host::Hit { distance: ray.length, normal, shading: normal, surface: Surface::BLACK, light: None };
        let pdf = 0.25;
        let arrival = Arrival::from_surface(&ray, &hit, Spectrum::ONE, pdf, &medium, EXACT).unwrap();
        // The same as an area sample whose density over area is frozen at x.
        let weight = Spectrum::splat(ray.length * ray.length / (pdf * cosine));
        let source = Source { position: at, normal, weight, falloff: Falloff::Area };
        let f = |p| connect(p, to_eye, &medium.phase, &medium, &source, EXACT).radiance;
        check!(arrival.scatter(to_eye, &medium.phase).gradient, f, x, 0.3 * ray.length.min(1.0));
    }

    #[test]
    fn scattered_light_as_the_direction_to_the_eye_turns(
        medium in medium(), source in source(), x in vector(1.0), to_eye in direction(),
    ) {
        prop_assume!(x.distance(source.position) > 0.1);
        let arrival = Arrival::from_source(x, &medium, &source, EXACT, 0.0);
        prop_assume!(arrival.is_some());
        let (arrival, phase) = (arrival.unwrap(), medium.phase);
        let light = arrival.scatter(to_eye, &phase).radiance;
        // Of the direction of any vector: its gradient at a unit vector is the tangential one.
        let f = |p: Vec3| arrival.scatter((to_eye + p).normalize(), &phase).radiance;
        let turned = arrival.turned(to_eye, &phase);
        prop_assert!(turned.along(to_eye).map(f32::abs).max_element() <= 1e-5 * turned.norm().max_element());
        prop_assume!(!light.is_black());
        check!(turned, f, Vec3::ZERO, 0.3);
    }

    #[test]
    fn coefficients_of_an_expansion(
        medium in medium(), source in source(), x in vector(1.0), degree in 0_usize..=6, pick in 0.0..1.0_f32,
    ) {
        prop_assume!(source.falloff != Falloff::Distant && x.distance(source.position) > 0.3);
        let f = moments(&medium.phase, degree);
        let expansion = |p: Vec3| {
            let mut out = [Coefficient::ZERO; 49];
            let out = &mut out[..sh::coefficient_count(degree)];
            let mean = Arrival::from_source(p, &medium, &source, EXACT, 0.0)
                .map_or(Contribution::ZERO, |a| a.scatter_directional(&f[..=degree], 1.0, out));
            let k = ((pick * out.len() as f32) as usize).min(out.len() - 1);
            (out[k], mean, out[0])
        };
        let (coefficient, mean, first) = expansion(x);
        // Coefficients pass through 0; the mean gives the scale.
        let offset = |p| { let (c, m, _) = expansion(p); c.value + m.radiance * 4.0 };
        let gradient = coefficient.gradient + mean.gradient * 4.0;
        check!(gradient, offset, x, 0.1);
        for c in 0..3 {
            prop_assert!((first.value[c] * 0.28209479 - mean.radiance[c]).abs() <= 1e-6 * mean.radiance[c].abs());
        }
    }

    #[test]
    fn multiple_scattering_with_a_frozen_path(
        medium in medium(), body in prop::option::of(body()), source in source(), x in vector(0.5),
        steps in prop::collection::vec((direction(), 0.2..1.0_f32, 1.0..15.0_f32), 1..5), to_eye in direction(),
    ) {
        prop_assume!(source.falloff != Falloff::Distant);
        let path = |p: Vec3| -> Contribution {
            match body {
                Some(body) => frozen(&Filled { medium, body }, &source, p, to_eye, &steps),
                None => frozen(&medium, &source, p, to_eye, &steps),
            }
        };
        let total = path(x);
        prop_assume!(!total.radiance.is_black());
        check!(total.gradient, |p| path(p).radiance, x, 0.15);
    }
}

/// One path translated as a whole: lengths, directions and densities stay.
fn frozen(medium: &impl Medium, source: &Source, x: Vec3, to_eye: Vec3, steps: &[(Vec3, f32, f32)]) -> Contribution {
    let (mut weight, mut total, mut at, mut to_eye) = (Weight::ONE, Contribution::ZERO, x, to_eye);
    for &(direction, length, inverse_pdf) in steps {
        let ray = Ray { origin: at, direction, length };
        let kappa = medium.properties(at).phase.value(deflection(direction, to_eye)) * inverse_pdf;
        let tau = optical_thickness_with_gradients(&ray, medium, EXACT);
        at = ray.at(length);
        let (properties, slopes) = (medium.properties(at), medium.gradients(at));
        let through = tau.value.transmitted();
        weight = weight.advance(kappa, through, &tau.gradient_joint, properties.scattering, &slopes.scattering);
        to_eye = -direction;
        total += weight.carry(&connect(at, to_eye, &properties.phase, medium, source, EXACT));
    }
    total
}

proptest! {
    #![proptest_config(config(300, 3))]

    /// The gradient of the interpolant jumps from cell to cell; the thickness has a gradient all the
    /// same, and faces where the border's densities are not 0.
    #[test]
    fn optical_thickness_through_a_voxel_grid(
        densities in prop::collection::vec(0.0..1.0_f32, 6 * 5 * 4), x in vector(1.5), far in vector(1.5),
        turn in direction(),
    ) {
        prop_assume!(x.distance(far) > 0.5);
        let size = [6, 5, 4];
        let mut blocks = vec![MinMax::default(); DensityGrid::block_count(size)];
        let frame = Frame::around(turn);
        let axes = Mat3::from_cols(frame.u * 2.0, frame.v * 1.6, frame.w * 1.8);
        let place = Affine3::from_mat3_translation(axes, -(frame.u + frame.v * 0.8 + frame.w * 0.9));
        let (absorption, scattering) = (Spectrum::new(0.2, 0.5, 0.1), Spectrum::new(1.0, 0.3, 0.2));
        let smoke = Properties { absorption, scattering, ..Properties::VACUUM };
        let grid = DensityGrid::new(size, Density::F32(&densities), &smoke, place, &mut blocks).unwrap();
        check_thickness(&Complaining::new(grid), x, far, Marching::midpoints(4000))?;
    }
}

/// A number of any size and sign.
fn wild() -> impl Strategy<Value = f32> {
    prop_oneof![
        Just(0.0_f32),
        (-38.0..38.0_f32, any::<bool>()).prop_map(|(e, s)| {
            let size = 10.0_f32.powf(e);
            if s { size } else { -size }
        })
    ]
}

proptest! {
    #![proptest_config(config(4000, 2))]

    #[test]
    fn connections_of_any_size_are_numbers(
        source in source(), x in (wild(), wild(), wild()), position in (wild(), wild(), wild()), weight in wild(),
        extinction in wild(), to_eye in direction(), lobe in lobe(), straight in any::<bool>(), beyond in 0.0..1e-4_f32,
    ) {
        let (x, position) = (Vec3::new(x.0, x.1, x.2), Vec3::new(position.0, position.1, position.2));
        let source = Source { position, weight: Spectrum::splat(weight.abs()), ..source };
        let to_eye = if straight { -Ray::between(x, position).direction } else { to_eye };
        let lobe = if beyond < 5e-5 { Lobe::HenyeyGreenstein { g: 1.0 - 2.0 * beyond.max(1e-5) } } else { lobe };
        let medium = Analytic::grey(Field::Homogeneous { a: extinction.abs() }, 0.5);
        let l = connect(x, to_eye, &lobe.into(), &medium, &source, EXACT);
        prop_assert!(l.radiance.is_valid() && l.gradient.is_finite(), "{l:?}");
        let mut expansion = [Coefficient::ZERO; 49];
        if let Some(arrival) = Arrival::from_source(x, &medium, &source, EXACT, 0.0) {
            arrival.scatter_directional(&moments(&lobe.into(), 6)[..7], 1.0, &mut expansion);
        }
        for c in expansion {
            prop_assert!(c.value.is_finite() && c.gradient.is_finite(), "{c:?}");
        }
    }
}

#[test]
fn degenerate_connections_have_defined_answers() {
    let fog = Analytic::grey(Field::Homogeneous { a: 60.0 }, 1.0);
    let lamp = |position| Source { position, normal: Vec3::Z, weight: Spectrum::ONE, falloff: Falloff::Uniform };
    let at = |source: &Source| connect(Vec3::ZERO, Vec3::Z, &Phase::ISOTROPIC, &fog, source, EXACT);
    assert_eq!(at(&lamp(Vec3::ZERO)), Contribution::ZERO, "at the light itself");
    assert_eq!(at(&lamp(Vec3::X * 10.0)), Contribution::ZERO, "opaque: no light and no slope");
    for distance in [1e-30, 1e-20, 1e-12, 2e-12, 1e-6, 1e6, 1e18, 1e30] {
        let c = at(&lamp(Vec3::X * distance));
        assert!(c.radiance.is_finite() && c.gradient.is_finite(), "{distance}: {c:?}");
    }
    let sun = Source { falloff: Falloff::Distant, ..lamp(Vec3::ZERO) };
    assert_eq!(at(&sun), Contribution::ZERO, "endless fog hides the sun");
    let nowhere = optical_thickness_with_gradients(&Ray::new(Vec3::ZERO, Vec3::X).with_length(0.0), &fog, EXACT);
    assert_eq!((nowhere.value, nowhere.gradient_fixed), (Spectrum::ZERO, Gradient::ZERO));
    let endless = optical_thickness_with_gradients(&Ray::new(Vec3::ZERO, Vec3::X), &fog, EXACT).transmittance();
    assert_eq!((endless.value, endless.gradient_fixed), (Spectrum::ZERO, Gradient::ZERO));
}
