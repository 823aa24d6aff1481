//! Texts of any encoding, as far as keywords and numbers are concerned, which are ASCII.

use std::borrow::Cow;

/// The mark at the beginning of a UTF-8 text.
const BOM: &[u8] = b"\xef\xbb\xbf";

/// Bytes at the beginning of a file that are looked at to tell what it is.
const BEGINNING: usize = 64 << 10;

/// The text in an encoding that agrees with ASCII: UTF-16 becomes UTF-8; anything else is left as it is, since what is
/// not ASCII can only be in comments and names.
pub(crate) fn ascii_compatible(bytes: &[u8]) -> Cow<'_, [u8]> {
    let unit: fn([u8; 2]) -> u16 = match bytes {
        [0xff, 0xfe, ..] => u16::from_le_bytes,
        [0xfe, 0xff, ..] => u16::from_be_bytes,
        [a, 0, b, 0, ..] if *a > 0 && *b > 0 => u16::from_le_bytes,
        [0, a, 0, b, ..] if *a > 0 && *b > 0 => u16::from_be_bytes,
        _ => return Cow::Borrowed(bytes),
    };
    let units = bytes.chunks_exact(2).map(|pair| unit([pair[0], pair[1]]));
    let text: String = char::decode_utf16(units).map(|one| one.unwrap_or(char::REPLACEMENT_CHARACTER)).collect();
    Cow::Owned(text.into_bytes())
}

/// The first part of a text, without a mark.
pub(crate) fn beginning(bytes: &[u8]) -> Vec<u8> {
    let first = &bytes[..bytes.len().min(BEGINNING)];
    without_bom(&ascii_compatible(first)).to_vec()
}

/// A line without the marks that stand before it: files that were put together have them anywhere.
pub(crate) fn without_bom(line: &[u8]) -> &[u8] {
    let mut rest = line;
    while let Some(after) = rest.strip_prefix(BOM) {
        rest = after;
    }
    rest
}

/// The lines with their numbers, counted from 1; they end with LF, CR LF or CR.
pub(crate) fn lines(text: &[u8]) -> impl Iterator<Item = (usize, &[u8])> {
    let mut rest = Some(text);
    let lines = std::iter::from_fn(move || {
        let text = rest?;
        let Some(end) = text.iter().position(|&byte| byte == b'\n' || byte == b'\r') else {
            rest = None;
            return (!text.is_empty()).then_some(text);
        };
        let ending = if text[end..].starts_with(b"\r\n") { 2 } else { 1 };
        rest = Some(&text[end + ending..]);
        Some(&text[..end])
    });
    lines.enumerate().map(|(before, line)| (before + 1, without_bom(line)))
}

/// The words of a line, without marks.
pub(crate) fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    let parts = line.split(|byte| byte.is_ascii_whitespace() || *byte == 0x0b);
    parts.map(without_bom).filter(|word| !word.is_empty())
}

/// A word as it is shown.
pub(crate) fn shown(word: &[u8]) -> String {
    const LONGEST: usize = 40;
    let word = String::from_utf8_lossy(word);
    format!("{:?}", elk_outside::text::clipped(&word, LONGEST))
}

/// A number; the forms in which C's libraries write what is none (`-nan(ind)`, `1.#QNAN`) are not a number, too.
///
/// # Errors
/// What was found and what would be right.
pub(crate) fn number(word: &[u8]) -> Result<f64, String> {
    let text = std::str::from_utf8(word).unwrap_or_default();
    if let Ok(number) = text.parse() {
        return Ok(number);
    }
    let bare = text.trim_start_matches(['-', '+']).to_ascii_lowercase();
    if bare.starts_with("nan(") || bare.starts_with("1.#") {
        return Ok(f64::NAN);
    }
    let right = match text.replacen(',', ".", 1).parse::<f64>() {
        Ok(meant) => format!("right is a point, not a comma: {meant}"),
        Err(_) => "right is a number".to_owned(),
    };
    Err(format!("{} is no number; {right}", shown(word)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_in_any_way_and_are_counted() {
        let all: Vec<_> = lines(b"a\r\nb\rc\n\n\xef\xbb\xbf\xef\xbb\xbfd").collect();
        assert_eq!(all, [(1, &b"a"[..]), (2, b"b"), (3, b"c"), (4, b""), (5, b"d")]);
        assert_eq!(lines(b"").count(), 0);
        assert_eq!(lines(b"a\n").count(), 1);
    }

    #[test]
    fn utf_16_is_read_in_both_orders_with_and_without_a_mark() {
        let text = "# Grüße\nv 1 2 3\n";
        for mark in ["\u{feff}", ""] {
            let marked = format!("{mark}{text}");
            let little: Vec<u8> = marked.encode_utf16().flat_map(u16::to_le_bytes).collect();
            let big: Vec<u8> = marked.encode_utf16().flat_map(u16::to_be_bytes).collect();
            for bytes in [little, big] {
                assert_eq!(without_bom(&ascii_compatible(&bytes)), text.as_bytes());
            }
        }
    }

    #[test]
    fn numbers_that_are_none_are_told_from_words() {
        assert_eq!(number(b"-1.5e-3"), Ok(-0.0015));
        for none in ["nan", "-nan(ind)", "1.#QNAN", "-1.#IND"] {
            assert!(number(none.as_bytes()).unwrap().is_nan(), "{none}");
        }
        assert_eq!(number(b"1,5").unwrap_err(), "\"1,5\" is no number; right is a point, not a comma: 1.5");
        assert_eq!(number(b"x").unwrap_err(), "\"x\" is no number; right is a number");
        assert!(number(b"\xff\xfe").is_err());
    }
}
