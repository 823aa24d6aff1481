//! Wildcards as MOOS has them: `*` is any run of characters, `?` any single one; the whole string counts, and case does.

/// Whether `text` matches `pattern`.
pub fn matches(pattern: &str, text: &str) -> bool {
    let (pattern, text): (Vec<char>, Vec<char>) = (pattern.chars().collect(), text.chars().collect());
    let (mut p, mut t) = (0, 0);
    // Where to go on when the characters after the last `*` do not fit: it then swallows one more.
    let mut retry: Option<(usize, usize)> = None;
    while t < text.len() {
        match pattern.get(p) {
            Some('*') => {
                retry = Some((p, t));
                p += 1;
            }
            Some(&c) if c == '?' || c == text[t] => {
                p += 1;
                t += 1;
            }
            _ => match retry {
                Some((star, swallowed)) => {
                    retry = Some((star, swallowed + 1));
                    (p, t) = (star + 1, swallowed + 1);
                }
                None => return false,
            },
        }
    }
    pattern[p..].iter().all(|&c| c == '*')
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
