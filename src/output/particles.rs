//! Lists of particles as CSV, as scenes read them.

use std::io::Write;
use std::path::Path;

use super::AtomicFile;
use crate::Result;
use crate::params::ParticleDesc;

/// Writes `particles`, each with the number of its cloud and without its colour, under the comment lines `notes`.
///
/// # Errors
/// [`Error::File`](crate::Error::File) when the file cannot be written.
pub fn write_particles(path: &Path, notes: &[String], particles: &[ParticleDesc]) -> Result<()> {
    let mut file = AtomicFile::create(path)?;
    let mut write = || {
        notes.iter().try_for_each(|note| writeln!(file, "# {note}"))?;
        writeln!(file, "x,y,z,rx,ry,rz,qx,qy,qz,qw,density,cloud")?;
        particles.iter().try_for_each(|p| {
            let ([x, y, z], [rx, ry, rz], [qx, qy, qz, qw]) = (p.centre, p.radii, p.rotation);
            writeln!(file, "{x},{y},{z},{rx},{ry},{rz},{qx},{qy},{qz},{qw},{},{}", p.density, p.cloud)
        })
    };
    let result = write();
    result.map_err(|error| file.fault(&error))?;
    file.commit()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scatter::Field;

    #[test]
    fn what_is_written_is_read_back() {
        let particles = Field { clouds: 3, particles: 100, ..Field::default() }.particles().unwrap();
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("field.csv");
        write_particles(&file, &["a note".into()], &particles).unwrap();
        let read = crate::scene::particles::load(&file).unwrap();
        // Quaternions are normalised again when read: to one rounding of f32.
        let near =
            |a: &ParticleDesc, b: &ParticleDesc| a.rotation.iter().zip(b.rotation).all(|(a, b)| (a - b).abs() < 2.0e-7);
        assert!(read.iter().zip(&particles).all(|(a, b)| near(a, b)));
        let turned = |p: &ParticleDesc| ParticleDesc { rotation: [0.0, 0.0, 0.0, 1.0], ..*p };
        assert!(read.iter().map(turned).eq(particles.iter().map(turned)));
    }
}
