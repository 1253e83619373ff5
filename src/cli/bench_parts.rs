//! `welkin bench` without a scene: parts of the renderer by themselves, whose speed others have published too.

use std::fmt::Write;
use std::ops::ControlFlow;
use std::time::Instant;

use serde::Serialize;
use welkin::compact::Sort;
use welkin::gpu::{Buffer, BufferKind, Frames};
use welkin::lut::axes::{OpticalDepthShape, ScatteringShape};
use welkin::lut::{Detail, OpticalDepthTable, ScatteringTable, TableParams};
use welkin::output::DeviceStats;
use welkin::params::Params;
use welkin::{Error, Result};

use super::args::{BenchArgs, ColdTables};
use super::session::Device;
use super::summary::{median, p95};

#[derive(Serialize)]
struct Report {
    device: DeviceStats,
    warmup_runs: u32,
    measured_runs: u32,
    sort: Vec<Sorted>,
    tables: Option<Made>,
}

/// A list that was sorted, and found to be in order.
#[derive(Serialize)]
struct Sorted {
    pairs: u32,
    median_ms: f64,
    p95_ms: f64,
    /// By the median.
    pairs_per_second: f64,
}

/// Tables made from nothing, and once more in the same process.
#[derive(Serialize)]
struct Made {
    size: &'static str,
    /// From the call to the table on the device, pipelines and the host's part included [s].
    scattering_seconds: f64,
    scattering_again_seconds: f64,
    /// On the device; none without timestamps.
    optical_depth_ms: Option<f64>,
    optical_depth_again_ms: Option<f64>,
}

pub fn run(args: &BenchArgs) -> Result<()> {
    let mut device = Device::open(&args.picture.scene, false)?;
    let mut report = Report {
        device: device.stats(),
        warmup_runs: args.warmup,
        measured_runs: args.measure,
        sort: Vec::new(),
        tables: None,
    };
    for &pairs in &args.sort {
        report.sort.push(sort(&mut device, pairs, args)?);
    }
    if let Some(size) = args.cold_tables {
        report.tables = Some(tables(device.frames(), size)?);
    }
    if args.json { super::print_json(&report) } else { super::print(&text(&report)) }
}

/// Sorts `pairs` random keys with their indices as often as the flags say, and looks at the last result.
fn sort(device: &mut Device, pairs: u32, args: &BenchArgs) -> Result<Sorted> {
    let name = device.stats().name;
    let frames = device.frames();
    let gpu = frames.gpu().clone();
    let random: Vec<u32> = (0..pairs).map(welkin::reference::density::pcg).collect();
    let count = pairs as usize;
    let bytes = u64::from(pairs) * 4;
    let (all_keys, all_indices) = (
        Buffer::upload(&gpu, "random keys", &random)?,
        Buffer::upload(&gpu, "random indices", &(0..pairs).collect::<Vec<u32>>())?,
    );
    let keys = Buffer::array::<u32>(&gpu, "keys", count)?;
    let indices = Buffer::array::<u32>(&gpu, "indices", count)?;
    let length = Buffer::upload(&gpu, "length", &[pairs])?;
    let groups = Buffer::upload(&gpu, "groups", &[pairs.div_ceil(1024), 1, 1])?;
    let sort = Sort::new(&gpu, pairs)?;
    let mut times = Vec::new();
    for turn in 0..args.warmup + args.measure {
        let (slot, ()) = frames.submit(|rec| {
            rec.pass("fill", |rec| {
                rec.copy_buffer(&all_keys, &keys, bytes);
                rec.copy_buffer(&all_indices, &indices, bytes);
                Ok(())
            })?;
            rec.pass("sort", |rec| sort.record(rec, (&length, 0), (&groups, 0), &keys, &indices))
        })?;
        frames.wait()?;
        if turn >= args.warmup {
            times.push(time_of(frames, slot, "sort").ok_or_else(|| Error::Unsupported {
                needed: "measuring: timestamp queries".into(),
                by: name.clone(),
            })?);
        }
    }
    let mut expected: Vec<u32> = (0..pairs).collect();
    expected.sort_by_key(|&index| random[index as usize]);
    if read(frames, &indices, count)? != expected {
        let expected = "the order of a stable sort: this device sorts wrongly, see `welkin conform`";
        return Err(Error::invalid("--sort", pairs, expected));
    }
    let median_ms = median(&times).unwrap_or(0.0);
    Ok(Sorted {
        pairs,
        median_ms,
        p95_ms: p95(&times).unwrap_or(0.0),
        pairs_per_second: f64::from(pairs) / (median_ms.max(1e-9) * 1e-3),
    })
}

fn read(frames: &mut Frames, buffer: &Buffer, count: usize) -> Result<Vec<u32>> {
    let bytes = count as u64 * 4;
    let readback = Buffer::new(frames.gpu(), "sorted", bytes, BufferKind::Readback)?;
    frames.run(|rec| {
        rec.copy_buffer(buffer, &readback, bytes);
        rec.make_visible_to_host(&readback);
        Ok(())
    })?;
    Ok(readback.read(0, count))
}

/// Time of a pass of the frame that has ended in `slot` [ms].
fn time_of(frames: &mut Frames, slot: usize, pass: &str) -> Option<f64> {
    frames.state().times(slot).into_iter().find(|time| time.name == pass).map(|time| time.gpu_ms)
}

/// Makes the tables of the default medium without a cache, each twice.
fn tables(frames: &mut Frames, size: ColdTables) -> Result<Made> {
    let (detail, size, depth_shape, scattering_shape, resolution) = match size {
        ColdTables::Full => (Detail::Full, "full", OpticalDepthShape::FULL, ScatteringShape::FULL, 1.0),
        ColdTables::Reduced => (Detail::Coarse, "reduced", OpticalDepthShape::COARSE, ScatteringShape::COARSE, 0.4),
    };
    let params = TableParams::new(&Params::default().clouds, detail);
    let gpu = frames.gpu().clone();
    let mut seconds = [0.0; 2];
    for time in &mut seconds {
        let started = Instant::now();
        let table = ScatteringTable::new(&gpu, scattering_shape)?;
        table.build(frames, &params.medium, params.orders, resolution, &mut |_| ControlFlow::Continue(()))?;
        *time = started.elapsed().as_secs_f64();
    }
    let table = OpticalDepthTable::new(&gpu, depth_shape)?;
    let mut depth = [None; 2];
    for time in &mut depth {
        let (slot, ()) = frames.submit(|rec| table.record(rec, params.style))?;
        frames.wait()?;
        *time = time_of(frames, slot, "optical depth table");
    }
    let ([scattering_seconds, scattering_again_seconds], [optical_depth_ms, optical_depth_again_ms]) = (seconds, depth);
    Ok(Made { size, scattering_seconds, scattering_again_seconds, optical_depth_ms, optical_depth_again_ms })
}

fn text(report: &Report) -> String {
    let mut text = format!("{}\n", report.device.name);
    // Writing to a string cannot fail.
    for Sorted { pairs, median_ms, p95_ms, pairs_per_second } in &report.sort {
        let rate = pairs_per_second * 1e-6;
        let _ = writeln!(text, "sort of {pairs} pairs: {median_ms:.4} ms, p95 {p95_ms:.4} ms, {rate:.1} million/s");
    }
    if let Some(made) = &report.tables {
        let ms = |time: Option<f64>| time.map_or("-".into(), |ms| format!("{ms:.3} ms"));
        let _ = writeln!(text, "{} tables of the default medium", made.size);
        let _ = writeln!(
            text,
            "  scattering {:.3} s, again {:.3} s",
            made.scattering_seconds, made.scattering_again_seconds
        );
        let (first, again) = (ms(made.optical_depth_ms), ms(made.optical_depth_again_ms));
        let _ = writeln!(text, "  optical depth on the device {first}, again {again}");
    }
    text
}
