//! `examples/shaders/fog.wgsl` against the core: light at random points and along random rays.
//!
//!     cargo run --manifest-path tests/shaders/Cargo.toml
//!
//! Needs a Vulkan driver; Debian's mesa-vulkan-drivers has one in software.

mod gpu;

use fogbow::bake::{Bake, BakeMemory, BakeSettings, BakedProbes, ProbeBasis, ProbeGrid, ProbeLevels, ProbeState};
use fogbow::host::{Hit, Scene};
use fogbow::light::{Light, PointLight};
use fogbow::math::{Bounds, Ray, Vec3};
use fogbow::medium::{Homogeneous, Placed, Region};
use fogbow::phase::Lobe;
use fogbow::sampling::{Generator, uniform, uniform2, warp};
use fogbow::sh;
use fogbow::spectrum::Spectrum;
use fogbow::surface::Surface;
use fogbow::work;
use fogbow::world::{Outline, World};
use gpu::Question;

const QUESTIONS: usize = 100_000;

/// Steps of a ray through the fog.
pub const STEPS: u32 = 24;

/// A closed block, whose probes are in a wall.
struct Block;

impl Scene for Block {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let (half, inverse) = (Vec3::new(0.35, 0.3, 0.4), 1.0 / ray.direction);
        let [a, b] = [(-half - ray.origin) * inverse, (half - ray.origin) * inverse];
        let (near, far) = (a.min(b).max_element(), a.max(b).min_element());
        let distance = if near > 1e-5 { near } else { far };
        let is_hit = near <= far && distance > 1e-5 && distance < ray.length;
        let at = ray.at(distance) / half;
        let axis = at.abs().cmpge(Vec3::splat(at.abs().max_element()));
        let normal = Vec3::select(axis, at.signum(), Vec3::ZERO).normalize();
        let surface = Surface::Lambert { reflectance: Spectrum::splat(0.5) };
        is_hit.then_some(Hit { distance, normal, shading: normal, surface, light: None })
    }
}

/// Finer levels of the bake.
const LEVELS: usize = 2;

/// A lamp and a sky in fog around a block, with finer levels for degree 2.
fn baked(degree: u32) -> Result<ProbeLevels<'static>, Box<dyn std::error::Error>> {
    let fog = Homogeneous::new(
        Spectrum::new(0.2, 0.3, 0.5),
        Spectrum::new(1.0, 0.8, 0.6),
        Lobe::HenyeyGreenstein { g: 0.6 },
    )?;
    let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 1.2)?);
    let lights = [
        Light::Point(PointLight::new(Vec3::new(0.2, 0.9, 0.1), Spectrum::new(2.0, 1.5, 1.0))?),
        Light::Constant(Spectrum::splat(0.3)),
    ];
    let world = World { medium: &ball, scene: &Block, lights: (&lights).into() };
    let outline = Outline::of(&world, Bounds { min: Vec3::new(-1.0, -1.1, -0.9), max: Vec3::new(1.0, 1.0, 1.2) });
    let basis = ProbeBasis::SphericalHarmonics { degree };
    let settings = BakeSettings { basis, most_passes: 4, ..BakeSettings::for_outline(&outline, [9, 7, 8]) };
    let mut bake = Bake::new(settings)?;
    work::finish(&mut bake, &world, &mut BakedProbes::default());
    let mut levels = ProbeLevels::new(bake.finish());
    let level = levels.finest().level();
    let mut settings = BakeSettings { level: Some(level as f32), ..settings };
    while degree == 2 && levels.levels().len() <= LEVELS {
        let Some(finer) = levels.finest().finer(level, 0.5, BakeMemory::default())? else {
            return Err("light does not vary".into());
        };
        settings.counts = settings.counts.map(|n| 2 * n);
        let mut bake = Bake::resume(finer, settings)?;
        work::finish(&mut bake, &world, &mut BakedProbes::default());
        levels.push(bake.finish())?;
    }
    levels.dilate();
    Ok(levels)
}

/// The probes of a level around a point that are there, with their weights.
fn around(grid: &ProbeGrid<'_>, point: Vec3) -> impl Iterator<Item = (usize, usize, f32)> {
    let bounds = grid.lattice().bounds();
    let around = grid.lattice().around(point.clamp(bounds.min, bounds.max)).unwrap_or_default();
    around.into_iter().filter_map(|(cell, weight)| Some((cell, grid.number_of(cell)?, weight)))
}

/// The sum of the sizes of what makes up light in a direction: what half floats round.
fn sizes(levels: &ProbeLevels<'_>, point: Vec3, direction: Vec3, degree: u32) -> f32 {
    let mut values = [0.0; 16];
    let values = &mut values[..levels.finest().basis().count()];
    sh::evaluate(direction, degree as usize, values);
    let size = |grid: &ProbeGrid<'_>, index: usize| -> f32 {
        grid.held(index).iter().zip(values.iter()).map(|(c, y)| c.map(f32::abs).max_element() * y.abs()).sum()
    };
    let most = |grid: &ProbeGrid<'_>| around(grid, point).map(|(_, index, _)| size(grid, index)).fold(0.0, f32::max);
    levels.levels().iter().map(most).fold(0.0, f32::max)
}

/// Valid probes with less weight than this may have none by rounding: then light jumps to what dilation has left.
const LEAST_SHARE: f32 = 1e-5;

/// The same of probes that see the point: then it jumps to those behind surfaces, which count for a millionth.
const LEAST_SEEN: f32 = 1e-4;

fn jumps(levels: &ProbeLevels<'_>, point: Vec3) -> bool {
    let jumps = |grid: &ProbeGrid<'_>| {
        let (lattice, bounds) = (grid.lattice(), grid.lattice().bounds());
        let half = 0.5 * lattice.cell();
        let inside = point.clamp(bounds.min + half, bounds.max - half);
        let (mut valid, mut seen) = (0.0, 0.0);
        for (cell, index, weight) in around(grid, point) {
            let probe = &grid.probes()[index];
            if probe.state() == ProbeState::Valid {
                valid += weight;
                seen += weight * probe.sees((inside - lattice.centre(cell)) / lattice.cell());
            }
        }
        let is_there = around(grid, point).next().is_some();
        is_there && (valid < LEAST_SHARE || seen < LEAST_SEEN)
    };
    levels.levels().iter().any(jumps)
}

/// Light scattered towards the eye, and transmittance; `None` where light jumps.
fn fog(levels: &ProbeLevels<'_>, question: &Question) -> Option<(Spectrum, f32)> {
    let [eye, direction] = [question.point, question.direction].map(Vec3::from);
    let bounds = levels.finest().lattice().bounds();
    let [low, high] = [bounds.min, bounds.max].map(|corner| (corner - eye) / direction);
    let begin = low.min(high).max_element().max(0.0);
    let end = low.max(high).min_element().min(question.depth);
    let (mut light, mut through) = (Spectrum::ZERO, 1.0);
    if end > begin {
        let step = (end - begin) / STEPS as f32;
        for i in 0..STEPS {
            let point = eye + (begin + (i as f32 + 0.5) * step) * direction;
            if jumps(levels, point) {
                return None;
            }
            let (albedo, extinction) = levels.medium(point);
            let passed = (-extinction.mean() * step).exp();
            light += albedo * levels.value(point, -direction) * (through * (1.0 - passed));
            through *= passed;
        }
    }
    Some((light, through))
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    for degree in [0, 1, 2] {
        let levels = baked(degree)?;
        let walls = levels.levels()[0].probes().iter().filter(|probe| probe.state() == ProbeState::InWall).count();
        let rng = &mut Generator::new(u64::from(degree) + 1);
        let questions: Vec<Question> = (0..QUESTIONS)
            .map(|_| {
                let at = Vec3::new(uniform(rng), uniform(rng), uniform(rng));
                let direction = warp::uniform_sphere(uniform2(rng)).to_array();
                Question { point: (at * 3.0 - 1.5).to_array(), depth: 4.0 * uniform(rng), direction, padding: 0.0 }
            })
            .collect();
        let answers = gpu::answers(&levels, &questions)?;
        let (mut worst, mut lit, mut compared) = ([0.0_f32; 2], 0, 0);
        for (question, answer) in questions.iter().zip(answers.chunks_exact(2)) {
            let [point, direction] = [question.point, question.direction].map(Vec3::from);
            // Half a unit in the eleventh digit of every number, and single precision beside.
            let rounding = sizes(&levels, point, direction, degree) * (0.5 / 1024.0) + 1e-6;
            let value = levels.value(point, direction);
            lit += usize::from(!value.is_black());
            for channel in (0..3).filter(|_| !jumps(&levels, point)) {
                worst[0] = worst[0].max((answer[0][channel] - value[channel]).abs() / rounding);
            }
            let Some((light, through)) = fog(&levels, question) else { continue };
            compared += 1;
            // Four free paths, whose extinction is rounded, too.
            let rounding = 4.0 / 1024.0;
            for channel in 0..3 {
                worst[1] =
                    worst[1].max((answer[1][channel] - light[channel]).abs() / (rounding * (light[channel] + 0.1)));
            }
            worst[1] = worst[1].max((answer[1][3] - through).abs() / rounding);
        }
        println!(
            "degree {degree}, {} levels: {QUESTIONS} points, {compared} rays, {walls} probes in walls: at most {:.2} and {:.2} of the rounding of half floats",
            levels.levels().len(),
            worst[0],
            worst[1]
        );
        if walls == 0 || lit.min(compared) < QUESTIONS / 2 || worst.iter().any(|worst| !(*worst <= 1.0)) {
            return Err("fog.wgsl is not what the core says".into());
        }
    }
    Ok(())
}
