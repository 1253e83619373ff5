//! `welkin voxelize`: a scene's extinction on a grid, for other renderers.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use serde::Serialize;
use welkin::output::{NpyVolume, VdbGrid, VdbWriter, write_json};
use welkin::params::{PHASES, Params};
use welkin::voxelize::{Brick, Gathered, Order, VoxelGrid, Voxelizer};
use welkin::{Error, Result};

use super::args::{Bounds, VoxelizeArgs};
use super::interrupt::Interrupt;
use super::progress::{Progress, note};
use super::session::Device;
use super::{Outcome, places, scenes};

/// How far around the camera the grid of particles is taken without `--bounds` [m].
const REACH: f64 = 5000.0;

/// What stands beside the volume.
#[derive(Serialize)]
struct Sidecar {
    file: String,
    scene: String,
    quantity: &'static str,
    unit: &'static str,
    /// Of the array in a `.npy`, slowest first.
    axes: [&'static str; 3],
    shape: [u32; 3],
    /// Least corner of the first voxel [m].
    corner: [f64; 3],
    /// Greatest corner of the last voxel [m].
    end: [f64; 3],
    voxel_size: f64,
    active_voxels: u64,
    maximum: f64,
    /// ∫ σ_t dV [m²].
    integral: f64,
    medium: Medium,
    sun: SunSide,
    camera: CameraSide,
}

#[derive(Serialize)]
struct Medium {
    albedo: f32,
    phase: &'static str,
    g_single: f32,
    g_multiple: f32,
}

#[derive(Serialize)]
struct SunSide {
    to_sun: [f64; 3],
    irradiance: [f32; 3],
    angular_radius_degrees: f32,
}

#[derive(Serialize)]
struct CameraSide {
    position: [f64; 3],
    right: [f64; 3],
    up: [f64; 3],
    forward: [f64; 3],
    fov_y_degrees: f64,
}

/// The two kinds of file.
enum Volume {
    Npy(NpyVolume),
    Vdb(Box<VdbWriter>),
}

/// Sums over all voxels.
#[derive(Default)]
struct Sums {
    active: u64,
    maximum: f64,
    total: f64,
}

pub fn run(args: &VoxelizeArgs) -> Result<Outcome> {
    let vdb = is_vdb(&args.output)?;
    let side_file = args.output.with_extension("json");
    [&args.output, &side_file].into_iter().try_for_each(|file| places::writable(file))?;
    let interrupt = Interrupt::watch()?;
    let params = scenes::load_with_quality(&args.scene, args.quality, &args.args)?.at_frame(0);
    let mut device = Device::open(&args.args, false)?;
    let frames = device.frames();
    let gpu = frames.gpu().clone();
    let gathered = Gathered::new(frames, &params)?;
    let grid = place(args, &params, &gathered)?;
    let mut voxelizer = Voxelizer::new(&gpu, &params, gathered, args.samples)?;

    let (mut volume, order) = if vdb {
        (Volume::Vdb(Box::new(VdbWriter::create(&args.output)?)), Order::Tree)
    } else {
        (Volume::Npy(NpyVolume::create(&args.output, grid.size)?), Order::Layers)
    };
    const STEPS: f64 = 1000.0;
    let mut progress = Progress::start("voxelize", STEPS as u64);
    let mut sums = Sums::default();
    let mut sink = |brick: Brick<'_>| {
        sums.add(&brick);
        match &mut volume {
            Volume::Npy(volume) => volume.brick(brick.at, brick.sigma_t),
            Volume::Vdb(volume) => volume.leaf(brick.at, brick.sigma_t),
        }
    };
    let mut on_progress = |done| {
        progress.set((done * STEPS) as u64);
        interrupt.signal().map_or(ControlFlow::Continue(()), |_| ControlFlow::Break(()))
    };
    let whole = voxelizer.run(frames, &grid, order, &mut sink, &mut on_progress)?;
    drop(progress);
    if let (false, Some(signal)) = (whole, interrupt.signal()) {
        note(&format!("stopped by {signal}: nothing is written"));
        return Ok(Outcome::Stopped(signal));
    }
    let side = sidecar(args, &params, &grid, &sums);
    match volume {
        Volume::Npy(volume) => volume.finish()?,
        Volume::Vdb(volume) => volume.finish(&VdbGrid {
            name: "density".into(),
            corner: grid.corner,
            voxel: grid.voxel,
            notes: vec![("quantity".into(), side.quantity.into()), ("unit".into(), side.unit.into())],
        })?,
    }
    write_json(&side_file, &side)?;
    let [x, y, z] = grid.size;
    let share = 100.0 * sums.active as f64 / grid.voxels() as f64;
    note(&format!(
        "wrote {} ({x}x{y}x{z} voxels of {:.4} m, {share:.1} % hold cloud, at most {:.4} 1/m)",
        args.output.display(),
        grid.voxel,
        sums.maximum
    ));
    Ok(Outcome::Done)
}

/// Whether the extension of `path` names OpenVDB; otherwise it is NumPy.
fn is_vdb(path: &Path) -> Result<bool> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
    match extension.as_deref() {
        Some("vdb") => Ok(true),
        Some("npy") => Ok(false),
        _ => Err(Error::file(path, "names no volume format: expected a name that ends in .npy or .vdb")),
    }
}

/// Where the voxels lie: in the box asked for, or around the particles with an empty voxel on every side, so that programs
/// that repeat the last voxel outwards repeat nothing.
fn place(args: &VoxelizeArgs, params: &Params, gathered: &Gathered) -> Result<VoxelGrid> {
    let named = |error| match error {
        Error::InvalidParam { field, value, expected } => Error::invalid(format!("--{field}"), value, expected),
        other => other,
    };
    if let Some(Bounds(bounds)) = args.bounds {
        return VoxelGrid::covering(bounds, args.resolution, 0).map_err(named);
    }
    let camera = params.camera.position;
    let bounds = match gathered.endless {
        false => gathered.bounds(|_| true),
        true => {
            let near = |at: [f64; 3], axis: usize| (at[axis] - camera[axis]).abs() <= REACH;
            let around = gathered.bounds(|at| near(at, 0) && near(at, 2));
            around.map(|[mut least, mut greatest]| {
                for axis in [0, 2] {
                    (least[axis], greatest[axis]) = (camera[axis] - REACH, camera[axis] + REACH);
                }
                [least, greatest]
            })
        }
    };
    let bounds = bounds.ok_or_else(|| {
        let what = if gathered.endless { "5 km of the camera" } else { "the scene" };
        Error::invalid(
            "--bounds",
            "none",
            format!("a box to fill: within {what} there is no particle with any density"),
        )
    })?;
    VoxelGrid::covering(bounds, args.resolution, 1).map_err(named)
}

impl Sums {
    fn add(&mut self, brick: &Brick<'_>) {
        for value in brick.sigma_t.iter().filter(|value| **value > 0.0).map(|&value| f64::from(value)) {
            self.active += 1;
            self.maximum = self.maximum.max(value);
            self.total += value;
        }
    }
}

fn sidecar(args: &VoxelizeArgs, params: &Params, grid: &VoxelGrid, sums: &Sums) -> Sidecar {
    let clouds = &params.clouds;
    let basis = params.camera.basis();
    let name = |path: &PathBuf| path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    Sidecar {
        file: name(&args.output),
        scene: name(&args.scene),
        quantity: "extinction",
        unit: "1/m",
        axes: ["z", "y", "x"],
        shape: [grid.size[2], grid.size[1], grid.size[0]],
        corner: grid.corner,
        end: grid.end(),
        voxel_size: grid.voxel,
        active_voxels: sums.active,
        maximum: sums.maximum,
        integral: sums.total * grid.voxel.powi(3),
        medium: Medium {
            albedo: clouds.albedo,
            phase: PHASES.iter().find(|row| row.value == clouds.phase).map_or("", |row| row.name),
            g_single: clouds.g_single,
            g_multiple: clouds.g_multiple,
        },
        sun: SunSide {
            to_sun: params.sun.to_sun(),
            irradiance: params.sun.irradiance,
            angular_radius_degrees: params.sun.angular_radius,
        },
        camera: CameraSide {
            position: params.camera.position,
            right: basis.right,
            up: basis.up,
            forward: basis.forward,
            fov_y_degrees: params.camera.fov_y,
        },
    }
}
