//! What the fuzz targets and the tests of damaged files drive: every reader, over any bytes, with everything that is
//! read of them used. Hidden from the documentation; no program calls it.

use std::path::Path;

use crate::alog::AlogReader;
use crate::check::check;
use crate::index::Index;
use crate::reader::LogReader;

/// Reads the file at `path` as a log in every way there is: records, index, jumps, check. Answers how many records
/// there were.
pub fn read_log(path: &Path) -> u64 {
    let Ok(mut log) = LogReader::open(path) else {
        return 0;
    };
    let mut records = 0;
    while let Some(next) = log.next_ref() {
        records += u64::from(next.is_ok());
    }
    if let Ok(index) = Index::read(path, &mut |_, _| {}) {
        let _ = (index.topics(), index.messages(), index.span(), index.whole());
        let (start, end) = index.span().unwrap_or_default();
        for time in [start, (start + end) / 2.0, end, f64::NAN] {
            if log.seek(&index, time).is_ok() {
                let _ = log.next_ref();
            }
        }
    }
    let _ = check(path, &mut |_, _| {});
    records
}

/// Reads the file at `path` as an `.alog`. Answers how many messages there were.
pub fn read_alog(path: &Path) -> u64 {
    AlogReader::open(path).map_or(0, |log| log.filter(Result::is_ok).count() as u64)
}
