//! Where each quantity sits in its table; the twin of `glsl/atmosphere/mapping.glsl`.

use crate::atmosphere::Air;
use std::f64::consts::{FRAC_PI_2, PI};

/// Distance to which aerial perspective is tabulated \[m\].
pub const AERIAL_DISTANCE_MAX: f64 = 160e3;

/// Texel index → [0, 1], ends of the domain on texel centres.
pub fn from_texel(i: usize, size: usize) -> f64 {
    i as f64 / (size - 1) as f64
}

/// Square root that keeps the sign.
fn signed_sqrt(x: f64) -> f64 {
    x.signum() * x.abs().sqrt()
}

/// (h, mu) → [0, 1]² of the transmittance table.
pub fn transmittance_from_ray(air: &Air, h: f64, mu: f64) -> [f64; 2] {
    let (top, rho) = (air.horizon_distance(air.top_height), air.horizon_distance(h));
    let d = air.distance_to_top(h, mu.max(air.horizon_mu(h)));
    let (d_min, d_max) = (air.top_height - h, rho + top);
    [((d - d_min) / (d_max - d_min)).clamp(0.0, 1.0), rho / top]
}

/// [0, 1]² of the transmittance table → (h, mu).
pub fn ray_from_transmittance(air: &Air, u: [f64; 2]) -> (f64, f64) {
    let top = air.horizon_distance(air.top_height);
    let rho = top * u[1];
    let r = (air.bottom_radius.powi(2) + rho * rho).sqrt();
    let h = r - air.bottom_radius;
    let d_min = air.top_height - h;
    let d = d_min + u[0] * (rho + top - d_min);
    let mu = if d <= 1e-6 { 1.0 } else { (top * top - rho * rho - d * d) / (2.0 * r * d) };
    (h, mu.clamp(-1.0, 1.0))
}

/// (h, mu_s) → [0, 1]² of the multiple-scattering table.
pub fn multiple_from_point(air: &Air, h: f64, mu_s: f64) -> [f64; 2] {
    [0.5 + 0.5 * signed_sqrt(mu_s), (h / air.top_height).clamp(0.0, 1.0).sqrt()]
}

/// [0, 1]² of the multiple-scattering table → (h, mu_s).
pub fn point_from_multiple(air: &Air, u: [f64; 2]) -> (f64, f64) {
    let s = 2.0 * u[0] - 1.0;
    (air.top_height * u[1] * u[1], s * s.abs())
}

/// (mu, azimuth) → [0, 1] × [−1, 1] of the sky view, and whether the ray meets the ground.
pub fn sky_view_from_direction(air: &Air, h: f64, mu: f64, azimuth: f64) -> ([f64; 2], bool) {
    let dip = -air.horizon_mu(h).asin();
    let ground = air.hits_ground(h, mu);
    let span = if ground { FRAC_PI_2 - dip } else { FRAC_PI_2 + dip };
    let s = ((mu.clamp(-1.0, 1.0).asin() + dip).abs() / span).clamp(0.0, 1.0).sqrt();
    ([azimuth / PI, if ground { -s } else { s }], ground)
}

/// [0, 1] × [−1, 1] of the sky view → (mu, azimuth).
pub fn direction_from_sky_view(air: &Air, h: f64, u: [f64; 2], ground: bool) -> (f64, f64) {
    let grazing = air.horizon_mu(h);
    let dip = -grazing.asin();
    let span = if ground { FRAC_PI_2 - dip } else { FRAC_PI_2 + dip };
    let mu = (u[1] * u[1].abs() * span - dip).sin();
    // As in the shader, where rounding must not move a row to the other side of the horizon.
    (if ground { mu.min(grazing - 1e-7) } else { mu.max(grazing) }, u[0] * PI)
}

/// A texel of the sky view → [0, 1] × [−1, 1], and whether it belongs to the ground's half.
pub fn sky_view_texel(x: usize, y: usize, size: [usize; 2]) -> ([f64; 2], bool) {
    let half = size[1] / 2;
    let ground = y < half;
    let v = if ground { y as f64 / (half - 1) as f64 - 1.0 } else { (y - half) as f64 / (half - 1) as f64 };
    ([from_texel(x, size[0]), v], ground)
}

/// (mu, azimuth, distance) → [0, 1]³ of the aerial perspective.
pub fn aerial_from_ray(mu: f64, azimuth: f64, distance: f64) -> [f64; 3] {
    let e = mu.clamp(-1.0, 1.0).asin() / FRAC_PI_2;
    [azimuth / PI, 0.5 + 0.5 * signed_sqrt(e), (distance / AERIAL_DISTANCE_MAX).clamp(0.0, 1.0).sqrt()]
}

/// [0, 1]³ of the aerial perspective → (mu, azimuth, distance).
pub fn ray_from_aerial(u: [f64; 3]) -> (f64, f64, f64) {
    let s = 2.0 * u[1] - 1.0;
    ((FRAC_PI_2 * s * s.abs()).sin(), u[0] * PI, AERIAL_DISTANCE_MAX * u[2] * u[2])
}

/// Cosine between view and sun from their cosines to the vertical and the azimuth between them.
pub fn nu_from_azimuth(mu: f64, mu_s: f64, azimuth: f64) -> f64 {
    let s = ((1.0 - mu * mu).max(0.0) * (1.0 - mu_s * mu_s).max(0.0)).sqrt();
    (mu * mu_s + s * azimuth.cos()).clamp(-1.0, 1.0)
}
