//! Explicit particles: `[[clouds.particle]]` tables, or a CSV file of
//! `x,y,z,rx,ry,rz,qx,qy,qz,qw,density[,r,g,b[,vx,vy,vz]]` with one particle a line.
//!
//! In the file a first line of column names, empty lines and lines that begin with `#` are allowed. Quaternions are
//! normalised in both.

use std::path::Path;

use serde::Deserialize;

use crate::params::ParticleDesc;
use crate::{Error, Result};

const COLUMNS: [&str; 17] =
    ["x", "y", "z", "rx", "ry", "rz", "qx", "qy", "qz", "qw", "density", "r", "g", "b", "vx", "vy", "vz"];
/// Columns up to and including the density; the colour is optional.
const WITHOUT_COLOUR: usize = 11;
/// Columns up to and including the colour; the velocity is optional.
const WITHOUT_VELOCITY: usize = 14;

/// One `[[clouds.particle]]`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParticleKeys {
    /// Centre [m].
    pub centre: [f64; 3],
    /// Semi-axes [m].
    pub radii: [f32; 3],
    /// Quaternion x, y, z, w of any length but 0.
    pub rotation: Option<[f32; 4]>,
    /// Relative density.
    pub density: Option<f32>,
    /// Flat colour.
    pub colour: Option<[f32; 3]>,
    /// Motion [m/s].
    pub velocity: Option<[f64; 3]>,
}

/// The particles of `[[clouds.particle]]` tables.
pub fn inline(list: Vec<ParticleKeys>) -> Result<Vec<ParticleDesc>> {
    let defaults = ParticleDesc::default();
    list.into_iter()
        .enumerate()
        .map(|(index, keys)| {
            let rotation = keys.rotation.unwrap_or(defaults.rotation);
            let rotation = normalised(rotation).ok_or_else(|| {
                let field = format!("clouds.particle[{index}].rotation");
                Error::invalid(field, format!("{rotation:?}"), "a quaternion x, y, z, w other than 0")
            })?;
            Ok(ParticleDesc {
                centre: keys.centre,
                radii: keys.radii,
                rotation,
                density: keys.density.unwrap_or(defaults.density),
                colour: keys.colour.unwrap_or(defaults.colour),
                velocity: keys.velocity.unwrap_or(defaults.velocity),
            })
        })
        .collect()
}

/// The particles of the CSV file at `path`.
pub fn load(path: &Path) -> Result<Vec<ParticleDesc>> {
    let bytes =
        std::fs::read(path).map_err(|error| Error::file(path, format!("cannot be read: {error} (clouds.file)")))?;
    let text = String::from_utf8(bytes).map_err(|_| Error::file(path, "is not UTF-8 text (clouds.file)"))?;
    parse(&text, path)
}

fn parse(text: &str, path: &Path) -> Result<Vec<ParticleDesc>> {
    let mut particles = Vec::new();
    let mut first = true;
    for (index, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        if line.trim().is_empty() || line.trim_start().starts_with('#') {
            continue;
        }
        let at = |column: usize, reason: String| Error::FileAt { path: path.into(), line: index + 1, column, reason };
        let cells: Vec<(usize, &str)> = cells(line);
        if ![WITHOUT_COLOUR, WITHOUT_VELOCITY, COLUMNS.len()].contains(&cells.len()) {
            let most = COLUMNS.len();
            let expected = format!("{WITHOUT_COLOUR}, {WITHOUT_VELOCITY} or {most}: {}", COLUMNS.join(","));
            return Err(at(1, format!("{} columns: expected {expected}", cells.len())));
        }
        if std::mem::take(&mut first) && cells.iter().all(|(_, cell)| cell.parse::<f64>().is_err()) {
            if let Some(((column, cell), name)) = cells.iter().zip(COLUMNS).find(|((_, cell), name)| cell != name) {
                return Err(at(*column, format!("column name {cell:?}: expected {name:?}")));
            }
            continue;
        }
        let mut numbers = [0.0_f64; COLUMNS.len()];
        for (slot, ((column, cell), name)) in cells.iter().zip(COLUMNS).enumerate() {
            numbers[slot] = cell.parse().map_err(|_| at(*column, format!("{name} = {cell:?}: expected a number")))?;
        }
        let has_colour = cells.len() >= WITHOUT_VELOCITY;
        let particle = particle(&numbers, has_colour)
            .ok_or_else(|| at(cells[6].0, "qx,qy,qz,qw: expected a quaternion other than 0".into()))?;
        particle.validate(|| "the particle".into()).map_err(|error| at(1, error.to_string()))?;
        particles.push(particle);
    }
    if particles.is_empty() {
        return Err(Error::file(path, "holds no particle (clouds.file)"));
    }
    Ok(particles)
}

/// The cells of a line, each with its column in characters from 1.
fn cells(line: &str) -> Vec<(usize, &str)> {
    let mut column = 1;
    line.split(',')
        .map(|cell| {
            let at = column;
            column += cell.chars().count() + 1;
            (at, cell.trim())
        })
        .collect()
}

/// A particle from the numbers of a line; `None` for a quaternion that is no direction.
fn particle(numbers: &[f64; COLUMNS.len()], has_colour: bool) -> Option<ParticleDesc> {
    let at = |slot: usize| numbers[slot] as f32;
    Some(ParticleDesc {
        centre: std::array::from_fn(|i| numbers[i]),
        radii: std::array::from_fn(|i| at(3 + i)),
        rotation: normalised(std::array::from_fn(|i| at(6 + i)))?,
        density: at(10),
        colour: if has_colour { std::array::from_fn(|i| at(11 + i)) } else { ParticleDesc::default().colour },
        velocity: std::array::from_fn(|i| numbers[WITHOUT_VELOCITY + i]), // 0 where the line has none
    })
}

/// `quaternion` at length 1, unless its length is 0 or not finite.
fn normalised(quaternion: [f32; 4]) -> Option<[f32; 4]> {
    let length = quaternion.iter().map(|&c| f64::from(c).powi(2)).sum::<f64>().sqrt();
    (length > 1.0e-12 && length.is_finite()).then(|| quaternion.map(|c| (f64::from(c) / length) as f32))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<ParticleDesc>> {
        parse(text, Path::new("cloud.csv"))
    }

    fn complaint(text: &str) -> String {
        read(text).unwrap_err().to_string()
    }

    #[test]
    fn lines_become_particles() {
        let text = "x,y,z,rx,ry,rz,qx,qy,qz,qw,density\n# a comment\n\n1,2,3, 4,5,6, 0,0,0,2, 0.5\n";
        let expected = ParticleDesc {
            centre: [1.0, 2.0, 3.0],
            radii: [4.0, 5.0, 6.0],
            rotation: [0.0, 0.0, 0.0, 1.0],
            density: 0.5,
            colour: [1.0; 3],
            velocity: [0.0; 3],
        };
        assert_eq!(read(text).unwrap(), [expected]);
        let coloured = read("1,2,3,4,5,6,0,0,0,1,0.5,0.1,0.2,0.3\r\n").unwrap();
        assert_eq!(coloured, [ParticleDesc { colour: [0.1, 0.2, 0.3], ..expected }]);
        let moving = read("1,2,3,4,5,6,0,0,0,1,0.5,1,1,1,7,-8,9.5").unwrap();
        assert_eq!(moving, [ParticleDesc { velocity: [7.0, -8.0, 9.5], ..expected }]);
    }

    #[test]
    fn faults_name_line_column_and_expectation() {
        let good = "0,0,0,1,1,1,0,0,0,1,1\n";
        assert_eq!(complaint(&format!("{good}0,0,0,1,1,x,0,0,0,1,1")), "cloud.csv:2:11: rz = \"x\": expected a number");
        assert!(complaint(&format!("{good}\n1,2,3")).starts_with("cloud.csv:3:1: 3 columns: expected 11, 14 or 17"));
        assert!(complaint("0,0,0,1,1,1,0,0,0,0,1").starts_with("cloud.csv:1:13: qx,qy,qz,qw: expected a quaternion"));
        assert!(complaint("0,0,0,1,-1,1,0,0,0,1,1").contains("cloud.csv:1:1: the particle.radii[1] = -1"));
        assert!(complaint("0,0,0,1,1,1,0,0,0,1,1,1,1,1,0,inf,0").contains("velocity[1] = inf"));
        assert!(complaint("0,0,0,1,nan,1,0,0,0,1,1").contains("radii[1] = NaN"));
        assert!(complaint("z,y,x,rx,ry,rz,qx,qy,qz,qw,density").contains("column name \"z\": expected \"x\""));
        assert!(complaint("# nothing\n").contains("no particle"));
    }
}
