//! The map as a process that begins with a saved one: what it says of it, and that what a predecessor left goes before it.

use std::path::Path;
use std::time::Duration;

use elk_bus::memory::MemoryBroker;
use elk_bus::{App, BrokerConfig, Client, Clock, Comms, Community, Mail, any};
use elk_geometry::Pose;
use elk_map::{Format, MapConfig, OccupancyMap, Saved};
use elk_spatial::keys::{MAP_UPDATE, SCAN};
use elk_spatial::map::MapUpdate;
use elk_spatial::scan::Points;
use elk_spatial::{CameraInfo, Scan};
use nalgebra::{Point3, Vector3};

struct Bench {
    broker: MemoryBroker,
    app: Box<dyn App>,
    client: Client,
    others: Client,
    settings: Vec<(String, String)>,
}

fn join(broker: &MemoryBroker, name: &str) -> Client {
    Client::over(broker.connect(name).unwrap(), name, &Community::new("map-test").unwrap())
}

fn app(settings: &[(String, String)]) -> Box<dyn App> {
    let map = &elk_map_app::TYPES[0];
    (map.build)(&map.check(settings, Path::new("")).unwrap()).unwrap()
}

/// A map that knows three voxels.
fn known() -> OccupancyMap {
    let mut map = OccupancyMap::new(MapConfig::default()).unwrap();
    map.insert(Point3::new(0.05, 0.05, 0.05), [Point3::new(0.25, 0.05, 0.05)]);
    map
}

impl Bench {
    /// A map whose file is in `folder`.
    fn new(folder: &Path) -> Self {
        let file = folder.join("known.elkmap");
        std::fs::write(&file, Format::ElkMap.write(&known())).unwrap();
        let broker = MemoryBroker::new(BrokerConfig::new("map-test"), Clock::new(1.0));
        let (client, mut others) = (join(&broker, "Map"), join(&broker, "others"));
        others.comms.register(any("MAP_*").lossless()).unwrap();
        others.comms.flush().unwrap();
        let settings = vec![("From".to_owned(), file.display().to_string())];
        let mut bench = Self { broker, app: app(&settings), client, others, settings };
        bench.app.on_start_up(&mut bench.client.comms).unwrap();
        bench
    }

    /// Puts a successor in the map's place, which died or stopped.
    fn exchange(&mut self) {
        // Its name is free when its client is gone.
        self.client = join(&self.broker, "nobody");
        self.app = app(&self.settings);
        self.client = join(&self.broker, "Map");
        self.app.on_start_up(&mut self.client.comms).unwrap();
    }

    /// Lets the map do what it can; the updates that it says.
    fn updates(&mut self) -> Vec<MapUpdate> {
        self.others.comms.flush().unwrap();
        let (app, Client { comms, inbox }) = (&mut self.app, &mut self.client);
        let mut give = |comms: &mut Comms, mail: &Mail<'_>| app.on_new_mail(comms, mail);
        while inbox.receive(comms, Duration::ZERO, &mut give).unwrap() > 0 {}
        self.client.comms.flush().unwrap();
        let mut heard = Vec::new();
        let note = |mail: &Mail<'_>| heard.extend(mail.is(&MAP_UPDATE).then(|| mail.decode(&MAP_UPDATE).unwrap()));
        self.others.receive(Duration::ZERO, note).unwrap();
        heard
    }

    fn scan(&mut self, id: u64) {
        let pose = Pose::looking(Point3::new(0.05, 0.05, 0.05), Vector3::y());
        let (camera, no_return) = (CameraInfo::default(), Points::default());
        let points = [Point3::new(0.0, 0.0, 0.3)].into_iter().collect();
        let scan = Scan { id, command: id, pose, camera, measured: 1, no_return, points };
        self.others.comms.publish(&SCAN, &scan).unwrap();
    }
}

#[test]
fn a_saved_map_is_said_whole_before_the_first_scan_which_then_continues_it() {
    let folder = tempfile::tempdir().unwrap();
    let mut bench = Bench::new(folder.path());
    let said = bench.updates();
    let right = MapUpdate::new(OccupancyMap::from_saved(MapConfig::default(), &saved()).unwrap().grid().whole(), 0);
    assert_eq!(said, [right]);
    assert_eq!((said[0].revision, said[0].since), (1, 0));
    bench.scan(1);
    let said = bench.updates();
    assert_eq!(said.iter().map(|update| (update.revision, update.since, update.scan)).collect::<Vec<_>>(), [(2, 1, 1)]);
}

/// One that is killed has said the saved map; its successor has it from the file, and need not ask.
#[test]
fn a_successor_of_a_map_that_saw_nothing_goes_on_from_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let mut bench = Bench::new(folder.path());
    assert_eq!(bench.updates().len(), 1);
    bench.exchange();
    bench.scan(1);
    let said = bench.updates();
    assert_eq!(said.iter().map(|update| (update.revision, update.since)).collect::<Vec<_>>(), [(2, 1)]);
}

#[test]
fn what_a_predecessor_left_goes_before_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let mut bench = Bench::new(folder.path());
    bench.scan(1);
    assert_eq!(bench.updates().len(), 2);
    bench.app.on_stop(&mut bench.client.comms).unwrap();
    bench.client.comms.flush().unwrap();
    bench.exchange();
    assert_eq!(bench.updates(), [], "nothing is new");
    bench.scan(2);
    let said = bench.updates();
    assert_eq!(said.iter().map(|update| (update.revision, update.since, update.scan)).collect::<Vec<_>>(), [(3, 2, 2)]);
}

fn saved() -> Saved {
    Saved::read(&Format::ElkMap.write(&known())).unwrap()
}
