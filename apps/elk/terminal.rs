//! What people see of a command: words and tables on standard output, complaints and progress on standard error.

use std::io::{BufWriter, IsTerminal, Write};

use anyhow::Result;
use elk_bus::tell;
use elk_outside::colour::{self, Style};
use elk_outside::text;
use elk_scope::{Output, ScopeError, Table};

/// Writes lines to standard output, which the terminal only shows, whatever names are in them; a reader that has gone (`elk types | head`) is no failure.
pub fn say(text: &str) -> Result<()> {
    show(&text::printable_lines(text))
}

/// As [`say`], of words that are printable already, and may have colours.
pub fn show(text: &str) -> Result<()> {
    match std::io::stdout().write_all(text.as_bytes()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Err(error.into()),
        _ => Ok(()),
    }
}

/// Prints a table as wide as the terminal, if it is one.
pub fn print_table(table: &Table) -> Result<()> {
    let mut out = BufWriter::new(std::io::stdout().lock());
    let mut output = Output::standard(&mut out);
    let lines = table.lines(output.columns());
    match lines.iter().try_for_each(|line| output.styled(line)).and_then(|()| output.flush()) {
        Err(ScopeError::ReaderGone) => Ok(()),
        done => Ok(done?),
    }
}

/// Says what is wrong on standard error. Names of files and of other people's apps may be in it: the terminal only shows
/// them, and only as much as is of use.
pub fn complain(words: &str) {
    const MOST: usize = 16_000;
    let words = text::clipped(words, MOST);
    let stderr = std::io::stderr();
    if colour::on(&stderr) {
        let line = format!("{} {}\n", Style::Bad.paint("elk:", true), text::printable_lines(&words));
        // A terminal that is gone shows nothing.
        let _ = stderr.lock().write_all(line.as_bytes());
    } else {
        tell(format_args!("elk: {words}"));
    }
}

/// Says on a terminal how far reading has come, and leaves no trace of it; is silent in a pipe.
pub fn progress(what: &'static str) -> impl FnMut(u64, u64) {
    let terminal = std::io::stderr().is_terminal();
    let mut shown = Shown(None);
    move |done, all| {
        let percent = (100 * done).checked_div(all).unwrap_or(100);
        if terminal && shown.0 != Some(percent) {
            shown.0 = Some(percent);
            draw(&format!("\r{what} {percent} %\r"));
        }
    }
}

/// The percentage that stands on the terminal.
struct Shown(Option<u64>);

impl Drop for Shown {
    fn drop(&mut self) {
        if self.0.is_some() {
            draw("\x1b[K");
        }
    }
}

/// Draws on standard error. A terminal that is gone shows nothing; nobody ends over it, as with [`eprint!`].
pub fn draw(text: &str) {
    let _ = std::io::stderr().write_all(text.as_bytes());
}
