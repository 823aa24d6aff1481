//! Plays a log onto the bus.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use elk_bus::broker::CLOCK;
use elk_bus::broker::table::CommunityTable;
use elk_bus::clock::Stopwatch;
use elk_bus::comms::BULK_MIN_BYTES;
use elk_bus::pattern::matches;
use elk_bus::{Client, Drive, Origin};
use elk_log::selection::Position;
use elk_log::{RecordRef, Selection};
use elk_outside::time;

use crate::error::ReplayError;
use crate::lateness::Lateness;
use crate::schedule::{Rate, Schedule, Wait};
use crate::table::{Losses, table};
use crate::tape::Tape;

/// What the broker publishes itself; another one's would only contradict it.
pub const OF_THE_BROKER: &str = "DB_*";
/// How often the keyboard is looked at, and progress shown.
const LOOK: Duration = Duration::from_millis(50);
/// Shorter waits are slept through; longer ones listen to the bus for all but this.
const SLEEP: Duration = Duration::from_millis(2);
/// Looking at the clock costs more than publishing a message: at rate `max` it is done after so many.
const MESSAGES_PER_LOOK: u32 = 256;
/// After so many bytes, and after each bulk value, a lossless replay waits for its readers: a mailbox holds many times
/// that, but only the last few bulk values are kept for those who are behind.
const LOSSLESS_BYTES: usize = 256 << 10;
/// The community's clock is set anew when it has come so far from the schedule (s of real time): the two go by different
/// clocks of the machine.
const OUT_OF_STEP_SECS: f64 = 1e-3;
/// Batches that some reader has not handled when a lossless replay goes on.
const LOSSLESS_AHEAD: u64 = 3;
/// How often it is looked whether readers are ready, at first and after a while.
const LOOK_AT_READERS: (Duration, Duration) = (Duration::from_micros(100), Duration::from_millis(20));
/// How long readers that nobody waits for get at the end: what they have lost is counted when they come to it.
const LAST_LOOK: Duration = Duration::from_secs(1);
/// Who is waited for is told after so long.
const LONG_WAIT: Duration = Duration::from_secs(1);

/// How a log is to be played.
#[derive(Debug, Clone, PartialEq)]
pub struct PlayOptions {
    /// How fast.
    pub rate: Rate,
    /// Which part of it.
    pub selection: Selection,
    /// Variables that are published under another name: from, to.
    pub remap: Vec<(String, String)>,
    /// From its end, begin again.
    pub repeat: bool,
    /// Wait for readers that do not keep up.
    pub lossless: bool,
    /// Let the community's time be that of the recording.
    pub clock: bool,
}

/// What a person asks for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Press {
    /// Stand still, or go on.
    Pause,
    /// While standing still: say the next message.
    Step,
    /// Go so many seconds of recorded time on, or back.
    Skip(f64),
    /// Double the rate, or halve it.
    Rate {
        /// Whether it is doubled.
        faster: bool,
    },
    /// Begin again.
    Restart,
    /// Give the terminal back for a while.
    Suspend,
    /// End.
    Quit,
}

/// How far a replay is.
#[derive(Debug, Clone, PartialEq)]
pub struct Progress {
    /// Recorded time since the log's first message (s).
    pub secs: f64,
    /// Recorded time from the first message to the last (s).
    pub of_secs: f64,
    /// Messages said.
    pub messages: u64,
    /// The rate.
    pub rate: Rate,
    /// Whether it stands still.
    pub paused: bool,
    /// The client that a lossless replay has been waiting for, for a while.
    pub waits_for: Option<String>,
}

/// What a replay came to.
#[derive(Debug, Clone, PartialEq)]
pub struct Played {
    /// Whether the log has ended, and nobody ended its replay before.
    pub to_the_end: bool,
    /// Messages said.
    pub messages: u64,
    /// Bytes of their values.
    pub bytes: u64,
    /// How long it took (real time).
    pub took: Duration,
    /// Messages that were lost meanwhile to clients that did not keep up.
    pub dropped: u64,
    /// The client that was furthest behind at the end, and the messages that it had still to read.
    pub behind: Option<(String, u64)>,
    /// Messages that the broker refused, with the first reason.
    pub refused: u64,
    /// The first reason.
    pub refusal: Option<String>,
    /// How late messages were said.
    pub lateness: Lateness,
    /// Messages of the log that could not be read.
    pub unreadable: u64,
    /// Messages of other tools that nobody here understands, by their types: they are not said.
    pub unknown: BTreeMap<String, u64>,
}

/// The person, and the screen.
pub trait Console {
    /// What was asked for since the last call.
    fn presses(&mut self) -> Vec<Press>;
    /// Shows how far it is.
    fn show(&mut self, progress: &Progress);
    /// Says something that is not to be overwritten.
    fn tell(&mut self, words: &str);
    /// Gives the terminal back, and returns when it may be used again.
    fn suspend(&mut self);
}

/// Plays a log once, or for ever.
pub struct Player<'a> {
    tape: Tape,
    options: &'a PlayOptions,
    client: &'a mut Client,
    schedule: Schedule,
    clock: Stopwatch,
    origin: f64,
    end: f64,
    /// Steps to take while standing still.
    steps: u32,
    /// Bytes said since readers were waited for.
    unchecked: usize,
    waits_for: Option<String>,
    losses: Losses,
    looked: Duration,
    since_look: u32,
    played: Played,
}

/// What to do with the message that was found.
#[derive(PartialEq)]
enum Turn {
    Say,
    /// The place in the log has changed.
    Moved,
    Quit,
}

impl<'a> Player<'a> {
    /// A player of `tape` onto `client`'s community.
    pub fn new(mut tape: Tape, options: &'a PlayOptions, client: &'a mut Client) -> Self {
        let (origin, end) = tape.span();
        tape.within(&options.selection);
        Self {
            tape,
            options,
            client,
            schedule: Schedule::new(options.rate),
            clock: Stopwatch::start(),
            origin,
            end,
            steps: 0,
            unchecked: 0,
            waits_for: None,
            losses: Losses::default(),
            looked: Duration::ZERO,
            since_look: 0,
            played: Played {
                to_the_end: false,
                messages: 0,
                bytes: 0,
                took: Duration::ZERO,
                dropped: 0,
                behind: None,
                refused: 0,
                refusal: None,
                lateness: Lateness::default(),
                unreadable: 0,
                unknown: BTreeMap::new(),
            },
        }
    }

    /// Plays until the log ends, somebody quits, or `stop` is set.
    pub fn play(mut self, console: &mut dyn Console, stop: &AtomicBool) -> Result<Played, ReplayError> {
        self.table()?;
        let lost_before = self.losses.total();
        // The kernel bundles wake-ups within 50 µs unless it is asked not to; where it refuses, messages are that late.
        let _ = rustix::thread::set_current_timer_slack(std::num::NonZeroU64::new(1));
        self.clock = Stopwatch::start();
        self.rewind()?;
        self.take_clock()?;
        while !stop.load(Ordering::Relaxed) {
            if self.unchecked >= LOSSLESS_BYTES
                && !self.readers_keep_up(LOSSLESS_AHEAD, Duration::MAX, console, stop)?
            {
                break;
            }
            if !self.find()? {
                if !self.options.repeat || self.played.messages == 0 {
                    self.played.to_the_end = true;
                    break;
                }
                self.rewind()?;
                continue;
            }
            match self.turn(console, stop)? {
                Turn::Say => self.say(console)?,
                Turn::Moved => {}
                Turn::Quit => break,
            }
        }
        self.client.comms.flush()?;
        self.played.took = self.clock.elapsed();
        self.table()?;
        if self.played.to_the_end {
            let patience = if self.options.lossless { Duration::MAX } else { LAST_LOOK };
            // What is left at last is the question itself.
            self.readers_keep_up(1, patience, console, stop)?;
            if self.options.lossless {
                self.played.took = self.clock.elapsed();
            }
            let last = self.table()?;
            self.played.behind = self.slowest(&last).filter(|_| self.client.comms.unhandled_batches() > 2);
        }
        self.client.comms.let_go_of_clock()?;
        self.client.comms.flush()?;
        self.played.dropped = self.losses.total() - lost_before;
        self.note_refusals();
        console.show(&self.progress());
        self.tape.damage().iter().for_each(|reason| console.tell(&format!("the log is not whole: {reason}")));
        Ok(self.played)
    }

    /// Has the community's time be that of the recording, unless somebody else drives it already.
    fn take_clock(&mut self) -> Result<(), ReplayError> {
        if !self.options.clock {
            return Ok(());
        }
        self.set_clock(self.clock.elapsed())?;
        // The answer comes behind a refusal.
        table(self.client)?;
        let refused = self.client.inbox.take_refusals().into_iter().find(|refused| refused.key == CLOCK);
        refused.map_or(Ok(()), |refused| Err(ReplayError::Clock { reason: refused.reason }))
    }

    /// Sets the community's clock to where the schedule is, if it is not there.
    fn set_clock(&mut self, now: Duration) -> Result<(), ReplayError> {
        if !self.options.clock {
            return Ok(());
        }
        let comms = &mut self.client.comms;
        if let Some((time, rate)) = self.schedule.clock(now) {
            let same_rate = comms.clock().setting().is_some_and(|setting| setting.rate == rate);
            if !same_rate || (comms.time() - time).abs() > rate * OUT_OF_STEP_SECS {
                comms.drive_clock(Drive { time_secs: time, rate })?;
            }
        }
        Ok(())
    }

    /// Has the community's clock stand still where the schedule is; the next turn sets it again.
    fn stop_clock(&mut self, now: Duration) -> Result<(), ReplayError> {
        let comms = &mut self.client.comms;
        let position = self.schedule.clock(now).filter(|_| self.options.clock);
        if let Some((time, _)) = position.filter(|_| comms.clock().setting().is_some_and(|setting| setting.rate > 0.0))
        {
            comms.drive_clock(Drive::standing_at(time))?;
            comms.flush()?;
        }
        Ok(())
    }

    /// Goes to where the part that is played begins.
    fn rewind(&mut self) -> Result<(), ReplayError> {
        self.go_to(self.origin + self.options.selection.from_secs.unwrap_or(0.0))
    }

    fn go_to(&mut self, time: f64) -> Result<(), ReplayError> {
        self.tape.seek(time)?;
        self.schedule.jump(self.clock.elapsed(), time);
        Ok(())
    }

    /// Finds the next message that is to be played.
    fn find(&mut self) -> Result<bool, ReplayError> {
        while self.tape.advance()? {
            let Some((key, source, time)) = self.tape.head() else {
                return Ok(false);
            };
            // What is behind the part may be followed by what is in it.
            let within = self.options.selection.position(time - self.origin) == Position::Within;
            if !within || !self.options.selection.takes(key, source) || matches(OF_THE_BROKER, key) {
                continue;
            }
            let Some(unknown) = self.tape.unknown_type() else {
                return Ok(true);
            };
            *self.played.unknown.entry(unknown.to_owned()).or_default() += 1;
        }
        Ok(false)
    }

    /// Waits until the message that was found is due.
    fn turn(&mut self, console: &mut dyn Console, stop: &AtomicBool) -> Result<Turn, ReplayError> {
        let Some((.., time)) = self.tape.head() else {
            return Ok(Turn::Moved);
        };
        self.since_look += 1;
        if self.schedule.rate() == Rate::Max && !self.schedule.paused() && self.since_look < MESSAGES_PER_LOOK {
            self.schedule.wait(self.looked, time);
            self.set_clock(self.looked)?;
            return Ok(Turn::Say);
        }
        self.since_look = 0;
        loop {
            let now = self.clock.elapsed();
            let wait = self.schedule.wait(now, time);
            self.set_clock(now)?;
            if now - self.looked >= LOOK {
                if let Some(turn) = self.look(console)? {
                    return Ok(turn);
                }
                continue;
            }
            match wait {
                Wait::Now => {
                    if let Some(due) = self.schedule.due(time) {
                        self.played.lateness.note(now.saturating_sub(due));
                    }
                    return Ok(Turn::Say);
                }
                Wait::Paused if self.steps > 0 => {
                    self.steps -= 1;
                    self.schedule.jump(now, time);
                    self.set_clock(now)?;
                    return Ok(Turn::Say);
                }
                Wait::Paused => self.rest(LOOK)?,
                Wait::For(left) => self.rest(left.min(LOOK))?,
            }
            if stop.load(Ordering::Relaxed) {
                return Ok(Turn::Quit);
            }
        }
    }

    /// Lets `time` pass; what was said leaves first.
    fn rest(&mut self, time: Duration) -> Result<(), ReplayError> {
        self.client.comms.flush()?;
        match time.checked_sub(SLEEP) {
            Some(long) => drop(self.client.receive(long, |_| {})?),
            None => std::thread::sleep(time),
        }
        Ok(())
    }

    fn look_if_due(&mut self, console: &mut dyn Console) -> Result<Option<Turn>, ReplayError> {
        if self.clock.elapsed() - self.looked >= LOOK { self.look(console) } else { Ok(None) }
    }

    /// Looks at the keyboard, and shows progress. Answers what that means for the message that was found.
    fn look(&mut self, console: &mut dyn Console) -> Result<Option<Turn>, ReplayError> {
        self.looked = self.clock.elapsed();
        let mut turn = None;
        for press in console.presses() {
            let now = self.clock.elapsed();
            match press {
                Press::Pause => self.schedule.pause(now, !self.schedule.paused()),
                Press::Step => self.steps += 1,
                Press::Rate { faster } => self.schedule.set_rate(now, self.schedule.rate().changed(faster)),
                Press::Quit => return Ok(Some(Turn::Quit)),
                Press::Suspend => self.stand_still(|_| console.suspend())?,
                Press::Restart => {
                    self.rewind()?;
                    turn = Some(Turn::Moved);
                }
                Press::Skip(secs) => {
                    let begin = self.origin + self.options.selection.from_secs.unwrap_or(0.0);
                    let here = self.schedule.position(now).unwrap_or(begin);
                    // A part that begins behind the end has nothing before its beginning.
                    self.go_to((here + secs).min(self.end).max(begin))?;
                    turn = Some(Turn::Moved);
                }
            }
        }
        if !self.schedule.paused() {
            self.steps = 0;
        }
        self.note_refusals();
        console.show(&self.progress());
        Ok(turn)
    }

    /// Does something in time that is no recorded time.
    fn stand_still<T>(&mut self, act: impl FnOnce(&mut Self) -> T) -> Result<T, ReplayError> {
        let before = self.clock.elapsed();
        self.stop_clock(before)?;
        let done = act(self);
        self.schedule.pass_over(self.clock.elapsed() - before);
        Ok(done)
    }

    fn note_refusals(&mut self) {
        for refused in self.client.inbox.take_refusals() {
            self.played.refused += 1;
            self.played.refusal.get_or_insert_with(|| format!("{}: {}", refused.key, refused.reason));
        }
    }

    fn progress(&self) -> Progress {
        let here = self.schedule.position(self.clock.elapsed()).unwrap_or(self.origin);
        Progress {
            secs: (here - self.origin).min(self.end - self.origin).max(0.0),
            of_secs: self.end - self.origin,
            messages: self.played.messages,
            rate: self.schedule.rate(),
            paused: self.schedule.paused(),
            waits_for: self.waits_for.clone(),
        }
    }

    /// Says the message that was found.
    fn say(&mut self, console: &mut dyn Console) -> Result<(), ReplayError> {
        let record = match self.tape.record() {
            Some(Ok(record)) => record,
            Some(Err(error)) => {
                if self.played.unreadable == 0 {
                    console.tell(&error.to_string());
                }
                self.played.unreadable += 1;
                return Ok(());
            }
            None => return Ok(()),
        };
        let RecordRef { key, value, .. } = record;
        let key = renamed(&self.options.remap, key);
        // Beside a clock that shows another time, a recorded one would only confuse.
        let time = self.options.clock.then_some(record.time).and_then(time::seconds);
        self.client.comms.publish_value(key, value, Origin { time, ..origin(&record) })?;
        let bytes = value.byte_len();
        self.played.messages += 1;
        self.played.bytes += bytes as u64;
        if self.options.lossless {
            self.unchecked += if bytes >= BULK_MIN_BYTES { LOSSLESS_BYTES } else { bytes + key.len() };
        }
        Ok(())
    }

    /// Waits, but no longer than `patience`, until no reader is further behind than the last `ahead` batches; answers
    /// whether to go on.
    fn readers_keep_up(
        &mut self,
        ahead: u64,
        patience: Duration,
        console: &mut dyn Console,
        stop: &AtomicBool,
    ) -> Result<bool, ReplayError> {
        self.unchecked = 0;
        let (mut pause, longest) = LOOK_AT_READERS;
        let begun = self.clock.elapsed();
        while self.client.comms.unhandled_batches() > ahead && self.clock.elapsed() - begun < patience {
            let slowest = self.stand_still(|player| player.look_at_readers(pause))??;
            pause = (2 * pause).min(longest);
            if self.clock.elapsed() - begun > LONG_WAIT {
                self.waits_for = slowest.map(|(client, _)| client);
            }
            if stop.load(Ordering::Relaxed) || self.look_if_due(console)? == Some(Turn::Quit) {
                return Ok(false);
            }
        }
        self.waits_for = None;
        Ok(true)
    }

    fn table(&mut self) -> Result<CommunityTable, ReplayError> {
        let table = table(self.client)?;
        self.losses.note(&table);
        Ok(table)
    }

    /// Has the broker say how far its readers are, and gives them some time; answers who has most to read.
    fn look_at_readers(&mut self, pause: Duration) -> Result<Option<(String, u64)>, ReplayError> {
        let table = self.table()?;
        self.client.receive(pause, |_| {})?;
        Ok(self.slowest(&table))
    }

    /// The client with most messages to read, and how many these are.
    fn slowest(&self, table: &CommunityTable) -> Option<(String, u64)> {
        let own = self.client.comms.name();
        let others = table.clients.iter().filter(|client| client.name != own && client.unhandled > 0);
        others.max_by_key(|client| client.unhandled).map(|client| (client.name.clone(), client.unhandled))
    }
}

fn renamed<'a>(remap: &'a [(String, String)], key: &'a str) -> &'a str {
    remap.iter().find(|(from, _)| from == key).map_or(key, |(_, to)| to)
}

/// Where a recorded message comes from.
pub(crate) fn origin<'a>(record: &RecordRef<'a>) -> Origin<'a> {
    // A source without a name (an .alog can have one) is this program itself.
    let source = Some(record.source).filter(|source| !source.is_empty());
    Origin { source, source_aux: record.source_aux, time: time::seconds(record.time) }
}
