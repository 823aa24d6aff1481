//! What the mission says of itself on the bus: who is there, how far it is, how it ended.

use std::collections::BTreeSet;

use elk_bus::{Comms, CommsError, DecodeError, Key, Mail, Payload};
use elk_mission::Mission;
use elk_spatial::keys::{
    ACCURACY_REPORT, EXPLORATION_REPORT, MAP_KNOWN, MAP_UPDATE, MOTION_REPORT, PLAN, PLAN_REQUEST, POSE_COMMAND,
    PROGRESS, SCAN, SENSOR_REPORT,
};
use elk_spatial::messages::{AccuracyReport, ExplorationReport, MapStatus, MotionReport, Progress, SensorReport};

use crate::steps::StepTimes;

/// The broker's list of clients, each name followed by a comma.
const DB_CLIENTS: &str = "DB_CLIENTS";
/// What the logger says when it cannot write; empty when it can again.
const LOGGER_ERROR: &str = "LOGGER_ERROR";

/// Everything that was heard.
#[derive(Debug, Default)]
pub(crate) struct Observer {
    /// Names of the clients of the community.
    pub clients: BTreeSet<String>,
    pub progress: Option<Progress>,
    pub map: Option<MapStatus>,
    pub sensor: Option<SensorReport>,
    pub exploration: Option<ExplorationReport>,
    pub motion: Option<MotionReport>,
    pub accuracy: Option<AccuracyReport>,
    pub steps: StepTimes,
    /// The community's time of the first pose command (s).
    pub first_command: Option<f64>,
    /// What somebody has to be told, in the order in which it came up.
    pub complaints: Vec<String>,
    /// The variables of one step, in their order, after the pose command.
    chain: Vec<String>,
}

impl Observer {
    /// Listens to a mission.
    pub fn new(mission: &Mission) -> Self {
        let outputs = ["Sensor", "Filter"].into_iter().flat_map(|element| mission.of_element(element));
        let mut chain: Vec<String> =
            outputs.map(|app| app.setting("Output").unwrap_or(SCAN.name()).to_owned()).collect();
        chain.extend([MAP_UPDATE.name(), PLAN_REQUEST.name(), PLAN.name()].map(str::to_owned));
        Self { chain, ..Self::default() }
    }

    /// Registers for all that it understands.
    pub fn register(&self, comms: &mut Comms) -> Result<(), CommsError> {
        for key in [DB_CLIENTS, LOGGER_ERROR].into_iter().chain(self.chain.iter().map(String::as_str)) {
            comms.register_variable(key, 0.0)?;
        }
        comms.register(&POSE_COMMAND)?;
        comms.register(&PROGRESS)?;
        comms.register(&MAP_KNOWN)?;
        comms.register(&SENSOR_REPORT)?;
        comms.register(&EXPLORATION_REPORT)?;
        comms.register(&MOTION_REPORT)?;
        comms.register(&ACCURACY_REPORT)
    }

    /// Takes note of a message.
    pub fn note(&mut self, mail: &Mail<'_>) {
        let command = mail.is(&POSE_COMMAND);
        if command || self.chain.iter().any(|key| key == mail.key()) {
            self.steps.note(mail.source(), mail.time(), command);
            self.first_command = self.first_command.or(command.then(|| mail.time()));
        } else if let Err(error) = self.note_report(mail) {
            self.complaints.push(format!("{} by {}: {error}", mail.key(), mail.source()));
        }
    }

    fn note_report(&mut self, mail: &Mail<'_>) -> Result<(), DecodeError> {
        match mail.key() {
            DB_CLIENTS => self.note_clients(mail.as_text().unwrap_or_default()),
            LOGGER_ERROR => self.note_logger(mail.as_text().unwrap_or_default()),
            _ => {}
        }
        keep(mail, &PROGRESS, &mut self.progress)?;
        keep(mail, &MAP_KNOWN, &mut self.map)?;
        keep(mail, &SENSOR_REPORT, &mut self.sensor)?;
        keep(mail, &EXPLORATION_REPORT, &mut self.exploration)?;
        keep(mail, &MOTION_REPORT, &mut self.motion)?;
        keep(mail, &ACCURACY_REPORT, &mut self.accuracy)
    }

    fn note_clients(&mut self, names: &str) {
        self.clients = names.split(',').filter(|name| !name.is_empty()).map(str::to_owned).collect();
    }

    fn note_logger(&mut self, trouble: &str) {
        if !trouble.is_empty() {
            self.complaints.push(trouble.to_owned());
        }
    }

    /// Whether exploration is over, for whatever reason.
    pub fn finished(&self) -> bool {
        self.exploration.is_some() && self.motion.is_some()
    }

    /// Whether the map as it is now has been held against the true world.
    pub fn judged(&self) -> bool {
        let revision = self.map.as_ref().map_or(0, |map| map.revision);
        self.accuracy.as_ref().is_some_and(|judged| judged.revision >= revision)
    }

    /// Motions that touched the true world, if the sensor has said so of the last scan.
    pub fn contacts(&self) -> Option<u64> {
        let scans = self.motion.as_ref()?.scans;
        self.sensor.as_ref().filter(|report| report.scans >= scans).map(|report| report.contacts)
    }

    /// Seconds of the community's time since the first pose command.
    pub fn seconds(&self) -> f64 {
        match (self.first_command, self.steps.last()) {
            (Some(first), Some(last)) => last - first,
            _ => 0.0,
        }
    }
}

/// Keeps what `mail` says, if it is of `key`.
fn keep<T>(mail: &Mail<'_>, key: &Key<T>, place: &mut Option<T>) -> Result<(), DecodeError>
where
    T: for<'a> Payload<View<'a> = T>,
{
    if mail.is(key) {
        *place = Some(mail.decode(key)?);
    }
    Ok(())
}
