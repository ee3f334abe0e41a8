//! Surfaces: held to another renderer's values; energy, reciprocity, samplers.

use std::path::Path;

use fogbow::math::{Ray, Vec3};
use fogbow::path::{self, Settings};
use fogbow::sampling::{Generator, uniform, uniform2, warp};
use fogbow::spectrum::Spectrum;
use fogbow::surface::{
    Conductor, Distribution, Plastic, RoughConductor, RoughPlastic, Roughness, Surface, SurfaceSample,
};
use fogbow::world::World as LitWorld;
use fogbow_examples::scene_file::SceneFile;
use fogbow_examples::world::{Storage, World};
use fogbow_tests::chi_square::sphere;

const SCENE: &str = include_str!("../golden/surfaces.xml");
const VALUES: &[u8] = include_bytes!("../golden/surfaces.f32");
const PAIRS: usize = 1000;
const REST: &str = "<integrator type=\"path\"/><sensor type=\"perspective\"><float name=\"fov\" value=\"40\"/>
    <film type=\"hdrfilm\"><rfilter type=\"box\"/></film></sensor>";

/// Seen from before and, where light passes, from behind.
fn eyes(surface: &Surface) -> Vec<Vec3> {
    let front = [Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.7, 0.66, 0.27).normalize()];
    front.into_iter().chain(surface.transmits().then_some(Vec3::new(-0.28, 0.0, -0.96))).collect()
}

/// The surfaces of the golden file by name, as the reader of scene files makes them.
fn surfaces() -> Vec<(String, Surface)> {
    let ids: Vec<String> = SCENE
        .match_indices("<bsdf ")
        .filter_map(|(at, _)| Some(SCENE[at..].lines().next()?.split_once("id=\"")?.1.split_once('"')?.0.to_owned()))
        .collect();
    let shapes: String =
        ids.iter().map(|id| format!("<shape type=\"rectangle\"><ref id=\"{id}\"/></shape>\n")).collect();
    let text = SCENE.replace("</scene>", &format!("{REST}{shapes}</scene>"));
    let scene = SceneFile::parse(Path::new("surfaces.xml"), &text).unwrap();
    ids.into_iter().zip(scene.shapes.iter().map(|shape| shape.material.surface)).collect()
}

fn floats(bytes: &[u8]) -> Vec<f32> {
    bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
}

/// The issue that asked for them wants 10⁻⁴ of the value, or of 1.
#[test]
fn values_and_densities_are_those_of_another_renderer() {
    let (surfaces, values) = (surfaces(), floats(VALUES));
    assert_eq!(values.len(), PAIRS * (6 + 4 * surfaces.len()));
    let (pairs, rows) = values.split_at(6 * PAIRS);
    let mut failures = Vec::new();
    for ((name, surface), rows) in surfaces.iter().zip(rows.chunks_exact(4 * PAIRS)) {
        let (mut worst, mut worst_pdf, mut lit) = (0.0_f32, 0.0_f32, 0);
        for (pair, row) in pairs.chunks_exact(6).zip(rows.chunks_exact(4)) {
            let (eye, light) = (Vec3::from_slice(pair), Vec3::from_slice(&pair[3..]));
            let value = surface.value(Vec3::Z, eye, light) * light.z.abs();
            // Our densities are exact; the other renderer's hold a fit of Beckmann's masking, and a table for coats.
            let pdf = surface.pdf(Vec3::Z, eye, light) * misfit(surface, eye, light);
            for (ours, theirs) in value.0.iter().zip(row) {
                worst = worst.max((ours - theirs).abs() / theirs.abs().max(1.0));
            }
            // From inside an opaque body the other renderer tells a density of directions that it never draws.
            let is_drawn = eye.z > 0.0 || surface.transmits() || matches!(surface, Surface::PrincipledThin(_));
            if is_drawn {
                worst_pdf = worst_pdf.max((pdf - row[3]).abs() / row[3].max(1.0));
            }
            lit += u32::from(row[3] > 0.0);
        }
        assert!(lit > 300, "{name}: only {lit} pairs say anything");
        if !(worst < 1e-4 && worst_pdf < 1e-4) {
            failures.push(format!("{name}: values off by {worst}, densities by {worst_pdf}"));
        }
    }
    assert!(failures.is_empty(), "{failures:#?}");
}

/// By how much a density changes with the fit of masking in place of the integral, and with a coat's transmittance interpolated
/// in a table, as a factor.
fn misfit(surface: &Surface, eye: Vec3, light: Vec3) -> f32 {
    let above = if eye.z < 0.0 { -eye } else { eye };
    match surface {
        Surface::RoughConductor(metal) => metal.roughness.misfit(above),
        Surface::RoughDielectric(glass) => glass.roughness.misfit(above),
        Surface::RoughPlastic(plastic) if eye.z > 0.0 && light.z > 0.0 => {
            let conductor = Conductor::mirror(Spectrum::ONE);
            let coat = Surface::RoughConductor(RoughConductor { conductor, roughness: plastic.roughness() });
            let diffuse = light.z / core::f32::consts::PI;
            // Only the coat's part has the fit.
            let fitted = coat.pdf(Vec3::Z, eye, light) * plastic.roughness().misfit(eye);
            let share = tabulated_share(plastic, surface, &coat, eye.z);
            (share * fitted + (1.0 - share) * diffuse) / surface.pdf(Vec3::Z, eye, light)
        }
        _ => 1.0,
    }
}

/// Share of samples that go to a coat whose transmittance is interpolated between 64 even cosines.
fn tabulated_share(plastic: &RoughPlastic, surface: &Surface, coat: &Surface, cosine: f32) -> f32 {
    let Plastic { diffuse, specular, .. } = plastic.plastic();
    let odds = specular.mean() / diffuse.mean();
    // The share shows in the mirror's direction, and tells the transmittance.
    let transmittance = |cosine: f32| {
        let eye = Vec3::new((1.0 - cosine * cosine).max(0.0).sqrt(), 0.0, cosine);
        let mirrored = Vec3::new(-eye.x, 0.0, eye.z);
        let diffuse = cosine / core::f32::consts::PI;
        let share = (surface.pdf(Vec3::Z, eye, mirrored) - diffuse) / (coat.pdf(Vec3::Z, eye, mirrored) - diffuse);
        odds / (odds + share / (1.0 - share))
    };
    let place = 63.0 * cosine;
    let node = place.floor().min(62.0);
    let [low, high] = [node, node + 1.0].map(|node| transmittance((node / 63.0).max(1e-3)));
    let passes = low + (high - low) * (place - node);
    let (coat, base) = ((1.0 - passes) * odds, passes);
    coat / (coat + base)
}

#[test]
fn directions_are_drawn_by_their_densities() {
    for (name, surface) in surfaces() {
        for eye in eyes(&surface) {
            sphere(
                &format!("{name} from {eye}"),
                Vec3::new(-eye.x, -eye.y, eye.z),
                3.0,
                100_000,
                |u, rng| {
                    // Mirrors within plastic are no density: they are left out, and so is their share.
                    let sample = surface.sample(Vec3::Z, eye, uniform(rng), u).filter(|sample| sample.pdf > 0.0)?;
                    check_sample(&name, &surface, eye, &sample);
                    Some(sample.to_light)
                },
                |light| f64::from(surface.pdf(Vec3::Z, eye, light)),
            );
        }
    }
}

/// A sample tells the density and the weight that its direction has.
fn check_sample(name: &str, surface: &Surface, eye: Vec3, sample: &SurfaceSample) {
    let light = sample.to_light;
    let (pdf, value) = (surface.pdf(Vec3::Z, eye, light), surface.value(Vec3::Z, eye, light));
    // At grazing directions, and in narrow lobes, rounding of the direction shows.
    if light.z.abs() > 0.02 && pdf > 1e-3 {
        assert!((sample.pdf / pdf - 1.0).abs() < 5e-3, "{name}: {} for {pdf}, {light}", sample.pdf);
        let weight = value * (light.z.abs() / pdf);
        let off = (sample.weight - weight).0.map(f32::abs).into_iter().fold(0.0, f32::max);
        assert!(off < 5e-3 * weight.max_element() + 1e-4, "{name}: {:?} for {weight:?}, {light}", sample.weight);
    }
}

/// `f(a, b) = f(b, a)`, and for light that is refracted `η_b² f(a, b) = η_a² f(b, a)`.
#[test]
fn eye_and_light_may_change_places() {
    for (name, surface) in surfaces() {
        let eta2 = match surface {
            Surface::RoughDielectric(glass) => glass.eta * glass.eta,
            Surface::Principled(body) => body.eta * body.eta,
            _ => 1.0,
        };
        let (mut rng, mut count) = (Generator::new(3), 0);
        while count < 300 {
            let [a, b] = [0, 1].map(|_| warp::uniform_sphere(uniform2(&mut rng)));
            if a.z.abs() < 0.05 || b.z.abs() < 0.05 || !surface.transmits() && a.z.min(b.z) < 0.0 {
                continue;
            }
            count += 1;
            let side = |v: Vec3| if v.z < 0.0 { eta2 } else { 1.0 };
            let there = surface.value(Vec3::Z, a, b) * side(b);
            let back = surface.value(Vec3::Z, b, a) * side(a);
            // Whether a facet of a sheet is seen is asked of the light that passes, on its own side only.
            if matches!(surface, Surface::PrincipledThin(_)) && (there.is_black() || back.is_black() || a.z * b.z < 0.0)
            {
                continue;
            }
            let off = (there - back).0.map(f32::abs).into_iter().fold(0.0, f32::max);
            assert!(off <= 2e-3 * there.max_element() + 1e-5, "{name}: {there:?} and {back:?} for {a}, {b}");
        }
    }
}

/// Mean weight of samples, with what refraction does to radiance undone, and its standard error.
fn energy(surface: &Surface, eye: Vec3, count: u32) -> (f64, f64) {
    let mut rng = Generator::new(5);
    let (mut sum, mut squares) = (0.0, 0.0);
    for _ in 0..count {
        let (choice, u) = (uniform(&mut rng), uniform2(&mut rng));
        let sent = surface
            .sample(Vec3::Z, eye, choice, u)
            .map_or(Spectrum::ZERO, |sample| surface.power_weight(Vec3::Z, eye, &sample));
        let sent = f64::from(sent.max_element());
        (sum, squares) = (sum + sent, squares + sent * sent);
    }
    let (n, mean) = (f64::from(count), sum / f64::from(count));
    (mean, ((squares / n - mean * mean) / n).max(0.0).sqrt())
}

#[test]
fn no_surface_sends_more_than_it_gets() {
    for (name, surface) in surfaces() {
        for eye in eyes(&surface) {
            let (mean, error) = energy(&surface, eye, 40_000);
            // The sheen of cloth is added to all else, by definition.
            let most = if name == "cloth" { 1.2 } else { 1.0 };
            assert!(mean < most + 4.0 * error && mean > 0.05, "{name} from {eye}: {mean} ± {error}");
        }
    }
}

/// Distribution, roughness, cosine to the eye; albedo and its standard error.
const ALBEDOS: [(Distribution, f32, f32, f64, f64); 8] = [
    (Distribution::Beckmann, 0.6, 1.0, 0.856074, 0.000057),
    (Distribution::Beckmann, 0.6, 0.4, 0.866679, 0.000470),
    (Distribution::Beckmann, 1.0, 1.0, 0.461440, 0.000099),
    (Distribution::Beckmann, 1.0, 0.4, 0.797041, 0.000152),
    (Distribution::Ggx, 0.6, 1.0, 0.591530, 0.000022),
    (Distribution::Ggx, 0.6, 0.4, 0.641931, 0.000197),
    (Distribution::Ggx, 1.0, 1.0, 0.306823, 0.000025),
    (Distribution::Ggx, 1.0, 0.4, 0.438318, 0.000035),
];

/// A white metal of facets that reflect once loses what would meet a second facet: as much as in the other renderer (integrals
/// of its values over the hemisphere, four million directions).
#[test]
fn rough_metals_lose_what_single_scattering_loses() {
    for (distribution, alpha, cosine, albedo, error) in ALBEDOS {
        let conductor = Conductor::mirror(Spectrum::ONE);
        let surface =
            Surface::RoughConductor(RoughConductor { conductor, roughness: Roughness::even(distribution, alpha) });
        let eye = Vec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine);
        let (mean, noise) = energy(&surface, eye, 200_000);
        let off = (mean - albedo).abs();
        assert!(off < 4.0 * noise.hypot(error), "{distribution:?} {alpha} at {cosine}: {mean} ± {noise} for {albedo}");
    }
}

/// Radiance seen straight down on a rectangle of a material, under a white sky.
fn seen(material: &str, count: u32) -> (Spectrum, f32) {
    let text = format!(
        "<scene version=\"3.0.0\">{REST}<emitter type=\"constant\"/><shape type=\"rectangle\">{material}</shape></scene>"
    );
    let scene = SceneFile::parse(Path::new("mix.xml"), &text).unwrap();
    let mut storage = Storage::default();
    let world = World::new(&scene, &mut storage).unwrap();
    let lights = world.lights();
    let lit = LitWorld { medium: &fogbow::host::Empty, scene: &world, lights: lights.as_slice().into() };
    let mut rng = Generator::new(7);
    let mut sum = Spectrum::ZERO;
    for _ in 0..count {
        let origin = Vec3::new(uniform(&mut rng) - 0.5, uniform(&mut rng) - 0.5, 2.0);
        sum += path::radiance(&Ray::new(origin, Vec3::NEG_Z), &lit, &Settings::default(), &mut rng).total();
    }
    (sum * (1.0 / count as f32), (count as f32).sqrt().recip())
}

/// Masks and blends are chosen hit by hit; their mean is the mixture.
#[test]
fn mixed_materials_look_like_their_mixture() {
    let black = "<bsdf type=\"diffuse\"><float name=\"reflectance\" value=\"0\"/></bsdf>";
    let mirror = "<bsdf type=\"conductor\"/>";
    let mask = format!("<bsdf type=\"mask\"><float name=\"opacity\" value=\"0.3\"/>{black}</bsdf>");
    let blend = format!("<bsdf type=\"blendbsdf\"><float name=\"weight\" value=\"0.2\"/>{black}{mirror}</bsdf>");
    let nested = format!("<bsdf type=\"blendbsdf\"><float name=\"weight\" value=\"0.5\"/>{blend}{mask}</bsdf>");
    let sides = format!("<bsdf type=\"twosided\">{mirror}{black}</bsdf>");
    let turned = format!("<boolean name=\"flip_normals\" value=\"true\"/>{sides}");
    for (material, expected) in [(&mask, 0.7), (&blend, 0.2), (&nested, 0.45), (&sides, 1.0), (&turned, 0.0)] {
        let (radiance, error) = seen(material, 20_000);
        // A share p has a deviation of √(p(1 − p)), half at most.
        let most = if expected == 0.0 || expected == 1.0 { 1e-6 } else { 2.0 * error };
        assert!((radiance[0] - expected).abs() < most, "{material}: {radiance:?} for {expected}");
    }
    // What is diffuse in both needs no choice: the same paths as with one that is between them.
    let grey = "<bsdf type=\"diffuse\"><float name=\"reflectance\" value=\"0.8\"/></bsdf>";
    let both = format!("<bsdf type=\"blendbsdf\"><float name=\"weight\" value=\"0.25\"/>{black}{grey}</bsdf>");
    let alone = "<bsdf type=\"diffuse\"><float name=\"reflectance\" value=\"0.2\"/></bsdf>";
    let [both, alone] = [both.as_str(), alone].map(|material| seen(material, 100).0[0]);
    assert!((both - alone).abs() < 1e-5, "{both} and {alone}");
}

/// What is seen along −z of a scene, its mean.
fn looked_through(shapes: &str, max_scatterings: u32, count: u32) -> f32 {
    let scene =
        SceneFile::parse(Path::new("panes.xml"), &format!("<scene version=\"3.0.0\">{REST}{shapes}</scene>")).unwrap();
    let mut storage = Storage::new(&scene);
    let world = World::new(&scene, &mut storage).unwrap();
    let lights = world.lights();
    let lit = LitWorld { medium: &fogbow::host::Empty, scene: &world, lights: lights.as_slice().into() };
    let (settings, mut rng) = (Settings { max_scatterings, ..Settings::default() }, Generator::new(3));
    let mut sum = 0.0;
    for i in 0..count {
        // A little apart, so that rays differ.
        let origin = Vec3::new(1e-4 * i as f32 / count as f32, 0.0, 4.0);
        sum += path::radiance(&Ray::new(origin, Vec3::NEG_Z), &lit, &settings, &mut rng).total()[0] / count as f32;
    }
    sum
}

/// Light goes straight through thin panes, and is not scattered by that: neither what is seen through them nor light from
/// a lamp behind them counts for the longest path, as in Mitsuba's `volpath`.
#[test]
fn thin_panes_are_passed_uncounted() {
    let pane = |z: f32, more: &str| {
        format!(
            "<shape type=\"rectangle\"><transform name=\"to_world\"><scale value=\"50\"/><translate z=\"{z}\"/></transform>\
             <bsdf type=\"thindielectric\"><float name=\"int_ior\" value=\"1.5\"/><float name=\"ext_ior\" value=\"1\"/>{more}\
             </bsdf></shape>"
        )
    };
    // Of 4 % once, back and forth: 2R/(1 + R).
    let through = 1.0_f32 - 2.0 * 0.04 / 1.04;
    let panes = pane(2.0, "") + &pane(3.0, "");
    let lamp = "<shape type=\"rectangle\"><emitter type=\"area\"/></shape>";
    let seen = looked_through(&format!("{panes}{lamp}"), 0, 20_000);
    assert!((seen - through * through).abs() < 0.01, "{seen} for {}", through * through);
    // A wall, lit by a lamp above all panes: twice through both.
    let wall = "<shape type=\"rectangle\"><bsdf type=\"diffuse\"><float name=\"reflectance\" value=\"1\"/></bsdf></shape>\
                <emitter type=\"point\"><point name=\"position\" x=\"0\" y=\"0\" z=\"5\"/></emitter>";
    let (seen, bare) = (looked_through(&format!("{panes}{wall}"), 1, 20_000), looked_through(wall, 1, 1));
    assert!((seen / bare - through.powi(4)).abs() < 0.015, "{seen} of {bare} for {}", through.powi(4));
    // What tints is passed by the path alone, which counts it.
    let green = pane(2.0, "<rgb name=\"specular_transmittance\" value=\"0.5, 1, 0.5\"/>");
    let [none, one] = [0, 1].map(|most| looked_through(&format!("{green}{lamp}"), most, 20_000));
    assert!(none == 0.0 && (one - 0.5 * through).abs() < 0.01, "{none} {one}");
    // An even tint takes away a part.
    let grey = pane(2.0, "<rgb name=\"specular_transmittance\" value=\"0.5\"/>");
    let seen = looked_through(&format!("{grey}{lamp}"), 0, 20_000);
    assert!((seen - 0.5 * through).abs() < 0.015, "{seen}");
}

/// A checkerboard that gives a number has its parts the other way round than one that gives a colour, as Mitsuba 3.9.1 has it.
#[test]
fn checkerboards_of_numbers_are_inverted() {
    // One square in each quarter: the corner of the rectangle is in the first part.
    let board = |name: &str| {
        format!(
            "<texture name=\"{name}\" type=\"checkerboard\"><float name=\"color0\" value=\"0\"/><float name=\"color1\" value=\"1\"/>\
             </texture>"
        )
    };
    let grey = |value: u32| format!("<bsdf type=\"diffuse\"><float name=\"reflectance\" value=\"{value}\"/></bsdf>");
    let colour = format!("<bsdf type=\"diffuse\">{}</bsdf>", board("reflectance"));
    let number = format!("<bsdf type=\"blendbsdf\">{}{}{}</bsdf>", board("weight"), grey(0), grey(1));
    for (material, expected) in [(colour, [0.0, 1.0]), (number, [1.0, 0.0])] {
        let text = format!("<scene version=\"3.0.0\">{REST}<shape type=\"rectangle\">{material}</shape></scene>");
        let scene = SceneFile::parse(Path::new("board.xml"), &text).unwrap();
        let mut storage = Storage::new(&scene);
        let world = World::new(&scene, &mut storage).unwrap();
        for (x, expected) in [-0.5, 0.5].into_iter().zip(expected) {
            let hit =
                fogbow::host::Scene::closest_hit(&world, &Ray::new(Vec3::new(x, -0.5, 2.0), Vec3::NEG_Z)).unwrap();
            assert_eq!(hit.surface, Surface::Lambert { reflectance: Spectrum::splat(expected) }, "{material} at {x}");
        }
    }
}
