//! `elk replay`: yesterday's run, onto the bus or into today's apps.

use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use clap::Args;
use elk_bus::{Client, stop_on_signals};
use elk_mission::{Mission, Override};
use elk_replay::keyboard::{self, Keyboard};
use elk_replay::{
    Console, PlayOptions, Played, Player, Press, Progress, Rate, ReproduceOptions, Reproduced, Tape, reproduce,
};

use crate::cli::CommunityArgs;
use crate::log::{SelectionArgs, progress};
use crate::registry::registry;

/// What stands below the help.
pub const HELP: &str = "Example: elk replay logs/apartment-20261123-224512 --rate 2\n\n\
    On a terminal space pauses, . steps, left and right go 5 s, + and - change the rate, Home begins again, q ends. The \
    broker's own variables (DB_*) are not played.\n\n\
    With --into, the apps of a mission that --only names run live in this process, the recording gives them their \
    input, in its order, and what they say is logged into a new run: elk log diff OLD NEW then says whether it is the \
    same. Besides --keys, what a live app has registered for is played.\n\
    Example: elk replay logs/apartment-20261123-224512 --rate max --keys 'SCAN*' \\\n         \
    --into mission-files/apartment.xml --only Map,Explorer";

/// Characters of the progress bar.
const BAR: usize = 30;

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
    /// Play into live apps of this mission instead of onto the bus
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
    let mut screen = Screen::new();
    let played = Player::new(tape, &options, &mut client).play(&mut screen, &stop)?;
    drop(screen);
    report(&log, &played)
}

fn report(log: &Path, played: &Played) -> Result<ExitCode> {
    let Played { messages, bytes, took, dropped, refused, refusal, lateness, unreadable } = played;
    if *messages == 0 {
        bail!("{}", elk_replay::ReplayError::Nothing(log.into()));
    }
    let secs = took.as_secs_f64();
    let mut text = format!("{messages} messages, {:.1} MB, in {secs:.3} s", *bytes as f64 / 1e6);
    if lateness.total() > 0 {
        let micros = |share| lateness.quantile(share).as_secs_f64() * 1e6;
        text += &format!("; late by {:.0} µs (half of them), {:.0} µs (99 %)", micros(0.5), micros(0.99));
    }
    text += &format!("; {dropped} dropped by clients that did not keep up\n");
    if *refused > 0 {
        text += &format!("{refused} refused by the broker; the first: {}\n", refusal.as_deref().unwrap_or_default());
    }
    if *unreadable > 0 {
        text += &format!("{unreadable} could not be read\n");
    }
    say(&text)?;
    Ok(if *refused > 0 || *unreadable > 0 { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

/// Into live apps.
fn run_into(arguments: ReplayArgs, mission: &Path) -> Result<ExitCode> {
    let ReplayArgs { log, rate, selection, only, sets, log_dir, .. } = arguments;
    let mission = Mission::load(mission, &registry(), &sets)?;
    let options = ReproduceOptions { rate, selection: selection.into(), only, log_dir };
    let stop = stop_on_signals().context("signals cannot be caught")?;
    let done = reproduce(&log, mission, &options, &mut progress("replaying"), &stop)?;
    report_reproduced(&log, &done)
}

fn report_reproduced(log: &Path, done: &Reproduced) -> Result<ExitCode> {
    let Reproduced { folder, played, outputs } = done;
    if *played == 0 {
        bail!("{}", elk_replay::ReplayError::Nothing(log.into()));
    }
    let mut text = format!("{played} recorded messages played; said by the live apps:\n");
    for output in outputs {
        let elk_replay::reproduce::Output { key, source, recorded, live } = output;
        text += &format!("  {key:<20} {source:<12} {live:>7} of {recorded}\n");
    }
    text += &format!("the new run is in {}\n", folder.display());
    let keys: Vec<String> = outputs.iter().map(|output| format!(" --keys {}", output.key)).collect();
    text += &format!("compare: elk log diff {} {}{}\n", log.display(), folder.display(), keys.concat());
    say(&text)?;
    let complete = outputs.iter().all(|output| output.live == output.recorded);
    Ok(if complete { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn say(text: &str) -> Result<()> {
    match std::io::stdout().write_all(text.as_bytes()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Err(error.into()),
        _ => Ok(()),
    }
}

/// A terminal with a bar and keys; in a pipe, a line every tenth of the way.
struct Screen {
    keyboard: Option<Keyboard>,
    terminal: bool,
    /// The tenth that was told last.
    tenth: Option<u64>,
}

impl Screen {
    fn new() -> Self {
        let keyboard = Keyboard::open();
        let terminal = std::io::stderr().is_terminal();
        if keyboard.is_some() && terminal {
            eprintln!("{}", keyboard::HELP);
        }
        Self { keyboard, terminal, tenth: None }
    }
}

impl Console for Screen {
    fn presses(&mut self) -> Vec<Press> {
        self.keyboard.as_mut().map(Keyboard::presses).unwrap_or_default()
    }

    fn show(&mut self, progress: &Progress) {
        let Progress { secs, of_secs, messages, rate, paused } = progress;
        let share = if *of_secs > 0.0 { secs / of_secs } else { 1.0 };
        let state = if *paused { " paused" } else { "" };
        if self.terminal {
            let full = (share * BAR as f64).round() as usize;
            let bar = format!("{}{}", "#".repeat(full.min(BAR)), ".".repeat(BAR.saturating_sub(full)));
            eprint!("\r[{bar}] {secs:.1} / {of_secs:.1} s at {rate}, {messages} messages{state}\x1b[K");
        } else if self.tenth != Some((share * 10.0) as u64) {
            self.tenth = Some((share * 10.0) as u64);
            eprintln!("{secs:.1} / {of_secs:.1} s at {rate}, {messages} messages{state}");
        }
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        if self.terminal {
            eprintln!();
        }
    }
}
