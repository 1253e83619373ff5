//! The `welkin` program.

#![deny(clippy::unwrap_used, clippy::expect_used)] // Tests and examples may.

mod cli;

fn main() -> std::process::ExitCode {
    cli::main()
}
