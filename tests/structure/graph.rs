//! Arrows between names, and the circles among them.

use std::collections::{BTreeMap, BTreeSet};

/// Who names whom, each arrow with one place where it does.
#[derive(Debug, Default)]
pub struct Graph {
    arrows: BTreeMap<String, BTreeMap<String, String>>,
}

impl Graph {
    /// Adds an arrow between two different names; of several, the first one's `place` is kept.
    pub fn arrow(&mut self, from: &str, to: &str, place: &str) {
        if from != to {
            self.arrows.entry(from.to_owned()).or_default().entry(to.to_owned()).or_insert_with(|| place.to_owned());
        }
    }

    /// The circles: names that can be reached from each other, with the arrows between them, as a text each.
    pub fn circles(&self) -> Vec<String> {
        let mut circles = BTreeSet::new();
        for name in self.arrows.keys() {
            let reached = self.reached(name);
            let circle: BTreeSet<&str> =
                reached.iter().copied().filter(|other| self.reached(other).contains(name.as_str())).collect();
            if !circle.is_empty() {
                circles.insert(self.describe(&circle));
            }
        }
        circles.into_iter().collect()
    }

    /// All that can be reached from a name; itself only if it lies on a circle.
    fn reached(&self, name: &str) -> BTreeSet<&str> {
        let mut reached = BTreeSet::new();
        let mut waiting: Vec<&str> =
            self.arrows.get_key_value(name).map(|(name, _)| name.as_str()).into_iter().collect();
        while let Some(name) = waiting.pop() {
            let next = self.arrows.get(name).into_iter().flat_map(BTreeMap::keys).map(String::as_str);
            waiting.extend(next.filter(|next| reached.insert(*next)));
        }
        reached
    }

    fn describe(&self, circle: &BTreeSet<&str>) -> String {
        let mut text = circle.iter().copied().collect::<Vec<_>>().join(", ");
        for from in circle {
            for (to, place) in self.arrows[*from].iter().filter(|(to, _)| circle.contains(to.as_str())) {
                text.push_str(&format!("\n    {from} -> {to}: {place}"));
            }
        }
        text
    }
}
