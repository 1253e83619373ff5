//! Voxels of a scene: mass, values against f64, files that come back bit by bit, bad input.
mod support;

use glam::DVec3;
use std::f64::consts::PI;
use std::ops::ControlFlow;

use support::folder::{directory, json, npy, refused, run};
use support::{stderr, tile, vdb};
use welkin::Params;
use welkin::gpu::standalone::{Options, Standalone};
use welkin::output::{NpyVolume, VdbGrid, VdbWriter};
use welkin::params::{ParticleDesc, Source, Style};
use welkin::reference::extinction::{Tile, to_unit_ball};
use welkin::voxelize::{Brick, Gathered, Order, VoxelGrid, Voxelizer};

fn open() -> Standalone {
    Standalone::new(Options { validation: true, ..Options::default() }).unwrap()
}

/// Where f32 positions would be 2 mm apart.
const FAR: [f64; 3] = [20_000.0, 1000.0, -5000.0];

/// Three ellipsoids that overlap, at `place`.
fn heap(style: Style, place: [f64; 3]) -> Params {
    let particle = |centre: [f64; 3], radii, rotation, density| ParticleDesc {
        centre: std::array::from_fn(|axis| centre[axis] + place[axis]),
        radii,
        rotation,
        density,
        ..Default::default()
    };
    let particles = vec![
        particle([0.0, 0.0, 0.0], [120.0, 60.0, 90.0], [0.0, 0.6, 0.0, 0.8], 0.5),
        particle([90.0, 30.0, 20.0], [70.0, 80.0, 60.0], [0.5, -0.5, 0.5, 0.5], 1.5),
        particle([-70.0, 50.0, -60.0], [40.0, 45.0, 50.0], [0.0, 0.0, 0.0, 1.0], 0.25),
    ];
    let mut params = Params::default();
    params.clouds.source = Source::Particles(particles);
    params.clouds.style = style;
    params
}

/// A dense volume, x fastest.
struct Volume {
    grid: VoxelGrid,
    values: Vec<f32>,
}

impl Volume {
    fn at(&self, [x, y, z]: [u32; 3]) -> f32 {
        let [nx, ny, _] = self.grid.size;
        self.values[((z * ny + y) * nx + x) as usize]
    }

    /// ∫ σ_t dV [m²].
    fn mass(&self) -> f64 {
        self.values.iter().map(|&v| f64::from(v)).sum::<f64>() * self.grid.voxel.powi(3)
    }
}

fn voxelize(device: &mut Standalone, params: &Params, resolution: u32, order: Order) -> Volume {
    let gathered = Gathered::new(device.frames(), params).unwrap();
    let grid = VoxelGrid::covering(gathered.bounds(|_| true).unwrap(), resolution, 1).unwrap();
    let gpu = device.gpu().clone();
    let mut voxelizer = Voxelizer::new(&gpu, params, gathered, 3).unwrap();
    let [nx, ny, nz] = grid.size;
    let mut values = vec![0.0; (nx * ny * nz) as usize];
    let mut last = 0.0;
    let done = voxelizer.run(
        device.frames(),
        &grid,
        order,
        &mut |brick: Brick<'_>| {
            for (index, &value) in brick.sigma_t.iter().enumerate().filter(|(_, value)| **value != 0.0) {
                let index = index as u32;
                let inside = [index / 64, index / 8 % 8, index % 8];
                let [x, y, z]: [u32; 3] = std::array::from_fn(|axis| brick.at[axis] * 8 + inside[axis]);
                assert!(x < nx && y < ny && z < nz, "a value outside of the grid");
                values[((z * ny + y) * nx + x) as usize] = value;
            }
            Ok(())
        },
        &mut |fraction| {
            assert!(fraction >= last && fraction <= 1.0 + 1e-12);
            last = fraction;
            ControlFlow::Continue(())
        },
    );
    assert!(done.unwrap() && last > 0.999);
    Volume { grid, values }
}

#[test]
fn the_mass_of_homogeneous_particles_is_that_of_their_ellipsoids_the_closer_the_finer_the_voxels() {
    let mut device = open();
    let params = heap(Style::Homogeneous, FAR);
    let Source::Particles(list) = &params.clouds.source else { unreachable!() };
    let sigma_t = f64::from(params.clouds.sigma_t);
    let volume = |p: &ParticleDesc| 4.0 / 3.0 * PI * p.radii.iter().map(|&r| f64::from(r)).product::<f64>();
    let mass: f64 = list.iter().map(|p| sigma_t * f64::from(p.density) * volume(p)).sum();
    for resolution in [12, 24, 48, 96] {
        let voxels = voxelize(&mut device, &params, resolution, Order::Layers);
        // Lattice points in a convex body miscount by points near its surface, about (S/h²)^½ of them with random signs
        // (Kendall): relative to its volume (h/r)² for a ball of r/h spacings, h a third of a voxel. Twice that.
        let bound: f64 = list
            .iter()
            .map(|p| {
                let ratio = voxels.grid.voxel / 3.0 / f64::from(p.radii.iter().fold(f32::MAX, |a, &b| a.min(b)));
                2.0 * sigma_t * f64::from(p.density) * volume(p) * ratio * ratio
            })
            .sum();
        let error = (voxels.mass() - mass).abs();
        assert!(error < bound, "{resolution}: mass {} is off {mass} by {error}, bound {bound}", voxels.mass());
    }
    // Particles much smaller than a voxel are still there once.
    let mut dust = heap(Style::Homogeneous, FAR);
    let Source::Particles(list) = &mut dust.clouds.source else { unreachable!() };
    list.iter_mut().for_each(|p| p.radii = p.radii.map(|r| r / 30.0));
    let mass: f64 = list.iter().map(|p| sigma_t * f64::from(p.density) * volume(p)).sum();
    let voxels = voxelize(&mut device, &dust, 24, Order::Layers);
    let least = 40.0 / 30.0 / voxels.grid.voxel;
    assert!(least < 0.2, "radii of {least} voxels");
    // At least 2 samples to a semi-axis: (1/2)² of the volume.
    assert!((voxels.mass() / mass - 1.0).abs() < 0.25, "{} of {mass}", voxels.mass());
    assert_eq!(device.messages().unwrap().all(), Vec::<String>::new());
}

/// The tile of noise as the device has it (tests/oracle_detail.rs checks it): its rounding to 16 bits is no matter here.
fn stored_tile(device: &mut Standalone) -> Tile {
    let texels = tile::texels(device);
    Tile::stored(texels.iter().map(|texel| texel[3].to_f64()).collect())
}

#[test]
fn voxels_are_the_mean_of_the_f64_density_in_every_style_and_in_either_order() {
    let mut device = open();
    let tile = stored_tile(&mut device);
    for style in [Style::Homogeneous, Style::Pyroclastic, Style::Radial, Style::Threshold] {
        let params = heap(style, [200.0, 300.0, -150.0]);
        let voxels = voxelize(&mut device, &params, 40, Order::Layers);
        let other = voxelize(&mut device, &params, 40, Order::Tree);
        assert!(voxels.values == other.values, "the order of bricks changes values");
        let gathered = Gathered::new(device.frames(), &params).unwrap();
        let origin = DVec3::from_array(gathered.origin);
        let (mut checked, mut cloudy, mut worst) = (0, 0, 0.0f64);
        let mut state = 12_345u32;
        while checked < 400 {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let index = (state >> 8) as usize % voxels.values.len();
            let [nx, ny, _] = voxels.grid.size.map(|c| c as usize);
            let at = [index % nx, index / nx % ny, index / (nx * ny)].map(|c| c as u32);
            let centre = DVec3::from_array(std::array::from_fn(|axis| {
                voxels.grid.corner[axis] + voxels.grid.voxel * (f64::from(at[axis]) + 0.5)
            })) - origin;
            let mut expected = 0.0;
            let mut ambiguous = 0.0;
            for sample in 0..27 {
                let step = DVec3::new(f64::from(sample % 3), f64::from(sample / 3 % 3), f64::from(sample / 9)) - 1.0;
                let position = centre + step * (voxels.grid.voxel / 3.0);
                for p in &gathered.particles {
                    let full = f64::from(params.clouds.sigma_t * p.density) / 27.0;
                    expected += full * tile.profile(p, position, origin, 1.0, style, 1);
                    // A sample on the surface may fall on either side: positions of 1 km in f32 are 6e-5 m apart, radii 40 m.
                    let on_edge = (to_unit_ball(p, position).length() - 1.0).abs() < 1e-5;
                    ambiguous += if on_edge { full } else { 0.0 };
                }
            }
            let value = f64::from(voxels.at(at));
            if value == 0.0 && expected == 0.0 && checked % 8 != 0 {
                continue; // Mostly cloud is of interest.
            }
            checked += 1;
            cloudy += usize::from(expected > 0.0);
            worst = worst.max((value - expected).abs() - ambiguous);
        }
        assert!(cloudy > 300, "{cloudy}");
        // Homogeneous: f32 sums of numbers up to 0.15. Others: the device's sin, cos and pow turn and scale the noise with
        // errors of 1e-6 over 500 m to the world's origin: 5e-4 m along bumps with slopes of 0.6, 3e-4 m of depth on radii
        // of 40 m; density has slopes of 22 per radius: 2e-4 of 0.105 1/m. (2e-6 was met on lavapipe.)
        let bound = if style == Style::Homogeneous { 1e-7 } else { 2e-5 };
        println!("{style:?}: {worst:e} at worst, {cloudy} voxels with cloud");
        assert!(worst < bound, "{style:?}: {worst}");
    }
    assert_eq!(device.messages().unwrap().all(), Vec::<String>::new());
}

/// Values that no rounding leaves alone, in leaves that cross nodes of every level.
fn leaves() -> Vec<([u32; 3], Vec<f32>)> {
    #[rustfmt::skip]
    let places = [
        [0, 0, 0], [0, 0, 3], [3, 15, 15], [0, 0, 16], [15, 31, 40], [5, 511, 2], [31, 2, 7], [0, 1, 512], [512, 0, 0],
    ];
    let mut state = 1u32;
    let mut word = || {
        state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        state
    };
    let value = |word: u32| if word.is_multiple_of(3) { 0.0 } else { f32::from_bits(word & 0x007f_ffff | 0x3d00_0000) };
    places.map(|at| (at, (0..512).map(|_| value(word())).collect())).to_vec()
}

#[test]
fn an_openvdb_file_comes_back_bit_by_bit() {
    let path = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("tree.vdb"); // scripts/check-outside looks for it there
    let mut writer = VdbWriter::create(&path).unwrap();
    let leaves = leaves();
    for (at, values) in &leaves {
        writer.leaf(*at, values).unwrap();
    }
    writer.leaf([513, 0, 0], &[0.0; 512]).unwrap(); // An empty one is left out.
    let active = writer.active_voxels();
    let notes = vec![("unit".to_owned(), "1/m".to_owned())];
    writer.finish(&VdbGrid { name: "density".into(), corner: [10.0, -20.0, 30.0], voxel: 2.5, notes }).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let grid = vdb::read(&bytes);
    assert_eq!((grid.name.as_str(), &grid.metadata["class"][..]), ("density", &b"fog volume"[..]));
    assert_eq!(grid.metadata["unit"], b"1/m");
    assert_eq!(grid.metadata["file_voxel_count"], active.to_le_bytes());
    assert_eq!(grid.first_centre, [11.25, -18.75, 31.25]);
    assert_eq!(grid.scale, 2.5);
    assert_eq!(grid.leaves.len(), leaves.len());
    for (at, values) in &leaves {
        let same = grid.leaves[at].iter().zip(values).all(|(a, b)| a.to_bits() == b.to_bits());
        assert!(same, "leaf {at:?}");
    }
    // These very bytes were read by OpenVDB 10.0.1 (scripts/check-outside vdb), every value bit by bit.
    let hash = blake3::hash(&bytes).to_hex();
    assert_eq!(&hash.as_str()[..16], "b9a8af77da3c01ac");
}

#[test]
#[should_panic(expected = "out of order")]
fn leaves_out_of_the_order_of_the_tree_are_refused() {
    let directory = tempfile::tempdir().unwrap();
    let mut writer = VdbWriter::create(&directory.path().join("a.vdb")).unwrap();
    writer.leaf([0, 0, 16], &[1.0; 512]).unwrap();
    writer.leaf([1, 0, 0], &[1.0; 512]).unwrap();
}

#[test]
fn a_dense_array_is_cropped_and_filled_up() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.npy");
    let mut volume = NpyVolume::create(&path, [10, 3, 21]).unwrap();
    let brick: Vec<f32> = (0..512).map(|i| i as f32 + 0.5).collect();
    volume.brick([1, 0, 1], &brick).unwrap();
    volume.finish().unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let file = npyz::NpyFile::new(&bytes[..]).unwrap();
    assert_eq!((file.shape(), file.order()), (&[21, 3, 10][..], npyz::Order::C));
    let values = file.into_vec::<f32>().unwrap();
    for (index, value) in values.into_iter().enumerate() {
        let [x, y, z] = [index % 10, index / 10 % 3, index / 30];
        let expected = if x >= 8 && (8..16).contains(&z) { brick[((x - 8) * 8 + y) * 8 + z - 8] } else { 0.0 };
        assert_eq!(value, expected, "{x} {y} {z}");
    }
}

const SCENE: &str = r#"
    [clouds]
    source = "particles"
    lighting = "flat"
    style = "radial"
    [[clouds.particle]]
    centre = [0, 500, -3000]
    radii = [300, 100, 200]
    [[clouds.particle]]
    centre = [150, 560, -3050]
    radii = [100, 150, 100]
"#;

#[test]
fn the_command_writes_both_formats_with_the_same_values() {
    let directory = directory(SCENE);
    for name in ["a.npy", "b.vdb"] {
        let output = run(directory.path(), &format!("voxelize sky.toml --resolution 40 -o {name}"));
        assert!(stderr(&output).contains("40x"), "{}", stderr(&output));
    }
    let (side, other) = (json(&directory.path().join("a.json")), json(&directory.path().join("b.json")));
    assert_eq!(side["corner"], other["corner"]);
    let (shape, values) = npy(&directory.path().join("a.npy"));
    assert_eq!(serde_json::json!(shape), side["shape"]);
    let (ny, nx) = (shape[1] as usize, shape[2] as usize);
    let edge = side["voxel_size"].as_f64().unwrap();
    let total: f64 = values.iter().map(|&v| f64::from(v)).sum::<f64>() * edge.powi(3);
    assert!((total / side["integral"].as_f64().unwrap() - 1.0).abs() < 1e-9);
    assert_eq!(values.iter().filter(|v| **v > 0.0).count() as u64, side["active_voxels"].as_u64().unwrap());
    // An empty voxel on every side.
    assert!(values.iter().take(nx * ny).all(|&v| v == 0.0) && values.iter().rev().take(nx * ny).all(|&v| v == 0.0));

    let grid = vdb::read(&std::fs::read(directory.path().join("b.vdb")).unwrap());
    assert!((grid.scale - edge).abs() < 1e-12 * edge);
    let corner: [f64; 3] = std::array::from_fn(|axis| side["corner"][axis].as_f64().unwrap());
    assert!((0..3).all(|axis| (grid.first_centre[axis] - corner[axis] - 0.5 * edge).abs() < 1e-9));
    for (index, value) in values.iter().enumerate() {
        let at = [index % nx, index / nx % ny, index / (nx * ny)];
        let leaf = grid.leaves.get(&at.map(|c| c as u32 / 8));
        let stored = leaf.map_or(0.0, |leaf| leaf[(at[0] % 8 * 8 + at[1] % 8) * 8 + at[2] % 8]);
        assert_eq!(stored.to_bits(), value.to_bits(), "{at:?}");
    }
}

#[test]
fn the_grid_of_particles_is_taken_around_the_camera_or_in_a_box() {
    let directory = directory("[clouds]\nstyle = \"homogeneous\"");
    let side = |line: &str| {
        run(directory.path(), &format!("voxelize {line}"));
        json(&directory.path().join("a.json"))
    };
    let around = side("sky.toml -o a.vdb --quality low --resolution 34 --samples 1 --set camera.position=[700,10,0]");
    // 32 voxels and a margin of one.
    assert_eq!(around["corner"][0], 700.0 - 5000.0 - 312.5);
    assert_eq!((&around["shape"][2], &around["voxel_size"]), (&34.into(), &312.5.into()));
    let base = around["corner"][1].as_f64().unwrap();
    assert!((2000.0..3000.0).contains(&base), "the clouds' base, {base}, is a little below 3000 m");
    assert!(around["integral"].as_f64().unwrap() > 0.0);
    let boxed =
        side("sky.toml -o a.vdb --quality low --resolution 16 --samples 1 --bounds -800,2900,-800,800,3700,800");
    assert_eq!(boxed["shape"], serde_json::json!([16, 8, 16]));
    assert_eq!(boxed["corner"], serde_json::json!([-800.0, 2900.0, -800.0]));
}

#[test]
fn bad_input_is_named_and_leaves_no_file() {
    let directory = directory(SCENE);
    std::fs::write(
        directory.path().join("none.toml"),
        "[clouds]\nsource = \"particles\"\nlighting = \"flat\"\n[[clouds.particle]]\ncentre = [0, 0, 0]\nradii = [9, 9, 9]\ndensity = 0",
    )
    .unwrap();
    std::fs::create_dir(directory.path().join("b.npy")).unwrap();
    std::fs::create_dir(directory.path().join("c.json")).unwrap();
    for (line, message) in [
        ("sky.toml -o a.raw", "a.raw: names no volume format: expected a name that ends in .npy or .vdb"),
        ("sky.toml -o a", "a: names no volume format: expected a name that ends in .npy or .vdb"),
        ("sky.toml -o nowhere/a.vdb", "there is no directory nowhere"),
        ("sky.toml -o b.npy", "b.npy: cannot be written: it is a directory"),
        ("sky.toml -o c.vdb", "c.json: cannot be written: it is a directory"),
        ("sky.toml", "--output <OUT.{npy,vdb}>"),
        ("sky.toml -o a.vdb --resolution 0", "--resolution = 0: expected a number from 4 to 4096"),
        ("sky.toml -o a.vdb --resolution 1", "--resolution = 1: expected a number from 4 to 4096"),
        ("sky.toml -o a.npy --resolution 9999", "--resolution = 9999: expected a number from 4 to 4096"),
        ("sky.toml -o a.npy --resolution=-8", "'-8' for '--resolution"),
        ("sky.toml -o a.npy --bounds 0,0,0,1,1", "expected six numbers x0,y0,z0,x1,y1,z1"),
        ("sky.toml -o a.npy --bounds 0,0,0,1,-1,1", "expected six numbers x0,y0,z0,x1,y1,z1"),
        ("sky.toml -o a.npy --bounds 0,0,0,1,nan,1", "expected six numbers x0,y0,z0,x1,y1,z1"),
        ("sky.toml -o a.npy --bounds -1e9,0,0,1,1,1", "--bounds = -1000000000,0,0,1,1,1: expected"),
        ("sky.toml -o a.npy --samples 0", "'0' for '--samples <S>'"),
        ("sky.toml -o a.npy --samples 17", "'17' for '--samples <S>'"),
        ("none.toml -o a.npy", "--bounds = none: expected a box to fill"),
    ] {
        refused(directory.path(), &format!("voxelize {line}"), &[message]);
    }
}
