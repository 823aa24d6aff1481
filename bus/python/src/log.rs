//! Recorded runs.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use elk_bus::ValueRef;
use elk_log::{Index, RecordRef, csv};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::bytes::{Bytes, Element, View};
use crate::error::error;
use crate::message::Message;

/// Columns of a table at most: what a log's texts may come to.
const MOST_COLUMNS: usize = 4096;

/// Numbers in a table at most, those that are missing in a row too: a gigabyte of them.
const MOST_CELLS: usize = 1 << 27;

/// A log that is read from its beginning to its end: an iterator over its messages.
#[pyclass(frozen, module = "elk")]
pub struct LogReader {
    path: PathBuf,
    reader: Mutex<elk_log::LogReader>,
}

impl LogReader {
    fn lock(&self) -> MutexGuard<'_, elk_log::LogReader> {
        self.reader.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[pymethods]
impl LogReader {
    /// Opens the log at `path`, a file or a run's folder, as the system has it (`os.fsencode`).
    #[new]
    fn new(path: &[u8]) -> PyResult<Self> {
        let path = PathBuf::from(OsStr::from_bytes(path));
        let reader = Mutex::new(elk_log::LogReader::open(&path).map_err(error)?);
        Ok(Self { path, reader })
    }

    fn __iter__(this: PyRef<'_, Self>) -> PyRef<'_, Self> {
        this
    }

    fn __next__(&self, py: Python<'_>) -> PyResult<Option<Message>> {
        py.detach(|| {
            let mut reader = self.lock();
            let next = reader.next_ref().map(|next| next.map(|record| Message::of_record(&record)));
            next.transpose()
        })
        .map_err(error)
    }

    /// Where the run came from: mission, version, seed, world, when it was started (s since 1970).
    fn metadata<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let said = self.lock().metadata().clone();
        let all = PyDict::new(py);
        all.set_item("mission_name", said.mission_name)?;
        all.set_item("mission", said.mission)?;
        all.set_item("effective_mission", said.effective_mission)?;
        all.set_item("version", said.version)?;
        all.set_item("seed", said.seed)?;
        all.set_item("world", said.world)?;
        all.set_item("run", said.run)?;
        all.set_item("started", said.started)?;
        Ok(all)
    }

    /// What was found to be damaged so far, in words.
    fn damage(&self) -> Vec<String> {
        self.lock().damage()
    }

    /// Messages that the logger missed, as far as the log has been read.
    fn dropped(&self) -> u64 {
        self.lock().dropped()
    }

    /// How many messages there are of each variable.
    fn variables(&self, py: Python<'_>) -> PyResult<BTreeMap<String, u64>> {
        let index = py.detach(|| Index::read(&self.path, &mut |_, _| {})).map_err(error)?;
        let mut counts = BTreeMap::new();
        for topic in index.topics() {
            *counts.entry(topic.name).or_default() += topic.count;
        }
        Ok(counts)
    }

    /// The numbers of a variable's messages, in their order: arrays of one length by name. `time` is when each was published
    /// (s, the community's clock); a number is `value`, and of a typed value every number in it has a column (`pose.x`). A
    /// column is NaN where a message has no such number; texts are in `text`.
    fn columns<'py>(&self, py: Python<'py>, variable: &str) -> PyResult<Bound<'py, PyDict>> {
        let table = py.detach(|| Table::read(&self.path, variable))?;
        let all = PyDict::new(py);
        let array = |numbers: Vec<f64>| {
            let bytes = Bytes::Own(numbers.iter().flat_map(|number| number.to_le_bytes()).collect());
            let element = Element::Number("<f8".to_owned());
            View { bytes: Arc::new(bytes), offset: 0, shape: vec![numbers.len()], element }.into_array(py)
        };
        all.set_item("time", array(table.times)?)?;
        for (name, numbers) in table.names.into_iter().zip(table.columns) {
            all.set_item(name, array(numbers)?)?;
        }
        if !table.texts.is_empty() {
            let numpy = py.import("numpy")?;
            all.set_item("text", numpy.call_method1("array", (table.texts, numpy.getattr("object_")?))?)?;
        }
        Ok(all)
    }
}

/// The numbers of a variable.
#[derive(Default)]
struct Table {
    times: Vec<f64>,
    names: Vec<String>,
    columns: Vec<Vec<f64>>,
    /// Of each message, if any is a text.
    texts: Vec<Option<String>>,
}

impl Table {
    fn read(path: &Path, variable: &str) -> PyResult<Self> {
        let mut reader = elk_log::LogReader::open(path).map_err(error)?;
        let (mut table, mut places) = (Self::default(), BTreeMap::new());
        while reader.advance().map_err(error)? {
            if reader.head().is_some_and(|(key, ..)| key == variable)
                && let Some(record) = reader.record()
            {
                table.put(&record.map_err(error)?, &mut places)?;
            }
        }
        if table.times.is_empty() {
            return Err(error(format_args!(
                "no message of {variable} is in {}; variables() says which are",
                path.display()
            )));
        }
        let rows = table.times.len();
        table.columns.iter_mut().for_each(|column| column.resize(rows, f64::NAN));
        if !table.texts.is_empty() {
            table.texts.resize(rows, None);
        }
        Ok(table)
    }

    fn put(&mut self, record: &RecordRef<'_>, places: &mut BTreeMap<String, usize>) -> PyResult<()> {
        let row = self.times.len();
        if (row + 1).saturating_mul(self.columns.len() + 1) > MOST_CELLS {
            let (columns, key) = (self.columns.len(), record.key);
            return Err(error(format_args!(
                "{key}: {columns} columns of more than {row} rows are more than {MOST_CELLS} numbers; right is to iterate over the log"
            )));
        }
        self.times.push(record.time);
        if let ValueRef::Text(text) = record.value {
            self.texts.resize(row, None);
            self.texts.push(Some(text.to_owned()));
        }
        let put = csv::put_numbers(record, &mut |name, number| {
            let place = match places.get(name) {
                Some(place) => *place,
                None if self.columns.len() == MOST_COLUMNS => {
                    return Err(std::io::Error::other(format!("it has more than {MOST_COLUMNS} numbers in it")));
                }
                None => {
                    let own = name.strip_prefix(record.key).unwrap_or(name).trim_start_matches('.');
                    // These are of the message itself.
                    let own = if ["time", "text"].contains(&own) { name } else { own };
                    self.names.push(if own.is_empty() { "value".to_owned() } else { own.to_owned() });
                    self.columns.push(Vec::new());
                    places.insert(name.to_owned(), self.columns.len() - 1);
                    self.columns.len() - 1
                }
            };
            let column = &mut self.columns[place];
            column.resize(row, f64::NAN);
            column.push(number.parse().unwrap_or(f64::NAN));
            Ok(())
        });
        put.map_err(|wrong| error(format_args!("{}: {wrong}", record.key)))
    }
}
