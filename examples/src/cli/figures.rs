//! `fogbow figures`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::{Ending, Failure};
use crate::figures::{self, Plan, belcour, engelhardt};

/// Rebuilds the figures of a paper, with a page that explains them. Runs in the repository's top folder.
#[derive(Debug, Args)]
pub struct FiguresArguments {
    /// Whose figures.
    #[arg(value_enum)]
    pub paper: Paper,
    /// Small pictures with little effort.
    #[arg(long)]
    pub quick: bool,
    /// Only this figure; may be repeated. The page then has these alone.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub only: Vec<u32>,
    /// Folder of the scenes.
    #[arg(long, value_name = "FOLDER", default_value = "examples/scenes")]
    pub scenes: PathBuf,
    /// Threads; 0 is one per processor.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub threads: usize,
    /// Folder to write to; made if it is not there [default: that of the paper in examples/figures].
    #[arg(short, long, value_name = "FOLDER")]
    pub output: Option<PathBuf>,
    /// No list of what is being made.
    #[arg(short, long)]
    pub quiet: bool,
}

/// A paper.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Paper {
    /// Jarosz et al. 2008, Radiance Caching for Participating Media: figures 4 to 10.
    Jarosz,
    /// Belcour et al. 2014, A Local Frequency Analysis of Light Scattering and Absorption: figures 6, 8, 10, 11, 12 to 15
    /// (`--only 12`), 18 to 21 (`--only 18`).
    Belcour,
    /// Engelhardt et al. 2012, Approximate Bias Compensation for Rendering Scenes with Heterogeneous Participating Media:
    /// figures 2, 4 to 8, 10, 11, 13; 2, 4 and 5 are made together, and 6 and 7.
    Engelhardt,
}

pub(super) fn run(arguments: &FiguresArguments) -> Result<Ending, Failure> {
    let (name, numbers): (_, &[u32]) = match arguments.paper {
        Paper::Jarosz => ("jarosz", &figures::NUMBERS),
        Paper::Belcour => ("belcour", &belcour::NUMBERS),
        Paper::Engelhardt => ("engelhardt", &engelhardt::NUMBERS),
    };
    if let Some(number) = arguments.only.iter().find(|number| !numbers.contains(number)) {
        let all: Vec<String> = numbers.iter().map(u32::to_string).collect();
        return Err(format!("--only {number}: the figures of {name} here are {}", all.join(", ")).into());
    }
    let plan = Plan {
        quick: arguments.quick,
        only: arguments.only.clone(),
        scenes: arguments.scenes.clone(),
        output: arguments.output.clone().unwrap_or_else(|| PathBuf::from("examples/figures").join(name)),
        threads: arguments.threads,
        quiet: arguments.quiet,
    };
    match arguments.paper {
        Paper::Jarosz => figures::rebuild(&plan)?,
        Paper::Belcour => belcour::rebuild(&plan)?,
        Paper::Engelhardt => engelhardt::rebuild(&plan)?,
    }
    Ok(Ending::Done)
}
