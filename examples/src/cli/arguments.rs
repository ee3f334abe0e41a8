//! What `fogbow render` is asked for.

use std::path::PathBuf;

use clap::{Arg, Args, ValueEnum};
use fogbow::bytes::Crc;
use fogbow::cache;
use fogbow::picture;

use super::covariance::{CovarianceArguments, MarchArguments, Step};
use super::defaults::{with_default, with_remark};
use super::film_file::{About, is_film};
use super::image_sampling::SamplingArguments;
use super::keep::KeepArguments;
use super::parts::PartArguments;
use super::photon_beams::{BeamArguments, Kernel};
use super::radiance_cache::CacheArguments;
use super::report::Voice;
use super::scene::SceneArguments;
use super::vpl::VplArguments;
use super::{Failure, output};
use crate::scene_file::SceneFile;

/// Renders a scene of Mitsuba (.xml), glTF (.glb, .gltf) or pbrt (.pbrt).
#[derive(Debug, Args)]
#[command(mut_args(told))]
pub struct RenderArguments {
    /// The scene.
    #[command(flatten)]
    pub scene: SceneArguments,
    /// How light is computed [default: radiance-cache; path with a limit on depth, and where only mirrors and glass
    /// scatter light].
    #[arg(long, value_enum)]
    pub method: Option<Method>,
    /// Samples per pixel, with --noise the most; for photon beams and virtual lights rounded up to whole passes.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub spp: Option<u32>,
    /// Relative noise at which tiles of some pixels have enough samples; not for photon beams and virtual lights, whose noise is
    /// that of whole passes.
    #[arg(long, value_name = "E", value_parser = output::positive)]
    pub noise: Option<f64>,
    /// Seconds to render for, on the wall clock; radiance caching fills caches for smaller and smaller errors as long as they last.
    #[arg(long, value_name = "SECONDS", value_parser = output::positive)]
    pub time: Option<f64>,
    /// Longest path, as Mitsuba counts: 1 is lights only, 2 adds one scattering [default: what the scene says].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub max_depth: Option<u32>,
    /// Threads; 0 is one per processor.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub threads: usize,
    /// Chooses other random numbers.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Size of the image [default: what the scene says].
    #[arg(long, value_name = "WxH", value_parser = output::size)]
    pub size: Option<(u32, u32)>,
    /// Where the camera stands and what it looks at, +y up: "x,y,z x,y,z" [default: what the scene says].
    #[arg(long, value_name = "ORIGIN TARGET", value_parser = output::camera, allow_hyphen_values = true)]
    pub camera: Option<[[f64; 3]; 2]>,
    /// Image to write: .png, .exr or .pfm, or .fogbow for the sums of its samples; may be repeated [default: SCENE.png and SCENE.exr in this folder].
    #[arg(short, long, value_name = "FILE")]
    pub output: Vec<PathBuf>,
    /// Stops by which PNG images are brightened.
    #[arg(long, value_name = "STOPS", default_value_t = 0.0, allow_negative_numbers = true)]
    pub exposure: f32,
    /// Also writes the components of light, as layers of .exr files; where a covariance grid is used, a layer draws its ellipsoids, and two of
    /// radiance caching show the relative bias of what is cached and its standard error by region of the picture.
    #[arg(long)]
    pub aov: bool,
    /// Writes times and counts.
    #[arg(long, value_name = "FILE.json")]
    pub stats: Option<PathBuf>,
    /// No progress bar and no summary.
    #[arg(short, long)]
    pub quiet: bool,
    /// Progress for other programs: a JSON object per line on standard output, with "event" and what belongs to it.
    #[arg(long, conflicts_with = "quiet")]
    pub json: bool,
    /// Names of the options that the user has given, if [`super::parse`] has read them.
    #[arg(skip)]
    pub given: Vec<String>,
    /// Whether nothing but what parts share is computed, for `fogbow fill`.
    #[arg(skip)]
    pub is_fill: bool,
    /// Of renders that may be interrupted.
    #[command(flatten)]
    pub keep: KeepArguments,
    /// Of renders that several machines share out.
    #[command(flatten)]
    pub parts: PartArguments,
    /// Of radiance caching.
    #[command(flatten)]
    pub cache: CacheArguments,
    /// Of photon beams.
    #[command(flatten)]
    pub beams: BeamArguments,
    /// Of virtual lights.
    #[command(flatten)]
    pub vpl: VplArguments,
    /// Of ray marching.
    #[command(flatten)]
    pub march: MarchArguments,
    /// Of adaptive sampling.
    #[command(flatten)]
    pub sampling: SamplingArguments,
    /// Of covariance grids.
    #[command(flatten)]
    pub covariance: CovarianceArguments,
}

/// An option with what [`RenderArguments::samples`] takes where it is not given.
fn told(option: Arg) -> Arg {
    match option.get_id().as_str() {
        "spp" => with_default(
            option,
            format!(
                "what the scene says, for radiance caching as --error wants, at most {}, for virtual lights one pass; with --time, as many as fit",
                cache::MOST_SAMPLES,
            ),
        ),
        "noise" => with_remark(
            option,
            format!("at least {} samples, without --spp at most {}", picture::LEAST_SAMPLES, picture::MOST_SAMPLES,),
        ),
        _ => option,
    }
}

/// How light is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Method {
    /// Volumetric path tracing: unbiased.
    Path,
    /// Volumetric radiance caching: smooth light computed at few points and carried to all others.
    RadianceCache,
    /// Progressive photon beams: the medium's light from beams sent by the lights, blurred less and less;
    /// surfaces' light as with `path`.
    PhotonBeams,
    /// Virtual lights with bias compensation: light scattered more than once from the vertices of paths from the lights.
    Vpl,
    /// Ray marching: the medium's light from steps along eye rays, each with a connection to a light and a path;
    /// surfaces' light as with `path`.
    March,
}

impl RenderArguments {
    /// Whether a file other than a picture is written or read, that has to be of this render.
    fn keeps_something(&self) -> bool {
        self.is_fill || self.keep.checkpoint.is_some() || self.parts.fill.is_some() || self.wants_film()
    }

    /// Whether sums are to be written.
    pub(super) fn wants_film(&self) -> bool {
        self.output.iter().any(|file| is_film(file))
    }

    /// What films are of, and a number for that: all that changes the picture but the number of samples, of which more may be asked for.
    pub(super) fn about(
        &self,
        method: Method,
        scene: &SceneFile,
        samples: u32,
        layers: &[&str],
    ) -> Result<(u64, About), Failure> {
        let keeps = self.keeps_something();
        let fingerprint = if keeps { self.scene.fingerprint()? } else { 0 };
        let Self { noise, max_depth, seed, size, camera, aov, cache, beams, vpl, march, sampling, covariance, .. } =
            self;
        let cache = CacheArguments { cache_in: None, cache_out: None, ..cache.clone() };
        let covariance = CovarianceArguments { grid_out: None, ..covariance.clone() };
        // Only what is written or read is worth the words.
        let (width, height) = size.unwrap_or((scene.sensor.width, scene.sensor.height));
        let options = if keeps {
            vec![
                ("method".to_owned(), method.name().to_owned()),
                ("size".to_owned(), format!("{width}x{height}")),
                ("seed".to_owned(), seed.to_string()),
                ("noise".to_owned(), noise.map_or_else(|| "none".to_owned(), |noise| noise.to_string())),
                (
                    "longest path".to_owned(),
                    max_depth.map_or_else(|| "as in the scene".to_owned(), |depth| depth.to_string()),
                ),
                ("camera".to_owned(), format!("{camera:?}")),
                ("sensor of the scene".to_owned(), format!("{:?}", scene.sensor)),
                ("integrator of the scene".to_owned(), format!("{:?}", scene.integrator)),
                ("option of radiance caching".to_owned(), format!("{cache:?}")),
                ("option of photon beams".to_owned(), format!("{beams:?}")),
                ("option of virtual lights".to_owned(), format!("{vpl:?}")),
                ("option of ray marching".to_owned(), format!("{march:?}")),
                ("option of adaptive sampling".to_owned(), format!("{sampling:?}")),
                ("option of covariance grids".to_owned(), format!("{covariance:?}")),
            ]
        } else {
            Vec::new()
        };
        let mut crc = Crc::new();
        crc.add(&fingerprint.to_le_bytes());
        options.iter().for_each(|(_, value)| crc.add(value.as_bytes()));
        layers.iter().for_each(|layer| crc.add(layer.as_bytes()));
        let scene = self.scene.file.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let about = About {
            program: env!("CARGO_PKG_VERSION").to_owned(),
            scene,
            fingerprint: format!("{fingerprint:016x}"),
            samples,
            options,
            layers: layers.iter().map(|layer| (*layer).to_owned()).collect(),
            has_layers: *aov,
            unfinished: None,
            parts: self.parts.parts(method, samples, [width, height]),
        };
        Ok((crc.value(), about))
    }

    /// Whether virtual lights' layers are kept: pixels that are filled in have none, and films of the same picture have the same layers.
    pub(super) fn is_audited(&self) -> bool {
        (self.aov || self.stats.is_some() && !self.wants_film()) && self.sampling.is_uniform()
    }

    /// How progress is shown.
    pub(super) fn voice(&self) -> Voice {
        match (self.quiet, self.json) {
            (true, _) => Voice::Quiet,
            (_, true) => Voice::Json,
            _ => Voice::Bar,
        }
    }

    /// Samples of a pixel at most, given what the scene names, and the noise at which fewer are enough.
    pub(super) fn samples(&self, method: Method, named: u32) -> (u32, Option<f64>) {
        let samples = match (self.spp, self.time, method) {
            (Some(spp), ..) => spp,
            (None, Some(_), _) => u32::MAX,
            (None, None, _) if self.noise.is_some() => picture::MOST_SAMPLES,
            (None, None, Method::RadianceCache) => cache::MOST_SAMPLES,
            (None, None, Method::Vpl) => self.beams.pass_samples.map_or(fogbow::vpl::SAMPLES, core::num::NonZero::get),
            (None, None, _) => named,
        };
        (samples, self.noise)
    }

    /// Whether anything asked for takes a covariance grid.
    pub(super) fn needs_grid(&self) -> bool {
        if !self.sampling.is_uniform() {
            return true;
        }
        match self.method {
            Some(Method::March) => self.march.step != Step::Uniform,
            Some(Method::PhotonBeams) => self.beams.kernel == Kernel::Covariance,
            None | Some(Method::Path | Method::RadianceCache | Method::Vpl) => false,
        }
    }
}
