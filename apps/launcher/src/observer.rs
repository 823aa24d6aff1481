//! What the mission says of itself on the bus: who is there, how far it is, how it ended.

use std::collections::{BTreeMap, BTreeSet};

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

/// What the broker says of clients that come, go, and take over.
const DB_EVENT: &str = "DB_EVENT";
/// The broker's list of how much mail each client has missed.
const DB_DROPS: &str = "DB_DROPS";
/// What every app says of itself every two seconds, from its run loop.
const STATUS: &str = "*_STATUS";

/// What the launcher has to do something about.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum News {
    /// The launcher itself has joined.
    Joined,
    /// A client has.
    Arrived(String),
    /// A successor of this name has come up and waits.
    Ready(String),
    /// A successor has handled its first message, so many milliseconds after its predecessor's last.
    HandedOver(String, f64),
    /// A report that the mission's end may hang on.
    Report,
}

/// Everything that was heard.
#[derive(Debug, Default)]
pub(crate) struct Observer {
    /// What has to be done something about, in its order; whoever does takes it.
    pub news: Vec<News>,
    /// Who was heard since this was last taken.
    pub signs: BTreeSet<String>,
    /// Messages that each client has missed.
    pub dropped: BTreeMap<String, u64>,
    /// Names of the clients of the community.
    pub clients: BTreeSet<String>,
    pub progress: Option<Progress>,
    pub map: Option<MapStatus>,
    pub sensor: Option<SensorReport>,
    pub exploration: Option<ExplorationReport>,
    pub motion: Option<MotionReport>,
    pub accuracy: Option<AccuracyReport>,
    pub steps: StepTimes,
    /// Which message of a step came last, and whose it was.
    pub last_word: String,
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
        for key in
            [DB_EVENT, DB_CLIENTS, DB_DROPS, LOGGER_ERROR].into_iter().chain(self.chain.iter().map(String::as_str))
        {
            comms.register_variable(key, 0.0)?;
        }
        comms.register_variable(STATUS, 0.0)?;
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
        if !self.signs.contains(mail.source()) {
            self.signs.insert(mail.source().to_owned());
        }
        let command = mail.is(&POSE_COMMAND);
        if command || self.chain.iter().any(|key| key == mail.key()) {
            self.steps.note(mail.source(), mail.time(), command);
            self.last_word = format!("{} by {}", mail.key(), mail.source());
            self.first_command = self.first_command.or(command.then(|| mail.time()));
        } else if let Err(error) = self.note_report(mail) {
            self.complaints.push(format!("{} by {}: {error}", mail.key(), mail.source()));
        }
    }

    fn note_report(&mut self, mail: &Mail<'_>) -> Result<(), DecodeError> {
        match mail.key() {
            DB_EVENT => self.news.extend(mail.as_text().and_then(event)),
            DB_CLIENTS => self.note_clients(mail.as_text().unwrap_or_default()),
            DB_DROPS => self.dropped = drops(mail.as_text().unwrap_or_default()),
            LOGGER_ERROR => self.note_logger(mail.as_text().unwrap_or_default()),
            _ => {}
        }
        if mail.is(&EXPLORATION_REPORT) || mail.is(&MOTION_REPORT) || mail.is(&ACCURACY_REPORT) {
            self.news.push(News::Report);
        }
        keep(mail, &PROGRESS, &mut self.progress)?;
        keep(mail, &MAP_KNOWN, &mut self.map)?;
        keep(mail, &SENSOR_REPORT, &mut self.sensor)?;
        keep(mail, &EXPLORATION_REPORT, &mut self.exploration)?;
        keep(mail, &MOTION_REPORT, &mut self.motion)?;
        keep(mail, &ACCURACY_REPORT, &mut self.accuracy)
    }

    fn note_clients(&mut self, names: &str) {
        let names: BTreeSet<String> = names.split(',').filter(|name| !name.is_empty()).map(str::to_owned).collect();
        // Who came while the launcher itself was cut off did so unheard.
        self.news.extend(names.difference(&self.clients).cloned().map(News::Arrived));
        self.clients = names;
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

/// `connected=Map`, `ready=Map`, `handover=Map gap_ms=1.234`.
fn event(text: &str) -> Option<News> {
    let (what, whom) = text.split_once('=')?;
    match what {
        "connected" => Some(News::Arrived(whom.to_owned())),
        "ready" => Some(News::Ready(whom.to_owned())),
        "handover" => {
            let (name, gap) = whom.split_once(" gap_ms=")?;
            Some(News::HandedOver(name.to_owned(), gap.trim().parse().ok()?))
        }
        _ => None,
    }
}

/// `Map=3,Sensor=0,`
fn drops(text: &str) -> BTreeMap<String, u64> {
    let pairs = text.split(',').filter_map(|pair| pair.split_once('='));
    pairs.filter_map(|(name, count)| Some((name.to_owned(), count.parse().ok()?))).collect()
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_broker_says_of_clients_is_understood() {
        assert_eq!(event("connected=Map"), Some(News::Arrived("Map".into())));
        assert_eq!(event("ready=Map"), Some(News::Ready("Map".into())));
        assert_eq!(event("handover=Map gap_ms=1.250"), Some(News::HandedOver("Map".into(), 1.25)));
        for strange in ["disconnected=Map", "handover=Map", "", "handover=Map gap_ms=soon"] {
            assert_eq!(event(strange), None, "{strange}");
        }
        assert_eq!(drops("Map=3,Sensor=0,odd,x=y,"), [("Map".to_owned(), 3), ("Sensor".to_owned(), 0)].into());
    }

    #[test]
    fn who_is_new_in_the_list_has_arrived() {
        let mut observer = Observer::default();
        observer.note_clients("Map,");
        observer.note_clients("Map,Sensor,");
        assert_eq!(observer.news, ["Map", "Sensor"].map(|name| News::Arrived(name.into())));
    }
}
