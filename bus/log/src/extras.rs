//! What stands in a log beside its messages: attachments and metadata, by their names.

use std::collections::BTreeMap;

use elk_outside::text;

/// So many are told apart; more are counted.
const MOST: usize = 1000;
/// Names and media types are told up to so many characters.
const LONGEST_NAME: usize = 256;

/// What kind of record stands beside the messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum ExtraKind {
    /// A file that was put into the log.
    Attachment,
    /// Names with their values.
    Metadata,
}

impl ExtraKind {
    /// The kind in one word.
    pub fn word(self) -> &'static str {
        match self {
            Self::Attachment => "attachment",
            Self::Metadata => "metadata",
        }
    }
}

/// All attachments of one name and media type, or all metadata of one name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Extra {
    /// What kind of record it is.
    pub kind: ExtraKind,
    /// Its name.
    pub name: String,
    /// What an attachment is (`text/plain`); empty: nobody says.
    pub media_type: String,
    /// How many there are.
    pub count: u64,
    /// Bytes of all of them: of an attachment its data, of metadata the record.
    pub bytes: u64,
}

/// What stands beside the messages of a log: one of a million of them takes no more memory for it.
#[derive(Debug, Clone, Default)]
pub(crate) struct Extras {
    /// Counts and bytes.
    told: BTreeMap<(ExtraKind, String, String), (u64, u64)>,
    /// Those that are only counted.
    more: u64,
}

impl Extras {
    /// Notes one record.
    pub fn note(&mut self, kind: ExtraKind, name: &str, media_type: &str, bytes: u64) {
        let clipped = |text: &str| text::clipped(text, LONGEST_NAME).into_owned();
        self.add((kind, clipped(name), clipped(media_type)), (1, bytes));
    }

    /// Notes one record of which nothing is known.
    pub fn note_unknown(&mut self) {
        self.more = self.more.saturating_add(1);
    }

    /// Notes all that `other` has.
    pub fn merge(&mut self, other: &Self) {
        other.told.iter().for_each(|(key, amount)| self.add(key.clone(), *amount));
        self.more = self.more.saturating_add(other.more);
    }

    fn add(&mut self, key: (ExtraKind, String, String), (count, bytes): (u64, u64)) {
        if self.told.len() >= MOST && !self.told.contains_key(&key) {
            self.more = self.more.saturating_add(count);
            return;
        }
        let (counted, all) = self.told.entry(key).or_default();
        (*counted, *all) = (counted.saturating_add(count), all.saturating_add(bytes));
    }

    /// Those that are told apart, by kind and name.
    pub fn told(&self) -> impl Iterator<Item = Extra> {
        self.told.iter().map(|((kind, name, media_type), (count, bytes))| Extra {
            kind: *kind,
            name: name.clone(),
            media_type: media_type.clone(),
            count: *count,
            bytes: *bytes,
        })
    }

    /// How many more there are.
    pub fn more(&self) -> u64 {
        self.more
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_million_names_are_counted_and_not_kept() {
        let mut extras = Extras::default();
        for number in 0..5000 {
            extras.note(ExtraKind::Attachment, &format!("{number}{}", "x".repeat(1000)), "text/plain", 3);
        }
        extras.note(ExtraKind::Attachment, &format!("0{}", "x".repeat(1000)), "text/plain", 4);
        let mut all = Extras::default();
        all.note_unknown();
        all.merge(&extras);
        let told: Vec<Extra> = all.told().collect();
        assert_eq!((told.len(), all.more()), (MOST, 4001));
        assert_eq!((told[0].count, told[0].bytes, told[0].name.chars().count()), (2, 7, LONGEST_NAME));
    }
}
