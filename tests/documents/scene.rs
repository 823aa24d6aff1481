//! A reader's machine: a folder that looks like a clone in which everything is built, a shell that remembers, and
//! whatever runs in other terminals.

use std::fs::Permissions;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command as Process, Stdio};

use rustix::process::{Pid, Signal, kill_process_group};

use crate::common::lab::{hear, wait_for_clients};
use crate::common::{Elk, Launcher, free_port};
use crate::page::{Command, Part};

/// The repository.
const CLONE: &str = env!("CARGO_MANIFEST_DIR");

/// Cargo, but for what a test cannot do twice: elk is built already, and crates of one's own are built as the tests are,
/// from what is there.
const CARGO: &str = r#"
if [ "$PWD" = "$SCENE" ]; then
    case "$*" in
        "build --release") exit 0;;
        "run --release -- "*) shift 3; exec elk "$@";;
        *) echo "the tests know no cargo $*"; exit 1;;
    esac
fi
command=$1; shift
set -- $(printf '%s\n' "$@" | sed '/^--release$/d')
# Another scene builds a crate of the same name in the same place: each takes its own away before the other builds.
exec 9> "$BUILT/documents.lock" && flock 9
CARGO_TARGET_DIR=$(dirname "$BUILT") "$REAL_CARGO" "$command" --offline "$@" 9>&-
code=$?
name=$(sed -n 's/^name = "\(.*\)"/\1/p' Cargo.toml | head -1)
mkdir -p target/release
[ ! -e "$BUILT/$name" ] || { cp "$BUILT/$name" target/release/new && mv target/release/new "target/release/$name"; }
exit $code
"#;

/// Graphviz' `dot`, but for the drawing.
const DOT: &str = "grep -q '^digraph' && echo '<svg/>'";

/// A box of two metres whose faces look inward, as a reader may have it.
const ROOM: &str = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nv 0 0 2\nv 2 0 2\nv 2 2 2\nv 0 2 2\n\
                    f 1 2 3 4\nf 8 7 6 5\nf 5 6 2 1\nf 6 7 3 2\nf 7 8 4 3\nf 8 5 1 4\n";

/// How a command is given, and how it ends.
enum Course {
    /// It ends by itself.
    Ends,
    /// It goes on until Ctrl-C, which the reader presses once it has said something.
    Says(&'static str),
    /// It goes on until Ctrl-C, which the reader presses once a client whose name begins so is there.
    Joins(&'static str),
    /// It is left running behind the prompt, as a client of this name.
    Background,
    /// It is not given here, and why.
    Elsewhere,
}

impl Course {
    fn of(command: &str) -> Self {
        let command = command.split(" # ").next().unwrap().trim();
        let words: Vec<&str> = command.split_whitespace().collect();
        let has = |word: &str| words.contains(&word);
        match words[..] {
            // The tests run it, in which this one is.
            ["cargo", "test", "--workspace"] => Self::Elsewhere,
            ["elk", "db", .., "&"] => Self::Background,
            ["elk", "db", ..] => Self::Joins(""),
            ["elk", "launch", ..] if has("--pace") => Self::Says(" scans"),
            ["elk", "launch", "mission-files/thesis-listing-2.xml"] => Self::Says("Enter takes a step"),
            ["elk", "sensor", "--type", "Stereo", ..] => Self::Ends,
            ["elk", "sensor", ..] => Self::Joins("Sensor"),
            ["elk", "filter", ..] => Self::Joins("Filter"),
            ["elk", "map", ..] => Self::Joins("Map"),
            ["elk", "explorer", ..] => Self::Joins("Explorer"),
            ["elk", "controller", ..] => Self::Joins("Controller"),
            ["elk", "logger", ..] => Self::Joins("Logger"),
            ["elk", "pipe", ..] => Self::Joins("Shouter"),
            ["elk", "log", "record", ..] => Self::Joins("record-"),
            ["elk", "echo", ..] if !has("--count") => Self::Says("\n"),
            ["elk", "hz", ..] => Self::Says("RATE"),
            ["elk", "bw", ..] => Self::Says("BANDWIDTH"),
            ["elk", "top"] => Self::Says("CLIENT"),
            ["elk", "view", "--foxglove"] => Self::Says("ws://"),
            ["elk", "view", ..] => Self::Says("http://"),
            _ => Self::Ends,
        }
    }
}

/// A command in a terminal. What it has started beside it ends with it.
struct Terminal {
    /// Its group of processes.
    group: Pid,
    program: Option<Launcher>,
}

impl Terminal {
    fn wait_until(&mut self, what: &str, is_right: impl Fn(&str) -> bool) {
        self.program.as_mut().unwrap().wait_until(what, is_right);
    }

    /// Sends a signal to all of its processes, as a terminal does.
    fn signal(&self, signal: Signal) {
        // They may have ended.
        let _ = kill_process_group(self.group, signal);
    }

    /// Waits for the command's end; its exit code, and all that was said.
    fn end(&mut self) -> (Option<i32>, String) {
        self.program.take().unwrap().end_of_several(5)
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        self.signal(Signal::KILL);
    }
}

/// The machine.
pub struct Scene {
    elk: Elk,
    root: PathBuf,
    /// How many commands were given.
    given: usize,
}

impl Scene {
    /// `name` tells it from the others that run at the same time.
    pub fn new(name: &str) -> Self {
        let elk = Elk::new(name);
        let root = elk.folder().join("clone");
        let made = |path: &Path| std::fs::create_dir_all(path).unwrap();
        ["clone/target", "home", "bin", "shell"].iter().for_each(|folder| made(&elk.folder().join(folder)));
        for shared in ["tests", "docs"] {
            symlink(Path::new(CLONE).join(shared), root.join(shared)).unwrap();
        }
        put_missions(&root.join("mission-files"));
        symlink(built(), root.join("target/release")).unwrap();
        std::fs::write(root.join("room.obj"), ROOM).unwrap();
        for (name, text) in [("cargo", CARGO), ("dot", DOT)] {
            let file = elk.folder().join("bin").join(name);
            std::fs::write(&file, format!("#!/bin/sh\n{text}\n")).unwrap();
            std::fs::set_permissions(&file, Permissions::from_mode(0o755)).unwrap();
        }
        let path =
            format!("{}:{}:{}", elk.folder().join("bin").display(), built().display(), std::env::var("PATH").unwrap());
        std::fs::write(elk.folder().join("shell/environment"), format!("export PATH='{path}'\n")).unwrap();
        std::fs::write(elk.folder().join("shell/folder"), root.to_str().unwrap()).unwrap();
        Self { elk, root, given: 0 }
    }

    /// The folder that looks like a clone.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The output of a command of elk that succeeds.
    pub fn elk(&self, arguments: &[&str]) -> String {
        let out = self.elk.command(arguments).current_dir(&self.root).output().unwrap();
        assert!(out.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&out.stderr));
        String::from_utf8(out.stdout).unwrap()
    }

    /// Gives the commands of a part of a page, one after another.
    pub fn go_through(&mut self, part: &Part) {
        let beside = part.beside.as_ref().map(|command| self.start_beside(command));
        let background: Vec<Terminal> = part.commands.iter().filter_map(|command| self.give(command)).collect();
        if let Some(mut mission) = beside {
            mission.signal(Signal::INT);
            mission.end();
        }
        for mut terminal in background {
            terminal.signal(Signal::TERM);
            terminal.end();
        }
        // The shell of a new part is in the clone again.
        std::fs::write(self.elk.folder().join("shell/folder"), self.root.to_str().unwrap()).unwrap();
    }

    /// Starts a mission that runs meanwhile, and waits until its robot moves.
    fn start_beside(&mut self, command: &str) -> Terminal {
        let terminal = self.open(command);
        let mut reader = self.elk.join("reader");
        reader.comms.register("PROGRES*").unwrap();
        hear(&mut reader, "a step of the robot", |mail| mail.key().starts_with("PROGRESS").then_some(()));
        terminal
    }

    /// Gives a command, and sees that it does what the page says; what it has left running.
    fn give(&mut self, command: &Command) -> Option<Terminal> {
        let course = Course::of(&command.line);
        if matches!(course, Course::Elsewhere) {
            return None;
        }
        let mut terminal = self.open(&command.line);
        match course {
            Course::Ends | Course::Background | Course::Elsewhere => {}
            Course::Says(words) => {
                terminal
                    .wait_until(&command.line, |said| said.contains(words) && self.missing(command, said).is_none());
            }
            Course::Joins("") => drop(self.elk.join("reader")),
            Course::Joins(name) => {
                wait_for_clients(&self.elk, name, |clients| clients.iter().any(|client| client.starts_with(name)));
            }
        }
        if matches!(course, Course::Says(_) | Course::Joins(_)) {
            terminal.signal(Signal::INT);
        }
        if matches!(course, Course::Background) {
            drop(self.elk.join("reader"));
            return Some(terminal);
        }
        let (code, said) = terminal.end();
        let fails = command.shown.first().is_some_and(|line| line.starts_with("elk: "));
        match course {
            // Whoever stops a mission has not explored all of it.
            Course::Says(" scans" | "Enter takes a step") => {}
            _ => assert_eq!(code, Some(i32::from(fails)), "{}\n{said}", command.line),
        }
        let missing = self.missing(command, &said);
        assert_eq!(missing, None, "{} does not show it, but\n{said}", command.line);
        None
    }

    /// What the page says that is shown, and is not. An error is shown as it is printed; in other lines numbers differ,
    /// and there may be more of them.
    fn missing<'a>(&self, command: &'a Command, said: &str) -> Option<&'a String> {
        let said = said.replace(self.elk.community(), "elk");
        let starts: Vec<_> = said.lines().map(start).collect();
        command.shown.iter().find(|line| match line.starts_with("elk: ") {
            true => !said.lines().any(|shown| shown == *line),
            false => !starts.contains(&start(line)),
        })
    }

    /// Starts a line in the shell, in a group of processes of its own. The shell waits for what it leaves running.
    fn open(&mut self, line: &str) -> Terminal {
        self.find_runs(line);
        let shell = self.elk.folder().join("shell");
        let script = format!(
            "cd \"$(cat {0}/folder)\" && . {0}/environment\n{line}\n\
             code=$?\nexport -p > {0}/environment\npwd > {0}/folder\n\
             trap : TERM\nwait\nwait\nexit $code\n",
            shell.display()
        );
        let mut bash = Process::new("bash");
        bash.args(["-o", "pipefail", "-c", &script]).process_group(0).stdin(Stdio::null());
        bash.env("HOME", self.elk.folder().join("home")).env("ELK_COMMUNITY", self.elk.community());
        // The reader has a home of their own, Cargo's things are where they are.
        for (name, folder) in [("CARGO_HOME", ".cargo"), ("RUSTUP_HOME", ".rustup")] {
            let usual = || std::env::home_dir().unwrap_or_default().join(folder).into();
            bash.env(name, std::env::var_os(name).unwrap_or_else(usual));
        }
        bash.env("SCENE", &self.root).env("BUILT", built()).env("REAL_CARGO", env!("CARGO"));
        self.given += 1;
        println!("{line}");
        let program = self.elk.spawn(&format!("said-{}.txt", self.given), bash);
        Terminal { group: Pid::from_raw(program.id()).unwrap(), program: Some(program) }
    }

    /// A run that the page names, and which is not there, stands for the latest one of that mission that was complete.
    fn find_runs(&self, line: &str) {
        for word in line.split_whitespace().filter(|word| word.starts_with("logs/")) {
            let name = word.split('/').nth(1).unwrap();
            let link = self.root.join("logs").join(name);
            if !link.exists() {
                symlink(self.latest_run(name.split('-').next().unwrap()), link).unwrap();
            }
        }
    }

    fn latest_run(&self, mission: &str) -> PathBuf {
        let is_right = |run: &PathBuf| {
            let name = run.file_name().unwrap().to_str().unwrap();
            let summary = std::fs::read_to_string(run.join("summary.json")).unwrap_or_default();
            !run.is_symlink()
                && (name.starts_with(mission) || mission == "RUN")
                && summary.contains("\"complete\": true")
        };
        let runs = std::fs::read_dir(self.root.join("logs")).unwrap().map(|entry| entry.unwrap().path());
        runs.filter(is_right).max_by_key(|run| run.metadata().unwrap().modified().unwrap()).expect("a run")
    }
}

/// Puts the missions of the clone into a folder. The port at which that of the thesis lets clients of MOOS' in is a reader's own,
/// and here perhaps somebody else's.
fn put_missions(folder: &Path) {
    std::fs::create_dir(folder).unwrap();
    for mission in std::fs::read_dir(Path::new(CLONE).join("mission-files")).unwrap() {
        let (from, name) = mission.map(|mission| (mission.path(), mission.file_name())).unwrap();
        if name != "thesis-listing-2.xml" {
            symlink(from, folder.join(name)).unwrap();
            continue;
        }
        let port = free_port().port().to_string();
        std::fs::write(folder.join(name), std::fs::read_to_string(from).unwrap().replace("9000", &port)).unwrap();
    }
}

/// Where the programs are.
fn built() -> &'static Path {
    Path::new(env!("CARGO_BIN_EXE_elk")).parent().unwrap()
}

/// The first two words of a line, every number a `#`.
fn start(line: &str) -> Vec<String> {
    let without_numbers = |word: &str| match word.starts_with(|first: char| first.is_ascii_digit()) {
        true => "#".to_owned(),
        false => word.to_owned(),
    };
    line.split_whitespace().take(2).map(without_numbers).collect()
}
