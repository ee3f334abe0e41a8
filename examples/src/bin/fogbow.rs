//! The program: `fogbow render SCENE.xml`.

use std::process::ExitCode;

use clap::Parser;
use fogbow_examples::cli::{Arguments, run};

fn main() -> ExitCode {
    run(Arguments::parse())
}
