//! Figures of papers, rebuilt with the scenes here, and pages that explain them: of Jarosz et al. 2008, *Radiance Caching
//! for Participating Media* (J), of Belcour et al. 2014 (B) and of Engelhardt et al. 2012 (E). Every number on a page is measured as it is made.
//!
//! | file | holds |
//! |---|---|
//! | [`radius`] | Fig. 4: valid radii against the optimal one |
//! | [`extrapolation`] | Fig. 5: records carried in four ways |
//! | `rendered` | Fig. 6 to 10: pictures beside path tracing |
//! | `records` | where records lie |
//! | [`belcour`] | the figures of B |
//! | `slices` | B's Fig. 8: slices of covariance grids |
//! | [`hessian`] | B's Fig. 10: second derivatives of the fluence |
//! | `pixels` | B's Fig. 11: adaptive sampling of images |
//! | `steps` | B's Figs 12 to 15: adaptive steps along eye rays |
//! | `beams` | B's Figs 18 to 21: photon beams |
//! | [`engelhardt`] | the figures of E |
//! | `clamping` | E's Figs 2, 4, 5, 11, 13: what clamping takes and compensation brings back |
//! | `strategies` | E's Figs 6 and 7: strategies of compensation at equal time |
//! | `visibility` | E's Fig. 8: local visibility |
//! | `costs` | E's Fig. 10: seconds of each part |
//! | `judged` | errors of pictures, told by two judges |
//! | `montage`, `plot` | pictures made of pictures; line plots |

mod beams;
pub mod belcour;
mod clamping;
mod costs;
pub mod engelhardt;
pub mod extrapolation;
pub mod hessian;
mod judged;
mod montage;
mod pixels;
mod plot;
pub mod radius;
mod records;
mod rendered;
mod slices;
mod steps;
mod strategies;
mod visibility;

use std::path::PathBuf;
use std::time::Instant;

use fogbow::spectrum::Spectrum;

use crate::cli::Failure;
use extrapolation::{Slice, WAYS};
use plot::{BLACK, BLUE, GREEN, GREY, Line, ORANGE, PURPLE, Plot};
use radius::{Claims, Radii, TOLERANCE};

/// Numbers of J's figures.
pub const NUMBERS: [u32; 7] = [4, 5, 6, 7, 8, 9, 10];

/// What to make, and where.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Small pictures with little effort.
    pub quick: bool,
    /// Only these figures; all if there is none.
    pub only: Vec<u32>,
    /// Folder of the scenes.
    pub scenes: PathBuf,
    /// Folder for the figures.
    pub output: PathBuf,
    /// Threads; 0 is one per processor.
    pub threads: usize,
    /// Say nothing.
    pub quiet: bool,
}

impl Plan {
    fn wants(&self, figure: u32) -> bool {
        self.only.is_empty() || self.only.contains(&figure)
    }

    fn say(&self, what: &str) {
        if !self.quiet {
            say!("{what}");
        }
    }

    fn write(&self, name: &str, text: &str) -> Result<(), Failure> {
        let file = self.output.join(name);
        std::fs::write(&file, text).map_err(|e| format!("{}: cannot be written: {e}", file.display()).into())
    }
}

/// Makes a page of figures by `body`, with `head` above it, which is told how many seconds all took.
fn together(
    plan: &Plan,
    head: fn(&Plan, f64) -> String,
    body: impl FnOnce(&Plan) -> Result<String, Failure>,
) -> Result<(), Failure> {
    let clock = Instant::now();
    std::fs::create_dir_all(&plan.output).map_err(|e| format!("{}: {e}", plan.output.display()))?;
    let page = body(plan)?;
    let head = head(plan, clock.elapsed().as_secs_f64());
    plan.write("README.md", format!("{head}{page}").trim_end())?;
    plan.say(&format!("wrote {}", plan.output.join("README.md").display()));
    Ok(())
}

/// A share as text.
fn percent(share: f64) -> String {
    let decimals = if share.abs() < 0.1 { 1 } else { 0 };
    format!("{:.decimals$} %", 100.0 * share)
}

/// Makes J's figures and `README.md`, the page.
///
/// # Errors
/// Scenes that are missing, files that cannot be written, a render that was stopped.
pub fn rebuild(plan: &Plan) -> Result<(), Failure> {
    together(plan, head, body)
}

fn body(plan: &Plan) -> Result<String, Failure> {
    let mut page = String::new();
    if plan.wants(4) {
        plan.say("figure 4");
        page += &fourth(plan)?;
    }
    if plan.wants(5) {
        plan.say("figure 5");
        page += &fifth(plan)?;
    }
    if plan.wants(6) || plan.wants(7) {
        page += &rendered::boxes(plan)?;
    }
    if plan.wants(8) {
        page += &rendered::atrium(plan)?;
    }
    if plan.wants(9) {
        page += &rendered::animation(plan)?;
    }
    if plan.wants(10) {
        page += &rendered::road(plan)?;
    }
    Ok(page)
}

fn head(plan: &Plan, seconds: f64) -> String {
    let quick = if plan.quick { " --quick" } else { "" };
    let note = if plan.quick { " These are the quick ones: small, with little effort.\n" } else { "\n" };
    let [walks, samples] = rendered::efforts(plan);
    format!(
        "# Figures of *Radiance Caching for Participating Media*\n\n\
         Figures 4 to 10 of Jarosz et al. 2008 (J), with the scenes of this repository.{note}\n\
         ```sh\ncargo run --release --bin fogbow -- figures jarosz{quick}\n```\n\n\
         makes all of this, the numbers on this page among it; here in {:.1} minutes. Errors are the root of the mean \
         square difference from the truth over the root of the mean square of the truth, over all pixels and channels. \
         Two more path-traced pictures, with random numbers of their own, stand in for the truth in such a way that their \
         noise cancels: the mean of (image − a)(image − b). Bright outliers of path tracing make errors uncertain. \
         Pictures of Figs 6 to 10 are cached with {walks} walks for a record and {samples} samples for a pixel.\n\n",
        seconds / 60.0
    )
}

fn fourth(plan: &Plan) -> Result<String, Failure> {
    let count = if plan.quick { 400 } else { 1200 };
    let mut page = format!(
        "## Fig. 4: valid radii\n\n\
         Point lights on a line of {} m in even fog (σₜ = {} m⁻¹), isotropic, ε = {TOLERANCE}. At every point of the line the \
         radius that J's Eq. 34 allows, the one of the plain logarithmic gradient, ε L/‖∇L‖, and the optimal one by brute \
         force: the largest radius such that no interval around the point up to that size has a relative L1 error, \
         ∫|L − L̂| dx / ∫L dx (J's Eq. 31), above ε. L̂ is the light carried from the point, as a constant or \
         exponentially as the cache does it.\n\n",
        radius::LENGTH,
        radius::EXTINCTION,
    );
    let mut table = "| lights | Eq. 34: least, greatest | logarithmic gradient: greatest | Eq. 34 ≤ optimal, carried \
                     exponentially | Eq. 34 ≤ optimal, constant | logarithmic ≤ optimal, constant |\n|---|---|---|---|---|---|\n"
        .to_owned();
    for (name, lamps) in [("two", radius::two()), ("twenty", radius::twenty())] {
        let radii = radius::radii(&lamps, count);
        let file = format!("fig-04-{name}.svg");
        plan.write(&file, &radii_plot(&radii).svg())?;
        let Claims { ours, log_gradient, safe, safe_constant, log_gradient_safe } = radius::claims(&radii);
        page += &format!("![{name} lights]({file})\n\n");
        table += &format!(
            "| {} | {:.4} m, {:.3} m | {log_gradient:.1} m | {:.1} % | {:.1} % | {:.1} % |\n",
            lamps.len(),
            ours[0],
            ours[1],
            100.0 * safe,
            100.0 * safe_constant,
            100.0 * log_gradient_safe,
        );
    }
    Ok(format!(
        "{page}{table}\nBetween lights the gradient vanishes and its radius has no bound, where a record would be carried \
         into other lights; adding norms instead of vectors keeps Eq. 34 below the optimum.\n\n"
    ))
}

fn radii_plot(radii: &[Radii]) -> Plot<'static> {
    let line = |name, colour, of: fn(&Radii) -> f64| {
        let points = radii.iter().map(|r| [r.x, of(r)]).collect();
        Line { name, colour, width: 1.4, points }
    };
    Plot {
        across: "position (m)",
        upwards: "radius (m)",
        x: [0.0, radius::LENGTH],
        y: [1e-3, 10.0],
        lines: vec![
            line("logarithmic gradient", ORANGE, |r| r.log_gradient),
            line("optimal, exponential", GREEN, |r| r.optimal),
            line("optimal, constant", BLACK, |r| r.optimal_constant),
            line("Eq. 34", BLUE, |r| r.ours),
        ],
    }
}

fn fifth(plan: &Plan) -> Result<String, Failure> {
    let edge = if plan.quick { 96 } else { 160 };
    let mut page = format!(
        "## Fig. 5: extrapolation\n\nLight of a lamp, scattered once, on a slice of {0} × {0} m beside it; above in even fog, \
         below in smoke. From left to right the truth, then the same records (ε = {1}) carried as constants, linearly, \
         exponentially (J's Eq. 35), and curved, as pictures are made here.\n\n![slices](fig-05-slices.png)\n\n",
        2.0 * extrapolation::HALF,
        extrapolation::TOLERANCE,
    );
    let mut table =
        "| medium | records | constant | linear | exponential | curved |\n|---|---|---|---|---|---|\n".to_owned();
    let mut rows = Vec::new();
    for (name, slice) in [("even fog", extrapolation::homogeneous(edge)), ("smoke", extrapolation::heterogeneous(edge))]
    {
        let [constant, linear, exponential, curved] = slice.errors().map(|e| 100.0 * e);
        let percent = format!("{constant:.2} % | {linear:.2} % | {exponential:.2} % | {curved:.2} %");
        table += &format!("| {name} | {} | {percent} |\n", slice.records);
        let [values, errors] = scanlines(&slice);
        for (what, plot) in [("line", values), ("errors", errors)] {
            let file = format!("fig-05-{}-{what}.svg", name.replace(' ', "-"));
            plan.write(&file, &plot.svg())?;
            page += &format!("![{what}, {name}]({file})\n\n");
        }
        rows.push(pictures(&slice)?);
    }
    montage::save(&plan.output.join("fig-05-slices.png"), &montage::above(&rows)?, 0.0)?;
    Ok(format!(
        "{page}Along the middle lines of the slices: radiance, and how far it is from the truth; in even fog, then in smoke. The errors, Σ|L̂ − L|/ΣL over all pixels:\n\n{table}\n"
    ))
}

fn pictures(slice: &Slice) -> Result<fogbow_std::film::Image, Failure> {
    let mut sorted = slice.truth.clone();
    sorted.sort_by(f32::total_cmp);
    let white = sorted.get(sorted.len() * 97 / 100).copied().unwrap_or(1.0).max(1e-9);
    let picture = |values: &Vec<f32>| {
        let value = |x, y| values.get((y * slice.edge + x) as usize).copied().unwrap_or_default();
        montage::made(slice.edge, slice.edge, |x, y| Spectrum::splat(value(x, y) / white))
    };
    let all = [&slice.truth].into_iter().chain(&slice.carried).map(picture).collect::<Result<Vec<_>, _>>()?;
    montage::beside(&all)
}

/// The middle row: what the records make of it, and by how much that is wrong.
fn scanlines(slice: &Slice) -> [Plot<'static>; 2] {
    let row = |values: &[f32]| -> Vec<[f64; 2]> {
        let y = slice.edge / 2;
        let at = |x: u32| values.get((y * slice.edge + x) as usize).copied().unwrap_or_default();
        (0..slice.edge).map(|x| [f64::from(extrapolation::place(slice.edge, x, y).x), f64::from(at(x))]).collect()
    };
    let truth = row(&slice.truth);
    let (mut values, mut errors) = (Vec::new(), Vec::new());
    values.push(Line { name: "truth", colour: GREY, width: 4.0, points: truth.clone() });
    for (((name, _), carried), colour) in WAYS.iter().zip(&slice.carried).zip([ORANGE, GREEN, BLUE, PURPLE]) {
        let points = row(carried);
        let relative = points.iter().zip(&truth).map(|(p, t)| [p[0], (p[1] / t[1] - 1.0).abs()]).collect();
        values.push(Line { name, colour, width: 1.2, points });
        errors.push(Line { name, colour, width: 1.2, points: relative });
    }
    let all = || values.iter().flat_map(|l| &l.points).map(|p| p[1]).filter(|l| *l > 0.0);
    let y = [all().fold(f64::INFINITY, f64::min) / 1.1, all().fold(0.0, f64::max) * 1.1];
    let half = f64::from(extrapolation::HALF);
    let (across, x) = ("position (m)", [-half, half]);
    [
        Plot { across, upwards: "radiance", x, y, lines: values },
        Plot { across, upwards: "relative error", x, y: [1e-4, 1.0], lines: errors },
    ]
}
