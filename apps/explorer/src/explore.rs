//! One explorer: from a map and a pose to the next path, until nothing is left that can be reached and seen.

mod agenda;
mod inspection;
mod memory;
mod nearest;
mod scene;
mod settings;
mod slice;
mod verdict;

pub use settings::Settings;

use std::borrow::Borrow;
use std::collections::BTreeSet;

use elk_bus::drawing::Drawing;
use elk_bus::tell;
use elk_geometry::clearance::Clearance;
use elk_geometry::frontier::Edges;
use elk_geometry::{Bounds, FrontierSet, OccupancyGrid, Polyline, Pose, Voxel, VoxelSet, mask};
use elk_spatial::CameraInfo;
use elk_spatial::candidates::Candidates;
use elk_spatial::checks::MAX_COUNT;
use elk_spatial::messages::{
    Decision, ExplorationReport, ExplorerMemory, ExplorerPast, FrontiersLeft, Path, Plan, PlanRequest, Standing,
};
use nalgebra::Point3;

use crate::goals::{Goal, Goals};
use crate::journal::Journal;
use crate::policy::looks;
use crate::route_fault::{RouteFault, passable};
use crate::sight::Sight;
use crate::space::Space;
use crate::strategy::{Route, Strategy, View};
use crate::strategy_memory::StrategyMemory;
use crate::target::{Known, Target};
use crate::weighed::Weighed;
use inspection::{Inspection, UnsureLeft, Vantage};
use memory::Memory;
use scene::Scene;
use slice::slab;
use verdict::{StopReason, Verdict};

/// The counters of an inspection: unsure voxels when it began, places that were gone to, and what is unsure in the end.
const UNSURE: &str = "unsure before inspection";
const INSPECTED: &str = "places of inspection";
const IN_VAIN: &str = "unsure, inspected in vain";
const UNSEEN: &str = "unsure, invisible";
const OPEN: &str = "unsure, open";
const COME: &str = "unsure since inspection";

/// Plans, remembers what it tried, and knows when it is done.
pub struct Explorer {
    strategy: Box<dyn Strategy>,
    /// The explorer before this one had the same strategy, which left a memory of its own.
    is_heir: bool,
    settings: Settings,
    memory: Memory,
    /// What a predecessor's memory goes on from.
    past: ExplorerPast,
    journal: Journal,
    plans: u64,
    report: Option<ExplorationReport>,
    /// Rays of all scans that went without a return.
    no_return: u64,
    /// What the camera sees.
    sight: Sight,
    /// The goals that were weighed for the last plan.
    weighed: Weighed,
    frontier: FrontierSet,
    /// What is occupied with little confidence.
    inspection: Inspection,
    /// What the last plan was made over.
    scene: Option<Scene>,
    /// Voxels in which the map has changed since.
    changed: VoxelSet,
    /// The volume to explore, all of it; what of it is explored is in the settings.
    volume: Option<Bounds>,
    /// The layer of voxels that a robot explores which stays in it, by its index along z.
    layer: Option<i32>,
    /// Whether the map is full.
    is_full: bool,
    /// What the robot keeps clear of; in the settings is what of it the sensor can tell.
    clearance: Clearance,
}

impl Explorer {
    /// An explorer that has seen nothing yet.
    pub fn new(strategy: Box<dyn Strategy>, settings: Settings) -> Self {
        Self {
            strategy,
            is_heir: false,
            memory: Memory::default(),
            past: ExplorerPast::default(),
            journal: Journal::new(settings.clock).heeding(settings.is_to_stop),
            frontier: FrontierSet::new(settings.bounds),
            inspection: Inspection::default(),
            volume: settings.bounds,
            layer: None,
            is_full: false,
            clearance: settings.clearance.clone(),
            settings,
            plans: 0,
            report: None,
            no_return: 0,
            sight: Sight::default(),
            weighed: Weighed::default(),
            scene: None,
            changed: VoxelSet::new(),
        }
    }

    /// The map has changed in these voxels, and is `grid` now. Every change is to be told, the first map as one from nothing:
    /// what a plan is made over is what the last one was, but for them.
    pub fn hear_of_map(&mut self, grid: &OccupancyGrid, changed: impl IntoIterator<Item = impl Borrow<Voxel>>) {
        let changed: VoxelSet = changed.into_iter().map(|voxel| *voxel.borrow()).collect();
        self.frontier.follow(grid, &changed);
        changed.bricks().for_each(|(brick, cells)| self.changed.unite(brick, cells));
    }

    /// These voxels of the map are unsure, occupied with less confidence than the settings ask for, and no others: they are looked at again
    /// when no frontier is left to be resolved.
    pub fn hear_of_unsure(&mut self, unsure: VoxelSet) {
        self.inspection.hear_of(unsure);
    }

    /// Whether the map is full, and comes to know nothing of bricks that it does not have.
    pub fn hear_whether_full(&mut self, full: bool, grid: &OccupancyGrid) {
        self.is_full = full;
        let rim = self.frontier.set_full(full, grid);
        rim.into_iter().for_each(|brick| self.changed.unite(brick, &mask::ALL));
    }

    /// The frontier of the volume that it explores.
    pub fn frontier(&self) -> &FrontierSet {
        &self.frontier
    }

    /// The scans are taken with this camera, and go into a map of voxels of `resolution` (m).
    pub fn hear_of_camera(&mut self, camera: &CameraInfo, resolution: f64) {
        let sight =
            if self.settings.planar { Sight::in_layer(camera, resolution) } else { Sight::of(camera, resolution) };
        if sight.is_level != self.sight.is_level {
            // Of what is above and below, a fan never says that it is free.
            self.settings.clearance = if sight.is_level { self.clearance.in_layer() } else { self.clearance.clone() };
            self.scene = None;
        }
        self.sight = sight;
    }

    /// Of the rays of all scans so far, so many went without a return. Where nothing is seen, looking again is in vain.
    pub fn hear_of_rays(&mut self, no_return: u64) {
        self.no_return = no_return;
    }

    /// The strategy, its settings and the policy, in one line.
    pub fn describe(&self) -> String {
        let strategy = [self.strategy.name().to_string(), self.strategy.describe()];
        let named = strategy.iter().filter(|s| !s.is_empty());
        let named: Vec<&str> = named.map(String::as_str).collect();
        let slice = if self.settings.planar { "; the slice of the map at the robot's height" } else { "" };
        let (policy, radius) = (self.settings.policy.describe(), self.settings.radius_m);
        let again =
            self.settings.confidence.map(|least| format!("; what is occupied with less than {least} is inspected"));
        format!("{}; {policy}; clearance {radius} m{slice}{}", named.join(": "), again.unwrap_or_default())
    }

    /// Why it ended and what is left; there once a plan was [`Decision::Done`].
    pub fn report(&self) -> Option<&ExplorationReport> {
        self.report.as_ref()
    }

    /// What the memory of another explorer goes on from, if that is one that does.
    pub fn hear_of_past(&mut self, past: ExplorerPast) {
        self.past = past;
    }

    /// Goes on where another explorer, of whatever strategy, stopped. Answers why what that one's strategy itself remembered is
    /// not taken over, if it is another's; if not, [`Explorer::recall`] takes it.
    pub fn succeed(&mut self, left: &ExplorerMemory) -> Option<String> {
        self.memory = Memory::recall(left, &self.past);
        // It was made with another memory.
        self.scene = None;
        self.no_return = self.no_return.max(left.no_return);
        self.journal.recall(left);
        self.plans = left.plans;
        self.report = left.ended.clone();
        let name = self.strategy.name();
        self.is_heir = left.strategy.as_deref() == Some(name);
        let of = left.strategy.as_deref().filter(|of| *of != name)?;
        Some(format!("what {of} itself remembered is left aside: it goes on as {name}"))
    }

    /// Goes on with what the strategy of the explorer before this one left, if that had the same one. Answers why it does not,
    /// if the strategy cannot make use of it.
    pub fn recall(&mut self, left: &StrategyMemory) -> Option<String> {
        if !self.is_heir {
            return None;
        }
        let why = self.strategy.recall(left).err()?;
        Some(format!("what {} itself remembered is left aside: {why}", self.strategy.name()))
    }

    /// The strategy's name.
    pub fn strategy(&self) -> &'static str {
        self.strategy.name()
    }

    /// What the strategy itself leaves. What cannot be left is no reason to plan nothing.
    fn strategy_memory(&self) -> Option<StrategyMemory> {
        self.strategy.memory().unwrap_or_else(|error| {
            tell(format_args!("{} leaves no memory of its own: {error}", self.strategy.name()));
            None
        })
    }

    /// Takes the goals that the strategy weighed for the last plan; `None`: it weighed none, or they were taken.
    pub fn take_candidates(&mut self, request: &PlanRequest, revision: u64) -> Option<Candidates> {
        let weighed = std::mem::take(&mut self.weighed);
        let (request, from, count) = (request.id, request.pose, weighed.count);
        (count > 0).then(|| Candidates { request, revision, from, weighed: count, goals: weighed.into_goals() })
    }

    /// Whether anybody looks at what the strategy draws.
    pub fn watch(&mut self, is_watched: bool) {
        self.journal.watch(is_watched);
    }

    /// What the strategy has drawn of the last plan.
    pub fn take_drawings(&mut self) -> Vec<Drawing> {
        self.journal.take_drawings()
    }

    /// What a successor has to know, `plan` being the last one: never more than it believes, whatever this one was left; and
    /// what the strategy leaves besides.
    pub fn memory(&self, plan: &Plan) -> (ExplorerMemory, Option<StrategyMemory>) {
        let own = self.strategy_memory();
        let mut memory = ExplorerMemory {
            plan: plan.clone(),
            ended: self.report.clone(),
            plans: self.plans,
            fallbacks: self.journal.fallbacks.min(MAX_COUNT),
            counters: self.journal.counters().to_vec(),
            strategy: own.is_some().then(|| self.strategy.name().to_owned()),
            cpu_secs: self.journal.phases().to_vec(),
            goes_on: false,
            lists: ExplorerPast::default(),
            standing: Standing::default(),
            progress_at: 0,
            refused: 0,
            no_return: 0,
        };
        self.memory.leave(&mut memory);
        (memory, own)
    }

    /// What the memories that come go on from, if that is another past than before: it is that of the last one, and to be said after
    /// it.
    pub fn take_past(&mut self) -> Option<ExplorerPast> {
        self.memory.take_past()
    }

    /// Answers a request from a map at the asked revision, all of whose changes it has heard of.
    pub fn plan(&mut self, grid: &OccupancyGrid, request: &PlanRequest) -> Plan {
        if self.settings.planar {
            self.stay_level(grid, Voxel::containing(request.pose.position(), grid.resolution()).z);
        }
        let frontier = std::mem::take(&mut self.frontier);
        let plan = self.plan_over(Known { grid, frontier: &frontier, sight: self.sight }, request);
        self.frontier = frontier;
        plan
    }

    /// What it explores is a layer of voxels; the frontier of another one is made anew.
    fn stay_level(&mut self, grid: &OccupancyGrid, layer: i32) {
        if self.layer.replace(layer) == Some(layer) {
            return;
        }
        self.settings.bounds = Some(slab(self.volume, layer, grid.resolution()));
        self.frontier = FrontierSet::new(self.settings.bounds);
        self.frontier.set_full(self.is_full, grid);
        self.frontier.update(grid, grid.bricks().voxels().map(|(voxel, _)| voxel));
        self.scene = None;
    }

    fn plan_over(&mut self, known: Known, request: &PlanRequest) -> Plan {
        let before = self.journal.total_secs();
        self.plans = (self.plans + 1).min(MAX_COUNT);
        self.inspection.learn(known, request, &mut self.memory);
        self.memory.learn(request, known, self.settings.policy.scan_spacing_m, self.no_return);
        self.weighed = Weighed::default();
        Plan {
            request: request.id,
            revision: known.grid.revision(),
            decision: self.decide(known, request),
            motion: self.settings.policy.motion(self.settings.radius_m, self.sight.is_level),
            cpu_secs: self.journal.total_secs() - before,
        }
    }

    fn decide(&mut self, known: Known, request: &PlanRequest) -> Decision {
        let from = request.pose.position();
        let (memory, settings) = (&self.memory, &self.settings);
        let (before, changed) = (self.scene.take(), std::mem::take(&mut self.changed));
        let mut scene = self.journal.time("space", || Scene::around(known, from, (before, changed), memory, settings));
        self.sort_out(&mut scene, known);
        let decision = self.decide_on(&mut scene, known, request);
        self.scene = Some(scene);
        decision
    }

    fn decide_on(&mut self, scene: &mut Scene, known: Known, request: &PlanRequest) -> Decision {
        let from = request.pose.position();
        if request.revision >= self.settings.max_scans {
            return self.stop(StopReason::TooManyScans, scene, known);
        }
        if self.memory.scans_without_progress(request.revision) >= self.settings.patience {
            return self.stop(StopReason::NoProgress, scene, known);
        }
        if self.memory.refused() >= self.settings.patience {
            return self.stop(StopReason::Refused, scene, known);
        }
        // Perhaps the robot stands in a corner that became too tight.
        if scene.agenda.goals().is_empty() && self.journal.time("space", || scene.back_off()) {
            self.sort_out(scene, known);
        }
        let far;
        let goals = match scene.agenda.goals().is_empty() {
            true => {
                far = self.far_goals(scene, known);
                &far
            }
            false => scene.agenda.goals(),
        };
        if goals.is_empty() {
            return match self.inspect(scene, known, from) {
                Some(path) => {
                    self.report = None;
                    Decision::Go(path)
                }
                None => self.stop(StopReason::Explored, scene, known),
            };
        }
        let open = match self.strategy.looks_from_afar() {
            true => self.journal.time("goals", || scene.agenda.targets(known, &self.memory)),
            false => Vec::new(),
        };
        match self.choose((&scene.space, &mut scene.unseen), (goals, &open), from) {
            Some((goal, way)) => {
                // Whoever goes on has not ended, whatever a predecessor or a request out of turn came to.
                self.report = None;
                Decision::Go(self.path(scene, known, &goal, way))
            }
            None => self.stop(StopReason::NoWay, scene, known),
        }
    }

    fn sort_out(&mut self, scene: &mut Scene, known: Known) {
        let (learned, memory, settings) = (self.memory.take_learned(), &self.memory, &self.settings);
        self.journal.time("goals", || scene.sort_out(known, learned, memory, settings));
    }

    /// The goals from afar. A target that nothing sees is not looked for again until nothing else is left, or nothing that is nearer:
    /// who left it for the end would come back for it. Only a verdict on the map as it is then counts.
    fn far_goals(&mut self, scene: &mut Scene, known: Known) -> Goals {
        let mut targets = scene.agenda.targets(known, &self.memory);
        let robot = scene.space.start();
        let away = |t: &Target| (t.voxel - robot).to_array().map(|c| i64::from(c).pow(2)).iter().sum::<i64>();
        targets.sort_by_key(away);
        let (fresh, hidden): (Vec<Target>, Vec<Target>) =
            targets.into_iter().partition(|t| !self.memory.is_hidden(t.voxel));
        scene.left.open = 0;
        let goals = self.goals_of(&fresh, scene, known);
        let nearest = goals.iter().map(|goal| away(&goal.target)).min();
        let nearer = nearest.map_or(hidden.len(), |nearest| hidden.partition_point(|target| away(target) < nearest));
        let again = self.goals_of(&hidden[..nearer], scene, known);
        if again.is_empty() { goals } else { again }
    }

    /// Goals from afar of the first of some targets; what becomes of those that have none is kept and counted.
    fn goals_of(&mut self, targets: &[Target], scene: &mut Scene, known: Known) -> Goals {
        let Scene { space, verdicts, left, .. } = scene;
        let (is_to_stop, range_m) = (self.settings.is_to_stop, self.sight.range_m);
        let wanted = targets.iter().take_while(|_| !is_to_stop());
        let (goals, far) = self.journal.time("sight", || Goals::far(space, range_m, wanted, verdicts));
        self.memory.hide(far.invisible.iter().chain(&far.exhausted).copied(), known.frontier);
        if goals.is_empty() {
            left.invisible += far.invisible.len() as u64;
            let (silent, exhausted): (Vec<Voxel>, Vec<Voxel>) =
                far.exhausted.iter().partition(|voxel| self.memory.saw_nothing(**voxel));
            left.no_return += silent.len() as u64;
            left.unresolved += exhausted.len() as u64;
        } else {
            left.open = targets.len() as u64;
        }
        goals
    }

    /// The goal to go to and the whole way there.
    fn choose(
        &mut self,
        (space, unseen): (&Space, &mut Option<BTreeSet<Voxel>>),
        (goals, open): (&Goals, &[Target]),
        robot: Point3<f64>,
    ) -> Option<(Goal, Vec<Point3<f64>>)> {
        let start = space.start();
        // A robot that stands in a goal looks first: for the field it would be source and sink at once.
        let is_here = goals.contains(start);
        let changed = if is_here { None } else { unseen.replace(BTreeSet::new()) };
        let from = if space.escape.len() > 1 { space.center(start) } else { robot };
        let view = View { space, from, goals, open, changed: changed.as_ref(), sight: self.sight, plan: self.plans };
        let here = is_here.then(|| Route { points: vec![view.from], goal: start });
        let route = match here {
            Some(here) => Some((goal_of(&view, &here)?, here)),
            None => self.answer(&view),
        };
        let (goal, route) = route.or_else(|| {
            self.journal.fallbacks += 1;
            let route = view.closest(&mut self.journal)?;
            Some((goal_of(&view, &route)?, route))
        })?;
        self.weighed = self.journal.take_weighed();
        self.weighed.choose(route.goal);
        let mut way = way_out(space, robot);
        way.extend(route.points);
        // The rest is in the goal's voxel.
        let there = way.last().is_some_and(|p| goal.target.seen_from(space, *p));
        if !there {
            way.push(goal.position);
        }
        Some((goal, way))
    }

    /// What the strategy answers, if it does, and it can be gone; what cannot is said the first time, and counted.
    fn answer(&mut self, view: &View<'_>) -> Option<(Goal, Route)> {
        let route = self.strategy.plan(view, &mut self.journal)?;
        let fault = match (passable(view.space, view.from, &route.points), goal_of(view, &route)) {
            (Ok(()), Some(goal)) => return Some((goal, route)),
            (Ok(()), None) => {
                let end = route.points.last().copied().unwrap_or(view.from);
                RouteFault::NoGoal { end, goal: view.space.center(route.goal) }
            }
            (Err(fault), _) => fault,
        };
        if self.journal.faults().0 == 0 {
            let (name, plan) = (self.strategy.name(), self.plans);
            tell(format_args!(
                "{name}: the way of plan {plan} cannot be gone, the closest goal is gone to instead: {fault}"
            ));
        }
        self.journal.blame(self.plans, fault);
        None
    }

    /// The path to follow, and what to do at its end.
    fn path(&mut self, scene: &Scene, known: Known, goal: &Goal, mut way: Vec<Point3<f64>>) -> Path {
        if let Some(height) = way.first().map(|robot| robot.z).filter(|_| self.settings.planar) {
            way.iter_mut().for_each(|point| point.z = height);
        }
        let (space, target) = (&scene.space, &goal.target);
        let (policy, range_m) = (&self.settings.policy, self.sight.range_m);
        let path = self.journal.time("path", || {
            let fixed = Polyline::new(way.iter().copied().take(space.escape.len()));
            let fixed = fixed.map_or(0.0, |f| f.length());
            let whole = Polyline::new(way.iter().copied());
            let shaped = whole.map(|w| policy.shape(space, (target, range_m), w, fixed));
            let points = shaped.map_or(way, |s| s.points().to_vec());
            let end = points.last().copied().unwrap_or(goal.position);
            Path {
                looks: looks(space, known, end, target),
                points,
                target: target.voxel,
                unknown: target.unknown().collect(),
                again: false,
            }
        });
        self.memory.remember(&path);
        path
    }

    /// The path to where most that is unsure is seen from; `None`: nobody asks for that, or all of it is given up.
    fn inspect(&mut self, scene: &Scene, known: Known, robot: Point3<f64>) -> Option<Path> {
        self.settings.confidence?;
        let (space, settings, memory) = (&scene.space, &self.settings, &mut self.memory);
        if self.journal.counters().iter().all(|(name, _)| name != UNSURE) {
            self.journal.count(UNSURE, self.inspection.begin(space, memory, settings));
        }
        let inspection = &self.inspection;
        let vantage = self.journal.time("inspection", || inspection.next(known, space, memory, settings))?;
        let Vantage { target, way, axes } = vantage;
        let mut points = way_out(space, robot);
        points.extend(space.middles(&way));
        if settings.planar {
            points.iter_mut().for_each(|point| point.z = robot.z);
        }
        let points = settings.policy.straightened(space, points, space.escape.len());
        let end = points.last().copied().unwrap_or(robot);
        let looks = axes.into_iter().map(|axis| Pose::looking(end, axis)).collect();
        let path = Path { points, target, unknown: vec![], looks, again: true };
        self.memory.remember(&path);
        self.journal.count(INSPECTED, 1);
        Some(path)
    }

    /// What an inspection came to, for people, and its figures; `None`: there was none.
    fn inspected(&self, scene: &Scene) -> Option<(String, [(&'static str, u64); 4])> {
        let least = self.settings.confidence?;
        let count = |what| self.journal.counters().iter().find(|(name, _)| name == what).map(|(_, count)| *count);
        let (before, places) = (count(UNSURE)?, count(INSPECTED).unwrap_or(0));
        let left = self.inspection.left(&scene.space, &self.memory, &self.settings);
        let UnsureLeft { open, in_vain, unseen, come } = left;
        let how = if open == 0 { "inspected is" } else { "not inspected to the end is" };
        let said = format!(
            "; {how} what was occupied with less than {least} (Confidence), from {places} places: of {before} such voxels before there are \
             {} now, {in_vain} looked at in vain, {unseen} that no place sees, {open} open and {come} that came to it meanwhile",
            left.total()
        );
        Some((said, [(IN_VAIN, in_vain), (UNSEEN, unseen), (OPEN, open), (COME, come)]))
    }

    fn stop(&mut self, why: StopReason, scene: &Scene, known: Known) -> Decision {
        let Edges { map, volume, no_room } = Edges::of(known.grid, known.frontier);
        let left = FrontiersLeft { map_edge: map, volume_edge: volume, no_room, ..scene.left };
        let Verdict { mut complete, mut reason } = Verdict::of(why, &left, scene, known.grid, &self.settings);
        if self.settings.planar {
            let height = scene.space.center(scene.robot()).z;
            reason +=
                &format!("; explored was the slice of the map at z = {height:.2} m, in which the robot stays (Planar)");
        }
        let mut counters = self.journal.counters().to_vec();
        if let Some((said, figures)) = self.inspected(scene) {
            reason += &said;
            counters.extend(figures.map(|(name, count)| (name.to_owned(), count)));
        }
        let (plans, (faults, first)) = (self.plans, self.journal.faults());
        let fallbacks = self.journal.fallbacks.saturating_sub(faults);
        if fallbacks > 0 {
            reason +=
                &format!("; {fallbacks} of {plans} plans led to the closest goal, since the strategy had no answer");
        }
        if faults > 0 {
            complete = false;
            let name = self.strategy.name();
            let first = first.map(|(plan, fault)| format!(", the first in plan {plan}: {fault}")).unwrap_or_default();
            reason = format!(
                "{name} has answered {faults} of {plans} plans with ways that cannot be gone{first}; the closest goal was gone to instead; \
                 else: {reason}"
            );
        }
        self.report = Some(ExplorationReport {
            explorer: self.strategy.name().into(),
            policy: self.settings.policy.name.into(),
            settings: self.describe(),
            complete,
            reason,
            frontiers_left: left,
            plans: self.plans,
            counters,
            cpu_secs: self.journal.phases().to_vec(),
        });
        Decision::Done
    }

    /// What planning cost so far.
    pub fn journal(&self) -> &Journal {
        &self.journal
    }
}

/// The points (m, world) from the robot to where ways through the space start.
fn way_out(space: &Space, robot: Point3<f64>) -> Vec<Point3<f64>> {
    std::iter::once(robot).chain(space.escape.iter().skip(1).map(|voxel| space.center(*voxel))).collect()
}

/// The goal that a route leads to, if it leads to one: it ends in the goal's voxel, or where the goal's target is seen, or a target from
/// afar.
fn goal_of(view: &View<'_>, route: &Route) -> Option<Goal> {
    let position = *route.points.last()?;
    let voxel = Voxel::containing(position, view.space.resolution());
    let afar = || {
        let at = view.open.binary_search_by_key(&route.goal, |target| target.voxel).ok()?;
        let target = &view.open[at];
        target.seen_from(view.space, position).then(|| Goal { voxel, position, target: target.clone() })
    };
    let leads_to = |goal: &&Goal| voxel == goal.voxel || goal.target.seen_from(view.space, position);
    afar().or_else(|| view.goals.at(route.goal).filter(leads_to).cloned())
}

#[cfg(test)]
mod tests;
