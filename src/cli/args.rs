//! The command line: what can be said, in one place.

use clap::{Args, Parser, Subcommand};

/// Cumulus skies in Vulkan: a scene file goes in, a picture comes out.
///
/// Exit status: 0 done, 1 a comparison or check failed, 2 error.
#[derive(Parser, Debug)]
#[command(name = "welkin", version, max_term_width = 120)]
pub struct Cli {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Subcommand, Debug)]
pub enum Command {
    /// List every Vulkan device and, per compositing mode, whether it can be used or why not
    Devices(DevicesArgs),
}

#[derive(Args, Debug)]
pub struct DevicesArgs {
    /// Print JSON (docs/json.md)
    #[arg(long)]
    pub json: bool,
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_table_of_flags_is_sound() {
        Cli::command().debug_assert();
    }
}
