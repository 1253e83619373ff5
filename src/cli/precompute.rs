//! `welkin precompute`: the tables of a medium as files, and in the cache.

use serde::Serialize;
use welkin::Result;
use welkin::lut::axes::{LEVELS, OpticalDepthShape, ScatteringShape};
use welkin::lut::{Detail, TableParams};
use welkin::output::{Axis, AxisValues, Table, write_tables};
use welkin::params::{Clouds, PHASES, STYLES};
use welkin::reference::scattering::single_scattering_model;

use super::args::PrecomputeArgs;
use super::progress::note;
use super::session::Device;
use super::{places, scenes, tables};

/// The medium that the tables belong to, as a scene file writes it.
#[derive(Serialize)]
struct Medium {
    style: &'static str,
    albedo: f32,
    phase: &'static str,
    g_single: f32,
    g_multiple: f32,
    orders: u32,
}

impl Medium {
    fn new(clouds: &Clouds) -> Self {
        let style = STYLES.iter().find(|row| row.value == clouds.style).map_or("", |row| row.name);
        let phase = PHASES.iter().find(|row| row.value == clouds.phase).map_or("", |row| row.name);
        let Clouds { albedo, g_single, g_multiple, orders, .. } = *clouds;
        Self { style, albedo, phase, g_single, g_multiple, orders }
    }
}

pub fn run(args: &PrecomputeArgs) -> Result<()> {
    let params = scenes::load_medium(args.scene.as_deref(), &args.args)?;
    let mut device = Device::open(&args.args, false)?;
    let frames = device.frames();
    let detail = if args.reduced { Detail::Coarse } else { Detail::Full };
    let wanted = TableParams::new(&params.clouds, detail);
    let made = tables::make(frames, &wanted, &places::cache(args.args.cache.as_deref())?)?;
    let files = [
        optical_depth(made.optical_depth.shape(), &made.read_optical_depth(frames)?),
        scattering(made.scattering.shape(), &made.read_scattering(frames)?),
    ];
    write_tables(&args.out, &Medium::new(&params.clouds), &files)?;
    note(&format!("wrote {}", args.out.join("tables.json").display()));
    Ok(())
}

fn fixed(name: &str, unit: &str, values: impl Iterator<Item = f64>) -> Axis {
    Axis { name: name.into(), unit: unit.into(), values: AxisValues::Fixed(values.collect()) }
}

/// The optical depth table (glsl/lut/optical_depth_lookup.glsl); `texels` as they lie in memory.
fn optical_depth(shape: OpticalDepthShape, texels: &[[f32; 2]]) -> Table {
    let azimuths = |name, n| fixed(name, "rad", (0..n).map(|i| OpticalDepthShape::azimuth(i, n)));
    Table {
        name: "optical_depth".into(),
        quantity: "for the ray that enters the unit ball at (theta_s, phi_s), zenith about +y, in the direction \
                   (theta_v, phi_v), zenith about the way to the centre: mean density along the chord, and distance to \
                   the first matter as a fraction of the chord, 1 where there is none"
            .into(),
        unit: "1".into(),
        axes: vec![
            azimuths("phi_v", shape.phi_v),
            fixed("theta_v", "rad", (0..shape.theta).map(|i| shape.theta_v(i))),
            fixed("theta_s", "rad", (0..shape.theta).map(|i| shape.theta_s(i))),
            azimuths("phi_s", shape.phi_s),
        ],
        components: vec!["mean_density".into(), "first_matter".into()],
        values: texels.as_flattened().to_vec(),
    }
}

/// The scattering tables (glsl/lut/scattering_lookup.glsl); `texels` as they lie in memory. There the table holds what the
/// closed-form model of single scattering leaves over; here the two are added up.
fn scattering(shape: ScatteringShape, texels: &[[f32; 2]]) -> Table {
    let radii: Vec<f64> = (0..LEVELS).map(ScatteringShape::optical_radius).collect();
    let mu = radii.iter().map(|&r| (0..shape.mu).map(|k| shape.coordinates([0, 0, k], r).mu).collect()).collect();
    let mut values = Vec::with_capacity(2 * texels.len());
    for (index, [rest, multiple]) in texels.iter().enumerate() {
        let (level, texel) = (index / shape.level_len(), index % shape.level_len());
        let (row, theta) = (texel as u32 / shape.theta, texel as u32 % shape.theta);
        let ray = shape.coordinates([theta, row % shape.psi, row / shape.psi], radii[level]).ray();
        let single = single_scattering_model(&ray, radii[level]) as f32 + rest;
        values.extend([single.max(0.0), *multiple]);
    }
    Table {
        name: "scattering".into(),
        quantity:
            "of the homogeneous ball in a parallel beam of unit irradiance, mean source function along the ray: of \
                   single scattering without the phase function, and of multiple scattering [1/sr]; times \
                   1 - exp(-2 optical_radius mu) it is the ray's radiance"
                .into(),
        unit: "1".into(),
        axes: vec![
            fixed("optical_radius", "1", radii.iter().copied()),
            Axis {
                name: "mu".into(),
                unit: "1".into(),
                values: AxisValues::Per { per: "optical_radius".into(), values: mu },
            },
            fixed("psi", "rad", (0..shape.psi).map(|j| shape.coordinates([0, j, 0], 1.0).psi)),
            fixed("theta", "rad", (0..shape.theta).map(|i| shape.coordinates([i, 0, 0], 1.0).theta)),
        ],
        components: vec!["single".into(), "multiple".into()],
        values,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_and_values_agree_in_number() {
        let shape = OpticalDepthShape::COARSE;
        let texels = shape.image_extent().iter().product::<u32>() as usize;
        let table = optical_depth(shape, &vec![[0.5, 0.25]; texels]);
        let directory = tempfile::tempdir().unwrap();
        let shape = ScatteringShape::COARSE;
        let both = [table, scattering(shape, &vec![[0.0, 0.1]; shape.level_len() * LEVELS as usize])];
        write_tables(directory.path(), &Medium::new(&Clouds::default()), &both).unwrap();
    }

    /// Along the rim nothing is in the way: the mean source function of single scattering is 1.
    #[test]
    fn the_model_is_added_to_the_rest() {
        let shape = ScatteringShape::COARSE;
        let table = scattering(shape, &vec![[0.25, 0.5]; shape.level_len() * LEVELS as usize]);
        assert_eq!(table.values[..2], [1.25, 0.5]);
    }
}
