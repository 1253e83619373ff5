//! Billow noise in f64 (`glsl/detail/billow.glsl`).

/// Lattice cells along the edge of the tile.
pub const CELLS: i32 = 8;
/// F1² at which the value reaches 0 [cells²].
pub const REACH: f64 = 0.75;

/// PCG-3D hash (Jarzynski and Olano, 2020).
#[must_use]
pub fn pcg3d(v: [u32; 3]) -> [u32; 3] {
    let [mut x, mut y, mut z] = v.map(|c| c.wrapping_mul(1_664_525).wrapping_add(1_013_904_223));
    x = x.wrapping_add(y.wrapping_mul(z));
    y = y.wrapping_add(z.wrapping_mul(x));
    z = z.wrapping_add(x.wrapping_mul(y));
    (x, y, z) = (x ^ x >> 16, y ^ y >> 16, z ^ z >> 16);
    x = x.wrapping_add(y.wrapping_mul(z));
    y = y.wrapping_add(z.wrapping_mul(x));
    z = z.wrapping_add(x.wrapping_mul(y));
    [x, y, z]
}

/// Value in [0, 1] and gradient [1/cell] at `p` [cells]; the tile repeats after [`CELLS`].
#[must_use]
pub fn billow(p: [f64; 3]) -> (f64, [f64; 3]) {
    let base = p.map(|c| c.floor() as i32);
    let mut nearest = f64::INFINITY;
    let mut offset = [0.0; 3];
    for step in 0..27 {
        let cell = [base[0] + step % 3 - 1, base[1] + step / 3 % 3 - 1, base[2] + step / 9 - 1];
        let jitter = pcg3d(cell.map(|c| c.rem_euclid(CELLS) as u32)).map(|word| f64::from(word >> 8) / 16_777_216.0);
        let d: [f64; 3] = std::array::from_fn(|i| p[i] - f64::from(cell[i]) - jitter[i]);
        let d2 = d.iter().map(|c| c * c).sum::<f64>();
        if d2 < nearest {
            (nearest, offset) = (d2, d);
        }
    }
    let value = 1.0 - nearest / REACH;
    if value > 0.0 { (value, offset.map(|c| -2.0 * c / REACH)) } else { (0.0, [0.0; 3]) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tile_repeats() {
        let p = [1.3, 6.9, 0.2];
        let far = [p[0] + f64::from(CELLS), p[1] - f64::from(CELLS), p[2] + 2.0 * f64::from(CELLS)];
        assert!((billow(p).0 - billow(far).0).abs() < 1e-12);
    }

    #[test]
    fn the_gradient_is_the_slope_of_the_value() {
        let h = 1e-6;
        for p in [[0.3, 0.4, 0.5], [2.2, 7.1, 3.9], [5.5, 0.01, 6.3]] {
            let (value, gradient) = billow(p);
            assert!(value > 0.0, "choose a point on a bump");
            for axis in 0..3 {
                let mut q = p;
                q[axis] += h;
                assert!(((billow(q).0 - value) / h - gradient[axis]).abs() < 1e-4);
            }
        }
    }
}
