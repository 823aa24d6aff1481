//! A broker or an app, as its supervisor sees it.

use std::collections::VecDeque;
use std::time::Duration;

use elk_mission::{Policy, Restart, element};
use elk_outside::time;

use super::words::{Exit, Ticket};

/// The first pause before a restart; each further one is twice as long, if it follows at once.
const FIRST_PAUSE: Duration = Duration::from_millis(100);
/// Whoever was on the bus for so long does not fail at once: pauses begin anew.
const WELL_AFTER: Duration = Duration::from_secs(1);
/// The longest.
const LONGEST_PAUSE: Duration = Duration::from_secs(5);

/// What does not change about a unit.
#[derive(Debug, Clone)]
pub(crate) struct UnitSpec {
    pub name: String,
    pub element: String,
    pub restart: Restart,
    /// Restarts within the window before it is given up.
    pub restarts: u32,
    pub window: Duration,
    /// How long it may be silent.
    pub health: Option<Duration>,
    /// It may end of its own accord: a program of somebody else's may have done all that it was there for.
    pub may_finish: bool,
    /// Nothing goes on without it: its first restart waits for nothing.
    pub urgent: bool,
}

impl UnitSpec {
    /// That of an app, or of the broker.
    pub fn new(name: &str, element: &str, policy: &Policy) -> Self {
        Self {
            name: name.to_owned(),
            element: element.to_owned(),
            restart: policy.restart,
            restarts: policy.restarts,
            window: time::duration(policy.window_secs),
            health: policy.health_secs.map(time::duration),
            may_finish: element::named(element).is_some_and(|element| element.may_finish),
            urgent: false,
        }
    }
}

/// What a unit does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum State {
    /// It was not started yet.
    Idle,
    /// Its process runs and has not registered.
    Starting,
    /// It is on the bus.
    Running,
    /// It ended and will be started again.
    Waiting { until: Duration },
    /// It was asked to end.
    Stopping { kill_at: Duration },
    /// It was stopped.
    Stopped,
    /// It ended by itself.
    Over,
}

impl State {
    /// In one word, for people.
    pub fn word(self) -> &'static str {
        match self {
            Self::Idle => "not started",
            Self::Starting => "starting",
            Self::Running => "running",
            Self::Waiting { .. } => "restarting",
            Self::Stopping { .. } => "stopping",
            Self::Stopped => "stopped",
            Self::Over => "ended",
        }
    }
}

/// A swap that is under way.
#[derive(Debug)]
pub(crate) struct Swap {
    pub ticket: Ticket,
    pub began: Duration,
    /// How long the successor may take to be ready.
    pub limit: Duration,
    pub phase: Phase,
}

/// How far a swap is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Phase {
    /// The successor's process runs.
    Coming,
    /// The successor waits for the holder to leave.
    Ready { kill_at: Duration },
    /// The successor has the name; what is missing is the gap.
    Taken { until: Duration },
    /// The holder was asked to leave before its successor is started: the two could not bear the name together.
    Leaving,
    /// The holder has left, at this time, and the successor is started.
    Alone { left: Duration },
}

/// A broker or an app.
#[derive(Debug)]
pub(crate) struct Unit {
    pub spec: UnitSpec,
    pub state: State,
    /// When it came to be in this state.
    pub since: Duration,
    /// When it was last heard.
    pub sign: Duration,
    /// Whether it has ever been on the bus.
    pub registered: bool,
    /// How often it was started again, over all.
    pub restarts: u32,
    /// How often it was swapped.
    pub swaps: u32,
    pub last_exit: Option<String>,
    pub swap: Option<Swap>,
    /// Who waits for it to be started or stopped, and until when.
    pub order: Option<(Ticket, Duration)>,
    /// Why it is being killed.
    pub kill_reason: Option<String>,
    /// Why it is being stopped, if that is a failure.
    pub failing: Option<String>,
    /// When it was started again, within the window.
    recent: VecDeque<Duration>,
    /// Restarts that followed each other at once.
    streak: u32,
}

impl Unit {
    pub fn new(spec: UnitSpec) -> Self {
        Self {
            spec,
            state: State::Idle,
            since: Duration::ZERO,
            sign: Duration::ZERO,
            registered: false,
            restarts: 0,
            swaps: 0,
            last_exit: None,
            swap: None,
            order: None,
            kill_reason: None,
            failing: None,
            recent: VecDeque::new(),
            streak: 0,
        }
    }

    /// Whether its policy has it started again after an end, limits aside.
    pub fn may_restart_after(&self, fine: bool) -> bool {
        // Without a broker that ever answered there is nothing to restore.
        let known = self.registered || !self.spec.urgent;
        known
            && match self.spec.restart {
                Restart::Never => false,
                Restart::OnFailure => !fine,
                Restart::Always => true,
            }
    }

    /// The pause until it is started again; `None`: it is not.
    pub fn next_restart(&mut self, exit: &Exit, now: Duration) -> Option<Duration> {
        while self.recent.front().is_some_and(|then| then.saturating_add(self.spec.window) <= now) {
            self.recent.pop_front();
        }
        if !self.may_restart_after(exit.fine) || self.recent.len() as u32 >= self.spec.restarts {
            return None;
        }
        self.recent.push_back(now);
        if self.state == State::Running && self.since + WELL_AFTER <= now {
            self.streak = 0;
        }
        let streak = self.streak;
        self.streak += 1;
        Some(match (self.spec.urgent, streak) {
            (true, 0) => Duration::ZERO,
            (true, _) => pause(streak - 1),
            (false, _) => pause(streak),
        })
    }

    /// `5 times in 60 s`
    pub fn limit_in_words(&self) -> String {
        format!("{} times in {} s", self.spec.restarts, self.spec.window.as_secs_f64())
    }

    /// `(2 of 5 in 60 s)`
    pub fn recent_in_words(&self) -> String {
        let (count, limit, secs) = (self.recent.len(), self.spec.restarts, self.spec.window.as_secs_f64());
        format!("({count} of {limit} in {secs} s)")
    }

    /// When something has to be done about it at the latest; health is looked at every now and then anyway.
    pub fn deadline(&self) -> Option<Duration> {
        let state = match self.state {
            State::Waiting { until } => Some(until),
            State::Stopping { kill_at } if self.kill_reason.is_none() => Some(kill_at),
            State::Starting => self.order.map(|(_, limit)| limit),
            _ => None,
        };
        let swap = self.swap.as_ref().map(|swap| match swap.phase {
            Phase::Coming => swap.began.saturating_add(swap.limit),
            Phase::Alone { left } if self.kill_reason.is_none() => left.saturating_add(swap.limit),
            Phase::Leaving | Phase::Alone { .. } => Duration::MAX,
            Phase::Ready { kill_at } => kill_at,
            Phase::Taken { until } => until,
        });
        state.into_iter().chain(swap).min()
    }
}

/// The pause before the restart that follows `count` others.
fn pause(count: u32) -> Duration {
    FIRST_PAUSE.saturating_mul(1 << count.min(16)).min(LONGEST_PAUSE)
}
