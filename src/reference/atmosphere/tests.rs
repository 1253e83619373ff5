//! Physics of the clear air, on the CPU: closed forms, conservation, and what a sky has to look like.

use super::*;

fn tables() -> AirTables {
    AirTables::new(Air::default(), [256, 64], [32, 32])
}

#[test]
fn phase_functions_are_normalised_and_point_forward() {
    let n = 20_000;
    for g in [0.0, 0.5, 0.8] {
        let (mut sum, mut mean_cosine) = (0.0, 0.0);
        for i in 0..n {
            let nu = -1.0 + 2.0 * (i as f64 + 0.5) / n as f64;
            sum += mie_phase(nu, g) * 2.0 * PI * 2.0 / n as f64;
            mean_cosine += nu * mie_phase(nu, g) * 2.0 * PI * 2.0 / n as f64;
        }
        assert!((sum - 1.0).abs() < 1e-5, "Cornette–Shanks, g = {g}: {sum}");
        // Mean cosine of Cornette–Shanks: 3g(4 + g²) / (5(2 + g²)).
        assert!((mean_cosine - 3.0 * g * (4.0 + g * g) / (5.0 * (2.0 + g * g))).abs() < 1e-4, "g = {g}: {mean_cosine}");
    }
    let rayleigh: f64 =
        (0..n).map(|i| rayleigh_phase(-1.0 + 2.0 * (i as f64 + 0.5) / n as f64) * 4.0 * PI / n as f64).sum();
    assert!((rayleigh - 1.0).abs() < 1e-6, "{rayleigh}");
}

#[test]
fn distances_agree_with_points_in_space() {
    let air = Air::default();
    for h in [0.0, 2.0, 1500.0, 20e3, 99e3] {
        for i in 0..=40 {
            let mu = -1.0 + i as f64 / 20.0;
            let origin = DVec3::new(0.0, air.bottom_radius + h, 0.0);
            let ray = DVec3::new((1.0 - mu * mu).sqrt(), mu, 0.0);
            let top = origin + ray * air.distance_to_top(h, mu);
            if !air.hits_ground(h, mu) || mu >= 0.0 {
                assert!((top.length() - air.bottom_radius - air.top_height).abs() < 1e-3, "h {h} mu {mu}");
            } else {
                let ground = origin + ray * air.distance_to_ground(h, mu);
                assert!((ground.length() - air.bottom_radius).abs() < 1e-3, "h {h} mu {mu}");
            }
            let d = 12_345.0;
            let p = origin + ray * d;
            let h_d = air.altitude_along(h, mu, d);
            assert!((p.length() - air.bottom_radius - h_d).abs() < 1e-6);
            assert!((p.normalize().dot(ray) - air.mu_along(h, mu, 1.0, h_d, d)).abs() < 1e-12);
        }
    }
}

#[test]
fn mappings_and_their_inverses_agree_at_every_texel() {
    let air = Air::default();
    let near = |a: f64, b: f64, what: &str| assert!((a - b).abs() < 1e-7, "{what}: {a} and {b}");
    for y in 0..64 {
        for x in 0..256 {
            let u = [from_texel(x, 256), from_texel(y, 64)];
            let (h, mu) = ray_from_transmittance(&air, u);
            let back = transmittance_from_ray(&air, h, mu);
            near(u[1], back[1], "altitude of the transmittance table");
            // At the top of the atmosphere d is 0 for every direction of the upper hemisphere.
            if y < 63 {
                near(u[0], back[0], "direction of the transmittance table");
            }
        }
    }
    for y in 0..32 {
        for x in 0..32 {
            let u = [from_texel(x, 32), from_texel(y, 32)];
            let (h, mu_s) = point_from_multiple(&air, u);
            let back = multiple_from_point(&air, h, mu_s);
            near(u[0], back[0], "sun of the multiple-scattering table");
            near(u[1], back[1], "altitude of the multiple-scattering table");
        }
    }
    for h in [2.0, 500.0, 12e3] {
        let size = [96, 128];
        for y in 0..size[1] {
            for x in 0..size[0] {
                let (u, ground) = sky_view_texel(x, y, size);
                let (mu, azimuth) = direction_from_sky_view(&air, h, u, ground);
                let (back, ground_back) = sky_view_from_direction(&air, h, mu, azimuth);
                assert_eq!(ground, ground_back, "row {y} changed sides of the horizon");
                near(u[0], back[0], "azimuth of the sky view");
                // The angle's square root magnifies the 1e-7 by which a grazing row is kept on its side.
                assert!((u[1] - back[1]).abs() < 2e-3, "row {y} of the sky view: {} and {}", u[1], back[1]);
            }
        }
    }
    for z in 0..32 {
        for y in 0..65 {
            let u = [from_texel(y, 65), from_texel(y, 65), from_texel(z, 32)];
            let (mu, azimuth, distance) = ray_from_aerial(u);
            let back = aerial_from_ray(mu, azimuth, distance);
            for i in 0..3 {
                near(u[i], back[i], "aerial perspective");
            }
        }
    }
}

#[test]
fn transmittance_is_multiplicative_and_converged() {
    let air = Air::default();
    for (h, mu) in [(0.0, 1.0), (0.0, 0.2), (0.0, 0.02), (3000.0, 0.5), (8000.0, -0.03)] {
        let coarse = air.transmittance(h, mu, TRANSMITTANCE_STEPS);
        let fine = air.transmittance(h, mu, 20 * TRANSMITTANCE_STEPS);
        // The midpoint rule with 48 quadratic steps.
        assert!((coarse - fine).abs().max_element() < 2e-3, "h {h} mu {mu}: {coarse} and {fine}");
        // T(a, c) = T(a, b)·T(b, c).
        let d = 30e3;
        let h_b = air.altitude_along(h, mu, d);
        let mu_b = air.mu_along(h, mu, 1.0, h_b, d);
        let steps = 4000;
        let a_to_b: DVec3 = (0..steps)
            .map(|i| {
                air.at(air.altitude_along(h, mu, (i as f64 + 0.5) * d / steps as f64)).extinction * d / steps as f64
            })
            .sum();
        let product = exp_minus(a_to_b) * air.transmittance(h_b, mu_b, 20 * TRANSMITTANCE_STEPS);
        assert!((product - fine).abs().max_element() < 1e-4, "h {h} mu {mu}: {product} and {fine}");
    }
    // Straight up through exponential air is a closed form: σH, less what lies above the top.
    let air = Air { ozone_absorption: [0.0; 3], mie_scattering: [0.0; 3], mie_extinction: [0.0; 3], ..air };
    let tau = air.rayleigh_scattering[2] * 8000.0 * (1.0 - (-100.0f64 / 8.0).exp());
    let up = air.transmittance(0.0, 1.0, 20 * TRANSMITTANCE_STEPS).z;
    assert!((up - (-tau).exp()).abs() < 1e-5, "{up} and {}", (-tau).exp());
}

#[test]
fn table_lookups_follow_the_integrals_between_texels() {
    let t = tables();
    for i in 0..200 {
        let f = (i as f64 * 0.618_034).fract();
        let h = 60e3 * f * f;
        let mu = t.air.horizon_mu(h) + (1.0 - t.air.horizon_mu(h)) * (i as f64 / 199.0).powi(2);
        let (table, integral) = (t.to_top(h, mu), t.air.transmittance(h, mu, 1000));
        // Interpolation error of 256×64 texels.
        assert!((table - integral).abs().max_element() < 6e-3, "h {h} mu {mu}: {table} and {integral}");
    }
    for (h, mu_s) in [(10.0, 0.3), (1500.0, 0.8), (5000.0, 0.05), (15e3, 0.55)] {
        let (table, computed) = (t.multiple_radiance(h, mu_s), t.compute_multiple(h, mu_s));
        // Interpolation error of 32×32 texels.
        assert!(((table - computed) / computed).abs().max_element() < 0.03, "h {h} mu_s {mu_s}: {table} {computed}");
    }
}

#[test]
fn airlight_converges_and_does_not_create_energy() {
    let t = tables();
    for (h, mu, mu_s, azimuth) in
        [(2.0, 0.03, 0.5, 2.0), (500.0, 0.3, 0.1, 1.0), (4000.0, -0.3, 0.7, 0.5), (2.0, 1.0, 0.6, 0.0)]
    {
        let nu = nu_from_azimuth(mu, mu_s, azimuth);
        let ground = t.air.hits_ground(h, mu);
        let coarse = t.airlight(h, mu, mu_s, nu, ground, SKY_VIEW_STEPS);
        let fine = t.airlight(h, mu, mu_s, nu, ground, 20 * SKY_VIEW_STEPS);
        let radiance = |l: &Airlight| t.air.airlight_radiance(l.smooth_part, l.aerosol, nu);
        // 40 quadratic steps, whose source is taken at the midpoint.
        assert!(((radiance(&coarse) - radiance(&fine)) / radiance(&fine)).abs().max_element() < 0.02, "mu {mu}");
    }
    // All light on level ground, direct and from the sky, cannot exceed what arrives outside (plane-parallel air gives
    // a little back by reflection from the ground, which stays below its albedo).
    for mu_s in [0.2f64, 0.5, 0.9] {
        let sky = t.horizontal_irradiance(0.0, mu_s, true, DVec3::ZERO);
        let total = sky + t.to_sun(0.0, mu_s) * mu_s;
        assert!(total.max_element() < mu_s * 1.03, "sun at {mu_s}: {total}");
        assert!(total.min_element() > mu_s * 0.55, "sun at {mu_s}: {total}");
    }
}

#[test]
fn the_sky_is_blue_overhead_pale_at_the_horizon_and_red_at_sunset() {
    let t = tables();
    let look = |mu: f64, mu_s: f64, azimuth: f64| {
        let nu = nu_from_azimuth(mu, mu_s, azimuth);
        let light = t.airlight(2.0, mu, mu_s, nu, false, 200);
        t.air.airlight_radiance(light.smooth_part, light.aerosol, nu)
    };
    let high = 50f64.to_radians().sin();
    let (zenith, horizon) = (look(1.0, high, PI), look(0.02, high, PI));
    assert!(zenith.z > 2.5 * zenith.x, "zenith {zenith}");
    assert!(horizon.z / horizon.x < 0.6 * zenith.z / zenith.x && horizon.y > 3.0 * zenith.y, "horizon {horizon}");
    let sunset = look(0.02, 1f64.to_radians().sin(), 0.1);
    assert!(sunset.x > 2.0 * sunset.z, "sunset {sunset}");
    let sun = t.to_sun(2.0, 2f64.to_radians().sin());
    assert!(sun.x > 5.0 * sun.z, "low sun {sun}");
    // The planet's shadow: well after sunset the ground gets no direct light, and the sky has dimmed a thousandfold.
    let night = look(1.0, -(9f64.to_radians().sin()), 0.0);
    assert!(t.to_sun(0.0, -0.01) == DVec3::ZERO && night.max_element() < 1e-3 * zenith.z, "night {night}");
}

#[test]
fn the_sun_disc_carries_the_solar_irradiance() {
    let air = Air::default();
    let n = 2000;
    let irradiance: DVec3 = (0..n)
        .map(|i| {
            let x = (i as f64 + 0.5) / n as f64;
            air.sun_disc_radiance(x * air.sun_angular_radius) * 2.0 * PI * x * air.sun_angular_radius.powi(2) / n as f64
        })
        .sum();
    assert!(
        (irradiance / DVec3::from_array(air.solar_irradiance) - DVec3::ONE).abs().max_element() < 1e-3,
        "{irradiance}"
    );
    assert_eq!(air.sun_disc_radiance(0.005), DVec3::ZERO);
    let (centre, edge) = (air.sun_disc_radiance(0.0), air.sun_disc_radiance(0.0045));
    assert!(edge.x < centre.x && edge.z / edge.x < centre.z / centre.x, "the limb is darker and redder");
}

#[test]
fn daylight_of_the_film_is_this_air_s() {
    let air = Air::default();
    let mu_s = 45f64.to_radians().sin();
    let sun = air.transmittance(1000.0, mu_s, 1000) * DVec3::from_array(air.solar_irradiance);
    let film = DVec3::from_array(crate::film::DAYLIGHT.map(f64::from));
    // The constant is rounded to two decimals.
    assert!((sun - film).abs().max_element() < 0.006, "{sun}");
}
