//! Tables on disk: one file each, named after everything that its contents depend on, checksummed, written whole or not
//! at all.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

const MAGIC: &[u8; 16] = b"welkin table 1\r\n";
const HEADER: usize = MAGIC.len() + 8 + 32;

/// Name of a table's file: blake3 of the parameters that it was made from and of the programs that made it.
pub(crate) fn file_name(kind: &str, parameters: &[u8], programs: &[&[u8]]) -> String {
    let mut hasher = blake3::Hasher::new();
    hasher.update(kind.as_bytes());
    hasher.update(&(parameters.len() as u64).to_le_bytes());
    hasher.update(parameters);
    for program in programs {
        hasher.update(&(program.len() as u64).to_le_bytes());
        hasher.update(program);
    }
    format!("{kind}-{}.table", &hasher.finalize().to_hex()[..32])
}

/// What reading a cached table gave.
pub(crate) enum Cached {
    /// The table.
    Found(Vec<u8>),
    /// There is none.
    Absent,
    /// There is one that cannot be used; why.
    Damaged(String),
}

/// Reads a table of exactly `length` bytes.
pub(crate) fn read(path: &Path, length: usize) -> Cached {
    let bytes = match fs::read(path) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Cached::Absent,
        Err(error) => return Cached::Damaged(error.to_string()),
    };
    if bytes.len() < HEADER || &bytes[..MAGIC.len()] != MAGIC {
        return Cached::Damaged("it is not a table of this version".into());
    }
    let (header, payload) = bytes.split_at(HEADER);
    let stored = u64::from_le_bytes(header[16..24].try_into().unwrap_or_default());
    if stored != payload.len() as u64 || payload.len() != length {
        return Cached::Damaged(format!("it holds {} bytes of data, expected {length}", payload.len()));
    }
    if blake3::hash(payload).as_bytes()[..] != header[24..56] {
        return Cached::Damaged("its checksum does not match its data".into());
    }
    Cached::Found(payload.to_vec())
}

/// Writes a table beside its final name and renames it, so that no reader ever sees half of one.
pub(crate) fn write(path: &Path, payload: &[u8]) -> Result<(), String> {
    static COUNTER: AtomicU32 = AtomicU32::new(0);
    let Some(directory) = path.parent() else { return Err("the path has no directory".into()) };
    let unique = format!(".tmp-{}-{}", std::process::id(), COUNTER.fetch_add(1, Ordering::Relaxed));
    let temporary: PathBuf = directory.join(unique);
    let written = fs::create_dir_all(directory).and_then(|()| {
        let mut file = fs::File::create(&temporary)?;
        file.write_all(MAGIC)?;
        file.write_all(&(payload.len() as u64).to_le_bytes())?;
        file.write_all(blake3::hash(payload).as_bytes())?;
        file.write_all(payload)?;
        file.sync_all()?;
        fs::rename(&temporary, path)
    });
    written.map_err(|error| {
        let _ = fs::remove_file(&temporary);
        error.to_string()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn directory(name: &str) -> PathBuf {
        let path = std::env::temp_dir().join(format!("welkin-cache-{name}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&path);
        path
    }

    #[test]
    fn a_table_comes_back_and_damage_is_told_apart_from_absence() {
        let directory = directory("damage");
        let path = directory.join("a.table");
        assert!(matches!(read(&path, 5), Cached::Absent));
        write(&path, b"12345").unwrap();
        assert!(matches!(read(&path, 5), Cached::Found(bytes) if bytes == b"12345"));
        assert!(matches!(read(&path, 6), Cached::Damaged(_)));
        let mut bytes = fs::read(&path).unwrap();
        for (at, length) in [(bytes.len() - 1, bytes.len()), (0, bytes.len()), (30, bytes.len()), (0, 20), (0, 0)] {
            bytes.truncate(length);
            if at < bytes.len() {
                bytes[at] ^= 1;
            }
            fs::write(&path, &bytes).unwrap();
            assert!(matches!(read(&path, 5), Cached::Damaged(_)), "byte {at} of {length}");
            write(&path, b"12345").unwrap();
            bytes = fs::read(&path).unwrap();
        }
        assert_eq!(fs::read_dir(&directory).unwrap().count(), 1, "temporary files were left");
        fs::remove_dir_all(directory).unwrap();
    }

    #[test]
    fn a_write_that_fails_leaves_nothing() {
        let directory = directory("fails");
        fs::create_dir_all(directory.join("a.table")).unwrap(); // a directory in the way of the rename
        fs::write(directory.join("a.table/x"), b"").unwrap();
        assert!(write(&directory.join("a.table"), b"12345").is_err());
        assert_eq!(fs::read_dir(&directory).unwrap().count(), 1);
        fs::remove_dir_all(directory).unwrap();
    }

    #[test]
    fn the_name_depends_on_parameters_and_programs() {
        let name = file_name("x", &[1, 2], &[&[1, 2]]);
        assert_ne!(name, file_name("x", &[1, 3], &[&[1, 2]]));
        assert_ne!(name, file_name("x", &[1, 2], &[&[1], &[2]]));
        assert_eq!(name, file_name("x", &[1, 2], &[&[1, 2]]));
    }
}
