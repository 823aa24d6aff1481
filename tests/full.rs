//! What runs out, or breaks: room on the disk and in shared memory, descriptors, a client's page. The folders are made small
//! in a mount namespace of their own; where the system allows none, the tests say so and skip.

mod common;

use std::fs::File;
use std::io::Read;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::fs::FileExt;
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::{SocketAddr, UnixStream};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use common::Elk;
use common::events::{Events, Patience, WATCHDOG, folders_of};
use common::running::Running;
use common::skip::skip;
use common::small::small;
use elk_bus::Community;

/// Launches the mission where `folder` is a file system with these options; its exit code, and what it said. `None`: not
/// allowed here. Its folder for temporary files is `temporary`.
fn launch_with_little_room(elk: &Elk, test: &str, folder: &str, options: &str) -> Option<(Option<i32>, String)> {
    let mission = elk.folder().join("mission.xml");
    std::fs::write(&mission, small("auto", "")).unwrap();
    for name in ["logs", "temporary"] {
        std::fs::create_dir(elk.folder().join(name)).unwrap();
    }
    let inside = |script: &str| {
        let mut command = Command::new("unshare");
        let script = format!("mount -t tmpfs -o {options} tmpfs {folder} && {script}");
        command.args(["--map-root-user", "--mount", "sh", "-c", &script]);
        command.current_dir(elk.folder()).stdin(Stdio::null());
        command.env("TMPDIR", elk.folder().join("temporary")).env_remove("XDG_RUNTIME_DIR");
        command
    };
    if !inside("true").output().is_ok_and(|tried| tried.status.success()) {
        skip(test, "unshare", "`unshare --map-root-user --mount` cannot mount a tmpfs here");
        return None;
    }
    let (program, community) = (env!("CARGO_BIN_EXE_elk"), elk.community());
    let launched = inside(&format!("exec {program} launch mission.xml --headless --community {community}"));
    let output = { launched }.output().unwrap();
    let said = [output.stdout, output.stderr].concat();
    Some((output.status.code(), String::from_utf8(said).unwrap()))
}

#[test]
fn a_full_disk_is_reported_and_stops_no_mission() {
    let elk = Elk::new("full-disk");
    let test = "a_full_disk_is_reported_and_stops_no_mission";
    let Some((code, said)) = launch_with_little_room(&elk, test, "logs", "size=64k") else { return };
    assert!(said.contains("cannot write to the log"), "{said}");
    // The whole world was explored, but its map could not be kept.
    let explored =
        "Small: NOT complete: every frontier that can be reached and seen is resolved, but Map could not end";
    assert!(said.contains(explored), "{said}");
    // Whoever reads `summary.json` is not to take the run for one that left it.
    assert!(said.contains("summary.json: No space left on device"), "{said}");
    assert_eq!(code, Some(1), "{said}");
}

#[test]
fn full_shared_memory_is_named_with_what_to_do() {
    let elk = Elk::new("full-shm");
    let test = "full_shared_memory_is_named_with_what_to_do";
    let Some((code, said)) = launch_with_little_room(&elk, test, "/dev/shm", "size=64k") else { return };
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("there is no room for one more client (/dev/shm has only 0 MB left"), "{said}");
    assert!(said.contains("mount -o remount,size="), "{said}");
}

#[test]
fn shared_memory_that_cannot_be_used_and_files_that_run_out_are_named_with_what_to_do() {
    let test = "shared_memory_that_cannot_be_used_and_files_that_run_out_are_named_with_what_to_do";
    let cases = [
        ("/dev/shm", "ro", "(/dev/shm cannot be written to: Read-only file system", "mount -t tmpfs"),
        ("/dev/shm", "nr_inodes=8", "(/dev/shm can hold only ", "nr_inodes="),
        ("temporary", "nr_inodes=3", "can hold only ", "set XDG_RUNTIME_DIR or TMPDIR to a folder of another"),
        ("temporary", "nr_inodes=12", "can hold only ", "set XDG_RUNTIME_DIR or TMPDIR to a folder of another"),
    ];
    for (number, (folder, options, resource, remedy)) in cases.into_iter().enumerate() {
        let elk = Elk::new(&format!("unusable-{number}"));
        let Some((code, said)) = launch_with_little_room(&elk, test, folder, options) else { return };
        assert_eq!(code, Some(1), "{folder} {options}: {said}");
        assert!(said.contains(resource) && said.contains(remedy), "{folder} {options}: {said}");
    }
}

/// `elk` as a user that may have one process of one thread.
fn alone(elk: &Elk, program: &Path, arguments: &[&str]) -> String {
    let mut command = Command::new("prlimit");
    command.arg("--nproc=1").arg(program).args(arguments).uid(54_322).gid(54_322);
    command.current_dir(elk.folder()).env("TMPDIR", elk.folder()).env_remove("XDG_RUNTIME_DIR").stdin(Stdio::null());
    let output = command.output().unwrap();
    let said = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
    assert_eq!(output.status.code(), Some(1), "{said}");
    said
}

#[test]
fn who_may_start_no_process_and_no_thread_is_told_so_with_what_to_do() {
    if !rustix::process::geteuid().is_root() {
        let why = "only root can become a user without processes";
        skip("who_may_start_no_process_and_no_thread_is_told_so_with_what_to_do", "root", why);
        return;
    }
    let elk = Elk::new("alone");
    let program = elk.folder().join("elk");
    std::fs::copy(env!("CARGO_BIN_EXE_elk"), &program).unwrap();
    std::fs::set_permissions(elk.folder(), std::fs::Permissions::from_mode(0o1777)).unwrap();
    std::fs::write(elk.folder().join("mission.xml"), small("auto", "")).unwrap();
    let community = ["--community", elk.community()];
    let launch = [&["launch", "mission.xml", "--headless"], &community[..]].concat();
    for arguments in [[&["db"], &community[..]].concat(), launch] {
        let said = alone(&elk, &program, &arguments);
        assert!(said.contains("no more processes and threads are allowed to this user"), "{arguments:?}: {said}");
        assert!(said.contains("`ulimit -u`"), "{arguments:?}: {said}");
    }
    let mut broker = Command::new(&program);
    broker.arg("db").args(community).uid(54_322).gid(54_322).current_dir(elk.folder()).env("TMPDIR", elk.folder());
    let _broker = Running(broker.env_remove("XDG_RUNTIME_DIR").stdin(Stdio::null()).spawn().unwrap());
    let patience = Patience::new();
    let said = loop {
        let said = alone(&elk, &program, &[&["list"], &community[..]].concat());
        if !said.contains("no community") {
            break said;
        }
        patience.left("the broker");
    };
    assert!(said.contains("cannot be joined: no thread for that") && said.contains("`ulimit -u`"), "{said}");
}

#[test]
fn what_elk_makes_its_owner_can_read_whatever_the_umask_says() {
    let elk = Elk::new("umask");
    let (code, said) = elk.launch_limited(&small("auto", ""), "umask 777").end();
    assert_eq!(code, Some(0), "{said}");
    let made = std::fs::read_dir(elk.run()).unwrap().map(|entry| entry.unwrap().path()).chain([elk.run()]);
    for path in made {
        let mode = path.metadata().unwrap().permissions().mode() & 0o777;
        let owner = if path.is_dir() { 0o700 } else { 0o600 };
        assert_eq!(mode, owner, "{}: {mode:04o}", path.display());
    }
}

#[test]
fn words_that_cannot_be_written_change_no_exit_code() {
    let full = File::options().write(true).open("/dev/full").unwrap();
    let ended = Elk::new("dev-full").command(&["check", "no-such-mission.xml"]).stderr(full).status().unwrap();
    assert_eq!(ended.code(), Some(1));
}

/// A broker with the limits that a shell command sets.
fn broker(elk: &Elk, limits: &str) -> Running {
    let words = File::create(elk.folder().join("db.txt")).unwrap();
    Running(elk.limited(limits, &["db", "--community", elk.community()]).stderr(words).spawn().unwrap())
}

/// All that it has said.
fn words_of_broker(elk: &Elk) -> String {
    std::fs::read_to_string(elk.folder().join("db.txt")).unwrap()
}

#[test]
fn a_mission_with_too_few_descriptors_says_how_many_it_needs_and_one_with_few_goes_on() {
    for descriptors in [64, 80, 90, 100, 110, 128] {
        let elk = Elk::new(&format!("descriptors-{descriptors}"));
        let (code, said) = elk.launch_limited(&small("auto", ""), &format!("ulimit -n {descriptors}")).end();
        let complete = code == Some(0) && said.contains("Small: complete");
        let log = std::fs::read_to_string(elk.run().join("db.log")).unwrap_or_default();
        let all = format!("{said}{log}");
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
        let db = ["db", "--community", elk.community()];
        let output = elk.limited(&format!("ulimit -n {descriptors}"), &db).output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.contains(&format!("only {descriptors} are allowed")), "{said}");
    }
}

#[test]
fn a_broker_out_of_descriptors_turns_away_with_a_word_and_those_who_say_nothing_go() {
    let elk = Elk::new("silent");
    let mut broker = broker(&elk, "ulimit -n 48");
    drop(elk.join("witness"));
    let address = SocketAddr::from_abstract_name(format!("elk/{}", elk.community())).unwrap();
    let silent: Vec<_> = (0..60).map(|_| UnixStream::connect_addr(&address).unwrap()).collect();
    let words = || words_of_broker(&elk);
    elk.events().wait_until("a complaint", || words().contains("the broker cannot take another connection"));
    let refused = elk.refused(&["list"]);
    assert!(refused.contains("Too many open files") || refused.contains("no room for one more client"), "{refused}");
    // They have five seconds; then there is room again, without anybody's doing.
    for mut stream in silent {
        stream.set_read_timeout(Some(WATCHDOG)).unwrap();
        // With a word or without.
        stream.read_to_end(&mut Vec::new()).expect("its end");
    }
    // Whose connection has ended holds descriptors for a moment yet; being let in is the only sign that it does not.
    let patience = Patience::new();
    while elk.order(&["list"]).0 != Some(0) {
        patience.left("room");
    }
    assert_eq!(words().matches("the broker cannot take another connection").count(), 1, "{}", words());
    assert!(broker.0.try_wait().unwrap().is_none());
}

#[test]
fn a_client_that_writes_over_its_page_is_let_go_of_and_nobody_else_is_harmed() {
    let elk = Elk::new("liar");
    let mut broker = broker(&elk, "true");
    let mut witness = elk.join("witness");
    let comes = Events::in_folders(folders_of(&Community::new(elk.community()).unwrap()));
    let liar =
        Running(elk.command(&["echo", "*", "--community", elk.community()]).stdout(Stdio::null()).spawn().unwrap());
    let page = || {
        let open = std::fs::read_dir(format!("/proc/{}/fd", liar.0.id())).ok()?.flatten();
        let is_page = |path: &PathBuf| path.to_string_lossy().contains("memfd:elk-client");
        open.map(|entry| entry.path()).find(|path| std::fs::read_link(path).is_ok_and(|link| is_page(&link)))
    };
    comes.wait_until("the client's page", || page().is_some());
    let page = File::options().read(true).write(true).open(page().unwrap()).unwrap();
    assert!(page.set_len(0).is_err(), "a page can be cut off under the broker's hands");
    let length = page.metadata().unwrap().len();
    page.write_all_at(&vec![0xff; length as usize], 0).unwrap();
    witness.comms.notify("X", 1.0).unwrap();
    witness.comms.flush().unwrap();
    let words = || words_of_broker(&elk);
    elk.events().wait_until("a word of the broker", || words().contains("its page cannot be true"));
    assert!(words().contains("letting go of client"), "{}", words());
    elk.obeyed(&["poke", "X", "2"]);
    assert!(broker.0.try_wait().unwrap().is_none());
}
