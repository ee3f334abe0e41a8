//! Mutations of good files, from a fixed seed: whatever comes out, nothing may panic.
//!
//! A second per reader; `FOGBOW_FUZZ_SECONDS=300 cargo test -p fogbow-examples fuzz` for more.

use std::path::Path;
use std::time::{Duration, Instant};

use fogbow::host::Scene;
use fogbow::math::{Ray, Vec2, Vec3};
use fogbow_examples::mesh::Mesh;
use fogbow_examples::picture::Picture;
use fogbow_examples::scene_file::{Findings, ReadOptions, SceneFile};
use fogbow_examples::transform::Transform;
use fogbow_examples::vdb::Grid;
use fogbow_examples::volume::Volume;
use fogbow_examples::world::{Storage, World};

use super::common::{Folder, OBJ, PLY, SCENE, densities, sky, volume};

/// xorshift64.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }
    fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }
}

/// Words that readers may stumble over.
const WORDS: &[&str] = &[
    "nan",
    "inf",
    "-1",
    "0",
    "1e39",
    "1e-45",
    "4294967295",
    "-2147483648",
    "99999999999999999999",
    "$spp",
    "<",
    ">",
    "\"",
    "/>",
    "&amp;",
    "&#0;",
    "<!--",
    "]]>",
    "\u{feff}",
    "id=\"smoke\"",
    "type=\"cube\"",
    "0 0 0",
    "",
    "180",
    "1e18",
    "x=\"1e9\"",
];

fn mutate(good: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = good.to_vec();
    for _ in 0..=random.below(4) {
        let at = random.below(bytes.len());
        let length = random.below(24).min(bytes.len() - at);
        match random.below(8) {
            0 => bytes.truncate(at),
            1 => drop(bytes.drain(at..at + length)),
            2 => {
                let copy = bytes[at..at + length].to_vec();
                let to = random.below(bytes.len());
                bytes.splice(to..to, copy);
            }
            3 if at < bytes.len() => bytes[at] ^= 1 << random.below(8),
            4 if at < bytes.len() => bytes[at] = [0, 1, 0x7F, 0x80, 0xFF, b'0', b'9', b'-'][random.below(8)],
            // A number becomes another word.
            5 | 6 => {
                let is_number = |b: &u8| b.is_ascii_digit() || *b == b'.' || *b == b'-';
                if let Some(start) = bytes.iter().skip(at).position(is_number).map(|i| i + at) {
                    let end = bytes.iter().skip(start).position(|b| !is_number(b)).map_or(bytes.len(), |i| i + start);
                    let word = WORDS[random.below(WORDS.len())];
                    bytes.splice(start..end, word.bytes());
                }
            }
            _ => {
                let word = WORDS[random.below(WORDS.len())];
                bytes.splice(at..at, word.bytes());
            }
        }
    }
    bytes
}

/// Feeds mutations of the seeds to a reader.
fn fuzz(seeds: &[Vec<u8>], mut read: impl FnMut(&[u8])) {
    let seconds = std::env::var("FOGBOW_FUZZ_SECONDS").ok().and_then(|s| s.parse().ok()).unwrap_or(1);
    let (start, limit) = (Instant::now(), Duration::from_secs(seconds));
    let mut random = Random(0x2545_F491_4F6C_DD1D);
    let mut rounds = 0_u64;
    while start.elapsed() < limit {
        for seed in seeds {
            read(&mutate(seed, &mut random));
            rounds += 1;
        }
    }
    println!("{rounds} rounds");
}

#[test]
fn fuzz_scenes() {
    let folder = Folder::new("fuzz");
    let file = folder.path("scene.xml");
    let mut built = 0;
    fuzz(&[SCENE.as_bytes().to_vec()], |bytes| {
        let text = String::from_utf8_lossy(bytes);
        let Ok(scene) = SceneFile::parse(&file, &text) else { return };
        let mut storage = Storage::new(&scene);
        let Ok(world) = World::new(&scene, &mut storage) else { return };
        built += 1;
        let camera = world.camera();
        for i in 0..16 {
            let ray = camera.ray(Vec2::new(i as f32 / 15.0, 0.4));
            if let Some(hit) = world.closest_hit(&ray) {
                assert!(hit.distance > 0.0 && (hit.normal.length() - 1.0).abs() < 1e-3, "{hit:?} in\n{text}");
            }
            world.is_blocked(&Ray::between(ray.origin, Vec3::ZERO));
        }
    });
    println!("{built} scenes were sound");
    assert!(built > 0);
}

#[test]
fn fuzz_volumes() {
    let seeds = [
        volume([2, 2, 2], 1, 1, &densities([0.5; 8])),
        volume([2, 2, 2], 3, 1, &[9; 8]),
        volume([1, 1, 8], 3, 1, &[9; 8]),
    ];
    fuzz(&seeds, |bytes| drop(Volume::from_bytes(Path::new("g.vol"), bytes)));
}

/// Files of both kinds, packed in every way; what is read is made into bricks, too.
#[test]
fn fuzz_sparse_volumes() {
    let names = ["odd_zip.vdb", "blosc.vdb", "half.vdb", "several.vdb", "fp4.nvdb", "fpN.nvdb", "blosc.nvdb"];
    let mut sound = 0;
    fuzz(&names.map(crate::vdb::file), |bytes| {
        let Ok(grid) = Grid::from_bytes(Path::new("g.vdb"), bytes.to_vec(), None) else { return };
        sound += usize::from(grid.into_bricks(Path::new("g.vdb")).is_ok());
    });
    println!("{sound} were sound");
    assert!(sound > 0);
}

/// Whether a world can be built of what was read; if nothing was, it is told why. A ray through it ends well.
fn is_sound(findings: &Findings) -> bool {
    let Some(scene) = &findings.scene else {
        assert!(!findings.errors.is_empty());
        return false;
    };
    let mut storage = Storage::new(scene);
    let Ok(world) = World::new(scene, &mut storage) else { return false };
    let hit = world.closest_hit(&world.camera().ray(Vec2::splat(0.5)));
    assert!(hit.is_none_or(|hit| hit.distance > 0.0 && (hit.normal.length() - 1.0).abs() < 1e-3), "{hit:?}");
    true
}

/// Text and binary; what is read is built, too.
#[test]
fn fuzz_gltf() {
    let (mut built, file) = (0, Path::new("none/room.gltf"));
    let seeds = [crate::gltf::binary_box(), crate::gltf::triangle("", ",\"nodes\":[{\"mesh\":0}]").into_bytes()];
    fuzz(&seeds, |bytes| {
        let findings = SceneFile::from_gltf(file, bytes, &ReadOptions::default());
        built += usize::from(is_sound(&findings));
    });
    println!("{built} scenes were sound");
    assert!(built > 0);
}

/// What is read is built, too; strictly and leniently by turns.
#[test]
fn fuzz_pbrt() {
    let (mut built, mut is_lenient) = (0, false);
    fuzz(&[crate::pbrt::ROOM.as_bytes().to_vec()], |bytes| {
        is_lenient = !is_lenient;
        let options = ReadOptions { is_lenient, ..ReadOptions::default() };
        let findings = SceneFile::from_pbrt(Path::new("none/room.pbrt"), &String::from_utf8_lossy(bytes), &options);
        built += usize::from(is_sound(&findings));
    });
    println!("{built} scenes were sound");
    assert!(built > 0);
}

#[test]
fn fuzz_fog() {
    let folder = Folder::new("fuzz-fog");
    folder.write("cloud.nvdb", &crate::vdb::file("fp4.nvdb"));
    let file = folder.path("fog.toml");
    let options = ReadOptions { fog: Some(file.clone()), ..ReadOptions::default() };
    let (mut built, scene) = (0, crate::gltf::triangle("", ",\"nodes\":[{\"mesh\":0}]"));
    fuzz(&[crate::gltf::ALL_FORMS.as_bytes().to_vec()], |bytes| {
        std::fs::write(&file, bytes).unwrap();
        let findings = SceneFile::from_gltf(&folder.path("room.gltf"), scene.as_bytes(), &options);
        built += usize::from(is_sound(&findings));
    });
    println!("{built} scenes were sound");
    assert!(built > 0);
}

#[test]
fn fuzz_meshes() {
    let mut binary = b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty double y\n\
        property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
        .to_vec();
    for vertex in [[0.0_f32, 0.0], [1.0, 0.0], [0.0, 2.0]] {
        binary.extend(vertex[0].to_le_bytes());
        binary.extend(f64::from(vertex[1]).to_le_bytes());
        binary.extend(0.5_f32.to_le_bytes());
    }
    binary.push(3);
    binary.extend([0_i32, 1, 2].iter().flat_map(|i| i.to_le_bytes()));
    assert!(Mesh::from_ply(Path::new("m.ply"), &binary).is_ok());
    fuzz(&[PLY.as_bytes().to_vec(), binary], |bytes| drop(Mesh::from_ply(Path::new("m.ply"), bytes)));
    let rich =
        PLY.replace("property float z", "property float z\nproperty float nx\nproperty float ny\nproperty float nz");
    let sheet = include_bytes!("../shapes/sheet.ply").to_vec();
    assert!(Mesh::from_ply(Path::new("m.ply"), &sheet).is_ok());
    fuzz(&[rich.into_bytes(), sheet], |bytes| drop(Mesh::from_ply(Path::new("m.ply"), bytes)));
    fuzz(&[OBJ.as_bytes().to_vec()], |bytes| drop(Mesh::from_obj(Path::new("m.obj"), bytes)));
    let obj = include_bytes!("../shapes/fold.obj").to_vec();
    fuzz(&[obj], |bytes| drop(Mesh::from_obj(Path::new("m.obj"), bytes)));
    let several = include_bytes!("../shapes/two.serialized").to_vec();
    assert!(Mesh::from_serialized(Path::new("m.serialized"), &several, 1).is_ok());
    fuzz(&[several], |bytes| drop(Mesh::from_serialized(Path::new("m.serialized"), bytes, 1)));
    let curve = include_bytes!("../shapes/curve.txt").to_vec();
    let read = |bytes: &[u8]| Mesh::from_curves(Path::new("c.txt"), bytes, true, &Transform::IDENTITY);
    assert!(read(&curve).is_ok());
    fuzz(&[curve], |bytes| drop(read(bytes)));
}

#[test]
fn fuzz_images() {
    let header = b"{'descr': '<f4', 'fortran_order': False, 'shape': (1, 2, 3), }\n";
    let npy = [b"\x93NUMPY\x01\x00", &(header.len() as u16).to_le_bytes()[..], header, &[0; 24]].concat();
    let hdr = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n\x80\x80\x80\x80\x80\x80\x80\x80".to_vec();
    let png = fogbow_std::image::png::encode(&fogbow_std::image::pfm::decode(&sky()).unwrap(), 0.0).unwrap();
    for (extension, seed) in [("npy", npy), ("hdr", hdr), ("pfm", sky()), ("png", png)] {
        assert!(Picture::from_bytes(Path::new("i"), extension, &seed).is_ok(), "{extension}");
        fuzz(&[seed], |bytes| drop(Picture::from_bytes(Path::new("i"), extension, bytes)));
    }
}
