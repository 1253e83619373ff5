//! The clear air on the device against its f64 oracle: tables, light, background, and the air in front of clouds.

use glam::DVec3;
use half::f16;
use std::f64::consts::PI;
use welkin::atmosphere::{Air, Atmosphere, Background, CloudShadow, SkyLight};
use welkin::blend::{CloudTargets, NO_CLOUD};
use welkin::gpu::standalone::{Options, Standalone};
use welkin::gpu::{Buffer, BufferKind, Image};
use welkin::params::{Precision, SkyModel};
use welkin::reference::atmosphere::{
    AirTables, TRANSMITTANCE_STEPS, direction_from_sky_view, exp_minus, from_texel, mie_phase, nu_from_azimuth,
    point_from_multiple, ray_from_aerial, ray_from_transmittance, sky_view_texel,
};
use welkin::shared::FrameParams;

/// Rounding of an f16 table entry is 2⁻¹¹; its inputs are f16 tables too, and f32 rounding of a long sum adds as much.
const RELATIVE: f64 = 4e-3;

const EXTENT: [u32; 2] = [96, 54];

struct Setup {
    device: Standalone,
    atmosphere: Atmosphere,
    frame: Buffer,
    params: FrameParams,
    altitude: f64,
    mu_s: f64,
}

fn frame_params(altitude: f32, pitch: f32, sun_elevation: f32, sun_azimuth: f32) -> FrameParams {
    let (sin, cos) = pitch.to_radians().sin_cos();
    let (e, a) = (sun_elevation.to_radians(), sun_azimuth.to_radians());
    let mut frame: FrameParams = bytemuck::Zeroable::zeroed();
    (frame.camera, frame.origin) = ([321.5, altitude, -40.25], [-71_680.0, 0.0, 1_024_000.0]);
    (frame.tan_half_fov_y, frame.aspect) = (30f32.to_radians().tan(), EXTENT[0] as f32 / EXTENT[1] as f32);
    (frame.right, frame.up, frame.forward) = ([1.0, 0.0, 0.0], [0.0, cos, sin], [0.0, sin, -cos]);
    (frame.width, frame.height) = (EXTENT[0], EXTENT[1]);
    (frame.low_width, frame.low_height) = (EXTENT[0], EXTENT[1]);
    frame.to_sun = [e.cos() * a.sin(), e.sin(), -e.cos() * a.cos()];
    frame
}

impl Setup {
    fn new(model: SkyModel, altitude: f32, pitch: f32, sun_elevation: f32) -> Self {
        let device = Standalone::new(Options { validation: true, ..Options::default() }).unwrap();
        let params = frame_params(altitude, pitch, sun_elevation, 40.0);
        Self {
            atmosphere: Atmosphere::new(device.gpu(), model, &Air::default()).unwrap(),
            frame: Buffer::upload(device.gpu(), "frame", &[params]).unwrap(),
            altitude: f64::from(altitude),
            mu_s: f64::from(params.to_sun[1]),
            params,
            device,
        }
    }

    fn fill(&mut self, cloud_altitude: f32) {
        let no_shadow = CloudShadow::new(self.device.gpu()).unwrap();
        self.fill_under(&no_shadow, cloud_altitude);
    }

    fn fill_under(&mut self, shadow: &CloudShadow, cloud_altitude: f32) {
        let (atmosphere, frame, params) = (&mut self.atmosphere, &self.frame, &self.params);
        self.device.frames().run(|rec| atmosphere.record_luts(rec, frame, params, shadow, cloud_altitude)).unwrap();
    }

    fn view(&self, x: u32, y: u32) -> DVec3 {
        let f = &self.params;
        let v = |a: [f32; 3]| DVec3::from_array(a.map(f64::from));
        let ndc = |p: u32, n: u32| 2.0 * (f64::from(p) + 0.5) / f64::from(n) - 1.0;
        let t = f64::from(f.tan_half_fov_y);
        let right = v(f.right) * (t * f64::from(f.aspect) * ndc(x, EXTENT[0]));
        (v(f.forward) + right - v(f.up) * (t * ndc(y, EXTENT[1]))).normalize()
    }

    fn nu(&self, view: DVec3) -> f64 {
        view.dot(DVec3::from_array(self.params.to_sun.map(f64::from)))
    }

    fn silent(&self) {
        assert_eq!(self.device.messages().unwrap().all(), Vec::<String>::new());
    }
}

fn bytes(device: &mut Standalone, image: &Image, texel: u64) -> (Buffer, usize) {
    let count = image.extent().iter().product::<u32>();
    let readback = Buffer::new(device.gpu(), "readback", u64::from(count) * texel, BufferKind::Readback).unwrap();
    device
        .frames()
        .run(|rec| {
            rec.copy_image_to_buffer(image, &readback);
            rec.make_visible_to_host(&readback);
            Ok(())
        })
        .unwrap();
    (readback, count as usize)
}

/// Texels of an rgba16f image.
fn halves(device: &mut Standalone, image: &Image) -> Vec<DVec3> {
    let (buffer, count) = bytes(device, image, 8);
    buffer.read::<[f16; 4]>(0, count).iter().map(|t| DVec3::new(t[0].into(), t[1].into(), t[2].into())).collect()
}

fn floats(device: &mut Standalone, image: &Image, channels: usize) -> Vec<f32> {
    let (buffer, count) = bytes(device, image, 4 * channels as u64);
    buffer.read::<f32>(0, count * channels)
}

/// `least`: below this a value may be off by as much as `relative` of it.
#[track_caller]
fn close(got: DVec3, expected: DVec3, relative: f64, least: f64, what: &str) {
    let bound = (expected.abs() + DVec3::splat(least)) * relative;
    assert!((got - expected).abs().cmple(bound).all(), "{what}: {got} and {expected}");
}

fn size2(image: &Image) -> [usize; 2] {
    let [w, h, _] = image.extent().map(|n| n as usize);
    [w, h]
}

#[test]
fn tables_follow_the_oracle() {
    let mut s = Setup::new(SkyModel::Atmosphere, 1200.0, 5.0, 25.0);
    s.fill(2000.0);
    let air = Air::default();
    let [tw, th] = size2(&s.atmosphere.transmittance);
    let oracle = AirTables::new(air, [tw, th], size2(&s.atmosphere.multiple));

    let got = halves(&mut s.device, &s.atmosphere.transmittance);
    for (i, got) in got.iter().enumerate() {
        let (h, mu) = ray_from_transmittance(&air, [from_texel(i % tw, tw), from_texel(i / tw, th)]);
        // At the top of the atmosphere f32 cannot tell the direction of a ray of no length, and its transmittance is 1.
        close(*got, air.transmittance(h, mu, TRANSMITTANCE_STEPS), RELATIVE, 0.05, "transmittance");
    }
    let size = size2(&s.atmosphere.multiple);
    let got = halves(&mut s.device, &s.atmosphere.multiple);
    for (i, got) in got.iter().enumerate() {
        let (h, mu_s) = point_from_multiple(&air, [from_texel(i % size[0], size[0]), from_texel(i / size[0], size[1])]);
        // The sun's edge at the horizon is 0.005 rad wide: f32 angles move it by up to a tenth of a percent of a step.
        close(*got, oracle.compute_multiple(h, mu_s), 2.0 * RELATIVE, 1e-3, "multiple scattering");
    }
    let size = size2(&s.atmosphere.sky_view_smooth);
    let smooth = halves(&mut s.device, &s.atmosphere.sky_view_smooth);
    let aerosol = halves(&mut s.device, &s.atmosphere.sky_view_aerosol);
    for i in (0..smooth.len()).step_by(7) {
        let (x, y) = (i % size[0], i / size[0]);
        let expected = oracle.sky_view_texel(s.altitude, s.mu_s, x, y, size);
        close(smooth[i], expected.smooth_part, 2.0 * RELATIVE, 1e-4, "sky view, smooth");
        close(aerosol[i], expected.aerosol, 2.0 * RELATIVE, 1e-3, "sky view, aerosol");
    }
    let size = s.atmosphere.aerial_smooth.extent().map(|n| n as usize);
    let smooth = halves(&mut s.device, &s.atmosphere.aerial_smooth);
    let aerosol = halves(&mut s.device, &s.atmosphere.aerial_aerosol);
    let extinction = halves(&mut s.device, &s.atmosphere.aerial_extinction);
    for y in (0..size[1]).step_by(5) {
        for x in (0..size[0]).step_by(6) {
            for (z, expected) in oracle.aerial_column(s.altitude, s.mu_s, x, y, size).iter().enumerate() {
                let i = (z * size[1] + y) * size[0] + x;
                close(smooth[i], expected.smooth_part, 2.0 * RELATIVE, 1e-4, "aerial perspective, smooth");
                close(aerosol[i], expected.aerosol, 2.0 * RELATIVE, 1e-4, "aerial perspective, aerosol");
                close(extinction[z * size[1] + y], expected.optical_depth, 2.0 * RELATIVE, 1e-4, "aerial extinction");
            }
        }
    }
    s.silent();
}

#[test]
fn light_on_clouds_and_ground_follows_the_oracle() {
    let mut s = Setup::new(SkyModel::Atmosphere, 1200.0, 5.0, 25.0);
    let air = Air::default();
    let cloud_altitude = 2500.0;
    s.fill(cloud_altitude);
    let oracle = AirTables::new(air, size2(&s.atmosphere.transmittance), size2(&s.atmosphere.multiple));
    let readback = Buffer::new(s.device.gpu(), "light", size_of::<SkyLight>() as u64, BufferKind::Readback).unwrap();
    let light = s.atmosphere.sky_light();
    s.device
        .frames()
        .run(|rec| {
            rec.copy_buffer(light, &readback, size_of::<SkyLight>() as u64);
            rec.make_visible_to_host(&readback);
            Ok(())
        })
        .unwrap();
    let got = readback.read::<SkyLight>(0, 1)[0];
    let solar = DVec3::from_array(air.solar_irradiance);
    let check = |got: [f32; 3], expected: DVec3, what| {
        close(DVec3::from_array(got.map(f64::from)), expected * solar, 2.0 * RELATIVE, 0.0, what);
    };
    let h = f64::from(cloud_altitude);
    let sky = oracle.horizontal_irradiance(0.0, s.mu_s, true, DVec3::ZERO);
    let ground = DVec3::from_array(air.ground_albedo) / PI * (oracle.to_sun(0.0, s.mu_s) * s.mu_s + sky);
    check(got.sun_irradiance_clouds, oracle.to_sun(h, s.mu_s), "sun at the clouds");
    check(got.sun_irradiance_ground, oracle.to_sun(0.0, s.mu_s), "sun at the ground");
    check(got.sky_irradiance_ground, sky, "sky at the ground");
    check(got.sky_irradiance_clouds, oracle.horizontal_irradiance(h, s.mu_s, true, DVec3::ZERO), "sky at the clouds");
    check(got.ground_irradiance_clouds, oracle.horizontal_irradiance(h, s.mu_s, false, ground), "from below");
    s.silent();
}

#[test]
fn sky_and_ground_distance_follow_the_oracle() {
    for (altitude, pitch, sun) in [(2.0, 10.0, 40.0), (4000.0, -8.0, 3.0), (20e3, -3.0, 60.0)] {
        let mut s = Setup::new(SkyModel::Atmosphere, altitude, pitch, sun);
        s.fill(2000.0);
        let gpu = s.device.gpu().clone();
        let background = Background::new(&gpu, SkyModel::Atmosphere, EXTENT, 2, Precision::F32).unwrap();
        let shadow = CloudShadow::new(&gpu).unwrap();
        let (atmosphere, frame) = (&s.atmosphere, &s.frame);
        s.device
            .frames()
            .run(|rec| {
                background.record_opaque(rec, atmosphere, frame)?;
                background.record(rec, atmosphere, frame, &shadow, 1500.0)
            })
            .unwrap();
        let air = Air::default();
        let oracle = AirTables::new(air, size2(&s.atmosphere.transmittance), size2(&s.atmosphere.multiple));
        let distance = floats(&mut s.device, &background.opaque_distance, 1);
        let low = floats(&mut s.device, &background.low_opaque, 1);
        let radiance = floats(&mut s.device, &background.radiance, 4);
        let pixel_angle = 2.0 * f64::from(s.params.tan_half_fov_y) / f64::from(EXTENT[1]);
        for y in 0..EXTENT[1] {
            for x in (0..EXTENT[0]).step_by(5) {
                let view = s.view(x, y);
                let i = (y * EXTENT[0] + x) as usize;
                let above = view.y.asin() - air.horizon_mu(s.altitude).asin();
                if above.abs() < pixel_angle {
                    continue; // the pixel holds both
                }
                if above < 0.0 {
                    let expected = air.distance_to_ground(s.altitude, view.y);
                    // The ray's elevation is known to 1e-7 rad; far away a small angle is a long way.
                    let grazing = (-view.y).max(1e-3);
                    let bound = expected * (1e-5 + 1e-6 / grazing);
                    assert!((f64::from(distance[i]) - expected).abs() < bound, "{} and {expected}", distance[i]);
                } else {
                    assert_eq!(distance[i], NO_CLOUD);
                    let nu = s.nu(view);
                    if nu.min(1.0).acos() < air.sun_angular_radius + pixel_angle {
                        continue; // the disc
                    }
                    let light = oracle.airlight(s.altitude, view.y, s.mu_s, nu, false, 400);
                    let expected = air.airlight_radiance(light.smooth_part, light.aerosol, nu);
                    let got =
                        DVec3::new(radiance[4 * i].into(), radiance[4 * i + 1].into(), radiance[4 * i + 2].into());
                    // Bilinear interpolation of 64 azimuths × 96 elevations and 40 steps against the integral itself.
                    close(got, expected, 0.03, 1e-3, &format!("sky at ({x}, {y})"));
                }
            }
        }
        // Every low texel is one of the four it stands for.
        for y in 0..EXTENT[1] / 2 {
            for x in 0..EXTENT[0] / 2 {
                let four = [(0, 0), (1, 0), (0, 1), (1, 1)]
                    .map(|(i, j)| distance[((2 * y + j) * EXTENT[0] + 2 * x + i) as usize]);
                let wanted = if (x + y) % 2 == 0 {
                    four.iter().copied().fold(f32::MAX, f32::min)
                } else {
                    four.iter().copied().fold(0.0, f32::max)
                };
                assert_eq!(low[(y * EXTENT[0] / 2 + x) as usize], wanted);
            }
        }
        s.silent();
    }
}

#[test]
fn the_air_in_front_of_clouds_follows_the_oracle() {
    let mut s = Setup::new(SkyModel::Atmosphere, 600.0, 12.0, 15.0);
    s.fill(2000.0);
    let gpu = s.device.gpu().clone();
    let air = Air::default();
    let oracle = AirTables::new(air, size2(&s.atmosphere.transmittance), size2(&s.atmosphere.multiple));
    let background = Background::new(&gpu, SkyModel::Atmosphere, EXTENT, 1, Precision::F32).unwrap();
    let targets = CloudTargets::new(&gpu, EXTENT, Precision::F32).unwrap();
    let no_shadow = CloudShadow::new(&gpu).unwrap();
    let (cloud, transmittance) = (DVec3::new(0.4, 0.5, 0.6), 0.25);
    for distance in [10.0f32, 800.0, 5e3, 33e3, 110e3] {
        let (atmosphere, frame) = (&s.atmosphere, &s.frame);
        let mut image = None;
        s.device
            .frames()
            .run(|rec| {
                rec.clear_image(&targets.cloud, [0.4, 0.5, 0.6, transmittance]);
                rec.clear_image(&targets.nearest, [distance; 4]);
                background.record(rec, atmosphere, frame, &no_shadow, 1500.0)?;
                image = Some(background.record_cloud_air(rec, atmosphere, frame, &targets, 1500.0)?);
                Ok(())
            })
            .unwrap();
        let got = floats(&mut s.device, image.unwrap(), 4);
        for (x, y) in [(3, 2), (40, 20), (47, 30), (80, 40), (10, 50)] {
            let view = s.view(x, y);
            let nu = s.nu(view);
            let mut light = welkin::reference::atmosphere::Airlight::default();
            let d = f64::from(distance);
            for k in 0..500 {
                let part = |k: i32| d * f64::from(k) / 500.0;
                oracle.step(s.altitude, view.y, s.mu_s, nu, part(k), part(k + 1), &mut light);
            }
            let airlight = light.smooth_part + light.aerosol * mie_phase(nu, air.mie_g);
            let airlight = DVec3::from_array(air.solar_irradiance) * airlight;
            let expected = cloud * exp_minus(light.optical_depth) + airlight * (1.0 - f64::from(transmittance));
            let i = 4 * (y * EXTENT[0] + x) as usize;
            let rgb = DVec3::new(got[i].into(), got[i + 1].into(), got[i + 2].into());
            // Interpolation in 32 × 65 × 32 texels with 2 steps between distances.
            close(rgb, expected, 0.02, 0.0, &format!("cloud at {distance} m in pixel ({x}, {y})"));
            assert_eq!(got[i + 3], transmittance);
        }
    }
    s.silent();
}

#[test]
fn shadow_takes_the_sunlit_air_below_the_clouds_away() {
    let mut s = Setup::new(SkyModel::Atmosphere, 600.0, 12.0, 15.0);
    let base = 1500.0f32;
    s.fill(base);
    let gpu = s.device.gpu().clone();
    let air = Air::default();
    let oracle = AirTables::new(air, size2(&s.atmosphere.transmittance), size2(&s.atmosphere.multiple));
    let background = Background::new(&gpu, SkyModel::Atmosphere, EXTENT, 1, Precision::F32).unwrap();
    let mut shadow = CloudShadow::new(&gpu).unwrap();
    let mut pictures = Vec::new();
    for transmittance in [1.0, 0.0] {
        let (atmosphere, frame, camera) = (&s.atmosphere, &s.frame, s.params.camera);
        s.device
            .frames()
            .run(|rec| {
                shadow.record_uniform(rec, transmittance, camera);
                background.record_opaque(rec, atmosphere, frame)?;
                background.record(rec, atmosphere, frame, &shadow, base)
            })
            .unwrap();
        pictures.push(floats(&mut s.device, &background.radiance, 4));
    }
    let (mut checked, through) = (0, 0.23); // CLOUD_DIFFUSE_TRANSMITTANCE
    for (x, y) in [(3, 2), (40, 10), (47, 20), (80, 5), (90, 25)] {
        let view = s.view(x, y);
        let nu = s.nu(view);
        assert!(view.y > 0.02, "a ray that leaves the shadow through the base of the clouds");
        // Where the ray reaches the base: the farther root of a sphere around the planet's centre.
        let (r, r_base) = (air.bottom_radius + s.altitude, air.bottom_radius + f64::from(base));
        let length = -r * view.y + (r_base * r_base - r * r * (1.0 - view.y * view.y)).sqrt();
        if length > 40e3 {
            continue; // the map ends
        }
        let mut light = welkin::reference::atmosphere::Airlight::default();
        for k in 0..800 {
            let part = |k: i32| length * f64::from(k) / 800.0;
            oracle.step(s.altitude, view.y, s.mu_s, nu, part(k), part(k + 1), &mut light);
        }
        let lost = light.smooth_part * (0.5 * (1.0 - through))
            + light.aerosol * (mie_phase(nu, air.mie_g) - through / (4.0 * PI)).max(0.0);
        let i = 4 * (y * EXTENT[0] + x) as usize;
        let at = |picture: &[f32]| DVec3::new(picture[i].into(), picture[i + 1].into(), picture[i + 2].into());
        let got = at(&pictures[0]) - at(&pictures[1]);
        // Interpolation in 64 × 192 texels, near the horizon in rays whose length changes quickly.
        close(got, lost * DVec3::from_array(air.solar_irradiance), 0.05, 1e-3, &format!("loss at ({x}, {y})"));
        checked += 1;
    }
    assert!(checked >= 3);
    s.silent();
}

#[test]
fn without_a_sky_all_is_black_and_clouds_are_untouched() {
    let mut s = Setup::new(SkyModel::None, 600.0, -12.0, 15.0);
    s.fill(2000.0);
    let gpu = s.device.gpu().clone();
    let background = Background::new(&gpu, SkyModel::None, EXTENT, 2, Precision::F32).unwrap();
    let targets = CloudTargets::new(&gpu, EXTENT.map(|n| n / 2), Precision::F32).unwrap();
    let shadow = CloudShadow::new(&gpu).unwrap();
    let readback = Buffer::new(&gpu, "light", size_of::<SkyLight>() as u64, BufferKind::Readback).unwrap();
    let (atmosphere, frame) = (&s.atmosphere, &s.frame);
    s.device
        .frames()
        .run(|rec| {
            background.record_opaque(rec, atmosphere, frame)?;
            background.record(rec, atmosphere, frame, &shadow, 1500.0)?;
            let cloud = background.record_cloud_air(rec, atmosphere, frame, &targets, 1500.0)?;
            assert!(std::ptr::eq(cloud, &targets.cloud));
            rec.copy_buffer(atmosphere.sky_light(), &readback, size_of::<SkyLight>() as u64);
            rec.make_visible_to_host(&readback);
            Ok(())
        })
        .unwrap();
    let light = readback.read::<SkyLight>(0, 1)[0];
    assert_eq!(light.sun_irradiance_clouds, Air::default().solar_irradiance.map(|c| c as f32));
    assert_eq!((light.sky_irradiance_clouds, light.ground_irradiance_clouds), ([0.0; 3], [0.0; 3]));
    assert!(floats(&mut s.device, &background.opaque_distance, 1).iter().all(|d| *d == NO_CLOUD));
    assert!(floats(&mut s.device, &background.low_opaque, 1).iter().all(|d| *d == NO_CLOUD));
    assert!(floats(&mut s.device, &background.radiance, 4).chunks(4).all(|c| c[..3] == [0.0; 3]));
    s.silent();
}

#[test]
fn the_sampled_texels_span_the_sky_and_the_range_of_distance() {
    // A guard for the tests above: their directions really cover both halves of the sky and the whole range of distance.
    let air = Air::default();
    let size = [64, 192];
    let (u, ground) = sky_view_texel(0, 0, size);
    assert!(ground && direction_from_sky_view(&air, 1200.0, u, ground).0 < -0.999);
    let (u, ground) = sky_view_texel(63, 191, size);
    let (mu, azimuth) = direction_from_sky_view(&air, 1200.0, u, ground);
    assert!(!ground && mu > 0.999 && azimuth > 0.999 * PI);
    assert_eq!(ray_from_aerial([1.0, 0.5, 1.0]).2, 160e3);
    assert!((nu_from_azimuth(0.6, 0.6, 0.0) - 1.0).abs() < 1e-12);
}
