//! Figures of Belcour et al. 2014, *A Local Frequency Analysis of Light Scattering and Absorption* (B), rebuilt.

use super::{Plan, hessian, together};
use crate::cli::Failure;

/// A figure: makes its files and returns its section of the page.
type Figure = fn(&Plan) -> Result<String, Failure>;

/// The figures there are, by number.
const FIGURES: [(u32, Figure); 1] = [(10, hessian::section)];

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
