//! The discrete Laplacian on a box of cells, matrix-free.

use crate::problem::{Cell, Problem};

/// `A` with `(Aψ)ᵢ = dᵢψᵢ − Σ ψⱼ` over the six neighbours, for the cells inside; zero for all others.
///
/// Vectors cover the whole box and are zero outside, so a product is the same few instructions for every cell and the
/// compiler turns rows of them into vector code.
#[derive(Debug, Clone)]
pub struct Operator {
    /// Cells along x, y and z, a halo of one cell outside the domain included.
    pub dim: [usize; 3],
    /// How many neighbours are in the domain, those with fixed values included; 0 outside.
    pub diagonal: Vec<f32>,
    /// 1 / diagonal; 0 outside.
    pub inverse: Vec<f32>,
    /// For every row of cells along x that has any inside: from its first to past its last.
    pub rows: Vec<(usize, usize)>,
}

impl Operator {
    /// The operator of a problem: weight 1 between neighbours that are both in the domain.
    pub fn of(problem: &Problem) -> Self {
        let cells = problem.cells();
        let strides = strides(problem.dim());
        let count = |i: usize| {
            let exists = |n: &usize| cells[*n] != Cell::Outside;
            let neighbours = strides.into_iter().flat_map(|s| [i - s, i + s]);
            neighbours.filter(exists).count() as f32
        };
        let diagonal = cells.iter().enumerate().map(|(i, c)| if *c == Cell::Inside { count(i) } else { 0.0 });
        let (dim, diagonal) = (problem.dim(), diagonal.collect::<Vec<f32>>());
        let inverse = diagonal.iter().map(|d| if *d > 0.0 { 1.0 / d } else { 0.0 });
        Self { dim, inverse: inverse.collect(), rows: rows(dim, &diagonal), diagonal }
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
        let mut buffer = vec![0.0; self.dim[0]];
        for &(from, to) in &self.rows {
            let out = &mut buffer[..to - from];
            self.row(x, from, out);
            f(from, out);
        }
    }

    /// All weights are 1. Cells outside have ψ = 0, so that only their own rows have to be left out.
    // A function of its own, so that the compiler knows `out` to overlap with nothing, and makes vector code of it.
    #[inline(never)]
    fn row(&self, x: &[f32], from: usize, out: &mut [f32]) {
        let [_, sy, sz] = strides(self.dim);
        let n = out.len();
        let d = slice(&self.diagonal, from, n);
        let row = |i| slice(x, i, n);
        let (xi, x0, x1) = (row(from), row(from - 1), row(from + 1));
        let (y0, y1, z0, z1) = (row(from - sy), row(from + sy), row(from - sz), row(from + sz));
        for i in 0..n {
            let ax = d[i] * xi[i] - (x0[i] + x1[i]) - (y0[i] + y1[i]) - (z0[i] + z1[i]);
            out[i] = if d[i] > 0.0 { ax } else { 0.0 };
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
            let n = ax.len();
            subtract(slice(b, from, n), ax, &mut r[from..from + n]);
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
    let mut b = vec![0.0; problem.cells().len()];
    for (i, value) in problem.cells().iter().map(|c| c.fixed()).enumerate() {
        let Some(value) = value else { continue };
        for n in strides(problem.dim()).into_iter().flat_map(|s| [i - s, i + s]) {
            if problem.cells()[n] == Cell::Inside {
                b[n] += value;
            }
        }
    }
    b
}

fn slice(v: &[f32], from: usize, n: usize) -> &[f32] {
    &v[from..from + n]
}

#[inline(never)]
fn subtract(a: &[f32], b: &[f32], out: &mut [f32]) {
    for ((out, a), b) in out.iter_mut().zip(a).zip(b) {
        *out = a - b;
    }
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
