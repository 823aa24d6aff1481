//! Numbers as if drawn by chance: the same seed, plan and place in the row give the same number, on every machine.
//!
//! They have no state: whoever goes on with a strategy after a swap draws what the one before would have drawn.

/// What the draws of one plan begin with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Chance(u64);

impl Chance {
    /// The draws of plan number `plan` under `seed`.
    pub fn new(seed: u64, plan: u64) -> Self {
        Self(mixed(seed ^ mixed(plan)))
    }

    /// The `n`-th of them, of 64 bits.
    pub fn bits(self, n: u64) -> u64 {
        mixed(self.0.wrapping_add(n.wrapping_mul(GOLDEN)))
    }

    /// The `n`-th as one of the numbers below `count`; 0 if there are none.
    pub fn below(self, n: u64, count: usize) -> usize {
        ((u128::from(self.bits(n)) * count as u128) >> 64) as usize
    }

    /// The `n`-th as a number in [0, 1).
    pub fn unit(self, n: u64) -> f64 {
        (self.bits(n) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// 2⁶⁴ divided by the golden ratio, odd.
const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// The output function of SplitMix64 (Steele, Lea and Flood, *Fast Splittable Pseudorandom Number Generators*, 2014), one step on.
fn mixed(state: u64) -> u64 {
    let z = state.wrapping_add(GOLDEN);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seeds_plans_and_places_draw_differently_and_evenly() {
        let chance = Chance::new(7, 3);
        assert_eq!(chance, Chance::new(7, 3));
        assert_ne!(chance, Chance::new(7, 4));
        assert_ne!(chance, Chance::new(8, 3));
        let mut counts = [0u32; 10];
        (0..100_000).for_each(|n| counts[chance.below(n, 10)] += 1);
        // Five standard deviations.
        assert!(counts.iter().all(|count| count.abs_diff(10_000) < 475), "{counts:?}");
        let mean = (0..100_000).map(|n| chance.unit(n)).sum::<f64>() / 1e5;
        assert!((mean - 0.5).abs() < 5.0 * (1.0 / 12.0f64 / 1e5).sqrt());
        assert_eq!(chance.below(0, 0), 0);
    }
}
