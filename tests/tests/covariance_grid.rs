//! Covariance grids: the same bits for any number of threads and after a file; broken files; the walk through a
//! lattice; steps; occluders; the fluence against closed forms.

use std::path::PathBuf;

use fogbow::bytes::Crc;
use fogbow::bytes::Damage;
use fogbow::covariance::bytes::{self, GridBytesError, HEADER_BYTES, VERSION};
use fogbow::covariance::{
    AdaptiveSteps, CellCrossing, CovarianceGrid, Fill, FrequencyPhotons, GridView, Lattice, OccluderCell, Occluders,
    Rule, Settings, Voxel,
};
use fogbow::host::{Empty, Hit, Medium, Scene};
use fogbow::light::{Light, PhongLight, PointLight, Sun};
use fogbow::math::{Bounds, Ray, Symmetric3, Vec3, float::PI};
use fogbow::medium::Homogeneous;
use fogbow::path;
use fogbow::phase::Lobe;
use fogbow::photon;
use fogbow::sampling::Generator;
use fogbow::spectrum::Spectrum;
use fogbow::surface::Surface;
use fogbow::world::World;
use fogbow_std::files::{FileError, Problem, load, write};
use fogbow_std::progress::Control;
use fogbow_std::threads::{self, Threads};
use fogbow_tests::analytic::mean_and_error;
use fogbow_tests::tolerance::STANDARD_ERRORS;
use proptest::prelude::*;

const TAG: u64 = 0x0123_4567_89ab_cdef;

fn cube(half: f32) -> Bounds {
    Bounds { min: Vec3::splat(-half), max: Vec3::splat(half) }
}

fn fog(absorption: f32, scattering: f32) -> Homogeneous {
    Homogeneous::new(Spectrum::splat(absorption), Spectrum::splat(scattering), Lobe::HenyeyGreenstein { g: 0.3 })
        .unwrap()
}

fn lamp(position: Vec3) -> Light<'static> {
    Light::Point(PointLight::from_flux(position, Spectrum::ONE).unwrap())
}

/// A black plate across x with a slit along z.
struct Slit {
    x: f32,
    half: f32,
}

impl Scene for Slit {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let distance = (self.x - ray.origin.x) / ray.direction.x;
        if !(distance > 0.0 && distance < ray.length) || ray.at(distance).y.abs() < self.half {
            return None;
        }
        let normal = Vec3::X * -ray.direction.x.signum();
        Some(Hit { distance, normal, shading: normal, surface: Surface::BLACK, light: None })
    }
}

// The same bits.

fn fill<M: Medium + Sync, S: Scene + Sync>(
    world: &World<'_, M, S>,
    settings: Settings,
    threads: usize,
) -> CovarianceGrid<'static> {
    let mut fill = Fill::new(settings).unwrap();
    threads::run(&mut fill, world, &Threads::new(threads).unwrap(), &Control::default(), None, |_| {});
    assert!(fill.share() == 1.0 && !fill.is_cut());
    fill.finish()
}

fn filled(threads: usize, seed: u64) -> CovarianceGrid<'static> {
    let fog = fog(0.1, 0.8);
    let lights = [
        lamp(Vec3::new(-0.7, 0.1, 0.2)),
        Light::Phong(PhongLight::new(Vec3::NEG_ONE, Vec3::ONE, 30.0, Spectrum::new(1.0, 0.5, 0.2)).unwrap()),
    ];
    let world = World { medium: &fog, scene: &Slit { x: 0.0, half: 0.3 }, lights: (&lights).into() };
    fill(&world, Settings { photons: 3001, edge: 13, seed, ..Settings::new(cube(1.0)) }, threads)
}

fn bits(grid: &CovarianceGrid<'_>) -> Vec<[u32; 7]> {
    let voxel = |v: &Voxel| {
        let [a, b, c, d, e, f] = v.sum.to_upper().map(f32::to_bits);
        [a, b, c, d, e, f, v.weight.to_bits()]
    };
    grid.view().voxels().iter().map(voxel).collect()
}

/// The grid in a file.
fn read_file(file: &std::path::Path) -> Result<CovarianceGrid<'static>, FileError<GridBytesError>> {
    load(file, |all| bytes::read(all, TAG, fogbow::storage::List::default()))
}

#[test]
fn one_two_and_seven_threads_fill_the_same_bits() {
    let expected = filled(1, 0);
    assert!(bits(&expected).iter().filter(|v| v[6] != 0).count() > 2000);
    for threads in [2, 7] {
        assert!(bits(&filled(threads, 0)) == bits(&expected), "{threads} threads");
    }
    assert!(bits(&filled(2, 1)) != bits(&expected));
}

// Files.

struct File(PathBuf);

impl File {
    fn new(name: &str) -> Self {
        Self(std::env::temp_dir().join(format!("fogbow-grid-{name}-{}", std::process::id())))
    }
}

impl Drop for File {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

#[test]
fn a_file_gives_the_same_bits_back() {
    let (file, grid) = (File::new("same"), filled(0, 5));
    write(&file.0, &grid.to_bytes(TAG)).unwrap();
    let copy = read_file(&file.0).unwrap();
    assert!(bits(&copy) == bits(&grid) && copy.view().lattice() == grid.view().lattice());
    assert_eq!(copy.view().paths(), 3001);
    // Written again, the file is the same.
    let before = std::fs::read(&file.0).unwrap();
    write(&file.0, &copy.to_bytes(TAG)).unwrap();
    assert!(std::fs::read(&file.0).unwrap() == before);
}

/// Sums of variances that are 0 but for rounding: what a fill writes must be readable.
#[test]
fn rounding_below_zero_is_read_back() {
    let lattice = Lattice::new(Bounds { min: Vec3::ZERO, max: Vec3::ONE }, [2, 1, 1]).unwrap();
    let voxel = |zz: f32| Voxel { sum: Symmetric3::from_upper([4.0, 0.0, 0.0, 1.0, 0.0, zz]), weight: 1.0 };
    let dark = Voxel { sum: Symmetric3::from_upper([0.0, 0.0, 0.0, 0.0, 0.0, -1.4e-45]), weight: 1e-40 };
    let voxels = [voxel(-1e-7), dark];
    let (_, copy) = read(&to_bytes(lattice, &voxels)).unwrap();
    let bits = |voxels: &[Voxel]| -> Vec<_> { voxels.iter().map(|v| v.sum.to_upper().map(f32::to_bits)).collect() };
    assert_eq!(bits(&copy), bits(&voxels));
}

fn to_bytes(lattice: Lattice, voxels: &[Voxel]) -> Vec<u8> {
    let mut all = Vec::new();
    let Ok(()) = bytes::write(&GridView::new(lattice, voxels, 1000).unwrap(), TAG, |part| {
        all.extend_from_slice(part);
        Ok::<(), core::convert::Infallible>(())
    });
    assert_eq!(all.len(), bytes::byte_count(&lattice));
    all
}

fn read(bytes: &[u8]) -> Result<(Lattice, Vec<Voxel>), GridBytesError> {
    let header = bytes::header(bytes, TAG)?;
    let mut voxels = vec![Voxel::EMPTY; header.lattice.cell_count()];
    bytes::read_into(bytes, TAG, &mut voxels)?;
    Ok((header.lattice, voxels))
}

/// Puts the right checksum into bytes that were changed: what is refused then is not damage.
fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    let mut crc = Crc::new();
    crc.add(&bytes[..64]);
    crc.add(&bytes[HEADER_BYTES..]);
    bytes[64..72].copy_from_slice(&crc.value().to_le_bytes());
    bytes
}

fn with(bytes: &[u8], at: usize, new: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    bytes[at..at + new.len()].copy_from_slice(new);
    bytes
}

fn small() -> Vec<u8> {
    let lattice = Lattice::new(Bounds { min: Vec3::ZERO, max: Vec3::new(3.0, 2.0, 2.0) }, [3, 2, 2]).unwrap();
    let voxel = |i: u8| {
        let x = f32::from(i);
        Voxel { sum: Symmetric3::from_upper([x, -0.5, 0.25, 1.0, 0.0, 3.0]), weight: 0.5 * x }
    };
    let voxels: Vec<Voxel> = (0..12).map(voxel).collect();
    to_bytes(lattice, &voxels)
}

#[test]
fn broken_bytes_are_refused_with_the_reason() {
    use GridBytesError::{Lattice, Storage, Voxel};
    let length = |found: usize, due: usize| Damage::Length { found: found as u64, due: due as u64 }.into();
    let header = |found| Damage::NoHeader { found, due: HEADER_BYTES }.into();
    let (magic, checksum) =
        (GridBytesError::from(Damage::Magic { due: "covariance grid" }), GridBytesError::from(Damage::Checksum));
    let version = |found| Damage::Version { found, known: VERSION }.into();
    let good = small();
    assert!(read(&good).is_ok());
    let word = |at: usize, value: u32| sealed(with(&good, at, &value.to_le_bytes()));
    let float = |at: usize, value: f32| sealed(with(&good, at, &value.to_le_bytes()));
    let voxel = |index: usize, entry: usize, value: f32| float(72 + 28 * index + 4 * entry, value);
    let due = good.len();
    assert_eq!(due, 72 + 28 * 12);
    let mut longer = good.clone();
    longer.push(0);
    let text = String::from_utf8_lossy(&good).replace('\n', "\r\n").into_bytes();
    let cases: Vec<(&str, Vec<u8>, GridBytesError)> = vec![
        ("empty", Vec::new(), header(0)),
        ("a header short of a byte", good[..71].to_vec(), header(71)),
        ("a header alone", good[..72].to_vec(), length(72, due)),
        ("a byte short", good[..due - 1].to_vec(), length(due - 1, due)),
        ("a byte more", longer, length(due + 1, due)),
        ("foreign magic", with(&good, 0, b"\x89PNG\r\n\x1a\n"), magic),
        ("a radiance cache", with(&good, 0, b"\x89FOGBOW\n"), magic),
        ("sent as text", text, magic),
        ("version 0", word(8, 0), version(0)),
        ("the next version", word(8, VERSION + 1), version(VERSION + 1)),
        ("no cells across", word(12, 0), Lattice),
        ("too many cells across", word(16, 1025), Lattice),
        ("endless cells across", word(20, u32::MAX), Lattice),
        ("one layer more", word(20, 3), length(due, due + 6 * 28)),
        ("one layer less", word(20, 1), length(due, due - 6 * 28)),
        ("a corner that is no number", float(24, f32::NAN), Lattice),
        ("a corner without end", float(44, f32::INFINITY), Lattice),
        ("corners the wrong way round", float(28, 5.0), Lattice),
        ("corners too far apart", sealed(with(&float(24, -3e38), 36, &3e38_f32.to_le_bytes())), Lattice),
        ("a box without extent", sealed(with(&good, 36, &[0; 12])), Lattice),
        (
            "another tag",
            sealed(with(&good, 48, &[7; 8])),
            Damage::Tag { found: 0x0707_0707_0707_0707, due: TAG }.into(),
        ),
        ("another tag, unsealed", with(&good, 48, &[7; 8]), checksum),
        ("another number of photons", with(&good, 56, &[7; 8]), checksum),
        ("another checksum", with(&good, 64, &[7; 8]), checksum),
        ("one bit of a voxel", with(&good, 200, &[good[200] ^ 1]), checksum),
        ("a weight that is no number", voxel(3, 6, f32::NAN), Voxel(3)),
        ("a sum that is no number", voxel(11, 1, f32::NAN), Voxel(11)),
        ("a sum without end", voxel(0, 4, f32::NEG_INFINITY), Voxel(0)),
        ("a weight below zero", voxel(5, 6, -1.0), Voxel(5)),
        ("a variance below zero", voxel(7, 3, -1e-3), Voxel(7)),
    ];
    assert!(cases.len() >= 15);
    let file = File::new("broken");
    for (name, bytes, expected) in cases {
        assert_eq!(read(&bytes).unwrap_err(), expected, "{name}");
        assert!(!expected.to_string().is_empty());
        std::fs::write(&file.0, &bytes).unwrap();
        let error = read_file(&file.0).unwrap_err();
        assert!(matches!(error.problem, Problem::Content(found) if found == expected), "{name}: {error}");
        assert!(error.to_string().contains(&expected.to_string()));
    }
    assert_eq!(bytes::header(&good, 1).unwrap_err(), Damage::Tag { found: TAG, due: 1 }.into());
    let mut few = [fogbow::covariance::Voxel::EMPTY; 11];
    assert_eq!(bytes::read_into(&good, TAG, &mut few), Err(Storage));
}

#[test]
fn files_that_are_none_are_refused() {
    let missing = read_file(&File::new("missing").0).unwrap_err();
    assert!(matches!(&missing.problem, Problem::Io(e) if e.kind() == std::io::ErrorKind::NotFound), "{missing}");
    let folder = read_file(&std::env::temp_dir()).unwrap_err();
    assert!(matches!(folder.problem, Problem::NoFile), "{folder}");
    let nowhere = write(&File::new("no").0.join("where"), &filled(1, 0).to_bytes(TAG)).unwrap_err();
    assert!(matches!(nowhere.problem, Problem::Io(_)), "{nowhere}");
}

#[test]
fn every_truncation_and_every_flipped_bit_is_found() {
    let good = small();
    for length in 0..good.len() {
        let error = read(&good[..length]).unwrap_err();
        let expected = match length {
            0..HEADER_BYTES => Damage::NoHeader { found: length, due: HEADER_BYTES },
            _ => Damage::Length { found: length as u64, due: good.len() as u64 },
        };
        assert_eq!(error, expected.into());
    }
    for bit in 0..8 * good.len() {
        let broken = with(&good, bit / 8, &[good[bit / 8] ^ 1 << (bit % 8)]);
        assert!(read(&broken).is_err(), "bit {bit}");
        // Sealed, a grid may be another one, but reading it ends well.
        drop(read(&sealed(broken)));
    }
}

// The walk through a lattice.

fn config() -> ProptestConfig {
    ProptestConfig {
        cases: 512,
        failure_persistence: None,
        rng_seed: proptest::test_runner::RngSeed::Fixed(1),
        ..ProptestConfig::default()
    }
}

fn lattices() -> impl Strategy<Value = Lattice> {
    let corner = prop::array::uniform3(-4.0_f32..4.0);
    // Flat ones, too.
    let extent = prop::array::uniform3(prop_oneof![4 => 0.1_f32..6.0, 1 => Just(0.0), 1 => 1e-4_f32..1e-2]);
    (corner, extent, prop::array::uniform3(1_u32..20)).prop_filter_map("no extent", |(min, extent, size)| {
        let min = Vec3::from(min);
        Lattice::new(Bounds { min, max: min + Vec3::from(extent) }, size).ok()
    })
}

/// Rays of all kinds, in units of a lattice's box: origin, direction, length.
fn rays() -> impl Strategy<Value = (Vec3, Vec3, f32)> {
    // On faces, at corners of cells, inside, outside, far away.
    let coordinate =
        prop_oneof![3 => -0.2_f32..1.2, 1 => Just(0.0), 1 => Just(1.0), 1 => Just(0.5), 1 => -9.0_f32..9.0];
    let component =
        prop_oneof![4 => -1.0_f32..1.0, 2 => Just(0.0), 1 => Just(-0.0), 1 => -1e-6_f32..1e-6, 1 => Just(1e-40)];
    let length = prop_oneof![3 => 0.01_f32..8.0, 2 => Just(f32::INFINITY), 1 => 1e-7_f32..1e-3, 1 => Just(0.0)];
    (prop::array::uniform3(coordinate), prop::array::uniform3(component), length)
        .prop_map(|(o, d, length)| (Vec3::from(o), Vec3::from(d).try_normalize().unwrap_or(Vec3::NEG_Y), length))
}

fn ray_in(lattice: &Lattice, (o, d, length): (Vec3, Vec3, f32)) -> Ray {
    let bounds = lattice.bounds();
    // Exactly on the far faces, too.
    let origin = Vec3::select(o.cmpeq(Vec3::ONE), bounds.max, bounds.min + o * bounds.size());
    Ray { origin, direction: d, length }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn cells_tile_any_ray_without_gaps(lattice in lattices(), ray in rays()) {
        let ray = ray_in(&lattice, ray);
        let crossings: Vec<CellCrossing> = lattice.cells(&ray).collect();
        let due = lattice.bounds().intersect(&ray).map(|(near, far)| (near.max(0.0), far.min(ray.length)));
        let Some((start, end)) = due.filter(|(start, end)| start < end) else {
            prop_assert!(crossings.is_empty());
            return Ok(());
        };
        prop_assert_eq!((crossings[0].enter, crossings[crossings.len() - 1].leave), (start, end));
        prop_assert!(crossings.windows(2).all(|pair| pair[0].leave == pair[1].enter && pair[0].cell != pair[1].cell));
        prop_assert!(crossings.len() <= lattice.size().iter().sum::<u32>() as usize);
        // What rounding of places and distances may move a face by.
        let reach = ray.origin.abs().max_element() + lattice.bounds().size().max_element() + end;
        let slack = 4e-6 * reach;
        for crossing in crossings {
            prop_assert!(crossing.enter < crossing.leave && crossing.cell < lattice.cell_count());
            let middle = ray.at(0.5 * (crossing.enter + crossing.leave));
            let off = (middle - lattice.centre(crossing.cell)).abs() - 0.5 * lattice.cell();
            prop_assert!(off.max_element() <= slack, "{:?}: {} off", crossing, off.max_element());
        }
    }

    #[test]
    fn cells_of_senseless_rays_are_few(lattice in lattices(), o in prop::array::uniform3(any::<f32>()), d in prop::array::uniform3(any::<f32>()), length in any::<f32>()) {
        let ray = Ray { origin: Vec3::from(o), direction: Vec3::from(d), length };
        let most = lattice.size().iter().sum::<u32>() as usize;
        let mut count = 0;
        for crossing in lattice.cells(&ray).take(most + 1) {
            prop_assert!(crossing.cell < lattice.cell_count() && crossing.enter < crossing.leave);
            count += 1;
        }
        prop_assert!(count <= most);
    }

    #[test]
    fn any_lattice_survives_its_bytes(lattice in lattices(), weight in 0.0_f32..1e30) {
        let voxels = vec![Voxel { weight, ..Voxel::EMPTY }; lattice.cell_count()];
        prop_assert_eq!(read(&to_bytes(lattice, &voxels)), Ok((lattice, voxels)));
    }
}

// Steps.

#[derive(Debug, Clone, Copy)]
enum Filling {
    Empty,
    Sparse,
    Moderate,
    Huge,
    Extreme,
}

fn voxels(lattice: &Lattice, filling: Filling, seed: u64) -> Vec<Voxel> {
    let mut rng = Generator::new(seed);
    let mut unit = || fogbow::sampling::uniform(&mut rng);
    (0..lattice.cell_count())
        .map(|_| {
            let (u, v, w) = (unit(), unit(), unit());
            let (gamma, weight) = match filling {
                Filling::Empty => return Voxel::EMPTY,
                Filling::Sparse if u > 0.1 => return Voxel::EMPTY,
                Filling::Sparse | Filling::Moderate => (100.0 * v, w),
                Filling::Huge => (1e12, 1e-3 + w),
                Filling::Extreme if u < 0.5 => (1.0, 1e38),
                Filling::Extreme => (1e38, 1.0),
            };
            let sum = Symmetric3::from_upper([gamma, 0.0, 0.0, 0.5 * gamma, 0.0, gamma]);
            Voxel { sum: sum.times(weight), weight }
        })
        .collect()
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn steps_hold_as_many_as_their_density_promises(
        lattice in lattices(), ray in rays(), seed in any::<u64>(),
        filling in prop_oneof![Just(Filling::Empty), Just(Filling::Sparse), Just(Filling::Moderate), Just(Filling::Huge)],
        count in prop_oneof![Just(None), (0.5_f32..50.0).prop_map(Some)],
        least in 0.01_f32..0.1, ratio in 1.0_f32..100.0,
    ) {
        let ray = ray_in(&lattice, ray);
        let ray = ray.with_length(ray.length.min(10.0));
        let voxels = voxels(&lattice, filling, seed);
        let grid = GridView::new(lattice, &voxels, 1).unwrap();
        let (most, rule) = (least * ratio, count.map_or(Rule::Frequency, |count| Rule::Error { count }));
        // The density of steps, cell by cell, in f64.
        let crossings: Vec<CellCrossing> = lattice.cells(&ray).collect();
        let light: f64 = crossings.iter().map(|c| f64::from(voxels[c.cell].weight) * f64::from(c.leave - c.enter)).sum();
        let density = |c: &CellCrossing| {
            let gamma = voxels[c.cell].covariance().map_or(0.0, |g| f64::from(g.along(ray.direction)).max(0.0));
            let n = match rule {
                Rule::Frequency => 2.0 * gamma.sqrt(),
                Rule::Error { count } if light > 0.0 => {
                    f64::from(count) * (f64::from(voxels[c.cell].weight) / light).sqrt() * gamma.powf(0.25)
                }
                Rule::Error { .. } => 0.0,
            };
            n.clamp(1.0 / f64::from(most), 1.0 / f64::from(least))
        };
        let held = |from: f64, to: f64| {
            let mut outside = to - from;
            let mut sum = 0.0;
            for c in &crossings {
                let overlap = (f64::from(c.leave).min(to) - f64::from(c.enter).max(from)).max(0.0);
                outside -= overlap;
                sum += overlap * density(c);
            }
            sum + outside / f64::from(most)
        };
        let mut steps = AdaptiveSteps::new(&grid, &ray, rule, (least, most));
        let mut at = 0.0_f32;
        let mut taken = 0;
        while at < ray.length {
            let step = steps.after(at);
            prop_assert!(step.is_finite() && step > 0.999 * least && step < 1.001 * most, "{step} not in {least}..{most}");
            let sum = held(f64::from(at), f64::from(at) + f64::from(step));
            // A step is the difference of two places in f32, 10 m away at most: 10⁻⁶ m of steps of a centimetre.
            prop_assert!((sum - 1.0).abs() < 1e-3, "the step of {step} at {at} holds {sum}");
            at += step;
            taken += 1;
            prop_assert!(taken <= 2000);
        }
        // Beyond the end as well.
        prop_assert!((steps.after(at + 100.0) / most - 1.0).abs() < 1e-3);
    }

    #[test]
    fn steps_stay_within_limits_whatever_the_grid_holds(lattice in lattices(), ray in rays(), seed in any::<u64>(), error in any::<bool>()) {
        let ray = ray_in(&lattice, ray);
        let ray = ray.with_length(ray.length.min(10.0));
        let voxels = voxels(&lattice, Filling::Extreme, seed);
        let grid = GridView::new(lattice, &voxels, 1).unwrap();
        let rule = if error { Rule::Error { count: 1e4 } } else { Rule::Frequency };
        let mut steps = AdaptiveSteps::new(&grid, &ray, rule, (0.01, 1.0));
        let mut at = 0.0;
        while at < ray.length {
            let step = steps.after(at);
            prop_assert!(step.is_finite() && (0.00999..1.001).contains(&step), "{step} at {at}");
            at += step;
        }
    }
}

#[test]
fn steps_of_an_empty_grid_are_the_longest() {
    let lattice = Lattice::cubic(cube(1.0), 8).unwrap();
    let voxels = vec![Voxel::EMPTY; lattice.cell_count()];
    let grid = GridView::new(lattice, &voxels, 1).unwrap();
    let ray = Ray::new(Vec3::new(-3.0, 0.1, 0.2), Vec3::X).with_length(6.0);
    for rule in [Rule::Frequency, Rule::Error { count: 16.0 }] {
        let mut steps = AdaptiveSteps::new(&grid, &ray, rule, (0.01, 0.75));
        assert!((0..8).all(|i| (steps.after(0.75 * i as f32) - 0.75).abs() < 1e-5));
    }
}

// Occluders.

/// Γ across a shaft of sunlight behind a slit that is open for `|y| < half` (m): by `y`, the mean over all cells along
/// the slit, at x = 0.5 m.
fn shaft(edge: u32, half: f32) -> Vec<(f32, f32)> {
    let (scene, fog) = (Slit { x: 0.0, half }, fog(0.01, 0.0));
    let lights = [Light::Sun(Sun::new(Vec3::NEG_X, Spectrum::ONE).unwrap())];
    let world = World { medium: &fog, scene: &scene, lights: (&lights).into() };
    let grid = fill(&world, Settings { photons: 60_000, edge, ..Settings::new(cube(1.0)) }, 0);
    let grid = grid.view();
    let cell = grid.lattice().cell().y;
    (0..edge)
        .filter_map(|j| {
            let y = -1.0 + (j as f32 + 0.5) * cell;
            let mut sum = Voxel::EMPTY;
            for k in 0..edge {
                let z = -1.0 + (k as f32 + 0.5) * cell;
                sum.merge(&grid.voxels()[grid.lattice().index(Vec3::new(0.5 + 0.5 * cell, y, z)).unwrap()]);
            }
            Some((y, sum.covariance()?.yy))
        })
        .collect()
}

#[test]
fn behind_a_slit_borders_are_sharp_and_sharper_in_finer_lattices() {
    for covered in [0.5, 0.7, 0.9] {
        let mut borders = Vec::new();
        for edge in [16, 32, 64] {
            // The plate covers this share of its last cell.
            let cell = 2.0 / edge as f32;
            let half = 0.25 + (1.0 - covered) * cell;
            let gamma = shaft(edge, half);
            let (low, high) = (gamma.first().unwrap(), gamma.last().unwrap());
            // Light reaches as far as the border's cell, on both sides.
            assert!(low.0 > -0.25 - cell && low.0 < -0.25 && high.0 > 0.25 && high.0 < 0.25 + cell, "{gamma:?}");
            let border = 0.5 * (low.1 + high.1);
            let middle = gamma[1..gamma.len() - 1].iter().map(|(_, g)| *g).fold(0.0, f32::max);
            println!("{covered} covered, {edge} cells: {border:.2} at the border, {middle:.4} between (cycles²/m²)");
            assert!((low.1 / high.1 - 1.0).abs() < 0.25, "{low:?} and {high:?} are alike");
            assert!(border > 100.0 * middle, "{border} at the border, {middle} between");
            borders.push(border);
        }
        // Distances to the plate are known twice as well: four times the variance.
        assert!(borders.windows(2).all(|pair| (3.0..5.0).contains(&(pair[1] / pair[0]))), "{borders:?}");
    }
}

#[test]
fn borders_on_the_faces_of_cells_are_not_seen() {
    // A limit of the model: an occluder is known in the cells that hold it, and light here passes beside them.
    let gamma = shaft(32, 0.25);
    assert_eq!(gamma.len(), 8);
    assert!(gamma.iter().all(|(_, g)| *g == 0.0), "{gamma:?}");
}

#[test]
fn where_nothing_occludes_sunlight_does_not_vary() {
    let lattice = Lattice::cubic(cube(1.0), 16).unwrap();
    let mut cells = vec![OccluderCell::default(); lattice.cell_count()];
    let mut occluders = Occluders::new(lattice, &mut cells[..]).unwrap();
    occluders.add_scene(&Slit { x: 0.0, half: 0.25 }, 2);
    // A plate across x lies in one layer of cells, but for the slit's four rows.
    assert_eq!(occluders.occupied(), 16 * (16 - 4));
    assert!(occluders.covariance(Vec3::new(0.5, 0.3, 0.0), Vec3::X).is_none());
    assert!(occluders.covariance(Vec3::new(0.05, 0.0, 0.0), Vec3::X).is_none());
    assert!(Occluders::new(lattice, &mut [OccluderCell::default(); 3][..]).is_err());
}

// Fluence.

/// Mean and standard error of sums over the voxels of grids, over batches with random numbers of their own.
fn batches(
    world: &World<'_, Homogeneous, Empty>,
    lattice: Lattice,
    max_scatterings: u32,
    walks: u32,
    sum: impl Fn(&GridView<'_>) -> f64,
) -> (f64, f64) {
    let settings = path::Settings { max_scatterings, ..path::Settings::default() };
    let samples: Vec<f64> = (0..24)
        .map(|batch| {
            let mut rng = Generator::new(1000 + batch);
            let mut voxels = vec![Voxel::EMPTY; lattice.cell_count()];
            let mut photons = FrequencyPhotons::new(*world, None, lattice);
            for _ in 0..walks {
                photon::trace(world, &lattice.bounds(), &settings, &mut rng, &mut |event| {
                    photons.visit(event, &mut voxels);
                });
            }
            sum(&GridView::new(lattice, &voxels, walks.into()).unwrap())
        })
        .collect();
    mean_and_error(&samples)
}

fn assert_near((mean, error): (f64, f64), due: f64, what: &str) {
    assert!((mean - due).abs() <= STANDARD_ERRORS * error, "{what}: {mean} ± {error}, expected {due}");
    assert!(error < 0.05 * due, "{what}: {mean} ± {error} proves nothing");
}

#[test]
fn the_fluence_of_a_lamp_in_absorbing_fog_is_the_closed_form() {
    let (absorption, fog) = (0.7, fog(0.7, 0.0));
    let lights = [lamp(Vec3::ZERO)];
    let world = World { medium: &fog, scene: &Empty, lights: (&lights).into() };
    let lattice = Lattice::cubic(cube(2.0), 15).unwrap();
    for at in [Vec3::new(0.5, 0.0, 0.0), Vec3::new(-0.6, 0.9, 0.3), Vec3::new(0.0, 0.0, -1.6)] {
        let index = lattice.index(at).unwrap();
        let centre = lattice.centre(index);
        // The mean over the cell.
        let n = 12;
        let mut due = 0.0;
        for i in 0..n * n * n {
            let part = Vec3::new((i % n) as f32, (i / n % n) as f32, (i / (n * n)) as f32);
            let r = (centre + ((part + 0.5) / n as f32 - 0.5) * lattice.cell()).length();
            due += f64::from((-absorption * r).exp() / (4.0 * PI * r * r)) / f64::from(n * n * n);
        }
        let found = batches(&world, lattice, 4, 20_000, |grid| f64::from(grid.fluence(centre).unwrap()));
        assert_near(found, due, &format!("fluence at {centre}"));
    }
}

#[test]
fn walks_end_where_max_scatterings_says() {
    let (scattering, fog) = (2.0, fog(0.0, 2.0));
    let lights = [lamp(Vec3::ZERO)];
    let world = World { medium: &fog, scene: &Empty, lights: (&lights).into() };
    // Ten mean free paths each way: nearly nothing leaves.
    let lattice = Lattice::cubic(cube(5.0), 6).unwrap();
    let cell = lattice.cell();
    let volume = f64::from(cell.x * cell.y * cell.z);
    let all = |grid: &GridView<'_>| -> f64 {
        let cells = (0..lattice.cell_count()).map(|i| f64::from(grid.fluence(lattice.centre(i)).unwrap()));
        cells.sum::<f64>() * volume
    };
    // ∫ F dV: a mean free path per flight.
    for flights in 1..=3 {
        let found = batches(&world, lattice, flights, 4000, all);
        assert_near(found, f64::from(flights) / scattering, &format!("{flights} flights"));
    }
    let (none, _) = batches(&world, lattice, 0, 100, all);
    assert_eq!(none, 0.0);
}
