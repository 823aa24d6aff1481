//! Where a scope writes: lines that follow each other, or a page that is written anew in place.

use std::io::Write;

use elk_outside::colour::{self, Style};
pub use elk_outside::screen::Screen;
use elk_outside::text;
use serde::Serialize;

use crate::error::ScopeError;

/// Where a scope writes.
pub struct Output<'a> {
    to: &'a mut dyn Write,
    screen: Option<Screen>,
    /// How the screen is looked at again, whose window may change.
    look: fn() -> Option<Screen>,
    colours: bool,
    /// Lines of the page that stands on the screen.
    standing: usize,
    /// Whether the screen has changed under it: nobody knows where its lines are.
    resized: bool,
}

impl<'a> Output<'a> {
    /// Writes to a terminal with this screen, or to a pipe or file without one.
    pub fn new(to: &'a mut dyn Write, screen: Option<Screen>) -> Self {
        Self { to, screen, look: || None, colours: false, standing: 0, resized: false }
    }

    /// Writes to standard output, which `to` is: to its terminal, as wide as that is at the time, with colours if they
    /// are wanted, or to a pipe or file.
    pub fn standard(to: &'a mut dyn Write) -> Self {
        let (look, colours) = (|| Screen::of(&std::io::stdout()), colour::on(&std::io::stdout()));
        Self { to, screen: look(), look, colours, standing: 0, resized: false }
    }

    /// Characters in a line; `None`: as many as there are.
    pub fn columns(&self) -> Option<usize> {
        self.screen.map(|screen| screen.columns)
    }

    /// Looks how wide the terminal is by now, for the next page.
    pub fn look(&mut self) {
        let now = (self.look)();
        if now.is_some() && now != self.screen {
            self.screen = now;
            self.resized = self.standing > 0;
        }
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

    /// Writes a line in a style.
    pub fn styled(&mut self, line: &Line) -> Result<(), ScopeError> {
        let shown = line.style.paint(&text::printable(&line.text), self.colours);
        self.raw_line(&shown)
    }

    /// Writes a line of JSON.
    pub fn json(&mut self, json: &impl Serialize) -> Result<(), ScopeError> {
        let line = serde_json::to_string(json).map_err(std::io::Error::from)?;
        self.raw_line(&text::printable_json(&line))
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
    pub fn page(&mut self, lines: &[Line]) -> Result<(), ScopeError> {
        match self.screen {
            Some(screen) => self.write_over(screen, lines)?,
            None => {
                if std::mem::replace(&mut self.standing, lines.len()) > 0 {
                    self.line("")?;
                }
                lines.iter().try_for_each(|line| self.styled(line))?;
            }
        }
        self.flush()
    }

    fn write_over(&mut self, screen: Screen, lines: &[Line]) -> Result<(), ScopeError> {
        if std::mem::take(&mut self.resized) {
            self.to.write_all(b"\x1b[H\x1b[2J")?;
        } else if self.standing > 0 {
            write!(self.to, "\x1b[{}A", self.standing)?;
        }
        // The last line of a screen stays free for the cursor: a line feed there would scroll the page away.
        let shown = lines.len().min(screen.rows - 1);
        for line in &lines[..shown] {
            let shown = text::printable(&line.text);
            let cut: String = shown.chars().take(screen.columns).collect();
            write!(self.to, "\r\x1b[2K{}\n", line.style.paint(&cut, self.colours))?;
        }
        self.standing = shown;
        Ok(self.to.write_all(b"\x1b[J")?)
    }
}

/// A line, and how it is to catch the eye.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Line {
    /// How.
    pub style: Style,
    /// The line.
    pub text: String,
}

impl From<String> for Line {
    fn from(text: String) -> Self {
        Self { style: Style::Plain, text }
    }
}

impl PartialEq<&str> for Line {
    fn eq(&self, text: &&str) -> bool {
        self.text == *text
    }
}

/// Characters of a table's last column for which other columns give way.
const LAST_COLUMN: usize = 12;

/// Rows of cells under their heads, to be fitted into a terminal.
#[derive(Debug, Default)]
pub struct Table<'a> {
    /// The heads, then the rows.
    pub rows: Vec<Vec<String>>,
    /// Columns that are flush right.
    pub right: &'a [usize],
    /// Columns that can be done without, the first one first; those that say nothing go before them.
    pub spare: &'a [usize],
    /// Rows, from 1, that something has to be done about.
    pub bad: Vec<usize>,
    /// What has all columns, where one is left out; if nothing is said here, `--json`.
    pub all: &'a str,
}

impl Table<'_> {
    /// The table in lines of at most `columns` characters, as far as it can do without columns; the last column is
    /// clipped, and what is left out is said.
    pub fn lines(&self, columns: Option<usize>) -> Vec<Line> {
        let mut kept: Vec<usize> = (0..self.rows.first().map_or(0, Vec::len)).collect();
        let mut spare = self.spare.iter().filter(|column| self.says_nothing(**column)).chain(self.spare);
        while columns.is_some_and(|columns| self.needs(&kept) > columns)
            && let Some(gone) = spare.next()
        {
            kept.retain(|column| column != gone);
        }
        self.finished(self.in_columns(&kept), &kept, columns)
    }

    fn finished(&self, lines: Vec<String>, kept: &[usize], columns: Option<usize>) -> Vec<Line> {
        let clip = |line: String| columns.map_or(line.clone(), |columns| text::clipped(&line, columns).into_owned());
        let style = |row: usize| match row {
            0 => Style::Head,
            row if self.bad.contains(&row) => Style::Bad,
            _ => Style::Plain,
        };
        let mut lines: Vec<Line> =
            lines.into_iter().enumerate().map(|(row, line)| Line { style: style(row), text: clip(line) }).collect();
        let heads = self.rows.first().into_iter().flatten().enumerate();
        let gone: Vec<&str> =
            heads.filter(|(column, _)| !kept.contains(column)).map(|(_, head)| head.as_str()).collect();
        if !gone.is_empty() {
            let all = if self.all.is_empty() { "--json" } else { self.all };
            lines.push(clip(format!("no room here for {}; {all} has all", gone.join(", "))).into());
        }
        lines
    }

    fn in_columns(&self, kept: &[usize]) -> Vec<String> {
        let only = |row: &Vec<String>| kept.iter().filter_map(|column| row.get(*column).cloned()).collect();
        let right: Vec<usize> = (0..kept.len()).filter(|place| self.right.contains(&kept[*place])).collect();
        in_columns(&self.rows.iter().map(only).collect::<Vec<_>>(), &right)
    }

    /// Characters that these columns need: all of each, but of the last one no more than is of use.
    fn needs(&self, kept: &[usize]) -> usize {
        let width = |column: &usize| {
            let cells = self.rows.iter().filter_map(|row| row.get(*column));
            cells.map(|cell| text::name(cell).chars().count()).max().unwrap_or(0)
        };
        let Some((last, others)) = kept.split_last() else { return 0 };
        others.iter().map(|column| width(column) + 2).sum::<usize>() + width(last).min(LAST_COLUMN)
    }

    /// Whether nothing but zeros and dashes stands in a column.
    fn says_nothing(&self, column: usize) -> bool {
        let cells = self.rows.iter().skip(1).filter_map(|row| row.get(column));
        cells.into_iter().all(|cell| ["-", "0", "+0", "0 %"].contains(&cell.as_str()))
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
            output.page(&page.iter().map(|line| line.to_string().into()).collect::<Vec<_>>()).unwrap();
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
    fn a_table_does_without_columns_where_there_is_no_room_for_them() {
        let row = |cells: [&str; 5]| cells.map(str::to_owned).to_vec();
        let rows = vec![
            row(["NAME", "TYPE", "LOST", "RATE", "LAST"]),
            row(["Map", "OctoMap", "0", "3 Hz", "signal 9 (SIGKILL), and more"]),
            row(["Explorer", "Potential", "-", "12 Hz", "-"]),
        ];
        let table = Table { rows, right: &[2, 3], spare: &[1, 2, 3], bad: vec![1], ..Table::default() };
        let whole = table.lines(None);
        assert_eq!(whole[1], "Map       OctoMap       0   3 Hz  signal 9 (SIGKILL), and more");
        assert_eq!([whole[0].style, whole[1].style, whole[2].style], [Style::Head, Style::Bad, Style::Plain]);
        assert_eq!(table.lines(Some(80)), whole);
        let text = |columns| table.lines(Some(columns)).into_iter().map(|line| line.text).collect::<Vec<_>>();
        assert_eq!(
            text(41),
            [
                "NAME      TYPE        RATE  LAST",
                "Map       OctoMap     3 Hz  signal 9 (SI…",
                "Explorer  Potential  12 Hz  -",
                "no room here for LOST; --json has all"
            ]
        );
        assert_eq!(text(30)[1], "Map        3 Hz  signal 9 (SI…");
        assert_eq!(text(24)[1], "Map       signal 9 (SIG…");
        assert!((1..100).all(|columns| text(columns).iter().all(|line| line.chars().count() <= columns)));
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
