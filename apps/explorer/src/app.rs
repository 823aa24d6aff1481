//! An explorer as an app: map updates and requests in, plans out.

use elk_bus::clock::thread_cpu_secs;
use elk_bus::{App, AppError, Comms, Mail, Recall, tell};
use elk_mission::{AppType, Kind, ParamSpec, Params};
use elk_spatial::keys::{
    EXPLORATION_REPORT, EXPLORER_MEMORY, MAP, MAP_RECALL, MAP_REQUEST, MAP_UPDATE, PLAN, PLAN_REQUEST,
};
use elk_spatial::map::MapUpdate;
use elk_spatial::messages::{ExplorerMemory, Plan, PlanRequest};
use elk_spatial::replica::Arrival;
use elk_spatial::{Bounds, FrontierSet, Replica};
use nalgebra::Vector3;

use crate::explore::{Explorer, Settings};
use crate::laplace::Solver;
use crate::policy::Policy;
use crate::strategy::{ClosestFrontier, Potential, Start, Strategy};

/// The explorers that a mission file can name.
pub static TYPES: &[AppType] = &[
    AppType {
        element: "Explorer",
        name: "ClosestFrontier",
        summary: "Goes to the closest frontier, by A*.",
        params: COMMON,
        build: |params| app(params, Box::new(ClosestFrontier)),
    },
    AppType {
        element: "Explorer",
        name: "Potential",
        summary: "Follows a streamline of the harmonic potential between robot and frontier (Laplace's equation, RK4).",
        params: POTENTIAL,
        build: |params| app(params, Box::new(potential(params))),
    },
];

const fn param(name: &'static str, kind: Kind, default: &'static str, doc: &'static str) -> ParamSpec {
    ParamSpec { name, kind, default: Some(default), doc }
}

const fn metres(min: f64, max: f64) -> Kind {
    Kind::Number { unit: "m", min, max }
}

const POINT: Kind = Kind::Point { unit: "m" };
const SIZE: Kind = Kind::Size { unit: "m" };
const COUNT: Kind = Kind::Integer { min: 1, max: 1_000_000_000 };

const MID: ParamSpec = param("Mid", POINT, "0; 0; 0", "Middle of the volume to explore.");
const DIM: ParamSpec =
    param("Dim", SIZE, "0; 0; 0", "Size of the volume to explore; all 0: everything that can be reached.");
const RES: ParamSpec = param("Res", metres(0.001, 10.0), "0.1", "Edge of a voxel: the map's.");
const POLICY: ParamSpec = param(
    "Policy",
    Kind::Choice(&["elk", "thesis"]),
    "elk",
    "How paths are followed and where scans are taken: to their end, looking along them (thesis), or until the target is \
     in sight, straightened, looking at it, and no longer than it is unresolved (elk).",
);
const RADIUS: ParamSpec =
    param("Radius", metres(0.0, 10.0), "0.1", "Radius of a ball around the robot that is kept clear of obstacles.");
const SPACING: ParamSpec = param("ScanSpacing", metres(0.01, 1000.0), "0.4", "Length of way between two scans.");
const MIN_FRONTIER: ParamSpec =
    param("MinFrontier", COUNT, "1", "Clusters of fewer frontier voxels than this are left alone.");
const ATTEMPTS: ParamSpec = param(
    "Attempts",
    COUNT,
    "4",
    "Distinct places from which a frontier voxel is looked at before it is given up as unresolved.",
);
const MAX_SCANS: ParamSpec = param("MaxScans", COUNT, "10000", "A run that takes more scans than this has failed.");
const PATIENCE: ParamSpec =
    param("Patience", COUNT, "100", "A run that learns nothing new in this many scans has failed.");
const START: ParamSpec = param(
    "Start",
    Kind::Choice(&["policy", "flux", "shortest"]),
    "policy",
    "The streamline to follow: the one of largest flux, the shortest of 26, or as the policy has it (thesis: flux, elk: \
     shortest).",
);
const SOLVER: ParamSpec = param(
    "Solver",
    Kind::Choice(&["multigrid", "jacobi", "thesis"]),
    "multigrid",
    "How Laplace's equation is solved: conjugate gradients preconditioned by multigrid or by the diagonal, or \
     Gauss-Seidel as in the thesis.",
);
const TOLERANCE: ParamSpec = param(
    "Tolerance",
    Kind::Number { unit: "", min: 0.0, max: 1.0 },
    "0",
    "When the solver stops: relative residual, for Solver thesis largest relative change; 0: 1e-6, and 1e-4 for thesis.",
);

const COMMON: &[ParamSpec] = &[MID, DIM, RES, POLICY, RADIUS, SPACING, MIN_FRONTIER, ATTEMPTS, MAX_SCANS, PATIENCE];
const POTENTIAL: &[ParamSpec] =
    &[MID, DIM, RES, POLICY, RADIUS, SPACING, MIN_FRONTIER, ATTEMPTS, MAX_SCANS, PATIENCE, START, SOLVER, TOLERANCE];

/// An explorer of any strategy with the parameters that all share.
pub fn app(params: &Params, strategy: Box<dyn Strategy>) -> Result<Box<dyn App>, AppError> {
    let explorer = Explorer::new(strategy, settings(params)?);
    Ok(Box::new(ExplorerApp {
        frontier: explorer.frontier(),
        explorer,
        replica: Replica::new(Some(params.number("Res"))),
        request: None,
        recall: Recall::default(),
        plan: None,
    }))
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
        radius_m: params.number("Radius"),
        min_frontier: count("MinFrontier") as usize,
        attempts: count("Attempts") as usize,
        max_scans: count("MaxScans"),
        patience: count("Patience"),
        clock: thread_cpu_secs,
    })
}

fn bounds(params: &Params) -> Option<Bounds> {
    let dim = Vector3::from(params.point("Dim"));
    (dim != Vector3::zeros()).then(|| Bounds::from_mid_dim(params.point("Mid").into(), dim))
}

fn potential(params: &Params) -> Potential {
    let solver = match params.text("Solver") {
        "thesis" => Solver::Thesis,
        "jacobi" => Solver::Jacobi,
        _ => Solver::Multigrid,
    };
    let start = match (params.text("Start"), params.text("Policy")) {
        ("flux", _) | ("policy", "thesis") => Start::Flux,
        _ => Start::Shortest,
    };
    let tolerance = match params.number("Tolerance") {
        0.0 => solver.usual_tolerance(),
        tolerance => tolerance,
    };
    Potential { start, solver, tolerance }
}

/// An [`Explorer`] on the bus.
pub struct ExplorerApp {
    explorer: Explorer,
    replica: Replica,
    frontier: FrontierSet,
    /// A request whose revision of the map is not here yet.
    request: Option<PlanRequest>,
    recall: Recall,
    /// The last plan, to be given again if it is asked for again.
    plan: Option<Plan>,
}

impl ExplorerApp {
    fn succeed(&mut self, left: ExplorerMemory) {
        self.explorer.succeed(&left);
        self.plan = Some(left.plan);
    }

    /// A request that was answered already comes again if one of the two, who asks and who answers, was exchanged or
    /// died, and the answer was perhaps lost.
    fn on_request(&mut self, comms: &mut Comms, request: PlanRequest) -> Result<(), AppError> {
        let answers = |plan: &Plan| plan.request == request.id && plan.revision >= request.revision;
        if self.plan.as_ref().is_some_and(answers) {
            return self.say(comms);
        }
        self.request = Some(request);
        self.answer(comms)
    }

    fn on_map(&mut self, comms: &mut Comms, update: &MapUpdate) -> Result<(), AppError> {
        match self.replica.take(update)? {
            Arrival::Applied(changed) => self.frontier.update(self.replica.grid(), &changed),
            Arrival::Old => {}
            Arrival::Gap => comms.notify(MAP_REQUEST, 1.0)?,
        }
        self.answer(comms)
    }

    fn answer(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        let revision = self.replica.grid().revision();
        let Some(request) = self.request.take_if(|r| r.revision <= revision) else {
            return Ok(());
        };
        let plan = self.explorer.plan(self.replica.grid(), &self.frontier, &request);
        // Before it is said: who has heard a plan can rely on every explorer to come to know it.
        comms.publish(&EXPLORER_MEMORY, &self.explorer.memory(&plan))?;
        self.plan = Some(plan);
        self.say(comms)
    }

    fn say(&self, comms: &mut Comms) -> Result<(), AppError> {
        if let Some(report) = self.explorer.report() {
            comms.publish(&EXPLORATION_REPORT, report)?;
        }
        self.plan.iter().try_for_each(|plan| Ok(comms.publish(&PLAN, plan)?))
    }
}

impl App for ExplorerApp {
    fn on_start_up(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        tell(format_args!("{}: {}", comms.name(), self.explorer.describe()));
        self.recall.ask(comms, &EXPLORER_MEMORY)?;
        comms.register(&MAP)?;
        comms.register(&MAP_UPDATE)?;
        comms.register_variable(MAP_RECALL, 0.0)?;
        comms.register(&PLAN_REQUEST)?;
        Ok(())
    }

    fn on_new_mail(&mut self, comms: &mut Comms, mail: &Mail<'_>) -> Result<(), AppError> {
        self.recall.ends_with(comms, mail)?;
        if mail.is(&MAP_UPDATE) {
            self.on_map(comms, &mail.decode(&MAP_UPDATE)?)
        } else if mail.is(&MAP) {
            self.on_map(comms, &mail.decode(&MAP)?)
        } else if mail.is(&PLAN_REQUEST) {
            self.on_request(comms, mail.decode(&PLAN_REQUEST)?)
        } else if mail.key() == MAP_RECALL {
            let copy = mail.as_double().and_then(|revision| self.replica.copy_of(revision));
            Ok(copy.map_or(Ok(()), |copy| comms.publish(&MAP, &copy))?)
        } else if mail.is(&EXPLORER_MEMORY) {
            self.succeed(mail.decode(&EXPLORER_MEMORY)?);
            Ok(())
        } else {
            Ok(())
        }
    }
}
