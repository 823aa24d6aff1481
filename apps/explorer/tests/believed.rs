//! What an explorer is told and does not believe: said to be wrong, and the next right word taken.

use std::path::Path;
use std::time::Duration;

use elk_bus::memory::MemoryBroker;
use elk_bus::{App, AppError, BrokerConfig, Client, Clock, Comms, Community, Mail, Rejection};
use elk_explorer::strategies::TYPES;
use elk_geometry::{OccupancyGrid, Pose, State, Voxel};
use elk_spatial::checks::MAX_REVISIONS_AHEAD;
use elk_spatial::keys::{MAP_UNSURE, MAP_UPDATE, PLAN, PLAN_REQUEST};
use elk_spatial::map::MapUpdate;
use elk_spatial::messages::{Outcome, PlanRequest};
use nalgebra::{Point3, Vector3};

/// The explorer, the map that it hears of, and who speaks to it.
struct Stage {
    app: Box<dyn App>,
    client: Client,
    others: Client,
    map: OccupancyGrid,
    _broker: MemoryBroker,
}

fn join(broker: &MemoryBroker, name: &str) -> Client {
    Client::over(broker.connect(name).unwrap(), name, &Community::new("explorer-test").unwrap())
}

impl Stage {
    /// One that goes to the closest frontier, in a map with a free room whose walls are not known.
    fn new() -> Self {
        let broker = MemoryBroker::new(BrokerConfig::new("explorer-test"), Clock::new(1.0));
        let (client, mut others) = (join(&broker, "Explorer"), join(&broker, "others"));
        let closest = TYPES.iter().find(|one| one.name == "ClosestFrontier").unwrap();
        let settings = [("Res", "0.1"), ("Confidence", "0.9")].map(|(name, text)| (name.to_owned(), text.to_owned()));
        let app = (closest.build)(&closest.check(&settings, Path::new("")).unwrap()).unwrap();
        others.comms.register(&PLAN).unwrap();
        let mut map = OccupancyGrid::new(0.1);
        let room = || (0..1000).map(|cell| Voxel::new(cell % 10, cell / 10 % 10, cell / 100));
        room().for_each(|voxel| assert!(map.set(voxel, State::Free)));
        let mut stage = Self { app, client, others, map, _broker: broker };
        stage.app.on_start_up(&mut stage.client.comms).unwrap();
        let update = MapUpdate::new(stage.map.advance(&room().collect::<Vec<_>>()), 1);
        stage.others.comms.publish(&MAP_UNSURE, &MapUpdate { bricks: Vec::new(), since: 0, ..update.clone() }).unwrap();
        stage.others.comms.publish(&MAP_UPDATE, &update).unwrap();
        assert_eq!(stage.rejections(), [""; 0]);
        stage
    }

    /// Gives the explorer what has come for it; what it says of what is of no use.
    fn rejections(&mut self) -> Vec<String> {
        self.others.comms.flush().unwrap();
        let (mut said, app) = (Vec::new(), &mut self.app);
        let mut give = |comms: &mut Comms, mail: &Mail<'_>| match app.on_new_mail(comms, mail) {
            Err(failure) if failure.is::<Rejection>() => {
                said.push(failure.to_string());
                Ok::<(), AppError>(())
            }
            done => done,
        };
        while self.client.inbox.receive(&mut self.client.comms, Duration::ZERO, &mut give).unwrap() > 0 {
            self.client.comms.flush().unwrap();
        }
        said
    }

    /// What it says to a request with this number, from this place, of this revision of the map.
    fn asked(&mut self, id: u64, place: Point3<f64>, revision: u64) -> Vec<String> {
        let request = PlanRequest { id, pose: Pose::looking(place, Vector3::x()), revision, outcome: Outcome::First };
        self.others.comms.publish(&PLAN_REQUEST, &request).unwrap();
        self.rejections()
    }

    /// The requests that it has answered since.
    fn answered(&mut self) -> Vec<u64> {
        let mut answered = Vec::new();
        self.others.receive(Duration::ZERO, |mail| answered.push(mail.decode(&PLAN).unwrap().request)).unwrap();
        answered
    }
}

#[test]
fn a_request_of_no_such_map_or_place_is_refused_and_the_right_one_answered() {
    let (mut stage, here) = (Stage::new(), Point3::new(0.45, 0.45, 0.45));
    let revision = stage.map.revision();
    let ahead = stage.asked(1, here, revision + MAX_REVISIONS_AHEAD + 1);
    assert!(ahead.len() == 1 && ahead[0].contains("is more than 1000 above 1: not believed"), "{ahead:?}");
    for (id, far) in [(2, Point3::new(100.0, 0.45, 0.45)), (3, Point3::new(-300_000.0, 0.0, 0.0))] {
        let refused = stage.asked(id, far, revision);
        assert!(refused.len() == 1 && refused[0].contains("it has to be near what the map knows"), "{refused:?}");
    }
    assert_eq!(stage.answered(), [0; 0]);
    assert_eq!(stage.asked(4, here, revision), [""; 0]);
    assert_eq!(stage.answered(), [4]);
}

#[test]
fn what_is_unsure_among_other_voxels_is_refused() {
    let mut stage = Stage::new();
    let unsure = MapUpdate { resolution: 0.2, revision: 9, ..MapUpdate::new(stage.map.whole(), 1) };
    stage.others.comms.publish(&MAP_UNSURE, &unsure).unwrap();
    let refused = stage.rejections();
    assert!(
        refused.len() == 1 && refused[0].contains("the map has voxels of 0.1 m, the update of 0.2 m"),
        "{refused:?}"
    );
}
