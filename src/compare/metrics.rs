//! Numbers about the difference of two pictures, and of two sequences.

use serde::Serialize;

use super::flip::{PIXELS_PER_DEGREE, flip};
use crate::output::Picture;
use crate::{Error, Result};

/// Added to the reference's square in the relative error, so that black does not divide (Rousselle et al., *Adaptive
/// rendering with non-local means filtering*, 2012, whose radiance is of this order).
pub const REL_MSE_EPSILON: f64 = 0.01;

/// What pictures are measured against.
#[derive(Clone, Debug, PartialEq)]
pub struct Reference {
    /// The picture.
    pub picture: Picture,
    /// Variance of each value of its radiance, if it is an estimate such as a path-traced one; noise of different pixels
    /// and frames is taken to be independent.
    pub variance: Option<Vec<[f32; 3]>>,
}

impl From<Picture> for Reference {
    fn from(picture: Picture) -> Self {
        Self { picture, variance: None }
    }
}

impl Reference {
    /// Sum of the variance over all values.
    fn variance_sum(&self) -> f64 {
        self.variance.iter().flatten().flatten().map(|v| f64::from(*v)).sum()
    }
}

/// How far a picture, or a sequence of them, is from its reference. Keys as in `metrics.json` (`docs/comparing.md`).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Metrics {
    /// Root mean square difference of linear radiance, over pixels and channels [W m⁻² sr⁻¹ nm⁻¹].
    pub rmse: f64,
    /// Mean of (I − R)² / (R² + 0.01) over pixels and channels of linear radiance.
    pub rel_mse: f64,
    /// Peak signal-to-noise ratio of the pictures as shown (toned, sRGB-encoded, peak 1), in dB; none of equal pictures.
    pub psnr: Option<f64>,
    /// Mean ꟻLIP of the pictures as shown, 0 to 1.
    pub flip_mean: f64,
    /// Greatest difference of linear radiance in any pixel and channel [W m⁻² sr⁻¹ nm⁻¹].
    pub max_abs: f64,
    /// Root mean square noise of a noisy reference's radiance; none of another.
    pub noise: Option<f64>,
    /// `rmse` without the part that is the reference's noise: √max(0, rmse² − noise²). Only with a noisy reference.
    pub rmse_less_noise: Option<f64>,
}

/// Sums over the pixels of one picture or of several, from which [`Metrics`] follow.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Errors {
    pixels: u64,
    squared: f64,
    relative: f64,
    shown_squared: f64,
    flip: f64,
    max_abs: f64,
    variance: Option<f64>,
}

/// The difference of a picture from its reference, pixel by pixel and in all.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// The sums.
    pub errors: Errors,
    /// ꟻLIP per pixel, 0 to 1.
    pub flip: Vec<f64>,
    /// Greatest difference of linear radiance over the channels, per pixel.
    pub radiance: Vec<f64>,
}

impl Difference {
    /// Compares `picture` with `reference`; `name` is what an error calls the picture.
    ///
    /// # Errors
    /// [`Error::InvalidParam`] when the sizes differ or a pixel of either is not finite.
    pub fn of(name: &str, picture: &Picture, reference: &Reference) -> Result<Self> {
        check(name, picture, reference)?;
        let variance = reference.variance.as_ref().map(|_| reference.variance_sum());
        let reference = &reference.picture;
        let flip = flip(&picture.display, &reference.display, picture.width as usize, PIXELS_PER_DEGREE);
        let pixels = picture.radiance.len() as u64;
        let mut errors = Errors { pixels, flip: flip.iter().sum(), variance, ..Errors::default() };
        let mut radiance = Vec::with_capacity(picture.radiance.len());
        for (a, r) in picture.radiance.iter().zip(&reference.radiance) {
            let mut greatest = 0.0f64;
            for (a, r) in a.iter().zip(r) {
                let (difference, r) = (f64::from(*a) - f64::from(*r), f64::from(*r));
                errors.squared += difference * difference;
                errors.relative += difference * difference / (r * r + REL_MSE_EPSILON);
                greatest = greatest.max(difference.abs());
            }
            errors.max_abs = errors.max_abs.max(greatest);
            radiance.push(greatest);
        }
        let shown = picture.display.iter().flatten().zip(reference.display.iter().flatten());
        errors.shown_squared = shown.map(|(a, r)| (f64::from(*a) - f64::from(*r)).powi(2)).sum();
        Ok(Self { errors, flip, radiance })
    }
}

impl Errors {
    /// Takes in those of another frame.
    pub fn add(&mut self, other: &Self) {
        self.pixels += other.pixels;
        self.squared += other.squared;
        self.relative += other.relative;
        self.shown_squared += other.shown_squared;
        self.flip += other.flip;
        self.max_abs = self.max_abs.max(other.max_abs);
        if let Some(variance) = other.variance {
            *self.variance.get_or_insert(0.0) += variance;
        }
    }

    /// The metrics over everything taken in so far; of nothing, zeros.
    #[must_use]
    pub fn metrics(&self) -> Metrics {
        let pixels = (self.pixels as f64).max(1.0);
        let values = 3.0 * pixels;
        Metrics {
            rmse: (self.squared / values).sqrt(),
            rel_mse: self.relative / values,
            psnr: (self.shown_squared > 0.0).then(|| -10.0 * (self.shown_squared / values).log10()),
            flip_mean: self.flip / pixels,
            max_abs: self.max_abs,
            noise: self.variance.map(|variance| (variance / values).sqrt()),
            rmse_less_noise: self.variance.map(|variance| ((self.squared - variance).max(0.0) / values).sqrt()),
        }
    }
}

/// Change from frame to frame that the motion does not explain.
///
/// For frames I₀, I₁ and their references R₀, R₁ it is ‖(I₁ − I₀) − (R₁ − R₀)‖ / ‖R₁ − R₀‖ over the linear radiance of all
/// pixels; over a sequence, the mean of all consecutive pairs. Where the reference does not change at all there is nothing
/// to relate to: such pairs are counted apart, with the change that the picture made nevertheless. The variance of a noisy
/// reference is taken off both squares; where nothing is left of its change, the pair counts among those, too.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Popping {
    sum: f64,
    pairs: u32,
    still_pairs: u32,
    still_squared: f64,
    still_values: u64,
}

impl Popping {
    /// Takes in two consecutive frames, each a picture with its reference. Returns the value of the pair; none where the
    /// reference did not change.
    ///
    /// # Errors
    /// [`Error::InvalidParam`] when the sizes differ or a pixel is not finite.
    pub fn add(
        &mut self,
        name: &str,
        before: (&Picture, &Reference),
        after: (&Picture, &Reference),
    ) -> Result<Option<f64>> {
        check(name, before.0, before.1)?;
        check(name, after.0, after.1)?;
        if (before.0.width, before.0.height) != (after.0.width, after.0.height) {
            return Err(Error::invalid(name, "frames of different sizes", "frames of one size"));
        }
        let changes = |before: &'_ Picture, after: &'_ Picture| -> Vec<f64> {
            let pairs = before.radiance.as_flattened().iter().zip(after.radiance.as_flattened());
            pairs.map(|(before, after)| f64::from(*after) - f64::from(*before)).collect()
        };
        let noise = before.1.variance_sum() + after.1.variance_sum();
        let (mut unexplained, mut explained) = (-noise, -noise);
        let motions = changes(&before.1.picture, &after.1.picture);
        for (change, motion) in changes(before.0, after.0).into_iter().zip(motions) {
            unexplained += (change - motion).powi(2);
            explained += motion * motion;
        }
        let unexplained = unexplained.max(0.0);
        if explained > 0.0 {
            let value = (unexplained / explained).sqrt();
            self.pairs += 1;
            self.sum += value;
            return Ok(Some(value));
        }
        self.still_pairs += 1;
        self.still_squared += unexplained;
        self.still_values += 3 * before.0.radiance.len() as u64;
        Ok(None)
    }

    /// The mean over the pairs whose reference changed; none if no pair's did.
    #[must_use]
    pub fn mean(&self) -> Option<f64> {
        (self.pairs > 0).then(|| self.sum / f64::from(self.pairs))
    }

    /// Pairs whose reference changed.
    #[must_use]
    pub fn pairs(&self) -> u32 {
        self.pairs
    }

    /// Pairs whose reference did not change.
    #[must_use]
    pub fn still_pairs(&self) -> u32 {
        self.still_pairs
    }

    /// Root mean square change of radiance over the pairs whose reference did not change; none without such pairs.
    #[must_use]
    pub fn still_change(&self) -> Option<f64> {
        (self.still_pairs > 0).then(|| (self.still_squared / self.still_values.max(1) as f64).sqrt())
    }
}

/// Refuses what cannot be compared: other sizes, values that are not finite.
fn check(name: &str, picture: &Picture, reference: &Reference) -> Result<()> {
    let truth = &reference.picture;
    if (picture.width, picture.height) != (truth.width, truth.height) {
        let size = format!("{}x{}", picture.width, picture.height);
        let expected = format!("the size of its reference, {}x{}", truth.width, truth.height);
        return Err(Error::invalid(name, size, expected));
    }
    for (name, picture) in [(name, picture), ("reference", truth)] {
        if let Some(fault) = picture.fault() {
            return Err(Error::invalid(name, fault, "a picture of finite values"));
        }
    }
    if let Some(variance) = &reference.variance {
        assert_eq!(variance.len(), truth.radiance.len(), "one variance a value");
        if let Some(bad) = variance.iter().flatten().find(|v| !(v.is_finite() && **v >= 0.0)) {
            return Err(Error::invalid("reference", format!("a variance of {bad}"), "finite variances from 0"));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture whose radiance is `value` of each pixel, shown as it is.
    fn picture(width: u32, height: u32, value: impl Fn(u32, u32) -> [f32; 3]) -> Picture {
        let radiance: Vec<_> = (0..width * height).map(|i| value(i % width, i / width)).collect();
        Picture { width, height, display: radiance.clone(), radiance, transmittance: None }
    }

    fn uniform(value: f32) -> Picture {
        picture(8, 4, |_, _| [value; 3])
    }

    fn metrics(a: &Picture, r: &Picture) -> Metrics {
        difference(a, r).unwrap().errors.metrics()
    }

    fn difference(a: &Picture, r: &Picture) -> Result<Difference> {
        Difference::of("a", a, &r.clone().into())
    }

    /// Popping's `add` of pictures with references free of noise.
    fn add(popping: &mut Popping, before: [&Picture; 2], after: [&Picture; 2]) -> Result<Option<f64>> {
        let [r0, r1] = [before[1], after[1]].map(|picture| Reference::from(picture.clone()));
        popping.add("a", (before[0], &r0), (after[0], &r1))
    }

    #[test]
    fn a_uniform_offset_has_closed_forms() {
        let m = metrics(&uniform(0.75), &uniform(0.5)); // Both exact in f32.
        assert_eq!((m.rmse, m.max_abs), (0.25, 0.25));
        assert!((m.rel_mse - 0.0625 / 0.26).abs() < 1e-15);
        assert!((m.psnr.unwrap() - 20.0 * 4.0_f64.log10()).abs() < 1e-12);
        assert!(m.flip_mean > 0.1);
    }

    #[test]
    fn one_wrong_channel_of_one_pixel_counts_as_one_of_all() {
        let reference = uniform(0.5);
        let mut wrong = reference.clone();
        wrong.radiance[5][1] = 2.5;
        let m = metrics(&wrong, &reference);
        assert!((m.rmse - 2.0 / (3.0 * 32.0_f64).sqrt()).abs() < 1e-15);
        assert_eq!((m.max_abs, m.psnr, m.flip_mean), (2.0, None, 0.0)); // What is shown is the same.
        let difference = difference(&wrong, &reference).unwrap();
        assert_eq!(difference.radiance.iter().filter(|d| **d > 0.0).count(), 1);
        assert_eq!(difference.radiance[5], 2.0);
    }

    #[test]
    fn equal_pictures_differ_in_nothing() {
        let a = picture(8, 4, |x, y| [x as f32 / 8.0, y as f32, 0.3]);
        let m = metrics(&a, &a);
        assert_eq!((m.rmse, m.rel_mse, m.psnr, m.flip_mean, m.max_abs), (0.0, 0.0, None, 0.0, 0.0));
        assert_eq!((m.noise, m.rmse_less_noise), (None, None));
    }

    #[test]
    fn sequences_are_averaged_over_all_pixels() {
        let mut sum = difference(&uniform(0.75), &uniform(0.5)).unwrap().errors;
        sum.add(&difference(&uniform(0.5), &uniform(0.5)).unwrap().errors);
        let m = sum.metrics();
        assert!((m.rmse - 0.25 / 2.0_f64.sqrt()).abs() < 1e-15);
        assert!((m.psnr.unwrap() - 10.0 * 32.0_f64.log10()).abs() < 1e-12);
        assert_eq!(m.max_abs, 0.25);
    }

    #[test]
    fn values_that_are_not_finite_are_errors_that_name_the_pixel() {
        let good = uniform(0.5);
        for (which, bad) in [f32::NAN, f32::INFINITY].into_iter().enumerate() {
            let mut wrong = good.clone();
            wrong.radiance[11][2] = bad;
            let message = difference(&wrong, &good).unwrap_err().to_string();
            assert!(
                message.starts_with("a = radiance is not finite in 1 pixels, first at column 3, row 1"),
                "{message}"
            );
            let message = difference(&good, &wrong).unwrap_err().to_string();
            assert!(message.starts_with("reference = "), "{which}: {message}");
            assert!(add(&mut Popping::default(), [&good, &good], [&good, &wrong]).is_err());
        }
        let message = difference(&good, &picture(4, 8, |_, _| [0.5; 3])).unwrap_err().to_string();
        assert_eq!(message, "a = 8x4: expected the size of its reference, 4x8");
    }

    #[test]
    fn popping_is_the_change_that_motion_does_not_explain() {
        let mut popping = Popping::default();
        assert_eq!(popping.mean(), None);
        // The reference brightens by 0.25 a value, the picture by 0.375: half of the motion too much.
        add(&mut popping, [&uniform(0.0), &uniform(0.5)], [&uniform(0.375), &uniform(0.75)]).unwrap();
        assert_eq!(popping.mean(), Some(0.5));
        // A constant offset does not pop.
        add(&mut popping, [&uniform(0.0), &uniform(0.5)], [&uniform(0.25), &uniform(0.75)]).unwrap();
        assert_eq!((popping.mean(), popping.pairs(), popping.still_change()), (Some(0.25), 2, None));
    }

    #[test]
    fn pairs_whose_reference_stands_still_are_told_apart() {
        let mut popping = Popping::default();
        let still = [&uniform(0.5), &uniform(0.5)];
        add(&mut popping, still, still).unwrap();
        assert_eq!((popping.mean(), popping.still_pairs(), popping.still_change()), (None, 1, Some(0.0)));
        add(&mut popping, still, [&uniform(0.75), &uniform(0.5)]).unwrap();
        assert_eq!(popping.mean(), None);
        assert!((popping.still_change().unwrap() - 0.25 / 2.0_f64.sqrt()).abs() < 1e-15);
    }

    #[test]
    fn a_references_noise_is_taken_off() {
        let noisy = |value: f32| Reference { picture: uniform(value), variance: Some(vec![[0.0225; 3]; 32]) };
        let m = Difference::of("a", &uniform(0.75), &noisy(0.5)).unwrap().errors.metrics();
        assert!((m.noise.unwrap() - 0.15).abs() < 1e-6 && m.rmse == 0.25); // 0.0225 is rounded to f32.
        assert!((m.rmse_less_noise.unwrap() - 0.2).abs() < 1e-6); // 0.25² = 0.15² + 0.2²
        let m = Difference::of("a", &uniform(0.5), &noisy(0.5)).unwrap().errors.metrics();
        assert_eq!(m.rmse_less_noise, Some(0.0));

        let mut popping = Popping::default();
        // Squares per value: 1 less 0.045 is explained, 0.25 less 0.045 is not.
        popping.add("a", (&uniform(0.0), &noisy(0.0)), (&uniform(0.5), &noisy(1.0))).unwrap();
        assert!((popping.mean().unwrap() - (0.205_f64 / 0.955).sqrt()).abs() < 1e-6);
        popping.add("a", (&uniform(0.0), &noisy(0.0)), (&uniform(0.0), &noisy(0.125))).unwrap(); // Lost in the noise.
        assert_eq!((popping.pairs(), popping.still_pairs()), (1, 1));
        let bad = Reference { picture: uniform(0.5), variance: Some(vec![[-1.0; 3]; 32]) };
        assert!(Difference::of("a", &uniform(0.5), &bad).unwrap_err().to_string().contains("a variance of -1"));
    }
}
