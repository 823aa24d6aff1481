//! As much of YAML as calibrations are written in: entries of a name and a word or a list of numbers, and matrices, of which only the
//! numbers matter.

/// Why a text cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum YamlError {
    /// A line is no entry.
    #[error("line {line}: {found:?} is no entry: `name: value` would be right")]
    Line {
        /// Where, counted from 1.
        line: usize,
        /// What stands there.
        found: String,
    },
    /// A list does not end.
    #[error("line {line}: the list that begins here does not end: a `]` would be right")]
    List {
        /// Where it begins, counted from 1.
        line: usize,
    },
    /// A name stands there again, and nobody knows which of the two counts.
    #[error("line {line}: {name} stands there again, after line {first}: one of them would be right")]
    Again {
        /// Where it stands again, counted from 1.
        line: usize,
        /// Where it stands first, counted from 1.
        first: usize,
        /// The name.
        name: String,
    },
}

/// What stands behind a name.
#[derive(Debug)]
pub struct Entry {
    /// Where it stands, counted from 1.
    pub line: usize,
    pub text: String,
    /// Where the `data` of a matrix stand, and where they stand again.
    data: [Option<usize>; 2],
}

impl Entry {
    /// A number, or the numbers of a list.
    pub fn numbers(&self) -> Option<Vec<f64>> {
        let inside = self.text.strip_prefix('[').and_then(|text| text.strip_suffix(']')).unwrap_or(&self.text);
        let inside = inside.trim().trim_end_matches(',');
        inside.split(',').map(|number| number.trim().parse().ok()).collect()
    }

    /// As much of it as a message may hold.
    pub fn shown(&self) -> String {
        let short: String = self.text.chars().take(60).collect();
        if short.len() < self.text.len() { format!("{short}…") } else { short }
    }
}

/// Entries by their names. A matrix is an entry whose text is its `data`.
#[derive(Debug, Default)]
pub struct Document(Vec<(String, Entry)>);

impl Document {
    /// The entry of a name; of several, the first.
    pub fn get(&self, name: &str) -> Option<&Entry> {
        self.all(name).next()
    }

    /// The only entry of a name.
    ///
    /// # Errors
    /// There are two, or it is a matrix with two `data`.
    pub fn only(&self, name: &str) -> Result<Option<&Entry>, YamlError> {
        let mut all = self.all(name);
        match (all.next(), all.next()) {
            (Some(Entry { line: first, .. }), Some(&Entry { line, .. })) => {
                Err(YamlError::Again { line, first: *first, name: name.to_owned() })
            }
            (Some(&Entry { data: [Some(first), Some(line)], .. }), None) => {
                Err(YamlError::Again { line, first, name: format!("data of {name}") })
            }
            (entry, _) => Ok(entry),
        }
    }

    fn all(&self, name: &str) -> impl Iterator<Item = &Entry> {
        self.0.iter().filter(move |(other, _)| other == name).map(|(_, entry)| entry)
    }

    /// # Errors
    /// A line that is no entry, and a list without an end.
    pub fn read(text: &str) -> Result<Self, YamlError> {
        let mut document = Self::default();
        let mut lines = text.lines().enumerate().map(|(i, line)| (i + 1, line));
        while let Some((line, raw)) = lines.next() {
            let content = without_comment(raw);
            if content.trim().is_empty() || ["%YAML", "---", "..."].iter().any(|mark| content.starts_with(mark)) {
                continue;
            }
            let found = || YamlError::Line { line, found: content.trim().chars().take(60).collect() };
            let (name, value) = content.split_once(':').ok_or_else(found)?;
            let mut text = value.trim().to_owned();
            while text.starts_with('[') && !text.ends_with(']') {
                let more = lines.next().map(|(_, more)| without_comment(more)).filter(|more| !more.contains(':'));
                text.push_str(more.ok_or(YamlError::List { line })?.trim());
            }
            let is_inside = name.starts_with(char::is_whitespace);
            document.add(is_inside, name.trim(), Entry { line, text, data: [None; 2] });
        }
        Ok(document)
    }

    /// What is inside of the last entry is left out, but for the data of a matrix, which is put in its place.
    fn add(&mut self, is_inside: bool, name: &str, entry: Entry) {
        match (is_inside, name, self.0.last_mut()) {
            (false, ..) => self.0.push((name.trim_matches('"').to_owned(), entry)),
            (true, "data", Some((_, Entry { text, data: [first @ None, _], .. }))) => {
                (*text, *first) = (entry.text, Some(entry.line));
            }
            (true, "data", Some((_, Entry { data: [_, again], .. }))) => *again = again.or(Some(entry.line)),
            (true, ..) => {}
        }
    }
}

fn without_comment(line: &str) -> &str {
    line.split('#').next().unwrap_or_default().trim_end()
}
