//! What there is to draw, as plain data, and how it is found in a log.

use std::collections::BTreeMap;

use elk_bus::codec::DecodeError;
use elk_bus::{Key, Payload, tell};
use elk_geometry::{OccupancyGrid, Pose, Voxel, frontier};
use elk_log::{LogError, LogReader, Record};
use elk_spatial::checks::MAX_BRICKS;
use elk_spatial::keyframe::MapPart;
use elk_spatial::map::MapUpdate;
use elk_spatial::messages::Decision;
use elk_spatial::{Replica, Scan, keys};
use nalgebra::Point3;

/// An explored world and how it was explored.
#[derive(Debug, Clone)]
pub struct Scene {
    /// The mission's name.
    pub mission: String,
    /// The explorer's type; empty where the log does not say.
    pub explorer: String,
    /// The final map.
    pub grid: OccupancyGrid,
    /// Frontier voxels that are left.
    pub frontier: Vec<Voxel>,
    /// Corners of the way travelled, from start to end (m, world).
    pub path: Vec<Point3<f64>>,
    /// The camera's pose at each scan, in order.
    pub scans: Vec<Pose>,
    /// Where scans were truly taken, or as recorded (m, world), in order, where their poses are estimates.
    pub truth: Vec<Point3<f64>>,
    /// Length of the way (m).
    pub path_length_m: f64,
    /// Plans that led somewhere.
    pub plans: usize,
    /// Whether the exploration is complete, where the log says.
    pub complete: Option<bool>,
}

/// Why a log makes no scene.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The log could not be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// Nothing was mapped.
    #[error("the log holds no map ({MAP_UPDATE} or {MAP}): did the mission run, and did it have a map?", MAP_UPDATE = keys::MAP_UPDATE.name(), MAP = keys::MAP.name())]
    NoMap,
}

/// What has been collected so far.
#[derive(Default)]
struct Collector {
    maps: Vec<Map>,
    scans: BTreeMap<u64, Pose>,
    truth: BTreeMap<u64, Pose>,
    path: Vec<Point3<f64>>,
    path_length_m: Option<f64>,
    plans: usize,
    explorer: String,
    complete: Option<bool>,
    /// The first message that could not be read, and how many there were.
    unfit: Option<String>,
    left_out: usize,
}

/// A map of one resolution. Whoever writes updates of another one makes another map.
struct Map {
    replica: Replica,
    /// Updates that belong to it.
    updates: usize,
}

/// Resolutions of which maps are put together.
const MOST_MAPS: usize = 4;

impl Scene {
    /// Collects a scene from a log; one that breaks off gives the scene at that moment.
    pub fn from_log(mut log: LogReader) -> Result<Self, SceneError> {
        let mut collector = Collector::default();
        for record in log.by_ref() {
            let record = record?;
            // A message that is not what its key stands for is none of the run's: the others make the picture.
            if let Err(unfit) = collector.take(&record) {
                collector.unfit.get_or_insert_with(|| format!("{} by {}: {unfit}", record.key, record.source));
                collector.left_out += 1;
            }
        }
        if let Some(first) = &collector.unfit {
            let number = collector.left_out;
            tell(format_args!(
                "the picture is drawn without {number} messages that fit nothing, the first of them {first}"
            ));
        }
        let mission = log.metadata().mission_name.trim_end_matches(".xml").to_owned();
        collector.finish(mission)
    }
}

impl Collector {
    fn take(&mut self, record: &Record) -> Result<(), DecodeError> {
        match record.key.as_str() {
            key if key == keys::MAP_UPDATE.name() => self.map(&decode(record, &keys::MAP_UPDATE)?),
            key if key == keys::MAP.name() => self.map(&decode(record, &keys::MAP)?),
            key if key == keys::MAP_PART.name() => self.map_part(&decode(record, &keys::MAP_PART)?),
            key if key == keys::SCAN.name() => {
                let scan: Scan<'_> = record.value.as_ref().decode(&keys::SCAN)?;
                self.scans.insert(scan.id, scan.pose);
            }
            key if key == keys::POSE_ESTIMATE.name() => {
                let estimate = decode(record, &keys::POSE_ESTIMATE)?;
                // Of a frame that was lost there is no scan.
                let truth = estimate.recorded.filter(|_| estimate.scan > 0);
                self.truth.extend(truth.map(|pose| (estimate.scan, pose)));
            }
            key if key == keys::POSE_COMMAND.name() => {
                let command = decode(record, &keys::POSE_COMMAND)?;
                self.path.extend(command.via);
                self.path.push(command.pose.position());
            }
            key if key == keys::PROGRESS.name() => {
                self.path_length_m = Some(decode(record, &keys::PROGRESS)?.path_length_m);
            }
            key if key == keys::PLAN.name() => {
                self.plans += usize::from(matches!(decode(record, &keys::PLAN)?.decision, Decision::Go(_)));
            }
            key if key == keys::EXPLORATION_REPORT.name() => {
                let report = decode(record, &keys::EXPLORATION_REPORT)?;
                (self.explorer, self.complete) = (report.explorer, Some(report.complete));
            }
            _ => {}
        }
        Ok(())
    }

    /// What does not fit is passed over: the next whole map mends it.
    fn map(&mut self, update: &MapUpdate) {
        if let Some(map) = self.map_of(update.resolution) {
            map.updates += usize::from(matches!(map.replica.take(update), Ok(Some(_))));
        }
    }

    fn map_part(&mut self, part: &MapPart) {
        if let Some(map) = self.map_of(part.resolution) {
            map.updates += usize::from(matches!(map.replica.take_part(part), Ok(Some(_))));
        }
    }

    /// The map with such voxels (m); none: there are too many others.
    fn map_of(&mut self, resolution: f64) -> Option<&mut Map> {
        let same = |map: &Map| map.replica.grid().resolution() == resolution;
        let i = self.maps.iter().position(same).unwrap_or(self.maps.len());
        if i == self.maps.len() && i < MOST_MAPS {
            self.maps.push(Map { replica: Replica::new(Some(resolution), MAX_BRICKS), updates: 0 });
        }
        self.maps.get_mut(i)
    }

    fn finish(self, mission: String) -> Result<Scene, SceneError> {
        // The first of equals.
        let most = self.maps.into_iter().rev().max_by_key(|map| map.updates);
        let grid = most.map(|map| map.replica.into_grid());
        let grid = grid.filter(|grid| grid.free() + grid.occupied() > 0).ok_or(SceneError::NoMap)?;
        let frontier =
            grid.bricks().voxels().map(|(voxel, _)| voxel).filter(|v| frontier::is_frontier(&grid, *v)).collect();
        let scans: Vec<Pose> = self.scans.into_values().collect();
        let path = match self.path.is_empty() {
            true => scans.iter().map(Pose::position).collect(),
            false => self.path,
        };
        let path_length_m = self.path_length_m.unwrap_or_else(|| length(&path));
        Ok(Scene {
            mission,
            explorer: self.explorer,
            grid,
            frontier,
            path,
            scans,
            truth: self.truth.values().map(Pose::position).collect(),
            path_length_m,
            plans: self.plans,
            complete: self.complete,
        })
    }
}

fn decode<T>(record: &Record, key: &Key<T>) -> Result<T, DecodeError>
where
    T: for<'a> Payload<View<'a> = T>,
{
    record.value.as_ref().decode(key)
}

fn length(path: &[Point3<f64>]) -> f64 {
    path.windows(2).map(|leg| nalgebra::distance(&leg[0], &leg[1])).sum()
}
