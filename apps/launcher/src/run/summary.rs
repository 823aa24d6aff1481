//! What a run came to: `summary.json`, and a few lines for people.

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

use elk_mission::{AppSpec, Mission, element};
use elk_outside::file;
use elk_spatial::messages::{CoverageMark, FrontiersLeft};
use elk_spatial::pixels::PixelTally;
use elk_spatial::playback::Playback;
use serde::{Deserialize, Serialize};

use crate::error::LaunchError;
use crate::reports::observer::Observer;
use crate::reports::steps::Spread;
use crate::run::shortfall::{overflow, shortfall};

/// The file in the run's folder.
const SUMMARY: &str = "summary.json";
/// The longest that is read (bytes).
const LONGEST: u64 = 1 << 20;

/// Who ran, as far as the mission file does not say it.
#[derive(Debug)]
pub(crate) struct Ran {
    /// The explorers, in the order in which they came.
    pub explorers: Vec<String>,
    /// The apps that were swapped.
    pub swapped: Vec<String>,
}

/// A run, summed up. What nobody said is `null`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// The mission's name.
    pub mission: String,
    /// The mission file.
    pub mission_file: String,
    /// The explorer's type; of several that took turns, each once, in their order.
    pub explorer: String,
    /// The apps that were swapped while the mission ran: who runs it again does so without that.
    pub swapped: Vec<String>,
    /// The motion policy's name.
    pub policy: Option<String>,
    /// Strategy, policy and clearance with all their settings.
    pub settings: Option<String>,
    /// The seed of everything random.
    pub seed: Option<i64>,
    /// Whether every frontier that can be reached and seen is resolved, in a map that holds something, without a contact with
    /// the true world; of a mission that does not explore, whether no app has failed.
    pub complete: bool,
    /// Why the run ended.
    pub reason: String,
    /// Of a recording: how far scans lie off the recorded positions, root mean square (m), where poses are estimated; both ways are laid on each
    /// other at the first scan of which both are known.
    pub position_error_m: Option<f64>,
    /// Of a recording: frames that were played.
    pub frames: Option<u64>,
    /// Of these, those that could not be used.
    pub unusable_frames: Option<u64>,
    /// Of these, those with the sensor lost: the estimator of poses did not find where they were taken.
    pub lost_frames: Option<u64>,
    /// Scans taken.
    pub scans: u64,
    /// Length of the way (m).
    pub path_length_m: f64,
    /// Time that a robot with limits on its speeds is on this way (s): computed, nobody waited for it.
    pub travel_seconds: Option<f64>,
    /// How often it stopped since it would have left what was known to be free.
    pub stops: Option<u64>,
    /// Frontier voxels left, by cause; of a run that was stopped, all that the map has, as open.
    pub frontiers_left: Option<FrontiersLeft>,
    /// Voxels known.
    pub known_voxels: u64,
    /// Of these, free.
    pub free_voxels: u64,
    /// Of these, occupied.
    pub occupied_voxels: u64,
    /// What became of all scans' pixels, of a camera that matches images.
    pub pixels: Option<PixelTally>,
    /// Known voxels whose state is that of the true world, of all known voxels (0 to 1).
    pub accuracy: Option<f64>,
    /// Motions on which the robot touched the true world; of a run that was stopped, as far as the sensor has said so.
    pub contacts: Option<u64>,
    /// Time from the first pose command to the last message of a step (s).
    pub seconds: f64,
    /// Scans and way to 95, 99, 99.9 and 100 % of the free voxels known at the end.
    pub coverage: Vec<CoverageMark>,
    /// Plans made.
    pub plans: Option<u64>,
    /// What the explorer's strategy counted, by name.
    pub counters: BTreeMap<String, u64>,
    /// Seconds of CPU by phase.
    pub cpu_seconds: BTreeMap<String, f64>,
    /// From one pose command to the next.
    pub step: Option<Spread>,
    /// Of it, what lies between an app's input and its output, by app.
    pub step_by_app: BTreeMap<String, Spread>,
}

impl Summary {
    /// Sums up what was observed of a mission in which these `ran`; `ended` is why it ended before its time, if it did.
    pub(crate) fn of(mission: &Mission, observed: &Observer, ran: Ran, ended: Option<&LaunchError>) -> Self {
        let report = observed.exploration.as_ref();
        let (complete, reason) = completeness(mission, observed, ended);
        let motion = observed.motion();
        let (scans, path_length_m) = motion.as_ref().map_or((0, 0.0), |motion| (motion.scans, motion.path_length_m));
        let (free, occupied) = observed.map.as_ref().map_or((0, 0), |map| (map.free, map.occupied));
        Self {
            mission: mission.name.clone(),
            mission_file: mission.file.display().to_string(),
            explorer: ran.explorers.join(", "),
            swapped: ran.swapped,
            policy: report.map(|report| report.policy.clone()).or_else(|| policy(mission)),
            settings: report.map(|report| report.settings.clone()),
            seed: seed(mission),
            complete,
            reason,
            position_error_m: observed.playback.as_ref().and_then(|playback| playback.off_m),
            frames: observed.playback.as_ref().map(|playback| playback.frames),
            unusable_frames: observed.playback.as_ref().map(|playback| playback.bad),
            lost_frames: observed.playback.as_ref().map(|playback| playback.lost),
            scans,
            path_length_m,
            travel_seconds: observed.travel.as_ref().map(|travel| travel.secs),
            stops: observed.travel.as_ref().map(|travel| travel.stops),
            frontiers_left: observed.frontiers_left(),
            known_voxels: free + occupied,
            free_voxels: free,
            occupied_voxels: occupied,
            pixels: observed.map.as_ref().map(|map| map.rays.pixels).filter(|pixels| pixels.total() > 0),
            accuracy: observed.accuracy.as_ref().filter(|report| report.voxels > 0).map(|report| report.accuracy),
            contacts: observed.contacts(),
            seconds: observed.seconds(),
            coverage: motion.map(|motion| motion.marks).unwrap_or_default(),
            plans: report.map(|report| report.plans),
            counters: report.map(|report| report.counters.iter().cloned().collect()).unwrap_or_default(),
            cpu_seconds: cpu_seconds(observed),
            step: observed.steps.whole_step(),
            step_by_app: observed.steps.by_app(),
        }
    }

    /// Writes it into the run's folder.
    pub(crate) fn write(&self, folder: &Path) -> Result<(), LaunchError> {
        let file = folder.join(SUMMARY);
        let written = serde_json::to_string_pretty(self)
            .map_err(std::io::Error::from)
            .and_then(|json| std::fs::write(&file, json + "\n"));
        written.map_err(|source| LaunchError::File { file, source })
    }
}

/// The apps that were swapped in the run that is kept in `folder`, as far as it was summed up.
pub(crate) fn swapped(folder: &Path) -> Vec<String> {
    #[derive(Default, Deserialize)]
    struct Swapped {
        #[serde(default)]
        swapped: Vec<String>,
    }
    let text = file::read_text(&folder.join(SUMMARY), LONGEST).unwrap_or_default();
    serde_json::from_str::<Swapped>(&text).unwrap_or_default().swapped
}

/// Whether the mission is complete, and why it ended.
fn completeness(mission: &Mission, observed: &Observer, ended: Option<&LaunchError>) -> (bool, String) {
    if !mission.explores() {
        return match ended {
            // Programs that want a community run until somebody has had enough of them.
            Some(LaunchError::Stopped) => (true, "it ran until it was stopped".to_owned()),
            Some(error) => (false, error.to_string()),
            None => (true, "all its apps have ended".to_owned()),
        };
    }
    if let Some(played) = observed.played() {
        return played_through(mission, observed, played, ended);
    }
    let Some(report) = &observed.exploration else {
        let silent = || "the explorer did not say why it ended".to_owned();
        return (false, ended.map_or_else(silent, LaunchError::to_string));
    };
    let reason = &report.reason;
    match (ended, objection(mission, observed, report.complete)) {
        (Some(error), _) if report.complete => (false, format!("{reason}, but {error}")),
        (Some(error), _) => (false, error.to_string()),
        (None, None) => (report.complete, reason.clone()),
        (None, Some(objection)) if report.complete => (false, format!("{reason}, but {objection}")),
        (None, Some(objection)) => (false, format!("{reason}: {objection}")),
    }
}

/// Whether a recording that was played to its end made a map, and what of it could not be used.
fn played_through(
    mission: &Mission,
    observed: &Observer,
    played: &Playback,
    ended: Option<&LaunchError>,
) -> (bool, String) {
    let Playback { frames, scans, bad, lost, .. } = *played;
    let cut = Some(&played.cut).filter(|cut| !cut.is_empty());
    let counted = [(bad, "could not be used"), (lost, "with the sensor lost")];
    let how = if cut.is_some() { "cut short" } else { "played to its end" };
    let mut reason = format!("the recording is {how}, {scans} scans of {frames} frames");
    for (count, what) in counted.into_iter().filter(|(count, _)| *count > 0) {
        reason += &format!(", {count} {what}");
    }
    if bad + lost > 0 {
        reason += ", as the Sensor's log says of each";
    }
    let against = ended.map(LaunchError::to_string).or_else(|| cut.cloned());
    let against = against.or_else(|| objection(mission, observed, true));
    match against {
        Some(against) => (false, format!("{reason}, but {against}")),
        None if scans == 0 => (false, format!("{reason}: none could be used")),
        None => (true, reason),
    }
}

/// What speaks against a mission whose explorer calls it complete, or says more than the explorer can know.
fn objection(mission: &Mission, observed: &Observer, complete: bool) -> Option<String> {
    let map = observed.map.as_ref();
    let filters: Vec<&AppSpec> = mission.of_element(element::FILTER).collect();
    if let Some(shortfall) = map.and_then(|map| shortfall(&filters, map)) {
        return Some(shortfall);
    }
    match observed.last_report().map(|report| report.contacts) {
        _ if !complete => map.and_then(overflow),
        None => Some("nobody counted contacts with the true world".to_owned()),
        // A real camera cannot tell, and that is no failure.
        Some(None | Some(0)) => None,
        Some(Some(n)) => Some(format!("the robot touched the true world {n} times")),
    }
}

/// The seed of the first app that has one, in the order of the file: the sensor's.
pub(crate) fn seed(mission: &Mission) -> Option<i64> {
    let stages = mission.apps.iter().filter(|app| app.element != element::LOGGER);
    stages.filter_map(|app| app.setting("Seed")?.parse().ok()).next()
}

/// The policy that the mission asks its explorer for: what there is to say of one that has not reported.
fn policy(mission: &Mission) -> Option<String> {
    mission.of_element(element::EXPLORER).find_map(|app| app.setting("Policy")).map(str::to_owned)
}

fn cpu_seconds(observed: &Observer) -> BTreeMap<String, f64> {
    let sensor = observed.sensor.iter().map(|report| ("scans".to_owned(), report.cpu_secs));
    let map = observed.map.iter().map(|map| ("map insertion".to_owned(), map.cpu_secs));
    let plans = observed.exploration.iter().flat_map(|report| report.cpu_secs.clone());
    sensor.chain(map).chain(plans).collect()
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let word = if self.complete { "complete" } else { "NOT complete" };
        writeln!(f, "{}: {word}: {}", self.mission, self.reason)?;
        if self.scans == 0 {
            return Ok(());
        }
        let Self { scans, path_length_m: length, seconds, explorer, .. } = self;
        let policy = self.policy.as_ref().map(|policy| format!(", policy {policy}")).unwrap_or_default();
        let explorer = if explorer.is_empty() { String::new() } else { format!(", explorer {explorer}") };
        writeln!(f, "  {scans} scans, {length:.1} m of way, {seconds:.1} s{explorer}{policy}")?;
        if let Some(secs) = self.travel_seconds {
            let stops = self.stops.filter(|stops| *stops > 0);
            let stops =
                stops.map_or(String::new(), |stops| format!(", {stops} stops before what is not known to be free"));
            writeln!(f, "  {secs:.1} s on the way at the robot's limits, as computed{stops}")?;
        }
        if let Some(off) = self.position_error_m {
            writeln!(
                f,
                "  positions are {off:.4} m off the recorded ones (root mean square, alike at the first that was recorded)"
            )?;
        }
        if let Some(settings) = &self.settings {
            writeln!(f, "  {settings}")?;
        }
        if !self.swapped.is_empty() {
            writeln!(f, "  swapped while it ran: {}", self.swapped.join(", "))?;
        }
        for mark in &self.coverage {
            let percent = 100.0 * mark.share;
            writeln!(
                f,
                "  {percent:>5.1} % of the free voxels known at the end after {} scans, {:.1} m",
                mark.scans, mark.path_length_m
            )?;
        }
        let Self { known_voxels: known, free_voxels: free, occupied_voxels: occupied, .. } = self;
        writeln!(f, "  {known} voxels known: {free} free, {occupied} occupied")?;
        if let Some(pixels) = &self.pixels {
            let share = 100.0 * pixels.matched as f64 / pixels.total() as f64;
            writeln!(f, "  {share:.1} % of the scans' pixels matched, the others not: {pixels}")?;
        }
        if let Some(left) = &self.frontiers_left {
            writeln!(
                f,
                "  {} frontier voxels left: {} unreachable, {} invisible, {} unresolved, {} with nothing to be seen behind, \
                 {} too small, {} open, {} where the \
                 map ends, {} where it is full, {} where the volume ends",
                left.total(),
                left.unreachable,
                left.invisible,
                left.unresolved,
                left.no_return,
                left.too_small,
                left.open,
                left.map_edge,
                left.no_room,
                left.volume_edge
            )?;
        }
        let accuracy = self.accuracy.map(|share| format!("accuracy {:.2} %", 100.0 * share));
        let contacts = self.contacts.map(|count| format!("contacts {count}"));
        let figures: Vec<String> = accuracy.into_iter().chain(contacts).collect();
        if !figures.is_empty() {
            writeln!(f, "  {}", figures.join(", "))?;
        }
        if let Some(step) = &self.step {
            writeln!(f, "  a step: median {:.1} ms, 99 % within {:.1} ms", step.median_ms, step.p99_ms)?;
        }
        Ok(())
    }
}
