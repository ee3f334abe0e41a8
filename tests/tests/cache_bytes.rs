//! Caches as bytes and in files: the same bits come back, and whatever is broken is refused with a word
//! that says how.

use std::path::{Path, PathBuf};

use fogbow::bytes::Crc;
use fogbow::bytes::Damage;
use fogbow::cache::bytes::{self, Attachment, BytesError, HEADER_BYTES, Header, RecordKind, byte_count, read_into};
use fogbow::cache::{
    Asked, Basis, Cache, CachesError, Effort, Facing, FilledRecords, Kind, Limits, RadianceCaches, Reading, Record,
    Settings, SurfaceCache, VolumeCache,
};
use fogbow::light::{Light, PointLight};
use fogbow::math::{Ray, Vec3};
use fogbow::medium::Homogeneous;
use fogbow::phase::Lobe;
use fogbow::sh::Coefficient;
use fogbow::spectrum::{Gradient, Spectrum};
use fogbow::storage::Chunk;
use fogbow::surface::Surface;
use fogbow::work::finish;
use fogbow::world::World;
use fogbow_std::files::{self, FileError};
use fogbow_tests::hosts::Ball;
use proptest::prelude::*;

const TAG: u64 = 0x0123_4567_89ab_cdef;

/// Numbers in [0, 1).
fn random(mut state: u64) -> impl FnMut() -> f32 {
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 40) as f32 / (1 << 24) as f32
    }
}

fn point(unit: &mut impl FnMut() -> f32) -> Vec3 {
    Vec3::new(unit(), unit(), unit()) * 2.0 - 1.0
}

fn gradient(unit: &mut impl FnMut() -> f32) -> Gradient {
    Gradient::outer(Spectrum::new(unit(), unit(), unit()), point(unit))
}

fn record(unit: &mut impl FnMut() -> f32) -> Record {
    let value = Spectrum::new(unit(), unit(), unit());
    Record { position: point(unit), radius: 0.4 * 20_f32.powf(-unit()), value, gradient: gradient(unit) }
}

fn volume(count: usize, stride: usize, seed: u64) -> VolumeCache<'static> {
    let mut unit = random(seed);
    let mut cache = Cache::growing(stride);
    for _ in 0..count {
        let unit = &mut unit;
        let record = record(unit);
        let mut higher = || Coefficient { value: Spectrum::splat(unit() - 0.5), gradient: gradient(unit) };
        let higher: Vec<_> = (0..stride).map(|_| higher()).collect();
        assert_eq!(cache.insert(record, &higher), Ok(()));
    }
    cache.finish().unwrap();
    cache
}

fn surface(count: usize, seed: u64) -> SurfaceCache<'static> {
    let mut unit = random(seed);
    let mut cache = Cache::growing(1);
    for _ in 0..count {
        let facing = Facing { normal: point(&mut unit).normalize_or(Vec3::Z), turn: gradient(&mut unit) };
        assert_eq!(cache.insert(record(&mut unit), &[facing]), Ok(()));
    }
    cache.finish().unwrap();
    cache
}

fn to_bytes<E: Attachment>(cache: &Cache<'_, E>) -> Vec<u8> {
    let mut all = Vec::new();
    let Ok(()) = bytes::write(cache, TAG, |part| {
        all.extend_from_slice(part);
        Ok::<(), core::convert::Infallible>(())
    });
    assert_eq!(all.len(), byte_count(cache));
    all
}

fn read(bytes: &[u8], stride: usize) -> Result<VolumeCache<'static>, BytesError> {
    let mut cache = Cache::growing(stride);
    read_into(bytes, TAG, &mut cache).map(|()| cache)
}

/// Puts the right checksum into bytes that were changed: what is refused then is not damage.
fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    let mut crc = Crc::new();
    crc.add(&bytes[..32]);
    crc.add(&bytes[HEADER_BYTES..]);
    bytes[32..40].copy_from_slice(&crc.value().to_le_bytes());
    bytes
}

fn with(bytes: &[u8], at: usize, new: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    bytes[at..at + new.len()].copy_from_slice(new);
    bytes
}

fn bits(value: Option<Spectrum>) -> Option<[u32; 3]> {
    value.map(|v| v.0.map(f32::to_bits))
}

proptest! {
    #[test]
    fn the_copy_of_a_volume_cache_answers_with_the_same_bits(count in 0_usize..200, degree in 0_usize..4, seed in 1_u64..) {
        let cache = volume(count, (degree + 1) * (degree + 1) - 1, seed);
        let copy = read(&to_bytes(&cache), cache.stride()).unwrap();
        prop_assert_eq!(copy.records(), cache.records());
        prop_assert_eq!(copy.attachments(), cache.attachments());
        let (mut unit, reading) = (random(seed ^ 1), Reading::new(0.3));
        for _ in 0..200 {
            let (at, basis) = (point(&mut unit) * 1.2, Basis::new(point(&mut unit).normalize_or(Vec3::X), degree));
            prop_assert_eq!(bits(copy.lookup(at, &basis, &reading)), bits(cache.lookup(at, &basis, &reading)));
        }
    }

    #[test]
    fn the_copy_of_a_surface_cache_answers_with_the_same_bits(count in 0_usize..300, seed in 1_u64..) {
        let cache = surface(count, seed);
        let mut copy = surface(7, 99);
        read_into(&to_bytes(&cache), TAG, &mut copy).unwrap();
        let (mut unit, reading) = (random(seed ^ 1), Reading::new(0.3));
        for _ in 0..200 {
            let (at, normal) = (point(&mut unit) * 1.2, point(&mut unit).normalize_or(Vec3::X));
            prop_assert_eq!(bits(copy.lookup(at, normal, &reading)), bits(cache.lookup(at, normal, &reading)));
        }
    }

    #[test]
    fn bytes_of_any_kind_are_refused_without_panic(mut bytes in prop::collection::vec(any::<u8>(), 0..400), headed in any::<bool>()) {
        if headed && bytes.len() >= 16 {
            bytes[..16].copy_from_slice(b"\x89FOGBOW\n\x01\0\0\0\x01\0\0\0");
        }
        prop_assert!(read(&bytes, 0).is_err());
    }
}

/// The caches in a file.
fn load(file: &Path, settings: Settings, tag: u64) -> Result<RadianceCaches<'static>, FileError<CachesError>> {
    let mut caches = RadianceCaches::new(settings);
    files::load(file, |bytes| caches.read(bytes, tag)).map(|()| caches)
}

#[test]
fn the_layout_is_the_one_documented() {
    let mut cache: VolumeCache<'_> = Cache::growing(3);
    let gradient = Gradient::outer(Spectrum::new(1.0, 2.0, 4.0), Vec3::new(0.5, 0.25, 0.0));
    let record =
        Record { position: Vec3::new(1.0, 2.0, 3.0), radius: 0.5, value: Spectrum::new(7.0, 8.0, 9.0), gradient };
    let higher = [1.0, 2.0, 3.0].map(|v| Coefficient { value: Spectrum::splat(v), gradient: Gradient::ZERO });
    cache.insert(record, &higher).unwrap();
    let bytes = to_bytes(&cache);
    assert_eq!(bytes.len(), 40 + 64 + 3 * 48);
    assert_eq!(bytes[..24], *b"\x89FOGBOW\n\x01\0\0\0\x01\0\0\0\x03\0\0\0\x01\0\0\0");
    assert_eq!(bytes[24..32], TAG.to_le_bytes());
    let float = |at: usize| f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    let written: Vec<f32> = (0..16).map(|i| float(40 + 4 * i)).collect();
    assert_eq!(written, [1.0, 2.0, 3.0, 0.5, 7.0, 8.0, 9.0, 0.5, 1.0, 2.0, 0.25, 0.5, 1.0, 0.0, 0.0, 0.0]);
    assert_eq!([0, 1, 2].map(|i| float(104 + 48 * i)), [1.0, 2.0, 3.0]);
    let header = Header::read(&bytes).unwrap();
    assert_eq!((header.kind, header.stride, header.count, header.tag), (RecordKind::Volume, 3, 1, TAG));
    assert_eq!(header.byte_count(), bytes.len());
}

#[test]
fn every_flipped_bit_is_found() {
    let whole = to_bytes(&volume(3, 3, 5));
    assert!(read(&whole, 3).is_ok());
    for bit in 0..8 * whole.len() {
        let mut flipped = whole.clone();
        flipped[bit / 8] ^= 1 << (bit % 8);
        assert!(read(&flipped, 3).is_err(), "bit {bit}");
    }
}

#[test]
fn every_other_byte_is_found_and_every_cut() {
    let whole = to_bytes(&surface(2, 5));
    let read = |bytes: &[u8]| read_into(bytes, TAG, &mut SurfaceCache::growing(1));
    assert_eq!(read(&whole), Ok(()));
    for at in 0..whole.len() {
        for change in 1..=255 {
            assert!(read(&with(&whole, at, &[whole[at] ^ change])).is_err(), "byte {at}");
        }
        let expected = match at {
            0..HEADER_BYTES => Damage::NoHeader { found: at, due: HEADER_BYTES },
            _ => Damage::Length { found: at as u64, due: whole.len() as u64 },
        };
        assert_eq!(read(&whole[..at]), Err(expected.into()));
    }
}

#[test]
fn what_is_wrong_is_said() {
    let whole = to_bytes(&volume(4, 0, 9));
    let number = |at: usize, value: u32| with(&whole, at, &value.to_le_bytes());
    let float = |at: usize, value: f32| sealed(with(&whole, at, &value.to_le_bytes()));
    let more = [&whole[..], b"x"].concat();
    let magic = BytesError::from(Damage::Magic { due: "radiance cache" });
    let cases: &[(&[u8], BytesError, &str)] = &[
        (b"", Damage::NoHeader { found: 0, due: 40 }.into(), "cut off after 0 bytes"),
        (&[0; 40], magic, "no radiance cache"),
        (&with(&whole, 0, b"\x89PNG\r\n\x1a\n"), magic, "no radiance cache"),
        (&number(8, 2), Damage::Version { found: 2, known: 1 }.into(), "version 2 of the format; 1 is known"),
        (&number(12, 3), BytesError::UnknownKind(3), "unknown kind 3"),
        (
            &sealed(number(12, 2)),
            BytesError::Kind { found: RecordKind::Surface, due: RecordKind::Volume },
            "on surfaces where records in a medium",
        ),
        (&number(16, 300), BytesError::Size { stride: 300, count: 4 }, "300 attachments"),
        (&number(20, 5), Damage::Length { found: 296, due: 360 }.into(), "cut off: 360 bytes are due, 296"),
        (&number(20, 3), Damage::Length { found: 296, due: 232 }.into(), "goes on after its end"),
        (&more, Damage::Length { found: 297, due: 296 }.into(), "goes on after its end"),
        (&with(&whole, 100, &[whole[100] ^ 4]), Damage::Checksum.into(), "damaged"),
        (&sealed(with(&whole, 24, &[0; 8])), Damage::Tag { found: 0, due: TAG }.into(), "something else"),
        (&float(40, f32::NAN), BytesError::Record(0), "number 0"),
        (&float(40 + 64 + 8, f32::INFINITY), BytesError::Record(1), "number 1"),
        (&float(40 + 2 * 64 + 12, -0.5), BytesError::Record(2), "number 2"),
        (&float(40 + 3 * 64 + 12, 0.0), BytesError::Record(3), "number 3"),
        (&float(40 + 16, -1.0), BytesError::Record(0), "not valid"),
        (&float(40 + 28, f32::NAN), BytesError::Record(0), "not valid"),
    ];
    for (bytes, expected, word) in cases {
        let error = read(bytes, 0).unwrap_err();
        assert_eq!(error, *expected);
        assert!(error.to_string().contains(word), "{error}");
    }
    let stride = read(&to_bytes(&volume(2, 3, 1)), 0).unwrap_err();
    assert_eq!(stride, BytesError::Stride { found: 3, due: 0 });
    assert!(stride.to_string().contains("another degree"), "{stride}");

    let whole = to_bytes(&volume(2, 3, 1));
    let broken = sealed(with(&whole, 40 + 2 * 64 + 5 * 48, &f32::NAN.to_le_bytes()));
    assert_eq!(read(&broken, 3).unwrap_err(), BytesError::Attachment(1));
    let whole = to_bytes(&surface(2, 1));
    let broken = sealed(with(&whole, 40 + 2 * 64, &9_f32.to_le_bytes()));
    assert_eq!(read_into(&broken, TAG, &mut SurfaceCache::growing(1)), Err(BytesError::Attachment(0)));
}

#[test]
fn a_refused_file_changes_nothing() {
    let mut cache = volume(5, 0, 3);
    let (before, mut broken) = (cache.records().to_vec(), to_bytes(&volume(9, 0, 4)));
    broken[200] ^= 1;
    assert!(read_into(&broken, TAG, &mut cache).is_err());
    assert_eq!(cache.records(), before);
}

#[test]
fn lent_storage_is_filled_or_said_to_be_too_small() {
    let whole = to_bytes(&volume(8, 0, 3));
    for (slots, expected) in [(8, Ok(())), (7, Err(BytesError::Full))] {
        let mut memory = vec![Chunk::default(); VolumeCache::chunks(slots, 0)];
        let mut cache = VolumeCache::lent(&mut memory, 0);
        assert_eq!(read_into(&whole, TAG, &mut cache), expected);
        assert_eq!(cache.len(), if expected.is_ok() { 8 } else { 0 });
    }
}

// ---------------------------------------------------------------------------------------------
// Files

/// A folder of its own, gone when dropped.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("fogbow-caches-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    fn with(&self, bytes: &[u8]) -> PathBuf {
        std::fs::write(self.path("broken"), bytes).unwrap();
        self.path("broken")
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Few records: as large as the room.
fn settings() -> Settings {
    let limits = Limits { min: 1.0, max: 1.5 };
    let effort = Effort { tolerance: 0.5, samples: 64, degree: 1, limits, clearance: 0.5, free_paths: 1.0 };
    let flat = Effort { degree: 0, ..effort };
    Settings {
        single: None,
        surface: Some(effort),
        multiple: Some(effort),
        irradiance: Some(flat),
        rays: 4,
        pixels: [1.0, 1000.0],
        ..Settings::default()
    }
}

/// Of a lamp in a foggy room.
fn caches() -> RadianceCaches<'static> {
    let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::splat(0.3), Lobe::HenyeyGreenstein { g: 0.4 }).unwrap();
    let surface = Surface::Lambert { reflectance: Spectrum::splat(0.6) };
    let room = Ball { centre: Vec3::ZERO, radius: 2.0, surface };
    let lamps = [Light::Point(PointLight::new(Vec3::Y, Spectrum::ONE).unwrap())];
    let world = World { medium: &fog, scene: &room, lights: (&lamps).into() };
    let ray = |at: [f32; 2]| Ray::new(Vec3::ZERO, Vec3::new(at[0], at[1], 1.0).normalize());
    let mut filling = RadianceCaches::new(settings()).fill(Asked::View { ray, pixel: 0.06 });
    finish(&mut filling, &world, &mut FilledRecords::default());
    filling.finish()
}

fn decode(bytes: &[u8], settings: Settings, tag: u64) -> Result<RadianceCaches<'static>, CachesError> {
    let mut caches = RadianceCaches::new(settings);
    caches.read(bytes, tag).map(|()| caches)
}

fn refusal(file: &Path, settings: Settings, tag: u64) -> String {
    let error = load(file, settings, tag).unwrap_err().to_string();
    assert!(error.starts_with(&format!("{}: ", file.display())), "{error}");
    error
}

#[test]
fn all_caches_come_back_from_a_file() {
    let folder = Folder::new("whole");
    let (file, caches) = (folder.path("caches"), caches());
    for _ in 0..2 {
        files::write(&file, &caches.to_bytes(TAG)).unwrap();
        let copy = load(&file, settings(), TAG).unwrap();
        for kind in Kind::ALL {
            assert!(kind == Kind::Single || !caches.records(kind).is_empty(), "{kind:?}");
            assert_eq!(copy.records(kind), caches.records(kind));
        }
        assert_eq!((copy.is_open(), copy.settings()), (false, caches.settings()));
        assert!(copy.to_bytes(TAG) == caches.to_bytes(TAG));
    }
    assert_eq!(std::fs::read_dir(&folder.0).unwrap().count(), 1);
}

#[test]
fn files_damaged_anywhere_are_refused() {
    let folder = Folder::new("damaged");
    let file = folder.path("caches");
    files::write(&file, &caches().to_bytes(TAG)).unwrap();
    let whole = std::fs::read(&file).unwrap();
    for at in 0..whole.len() {
        for change in [1, 0x80, 0xff] {
            assert!(decode(&with(&whole, at, &[whole[at] ^ change]), settings(), TAG).is_err(), "byte {at}");
        }
        assert!(decode(&whole[..at], settings(), TAG).is_err(), "{at} bytes");
    }
    assert!(refusal(&folder.with(&whole[..12]), settings(), TAG).contains("cut off"));
    assert!(refusal(&folder.with(&whole[..whole.len() - 1]), settings(), TAG).contains("cut off"));
    assert!(refusal(&folder.with(&[&whole[..], b"."].concat()), settings(), TAG).contains("goes on after its end"));
    assert!(refusal(&folder.with(b""), settings(), TAG).contains("cut off after 0 bytes"));
    assert!(
        refusal(&folder.with(b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR"), settings(), TAG).contains("no file of radiance caches")
    );
    assert!(refusal(&folder.with(&to_bytes(&volume(2, 0, 1))), settings(), TAG).contains("no file of radiance caches"));
    assert!(refusal(&folder.with(&with(&whole, 8, &[9])), settings(), TAG).contains("version 9"));
    assert!(refusal(&folder.with(&with(&whole, 12, &[0xff; 8])), settings(), TAG).contains("cut off"));
    assert!(refusal(&folder.with(&with(&whole, 60, &[1])), settings(), TAG).contains("damaged"));
    let last = whole.len() - 9;
    let error = refusal(&folder.with(&with(&whole, last, &[whole[last] ^ 1])), settings(), TAG);
    assert!(error.contains("its cache \"coarse irradiance\" is damaged"), "{error}");
}

#[test]
fn files_for_something_else_are_refused() {
    let folder = Folder::new("other");
    let file = folder.path("caches");
    files::write(&file, &caches().to_bytes(TAG)).unwrap();
    assert!(refusal(&file, settings(), TAG + 1).contains("something else"));
    let changed = |change: fn(&mut Effort)| {
        let mut other = settings();
        change(other.multiple.as_mut().unwrap());
        refusal(&file, other, TAG)
    };
    assert!(changed(|e| e.degree = 2).contains("\"multiple\" was made with degree 1; 2 is asked for"));
    assert!(changed(|e| e.tolerance = 0.25).contains("tolerance 0.5; 0.25"));
    assert!(changed(|e| e.samples = 128).contains("samples per record 64; 128"));
    let more = Settings { single: settings().surface, ..settings() };
    assert!(refusal(&file, more, TAG).contains("no cache \"single\""));
    let less = Settings { surface: None, ..settings() };
    assert!(refusal(&file, less, TAG).contains("\"surface\", which is not asked for"));

    // What steers where records are made may differ.
    let finer = Settings { rays: 99, seed: 5, ..settings() };
    assert_eq!(*load(&file, finer, TAG).unwrap().settings(), finer);
}

#[test]
fn reaches_that_were_shrunk_stay_so() {
    let reaching = |share: f32| {
        let mut settings = settings();
        let effort = settings.multiple.as_mut().unwrap();
        effort.limits.max *= share;
        (effort.clearance, effort.free_paths) = (share * effort.clearance, share * effort.free_paths);
        settings
    };
    // Of the file and of what is asked for, the nearer; not below the least radius, whatever a file says.
    for (written, asked, due) in [(0.8, 1.0, 0.8), (1.0, 0.8, 0.8)] {
        let bytes = RadianceCaches::new(reaching(written)).to_bytes(TAG);
        assert_eq!(*decode(&bytes, reaching(asked), TAG).unwrap().settings(), reaching(due));
    }
    let bytes = RadianceCaches::new(reaching(f32::NAN)).to_bytes(TAG);
    assert_eq!(*decode(&bytes, settings(), TAG).unwrap().settings(), settings());
    let bytes = RadianceCaches::new(reaching(-1.0)).to_bytes(TAG);
    assert_eq!(decode(&bytes, settings(), TAG).unwrap().settings().multiple.unwrap().limits.max, 1.0);
}

#[test]
fn what_is_no_file_is_refused() {
    let folder = Folder::new("none");
    assert!(refusal(&folder.0, settings(), TAG).contains("is not a file"));
    assert!(refusal(&folder.path("none"), settings(), TAG).contains("No such file"));
    let error = files::write(&folder.0, &caches().to_bytes(TAG)).unwrap_err().to_string();
    assert!(error.starts_with(&format!("{}: ", folder.0.display())), "{error}");
    assert!(files::write(&folder.path("none/caches"), &caches().to_bytes(TAG)).is_err());
    assert_eq!(std::fs::read_dir(&folder.0).unwrap().count(), 0);
}
