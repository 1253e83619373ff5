//! The particle tables on the device against quadrature, Monte Carlo and closed forms.

use glam::DVec3;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use welkin::definitions::REFERENCE_SEED;
use welkin::gpu::standalone::{Options, Standalone};
use welkin::gpu::{Buffer, BufferKind, ComputePipeline};
use welkin::lut::axes::{DENSITY_LEVELS, LEVELS, OpticalDepthShape, R_MAX, R_MIN, STEPS, ScatteringShape};
use welkin::lut::transport::plan::Resolution;
use welkin::lut::{Detail, TableParams, Tables};
use welkin::params::{Clouds, Style};
use welkin::reference::comparison::{Deviation, random_cases, random_ray};
use welkin::reference::monte_carlo::{Medium, next_uniform, parallel};
use welkin::reference::optical_depth::mean_density;
use welkin::reference::phase::PhaseFunction;
use welkin::reference::scattering::{
    ScatteringLookup, directly_transmitted, multiple_scattering_model, opacity, single_fraction, single_scattering,
};
use welkin::reference::sphere::RayCoordinates;
use welkin::reference::transport::solve;
use welkin::shaders::probe_scattering_lookup_comp as probe;

fn open() -> Standalone {
    Standalone::new(Options { validation: true, ..Options::default() }).expect("a device with validation")
}

/// Full tables of the default medium, kept in cargo's directory for tests: their name changes with solver and shaders.
struct Fixture {
    scattering: ScatteringLookup,
    reports: Vec<welkin::lut::LevelReport>,
    params: TableParams,
}

fn params(detail: Detail, style: Style) -> TableParams {
    TableParams { style, ..TableParams::new(&Clouds::default(), detail) }
}

fn load_full(device: &mut Standalone) -> (Tables, ScatteringLookup) {
    let params = params(Detail::Full, Style::Homogeneous);
    let cache = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let go_on = &mut |_| ControlFlow::Continue(());
    let tables = Tables::load_or_build(device.frames(), &params, Some(cache), go_on).unwrap().unwrap();
    let values = tables.read_scattering(device.frames()).unwrap();
    let lookup = ScatteringLookup::new(tables.scattering.shape(), values);
    (tables, lookup)
}

fn fixture() -> &'static Fixture {
    static FIXTURE: OnceLock<Fixture> = OnceLock::new();
    FIXTURE.get_or_init(|| {
        let mut device = open();
        let (tables, scattering) = load_full(&mut device);
        assert_eq!(device.messages().unwrap().all(), Vec::<String>::new());
        Fixture { scattering, reports: tables.reports().to_vec(), params: *tables.params() }
    })
}

/// Directory that no other test uses, removed first.
fn scratch(name: &str) -> PathBuf {
    let path = std::env::temp_dir().join(format!("welkin-tables-{name}-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&path);
    path
}

/// Relative RMS error weighted by radiance, and bias: √(Σ(x - t)² / Σt²), Σ(x - t) / Σt.
fn errors(pairs: &[(f64, f64)]) -> (f64, f64) {
    let square: f64 = pairs.iter().map(|(x, t)| (x - t).powi(2)).sum();
    let energy: f64 = pairs.iter().map(|(_, t)| t * t).sum();
    let (difference, total) = pairs.iter().fold((0.0, 0.0), |s, (x, t)| (s.0 + x - t, s.1 + t));
    ((square / energy).sqrt(), difference / total)
}

/// Optical radii at levels of the table and half-way between them.
fn radii_at_and_between_levels() -> impl Iterator<Item = (f64, bool)> {
    let between =
        |level: u32| (ScatteringShape::optical_radius(level) * ScatteringShape::optical_radius(level + 1)).sqrt();
    (0..LEVELS)
        .map(|level| (ScatteringShape::optical_radius(level), true))
        .chain((0..LEVELS - 1).map(move |level| (between(level), false)))
}

#[test]
fn single_scattering_agrees_with_quadrature_at_texels_and_between() {
    let fixture = fixture();
    let shape = ScatteringShape::FULL;
    let mut state = 17;
    for (r, at_level) in radii_at_and_between_levels() {
        let between: Vec<_> = (0..600)
            .map(|_| {
                let c = random_ray(&mut state);
                (fixture.scattering.single(&c, r), single_scattering(&c.ray(), r))
            })
            .collect();
        let (rms, bias) = errors(&between);
        // What interpolation leaves over the closed-form model; largest at the edge of shadow of thick balls.
        assert!(rms < 0.02 && bias.abs() < 0.005, "R = {r}: rms {rms}, bias {bias}");
        if at_level {
            let at_texels: Vec<_> = (0..600)
                .map(|_| {
                    let mut pick = |n: u32| (next_uniform(&mut state) * f64::from(n)) as u32;
                    let texel = [pick(shape.theta), pick(shape.psi), 1 + pick(shape.mu - 1)];
                    let c = shape.coordinates(texel, r);
                    (fixture.scattering.single(&c, r), single_scattering(&c.ray(), r))
                })
                .collect();
            let (rms, bias) = errors(&at_texels);
            // f32 quadrature and f16 storage of the small rest.
            assert!(rms < 0.002 && bias.abs() < 0.001, "texels, R = {r}: rms {rms}, bias {bias}");
        }
    }
}

#[test]
fn multiple_scattering_agrees_with_monte_carlo_at_every_density_and_between() {
    let fixture = fixture();
    let medium = fixture.params.medium;
    // Rays at each density level, and at optical radii anywhere between the first and the last. `scripts/table-errors` does
    // this with more rays, more walks and for other media.
    let levels = (0..DENSITY_LEVELS).map(|level| ScatteringShape::optical_radius(level * STEPS));
    for (from, to) in levels.map(|r| (r, r)).chain([(R_MIN, R_MAX)]) {
        // Walks that bring noise to 2 to 4 %.
        let (rays, walks) = match from {
            _ if from < to => (200, 1500),
            r if r < 4.0 => (100, 1500),
            r => (100, (6600.0 * r.powf(-0.28)) as u32),
        };
        let cases = random_cases(&medium, from, to, rays, walks, 29 + from as u64);
        let pairs: Vec<_> =
            cases.iter().map(|c| (fixture.scattering.multiple(&c.ray, c.optical_radius), c.truth)).collect();
        let found = Deviation::new(&pairs);
        let what = format!(
            "R = {from:.2} to {to:.2}: rms {:.2} % (< {:.2} %, noise of {:.1} % out), bias {:+.2} ± {:.2} %",
            100.0 * found.rms(),
            100.0 * found.rms_bound(),
            100.0 * found.noise,
            100.0 * found.bias.mean,
            100.0 * found.bias.error
        );
        println!("{what}");
        assert!(found.rms() < 0.03 && found.bias.mean.abs() < 0.01, "{what}");
        // Without this the test would prove little.
        assert!(found.mean_square.error < 4e-4 && found.bias.error < 0.006, "{what}");
    }
}

#[test]
fn no_energy_is_lost_or_made() {
    let fixture = fixture();
    for report in &fixture.reports {
        let r = report.optical_radius;
        let single = single_fraction(&fixture.params.medium, r);
        let total = directly_transmitted(r) + single + report.multiple;
        println!("R = {r:.2}: total {total:.5} after {} applications", report.applications);
        assert!((total - 1.0).abs() < 0.005, "R = {r}: {total}");
    }
}

#[test]
fn look_ups_have_no_bias_at_levels_and_between() {
    // All light that leaves, by look-ups alone. Without absorption it is known: 1 less what was scattered never or once.
    let fixture = fixture();
    assert_eq!(fixture.params.medium.albedo, 1.0);
    let cases: Vec<_> = radii_at_and_between_levels().step_by(3).collect();
    let found = parallel(cases.len(), |case| {
        let (r, rays) = (cases[case].0, 20_000);
        let mut sum = 0.0;
        for i in 0..rays {
            // A sequence that fills the cube of (cos theta, psi, mu²) evenly.
            let at = |step: f64| (0.5 + f64::from(i) * step).fract();
            let theta = (1.0 - 2.0 * at(0.819_172_513_396_164_5)).acos();
            let psi = std::f64::consts::PI * at(0.671_043_606_703_789_3);
            let c = RayCoordinates { theta, psi, mu: at(0.549_700_477_901_970_3).sqrt() };
            sum += fixture.scattering.multiple(&c, r) / f64::from(rays);
        }
        4.0 * std::f64::consts::PI * sum
    });
    for ((r, _), multiple) in cases.iter().zip(found) {
        let truth = 1.0 - directly_transmitted(*r) - single_fraction(&fixture.params.medium, *r);
        let bias = multiple / truth - 1.0;
        println!("R = {r:.2}: bias {:.2} %", 100.0 * bias);
        assert!(bias.abs() < 0.01, "R = {r}: {multiple}, not {truth}");
    }
}

#[test]
fn interpolation_follows_thick_absorbing_balls() {
    // Look-ups against the solution that their texels come from, both without noise, half-way between texels along mu,
    // where linear interpolation errs most. With absorption light stays near the surface, and the terminator is sharp.
    let medium = Medium { phase: PhaseFunction::HenyeyGreenstein, g_sun: 0.9, g: 0.7, albedo: 0.9 };
    let shape = ScatteringShape::FULL;
    for level in [24, 28] {
        let r = ScatteringShape::optical_radius(level);
        let twice = ScatteringShape { mu: 2 * shape.mu - 1, ..shape };
        let mus: Vec<f64> = (0..twice.mu).map(|k| twice.coordinates([0, 0, k], r).mu.max(1e-3 / r)).collect();
        // What is interpolated matters here, not how finely it was solved.
        let solution = solve(&medium, r, Resolution::for_medium(&medium, r, 0.4), &mus, None);
        let source = |view: usize, c: RayCoordinates| {
            let c = RayCoordinates { mu: mus[view], ..c };
            solution.radiance(view, &c).max(0.0) / opacity(2.0 * r * c.mu)
        };
        let model = |view: usize, c: &RayCoordinates| {
            multiple_scattering_model(&RayCoordinates { mu: mus[view], ..*c }.ray(), r)
        };
        let mut state = 23;
        let pairs: Vec<(f64, f64)> = (0..6000)
            .map(|_| {
                let ray = random_ray(&mut state);
                let texel = shape.texel(&ray, r);
                let [i, j, k] = [0, 1, 2].map(|a| texel[a] as u32);
                let (i, j, between) =
                    (i.min(shape.theta - 2), j.min(shape.psi - 2), 2 * k.min(shape.mu - 2) as usize + 1);
                let mut sum = 0.0;
                for corner in 0..8 {
                    let (x, y, view) =
                        (i + (corner & 1), j + (corner >> 1 & 1), between + 1 - 2 * (corner >> 2) as usize);
                    let weight =
                        (1.0 - (texel[0] - f64::from(x)).abs()) * (1.0 - (texel[1] - f64::from(y)).abs()) * 0.5;
                    let at = shape.coordinates([x, y, 0], r);
                    sum += weight * source(view, at) / model(view, &at);
                }
                let opacity = opacity(2.0 * r * mus[between]);
                (sum * model(between, &ray) * opacity, source(between, ray) * opacity)
            })
            .collect();
        let (rms, bias) = errors(&pairs);
        println!("R = {r:.2}: rms {:.2} %, bias {:+.2} %", 100.0 * rms, 100.0 * bias);
        assert!(rms < 0.02 && bias.abs() < 0.005, "R = {r}: rms {rms}, bias {bias}");
    }
}

/// Twin of `LookupRay`.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct LookupRay {
    entry: [f32; 3],
    optical_radius: f32,
    dir: [f32; 3],
    pad_a: f32,
    to_sun: [f32; 3],
    pad_b: f32,
}

#[test]
fn the_device_looks_tables_up_as_the_oracle_does() {
    let mut device = open();
    let gpu = device.gpu().clone();
    let (tables, lookup) = load_full(&mut device);
    let mut state = 5;
    let rays: Vec<(RayCoordinates, f64)> = (0..20_000)
        .map(|_| (random_ray(&mut state), 0.1 * 2000f64.powf(next_uniform(&mut state)))) // 0.1..200: beyond both ends
        .collect();
    let probes: Vec<LookupRay> = (rays.iter())
        .map(|(c, r)| {
            let ray = c.ray();
            let v = |v: DVec3| v.as_vec3().to_array();
            let (entry, dir, to_sun) = (v(ray.entry), v(ray.dir), v(ray.to_sun));
            LookupRay { entry, optical_radius: *r as f32, dir, pad_a: 0.0, to_sun, pad_b: 0.0 }
        })
        .collect();
    let source = Buffer::upload(&gpu, "rays", &probes).unwrap();
    let found = Buffer::array::<[f32; 2]>(&gpu, "found", rays.len()).unwrap();
    let readback = Buffer::new(&gpu, "readback", found.size(), BufferKind::Readback).unwrap();
    let pipeline = ComputePipeline::new(&gpu, &probe::PROGRAM, &[]).unwrap();
    (device.frames())
        .run(|rec| {
            rec.pass("look up", |rec| {
                let bindings = probe::Bindings { rays: &source, found: &found, table: tables.scattering.sampled() };
                let count = rays.len() as u32;
                rec.dispatch(&pipeline, &bindings, &count, [count, 1, 1])?;
                rec.copy_buffer(&found, &readback, found.size());
                rec.make_visible_to_host(&readback);
                Ok(())
            })
        })
        .unwrap();
    let found: Vec<[f32; 2]> = readback.read(0, rays.len());
    let (mut single, mut multiple) = (Vec::new(), Vec::new());
    for ((c, r), found) in rays.iter().zip(&found) {
        let opacity = opacity(2.0 * r * c.mu);
        single.push((f64::from(found[0]) * opacity, lookup.single(c, *r)));
        multiple.push((f64::from(found[1]) * opacity, lookup.multiple(c, *r)));
    }
    // f32 coordinates, whose error the closed-form model multiplies by the optical radius; texture filters of 8 bits.
    for (name, pairs) in [("single", single), ("multiple", multiple)] {
        let (rms, bias) = errors(&pairs);
        println!("{name}: rms {:.3} %, bias {:.4} %", 100.0 * rms, 100.0 * bias);
        assert!(rms < 0.003 && bias.abs() < 3e-4, "{name}: {rms} {bias}");
    }
    assert_eq!(device.messages().unwrap().all(), Vec::<String>::new());
}

#[test]
fn optical_depth_is_the_mean_density_of_each_style() {
    let mut device = open();
    let shape = OpticalDepthShape::COARSE;
    for style in [Style::Homogeneous, Style::Pyroclastic, Style::Radial, Style::Threshold] {
        let table = welkin::lut::OpticalDepthTable::new(device.gpu(), shape).unwrap();
        device.frames().run(|rec| table.record(rec, style)).unwrap();
        let values = welkin::lut::read_image(device.frames(), table.image()).unwrap();
        let mut state = 3;
        let mut square: f64 = 0.0;
        for _ in 0..400 {
            let mut pick = |n: u32| (next_uniform(&mut state) * f64::from(n)) as u32;
            let (i, j, k, l) = (pick(shape.phi_s), pick(shape.theta), pick(shape.phi_v), pick(shape.theta - 1));
            let (phi_s, phi_v) =
                (OpticalDepthShape::azimuth(i, shape.phi_s), OpticalDepthShape::azimuth(k, shape.phi_v));
            let ((st, ct), (sp, cp)) = (shape.theta_s(j).sin_cos(), phi_s.sin_cos());
            let entry = DVec3::new(st * cp, ct, st * sp);
            let (e_theta, e_phi) = (DVec3::new(ct * cp, -st, ct * sp), DVec3::new(-sp, 0.0, cp));
            let (sv, cv) = shape.theta_v(l).sin_cos();
            let dir = -cv * entry + sv * (phi_v.cos() * e_theta + phi_v.sin() * e_phi);
            let [x, y, _] = shape.image_extent();
            let value = values[((k * y + l * shape.theta + j) * x + i) as usize];
            let truth = mean_density(entry, dir, style, REFERENCE_SEED, 256);
            square += (f64::from(value[0]) - truth).powi(2) / 400.0;
            assert!((0.0..=1.0).contains(&value[1]) && (0.0..=1.001).contains(&value[0]));
        }
        // The coarse table samples density on 48³ points, whose cell is 1/24 of the radius; edges blur over one cell.
        assert!(square.sqrt() < 0.02, "{style:?}: rms {}", square.sqrt());
    }
    assert_eq!(device.messages().unwrap().all(), Vec::<String>::new());
}

#[test]
fn tables_are_built_once_and_rebuilt_when_damaged() {
    let mut device = open();
    let directory = scratch("cache");
    let params = params(Detail::Coarse, Style::Radial);
    let mut load = |cache: &PathBuf| {
        let mut calls = 0;
        let progress = &mut |_| {
            calls += 1;
            ControlFlow::Continue(())
        };
        let tables = Tables::load_or_build(device.frames(), &params, Some(cache), progress).unwrap().unwrap();
        let scattering = tables.read_scattering(device.frames()).unwrap();
        (tables.built(), tables.warnings().len(), calls, scattering, tables.reports().to_vec())
    };
    assert!(!Tables::cached(&params, &directory));
    let first = load(&directory);
    assert!(first.0 && first.1 == 0 && first.2 > 0);
    assert!(Tables::cached(&params, &directory));
    let second = load(&directory);
    assert!(!second.0 && second.1 == 0 && second.2 == 0, "built again");
    assert_eq!((&first.3, &first.4), (&second.3, &second.4));
    let file = directory.join(params.scattering_file());
    let mut bytes = std::fs::read(&file).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 4;
    std::fs::write(&file, bytes).unwrap();
    let third = load(&directory);
    assert!(third.0 && third.1 == 1, "damage was not noticed");
    assert_eq!(first.3, third.3, "the same parameters gave another table");
    assert_eq!(load(&directory).1, 0);
    assert_eq!(std::fs::read_dir(&directory).unwrap().count(), 2);

    // A cache that cannot be written is no error.
    let blocked = directory.join("file");
    std::fs::write(&blocked, b"").unwrap();
    let unwritable = load(&blocked);
    assert!(unwritable.0 && unwritable.1 >= 2);
    std::fs::remove_dir_all(directory).unwrap();
}

#[test]
fn a_build_that_is_stopped_leaves_the_cache_as_it_was() {
    let mut device = open();
    let directory = scratch("stopped");
    let params = params(Detail::Coarse, Style::Homogeneous);
    let mut calls = 0;
    let tables = Tables::load_or_build(device.frames(), &params, Some(&directory), &mut |_| {
        calls += 1;
        if calls > 4 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert!(tables.unwrap().is_none());
    assert!(!directory.join(params.scattering_file()).exists());
    let left: Vec<_> = std::fs::read_dir(&directory).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(left, [std::ffi::OsString::from(params.optical_depth_file())]);
    std::fs::remove_dir_all(directory).unwrap();
}
