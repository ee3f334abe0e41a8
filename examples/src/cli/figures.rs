//! `fogbow figures`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::{Ending, Failure};
use crate::figures::{self, Plan};

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
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(4..=10))]
    pub only: Vec<u32>,
    /// Folder of the scenes.
    #[arg(long, value_name = "FOLDER", default_value = "examples/scenes")]
    pub scenes: PathBuf,
    /// Threads; 0 is one per processor.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub threads: usize,
    /// Folder to write to; made if it is not there.
    #[arg(short, long, value_name = "FOLDER", default_value = "examples/figures/jarosz")]
    pub output: PathBuf,
    /// No list of what is being made.
    #[arg(short, long)]
    pub quiet: bool,
}

/// A paper.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Paper {
    /// Jarosz et al. 2008, Radiance Caching for Participating Media: figures 4 to 10.
    Jarosz,
}

pub(super) fn run(arguments: &FiguresArguments) -> Result<Ending, Failure> {
    let Paper::Jarosz = arguments.paper;
    figures::rebuild(&Plan {
        quick: arguments.quick,
        only: arguments.only.clone(),
        scenes: arguments.scenes.clone(),
        output: arguments.output.clone(),
        threads: arguments.threads,
        quiet: arguments.quiet,
    })?;
    Ok(Ending::Done)
}
