//! `fogbow render`.

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::path::{Path, PathBuf};

use fogbow::cache::{Kind, RadianceCaches};
use fogbow::covariance::image_sampling::Plan;
use fogbow::covariance::{CovarianceGrid, GridView};
use fogbow::host::Medium;
use fogbow::light::Lights;
use fogbow::math::Ray;
use fogbow::path::{self, InScattered, Radiance};
use fogbow::picture;
use fogbow::sampling::Generator;
use fogbow::spectrum::Spectrum;
use fogbow::vpl::VirtualLight;
use fogbow::world::World as LitWorld;
use fogbow_std::files;
use fogbow_std::film::Film;
use fogbow_std::image::write_film;
use fogbow_std::progress::{Control, Progress};
use fogbow_std::seed::SampleRng;
use fogbow_std::stats::{Counters, CountingMedium, CountingScene, Seconds};
use fogbow_std::threads::Threads;
use fogbow_std::tiles::{self, Outcome, Reason, RenderError, Sample};

use super::arguments::{Method, RenderArguments};
use super::choice::Choice;
use super::covariance::{GridJob, Stopped};
use super::film_file::{FilmFile, is_film};
use super::image_sampling::{self, Sight};
use super::keep::Keeper;
use super::march::{self, MarchJob};
use super::photon_beams::BeamJob;
use super::radiance_cache::{Audited, CacheJob};
use super::report::{Bar, Report};
use super::vpl::{self, Audit, VplJob};
use super::{Ending, Failure, bias_layers, ellipsoids, exposure, output};
use crate::camera::{Camera, Eye};
use crate::filter::FilterTable;
use crate::scene_file::SceneFile;
use crate::statistics::Statistics;
use crate::world::{LightAids, Storage, WithMedium, World};

/// Names of the layers; the first is the image.
pub(super) const LAYERS: [&str; 6] =
    ["total", "emitted", "surface_direct", "surface_indirect", "medium_single", "medium_multiple"];

/// The same for ray marching, with the number of steps.
const MARCH_LAYERS: [&str; 7] =
    ["total", "emitted", "surface_direct", "surface_indirect", "medium_single", "medium_multiple", "steps"];

/// The same for radiance caching, which knows light from surfaces apart.
pub(super) const CACHE_LAYERS: [&str; 7] =
    ["total", "emitted", "surface_direct", "surface_indirect", "medium_single", "medium_surface", "medium_multiple"];

/// The same for virtual lights, with what clamping leaves and compensation adds.
const VPL_LAYERS: [&str; 12] = {
    let mut layers = [""; 12];
    let mut i = 0;
    while i < 12 {
        layers[i] = if i < 6 { LAYERS[i] } else { vpl::OWN[i - 6] };
        i += 1;
    }
    layers
};

/// Set by Ctrl-C.
static STOP: AtomicBool = AtomicBool::new(false);

/// The flag that Ctrl-C sets from now on; the second time it ends the program.
pub(super) fn stop_flag() -> &'static AtomicBool {
    // A handler can be set once per process; without one, Ctrl-C still ends the program.
    drop(ctrlc::set_handler(|| {
        if STOP.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    }));
    &STOP
}

/// A finished render.
#[derive(Debug)]
pub(crate) struct Rendered {
    pub(crate) film: Film,
    pub(crate) choice: Choice,
    pub(crate) outcome: Outcome,
    pub(crate) statistics: Statistics,
    pub(crate) camera: Camera,
    /// Of radiance caching.
    pub(crate) caches: Option<RadianceCaches<'static>>,
    /// Of virtual lights, where it was asked for.
    pub(crate) audit: Option<Audit>,
    /// How far a picture from caches is off.
    pub(crate) audited: Option<Audited>,
    /// Sums, or what was filled, where a film was asked for.
    film_file: Option<FilmFile>,
}

pub(super) fn run(arguments: &RenderArguments) -> Result<Ending, Failure> {
    // Reading a scene takes a while, too.
    stop_flag();
    let (films, outputs): (Vec<_>, Vec<_>) = outputs(arguments)?.into_iter().partition(|file| is_film(file));
    let rendered = match render(arguments) {
        // Nothing has been rendered yet, and nothing is wrong.
        Err(error) if error.is::<Stopped>() => {
            say!("fogbow: {error}");
            return Ok(Ending::Stopped);
        }
        rendered => rendered?,
    };
    let Rendered { mut film, choice, outcome, mut statistics, audit, audited, film_file, .. } = rendered;
    if outcome.samples == 0 && outcome.reason == Reason::Cancelled {
        say!("fogbow: stopped before every pixel had a sample; no picture is written");
        return Ok(Ending::Stopped);
    }
    if !arguments.aov && film.layers().len() > 1 {
        film = film.first(1)?;
    }
    let outputs = output::not_over_better(outputs, outcome.reason == Reason::Cancelled);
    let write = |file: &Path| write_film(file, &film, arguments.exposure).map_err(|error| error.to_string());
    let (mut outputs, mut trouble) = statistics.time("write", || write_all(outputs, ("the picture", "exr"), write));
    let is_whole = outcome.reason != Reason::Cancelled;
    if let (Some(film_file), true) = (film_file, is_whole) {
        let what = if arguments.is_fill { "what was filled" } else { "the film" };
        let (written, more) = write_all(films, (what, "fogbow"), |file| film_file.write(file));
        outputs.extend(written);
        trouble.extend(more);
    }

    let size = (film.width(), film.height());
    let report = Report {
        arguments,
        choice: &choice,
        outputs: &outputs,
        outcome: &outcome,
        statistics: &statistics,
        size,
        audit,
        audited: audited.as_ref(),
    };
    if let Some(file) = &arguments.stats {
        files::write(file, report.json().as_bytes())?;
    }
    if !arguments.quiet {
        report.print();
        let is_png = |file: &PathBuf| file.extension().is_some_and(|e| e.eq_ignore_ascii_case("png"));
        let picture = film.mean(0).filter(|_| outputs.iter().any(is_png));
        if let Some(advice) = picture.and_then(|picture| exposure::advice(&picture, arguments.exposure)) {
            say!("{advice}");
        }
    }
    let bar = Bar::new(arguments.voice());
    outputs.iter().for_each(|file| bar.wrote(file));
    if !trouble.is_empty() {
        return Err(trouble.join("; ").into());
    }
    bar.ended(outcome.reason);
    Ok(if outcome.reason == Reason::Cancelled { Ending::Stopped } else { Ending::Done })
}

/// Writes something to every file that can be written; of the others, what went wrong. If none can, it goes elsewhere.
fn write_all(
    files: Vec<PathBuf>,
    (what, extension): (&str, &str),
    write: impl Fn(&Path) -> Result<(), String>,
) -> (Vec<PathBuf>, Vec<String>) {
    let (mut written, mut failed, mut trouble) = (Vec::new(), Vec::new(), Vec::new());
    for file in files {
        match write(&file) {
            Ok(()) => written.push(file),
            Err(error) => {
                trouble.push(error);
                failed.push(file);
            }
        }
    }
    if let (true, Some(file)) = (written.is_empty(), failed.last())
        && let Some(rescue) = output::rescue(file, extension, write)
    {
        trouble.push(format!("{what} is in {}", rescue.display()));
        written.push(rescue);
    }
    (written, trouble)
}

/// Renders; writes nothing.
pub(crate) fn render(arguments: &RenderArguments) -> Result<Rendered, Failure> {
    let mut statistics = Statistics::default();
    let mut scene = statistics.time("read", || arguments.scene.read(arguments.quiet))?;
    if let Some([origin, target]) = arguments.camera {
        scene = scene.seen_from(origin, target).map_err(|reason| format!("--camera: {reason}"))?;
    }
    let paths = path_settings(&scene, arguments.max_depth);
    if arguments.noise.is_some() && matches!(arguments.method, Some(Method::PhotonBeams | Method::Vpl)) {
        return Err(
            "--noise: the noise of photon beams and virtual lights is that of whole passes; use --spp or --time".into(),
        );
    }
    let mut storage = Storage::new(&scene);
    let world = statistics.time("build", || World::new(&scene, &mut storage))?;
    let choice = Choice::of(arguments, &paths, &world)?;
    let method = choice.method;
    arguments.check_given(method, choice.instead.as_deref())?;
    if arguments.is_fill && method != Method::RadianceCache && !arguments.needs_grid() {
        return Err(format!("--method {} fills nothing: parts of it need no fill", method.name()).into());
    }
    if arguments.method.is_none() && !arguments.quiet {
        say!("{}", choice.line());
    }
    let (width, height) = arguments.size.unwrap_or((scene.sensor.width, scene.sensor.height));
    let layers: &[&str] = match (arguments.aov, method) {
        (_, Method::Vpl) if arguments.is_audited() => &VPL_LAYERS,
        (false, _) if arguments.sampling.is_uniform() => &["total"],
        (_, Method::RadianceCache) => &CACHE_LAYERS,
        (false, _) => &LAYERS,
        (true, Method::Path | Method::PhotonBeams | Method::Vpl) => &LAYERS,
        (true, Method::March) => &MARCH_LAYERS,
    };
    let mut film = Film::new(width, height, layers)?;
    statistics.bytes.push(("film".to_owned(), film.bytes() as u64));
    statistics.bytes.push(("volumes".to_owned(), scene.media.iter().map(|m| m.bytes() as u64).sum()));
    statistics.bytes.push(("world".to_owned(), world.bytes() as u64));

    let bar = Bar::new(arguments.voice());
    let progress = |progress: &Progress| bar.show(progress, u64::from(width) * u64::from(height));
    let (samples, noise) = arguments.samples(method, scene.sensor.samples);
    arguments.check_part_of(method, samples, [width, height])?;
    let (tag, about) = arguments.about(method, &scene, samples, layers)?;
    let keeper = Keeper::new(&arguments.keep, ([width, height], tag, about), arguments.parts.fill.as_deref())?
        .for_film(arguments.wants_film());
    if keeper.is_asked() && arguments.time.is_some() && method == Method::RadianceCache {
        return Err(
            "--checkpoint: radiance caching with --time refines caches by the clock, and cannot be gone on with; \
                    leave --time out"
                .into(),
        );
    }
    let watch = |tiles: &tiles::Watched, is_last: bool| keeper.watch(tiles, is_last);
    let control =
        Control { cancel: Some(stop_flag()), progress: Some(&progress), watch: Some(&watch), resume: keeper.picture() };
    let settings = tiles::Settings {
        samples,
        goal: noise.map(|noise| tiles::Goal { noise: noise as f32, least: picture::LEAST_SAMPLES }),
        time: arguments.time.map(Duration::try_from_secs_f64).transpose()?,
        threads: arguments.threads,
        seed: arguments.seed,
        share: keeper.share(),
        ..tiles::Settings::default()
    };
    let lights = world.lights();
    // What other methods draw points by knows no shadows.
    let has_shafts = method == Method::RadianceCache;
    let aids = if has_shafts { LightAids::with_shadows(&lights, &world) } else { LightAids::new(&lights) };
    let lights = aids.view(&lights);
    let camera = world.camera_for(width, height);
    let filter = FilterTable::new(world.sensor().filter);
    let covariances = if arguments.needs_grid() {
        Some(world.media().with(GridJob {
            arguments: &arguments.covariance,
            scene: &arguments.scene,
            is_for_kernels: method == Method::PhotonBeams && arguments.sampling.is_uniform(),
            world: &world,
            lights,
            paths,
            threads: arguments.threads,
            seed: arguments.seed,
            control: &control,
            statistics: &mut statistics,
            keeper: Some(&keeper),
            is_fill: arguments.is_fill,
        })?)
    } else {
        None
    };
    let grid = covariances.as_ref().map(CovarianceGrid::view);
    let threads = Threads::new(arguments.threads)?;
    let plan = match grid {
        Some(grid) => {
            let sight = Sight { world: &world, lights, camera, grid };
            arguments.sampling.plan(sight, (width, height), &threads, &mut statistics)?
        }
        None => None,
    };
    let shot = Shot {
        world: &world,
        lights,
        camera,
        filter: &filter,
        paths,
        settings: &settings,
        grid: grid.as_ref(),
        plan: plan.as_ref(),
    };
    let (mut cached, mut audit) = (None, None);
    let nothing =
        Outcome { samples: 0, reason: Reason::Done, counters: Counters::default(), seconds: Seconds::default() };
    let outcome = match method {
        Method::PhotonBeams | Method::March | Method::Path | Method::Vpl if arguments.is_fill => nothing,
        Method::Path => world.media().with(Job { shot, control: &control, film: &mut film })?,
        Method::PhotonBeams => {
            world.media().with(BeamJob { shot, control: &control, film: &mut film, arguments: &arguments.beams })?
        }
        Method::Vpl => {
            let pass_samples = arguments.beams.pass_samples;
            let job = VplJob { shot, control: &control, film: &mut film, arguments: &arguments.vpl, pass_samples };
            let (outcome, settings) = world.media().with(job)?;
            let bytes = u64::from(settings.lights) * size_of::<VirtualLight>() as u64;
            statistics.bytes.push(("virtual lights".to_owned(), bytes));
            audit = arguments.is_audited().then(|| Audit::new(&film, settings.bound, &arguments.vpl));
            outcome
        }
        Method::March => {
            let baked = march::baked(&arguments.march, &arguments.scene, &paths, &world)?;
            world.media().with(MarchJob {
                shot,
                control: &control,
                film: &mut film,
                arguments: &arguments.march,
                baked,
            })?
        }
        Method::RadianceCache => {
            let done = world.media().with(CacheJob {
                world: &world,
                lights,
                camera,
                filter: &filter,
                paths,
                film: &mut film,
                settings: &settings,
                has_usual_goal: arguments.spp.is_none() && arguments.noise.is_none() && arguments.time.is_none(),
                control: &control,
                tell: &|stage, share| bar.tell(stage, share),
                keeper: Some(&keeper),
                is_fill: arguments.is_fill,
                is_part: arguments.parts.part.is_some(),
                arguments: &arguments.cache,
                plan: plan.as_ref(),
                tag: arguments.cache.tag(&arguments.scene, &paths)?,
            })?;
            let outcome = done.render;
            cached = Some(done);
            outcome
        }
    };
    bar.finish();
    if let Some(problem) = keeper.problem() {
        say!("fogbow: {problem}");
    }
    if plan.is_some() {
        keeper.needs_finishing("pixels are filled in (--image-sampling)");
    } else if arguments.aov && (grid.is_some() || method == Method::RadianceCache) {
        keeper.needs_finishing("some of its layers are drawn (--aov)");
    }
    let film_file = (arguments.is_fill || arguments.wants_film()).then(|| keeper.film(arguments.is_fill));
    if let Some(plan) = &plan {
        film = statistics.time("fill in", || image_sampling::finished(&film, plan, arguments.aov, &threads))?;
    }
    if let Some(grid) = grid.as_ref().filter(|_| arguments.aov) {
        film = statistics.time("draw ellipsoids", || ellipsoids::drawn(&film, grid, &camera, &world))?;
    }
    if let Some(cached) = &cached {
        cached.filled.iter().for_each(|(stage, seconds)| statistics.add(stage, *seconds));
        for (name, seconds) in ["read caches", "write caches"].into_iter().zip(cached.files) {
            statistics.add(name, seconds);
        }
        for kind in Kind::ALL {
            statistics.bytes.push((format!("cache {}", kind.name()), cached.caches.bytes(kind) as u64));
            statistics.records.push((kind.name().to_owned(), cached.caches.records(kind).len() as u64));
            if cached.caches.settings().effort(kind).is_some() {
                let coarser = cached.caches.settings().coarser[kind as usize];
                statistics.coarser.push((kind.name().to_owned(), coarser));
            }
        }
        statistics.records.push(("computed".to_owned(), cached.computed));
        statistics.record_noise = cached.record_noise;
        if let Some(audited) = cached.audited.as_ref().filter(|_| arguments.aov) {
            film = bias_layers::drawn(&film, &audited.map)?;
        }
    }
    statistics.add("render", outcome.seconds);
    statistics.counters = outcome.counters;
    let (caches, audited) = cached.map_or((None, None), |cached| (Some(cached.caches), cached.audited));
    Ok(Rendered { film, choice, outcome, statistics, camera, caches, audit, audited, film_file })
}

/// The files to write, all of them checked.
fn outputs(arguments: &RenderArguments) -> Result<Vec<PathBuf>, Failure> {
    let mut outputs = arguments.output.clone();
    if outputs.is_empty() {
        let stem = arguments.scene.file.file_stem().ok_or("the scene has no name")?;
        outputs = ["png", "exr"]
            .map(|extension| {
                let mut name = stem.to_owned();
                name.push(".");
                name.push(extension);
                PathBuf::from(name)
            })
            .into();
    }
    let check = |file: &PathBuf| if is_film(file) { output::check_place(file) } else { output::check(file) };
    outputs.iter().try_for_each(check)?;
    if arguments.is_fill && !outputs.iter().all(|file| is_film(file)) {
        return Err("a fill is no picture; -o FILL.fogbow takes it, for --fill".into());
    }
    arguments.check_part()?;
    if let Some(method) = arguments.method {
        arguments.check_given(method, None)?;
    }
    let has_layers = |file: &PathBuf| is_film(file) || file.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr"));
    if arguments.aov && !outputs.iter().any(has_layers) {
        return Err("--aov needs an .exr file to write to (-o FILE.exr)".into());
    }
    if let Some(file) = &arguments.stats {
        output::check_place(file)?;
    }
    let caches = &arguments.cache;
    caches.check()?;
    arguments.keep.check()?;
    arguments.vpl.check()?;
    arguments.covariance.check()?;
    if !arguments.exposure.is_finite() {
        return Err("--exposure must be a finite number".into());
    }
    Ok(outputs)
}

/// Mitsuba counts the segments of a path, the path tracer its scatterings.
pub(crate) fn path_settings(scene: &SceneFile, max_depth: Option<u32>) -> path::Settings {
    let depth = max_depth.or(scene.integrator.max_depth);
    path::Settings {
        max_scatterings: depth.map_or(u32::MAX, |d| d.saturating_sub(1)),
        roulette_after: scene.integrator.rr_depth,
        lights_visible: !scene.integrator.hide_emitters,
    }
}

/// What is rendered, from where and how: the same for most methods.
#[derive(Clone, Copy)]
pub(super) struct Shot<'a> {
    pub(super) world: &'a World<'a>,
    pub(super) lights: Lights<'a>,
    pub(super) camera: Camera,
    pub(super) filter: &'a FilterTable,
    pub(super) paths: path::Settings,
    pub(super) settings: &'a tiles::Settings,
    pub(super) grid: Option<&'a GridView<'a>>,
    pub(super) plan: Option<&'a Plan<'a>>,
}

impl Shot<'_> {
    /// The eye ray of a sample, where the film's filter wants it, of a film of this size, and how much what it sees counts.
    #[inline]
    pub(super) fn eye_ray(&self, sample: &Sample<'_>, (width, height): (u32, u32), rng: &mut SampleRng) -> (Ray, f32) {
        let eye = Eye { camera: self.camera, filter: self.filter };
        eye.ray([sample.x, sample.y], [width, height], rng)
    }

    /// Whether the medium's light is wanted at a pixel, or filled in from others.
    #[inline]
    pub(super) fn is_computed(&self, sample: &Sample<'_>, width: u32) -> bool {
        image_sampling::is_computed(self.plan, sample, width)
    }
}

/// A render by path tracing, to be done with a medium of any type.
struct Job<'a> {
    shot: Shot<'a>,
    control: &'a Control<'a>,
    film: &'a mut Film,
}

impl WithMedium for Job<'_> {
    type Output = Result<Outcome, RenderError>;

    fn with<M: Medium + Sync>(self, medium: &M) -> Self::Output {
        let shot = self.shot;
        let (width, height) = (self.film.width(), self.film.height());
        tiles::render(self.film, shot.settings, self.control, |sample, rng, layers| {
            let world = LitWorld {
                medium: &CountingMedium { medium, tally: sample.tally },
                scene: &CountingScene { scene: shot.world, tally: sample.tally },
                lights: shot.lights,
            };
            let (ray, weight) = shot.eye_ray(sample, (width, height), rng);
            let seen = if shot.is_computed(sample, width) {
                path::radiance(&ray, &world, &shot.paths, rng)
            } else {
                path::radiance_beyond(&ray, &world, &shot.paths, rng, |_: &Ray, _, _: &mut Generator| {
                    InScattered::default()
                })
            };
            sample.tally.collide(seen.collisions);
            write_layers(&seen, layers);
            weigh(layers, weight);
        })
    }
}

/// What was seen counts so much for its pixel.
#[inline]
pub(super) fn weigh(layers: &mut [Spectrum], weight: f32) {
    if weight != 1.0 {
        layers.iter_mut().for_each(|layer| *layer *= weight);
    }
}

/// What was seen, into [`LAYERS`] or the first of them alone.
pub(super) fn write_layers(seen: &Radiance, layers: &mut [Spectrum]) {
    let parts = [
        seen.total(),
        seen.emitted,
        seen.surface_direct,
        seen.surface_indirect,
        seen.medium_single,
        seen.medium_multiple,
    ];
    for (layer, part) in layers.iter_mut().zip(parts) {
        *layer = part;
    }
}
