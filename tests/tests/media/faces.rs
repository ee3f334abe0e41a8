//! Faces, regions and holes.

use fogbow::host::Medium;
use fogbow::math::{Ray, Vec2, Vec3};
use fogbow::medium::{AnyMedium, FractalNoise, Homogeneous, Noise, Placed, Region};
use fogbow::phase::Phase;
use fogbow::sampling::{Generator, uniform, warp};
use fogbow::spectrum::Spectrum;
use proptest::prelude::*;

use super::common::*;

/// Optical thickness of a ray by segments of vacuum and of constant medium alone.
fn thickness(medium: &impl Medium, ray: &Ray) -> f32 {
    let (mut t, mut sum) = (0.0_f32, 0.0_f64);
    while t < ray.length {
        let segment = medium.majorant_segment(ray, t);
        assert!(segment.is_constant());
        let until = segment.until.min(ray.length);
        sum += f64::from(segment.majorant[0]) * f64::from(until - t);
        t = until;
    }
    sum as f32
}

/// Gradient of thickness by the interior and boundary terms of the sheet, for homogeneous bodies.
fn thickness_gradient(medium: &impl Medium, ray: &Ray, is_joint: bool) -> Vec3 {
    let u = -ray.direction;
    let mut sum = if is_joint { Vec3::ZERO } else { u * (thickness(medium, ray) / ray.length) };
    medium.faces(ray, &mut |face| {
        assert_near(face.normal.length(), 1.0, 1e-5, "normal");
        let fraction = face.distance / ray.length;
        let weight = if is_joint { 1.0 } else { 1.0 - fraction };
        sum += face.normal * (weight * face.jump[0] / face.normal.dot(u).abs().max(1e-3));
    });
    sum
}

/// Compares both gradients with differences; rays that graze a face are left out.
fn check_faces(medium: &impl Medium, rng: &mut Generator, rays: u32) -> u32 {
    let mut checked = 0;
    for _ in 0..rays {
        let (from, to) = (point(rng, 2.0), point(rng, 2.0));
        let ray = Ray::between(from, to);
        // Faces just beyond the ends count, too: differences reach them.
        const MARGIN: f32 = 0.05;
        let longer = Ray { origin: ray.at(-MARGIN), direction: ray.direction, length: ray.length + 2.0 * MARGIN };
        let mut faces = Vec::new();
        medium.faces(&longer, &mut |face| faces.push((face.distance, face.normal.dot(ray.direction).abs())));
        let is_clear = |at: f32, from: f32| (at - from).abs() > 2.0 * MARGIN;
        let are_clear = faces.iter().enumerate().all(|(i, &(at, cosine))| {
            let apart = faces[..i].iter().all(|other| is_clear(at, other.0));
            cosine > 0.3 && apart && is_clear(at, 0.0) && is_clear(at, longer.length)
        });
        if !are_clear {
            continue;
        }
        const H: f32 = 2e-3;
        // Nor may a displaced ray pass the other side of an edge.
        let normals = |from: Vec3, to: Vec3| {
            let mut normals = Vec::new();
            medium.faces(&Ray::between(from, to), &mut |face| normals.push(face.normal));
            normals
        };
        let here = normals(from, to);
        let is_same = |from: Vec3, to: Vec3| {
            let there = normals(from, to);
            here.len() == there.len() && here.iter().zip(&there).all(|(a, b)| a.dot(*b) > 0.99)
        };
        if !around(Vec3::ZERO, H).all(|o| is_same(from + o, to) && is_same(from + o, to + o)) {
            continue;
        }
        checked += 1;
        for is_joint in [false, true] {
            let at = |offset: Vec3| {
                let moved = if is_joint { to + offset } else { to };
                thickness(medium, &Ray::between(from + offset, moved))
            };
            let along = |axis: Vec3| (at(axis * H) - at(-axis * H)) / (2.0 * H);
            let numeric = Vec3::new(along(Vec3::X), along(Vec3::Y), along(Vec3::Z));
            let analytic = thickness_gradient(medium, &ray, is_joint);
            // Rounding 5e-7/H; third derivatives of spheres at 0.3 from grazing, H² of them.
            let tolerance = 5e-3 * (1.0 + analytic.length());
            assert!((numeric - analytic).length() < tolerance, "{numeric} {analytic} joint {is_joint} {ray:?}");
        }
    }
    checked
}

#[test]
fn faces_complete_the_gradients_of_thickness() {
    let mut rng = Generator::new(9);
    let fog = Homogeneous::new(ABSORPTION, SCATTERING, Phase::ISOTROPIC).unwrap();
    let ball = Region::sphere(Vec3::new(0.2, -0.1, 0.0), 0.9).unwrap();
    let mut tilted = placement(&mut rng, 1.5);
    tilted.translation = tilted.matrix3 * Vec3::splat(-0.5);
    let cube = Region::unit_cube(tilted).unwrap();
    let hole = [Region::sphere(Vec3::ZERO, 0.4).unwrap()];
    let outside = [Region::sphere(Vec3::new(1.0, 0.0, 0.0), 0.7).unwrap(), hole[0]];
    let mut voxels = Voxels::new([5, 4, 3], tilted, |_| 1.0);
    let grid = voxels.grid();
    for checked in [
        check_faces(&Placed::new(fog, ball), &mut rng, 800),
        check_faces(&Placed::new(fog, cube), &mut rng, 800),
        check_faces(&Placed::new(fog, ball).with_holes(&hole), &mut rng, 800),
        check_faces(&Placed::new(fog, cube).with_holes(&outside), &mut rng, 800),
        check_faces(&Placed::new(fog, Region::Everywhere).with_holes(&outside), &mut rng, 800),
        check_faces(&grid, &mut rng, 800),
        // The same faces twice over count once.
        check_faces(&Placed::new(grid, cube), &mut rng, 800),
        check_faces(&Placed::new(grid, ball), &mut rng, 800),
    ] {
        assert!(checked > 60, "{checked}");
    }
}

#[test]
fn faces_of_one_sphere_give_the_closed_form_of_the_sheet() {
    let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::splat(1.5), Phase::ISOTROPIC).unwrap();
    let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 1.0).unwrap());
    let ray = Ray::between(Vec3::new(0.3, 0.2, 0.0), Vec3::new(2.0, 1.0, 1.5));
    let mut faces = Vec::new();
    ball.faces(&ray, &mut |face| faces.push(face));
    let [face] = faces[..] else { panic!("one face, not {faces:?}") };
    assert_eq!(face.jump, Spectrum::splat(-1.5));
    let (m, u, fraction) = (ray.at(face.distance), -ray.direction, face.distance / ray.length);
    assert_near((m - face.normal).length(), 0.0, 1e-6, "normal");
    // Sheet § 1.4: ∇τ = σ [ t u + (1 − t) m/(m·u) ].
    let expected = (u * fraction + m * ((1.0 - fraction) / m.dot(u))) * 1.5;
    assert_near((thickness_gradient(&ball, &ray, false) - expected).length(), 0.0, 1e-5, "gradient");
}

#[test]
fn placed_media_walk_through_regions_and_holes() {
    let mut rng = Generator::new(10);
    let holes = [Region::sphere(Vec3::ZERO, 0.4).unwrap(), Region::sphere(Vec3::new(0.5, 0.0, 0.0), 0.3).unwrap()];
    let shape = FractalNoise { frequency: 1.5, ..FractalNoise::default() };
    let noise = Noise::new(shape, ABSORPTION, SCATTERING, Phase::ISOTROPIC).unwrap();
    for _ in 0..300 {
        let placement = placement(&mut rng, 1.0);
        let placed = Placed::new(noise, Region::unit_cube(placement).unwrap()).with_holes(&holes);
        check_walk(&placed, &ray_around(&mut rng, &placement), 6.0, 1e-5, &mut rng);
        let ball = Placed::new(noise, Region::sphere(point(&mut rng, 1.0), 0.1 + uniform(&mut rng)).unwrap());
        check_walk(&ball, &ray_around(&mut rng, &placement), 6.0, 1e-5, &mut rng);
        let p = point(&mut rng, 1.0);
        let expected = if placed.contains(p) { noise.extinction(p) } else { Spectrum::ZERO };
        assert_eq!(placed.extinction(p), expected);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn intervals_lie_in_their_regions(
        seed in any::<u64>(), scale in prop::sample::select(vec![1e-6_f32, 1e-2, 1.0, 1e4, 1e9]),
    ) {
        let mut rng = Generator::new(seed);
        let placement = placement(&mut rng, scale);
        let cube = Region::unit_cube(placement).unwrap();
        let ball = Region::sphere(placement.translation, scale * (0.1 + uniform(&mut rng))).unwrap();
        let ray = ray_around(&mut rng, &placement);
        for region in [cube, ball] {
            let crossings = region.crossings(&ray);
            prop_assert_eq!(crossings.map(|c| (c[0].distance, c[1].distance)), region.interval(&ray));
            let Some([entry, exit]) = crossings else { continue };
            prop_assert!(entry.distance < exit.distance);
            prop_assert!(entry.normal.dot(ray.direction) <= 1e-5 && exit.normal.dot(ray.direction) >= -1e-5);
            let length = exit.distance - entry.distance;
            if length > 1e-3 * scale {
                let blur = 1e-5 * scale;
                for u in [0.1, 0.5, 0.9] {
                    // The ray may run along a face.
                    prop_assert!(around(ray.at(entry.distance + u * length), blur).any(|p| region.contains(p)));
                }
                prop_assert!(!region.contains(ray.at(entry.distance) + entry.normal * blur));
                prop_assert!(!region.contains(ray.at(exit.distance) + exit.normal * blur));
            }
        }
    }

    #[test]
    fn queries_are_total(
        origin in prop::array::uniform3(any::<f32>()), at in prop::array::uniform3(any::<f32>()),
        from in 0.0_f32..f32::MAX, u in prop::array::uniform2(0.0_f32..1.0),
    ) {
        let is_finite = |v: [f32; 3]| v.iter().all(|c| c.is_finite());
        prop_assume!(is_finite(origin) && is_finite(at));
        let mut rng = Generator::new(1);
        let mut voxels = Voxels::new([9, 5, 6], placement(&mut rng, 1.0), islands(&mut rng));
        let grid = voxels.grid();
        let shape = FractalNoise::default();
        let noise = Noise::new(shape, ABSORPTION, SCATTERING, Phase::ISOTROPIC).unwrap();
        let hole = [Region::sphere(Vec3::splat(0.5), 0.2).unwrap()];
        let ray = Ray::new(Vec3::from_array(origin), warp::uniform_sphere(Vec2::from_array(u)));
        let at = Vec3::from_array(at);
        for medium in [AnyMedium::from(grid), AnyMedium::from(noise)] {
            for region in [Region::Everywhere, Region::sphere(Vec3::ZERO, 2.0).unwrap()] {
                let placed = Placed::new(medium, region).with_holes(&hole);
                let segment = placed.majorant_segment(&ray, from);
                prop_assert!(segment.until > from && segment.majorant.is_valid() && segment.minorant.is_valid());
                prop_assert!(placed.extinction(at).is_valid());
                prop_assert!(placed.gradients(at).extinction.is_finite());
                prop_assert!(placed.extinction_hessian(at).xx.is_finite());
                prop_assert!(placed.mean_extinction(at, from).is_valid());
                let mut is_fine = true;
                placed.faces(&ray, &mut |f| is_fine &= f.normal.is_finite() && f.jump.is_finite());
                prop_assert!(is_fine);
            }
        }
    }
}
