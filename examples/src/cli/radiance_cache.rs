//! `fogbow render --method radiance-cache`.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use fogbow::bytes::Crc;
use fogbow::cache::{Estimator, Extrapolation, EyeSettings, Limits, Seen, radiance, radiance_beyond};
use fogbow::host::Medium;
use fogbow::light::Light;
use fogbow::math::{Ray, Vec2};
use fogbow::multiple_scatter::{self, Lengths};
use fogbow::path;
use fogbow::phase::Phase;
use fogbow::sampling::uniform2;
use fogbow::transmittance::thickness::Steps;
use fogbow::world::World as LitWorld;
use fogbow_std::film::Film;
use fogbow_std::image_sampling::Plan;
use fogbow_std::progress::Control;
use fogbow_std::radiance_cache::{self as cache, Effort, Problem, RadianceCaches};
use fogbow_std::stats::{CountingMedium, CountingScene, Seconds, Stopwatch};
use fogbow_std::tiles::{self, Outcome};

use super::image_sampling::is_computed;
use super::{Failure, output};
use crate::camera::Camera;
use crate::error::SceneError;
use crate::scene_file::fingerprint;
use crate::world::{WithMedium, World};

/// Of `--method radiance-cache`.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Radiance caching")]
pub struct CacheArguments {
    /// Error tolerance of all caches: smaller is finer and slower [default: 0.2 for single, 2 for surface, for
    /// multiple 1 less the absolute mean cosine of the phase function, within 0.1 and 0.8, 0.35 for irradiance].
    #[arg(long, value_name = "E", value_parser = output::positive)]
    pub tolerance: Option<f64>,
    /// Error tolerance of one cache, as CACHE=E; may be repeated.
    #[arg(long, value_name = "CACHE=E", value_parser = named)]
    pub tolerance_of: Vec<(Kind, f64)>,
    /// Random walks of each of the two estimates of a record of multiple scattering, fewer where it reaches less far
    /// than others, in the second up to four times as many where they differ much; the other caches in proportion
    /// [default: 2048].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub paths: Option<u32>,
    /// Degree of expansions in anisotropic media [default: from the phase function].
    #[arg(long, value_name = "L", value_parser = clap::value_parser!(u32).range(0..=16))]
    pub degree: Option<u32>,
    /// Caches not to use: their light is estimated anew at every point; may be repeated.
    #[arg(long, value_name = "CACHE", value_enum)]
    pub uncached: Vec<Kind>,
    /// How records are carried to other points [default: curved].
    #[arg(long, value_enum)]
    pub extrapolation: Option<Carrying>,
    /// How light straight from the lights is scattered once.
    #[arg(long, value_enum, default_value_t = Single::Auto)]
    pub single: Single,
    /// Starts from the records in this file, and adds only what is missing: made by --cache-out for the same scene
    /// and the same options; the camera may be another.
    #[arg(long, value_name = "FILE")]
    pub cache_in: Option<PathBuf>,
    /// Writes all records, for --cache-in; may be the same file.
    #[arg(long, value_name = "FILE")]
    pub cache_out: Option<PathBuf>,
}

impl CacheArguments {
    /// # Errors
    /// A file that cannot be written: better before a long render than after it.
    pub(super) fn check(&self) -> Result<(), String> {
        self.cache_out.as_deref().map_or(Ok(()), output::check_place)
    }

    /// What caches in files are for: all that changes the light of a scene, and not the camera.
    pub(super) fn tag(&self, scene: &Path, paths: &path::Settings) -> Result<u64, SceneError> {
        if self.cache_in.is_none() && self.cache_out.is_none() {
            return Ok(0);
        }
        let mut crc = Crc::new();
        crc.add(&fingerprint(scene)?.to_le_bytes());
        let path::Settings { max_scatterings, roulette_after, lights_visible } = *paths;
        for number in [max_scatterings, roulette_after, u32::from(lights_visible)] {
            crc.add(&number.to_le_bytes());
        }
        Ok(crc.value())
    }

    fn load(&self, settings: cache::Settings, tag: u64) -> Result<RadianceCaches, String> {
        let Some(file) = &self.cache_in else { return Ok(RadianceCaches::new(settings)) };
        cache::load(file, settings, tag).map_err(|error| match error.problem {
            Problem::Tag { .. } => {
                format!("{}: was made for another scene, or with another --max-depth", file.display())
            }
            _ => error.to_string(),
        })
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

/// What becomes of single scattering.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Single {
    /// Cached where there are many lights.
    Auto,
    /// Connections to the lights from every point: sharp shadows and peaked phase functions.
    Direct,
    /// Cached.
    Cached,
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

/// Random walks per record of multiple scattering, unless the user says otherwise.
const PATHS: u32 = 2048;

/// Samples of all lights with extent together, for a record of single scattering.
const LIGHT_SAMPLES: u32 = 128;

/// Changes of light below this share of the scene's size are noise.
const FINEST: f32 = 0.01;

/// Number of lights from which on single scattering is cached.
const MANY_LIGHTS: usize = 12;

/// A render by radiance caching, to be done with a medium of any type.
pub(super) struct CacheJob<'a> {
    pub(super) world: &'a World<'a>,
    pub(super) lights: &'a [Light<'a>],
    pub(super) camera: Camera,
    pub(super) paths: path::Settings,
    pub(super) film: &'a mut Film,
    pub(super) settings: &'a tiles::Settings,
    pub(super) control: &'a Control<'a>,
    pub(super) arguments: &'a CacheArguments,
    /// Which pixels are computed; `None` for all.
    pub(super) plan: Option<&'a Plan>,
    /// See [`CacheArguments::tag`].
    pub(super) tag: u64,
}

/// What caching did besides the picture.
#[derive(Debug)]
pub(super) struct Cached {
    pub(super) caches: RadianceCaches,
    pub(super) filled: cache::Outcome,
    /// Time to read and write them.
    pub(super) files: [Seconds; 2],
    pub(super) render: Outcome,
}

impl CacheJob<'_> {
    fn efforts(&self, phase: &Phase) -> cache::Settings {
        let size = self.world.bounds().size().max_element();
        let arguments = self.arguments;
        let scale = f64::from(arguments.paths.unwrap_or(PATHS)) / 1024.0;
        let effort = |kind: Kind, tolerance: f64, samples: f64, degree: usize, most: f32| {
            let named = arguments.tolerance_of.iter().rev().find(|(k, _)| *k == kind).map(|(_, e)| *e);
            let effort = Effort {
                tolerance: named.or(arguments.tolerance).unwrap_or(tolerance) as f32,
                samples: ((samples * scale) as u32).max(1),
                degree: arguments.degree.map_or(degree, |d| d as usize),
                limits: Limits { min: 1e-3 * size, max: most * size },
                // Farther, and dark corners turn out too bright; nearer, and records cost more than they mend.
                clearance: match kind {
                    Kind::Irradiance => 0.3,
                    Kind::Surface => 1.0,
                    Kind::Single | Kind::Multiple => f32::INFINITY,
                },
            };
            (!arguments.uncached.contains(&kind) && self.paths.max_scatterings > 1).then_some(effort)
        };
        let degree = |power: i32, damping: f32| degree_for(phase, power, damping);
        let cached = match arguments.single {
            Single::Auto => self.lights.len() >= MANY_LIGHTS,
            Single::Direct => false,
            Single::Cached => true,
        };
        // Expansions change faster than the mean over directions, from which radii come. Above 0.8 light that falls off
        // like 1/r is carried too far: fog around a lamp turns out too dark.
        let breadth = (1.0 - f64::from(phase.mean_cosine().map(f32::abs).max_element())).clamp(0.1, 0.8);
        cache::Settings {
            single: if cached { effort(Kind::Single, 0.2, 16.0, degree(1, 0.0), 0.1) } else { None },
            surface: effort(Kind::Surface, 2.0, 256.0, degree(1, 1.5), 0.06),
            multiple: effort(Kind::Multiple, breadth, 1024.0, degree(2, 0.0), (breadth as f32 / 8.0).max(0.05)),
            irradiance: effort(Kind::Irradiance, 0.35, 512.0, 0, 0.1),
            // Small things are seen in large pictures; places take memory.
            rays: (self.film.width() * self.film.height() / 4).clamp(16384, 131_072),
            extrapolation: arguments.extrapolation.map_or_else(Extrapolation::default, Into::into),
            margin: 0.15,
            pixels: (1.5, 64.0),
            round: 64,
            threads: self.settings.threads,
            seed: self.settings.seed,
        }
    }
}

/// The least degree beyond which an expansion holds less than a sixtieth of the phase function, applied
/// `power` times, to light whose own expansion falls off like `1/(l + 1)^damping`.
fn degree_for(phase: &Phase, power: i32, damping: f32) -> usize {
    let energy = |l: usize| {
        let moment = phase.moment(l).max_element().abs().powi(power) / (l as f32 + 1.0).powf(damping);
        (2 * l + 1) as f32 * moment * moment
    };
    let total: f32 = (0..=fogbow::sh::MAX_DEGREE).map(energy).sum();
    let mut rest = total;
    for l in 0..=fogbow::sh::MAX_DEGREE {
        rest -= energy(l);
        if rest <= 2.5e-4 * total {
            return l;
        }
    }
    fogbow::sh::MAX_DEGREE
}

impl WithMedium for CacheJob<'_> {
    type Output = Result<Cached, Failure>;

    fn with<M: Medium + Sync>(self, medium: &M) -> Self::Output {
        let phases = self.world.media().phases();
        let sharpest = phases.iter().copied().max_by(|a, b| {
            let mean = |p: &Phase| p.moment(1).max_element().abs();
            mean(a).total_cmp(&mean(b))
        });
        let settings = self.efforts(&sharpest.unwrap_or(Phase::ISOTROPIC));
        let eye = EyeSettings {
            density: 8.0,
            connections: 4,
            lights_visible: self.paths.lights_visible,
            indirect: self.paths.max_scatterings > 1,
        };
        let steps = Steps::Length(3.0 * medium.resolution());
        let estimator = Estimator {
            world: LitWorld { medium, scene: self.world, lights: self.lights },
            surfaces: None,
            scattered: None,
            walk: multiple_scatter::Settings {
                one_light: self.lights.len() > 1,
                lengths: Lengths::Marched,
                ..multiple_scatter::Settings::new(steps)
            },
            paths: self.paths,
            light_samples: (LIGHT_SAMPLES / self.lights.len().max(1) as u32).clamp(1, 16),
            finest: FINEST * self.world.bounds().size().max_element(),
        };
        let (width, height) = (self.film.width() as f32, self.film.height() as f32);
        let ray = |at: [f32; 2]| -> Ray { self.camera.ray(Vec2::from(at)) };
        let apart = ray([0.5, 0.5]).direction.angle_between(ray([0.5 + 1.0 / width, 0.5]).direction);
        let clock = Stopwatch::start();
        let mut caches = self.arguments.load(settings, self.tag)?;
        let loaded = clock.elapsed();
        let filled = cache::fill(&mut caches, &estimator, &eye, apart, self.control, ray)?;
        let clock = Stopwatch::start();
        if let Some(file) = &self.arguments.cache_out {
            cache::save(file, &caches, self.tag)?;
        }
        let files = [loaded, clock.elapsed()];
        let has_layers = self.film.layers().len() > 1;
        let reader = caches.reader();
        let render = tiles::render(self.film, self.settings, self.control, |sample, rng, layers| {
            let world = LitWorld {
                medium: &CountingMedium { medium, tally: sample.tally },
                scene: &CountingScene { scene: self.world, tally: sample.tally },
                lights: self.lights,
            };
            let estimator = Estimator {
                world,
                surfaces: reader.irradiance.map(|r| (r.cache, r.reading)),
                scattered: None,
                walk: estimator.walk,
                paths: estimator.paths,
                light_samples: 1,
                finest: estimator.finest,
            };
            let jitter = uniform2(rng);
            let film = Vec2::new((sample.x as f32 + jitter.x) / width, (sample.y as f32 + jitter.y) / height);
            let ray = self.camera.ray(film);
            let seen = if self.paths.max_scatterings == 0 {
                Seen { emitted: path::radiance(&ray, &estimator.world, &self.paths, rng).emitted, ..Seen::default() }
            } else if is_computed(self.plan, sample, width as u32) {
                radiance(&ray, &estimator, &reader, &eye, rng)
            } else {
                radiance_beyond(&ray, &estimator, &reader, &eye, rng)
            };
            sample.tally.look_up(seen.lookups, seen.misses);
            if has_layers {
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
        })?;
        Ok(Cached { caches, filled, files, render })
    }
}
