//! Upsampling and tone curve in f64 (`glsl/film`).

/// Catmull-Rom weights of the four samples around fraction `f`.
#[must_use]
pub fn catmull_rom(f: f64) -> [f64; 4] {
    let (f2, f3) = (f * f, f * f * f);
    [-0.5 * f3 + f2 - 0.5 * f, 1.5 * f3 - 2.5 * f2 + 1.0, -1.5 * f3 + 2.0 * f2 + 0.5 * f, 0.5 * (f3 - f2)]
}

/// How well two opaque distances agree, 1e-4 to 1.
#[must_use]
pub fn agreement(a: f64, b: f64) -> f64 {
    (-30.0 * (a.max(1e-3) / b.max(1e-3)).ln().abs()).exp().max(1e-4)
}

/// An image of one value per texel, row by row.
pub struct Plane<'a, T> {
    /// Columns.
    pub width: i64,
    /// Rows.
    pub height: i64,
    /// Texels.
    pub texels: &'a [T],
}

impl<T: Copy> Plane<'_, T> {
    fn at(&self, x: i64, y: i64) -> T {
        let (x, y) = (x.clamp(0, self.width - 1), y.clamp(0, self.height - 1));
        self.texels[(y * self.width + x) as usize]
    }
}

/// The cloud targets at pixel (x, y) of an image of `size` pixels whose opaque scene there lies at `distance`.
#[must_use]
pub fn upsample(
    cloud: &Plane<'_, [f64; 4]>,
    low_opaque: &Plane<'_, f64>,
    distance: f64,
    pixel: [i64; 2],
    size: [i64; 2],
) -> [f64; 4] {
    let at = |p: i64, full: i64, low: i64| (p as f64 + 0.5) / full as f64 * low as f64 - 0.5;
    let (x, y) = (at(pixel[0], size[0], cloud.width), at(pixel[1], size[1], cloud.height));
    let (fx, fy) = (x - x.floor(), y - y.floor());
    let (wx, wy) = (catmull_rom(fx), catmull_rom(fy));
    let (mut sharp, mut soft, mut soft_weight, mut worst) = ([0.0; 4], [0.0; 4], 0.0, 1.0f64);
    let (mut least, mut greatest) = ([f64::MAX; 4], [f64::MIN; 4]);
    for (j, wy) in wy.iter().enumerate() {
        for (i, wx) in wx.iter().enumerate() {
            let (tx, ty) = (x.floor() as i64 + i as i64 - 1, y.floor() as i64 + j as i64 - 1);
            let value = cloud.at(tx, ty);
            let agree = agreement(low_opaque.at(tx, ty), distance);
            worst = worst.min(agree);
            let inner = (1..3).contains(&i) && (1..3).contains(&j);
            let bilinear = (if i == 1 { 1.0 - fx } else { fx }) * (if j == 1 { 1.0 - fy } else { fy }) * agree;
            soft_weight += if inner { bilinear } else { 0.0 };
            for c in 0..4 {
                sharp[c] += wx * wy * value[c];
                if inner {
                    soft[c] += bilinear * value[c];
                    least[c] = least[c].min(value[c]);
                    greatest[c] = greatest[c].max(value[c]);
                }
            }
        }
    }
    let t = ((worst - 0.5) / 0.4).clamp(0.0, 1.0);
    let sharpness = t * t * (3.0 - 2.0 * t);
    std::array::from_fn(|c| {
        let (soft, sharp) = (soft[c] / soft_weight, sharp[c].clamp(least[c], greatest[c]));
        soft + (sharp - soft) * sharpness
    })
}

/// Narkowicz's fit of the ACES curve, as in `glsl/film/tonemap.glsl`.
#[must_use]
pub fn filmic(x: f64) -> f64 {
    (x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)).clamp(0.0, 1.0)
}

/// sRGB transfer function.
#[must_use]
pub fn srgb_encode(x: f64) -> f64 {
    if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_sum_to_one_and_interpolate() {
        for i in 0..=10 {
            let w = catmull_rom(f64::from(i) / 10.0);
            assert!((w.iter().sum::<f64>() - 1.0).abs() < 1e-15);
        }
        assert_eq!(catmull_rom(0.0), [0.0, 1.0, 0.0, 0.0]);
    }

    #[test]
    fn a_constant_stays_constant_and_an_opaque_edge_stays_sharp() {
        let (w, h) = (8, 8);
        let near = |x: i64| x < 4;
        let cloud: Vec<[f64; 4]> = (0..w * h).map(|i| if near(i % w) { [1.0; 4] } else { [0.0; 4] }).collect();
        let depth: Vec<f64> = (0..w * h).map(|i| if near(i % w) { 100.0 } else { 1e30 }).collect();
        let cloud = Plane { width: w, height: h, texels: &cloud };
        let depth = Plane { width: w, height: h, texels: &depth };
        for x in 0..16 {
            let distance = if x < 8 { 100.0 } else { 1e30 };
            let expected = if x < 8 { 1.0 } else { 0.0 };
            let got = upsample(&cloud, &depth, distance, [x, 7], [16, 16]);
            assert!((got[0] - expected).abs() < 2e-3, "{x}: {got:?}");
        }
    }

    #[test]
    fn the_curve_rises_from_black_to_white_without_a_step() {
        assert_eq!(filmic(0.0), 0.0);
        let mut last = 0.0;
        for i in 1..9000 {
            let y = filmic(f64::from(i) * 1e-3);
            assert!(y >= last && y - last < 3e-3, "{i}: {last} {y}");
            last = y;
        }
        assert!(last > 0.98 && last <= 1.0);
    }
}
