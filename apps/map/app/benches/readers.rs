//! What readers that ask for the whole map cost the map: the CPU time of each scan, with all that the map does between it and the
//! one before.
//!
//! `cargo bench -p elk-map-app --bench readers -- [VOXELS…]`. The map knows rooms in a row of so many voxels (0.05 m) and is
//! given scans of 10,000 points in rooms behind them. Readers keep copies; all of them lose an update every 25 scans, and ask. Beside
//! it, in the same run, what it was before: each who asks is given the whole map in one message.

use std::path::Path;
use std::time::Duration;

use elk_bus::clock::thread_cpu_secs;
use elk_bus::memory::MemoryBroker;
use elk_bus::{App, AppError, BrokerConfig, Client, Clock, Comms, Community, Mail};
use elk_geometry::Pose;
use elk_map::{Format, MapConfig, OccupancyMap};
use elk_spatial::checks::MAX_BRICKS;
use elk_spatial::keys::{MAP, MAP_PART, MAP_REQUEST, MAP_UPDATE, SCAN};
use elk_spatial::map::MapUpdate;
use elk_spatial::scan::Points;
use elk_spatial::{Replica, Scan};
use nalgebra::{Point3, Vector3};

#[path = "../../tests/scans/mod.rs"]
mod scans;

const RESOLUTION: f64 = 0.05;
const SCANS: usize = 200;
/// Scans after which all readers lose an update.
const LOSS_EVERY: usize = 25;
/// Scans of a room: each has one point of so many.
const SCANS_A_ROOM: usize = 16;

/// The map of so many rooms that so many voxels are known, and how many rooms that are.
fn known(voxels: usize) -> (OccupancyMap, usize) {
    let config = MapConfig { resolution: RESOLUTION, max_bricks: MAX_BRICKS, ..MapConfig::default() };
    let mut map = OccupancyMap::new(config).expect("the settings make sense");
    for (rooms, scan) in scans::building().enumerate() {
        if map.grid().free() + map.grid().occupied() >= voxels {
            return (map, rooms);
        }
        let changed = map.insert(scan.origin(), scan.points()).changed;
        map.advance(&changed);
    }
    unreachable!("there are rooms without end")
}

/// Scans in the rooms behind those.
fn scans_behind(rooms: usize) -> impl Iterator<Item = Scan<'static>> {
    let parts = scans::building().skip(rooms).flat_map(|scan| {
        let origin = scan.origin();
        let part = move |nth: usize| {
            let own = scan.points.iter().skip(nth).step_by(SCANS_A_ROOM);
            let points: Points<'static> =
                own.map(|p| Point3::from(*p) - origin.coords.cast::<f32>()).map(turned).collect();
            (origin, points)
        };
        (0..SCANS_A_ROOM).map(part).collect::<Vec<_>>()
    });
    parts.zip(1..).map(|((origin, points), id)| {
        let pose = Pose::looking(origin, Vector3::x());
        Scan::new(id, id, pose, points)
    })
}

/// A point beside a camera that looks along x (m, world's axes) as that camera has it: x to the right, y down, z ahead.
fn turned(p: Point3<f32>) -> Point3<f32> {
    Point3::new(-p.y, -p.z, p.x)
}

struct Bench {
    app: Box<dyn App>,
    map: Client,
    readers: Vec<(Client, Replica)>,
    others: Client,
}

fn join(broker: &MemoryBroker, name: &str) -> Client {
    let community = Community::new("readers").expect("it is a name");
    Client::over(broker.connect(name).expect("there is room"), name, &community)
}

impl Bench {
    fn new(file: &Path, readers: usize) -> Self {
        let broker = MemoryBroker::new(BrokerConfig::new("readers"), Clock::new(1.0));
        let type_ = &elk_map_app::TYPES[0];
        let settings = [
            ("From", file.display().to_string()),
            ("Res", RESOLUTION.to_string()),
            ("MaxBricks", MAX_BRICKS.to_string()),
        ];
        let settings = settings.map(|(name, value)| (name.to_owned(), value));
        let params = type_.check(&settings, Path::new("")).expect("they are its parameters");
        let (app, map) = ((type_.build)(&params).expect("the file is there"), join(&broker, "Map"));
        let reader = |n: usize| {
            let mut client = join(&broker, &format!("reader{n}"));
            client.comms.register(&MAP_UPDATE).expect("the broker is there");
            client.comms.register(&MAP_PART).expect("the broker is there");
            client.comms.flush().expect("the broker is there");
            (client, Replica::new(Some(RESOLUTION), MAX_BRICKS))
        };
        let readers = (0..readers).map(reader).collect();
        let mut bench = Self { app, map, readers, others: join(&broker, "others") };
        bench.app.on_start_up(&mut bench.map.comms).expect("the broker is there");
        for _ in 0..4 {
            bench.turn();
        }
        bench.read(false);
        bench
    }

    /// Lets the map do what there is to do; its CPU time (s).
    fn turn(&mut self) -> f64 {
        let start = thread_cpu_secs();
        let (app, Client { comms, inbox }) = (&mut self.app, &mut self.map);
        let give = |comms: &mut Comms, mail: &Mail<'_>| app.on_new_mail(comms, mail);
        inbox.receive(comms, Duration::ZERO, give).expect("the broker is there");
        comms.flush().expect("the broker is there");
        thread_cpu_secs() - start
    }

    /// Lets the readers hear what was said, without the updates if they are to lose them, and ask.
    fn read(&mut self, lose: bool) {
        for (Client { comms, inbox }, replica) in &mut self.readers {
            let take = |_: &mut Comms, mail: &Mail<'_>| -> Result<(), AppError> {
                match mail.is(&MAP_PART) {
                    true => drop(replica.take_part(&mail.decode(&MAP_PART)?)),
                    false if lose => {}
                    false => drop(replica.take(&mail.decode(&MAP_UPDATE)?)),
                }
                Ok(())
            };
            inbox.receive(comms, Duration::ZERO, take).expect("the broker is there");
            if replica.take_question() {
                comms.notify(MAP_REQUEST, 1.0).expect("the broker is there");
            }
            comms.flush().expect("the broker is there");
        }
    }

    /// What it takes to give each of so many the whole map of this copy in one message (s).
    fn answer_whole(&mut self, readers: usize) -> f64 {
        let Some((_, replica)) = self.readers.first() else { return 0.0 };
        let start = thread_cpu_secs();
        for _ in 0..readers {
            self.others.comms.publish(&MAP, &MapUpdate::new(replica.grid().whole(), 1)).expect("the broker is there");
        }
        self.others.comms.flush().expect("the broker is there");
        thread_cpu_secs() - start
    }
}

/// How readers that miss something are given the map.
#[derive(Clone, Copy, PartialEq)]
enum Answer {
    /// In parts, as it is.
    Parts,
    /// Each who asks in one message, as it was; that is said by somebody else, and its time added to the map's.
    Messages,
}

/// Of each scan what the map did since the one before (s of CPU); and after how many a reader had not the map of that scan.
fn run(file: &Path, rooms: usize, readers: usize, answer: Answer) -> (Vec<f64>, usize) {
    let mut bench = Bench::new(file, readers);
    let begun = bench.readers.first().map_or(0, |(_, replica)| replica.grid().revision());
    let mut behind = 0;
    let step = |(n, scan): (usize, Scan<'_>)| {
        bench.others.comms.publish(&SCAN, &scan).expect("the broker is there");
        bench.others.comms.flush().expect("the broker is there");
        let secs = bench.turn();
        let lose = n % LOSS_EVERY == LOSS_EVERY - 1;
        bench.read(lose && answer == Answer::Parts);
        let has_it = |(_, replica): &(Client, Replica)| replica.grid().revision() == begun + n as u64 + 1;
        behind += usize::from(!bench.readers.iter().all(has_it));
        secs + if lose && answer == Answer::Messages { bench.answer_whole(readers) } else { 0.0 }
    };
    let secs = scans_behind(rooms).take(SCANS).enumerate().map(step).collect();
    (secs, behind)
}

fn main() {
    let wanted: Vec<usize> = std::env::args().filter_map(|word| word.parse().ok()).collect();
    let folder = tempfile::tempdir().expect("there is room on the disk");
    for voxels in if wanted.is_empty() { vec![1_000_000, 10_000_000] } else { wanted } {
        let (map, rooms) = known(voxels);
        let file = folder.path().join("known.elkmap");
        std::fs::write(&file, Format::ElkMap.write(&map)).expect("there is room on the disk");
        let known = map.grid().free() + map.grid().occupied();
        println!("\n{known} voxels, {} bricks; ms of CPU a scan, of {SCANS}\n", map.grid().bricks().len());
        println!("| readers | the map is said | p50 | p99 | largest | scans after which a reader lacked it |");
        println!("|---|---|---|---|---|---|");
        for readers in [0, 1, 8] {
            for (answer, how) in [(Answer::Messages, "to each in one message"), (Answer::Parts, "in parts")] {
                let (mut secs, behind) = run(&file, rooms, readers, answer);
                secs.sort_unstable_by(f64::total_cmp);
                let at = |share: f64| 1e3 * secs[((secs.len() - 1) as f64 * share).round() as usize];
                println!("| {readers} | {how} | {:.2} | {:.2} | {:.2} | {behind} |", at(0.5), at(0.99), at(1.0));
            }
        }
    }
}
