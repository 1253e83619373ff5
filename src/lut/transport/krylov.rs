//! GMRES for `x = b + A x`, where A is only known by applying it.

/// What the iteration did.
#[derive(Clone, Copy, Debug, Default)]
pub struct Convergence {
    /// How often the operator was applied.
    pub applications: usize,
    /// Final residual relative to the right-hand side.
    pub residual: f64,
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// One unknown vector's Krylov space; many of them are advanced together so that one pass on the device serves all.
pub struct Gmres {
    x: Vec<f64>,
    basis: Vec<Vec<f64>>,
    /// Columns of the Hessenberg matrix, already rotated to upper triangular form.
    columns: Vec<Vec<f64>>,
    rotations: Vec<(f64, f64)>,
    rhs: Vec<f64>,
    norm: f64,
    target: f64,
    restart: usize,
    state: State,
    applications: usize,
}

#[derive(Clone, Copy, PartialEq)]
enum State {
    Residual,
    Arnoldi,
    Done,
}

impl Gmres {
    /// Starts from `x = b`; stops when the residual has fallen below `tolerance` times |b|.
    pub fn new(b: &[f64], tolerance: f64, restart: usize) -> Self {
        let norm = dot(b, b).sqrt();
        let state = if norm > 0.0 { State::Residual } else { State::Done };
        Self {
            x: b.to_vec(),
            basis: Vec::new(),
            columns: Vec::new(),
            rotations: Vec::new(),
            rhs: Vec::new(),
            norm,
            target: tolerance * norm,
            restart,
            state,
            applications: 0,
        }
    }

    /// The vector that the operator is to be applied to next; `None` when converged.
    pub fn request(&self) -> Option<&[f64]> {
        match self.state {
            State::Residual => Some(&self.x),
            State::Arnoldi => self.basis.last().map(Vec::as_slice),
            State::Done => None,
        }
    }

    /// Takes `A v` for the vector `v` requested, and the right-hand side `b`.
    pub fn supply(&mut self, applied: &[f64], b: &[f64]) {
        self.applications += 1;
        match self.state {
            State::Residual => {
                let mut residual: Vec<f64> = applied.iter().zip(&self.x).zip(b).map(|((a, x), b)| b + a - x).collect();
                let beta = dot(&residual, &residual).sqrt();
                if beta <= self.target {
                    self.rhs = vec![beta];
                    self.state = State::Done;
                    return;
                }
                residual.iter_mut().for_each(|r| *r /= beta);
                self.basis = vec![residual];
                self.columns.clear();
                self.rotations.clear();
                self.rhs = vec![beta];
                self.state = State::Arnoldi;
            }
            State::Arnoldi => self.extend(applied),
            State::Done => {}
        }
    }

    fn extend(&mut self, applied: &[f64]) {
        let Some(last) = self.basis.last() else { return };
        // The matrix is I - A.
        let mut w: Vec<f64> = last.iter().zip(applied).map(|(v, a)| v - a).collect();
        let mut column = Vec::with_capacity(self.basis.len() + 1);
        for v in &self.basis {
            let h = dot(v, &w);
            w.iter_mut().zip(v).for_each(|(w, v)| *w -= h * v);
            column.push(h);
        }
        let mut below = dot(&w, &w).sqrt();
        for (k, &(c, s)) in self.rotations.iter().enumerate() {
            (column[k], column[k + 1]) = (c * column[k] + s * column[k + 1], c * column[k + 1] - s * column[k]);
        }
        let k = column.len() - 1;
        let breakdown = below <= 1e-14 * self.norm.max(1e-300) && below <= 1e-13;
        let length = column[k].hypot(below).max(1e-300);
        let (c, s) = (column[k] / length, below / length);
        column[k] = length;
        self.rotations.push((c, s));
        self.columns.push(column);
        let tail = self.rhs[k];
        self.rhs[k] = c * tail;
        self.rhs.push(-s * tail);
        let residual = (s * tail).abs();
        if residual <= self.target || breakdown {
            self.combine();
            self.rhs = vec![residual];
            self.state = State::Done;
        } else if self.columns.len() >= self.restart {
            self.combine();
            self.state = State::Residual;
        } else {
            below = below.max(1e-300);
            w.iter_mut().for_each(|w| *w /= below);
            self.basis.push(w);
        }
    }

    fn combine(&mut self) {
        let n = self.columns.len();
        let mut y = vec![0.0; n];
        for i in (0..n).rev() {
            let sum: f64 = (i + 1..n).map(|k| self.columns[k][i] * y[k]).sum();
            y[i] = (self.rhs[i] - sum) / self.columns[i][i];
        }
        for (v, y) in self.basis.iter().zip(&y) {
            self.x.iter_mut().zip(v).for_each(|(x, v)| *x += y * v);
        }
        self.basis.clear();
    }

    /// The solution and how it was reached.
    pub fn finish(self) -> (Vec<f64>, Convergence) {
        let residual = self.rhs.last().map_or(0.0, |r| r.abs()) / self.norm.max(1e-300);
        (self.x, Convergence { applications: self.applications, residual })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solves_a_slowly_converging_system() {
        let n = 40;
        let apply = |x: &[f64]| -> Vec<f64> {
            (0..n)
                .map(|i| {
                    let left = if i > 0 { x[i - 1] } else { 0.0 };
                    let right = if i + 1 < n { x[i + 1] } else { 0.0 };
                    0.52 * left + 0.45 * right // spectral radius 0.965
                })
                .collect()
        };
        let b: Vec<f64> = (0..n).map(|i| (i as f64).cos()).collect();
        let mut gmres = Gmres::new(&b, 1e-10, 50);
        while let Some(v) = gmres.request() {
            let applied = apply(v);
            gmres.supply(&applied, &b);
        }
        let (x, convergence) = gmres.finish();
        let error = apply(&x).iter().zip(&x).zip(&b).map(|((a, x), b)| (b + a - x).abs()).fold(0.0, f64::max);
        assert!(error < 1e-8 && convergence.applications <= 45, "{error} {convergence:?}");
    }
}
