//! Known answers times the media of the core, and the path tracer against one that never connects.

use fogbow::host::{Empty, Hit, Medium, Properties, Scene};
use fogbow::light::{EnvironmentMap, Light, MeshLight, PointLight, QuadLight, SphereLight, Triangle};
use fogbow::math::{Affine3, Mat3, Ray, Vec2, Vec3, float::PI};
use fogbow::medium::{Density, DensityGrid, FractalNoise, Homogeneous, MinMax, Noise, Overlap, Placed, Region};
use fogbow::path::{self, Settings};
use fogbow::phase::{Lobe, Phase};
use fogbow::sampling::{Generator, distance::Equiangular, uniform, uniform2, warp};
use fogbow::spectrum::Spectrum;
use fogbow::surface::Surface;
use fogbow::transmittance::thickness::{Marching, optical_thickness};
use fogbow::transmittance::{flight, transmittance};
use fogbow::world::World;
use fogbow_tests::estimate::{Estimate, estimate};

const SIZE: [u32; 3] = [12, 10, 9];
const COLOURED: Spectrum = Spectrum::new(0.5, 3.0, 8.0);

/// Densities with vacuum, thin and thick parts.
fn densities() -> Vec<f32> {
    let [nx, ny, nz] = SIZE;
    let mut values = Vec::new();
    for z in 0..nz {
        for y in 0..ny {
            for x in 0..nx {
                let wave = (x as f32 * 0.9).sin() * (y as f32 * 0.7).cos() + (z as f32 * 0.8).sin();
                values.push(wave.clamp(0.0, 1.0));
            }
        }
    }
    values
}

fn placement() -> Affine3 {
    let turned = Mat3::from_axis_angle(Vec3::new(0.6, 0.8, 0.0), 0.7);
    let sized = turned * Mat3::from_diagonal(Vec3::new(2.0, 1.6, 1.8));
    Affine3::from_mat3_translation(sized, sized * Vec3::splat(-0.5))
}

fn shape(offset: f32) -> FractalNoise {
    FractalNoise { frequency: 1.7, offset, seed: 5, ..FractalNoise::default() }
}

fn through_the_middle(rng: &mut Generator) -> Ray {
    let eye = Vec3::new(0.3, -0.5, 4.0);
    Ray::new(eye, (warp::uniform_sphere(uniform2(rng)) * 0.8 - eye).normalize())
}

#[track_caller]
fn assert_white_furnace(medium: &dyn Medium, what: &str) {
    let sky = [Light::Constant(Spectrum::new(1.0, 2.0, 3.0))];
    let world = World { medium, scene: &Empty, lights: (&sky).into() };
    let seen =
        estimate(15_000, |rng| path::radiance(&through_the_middle(rng), &world, &Settings::default(), rng).total());
    seen.assert_is([1.0, 2.0, 3.0], 2e-5, what);
}

#[test]
fn every_medium_that_only_scatters_vanishes_under_a_uniform_sky() {
    let values = densities();
    let bytes: Vec<u8> = values.iter().map(|v| (v * 255.0) as u8).collect();
    let nothing = vec![0.0; values.len()];
    let holes = [Region::sphere(Vec3::new(0.2, 0.1, 0.3), 0.5).unwrap()];
    let count = DensityGrid::block_count(SIZE);
    for scattering in [Spectrum::splat(4.0), COLOURED] {
        let phase: Phase = Lobe::HenyeyGreenstein { g: 0.6 }.into();
        for (name, density) in [("f32", Density::F32(&values)), ("u8", Density::U8(&bytes))] {
            let mut blocks = vec![MinMax::default(); count];
            let white = Properties { scattering, phase, ..Properties::VACUUM };
            let grid = DensityGrid::new(SIZE, density, &white, placement(), &mut blocks).unwrap();
            assert_white_furnace(&grid, &format!("grid {name} {scattering:?}"));
            let placed = Placed::new(grid, Region::sphere(Vec3::ZERO, 1.1).unwrap()).with_holes(&holes);
            assert_white_furnace(&placed, &format!("grid {name} with holes {scattering:?}"));
            let mut other = vec![MinMax::default(); count];
            let both =
                Overlap::new(std::slice::from_ref(&placed), |m: &Placed<'_, DensityGrid<'_>>| m.medium().phase())
                    .unwrap();
            assert_white_furnace(&both, "overlap of one");
            let separate = grid_with_absorption(density, &nothing, scattering, &mut other);
            assert_white_furnace(&separate, &format!("grid {name}, absorption of its own, 0"));
        }
        let noise = Noise::new(shape(0.1), Spectrum::ZERO, scattering, phase).unwrap();
        let ball = Placed::new(noise, Region::sphere(Vec3::ZERO, 1.2).unwrap());
        assert_white_furnace(&ball.with_holes(&holes), &format!("noise with holes {scattering:?}"));
        let fog = Homogeneous::new(Spectrum::ZERO, scattering, phase).unwrap();
        let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 1.2).unwrap());
        assert_white_furnace(&ball.with_holes(&holes), &format!("fog with holes {scattering:?}"));
    }
}

fn grid_with_absorption<'a>(
    density: Density<'a>,
    absorption: &'a [f32],
    scattering: Spectrum,
    blocks: &'a mut [MinMax],
) -> DensityGrid<'a> {
    let more = vec![MinMax::default(); blocks.len()].leak();
    let smoke = Properties { absorption: Spectrum::ONE, scattering, ..Properties::VACUUM };
    DensityGrid::new(SIZE, density, &smoke, placement(), blocks)
        .and_then(|grid| grid.with_absorption_grid(Density::F32(absorption), more))
        .unwrap()
}

#[test]
fn overlapping_colours_vanish_too_even_where_a_channel_has_nothing() {
    let colours = [
        [Spectrum::new(2.0, 0.5, 0.1), Spectrum::new(0.1, 0.7, 3.0)],
        [Spectrum::new(2.0, 0.0, 0.0), Spectrum::new(1.0, 0.0, 0.0)],
        [Spectrum::new(0.0, 2.0, 1.0), Spectrum::new(0.0, 0.5, 3.0)],
        [Spectrum::new(0.0, 2.0, 0.0), Spectrum::new(1.0, 0.0, 0.0)],
    ];
    for pair in colours {
        let lobes = [Lobe::HenyeyGreenstein { g: 0.7 }, Lobe::Rayleigh];
        let balls = [0, 1].map(|i| {
            let fog = Homogeneous::new(Spectrum::ZERO, pair[i], lobes[i]).unwrap();
            Placed::new(fog, Region::sphere(Vec3::X * (i as f32 * 0.5), 1.0).unwrap())
        });
        let both = Overlap::new(&balls, |ball| ball.medium().phase()).unwrap();
        assert_white_furnace(&both, &format!("{pair:?}"));
    }
}

#[test]
fn mixtures_have_a_density_that_is_one() {
    let parts = [
        (Spectrum::new(2.0, 0.0, 0.0), Phase::from(Lobe::HenyeyGreenstein { g: 0.7 })),
        (Spectrum::new(1.0, 0.0, 0.0), Phase::from(Lobe::Rayleigh)),
    ];
    let phase = Phase::mix(parts).unwrap();
    for c in 0..3 {
        assert!((phase.moment(0)[c] - 1.0).abs() < 1e-6, "channel {c}");
    }
    let mut rng = Generator::new(3);
    for _ in 0..100 {
        let sample = phase.sample(Vec3::Z, uniform2(&mut rng));
        assert!((sample.weight[0] - 1.0).abs() < 1e-5, "{sample:?}");
    }
}

#[test]
fn transmittance_and_flights_agree_with_the_optical_thickness() {
    let values = densities();
    let count = DensityGrid::block_count(SIZE);
    let mut blocks = vec![MinMax::default(); count];
    let holes = [Region::sphere(Vec3::new(0.2, 0.1, 0.3), 0.3).unwrap()];
    for colour in [Spectrum::splat(1.5), Spectrum::new(0.0, 0.7, 3.0)] {
        let smoke = Properties { absorption: colour * 0.25, scattering: colour * 0.75, ..Properties::VACUUM };
        let grid = DensityGrid::new(SIZE, Density::F32(&values), &smoke, placement(), &mut blocks).unwrap();
        let noise = Noise::new(shape(0.2), colour * 0.5, colour * 0.5, Phase::ISOTROPIC).unwrap();
        let region = Region::sphere(Vec3::ZERO, 1.2).unwrap();
        let (grid, noise) = (Placed::new(grid, region), Placed::new(noise, region));
        let media: [(&str, &dyn Medium); 3] =
            [("grid", &grid), ("noise", &noise), ("noise with a hole", &noise.with_holes(&holes))];
        for (name, medium) in media {
            for k in 0..3 {
                let ray = through_the_middle(&mut Generator::new(k)).with_length(6.0);
                let exact = optical_thickness(&ray, medium, Marching::new(2e-4, 0.5)).transmitted();
                let exact = exact.0.map(f64::from);
                let what = format!("{name} {colour:?} ray {k}");
                let ratio = estimate(20_000, |rng| transmittance(medium, &ray, rng));
                ratio.assert_is(exact, 1e-4, &format!("ratio tracking, {what}"));
                let escapes = estimate(40_000, |rng| {
                    let flown = flight(medium, &ray, Spectrum::new(1.0, 0.3, 2.0), uniform(rng), rng);
                    if flown.collision.is_none() { flown.weight } else { Spectrum::ZERO }
                });
                escapes.assert_is(exact, 1e-4, &format!("delta tracking, {what}"));
            }
        }
    }
}

#[test]
fn glowing_media_look_like_emission_over_absorption() {
    let values = vec![1.0; densities().len()];
    let mut blocks = vec![MinMax::default(); DensityGrid::block_count(SIZE)];
    for scattering in [Spectrum::ZERO, Spectrum::splat(40.0), Spectrum::new(10.0, 20.0, 60.0)] {
        let (absorption, emission) = (Spectrum::splat(40.0), Spectrum::new(40.0, 80.0, 120.0));
        let fire = Properties { absorption, scattering, emission, phase: Phase::ISOTROPIC };
        let grid = DensityGrid::new(SIZE, Density::F32(&values), &fire, placement(), &mut blocks).unwrap();
        // Kirchhoff: under a sky of the same radiance a glowing body of any thickness vanishes.
        let sky = [Light::Constant(Spectrum::new(1.0, 2.0, 3.0))];
        let world = World { medium: &grid, scene: &Empty, lights: (&sky).into() };
        let seen =
            estimate(20_000, |rng| path::radiance(&through_the_middle(rng), &world, &Settings::default(), rng).total());
        seen.assert_is([1.0, 2.0, 3.0], 2e-5, &format!("{scattering:?}"));
    }
}

#[test]
fn what_glows_without_extinction_is_seen() {
    let values = vec![1.0; densities().len()];
    let nothing = vec![0.0; values.len()];
    let (mut a, mut b) = (
        vec![MinMax::default(); DensityGrid::block_count(SIZE)],
        vec![MinMax::default(); DensityGrid::block_count(SIZE)],
    );
    let smoke = Properties { absorption: Spectrum::ONE, scattering: Spectrum::ONE, ..Properties::VACUUM };
    let place = Affine3::from_translation(Vec3::splat(-0.5));
    let flame = DensityGrid::new(SIZE, Density::F32(&nothing), &smoke, place, &mut a)
        .and_then(|grid| grid.with_emission_grid(Density::F32(&values), Spectrum::new(1.0, 2.0, 3.0), &mut b))
        .unwrap();
    let emission = Spectrum::new(1.0, 2.0, 3.0);
    let cube = Region::unit_cube(Affine3::from_translation(Vec3::splat(-0.5))).unwrap();
    let fog = |absorption| Homogeneous::new(absorption, Spectrum::ZERO, Phase::ISOTROPIC).unwrap();
    let clear = Placed::new(fog(Spectrum::ZERO).with_emission(emission).unwrap(), cube);
    let red = Placed::new(fog(Spectrum::new(2.0, 0.0, 0.0)).with_emission(emission).unwrap(), cube);
    let red_seen = 0.5 * (1.0 - (-2.0f64).exp());
    let media: [(&dyn Medium, f64); 3] = [(&flame, 1.0), (&clear, 1.0), (&red, red_seen)];
    for (i, (medium, first)) in media.into_iter().enumerate() {
        let world = World { medium, scene: &Empty, lights: (&[]).into() };
        let ray = Ray::new(Vec3::new(0.1, 0.2, 3.0), Vec3::NEG_Z);
        let seen = estimate(60_000, |rng| path::radiance(&ray, &world, &Settings::default(), rng).total());
        seen.assert_is([first, 2.0, 3.0], 1e-4, &format!("medium {i}"));
        // A path that has lost a channel sees what glows in the others.
        let mut seen = estimate(60_000, |rng| {
            let u = uniform(rng);
            flight(medium, &ray, Spectrum::new(0.0, 1.0, 0.5), u, rng).emission
        });
        seen.mean[0] = first;
        seen.assert_is([first, 2.0, 3.0], 1e-4, &format!("flight in medium {i}"));
    }
}

#[test]
fn endless_media_end() {
    let start = std::time::Instant::now();
    let sky = [Light::Constant(Spectrum::ONE)];
    for offset in [0.5, -0.1, -0.6, -20.0] {
        for colour in [Spectrum::ONE, Spectrum::new(0.0, 0.5, 2.0)] {
            let noise = Noise::new(shape(offset), Spectrum::ZERO, colour, Phase::ISOTROPIC).unwrap();
            let ray = Ray::new(Vec3::ZERO, Vec3::new(0.6, 0.0, 0.8));
            let thickness = optical_thickness(&ray, &noise, Marching::new(0.05, 0.5));
            if offset > 0.0 {
                assert_eq!(thickness.transmitted()[2], 0.0, "{offset} {colour:?}");
            }
            let mut rng = Generator::new(1);
            assert!(transmittance(&noise, &ray, &mut rng).is_valid());
            let world = World { medium: &noise, scene: &Empty, lights: (&sky).into() };
            let settings = Settings { max_scatterings: 2, ..Settings::default() };
            assert!(path::radiance(&ray, &world, &settings, &mut rng).total().is_valid());
        }
    }
    // Minutes, if any of them went on to where `f32` ends.
    assert!(start.elapsed().as_secs() < 20, "{:?}", start.elapsed());
}

#[test]
fn equiangular_distances_keep_their_law_where_the_light_is_far_away_or_on_the_ray() {
    let cases = [
        (Vec3::ZERO, 1.0_f32, 3.0_f32),
        (Vec3::new(5.0, 0.0, 0.0), 1.0, 3.0),
        (Vec3::new(1e-4, 1e-5, 0.0), 1.0, 2.0),
        (Vec3::new(2e4, 10.0, 0.0), 1.0, 2.0),
        (Vec3::new(-3e4, 1.0, 1.0), 0.0, 5.0),
        (Vec3::new(2.0, 0.5, 0.0), 1.0, 3.0),
        (Vec3::new(-1.0, 0.1, 0.0), 0.0, f32::INFINITY),
    ];
    for (light, near, far) in cases {
        let law = Equiangular::new(Vec3::ZERO, Vec3::X, light, near, far).expect("a law");
        // ∫ f/pdf for a smooth f: the mean of samples is the integral.
        let n = 1 << 14;
        let f = |t: f64| (-t).exp() / (1.0 + t);
        let mut mean = 0.0;
        for i in 0..n {
            let t = law.sample((i as f32 + 0.5) / n as f32).clamp(near, far);
            mean += f(f64::from(t)) / f64::from(law.pdf(t)) / f64::from(n);
        }
        let end = f64::from(far.min(40.0));
        let (steps, near) = (200_000, f64::from(near));
        let exact: f64 = (0..steps)
            .map(|i| f(near + (end - near) * (f64::from(i) + 0.5) / f64::from(steps)) * (end - near))
            .sum::<f64>()
            / f64::from(steps);
        assert!((mean / exact - 1.0).abs() < 2e-3, "{light} {near} {far}: {mean} instead of {exact}");
    }
}

/// A room of analytic shapes: floor and wall, a sphere, and a light's own surface.
struct Room<'a> {
    ball: Surface,
    light: Option<Shape<'a>>,
}

#[derive(Clone, Copy)]
enum Shape<'a> {
    Triangles(&'a [Triangle], Surface),
    Sphere(Vec3, f32),
}

const FLOOR: f32 = -1.0;

fn sphere_hit(ray: &Ray, centre: Vec3, radius: f32) -> Option<f32> {
    let offset = ray.origin - centre;
    let b = offset.dot(ray.direction);
    let half2 = radius * radius - (offset - ray.direction * b).length_squared();
    if half2 < 0.0 {
        return None;
    }
    [-b - half2.sqrt(), -b + half2.sqrt()].into_iter().find(|&t| t > 1e-5 && t < ray.length)
}

fn triangle_hit(ray: &Ray, triangle: &Triangle) -> Option<f32> {
    let [a, b, c] = triangle.corners;
    let (e1, e2) = (b - a, c - a);
    let p = ray.direction.cross(e2);
    let det = e1.dot(p);
    if det.abs() < 1e-12 {
        return None;
    }
    let s = ray.origin - a;
    let (u, q) = (s.dot(p) / det, s.cross(e1));
    let (v, t) = (ray.direction.dot(q) / det, e2.dot(q) / det);
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 1e-5 && t < ray.length).then_some(t)
}

impl Scene for Room<'_> {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let wall = Surface::Lambert { reflectance: Spectrum::new(0.8, 0.6, 0.3) };
        let mut best: Option<Hit> = None;
        let mut offer = |distance: f32, normal: Vec3, surface: Surface, light: Option<u32>| {
            if best.is_none_or(|b| distance < b.distance) {
                best = Some(Hit { distance, normal, shading: normal, surface, light });
            }
        };
        let t = (FLOOR - ray.origin.y) / ray.direction.y;
        if t > 1e-5 && t < ray.length && ray.at(t).length() < 4.0 {
            offer(t, Vec3::Y, wall, None);
        }
        let centre = Vec3::new(-0.5, -0.5, 0.0);
        if let Some(t) = sphere_hit(ray, centre, 0.5) {
            offer(t, (ray.at(t) - centre).normalize(), self.ball, None);
        }
        match self.light {
            Some(Shape::Sphere(centre, radius)) => {
                if let Some(t) = sphere_hit(ray, centre, radius) {
                    offer(t, (ray.at(t) - centre).normalize(), Surface::BLACK, Some(0));
                }
            }
            Some(Shape::Triangles(triangles, surface)) => {
                for triangle in triangles {
                    if let Some(t) = triangle_hit(ray, triangle) {
                        offer(t, triangle.cross().normalize(), surface, Some(0));
                    }
                }
            }
            None => {}
        }
        best
    }
}

/// Follows the same physics without a single connection: light counts where the path runs into it.
fn brute_force<M: Medium + ?Sized>(
    ray: &Ray,
    world: &World<'_, M, Room<'_>>,
    max_scatterings: u32,
    rng: &mut Generator,
) -> Spectrum {
    let (mut ray, mut sum, mut throughput) = (*ray, Spectrum::ZERO, Spectrum::ONE);
    let mut scatterings = 0;
    loop {
        let hit = world.scene.closest_hit(&ray);
        let segment = hit.map_or(ray, |hit| ray.with_length(hit.distance));
        let u = uniform(rng);
        let flown = flight(world.medium, &segment, throughput, u, rng);
        throughput *= flown.weight;
        let u = uniform2(rng);
        if let Some(properties) = flown.collision {
            throughput *= properties.albedo();
            let sample = properties.phase.sample(-ray.direction, u);
            throughput *= sample.weight;
            ray = Ray::new(segment.at(flown.distance), sample.to_light);
        } else if let Some(hit) = hit {
            if let Some(index) = hit.light {
                sum += throughput
                    * world.lights[index as usize].radiance(ray.at(hit.distance), hit.normal, -ray.direction);
            }
            let choice = uniform(rng);
            let Some(sample) = hit.surface.sample(hit.normal, -ray.direction, choice, u) else { return sum };
            throughput *= sample.weight;
            let side = 1e-4_f32.copysign(hit.normal.dot(sample.to_light));
            ray = Ray::new(segment.at(hit.distance) + hit.normal * side, sample.to_light);
            if hit.surface == Surface::Null {
                continue;
            }
        } else {
            for light in world.lights.iter() {
                sum += throughput * light.background(ray.direction);
            }
            return sum;
        }
        scatterings += 1;
        if scatterings > max_scatterings || throughput.is_black() {
            return sum;
        }
    }
}

#[test]
fn connections_and_hits_add_up_to_what_hits_alone_find() {
    let corners =
        [Vec3::new(-0.6, 1.0, -0.6), Vec3::new(0.6, 1.0, -0.6), Vec3::new(0.6, 1.0, 0.6), Vec3::new(-0.6, 1.0, 0.6)];
    let face = [
        Triangle { corners: [corners[0], corners[1], corners[2]] },
        Triangle { corners: [corners[0], corners[2], corners[3]] },
    ];
    let bent = [
        Triangle { corners: [corners[0], corners[1], corners[2]] },
        Triangle { corners: [corners[0], corners[2], corners[3] + Vec3::Y * 0.4] },
    ];
    let radiance = Spectrum::new(3.0, 2.0, 1.0);
    let quad = QuadLight::new(corners[0], corners[1] - corners[0], corners[3] - corners[0], radiance).unwrap();
    let mut table = [0.7, 0.7];
    let mesh = MeshLight::new(&bent, &mut table, radiance).unwrap();
    let (centre, radius) = (Vec3::new(0.5, 0.3, 0.2), 0.35);
    let sphere = SphereLight::new(centre, radius, radiance).unwrap();
    let texels: Vec<Spectrum> = (0..8 * 6).map(|i| radiance * if i % 7 == 2 { 4.0 } else { 0.2 }).collect();
    let (mut weights, mut column) = (vec![0.0; 48], vec![0.0; 6]);
    let map = EnvironmentMap::new(8, 6, &texels, &mut weights, &mut column, Mat3::from_rotation_y(0.6)).unwrap();
    let outwards = quad.normal();
    assert!(outwards.dot(face[0].cross()) > 0.0);
    let lights: [(&str, Light<'_>, Option<Shape<'_>>); 6] = [
        ("quad", Light::Quad(quad), Some(Shape::Triangles(&face, Surface::BLACK))),
        ("quad on a null surface", Light::Quad(quad), Some(Shape::Triangles(&face, Surface::Null))),
        ("mesh", Light::Mesh(mesh), Some(Shape::Triangles(&bent, Surface::BLACK))),
        ("sphere", Light::Sphere(sphere), Some(Shape::Sphere(centre, radius))),
        ("constant", Light::Constant(radiance), None),
        ("map", Light::Environment(&map), None),
    ];
    let region = Region::sphere(Vec3::ZERO, 2.0).unwrap();
    let grey = Homogeneous::new(Spectrum::splat(0.1), Spectrum::splat(0.5), Lobe::HenyeyGreenstein { g: 0.4 });
    let coloured =
        Homogeneous::new(Spectrum::splat(0.05), Spectrum::new(0.2, 0.5, 1.0), Lobe::HenyeyGreenstein { g: 0.4 });
    let values = densities();
    let mut blocks = vec![MinMax::default(); DensityGrid::block_count(SIZE)];
    let smoke = Properties {
        absorption: Spectrum::splat(0.2),
        scattering: COLOURED * 0.3,
        emission: Spectrum::ZERO,
        phase: Lobe::HenyeyGreenstein { g: -0.3 }.into(),
    };
    let grid = DensityGrid::new(SIZE, Density::F32(&values), &smoke, placement(), &mut blocks).unwrap();
    let (grey, coloured) = (Placed::new(grey.unwrap(), region), Placed::new(coloured.unwrap(), region));
    let media: [(&str, &dyn Medium); 4] =
        [("vacuum", &Empty), ("grey", &grey), ("coloured", &coloured), ("grid", &grid)];
    let balls = [
        Surface::Phong { diffuse: Spectrum::splat(0.3), specular: Spectrum::splat(0.6), exponent: 12.0 },
        Surface::Mirror { reflectance: Spectrum::splat(0.9) },
        Surface::Dielectric { eta: 1.5, reflectance: Spectrum::ONE, transmittance: Spectrum::ONE },
    ];
    for (i, (light_name, light, shape)) in lights.iter().enumerate() {
        for (j, (medium_name, medium)) in media.iter().enumerate() {
            for limit in [1, 5] {
                let scene = Room { ball: balls[(i + j) % 3], light: *shape };
                // A second light makes choices count; it has no surface and is black.
                let dark = Light::Constant(Spectrum::ZERO);
                let lights = [*light, dark];
                let world = World { medium: *medium, scene: &scene, lights: lights[..1 + (i + j) % 2].into() };
                let eye = |rng: &mut Generator| {
                    let (from, u) = (Vec3::new(0.2, 0.4, 3.0), uniform2(rng));
                    let to = Vec3::new(u.x * 2.0 - 1.2, u.y * 1.2 - 1.0, 0.0);
                    Ray::new(from, (to - from).normalize())
                };
                let settings = Settings { max_scatterings: limit, ..Settings::default() };
                let seen = estimate(20_000, |rng| path::radiance(&eye(rng), &world, &settings, rng).total());
                let Estimate { mean: truth, error } =
                    estimate(60_000, |rng| brute_force(&eye(rng), &world, limit, rng));
                let both = [0, 1, 2].map(|c: usize| seen.error[c].hypot(error[c]));
                let what = format!("{light_name}, {medium_name}, {limit} scatterings");
                Estimate { mean: seen.mean, error: both }.assert_is(truth, 1e-3, &what);
            }
        }
    }
}

#[test]
fn small_sphere_lights_become_points() {
    let fog = Homogeneous::new(Spectrum::splat(0.1), Spectrum::splat(0.4), Lobe::HenyeyGreenstein { g: 0.5 });
    let fog = Placed::new(fog.unwrap(), Region::sphere(Vec3::ZERO, 2.0).unwrap());
    let centre = Vec3::new(0.5, 0.6, 0.2);
    let settings = Settings { max_scatterings: 3, lights_visible: false, ..Settings::default() };
    let see = |light: Light<'_>, shape: Option<Shape<'_>>| {
        let scene = Room { ball: Surface::Lambert { reflectance: Spectrum::splat(0.5) }, light: shape };
        let lights = [light];
        let world = World { medium: &fog, scene: &scene, lights: (&lights).into() };
        let ray = Ray::between(Vec3::new(0.2, 0.4, 3.0), Vec3::new(0.1, -0.6, 0.3));
        let ray = Ray::new(ray.origin, ray.direction);
        estimate(150_000, |rng| path::radiance(&ray, &world, &settings, rng).total())
    };
    let point = see(Light::Point(PointLight::new(centre, Spectrum::ONE).unwrap()), None);
    for radius in [1e-2_f32, 1e-3] {
        let radiance = Spectrum::splat(1.0 / (PI * radius * radius));
        let light = SphereLight::new(centre, radius, radiance).unwrap();
        let sphere = see(Light::Sphere(light), Some(Shape::Sphere(centre, radius)));
        let both = [0, 1, 2].map(|c: usize| point.error[c].hypot(sphere.error[c]));
        Estimate { mean: sphere.mean, error: both }.assert_is(point.mean, 2e-3, &format!("radius {radius}"));
    }
}

#[test]
fn phong_reflects_no_more_than_it_gets_and_is_reciprocal() {
    let mut rng = Generator::new(9);
    for exponent in [0.0, 1.0, 7.5, 300.0] {
        let surface = Surface::Phong { diffuse: Spectrum::splat(0.4), specular: Spectrum::splat(0.6), exponent };
        for _ in 0..8 {
            let to_eye = warp::cosine_hemisphere(uniform2(&mut rng));
            let Estimate { mean, error } = estimate(20_000, |rng| {
                surface.sample(Vec3::Z, to_eye, uniform(rng), uniform2(rng)).map_or(Spectrum::ZERO, |s| s.weight)
            });
            assert!(mean[0] <= 1.0 + 4.5 * error[0] + 1e-5, "exponent {exponent}: {} ± {}", mean[0], error[0]);
            let to_light = warp::cosine_hemisphere(uniform2(&mut rng));
            let there = surface.value(Vec3::Z, to_eye, to_light)[0];
            let back = surface.value(Vec3::Z, to_light, to_eye)[0];
            assert!((there - back).abs() <= 1e-4 * (there + back), "exponent {exponent}: {there}, {back}");
        }
    }
}

#[test]
fn rays_through_extremes_stay_numbers() {
    let mut rng = Generator::new(5);
    let tiny = Spectrum::splat(1e-42);
    let media = [
        Homogeneous::new(Spectrum::ZERO, Spectrum::ZERO, Phase::ISOTROPIC).unwrap(),
        Homogeneous::new(tiny, tiny, Phase::ISOTROPIC).unwrap(),
        Homogeneous::new(Spectrum::ZERO, Spectrum::new(0.0, 1.0, 1e6), Phase::ISOTROPIC).unwrap(),
        Homogeneous::new(Spectrum::splat(1e20), Spectrum::splat(1e30), Phase::ISOTROPIC).unwrap(),
        Homogeneous::new(Spectrum::ZERO, Spectrum::ZERO, Phase::ISOTROPIC)
            .and_then(|m| m.with_emission(Spectrum::ONE))
            .unwrap(),
    ];
    let bright = Spectrum::splat(1e38);
    let origin = Vec3::ZERO;
    let lights = [
        Light::Point(PointLight::new(origin, Spectrum::ONE).unwrap()),
        Light::Sphere(SphereLight::new(origin, 1e-3, Spectrum::ONE).unwrap()),
        Light::Sphere(SphereLight::new(Vec3::splat(1e25), 1.0, Spectrum::ONE).unwrap()),
        Light::Quad(QuadLight::new(origin, Vec3::X, Vec3::Y, Spectrum::ONE).unwrap()),
        Light::Constant(Spectrum::ONE),
        Light::Constant(bright * 0.0),
    ];
    let scene = Room { ball: Surface::Mirror { reflectance: Spectrum::ONE }, light: None };
    let settings = Settings { max_scatterings: 3, ..Settings::default() };
    for (i, medium) in media.iter().enumerate() {
        for origin in [0.0, 1e-30, 1.0, 1e7, 1e15] {
            for length in [0.0, 1e-30, 1.0, 1e30, f32::INFINITY] {
                for lights in [&lights[..0], &lights[..1], &lights[..]] {
                    let world = World { medium, scene: &scene, lights: lights.into() };
                    let direction = warp::uniform_sphere(Vec2::new(uniform(&mut rng), uniform(&mut rng)));
                    let ray = Ray::new(Vec3::splat(origin), direction.normalize()).with_length(length);
                    let seen = path::radiance(&ray, &world, &settings, &mut rng).total();
                    assert!(seen.is_valid(), "medium {i} from {origin}, length {length}: {seen:?}");
                }
            }
        }
    }
}
