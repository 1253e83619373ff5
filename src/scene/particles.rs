//! Explicit particles: `[[clouds.particle]]` tables, or a CSV file of
//! `x,y,z,rx,ry,rz,qx,qy,qz,qw,density[,r,g,b[,vx,vy,vz]][,cloud]` with one particle a line.
//!
//! In the file a first line of column names, empty lines and lines that begin with `#` are allowed. Quaternions are
//! normalised in both.

use std::path::Path;

use serde::Deserialize;

use crate::params::ParticleDesc;
use crate::threads::parallel;
use crate::{Error, Result};

/// Every column that a file may have, in order.
pub(crate) const COLUMNS: [&str; 18] =
    ["x", "y", "z", "rx", "ry", "rz", "qx", "qy", "qz", "qw", "density", "r", "g", "b", "vx", "vy", "vz", "cloud"];
/// Columns up to and including the density; colour, velocity and cloud are optional.
const WITHOUT_COLOUR: usize = 11;
/// Slot of the cloud.
const CLOUD: usize = 17;
/// Numbers of columns that a file does not have: a white colour, at rest, cloud 0.
const DEFAULTS: [f64; COLUMNS.len()] =
    [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0];
/// Which columns lines of 11, 12, 14, 15, 17 and 18 numbers have.
const LAYOUTS: [&[usize]; 6] = [
    &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10],
    &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, CLOUD],
    &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13],
    &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, CLOUD],
    &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16],
    &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, CLOUD],
];

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
    /// Which cloud it is part of.
    pub cloud: Option<u32>,
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
                cloud: keys.cloud.unwrap_or(defaults.cloud),
            })
        })
        .collect()
}

/// The particles of the CSV file at `path`.
pub fn load(path: &Path) -> Result<Vec<ParticleDesc>> {
    let bytes = std::fs::read(path).map_err(|error| {
        // Fields of a million particles are made, not kept.
        let how = match error.kind() {
            std::io::ErrorKind::NotFound => "; `welkin scatter` makes such files, and the scene may tell how",
            _ => "",
        };
        Error::file(path, format!("cannot be read: {error} (clouds.file{how})"))
    })?;
    let text = String::from_utf8(bytes).map_err(|_| Error::file(path, "is not UTF-8 text (clouds.file)"))?;
    parse(&text, path)
}

/// A fault of a line: column in characters, and what is wrong.
type Fault = (usize, String);

/// Lines are read on all cores, in parts of this many bytes and the rest of a line.
const PART: usize = 1 << 20;

fn parse(text: &str, path: &Path) -> Result<Vec<ParticleDesc>> {
    let text = text.trim_start_matches('\u{feff}');
    let mut parts = Vec::new();
    let mut rest = text;
    while !rest.is_empty() {
        let end = rest.as_bytes().iter().skip(PART).position(|&byte| byte == b'\n');
        let (part, after) = rest.split_at(end.map_or(rest.len(), |at| PART + at + 1));
        parts.push(part);
        rest = after;
    }
    let mut first = 1; // line of the part
    let mut particles = Vec::new();
    for (index, part) in parallel(parts.len(), |index| parse_part(parts[index], index == 0)).into_iter().enumerate() {
        let part = part.map_err(|(line, (column, reason))| Error::FileAt {
            path: path.into(),
            line: first + line,
            column,
            reason,
        })?;
        particles.extend(part);
        first += parts[index].lines().count();
    }
    if particles.is_empty() {
        return Err(Error::file(path, "holds no particle (clouds.file)"));
    }
    Ok(particles)
}

/// The particles of some lines, or the number of a bad one from 0 and its fault. `first`: there may be column names.
fn parse_part(text: &str, first: bool) -> Result<Vec<ParticleDesc>, (usize, Fault)> {
    let mut first = first;
    let mut particles = Vec::with_capacity(text.len() / 64);
    for (index, line) in text.lines().enumerate() {
        if line.trim().is_empty() || line.trim_start().starts_with('#') {
            continue;
        }
        if let Some(particle) = parse_line(line, std::mem::take(&mut first)).map_err(|fault| (index, fault))? {
            particles.push(particle);
        }
    }
    Ok(particles)
}

/// The particle of a line, or none from one of column names, which only the first may be.
fn parse_line(line: &str, first: bool) -> Result<Option<ParticleDesc>, Fault> {
    let mut cells = [""; COLUMNS.len() + 1];
    let mut count = 0;
    for cell in line.split(',') {
        count += 1;
        if let Some(slot) = cells.get_mut(count - 1) {
            *slot = cell;
        }
    }
    // Columns are counted when something is wrong.
    let column = |slot: usize| 1 + cells[..slot].iter().map(|cell| cell.chars().count() + 1).sum::<usize>();
    let Some(layout) = LAYOUTS.iter().find(|layout| layout.len() == count) else {
        let expected =
            format!("11, 12, 14, 15, 17 or 18: {}[,r,g,b[,vx,vy,vz]][,cloud]", COLUMNS[..WITHOUT_COLOUR].join(","));
        return Err((1, format!("{count} columns: expected {expected}")));
    };
    let names = || layout.iter().map(|&slot| COLUMNS[slot]);
    if first && cells[..count].iter().all(|cell| cell.trim().parse::<f64>().is_err()) {
        return match cells.iter().zip(names()).enumerate().find(|(_, (cell, name))| cell.trim() != *name) {
            Some((at, (cell, name))) => Err((column(at), format!("column name {:?}: expected {name:?}", cell.trim()))),
            None => Ok(None),
        };
    }
    let mut numbers = DEFAULTS;
    for (at, &slot) in layout.iter().enumerate() {
        let cell = cells[at].trim();
        let name = COLUMNS[slot];
        numbers[slot] = cell.parse().map_err(|_| (column(at), format!("{name} = {cell:?}: expected a number")))?;
    }
    let cloud = numbers[CLOUD];
    if !(0.0..=f64::from(u32::MAX)).contains(&cloud) || cloud.fract() != 0.0 {
        let expected = format!("cloud = {cloud}: expected a whole number from 0 to {}", u32::MAX);
        return Err((column(layout.len() - 1), expected));
    }
    let particle =
        particle(&numbers).ok_or_else(|| (column(6), "qx,qy,qz,qw: expected a quaternion other than 0".into()))?;
    particle.validate(|| "the particle".into()).map_err(|error| (1, error.to_string()))?;
    Ok(Some(particle))
}

/// A particle from the numbers of a line; `None` for a quaternion that is no direction.
fn particle(numbers: &[f64; COLUMNS.len()]) -> Option<ParticleDesc> {
    let at = |slot: usize| numbers[slot] as f32;
    Some(ParticleDesc {
        centre: std::array::from_fn(|i| numbers[i]),
        radii: std::array::from_fn(|i| at(3 + i)),
        rotation: normalised(std::array::from_fn(|i| at(6 + i)))?,
        density: at(10),
        colour: std::array::from_fn(|i| at(11 + i)),
        velocity: std::array::from_fn(|i| numbers[14 + i]),
        cloud: numbers[CLOUD] as u32,
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
            cloud: 0,
        };
        assert_eq!(read(text).unwrap(), [expected]);
        let coloured = read("1,2,3,4,5,6,0,0,0,1,0.5,0.1,0.2,0.3\r\n").unwrap();
        assert_eq!(coloured, [ParticleDesc { colour: [0.1, 0.2, 0.3], ..expected }]);
        let moving = read("1,2,3,4,5,6,0,0,0,1,0.5,1,1,1,7,-8,9.5").unwrap();
        assert_eq!(moving, [ParticleDesc { velocity: [7.0, -8.0, 9.5], ..expected }]);
        let grouped = read("x,y,z,rx,ry,rz,qx,qy,qz,qw,density,cloud\n1,2,3,4,5,6,0,0,0,1,0.5,7\n").unwrap();
        assert_eq!(grouped, [ParticleDesc { cloud: 7, ..expected }]);
        let both = read("1,2,3,4,5,6,0,0,0,1,0.5,0.1,0.2,0.3,4294967295").unwrap();
        assert_eq!(both, [ParticleDesc { colour: [0.1, 0.2, 0.3], cloud: u32::MAX, ..expected }]);
    }

    #[test]
    fn long_files_are_read_in_order_and_faults_far_down_have_their_line() {
        let line = |i: usize| format!("{i},2,3,4,5,6,0,0,0,1,0.5,{}\n", i / 100);
        let mut text: String = (0..100_000).map(line).collect();
        assert!(text.len() > 2 * PART);
        let particles = read(&text).unwrap();
        assert_eq!(particles.len(), 100_000);
        for (i, p) in particles.iter().enumerate() {
            assert_eq!((p.centre[0], p.cloud), (i as f64, (i / 100) as u32));
        }
        text += "1,2\n";
        assert!(complaint(&text).starts_with("cloud.csv:100001:1: 2 columns"), "{}", complaint(&text));
    }

    #[test]
    fn faults_name_line_column_and_expectation() {
        let good = "0,0,0,1,1,1,0,0,0,1,1\n";
        assert_eq!(complaint(&format!("{good}0,0,0,1,1,x,0,0,0,1,1")), "cloud.csv:2:11: rz = \"x\": expected a number");
        assert!(
            complaint(&format!("{good}\n1,2,3"))
                .starts_with("cloud.csv:3:1: 3 columns: expected 11, 12, 14, 15, 17 or 18")
        );
        assert!(complaint("0,0,0,1,1,1,0,0,0,0,1").starts_with("cloud.csv:1:13: qx,qy,qz,qw: expected a quaternion"));
        assert!(complaint("0,0,0,1,-1,1,0,0,0,1,1").contains("cloud.csv:1:1: the particle.radii[1] = -1"));
        assert!(complaint("0,0,0,1,1,1,0,0,0,1,1,1,1,1,0,inf,0").contains("velocity[1] = inf"));
        assert!(complaint("0,0,0,1,nan,1,0,0,0,1,1").contains("radii[1] = NaN"));
        assert!(complaint("z,y,x,rx,ry,rz,qx,qy,qz,qw,density").contains("column name \"z\": expected \"x\""));
        assert!(complaint("0,0,0,1,1,1,0,0,0,1,1,-1").contains("cloud.csv:1:23: cloud = -1: expected a whole number"));
        assert!(complaint("# nothing\n").contains("no particle"));
    }
}
