//! What it costs a mission to be watched, and how soon a page shows what a scan saw: the figures of `docs/figures.md`.
//!
//! ```text
//! cargo bench --bench watched -- [pages 5] [rate 30] [visible 1]
//! ```
//!
//! `pages` takes so many turns of a mission that nobody watches, one page, and ten; `rate` paces a mission to so many scans a
//! second under one page; `visible` has a page in Chromium (and Node) say when it had drawn what.

#[path = "../common/browser.rs"]
#[allow(dead_code, reason = "this program uses its part of it")]
mod browser;

use std::net::{SocketAddr, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::JoinHandle;
use std::time::Duration;

use browser::Browser;
use elk_bus::clock::Stopwatch;
use elk_bus::{ValueRef, codec};
use elk_log::LogReader;
use elk_spatial::keys::{MAP_KNOWN, MAP_UPDATE, SCAN};
use elk_spatial::messages::MapStatus;
use serde_json::{Value, json};
use tungstenite::Message;
use tungstenite::client::IntoClientRequest;

const ELK: &str = env!("CARGO_BIN_EXE_elk");
const MISSION: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/mission-files/apartment.xml");
/// Between two scans of the policy (m), and so fast is a robot at a pace of 1 (m/s), about: what a pace is reckoned from.
const SCAN_SPACING_M: f64 = 0.4;
const ROBOT_SPEED: f64 = 1.0;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let number = |case: &str, default: usize| match arguments.iter().position(|a| a == case) {
        Some(at) => Some(arguments.get(at + 1).and_then(|n| n.parse().ok()).unwrap_or(default)),
        None => arguments.is_empty().then_some(default),
    };
    if let Some(turns) = number("pages", 5) {
        pages(turns);
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
}

/// What was measured of it.
struct Measured {
    summary: Value,
    /// Of the view (s).
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
        let launcher = start(&[&["launch", MISSION, "--headless"], more].concat(), "launch.txt");
        Self { folder, launcher, view }
    }

    fn address(&self) -> SocketAddr {
        address_in(self.folder.path()).expect("an address")
    }

    /// Waits for the mission's end, and ends the view, once what is to be done before that is done.
    fn end(mut self, before: impl FnOnce()) -> Measured {
        assert!(self.launcher.wait().expect("a launcher").success(), "the mission is not complete");
        before();
        let cpu_secs = self.view.as_mut().map_or(0.0, |view| {
            let cpu_secs = cpu_of(view.id());
            view.kill().expect("a view");
            view.wait().expect("a view");
            cpu_secs
        });
        let runs = std::fs::read_dir(self.folder.path().join("logs")).expect("logs");
        let run = runs.map(|run| run.expect("a run").path()).next().expect("a run");
        let summary = std::fs::read_to_string(run.join("summary.json")).expect("a summary");
        Measured {
            summary: serde_json::from_str(&summary).expect("a summary"),
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

/// CPU time of a process, user's and kernel's (s).
fn cpu_of(process: u32) -> f64 {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).expect("a process");
    let behind_name = stat.rsplit(')').next().unwrap_or_default();
    let ticks = behind_name.split_whitespace().skip(11).take(2).filter_map(|ticks| ticks.parse::<f64>().ok());
    ticks.sum::<f64>() / 100.0
}

/// A page that takes what comes and draws nothing; the bytes of all, and of bricks.
fn page(address: SocketAddr) -> JoinHandle<(usize, usize)> {
    std::thread::spawn(move || {
        let stream = TcpStream::connect(address).expect("a view");
        let request = format!("ws://{address}/ws").into_client_request().expect("a request");
        let (mut socket, _) = tungstenite::client(request, stream).expect("a page");
        let (mut all, mut bricks) = (0, 0);
        while let Ok(message) = socket.read() {
            all += message.len();
            match message {
                Message::Binary(frame) if frame.first() == Some(&1) => bricks += frame.len(),
                Message::Text(text) => {
                    let said: Value = serde_json::from_str(&text).expect("JSON");
                    if said["type"] == "frame" {
                        let ack = json!({"type": "ack", "number": said["number"]});
                        let _ = socket.send(Message::text(ack.to_string()));
                    }
                }
                _ => {}
            }
        }
        (all, bricks)
    })
}

fn pages(turns: usize) {
    const PAGES: [usize; 3] = [0, 1, 10];
    let mut found: [Vec<[f64; 3]>; 3] = Default::default();
    let mut sizes = None;
    for _ in 0..turns {
        for (count, found) in PAGES.iter().zip(&mut found) {
            let mission = Mission::start(*count > 0, &[]);
            let pages: Vec<_> = (0..*count).map(|_| page(mission.address())).collect();
            let measured = mission.end(|| ());
            let heard: Vec<(usize, usize)> = pages.into_iter().map(|page| page.join().expect("a page")).collect();
            if *count == 1 {
                sizes = Some((heard[0], update_bytes(&measured.log)));
            }
            let of = |place: &str| measured.summary.pointer(place).and_then(Value::as_f64).expect("a figure");
            found.push([of("/seconds"), of("/step/median_ms"), of("/step/p99_ms")]);
        }
    }
    let median = |runs: &[[f64; 3]], which: usize| {
        let mut all: Vec<f64> = runs.iter().map(|run| run[which]).collect();
        all.sort_by(f64::total_cmp);
        all[all.len() / 2]
    };
    for (count, runs) in PAGES.iter().zip(&found) {
        let [secs, step, p99] = [0, 1, 2].map(|which| median(runs, which));
        let [by_secs, by_step, by_p99] = [0, 1, 2].map(|which| median(runs, which) / median(&found[0], which));
        println!(
            "{count} pages: mission {secs:.2} s ({by_secs:.2} × of unwatched), step {step:.1} ms ({by_step:.2}), p99 {p99:.1} ms \
             ({by_p99:.2}); medians of {turns}"
        );
    }
    if let Some(((all, bricks), updates)) = sizes {
        println!(
            "one page: {all} bytes, of which {bricks} are bricks; the log's map updates {updates} ({:.2} and {:.2} times)",
            all as f64 / updates as f64,
            bricks as f64 / updates as f64
        );
    }
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

fn paced(rate: usize) {
    let pace = format!("{:.1}", rate as f64 * SCAN_SPACING_M / ROBOT_SPEED);
    let mission = Mission::start(true, &["--pace", &pace]);
    let page = page(mission.address());
    let ran = Stopwatch::start();
    let measured = mission.end(|| ());
    let secs = ran.elapsed().as_secs_f64();
    page.join().expect("a page");
    let scans = measured.summary["scans"].as_f64().expect("scans");
    println!(
        "pace {pace}: {scans} scans in {secs:.1} s ({:.1} a second); the view took {:.1} % of a core",
        scans / secs,
        100.0 * measured.cpu_secs / secs
    );
}

/// From a scan's time to the moment at which a page had drawn what the map made of it.
fn visible() {
    // After a frame was drawn, and the page could take part in something else again, what is known is on the screen.
    const WATCH: &str = "elk.link !== undefined && (window.drawn = [], (function note() {
        requestAnimationFrame(() => setTimeout(() => {
            const last = window.drawn.at(-1);
            if (elk.known > (last ? last[1] : 0)) window.drawn.push([Date.now() / 1000, elk.known]);
            note();
        }));
    })(), true)";
    let Ok(mut browser) = Browser::start() else { return println!("no browser: node or chromium is missing") };
    // As fast as a camera that scans 10 times a second.
    let mission = Mission::start(true, &["--pace", "4"]);
    browser.open(&format!("http://{}/", mission.address()));
    browser.until(WATCH);
    let mut drawn: Vec<(f64, u64)> = Vec::new();
    let measured = mission.end(|| {
        std::thread::sleep(Duration::from_secs(1));
        drawn = serde_json::from_value(browser.until("window.drawn")).expect("what was drawn");
    });
    let mut scanned = Vec::new();
    each(&measured.log, SCAN.name(), |time, _| scanned.push(time));
    let mut scanned = scanned.into_iter();
    let mut waits: Vec<f64> = Vec::new();
    let mut known = 0;
    // The map says how much is known after each scan.
    each(&measured.log, MAP_KNOWN.name(), |_, bytes| {
        let status = codec::decode::<MapStatus>(bytes).expect("a status");
        let (now, scan) = ((status.free + status.occupied) as u64, scanned.next());
        let shown = drawn.iter().find(|(_, shown)| *shown >= now);
        if now > std::mem::replace(&mut known, now)
            && let (Some((at, _)), Some(scan)) = (shown, scan)
        {
            waits.push(1000.0 * (at - scan));
        }
    });
    waits.sort_by(f64::total_cmp);
    println!(
        "scan → what it changed is drawn: p50 {:.0} ms, p99 {:.0} ms of {} scans",
        waits[waits.len() / 2],
        waits[waits.len() * 99 / 100],
        waits.len()
    );
}
