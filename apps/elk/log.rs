//! `elk log`: what is in logs, and what can be made of them.

use std::fmt::Write as _;
use std::io::{BufWriter, ErrorKind, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use clap::{Args, Subcommand, ValueEnum};
use elk_bus::clock::Clock;
use elk_bus::{App, Client, RunError, ValueRef, run_app_on, stop_on_signals, tell};
use elk_log::alog::AlogWriter;
use elk_log::check::check;
use elk_log::copy::{self, Copied, copy};
use elk_log::csv::{self, LONGEST_JSON, LONGEST_LIST, put_csv};
use elk_log::diff::{Diff, DiffOptions, Difference, diff};
use elk_log::index::{Extra, ExtraKind};
use elk_log::selection::{Place, Window};
use elk_log::{Compression, Index, LogOptions, LogReader, Metadata, Record, RecordRef, Selection};
use elk_logger::{Logger, Recorder};
use elk_outside::{text, time};
use serde_json::{Value as Json, json};

use crate::cli::CommunityArgs;
use crate::complain;
use crate::prune::{self, PruneArgs};
use crate::target::{Target, not_to_a_terminal};

/// So many messages that cannot be read are each complained of; the others are counted.
const MOST_COMPLAINTS: u64 = 20;

/// What is said of a log that is not whole.
const HOW_TO_MEND: &str = "  elk log recover makes a whole one of all that can be had of it\n";

/// What can be done with logs.
#[derive(Debug, Subcommand)]
pub enum LogCommand {
    /// Say what is in a log
    #[command(after_help = "Example: elk log info logs/apartment-20261123-224512 --json")]
    Info {
        /// The log: a run's folder, or a file
        log: PathBuf,
        /// As JSON
        #[arg(long)]
        json: bool,
    },
    /// Read a log from end to end and say whether it is whole
    #[command(after_help = "Example: elk log check logs/apartment-20261123-224512")]
    Check {
        /// The log: a run's folder, or a file
        log: PathBuf,
    },
    /// Mend a log that was cut short or damaged: all that can be had, also behind and inside of what is damaged, in a new one
    #[command(after_help = "Example: elk log recover logs/apartment-20261123-224512/log.mcap -o mended.mcap")]
    Recover {
        /// The log: a run's folder, or a file
        log: PathBuf,
        /// How the new log is written
        #[command(flatten)]
        output: OutputArgs,
    },
    /// Print the messages of a log
    #[command(after_help = "Example: elk log cat logs/apartment-20261123-224512 --keys PROGRESS --from 1 --to 3")]
    Cat {
        /// The log: a run's folder, or a file
        log: PathBuf,
        /// Which of them
        #[command(flatten)]
        selection: SelectionArgs,
        /// One JSON object a line, values in full
        #[arg(long)]
        json: bool,
    },
    /// Make a shorter log of a part of one
    #[command(after_help = "Example: elk log cut logs/apartment-20261123-224512 --keys 'SCAN*' --to 10 -o scans.mcap")]
    Cut {
        /// The log: a run's folder, or a file
        log: PathBuf,
        /// Which part
        #[command(flatten)]
        selection: SelectionArgs,
        /// How the new log is written
        #[command(flatten)]
        output: OutputArgs,
    },
    /// Compare two logs message by message; ends with 1 if they differ
    #[command(after_help = "Example: elk log diff logs/apartment-1 logs/apartment-2 --keys MAP_UPDATE --keys PLAN\n\n\
        Messages are compared by variable and source, in order. Times are not compared, nor fields named cpu_secs \
        (measured anew in each run), nor the variables DB_* and *_STATUS, which tell of processes; --exact compares all \
        of these but the times.")]
    Diff {
        /// A log: a run's folder, or a file
        first: PathBuf,
        /// Another
        second: PathBuf,
        /// Which messages
        #[command(flatten)]
        selection: SelectionArgs,
        /// Compare measured times and the broker's own tables, too
        #[arg(long)]
        exact: bool,
    },
    /// Hand a log on: to MOOS' tools as .alog (with .blog), to spreadsheets as CSV
    #[command(after_help = "Example: elk log export logs/apartment-20261123-224512 --to alog -o apartment.alog\n\n\
        A message has the time at which its source has written it, in both. An .alog counts from the run's start, which \
        is its LOGSTART; CSV from the log's earliest message, as elk log cat does.")]
    Export {
        /// The log: a run's folder, or a file
        log: PathBuf,
        /// The format
        #[arg(long)]
        to: Format,
        /// The file to write; the log's name with another ending if not said; `-`: standard output
        #[arg(short, long, value_name = "FILE")]
        output: Option<PathBuf>,
        /// Which messages
        #[command(flatten)]
        patterns: PatternArgs,
    },
    /// Name old runs, or delete them with their logs
    #[command(after_help = "Example: elk log prune --keep 10 --older-than 7 --delete")]
    Prune(PruneArgs),
    /// Record a part of a running community until Ctrl-C
    #[command(after_help = "Example: elk log record 'SCAN*' MAP_UPDATE -o recorded.mcap")]
    Record {
        /// Patterns of the variables to record
        #[arg(default_value = "*")]
        patterns: Vec<String>,
        /// Which community
        #[command(flatten)]
        community: CommunityArgs,
        /// The log to write
        #[command(flatten)]
        output: OutputArgs,
    },
}

/// A part of a log.
#[derive(Debug, Args)]
pub struct SelectionArgs {
    /// By variable and source.
    #[command(flatten)]
    patterns: PatternArgs,
    /// Begin so many seconds after the earliest message
    #[arg(long, value_name = "S", value_parser = time::parse_seconds)]
    from: Option<f64>,
    /// End so many seconds after the earliest message
    #[arg(long, value_name = "S", value_parser = time::parse_seconds)]
    to: Option<f64>,
}

/// Some variables, some sources.
#[derive(Debug, Args)]
pub struct PatternArgs {
    /// Only variables that match (`*`: any characters, `?`: one); may be repeated
    #[arg(long, value_name = "PATTERN")]
    keys: Vec<String>,
    /// Only sources that match; may be repeated
    #[arg(long, value_name = "PATTERN")]
    source: Vec<String>,
    /// No variables that match; may be repeated
    #[arg(long, value_name = "PATTERN")]
    exclude: Vec<String>,
}

impl From<SelectionArgs> for Selection {
    fn from(said: SelectionArgs) -> Self {
        Selection { from_secs: said.from, to_secs: said.to, ..said.patterns.into() }
    }
}

impl From<PatternArgs> for Selection {
    fn from(said: PatternArgs) -> Self {
        let PatternArgs { keys, source, exclude } = said;
        Selection { keys, sources: source, exclude, ..Selection::default() }
    }
}

/// A log to write.
#[derive(Debug, Args)]
pub struct OutputArgs {
    /// The log to write; must not be there; `-`: standard output
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// How it is compressed
    #[arg(long, default_value = "zstd")]
    compression: Packing,
}

impl OutputArgs {
    fn target(&self) -> Result<Target> {
        not_to_a_terminal(&self.output)?;
        Target::new(&self.output, "log.mcap")
    }

    fn options(&self) -> LogOptions {
        let compression = match self.compression {
            Packing::None => Compression::None,
            Packing::Lz4 => Compression::Lz4,
            Packing::Zstd => Compression::Zstd,
        };
        LogOptions { compression, ..LogOptions::default() }
    }
}

/// How a log is compressed.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum Packing {
    /// Not at all
    None,
    /// A little, for little work
    Lz4,
    /// More, for more work
    Zstd,
}

/// What a log is exported to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// MOOS' text log
    Alog,
    /// Numbers: time, variable, source, value
    Csv,
}

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

/// Writes lines to standard output. Names and values of a log are anybody's: the terminal only shows them.
fn say(lines: &str) -> Result<()> {
    Ok(std::io::stdout().write_all(text::printable_lines(lines).as_bytes())?)
}

/// Says on a terminal how far reading has come, and leaves no trace of it; is silent in a pipe.
pub fn progress(what: &'static str) -> impl FnMut(u64, u64) {
    let terminal = std::io::stderr().is_terminal();
    let mut shown = Shown(None);
    move |done, all| {
        let percent = (100 * done).checked_div(all).unwrap_or(100);
        if terminal && shown.0 != Some(percent) {
            shown.0 = Some(percent);
            draw(&format!("\r{what} {percent} %\r"));
        }
    }
}

/// The percentage that stands on the terminal.
struct Shown(Option<u64>);

impl Drop for Shown {
    fn drop(&mut self) {
        if self.0.is_some() {
            draw("\x1b[K");
        }
    }
}

/// Draws on standard error. A terminal that is gone shows nothing; nobody ends over it, as with [`eprint!`].
pub fn draw(text: &str) {
    let _ = std::io::stderr().write_all(text.as_bytes());
}

/// `elk log info`
fn info(log: &Path, as_json: bool) -> Result<ExitCode> {
    let index = Index::read(log, &mut progress("reading a log without an index:"))?;
    say(&if as_json { info_json(&index)? } else { info_text(&index) })?;
    Ok(ExitCode::SUCCESS)
}

fn info_json(index: &Index) -> Result<String> {
    let topic = |topic: &elk_log::Topic| {
        json!({
            "name": topic.name, "source": topic.source, "type": topic.type_name, "schema": topic.schema,
            "count": topic.count,
        })
    };
    let Metadata { mission_name, version, seed, started, world, world_checksum, effective_mission, run, .. } =
        &index.metadata;
    let span = index.span();
    // A tree of it takes many times its length.
    let said = match run.len() > LONGEST_JSON {
        true => Json::from(run.as_str()),
        false => serde_json::from_str(run).unwrap_or_default(),
    };
    let (extras, unnamed) = index.extras();
    let of_kind = |kind| extras.iter().filter(move |extra| extra.kind == kind).map(extra_json).collect::<Vec<_>>();
    let info = json!({
        "files": index.files().collect::<Vec<_>>(),
        "bytes": index.bytes(),
        "messages": index.messages(),
        "topics": index.topics().iter().map(topic).collect::<Vec<_>>(),
        "attachments": of_kind(ExtraKind::Attachment),
        "metadata": of_kind(ExtraKind::Metadata),
        "attachments_and_metadata_not_listed": unnamed,
        "start": span.map(|(start, _)| start),
        "end": span.map(|(_, end)| end),
        "whole": index.whole(),
        "damage": index.damage(),
        "dropped": index.dropped(),
        "mission": mission_name,
        "seed": seed,
        "version": version,
        "started": started,
        "world": world,
        "world_checksum": world_checksum,
        "effective_mission": effective_mission,
        "run": said,
    });
    Ok(text::printable_json(&serde_json::to_string_pretty(&info)?).into_owned() + "\n")
}

fn extra_json(extra: &Extra) -> Json {
    let Extra { kind, name, media_type, count, bytes } = extra;
    match kind {
        ExtraKind::Attachment => json!({ "name": name, "media_type": media_type, "count": count, "bytes": bytes }),
        ExtraKind::Metadata => json!({ "name": name, "count": count, "bytes": bytes }),
    }
}

fn info_text(index: &Index) -> String {
    let mut said = String::new();
    let Metadata { mission_name, version, seed, world, world_checksum, .. } = &index.metadata;
    for file in index.files() {
        let _ = writeln!(said, "{}", file.display());
    }
    if !mission_name.is_empty() {
        // A world that is built in has no checksum, and a mission may have no world.
        let world = format!("world {world} {world_checksum}");
        let world = if world.trim_end() == "world" { "no world" } else { world.trim_end() };
        let _ = writeln!(said, "  mission {mission_name}, seed {seed}, {world}, elk {version}");
    }
    let secs = index.span().map_or(0.0, |(start, end)| end - start);
    let bytes = index.bytes() as f64 / 1e6;
    let _ = writeln!(said, "  {} messages in {secs:.3} s, {bytes:.1} MB", index.messages());
    match index.dropped() {
        0 => {}
        dropped => said += &format!("  {dropped} messages are missing: the logger did not keep up\n"),
    }
    match index.whole() {
        true => said += "  has its end (elk log check reads all of it)\n",
        false => {
            index.damage().iter().for_each(|reason| said += &format!("  NOT whole: {reason}\n"));
            said += HOW_TO_MEND;
        }
    }
    let _ = writeln!(said, "  {:<24} {:<16} {:<20} {:>10}", "variable", "source", "type", "messages");
    for topic in index.topics() {
        let elk_log::Topic { name, source, type_name, count, .. } = &topic;
        let (name, source, type_name) = (text::name(name), text::name(source), text::name(type_name));
        let _ = writeln!(said, "  {name:<24} {source:<16} {type_name:<20} {count:>10}");
    }
    put_extras(index, &mut said);
    said
}

/// What stands in a log beside its messages, if anything does.
fn put_extras(index: &Index, said: &mut String) {
    let (extras, unnamed) = index.extras();
    if !extras.is_empty() {
        let _ = writeln!(
            said,
            "  {:<24} {:<16} {:<20} {:>10} {:>12}",
            "beside them", "kind", "media type", "count", "bytes"
        );
    }
    for extra in &extras {
        let (name, media_type, kind) = (text::name(&extra.name), text::name(&extra.media_type), extra.kind.word());
        let _ = writeln!(said, "  {name:<24} {kind:<16} {media_type:<20} {:>10} {:>12}", extra.count, extra.bytes);
    }
    if unnamed > 0 {
        let _ = writeln!(said, "  {unnamed} attachments and metadata more, of other names or too large to be read");
    }
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
    finish(target, &said)
}

/// Puts a result into its place, then says what is to be said of it.
fn finish(target: Target, said: &str) -> Result<()> {
    let piped = target.is_standard_output();
    for beside in target.finish()? {
        let name = beside.file_name().unwrap_or_default().to_string_lossy().into_owned();
        complain(&format!("{name} is left out: standard output has no room for a second file; right is -o FILE"));
    }
    match piped {
        true if said.is_empty() => {}
        true => tell(said.trim_end()),
        false => say(said)?,
    }
    Ok(())
}

fn warn_of(damage: &[String]) {
    for reason in damage {
        complain(&format!("the log is not whole: {reason}"));
    }
}

/// A part of a log, and when the earliest message of that log was recorded.
fn window<'a>(log: &Path, selection: &'a Selection) -> Result<Window<'a>> {
    let index = Index::read(log, &mut progress("reading a log without an index:"))?;
    Ok(Window { origin: index.span().map_or(0.0, |(start, _)| start), selection })
}

/// Hands the records of a part of a log to `each`, with their seconds after the log's earliest message.
fn for_each_record(
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
        if window.place(record.received) == Place::Within && selection.takes(record.key, record.source) {
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
fn is_something(found: u64, log: &Path, selection: &Selection) -> Result<()> {
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
        ValueRef::Double(_) => "double",
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
    let Difference { key, source, number, first: one, second: other, place } = earliest;
    let (key, source) = (text::name(key), text::name(source));
    let _ = writeln!(said, "first: {key} by {source}, its message {number}, at {:.6} s", earliest.time());
    if let Some(place) = place {
        let at = if place.path.is_empty() { "value" } else { &place.path };
        let _ = writeln!(said, "  {at}: {} became {}", brief(&place.first), brief(&place.second));
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

/// `elk log export`
fn export(log: &Path, to: Format, output: Option<PathBuf>, selection: &Selection) -> Result<ExitCode> {
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
    finish(target, &said)?;
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
    let mut logger = Logger::of(recorder, patterns);
    match run_app_on(&mut logger, &mut client, &stop) {
        // The community's end is the recording's, too.
        Err(RunError::Comms(_)) => logger.on_stop(&mut client.comms).map_err(|error| anyhow::anyhow!("{error}"))?,
        ended => ended?,
    }
    let messages = logger.messages();
    match piped {
        Some(target) => finish(target, &format!("{messages} messages in standard output\n"))?,
        None => say(&format!("{messages} messages in {}\n", output.output.display()))?,
    }
    Ok(ExitCode::SUCCESS)
}
