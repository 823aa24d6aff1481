//! Strategies: which goal to go to, and which way.
//!
//! A new one is a type that implements [`Strategy`]: in a program of its own ([`crate::main`]), or in a module here with an
//! entry in [`crate::app::TYPES`]. What happens with its route (how far it is followed, where scans are taken) is [`crate::policy`]'s business and the same
//! for all strategies, so that their results can be compared.

mod closest_frontier;
mod potential;
mod ways;

pub use closest_frontier::ClosestFrontier;
pub use potential::{Potential, Start};
pub use ways::Ways;

use elk_spatial::checks::{LARGEST_SUM, MAX_PHASES};
use elk_spatial::messages::ExplorerMemory;
use nalgebra::Point3;

use crate::goals::Goals;
use crate::space::Space;
use elk_geometry::Volume;

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
}

/// The last word of a type's name: `Level` of `mine::Level`.
pub(crate) fn type_name<T: ?Sized>() -> &'static str {
    let name = std::any::type_name::<T>();
    let name = name.split('<').next().unwrap_or(name);
    name.rsplit("::").next().unwrap_or(name)
}

/// What planning cost and what went wrong on the way.
#[derive(Debug, Clone)]
pub struct Journal {
    clock: fn() -> f64,
    is_to_stop: fn() -> bool,
    phases: Vec<(String, f64)>,
    /// Streamlines that stalled before they reached a goal.
    pub stalls: u64,
    /// Plans for which the strategy had no answer and the closest goal was taken.
    pub fallbacks: u64,
    /// Iterations of the field's solver.
    pub iterations: u64,
}

impl Journal {
    /// An empty one; `clock` gives the seconds of CPU that the thread has used.
    pub fn new(clock: fn() -> f64) -> Self {
        Self { clock, is_to_stop: || false, phases: Vec::new(), stalls: 0, fallbacks: 0, iterations: 0 }
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
        (self.stalls, self.fallbacks, self.iterations) = (left.stalls, left.fallbacks, left.iterations);
        self.phases = left.cpu_secs.clone();
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

    /// Seconds of CPU by phase, in the order in which they first came.
    pub fn phases(&self) -> &[(String, f64)] {
        &self.phases
    }

    /// Seconds of CPU of all phases.
    pub fn total_secs(&self) -> f64 {
        self.phases.iter().map(|(_, s)| s).sum()
    }
}
