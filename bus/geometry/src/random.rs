//! Seeded random numbers: the same seed gives the same numbers on every machine.

/// SplitMix64 (Steele, Lea and Flood, *Fast Splittable Pseudorandom Number Generators*, 2014).
#[derive(Debug, Clone)]
pub struct Random {
    state: u64,
}

impl Random {
    /// The stream that belongs to `seed` and `stream`: two streams of one seed have nothing to do with each other.
    pub fn new(seed: u64, stream: u64) -> Self {
        let mut of_seed = Self { state: seed };
        let mut of_stream = Self { state: of_seed.next_u64() ^ stream.wrapping_mul(0xd1b5_4a32_d192_ed03) };
        Self { state: of_stream.next_u64() }
    }

    /// 64 random bits.
    pub fn next_u64(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = self.state;
        let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f64 {
        (self.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Uniform among the numbers below `count`; 0 if there are none.
    pub fn below(&mut self, count: usize) -> usize {
        ((u128::from(self.next_u64()) * count as u128) >> 64) as usize
    }

    /// Uniform in [`low`, `high`).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Two independent numbers of the standard normal distribution (Box and Muller, 1958).
    pub fn normal_pair(&mut self) -> (f64, f64) {
        let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
        let angle = std::f64::consts::TAU * self.unit();
        (radius * angle.cos(), radius * angle.sin())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_numbers_have_mean_zero_variance_one_and_no_correlation() {
        let mut random = Random::new(7, 0);
        let n = 200_000.0;
        let (mut sum, mut squares, mut products) = (0.0, 0.0, 0.0);
        for _ in 0..200_000 {
            let (a, b) = random.normal_pair();
            sum += a + b;
            squares += a * a + b * b;
            products += a * b;
        }
        // Five standard errors each.
        assert!((sum / (2.0 * n)).abs() < 5.0 / (2.0 * n).sqrt());
        assert!((squares / (2.0 * n) - 1.0).abs() < 5.0 * (1.0 / n).sqrt());
        assert!((products / n).abs() < 5.0 / n.sqrt());
    }

    #[test]
    fn numbers_below_another_are_even() {
        let (mut random, mut counts) = (Random::new(7, 3), [0u32; 10]);
        (0..100_000).for_each(|_| counts[random.below(10)] += 1);
        // Five standard deviations.
        assert!(counts.iter().all(|count| count.abs_diff(10_000) < 475), "{counts:?}");
        assert_eq!(random.below(0), 0);
    }

    #[test]
    fn streams_differ_and_repeat() {
        let first = |seed, stream| Random::new(seed, stream).next_u64();
        assert_eq!(first(1, 2), first(1, 2));
        assert_ne!(first(1, 2), first(2, 1));
        assert_ne!(first(1, 2), first(1, 3));
    }
}
