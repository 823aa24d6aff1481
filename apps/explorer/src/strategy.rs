//! The seam of strategies: what one sees, and what it answers.
//!
//! What happens with its route (how far it is followed, where scans are taken) is [`crate::policy`]'s business and the same for
//! all strategies, so that their results can be compared.

use std::collections::BTreeSet;

use elk_bus::DecodeError;
use elk_geometry::Voxel;
use elk_mission::type_name;
use nalgebra::Point3;

use crate::goals::Goals;
use crate::journal::Journal;
use crate::sight::Sight;
use crate::space::Space;
use crate::strategy_memory::{LeaveError, StrategyMemory};
use crate::target::Target;

/// What a strategy sees. [`View::cheapest`] and [`View::ways`] are all that most strategies need of it.
#[derive(Debug, Clone, Copy)]
pub struct View<'a> {
    /// What is free, and where the robot can be; a route leads from [`Space::start`] through [`Space::reach`].
    pub space: &'a Space,
    /// Where the route starts (m, world): the robot, or the centre of the start voxel if the robot has to back off first.
    pub from: Point3<f64>,
    /// Where to go; at least one, and none where the route starts.
    pub goals: &'a Goals,
    /// All that is to be resolved, for a strategy that [looks from afar](Strategy::looks_from_afar); else nothing. Of some there
    /// is a goal in [`View::goals`], of others not: those are seen from farther away, or from nowhere.
    pub open: &'a [Target],
    /// Bricks in which other voxels are free than when the strategy was asked last, or the robot can get to others, and perhaps
    /// more; `None`: it was not asked yet.
    pub changed: Option<&'a BTreeSet<Voxel>>,
    /// What the camera sees that looks there.
    pub sight: Sight,
    /// The number of the plan, from 1, counted over swaps and deaths: who draws by lot may draw anew in each.
    pub plan: u64,
}

/// A way to a goal.
#[derive(Debug, Clone, PartialEq)]
pub struct Route {
    /// Points to pass in straight lines (m, world), from [`View::from`] to somewhere in the goal's voxel, or to any place that
    /// sees its target.
    pub points: Vec<Point3<f64>>,
    /// The goal's voxel; or, at the end of a way from where it is seen, that of a target of [`View::open`].
    pub goal: Voxel,
}

impl Route {
    /// From `view.from` through the centres of the voxels of `way`; `None` if it is empty.
    pub fn over_voxels(view: &View<'_>, way: &[Voxel]) -> Option<Self> {
        Some(Self::to_look(view, way, *way.last()?))
    }

    /// The same to a place that sees the target of the goal in another voxel: to the middle of its own, also if the robot is in it.
    pub fn to_look(view: &View<'_>, way: &[Voxel], goal: Voxel) -> Self {
        Self { points: std::iter::once(view.from).chain(view.space.middles(way)).collect(), goal }
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

    /// Whether it chooses among all that is to be resolved, and looks from where it likes: [`View::open`] is for it then.
    fn looks_from_afar(&self) -> bool {
        false
    }

    /// The way to the goal that it chooses; `None` if it finds none: then the closest goal is taken, and the plan counted
    /// as a fallback. It is asked after every scan, and may remember what it likes; equal maps should give equal ways. A way that
    /// cannot be gone ([`RouteFault`](crate::RouteFault)) is not: the closest goal is taken, and the run is incomplete for it.
    fn plan(&mut self, view: &View<'_>, journal: &mut Journal) -> Option<Route>;

    /// What the next one of its name is to know, after a swap or a death: asked for with every plan, and left beside the
    /// memory that all explorers share, as a variable's value that everybody can look at. [`StrategyMemory::of`] makes it of a
    /// payload type.
    ///
    /// # Errors
    /// There is one that cannot be left; the plan is made all the same.
    fn memory(&self) -> Result<Option<StrategyMemory>, LeaveError> {
        Ok(None)
    }

    /// Goes on with what one of its name has left: [`StrategyMemory::take`] makes a value of it.
    ///
    /// # Errors
    /// It is of another type, or of a version that differs in more than fields with defaults; that is said, and the strategy
    /// begins without it.
    fn recall(&mut self, _left: &StrategyMemory) -> Result<(), DecodeError> {
        Ok(())
    }
}
