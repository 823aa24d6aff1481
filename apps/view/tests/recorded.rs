//! Pages of a recorded run.

mod common;

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;

use elk_bus::drawing::{Drawing, variables};
use elk_bus::{Payload, TypeRef, Value as BusValue, codec};
use elk_geometry::{OccupancyGrid, Pose};
use elk_log::{LogWriter, Metadata, Record};
use elk_spatial::keys::{MAP_UPDATE, camera_pose};
use elk_spatial::messages::CameraPose;
use elk_view::{Options, Source, ViewError, serve};
use nalgebra::{Point3, Vector3};
use serde_json::json;

use common::{Page, wall};

/// Scans of the run, one a second, from second 1000 on; each adds 40 occupied voxels.
const SCANS: i32 = 3_000;

fn typed<T: Payload>(value: &T::View<'_>) -> BusValue {
    let mut bytes = Vec::new();
    codec::encode_onto(value, &mut bytes).unwrap();
    BusValue::Binary { type_: TypeRef::of::<T>().to_type(), bytes }
}

fn record(log: &mut LogWriter, order: u64, key: &str, time: f64, value: BusValue) {
    let [source, source_aux, community] = ["Map", "", "lab"].map(str::to_owned);
    let (sequence, received) = (order, time);
    let record =
        Record { key: key.into(), source, source_aux, community, time, sequence, received, order, epoch: 1, value };
    log.append(&record.as_ref()).unwrap();
}

fn recorded(path: &Path) {
    let mut log = LogWriter::create(path, &Metadata::default()).unwrap();
    let mut map = OccupancyGrid::new(0.1);
    for scan in 1..=SCANS {
        let (time, order) = (1000.0 + f64::from(scan), 3 * scan as u64);
        record(&mut log, order, MAP_UPDATE.name(), time, typed::<elk_spatial::map::MapUpdate>(&wall(&mut map, scan)));
        let pose = Pose::looking(Point3::new(f64::from(scan), 0.0, 1.0), Vector3::x());
        let said = CameraPose { command: scan as u64, pose };
        record(&mut log, order + 1, camera_pose("NAV").name(), time, typed::<CameraPose>(&said));
        let line = |name: &str| Drawing::new(name).line_strip([[0.0; 3], [1.0; 3]], [255; 4]);
        let drawn = match scan {
            1_000 => line("brief").lasting(500.0),
            1_500 => line("long"),
            2_500 => Drawing::new("long"),
            _ => continue,
        };
        let key = variables::drawing("Map", &drawn.name);
        record(&mut log, order + 2, key.name(), time, typed::<Drawing>(&drawn));
    }
    log.finish().unwrap();
}

/// The names of what is to be seen after a scan.
fn drawn_at(scan: i32) -> Option<&'static str> {
    match scan {
        1_000..1_500 => Some("brief"),
        1_500..2_500 => Some("long"),
        _ => None,
    }
}

/// A view of a log until this is dropped, and where.
struct View {
    address: std::net::SocketAddr,
    stop: Arc<AtomicBool>,
    thread: Option<std::thread::JoinHandle<Result<(), ViewError>>>,
}

impl View {
    fn of(log: &Path) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let (ready, address) = channel();
        let options = Options { address: "127.0.0.1:0".parse().unwrap(), any_port: false, read_only: false };
        let (stopped, source) = (stop.clone(), Source::Log(log.to_owned()));
        let ready = move |url: &str| ready.send(url.to_owned()).unwrap();
        let thread = std::thread::spawn(move || serve(source, &options, None, None, ready, &stopped));
        let url: String = address.recv().unwrap();
        let address = url.trim_start_matches("http://").trim_end_matches('/').parse().unwrap();
        Self { address, stop, thread: Some(thread) }
    }
}

impl Drop for View {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let ended = self.thread.take().map(std::thread::JoinHandle::join);
        assert!(std::thread::panicking() || matches!(ended, Some(Ok(Ok(())))));
    }
}

#[test]
fn the_state_at_any_time_is_whole_backwards_too() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log.mcap");
    recorded(&log);
    let view = View::of(&log);
    let mut page = Page::open(view.address, "");
    let hello = page.next("hello");
    assert_eq!(hello["recorded"], json!({"log": "log.mcap", "start": 1001.0, "end": 1000.0 + f64::from(SCANS)}));
    assert_eq!((&hello["live"], &hello["read_only"]), (&json!(null), &json!(true)));
    page.say(&json!({"type": "play", "playing": false, "rate": 1.0, "looping": false}));
    for scan in [2_000, 1_500, 2_999, 7, 1_100, 1_500, 3_000, 1_499, 1, 2_500, 600] {
        let time = 1000.5 + f64::from(scan);
        page.say(&json!({"type": "seek", "time": time}));
        // Of where it was before there may be frames on their way.
        while page.last("timeline")["at"] != json!(time.min(1000.0 + f64::from(SCANS)))
            || page.occupied() != 40 * scan as u32
            || page.last("robot")["position"][0] != json!(f64::from(scan))
            || page.drawings.keys().map(|(_, name)| name.as_str()).ne(drawn_at(scan))
        {
            page.next("frame");
        }
    }
    page.say(&json!({"type": "order", "id": 1, "order": {"command": "pause"}}));
    assert_eq!(page.next("answer")["ok"], json!(false), "what is over cannot be steered");
    // Played as fast as it goes, from its beginning, it ends where it ended.
    page.say(&json!({"type": "seek", "time": 0.0}));
    page.say(&json!({"type": "play", "playing": true, "rate": 1000.0, "looping": false}));
    while page.occupied() != 40 * SCANS as u32 || page.last("timeline")["playing"] != json!(false) {
        page.next("frame");
    }
}

#[test]
fn a_log_that_is_cut_in_the_middle_is_shown_as_far_as_it_goes_and_that_is_said_to_everybody() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log.mcap");
    recorded(&log);
    let whole = std::fs::read(&log).unwrap();
    std::fs::write(&log, &whole[..whole.len() / 2]).unwrap();
    let view = View::of(&log);
    let (mut page, end) =
        (Page::open(view.address, ""), |hello: &serde_json::Value| hello["recorded"]["end"].as_f64().unwrap());
    let hello = page.next("hello");
    let told = page.next("damage");
    let damage = told["text"].as_str().unwrap();
    assert!(damage.contains("is not whole") && damage.contains("log.mcap"), "{damage}");
    let last = end(&hello);
    assert!(last > 1100.0 && last < 900.0 + f64::from(SCANS), "{last}");
    for time in [last, 1050.5, last] {
        page.say(&json!({"type": "seek", "time": time}));
        while page.last("timeline")["at"] != json!(time) || page.occupied() != 40 * (time - 1000.0) as u32 {
            page.next("frame");
        }
    }
    // Who comes later is told as well.
    assert_eq!(Page::open(view.address, "").next("damage"), told);
}

#[test]
fn what_is_damaged_in_the_middle_is_said_once_it_is_read_and_to_who_comes_later() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log.mcap");
    recorded(&log);
    let mut bytes = std::fs::read(&log).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle..middle + 64].iter_mut().for_each(|byte| *byte ^= 0xff);
    std::fs::write(&log, &bytes).unwrap();
    assert!(elk_log::Index::read(&log, &mut |_, _| {}).unwrap().whole(), "its index says nothing of that");
    let view = View::of(&log);
    let mut page = Page::open(view.address, "");
    page.say(&json!({"type": "play", "playing": false, "rate": 1.0, "looping": false}));
    let end = 1000.0 + f64::from(SCANS);
    page.say(&json!({"type": "seek", "time": end}));
    let told = page.next("damage");
    assert!(told["text"].as_str().unwrap().contains("checksum"), "{told}");
    while page.last("timeline")["at"] != json!(end) {
        page.next("frame");
    }
    assert_eq!(Page::open(view.address, "").next("damage"), told, "the place is counted once");
}

#[test]
fn a_variable_that_is_watched_has_its_value_of_any_time() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log.mcap");
    recorded(&log);
    let view = View::of(&log);
    let mut page = Page::open(view.address, "");
    page.say(&json!({"type": "play", "playing": false, "rate": 1.0, "looping": false}));
    let seek = |page: &mut Page, scan: i32| {
        let time = 1000.5 + f64::from(scan);
        page.say(&json!({"type": "seek", "time": time}));
        while page.last("timeline")["at"] != json!(time) {
            page.next("frame");
        }
    };
    let shows = |page: &mut Page, x: f64| {
        while page.last("value")["value"]["pose"]["translation"][0] != json!(x) {
            page.next("value");
        }
    };
    seek(&mut page, 2_000);
    // Nothing is played, and nothing more is said.
    page.say(&json!({"type": "watch", "keys": ["NAV"]}));
    shows(&mut page, 2_000.0);
    for scan in [2_900, 700, 1_200] {
        seek(&mut page, scan);
        shows(&mut page, f64::from(scan));
    }
    // Said once, long before.
    page.say(&json!({"type": "watch", "keys": ["DRAWING/Map/brief"]}));
    while page.last("value")["key"] != "DRAWING/Map/brief" {
        page.next("value");
    }
    assert_eq!(page.last("value")["time"], json!(999.0));
    seek(&mut page, 2_900);
    assert_eq!(page.last("value")["time"], json!(999.0), "it is said anew behind a reset");
    seek(&mut page, 999);
    page.say(&json!({"type": "watch", "keys": ["NAV"]}));
    assert_eq!(page.next("value")["key"], "NAV", "it was not said yet");
}

#[test]
fn what_is_no_log_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("no.mcap");
    let options = Options { address: "127.0.0.1:0".parse().unwrap(), any_port: false, read_only: false };
    let stop = AtomicBool::new(false);
    let refused = serve(Source::Log(path.clone()), &options, None, None, |_| {}, &stop).unwrap_err();
    assert!(matches!(refused, ViewError::Log(_)) && refused.to_string().contains("no.mcap"), "{refused}");
    // A port that is taken is named, and what to do.
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let options = Options { address: taken.local_addr().unwrap(), ..options };
    let refused = serve(Source::Log(path), &options, None, None, |_| {}, &stop).unwrap_err();
    assert!(refused.to_string().contains("--port"), "{refused}");
}
