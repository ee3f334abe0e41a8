//! `--image-sampling covariance`: fewer pixels computed where light is smooth.

use clap::{Args, ValueEnum};
use fogbow::covariance::{Grid, filter_precision, image_covariance};
use fogbow::host::{Medium, Scene};
use fogbow::math::{Frame, Ray, Symmetric2, Vec2};
use fogbow::spectrum::Spectrum;
use fogbow_std::film::{Film, Image};
use fogbow_std::image_sampling::{Outlook, Plan};
use fogbow_std::stats::Statistics;
use fogbow_std::tiles::Sample;

use super::Failure;
use super::render::CACHE_LAYERS;
use crate::camera::Camera;
use crate::world::{WithMedium, World};

/// Options of adaptive sampling.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Adaptive sampling")]
pub struct SamplingArguments {
    /// At which pixels light scattered by the medium is computed; surfaces are at all.
    #[arg(long, value_enum, default_value_t = ImageSampling::Uniform)]
    pub image_sampling: ImageSampling,
    /// Share of pixels that `--image-sampling covariance` computes at most, from 0.05 to 1.
    #[arg(long, value_name = "SHARE", value_parser = share, default_value_t = 0.4)]
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

fn share(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(value) if (0.05..=1.0).contains(&value) => Ok(value),
        _ => Err("must be a number from 0.05 to 1".to_owned()),
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
        world: &World<'_>,
        camera: Camera,
        grid: Option<&Grid<'_>>,
        size: (u32, u32),
        statistics: &mut Statistics,
    ) -> Option<Plan> {
        let grid = grid.filter(|_| !self.is_uniform())?;
        Some(statistics.time("plan", || {
            let outlooks = world.media().with(PlanJob { world, camera, grid, size });
            Plan::new(size.0, size.1, self.image_share, outlooks)
        }))
    }
}

struct PlanJob<'a> {
    world: &'a World<'a>,
    camera: Camera,
    grid: &'a Grid<'a>,
    size: (u32, u32),
}

impl WithMedium for PlanJob<'_> {
    type Output = Vec<Outlook>;

    fn with<M: Medium + Sync>(self, medium: &M) -> Self::Output {
        let (width, height) = self.size;
        let ray = |x: f32, y: f32| self.camera.ray(Vec2::new(x / width as f32, y / height as f32));
        let outlook = |index: u32| {
            let (x, y) = ((index % width) as f32 + 0.5, (index / width) as f32 + 0.5);
            let centre = ray(x, y);
            let hit = self.world.closest_hit(&centre);
            let depth = hit.map_or(f32::INFINITY, |hit| hit.distance);
            // One pixel to the right and one down, as angles.
            let w = centre.direction;
            let (right, down) = (ray(x + 1.0, y).direction - w, ray(x, y + 1.0).direction - w);
            let frame = Frame::around(w);
            let columns = [right, down].map(|d| Vec2::new(d.dot(frame.u), d.dot(frame.v)));
            let seen = image_covariance(&Ray { length: depth, ..centre }, &frame, self.grid, medium);
            Outlook { covariance: seen.map(|p| in_pixels(&p, columns)), depth }
        };
        (0..width * height).map(outlook).collect()
    }
}

/// `Jᵀ P J`: from cycles per radian to cycles per pixel.
fn in_pixels(p: &Symmetric2, [a, b]: [Vec2; 2]) -> Symmetric2 {
    let between = |a: Vec2, b: Vec2| p.xx * a.x * b.x + p.xy * (a.x * b.y + a.y * b.x) + p.yy * a.y * b.y;
    Symmetric2::new(between(a, a), between(a, b), between(b, b))
}

/// Layers that adaptive sampling adds: which pixels were computed, the density wanted, and the filter's standard
/// deviations along its axes (pixels) with the angle (rad) of the longer from the rows.
const OWN: [&str; 3] = ["computed", "density", "filter"];

/// Whether the medium's light is wanted at a pixel, or filled in from others.
#[inline]
pub(super) fn is_computed(plan: Option<&Plan>, sample: &Sample<'_>, width: u32) -> bool {
    plan.is_none_or(|plan| plan.computed[(sample.y * width + sample.x) as usize])
}

/// The film with light of the medium filled in.
pub(super) fn finished(film: &Film, plan: &Plan, has_layers: bool) -> Result<Film, Failure> {
    let mut layers: Vec<Image> = (0..film.layers().len()).filter_map(|i| film.mean(i)).collect();
    for (layer, name) in layers.iter_mut().zip(film.layers()) {
        if name.starts_with("medium") {
            *layer = plan.filled(layer);
        }
    }
    let names: Vec<&str> =
        if has_layers { film.layers().iter().map(String::as_str).chain(OWN).collect() } else { vec!["total"] };
    let mut out = Film::new(film.width(), film.height(), &names)?;
    // Layers of light, in any method; ray marching has one that counts.
    let parts = film.layers().iter().skip(1).take_while(|name| CACHE_LAYERS.contains(&name.as_str())).count();
    let mut colours = Vec::new();
    for index in 0..plan.computed.len() {
        colours.clear();
        colours.push(layers[1..=parts].iter().map(|layer| layer.pixels[index]).sum::<Spectrum>());
        if has_layers {
            colours.extend(layers[1..].iter().map(|layer| layer.pixels[index]));
            colours.push(Spectrum::splat(f32::from(u8::from(plan.computed[index]))));
            colours.push(Spectrum::splat(plan.density[index]));
            colours.push(ellipse(plan, index));
        }
        let index = index as u32;
        out.add(index % film.width(), index / film.width(), &colours);
    }
    Ok(out)
}

fn ellipse(plan: &Plan, index: usize) -> Spectrum {
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
