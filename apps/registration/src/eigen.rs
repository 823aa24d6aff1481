//! Eigenvalues of small symmetric matrices.

use nalgebra::{SMatrix, SVector};

/// After so many sweeps every matrix of finite numbers is diagonal to rounding: convergence is quadratic, and 4 to 6 are usual.
const SWEEPS: usize = 16;

/// Eigenvalues in ascending order, and the unit eigenvectors that belong to them as columns, by Jacobi's rotations (Golub and Van Loan,
/// *Matrix Computations*, 8.5.2).
pub(crate) fn symmetric<const N: usize>(matrix: &SMatrix<f64, N, N>) -> (SVector<f64, N>, SMatrix<f64, N, N>) {
    let mut a = *matrix;
    let mut vectors = SMatrix::<f64, N, N>::identity();
    let negligible = a.norm_squared() * 1e-28;
    for _ in 0..SWEEPS {
        let mut off = 0.0;
        for p in 0..N {
            for q in p + 1..N {
                off += a[(p, q)] * a[(p, q)];
            }
        }
        if off <= negligible {
            break;
        }
        for p in 0..N {
            for q in p + 1..N {
                rotate(&mut a, &mut vectors, p, q);
            }
        }
    }
    let mut order: [usize; N] = std::array::from_fn(|i| i);
    order.sort_by(|&i, &j| a[(i, i)].total_cmp(&a[(j, j)]));
    let values = SVector::from_fn(|i, _| a[(order[i], order[i])]);
    (values, SMatrix::from_fn(|row, column| vectors[(row, order[column])]))
}

/// Makes the element (p, q) zero.
fn rotate<const N: usize>(a: &mut SMatrix<f64, N, N>, vectors: &mut SMatrix<f64, N, N>, p: usize, q: usize) {
    if a[(p, q)] == 0.0 {
        return;
    }
    let tau = (a[(q, q)] - a[(p, p)]) / (2.0 * a[(p, q)]);
    let t = tau.signum() / (tau.abs() + (1.0 + tau * tau).sqrt());
    let c = 1.0 / (1.0 + t * t).sqrt();
    let s = t * c;
    let turned = |x: f64, y: f64| (c * x - s * y, s * x + c * y);
    for i in 0..N {
        (a[(i, p)], a[(i, q)]) = turned(a[(i, p)], a[(i, q)]);
    }
    for i in 0..N {
        (a[(p, i)], a[(q, i)]) = turned(a[(p, i)], a[(q, i)]);
        (vectors[(i, p)], vectors[(i, q)]) = turned(vectors[(i, p)], vectors[(i, q)]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_matrix_is_made_of_its_eigenvectors(entries in prop::array::uniform21(-3.0..3.0f64)) {
            let mut entries = entries.into_iter();
            let mut matrix = SMatrix::<f64, 6, 6>::zeros();
            for row in 0..6 {
                for column in row..6 {
                    matrix[(row, column)] = entries.next().unwrap();
                    matrix[(column, row)] = matrix[(row, column)];
                }
            }
            let (values, vectors) = symmetric(&matrix);
            let again = vectors * SMatrix::from_diagonal(&values) * vectors.transpose();
            prop_assert!((again - matrix).norm() < 1e-12, "{again} is not {matrix}");
            prop_assert!((vectors.transpose() * vectors - SMatrix::<f64, 6, 6>::identity()).norm() < 1e-12);
            prop_assert!(values.as_slice().is_sorted());
        }
    }

    #[test]
    fn what_has_no_extent_has_axes_all_the_same() {
        let (values, vectors) = symmetric(&SMatrix::<f64, 3, 3>::zeros());
        assert_eq!((values, vectors), (SVector::zeros(), SMatrix::identity()));
    }
}
