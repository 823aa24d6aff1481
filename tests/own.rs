//! Nothing but its own: what elk makes lies where nobody else reaches it, and what it removes it has made. All of it in
//! temporary folders of the tests' own.

mod common;

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{Permissions, set_permissions};
use std::os::unix::fs::{PermissionsExt, symlink};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use common::events::{Events, folders_of, once_served_in};
use common::lab::hear;
use common::running::Running;
use common::skip::skip;
use common::small::small;
use common::{Elk, kill, said, shared_memory_of};
use elk_bus::{Client, Community};
use rustix::process::Signal;

/// Starts a community with a folder for temporary files of its own.
fn serve(elk: &Elk, community: &str, temporary: &Path) -> (Running, Client) {
    let broker = Running(in_place(elk, &["db", "--community", community], temporary).spawn().unwrap());
    (broker, join(community, "witness", &home(temporary)))
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

/// Names as somebody would choose them who wants to reach something by them, and what else comes of the same letters.
fn names() -> impl Iterator<Item = String> {
    let known = [
        "..",
        ".",
        "/",
        "/etc/passwd",
        "../../x",
        "a/b",
        "a\0b",
        "*",
        "-rf",
        "a\nb",
        "\x1b[31m",
        "$(id)",
        "%n",
        "elk_",
        "\u{202e}",
    ];
    let known = known.into_iter().map(str::to_owned).chain([String::new(), "x".repeat(256), "/".repeat(10_000)]);
    let letters: Vec<char> = "../\\\0\n*?%$~-_= a1ä\u{1b}\u{202e}".chars().collect();
    let mut state = 9_u64;
    let mut next = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (state >> 33) as usize
    };
    let random = move |_| (0..1 + next() % 40).map(|_| letters[next() % letters.len()]).collect();
    known.chain((0..10_000).map(random))
}

#[test]
fn whatever_clients_and_variables_are_called_no_file_is_made_or_removed_for_it() {
    let elk = Elk::new("names");
    let temporary = inhabited(&elk);
    let (broker, mut witness) = serve(&elk, elk.community(), &temporary);
    let place = home(&temporary).join(elk.community());
    let outside = || tree(elk.folder()).into_iter().filter(|(path, _)| !path.starts_with(&place)).collect::<Vec<_>>();
    let before = outside();
    let said = names().filter(|name| witness.comms.notify(name, 1.0).is_ok()).count();
    witness.comms.flush().unwrap();
    assert!(said > 1000, "{said} were taken");
    for looks in ["list", "graph"] {
        elk.obeyed(&[looks]);
    }
    drop(witness);
    assert_eq!(outside(), before);
    let community = Community::new(elk.community()).unwrap();
    // Each client has files of its own, under its number.
    let some = names().enumerate().filter(|(nth, _)| *nth < 20 || nth % 100 == 0);
    let joined = some.filter(|(_, name)| Client::connect(&community, name).is_ok()).count();
    assert!(joined > 10, "{joined} were let in");
    assert_eq!(outside(), before);
    broker.stop();
    assert_eq!(outside(), before);
    assert_eq!(shared_memory_of(&elk), [""; 0]);
}

#[test]
fn a_community_whose_name_begins_another_s_leaves_that_one_alone() {
    let elk = Elk::new("neighbours");
    let temporary = inhabited(&elk);
    let (short, long) = (elk.community(), format!("{}_q", elk.community()));
    let (running, mut client) = serve(&elk, &long, &temporary);
    client.comms.register("WORDS").unwrap();
    client.comms.flush().unwrap();
    let before = shared_memory_of(&elk);
    assert!(!before.is_empty());
    serve(&elk, short, &temporary).0.stop();
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
    serve(&elk, elk.community(), &temporary).0.stop();
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
    let broker = Running(command.env("XDG_RUNTIME_DIR", &runtime).spawn().unwrap());
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
    let (broker, _witness) = serve(&elk, elk.community(), &here);
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
    let (_broker, witness) = serve(&elk, elk.community(), &temporary);
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
        let why = "only root can look through another user's eyes";
        skip("another_user_can_neither_read_nor_write_anything_of_a_mission", "root", why);
        return;
    }
    let elk = Elk::new("second-user");
    // What keeps the other one out is to be what elk makes, not the folders that the test has made around it.
    let temporary = elk.folder().join("temporary");
    std::fs::create_dir(&temporary).unwrap();
    for (folder, mode) in [(elk.folder(), 0o755), (&temporary, 0o1777)] {
        set_permissions(folder, Permissions::from_mode(mode)).unwrap();
    }
    std::fs::write(elk.folder().join("mission.xml"), small("manual", "")).unwrap();
    let program = elk.folder().join("elk");
    std::fs::copy(env!("CARGO_BIN_EXE_elk"), &program).unwrap();
    let arguments = ["launch", "mission.xml", "--headless", "--community", elk.community()];
    let launcher = Running(in_place(&elk, &arguments, &temporary).stdout(Stdio::null()).spawn().unwrap());
    // Every app has lanes by then.
    let place = home(&temporary).join(elk.community());
    let known = || String::from_utf8_lossy(&std::fs::read(place.join("sessions")).unwrap_or_default()).into_owned();
    Events::in_folders([&place])
        .wait_until("all apps", || ["Sensor", "Map", "Explorer", "Controller"].iter().all(|app| known().contains(app)));

    let mut made: Vec<PathBuf> = shared_memory_of(&elk).iter().map(|name| Path::new("/dev/shm").join(name)).collect();
    made.push(home(&temporary));
    made.extend(tree(&home(&temporary)).into_keys());
    let run = elk.run();
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

#[test]
fn what_a_killed_broker_leaves_goes_with_the_test_that_killed_it() {
    let elk = Elk::new("leftovers");
    let broker = Running(elk.command(&["db", "--community", elk.community()]).stdin(Stdio::null()).spawn().unwrap());
    drop(elk.join("witness"));
    // Its end is a kill.
    drop(broker);
    let left: Vec<PathBuf> = shared_memory_of(&elk).iter().map(|name| Path::new("/dev/shm").join(name)).collect();
    let folders = folders_of(&Community::new(elk.community()).unwrap());
    assert!(!left.is_empty() && folders.iter().any(|folder| folder.exists()), "{left:?} {folders:?}");
    drop(elk);
    assert!(left.iter().chain(&folders).all(|path| !path.exists()), "{left:?} {folders:?}");
}

/// A container that is killed, and started again with the same numbers and the same folder for temporary files.
#[test]
fn a_container_that_starts_again_does_not_find_itself_there_already() {
    let elk = Elk::new("container");
    let (temporary, program) = (elk.folder().join("temporary"), env!("CARGO_BIN_EXE_elk"));
    std::fs::create_dir(&temporary).unwrap();
    std::fs::write(elk.folder().join("mission.xml"), small("manual", "")).unwrap();
    let contained = |script: &str| {
        let mut command = Command::new("unshare");
        command.args(["--map-root-user", "--pid", "--fork", "--mount-proc", "sh", "-c", script]);
        command.current_dir(elk.folder()).env("TMPDIR", &temporary).env_remove("XDG_RUNTIME_DIR").stdin(Stdio::null());
        command.output()
    };
    if !contained("true").is_ok_and(|tried| tried.status.success()) {
        let why = "`unshare --map-root-user --pid --mount-proc` is not allowed here";
        skip("a_container_that_starts_again_does_not_find_itself_there_already", "unshare", why);
        return;
    }
    let launch = format!("{program} launch mission.xml --headless --community {}", elk.community());
    // Everybody is there by then, and is killed.
    let kill = "case \"$line\" in *'Enter takes a step'*) kill -9 -1;; esac";
    let first = contained(&format!("{launch} 2>&1 | while read -r line; do echo \"$line\"; {kill}; done")).unwrap();
    assert!(home(&temporary).join(elk.community()).join("sessions").exists(), "{}", said(&first));
    let again = contained(&format!("{launch} --auto 2>&1")).unwrap();
    assert!(said(&again).contains("Small: complete"), "{}", said(&again));
}
