//! `welkin setup`: a Vulkan driver for the CPU, unpacked into the user's data directory by the scripts that a checkout uses.

use std::path::Path;
use std::process::Command;

use welkin::{Error, Result};

use super::args::SetupArgs;
use super::{places, prefix};

/// The scripts, by the names under which they source each other.
const SCRIPTS: [(&str, &str); 2] = [
    ("lavapipe-prefix.sh", include_str!("../../scripts/lavapipe-prefix.sh")),
    ("prefix-lib.sh", include_str!("../../scripts/prefix-lib.sh")),
];

pub fn run(args: &SetupArgs) -> Result<()> {
    let directory = args.dir.clone().or_else(prefix::data_directory);
    let directory =
        directory.ok_or_else(|| Error::invalid("--dir", "", "a directory: neither XDG_DATA_HOME nor HOME is set"))?;
    places::directory(&directory)?;
    let scripts = tempfile::tempdir().map_err(|error| Error::file(std::env::temp_dir(), error))?;
    for (name, text) in SCRIPTS {
        let file = scripts.path().join(name);
        std::fs::write(&file, text).map_err(|error| Error::file(&file, format!("cannot be written: {error}")))?;
    }
    let target = directory.join("lavapipe");
    // Recent ones have fragment shader interlock; where none can be had, the distribution's own still renders.
    for origin in ["recent", "own"] {
        if unpack(&scripts.path().join(SCRIPTS[0].0), origin, &target)? {
            return super::print(&format!("{}\n", target.display()));
        }
    }
    Err(Error::file(target, "cannot be unpacked (see above): install a Vulkan driver from the packages of this system"))
}

/// Whether the script has left a driver in `target`; it says on standard error why not.
fn unpack(script: &Path, origin: &str, target: &Path) -> Result<bool> {
    let status = Command::new("sh").arg(script).arg(origin).arg(target).status();
    status.map(|status| status.success()).map_err(|error| Error::file("sh", format!("cannot be started: {error}")))
}
