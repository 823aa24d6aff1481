//! How large a terminal is.

use std::io::IsTerminal;
use std::os::fd::AsFd;

use rustix::termios::{Winsize, tcgetwinsize};

/// The size of a terminal, in characters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Screen {
    /// Characters in a line.
    pub columns: usize,
    /// Lines.
    pub rows: usize,
}

impl Screen {
    /// What a terminal that does not know its size is taken for, as everywhere.
    const USUAL: Self = Self { columns: 80, rows: 24 };

    /// The terminal that an output is, as large as it is now; none: it is no terminal.
    pub fn of(output: &(impl AsFd + IsTerminal)) -> Option<Self> {
        output.is_terminal().then(|| tcgetwinsize(output).map_or(Self::USUAL, Self::sized))
    }

    /// A serial line has no size, and says 0 × 0; a page needs a line for the cursor besides.
    fn sized(size: Winsize) -> Self {
        match (usize::from(size.ws_col), usize::from(size.ws_row)) {
            (columns @ 1.., rows @ 2..) => Self { columns, rows },
            (columns @ 1.., _) => Self { columns, ..Self::USUAL },
            _ => Self::USUAL,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_terminal_without_a_size_has_the_usual_one_and_a_file_has_none() {
        let sized = |ws_col, ws_row| Screen::sized(Winsize { ws_col, ws_row, ws_xpixel: 0, ws_ypixel: 0 });
        assert_eq!(sized(0, 0), Screen::USUAL);
        assert_eq!(sized(40, 0), Screen { columns: 40, rows: 24 });
        assert_eq!(sized(132, 50), Screen { columns: 132, rows: 50 });
        assert_eq!(Screen::of(&tempfile::tempfile().unwrap()), None);
    }
}
