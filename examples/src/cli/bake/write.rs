//! The files of a bake.

use std::path::{Path, PathBuf};

use fogbow::bake::{ProbeGrid, bytes};
use fogbow_std::image::{Layer, write as write_picture};

use super::super::output;
use super::{BakeArguments, Made};
use crate::bake::texture::Texel;
use crate::bake::{Baked, Layout, ktx2, raw, sheets, texture};

/// What a file is, by its extension.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Target {
    Bake,
    Json,
    Ktx2,
    Exr,
}

impl Target {
    /// # Errors
    /// An extension that is none of these.
    pub(super) fn of(file: &Path) -> Result<Self, String> {
        let extension = file.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
        match extension.as_deref() {
            Some("bake") => Ok(Self::Bake),
            Some("json") => Ok(Self::Json),
            Some("ktx2") => Ok(Self::Ktx2),
            Some("exr") => Ok(Self::Exr),
            _ => Err(format!("{}: the extension is none of bake, json, ktx2, exr", file.display())),
        }
    }
}

/// Writes all files, and says what there is. What was baked from a scene and has no place in a .bake file goes elsewhere.
///
/// # Errors
/// A layout that has no place for what was baked, numbers that texels do not hold, or what the system says.
pub(super) fn all(arguments: &BakeArguments, made: Made, files: &[&PathBuf]) -> Result<String, String> {
    let all = all_to_bytes(made.baked.levels.levels(), made.tag);
    let (mut written, mut trouble) = (Vec::new(), None);
    for file in files.iter().filter(|file| Target::of(file) == Ok(Target::Bake)) {
        match save(file, &all) {
            Ok(()) => written.push((*file).clone()),
            Err(error) => trouble = Some(error),
        }
    }
    let is_kept = !written.is_empty() || arguments.scene.is_empty();
    trouble.map_or_else(|| others(arguments, made.baked, files, written), Err).map_err(|error| {
        let file = files.first().filter(|_| !is_kept);
        match file.and_then(|file| output::rescue(file, "bake", |rescue| save(rescue, &all))) {
            Some(rescue) => format!("{error}; what was baked is in {}", rescue.display()),
            None => error,
        }
    })
}

/// The same, when .bake files are written.
fn others(
    arguments: &BakeArguments,
    mut baked: Baked,
    files: &[&PathBuf],
    mut written: Vec<PathBuf>,
) -> Result<String, String> {
    let [valid, in_wall, empty] = baked.counts();
    let error = baked.grid().relative_error();
    baked.levels.dilate();
    baked.scale = arguments.scale as f32;
    for file in files {
        match Target::of(file)? {
            Target::Bake => {}
            Target::Json => {
                let numbers = file.with_extension("bin");
                save(&numbers, &raw::data(&baked))?;
                let name = numbers.file_name().unwrap_or_default().to_string_lossy().into_owned();
                save(file, raw::description(&baked, Some(&name)).as_bytes())?;
                written.extend([numbers, (*file).clone()]);
            }
            Target::Ktx2 => written.extend(textures(arguments, &baked, file)?),
            Target::Exr => {
                let sheets = sheets::sheets(&baked).map_err(|error| format!("{}: {error}", file.display()))?;
                let layers: Vec<_> = sheets.iter().map(|(name, image)| Layer { name, image }).collect();
                write_picture(file, &layers, 0.0).map_err(|error| error.to_string())?;
                let beside = file.with_extension("exr.json");
                save(&beside, raw::description(&baked, None).as_bytes())?;
                written.extend([(*file).clone(), beside]);
            }
        }
    }
    let [x, y, z] = baked.grid().lattice().size();
    let names: Vec<_> = written.iter().map(|file| file.display().to_string()).collect();
    let leaks = match baked.grid().leaks() {
        0 => String::new(),
        pairs => format!(
            "{pairs} pairs of neighbours have a surface between them: light leaks through it where engines mix all probes, and not where they read planes of surfaces\n"
        ),
    };
    let by_paths = match baked.grid().probes().iter().filter(|probe| probe.is_by_paths()).count() {
        0 => String::new(),
        probes => format!(
            "{probes} probes see other surfaces near them than most of their cell does, and had paths in place of photons\n"
        ),
    };
    let kept = baked.kept.map_or_else(String::new, |[kept, all]| {
        format!("{kept} of {all} bricks of 64 probes are those of the frame before\n")
    });
    let [usual, worst] = baked.levels.relative_coarseness().map(|share| 100.0 * share);
    let apart = baked.deviation.map_or(String::new(), |d| {
        let [bias, error, spread] = [d.bias, d.bias_error, d.spread].map(|share| 100.0 * share);
        format!("against path tracing of {} probes: {bias:+.2} % ± {error:.2} %, single numbers off by {spread:.1} % of the mean\n", d.probes)
    });
    let bricks: String = baked.finer().iter().zip(1..).map(|(grid, level)| finer_level(grid, level)).collect();
    Ok(format!(
        "{x} x {y} x {z} probes: {valid} valid, {in_wall} in walls, {empty} far from any medium; standard error of what was sampled {:.2} % of the mean\n{bricks}between probes off by about {usual:.1} % of the mean, {worst:.0} % where light varies most\n{leaks}{by_paths}{kept}{apart}wrote {}",
        100.0 * error,
        names.join(", ")
    ))
}

/// What there is of a finer level, in a line.
fn finer_level(grid: &ProbeGrid<'_>, level: u32) -> String {
    let (bricks, all) = (grid.places().len(), grid.lattice().cell_count());
    let spacing = 1 << level;
    let error = 100.0 * grid.relative_error();
    let share = 6400.0 * bricks as f32 / all as f32;
    format!(
        "at 1/{spacing} of the spacing {bricks} bricks of 64 probes, {share:.1} % of the box; standard error {error:.2} % of their mean\n"
    )
}

/// Writes the textures of a file, and a description beside it; their names.
fn textures(arguments: &BakeArguments, baked: &Baked, file: &Path) -> Result<Vec<PathBuf>, String> {
    let fail = |error: String| format!("{}: {error}", file.display());
    let textures = texture::textures(baked, arguments.layout()).map_err(fail)?;
    let bounds = baked.grid().lattice().bounds();
    let corner = |v: fogbow::math::Vec3| format!("{},{},{}", v.x, v.y, v.z);
    let (quantity, unit) = baked.quantity();
    let region = format!("{} {}", corner(bounds.min), corner(bounds.max));
    let (basis, scale) = (baked.basis(), baked.scale.to_string());
    let [x, y, z] = baked.grid().lattice().size();
    let (counts, levels) = (format!("{x},{y},{z}"), baked.finer().len().to_string());
    let about = [
        ("fogbow.box", region.as_str()),
        ("fogbow.basis", &basis),
        ("fogbow.counts", &counts),
        ("fogbow.levels", &levels),
        ("fogbow.orders", baked.orders()),
        ("fogbow.quantity", quantity),
        ("fogbow.scale", &scale),
        ("fogbow.unit", unit),
    ];
    let place = |name: &str| if arguments.layout() == Layout::Plain { named(file, name) } else { file.to_owned() };
    let encoded = textures.iter().map(|one| {
        let about = [&about[..], &[("fogbow.texture", one.name.as_str())]].concat();
        // Planes have any sign, and are read as they are; so are places of bricks.
        let is_plain = texture::WALLS.contains(&one.name.as_str()) || one.name == texture::INDEX;
        let texel = if is_plain { Texel::Rgba16F } else { arguments.texel() };
        Ok((place(&one.name), ktx2::encode(one, texel, &about)?))
    });
    // All or none.
    let encoded: Vec<_> = encoded.collect::<Result<_, String>>().map_err(fail)?;
    let mut written = Vec::new();
    for (place, bytes) in encoded {
        save(&place, &bytes)?;
        written.push(place);
    }
    let beside = file.with_extension("ktx2.json");
    save(&beside, raw::description(baked, None).as_bytes())?;
    written.push(beside);
    Ok(written)
}

/// `fog.ktx2` and `sh0` make `fog-sh0.ktx2`.
fn named(file: &Path, name: &str) -> PathBuf {
    let mut stem = file.file_stem().unwrap_or_default().to_owned();
    let name = match name.split_at(1) {
        ("+", axis) => format!("plus-{axis}"),
        ("-", axis) => format!("minus-{axis}"),
        _ => name.to_owned(),
    };
    stem.push(format!("-{name}.ktx2"));
    file.with_file_name(stem)
}

/// Writes a grid, for `--resume` and `--from-file`.
///
/// # Errors
/// What the system says.
pub(super) fn keep<'g>(
    file: &Path,
    levels: impl IntoIterator<Item = &'g ProbeGrid<'static>>,
    tag: u64,
) -> Result<(), String> {
    save(file, &all_to_bytes(levels, tag))
}

pub(super) fn all_to_bytes<'g>(levels: impl IntoIterator<Item = &'g ProbeGrid<'static>>, tag: u64) -> Vec<u8> {
    levels.into_iter().flat_map(|grid| to_bytes(grid, tag)).collect()
}

pub(super) fn to_bytes(grid: &ProbeGrid<'_>, tag: u64) -> Vec<u8> {
    let mut all = Vec::with_capacity(bytes::byte_count(grid));
    let Ok(()) = bytes::write(grid, tag, |part| {
        all.extend_from_slice(part);
        Ok::<(), core::convert::Infallible>(())
    });
    all
}

fn save(file: &Path, bytes: &[u8]) -> Result<(), String> {
    fogbow_std::files::write(file, bytes).map_err(|error| error.to_string())
}
