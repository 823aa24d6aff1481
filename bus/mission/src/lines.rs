//! Line and column of any byte of a file, however long its lines are.

use crate::problem::Place;

/// Between two places that are known lie so many bytes.
const STEP: usize = 1024;

/// Where lines and columns are in a text.
pub(crate) struct Lines<'a> {
    text: &'a str,
    /// Row and column, from 1, of the first letter at or behind each multiple of [`STEP`] bytes, and where that letter is.
    marks: Vec<(usize, u32, u32)>,
}

impl<'a> Lines<'a> {
    /// Those of a text.
    pub fn of(text: &'a str) -> Self {
        let (mut row, mut column) = (1, 1);
        let mut marks = Vec::with_capacity(text.len() / STEP + 1);
        for (at, character) in text.char_indices() {
            if at >= marks.len() * STEP {
                marks.push((at, row, column));
            }
            (row, column) = behind(character, row, column);
        }
        Self { text, marks }
    }

    /// Where a byte stands.
    pub fn place(&self, byte: usize) -> Place {
        // A letter that lies across a multiple begins before it; the mark behind it is then the next letter's.
        let mark = (byte / STEP).min(self.marks.len().saturating_sub(1));
        let mark = self.marks.get(mark).filter(|(at, ..)| *at <= byte).or_else(|| self.marks.get(mark.checked_sub(1)?));
        let &(from, row, column) = mark.unwrap_or(&(0, 1, 1));
        let letters = self.text.get(from..).unwrap_or_default().char_indices();
        let before = letters.take_while(|(at, _)| from + at < byte);
        let (line, column) = before.fold((row, column), |(row, column), (_, letter)| behind(letter, row, column));
        Place::File { line, column }
    }
}

fn behind(letter: char, row: u32, column: u32) -> (u32, u32) {
    if letter == '\n' { (row + 1, 1) } else { (row, column + 1) }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn every_letter_is_where_counting_finds_it(text in "[ä\n€a]{0,3000}") {
            let lines = Lines::of(&text);
            let (mut row, mut column) = (1, 1);
            for (at, letter) in text.char_indices() {
                prop_assert_eq!(lines.place(at), Place::File { line: row, column });
                (row, column) = behind(letter, row, column);
            }
            prop_assert_eq!(lines.place(text.len()), Place::File { line: row, column });
        }
    }
}
