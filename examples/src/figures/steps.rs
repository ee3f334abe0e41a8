//! Adaptive steps along eye rays: Figs 12 to 15 of Belcour et al. 2014.

use std::fmt::Write;
use std::path::Path;

use fogbow_std::film::Image;

use super::judged::Judges;
use super::plot::{BLUE, GREEN, Line, ORANGE, Plot};
use super::slices::colour;
use super::{Plan, montage, percent, rendered};
use crate::cli::Failure;

/// Samples per pixel, the same for all ways: errors from where in its pixel a ray starts are then the same, too.
const SPP: &str = "4";
/// Lengths of uniform steps (m).
const LENGTHS: [&str; 5] = ["2.4", "1.2", "0.6", "0.3", "0.15"];
/// Numbers of steps by error.
const COUNTS: [&str; 4] = ["4", "8", "16", "32"];
/// Longest steps by frequency (m).
const LONGEST: [&str; 4] = ["4.8", "2.4", "1.2", "0.6"];
/// Cells along the longest side; the middle one is used for all but the table of grids.
const EDGES: [&str; 3] = ["32", "64", "128"];

/// What one render gave.
struct Point {
    /// Points in the medium for which light was computed, per pixel.
    samples: f64,
    /// Processor time of the render, without the grid's (s).
    cpu: f64,
    /// Root of the mean squared relative error of light scattered once.
    error: f64,
    steps: Image,
}

struct Bench<'a> {
    plan: &'a Plan,
    size: [u32; 2],
    judges: Judges,
}

impl Bench<'_> {
    fn shot(&self, options: &[&str]) -> Result<(Point, rendered::Shot), Failure> {
        let words: Vec<&str> = common(SPP).into_iter().chain(options.iter().copied()).collect();
        let shot = rendered::shot(self.plan, &rendered::scene_of(self.plan, "nave"), self.size, &words)?;
        let steps = shot.layer("steps");
        let each = steps.pixels.iter().map(|p| f64::from(p[0])).sum::<f64>() / steps.pixels.len().max(1) as f64;
        let samples = each * f64::from(shot.rendered.outcome.samples);
        let error = self.judges.rel_mse(&shot.layer("medium_single")).sqrt();
        Ok((Point { samples, cpu: shot.seconds("render"), error, steps }, shot))
    }

    fn all(&self, options: &[Vec<&str>]) -> Result<Vec<Point>, Failure> {
        options.iter().map(|options| Ok(self.shot(options)?.0)).collect()
    }
}

fn common(spp: &'static str) -> Vec<&'static str> {
    vec!["--method", "march", "--max-depth", "2", "--aov", "--spp", spp]
}

/// A quantity at an error, between the points of a line, in logarithms; `None` beyond its ends.
fn at_error(points: &[Point], error: f64, of: fn(&Point) -> f64) -> Option<f64> {
    let mut sorted: Vec<[f64; 2]> = points.iter().map(|p| [p.error.ln(), of(p).ln()]).collect();
    sorted.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let e = error.ln();
    sorted.windows(2).find(|w| (w[0][0]..=w[1][0]).contains(&e)).map(|w| {
        let t = (e - w[0][0]) / (w[1][0] - w[0][0]).max(1e-12);
        (w[0][1] + (w[1][1] - w[0][1]) * t).exp()
    })
}

/// The error in the middle of those that both lines reach.
fn common_error(a: &[Point], b: &[Point]) -> Option<f64> {
    let least = |points: &[Point]| points.iter().map(|p| p.error).fold(f64::INFINITY, f64::min);
    let most = |points: &[Point]| points.iter().map(|p| p.error).fold(0.0, f64::max);
    let (low, high) = (least(a).max(least(b)), most(a).min(most(b)));
    (low < high).then(|| (low * high).sqrt())
}

/// How many times more uniform steps take at equal error, as a row: samples, time, time with the grid's.
fn ratios(name: &str, uniform: &[Point], adaptive: &[Point], fill: f64) -> String {
    let found = common_error(uniform, adaptive).and_then(|error| {
        let both = |of| Some([at_error(uniform, error, of)?, at_error(adaptive, error, of)?]);
        Some((error, both(|p| p.samples)?, both(|p| p.cpu)?))
    });
    found.map_or(format!("| {name} | no error in common | | | | |\n"), |(error, [us, s], [uc, c])| {
        let (samples, time, filled) = (us / s, uc / c, uc / (c + fill));
        // How much must be rendered for the grid to pay.
        let pays = if uc > c { format!("{:.1} times", fill / (uc - c)) } else { "never".to_owned() };
        format!(
            "| {name} | {} | {us:.0} / {s:.0} = {samples:.2} | {uc:.2} s / {c:.2} s = {time:.2} | {filled:.2} | {pays} |\n",
            percent(error)
        )
    })
}

fn plot<'a>(across: &'a str, of: fn(&Point) -> f64, lines: [(&'a str, &'a str, &[Point]); 3]) -> Plot<'a> {
    let all = || lines.iter().flat_map(|(_, _, points)| points.iter());
    let range = |of: fn(&Point) -> f64| {
        let values = || all().map(of).filter(|v| *v > 0.0);
        [values().fold(f64::INFINITY, f64::min) / 1.15, values().fold(0.0, f64::max) * 1.15]
    };
    let line = |(name, colour, points): (&'a str, &'a str, &[Point])| Line {
        name,
        colour,
        width: 1.6,
        points: points.iter().map(|p| [of(p), p.error]).collect(),
    };
    Plot { across, upwards: "relRMSE", x: range(of), y: range(|p| p.error), lines: lines.map(line).into() }
}

/// Step counts as colours, the brightest for `most`.
fn counted(steps: &Image, most: f32) -> Result<Image, Failure> {
    montage::made(steps.width, steps.height, |x, y| colour(steps.get(x, y).map_or(0.0, |p| p[0] / most)))
}

/// The section of the page.
pub(super) fn section(plan: &Plan) -> Result<String, Failure> {
    let folder = std::env::temp_dir().join(format!("fogbow-steps-{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    let result = measured(plan, &folder);
    std::fs::remove_dir_all(&folder)?;
    result
}

fn measured(plan: &Plan, folder: &Path) -> Result<String, Failure> {
    let (edge, paths, judging) = if plan.quick { (96, "1000000", "24") } else { (192, "1000000", "256") };
    let size = [edge, edge];
    let words: Vec<&str> = common(judging).into_iter().chain(["--step-length", "0.3"]).collect();
    let judges = Judges::rendered(plan, "nave", size, &words, |shot| shot.layer("medium_single"))?;
    let bench = Bench { plan, size, judges };
    let uniform = bench.all(&LENGTHS.map(|length| vec!["--step-length", length]))?;
    // Each grid is filled once, and its time taken.
    let mut grids = Vec::new();
    for cells in EDGES {
        let file = folder.join(cells).display().to_string();
        let options = ["--step", "covariance", "--grid-paths", paths, "--grid-cells", cells, "--grid-out", &file];
        let (_, shot) = bench.shot(&options)?;
        let fill = shot.seconds("fill grid");
        let of = |count| vec!["--step", "covariance", "--step-count", count, "--grid-in", &file];
        let points = bench.all(&COUNTS.map(of))?;
        grids.push((cells, fill, points, file));
    }
    let [_, (_, fill, covariance, file), _] = grids.as_slice() else { return Err("no grids".into()) };
    let by_frequency = |longest| vec!["--step", "frequency", "--step-length", longest, "--grid-in", file];
    let frequency = bench.all(&LONGEST.map(by_frequency))?;

    let lines =
        [("uniform", BLUE, uniform.as_slice()), ("covariance", ORANGE, covariance), ("frequency", GREEN, &frequency)];
    let plots = [
        ("samples", plot("samples in the medium per pixel", |p| p.samples, lines)),
        ("seconds", plot("processor time without the grid's (s)", |p| p.cpu, lines)),
    ];
    for (name, plot) in plots {
        plan.write(&format!("fig-12-{name}.svg"), &plot.svg_over_decades())?;
    }
    let shown = [&covariance[2].steps, &frequency[1].steps];
    let mut counts: Vec<f32> = shown.iter().flat_map(|steps| steps.pixels.iter().map(|p| p[0])).collect();
    counts.sort_by(f32::total_cmp);
    let most = counts.get(counts.len() * 99 / 100).copied().unwrap_or(1.0).max(1.0);
    let truth = bench.judges.mean();
    let truth = montage::brightened(&truth, rendered::gain(&truth));
    let by = if plan.quick { 2 } else { 1 };
    let images = [truth, counted(shown[0], most)?, counted(shown[1], most)?];
    let images = images.iter().map(|image| montage::enlarged(image, by)).collect::<Result<Vec<_>, _>>()?;
    montage::save(&plan.output.join("fig-12-steps.png"), &montage::beside(&images)?, 0.0)?;

    let mut page = format!(
        "## Figs 12 to 15: steps along eye rays\n\n![light and steps](fig-12-steps.png)\n\nThe nave, light scattered at most once, \
         {edge} × {edge} pixels: left light scattered by the medium, then how many steps a ray takes, black for none and \
         brightest for {most:.0} or more: in the middle with `--step covariance --step-count {}`, right with `--step frequency \
         --step-length {}` (B's Alg. 1, which does not ask how bright light is).\n\n\
         ![error by samples](fig-12-samples.svg)\n\n![error by time](fig-12-seconds.svg)\n\n\
         relRMSE of that light, with {SPP} samples per pixel for all, so that the noise of where rays start in their pixels is \
         the same; uniform steps of {} m; steps by covariance with `--step-count` {}; by frequency with `--step-length` {} m. The grid \
         has 64 cells along its longest side, {paths} photons and took {fill:.2} s. The truth are two renders with \
         {judging} samples per pixel and uniform steps of 0.3 m, without bias as all of them are, used so that their \
         noise cancels.\n\nAt equal error, uniform steps over adaptive ones, halfway (in logarithms) between the errors that both \
         reach:\n\n| steps | relRMSE | samples in the medium per pixel | processor time | with the grid's fill | pays for itself from |\n|---|---|---|---|---|---|\n",
        COUNTS[2],
        LONGEST[1],
        LENGTHS.join(", "),
        COUNTS.join(", "),
        LONGEST.join(", "),
    );
    for (cells, fill, points, _) in &grids {
        page += &ratios(&format!("covariance, {cells} cells"), &uniform, points, *fill);
    }
    page += &ratios("frequency, 64 cells", &uniform, &frequency, *fill);
    page += "\nThe grid is filled once, whatever is rendered with it: the last column says for how many times the pixels, samples or \
             frames of this small picture it has paid for itself.\n\nAll that was measured, errors with samples in the medium per pixel and processor time:\n\n";
    let coarse_to_fine = |points: &[Point]| -> String {
        let cell = |p: &Point| format!("{} ({:.0}, {:.2} s)", percent(p.error), p.samples, p.cpu);
        points.iter().map(cell).collect::<Vec<_>>().join(" | ")
    };
    page += "| steps | fill | coarsest first | | | | |\n|---|---|---|---|---|---|---|\n";
    // Writing to a string cannot fail.
    let _ = writeln!(page, "| uniform | | {} |", coarse_to_fine(&uniform));
    for (cells, fill, points, _) in &grids {
        let _ = writeln!(page, "| covariance, {cells} cells | {fill:.2} s | {} | |", coarse_to_fine(points));
    }
    let _ = writeln!(page, "| frequency, 64 cells | {fill:.2} s | {} | |\n", coarse_to_fine(&frequency));
    Ok(page)
}
