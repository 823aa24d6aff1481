//! Logs for others: MOOS' text logs, and numbers for spreadsheets.

use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result};
use elk_log::alog::AlogWriter;
use elk_log::csv::{self, put_csv};
use elk_log::selection::Window;
use elk_log::{LogReader, Selection};

use super::arguments::Format;
use super::reading::{for_each_record, window};
use crate::target::Target;
use crate::terminal::complain;

/// `elk log export`
pub fn export(log: &Path, to: Format, output: Option<PathBuf>, selection: &Selection) -> Result<ExitCode> {
    let output = output.unwrap_or_else(|| beside(log, to));
    if output == Path::new("-") {
        return export_piped(log, to, selection);
    }
    let target = Target::new(&output, "")?.gone_at_a_signal()?;
    match to {
        Format::Alog => {
            let window = window(log, selection)?;
            export_alog(log, AlogWriter::create(target.draft(), started(log, window)?)?, window)?;
        }
        Format::Csv => {
            let named = || format!("cannot write {}", output.display());
            export_csv(log, std::fs::File::create_new(target.draft()).with_context(named)?, named, selection)?;
        }
    }
    let said = format!("{}\n", target.shown());
    target.conclude(&said)?;
    Ok(ExitCode::SUCCESS)
}

/// Exports to standard output, message by message as they are read.
fn export_piped(log: &Path, to: Format, selection: &Selection) -> Result<ExitCode> {
    let (name, out) = ("standard output", std::io::stdout());
    match to {
        Format::Alog => {
            let window = window(log, selection)?;
            let alog = AlogWriter::piped(Path::new(name), out, started(log, window)?)?;
            if export_alog(log, alog, window)?.is_some() {
                complain(&format!(
                    "the binary values are left out: {name} has no room for a second file; right is -o FILE"
                ));
            }
        }
        Format::Csv => export_csv(log, out, || format!("cannot write {name}"), selection)?,
    }
    Ok(ExitCode::SUCCESS)
}

/// The exported file of a log: in its folder, or beside it.
fn beside(log: &Path, to: Format) -> PathBuf {
    let extension = if to == Format::Alog { "alog" } else { "csv" };
    if log.is_dir() { log.join("log").with_extension(extension) } else { log.with_extension(extension) }
}

/// When the run of a log began (s since 1970): MOOS counts from there. A log that does not say so begins with its
/// earliest message.
fn started(log: &Path, window: Window<'_>) -> Result<f64> {
    let mut reader = LogReader::open(log)?;
    let started = reader.metadata().started;
    if started > 0.0 {
        return Ok(started);
    }
    // Published before it was recorded; what cannot be read is said when all is read.
    let first = reader.find_map(Result::ok).map_or(f64::INFINITY, |record| record.time);
    Ok(window.origin.min(first))
}

fn export_alog(log: &Path, mut alog: AlogWriter, window: Window<'_>) -> Result<Option<PathBuf>> {
    for_each_record(log, window, |_, record| Ok(alog.append(record)?))?;
    Ok(alog.finish()?)
}

fn export_csv(log: &Path, out: impl Write, named: impl Fn() -> String + Copy, selection: &Selection) -> Result<()> {
    let mut out = BufWriter::new(out);
    out.write_all(csv::HEADER.as_bytes()).with_context(named)?;
    for_each_record(log, window(log, selection)?, |secs, record| put_csv(&mut out, secs, record).with_context(named))?;
    out.flush().with_context(named)
}
