//! MOOS' own text logs: `.alog`, with binary values in a `.blog` beside it.
//!
//! One line a message: time since LOGSTART in 15 columns, name in 20, source in 15, then the value, each followed by a
//! space. Columns that are too narrow are overrun, so a line is read by its white space. What MOOS leaves undone is put
//! right on the way out: a line break in a text is written as `\n` and breaks no line, and the date is the run's. On the
//! way in, a line that does not begin with a number goes on with the text of the line before it, as MOOS breaks them. One
//! that names a variable and a source of the file where a message does is no such line: its time is damaged. Of it, of a
//! line that goes on with no text, and of a last line that is cut short the reader says so.
//!
//! A number has as many digits as bring it back bit for bit. What a line means depends on its variable: a file does not say
//! what is a number, so a variable that is a text once is one throughout, and one that is `nan` or `inf` is a number if it
//! is one elsewhere. Small typed values are JSON, which MOOS' tools can search; the others lie in the `.blog`. The first
//! variable that carries camera poses is also written as `NAV_X`, `NAV_Y`, `NAV_Z` (m, world) and `NAV_HEADING`, the
//! direction of its optical axis on the ground (degrees clockwise from the world's y, MOOS' north).

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use elk_bus::clock::Date;
use elk_bus::codec::{self, MAX_VALUE_BYTES};
use elk_bus::{Type, TypeRef, Value, ValueRef};
use elk_outside::{file, text, time};
use elk_spatial::messages::CameraPose;

use crate::damage::Damage;
use crate::error::LogError;
use crate::record::{Record, RecordRef};

/// The line above and below the banner.
const RULE: &str = "%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%";
/// The longest line, and the longest text of several, that is read (bytes); the rest of a longer one is passed over.
const MAX_LINE_BYTES: u64 = 16 << 20;
/// What stands for a binary value.
const BINARY: (&str, &str) = ("<MOOS_BINARY>", "</MOOS_BINARY>");
/// The type of a binary value that MOOS wrote: it has none.
pub const MOOS_BINARY: &str = "MOOS_BINARY";

/// Typed values up to this length (bytes) are written as JSON.
const LONGEST_JSON: usize = 4096;
/// The variables of which it is noted what they carry have names of so many bytes in all; what others carry each line says.
const MAX_NAMES_BYTES: usize = 64 << 20;

/// Writes an `.alog`.
pub struct AlogWriter {
    path: PathBuf,
    out: BufWriter<Box<dyn Write>>,
    /// Whether there is room beside it for the binary values.
    piped: bool,
    /// The binary values' file, once there is one, and its length.
    blog: Option<(BufWriter<Box<dyn Write>>, u64)>,
    /// The variable whose poses are written as MOOS' own.
    navigated: Option<String>,
    start: f64,
}

impl AlogWriter {
    /// Creates the file at `path`, for a run that started at `start` (s since 1970).
    pub fn create(path: &Path, start: f64) -> Result<Self, LogError> {
        let file = File::create_new(path).map_err(|source| LogError::Create { path: path.into(), source })?;
        Self::begin(path, Box::new(file), false, start)
    }

    /// Writes to `out`, which is called `path` for people, as it comes. Binary values are left out:
    /// [`AlogWriter::finish`] says whether there were any.
    pub fn piped(path: &Path, out: impl Write + 'static, start: f64) -> Result<Self, LogError> {
        Self::begin(path, Box::new(out), true, start)
    }

    fn begin(path: &Path, out: Box<dyn Write>, piped: bool, start: f64) -> Result<Self, LogError> {
        // LOGSTART has two decimals; times count from what is written there.
        let start = (start * 100.0).round() / 100.0;
        let create = |source| LogError::Create { path: path.into(), source };
        let mut out = BufWriter::new(out);
        let banner = format!(
            "{RULE}\n%% LOG FILE:       {}\n%% FILE OPENED ON  {}\n%% LOGSTART               {start:.2}\n{RULE}\n",
            path.file_name().unwrap_or_default().display(),
            date(start)
        );
        out.write_all(banner.as_bytes()).map_err(create)?;
        Ok(Self { path: path.into(), out, piped, blog: None, navigated: None, start })
    }

    /// Writes a message.
    pub fn append(&mut self, record: &RecordRef<'_>) -> Result<(), LogError> {
        let value = match record.value {
            ValueRef::Double(number) => format!("{:<12}", digits(number)),
            ValueRef::Text(text) => text.replace("\r\n", "\\n").replace(['\n', '\r'], "\\n"),
            ValueRef::Binary { type_, bytes } => match as_json(type_, bytes) {
                Some(json) => json,
                None => self.put_binary(record, type_, bytes)?,
            },
        };
        let line = format!("{}{value} \n", columns(self.start, record));
        self.out.write_all(line.as_bytes()).map_err(|source| self.failed(source))?;
        self.put_navigation(record)
    }

    /// Writes a camera's pose as MOOS' tools look for one.
    fn put_navigation(&mut self, record: &RecordRef<'_>) -> Result<(), LogError> {
        let ValueRef::Binary { type_, bytes } = record.value else { return Ok(()) };
        if !type_.is::<CameraPose>() {
            return Ok(());
        }
        let Ok(camera) = codec::decode::<CameraPose>(bytes) else {
            return Ok(());
        };
        if self.navigated.get_or_insert_with(|| record.key.to_owned()) != record.key {
            return Ok(());
        }
        let (at, towards) = (camera.pose.position(), camera.pose.forward());
        let heading = towards.x.atan2(towards.y).to_degrees().rem_euclid(360.0);
        // Straight up or down there is none.
        let heading = (towards.x.hypot(towards.y) > 1e-9).then_some(("NAV_HEADING", heading));
        for (key, number) in [("NAV_X", at.x), ("NAV_Y", at.y), ("NAV_Z", at.z)].into_iter().chain(heading) {
            self.append(&RecordRef { key, value: ValueRef::Double(number), ..*record })?;
        }
        Ok(())
    }

    fn put_binary(&mut self, record: &RecordRef<'_>, type_: TypeRef<'_>, bytes: &[u8]) -> Result<String, LogError> {
        let path = blog_of(&self.path);
        let create = |source| LogError::Create { path: path.clone(), source };
        let (mut blog, mut length) = match self.blog.take() {
            Some(blog) => blog,
            None if self.piped => (BufWriter::new(Box::new(std::io::sink()) as Box<dyn Write>), 0),
            None => (BufWriter::new(Box::new(File::create_new(&path).map_err(create)?) as Box<dyn Write>), 0),
        };
        let head = columns(self.start, record);
        let written = [head.as_bytes(), bytes, b"\n"].iter().try_for_each(|part| blog.write_all(part));
        let offset = length + head.len() as u64;
        length = offset + bytes.len() as u64 + 1;
        self.blog = Some((blog, length));
        written.map_err(|source| self.failed(source))?;
        let file = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let (open, close) = BINARY;
        let bytes = bytes.len();
        // MOOS reads the first three; type and layout bring the value back to elk as it was.
        let (name, layout) = (type_.name(), type_.layout());
        Ok(format!("{open}File={file},Offset={offset},Bytes={bytes},Type={name},Layout={layout:016x}{close}"))
    }

    /// Brings everything into the files. Answers the file of the binary values, if there are any.
    pub fn finish(mut self) -> Result<Option<PathBuf>, LogError> {
        let flushed = self.out.flush().and_then(|()| self.blog.as_mut().map_or(Ok(()), |(blog, _)| blog.flush()));
        flushed.map_err(|source| self.failed(source))?;
        Ok(self.blog.map(|_| blog_of(&self.path)))
    }

    fn failed(&self, source: std::io::Error) -> LogError {
        LogError::Write { path: self.path.clone(), source, waiting: self.out.buffer().len() }
    }
}

/// A small value of a type that describes itself, for people and for MOOS' tools.
fn as_json(type_: TypeRef<'_>, bytes: &[u8]) -> Option<String> {
    let small = bytes.len() <= LONGEST_JSON;
    small.then(|| type_.to_json(bytes, usize::MAX).ok()).flatten().map(|json| json.to_string())
}

/// A number as MOOS writes it, or with as many digits as bring it back bit for bit.
fn digits(number: f64) -> String {
    if !number.is_finite() {
        return format!("{number}").to_lowercase();
    }
    let usual = format!("{number:.5}");
    match usual.parse::<f64>() {
        Ok(same) if same.to_bits() == number.to_bits() => usual,
        _ => format!("{number:?}"),
    }
}

/// Time, name and source, each in its column.
fn columns(start: f64, record: &RecordRef<'_>) -> String {
    let aux = if record.source_aux.is_empty() { String::new() } else { format!(":{}", record.source_aux) };
    let word = |text: &str| text.split_whitespace().collect::<Vec<_>>().join("_");
    let (key, source) = (word(record.key), word(&format!("{}{aux}", record.source)));
    let time = record.time - start;
    let (usual, exact) = (format!("{time:.3}"), format!("{time:.6}"));
    let time = if exact.ends_with("000") { usual } else { exact };
    format!("{time:<15} {key:<20} {source:<15} ")
}

/// The binary file beside an `.alog`.
fn blog_of(path: &Path) -> PathBuf {
    path.with_extension("blog")
}

/// A date as C's `ctime` writes it: `Mon Jun  2 01:38:39 2008`, UTC.
fn date(secs: f64) -> String {
    const DAYS: [&str; 7] = ["Mon", "Tue", "Wed", "Thu", "Fri", "Sat", "Sun"];
    const MONTHS: [&str; 12] = ["Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec"];
    // Before 1970 and after 9999 there is no run; times of a warped clock may lie there.
    let Date { year, month, day, hour, minute, second, weekday } = Date::of(secs.clamp(0.0, time::LAST));
    let (weekday, month) = (DAYS[weekday as usize], MONTHS[month as usize - 1]);
    format!("{weekday} {month} {day:2} {hour:02}:{minute:02}:{second:02} {year}")
}

/// Reads an `.alog`, message by message.
pub struct AlogReader {
    path: PathBuf,
    lines: BufReader<File>,
    start: f64,
    /// Whether values carry their type: `D:` or `S:`.
    marked: bool,
    types: Arc<Types>,
    blog: Option<File>,
    /// The message before the line that is read next: more of its text may come.
    ahead: Option<Record>,
    /// Whether the line before was a message that is damaged: what goes on with a text goes on with that one's.
    garbled: bool,
    damage: Damage,
    messages: u64,
    /// Whether the file ends in the midst of the line that was read last.
    cut: bool,
    /// Lines and bytes that were read.
    lines_read: u64,
    read: u64,
    length: u64,
}

/// What variables carry, as all of a file shows.
#[derive(Debug, Default)]
struct Types {
    /// Those that are a number somewhere.
    numbers: BTreeSet<String>,
    /// Those that are a text somewhere.
    texts: BTreeSet<String>,
    /// Who has written any.
    sources: BTreeSet<String>,
    names_bytes: usize,
}

impl Types {
    fn note(&mut self, Line { key, source, value, .. }: &Line<'_>) {
        keep(&mut self.sources, source, &mut self.names_bytes);
        match Word::of(value) {
            Word::Number(_) => keep(&mut self.numbers, key, &mut self.names_bytes),
            Word::Text => keep(&mut self.texts, key, &mut self.names_bytes),
            Word::NotFinite(_) => {} // a number beside numbers, a word beside words
        }
    }

    /// Whether a line that is no message was one: its second word is a variable, its third who writes such.
    fn are_named_in(&self, line: &str) -> bool {
        let mut words = line.split_whitespace().skip(1);
        let is_known = |key: &str| self.texts.contains(key) || self.numbers.contains(key);
        words.next().is_some_and(is_known) && words.next().is_some_and(|source| self.sources.contains(source))
    }

    /// What `value` of `key` is.
    fn value(&self, key: &str, value: &str) -> Value {
        match Word::of(value) {
            Word::Number(number) if !self.texts.contains(key) => Value::Double(number),
            Word::NotFinite(number) if self.numbers.contains(key) && !self.texts.contains(key) => Value::Double(number),
            _ => Value::Text(value.into()),
        }
    }
}

/// Keeps a name, as long as there is room for it.
fn keep(names: &mut BTreeSet<String>, name: &str, names_bytes: &mut usize) {
    if !names.contains(name) && *names_bytes + name.len() <= MAX_NAMES_BYTES {
        *names_bytes += name.len();
        names.insert(name.into());
    }
}

/// What a value can be by itself.
enum Word {
    Number(f64),
    /// A number as C writes it that is not finite, or a word.
    NotFinite(f64),
    Text,
}

impl Word {
    fn of(text: &str) -> Self {
        match text {
            "nan" | "-nan" | "NaN" => Self::NotFinite(f64::NAN),
            "inf" | "+inf" => Self::NotFinite(f64::INFINITY),
            "-inf" => Self::NotFinite(f64::NEG_INFINITY),
            _ => number(text).map_or(Self::Text, Self::Number),
        }
    }
}

/// A line that begins a message.
struct Line<'a> {
    time: f64,
    key: &'a str,
    source: &'a str,
    value: &'a str,
}

impl<'a> Line<'a> {
    fn of(line: &'a str) -> Option<Self> {
        let (time, rest) = word(line)?;
        let (key, rest) = word(rest)?;
        let (source, rest) = word(rest)?;
        // What is no moment begins no message.
        Some(Self { time: time::seconds(number(time)?)?, key, source, value: rest.trim() })
    }
}

impl AlogReader {
    /// Opens a file, and reads it once to know what its variables carry.
    ///
    /// # Errors
    /// It cannot be read, or has no line of an `.alog` among its first.
    pub fn open(path: &Path) -> Result<Self, LogError> {
        let types = Self::at_the_beginning(path, Arc::default())?.types()?;
        Self::of(path, Arc::new(types))
    }

    /// The same file from its beginning.
    ///
    /// # Errors
    /// As [`AlogReader::open`].
    pub fn again(&self) -> Result<Self, LogError> {
        Self::of(&self.path, self.types.clone())
    }

    fn of(path: &Path, types: Arc<Types>) -> Result<Self, LogError> {
        let mut log = Self::at_the_beginning(path, types)?;
        log.ahead = log.next_message()?;
        match log.ahead {
            Some(_) => Ok(log),
            None => Err(LogError::NoLog { path: path.into(), reason: "no line of it is one of an .alog".into() }),
        }
    }

    fn at_the_beginning(path: &Path, types: Arc<Types>) -> Result<Self, LogError> {
        let read = |source| LogError::Read { path: path.into(), source };
        let file = file::open(path).map_err(read)?;
        let length = file.metadata().map_err(read)?.len();
        Ok(Self {
            path: path.into(),
            lines: BufReader::new(file),
            start: 0.0,
            marked: false,
            types,
            blog: None,
            ahead: None,
            garbled: false,
            damage: Damage::default(),
            messages: 0,
            cut: false,
            lines_read: 0,
            read: 0,
            length,
        })
    }

    /// Reads all of the file for what its variables carry.
    fn types(mut self) -> Result<Types, LogError> {
        let mut types = Types::default();
        while let Some(line) = self.line()? {
            if line.starts_with("%%") {
                self.banner(&line)?;
            } else if let Some(line) = Line::of(&line).filter(|line| !line.value.contains(BINARY.0)) {
                types.note(&line);
            }
        }
        Ok(types)
    }

    /// When the run started (s since 1970), as the banner says.
    pub fn start(&self) -> f64 {
        self.start
    }

    /// Bytes read, and bytes in all.
    pub fn progress(&self) -> (u64, u64) {
        (self.read, self.length)
    }

    /// What was found to be damaged so far, in words; beyond a thousand lines the rest is counted.
    pub fn damage(&self) -> Vec<String> {
        self.damage.reasons()
    }

    fn note_damage(&mut self, what: &str) {
        let Self { path, lines_read, .. } = self;
        self.damage.note(format!("{}: line {lines_read} {what}", path.display()));
    }

    /// A line without its end; nothing at the end of the file.
    fn line(&mut self) -> Result<Option<String>, LogError> {
        let mut line = Vec::new();
        let failed = |source| LogError::Read { path: self.path.clone(), source };
        let count = (&mut self.lines).take(MAX_LINE_BYTES).read_until(b'\n', &mut line).map_err(failed)?;
        self.read += count as u64;
        self.lines_read += 1;
        self.cut = !line.ends_with(b"\n");
        if count as u64 == MAX_LINE_BYTES && !line.ends_with(b"\n") {
            self.lines.skip_until(b'\n').map_err(|source| LogError::Read { path: self.path.clone(), source })?;
            self.note_damage(&format!("has more than {MAX_LINE_BYTES} bytes; the rest is passed over"));
        }
        let text = String::from_utf8_lossy(&line);
        Ok((count > 0).then(|| text.trim_end_matches(['\n', '\r']).to_owned()))
    }

    /// The next line that begins a message; what comes before goes on with the message ahead.
    fn next_message(&mut self) -> Result<Option<Record>, LogError> {
        while let Some(line) = self.line()? {
            if line.starts_with("%%") {
                self.banner(&line)?;
            } else if let Some(record) = self.message(&line) {
                self.garbled = false;
                return Ok(Some(record));
            } else if !line.trim().is_empty() {
                self.go_on(&line);
            }
        }
        Ok(None)
    }

    /// Takes a line that begins no message.
    fn go_on(&mut self, line: &str) {
        let is_cut = self.cut && word(line).is_some_and(|(time, _)| number(time).is_some());
        if is_cut || self.types.are_named_in(line) {
            self.garbled = true;
            let what = if is_cut { "ends before its value" } else { "does not begin with a time" };
            return self.note_damage(&format!("{what}; its message is passed over"));
        }
        match &mut self.ahead {
            Some(Record { value: Value::Text(text), .. })
                if !self.garbled && text.len() + line.len() < MAX_LINE_BYTES as usize =>
            {
                text.push('\n');
                text.push_str(line.trim_end());
            }
            _ => self.note_damage("is no message, and there is no text that it goes on with; it is passed over"),
        }
    }

    fn banner(&mut self, line: &str) -> Result<(), LogError> {
        let mut words = line.trim_start_matches('%').split_whitespace();
        match words.next() {
            Some("LOGSTART") => self.start = self.log_start(words.next().unwrap_or_default())?,
            Some("DATATYPE") => self.marked = line.contains(" ON"),
            _ => {}
        }
        Ok(())
    }

    /// When the run started. All times count from there: without it there are none.
    fn log_start(&self, said: &str) -> Result<f64, LogError> {
        let start = number(said).filter(|start| (0.0..=time::LAST).contains(start));
        start.ok_or_else(|| {
            let said = text::clipped(said, 40);
            let reason = format!("its LOGSTART is {said:?}; right is the run's start in seconds since 1970");
            LogError::NoLog { path: self.path.clone(), reason }
        })
    }

    fn message(&mut self, line: &str) -> Option<Record> {
        let Line { time, key, source, value } = Line::of(line)?;
        let (source, community) = source.split_once('@').unwrap_or((source, ""));
        let (source, source_aux) = source.split_once(':').unwrap_or((source, ""));
        let record = Record {
            key: key.into(),
            source: source.into(),
            source_aux: source_aux.into(),
            community: community.into(),
            time: self.start + time,
            sequence: self.messages + 1,
            received: self.start + time,
            order: self.messages,
            epoch: 0,
            value: self.value(key, value),
        };
        self.messages += 1;
        Some(record)
    }

    fn value(&mut self, key: &str, text: &str) -> Value {
        if let Some(binary) = self.binary(text) {
            return binary;
        }
        let marked = if self.marked { text.split_at_checked(2) } else { None };
        match (marked, marked.map(|(_, text)| Word::of(text))) {
            (Some(("S:", text)), _) => Value::Text(text.into()),
            (Some(("D:", _)), Some(Word::Number(number) | Word::NotFinite(number))) => Value::Double(number),
            (Some(("D:", text)), _) => Value::Text(text.into()),
            _ => self.types.value(key, text),
        }
    }

    /// A binary value, from the file beside this one; what cannot be read there stays the text that stands for it.
    fn binary(&mut self, text: &str) -> Option<Value> {
        let said = text.trim_start_matches("B:").strip_prefix(BINARY.0)?.strip_suffix(BINARY.1)?;
        let field = |name: &str| said.split(',').find_map(|field| field.strip_prefix(name)?.strip_prefix('='));
        let (offset, length): (u64, u64) = (field("Offset")?.parse().ok()?, field("Bytes")?.parse().ok()?);
        // The name is only a name: no log leads to another folder.
        let file = self.path.with_file_name(Path::new(field("File")?).file_name()?);
        let blog = match self.blog.take() {
            Some(blog) => blog,
            None => file::open(&file).ok()?,
        };
        let blog = self.blog.insert(blog);
        if length > MAX_VALUE_BYTES as u64 || offset.checked_add(length)? > blog.metadata().ok()?.len() {
            return None;
        }
        let mut bytes = Vec::new();
        blog.seek(SeekFrom::Start(offset)).ok()?;
        blog.take(length).read_to_end(&mut bytes).ok().filter(|read| *read as u64 == length)?;
        let layout = field("Layout").and_then(|layout| u64::from_str_radix(layout, 16).ok()).unwrap_or_default();
        Some(Value::Binary { type_: Type::undescribed(field("Type").unwrap_or(MOOS_BINARY), layout), bytes })
    }
}

impl Iterator for AlogReader {
    type Item = Result<Record, LogError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.ahead.as_ref()?;
        match self.next_message() {
            Ok(next) => std::mem::replace(&mut self.ahead, next).map(Ok),
            Err(error) => {
                self.ahead = None;
                Some(Err(error))
            }
        }
    }
}

/// The first word of `text`, and what follows it.
fn word(text: &str) -> Option<(&str, &str)> {
    let text = text.trim_start();
    let end = text.find(char::is_whitespace).unwrap_or(text.len());
    (end > 0).then(|| text.split_at(end))
}

/// A number as C writes it. Words that happen to be numbers elsewhere (`nan`, `infinity`, `+1`, `007`) are words.
fn number(text: &str) -> Option<f64> {
    let text = text.trim();
    let digits = text.strip_prefix('-').unwrap_or(text);
    let is_padded = digits.strip_prefix('0').is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit()));
    let is_one = digits.starts_with(|c: char| c.is_ascii_digit() || c == '.') && !is_padded;
    is_one.then(|| text.parse().ok())?
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_written_as_c_does() {
        assert_eq!(date(1_212_370_719.0), "Mon Jun  2 01:38:39 2008");
        assert_eq!(date(951_782_400.0), "Tue Feb 29 00:00:00 2000");
        assert_eq!(date(0.0), "Thu Jan  1 00:00:00 1970");
        assert_eq!(date(1_735_689_599.0), "Tue Dec 31 23:59:59 2024");
    }

    #[test]
    fn words_are_no_numbers() {
        assert_eq!(["1.5", "-2", ".5", "1e3"].map(number), [Some(1.5), Some(-2.0), Some(0.5), Some(1000.0)]);
        assert_eq!(["nan", "inf", "-", "1.5m", "", "007", "-01", "+49"].map(number), [None; 8]);
        assert_eq!(["0", "0.5", "-0.0", "1.25e-07"].map(number), [Some(0.0), Some(0.5), Some(-0.0), Some(1.25e-7)]);
    }

    #[test]
    fn a_number_has_the_digits_that_bring_it_back() {
        for number in [1.5, 0.0, -0.0, 42.358_456_123, 1.25e-7, 1e300, 5e-324, f64::MAX, 1.0 / 3.0, -7.0] {
            let back: f64 = digits(number).parse().unwrap();
            assert_eq!(back.to_bits(), number.to_bits(), "{}", digits(number));
        }
        assert_eq!([1.5, f64::NAN, f64::INFINITY, f64::NEG_INFINITY].map(digits), ["1.50000", "nan", "inf", "-inf"]);
    }
}
