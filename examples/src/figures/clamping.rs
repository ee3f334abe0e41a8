//! What clamping takes and compensation brings back: Figs 2, 4, 5, 11 and 13 of Engelhardt et al. 2012.

use std::fmt::Write;

use fogbow::spectrum::Spectrum;
use fogbow_std::film::Image;

use super::engelhardt::{STEPS, evened, layers, mean, plus, seen, strip, wrong};
use super::plot::{BLACK, BLUE, GREEN, GREY, Line, ORANGE, PURPLE, Plot};
use super::{Plan, montage, percent, rendered};
use crate::cli::Failure;

/// Clamps within 0.1 m, farther than by default, so that there is something to see.
const BOUND: &str = "100";
/// By how much differences are brighter than pictures.
const SCALE: f32 = 8.0;

/// Figs 2, 4 and 5.
pub(super) fn smoke(plan: &Plan) -> Result<String, Failure> {
    let (edge, lights, judging, by) = if plan.quick { (96, "500", "512", 2) } else { (192, "1000", "2048", 1) };
    let base = format!("--lights {lights} --candidates 1 ");
    let shot = |options: &str| seen(plan, "smoke", [edge, edge], &format!("{base}{options}"));
    let unclamped = shot("--clamp off --compensation none")?;
    let exact = shot(&format!("--clamp {BOUND} --compensation 1-to-1 --steps 1000"))?;
    let even = shot(&format!("--clamp {BOUND} --compensation abc --share 1"))?;
    let path = rendered::scene_of(plan, "smoke");
    let traced = rendered::shot(plan, &path, [edge, edge], &["--method", "path", "--spp", judging, "--aov"])?;

    let gain = rendered::gain(&traced.image);
    let clamped = plus(&exact.image, &layers(&exact, &STEPS), -1.0);
    let pictures = [unclamped.image.clone(), clamped, even.image.clone(), traced.image.clone()];
    montage::save(&plan.output.join("fig-02-smoke.png"), &strip(by, &pictures, gain)?, 0.0)?;

    // Light scattered more than once, from less to more compensation.
    let of = |shot: &rendered::Shot, steps: usize| plus(&shot.layer("clamped"), &layers(shot, &STEPS[..steps]), 1.0);
    let ways = [
        ("unclamped", GREY, unclamped.layer("clamped")),
        ("clamped", PURPLE, of(&exact, 0)),
        ("1 step", ORANGE, of(&exact, 1)),
        ("2 steps", GREEN, of(&exact, 2)),
        ("2 steps, even", BLUE, of(&even, 2)),
        ("all", BLACK, of(&exact, 4)),
    ];
    let all = mean(&ways[5].2);
    let mut table = "| light scattered more than once | of that with all steps |\n|---|---|\n".to_owned();
    for (name, _, image) in &ways {
        // Writing to a string cannot fail.
        let _ = writeln!(table, "| {name} | {} |", percent(mean(image) / all));
    }
    let _ = writeln!(
        table,
        "| path tracing, {judging} samples | {} |",
        percent(mean(&traced.layer("medium_multiple")) / all)
    );
    let mut page = format!(
        "## Fig. 2: splotches, and what clamping takes\n\n![smoke](fig-02-smoke.png)\n\nSmoke (`smoke.xml`), {edge} × {edge} pixels, about \
         {lights} virtual lights. From left to right: unclamped, with a splotch around each light near the eye ray; clamped to {BOUND} m⁻², \
         which is within 0.1 m, and too dark; with `--compensation abc`, two steps; path tracing.\n\n{table}\n\
         All but path tracing have the same few virtual lights, so that they agree with each other and not with it; unclamped light \
         agrees with that of all steps on average over lights only.\n\n",
    );
    page += &scanline(plan, by, &ways, &traced.image)?;
    page += &even_media(plan, by, &exact, &even)?;
    Ok(page)
}

/// Fig. 4: one row of the picture.
fn scanline(
    plan: &Plan,
    by: u32,
    ways: &[(&'static str, &'static str, Image); 6],
    shown: &Image,
) -> Result<String, Failure> {
    let (edge, y) = (shown.width, shown.height * 68 / 100);
    let mut marked = montage::brightened(shown, rendered::gain(shown));
    (0..edge).for_each(|x| montage::set(&mut marked, x, y, Spectrum::new(1.0, 0.7, 0.0)));
    montage::save(&plan.output.join("fig-04-line.png"), &strip(by, &[marked], 1.0)?, 0.0)?;
    let row = |image: &Image| -> Vec<[f64; 2]> {
        (0..edge).map(|x| [f64::from(x), f64::from(image.get(x, y).map_or(0.0, Spectrum::mean))]).collect()
    };
    let lines: Vec<Line<'_>> =
        ways.iter().map(|(name, colour, image)| Line { name, colour, width: 1.3, points: row(image) }).collect();
    let truth = row(&ways[5].2);
    let most = truth.iter().map(|p| p[1]).fold(1e-9, f64::max);
    let bright: Vec<f64> = truth.iter().filter(|p| p[1] > 0.1 * most).map(|p| p[0]).collect();
    let ten = |x: Option<&f64>, to: fn(f64) -> f64| to(x.copied().unwrap_or(0.0) / 10.0) * 10.0;
    let x = [ten(bright.first(), f64::floor), ten(bright.last(), f64::ceil)];
    let plot = Plot { across: "pixel", upwards: "radiance", x, y: [0.05 * most, 2.0 * most], lines };
    plan.write("fig-04-radiance.svg", &plot.svg())?;
    Ok(
        "## Fig. 4: one line of the picture\n\n![the line](fig-04-line.png)\n\n![radiance along it](fig-04-radiance.svg)\n\n\
         Radiance scattered more than once along the marked line, where the smoke is bright. The lines of one step, two and all of \
         them have the same paths (`--compensation 1-to-1`, which tracks through the smoke as it is) and are therefore noisy \
         together; *2 steps, even* is `--compensation abc --share 1`, which takes the smoke as even around each point. Unclamped light peaks where an eye ray passes a virtual light.\n\n"
            .to_owned(),
    )
}

/// Fig. 5: media taken as even around each point.
fn even_media(plan: &Plan, by: u32, exact: &rendered::Shot, even: &rendered::Shot) -> Result<String, Failure> {
    let [a, b] = [exact, even].map(|shot| layers(shot, &STEPS[..2]));
    let gain = 0.6 * rendered::gain(&a);
    let apart = wrong(&evened(&b)?, &evened(&a)?, gain * SCALE)?;
    let shown = [montage::brightened(&a, gain), montage::brightened(&b, gain), apart];
    montage::save(&plan.output.join("fig-05-even.png"), &strip(by, &shown, 1.0)?, 0.0)?;
    let bias = mean(&b) / mean(&a).max(f64::MIN_POSITIVE) - 1.0;
    let d = plus(&evened(&b)?, &evened(&a)?, -1.0);
    let square = |image: &Image| image.pixels.iter().map(|p| f64::from(p.mean()).powi(2)).sum::<f64>();
    Ok(format!(
        "## Fig. 5: media taken as even around each point\n\n![two steps](fig-05-even.png)\n\nWhat two steps of compensation add: left \
         with flights and transmittance through the smoke as it is, in the middle with the mean extinction within 0.1 m in \
         place of it, right {SCALE} times the difference, both evened out over 5 × 5 pixels; red where the latter is brighter, \
         green where it is darker. On the whole it adds {} {}; evened out, the difference's root of the mean square is {} \
         of the layer's, noise of both included.\n\n",
        percent(bias.abs()),
        if bias < 0.0 { "less" } else { "more" },
        percent((square(&d) / square(&evened(&a)?).max(f64::MIN_POSITIVE)).sqrt()),
    ))
}

/// Fig. 11: a room, and the light it lost.
pub(super) fn room(plan: &Plan) -> Result<String, Failure> {
    let (size, lights, samples, reference, by) =
        if plan.quick { ([128, 96], "300", "128", "192", 2) } else { ([192, 144], "600", "256", "384", 2) };
    let shot = |options: &str| seen(plan, "room-plume", size, &format!("--lights {lights} {options}"));
    let full = shot(&format!("--compensation full --pass-samples {reference}"))?;
    let abc = shot(&format!("--pass-samples {samples}"))?;
    let of = |steps: usize| plus(&abc.image, &layers(&abc, &STEPS[steps..]), -1.0);
    let pictures = [of(0), of(1), of(2), full.image.clone()];
    let gain = rendered::gain(&full.image);
    // Light scattered once, and of the lamps, is as it is: its noise is no error of compensation.
    let multiple =
        |shot: &rendered::Shot, steps: usize| plus(&shot.layer("clamped"), &layers(shot, &STEPS[..steps]), 1.0);
    let truth = evened(&multiple(&full, 4))?;
    let maps = (0..3).map(|steps| wrong(&evened(&multiple(&abc, steps))?, &truth, gain * SCALE));
    // What the reference itself would lack with two steps.
    let cut = wrong(&evened(&multiple(&full, 2))?, &truth, gain * SCALE);
    let maps = maps.chain([cut]).collect::<Result<Vec<_>, Failure>>()?;
    let sheet = montage::above(&[strip(by, &pictures, gain)?, strip(by, &maps, 1.0)?])?;
    montage::save(&plan.output.join("fig-11-room.png"), &sheet, 0.0)?;
    let total = mean(&truth).max(f64::MIN_POSITIVE);
    let row = |name: &str, steps: usize| -> Result<String, Failure> {
        let image = evened(&multiple(&abc, steps))?;
        let part = |sign: f32| {
            let both = image.pixels.iter().zip(&truth.pixels);
            let sum: f64 = both.map(|(p, t)| f64::from(((p.mean() - t.mean()) * sign).max(0.0))).sum();
            percent(sum / truth.pixels.len() as f64 / total)
        };
        Ok(format!("| {name} | {} | {} | {} |\n", percent(mean(&image) / total), part(-1.0), part(1.0)))
    };
    Ok(format!(
        "## Fig. 11: a room with smoke\n\n![room](fig-11-room.png)\n\n`room-plume.xml`, {} × {} pixels, {lights} virtual lights of \
         one pass. Above: clamped, one step of `abc`, two, and `--compensation full` with {reference} samples instead of {samples}. Below, for the first three, and for the last cut after two steps: \
         {SCALE} times the light lost (green) and overcompensated (red), against the last, evened out over 5 × 5 pixels; what \
         noise is left shows in both colours. What is green on the right is left to the third step and later ones. \
         Grain on the ceiling is in light straight from the lamps, which needs no virtual light.\n\n| | virtual lights' light, of full | lost | too much |\n|---|---|---|---|\n{}{}{}\n\
         Processor time: {:.1} s with two steps, {:.1} s for full.\n\n",
        size[0],
        size[1],
        row("clamped", 0)?,
        row("1 step", 1)?,
        row("2 steps", 2)?,
        abc.cpu,
        full.cpu,
    ))
}

/// Fig. 13: phase functions.
pub(super) fn statues(plan: &Plan) -> Result<String, Failure> {
    let (size, lights, judging, by) =
        if plan.quick { ([112, 84], "600", "1024", 2) } else { ([160, 120], "1000", "2048", 2) };
    let (mut above, mut below, mut gain) = (Vec::new(), Vec::new(), None);
    let mut table =
        "| scatters | g | clamped | 1 step | 2 steps | processor time |\n|---|---|---|---|---|---|\n".to_owned();
    for (name, g) in [("backward", "−0.6"), ("isotropic", "0"), ("forward", "0.6")] {
        let scene = format!("statue-{name}");
        let ours = seen(plan, &scene, size, &format!("--lights {lights}"))?;
        let path = rendered::scene_of(plan, &scene);
        let traced = rendered::shot(plan, &path, size, &["--method", "path", "--spp", judging])?;
        gain.get_or_insert_with(|| rendered::gain(&traced.image));
        let share = |steps: usize| {
            let left = plus(&ours.image, &layers(&ours, &STEPS[steps..]), -1.0);
            percent(mean(&left) / mean(&traced.image))
        };
        let _ = writeln!(table, "| {name} | {g} | {} | {} | {} | {:.1} s |", share(0), share(1), share(2), ours.cpu);
        above.push(ours.image);
        below.push(traced.image);
    }
    let gain = gain.unwrap_or(1.0);
    let sheet = montage::above(&[strip(by, &above, gain)?, strip(by, &below, gain)?])?;
    montage::save(&plan.output.join("fig-13-statues.png"), &sheet, 0.0)?;
    Ok(format!(
        "## Fig. 13: phase functions\n\n![statues](fig-13-statues.png)\n\nA statue in even fog that scatters light backwards, in all \
         directions, and forwards: above {lights} virtual lights with two steps of `abc`, below path tracing with {judging} samples \
         per pixel, as bright; {} × {} pixels. All light of the picture, of path tracing's:\n\n{table}\n",
        size[0], size[1],
    ))
}
