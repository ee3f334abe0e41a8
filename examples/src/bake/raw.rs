//! Plain little-endian numbers, and the JSON file beside them that says what they are.

use core::fmt::Write as _;

use fogbow::bake::{Probe, ProbeGrid, ProbeState};
use fogbow::math::Vec3;

use super::Baked;
use super::texture::WALLS;

/// Version of the description.
pub const VERSION: u32 = 2;

/// A plain array of numbers of each probe.
struct Array {
    name: String,
    kind: &'static str,
    components: u32,
    bytes: Vec<u8>,
}

/// The bytes of all arrays: `f32` but for the states of probes, which are `u8`; probes along x first, then y, then z, in the box and in each brick of finer levels.
#[must_use]
pub fn data(baked: &Baked) -> Vec<u8> {
    arrays(baked).into_iter().flat_map(|array| array.bytes).collect()
}

fn arrays(baked: &Baked) -> Vec<Array> {
    let levels = baked.levels.levels().iter().enumerate();
    levels.flat_map(|(number, grid)| arrays_of(baked.scale, number, grid)).collect()
}

/// The arrays of a level; those of finer ones have its number before their names, and 64 probes for each brick.
fn arrays_of(scale: f32, level: usize, grid: &ProbeGrid<'_>) -> Vec<Array> {
    let named = |name: &str| if level == 0 { name.to_owned() } else { format!("level {level}: {name}") };
    let floats = |name: &str, components: u32, of: &dyn Fn(usize) -> Vec<f32>| {
        let bytes = (0..grid.probes().len()).flat_map(of).flat_map(f32::to_le_bytes).collect();
        Array { name: named(name), kind: "f32", components, bytes }
    };
    let mut all = Vec::new();
    for (number, name) in Baked::names(grid.basis()).iter().enumerate() {
        all.push(floats(name, 3, &|index| (grid.held(index)[number] * scale).0.to_vec()));
    }
    for (number, name) in Baked::names(grid.basis()).iter().enumerate() {
        // Beyond the border of the box nothing is known.
        let error = |index| if grid.cell_of(index).is_some() { grid.error(index, number) * scale } else { 0.0 };
        all.push(floats(&format!("error of {name}"), 1, &|index| vec![error(index)]));
    }
    all.push(floats("coarseness", 1, &|index| vec![grid.coarseness(index) * scale]));
    all.push(floats("extinction", 3, &|index| grid.probes()[index].extinction.0.to_vec()));
    all.push(floats("albedo", 3, &|index| grid.probes()[index].albedo.0.to_vec()));
    for (number, name) in WALLS.into_iter().enumerate() {
        all.push(floats(name, 3, &|index| grid.probes()[index].planes()[number].to_array().to_vec()));
    }
    let bytes = |name: &str, of: &dyn Fn(&Probe) -> u8| {
        let bytes = grid.probes().iter().map(of).collect();
        Array { name: named(name), kind: "u8", components: 1, bytes }
    };
    all.push(bytes("state", &|probe| match probe.state() {
        ProbeState::Valid => 1,
        ProbeState::InWall => 2,
        ProbeState::Empty => 3,
        ProbeState::Unknown => 0,
    }));
    if level > 0 {
        all.push(bytes("inner", &|probe| u8::from(probe.is_inner())));
    }
    all
}

/// What is in a bake, as JSON. `data_file` is where the numbers are: those of [`data`], or `None` for textures.
#[must_use]
pub fn description(baked: &Baked, data_file: Option<&str>) -> String {
    let grid = baked.grid();
    let lattice = grid.lattice();
    let (quantity, unit) = baked.quantity();
    let [valid, in_wall, empty] = baked.counts();
    let vector = |v: Vec3| format!("[{}, {}, {}]", v.x, v.y, v.z);
    let number = |value: Option<f32>| value.filter(|v| v.is_finite()).map_or("null".to_owned(), |v| v.to_string());
    let string = |text: &str| format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""));
    let [nx, ny, nz] = lattice.size();
    let mut text = "{\n".to_owned();
    let mut field = |name: &str, value: String| {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "  {}: {value},", string(name));
    };
    field("format", string("fogbow bake"));
    field("version", VERSION.to_string());
    field("quantity", string(quantity));
    field("unit", string(unit));
    field("basis", string(&baked.basis()));
    field("orders", string(baked.orders()));
    field("scale", number(Some(baked.scale)));
    field("mean_cosine", number(baked.mean_cosine));
    field("method", baked.method.map_or("null".to_owned(), string));
    field("relative_error", number(Some(grid.relative_error())));
    let [usual, worst] = baked.levels.relative_coarseness();
    field("relative_coarseness", format!("{{\"root_mean_square\": {usual}, \"greatest\": {worst}}}"));
    let deviation = baked.deviation.map(|d| {
        let [bias, error, spread] = [d.bias, d.bias_error, d.spread].map(|value| number(Some(value)));
        format!("{{\"bias\": {bias}, \"bias_error\": {error}, \"spread\": {spread}, \"probes\": {}}}", d.probes)
    });
    field("deviation", deviation.unwrap_or("null".to_owned()));
    field("box", format!("{{\"min\": {}, \"max\": {}}}", vector(lattice.bounds().min), vector(lattice.bounds().max)));
    field("counts", format!("[{nx}, {ny}, {nz}]"));
    field("spacing", vector(lattice.cell()));
    field("first_probe", vector(lattice.centre(0)));
    field("last_probe", vector(lattice.centre(lattice.cell_count() - 1)));
    field("order", string("x fastest, then y, then z"));
    field("states", "{\"valid\": 1, \"in_wall\": 2, \"empty\": 3}".to_owned());
    field("valid", valid.to_string());
    field("in_wall", in_wall.to_string());
    field("empty", empty.to_string());
    field("leaks", grid.leaks().to_string());
    if !baked.finer().is_empty() {
        let level = |grid: &ProbeGrid<'_>| {
            let [nx, ny, nz] = grid.lattice().size();
            let bricks: Vec<_> = grid.places().iter().map(u32::to_string).collect();
            format!(
                "    {{\"counts\": [{nx}, {ny}, {nz}], \"spacing\": {}, \"relative_error\": {}, \"bricks\": [{}]}}",
                vector(grid.lattice().cell()),
                number(Some(grid.relative_error())),
                bricks.join(", ")
            )
        };
        let levels: Vec<_> = baked.finer().iter().map(level).collect();
        field("levels", format!("[\n{}\n  ]", levels.join(",\n")));
    }
    let mut lines = Vec::new();
    if let Some(file) = data_file {
        field("data", string(file));
        let mut offset = 0;
        for Array { name, kind, components, bytes } in arrays(baked) {
            let name = string(&name);
            lines.push(format!(
                "    {{\"name\": {name}, \"type\": \"{kind}\", \"components\": {components}, \"offset\": {offset}, \"bytes\": {}}}",
                bytes.len()
            ));
            offset += bytes.len();
        }
    }
    let lines = if lines.is_empty() { String::new() } else { format!("\n{}\n  ", lines.join(",\n")) };
    text + &format!("  \"arrays\": [{lines}]\n}}\n")
}
