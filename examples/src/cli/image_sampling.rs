//! `--image-sampling covariance`: fewer pixels computed where light is smooth.

use clap::{Arg, Args, ValueEnum};
use fogbow::covariance::image_sampling::{self, Computed, FillingIn, LEAST_PLAN, Plan, Planning, USUAL_SHARE};
use fogbow::covariance::{GridView, filter_precision};
use fogbow::host::Medium;
use fogbow::light::Lights;
use fogbow::math::{Ray, Vec2};
use fogbow::spectrum::Spectrum;
use fogbow::storage::Full;
use fogbow_std::film::{Film, Image};
use fogbow_std::progress::Control;
use fogbow_std::stats::Seconds;
use fogbow_std::threads::{self, Threads};
use fogbow_std::tiles::Sample;

use super::Failure;
use super::defaults::with_remark;
use super::render::CACHE_LAYERS;
use crate::camera::Camera;
use crate::statistics::Statistics;
use crate::world::{WithMedium, World};

/// Options of adaptive sampling.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Adaptive sampling", mut_args(told))]
pub struct SamplingArguments {
    /// At which pixels light scattered by the medium is computed; surfaces are at all.
    #[arg(long, value_enum, default_value_t = ImageSampling::Uniform)]
    pub image_sampling: ImageSampling,
    /// Share of pixels that `--image-sampling covariance` computes at most.
    #[arg(long, value_name = "SHARE", value_parser = share, default_value_t = USUAL_SHARE)]
    pub image_share: f32,
}

/// At which pixels light of the medium is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ImageSampling {
    /// At all.
    Uniform,
    /// Where it varies, by its covariance; the others are filled in with anisotropic filters.
    Covariance,
}

/// An option with its limits.
fn told(option: Arg) -> Arg {
    match option.get_id().as_str() {
        "image_share" => with_remark(option, format!("from {LEAST_PLAN} to 1")),
        _ => option,
    }
}

fn share(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(value) if (LEAST_PLAN..=1.0).contains(&value) => Ok(value),
        _ => Err(format!("must be a number from {LEAST_PLAN} to 1")),
    }
}

impl SamplingArguments {
    /// Whether all pixels are computed.
    pub(super) fn is_uniform(&self) -> bool {
        self.image_sampling == ImageSampling::Uniform
    }

    /// Which pixels are computed; `None` for all.
    pub(super) fn plan(
        &self,
        sight: Sight<'_>,
        (width, height): (u32, u32),
        threads: &Threads,
        statistics: &mut Statistics,
    ) -> Result<Option<Plan<'static>>, Failure> {
        if self.is_uniform() {
            return Ok(None);
        }
        let mut planning = Planning::new([width, height], self.image_share)?;
        let stages = sight.world.media().with(PlanJob { sight, planning: &mut planning, threads });
        stages.iter().for_each(|(stage, seconds)| statistics.add(stage, *seconds));
        Ok(Some(planning.finish()))
    }
}

/// What is seen, and from where.
#[derive(Clone, Copy)]
pub(super) struct Sight<'a> {
    pub(super) world: &'a World<'a>,
    pub(super) lights: Lights<'a>,
    pub(super) camera: Camera,
    pub(super) grid: GridView<'a>,
}

struct PlanJob<'a> {
    sight: Sight<'a>,
    planning: &'a mut Planning<'static>,
    threads: &'a Threads,
}

impl WithMedium for PlanJob<'_> {
    /// Times by stage.
    type Output = Vec<(&'static str, Seconds)>;

    fn with<M: Medium + Sync>(self, medium: &M) -> Self::Output {
        let Sight { world, lights, camera, grid } = self.sight;
        let world = fogbow::world::World { medium, scene: world, lights };
        let ray = |at: [f32; 2]| -> Ray { camera.ray(Vec2::from(at)) };
        let sight = image_sampling::Sight { world, grid, ray };
        threads::run(self.planning, &sight, self.threads, &Control::default(), None, |_| {}).stages
    }
}

/// Layers that adaptive sampling adds: which pixels were computed, the density wanted, and the filter's standard
/// deviations along its axes (pixels) with the angle (rad) of the longer from the rows.
const OWN: [&str; 3] = ["computed", "density", "filter"];

/// Whether the medium's light is wanted at a pixel, or filled in from others.
#[inline]
pub(super) fn is_computed(plan: Option<&Plan<'_>>, sample: &Sample<'_>, width: u32) -> bool {
    plan.is_none_or(|plan| plan.is_computed((sample.y * width + sample.x) as usize))
}

/// The film with light of the medium filled in.
pub(super) fn finished(film: &Film, plan: &Plan<'_>, has_layers: bool, threads: &Threads) -> Result<Film, Failure> {
    let mut layers: Vec<Image> = (0..film.layers().len()).filter_map(|i| film.mean(i)).collect();
    for (layer, name) in layers.iter_mut().zip(film.layers()) {
        if name.starts_with("medium") {
            *layer = filled(plan, layer, threads)?;
        }
    }
    let names: Vec<&str> =
        if has_layers { film.layers().iter().map(String::as_str).chain(OWN).collect() } else { vec!["total"] };
    let mut out = Film::new(film.width(), film.height(), &names)?;
    // Layers of light, in any method; ray marching has one that counts.
    let parts = film.layers().iter().skip(1).take_while(|name| CACHE_LAYERS.contains(&name.as_str())).count();
    let mut colours = Vec::new();
    for index in 0..layers[0].pixels.len() {
        colours.clear();
        colours.push(layers[1..=parts].iter().map(|layer| layer.pixels[index]).sum::<Spectrum>());
        if has_layers {
            colours.extend(layers[1..].iter().map(|layer| layer.pixels[index]));
            colours.push(Spectrum::splat(f32::from(u8::from(plan.is_computed(index)))));
            colours.push(Spectrum::splat(plan.density(index)));
            colours.push(ellipse(plan, index));
        }
        let index = index as u32;
        out.add(index % film.width(), index / film.width(), &colours);
    }
    Ok(out)
}

/// The image that the computed pixels of `image` give; the others' values are not read.
fn filled(plan: &Plan<'_>, image: &Image, threads: &Threads) -> Result<Image, Full> {
    if plan.size() != [image.width, image.height] {
        return Err(Full);
    }
    let mut pixels = vec![Spectrum::ZERO; image.pixels.len()];
    let mut work = FillingIn::new(plan, &mut pixels[..])?;
    let computed = Computed { plan, pixels: &image.pixels };
    threads::run(&mut work, &computed, threads, &Control::default(), None, |_| {});
    Ok(Image { width: image.width, height: image.height, pixels })
}

fn ellipse(plan: &Plan<'_>, index: usize) -> Spectrum {
    let precision = filter_precision(&plan.shape(index));
    let eigen = precision.eigen();
    let [short, long] = eigen.values.map(|value| 1.0 / value.max(1e-12).sqrt());
    let [x, y] = eigen.vectors[1];
    Spectrum::new(long, short, y.atan2(x))
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use crate::cli::render::render;
    use crate::cli::{Arguments, Command};

    /// Mean light of the medium, of all else, and the share of computed pixels where there is one; in the lantern, light
    /// scattered once.
    fn means(options: &[&str]) -> (f64, f64, f64) {
        let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/lantern.xml");
        let common = ["fogbow", "render", scene, "--size", "48x48", "--max-depth", "2", "--aov", "-q", "-o", "a.exr"];
        let arguments = Arguments::try_parse_from(common.iter().chain(options)).unwrap();
        let Command::Render(arguments) = arguments.command else { panic!("no render") };
        let film = render(&arguments).unwrap().film;
        let mean = |is_wanted: &dyn Fn(&str) -> bool| -> f64 {
            let layers = film.layers().iter().enumerate().filter(|(_, name)| is_wanted(name));
            let sums =
                layers.map(|(i, _)| film.mean(i).unwrap().pixels.iter().map(|p| f64::from(p.mean())).sum::<f64>());
            sums.sum::<f64>() / f64::from(film.width() * film.height())
        };
        let (medium, computed) = (mean(&|name| name.starts_with("medium")), mean(&|name| name == "computed"));
        let others = mean(&|name| name.starts_with("surface") || name == "emitted");
        let total = mean(&|name| name == "total");
        assert!((total - medium - others).abs() < 1e-4 * total, "{total} instead of {medium} + {others}");
        (medium, others, computed)
    }

    #[test]
    fn filled_in_light_is_as_bright_as_converged_light() {
        let file = std::env::temp_dir().join(format!("fogbow-sampling-{}", std::process::id()));
        let grid = file.to_str().unwrap();
        let sampling = ["--method", "march", "--image-sampling", "covariance"];
        means(&[&sampling[..], &["--spp", "1", "--grid-out", grid]].concat());
        let (converged, ..) = means(&["--method", "march", "--spp", "256", "--seed", "99"]);
        let biases: Vec<f64> = (0..8)
            .map(|seed: u32| {
                let seed = seed.to_string();
                let options = ["--spp", "16", "--seed", seed.as_str(), "--grid-in", grid];
                means(&[&sampling[..], &options].concat()).0 / converged - 1.0
            })
            .collect();
        std::fs::remove_file(file).unwrap();
        let mean = biases.iter().sum::<f64>() / 8.0;
        let error = (biases.iter().map(|b| (b - mean).powi(2)).sum::<f64>() / (7.0 * 8.0)).sqrt();
        assert!(error < 0.008, "too noisy to tell: {biases:?}");
        // The filters round off the brightest pixels beside the lamp, which at this size are few. Without weights by density
        // the picture is brighter by a seventh.
        assert!(mean.abs() < 0.02 + 3.5 * error, "bias {mean} ± {error}: {biases:?}");
    }

    #[test]
    fn every_method_has_pixels_filled_in() {
        for method in ["path", "march", "photon-beams", "radiance-cache"] {
            let options = ["--method", method, "--spp", "32"];
            let all = means(&options);
            let some = means(&[&options[..], &["--image-sampling", "covariance", "--grid-paths", "30000"]].concat());
            assert!(all.2 == 0.0 && some.2 > 0.35 && some.2 <= 0.4, "{method}: {some:?}");
            // Surfaces are computed at all pixels; noise of the medium's light is some per cent.
            assert!((some.1 / all.1 - 1.0).abs() < 0.02, "{method}: {some:?} instead of {all:?}");
            assert!((some.0 / all.0 - 1.0).abs() < 0.08, "{method}: {some:?} instead of {all:?}");
        }
    }
}
