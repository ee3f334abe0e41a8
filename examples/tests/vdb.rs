//! OpenVDB and NanoVDB files, against what their own libraries read: see `vdb/make.cc`, which wrote them.

use std::io::Read;
use std::path::{Path, PathBuf};

use fogbow::host::Medium;
use fogbow::math::Vec3;
use fogbow_examples::scene_file::SceneFile;
use fogbow_examples::vdb::Grid;
use fogbow_examples::world::{Storage, WithMedium, World};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/vdb")
}

/// A file that was written there, as it was written.
pub(crate) fn file(name: &str) -> Vec<u8> {
    let packed = std::fs::read(folder().join(format!("{name}.gz"))).unwrap();
    let mut bytes = Vec::new();
    flate2::read::GzDecoder::new(&packed[..]).read_to_end(&mut bytes).unwrap();
    bytes
}

fn read(name: &str, grid: &str) -> Grid {
    Grid::from_bytes(Path::new(name), file(name), Some(grid)).unwrap()
}

fn positions(low: [i32; 3], high: [i32; 3]) -> impl Iterator<Item = [i32; 3]> {
    let [x, y, z] = [0, 1, 2].map(|axis| low[axis]..=high[axis]);
    z.flat_map(move |z| (y.clone().zip(std::iter::repeat(x.clone()))).flat_map(move |(y, x)| x.map(move |x| [x, y, z])))
}

#[test]
fn every_voxel_is_what_the_libraries_read() {
    let table = std::fs::read_to_string(folder().join("values.txt")).unwrap();
    let mut kinds = 0;
    for line in table.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        let numbers: Vec<f64> = words[2..8].iter().chain(&words[9..]).map(|w| w.parse().unwrap()).collect();
        let grid = read(words[0], words[1]);
        let corner = |at: usize| [0, 1, 2].map(|axis| numbers[at + axis] as i32);
        let (low, high) = (corner(0), corner(3));
        assert_eq!(grid.active_box(), Some([low, high]), "{line}");
        let (mut crc, mut sum) = (flate2::Crc::new(), 0.0);
        for voxel in positions(low.map(|c| c - 3), high.map(|c| c + 3)) {
            let value = grid.value(voxel);
            sum += f64::from(value);
            crc.update(&value.to_le_bytes());
        }
        assert!((sum - numbers[6]).abs() <= 1e-8 * sum, "{line}: sum {sum}");
        assert_eq!(format!("{:08x}", crc.sum()), words[8], "{line}");
        for (voxel, at) in [([0.0; 3], 7), ([1.0, 2.0, 3.0], 10)] {
            let place = grid.to_world.point(voxel);
            assert!((0..3).all(|axis| (place[axis] - numbers[at + axis]).abs() < 1e-6), "{line}: {place:?}");
        }
        kinds += 1;
    }
    assert_eq!(kinds, 21);
}

#[test]
fn bricks_hold_every_voxel_and_nothing_around() {
    for (name, grid) in
        [("none.vdb", "density"), ("several.vdb", "again"), ("odd_zip.vdb", "odd"), ("fp8.nvdb", "density")]
    {
        let grid = read(name, grid);
        let [low, high] = grid.active_box().unwrap();
        let bricks = grid.clone().into_bricks(Path::new(name)).unwrap();
        let size = bricks.size().map(f64::from);
        // The first voxel of the box, from where the first cell's centre lies in the world.
        let first = bricks.in_file().point(size.map(|n| 0.5 / n));
        let origin = grid.to_world.inverse().unwrap().point(first).map(|c| c.round() as i32);
        let here = grid.to_world.point(origin.map(f64::from));
        assert!((0..3).all(|axis| (here[axis] - first[axis]).abs() < 1e-9), "{name}");
        let unit = bricks.in_active_box().point([0, 1, 2].map(|i| f64::from(low[i] - origin[i]) / size[i]));
        assert!(unit.iter().all(|c| c.abs() < 1e-12), "{name}: {unit:?}");
        for voxel in positions(low.map(|c| c - 2), high.map(|c| c + 2)) {
            let cell = [0, 1, 2].map(|axis| voxel[axis] - origin[axis]);
            let is_inside = (0..3).all(|axis| voxel[axis] >= low[axis] && voxel[axis] <= high[axis]);
            // Tiles that are not active, and what lies outside of the box of active voxels, are left out.
            let value = if is_inside { grid.value(voxel) } else { 0.0 };
            assert_eq!(bricks.bricks().value(cell), value, "{name} {voxel:?}");
        }
    }
}

/// Extinction at points.
struct At<'a>(&'a [Vec3]);

impl WithMedium for At<'_> {
    type Output = Vec<f32>;

    fn with<M: Medium + Sync>(self, medium: &M) -> Vec<f32> {
        self.0.iter().map(|point| medium.extinction(*point)[0]).collect()
    }
}

fn extinction(volume: &str, points: &[Vec3]) -> Result<Vec<f32>, String> {
    let target =
        std::env::temp_dir().join(format!("fogbow-test-vdb-{}-{:?}", std::process::id(), std::thread::current().id()));
    std::fs::create_dir_all(&target).unwrap();
    for name in ["several.vdb", "fp16.nvdb"] {
        std::fs::write(target.join(name), file(name)).unwrap();
    }
    let text = format!(
        "<scene version=\"3.0.0\"><integrator type=\"volpath\"/><sensor type=\"perspective\"><float name=\"fov\" value=\"36\"/>\
        <transform name=\"to_world\"><lookat origin=\"0, 0, 90\" target=\"0, 0, 0\" up=\"0, 1, 0\"/></transform>\
        <film type=\"hdrfilm\"><rfilter type=\"box\"/></film></sensor>\
        <shape type=\"cube\"><transform name=\"to_world\"><scale value=\"50\"/></transform><bsdf type=\"null\"/>\
        <medium name=\"interior\" type=\"heterogeneous\"><volume name=\"sigma_t\" type=\"gridvolume\">{volume}</volume>\
        <float name=\"scale\" value=\"2\"/><float name=\"albedo\" value=\"0.5\"/></medium></shape></scene>"
    );
    let read = || {
        let scene = SceneFile::parse(&target.join("scene.xml"), &text).map_err(|e| e.to_string())?;
        let mut storage = Storage::new(&scene);
        let world = World::new(&scene, &mut storage).map_err(|e| e.to_string())?;
        Ok(world.media().with(At(points)))
    };
    let result = read();
    std::fs::remove_dir_all(&target).unwrap();
    result
}

#[test]
fn scenes_place_volumes_by_themselves_or_as_the_file_says() {
    // The middle of the ball, and a voxel beside it.
    let grid = read("several.vdb", "again");
    let voxels = [[7, 8, 13], [9, 7, 12]];
    let points = voxels.map(|voxel| grid.to_world.point(voxel.map(f64::from)).map(|c| c as f32)).map(Vec3::from_array);
    let wanted = voxels.map(|voxel| 2.0 * grid.value(voxel));
    let file = "<string name=\"filename\" value=\"several.vdb\"/><string name=\"grid\" value=\"again\"/>";
    let got = extinction(&format!("{file}<boolean name=\"use_grid_bbox\" value=\"true\"/>"), &points).unwrap();
    for (got, wanted) in got.iter().zip(wanted) {
        assert!(wanted > 0.5 && (got - wanted).abs() < 1e-4, "{got} for {wanted}");
    }
    // By themselves, the active voxels fill the unit cube.
    let [low, high] = grid.active_box().unwrap();
    let unit = |voxel: [i32; 3]| {
        Vec3::from_array([0, 1, 2].map(|i| ((voxel[i] - low[i]) as f32 + 0.5) / (high[i] - low[i] + 1) as f32))
    };
    let got = extinction(file, &voxels.map(unit)).unwrap();
    for (got, wanted) in got.iter().zip(wanted) {
        assert!((got - wanted).abs() < 1e-4, "{got} for {wanted}");
    }
    // Half a voxel outside of the cube, half of a border voxel is left at most; a whole one outside, nothing.
    let cell = 1.0 / (high[0] - low[0] + 1) as f32;
    assert_eq!(extinction(file, &[Vec3::new(1.0 + 0.51 * cell, 0.5, 0.5)]).unwrap(), [0.0]);
}

#[test]
fn what_cannot_be_used_is_said() {
    let wrong = |volume: &str, words: &[&str]| {
        let error = extinction(volume, &[]).unwrap_err();
        assert!(words.iter().all(|word| error.contains(word)), "{error}");
    };
    wrong("<string name=\"filename\" value=\"none.vdb\"/>", &["scene.xml:1", "none.vdb", "cannot be read"]);
    let several = "<string name=\"filename\" value=\"several.vdb\"/>";
    wrong(
        &format!("{several}<string name=\"grid\" value=\"smoke\"/>"),
        &["several.vdb", "there is no grid \"smoke\"", "\"velocity\"", "\"odd\""],
    );
    wrong(&format!("{several}<string name=\"grid\" value=\"velocity\"/>"), &["grid \"velocity\"", "Tree_vec3s_5_4_3"]);
    wrong("<string name=\"filename\" value=\"fp16.nvdb\"/><string name=\"gird\" value=\"a\"/>", &["gird"]);
    let bytes = file("blosc.vdb");
    let broken =
        |bytes: Vec<u8>| Grid::from_bytes(Path::new("a.vdb"), bytes, None).map(|_| ()).unwrap_err().to_string();
    assert!(broken(bytes[..bytes.len() - 5].to_vec()).contains("a.vdb: "));
    assert!(broken(b"VDB ???? and more".to_vec()).contains("neither OpenVDB nor NanoVDB"));
    let old: Vec<u8> = bytes.iter().enumerate().map(|(i, b)| if i == 8 { 221 } else { *b }).collect();
    assert!(broken(old).contains("version 221 is too old"));
    let mut negative = read("none.vdb", "density");
    negative.background = 3.0;
    let reason = negative.into_bricks(Path::new("a.vdb")).unwrap_err().to_string();
    assert_eq!(reason, "a.vdb: grid \"density\": its background is 3: densities must be 0 where there is nothing");
}
