//! The program: `fogbow render SCENE.xml`.

use std::process::ExitCode;

use fogbow_examples::cli::{parse, run};

fn main() -> ExitCode {
    match parse(std::env::args_os()) {
        Ok(arguments) => run(arguments),
        Err(answer) => answer.exit(),
    }
}
