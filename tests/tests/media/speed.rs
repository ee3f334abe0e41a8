//! Times, printed.

use std::time::Instant;

use fogbow::host::Medium;
use fogbow::math::{Affine3, Bounds, Mat3, Ray, Vec3, float};
use fogbow::medium::{AnyMedium, BLOCK, FractalNoise, Noise, Placed, Pyramid, Region};
use fogbow::phase::Phase;
use fogbow::sampling::{Generator, uniform};
use fogbow::spectrum::Spectrum;

use super::common::*;

/// Prints times: `cargo test -p fogbow-tests --test media -- --ignored --nocapture speed`. A file
/// that ends in 64³ floats, such as a Mitsuba volume, takes the place of the cloud if the variable
/// `FOGBOW_VOLUME` names it.
#[test]
#[ignore = "prints times"]
fn speed() {
    let size = [64, 64, 64];
    let shape = FractalNoise { frequency: 3.0, offset: 0.1, octaves: 4, ..FractalNoise::default() };
    let local = |i: usize| Vec3::new((i % 64) as f32, (i / 64 % 64) as f32, (i / 4096) as f32) / 64.0;
    // A round cloud in empty space.
    let cloud = |p: Vec3| shape.density(p) * (1.0 - 2.2 * (p - Vec3::splat(0.5)).length()).max(0.0);
    let placement = Affine3 { matrix3: Mat3::from_diagonal(Vec3::splat(2.0)), translation: Vec3::splat(-1.0) };
    let mut voxels = Voxels::new(size, placement, |i| 3.5 * cloud(local(i)));
    if let Some(path) = std::env::var_os("FOGBOW_VOLUME") {
        let bytes = std::fs::read(path).unwrap();
        let floats = bytes[bytes.len() - voxels.values.len() * 4..].chunks_exact(4);
        let float = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
        voxels.values = floats.map(|b| 3.5 * float(b)).collect();
    }
    let started = Instant::now();
    let grid = voxels.grid();
    println!("blocks of {BLOCK}³ filled in {:.1} ms", started.elapsed().as_secs_f64() * 1e3);
    let noise = Noise::new(shape, ABSORPTION, SCATTERING, Phase::ISOTROPIC).unwrap();
    let mut rng = Generator::new(1);
    let rays: Vec<Ray> = (0..2000)
        .map(|i| {
            let (a, b) = (point(&mut rng, 1.0), direction(&mut rng));
            if i % 2 == 0 { Ray::new(a, b) } else { Ray { length: f32::INFINITY, ..Ray::between(b * 2.5, a) } }
        })
        .collect();
    let points: Vec<Vec3> = (0..2000).map(|_| point(&mut rng, 1.0)).collect();
    measure("grid", &grid, &rays, &points);
    let mut cells = vec![Spectrum::ZERO; Pyramid::<()>::cell_count(size)];
    let bounds = Bounds { min: Vec3::splat(-1.0), max: Vec3::splat(1.0) };
    let started = Instant::now();
    let pyramid = Pyramid::new(grid, bounds, size, &mut cells).unwrap();
    println!("pyramid filled in {:.1} ms", started.elapsed().as_secs_f64() * 1e3);
    measure("pyramid of grid", &pyramid, &rays, &points);
    measure("noise", &noise, &rays, &points);
    measure("any grid", &AnyMedium::from(grid), &rays, &points);
    let ball = Region::sphere(Vec3::ZERO, 1.0).unwrap();
    measure("placed grid", &Placed::new(grid, ball), &rays, &points);
}

/// Least time (ns) of several runs, each of `count` operations: others share the machine.
fn least(count: usize, mut run: impl FnMut()) -> f64 {
    let time = |_| {
        let start = Instant::now();
        run();
        start.elapsed().as_secs_f64() * 1e9 / count as f64
    };
    (0..30).map(time).fold(f64::INFINITY, f64::min)
}

fn measure(name: &str, medium: &impl Medium, rays: &[Ray], points: &[Vec3]) {
    const END: f32 = 4.0;
    let points = &points[..2000];
    let mut sum = 0.0;
    let mut segments = 0_usize;
    let walks = least(rays.len(), || {
        segments = 0;
        for ray in rays {
            let mut t = 0.0;
            while t < END {
                let segment = medium.majorant_segment(ray, t);
                segments += 1;
                sum += segment.majorant[0];
                t = segment.until;
            }
        }
    });
    let steps = segments as f64 / rays.len() as f64;
    let segment = walks / steps;
    let lookup = least(points.len(), || sum += points.iter().map(|p| medium.extinction(*p)[0]).sum::<f32>());
    let properties =
        least(points.len(), || sum += points.iter().map(|p| medium.properties(*p).scattering[0]).sum::<f32>());
    let ball = least(100, || sum += points[..100].iter().map(|p| medium.mean_extinction(*p, 0.1)[0]).sum::<f32>());
    // Ratio tracking of every ray to its end, then free flight to the first collision.
    let mut collisions = 0_usize;
    let mut track = |to_end: bool| {
        collisions = 0;
        let time = least(rays.len(), || {
            let mut rng = Generator::new(2);
            collisions = 0;
            for ray in rays {
                let (mut t, mut transmittance) = (0.0_f32, 1.0);
                'ray: while t < END {
                    let segment = medium.majorant_segment(ray, t);
                    let bound = segment.majorant.max_element();
                    let end = segment.until.min(END);
                    if bound == 0.0 {
                        t = end;
                        continue;
                    }
                    loop {
                        t -= float::ln(1.0 - uniform(&mut rng)) / bound;
                        if t >= end {
                            break;
                        }
                        collisions += 1;
                        let ratio = medium.extinction(ray.at(t))[0] / bound;
                        transmittance *= 1.0 - ratio;
                        if !to_end && uniform(&mut rng) < ratio {
                            break 'ray;
                        }
                    }
                    t = end;
                }
                sum += transmittance;
            }
        });
        (time, collisions as f64 / rays.len() as f64)
    };
    let (transmittance, tracked) = track(true);
    let (flight, collided) = track(false);
    println!(
        "{name}: segment {segment:.1} ns ({steps:.1} a ray), extinction {lookup:.1} ns, properties {properties:.1} ns, \
         ball {ball:.0} ns, transmittance {transmittance:.0} ns ({tracked:.2} collisions), \
         free flight {flight:.0} ns ({collided:.2}) [{sum}]"
    );
}
