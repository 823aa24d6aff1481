//! Mean, spread and extremes of numbers, one by one or in parts.

/// What a run of numbers amounts to (Welford 1962; parts put together after Chan, Golub and LeVeque 1979).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// How many.
    pub count: u64,
    /// Their mean.
    pub mean: f64,
    /// Sum of the squares of their distances from the mean.
    squares: f64,
    /// The smallest; infinite if there is none.
    pub min: f64,
    /// The largest; minus infinity if there is none.
    pub max: f64,
}

impl Default for Spread {
    fn default() -> Self {
        Self { count: 0, mean: 0.0, squares: 0.0, min: f64::INFINITY, max: f64::NEG_INFINITY }
    }
}

impl Spread {
    /// Takes note of a number.
    pub fn note(&mut self, number: f64) {
        self.merge(&Self { count: 1, mean: number, squares: 0.0, min: number, max: number });
    }

    /// Takes note of all numbers of another run.
    pub fn merge(&mut self, other: &Self) {
        if other.count == 0 {
            return;
        }
        let count = self.count + other.count;
        let share = other.count as f64 / count as f64;
        let apart = other.mean - self.mean;
        self.squares += other.squares + apart * apart * self.count as f64 * share;
        self.mean += apart * share;
        self.count = count;
        self.min = self.min.min(other.min);
        self.max = self.max.max(other.max);
    }

    /// Their standard deviation (of these numbers, not estimated for others).
    pub fn deviation(&self) -> f64 {
        (self.squares / self.count.max(1) as f64).sqrt()
    }

    /// Their sum.
    pub fn sum(&self) -> f64 {
        self.mean * self.count as f64
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn of(numbers: &[f64]) -> Spread {
        let mut spread = Spread::default();
        numbers.iter().for_each(|number| spread.note(*number));
        spread
    }

    proptest! {
        #[test]
        fn parts_amount_to_the_whole_and_the_whole_to_the_definition(
            numbers in prop::collection::vec(-1e3..1e3f64, 1..50), cut in 0..50usize,
        ) {
            let cut = cut.min(numbers.len());
            let mut parts = of(&numbers[..cut]);
            parts.merge(&of(&numbers[cut..]));
            let count = numbers.len() as f64;
            let mean = numbers.iter().sum::<f64>() / count;
            let deviation = (numbers.iter().map(|n| (n - mean).powi(2)).sum::<f64>() / count).sqrt();
            for spread in [parts, of(&numbers)] {
                prop_assert!((spread.mean - mean).abs() < 1e-9 && (spread.deviation() - deviation).abs() < 1e-6);
                prop_assert_eq!(spread.count, numbers.len() as u64);
                prop_assert_eq!(spread.min, numbers.iter().copied().fold(f64::INFINITY, f64::min));
                prop_assert_eq!(spread.max, numbers.iter().copied().fold(f64::NEG_INFINITY, f64::max));
            }
        }
    }
}
