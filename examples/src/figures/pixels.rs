//! Adaptive sampling of images: Fig. 11 of Belcour et al. 2014.

use fogbow_std::film::Image;

use super::judged::Judges;
use super::slices::colour;
use super::{Plan, montage, percent, rendered};
use crate::cli::Failure;

/// Share of computed pixels.
const SHARE: &str = "0.4";

/// The section of the page.
pub(super) fn section(plan: &Plan) -> Result<String, Failure> {
    // As many samples of the medium: two fifths of the pixels with `all`, all pixels with `fewer`.
    let (edge, all, fewer, judging) = if plan.quick { (128, "5", "2", "10") } else { (192, "20", "8", "96") };
    let size = [edge, edge];
    let scene = rendered::scene_of(plan, "lantern");
    let shot = |options: &[&str]| {
        let words: Vec<&str> = ["--method", "march", "--aov"].iter().chain(options).copied().collect();
        rendered::shot(plan, &scene, size, &words)
    };
    let words = ["--method", "march", "--aov", "--spp", judging];
    let judges = Judges::rendered(plan, "lantern", size, &words, rendered::Shot::medium)?;
    let adaptive = shot(&["--spp", all, "--image-sampling", "covariance", "--image-share", SHARE])?;
    let (full, poor) = (shot(&["--spp", all])?, shot(&["--spp", fewer])?);

    let density = adaptive.layer("density");
    let most = density.pixels.iter().map(|p| p[0]).fold(1e-6, f32::max);
    let computed = adaptive.layer("computed");
    let density = montage::made(edge, edge, |x, y| colour(density.get(x, y).map_or(0.0, |p| p[0] / most)))?;
    let gain = rendered::gain(&judges.mean());
    let bright = |image: &Image| montage::brightened(image, gain);
    let (filled, whole) = (adaptive.medium(), full.medium());
    let row = |images: [&Image; 3]| {
        let by = 1;
        let images = images.into_iter().map(|image| montage::enlarged(image, by)).collect::<Result<Vec<_>, _>>()?;
        montage::beside(&images)
    };
    // Light where it was computed, black elsewhere.
    let seen = montage::made(edge, edge, |x, y| {
        let is_computed = computed.get(x, y).is_some_and(|p| p[0] > 0.5);
        bright(&whole).get(x, y).filter(|_| is_computed).unwrap_or_default()
    })?;
    let sheet = montage::above(&[
        row([&density, &computed, &seen])?,
        row([&bright(&filled), &bright(&whole), &bright(&judges.mean())])?,
    ])?;
    montage::save(&plan.output.join("fig-11-pixels.png"), &sheet, 0.0)?;
    let share = computed.pixels.iter().map(|p| f64::from(p[0])).sum::<f64>() / computed.pixels.len() as f64;
    let line = |name: &str, spp: &str, shot: &rendered::Shot| {
        let image = shot.medium();
        let bias = percent(judges.bias(&image));
        let [all, smooth] = [judges.rel_mse(&image), judges.rel_mse_smooth(&image)].map(|e| percent(e.sqrt()));
        let grid = shot.seconds("fill grid");
        let filling = shot.seconds("plan") + shot.seconds("fill in");
        let render = shot.seconds("render");
        format!("| {name} | {spp} | {all} | {smooth} | {bias} | {render:.2} s | {grid:.2} s | {filling:.2} s |\n")
    };
    Ok(format!(
        "## Fig. 11: fewer pixels\n\n![pixels](fig-11-pixels.png)\n\nThe lantern, `--method march`, {edge} × {edge} pixels, light of the \
         medium computed at {} of them. Above the density wanted (brightest: {most:.2}), the pixels that were computed, and \
         their light; below the layers of light from the medium: filled in from those pixels, computed at all of them with as \
         many samples each, and the mean of the two renders with {judging} samples per pixel that stand in for the truth.\n\n\
         | pixels | samples per pixel | relRMSE, light of the medium | in the smooth half | bias | render, processor time | grid | plan and fill in |\n\
         |---|---|---|---|---|---|---|---|\n{}{}{}\n\
         The last line has as many samples of the medium as the first. Light at surfaces is computed at all pixels and is \
         in the times. The smooth half are the pixels around which the truth, evened out over 5 × 5, varies less than its \
         median. Filling in evens out noise where light is smooth, and spreads bright outliers over their neighbours. Bias is what is \
         too bright or too dark on the whole, noise included. Pixels fill each other in where they see one surface or two that \
         meet, and not over a jump in depth.\n\n",
        percent(share),
        line("adaptive", all, &adaptive),
        line("all", all, &full),
        line("all", fewer, &poor),
    ))
}
