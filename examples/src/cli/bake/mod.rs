//! `fogbow bake`: light in fog as 3D textures.

mod job;
pub(super) mod parts;
mod sequence;
mod write;

use core::cell::Cell;
use std::path::{Path, PathBuf};

use clap::{Arg, Args, ValueEnum};
use fogbow::bake::bytes::{self, ProbeBytesError};
use fogbow::bake::{BakeMemory, BakeSettings, Orders, ProbeBasis, ProbeGrid, ProbeLevels, Quantity};
use fogbow::bytes::{Crc, Damage};
use fogbow::math::{Bounds, Vec3};
use fogbow::path;

use super::defaults::{unit_outline, with_default};
use super::scene::{ReadArguments, SceneArguments};
use super::{Ending, Failure, output};
use crate::bake::texture::Texel;
use crate::bake::{Baked, Layout};
use crate::error::read_file;
use crate::world::{LightAids, Storage, World};
use job::{BakeJob, Done};
pub use parts::BakePartArguments;
use parts::PartOf;
pub(super) use parts::check_count;
use sequence::Earlier;
use write::Target;

/// Bakes light in fog into 3D textures for engines.
///
/// Probes stand in the centres of equal cells of a box. Each holds in-scattered radiance towards a direction (W·m⁻²·sr⁻¹; the phase function is in it,
/// the scattering coefficient is not), or irradiance of surfaces with that normal (W·m⁻²). Light of probes in walls, and of those far from any medium, comes
/// from their neighbours.
#[derive(Debug, Args)]
#[command(mut_args(told))]
pub struct BakeArguments {
    /// The scene file; or several, the frames of an animation in their order: each goes into files with its scene's name in theirs, and keeps what has not changed since the frame before (see --after).
    #[arg(required_unless_present = "from_file", value_name = "SCENE")]
    pub scene: Vec<PathBuf>,
    /// How it is read.
    #[command(flatten)]
    pub reading: ReadArguments,
    /// Bakes nothing but writes what is in a .bake file in other formats.
    #[arg(long, value_name = "FILE.bake", conflicts_with_all = ["scene", "region", "spacing", "counts", "basis", "quantity", "orders", "error", "passes", "refine", "per_light", "resume", "after", "part", "level"])]
    pub from_file: Option<PathBuf>,
    /// The box to bake: two corners, the smaller one first [default: around all media].
    #[arg(long = "box", value_name = "MIN MAX", value_parser = corners, allow_hyphen_values = true)]
    pub region: Option<Bounds>,
    /// Size of cells, in the scene's unit of length.
    #[arg(long, value_name = "LENGTH", value_parser = output::positive, conflicts_with = "counts")]
    pub spacing: Option<f64>,
    /// Probes along x, y and z [default: cubic cells, 32 along the longest side].
    #[arg(long, value_name = "NxNxN", value_parser = counts)]
    pub counts: Option<[u32; 3]>,
    /// How a probe holds light by direction [default: sh2; ambient-cube for --layout bevy].
    #[arg(long, value_enum)]
    pub basis: Option<Basis>,
    /// What light is baked for [default: in-scattered; irradiance for --layout bevy and three].
    #[arg(long, value_enum)]
    pub quantity: Option<Purpose>,
    /// Which light is baked [default: all; indirect for --layout bevy and three, which add the light of lamps themselves].
    #[arg(long, value_enum)]
    pub orders: Option<Light>,
    /// How light is found.
    #[arg(long, value_enum, default_value_t = Source::Path)]
    pub method: Source,
    /// Standard error of probes, in proportion to the mean of all, at which bricks of 64 have enough samples; caches are filled for it, too.
    #[arg(long, value_name = "E", value_parser = error)]
    pub error: Option<f32>,
    /// Passes of each brick at most, whatever the error.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..))]
    pub passes: Option<u32>,
    /// Adds bricks of 4x4x4 probes of half the spacing where values between probes are off by more than E of the mean because light varies faster than the grid can hold, as
    /// second differences say; in .bake, .json and .ktx2 files of the plain layout alone.
    #[arg(long, value_name = "E", value_parser = error)]
    pub refine: Option<f32>,
    /// Levels that --refine adds at most, each of half the spacing of the one before.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..fogbow::bake::MOST_LEVELS as i64), default_value_t = 2, requires = "refine")]
    pub levels: u32,
    /// Bakes each light by itself, into files with -light0, -light1 and so on in their names, so that an engine may colour and dim them; lights are counted in the
    /// order of the scene.
    #[arg(long)]
    pub per_light: bool,
    /// Goes on where the .bake file that is to be written was left. Without such a file, begins.
    #[arg(long)]
    pub resume: bool,
    /// Keeps what has not changed since the frame before was baked, with the same --box, --counts, --basis, --quantity and --orders: each brick of 64 probes whose light a few first passes cannot tell from what it was, to the error asked for. Its
    /// numbers stay bit for bit, so that they do not flicker, and take a fraction of the time.
    #[arg(long, value_name = "FRAME.bake", conflicts_with_all = ["per_light", "part"])]
    pub after: Option<PathBuf>,
    /// Seconds between two writings of the .bake file while it is baked.
    #[arg(long, value_name = "SECONDS", value_parser = output::positive, default_value_t = 30.0)]
    pub checkpoint_every: f64,
    /// How numbers lie in .ktx2 files.
    #[arg(long, value_enum, default_value_t = Packing::Plain)]
    pub layout: Packing,
    /// Texels of .ktx2 files.
    #[arg(long, value_enum, default_value_t = Format::Rgba16f)]
    pub texel: Format,
    /// What light is multiplied by in all files but .bake.
    #[arg(long, value_name = "FACTOR", value_parser = output::positive, default_value_t = 1.0)]
    pub scale: f64,
    /// Threads; 0 is one per processor.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub threads: usize,
    /// Chooses other random numbers.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Parts.
    #[command(flatten)]
    pub many: BakePartArguments,
    /// File to write; may be repeated: .bake (all there is, for --resume and --from-file), .json (with plain numbers in a .bin file beside it), .ktx2 (with a
    /// .json file beside it; for the plain layout, a file for each number) or .exr (slices side by side).
    #[arg(short, long, value_name = "FILE", required = true)]
    pub output: Vec<PathBuf>,
    /// No progress bar and no summary.
    #[arg(short, long)]
    pub quiet: bool,
}

/// An option with the default of [`BakeSettings::for_outline`].
fn told(option: Arg) -> Arg {
    let usual = BakeSettings::for_outline(&unit_outline(), [1, 1, 1]);
    match option.get_id().as_str() {
        "error" => with_default(option, usual.error),
        "passes" => with_default(option, usual.most_passes),
        _ => option,
    }
}

/// How a probe holds light by direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Basis {
    /// The mean over directions.
    Sh0,
    /// Spherical harmonics of degree 1: four colours.
    Sh1,
    /// Spherical harmonics of degree 2: nine colours.
    Sh2,
    /// Spherical harmonics of degree 3: sixteen colours.
    Sh3,
    /// Values in the directions of the axes: six colours.
    AmbientCube,
    /// Fluence alone, the integral over all directions: a colour.
    Fluence,
}

/// What light is baked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Purpose {
    /// Radiance scattered towards a direction: for fog.
    InScattered,
    /// Irradiance by normal: for surfaces.
    Irradiance,
}

/// Which light is baked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Light {
    /// All of it.
    All,
    /// All but light straight from the lights; that of an even sky is in it.
    Indirect,
    /// Light that the medium has scattered before it comes to the probe.
    Multiple,
}

/// How light is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Source {
    /// What radiance caches know at the probe, connections to the lights: quick where probes are many, and as far off as single records are. That is
    /// measured by path tracing some of the probes.
    RadianceCache,
    /// Path tracing from every probe: unbiased.
    Path,
    /// Photons from the lights, which all probes share: many times faster. What was scattered before it comes to a probe is the mean over its cell.
    Photons,
}

/// How numbers lie in textures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Packing {
    /// A texture for each number, with validity in alpha, and one of the medium: albedo, with extinction in alpha.
    Plain,
    /// One texture as Bevy's irradiance volumes have it, of irradiance over π.
    Bevy,
    /// One texture as three.js' LightProbeGrid has it.
    Three,
}

/// Texels of textures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// Four half floats.
    Rgba16f,
    /// Three numbers with a common exponent: for ambient cubes and fluence, which are not below 0.
    Rgb9e5,
    /// One float, the mean of the channels.
    R32f,
}

impl BakeArguments {
    fn layout(&self) -> Layout {
        match self.layout {
            Packing::Plain => Layout::Plain,
            Packing::Bevy => Layout::Bevy,
            Packing::Three => Layout::Three,
        }
    }

    fn texel(&self) -> Texel {
        match self.texel {
            Format::Rgba16f => Texel::Rgba16F,
            Format::Rgb9e5 => Texel::Rgb9E5,
            Format::R32f => Texel::R32F,
        }
    }

    fn basis(&self) -> ProbeBasis {
        let usual = if self.layout == Packing::Bevy { Basis::AmbientCube } else { Basis::Sh2 };
        match self.basis.unwrap_or(usual) {
            Basis::Sh0 => ProbeBasis::SphericalHarmonics { degree: 0 },
            Basis::Sh1 => ProbeBasis::SphericalHarmonics { degree: 1 },
            Basis::Sh2 => ProbeBasis::SphericalHarmonics { degree: 2 },
            Basis::Sh3 => ProbeBasis::SphericalHarmonics { degree: 3 },
            Basis::AmbientCube => ProbeBasis::AmbientCube,
            Basis::Fluence => ProbeBasis::Fluence,
        }
    }

    fn quantity(&self) -> Quantity {
        let usual = if self.layout == Packing::Plain { Purpose::InScattered } else { Purpose::Irradiance };
        match self.quantity.unwrap_or(usual) {
            Purpose::InScattered => Quantity::InScattered,
            Purpose::Irradiance => Quantity::Irradiance,
        }
    }

    fn orders(&self) -> Orders {
        let usual = if self.layout == Packing::Plain { Light::All } else { Light::Indirect };
        match self.orders.unwrap_or(usual) {
            Light::All => Orders::All,
            Light::Indirect => Orders::Indirect,
            Light::Multiple => Orders::Multiple,
        }
    }

    /// The one file that is written and can be gone on with: .bake, or .fogbow of a part.
    ///
    /// # Errors
    /// None or several, where one is needed.
    fn kept(&self) -> Result<Option<&Path>, String> {
        let is_kept = |file: &&Path| self.many.part.is_some() || Target::of(file) == Ok(Target::Bake);
        let mut files = self.output.iter().map(PathBuf::as_path).filter(is_kept);
        match (files.next(), files.next()) {
            (None, _) if self.resume => Err("--resume goes on with a .bake file, but none is to be written".to_owned()),
            (Some(_), Some(_)) => Err("--output: there may be one .bake file".to_owned()),
            (file, _) => Ok(file),
        }
    }

    /// The cells of a box.
    ///
    /// # Errors
    /// Too many of them.
    fn cells(&self, bounds: &Bounds) -> Result<[u32; 3], String> {
        /// Along the longest side.
        const USUAL: f64 = 32.0;
        if let Some(counts) = self.counts {
            return Ok(counts);
        }
        let size = bounds.size();
        let spacing = self.spacing.unwrap_or(f64::from(size.max_element()) / USUAL);
        let count = |length: f32| (f64::from(length) / spacing - 1e-3).ceil().max(1.0);
        let counts = size.to_array().map(count);
        if counts.iter().product::<f64>() > fogbow::bake::MOST_PROBES as f64 {
            let [x, y, z] = counts;
            return Err(format!(
                "--spacing: {spacing} makes {x} x {y} x {z} probes, and there may be at most {}",
                fogbow::bake::MOST_PROBES
            ));
        }
        Ok(counts.map(|n| n as u32))
    }
}

/// `x,y,z x,y,z`: the corners of a box.
fn corners(text: &str) -> Result<Bounds, String> {
    let number = |text: &str| text.trim().parse().ok().filter(|v: &f32| v.is_finite());
    let point =
        |text: &str| -> Option<[f32; 3]> { text.split(',').map(number).collect::<Option<Vec<_>>>()?.try_into().ok() };
    let points: Option<Vec<_>> = text.split_whitespace().map(point).collect();
    let Some(&[min, max]) = points.as_deref() else {
        return Err("must look like \"-1,0,-1 1,2,1\": the smaller corner, a space, the larger corner".to_owned());
    };
    match (0..3).find(|axis| !(min[*axis] < max[*axis])) {
        Some(axis) => Err(format!(
            "the box has no extent along {}: {} is not less than {}",
            ["x", "y", "z"][axis],
            min[axis],
            max[axis]
        )),
        None => Ok(Bounds { min: Vec3::from(min), max: Vec3::from(max) }),
    }
}

/// `NxNxN`.
fn counts(text: &str) -> Result<[u32; 3], String> {
    let numbers: Option<Vec<u32>> = text.split('x').map(|n| n.parse().ok()).collect();
    let most = fogbow::bake::MOST_PROBES;
    match numbers.as_deref() {
        Some(&[x, y, z]) if [x, y, z].map(u128::from).iter().product::<u128>() > most as u128 => {
            Err(format!("there may be at most {most} probes"))
        }
        Some(&[x, y, z]) if x.min(y).min(z) == 0 => Err("there must be a probe along every side".to_owned()),
        Some(&[x, y, z]) if x.max(y).max(z) > 1024 => Err("there may be at most 1024 probes along a side".to_owned()),
        Some(&[x, y, z]) => Ok([x, y, z]),
        _ => Err("must look like 32x16x32".to_owned()),
    }
}

/// A standard error.
fn error(text: &str) -> Result<f32, String> {
    let [least, most] = fogbow::cache::ERROR_BOUNDS;
    let error = text.parse::<f32>().ok().filter(|error| (least..=most).contains(error));
    error.ok_or_else(|| format!("must be a number from {least} to {most}"))
}

pub(super) fn run(arguments: &BakeArguments) -> Result<Ending, Failure> {
    arguments.check_part()?;
    for file in &arguments.output {
        if arguments.many.part.is_none() {
            Target::of(file)?;
        }
        output::check_place(file)?;
    }
    arguments.kept()?;
    let file = match arguments.scene.as_slice() {
        [] => {
            let file = arguments.from_file.as_deref().ok_or("there is no scene to bake")?;
            return finish(arguments, from_file(file)?, Ending::Done, &arguments.output);
        }
        [file] => file,
        frames => return sequence::run(arguments, frames),
    };
    let scene = &SceneArguments { file: file.clone(), reading: arguments.reading.clone() };
    if arguments.many.part.is_some() {
        return parts::run(arguments, scene);
    }
    if !arguments.per_light {
        let earlier = sequence::earlier(arguments)?;
        let Some((made, ending)) =
            unless_stopped(bake(arguments, scene, &Frame { earlier: earlier.as_ref(), ..Frame::default() }))?
        else {
            return Ok(Ending::Stopped);
        };
        return finish(arguments, made, ending, &arguments.output);
    }
    for number in 0..light_count(scene)? {
        let frame = Frame { light: Some(number), ..Frame::default() };
        let files: Vec<_> = arguments.output.iter().map(|file| frame.file(file)).collect();
        for file in &files {
            output::check_place(file)?;
        }
        let (made, ending) = bake(arguments, scene, &frame)?;
        if finish(arguments, made, ending, &files)? == Ending::Stopped {
            return Ok(Ending::Stopped);
        }
    }
    Ok(Ending::Done)
}

/// What a bake has made; none if it was stopped before there was anything.
///
/// # Errors
/// All else.
fn unless_stopped(made: Result<(Made, Ending), Failure>) -> Result<Option<(Made, Ending)>, Failure> {
    match made {
        Err(error) if error.is::<super::covariance::Stopped>() => {
            say!("fogbow: {error}");
            Ok(None)
        }
        made => made.map(Some),
    }
}

/// Writes the files of a bake.
fn finish(arguments: &BakeArguments, made: Made, ending: Ending, files: &[PathBuf]) -> Result<Ending, Failure> {
    let (unfinished, has_kept) = (made.unfinished.clone(), made.has_kept);
    // Textures of a bake that is not done would look as if it were.
    let files: Vec<_> = if ending == Ending::Done { files.iter().collect() } else { unfinished.iter().collect() };
    let written = write::all(arguments, made, &files)?;
    if let Some(file) = unfinished.as_ref().filter(|file| ending == Ending::Done && has_kept && !files.contains(file)) {
        drop(std::fs::remove_file(file));
    }
    if !arguments.quiet {
        say!("{written}");
    }
    Ok(ending)
}

/// Lights of a scene that are baked one by one.
///
/// # Errors
/// None, or more than anybody wants.
fn light_count(file: &SceneArguments) -> Result<u32, Failure> {
    /// Layers of light in files.
    const MOST: usize = 64;
    let scene = file.read(true)?;
    let mut storage = Storage::new(&scene);
    match World::new(&scene, &mut storage)?.lights().len() {
        0 => Err(format!("{}: has no lights, so there is nothing to bake", file.file.display()).into()),
        count if count > MOST => {
            Err(format!("--per-light: {} has {count} lights; at most {MOST} are baked one by one", file.file.display())
                .into())
        }
        count => Ok(count as u32),
    }
}

/// Which of several bakes of the same arguments.
#[derive(Default)]
struct Frame<'a> {
    /// The one light that shines; `None` for all.
    light: Option<u32>,
    /// What its files are called instead of the arguments' own.
    name: Option<&'a str>,
    /// The frame before.
    earlier: Option<&'a Earlier>,
}

impl Frame<'_> {
    /// `fog.json` of light 3 is `fog-light3.json`, of the scene `plume-07.xml` among others `fog-plume-07.json`.
    fn file(&self, file: &Path) -> PathBuf {
        let more = match (self.light, self.name) {
            (Some(number), _) => format!("light{number}"),
            (None, Some(name)) => name.to_owned(),
            (None, None) => return file.to_owned(),
        };
        let mut name = file.file_stem().unwrap_or_default().to_owned();
        name.push(format!("-{more}."));
        name.push(file.extension().unwrap_or_default());
        file.with_file_name(name)
    }
}

/// A bake and what it was made for.
struct Made {
    baked: Baked,
    tag: u64,
    part: Option<PartOf>,
    /// Where the grid is kept until all is done: not over a file that was there and is not gone on with, which may have had all its passes.
    unfinished: Option<PathBuf>,
    /// Whether it was, on the way.
    has_kept: bool,
}

fn from_file(file: &Path) -> Result<Made, Failure> {
    let (levels, tag) = read(&read_file(file)?).map_err(|error| format!("{}: {error}", file.display()))?;
    let baked = Baked { levels, method: None, mean_cosine: None, deviation: None, kept: None, scale: 1.0 };
    Ok(Made { baked, tag, part: None, unfinished: None, has_kept: false })
}

/// All levels in a file, and what they were made for.
///
/// # Errors
/// What is no bake, or damaged.
pub(super) fn read(bytes: &[u8]) -> Result<(ProbeLevels<'static>, u64), ProbeBytesError> {
    let tag = bytes::tag(bytes)?;
    Ok((bytes::read_levels(bytes, tag, |_| BakeMemory::default())?, tag))
}

/// Bakes a scene, by all its lights or by one of them.
fn bake(arguments: &BakeArguments, file: &SceneArguments, frame: &Frame<'_>) -> Result<(Made, Ending), Failure> {
    const MAX_EDGE: u32 = fogbow::covariance::MAX_EDGE;
    let scene = file.read(true)?;
    let mut storage = Storage::new(&scene);
    let world = World::new(&scene, &mut storage)?;
    let paths = super::render::path_settings(&scene, None);
    let (bounds, counts) = place(arguments, file, &world)?;
    if arguments.refine.is_some() && counts.iter().any(|n| n << arguments.levels > MAX_EDGE) {
        let [x, y, z] = counts;
        return Err(format!("--levels: {x} x {y} x {z} probes with {} finer levels make more than {MAX_EDGE} along a side; take fewer of one or the other", arguments.levels).into());
    }
    let lights = world.lights();
    if lights.is_empty() && !world.media().glow() {
        return Err(format!("{}: has no lights, so there is nothing to bake", file.file.display()).into());
    }
    let aids = LightAids::new(&lights);
    let method = arguments.method;
    if method == Source::RadianceCache
        && arguments.quantity() == Quantity::Irradiance
        && arguments.basis() != ProbeBasis::Fluence
    {
        return Err("--method radiance-cache: caches in a medium know nothing of irradiance; take --method path".into());
    }
    job::check(method, &paths, &world)?;
    let tag = tag(arguments, file, &paths, frame)?;
    let level = arguments.level(file, &paths)?;
    let part = arguments.part_of(file, &paths, (&bounds, counts), level)?;
    let kept = arguments.kept()?.map(|file| frame.file(file));
    let unfinished = kept.map(|file| if arguments.resume { file } else { output::beside(file) });
    let has_kept = Cell::new(false);
    let job = BakeJob {
        arguments,
        world: &world,
        lights: aids.view(&lights),
        paths,
        bounds,
        counts,
        method,
        tag,
        light: frame.light,
        earlier: frame.earlier,
        level,
        part: part.as_ref(),
        kept: unfinished.clone(),
        has_kept: &has_kept,
    };
    let Done { levels, mean_cosine, deviation, kept, ending } = world.media().with(job)?;
    let name = match method {
        Source::RadianceCache => "radiance-cache",
        Source::Path => "path",
        Source::Photons => "photons",
    };
    let baked = Baked { levels, method: Some(name), mean_cosine: Some(mean_cosine), deviation, kept, scale: 1.0 };
    if baked.counts()[0] == 0 && ending == Ending::Done && part.is_none() {
        let [_, in_wall, empty] = baked.counts();
        return Err(format!(
            "no probe holds light: {in_wall} are in walls, {empty} far from any medium; choose another --box or smaller cells"
        )
        .into());
    }
    Ok((Made { baked, tag, part, unfinished, has_kept: has_kept.get() }, ending))
}

/// The box that is baked, and the probes along its sides.
///
/// # Errors
/// A scene without a medium, or a box far from it; too many probes.
fn place(arguments: &BakeArguments, file: &SceneArguments, world: &World<'_>) -> Result<(Bounds, [u32; 3]), Failure> {
    let around = world.medium_bounds();
    let needs_medium = arguments.quantity() == Quantity::InScattered;
    let bounds = match (arguments.region, around) {
        (_, None) if needs_medium => {
            return Err(format!("{}: has no medium to bake light for", file.file.display()).into());
        }
        (Some(region), Some(around)) if needs_medium && !overlap(&region, &around) => {
            let Bounds { min, max } = around;
            return Err(format!(
                "--box: no medium is in it; they reach from {},{},{} to {},{},{}",
                min.x, min.y, min.z, max.x, max.y, max.z
            )
            .into());
        }
        (Some(region), _) => region,
        (None, around) => around.unwrap_or(world.bounds()),
    };
    Ok((bounds, arguments.cells(&bounds)?))
}

/// Probes along the sides of the box that is baked.
///
/// # Errors
/// A scene that cannot be read, and what [`place`] refuses.
pub(super) fn cells_of(arguments: &BakeArguments, file: &SceneArguments) -> Result<[u32; 3], Failure> {
    let scene = file.read(true)?;
    let mut storage = Storage::new(&scene);
    let world = World::new(&scene, &mut storage)?;
    Ok(place(arguments, file, &world)?.1)
}

fn overlap(a: &Bounds, b: &Bounds) -> bool {
    a.min.cmplt(b.max).all() && b.min.cmplt(a.max).all()
}

/// What a grid in a file is for: in the upper half the light of the scene, in the lower one all else that changes a probe but for what the file's
/// header says.
fn tag(
    arguments: &BakeArguments,
    scene: &SceneArguments,
    paths: &path::Settings,
    frame: &Frame<'_>,
) -> Result<u64, Failure> {
    let Frame { light, earlier, .. } = *frame;
    let mut crc = Crc::new();
    if let Some(earlier) = earlier {
        crc.add(&earlier.crc.to_le_bytes());
    }
    let method = arguments.method;
    let of_caches = if method == Source::RadianceCache { arguments.error.unwrap_or(0.0).to_bits() } else { 0 };
    for number in [paths.roulette_after, method as u32, of_caches, light.map_or(0, |number| number + 1)] {
        crc.add(&number.to_le_bytes());
    }
    crc.add(&arguments.seed.to_le_bytes());
    // Light of one lamp is not that of the scene.
    let scene = of_scene(scene, paths)? ^ light.map_or(0, |number| number + 1);
    Ok(u64::from(scene) << 32 | crc.value() & 0xffff_ffff)
}

/// A number for the light of a scene.
fn of_scene(scene: &SceneArguments, paths: &path::Settings) -> Result<u32, Failure> {
    let mut crc = Crc::new();
    crc.add(&scene.fingerprint()?.to_le_bytes());
    crc.add(&paths.max_scatterings.to_le_bytes());
    Ok((crc.value() >> 32) as u32)
}

/// Whether a grid with a tag has the light of a scene.
pub(super) fn is_made_for(tag: u64, scene: &SceneArguments, paths: &path::Settings) -> Result<bool, Failure> {
    Ok((tag >> 32) as u32 == of_scene(scene, paths)?)
}

/// The levels that were left in a file; none if there is no file.
fn begun(file: &Path, tag: u64) -> Result<Vec<ProbeGrid<'static>>, Failure> {
    if !file.exists() {
        return Ok(Vec::new());
    }
    let read = bytes::read_levels(&read_file(file)?, tag, |_| BakeMemory::default());
    let levels = read.map_err(|error| match error {
        ProbeBytesError::Damage(Damage::Tag { .. }) => {
            format!(
                "{}: was made for another scene, or with another --method, --seed, --error or --after",
                file.display()
            )
        }
        error => format!("{}: {error}", file.display()),
    })?;
    Ok(levels.into_levels().collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_and_counts_are_read_or_refused_with_the_reason() {
        let due = Bounds { min: Vec3::new(-1.0, 0.0, 0.5), max: Vec3::new(1.0, 2.5, 1.0) };
        assert_eq!(corners("-1,0,0.5  1,2.5,1"), Ok(due));
        for text in ["", "1,2,3", "1,2 3,4", "1,2,3 4,5,nan", "1,2,3 4,5,6 7,8,9"] {
            assert!(corners(text).unwrap_err().contains("must look like"), "{text}");
        }
        assert_eq!(corners("0,5,0 1,2,3").unwrap_err(), "the box has no extent along y: 5 is not less than 2");
        assert_eq!(counts("3x4x5"), Ok([3, 4, 5]));
        for (text, reason) in [
            ("1000x1000x1000", "at most 16777216 probes"),
            ("4294967295x4294967295x4294967295", "at most 16777216 probes"),
            ("0x1x1", "along every side"),
            ("2000x1x1", "at most 1024"),
            ("3x4", "must look like"),
        ] {
            assert!(counts(text).unwrap_err().contains(reason), "{text}");
        }
    }
}
