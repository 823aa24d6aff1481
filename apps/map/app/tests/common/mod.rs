//! A map app that is given its mail message by message, and a client that hears all it says.

use std::path::Path;
use std::time::Duration;

use elk_bus::memory::MemoryBroker;
use elk_bus::{App, AppError, BrokerConfig, Client, Clock, Comms, Community, Mail, any};
use elk_geometry::Pose;
use elk_map::{Format, OccupancyMap};
use elk_spatial::Scan;
use elk_spatial::keys::SCAN;
use nalgebra::{Point3, Vector3};

/// The community.
const NAME: &str = "map-test";

/// The app, and who hears it.
pub struct Stage {
    broker: MemoryBroker,
    app: Box<dyn App>,
    client: Client,
    /// Hears it, and speaks to it.
    pub others: Client,
    /// What the next one begins with.
    pub settings: Vec<(String, String)>,
}

fn join(broker: &MemoryBroker, name: &str) -> Client {
    Client::over(broker.connect(name).unwrap(), name, &Community::new(NAME).unwrap())
}

fn app(settings: &[(String, String)]) -> Box<dyn App> {
    let map = &elk_map_app::TYPES[0];
    (map.build)(&map.check(settings, Path::new("")).unwrap()).unwrap()
}

impl Stage {
    /// An app that begins with a map, which is saved in `folder`; and whoever hears it hears the variables that match `keys`.
    pub fn new(folder: &Path, map: &OccupancyMap, settings: &[(&str, String)], keys: &str) -> Self {
        let file = folder.join("known.elkmap");
        std::fs::write(&file, Format::ElkMap.write(map)).unwrap();
        Self::of(&file, settings, keys)
    }

    /// The same of a file.
    pub fn of(file: &Path, settings: &[(&str, String)], keys: &str) -> Self {
        let broker = MemoryBroker::new(BrokerConfig::new(NAME), Clock::new(1.0));
        let (client, mut others) = (join(&broker, "Map"), join(&broker, "others"));
        others.comms.register(any(keys).lossless()).unwrap();
        others.comms.flush().unwrap();
        let from = ("From", file.display().to_string());
        let settings = std::iter::once(&from).chain(settings).map(|(name, text)| ((*name).to_owned(), text.clone()));
        let settings: Vec<(String, String)> = settings.collect();
        let mut stage = Self { broker, app: app(&settings), client, others, settings };
        stage.app.on_start_up(&mut stage.client.comms).unwrap();
        stage
    }

    /// Puts a successor in the map's place, which died or stopped without a word.
    pub fn exchange(&mut self) {
        // Its name is free when its client is gone.
        self.client = join(&self.broker, "nobody");
        self.app = app(&self.settings);
        self.client = join(&self.broker, "Map");
        self.app.on_start_up(&mut self.client.comms).unwrap();
    }

    /// Lets the map say its last.
    pub fn stop(&mut self) {
        self.app.on_stop(&mut self.client.comms).unwrap();
        self.client.comms.flush().unwrap();
    }

    /// Gives the map the mail that is there now; how many messages that were.
    pub fn give(&mut self) -> usize {
        self.try_give().unwrap()
    }

    /// The same, as far as it has no error.
    pub fn try_give(&mut self) -> Result<usize, AppError> {
        self.others.comms.flush().unwrap();
        let (app, Client { comms, inbox }) = (&mut self.app, &mut self.client);
        let given =
            inbox.receive(comms, Duration::ZERO, |comms: &mut Comms, mail: &Mail<'_>| app.on_new_mail(comms, mail));
        self.client.comms.flush().unwrap();
        given
    }

    /// Says a scan of a point so far ahead (m).
    pub fn scan(&mut self, id: u64, ahead_m: f32) {
        let pose = Pose::looking(Point3::new(0.05, 0.05, 0.05), Vector3::y());
        let scan = Scan::new(id, id, pose, [Point3::new(0.0, 0.0, ahead_m)].into_iter().collect());
        self.others.comms.publish(&SCAN, &scan).unwrap();
    }
}
