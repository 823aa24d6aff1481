//! What processes say to people.

use std::fmt::Display;
use std::io::Write;

use elk_outside::text::printable_lines;

/// Says something to people: a line on standard error. Where that goes to a disk that is full, or to a reader that has
/// gone, the words are lost; nobody ends over it, as with [`eprintln!`].
pub fn tell(words: impl Display) {
    // One write, so that the lines of several processes do not mix; and what others have made up rules no terminal.
    let line = format!("{}\n", printable_lines(&words.to_string()));
    let _ = std::io::stderr().write_all(line.as_bytes());
}
