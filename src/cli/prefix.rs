//! A Vulkan driver that `welkin setup` or `scripts/setup` has unpacked, for a program that cargo's runner has not started.
//!
//! The driver may bring its own libc, so a program does not load it: the prefix's `run` starts the program anew on it.

use std::path::{Path, PathBuf};

use welkin::{Error, Result};

/// Names the folder of a prefix, or one that holds it.
const FOLDER: &str = "WELKIN_PREFIX_DIR";

/// Starts this program again on an unpacked driver, if `error` says that the system has none; comes back with the error
/// where there is none either.
pub fn start_again(error: Error) -> Error {
    let variable = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty());
    // `run` sets WELKIN_PREFIX: then this is the second time.
    let asked_not_to = variable("WELKIN_PREFIX").is_some() || variable("WELKIN_DRIVER").is_some_and(|d| d == "system");
    if !matches!(error, Error::NoDriver { .. }) || asked_not_to {
        return error;
    }
    let program = std::env::current_exe().ok();
    let Some(run) = find(program.as_deref(), |name| variable(name).map(PathBuf::from)) else { return error };
    match execute(&run, program.as_deref()) {
        Ok(never) => match never {},
        Err(failed) => failed,
    }
}

/// Put where a driver is looked for: beside the program, and in the user's data directory.
pub fn data_directory() -> Option<PathBuf> {
    data_from(|name| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from))
}

fn data_from(variable: impl Fn(&str) -> Option<PathBuf>) -> Option<PathBuf> {
    // The XDG specification has relative paths ignored.
    let data = variable("XDG_DATA_HOME").filter(|path| path.is_absolute());
    data.or_else(|| variable("HOME").map(|home| home.join(".local/share"))).map(|data| data.join("welkin"))
}

/// The `run` of the first prefix there is.
fn find(program: Option<&Path>, variable: impl Fn(&str) -> Option<PathBuf>) -> Option<PathBuf> {
    let beside = program.and_then(Path::parent).map(Path::to_owned);
    let folders = [variable(FOLDER), beside, data_from(&variable)];
    folders.into_iter().flatten().flat_map(|folder| [folder.join("run"), folder.join("lavapipe/run")]).find(|run| {
        // Any program may be called `run`; a prefix also has the driver's manifest beside it.
        run.is_file() && run.with_file_name("lvp.json").is_file()
    })
}

#[cfg(unix)]
fn execute(run: &Path, program: Option<&Path>) -> Result<std::convert::Infallible> {
    use std::os::unix::process::CommandExt;
    let Some(program) = program else { return Err(Error::file(run, "cannot start this program: its path is unknown")) };
    let error = std::process::Command::new(run).arg(program).args(std::env::args_os().skip(1)).exec();
    Err(Error::file(run, format!("cannot be started: {error}")))
}

#[cfg(not(unix))]
fn execute(run: &Path, _: Option<&Path>) -> Result<std::convert::Infallible> {
    Err(Error::file(run, "cannot be started on this system"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_prefix_is_found_where_it_is_named_then_beside_the_program_then_among_the_users_data() {
        let directory = tempfile::tempdir().unwrap();
        let place = |name: &str| directory.path().join(name);
        for folder in ["named/lavapipe", "bin", "data/welkin/lavapipe", "empty"] {
            std::fs::create_dir_all(place(folder)).unwrap();
            std::fs::write(place(folder).join("run"), "").unwrap();
        }
        let program = place("bin/welkin");
        let found = |names: &[(&str, &str)]| {
            find(Some(&program), |name| names.iter().find(|(known, _)| *known == name).map(|(_, folder)| place(folder)))
        };
        let all = [("WELKIN_PREFIX_DIR", "named"), ("XDG_DATA_HOME", "data")];
        assert_eq!(found(&all), None, "a file called run is no prefix");
        for folder in ["named/lavapipe", "bin", "data/welkin/lavapipe"] {
            std::fs::write(place(folder).join("lvp.json"), "").unwrap();
        }
        assert_eq!(found(&all), Some(place("named/lavapipe/run")));
        assert_eq!(found(&[("WELKIN_PREFIX_DIR", "empty"), all[1]]), Some(place("bin/run")));
        std::fs::remove_file(place("bin/lvp.json")).unwrap();
        assert_eq!(found(&all[1..]), Some(place("data/welkin/lavapipe/run")));
        assert_eq!(
            data_from(|name| (name == "HOME").then(|| "/home/me".into())),
            Some("/home/me/.local/share/welkin".into())
        );
    }
}
