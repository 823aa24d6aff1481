//! What swaps, deaths and stops cost a running community: the figures of `docs/figures.md`.
//!
//! ```text
//! cargo bench --bench running -- [swaps 1000] [recovery 50] [stopped 60]
//! ```
//!
//! Each case prints what it compares with beside its result, from the same run.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use elk_bus::clock::{Stopwatch, monotonic_nanos};
use elk_bus::{Client, Community};
use rustix::process::{Pid, Signal, kill_process};

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
struct Stage {
    folder: PathBuf,
    community: Community,
    started: Vec<Child>,
}

impl Stage {
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
        let child = self.command(arguments).spawn().expect("elk starts");
        self.started.push(child);
        self.started.last().map_or(0, Child::id)
    }

    fn connect(&self, name: &str) -> Client {
        let clock = Stopwatch::start();
        loop {
            match Client::connect(&self.community, name) {
                Ok(client) => return client,
                Err(error) => assert!(clock.elapsed() < Duration::from_secs(20), "{error}"),
            }
            std::thread::sleep(Duration::from_millis(2));
        }
    }
}

impl Drop for Stage {
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
    let mut stage = Stage::new("swaps");
    let mission = long_mission(&stage.folder).display().to_string();
    let launcher = stage.start(&["launch", &mission, "--headless"]);
    let ready = Stopwatch::start();
    while !stage.command(&["apps"]).status().is_ok_and(|s| s.success()) || running(&stage).len() < 7 {
        assert!(ready.elapsed() < Duration::from_secs(60), "the mission does not start");
        std::thread::sleep(Duration::from_millis(20));
    }
    println!("swaps of the explorer in one mission (ClosestFrontier and Potential in turn)");
    println!("{:>6}  {:<44} {:<44} files in /dev/shm, beside", "swaps", "broker", "launcher");
    let (mut commands, mut gaps) = (Vec::new(), Vec::new());
    let show = |done: usize| {
        let broker = running(&stage).get("db").copied().unwrap_or(0);
        let line = |h: Holdings| {
            format!(
                "{} fds {} threads {} maps {:.1} MB",
                h.descriptors,
                h.threads,
                h.mappings,
                h.resident_kb as f64 / 1e3
            )
        };
        let (shared, beside) = files(&stage.community);
        println!("{done:>6}  {:<44} {:<44} {shared}, {beside}", line(holdings(broker)), line(holdings(launcher)));
    };
    let mut failed = 0;
    for done in 0..count {
        if [0, 10, 100, 1000].contains(&done) {
            show(done);
        }
        let other = ["type=Potential", "type=ClosestFrontier"][done % 2];
        let clock = Stopwatch::start();
        let output = stage.command(&["swap", "Explorer", other]).stdout(Stdio::piped()).stderr(Stdio::piped()).output();
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
fn running(stage: &Stage) -> BTreeMap<String, u32> {
    let output = stage.command(&["apps", "--json"]).stdout(Stdio::piped()).output();
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
    let mut stage = Stage::new("recovery");
    let mut broker = stage.command(&["db"]).spawn().expect("elk starts");
    let (killed_at, over) = (AtomicU64::new(u64::MAX), AtomicBool::new(false));
    let recovered = AtomicU64::new(0);
    let epoch = monotonic_nanos();
    let now = || monotonic_nanos() - epoch;
    let mut times = Vec::new();
    let idle: Vec<u32> = (0..6)
        .map(|n| {
            let log = stage.folder.join(format!("{n}.mcap")).display().to_string();
            stage.start(&["logger", "--type", "Mcap", "--name", &format!("idle-{n}"), &format!("File={log}")])
        })
        .collect();
    std::thread::scope(|scope| {
        let (stage, over, killed_at, recovered) = (&stage, &over, &killed_at, &recovered);
        scope.spawn(move || {
            let mut publisher = stage.connect("publisher");
            while !over.load(Ordering::Relaxed) {
                publisher.comms.notify("T", now() as f64).and_then(|()| publisher.comms.flush()).expect("it is heard");
                std::thread::sleep(Duration::from_millis(1));
            }
        });
        scope.spawn(move || {
            let mut subscriber = stage.connect("subscriber");
            subscriber.comms.register_variable("T", 0.0).expect("it registers");
            while !over.load(Ordering::Relaxed) {
                note(&mut subscriber, Duration::from_millis(50), |said| {
                    if said as u64 > killed_at.load(Ordering::SeqCst) {
                        recovered.store(now(), Ordering::SeqCst);
                        killed_at.store(u64::MAX, Ordering::SeqCst);
                    }
                });
            }
        });
        for _ in 0..count {
            std::thread::sleep(Duration::from_millis(700));
            let death = now();
            killed_at.store(death, Ordering::SeqCst);
            broker.kill().expect("the broker can be killed");
            broker.wait().expect("it ends");
            broker = stage.command(&["db"]).spawn().expect("elk starts");
            let patience = Stopwatch::start();
            while killed_at.load(Ordering::SeqCst) != u64::MAX {
                assert!(patience.elapsed() < Duration::from_secs(20), "nothing comes through again");
                std::thread::sleep(Duration::from_millis(1));
            }
            times.push((recovered.load(Ordering::SeqCst) - death) as f64 * 1e-6);
        }
        over.store(true, Ordering::Relaxed);
    });
    println!("{count} deaths of the broker under a message each ms, {} clients besides", idle.len());
    println!("the first message through again  {}", spread(times));
    let _ = kill_process(Pid::from_child(&broker), Signal::TERM);
    let _ = broker.wait();
}

/// What two subscribers hear of 100,000 messages a second, while a third one is stopped.
fn a_stopped_subscriber(secs: u64) {
    let mut stage = Stage::new("stopped");
    let broker = stage.start(&["db"]);
    let _ = stage.connect("first");
    let over = AtomicBool::new(false);
    let epoch = monotonic_nanos();
    let now = || (monotonic_nanos() - epoch) as f64;
    // The one that is stopped is a process of its own: a look at all messages.
    let log = stage.folder.join("echo.txt");
    let mut echo = stage.command(&["echo", "T", "--json"]);
    echo.stdout(std::fs::File::create(&log).expect("a file for the echo"));
    let mut echo = echo.spawn().expect("elk starts");
    let mut phases: Vec<(&str, Vec<f64>)> = Vec::new();
    std::thread::scope(|scope| {
        let (stage, over) = (&stage, &over);
        scope.spawn(move || {
            let mut publisher = stage.connect("publisher");
            let clock = Stopwatch::start();
            let mut ticks = 0_u64;
            while !over.load(Ordering::Relaxed) {
                for _ in 0..100 {
                    publisher.comms.notify("T", now()).expect("it is heard");
                }
                publisher.comms.flush().expect("it is heard");
                ticks += 1;
                let next = Duration::from_millis(ticks);
                std::thread::sleep(next.saturating_sub(clock.elapsed()));
            }
        });
        let mut listener = stage.connect("listener");
        listener.comms.register_variable("T", 0.0).expect("it registers");
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
    std::thread::sleep(Duration::from_millis(500));
    let _ = kill_process(Pid::from_child(&echo), Signal::INT);
    let _ = echo.wait();
    let text = std::fs::read_to_string(&log).unwrap_or_default();
    let missed = text.lines().rfind(|line| line.contains("missed")).unwrap_or("nothing missed");
    println!("the stopped one: {} lines, last word on what it missed: {missed}", text.lines().count());
}
