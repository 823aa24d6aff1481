//! `elk replay`: yesterday's run, onto the bus or into today's apps.

use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use clap::Args;
use elk_bus::{Client, stop_on_signals, tell};
use elk_mission::Override;
use elk_outside::screen::Screen;
use elk_outside::text;
use elk_replay::keyboard::{self, Keyboard};
use elk_replay::{
    Console, PlayOptions, Played, Player, Press, Progress, Rate, ReproduceOptions, Reproduced, StreamCount, Tape,
    reproduce,
};

use crate::arguments::CommunityArgs;
use crate::log::SelectionArgs;
use crate::missions;
use crate::terminal::{draw, progress, say};

/// What stands below the help.
pub const HELP: &str = "Example: elk replay logs/apartment-20261123-224512 --rate 2\n\n\
    On a terminal space pauses, . steps, left and right go 5 s, + and - change the rate, Home begins again, q ends, \
    Ctrl-Z gives the terminal back until fg. The broker's own variables (DB_*) are not played.\n\n\
    With --into, the apps of a mission that --only names are live: elk's own in this process, programs of somebody else's \
    beside it. The recording gives them their input, in its order, and what they say is logged into a new run: \
    elk log diff OLD NEW then says whether it is the same. Besides --keys, what a live app has registered for is played.\n\
    Example: elk replay logs/apartment-20261123-224512 --rate max --keys 'SCAN*' \\\n         \
    --into mission-files/apartment.xml --only Map,Explorer";

/// Characters of the progress bar, where there is room.
const BAR_LENGTH: usize = 30;
/// Fewer say nothing.
const SHORTEST_BAR: usize = 5;

/// What to play, and how.
#[derive(Debug, Args)]
pub struct ReplayArgs {
    /// The log: a run's folder, a file, or an .alog of MOOS
    log: PathBuf,
    /// How many times as fast as it was, 0.1 to 1000, or max
    #[arg(long, default_value = "1")]
    rate: Rate,
    /// Which part
    #[command(flatten)]
    selection: SelectionArgs,
    /// Publish a variable under another name; may be repeated
    #[arg(long, value_name = "NAME=NEW", value_parser = remapping)]
    remap: Vec<(String, String)>,
    /// From its end, begin again
    #[arg(long = "loop")]
    repeat: bool,
    /// Wait for clients that do not keep up, instead of keeping time
    #[arg(long)]
    lossless: bool,
    /// Let the community's time be that of the recording: the apps that are there follow it through pauses and jumps
    #[arg(long)]
    clock: bool,
    /// Play into live apps of this mission instead of onto the bus: its file, a built-in one's name, or a run's folder
    #[arg(long, value_name = "MISSION", requires = "only", conflicts_with_all = ["remap", "repeat", "lossless", "clock", "community"])]
    into: Option<PathBuf>,
    /// The live apps, by name or element, separated by commas
    #[arg(long, value_name = "APPS", value_delimiter = ',', requires = "into")]
    only: Vec<String>,
    /// Say a parameter of a live app here instead of in the mission file; may be repeated
    #[arg(long = "set", value_name = "APP.PARAM=VALUE", requires = "into")]
    sets: Vec<Override>,
    /// Where the new run's folder is made
    #[arg(long, default_value = "logs", value_name = "DIR", requires = "into")]
    log_dir: PathBuf,
    /// Which community
    #[command(flatten)]
    community: CommunityArgs,
}

fn remapping(said: &str) -> Result<(String, String), String> {
    match said.split_once('=') {
        Some((from, to)) if !from.is_empty() && !to.is_empty() => Ok((from.into(), to.into())),
        _ => Err("right is NAME=NEW, for example SCAN=OLD_SCAN".into()),
    }
}

/// `elk replay`
pub fn run(arguments: ReplayArgs) -> Result<ExitCode> {
    match arguments.into.clone() {
        Some(mission) => run_into(arguments, &mission),
        None => run_onto(arguments),
    }
}

/// Onto the bus.
fn run_onto(arguments: ReplayArgs) -> Result<ExitCode> {
    let ReplayArgs { log, rate, selection, remap, repeat, lossless, clock, community, .. } = arguments;
    let tape = Tape::open(&log, &mut progress("reading a log without an index:"))?;
    let options = PlayOptions { rate, selection: selection.into(), remap, repeat, lossless, clock };
    let name = format!("replay-{}", std::process::id());
    let mut client = Client::connect(&community.community, &name)
        .context("a log is played to a community; start one with `elk db`, or play into apps with --into")?;
    let stop = stop_on_signals().context("signals cannot be caught")?;
    let (start, end) = tape.span();
    say(&format!("{}: {} messages in {:.3} s\n", log.display(), tape.messages(), end - start))?;
    let mut screen = Bar::new();
    let played = Player::new(tape, &options, &mut client).play(&mut screen, &stop)?;
    drop(screen);
    report(&log, &played)
}

fn report(log: &Path, played: &Played) -> Result<ExitCode> {
    let Played { to_the_end, messages, bytes, took, dropped, behind, refused, refusal, lateness, unreadable, unknown } =
        played;
    let unknown: Vec<String> =
        unknown.iter().map(|(of, count)| format!("{count} messages of {} were not played", text::name(of))).collect();
    if *to_the_end && *messages == 0 {
        let nothing = elk_replay::ReplayError::Nothing(log.into());
        let why = if unknown.is_empty() { String::new() } else { format!(": {}", unknown.join(", ")) };
        bail!("{nothing}{why}");
    }
    let secs = took.as_secs_f64();
    let mut said = format!("{messages} messages, {:.1} MB, in {secs:.3} s", *bytes as f64 / 1e6);
    if lateness.total() > 0 {
        let micros = |share| lateness.quantile(share).as_secs_f64() * 1e6;
        said += &format!("; late by {:.0} µs (half of them), {:.0} µs (99 %)", micros(0.5), micros(0.99));
    }
    said += &format!("; {dropped} dropped by clients that did not keep up");
    if let Some((client, unread)) = behind {
        said += &format!("; {} has {unread} still to read", text::name(client));
    }
    said += "\n";
    if *refused > 0 {
        said += &format!("{refused} refused by the broker; the first: {}\n", refusal.as_deref().unwrap_or_default());
    }
    if *unreadable > 0 {
        said += &format!("{unreadable} could not be read\n");
    }
    unknown.iter().for_each(|words| said += &format!("{words}: another tool's type, which elk does not know\n"));
    say(&said)?;
    Ok(if *refused > 0 || *unreadable > 0 { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

/// Into live apps.
fn run_into(arguments: ReplayArgs, mission: &Path) -> Result<ExitCode> {
    let ReplayArgs { log, rate, selection, only, sets, log_dir, .. } = arguments;
    let (mission, notes) = missions::load(mission, &sets)?;
    notes.into_iter().for_each(tell);
    let options = ReproduceOptions { rate, selection: selection.into(), only, log_dir };
    let stop = stop_on_signals().context("signals cannot be caught")?;
    let done = reproduce(&log, mission, &options, &mut progress("replaying"), &stop)?;
    report_reproduced(&log, &done)
}

fn report_reproduced(log: &Path, done: &Reproduced) -> Result<ExitCode> {
    let Reproduced { folder, played, streams } = done;
    if *played == 0 {
        bail!("{}", elk_replay::ReplayError::Nothing(log.into()));
    }
    let mut said = format!("{played} recorded messages played; said by the live apps:\n");
    for stream in streams {
        let StreamCount { key, source, recorded, live } = stream;
        let (key, source) = (text::name(key), text::name(source));
        said += &format!("  {key:<20} {source:<12} {live:>7} of {recorded}\n");
    }
    said += &format!("the new run is in {}\n", folder.display());
    let keys: Vec<String> = streams.iter().map(|stream| format!(" --keys {}", stream.key)).collect();
    said += &format!("compare: elk log diff {} {}{}\n", log.display(), folder.display(), keys.concat());
    say(&said)?;
    let complete = streams.iter().all(StreamCount::is_complete);
    Ok(if complete { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// A terminal with a bar and keys; in a pipe, a line every tenth of the way, and for each client that is waited for.
struct Bar {
    keyboard: Option<Keyboard>,
    terminal: bool,
    /// The tenth, and the client, that were told last.
    told: (Option<u64>, Option<String>),
}

impl Bar {
    fn new() -> Self {
        let keyboard = Keyboard::open();
        let terminal = std::io::stderr().is_terminal();
        let bar = Self { keyboard, terminal, told: (None, None) };
        if bar.keyboard.is_some() && bar.is_drawn_on() {
            tell(keyboard::HELP);
        }
        bar
    }

    /// Whether there is a bar: not where a shell or another job has the terminal.
    fn is_drawn_on(&self) -> bool {
        self.terminal && self.keyboard.as_ref().is_none_or(Keyboard::is_ours)
    }
}

impl Console for Bar {
    fn presses(&mut self) -> Vec<Press> {
        self.keyboard.as_mut().map(Keyboard::presses).unwrap_or_default()
    }

    fn show(&mut self, progress: &Progress) {
        if self.is_drawn_on() {
            let columns = Screen::of(&std::io::stderr()).map_or(0, |screen| screen.columns);
            draw(&format!("\r{}\x1b[K", line(progress, columns)));
        } else if !self.terminal {
            let waits_for = progress.waits_for.clone().or_else(|| self.told.1.clone());
            let now = (Some((share(progress) * 10.0) as u64), waits_for);
            if self.told != now {
                self.told = now;
                tell(words(progress));
            }
        }
    }

    fn tell(&mut self, words: &str) {
        if self.is_drawn_on() {
            draw("\r\x1b[K");
        }
        tell(words);
    }

    fn suspend(&mut self) {
        if let Some(keyboard) = &mut self.keyboard {
            tell(""); // the shell has a line of its own
            keyboard.suspend();
        }
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        if self.is_drawn_on() {
            tell("");
        }
    }
}

/// How much of the log is played, 0 to 1.
fn share(progress: &Progress) -> f64 {
    if progress.of_secs > 0.0 { progress.secs / progress.of_secs } else { 1.0 }
}

fn words(progress: &Progress) -> String {
    let Progress { secs, of_secs, messages, rate, paused, waits_for } = progress;
    let paused = if *paused { ", paused" } else { "" };
    let waits = waits_for.as_ref().map(|client| format!(", waits for {}", text::name(client))).unwrap_or_default();
    format!("{secs:.1} / {of_secs:.1} s at {rate}{paused}{waits}, {messages} messages")
}

/// Words with a bar before them, as far as there is room in so many columns. The last one stays free: what reaches it
/// may go on in the next line.
fn line(progress: &Progress, columns: usize) -> String {
    let words = words(progress);
    let room = columns.saturating_sub(1);
    let bar = room.saturating_sub(words.len() + "[] ".len()).min(BAR_LENGTH);
    if bar < SHORTEST_BAR {
        return words.chars().take(room).collect();
    }
    let full = (share(progress) * bar as f64).round() as usize;
    format!("[{}{}] {words}", "#".repeat(full.min(bar)), ".".repeat(bar.saturating_sub(full)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bar_gives_way_to_the_words_where_there_is_little_room() {
        let progress =
            Progress { secs: 5.0, of_secs: 20.0, messages: 7, rate: Rate::Times(2.0), paused: true, waits_for: None };
        let words = "5.0 / 20.0 s at 2x, paused, 7 messages";
        assert_eq!(line(&progress, 80), format!("[########......................] {words}"));
        assert_eq!(line(&progress, 200), line(&progress, 80));
        assert_eq!(line(&progress, 60), format!("[#####.............] {words}"));
        assert_eq!(line(&progress, 40), words);
        assert_eq!(line(&progress, 20), "5.0 / 20.0 s at 2x,");
        assert_eq!(line(&progress, 1), "");
    }

    #[test]
    fn a_log_without_duration_is_played_as_a_whole() {
        let progress =
            Progress { secs: 0.0, of_secs: 0.0, messages: 1, rate: Rate::Max, paused: false, waits_for: None };
        assert_eq!(line(&progress, 80), format!("[{}] 0.0 / 0.0 s at max, 1 messages", "#".repeat(BAR_LENGTH)));
    }
}
