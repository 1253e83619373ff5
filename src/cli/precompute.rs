//! `welkin precompute`: the tables of a medium as files, and in the cache.

use serde::Serialize;
use welkin::Result;
use welkin::lut::{Detail, EnergyBalance, ExportAxis, ExportTable, TableParams};
use welkin::output::{Axis, AxisValues, Table, write_tables};
use welkin::params::{Clouds, PHASES, STYLES};

use super::args::PrecomputeArgs;
use super::interrupt::Interrupt;
use super::progress::note;
use super::session::Device;
use super::{Outcome, places, scenes, tables};

/// The medium that the tables belong to, as a scene file writes it.
#[derive(Serialize)]
struct Medium {
    style: &'static str,
    albedo: f32,
    phase: &'static str,
    g_single: f32,
    g_multiple: f32,
    orders: u32,
    energy_balance: Vec<Energy>,
}

/// Where the light that meets a ball goes, as fractions of it.
#[derive(Serialize)]
struct Energy {
    optical_radius: f64,
    transmitted: f64,
    single: f64,
    multiple: f64,
    total: f64,
}

impl Medium {
    fn new(clouds: &Clouds, energy: &[EnergyBalance]) -> Self {
        let style = STYLES.iter().find(|row| row.value == clouds.style).map_or("", |row| row.name);
        let phase = PHASES.iter().find(|row| row.value == clouds.phase).map_or("", |row| row.name);
        let Clouds { albedo, g_single, g_multiple, orders, .. } = *clouds;
        let energy_balance = energy.iter().map(|e| {
            let EnergyBalance { optical_radius, transmitted, single, multiple } = *e;
            Energy { optical_radius, transmitted, single, multiple, total: e.total() }
        });
        Self { style, albedo, phase, g_single, g_multiple, orders, energy_balance: energy_balance.collect() }
    }
}

pub fn run(args: &PrecomputeArgs) -> Result<Outcome> {
    let interrupt = Interrupt::watch()?;
    let params = scenes::load_medium(args.scene.as_deref(), &args.args)?;
    let mut device = Device::open(&args.args, false)?;
    let frames = device.frames();
    let detail = if args.reduced { Detail::Coarse } else { Detail::Full };
    let wanted = TableParams::new(&params.clouds, detail);
    let cache = places::cache(args.args.cache.as_deref())?;
    let made = tables::make(frames, &wanted, &cache, &|| interrupt.signal().is_some())?;
    let Some(made) = made else {
        note(
            "stopped: no table is written; the cache keeps those that were finished, and the next run makes the others",
        );
        return Ok(interrupt.signal().map_or(Outcome::Failed, Outcome::Stopped));
    };
    let files: Vec<Table> = made.export(frames)?.into_iter().map(table).collect();
    write_tables(&args.out, &Medium::new(&params.clouds, &made.energy()), &files)?;
    note(&format!("wrote {}", args.out.join("tables.json").display()));
    Ok(Outcome::Done)
}

fn table(from: ExportTable) -> Table {
    Table {
        name: from.name.into(),
        quantity: from.quantity.into(),
        unit: from.unit.into(),
        axes: from.axes.into_iter().map(axis).collect(),
        components: Vec::new(),
        values: from.values,
    }
}

fn axis(from: ExportAxis) -> Axis {
    let mut values = from.values;
    let values = match values.len() {
        1 => AxisValues::Fixed(values.remove(0)),
        _ => AxisValues::Per { per: "optical_radius".into(), values },
    };
    Axis { name: from.name.into(), meaning: from.meaning.into(), unit: from.unit.into(), values }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axis_with_one_list_is_fixed() {
        let from = |values| ExportAxis { name: "mu", meaning: "m", unit: "1", values };
        assert_eq!(axis(from(vec![vec![1.0, 2.0]])).values, AxisValues::Fixed(vec![1.0, 2.0]));
        assert!(
            matches!(axis(from(vec![vec![1.0], vec![2.0]])).values, AxisValues::Per { per, .. } if per == "optical_radius")
        );
    }
}
