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
    }
}
