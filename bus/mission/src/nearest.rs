//! "Did you mean": the known name that a misspelt one is nearest to.

/// Longer names than anybody types are near to nothing (bytes).
const LONGEST: usize = 256;

/// The candidate that `found` is most likely a slip of, if one is near enough: by edit distance, letter case ignored.
pub fn nearest<'a>(found: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let found = found.to_lowercase();
    let allowed = (found.chars().count() / 3).clamp(1, 3);
    candidates
        .into_iter()
        .filter(|candidate| found.len().max(candidate.len()) <= LONGEST)
        .map(|candidate| (distance(&found, &candidate.to_lowercase()), candidate))
        .filter(|(distance, _)| *distance <= allowed)
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, candidate)| candidate)
}

/// What would be right instead of `found`: the nearest candidate, or all of them.
pub fn instead(found: &str, candidates: &[&str]) -> String {
    match (nearest(found, candidates.iter().copied()), candidates) {
        (Some(candidate), _) => format!("did you mean {candidate}?"),
        (None, []) => "there is none to choose from".to_owned(),
        (None, _) => format!("known: {}", candidates.join(", ")),
    }
}

/// Damerau-Levenshtein distance with adjacent transpositions (optimal string alignment): letters inserted, dropped,
/// replaced, or swapped with their neighbour.
fn distance(a: &str, b: &str) -> usize {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().collect(), b.chars().collect());
    let mut before_last = vec![0; b.len() + 1];
    let mut last: Vec<usize> = (0..=b.len()).collect();
    for i in 1..=a.len() {
        let mut row = vec![i; b.len() + 1];
        for j in 1..=b.len() {
            let replaced = last[j - 1] + usize::from(a[i - 1] != b[j - 1]);
            row[j] = replaced.min(last[j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                row[j] = row[j].min(before_last[j - 2] + 1);
            }
        }
        before_last = std::mem::replace(&mut last, row);
    }
    last[b.len()]
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::{distance, instead, nearest};

    #[test]
    fn every_kind_of_slip_costs_one() {
        for slip in ["Snsor", "Sennsor", "Senzor", "Sesnor"] {
            assert_eq!(distance(slip, "Sensor"), 1, "{slip}");
        }
        assert_eq!(distance("kitten", "sitting"), 3);
    }

    #[test]
    fn suggests_what_is_near_and_lists_when_nothing_is() {
        assert_eq!(nearest("treshold", ["Input", "Threshold"]), Some("Threshold"));
        assert_eq!(nearest("x", ["Input", "Threshold"]), None);
        assert_eq!(instead("x", &["Input", "Threshold"]), "known: Input, Threshold");
    }

    proptest! {
        #[test]
        fn the_distance_is_symmetric_and_bounded(a in "[a-d]{0,8}", b in "[a-d]{0,8}") {
            let d = distance(&a, &b);
            prop_assert_eq!(d, distance(&b, &a));
            prop_assert_eq!(d == 0, a == b);
            prop_assert!(d <= a.len().max(b.len()));
            prop_assert!(d >= a.len().abs_diff(b.len()));
        }
    }
}
