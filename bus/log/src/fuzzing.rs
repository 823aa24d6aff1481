//! What the fuzz targets and the tests of damaged files drive: every reader, over any bytes, with everything that is
//! read of them used. Hidden from the documentation; no program calls it.

use std::path::Path;

use crate::alog::AlogReader;
use crate::check::check;
use crate::copy::recover;
use crate::index::Index;
use crate::reader::LogReader;
use crate::writer::LogOptions;

/// Reads the file at `path` as a log in every way there is: records, index, jumps, check, and as a damaged one; what
/// recover makes of it beside it is a whole log. Answers how many records there were.
pub fn read_log(path: &Path) -> u64 {
    recover_log(path);
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

/// Recovers the file at `path`, whatever it is, and checks what comes of it.
fn recover_log(path: &Path) {
    let mended = path.with_extension("mended.mcap");
    let _ = std::fs::remove_file(&mended);
    let copied = recover(path, &mended, LogOptions::default(), &mut |_, _| {});
    if let Ok(copied) = copied {
        let checked = check(&mended, &mut |_, _| {}).expect("what recover has written can be read");
        assert!(checked.damage.is_empty(), "what recover has written is whole: {:?}", checked.damage);
        assert_eq!(checked.messages, copied.records, "and holds all that it gave back");
    }
    let _ = std::fs::remove_file(&mended);
}

/// Reads the file at `path` as an `.alog`. Answers how many messages there were.
pub fn read_alog(path: &Path) -> u64 {
    AlogReader::open(path).map_or(0, |log| log.filter(Result::is_ok).count() as u64)
}
