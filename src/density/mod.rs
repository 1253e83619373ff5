//! Where clouds are: a world-anchored field of heaps, outline noise, streaks and weather, and its calibration, so that
//! `coverage` is the share of the area that is covered (`glsl/density/field.glsl`).

use crate::reference::density::{FieldFrequencies, coverage_field};

/// Wavelengths of the field [m].
///
/// Heaps of 1 to 3 km and their turrets are those of fair-weather cumulus; 20 km and 200 km are Yusov's reference values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wavelengths {
    /// Spacing of heaps.
    pub heap: f64,
    /// Longest of the three octaves that break the outline.
    pub billow: f64,
    /// Spacing of the turrets on a heap.
    pub turret: f64,
    /// Clusters of heaps.
    pub streak: f64,
    /// Weather.
    pub region: f64,
}

impl Default for Wavelengths {
    fn default() -> Self {
        Self { heap: 2_600.0, billow: 1_300.0, turret: 900.0, streak: 2.0e4, region: 2.0e5 }
    }
}

/// Frequency of wavelength `length` for positions in steps of `step` metres, in 2⁻³² lattice cells per step.
#[must_use]
pub fn frequency(length: f64, step: f64) -> i32 {
    // Coarser than a quarter of a lattice cell per step samples noise only; the bound keeps two octaves within an i32.
    (step / length * 4_294_967_296.0).round().clamp(1.0, 268_435_456.0) as i32
}

impl Wavelengths {
    /// Frequencies for positions in steps of `step` metres.
    #[must_use]
    pub fn frequencies(&self, step: f64) -> FieldFrequencies {
        FieldFrequencies {
            heap: frequency(self.heap, step),
            billow: frequency(self.billow, step),
            turret: frequency(self.turret, step),
            streak: frequency(self.streak, step),
            region: frequency(self.region, step),
            phase: 0,
            weather_phase: 0,
        }
    }
}

/// Knots of [`coverage_curve`].
pub const KNOTS: usize = 65;

/// Field value above which a share i/64 of the world lies, at 65 knots: the quantiles of the field over some 4000 km.
///
/// Costs about 30 ms; the grid computes it once per seed and cell size.
#[must_use]
pub fn coverage_curve(f: FieldFrequencies, step: f64, seed: u32) -> [f32; 68] {
    const SAMPLES: u32 = 1 << 15;
    let half_width = (2.0e6 / step).min(f64::from(1 << 30));
    // The R2 sequence (Roberts 2018): the plastic number's powers fill the square evenly.
    let place = |i: u32, alpha: f64| ((f64::from(i) * alpha).fract() * 2.0 - 1.0) * half_width;
    let mut field: Vec<f32> = (1..=SAMPLES)
        .map(|i| [place(i, 0.754_877_666_246_692_8) as i32, place(i, 0.569_840_290_998_053_3) as i32])
        .map(|position| coverage_field(position, f, seed, 1.0))
        .collect();
    field.sort_unstable_by(f32::total_cmp);
    let mut curve = [0.0; 68];
    for (i, knot) in curve.iter_mut().enumerate().take(KNOTS) {
        let above = SAMPLES as usize * i / 64;
        *knot = match i {
            0 => field[field.len() - 1],
            64 => field[0] - 0.5, // the samples' least is not the world's
            _ => field[SAMPLES as usize - above],
        };
    }
    curve
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::density::pcg;

    /// Share of random places whose field exceeds the threshold for `coverage`.
    fn covered(coverage: f32, step: f64, seed: u32) -> f64 {
        let f = Wavelengths::default().frequencies(step);
        let curve = coverage_curve(f, step, seed);
        let knot = coverage * 64.0;
        let (i, t) = (knot as usize, knot.fract());
        let threshold = curve[i] + t * (curve[i + 1] - curve[i]);
        let place = |h: u32| (f64::from(h) / f64::from(u32::MAX) * 2.0 - 1.0) * 1.5e6 / step;
        let hits = (0..20_000u32).filter(|&i| {
            let position = [place(pcg(2 * i)) as i32, place(pcg(2 * i + 1)) as i32];
            coverage_field(position, f, seed, 1.0) > threshold
        });
        hits.count() as f64 / 20_000.0
    }

    #[test]
    fn coverage_is_the_share_of_the_area_that_is_covered() {
        for (coverage, step, seed) in [(0.1, 1.4, 1), (0.3, 1.4, 2), (0.6, 1.9, 1), (0.905, 1.06, 7)] {
            let share = covered(coverage, step, seed);
            // 20 000 and 32 768 samples: standard deviation below 0.0045; and four of them.
            assert!((share - f64::from(coverage)).abs() < 0.018, "{coverage}: {share}");
        }
    }

    #[test]
    fn a_clear_sky_is_clear_and_an_overcast_one_is_closed() {
        assert!(covered(0.0, 1.4, 1) < 1e-3); // the greatest of 32 768 samples is exceeded about once in as many
        assert!(covered(0.999_9, 1.4, 1) > 0.998);
    }
}
