//! The command line: a thin shell around the library.

mod ab;
mod accuracy;
mod args;
mod bench;
mod bench_parts;
mod conform;
mod devices;
mod gpu_check;
mod interrupt;
mod manual;
mod places;
mod precompute;
mod prefix;
mod progress;
mod reference;
mod render;
mod scatter;
mod scenes;
mod serial_forward;
mod session;
mod setup;
mod summary;
mod tables;
mod validation;
mod voxelize;

use std::io::Write;
use std::process::ExitCode;

use args::{Cli, Command};
use clap::Parser;
use welkin::{Error, Result};

/// How a command ended, if not by an error.
enum Outcome {
    Done,
    /// A comparison or check failed.
    Failed,
    /// It was asked to end before it was done.
    Stopped(interrupt::Signal),
}

impl Outcome {
    fn done((): ()) -> Self {
        Self::Done
    }

    fn of(passed: bool) -> Self {
        if passed { Self::Done } else { Self::Failed }
    }
}

/// Parses the command line and runs it. Status 0: done; 1: a comparison or check failed; 2: error; 128 and the number of a
/// signal that has ended it.
pub fn main() -> ExitCode {
    let cli = Cli::parse(); // Ends the process with status 2 on a usage error, 0 on --help.
    let outcome = match &cli.command {
        Command::Devices(args) => devices::run(args).map(Outcome::done),
        Command::Render(args) => render::run(args).map(Outcome::done),
        Command::Precompute(args) => precompute::run(args),
        Command::Voxelize(args) => voxelize::run(args),
        Command::Scatter(args) => scatter::run(args).map(Outcome::done),
        Command::Reference(args) => reference::run(args),
        Command::Bench(args) => bench::run(args).map(Outcome::done),
        Command::Ab(args) => ab::run(args).map(Outcome::of),
        Command::Accuracy(args) => accuracy::run(args).map(Outcome::done),
        Command::Conform(args) => conform::run(args).map(Outcome::of),
        Command::GpuCheck(args) => gpu_check::run(args),
        Command::Setup(args) => setup::run(args).map(Outcome::done),
        Command::Man(args) => manual::man(args).map(Outcome::done),
        Command::Completions(args) => manual::completions(args).map(Outcome::done),
    };
    let validation = validation::verdict();
    match outcome.and_then(|outcome| validation.map(|()| outcome)) {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::Failed) => ExitCode::from(1),
        Ok(Outcome::Stopped(signal)) => ExitCode::from(signal.status()),
        Err(error) => {
            let error = prefix::start_again(error);
            eprintln!("welkin: error: {error}");
            if matches!(error, Error::NoDriver { .. }) {
                eprintln!("welkin: or, without root on a system with apt: welkin setup");
            }
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
