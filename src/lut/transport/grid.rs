//! Radii, rays and the points on them.

/// A straight line through the ball, cut into points where the source is evaluated, in the direction of travel.
#[derive(Clone, Debug)]
pub struct Ray {
    /// Impact parameter.
    pub b: f64,
    /// Signed distance of each point from the closest one to the centre, ascending.
    pub x: Vec<f64>,
    /// For each point, the shell it lies on (where the radiance is wanted), if any.
    pub shell: Vec<Option<usize>>,
}

impl Ray {
    /// Radius and direction cosine (direction against radius) of point `k`.
    pub fn local(&self, k: usize) -> (f64, f64) {
        let r = self.b.hypot(self.x[k]);
        (r, if r > 0.0 { (self.x[k] / r).clamp(-1.0, 1.0) } else { 1.0 })
    }

    /// Cuts the line with impact parameter `b`: at every shell outside it, and between so that no step exceeds `step`.
    pub fn new(b: f64, shells: &[f64], step: f64) -> Self {
        let mut cuts: Vec<(f64, Option<usize>)> = Vec::new();
        for (i, &r) in shells.iter().enumerate() {
            if r > b * (1.0 + 1e-12) {
                let x = (r * r - b * b).sqrt();
                cuts.extend([(-x, Some(i)), (x, Some(i))]);
            } else if (r - b).abs() <= r * 1e-12 {
                cuts.push((0.0, Some(i)));
            }
        }
        cuts.sort_by(|a, b| a.0.total_cmp(&b.0));
        if cuts.len() < 2 {
            // The line misses every shell but the surface itself: a vanishing chord at the surface.
            return Self { b, x: cuts.iter().map(|c| c.0).collect(), shell: cuts.iter().map(|c| c.1).collect() };
        }
        let (mut x, mut shell) = (vec![cuts[0].0], vec![cuts[0].1]);
        for pair in cuts.windows(2) {
            let width = pair[1].0 - pair[0].0;
            let pieces = (width / step).ceil().max(1.0) as usize;
            for k in 1..pieces {
                x.push(pair[0].0 + width * k as f64 / pieces as f64);
                shell.push(None);
            }
            x.push(pair[1].0);
            shell.push(pair[1].1);
        }
        Self { b, x, shell }
    }
}

/// Radii of the shells: near the surface `finest` apart in optical depth, growing smoothly inwards; the last is 1.
pub fn shells(optical_radius: f64, count: usize, finest: f64) -> Vec<f64> {
    let intervals = (count - 1) as f64 + 0.5; // the half one is from the first shell to the centre
    let target = finest / optical_radius;
    // Depth(t) = sinh(a t) / sinh(a); find a with depth(1 / intervals) = target, unless even spacing is finer already.
    let depth = |a: f64, t: f64| if a < 1e-6 { t } else { (a * t).sinh() / a.sinh() };
    let (mut low, mut high) = (0.0, 40.0);
    if depth(0.0, 1.0 / intervals) > target {
        for _ in 0..80 {
            let a = 0.5 * (low + high);
            if depth(a, 1.0 / intervals) > target { low = a } else { high = a }
        }
    }
    let mut radii: Vec<f64> = (0..count).rev().map(|k| 1.0 - depth(low, k as f64 / intervals)).collect();
    radii[count - 1] = 1.0;
    radii
}

/// Impact parameters: tangent to every shell, and enough between that directions on every shell are at most `gap` apart,
/// closer about the tangent near the surface, where the radiance rises from nothing over a zenith cosine of 1 / 2R.
pub fn impact_parameters(shells: &[f64], optical_radius: f64, gap: f64) -> Vec<f64> {
    let mut all = vec![0.0];
    for &r in shells {
        let last = *all.last().unwrap_or(&0.0);
        let span = (last / r).min(1.0).acos();
        let layer = 0.25 / optical_radius + 0.5 * (optical_radius * (1.0 - r)).min(1.0);
        let mut elevations = Vec::new();
        let mut elevation = 0.0;
        while elevation < span {
            elevations.push(elevation);
            elevation += (TANGENT_GROWTH * (elevation + layer)).min(gap);
        }
        // Spread evenly in count so that the last gap is not a sliver.
        let stretch = span / elevation;
        all.extend(elevations.iter().rev().map(|e| if *e == 0.0 { r } else { r * (e * stretch).cos() }));
    }
    all
}

/// Growth of the angle between neighbouring directions with their elevation over the tangent (tuned).
const TANGENT_GROWTH: f64 = 0.5;

/// Four-point Lagrange interpolation on ascending nodes: first node and weights. Constant below the first node.
pub fn interpolation(nodes: &[f64], at: f64) -> (usize, [f64; 4]) {
    if at <= nodes[0] {
        return (0, [1.0, 0.0, 0.0, 0.0]);
    }
    let upper = nodes.partition_point(|&r| r < at);
    let first = upper.saturating_sub(2).min(nodes.len() - 4);
    let mut weights = [1.0; 4];
    for (a, weight) in weights.iter_mut().enumerate() {
        for b in (0..4).filter(|&b| b != a) {
            *weight *= (at - nodes[first + b]) / (nodes[first + a] - nodes[first + b]);
        }
    }
    (first, weights)
}

/// Weights of one step of optical depth `d` for a source that is a parabola through the step's start, its end and a third
/// point at `third` (optical depth from the start; beyond the end or before the start): `(attenuation, start, end, third)`.
///
/// Exact: `∫ S(t) e^(-(d - t)) dt` over the step. Without a third point (`None`) the source is linear.
pub fn step_weights(d: f64, third: Option<f64>) -> [f64; 4] {
    let attenuation = (-d).exp();
    // Moments of u = d - t (distance back from the end): e_k = ∫_0^d u^k e^-u du.
    let (e0, e1, e2) = if d < 0.05 {
        let series = |k: f64| {
            d.powf(k + 1.0)
                * (1.0 / (k + 1.0) - d / (k + 2.0) + d * d / (2.0 * (k + 3.0)) - d * d * d / (6.0 * (k + 4.0)))
        };
        (-(-d).exp_m1(), series(1.0), series(2.0))
    } else {
        let e0 = -(-d).exp_m1();
        let e1 = e0 - d * attenuation;
        (e0, e1, 2.0 * e1 - d * d * attenuation)
    };
    match third {
        None => [attenuation, e1 / d, e0 - e1 / d, 0.0],
        Some(t) => {
            let v = d - t; // in u: start d, end 0, third v (negative when beyond the end)
            let start = (e2 - v * e1) / (d * (d - v));
            let third = (e2 - d * e1) / (v * (v - d));
            [attenuation, start, e0 - start - third, third]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_is_exact_for_parabolas() {
        for d in [0.001, 0.049, 0.051, 0.7, 9.0] {
            for third in [1.6 * d, -0.4 * d] {
                let w = step_weights(d, Some(third));
                let f = |t: f64| 1.0 + 0.5 * t - 0.3 * t * t;
                let (nodes, weights) = crate::reference::quadrature::gauss_legendre(40);
                let exact: f64 = nodes
                    .iter()
                    .zip(&weights)
                    .map(|(x, q)| {
                        let t = 0.5 * d * (1.0 + x);
                        0.5 * d * q * f(t) * (t - d).exp()
                    })
                    .sum();
                let value = w[1] * f(0.0) + w[2] * f(d) + w[3] * f(third);
                assert!((value - exact).abs() < 1e-9, "{d} {third}: {value} {exact}");
            }
        }
    }

    #[test]
    fn shells_are_ascending_and_fine_at_the_surface() {
        for (r, count) in [(0.5, 16), (8.0, 28), (128.0, 44)] {
            let shells = shells(r, count, 0.1);
            assert!(shells.windows(2).all(|p| p[0] < p[1]) && shells[0] > 0.0 && shells[count - 1] == 1.0);
            assert!((1.0 - shells[count - 2]) * r <= 0.11 || r < 2.0);
        }
    }
}
