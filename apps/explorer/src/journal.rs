//! What is booked while plans are made: seconds by phase, counters, and what was weighed.

use elk_bus::MAX_DRAWINGS;
use elk_bus::drawing::Drawing;
use elk_spatial::checks::{LARGEST_SUM, MAX_COUNT, MAX_PHASES};
use elk_spatial::messages::ExplorerMemory;

use crate::goals::Goal;
use crate::route_fault::RouteFault;
use crate::weighed::Weighed;

/// What planning cost, what was weighed, and what went wrong on the way.
#[derive(Debug, Clone)]
pub struct Journal {
    clock: fn() -> f64,
    is_to_stop: fn() -> bool,
    phases: Vec<(String, f64)>,
    counters: Vec<(String, u64)>,
    weighed: Weighed,
    /// Whether anybody looks at what strategies draw.
    is_watched: bool,
    drawings: Vec<Drawing>,
    /// Plans for which the strategy had no answer and the closest goal was taken.
    pub fallbacks: u64,
    /// The first way that the strategy answered and that cannot be gone, with the number of its plan.
    fault: Option<(u64, RouteFault)>,
}

/// The counter of ways that cannot be gone.
const FAULTS: &str = "ways that cannot be gone";

impl Journal {
    /// An empty one; `clock` gives the seconds of CPU that the thread has used.
    pub fn new(clock: fn() -> f64) -> Self {
        let (phases, counters) = (Vec::new(), Vec::new());
        let (weighed, drawings) = (Weighed::default(), Vec::new());
        let (is_watched, fallbacks, fault) = (false, 0, None);
        Self { clock, is_to_stop: || false, phases, counters, weighed, is_watched, drawings, fallbacks, fault }
    }

    /// `is_to_stop` says whether the process is asked to stop.
    pub fn heeding(self, is_to_stop: fn() -> bool) -> Self {
        Self { is_to_stop, ..self }
    }

    /// Whether nobody waits for the plan any more, since the process is asked to stop. A strategy that computes for long looks
    /// here now and then, and gives up: it has 5 s.
    pub fn is_to_stop(&self) -> bool {
        (self.is_to_stop)()
    }

    /// What answers [`Journal::is_to_stop`], to be asked within [`Journal::time`].
    pub fn stop_signal(&self) -> fn() -> bool {
        self.is_to_stop
    }

    /// Goes on with what a predecessor has booked.
    pub fn recall(&mut self, left: &ExplorerMemory) {
        self.fallbacks = left.fallbacks;
        (self.phases, self.counters) = (left.cpu_secs.clone(), left.counters.clone());
    }

    /// Does `work` and books its time on `phase`, if there are not too many of those already ([`MAX_PHASES`]).
    pub fn time<T>(&mut self, phase: &'static str, work: impl FnOnce() -> T) -> T {
        let start = (self.clock)();
        let result = work();
        let secs = (self.clock)() - start;
        let room = self.phases.len() < MAX_PHASES;
        match self.phases.iter_mut().find(|(name, _)| *name == phase) {
            Some((_, total)) => *total = (*total + secs).min(LARGEST_SUM),
            None if room => self.phases.push((phase.to_owned(), secs)),
            None => {}
        }
        result
    }

    /// Counts `more` of `what`, if there are not too many counters already ([`MAX_PHASES`]). The report of the run has the sum.
    pub fn count(&mut self, what: &'static str, more: u64) {
        let room = self.counters.len() < MAX_PHASES;
        match self.counters.iter_mut().find(|(name, _)| *name == what) {
            Some((_, total)) => *total = total.saturating_add(more).min(MAX_COUNT),
            None if room => self.counters.push((what.to_owned(), more.min(MAX_COUNT))),
            None => {}
        }
    }

    /// In plan `plan` the strategy has answered a way that cannot be gone.
    pub(crate) fn blame(&mut self, plan: u64, fault: RouteFault) {
        self.count(FAULTS, 1);
        self.fault.get_or_insert((plan, fault));
    }

    /// How many ways the strategy has answered that cannot be gone, and the first of them, with the number of its plan, if it is known
    /// here: a predecessor leaves their number.
    pub(crate) fn faults(&self) -> (u64, Option<(u64, RouteFault)>) {
        let count = self.counters.iter().find(|(name, _)| name == FAULTS).map_or(0, |(_, count)| *count);
        (count.max(u64::from(self.fault.is_some())), self.fault)
    }

    /// What was counted, in the order in which it first came.
    pub fn counters(&self) -> &[(String, u64)] {
        &self.counters
    }

    /// Takes note of a goal that the strategy could go to, with what it gives it in its own unit: whoever looks on sees it.
    pub fn weigh(&mut self, goal: &Goal, score: f64) {
        self.weighed.add(goal, score);
    }

    /// The goals that were weighed since they were last taken.
    pub fn take_weighed(&mut self) -> Weighed {
        std::mem::take(&mut self.weighed)
    }

    /// Whether anybody looks at what strategies draw.
    pub fn watch(&mut self, is_watched: bool) {
        self.is_watched = is_watched;
    }

    /// Whether anybody looks: what is only to be drawn need not be kept for nobody.
    pub fn is_watched(&self) -> bool {
        self.is_watched
    }

    /// Shows what the strategy weighs, if anybody looks; what it draws under other names than before is gone with the next plan.
    /// A plan is the same with and without.
    pub fn draw(&mut self, drawing: impl FnOnce() -> Drawing) {
        if self.is_watched && self.drawings.len() < MAX_DRAWINGS {
            self.drawings.push(drawing());
        }
    }

    /// What was drawn since this was last taken.
    pub fn take_drawings(&mut self) -> Vec<Drawing> {
        std::mem::take(&mut self.drawings)
    }

    /// Seconds of CPU by phase, in the order in which they first came.
    pub fn phases(&self) -> &[(String, f64)] {
        &self.phases
    }

    /// Seconds of CPU of all phases.
    pub fn total_secs(&self) -> f64 {
        self.phases.iter().map(|(_, s)| s).sum()
    }
}
