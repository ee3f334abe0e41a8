//! `<medium>`, `<volume>` and `<phase>`.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use fogbow::phase::{Lobe, Phase};
use fogbow::spectrum::Spectrum;

use super::description::{Container, Field, Heat, Matter};
use super::element::Element;
use super::plugin::{Plugin, is_share};
use super::spectra;
use super::tree::Inline;
use crate::error::SceneError;
use crate::texture::Wrap;
use crate::transform::Transform;
use crate::vdb::{self, BrickStorage};
use crate::volume::{self, Colours, Volume};

/// Corners of a box (m).
type Corners = [[f64; 3]; 2];

/// What a `<medium>` says.
pub(super) struct Read {
    pub(super) matter: Matter,
    /// The box beyond which there is nothing of it.
    pub(super) limits: Option<Corners>,
    pub(super) glow: Spectrum,
    pub(super) heat: Option<Heat>,
}

pub(super) fn read(element: &Element<'_>) -> Result<Read, SceneError> {
    let plugin = Plugin::new(*element)?;
    if !matches!(plugin.kind.as_str(), "homogeneous" | "heterogeneous") {
        return Err(plugin.unknown_type("homogeneous, heterogeneous"));
    }
    let scale = plugin.number_in("scale", 1.0, 0.0..=1e12)? as f32;
    plugin.boolean("sample_emitters", true)?;
    plugin.skip(&["has_spectral_extinction", "medium_sampling_weight"]);
    let phase = match plugin.nested("phase") {
        Some(phase) => read_phase(&phase, 0)?,
        None => Phase::ISOTROPIC,
    };
    // Of pbrt, as what follows.
    let glow = plugin.colour("glow")?.map_or(Spectrum::ZERO, |(glow, _)| glow);
    let heat = match plugin.get("temperature") {
        Some(volume) if volume.tag() == "volume" => Some(heat(&plugin, &volume)?),
        _ => None,
    };
    let (matter, limits) = matter(&plugin, scale, phase)?;
    plugin.finish()?;
    Ok(Read { matter, limits, glow, heat })
}

/// Colours of temperatures: between so many, black bodies are nearly linear.
const COLOURS: usize = 512;

/// A grid of temperatures, with `temperature_offset`, `temperature_scale` and `glow_scale`.
fn heat(plugin: &Plugin<'_>, volume: &Element<'_>) -> Result<Heat, SceneError> {
    let number = |name: &str, usual: f64| plugin.number_in(name, usual, -1e9..=1e9);
    let (offset, scale) = (number("temperature_offset", 0.0)? as f32, number("temperature_scale", 1.0)? as f32);
    let strength = plugin.number_in("glow_scale", 1.0, 0.0..=1e12)? as f32;
    let Extinction::Sparse { bricks, to_world } = extinction(volume, true)?.0 else {
        return Err(volume.error("temperatures are those of an OpenVDB or NanoVDB grid"));
    };
    let hottest = ((bricks.max() - offset) * scale).clamp(0.0, 1e6);
    let colour = |i: usize| {
        let kelvin = f64::from(hottest) * i as f64 / (COLOURS - 1) as f64;
        // Colder than that nothing is seen.
        if kelvin > 100.0 { spectra::of_normalized_black_body(kelvin) * strength } else { Spectrum::ZERO }
    };
    Ok(Heat { bricks, to_world, offset, scale, colours: (0..COLOURS).map(colour).collect(), hottest })
}

/// How extinction varies.
enum Extinction {
    Constant(Spectrum),
    Grid { volume: Arc<Volume>, to_world: Transform },
    Sparse { bricks: Arc<BrickStorage>, to_world: Transform },
    Coloured(Field),
}

fn matter(plugin: &Plugin<'_>, scale: f32, phase: Phase) -> Result<(Matter, Option<Corners>), SceneError> {
    let is_heterogeneous = plugin.kind == "heterogeneous";
    // Of pbrt: coefficients at density 1, and densities.
    if let Some(density) = plugin.get("density").filter(|density| is_heterogeneous && density.tag() == "volume") {
        let coefficient = |name: &str| Ok(plugin.colour(name)?.map_or(Spectrum::ONE, |(value, _)| value) * scale);
        let (absorption, scattering) = (coefficient("sigma_a")?, coefficient("sigma_s")?);
        return match extinction(&density, true)?.0 {
            Extinction::Grid { volume, to_world } => {
                Ok((Matter::Grid { volume, to_world, absorption, scattering, phase }, None))
            }
            Extinction::Sparse { bricks, to_world } => {
                Ok((Matter::Sparse { bricks, to_world, absorption, scattering, phase }, None))
            }
            _ => Err(density.error("densities on a grid are due, of one channel")),
        };
    }
    if let (Some((_, a)), Some((_, _))) = (plugin.colour("sigma_a")?, plugin.colour("sigma_s")?)
        && is_heterogeneous
    {
        return Err(a.error("a heterogeneous medium takes sigma_t and albedo"));
    }
    let finite = |absorption: Spectrum, scattering: Spectrum| {
        let error = || plugin.element.error("extinction is not finite");
        (absorption + scattering).is_finite().then_some((absorption, scattering)).ok_or_else(error)
    };
    match (plugin.colour("sigma_a")?, plugin.colour("sigma_s")?) {
        (Some((absorption, element)), Some((scattering, _))) => {
            if plugin.get("sigma_t").is_some() || plugin.get("albedo").is_some() {
                return Err(element.error("sigma_a and sigma_s cannot stand beside sigma_t or albedo"));
            }
            let (absorption, scattering) = finite(absorption * scale, scattering * scale)?;
            return Ok((Matter::Homogeneous { absorption, scattering, phase }, None));
        }
        (Some((_, element)), None) => return Err(element.error("sigma_a needs sigma_s beside it")),
        (None, Some((_, element))) => return Err(element.error("sigma_s needs sigma_a beside it")),
        (None, None) => {}
    }
    let albedo = match plugin.get("albedo") {
        Some(element) if element.tag() == "volume" => albedo(&element)?,
        _ => Field::Constant(plugin.share("albedo", Spectrum::splat(0.75))?),
    };
    let (extinction, limits) = match plugin.get("sigma_t") {
        Some(element) if element.tag() == "volume" => extinction(&element, is_heterogeneous)?,
        _ => {
            let value = plugin.colour("sigma_t")?.map_or(Spectrum::ONE, |(value, _)| value);
            (Extinction::Constant(value), Some(around(&Transform::IDENTITY)))
        }
    };
    // A medium that is called homogeneous has no border of its own.
    let limits = limits.filter(|_| is_heterogeneous);
    let coloured = |extinction, albedo| Matter::Coloured { extinction, albedo, scale, phase };
    let share = |value: Spectrum, albedo: Spectrum| {
        let (extinction, scattering) = (value * scale, value * scale * albedo);
        finite((extinction - scattering).max(Spectrum::ZERO), scattering)
    };
    Ok(match (extinction, albedo) {
        (Extinction::Constant(value), Field::Constant(albedo)) => {
            let (absorption, scattering) = share(value, albedo)?;
            (Matter::Homogeneous { absorption, scattering, phase }, limits)
        }
        (Extinction::Constant(value), albedo) => (coloured(Field::Constant(value), albedo), limits),
        // A grid ends by itself.
        (Extinction::Grid { volume, to_world }, Field::Constant(albedo)) => {
            let (absorption, scattering) = share(Spectrum::ONE, albedo)?;
            (Matter::Grid { volume, to_world, absorption, scattering, phase }, None)
        }
        (Extinction::Sparse { bricks, to_world }, Field::Constant(albedo)) => {
            let (absorption, scattering) = share(Spectrum::ONE, albedo)?;
            (Matter::Sparse { bricks, to_world, absorption, scattering, phase }, None)
        }
        (Extinction::Grid { volume, to_world }, albedo) => {
            let colours = Arc::new(Colours::from(&*volume));
            let field = Field::Grid { colours, to_world, wrap: Wrap::Clamp, is_smooth: true };
            (coloured(field, albedo), limits)
        }
        (Extinction::Sparse { .. }, _) => {
            return Err(plugin.element.error("an albedo that varies is not supported with OpenVDB and NanoVDB grids"));
        }
        (Extinction::Coloured(field), albedo) => (coloured(field, albedo), limits),
    })
}

/// The axis-aligned box around the image of the unit cube.
fn around(to_world: &Transform) -> Corners {
    let centred = Transform::scaling([0.5; 3]).then(&Transform::translation([0.5; 3]));
    Container::Cube(centred.then(to_world)).bounds()
}

/// A `<volume>` of extinction, with the box in which it is.
fn extinction(element: &Element<'_>, is_heterogeneous: bool) -> Result<(Extinction, Option<Corners>), SceneError> {
    let plugin = Plugin::new(*element)?;
    match plugin.kind.as_str() {
        "constvolume" => {
            let to_world = plugin.to_world()?.map_or(Transform::IDENTITY, |(t, _)| t);
            Ok((Extinction::Constant(constant_volume(&plugin)?), Some(around(&to_world))))
        }
        "gridvolume" if !is_heterogeneous => Err(element.error("a homogeneous medium cannot hold a grid")),
        "gridvolume" => {
            if let Some(Inline::Volume(volume)) = plugin.inline()? {
                let to_world = plugin.to_world()?.map_or(Transform::IDENTITY, |(t, _)| t);
                plugin.finish()?;
                let volume = Arc::new(volume.clone());
                return Ok((Extinction::Grid { volume, to_world }, Some(around(&to_world))));
            }
            let (file, source) = plugin.path("filename")?;
            if vdb::is_named(&file) {
                plugin.word("filter_type", &["trilinear"])?;
                plugin.word("wrap_mode", &["clamp"])?;
                plugin.skip(&["raw", "accel"]);
                return Ok((sparse_volume(&plugin, &file, &source)?, None));
            }
            let grid = grid_place(&plugin)?;
            let limits = Some(around(&grid.to_world));
            // One channel, interpolated as the core does: much quicker.
            if grid.channels == 1 && grid.wrap == Wrap::Clamp && grid.is_smooth {
                let volume = Volume::read(&file).map_err(|e| source.data_error(&e))?;
                return Ok((Extinction::Grid { volume: Arc::new(volume), to_world: grid.to_world }, limits));
            }
            Ok((Extinction::Coloured(grid.read()?), limits))
        }
        _ => Err(plugin.unknown_type("gridvolume, constvolume")),
    }
}

/// A `<volume>` of albedo; values of grids are clamped to [0, 1] where they are looked up.
fn albedo(element: &Element<'_>) -> Result<Field, SceneError> {
    let plugin = Plugin::new(*element)?;
    match plugin.kind.as_str() {
        "constvolume" => {
            plugin.skip(&["to_world"]);
            Ok(Field::Constant(is_share(constant_volume(&plugin)?, element)?))
        }
        "gridvolume" => grid_place(&plugin)?.read(),
        _ => Err(plugin.unknown_type("gridvolume, constvolume")),
    }
}

fn constant_volume(plugin: &Plugin<'_>) -> Result<Spectrum, SceneError> {
    let (value, _) = plugin.colour("value")?.ok_or_else(|| plugin.element.error("\"value\" is missing"))?;
    plugin.finish()?;
    Ok(value)
}

/// A `gridvolume` before its values are read.
struct GridPlace<'a> {
    file: PathBuf,
    source: Element<'a>,
    channels: i32,
    to_world: Transform,
    wrap: Wrap,
    is_smooth: bool,
}

impl GridPlace<'_> {
    fn read(&self) -> Result<Field, SceneError> {
        let colours = Colours::read(&self.file).map_err(|e| self.source.data_error(&e))?;
        let Self { to_world, wrap, is_smooth, .. } = *self;
        Ok(Field::Grid { colours: Arc::new(colours), to_world, wrap, is_smooth })
    }
}

fn grid_place<'a>(plugin: &Plugin<'a>) -> Result<GridPlace<'a>, SceneError> {
    let is_smooth = plugin.word("filter_type", &["trilinear", "nearest"])? == "trilinear";
    let wrap = match plugin.word("wrap_mode", &["clamp", "repeat", "mirror"])? {
        "repeat" => Wrap::Repeat,
        "mirror" => Wrap::Mirror,
        _ => Wrap::Clamp,
    };
    plugin.boolean("raw", true)?;
    plugin.boolean("accel", true)?;
    let (file, source) = plugin.path("filename")?;
    let is_in_file = plugin.boolean("use_grid_bbox", false)?;
    let mut to_world = plugin.to_world()?.map_or(Transform::IDENTITY, |(t, _)| t);
    plugin.finish()?;
    let (channels, bounds) = volume::peek(&file).map_err(|e| source.data_error(&e))?;
    if is_in_file {
        let [low, high] = bounds.map(|corner| corner.map(f64::from));
        let size = [0, 1, 2].map(|i| high[i] - low[i]);
        to_world = Transform::scaling(size).then(&Transform::translation(low)).then(&to_world);
        if !to_world.is_regular() {
            return Err(source.attribute_error("value", "the box that the file names has no volume"));
        }
    }
    Ok(GridPlace { file, source, channels, to_world, wrap, is_smooth })
}

/// An OpenVDB or NanoVDB file: as a grid of the box of its active voxels, or with `use_grid_bbox` where the file itself says.
fn sparse_volume(plugin: &Plugin<'_>, file: &Path, source: &Element<'_>) -> Result<Extinction, SceneError> {
    let name = plugin.string("grid")?.map(|(name, _)| name);
    let is_in_file = plugin.boolean("use_grid_bbox", false)?;
    let to_world = plugin.to_world()?.map_or(Transform::IDENTITY, |(t, _)| t);
    plugin.finish()?;
    let bricks = vdb::Grid::read(file, name.as_deref()).and_then(|grid| grid.into_bricks(file));
    let bricks = bricks.map_err(|e| source.data_error(&e))?;
    let place = if is_in_file { bricks.in_file() } else { bricks.in_active_box() };
    let to_world = place.then(&to_world);
    Ok(Extinction::Sparse { bricks: Arc::new(bricks), to_world })
}

/// Blends within blends, and no further.
const MAX_BLENDS: u32 = 4;

fn read_phase(element: &Element<'_>, depth: u32) -> Result<Phase, SceneError> {
    let plugin = Plugin::new(*element)?;
    let phase = match plugin.kind.as_str() {
        "isotropic" => Phase::ISOTROPIC,
        "rayleigh" => Phase::from(Lobe::Rayleigh),
        "hg" => {
            let (g, source) = match plugin.number("g")? {
                Some((g, source)) => (g as f32, source),
                None => (0.8, *element),
            };
            let lobe = Lobe::HenyeyGreenstein { g }.check();
            Phase::from(lobe.map_err(|e| source.attribute_error("value", e))?)
        }
        "blendphase" => {
            if depth >= MAX_BLENDS {
                return Err(element.error(format!("blends are nested more than {MAX_BLENDS} deep")));
            }
            let weight = plugin.number_in("weight", 0.5, 0.0..=1.0)? as f32;
            let part = || match plugin.nested("phase") {
                Some(phase) => read_phase(&phase, depth + 1),
                None => Err(element.error("a blend needs two <phase> inside")),
            };
            let parts = [(Spectrum::splat(1.0 - weight), part()?), (Spectrum::splat(weight), part()?)];
            Phase::mix(parts).map_err(|e| element.error(e))?
        }
        _ => return Err(plugin.unknown_type("isotropic, hg, rayleigh, blendphase")),
    };
    plugin.finish()?;
    Ok(phase)
}
