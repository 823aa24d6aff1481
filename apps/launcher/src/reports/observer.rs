//! What the mission says of itself on the bus: who is there, how far it is, how it ended.

use std::collections::{BTreeMap, BTreeSet};

use elk_bus::clock::Stopwatch;
use elk_bus::rejection::REJECTED;
use elk_bus::{Comms, CommsError, DecodeError, Key, Mail, Payload, text};
use elk_mission::variables::LOGGER_ERROR;
use elk_mission::{Mission, element};
use elk_spatial::keys::{
    ACCURACY_REPORT, EXPLORATION_REPORT, MAP_KNOWN, MAP_UPDATE, MOTION_REPORT, PLAN, PLAN_REQUEST, PLAYBACK,
    POSE_COMMAND, PROGRESS, SCAN, SENSOR_REPORT, TRAVEL_REPORT,
};
use elk_spatial::messages::{
    AccuracyReport, CoverageSample, ExplorationReport, FrontiersLeft, MapStatus, MotionReport, Progress, SensorReport,
};
use elk_spatial::playback::Playback;
use elk_spatial::record::Record;
use elk_spatial::travel::TravelReport;

use crate::reports::steps::StepTimes;

/// The broker's list of clients, each name followed by a comma.
const DB_CLIENTS: &str = "DB_CLIENTS";

/// What the broker says of clients that come, go, and take over.
const DB_EVENT: &str = "DB_EVENT";
/// The broker's list of how much mail each client has missed.
const DB_DROPS: &str = "DB_DROPS";
/// What every app says of itself every two seconds, from its run loop.
const STATUS: &str = "*_STATUS";
const STATUS_SUFFIX: &str = "_STATUS";

/// Pairs of variable and writer that are complained of.
const COMPLAINED_OF: usize = 64;
/// Characters of a complaint.
const COMPLAINT_LENGTH: usize = 1000;

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

/// Messages that clients have not made use of, by their names.
#[derive(Debug, Clone, Default)]
pub(crate) struct Losses {
    /// Missed, because a client did not keep up.
    pub dropped: BTreeMap<String, u64>,
    /// Passed over, because an app could not use them.
    pub rejected: BTreeMap<String, u64>,
}

impl Losses {
    /// An app's word of itself: `…,rejected=3,MOOSName=Map`. Nobody else's.
    fn note_status(&mut self, mail: &Mail<'_>) {
        // An app of somebody else's may say anything under such a name.
        let Some(text) = mail.as_text() else { return };
        let said = |name: &str| text.split(',').find_map(|part| part.strip_prefix(name)?.strip_prefix('='));
        if let (Some(name), Some(Ok(count))) = (said("MOOSName"), said("rejected").map(str::parse))
            && name == mail.source()
        {
            self.rejected.insert(name.to_owned(), count);
        }
    }
}

/// Everything that was heard.
#[derive(Debug, Default)]
pub(crate) struct Observer {
    /// What has to be done something about, in its order; whoever does takes it.
    pub news: Vec<News>,
    /// Who was heard since this was last taken.
    pub signs: BTreeSet<String>,
    /// What each client has not made use of.
    pub losses: Losses,
    /// Names of the clients of the community.
    pub clients: BTreeSet<String>,
    pub progress: Option<Progress>,
    /// What all progress that was heard comes to.
    record: Record,
    pub map: Option<MapStatus>,
    pub sensor: Option<SensorReport>,
    pub exploration: Option<ExplorationReport>,
    pub motion: Option<MotionReport>,
    /// How long a robot that takes its time has been on its way.
    pub travel: Option<TravelReport>,
    /// How far a recording is played.
    pub playback: Option<Playback>,
    pub accuracy: Option<AccuracyReport>,
    pub steps: StepTimes,
    /// Which message of a step came last, and whose it was.
    pub last_word: String,
    /// What was rejected of it, by whom and why, as far as anybody has said so since; empty: nothing was.
    rejection: String,
    /// Since when that is the last one, and whether it asks for a plan.
    pub since_last_word: Option<(Stopwatch, bool)>,
    /// The community's time of the first pose command (s).
    pub first_command: Option<f64>,
    /// What somebody has to be told, in the order in which it came up; no more of one variable and writer than was agreed.
    pub complaints: Vec<String>,
    /// How often there was reason to complain, by variable and writer.
    complained: BTreeMap<(String, String), usize>,
    /// The variables of one step, in their order, after the pose command.
    chain: Vec<String>,
    /// The reports that a mission's end hangs on, with the names of the apps whose they are.
    reporters: BTreeMap<String, Vec<String>>,
}

impl Observer {
    /// Listens to a mission.
    pub fn new(mission: &Mission) -> Self {
        let outputs = [element::SENSOR, element::FILTER].into_iter().flat_map(|element| mission.of_element(element));
        let mut chain: Vec<String> =
            outputs.map(|app| app.setting("Output").unwrap_or(SCAN.name()).to_owned()).collect();
        chain.extend([MAP_UPDATE.name(), PLAN_REQUEST.name(), PLAN.name()].map(str::to_owned));
        let named = |element: &str| mission.of_element(element).map(|app| app.name.clone()).collect();
        let reporters = reports().map(|(key, element)| (key, named(element))).into();
        Self { chain, reporters, ..Self::default() }
    }

    /// Registers for all that it understands.
    pub fn register(&self, comms: &mut Comms) -> Result<(), CommsError> {
        [DB_EVENT, DB_CLIENTS, DB_DROPS, LOGGER_ERROR, REJECTED]
            .iter()
            .try_for_each(|key| comms.register(text(key)))?;
        self.chain.iter().try_for_each(|key| comms.register(key))?;
        comms.register(STATUS)?;
        comms.register(&POSE_COMMAND)?;
        comms.register(&PROGRESS)?;
        comms.register(&MAP_KNOWN)?;
        comms.register(&SENSOR_REPORT)?;
        comms.register(&EXPLORATION_REPORT)?;
        comms.register(&MOTION_REPORT)?;
        comms.register(&PLAYBACK)?;
        comms.register(&TRAVEL_REPORT)?;
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
            self.since_last_word = Some((Stopwatch::start(), mail.is(&PLAN_REQUEST)));
            self.rejection.clear();
            let time = Some(mail.time()).filter(|time| command && time.is_finite());
            self.first_command = self.first_command.or(time);
        } else if let Err(error) = self.note_report(mail) {
            self.complain(mail, format!("{} by {}: {error}", mail.key(), mail.source()));
        }
    }

    /// Which message of a step came last, and whose it was; and what was rejected since, by whom and why.
    pub fn last_words(&self) -> (String, String) {
        (self.last_word.clone(), self.rejection.clone())
    }

    /// Takes up a complaint about a message, if there were less than [`most`] of its variable and writer.
    fn complain(&mut self, mail: &Mail<'_>, words: String) {
        let pair = (mail.key().to_owned(), mail.source().to_owned());
        if self.complained.len() >= COMPLAINED_OF && !self.complained.contains_key(&pair) {
            return;
        }
        let count = self.complained.entry(pair).or_default();
        *count = count.saturating_add(1);
        if *count <= most(mail.key()) {
            self.complaints.push(words.chars().take(COMPLAINT_LENGTH).collect());
        }
    }

    /// How often there was reason to complain where not all of it was said, a line a variable and writer.
    pub fn left_out(&self) -> impl Iterator<Item = String> + '_ {
        let often = self.complained.iter().filter(|((key, _), count)| **count > most(key));
        often.map(|((key, writer), count)| format!("{key} by {writer}: {count} such messages in all"))
    }

    fn note_report(&mut self, mail: &Mail<'_>) -> Result<(), DecodeError> {
        match mail.key() {
            DB_EVENT => self.news.extend(mail.as_text().and_then(event)),
            // The broker writes these, texts both; anything else says nothing of who is there.
            DB_CLIENTS => mail.as_text().into_iter().for_each(|text| self.note_clients(text)),
            DB_DROPS => mail.as_text().into_iter().for_each(|text| self.losses.dropped = drops(text)),
            LOGGER_ERROR | REJECTED => self.note_trouble(mail),
            key if key.ends_with(STATUS_SUFFIX) => self.losses.note_status(mail),
            _ => {}
        }
        if self.is_of_a_stranger(mail) {
            let words = format!("{} by {}: it is not the mission's, and counts for nothing", mail.key(), mail.source());
            self.complain(mail, words);
            return Ok(());
        }
        if mail.is(&EXPLORATION_REPORT) || mail.is(&MOTION_REPORT) || mail.is(&ACCURACY_REPORT) {
            self.news.push(News::Report);
        }
        keep(mail, &PROGRESS, &mut self.progress)?;
        if let Some(Progress { scans, free, path_length_m, .. }) = self.progress.as_ref().filter(|_| mail.is(&PROGRESS))
        {
            self.record.take(CoverageSample { scans: *scans, free: *free, path_length_m: *path_length_m });
        }
        keep(mail, &MAP_KNOWN, &mut self.map)?;
        keep(mail, &SENSOR_REPORT, &mut self.sensor)?;
        keep(mail, &EXPLORATION_REPORT, &mut self.exploration)?;
        keep(mail, &MOTION_REPORT, &mut self.motion)?;
        keep(mail, &PLAYBACK, &mut self.playback)?;
        keep(mail, &TRAVEL_REPORT, &mut self.travel)?;
        keep(mail, &ACCURACY_REPORT, &mut self.accuracy)
    }

    /// Whether a report comes from somebody else than the mission's app whose it is.
    fn is_of_a_stranger(&self, mail: &Mail<'_>) -> bool {
        let own = self.reporters.get(mail.key());
        own.is_some_and(|names| !names.iter().any(|name| name == mail.source()))
    }

    fn note_clients(&mut self, names: &str) {
        let names: BTreeSet<String> = names.split(',').filter(|name| !name.is_empty()).map(str::to_owned).collect();
        // Who came while the launcher itself was cut off did so unheard.
        self.news.extend(names.difference(&self.clients).cloned().map(News::Arrived));
        self.clients = names;
    }

    /// What an app says of its own trouble; nothing, when it is over.
    fn note_trouble(&mut self, mail: &Mail<'_>) {
        if let Some(trouble) = mail.as_text().filter(|trouble| !trouble.is_empty()) {
            if mail.key() == REJECTED {
                self.rejection = trouble.chars().take(COMPLAINT_LENGTH).collect();
            }
            self.complain(mail, trouble.to_owned());
        }
    }

    /// Whether exploration is over, for whatever reason, or the recording played to its end.
    pub fn finished(&self) -> bool {
        self.motion.is_some() && (self.exploration.is_some() || self.played().is_some())
    }

    /// What came of a recording that is played to its end.
    pub fn played(&self) -> Option<&Playback> {
        self.playback.as_ref().filter(|playback| playback.next_secs.is_none())
    }

    /// Whether the map as it is now has been held against the true world, or nobody knows that.
    pub fn is_evaluated(&self) -> bool {
        if self.sensor.as_ref().is_some_and(|report| report.contacts.is_none()) {
            return true;
        }
        let revision = self.map.as_ref().map_or(0, |map| map.revision);
        self.accuracy.as_ref().is_some_and(|report| report.revision >= revision)
    }

    /// What the sensor has said of the last scan.
    pub fn last_report(&self) -> Option<&SensorReport> {
        let scans = self.motion.as_ref()?.scans;
        self.sensor.as_ref().filter(|report| report.scans >= scans)
    }

    /// Motions that touched the true world, if the sensor has said so of the last scan, and can tell; of a run that is not over,
    /// as far as the sensor has said so.
    pub fn contacts(&self) -> Option<u64> {
        let report = if self.motion.is_some() { self.last_report() } else { self.sensor.as_ref() };
        report?.contacts
    }

    /// What it has cost to get how far: the controller's own word, or, before the run is over, what its progress comes to.
    pub fn motion(&self) -> Option<MotionReport> {
        let so_far = || Some(self.record.report()).filter(|report| report.scans > 0);
        self.motion.clone().or_else(so_far)
    }

    /// What frontier is left: the explorer's own word, or, before the run is over, all that the map has, which nobody has looked at.
    pub fn frontiers_left(&self) -> Option<FrontiersLeft> {
        let of_map = || self.map.as_ref().map(|map| FrontiersLeft { open: map.frontier, ..FrontiersLeft::default() });
        self.exploration.as_ref().map(|report| report.frontiers_left).or_else(of_map)
    }

    /// Seconds of the community's time since the first pose command.
    pub fn seconds(&self) -> f64 {
        match (self.first_command, self.steps.last()) {
            (Some(first), Some(last)) => last - first,
            _ => 0.0,
        }
    }
}

/// Whose reports sum a mission up, by the element of its apps.
fn reports() -> [(String, &'static str); 8] {
    [
        (PROGRESS.name(), element::CONTROLLER),
        (MOTION_REPORT.name(), element::CONTROLLER),
        (TRAVEL_REPORT.name(), element::CONTROLLER),
        (EXPLORATION_REPORT.name(), element::EXPLORER),
        (MAP_KNOWN.name(), element::MAP),
        (SENSOR_REPORT.name(), element::SENSOR),
        (PLAYBACK.name(), element::SENSOR),
        (ACCURACY_REPORT.name(), element::SENSOR),
    ]
    .map(|(key, element)| (key.to_owned(), element))
}

/// How many complaints about a variable are said, of each writer.
fn most(key: &str) -> usize {
    match key {
        LOGGER_ERROR => 16,
        // The app's own text log has more.
        REJECTED => 8,
        // Of what is no report, or a stranger's, one tells all.
        _ => 1,
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
fn keep<T>(mail: &Mail<'_>, key: &Key<T>, kept: &mut Option<T>) -> Result<(), DecodeError>
where
    T: for<'a> Payload<View<'a> = T>,
{
    if mail.is(key) {
        *kept = Some(mail.decode(key)?);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use elk_bus::memory::MemoryBroker;
    use elk_bus::{BrokerConfig, Client, Clock, Community};

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

    /// Regression: a hostile writer's reports were taken for true, and what was no report was said without end.
    #[test]
    fn lies_are_complained_of_once_a_variable_and_writer_and_then_counted() {
        let broker = MemoryBroker::new(BrokerConfig::new("observer"), Clock::new(1.0));
        let community = Community::new("observer").unwrap();
        let join = |name: &str| Client::over(broker.connect(name).unwrap(), name, &community);
        let (mut observer, mut launcher, mut liar) = (Observer::default(), join("launcher"), join("liar"));
        observer.register(&mut launcher.comms).unwrap();
        launcher.comms.flush().unwrap();
        let right = Progress { scan: 3, revision: 3, scans: 3, path_length_m: 1.0, free: 9, finished: false };
        for _ in 0..100 {
            liar.comms.publish(&PROGRESS, &Progress { scans: u64::MAX, ..right.clone() }).unwrap();
            liar.comms.publish(&PROGRESS, &Progress { path_length_m: f64::NAN, ..right.clone() }).unwrap();
        }
        let report = SensorReport { scans: u64::MAX, contacts: Some(0), scan: 0, cpu_secs: 0.0 };
        liar.comms.publish(&SENSOR_REPORT, &report).unwrap();
        (0..100).for_each(|n| liar.comms.notify(LOGGER_ERROR, format!("disk {n}").as_str()).unwrap());
        liar.comms.publish(&PROGRESS, &right).unwrap();
        liar.comms.flush().unwrap();
        launcher.receive(std::time::Duration::ZERO, |mail| observer.note(mail)).unwrap();
        assert_eq!(observer.progress, Some(right));
        let of = |key: &str| observer.complaints.iter().filter(|words| words.starts_with(key)).count();
        assert_eq!((of("PROGRESS by liar"), of("SENSOR_REPORT by liar"), of("disk")), (1, 1, most(LOGGER_ERROR)));
        let left_out: Vec<String> = observer.left_out().collect();
        let expected = ["LOGGER_ERROR by liar: 100", "PROGRESS by liar: 200"];
        assert_eq!(left_out, expected.map(|words| format!("{words} such messages in all")));
    }

    #[test]
    fn what_was_said_in_full_is_not_counted_again() {
        let pair = |key: &str| (key.to_owned(), "app".to_owned());
        let complained = [(pair(LOGGER_ERROR), 16), (pair(REJECTED), 9), (pair("PROGRESS"), 1)].into();
        let observer = Observer { complained, ..Observer::default() };
        let left_out: Vec<String> = observer.left_out().collect();
        assert_eq!(left_out, [format!("{REJECTED} by app: 9 such messages in all")]);
    }

    /// Regression: anybody's word that all is explored ended the mission as complete.
    #[test]
    fn reports_of_strangers_count_for_nothing() {
        let broker = MemoryBroker::new(BrokerConfig::new("strangers"), Clock::new(1.0));
        let community = Community::new("strangers").unwrap();
        let join = |name: &str| Client::over(broker.connect(name).unwrap(), name, &community);
        let (mut launcher, mut liar, mut controller) = (join("launcher"), join("liar"), join("Controller"));
        let reporters = [(MOTION_REPORT.name().to_owned(), vec!["Controller".to_owned()])].into();
        let mut observer = Observer { reporters, ..Observer::default() };
        observer.register(&mut launcher.comms).unwrap();
        launcher.comms.flush().unwrap();
        let report = |scans| MotionReport { scans, path_length_m: 1.0, free: 9, marks: vec![] };
        for (client, scans) in [(&mut controller, 7), (&mut liar, 3)] {
            client.comms.publish(&MOTION_REPORT, &report(scans)).unwrap();
            client.comms.flush().unwrap();
        }
        launcher.receive(std::time::Duration::ZERO, |mail| observer.note(mail)).unwrap();
        assert_eq!(observer.motion, Some(report(7)));
        assert_eq!(observer.complaints, ["MOTION_REPORT by liar: it is not the mission's, and counts for nothing"]);
    }

    /// What stands still after a plan was rejected stands still for that.
    #[test]
    fn what_was_rejected_is_said_until_somebody_goes_on() {
        let broker = MemoryBroker::new(BrokerConfig::new("rejected"), Clock::new(1.0));
        let community = Community::new("rejected").unwrap();
        let join = |name: &str| Client::over(broker.connect(name).unwrap(), name, &community);
        let (mut launcher, mut controller) = (join("launcher"), join("Controller"));
        let mut observer = Observer { chain: vec![PLAN.name().to_owned()], ..Observer::default() };
        observer.register(&mut launcher.comms).unwrap();
        launcher.comms.flush().unwrap();
        let why = "Controller rejects PLAN #1 by Explorer: path.points is from here to there through a wall";
        controller.comms.notify(PLAN.name(), 1.0).unwrap();
        controller.comms.notify(REJECTED, why).unwrap();
        controller.comms.flush().unwrap();
        launcher.receive(std::time::Duration::ZERO, |mail| observer.note(mail)).unwrap();
        assert_eq!(observer.last_words(), ("PLAN by Controller".to_owned(), why.to_owned()));
        let (last_word, rejection) = observer.last_words();
        let said =
            crate::LaunchError::Standstill { secs: 300, last_word, rejection, folder: "logs".into() }.to_string();
        assert!(said.contains(&format!("should have answered did not ({why}): what they say")), "{said}");
        controller.comms.notify(PLAN.name(), 2.0).unwrap();
        controller.comms.flush().unwrap();
        launcher.receive(std::time::Duration::ZERO, |mail| observer.note(mail)).unwrap();
        assert_eq!(observer.last_words().1, "");
    }

    #[test]
    fn who_is_new_in_the_list_has_arrived() {
        let mut observer = Observer::default();
        observer.note_clients("Map,");
        observer.note_clients("Map,Sensor,");
        assert_eq!(observer.news, ["Map", "Sensor"].map(|name| News::Arrived(name.into())));
    }
}
