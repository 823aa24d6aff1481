//! Texts that somebody else made, on a terminal: names and values of other clients, of logs, of files.

use std::borrow::Cow;

/// The text in one line, with everything escaped that would move the cursor, colour the terminal or turn the direction of
/// writing: `"\x1b[2J"` is shown as `\u{1b}[2J`.
pub fn printable(text: &str) -> Cow<'_, str> {
    escaped(text, rules, put_as_rust)
}

/// As [`printable`], for texts of several lines: line feeds stay.
pub fn printable_lines(text: &str) -> Cow<'_, str> {
    escaped(text, rules_in_lines, put_as_rust)
}

/// A JSON text that a terminal shows as it is: what [`printable`] escapes is escaped as JSON does, which is the same text to
/// whoever parses it. Line feeds between its parts stay.
pub fn printable_json(json: &str) -> Cow<'_, str> {
    // All of these have four digits.
    escaped(json, rules_in_lines, |shown, character| shown.push_str(&format!("\\u{:04x}", u32::from(character))))
}

/// The text, with each character that is to be escaped put as `put` has it.
fn escaped(text: &str, is_escaped: impl Fn(char) -> bool, put: impl Fn(&mut String, char)) -> Cow<'_, str> {
    if !text.contains(&is_escaped) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 16);
    for character in text.chars() {
        match is_escaped(character) {
            true => put(&mut shown, character),
            false => shown.push(character),
        }
    }
    Cow::Owned(shown)
}

fn put_as_rust(shown: &mut String, character: char) {
    shown.extend(character.escape_debug());
}

fn rules_in_lines(character: char) -> bool {
    character != '\n' && rules(character)
}

/// Whether a terminal, or the eye, obeys this character instead of showing it: controls (C0, C1), line and paragraph
/// separators, and what embeds, overrides or isolates a direction of writing (Unicode Standard Annex 9).
fn rules(character: char) -> bool {
    let turns = matches!(character, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    character.is_control() || turns
}

/// The beginning of a text, at most `longest` characters with the dots that stand for the rest.
pub fn clipped(text: &str, longest: usize) -> Cow<'_, str> {
    match text.char_indices().nth(longest) {
        None => Cow::Borrowed(text),
        Some(_) => text.chars().take(longest.saturating_sub(1)).chain(['…']).collect::<String>().into(),
    }
}

/// The beginning of a line, at most `longest` characters: whole words and, if some are left out, dots.
pub fn clipped_at_words(line: &str, longest: usize) -> Cow<'_, str> {
    let Some((end, _)) = line.char_indices().nth(longest) else { return Cow::Borrowed(line) };
    if longest < 2 {
        return Cow::Borrowed(line.get(..end).unwrap_or_default());
    }
    // Room for a space and the dots.
    let room = line.char_indices().nth(longest - 2).map_or(end, |(at, _)| at);
    let whole = line.get(..=room).filter(|beginning| beginning.ends_with(' ')).map(|_| room);
    match whole.or_else(|| line.get(..room)?.rfind(' ')) {
        Some(end) => format!("{} …", line.get(..end).unwrap_or_default().trim_end_matches([' ', '|', ','])).into(),
        None => clipped(line, longest),
    }
}

/// The most characters of a name that people are shown in a table or a line; programs are given all of it.
pub const NAME: usize = 64;

/// A name in one line, as much of it as people read.
pub fn name(text: &str) -> Cow<'_, str> {
    // What is clipped is not escaped first: a name of a gigabyte costs no gigabyte more.
    match clipped(text, NAME) {
        Cow::Borrowed(whole) => printable(whole),
        Cow::Owned(beginning) => printable(&beginning).into_owned().into(),
    }
}

/// Appends `cell` to `line`, filled up with spaces to `width` characters, at its right side or, `right`, at its left.
/// Unlike the widths of [`format!`], which end at 65,535, `width` may be anything.
pub fn put_cell(line: &mut String, cell: &str, width: usize, right: bool) {
    let fill = std::iter::repeat_n(' ', width.saturating_sub(cell.chars().count()));
    if right {
        line.extend(fill);
        line.push_str(cell);
    } else {
        line.push_str(cell);
        line.extend(fill);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_text_cannot_rule_a_terminal() {
        assert_eq!(printable("a\x1b[2J\nb„ä“'"), "a\\u{1b}[2J\\nb„ä“'");
        assert_eq!(printable("\u{9b}31m \u{202e}gpj.exe\u{2028}"), "\\u{9b}31m \\u{202e}gpj.exe\\u{2028}");
        assert_eq!(printable_json("{\n\"a\": \"\u{9b}\u{202e}ä\"}"), "{\n\"a\": \"\\u009b\\u202eä\"}");
        assert_eq!(printable_lines("one\n\ttwo\r"), "one\n\\ttwo\\r");
    }

    #[test]
    fn names_are_shown_as_far_as_they_are_read() {
        assert_eq!(name("SCAN_1"), "SCAN_1");
        assert_eq!(name(&"ä".repeat(64)), "ä".repeat(64));
        assert_eq!(name(&"ä".repeat(66_000)), "ä".repeat(63) + "…");
        assert_eq!(clipped("abc", 0), "…");
    }

    #[test]
    fn a_line_is_clipped_behind_a_word() {
        let clip = |longest| clipped_at_words("3 scans | alive: Map Sensor", longest).into_owned();
        assert_eq!(clip(27), "3 scans | alive: Map Sensor");
        for longest in 22..27 {
            assert_eq!(clip(longest), "3 scans | alive: Map …", "{longest}");
        }
        assert_eq!([clip(21), clip(11), clip(8)], ["3 scans | alive: …", "3 scans …", "3 …"]);
        assert_eq!([clip(2), clip(1), clip(0)], ["3…", "3", ""]);
        assert_eq!(clipped_at_words("größer als", 5), "größ…");
    }

    #[test]
    fn a_cell_is_as_wide_as_it_is_to_be_however_wide_that_is() {
        let mut line = String::new();
        put_cell(&mut line, "ab", 4, true);
        put_cell(&mut line, "c", 70_000, false);
        put_cell(&mut line, "abc", 2, false);
        assert_eq!((line.len(), &line[..5], line.ends_with(" abc")), (70_007, "  abc", true));
    }

    proptest! {
        #[test]
        fn whatever_is_shown_is_one_line_without_controls(text in any::<String>(), longest in 0..100_usize) {
            for shown in [printable(&text), name(&text), printable(&clipped(&text, longest))] {
                prop_assert!(!shown.contains(rules));
            }
            prop_assert!(clipped(&text, longest).chars().count() <= longest.max(1));
            prop_assert!(clipped_at_words(&text, longest).chars().count() <= longest);
        }
    }
}
