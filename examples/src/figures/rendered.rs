//! Figures 6 to 10: radiance caching beside path tracing, given as much processor time.

use std::path::Path;

use clap::Parser;
use fogbow::cache::Kind;
use fogbow::math::Vec3;
use fogbow::spectrum::Spectrum;
use fogbow_std::film::Image;
use fogbow_std::tiles::Reason;

use super::{Plan, montage, records};
use crate::cli::render::{Rendered, render};
use crate::cli::{Arguments, Command, Failure};
use crate::plume::{self, Plume};

/// A picture, and what it took.
pub(super) struct Shot {
    pub(super) image: Image,
    /// Processor time (s).
    pub(super) cpu: f64,
    samples: u32,
    pub(super) rendered: Rendered,
}

impl Shot {
    /// Processor time (s) of one phase.
    pub(super) fn seconds(&self, phase: &str) -> f64 {
        let phases = &self.rendered.statistics.phases;
        phases.iter().find(|(name, _)| name == phase).map_or(0.0, |(_, s)| s.cpu.unwrap_or(s.wall))
    }

    /// A layer, if there is one of that name; else black.
    pub(super) fn layer(&self, name: &str) -> Image {
        let film = &self.rendered.film;
        let index = film.layers().iter().position(|layer| layer == name);
        index.and_then(|index| film.mean(index)).unwrap_or_else(|| montage::brightened(&self.image, 0.0))
    }

    /// Light scattered by the medium.
    pub(super) fn medium(&self) -> Image {
        let mut sum = self.layer("medium_single");
        let multiple = self.layer("medium_multiple");
        sum.pixels.iter_mut().zip(&multiple.pixels).for_each(|(a, b)| *a += *b);
        sum
    }

    fn records(&self, name: &str) -> u64 {
        self.rendered.statistics.records.iter().find(|(n, _)| n == name).map_or(0, |(_, count)| *count)
    }
}

pub(super) fn shot(plan: &Plan, scene: &Path, size: [u32; 2], options: &[&str]) -> Result<Shot, Failure> {
    let words = [
        vec!["fogbow".to_owned(), "render".to_owned(), scene.display().to_string(), "--quiet".to_owned()],
        vec!["--size".to_owned(), format!("{}x{}", size[0], size[1]), "--threads".to_owned(), plan.threads.to_string()],
        options.iter().map(|word| (*word).to_owned()).collect(),
    ];
    let Command::Render(arguments) = Arguments::try_parse_from(words.concat())?.command else {
        return Err("no render".into());
    };
    let rendered = render(&arguments)?;
    if rendered.outcome.reason == Reason::Cancelled {
        return Err("stopped".into());
    }
    let image = rendered.film.mean(0).ok_or("no picture")?;
    let phases = &rendered.statistics.phases;
    let counts = |name: &str| name == "render" || name.starts_with("fill");
    let cpu = phases.iter().filter(|(name, _)| counts(name)).map(|(_, s)| s.cpu.unwrap_or(s.wall)).sum();
    Ok(Shot { image, cpu, samples: rendered.outcome.samples, rendered })
}

/// Both methods on a scene.
struct Pair {
    cached: Shot,
    /// As much processor time.
    traced: Shot,
    /// Two path-traced pictures more, each as good as `traced`, with random numbers of their own.
    judges: [Image; 2],
}

/// Walks of a record and samples of a pixel; few, because four pictures share the time, three of them path-traced.
pub(super) fn efforts(plan: &Plan) -> [u32; 2] {
    if plan.quick { [64, 8] } else { [512, 32] }
}

fn pair(plan: &Plan, scene: &Path, size: [u32; 2], options: &[&str]) -> Result<Pair, Failure> {
    let [walks, samples] = efforts(plan).map(|number| number.to_string());
    let mut words = vec!["--method", "radiance-cache", "--spp", &samples, "--paths", &walks];
    if plan.quick {
        words.extend(["--tolerance-of", "multiple=2", "--tolerance-of", "surface=3"]);
        words.extend(["--tolerance-of", "irradiance=1", "--tolerance-of", "single=0.5"]);
    }
    words.extend(options);
    let cached = shot(plan, scene, size, &words)?;
    // A first few samples tell how many fit into the time.
    let probe = shot(plan, scene, size, &["--method", "path", "--spp", "2", "--seed", "9"])?;
    let spp = ((2.0 * cached.cpu / probe.cpu.max(1e-9)).round() as u32).max(1).to_string();
    let trace = |seed: &str| shot(plan, scene, size, &["--method", "path", "--spp", &spp, "--seed", seed]);
    let traced = trace("1")?;
    let judges = [trace("2")?.image, trace("3")?.image];
    Ok(Pair { cached, traced, judges })
}

/// Root of the mean square error over that of the truth. Two pictures without bias, independent of each other and
/// of this one, stand in for the truth: the mean of `(image − a)(image − b)` holds none of their noise.
fn error(image: &Image, [a, b]: &[Image; 2]) -> f64 {
    let (mut wrong, mut light) = (0.0, 0.0);
    for ((p, a), b) in image.pixels.iter().zip(&a.pixels).zip(&b.pixels) {
        for c in 0..3 {
            let (p, a, b) = (f64::from(p[c]), f64::from(a[c]), f64::from(b[c]));
            wrong += (p - a) * (p - b);
            light += a * b;
        }
    }
    (wrong.max(0.0) / light.max(f64::MIN_POSITIVE)).sqrt()
}

/// By how much to brighten: nine tenths of the pixels shall stay below this.
pub(super) fn gain(image: &Image) -> f32 {
    let mut means: Vec<f32> = image.pixels.iter().map(|pixel| pixel.mean()).collect();
    means.sort_by(f32::total_cmp);
    0.6 / means.get(means.len() * 9 / 10).copied().unwrap_or(1.0).max(1e-9)
}

/// A picture by caching with a part of it enlarged below, left by caching, right by path tracing.
fn with_insets(pair: &Pair, centre: [f32; 2]) -> Result<Image, Failure> {
    let gain = gain(&pair.cached.image);
    let mut main = montage::brightened(&pair.cached.image, gain);
    let (width, height) = (main.width, main.height);
    let part = [(width - 4) / 4, height / 5];
    let corner = |at: f32, size: u32, part: u32| ((at * size as f32) as u32).saturating_sub(part / 2).min(size - part);
    let from = [corner(centre[0], width, part[0]), corner(centre[1], height, part[1])];
    let inset = |image: &Image| montage::enlarged(&montage::brightened(&montage::crop(image, from, part)?, gain), 2);
    let insets = [inset(&pair.cached.image)?, inset(&pair.traced.image)?];
    montage::frame(&mut main, from, part);
    montage::above(&[main, montage::beside(&insets)?])
}

/// Times, records and errors as a row of a table.
fn row(name: &str, pair: &Pair) -> String {
    let records: Vec<String> = Kind::FINAL.iter().map(|kind| pair.cached.records(kind.name()).to_string()).collect();
    format!(
        "| {name} | {:.1} s | {} | {:.2} % | {:.1} s, {} spp | {:.2} % |\n",
        pair.cached.cpu,
        records.join(" / "),
        100.0 * error(&pair.cached.image, &pair.judges),
        pair.traced.cpu,
        pair.traced.samples,
        100.0 * error(&pair.traced.image, &pair.judges),
    )
}

const HEAD: &str = "| scene | caching, processor time | records: single / surface / multiple / irradiance | error | \
                    path tracing | error |\n|---|---|---|---|---|---|\n";

const BOXES: [&str; 4] =
    ["homogeneous-isotropic", "homogeneous-anisotropic", "heterogeneous-isotropic", "heterogeneous-anisotropic"];

pub(super) fn scene_of(plan: &Plan, name: &str) -> std::path::PathBuf {
    plan.scenes.join(format!("{name}.xml"))
}

/// Fig. 6, and Fig. 7 from its first picture.
pub(super) fn boxes(plan: &Plan) -> Result<String, Failure> {
    let edge = if plan.quick { 96 } else { 240 };
    let mut page = format!(
        "## Fig. 6: smoke boxes\n\nA closed room with a lamp under the ceiling, two mirror balls and smoke. Below each \
         picture a part of it: left by radiance caching, right by path tracing with as much processor time. \
         {edge} × {edge} pixels. (J: 1.5 to 7.5 minutes for {:.0} times as many, on one core of 2006.)\n\n",
        (1024.0 / f64::from(edge)).powi(2),
    );
    let mut table = HEAD.to_owned();
    let mut seventh = None;
    for name in BOXES {
        plan.say(&format!("figure 6, {name}"));
        let pair = pair(plan, &scene_of(plan, &format!("smoke-box-{name}")), [edge, edge], &[])?;
        let file = format!("fig-06-{name}.png");
        montage::save(&plan.output.join(&file), &with_insets(&pair, [0.66, 0.66])?, 0.0)?;
        page += &format!("![{name}]({file}) ");
        table += &row(name, &pair);
        seventh.get_or_insert(pair.cached);
    }
    page += &format!("\n\n{table}\n");
    if let Some(cached) = seventh.filter(|_| plan.wants(7)) {
        page += &dots(plan, &cached)?;
    }
    Ok(page)
}

/// Fig. 7: where the records of a picture lie.
fn dots(plan: &Plan, cached: &Shot) -> Result<String, Failure> {
    let size = [cached.image.width, cached.image.height];
    let Some(caches) = &cached.rendered.caches else { return Ok(String::new()) };
    let mut images = Vec::new();
    for kind in [Kind::Surface, Kind::Multiple, Kind::Irradiance] {
        let points: Vec<Vec3> = caches.records(kind).iter().map(|r| r.position).collect();
        images.push(records::seen(&points, &cached.rendered.camera, size)?);
    }
    montage::save(&plan.output.join("fig-07-records.png"), &montage::beside(&images)?, 0.0)?;
    Ok(format!(
        "## Fig. 7: records\n\n![records](fig-07-records.png)\n\nThe records of the first box as the camera sees them, a \
         dot each. From left to right: light from surfaces ({}), light scattered more than once ({}), irradiance on \
         surfaces ({}). Light straight from the lamp is not cached here: with few lights every point connects to \
         them.\n\n",
        cached.records("surface"),
        cached.records("multiple"),
        cached.records("irradiance"),
    ))
}

/// Fig. 8.
pub(super) fn atrium(plan: &Plan) -> Result<String, Failure> {
    plan.say("figure 8");
    let size = if plan.quick { [120, 90] } else { [288, 216] };
    let pair = pair(plan, &scene_of(plan, "atrium"), size, &[])?;
    montage::save(&plan.output.join("fig-08-atrium.png"), &with_insets(&pair, [0.45, 0.55])?, 0.0)?;
    let caches = pair.cached.rendered.caches.as_ref();
    let surface = caches.iter().flat_map(|caches| caches.records(Kind::Surface));
    let points: Vec<Vec3> = surface.map(|r| r.position).collect();
    let (low, high) = (Vec3::new(-13.2, 0.0, -6.2), Vec3::new(13.2, 0.0, 6.2));
    let section = records::section(&points, [0.0, 2.0], low, high, 640)?;
    montage::save(&plan.output.join("fig-08-section.png"), &section, 0.0)?;
    Ok(format!(
        "## Fig. 8: atrium\n\n![atrium](fig-08-atrium.png)\n\n![records near the floor](fig-08-section.png)\n\nShafts of \
         sunlight in haze; below left caching, right path tracing. The section shows the records of light from surfaces \
         up to 2 m above the floor, from above; the camera stands at the left and looks to the right. Light straight \
         from the sun is not cached, as in the paper.\n\n{HEAD}{}\n",
        row("atrium", &pair)
    ))
}

/// Fig. 9: a plume, frame by frame.
pub(super) fn animation(plan: &Plan) -> Result<String, Failure> {
    let (frames, edge, cells) = if plan.quick { (3, 48, 32) } else { (6, 192, 64) };
    let folder = std::env::temp_dir().join(format!("fogbow-figures-{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    let result = flicker(plan, &folder, frames, edge, cells);
    std::fs::remove_dir_all(&folder)?;
    result
}

fn flicker(plan: &Plan, folder: &Path, frames: u32, edge: u32, cells: u32) -> Result<String, Failure> {
    let mut plume = Plume::new(cells);
    let mut pairs = Vec::new();
    for frame in 0..frames {
        plan.say(&format!("figure 9, frame {} of {frames}", frame + 1));
        let volume = format!("{frame}.vol");
        plume.next_frame().write(&folder.join(&volume))?;
        let scene = folder.join(format!("{frame}.xml"));
        std::fs::write(&scene, plume::scene(&volume))?;
        // Every frame has caches and random numbers of its own.
        let seed = (frame + 10).to_string();
        pairs.push(pair(plan, &scene, [edge, edge], &["--seed", &seed])?);
    }
    let first = pairs.first().ok_or("no frames")?;
    let gain = gain(&first.cached.image);
    let strip = |of: fn(&Pair) -> &Image| {
        let part = |p: &Pair| montage::crop(of(p), [edge / 4, edge / 3], [edge / 2, edge / 2]);
        let images = pairs.iter().take(3).map(|p| Ok(montage::brightened(&part(p)?, gain)));
        montage::beside(&images.collect::<Result<Vec<_>, Failure>>()?)
    };
    let sheet = montage::above(&[strip(|p| &p.cached.image)?, strip(|p| &p.traced.image)?])?;
    montage::save(&plan.output.join("fig-09-plume.png"), &sheet, 0.0)?;
    let mean = |of: fn(&Pair) -> f64| pairs.iter().map(of).sum::<f64>() / pairs.len() as f64;
    Ok(format!(
        "## Fig. 9: an animation\n\n![frames](fig-09-plume.png)\n\nParts of consecutive frames of rising smoke, {edge} × {edge} \
         pixels, twelve a second; above by caching, with caches made anew for every frame, below by path tracing. Over \
         {frames} frames:\n\n| | processor time per frame | flicker | error |\n|---|---|---|---|\n\
         | caching | {:.1} s | {:.2} % | {:.2} % |\n| path tracing | {:.1} s | {:.2} % | {:.2} % |\n\n\
         Flicker is the standard deviation over the frames of a frame minus its truth, over the root of the mean square of \
         the truth: what of the error changes from frame to frame.\n\n",
        mean(|p| p.cached.cpu),
        100.0 * deviation(&pairs, |p| &p.cached.image),
        100.0 * mean(|p| error(&p.cached.image, &p.judges)),
        mean(|p| p.traced.cpu),
        100.0 * deviation(&pairs, |p| &p.traced.image),
        100.0 * mean(|p| error(&p.traced.image, &p.judges)),
    ))
}

/// The covariance over frames of `(frame − a)` and `(frame − b)`, which is the variance of `frame − truth` whatever the
/// noise of the judges; its root over that of the mean square of the truth.
fn deviation(pairs: &[Pair], of: fn(&Pair) -> &Image) -> f64 {
    let count = pairs.len() as f64;
    let pixels = pairs.first().map_or(0, |p| of(p).pixels.len());
    let (mut variance, mut light) = (0.0, 0.0);
    for i in 0..pixels {
        for c in 0..3 {
            let value = |image: &Image| f64::from(image.pixels.get(i).map_or(0.0, |p: &Spectrum| p[c]));
            let apart = |p: &Pair, judge: usize| value(of(p)) - value(&p.judges[judge]);
            let [a, b] = [0, 1].map(|judge| pairs.iter().map(|p| apart(p, judge)).sum::<f64>() / count);
            variance += pairs.iter().map(|p| (apart(p, 0) - a) * (apart(p, 1) - b)).sum::<f64>() / (count - 1.0);
            light += pairs.iter().map(|p| value(&p.judges[0]) * value(&p.judges[1])).sum::<f64>() / count;
        }
    }
    (variance.max(0.0) / light.max(f64::MIN_POSITIVE)).sqrt()
}

/// Fig. 10a.
pub(super) fn road(plan: &Plan) -> Result<String, Failure> {
    plan.say("figure 10");
    let size = if plan.quick { [120, 68] } else { [320, 180] };
    // A record of single scattering marches to every one of the lights, and there is one around each: a point of the
    // picture that connects to one light at a time is cheaper.
    let pair = pair(plan, &scene_of(plan, "foggy-road"), size, &["--single", "direct"])?;
    montage::save(&plan.output.join("fig-10-road.png"), &with_insets(&pair, [0.42, 0.65])?, 0.0)?;
    Ok(format!(
        "## Fig. 10: a road in fog\n\n![road](fig-10-road.png)\n\nTwo cars in patchy fog with 60 lights; below left caching, \
         right path tracing. Unlike J's, light straight from the lights is connected to and not cached. The comparison with \
         photon mapping (10b) is left out: there is none here.\n\n{HEAD}{}\n",
        row("foggy road", &pair)
    ))
}
