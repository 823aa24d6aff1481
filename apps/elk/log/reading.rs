//! The messages of a part of a log, for whatever is made of them, and what is said of a log that is not whole.

use std::path::Path;

use anyhow::{Result, bail};
use elk_log::selection::{Position, Window};
use elk_log::{Index, LogReader, RecordRef, Selection};

use crate::terminal::{complain, progress};

/// So many messages that cannot be read are each complained of; the others are counted.
const MOST_COMPLAINTS: u64 = 20;

/// What is said of a log that is not whole.
pub const HOW_TO_MEND: &str = "  elk log recover makes a whole one of all that can be had of it\n";

/// Says of a log what is wrong with it.
pub fn warn_of(damage: &[String]) {
    for reason in damage {
        complain(&format!("the log is not whole: {reason}"));
    }
}

/// A part of a log, and when the earliest message of that log was recorded.
pub fn window<'a>(log: &Path, selection: &'a Selection) -> Result<Window<'a>> {
    let index = Index::read(log, &mut progress("reading a log without an index:"))?;
    Ok(Window { origin: index.span().map_or(0.0, |(start, _)| start), selection })
}

/// Hands the records of a part of a log to `each`, with their seconds after the log's earliest message.
pub fn for_each_record(
    log: &Path,
    window: Window<'_>,
    mut each: impl FnMut(f64, &RecordRef<'_>) -> Result<()>,
) -> Result<()> {
    let Window { selection, .. } = window;
    let mut reader = LogReader::open(log)?;
    reader.within(&window);
    let (mut found, mut unreadable) = (0_u64, 0_u64);
    while let Some(next) = reader.next_ref() {
        let record = match next {
            Ok(record) => record,
            Err(error) => {
                unreadable += 1;
                if unreadable <= MOST_COMPLAINTS {
                    complain(&error.to_string());
                }
                continue;
            }
        };
        if window.position(record.received) == Position::Within && selection.takes(record.key, record.source) {
            found += 1;
            each(record.time - window.origin, &record)?;
        }
    }
    if unreadable > MOST_COMPLAINTS {
        complain(&format!("and {} messages more cannot be read", unreadable - MOST_COMPLAINTS));
    }
    warn_of(&reader.damage());
    is_something(found, log, selection)
}

/// Sees that a part of a log that somebody wants is not nothing: a slip in a name is an answer to nobody.
pub fn is_something(found: u64, log: &Path, selection: &Selection) -> Result<()> {
    match found > 0 || *selection == Selection::default() {
        true => Ok(()),
        false => {
            let log = log.display();
            bail!(
                "no message of {log} is what the options say (`elk log info {log}` lists what it has, and its length)"
            )
        }
    }
}
