//! What was found to be wrong with a log, in words: a log in which everything is wrong takes no more memory for it.

/// So many places are told apart; more are counted.
const MOST: usize = 1000;

/// What was found, in the order in which it was found.
#[derive(Debug, Clone, Default)]
pub(crate) struct Damage {
    told: Vec<String>,
    /// Places that are only counted.
    more: u64,
}

impl Damage {
    /// Notes one place.
    pub fn note(&mut self, reason: String) {
        match self.told.len() < MOST {
            true => self.told.push(reason),
            false => self.more += 1,
        }
    }

    /// Notes every place that `other` has.
    pub fn merge(&mut self, other: &Self) {
        other.told.iter().cloned().for_each(|reason| self.note(reason));
        self.more += other.more;
    }

    /// Whether nothing is wrong.
    pub fn is_empty(&self) -> bool {
        self.told.is_empty()
    }

    /// One reason for each place; beyond the first thousand the last one is how many more there are.
    pub fn reasons(&self) -> Vec<String> {
        let more = (self.more > 0).then(|| format!("and {} more", self.more));
        self.told.iter().cloned().chain(more).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::Damage;

    fn of_places(count: u64) -> Damage {
        let mut damage = Damage::default();
        (0..count).for_each(|number| damage.note(format!("message {number}")));
        damage
    }

    #[test]
    fn a_million_places_are_counted_and_not_kept() {
        let reasons = of_places(1_000_000).reasons();
        assert_eq!((reasons.len(), reasons[1000].as_str()), (1001, "and 999000 more"));
        assert_eq!(of_places(1000).reasons().len(), 1000);
    }

    #[test]
    fn none_is_lost_where_findings_are_put_together() {
        for (one, other) in [(0, 20_001), (20_001, 0), (1, 20_000), (10_001, 10_000), (999, 19_002)] {
            let mut all = of_places(one);
            all.merge(&of_places(other));
            let reasons = all.reasons();
            assert_eq!((reasons.len(), reasons[1000].as_str()), (1001, "and 19001 more"), "{one} and {other}");
        }
        let mut none = of_places(0);
        none.merge(&of_places(0));
        assert!(none.is_empty() && none.reasons().is_empty());
    }
}
