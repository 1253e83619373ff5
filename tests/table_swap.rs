//! Tables change while frames are rendered: coarse ones give way to full ones, one style to another.

use std::ops::ControlFlow;
use std::path::Path;
use welkin::gpu::standalone::{Options, Standalone};
use welkin::gpu::{Buffer, BufferKind};
use welkin::lut::{Background, Detail, TableParams, Tables};
use welkin::params::{Aim, Params, Preset, Style};
use welkin::renderer::{Renderer, TableImages};

const SIZE: [u32; 2] = [128, 80];

struct Scene {
    device: Standalone,
    params: Params,
    renderer: Renderer,
    picture: Buffer,
}

impl Scene {
    fn new() -> Self {
        let device = Standalone::new(Options { validation: true, ..Options::default() }).unwrap();
        let mut params = Params::default();
        params.quality = Preset::Low.quality();
        params.quality.downscale = 1;
        let gpu = device.gpu().clone();
        let renderer = Renderer::new(&gpu, &params, SIZE, 2).unwrap();
        let size = u64::from(SIZE[0] * SIZE[1]) * 8;
        let picture = Buffer::new(&gpu, "picture", size, BufferKind::Readback).unwrap();
        Self { device, params, renderer, picture }
    }

    /// Tables from cargo's directory for tests, where those of `tests/tables.rs` lie as well.
    fn tables(&mut self, detail: Detail, style: Style) -> Tables {
        let params = TableParams { style, ..TableParams::new(&self.params.clouds, detail) };
        let cache = Path::new(env!("CARGO_TARGET_TMPDIR"));
        let go_on = &mut |_| ControlFlow::Continue(());
        Tables::load_or_build(self.device.frames(), &params, Some(cache), go_on).unwrap().unwrap()
    }

    /// A frame, in whose commands the tables first change to another style if one is given: `[radiance; 3], transmittance`.
    fn frame(&mut self, tables: &mut Tables, style: Option<Style>) -> Vec<f32> {
        let gpu = self.device.gpu().clone();
        for _ in 0..6 {
            let (slot, ()) = (self.device.frames())
                .submit(|rec| {
                    if let Some(style) = style {
                        tables.record_style(rec, style)?;
                    }
                    let images = TableImages {
                        optical_depth: tables.optical_depth.image(),
                        scattering: tables.scattering.image(),
                        fill: tables.fill(),
                    };
                    self.renderer.record(rec, &self.params.camera, images)?;
                    rec.copy_image_to_buffer(&self.renderer.targets().cloud, &self.picture);
                    rec.make_visible_to_host(&self.picture);
                    Ok(())
                })
                .unwrap();
            self.device.frames().wait().unwrap();
            if !self.renderer.finish(&gpu, slot).unwrap() {
                let bits: Vec<u16> = self.picture.read(0, (SIZE[0] * SIZE[1] * 4) as usize);
                return bits.into_iter().map(|b| half::f16::from_bits(b).to_f32()).collect();
            }
            self.device.frames().state().forget();
        }
        panic!("the lists keep growing");
    }
}

/// RMS difference relative to the RMS of `b`, radiance and transmittance alike.
fn difference(a: &[f32], b: &[f32]) -> f32 {
    let square: f32 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
    (square / b.iter().map(|b| b * b).sum::<f32>()).sqrt()
}

/// Full tables on a device of their own, as `--tables progressive` makes them.
fn full_tables_beside() -> Background {
    Background::start(|progress| {
        let mut device = Standalone::new(Options { validation: true, ..Options::default() })?;
        let params =
            TableParams { style: Style::Homogeneous, ..TableParams::new(&Params::default().clouds, Detail::Full) };
        let cache = Path::new(env!("CARGO_TARGET_TMPDIR"));
        let tables = Tables::load_or_build(device.frames(), &params, Some(cache), progress)?;
        let data = tables.map(|tables| tables.download(device.frames())).transpose();
        assert_eq!(device.messages().unwrap().all(), Vec::<String>::new());
        data
    })
    .unwrap()
}

#[test]
fn the_swap_from_coarse_to_full_tables_shows_less_than_a_moving_camera() {
    let mut scene = Scene::new();
    let mut tables = scene.tables(Detail::Coarse, Style::Homogeneous);
    let coarse = scene.frame(&mut tables, None);
    let mut better = full_tables_beside();
    let data = loop {
        // While the full ones are made, frames go on as they were.
        assert_eq!(scene.frame(&mut tables, None), coarse);
        match better.poll().unwrap() {
            Some(data) => break data,
            None => std::thread::sleep(std::time::Duration::from_millis(200)),
        }
    };
    assert!(better.poll().unwrap().is_none(), "tables come once");
    let mut tables = Tables::upload(scene.device.frames(), data).unwrap();
    let full = scene.frame(&mut tables, None);
    assert_eq!(scene.frame(&mut tables, None), full, "the swap is not done in one frame");
    // It is what a run that has full tables from the start shows.
    let mut from_the_start = scene.tables(Detail::Full, Style::Homogeneous);
    assert_eq!(scene.frame(&mut from_the_start, None), full);

    // A camera that turns by 6 degrees a second, at 60 frames a second.
    let Aim::Angles { yaw, pitch } = scene.params.camera.aim else { panic!("the default camera aims by angles") };
    scene.params.camera.aim = Aim::Angles { yaw: yaw + 0.1, pitch };
    let moved = difference(&scene.frame(&mut tables, None), &full);
    let change = difference(&coarse, &full);
    println!("coarse to full: {:.2} %, a frame of motion: {:.2} %", 100.0 * change, 100.0 * moved);
    assert!(change > 0.0 && change < moved, "{change} {moved}");
    assert_eq!(scene.device.messages().unwrap().all(), Vec::<String>::new());
}

#[test]
fn tables_that_are_no_longer_wanted_stop_being_made() {
    let cache = tempfile::tempdir().unwrap();
    let directory = cache.path().to_owned();
    let params = TableParams::new(&Params::default().clouds, Detail::Full);
    let mut background = Background::start(move |progress| {
        let mut device = Standalone::new(Options { validation: true, ..Options::default() })?;
        let tables = Tables::load_or_build(device.frames(), &params, Some(&directory), progress)?;
        tables.map(|tables| tables.download(device.frames())).transpose()
    })
    .unwrap();
    while background.fraction() <= 0.1 {
        assert!(background.poll().unwrap().is_none());
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    drop(background); // waits for the thread: half a minute if it did not stop
    let left: Vec<_> = std::fs::read_dir(cache.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(left, [std::ffi::OsString::from(params.optical_depth_file())]);
}

#[test]
fn styles_switch_within_a_frame() {
    let mut scene = Scene::new();
    let mut tables = scene.tables(Detail::Coarse, Style::Homogeneous);
    let plain = scene.frame(&mut tables, None);
    let mut pictures = vec![plain.clone()];
    for style in [Style::Pyroclastic, Style::Radial, Style::Threshold] {
        let picture = scene.frame(&mut tables, Some(style));
        assert!(picture.iter().all(|v| v.is_finite()));
        for other in &pictures {
            assert!(difference(&picture, other) > 0.01, "{style:?} looks like another style");
        }
        pictures.push(picture);
    }
    assert_eq!(scene.frame(&mut tables, Some(Style::Homogeneous)), plain, "switching back gives another picture");
    assert_eq!(scene.device.messages().unwrap().all(), Vec::<String>::new());
}
