//! The command line: a thin shell around the library.

mod ab;
mod accuracy;
mod args;
mod bench;
mod conform;
mod devices;
mod places;
mod precompute;
mod progress;
mod reference;
mod render;
mod scenes;
mod session;
mod summary;
mod tables;
mod validation;
mod voxelize;

use std::io::Write;
use std::process::ExitCode;

use args::{Cli, Command};
use clap::Parser;
use welkin::{Error, Result};

/// Parses the command line and runs it. Status 0: done; 1: a comparison or check failed; 2: error.
pub fn main() -> ExitCode {
    let cli = Cli::parse(); // Ends the process with status 2 on a usage error, 0 on --help.
    let outcome = match &cli.command {
        Command::Devices(args) => devices::run(args).map(|()| true),
        Command::Render(args) => render::run(args).map(|()| true),
        Command::Precompute(args) => precompute::run(args).map(|()| true),
        Command::Voxelize(args) => voxelize::run(args).map(|()| true),
        Command::Reference(args) => reference::run(args).map(|()| true),
        Command::Bench(args) => bench::run(args).map(|()| true),
        Command::Ab(args) => ab::run(args),
        Command::Accuracy(args) => accuracy::run(args).map(|()| true),
        Command::Conform(args) => conform::run(args),
    };
    let validation = validation::verdict();
    match outcome.and_then(|passed| validation.map(|()| passed)) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(1),
        Err(error) => {
            eprintln!("welkin: error: {error}");
            ExitCode::from(2)
        }
    }
}

/// Writes a result to standard output. A reader that has gone away (`welkin … | head`) is not an error.
fn print(text: &str) -> Result<()> {
    match std::io::stdout().write_all(text.as_bytes()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Error::file("standard output", format!("cannot be written: {error}")))
        }
        _ => Ok(()),
    }
}

/// `value` as JSON on standard output.
fn print_json(value: &impl serde::Serialize) -> Result<()> {
    print(&welkin::output::to_json(value).map_err(|reason| Error::file("standard output", reason))?)
}
