//! Points put together: how many, where in the mean, how they scatter.

use nalgebra::{SMatrix, SVector};

use crate::eigen;

/// The first moments of a set of points. Those of a union are the sum of those of its parts (Chan, Golub and LeVeque, COMPSTAT 1982), so that
/// a map needs to keep no point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moments<const D: usize> {
    /// How many points.
    pub count: f64,
    /// Their mean, metres.
    pub mean: SVector<f64, D>,
    /// Σ (p − mean)(p − mean)ᵀ, m².
    pub scatter: SMatrix<f64, D, D>,
}

impl<const D: usize> Moments<D> {
    /// Of no point.
    pub const NONE: Self = Self {
        count: 0.0,
        mean: SVector::from_array_storage(nalgebra::ArrayStorage([[0.0; D]])),
        scatter: SMatrix::from_array_storage(nalgebra::ArrayStorage([[0.0; D]; D])),
    };

    /// Of one point.
    pub fn of(point: SVector<f64, D>) -> Self {
        Self { count: 1.0, mean: point, scatter: SMatrix::zeros() }
    }

    /// Adds those of other points.
    pub fn add(&mut self, other: &Self) {
        let count = self.count + other.count;
        if count == 0.0 {
            return;
        }
        let apart = other.mean - self.mean;
        let share = other.count / count;
        self.mean += apart * share;
        self.scatter += other.scatter + apart * apart.transpose() * (self.count * share);
        self.count = count;
    }

    /// Of the same points seen from elsewhere: R p + t.
    pub fn seen(&self, rotation: &SMatrix<f64, D, D>, translation: &SVector<f64, D>) -> Self {
        Self {
            count: self.count,
            mean: rotation * self.mean + translation,
            scatter: rotation * self.scatter * rotation.transpose(),
        }
    }

    /// The direction in which the points scatter least, and their variances along the principal axes, ascending, m² (principal components).
    pub fn principal(&self) -> (SVector<f64, D>, SVector<f64, D>) {
        let (values, vectors) = eigen::symmetric(&(self.scatter / self.count));
        (vectors.column(0).into_owned(), values)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn moments_of_parts_add_up(points in prop::collection::vec(prop::array::uniform3(-50.0..50.0f64), 1..40), cut in 0usize..40) {
            let points: Vec<SVector<f64, 3>> = points.into_iter().map(SVector::from).collect();
            let of = |points: &[SVector<f64, 3>]| points.iter().fold(Moments::NONE, |mut all, &point| {
                all.add(&Moments::of(point));
                all
            });
            let cut = cut.min(points.len());
            let mut parts = of(&points[..cut]);
            parts.add(&of(&points[cut..]));
            let n = points.len() as f64;
            let mean = points.iter().sum::<SVector<f64, 3>>() / n;
            let scatter: SMatrix<f64, 3, 3> = points.iter().map(|p| (p - mean) * (p - mean).transpose()).sum();
            prop_assert_eq!(parts.count, n);
            prop_assert!((parts.mean - mean).norm() < 1e-9);
            prop_assert!((parts.scatter - scatter).norm() < 1e-6);
        }
    }
}
