//! The discrete Laplacian as a weighted graph on a box of cells, matrix-free.

use super::{Cell, Problem};

/// `A` with `(Aψ)ᵢ = dᵢψᵢ − Σ wᵢⱼψⱼ` over the six neighbours, for the cells inside; zero for all others.
///
/// Vectors cover the whole box and are zero outside, so a product is the same few instructions for every cell and the
/// compiler turns rows of them into vector code.
#[derive(Debug, Clone)]
pub struct Operator {
    /// Cells along x, y and z, a halo of one cell outside the domain included.
    pub dim: [usize; 3],
    /// Weight to the next cell along x, y and z.
    pub weights: [Vec<f32>; 3],
    /// Sum of the weights to all neighbours, those with fixed values included; 0 outside.
    pub diagonal: Vec<f32>,
    /// 1 / diagonal; 0 outside.
    pub inverse: Vec<f32>,
    /// For every row of cells along x that has any inside: from its first to past its last.
    pub rows: Vec<(usize, usize)>,
}

impl Operator {
    /// The operator of a problem: weight 1 between neighbours that are both in the domain.
    pub fn of(problem: &Problem) -> Self {
        let strides = strides(problem.dim);
        let cells = &problem.cells;
        let inside = |i: usize| cells[i] == Cell::Inside;
        let weight = |i: usize, s: usize| f32::from(u8::from(inside(i) && inside(i + s)));
        let mut weights = strides.map(|_| vec![0.0; cells.len()]);
        let mut diagonal = vec![0.0; cells.len()];
        for i in (0..cells.len()).filter(|&i| inside(i)) {
            for (axis, s) in strides.into_iter().enumerate() {
                weights[axis][i] = weight(i, s);
                let exists = |n: &usize| cells[*n] != Cell::Outside;
                diagonal[i] += [i - s, i + s].iter().filter(|n| exists(n)).count() as f32;
            }
        }
        Self::new(problem.dim, weights, diagonal)
    }

    /// An operator from its weights and its diagonal.
    pub fn new(dim: [usize; 3], weights: [Vec<f32>; 3], diagonal: Vec<f32>) -> Self {
        let inverse = diagonal.iter().map(|d| if *d > 0.0 { 1.0 / d } else { 0.0 });
        Self { dim, weights, inverse: inverse.collect(), rows: rows(dim, &diagonal), diagonal }
    }

    /// Number of cells of the box.
    pub fn len(&self) -> usize {
        self.diagonal.len()
    }

    /// Whether the box is empty.
    pub fn is_empty(&self) -> bool {
        self.diagonal.is_empty()
    }

    /// Calls `f` with the product `(Ax)ᵢ`, row by row: the row's first cell and the products.
    #[inline]
    pub fn for_rows(&self, x: &[f32], mut f: impl FnMut(usize, &[f32])) {
        let [_, sy, sz] = strides(self.dim);
        let [wx, wy, wz] = &self.weights;
        let mut buffer = vec![0.0; self.dim[0]];
        for &(from, to) in &self.rows {
            let n = to - from;
            let row = |v, i| slice(v, i, n);
            let (d, xi) = (row(&self.diagonal, from), row(x, from));
            let (x0, x1) = (row(x, from - 1), row(x, from + 1));
            let (y0, y1) = (row(x, from - sy), row(x, from + sy));
            let (z0, z1) = (row(x, from - sz), row(x, from + sz));
            let (wx0, wx1) = (row(wx, from - 1), row(wx, from));
            let (wy0, wy1) = (row(wy, from - sy), row(wy, from));
            let (wz0, wz1) = (row(wz, from - sz), row(wz, from));
            let out = &mut buffer[..n];
            for i in 0..n {
                out[i] = d[i] * xi[i]
                    - (wx0[i] * x0[i] + wx1[i] * x1[i])
                    - (wy0[i] * y0[i] + wy1[i] * y1[i])
                    - (wz0[i] * z0[i] + wz1[i] * z1[i]);
            }
            f(from, out);
        }
    }

    /// `y = Ax`, and the inner product of the two.
    pub fn multiply(&self, x: &[f32], y: &mut [f32]) -> f64 {
        let mut product = 0.0;
        self.for_rows(x, |from, ax| {
            y[from..from + ax.len()].copy_from_slice(ax);
            product += dot_row(ax, slice(x, from, ax.len()));
        });
        product
    }

    /// `r = b − Ax`.
    pub fn residual(&self, x: &[f32], b: &[f32], r: &mut [f32]) {
        self.for_rows(x, |from, ax| {
            let r = &mut r[from..from + ax.len()];
            for ((r, ax), b) in r.iter_mut().zip(ax).zip(slice(b, from, ax.len())) {
                *r = b - ax;
            }
        });
    }

    /// `y = x + ω D⁻¹ (b − Ax)`: one damped Jacobi sweep.
    pub fn relax(&self, x: &[f32], b: &[f32], omega: f32, y: &mut [f32]) {
        self.for_rows(x, |from, ax| {
            let n = ax.len();
            let (x, b) = (slice(x, from, n), slice(b, from, n));
            let inverse = slice(&self.inverse, from, n);
            let y = &mut y[from..from + n];
            for i in 0..n {
                y[i] = x[i] + omega * inverse[i] * (b[i] - ax[i]);
            }
        });
    }

    /// `z = D⁻¹ r`.
    pub fn divide_by_diagonal(&self, r: &[f32], z: &mut [f32]) {
        for ((z, r), i) in z.iter_mut().zip(r).zip(&self.inverse) {
            *z = r * i;
        }
    }

    /// `⟨x, y⟩`, summed row by row in double precision.
    pub fn dot(&self, x: &[f32], y: &[f32]) -> f64 {
        let rows = self.rows.iter();
        rows.map(|&(from, to)| dot_row(&x[from..to], &y[from..to])).sum()
    }

    /// `‖b − Ax‖ / ‖b‖`, or `‖b − Ax‖` if `b` is zero.
    pub fn relative_residual(&self, x: &[f32], b: &[f32]) -> f64 {
        let mut r = vec![0.0; self.len()];
        let inside: Vec<f32> = x.iter().zip(&self.diagonal).map(|(x, d)| if *d > 0.0 { *x } else { 0.0 }).collect();
        self.residual(&inside, b, &mut r);
        let scale = self.dot(b, b).sqrt();
        self.dot(&r, &r).sqrt() / if scale > 0.0 { scale } else { 1.0 }
    }
}

/// Index steps along x, y and z.
pub fn strides(dim: [usize; 3]) -> [usize; 3] {
    [1, dim[0], dim[0] * dim[1]]
}

/// What the fixed neighbours give: for every cell inside, the sum of their values.
pub fn right_hand_side(problem: &Problem) -> Vec<f32> {
    let mut b = vec![0.0; problem.cells.len()];
    for (i, value) in problem.cells.iter().map(|c| c.fixed()).enumerate() {
        let Some(value) = value else { continue };
        for n in strides(problem.dim).into_iter().flat_map(|s| [i - s, i + s]) {
            if problem.cells[n] == Cell::Inside {
                b[n] += value;
            }
        }
    }
    b
}

fn slice(v: &[f32], from: usize, n: usize) -> &[f32] {
    &v[from..from + n]
}

fn dot_row(a: &[f32], b: &[f32]) -> f64 {
    let lanes = a.chunks_exact(8).zip(b.chunks_exact(8));
    let mut sum = [0.0f32; 8];
    for (a, b) in lanes {
        for i in 0..8 {
            sum[i] += a[i] * b[i];
        }
    }
    let tail = a.len() / 8 * 8;
    let rest: f32 = a[tail..].iter().zip(&b[tail..]).map(|(a, b)| a * b).sum();
    sum.iter().map(|s| f64::from(*s)).sum::<f64>() + f64::from(rest)
}

fn rows(dim: [usize; 3], diagonal: &[f32]) -> Vec<(usize, usize)> {
    let rows = diagonal.chunks_exact(dim[0]).enumerate();
    rows.filter_map(|(n, row)| {
        let first = row.iter().position(|d| *d > 0.0)?;
        let last = row.iter().rposition(|d| *d > 0.0)?;
        Some((n * dim[0] + first, n * dim[0] + last + 1))
    })
    .collect()
}
