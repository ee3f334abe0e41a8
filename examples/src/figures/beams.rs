//! Photon beams blurred by covariances: Figs 18 to 21 of Belcour et al. 2014.

use std::fmt::Write;

use fogbow_std::film::Image;

use super::judged::Judges;
use super::{Plan, montage, percent, rendered};
use crate::cli::Failure;

const SCENES: [&str; 3] = ["lantern", "caustic", "nave"];
/// Cells along the longest side of the grid that serves all scenes.
const CELLS: &str = "64";
/// The same of the grids that are compared with each other, in the first scene.
const EDGES: [&str; 3] = ["16", "32", CELLS];

/// How much is done.
#[derive(Clone, Copy)]
struct Effort<'a> {
    size: [u32; 2],
    passes: &'a str,
    /// Passes of each judge.
    judging: &'a str,
    paths: &'a str,
}

struct Blurred {
    medium: Image,
    overall: f64,
    smooth: f64,
    cpu: f64,
    fill: f64,
}

fn blurred(
    plan: &Plan,
    scene: &str,
    effort: &Effort<'_>,
    judges: &Judges,
    options: &[&str],
) -> Result<Blurred, Failure> {
    let words: Vec<&str> = common(effort.passes).into_iter().chain(options.iter().copied()).collect();
    let shot = rendered::shot(plan, &rendered::scene_of(plan, scene), effort.size, &words)?;
    let medium = shot.medium();
    let (overall, smooth) = (judges.rel_mse(&medium), judges.rel_mse_smooth(&medium));
    Ok(Blurred { medium, overall, smooth, cpu: shot.seconds("render"), fill: shot.seconds("fill grid") })
}

fn common(passes: &str) -> Vec<&str> {
    vec!["--method", "photon-beams", "--pass-samples", "1", "--aov", "--spp", passes]
}

fn line(page: &mut String, name: &str, kernel: &str, b: &Blurred) {
    let fill = if b.fill > 0.0 { format!("{:.1} s", b.fill) } else { String::new() };
    // Writing to a string cannot fail.
    let _ = writeln!(page, "| {name} | {kernel} | {:.4} | {:.4} | {:.1} s | {fill} |", b.smooth, b.overall, b.cpu);
}

const HEAD: &str =
    "| scene | kernel | relMSE, smooth half | overall | processor time | grid |\n|---|---|---|---|---|---|\n";

/// The section of the page.
pub(super) fn section(plan: &Plan) -> Result<String, Failure> {
    let effort = if plan.quick {
        Effort { size: [64, 64], passes: "8", judging: "56", paths: "10000" }
    } else {
        Effort { size: [160, 160], passes: "16", judging: "128", paths: "10000" }
    };
    let (mut rows, mut table, mut gains, mut grids) = (Vec::new(), HEAD.to_owned(), String::new(), HEAD.to_owned());
    for scene in SCENES {
        plan.say(&format!("figure 18, {scene}"));
        // Long, and narrower from the first pass on.
        let words: Vec<&str> = common(effort.judging).into_iter().chain(["--radius", radius(scene)]).collect();
        let judges = Judges::rendered(plan, scene, effort.size, &words, rendered::Shot::medium)?;
        let usual = blurred(plan, scene, &effort, &judges, &[])?;
        let kernel = ["--kernel", "covariance", "--grid-paths", effort.paths, "--grid-cells"];
        let of = |cells| {
            let options: Vec<&str> = kernel.into_iter().chain([cells]).collect();
            blurred(plan, scene, &effort, &judges, &options)
        };
        let ours = of(CELLS)?;
        line(&mut table, scene, "progressive", &usual);
        // As much time as with covariances and their grid.
        let passes = effort.passes.parse::<f64>().unwrap_or(1.0) * (ours.cpu + ours.fill) / usual.cpu.max(1e-9);
        let passes = (passes.round() as u32).max(1).to_string();
        let longer = blurred(plan, scene, &Effort { passes: &passes, ..effort }, &judges, &[])?;
        line(&mut table, scene, &format!("progressive, {passes} passes"), &longer);
        line(&mut table, scene, "covariance", &ours);
        let comma = if gains.is_empty() { "" } else { "; " };
        let [smooth, overall] = [usual.smooth / ours.smooth, usual.overall / ours.overall];
        let _ = write!(gains, "{comma}{scene} {smooth:.2} in the smooth half, {overall:.2} overall");
        if scene == SCENES[0] {
            for cells in EDGES {
                let one = if cells == CELLS { &ours } else { &of(cells)? };
                line(&mut grids, &format!("{scene}, {cells} cells"), "covariance", one);
            }
        }
        let truth = judges.mean();
        let gain = rendered::gain(&truth);
        let by = if plan.quick { 3 } else { 1 };
        let shown = |image: &Image| montage::enlarged(&montage::brightened(image, gain), by);
        rows.push(montage::beside(&[shown(&usual.medium)?, shown(&ours.medium)?, shown(&truth)?])?);
    }
    montage::save(&plan.output.join("fig-18-beams.png"), &montage::above(&rows)?, 0.0)?;
    let Effort { size: [edge, _], passes, judging, paths } = effort;
    Ok(format!(
        "## Figs 18 to 21: photon beams\n\n![beams](fig-18-beams.png)\n\nLight of the medium after {passes} passes of one sample per \
         pixel, {edge} × {edge} pixels: left `--kernel progressive`, in the middle `--kernel covariance` with {CELLS} cells along \
         the longest side of its grid and {paths} photons to fill it, right the mean of two progressive renders of {judging} passes with radii that \
         start at half, which stand in for the truth. From above: lantern, caustic, nave.\n\n{table}\n\
         Progressive over covariance, relMSE after equal passes: {gains}. The lines with more passes take about as much time as \
         covariances and their grid. The smooth half are the pixels around which the \
         truth, evened out over 5 × 5, varies less than its median ({} of all). Wider beams cover more pixels, so \
         that passes take longer.\n\nGrids of 16, 32 and 64 cells:\n\n{grids}\n",
        percent(0.5),
    ))
}

/// Half of the usual radius: 0.005 of the scene's diagonal.
fn radius(scene: &str) -> &'static str {
    if scene == "nave" { "0.092" } else { "0.0087" }
}
