//! Figures of Belcour et al. 2014, *A Local Frequency Analysis of Light Scattering and Absorption* (B), rebuilt.

use super::{Plan, beams, hessian, pixels, slices, steps, together};
use crate::cli::Failure;

/// A figure: makes its files and returns its section of the page.
type Figure = fn(&Plan) -> Result<String, Failure>;

/// The figures there are, by number; 12 stands for 12 to 15, 18 for 18 to 21.
const FIGURES: [(u32, Figure); 6] = [
    (6, scattering),
    (8, slices::section),
    (10, hessian::section),
    (11, pixels::section),
    (12, steps::section),
    (18, beams::section),
];

/// Numbers of the figures that there are.
pub const NUMBERS: [u32; FIGURES.len()] = {
    let mut numbers = [0; FIGURES.len()];
    let mut i = 0;
    while i < numbers.len() {
        numbers[i] = FIGURES[i].0;
        i += 1;
    }
    numbers
};

/// Makes the figures and `README.md`, the page.
///
/// # Errors
/// Files that cannot be written.
pub fn rebuild(plan: &Plan) -> Result<(), Failure> {
    together(plan, head, |plan| {
        let mut page = String::new();
        for (number, make) in FIGURES {
            if plan.wants(number) {
                plan.say(&format!("figure {number}"));
                page += &make(plan)?;
            }
        }
        Ok(page)
    })
}

/// Fig. 6: what scattering does to covariances, as a test measures it.
fn scattering(_: &Plan) -> Result<String, Failure> {
    Ok("## Fig. 6: scattering\n\n\
        A Gaussian light field with covariance diagonal (3, 3, 6, 6) in (u, v, θ, φ) and, off it, 1.5 for u with \
        θ and 1 for v with φ, scattered by the Henyey–Greenstein lobe of g = 0.8 at angle α: the diagonal afterwards, predicted by \
        the covariance operators and measured as that of the scattered field's spectrum, by FFT in four dimensions. These \
        numbers are not made with this page: they come from the test \
        `scattering_by_henyey_greenstein_is_near` in `tests/tests/light_fields.rs`, which prints them (`cargo test --release --test \
        light_fields henyey -- --nocapture`).\n\n\
        | α | predicted | measured, B's kernel (a convolution) | measured, with true directions |\n|---|---|---|---|\n\
        | 0 | 2.701, 2.867, 1.213, 1.213 | 2.688, 2.861, 1.003, 1.003 | 2.688, 2.862, 1.003, 1.033 |\n\
        | 0.2 | 2.574, 2.854, 0.878, 0.728 | 2.582, 2.861, 1.007, 1.003 | 2.582, 2.862, 1.007, 1.035 |\n\n\
        In space the prediction is within 0.5 %, in angle off by 21 % at most at α = 0 and by 30 % at α = 0.2: \
        no Gaussian is the lobe.\n\n"
        .to_owned())
}

fn head(plan: &Plan, seconds: f64) -> String {
    let quick = if plan.quick { " --quick" } else { "" };
    let note = if plan.quick { " These are the quick ones, with little effort.\n" } else { "\n" };
    format!(
        "# Figures of *A Local Frequency Analysis of Light Scattering and Absorption*\n\n\
         Figures of Belcour et al. 2014 (B).{note}\n\
         ```sh\ncargo run --release --bin fogbow -- figures belcour{quick}\n```\n\n\
         makes all of this, the numbers on this page among it; here in {:.1} minutes.\n\n",
        seconds / 60.0
    )
}
