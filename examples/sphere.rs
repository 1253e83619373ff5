//! Draws the homogeneous sphere of the scattering tables, lit from eight directions: Monte Carlo, table, and their difference × 10,
//! averaged over blocks so that what remains is not the noise of Monte Carlo.
//!
//! `cargo run --release --example sphere -- OUT.png [OPTICAL_RADIUS [WALKS]]` (docs/tables.md shows the result).

use std::f64::consts::PI;
use std::ops::ControlFlow;
use welkin::gpu::standalone::{Options, Standalone};
use welkin::lut::{Detail, TableParams, Tables};
use welkin::params::{Clouds, Style};
use welkin::reference::monte_carlo::{multiple_scattering, parallel};
use welkin::reference::scattering::{ScatteringLookup, single_scattering};
use welkin::reference::sphere::RayCoordinates;

const ANGLES: [f64; 8] = [0.0, 25.0, 50.0, 75.0, 100.0, 130.0, 155.0, 180.0];
const SIZE: usize = 64;
const BLOCK: usize = 8;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let out = args.next().ok_or("name the picture to write")?;
    let optical_radius: f64 = args.next().map_or(Ok(8.0), |r| r.parse())?;
    let walks: u32 = args.next().map_or(Ok(4000), |n| n.parse())?;

    let mut device = Standalone::new(Options::default())?;
    let params = TableParams { style: Style::Homogeneous, ..TableParams::new(&Clouds::default(), Detail::Full) };
    let cache = std::env::temp_dir().join("welkin-example-tables");
    let tables = Tables::load_or_build(device.frames(), &params, Some(&cache), &mut |p| {
        eprintln!("{} {:.0} %", p.stage, 100.0 * p.fraction);
        ControlFlow::Continue(())
    })?
    .ok_or("stopped")?;
    let texels = tables.read_scattering(device.frames())?;
    let lookup = ScatteringLookup::new(tables.scattering.shape(), texels);

    let medium = params.medium;
    let mut picture = image::RgbImage::new((ANGLES.len() * SIZE) as u32, 3 * SIZE as u32);
    for (column, angle) in ANGLES.iter().enumerate() {
        let theta = angle.to_radians();
        let pixels = parallel(SIZE * SIZE, |i| {
            let at = |k: usize| (k as f64 + 0.5) / SIZE as f64 * 2.1 - 1.05;
            let (x, y) = (at(i % SIZE), -at(i / SIZE));
            let b = x.hypot(y);
            if b >= 1.0 {
                return None;
            }
            // The sun is above: psi is measured from the side of the ray to it.
            let c = RayCoordinates { theta, psi: x.atan2(y).abs().min(PI), mu: (1.0 - b * b).sqrt() };
            let phase = medium.phase.eval(theta.cos(), medium.g_sun);
            let truth = phase * single_scattering(&c.ray(), optical_radius)
                + multiple_scattering(&medium, &c.ray(), optical_radius, None, walks, i as u64).mean;
            let table = phase * lookup.single(&c, optical_radius) + lookup.multiple(&c, optical_radius);
            Some((truth, table))
        });
        let peak = pixels.iter().flatten().fold(0.0f64, |peak, p| peak.max(p.1));
        // Mean difference of each block, over the pixels of it that show the sphere.
        let mut blocks = vec![(0.0, 0.0); (SIZE / BLOCK).pow(2)];
        let block = |i: usize| (i / SIZE / BLOCK) * (SIZE / BLOCK) + i % SIZE / BLOCK;
        for (i, (truth, table)) in pixels.iter().enumerate().filter_map(|(i, p)| p.map(|p| (i, p))) {
            blocks[block(i)].0 += truth - table;
            blocks[block(i)].1 += 1.0;
        }
        for (i, pixel) in pixels.iter().enumerate() {
            let Some((truth, table)) = pixel else { continue };
            let (difference, count) = blocks[block(i)];
            for (row, value) in [*truth, *table, (10.0 * difference / count).abs()].iter().enumerate() {
                let grey = (255.0 * (value / peak).clamp(0.0, 1.0).powf(1.0 / 2.2)) as u8;
                let (x, y) = (column * SIZE + i % SIZE, row * SIZE + i / SIZE);
                picture.put_pixel(x as u32, y as u32, image::Rgb([grey; 3]));
            }
        }
    }
    picture.save(out)?;
    Ok(())
}
