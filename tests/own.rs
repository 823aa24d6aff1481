//! Nothing but its own: what elk makes lies where nobody else reaches it, and what it removes it has made. All of it in
//! temporary folders of the tests' own.

mod common;

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{Permissions, set_permissions};
use std::os::unix::fs::{PermissionsExt, symlink};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

use common::events::{Events, WATCHDOG, once_served_in, wait_until_gone};
use common::lab::hear;
use common::{Elk, alive, kill, shared_memory_of};
use elk_bus::{Client, Community};
use rustix::process::Signal;

/// A small world that three coarse apps explore in a moment.
const SMALL: &str = "<Scenario name=\"Small\"><Sensor type=\"Simulator\"/><Map type=\"OctoMap\"><Res>0.25 m</Res></Map>\
    <Explorer type=\"ClosestFrontier\"><Mid>0; 0; 0.5</Mid><Dim>3; 3; 3</Dim></Explorer>\
    <Controller type=\"MOOSSim\"/>MORE</Scenario>";

/// A broker, killed with its test.
struct Broker(Child);

impl Drop for Broker {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Broker {
    fn start(elk: &Elk, community: &str, temporary: &Path) -> (Self, Client) {
        let out = std::fs::File::create(elk.folder().join("db.txt")).unwrap();
        let mut command = in_place(elk, &["db", "--community", community], temporary);
        let broker = Self(command.stderr(out).spawn().unwrap());
        (broker, join(community, "witness", &home(temporary)))
    }

    fn stop(mut self) {
        kill(self.0.id() as i32, Signal::TERM);
        assert!(self.0.wait().unwrap().success());
    }
}

/// Joins a community that is served in this folder, as soon as it is.
fn join(community: &str, name: &str, home: &Path) -> Client {
    let community = Community::new(community).unwrap();
    once_served_in(&[home.join(community.as_str())], || Client::connect(&community, name)).unwrap()
}

/// `elk` with a folder for temporary files of its own.
fn in_place(elk: &Elk, arguments: &[&str], temporary: &Path) -> Command {
    let mut command = elk.command(arguments);
    command.env("TMPDIR", temporary).env_remove("XDG_RUNTIME_DIR").stdin(Stdio::null());
    command
}

fn said(output: &Output) -> String {
    String::from_utf8([output.stdout.as_slice(), &output.stderr].concat()).unwrap()
}

/// Everything under a folder, with what is in the files; links are not followed.
fn tree(folder: &Path) -> BTreeMap<PathBuf, Option<Vec<u8>>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        // Whoever leaves a community meanwhile takes a folder along.
        for entry in std::fs::read_dir(next).into_iter().flatten().flatten() {
            let Ok(kind) = entry.file_type() else { continue };
            found.insert(entry.path(), kind.is_file().then(|| std::fs::read(entry.path()).unwrap_or_default()));
            folders.extend(kind.is_dir().then(|| entry.path()));
        }
    }
    found
}

fn home(temporary: &Path) -> PathBuf {
    temporary.join(format!("elk-{}", rustix::process::geteuid().as_raw()))
}

/// A folder with other people's files, and those of another community.
fn inhabited(elk: &Elk) -> PathBuf {
    let temporary = elk.folder().join("temporary");
    std::fs::create_dir_all(temporary.join("thesis")).unwrap();
    std::fs::write(temporary.join("thesis/chapter"), "years of work").unwrap();
    std::fs::create_dir_all(home(&temporary).join("notes")).unwrap();
    std::fs::write(home(&temporary).join("notes/today"), "mine").unwrap();
    set_permissions(home(&temporary), Permissions::from_mode(0o700)).unwrap();
    temporary
}

#[test]
fn bad_names_of_communities_are_refused_and_touch_nothing() {
    let elk = Elk::new("bad-names");
    let temporary = inhabited(&elk);
    let before = tree(elk.folder());
    let long = "x".repeat(49);
    let names = [
        "..", ".", "", "...", "-", "--all", "_", "a/b", "/", "../..", "a b", "a*", "a?", "a\n", "a=b", "ä", ".lab",
        &long,
    ];
    for name in names {
        for command in ["db", "list", "apps", "step"] {
            let output = in_place(&elk, &[command, &format!("--community={name}")], &temporary).output().unwrap();
            let said = said(&output);
            assert_eq!(output.status.code(), Some(2), "{command} {name:?}: {said}");
            assert!(said.contains("is no name for a community") || name.is_empty(), "{name:?}: {said}");
        }
    }
    assert_eq!(tree(elk.folder()), before);
}

#[test]
fn a_community_whose_name_begins_another_s_leaves_that_one_alone() {
    let elk = Elk::new("neighbours");
    let temporary = inhabited(&elk);
    let (short, long) = (elk.community(), format!("{}_q", elk.community()));
    let (running, mut client) = Broker::start(&elk, &long, &temporary);
    client.comms.register_variable("WORDS", 0.0).unwrap();
    client.comms.flush().unwrap();
    let before = shared_memory_of(&elk);
    assert!(!before.is_empty());
    Broker::start(&elk, short, &temporary).0.stop();
    assert_eq!(shared_memory_of(&elk), before);
    // Too long for the page: it goes through the files that are still there.
    let words = "word ".repeat(1000);
    let mut writer = join(&long, "writer", &home(&temporary));
    writer.comms.notify("WORDS", words.as_str()).unwrap();
    writer.comms.flush().unwrap();
    hear(&mut client, "a long text", |mail| (mail.as_text() == Some(&words)).then_some(()));
    drop((client, writer));
    running.stop();
    assert_eq!(std::fs::read_to_string(temporary.join("thesis/chapter")).unwrap(), "years of work");
    assert_eq!(std::fs::read_to_string(home(&temporary).join("notes/today")).unwrap(), "mine");
}

#[test]
fn links_that_somebody_has_planted_are_not_followed() {
    let elk = Elk::new("planted");
    let (temporary, victim) = (elk.folder().join("temporary"), elk.folder().join("victim"));
    std::fs::create_dir(&temporary).unwrap();
    for folder in ["lab", "dead/nodes"] {
        std::fs::create_dir_all(victim.join(folder)).unwrap();
    }
    std::fs::write(victim.join("lab/file"), "mine").unwrap();
    let before = tree(&victim);
    symlink(&victim, home(&temporary)).unwrap();
    let output = in_place(&elk, &["db", "--community", elk.community()], &temporary).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    let words = said(&output);
    assert!(words.contains(&format!("{} is not used: it is a link", home(&temporary).display())), "{words}");
    std::fs::remove_file(home(&temporary)).unwrap();

    // As the folder of this community, and of one that looks dead.
    std::fs::create_dir(home(&temporary)).unwrap();
    symlink(&victim, home(&temporary).join(elk.community())).unwrap();
    symlink(victim.join("dead"), home(&temporary).join("dead")).unwrap();
    let output = in_place(&elk, &["db", "--community", elk.community()], &temporary).output().unwrap();
    assert!(said(&output).contains("it is a link"), "{}", said(&output));
    std::fs::remove_file(home(&temporary).join(elk.community())).unwrap();
    Broker::start(&elk, elk.community(), &temporary).0.stop();
    assert_eq!(tree(&victim), before);
    assert!(home(&temporary).join("dead").is_symlink());
}

#[test]
fn a_folder_that_others_can_write_to_is_refused_with_what_to_do() {
    let elk = Elk::new("open-home");
    let temporary = inhabited(&elk);
    set_permissions(home(&temporary), Permissions::from_mode(0o777)).unwrap();
    let output = in_place(&elk, &["db", "--community", elk.community()], &temporary).output().unwrap();
    let said = said(&output);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("others can write to it (mode 0777)"), "{said}");
    assert!(said.contains(&home(&temporary).display().to_string()), "{said}");
}

#[test]
fn a_folder_that_elk_has_not_marked_is_neither_used_nor_removed() {
    let elk = Elk::new("unmarked");
    let temporary = inhabited(&elk);
    let before = tree(&temporary);
    let output = in_place(&elk, &["db", "--community", "notes"], &temporary).output().unwrap();
    let said = said(&output);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("neither empty nor marked as one that elk made"), "{said}");
    assert_eq!(tree(&temporary), before);
}

#[test]
fn the_folder_of_the_session_comes_first() {
    let elk = Elk::new("session");
    let (runtime, temporary) = (elk.folder().join("runtime"), elk.folder().join("temporary"));
    for folder in [&runtime, &temporary] {
        std::fs::create_dir(folder).unwrap();
        set_permissions(folder, Permissions::from_mode(0o700)).unwrap();
    }
    let mut command = in_place(&elk, &["db", "--community", elk.community()], &temporary);
    let broker = Broker(command.env("XDG_RUNTIME_DIR", &runtime).spawn().unwrap());
    drop(join(elk.community(), "witness", &runtime.join("elk")));
    assert!(runtime.join("elk").join(elk.community()).is_dir() && tree(&temporary).is_empty());
    broker.stop();
    assert!(tree(&runtime).is_empty());
}

#[test]
fn a_client_with_another_temporary_folder_joins_all_the_same() {
    let elk = Elk::new("elsewhere");
    let (here, there) = (elk.folder().join("here"), elk.folder().join("there"));
    std::fs::create_dir(&here).unwrap();
    std::fs::create_dir(&there).unwrap();
    let (broker, _witness) = Broker::start(&elk, elk.community(), &here);
    let words = "word ".repeat(1000);
    let poked = in_place(&elk, &["poke", "WORDS", &words, "--community", elk.community()], &there).output().unwrap();
    assert!(poked.status.success(), "{}", said(&poked));
    assert!(tree(&there).is_empty());
    drop(broker);
}

#[test]
fn what_is_scribbled_over_or_cut_off_in_the_community_s_folder_holds_nobody_up() {
    let elk = Elk::new("scribbled");
    let temporary = inhabited(&elk);
    let (_broker, witness) = Broker::start(&elk, elk.community(), &temporary);
    let all = tree(&home(&temporary).join(elk.community()));
    let counter =
        all.keys().find(|path| path.to_string_lossy().ends_with(".global_mgmt")).expect("the counter of nodes");
    let whole = std::fs::read(counter).unwrap();
    for broken in [vec![0; 16], vec![255; 16], Vec::new(), vec![1; 3]] {
        std::fs::write(counter, &broken).unwrap();
        let refused = elk.refused(&["poke", "X", "1"]);
        assert!(refused.contains("joining the community's shared memory"), "{broken:?}: {refused}");
    }
    std::fs::write(counter, whole).unwrap();
    elk.obeyed(&["poke", "X", "1"]);
    drop(witness);
}

#[test]
fn another_user_can_neither_read_nor_write_anything_of_a_mission() {
    if !rustix::process::geteuid().is_root() {
        println!("another_user_can_neither_…: skipped, only root can look through another user's eyes");
        return;
    }
    let elk = Elk::new("second-user");
    // What keeps the other one out is to be what elk makes, not the folders that the test has made around it.
    let temporary = elk.folder().join("temporary");
    std::fs::create_dir(&temporary).unwrap();
    for (folder, mode) in [(elk.folder(), 0o755), (&temporary, 0o1777)] {
        set_permissions(folder, Permissions::from_mode(mode)).unwrap();
    }
    std::fs::write(elk.folder().join("mission.xml"), SMALL.replace("MORE", "")).unwrap();
    let program = elk.folder().join("elk");
    std::fs::copy(env!("CARGO_BIN_EXE_elk"), &program).unwrap();
    let manual = std::fs::read_to_string(elk.folder().join("mission.xml")).unwrap();
    let manual = manual.replace("name=\"Small\"", "name=\"Small\" type=\"manual\"");
    std::fs::write(elk.folder().join("mission.xml"), manual).unwrap();
    let arguments = ["launch", "mission.xml", "--headless", "--community", elk.community()];
    let launcher = Broker(in_place(&elk, &arguments, &temporary).stdout(Stdio::null()).spawn().unwrap());
    // Every app has lanes by then.
    let place = home(&temporary).join(elk.community());
    let known = || String::from_utf8_lossy(&std::fs::read(place.join("places")).unwrap_or_default()).into_owned();
    Events::in_folders([&place])
        .wait_until("all apps", || ["Sensor", "Map", "Explorer", "Controller"].iter().all(|app| known().contains(app)));

    let mut made: Vec<PathBuf> = shared_memory_of(&elk).iter().map(|name| Path::new("/dev/shm").join(name)).collect();
    made.push(home(&temporary));
    made.extend(tree(&home(&temporary)).into_keys());
    let run = std::fs::read_dir(elk.folder().join("logs")).unwrap().next().unwrap().unwrap().path();
    made.extend(tree(&run).into_keys().chain([run]));
    assert!(made.len() > 50, "{made:?}");
    let look = "for one; do if [ -r \"$one\" ] || [ -w \"$one\" ]; then echo \"$one\"; fi; done";
    let mut other = Command::new("sh");
    let seen = other.args(["-c", look, "sh"]).args(&made).uid(54_321).gid(54_321).output().unwrap();
    assert_eq!(said(&seen), "");
    // By their modes, too, whatever folder they are in; what iceoryx2 makes inside is narrowed a moment later.
    let open = |path: &&PathBuf| path.symlink_metadata().is_ok_and(|found| found.permissions().mode() & 0o077 != 0);
    let mut ours = made.iter().filter(|path| !path.starts_with(elk.folder().join("logs"))).collect::<Vec<_>>();
    let folders: BTreeSet<PathBuf> = ours.iter().filter_map(|path| path.parent()).map(Path::to_owned).collect();
    Events::in_folders(folders).wait_until("modes for the owner alone", || {
        ours.retain(open);
        ours.is_empty()
    });

    for arguments in [["list", "--community"], ["apps", "--community"]] {
        let mut other = Command::new(&program);
        let refused = other.args(arguments).arg(elk.community()).uid(54_321).gid(54_321).current_dir("/").output();
        let refused = refused.unwrap();
        assert_eq!(refused.status.code(), Some(1), "{}", said(&refused));
    }
    kill(launcher.0.id() as i32, Signal::TERM);
    elk.wait_until_deserted();
}

/// A container that is killed, and started again with the same numbers and the same folder for temporary files.
#[test]
fn a_container_that_starts_again_does_not_find_itself_there_already() {
    let elk = Elk::new("container");
    let (temporary, program) = (elk.folder().join("temporary"), env!("CARGO_BIN_EXE_elk"));
    std::fs::create_dir(&temporary).unwrap();
    let manual = SMALL.replace("name=\"Small\"", "name=\"Small\" type=\"manual\"").replace("MORE", "");
    std::fs::write(elk.folder().join("mission.xml"), manual).unwrap();
    let contained = |script: &str| {
        let mut command = Command::new("unshare");
        command.args(["--map-root-user", "--pid", "--fork", "--mount-proc", "sh", "-c", script]);
        command.current_dir(elk.folder()).env("TMPDIR", &temporary).env_remove("XDG_RUNTIME_DIR").stdin(Stdio::null());
        command.output()
    };
    if !contained("true").is_ok_and(|tried| tried.status.success()) {
        println!("a_container_that_…: skipped, `unshare --map-root-user --pid --mount-proc` is not allowed here");
        return;
    }
    let launch = format!("{program} launch mission.xml --headless --community {}", elk.community());
    let places = home(&temporary).join(elk.community()).join("places");
    let wait = format!("for try in $(seq 600); do grep -qs Controller {} && break; sleep 0.1; done", places.display());
    // The shell is the first process: with it, all others are killed.
    let first = contained(&format!("{launch} >first.txt 2>&1 & {wait}; kill -9 -1; exit 0")).unwrap();
    assert!(places.exists(), "{}", said(&first));
    let again = contained(&format!("{launch} --auto 2>&1")).unwrap();
    assert!(said(&again).contains("Small: complete"), "{}", said(&again));
}

/// What a mission says that has so many descriptors.
fn launched_with(elk: &Elk, descriptors: u32) -> (Option<i32>, String) {
    std::fs::write(elk.folder().join("mission.xml"), SMALL.replace("MORE", "")).unwrap();
    let launch = format!("{} launch mission.xml --headless --community {}", env!("CARGO_BIN_EXE_elk"), elk.community());
    let script = format!("ulimit -n {descriptors}; exec {launch}");
    let output = Command::new("sh").args(["-c", &script]).current_dir(elk.folder()).output().unwrap();
    (output.status.code(), said(&output))
}

#[test]
fn a_mission_with_too_few_descriptors_says_how_many_it_needs_and_one_with_few_goes_on() {
    for descriptors in [64, 80, 90, 100, 110, 128] {
        let elk = Elk::new(&format!("descriptors-{descriptors}"));
        let (code, said) = launched_with(&elk, descriptors);
        let complete = code == Some(0) && said.contains("Small: complete");
        let runs = std::fs::read_dir(elk.folder().join("logs")).unwrap().flatten();
        let logs = runs.filter_map(|run| std::fs::read_to_string(run.path().join("db.log")).ok());
        let all = format!("{said}{}", logs.collect::<String>());
        let named = all.contains(&format!("only {descriptors} are allowed")) && all.contains("`ulimit -n 1024`");
        assert!(complete || (code == Some(1) && named), "{descriptors}: {code:?} {all}");
        assert!(complete || descriptors < 110, "{descriptors}: {said}");
        elk.wait_until_deserted();
    }
}

#[test]
fn a_broker_that_cannot_start_names_what_it_lacks() {
    let elk = Elk::new("start");
    for descriptors in [6, 20] {
        let db = format!("{} db --community {}", env!("CARGO_BIN_EXE_elk"), elk.community());
        let script = format!("ulimit -n {descriptors}; exec {db}");
        let output = Command::new("sh").args(["-c", &script]).current_dir(elk.folder()).output().unwrap();
        assert_eq!(output.status.code(), Some(1));
        assert!(said(&output).contains(&format!("only {descriptors} are allowed")), "{}", said(&output));
    }
}

#[test]
fn a_broker_out_of_descriptors_turns_away_with_a_word_and_those_who_say_nothing_go() {
    use std::io::Read;
    use std::os::linux::net::SocketAddrExt;
    use std::os::unix::net::{SocketAddr, UnixStream};
    let elk = Elk::new("silent");
    let script = format!("ulimit -n 40; exec {} db --community {}", env!("CARGO_BIN_EXE_elk"), elk.community());
    let complaints = elk.folder().join("db.txt");
    let log = std::fs::File::create(&complaints).unwrap();
    let mut broker = Broker(Command::new("sh").args(["-c", &script]).stderr(log).spawn().unwrap());
    drop(elk.join("witness"));
    let address = SocketAddr::from_abstract_name(format!("elk/{}", elk.community())).unwrap();
    let silent: Vec<_> = (0..60).map(|_| UnixStream::connect_addr(&address).unwrap()).collect();
    let words = || std::fs::read_to_string(&complaints).unwrap();
    elk.events().wait_until("a complaint", || words().contains("the broker cannot take another connection"));
    let refused = elk.refused(&["list"]);
    assert!(refused.contains("Too many open files") || refused.contains("no room for one more client"), "{refused}");
    // They have five seconds; then there is room again, without anybody's doing.
    for mut stream in silent {
        stream.set_read_timeout(Some(WATCHDOG)).unwrap();
        assert_eq!(stream.read(&mut [0]).unwrap(), 0, "it is sent away");
    }
    elk.obeyed(&["list"]);
    assert_eq!(words().matches("the broker cannot take another connection").count(), 1, "{}", words());
    assert!(broker.0.try_wait().unwrap().is_none());
}

#[test]
fn a_client_that_writes_over_its_page_is_let_go_of_and_nobody_else_is_harmed() {
    use std::os::unix::fs::FileExt;
    let elk = Elk::new("liar");
    let (mut broker, mut witness) = Broker::start(&elk, elk.community(), elk.folder());
    let comes = Events::in_folders([home(elk.folder()).join(elk.community())]);
    let liar =
        Broker(elk.command(&["echo", "*", "--community", elk.community()]).stdout(Stdio::null()).spawn().unwrap());
    let page = || {
        let open = std::fs::read_dir(format!("/proc/{}/fd", liar.0.id())).ok()?.flatten();
        let is_page = |path: &PathBuf| path.to_string_lossy().contains("memfd:elk-client");
        open.map(|entry| entry.path()).find(|path| std::fs::read_link(path).is_ok_and(|link| is_page(&link)))
    };
    comes.wait_until("the client's page", || page().is_some());
    let page = std::fs::File::options().read(true).write(true).open(page().unwrap()).unwrap();
    assert!(page.set_len(0).is_err(), "a page can be cut off under the broker's hands");
    let length = page.metadata().unwrap().len();
    page.write_all_at(&vec![0xff; length as usize], 0).unwrap();
    witness.comms.notify("X", 1.0).unwrap();
    witness.comms.flush().unwrap();
    let words = || std::fs::read_to_string(elk.folder().join("db.txt")).unwrap();
    elk.events().wait_until("a word of the broker", || words().contains("its page cannot be true"));
    assert!(words().contains("letting go of client"), "{}", words());
    elk.obeyed(&["poke", "X", "2"]);
    assert!(broker.0.try_wait().unwrap().is_none());
}

#[test]
fn what_an_app_has_started_in_a_session_of_its_own_ends_with_the_mission() {
    for (test, killed) in [("ends", false), ("killed", true)] {
        let elk = Elk::new(&format!("stray-{test}"));
        let (program, arguments) = elk.idle_client("Daemon");
        let start = "setsid sh -c 'trap \"\" TERM; echo $$ >>strays; exec sleep 1000' &\n";
        elk.script("daemon.sh", &format!("cd {}\n{start}{start}exec {program} {arguments}\n", elk.folder().display()));
        let kind = if killed { " type=\"manual\"" } else { "" };
        let mission = SMALL.replace("MORE", "<App name=\"Daemon\" exec=\"./daemon.sh\"/>");
        let mission = mission.replace("name=\"Small\"", &format!("name=\"Small\"{kind}"));
        let mut launcher = elk.launch(&mission);
        let strays = || -> Vec<i32> {
            let said = std::fs::read_to_string(elk.folder().join("strays")).unwrap_or_default();
            said.lines().filter_map(|line| line.parse().ok()).collect()
        };
        elk.events().wait_until("two strays", || strays().len() == 2);
        if killed {
            launcher.wait_for("Enter takes a step");
            elk.obeyed(&["step"]);
            kill(launcher.id(), Signal::KILL);
        } else {
            let (code, said) = launcher.end();
            assert_eq!(code, Some(0), "{said}");
            assert!(!strays().into_iter().any(alive), "they outlive the mission");
        }
        wait_until_gone("the strays' end", || strays().into_iter().find(|id| alive(*id)));
    }
}
