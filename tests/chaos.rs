//! Kills: any process, the broker among them, at random moments, one after the other, over a stream of numbered messages
//! and over missions. Nothing may be lost, heard twice or out of order, and every mission has to complete.
//!
//! The short run is part of the tests. A long one, of any seed:
//!
//! ```text
//! ELK_CHAOS_KILLS=250 ELK_CHAOS_SEED=7 cargo test --release --test chaos -- --nocapture
//! ```
//!
//! One process is killed at a time: the next is killed when all are there again. What a publisher has said and the broker
//! has not taken dies with both of them, and no design without a disk can change that.

mod common;

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use common::events::Patience;
use common::lab::{hear, wait_for_clients};
use common::{Elk, Launcher, alive, kill};
use elk_bus::{App, AppError, Client, Comms, Community, Mail, RunOptions, number, run_app, text};
use rustix::process::Signal;

const PUBLISHERS: [&str; 3] = ["p1", "p2", "p3"];
const SUBSCRIBERS: [&str; 3] = ["s1", "s2", "s3"];
/// What the first publisher says.
const NUMBERS: &str = "P1";

fn setting(name: &str, default: u64) -> u64 {
    std::env::var(name).ok().map_or(default, |text| text.parse().expect("a whole number"))
}

fn kills() -> u64 {
    setting("ELK_CHAOS_KILLS", 12)
}

/// Random numbers of a seed (splitmix64).
struct Random(u64);

impl Random {
    fn below(&mut self, end: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) % end
    }
}

/// Says 1, 2, 3, … under its own name, until it is told to be content. Started again it goes on behind the last number
/// that the community has of it.
struct Publisher {
    key: String,
    enough: PathBuf,
    /// The last number said; `None`: what was said before is not known yet.
    said: Option<u64>,
    content: bool,
}

impl App for Publisher {
    fn on_start_up(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        self.key = comms.name().to_uppercase();
        comms.register(&self.key)?;
        Ok(comms.register("DB_CLIENTS")?)
    }

    fn on_new_mail(&mut self, comms: &mut Comms, mail: &Mail<'_>) -> Result<(), AppError> {
        if self.said.is_none() {
            self.said = Some(if mail.key() == self.key { mail.as_double().unwrap_or(0.0) as u64 } else { 0 });
            comms.unregister(&self.key)?;
            comms.unregister("DB_CLIENTS")?;
        }
        Ok(())
    }

    fn tick_period(&self) -> Option<Duration> {
        Some(Duration::from_millis(4))
    }

    fn iterate(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        let Some(said) = self.said.as_mut().filter(|_| !self.content) else { return Ok(()) };
        for _ in 0..4 {
            *said += 1;
            comms.notify(&self.key, *said as f64)?;
        }
        if self.enough.exists() {
            self.content = true;
            std::fs::write(self.enough.with_extension(&self.key), said.to_string())?;
        }
        Ok(())
    }
}

/// Writes down every number that it hears. Started again it knows what it was writing down when it died.
struct Subscriber {
    record: PathBuf,
    file: Option<File>,
    last: String,
}

impl App for Subscriber {
    fn on_start_up(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        self.record = self.record.join(comms.name());
        let text = std::fs::read_to_string(&self.record).unwrap_or_default();
        self.last = text.lines().next_back().unwrap_or_default().to_owned();
        self.file = Some(OpenOptions::new().create(true).append(true).open(&self.record)?);
        PUBLISHERS.iter().try_for_each(|name| comms.register(&name.to_uppercase()))?;
        Ok(())
    }

    fn on_new_mail(&mut self, _: &mut Comms, mail: &Mail<'_>) -> Result<(), AppError> {
        let line = format!("{} {}", mail.key(), mail.as_double().unwrap_or_default());
        // A latest value was heard by the one before; and what that one died of comes once more.
        if mail.is_latest() || std::mem::take(&mut self.last) == line {
            return Ok(());
        }
        if let Some(file) = &mut self.file {
            file.write_all(format!("{line}\n").as_bytes())?;
        }
        Ok(())
    }
}

const ROLE: &str = "ELK_CHAOS_ROLE";

/// Not a test by itself: the process of a publisher or a subscriber.
#[test]
fn role() {
    let Ok(said) = std::env::var(ROLE) else { return };
    let [community, name, folder]: [&str; 3] = said.split(' ').collect::<Vec<_>>().try_into().unwrap();
    let app: Box<dyn App> = match PUBLISHERS.contains(&name) {
        true => {
            let enough = Path::new(folder).join("enough");
            Box::new(Publisher { key: String::new(), enough, said: None, content: false })
        }
        false => Box::new(Subscriber { record: folder.into(), file: None, last: String::new() }),
    };
    let options = RunOptions::new(name, Community::new(community).unwrap()).as_launched().unwrap();
    run_app(app, &options).unwrap();
}

/// The processes of a stream, each started again when it was killed.
struct ProcessSet<'a> {
    elk: &'a Elk,
    members: BTreeMap<&'static str, Child>,
}

impl<'a> ProcessSet<'a> {
    fn start(elk: &'a Elk) -> Self {
        let mut processes = Self { elk, members: BTreeMap::new() };
        processes.start_one("db");
        // Whoever comes before the broker serves finds nobody, and ends.
        drop(elk.join("observer"));
        for names in [SUBSCRIBERS, PUBLISHERS] {
            names.iter().for_each(|name| processes.start_one(name));
            wait_for_clients(elk, &format!("all of {names:?}"), |clients| {
                names.iter().all(|name| clients.contains(name))
            });
        }
        processes
    }

    fn start_one(&mut self, name: &'static str) {
        let community = self.elk.community();
        let mut command = if name == "db" {
            self.elk.command(&["db", "--community", community])
        } else {
            let mut command = Command::new(std::env::current_exe().unwrap());
            command.args(["--exact", "role"]).env("ELK_LEASE_SECS", "60");
            command.env(ROLE, format!("{community} {name} {}", self.elk.folder().display()));
            command
        };
        let child = command.stdin(Stdio::null()).stdout(Stdio::null()).spawn().unwrap();
        self.members.insert(name, child);
    }

    fn kill(&mut self, name: &'static str) {
        let child = self.members.get_mut(name).unwrap();
        kill(child.id() as i32, Signal::KILL);
        child.wait().unwrap();
        self.start_one(name);
    }
}

impl Drop for ProcessSet<'_> {
    fn drop(&mut self) {
        for child in self.members.values_mut() {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

#[test]
fn a_stream_of_numbers_survives_the_death_of_anyone() {
    let elk = Elk::new("chaos-stream");
    let mut random = Random(setting("ELK_CHAOS_SEED", 1));
    let mut processes = ProcessSet::start(&elk);
    let names: Vec<&'static str> = ["db"].into_iter().chain(PUBLISHERS).chain(SUBSCRIBERS).collect();
    let mut killed: BTreeMap<&str, u64> = BTreeMap::new();
    let mut watcher = Watcher::of(&elk);
    for _ in 0..kills() {
        watcher.hear_numbers(30 + random.below(200));
        let name = names[random.below(names.len() as u64) as usize];
        processes.kill(name);
        *killed.entry(name).or_default() += 1;
        // The list of the time before the death does not count: it is told anew once the dead one is back.
        let gone_and_back = if name == "db" { &names[..] } else { std::slice::from_ref(&name) };
        watcher.until_back(gone_and_back);
    }
    let enough = elk.folder().join("enough");
    std::fs::write(&enough, "").unwrap();
    let last: Vec<u64> = PUBLISHERS.iter().map(|name| last_said(&elk, &enough, &name.to_uppercase())).collect();
    let total: u64 = last.iter().sum();
    for subscriber in SUBSCRIBERS {
        let record = elk.folder().join(subscriber);
        let heard = || std::fs::read_to_string(&record).unwrap_or_default();
        elk.events().wait_until("all numbers", || heard().lines().count() as u64 >= total);
        let heard = heard();
        for (publisher, last) in PUBLISHERS.iter().zip(&last) {
            let key = publisher.to_uppercase();
            let numbers = heard.lines().filter_map(|line| line.strip_prefix(&key)?.trim().parse::<u64>().ok());
            let wrong = numbers.clone().zip(1..).find(|(number, expected)| number != expected);
            assert_eq!(wrong, None, "{subscriber} of {publisher}: heard, expected; killed so far: {killed:?}");
            assert_eq!(numbers.count() as u64, *last, "{subscriber} of {publisher}; killed: {killed:?}");
        }
    }
    println!("{} kills {killed:?}: {total} messages to each of 3, 0 lost, 0 twice, 0 out of order", kills());
}

/// What a publisher says that it has said.
fn last_said(elk: &Elk, enough: &Path, key: &str) -> u64 {
    let (file, mut last) = (enough.with_extension(key), None);
    elk.events().wait_until(&format!("the end of {key}"), || {
        last = std::fs::read_to_string(&file).ok().and_then(|text| text.parse().ok());
        last.is_some()
    });
    last.unwrap()
}

/// Hears who comes, and what the first of the publishers says.
struct Watcher(Client);

impl Watcher {
    fn of(elk: &Elk) -> Self {
        let mut client = elk.join("usher");
        client.comms.register(text("DB_EVENT")).unwrap();
        client.comms.register(number(NUMBERS)).unwrap();
        Self(client)
    }

    /// Waits for so many more numbers.
    fn hear_numbers(&mut self, mut count: u64) {
        hear(&mut self.0, "more numbers", |mail| {
            count -= u64::from(mail.key() == NUMBERS).min(count);
            (count == 0).then_some(())
        });
    }

    /// Waits until each of these has been let in again.
    fn until_back(&mut self, names: &[&'static str]) {
        let mut missing: Vec<&str> = names.iter().copied().filter(|name| *name != "db").collect();
        hear(&mut self.0, &format!("that {names:?} are back"), |mail| {
            let event = mail.as_text().unwrap_or_default();
            missing.retain(|name| event.strip_prefix("connected=") != Some(name));
            missing.is_empty().then_some(())
        });
    }
}

/// Everybody may die as often as it happens.
const MISSION: &str = r#"
<Scenario name="Chaos" broker-restarts="1000" broker-window="2">
    <Sensor type="Simulator" restart="always" restarts="1000" restart-window="1">
        <Width>60</Width> <Height>60</Height> <Start> 0.0; 0.0; 0.8 </Start>
    </Sensor>
    <Filter type="Distance" restart="always" restarts="1000" restart-window="1"/>
    <Map type="OctoMap" restart="always" restarts="1000" restart-window="1"/>
    <Explorer type="Potential" restart="always" restarts="1000" restart-window="1">
        <Mid> 0.0; 0.0; 0.0 </Mid> <Dim> 5.7; 4.3; 4.5 </Dim>
    </Explorer>
    <Controller type="MOOSSim" restart="always" restarts="1000" restart-window="1"/>
    <Logger type="Mcap" restart="always" restarts="1000" restart-window="1"/>
</Scenario>"#;

#[test]
fn missions_survive_the_death_of_anyone() {
    let mut random = Random(setting("ELK_CHAOS_SEED", 1) ^ 0x5eed);
    let (mut done, mut missions) = (0, 0);
    let mut killed: BTreeMap<String, u64> = BTreeMap::new();
    while done < kills() {
        missions += 1;
        let elk = Elk::new(&format!("chaos-{missions}"));
        let mut launcher = elk.launch(MISSION);
        let mut observer = Observer::of(&elk);
        while done < kills() {
            let Some(processes) = observer.processes_after(5 + random.below(40), &mut launcher) else { break };
            let (name, id) = &processes[random.below(processes.len() as u64) as usize];
            if alive(*id) {
                let _ = rustix::process::kill_process(rustix::process::Pid::from_raw(*id).unwrap(), Signal::KILL);
                *killed.entry(name.clone()).or_default() += 1;
                done += 1;
            }
        }
        drop(observer);
        let (code, said) = launcher.end();
        assert_eq!(code, Some(0), "killed so far: {killed:?}\n{said}");
        assert!(said.contains("contacts 0"), "{said}");
    }
    println!("{done} kills {killed:?}: {missions} missions, all complete, 0 contacts");
}

/// Two to four at once, the broker perhaps among them.
#[test]
fn missions_survive_several_deaths_at_once() {
    let mut random = Random(setting("ELK_CHAOS_SEED", 1) ^ 0x2005);
    let mut done = 0;
    while done < kills() {
        let elk = Elk::new(&format!("chaos-at-once-{done}"));
        let mut launcher = elk.launch(MISSION);
        let mut processes = Observer::of(&elk).processes_after(20 + random.below(100), &mut launcher).unwrap();
        let mut victims = Vec::new();
        for _ in 0..2 + random.below(3) {
            victims.push(processes.swap_remove(random.below(processes.len() as u64) as usize));
        }
        victims.iter().for_each(|(_, id)| kill(*id, Signal::KILL));
        done += victims.len() as u64;
        let (code, said) = launcher.end();
        assert_eq!(code, Some(0), "killed at once: {victims:?}\n{said}");
        assert!(said.contains("contacts 0"), "{said}");
    }
}

/// Hears what a mission says of itself.
struct Observer<'a> {
    elk: &'a Elk,
    client: Client,
}

impl<'a> Observer<'a> {
    fn of(elk: &'a Elk) -> Self {
        let mut client = elk.join("observer");
        for key in ["POSE_COMMAND", "PLAN_REQUEST", "PLAN", "MAP_KNOWN", "PROGRESS", "*_STATUS", "DB_CLIENTS"] {
            client.comms.register(key).unwrap();
        }
        Self { elk, client }
    }

    /// Waits for so many messages, and until all apps and the broker run then; their processes. `None`: the mission is over.
    fn processes_after(&mut self, messages: u64, launcher: &mut Launcher) -> Option<Vec<(String, i32)>> {
        let (mut heard, patience) = (0, Patience::new());
        loop {
            if heard >= messages {
                match look(self.elk) {
                    MissionState::Running(processes) => return Some(processes),
                    MissionState::Over => return None,
                    MissionState::Incomplete => {}
                }
            }
            if launcher.is_over() {
                return None;
            }
            // A broker that is gone for good has ended with its mission.
            let left = patience.left(format_args!("all of them run:\n{}", launcher.said()));
            heard += self.client.receive(left, |_| {}).ok()? as u64;
        }
    }
}

enum MissionState {
    /// All run: their names and processes.
    Running(Vec<(String, i32)>),
    Incomplete,
    Over,
}

fn look(elk: &Elk) -> MissionState {
    let output = elk.command(&["apps", "--json", "--community", elk.community()]).output().unwrap();
    let rows: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap_or_default();
    let rows = rows.as_array().cloned().unwrap_or_default();
    if rows.iter().any(|row| row["state"] == "ended") {
        return MissionState::Over;
    }
    if rows.len() != 8 || rows.iter().any(|row| row["state"] != "running") {
        return MissionState::Incomplete;
    }
    let apps = rows.iter().filter(|row| row["name"] != "launcher");
    let process = |row: &serde_json::Value| Some((row["name"].as_str()?.to_owned(), row["pid"].as_i64()? as i32));
    MissionState::Running(apps.filter_map(process).collect())
}
