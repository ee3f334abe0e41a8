//! The smoke box through the interface and without it: the same bits, which `examples/smoke_box.c` has, too.

use core::ffi::{CStr, c_void};
use core::ptr;

use fogbow::cache::{Asked, FilledRecords, RadianceCaches, Settings, USUAL_ERROR};
use fogbow::host::{Hit, Scene};
use fogbow::light::{Light, QuadLight};
use fogbow::math::{Bounds, Ray, Vec3, float};
use fogbow::medium::{Homogeneous, Placed, Region};
use fogbow::phase::Phase;
use fogbow::sampling::{Generator, independent, pixel_key};
use fogbow::spectrum::Spectrum;
use fogbow::surface::Surface;
use fogbow::work;
use fogbow::world::{Outline, World};
use fogbow_c::*;

/// What `examples/smoke_box.c` prints. Where the core's pictures change for a reason, this does.
pub(crate) const DIGESTS: &str = include_str!("../examples/smoke_box.txt");

/// As in `examples/smoke_box.c`.
const SIDE: u32 = 64;
const SAMPLES: u32 = 2;
const TAG: u64 = 1;
const RAYS: u32 = 256;
const WALKS: u32 = 32;
const NEAREST: f32 = 1e-4;

/// Axis, place, normal, half a side, colour, and whether it is the lamp, as in `examples/smoke_box.h`.
const WALLS: [(usize, f32, f32, f32, [f32; 3], bool); 6] = [
    (1, -1.0, 1.0, 1.0, [0.725, 0.71, 0.68], false),
    (1, 1.0, -1.0, 1.0, [0.725, 0.71, 0.68], false),
    (2, -1.0, 1.0, 1.0, [0.725, 0.71, 0.68], false),
    (0, -1.0, 1.0, 1.0, [0.63, 0.065, 0.05], false),
    (0, 1.0, -1.0, 1.0, [0.14, 0.45, 0.091], false),
    (1, 0.998, -1.0, 0.3, [0.0; 3], true),
];

const BALLS: [([f32; 3], f32, [f32; 3]); 2] =
    [([-0.42, -0.6, -0.3], 0.4, [0.95, 0.93, 0.88]), ([0.45, -0.68, 0.3], 0.32, [0.93, 0.62, 0.5])];

struct Box;

impl Scene for Box {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let (o, d) = (ray.origin.to_array(), ray.direction.to_array());
        let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let (mut nearest, mut found) = (ray.length, None);
        for (axis, at, side, half, colour, is_lamp) in WALLS {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let t = (at - o[axis]) / d[axis];
            let is_met = t > NEAREST && t < nearest;
            if is_met && (o[u] + t * d[u]).abs() <= half && (o[v] + t * d[v]).abs() <= half {
                nearest = t;
                let normal = Vec3::from_array([0, 1, 2].map(|k| if k == axis { side } else { 0.0 }));
                let surface = Surface::Lambert { reflectance: Spectrum(colour) };
                found = Some(Hit { distance: t, normal, shading: normal, surface, light: is_lamp.then_some(0) });
            }
        }
        for (centre, radius, colour) in BALLS {
            let from = [0, 1, 2].map(|k| o[k] - centre[k]);
            let half = dot(from, d);
            let root = (half * half - dot(from, from) + radius * radius).sqrt();
            let t = if -half - root > NEAREST { -half - root } else { -half + root };
            // No root is no number, which is not greater than anything.
            if t > NEAREST && t < nearest {
                nearest = t;
                let normal = Vec3::from_array([0, 1, 2].map(|k| (from[k] + t * d[k]) / radius));
                let surface = Surface::Mirror { reflectance: Spectrum(colour) };
                found = Some(Hit { distance: t, normal, shading: normal, surface, light: None });
            }
        }
        found
    }
}

/// Fowler, Noll and Vo's.
fn digest(bytes: impl IntoIterator<Item = u8>) -> u64 {
    bytes.into_iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

pub(crate) fn line(caches: &[u8], picture: &[f32]) -> String {
    let picture = picture.iter().flat_map(|value| value.to_le_bytes());
    format!("caches {:016x}, picture {:016x}\n", digest(caches.iter().copied()), digest(picture))
}

fn camera_ray([x, y]: [f32; 2]) -> Ray {
    let half = float::tan(0.5 * 0.628_318_53);
    let direction = Vec3::new((2.0 * x - 1.0) * half, (1.0 - 2.0 * y) * half, -1.0);
    Ray { origin: Vec3::new(0.0, 0.0, 4.0), direction: direction.normalize(), length: f32::INFINITY }
}

pub(crate) fn film_point(x: u32, y: u32) -> [f32; 2] {
    [x, y].map(|k| (k as f32 + 0.5) / SIDE as f32)
}

/// Sums of samples, of seed 0.
pub(crate) fn picture(light: impl Fn(u32, u32, &mut Generator) -> Spectrum) -> Vec<f32> {
    let pixels = (0..SIDE).flat_map(|y| (0..SIDE).map(move |x| (x, y)));
    let summed = pixels.map(|(x, y)| {
        (0..SAMPLES).fold(Spectrum::ZERO, |sum, sample| sum + light(x, y, &mut independent(0, pixel_key(x, y), sample)))
    });
    summed.flat_map(|sum| sum.0).collect()
}

/// Nothing of this crate.
fn native() -> String {
    let fog = Homogeneous::new(Spectrum::splat(0.03), Spectrum::splat(0.57), Phase::ISOTROPIC).unwrap();
    let bounds = Bounds { min: Vec3::splat(-1.001), max: Vec3::splat(1.001) };
    let smoke = Placed::new(fog, Region::bounds(bounds).unwrap());
    let corner = Vec3::new(-0.3, 0.998, -0.3);
    let lamp = QuadLight::new(corner, 0.6 * Vec3::X, 0.6 * Vec3::Z, Spectrum::new(15.0, 13.0, 10.0)).unwrap();
    let lights = [Light::Quad(lamp)];
    let world = World { medium: &smoke, scene: &Box, lights: (&lights).into() };
    let settings = Settings::for_outline(&Outline::of(&world, bounds), USUAL_ERROR).with_walks(WALKS);
    let settings = Settings { rays: RAYS, ..settings };
    let mut filling = RadianceCaches::new(settings).fill(Asked::View { ray: camera_ray, pixel: 0.01 });
    work::finish(&mut filling, &world, &mut FilledRecords::default());
    let caches = filling.finish();
    let picture = picture(|x, y, rng| caches.radiance(&camera_ray(film_point(x, y)), &world, rng).total());
    line(&caches.to_bytes(TAG), &picture)
}

pub(crate) fn check(status: fogbow_status) {
    if status != fogbow_status::FOGBOW_OK {
        // SAFETY: a string of this thread, and no other call in between.
        panic!("{status:?}: {}", unsafe { CStr::from_ptr(fogbow_message()) }.to_string_lossy());
    }
}

unsafe extern "C" fn closest_hit(_: *mut c_void, ray: *const fogbow_ray, hit: *mut fogbow_hit) -> i32 {
    // SAFETY: pointers of the library, good during the call.
    let (ray, hit) = unsafe { (&*ray, &mut *hit) };
    let native = Ray { origin: ray.origin.into(), direction: ray.direction.into(), length: ray.length };
    let Some(found) = Box.closest_hit(&native) else { return 0 };
    (hit.distance, hit.normal) = (found.distance, found.normal.to_array());
    (hit.surface, hit.reflectance) = match found.surface {
        Surface::Mirror { reflectance } => (FOGBOW_SURFACE_MIRROR, reflectance.0),
        other => (FOGBOW_SURFACE_LAMBERT, other.albedo().0),
    };
    hit.light = found.light.unwrap_or(FOGBOW_NO_LIGHT);
    1
}

unsafe extern "C" fn eye_ray(_: *const c_void, at: *const f32, ray: *mut fogbow_ray) {
    // SAFETY: pointers of the library, good during the call.
    let (found, ray) = unsafe { (camera_ray(at.cast::<[f32; 2]>().read()), &mut *ray) };
    *ray = plain(&found);
}

fn plain(ray: &Ray) -> fogbow_ray {
    fogbow_ray { origin: ray.origin.to_array(), direction: ray.direction.to_array(), length: ray.length }
}

/// The world by the interface.
pub(crate) fn world() -> *mut fogbow_world {
    let (mut fog, mut placed, mut world) = (ptr::null_mut(), ptr::null_mut(), ptr::null_mut());
    let smoke = fogbow_properties { absorption: [0.03; 3], scattering: [0.57; 3], ..Default::default() };
    let bounds = fogbow_box { lower: [-1.001; 3], upper: [1.001; 3] };
    let lamp = fogbow_light {
        kind: FOGBOW_LIGHT_QUAD,
        position: [-0.3, 0.998, -0.3],
        direction: [0.0; 3],
        edge_u: [0.6, 0.0, 0.0],
        edge_v: [0.0, 0.0, 0.6],
        radius: 0.0,
        beam: 0.0,
        cutoff: 0.0,
        exponent: 0.0,
        emission: [15.0, 13.0, 10.0],
    };
    let scene = fogbow_host_scene {
        size: size_of::<fogbow_host_scene>() as u32,
        reserved: 0,
        context: ptr::null_mut(),
        closest_hit: Some(closest_hit),
        is_blocked: None,
    };
    // SAFETY: pointers to what lives until the end of the calls; the callback has no context.
    unsafe {
        check(fogbow_medium_homogeneous(&raw const smoke, &raw mut fog));
        check(fogbow_medium_in_box(fog, &raw const bounds, &raw mut placed));
        let parts = fogbow_world_parts {
            size: size_of::<fogbow_world_parts>() as u32,
            reserved: 0,
            medium: placed,
            scene: &raw const scene,
            lights: &raw const lamp,
            light_count: 1,
            bounds,
        };
        check(fogbow_world_new(&raw const parts, &raw mut world));
        // The world keeps them.
        check(fogbow_medium_free(fog));
        check(fogbow_medium_free(placed));
    }
    world
}

pub(crate) fn view() -> fogbow_view {
    fogbow_view { size: size_of::<fogbow_view>() as u32, pixel: 0.01, context: ptr::null(), ray: Some(eye_ray) }
}

/// New caches of the world, to be filled.
pub(crate) fn caches(world: *const fogbow_world) -> *mut fogbow_caches {
    let mut caches = ptr::null_mut();
    let size = size_of::<fogbow_settings>() as u32;
    let (rays, walks) = (RAYS, WALKS);
    let settings = fogbow_settings { size, error: 0.0, pixels: 0, rays, walks, is_single_cached: 0, seed: 0 };
    // SAFETY: pointers to what lives until the end of the call.
    check(unsafe { fogbow_caches_new(world, &raw const settings, &raw mut caches) });
    caches
}

/// What the program in C prints, of caches that are filled.
pub(crate) fn digests(world: *const fogbow_world, caches: *const fogbow_caches) -> String {
    let (mut size, mut picture) = (0, Vec::new());
    // SAFETY: pointers to what lives until the end of the calls, of the sizes that are said.
    let bytes = unsafe {
        check(fogbow_caches_save(caches, TAG, ptr::null_mut(), 0, &raw mut size));
        let mut bytes = vec![0; size];
        check(fogbow_caches_save(caches, TAG, bytes.as_mut_ptr(), size, ptr::null_mut()));
        for y in 0..SIDE {
            let mut sums = [0.0; 3 * SIDE as usize];
            let rays: Vec<fogbow_ray> = (0..SIDE).map(|x| plain(&camera_ray(film_point(x, y)))).collect();
            for sample in 0..SAMPLES {
                let chance = fogbow_chance { seed: 0, first_key: pixel_key(0, y), sample, reserved: 0 };
                let mut light = [0.0; 3 * SIDE as usize];
                let (rays, light_of) = (rays.as_ptr(), light.as_mut_ptr());
                check(fogbow_radiance(caches, world, rays, SIDE as usize, chance, light_of, ptr::null_mut()));
                sums.iter_mut().zip(light).for_each(|(sum, light)| *sum += light);
            }
            picture.extend(sums);
        }
        bytes
    };
    line(&bytes, &picture)
}

#[test]
fn the_interface_has_the_bits_of_the_core() {
    let (world, view) = (world(), view());
    let caches = caches(world);
    let mut work = ptr::null_mut();
    // SAFETY: pointers to what lives until the end of the calls.
    unsafe {
        check(fogbow_fill_view(caches, world, &raw const view, &raw mut work));
        check(fogbow_work_step(work, 0, ptr::null_mut()));
        check(fogbow_work_free(work));
    }
    let by_interface = digests(world, caches);
    assert_eq!(by_interface, native());
    assert_eq!(by_interface, DIGESTS, "examples/smoke_box.txt is what examples/smoke_box.c should print");
    // SAFETY: handles of this test.
    unsafe {
        check(fogbow_caches_free(caches));
        check(fogbow_world_free(world));
    }
}
