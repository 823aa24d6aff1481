//! `elk log`: what is in logs, and what can be made of them.

mod arguments;
mod export;
mod info;
mod reading;

use std::fmt::Write as _;
use std::io::{BufWriter, ErrorKind, Write};
use std::path::Path;
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use elk_bus::clock::Clock;
use elk_bus::{App, Client, RunError, ValueRef, run_app_on, stop_on_signals};
use elk_log::check::check;
use elk_log::copy::{self, Copied, copy};
use elk_log::csv::LONGEST_LIST;
use elk_log::diff::{Diff, DiffOptions, Difference, diff};
use elk_log::{Metadata, Record, RecordRef, Selection};
use elk_logger::{Logger, Recorder};
use elk_outside::text;
use serde_json::{Value as Json, json};

use crate::arguments::CommunityArgs;
use crate::prune;
use crate::target::Target;
use crate::terminal::{progress, say};

use arguments::OutputArgs;
pub use arguments::{LogCommand, SelectionArgs};
use export::export;
use info::info;
use reading::{HOW_TO_MEND, for_each_record, is_something, warn_of, window};

/// `elk log …`
pub fn run(command: LogCommand) -> Result<ExitCode> {
    let done = match command {
        LogCommand::Info { log, json } => info(&log, json),
        LogCommand::Check { log } => check_log(&log),
        LogCommand::Recover { log, output } => recover(&log, &output),
        LogCommand::Cat { log, selection, json } => cat(&log, &selection.into(), json),
        LogCommand::Cut { log, selection, output } => cut(&log, &selection.into(), &output),
        LogCommand::Diff { first, second, selection, exact } => {
            compare(&first, &second, &DiffOptions { selection: selection.into(), exact })
        }
        LogCommand::Export { log, to, output, patterns } => export(&log, to, output, &patterns.into()),
        LogCommand::Prune(arguments) => prune::run(&arguments),
        LogCommand::Record { patterns, community, output } => record(patterns, &community, &output),
    };
    match done {
        Err(error) if is_broken_pipe(&error) => Ok(ExitCode::SUCCESS), // the reader has seen enough
        done => done,
    }
}

fn is_broken_pipe(error: &anyhow::Error) -> bool {
    let of_system = |error: &std::io::Error| error.kind() == ErrorKind::BrokenPipe;
    error.chain().any(|cause| cause.downcast_ref().is_some_and(of_system))
}

/// `elk log check`
fn check_log(log: &Path) -> Result<ExitCode> {
    let checked = check(log, &mut progress("checking"))?;
    let mut said = format!("{}: {} messages", log.display(), checked.messages);
    if checked.dropped > 0 {
        let _ = write!(said, ", {} more that the logger missed", checked.dropped);
    }
    said += if checked.damage.is_empty() { ", whole\n" } else { ", NOT whole:\n" };
    checked.damage.iter().for_each(|reason| said += &format!("  {reason}\n"));
    if !checked.damage.is_empty() {
        said += HOW_TO_MEND;
    }
    say(&said)?;
    Ok(if checked.damage.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// `elk log recover`
fn recover(log: &Path, output: &OutputArgs) -> Result<ExitCode> {
    let target = output.target()?.gone_at_a_signal()?;
    let copied = copy::recover(log, target.draft(), output.options(), &mut progress("recovering"))?;
    for reason in &copied.damage {
        target.say(&format!("  {reason}\n"))?;
    }
    if copied.records == 0 && !copied.damage.is_empty() {
        bail!("no message is left in {}: is it a log?", log.display());
    }
    say_copied(&copied, target)?;
    Ok(ExitCode::SUCCESS)
}

/// `elk log cut`
fn cut(log: &Path, selection: &Selection, output: &OutputArgs) -> Result<ExitCode> {
    let target = output.target()?.gone_at_a_signal()?;
    let copied = copy(log, target.draft(), selection, output.options(), &mut progress("cutting"))?;
    warn_of(&copied.damage);
    is_something(copied.records, log, selection)?;
    say_copied(&copied, target)?;
    Ok(ExitCode::SUCCESS)
}

/// Puts a copy into its place, and says what it came to.
fn say_copied(copied: &Copied, target: Target) -> Result<()> {
    let Copied { records, doubtful, unreadable, left_out, .. } = copied;
    let mut said = format!("{records} messages in {}\n", target.shown());
    if *doubtful > 0 {
        said += &format!("{doubtful} of them lie in damaged chunks; some may not be what was recorded\n");
    }
    if *unreadable > 0 {
        said += &format!("{unreadable} messages could not be read\n");
    }
    left_out.iter().for_each(|what| said += &format!("left out: {what}\n"));
    target.conclude(&said)
}

/// `elk log cat`
fn cat(log: &Path, selection: &Selection, as_json: bool) -> Result<ExitCode> {
    let mut out = BufWriter::new(std::io::stdout().lock());
    for_each_record(log, window(log, selection)?, |secs, record| {
        let line = match as_json {
            true => text::printable_json(&record_json(record).to_string()).into_owned(),
            false => {
                let value = shown(record.value, LONGEST_LIST).to_string();
                let (key, source) = (text::name(record.key), text::name(record.source));
                format!("{secs:<11.6} {key:<24} {source:<16} {}", text::printable_json(&value))
            }
        };
        Ok(writeln!(out, "{line}")?)
    })?;
    out.flush()?;
    Ok(ExitCode::SUCCESS)
}

fn record_json(record: &RecordRef<'_>) -> Json {
    json!({
        "time": record.time, "received": record.received, "order": record.order, "key": record.key,
        "source": record.source, "source_aux": record.source_aux, "community": record.community,
        "sequence": record.sequence, "epoch": record.epoch, "type": type_name(record.value),
        "value": shown(record.value, usize::MAX),
    })
}

fn type_name(value: ValueRef<'_>) -> &str {
    match value {
        ValueRef::Double(_) => "number",
        ValueRef::Text(_) => "text",
        ValueRef::Binary { type_, .. } => type_.name(),
    }
}

/// A value for people: of a type that is not known, how large it is and why it is not shown.
fn shown(value: ValueRef<'_>, longest: usize) -> Json {
    value.to_json(longest).unwrap_or_else(|error| match value {
        // Another tool's, whose types have no layouts.
        ValueRef::Binary { type_, bytes } if type_.layout() == 0 => {
            format!("{} bytes of {} that elk cannot read", bytes.len(), type_.name()).into()
        }
        ValueRef::Binary { type_, bytes } => format!("{} bytes of {}: {error}", bytes.len(), type_.name()).into(),
        ValueRef::Double(_) | ValueRef::Text(_) => error.to_string().into(),
    })
}

/// `elk log diff`
fn compare(first: &Path, second: &Path, options: &DiffOptions) -> Result<ExitCode> {
    let Diff { same, differences, damage } = diff(first, second, options)?;
    warn_of(&damage);
    let Some((earliest, others)) = differences.split_first() else {
        say(&format!("the same: {same} messages\n"))?;
        if same == 0 {
            bail!("neither log has any such message: there was nothing to compare");
        }
        return Ok(ExitCode::SUCCESS);
    };
    let mut said = format!("different, after {same} messages that are the same\n");
    let Difference { key, source, number, first: one, second: other, divergence } = earliest;
    let (key, source) = (text::name(key), text::name(source));
    let _ = writeln!(said, "first: {key} by {source}, its message {number}, at {:.6} s", earliest.time());
    if let Some(divergence) = divergence {
        let at = if divergence.path.is_empty() { "value" } else { &divergence.path };
        let _ = writeln!(said, "  {at}: {} became {}", brief(&divergence.first), brief(&divergence.second));
    }
    let _ = writeln!(said, "  {}: {}", first.display(), side(one.as_ref()));
    let _ = writeln!(said, "  {}: {}", second.display(), side(other.as_ref()));
    for Difference { key, source, number, .. } in others {
        let (key, source) = (text::name(key), text::name(source));
        let _ = writeln!(said, "later: {key} by {source}, its message {number}");
    }
    say(&said)?;
    Ok(ExitCode::FAILURE)
}

fn side(record: Option<&Record>) -> String {
    record.map_or("no such message".into(), |record| {
        format!("at {:.6} s: {}", record.time, shown(record.value.as_ref(), LONGEST_LIST))
    })
}

/// A value in few words.
fn brief(value: &Json) -> String {
    let text = value.to_string();
    match text.char_indices().nth(160) {
        None => text,
        Some((end, _)) => format!("{}…", &text[..end]),
    }
}

/// `elk log record`
fn record(patterns: Vec<String>, community: &CommunityArgs, output: &OutputArgs) -> Result<ExitCode> {
    let piped = if output.output == Path::new("-") { Some(output.target()?) } else { None };
    let file = piped.as_ref().map_or(&*output.output, Target::draft).to_owned();
    if file.exists() {
        bail!("{} is there already; say another file", file.display());
    }
    let metadata =
        Metadata { version: env!("CARGO_PKG_VERSION").into(), started: Clock::new(1.0).now(), ..Metadata::default() };
    let recorder = Recorder::new(file, metadata).with_options(output.options());
    let stop = stop_on_signals().context("signals cannot be caught")?;
    let mut client = Client::connect(&community.community, &format!("record-{}", std::process::id()))?;
    let mut logger = Logger::of(recorder, patterns).on_the_bus();
    match run_app_on(&mut logger, &mut client, &stop) {
        // The community's end is the recording's, too.
        Err(RunError::Comms(_)) => logger.on_stop(&mut client.comms).map_err(|error| anyhow::anyhow!("{error}"))?,
        ended => ended?,
    }
    let messages = logger.state.messages();
    match piped {
        Some(target) => target.conclude(&format!("{messages} messages in standard output\n"))?,
        None => say(&format!("{messages} messages in {}\n", output.output.display()))?,
    }
    Ok(ExitCode::SUCCESS)
}
