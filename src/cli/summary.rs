//! Numbers about several frames.

/// The middle value; the mean of the two middle ones of an even count; `None` of nothing.
pub fn median(values: &[f64]) -> Option<f64> {
    let sorted = sorted(values);
    let middle = sorted.len() / 2;
    match sorted.len() {
        0 => None,
        n if n % 2 == 1 => Some(sorted[middle]),
        _ => Some((sorted[middle - 1] + sorted[middle]) * 0.5),
    }
}

/// The smallest value that at least 95 % of the values do not exceed; `None` of nothing.
pub fn p95(values: &[f64]) -> Option<f64> {
    let sorted = sorted(values);
    let rank = (sorted.len() * 95).div_ceil(100);
    sorted.get(rank.checked_sub(1)?).copied()
}

/// Two of the values between which the median of all that they were drawn from lies with 95 % (order statistics; the binomial
/// distribution by its normal approximation); the extremes of fewer than eight; `None` of nothing.
pub fn median_bounds(values: &[f64]) -> Option<[f64; 2]> {
    let sorted = sorted(values);
    let n = sorted.len() as f64;
    let first = (0.5 * n - 0.98 * n.sqrt()).floor().max(0.0) as usize;
    Some([*sorted.get(first)?, *sorted.get(sorted.len().checked_sub(first + 1)?)?])
}

fn sorted(values: &[f64]) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted
}

/// Times per pass name over many frames, in the order in which passes first appeared.
#[derive(Default)]
pub struct PassTimes(Vec<(String, Vec<f64>)>);

impl PassTimes {
    /// Adds the time [ms] of a pass in one frame.
    pub fn add(&mut self, name: &str, gpu_ms: f64) {
        match self.0.iter_mut().find(|(known, _)| known == name) {
            Some((_, times)) => times.push(gpu_ms),
            None => self.0.push((name.to_owned(), vec![gpu_ms])),
        }
    }

    /// Name and times of each pass.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &[f64])> {
        self.0.iter().map(|(name, times)| (name.as_str(), times.as_slice()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_and_percentiles() {
        assert_eq!(median(&[]), None);
        assert_eq!(median(&[3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(&[4.0, 1.0, 2.0, 3.0]), Some(2.5));
        assert_eq!(p95(&[]), None);
        assert_eq!(p95(&[7.0]), Some(7.0));
        let hundred: Vec<f64> = (1..=100).rev().map(f64::from).collect();
        assert_eq!(p95(&hundred), Some(95.0));
        assert_eq!(median_bounds(&[]), None);
        assert_eq!(median_bounds(&[7.0]), Some([7.0, 7.0]));
        assert_eq!(median_bounds(&[3.0, 1.0, 2.0]), Some([1.0, 3.0]));
        // The 41st and the 60th of a hundred hold the median with 94.3 %, by the binomial distribution.
        assert_eq!(median_bounds(&hundred), Some([41.0, 60.0]));
    }
}
