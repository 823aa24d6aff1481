//! Waiting for what happens: files that are written, processes that end, brokers that come. Nobody looks again before
//! something has happened, and nobody waits for ever.
#![allow(dead_code, reason = "each test program uses its part of it")]

use std::fmt::Display;
use std::mem::MaybeUninit;
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};
use std::process::{Child, ExitStatus};
use std::time::Duration;

use elk_bus::clock::Stopwatch;
use elk_bus::{Community, ConnectError};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::inotify::{self, CreateFlags, WatchFlags};
use rustix::io::Errno;
use rustix::process::{Pid, PidfdFlags, pidfd_open};

/// How long anything may take before a test gives up: far longer than it takes on a busy machine.
pub const WATCHDOG: Duration = Duration::from_secs(120);

/// How long it is waited for an event before all is looked at once more: an event that was missed costs no test.
const LOOK_AGAIN: Duration = Duration::from_secs(2);

/// How long a test waits for one thing.
pub struct Patience(Stopwatch);

impl Patience {
    /// Waits from now on.
    pub fn new() -> Self {
        Self(Stopwatch::start())
    }

    /// What is left of it; the test fails if that is nothing.
    pub fn left(&self, what: impl Display) -> Duration {
        self.rest().unwrap_or_else(|| panic!("not within {WATCHDOG:?}: {what}"))
    }

    fn rest(&self) -> Option<Duration> {
        WATCHDOG.checked_sub(self.0.elapsed()).filter(|left| !left.is_zero())
    }
}

/// What happens to files and processes.
pub struct Events {
    inotify: OwnedFd,
    folders: Vec<PathBuf>,
    processes: Vec<OwnedFd>,
    patience: Patience,
}

impl Events {
    /// Whatever happens to the files in these folders from now on. A folder that is not there yet is seen to come.
    pub fn in_folders<F: Into<PathBuf>>(folders: impl IntoIterator<Item = F>) -> Self {
        let inotify = inotify::init(CreateFlags::CLOEXEC | CreateFlags::NONBLOCK).unwrap();
        let folders = folders.into_iter().map(Into::into).collect();
        let events = Self { inotify, folders, processes: Vec::new(), patience: Patience::new() };
        events.watch();
        events
    }

    /// … or a process' end.
    pub fn or_end_of(mut self, process: i32) -> Self {
        self.processes.extend(handle(process));
        self
    }

    /// Watches each folder, or the one in which it will come about.
    fn watch(&self) {
        let what = WatchFlags::CREATE | WatchFlags::MODIFY | WatchFlags::ATTRIB | WatchFlags::MOVED_TO;
        let what = what | WatchFlags::DELETE | WatchFlags::DELETE_SELF | WatchFlags::MOVE_SELF;
        let add = |folder: &Path| inotify::add_watch(&self.inotify, folder, what).is_ok();
        self.folders.iter().for_each(|folder| watch(folder, &add));
    }

    /// Waits until something has happened since the last call, or a while; `false`: the test has waited for too long.
    #[must_use]
    pub fn happen(&mut self) -> bool {
        let Some(left) = self.patience.rest() else { return false };
        let all = std::iter::once(&self.inotify).chain(&self.processes);
        let mut all: Vec<PollFd<'_>> = all.map(|one| PollFd::new(one, PollFlags::IN)).collect();
        wait(&mut all, left.min(LOOK_AGAIN));
        let ended: Vec<bool> = all[1..].iter().map(|process| !process.revents().is_empty()).collect();
        // A process ends once.
        let mut ended = ended.into_iter();
        self.processes.retain(|_| ended.next() == Some(false));
        let mut bytes = [MaybeUninit::uninit(); 4096];
        let mut news = inotify::Reader::new(&self.inotify, &mut bytes);
        while news.next().is_ok() {}
        self.watch();
        self.patience.rest().is_some()
    }

    /// Looks whether something is so, and again whenever something has happened.
    pub fn wait_until(mut self, what: &str, mut is_so: impl FnMut() -> bool) {
        while !is_so() {
            assert!(self.happen(), "not within {WATCHDOG:?}: {what}");
        }
    }
}

/// Watches a folder, or the nearest above it.
fn watch(folder: &Path, add: &impl Fn(&Path) -> bool) {
    if !add(folder)
        && let Some(above) = folder.parent()
    {
        watch(above, add);
        // It may have come about before the one above was watched.
        add(folder);
    }
}

/// Becomes readable when the process ends; `None`: it has, and was waited for.
fn handle(process: i32) -> Option<OwnedFd> {
    match pidfd_open(Pid::from_raw(process).unwrap(), PidfdFlags::empty()) {
        Err(Errno::SRCH) => None,
        handle => Some(handle.unwrap()),
    }
}

/// Waits for one of them, or a signal.
fn wait(all: &mut [PollFd<'_>], patience: Duration) {
    match poll(all, Some(&Timespec::try_from(patience).unwrap())) {
        Err(Errno::INTR) => {}
        waited => drop(waited.unwrap()),
    }
}

/// Waits for a child's end; `None`: the test has waited for too long.
pub fn end_of(child: &mut Child) -> Option<ExitStatus> {
    let patience = Patience::new();
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return Some(status);
        }
        wait_for_end(child.id() as i32, patience.rest()?);
    }
}

/// Waits until none of these processes is left.
pub fn wait_until_gone<L: IntoIterator<Item = i32>>(what: &str, mut left: impl FnMut() -> L) {
    let patience = Patience::new();
    while let Some(process) = left().into_iter().next() {
        wait_for_end(process, patience.left(what));
    }
}

fn wait_for_end(process: i32, patience: Duration) {
    if let Some(process) = handle(process) {
        wait(&mut [PollFd::new(&process, PollFlags::IN)], patience);
    }
}

/// Where a community's broker keeps its files, unless it was told of another place for them.
pub fn folders_of(community: &Community) -> Vec<PathBuf> {
    let temporary = std::env::temp_dir().join(format!("elk-{}", rustix::process::geteuid().as_raw()));
    let session = std::env::var_os("XDG_RUNTIME_DIR").map(|folder| PathBuf::from(folder).join("elk"));
    session.into_iter().chain([temporary]).map(|home| home.join(community.as_str())).collect()
}

/// Joins a community as soon as it is served.
pub fn once_served<T>(community: &Community, join: impl FnMut() -> Result<T, ConnectError>) -> Result<T, ConnectError> {
    once_served_in(&folders_of(community), join)
}

/// Joins a community as soon as it is served with its files in one of these folders. A broker takes its socket's name, and
/// then makes the first files there.
pub fn once_served_in<T>(
    folders: &[PathBuf],
    mut join: impl FnMut() -> Result<T, ConnectError>,
) -> Result<T, ConnectError> {
    let nodes = folders.iter().map(|folder| folder.join("nodes"));
    let mut events = Events::in_folders(nodes.chain(folders.iter().cloned()));
    loop {
        match join() {
            Err(ConnectError::NoBroker(_)) if events.happen() => {}
            // One that is just dying.
            Err(ConnectError::Handshake { .. } | ConnectError::Link(_)) if events.patience.rest().is_some() => {}
            joined => return joined,
        }
    }
}
