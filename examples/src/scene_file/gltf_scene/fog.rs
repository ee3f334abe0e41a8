//! Fog beside a scene: a file in TOML.
//!
//! ```toml
//! [sky]
//! radiance = [0.4, 0.5, 0.7]        # or image = "sky.hdr"
//!
//! [sun]
//! from = [1, 2, 0.5]                # where it stands, as seen from the scene
//! irradiance = 3                    # on what faces it
//!
//! [[fog]]                           # even fog in the box of all surfaces
//! visibility = 200
//!
//! [[fog]]
//! shape = "box"                     # or "sphere", "height", "grid"
//! min = [-2, 0, -2]
//! max = [2, 3, 2]
//! visibility = 40                   # m; or extinction = 0.1 (1/m), a number or three
//! albedo = 0.95
//! g = 0.6
//!
//! [[fog]]
//! shape = "grid"
//! file = "cloud.nvdb"               # or .vdb, .vol
//! grid = "density"
//! extinction = 20                   # where density is 1
//! ```

use std::path::Path;
use std::sync::Arc;

use fogbow::math::{Bounds, Vec3};
use fogbow::phase::{Lobe, Phase};
use fogbow::spectrum::Spectrum;
use serde::Deserialize;
use serde::de::{DeserializeOwned, IntoDeserializer};
use toml::Spanned;
use toml::de::{DeString, DeTable, DeValue};

use crate::error::{SceneError, read_file};
use crate::picture::Picture;
use crate::scene_file::description::{Container, Emitter, Matter, MediumDescription, Place, SceneFile};
use crate::scene_file::notes::Sink;
use crate::scene_file::plugin::suggestion;
use crate::transform::{Transform, normalized, to_array, to_vec3};
use crate::vdb;
use crate::volume::{Values, Volume};
use crate::world::bounds_of;

/// All of a file, as far as it can be.
#[derive(Debug, Default)]
struct FogFile {
    sky: Option<Sky>,
    sun: Option<Sun>,
    /// With their lines and numbers.
    fog: Vec<(u32, usize, Fog)>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Sky {
    radiance: Option<Colour>,
    image: Option<String>,
}

/// Parallel light.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Sun {
    from: Option<[f64; 3]>,
    irradiance: Option<Colour>,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Form {
    #[default]
    Box,
    Sphere,
    Height,
    Grid,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(untagged, expecting = "must be a number, or three in brackets")]
enum Colour {
    Grey(f32),
    Three([f32; 3]),
}

impl Colour {
    fn spectrum(self) -> Spectrum {
        match self {
            Self::Grey(value) => Spectrum::splat(value),
            Self::Three(values) => Spectrum(values),
        }
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Fog {
    #[serde(default)]
    shape: Form,
    min: Option<[f64; 3]>,
    max: Option<[f64; 3]>,
    centre: Option<[f64; 3]>,
    radius: Option<f64>,
    /// Height (m) at which fog has its extinction, and the height over which it falls to 1/e of that.
    ground: Option<f64>,
    fall_off: Option<f64>,
    file: Option<String>,
    grid: Option<String>,
    /// Of grids, in this order.
    scale: Option<f64>,
    rotate: Option<Rotation>,
    translate: Option<[f64; 3]>,
    extinction: Option<Colour>,
    visibility: Option<f32>,
    albedo: Option<Colour>,
    g: Option<f32>,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct Rotation {
    axis: [f64; 3],
    degrees: f64,
}

/// Contrast at which a black thing is still told from the sky, −ln of it: Koschmieder's 2 %.
const VISIBLE: f32 = 3.912;

/// Cells of the grid that height fog is made of: between their centres it is off by (1/128)²/8 at most where it falls to 1/e over half of
/// its height.
const LAYERS: u32 = 256;

/// What tells of mistakes in a file of fog: all of them, each with its line.
struct Reader<'a> {
    file: &'a Path,
    text: &'a str,
    sink: &'a Sink,
}

impl Reader<'_> {
    fn line_of(&self, at: usize) -> u32 {
        self.text.as_bytes().iter().take(at).filter(|byte| **byte == b'\n').count() as u32 + 1
    }

    fn error(&self, line: impl Into<Option<u32>>, element: &str, reason: impl Into<String>) {
        self.sink.error(SceneError {
            file: self.file.to_owned(),
            line: line.into(),
            element: element.to_owned(),
            reason: reason.into(),
            ..SceneError::default()
        });
    }

    /// What a table holds, key by key, so that one mistake hides no other: all of `T` is optional.
    fn table<T: DeserializeOwned>(&self, element: &str, value: Spanned<DeValue<'_>>) -> Option<T> {
        let (span, line) = (value.span(), self.line_of(value.span().start));
        let DeValue::Table(table) = value.into_inner() else {
            self.error(line, element, "must be a table");
            return None;
        };
        let read = |table: DeTable<'_>| T::deserialize(Spanned::new(span.clone(), table).into_deserializer());
        let mut is_good = true;
        for (key, value) in in_order(&table) {
            let one = DeTable::from_iter([(key.clone(), value.clone())]);
            if let Err(e) = read(one) {
                // Of what is unknown the words name all that is known.
                let known = e.message().split('`').skip(3).step_by(2);
                let near = suggestion(key.get_ref(), known);
                let at = e.span().map_or(key.span().start, |span| span.start);
                self.error(self.line_of(at), element, format!("{}{near}", e.message().trim_end()));
                is_good = false;
            }
        }
        is_good.then(|| read(table)).and_then(Result::ok)
    }

    fn all(&self) -> FogFile {
        let mut fog = FogFile::default();
        let (whole, errors) = DeTable::parse_recoverable(self.text);
        for e in &errors {
            self.error(e.span().map(|span| self.line_of(span.start)), "", e.message());
        }
        if !errors.is_empty() {
            return fog;
        }
        for (key, value) in in_order(whole.get_ref()) {
            let line = self.line_of(key.span().start);
            match key.get_ref().as_ref() {
                "sky" => fog.sky = self.table("[sky]", value.clone()),
                "sun" => fog.sun = self.table("[sun]", value.clone()),
                "fog" => {
                    let DeValue::Array(each) = value.get_ref() else {
                        self.error(line, "", "\"fog\" must be a list of tables: [[fog]]");
                        continue;
                    };
                    for (number, one) in each.iter().enumerate() {
                        let line = self.line_of(one.span().start);
                        fog.fog.extend(self.table(&element_of(number), one.clone()).map(|one| (line, number, one)));
                    }
                }
                other => {
                    let near = suggestion(other, ["sky", "sun", "fog"].into_iter());
                    self.error(line, "", format!("nothing is called \"{other}\" here{near}"));
                }
            }
        }
        fog
    }
}

/// What a table holds, as it is written.
fn in_order<'t, 'i>(
    table: &'t DeTable<'i>,
) -> impl Iterator<Item = (&'t Spanned<DeString<'i>>, &'t Spanned<DeValue<'i>>)> {
    let mut all: Vec<_> = table.iter().collect();
    all.sort_by_key(|(key, _)| key.span().start);
    all.into_iter()
}

fn element_of(number: usize) -> String {
    format!("[[fog]] {}", number + 1)
}

/// Reads a file of fog, and adds what is in it to a scene. A file that is missing, is no TOML, or says something that cannot be is an error.
pub(super) fn read(sink: &Sink, file: &Path, scene: &mut SceneFile) {
    let text = read_file(file).map_err(|e| e.reason);
    let text = text.and_then(|bytes| String::from_utf8(bytes).map_err(|e| format!("is not UTF-8 text: {e}")));
    let reader = |text| Reader { file, text, sink };
    let text = match text {
        Ok(text) => text,
        Err(reason) => return reader("").error(None, "", reason),
    };
    let reader = reader(&text);
    let fog = reader.all();
    let mut add = |element: &str, emitter: Result<Emitter, String>| match emitter {
        Ok(emitter) => scene.emitters.push(emitter),
        Err(reason) => reader.error(None, element, reason),
    };
    if let Some(sky) = fog.sky {
        add("[sky]", read_sky(file, &sky));
    }
    if let Some(sun) = fog.sun {
        add("[sun]", read_sun(&sun));
    }
    let around = scene.shapes.iter().map(|shape| bounds_of(&shape.geometry)).fold(Bounds::EMPTY, Bounds::union);
    for (line, number, one) in &fog.fog {
        let (matter, container) = match medium(file, one, around) {
            Ok(found) => found,
            Err(reason) => {
                reader.error(*line, &element_of(*number), reason);
                continue;
            }
        };
        let places = vec![Place { container, holes: Vec::new() }];
        scene.media.push(MediumDescription {
            id: format!("fog {}", number + 1),
            matter,
            places,
            limits: None,
            glow: Spectrum::ZERO,
            heat: None,
        });
    }
}

/// Hands out the bytes of all files that a file of fog names, as far as they can be read.
pub(super) fn each_file(file: &Path, each: &mut impl FnMut(&[u8])) {
    let text = read_file(file).ok().and_then(|bytes| String::from_utf8(bytes).ok()).unwrap_or_default();
    let fog = Reader { file, text: &text, sink: &Sink::default() }.all();
    let named = fog.fog.iter().filter_map(|(_, _, fog)| fog.file.as_ref());
    for name in named.chain(fog.sky.iter().filter_map(|sky| sky.image.as_ref())) {
        if let Ok(bytes) = read_file(&beside(file, name)) {
            each(&bytes);
        }
    }
}

fn beside(file: &Path, name: &str) -> std::path::PathBuf {
    file.parent().unwrap_or("".as_ref()).join(name)
}

fn read_sun(sun: &Sun) -> Result<Emitter, String> {
    let (Some(from), Some(irradiance)) = (sun.from, sun.irradiance) else {
        return Err("needs \"from\" and \"irradiance\"".to_owned());
    };
    let direction = normalized(from.map(|c| -c)).ok_or("\"from\" has no direction")?;
    let irradiance = irradiance.spectrum();
    if !irradiance.is_valid() {
        return Err("\"irradiance\" is negative or not finite".to_owned());
    }
    Ok(Emitter::Directional { direction, irradiance })
}

fn read_sky(file: &Path, sky: &Sky) -> Result<Emitter, String> {
    match (&sky.radiance, &sky.image) {
        (Some(radiance), None) => {
            let radiance = radiance.spectrum();
            if !radiance.is_valid() {
                return Err("\"radiance\" is negative or not finite".to_owned());
            }
            Ok(Emitter::Constant { radiance })
        }
        (None, Some(image)) => {
            let picture = Picture::read(&beside(file, image)).map_err(|e| e.to_string())?;
            let is_usable = |p: &[f32; 3]| p.iter().all(|c| c.is_finite() && *c >= 0.0);
            if picture.width < 2 || picture.height < 2 || !picture.pixels.iter().all(is_usable) {
                return Err(format!("\"{image}\" needs at least 2 x 2 pixels, none of them negative or not finite"));
            }
            Ok(Emitter::Environment { picture, to_world: Transform::IDENTITY })
        }
        _ => Err("needs \"radiance\" or \"image\", and not both".to_owned()),
    }
}

/// `around` is the box of all surfaces.
fn medium(file: &Path, fog: &Fog, around: Bounds) -> Result<(Matter, Container), String> {
    check_names(fog)?;
    let extinction = match (fog.extinction, fog.visibility) {
        (Some(extinction), None) => extinction.spectrum(),
        (None, Some(visibility)) => Spectrum::splat(VISIBLE / visibility),
        (None, None) if fog.shape == Form::Grid => Spectrum::ONE,
        _ => return Err("needs \"extinction\" or \"visibility\", and not both".to_owned()),
    };
    let albedo = fog.albedo.map_or(Spectrum::ONE, Colour::spectrum);
    if !extinction.is_valid() {
        return Err("its extinction is negative or not finite".to_owned());
    }
    if !albedo.0.iter().all(|c| (0.0..=1.0).contains(c)) {
        return Err("\"albedo\" is outside [0, 1]".to_owned());
    }
    let scattering = extinction * albedo;
    let absorption = (extinction - scattering).max(Spectrum::ZERO);
    let phase = match fog.g {
        None => Phase::ISOTROPIC,
        Some(g) => Phase::from(Lobe::HenyeyGreenstein { g }.check().map_err(|e| e.to_string())?),
    };
    match fog.shape {
        Form::Box => Ok((Matter::Homogeneous { absorption, scattering, phase }, cube(corners(fog, Some(around))?))),
        Form::Sphere => {
            let centre = fog.centre.ok_or("a sphere needs \"centre\"")?;
            let radius = fog.radius.ok_or("a sphere needs \"radius\"")?;
            if !(radius > 1e-18 && radius < 1e18 && centre.iter().all(|c| c.abs() < 1e18)) {
                return Err("its radius must be greater than 0, and all of it within reach".to_owned());
            }
            Ok((Matter::Homogeneous { absorption, scattering, phase }, Container::Sphere { centre, radius }))
        }
        Form::Height => {
            let [low, high] = corners(fog, Some(around))?;
            let ground = fog.ground.unwrap_or(low[1]);
            let fall_off = fog.fall_off.ok_or("height fog needs \"fall_off\"")?;
            if !(fall_off > 0.0 && fall_off.is_finite() && ground.is_finite()) {
                return Err("\"fall_off\" must be greater than 0".to_owned());
            }
            let layer = |i: u32| {
                let height = low[1] + (high[1] - low[1]) * (f64::from(i) + 0.5) / f64::from(LAYERS);
                (-((height - ground) / fall_off).max(0.0)).exp() as f32
            };
            let values = Values::F32((0..LAYERS).map(layer).collect());
            let volume = Arc::new(Volume { size: [1, LAYERS, 1], values });
            let to_world = Transform::scaling([0, 1, 2].map(|i| high[i] - low[i])).then(&Transform::translation(low));
            Ok((Matter::Grid { volume, to_world, absorption, scattering, phase }, cube([low, high])))
        }
        Form::Grid => {
            let name = fog.file.as_ref().ok_or("a grid needs \"file\"")?;
            let path = beside(file, name);
            let is_boxed = fog.min.is_some() || fog.max.is_some();
            // From the unit cube to the place that was named.
            let into_box = || -> Result<Transform, String> {
                let [low, high] = corners(fog, None)?;
                Ok(Transform::scaling([0, 1, 2].map(|i| high[i] - low[i])).then(&Transform::translation(low)))
            };
            let moved = moved(fog)?;
            if vdb::is_named(&path) {
                let bricks = vdb::Grid::read(&path, fog.grid.as_deref()).and_then(|grid| grid.into_bricks(&path));
                let bricks = bricks.map_err(|e| e.to_string())?;
                let place = if is_boxed { bricks.in_active_box().then(&into_box()?) } else { *bricks.in_file() };
                let to_world = place.then(&moved);
                check_place(&to_world)?;
                let matter = Matter::Sparse { bricks: Arc::new(bricks), to_world, absorption, scattering, phase };
                return Ok((matter, just_around(&to_world)));
            }
            if fog.grid.is_some() {
                return Err("\"grid\" names a grid of a .vdb or .nvdb file".to_owned());
            }
            let volume = Volume::read(&path).map_err(|e| e.to_string())?;
            let to_world = into_box()?.then(&moved);
            check_place(&to_world)?;
            let matter = Matter::Grid { volume: Arc::new(volume), to_world, absorption, scattering, phase };
            Ok((matter, just_around(&to_world)))
        }
    }
}

/// What a form has no use for is a mistake.
fn check_names(fog: &Fog) -> Result<(), String> {
    use Form::{Box, Grid, Height, Sphere};
    let given: [(&str, bool, &[Form]); 11] = [
        ("min", fog.min.is_some(), &[Box, Height, Grid]),
        ("max", fog.max.is_some(), &[Box, Height, Grid]),
        ("centre", fog.centre.is_some(), &[Sphere]),
        ("radius", fog.radius.is_some(), &[Sphere]),
        ("ground", fog.ground.is_some(), &[Height]),
        ("fall_off", fog.fall_off.is_some(), &[Height]),
        ("file", fog.file.is_some(), &[Grid]),
        ("grid", fog.grid.is_some(), &[Grid]),
        ("scale", fog.scale.is_some(), &[Grid]),
        ("rotate", fog.rotate.is_some(), &[Grid]),
        ("translate", fog.translate.is_some(), &[Grid]),
    ];
    let is_idle = |(_, is_given, forms): &&(&str, bool, &[Form])| *is_given && !forms.contains(&fog.shape);
    let idle: Vec<_> = given.iter().filter(is_idle).map(|(name, ..)| format!("\"{name}\"")).collect();
    match idle[..] {
        [] => Ok(()),
        [ref name] => Err(format!("{name} has no meaning for this shape")),
        _ => Err(format!("{} have no meaning for this shape", idle.join(", "))),
    }
}

/// Both corners of a box, those of `around` where none is named.
fn corners(fog: &Fog, around: Option<Bounds>) -> Result<[[f64; 3]; 2], String> {
    // Fog begins beyond outer walls, not in them.
    let around = around.filter(|b| b.size().is_finite() && b.size().min_element() > 0.0).map(|b| {
        let room = 1e-3 * b.size().max_element();
        [b.min - Vec3::splat(room), b.max + Vec3::splat(room)].map(to_array)
    });
    let low = fog.min.or(around.map(|b| b[0])).ok_or("needs \"min\"")?;
    let high = fog.max.or(around.map(|b| b[1])).ok_or("needs \"max\"")?;
    let is_box = (0..3).all(|i| low[i] < high[i] && low[i] > -1e18 && high[i] < 1e18);
    if is_box { Ok([low, high]) } else { Err(format!("\"max\" {high:?} must be greater than \"min\" {low:?}")) }
}

/// A box as a container.
fn cube([low, high]: [[f64; 3]; 2]) -> Container {
    let half = [0, 1, 2].map(|i| 0.5 * (high[i] - low[i]));
    let middle = [0, 1, 2].map(|i| 0.5 * (high[i] + low[i]));
    Container::Cube(Transform::scaling(half).then(&Transform::translation(middle)))
}

/// How a grid is moved from where it would stand.
fn moved(fog: &Fog) -> Result<Transform, String> {
    let scaled = Transform::scaling([fog.scale.unwrap_or(1.0); 3]);
    let turned = match fog.rotate {
        Some(Rotation { axis, degrees }) => {
            Transform::rotation(axis, degrees).ok_or("\"rotate\": the axis has no length")?
        }
        None => Transform::IDENTITY,
    };
    Ok(scaled.then(&turned).then(&Transform::translation(fog.translate.unwrap_or_default())))
}

fn check_place(to_world: &Transform) -> Result<(), String> {
    if to_world.is_regular() { Ok(()) } else { Err("its place is no volume".to_owned()) }
}

/// A container just around the image of the unit cube: a grid ends by itself.
fn just_around(to_world: &Transform) -> Container {
    const ROOM: f64 = 0.5 + 1e-6;
    let unit = Transform::scaling([ROOM; 3]).then(&Transform::translation([0.5; 3]));
    Container::Cube(unit.then(to_world))
}

/// The smallest boxes around the places of a medium.
pub(super) fn bounds(medium: &MediumDescription) -> impl Iterator<Item = Bounds> + '_ {
    medium.places.iter().map(|place| {
        let [low, high] = place.container.bounds();
        Bounds { min: to_vec3(low), max: to_vec3(high) }
    })
}
