//! The backend as operating-system processes: `elk db`, `elk sensor`, …, or any other executable. The thin shell around
//! [`Supervisor`], which says what is to be done with them.

use std::collections::BTreeSet;
use std::io::Write;
use std::process::Command;
use std::time::Duration;

use elk_bus::child::Bond;
use elk_bus::clock::Stopwatch;
use elk_bus::{Client, Clock, Community, ConnectError, ProcessId, SUCCEED};
use elk_mission::{AppSpec, Exchange, Mission, Program, Via, element, instead};
use elk_outside::time;
use rustix::event::{PollFd, PollFlags};
use rustix::process::Pid;

use crate::backend::Backend;
use crate::backend::environment::{BrokerSetup, DB, Environment};
use crate::control::{AppRow, Order};
use crate::error::LaunchError;
use crate::process::child::Process;
use crate::process::descendants::Descendants;
use crate::process::escaped::RunId;
use crate::process::usage::{Samples, Usage};
use crate::reports::listener::Join;
use crate::reports::observer::{Losses, News};
use crate::run::folder::stamp;
use crate::run::launch_state::{AppState, LaunchState};
use crate::supervisor::{Action, BROKER, Exit, Role, STOP_PATIENCE, State, Supervisor, Ticket, UnitSpec, Word};

/// How long a broker that is only to put things away may take to answer.
const ANSWER_PATIENCE: Duration = Duration::from_secs(5);
/// How long the end of a mission waits for processes that apps had started elsewhere: they have been killed long before.
const ESCAPED_PATIENCE: Duration = Duration::from_secs(10);
/// How long nobody looks then whether there are more of them.
const ESCAPED_LOOK: Duration = Duration::from_millis(100);
/// How often it is asked.
const ASK_EVERY: Duration = Duration::from_millis(5);

/// Processes of one community.
pub(crate) struct Processes {
    environment: Environment,
    broker: BrokerSetup,
    supervisor: Supervisor,
    /// The broker's, then those of the apps, in the supervisor's order.
    slots: Vec<Slot>,
    /// Holders that were relieved and have until then to end.
    retiring: Vec<(Process, Duration)>,
    descendants: Descendants,
    /// What ended the mission, until somebody asks.
    failed: Option<LaunchError>,
    sayings: Vec<String>,
    words: Vec<(Ticket, Word)>,
    explorers: Vec<String>,
    samples: Samples,
    /// Whether they are another launcher's now.
    let_go: bool,
    clock: Stopwatch,
}

/// An app, or the broker, and the processes that hold its name or are to hold it.
#[derive(Default)]
struct Slot {
    /// `None`: the broker's.
    app: Option<AppSpec>,
    holder: Option<Process>,
    /// What the app is to be once its successor has taken over.
    wanted: Option<AppSpec>,
    successor: Option<Process>,
}

impl Processes {
    /// The backend of a mission. Nothing but the guard is started yet.
    pub fn new(mission: &Mission, environment: Environment) -> Result<Self, LaunchError> {
        Self::of_run(RunId::fresh()?, mission, environment)
    }

    fn of_run(run: RunId, mission: &Mission, environment: Environment) -> Result<Self, LaunchError> {
        let descendants = Descendants::begin(run, &environment.program, &environment.community, environment.detached)?;
        let broker = UnitSpec { urgent: true, ..UnitSpec::new(DB, "", &mission.broker) };
        let units = mission.apps.iter().map(|app| UnitSpec::new(&app.name, &app.element, &app.policy));
        let apps = mission.apps.iter().map(|app| Slot { app: Some(app.clone()), ..Slot::default() });
        let mut all = Self {
            environment,
            broker: BrokerSetup::of(mission),
            supervisor: Supervisor::new(broker, units),
            slots: std::iter::once(Slot::default()).chain(apps).collect(),
            retiring: Vec::new(),
            descendants,
            failed: None,
            sayings: Vec::new(),
            words: Vec::new(),
            explorers: Vec::new(),
            samples: Samples::default(),
            let_go: false,
            clock: Stopwatch::start(),
        };
        for app in mission.of_element(element::EXPLORER) {
            all.note_explorer(app);
        }
        Ok(all)
    }

    /// Takes over the processes that a launcher which is gone has left behind. Who has ended meanwhile is found by the
    /// next [`Backend::check`].
    pub fn adopt(mission: &Mission, environment: Environment, state: &LaunchState) -> Result<Self, LaunchError> {
        let run = state.run.clone().map_or_else(RunId::fresh, Ok)?;
        let mut all = Self::of_run(run, mission, environment)?;
        all.descendants.adopt();
        let log = all.environment.log_of(DB);
        all.explorers.clone_from(&state.explorers);
        all.slots[BROKER].holder = state.broker.and_then(|broker| Process::adopt(broker, &log));
        all.supervisor.adopt(BROKER, State::Running, Duration::ZERO);
        for (index, app) in (BROKER + 1..).zip(&state.apps) {
            all.adopt_app(index, app);
        }
        Ok(all)
    }

    fn adopt_app(&mut self, index: usize, app: &AppState) {
        let log = self.environment.log_of(&app.name);
        let adopt = |process: Option<ProcessId>| Process::adopt(process?, &log);
        // In the midst of a swap there may be two; who has the name goes on.
        let (holder, successor) = (adopt(app.process), adopt(app.successor));
        let holder = match (holder, successor) {
            (Some(holder), Some(mut successor)) => {
                successor.kill_and_wait();
                Some(holder)
            }
            (holder, successor) => holder.or(successor),
        };
        let unit = &mut self.supervisor.units[index];
        unit.restarts = app.restarts;
        unit.swaps = app.swaps;
        unit.last_exit.clone_from(&app.last_exit);
        let state = if app.idle && holder.is_none() { State::Stopped } else { State::Running };
        self.slots[index].holder = holder;
        self.supervisor.adopt(index, state, Duration::ZERO);
    }

    fn now(&self) -> Duration {
        self.clock.elapsed()
    }

    /// Sees who has ended, lets time pass, and does what is to be done, until nothing is.
    fn work(&mut self) {
        self.reap();
        let now = self.now();
        self.supervisor.tick(now);
        loop {
            let actions = self.supervisor.take_actions();
            if actions.is_empty() {
                break;
            }
            for action in actions {
                self.act(action);
            }
        }
    }

    fn reap(&mut self) {
        let now = self.now();
        for index in 0..self.slots.len() {
            for role in [Role::Holder, Role::Successor] {
                let exit = self.reap_one(index, role);
                if let Some(exit) = exit {
                    self.supervisor.ended(index, role, exit, now);
                    // What follows from one's end is done before the next one's is looked at.
                    self.act_all();
                }
            }
        }
        let descendants = &mut self.descendants;
        self.retiring.retain_mut(|(process, until)| {
            if *until <= now {
                process.kill();
            }
            let ended = process.ended().is_some();
            if ended {
                descendants.ended(process.pid(), now);
            }
            !ended
        });
        let processes = self.slots.iter().flat_map(Slot::processes).map(Process::pid);
        self.samples.take(now, processes);
        let apps = self.started();
        self.descendants.reap(now, &apps);
    }

    /// Sees who descends from whom before anybody ends: afterwards it cannot be told any more.
    fn look_for_escaped(&mut self) {
        let (now, apps) = (self.now(), self.started());
        self.descendants.look_now(now, &apps);
    }

    /// The processes that were started and not waited for.
    fn started(&self) -> Vec<Pid> {
        let retiring = self.retiring.iter().map(|(process, _)| process);
        self.slots.iter().flat_map(Slot::processes).chain(retiring).map(Process::pid).collect()
    }

    fn act_all(&mut self) {
        for action in self.supervisor.take_actions() {
            self.act(action);
        }
    }

    fn reap_one(&mut self, index: usize, role: Role) -> Option<Exit> {
        let slot = &mut self.slots[index];
        let process = match role {
            Role::Holder => &mut slot.holder,
            Role::Successor => &mut slot.successor,
        };
        // Of whom there was word, and who was gone when it was read.
        if process.is_none() && role == Role::Holder && self.supervisor.units[index].state == State::Running {
            let fine = self.supervisor.units[index].spec.may_finish;
            return Some(Exit { how: "while there was no launcher".to_owned(), fine, ..Exit::default() });
        }
        let exit = process.as_mut()?.ended()?.clone();
        let process = process.take()?;
        self.descendants.ended(process.pid(), self.clock.elapsed());
        // Nobody knows how a stranger ended: that it did may be all right.
        let fine = exit.fine || (process.is_adopted() && self.supervisor.units[index].spec.may_finish);
        Some(Exit { fine, ..exit })
    }

    fn act(&mut self, action: Action) {
        match action {
            Action::Start(index, role) => {
                if let Err(error) = self.start(index, role) {
                    let now = self.now();
                    self.supervisor.not_started(index, role, error, now);
                }
            }
            Action::Ask(index) => self.slots[index].holder.iter().for_each(Process::ask),
            Action::Kill(index) => self.slots[index].holder.iter().for_each(Process::kill),
            Action::Discard(index) => self.discard(index),
            Action::TakeOver(index) => self.take_over(index),
            Action::Exchange(index) => self.exchange_names(index),
            Action::Say(words) => self.sayings.push(words),
            Action::Tell(ticket, word) => self.words.push((ticket, word)),
            // The first failure is the one that explains the others.
            Action::Fail(error) => self.failed = self.failed.take().or(Some(error)),
        }
    }

    fn start(&mut self, index: usize, role: Role) -> Result<(), LaunchError> {
        let slot = &self.slots[index];
        let app = match role {
            Role::Holder => &slot.app,
            Role::Successor => &slot.wanted,
        };
        let (name, mut command) = match app {
            None => (DB.to_owned(), self.environment.broker_command(&self.broker)),
            Some(app) => (app.name.clone(), self.environment.app_command(app, &self.broker)?),
        };
        if role == Role::Successor {
            command.env(SUCCEED, "1");
        }
        let process = self.spawn(&name, command)?;
        let slot = &mut self.slots[index];
        match role {
            Role::Holder => slot.holder = Some(process),
            Role::Successor => slot.successor = Some(process),
        }
        Ok(())
    }

    fn spawn(&mut self, name: &str, mut command: Command) -> Result<Process, LaunchError> {
        self.descendants.mark(&mut command);
        let log = self.environment.log_of(name);
        if log.metadata().is_ok_and(|found| found.len() > 0)
            && let Ok(mut file) = std::fs::OpenOptions::new().append(true).open(&log)
        {
            // A log without the line is no reason not to start.
            let _ = writeln!(file, "--- a new process of {name}, {} UTC ---", stamp(Clock::new(1.0).now()));
        }
        let bond = if self.environment.detached { Bond::None } else { Bond::Parent };
        let process = Process::spawn(name, command, &log, bond)?;
        self.descendants.watch(process.pid());
        Ok(process)
    }

    fn discard(&mut self, index: usize) {
        let slot = &mut self.slots[index];
        slot.wanted = None;
        if let Some(mut successor) = slot.successor.take() {
            successor.kill_and_wait();
            self.descendants.forget(successor.pid());
        }
    }

    fn take_over(&mut self, index: usize) {
        let until = self.now() + STOP_PATIENCE;
        let slot = &mut self.slots[index];
        let successor = slot.successor.take();
        let relieved = std::mem::replace(&mut slot.holder, successor);
        self.retiring.extend(relieved.map(|process| (process, until)));
        if let Some(app) = slot.wanted.take() {
            self.note_explorer(&app);
            self.slots[index].app = Some(app);
        }
    }

    /// Whoever is started next under the name is the other one of the two.
    fn exchange_names(&mut self, index: usize) {
        let slot = &mut self.slots[index];
        std::mem::swap(&mut slot.app, &mut slot.wanted);
        if let Some(app) = slot.app.clone() {
            self.note_explorer(&app);
        }
    }

    fn note_explorer(&mut self, app: &AppSpec) {
        let what = match &app.program {
            Program::Builtin(app_type, _) => app_type.name.to_owned(),
            Program::Foreign { exec, args, via } => {
                let exec = exec.file_name().unwrap_or_default().to_string_lossy().into_owned();
                // Of a language the script is what matters.
                if *via == Via::Lines { [&[exec], &args[..]].concat().join(" ") } else { exec }
            }
        };
        if app.element == element::EXPLORER && !self.explorers.contains(&what) {
            self.explorers.push(what);
        }
    }

    /// What an app is to be exchanged for, checked; and what is dropped of it.
    fn exchange(&self, index: usize, wanted: &Exchange) -> Result<(AppSpec, Vec<String>), LaunchError> {
        let Some(app) = &self.slots[index].app else { return Err(LaunchError::Stopped) };
        let apps: Vec<AppSpec> = self.slots.iter().filter_map(|slot| slot.app.clone()).collect();
        let mut exchanged = app.exchange_among(&apps, wanted, &self.environment.registry)?;
        self.environment.files.settle(&mut exchanged.app)?;
        Ok((exchanged.app, exchanged.dropped))
    }

    fn swap(&mut self, ticket: Ticket, index: usize, wanted: &Exchange, limit: Duration) {
        if let Some(refusal) = self.supervisor.refusal(index) {
            return self.words.push((ticket, Word::Failed(refusal)));
        }
        match self.exchange(index, wanted) {
            Err(error) => self.words.push((ticket, Word::Failed(error.to_string()))),
            Ok((app, dropped)) => {
                if !dropped.is_empty() {
                    let said = format!("{} has no word for {}: dropped", app.type_name(), dropped.join(", "));
                    self.words.push((ticket, Word::Progress(said)));
                }
                let slot = &mut self.slots[index];
                let alone = app.is_moos() || slot.app.as_ref().is_some_and(AppSpec::is_moos);
                slot.wanted = Some(app);
                let now = self.now();
                self.supervisor.order_swap(ticket, index, limit, alone, now);
            }
        }
    }

    /// Whether it ended in good order, as far as anybody can see.
    fn stop_this_broker(&mut self) -> bool {
        let Some(mut broker) = self.slots[BROKER].holder.take() else { return false };
        let (adopted, log) = (broker.is_adopted(), broker.log.display().to_string());
        let (exit, killed) = broker.stop(STOP_PATIENCE);
        let fine = adopted || exit.is_some_and(|exit| exit.fine);
        if killed {
            let secs = STOP_PATIENCE.as_secs();
            self.sayings.push(format!("{DB} did not stop within {secs} s and was killed; see {log}"));
        } else if let Some(exit) = exit.filter(|_| !fine) {
            self.sayings.push(format!("{DB} ended: {}; see {log}", exit.how));
        }
        self.descendants.forget(broker.pid());
        fine && !killed
    }

    /// Waits until the broker that was just started answers; whether it does.
    fn broker_answers(&mut self) -> bool {
        let clock = Stopwatch::start();
        while clock.elapsed() < ANSWER_PATIENCE {
            if Client::connect(&self.environment.community, crate::reports::NAME).is_ok() {
                return true;
            }
            if self.slots[BROKER].holder.as_mut().is_none_or(|broker| broker.ended().is_some()) {
                return false;
            }
            std::thread::sleep(ASK_EVERY);
        }
        false
    }

    fn row(&self, index: usize, losses: &Losses) -> AppRow {
        let (slot, unit, now) = (&self.slots[index], &self.supervisor.units[index], self.now());
        let pid = slot.holder.as_ref().map(Process::pid);
        let usage = pid.and_then(Usage::of);
        let type_name = slot.app.as_ref().map_or("broker", AppSpec::type_name);
        AppRow {
            name: unit.spec.name.clone(),
            element: unit.spec.element.clone(),
            type_name: type_name.to_owned(),
            pid: pid.map(|pid| pid.as_raw_nonzero().get()),
            state: unit.state.word().to_owned(),
            state_secs: now.saturating_sub(unit.since).as_secs_f64(),
            cpu_percent: usage.and_then(|usage| usage.cpu_percent()),
            cpu_percent_now: pid.zip(usage).and_then(|(pid, usage)| self.samples.cpu_percent(pid, &usage, now)),
            resident_bytes: usage.map(|usage| usage.resident),
            dropped: losses.dropped.get(&unit.spec.name).copied(),
            rejected: losses.rejected.get(&unit.spec.name).copied(),
            restarts: unit.restarts,
            swaps: unit.swaps,
            last_exit: unit.last_exit.clone(),
        }
    }

    fn note_app(&self, index: usize, state: &mut AppState) {
        let (slot, unit) = (&self.slots[index], &self.supervisor.units[index]);
        if let Some(app) = &slot.app {
            *state = AppState::of(app);
        }
        state.idle = matches!(unit.state, State::Idle | State::Stopping { .. } | State::Stopped | State::Over);
        state.process = slot.holder.as_ref().and_then(Process::id);
        state.successor = slot.successor.as_ref().and_then(Process::id);
        state.restarts = unit.restarts;
        state.swaps = unit.swaps;
        state.last_exit.clone_from(&unit.last_exit);
    }
}

impl Slot {
    fn processes(&self) -> impl Iterator<Item = &Process> {
        self.holder.iter().chain(&self.successor)
    }
}

impl Backend for Processes {
    fn join(&self, name: &str) -> Join {
        let (community, name) = (self.environment.community.clone(), name.to_owned());
        Box::new(move || Client::connect(&community, &name))
    }

    fn start_broker(&mut self) -> Result<(), LaunchError> {
        free_of_brokers(&self.environment.community)?;
        let now = self.now();
        self.supervisor.start(BROKER, now);
        self.check("at once")
    }

    fn start_apps(&mut self, which: &dyn Fn(&str, &str) -> bool) -> Result<(), LaunchError> {
        let now = self.now();
        for index in BROKER + 1..self.slots.len() {
            let UnitSpec { element, name, .. } = &self.supervisor.units[index].spec;
            if which(element, name) {
                self.supervisor.start(index, now);
            }
        }
        self.check("before it registered")
    }

    fn all_over(&self) -> bool {
        let mut apps =
            self.supervisor.units.iter().skip(BROKER + 1).filter(|unit| unit.spec.element != element::LOGGER);
        apps.all(|unit| unit.state == State::Over)
    }

    fn missing(&self, _: &BTreeSet<String>) -> Vec<String> {
        let apps = self.supervisor.units.iter().skip(BROKER + 1);
        let coming = apps.filter(|unit| matches!(unit.state, State::Starting | State::Waiting { .. }));
        coming.map(|unit| unit.spec.name.clone()).collect()
    }

    fn hear(&mut self, news: &[News], signs: &BTreeSet<String>) {
        // Who has ended did so before whatever is heard now of that name.
        self.reap();
        let now = self.now();
        for name in signs {
            self.supervisor.sign(name, now);
        }
        for one in news {
            match one {
                News::Joined => self.supervisor.broker_answers(now),
                News::Arrived(name) => self.supervisor.arrived(name, now),
                News::Ready(name) => self.supervisor.ready(name, now),
                News::HandedOver(name, gap_ms) => self.supervisor.handed_over(name, *gap_ms, now),
                News::Report => {}
            }
            self.act_all();
        }
    }

    fn check(&mut self, when: &'static str) -> Result<(), LaunchError> {
        self.supervisor.when = when;
        self.work();
        self.failed.take().map_or(Ok(()), Err)
    }

    fn watch<'a>(&'a self, watched: &mut Vec<PollFd<'a>>) {
        let retiring = self.retiring.iter().map(|(process, _)| process);
        let all = self.slots.iter().flat_map(Slot::processes).chain(retiring);
        watched.extend(all.map(|process| PollFd::from_borrowed_fd(process.handle(), PollFlags::IN)));
    }

    fn patience(&self) -> Option<Duration> {
        let deadlines = self.supervisor.deadline().into_iter().chain(self.descendants.deadline());
        Some(deadlines.min()?.saturating_sub(self.now()))
    }

    fn sayings(&mut self) -> Vec<String> {
        std::mem::take(&mut self.sayings)
    }

    fn order(&mut self, ticket: Ticket, order: Order) {
        let (Order::Stop { app } | Order::Start { app, .. } | Order::Swap { app, .. }) = &order else {
            return;
        };
        let Some(index) = self.supervisor.index_of(app) else {
            let known: Vec<&str> = self.supervisor.units[1..].iter().map(|unit| unit.spec.name.as_str()).collect();
            let right = instead(app, &known);
            return self.words.push((ticket, Word::Failed(format!("the mission has no app {app}; {right}"))));
        };
        let now = self.now();
        match order {
            Order::Stop { .. } => self.supervisor.order_stop(ticket, index, now),
            Order::Start { limit_secs, .. } => {
                self.supervisor.order_start(ticket, index, time::duration(limit_secs), now);
            }
            Order::Swap { type_name, exec, via, params, folder, limit_secs, .. } => {
                let wanted = Exchange { type_name, exec, via, params, folder };
                self.swap(ticket, index, &wanted, time::duration(limit_secs));
            }
            Order::Apps | Order::Mission | Order::Pause | Order::Resume | Order::Step | Order::Leave => {}
        }
        self.act_all();
    }

    fn words(&mut self) -> Vec<(Ticket, Word)> {
        std::mem::take(&mut self.words)
    }

    fn rows(&mut self, losses: &Losses) -> Vec<AppRow> {
        (0..self.slots.len()).map(|index| self.row(index, losses)).collect()
    }

    fn note_state(&self, state: &mut LaunchState) -> bool {
        state.broker = self.slots[BROKER].holder.as_ref().and_then(Process::id);
        state.run = Some(self.descendants.run().clone());
        state.explorers.clone_from(&self.explorers);
        for (index, app) in (BROKER + 1..).zip(&mut state.apps) {
            self.note_app(index, app);
        }
        self.environment.detached
    }

    fn explorers(&self) -> Vec<String> {
        self.explorers.clone()
    }

    fn swapped(&self) -> Vec<String> {
        let swapped = self.supervisor.units.iter().filter(|unit| unit.swaps > 0);
        swapped.map(|unit| unit.spec.name.clone()).collect()
    }

    fn let_go(&mut self) {
        self.let_go = true;
    }

    fn end_apps(&mut self) {
        self.look_for_escaped();
        let now = self.now();
        self.supervisor.end(now);
        self.work();
    }

    fn ended(&self) -> bool {
        self.supervisor.all_ended() && self.retiring.is_empty()
    }

    fn end_escaped(&mut self) {
        let clock = Stopwatch::start();
        loop {
            // The children of one that has ended just now are the launcher's.
            self.look_for_escaped();
            if self.descendants.end_escaped(self.now()) {
                return;
            }
            if clock.elapsed() > ESCAPED_PATIENCE {
                return self.sayings.push("processes that apps had started elsewhere could not be ended".to_owned());
            }
            self.descendants.wait(self.now(), ESCAPED_LOOK);
        }
    }

    fn stop_broker(&mut self) {
        // What a broker that died could not put away, the next one does.
        if !self.stop_this_broker() && self.start(BROKER, Role::Holder).is_ok() && self.broker_answers() {
            self.stop_this_broker();
        }
    }
}

/// Whoever leaves early, by an error or a panic, leaves nobody behind.
impl Drop for Processes {
    fn drop(&mut self) {
        if self.let_go {
            return;
        }
        self.look_for_escaped();
        let slots = self.slots.iter_mut().rev();
        for process in slots.flat_map(|slot| slot.successor.take().into_iter().chain(slot.holder.take())) {
            let mut process = process;
            process.stop(STOP_PATIENCE);
        }
        for (process, _) in &mut self.retiring {
            process.stop(STOP_PATIENCE);
        }
        self.end_escaped();
    }
}

/// Another broker of the same community would make ours end, or be taken for it.
fn free_of_brokers(community: &Community) -> Result<(), LaunchError> {
    match Client::connect(community, crate::reports::NAME) {
        Err(ConnectError::NoBroker(_)) => Ok(()),
        Err(error @ ConnectError::ForeignUser { .. }) => Err(error.into()),
        Ok(_) | Err(_) => Err(LaunchError::Served(community.clone())),
    }
}
