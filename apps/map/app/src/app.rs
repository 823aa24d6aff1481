//! The process around the map: scans in, what they changed out.

use std::path::PathBuf;
use std::time::Duration;

use elk_bus::clock::thread_cpu_secs;
use elk_bus::{App, AppError, Comms, Handlers, Key, Mail, Rejection, Subscribe, tell};
use elk_geometry::delta::Delta;
use elk_geometry::limits::RESOLUTIONS_M;
use elk_geometry::state::{BrickStates, Cells};
use elk_geometry::{Bounds, mask};
use elk_map::{DepthError, Dropped, Grazing, Insertion, Integration, MapConfig, OccupancyMap};
use elk_mission::{AppType, Kind, ParamSpec, Params, PreflightReport};

use elk_spatial::checks::{MAX_BRICKS, MAX_COUNT, MAX_POINTS, MAX_REVISIONS_AHEAD, within_range};
use elk_spatial::keys::{
    MAP, MAP_CONFIDENCE, MAP_KNOWN, MAP_MEMORY, MAP_PART, MAP_RECALL, MAP_REQUEST, MAP_UNSURE, MAP_UPDATE, PLAN,
    PLAN_REQUEST, PROGRESS,
};
use elk_spatial::map::{MapUpdate, UpdateError};
use elk_spatial::messages::{MapMemory, MapStatus};
use elk_spatial::rays::RayTally;
use elk_spatial::{CameraInfo, Scan};
use nalgebra::Vector3;

use crate::keyframes::Keyframes;
use crate::memory;
use crate::recovery::{Past, Stage};
use crate::saved;

/// What `From` says of a map that begins with nothing.
const NOTHING: &str = "none";

/// The maps that a mission can name.
pub static TYPES: &[AppType] = &[AppType {
    element: "Map",
    name: "OctoMap",
    summary: "Log-odds occupancy of voxels, with its frontier; from a saved map on, and into one: OctoMap's files, or its own.",
    params: PARAMS,
    build: |params| Ok(Box::new(MapApp::new(params)?.on_the_bus())),
    preflight: Some(|params, _| match MapApp::new(params).and_then(|map| map.saved()) {
        Ok(_) => PreflightReport::default(),
        Err(error) => PreflightReport::fault(error),
    }),
}];

const fn number(
    name: &'static str,
    (unit, min, max): (&'static str, f64, f64),
    default: &'static str,
    doc: &'static str,
) -> ParamSpec {
    ParamSpec { name, kind: Kind::Number { unit, min, max }, default: Some(default), doc }
}

const fn point(name: &'static str, kind: Kind, doc: &'static str) -> ParamSpec {
    ParamSpec { name, kind, default: Some("0; 0; 0"), doc }
}

const PARAMS: &[ParamSpec] = &[
    number("Res", ("m", *RESOLUTIONS_M.start(), *RESOLUTIONS_M.end()), "0.1", "Edge of a voxel."),
    ParamSpec {
        name: "Input",
        kind: Kind::Variable,
        default: Some("SCAN"),
        doc: "The variable of the scans to insert: the sensor's, or the last filter's.",
    },
    ParamSpec {
        name: "Grazing",
        kind: Kind::Choice(&["guard", "sticky", "none"]),
        default: Some("guard"),
        doc: "Which voxels passing rays spare: once hit and beside a hit of the same scan (guard), once hit (sticky: \
              only without noise), none (plain log-odds).",
    },
    ParamSpec {
        name: "Integration",
        kind: Kind::Choice(&["Rays", "EndVoxels"]),
        default: Some("Rays"),
        doc: "Which rays are walked: one to every point (Rays), or one to the middle of every voxel that points lie in \
              (EndVoxels: faster where many share a voxel; what only other rays pass is not freed).",
    },
    ParamSpec {
        name: "DepthError",
        kind: Kind::Choice(&["scan", "none"]),
        default: Some("scan"),
        doc: "What is believed of depth: the error that the scan's camera says of itself (scan), or that it is exact (none).",
    },
    number(
        "Advance",
        ("m", 0.0, 0.1),
        "0.0001",
        "How far points are moved along their rays, so that those on the border of two voxels lie behind it; 0: as OctoMap.",
    ),
    number(
        "MaxRange",
        ("m", 0.0, 1e4),
        "30",
        "Farther points are no hits, their rays free only up to here; 0: no limit.",
    ),
    number(
        "FreeNoReturn",
        ("m", 0.0, 1e4),
        "0",
        "How far a ray frees voxels in whose direction the sensor saw nothing, at most MaxRange; 0: not at all.",
    ),
    ParamSpec {
        name: "MaxBricks",
        kind: Kind::Integer { min: 64, max: MAX_BRICKS as i64 },
        default: Some("32768"),
        doc: "Bricks of 8x8x8 voxels that the map may have, 1.3 kB each; what lies beyond them is left out.",
    },
    point("Mid", Kind::Point { unit: "m" }, "Middle of the volume in which frontiers count."),
    point("Dim", Kind::Size { unit: "m" }, "Size of the volume in which frontiers count; all 0: everywhere."),
    number("LogOddsHit", ("", 0.01, 10.0), "0.85", "Added to a voxel that a scan hit."),
    number("LogOddsMiss", ("", -10.0, -0.01), "-0.4", "Added to a voxel that a scan's rays only passed."),
    number("ClampMin", ("", -100.0, 0.0), "-2", "Smallest log-odds of a voxel."),
    number("ClampMax", ("", 0.01, 100.0), "3.5", "Largest log-odds of a voxel."),
    ParamSpec {
        name: "From",
        kind: Kind::File { builtin: &[NOTHING], at_once: false },
        default: Some(NOTHING),
        doc: "The saved map to begin with, .elkmap, .ot or .bt, with voxels of this Res; none: an unknown world.",
    },
    ParamSpec {
        name: "File",
        kind: Kind::Text,
        default: Some(""),
        doc: "Where to write the map when the mission ends: all of it (.elkmap), OctoMap's log-odds (.ot), or, under any \
              other name, OctoMap's .bt; empty: nowhere.",
    },
];

/// The map's settings as a mission gives them.
fn config(params: &Params) -> Result<MapConfig, AppError> {
    let dim = Vector3::from(params.point("Dim"));
    let bounds = (dim != Vector3::zeros()).then(|| Bounds::from_mid_dim(params.point("Mid").into(), dim));
    let (max_range, free_no_return) = (params.number("MaxRange"), params.number("FreeNoReturn"));
    within_range(free_no_return, max_range)?;
    Ok(MapConfig {
        resolution: params.number("Res"),
        hit: params.number("LogOddsHit") as f32,
        miss: params.number("LogOddsMiss") as f32,
        clamp_min: params.number("ClampMin") as f32,
        clamp_max: params.number("ClampMax") as f32,
        grazing: match params.text("Grazing") {
            "none" => Grazing::None,
            "sticky" => Grazing::Sticky,
            _ => Grazing::Guard,
        },
        integration: match params.text("Integration") {
            "EndVoxels" => Integration::EndVoxels,
            _ => Integration::Rays,
        },
        advance: params.number("Advance"),
        max_range,
        free_no_return,
        // The table keeps it positive.
        max_bricks: params.integer("MaxBricks") as usize,
        bounds,
    })
}

/// The revision that a saved map is.
const SAVED: u64 = 1;
/// How long a map that was killed waits for a reader's copy before it begins anew (s): longer than any reader plans. After
/// half of it any copy will do.
const COPY_PATIENCE_SECS: f64 = 10.0;
/// Scans, and points of scans, that are kept for a map that is not there yet.
const MOST_WAITING: usize = 256;
const MOST_WAITING_POINTS: usize = MAX_POINTS;
/// How often a map looks whether it has waited long enough.
const LOOK_EVERY: Duration = Duration::from_secs(1);

/// The map on the bus.
///
/// A map that stops leaves its memory, log-odds and all, under MAP_MEMORY. One that is killed leaves what its readers have:
/// a whole map of three values each. Publishing the memory with every scan instead would write the whole map where
/// little has changed, and cost the more, the larger the world is.
///
/// One that begins with a saved map has it as revision 1, and says it whole before the first scan. What a predecessor left goes
/// before it, and the file is not even looked for. Where nobody has a copy of the predecessor's map, the saved one is what is
/// left.
struct MapApp {
    map: OccupancyMap,
    /// The saved map to begin with.
    from: Option<PathBuf>,
    /// Whether depth is taken as exact, whatever scans say of its error.
    is_exact: bool,
    input: Key<Scan<'static>>,
    file: Option<PathBuf>,
    last_scan: u64,
    cpu_secs: f64,
    stage: Stage,
    /// Scans that came before the map was there to take them, oldest first.
    waiting: Vec<Scan<'static>>,
    /// Whether somebody asked for the whole map before it was there.
    requested: bool,
    /// What is being said of the whole map.
    keyframes: Keyframes,
    /// Whether a part that it said is to come back to it.
    hears_parts: bool,
    /// Whether no part of it was said since the last look.
    is_behind: bool,
    /// Whether readers may have a map that this one does not go on from.
    next_is_whole: bool,
    /// Whether it was said that points lie beyond the largest range.
    range_said: bool,
    /// What became of the rays of all scans, its predecessor's included.
    rays: RayTally,
    /// The camera of the last scan.
    camera: CameraInfo,
    /// An explorer wants to know which voxels are occupied with log-odds below this.
    confidence: Option<f32>,
}

impl MapApp {
    fn new(params: &Params) -> Result<Self, AppError> {
        let (from, file) = (params.text("From"), params.text("File"));
        Ok(Self {
            map: OccupancyMap::new(config(params)?).map_err(|error| error.to_string())?,
            from: (from != NOTHING).then(|| from.into()),
            is_exact: params.text("DepthError") == "none",
            input: Key::named(params.text("Input")),
            file: (!file.is_empty()).then(|| file.into()),
            last_scan: 0,
            cpu_secs: 0.0,
            stage: Stage::Recalling(Past::default()),
            waiting: Vec::new(),
            requested: false,
            keyframes: Keyframes::default(),
            hears_parts: false,
            is_behind: false,
            next_is_whole: false,
            range_said: false,
            rays: RayTally::default(),
            camera: CameraInfo::default(),
            confidence: None,
        })
    }

    /// The saved map to begin with, if there is to be one.
    fn saved(&self) -> Result<Option<OccupancyMap>, AppError> {
        self.from.as_ref().map(|path| saved::read(path, *self.map.config())).transpose()
    }

    fn on_the_bus(self) -> impl App {
        Handlers::<Self>::new()
            .recall(&MAP_MEMORY, Self::on_memory)
            .recall(&MAP_KNOWN, Self::on_known)
            .recall(&MAP_UPDATE, |map, _, update| map.hear_of(update.revision))
            .recall(&PROGRESS, |map, _, progress| map.hear_of(progress.revision))
            .recall(&PLAN_REQUEST, |map, _, request| map.hear_of(request.revision))
            .recall(&PLAN, |map, _, plan| map.hear_of(plan.revision))
            .recalled(Self::recalled)
            .on(&self.input, Self::on_scan)
            .on(elk_bus::number(MAP_REQUEST), Self::on_request)
            .on(elk_bus::number(MAP_CONFIDENCE), Self::on_confidence)
            .when_wanted(&MAP, Self::on_copy)
            .when_wanted(MAP_PART.subscription().as_it_comes(), Self::on_part)
            .iterate(LOOK_EVERY, Self::look)
            .on_stop(Self::leave)
            .with(self)
    }

    /// The map that the predecessor left when it stopped.
    fn on_memory(&mut self, _: &mut Comms, memory: MapMemory) -> Result<(), AppError> {
        let (snapshot, scan) = memory::read(memory);
        let map = OccupancyMap::restore(*self.map.config(), &snapshot).map_err(Rejection::new)?;
        if let Stage::Recalling(past) = &mut self.stage {
            past.memory = Some((Box::new(map), scan));
        }
        self.hear_of(snapshot.revision)
    }

    fn on_known(&mut self, _: &mut Comms, known: MapStatus) -> Result<(), AppError> {
        (self.cpu_secs, self.rays, self.camera) = (known.cpu_secs, known.rays, known.camera);
        self.hear_of(known.revision)
    }

    /// Takes note of a revision that the predecessor's map had, as somebody says.
    fn hear_of(&mut self, revision: u64) -> Result<(), AppError> {
        if let Stage::Recalling(past) = &mut self.stage {
            past.revisions.push(revision);
        }
        Ok(())
    }

    /// All that the predecessor published is known: it left its memory, was killed, or there was none.
    fn recalled(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        let Stage::Recalling(past) = &mut self.stage else {
            return Ok(());
        };
        let revision = past.revision();
        // It may have died in the middle of an answer.
        self.requested |= revision > 0;
        let (memory, mut is_left) = (past.memory.take(), false);
        match memory {
            Some((map, scan)) if map.grid().revision() <= revision => {
                (self.map, self.last_scan, is_left) = (*map, scan, true);
            }
            Some((map, _)) => {
                let (name, left) = (comms.name(), map.grid().revision());
                tell(format_args!(
                    "{name}: a map of revision {left} was left (MAP_MEMORY), of which nobody else has heard; it is not \
                     believed"
                ));
            }
            None => {}
        }
        if !is_left && revision <= SAVED {
            match self.saved() {
                Ok(Some(map)) => self.map = map,
                Err(error) if revision == 0 => return Err(error),
                // What was said of it readers have.
                Ok(None) | Err(_) => {}
            }
        }
        if revision == 0 && self.map.grid().revision() > 0 {
            // A saved map, of which nobody has heard.
            self.publish_update(comms, self.map.grid().whole())?;
        }
        if self.map.grid().revision() >= revision {
            return self.begin(comms);
        }
        comms.register(&MAP)?;
        comms.notify(MAP_RECALL, revision as f64)?;
        self.stage = Stage::Asking { revision, since: comms.clock().own(), any: false };
        Ok(())
    }

    /// A whole map came; a copy of the map that was, if it is asked for and not too old.
    fn on_copy(&mut self, comms: &mut Comms, copy: MapUpdate) -> Result<(), AppError> {
        let Stage::Asking { revision, .. } = self.stage else {
            return Ok(());
        };
        if copy.revision > revision + MAX_REVISIONS_AHEAD {
            return Err(Rejection::new(UpdateError::Ahead { have: revision, update: copy.revision }).into());
        }
        if copy.revision > self.map.grid().revision() {
            self.map = OccupancyMap::from_states(*self.map.config(), &copy.delta()).map_err(Rejection::new)?;
            self.last_scan = copy.scan;
        }
        if copy.revision < revision {
            return Ok(());
        }
        comms.publish(&MAP_KNOWN, &self.status())?;
        self.begin(comms)
    }

    fn look(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        if self.hears_parts && std::mem::replace(&mut self.is_behind, true) {
            // The part before did not come back.
            self.say_part(comms)?;
        }
        self.give_up_on_copies(comms)
    }

    /// Goes on with what there is, if a copy was waited for in vain.
    fn give_up_on_copies(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        let Stage::Asking { revision, since, any } = &mut self.stage else {
            return Ok(());
        };
        let (revision, waited) = (*revision, comms.clock().own() - *since);
        if waited > COPY_PATIENCE_SECS / 2.0 && !std::mem::replace(any, true) {
            comms.notify(MAP_RECALL, 0.0)?;
        }
        if waited < COPY_PATIENCE_SECS {
            return Ok(());
        }
        let own = self.map.grid().revision();
        let saved = if own == 0 { self.saved() } else { Ok(None) };
        let begins_with = match &saved {
            Ok(Some(_)) => "what From says".to_owned(),
            Ok(None) if own > 0 => format!("a copy of revision {own}"),
            Ok(None) => "nothing".to_owned(),
            Err(error) => format!("nothing, as what From says is not there ({error})"),
        };
        tell(format_args!(
            "{}: the map was lost: nobody has a copy of its revision {revision}; it goes on from {begins_with}, and what is \
             missing has to be explored again",
            comms.name()
        ));
        if let Ok(Some(map)) = saved {
            self.map = map;
        }
        self.map.skip_to(revision);
        self.next_is_whole = true;
        self.begin(comms)
    }

    fn begin(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        if matches!(self.stage, Stage::Asking { .. }) {
            comms.unregister(&MAP)?;
        }
        self.stage = Stage::Here;
        self.publish_unsure(comms)?;
        let mut waiting = std::mem::take(&mut self.waiting);
        // The latest scan comes to every map that starts, whether its predecessor had taken it or not.
        waiting.retain(|scan| scan.id > self.last_scan);
        waiting.iter().try_for_each(|scan| self.insert(comms, scan))?;
        if std::mem::take(&mut self.requested) { self.say_whole(comms) } else { Ok(()) }
    }

    fn on_scan(&mut self, comms: &mut Comms, scan: Scan<'_>) -> Result<(), AppError> {
        match self.stage {
            Stage::Here => self.insert(comms, &scan),
            _ if self.waiting.iter().any(|other| other.id == scan.id) => Ok(()),
            _ if !self.has_room_for(&scan) => {
                Err(Rejection::new("the map is not there yet, and too many scans wait for it already").into())
            }
            _ => {
                self.waiting.push(scan.into_owned());
                Ok(())
            }
        }
    }

    /// Whether a scan may wait for the map.
    fn has_room_for(&self, scan: &Scan<'_>) -> bool {
        let rays = |scan: &Scan<'_>| scan.points.len() + scan.no_return.len();
        let waiting: usize = self.waiting.iter().map(rays).sum();
        self.waiting.len() < MOST_WAITING && waiting + rays(scan) <= MOST_WAITING_POINTS
    }

    fn insert(&mut self, comms: &mut Comms, scan: &Scan<'_>) -> Result<(), AppError> {
        // A successor of the sensor or of a filter that does not know whether it was published publishes it again.
        if scan.id == self.last_scan {
            return Ok(());
        }
        if scan.id != self.last_scan + 1 {
            let (name, last) = (comms.name(), self.last_scan);
            tell(format_args!(
                "{name}: scan {} follows scan {last}: scans were lost, or the sensor started again",
                scan.id
            ));
        }
        (self.last_scan, self.camera) = (scan.id, scan.camera);
        let start = thread_cpu_secs();
        let seen = self.take_in(scan);
        self.cpu_secs += thread_cpu_secs() - start;
        self.say_what_was_left_out(comms.name(), scan, &seen);
        self.tally(scan, &seen);
        let delta = self.map.advance(&seen.changed);
        let delta = if std::mem::take(&mut self.next_is_whole) { self.map.grid().whole() } else { delta };
        self.publish_update(comms, delta)
    }

    fn take_in(&mut self, scan: &Scan<'_>) -> Insertion {
        let (origin, range) = (scan.pose.position(), scan.camera.range_m);
        let (points, no_return) = (scan.world_points(), scan.world_no_return());
        let inverse_depth_sigma = scan.camera.inverse_depth_sigma;
        if self.is_exact || inverse_depth_sigma == 0.0 {
            return self.map.insert_with(origin, points, no_return, range);
        }
        let error = DepthError { inverse_depth_sigma, axis: scan.pose.forward() };
        self.map.insert_uncertain(origin, points, (no_return, range), &error)
    }

    /// An explorer looks again at what is occupied with a smaller probability; 0: none does any more.
    fn on_confidence(&mut self, comms: &mut Comms, probability: f64) -> Result<(), AppError> {
        if probability != 0.0 && !(0.5..1.0).contains(&probability) {
            return Err(Rejection::new(format_args!(
                "it is {probability}; right is 0, or a probability of 0.5 to less than 1"
            ))
            .into());
        }
        self.confidence = (probability > 0.0).then(|| (probability / (1.0 - probability)).ln() as f32);
        if matches!(self.stage, Stage::Here) { self.publish_unsure(comms) } else { Ok(()) }
    }

    /// Says which voxels are occupied with little confidence, if anybody wants to know.
    fn publish_unsure(&self, comms: &mut Comms) -> Result<(), AppError> {
        let Some(below) = self.confidence.filter(|_| self.map.grid().revision() > 0) else { return Ok(()) };
        let unsure = self.map.unsure(below);
        let bricks = unsure.bricks().filter(|(_, cells)| **cells != mask::NONE);
        let bricks = bricks.map(|(brick, cells)| BrickStates::pack(brick, &Cells::new(&mask::NONE, cells))).collect();
        let (revision, resolution) = (self.map.grid().revision(), self.map.grid().resolution());
        comms.publish(&MAP_UNSURE, &MapUpdate { revision, since: 0, scan: self.last_scan, resolution, bricks })?;
        Ok(())
    }

    fn publish_update(&self, comms: &mut Comms, delta: Delta<'_>) -> Result<(), AppError> {
        self.publish_unsure(comms)?;
        comms.publish(&MAP_UPDATE, &MapUpdate::new(delta, self.last_scan))?;
        comms.publish(&MAP_KNOWN, &self.status())?;
        Ok(())
    }

    fn say_what_was_left_out(&mut self, name: &str, scan: &Scan<'_>, seen: &Insertion) {
        let (id, points) = (scan.id, scan.points.len());
        let Dropped { invalid, out_of_range, no_room } = seen.dropped;
        if invalid > 0 {
            tell(format_args!("{name}: scan {id}: {invalid} points are not finite or at the camera itself; left out"));
        }
        if out_of_range > 0 && self.rays.outside == 0 {
            tell(format_args!(
                "{name}: {out_of_range} of {points} points of scan {id} lie outside the map's 65536 voxels an axis, and are \
                 left out; move the world nearer to the origin, or set a coarser Res. Counted from now on"
            ));
        }
        if seen.cut > 0 && !std::mem::replace(&mut self.range_said, true) {
            let range = self.map.config().max_range;
            tell(format_args!(
                "{name}: {} of {points} points of scan {id} are farther than {range} m (MaxRange): they are no hits, and \
                 free only up to there; set Map.MaxRange for more (0: no limit). Not said again",
                seen.cut
            ));
        }
        if no_room > 0 && self.rays.no_room == 0 {
            let most = self.map.config().max_bricks;
            tell(format_args!(
                "{name}: the map is full: {no_room} of {points} points of scan {id} lie beyond its {most} bricks (MaxBricks) \
                 and are left out; allow for more by a larger MaxBricks, of the explorer as well, or set a coarser Res. \
                 Counted from now on"
            ));
        }
    }

    fn tally(&mut self, scan: &Scan<'_>, seen: &Insertion) {
        let Dropped { invalid, out_of_range, no_room } = seen.dropped;
        let rays = &mut self.rays;
        let counts = [
            (&mut rays.no_return, scan.no_return.len()),
            (&mut rays.measured, scan.measured as usize),
            (&mut rays.received, scan.points.len()),
            (&mut rays.invalid, invalid),
            (&mut rays.outside, out_of_range),
            (&mut rays.too_far, seen.cut),
            (&mut rays.no_room, no_room),
        ];
        for (sum, more) in counts {
            *sum = (*sum + more as u64).min(MAX_COUNT);
        }
        rays.pixels.add(&scan.pixel_runs);
    }

    fn status(&self) -> MapStatus {
        let grid = self.map.grid();
        MapStatus {
            revision: grid.revision(),
            free: grid.free() as u64,
            occupied: grid.occupied() as u64,
            frontier: self.map.frontier_len() as u64,
            resolution: grid.resolution(),
            cpu_secs: self.cpu_secs,
            full: self.map.is_full(),
            rays: self.rays,
            camera: self.camera,
        }
    }

    fn on_request(&mut self, comms: &mut Comms, _: f64) -> Result<(), AppError> {
        match self.stage {
            Stage::Here => self.say_whole(comms),
            _ => {
                self.requested = true;
                Ok(())
            }
        }
    }

    /// Says all of the map once more, part by part. The next part is said when the one before comes back, behind all that has
    /// come meanwhile: between two scans there is one part at most, however many ask, and none waits for a scan.
    fn say_whole(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        self.keyframes.ask();
        if self.hears_parts { Ok(()) } else { self.say_part(comms) }
    }

    fn on_part(&mut self, comms: &mut Comms, part: Mail<'_>) -> Result<(), AppError> {
        // The last one of the round before comes as well, to who registers anew.
        let is_own = part.source() == comms.name() && !part.is_latest();
        if is_own && self.hears_parts { self.say_part(comms) } else { Ok(()) }
    }

    /// Says the next part, if there is one.
    fn say_part(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        let (own, part) = (MAP_PART.subscription().as_it_comes(), self.keyframes.part(self.map.grid(), self.last_scan));
        match (&part, std::mem::replace(&mut self.hears_parts, part.is_some())) {
            (Some(_), false) => comms.register(own)?,
            (None, true) => comms.unregister(own)?,
            _ => {}
        }
        self.is_behind = false;
        part.map_or(Ok(()), |part| Ok(comms.publish(&MAP_PART, &part)?))
    }

    /// Leaves its memory to a successor, and the map to whoever wants it.
    fn leave(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        let RayTally { no_room, outside, .. } = self.rays;
        for (count, where_) in [(no_room, "where the map had no more room"), (outside, "outside the map")] {
            if count > 0 {
                tell(format_args!("{}: {count} points were left out that lay {where_}", comms.name()));
            }
        }
        if !matches!(self.stage, Stage::Here) {
            // What it does not have it cannot leave; its successor asks again.
            return Ok(());
        }
        comms.publish(&MAP_MEMORY, &memory::write(self.map.snapshot(), self.last_scan))?;
        // There are no scans any more that could wait.
        comms.publish(&MAP, &MapUpdate::new(self.map.grid().whole(), self.last_scan))?;
        self.file.as_ref().map_or(Ok(()), |path| saved::write(path, &self.map))
    }
}
