//! A world that is ready to be explored: read, checked, its truth known, its starts drawn; and the missions to run in it.

use std::path::{Path, PathBuf};

use elk_bus::clock::Stopwatch;
use elk_geometry::random::Random;
use elk_geometry::{Bounds, Pose};
use elk_mission::{
    AppSpec, Mission, Override, Params, Program, Registry, element, expanded, instead, join_arguments, split_arguments,
};
use elk_outside::checksum::fnv1a_of_file;
use elk_spatial::messages::PoseCommand;
use elk_world::{BUILT_IN, Placement, World};
use nalgebra::Vector3;

use crate::suite::{Place, Runs, Source, StrategyEntry, Suite, SuiteError, WorldEntry};
use crate::truth::{Start, Terms, Truth};

/// The plainest of missions: a world's file is explored in it.
const PLAIN: &str = r#"<Scenario name="Evaluation" type="auto" version="1">
    <Sensor type="Simulator"/>
    <Filter type="Distance"/>
    <Map type="OctoMap"/>
    <Explorer type="ClosestFrontier"/>
    <Controller type="MOOSSim"/>
</Scenario>
"#;

/// Where missions come from.
pub struct Missions {
    /// The app types that a mission can name.
    pub registry: Registry,
    /// The mission in a file, or the built-in one of that name, changed by what is said otherwise.
    pub load: Box<Load>,
}

/// Loads a mission, changed by what is said otherwise; what is wrong with it, in words.
pub type Load = dyn Fn(&Path, &[Override]) -> Result<Mission, String> + Send + Sync;

/// How fast a robot is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Speed {
    /// Along the way (m/s).
    pub along: f64,
    /// On the spot (rad/s).
    pub turn: f64,
}

impl Speed {
    /// How long the robot is on its way (s): it turns while it goes, as the controller's `Pace` has it.
    pub fn secs(&self, from: &Pose, command: &PoseCommand) -> f64 {
        let corners = command.via.iter().copied().chain([command.pose.position()]);
        let (length, _) = corners.fold((0.0, from.position()), |(sum, last), next| (sum + (next - last).norm(), next));
        let angle = from.0.rotation.angle_to(&command.pose.0.rotation);
        (length / self.along).max(angle / self.turn)
    }
}

/// What the sensor sees that looks around.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Around {
    /// Angle between neighbouring rays (rad).
    pub spacing: f64,
    /// How far it sees (m); infinite: as far as there is anything.
    pub range_m: f64,
}

/// A world that is ready.
pub struct Site {
    /// The world.
    pub world: World,
    /// What of it can be known.
    pub truth: Truth,
    /// The starts, the same for all strategies.
    pub starts: Vec<Start>,
    /// The variable of the camera's pose.
    pub pose_variable: String,
    /// The robot's speed, if its controller says it.
    pub speed: Option<Speed>,
    /// What its sensor sees that looks around, if that says how its rays lie.
    pub around: Option<Around>,
    /// How long it took to get ready (s).
    pub secs: f64,
}

/// What a run says of its sensor, and a suite cannot.
const DRAWN: [&str; 4] = ["Start", "StartYaw", "StartPitch", "RandomStart"];

/// The missions of a world, one a strategy, without a start.
pub struct Plans {
    source: Source,
    folder: PathBuf,
    /// What is said otherwise, by strategy.
    sets: Vec<Vec<Override>>,
    sensor: String,
    /// What the missions came to, all that is said and all defaults, by strategy; and what is in a program's files.
    pub effective: Vec<String>,
    /// Whether its sensor has noise that it can be without.
    pub is_noisy: bool,
    terms: Terms,
    pose_variable: String,
    speed: Option<Speed>,
    around: Option<Around>,
    world_file: String,
    placement: Result<Placement, String>,
}

impl Plans {
    /// The missions of a world of the suite, each checked.
    ///
    /// # Errors
    /// What is wrong, and where in the suite; `Ok(Err(…))`: the world itself cannot be had, which is its runs' failure.
    pub fn of(suite: &Suite, entry: &WorldEntry, missions: &Missions) -> Result<Result<Self, String>, SuiteError> {
        let wrong =
            |at: Place, what: String| SuiteError::Wrong { file: suite.file.clone(), problems: vec![(at, what)] };
        let folder = suite.file.parent().unwrap_or(Path::new("")).to_owned();
        let own = match world_set(&entry.source, &folder) {
            Ok(set) => set,
            Err(why) => return Ok(Err(why)),
        };
        let base: Vec<Override> = entry.sets.iter().cloned().chain(own).collect();
        let load = |sets: &[Override]| load(&entry.source, &folder, sets, missions);
        let plain = load(&base).map_err(|why| wrong(entry.at, format!("world {}: {why}", entry.name)))?;
        let explorer = only(&plain, element::EXPLORER).map_err(|why| wrong(entry.at, why))?.name.clone();
        let sensor = only(&plain, element::SENSOR).map_err(|why| wrong(entry.at, why))?.name.clone();
        if let Some(own) = entry.sets.iter().find(|set| set.app == sensor && DRAWN.contains(&set.param.as_str())) {
            let why = "an evaluation draws the starts by the suite's seed; `elk launch` takes one";
            return Err(wrong(entry.at, format!("world {}: {sensor}.{} cannot be said: {why}", entry.name, own.param)));
        }
        let (mut all, mut effective, mut known, mut last) = (Vec::new(), Vec::new(), plain.clone(), plain);
        for strategy in &suite.strategies {
            let named =
                |why: String| wrong(strategy.at, format!("explorer {} in world {}: {why}", strategy.name, entry.name));
            let runs = what_runs(&strategy.runs, &explorer, &folder).map_err(named)?;
            let sets = with_strategy(&base, (&explorer, runs), strategy, &last);
            last = load(&sets).map_err(named)?;
            let is_mission_s = |app: &AppSpec| app.is_builtin() || (app.name == explorer && !app.is_moos());
            if let Some(foreign) = last.apps.iter().find(|app| !is_mission_s(app)) {
                return Err(wrong(
                    entry.at,
                    format!(
                        "{} is a program of its own; of a suite, only the explorer can be one, and none of MOOS'",
                        foreign.name
                    ),
                ));
            }
            effective.push(last.to_xml(&|app, _| app.element == element::LOGGER) + &program_files(&last));
            if last.apps.iter().all(AppSpec::is_builtin) {
                known = last.clone();
            }
            all.push(sets);
        }
        let facts = Facts::of(&known).map_err(|why| wrong(entry.at, format!("world {}: {why}", entry.name)))?;
        let Facts { is_noisy, terms, pose_variable, speed, around, world_file, placement } = facts;
        let source = entry.source.clone();
        Ok(Ok(Self {
            source,
            folder,
            sets: all,
            sensor,
            effective,
            is_noisy,
            terms,
            pose_variable,
            speed,
            around,
            world_file,
            placement,
        }))
    }

    /// Digest of the world's file; 0 of a built-in one.
    pub fn world_digest(&self) -> u64 {
        fnv1a_of_file(Path::new(&self.world_file)).unwrap_or(0)
    }

    /// Reads the world, and looks for what can be known of it.
    ///
    /// # Errors
    /// It is no world, or one without room for a robot.
    pub fn site(&self, suite: &Suite, source: &Source) -> Result<Site, String> {
        let took = Stopwatch::start();
        let placement = self.placement.as_ref().map_err(Clone::clone)?;
        let world = World::load(&self.world_file, placement).map_err(|error| error.to_string())?;
        let truth = Truth::of(&world, self.terms).map_err(|error| error.to_string())?;
        let mut random = Random::new(suite.seed, stream(&source.stem()));
        let starts = truth.starts(&world, suite.starts, &mut random).map_err(|error| error.to_string())?;
        let secs = took.elapsed().as_secs_f64();
        let pose_variable = self.pose_variable.clone();
        Ok(Site { world, truth, starts, pose_variable, speed: self.speed, around: self.around, secs })
    }

    /// What a run says otherwise than its mission's file.
    pub fn run_sets(&self, strategy: usize, start: &Start) -> Vec<Override> {
        let [x, y, z] = [start.position.x, start.position.y, start.position.z];
        let drawn =
            [format!("{x}; {y}; {z}"), start.yaw_deg.to_string(), start.pitch_deg.to_string(), "false".to_owned()];
        let set = |(param, text): (&str, String)| Override { app: self.sensor.clone(), param: param.to_owned(), text };
        let own = DRAWN.into_iter().zip(drawn).map(set);
        self.sets[strategy].iter().cloned().chain(own).collect()
    }

    /// The mission of a run.
    ///
    /// # Errors
    /// There is none: its file has changed.
    pub fn mission(
        &self,
        strategy: usize,
        start: &Start,
        noise: Noise,
        missions: &Missions,
    ) -> Result<Mission, String> {
        let mut sets = self.run_sets(strategy, start);
        if noise == Noise::None {
            sets.retain(|set| !(set.app == self.sensor && set.param.eq_ignore_ascii_case(NOISE)));
            sets.push(Override { app: self.sensor.clone(), param: NOISE.to_owned(), text: "0".to_owned() });
        }
        load(&self.source, &self.folder, &sets, missions)
    }
}

/// The sensor's parameter that says how much noise it has.
const NOISE: &str = "NoiseSigma";

/// Which noise a run has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Noise {
    /// What its mission says.
    AsSaid,
    /// None.
    None,
}

/// What a mission says of world and robot.
struct Facts {
    is_noisy: bool,
    terms: Terms,
    pose_variable: String,
    speed: Option<Speed>,
    around: Option<Around>,
    world_file: String,
    placement: Result<Placement, String>,
}

impl Facts {
    fn of(mission: &Mission) -> Result<Self, String> {
        let of = |element: &str| only(mission, element).and_then(|app| params(app).map(|params| (app, params)));
        let (sensor, seen) = of(element::SENSOR)?;
        if !sensor.takes("World") {
            return Err(format!(
                "{} knows no true world: an evaluation needs a simulated one (type=\"Simulator\")",
                sensor.name
            ));
        }
        let ((_, map), (_, explorer), (controller, motion)) =
            (of(element::MAP)?, of(element::EXPLORER)?, of(element::CONTROLLER)?);
        let dim = Vector3::from(explorer.point("Dim"));
        let bounds = (dim != Vector3::zeros()).then(|| Bounds::from_mid_dim(explorer.point("Mid").into(), dim));
        let has_rays = ["Width", "Fov", "Range"].iter().all(|param| sensor.takes(param));
        let around = || {
            let range_m = Some(seen.number("Range")).filter(|range_m| *range_m > 0.0).unwrap_or(f64::INFINITY);
            Around { spacing: seen.number("Fov").to_radians() / seen.integer("Width") as f64, range_m }
        };
        let has_speed = controller.takes("Speed") && controller.takes("TurnRate");
        Ok(Self {
            is_noisy: sensor.takes(NOISE) && seen.number(NOISE) > 0.0,
            terms: Terms { resolution: map.number("Res"), radius_m: explorer.number("Radius"), bounds },
            pose_variable: seen.text("MOOSPoseVarName").to_owned(),
            speed: has_speed
                .then(|| Speed { along: motion.number("Speed"), turn: motion.number("TurnRate").to_radians() }),
            around: has_rays.then(around),
            world_file: seen.text("World").to_owned(),
            placement: Placement::new(seen.number("Scale"), seen.text("Up")).map_err(|error| error.to_string()),
        })
    }
}

fn params(app: &AppSpec) -> Result<&Params, String> {
    match &app.program {
        Program::Builtin(_, params) => Ok(params),
        Program::Foreign { .. } => Err(format!("{} is a program of its own", app.name)),
    }
}

/// The one app of an element.
fn only<'a>(mission: &'a Mission, element: &str) -> Result<&'a AppSpec, String> {
    mission.of_element(element).next().ok_or_else(|| format!("the mission {} has no {element}", mission.name))
}

/// What is to run as the mission's explorer. A program with a folder is the suite's, and so is a file beside the suite that an argument
/// names.
fn what_runs(runs: &Runs, explorer: &str, folder: &Path) -> Result<Vec<Override>, String> {
    let set = |(param, text): (&str, String)| Override { app: explorer.to_owned(), param: param.to_owned(), text };
    let words = |line: &str| words_of(line, folder);
    let sets = match runs {
        Runs::Type(name) => vec![("type", name.clone())],
        Runs::Pipe(line) => vec![("pipe", join_arguments(&words(line).map_err(|why| format!("pipe: {why}"))?))],
        Runs::Exec(line) => {
            let words = words(line).map_err(|why| format!("exec: {why}"))?;
            let Some((program, arguments)) = words.split_first() else {
                return Err("exec: it names no program".to_owned());
            };
            vec![("exec", program.clone()), ("args", join_arguments(arguments))]
        }
    };
    Ok(sets.into_iter().map(set).collect())
}

fn words_of(line: &str, folder: &Path) -> Result<Vec<String>, String> {
    let mut words = split_arguments(line).map_err(|error| error.to_string())?;
    for (place, word) in words.iter_mut().enumerate() {
        let beside = folder.join(&*word);
        if (place == 0 && word.contains('/')) || (place > 0 && beside.is_file()) {
            *word = beside.to_string_lossy().into_owned();
        }
    }
    Ok(words)
}

/// What is in the files of the mission's programs, as far as their command lines name them: rows of another program are not
/// this one's.
fn program_files(mission: &Mission) -> String {
    let words = mission.apps.iter().filter_map(|app| match &app.program {
        Program::Builtin(..) => None,
        Program::Foreign { exec, args, .. } => {
            Some(std::iter::once(exec.clone()).chain(args.iter().map(PathBuf::from)))
        }
    });
    let digest = |file: PathBuf| fnv1a_of_file(&file).ok().map(|digest| format!("{} {digest:016x}\n", file.display()));
    words.flatten().filter_map(digest).collect()
}

/// A strategy in place of the mission's own; what it says itself counts. Nobody watches: a robot is not held back.
fn with_strategy(
    base: &[Override],
    (explorer, runs): (&str, Vec<Override>),
    strategy: &StrategyEntry,
    mission: &Mission,
) -> Vec<Override> {
    let set = |app: &str, param: &str, text: &str| Override {
        app: app.to_owned(),
        param: param.to_owned(),
        text: text.to_owned(),
    };
    let own = |param: &str| strategy.settings.iter().any(|(name, _)| name.eq_ignore_ascii_case(param));
    let mut sets: Vec<Override> =
        base.iter().filter(|said| said.app != explorer || !own(&said.param)).cloned().collect();
    sets.extend(runs);
    sets.extend(strategy.settings.iter().map(|(param, text)| set(explorer, param, text)));
    for controller in mission.of_element(element::CONTROLLER) {
        let held = [("Pace", "0"), ("Manual", "false")].into_iter().filter(|(param, _)| controller.takes(param));
        let new =
            held.filter(|(param, _)| !base.iter().any(|said| said.app == controller.name && said.param == *param));
        sets.extend(new.map(|(param, text)| set(&controller.name, param, text)));
    }
    sets
}

fn load(source: &Source, folder: &Path, sets: &[Override], missions: &Missions) -> Result<Mission, String> {
    match source {
        Source::Mission(name) => {
            let beside = folder.join(name);
            (missions.load)(if beside.exists() { &beside } else { Path::new(name) }, sets)
        }
        Source::World(_) => Mission::parse(PLAIN, &folder.join("evaluation.xml"), &missions.registry, sets)
            .map_err(|error| error.to_string()),
    }
}

/// What says a world's own file to the plain mission.
fn world_set(source: &Source, folder: &Path) -> Result<Option<Override>, String> {
    let Source::World(said) = source else { return Ok(None) };
    let text = match BUILT_IN.contains(&said.as_str()) {
        true => said.clone(),
        false => {
            let path = folder.join(expanded(said).map_err(|error| error.to_string())?);
            let path = std::path::absolute(&path).map_err(|error| format!("{}: {error}", path.display()))?;
            if !path.is_file() {
                return Err(format!("there is no world {}", path.display()));
            }
            path.to_string_lossy().into_owned()
        }
    };
    Ok(Some(Override { app: element::SENSOR.to_owned(), param: "World".to_owned(), text }))
}

/// The random stream of a world's starts: by its file's name, so that another world beside it changes nothing, and one that is
/// there several times, each with other parameters, has the same starts.
fn stream(stem: &str) -> u64 {
    stem.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

/// Complains of strategies that there are not.
///
/// # Errors
/// All of them, with their places.
pub fn check_strategies(suite: &Suite, registry: &Registry) -> Result<(), SuiteError> {
    let known: Vec<&str> = registry.of_element(element::EXPLORER).map(|one| one.name).collect();
    let types = suite.strategies.iter().filter_map(|one| match &one.runs {
        Runs::Type(name) => Some((one.at, name)),
        Runs::Pipe(_) | Runs::Exec(_) => None,
    });
    let unknown = types.filter(|(_, name)| !known.contains(&name.as_str()));
    let problems: Vec<(Place, String)> = unknown
        .map(|(at, name)| (at, format!("there is no Explorer of type {name:?}; {}", instead(name, &known))))
        .collect();
    if problems.is_empty() { Ok(()) } else { Err(SuiteError::Wrong { file: suite.file.clone(), problems }) }
}
