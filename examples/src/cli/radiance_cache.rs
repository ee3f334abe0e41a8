//! `fogbow render` by radiance caching.

use std::path::PathBuf;
use std::time::Duration;

use clap::{Arg, Args, ValueEnum};
use fogbow::bytes::{Crc, Damage};
use fogbow::cache::{
    self, Asked, Audit, BiasMap, CachedRadiance, CachesError, Deviation, Extrapolation, Filling, Findings,
    RadianceCaches, RaySettings,
};
use fogbow::covariance::image_sampling::Plan;
use fogbow::host::Medium;
use fogbow::light::{Light, Lights};
use fogbow::math::{Ray, Vec2};
use fogbow::path;
use fogbow::sampling::{Generator, uniform2};
use fogbow::sh;
use fogbow::spectrum::Spectrum;
use fogbow::work::Rounds;
use fogbow::world::{Outline, World as LitWorld};
use fogbow_std::files::{self, Problem};
use fogbow_std::film::Film;
use fogbow_std::progress::Control;
use fogbow_std::stats::{Counters, CountingMedium, CountingScene, Seconds, Stopwatch};
use fogbow_std::threads::{self, Ending, Threads};
use fogbow_std::tiles::{self, Outcome};

use super::covariance::Stopped;
use super::defaults::{unit_outline, with_default};
use super::film_file::Measured;
use super::image_sampling::is_computed;
use super::keep::Keeper;
use super::render::weigh;
use super::scene::SceneArguments;
use super::{Failure, output};
use crate::camera::{Camera, Eye};
use crate::error::SceneError;
use crate::filter::FilterTable;
use crate::glare::{Glares, TwoPlaces};
use crate::world::{WithMedium, World};

mod levels;

/// Rays of a sample that see lamps, besides that which sees all. More: time; fewer: noise at the edges of lamps.
const STRAIGHT: u32 = 4;

/// Multiples of the plastic numbers, wrapped, fill a square evenly.
const EVEN: Vec2 = Vec2::new(0.754_877_67, 0.569_840_3);

/// Of `--method radiance-cache`.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Radiance caching", mut_args(told))]
pub struct CacheArguments {
    /// Relative error that the picture may have, noise and bias together: tolerances, walks and samples follow from it.
    #[arg(long, value_name = "E", value_parser = error_asked)]
    pub error: Option<f32>,
    /// Error tolerance of all caches: smaller is finer and slower.
    #[arg(long, value_name = "E", value_parser = output::positive)]
    pub tolerance: Option<f64>,
    /// Error tolerance of one cache, as CACHE=E; may be repeated.
    #[arg(long, value_name = "CACHE=E", value_parser = named)]
    pub tolerance_of: Vec<(Kind, f64)>,
    /// Random walks of each of the first two estimates of a record of multiple scattering, at least 16, fewer where it reaches less far
    /// than others, in the second up to eight times as many where they differ much or are bright; the other caches in proportion.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub paths: Option<u32>,
    /// Degree of expansions in anisotropic media [default: from the phase function].
    #[arg(long, value_name = "L", value_parser = clap::value_parser!(u32).range(0..=sh::MAX_DEGREE as i64))]
    pub degree: Option<u32>,
    /// Caches not to use: their light is estimated anew at every point; may be repeated.
    #[arg(long, value_name = "CACHE", value_enum)]
    pub uncached: Vec<Kind>,
    /// How records are carried to other points [default: curved].
    #[arg(long, value_enum)]
    pub extrapolation: Option<Carrying>,
    /// How light straight from the lights is scattered once.
    #[arg(long, value_enum, default_value_t = Single::Direct)]
    pub single: Single,
    /// Eye rays along which caches are compared with path tracing before the picture is made, to say how far it is off and to make anew
    /// what is wrong; 0 for no such comparison
    /// [default: as many as take about a twentieth of the time, a tenth in dense fog].
    #[arg(long, value_name = "N")]
    pub audit: Option<u32>,
    /// Starts from the records in this file, and adds only what is missing: made by --cache-out for the same scene
    /// and the same options; the camera may be another.
    #[arg(long, value_name = "FILE")]
    pub cache_in: Option<PathBuf>,
    /// Writes all records, for --cache-in; may be the same file.
    #[arg(long, value_name = "FILE")]
    pub cache_out: Option<PathBuf>,
}

impl CacheArguments {
    /// The error asked for, where time is not limited.
    pub(super) fn error(&self) -> f32 {
        self.error.unwrap_or(cache::USUAL_ERROR)
    }

    /// # Errors
    /// A file that cannot be written: better before a long render than after it.
    pub(super) fn check(&self) -> Result<(), String> {
        self.cache_out.as_deref().map_or(Ok(()), output::check_place)
    }

    pub(super) fn has_files(&self) -> bool {
        self.cache_in.is_some() || self.cache_out.is_some()
    }

    /// What caches in files are for: all that changes the light of a scene, and not the camera.
    pub(super) fn tag(&self, scene: &SceneArguments, paths: &path::Settings) -> Result<u64, SceneError> {
        if !self.has_files() {
            return Ok(0);
        }
        let mut crc = Crc::new();
        crc.add(&scene.fingerprint()?.to_le_bytes());
        let path::Settings { max_scatterings, roulette_after, lights_visible } = *paths;
        for number in [max_scatterings, roulette_after, u32::from(lights_visible)] {
            crc.add(&number.to_le_bytes());
        }
        Ok(crc.value())
    }

    fn load(&self, settings: cache::Settings, tag: u64) -> Result<RadianceCaches<'static>, String> {
        let Some(file) = &self.cache_in else { return Ok(RadianceCaches::new(settings)) };
        let mut caches = RadianceCaches::new(settings);
        files::load(file, |bytes| caches.read(bytes, tag)).map(|()| caches).map_err(|error| match error.problem {
            Problem::Content(CachesError::Damage(Damage::Tag { .. })) => {
                format!("{}: was made for another scene, or with another --max-depth", file.display())
            }
            _ => error.to_string(),
        })
    }
}

/// An option with the default of [`cache::Settings::for_outline`].
fn told(option: Arg) -> Arg {
    let outline = unit_outline();
    let usual = cache::Settings::for_outline(&outline, cache::USUAL_ERROR).with_single_cached(&outline);
    match option.get_id().as_str() {
        "tolerance" => {
            let [single, surface, multiple, irradiance] =
                [usual.single, usual.surface, usual.multiple, usual.irradiance]
                    .map(|effort| effort.map_or(0.0, |effort| effort.tolerance));
            let text = format!(
                "{single} for single, {surface} for surface, {multiple} for multiple, {irradiance} for irradiance"
            );
            with_default(option, text)
        }
        "error" => with_default(option, format!("{}; with --time as small as is done in time", cache::USUAL_ERROR)),
        "paths" => with_default(option, usual.multiple.map_or(0, |effort| effort.samples).to_string()),
        _ => option,
    }
}

/// How records are carried to other points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Carrying {
    /// Along the mean of gradients: exact for light that changes quadratically.
    Curved,
    /// Exponentially, mixed by their geometric mean: as Jarosz et al. do.
    Exponential,
    /// Along the gradient.
    Linear,
    /// Unchanged.
    Constant,
}

impl From<Carrying> for Extrapolation {
    fn from(carrying: Carrying) -> Self {
        match carrying {
            Carrying::Curved => Self::Curved,
            Carrying::Exponential => Self::Exponential,
            Carrying::Linear => Self::Linear,
            Carrying::Constant => Self::Constant,
        }
    }
}

/// A cache.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Kind {
    /// Light of the lights, scattered once.
    Single,
    /// Light of surfaces, scattered once.
    Surface,
    /// Light scattered more than once.
    Multiple,
    /// Indirect light on surfaces.
    Irradiance,
}

impl From<Kind> for cache::Kind {
    fn from(kind: Kind) -> Self {
        match kind {
            Kind::Single => Self::Single,
            Kind::Surface => Self::Surface,
            Kind::Multiple => Self::Multiple,
            Kind::Irradiance => Self::Irradiance,
        }
    }
}

/// What becomes of single scattering.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Single {
    /// Connections to the lights from every point: sharp shadows and peaked phase functions.
    Direct,
    /// Cached: for fog in which most points see no light; blurs what is close to lamps.
    Cached,
}

/// An error that can be asked for.
fn error_asked(text: &str) -> Result<f32, String> {
    let [least, most] = cache::ERROR_BOUNDS;
    let error = text.parse::<f32>().ok().filter(|error| (least..=most).contains(error));
    error.ok_or_else(|| format!("must be a number from {least} to {most}"))
}

/// `CACHE=E`.
fn named(text: &str) -> Result<(Kind, f64), String> {
    let (kind, value) = text.split_once('=').ok_or("must look like multiple=0.2")?;
    Ok((Kind::from_str(kind, false)?, output::positive(value)?))
}

/// # Errors
/// A limit on scatterings between one and none: a record does not know how often its light was scattered.
pub(super) fn check_depth(paths: &path::Settings) -> Result<(), String> {
    match paths.max_scatterings {
        0 | 1 | u32::MAX => Ok(()),
        limit => Err(format!(
            "radiance caching knows paths of depth 1, of depth 2, or without limit: not {}; leave --max-depth out, \
             or max_depth of the scene at -1, or take --method path",
            u64::from(limit) + 1
        )),
    }
}

/// Tag of caches in film files, which know themselves what they are of.
const KEPT: u64 = 0;

/// A render by radiance caching, to be done with a medium of any type.
pub(super) struct CacheJob<'a> {
    pub(super) world: &'a World<'a>,
    pub(super) lights: Lights<'a>,
    pub(super) camera: Camera,
    pub(super) filter: &'a FilterTable,
    pub(super) paths: path::Settings,
    pub(super) film: &'a mut Film,
    pub(super) settings: &'a tiles::Settings,
    /// Whether nobody says how many samples there are to be, or how little noise.
    pub(super) has_usual_goal: bool,
    pub(super) control: &'a Control<'a>,
    /// Is told of every stage of filling, again and again, and which share of its jobs is done.
    pub(super) tell: &'a dyn Fn(&'static str, f32),
    /// What is kept of the render, if anything, and what it goes on with.
    pub(super) keeper: Option<&'a Keeper<'a>>,
    /// Whether caches alone are wanted, for parts of the picture.
    pub(super) is_fill: bool,
    /// Whether it is such a part: what is to be said of the caches was said when they were filled.
    pub(super) is_part: bool,
    pub(super) arguments: &'a CacheArguments,
    /// Which pixels are computed; `None` for all.
    pub(super) plan: Option<&'a Plan<'a>>,
    /// See [`CacheArguments::tag`].
    pub(super) tag: u64,
}

/// What caching did besides the picture.
#[derive(Debug)]
pub(super) struct Cached {
    pub(super) caches: RadianceCaches<'static>,
    /// Time of filling by stage.
    pub(super) filled: Vec<(&'static str, Seconds)>,
    /// Records that were computed.
    pub(super) computed: u64,
    /// The relative noise that records leave in the picture.
    pub(super) record_noise: Option<f32>,
    /// Time to read and write them.
    pub(super) files: [Seconds; 2],
    pub(super) render: Outcome,
    /// How far the picture is off, and where; `None` if nobody asked, or if the render was stopped.
    pub(super) audited: Option<Audited>,
}

/// Samples of every pixel. Fewer: noise is told too badly; more: large pictures cost more than their noise asks for, as most light comes from
/// caches, without any.
const LEAST_SAMPLES: u32 = 4;

/// The same where noise may be [`ROUGH`]. Fewer: no halves that tell noise.
const LEAST_ROUGH_SAMPLES: u32 = 2;

/// Relative noise that is told well enough by halves of one sample a pixel. Less: tiles that stop early by chance; more: rough pictures are finer than was asked for.
const ROUGH: f32 = 0.05;

/// Caches as far as they were filled.
struct Filled {
    caches: RadianceCaches<'static>,
    ending: Ending,
    measured: Measured,
    audited: Option<Audited>,
}

impl Filled {
    /// No more views follow, for which photons were kept.
    fn new(
        mut caches: RadianceCaches<'static>,
        (ending, measured): (Ending, Measured),
        audited: Option<Audited>,
    ) -> Self {
        caches.forget_photons();
        Self { caches, ending, measured, audited }
    }

    /// When pixels have enough samples, unless told otherwise.
    fn usual_goal(&self) -> tiles::Goal {
        let noise = self.measured.noise;
        tiles::Goal { noise, least: if noise < ROUGH { LEAST_SAMPLES } else { LEAST_ROUGH_SAMPLES } }
    }
}

/// What all fills of a render took.
#[derive(Default)]
struct Spent {
    filled: Vec<(&'static str, Seconds)>,
    computed: u64,
    record_noise: Option<f32>,
}

/// Adds times to those of the same stages.
fn add_times(all: &mut Vec<(&'static str, Seconds)>, more: Vec<(&'static str, Seconds)>) {
    for (stage, time) in more {
        match all.iter_mut().find(|(name, _)| *name == stage) {
            Some((_, sum)) => *sum = *sum + time,
            None => all.push((stage, time)),
        }
    }
}

/// What an audit has found.
#[derive(Debug, Clone)]
pub(crate) struct Audited {
    /// The error that the picture was made for.
    pub(crate) error: f32,
    pub(crate) findings: Findings,
    pub(crate) map: Box<BiasMap>,
    /// What earlier audits had found, because of which records were made anew.
    pub(crate) repaired: Vec<(Findings, Box<BiasMap>)>,
    /// Whether what looks too bright may be light that paths cannot find.
    pub(crate) may_be_hidden: bool,
}

impl CacheJob<'_> {
    fn save(&self, caches: &RadianceCaches<'static>) -> Result<(), Failure> {
        Ok(self.arguments.cache_out.as_ref().map_or(Ok(()), |file| files::write(file, &caches.to_bytes(self.tag)))?)
    }

    /// What suits the world, with what the user says otherwise.
    fn settings(&self, outline: &Outline, error: f32) -> cache::Settings {
        let arguments = self.arguments;
        let preset = cache::Settings::for_outline(outline, error).for_pixels(self.film.width() * self.film.height());
        let mut settings = match arguments.single {
            Single::Direct => preset,
            Single::Cached => preset.with_single_cached(outline),
        };
        if let Some(walks) = arguments.paths {
            settings = settings.with_walks(walks);
        }
        for kind in Kind::value_variants() {
            let Some(effort) = settings.effort_mut((*kind).into()) else { continue };
            let named = arguments.tolerance_of.iter().rev().find(|(k, _)| k == kind).map(|(_, e)| *e);
            if let Some(tolerance) = named.or(arguments.tolerance) {
                effort.tolerance = tolerance as f32;
            }
            if let Some(degree) = arguments.degree {
                effort.degree = degree as usize;
            }
        }
        let scatters_on = self.paths.max_scatterings > 1;
        let kept = |kind: Kind| scatters_on && !arguments.uncached.contains(&kind);
        cache::Settings {
            single: settings.single.filter(|_| kept(Kind::Single)),
            surface: settings.surface.filter(|_| kept(Kind::Surface)),
            multiple: settings.multiple.filter(|_| kept(Kind::Multiple)),
            irradiance: settings.irradiance.filter(|_| kept(Kind::Irradiance)),
            extrapolation: arguments.extrapolation.map_or(settings.extrapolation, Into::into),
            eye: RaySettings { lights_visible: self.paths.lights_visible, indirect: scatters_on, ..settings.eye },
            paths: self.paths,
            seed: self.settings.seed,
            ..settings
        }
    }
}

/// A picture, and the caches that it was made from.
struct Done {
    film: Film,
    filled: Filled,
    render: Outcome,
}

/// The stages of one job, with the medium of any type.
struct Stages<'j, 'a, M> {
    job: &'j CacheJob<'a>,
    medium: &'j M,
    outline: Outline,
    pool: Threads,
}

impl<M: Medium + Sync> Stages<'_, '_, M> {
    fn world(&self) -> LitWorld<'_, M, World<'_>> {
        LitWorld { medium: self.medium, scene: self.job.world, lights: self.job.lights }
    }

    /// Eye rays by where they cross the film.
    fn rays(&self) -> impl Fn([f32; 2]) -> Ray + Copy + use<M> {
        let camera = self.job.camera;
        move |at| camera.ray(Vec2::from(at))
    }

    /// What the picture asks caches for.
    fn asked(&self) -> Asked<impl Fn([f32; 2]) -> Ray + Copy + use<M>> {
        let (ray, width) = (self.rays(), self.job.film.width() as f32);
        let pixel = ray([0.5, 0.5]).direction.angle_between(ray([0.5 + 1.0 / width, 0.5]).direction);
        Asked::View { ray, pixel }
    }

    /// Fills caches until nothing is missing, or `time` is up.
    fn run<F: Fn([f32; 2]) -> Ray + Sync>(
        &self,
        filling: &mut Filling<'static, F>,
        time: Option<Duration>,
        spent: &mut Spent,
    ) -> Ending {
        let (job, world) = (self.job, self.world());
        let ran = threads::run(filling, &world, &self.pool, job.control, time, |filling| {
            let jobs = Rounds::<LitWorld<'_, M, World<'_>>>::jobs(filling);
            (job.tell)(
                Rounds::<LitWorld<'_, M, World<'_>>>::stage(filling),
                jobs.start as f32 / jobs.end.max(1) as f32,
            );
        });
        add_times(&mut spent.filled, ran.stages);
        spent.computed += cache::Kind::ALL.into_iter().map(|kind| filling.computed(kind)).sum::<u64>();
        spent.record_noise = filling.record_noise().or(spent.record_noise);
        ran.ending
    }

    /// Runs an audit, as far as time allows; `None` if it was stopped.
    fn audit(
        &self,
        mut audit: Audit<'_, '_, impl Fn([f32; 2]) -> Ray + Sync>,
        time: Option<Duration>,
        spent: &mut Spent,
    ) -> Option<(Findings, Box<BiasMap>)> {
        let tell = |_: &Audit<'_, '_, _>| (self.job.tell)("audit", 0.0);
        let ran = threads::run(&mut audit, &self.world(), &self.pool, self.job.control, time, tell);
        add_times(&mut spent.filled, ran.stages);
        (ran.ending != Ending::Cancelled).then(|| (audit.findings(), Box::new(audit.map())))
    }

    fn audited(
        &self,
        error: f32,
        (findings, map): (Findings, Box<BiasMap>),
        repaired: Vec<(Findings, Box<BiasMap>)>,
    ) -> Audited {
        let may_be_hidden = self.may_be_hidden((&findings, &map), error);
        Audited { error, findings, map, repaired, may_be_hidden }
    }

    /// Whether something is too bright where there may be light that paths cannot find: then no repair helps.
    fn may_be_hidden(&self, (findings, map): (&Findings, &BiasMap), error: f32) -> bool {
        let error = f64::from(error);
        let is_too_bright = |off: &Deviation| off.exceeds(error) && off.bias > 0.0;
        self.outline.hides_light()
            && (map.worst(error).is_some_and(|region| region.cached.bias > 0.0)
                || [findings.all, findings.cached].iter().any(is_too_bright))
    }

    /// Fills caches until nothing is missing; audits them, and makes anew what is wrong.
    fn fill(&self, mut caches: RadianceCaches<'static>, error: f32, spent: &mut Spent) -> Filled {
        let (job, world) = (self.job, self.world());
        let (mut repaired, mut noise) = (Vec::new(), error);
        loop {
            let mut filling = caches.fill(self.asked());
            let ending = self.run(&mut filling, None, spent);
            let audit_rays = job.arguments.audit.unwrap_or_else(|| filling.audit_rays());
            noise = noise.min(filling.noise_goal(error, job.film.width() * job.film.height()));
            let measured = Measured { noise, audit_rays };
            caches = filling.finish();
            if ending != Ending::Done || audit_rays == 0 || job.paths.max_scatterings == 0 {
                return Filled::new(caches, (ending, measured), None);
            }
            let audit = Audit::new(&caches, self.rays(), audit_rays).held_to(error);
            let Some((findings, map)) = self.audit(audit, None, spent) else {
                return Filled::new(caches, (Ending::Cancelled, measured), None);
            };
            let is_over = repaired.len() as u32 >= cache::MOST_REPAIRS || self.may_be_hidden((&findings, &map), error);
            let ray = self.rays();
            if is_over || !caches.drop_wrong((&findings, &map), error, ray, &world) {
                return Filled::new(
                    caches,
                    (Ending::Done, measured),
                    Some(self.audited(error, (findings, map), repaired)),
                );
            }
            repaired.push((findings, map));
        }
    }

    /// Caches that were filled before, and audited anew: only what is said of them depends on that.
    fn taken_up(&self, bytes: &[u8], measured: Measured, error: f32, spent: &mut Spent) -> Result<Filled, Failure> {
        let job = self.job;
        let mut caches = RadianceCaches::new(job.settings(&self.outline, error));
        caches.read(bytes, KEPT).map_err(|error| format!("the caches that were kept: {error}"))?;
        if job.is_part || measured.audit_rays == 0 || job.paths.max_scatterings == 0 {
            return Ok(Filled::new(caches, (Ending::Done, measured), None));
        }
        let audit = Audit::new(&caches, self.rays(), measured.audit_rays).held_to(error);
        let found = self.audit(audit, None, spent);
        let audited = found.map(|found| self.audited(error, found, Vec::new()));
        Ok(Filled::new(caches, (Ending::Done, measured), audited))
    }

    /// Adds samples to a film.
    fn picture(
        &self,
        film: &mut Film,
        caches: &RadianceCaches<'static>,
        settings: &tiles::Settings,
    ) -> Result<Outcome, Failure> {
        // Threads share no more of the job than they need.
        let CacheJob { world: scene, lights, camera, filter, paths, plan, .. } = *self.job;
        let medium = self.medium;
        let has_layers = film.layers().len() > 1;
        let has_edges = lights.iter().any(|light| matches!(light, Light::Quad(_) | Light::Sphere(_) | Light::Mesh(_)));
        let straight = if has_edges { STRAIGHT } else { 0 };
        let size = [film.width(), film.height()];
        let eye = Eye { camera, filter };
        let glares = Glares::new(&eye, size, &lights, scene);
        Ok(tiles::render(film, settings, self.job.control, |sample, rng, layers| {
            let world = LitWorld {
                medium: &CountingMedium { medium, tally: sample.tally },
                scene: &CountingScene { scene, tally: sample.tally },
                lights,
            };
            let (pixel, within) = ([sample.x, sample.y], uniform2(rng));
            let (ray, weight) = eye.ray_at(pixel, size, within, rng);
            let seen = if paths.max_scatterings == 0 {
                CachedRadiance {
                    emitted: path::radiance(&ray, &world, &paths, rng).emitted,
                    ..CachedRadiance::default()
                }
            } else if is_computed(plan, sample, size[0]) {
                let mut seen = caches.radiance(&ray, &world, rng);
                let (mut sum, rng) = (seen.straight * weight, &mut Generator::child(rng));
                for k in 1..=straight {
                    // As even from sample to sample as those of the ray itself are.
                    let within = (within + EVEN * k as f32).fract();
                    let (ray, weight) = eye.ray_at(pixel, size, within, rng);
                    sum += caches.straight(&ray, &world, rng) * weight;
                }
                let mean = sum / ((straight + 1) as f32 * weight);
                let emitted = seen.emitted - seen.straight + mean;
                if straight > 0 && emitted.is_finite() {
                    seen.emitted = emitted;
                }
                if let Some(TwoPlaces { at, shares }) = glares.places(pixel, within) {
                    let single = |(at, share): (Vec2, f32)| {
                        let (ray, weight) = eye.ray_at(pixel, size, at, rng);
                        let other = caches.radiance(&ray, &world, rng);
                        (seen.lookups, seen.misses) = (seen.lookups + other.lookups, seen.misses + other.misses);
                        other.medium_single * (share * weight)
                    };
                    let looks = at.into_iter().zip(shares).filter(|(_, share)| *share != 0.0);
                    let single = looks.map(single).sum::<Spectrum>() / weight;
                    if single.is_finite() {
                        seen.medium_single = single;
                    }
                }
                seen
            } else {
                caches.radiance_beyond(&ray, &world, rng)
            };
            sample.tally.look_up(seen.lookups, seen.misses);
            if layers.len() == levels::LAYERS.len() {
                layers.copy_from_slice(&[seen.total(), levels::cached(&seen, &caches.reader())]);
            } else if has_layers {
                let parts = [
                    seen.total(),
                    seen.emitted,
                    seen.surface_direct,
                    seen.surface_indirect,
                    seen.medium_single,
                    seen.medium_surface,
                    seen.medium_multiple,
                ];
                layers.copy_from_slice(&parts);
            } else if let Some(total) = layers.first_mut() {
                *total = seen.total();
            }
            weigh(layers, weight);
        })?)
    }
}

impl WithMedium for CacheJob<'_> {
    type Output = Result<Cached, Failure>;

    fn with<M: Medium + Sync>(self, medium: &M) -> Self::Output {
        let world = LitWorld { medium, scene: self.world, lights: self.lights };
        let outline = self.world.outline(&world);
        let stages = Stages { job: &self, medium, outline, pool: Threads::new(self.settings.threads)? };
        let mut spent = Spent::default();
        let clock = Stopwatch::start();
        let (mut loaded, asked) = (clock.elapsed(), self.arguments.error());
        let done = match self.settings.time {
            Some(time) if !self.arguments.has_files() => stages.timed(time, &mut spent)?,
            _ => {
                let filled = if let Some((bytes, measured)) = self.keeper.and_then(Keeper::caches) {
                    let filled = stages.taken_up(bytes, measured, asked, &mut spent)?;
                    loaded = clock.elapsed();
                    filled
                } else {
                    let caches = self.arguments.load(self.settings(&outline, asked), self.tag)?;
                    loaded = clock.elapsed();
                    stages.fill(caches, asked, &mut spent)
                };
                let mut film = Film::new(self.film.width(), self.film.height(), self.film.layers())?;
                if filled.ending == Ending::Cancelled {
                    self.save(&filled.caches)?;
                    return Err(Stopped("caches").into());
                }
                if let Some(keeper) = self.keeper.filter(|keeper| keeper.wants_filled(self.is_fill)) {
                    keeper.keep_caches(filled.caches.to_bytes(KEPT), filled.measured);
                }
                let goal = self.settings.goal.or_else(|| self.has_usual_goal.then(|| filled.usual_goal()));
                let settings = tiles::Settings { goal, ..*self.settings };
                let render = if self.is_fill {
                    let (counters, seconds) = (Counters::default(), Seconds::default());
                    Outcome { samples: 0, reason: tiles::Reason::Done, counters, seconds }
                } else {
                    stages.picture(&mut film, &filled.caches, &settings)?
                };
                Done { film, filled, render }
            }
        };
        drop(stages);
        let clock = Stopwatch::start();
        self.save(&done.filled.caches)?;
        let files = [loaded, clock.elapsed()];
        let Done { film, filled: Filled { caches, audited, .. }, render } = done;
        *self.film = film;
        let Spent { filled, computed, record_noise } = spent;
        Ok(Cached { caches, filled, computed, record_noise, files, render, audited })
    }
}
