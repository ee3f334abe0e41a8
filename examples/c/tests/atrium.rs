//! The atrium through the interface, in Rust alone, and in C (`examples/atrium.c`): the same bits.

use fogbow::cache::{Asked, FilledRecords, RadianceCaches, Settings};
use fogbow::host::{Hit, Scene};
use fogbow::light::{Light, Sun};
use fogbow::math::{Bounds, Ray, Vec3, float};
use fogbow::medium::{Homogeneous, Placed, Region};
use fogbow::phase::{Lobe, Phase};
use fogbow::spectrum::Spectrum;
use fogbow::surface::Surface;
use fogbow::work;
use fogbow::world::{Outline, World};

use super::smoke_box::{film_point, line, picture};

/// What `examples/atrium.c` prints. Where the core's pictures change for a reason, this does.
const DIGESTS: &str = include_str!("../examples/atrium.txt");

const ERROR: f32 = 0.1;
const RAYS: u32 = 64;
const WALKS: u32 = 16;
const TAG: u64 = 1;
const NEAREST: f32 = 1e-4;

const STONE: [f32; 3] = [0.6, 0.55, 0.45];
const TILES: [f32; 3] = [0.35, 0.3, 0.28];
const GLAZE: [f32; 3] = [0.2, 0.35, 0.6];
const BALL: ([f32; 3], f32) = ([4.0, 0.8, 6.0], 0.8);

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|k| a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3])
}

struct Panel {
    corner: [f32; 3],
    u: [f32; 3],
    v: [f32; 3],
    normal: [f32; 3],
    colour: [f32; 3],
}

fn panel(corner: [f32; 3], u: [f32; 3], v: [f32; 3], colour: [f32; 3]) -> Panel {
    let normal = cross(u, v);
    let length = dot(normal, normal).sqrt();
    Panel { corner, u, v, normal: normal.map(|n| n / length), colour }
}

/// As `build` of `examples/atrium.h`.
fn panels() -> Vec<Panel> {
    let ring = [
        [0.3, 0.0],
        [0.2125, 0.2125],
        [0.0, 0.3],
        [-0.2125, 0.2125],
        [-0.3, 0.0],
        [-0.2125, -0.2125],
        [0.0, -0.3],
        [0.2125, -0.2125],
        [0.3, 0.0],
    ];
    let mut panels = vec![
        panel([0.0; 3], [0.0, 0.0, 12.0], [8.0, 0.0, 0.0], TILES),
        panel([0.0; 3], [0.0, 5.0, 0.0], [0.0, 0.0, 12.0], STONE),
        panel([8.0, 0.0, 0.0], [0.0, 0.0, 12.0], [0.0, 5.0, 0.0], STONE),
        panel([0.0; 3], [8.0, 0.0, 0.0], [0.0, 5.0, 0.0], STONE),
        panel([0.0, 0.0, 12.0], [0.0, 5.0, 0.0], [8.0, 0.0, 0.0], STONE),
    ];
    panels.extend((0..6).map(|i| panel([0.0, 5.0, 2.0 * i as f32], [8.0, 0.0, 0.0], [0.0, 0.0, 1.25], STONE)));
    for (x, z) in [2.0, 6.0].into_iter().flat_map(|x| [2.0, 6.0, 10.0].map(|z| (x, z))) {
        for pair in ring.windows(2) {
            let [a, b] = [pair[0], pair[1]];
            let along = [b[0] - a[0], 0.0, b[1] - a[1]];
            panels.push(panel([x + a[0], 0.0, z + a[1]], [0.0, 5.0, 0.0], along, STONE));
        }
    }
    panels
}

struct Atrium(Vec<Panel>);

impl Scene for Atrium {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let (o, d) = (ray.origin.to_array(), ray.direction.to_array());
        let less = |a: [f32; 3], b: [f32; 3]| [0, 1, 2].map(|k| a[k] - b[k]);
        let hit = |distance, normal, colour| {
            let (normal, surface) = (Vec3::from_array(normal), Surface::Lambert { reflectance: Spectrum(colour) });
            Some(Hit { distance, normal, shading: normal, surface, light: None })
        };
        let (mut nearest, mut found) = (ray.length, None);
        for panel in &self.0 {
            let from = less(o, panel.corner);
            let (p, q) = (cross(d, panel.v), cross(from, panel.u));
            let determinant = dot(panel.u, p);
            let (t, u, v) = (dot(panel.v, q) / determinant, dot(from, p) / determinant, dot(d, q) / determinant);
            if t > NEAREST && t < nearest && [u, v].iter().all(|at| (0.0..=1.0).contains(at)) {
                nearest = t;
                found = hit(t, panel.normal, panel.colour);
            }
        }
        let (centre, radius) = BALL;
        let from = less(o, centre);
        let half = dot(from, d);
        let root = (half * half - dot(from, from) + radius * radius).sqrt();
        let t = if -half - root > NEAREST { -half - root } else { -half + root };
        if t > NEAREST && t < nearest {
            found = hit(t, [0, 1, 2].map(|k| (from[k] + t * d[k]) / radius), GLAZE);
        }
        found
    }
}

/// As `fogbow_camera_ray` with the camera of `examples/atrium.h`.
fn camera_ray([x, y]: [f32; 2]) -> Ray {
    let (eye, target) = (Vec3::new(4.0, 1.7, 11.0), Vec3::new(4.0, 2.0, 0.0));
    let forward = (target - eye).normalize();
    let right = forward.cross(Vec3::Y).normalize();
    let half = float::tan(0.5 * 1.1);
    let (across, upwards) = ((2.0 * x - 1.0) * half, (1.0 - 2.0 * y) * half);
    let direction = forward + right * across + right.cross(forward) * upwards;
    Ray { origin: eye, direction: direction.normalize(), length: f32::INFINITY }
}

#[test]
fn the_atrium_in_c_has_the_bits_of_the_core() {
    let haze = Lobe::HenyeyGreenstein { g: 0.6 };
    let haze = Homogeneous::new(Spectrum::splat(0.01), Spectrum::splat(0.08), Phase::from(haze)).unwrap();
    let bounds = Bounds { min: Vec3::ZERO, max: Vec3::new(8.0, 5.0, 12.0) };
    let haze = Placed::new(haze, Region::bounds(bounds).unwrap());
    let sun = Sun::new(Vec3::new(0.36, 0.8, 0.48), Spectrum::new(30.0, 27.0, 22.0)).unwrap();
    let lights = [Light::Sun(sun), Light::Constant(Spectrum::new(0.4, 0.6, 1.0))];
    let scene = Atrium(panels());
    let world = World { medium: &haze, scene: &scene, lights: (&lights).into() };
    let settings = Settings::for_outline(&Outline::of(&world, bounds), ERROR).with_walks(WALKS);
    let settings = Settings { rays: RAYS, ..settings };
    let mut filling = RadianceCaches::new(settings).fill(Asked::View { ray: camera_ray, pixel: 0.01 });
    work::finish(&mut filling, &world, &mut FilledRecords::default());
    let caches = filling.finish();
    let picture = picture(|x, y, rng| caches.radiance(&camera_ray(film_point(x, y)), &world, rng).total());
    assert_eq!(
        line(&caches.to_bytes(TAG), &picture),
        DIGESTS,
        "examples/atrium.txt is what examples/atrium.c should print"
    );
}
