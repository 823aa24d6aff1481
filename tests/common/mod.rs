//! The real program in a folder and a community of its own.
#![allow(dead_code, reason = "each test program uses its part of it")]

#[path = "../../bus/tests/common/events.rs"]
pub mod events;

pub mod browser;
pub mod car;
pub mod data;
pub mod lab;
pub mod page;
pub mod running;
pub mod skip;
pub mod small;
pub mod spoilt;
pub mod terminal;

use std::io::Read;
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::os::unix::fs::PermissionsExt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

use elk_bus::{Client, Community, ProcessStat};
use events::{Events, end_of, folders_of, once_served, wait_until_gone};
use rustix::process::{Pid, Signal, kill_process};

/// An address of this machine that nobody listens at now.
pub fn free_port() -> SocketAddr {
    TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap().local_addr().unwrap()
}

/// All that a program has said.
pub fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr)
}

/// A folder and a community for one test.
pub struct Elk {
    folder: tempfile::TempDir,
    community: String,
}

impl Elk {
    /// `test` tells it from the others that run at the same time.
    pub fn new(test: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let community = format!("{test}-{}", std::process::id());
        Self { folder, community }
    }

    fn program(&self) -> &'static str {
        env!("CARGO_BIN_EXE_elk")
    }

    /// A program and its arguments that joins as `name` and says nothing: a logger of its own.
    pub fn idle_client(&self, name: &str) -> (&'static str, String) {
        let log = self.folder().join(format!("{name}.mcap"));
        let Self { community, .. } = self;
        let arguments = format!("logger --type Mcap --name {name} --community {community} File={}", log.display());
        (self.program(), arguments)
    }

    /// The community's name.
    pub fn community(&self) -> &str {
        &self.community
    }

    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Whatever happens in the folder from now on.
    pub fn events(&self) -> Events {
        Events::in_folders([self.folder()])
    }

    /// Joins the community, as soon as somebody serves it.
    pub fn join(&self, name: &str) -> Client {
        let community = Community::new(self.community()).unwrap();
        once_served(&community, || Client::connect(&community, name)).unwrap()
    }

    /// Waits until none of the test's processes is left.
    pub fn wait_until_deserted(&self) {
        wait_until_gone("the end of all processes", || processes_of(self));
    }

    /// Writes a shell script that a mission can name.
    pub fn script(&self, name: &str, text: &str) {
        let file = self.folder().join(name);
        std::fs::write(&file, format!("#!/bin/sh\n{text}")).unwrap();
        std::fs::set_permissions(&file, std::fs::Permissions::from_mode(0o755)).unwrap();
    }

    /// `elk` with these arguments, in the folder.
    pub fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(self.program());
        command.args(arguments).current_dir(self.folder()).stdin(Stdio::null());
        command
    }

    /// Launches a mission.
    pub fn launch(&self, mission: &str) -> Launcher {
        self.launch_with(mission, &[])
    }

    /// Launches a mission with more arguments.
    pub fn launch_with(&self, mission: &str, more: &[&str]) -> Launcher {
        let file = self.mission_file(mission);
        self.start("said.txt", &[&["launch", &file, "--headless", "--community", &self.community], more].concat())
    }

    /// Launches a mission whose processes have the limits that a shell command sets.
    pub fn launch_limited(&self, mission: &str, limits: &str) -> Launcher {
        let file = self.mission_file(mission);
        self.spawn("said.txt", self.limited(limits, &["launch", &file, "--headless", "--community", &self.community]))
    }

    /// `elk` with these arguments, in the folder, with the limits that a shell command sets.
    pub fn limited(&self, limits: &str, arguments: &[&str]) -> Command {
        let mut command = Command::new("sh");
        command.args(["-c", &format!("{limits} && exec {} {}", self.program(), arguments.join(" "))]);
        command.current_dir(self.folder()).stdin(Stdio::null());
        command
    }

    fn mission_file(&self, mission: &str) -> String {
        let file = self.folder().join("mission.xml");
        std::fs::write(&file, mission).unwrap();
        file.display().to_string()
    }

    /// Starts `elk attach`.
    pub fn attach(&self) -> Launcher {
        self.start("said-attached.txt", &["attach", "--headless", "--community", &self.community])
    }

    fn start(&self, said: &str, arguments: &[&str]) -> Launcher {
        self.spawn(said, self.command(arguments))
    }

    /// Starts a command; what it says stands in the folder under this name.
    pub fn spawn(&self, said: &str, mut command: Command) -> Launcher {
        let said = self.folder().join(said);
        let out = std::fs::File::create(&said).unwrap();
        let child = command.stdout(out.try_clone().unwrap()).stderr(out).spawn().unwrap();
        Launcher { child, said }
    }

    /// Gives an order to the running mission; its exit code, and all that it said.
    pub fn order(&self, arguments: &[&str]) -> (Option<i32>, String) {
        let all = [arguments, &["--community", &self.community]].concat();
        let out = self.command(&all).output().unwrap();
        let said = [out.stdout, out.stderr].map(|bytes| String::from_utf8(bytes).unwrap()).concat();
        (out.status.code(), said)
    }

    /// Gives an order that has to succeed; what it said.
    pub fn obeyed(&self, arguments: &[&str]) -> String {
        let (code, said) = self.order(arguments);
        assert_eq!(code, Some(0), "{arguments:?}: {said}");
        said
    }

    /// Gives an order that cannot be carried out; what it said.
    pub fn refused(&self, arguments: &[&str]) -> String {
        let (code, said) = self.order(arguments);
        assert_eq!(code, Some(1), "{arguments:?}: {said}");
        said
    }

    /// What `elk apps --json` says of an app.
    pub fn row(&self, app: &str) -> serde_json::Value {
        let rows: Vec<serde_json::Value> = serde_json::from_str(&self.obeyed(&["apps", "--json"])).unwrap();
        let found = rows.iter().find(|row| row["name"] == app);
        found.unwrap_or_else(|| panic!("no row of {app} in {rows:#?}")).clone()
    }

    /// The process of an app, a broker (`db`) or a launcher, as `elk apps` says.
    pub fn process(&self, app: &str) -> i32 {
        self.row(app)["pid"].as_i64().unwrap() as i32
    }

    /// The folder of the only run.
    pub fn run(&self) -> PathBuf {
        self.run_in("logs")
    }

    /// The folder of the only run whose logs are in the folder of this name.
    pub fn run_in(&self, logs: impl AsRef<Path>) -> PathBuf {
        let runs = std::fs::read_dir(self.folder().join(logs)).unwrap();
        let runs: Vec<PathBuf> = runs.map(|run| run.unwrap().path()).collect();
        assert_eq!(runs.len(), 1, "{runs:?}");
        runs.into_iter().next().unwrap()
    }

    /// The summary of the only run.
    pub fn summary(&self) -> serde_json::Value {
        summary_of(&self.run())
    }

    /// Launches a mission that cannot succeed; what was said.
    pub fn launch_and_fail(&self, mission: &str) -> String {
        let (code, said) = self.launch(mission).end();
        assert_eq!(code, Some(1), "{said}");
        said
    }
}

/// What is left of a test's community is removed, also if the test has failed: a broker that was killed clears nothing away.
impl Drop for Elk {
    fn drop(&mut self) {
        for process in processes_of(self) {
            // One that has ended meanwhile needs no end.
            let _ = Pid::from_raw(process).map(|process| kill_process(process, Signal::KILL));
        }
        let gone = catch_unwind(AssertUnwindSafe(|| self.wait_until_deserted()));
        for name in shared_memory_of(self) {
            let _ = std::fs::remove_file(Path::new("/dev/shm").join(name));
        }
        for folder in Community::new(&*self.community).map(|community| folders_of(&community)).unwrap_or_default() {
            let _ = std::fs::remove_dir_all(&folder);
            // That of all communities, if it was the last.
            let _ = folder.parent().map(std::fs::remove_dir);
        }
        assert!(gone.is_ok() || std::thread::panicking(), "processes of {} do not end", self.community);
    }
}

/// A running `elk launch`. Killed, should the test fail before its end.
pub struct Launcher {
    child: Child,
    said: PathBuf,
}

impl Launcher {
    pub fn id(&self) -> i32 {
        self.child.id() as i32
    }

    /// All that it has said.
    pub fn said(&self) -> String {
        std::fs::read_to_string(&self.said).unwrap()
    }

    /// Whether it has ended.
    pub fn is_over(&mut self) -> bool {
        self.child.try_wait().unwrap().is_some()
    }

    /// Waits until it has said something.
    pub fn wait_for(&mut self, words: &str) {
        self.wait_until(words, |said| said.contains(words));
    }

    /// Waits until what it has said is right.
    pub fn wait_until(&mut self, what: &str, is_right: impl Fn(&str) -> bool) {
        let mut events = Events::in_folders(self.said.parent()).or_end_of(self.id());
        loop {
            let over = self.is_over();
            if is_right(&self.said()) {
                return;
            }
            assert!(!over && events.happen(), "never said {what:?}:\n{}", self.said());
        }
    }

    /// Waits for its end; its exit code, and all that it said.
    pub fn end(self) -> (Option<i32>, String) {
        self.end_of_several(1)
    }

    /// … of so many missions, one after the other.
    pub fn end_of_several(mut self, missions: usize) -> (Option<i32>, String) {
        let status = (0..missions).find_map(|_| end_of(&mut self.child));
        let status = status.unwrap_or_else(|| panic!("never ended:\n{}", self.said()));
        (status.code(), self.said())
    }

    /// All processes that it has started, and those that they have.
    pub fn descendants(&self) -> Vec<i32> {
        let all = processes();
        let mut found = vec![self.id()];
        let mut next = 0;
        while next < found.len() {
            let parent = found[next];
            found.extend(all.iter().filter(|one| one.parent == parent).map(|one| one.id));
            next += 1;
        }
        found.split_off(1)
    }

    /// The process of the app of this name.
    pub fn process_of(&self, app: &str) -> i32 {
        self.process_with(&format!("--name\0{app}\0"))
    }

    /// Its descendant with this in its arguments.
    pub fn process_with(&self, arguments: &str) -> i32 {
        let all = processes();
        let ours = self.descendants();
        let found = all.iter().find(|one| ours.contains(&one.id) && one.line.contains(arguments));
        found.unwrap_or_else(|| panic!("no process with {arguments:?}")).id
    }
}

impl Drop for Launcher {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The summary of a run.
pub fn summary_of(run: &Path) -> serde_json::Value {
    serde_json::from_str(&std::fs::read_to_string(run.join("summary.json")).unwrap()).unwrap()
}

struct Process {
    id: i32,
    parent: i32,
    /// Its arguments, each followed by a zero.
    line: String,
}

fn processes() -> Vec<Process> {
    let entries = std::fs::read_dir("/proc").unwrap().flatten();
    let ids = entries.filter_map(|entry| entry.file_name().to_str()?.parse().ok());
    ids.filter_map(|id: i32| {
        let stat = ProcessStat::of(id).filter(|stat| !stat.has_ended())?;
        let mut line = Vec::new();
        std::fs::File::open(format!("/proc/{id}/cmdline")).ok()?.read_to_end(&mut line).ok()?;
        let line = String::from_utf8_lossy(&line).into_owned();
        Some(Process { id, parent: stat.parent, line })
    })
    .collect()
}

/// Whether a process runs; one that has ended and was not waited for does not.
pub fn alive(id: i32) -> bool {
    ProcessStat::of(id).is_some_and(|stat| !stat.has_ended())
}

/// Processes that have the test's community among their arguments: not one whose name ends in it, which is another test's.
pub fn processes_of(elk: &Elk) -> Vec<i32> {
    let is_of = |one: &&Process| one.line.split('\0').any(|argument| argument == elk.community);
    processes().iter().filter(is_of).map(|one| one.id).collect()
}

/// Whether a file in shared memory is of the test's community, or of one that a test has made of its name: no number follows that
/// is another process'.
fn is_of(elk: &Elk, name: &str) -> bool {
    let rest = name.strip_prefix("elk_").and_then(|name| name.strip_prefix(&elk.community));
    rest.is_some_and(|rest| !rest.starts_with(|next: char| next.is_ascii_digit()))
}

/// Files of the test's community in shared memory.
pub fn shared_memory_of(elk: &Elk) -> Vec<String> {
    let entries = std::fs::read_dir("/dev/shm").unwrap().flatten();
    let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
    names.filter(|name| is_of(elk, name)).collect()
}

pub fn kill(id: i32, signal: Signal) {
    kill_process(Pid::from_raw(id).unwrap(), signal).unwrap();
}
