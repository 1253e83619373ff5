//! All of a file or nothing.

use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use crate::{Error, Result};

/// A file on its way: written beside its place, and moved there by [`Self::commit`] when all of it is on the disk. Dropped
/// before, it leaves nothing, and what was at its place stays.
pub struct AtomicFile {
    path: PathBuf,
    writer: BufWriter<NamedTempFile>,
}

impl AtomicFile {
    /// Starts the file for `path`, in the same directory.
    ///
    /// # Errors
    /// [`Error::File`] naming `path` when it or its directory cannot be written.
    pub fn create(path: &Path) -> Result<Self> {
        let directory = directory_of(path);
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
        let file = builder.tempfile_in(directory).map_err(|error| fault(path, &error))?;
        Ok(Self { path: path.to_owned(), writer: BufWriter::new(file) })
    }

    /// Moves the file to its place.
    ///
    /// # Errors
    /// [`Error::File`] naming the path when the disk fails.
    pub fn commit(self) -> Result<()> {
        let Self { path, writer } = self;
        let file = writer.into_inner().map_err(|error| fault(&path, error.error()))?;
        file.as_file().sync_all().map_err(|error| fault(&path, &error))?; // A full disk may only be noticed here.
        file.persist(&path).map_err(|error| fault(&path, &error.error))?;
        Ok(())
    }

    /// The error of a failed write to this file.
    pub fn fault(&self, error: &io::Error) -> Error {
        fault(&self.path, error)
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.writer.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.writer.flush()
    }
}

fn fault(path: &Path, error: &io::Error) -> Error {
    Error::file(path, format!("cannot be written: {error}"))
}

/// The directory that `path` lies in.
pub(super) fn directory_of(path: &Path) -> &Path {
    path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Creates or replaces the file at `path` with what `write` writes, all of it or nothing ([`AtomicFile`]).
///
/// # Errors
/// [`Error::File`] naming `path` when the directory, the disk or `write` fails.
pub fn write_atomic(path: &Path, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<()> {
    let mut file = AtomicFile::create(path)?;
    write(&mut file).map_err(|error| file.fault(&error))?;
    file.commit()
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
