//! Light that leaves lights, and the walks of photons, against closed forms.

use fogbow::host::{Empty, Hit, Medium, Scene};
use fogbow::light::{
    Emission, EnvironmentMap, Light, LightImage, MeshLight, PhongLight, PictureLight, PointLight, Projector, QuadLight,
    SphereLight, SpotLight, Sun, Throw, Triangle,
};
use fogbow::math::{Bounds, Mat3, Ray, Vec2, Vec3, float::PI};
use fogbow::medium::{Homogeneous, Placed, Region};
use fogbow::path::Settings;
use fogbow::phase::{Lobe, Phase};
use fogbow::photon::{self, Event};
use fogbow::sampling::warp::{cosine_hemisphere_pdf, cosine_power_pdf, uniform_cone_pdf};
use fogbow::sampling::{Generator, uniform2};
use fogbow::spectrum::Spectrum;
use fogbow::surface::Surface;
use fogbow::world::World;
use fogbow_tests::chi_square;
use fogbow_tests::estimate::estimate;

const BOUNDS: Bounds = Bounds { min: Vec3::splat(-1.0), max: Vec3::new(1.0, 2.0, 1.5) };
const COLOUR: Spectrum = Spectrum([1.0, 2.0, 5.0]);

/// One light of every kind.
fn with_lights(mut check: impl FnMut(&str, &Light<'_>)) {
    let axis = Vec3::new(0.3, -1.0, 0.2);
    let at = Vec3::new(0.1, 3.0, -0.2);
    check("point", &Light::Point(PointLight::new(at, COLOUR).unwrap()));
    check("Phong", &Light::Phong(PhongLight::new(at, axis, 12.0, COLOUR).unwrap()));
    check("spot", &Light::Spot(SpotLight::new(at, axis, 0.2, 0.6, COLOUR).unwrap()));
    let quad = QuadLight::new(at, Vec3::X, Vec3::new(0.0, 0.2, 0.7), COLOUR).unwrap();
    check("quad", &Light::Quad(quad));
    check("sphere", &Light::Sphere(SphereLight::new(at, 0.4, COLOUR).unwrap()));
    let triangles = [
        Triangle { corners: [at, at + Vec3::X, at + Vec3::Z] },
        Triangle { corners: [at, at + Vec3::Y * 0.2, at + Vec3::X * 0.5] },
    ];
    let mut areas = [0.0; 2];
    check("mesh", &Light::Mesh(MeshLight::new(&triangles, &mut areas, COLOUR).unwrap()));
    let texels: Vec<Spectrum> = (0..8 * 6).map(|i| COLOUR * ((i * 29) % 7) as f32).collect();
    for (throw, is_smooth) in [(Throw::Screen, false), (Throw::Spot { beam: 0.2, cutoff: 0.5 }, true)] {
        let (mut weights, mut column) = (vec![0.0; texels.len()], vec![0.0; 6]);
        let image = LightImage::new(8, &texels, &mut weights, &mut column, is_smooth).unwrap();
        let frame = Mat3::from_rotation_x(1.3);
        let lamp = Projector::new(at, frame, Vec2::new(0.7, 0.4), throw, image).unwrap();
        check(if is_smooth { "textured spot" } else { "projector" }, &Light::Projector(&lamp));
        let sign = PictureLight::new([at, Vec3::X, Vec3::new(0.0, 0.2, 0.7)], false, image).unwrap();
        check(if is_smooth { "smooth picture" } else { "picture" }, &Light::Picture(&sign));
    }
    // Of a triangle, black beyond the diagonal.
    let texels: Vec<Spectrum> = (0..36).map(|i| if i % 6 + i / 6 < 6 { texels[i] } else { Spectrum::ZERO }).collect();
    let (mut weights, mut column) = (vec![0.0; 36], vec![0.0; 6]);
    let image = LightImage::new(6, &texels, &mut weights, &mut column, false).unwrap();
    let sign = PictureLight::new([at, Vec3::X, Vec3::new(0.3, 0.2, 0.7)], true, image).unwrap();
    check("triangle with a picture", &Light::Picture(&sign));
    check("sun", &Light::Sun(Sun::new(-axis, COLOUR).unwrap()));
    check("constant", &Light::Constant(COLOUR));
    let texels: Vec<Spectrum> = (0..16 * 8).map(|i| COLOUR * (0.2 + ((i * 37) % 11) as f32)).collect();
    let (mut weights, mut column) = (vec![0.0; texels.len()], vec![0.0; 8]);
    let map = EnvironmentMap::new(16, 8, &texels, &mut weights, &mut column, Mat3::from_rotation_x(0.4)).unwrap();
    check("environment", &Light::Environment(&map));
}

fn emit(light: &Light<'_>, rng: &mut Generator) -> Option<Emission> {
    let position = uniform2(rng);
    light.emit(&BOUNDS, position, uniform2(rng))
}

#[test]
fn mean_emitted_power_is_the_power_of_the_light() {
    with_lights(|name, light| {
        let truth = light.power(&BOUNDS).0.map(f64::from);
        // The mean of an image is a sum over texels, that of its interpolant a little different.
        let floor = if matches!(name, "environment" | "textured spot" | "smooth picture") { 0.05 } else { 1e-5 };
        let mean = estimate(20_000, |rng| emit(light, rng).map_or(Spectrum::ZERO, |e| e.power));
        mean.assert_is(truth, floor, name);
    });
}

#[test]
fn emitted_light_falls_on_a_probe_as_connections_say() {
    // A disc of radius 0.3 within the bounds, looking up.
    let (centre, normal, radius) = (Vec3::new(0.2, 0.1, 0.0), Vec3::new(0.1, 1.0, -0.2).normalize(), 0.3_f32);
    let frame = fogbow::math::Frame::around(normal);
    with_lights(|name, light| {
        let sent = estimate(400_000, |rng| {
            let Some(emission) = emit(light, rng) else { return Spectrum::ZERO };
            let down = -normal.dot(emission.ray.direction);
            let distance = normal.dot(emission.ray.origin - centre) / down;
            let hits = down > 0.0 && distance > 0.0 && emission.ray.at(distance).distance(centre) < radius;
            if hits { emission.power * (1.0 / (PI * radius * radius)) } else { Spectrum::ZERO }
        });
        let fetched = estimate(400_000, |rng| {
            let u = uniform2(rng);
            let (sin, cos) = (2.0 * PI * u.y).sin_cos();
            let point = centre + frame.to_world(Vec3::new(cos, sin, 0.0)) * (radius * u.x.sqrt());
            match light.sample(point, uniform2(rng)) {
                Some(sample) => sample.incident.irradiance * normal.dot(sample.incident.to_light).max(0.0),
                None => Spectrum::ZERO,
            }
        });
        for c in 0..3 {
            let allowed = 4.5 * (sent.error[c].powi(2) + fetched.error[c].powi(2)).sqrt() + 1e-4 * fetched.mean[c];
            assert!((sent.mean[c] - fetched.mean[c]).abs() < allowed, "{name}: {sent:?} {fetched:?}");
            assert!(sent.error[c] < 0.05 * sent.mean[c], "{name}: {sent:?} proves nothing");
        }
    });
}

/// Rays that pass the world by are lost.
#[test]
fn light_from_afar_comes_to_the_bounds_from_outside() {
    let bounds = Bounds { min: Vec3::new(-4.0, 0.0, 1.0), max: Vec3::new(4.0, 1.0, 3.0) };
    let mut rng = Generator::new(3);
    for light in [Light::Constant(COLOUR), Light::Sun(Sun::new(Vec3::new(0.3, 0.9, -0.2), COLOUR).unwrap())] {
        let mut sum = Spectrum::ZERO;
        for _ in 0..2000 {
            let emission = light.emit(&bounds, uniform2(&mut rng), uniform2(&mut rng)).unwrap();
            let (near, far) = bounds.intersect(&emission.ray).expect("a ray that meets nothing");
            assert!(near > 0.0 && far >= near, "{emission:?}");
            sum += emission.power * (1.0 / 2000.0);
        }
        assert!((sum[1] / light.power(&bounds)[1] - 1.0).abs() < 0.02, "{sum:?}");
    }
}

#[test]
fn directions_leave_as_their_densities_say() {
    let axis = Vec3::new(0.6, 0.0, -0.8);
    let phong = Light::Phong(PhongLight::new(Vec3::ZERO, axis, 9.0, COLOUR).unwrap());
    let spot = Light::Spot(SpotLight::new(Vec3::ZERO, axis, 0.1, 0.5 * PI, COLOUR).unwrap());
    let edge = Vec3::new(0.8, 0.0, 0.6);
    let quad = Light::Quad(QuadLight::new(Vec3::ZERO, edge.cross(axis), edge, COLOUR).unwrap());
    // A cone that ends at a border of bins.
    let below = 1.0 - (0.5 * PI).cos();
    type Density<'a> = (&'a str, &'a Light<'a>, &'a dyn Fn(f32) -> f32);
    let densities: [Density<'_>; 3] = [
        ("emitted, Phong", &phong, &|c| cosine_power_pdf(c, 9.0)),
        ("emitted, spot", &spot, &|c| if 1.0 - c < below { uniform_cone_pdf(below) } else { 0.0 }),
        ("emitted, quad", &quad, &cosine_hemisphere_pdf),
    ];
    for (name, light, density) in densities {
        // The quad's normal is ± the axis.
        let towards = emit(light, &mut Generator::new(1)).unwrap().normal.unwrap_or(axis);
        chi_square::sphere(
            name,
            towards,
            1.0,
            200_000,
            |u, rng| light.emit(&BOUNDS, uniform2(rng), u).map(|e| e.ray.direction),
            |direction| f64::from(density(towards.dot(direction))),
        );
    }
}

// ---------------------------------------------------------------------------------------------
// Walks

/// Mean over walks of what `visit` adds up.
fn walks<M: Medium, S: Scene>(
    paths: u32,
    world: &World<'_, M, S>,
    settings: &Settings,
    visit: impl Fn(&Event<'_>) -> Spectrum,
) -> fogbow_tests::estimate::Estimate {
    estimate(paths, |rng| {
        let mut sum = Spectrum::ZERO;
        photon::trace(world, &BOUNDS, settings, rng, &mut |event| sum += visit(event));
        sum
    })
}

#[test]
fn fluence_around_a_lamp_in_absorbing_fog_follows_the_closed_form() {
    let absorption = Spectrum::new(0.5, 1.0, 2.0);
    let fog = Homogeneous::new(absorption, Spectrum::ZERO, Phase::ISOTROPIC).unwrap();
    let lamp = [Light::Point(PointLight::from_flux(Vec3::ZERO, COLOUR).unwrap())];
    let world = World { medium: &fog, scene: &Empty, lights: (&lamp).into() };
    for (near, far) in [(0.0_f32, 0.3_f32), (0.5, 1.0), (2.0, 4.0)] {
        // ∫ Φ dV of a shell = P (e^−σr₀ − e^−σr₁)/σ, all flights being straight.
        let truth = [0, 1, 2].map(|c| {
            let (s, p) = (f64::from(absorption[c]), f64::from(COLOUR[c]));
            p * ((-s * f64::from(near)).exp() - (-s * f64::from(far)).exp()) / s
        });
        // Collisions over extinction: holds channel by channel, which lengths of flights in coloured fog do not.
        let found = walks(60_000, &world, &Settings::default(), |event| match *event {
            Event::Collided { point, power, properties, .. } if (near..far).contains(&point.length()) => {
                power.ratio(properties.extinction())
            }
            _ => Spectrum::ZERO,
        });
        found.assert_is(truth, 1e-5, &format!("{near} to {far} m"));
    }
}

#[test]
fn photons_are_absorbed_where_diffusion_exactly_says() {
    // Of a lamp's power all is absorbed, and ⟨r²⟩ = 2/(σₜ² (1 − ϖ)(1 − ϖ g)) where.
    let (extinction, albedo) = (2.0_f32, 0.8_f32);
    for g in [0.0_f32, 0.5, -0.3] {
        let fog = Homogeneous::new(
            Spectrum::splat(extinction * (1.0 - albedo)),
            Spectrum::splat(extinction * albedo),
            Lobe::HenyeyGreenstein { g },
        )
        .unwrap();
        let lamp = [Light::Point(PointLight::from_flux(Vec3::ZERO, Spectrum::ONE).unwrap())];
        let world = World { medium: &fog, scene: &Empty, lights: (&lamp).into() };
        for roulette_after in [0, 5] {
            let settings = Settings { roulette_after, ..Settings::default() };
            let share = 1.0 - albedo;
            let power = walks(20_000, &world, &settings, |event| match *event {
                Event::Collided { power, .. } => power * share,
                _ => Spectrum::ZERO,
            });
            power.assert_is([1.0; 3], 1e-4, &format!("absorbed, g = {g}"));
            let square = walks(60_000, &world, &settings, |event| match *event {
                Event::Collided { power, point, .. } => power * (share * point.length_squared()),
                _ => Spectrum::ZERO,
            });
            let truth = 2.0 / f64::from(extinction * extinction * (1.0 - albedo) * (1.0 - albedo * g));
            square.assert_is([truth; 3], 1e-4, &format!("mean square, g = {g}"));
            // The same by lengths of flights.
            let length = walks(20_000, &world, &settings, |event| match *event {
                Event::Flew { distance, power, .. } => power * distance,
                _ => Spectrum::ZERO,
            });
            length.assert_is([f64::from(1.0 / (extinction * share)); 3], 1e-4, &format!("length, g = {g}"));
        }
    }
}

type Window<'a> = &'a dyn Fn(Vec3) -> Option<f32>;

/// Whatever windows ask for, right, too low or too high, or nothing that makes sense, light stays the same; the right ones find what hardly a whole photon does.
#[test]
#[ignore = "long: tests/acceptance/long.sh"]
fn photons_in_parts_bring_the_same_light_also_where_it_is_dark() {
    let (extinction, albedo) = (2.0_f32, 0.8_f32);
    let share = 1.0 - albedo;
    let fog =
        Homogeneous::new(Spectrum::splat(extinction * share), Spectrum::splat(extinction * albedo), Phase::ISOTROPIC);
    let lamp = [Light::Point(PointLight::from_flux(Vec3::ZERO, Spectrum::ONE).unwrap())];
    let world = World { medium: &fog.unwrap(), scene: &Empty, lights: (&lamp).into() };
    let parts = |paths, window: Window<'_>, visit: &dyn Fn(Vec3) -> f32| {
        estimate(paths, |rng| {
            let mut sum = Spectrum::ZERO;
            photon::trace_split(&world, &BOUNDS, &Settings::default(), window, rng, &mut |event| {
                if let Event::Collided { power, point, .. } = *event {
                    sum += power * (share * visit(point));
                }
            });
            sum
        })
    };
    // Light falls off as e^−κr, with κ = 0.71 σ where so much is absorbed.
    let right = |at: Vec3| Some((-0.71 * extinction * at.length()).exp());
    let windows: [(&str, Window<'_>); 7] = [
        ("right", &right),
        ("falling too fast", &|at| Some((-0.8 * extinction * at.length()).exp())),
        ("too low", &|_| Some(0.05)),
        ("too high", &|_| Some(5.0)),
        ("unknown here and there", &|at| (at.x > 0.0).then_some(0.3)),
        ("none", &|_| None),
        ("no positive number", &|at| Some(if at.x > 0.0 { -1.0 } else { at.y.sqrt() / 0.0 })),
    ];
    let square = 2.0 / f64::from(extinction * extinction * share);
    for (name, window) in windows {
        parts(500, window, &|_| 1.0).assert_is([1.0; 3], 1e-4, &format!("absorbed, {name}"));
        parts(2_000, window, &|at| at.length_squared()).assert_is([square; 3], 1e-4, &format!("mean square, {name}"));
    }
    let far = |at: Vec3| f32::from(u8::from(at.length() > 5.0));
    let (split, whole) = (parts(4_000, &right, &far), parts(100_000, &|_| None, &far));
    let [split_noise, whole_noise] = [(&split, 4_000.0), (&whole, 100_000.0_f64)]
        .map(|(found, paths)| found.error[0] / found.mean[0] * paths.sqrt());
    assert!(split_noise < 0.25 * whole_noise, "of one photon: {split_noise} {whole_noise}");
    let error = (split.error[0].powi(2) + whole.error[0].powi(2)).sqrt();
    assert!((split.mean[0] - whole.mean[0]).abs() < 4.0 * error, "{} {} {error}", split.mean[0], whole.mean[0]);
}

/// What neither absorbs nor lets go ends all the same.
#[test]
fn photons_in_parts_end() {
    let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC).unwrap();
    let lamp = [Light::Point(PointLight::from_flux(Vec3::ZERO, Spectrum::ONE).unwrap())];
    let world = World { medium: &fog, scene: &Empty, lights: (&lamp).into() };
    let mut flights = 0_u64;
    photon::trace_split(&world, &BOUNDS, &Settings::default(), &|_| Some(1e-6), &mut Generator::new(3), &mut |event| {
        flights += u64::from(matches!(event, Event::Flew { .. }));
    });
    assert!((100_000..10_000_000).contains(&flights), "{flights}");
}

#[test]
fn fog_that_only_scatters_is_filled_evenly_by_a_uniform_sky() {
    let ball = Region::sphere(BOUNDS.centre(), 0.9).unwrap();
    let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::splat(1.5), Lobe::HenyeyGreenstein { g: 0.4 }).unwrap();
    let fog = Placed::new(fog, ball);
    let sky = [Light::Constant(COLOUR)];
    let world = World { medium: &fog, scene: &Empty, lights: (&sky).into() };
    let found = walks(60_000, &world, &Settings::default(), |event| match *event {
        Event::Collided { power, properties, .. } => power.ratio(properties.extinction()),
        _ => Spectrum::ZERO,
    });
    // Φ = 4π L everywhere.
    let volume = 4.0 / 3.0 * std::f64::consts::PI * 0.9_f64.powi(3);
    found.assert_is(COLOUR.0.map(|c| 4.0 * std::f64::consts::PI * volume * f64::from(c)), 1e-4, "∫ Φ dV");
}

/// A plane z = 0 of some surface.
struct Floor(Surface);

impl Scene for Floor {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let distance = -ray.origin.z / ray.direction.z;
        let is_hit = distance > 0.0 && distance < ray.length;
        is_hit.then_some(Hit { distance, normal: Vec3::Z, shading: Vec3::Z, surface: self.0, light: None })
    }
}

#[test]
fn surfaces_pass_on_power_and_not_radiance() {
    let lamp = [Light::Point(PointLight::from_flux(Vec3::Z, Spectrum::ONE).unwrap())];
    let surfaces = [
        Surface::Dielectric { eta: 1.5, reflectance: Spectrum::ONE, transmittance: Spectrum::ONE },
        Surface::Dielectric { eta: 0.7, reflectance: Spectrum::ONE, transmittance: Spectrum::ONE },
        Surface::Mirror { reflectance: Spectrum::ONE },
        Surface::Lambert { reflectance: Spectrum::ONE },
    ];
    let settings = Settings { roulette_after: 100, ..Settings::default() };
    for surface in surfaces {
        let floor = Floor(surface);
        let world = World { medium: &Empty, scene: &floor, lights: (&lamp).into() };
        for seed in 0..200 {
            let mut powers = Vec::new();
            photon::trace(&world, &BOUNDS, &settings, &mut Generator::new(seed), &mut |event| match *event {
                Event::Flew { power, .. } => powers.push(power[0]),
                Event::Met { outgoing, .. } => assert!(outgoing.is_some()),
                _ => {}
            });
            assert!((1..=2).contains(&powers.len()) && powers.iter().all(|p| (p - 1.0).abs() < 1e-5), "{powers:?}");
        }
    }
}

#[test]
fn flights_reach_through_null_interfaces_and_say_where_they_met() {
    let lamp = [Light::Sun(Sun::new(Vec3::Z, Spectrum::ONE).unwrap())];
    let fog = Homogeneous::new(Spectrum::splat(3.0), Spectrum::ZERO, Phase::ISOTROPIC).unwrap();
    for (surface, is_endless) in [(Surface::Null, true), (Surface::BLACK, false)] {
        let floor = Floor(surface);
        let world = World { medium: &fog, scene: &floor, lights: (&lamp).into() };
        let mut flights = 0;
        for seed in 0..500 {
            photon::trace(
                &world,
                &BOUNDS,
                &Settings::default(),
                &mut Generator::new(seed),
                &mut |event| match *event {
                    Event::Flew { reach, distance, .. } => {
                        flights += 1;
                        assert_eq!(reach.length.is_infinite(), is_endless);
                        assert!(distance <= reach.length);
                    }
                    Event::Met { point, hit, .. } => {
                        assert!(point.z.abs() < 1e-5 && hit.surface == surface, "{point}");
                    }
                    _ => {}
                },
            );
        }
        assert_eq!(flights, 500);
    }
}

#[test]
fn no_walk_is_longer_than_the_settings_allow() {
    let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC).unwrap();
    let lamp = [Light::Point(PointLight::from_flux(Vec3::ZERO, Spectrum::ONE).unwrap())];
    let world = World { medium: &fog, scene: &Empty, lights: (&lamp).into() };
    for max_scatterings in [0, 1, 2, 5] {
        let settings = Settings { max_scatterings, ..Settings::default() };
        let mut flights = 0;
        photon::trace(&world, &BOUNDS, &settings, &mut Generator::new(3), &mut |event| {
            flights += u32::from(matches!(event, Event::Flew { .. }));
        });
        assert!(flights <= max_scatterings && (flights > 0) == (max_scatterings > 0), "{max_scatterings}: {flights}");
    }
}
