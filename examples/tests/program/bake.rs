//! Bakes: files that engines read, threads, interruptions, bad input.

use fogbow::bake::{BakeMemory, ProbeGrid, ProbeState, bytes};
use fogbow::math::Vec3;
use fogbow::math::float::PI;
use fogbow_examples::bake::ktx2;
use fogbow_examples::bake::texture::{Texel, Texture};
use fogbow_std::image;
use serde_json::Value;

use super::{Folder, SCENE, said};
use crate::shaders::{check, schema};

/// Quick, and not good.
const QUICK: [&str; 4] = ["--passes", "2", "--counts", "6x5x3"];

fn bake(folder: &Folder, options: &[&str]) {
    let output = folder.run(&[&["bake", SCENE, "-q"], options].concat());
    assert_eq!(output.status.code(), Some(0), "{options:?}: {}", said(&output));
    assert!(output.stderr.is_empty(), "{}", said(&output));
}

fn file(folder: &Folder, name: &str) -> Vec<u8> {
    std::fs::read(folder.0.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn grid(folder: &Folder, name: &str) -> ProbeGrid<'static> {
    let file = file(folder, name);
    bytes::read(&file, bytes::tag(&file).unwrap(), BakeMemory::default()).unwrap()
}

/// A description, which is what the schema says.
fn json(folder: &Folder, name: &str) -> Value {
    let value = serde_json::from_slice(&file(folder, name)).unwrap();
    check(&schema(), &value, name);
    value
}

fn texture(folder: &Folder, name: &str) -> (Texture, Texel) {
    ktx2::decode(&file(folder, name)).unwrap()
}

#[test]
fn every_format_has_the_same_numbers() {
    let folder = Folder::new("bake-formats");
    let outputs = ["-o", "a.bake", "-o", "a.json", "-o", "a.exr", "-o", "a.ktx2"];
    bake(&folder, &[&QUICK[..], &["--basis", "sh1", "--box", "-1,-0.9,-1 0.9,1,1"], &outputs].concat());
    let kept = grid(&folder, "a.bake");
    let mut dilated = grid(&folder, "a.bake");
    let reached = dilated.dilate();
    assert!(reached > 0, "some probes are in the mirror ball");

    // Plain numbers, where their description says.
    let about = json(&folder, "a.json");
    assert_eq!(about["counts"], serde_json::json!([6, 5, 3]));
    assert_eq!((&about["basis"], &about["quantity"]), (&"sh1".into(), &"in-scattered".into()));
    assert_eq!((&about["unit"], &about["orders"]), (&"W/(m^2 sr)".into(), &"all".into()));
    assert_eq!(about["box"]["min"][1].as_f64().unwrap() as f32, -0.9);
    assert_eq!((about["mean_cosine"].as_f64().unwrap() as f32, &about["deviation"]), (0.6, &Value::Null));
    assert_eq!(about["in_wall"].as_u64().unwrap() as usize, reached);
    let data = file(&folder, about["data"].as_str().unwrap());
    let arrays = about["arrays"].as_array().unwrap();
    let of = |name: &str| {
        let array = arrays.iter().find(|array| array["name"] == name).unwrap_or_else(|| panic!("{name}"));
        let number = |key: &str| array[key].as_u64().unwrap() as usize;
        (&data[number("offset")..][..number("bytes")], number("components"))
    };
    let floats = |name: &str| {
        let (bytes, components) = of(name);
        let all: Vec<f32> = bytes.as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
        all.chunks(components).map(<[f32]>::to_vec).collect::<Vec<_>>()
    };
    let end = arrays.iter().map(|array| array["offset"].as_u64().unwrap() + array["bytes"].as_u64().unwrap()).max();
    assert_eq!(end, Some(data.len() as u64));
    for number in 0..4 {
        let (values, errors) = (floats(&format!("sh{number}")), floats(&format!("error of sh{number}")));
        for index in 0..90 {
            assert_eq!(values[index], dilated.held(index)[number].0);
            assert_eq!(errors[index], [kept.error(index, number)]);
        }
    }
    let (extinction, (states, _)) = (floats("extinction"), of("state"));
    for (index, probe) in kept.probes().iter().enumerate() {
        assert_eq!(extinction[index], probe.extinction.0);
        assert_eq!(states[index] == 1, probe.state() == ProbeState::Valid);
    }

    // Slices side by side: three of them make two rows of two.
    let sheet = image::read(folder.0.join("a.exr")).unwrap();
    assert_eq!((sheet.width, sheet.height), (12, 10));
    for index in 0..90 {
        let [x, y, z] = [index % 6, index / 6 % 5, index / 30];
        let pixel = (x + 6 * (z % 2)) + 12 * (y + 5 * (z / 2));
        assert_eq!(sheet.pixels[pixel], dilated.held(index)[0]);
    }

    // Textures of half floats, with validity in alpha.
    for number in 0..4 {
        let (texture, texel) = texture(&folder, &format!("a-sh{number}.ktx2"));
        assert_eq!((texture.size, texel), ([6, 5, 3], Texel::Rgba16F));
        for (index, texel) in texture.texels.iter().enumerate() {
            let halves = dilated.held(index)[number].0.map(|value| half::f16::from_f32(value).to_f32());
            assert_eq!(texel[..3], halves);
            assert_eq!(texel[3] == 1.0, kept.probes()[index].state() == ProbeState::Valid);
        }
    }
    let (medium, _) = texture(&folder, "a-medium.ktx2");
    assert!((medium.texels[40][3] / kept.probes()[40].extinction.mean() - 1.0).abs() < 1e-3);

    for number in 0..2 {
        // Whatever the texels of light, planes have any sign; the core rounds them to half floats.
        let (walls, texel) = texture(&folder, &format!("a-wall{number}.ktx2"));
        assert_eq!(texel, Texel::Rgba16F);
        for (texel, probe) in walls.texels.iter().zip(kept.probes()) {
            assert_eq!(texel[..3], probe.planes()[number].to_array());
        }
        assert!(number == 1 || walls.texels.iter().any(|texel| texel[0] != 0.0));
    }

    // From one into others, the same bytes; scaled, others.
    let output = folder.run(&["bake", "--from-file", "a.bake", "-o", "b.json", "-o", "b.exr", "-o", "b.bake"]);
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    assert!(said(&output).contains("6 x 5 x 3 probes:"), "{}", said(&output));
    assert!(file(&folder, "b.bin") == data && file(&folder, "b.bake") == file(&folder, "a.bake"));
    assert!(file(&folder, "b.exr") == file(&folder, "a.exr"));
    let output = folder.run(&["bake", "--from-file", "a.bake", "-o", "c.json", "-q", "--scale", "0.5"]);
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    assert_eq!(json(&folder, "c.json")["scale"], 0.5);
    let first = |data: &[u8]| f32::from_le_bytes(*data.first_chunk().unwrap());
    assert_eq!(first(&file(&folder, "c.bin")), 0.5 * first(&data));
    // Nothing else is left.
    assert!(folder.names().iter().all(|name| !name.ends_with(".new")), "{:?}", folder.names());
}

/// What hardware makes of a texture at `uvw`, each in [0, 1].
fn sampled(texture: &Texture, uvw: Vec3) -> [f32; 4] {
    let size = texture.size.map(|n| n as i32);
    let at: [f32; 3] = core::array::from_fn(|i| uvw[i] * size[i] as f32 - 0.5);
    let mut sum = [0.0; 4];
    for corner in 0..8 {
        let (mut weight, mut texel) = (1.0, [0; 3]);
        for axis in 0..3 {
            let (low, bit) = (at[axis].floor(), corner >> axis & 1);
            weight *= if bit == 1 { at[axis] - low } else { 1.0 - (at[axis] - low) };
            texel[axis] = (low as i32 + bit).clamp(0, size[axis] - 1);
        }
        let [x, y, z] = texel;
        let found = texture.texels[(x + size[0] * (y + size[1] * z)) as usize];
        sum.iter_mut().zip(found).for_each(|(sum, value)| *sum += weight * value);
    }
    sum
}

/// Points and unit normals in a box.
fn asked(grid: &ProbeGrid<'_>) -> impl Iterator<Item = (Vec3, Vec3)> + use<> {
    let bounds = grid.lattice().bounds();
    (0..200).map(move |i| {
        let part = |k: u32| (i as f32 * [0.7548, 0.5698, 0.4301, 0.3247, 0.8192][k as usize]).fract();
        let point = bounds.min + bounds.size() * Vec3::new(part(0), part(1), part(2));
        let (z, angle) = (2.0 * part(3) - 1.0, 2.0 * PI * part(4));
        let across = (1.0 - z * z).sqrt();
        (point, Vec3::new(across * angle.cos(), across * angle.sin(), z))
    })
}

/// Half floats, of a few numbers that add up.
const HALF: f32 = 3e-3;

/// As Bevy's shader reads it (irradiance_volume.wesl, November 2026).
#[test]
fn an_irradiance_volume_is_what_bevys_shader_samples() {
    let folder = Folder::new("bake-bevy");
    let options = ["--box", "0.1,-0.4,-0.6 0.9,0.9,0.6", "--layout", "bevy", "-o", "a.ktx2", "-o", "a.bake"];
    bake(&folder, &[&QUICK[..], &options].concat());
    let (kept, (texture, _)) = (grid(&folder, "a.bake"), texture(&folder, "a.ktx2"));
    assert_eq!(texture.size, [6, 10, 9]);
    assert_eq!(json(&folder, "a.ktx2.json")["orders"], "indirect");
    assert!(kept.probes().iter().all(|probe| probe.state() == ProbeState::Valid));
    let atlas = Vec3::new(6.0, 10.0, 9.0);
    let resolution = Vec3::new(6.0, 5.0, 3.0);
    for (point, normal) in asked(&kept) {
        // The volume fills a cube around the origin.
        let unit = (point - kept.lattice().bounds().centre()) / kept.lattice().bounds().size();
        let stp = ((unit + 0.5) * resolution).clamp(Vec3::splat(0.5), resolution - 0.5);
        let uvw = stp / atlas;
        let lower = |axis: usize| if normal[axis] < 0.0 { 0.5 } else { 0.0 };
        let mut light = 0.0;
        for axis in 0..3 {
            let rgb = sampled(&texture, uvw + Vec3::new(0.0, lower(axis), axis as f32 / 3.0));
            light += rgb[1] * normal[axis] * normal[axis];
        }
        let due = kept.value(point, normal)[1] / PI;
        assert!((light - due).abs() < HALF * due, "{point} {normal}: {light} instead of {due}");
    }
}

/// As three.js reads it (LightProbeGridNode.js, November 2026).
#[test]
fn an_atlas_is_what_three_js_samples() {
    let folder = Folder::new("bake-three");
    let options = ["--box", "0.1,-0.4,-0.6 0.9,0.9,0.6", "--layout", "three", "-o", "a.ktx2", "-o", "a.bake"];
    bake(&folder, &[&QUICK[..], &options].concat());
    let (kept, (texture, _)) = (grid(&folder, "a.bake"), texture(&folder, "a.ktx2"));
    assert_eq!(texture.size, [6, 5, 7 * 5]);
    let about = json(&folder, "a.ktx2.json");
    let corner = |name: &str| Vec3::from_array(core::array::from_fn(|i| about[name][i].as_f64().unwrap() as f32));
    let (min, max, resolution) = (corner("first_probe"), corner("last_probe"), Vec3::new(6.0, 5.0, 3.0));
    for (point, normal) in asked(&kept) {
        let inside = ((point - min) / (max - min)).clamp(Vec3::ZERO, Vec3::ONE);
        let uvw = (inside * (resolution - 1.0) + 0.5) / resolution;
        let slices = 3.0 + 2.0;
        let volume =
            |t: f32| sampled(&texture, Vec3::new(uvw.x, uvw.y, (uvw.z * 3.0 + 1.0 + slices * t) / (7.0 * slices)));
        let floats: Vec<f32> = (0..7).flat_map(|t| volume(t as f32)).collect();
        let green = |k: usize| floats[3 * k + 1];
        let Vec3 { x, y, z } = normal;
        let light = 0.886227 * green(0)
            + 2.0 * 0.511664 * (green(1) * y + green(2) * z + green(3) * x)
            + 2.0 * 0.429043 * (green(4) * x * y + green(5) * y * z + green(7) * x * z)
            + green(6) * (0.743125 * z * z - 0.247708)
            + green(8) * 0.429043 * (x * x - y * y);
        let (due, mean) = (kept.value(point, normal)[1], 0.886227 * green(0));
        assert!((light.max(0.0) - due).abs() < HALF * mean, "{point} {normal}: {light} instead of {due}");
    }
}

/// What fog.wgsl makes of the textures of a bake with finer levels, line by line.
struct Shader {
    textures: Vec<(String, Texture)>,
    min: Vec3,
    size: Vec3,
    counts: [u32; 3],
    levels: u32,
}

impl Shader {
    fn load(&self, name: &str, at: [u32; 3]) -> [f32; 4] {
        let (_, texture) = self.textures.iter().find(|(other, _)| other == name).unwrap();
        let [nx, ny, nz] = texture.size;
        assert!(at[0] < nx && at[1] < ny && at[2] < nz, "{name} {at:?} of {:?}", texture.size);
        texture.texels[(at[0] + nx * (at[1] + ny * at[2])) as usize]
    }

    fn in_scattered(&self, point: Vec3, d: Vec3) -> Vec3 {
        let (mut light, mut hidden, mut valid, mut rest) = (Vec3::ZERO, Vec3::ZERO, 0.0, 1.0);
        for level in (0..=self.levels).rev() {
            let counts = Vec3::from_array(self.counts.map(|n| (n << level) as f32));
            let at = ((point - self.min) / self.size * counts - 0.5).clamp(Vec3::ZERO, counts - 1.0);
            let low = at.floor().min((counts - 2.0).max(Vec3::ZERO));
            let (high, share) = ((low + 1.0).min(counts - 1.0), at - low);
            let layer: u32 = (1..level).map(|other| (self.counts[2] << other).div_ceil(4)).sum();
            let (mut part, mut inner) = (0.0, 0);
            let corners: Vec<_> = (0..8)
                .map(|corner| {
                    let bit = [corner & 1, corner >> 1 & 1, corner >> 2];
                    let cell = [0, 1, 2].map(|i| if bit[i] == 1 { high[i] } else { low[i] } as u32);
                    let weight = (0..3).map(|i| if bit[i] == 1 { share[i] } else { 1.0 - share[i] }).product::<f32>();
                    let offset = Vec3::from_array([0, 1, 2].map(|i| share[i] - bit[i] as f32));
                    if level == 0 {
                        return (cell, weight, offset);
                    }
                    let brick = self.load("index", [cell[0] / 4, cell[1] / 4, cell[2] / 4 + layer]);
                    let texel = [0, 1, 2].map(|i| brick[i] as u32 + cell[i] % 4);
                    if brick[3] * self.load("wall0", texel)[3] > 0.0 {
                        part += weight;
                        inner += 1;
                    }
                    (texel, weight, offset)
                })
                .collect();
            let part = if level == 0 || inner == 8 { 1.0 } else { f32::min(part, 1.0) };
            for (texel, weight, offset) in corners.into_iter().filter(|_| part > 0.0) {
                let weight = rest * part * weight;
                let of = |name: &str| Vec3::from_slice(&self.load(name, texel)[..3]);
                let seen =
                    0.282_094_8 * of("sh0") + 0.488_602_5 * (d.y * of("sh1") + d.z * of("sh2") + d.x * of("sh3"));
                let s = offset.dot(of("wall0")).max(offset.dot(of("wall1")));
                let sees = ((1.0 - s) * 10.0).clamp(0.0, 1.0) + 1e-6 / s.max(1.0).powi(8);
                let one = weight * self.load("sh0", texel)[3] * sees;
                light += one * seen;
                hidden += weight * seen;
                valid += one;
            }
            rest *= 1.0 - part;
            if !(rest > 0.0) {
                break;
            }
        }
        if valid > 0.0 { light / valid } else { hidden }.max(Vec3::ZERO)
    }
}

#[test]
fn finer_levels_are_found_by_shaders_and_gone_on_with() {
    let folder = Folder::new("bake-levels");
    let options = ["--counts", "9x7x6", "--basis", "sh1", "--passes", "4", "--error", "0.05", "--refine", "0.3"];
    let outputs = ["-o", "a.bake", "-o", "a.json", "-o", "a.ktx2", "--threads", "2"];
    bake(&folder, &[&options[..], &outputs].concat());
    let kept = file(&folder, "a.bake");
    let mut levels = bytes::read_levels(&kept, bytes::tag(&kept).unwrap(), |_| BakeMemory::default()).unwrap();
    assert_eq!(levels.levels().len(), 3);
    levels.dilate();

    // Plain numbers of each level.
    let about = json(&folder, "a.json");
    let data = file(&folder, "a.bin");
    let arrays = about["arrays"].as_array().unwrap();
    for (number, grid) in levels.levels().iter().enumerate().skip(1) {
        let told = &about["levels"][number - 1];
        let bricks: Vec<u32> =
            told["bricks"].as_array().unwrap().iter().map(|brick| brick.as_u64().unwrap() as u32).collect();
        assert_eq!((&bricks[..], told["counts"][0].as_u64()), (grid.places(), Some(9 << number)));
        let name = format!("level {number}: sh2");
        let array = arrays.iter().find(|array| array["name"] == name.as_str()).unwrap();
        let [offset, length] = ["offset", "bytes"].map(|key| array[key].as_u64().unwrap() as usize);
        let floats = data[offset..][..length].as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes));
        assert!(floats.eq((0..grid.probes().len()).flat_map(|index| grid.held(index)[2].0)));
    }

    // Textures, as the shader reads them.
    let names = ["sh0", "sh1", "sh2", "sh3", "wall0", "wall1", "index"];
    let textures = names.map(|name| (name.to_owned(), texture(&folder, &format!("a-{name}.ktx2")).0)).to_vec();
    let bounds = levels.finest().lattice().bounds();
    let shader = Shader { textures, min: bounds.min, size: bounds.size(), counts: [9, 7, 6], levels: 2 };
    let level = levels.levels()[0].level() as f32;
    let (mut lit, mut off) = (0, 0);
    for i in 0..4000 {
        let unit = Vec3::from(fogbow::sampling::even3(i));
        let (point, d) = (bounds.min + bounds.size() * unit, (unit - 0.4).normalize());
        let (found, due) = (shader.in_scattered(point, d), levels.value(point, d));
        // Half floats; beside walls, rounding decides which probes see a point.
        off += u32::from((found.x - due[0]).abs() > HALF * (due[0] + level));
        lit += u32::from(due[0] > 0.1 * level);
    }
    assert!(lit > 1000 && off <= 8, "{off} of 4000 points are off, {lit} are lit");

    // From the grid alone, to the same bytes; and with fewer levels, which would be lost.
    bake(&folder, &[&options[..6], &["--error", "0.05", "-o", "b.bake", "--threads", "1"]].concat());
    let output = folder.run(&["bake", "--from-file", "a.bake", "-o", "c.json", "-o", "c.bake", "-q"]);
    assert!(output.status.success() && file(&folder, "c.bin") == data && file(&folder, "c.bake") == kept);
    bake(&folder, &[&options[..], &["-o", "b.bake", "--resume", "--threads", "3"]].concat());
    assert!(file(&folder, "b.bake") == kept);
    let again = ["bake", SCENE, "-q", "--counts", "9x7x6", "--basis", "sh1", "--resume", "-o", "b.bake"];
    let output = folder.run(&again);
    assert!(said(&output).contains("has 2 finer levels, which would be lost"), "{}", said(&output));
    assert!(file(&folder, "b.bake") == kept);
    // Spacings that no grid has are told before anything is baked.
    let output = folder.run(&["bake", SCENE, "-q", "--counts", "600x4x4", "--refine", "0.1", "-o", "e.bake"]);
    assert!(
        output.status.code() == Some(2) && said(&output).contains("more than 1024 along a side"),
        "{}",
        said(&output)
    );
    // What has no place for them says so, and writes nothing.
    for (name, more) in [("d.exr", &[][..]), ("d.ktx2", &["--layout", "bevy"])] {
        let output = folder.run(&[&["bake", "--from-file", "a.bake", "-q", "-o", name], more].concat());
        assert!(output.status.code() == Some(2) && said(&output).contains("half the spacing"), "{}", said(&output));
        assert!(!folder.names().iter().any(|other| other == name));
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let folder = Folder::new("bake-threads");
    for method in ["path", "radiance-cache"] {
        let mut first = None;
        for threads in ["1", "2", "7"] {
            let options =
                ["--counts", "9x5x6", "--error", "0.1", "--passes", "12", "--basis", "ambient-cube", "-o", "a.bake"];
            bake(&folder, &[&options[..], &["--method", method, "--threads", threads]].concat());
            let found = file(&folder, "a.bake");
            assert!(*first.get_or_insert_with(|| found.clone()) == found, "{method}, {threads} threads");
        }
    }
}

/// What was left goes on as if it had not been.
#[cfg(unix)]
#[test]
fn an_interrupted_bake_is_gone_on_with() {
    let folder = Folder::new("bake-stop");
    let options = ["bake", SCENE, "--counts", "9x8x8", "--error", "0.005", "-o", "a.bake", "-o", "a.json"];
    let child = folder.fogbow().args(options).stderr(std::process::Stdio::piped()).spawn().unwrap();
    // Until it is under way, however slow the machine.
    std::thread::sleep(std::time::Duration::from_secs(3));
    let stop = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(stop.success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    assert_eq!(folder.names(), ["a.bake"], "textures of half a bake would look whole");
    let left = grid(&folder, "a.bake");
    let most = (0..left.lattice().cell_count()).map(|index| left.passes(index)).max().unwrap();
    assert!(most > 0);
    let passes = (most + 2).to_string();
    let again = |more: &[&str], name: &str| {
        let common = ["--counts", "9x8x8", "--error", "0.005", "--passes", &passes, "-o", name];
        bake(&folder, &[&common[..], more].concat());
    };
    again(&["--resume"], "a.bake");
    again(&[], "b.bake");
    assert!(file(&folder, "a.bake") == file(&folder, "b.bake"));
}

/// Fog in a box that two lamps light, of different colours.
const TWO: &str = r#"<scene version="3.0.0"><integrator type="volpath"><integer name="max_depth" value="-1"/></integrator>
    <medium type="homogeneous" id="fog"><float name="sigma_t" value="0.8"/><rgb name="albedo" value="0.9 0.8 0.7"/><phase type="isotropic"/></medium>
    <shape type="cube"><bsdf type="null"/><ref name="interior" id="fog"/></shape>
    <shape type="rectangle"><transform name="to_world"><scale value="0.4"/><rotate x="1" angle="90"/><translate y="1.6"/></transform>
    <bsdf type="diffuse"><rgb name="reflectance" value="0.5 0.5 0.5"/></bsdf><emitter type="area"><rgb name="radiance" value="9 8 7"/></emitter></shape>
    <emitter type="point"><point name="position" x="0" y="-2" z="0.5"/><rgb name="intensity" value="1 3 6"/></emitter>
    <sensor type="perspective"><float name="fov" value="36"/><string name="fov_axis" value="x"/>
    <transform name="to_world"><lookat origin="0, 0, 4" target="0, 0, 0" up="0, 1, 0"/></transform>
    <film type="hdrfilm"><rfilter type="box"/></film></sensor></scene>"#;

#[test]
fn photons_are_gone_on_with_and_say_what_they_are() {
    let folder = Folder::new("bake-photons");
    let options = ["--method", "photons", "--counts", "6x5x3", "--error", "0.03"];
    bake(&folder, &[&options[..], &["--threads", "1", "-o", "a.bake", "-o", "a.json"]].concat());
    let about = json(&folder, "a.json");
    assert_eq!(about["method"], "photons");
    assert!(about["relative_error"].as_f64().unwrap() <= 0.03);
    bake(&folder, &[&options[..], &["--threads", "3", "-o", "b.bake"]].concat());
    assert!(file(&folder, "a.bake") == file(&folder, "b.bake"));
    // What is done is not done again.
    bake(&folder, &[&options[..], &["--resume", "-o", "b.bake"]].concat());
    assert!(file(&folder, "a.bake") == file(&folder, "b.bake"));
    // What another method has begun is not gone on with.
    let output = folder.run(&["bake", SCENE, "-q", "--counts", "6x5x3", "--resume", "-o", "a.bake"]);
    assert!(output.status.code() == Some(2) && said(&output).contains("another --method"), "{}", said(&output));
}

/// An animation of three frames, the first two alike.
#[test]
fn frames_keep_what_has_not_changed_since_the_one_before() {
    let folder = Folder::new("bake-frames");
    let plume = folder.run(&["plume", "--frames", "2", "--resolution", "8", "-o", ".", "-q"]);
    assert_eq!(plume.status.code(), Some(0), "{}", said(&plume));
    std::fs::copy(folder.0.join("plume-00.xml"), folder.0.join("still.xml")).unwrap();
    let asked = ["--counts", "8x8x8", "--error", "0.1", "--basis", "sh1"];
    for method in ["path", "photons"] {
        let run = |more: &[&str]| folder.run(&[&["bake", "--method", method], &asked[..], more].concat());
        let all = run(&["plume-00.xml", "still.xml", "plume-01.xml", "-o", "fog.bake", "-o", "fog.json"]);
        assert_eq!(all.status.code(), Some(0), "{}", said(&all));
        let kept = |number: usize| {
            let lines = said(&all);
            let line = lines.lines().filter(|line| line.ends_with("are those of the frame before")).nth(number);
            line.and_then(|line| line.split_whitespace().next()?.parse::<u32>().ok()).unwrap()
        };
        // Of still bricks 7 in a hundred are baked anew by chance, by photons 3: for none of 20 seeds more than two of eight.
        assert!(kept(0) >= 6 && kept(1) <= 8, "of 8 bricks {} and {}", kept(0), kept(1));
        let [first, still, moved] =
            ["plume-00", "still", "plume-01"].map(|name| grid(&folder, &format!("fog-{name}.bake")));
        let same = |other: &ProbeGrid<'_>| (0..512).filter(|probe| first.held(*probe) == other.held(*probe)).count();
        assert!(same(&still) >= 64 * kept(0) as usize && same(&moved) <= 64 * kept(1) as usize);
        let medium = |grid: &ProbeGrid<'_>| grid.probes().iter().map(|probe| probe.extinction[0]).collect::<Vec<_>>();
        assert!(medium(&first) == medium(&still) && medium(&first) != medium(&moved), "what a shader marches through");
        json(&folder, "fog-plume-01.json");

        // Frame by frame it is the same, and what is done is not done again.
        let one = run(&["plume-01.xml", "--after", "fog-still.bake", "-o", "one.bake"]);
        assert_eq!(one.status.code(), Some(0), "{}", said(&one));
        let due = file(&folder, "fog-plume-01.bake");
        assert!(file(&folder, "one.bake") == due);
        for more in [
            &["plume-01.xml", "--after", "fog-still.bake", "-o", "one.bake", "--resume"][..],
            &["plume-00.xml", "still.xml", "plume-01.xml", "-o", "fog.bake", "--resume"],
        ] {
            let again = run(more);
            assert_eq!(again.status.code(), Some(0), "{}", said(&again));
        }
        assert!(file(&folder, "one.bake") == due && file(&folder, "fog-plume-01.bake") == due);
        let other = run(&["plume-01.xml", "--after", "fog-plume-00.bake", "-o", "one.bake", "--resume"]);
        assert!(said(&other).contains("--error or --after"), "{}", said(&other));
    }
    for (arguments, reason) in [
        (
            &["plume-01.xml", "--after", "fog-still.bake", "--counts", "8x8x4"][..],
            "--after: the frame before has other probes",
        ),
        (&["plume-01.xml", "--after", "still.xml"], "--after still.xml: is no grid of probes"),
        (&["plume-01.xml", "--after", "nowhere.bake"], "nowhere.bake: cannot be read"),
        (&["plume-01.xml", "--after", "fog-still.bake", "--per-light"], "cannot be used with"),
        (&["plume-01.xml", "./plume-01.xml"], "two scenes are called plume-01"),
        (&["plume-01.xml", "still.xml", "--per-light"], "--per-light is for one scene"),
        (&["plume-01.xml", "gone.xml"], "gone.xml: cannot be read"),
    ] {
        let output =
            folder.run(&[&["bake", "-o", "no.bake", "--passes", "2", "--basis", "fluence"], arguments].concat());
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {}", said(&output));
        assert!(said(&output).contains(reason), "{arguments:?}: {}", said(&output));
    }
    // Nor are those made that come before one which is not there.
    assert!(!folder.0.join("no-plume-01.bake").exists());
}

/// Killed without a word, at any time: what is there is a whole file, and is gone on with to the same bytes.
#[test]
fn a_killed_bake_is_gone_on_with() {
    let folder = Folder::new("bake-killed");
    let options = ["bake", SCENE, "-q", "--counts", "8x8x4", "--passes", "60", "--error", "0.001", "--seed", "3"];
    let whole = folder.run(&[&options[..], &["-o", "whole.bake"]].concat());
    assert_eq!(whole.status.code(), Some(0), "{}", said(&whole));
    let resumed = [&options[..], &["--resume", "--checkpoint-every", "0.02", "-o", "killed.bake"]].concat();
    for kill in 0..3 {
        let mut child = folder.fogbow().args(&resumed).spawn().unwrap();
        let wait = |millis| std::thread::sleep(std::time::Duration::from_millis(millis));
        for _ in 0..1000 {
            if folder.0.join("killed.bake").exists() || child.try_wait().unwrap().is_some() {
                break;
            }
            wait(10);
        }
        wait(40 * kill);
        child.kill().unwrap();
        child.wait().unwrap();
        let passes = grid(&folder, "killed.bake").passes(0);
        assert!(passes > 0 && passes <= 60);
    }
    assert_eq!(folder.run(&resumed).status.code(), Some(0));
    assert!(file(&folder, "killed.bake") == file(&folder, "whole.bake"));
}

#[test]
fn layers_of_single_lights_add_up() {
    let folder = Folder::new("bake-lights");
    std::fs::write(folder.0.join("two.xml"), TWO).unwrap();
    let run = |more: &[&str]| {
        let common = ["bake", "two.xml", "-q", "--counts", "3x3x3", "--basis", "fluence", "-o", "a.bake"];
        let output = folder.run(&[&common[..], more].concat());
        assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    };
    run(&["--error", "0.03"]);
    run(&["--error", "0.03", "--per-light"]);
    assert_eq!(folder.names(), ["a-light0.bake", "a-light1.bake", "a.bake", "two.xml"]);
    let [all, first, second] = ["a.bake", "a-light0.bake", "a-light1.bake"].map(|name| grid(&folder, name));
    for index in 0..27 {
        let error: f32 = [&all, &first, &second].map(|grid| grid.error(index, 0).powi(2)).iter().sum();
        let [all, first, second] = [&all, &first, &second].map(|grid| grid.held(index)[0]);
        let off = (all - first - second).map(f32::abs).max_element();
        // Errors are means over channels, of which the brightest may have twice as much.
        assert!(off <= 10.0 * error.sqrt(), "{index}: {all:?}, {first:?} + {second:?}");
        assert!(first[2] < first[0] && second[2] > second[0], "each has its colour");
    }
    // One after the other, they may be gone on with.
    run(&["--per-light", "--resume", "--error", "0.02"]);
    assert!(grid(&folder, "a-light1.bake").error(0, 0) < second.error(0, 0));
}

#[test]
fn pictures_are_marched_from_bakes_of_their_scene() {
    let folder = Folder::new("bake-march");
    std::fs::write(folder.0.join("two.xml"), TWO).unwrap();
    let bake = |name: &str, more: &[&str]| {
        let common = ["bake", "two.xml", "-q", "--counts", "8x8x8", "--basis", "sh0", "--error", "0.03", "-o", name];
        let output = folder.run(&[&common[..], more].concat());
        assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    };
    let render = |scene: &str, more: &[&str]| {
        let common = ["render", scene, "--size", "24x24", "-q", "-o", "a.pfm"];
        folder.run(&[&common[..], more].concat())
    };
    let mean = |more: &[&str]| {
        let output = render("two.xml", more);
        assert_eq!(output.status.code(), Some(0), "{}", said(&output));
        let picture = image::read(folder.0.join("a.pfm")).unwrap();
        picture.pixels.iter().map(|pixel| pixel.mean()).sum::<f32>() / 576.0
    };
    let due = mean(&["--method", "path", "--spp", "400"]);
    for orders in ["all", "indirect"] {
        bake("a.bake", &["--orders", orders]);
        let found = mean(&["--method", "march", "--bake", "a.bake", "--spp", "16"]);
        // Errors of probes and of both pictures, with many of each.
        assert!((found / due - 1.0).abs() < 0.02, "{orders}: {found} instead of {due}");
    }
    bake("multiple.bake", &["--orders", "multiple"]);
    bake("half.bake", &["--box", "-1,-1,-1 0,1,1"]);
    bake("surfaces.bake", &["--quantity", "irradiance", "--passes", "2"]);
    bake("light.bake", &["--per-light", "--passes", "2"]);
    for (method, file, reason) in [
        ("march", "multiple.bake", "multiple.bake: lacks light that surfaces send into the medium"),
        ("march", "half.bake", "half.bake: its box does not hold all of the medium"),
        ("march", "surfaces.bake", "surfaces.bake: holds irradiance of surfaces"),
        ("march", "light-light0.bake", "light-light0.bake: was made for another scene"),
        ("march", "two.xml", "two.xml: is no grid of probes"),
        ("path", "a.bake", "--bake has no effect with --method path; it belongs to --method march"),
    ] {
        let output = render("two.xml", &["--method", method, "--bake", file]);
        assert_eq!(output.status.code(), Some(2), "{file}");
        assert!(said(&output).contains(reason), "{file}: {}", said(&output));
    }
    let output = render(SCENE, &["--method", "march", "--bake", "a.bake"]);
    assert!(said(&output).contains("a.bake: was made for another scene"), "{}", said(&output));
}

/// A floor and a lamp in clear air.
const BARE: &str = r#"<scene version="3.0.0"><integrator type="volpath"/><shape type="rectangle"><bsdf type="diffuse"/></shape>
    <emitter type="point"><point name="position" x="0" y="1" z="0"/><rgb name="intensity" value="1 1 1"/></emitter>
    <sensor type="perspective"><float name="fov" value="36"/><string name="fov_axis" value="x"/>
    <film type="hdrfilm"><rfilter type="box"/></film></sensor></scene>"#;

#[test]
fn what_cannot_be_baked_is_told_by_name() {
    let folder = Folder::new("bake-wrong");
    bake(&folder, &[&QUICK[..], &["-o", "a.bake"]].concat());
    let kept = file(&folder, "a.bake");
    std::fs::write(folder.0.join("cut.bake"), &kept[..999]).unwrap();
    std::fs::write(folder.0.join("bare.xml"), BARE).unwrap();
    for (arguments, reason) in [
        (&[SCENE, "--counts", "0x2x2", "-o", "b.json"][..], "there must be a probe along every side"),
        (&[SCENE, "--counts", "1000x1000x1000", "-o", "b.json"], "at most 16777216 probes"),
        (&[SCENE, "--counts", "2x2", "-o", "b.json"], "must look like 32x16x32"),
        (&[SCENE, "--spacing", "0.0001", "-o", "b.json"], "--spacing: 0.0001 makes 20"),
        (&[SCENE, "--spacing", "0", "-o", "b.json"], "must be a number greater than 0"),
        (&[SCENE, "--spacing", "1", "--counts", "2x2x2", "-o", "b.json"], "cannot be used with"),
        (&[SCENE, "--box", "1,0,0 0,1,1", "-o", "b.json"], "no extent along x: 1 is not less than 0"),
        (&[SCENE, "--box", "0,0,0 1,1", "-o", "b.json"], "the smaller corner, a space, the larger corner"),
        (&[SCENE, "--box", "5,5,5 6,6,6", "-o", "b.json"], "--box: no medium is in it; they reach from"),
        (&[SCENE, "--error", "0", "-o", "b.json"], "must be a number from"),
        (&[SCENE, "--basis", "sh4", "-o", "b.json"], "possible values: sh0"),
        (&[SCENE, "-o", "b.png"], "b.png: the extension is none of bake, json, ktx2, exr"),
        (&[SCENE, "-o", "nowhere/b.json"], "nowhere/b.json: cannot be written"),
        (&[SCENE], "--output <FILE>"),
        (&["-o", "b.json"], "<SCENE>"),
        (&[SCENE, "-o", "b.json", "--resume"], "none is to be written"),
        (&[SCENE, "-o", "a.bake", "-o", "b.bake"], "there may be one .bake file"),
        (
            &[SCENE, "-o", "a.bake", "--resume", "--counts", "6x5x3", "--seed", "7"],
            "a.bake: was made for another scene",
        ),
        (&[SCENE, "-o", "a.bake", "--resume", "--counts", "6x5x4"], "of another --box, --counts, --basis"),
        (&[SCENE, "-o", "cut.bake", "--resume"], "cut.bake: is cut off"),
        (&["--from-file", "cut.bake", "-o", "b.json"], "cut.bake: is cut off"),
        (
            &[SCENE, "-o", "b.json", "--method", "radiance-cache", "--quantity", "irradiance"],
            "know nothing of irradiance",
        ),
        (&["bare.xml", "-o", "b.json", "--per-light"], "bare.xml: has no medium to bake light for"),
        (&["--from-file", "a.bake", "-o", "b.json", "--per-light"], "cannot be used with"),
        (&["--from-file", "missing.bake", "-o", "b.json"], "missing.bake: cannot be read"),
        (&["--from-file", "a.bake", "-o", "b.ktx2", "--layout", "bevy"], "takes an ambient cube of irradiance"),
        (&["--from-file", "a.bake", "-o", "b.ktx2", "--texel", "rgb9e5"], "take rgba16f"),
        (&["--from-file", "a.bake", "-o", "b.ktx2", "--scale", "1e9"], "more than texels hold"),
        (&["--from-file", "a.bake", SCENE, "-o", "b.json"], "cannot be used with"),
        (&["bare.xml", "-o", "b.json"], "bare.xml: has no medium to bake light for"),
    ] {
        let output = folder.run(&[&["bake"], arguments].concat());
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(said(&output).contains(reason), "{arguments:?}: {}", said(&output));
        assert!(!said(&output).contains("panicked"), "{}", said(&output));
    }
    // Nothing is lost, and nothing is begun.
    assert!(file(&folder, "a.bake") == kept);
    assert_eq!(folder.names(), ["a.bake", "bare.xml", "cut.bake"]);
}
