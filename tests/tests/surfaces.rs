//! Surfaces: held to another renderer's values; energy, reciprocity, samplers.

use std::path::Path;

use fogbow::math::Vec3;
use fogbow::spectrum::Spectrum;
use fogbow::surface::{Conductor, RoughConductor, Surface};
use fogbow_examples::scene_file::SceneFile;

const SCENE: &str = include_str!("../golden/surfaces.xml");
const VALUES: &[u8] = include_bytes!("../golden/surfaces.f32");
const PAIRS: usize = 1000;

/// The surfaces of the golden file by name, as the reader of scene files makes them.
fn surfaces() -> Vec<(String, Surface)> {
    let ids: Vec<String> = SCENE
        .match_indices("<bsdf ")
        .filter_map(|(at, _)| Some(SCENE[at..].lines().next()?.split_once("id=\"")?.1.split_once('"')?.0.to_owned()))
        .collect();
    let shapes: String =
        ids.iter().map(|id| format!("<shape type=\"rectangle\"><ref id=\"{id}\"/></shape>\n")).collect();
    let rest = "<integrator type=\"path\"/><sensor type=\"perspective\"><float name=\"fov\" value=\"40\"/>\
        <film type=\"hdrfilm\"><rfilter type=\"box\"/></film></sensor>";
    let text = SCENE.replace("</scene>", &format!("{rest}{shapes}</scene>"));
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
            // Our density of Beckmann's visible normals is the exact one; the other renderer's holds the fit of its masking.
            let pdf = surface.pdf(Vec3::Z, eye, light) * misfit(surface, eye, light);
            for (ours, theirs) in value.0.iter().zip(row) {
                worst = worst.max((ours - theirs).abs() / theirs.abs().max(1.0));
            }
            worst_pdf = worst_pdf.max((pdf - row[3]).abs() / row[3].max(1.0));
            lit += u32::from(row[3] > 0.0);
        }
        assert!(lit > 300, "{name}: only {lit} pairs say anything");
        if !(worst < 1e-4 && worst_pdf < 1e-4) {
            failures.push(format!("{name}: values off by {worst}, densities by {worst_pdf}"));
        }
    }
    assert!(failures.is_empty(), "{failures:#?}");
}

/// By how much a density changes with the fit of masking in place of the integral, as a factor.
fn misfit(surface: &Surface, eye: Vec3, light: Vec3) -> f32 {
    let above = if eye.z < 0.0 { -eye } else { eye };
    match surface {
        Surface::RoughConductor(metal) => metal.roughness.misfit(above),
        Surface::RoughDielectric(glass) => glass.roughness.misfit(above),
        Surface::RoughPlastic(plastic) if eye.z > 0.0 && light.z > 0.0 => {
            // Only the coat's part has it; the coat's share shows in the mirror's direction.
            let conductor = Conductor::mirror(Spectrum::ONE);
            let coat = Surface::RoughConductor(RoughConductor { conductor, roughness: plastic.roughness() });
            let mirrored = Vec3::new(-eye.x, -eye.y, eye.z);
            let [here, there] = [light, mirrored].map(|light| {
                let diffuse = light.z / core::f32::consts::PI;
                (coat.pdf(Vec3::Z, eye, light), diffuse, surface.pdf(Vec3::Z, eye, light))
            });
            let share = (there.2 - there.1) / (there.0 - there.1);
            1.0 + share * here.0 * (plastic.roughness().misfit(eye) - 1.0) / here.2
        }
        _ => 1.0,
    }
}
