//! `fogbow records`: where the records of radiance caches lie (as Figs. 7, 8 and 10c of Jarosz et al. 2008).

use std::path::PathBuf;

use clap::Args;
use fogbow::cache::{RadianceCaches, Record};
use fogbow::host::Scene;
use fogbow::math::{Ray, Vec2, Vec3};
use fogbow::spectrum::Spectrum;
use fogbow_std::film::{Film, Image};
use fogbow_std::image::{Layer, write};
use fogbow_std::progress::{Control, Progress};
use fogbow_std::tiles;

use super::radiance_cache::{CacheArguments, CacheJob, Kind};
use super::render::path_settings;
use super::report::{Bar, Voice};
use super::scene::SceneArguments;
use super::{Ending, Failure, output};
use crate::camera::Camera;
use crate::filter::FilterTable;
use crate::world::{LightAids, Storage, World};

/// Draws where the records of radiance caches lie.
#[derive(Debug, Args)]
pub struct RecordsArguments {
    /// The scene.
    #[command(flatten)]
    pub scene: SceneArguments,
    /// Cache to draw; may be repeated [default: all].
    #[arg(long, value_name = "CACHE", value_enum)]
    pub kind: Vec<Kind>,
    /// Draws spheres of validity cut by a horizontal plane, seen from above, instead of points seen by the camera.
    #[arg(long)]
    pub section: bool,
    /// Height of that plane [default: the camera's].
    #[arg(long, value_name = "Y", requires = "section", allow_negative_numbers = true, value_parser = output::finite)]
    pub height: Option<f32>,
    /// Draws over black and not over the darkened picture.
    #[arg(long, conflicts_with = "section")]
    pub black: bool,
    /// Samples per pixel of that picture.
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..))]
    pub spp: u32,
    /// Diameter of points, in pixels.
    #[arg(long, value_name = "PIXELS", default_value_t = 3.0, value_parser = output::positive)]
    pub dot: f64,
    /// As in `render`.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub max_depth: Option<u32>,
    /// Threads; 0 is one per processor.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub threads: usize,
    /// Chooses other random numbers.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Size of the image [default: what the scene says]. Records are made for an image of this size.
    #[arg(long, value_name = "WxH", value_parser = output::size)]
    pub size: Option<(u32, u32)>,
    /// As in `render`.
    #[arg(long, value_name = "ORIGIN TARGET", value_parser = output::camera, allow_hyphen_values = true)]
    pub camera: Option<[[f64; 3]; 2]>,
    /// Image to write: .png, .exr or .pfm.
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Stops by which the picture is brightened.
    #[arg(long, value_name = "STOPS", default_value_t = 0.0, allow_negative_numbers = true, value_parser = output::finite)]
    pub exposure: f32,
    /// No progress bar and no summary.
    #[arg(short, long)]
    pub quiet: bool,
    /// Of radiance caching.
    #[command(flatten)]
    pub cache: CacheArguments,
}

/// Kinds, in the order in which they are drawn, and their colours.
const KINDS: [(Kind, Spectrum); 4] = [
    (Kind::Irradiance, Spectrum::new(1.0, 0.12, 0.03)),
    (Kind::Surface, Spectrum::new(0.05, 0.75, 0.12)),
    (Kind::Multiple, Spectrum::new(0.1, 0.35, 1.0)),
    (Kind::Single, Spectrum::new(1.0, 0.7, 0.05)),
];

pub(super) fn run(arguments: &RecordsArguments) -> Result<Ending, Failure> {
    output::check(&arguments.output)?;
    arguments.cache.check()?;
    let mut scene = arguments.scene.read(arguments.quiet)?;
    if let Some([origin, target]) = arguments.camera {
        scene = scene.seen_from(origin, target).map_err(|reason| format!("--camera: {reason}"))?;
    }
    let mut storage = Storage::new(&scene);
    let world = World::new(&scene, &mut storage)?;
    let (width, height) = arguments.size.unwrap_or((scene.sensor.width, scene.sensor.height));
    let camera = world.camera_for(width, height);
    let filter = FilterTable::new(world.sensor().filter);
    let lights = world.lights();
    let aids = LightAids::with_shadows(&lights, &world);
    let mut film = Film::new(width, height, &["total"])?;
    let bar = Bar::new(Voice::unless(arguments.quiet));
    let progress = |progress: &Progress| bar.show(progress, u64::from(width) * u64::from(height));
    let control = Control { progress: Some(&progress), ..Control::default() };
    let is_plain = arguments.section || arguments.black;
    let settings = tiles::Settings {
        samples: if is_plain { 1 } else { arguments.spp },
        threads: arguments.threads,
        seed: arguments.seed,
        ..tiles::Settings::default()
    };
    let paths = path_settings(&scene, arguments.max_depth);
    let cached = world.media().with(CacheJob {
        world: &world,
        lights: aids.view(&lights),
        filter: &filter,
        camera,
        paths,
        film: &mut film,
        settings: &settings,
        has_usual_goal: false,
        control: &control,
        tell: &|stage, share| bar.tell(stage, share),
        keeper: None,
        is_fill: false,
        is_part: false,
        arguments: &arguments.cache,
        plan: None,
        tag: arguments.cache.tag(&arguments.scene, &paths)?,
    })?;
    bar.finish();
    let kinds = KINDS.iter().filter(|(kind, _)| arguments.kind.is_empty() || arguments.kind.contains(kind));
    let shown: Vec<Shown<'_>> =
        kinds.map(|&(kind, colour)| Shown { kind, colour, records: records(&cached.caches, kind) }).collect();
    let (canvas, counts) = if arguments.section {
        let plane = arguments.height.unwrap_or(camera.position().y);
        section(&shown, &world, &camera, plane, arguments.size, width.max(height))?
    } else {
        let picture = film.mean(0).filter(|_| !is_plain);
        seen(&shown, &world, &camera, (width, height), picture, arguments)?
    };
    write(&arguments.output, &[Layer { name: "records", image: &canvas.image }], 0.0)?;
    if !arguments.quiet {
        for (shown, drawn) in shown.iter().zip(counts) {
            say!("{:?}: {} records, {drawn} drawn", shown.kind, shown.records.len());
        }
        say!("wrote {}", arguments.output.display());
    }
    Ok(Ending::Done)
}

/// The records of one kind.
struct Shown<'a> {
    kind: Kind,
    colour: Spectrum,
    records: &'a [Record],
}

fn records<'a>(caches: &'a RadianceCaches<'_>, kind: Kind) -> &'a [Record] {
    caches.records(kind.into())
}

/// The picture, darkened, with a disc for every record that no surface hides.
fn seen(
    shown: &[Shown<'_>],
    world: &World<'_>,
    camera: &Camera,
    (width, height): (u32, u32),
    picture: Option<Image>,
    arguments: &RecordsArguments,
) -> Result<(Canvas, Vec<usize>), Failure> {
    let mut canvas = Canvas { image: Image::new(width, height, Spectrum::ZERO)? };
    if let Some(picture) = picture {
        let scale = arguments.exposure.exp2();
        canvas.image = picture;
        for pixel in &mut canvas.image.pixels {
            // What would be white becomes a dark grey, so that points stand out everywhere.
            *pixel = pixel.map(|c| 0.12 * (scale * c).clamp(0.0, 1.0));
        }
    }
    let size = Vec2::new(width as f32, height as f32);
    let eye = camera.position();
    let mut counts = Vec::new();
    for Shown { colour, records, .. } in shown {
        let mut drawn = 0;
        for record in *records {
            let Some(film) = camera.project(record.position) else { continue };
            let towards = record.position - eye;
            let distance = towards.length();
            // Records on surfaces lie behind the surface by rounding.
            let ray = Ray { origin: eye, direction: towards / distance, length: 0.999 * distance };
            if film.min_element() >= 0.0 && film.max_element() < 1.0 && !world.is_blocked(&ray) {
                canvas.disc(film * size, 0.5 * arguments.dot as f32, *colour, 0.9);
                drawn += 1;
            }
        }
        counts.push(drawn);
    }
    Ok((canvas, counts))
}

/// Circles where the spheres of validity meet a horizontal plane, a dot in each; walls in grey; the camera as
/// a wedge. The camera looks up the picture.
fn section(
    shown: &[Shown<'_>],
    world: &World<'_>,
    camera: &Camera,
    plane: f32,
    size: Option<(u32, u32)>,
    longest: u32,
) -> Result<(Canvas, Vec<usize>), Failure> {
    let cut = |record: &&Record| (record.position.y - plane).abs() < record.radius;
    let forward = camera.forward();
    // A quarter turn at a time, so that walls stay straight.
    let up = match forward.x.abs() > forward.z.abs() {
        true => Vec2::new(forward.x.signum(), 0.0),
        false => Vec2::new(0.0, forward.z.signum()),
    };
    let right = Vec2::new(-up.y, up.x);
    let flat = |p: Vec3| Vec2::new(Vec2::new(p.x, p.z).dot(right), -Vec2::new(p.x, p.z).dot(up));
    let mut low = flat(camera.position());
    let mut high = low;
    for record in shown.iter().flat_map(|s| s.records).filter(cut) {
        low = low.min(flat(record.position));
        high = high.max(flat(record.position));
    }
    let room = 0.03 * (high - low).max_element().max(1e-3);
    let (low, high) = (low - room, high + room);
    let extent = high - low;
    let (width, height) = size.unwrap_or_else(|| {
        let pixels = (extent * (longest as f32 / extent.max_element())).ceil().max(Vec2::ONE);
        (pixels.x as u32, pixels.y as u32)
    });
    let film = Vec2::new(width as f32, height as f32);
    let scale = (film / extent).min_element();
    let middle = 0.5 * (low + high);
    let place = |p: Vec2| 0.5 * film + (p - middle) * scale;
    let back = |pixel: Vec2| {
        let p = middle + (pixel - 0.5 * film) / scale;
        let ground = right * p.x - up * p.y;
        Vec3::new(ground.x, plane, ground.y)
    };

    let mut canvas = Canvas { image: Image::new(width, height, Spectrum::ZERO)? };
    for y in 0..height {
        for x in 0..width {
            let at = Vec2::new(x as f32, y as f32) + 0.5;
            let is_wall = [Vec2::X, Vec2::Y].iter().any(|step| {
                let (from, to) = (back(at - 0.5 * *step), back(at + 0.5 * *step));
                let ray = Ray { origin: from, direction: (to - from).normalize_or_zero(), length: from.distance(to) };
                ray.length > 0.0 && world.is_blocked(&ray)
            });
            if is_wall {
                canvas.blend(x, y, Spectrum::splat(0.35), 1.0);
            }
        }
    }
    let mut counts = Vec::new();
    for Shown { colour, records, .. } in shown {
        let mut drawn = 0;
        for record in records.iter().filter(cut) {
            let height = record.position.y - plane;
            let radius = (record.radius * record.radius - height * height).max(0.0).sqrt();
            let centre = place(flat(record.position));
            canvas.ring(centre, radius * scale, *colour, 0.45);
            canvas.disc(centre, 0.9, *colour, 1.0);
            drawn += 1;
        }
        counts.push(drawn);
    }
    let eye = place(flat(camera.position()));
    let ahead = Vec2::new(Vec2::new(forward.x, forward.z).dot(right), -Vec2::new(forward.x, forward.z).dot(up));
    for step in 0..24_u32 {
        for side in [-0.5_f32, 0.5] {
            let at = eye + Vec2::from_angle(side).rotate(ahead.normalize_or_zero()) * step as f32 * 0.6;
            canvas.disc(at, 0.8, Spectrum::ONE, 1.0);
        }
    }
    Ok((canvas, counts))
}

/// A picture to draw on, in pixels from the upper left corner.
struct Canvas {
    image: Image,
}

impl Canvas {
    fn blend(&mut self, x: u32, y: u32, colour: Spectrum, share: f32) {
        let index = y as usize * self.image.width as usize + x as usize;
        if let Some(pixel) = self.image.pixels.get_mut(index) {
            *pixel = *pixel * (1.0 - share) + colour * share;
        }
    }

    /// Blends every pixel around `centre` by its cover, a function of its distance from there.
    fn around(&mut self, centre: Vec2, reach: f32, colour: Spectrum, cover: impl Fn(f32) -> f32) {
        let last = Vec2::new(self.image.width as f32, self.image.height as f32) - 1.0;
        let (low, high) = ((centre - reach).floor().max(Vec2::ZERO), (centre + reach).ceil().min(last));
        if !(low.cmple(high).all()) {
            return;
        }
        for y in low.y as u32..=high.y as u32 {
            for x in low.x as u32..=high.x as u32 {
                let share = cover((Vec2::new(x as f32, y as f32) + 0.5).distance(centre));
                if share > 0.0 {
                    self.blend(x, y, colour, share);
                }
            }
        }
    }

    fn disc(&mut self, centre: Vec2, radius: f32, colour: Spectrum, opacity: f32) {
        self.around(centre, radius + 1.0, colour, |d| opacity * (radius + 0.5 - d).clamp(0.0, 1.0));
    }

    fn ring(&mut self, centre: Vec2, radius: f32, colour: Spectrum, opacity: f32) {
        self.around(centre, radius + 1.0, colour, |d| opacity * (1.0 - (d - radius).abs()).clamp(0.0, 1.0));
    }
}
