//! Radiance caches in lent storage: filled with a few records, looked up, seen by eye rays.

use fogbow::cache::{
    Basis, Block, Cache, Caches, Estimator, EyeSettings, Facing, Index, InsertError, Limits, Node, Place, Reader,
    Reading, Record, SurfaceCache, TurningBasis, VolumeCache, places, radiance,
};
use fogbow::host::Medium;
use fogbow::light::Light;
use fogbow::math::{Ray, Vec3};
use fogbow::multiple_scatter;
use fogbow::path;
use fogbow::sampling::Generator;
use fogbow::sh::{Coefficient, coefficient_count};
use fogbow::spectrum::Spectrum;
use fogbow::transmittance::thickness::Steps;
use fogbow::world::World;

use crate::sections::{direction, point};
use crate::walks::{Balls, with_lights};
use crate::{Digest, media};

/// Records of a cache: enough to overlap, few because each takes random walks.
const RECORDS: usize = 8;
/// Random walks per record.
const WALKS: u32 = 6;
/// Points looked up, and eye rays, per medium.
const QUESTIONS: usize = 32;
const DEGREE: usize = 2;
const STRIDE: usize = coefficient_count(DEGREE) - 1;
const LIMITS: Limits = Limits { min: 0.2, max: 2.0 };
const READING: Reading = Reading { extrapolation: fogbow::cache::Extrapolation::Curved, tolerance: 0.5, margin: 0.0 };

/// Room for the index over the records of a cache: what [`Index::new`] asks for.
struct Slots {
    nodes: [Node; RECORDS],
    entries: [u32; 6 * RECORDS],
    spheres: [[f32; 4]; RECORDS],
    blocks: [Block; 4 * RECORDS + 16],
}

impl Slots {
    fn new() -> Self {
        Self {
            nodes: [Node::default(); RECORDS],
            entries: [0; 6 * RECORDS],
            spheres: [[0.0; 4]; RECORDS],
            blocks: [Block::default(); 4 * RECORDS + 16],
        }
    }

    fn index(&mut self) -> Index<'_> {
        Index::new(&mut self.nodes[..], &mut self.entries[..], &mut self.spheres[..], &mut self.blocks[..])
    }
}

/// What lent storage holds before a record.
const EMPTY: Record =
    Record { position: Vec3::ZERO, radius: 0.0, value: Spectrum::ZERO, gradient: fogbow::spectrum::Gradient::ZERO };

pub(crate) fn cache(out: &mut Digest) {
    let done = with_lights(|lights| {
        media::each(|medium| {
            // Full storage is as much a result as any other.
            let filled = in_medium(out, medium, lights);
            out.int(u64::from(filled.is_ok()));
        })
    });
    out.int(u64::from(done));
}

fn in_medium(out: &mut Digest, medium: &dyn Medium, lights: &[Light<'_>]) -> Result<(), InsertError> {
    let mut rng = Generator::new(17);
    let mut estimator = Estimator {
        world: World { medium, scene: &Balls, lights },
        surfaces: None,
        scattered: None,
        walk: multiple_scatter::Settings { max_vertices: 8, ..multiple_scatter::Settings::new(Steps::Length(0.3)) },
        paths: path::Settings { max_scatterings: 6, ..path::Settings::default() },
        light_samples: 1,
        finest: 0.02,
    };

    let (mut near, mut far) = (Slots::new(), Slots::new());
    let (mut records, mut facings) = ([EMPTY; RECORDS], [Facing { normal: Vec3::Y, turn: EMPTY.gradient }; RECORDS]);
    let mut floor: SurfaceCache<'_> = Cache::new(&mut records[..], &mut facings[..], near.index(), far.index(), 1);
    for _ in 0..RECORDS {
        let at = (point(&mut rng) * 0.5).with_y(-2.0);
        let (sums, facing) = estimator.irradiance(at, Vec3::Y, WALKS, &mut rng);
        if let Some(record) = Record::new(at, &sums, READING.tolerance, LIMITS) {
            floor.insert(record, &[facing])?;
        }
    }
    floor.finish()?;
    fold_records(out, floor.records());
    for facing in floor.attachments() {
        out.vec3(facing.normal);
        out.gradient(&facing.turn);
    }
    for _ in 0..QUESTIONS {
        let (at, normal) = ((point(&mut rng) * 0.5).with_y(-2.0), (direction(&mut rng) * 0.3 + Vec3::Y).normalize());
        out.option(floor.lookup(at, normal, &READING), Digest::spectrum);
    }

    estimator.surfaces = Some((&floor, READING));
    let mut slots = [(); 4].map(|()| Slots::new());
    let mut stored = [[EMPTY; RECORDS]; 2];
    let mut higher = [[Coefficient::ZERO; STRIDE * RECORDS]; 2];
    let [a, b, c, d] = &mut slots;
    let ([stored_a, stored_b], [higher_a, higher_b]) = (&mut stored, &mut higher);
    let mut surface: VolumeCache<'_> = Cache::new(&mut stored_a[..], &mut higher_a[..], a.index(), b.index(), STRIDE);
    let mut multiple: VolumeCache<'_> = Cache::new(&mut stored_b[..], &mut higher_b[..], c.index(), d.index(), STRIDE);
    for _ in 0..RECORDS {
        let at = point(&mut rng) * 0.3;
        let phase = estimator.phase(at);
        let mut coefficients = [Coefficient::ZERO; STRIDE];
        let once = estimator.surface(at, &phase, WALKS, &mut coefficients, &mut rng);
        if let Some(record) = Record::new(at, &once, READING.tolerance, LIMITS) {
            surface.insert(record, &coefficients)?;
        }
        let mut coefficients = [Coefficient::ZERO; STRIDE];
        let often = estimator.multiple(at, &phase, WALKS, &mut coefficients, &mut rng);
        if let Some(record) = Record::new(at, &often, READING.tolerance, LIMITS) {
            multiple.insert(record, &coefficients)?;
        }
    }
    surface.finish()?;
    multiple.finish()?;
    for cache in [&surface, &multiple] {
        fold_records(out, cache.records());
        for coefficient in cache.attachments() {
            out.spectrum(coefficient.value);
            out.gradient(&coefficient.gradient);
        }
        for _ in 0..QUESTIONS {
            let (at, to_eye) = (point(&mut rng) * 0.3, direction(&mut rng));
            let basis = Basis::new(to_eye, DEGREE);
            out.option(cache.lookup(at, &basis, &READING), Digest::spectrum);
            let basis = TurningBasis::new(to_eye, DEGREE);
            out.option(cache.lookup_with_gradients(at, &basis, &READING), |out, (light, turned)| {
                out.spectrum(light.radiance);
                out.gradient(&light.gradient);
                out.gradient(&turned);
            });
        }
    }

    fn reader<C>(cache: &C) -> Option<Reader<'_, C>> {
        Some(Reader { cache, reading: READING })
    }
    let caches =
        Caches { single: None, surface: reader(&surface), multiple: reader(&multiple), irradiance: reader(&floor) };
    let settings = EyeSettings { density: 4.0, connections: 4, lights_visible: true, indirect: true };
    for _ in 0..QUESTIONS / 2 {
        let eye = Vec3::new(0.0, 0.5, -5.0);
        let ray = Ray::new(eye, (point(&mut rng) * 0.5 - eye).normalize());
        places(&ray, &estimator.world, &settings, &mut rng, |Place { point, normal, is_seen }| {
            out.vec3(point);
            out.option(normal, Digest::vec3);
            out.int(u64::from(is_seen));
        });
        let seen = radiance(&ray, &estimator, &caches, &settings, &mut rng);
        [seen.emitted, seen.surface_direct, seen.surface_indirect]
            .into_iter()
            .chain([seen.medium_single, seen.medium_surface, seen.medium_multiple])
            .for_each(|part| out.spectrum(part));
        out.int(u64::from(seen.lookups) << 32 | u64::from(seen.misses));
    }
    Ok(())
}

fn fold_records(out: &mut Digest, records: &[Record]) {
    out.int(records.len() as u64);
    for record in records {
        out.vec3(record.position);
        out.float(record.radius);
        out.spectrum(record.value);
        out.gradient(&record.gradient);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lent_storage_is_enough() {
        let mut count = 0;
        assert!(with_lights(|lights| {
            media::each(|medium| {
                assert_eq!(in_medium(&mut Digest::default(), medium, lights), Ok(()));
                count += 1;
            })
        }));
        assert_eq!(count, 7);
    }
}
