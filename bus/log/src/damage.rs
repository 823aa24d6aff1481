//! What was found to be wrong with a log, in words: a log in which everything is wrong takes no more memory for it.

/// So many places are told apart; more are counted.
const MOST: usize = 1000;

/// What was found, in the order in which it was found.
#[derive(Debug, Clone, Default)]
pub(crate) struct Damage {
    reasons: Vec<String>,
    /// Places that are only counted.
    more: u64,
}

impl Damage {
    /// Notes one place. Beyond the first thousand the last reason is how many more there are.
    pub fn note(&mut self, reason: impl FnOnce() -> String) {
        if self.reasons.len() < MOST {
            return self.reasons.push(reason());
        }
        self.more += 1;
        self.reasons.truncate(MOST);
        self.reasons.push(format!("and {} more", self.more));
    }

    /// Notes a place unless it is known.
    pub fn note_once(&mut self, reason: &str) {
        if !self.reasons.iter().any(|known| known == reason) {
            self.note(|| reason.to_owned());
        }
    }

    /// The reasons.
    pub fn reasons(&self) -> &[String] {
        &self.reasons
    }
}

#[cfg(test)]
mod tests {
    use super::Damage;

    #[test]
    fn a_million_places_are_counted_and_not_kept() {
        let mut damage = Damage::default();
        (0..1_000_000).for_each(|number| damage.note(|| format!("message {number}")));
        assert_eq!((damage.reasons().len(), damage.reasons()[1000].as_str()), (1001, "and 999000 more"));
        damage.note_once("message 7");
        assert_eq!(damage.reasons()[1000], "and 999000 more");
    }
}
