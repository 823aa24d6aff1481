//! The first piece of the best branch of a tree of ways, grown anew from the rest of it with each plan (after NBVP, Bircher et al.,
//! *Receding Horizon "Next-Best-View" Planner for 3D Exploration*, ICRA 2016, and AEP, Selin et al., *Efficient Autonomous
//! Exploration Planning of Large-Scale 3-D Environments*, RA-L 2019).
//!
//! As in NBVP, a branch is worth the sum of what its nodes see, each worth less by exp(−λ c) at the end of a way of c metres (its
//! eq. 1), only its first piece is gone, and the rest seeds the next tree. As in AEP, places from which there was something to be
//! seen are kept from plan to plan, and are gone for where no branch near by is worth it. Otherwise than there:
//!
//! - What is counted is frontier, which this map keeps, and not volume along rays; and a node's gain is only what no node before it
//!   on its branch sees, since it would be gone by then.
//! - A node sees what a camera sees that turns there: turning costs no way, and each plan first looks at what is seen from where the
//!   robot is.
//! - Half of the samples are drawn from the places near by from which frontier is known to be seen, and only half from all.
//! - Where neither a branch nor a kept place is worth it, the closest goal is next, so that a run ends completely.

mod kept;
mod prospects;
mod tree;

use std::cmp::Reverse;

use elk_bus::DecodeError;
use elk_geometry::random::Random;
use elk_geometry::{Voxel, astar};
use elk_mission::{AppType, Kind, ParamSpec, Params, joined};
use nalgebra::{Point3, Vector3};

use super::candidates::SEED;
use super::groups::{Group, groups, in_sight};
use crate::app::{COMMON, app, param};
use crate::journal::Journal;
use crate::pictures;
use crate::strategy::{Route, Strategy, View};
use crate::strategy_memory::{LeaveError, StrategyMemory};
use kept::{Kept, Place};
use prospects::{Prospects, Sighted};
use tree::Tree;

/// Its row in the table of explorers.
pub const TYPE: AppType = AppType {
    element: "Explorer",
    name: "RecedingHorizon",
    summary: "Goes the first piece of the branch that sees most for its way, of a tree grown anew with each plan (after NBVP and AEP).",
    params: &joined::<{ COMMON.len() + PARAMS.len() }>(COMMON, PARAMS),
    build: |params| app(params, Box::new(RecedingHorizon::new(settings(params)))),
    preflight: None,
};

const PARAMS: &[ParamSpec] = &[
    SEED,
    param(
        "Lambda",
        Kind::Number { unit: "1/m", min: 0.0, max: 100.0 },
        "2",
        "How much less a view is worth for each metre of way to it: exp(-Lambda way).",
    ),
    param("Horizon", Kind::Number { unit: "m", min: 0.5, max: 100.0 }, "5", "How far from the robot the tree grows."),
    param("Edge", Kind::Number { unit: "m", min: 0.1, max: 10.0 }, "1", "Longest edge of the tree."),
    param("Nodes", Kind::Integer { min: 2, max: 2000 }, "100", "Nodes of a tree at most: what a plan costs."),
    param(
        "LeastGain",
        Kind::Number { unit: "", min: 0.0, max: 1e6 },
        "0.02",
        "A branch that is worth less (frontier voxels, less by Lambda) is not gone: the closest of the places that are kept, and of \
         the goals, is next.",
    ),
];

fn settings(params: &Params) -> Settings {
    Settings {
        // The table keeps these from being negative.
        seed: params.integer("Seed") as u64,
        nodes: params.integer("Nodes") as usize,
        lambda: params.number("Lambda"),
        horizon_m: params.number("Horizon"),
        edge_m: params.number("Edge"),
        least_gain: params.number("LeastGain"),
    }
}

/// Groups of targets that a plan is made of at most, unless they are too far apart for that.
const MOST_GROUPS: usize = 256;
/// Samples that are drawn for each node that a tree may have, at most.
const SAMPLES_A_NODE: usize = 4;
/// Of a sample that is drawn from all around, so many lots are drawn at most until one falls where the robot can be.
const LOTS_A_SAMPLE: usize = 8;
/// Kept places are so far from each other, at least (edges of the tree).
const APART_EDGES: f64 = 0.5;
/// Frontier voxels that a place has to see to be kept.
const LEAST_KEPT: f64 = 1.0;

/// How far a tree grows, and what it is worth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// What is drawn follows from it and from the number of the plan.
    pub seed: u64,
    /// λ (1/m).
    pub lambda: f64,
    /// How far from the robot the tree grows (m).
    pub horizon_m: f64,
    /// Longest edge of the tree (m).
    pub edge_m: f64,
    /// Nodes of a tree, at most.
    pub nodes: usize,
    /// What the best branch is worth at least that is gone.
    pub least_gain: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self { seed: 0, lambda: 2.0, horizon_m: 5.0, edge_m: 1.0, nodes: 100, least_gain: 0.02 }
    }
}

/// Goes the first piece of the best branch.
#[derive(Debug, Clone, Default)]
pub struct RecedingHorizon {
    settings: Settings,
    kept: Kept,
}

/// A tree, and what its nodes see.
struct Grown<'a> {
    tree: Tree<'a>,
    /// What is seen from each node.
    sighted: Vec<Sighted>,
    /// What is seen from each node that is not seen from one before it on its branch.
    new: Vec<Sighted>,
}

impl RecedingHorizon {
    /// One that has not planned yet.
    pub fn new(settings: Settings) -> Self {
        Self { settings, kept: Kept::default() }
    }

    /// A tree from where the route starts: first toward what is kept of the last branch and of earlier trees, then toward samples.
    fn grow<'a>(&self, view: &View<'a>) -> Tree<'a> {
        let Settings { seed, horizon_m, edge_m, nodes, .. } = self.settings;
        let (space, mut random) = (view.space, Random::new(seed, view.plan));
        let is_near = |voxel: Voxel| (space.center(voxel) - view.from).norm() <= horizon_m;
        let mut tree = Tree::new(space, view.from, edge_m, nodes);
        let mut places: Vec<Voxel> = self.kept.places.iter().map(|place| place.voxel).collect();
        places.sort_by(|one, other| one.distance(space.start()).total_cmp(&other.distance(space.start())));
        let before = self.kept.branch.iter().chain(&places).filter(|voxel| is_near(**voxel));
        for voxel in before.filter(|voxel| space.reach.contains(**voxel)) {
            // The rest is for what is new.
            if 2 * tree.nodes().len() > nodes {
                break;
            }
            tree.grow(*voxel);
        }
        let goals = view.goals.iter().map(|goal| goal.voxel).filter(|voxel| is_near(*voxel));
        let goals: Vec<Voxel> = goals.collect();
        let around = |random: &mut Random| {
            let lots = std::iter::repeat_with(|| Vector3::from_fn(|_, _| random.between(-horizon_m, horizon_m)));
            let mut voxels = lots.take(LOTS_A_SAMPLE).map(|d| Voxel::containing(view.from + d, space.resolution()));
            voxels.find(|voxel| is_near(*voxel) && space.reach.contains(*voxel))
        };
        for sample in 0..SAMPLES_A_NODE * nodes {
            if tree.is_full() {
                break;
            }
            let goal = goals.get(random.below(goals.len())).filter(|_| sample.is_multiple_of(2));
            if let Some(voxel) = goal.copied().or_else(|| around(&mut random)) {
                tree.grow(voxel);
            }
        }
        tree
    }

    /// What is worth going for in a tree, as nodes of the best branch from its root on; `None`: nothing is.
    fn best(&self, grown: &Grown<'_>, groups: &[Group<'_>]) -> Option<Vec<usize>> {
        let nodes = grown.tree.nodes();
        let mut worth = vec![0.0; nodes.len()];
        let mut best = (0.0, 0);
        for node in grown.tree.outward().into_iter().filter(|node| *node > 0) {
            let own = gain(&grown.new[node], groups) * (-self.settings.lambda * nodes[node].cost_m).exp();
            worth[node] = worth[nodes[node].parent] + own;
            if worth[node] > best.0 {
                best = (worth[node], node);
            }
        }
        (best.0 > 0.0 && best.0 >= self.settings.least_gain).then(|| grown.tree.branch(best.1))
    }

    /// What is seen from the nodes of a tree is kept, and the branch that is gone.
    fn keep(&mut self, grown: &Grown<'_>, groups: &[Group<'_>], branch: &[usize], resolution: f64) {
        let nodes = grown.tree.nodes();
        let apart = APART_EDGES * self.settings.edge_m / resolution;
        for (node, sighted) in nodes.iter().zip(&grown.sighted) {
            self.kept.note(Place { voxel: node.voxel, gain: gain(sighted, groups) }, LEAST_KEPT, apart);
        }
        self.kept.keep_branch(branch.iter().skip(1).map(|node| nodes[*node].voxel));
    }

    /// The way to the closest of the kept places from which there still is something to be seen, and of the goals.
    fn far(&mut self, view: &View<'_>, groups: &[Group<'_>], prospects: &mut Prospects<'_>) -> Option<Route> {
        let space = view.space;
        let seen = self.kept.places.iter().map(|place| {
            let sighted = prospects.seen_from(place.voxel);
            (Place { gain: gain(&sighted, groups), ..*place }, sighted)
        });
        let seen: Vec<(Place, Sighted)> = seen.filter(|(place, _)| place.gain >= LEAST_KEPT).collect();
        self.kept.places = seen.iter().map(|(place, _)| *place).collect();
        let kept = |voxel: Voxel| seen.binary_search_by_key(&voxel, |(place, _)| place.voxel).ok();
        let is_goal = |voxel| kept(voxel).is_some() || view.goals.contains(voxel);
        let boxes = || view.goals.boxes().chain(seen.iter().map(|(place, _)| [place.voxel; 2]));
        let way = astar::closest_of(&space.reach, space.start(), is_goal, boxes)?;
        let end = *way.last()?;
        let group = kept(end).filter(|_| !view.goals.contains(end)).and_then(|n| largest(&seen[n].1, groups));
        Some(Route::to_look(view, &way, group.map_or(end, |group| aim(view, group))))
    }
}

/// How many frontier voxels are in some groups.
fn gain(sighted: &Sighted, groups: &[Group<'_>]) -> f64 {
    sighted.iter().map(|group| groups[group].size as f64).sum()
}

/// Of some groups the first of the largest.
fn largest<'a, 'b>(sighted: &Sighted, groups: &'b [Group<'a>]) -> Option<&'b Group<'a>> {
    sighted.iter().map(|group| &groups[group]).min_by_key(|group| Reverse(group.size))
}

/// What a route leads to that ends where a group is seen.
fn aim(view: &View<'_>, group: &Group<'_>) -> Voxel {
    group.goal.filter(|_| view.open.is_empty()).unwrap_or(group.target.voxel)
}

impl Strategy for RecedingHorizon {
    fn name(&self) -> &'static str {
        "RecedingHorizon"
    }

    fn describe(&self) -> String {
        let Settings { seed, lambda, horizon_m, edge_m, nodes, least_gain } = self.settings;
        format!(
            "seed {seed}, lambda {lambda} 1/m, {nodes} nodes within {horizon_m} m, edges of {edge_m} m, least gain {least_gain}"
        )
    }

    fn looks_from_afar(&self) -> bool {
        true
    }

    fn plan(&mut self, view: &View<'_>, journal: &mut Journal) -> Option<Route> {
        if let Some(goal) = journal.time("views", || in_sight(view)) {
            return Some(Route { points: vec![view.from], goal });
        }
        let groups = groups(view, MOST_GROUPS);
        let mut prospects = Prospects::new(view, &groups);
        // What is seen from here costs no way.
        if let Some(group) = journal.time("views", || largest(&prospects.seen_from_start(view), &groups)) {
            return Some(Route { points: vec![view.from], goal: aim(view, group) });
        }
        let tree = journal.time("tree", || self.grow(view));
        journal.count("nodes", tree.nodes().len() as u64);
        let grown = journal.time("gain", || Grown::of(tree, &mut prospects));
        let branch = self.best(&grown, &groups);
        self.keep(&grown, &groups, branch.as_deref().unwrap_or_default(), view.space.resolution());
        journal.draw(|| pictures::tree(&grown.edges(), &grown.places(branch.as_deref().unwrap_or_default())));
        let Some(branch) = branch else {
            journal.count("plans beyond the horizon", 1);
            return journal.time("search", || self.far(view, &groups, &mut prospects));
        };
        let first = branch.iter().position(|node| *node > 0 && grown.new[*node].iter().next().is_some())?;
        let group = largest(&grown.new[branch[first]], &groups)?;
        Some(Route { points: grown.places(&branch[..=first]), goal: aim(view, group) })
    }

    fn memory(&self) -> Result<Option<StrategyMemory>, LeaveError> {
        StrategyMemory::of::<Kept>(&self.kept).map(Some)
    }

    fn recall(&mut self, left: &StrategyMemory) -> Result<(), DecodeError> {
        self.kept = left.take::<Kept>()?;
        self.kept.places.sort_by_key(|place| place.voxel);
        Ok(())
    }
}

impl<'a> Grown<'a> {
    /// A tree looked from, from whose root nothing is seen.
    fn of(tree: Tree<'a>, prospects: &mut Prospects<'_>) -> Self {
        let there = tree.nodes().iter().skip(1).map(|node| prospects.seen_from(node.voxel));
        let sighted: Vec<Sighted> = std::iter::once(Sighted::default()).chain(there).collect();
        let (mut on_branch, mut new) = (sighted.clone(), sighted.clone());
        for node in tree.outward().into_iter().filter(|node| *node > 0) {
            let before = &on_branch[tree.nodes()[node].parent];
            new[node] = sighted[node].without(before);
            on_branch[node] = sighted[node].or(before);
        }
        Self { tree, sighted, new }
    }

    /// Where nodes are (m, world).
    fn places(&self, nodes: &[usize]) -> Vec<Point3<f64>> {
        nodes.iter().map(|node| self.tree.nodes()[*node].position).collect()
    }

    /// Both ends of each edge (m, world).
    fn edges(&self) -> Vec<[Point3<f64>; 2]> {
        let nodes = self.tree.nodes();
        nodes.iter().skip(1).map(|node| [nodes[node.parent].position, node.position]).collect()
    }
}

#[cfg(test)]
mod tests;
