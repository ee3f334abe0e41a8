//! Noise and overlap.

use fogbow::host::{Empty, Medium};
use fogbow::math::{Ray, Vec3};
use fogbow::medium::{AnyMedium, FractalNoise, Homogeneous, MediumError, Noise, Overlap, Placed, Region};
use fogbow::phase::{Lobe, Phase};
use fogbow::sampling::{Generator, uniform};
use fogbow::spectrum::Spectrum;

use super::common::*;

#[test]
fn noise_keeps_its_bounds_along_rays_and_its_gradient_is_right() {
    let mut rng = Generator::new(11);
    for round in 0..60 {
        let shape = FractalNoise {
            frequency: [0.01, 1.0, 30.0][round % 3],
            octaves: 1 + (6.0 * uniform(&mut rng)) as u32,
            lacunarity: 1.5 + uniform(&mut rng),
            gain: 0.3 + 0.5 * uniform(&mut rng),
            offset: uniform(&mut rng) - 0.5,
            amplitude: uniform(&mut rng) * 2.0,
            max_density: 0.2 + uniform(&mut rng),
            seed: round as u32,
        };
        let noise = Noise::new(shape, ABSORPTION, SCATTERING * 3.0, Phase::ISOTROPIC).unwrap();
        let scale = 1.0 / shape.frequency;
        for _ in 0..8 {
            let ray = Ray::new(point(&mut rng, 20.0) * scale, direction(&mut rng));
            check_walk(&noise, &ray, 4.0 * scale, 0.0, &mut rng);
            let p = ray.origin;
            let density = shape.density(p);
            if density < 0.05 || density > shape.max_density - 0.05 {
                continue;
            }
            let analytic = noise.gradients(p).extinction;
            let numeric = numeric_gradient(&noise, p, 0.02 * noise.resolution());
            let error = (analytic - numeric).norm().max_element();
            // Rounding of coordinates: 1e-6 of 20 cells and more over two hundredths of a quarter.
            assert!(error < 0.02 * (analytic.norm().max_element() + 10.0 / scale), "{error} {analytic:?} {numeric:?}");
        }
    }
    // The bounds are of use: thin parts are known to be thin.
    let shape = FractalNoise { offset: -0.1, ..FractalNoise::default() };
    let noise = Noise::new(shape, Spectrum::ZERO, Spectrum::splat(4.0), Phase::ISOTROPIC).unwrap();
    let (mut t, mut bound, mut value) = (0.0, 0.0, 0.0);
    let ray = Ray::new(Vec3::ZERO, Vec3::new(0.6, 0.48, 0.64));
    while t < 500.0 {
        let segment = noise.majorant_segment(&ray, t);
        bound += segment.majorant[0] * (segment.until - t);
        value += noise.extinction(ray.at(t + uniform(&mut rng) * (segment.until - t)))[0] * (segment.until - t);
        t = segment.until;
    }
    println!("bound {bound}, mean {value}, largest {}", 4.0 * t);
    assert!(bound < 0.7 * (4.0 * t), "{bound} {value}");
}

#[test]
fn overlapping_media_add_and_mix() {
    let mut rng = Generator::new(12);
    let mut voxels = Voxels::new([6, 6, 6], placement(&mut rng, 1.0), islands(&mut rng));
    let placement = voxels.placement;
    let fog = Homogeneous::new(ABSORPTION, SCATTERING, Lobe::HenyeyGreenstein { g: 0.6 }).unwrap();
    let fog = fog.with_emission(Spectrum::ONE).unwrap();
    let shape = FractalNoise { frequency: 3.0, ..FractalNoise::default() };
    let cloud = Noise::new(shape, ABSORPTION, SCATTERING, Lobe::Rayleigh).unwrap();
    let ball = Region::sphere(Vec3::ZERO, 0.8).unwrap();
    let media = [
        Placed::new(AnyMedium::from(voxels.grid()), Region::Everywhere),
        Placed::new(AnyMedium::from(fog), ball),
        Placed::new(AnyMedium::from(cloud), Region::sphere(Vec3::X, 0.9).unwrap()),
    ];
    let all = Overlap::new(&media, |m| m.medium().phase()).unwrap();
    for _ in 0..300 {
        let ray = ray_around(&mut rng, &placement);
        check_walk(&all, &ray, 4.0, 1e-5, &mut rng);
        let p = ray.at(uniform(&mut rng));
        let parts = media.map(|m| m.properties(p));
        let sum = all.properties(p);
        let scattering: Spectrum = parts.iter().map(|q| q.scattering).sum();
        assert_near((sum.scattering - scattering).max_element(), 0.0, 1e-6, "scattering");
        assert_eq!(sum.emission, if ball.contains(p) { Spectrum::ONE } else { Spectrum::ZERO });
        let cosine: Spectrum = parts.iter().map(|q| q.scattering * q.phase.mean_cosine()).sum();
        let difference = sum.phase.mean_cosine() * scattering - cosine;
        assert_near(difference.map(f32::abs).max_element(), 0.0, 1e-5, "mean cosine");
    }
    assert!(all.is_emissive() && !all.is_grey());
    let none = Overlap::<Homogeneous>::new(&[], Homogeneous::phase).unwrap();
    let ray = Ray::new(Vec3::ZERO, Vec3::X);
    assert_eq!(none.majorant_segment(&ray, 0.0), Empty.majorant_segment(&ray, 0.0));
    let lobe = |i: usize| Lobe::HenyeyGreenstein { g: 0.1 * i as f32 };
    let five: [_; 5] = core::array::from_fn(|i| Homogeneous::new(ABSORPTION, SCATTERING, lobe(i)).unwrap());
    assert_eq!(Overlap::new(&five, Homogeneous::phase), Err(MediumError::TooManyLobes));
}
