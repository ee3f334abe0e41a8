//! `fogbow compare`.

use std::path::PathBuf;

use clap::Args;
use fogbow_std::image::{Layer, write};

use super::{Ending, Failure, output};
use crate::compare::{compare, false_colour};
use crate::picture::Picture;

/// Says how far an image is from a reference.
#[derive(Debug, Args)]
pub struct CompareArguments {
    /// The image: .exr, .pfm, .hdr, .npy or .png.
    #[arg(value_name = "A")]
    pub image: PathBuf,
    /// The reference.
    #[arg(value_name = "B")]
    pub reference: PathBuf,
    /// Writes a picture of the difference: red is too bright, blue too dark.
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Relative difference shown in full colour.
    #[arg(long, default_value_t = 0.25, value_parser = output::positive)]
    pub range: f64,
}

pub(super) fn run(arguments: &CompareArguments) -> Result<Ending, Failure> {
    if let Some(file) = &arguments.output {
        output::check(file)?;
    }
    let image = Picture::read(&arguments.image)?;
    let reference = Picture::read(&arguments.reference)?;
    let result = compare(&image, &reference)?;
    let worst = result.worst_block;
    output::print(&format!(
        "relRMSE      {:.6}\nrelMSE       {:.6}\nbias         {:+.4} %\nlargest      {:.4}\nworst block  {:+.3} % at ({}, {})",
        result.rel_rmse,
        result.rel_mse,
        100.0 * result.bias,
        result.largest,
        100.0 * worst.difference,
        worst.x,
        worst.y
    ))?;
    if let Some(file) = &arguments.output {
        let picture = false_colour(&image, &reference, arguments.range)?;
        write(file, &[Layer { name: "difference", image: &picture }], 0.0)?;
    }
    Ok(Ending::Done)
}
