//! LDR-ꟻLIP: the difference that a person sees when two pictures are shown in turns in one place.
//!
//! After P. Andersson, J. Nilsson, T. Akenine-Möller, M. Oskarsson, K. Åström, M. D. Fairchild, *ꟻLIP: A Difference
//! Evaluator for Alternating Images*, Proc. ACM Comput. Graph. Interact. Tech. 3(2), 2020; equations and sections are cited
//! as (ꟻLIP, …). Constants are the paper's. Tests compare with the authors' own program, version 1.7.

use std::f64::consts::PI;

/// Pixels per degree of visual angle by default: a 0.7 m wide display of 3840 pixels seen from 0.7 m (ꟻLIP 4).
pub const PIXELS_PER_DEGREE: f64 = 67.020_643_276_582_25;

/// ꟻLIP of each pixel, 0 (equal) to 1, of two pictures of `width` columns. Both hold sRGB-encoded values, 0 to 1, row by row;
/// they are symmetric in the result. `pixels_per_degree` of visual angle says how they are looked at.
///
/// # Panics
/// If the pictures differ in length or are not made of whole rows, or if `pixels_per_degree` is not positive.
#[must_use]
pub fn flip(test: &[[f32; 3]], reference: &[[f32; 3]], width: usize, pixels_per_degree: f64) -> Vec<f64> {
    assert!(test.len() == reference.len() && width > 0 && test.len().is_multiple_of(width), "two pictures of one size");
    assert!(pixels_per_degree > 0.0 && pixels_per_degree.is_finite(), "pixels per degree are positive");
    let filters = Filters::new(pixels_per_degree);
    let [test, reference] = [test, reference].map(|picture| filters.perceive(picture, width));
    let greatest = greatest_colour_error();
    (0..test.colour.len())
        .map(|i| {
            let colour = redistribute(hyab(test.colour[i], reference.colour[i]).powf(QC), greatest);
            let edges = (test.edges[i] - reference.edges[i]).abs();
            let points = (test.points[i] - reference.points[i]).abs();
            let feature = (edges.max(points) / 2.0_f64.sqrt()).powf(QF).min(1.0); // Eq. 5
            if colour == 0.0 && feature < 1.0 { 0.0 } else { colour.powf(1.0 - feature) } // Eq. 6
        })
        .collect()
}

/// Exponent of colour differences.
const QC: f64 = 0.7;
/// Exponent of feature differences.
const QF: f64 = 0.5;
/// Share of the greatest colour error that is mapped to …
const PC: f64 = 0.4;
/// … this value (Eq. 3).
const PT: f64 = 0.95;
/// Width of the feature detectors [degrees].
const FEATURE_WIDTH: f64 = 0.082;

/// Contrast sensitivity of one opponent channel: Gaussians `a √(π/b) exp(−π² z² / b)`, z in degrees (ꟻLIP, Table 1).
type Sensitivity = [(f64, f64); 2];
const ACHROMATIC: Sensitivity = [(1.0, 0.0047), (0.0, 1e-5)];
const RED_GREEN: Sensitivity = [(1.0, 0.0053), (0.0, 1e-5)];
const BLUE_YELLOW: Sensitivity = [(34.1, 0.04), (13.5, 0.025)];

/// What is seen of a picture.
struct Percept {
    /// Hunt-adjusted L*a*b* after the eye's blur.
    colour: Vec<[f64; 3]>,
    /// Strength of edges and of points in the luminance.
    edges: Vec<f64>,
    points: Vec<f64>,
}

/// A separable filter: weights along x, and along y, from −r to r.
struct Separable {
    x: Vec<f64>,
    y: Vec<f64>,
}

struct Filters {
    /// Per opponent channel, with the weight of each part.
    channels: [Vec<(f64, Separable)>; 3],
    /// Along x; along y they are the transposed.
    edge: Separable,
    point: Separable,
}

impl Filters {
    fn new(ppd: f64) -> Self {
        let broadest = [ACHROMATIC, RED_GREEN, BLUE_YELLOW].iter().flatten().map(|g| g.1).fold(0.0, f64::max);
        let radius = (3.0 * (broadest / (2.0 * PI * PI)).sqrt() * ppd).ceil() as i32;
        let channels = [ACHROMATIC, RED_GREEN, BLUE_YELLOW].map(|parts| {
            let parts = parts.iter().filter(|(a, _)| *a > 0.0).map(|&(a, b)| {
                let line: Vec<f64> =
                    (-radius..=radius).map(|i| (-(PI * f64::from(i) / ppd).powi(2) / b).exp()).collect();
                let sum: f64 = line.iter().sum();
                let line: Vec<f64> = line.iter().map(|w| w / sum).collect();
                (a * (PI / b).sqrt() * sum * sum, Separable { x: line.clone(), y: line })
            });
            let parts: Vec<_> = parts.collect();
            let whole: f64 = parts.iter().map(|(weight, _)| weight).sum();
            parts.into_iter().map(|(weight, filter)| (weight / whole, filter)).collect()
        });

        let sigma = 0.5 * FEATURE_WIDTH * ppd;
        let radius = (3.0 * sigma).ceil() as i32;
        let steps = || (-radius..=radius).map(f64::from);
        let gauss = |x: f64| (-x * x / (2.0 * sigma * sigma)).exp();
        let total: f64 = steps().map(gauss).sum();
        let along: Vec<f64> = steps().map(|x| gauss(x) / total).collect();
        // The positive weights add up to 1 and the negative ones to −1 (ꟻLIP 4.2).
        let balanced = |weights: Vec<f64>| -> Vec<f64> {
            let positive: f64 = weights.iter().filter(|w| **w > 0.0).sum();
            let negative: f64 = -weights.iter().filter(|w| **w < 0.0).sum::<f64>();
            weights.iter().map(|w| if *w > 0.0 { w / positive } else { w / negative }).collect()
        };
        let edge = balanced(steps().map(|x| -x * gauss(x)).collect());
        let point = balanced(steps().map(|x| (x * x / (sigma * sigma) - 1.0) * gauss(x)).collect());
        Self { channels, edge: Separable { x: edge, y: along.clone() }, point: Separable { x: point, y: along } }
    }

    fn perceive(&self, srgb: &[[f32; 3]], width: usize) -> Percept {
        let opponent: Vec<[f64; 3]> = srgb.iter().map(|pixel| ycxcz(xyz(pixel.map(linear)))).collect();
        let channel = |c: usize| opponent.iter().map(|pixel| pixel[c]).collect::<Vec<f64>>();
        let seen: [Vec<f64>; 3] = std::array::from_fn(|c| {
            let plane = channel(c);
            let mut sum = vec![0.0; plane.len()];
            for (weight, filter) in &self.channels[c] {
                let part = convolve(&plane, width, &filter.x, &filter.y);
                sum.iter_mut().zip(part).for_each(|(sum, part)| *sum += weight * part);
            }
            sum
        });
        let to_rgb = inverse_xyz();
        let colour = (0..opponent.len()).map(|i| {
            let rgb = times(&to_rgb, xyz_of_ycxcz([seen[0][i], seen[1][i], seen[2][i]]));
            hunt(lab(xyz(rgb.map(|v| v.clamp(0.0, 1.0)))))
        });
        let luminance: Vec<f64> = channel(0).iter().map(|y| (y + 16.0) / 116.0).collect();
        let strength = |filter: &Separable| {
            let x = convolve(&luminance, width, &filter.x, &filter.y);
            let y = convolve(&luminance, width, &filter.y, &filter.x);
            x.iter().zip(y).map(|(x, y)| x.hypot(y)).collect()
        };
        Percept { colour: colour.collect(), edges: strength(&self.edge), points: strength(&self.point) }
    }
}

/// `plane` filtered along x, then along y; beyond its borders it goes on as it ends.
fn convolve(plane: &[f64], width: usize, along_x: &[f64], along_y: &[f64]) -> Vec<f64> {
    let height = plane.len() / width;
    let (rx, ry) = (along_x.len() / 2, along_y.len() / 2);
    let mut rows = vec![0.0; plane.len()];
    let mut padded = vec![0.0; width + 2 * rx];
    for (row, out) in plane.chunks_exact(width).zip(rows.chunks_exact_mut(width)) {
        padded[..rx].fill(row[0]);
        padded[rx..rx + width].copy_from_slice(row);
        padded[rx + width..].fill(row[width - 1]);
        for (out, window) in out.iter_mut().zip(padded.windows(along_x.len())) {
            *out = window.iter().zip(along_x).map(|(v, w)| v * w).sum();
        }
    }
    let mut result = vec![0.0; plane.len()];
    for (y, out) in result.chunks_exact_mut(width).enumerate() {
        for (k, weight) in along_y.iter().enumerate() {
            let from = (y + k).saturating_sub(ry).min(height - 1);
            let row = &rows[from * width..(from + 1) * width];
            out.iter_mut().zip(row).for_each(|(out, v)| *out += weight * v);
        }
    }
    result
}

/// Maps colour errors to 0 … 1 (Eq. 3).
fn redistribute(error: f64, greatest: f64) -> f64 {
    let knee = PC * greatest;
    if error < knee { PT / knee * error } else { PT + (error - knee) / (greatest - knee) * (1.0 - PT) }
}

/// The greatest colour error: between the primaries green and blue.
fn greatest_colour_error() -> f64 {
    let of = |rgb| hunt(lab(xyz(rgb)));
    hyab(of([0.0, 1.0, 0.0]), of([0.0, 0.0, 1.0])).powf(QC)
}

/// Distance of two colours far apart (Abasi et al. 2020).
fn hyab(a: [f64; 3], b: [f64; 3]) -> f64 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}

/// Chroma shrinks with luminance (Hunt 1952).
fn hunt([l, a, b]: [f64; 3]) -> [f64; 3] {
    [l, 0.01 * l * a, 0.01 * l * b]
}

/// The inverse of sRGB's transfer function (IEC 61966-2-1).
fn linear(encoded: f32) -> f64 {
    let v = f64::from(encoded).clamp(0.0, 1.0);
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// CIE XYZ of linear sRGB, from its primaries and D65 as exact fractions.
const XYZ: [[f64; 3]; 3] = [
    [10_135_552.0 / 24_577_794.0, 8_788_810.0 / 24_577_794.0, 4_435_075.0 / 24_577_794.0],
    [2_613_072.0 / 12_288_897.0, 8_788_810.0 / 12_288_897.0, 887_015.0 / 12_288_897.0],
    [1_425_312.0 / 73_733_382.0, 8_788_810.0 / 73_733_382.0, 70_074_185.0 / 73_733_382.0],
];

fn times(m: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

fn xyz(rgb: [f64; 3]) -> [f64; 3] {
    times(&XYZ, rgb)
}

/// Linear sRGB of CIE XYZ.
fn inverse_xyz() -> [[f64; 3]; 3] {
    // Columns there are rows here, and the inverse of the transpose is the transpose of the inverse.
    glam::DMat3::from_cols_array_2d(&XYZ).inverse().to_cols_array_2d()
}

const WHITE: [f64; 3] =
    [XYZ[0][0] + XYZ[0][1] + XYZ[0][2], XYZ[1][0] + XYZ[1][1] + XYZ[1][2], XYZ[2][0] + XYZ[2][1] + XYZ[2][2]];

/// XYZ relative to white.
fn relative(v: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| v[i] / WHITE[i])
}

/// A linear opponent space: luminance, red–green, blue–yellow.
fn ycxcz(v: [f64; 3]) -> [f64; 3] {
    let [x, y, z] = relative(v);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn xyz_of_ycxcz([y, cx, cz]: [f64; 3]) -> [f64; 3] {
    let y = (y + 16.0) / 116.0;
    [(y + cx / 500.0) * WHITE[0], y * WHITE[1], (y - cz / 200.0) * WHITE[2]]
}

/// CIE L*a*b*.
fn lab(v: [f64; 3]) -> [f64; 3] {
    const DELTA: f64 = 6.0 / 29.0;
    let [x, y, z] =
        relative(v).map(|t| if t > DELTA.powi(3) { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 });
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

#[cfg(test)]
mod tests {
    use super::*;

    const W: usize = 96;

    /// Stripes, squares and noise out of whole numbers.
    fn pattern(k: usize) -> Vec<[f32; 3]> {
        let pixel = |x: usize, y: usize| {
            let blue = ((x / 8 + y / 8) % 2) * (200 - 40 * k) + (x + y) % 40;
            [(x * 7 + y * 3 + k * 11) % 256, (x * x + 5 * y * (1 + k)) % 256, blue].map(|c| c as f32 / 255.0)
        };
        (0..W * 64).map(|i| pixel(i % W, i / W)).collect()
    }

    fn mean(values: &[f64]) -> f64 {
        values.iter().sum::<f64>() / values.len() as f64
    }

    /// ꟻLIP between two uniform pictures.
    fn uniform(a: [f32; 3], b: [f32; 3]) -> f64 {
        let errors = flip(&[a; 32 * 32], &[b; 32 * 32], 32, PIXELS_PER_DEGREE);
        assert!(errors.iter().all(|e| (e - errors[0]).abs() < 1e-9)); // Rounding in the sums of weights.
        errors[0]
    }

    /// Values of the authors' program (flip-evaluator 1.7), which computes in f32.
    const F32: f64 = 2e-5;

    #[test]
    fn it_agrees_with_the_authors_program() {
        let golden = [
            (PIXELS_PER_DEGREE, 0.562_371_4, [0.088_498_79, 0.761_913_8, 0.497_985_6, 0.385_749_2, 0.604_120_1]),
            (20.0, 0.752_912_7, [0.049_680_55, 0.879_546_2, 0.969_800_5, 0.137_804_2, 0.904_272_3]),
        ];
        let points = [(0, 0), (95, 63), (40, 20), (17, 50), (64, 31)];
        for (ppd, whole, at) in golden {
            let errors = flip(&pattern(0), &pattern(1), W, ppd);
            assert!((mean(&errors) - whole).abs() < F32, "{ppd}: {}", mean(&errors));
            for ((x, y), expected) in points.into_iter().zip(at) {
                let got = errors[y * W + x];
                assert!((got - expected).abs() < 10.0 * F32, "{ppd} at {x}, {y}: {got} {expected}"); // One pixel of it.
            }
        }
        let faded: Vec<_> = pattern(0).iter().map(|p| p.map(|v| (v * 0.96 + 0.01).clamp(0.0, 1.0))).collect();
        let error = mean(&flip(&faded, &pattern(0), W, PIXELS_PER_DEGREE));
        assert!((error - 0.124_354_98).abs() < F32, "{error}");
        assert!((uniform([0.5, 0.5, 0.5], [0.55, 0.5, 0.5]) - 0.149_689_0).abs() < F32);
        assert!((uniform([0.2, 0.3, 0.4], [0.2, 0.3, 0.41]) - 0.043_101_2).abs() < F32);
        assert!((uniform([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]) - 0.986_679_0).abs() < F32);
    }

    #[test]
    fn uniform_pictures_follow_the_closed_form() {
        // Black to white is ΔL* = 100 without chroma; green to blue is the greatest error there is.
        let error = 100.0_f64.powf(0.7);
        let greatest = greatest_colour_error();
        let expected = PT + (error - PC * greatest) / (greatest * (1.0 - PC)) * (1.0 - PT);
        assert!((uniform([0.0; 3], [1.0; 3]) - expected).abs() < 1e-9);
        assert!((uniform([0.0, 1.0, 0.0], [0.0, 0.0, 1.0]) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn equal_pictures_have_none_and_order_does_not_matter() {
        let (a, b) = (pattern(0), pattern(1));
        assert!(flip(&a, &a, W, PIXELS_PER_DEGREE).iter().all(|e| *e == 0.0));
        assert_eq!(flip(&a, &b, W, PIXELS_PER_DEGREE), flip(&b, &a, W, PIXELS_PER_DEGREE));
    }

    #[test]
    fn a_lone_pixel_is_seen_where_it_is_and_not_far_away() {
        let grey = vec![[0.5f32; 3]; W * 64];
        let mut dot = grey.clone();
        dot[30 * W + 50] = [1.0; 3];
        let errors = flip(&dot, &grey, W, PIXELS_PER_DEGREE);
        assert!(errors[30 * W + 50] > 0.1 && errors[30 * W + 80] == 0.0 && errors[5 * W + 50] == 0.0);
        assert!(errors.iter().all(|e| (0.0..=1.0).contains(e)));
    }

    #[test]
    fn filters_keep_what_is_uniform() {
        let filters = Filters::new(PIXELS_PER_DEGREE);
        for parts in &filters.channels {
            let sum: f64 = parts.iter().map(|(w, f)| w * f.x.iter().sum::<f64>() * f.y.iter().sum::<f64>()).sum();
            assert!((sum - 1.0).abs() < 1e-12);
        }
        for filter in [&filters.edge, &filters.point] {
            assert!(filter.x.iter().sum::<f64>().abs() < 1e-12 && (filter.y.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        }
    }
}
