//! Phase functions: values, Legendre moments, mean cosine, sampling. GLSL twin: `glsl/medium/phase.glsl`.
//!
//! `cos_theta = -dot(to_light, to_eye)`: +1 is forward. Both functions integrate to one over the sphere.

use std::f64::consts::PI;

use crate::params::Phase;

/// The shape of the phase function; the asymmetry `g` goes with each use, since a medium may use two.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum PhaseFunction {
    /// Cornette–Shanks (Yusov, Eq. 7): Henyey–Greenstein's peak with Rayleigh's 1 + cos².
    #[default]
    CornetteShanks,
    /// Henyey–Greenstein.
    HenyeyGreenstein,
}

impl From<Phase> for PhaseFunction {
    fn from(phase: Phase) -> Self {
        match phase {
            Phase::CornetteShanks => Self::CornetteShanks,
            Phase::HenyeyGreenstein => Self::HenyeyGreenstein,
        }
    }
}

impl PhaseFunction {
    /// Probability per steradian of scattering by the angle whose cosine is given [1/sr].
    pub fn eval(self, cos_theta: f64, g: f64) -> f64 {
        let d = 1.0 + g * g - 2.0 * g * cos_theta;
        let hg = (1.0 - g * g) / (4.0 * PI * d * d.sqrt());
        match self {
            Self::HenyeyGreenstein => hg,
            Self::CornetteShanks => hg * 1.5 * (1.0 + cos_theta * cos_theta) / (2.0 + g * g),
        }
    }

    /// Legendre moments 2π ∫ p P_l dcos for l = 0..=l_max; moment 0 is 1, moment 1 the mean cosine.
    ///
    /// Henyey–Greenstein has g^l. Cornette–Shanks follows from it by x P_l = ((l+1) P_{l+1} + l P_{l-1}) / (2l+1) twice.
    pub fn moments(self, g: f64, l_max: usize) -> Vec<f64> {
        let hg = |l: i64| if l < 0 { 0.0 } else { g.powi(l as i32) };
        (0..=l_max as i64)
            .map(|l| match self {
                Self::HenyeyGreenstein => hg(l),
                Self::CornetteShanks => {
                    let n = l as f64;
                    let up = (n + 1.0) * (n + 2.0) / ((2.0 * n + 1.0) * (2.0 * n + 3.0));
                    let here = (n + 1.0).powi(2) / ((2.0 * n + 1.0) * (2.0 * n + 3.0))
                        + n * n / ((2.0 * n + 1.0) * (2.0 * n - 1.0));
                    let down = n * (n - 1.0) / ((2.0 * n + 1.0) * (2.0 * n - 1.0));
                    1.5 / (2.0 + g * g) * (hg(l) * (1.0 + here) + up * hg(l + 2) + down * hg(l - 2))
                }
            })
            .collect()
    }

    /// Mean cosine of the scattering angle.
    pub fn mean_cosine(self, g: f64) -> f64 {
        match self {
            Self::HenyeyGreenstein => g,
            Self::CornetteShanks => 3.0 * g * (4.0 + g * g) / (5.0 * (2.0 + g * g)),
        }
    }

    /// Cosine of a scattering angle distributed by the function; `uniform` yields numbers in [0, 1).
    pub fn sample(self, g: f64, mut uniform: impl FnMut() -> f64) -> f64 {
        loop {
            let u = uniform();
            let cos = if g.abs() < 1e-4 {
                1.0 - 2.0 * u
            } else {
                let q = (1.0 - g * g) / (1.0 - g + 2.0 * g * u);
                ((1.0 + g * g - q * q) / (2.0 * g)).clamp(-1.0, 1.0)
            };
            // Cornette–Shanks is Henyey–Greenstein accepted with probability (1 + cos²) / 2.
            if self == Self::HenyeyGreenstein || uniform() < 0.5 * (1.0 + cos * cos) {
                return cos;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::quadrature::gauss_legendre;

    const BOTH: [PhaseFunction; 2] = [PhaseFunction::CornetteShanks, PhaseFunction::HenyeyGreenstein];

    #[test]
    fn phase_functions_integrate_to_one_with_the_stated_mean_cosine_and_moments() {
        let (x, w) = gauss_legendre(400); // exact far beyond the decay of 0.9^l
        for phase in BOTH {
            for g in [-0.5, 0.0, 0.3, 0.7, 0.85, 0.9] {
                let moment = |f: &dyn Fn(f64) -> f64| -> f64 {
                    x.iter().zip(&w).map(|(&c, &w)| 2.0 * PI * w * phase.eval(c, g) * f(c)).sum()
                };
                assert!((moment(&|_| 1.0) - 1.0).abs() < 1e-9, "{phase:?} {g}");
                assert!((moment(&|c| c) - phase.mean_cosine(g)).abs() < 1e-9, "{phase:?} {g}");
                let expected = phase.moments(g, 3);
                assert!((moment(&|c| 0.5 * (5.0 * c * c * c - 3.0 * c)) - expected[3]).abs() < 1e-9);
                assert!((expected[1] - phase.mean_cosine(g)).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn forward_is_plus_one() {
        for phase in BOTH {
            assert!(phase.eval(1.0, 0.7) > 50.0 * phase.eval(-1.0, 0.7));
        }
    }

    #[test]
    fn samples_have_the_mean_cosine() {
        let mut state = 1u64;
        let mut uniform = move || crate::reference::monte_carlo::next_uniform(&mut state);
        for phase in BOTH {
            let n = 200_000;
            let mean = (0..n).map(|_| phase.sample(0.7, &mut uniform)).sum::<f64>() / f64::from(n);
            // Standard error below 0.4 / √n = 9e-4; four of them.
            assert!((mean - phase.mean_cosine(0.7)).abs() < 3.6e-3, "{phase:?} {mean}");
        }
    }
}
