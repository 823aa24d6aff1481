//! Where a scope writes: lines that follow each other, or a page that is written anew in place.

use std::io::{IsTerminal, Write};

use elk_outside::text;
use serde::Serialize;

use crate::error::ScopeError;

/// The size of a terminal, in characters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Screen {
    /// Characters in a line.
    pub columns: usize,
    /// Lines.
    pub rows: usize,
}

impl Screen {
    /// The terminal that standard output is, if it is one.
    pub fn of_standard_output() -> Option<Self> {
        let out = std::io::stdout();
        if !out.is_terminal() {
            return None;
        }
        let size = rustix::termios::tcgetwinsize(&out).ok().filter(|size| size.ws_col > 0 && size.ws_row > 1);
        Some(size.map_or(Self { columns: 80, rows: 24 }, |s| Self { columns: s.ws_col.into(), rows: s.ws_row.into() }))
    }
}

/// Where a scope writes.
pub struct Output<'a> {
    to: &'a mut dyn Write,
    screen: Option<Screen>,
    /// Lines of the page that stands on the screen.
    standing: usize,
}

impl<'a> Output<'a> {
    /// Writes to a terminal with this screen, or to a pipe or file without one.
    pub fn new(to: &'a mut dyn Write, screen: Option<Screen>) -> Self {
        Self { to, screen, standing: 0 }
    }

    /// Whether a person looks at it.
    pub fn is_terminal(&self) -> bool {
        self.screen.is_some()
    }

    /// Writes a line; it need not arrive before [`Output::flush`]. Whatever names and values are in it, it is one line, and
    /// the terminal only shows it.
    pub fn line(&mut self, line: &str) -> Result<(), ScopeError> {
        self.raw_line(&text::printable(line))
    }

    /// Writes a line of JSON.
    pub fn json(&mut self, json: &impl Serialize) -> Result<(), ScopeError> {
        // Names, numbers and JSON can always be written as JSON.
        self.raw_line(&text::printable_json(&serde_json::to_string(json).unwrap_or_default()))
    }

    fn raw_line(&mut self, line: &str) -> Result<(), ScopeError> {
        self.to.write_all(line.as_bytes())?;
        Ok(self.to.write_all(b"\n")?)
    }

    /// Lets all that was written arrive.
    pub fn flush(&mut self) -> Result<(), ScopeError> {
        Ok(self.to.flush()?)
    }

    /// Writes a line of JSON, and lets it arrive.
    pub fn whole_json(&mut self, json: &impl Serialize) -> Result<(), ScopeError> {
        self.json(json)?;
        self.flush()
    }

    /// Writes a page: over the page before on a terminal, cut to its size; below it, behind an empty line, elsewhere.
    pub fn page(&mut self, lines: &[String]) -> Result<(), ScopeError> {
        match self.screen {
            Some(screen) => self.write_over(screen, lines)?,
            None => {
                if std::mem::replace(&mut self.standing, lines.len()) > 0 {
                    self.line("")?;
                }
                lines.iter().try_for_each(|line| self.line(line))?;
            }
        }
        self.flush()
    }

    fn write_over(&mut self, screen: Screen, lines: &[String]) -> Result<(), ScopeError> {
        if self.standing > 0 {
            write!(self.to, "\x1b[{}A", self.standing)?;
        }
        // The last line of a screen stays free for the cursor: a line feed there would scroll the page away.
        let shown = lines.len().min(screen.rows - 1);
        for line in &lines[..shown] {
            let shown = text::printable(line);
            let cut: String = shown.chars().take(screen.columns).collect();
            write!(self.to, "\r\x1b[2K{cut}\n")?;
        }
        self.standing = shown;
        Ok(self.to.write_all(b"\x1b[J")?)
    }
}

/// Rows of cells as lines: each column as wide as it has to be for what people read of a name, those that `right` names flush
/// right, the last one free.
pub fn in_columns(rows: &[Vec<String>], right: &[usize]) -> Vec<String> {
    let last = rows.iter().map(Vec::len).max().unwrap_or(0).saturating_sub(1);
    let cell = |(column, cell): (usize, &String)| match column == last {
        true => text::printable(cell).into_owned(),
        false => text::name(cell).into_owned(),
    };
    let rows: Vec<Vec<String>> = rows.iter().map(|row| row.iter().enumerate().map(cell).collect()).collect();
    let width = |column: usize| rows.iter().filter_map(|row| row.get(column)).map(|c| c.chars().count()).max();
    let widths: Vec<usize> = (0..=last).map(|column| width(column).unwrap_or(0)).collect();
    let line = |row: &Vec<String>| {
        let mut line = String::new();
        for (column, (cell, width)) in row.iter().zip(&widths).enumerate() {
            line += if column > 0 { "  " } else { "" };
            text::put_cell(&mut line, cell, *width, right.contains(&column));
        }
        line.trim_end().to_owned()
    };
    rows.iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(screen: Option<Screen>, pages: &[&[&str]]) -> String {
        let mut to = Vec::new();
        let mut output = Output::new(&mut to, screen);
        for page in pages {
            output.page(&page.iter().map(ToString::to_string).collect::<Vec<_>>()).unwrap();
        }
        String::from_utf8(to).unwrap()
    }

    #[test]
    fn pages_follow_each_other_in_a_pipe() {
        assert_eq!(written(None, &[&["a", "b"], &["c"]]), "a\nb\n\nc\n");
    }

    #[test]
    fn a_page_takes_the_place_of_the_one_before_on_a_terminal_and_is_cut_to_it() {
        let screen = Screen { columns: 3, rows: 3 };
        let written = written(Some(screen), &[&["äbcd", "b", "too many"], &["c"]]);
        assert_eq!(written, "\r\x1b[2Käbc\n\r\x1b[2Kb\n\x1b[J\x1b[2A\r\x1b[2Kc\n\x1b[J");
    }

    #[test]
    fn a_reader_that_has_gone_is_told_from_a_full_disk() {
        struct Gone;
        impl Write for Gone {
            fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
                Err(std::io::ErrorKind::BrokenPipe.into())
            }
            fn flush(&mut self) -> std::io::Result<()> {
                Ok(())
            }
        }
        assert!(matches!(Output::new(&mut Gone, None).line("x"), Err(ScopeError::ReaderGone)));
    }

    #[test]
    fn columns_are_as_wide_as_they_have_to_be() {
        let rows =
            [vec!["NAME".to_owned(), "RATE".into(), "VALUE".into()], vec!["Größe".into(), "7".into(), "".into()]];
        assert_eq!(in_columns(&rows, &[1]), ["NAME   RATE  VALUE", "Größe     7"]);
    }

    #[test]
    fn a_name_of_any_length_and_of_any_characters_is_a_cell_like_others() {
        let rows = [
            vec!["x".repeat(66_000), "1".into(), "value\x1b[2J".into()],
            vec!["\x1b]0;mine\x07".into(), "2".repeat(70_000), "v".repeat(70_000)],
            vec!["\u{9b}2J\u{202e}".into()],
        ];
        let lines = in_columns(&rows, &[1]);
        assert_eq!(lines[0], format!("{}…  {:>64}  value\\u{{1b}}[2J", "x".repeat(63), 1));
        assert!(lines[1].starts_with("\\u{1b}]0;mine\\u{7} ") && lines[1].chars().count() < 70_200);
        assert_eq!(lines[2], "\\u{9b}2J\\u{202e}");
        let written = written(Some(Screen { columns: 80, rows: 24 }), &[&["\x1b[31m\u{9b}"]]);
        assert_eq!(written, "\r\x1b[2K\\u{1b}[31m\\u{9b}\n\x1b[J");
        let mut to = Vec::new();
        let mut output = Output::new(&mut to, None);
        output.line("two\nlines\x1bc").unwrap();
        output.json(&serde_json::json!({"\x1b": "\u{9b}"})).unwrap();
        assert_eq!(String::from_utf8(to).unwrap(), "two\\nlines\\u{1b}c\n{\"\\u001b\":\"\\u009b\"}\n");
    }
}
