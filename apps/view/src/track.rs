//! A list that only grows, of which a reader has the beginning.

/// A growing list. When it is full, every second entry goes, and readers begin anew.
#[derive(Debug, Clone)]
pub struct Track<T> {
    entries: Vec<T>,
    most: usize,
    /// Counts up when what was there is not there any more.
    edition: u64,
}

/// How far a reader has read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Read {
    edition: u64,
    entries: usize,
}

impl<T: Clone> Track<T> {
    /// An empty list of at most `most` entries.
    pub fn new(most: usize) -> Self {
        Self { entries: Vec::new(), most: most.max(2), edition: 1 }
    }

    /// Adds an entry.
    pub fn push(&mut self, entry: T) {
        if self.entries.len() == self.most {
            let mut index = 0;
            self.entries.retain(|_| {
                index += 1;
                index % 2 == 1
            });
            self.edition += 1;
        }
        self.entries.push(entry);
    }

    /// The last entry.
    pub fn last(&self) -> Option<&T> {
        self.entries.last()
    }

    /// What a reader has not read, and at which index it begins; `None`: nothing. He has read it then.
    pub fn next(&self, read: &mut Read) -> Option<(usize, &[T])> {
        let from = if read.edition == self.edition { read.entries } else { 0 };
        let is_new = read.edition != self.edition && read.edition != 0;
        *read = Read { edition: self.edition, entries: self.entries.len() };
        (is_new || from < self.entries.len()).then(|| (from, &self.entries[from..]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reader_has_what_the_list_has_also_when_it_was_thinned() {
        let (mut track, mut read, mut known) = (Track::new(8), Read::default(), Vec::new());
        assert_eq!(track.next(&mut read), None);
        for entry in 0..100 {
            track.push(entry);
            if entry % 3 == 0
                && let Some((from, entries)) = track.next(&mut read)
            {
                known.truncate(from);
                known.extend_from_slice(entries);
                assert_eq!(known, track.entries);
            }
        }
        assert!(track.entries.len() <= 8);
        assert_eq!((track.entries[0], track.last()), (0, Some(&99)));
    }
}
