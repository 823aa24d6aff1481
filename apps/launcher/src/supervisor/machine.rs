//! The state machine: all units of a mission, what happens to them, and what follows.

#[cfg(test)]
mod tests;

use std::collections::VecDeque;
use std::time::Duration;

use super::order::stop_order;
use super::unit::{Phase, State, Swap, Unit, UnitSpec};
use super::words::{Action, Exit, Role, Ticket, Word};
use crate::error::LaunchError;

/// How long anyone may take to end after SIGTERM: the map and the log are written then.
pub(crate) const STOP_PATIENCE: Duration = Duration::from_secs(20);
/// How long an app that was started again may take to register.
const REGISTER_PATIENCE: Duration = Duration::from_secs(60);
/// How long a holder may take to leave once its successor is ready.
const RETIRE_PATIENCE: Duration = Duration::from_secs(5);
/// How long a swap waits for the measured gap once the successor has taken over: it may have no mail to handle.
const GAP_PATIENCE: Duration = Duration::from_secs(1);
/// How long nobody at all may be heard before silence says nothing about anybody: the broker itself speaks every 2 s.
const DEAF_AFTER: Duration = Duration::from_secs(5);

/// How long an app that found no broker waits before it tries again.
const OUTAGE_PAUSE: Duration = Duration::from_millis(100);

/// What is to be said of a program that ends well without having been an app.
const NO_APP: &str =
    "as a program does that is no app: right is one that joins the bus and stays (`elk new` makes one)";

/// All units of a mission. The broker is the first.
#[derive(Debug)]
pub(crate) struct Supervisor {
    pub units: Vec<Unit>,
    /// How far the mission is, for messages about an app's end: `before the mission was over`.
    pub when: &'static str,
    actions: Vec<Action>,
    /// Who has yet to end, once the mission ends.
    ending: Option<VecDeque<usize>>,
    /// When anybody was last heard.
    heard: Duration,
}

/// How long a swapped app was missed.
enum Gap {
    /// So many milliseconds lay between the last message of the old one and the first of the new one.
    Mail(f64),
    /// Nobody has said.
    Unknown,
    /// The name was nobody's for so long.
    Nobody(Duration),
}

/// The broker's index.
pub(crate) const BROKER: usize = 0;

impl Supervisor {
    /// A broker and apps, none of them started.
    pub fn new(broker: UnitSpec, apps: impl IntoIterator<Item = UnitSpec>) -> Self {
        let units = std::iter::once(broker).chain(apps).map(Unit::new).collect();
        Self { units, when: "at once", actions: Vec::new(), ending: None, heard: Duration::ZERO }
    }

    /// What is to be done; each thing once.
    pub fn take_actions(&mut self) -> Vec<Action> {
        std::mem::take(&mut self.actions)
    }

    /// The index of the app or broker of this name.
    pub fn index_of(&self, name: &str) -> Option<usize> {
        self.units.iter().position(|unit| unit.spec.name == name)
    }

    fn say(&mut self, words: String) {
        self.actions.push(Action::Say(words));
    }

    fn tell(&mut self, ticket: Option<Ticket>, word: Word) {
        self.actions.extend(ticket.map(|ticket| Action::Tell(ticket, word)));
    }

    fn enter(&mut self, index: usize, state: State, now: Duration) {
        let unit = &mut self.units[index];
        unit.state = state;
        unit.since = now;
        unit.sign = now;
    }

    /// Starts a unit for the first time.
    pub fn start(&mut self, index: usize, now: Duration) {
        self.enter(index, State::Starting, now);
        self.actions.push(Action::Start(index, Role::Holder));
    }

    /// A unit is taken over from a launcher that is gone.
    pub fn adopt(&mut self, index: usize, state: State, now: Duration) {
        self.enter(index, state, now);
        self.units[index].registered = true;
    }

    /// A process could not be started.
    pub fn not_started(&mut self, index: usize, role: Role, error: LaunchError, now: Duration) {
        let unit = &self.units[index];
        match role {
            Role::Successor => self.fail_swap(index, error.to_string()),
            Role::Holder if unit.registered || unit.order.is_some() => {
                let exit = Exit { how: error.to_string(), ..Exit::default() };
                self.holder_ended(index, exit, now);
            }
            Role::Holder => {
                self.enter(index, State::Over, now);
                self.actions.push(Action::Fail(error));
            }
        }
    }

    /// A process has ended.
    pub fn ended(&mut self, index: usize, role: Role, exit: Exit, now: Duration) {
        match role {
            Role::Holder => self.holder_ended(index, exit, now),
            Role::Successor => {
                let name = &self.units[index].spec.name;
                let said = format!("the new {name} ended before it was ready: {}", quoted(&exit));
                self.fail_swap(index, said);
            }
        }
        self.end_next(now);
    }

    fn holder_ended(&mut self, index: usize, mut exit: Exit, now: Duration) {
        let unit = &mut self.units[index];
        if let Some(kill_reason) = unit.kill_reason.take() {
            exit = Exit { how: format!("killed, {kill_reason}"), asked: false, ..exit };
        }
        unit.last_exit = Some(exit.in_short());
        match (&unit.swap, unit.state) {
            (Some(Swap { phase: Phase::Leaving, .. }), _) => self.made_room(index, now),
            (Some(Swap { phase: Phase::Alone { .. }, .. }), _) => self.back_to_the_old(index, &exit, now),
            (Some(Swap { phase: Phase::Coming | Phase::Ready { .. }, .. }), State::Running) => {
                self.succeed(index, &exit, now);
            }
            (Some(_), _) => self.swapped_in_vain(index, exit, now),
            (None, State::Stopping { .. }) => self.stopped(index, &exit, now),
            (None, _) if self.ending.is_some() && index != BROKER => {
                self.stopped(index, &Exit { asked: false, ..exit }, now);
            }
            (None, _) if exit.fine && unit.spec.may_finish => self.finished(index, &exit, now),
            (None, State::Starting) if unit.order.is_some() => {
                let ticket = unit.order.take().map(|(ticket, _)| ticket);
                let said = format!("{} ended before it registered: {}", unit.spec.name, quoted(&exit));
                self.enter(index, State::Stopped, now);
                self.tell(ticket, Word::Failed(said));
            }
            (None, _) => self.again_or_fail(index, exit, now),
        }
    }

    /// An app that may end has. One that nobody has heard of until then was perhaps meant to do something.
    fn finished(&mut self, index: usize, exit: &Exit, now: Duration) {
        let Unit { registered, spec, .. } = &self.units[index];
        if !registered {
            let (name, log) = (&spec.name, exit.log.display());
            self.say(format!(
                "{name} has ended, {}, and never joined the community: {NO_APP}; it logs to {log}",
                exit.how
            ));
        }
        self.enter(index, State::Over, now);
    }

    /// The holder ended in the midst of a swap.
    fn succeed(&mut self, index: usize, exit: &Exit, now: Duration) {
        let unit = &self.units[index];
        let ready = unit.swap.as_ref().is_some_and(|swap| swap.phase != Phase::Coming);
        // One that left in good order may have been asked to by the broker: that word can be slower than its end.
        if !exit.fine {
            let said = format!("{} ended before it was relieved: {}", unit.spec.name, exit.in_short());
            self.say(said);
        }
        match ready {
            true => self.take_over(index, now),
            false => {
                // Nobody has the name now: the new one simply joins, if it has not taken over already.
                self.actions.push(Action::TakeOver(index));
                self.enter(index, State::Starting, now);
            }
        }
    }

    /// The holder has left, and nobody has the name: the successor is started.
    fn made_room(&mut self, index: usize, now: Duration) {
        if let Some(swap) = &mut self.units[index].swap {
            swap.phase = Phase::Alone { left: now };
        }
        self.start_the_other(index, now);
    }

    /// The successor has ended, for which the holder had left, before it was on the bus: the old one comes back.
    fn back_to_the_old(&mut self, index: usize, exit: &Exit, now: Duration) {
        let unit = &mut self.units[index];
        let ticket = unit.swap.take().map(|swap| swap.ticket);
        let name = &unit.spec.name;
        let said =
            format!("the new {name} ended before it registered: {}\nthe old {name} is started again", quoted(exit));
        self.tell(ticket, Word::Failed(said));
        self.start_the_other(index, now);
    }

    fn start_the_other(&mut self, index: usize, now: Duration) {
        self.actions.push(Action::Exchange(index));
        self.start(index, now);
    }

    /// The successor had taken over, and ended before anything was heard of it.
    fn swapped_in_vain(&mut self, index: usize, exit: Exit, now: Duration) {
        let unit = &mut self.units[index];
        let ticket = unit.swap.take().map(|swap| swap.ticket);
        let said = format!("the new {} took over, and ended: {}", unit.spec.name, quoted(&exit));
        self.tell(ticket, Word::Failed(said));
        self.again_or_fail(index, exit, now);
    }

    fn stopped(&mut self, index: usize, exit: &Exit, now: Duration) {
        let unit = &mut self.units[index];
        let name = unit.spec.name.clone();
        let failed = unit.failing.take();
        let ticket = unit.order.take().map(|(ticket, _)| ticket);
        self.enter(index, State::Stopped, now);
        if !exit.fine && !exit.asked {
            self.stopped_badly(index, exit.clone());
        }
        self.tell(ticket, failed.map_or_else(|| Word::Done(format!("{name} is stopped")), Word::Failed));
    }

    /// What an app of the mission does at its end is part of it: the map is written then.
    fn stopped_badly(&mut self, index: usize, exit: Exit) {
        let spec = &self.units[index].spec;
        let (app, Exit { how, log, tail, .. }) = (spec.name.clone(), exit);
        match self.ending.is_some() && !spec.may_finish {
            true => self.actions.push(Action::Fail(LaunchError::Unfinished { app, how, log, tail })),
            false => self.say(format!("{app} did not stop in good order: {how}; see {}", log.display())),
        }
    }

    /// Starts a unit again, later, or ends the mission.
    fn again_or_fail(&mut self, index: usize, exit: Exit, now: Duration) {
        if self.found_no_broker(index, &exit, now) {
            return;
        }
        let unit = &mut self.units[index];
        let name = unit.spec.name.clone();
        let Some(delay) = unit.next_restart(&exit, now) else {
            let when = if unit.registered { self.when } else { "before it registered" };
            // Whoever fails says why.
            let how = if unit.registered || !exit.fine { exit.how } else { format!("{}, {NO_APP}", exit.how) };
            let died = LaunchError::Died { app: name, when, how, log: exit.log, tail: exit.tail };
            let given_up = unit.may_restart_after(exit.fine).then(|| unit.limit_in_words());
            self.enter(index, State::Over, now);
            let failed = match given_up {
                Some(limit) => LaunchError::GaveUp { limit, died: Box::new(died) },
                None => died,
            };
            self.actions.push(Action::Fail(failed));
            return;
        };
        let soon = match delay.is_zero() {
            true => "it is started again".to_owned(),
            false => format!("it is started again in {} s", delay.as_secs_f64()),
        };
        self.say(format!("{name} ended: {}; {soon}", exit.in_short()));
        self.enter(index, State::Waiting { until: now + delay }, now);
        if index == BROKER {
            self.forgive(now);
        }
        self.tick(now);
    }

    /// An app that was to join while there was no broker is not to blame: whatever its policy, it tries again.
    fn found_no_broker(&mut self, index: usize, exit: &Exit, now: Duration) -> bool {
        let outage = self.units[BROKER].registered && self.units[BROKER].state != State::Running;
        let excused = index != BROKER && outage && self.units[index].state == State::Starting;
        if excused {
            let name = &self.units[index].spec.name;
            let said = format!("{name} came while there was no broker ({}); it is started again", exit.how);
            self.say(said);
            self.enter(index, State::Waiting { until: now + OUTAGE_PAUSE }, now);
        }
        excused
    }

    /// A broker's outage is nobody's fault but the broker's.
    fn forgive(&mut self, now: Duration) {
        for unit in &mut self.units {
            unit.sign = now;
            if let Some(Swap { phase: Phase::Ready { kill_at }, .. }) = &mut unit.swap {
                *kill_at = kill_at.saturating_add(RETIRE_PATIENCE);
            }
        }
    }

    /// A name has come to the bus.
    pub fn arrived(&mut self, name: &str, now: Duration) {
        // Whoever arrives does so at a broker that is up.
        if self.units[BROKER].state == State::Starting {
            self.registered(BROKER, now);
        }
        if let Some(index) = self.index_of(name).filter(|index| *index != BROKER) {
            if self.units[index].state == State::Starting {
                self.registered(index, now);
            }
            self.end_next(now);
        }
    }

    /// The broker answers.
    pub fn broker_answers(&mut self, now: Duration) {
        if self.units[BROKER].state == State::Starting {
            self.registered(BROKER, now);
        }
    }

    fn registered(&mut self, index: usize, now: Duration) {
        self.enter(index, State::Running, now);
        let unit = &mut self.units[index];
        let again = std::mem::replace(&mut unit.registered, true);
        let name = unit.spec.name.clone();
        let ticket = unit.order.take().map(|(ticket, _)| ticket);
        if let Some(swap) = &mut unit.swap {
            match swap.phase {
                Phase::Alone { left } => self.finish_swap(index, Gap::Nobody(now.saturating_sub(left)), now),
                _ => swap.phase = Phase::Taken { until: now + GAP_PATIENCE },
            }
        } else if ticket.is_some() {
            self.tell(ticket, Word::Done(format!("{name} runs")));
        } else if again {
            let said = format!("{name} is back, restarted {}", unit.recent_in_words());
            self.say(said);
        }
    }

    /// A successor has come up and waits.
    pub fn ready(&mut self, name: &str, now: Duration) {
        let Some(index) = self.index_of(name) else { return };
        let unit = &mut self.units[index];
        let state = unit.state;
        let Some(swap) = unit.swap.as_mut().filter(|swap| swap.phase == Phase::Coming) else { return };
        swap.phase = Phase::Ready { kill_at: now + RETIRE_PATIENCE };
        let ticket = swap.ticket;
        self.tell(Some(ticket), Word::Progress(format!("the new {name} is ready")));
        // Its predecessor may be gone already.
        if state == State::Starting {
            self.registered(index, now);
        }
    }

    /// A successor has handled its first message, so many milliseconds after its predecessor's last one.
    pub fn handed_over(&mut self, name: &str, gap_ms: f64, now: Duration) {
        let Some(index) = self.index_of(name) else { return };
        match (self.units[index].swap.as_ref().map(|swap| swap.phase), self.units[index].state) {
            (None, _) => return,
            (Some(Phase::Taken { .. }), _) => {}
            // The holder's end was seen, and what came before it on the bus was not.
            (Some(_), State::Starting) => self.registered(index, now),
            (Some(_), _) => self.take_over(index, now),
        }
        self.finish_swap(index, Gap::Mail(gap_ms), now);
    }

    fn take_over(&mut self, index: usize, now: Duration) {
        self.actions.push(Action::TakeOver(index));
        self.enter(index, State::Running, now);
        if let Some(swap) = &mut self.units[index].swap {
            swap.phase = Phase::Taken { until: now + GAP_PATIENCE };
        }
    }

    fn finish_swap(&mut self, index: usize, gap: Gap, now: Duration) {
        let unit = &mut self.units[index];
        let Some(swap) = unit.swap.take() else { return };
        unit.swaps += 1;
        let name = unit.spec.name.clone();
        let took = (now.saturating_sub(swap.began)).as_secs_f64() * 1e3;
        let gap = match gap {
            Gap::Mail(ms) => format!("gap {ms:.1} ms"),
            Gap::Unknown => "it had no message to handle yet, so there is no gap to tell".to_owned(),
            Gap::Nobody(time) => format!("nobody was there for {:.0} ms", time.as_secs_f64() * 1e3),
        };
        let done = format!("{name} is swapped, in {took:.0} ms: {gap}");
        self.say(done.clone());
        self.tell(Some(swap.ticket), Word::Done(done));
    }

    fn fail_swap(&mut self, index: usize, why: String) {
        if let Some(swap) = self.units[index].swap.take() {
            let said = format!("{why}\nnothing is changed: the old {} goes on", self.units[index].spec.name);
            self.tell(Some(swap.ticket), Word::Failed(said));
        }
    }

    /// Somebody is heard.
    pub fn sign(&mut self, name: &str, now: Duration) {
        if now.saturating_sub(self.heard) > DEAF_AFTER {
            self.forgive(now);
        }
        self.heard = now;
        if let Some(index) = self.index_of(name) {
            self.units[index].sign = now;
        }
    }

    /// An order: start an app that is stopped.
    pub fn order_start(&mut self, ticket: Ticket, index: usize, limit: Duration, now: Duration) {
        let (name, state) = (self.units[index].spec.name.clone(), self.units[index].state);
        if let Some(refusal) = self.refusal(index) {
            return self.tell(Some(ticket), Word::Failed(refusal));
        }
        match state {
            State::Stopped | State::Over => {
                self.units[index].order = Some((ticket, now.saturating_add(limit)));
                self.start(index, now);
            }
            other => self.tell(Some(ticket), Word::Failed(format!("{name} is {}, not stopped", other.word()))),
        }
    }

    /// An order: stop an app that runs.
    pub fn order_stop(&mut self, ticket: Ticket, index: usize, now: Duration) {
        let (name, state) = (self.units[index].spec.name.clone(), self.units[index].state);
        if let Some(refusal) = self.refusal(index) {
            return self.tell(Some(ticket), Word::Failed(refusal));
        }
        match state {
            State::Waiting { .. } => {
                self.enter(index, State::Stopped, now);
                self.tell(Some(ticket), Word::Done(format!("{name} is stopped; it had ended before")));
            }
            State::Running | State::Starting => {
                self.units[index].order = Some((ticket, Duration::MAX));
                self.ask(index, now);
            }
            other => self.tell(Some(ticket), Word::Failed(format!("{name} is {} already", other.word()))),
        }
    }

    /// An order: exchange an app for what its successor's process will be; `alone`: two of the name cannot be there at once.
    pub fn order_swap(&mut self, ticket: Ticket, index: usize, limit: Duration, alone: bool, now: Duration) {
        let (name, state) = (self.units[index].spec.name.clone(), self.units[index].state);
        if let Some(refusal) = self.refusal(index) {
            return self.tell(Some(ticket), Word::Failed(refusal));
        }
        if state != State::Running {
            let said = format!("{name} is {}: only an app that runs can be swapped", state.word());
            return self.tell(Some(ticket), Word::Failed(said));
        }
        let phase = if alone { Phase::Leaving } else { Phase::Coming };
        self.units[index].swap = Some(Swap { ticket, began: now, limit, phase });
        match alone {
            true => self.ask(index, now),
            false => self.actions.push(Action::Start(index, Role::Successor)),
        }
    }

    /// Why no order can be taken for an app now.
    pub fn refusal(&self, index: usize) -> Option<String> {
        let unit = &self.units[index];
        let name = &unit.spec.name;
        if self.ending.is_some() {
            return Some("the mission is ending".to_owned());
        }
        if index == BROKER {
            return Some(format!(
                "{name} is the broker: without it there is no mission; Ctrl-C at the launcher ends it"
            ));
        }
        if unit.swap.is_some() {
            return Some(format!("{name} is being swapped; wait until that is over"));
        }
        unit.order.map(|_| format!("{name} is {} by another command", unit.state.word()))
    }

    fn ask(&mut self, index: usize, now: Duration) {
        self.enter(index, State::Stopping { kill_at: now + STOP_PATIENCE }, now);
        self.actions.push(Action::Ask(index));
    }

    /// When [`Supervisor::tick`] has something to do at the latest.
    pub fn deadline(&self) -> Option<Duration> {
        self.units.iter().filter_map(Unit::deadline).min()
    }

    /// Time passes.
    pub fn tick(&mut self, now: Duration) {
        let hearing = now.saturating_sub(self.heard) <= DEAF_AFTER;
        for index in 0..self.units.len() {
            self.tick_state(index, now);
            self.tick_swap(index, now);
            if hearing && self.units[BROKER].state == State::Running {
                self.tick_health(index, now);
            }
        }
    }

    fn tick_state(&mut self, index: usize, now: Duration) {
        let unit = &mut self.units[index];
        let name = unit.spec.name.clone();
        match unit.state {
            State::Waiting { until } if until <= now => {
                unit.restarts += 1;
                self.start(index, now);
            }
            State::Stopping { kill_at } if unit.kill_reason.is_none() && kill_at <= now => {
                unit.kill_reason = Some(format!("not stopped within {} s", STOP_PATIENCE.as_secs()));
                self.actions.push(Action::Kill(index));
            }
            State::Starting if unit.order.is_some_and(|(_, limit)| limit <= now) => {
                unit.failing = Some(format!("{name} did not register in time and was stopped"));
                self.ask(index, now);
            }
            State::Starting
                if unit.registered && unit.kill_reason.is_none() && unit.since + REGISTER_PATIENCE <= now =>
            {
                unit.kill_reason = Some(format!("not registered within {} s", REGISTER_PATIENCE.as_secs()));
                self.actions.push(Action::Kill(index));
            }
            _ => {}
        }
    }

    fn tick_swap(&mut self, index: usize, now: Duration) {
        let unit = &mut self.units[index];
        let Some(swap) = &mut unit.swap else { return };
        match swap.phase {
            Phase::Coming if swap.began.saturating_add(swap.limit) <= now => {
                let secs = swap.limit.as_secs_f64();
                let said = format!("the new {} was not ready within {secs} s", unit.spec.name);
                // Had the old one gone, the new one is all there is: its own patience counts then.
                if unit.state != State::Starting {
                    self.actions.push(Action::Discard(index));
                    self.fail_swap(index, said);
                }
            }
            Phase::Ready { kill_at } if kill_at <= now => {
                swap.phase = Phase::Ready { kill_at: Duration::MAX };
                let said = format!(
                    "the old {} did not leave within {} s and is killed",
                    unit.spec.name,
                    RETIRE_PATIENCE.as_secs()
                );
                let ticket = swap.ticket;
                self.actions.push(Action::Kill(index));
                self.tell(Some(ticket), Word::Progress(said));
            }
            Phase::Alone { left } if left.saturating_add(swap.limit) <= now && unit.kill_reason.is_none() => {
                unit.kill_reason = Some(format!("not registered within {} s", swap.limit.as_secs_f64()));
                self.actions.push(Action::Kill(index));
            }
            Phase::Taken { until } if until <= now => self.finish_swap(index, Gap::Unknown, now),
            _ => {}
        }
    }

    fn tick_health(&mut self, index: usize, now: Duration) {
        let unit = &mut self.units[index];
        let silent = now.saturating_sub(unit.sign);
        let hung = unit.spec.health.is_some_and(|health| silent > health);
        if hung && unit.state == State::Running && unit.swap.is_none() && unit.kill_reason.is_none() {
            unit.kill_reason = Some(format!("no sign of life for {:.0} s", silent.as_secs_f64()));
            self.actions.push(Action::Kill(index));
        }
    }

    /// The mission ends: everyone but the broker is stopped, one after the other, so that nobody misses anybody.
    pub fn end(&mut self, now: Duration) {
        for index in 0..self.units.len() {
            if self.units[index].swap.as_ref().is_some_and(|swap| matches!(swap.phase, Phase::Taken { .. })) {
                self.finish_swap(index, Gap::Unknown, now);
            } else if self.units[index].swap.is_some() {
                self.actions.push(Action::Discard(index));
                self.fail_swap(index, "the mission is ending".to_owned());
            }
        }
        let elements = self.units[1..].iter().map(|unit| unit.spec.element.as_str());
        self.ending = Some(stop_order(elements).into_iter().map(|index| index + 1).collect());
        self.end_next(now);
    }

    /// Whether everyone but the broker has ended.
    pub fn all_ended(&self) -> bool {
        self.ending.as_ref().is_some_and(VecDeque::is_empty)
    }

    /// Goes on to whoever is to end next, once the one before has.
    fn end_next(&mut self, now: Duration) {
        while let Some(index) = self.ending.as_ref().and_then(|queue| queue.front().copied()) {
            match self.units[index].state {
                State::Running | State::Starting => return self.ask(index, now),
                State::Stopping { .. } => return,
                // It would have come back, and did not.
                State::Waiting { .. } => {
                    let last = self.units[index].last_exit.clone();
                    debug_assert!(last.is_some(), "who waits to be started again has ended");
                    let how = last.unwrap_or_else(|| "ended, nobody saw how".to_owned());
                    self.stopped(index, &Exit { how, ..Exit::default() }, now);
                }
                State::Idle | State::Stopped | State::Over => {}
            }
            self.ending.as_mut().and_then(VecDeque::pop_front);
        }
    }
}

/// An exit with the log's last lines below it.
fn quoted(exit: &Exit) -> String {
    match exit.tail.as_slice() {
        [] => exit.how.clone(),
        lines => format!("{}; it said:\n    {}", exit.how, lines.join("\n    ")),
    }
}
