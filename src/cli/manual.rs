//! `welkin man` and `welkin completions`: for packagers, who then need no build script.

use std::io::Write;

use clap::CommandFactory;
use welkin::output::write_atomic;
use welkin::{Error, Result};

use super::args::{Cli, CompletionsArgs, ManArgs};
use super::places;

/// Manual pages: that of the program to standard output, or one a command into a directory.
pub fn man(args: &ManArgs) -> Result<()> {
    let command = described();
    let Some(directory) = &args.out else {
        return super::print(&String::from_utf8_lossy(&page(command)?));
    };
    places::directory(directory)?;
    for subcommand in command.get_subcommands().filter(|command| !command.is_hide_set()) {
        let name = format!("welkin-{}", subcommand.get_name());
        let bytes = page(subcommand.clone())?;
        write_atomic(&directory.join(format!("{name}.1")), |file| file.write_all(&bytes))?;
    }
    let bytes = page(command)?;
    write_atomic(&directory.join("welkin.1"), |file| file.write_all(&bytes))
}

/// The shell's completions to standard output.
pub fn completions(args: &CompletionsArgs) -> Result<()> {
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "welkin", &mut text);
    super::print(&String::from_utf8_lossy(&text))
}

/// The command with all its parts built, less clap's own `help`.
fn described() -> clap::Command {
    let mut command = Cli::command().disable_help_subcommand(true);
    command.build();
    command
}

fn page(command: clap::Command) -> Result<Vec<u8>> {
    let mut text = Vec::new();
    let man = clap_mangen::Man::new(command);
    man.render(&mut text).map_err(|error| Error::file("the manual", format!("cannot be written: {error}")))?;
    text.flush().map(|()| text).map_err(|error| Error::file("the manual", error))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_command_has_a_page_with_its_flags() {
        let directory = tempfile::tempdir().unwrap();
        man(&ManArgs { out: Some(directory.path().to_owned()) }).unwrap();
        let read = |name: &str| std::fs::read_to_string(directory.path().join(name)).unwrap();
        let overview = read("welkin.1");
        let mut pages = 1;
        for command in described().get_subcommands() {
            let name = command.get_name();
            let page = read(&format!("welkin-{name}.1"));
            for flag in command.get_arguments().filter(|flag| !flag.is_hide_set()).filter_map(clap::Arg::get_long) {
                // roff writes a hyphen as \-.
                assert!(page.contains(&format!("\\-\\-{}", flag.replace('-', "\\-"))), "{name} --{flag}:\n{page}");
            }
            assert!(overview.contains(&format!("welkin\\-{}", name.replace('-', "\\-"))), "{name}");
            pages += 1;
        }
        assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), pages);
    }

    #[test]
    fn completions_know_commands_and_flags() {
        use clap_complete::Shell;
        for shell in [Shell::Bash, Shell::Zsh, Shell::Fish] {
            let mut text = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), "welkin", &mut text);
            let text = String::from_utf8(text).unwrap();
            assert!(text.contains("voxelize") && text.contains("exr-compression"), "{shell}");
        }
    }
}
