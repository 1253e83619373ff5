//! Where files go: pictures, and the cache of tables.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use welkin::output::{AtomicFile, Format};
use welkin::{Error, Result};

/// The picture file of each scene. Everything that can be wrong with them is found before the first frame.
pub fn pictures(scenes: &[PathBuf], output: Option<&Path>) -> Result<Vec<PathBuf>> {
    let is_directory =
        |path: &Path| path.is_dir() || path.to_string_lossy().ends_with(['/', std::path::MAIN_SEPARATOR]);
    if let ([_], Some(file)) = (scenes, output)
        && !is_directory(file)
    {
        Format::of(file)?;
        writable(file)?;
        return Ok(vec![file.to_owned()]);
    }
    let directory = output.unwrap_or(Path::new(""));
    if scenes.len() > 1 && output.is_some() && !is_directory(directory) {
        let expected = "a directory for several scenes; end the name with / to have it made";
        return Err(Error::invalid("--output", directory.display(), expected));
    }
    let mut taken: HashMap<PathBuf, &Path> = HashMap::new();
    let mut pictures = Vec::with_capacity(scenes.len());
    for scene in scenes {
        let name = scene.file_stem().ok_or_else(|| Error::file(scene, "names no scene file"))?;
        let mut name = name.to_owned();
        name.push(".png");
        let picture = directory.join(name);
        if let Some(other) = taken.insert(picture.clone(), scene) {
            let reason = format!("would be written for {} and for {}", other.display(), scene.display());
            return Err(Error::file(picture, reason));
        }
        pictures.push(picture);
    }
    if output.is_some() {
        self::directory(directory)?;
    }
    Ok(pictures)
}

/// Makes the directory that files are to be written in, if it is not there.
pub fn directory(path: &Path) -> Result<()> {
    std::fs::create_dir_all(path).map_err(|error| Error::file(path, format!("cannot be made: {error}")))
}

/// `file` can be written, which is found by starting it and leaving it: hours of work may come before it is.
pub fn writable(file: &Path) -> Result<()> {
    AtomicFile::create(file).map(drop)
}

/// The directory for tables: what was asked for, `$WELKIN_CACHE`, or `welkin` in the user's cache directory.
pub fn cache(asked: Option<&Path>) -> Result<PathBuf> {
    let cache = cache_from(asked, |name| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from));
    if cache.exists() && !cache.is_dir() {
        return Err(Error::invalid("--cache", cache.display(), "a directory for tables, made if need be"));
    }
    Ok(cache)
}

fn cache_from(asked: Option<&Path>, variable: impl Fn(&str) -> Option<PathBuf>) -> PathBuf {
    asked
        .map(Path::to_owned)
        .or_else(|| variable("WELKIN_CACHE"))
        // The XDG specification has relative paths ignored.
        .or_else(|| variable("XDG_CACHE_HOME").filter(|path| path.is_absolute()).map(|base| base.join("welkin")))
        .or_else(|| variable("LOCALAPPDATA").map(|base| base.join("welkin")))
        .or_else(|| variable("HOME").map(|home| home.join(".cache/welkin")))
        .unwrap_or_else(|| std::env::temp_dir().join("welkin-cache"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_named_by_output_or_scene() {
        let scenes = |names: &[&str]| names.iter().map(PathBuf::from).collect::<Vec<_>>();
        let directory = tempfile::tempdir().unwrap();
        let one = scenes(&["s/sky.toml"]);
        assert_eq!(pictures(&one, None).unwrap(), scenes(&["sky.png"]));
        assert_eq!(pictures(&one, Some(Path::new("a.exr"))).unwrap(), scenes(&["a.exr"]));
        assert_eq!(pictures(&one, Some(directory.path())).unwrap(), [directory.path().join("sky.png")]);
        let two = scenes(&["s/sky.toml", "s/sea.toml"]);
        assert_eq!(pictures(&two, None).unwrap(), scenes(&["sky.png", "sea.png"]));
        let made = directory.path().join("new");
        let with_slash = PathBuf::from(format!("{}/", made.display()));
        assert_eq!(pictures(&two, Some(&with_slash)).unwrap(), [made.join("sky.png"), made.join("sea.png")]);
        assert!(made.is_dir());
    }

    #[test]
    fn bad_outputs_are_found_before_rendering() {
        let message = |scenes: &[&str], output: &str| {
            let scenes: Vec<_> = scenes.iter().map(PathBuf::from).collect();
            pictures(&scenes, Some(Path::new(output))).unwrap_err().to_string()
        };
        assert!(message(&["sky.toml"], "a.jpg").starts_with("a.jpg: names no picture format"));
        assert!(message(&["sky.toml"], "no/such/a.png").contains("there is no directory no/such"));
        assert!(message(&["a.toml", "b.toml"], "a.png").starts_with("--output = a.png: expected a directory"));
        assert!(message(&["x/a.toml", "y/a.toml"], "./").contains("would be written for x/a.toml and for y/a.toml"));
    }

    #[test]
    fn the_cache_is_where_it_is_asked_for() {
        let none = |_: &str| None;
        assert_eq!(cache_from(Some(Path::new("c")), none), Path::new("c"));
        let environment = |name: &str| match name {
            "XDG_CACHE_HOME" => Some(PathBuf::from("/xdg")),
            "HOME" => Some(PathBuf::from("/home/me")),
            _ => None,
        };
        assert_eq!(cache_from(None, environment), Path::new("/xdg/welkin"));
        assert_eq!(
            cache_from(None, |name| environment(name).filter(|_| name == "HOME")),
            Path::new("/home/me/.cache/welkin")
        );
        assert_eq!(cache_from(None, |name| (name == "WELKIN_CACHE").then(|| "/w".into())), Path::new("/w"));
    }
}
