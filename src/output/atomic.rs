//! All of a file or nothing.

use std::io::{self, BufWriter, Write};
use std::path::Path;

use crate::{Error, Result};

/// Creates or replaces the file at `path` with what `write` writes. It is written to a temporary file in the same
/// directory and renamed when all of it is on the disk; on failure the temporary file is removed and what was at `path`
/// stays.
///
/// # Errors
/// [`Error::File`] naming `path` when the directory, the disk or `write` fails.
pub fn write_atomic(path: &Path, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<()> {
    let fault = |error: io::Error| Error::file(path, format!("cannot be written: {error}"));
    let directory = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    if path.is_dir() {
        return Err(Error::file(path, "cannot be written: it is a directory"));
    }
    if !directory.is_dir() {
        return Err(Error::file(path, format!("cannot be written: there is no directory {}", directory.display())));
    }
    let mut builder = tempfile::Builder::new();
    builder.prefix(".welkin-").suffix(".part");
    #[cfg(unix)]
    {
        // As any new file, less the user's mask; temporary files are private otherwise.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let temporary = builder.tempfile_in(directory).map_err(fault)?;
    let mut writer = BufWriter::new(temporary);
    write(&mut writer).map_err(fault)?;
    let temporary = writer.into_inner().map_err(|error| fault(error.into_error()))?;
    temporary.as_file().sync_all().map_err(fault)?; // A full disk may only be noticed here.
    temporary.persist(path).map_err(|error| fault(error.error))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(directory: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(directory).unwrap();
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
    }

    #[test]
    fn a_file_is_created_and_replaced() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.txt");
        for text in ["one", "two"] {
            write_atomic(&path, |file| file.write_all(text.as_bytes())).unwrap();
            assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
        }
        assert_eq!(names(directory.path()), ["a.txt"]);
    }

    #[test]
    fn a_failure_leaves_nothing_new_and_the_old_file_whole() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.txt");
        let full = |file: &mut dyn Write| {
            file.write_all(&[0; 100_000])?;
            Err(io::Error::from(io::ErrorKind::StorageFull))
        };
        let message = write_atomic(&path, full).unwrap_err().to_string();
        assert_eq!(message, format!("{}: cannot be written: no storage space", path.display()));
        assert!(names(directory.path()).is_empty());
        std::fs::write(&path, "old").unwrap();
        write_atomic(&path, full).unwrap_err();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(names(directory.path()), ["a.txt"]);
    }

    #[test]
    fn bad_places_are_named() {
        let directory = tempfile::tempdir().unwrap();
        let message = |path: &Path| write_atomic(path, |_| Ok(())).unwrap_err().to_string();
        assert!(message(directory.path()).ends_with("it is a directory"));
        assert!(
            message(&directory.path().join("none/a.txt")).contains("a.txt: cannot be written: there is no directory")
        );
    }
}
