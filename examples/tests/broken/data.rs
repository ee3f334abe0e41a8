//! Broken meshes, volumes and images.

use std::path::Path;

use super::common::{OBJ, PLY, densities, sky, volume};
use fogbow_examples::mesh::Mesh;
use fogbow_examples::picture::Picture;
use fogbow_examples::volume::Volume;

fn mentions(error: &impl ToString, words: &[&str]) {
    let error = error.to_string();
    for word in words {
        assert!(error.contains(word), "\"{error}\" does not mention {word}");
    }
}

#[test]
fn broken_ply_files_say_where() {
    let file = Path::new("m.ply");
    Mesh::from_ply(file, PLY.as_bytes()).unwrap();
    let cases: &[(&str, &str, &[&str])] = &[
        ("ply\n", "plx\n", &["header", "does not begin"]),
        ("end_header\n", "", &["header"]),
        ("format ascii 1.0\n", "", &["header", "\"format\" is missing"]),
        ("ascii 1.0", "ascii 2.0", &["header", "not understood"]),
        ("ascii 1.0", "utf16 1.0", &["header", "unknown format"]),
        ("element vertex 4", "element vertex many", &["header", "count"]),
        ("element vertex 4", "element vertex 4000000000", &["header", "4000000000", "bytes follow"]),
        ("element vertex 4", "element vertex 99999999999999999999", &["header", "count"]),
        ("element vertex 4", "element vertex 5", &["face 0"]),
        ("element face 2", "element face 3", &["face 2", "ends here"]),
        ("element face 2", "element vertex 2", &["header", "twice"]),
        ("property float z\n", "", &["header", "\"z\""]),
        ("property float x", "property real x", &["header", "unknown number type"]),
        ("property float y", "property float x", &["header", "twice"]),
        ("list uchar int vertex_indices", "list float int vertex_indices", &["header", "whole number"]),
        ("list uchar int vertex_indices", "list uchar float vertex_indices", &["header", "vertex_indices"]),
        ("vertex_indices", "corners", &["header", "vertex_indices"]),
        ("1 0 0\n", "nan 0 0\n", &["vertex 1", "x", "finite"]),
        ("1 0 0\n", "1 inf 0\n", &["vertex 1", "y", "finite"]),
        ("1 0 0\n", "1 0 1e300\n", &["vertex 1", "z", "finite"]),
        ("1 0 0\n", "1e20 0 0\n", &["vertex 1", "too far"]),
        ("1 0 0\n", "1 0 zero\n", &["vertex 1", "not a number"]),
        ("3 0 1 2\n", "3 0 1 9\n", &["face 0", "vertex 9"]),
        ("3 0 1 2\n", "3 0 1 -1\n", &["face 0", "-1"]),
        ("3 0 1 2\n", "2 0 1\n", &["face 0", "2 corners"]),
        ("3 0 1 2\n", "200 0 1\n", &["face 0", "entries"]),
        ("3 0 1 2\n3 0 2 3\n", "3 0 0 0\n3 1 1 2\n", &["no triangle with an area"]),
    ];
    for (whole, broken, words) in cases {
        assert!(PLY.contains(whole), "{whole}");
        let text = PLY.replacen(whole, broken, 1);
        match Mesh::from_ply(file, text.as_bytes()) {
            Ok(_) => panic!("{broken} was accepted"),
            Err(error) => mentions(&error, &[&["m.ply"], *words].concat()),
        }
    }
}

#[test]
fn binary_ply_files_are_read_in_both_byte_orders_and_may_be_cut_nowhere() {
    for (format, is_little) in [("binary_little_endian", true), ("binary_big_endian", false)] {
        let mut bytes = format!(
            "ply\nformat {format} 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
             property uchar red\nelement face 1\nproperty list uchar int vertex_indices\nproperty uchar material\nend_header\n"
        )
        .into_bytes();
        let header = bytes.len();
        for vertex in [[0.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0]] {
            for c in vertex {
                bytes.extend(if is_little { c.to_le_bytes() } else { c.to_be_bytes() });
            }
            bytes.push(7);
        }
        bytes.push(3);
        for index in [0_i32, 1, 2] {
            bytes.extend(if is_little { index.to_le_bytes() } else { index.to_be_bytes() });
        }
        bytes.push(0);
        let mesh = Mesh::from_ply(Path::new("b.ply"), &bytes).unwrap();
        assert_eq!((mesh.vertices[2].y, mesh.triangles[0]), (2.0, [0, 1, 2]));
        for end in 0..bytes.len() {
            let error = Mesh::from_ply(Path::new("b.ply"), &bytes[..end]).unwrap_err();
            if end > header + 10 {
                mentions(&error, &["b.ply"]);
            }
        }
    }
}

#[test]
fn broken_obj_files_are_errors() {
    let file = Path::new("m.obj");
    assert_eq!(Mesh::from_obj(file, OBJ.as_bytes()).unwrap().triangles.len(), 2);
    for (whole, broken) in [
        ("f 1 2 3 4", "f 1 2 3 9"),
        ("f 1 2 3 4", "f 0 1 2"),
        ("f 1 2 3 4", ""),
        ("f 1 2 3 4", "f 1 1 1"),
        ("v 0 0 1", "v 0 nan 1"),
        ("v 0 0 1", "v 0 zero 1"),
        ("v 0 0 1", "v 0 1e30 1"),
    ] {
        let text = OBJ.replacen(whole, broken, 1);
        match Mesh::from_obj(file, text.as_bytes()) {
            Ok(_) => panic!("{broken} was accepted"),
            Err(error) => mentions(&error, &["m.obj"]),
        }
    }
}

#[test]
fn broken_volumes_say_where() {
    let file = Path::new("g.vol");
    let good = densities([0.5; 8]);
    Volume::from_bytes(file, &volume([2, 2, 2], 1, 1, &good)).unwrap();
    Volume::from_bytes(file, &volume([2, 2, 2], 3, 1, &[9; 8])).unwrap();
    let mut not_a_number = [0.5; 8];
    not_a_number[6] = f32::NAN;
    let mut negative = [0.5; 8];
    negative[1] = -0.5;
    let cases: Vec<(Vec<u8>, &[&str])> = vec![
        (b"VOL".to_vec(), &["header", "too few"]),
        ([b"PNG\x03".as_slice(), &[0; 60]].concat(), &["header", "VOL"]),
        ([b"VOL\x02".as_slice(), &[0; 60]].concat(), &["header", "version 2"]),
        (volume([2, 2, 2], 2, 1, &good), &["header", "encoding 2"]),
        (volume([2, 2, 2], 1, 3, &good), &["header", "3 channels"]),
        (volume([0, 2, 2], 1, 1, &good), &["header", "0 x 2 x 2"]),
        (volume([-2, 2, 2], 1, 1, &good), &["header", "positive"]),
        (volume([2, 2, 2], 1, 1, &good[..31]), &["header", "32 bytes", "31"]),
        (volume([2, 2, 2], 1, 1, &[good.clone(), vec![0]].concat()), &["header", "33"]),
        (volume([i32::MAX, i32::MAX, i32::MAX], 1, 1, &good), &["header", "2^64"]),
        (volume([30_000, 30_000, 30_000], 3, 1, &good), &["header", "27000000000000"]),
        (volume([2, 2, 2], 1, 1, &densities(not_a_number)), &["cell (0, 1, 1)", "NaN"]),
        (volume([2, 2, 2], 1, 1, &densities(negative)), &["cell (1, 0, 0)", "-0.5"]),
    ];
    for (bytes, words) in cases {
        let error = Volume::from_bytes(file, &bytes).unwrap_err();
        mentions(&error, &[&["g.vol"], words].concat());
    }
}

#[test]
fn broken_images_are_errors() {
    let file = Path::new("i");
    assert_eq!(Picture::from_bytes(file, "pfm", &sky()).unwrap().width, 4);
    for (extension, bytes) in [
        ("pfm", b"PF\n4 2\n-1.0\n0000".to_vec()),
        ("pfm", b"PF\n4000000 2000000\n-1.0\n".to_vec()),
        ("pfm", b"PF".to_vec()),
        ("exr", b"\x76\x2f\x31\x01".to_vec()),
        ("png", b"\x89PNG\r\n\x1a\n".to_vec()),
        ("hdr", b"#?RADIANCE\n".to_vec()),
        ("npy", b"\x93NUMPY\x01\x00\xFF\xFF".to_vec()),
        ("npy", b"\x93NUMPY\x01\x00\x40\x00{'descr': '<f4', 'fortran_order': False, 'shape': (4, 4, 3), }   ".to_vec()),
        ("gif", Vec::new()),
    ] {
        let error = Picture::from_bytes(file, extension, &bytes).unwrap_err();
        mentions(&error, &["i: "]);
    }
}
