//! The command line.
//!
//! Exit codes: 0 done, 1 stopped early, 2 bad input.

mod arguments;
mod bake;
mod bias_layers;
mod check;
mod choice;
mod compare;
pub(crate) mod covariance;
mod defaults;
mod ellipsoids;
mod exposure;
mod figures;
mod film_file;
mod help;
mod image_sampling;
mod keep;
mod march;
mod merge;
mod output;
mod parts;
mod photon_beams;
mod plan;
mod plan_bake;
mod plume;
mod probe;
mod radiance_cache;
mod records;
pub(crate) mod render;
mod report;
mod scene;
mod vpl;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

pub use arguments::{Method, RenderArguments};
pub use bake::{BakeArguments, BakePartArguments};
pub use check::CheckArguments;
pub use compare::CompareArguments;
pub use covariance::{CovarianceArguments, MarchArguments, Step};
pub use figures::{FiguresArguments, Paper};
pub use film_file::Split;
pub use help::{Answer, CompletionsArguments, ManArguments, parse};
pub use image_sampling::{ImageSampling, SamplingArguments};
pub use keep::KeepArguments;
pub use merge::MergeArguments;
pub use parts::PartArguments;
pub use photon_beams::{BeamArguments, Kernel};
pub use plan::PlanArguments;
pub use plan_bake::PlanBakeArguments;
pub use plume::PlumeArguments;
pub use probe::{HessianArguments, Probe, ProbeArguments};
pub use radiance_cache::{CacheArguments, Kind, Single};
pub use records::RecordsArguments;
pub use scene::{ReadArguments, SceneArguments};
pub use vpl::{Clamp, Recovery, Switch, VplArguments};

/// Light in fog, smoke and clouds.
#[derive(Debug, Parser)]
#[command(name = "fogbow", version, about, arg_required_else_help = true)]
pub struct Arguments {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Renders a scene of Mitsuba, glTF or pbrt.
    Render(Box<RenderArguments>),
    /// Computes what parts of a picture share: caches, or a covariance grid.
    Fill(Box<RenderArguments>),
    /// Puts parts of a picture together.
    Merge(MergeArguments),
    /// Prints which commands render a scene on many machines.
    Plan(PlanArguments),
    /// Prints which commands bake a scene on many machines: fogbow plan bake.
    #[command(hide = true)]
    PlanBake(PlanBakeArguments),
    /// Says all at once what of a scene cannot be rendered or looks like a mistake.
    Check(CheckArguments),
    /// Bakes light in fog into 3D textures for engines.
    Bake(Box<BakeArguments>),
    /// Draws where the records of radiance caches lie.
    Records(Box<RecordsArguments>),
    /// Says how far an image is from a reference.
    Compare(CompareArguments),
    /// Says in numbers what is in a scene.
    Probe(ProbeArguments),
    /// Writes an animation: a plume of smoke, a volume and a scene per frame.
    Plume(PlumeArguments),
    /// Rebuilds the figures of a paper, with a page that explains them.
    Figures(FiguresArguments),
    /// Writes completions for a shell to standard output.
    Completions(CompletionsArguments),
    /// Writes the pages of the manual.
    Man(ManArguments),
}

/// How a command ended well enough to leave a result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// Everything asked for was done.
    Done,
    /// Stopped early; the result so far is there.
    Stopped,
}

/// Runs a command; what is wrong goes to standard error.
pub fn run(arguments: Arguments) -> ExitCode {
    let result = match arguments.command {
        Command::Render(arguments) | Command::Fill(arguments) => render::run(&arguments),
        Command::Merge(arguments) => merge::run(&arguments),
        Command::Plan(arguments) => plan::run(&arguments),
        Command::PlanBake(arguments) => plan_bake::run(&arguments),
        Command::Check(arguments) => check::run(&arguments),
        Command::Bake(arguments) => bake::run(&arguments),
        Command::Records(arguments) => records::run(&arguments),
        Command::Compare(arguments) => compare::run(&arguments),
        Command::Probe(arguments) => probe::run(&arguments),
        Command::Plume(arguments) => plume::run(&arguments),
        Command::Figures(arguments) => figures::run(&arguments),
        Command::Completions(arguments) => help::completions(&arguments),
        Command::Man(arguments) => help::man(&arguments),
    };
    match result {
        Ok(Ending::Done) => ExitCode::SUCCESS,
        Ok(Ending::Stopped) => ExitCode::from(1),
        Err(error) => {
            say!("fogbow: {error}");
            ExitCode::from(2)
        }
    }
}

/// Any error, to be shown.
pub(crate) type Failure = Box<dyn core::error::Error>;
