//! Means, paired differences and what they are worth.

/// Mean and standard deviation of a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Its size.
    pub count: usize,
    /// Mean.
    pub mean: f64,
    /// Standard deviation of the sample (over n − 1); 0 of a single value.
    pub sd: f64,
}

impl Sample {
    /// Of these values; `None`: there is none.
    pub fn of(values: &[f64]) -> Option<Self> {
        let count = values.len();
        let mean = values.iter().sum::<f64>() / count as f64;
        let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
        let sd = if count > 1 { (squares / (count - 1) as f64).sqrt() } else { 0.0 };
        (count > 0).then_some(Self { count, mean, sd })
    }
}

/// What the differences of pairs come to: Student's t test for paired samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Paired {
    /// Pairs.
    pub pairs: usize,
    /// Mean difference.
    pub mean: f64,
    /// Ends of its 95 % confidence interval.
    pub interval: [f64; 2],
    /// How likely a mean at least as far from 0 is by chance (two-sided).
    pub p: f64,
}

impl Paired {
    /// Of these differences; `None`: fewer than two say nothing of chance.
    pub fn of(differences: &[f64]) -> Option<Self> {
        let Sample { count, mean, sd } = Sample::of(differences).filter(|sample| sample.count > 1)?;
        let freedom = (count - 1) as f64;
        let error = sd / (count as f64).sqrt();
        let half = t_quantile(0.975, freedom) * error;
        let p = match (error > 0.0, mean == 0.0) {
            (true, _) => 2.0 * (1.0 - t_cumulative((mean / error).abs(), freedom)),
            // All differences are the same.
            (false, true) => 1.0,
            (false, false) => 0.0,
        };
        Some(Self { pairs: count, mean, interval: [mean - half, mean + half], p })
    }

    /// Whether chance alone is taken to be ruled out: p < 0.05.
    pub fn is_significant(&self) -> bool {
        self.p < 0.05
    }
}

/// The value below which a share of all lies (0 to 1), the nearest rank; `None`: there are none.
pub fn percentile(values: &[f64], share: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let rank = (share * sorted.len() as f64).ceil().max(1.0) as usize;
    sorted.get(rank - 1).copied()
}

/// Student's t distribution: the share below `t`, for so many degrees of freedom (Abramowitz and Stegun, 26.7.1 with 26.5.27).
fn t_cumulative(t: f64, freedom: f64) -> f64 {
    let tail = 0.5 * beta_regularised(freedom / (freedom + t * t), freedom / 2.0, 0.5);
    if t >= 0.0 { 1.0 - tail } else { tail }
}

/// Where [`t_cumulative`] is `share` (0.5 to 1), by bisection.
fn t_quantile(share: f64, freedom: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    while t_cumulative(high, freedom) < share && high < 1e12 {
        high *= 2.0;
    }
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if t_cumulative(middle, freedom) < share { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// The regularised incomplete beta function I_x(a, b), by its continued fraction (Abramowitz and Stegun, 26.5.8, evaluated
/// after Lentz).
fn beta_regularised(x: f64, a: f64, b: f64) -> f64 {
    if x <= 0.0 || x >= 1.0 {
        return x.clamp(0.0, 1.0);
    }
    let front = (ln_gamma(a + b) - ln_gamma(a) - ln_gamma(b) + a * x.ln() + b * (1.0 - x).ln()).exp();
    // The fraction converges fast on this side of the distribution's mean.
    match x < (a + 1.0) / (a + b + 2.0) {
        true => front * beta_fraction(x, a, b) / a,
        false => 1.0 - front * beta_fraction(1.0 - x, b, a) / b,
    }
}

fn beta_fraction(x: f64, a: f64, b: f64) -> f64 {
    const TINY: f64 = 1e-300;
    let away_from_0 = |value: f64| if value.abs() < TINY { TINY } else { value };
    let (mut c, mut d) = (1.0, 1.0 / away_from_0(1.0 - (a + b) * x / (a + 1.0)));
    let mut fraction = d;
    for m in 1..500 {
        let m = f64::from(m);
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        let mut change = 1.0;
        for coefficient in [even, odd] {
            d = 1.0 / away_from_0(1.0 + coefficient * d);
            c = away_from_0(1.0 + coefficient / c);
            change = c * d;
            fraction *= change;
        }
        if (change - 1.0).abs() < 1e-15 {
            break;
        }
    }
    fraction
}

/// ln Γ(x) for x > 0: Stirling's series, behind the recurrence that makes x large enough for it (Abramowitz and Stegun, 6.1.41).
fn ln_gamma(x: f64) -> f64 {
    let (mut x, mut shift) = (x, 0.0);
    while x < 10.0 {
        shift -= x.ln();
        x += 1.0;
    }
    let series = 1.0 / (12.0 * x) - 1.0 / (360.0 * x.powi(3)) + 1.0 / (1260.0 * x.powi(5)) - 1.0 / (1680.0 * x.powi(7));
    shift + (x - 0.5) * x.ln() - x + 0.5 * std::f64::consts::TAU.ln() + series
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn near(found: f64, expected: f64, tolerance: f64) {
        assert!((found - expected).abs() < tolerance, "{found}, and it is {expected}");
    }

    /// From printed tables of Student's t.
    #[test]
    fn quantiles_are_those_of_the_tables() {
        for (freedom, expected) in
            [(1.0, 12.706), (2.0, 4.303), (5.0, 2.571), (10.0, 2.228), (29.0, 2.045), (120.0, 1.980)]
        {
            near(t_quantile(0.975, freedom), expected, 5e-4);
        }
        near(t_quantile(0.995, 4.0), 4.604, 5e-4);
        near(t_cumulative(1.0, 1.0), 0.75, 1e-12);
        near(t_cumulative(-1.0, 1.0), 0.25, 1e-12);
    }

    #[test]
    fn the_gamma_function_is_that_of_factorials() {
        near(ln_gamma(1.0), 0.0, 1e-12);
        near(ln_gamma(6.0), 120_f64.ln(), 1e-12);
        near(ln_gamma(0.5), std::f64::consts::PI.sqrt().ln(), 1e-12);
    }

    /// Student's own sleep data (1908): ten patients, additional hours by two drugs. Mean 1.58, t = 4.0621, p = 0.002833.
    #[test]
    fn students_own_pairs_come_to_what_he_found() {
        let first = [0.7, -1.6, -0.2, -1.2, -0.1, 3.4, 3.7, 0.8, 0.0, 2.0];
        let second = [1.9, 0.8, 1.1, 0.1, -0.1, 4.4, 5.5, 1.6, 4.6, 3.4];
        let differences: Vec<f64> = second.iter().zip(first).map(|(b, a)| b - a).collect();
        let paired = Paired::of(&differences).unwrap();
        near(paired.mean, 1.58, 1e-12);
        near(paired.p, 0.002_833, 1e-6);
        near(paired.interval[0], 0.700_1, 1e-4);
        near(paired.interval[1], 2.459_9, 1e-4);
        assert!(paired.is_significant() && paired.pairs == 10);
    }

    #[test]
    fn few_pairs_and_equal_ones_say_what_they_can() {
        assert_eq!(Paired::of(&[1.0]), None);
        assert_eq!(Paired::of(&[]), None);
        let same = Paired::of(&[0.0, 0.0, 0.0]).unwrap();
        assert_eq!((same.mean, same.interval, same.p), (0.0, [0.0; 2], 1.0));
        assert_eq!(Paired::of(&[2.0, 2.0]).unwrap().p, 0.0);
        assert_eq!(Sample::of(&[]), None);
        assert_eq!(Sample::of(&[3.0]), Some(Sample { count: 1, mean: 3.0, sd: 0.0 }));
        near(Sample::of(&[2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0]).unwrap().sd, (32.0_f64 / 7.0).sqrt(), 1e-12);
    }

    #[test]
    fn a_percentile_is_a_value_that_was_there() {
        let values: Vec<f64> = (1..=100).rev().map(f64::from).collect();
        assert_eq!([0.5, 0.99, 1.0, 0.0].map(|share| percentile(&values, share)), [50.0, 99.0, 100.0, 1.0].map(Some));
        assert_eq!(percentile(&[], 0.5), None);
    }

    proptest! {
        /// The test asks whether 0 is in the interval.
        #[test]
        fn what_is_significant_has_no_0_in_its_interval(differences in prop::collection::vec(-1.0..3.0, 2..40)) {
            let paired = Paired::of(&differences).unwrap();
            let has_0 = paired.interval[0] <= 0.0 && paired.interval[1] >= 0.0;
            prop_assert!(paired.is_significant() != has_0 || (paired.p - 0.05).abs() < 1e-9);
            prop_assert!((0.0..=1.0).contains(&paired.p));
        }
    }
}
