//! Seconds of each part of virtual lights: Fig. 10 of Engelhardt et al. 2012.

use super::Plan;
use super::engelhardt::seen;
use crate::cli::Failure;

const SCENES: [(&str, &str); 2] = [("statue-isotropic", "even"), ("room-plume", "smoke")];

/// The section of the page.
pub(super) fn section(plan: &Plan) -> Result<String, Failure> {
    let (edge, lights) = if plan.quick { (64_u32, 512_u32) } else { (96, 1024) };
    let mut table = "| scene | medium | compensation | all but virtual lights | clamped light | 1st step | 2nd step | steps, of all |\n\
                     |---|---|---|---|---|---|---|---|\n"
        .to_owned();
    for (scene, medium) in SCENES {
        let size = [edge, edge * 3 / 4];
        // Few samples, so that light scattered once does not drown the rest; the least of three runs.
        let seconds = |lights: u32, options: &str| -> Result<f64, Failure> {
            let words = format!("--candidates 1 --pass-samples 8 --lights {lights} --compensation {options}");
            (0..3).try_fold(f64::INFINITY, |least, _| Ok(least.min(seen(plan, scene, size, &words)?.cpu)))
        };
        let (rest, clamped) = (seconds(1, "none")?, seconds(lights, "none")?);
        // Points are the same with and without compensation where each light has its own.
        for (name, options) in [("1-to-1", "1-to-1"), ("abc, `--share 1`", "abc --share 1")] {
            let steps = [1, 2].map(|steps| seconds(lights, &format!("{options} --steps {steps}")));
            let [one, two] = steps;
            let (one, two) = (one?, two?);
            let each = |seconds: f64| seconds * 1e6 / f64::from(size[0] * size[1]) / f64::from(lights);
            table += &format!(
                "| `{scene}.xml` | {medium} | {name} | {rest:.1} s | {:.1} s ({:.2} µs) | {:.1} s ({:.2} µs) | {:.1} s ({:.2} µs) | {:.0} % |\n",
                clamped - rest,
                each(clamped - rest),
                one - clamped,
                each(one - clamped),
                (two - one).max(0.0),
                each((two - one).max(0.0)),
                100.0 * (two - clamped) / two,
            );
        }
    }
    Ok(format!(
        "## Fig. 10: what each part costs\n\nProcessor time at {edge} × {} pixels and {lights} virtual lights, all of which are kept; in brackets \
         for each pair of pixel and light, which in the picture's one pass is gathered once in the medium and once at the surface. \
         The least of three runs each, and differences of them: with one virtual light, without compensation, with one step, with two.\n\n{table}\n\
         E report 35 to 38 % for multiple scattering with two steps on a GPU, most of whose time goes into shadow maps. Here every connection traces a ray and asks for transmittance, which in even fog is an exponential and in smoke is not, \
         so that clamped light costs more there. With `abc` most paths reach a vertex; \
         with 1-to-1 many flights leave the ball and need no connection. Differences of a tenth of a second are noise of the clock.\n\n",
        edge * 3 / 4,
    ))
}
