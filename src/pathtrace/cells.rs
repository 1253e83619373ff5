//! The grid that paths are traced through, built on the device from the renderer's particles (`glsl/pathtrace/cells.glsl`).

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use crate::Result;
use crate::compact::Scan;
use crate::gpu::{Buffer, BufferKind, ComputePipeline, Frames, Gpu};
use crate::shaders::{
    pathtrace_bounds_comp as bounds, pathtrace_count_comp as count, pathtrace_fill_comp as fill,
    pathtrace_order_comp as order, pathtrace_split_comp as split, pathtrace_sunny_comp as sunny,
    pathtrace_top_comp as top,
};
use crate::shared::assert_layout;

/// Top cells wanted at least and at most. Twice as many may come of it: a group of a dispatch each.
const TOP_CELLS: [f64; 2] = [64.0, 30_000.0];
/// Cells at most: 16 bytes each, and a dispatch of 64 to a group.
const MOST_CELLS: u32 = 4_000_000;
/// Entries of all lists at most: 8 bytes each.
const MOST_ENTRIES: u32 = 12_000_000;
/// Groups along a side of a dispatch that every device takes.
const MOST_GROUPS: u32 = 65_535;
/// Edge of a cell in particle radii to begin with. Finer cells have tighter majorants, but more walls to cross.
const FINENESS: f32 = 0.33;

/// The grid's geometry.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct CellParams {
    least: [f32; 3],
    top_edge: f32,
    greatest: [f32; 3],
    slack: f32,
    top: [u32; 3],
    particles: u32,
    sigma_t: f32,
    fineness: f32,
    reserved: [u32; 2],
}
assert_layout!(CellParams, cell_params, {
    least: LEAST, top_edge: TOP_EDGE, greatest: GREATEST, slack: SLACK, top: TOP_X, particles: PARTICLES,
    sigma_t: SIGMA_T, fineness: FINENESS, reserved: RESERVED_A,
});

/// How large the grid has become.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CellCounts {
    /// Particles that it holds.
    pub particles: u32,
    /// Cells of the coarse level.
    pub top_cells: u32,
    /// Cells of the fine level.
    pub cells: u32,
    /// Entries of all their lists.
    pub entries: u32,
}

/// Cells with majorants and lists of particles.
pub struct CellGrid {
    pub(super) params: Buffer,
    pub(super) cell_counts: Buffer,
    pub(super) cell_first: Buffer,
    pub(super) cells: Buffer,
    pub(super) entries: Buffer,
    counts: CellCounts,
}

/// What `bounds.comp` writes, as integers that order as the floats do.
fn unordered(bits: u32) -> f32 {
    f32::from_bits(if bits >> 31 == 1 { bits & 0x7fff_ffff } else { !bits })
}

impl CellGrid {
    /// Builds the grid over the first `particles` of a list, for a sun in direction `to_sun`. Waits for the device a few times; afterwards the lists that
    /// it needed only for itself are gone, so the caller has to let [`RecorderState::forget`] follow.
    ///
    /// [`RecorderState::forget`]: crate::gpu::RecorderState::forget
    pub fn build(frames: &mut Frames, list: &Buffer, particles: u32, sigma_t: f32, to_sun: [f32; 3]) -> Result<Self> {
        let gpu = &frames.gpu().clone();
        let mut params = geometry(find_bounds(frames, list, particles)?, particles, sigma_t);
        let top_cells: u32 = params.top.iter().product();
        let threads = [particles, 1, 1];
        // A group of 64 a particle.
        let rows = particles.div_ceil(MOST_GROUPS).max(1);
        let group_threads = [64 * particles.div_ceil(rows), rows, 1];
        let top_threads = [top_cells, 1, 1];
        let least_radius = Buffer::array::<u32>(gpu, "least radius", top_cells as usize)?;
        let cell_counts = Buffer::array::<u32>(gpu, "cell counts", top_cells as usize)?;
        let cell_first = Buffer::array::<u32>(gpu, "cell first", top_cells as usize)?;
        let total = Buffer::array::<u32>(gpu, "cell total", 1)?;
        let read_total = Buffer::new(gpu, "cell total readback", 4, BufferKind::Readback)?;
        let top_scan = Scan::new(gpu, top_cells)?;
        let (top_pipeline, split_pipeline) = (pipeline(gpu, &top::PROGRAM)?, pipeline(gpu, &split::PROGRAM)?);
        let (count_pipeline, fill_pipeline) = (pipeline(gpu, &count::PROGRAM)?, pipeline(gpu, &fill::PROGRAM)?);
        let (order_pipeline, sunny_pipeline) = (pipeline(gpu, &order::PROGRAM)?, pipeline(gpu, &sunny::PROGRAM)?);
        loop {
            let params_buffer = Buffer::upload(gpu, "cell params", &[params])?;
            frames.run(|rec| {
                rec.pass("cells: top", |rec| {
                    rec.fill_buffer(&least_radius, 0, least_radius.size(), u32::MAX);
                    let bindings =
                        top::Bindings { params: &params_buffer, particles: list, least_radius: &least_radius };
                    rec.dispatch(&top_pipeline, &bindings, &(), threads)?;
                    let bindings = split::Bindings {
                        params: &params_buffer,
                        least_radius: &least_radius,
                        cell_counts: &cell_counts,
                    };
                    rec.dispatch(&split_pipeline, &bindings, &(), top_threads)?;
                    top_scan.record(rec, &cell_counts, top_cells, &cell_first, &total)?;
                    rec.copy_buffer(&total, &read_total, 4);
                    rec.make_visible_to_host(&read_total);
                    Ok(())
                })
            })?;
            let cells = read_total.read::<u32>(0, 1)[0];
            if cells > MOST_CELLS {
                params.fineness *= 1.26;
                continue;
            }
            let entry_counts = Buffer::array::<u32>(gpu, "entry counts", cells as usize)?;
            let entry_first = Buffer::array::<u32>(gpu, "entry first", cells as usize)?;
            let scan = Scan::new(gpu, cells.max(1))?;
            frames.run(|rec| {
                rec.pass("cells: count", |rec| {
                    rec.fill_buffer(&entry_counts, 0, entry_counts.size(), 0);
                    let bindings = count::Bindings {
                        params: &params_buffer,
                        particles: list,
                        cell_counts: &cell_counts,
                        cell_first: &cell_first,
                        entry_counts: &entry_counts,
                    };
                    rec.dispatch(&count_pipeline, &bindings, &(), group_threads)?;
                    scan.record(rec, &entry_counts, cells.max(1), &entry_first, &total)?;
                    rec.copy_buffer(&total, &read_total, 4);
                    rec.make_visible_to_host(&read_total);
                    Ok(())
                })
            })?;
            let entries = read_total.read::<u32>(0, 1)[0];
            // Coarser cells are of no more use when every top cell is one already.
            if entries > MOST_ENTRIES && cells > top_cells {
                params.fineness *= 1.26;
                continue;
            }
            let list_entries = Buffer::array::<[u32; 2]>(gpu, "cell entries", entries as usize)?;
            let cell_list = Buffer::array::<[u32; 4]>(gpu, "cells", cells as usize)?;
            frames.run(|rec| {
                rec.pass("cells: fill", |rec| {
                    let bindings = fill::Bindings {
                        params: &params_buffer,
                        particles: list,
                        cell_counts: &cell_counts,
                        cell_first: &cell_first,
                        entry_counts: &entry_counts,
                        entry_first: &entry_first,
                        entries: &list_entries,
                    };
                    rec.dispatch(&fill_pipeline, &bindings, &[cells, entries], group_threads)?;
                    let bindings = order::Bindings {
                        params: &params_buffer,
                        particles: list,
                        entry_first: &entry_first,
                        entries: &list_entries,
                        cells: &cell_list,
                    };
                    rec.dispatch(&order_pipeline, &bindings, &[cells, entries], [cells, 1, 1])?;
                    let bindings = sunny::Bindings {
                        grid: &params_buffer,
                        cell_counts: &cell_counts,
                        cell_first: &cell_first,
                        cells: &cell_list,
                    };
                    let push = [to_sun[0], to_sun[1], to_sun[2], 0.0];
                    rec.dispatch(&sunny_pipeline, &bindings, &push, [64 * top_cells, 1, 1])
                })
            })?;
            return Ok(Self {
                params: params_buffer,
                cell_counts,
                cell_first,
                cells: cell_list,
                entries: list_entries,
                counts: CellCounts { particles, top_cells, cells, entries },
            });
        }
    }

    /// How large it is.
    #[must_use]
    pub fn counts(&self) -> CellCounts {
        self.counts
    }
}

fn pipeline(gpu: &Arc<Gpu>, program: &'static crate::gpu::Program) -> Result<ComputePipeline> {
    ComputePipeline::new(gpu, program, &[])
}

/// Box around all particles with any extinction, relative to the floating origin; none if there is none.
fn find_bounds(frames: &mut Frames, list: &Buffer, particles: u32) -> Result<Option<[[f32; 3]; 2]>> {
    let gpu = &frames.gpu().clone();
    let found = Buffer::array::<u32>(gpu, "bounds", 6)?;
    let read = Buffer::new(gpu, "bounds readback", 24, BufferKind::Readback)?;
    let pipeline = pipeline(gpu, &bounds::PROGRAM)?;
    frames.run(|rec| {
        rec.pass("cells: bounds", |rec| {
            rec.fill_buffer(&found, 0, 12, u32::MAX);
            rec.fill_buffer(&found, 12, 12, 0);
            let bindings = bounds::Bindings { particles: list, bounds: &found };
            rec.dispatch(&pipeline, &bindings, &particles, [particles, 1, 1])?;
            rec.copy_buffer(&found, &read, 24);
            rec.make_visible_to_host(&read);
            Ok(())
        })
    })?;
    let words = read.read::<u32>(0, 6);
    if words[0] == u32::MAX {
        return Ok(None);
    }
    Ok(Some([0, 3].map(|at| std::array::from_fn(|axis| unordered(words[at + axis])))))
}

/// Nearly cubic top cells over the bounds, about two for each particle.
fn geometry(bounds: Option<[[f32; 3]; 2]>, particles: u32, sigma_t: f32) -> CellParams {
    let mut params = CellParams { particles, sigma_t, fineness: FINENESS, top: [1; 3], ..CellParams::zeroed() };
    // Nothing to meet: a grid of no size, which every ray misses.
    let Some([least, greatest]) = bounds else { return CellParams { top_edge: 1.0, ..params } };
    let size: [f64; 3] = std::array::from_fn(|i| f64::from(greatest[i]) - f64::from(least[i]));
    let longest = size.iter().fold(0.0, |a: f64, &b| a.max(b));
    // A few times the rounding of positions this far apart, or a thousandth of the smallest thing there might be.
    let far = least.iter().chain(&greatest).fold(0.0f32, |a, b| a.max(b.abs()));
    params.slack = (f64::from(far) * 4.0e-6).max(longest * 1.0e-6).max(1.0e-4) as f32;
    let wanted = (2.0 * f64::from(particles)).clamp(TOP_CELLS[0], TOP_CELLS[1]);
    let mut edge = (size.iter().product::<f64>() / wanted).cbrt().max(longest / 1024.0);
    loop {
        params.top = size.map(|side| ((side + 4.0 * f64::from(params.slack)) / edge).ceil().max(1.0) as u32);
        if params.top.iter().map(|&n| f64::from(n)).product::<f64>() <= 2.0 * TOP_CELLS[1] {
            break;
        }
        edge *= 1.1;
    }
    params.top_edge = edge as f32;
    params.least = least.map(|x| x - 2.0 * params.slack);
    params.greatest = std::array::from_fn(|i| params.least[i] + params.top[i] as f32 * params.top_edge);
    params
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn top_cells_cover_the_bounds_and_are_nearly_cubic_in_number() {
        for (least, greatest, particles) in [
            ([-1e5, 2000.0, -1e5], [1e5, 4000.0, 1e5], 100_000),
            ([-10.0, -10.0, -10.0], [10.0, 10.0, 10.0], 1),
            ([0.0, 0.0, 0.0], [1e4, 1.0, 1.0], 1000),
        ] {
            let params = geometry(Some([least, greatest]), particles, 0.07);
            for i in 0..3 {
                assert!(params.least[i] < least[i] && params.greatest[i] > greatest[i], "{params:?}");
                let last = f64::from(params.greatest[i]) - f64::from(greatest[i]);
                assert!(last <= 1.01 * f64::from(params.top_edge) + 1.0, "{params:?}");
            }
            let cells: u32 = params.top.iter().product();
            assert!((60..=2 * 30_000).contains(&cells), "{params:?}");
        }
    }

    #[test]
    fn ordered_bits_come_back_as_the_floats_they_were() {
        let ordered = |x: f32| if x.to_bits() >> 31 == 0 { x.to_bits() | 0x8000_0000 } else { !x.to_bits() };
        for x in [0.0f32, 1.5, -1.5, 1e30, -1e30] {
            assert_eq!(unordered(ordered(x)), x);
        }
        assert!(ordered(-2.0) < ordered(-1.0) && ordered(-1.0) < ordered(0.5));
    }
}
