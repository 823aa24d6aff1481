//! From the bytes of a mission file to its text: in UTF-8, or in the encoding that its beginning names.

use crate::problem::{At, Findings};

/// What the bytes 0x80 to 0x9f are in windows-1252; above, it is Latin-1. Five of them are no letters.
const WINDOWS_1252: &str = "€\u{81}‚ƒ„…†‡ˆ‰Š‹Œ\u{8d}Ž\u{8f}\u{90}‘’“”•–—˜™š›œ\u{9d}žŸ";
/// The encodings that are read, as a file may call them.
const READ: &str = "UTF-8, ISO-8859-1 and windows-1252";

/// The text of a mission file; what is wrong with it, and the text as far as it could be read.
pub(crate) fn text_of(bytes: &[u8]) -> Result<String, (Findings, String)> {
    match bytes {
        [0xff, 0xfe, wide @ ..] => return of_utf16(wide, u16::from_le_bytes),
        [0xfe, 0xff, wide @ ..] => return of_utf16(wide, u16::from_be_bytes),
        _ => {}
    }
    let Some((at, label)) = declared(bytes) else { return of_utf8(bytes) };
    match label.to_ascii_lowercase().as_str() {
        "utf-8" | "utf8" | "us-ascii" | "ascii" => of_utf8(bytes),
        "iso-8859-1" | "iso_8859-1" | "latin1" | "latin-1" => Ok(bytes.iter().copied().map(char::from).collect()),
        "windows-1252" | "cp1252" => Ok(bytes.iter().copied().map(of_windows).collect()),
        _ => Err(refused(
            at,
            format!("the encoding {label:?} is not one that this file is in, or that is read; right are {READ}"),
            bytes,
        )),
    }
}

fn of_utf8(bytes: &[u8]) -> Result<String, (Findings, String)> {
    std::str::from_utf8(bytes).map(|text| text.trim_start_matches('\u{feff}').to_owned()).map_err(|error| {
        let at = error.valid_up_to();
        let found = bytes.get(at).copied().unwrap_or_default();
        let said = format!(
            "the byte {found:#04x} is not UTF-8; right is to save the file as UTF-8, or to begin it with \
             <?xml version=\"1.0\" encoding=\"ISO-8859-1\"?> if that is what it is"
        );
        refused(at, said, bytes)
    })
}

fn of_windows(byte: u8) -> char {
    let special = byte.checked_sub(0x80).and_then(|at| WINDOWS_1252.chars().nth(usize::from(at)));
    special.unwrap_or_else(|| char::from(byte))
}

fn of_utf16(bytes: &[u8], number: fn([u8; 2]) -> u16) -> Result<String, (Findings, String)> {
    let (pairs, rest) = bytes.as_chunks::<2>();
    let text = String::from_utf16(&pairs.iter().copied().map(number).collect::<Vec<_>>());
    text.ok().filter(|_| rest.is_empty()).ok_or_else(|| {
        refused(0, "this is no UTF-16, as its first bytes say it is; right is to save it as UTF-8".to_owned(), bytes)
    })
}

fn refused(at: usize, said: String, bytes: &[u8]) -> (Findings, String) {
    let mut findings = Findings::default();
    findings.add(&At::Byte(at), said);
    let read = bytes.get(..at).unwrap_or_default();
    (findings, String::from_utf8_lossy(read).into_owned())
}

/// The encoding that the XML declaration names, and at which byte.
fn declared(bytes: &[u8]) -> Option<(usize, String)> {
    let end = bytes.windows(2).take(1000).position(|two| two == b"?>")?;
    let head = std::str::from_utf8(bytes.get(..end)?).ok().filter(|head| head.starts_with("<?xml"))?;
    let (before, after) = head.split_once("encoding")?;
    let value = after.trim_start().strip_prefix('=')?.trim_start();
    let quote = value.chars().next().filter(|quote| "'\"".contains(*quote))?;
    let label = value.get(1..)?.split(quote).next()?;
    let at = before.len() + "encoding".len() + (after.len() - value.len()) + 1;
    Some((at, label.to_owned()))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn said(bytes: &[u8]) -> String {
        let (findings, text) = text_of(bytes).unwrap_err();
        findings.located(Path::new("m.xml"), &text).to_string()
    }

    #[test]
    fn a_file_is_read_in_the_encoding_that_it_names() {
        let declared = |label: &str, rest: &[u8]| {
            text_of(&[format!("<?xml version='1.0' encoding = '{label}'?>").as_bytes(), rest].concat()).unwrap()
        };
        for label in ["ISO-8859-1", "latin1", "Windows-1252"] {
            assert!(declared(label, b"K\xfcche").ends_with("Küche"), "{label}");
        }
        assert!(declared("windows-1252", b"\x80 \x96 \x9f").ends_with("€ – Ÿ"));
        assert!(declared("UTF-8", "Küche".as_bytes()).ends_with("Küche"));
        assert_eq!(text_of("\u{feff}Küche".as_bytes()).unwrap(), "Küche");
        let wide = |order: fn(u16) -> [u8; 2]| "\u{feff}Küche".encode_utf16().flat_map(order).collect::<Vec<_>>();
        assert_eq!(text_of(&wide(u16::to_le_bytes)).unwrap(), "Küche");
        assert_eq!(text_of(&wide(u16::to_be_bytes)).unwrap(), "Küche");
        assert_eq!(WINDOWS_1252.chars().count(), 32);
    }

    #[test]
    fn what_cannot_be_read_is_said_with_its_location() {
        assert!(said(b"<a>\n<!-- K\xfcche --></a>").starts_with("m.xml:2:7: the byte 0xfc is not UTF-8; right is "));
        let martian = b"<?xml version=\"1.0\" encoding=\"martian\"?><a/>";
        assert!(said(martian).starts_with("m.xml:1:31: the encoding \"martian\" is not one"), "{}", said(martian));
        assert!(
            said(b"<?xml version='1.0' encoding='UTF-16'?><a/>").starts_with("m.xml:1:31: the encoding \"UTF-16\"")
        );
        assert!(said(b"\xff\xfe\x00\xd8").starts_with("m.xml:1:1: this is no UTF-16"), "half a pair");
        assert!(said(b"\xff\xfea").starts_with("m.xml:1:1: this is no UTF-16"), "half a letter");
    }
}
