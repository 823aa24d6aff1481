//! Wildcards as MOOS has them: `*` is any run of characters, `?` any single one; the whole string counts, and case does.

use std::str::Chars;

/// Whether `text` matches `pattern`.
pub fn matches(pattern: &str, text: &str) -> bool {
    let (mut pattern, mut text) = (pattern.chars(), text.chars());
    // Where to go on when what follows the last `*` does not fit: it then swallows one character more.
    let mut retry: Option<(Chars<'_>, Chars<'_>)> = None;
    loop {
        let (mut pattern_rest, mut text_rest) = (pattern.clone(), text.clone());
        match (pattern_rest.next(), text_rest.next()) {
            (None, None) => return true,
            (Some('*'), _) => {
                if pattern_rest.as_str().is_empty() {
                    return true;
                }
                retry = Some((pattern_rest.clone(), text.clone()));
                pattern = pattern_rest;
            }
            (Some(wanted), Some(found)) if wanted == '?' || wanted == found => {
                (pattern, text) = (pattern_rest, text_rest);
            }
            _ => {
                let Some((behind_star, swallowed)) = &mut retry else { return false };
                if swallowed.next().is_none() {
                    return false;
                }
                (pattern, text) = (behind_star.clone(), swallowed.clone());
            }
        }
    }
}

/// Whether there is a string that both patterns match.
pub fn meet(one: &str, other: &str) -> bool {
    let (one, other): (Vec<char>, Vec<char>) = (one.chars().collect(), other.chars().collect());
    // Whether the rest of `one` from the row on meets the rest of `other` from each of its characters on.
    let mut below = vec![false; other.len() + 1];
    for i in (0..=one.len()).rev() {
        let mut row = vec![false; other.len() + 1];
        for j in (0..=other.len()).rev() {
            row[j] = match (one.get(i), other.get(j)) {
                (None, None) => true,
                // A run of characters is nothing, or one of the other's and what is left of the run.
                (Some('*'), None) => below[j],
                (Some('*'), Some(_)) => below[j] || row[j + 1],
                (None, Some('*')) => row[j + 1],
                (Some(_), Some('*')) => row[j + 1] || below[j],
                (Some('?'), Some(_)) | (Some(_), Some('?')) => below[j + 1],
                (Some(a), Some(b)) => a == b && below[j + 1],
                (None, Some(_)) | (Some(_), None) => false,
            };
        }
        below = row;
    }
    below[0]
}

/// Whether `pattern` matches one string only.
pub fn is_literal(pattern: &str) -> bool {
    !pattern.contains(['*', '?'])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_usual_ones() {
        for (pattern, text, expected) in [
            ("*", "", true),
            ("NAV_*", "NAV_X", true),
            ("NAV_?", "NAV_XY", false),
            ("*_STATUS", "PMAP_STATUS", true),
            ("*A*B", "xAyAzB", true),
            ("nav", "NAV", false),
            ("", "x", false),
            ("Größe?", "Größe1", true),
        ] {
            assert_eq!(matches(pattern, text), expected, "{pattern} {text}");
        }
    }

    #[test]
    fn patterns_that_have_a_string_in_common_meet() {
        for (one, other, expected) in [
            ("*", "DRAWING/a/*", true),
            ("DRAWING/*", "DRAWING/a/*", true),
            ("DRAWING/*/field", "DRAWING/a/*", true),
            ("DRAWING/a/field", "DRAWING/a/*", true),
            ("DRAWING/b/*", "DRAWING/a/*", false),
            ("DRAWING/a", "DRAWING/a/*", false),
            ("*_STATUS", "DRAWING/a/*", true),
            ("SCAN*", "DRAWING/a/*", false),
            ("a?c", "ab?", true),
            ("", "*", true),
            ("", "?", false),
        ] {
            assert_eq!(meet(one, other), expected, "{one} {other}");
            assert_eq!(meet(other, one), expected, "{other} {one}");
        }
    }

    fn by_the_book(pattern: &[char], text: &[char]) -> bool {
        match (pattern.first(), text.first()) {
            (None, None) => true,
            (Some('*'), _) => {
                by_the_book(&pattern[1..], text) || (!text.is_empty() && by_the_book(pattern, &text[1..]))
            }
            (Some(p), Some(t)) => (*p == '?' || p == t) && by_the_book(&pattern[1..], &text[1..]),
            _ => false,
        }
    }

    proptest! {
        #[test]
        fn equals_the_recursive_definition(pattern in "[ab*?]{0,8}", text in "[ab]{0,8}") {
            let (p, t): (Vec<char>, Vec<char>) = (pattern.chars().collect(), text.chars().collect());
            prop_assert_eq!(matches(&pattern, &text), by_the_book(&p, &t));
        }

        /// The shortest string in common has no more characters than both patterns together.
        #[test]
        fn patterns_meet_in_a_string_that_both_match(one in "[ab*?]{0,4}", other in "[ab*?]{0,4}") {
            let of_length = |length: u32| (0..1u32 << length).map(move |bits| {
                (0..length).map(|i| if bits >> i & 1 == 1 { 'b' } else { 'a' }).collect::<String>()
            });
            let common = (0..=8).flat_map(of_length).any(|text| matches(&one, &text) && matches(&other, &text));
            prop_assert_eq!(meet(&one, &other), common);
        }
    }
}
