//! Photon beams against closed forms, brute force and the path tracer.

use core::num::NonZero;

use fogbow::beams::{BeamOutput, BeamPass, BeamPassError, Beams, Piece, Settings, kernel, pieces, shoot};
use fogbow::host::{Empty, Hit, Medium, Rng, Scene};
use fogbow::light::{Light, PointLight, QuadLight};
use fogbow::math::{Bounds, Ray, Vec3, float::PI};
use fogbow::medium::Homogeneous;
use fogbow::path;
use fogbow::phase::{Lobe, Phase};
use fogbow::sampling::warp::uniform_sphere;
use fogbow::sampling::{Generator, uniform, uniform2};
use fogbow::spectrum::Spectrum;
use fogbow::surface::Surface;
use fogbow::work;
use fogbow::world::{Outline, World};
use fogbow_std::film::Film;
use fogbow_std::progress::Control;
use fogbow_std::progressive::{self, ProgressiveError};
use fogbow_std::seed::SampleRng;
use fogbow_std::tiles;
use fogbow_tests::estimate::estimate;
use fogbow_tests::hosts::{Analytic, Body, Field, Filled};
use proptest::prelude::*;

fn fog(absorption: f32, scattering: f32, g: f32) -> Homogeneous {
    Homogeneous::new(Spectrum::splat(absorption), Spectrum::splat(scattering), Lobe::HenyeyGreenstein { g }).unwrap()
}

fn beam(origin: Vec3, direction: Vec3, length: f32, rate: f32) -> Piece {
    let (power, rate) = (Spectrum::ONE, Spectrum::splat(rate));
    Piece { origin, length, direction, power, rate, radius: 0.1, ..Piece::default() }
}

fn single(piece: Piece) -> Beams<'static> {
    let mut beams = Beams::new(Vec::new(), Vec::new());
    beams.push(piece).unwrap();
    beams.build(1).unwrap();
    beams
}

fn seen(beams: &Beams<'_>, medium: &impl Medium, ray: &Ray, radius: f32) -> f64 {
    let mut wide = Beams::new(Vec::new(), Vec::new());
    for piece in beams.pieces() {
        wide.push(Piece { radius, ..*piece }).unwrap();
    }
    wide.build(1).unwrap();
    let found = wide.gather(ray, medium, u32::MAX, &mut Generator::new(5));
    let light = found.light.single + found.light.multiple;
    assert!(light.is_valid(), "{light:?}");
    f64::from(light[0])
}

#[test]
fn a_narrow_beam_scatters_what_the_line_integral_says() {
    let (absorption, scattering, g) = (0.3_f32, 0.5_f32, 0.6_f32);
    let fog = fog(absorption, scattering, g);
    let extinction = absorption + scattering;
    let beams = single(beam(Vec3::ZERO, Vec3::Z, 3.0, extinction));
    let radius = 0.01;
    for angle in [0.05_f32, 0.4, 1.2, 1.570_796_4, 2.5, 3.0] {
        // Towards the beam's point at 1.5 m, whose plane with the eye ray is x = 0, from 2 m away.
        let direction = Vec3::new(0.0, angle.sin(), angle.cos());
        let crossing = Vec3::Z * 1.5;
        let origin = crossing - direction * 2.0;
        // ∫ over the eye's offset across that plane: the blur is gone, `1/sin` is left.
        const STEPS: u32 = 200;
        let mut sum = 0.0;
        for i in 0..STEPS {
            let offset = (i as f32 + 0.5) / STEPS as f32 * 2.0 * radius - radius;
            sum += seen(&beams, &fog, &Ray { origin: origin + Vec3::X * offset, direction, length: 4.0 }, radius);
        }
        let found = sum * 2.0 * f64::from(radius) / f64::from(STEPS);
        // Light travels along +z and leaves against the eye ray's direction.
        let phase = Phase::from(Lobe::HenyeyGreenstein { g }).value(fogbow::phase::deflection(-Vec3::Z, -direction))[0];
        let attenuation = (-extinction * (1.5 + 2.0)).exp();
        let expected = f64::from(scattering * phase * attenuation / angle.sin());
        // The blur's own error: a/2 (k r/sin θ)², where light fades by at most k = 2σ along the eye ray.
        let blur = 0.5 * kernel::SECOND_MOMENT * (2.0 * extinction * radius / angle.sin()).powi(2);
        let allowed = 2e-3 + f64::from(blur);
        assert!((found / expected - 1.0).abs() < allowed, "{angle}: {found} instead of {expected}");
    }
}

#[test]
fn looking_along_a_beam_sees_a_finite_cylinder() {
    let (scattering, radius) = (1.0_f32, 0.02_f32);
    let fog = fog(0.0, scattering, 0.0);
    let beams = single(beam(Vec3::ZERO, Vec3::Z, 2.0, scattering));
    // Light that flies away and comes back is attenuated twice.
    let centre = 3.0 / (PI * radius * radius);
    let expected = f64::from(centre * (1.0 - (-4.0_f32).exp()) / 2.0 / (4.0 * PI));
    let along = seen(&beams, &fog, &Ray::new(Vec3::ZERO, Vec3::Z), radius);
    assert!((along / expected - 1.0).abs() < 2e-3, "{along} instead of {expected}");
    // From the other end light comes towards the eye: e^−σ(2−t) e^−σt, the same everywhere.
    let towards = seen(&beams, &fog, &Ray::new(Vec3::Z * 2.0, -Vec3::Z), radius);
    let expected = f64::from(centre * 2.0 * (-2.0_f32).exp() / (4.0 * PI));
    assert!((towards / expected - 1.0).abs() < 2e-3, "{towards} instead of {expected}");
    // Nothing jumps as the angle goes to 0.
    for exponent in 3..12 {
        let angle = 10.0_f32.powi(-exponent);
        let tilted = seen(&beams, &fog, &Ray::new(Vec3::ZERO, Vec3::new(angle, 0.0, 1.0).normalize()), radius);
        let allowed = 2e-3 + 6.0 * f64::from(angle / radius).powi(2);
        assert!((tilted / along - 1.0).abs() < allowed, "angle {angle}: {tilted} instead of {along}");
    }
    // Beside the cylinder there is nothing.
    assert_eq!(seen(&beams, &fog, &Ray::new(Vec3::X * 0.021, Vec3::Z), radius), 0.0);
}

#[test]
fn a_blurred_beam_is_seen_in_full_from_within() {
    let fog = fog(0.0, 1e-4, 0.0);
    let beams = single(beam(Vec3::new(0.0, 0.0, -1.0), Vec3::Z, 2.0, 0.0));
    // Two halves of the chord through the axis.
    let whole = seen(&beams, &fog, &Ray { origin: Vec3::NEG_X, direction: Vec3::X, length: 2.0 }, 0.3);
    let half = seen(&beams, &fog, &Ray::new(Vec3::ZERO, Vec3::X), 0.3);
    assert!((half / whole - 0.5).abs() < 1e-3, "{half} of {whole}");
}

#[test]
fn degenerate_beams_and_rays_give_numbers() {
    let fog = fog(0.1, 1.0, 0.9);
    let mut beams = Beams::new(Vec::new(), Vec::new());
    let ray = Ray::new(Vec3::ZERO, Vec3::Z);
    assert_eq!(seen(&beams, &fog, &ray, 0.1), 0.0);
    let good = beam(Vec3::ZERO, Vec3::Z, 1.0, 1.0);
    let bad = [
        Piece { length: 0.0, ..good },
        Piece { length: f32::NAN, ..good },
        Piece { length: f32::INFINITY, ..good },
        Piece { power: Spectrum::ZERO, ..good },
        Piece { power: Spectrum::splat(f32::NAN), ..good },
        Piece { origin: Vec3::NAN, ..good },
    ];
    for piece in bad {
        beams.push(piece).unwrap();
    }
    assert!(beams.pieces().is_empty());
    for direction in [Vec3::X, Vec3::Z, -Vec3::Z, Vec3::new(0.6, 0.0, 0.8)] {
        for length in [1e-30, 1e-6, 1.0, 1e4] {
            beams.push(beam(Vec3::ZERO, direction, length, 1.0)).unwrap();
        }
    }
    beams.build(3).unwrap();
    for direction in [Vec3::X, Vec3::Z, -Vec3::Z, Vec3::Y, Vec3::new(1e-7, 0.0, 1.0).normalize()] {
        for origin in [Vec3::ZERO, Vec3::new(0.0, 0.0, 0.5), Vec3::X * 1e-7, Vec3::splat(1e4)] {
            for length in [0.0, 1e-20, 1.0, f32::INFINITY] {
                for radius in [1e-12, 1e-4, 0.1, 1e3] {
                    seen(&beams, &fog, &Ray { origin, direction, length }, radius);
                }
            }
        }
    }
    beams.build(0).unwrap();
    assert_eq!(beams.gather(&ray, &fog, u32::MAX, &mut Generator::new(5)).light.single, Spectrum::ZERO);
}

fn random_beams(seed: u64, count: u32) -> Vec<Piece> {
    let mut rng = Generator::new(seed);
    let mut number = || uniform(&mut rng) * 2.0 - 1.0;
    (0..count)
        .map(|i| {
            let origin = Vec3::new(number(), number(), number());
            let direction =
                if i % 7 == 0 { Vec3::Y } else { Vec3::new(number(), number(), number() + 1e-3).normalize() };
            // Of different widths.
            let radius = 0.02 + 0.1 * (i % 5) as f32;
            Piece { scatterings: i % 3, radius, ..beam(origin, direction, (number() + 1.001) * 0.7, 0.5) }
        })
        .collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn the_tree_finds_what_a_look_at_every_beam_finds(seed in 0u64..1 << 40, count in 1u32..120, radius in 0.01f32..0.6) {
        let fog = fog(0.2, 0.7, 0.3);
        let all = random_beams(seed, count);
        let mut beams = Beams::new(Vec::new(), Vec::new());
        all.iter().for_each(|&piece| beams.push(piece).unwrap());
        beams.build(1).unwrap();
        let mut rng = Generator::new(seed ^ 9);
        let direction = uniform_sphere(uniform2(&mut rng));
        let ray = Ray { origin: -direction * 2.0 + Vec3::X * 0.1, direction, length: 1.0 + 3.0 * uniform(&mut rng) };
        let brute: f64 = all.iter().map(|&piece| seen(&single(piece), &fog, &ray, radius)).sum();
        let found = seen(&beams, &fog, &ray, radius);
        prop_assert!((found - brute).abs() <= 1e-4 * brute, "{found} {brute}");
        // Each with a radius of its own.
        let light = |beams: &Beams<'_>| beams.gather(&ray, &fog, u32::MAX, &mut Generator::new(5)).light;
        let brute: f32 = all.iter().map(|&piece| light(&single(piece))).map(|l| (l.single + l.multiple)[0]).sum();
        let found = light(&beams);
        prop_assert!(((found.single + found.multiple)[0] - brute).abs() <= 1e-4 * brute);
    }
}

#[test]
fn lent_storage_that_is_too_small_says_so() {
    let all = random_beams(1, 40);
    let (mut slots, mut nodes) = (vec![Piece::default(); 40], vec![fogbow::beams::BeamNode::default(); 41]);
    let mut beams = Beams::new(&mut slots[..], &mut nodes[..]);
    all.iter().for_each(|&piece| beams.push(piece).unwrap());
    assert!(beams.push(all[0]).is_err());
    beams.build(1).unwrap();
    let mut few = [fogbow::beams::BeamNode::default(); 3];
    let mut slots = vec![Piece::default(); 40];
    let mut beams = Beams::new(&mut slots[..], &mut few[..]);
    all.iter().for_each(|&piece| beams.push(piece).unwrap());
    assert!(beams.build(1).is_err());
    let found = beams.gather(&Ray::new(Vec3::NEG_Z, Vec3::Z), &fog(0.0, 1.0, 0.0), u32::MAX, &mut Generator::new(5));
    assert_eq!(found.pieces, 0);
}

#[test]
fn pieces_carry_the_transmittance_on_average() {
    let tint = Spectrum::new(0.5, 1.0, 1.7);
    let bump = Field::Gaussian { a: 0.2, k: 3.0, c: Vec3::new(0.1, 0.2, 1.0), s: 0.4 };
    let medium = Analytic { tint, ..Analytic::grey(bump, 0.8) };
    let reach = Ray { origin: Vec3::ZERO, direction: Vec3::Z, length: 3.0 };
    // Optical thickness by a fine sum.
    let thickness = |to: f32| -> f64 {
        (0..4000)
            .map(|i| f64::from(bump.at(Vec3::Z * to * ((i as f32 + 0.5) / 4000.0)).0) * f64::from(to) / 4000.0)
            .sum()
    };
    for to in [0.3_f32, 1.0, 2.9] {
        let found = estimate(40_000, |rng| {
            let mut power = Spectrum::ZERO;
            pieces(&medium, &reach, Spectrum::ONE, 0.25, rng, &mut |piece| {
                let along = to - piece.origin.z;
                if along >= 0.0 && along < piece.length {
                    power += piece.power * (piece.rate * along).transmitted();
                }
            });
            power
        });
        let tau = thickness(to);
        found.assert_is(tint.0.map(|t| (-f64::from(t) * tau).exp()), 1e-4, &format!("at {to} m"));
    }
}

#[test]
fn endless_beams_end() {
    let thin = fog(0.0, 1e-3, 0.0);
    let lamp = [Light::Point(PointLight::from_flux(Vec3::ZERO, Spectrum::ONE).unwrap())];
    let world = World { medium: &thin, scene: &Empty, lights: (&lamp).into() };
    let bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
    let settings = path::Settings { max_scatterings: 1, ..path::Settings::default() };
    let mut count = 0;
    shoot(&world, &bounds, &settings, 10.0, &mut Generator::new(2), &mut |piece| {
        assert!(piece.power.is_finite() && piece.length <= 10.0);
        count += 1;
    });
    assert!((100..5000).contains(&count), "{count}");
}

// ---------------------------------------------------------------------------------------------
// A small room

/// A floor at y = −1 and the lamp's own rectangle at y = 1.
struct Room;

impl Scene for Room {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let plane = |y: f32| {
            let distance = (y - ray.origin.y) / ray.direction.y;
            (distance > 0.0 && distance < ray.length).then_some(distance)
        };
        let floor = plane(-1.0).map(|distance| Hit {
            distance,
            normal: Vec3::Y,
            shading: Vec3::Y,
            surface: Surface::Lambert { reflectance: Spectrum::new(0.7, 0.5, 0.3) },
            light: None,
        });
        let lamp = plane(1.0).filter(|&t| ray.at(t).x.abs() < 0.4 && ray.at(t).z.abs() < 0.4).map(|distance| Hit {
            distance,
            normal: Vec3::NEG_Y,
            shading: Vec3::NEG_Y,
            surface: Surface::BLACK,
            light: (ray.direction.y > 0.0).then_some(0),
        });
        [floor, lamp].into_iter().flatten().min_by(|a, b| a.distance.total_cmp(&b.distance))
    }
}

const SIDE: u32 = 12;
const BLOCK: u32 = 4;
const BOUNDS: Bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };

fn lamp() -> [Light<'static>; 1] {
    let (corner, edge) = (Vec3::new(-0.4, 1.0, -0.4), 0.8);
    [Light::Quad(QuadLight::new(corner, Vec3::X * edge, Vec3::Z * edge, Spectrum::new(4.0, 5.0, 6.0)).unwrap())]
}

fn eye_ray(x: f32, y: f32) -> Ray {
    let target = Vec3::new(x / SIDE as f32 * 2.0 - 1.0, 1.0 - y / SIDE as f32 * 2.0, 0.0);
    Ray::between(Vec3::new(0.0, 0.1, 4.0), target).with_length(f32::INFINITY)
}

const NAMES: [&str; 6] = ["total", "emitted", "surface_direct", "surface_indirect", "medium_single", "medium_multiple"];

fn write(seen: &path::Radiance, layers: &mut [Spectrum]) {
    let parts = [
        seen.total(),
        seen.emitted,
        seen.surface_direct,
        seen.surface_indirect,
        seen.medium_single,
        seen.medium_multiple,
    ];
    layers.copy_from_slice(&parts);
}

/// Means over blocks of pixels, layer by layer.
fn blocks(film: &Film) -> Vec<f64> {
    let side = SIDE / BLOCK;
    let mut sums = vec![0.0; NAMES.len() * (side * side) as usize];
    for layer in 0..NAMES.len() {
        for (i, pixel) in film.mean(layer).unwrap().pixels.iter().enumerate() {
            let (x, y) = (i as u32 % SIDE / BLOCK, i as u32 / SIDE / BLOCK);
            sums[layer * (side * side) as usize + (y * side + x) as usize] += f64::from(pixel.mean());
        }
    }
    sums
}

fn usual() -> Settings {
    Settings::for_outline(&Outline::of(&World { medium: &Empty, scene: &Empty, lights: (&[]).into() }, BOUNDS))
}

fn render(
    film: &mut Film,
    tiles: &tiles::Settings,
    settings: &Settings,
    world: &World<'_, impl Medium + Sync, impl Scene + Sync>,
) -> Result<tiles::Outcome, ProgressiveError<BeamPassError>> {
    let settings = &Settings { seed: tiles.seed, ..*settings };
    let make = |pass: u32, runner: &progressive::Runner<'_>| {
        let mut pass = BeamPass::new(settings, pass, |_, radius| radius);
        runner.run(&mut pass, world);
        pass.finish()
    };
    let sample = |beams: &Beams<'_>, sample: &tiles::Sample<'_>, rng: &mut SampleRng, layers: &mut [Spectrum]| {
        let jitter = uniform2(rng);
        let ray = eye_ray(sample.x as f32 + jitter.x, sample.y as f32 + jitter.y);
        write(&beams.radiance(&ray, world, &settings.walk, settings.share(sample.index), rng), layers);
    };
    let passes = tiles::Passes { length: NonZero::new(settings.samples).unwrap(), may_break: false };
    progressive::render(film, tiles, &Control::default(), passes, make, sample)
}

fn by_beams<M: Medium + Sync>(medium: &M, walk: path::Settings, tiles: tiles::Settings) -> Film {
    let lights = lamp();
    let settings = Settings { walk, paths: 512, samples: 4, radius: 0.03, longest: 0.4, ..usual() };
    let mut film = Film::new(SIDE, SIDE, &NAMES).unwrap();
    render(&mut film, &tiles, &settings, &World { medium, scene: &Room, lights: (&lights).into() }).unwrap();
    film
}

fn by_paths<M: Medium + Sync>(medium: &M, paths: path::Settings, tiles: tiles::Settings) -> Film {
    let lights = lamp();
    let world = World { medium, scene: &Room, lights: (&lights).into() };
    let mut film = Film::new(SIDE, SIDE, &NAMES).unwrap();
    tiles::render(&mut film, &tiles, &Control::default(), |sample, rng, layers| {
        let jitter = uniform2(rng);
        let ray = eye_ray(sample.x as f32 + jitter.x, sample.y as f32 + jitter.y);
        write(&path::radiance(&ray, &world, &paths, rng), layers);
    })
    .unwrap();
    film
}

const SEEDS: u64 = 16;

/// Mean and squared standard error of every block, from the spread over seeds.
fn over_seeds(render: impl Fn(u64) -> Film) -> Vec<(f64, f64)> {
    let runs: Vec<Vec<f64>> = (0..SEEDS).map(|seed| blocks(&render(seed))).collect();
    let n = SEEDS as f64;
    (0..runs[0].len())
        .map(|i| {
            let mean = runs.iter().map(|run| run[i]).sum::<f64>() / n;
            let spread = runs.iter().map(|run| (run[i] - mean).powi(2)).sum::<f64>();
            (mean, spread / (n * (n - 1.0)))
        })
        .collect()
}

fn assert_same_pictures<M: Medium + Sync>(name: &str, medium: &M, paths: path::Settings) {
    let settings = |seed, samples| tiles::Settings { samples, seed, threads: 2, ..tiles::Settings::default() };
    let beams = over_seeds(|seed| by_beams(medium, paths, settings(seed, 32)));
    let truth = over_seeds(|seed| by_paths(medium, paths, settings(seed + 100, 128)));
    let per_layer = beams.len() / NAMES.len();
    let mut worst = 0.0_f64;
    for (i, (&(found, found2), &(expected, expected2))) in beams.iter().zip(&truth).enumerate() {
        let error = (found2 + expected2).sqrt();
        // What both render alike, or black, has no spread.
        let off = (found - expected).abs() / (error + 1e-5 * expected.abs() + 1e-9);
        worst = worst.max(off);
        let layer = NAMES[i / per_layer];
        assert!(off < 5.0, "{name}, {layer}, block {}: {found} instead of {expected} ± {error}", i % per_layer);
        // With all its light a picture is known to 5 %: otherwise the test proves nothing.
        let is_part = paths.max_scatterings < u32::MAX;
        assert!(is_part || layer != "total" || error < 0.05 * expected, "{name}, block {i}: {expected} ± {error}");
    }
    println!("{name}: worst block off by {worst:.1} standard errors");
}

fn foggy_room() -> Filled<Homogeneous> {
    Filled { medium: fog(0.1, 0.6, 0.5), body: Body::Box(BOUNDS) }
}

#[test]
fn pictures_by_beams_are_those_of_the_path_tracer() {
    let room = foggy_room();
    assert_same_pictures("even fog", &room, path::Settings::default());
    let bump = Field::Gaussian { a: 0.1, k: 2.0, c: Vec3::new(0.3, -0.2, 0.1), s: 0.4 };
    let medium = Analytic { tint: Spectrum::new(0.6, 1.0, 1.5), ..Analytic::grey(bump, 0.9) };
    assert_same_pictures("coloured cloud", &Filled { medium, body: Body::Box(BOUNDS) }, path::Settings::default());
    for max_scatterings in [0, 1, 2] {
        let paths = path::Settings { max_scatterings, ..path::Settings::default() };
        assert_same_pictures(&format!("{max_scatterings} scatterings"), &room, paths);
    }
}

#[test]
fn wide_beams_are_fewer_and_keep_their_light() {
    let (room, lights) = (foggy_room(), lamp());
    let world = World { medium: &room, scene: &Room, lights: (&lights).into() };
    let (narrow, wide) = (0.05_f32, 0.2_f32);
    let (mut all, mut kept) = (0, 0);
    // Of the same paths, so that only what thinning does is left.
    let difference = estimate(200, |rng| {
        let seed = rng.next_u64();
        let [every, some] = [wide, narrow].map(|radius| {
            let settings = Settings { paths: 64, radius, longest: 0.4, seed, ..usual() };
            let mut pass = BeamPass::new(&settings, 0, |_, _| wide);
            work::finish(&mut pass, &world, &mut BeamOutput::default());
            pass.finish().unwrap()
        });
        all += every.pieces().len();
        kept += some.pieces().len();
        assert!(every.pieces().iter().chain(some.pieces()).all(|piece| piece.radius == wide));
        let ray = eye_ray(4.0, 7.0);
        let [every, some] = [every, some].map(|beams| beams.gather(&ray, &room, u32::MAX, rng).light);
        some.single + some.multiple - every.single - every.multiple
    });
    difference.assert_is([0.0; 3], 0.0, "what thinning adds");
    let share = kept as f64 / all as f64;
    assert!((share - 0.5).abs() < 0.01, "{share} of the pieces kept instead of √(0.05/0.2)");
}

#[test]
fn the_noise_of_a_pass_is_what_its_settings_foretell() {
    // Parallel beams through a square metre, somewhere, and an eye ray across.
    const PATHS: u32 = 400;
    let (power, depth, fog) = (3.0_f32, 1.0_f32, fog(0.0, 1e-4, 0.0));
    let settings = Settings { paths: PATHS, depth, ..usual() };
    let ray = Ray::between(Vec3::ZERO, Vec3::X * depth);
    let mut relative = Vec::new();
    for radius in [0.02_f32, 0.08] {
        let mut rng = Generator::new(7);
        let found: Vec<f64> = (0..4000)
            .map(|_| {
                let mut beams = Beams::new(Vec::new(), Vec::new());
                for _ in 0..PATHS {
                    let origin = Vec3::new(uniform(&mut rng), uniform(&mut rng) - 0.5, -1.0);
                    let piece = Piece { radius, power: Spectrum::splat(power), ..beam(origin, Vec3::Z, 2.0, 0.0) };
                    beams.push(piece).unwrap();
                }
                beams.build(PATHS).unwrap();
                f64::from(beams.gather(&ray, &fog, u32::MAX, &mut rng).light.single[0])
            })
            .collect();
        let n = found.len() as f64;
        let mean = found.iter().sum::<f64>() / n;
        let variance = found.iter().map(|light| (light - mean).powi(2)).sum::<f64>() / (n - 1.0) / mean.powi(2);
        // The fluence of all beams together, over the square.
        let foretold = f64::from(settings.noise(power) / (power * radius));
        relative.push(variance / foretold);
    }
    // Variances of 4000 samples are known to √(2/4000) and a little more; a square's border takes 2 r of beams' light.
    for (found, allowed) in relative.iter().zip([0.08, 0.12]) {
        assert!((found - 1.0).abs() < allowed, "{relative:?} of what was foretold");
    }
}

#[test]
fn beams_give_the_same_bits_for_any_number_of_threads() {
    let settings = tiles::Settings { samples: 12, seed: 3, threads: 1, ..tiles::Settings::default() };
    let room = foggy_room();
    let expected = by_beams(&room, path::Settings::default(), settings);
    for threads in [2, 5] {
        let found = by_beams(&room, path::Settings::default(), tiles::Settings { threads, ..settings });
        assert_eq!(found, expected, "{threads} threads");
    }
    let other = by_beams(&room, path::Settings::default(), tiles::Settings { seed: 4, ..settings });
    assert_ne!(other, expected);
}

#[test]
fn what_beams_cannot_do_is_an_error() {
    let render = |medium: &Homogeneous, settings: Settings| {
        let mut film = Film::new(2, 2, &NAMES).unwrap();
        let world = World { medium, scene: &Empty, lights: (&[]).into() };
        render(&mut film, &tiles::Settings::default(), &settings, &world)
    };
    let good = usual();
    // Without lights there is nothing to send: black, and no error.
    assert!(render(&fog(0.1, 1.0, 0.0), good).is_ok());
    let glowing = fog(0.1, 1.0, 0.0).with_emission(Spectrum::ONE).unwrap();
    assert_eq!(render(&glowing, good).unwrap_err(), ProgressiveError::Method(BeamPassError::Glowing));
    for bad in [
        Settings { paths: 0, ..good },
        Settings { radius: 0.0, ..good },
        Settings { radius: f32::NAN, ..good },
        Settings { longest: f32::INFINITY, ..good },
        Settings { alpha: 1.5, ..good },
    ] {
        assert_eq!(render(&fog(0.1, 1.0, 0.0), bad).unwrap_err(), ProgressiveError::Method(BeamPassError::Settings));
    }
}

#[test]
fn what_lent_memory_cannot_hold_is_an_error_and_no_part_of_the_light() {
    let (room, lights) = (foggy_room(), lamp());
    let world = World { medium: &room, scene: &Room, lights: (&lights).into() };
    let settings = Settings { paths: 200, ..usual() };
    let grown = || {
        let mut pass = BeamPass::new(&settings, 3, |_, radius| radius);
        work::finish(&mut pass, &world, &mut BeamOutput::default());
        pass.finish().unwrap()
    };
    let expected = grown();
    let count = expected.pieces().len();
    let lent = |pieces: usize, nodes: usize, of_job: usize| {
        let (mut pieces, mut nodes) = (vec![Piece::default(); pieces], vec![fogbow::beams::BeamNode::default(); nodes]);
        let mut slots = vec![Piece::default(); of_job];
        let beams = Beams::new(&mut pieces[..], &mut nodes[..]);
        let mut pass = BeamPass::new_in(beams, &settings, 3, |_, radius| radius);
        work::finish(&mut pass, &world, &mut BeamOutput::new(&mut slots[..]));
        pass.finish().map(|beams| beams.pieces().to_vec())
    };
    assert_eq!(lent(count, count + 1, count).as_deref(), Ok(expected.pieces()));
    assert_eq!(lent(count - 1, count + 1, count), Err(BeamPassError::TooMany));
    assert_eq!(lent(count, 1, count), Err(BeamPassError::TooMany));
    assert_eq!(lent(count, count + 1, 8), Err(BeamPassError::TooMany));
}

#[test]
fn a_pass_that_is_stopped_keeps_all_light() {
    let (room, lights) = (foggy_room(), lamp());
    let world = World { medium: &room, scene: &Room, lights: (&lights).into() };
    // So wide that some beams of a few paths reach any eye ray.
    let settings = Settings { paths: 200, ..usual() };
    let mut pass = BeamPass::new(&settings, 0, |_, _| 0.5);
    work::step(&mut pass, &world, &mut BeamOutput::default());
    let part = pass.finish().unwrap();
    // The first 64 paths, as many as a job has.
    let mut pass = BeamPass::new(&Settings { paths: 64, ..settings }, 0, |_, _| 0.5);
    work::finish(&mut pass, &world, &mut BeamOutput::default());
    let whole = pass.finish().unwrap();
    assert_eq!(part.pieces(), whole.pieces());
    let [part, whole] =
        [part, whole].map(|beams| beams.gather(&eye_ray(4.0, 7.0), &room, u32::MAX, &mut Generator::new(1)));
    assert_eq!(part, whole);
    assert!(!part.light.single.is_black());
}

#[test]
fn radii_narrow_as_the_product_says() {
    let mut square = 1.0_f64;
    for pass in 1..200_u32 {
        square *= (f64::from(pass) + 0.6) / (f64::from(pass) + 1.0);
        let closed = f64::from(kernel::radius(2.0, 0.6, pass));
        assert!((closed / (2.0 * square.sqrt()) - 1.0).abs() < 1e-6, "pass {pass}");
    }
    assert_eq!(kernel::radius(0.1, 1.0, 77), 0.1);
}
