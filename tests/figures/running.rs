//! What swaps, deaths and stops cost a running community: the figures of `docs/figures.md`.
//!
//! ```text
//! cargo bench --bench running -- [swaps 1000] [recovery 50] [stopped 60]
//! ```
//!
//! Each case prints what it compares with beside its result, from the same run.

use std::collections::BTreeMap;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::time::Duration;

use elk_bus::clock::{Stopwatch, monotonic_nanos};
use elk_bus::{Client, Community};
use events::{Events, WATCHDOG, once_served};
use rustix::process::{Pid, Signal, kill_process};

#[path = "../../bus/tests/common/events.rs"]
mod events;

const ELK: &str = env!("CARGO_BIN_EXE_elk");

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let count = |case: &str, default: usize| {
        let at = arguments.iter().position(|a| a == case);
        match at {
            Some(at) => Some(arguments.get(at + 1).and_then(|n| n.parse().ok()).unwrap_or(default)),
            None => arguments.is_empty().then_some(default),
        }
    };
    if let Some(swaps) = count("swaps", 100) {
        swaps_of_an_explorer(swaps);
    }
    if let Some(deaths) = count("recovery", 20) {
        recovery_of_a_broker(deaths);
    }
    if let Some(secs) = count("stopped", 10) {
        a_stopped_subscriber(secs as u64);
    }
}

/// A folder and a community of their own, and what was started in them.
struct Fixture {
    folder: PathBuf,
    community: Community,
    started: Vec<Child>,
}

impl Fixture {
    fn new(case: &str) -> Self {
        let name = format!("elk-{case}-{}", std::process::id());
        let folder = std::env::temp_dir().join(&name);
        std::fs::create_dir_all(&folder).expect("a folder for the run");
        Self { folder, community: Community::new(name).expect("a good name"), started: Vec::new() }
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(ELK);
        command.args(arguments).args(["--community", self.community.as_str()]);
        command.current_dir(&self.folder).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        command
    }

    fn start(&mut self, arguments: &[&str]) -> u32 {
        let command = self.command(arguments);
        self.keep(command)
    }

    fn keep(&mut self, mut command: Command) -> u32 {
        let child = command.spawn().expect("elk starts");
        let process = child.id();
        self.started.push(child);
        process
    }

    fn connect(&self, name: &str) -> Client {
        once_served(&self.community, || Client::connect(&self.community, name)).expect("a community")
    }
}

impl Drop for Fixture {
    fn drop(&mut self) {
        for child in &mut self.started {
            let _ = kill_process(Pid::from_child(child), Signal::TERM);
            let _ = child.wait();
        }
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

/// The value below which a share of `sorted` lies.
fn at(sorted: &[f64], share: f64) -> f64 {
    let rank = (share * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.saturating_sub(1)).copied().unwrap_or(f64::NAN)
}

fn spread(mut values: Vec<f64>) -> String {
    values.sort_by(f64::total_cmp);
    format!("p50 {:.1}  p99 {:.1}  max {:.1} ms", at(&values, 0.5), at(&values, 0.99), at(&values, 1.0))
}

/// What a process holds: descriptors, threads, mappings, resident memory (kB).
#[derive(Debug, Clone, Copy)]
struct Holdings {
    descriptors: usize,
    threads: usize,
    mappings: usize,
    resident_kb: u64,
}

fn holdings(process: u32) -> Holdings {
    let entries = |folder: &str| std::fs::read_dir(format!("/proc/{process}/{folder}")).map_or(0, Iterator::count);
    let text = |file: &str| std::fs::read_to_string(format!("/proc/{process}/{file}")).unwrap_or_default();
    let resident =
        text("status").lines().find_map(|l| l.strip_prefix("VmRSS:")?.trim().strip_suffix(" kB")?.parse().ok());
    Holdings {
        descriptors: entries("fd"),
        threads: entries("task"),
        mappings: text("maps").lines().count(),
        resident_kb: resident.unwrap_or(0),
    }
}

/// The community's files in shared memory and beside it.
fn files(community: &Community) -> (usize, usize) {
    let shared = std::fs::read_dir("/dev/shm").into_iter().flatten().flatten();
    let shared = shared.filter(|f| f.file_name().to_string_lossy().contains(community.as_str())).count();
    let user = rustix::process::geteuid().as_raw();
    let mut folders = vec![std::env::temp_dir().join(format!("elk-{user}")).join(community.as_str())];
    let mut others = 0;
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            match entry.path().is_dir() {
                true => folders.push(entry.path()),
                false => others += 1,
            }
        }
    }
    (shared, others)
}

/// A mission that takes long enough: many scans of a large world.
fn long_mission(folder: &Path) -> PathBuf {
    let worlds = Path::new(env!("CARGO_MANIFEST_DIR")).join("mission-files/worlds/hall-long.obj");
    let file = folder.join("mission.xml");
    let text = format!(
        "<Scenario name=\"Swaps\"><Sensor type=\"Simulator\"><World>{}</World><Start>2.2; 3.2; 1.2</Start>\
         <Width>160</Width><Height>160</Height></Sensor><Filter type=\"Distance\"/><Map type=\"OctoMap\"/>\
         <Explorer type=\"ClosestFrontier\"><ScanSpacing>0.02 m</ScanSpacing><Policy>thesis</Policy></Explorer>\
         <Controller type=\"MOOSSim\"/><Logger type=\"none\"/></Scenario>",
        worlds.display()
    );
    std::fs::write(&file, text).expect("the mission is written");
    file
}

/// Exchanges the explorer of a mission again and again; what is left of each swap shows in what the others hold.
fn swaps_of_an_explorer(count: usize) {
    let mut fixture = Fixture::new("swaps");
    let mission = long_mission(&fixture.folder).display().to_string();
    let words = fixture.folder.join("said.txt");
    let mut launch = fixture.command(&["launch", &mission, "--headless"]);
    let out = std::fs::File::create(&words).expect("a file for its words");
    launch.stdout(out.try_clone().expect("another handle")).stderr(out);
    let launcher = fixture.keep(launch);
    let everybody = "alive: Controller Explorer Filter Map Sensor";
    let begins = || std::fs::read_to_string(&words).is_ok_and(|said| said.contains(everybody));
    Events::in_folders([&fixture.folder]).wait_until("the mission's start", begins);
    assert_eq!(running(&fixture).len(), 7);
    println!("swaps of the explorer in one mission (ClosestFrontier and Potential in turn)");
    println!("{:>6}  {:<44} {:<44} files in /dev/shm, beside", "swaps", "broker", "launcher");
    let (mut commands, mut gaps) = (Vec::new(), Vec::new());
    let show = |done: usize| {
        let broker = running(&fixture).get("db").copied().unwrap_or(0);
        let line = |h: Holdings| {
            format!(
                "{} fds {} threads {} maps {:.1} MB",
                h.descriptors,
                h.threads,
                h.mappings,
                h.resident_kb as f64 / 1e3
            )
        };
        let (shared, beside) = files(&fixture.community);
        println!("{done:>6}  {:<44} {:<44} {shared}, {beside}", line(holdings(broker)), line(holdings(launcher)));
    };
    let mut failed = 0;
    for done in 0..count {
        if [0, 10, 100, 1000].contains(&done) {
            show(done);
        }
        let other = ["type=Potential", "type=ClosestFrontier"][done % 2];
        let clock = Stopwatch::start();
        let output =
            fixture.command(&["swap", "Explorer", other]).stdout(Stdio::piped()).stderr(Stdio::piped()).output();
        let output = output.expect("elk swap runs");
        commands.push(clock.elapsed().as_secs_f64() * 1e3);
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        match said.split("gap ").nth(1).and_then(|rest| rest.split(' ').next()?.parse().ok()) {
            Some(gap) if output.status.success() => gaps.push(gap),
            _ => {
                failed += 1;
                println!("swap {done}: {said}{}", String::from_utf8_lossy(&output.stderr).trim());
            }
        }
    }
    show(count);
    println!("{count} swaps, {failed} failed");
    println!("the command  {}", spread(commands));
    println!("the gap      {}", spread(gaps));
}

/// Names and processes of a mission, once they run.
fn running(fixture: &Fixture) -> BTreeMap<String, u32> {
    let output = fixture.command(&["apps", "--json"]).stdout(Stdio::piped()).output();
    let rows: serde_json::Value = output.ok().and_then(|o| serde_json::from_slice(&o.stdout).ok()).unwrap_or_default();
    let row = |row: &serde_json::Value| {
        let running = row["state"] == "running";
        running.then(|| Some((row["name"].as_str()?.to_owned(), row["pid"].as_u64()? as u32)))?
    };
    rows.as_array().into_iter().flatten().filter_map(row).collect()
}

/// A message: when it was said.
fn note(client: &mut Client, patience: Duration, mut heard: impl FnMut(f64)) {
    client.receive(patience, |mail| mail.as_double().into_iter().for_each(&mut heard)).expect("the community stays");
}

/// Kills the broker under a stream of one message each millisecond: when does the first message come through again that
/// was said after the death?
fn recovery_of_a_broker(count: usize) {
    let mut fixture = Fixture::new("recovery");
    let mut broker = fixture.command(&["db"]).spawn().expect("elk starts");
    let (over, (tell, heard)) = (AtomicBool::new(false), channel());
    let epoch = monotonic_nanos();
    let now = || (monotonic_nanos() - epoch) as f64;
    let mut times = Vec::new();
    let idle: Vec<u32> = (0..6)
        .map(|n| {
            let log = fixture.folder.join(format!("{n}.mcap")).display().to_string();
            fixture.start(&["logger", "--type", "Mcap", "--name", &format!("idle-{n}"), &format!("File={log}")])
        })
        .collect();
    std::thread::scope(|scope| {
        let (fixture, over) = (&fixture, &over);
        scope.spawn(move || {
            let mut publisher = fixture.connect("publisher");
            while !over.load(Ordering::Relaxed) {
                publisher.comms.notify("T", now()).and_then(|()| publisher.comms.flush()).expect("it is heard");
                // The load: a message each millisecond.
                std::thread::sleep(Duration::from_millis(1));
            }
        });
        scope.spawn(move || {
            let mut subscriber = fixture.connect("subscriber");
            subscriber.comms.register("T").expect("it registers");
            while !over.load(Ordering::Relaxed) {
                // When it was said, and when it was heard.
                note(&mut subscriber, Duration::from_millis(50), |said| {
                    tell.send((said, now())).expect("it is listened to")
                });
            }
        });
        // When the first message was heard that was said after a moment.
        let first_after = |moment: f64| loop {
            let (said, when) = heard.recv_timeout(WATCHDOG).expect("something comes through again");
            if said > moment {
                break when;
            }
        };
        for _ in 0..count {
            // Each broker has served for a while before it is killed.
            let served_since = first_after(now());
            first_after(served_since + 700e6);
            let death = now();
            broker.kill().expect("the broker can be killed");
            broker.wait().expect("it ends");
            broker = fixture.command(&["db"]).spawn().expect("elk starts");
            times.push((first_after(death) - death) * 1e-6);
        }
        over.store(true, Ordering::Relaxed);
    });
    println!("{count} deaths of the broker under a message each ms, {} clients besides", idle.len());
    println!("the first message through again  {}", spread(times));
    let _ = kill_process(Pid::from_child(&broker), Signal::TERM);
    let _ = broker.wait();
}

/// The last message of a publisher.
const LAST: f64 = -1.0;

/// The last lines of a file.
fn end_of(file: &Path) -> std::io::Result<String> {
    let mut file = std::fs::File::open(file)?;
    let len = file.metadata()?.len();
    file.seek(SeekFrom::Start(len.saturating_sub(1000)))?;
    let mut end = Vec::new();
    file.read_to_end(&mut end)?;
    Ok(String::from_utf8_lossy(&end).into_owned())
}

/// What two subscribers hear of 100,000 messages a second, while a third one is stopped.
fn a_stopped_subscriber(secs: u64) {
    let mut fixture = Fixture::new("stopped");
    let broker = fixture.start(&["db"]);
    let _ = fixture.connect("first");
    let over = AtomicBool::new(false);
    let epoch = monotonic_nanos();
    let now = || (monotonic_nanos() - epoch) as f64;
    // The one that is stopped is a process of its own: a look at all messages.
    let log = fixture.folder.join("echo.txt");
    let mut echo = fixture.command(&["echo", "T", "--json"]);
    echo.stdout(std::fs::File::create(&log).expect("a file for the echo"));
    let mut echo = echo.spawn().expect("elk starts");
    let mut phases: Vec<(&str, Vec<f64>)> = Vec::new();
    std::thread::scope(|scope| {
        let (fixture, over) = (&fixture, &over);
        scope.spawn(move || {
            let mut publisher = fixture.connect("publisher");
            let clock = Stopwatch::start();
            let mut ticks = 0_u64;
            while !over.load(Ordering::Relaxed) {
                for _ in 0..100 {
                    publisher.comms.notify("T", now()).expect("it is heard");
                }
                publisher.comms.flush().expect("it is heard");
                ticks += 1;
                let next = Duration::from_millis(ticks);
                // The load: 100 messages each millisecond.
                std::thread::sleep(next.saturating_sub(clock.elapsed()));
            }
            publisher.comms.notify("T", LAST).and_then(|()| publisher.comms.flush()).expect("it is heard");
        });
        let mut listener = fixture.connect("listener");
        listener.comms.register("T").expect("it registers");
        let mut listen = |phase: &'static str, secs: u64| {
            let (clock, mut latencies) = (Stopwatch::start(), Vec::new());
            while clock.elapsed() < Duration::from_secs(secs) {
                note(&mut listener, Duration::from_millis(100), |said| latencies.push((now() - said) * 1e-6));
            }
            phases.push((phase, latencies));
        };
        listen("warm-up", 2);
        for _ in 0..3 {
            listen("all read", secs / 3);
            let _ = kill_process(Pid::from_child(&echo), Signal::STOP);
            listen("one stopped", secs / 3);
            let _ = kill_process(Pid::from_child(&echo), Signal::CONT);
            listen("it goes on", 1);
        }
        over.store(true, Ordering::Relaxed);
    });
    let resident = holdings(broker).resident_kb as f64 / 1e3;
    println!("100,000 messages a second, one of two subscribers stopped with SIGSTOP for 3 × {} s", secs / 3);
    let mut p99 = BTreeMap::new();
    for phase in ["all read", "one stopped"] {
        let mut all: Vec<f64> = phases.iter().filter(|(name, _)| *name == phase).flat_map(|(_, l)| l.clone()).collect();
        all.sort_by(f64::total_cmp);
        p99.insert(phase, at(&all, 0.99));
        println!(
            "the other one, {phase:<12} {} messages, p50 {:.3}  p99 {:.3} ms",
            all.len(),
            at(&all, 0.5),
            at(&all, 0.99)
        );
    }
    println!("ratio of p99 {:.2}; broker {resident:.1} MB", p99["one stopped"] / p99["all read"]);
    // It has heard, or missed, all by then.
    let last = format!("\"value\":{LAST:?}");
    let is_through = || end_of(&log).is_ok_and(|end| end.lines().any(|line| line.contains(&last)));
    Events::in_folders([&fixture.folder]).wait_until("the last message", is_through);
    let _ = kill_process(Pid::from_child(&echo), Signal::INT);
    let _ = echo.wait();
    let text = std::fs::read_to_string(&log).unwrap_or_default();
    let missed = text.lines().rfind(|line| line.contains("missed")).unwrap_or("nothing missed");
    println!("the stopped one: {} lines, last word on what it missed: {missed}", text.lines().count());
}
