//! Figure 13 of Yusov 2014: spheres whose opacity is close to 1, seen from two places so close that only their order
//! differs. Sorted alpha pops, volume-aware blending does not.
//!
//! `cargo run --release --example ab_popping -- DIRECTORY [WIDTHxHEIGHT]` writes `figure.png` (left alpha, right
//! volume-aware; above before, below after the camera has moved) and `report.html`, and prints how much each mode pops.
//! The reference is integrated in f64 on the CPU.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use ash::vk;
use welkin::Params;
use welkin::blend::supports;
use welkin::compare::{Report, ReportSide, Series, oracle};
use welkin::gpu::standalone::{Options, Standalone};
use welkin::gpu::{Buffer, BufferKind, Image, ImageDesc};
use welkin::output::{Picture, PngDepth};
use welkin::params::{Blend, Precision};
use welkin::renderer::{Renderer, TableImages};

/// Frames of the scene's animation that are looked at.
const FRAMES: u32 = 12;

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let out = PathBuf::from(arguments.next().ok_or("name a directory for the pictures")?);
    let size = arguments.next().unwrap_or("480x270".into());
    let (width, height) = size.split_once('x').ok_or("the size is WIDTHxHEIGHT")?;
    let size: [u32; 2] = [width.parse()?, height.parse()?];
    std::fs::create_dir_all(&out)?;

    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/popping.toml");
    let mut params = welkin::scene::load(&scene, &[])?;
    params.quality.precision = Precision::F32;
    let mut device = Standalone::new(Options::default())?;
    let capabilities = device.gpu().capabilities();
    let volume_aware = [Blend::Interlock(1), Blend::Attachment(1), Blend::List]
        .into_iter()
        .find(|mode| supports(*mode, capabilities).is_ok())
        .ok_or("this device has no volume-aware mode")?;
    let name = capabilities.device_name.clone();

    let mut modes =
        [Mode::new(&mut device, &params, Blend::Alpha, size)?, Mode::new(&mut device, &params, volume_aware, size)?];
    let mut report = Report::new("Figure 13", &name, size, "oracle");
    let mut ends = Vec::new();
    for frame in 0..FRAMES {
        let at = params.at_frame(frame);
        let reference = Arc::new(oracle(&at, size)?.into());
        let mut pictures = Vec::new();
        let mut differences = Vec::new();
        for mode in &mut modes {
            let picture = Arc::new(mode.picture(&mut device, &at)?);
            differences.push(mode.series.add(frame, &picture, &reference)?);
            pictures.push(picture);
        }
        report.add(frame, [&pictures[0], &pictures[1], &reference.picture], [&differences[0], &differences[1]])?;
        if frame == 0 || frame == FRAMES - 1 {
            ends.extend(pictures);
        }
    }
    figure(&ends).write(&out.join("figure.png"), PngDepth::Eight)?;
    let names = modes.each_ref().map(|mode| mode.blend.to_string());
    let side = |i: usize| ReportSide { name: &names[i], series: &modes[i].series, frame_gpu_ms: None };
    report.write(&out.join("report.html"), [side(0), side(1)])?;
    let popping = modes.each_ref().map(|mode| mode.series.summary().popping.unwrap_or(0.0));
    println!(
        "popping: {} {:.4}, {} {:.4}, {:.0} times less",
        names[0],
        popping[0],
        names[1],
        popping[1],
        popping[0] / popping[1]
    );
    Ok(())
}

/// One blend mode, and what it made so far.
struct Mode {
    blend: Blend,
    renderer: Renderer,
    unused: Image,
    radiance: Buffer,
    shown: Buffer,
    size: [u32; 2],
    series: Series,
}

impl Mode {
    fn new(device: &mut Standalone, params: &Params, blend: Blend, size: [u32; 2]) -> Result<Self> {
        let mut params = params.clone();
        params.quality.blend = blend;
        let gpu = device.gpu().clone();
        let pixels = u64::from(size[0] * size[1]);
        let unused = ImageDesc {
            name: "unused table",
            extent: [1, 1, 2],
            format: vk::Format::R16G16_SFLOAT,
            usage: vk::ImageUsageFlags::SAMPLED,
        };
        Ok(Self {
            blend,
            renderer: Renderer::new(&gpu, &params, size, device.frames().slots())?,
            unused: Image::new(&gpu, &unused)?, // Particles of constant density and colour need no tables.
            radiance: Buffer::new(&gpu, "radiance", 16 * pixels, BufferKind::Readback)?,
            shown: Buffer::new(&gpu, "picture", 8 * pixels, BufferKind::Readback)?,
            size,
            series: Series::new(&blend.to_string()),
        })
    }

    fn picture(&mut self, device: &mut Standalone, params: &Params) -> Result<Picture> {
        let gpu = device.gpu().clone();
        loop {
            let tables = TableImages { optical_depth: &self.unused, scattering: &self.unused, fill: 1.0 };
            let (slot, ()) = device.frames().submit(|rec| {
                self.renderer.record(rec, &params.camera, tables)?;
                let film = self.renderer.film();
                for (image, buffer) in [(&film.scene, &self.radiance), (&film.picture, &self.shown)] {
                    rec.copy_image_to_buffer(image, buffer);
                    rec.make_visible_to_host(buffer);
                }
                Ok(())
            })?;
            device.frames().wait()?;
            if !self.renderer.finish(&gpu, slot)? {
                break; // Every list was large enough.
            }
            device.frames().state().forget();
        }
        let pixels = (self.size[0] * self.size[1]) as usize;
        let radiance: Vec<[f32; 4]> = self.radiance.read(0, pixels);
        let shown: Vec<[u16; 4]> = self.shown.read(0, pixels);
        Ok(Picture {
            width: self.size[0],
            height: self.size[1],
            radiance: radiance.iter().map(|&[r, g, b, _]| [r, g, b]).collect(),
            transmittance: Some(radiance.iter().map(|&[.., t]| t).collect()),
            display: shown.iter().map(|&[r, g, b, _]| [r, g, b].map(|v| f32::from(v) / 65_535.0)).collect(),
        })
    }
}

/// Four pictures as two rows of two.
fn figure(pictures: &[Arc<Picture>]) -> Picture {
    let (width, height) = (pictures[0].width, pictures[0].height);
    let gather = |values: &dyn Fn(&Picture) -> Vec<[f32; 3]>| {
        let parts: Vec<_> = pictures.iter().map(|picture| values(picture)).collect();
        let mut all = Vec::new();
        for y in 0..2 * height {
            for x in 0..2 * width {
                let part = &parts[(2 * (y / height) + x / width) as usize];
                all.push(part[(y % height * width + x % width) as usize]);
            }
        }
        all
    };
    Picture {
        width: 2 * width,
        height: 2 * height,
        radiance: gather(&|picture| picture.radiance.clone()),
        transmittance: None,
        display: gather(&|picture| picture.display.clone()),
    }
}
