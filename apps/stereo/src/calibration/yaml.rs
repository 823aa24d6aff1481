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
}

/// What stands behind a name.
#[derive(Debug)]
pub struct Entry {
    /// Where it stands, counted from 1.
    pub line: usize,
    pub text: String,
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
        self.0.iter().find(|(other, _)| other == name).map(|(_, entry)| entry)
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
            document.add(is_inside, name.trim(), Entry { line, text });
        }
        Ok(document)
    }

    /// What is inside of the last entry is left out, but for the data of a matrix, which is put in its place.
    fn add(&mut self, is_inside: bool, name: &str, entry: Entry) {
        match (is_inside, name, self.0.last_mut()) {
            (false, ..) => self.0.push((name.trim_matches('"').to_owned(), entry)),
            (true, "data", Some((_, matrix))) => matrix.text = entry.text,
            (true, ..) => {}
        }
    }
}

fn without_comment(line: &str) -> &str {
    line.split('#').next().unwrap_or_default().trim_end()
}
