//! Commands run in a folder of their own, and what they leave there.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Output};

use super::{stderr, welkin};

/// Two balls in the sun before black, no tables.
pub const BALLS: &str = r#"
    [camera]
    position = [0, 0, 0]
    pitch = 0
    fov_y = 40
    [sun]
    elevation = 40
    azimuth = 60
    [clouds]
    source = "particles"
    style = "radial"
    [[clouds.particle]]
    centre = [0, 0, -500]
    radii = [100, 80, 100]
    [[clouds.particle]]
    centre = [80, 40, -450]
    radii = [60, 50, 70]
    density = 0.4
    [sky]
    model = "none"
"#;

/// A folder for a test, with `sky.toml` in it.
pub fn directory(scene: &str) -> tempfile::TempDir {
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(directory.path().join("sky.toml"), scene).unwrap();
    directory
}

/// `welkin` with the words of `line` in `directory`, where it also keeps its tables.
pub fn command(directory: &Path, line: &str) -> Command {
    let mut command = welkin();
    command.args(line.split_whitespace()).current_dir(directory).env("WELKIN_CACHE", directory.join("cache"));
    command
}

/// Runs [`command`]; it must succeed.
#[track_caller]
pub fn run(directory: &Path, line: &str) -> Output {
    let output = command(directory, line).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{line}: {}", stderr(&output));
    output
}

/// Runs [`command`]; it must end with status 2 and a message with each of `parts`, and leave every file as it was.
#[track_caller]
pub fn refused(directory: &Path, line: &str, parts: &[&str]) {
    let before = contents(directory);
    let output = command(directory, line).output().unwrap();
    let message = stderr(&output);
    assert_eq!(output.status.code(), Some(2), "{line}: {message}");
    assert!(!message.contains("panicked"), "{line}: {message}");
    for part in parts {
        assert!(message.contains(part), "{line}: {part:?} is not in {message:?}");
    }
    let after = contents(directory);
    assert!(before == after, "{line}: {:?} became {:?}", before.keys(), after.keys());
}

/// Names in `directory` other than the scene's.
pub fn files(directory: &Path) -> Vec<String> {
    contents(directory).into_keys().filter(|name| name != "sky.toml").collect()
}

/// Every name in `directory`, and what each file holds.
fn contents(directory: &Path) -> BTreeMap<String, Option<Vec<u8>>> {
    let entries = std::fs::read_dir(directory).unwrap().map(Result::unwrap);
    entries.map(|entry| (entry.file_name().into_string().unwrap(), std::fs::read(entry.path()).ok())).collect()
}

/// The values of a NumPy array of f32, and its shape.
pub fn npy(path: &Path) -> (Vec<u64>, Vec<f32>) {
    let bytes = std::fs::read(path).unwrap();
    let file = npyz::NpyFile::new(&bytes[..]).unwrap();
    (file.shape().to_vec(), file.into_vec().unwrap())
}

pub fn json(path: &Path) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}
