//! χ² of every sampler against its density. Seeds are fixed.

use fogbow::light::{EnvironmentMap, Light, LightImage, MeshLight, PictureLight, QuadLight, SphereLight, Triangle};
use fogbow::math::{Mat3, Vec3};
use fogbow::phase::{Lobe, Phase, deflection};
use fogbow::sampling::{Generator, discrete, distance, uniform, uniform2, warp};
use fogbow::spectrum::Spectrum;
use fogbow::surface::Surface;
use fogbow_tests::chi_square::{self, compare, interval, sphere, square, upper_gamma};

const SAMPLES: u32 = 300_000;
const AXIS: Vec3 = Vec3::new(0.36, -0.48, 0.8);

#[test]
fn tail_of_chi_square_agrees_with_tables() {
    for (freedom, statistic, p) in [(1.0, 3.841_459, 0.05), (10.0, 18.307_04, 0.05), (100.0, 135.806_7, 0.01)] {
        let tail = upper_gamma(0.5 * freedom, 0.5 * statistic);
        assert!((tail - p).abs() < 1e-6, "{freedom} degrees of freedom: {tail}");
    }
    assert!(upper_gamma(50.0, 20.0) > 0.999_999 && upper_gamma(50.0, 200.0) < 1e-20);
}

#[test]
fn chi_square_notices_a_density_that_is_tilted_by_five_percent() {
    let mut counts = [0_u64; 20];
    let mut rng = Generator::new(3);
    for _ in 0..SAMPLES {
        counts[(uniform(&mut rng) * 20.0) as usize] += 1;
    }
    let flat = [f64::from(SAMPLES) / 20.0; 20];
    let tilted: Vec<f64> = (0..20).map(|i| flat[i] * (1.0 + 0.05 * (i as f64 - 9.5) / 9.5)).collect();
    chi_square::assert_passes("uniform numbers", &compare(&counts, &flat));
    assert!(compare(&counts, &tilted).p_value < 1e-9);
}

#[test]
#[should_panic(expected = "wrong mean cosine")]
fn chi_square_notices_a_wrong_phase_function() {
    let (drawn, claimed) = (Lobe::HenyeyGreenstein { g: 0.60 }, Lobe::HenyeyGreenstein { g: 0.61 });
    let sample = |u| Phase::from(drawn).sample(AXIS, u).to_light;
    sphere(
        "wrong mean cosine",
        -AXIS,
        4.0,
        SAMPLES,
        |u, _| Some(sample(u)),
        |d| f64::from(claimed.value(deflection(d, AXIS))),
    );
}

#[test]
fn warps_of_the_unit_square() {
    sphere(
        "uniform sphere",
        Vec3::Z,
        1.0,
        SAMPLES,
        |u, _| Some(warp::uniform_sphere(u)),
        |_| f64::from(warp::uniform_sphere_pdf()),
    );
    sphere(
        "cosine hemisphere",
        Vec3::Z,
        1.0,
        SAMPLES,
        |u, _| Some(warp::cosine_hemisphere(u)),
        |d| f64::from(warp::cosine_hemisphere_pdf(d.z)),
    );
    for exponent in [0.0, 1.0, 5.0, 200.0] {
        let name = format!("cosine to the power {exponent}");
        sphere(
            &name,
            Vec3::Z,
            3.0,
            SAMPLES,
            |u, _| Some(warp::cosine_power(u, exponent)),
            |d| f64::from(warp::cosine_power_pdf(d.z, exponent)),
        );
    }
    for one_minus_cos in [1.5_f32, 0.1, 1e-4] {
        let name = format!("cone of {one_minus_cos}");
        // The border falls between two bins: 2 (1 − t)^p = 1 − cos at a multiple of 1/24.
        let power = f64::from(one_minus_cos * 0.5).ln() / 0.25_f64.ln();
        sphere(
            &name,
            Vec3::Z,
            power,
            SAMPLES,
            |u, _| Some(warp::uniform_cone(u, one_minus_cos)),
            |d| {
                let below = 0.5 * (d - Vec3::Z).length_squared();
                if below <= one_minus_cos * (1.0 + 1e-4) {
                    f64::from(warp::uniform_cone_pdf(one_minus_cos))
                } else {
                    0.0
                }
            },
        );
    }
    square(
        "triangle",
        SAMPLES,
        |u, _| Some(warp::uniform_triangle(u)),
        |b| match b.x + b.y {
            sum if sum < 1.0 - 1e-6 => 2.0,
            sum if sum < 1.0 + 1e-6 => 1.0,
            _ => 0.0,
        },
    );
}

/// By the angle to the axis: the density over the sphere has no bound there.
#[test]
fn steep_cones() {
    for widest in [0.1_f32, 1.5, 3.0] {
        interval(
            "angle in a steep cone",
            [0.0, f64::from(widest)],
            SAMPLES,
            |u, _| {
                let direction = warp::steep_cone(u, widest);
                Some(f64::from(Vec3::Z.cross(direction).length().atan2(direction.z)))
            },
            |angle| {
                let pdf = warp::steep_cone_pdf(angle.sin() as f32, angle.cos() as f32, widest);
                f64::from(pdf) * 2.0 * std::f64::consts::PI * angle.sin()
            },
        );
        assert_eq!(warp::steep_cone_pdf((widest + 0.01).sin(), (widest + 0.01).cos(), widest), 0.0);
    }
}

#[test]
fn distances() {
    for extinction in [0.3_f32, 20.0] {
        let reach = 6.0 / f64::from(extinction);
        interval(
            "exponential",
            [0.0, reach],
            SAMPLES,
            |u, _| Some(f64::from(distance::exponential(u.x, extinction))),
            |t| f64::from(distance::exponential_pdf(t as f32, extinction)),
        );
    }
    for (extinction, limit) in [(0.0_f32, 2.0_f32), (1e-5, 1.0), (0.7, 2.0), (3.0, 10.0), (50.0, 0.5)] {
        interval(
            &format!("truncated exponential {extinction} {limit}"),
            [0.0, f64::from(limit)],
            SAMPLES,
            |u, _| Some(f64::from(distance::truncated_exponential(u.x, extinction, limit).distance)),
            // The density the sampler itself reports, found through its inverse: e^{−σt}/weight.
            |t| {
                let weight = f64::from(distance::truncated_exponential(0.5, extinction, limit).weight);
                (-f64::from(extinction) * t).exp() / weight
            },
        );
    }
    let origin = Vec3::new(-1.0, 0.3, 0.2);
    for (light, near, far) in [
        (Vec3::new(1.0, 0.5, 0.0), 0.0_f32, 4.0_f32),
        (Vec3::new(0.2, 0.31, 0.2), 0.0, 3.0),
        (Vec3::new(-3.0, 0.0, 1.0), 0.5, 2.5),
        (Vec3::new(9.0, 1.0, 1.0), 1.0, 5.0),
    ] {
        let law = distance::Equiangular::new(origin, Vec3::X, light, near, far).unwrap();
        interval(
            &format!("equiangular {light}"),
            [f64::from(near), f64::from(far)],
            SAMPLES,
            |u, _| Some(f64::from(law.sample(u.x)).clamp(f64::from(near), f64::from(far))),
            |t| f64::from(law.pdf(t as f32)),
        );
    }
}

#[test]
fn choices_and_what_they_leave_over() {
    let weights = [0.5_f32, 0.0, 3.0, 1.0, 0.25];
    let total: f32 = weights.iter().sum();
    // Index plus remainder: uniform within each entry.
    let density = |x: f64| f64::from(weights[(x as usize).min(4)] / total);
    interval(
        "choose",
        [0.0, 5.0],
        SAMPLES,
        |u, _| discrete::choose(weights.map(|w| (w, ())), u.x).map(|((), c)| c.index as f64 + f64::from(c.remainder)),
        density,
    );
    let mut table = weights;
    discrete::cumulate(&mut table);
    interval(
        "choose from a table",
        [0.0, 5.0],
        SAMPLES,
        |u, _| {
            let choice = discrete::choose_cumulated(&table, u.x);
            Some(choice.index as f64 + f64::from(choice.remainder))
        },
        density,
    );
    let mut cells: Vec<f32> = (0..8 * 4).map(|i| ((i * 7) % 5) as f32).collect();
    let mut column = [0.0; 4];
    let table = discrete::Table2::build(8, &mut cells, &mut column).unwrap();
    square("two-dimensional table", SAMPLES, |u, _| Some(table.sample(u).0), |p| f64::from(table.pdf(p)));
}

#[test]
fn phase_functions() {
    let mix = |parts: &[(Spectrum, Lobe)]| Phase::mix(parts.iter().map(|&(s, l)| (s, l.into()))).unwrap();
    let coloured = mix(&[
        (Spectrum::new(0.9, 0.2, 0.1), Lobe::HenyeyGreenstein { g: 0.8 }),
        (Spectrum::new(0.1, 0.4, 0.6), Lobe::Rayleigh),
        (Spectrum::new(0.0, 0.4, 0.3), Lobe::Schlick { k: -0.6 }),
    ]);
    let mut all: Vec<(String, Phase)> = [
        Lobe::Isotropic,
        Lobe::Rayleigh,
        Lobe::HenyeyGreenstein { g: 0.0 },
        Lobe::HenyeyGreenstein { g: 0.6 },
        Lobe::HenyeyGreenstein { g: -0.9 },
        Lobe::HenyeyGreenstein { g: 0.98 },
        Lobe::Schlick { k: 0.5 },
        Lobe::Schlick { k: -0.95 },
        Lobe::Draine { g: 0.0, alpha: 1.0 },
        Lobe::Draine { g: 5e-4, alpha: 2.0 },
        Lobe::Draine { g: 0.6, alpha: 27.0 },
        Lobe::Draine { g: -0.4, alpha: 1.5 },
    ]
    .map(|lobe| (format!("{lobe:?}"), lobe.into()))
    .to_vec();
    all.push(("coloured mixture".into(), coloured));
    for diameter in [5.0, 20.0, 50.0] {
        all.push((format!("droplets of {diameter} µm"), Phase::droplets(diameter).unwrap()));
    }
    for (name, phase) in all {
        // Bins about the direction straight on; backward peaks get theirs from the other end.
        let axis = if phase.mean_cosine()[0] < 0.0 { AXIS } else { -AXIS };
        let mut weights = (0.0, 0_u32);
        sphere(
            &name,
            axis,
            4.0,
            SAMPLES,
            |u, _| {
                let sample = phase.sample(AXIS, u);
                let exact = phase.pdf(deflection(sample.to_light, AXIS));
                assert!((sample.pdf / exact - 1.0).abs() < 2e-2, "{name}: {} is reported for {exact}", sample.pdf);
                weights = (weights.0 + f64::from(sample.weight[1]), weights.1 + 1);
                Some(sample.to_light)
            },
            |d| f64::from(phase.pdf(deflection(d, AXIS))),
        );
        // The weight turns the density into the channel's own value, which integrates to 1.
        let mean = weights.0 / f64::from(weights.1);
        assert!((mean - 1.0).abs() < 1e-2, "{name}: mean weight {mean}");
    }
}

#[test]
fn surfaces() {
    let to_eye = Vec3::new(0.6, 0.0, 0.8);
    let grey = Spectrum::splat;
    for (name, surface) in [
        ("Lambert", Surface::Lambert { reflectance: grey(0.7) }),
        ("Phong 5", Surface::Phong { diffuse: grey(0.4), specular: grey(0.5), exponent: 5.0 }),
        ("Phong 80", Surface::Phong { diffuse: grey(0.1), specular: grey(0.8), exponent: 80.0 }),
        ("Phong lobe", Surface::Phong { diffuse: grey(0.0), specular: grey(0.8), exponent: 30.0 }),
    ] {
        for normal in [Vec3::Z, Vec3::new(0.0, 0.6, 0.8)] {
            let axis =
                if name == "Lambert" { normal } else { (normal * (2.0 * normal.dot(to_eye)) - to_eye).normalize() };
            sphere(
                &format!("{name} about {normal}"),
                axis,
                2.0,
                SAMPLES,
                |u, rng| {
                    let sample = surface.sample(normal, to_eye, uniform(rng), u)?;
                    let exact = surface.pdf(normal, to_eye, sample.to_light);
                    // At grazing directions rounding of the direction shows in the cosine.
                    assert!((sample.pdf - exact).abs() <= 1e-3 * exact + 1e-5, "{name}: {} for {exact}", sample.pdf);
                    Some(sample.to_light)
                },
                |d| f64::from(surface.pdf(normal, to_eye, d)),
            );
        }
    }
}

/// Distance and normal where the direction meets a triangle.
fn meet([a, b, c]: [Vec3; 3], from: Vec3, direction: Vec3) -> Option<(f32, Vec3)> {
    let (e, f) = (b - a, c - a);
    let p = direction.cross(f);
    let inverse = 1.0 / e.dot(p);
    let s = from - a;
    let (u, q) = (s.dot(p) * inverse, s.cross(e));
    let (v, t) = (direction.dot(q) * inverse, f.dot(q) * inverse);
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then(|| (t, e.cross(f).normalize()))
}

/// Tests a light seen from a point: `surfaces` are the triangles a ray may meet.
fn check_light(
    name: &str,
    light: &Light<'_>,
    from: Vec3,
    axis: Vec3,
    power: f64,
    meet: impl Fn(Vec3) -> Option<(f32, Vec3)>,
) {
    sphere(
        name,
        axis.normalize(),
        power,
        SAMPLES,
        |u, _| {
            let sample = light.sample(from, u)?;
            let incident = sample.source.incident(from).unwrap();
            // The source carries one over the density: what it sends here is radiance over pdf.
            let ratio = incident.irradiance[0] / sample.incident.irradiance[0];
            assert!((ratio - 1.0).abs() < 2e-3, "{name}: source and sample differ by {ratio}");
            Some(sample.incident.to_light)
        },
        |d| meet(d).map_or(0.0, |(distance, normal)| f64::from(light.pdf(from, d, distance, normal))),
    );
}

#[test]
fn lights_with_extent() {
    let (corner, x, y) = (Vec3::new(-0.5, -0.7, 2.0), Vec3::new(0.0, 1.4, 0.0), Vec3::new(1.0, 0.0, 0.0));
    let quad = QuadLight::new(corner, x, y, Spectrum::ONE).unwrap();
    let slanted = QuadLight::new(corner, x, y + Vec3::new(0.0, 0.6, 0.2), Spectrum::ONE).unwrap();
    let halves = |corner: Vec3, x: Vec3, y: Vec3| {
        move |from: Vec3, d: Vec3| {
            meet([corner, corner + x, corner + y], from, d).or(meet([corner + x, corner + x + y, corner + y], from, d))
        }
    };
    for (name, quad, from, edge) in [
        ("quad far", quad, Vec3::new(0.5, 0.3, -3.0), y),
        ("quad near", quad, Vec3::new(0.1, 0.2, 1.6), y),
        ("quad aslant", quad, Vec3::new(2.0, 0.3, 1.2), y),
        ("slanted quad", slanted, Vec3::new(0.3, 0.2, 1.0), y + Vec3::new(0.0, 0.6, 0.2)),
    ] {
        let centre = corner + (x + edge) * 0.5;
        let hits = halves(corner, x, edge);
        // Wide lights fill the sphere, far ones a small part around the axis.
        let power = if name == "quad far" { 4.0 } else { 1.5 };
        check_light(name, &Light::Quad(quad), from, centre - from, power, |d| hits(from, d));
    }

    let ball = SphereLight::new(Vec3::new(0.0, 1.0, 2.0), 0.8, Spectrum::ONE).unwrap();
    for (name, from) in [("sphere far", Vec3::new(0.3, 0.0, -4.0)), ("sphere near", Vec3::new(0.0, 1.0, 1.1))] {
        let to_centre = ball.centre - from;
        let sine2 = 0.64 / to_centre.length_squared();
        // As for the cone: the border of the disc is a border of bins.
        let border = f64::from(1.0 - (1.0 - sine2).sqrt());
        let power = (border * 0.5).ln() / 0.25_f64.ln();
        check_light(name, &Light::Sphere(ball), from, to_centre, power, |d| {
            let below = 0.5 * f64::from((d - to_centre.normalize()).length_squared());
            (below <= border).then_some((1.0, -d))
        });
    }

    let (a, b, c, d) = (Vec3::ZERO, Vec3::new(1.0, 0.0, 0.2), Vec3::new(0.0, 1.0, -0.2), Vec3::new(1.2, 1.1, 0.4));
    let triangles = [Triangle { corners: [a, c, b] }, Triangle { corners: [b, c, d] }];
    let mut table = [0.0; 2];
    let mesh = MeshLight::new(&triangles, &mut table, Spectrum::ONE).unwrap();
    let from = Vec3::new(0.4, 0.4, -0.9);
    check_light("mesh", &Light::Mesh(mesh), from, Vec3::new(0.5, 0.5, 0.0) - from, 1.5, |direction| {
        triangles.iter().find_map(|t| meet(t.corners, from, direction))
    });

    // A closed body: of the sides that are turned away no sample is lost.
    let (o, x, y, z) = (Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z);
    let sides = [[o, y, x], [o, x, z], [o, z, y], [x, y, z]].map(|corners| Triangle { corners });
    let mut table = [0.0; 4];
    let body = Light::Mesh(MeshLight::new(&sides, &mut table, Spectrum::ONE).unwrap());
    let rng = &mut Generator::new(3);
    for from in [Vec3::new(-0.5, -0.4, 0.3), Vec3::new(0.8, 0.9, 1.1)] {
        assert!((0..1000).all(|_| body.sample(from, uniform2(rng)).is_some()), "from {from}");
        check_light("body", &body, from, Vec3::splat(0.25) - from, 1.5, |direction| {
            let front = |t: &&Triangle| t.cross().dot(direction) < 0.0;
            sides.iter().filter(front).find_map(|t| meet(t.corners, from, direction))
        });
    }
}

#[test]
fn lights_that_show_a_picture() {
    let (corner, x, y) = (Vec3::new(-0.5, -0.7, 2.0), Vec3::new(0.0, 1.4, 0.0), Vec3::new(1.0, 0.0, 0.3));
    let from = Vec3::new(0.1, 0.2, 1.2);
    for (name, is_triangle, is_smooth) in
        [("picture", false, false), ("smooth picture", false, true), ("triangle with a picture", true, false)]
    {
        // Of a triangle black beyond the diagonal.
        let texel = |i: usize| if is_triangle && i % 4 + i / 4 > 3 { 0.0 } else { 1.0 + 0.25 * ((i * 7) % 5) as f32 };
        let texels: Vec<Spectrum> = (0..16).map(|i| Spectrum::splat(texel(i))).collect();
        let (mut weights, mut column) = ([0.0; 16], [0.0; 4]);
        let image = LightImage::new(4, &texels, &mut weights, &mut column, is_smooth).unwrap();
        let light = PictureLight::new([corner, x, y], is_triangle, image).unwrap();
        let near = [corner, corner + x, corner + y];
        let far = [corner + x, corner + x + y, corner + y];
        check_light(name, &Light::Picture(&light), from, light.centre() - from, 1.5, |d| {
            meet(near, from, d).or_else(|| if is_triangle { None } else { meet(far, from, d) })
        });
    }
}

#[test]
fn environments() {
    let bright = Spectrum::new(1.0, 2.0, 3.0);
    check_light("constant", &Light::Constant(bright), Vec3::ONE, Vec3::Z, 1.0, |d| Some((f32::INFINITY, -d)));
    let (width, height) = (16, 9);
    let texels: Vec<Spectrum> = (0..width * height)
        .map(|i| Spectrum::splat(0.2 + ((i * 37) % 11) as f32 * if i == 70 { 20.0 } else { 1.0 }))
        .collect();
    let (mut weights, mut column) = (vec![0.0; width * height], vec![0.0; height]);
    let turn = Mat3::from_rotation_x(0.7) * Mat3::from_rotation_y(1.1);
    let map = EnvironmentMap::new(width, height, &texels, &mut weights, &mut column, turn).unwrap();
    check_light("environment map", &Light::Environment(&map), Vec3::ZERO, turn * Vec3::Y, 1.0, |d| {
        Some((f32::INFINITY, -d))
    });
}
