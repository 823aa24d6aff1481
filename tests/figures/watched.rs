//! What it costs a mission to be watched, and how soon a page shows what a scan saw: the figures of `docs/figures.md`.
//!
//! ```text
//! cargo bench --bench watched -- [pages 9] [bytes 1] [rate 30] [visible 1]
//! ```
//!
//! `pages` takes so many turns of a mission that nobody watches, one page, and ten; `bytes` says what a page is sent, by kind;
//! `rate` paces a mission to so many scans a second under one page; `visible` has a page in Chromium (and Node) say when it had
//! drawn what.

#[path = "../common/browser.rs"]
#[allow(dead_code, reason = "this program uses its part of it")]
mod browser;

use std::collections::BTreeMap;
use std::net::{SocketAddr, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::JoinHandle;
use std::time::Duration;

use browser::Browser;
use elk_bus::{ValueRef, codec};
use elk_log::LogReader;
use elk_spatial::Scan;
use elk_spatial::keys::{MAP_KNOWN, MAP_UPDATE, SCAN};
use elk_spatial::map::MapUpdate;
use elk_spatial::messages::MapStatus;
use serde_json::{Value, json};
use tungstenite::Message;
use tungstenite::client::IntoClientRequest;

const ELK: &str = env!("CARGO_BIN_EXE_elk");
const MISSION: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/mission-files/apartment.xml");
/// The pace at which it is measured how long a robot is on its way between two scans.
const MEASURED_PACE: f64 = 12.0;
/// Pages are no part of what is measured, as if they were on other machines: what they do waits for all else.
const NICENESS_OF_PAGES: i32 = 19;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let number = |case: &str, default: usize| match arguments.iter().position(|a| a == case) {
        Some(at) => Some(arguments.get(at + 1).and_then(|n| n.parse().ok()).unwrap_or(default)),
        None => arguments.is_empty().then_some(default),
    };
    if let Some(turns) = number("pages", 9) {
        pages(turns);
    }
    if number("bytes", 1).is_some() {
        bytes();
    }
    if let Some(rate) = number("rate", 30) {
        paced(rate);
    }
    if number("visible", 1).is_some() {
        visible();
    }
}

/// A mission that is under way, and perhaps a view of it.
struct Mission {
    folder: tempfile::TempDir,
    launcher: Child,
    view: Option<Child>,
    /// CPU time of the view, and of children that have ended, before the mission began (s).
    cpu_before: [f64; 2],
}

/// What was measured of it.
struct Measured {
    summary: Value,
    /// CPU time of the launcher, the broker and all apps (s).
    mission_cpu_secs: f64,
    /// CPU time of the view (s), since before the mission began.
    cpu_secs: f64,
    log: PathBuf,
    /// Keeps the log.
    _folder: tempfile::TempDir,
}

impl Mission {
    fn start(is_watched: bool, more: &[&str]) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let community = format!("watched-{}", std::process::id());
        let start = |arguments: &[&str], said: &str| {
            let said = std::fs::File::create(folder.path().join(said)).expect("a file");
            let mut command = Command::new(ELK);
            command.args(arguments).args(["--community", &community]).current_dir(&folder).stdin(Stdio::null());
            command.stdout(said).stderr(Stdio::null()).spawn().expect("elk starts")
        };
        // The view is there before the mission is, and waits for it.
        let view = is_watched.then(|| start(&["view"], "view.txt"));
        if is_watched {
            while address_in(folder.path()).is_none() {
                std::thread::sleep(Duration::from_millis(5));
            }
        }
        let cpu_before = [view.as_ref().map_or(0.0, |view| cpu_of(view.id())[0]), cpu_of(std::process::id())[1]];
        let launcher = start(&[&["launch", MISSION, "--headless"], more].concat(), "launch.txt");
        Self { folder, launcher, view, cpu_before }
    }

    fn address(&self) -> SocketAddr {
        address_in(self.folder.path()).expect("an address")
    }

    /// Waits for the mission's end, and ends the view, once what is to be done before that is done.
    fn end(mut self, before: impl FnOnce()) -> Measured {
        assert!(self.launcher.wait().expect("a launcher").success(), "the mission is not complete");
        let [view_before, children_before] = self.cpu_before;
        let mission_cpu_secs = cpu_of(std::process::id())[1] - children_before;
        before();
        let cpu_secs = self.view.as_mut().map_or(0.0, |view| {
            let cpu_secs = cpu_of(view.id())[0] - view_before;
            view.kill().expect("a view");
            view.wait().expect("a view");
            cpu_secs
        });
        let runs = std::fs::read_dir(self.folder.path().join("logs")).expect("logs");
        let run = runs.map(|run| run.expect("a run").path()).next().expect("a run");
        let summary = std::fs::read_to_string(run.join("summary.json")).expect("a summary");
        Measured {
            summary: serde_json::from_str(&summary).expect("a summary"),
            mission_cpu_secs,
            cpu_secs,
            log: run.join("log.mcap"),
            _folder: self.folder,
        }
    }
}

fn address_in(folder: &Path) -> Option<SocketAddr> {
    let said = std::fs::read_to_string(folder.join("view.txt")).unwrap_or_default();
    let word = said.split_whitespace().find_map(|word| word.strip_prefix("http://"))?;
    word.trim_end_matches('/').parse().ok()
}

/// CPU time of a process, and of those of its children, and theirs, that were waited for (s).
fn cpu_of(process: u32) -> [f64; 2] {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).expect("a process");
    let behind_name = stat.rsplit(')').next().unwrap_or_default();
    let ticks: Vec<f64> =
        behind_name.split_whitespace().skip(11).take(4).filter_map(|ticks| ticks.parse().ok()).collect();
    [ticks[0] + ticks[1], ticks[2] + ticks[3]].map(|ticks| ticks / 100.0)
}

/// Messages and bytes, by kind.
type Kinds = BTreeMap<String, [usize; 2]>;

/// A page that takes what comes and draws nothing; it shows these layers, or what a page shows that says nothing.
fn page(address: SocketAddr, layers: Option<&'static [&'static str]>) -> JoinHandle<Kinds> {
    let (ready, is_ready) = std::sync::mpsc::channel();
    let page = std::thread::spawn(move || {
        // A thread's own, as Linux has it.
        let _ = rustix::process::nice(NICENESS_OF_PAGES);
        let stream = TcpStream::connect(address).expect("a view");
        let request = format!("ws://{address}/ws").into_client_request().expect("a request");
        let (mut socket, _) = tungstenite::client(request, stream).expect("a page");
        let say = |words: Value, socket: &mut tungstenite::WebSocket<TcpStream>| {
            // Of a view that has ended all is heard that it had said.
            let _ = socket.send(Message::text(words.to_string()));
        };
        if let Some(layers) = layers {
            say(json!({"type": "show", "layers": layers}), &mut socket);
        }
        ready.send(()).expect("a bench");
        let mut kinds = Kinds::new();
        while let Ok(message) = socket.read() {
            let kind = match &message {
                Message::Binary(frame) => binary(frame),
                Message::Text(text) => {
                    let said: Value = serde_json::from_str(text).expect("JSON");
                    if said["type"] == "frame" {
                        say(json!({"type": "ack", "number": said["number"]}), &mut socket);
                    }
                    said["type"].as_str().expect("a type").to_owned()
                }
                _ => continue,
            };
            let [count, bytes] = kinds.entry(kind).or_default();
            (*count, *bytes) = (*count + 1, *bytes + message.len());
        }
        kinds
    });
    is_ready.recv().expect("a page");
    page
}

/// What a binary message is.
fn binary(frame: &[u8]) -> String {
    match frame.first() {
        Some(1) => "bricks".to_owned(),
        Some(2) => "scan".to_owned(),
        Some(3) => {
            let length = u32::from_le_bytes(frame[4..8].try_into().expect("four bytes")) as usize;
            let said: Value = serde_json::from_slice(&frame[8..8 + length]).expect("a drawing");
            format!("drawing {}/{}", said["app"].as_str().expect("an app"), said["name"].as_str().expect("a name"))
        }
        _ => "other".to_owned(),
    }
}

/// Bytes of all kinds whose names begin so; "": of all.
fn sum(kinds: &Kinds, beginning: &str) -> usize {
    kinds.iter().filter(|(kind, _)| kind.starts_with(beginning)).map(|(_, [_, bytes])| bytes).sum()
}

fn median(mut all: Vec<f64>) -> f64 {
    all.sort_by(f64::total_cmp);
    all[all.len() / 2]
}

/// Each turn has one mission of each kind, in an order that is turned over from turn to turn, and is compared with itself.
fn pages(turns: usize) {
    const PAGES: [usize; 3] = [0, 1, 10];
    const FIGURES: [&str; 4] = ["mission", "step", "p99 of steps", "its CPU"];
    let mut found: [Vec<[f64; 4]>; 3] = Default::default();
    let mut view_cpu: [Vec<f64>; 3] = Default::default();
    for turn in 0..turns {
        let order = if turn % 2 == 0 { [0, 1, 2] } else { [2, 1, 0] };
        for which in order {
            let mission = Mission::start(PAGES[which] > 0, &[]);
            let pages: Vec<_> = (0..PAGES[which]).map(|_| page(mission.address(), None)).collect();
            let measured = mission.end(|| ());
            pages.into_iter().for_each(|page| drop(page.join().expect("a page")));
            let of = |place: &str| measured.summary.pointer(place).and_then(Value::as_f64).expect("a figure");
            let cpu = measured.mission_cpu_secs;
            found[which].push([of("/seconds"), of("/step/median_ms") / 1e3, of("/step/p99_ms") / 1e3, cpu]);
            view_cpu[which].push(measured.cpu_secs);
        }
    }
    for (which, count) in PAGES.iter().enumerate() {
        let figures: Vec<String> = FIGURES
            .iter()
            .enumerate()
            .map(|(figure, name)| {
                let ratios = found[which].iter().zip(&found[0]).map(|(it, unwatched)| it[figure] / unwatched[figure]);
                let secs = median(found[which].iter().map(|run| run[figure]).collect());
                format!("{name} {secs:.4} s ({:.2} ×)", median(ratios.collect()))
            })
            .collect();
        let view_cpu = median(view_cpu[which].clone());
        println!("{count} pages: {}; the view's CPU {view_cpu:.2} s; medians of {turns} turns", figures.join(", "));
    }
}

/// What pages are sent of a mission: one that shows the map alone, and one that shows scans and drawings as well.
fn bytes() {
    let mission = Mission::start(true, &[]);
    let pages = [Some(&[][..]), None].map(|layers| page(mission.address(), layers));
    let measured = mission.end(|| ());
    let [map, all] = pages.map(|page| page.join().expect("a page"));
    let updates = update_bytes(&measured.log);
    println!("the log's map updates: {updates} bytes");
    for (name, kinds) in [("the map alone", &map), ("scans and drawings as well", &all)] {
        let (sent, asked_for) = (sum(kinds, ""), sum(kinds, "scan") + sum(kinds, "drawing "));
        println!(
            "a page that shows {name}: {sent} bytes, of which {asked_for} are what it asked for besides; the rest is {:.2} × the \
             updates",
            (sent - asked_for) as f64 / updates as f64
        );
    }
    let mut kinds: Vec<_> = all.iter().collect();
    kinds.sort_by_key(|(_, [_, bytes])| std::cmp::Reverse(*bytes));
    kinds.iter().for_each(|(kind, [count, bytes])| println!("    {kind}: {bytes} bytes in {count} messages"));
}

/// Bytes of the map's updates in a log, as they crossed the bus.
fn update_bytes(log: &Path) -> usize {
    let mut bytes_of_all = 0;
    each(log, MAP_UPDATE.name(), |_, bytes| bytes_of_all += bytes.len());
    bytes_of_all
}

/// Calls `f` with the time and the bytes of each message of a variable.
fn each(log: &Path, key: &str, mut f: impl FnMut(f64, &[u8])) {
    let mut reader = LogReader::open(log).expect("a log");
    while let Some(record) = reader.next_ref() {
        let record = record.expect("a record");
        match record.value {
            ValueRef::Binary { bytes, .. } if record.key == key => f(record.time, bytes),
            _ => {}
        }
    }
}

/// A mission at so many scans a second. How long a step takes at a pace p is a + b/p: what the machine needs, and the robot's way.
fn paced(rate: usize) {
    let secs_per_scan = |pace: Option<f64>| {
        let pace = pace.map(|pace| format!("{pace:.2}"));
        let more = pace.as_ref().map_or(vec![], |pace| vec!["--pace", pace]);
        let summary = Mission::start(false, &more).end(|| ()).summary;
        summary["seconds"].as_f64().expect("seconds") / summary["scans"].as_f64().expect("scans")
    };
    let machine = secs_per_scan(None);
    let way = MEASURED_PACE * (secs_per_scan(Some(MEASURED_PACE)) - machine);
    let left = 1.0 / rate as f64 - machine;
    if left <= 0.0 {
        return println!("the machine does {:.1} scans a second at once: {rate} are out of reach", 1.0 / machine);
    }
    let pace = format!("{:.2}", way / left);
    let mission = Mission::start(true, &["--pace", &pace]);
    let page = page(mission.address(), None);
    let measured = mission.end(|| ());
    page.join().expect("a page");
    let [scans, secs] = ["scans", "seconds"].map(|figure| measured.summary[figure].as_f64().expect("a figure"));
    println!(
        "pace {pace}: {scans} scans in {secs:.1} s ({:.1} a second); the view took {:.1} % of a core",
        scans / secs,
        100.0 * measured.cpu_secs / secs
    );
}

/// From a scan's time to the moment at which a page had drawn what the map made of it.
fn visible() {
    // After a frame was drawn, and the page could take part in something else again, what is known is on the screen.
    const WATCH: &str = "elk.link !== undefined && (window.drawn = [[Date.now() / 1000, elk.known]], (function note() {
        requestAnimationFrame(() => setTimeout(() => {
            if (elk.known !== window.drawn.at(-1)[1]) window.drawn.push([Date.now() / 1000, elk.known]);
            note();
        }));
    })(), true)";
    let Ok(mut browser) = Browser::start() else { return println!("no browser: node or chromium is missing") };
    // As fast as a camera that scans some 4 times a second.
    let mission = Mission::start(true, &["--pace", "4"]);
    browser.open(&format!("http://{}/", mission.address()));
    browser.until(WATCH);
    let mut drawn: Vec<(f64, u64)> = Vec::new();
    let measured = mission.end(|| {
        std::thread::sleep(Duration::from_secs(1));
        drawn = serde_json::from_value(browser.until("window.drawn")).expect("what was drawn");
    });
    let waits = waits(&measured.log, &drawn);
    let at = |share: f64| waits[((waits.len() as f64 * share) as usize).min(waits.len() - 1)];
    println!(
        "scan → what it changed is drawn: p50 {:.0} ms, p99 {:.0} ms, the longest {:.0} ms of {} scans",
        at(0.5),
        at(0.99),
        at(1.0),
        waits.len()
    );
}

/// How long it took of each scan that was taken since the page looked, and from which something became known (ms), ascending.
fn waits(log: &Path, drawn: &[(f64, u64)]) -> Vec<f64> {
    let (mut scans, mut scan_of, mut waits) = (BTreeMap::new(), BTreeMap::new(), Vec::new());
    each(log, SCAN.name(), |time, bytes| {
        scans.insert(codec::decode::<Scan<'_>>(bytes).expect("a scan").id, time);
    });
    each(log, MAP_UPDATE.name(), |_, bytes| {
        let update = codec::decode::<MapUpdate>(bytes).expect("an update");
        scan_of.insert(update.revision, update.scan);
    });
    let (began, mut known) = (drawn[0].0, drawn[0].1);
    each(log, MAP_KNOWN.name(), |_, bytes| {
        let status = codec::decode::<MapStatus>(bytes).expect("a status");
        let now = (status.free + status.occupied) as u64;
        let scanned =
            scan_of.get(&status.revision).and_then(|scan| scans.get(scan)).filter(|scanned| **scanned > began);
        let shown = drawn.iter().find(|(_, shown)| *shown >= now);
        let before = known;
        known = known.max(now);
        if now > before
            && let (Some(scanned), Some((at, _))) = (scanned, shown)
        {
            waits.push(1000.0 * (at - scanned));
        }
    });
    waits.sort_by(f64::total_cmp);
    waits
}
