//! One run of a mission, from the start of its broker to the end of its last app.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use elk_bus::clock::Stopwatch;
use elk_bus::{Community, ConnectError};
use elk_mission::Mission;
use elk_mission::element::{self, ELEMENTS};
use elk_mission::variables::LAUNCH_STATE;
use elk_outside::time;
use elk_spatial::keys::{MAP_REQUEST, MOTION, STEP};
use rustix::event::{PollFd, Timespec, poll};
use rustix::process::getpid;

use crate::backend::Backend;
use crate::control::{Answer, AppRow, Order, Server};
use crate::error::LaunchError;
use crate::process::usage::Usage;
use crate::reports::listener::Listener;
use crate::reports::observer::News;
use crate::run::launch_state::LaunchState;
use crate::supervisor::{State, Ticket, Word};
use crate::terminal::keyboard::{self, Keyboard};
use crate::terminal::progress::Display;

/// How long the broker may take to answer.
const BROKER_PATIENCE: Duration = Duration::from_secs(20);
/// How long apps may take to register: they load worlds first.
const REGISTER_PATIENCE: Duration = Duration::from_secs(60);
/// How long the sensor may take to hold the final map against the true world.
const EVALUATION_PATIENCE: Duration = Duration::from_secs(60);
/// How long a step may take, of which everybody says that they are well, before the mission counts as stuck: far longer
/// than any explorer thinks.
const STEP_PATIENCE: Duration = Duration::from_secs(300);
/// When somebody ends who is asked to.
const ENDING: &str = "while the mission ended";
/// How long nobody is looked at if nothing happens.
const LOOK: Duration = Duration::from_millis(100);

/// One run of a mission, as its launcher sees it.
pub(crate) struct MissionRun<'a> {
    pub mission: &'a Mission,
    pub backend: &'a mut dyn Backend,
    pub listener: &'a mut Listener,
    pub server: Option<Server>,
    pub display: Display,
    pub keyboard: Keyboard,
    pub stop: &'a AtomicBool,
    pub community: &'a Community,
    /// Where the apps' text logs are.
    pub folder: &'a Path,
    /// What another launcher would have to know.
    pub state: LaunchState,
    /// That, as it was last said to a broker that still has it.
    pub said_state: Option<LaunchState>,
    /// Whether nobody sits at this launcher: it makes room for one at whom somebody does.
    pub background: bool,
    /// Who is to be told that it has made room.
    pub leaves: Option<Ticket>,
    pub running: Stopwatch,
}

/// The time of the last message of a step (s, the community's), and since when that is the last one.
struct Movement {
    last: Option<f64>,
    since: Stopwatch,
}

impl MissionRun<'_> {
    /// Starts broker and apps.
    pub fn begin(&mut self) -> Result<(), LaunchError> {
        self.backend.start_broker()?;
        self.join("at once")?;
        let ranks: BTreeSet<u8> = ELEMENTS.iter().map(|element| element.start_rank).collect();
        let is_of = |element: &str, rank| element::named(element).is_some_and(|element| element.start_rank == rank);
        let is_paced = self.mission.launch_pause_secs > 0.0;
        let at_once = |element: &str| !(is_paced && element == element::APP);
        ranks.into_iter().try_for_each(|rank| self.start(&|element, _| is_of(element, rank) && at_once(element)))?;
        self.start_paced()
    }

    /// Waits until the launcher itself is on the bus.
    pub fn join(&mut self, when: &'static str) -> Result<(), LaunchError> {
        let clock = Stopwatch::start();
        while self.listener.observer().clients.is_empty() {
            self.look(when)?;
            if let Some(error) = self.listener.take_failure() {
                return Err(error.into());
            }
            if clock.elapsed() > BROKER_PATIENCE {
                return Err(ConnectError::NoBroker(self.community.clone()).into());
            }
        }
        Ok(())
    }

    fn start(&mut self, which: &dyn Fn(&str, &str) -> bool) -> Result<(), LaunchError> {
        self.backend.start_apps(which)?;
        self.gather("before it registered")
    }

    /// Starts the apps that wait for each other, in their order.
    fn start_paced(&mut self) -> Result<(), LaunchError> {
        let (mission, pause) = (self.mission, self.mission.launch_pause_secs);
        for (count, app) in mission.of_element(element::APP).filter(|_| pause > 0.0).enumerate() {
            let clock = Stopwatch::start();
            while count > 0 && clock.elapsed() < time::duration(pause) {
                self.look("before it registered")?;
            }
            self.backend.start_apps(&|_, name| name == app.name)?;
        }
        self.gather("before it registered")
    }

    /// Waits until everyone who was started, or is started again, is on the bus.
    fn gather(&mut self, when: &'static str) -> Result<(), LaunchError> {
        let clock = Stopwatch::start();
        loop {
            self.look(when)?;
            let missing = self.backend.missing(&self.listener.observer().clients);
            if missing.is_empty() {
                return Ok(());
            }
            if clock.elapsed() > REGISTER_PATIENCE {
                let (secs, folder) = (REGISTER_PATIENCE.as_secs(), self.folder.to_owned());
                return Err(LaunchError::NotRegistered { apps: missing, secs, folder });
            }
        }
    }

    /// Waits until exploration is over, has the final map evaluated, and sees that everyone is there for the end.
    pub fn explore(&mut self) -> Result<(), LaunchError> {
        if self.state.manual && self.background {
            self.display.put("`elk step` takes a step; `elk resume` runs on");
        } else if self.state.manual {
            let words = "Enter takes a step, and so does `elk step`; `elk resume` runs on, Ctrl-C ends the mission.";
            self.display.put(words);
        }
        if !self.mission.explores() {
            return self.accompany();
        }
        let mut movement = Movement { last: None, since: Stopwatch::start() };
        while !self.listener.observer().finished() {
            self.look("before the mission was over")?;
            self.step_by_hand();
            self.see_movement(&mut movement)?;
        }
        self.evaluate_map()?;
        // Whoever died in the last moment has yet to do what it does at the end.
        self.gather("before the mission was over")
    }

    /// Waits until all apps of a mission that does not explore have ended of their own accord.
    fn accompany(&mut self) -> Result<(), LaunchError> {
        while !self.backend.all_over() {
            self.look("before the mission was over")?;
        }
        Ok(())
    }

    /// A mission that has begun and in which nothing moves any more is stuck, unless somebody holds it: who has paused it
    /// or stopped an app will go on.
    fn see_movement(&mut self, movement: &mut Movement) -> Result<(), LaunchError> {
        let last = self.listener.observer().steps.last();
        if last != movement.last || last.is_none() || self.state.paused {
            *movement = Movement { last, since: Stopwatch::start() };
        }
        if movement.since.elapsed() < STEP_PATIENCE {
            return Ok(());
        }
        if self.rows().iter().any(|row| ![State::Running, State::Over].map(State::word).contains(&row.state.as_str())) {
            movement.since = Stopwatch::start();
            return Ok(());
        }
        let (last_word, rejection) = self.listener.observer().last_words();
        let (secs, folder) = (STEP_PATIENCE.as_secs(), self.folder.to_owned());
        Err(LaunchError::Standstill { secs, last_word, rejection, folder })
    }

    /// Asks for the whole map, and waits until the sensor has held it against the true world. A sensor that does not
    /// know the true world says nothing, and that is no failure.
    fn evaluate_map(&mut self) -> Result<(), LaunchError> {
        self.listener.say(MAP_REQUEST, 1.0);
        let clock = Stopwatch::start();
        while !self.listener.observer().is_evaluated() && clock.elapsed() < EVALUATION_PATIENCE {
            self.look("before the map was evaluated")?;
        }
        Ok(())
    }

    /// Ends the apps, then leaves the bus, then ends the broker. `reason` is why the mission ended before its time, if it
    /// did. Answers that, or else the first thing that somebody could not do at the end: it is told with the summary, and
    /// all others are told here.
    pub fn end(&mut self, mut reason: Option<LaunchError>) -> Option<LaunchError> {
        self.display.close();
        self.background = false;
        if let Some(ticket) = self.leaves.take() {
            self.tell(ticket, Word::Failed("the mission is at its end".to_owned()));
        }
        self.backend.end_apps();
        let checked = self.backend.check(ENDING);
        self.note_failure(checked, &mut reason);
        while !self.backend.ended() {
            let checked = self.round(ENDING);
            self.note_failure(checked, &mut reason);
        }
        self.backend.end_escaped();
        // Nobody is on the bus any more when the broker goes.
        self.listener.leave();
        while !self.listener.has_left() {
            let checked = self.round(ENDING);
            self.note_failure(checked, &mut reason);
        }
        self.backend.stop_broker();
        self.pass_words_on();
        if let Some(server) = &mut self.server {
            server.finish();
        }
        reason
    }

    fn note_failure(&self, checked: Result<(), LaunchError>, reason: &mut Option<LaunchError>) {
        match (checked, &reason) {
            (Ok(()), _) => {}
            (Err(error), None) => *reason = Some(error),
            (Err(error), Some(_)) => self.display.say(&error.to_string()),
        }
    }

    /// Hears what there is to hear, sees that everyone is alive, and that nobody wants to stop.
    fn look(&mut self, when: &'static str) -> Result<(), LaunchError> {
        let checked = self.round(when);
        if keyboard::stopped(self.stop) {
            return Err(LaunchError::Stopped);
        }
        checked
    }

    /// Waits until something happens, and deals with it.
    fn round(&mut self, when: &'static str) -> Result<(), LaunchError> {
        self.wait();
        self.listener.hush();
        let (news, signs) = {
            let mut observer = self.listener.observer();
            (std::mem::take(&mut observer.news), std::mem::take(&mut observer.signs))
        };
        if news.contains(&News::Joined) {
            self.introduce();
        }
        self.backend.hear(&news, &signs);
        let checked = self.backend.check(when);
        self.serve();
        self.leave_word();
        // Whoever hears that an order is carried out may end the launcher: the word of it has to be left by then.
        if self.listener.has_said_all() {
            self.pass_words_on();
        }
        self.display.show(&self.listener.observer(), self.state.paused);
        match self.leaves {
            Some(_) if self.listener.has_said_all() => checked.and(Err(LaunchError::Relieved)),
            _ => checked,
        }
    }

    /// Leaves the mission, as it runs, to another launcher.
    pub fn hand_over(&mut self) {
        self.backend.let_go();
        self.listener.leave();
        if let Some(ticket) = self.leaves.take() {
            self.tell(ticket, Word::Done("the mission is yours".to_owned()));
        }
        if let Some(server) = &mut self.server {
            server.finish();
        }
    }

    /// Says how things are to a broker that may not know.
    fn introduce(&mut self) {
        self.said_state = None;
        if self.state.paused {
            self.listener.say(MOTION, motion(true));
        }
    }

    fn wait(&self) {
        let mut watched = vec![PollFd::from_borrowed_fd(self.listener.bell(), rustix::event::PollFlags::IN)];
        self.backend.watch(&mut watched);
        if let Some(server) = &self.server {
            server.watch(&mut watched);
        }
        if self.state.manual {
            self.keyboard.watch(&mut watched);
        }
        let patience = self.backend.patience().map_or(LOOK, |patience| patience.min(LOOK));
        // A timeout, a signal or an event: all of them are reasons to look.
        let _ = poll(&mut watched, Timespec::try_from(patience).ok().as_ref());
    }

    fn step_by_hand(&mut self) {
        if !self.state.manual {
            return;
        }
        for _ in 0..self.keyboard.enters() {
            if self.state.paused {
                self.listener.say(STEP, 1.0);
            }
        }
        if self.keyboard.left() {
            self.display.say("nobody can press Enter here: `elk step` takes a step, `elk resume` runs on");
        }
    }

    /// Takes questions, and answers those that need no app.
    fn serve(&mut self) {
        let questions = self.server.as_mut().map(Server::questions).unwrap_or_default();
        for (ticket, question) in questions {
            let word = match question {
                Order::Apps => {
                    let rows = self.rows();
                    self.answer(ticket, &Answer::Apps { rows });
                    continue;
                }
                Order::Mission => {
                    let answer = self.mission();
                    self.answer(ticket, &answer);
                    continue;
                }
                Order::Pause => self.pause(true),
                Order::Resume => self.pause(false),
                Order::Step => self.step(),
                Order::Leave if self.background => {
                    if let Some(earlier) = self.leaves.replace(ticket) {
                        self.tell(earlier, Word::Failed("another launcher takes it over".to_owned()));
                    }
                    continue;
                }
                Order::Leave => Word::Failed("somebody sits at this mission's launcher".to_owned()),
                order => {
                    self.backend.order(ticket, order);
                    continue;
                }
            };
            self.tell(ticket, word);
        }
    }

    fn pause(&mut self, pause: bool) -> Word {
        if self.state.paused == pause {
            let word = if pause { "paused" } else { "running" };
            return Word::Failed(format!("the mission is {word} already"));
        }
        self.state.paused = pause;
        self.listener.say(MOTION, motion(pause));
        Word::Done(if pause { "paused: the robot stands before its next pose" } else { "resumed" }.to_owned())
    }

    fn step(&mut self) -> Word {
        if !self.state.paused {
            return Word::Failed("the mission is not paused: `elk pause` does that first".to_owned());
        }
        self.listener.say(STEP, 1.0);
        Word::Done("one step".to_owned())
    }

    fn mission(&mut self) -> Answer {
        self.backend.note_state(&mut self.state);
        // What is said to one need not be said to all.
        match self.state.clone().next_text() {
            Ok(text) => Answer::Mission { text },
            Err(error) => Answer::Failed { text: error.to_string() },
        }
    }

    fn rows(&mut self) -> Vec<AppRow> {
        let losses = self.listener.observer().losses.clone();
        let mut rows = vec![launcher_row(self.running, losses.dropped.get(crate::reports::NAME).copied())];
        rows.extend(self.backend.rows(&losses));
        rows
    }

    /// Tells everybody what they are to be told.
    fn pass_words_on(&mut self) {
        for saying in self.backend.sayings() {
            self.display.say(&saying);
        }
        for (ticket, word) in self.backend.words() {
            self.tell(ticket, word);
        }
    }

    fn tell(&mut self, ticket: Ticket, word: Word) {
        let answer = match word {
            Word::Progress(text) => Answer::Progress { text },
            Word::Done(text) => Answer::Done { text },
            Word::Failed(text) => Answer::Failed { text },
        };
        self.answer(ticket, &answer);
    }

    fn answer(&mut self, ticket: Ticket, answer: &Answer) {
        if let Some(server) = &mut self.server {
            server.answer(ticket, answer);
        }
    }

    /// Leaves word of the mission, for a launcher that may have to pick it up, whenever it has changed.
    fn leave_word(&mut self) {
        self.state.first_command = self.listener.observer().first_command;
        if !self.backend.note_state(&mut self.state) || self.said_state.as_ref() == Some(&self.state) {
            return;
        }
        let kept = self.state.next_text().and_then(|text| {
            self.listener.say(LAUNCH_STATE, text.as_str());
            LaunchState::keep(self.community, &text)
        });
        if let Err(error) = kept {
            self.display.say(&error.to_string());
        }
        self.said_state = Some(self.state.clone());
    }
}

fn motion(paused: bool) -> &'static str {
    if paused { "pause" } else { "run" }
}

fn launcher_row(running: Stopwatch, dropped: Option<u64>) -> AppRow {
    let usage = Usage::of(getpid());
    AppRow {
        name: crate::reports::NAME.to_owned(),
        element: String::new(),
        type_name: "launcher".to_owned(),
        pid: Some(getpid().as_raw_nonzero().get()),
        state: State::Running.word().to_owned(),
        state_secs: running.elapsed().as_secs_f64(),
        cpu_percent: usage.and_then(|usage| usage.cpu_percent()),
        cpu_percent_now: None,
        resident_bytes: usage.map(|usage| usage.resident),
        dropped,
        rejected: None,
        restarts: 0,
        swaps: 0,
        last_exit: None,
    }
}
