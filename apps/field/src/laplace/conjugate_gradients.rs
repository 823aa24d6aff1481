//! Conjugate gradients (Hestenes and Stiefel, 1952), preconditioned by the diagonal, for a symmetric positive definite
//! operator.

use super::operator::Operator;

/// Past this something is wrong with the problem, not with the number.
const MAX_ITERATIONS: usize = 5000;

/// Solves `Ax = b` from zero until `‖r‖ ≤ tolerance ‖b‖`, or somebody is `stopping`.
/// Answers `x` and the iterations it took.
pub fn solve(operator: &Operator, b: &[f32], tolerance: f64, stopping: impl Fn() -> bool) -> (Vec<f32>, usize) {
    let zero = vec![0.0; operator.len()];
    let (mut x, mut r) = (zero.clone(), b.to_vec());
    let (mut z, mut p, mut ap) = (zero.clone(), zero.clone(), zero);
    let enough = tolerance * operator.dot(b, b).sqrt();
    let mut rz = 0.0;
    for iteration in 0..MAX_ITERATIONS {
        if operator.dot(&r, &r).sqrt() <= enough || stopping() {
            return (x, iteration);
        }
        operator.divide_by_diagonal(&r, &mut z);
        let next = operator.dot(&r, &z);
        let beta = if iteration == 0 { 0.0 } else { next / rz } as f32;
        rz = next;
        combine(operator, &z, beta, &mut p);
        let curvature = operator.multiply(&p, &mut ap);
        if curvature <= 0.0 {
            // Rounding has used up the precision: nothing more to gain.
            return (x, iteration);
        }
        let alpha = (rz / curvature) as f32;
        add(operator, alpha, &p, &mut x);
        add(operator, -alpha, &ap, &mut r);
    }
    (x, MAX_ITERATIONS)
}

/// `p = z + β p`.
fn combine(operator: &Operator, z: &[f32], beta: f32, p: &mut [f32]) {
    for &(from, to) in &operator.rows {
        for (p, z) in p[from..to].iter_mut().zip(&z[from..to]) {
            *p = z + beta * *p;
        }
    }
}

/// `y += α x`.
fn add(operator: &Operator, alpha: f32, x: &[f32], y: &mut [f32]) {
    for &(from, to) in &operator.rows {
        for (y, x) in y[from..to].iter_mut().zip(&x[from..to]) {
            *y += alpha * x;
        }
    }
}
