//! The command line: what can be said, in one place.

use std::ops::Range;
use std::path::{Path, PathBuf};

use clap::{Args, Parser, Subcommand, ValueEnum};
use welkin::output::{ExrCompression, ExrOptions, ExrType};
use welkin::params::Blend;

/// Cumulus skies in Vulkan: a scene file goes in, a picture comes out.
///
/// Exit status: 0 done, 1 a comparison or check failed, 2 error, 130 stopped by Ctrl-C, 143 by SIGTERM.
#[derive(Parser, Debug)]
#[command(name = "welkin", version, max_term_width = 120)]
pub struct Cli {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Subcommand, Debug)]
pub enum Command {
    /// List every Vulkan device and, per compositing mode, whether it can be used or why not
    Devices(DevicesArgs),
    /// Render scenes to pictures
    Render(RenderArgs),
    /// Compute the full tables of a scene's cloud medium: into the cache, and as .npy files with a JSON file naming each axis
    Precompute(PrecomputeArgs),
    /// Write the extinction of a scene's clouds on a grid of voxels, for other renderers (docs/outside-renderers.md)
    Voxelize(VoxelizeArgs),
    /// Make a field of cumulus out of particles: a CSV file for scenes with `clouds.source = "particles"`
    Scatter(ScatterArgs),
    /// Path trace a scene: the unbiased truth of what `render` approximates
    Reference(ReferenceArgs),
    /// Measure the GPU time of each pass: median and 95th percentile
    Bench(BenchArgs),
    /// Compare two compositing modes with a reference: pictures, heat maps, metrics, and a report to look at
    Ab(AbArgs),
    /// Measure how far lighting and compositing are from path-traced truth, over a suite of scenes
    Accuracy(AccuracyArgs),
    /// Try what a driver must do for Welkin, check by check; exit status 1 if a check fails
    Conform(ConformArgs),
    /// Measure everything about a device within minutes: what scripts/gpu-check starts (docs/performance)
    GpuCheck(GpuCheckArgs),
    /// Unpack a Vulkan driver for the CPU, without root, on a system with apt (docs/drivers.md)
    Setup(SetupArgs),
    /// Print the manual page, or write one for each command
    Man(ManArgs),
    /// Print completions for a shell
    Completions(CompletionsArgs),
}

#[derive(Args, Debug)]
pub struct SetupArgs {
    /// Directory to unpack into; made if need be [default: welkin in the user's data directory]
    ///
    /// Another than the default is found by naming it in WELKIN_PREFIX_DIR.
    #[arg(long, value_name = "DIR")]
    pub dir: Option<PathBuf>,
}

#[derive(Args, Debug)]
pub struct ManArgs {
    /// Directory for welkin.1 and a page for each command; made if need be
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

#[derive(Args, Debug)]
pub struct CompletionsArgs {
    /// Whose
    #[arg(value_name = "SHELL")]
    pub shell: clap_complete::Shell,
}

#[derive(Args, Debug)]
pub struct DevicesArgs {
    /// Print JSON (docs/json.md)
    #[arg(long)]
    pub json: bool,
    /// Also print every pipeline of a frame as it would be built on the default device
    #[arg(long)]
    pub pipelines: bool,
}

/// What picture, on what device: shared by the commands that render.
#[derive(Args, Clone, Debug)]
pub struct PictureArgs {
    /// Size of the picture [pixels]
    #[arg(long, value_name = "WxH", default_value = "1280x720", value_parser = parse_size)]
    pub size: Size,
    /// Preset of the particle grid; keys of the scene's [quality] still count
    #[arg(long, value_enum)]
    pub quality: Option<QualityArg>,
    /// Which tables to light particles from
    #[arg(long, value_enum, default_value_t)]
    pub tables: TablesArg,
    #[command(flatten)]
    pub scene: SceneArgs,
}

#[derive(ValueEnum, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TablesArg {
    /// Full ones; reduced ones for the low preset while there are no full ones in the cache
    #[default]
    Auto,
    /// Full ones, which take longer to make the first time
    Full,
    /// Reduced ones, made in a few seconds
    Reduced,
    /// Reduced ones at once, and the full ones from the frame on by which they have been made beside the rendering
    Progressive,
}

/// Where a scene's values, device and tables come from.
#[derive(Args, Clone, Debug)]
pub struct SceneArgs {
    /// Replace a value of the scene file, for example clouds.coverage=0.3; can be given again
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Device by part of its name or by its index in `welkin devices`
    #[arg(long, value_name = "NAME|INDEX")]
    pub device: Option<String>,
    /// Where tables are kept between runs [default: $WELKIN_CACHE, or welkin in the user's cache directory]
    #[arg(long, value_name = "DIR")]
    pub cache: Option<PathBuf>,
}

#[derive(Args, Debug)]
pub struct RenderArgs {
    /// Scene files
    #[arg(required = true, value_name = "SCENE.toml")]
    pub scenes: Vec<PathBuf>,
    /// Picture file, or a directory for pictures named after their scenes [default: SCENE.png in the current directory]
    ///
    /// .png holds the toned picture; .exr and .npy hold linear scene radiance, height x width x 3.
    #[arg(short, long, value_name = "OUT.{png,exr,npy}")]
    pub output: Option<PathBuf>,
    /// How overlapping particles are composited: auto, interlock[:K], attachment[:K], list, tiled, alpha; docs/blending.md compares them
    #[arg(long, value_name = "MODE[:K]", value_parser = parse_blend)]
    pub blend: Option<Blend>,
    #[command(flatten)]
    pub picture: PictureArgs,
    /// Render frames A to B-1 of the scene's [animation] to OUT.0000.png, OUT.0001.png, ...
    #[arg(long, value_name = "A..B", value_parser = parse_frames)]
    pub frames: Option<FrameRange>,
    /// Write statistics as JSON (docs/json.md), to standard output if no file is named; with several scenes, a list
    ///
    /// Validation is on while statistics are taken, where the layer is installed.
    #[arg(long, value_name = "FILE.json", num_args = 0..=1, default_missing_value = "-", value_parser = parse_stats)]
    pub stats: Option<PathBuf>,
    /// Write the clouds' transmittance beside the picture, as OUT.transmittance.npy, and as a layer of an EXR
    #[arg(long)]
    pub aux: bool,
    /// Write PNG with 16 bits a channel
    #[arg(long)]
    pub png16: bool,
    /// Compression of EXR
    #[arg(long, value_enum, value_name = "METHOD", default_value_t)]
    pub exr_compression: ExrCompressionArg,
    /// Type of EXR's colour channels; other layers are floats
    #[arg(long, value_enum, value_name = "TYPE", default_value_t)]
    pub exr_type: ExrTypeArg,
    /// Owner that an EXR names
    #[arg(long, value_name = "NAME")]
    pub exr_owner: Option<String>,
}

#[derive(ValueEnum, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ExrCompressionArg {
    /// Deflate, 16 lines at a time
    #[default]
    Zip,
    /// Deflate, line by line
    Zips,
    /// Runs of equal bytes
    Rle,
    /// Wavelets
    Piz,
    /// None
    None,
}

#[derive(ValueEnum, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ExrTypeArg {
    /// 16 bits, up to 65504
    Half,
    /// 32 bits
    #[default]
    Float,
}

impl RenderArgs {
    /// How EXRs of `scene` are written.
    pub fn exr_options(&self, scene: &Path) -> ExrOptions {
        let words = [scene.display().to_string()].into_iter().chain(self.picture.scene.set.iter().cloned());
        ExrOptions {
            compression: match self.exr_compression {
                ExrCompressionArg::Zip => ExrCompression::Zip,
                ExrCompressionArg::Zips => ExrCompression::Zips,
                ExrCompressionArg::Rle => ExrCompression::Rle,
                ExrCompressionArg::Piz => ExrCompression::Piz,
                ExrCompressionArg::None => ExrCompression::None,
            },
            colour: match self.exr_type {
                ExrTypeArg::Half => ExrType::Half,
                ExrTypeArg::Float => ExrType::Float,
            },
            owner: self.exr_owner.clone(),
            scene: Some(words.collect::<Vec<_>>().join(" ")),
            aux: self.aux,
        }
    }
}

#[derive(Args, Debug)]
pub struct PrecomputeArgs {
    /// Scene file whose medium is meant [default: the default medium]
    #[arg(value_name = "SCENE.toml")]
    pub scene: Option<PathBuf>,
    /// Directory for the tables; made if need be
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Make reduced tables, as a first picture uses
    #[arg(long)]
    pub reduced: bool,
    #[command(flatten)]
    pub args: SceneArgs,
}

#[derive(Args, Debug)]
pub struct VoxelizeArgs {
    /// Scene file
    #[arg(value_name = "SCENE.toml")]
    pub scene: PathBuf,
    /// Volume file: .npy holds a dense array of shape (z, y, x), .vdb a sparse OpenVDB grid named density [1/m]
    ///
    /// A file of the same name that ends in .json says where the voxels lie, what the medium is and where the scene's
    /// camera and sun stand (docs/json.md).
    #[arg(short, long, value_name = "OUT.{npy,vdb}")]
    pub output: PathBuf,
    /// Voxels along the longest side
    #[arg(long, value_name = "N", default_value_t = 256)]
    pub resolution: u32,
    /// Box to fill with voxels [m] [default: all particles of a list; of the grid, 5 km around the camera]
    #[arg(long, value_name = "X0,Y0,Z0,X1,Y1,Z1", value_parser = parse_bounds, allow_hyphen_values = true)]
    pub bounds: Option<Bounds>,
    /// Points averaged along each axis of a voxel; more where particles are smaller than voxels
    #[arg(long, value_name = "S", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=16))]
    pub samples: u32,
    /// Preset of the particle grid; keys of the scene's [quality] still count
    #[arg(long, value_enum)]
    pub quality: Option<QualityArg>,
    #[command(flatten)]
    pub args: SceneArgs,
}

#[derive(Args, Debug)]
pub struct ScatterArgs {
    /// CSV file: one particle a line, with the number of its cloud (docs/scene.md)
    #[arg(short, long, value_name = "OUT.csv")]
    pub output: PathBuf,
    /// Clouds
    #[arg(long, value_name = "N", default_value_t = 100)]
    pub clouds: u32,
    /// Particles of all clouds together
    #[arg(long, value_name = "N", default_value_t = 50_000)]
    pub particles: u32,
    /// Another seed is another field
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u32,
    /// Edge of the square that cloud bases lie in, around the origin [m]
    #[arg(long, value_name = "M", default_value_t = 10_000.0)]
    pub extent: f64,
    /// Altitude of the bases [m]
    #[arg(long, value_name = "M", default_value_t = 1500.0)]
    pub base: f64,
    /// Median radius of a cloud at its base [m]
    #[arg(long, value_name = "M", default_value_t = 400.0)]
    pub radius: f64,
    /// Density of the particles, relative to the scene's sigma_t
    #[arg(long, value_name = "D", default_value_t = 0.3)]
    pub density: f64,
}

/// Least and greatest corner of a box [m].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds(pub [[f64; 3]; 2]);

fn parse_bounds(text: &str) -> Result<Bounds, String> {
    let expected = "expected six numbers x0,y0,z0,x1,y1,z1 in metres: the least corner, then the greatest";
    let values: Option<Vec<f64>> = text.split(',').map(|word| word.trim().parse().ok()).collect();
    match values.as_deref() {
        Some(&[x0, y0, z0, x1, y1, z1]) if x0 < x1 && y0 < y1 && z0 < z1 => Ok(Bounds([[x0, y0, z0], [x1, y1, z1]])),
        _ => Err(expected.into()),
    }
}

#[derive(Args, Debug)]
#[command(group = clap::ArgGroup::new("end").required(true).multiple(true).args(["spp", "noise"]))]
pub struct ReferenceArgs {
    /// Scene file
    #[arg(value_name = "SCENE.toml")]
    pub scene: PathBuf,
    /// Picture file
    ///
    /// .png holds the toned picture; .exr and .npy hold linear scene radiance, height x width x 3. The variance of each
    /// value is written beside it as OUT.variance.exr or OUT.variance.npy, and what is needed to go on as OUT.state.
    #[arg(short, long, value_name = "OUT.{png,exr,npy}")]
    pub output: PathBuf,
    /// Samples of each pixel; with --noise, at most so many
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000_000))]
    pub spp: Option<u32>,
    /// Stop when the relative standard error of the clouds' radiance is at most this, for example 0.01
    #[arg(long, value_name = "ERROR", value_parser = parse_noise)]
    pub noise: Option<f64>,
    /// Size of the picture [pixels]
    #[arg(long, value_name = "WxH", default_value = "1280x720", value_parser = parse_size)]
    pub size: Size,
    /// Preset of the particle grid; keys of the scene's [quality] still count
    #[arg(long, value_enum)]
    pub quality: Option<QualityArg>,
    /// Another seed is another picture of the same mean
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u32,
    /// The sun on the clouds: one direction, as the tables have it, or its disc
    #[arg(long, value_enum, default_value_t)]
    pub sun: SunArg,
    /// Spread rays over each pixel instead of sending them through its centre
    #[arg(long)]
    pub antialias: bool,
    /// Go on from a state [default: OUT.state]
    #[arg(long, value_name = "FILE")]
    pub resume: Option<Option<PathBuf>>,
    /// Write the clouds' transmittance beside the picture, as OUT.transmittance.npy
    #[arg(long)]
    pub aux: bool,
    #[command(flatten)]
    pub args: SceneArgs,
}

#[derive(ValueEnum, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SunArg {
    /// One direction
    #[default]
    Direction,
    /// An even disc of the scene's angular radius
    Disc,
}

#[derive(Args, Debug)]
pub struct BenchArgs {
    /// Scene file
    #[arg(value_name = "SCENE.toml", required_unless_present_any = ["sort", "cold_tables"])]
    pub scene: Option<PathBuf>,
    /// Measure the radix sort instead of a scene: so many random pairs of a 32-bit key and an index
    #[arg(long, value_name = "N,...", value_delimiter = ',', conflicts_with_all = ["scene", "vs", "vs_set", "blend"],
          value_parser = clap::value_parser!(u32).range(1..=1 << 26))]
    pub sort: Vec<u32>,
    /// Measure how long the tables of the default medium take to make, without any cache
    #[arg(long, value_name = "SIZE", value_enum, conflicts_with_all = ["scene", "vs", "vs_set", "blend", "sort"])]
    pub cold_tables: Option<ColdTables>,
    /// Print JSON (docs/json.md)
    #[arg(long)]
    pub json: bool,
    /// How overlapping particles are composited: auto, interlock[:K], attachment[:K], list, tiled, alpha; docs/blending.md compares them
    #[arg(long, value_name = "MODE[:K]", value_parser = parse_blend)]
    pub blend: Option<Blend>,
    /// Compare with these modes in the same run, frame by frame in turns; all: with every mode that the device has
    #[arg(long, value_name = "MODE[:K],...|all", value_delimiter = ',', value_parser = parse_versus)]
    pub vs: Vec<Versus>,
    /// Compare with the same scene after replacing this value, in the same way; given again, all of them together
    #[arg(long, value_name = "KEY=VALUE")]
    pub vs_set: Vec<String>,
    /// Compare lighting forward with the same done as Harris has it, one draw and one read-back a particle (docs/lighting.md)
    #[arg(long, conflicts_with_all = ["vs", "vs_set"])]
    pub serial_forward: bool,
    /// Frames measured per mode
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub measure: u32,
    /// Frames rendered before the first measured one
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(0..=100_000))]
    pub warmup: u32,
    #[command(flatten)]
    pub picture: PictureArgs,
}

/// Which tables `bench --cold-tables` makes.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColdTables {
    /// Full ones
    Full,
    /// Reduced ones, as a first picture uses
    Reduced,
}

#[derive(Args, Debug)]
pub struct GpuCheckArgs {
    /// What `scripts/gpu-check prepare` has collected, unpacked
    #[arg(long, value_name = "DIR")]
    pub kit: PathBuf,
    /// Directory for DEVICE.json, DEVICE.md and, in DEVICE/, pictures and what each measurement printed; made if need be
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// How much to measure
    #[arg(long, value_enum, default_value_t)]
    pub scale: ScaleArg,
    /// Time for all steps together [s]; what comes too late is left out [default: 360]
    #[arg(long, value_name = "SECONDS", value_parser = clap::value_parser!(u64).range(1..=86_400))]
    pub budget: Option<u64>,
    /// Where the results of earlier runs lie, to compare with [default: --out]
    #[arg(long, value_name = "DIR")]
    pub previous: Option<PathBuf>,
    /// Device by part of its name or by its index in `welkin devices`
    #[arg(long, value_name = "NAME|INDEX")]
    pub device: Option<String>,
    /// Make what the kit lacks on the driver in use: tables, and the pictures that devices are compared with
    #[arg(long, hide = true)]
    pub fill_kit: bool,
}

/// How much `gpu-check` measures.
#[derive(ValueEnum, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ScaleArg {
    /// What a GPU does in six minutes
    #[default]
    Full,
    /// Small pictures and short lists, for a CPU driver
    Modest,
    /// As little as shows that every step works
    Tiny,
}

#[derive(Args, Debug)]
pub struct ConformArgs {
    /// Print JSON (docs/json.md)
    #[arg(long)]
    pub json: bool,
    /// Device by part of its name or by its index in `welkin devices`
    #[arg(long, value_name = "NAME|INDEX")]
    pub device: Option<String>,
    /// Every device present
    #[arg(long, conflicts_with = "device")]
    pub all: bool,
    /// Only checks whose id matches, `*` standing for any text; can be given again
    #[arg(long, value_name = "GLOB")]
    pub filter: Vec<String>,
    /// Print what would be checked, why, and where it is specified
    #[arg(long)]
    pub list: bool,
    /// Small sizes and few repetitions
    #[arg(long)]
    pub quick: bool,
    /// Take interlock and attachment-access flags away: each check of ordering must show it, and fails if it does not
    ///
    /// For hardware. A software rasterizer keeps a pixel's fragments in order even where nobody asks for it.
    #[arg(long)]
    pub unordered: bool,
    /// How long a check may take before it counts as hanging [s]
    #[arg(long, value_name = "SECONDS", default_value_t = 300, value_parser = clap::value_parser!(u64).range(1..=86_400))]
    pub timeout: u64,
    /// Try the checks in this process, from this row on
    #[arg(long, hide = true, value_name = "ROW")]
    pub worker: Option<usize>,
}

#[derive(Args, Debug)]
pub struct AbArgs {
    /// Scene file
    #[arg(value_name = "SCENE.toml")]
    pub scene: PathBuf,
    /// The mode under test: limits hold for it
    #[arg(long, value_name = "MODE[:K]", value_parser = parse_blend)]
    pub a: Blend,
    /// The mode to compare it with
    #[arg(long, value_name = "MODE[:K]", value_parser = parse_blend)]
    pub b: Blend,
    /// What both are measured against: exact, path, oracle or any mode
    ///
    /// exact is tiled or list, whichever the device has; path is path-traced, and its noise is taken into account; oracle
    /// integrates scenes of homogeneous particles under flat lighting before a black sky in f64.
    #[arg(long, value_name = "exact|path|…", default_value = "exact", value_parser = parse_reference)]
    pub reference: ReferenceArg,
    /// Paths a pixel of --reference path [default: 256]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=1 << 24))]
    pub spp: Option<u32>,
    /// Compare frames A to B-1 of the scene's [animation], and measure popping from each to the next
    #[arg(long, value_name = "A..B", value_parser = parse_frames)]
    pub frames: Option<FrameRange>,
    /// Directory for pictures, metrics.json (docs/json.md) and report.html; made if need be
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// End with status 1 if the RMSE of a is above X
    #[arg(long, value_name = "X", value_parser = parse_limit)]
    pub max_rmse: Option<f64>,
    /// End with status 1 if the mean FLIP of a is above X
    #[arg(long, value_name = "X", value_parser = parse_limit)]
    pub max_flip: Option<f64>,
    /// End with status 1 if the greatest difference of a is above X
    #[arg(long, value_name = "X", value_parser = parse_limit)]
    pub max_abs: Option<f64>,
    /// End with status 1 if the popping of a is above X, or has no value because nothing moves
    #[arg(long, value_name = "X", value_parser = parse_limit)]
    pub max_popping: Option<f64>,
    #[command(flatten)]
    pub picture: PictureArgs,
}

/// What `welkin ab` measures against.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReferenceArg {
    /// An exact mode of the device's.
    Exact,
    /// Path tracing.
    Path,
    /// Integration in f64 on the CPU.
    Oracle,
    /// This mode.
    Mode(Blend),
}

impl std::fmt::Display for ReferenceArg {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Exact => f.write_str("exact"),
            Self::Path => f.write_str("path"),
            Self::Oracle => f.write_str("oracle"),
            Self::Mode(blend) => blend.fmt(f),
        }
    }
}

#[derive(Args, Debug)]
pub struct AccuracyArgs {
    /// Suite file: cases and the variants that are compared on each (scenes/truth/suite.toml)
    #[arg(value_name = "SUITE.toml")]
    pub suite: PathBuf,
    /// Directory for accuracy.json, accuracy.md and a picture for each case; made if need be
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Only this case; can be given again
    #[arg(long, value_name = "CASE")]
    pub only: Vec<String>,
    /// Paths a pixel [default: those of the suite]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=1 << 24))]
    pub spp: Option<u32>,
    #[command(flatten)]
    pub picture: PictureArgs,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum QualityArg {
    /// 4 rings of 104x104 cells, 2 layers
    Low,
    /// 4 rings of 136x136 cells, 4 layers
    Medium,
    /// 4 rings of 184x184 cells, 6 layers
    High,
}

impl QualityArg {
    pub fn name(self) -> &'static str {
        match self {
            Self::Low => "low",
            Self::Medium => "medium",
            Self::High => "high",
        }
    }
}

/// Size of a picture [pixels].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    pub width: u32,
    pub height: u32,
}

const MAX_SIDE: u32 = 16_384;
/// 64 Mi pixels: 8192 × 8192. A pixel takes some 60 bytes of device memory and 28 of the host's, so this is about 6 GB.
const MAX_PIXELS: u64 = 1 << 26;

fn parse_size(text: &str) -> Result<Size, String> {
    let expected = format!(
        "expected WIDTHxHEIGHT, for example 1280x720: each from 1 to {MAX_SIDE}, and at most {MAX_PIXELS} pixels in all"
    );
    let (width, height) = text.split_once(['x', 'X']).ok_or(&expected)?;
    let side = |text: &str| match text.parse::<u32>() {
        Ok(side) if (1..=MAX_SIDE).contains(&side) => Ok(side),
        _ => Err(&expected),
    };
    let size = Size { width: side(width)?, height: side(height)? };
    if u64::from(size.width) * u64::from(size.height) > MAX_PIXELS { Err(expected) } else { Ok(size) }
}

fn parse_noise(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(noise) if noise > 0.0 && noise < 1.0 => Ok(noise),
        _ => Err("expected a relative error above 0 and below 1, for example 0.01".into()),
    }
}

/// A mode to compare with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Versus {
    Mode(Blend),
    All,
}

fn parse_versus(text: &str) -> Result<Versus, String> {
    if text == "all" { Ok(Versus::All) } else { parse_blend(text).map(Versus::Mode) }
}

fn parse_blend(text: &str) -> Result<Blend, String> {
    text.parse().map_err(|error: welkin::Error| match error {
        welkin::Error::InvalidParam { expected, .. } => format!("expected {expected}"),
        other => other.to_string(),
    })
}

fn parse_reference(text: &str) -> Result<ReferenceArg, String> {
    match text {
        "exact" => Ok(ReferenceArg::Exact),
        "path" => Ok(ReferenceArg::Path),
        "oracle" => Ok(ReferenceArg::Oracle),
        mode => parse_blend(mode).map(ReferenceArg::Mode).map_err(|error| format!("{error}, or exact, path, oracle")),
    }
}

fn parse_limit(text: &str) -> Result<f64, String> {
    let limit: Option<f64> = text.parse().ok().filter(|limit: &f64| limit.is_finite() && *limit >= 0.0);
    limit.ok_or_else(|| "expected a number that is not negative".into())
}

/// Frames from the first up to, but not including, the last. (A `Vec` or a bare `Range` would mean something else to clap.)
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrameRange(pub Range<u32>);

fn parse_frames(text: &str) -> Result<FrameRange, String> {
    let expected = "expected A..B with A below B, for example 0..10 for the frames 0 to 9; at most 100000 frames";
    let (from, to) = text.split_once("..").ok_or(expected)?;
    let (from, to) = (from.parse().map_err(|_| expected)?, to.parse().map_err(|_| expected)?);
    if from < to && to - from <= 100_000 { Ok(FrameRange(from..to)) } else { Err(expected.into()) }
}

/// A scene file after `--stats` would silently be overwritten: only `.json` and `-` are taken.
fn parse_stats(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    let json = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
    if json || text == "-" {
        Ok(path)
    } else {
        Err("expected a name that ends in .json, or - for standard output".into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    fn render(line: &str) -> Result<RenderArgs, String> {
        let words = ["welkin", "render"].into_iter().chain(line.split_whitespace());
        match Cli::try_parse_from(words).map_err(|error| error.to_string())?.command {
            Command::Render(args) => Ok(args),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn the_table_of_flags_is_sound() {
        Cli::command().debug_assert();
    }

    #[test]
    fn a_full_line_is_understood() {
        let args = render(
            "sky.toml -o out.png --size 64x32 --quality low --blend interlock:4 --device llvm --frames 3..7 \
             --stats s.json --set a.b=1 --set c=2 --aux --png16 --cache /c --tables full",
        )
        .unwrap();
        assert_eq!(args.picture.size, Size { width: 64, height: 32 });
        assert_eq!((args.picture.quality, args.blend), (Some(QualityArg::Low), Some(Blend::Interlock(4))));
        assert_eq!(args.frames, Some(FrameRange(3..7)));
        assert_eq!((args.stats, args.picture.scene.set.len()), (Some("s.json".into()), 2));
        let args = render("sky.toml --set a.b=1 --exr-compression piz --exr-type half --exr-owner me --aux").unwrap();
        let options = args.exr_options(Path::new("sky.toml"));
        assert_eq!((options.compression, options.colour, options.aux), (ExrCompression::Piz, ExrType::Half, true));
        assert_eq!((options.owner.as_deref(), options.scene.as_deref()), (Some("me"), Some("sky.toml a.b=1")));
    }

    #[test]
    fn bench_takes_one_mode_several_or_all() {
        let vs = |line: &str| -> Result<Vec<Versus>, String> {
            let words = ["welkin", "bench", "a.toml"].into_iter().chain(line.split_whitespace());
            match Cli::try_parse_from(words).map_err(|error| error.to_string())?.command {
                Command::Bench(args) => Ok(args.vs),
                other => panic!("{other:?}"),
            }
        };
        assert_eq!(vs(""), Ok(vec![]));
        assert_eq!(vs("--vs interlock:4"), Ok(vec![Versus::Mode(Blend::Interlock(4))]));
        let two = vec![Versus::Mode(Blend::Tiled), Versus::Mode(Blend::List)];
        assert_eq!(vs("--vs tiled,list"), Ok(two.clone()));
        assert_eq!(vs("--vs tiled --vs list"), Ok(two));
        assert_eq!(vs("--vs all"), Ok(vec![Versus::All]));
        assert!(vs("--vs glass").unwrap_err().contains("'glass' for '--vs"));
    }

    #[test]
    fn several_scenes_and_statistics_on_standard_output() {
        let args = render("a.toml b.toml --stats").unwrap();
        assert_eq!((args.scenes.len(), args.stats), (2, Some("-".into())));
        assert!(render("--stats a.toml b.toml").unwrap_err().contains("ends in .json"));
        assert!(render("").is_err());
    }

    #[test]
    fn bad_values_name_flag_value_and_expectation() {
        for size in ["0x0", "100000x100000", "16384x16384", "640", "-1x5", "axb", "1x"] {
            let message = render(&format!("a.toml --size={size}")).unwrap_err();
            let named = message.contains(&format!("'{size}' for '--size <WxH>'"));
            assert!(named && message.contains("expected WIDTHxHEIGHT"), "{message}");
        }
        assert_eq!(render("a.toml --size 16384x4096").unwrap().picture.size.height, 4096);
        for frames in ["3..3", "4..1", "1", "a..b", "0..200000"] {
            let message = render(&format!("a.toml --frames {frames}")).unwrap_err();
            assert!(message.contains("expected A..B"), "{message}");
        }
        let message = render("a.toml --blend glass").unwrap_err();
        assert!(
            message.contains("'glass' for '--blend") && message.contains("one of auto, exact, interlock"),
            "{message}"
        );
        assert!(render("a.toml --exr-compression lzw").unwrap_err().contains("zip, zips, rle, piz, none"));
        assert!(render("a.toml --exr-type double").unwrap_err().contains("half, float"));
        assert!(render("a.toml --quality ultra").unwrap_err().contains("low, medium, high"));
    }
}
