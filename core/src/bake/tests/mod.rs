//! Bakes against what is known of their worlds.

use alloc::vec::Vec;

use glam::{Vec3, Vec3Swizzles};

use super::bytes::{self, ProbeBytesError};
use super::*;
use crate::bytes::Damage;
use crate::host::{Empty, Hit, Medium, Scene};
use crate::light::{Light, Lights, PointLight};
use crate::math::float::{INV_FOUR_PI, PI};
use crate::math::{Bounds, Ray};
use crate::medium::{Homogeneous, Placed, Region};
use crate::path;
use crate::phase::{Lobe, Phase, deflection};
use crate::sampling::{Generator, uniform};
use crate::spectrum::Spectrum;
use crate::surface::Surface;
use crate::work::{Rounds, finish, step};
use crate::world::{Outline, World};

mod earlier;
mod levels;

const BOX: Bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
const SH2: ProbeBasis = ProbeBasis::SphericalHarmonics { degree: 2 };

/// Standard errors by which a mean may miss what it should be: errors of a dozen passes are themselves not sure.
const ERRORS: f32 = 6.0;

fn haze(albedo: f32, extinction: f32, g: f32) -> Homogeneous {
    let scattering = Spectrum::splat(albedo * extinction);
    Homogeneous::new(Spectrum::splat(extinction) - scattering, scattering, Lobe::HenyeyGreenstein { g }).unwrap()
}

fn lamp(at: Vec3, power: Spectrum) -> Light<'static> {
    Light::Point(PointLight::new(at, power).unwrap())
}

fn settings<M: Medium, S: Scene>(world: &World<'_, M, S>, counts: [u32; 3]) -> BakeSettings {
    BakeSettings::for_outline(&Outline::of(world, BOX), counts)
}

fn baked<M: Medium, S: Scene>(settings: BakeSettings, world: &World<'_, M, S>) -> ProbeGrid<'static> {
    let mut bake = Bake::new(settings).unwrap();
    finish(&mut bake, world, &mut BakedProbes::default());
    assert!(!bake.is_cut());
    bake.finish()
}

fn bits(grid: &ProbeGrid<'_>) -> Vec<u8> {
    let mut all = Vec::new();
    let Ok(()) = bytes::write(grid, 0, |part| {
        all.extend_from_slice(part);
        Ok::<_, core::convert::Infallible>(())
    });
    all
}

/// A wall across x, black, with outward normals.
struct Wall {
    /// Where it begins and ends (m).
    faces: [f32; 2],
}

impl Scene for Wall {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let hit = |i: usize| {
            let distance = (self.faces[i] - ray.origin.x) / ray.direction.x;
            let normal = if i == 0 { Vec3::NEG_X } else { Vec3::X };
            let hit = Hit { distance, normal, shading: normal, surface: Surface::BLACK, light: None };
            (distance > 1e-6 && distance < ray.length).then_some(hit)
        };
        [0, 1].into_iter().filter_map(hit).min_by(|a, b| a.distance.total_cmp(&b.distance))
    }
}

#[test]
fn a_furnace_is_as_bright_as_its_sky_from_everywhere() {
    let (fog, sky) = (haze(1.0, 0.7, 0.4), [Light::Constant(Spectrum::new(1.0, 2.0, 0.5))]);
    let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 1.0).unwrap());
    let world = World { medium: &ball, scene: &Empty, lights: (&sky).into() };
    for (basis, quantity, due) in [
        (SH2, Quantity::InScattered, libm::sqrtf(4.0 * PI)),
        // Irradiance π L in all directions.
        (SH2, Quantity::Irradiance, PI * libm::sqrtf(4.0 * PI)),
        (ProbeBasis::AmbientCube, Quantity::InScattered, 1.0),
        (ProbeBasis::AmbientCube, Quantity::Irradiance, PI),
        (ProbeBasis::Fluence, Quantity::InScattered, 4.0 * PI),
        (ProbeBasis::Fluence, Quantity::Irradiance, 4.0 * PI),
    ] {
        let settings = BakeSettings { basis, quantity, ..settings(&world, [4, 4, 4]) };
        let grid = baked(settings, &world);
        // A mean over colours of 3.5 / 3, whatever holds it.
        let level = grid.level() / if quantity == Quantity::Irradiance { f64::from(PI) } else { 1.0 };
        assert!((level - 3.5 / 3.0).abs() < 0.02, "{basis:?} {quantity:?}: {level}");
        let (mut missed, mut count) = (0, 0);
        for (index, probe) in grid.probes().iter().enumerate() {
            assert_eq!(probe.state(), ProbeState::Valid, "the corners' cells touch the ball");
            for number in 0..basis.count() {
                let is_mean = number == 0 || basis == ProbeBasis::AmbientCube;
                let (due, error) = (if is_mean { due } else { 0.0 }, grid.error(index, number));
                let off = (grid.held(index)[number][0] - due).abs();
                assert!(off < 0.15 * grid.basis.level(grid.held(index)), "{basis:?} {number}: {off}");
                missed += u32::from(off > 3.0 * error);
                count += 1;
            }
        }
        assert!(missed * 100 <= count * 3, "{basis:?} {quantity:?}: {missed} of {count} beyond three errors");
        let value = grid.value(0.1 * Vec3::ONE, Vec3::Y);
        assert!((value[1] / value[0] - 2.0).abs() < 1e-3 && (value[2] / value[0] - 0.5).abs() < 1e-3, "colours");
    }
}

#[test]
fn light_of_a_lamp_scattered_once_has_its_closed_form() {
    let (fog, at) = (haze(0.8, 0.9, 0.6), Vec3::new(0.2, -0.3, 0.1));
    let lights = [lamp(at, Spectrum::new(1.0, 2.0, 3.0))];
    let world = World { medium: &fog, scene: &Empty, lights: (&lights).into() };
    let settings = BakeSettings {
        basis: ProbeBasis::AmbientCube,
        paths: path::Settings { max_scatterings: 1, ..path::Settings::default() },
        ..settings(&world, [3, 4, 5])
    };
    let grid = baked(settings, &world);
    let phase = Phase::from(Lobe::HenyeyGreenstein { g: 0.6 });
    for index in 0..60 {
        let point = grid.lattice().centre(index);
        let (to_light, r) = ((at - point).normalize(), at.distance(point));
        for (axis, held) in AXES.into_iter().zip(grid.held(index)) {
            let due = phase.value(deflection(to_light, axis)) * lights_at(r, 0.9);
            assert!((held[1] / due[1] - 1.0).abs() < 1e-4, "{index}: {} instead of {}", held[1], due[1]);
        }
        assert_eq!((grid.error(index, 0), grid.passes(index)), (0.0, 2), "nothing is random");
        let Probe { extinction, albedo, .. } = grid.probes()[index];
        assert!((extinction[0] - 0.9).abs() < 1e-5 && (albedo[0] - 0.8).abs() < 1e-5);
    }
    // The same in spherical harmonics is a projection of it.
    let settings = BakeSettings { basis: SH2, ..settings };
    let grid = baked(settings, &world);
    let mut due = [Spectrum::ZERO; 9];
    let point = grid.lattice().centre(7);
    let to_light = (at - point).normalize();
    let light = lights_at(at.distance(point), 0.9);
    crate::sh::project(16, |to_eye| phase.value(deflection(to_light, to_eye)) * light, &mut due);
    for (held, due) in grid.held(7).iter().zip(due) {
        assert!((held[2] - due[2]).abs() < 1e-4 * light[2], "{} instead of {}", held[2], due[2]);
    }
    // None of it is indirect.
    let grid = baked(BakeSettings { orders: Orders::Indirect, ..settings }, &world);
    assert!(grid.held(7).iter().all(|number| number.is_black()));
}

/// Irradiance of the lamp across its light, `r` away.
fn lights_at(r: f32, extinction: f32) -> Spectrum {
    Spectrum::new(1.0, 2.0, 3.0) * (crate::math::float::exp(-extinction * r) / (r * r))
}

/// Against the path tracer's own light at a point, which draws other directions.
#[test]
fn light_of_all_orders_is_that_of_the_path_tracer() {
    let (fog, lights) = (haze(0.9, 1.5, 0.3), [lamp(Vec3::new(0.0, 0.2, 2.0), Spectrum::ONE)]);
    let block = Placed::new(fog, Region::sphere(Vec3::ZERO, 1.5).unwrap());
    let wall = Wall { faces: [-0.9, -0.7] };
    let world = World { medium: &block, scene: &wall, lights: (&lights).into() };
    let settings = BakeSettings { error: 0.01, basis: ProbeBasis::AmbientCube, ..settings(&world, [2, 1, 1]) };
    let grids = [Orders::All, Orders::Multiple].map(|orders| baked(BakeSettings { orders, ..settings }, &world));
    let (index, phase, rng) = (1, Lobe::HenyeyGreenstein { g: 0.3 }.into(), &mut Generator::new(3));
    let point = grids[0].lattice().centre(index);
    for (face, axis) in AXES.into_iter().enumerate() {
        let (mut sums, mut squares) = ([0.0_f64; 2], [0.0_f64; 2]);
        const PATHS: u32 = 40_000;
        for _ in 0..PATHS {
            let light = path::in_scattered(&world, point, axis, &phase, &path::Settings::default(), rng);
            // The walls are black: all that was scattered before comes from the medium.
            for (i, light) in [light.single + light.multiple, light.multiple].into_iter().enumerate() {
                sums[i] += f64::from(light[0]);
                squares[i] += f64::from(light[0]).powi(2);
            }
        }
        for (i, grid) in grids.iter().enumerate() {
            let mean = sums[i] / f64::from(PATHS);
            let variance = (squares[i] / f64::from(PATHS) - mean * mean) / f64::from(PATHS);
            let off = (f64::from(grid.held(index)[face][0]) - mean).abs();
            let error = libm::sqrt(variance + f64::from(grid.error(index, face)).powi(2));
            assert!(off < 4.0 * error, "{axis} {i}: off by {off}, {} errors of {mean}", off / error);
            assert!(error < 0.05 * mean, "{axis} {i}: {error} of {mean} tells nothing");
        }
    }
}

#[test]
fn light_of_two_lamps_is_the_sum_of_both() {
    let (fog, [a, b]) = (haze(0.9, 1.0, 0.2), [-0.8, 0.9].map(|x| lamp(Vec3::new(x, 0.1, 1.3), Spectrum::ONE)));
    let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 1.2).unwrap());
    let of = |lights: &[Light<'_>]| {
        let world = World { medium: &ball, scene: &Empty, lights: Lights::from(lights) };
        baked(settings(&world, [3, 3, 3]), &world)
    };
    let [both, first, second] = [of(&[a, b]), of(&[a]), of(&[b])];
    for index in 0..27 {
        for number in 0..9 {
            let [both_, first_, second_] = [&both, &first, &second].map(|grid| grid.held(index)[number][0]);
            let error: f32 = [&both, &first, &second].map(|grid| grid.error(index, number).powi(2)).iter().sum();
            let off = (both_ - first_ - second_).abs();
            assert!(off <= ERRORS * libm::sqrtf(error) + 1e-5, "{index}, {number}: {off}");
        }
    }
}

/// A lamp on a wall: a disc that shines to one side, as a light and as a surface.
struct Panel;

impl Scene for Panel {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let distance = (-0.9 - ray.origin.x) / ray.direction.x;
        let is_hit = distance > 1e-6 && distance < ray.length && ray.at(distance).yz().abs().max_element() < 0.5;
        let surface = Surface::Lambert { reflectance: Spectrum::splat(0.5) };
        let light = (ray.direction.x < 0.0).then_some(1);
        is_hit.then_some(Hit { distance, normal: Vec3::X, shading: Vec3::X, surface, light })
    }
}

#[test]
fn light_of_each_lamp_by_itself_adds_up() {
    let panel = crate::light::QuadLight::new(Vec3::new(-0.9, -0.5, -0.5), Vec3::Y, Vec3::Z, Spectrum::ONE).unwrap();
    let lights = [lamp(Vec3::new(1.3, 0.0, 0.3), Spectrum::ONE), Light::Quad(panel)];
    let ball = Placed::new(haze(0.9, 1.0, 0.2), Region::sphere(Vec3::ZERO, 0.8).unwrap());
    let all = World { medium: &ball, scene: &Panel, lights: (&lights).into() };
    let settings = BakeSettings { basis: ProbeBasis::Fluence, ..settings(&all, [3, 3, 3]) };
    let both = baked(settings, &all);
    let each = [0, 1].map(|number| {
        let scene = OneLight { scene: &Panel, number };
        let lights = core::slice::from_ref(&lights[number as usize]).into();
        baked(settings, &World { medium: &ball, scene: &scene, lights })
    });
    for index in 0..27 {
        let [all, first, second] = [&both, &each[0], &each[1]].map(|grid| grid.held(index)[0][0]);
        let error: f32 = [&both, &each[0], &each[1]].map(|grid| grid.error(index, 0).powi(2)).iter().sum();
        assert!(
            (all - first - second).abs() <= ERRORS * libm::sqrtf(error) + 1e-5,
            "{index}: {all}, {first} + {second}"
        );
        assert!(second > 0.0 && first > 0.0);
    }
}

#[test]
fn look_ups_are_trilinear_and_end_at_the_outermost_probes() {
    let world = World { medium: &haze(0.5, 1.0, 0.0), scene: &Empty, lights: (&[]).into() };
    let settings = BakeSettings { basis: ProbeBasis::Fluence, ..settings(&world, [4, 3, 2]) };
    let mut grid = baked(settings, &world);
    for index in 0..24 {
        let Vec3 { x, y, z } = grid.lattice().centre(index);
        grid.memory.values.as_mut_slice()[index] = Spectrum::splat(3.0 + x - 0.5 * y + 2.0 * z + x * y * z);
    }
    let at = |point: Vec3| {
        let mut held = [Spectrum::ZERO];
        assert!((grid.look_up(point, &mut held) - 1.0).abs() < 1e-6);
        held[0][0]
    };
    for index in 0..24 {
        let due = grid.held(index)[0][0];
        assert!((at(grid.lattice().centre(index)) - due).abs() < 2e-6, "but for the rounding of coordinates");
    }
    // Half way between two along x, between four, and anywhere between eight, what is trilinear is exact.
    for (x, y, z) in [(-0.5, 0.0, 0.5), (0.0, 0.3, -0.5), (0.1, -0.6, 0.2), (-0.7, 0.61, 0.49)] {
        let due = 3.0 + x - 0.5 * y + 2.0 * z + x * y * z;
        assert!((at(Vec3::new(x, y, z)) - due).abs() < 1e-5, "{x} {y} {z}");
    }
    assert!((at(Vec3::new(9.0, 9.0, 9.0)) - grid.held(23)[0][0]).abs() < 2e-6);
    let mut held = [Spectrum::ONE];
    assert!(grid.look_up(Vec3::NAN, &mut held).is_finite() && held[0].is_finite());
}

#[test]
fn coarse_grids_are_told_where_light_bends() {
    let world = World { medium: &haze(0.5, 1.0, 0.0), scene: &Empty, lights: (&[]).into() };
    let settings = BakeSettings { basis: ProbeBasis::Fluence, ..settings(&world, [8, 6, 5]) };
    let mut grid = baked(settings, &world);
    let light = |point: Vec3| 4.0 + 3.0 * point.x + 2.0 * point.x * point.x - point.y * point.y * point.y;
    for index in 0..240 {
        grid.memory.values.as_mut_slice()[index] = Spectrum::splat(light(grid.lattice().centre(index)));
    }
    let index = grid.lattice().index(Vec3::new(0.1, 0.2, 0.1)).unwrap();
    let (centre, cell) = (grid.lattice().centre(index), grid.lattice().cell());
    // Mixed half way along x and y, and there: both bends miss into directions of their own, so that the sum is a bound.
    let off = |axis: Vec3| {
        let point = centre + 0.5 * cell * axis;
        (grid.value(point, Vec3::X)[0] / INV_FOUR_PI - light(point)).abs()
    };
    let (found, [x, y]) = (grid.coarseness(index), [Vec3::X, Vec3::Y].map(off));
    assert!((x - 2.0 * cell.x * cell.x / 4.0).abs() < 1e-4, "{x}");
    assert!(found >= x.max(y) && found < 1.6 * (x + y), "{found} for {x} and {y}");
    grid.memory.values.as_mut_slice().fill(Spectrum::ONE);
    assert_eq!(grid.relative_coarseness(), [0.0; 2]);
}

#[test]
fn noise_is_not_taken_for_bends() {
    let (fog, sky) = (haze(1.0, 0.7, 0.0), [Light::Constant(Spectrum::ONE)]);
    let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 2.0).unwrap());
    let world = World { medium: &ball, scene: &Empty, lights: (&sky).into() };
    // A furnace: nothing varies, and errors are a tenth.
    let grid = baked(BakeSettings { error: 0.1, basis: ProbeBasis::Fluence, ..settings(&world, [8, 8, 8]) }, &world);
    let [usual, _] = grid.relative_coarseness();
    // Noise alone would be √6/8 of an error on each of three axes.
    assert!(usual < 0.6 * 3.0 * 0.306 * grid.relative_error(), "{usual}, with errors of {}", grid.relative_error());
}

fn by_photons<M: Medium, S: Scene>(settings: BakeSettings, world: &World<'_, M, S>) -> ProbeGrid<'static> {
    let bounds = Bounds { min: Vec3::splat(-1.5), max: Vec3::splat(1.5) };
    let mut bake = Bake::new(settings).unwrap().with_photons(FlightMemory::default(), bounds);
    finish(&mut bake, world, &mut BakedProbes::default());
    assert!(!bake.is_cut());
    bake.finish()
}

#[test]
fn photons_bring_the_light_that_paths_find() {
    // Before and behind a leaning floor, in a ball of coloured fog that is not all of the box; a lamp beside, a sky around.
    let scattering = Spectrum::new(0.3, 0.7, 3.0);
    let fog = Homogeneous::new(Spectrum::splat(0.1), scattering, Lobe::HenyeyGreenstein { g: 0.4 }).unwrap();
    let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 1.3).unwrap());
    let lights = [lamp(Vec3::new(1.4, 0.3, 0.2), Spectrum::ONE), Light::Constant(Spectrum::splat(0.02))];
    let world = World { medium: &ball, scene: &Floor, lights: (&lights).into() };
    for (basis, quantity, orders) in [
        (SH2, Quantity::InScattered, Orders::All),
        (SH2, Quantity::Irradiance, Orders::Indirect),
        (ProbeBasis::AmbientCube, Quantity::InScattered, Orders::Multiple),
        (ProbeBasis::Fluence, Quantity::InScattered, Orders::Indirect),
    ] {
        let settings = BakeSettings { basis, quantity, orders, error: 0.03, ..settings(&world, [7, 6, 5]) };
        let [found, due] = [by_photons(settings, &world), baked(settings, &world)];
        let apart = found.deviation(&due);
        assert_eq!(apart.probes as usize, found.probes().iter().filter(|probe| probe.is_valid()).count());
        // Means over cells, of a third of the ball's radius here, are off by less than what the grid is too coarse for in any case.
        let [coarse, _] = due.relative_coarseness();
        assert!(apart.bias.abs() < 4.0 * apart.bias_error + 0.2 * coarse, "{basis:?} {orders:?}: {apart:?}");
        assert!(apart.spread < coarse, "{basis:?} {quantity:?} {orders:?}: {apart:?}, coarse {coarse}");
    }
}

/// A white sheet across the box, leaning.
struct Floor;

impl Scene for Floor {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let normal = Vec3::new(0.1, 1.0, -0.2).normalize();
        let distance = (-0.55 - ray.origin.dot(normal)) / ray.direction.dot(normal);
        let is_hit = distance > 1e-6 && distance < ray.length && ray.at(distance).length() < 1.5;
        let normal = if ray.direction.dot(normal) < 0.0 { normal } else { -normal };
        let surface = Surface::Lambert { reflectance: Spectrum::splat(0.6) };
        is_hit.then_some(Hit { distance, normal, shading: normal, surface, light: None })
    }
}

#[test]
fn photons_in_any_order_and_after_any_interruption_give_the_same_bits() {
    let lights = [lamp(Vec3::new(0.2, 1.2, 0.0), Spectrum::ONE)];
    let ball = Placed::new(haze(0.9, 1.2, 0.5), Region::sphere(Vec3::ZERO, 1.0).unwrap());
    let world = World { medium: &ball, scene: &Floor, lights: (&lights).into() };
    let settings = BakeSettings { error: 0.1, most_passes: 12, ..settings(&world, [9, 5, 6]) };
    let due = bits(&by_photons(settings, &world));
    let bounds = Bounds { min: Vec3::splat(-1.5), max: Vec3::splat(1.5) };
    let photons = |bake: Bake<'static, 'static>| bake.with_photons(FlightMemory::default(), bounds);
    // Backwards and by way of bytes; left after every so many jobs, saved, read, gone on with.
    let mut bake = photons(Bake::new(settings).unwrap());
    let jobs = |bake: &Bake<'_, '_>| Rounds::<World<'_, Placed<Homogeneous>, Floor>>::jobs(bake);
    let mut turn = 0;
    while !jobs(&bake).is_empty() {
        let some = jobs(&bake);
        let some = some.start..some.end.min(some.start + 7);
        let mut outputs: Vec<BakedProbes<'_>> = some.clone().map(|_| BakedProbes::default()).collect();
        for job in some.clone().rev() {
            let mut output = BakedProbes::default();
            bake.run(job, &world, &mut output);
            outputs[(job - some.start) as usize].read(&output.to_bytes()).unwrap();
        }
        for output in &outputs {
            Rounds::<World<'_, Placed<Homogeneous>, Floor>>::accept(&mut bake, output);
        }
        turn += 1;
        if turn % 5 == 0 {
            let saved = bits(bake.grid());
            bake = photons(Bake::resume(bytes::read(&saved, 0, BakeMemory::default()).unwrap(), settings).unwrap());
        }
    }
    assert!(bits(&bake.finish()) == due);
    // Lent memory that is too small is told.
    let mut few = [PhotonFlight::default(); 50];
    let memory = FlightMemory { flights: (&mut few[..]).into(), ..FlightMemory::default() };
    let mut bake = Bake::new(settings).unwrap().with_photons(memory, bounds);
    step(&mut bake, &world, &mut BakedProbes::default());
    assert!(bake.is_cut());
}

/// A lamp before a wall: behind it all is dark.
fn before_a_wall(faces: [f32; 2], test: impl FnOnce(ProbeGrid<'static>)) {
    let (fog, lights) = (haze(0.9, 1.0, 0.0), [lamp(Vec3::new(-0.9, 0.0, 0.0), Spectrum::ONE)]);
    let world = World { medium: &fog, scene: &Wall { faces }, lights: (&lights).into() };
    let settings = BakeSettings {
        basis: ProbeBasis::Fluence,
        paths: path::Settings { max_scatterings: 1, ..path::Settings::default() },
        ..settings(&world, [8, 4, 4])
    };
    test(baked(settings, &world));
}

#[test]
fn nothing_leaks_through_a_wall_with_probes_in_it() {
    // Centres of cells at ±0.125, ±0.375: one of them in the wall.
    before_a_wall([0.05, 0.2], |mut grid| {
        let states = [ProbeState::Valid, ProbeState::Valid, ProbeState::InWall, ProbeState::Valid];
        let index = |x: f32| grid.lattice().index(Vec3::new(x, 0.1, 0.1)).unwrap();
        assert_eq!([-0.4, -0.1, 0.1, 0.4].map(|x| grid.probes()[index(x)].state()), states);
        assert!(grid.held(index(0.1))[0].is_black() && grid.error(index(0.1), 0) == 0.0);
        assert_eq!(grid.leaks(), 0, "all pairs across the wall have a probe in it");
        let before = grid.value(Vec3::new(0.0, 0.1, 0.1), Vec3::X)[0];
        for x in [0.21, 0.3, 0.5, 0.9] {
            assert_eq!(grid.value(Vec3::new(x, 0.1, 0.1), Vec3::X)[0], 0.0, "behind the wall, before it {before}");
        }
        assert!(before > 0.01);
        // Mixed without regard to validity, what was dilated into the wall from both sides leaks: why look-ups regard it.
        let wall = index(0.1);
        assert_eq!(grid.dilate(), 16);
        assert_eq!(grid.probes()[wall].state(), ProbeState::InWall);
        let share = grid.held(wall)[0][0] * INV_FOUR_PI / before;
        assert!(share > 0.1 && share < 0.9, "{share} of the light before the wall is in it");
        let mut held = [Spectrum::ZERO];
        assert!(grid.look_up(Vec3::new(0.21, 0.1, 0.1), &mut held) < 0.7 && held[0].is_black());
    });
}

#[test]
fn walls_between_probes_are_told() {
    // Between the probes at -0.125 and 0.125.
    before_a_wall([-0.02, 0.02], |grid| {
        assert!(grid.probes().iter().all(|probe| probe.state() == ProbeState::Valid));
        assert_eq!(grid.leaks(), 16, "one for each row of probes");
        let index = |x: f32| grid.lattice().index(Vec3::new(x, 0.1, 0.1)).unwrap();
        assert_eq!(grid.probes()[index(-0.1)].walls(), [true, false, false]);
        assert_eq!(grid.probes()[index(0.1)].walls(), [false; 3]);
        // Look-ups leave out probes on the other side; mixed without regard to sides, light leaks.
        let light = |x: f32| grid.value(Vec3::new(x, 0.1, 0.1), Vec3::X)[0];
        let [before, probe] = [-0.021, -0.125].map(light);
        assert!(before > 0.0 && (before / probe - 1.0).abs() < 1e-4, "that of the last probe before it");
        for x in [0.021, 0.05, 0.12, 0.3] {
            assert!(light(x) < 1e-4 * before, "{x} behind the wall");
        }
        let weights = grid.lattice().around(Vec3::new(0.03, 0.1, 0.1)).unwrap();
        let mixed: Spectrum = weights.iter().map(|&(index, weight)| grid.held(index)[0] * weight).sum();
        assert!(mixed[0] * INV_FOUR_PI > 0.3 * before);
    });
}

/// Two half spaces parted by a plane that leans: light of one below, of two above.
#[test]
fn planes_that_lean_part_probes_exactly() {
    struct Sheet {
        normal: Vec3,
        at: f32,
    }
    impl Scene for Sheet {
        fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
            let distance = (self.at - ray.origin.dot(self.normal)) / ray.direction.dot(self.normal);
            let is_hit = distance > 1e-6 && distance < ray.length;
            // As a sheet with two sides: its back is no inside of a wall.
            let normal = if ray.direction.dot(self.normal) < 0.0 { self.normal } else { -self.normal };
            let hit = Hit { distance, normal, shading: normal, surface: Surface::BLACK, light: None };
            is_hit.then_some(hit)
        }
    }
    let (fog, mut rng) = (haze(0.9, 1.0, 0.0), Generator::new(5));
    for (normal, at) in [
        (Vec3::new(1.0, 0.3, 0.0), 0.1),
        (Vec3::new(1.0, 1.0, 1.0), 0.21),
        (Vec3::new(0.2, -0.3, 1.0), -0.33),
        (Vec3::new(-1.0, 0.9, -0.8), 0.07),
    ] {
        let sheet = Sheet { normal: normal.normalize(), at };
        let world = World { medium: &fog, scene: &sheet, lights: (&[]).into() };
        let settings = BakeSettings { basis: ProbeBasis::Fluence, most_passes: 2, ..settings(&world, [6, 6, 6]) };
        let mut grid = baked(settings, &world);
        let side = |point: Vec3| if point.dot(sheet.normal) > at { 2.0 } else { 1.0 };
        for index in 0..216 {
            grid.memory.values.as_mut_slice()[index] = Spectrum::splat(side(grid.lattice().centre(index)));
        }
        let (mut wrong, mut asked) = (0, 0);
        for _ in 0..2000 {
            let point = warp_to_box(&mut rng) * 0.8;
            // Within a thousandth of a cell of a surface without thickness, half floats do not tell sides apart.
            if (point.dot(sheet.normal) - at).abs() > 1e-3 {
                let mut held = [Spectrum::ZERO];
                grid.look_up(point, &mut held);
                wrong += u32::from((held[0][0] - side(point)).abs() > 1e-3);
                asked += 1;
            }
        }
        assert!(wrong * 500 <= asked, "{normal}: {wrong} of {asked} points");
    }
}

fn warp_to_box(rng: &mut Generator) -> Vec3 {
    Vec3::new(uniform(rng), uniform(rng), uniform(rng)) * 2.0 - 1.0
}

#[test]
fn dilation_reaches_everything_and_invents_no_light() {
    before_a_wall([-0.5, 0.6], |mut grid| {
        let most = (0..grid.lattice().cell_count()).map(|i| grid.held(i)[0][0]).fold(0.0, f32::max);
        let invalid = grid.probes().iter().filter(|probe| probe.state() != ProbeState::Valid).count();
        assert_eq!((invalid, grid.dilate()), (4 * 16, 4 * 16));
        assert!(grid.memory.values.as_slice().iter().all(|v| v[0] >= 0.0 && v[0] <= most));
        let [lit, dark] = [-0.375, 0.375].map(|x| grid.lattice().index(Vec3::new(x, 0.1, 0.1)).unwrap());
        // Two probes deep from either side, each has the light of its side.
        assert!(grid.held(lit)[0][0] > 0.0 && grid.held(dark)[0].is_black());
        assert_eq!(grid.dilate(), 4 * 16, "again the same");
    });
}

#[test]
fn far_from_any_medium_nothing_is_baked() {
    let (fog, lights) = (haze(0.9, 1.0, 0.0), [lamp(Vec3::ZERO, Spectrum::ONE)]);
    let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 0.3).unwrap());
    let world = World { medium: &ball, scene: &Empty, lights: (&lights).into() };
    let grid = baked(BakeSettings { most_passes: 2, ..settings(&world, [8, 8, 8]) }, &world);
    let state = |at: Vec3| grid.probes()[grid.lattice().index(at).unwrap()].state();
    assert_eq!(
        [0.1, 0.4, 0.9].map(|x| state(Vec3::splat(x))),
        [ProbeState::Valid, ProbeState::Valid, ProbeState::Empty]
    );
    // Surfaces need light anywhere.
    let settings = BakeSettings { most_passes: 2, quantity: Quantity::Irradiance, ..settings(&world, [8, 8, 8]) };
    assert!(baked(settings, &world).probes().iter().all(|probe| probe.state() == ProbeState::Valid));
}

#[test]
fn any_order_of_jobs_and_any_interruption_give_the_same_bits() {
    let (fog, lights) = (haze(0.9, 1.2, 0.5), [lamp(Vec3::new(0.2, 1.5, 0.0), Spectrum::ONE)]);
    let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 1.0).unwrap());
    let world = World { medium: &ball, scene: &Wall { faces: [-0.3, -0.2] }, lights: (&lights).into() };
    let settings = BakeSettings { error: 0.1, most_passes: 20, ..settings(&world, [9, 5, 6]) };
    let due = bits(&baked(settings, &world));

    // Backwards, some at a time, some results lost.
    let mut bake = Bake::new(settings).unwrap();
    let mut turn = 0;
    while !Rounds::<World<'_, Placed<Homogeneous>, Wall>>::jobs(&bake).is_empty() {
        let jobs = Rounds::<World<'_, Placed<Homogeneous>, Wall>>::jobs(&bake);
        let jobs = jobs.start..jobs.end.min(jobs.start + 5);
        let mut outputs: Vec<BakedProbes<'_>> = jobs.clone().map(|_| BakedProbes::default()).collect();
        for job in jobs.clone().rev() {
            bake.run(job, &world, &mut outputs[(job - jobs.start) as usize]);
        }
        turn += 1;
        let kept = if turn % 3 == 0 { 2 } else { outputs.len() };
        outputs
            .iter()
            .take(kept)
            .for_each(|output| Rounds::<World<'_, Placed<Homogeneous>, Wall>>::accept(&mut bake, output));
    }
    assert!(bits(&bake.finish()) == due);

    // Left in the middle of a round, saved, read, gone on with; again and again.
    let mut bake = Bake::new(settings).unwrap();
    loop {
        let mut left = true;
        for _ in 0..7 {
            left = left && step(&mut bake, &world, &mut BakedProbes::default());
        }
        let saved = bits(bake.grid());
        if !left {
            break;
        }
        bake = Bake::resume(bytes::read(&saved, 0, BakeMemory::default()).unwrap(), settings).unwrap();
    }
    assert!(bits(&bake.finish()) == due);

    // A part of the box anew, in a world that has not changed.
    let mut bake = Bake::resume(bytes::read(&due, 0, BakeMemory::default()).unwrap(), settings).unwrap();
    bake.bake_anew(Bounds { min: Vec3::ZERO, max: Vec3::splat(0.2) });
    let bricks = bake.grid().memory.bricks.as_slice();
    assert!(bricks.iter().any(|brick| brick.passes == 0) && bricks.iter().any(|brick| brick.passes > 0));
    finish(&mut bake, &world, &mut BakedProbes::default());
    assert!(bits(&bake.finish()) == due);
}

#[test]
fn too_little_memory_for_a_job_is_told_and_ends() {
    let (fog, lights) = (haze(0.9, 1.2, 0.5), [lamp(Vec3::ZERO, Spectrum::ONE)]);
    let world = World { medium: &fog, scene: &Empty, lights: (&lights).into() };
    let settings = BakeSettings { most_passes: 2, ..settings(&world, [5, 4, 4]) };
    let mut bake = Bake::new(settings).unwrap();
    // Room for the small brick alone.
    let (mut values, mut probes) = ([Spectrum::ZERO; 16 * 9], [Probe::default(); 16]);
    finish(&mut bake, &world, &mut BakedProbes::lent(&mut values, &mut probes));
    assert!(bake.is_cut());
    let grid = bake.finish();
    assert_eq!([grid.probes()[0].state(), grid.probes()[4].state()], [ProbeState::Unknown, ProbeState::Valid]);
}

#[test]
fn damaged_bytes_are_no_grid() {
    let (fog, lights) = (haze(0.9, 1.2, 0.5), [lamp(Vec3::ZERO, Spectrum::ONE)]);
    let world = World { medium: &fog, scene: &Empty, lights: (&lights).into() };
    let settings = BakeSettings { most_passes: 2, orders: Orders::Indirect, ..settings(&world, [2, 3, 1]) };
    let grid = baked(settings, &world);
    let file = bits(&grid);
    let read = |bytes: &[u8]| bytes::read(bytes, 0, BakeMemory::default());
    let copy = read(&file).unwrap();
    assert!(bits(&copy) == file && copy.orders() == Orders::Indirect && copy.quantity() == Quantity::InScattered);
    for at in 0..file.len() {
        let mut damaged = file.clone();
        damaged[at] ^= 4;
        assert!(read(&damaged).is_err(), "byte {at}");
    }
    for length in 0..file.len() {
        assert!(read(&file[..length]).is_err(), "{length} bytes");
    }
    assert!(matches!(read(&[&file[..], &[0]].concat()).err(), Some(ProbeBytesError::Damage(Damage::Length { .. }))));
    let mut few = [Spectrum::ZERO; 3];
    let memory = BakeMemory { values: (&mut few[..]).into(), ..BakeMemory::default() };
    assert_eq!(bytes::read(&file, 0, memory).err(), Some(ProbeBytesError::Storage));
}

#[test]
fn what_cannot_be_baked_is_told() {
    let world = World { medium: &Empty, scene: &Empty, lights: (&[]).into() };
    let of = |change: &dyn Fn(&mut BakeSettings)| {
        let mut settings = settings(&world, [2, 2, 2]);
        change(&mut settings);
        Bake::new(settings).err()
    };
    assert_eq!(of(&|_| ()), None);
    assert_eq!(of(&|s| s.counts = [1000, 1000, 1000]), Some(BakeError::Probes(1_000_000_000)));
    assert_eq!(of(&|s| s.counts = [u32::MAX; 3]), Some(BakeError::Probes(u64::MAX)));
    assert!(matches!(of(&|s| s.counts = [2, 0, 2]), Some(BakeError::Lattice(_))));
    assert!(matches!(of(&|s| s.bounds = Bounds { min: Vec3::ONE, max: Vec3::ZERO }), Some(BakeError::Lattice(_))));
    assert!(matches!(of(&|s| s.bounds.max.x = f32::NAN), Some(BakeError::Lattice(_))));
    assert_eq!(of(&|s| s.basis = ProbeBasis::SphericalHarmonics { degree: 4 }), Some(BakeError::Degree(4)));
    let effort = Some(BakeError::Effort);
    assert_eq!(of(&|s| s.error = f32::NAN), effort);
    assert_eq!(of(&|s| s.directions = 0), effort);
    assert_eq!(of(&|s| s.most_passes = 1), effort);
}
