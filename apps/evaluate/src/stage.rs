//! A mission as one thread's work: its apps take turns around a broker in memory, so that each run is the same run.

use std::process::Command;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use elk_bus::clock::Stopwatch;
use elk_bus::clock::{monotonic_nanos, thread_cpu_secs};
use elk_bus::{App, Client, Clock, Overheard, begin_app, take_turn, take_wake};
use elk_geometry::OccupancyGrid;
use elk_mission::{AppSpec, Mission, Program, Via, element};
use elk_pipe::{Errors, PipeApp};

use crate::meeting::Meeting;
use crate::observer::Observer;
use crate::outcome::{End, Outcome, Times, TracePoint};
use crate::site::Site;
use crate::statistics::percentile;
use crate::suite::Limits;

/// Rounds of a millisecond in which nobody has anything to do, after which a mission has come to a standstill.
const STANDSTILL_ROUNDS: usize = 50;
/// The longest wait for a program without a look whether to stop.
const LOOK_EVERY: Duration = Duration::from_millis(100);
/// How long a look at what programs on the bus have said is put off while there is nothing.
const PROGRAM_LOOK: Duration = Duration::from_micros(200);
/// How fast the community's clock runs: who waits for a time to pass does not keep others waiting.
const WARP: f64 = 1000.0;
/// Lines of what apps say that are kept for the reason of a failure.
const LAST_WORDS: usize = 64;

/// What is seen of a run from outside while it goes on.
#[derive(Debug, Default)]
pub struct Sign {
    /// When the present turn began (ns, monotonic); 0: none has.
    since_nanos: AtomicU64,
    /// Whose turn it is.
    turn: AtomicUsize,
    /// The apps that take turns.
    players: Mutex<Vec<String>>,
}

impl Sign {
    fn begin(&self, players: Vec<String>) {
        *self.players.lock().unwrap_or_else(PoisonError::into_inner) = players;
    }

    fn turn(&self, player: usize) {
        self.turn.store(player, Ordering::Relaxed);
        self.since_nanos.store(monotonic_nanos(), Ordering::Relaxed);
    }

    /// Nobody has a turn.
    pub fn rest(&self) {
        self.since_nanos.store(0, Ordering::Relaxed);
    }

    /// Who has been at the same turn for longer than `most_secs`, if anybody has.
    pub fn stuck(&self, most_secs: f64) -> Option<String> {
        let since = self.since_nanos.load(Ordering::Relaxed);
        let secs = monotonic_nanos().saturating_sub(since) as f64 * 1e-9;
        let players = self.players.lock().unwrap_or_else(PoisonError::into_inner);
        let player = players.get(self.turn.load(Ordering::Relaxed)).cloned().unwrap_or_default();
        (since > 0 && secs > most_secs).then_some(player)
    }
}

/// A run was asked to stop.
#[derive(Debug, PartialEq)]
pub struct Interrupted;

/// An app that takes its turns.
struct Player {
    name: String,
    app: Box<dyn App>,
    client: Client,
}

/// What came of a run.
pub struct Came {
    /// How it ended, and what was measured.
    pub outcome: Outcome,
    /// What was known after each scan.
    pub trace: Vec<TracePoint>,
    /// The map that was made.
    pub map: OccupancyGrid,
}

impl Came {
    /// Of a run that came to nothing.
    pub fn failed(why: impl Into<String>) -> Self {
        Self { outcome: Outcome::failed(why), trace: Vec::new(), map: OccupancyGrid::new(1.0) }
    }
}

/// Runs a mission to its end, or to where it may go no farther.
///
/// # Errors
/// `stop` was set meanwhile.
pub fn run(
    site: &Site,
    mission: &Mission,
    limits: &Limits,
    (sign, stop): (&Sign, &AtomicBool),
) -> Result<Came, Interrupted> {
    let overheard = Overheard::listen(LAST_WORDS);
    let begun = thread_cpu_secs();
    let mut stage = match Stage::new(site, mission) {
        Ok(stage) => stage,
        Err(why) => return Ok(Came::failed(why)),
    };
    sign.begin(stage.players.iter().map(|player| player.name.clone()).collect());
    let why = stage.play(limits, (sign, stop))?;
    sign.rest();
    // What is worked out of a run that is over is no part of what it took.
    let cpu_secs = thread_cpu_secs() - begun;
    let (mut outcome, plans) = stage.observer.outcome();
    match why {
        Over::Ended => {}
        Over::Capped(why) => (outcome.end, outcome.reason) = (End::Capped, why),
        Over::Failed(why) => (outcome.end, outcome.reason) = (End::Failed, with_last_words(why, &overheard)),
    }
    outcome.times = Times {
        cpu_secs,
        plan_p50_secs: percentile(&plans, 0.5).unwrap_or(0.0),
        plan_p99_secs: percentile(&plans, 0.99).unwrap_or(0.0),
    };
    // Clients that hang up wake the broker, who is to stop then.
    let Stage { players, observer, mut meeting } = stage;
    meeting.close();
    drop(players);
    let (trace, map) = observer.into_trace_and_map();
    Ok(Came { outcome, trace, map })
}

/// Why it goes no farther.
enum Over {
    /// It came to its end.
    Ended,
    Capped(String),
    Failed(String),
}

/// Rejections come before a standstill, and say why it stands still.
fn with_last_words(why: String, overheard: &Overheard) -> String {
    let words = overheard.words();
    const TELLING: [&str; 4] = [" rejects ", "no plan for request", " was refused: ", " was not taken: "];
    let telling = words.iter().rev().find(|line| TELLING.iter().any(|words| line.contains(words)));
    telling.map_or(why.clone(), |line| format!("{why}; before that: {line}"))
}

struct Stage<'a> {
    players: Vec<Player>,
    observer: Observer<'a>,
    /// The last to go.
    meeting: Meeting,
}

impl<'a> Stage<'a> {
    fn new(site: &'a Site, mission: &Mission) -> Result<Self, String> {
        let clock = Clock::new(WARP);
        let apps = || mission.apps.iter().filter(|app| app.element != element::LOGGER);
        let (programs, own): (Vec<&AppSpec>, Vec<&AppSpec>) = apps().partition(|app| is_on_the_bus_itself(app));
        let mut meeting = match programs.is_empty() {
            true => Meeting::in_memory(clock)?,
            false => Meeting::on_this_machine(clock)?,
        };
        let observer = Observer::new(site, meeting.join("evaluation")?).map_err(|error| error.to_string())?;
        let mut players = Vec::new();
        for app in own {
            let made = build(app)?;
            players.push(Player { name: app.name.clone(), app: made, client: meeting.join(&app.name)? });
        }
        for Player { app, client, .. } in &mut players {
            begin_app(&mut **app, client).map_err(|error| error.to_string())?;
        }
        programs.into_iter().try_for_each(|app| meeting.start(app))?;
        Ok(Self { players, observer, meeting })
    }

    fn play(&mut self, limits: &Limits, (sign, stop): (&Sign, &AtomicBool)) -> Result<Over, Interrupted> {
        let (mut idle, mut moved_last) = (0, Stopwatch::start());
        loop {
            if stop.load(Ordering::Relaxed) {
                return Err(Interrupted);
            }
            let moved = match self.round(sign) {
                Ok(moved) => moved,
                Err(why) => return Ok(Over::Failed(why)),
            };
            if self.observer.has_ended() {
                return Ok(Over::Ended);
            }
            if let Some(why) = self.observer.beyond(limits) {
                return Ok(Over::Capped(why));
            }
            if !moved && let Some(program) = self.players.iter().position(|player| player.app.wake_fd().is_some()) {
                // It is waited for here, and nobody's turn.
                sign.rest();
                match self.hear_program(program, limits, stop)? {
                    Ok(()) => continue,
                    Err(why) => return Ok(Over::Failed(why)),
                }
            }
            if moved {
                (idle, moved_last) = (0, Stopwatch::start());
                continue;
            }
            idle += 1;
            if self.meeting.has_programs() {
                if let Err(why) = self.wait_for_programs(&moved_last, limits) {
                    return Ok(Over::Failed(why));
                }
                continue;
            }
            if idle > STANDSTILL_ROUNDS {
                return Ok(Over::Failed(self.observer.standstill()));
            }
            if idle > 1 {
                // Nobody has anything to do: the community's time is all that an app can be waiting for.
                std::thread::sleep(Duration::from_millis(1));
            }
        }
    }

    /// Waits a little for programs that are on the bus themselves: what they say comes when it comes, and is the same.
    fn wait_for_programs(&mut self, moved_last: &Stopwatch, limits: &Limits) -> Result<(), String> {
        if let Some(why) = self.meeting.ended() {
            return Err(why);
        }
        if moved_last.elapsed().as_secs_f64() > limits.answer_secs {
            let standstill = self.observer.standstill();
            return Err(format!("nothing came of the program for {} s: {standstill}", limits.answer_secs));
        }
        std::thread::sleep(PROGRAM_LOOK);
        Ok(())
    }

    /// Waits for the next line of a program. It is waited for once everybody else has nothing to do, and one line at a time is
    /// taken: so what comes of it does not depend on how fast it is.
    fn hear_program(
        &mut self,
        program: usize,
        limits: &Limits,
        stop: &AtomicBool,
    ) -> Result<Result<(), String>, Interrupted> {
        let Player { name, app, client } = &mut self.players[program];
        let waited = Stopwatch::start();
        while waited.elapsed().as_secs_f64() < limits.answer_secs {
            if stop.load(Ordering::Relaxed) {
                return Err(Interrupted);
            }
            match take_wake(&mut **app, client, LOOK_EVERY) {
                Ok(false) => {}
                Ok(true) if client.comms.stopping() => return Ok(Err(format!("{name} ended by itself"))),
                Ok(true) => return Ok(Ok(())),
                Err(error) => return Ok(Err(error.to_string())),
            }
        }
        let standstill = self.observer.standstill();
        Ok(Err(format!("nothing came of the program for {} s: {standstill}", limits.answer_secs)))
    }

    /// Everybody takes a turn; whether anybody had anything to do.
    fn round(&mut self, sign: &Sign) -> Result<bool, String> {
        let mut moved = false;
        for (place, Player { app, client, .. }) in self.players.iter_mut().enumerate() {
            sign.turn(place);
            moved |= take_turn(&mut **app, client).map_err(|error| error.to_string())? > 0;
            if client.comms.stopping() {
                return Err(format!("{} ended by itself", client.comms.name()));
            }
        }
        Ok(moved | self.observer.listen().map_err(|error| error.to_string())?)
    }
}

fn build(app: &AppSpec) -> Result<Box<dyn App>, String> {
    match &app.program {
        Program::Builtin(app_type, params) => {
            (app_type.build)(params).map_err(|error| format!("{}: {error}", app.name))
        }
        Program::Foreign { exec, args, via: Via::Lines } => {
            let mut command = Command::new(exec);
            command.args(args);
            let program = PipeApp::new(command, app.settings.clone(), Vec::new()).with_errors(Errors::Kept);
            Ok(Box::new(program))
        }
        Program::Foreign { .. } => Err(format!("{} is a program of its own, and no thread of this one", app.name)),
    }
}

/// Whether it is no app of this process, but a program that joins the community.
fn is_on_the_bus_itself(app: &AppSpec) -> bool {
    matches!(app.program, Program::Foreign { via: Via::Itself, .. })
}
