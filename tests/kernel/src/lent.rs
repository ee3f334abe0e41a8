//! Methods that fill memory, in lent memory: radiance caches, beams, virtual lights, pictures.
//!
//! The world, the settings and the questions are public, so that hosts with memory that grows can ask the same.

use fogbow::beams::{self, Beams};
use fogbow::cache::{
    self, Asked, Effort, Estimate, FillingMemory, Glance, Guide, Kind, Limits, PhotonCell, PhotonDeposit, PhotonEffort,
    Place, RadianceCaches, Slots, SurfaceCache, TurningBasis, VolumeCache, Wanted,
};
use fogbow::host::{Hit, Scene};
use fogbow::light::{Light, PointLight, SphereLight};
use fogbow::math::{Bounds, Ray, Vec3};
use fogbow::medium::{Homogeneous, Placed, Region};
use fogbow::path;
use fogbow::phase::{Lobe, Phase};
use fogbow::picture::{
    self, Goal, Integrand, PixelNoise, PixelSum, Sample, TileNoise, TileOutput, TileRoom, TileSlots, Tiles,
};
use fogbow::sampling::{Generator, Independent, uniform};
use fogbow::sh::{Coefficient, coefficient_count};
use fogbow::spectrum::Spectrum;
use fogbow::storage::{Chunk, List};
use fogbow::surface::Surface;
use fogbow::vpl::{self, Receiver, VirtualLight};
use fogbow::work;
use fogbow::world::{Outline, World};

use crate::Digest;
use crate::sections::{direction, point};
use crate::walks::{Balls, SHINING};

/// A ball of fog over a floor, between a mirror and a glass ball.
pub type Foggy<'a> = World<'a, Placed<'static, Homogeneous>, OverPaleFloor>;

/// The balls over a diffuse floor: of glossy surfaces nothing is cached.
#[derive(Debug, Clone, Copy)]
pub struct OverPaleFloor;

impl Scene for OverPaleFloor {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let hit = Balls.closest_hit(ray)?;
        let surface = match hit.surface {
            Surface::Phong { diffuse, .. } => Surface::Lambert { reflectance: diffuse },
            other => other,
        };
        Some(Hit { surface, ..hit })
    }
}

/// A box around what matters (m).
const BOUNDS: Bounds = Bounds { min: Vec3::splat(-3.0), max: Vec3::splat(3.0) };
const EYE: Vec3 = Vec3::new(0.0, 0.5, -5.0);

/// Calls `f` with the world; `None` if it cannot be made.
pub fn with_world<T>(f: impl FnOnce(&Foggy<'_>) -> T) -> Option<T> {
    let fog = Homogeneous::new(Spectrum::splat(0.05), Spectrum::new(0.3, 0.4, 0.5), Lobe::HenyeyGreenstein { g: 0.4 });
    let medium = Placed::new(fog.ok()?, Region::sphere(Vec3::ZERO, 3.0).ok()?);
    let white = Spectrum::new(3.0, 2.0, 1.0);
    let lights = [
        Light::Sphere(SphereLight::new(SHINING.0, SHINING.1, white).ok()?),
        Light::Point(PointLight::new(Vec3::new(1.0, 1.0, -1.0), white).ok()?),
    ];
    Some(f(&World { medium: &medium, scene: &OverPaleFloor, lights: (&lights).into() }))
}

/// The eye ray of a point of the film.
#[must_use]
pub fn eye_ray([x, y]: [f32; 2]) -> Ray {
    Ray::new(EYE, Vec3::new(0.6 * (x - 0.5), 0.6 * (0.4 - y), 1.0).normalize())
}

fn eye_rays(rng: &mut Generator) -> impl Iterator<Item = Ray> + use<> {
    let mut rng = rng.clone();
    (0..RAYS).map(move |_| {
        let at = point(&mut rng) / 8.0 + 0.5;
        eye_ray([at.x, at.y])
    })
}

/// Eye rays, and probes, that ask for light.
const RAYS: usize = 16;

// ---------------------------------------------------------------------------------------------
// Radiance caches

/// Records of each kind at most, places that ask for some, and places that the rays of one job meet.
const RECORDS: usize = 32;
const PLACES: usize = 1024;
const DEGREE: usize = 1;
/// Attachments of a record: of its expansion, and where light is scattered more than once two of what that leaves out towards the eye.
const EXPANDED: usize = coefficient_count(DEGREE) - 1;
const STRIDE: usize = EXPANDED + 2;
const ROUND: usize = 8;

/// Coarse caches of all kinds, so that a browser fills them at once.
#[must_use]
pub fn cache_settings() -> cache::Settings {
    let limits = Limits { min: 1.5, max: 4.0 };
    let effort = |degree| {
        Some(Effort {
            tolerance: 1.0,
            samples: 16,
            degree,
            limits,
            clearance: f32::INFINITY,
            free_paths: f32::INFINITY,
        })
    };
    cache::Settings {
        single: effort(DEGREE),
        surface: effort(DEGREE),
        multiple: effort(DEGREE),
        irradiance: effort(0),
        // Four cells a side, in all of which surfaces may be.
        photons: Some(PHOTONS),
        rays: 16,
        round: ROUND as u32,
        light_samples: 1,
        eye: cache::RaySettings { density: 3.0, ..cache::RaySettings::default() },
        seed: 17,
        ..cache::Settings::default()
    }
}

/// Photons that light walks.
const PHOTONS: PhotonEffort =
    PhotonEffort { bounds: BOUNDS, cells: 4, degree: 2, paths: 256, flights: 10_000, enough: u32::MAX };

/// Cells of light, and what the photons of a job leave in them: these are few.
const CELLS: usize = 64;
/// Of light, and of what halves of it differ by.
const MOMENTS: usize = 2 * 9 * CELLS;
const GLANCES: usize = 0;
const DEPOSITS: usize = 2048;

/// Where light is asked for.
pub const ASKED: Asked = Asked::View { ray: eye_ray, pixel: 0.05 };

/// Room for the caches of all kinds.
const CHUNKS: usize = VolumeCache::chunks(RECORDS, EXPANDED)
    + 2 * VolumeCache::chunks(RECORDS, STRIDE)
    + 2 * SurfaceCache::chunks(RECORDS, 1);

/// Fills caches in lent memory and calls `read` with them and with whether the memory was too small.
fn filled(world: &Foggy<'_>, read: impl FnOnce(&RadianceCaches<'_>, bool)) {
    let (mut memory, mut views) = ([Chunk::default(); CHUNKS], [0; 1]);
    let caches = RadianceCaches::lent(cache_settings(), &mut views[..], &mut memory);

    let mut wanted = [[Wanted::default(); PLACES]; 2];
    let mut open = [[0; PLACES]; 3];
    let (mut chosen, mut estimates) = ([(0, 0.0); ROUND], [Estimate::default(); RECORDS]);
    let (mut higher, mut of_job) = ([Coefficient::ZERO; STRIDE * RECORDS], [Coefficient::ZERO; STRIDE]);
    let (mut photons, mut deposits) = ([PhotonCell::default(); CELLS], [PhotonDeposit::default(); DEPOSITS]);
    let (mut photon_moments, mut glances) = ([Spectrum::ZERO; MOMENTS], [Glance::default(); GLANCES]);
    let mut guides = [[Guide::default(); RECORDS]; Kind::COUNT];
    let ([wanted, found], [open, still_open, looked_up]) = (&mut wanted, &mut open);
    let memory = FillingMemory::lent(Slots {
        wanted,
        open: [open, still_open],
        chosen: &mut chosen,
        estimates: &mut estimates,
        higher: &mut higher,
        guides: guides.each_mut().map(|guides| &mut guides[..]),
        photons: &mut photons,
        photon_moments: &mut photon_moments,
        glances: &mut glances,
    });
    let mut filling = caches.fill_in(memory, ASKED);
    work::finish(&mut filling, world, &mut cache::FilledRecords::lent(found, looked_up, &mut of_job, &mut deposits));
    let is_cut = filling.is_cut();
    read(&filling.finish(), is_cut);
}

/// Folds all records of caches, and what eye rays and probes see by them.
pub fn read_caches(out: &mut Digest, caches: &RadianceCaches<'_>, world: &Foggy<'_>) {
    for kind in Kind::ALL {
        out.int(caches.records(kind).len() as u64);
        for record in caches.records(kind) {
            out.vec3(record.position);
            out.float(record.radius);
            out.spectrum(record.value);
            out.gradient(&record.gradient);
        }
        if let Some(reader) = caches.volume(kind) {
            for coefficient in reader.cache.attachments() {
                out.spectrum(coefficient.value);
                out.gradient(&coefficient.gradient);
            }
        }
        if let Some(reader) = caches.surface(kind) {
            for facing in reader.cache.attachments() {
                out.vec3(facing.normal);
                out.gradient(&facing.turn);
            }
        }
    }
    let mut rng = Generator::new(18);
    for ray in eye_rays(&mut rng) {
        cache::places(
            &ray,
            world,
            &caches.settings().eye,
            &mut rng,
            |Place { point, normal, is_seen, share, to_eye }| {
                out.vec3(point);
                out.option(normal, Digest::vec3);
                out.int(u64::from(is_seen));
                out.float(share);
                out.option(to_eye, Digest::vec3);
            },
        );
        let seen = caches.radiance(&ray, world, &mut rng);
        [seen.emitted, seen.surface_direct, seen.surface_indirect]
            .into_iter()
            .chain([seen.medium_single, seen.medium_surface, seen.medium_multiple])
            .for_each(|part| out.spectrum(part));
        out.int(u64::from(seen.lookups) << 32 | u64::from(seen.misses));
    }
    for _ in 0..RAYS {
        let (at, to_eye) = (0.3 * point(&mut rng), direction(&mut rng));
        let mut coefficients = [Spectrum::ZERO; coefficient_count(DEGREE)];
        out.int(u64::from(caches.in_scattered_sh(at, &mut coefficients)));
        coefficients.into_iter().for_each(|value| out.spectrum(value));
        out.option(caches.fluence(at), Digest::spectrum);
        out.option(caches.irradiance(at.with_y(-2.0), (0.3 * to_eye + Vec3::Y).normalize()), Digest::spectrum);
        if let Some(reader) = caches.volume(Kind::Multiple) {
            let basis = TurningBasis::new(to_eye, DEGREE);
            out.option(reader.cache.lookup_with_gradients(at, &basis, &reader.reading), |out, (light, turned)| {
                out.spectrum(light.radiance);
                out.gradient(&light.gradient);
                out.gradient(&turned);
            });
        }
    }
}

pub(crate) fn caches(out: &mut Digest) {
    let made = with_world(|world| filled(world, |caches, _| read_caches(out, caches, world)));
    out.int(u64::from(made.is_some()));
}

// ---------------------------------------------------------------------------------------------
// Beams

/// Pieces of beams of a pass at most.
const PIECES: usize = 1024;

/// Few beams, wide ones.
#[must_use]
pub fn beam_settings(world: &Foggy<'_>) -> beams::Settings {
    beams::Settings { paths: 64, radius: 0.2, seed: 19, ..beams::Settings::for_outline(&Outline::of(world, BOUNDS)) }
}

/// Shoots beams in lent memory.
fn shot(world: &Foggy<'_>, gather: impl FnOnce(Result<Beams<'_>, beams::BeamPassError>)) {
    let (mut pieces, mut nodes) = ([[beams::Piece::default(); PIECES]; 2], [beams::BeamNode::default(); PIECES + 1]);
    let [pieces, of_job] = &mut pieces;
    let memory = Beams::new(&mut pieces[..], &mut nodes[..]);
    let mut pass = beams::BeamPass::new_in(memory, &beam_settings(world), 0, |_, pass| pass);
    work::finish(&mut pass, world, &mut beams::BeamOutput::new(&mut of_job[..]));
    gather(pass.finish());
}

/// Folds all pieces of beams, and what eye rays gather.
pub fn gather_beams(out: &mut Digest, beams: &Beams<'_>, world: &Foggy<'_>) {
    for piece in beams.pieces() {
        out.vec3(piece.origin);
        out.vec3(piece.direction);
        out.float(piece.length);
        out.float(piece.radius);
        out.spectrum(piece.power);
    }
    let (mut rng, settings) = (Generator::new(20), beam_settings(world));
    for ray in eye_rays(&mut rng) {
        let gathered = beams.gather(&ray, world.medium, u32::MAX, &mut rng);
        out.spectrum(gathered.light.single);
        out.spectrum(gathered.light.multiple);
        out.int(u64::from(gathered.pieces));
        out.spectrum(beams.radiance(&ray, world, &settings.walk, 1.0, &mut rng).total());
    }
}

pub(crate) fn beams(out: &mut Digest) {
    let made = with_world(|world| {
        shot(world, |beams| {
            if let Ok(beams) = beams {
                gather_beams(out, &beams, world);
            }
        });
    });
    out.int(u64::from(made.is_some()));
}

// ---------------------------------------------------------------------------------------------
// Virtual lights

/// Virtual lights that paths leave at most, and points of eye rays that tell which matter.
const CANDIDATES: usize = 512;
const WITNESSES: usize = 512;

/// Few lights out of more.
#[must_use]
pub fn light_settings(world: &Foggy<'_>) -> vpl::Settings {
    let usual = vpl::Settings::for_outline(&Outline::of(world, BOUNDS));
    vpl::Settings { paths: 64, lights: 48, candidates: 4, samples: 2, seed: 21, ..usual }
}

/// Calls `keep` with the points that tell which lights matter: every eighth of them.
pub fn each_witness(world: &Foggy<'_>, mut keep: impl FnMut(Receiver)) {
    let mut number = 0_u32;
    vpl::witnesses(
        world,
        &light_settings(world),
        |at, _| eye_ray(at),
        |witness| {
            if number.is_multiple_of(8) {
                keep(witness);
            }
            number += 1;
        },
    );
}

/// Makes lights in lent memory.
fn made(world: &Foggy<'_>, see: impl FnOnce(Result<&[VirtualLight], vpl::VplPassError>)) {
    let light = VirtualLight::in_medium(Vec3::ZERO, Vec3::Z, Spectrum::ZERO, 1, &Phase::ISOTROPIC);
    let nothing = vpl::Scatterer::Medium { scattering: Spectrum::ZERO, phase: Phase::ISOTROPIC };
    let mut witnesses = [Receiver { point: Vec3::ZERO, to_eye: Vec3::Z, scatterer: nothing }; WITNESSES];
    let mut count = 0;
    each_witness(world, |witness| {
        if let Some(slot) = witnesses.get_mut(count) {
            *slot = witness;
            count += 1;
        }
    });

    let (mut lights, mut order) = ([[light; CANDIDATES]; 2], [vpl::CurvePlace::default(); CANDIDATES]);
    let mut numbers = [[0.0; CANDIDATES]; 3];
    let ([lights, of_job], [importance, seen, seen_of_job]) = (&mut lights, &mut numbers);
    let memory = vpl::VplMemory::new(&mut lights[..], &mut order[..], &mut importance[..], &mut seen[..]);
    let mut pass = vpl::VplPass::new_in(memory, &light_settings(world), 0, Independent, &witnesses[..count]);
    work::finish(&mut pass, world, &mut vpl::VplOutput::new(&mut of_job[..], &mut seen_of_job[..]));
    see(pass.finish().as_ref().map(List::as_slice).map_err(|error| *error));
}

/// Folds all virtual lights, and what eye rays see by them.
pub fn see_lights(out: &mut Digest, lights: &[VirtualLight], world: &Foggy<'_>) {
    for light in lights {
        out.vec3(light.position);
        out.vec3(light.incoming);
        out.spectrum(light.flux);
        out.int(u64::from(light.scatterings));
    }
    let (mut rng, settings) = (Generator::new(22), light_settings(world));
    for (ray, sample) in eye_rays(&mut rng).zip(0..) {
        let (part, share) = settings.part(lights, sample);
        let seen = vpl::radiance(&ray, &settings.gatherer(world), part, share, &settings.eye(), &mut rng);
        [seen.radiance.total(), seen.clamped].into_iter().chain(seen.compensated).for_each(|part| out.spectrum(part));
    }
}

pub(crate) fn lights(out: &mut Digest) {
    let made = with_world(|world| {
        made(world, |lights| {
            if let Ok(lights) = lights {
                see_lights(out, lights, world);
            }
        });
    });
    out.int(u64::from(made.is_some()));
}

// ---------------------------------------------------------------------------------------------
// Pictures

/// A small picture, whose tiles end as they have little noise.
pub const PICTURE: picture::Settings = picture::Settings {
    size: [8, 6],
    layers: 2,
    samples: 64,
    goal: Some(Goal { noise: 0.3, least: 8 }),
    seed: 23,
    tile: 4,
};
const ROOM: TileRoom = PICTURE.room();

/// A sample by path tracing: all light, and what the medium scattered.
#[must_use]
pub fn pixel(world: &Foggy<'_>) -> impl Integrand<Generator, Tally = ()> + Sync {
    |sample: &Sample<'_, ()>, rng: &mut Generator, layers: &mut [Spectrum]| {
        let mut at = |index, count| (index as f32 + uniform(rng)) / count as f32;
        let [x, y] = [(sample.x, PICTURE.size[0]), (sample.y, PICTURE.size[1])].map(|(index, count)| at(index, count));
        let seen = path::radiance(&eye_ray([x, y]), world, &path::Settings::default(), rng);
        layers.copy_from_slice(&[seen.total(), seen.medium_single + seen.medium_multiple]);
    }
}

/// Folds the sums and numbers of samples of a picture.
pub fn see_picture(out: &mut Digest, sums: &[PixelSum], counts: &[u32]) {
    sums.iter().flat_map(PixelSum::values).for_each(|sum| out.int(sum.to_bits()));
    counts.iter().for_each(|count| out.int(u64::from(*count)));
}

/// Renders in lent memory.
fn rendered(world: &Foggy<'_>, see: impl FnOnce(&[PixelSum], &[u32])) {
    let (mut sums, mut counts) = ([PixelSum::ZERO; ROOM.sums], [0; ROOM.counts]);
    let (mut noise, mut pixels) = ([TileNoise::default(); ROOM.tiles], [PixelNoise::default(); ROOM.pixels]);
    let slots = TileSlots { sums: &mut sums, counts: &mut counts, tiles: &mut noise, pixels: &mut pixels };
    if let Ok(mut tiles) = Tiles::lent(PICTURE, Independent, slots) {
        let (mut of_job, mut colours) = ([PixelSum::ZERO; ROOM.of_job_sums], [Spectrum::ZERO; ROOM.of_job_colours]);
        work::finish(&mut tiles, &pixel(world), &mut TileOutput::lent(&mut of_job, &mut colours));
    }
    see(&sums, &counts);
}

pub(crate) fn picture(out: &mut Digest) {
    let made = with_world(|world| rendered(world, |sums, counts| see_picture(out, sums, counts)));
    out.int(u64::from(made.is_some()));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lent_memory_is_enough_and_everything_is_there() {
        with_world(|world| {
            filled(world, |caches, is_cut| {
                let counts = Kind::ALL.map(|kind| caches.records(kind).len());
                assert!(!is_cut && counts.iter().all(|&count| count > 2), "{counts:?}");
            });
            shot(world, |beams| assert!(beams.unwrap().pieces().len() > 100));
            made(world, |lights| assert!(lights.unwrap().len() > 40));
            rendered(world, |sums, counts| {
                let [least, most] = [counts.iter().min(), counts.iter().max()].map(|count| *count.unwrap());
                assert!(least >= 8 && least < most && most <= 64, "{counts:?}");
                assert!(sums.iter().any(|sum| sum.values()[0] > 0.0));
            });
        })
        .unwrap();
    }

    #[test]
    fn the_lent_memory_is_what_the_core_asks_for() {
        let room = cache::room_for(&cache_settings(), PLACES, RECORDS);
        assert_eq!((room.wanted, room.open, room.of_job_wanted, room.of_job_open), (PLACES, PLACES, PLACES, PLACES));
        assert_eq!((room.chosen, room.estimates, room.higher), (ROUND, RECORDS, STRIDE * RECORDS));
        assert_eq!((room.of_job_higher, room.guides), (STRIDE, [RECORDS; Kind::COUNT]));
        assert!(room.photons <= CELLS && room.photon_moments <= MOMENTS && room.of_job_deposits >= DEPOSITS);
        assert_eq!((room.chunks, room.glances), (CHUNKS, GLANCES));
    }
}
