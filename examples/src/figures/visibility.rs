//! What lies between a point and the next vertex of its compensation path: Fig. 8 of Engelhardt et al. 2012.

use fogbow_std::film::Image;

use super::engelhardt::{STEPS, evened, layers, mean, plus, seen, strip, wrong};
use super::{Plan, montage, percent, rendered};
use crate::cli::Failure;

/// By how much differences are brighter than pictures.
const SCALE: f32 = 16.0;

/// The section of the page.
pub(super) fn section(plan: &Plan) -> Result<String, Failure> {
    let (edge, lights, by) = if plan.quick { (96, "256", 2) } else { (192, "500", 1) };
    let (mut rows, mut table) = (Vec::new(), TABLE.to_owned());
    for (scene, size) in [("thin-wall", [edge, edge]), ("room-plume", [edge, edge * 3 / 4])] {
        let shot = |visibility: &str| {
            seen(plan, scene, size, &format!("--lights {lights} --share 1 --local-visibility {visibility}"))
        };
        let (on, off) = (shot("on")?, shot("off")?);
        let gain = rendered::gain(&on.image);
        let apart = wrong(&off.image, &on.image, gain * SCALE)?;
        let shown = [montage::brightened(&on.image, gain), montage::brightened(&off.image, gain), apart];
        rows.push(strip(by, &shown, 1.0)?);
        let difference = plus(&off.image, &on.image, -1.0);
        let part = |sign: f32| {
            let sum: f64 = difference.pixels.iter().map(|p| f64::from((p.mean() * sign).max(0.0))).sum();
            percent(sum / difference.pixels.len() as f64 / mean(&on.image))
        };
        let most = |image: &Image| image.pixels.iter().map(|p| p.mean().abs()).fold(0.0, f32::max);
        let compensated = mean(&layers(&on, &STEPS)) / mean(&on.image);
        table += &format!(
            "| `{scene}.xml` | {} | {} | {} | {} | {:.1} s, {:.1} s |\n",
            percent(compensated),
            percent(f64::from(most(&evened(&difference)?) * gain / 0.6)),
            part(1.0),
            part(-1.0),
            on.cpu,
            off.cpu,
        );
    }
    montage::save(&plan.output.join("fig-08-visibility.png"), &montage::above(&rows)?, 0.0)?;
    Ok(format!(
        "## Fig. 8: local visibility\n\n![visibility](fig-08-visibility.png)\n\n`--compensation abc` with `--local-visibility on` (left) and \
         `off` (middle), with the same random numbers, and {SCALE:.0} times the difference: red where light leaks through, green \
         where it is missing. Above a thin wall in thin fog with a lamp to its right, made to show it; below the room with \
         smoke. {lights} virtual lights.\n\n{table}\n\
         Without local visibility surfaces near a point of the fog send it nothing back, which is what is missing; and a vertex behind \
         the wall is lit by that side's lights. Visibility of virtual lights is never left out. *Bright* is what nine tenths \
         of the pixels stay below.\n\n"
    ))
}

const TABLE: &str = "| scene | compensation, of all light | largest difference over 5 × 5 pixels, of bright | light too much, of all | light missing, of all | \
                     processor time, on and off |\n|---|---|---|---|---|---|\n";
