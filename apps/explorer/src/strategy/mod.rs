//! Strategies: which goal to go to, and which way.
//!
//! A new one is a type that implements [`Strategy`]: in a program of its own ([`crate::main`]), or in a module here, whose `TYPE`
//! is then a row of [`TYPES`]. What happens with its route (how far it is followed, where scans are taken) is [`crate::policy`]'s business and the same
//! for all strategies, so that their results can be compared.

mod card;
mod closest_frontier;
mod potential;
mod ways;

pub use card::Card;
pub use closest_frontier::ClosestFrontier;
pub use potential::{Potential, Start};
pub use ways::Ways;

use elk_bus::DecodeError;
use elk_mission::{AppType, type_name};
use elk_spatial::StrategyMemory;
use elk_spatial::checks::{LARGEST_SUM, MAX_COUNT, MAX_PHASES};
use elk_spatial::messages::ExplorerMemory;
use elk_spatial::strategy_memory::LeaveError;
use nalgebra::Point3;

use crate::candidates::Weighed;
use crate::goals::{Goal, Goals};
use crate::space::Space;
use elk_geometry::Volume;

/// The explorers that a mission file can name.
pub static TYPES: &[AppType] = &[closest_frontier::TYPE, potential::TYPE];

/// What a strategy sees. [`View::cheapest`] and [`View::ways`] are all that most strategies need of it.
#[derive(Debug, Clone, Copy)]
pub struct View<'a> {
    /// The known map.
    pub volume: &'a Volume,
    /// Where the robot can be; a route leads from [`Space::start`] through [`Space::reach`].
    pub space: &'a Space,
    /// Where the route starts (m, world): the robot, or the centre of the start voxel if the robot has to back off first.
    pub from: Point3<f64>,
    /// Where to go; at least one, and none where the route starts.
    pub goals: &'a Goals,
}

/// A way to a goal.
#[derive(Debug, Clone, PartialEq)]
pub struct Route {
    /// Points to pass in straight lines (m, world), from [`View::from`] to somewhere in the goal's voxel.
    pub points: Vec<Point3<f64>>,
    /// The goal's voxel, by index of the volume.
    pub goal: usize,
}

impl Route {
    /// From `view.from` through the centres of the voxels of `way`; `None` if it is empty.
    pub fn over_voxels(view: &View<'_>, way: &[usize]) -> Option<Self> {
        let goal = *way.last()?;
        let rest = way.iter().skip(1).map(|i| view.volume.center(*i));
        Some(Self { points: std::iter::once(view.from).chain(rest).collect(), goal })
    }
}

/// Chooses a goal and a way to it.
pub trait Strategy: Send {
    /// The type's name, as mission files say it and as it stands in the record.
    fn name(&self) -> &'static str {
        type_name::<Self>()
    }

    /// Its settings, for people and for the record.
    fn describe(&self) -> String {
        String::new()
    }

    /// The way to the goal that it chooses; `None` if it finds none: then the closest goal is taken, and the plan counted
    /// as a fallback. It is asked after every scan, and may remember what it likes; equal maps should give equal ways.
    fn plan(&mut self, view: &View<'_>, journal: &mut Journal) -> Option<Route>;

    /// What the next one of its name is to know, after a swap or a death: asked for with every plan, and left with the memory
    /// that all explorers share. [`StrategyMemory::of`] makes it of a payload type.
    ///
    /// # Errors
    /// There is one that cannot be left; the plan is made all the same.
    fn memory(&self) -> Result<Option<StrategyMemory>, LeaveError> {
        Ok(None)
    }

    /// Goes on with what one of its name has left: [`StrategyMemory::take`] makes a value of it.
    ///
    /// # Errors
    /// It is of another type, or of another build's; that is said, and the strategy begins without it.
    fn recall(&mut self, _left: &StrategyMemory) -> Result<(), DecodeError> {
        Ok(())
    }
}

/// What planning cost, what was weighed, and what went wrong on the way.
#[derive(Debug, Clone)]
pub struct Journal {
    clock: fn() -> f64,
    is_to_stop: fn() -> bool,
    phases: Vec<(String, f64)>,
    counters: Vec<(String, u64)>,
    weighed: Weighed,
    /// Plans for which the strategy had no answer and the closest goal was taken.
    pub fallbacks: u64,
}

impl Journal {
    /// An empty one; `clock` gives the seconds of CPU that the thread has used.
    pub fn new(clock: fn() -> f64) -> Self {
        let (phases, counters) = (Vec::new(), Vec::new());
        Self { clock, is_to_stop: || false, phases, counters, weighed: Weighed::default(), fallbacks: 0 }
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

    /// Seconds of CPU by phase, in the order in which they first came.
    pub fn phases(&self) -> &[(String, f64)] {
        &self.phases
    }

    /// Seconds of CPU of all phases.
    pub fn total_secs(&self) -> f64 {
        self.phases.iter().map(|(_, s)| s).sum()
    }
}
