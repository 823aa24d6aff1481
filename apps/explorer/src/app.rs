//! An explorer as an app: map updates and requests in, plans out.

use std::ops::RangeInclusive;

use elk_bus::clock::thread_cpu_secs;
use elk_bus::drawing::Drawing;
use elk_bus::{App, AppError, Comms, Handlers, Mail, Origin, Rejection, any, asked_to_stop, number, tell};
use elk_geometry::clearance::Clearance;
use elk_geometry::delta::Changes;
use elk_geometry::limits::RESOLUTIONS_M;
use elk_geometry::{Bounds, Voxel, VoxelSet};
use elk_mission::{Kind, ParamSpec, Params};
use elk_spatial::Replica;
use elk_spatial::checks::{CLEARANCES_M, MAX_BRICKS, MAX_REVISIONS_AHEAD, SPACINGS_M, path_in};
use elk_spatial::keyframe::MapPart;
use elk_spatial::keys::{
    EXPLORATION_REPORT, EXPLORER_GOALS, EXPLORER_MEMORY, EXPLORER_PAST, MAP, MAP_CONFIDENCE, MAP_KNOWN, MAP_PART,
    MAP_RECALL, MAP_REQUEST, MAP_UNSURE, MAP_UPDATE, PLAN, PLAN_REQUEST, strategy_memory,
};
use elk_spatial::map::{MapUpdate, UpdateError};
use elk_spatial::messages::{Decision, ExplorerMemory, ExplorerPast, MapStatus, Plan, PlanRequest};
use nalgebra::Vector3;

use crate::explore::{Explorer, Settings};
use crate::policy::Policy;
use crate::requests::{MOST_ASKERS, Requests};
use crate::strategy::Strategy;
use crate::strategy_memory::StrategyMemory;

/// A parameter with a default.
pub(crate) const fn param(name: &'static str, kind: Kind, default: &'static str, doc: &'static str) -> ParamSpec {
    ParamSpec { name, kind, default: Some(default), doc }
}

const fn metres(range: &RangeInclusive<f64>) -> Kind {
    Kind::Number { unit: "m", min: *range.start(), max: *range.end() }
}

const POINT: Kind = Kind::Point { unit: "m" };
const SIZE: Kind = Kind::Size { unit: "m" };
const COUNT: Kind = Kind::Integer { min: 1, max: 1_000_000_000 };

const MID: ParamSpec = param("Mid", POINT, "0; 0; 0", "Middle of the volume to explore.");
const DIM: ParamSpec =
    param("Dim", SIZE, "0; 0; 0", "Size of the volume to explore; all 0: everything that can be reached.");
const PLANAR: ParamSpec = param(
    "Planar",
    Kind::Flag,
    "false",
    "The robot stays at the height at which it is, and explores the slice of the map there (thesis 6.5.4).",
);
const RES: ParamSpec = param("Res", metres(&RESOLUTIONS_M), "0.1", "Edge of a voxel: the map's.");
const POLICY: ParamSpec = param(
    "Policy",
    Kind::Choice(&["elk", "thesis"]),
    "elk",
    "How paths are followed and where scans are taken: to their end, looking along them (thesis), or until the target is \
     in sight, straightened, looking at it, and no longer than it is unresolved (elk).",
);
const RADIUS: ParamSpec =
    param("Radius", metres(&CLEARANCES_M), "0.1", "Radius of a ball around the robot that is kept clear of obstacles.");
const SPACING: ParamSpec = param("ScanSpacing", metres(&SPACINGS_M), "0.4", "Length of way between two scans.");
const MIN_FRONTIER: ParamSpec =
    param("MinFrontier", COUNT, "1", "Clusters of fewer frontier voxels than this are left alone.");
const ATTEMPTS: ParamSpec = param(
    "Attempts",
    COUNT,
    "4",
    "Distinct places from which a frontier voxel, or one of little confidence, is looked at in vain before it is given up.",
);
const CONFIDENCE: ParamSpec = param(
    "Confidence",
    Kind::Number { unit: "", min: 0.0, max: 0.999 },
    "0",
    "When no frontier is left, voxels that are occupied with a smaller probability (no unit) are looked at again, from Attempts places \
     each at most (thesis 7.2, 1); at most 0.5, with which a voxel is occupied at all: none is.",
);
const MAX_SCANS: ParamSpec = param("MaxScans", COUNT, "10000", "A run that takes more scans than this has failed.");
const PATIENCE: ParamSpec = param(
    "Patience",
    COUNT,
    "100",
    "A run that learns nothing new in this many scans has failed, and so has one in which the sensor refuses as many motions.",
);
const MAX_BRICKS_PARAM: ParamSpec = param(
    "MaxBricks",
    Kind::Integer { min: 64, max: MAX_BRICKS as i64 },
    "32768",
    "Bricks of 8x8x8 voxels that the map may have: the map's.",
);
/// The parameters that all explorers have.
pub const COMMON: &[ParamSpec] = &[
    MID,
    DIM,
    PLANAR,
    RES,
    POLICY,
    RADIUS,
    SPACING,
    MIN_FRONTIER,
    ATTEMPTS,
    CONFIDENCE,
    MAX_SCANS,
    PATIENCE,
    MAX_BRICKS_PARAM,
];

/// An explorer of any strategy with the parameters that all share.
pub fn app(params: &Params, strategy: Box<dyn Strategy>) -> Result<Box<dyn App>, AppError> {
    let settings = settings(params)?;
    let confidence = settings.confidence;
    let explorer = Explorer::new(strategy, settings);
    // The table keeps the number of bricks positive.
    let max_bricks = params.integer("MaxBricks") as usize;
    let app = ExplorerApp {
        explorer,
        replica: Replica::new(Some(params.number("Res")), max_bricks),
        max_bricks,
        said_full: false,
        requests: Requests::default(),
        plan: None,
        drawn: Vec::new(),
        confidence,
        unsure_at: 0,
    };
    Ok(Box::new(app.on_the_bus()))
}

fn settings(params: &Params) -> Result<Settings, AppError> {
    let spacing = params.number("ScanSpacing");
    // The table keeps these between 1 and 10⁹.
    let count = |name| params.integer(name) as u64;
    Ok(Settings {
        policy: match params.text("Policy") {
            "thesis" => Policy::thesis(spacing),
            _ => Policy::elk(spacing),
        },
        bounds: bounds(params),
        // What is occupied is so with more than half.
        confidence: Some(params.number("Confidence")).filter(|confidence| *confidence > 0.5),
        planar: params.flag("Planar"),
        radius_m: params.number("Radius"),
        clearance: Clearance::new(params.number("Radius"), params.number("Res"))?,
        min_frontier: count("MinFrontier") as usize,
        attempts: count("Attempts") as usize,
        max_scans: count("MaxScans"),
        patience: count("Patience"),
        clock: thread_cpu_secs,
        is_to_stop: asked_to_stop,
    })
}

fn bounds(params: &Params) -> Option<Bounds> {
    let dim = Vector3::from(params.point("Dim"));
    (dim != Vector3::zeros()).then(|| Bounds::from_mid_dim(params.point("Mid").into(), dim))
}

/// An [`Explorer`] on the bus.
pub struct ExplorerApp {
    explorer: Explorer,
    replica: Replica,
    /// Bricks that the map may have.
    max_bricks: usize,
    /// Whether the map has said last that it is full.
    said_full: bool,
    /// Requests whose revision of the map is not here yet.
    requests: Requests,
    /// The last plan, to be given again if it is asked for again.
    plan: Option<Plan>,
    /// Names of what the strategy has drawn of it.
    drawn: Vec<String>,
    /// Probability below which an occupied voxel is looked at again.
    confidence: Option<f64>,
    /// The revision of the map of which it has last heard such voxels.
    unsure_at: u64,
}

impl ExplorerApp {
    fn on_the_bus(self) -> impl App {
        let own = strategy_memory(self.explorer.strategy());
        let handlers = Handlers::<Self>::new();
        // Before each update comes what of the map it looks at again.
        let handlers = if self.confidence.is_some() { handlers.on(&MAP_UNSURE, Self::on_unsure) } else { handlers };
        handlers
            .on_start_up(Self::introduce)
            // What the memory goes on from is known when it comes.
            .recall(&EXPLORER_PAST, Self::hear_of_past)
            .recall(&EXPLORER_MEMORY, Self::succeed)
            // Who left it is known by then.
            .recall(any(own.as_str()), Self::recall_strategy)
            .on(&MAP, Self::on_map)
            .on(&MAP_UPDATE, Self::on_map)
            .on(&MAP_PART, Self::on_map_part)
            // It comes with the update, and so before any request that follows from that.
            .on(&MAP_KNOWN, Self::on_status)
            .on(number(MAP_RECALL), Self::on_map_recall)
            .on_with(&PLAN_REQUEST, Self::on_request)
            .with(self)
    }

    fn introduce(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        tell(format_args!("{}: {}", comms.name(), self.explorer.describe()));
        if let Some(confidence) = self.confidence {
            comms.notify(MAP_CONFIDENCE, confidence)?;
        }
        // Asked now, so that the answer is there before the first plan.
        comms.is_watched()?;
        Ok(())
    }

    fn hear_of_past(&mut self, _: &mut Comms, past: ExplorerPast) -> Result<(), AppError> {
        self.explorer.hear_of_past(past);
        Ok(())
    }

    fn succeed(&mut self, comms: &mut Comms, left: ExplorerMemory) -> Result<(), AppError> {
        if let Some(remark) = self.explorer.succeed(&left) {
            tell(format_args!("{}: {remark}", comms.name()));
        }
        self.plan = Some(left.plan);
        Ok(())
    }

    fn recall_strategy(&mut self, comms: &mut Comms, left: Mail<'_>) -> Result<(), AppError> {
        let memory = StrategyMemory::left(left.value()).ok_or_else(|| Rejection::new("it has to be a typed value"))?;
        if let Some(remark) = self.explorer.recall(&memory) {
            tell(format_args!("{}: {remark}", comms.name()));
        }
        Ok(())
    }

    fn on_status(&mut self, _: &mut Comms, status: MapStatus) -> Result<(), AppError> {
        self.said_full = status.full;
        self.explorer.hear_of_rays(status.rays.no_return);
        self.explorer.hear_of_camera(&status.camera, status.resolution);
        self.look_whether_full();
        Ok(())
    }

    fn on_map_recall(&mut self, comms: &mut Comms, revision: f64) -> Result<(), AppError> {
        self.replica.answer(comms, revision)
    }

    /// Takes note of whether the map is full. One that is has most of its bricks in every copy; one of which that is not true
    /// is not believed to be, yet: the copy of a successor comes after the word.
    fn look_whether_full(&mut self) {
        let grid = self.replica.grid();
        let full = self.said_full && 2 * grid.bricks().len() >= self.max_bricks;
        self.explorer.hear_whether_full(full, grid);
    }

    fn on_request(&mut self, comms: &mut Comms, request: PlanRequest, mail: &Mail<'_>) -> Result<(), AppError> {
        let asker = mail.source();
        let revision = self.replica.grid().revision();
        if revision > 0 && request.revision > revision + MAX_REVISIONS_AHEAD {
            return Err(Rejection::new(UpdateError::Ahead { have: revision, update: request.revision }).into());
        }
        self.replica.hear_of(request.revision);
        self.ask_for_map(comms)?;
        self.look_at_place(&request)?;
        if let Some((left_out, request)) = self.requests.add(asker, request, revision) {
            let why =
                format!("revision is {}; {MOST_ASKERS} others wait for what comes before already", request.revision);
            if left_out == asker {
                return Err(Rejection::new(why).into());
            }
            tell(format_args!("{}: no plan for request {} of {left_out}: {why}", comms.name(), request.id));
        }
        self.answer(comms)
    }

    /// Whether the robot can be where it is said to be: in the map, and near what is known of it. Of a map in which there is
    /// nothing it may be outside; that is then why there is nothing.
    fn look_at_place(&self, request: &PlanRequest) -> Result<(), Rejection> {
        let grid = self.replica.grid();
        let place = request.pose.position();
        let robot = Voxel::containing(place, grid.resolution());
        let unheard_of = self.replica.is_doubtful() || grid.bricks().is_empty() || request.revision > grid.revision();
        if unheard_of || (robot.is_mappable() && grid.knows_near(robot)) {
            return Ok(());
        }
        let (x, y, z) = (place.x, place.y, place.z);
        Err(Rejection::new(format_args!("pose is at ({x:.2}; {y:.2}; {z:.2}) m; it has to be near what the map knows")))
    }

    fn on_map(&mut self, comms: &mut Comms, update: MapUpdate) -> Result<(), AppError> {
        let taken = self.replica.take(&update);
        self.go_on_with(comms, taken)
    }

    /// The voxels that are occupied with little confidence, all of them.
    fn on_unsure(&mut self, comms: &mut Comms, unsure: MapUpdate) -> Result<(), AppError> {
        let (own, have) = (self.replica.grid().resolution(), unsure.resolution);
        if (own - have).abs() > 1e-9 * own {
            return Err(Rejection::new(UpdateError::Resolution { have: own, update: have }).into());
        }
        let mut voxels = VoxelSet::new();
        unsure.bricks.iter().for_each(|brick| voxels.unite(brick.position(), brick.unpack().occupied()));
        self.explorer.hear_of_unsure(voxels);
        // A client that says an old revision holds nothing up.
        self.unsure_at = self.unsure_at.max(unsure.revision);
        self.answer(comms)
    }

    fn on_map_part(&mut self, comms: &mut Comms, part: MapPart) -> Result<(), AppError> {
        let taken = self.replica.take_part(&part);
        self.go_on_with(comms, taken)
    }

    fn go_on_with(&mut self, comms: &mut Comms, taken: Result<Option<Changes>, UpdateError>) -> Result<(), AppError> {
        self.ask_for_map(comms)?;
        if let Some(changes) = taken.map_err(Rejection::new)? {
            self.explorer.hear_of_map(self.replica.grid(), changes.voxels());
            self.look_whether_full();
        }
        self.answer(comms)
    }

    fn ask_for_map(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        if self.replica.take_question() {
            comms.notify(MAP_REQUEST, 1.0)?;
        }
        Ok(())
    }

    /// Answers the requests that wait, once the map is there for them, and nothing speaks against that map.
    fn answer(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        if self.replica.is_doubtful() {
            return Ok(());
        }
        let known = self.replica.grid().revision();
        // In the order in which the map says them, what is unsure in a revision is there before it.
        let revision = if self.confidence.is_some() { known.min(self.unsure_at) } else { known };
        self.requests.take_due(revision).into_iter().try_for_each(|request| self.answer_one(comms, request))
    }

    fn answer_one(&mut self, comms: &mut Comms, request: PlanRequest) -> Result<(), AppError> {
        if let Err(rejection) = self.look_at_place(&request) {
            tell(format_args!("{}: no plan for request {}: {rejection}", comms.name(), request.id));
            return Ok(());
        }
        if self.plan.as_ref().is_some_and(|plan| self.answers(plan, &request)) {
            return self.say(comms);
        }
        self.explorer.watch(comms.is_watched()?);
        let plan = self.explorer.plan(self.replica.grid(), &request);
        let drawings = self.explorer.take_drawings();
        if asked_to_stop() {
            // It was perhaps given up half-way.
            return Ok(());
        }
        // Before it is said: who has heard a plan can rely on every explorer to come to know it.
        let (memory, own) = self.explorer.memory(&plan);
        if let Some(own) = own {
            let variable = strategy_memory(self.explorer.strategy());
            comms.publish_value(&variable, own.value(), Origin::default())?;
        }
        comms.publish(&EXPLORER_MEMORY, &memory)?;
        if let Some(past) = self.explorer.take_past() {
            comms.publish(&EXPLORER_PAST, &past)?;
        }
        if let Some(candidates) = self.explorer.take_candidates(&request, plan.revision) {
            comms.publish(&EXPLORER_GOALS, &candidates)?;
        }
        self.plan = Some(plan);
        self.say(comms)?;
        self.draw(comms, drawings)
    }

    /// Shows what the strategy has drawn, and no longer what it had drawn before.
    fn draw(&mut self, comms: &mut Comms, drawings: Vec<Drawing>) -> Result<(), AppError> {
        let names: Vec<String> = drawings.iter().map(|drawing| drawing.name.clone()).collect();
        for over in std::mem::replace(&mut self.drawn, names).into_iter().filter(|name| !self.drawn.contains(name)) {
            comms.draw(&Drawing::new(over))?;
        }
        drawings.iter().try_for_each(|drawing| Ok(comms.draw(drawing)?))
    }

    /// Whether a plan is an answer to a request. One that was answered already comes again if one of the two, who asks and
    /// who answers, was exchanged or died, and the answer was perhaps lost. A plan that was only remembered has to be one of
    /// this map.
    fn answers(&self, plan: &Plan, request: &PlanRequest) -> bool {
        let grid = self.replica.grid();
        let right = plan.request == request.id && (request.revision..=grid.revision()).contains(&plan.revision);
        right
            && match &plan.decision {
                Decision::Go(path) => path_in(grid, &path.points, plan.motion.clearance_m).is_ok(),
                Decision::Done => true,
            }
    }

    fn say(&self, comms: &mut Comms) -> Result<(), AppError> {
        if let Some(report) = self.explorer.report() {
            comms.publish(&EXPLORATION_REPORT, report)?;
        }
        self.plan.iter().try_for_each(|plan| Ok(comms.publish(&PLAN, plan)?))
    }
}
