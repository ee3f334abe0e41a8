use super::*;
use crate::host::Hit;
use crate::light::PointLight;
use crate::medium::{Homogeneous, Placed, Region};
use crate::path;
use crate::phase::{Lobe, Phase};
use crate::surface::Surface;

const BOX: Bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };

fn effort(paths: u32) -> PhotonEffort {
    PhotonEffort { bounds: BOX, cells: 5, degree: 2, paths, flights: u64::MAX, enough: u32::MAX }
}

/// Black, at `z = 0.1`.
struct Wall;

impl Scene for Wall {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let distance = (0.1 - ray.origin.z) / ray.direction.z;
        (distance > 1e-6 && distance < ray.length).then_some(Hit {
            distance,
            normal: Vec3::NEG_Z,
            shading: Vec3::NEG_Z,
            surface: Surface::BLACK,
            light: None,
        })
    }
}

/// Cells of 0.4 from -1 on: the wall lies within the middle layer.
#[test]
fn cells_that_a_surface_cuts_or_that_lie_in_the_dark_do_not_know() {
    let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC).unwrap();
    let lamps = [Light::Point(PointLight::from_flux(Vec3::new(0.0, 0.0, -0.5), Spectrum::ONE).unwrap())];
    let world = World { medium: &fog, scene: &Wall, lights: (&lamps).into() };
    let cells = PhotonGrid::lit(&world, &effort(4000), &path::Settings::default(), 1);
    let known = |z: f32| cells.scattered(Vec3::new(0.1, 0.1, z), Vec3::X, &fog.properties(Vec3::ZERO)).is_some();
    assert_eq!([-0.8, -0.4, 0.0, 0.15, 0.4].map(known), [true, true, false, false, false]);
}

/// White fog whose extinction is coloured, under an even sky of 1: as much light everywhere, in every channel.
#[test]
fn cells_of_coloured_fog_hold_the_light_of_every_channel() {
    let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::new(0.5, 1.5, 4.0), Phase::ISOTROPIC).unwrap();
    let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 1.0).unwrap());
    let sky = [Light::Constant(Spectrum::ONE)];
    let world = World { medium: &ball, scene: &crate::host::Empty, lights: (&sky).into() };
    let cells = PhotonGrid::lit(&world, &effort(800_000), &path::Settings::default(), 1);
    let properties = ball.properties(Vec3::ZERO);
    for point in [Vec3::ZERO, Vec3::splat(0.3), Vec3::new(0.0, -0.4, 0.1)] {
        let (light, _) = cells.scattered(point, Vec3::Z, &properties).unwrap();
        let off = (light.radiance - Spectrum::ONE).map(f32::abs).max_element();
        assert!(off < 0.05, "{point}: {light:?}");
    }
}

/// A long hall has eight cells across and no more in all than a cube; one that is not much longer than wide, and what is flat, as many along it as a cube.
#[test]
fn narrow_places_have_cells_across() {
    let counts = |size: Vec3| {
        let effort = PhotonEffort { bounds: Bounds { min: -0.5 * size, max: 0.5 * size }, cells: 32, ..effort(1) };
        effort.division().unwrap().0
    };
    assert_eq!(counts(Vec3::ONE), [32; 3]);
    assert_eq!(counts(Vec3::new(4.0, 16.0, 8.0)), [8, 32, 16]);
    assert_eq!(counts(Vec3::new(2.0, 2.0, 24.0)), [8, 8, 96]);
    for thin in [0.0, 1e-6, 1e-3, 0.05] {
        for size in [Vec3::new(1.0, 1.0, thin), Vec3::new(1.0, thin, thin)] {
            let counts = counts(size);
            assert!(counts.iter().product::<u32>() <= 2 * 32 * 32 * 32 && counts[0] >= 32, "{size}: {counts:?}");
        }
    }
}

/// Walls a little within the bounds: cells end at them, and all are whole; where fog ends far from the bounds, and where it is dark, cells reach on.
#[test]
fn cells_end_where_walls_do() {
    /// A room of 1.94 m, open towards what is far below.
    struct Room;
    impl Scene for Room {
        fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
            const HALF: f32 = 0.97;
            let walls = (0..6).filter_map(|i| {
                let normal = Vec3::AXES[i >> 1] * -sign(i & 1);
                let distance = (-HALF - ray.origin.dot(normal)) / ray.direction.dot(normal);
                (normal != Vec3::Y && ray.direction.dot(normal) < 0.0).then_some((distance, normal))
            });
            let (distance, normal) = walls.min_by(|a, b| a.0.total_cmp(&b.0))?;
            let surface = Surface::Lambert { reflectance: Spectrum::splat(0.5) };
            let is_met = distance > 1e-6 && distance < ray.length;
            is_met.then_some(Hit { distance, normal, shading: normal, surface, light: None })
        }
    }
    let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC).unwrap();
    let bounds = Bounds { min: Vec3::new(-1.0, -0.3, -1.0), max: Vec3::ONE };
    let low = Placed::new(fog, Region::bounds(bounds).unwrap());
    let lamps = [Light::Point(PointLight::from_flux(Vec3::Y * 0.3, Spectrum::ONE).unwrap())];
    let world = World { medium: &low, scene: &Room, lights: (&lamps).into() };
    let cells = PhotonGrid::lit(&world, &effort(40_000), &path::Settings::default(), 1);
    let Bounds { min, max } = cells.bounds();
    // Not beyond them, and within a hundredth of a cell.
    for found in [-min.x, -min.z, max.x, max.y, max.z] {
        assert!((0.966..=0.97).contains(&found), "{found}");
    }
    assert!((min.y + 1.0).abs() < 1e-6, "{min}");
    let point = Vec3::new(0.9, 0.9, -0.9);
    assert!(cells.scattered(point, Vec3::Z, &low.properties(point)).is_some());
}

/// What flows one way is scattered on by the phase function, as far as the degree of cells goes; light straight from a
/// lamp is not in them.
#[test]
fn cells_hold_directions_and_gradients_but_no_light_straight_from_lamps() {
    let phase = Lobe::HenyeyGreenstein { g: 0.4 };
    let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, phase).unwrap();
    let dark = Homogeneous::new(Spectrum::ONE, Spectrum::ZERO, phase).unwrap();
    let lamps = [Light::Point(PointLight::from_flux(Vec3::splat(-0.9), Spectrum::ONE).unwrap())];
    let black = World { medium: &dark, scene: &crate::host::Empty, lights: (&lamps).into() };
    let cells = PhotonGrid::lit(&black, &effort(2000), &path::Settings::default(), 1);
    assert!(cells.cells.as_slice().iter().all(|cell| cell.paths == 0), "nothing is scattered");

    let world = World { medium: &fog, ..black };
    let cells = PhotonGrid::lit(&world, &effort(100_000), &path::Settings::default(), 1);
    // Of five cells along each axis the third.
    let middle = cells.bounds().centre();
    let properties = fog.properties(middle);
    let at = |x: f32, to_eye: Vec3| cells.scattered(middle + Vec3::splat(x), to_eye, &properties).unwrap();
    let (away, towards) = (Vec3::ONE.normalize(), -Vec3::ONE.normalize());
    let ((ahead, _), (back, _)) = (at(0.0, away), at(0.0, towards));
    assert!(ahead.radiance[0] > 1.3 * back.radiance[0], "{ahead:?} {back:?}");
    // Light falls off away from the lamp, and linearly from cell to cell.
    let slope = ahead.gradient.channel(0).dot(away);
    let difference = (at(0.15, away).0.radiance[0] - at(-0.15, away).0.radiance[0]) / (0.3 * 3_f32.sqrt());
    assert!(slope < 0.0 && (slope / difference - 1.0).abs() < 1e-3, "{slope} {difference}");
    // Turning the direction does what the basis says.
    let turned = Vec3::new(1.0, 1.0, 1.1).normalize();
    let change = at(0.0, turned).0.radiance[0] - ahead.radiance[0];
    let told = at(0.0, (away + turned).normalize()).1.channel(0).dot(turned - away);
    assert!((change / told - 1.0).abs() < 0.01, "{change} {told}");
}

/// Through twelve free paths of fog that absorbs a fifth, light falls by thousands of times: of whole photons as many fewer would come to a cell at the other end.
#[test]
fn photons_come_to_dark_cells_as_to_bright_ones() {
    let fog = Homogeneous::new(Spectrum::splat(1.2), Spectrum::splat(4.8), Phase::ISOTROPIC).unwrap();
    let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 1.4).unwrap());
    let lamps = [Light::Point(PointLight::from_flux(Vec3::Z * 0.9, Spectrum::ONE).unwrap())];
    let world = World { medium: &ball, scene: &crate::host::Empty, lights: (&lamps).into() };
    let effort = PhotonEffort { cells: 8, enough: 100, ..effort(400_000) };
    let cells = PhotonGrid::lit(&world, &effort, &path::Settings::default(), 1);
    let cell = |z: f32| cells.cells.as_slice()[cells.number(cells.cell_of(Vec3::new(0.1, 0.1, z)).unwrap()) as usize];
    let [near, far] = [cell(0.6), cell(-0.9)];
    let darker = far.light / near.light;
    assert!(darker < 1e-3 && far.paths > 20, "{near:?} {far:?}");
    assert!(far.paths as f32 > 10.0 * darker * near.paths as f32, "{near:?} {far:?}");
}

#[test]
fn halves_of_the_photons_tell_what_all_differ_by_from_seed_to_seed() {
    const SEEDS: u64 = 64;
    let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC).unwrap();
    let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 1.0).unwrap());
    let lamps = [Light::Point(PointLight::from_flux(Vec3::splat(0.3), Spectrum::ONE).unwrap())];
    let world = World { medium: &ball, scene: &crate::host::Empty, lights: (&lamps).into() };
    let (mut sum, mut squares, mut halves) = (0.0, 0.0, 0.0);
    for seed in 0..SEEDS {
        let mut cells = PhotonGrid::lit(&world, &effort(4_000), &path::Settings::default(), seed);
        let mut light = |by: f32| {
            cells.turn(by);
            let point = Vec3::splat(-0.1);
            f64::from(cells.scattered(point, Vec3::X, &ball.properties(point)).unwrap().0.radiance[0])
        };
        let [all, even, odd, again] = [0.0, 1.0, -2.0, 1.0].map(&mut light);
        assert!((0.5 * (even + odd) / all - 1.0).abs() < 1e-5 && (again / all - 1.0).abs() < 1e-5);
        (sum, squares, halves) = (sum + all, squares + all * all, halves + (even - odd).powi(2) / 4.0);
    }
    let seeds = SEEDS as f64;
    let (told, seen) = (halves / seeds, (squares - sum * sum / seeds) / (seeds - 1.0));
    // Squares of 64 normal numbers: both vary by 18 %.
    assert!((0.5..2.0).contains(&(told / seen)), "{told:e} {seen:e}");
    assert!(told.sqrt() > 0.01 * sum / seeds, "{told:e}");
}

/// Where nothing scatters no walk ends, and photons leave nothing; slopes look one cell beyond.
#[test]
fn cells_far_from_all_fog_are_dark() {
    let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC).unwrap();
    let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 0.15).unwrap());
    let sky = [Light::Constant(Spectrum::ONE)];
    let world = World { medium: &ball, scene: &crate::host::Empty, lights: (&sky).into() };
    let effort = PhotonEffort { cells: 11, ..effort(100_000) };
    let cells = PhotonGrid::lit(&world, &effort, &path::Settings::default(), 1);
    let at = |i: u32| cells.scattered(Vec3::X * (2.0 / 11.0 * i as f32), Vec3::Z, &fog.properties(Vec3::ZERO));
    assert_eq!([0, 1, 2, 3, 4, 5].map(|i| at(i).is_some()), [true, true, true, false, false, false]);
    let (light, _) = at(0).unwrap();
    assert!((light.radiance[0] - 1.0).abs() < 0.1, "{light:?}");
    // Where nothing scatters at all, a first look is enough.
    let dark = Homogeneous::new(Spectrum::ONE, Spectrum::ZERO, Phase::ISOTROPIC).unwrap();
    let clear = World { medium: &dark, scene: &crate::host::Empty, lights: (&sky).into() };
    assert_eq!(PhotonGrid::lit(&clear, &effort, &path::Settings::default(), 1).paths(), rounds::FIRST);
}

/// A finer level goes on where a coarser one has ended; with another division or other random numbers all begins anew.
#[test]
fn more_photons_come_to_those_that_there_are() {
    let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC).unwrap();
    let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 1.0).unwrap());
    let sky = [Light::Constant(Spectrum::ONE)];
    let world = World { medium: &ball, scene: &crate::host::Empty, lights: (&sky).into() };
    let walk = path::Settings::default();
    let mut cells = PhotonGrid::lit(&world, &effort(2_000), &walk, 1);
    cells.finish(&effort(2_000), 1);
    assert_eq!(cells.paths(), 2_000);
    cells.prepare(&effort(400_000), 1).unwrap();
    assert_eq!((cells.paths(), cells.is_made()), (2_000, false));
    cells.light(&world, (&effort(400_000), &walk, 1));
    assert_eq!(cells.paths(), 400_000);
    // Those that the first few have not met, too.
    let at = |i: u32| Vec3::new((i % 4) as f32, (i / 4 % 4) as f32, (i / 16) as f32) * 0.3 - Vec3::splat(0.45);
    for point in (0..64).map(at) {
        let (light, _) = cells.scattered(point, Vec3::Z, &ball.properties(point)).unwrap();
        assert!((light.radiance[0] - 1.0).abs() < 0.1, "{point}: {light:?}");
    }
    let counted = f64::from(cells.counted) / 400_000.0;
    assert!((counted - rounds::COUNTED).abs() < 0.01, "{counted}");
    let (light, _) = cells.scattered(Vec3::splat(0.1), Vec3::Z, &ball.properties(Vec3::ZERO)).unwrap();
    assert!((light.radiance[0] - 1.0).abs() < 0.05, "{light:?}");
    for (other, seed) in [(PhotonEffort { cells: 6, ..effort(800_000) }, 1), (effort(800_000), 2), (effort(10), 1)] {
        cells.finish(&effort(400_000), 1);
        cells.prepare(&other, seed).unwrap();
        assert_eq!(cells.paths(), 0);
        cells.light(&world, (&effort(1), &walk, 1));
    }
}
