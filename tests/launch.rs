//! Launches as people do them: the real program, real processes, real shared memory.

mod common;

use common::events::wait_until_gone;
use common::lab::wait_for_clients;
use common::small::small;
use common::{Elk, alive, kill, processes_of, shared_memory_of};
use rustix::process::Signal;

/// What the launcher says once everyone of an idle mission is there.
const ALL_ALIVE: &str = "alive: Controller Explorer Map Sensor";

/// A mission in which nobody ever commands a pose: its controller is an idle client of the bus. `explorer` is an idle
/// one, too, or what a test wants.
fn idle(elk: &Elk, explorer: Option<&str>) -> String {
    let (program, controller) = elk.idle_client("Controller");
    let explorer = explorer.unwrap_or("<Explorer type=\"Potential\"><Mid>0;0;0</Mid><Dim>5;4;4</Dim></Explorer>");
    format!(
        "<Scenario name=\"Idle\"><Sensor type=\"Simulator\"/><Map type=\"OctoMap\"/>{explorer}\
         <Controller exec=\"{program}\" args=\"{controller}\"/><Logger type=\"none\"/></Scenario>"
    )
}

fn assert_nothing_is_left(elk: &Elk) {
    assert_eq!(processes_of(elk), [0; 0]);
    assert_eq!(shared_memory_of(elk), [""; 0]);
}

#[test]
fn an_executable_that_is_not_there_fails_the_launch_by_name() {
    let elk = Elk::new("not-there");
    let said = elk.launch_and_fail(&idle(&elk, Some("<Explorer exec=\"./no-such-explorer\"/>")));
    assert!(said.contains("Explorer: "), "{said}");
    assert!(said.contains("no-such-explorer cannot be run: No such file or directory"), "{said}");
    assert_nothing_is_left(&elk);
}

#[test]
fn an_executable_that_dies_at_once_fails_the_launch_with_its_last_words() {
    let elk = Elk::new("dies-at-once");
    elk.script("dies.sh", "echo my last words >&2\nexit 3\n");
    let said = elk.launch_and_fail(&idle(&elk, Some("<Explorer exec=\"./dies.sh\"/>")));
    assert!(said.contains("Explorer ended before it registered: exit code 3"), "{said}");
    assert!(said.contains("my last words"), "{said}");
    assert_nothing_is_left(&elk);
}

/// Regression: nothing was said of a program that ends at once, and well, without having been an app.
#[test]
fn a_program_that_ends_at_once_without_joining_is_named() {
    let elk = Elk::new("ends-at-once");
    let (code, said) = elk.launch(&small("auto", "<App name=\"Lamp\" exec=\"/bin/true\"/>")).end();
    assert_eq!(code, Some(0), "the mission goes on: {said}");
    let right = "right is one that joins the bus and stays (`elk new` makes one)";
    assert!(said.contains("Lamp has ended, exit code 0, and never joined the community: "), "{said}");
    assert!(said.contains(right), "{said}");
    let said = elk.launch_and_fail(&idle(&elk, Some("<Explorer exec=\"/bin/true\"/>")));
    assert!(
        said.contains("Explorer ended before it registered: exit code 0, as a program does that is no app"),
        "{said}"
    );
    assert!(said.contains(right), "{said}");
}

/// Regression: an explorer that computes for long was alive and nothing else, and killed 5 s after Ctrl-C.
#[test]
fn an_explorer_that_plans_for_long_is_named_and_ends_when_it_is_asked_to() {
    let elk = Elk::new("plans-for-long");
    let more = "<Solver>thesis</Solver><Tolerance>1e-300</Tolerance>";
    let text = small("auto", "").replace("\"ClosestFrontier\">", &format!("\"Potential\">{more}"));
    let mut launcher = elk.launch(&text.replace("0.25 m", "0.02 m"));
    launcher.wait_for("Explorer: planning for ");
    kill(launcher.id(), Signal::INT);
    let (_, said) = launcher.end();
    assert!(said.contains("NOT complete: stopped"), "{said}");
    assert!(!said.contains("good order"), "{said}");
}

#[test]
fn an_app_that_is_killed_in_the_midst_of_it_fails_the_mission() {
    let elk = Elk::new("killed-app");
    let mut launcher = elk.launch(&idle(&elk, None));
    launcher.wait_for(ALL_ALIVE);
    kill(launcher.process_of("Map"), Signal::KILL);
    let (code, said) = launcher.end();
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("Map ended before the mission was over: signal 9 (SIGKILL)"), "{said}");
    assert_nothing_is_left(&elk);
}

#[test]
fn a_broker_that_is_killed_is_started_again_and_everybody_comes_back() {
    let elk = Elk::new("killed-broker");
    let mut launcher = elk.launch(&idle(&elk, None));
    launcher.wait_for(ALL_ALIVE);
    let apps = ["Sensor", "Map", "Explorer", "Controller"].map(|app| elk.process(app));
    let broker = elk.process("db");
    kill(broker, Signal::KILL);
    launcher.wait_for("db ended: signal 9 (SIGKILL); it is started again");
    launcher.wait_for("db is back, restarted (1 of 5 in 60 s)");
    assert_ne!(elk.process("db"), broker);
    assert_eq!(elk.row("db")["restarts"], 1);
    assert_eq!(["Sensor", "Map", "Explorer", "Controller"].map(|app| elk.process(app)), apps);
    // They are on the bus, and not only alive.
    let all = ["Sensor", "Map", "Explorer", "Controller", "launcher"];
    wait_for_clients(&elk, "everyone", |clients| all.iter().all(|name| clients.contains(name)));
    kill(launcher.id(), Signal::INT);
    let (_, said) = launcher.end();
    assert!(said.contains("NOT complete: stopped"), "{said}");
    assert_nothing_is_left(&elk);
}

#[test]
fn a_broker_that_dies_too_often_ends_the_mission() {
    let elk = Elk::new("broker-too-often");
    let mission = idle(&elk, None).replace("<Scenario", "<Scenario broker-restarts=\"1\"");
    let mut launcher = elk.launch(&mission);
    launcher.wait_for(ALL_ALIVE);
    kill(elk.process("db"), Signal::KILL);
    launcher.wait_for("db is back");
    kill(elk.process("db"), Signal::KILL);
    let (code, said) = launcher.end();
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("db ended before the mission was over: signal 9 (SIGKILL)"), "{said}");
    assert!(said.contains("it had been started again 1 times in 60 s, which is its limit"), "{said}");
    assert_eq!(processes_of(&elk), [0; 0]);
    // What the dead broker could not put away, the next run does.
    let mut next = elk.launch(&idle(&elk, None));
    next.wait_for(ALL_ALIVE);
    kill(next.id(), Signal::INT);
    next.end();
    assert_nothing_is_left(&elk);
}

#[test]
fn a_person_stops_a_mission_and_nobody_is_left() {
    let elk = Elk::new("stopped");
    let mut launcher = elk.launch(&idle(&elk, None));
    launcher.wait_for(ALL_ALIVE);
    kill(launcher.id(), Signal::INT);
    let (code, said) = launcher.end();
    assert_eq!(code, Some(1), "{said}");
    assert!(said.ends_with("NOT complete: stopped\n") || said.contains("NOT complete: stopped\n  all of it"), "{said}");
    assert!(!said.contains("killed"), "{said}");
    assert_nothing_is_left(&elk);
}

#[test]
fn nobody_is_left_after_the_launcher_is_killed() {
    let elk = Elk::new("killed-launcher");
    // It listens to no signal, and neither does its child.
    let (program, client) = elk.idle_client("Explorer");
    elk.script("deaf.sh", &format!("trap '' TERM INT\nsleep 1000 &\n{program} {client}\nwait\n"));
    let mut launcher = elk.launch(&idle(&elk, Some("<Explorer exec=\"./deaf.sh\"/>")));
    launcher.wait_for(ALL_ALIVE);
    let descendants = launcher.descendants();
    // Guard, broker, sensor, map, script, its two children, controller.
    assert_eq!(descendants.len(), 8);
    kill(launcher.id(), Signal::KILL);
    launcher.end();
    wait_until_gone("everyone's end", || descendants.iter().copied().find(|id| alive(*id)));
    assert_nothing_is_left(&elk);
}

#[test]
fn a_failing_app_is_started_again_where_the_mission_says_so() {
    let elk = Elk::new("restarted");
    let (program, client) = elk.idle_client("Explorer");
    let tried = elk.folder().join("tried");
    let tried = tried.display();
    // Fails the first time, stays the second.
    let script = format!("[ -e {tried} ] || {{ touch {tried}; echo alas; exit 1; }}\nexec {program} {client}\n");
    elk.script("second.sh", &script);
    let mission = idle(&elk, Some("<Explorer exec=\"./second.sh\" restart=\"on-failure\"/>"));
    let mut launcher = elk.launch(&mission);
    launcher.wait_for(ALL_ALIVE);
    let row = elk.row("Explorer");
    assert_eq!((&row["restarts"], &row["last_exit"]), (&1.into(), &"exit code 1; last line: alas".into()), "{row}");
    kill(launcher.id(), Signal::TERM);
    let (_, said) = launcher.end();
    assert!(said.contains("Explorer ended: exit code 1; last line: alas; it is started again in 0.1 s"), "{said}");
}

#[test]
fn an_app_that_fails_too_often_fails_the_mission() {
    let elk = Elk::new("app-too-often");
    elk.script("dies.sh", "echo alas\nexit 3\n");
    let explorer = "<Explorer exec=\"./dies.sh\" restart=\"always\" restarts=\"2\" restart-window=\"100\"/>";
    let said = elk.launch_and_fail(&idle(&elk, Some(explorer)));
    assert_eq!(said.matches("Explorer ended: exit code 3; last line: alas; it is started again").count(), 2, "{said}");
    assert!(said.contains("it had been started again 2 times in 100 s, which is its limit"), "{said}");
    assert!(!said.contains("Explorer is back"), "{said}");
    assert_nothing_is_left(&elk);
}

#[test]
fn an_app_that_hangs_is_killed_and_started_again() {
    let elk = Elk::new("hangs");
    let (program, controller) = elk.idle_client("Explorer");
    let explorer = format!("<Explorer exec=\"{program}\" args=\"{controller}\" restart=\"always\" health=\"3\"/>");
    let mut launcher = elk.launch(&idle(&elk, Some(&explorer)));
    launcher.wait_for(ALL_ALIVE);
    let hung = elk.process("Explorer");
    kill(hung, Signal::STOP);
    launcher.wait_for("Explorer ended: killed, no sign of life for");
    launcher.wait_for("Explorer is back, restarted (1 of 5 in 60 s)");
    assert!(!alive(hung));
    kill(launcher.id(), Signal::INT);
    launcher.end();
    assert_nothing_is_left(&elk);
}

#[test]
fn a_second_launch_of_a_community_is_refused_and_the_first_goes_on() {
    let elk = Elk::new("second-launch");
    let mut launcher = elk.launch(&idle(&elk, None));
    launcher.wait_for(ALL_ALIVE);
    let before = launcher.descendants();
    let file = elk.folder().join("mission.xml").display().to_string();
    let said = elk.refused(&["launch", &file, "--headless"]);
    let expected =
        format!("elk: community {} is launched already, by process {} of user ", elk.community(), launcher.id());
    assert!(said.starts_with(&expected) && said.lines().count() == 1, "{said}");
    let said = elk.refused(&["attach"]);
    assert!(said.starts_with(&expected) && said.lines().count() == 1, "{said}");
    assert_eq!(launcher.descendants(), before);
    assert_eq!(std::fs::read_dir(elk.folder().join("logs")).unwrap().count(), 1);
    kill(launcher.id(), Signal::INT);
    launcher.end();
    assert_nothing_is_left(&elk);
}

#[test]
fn a_broker_of_somebody_else_keeps_a_mission_from_starting() {
    let elk = Elk::new("served");
    let mut broker = elk.command(&["db", "--community", elk.community()]).spawn().unwrap();
    drop(elk.join("usher"));
    let said = elk.launch_and_fail(&idle(&elk, None));
    assert!(said.contains("is served already, by a broker that is not this mission's"), "{said}");
    assert!(broker.try_wait().unwrap().is_none());
    kill(broker.id() as i32, Signal::TERM);
    broker.wait().unwrap();
    assert_nothing_is_left(&elk);
}

#[test]
fn a_manual_mission_without_a_person_says_what_to_do() {
    let elk = Elk::new("nobody");
    let mission = idle(&elk, None).replace("<Scenario", "<Scenario type=\"manual\"");
    let mut launcher = elk.launch(&mission);
    launcher.wait_for("nobody can press Enter here: `elk step` takes a step, `elk resume` runs on");
    launcher.wait_for("paused | ");
    assert_eq!(elk.obeyed(&["step"]), "one step\n");
    assert_eq!(elk.refused(&["pause"]), "elk: the mission is paused already\n");
    assert_eq!(elk.obeyed(&["resume"]), "resumed\n");
    assert_eq!(elk.refused(&["step"]), "elk: the mission is not paused: `elk pause` does that first\n");
    kill(launcher.id(), Signal::INT);
    launcher.end();
    assert_nothing_is_left(&elk);
}

#[test]
fn a_mission_that_is_wrong_starts_nothing() {
    let elk = Elk::new("wrong");
    let said = elk.launch_and_fail("<Scenario>\n<Sensor type=\"Simulatr\"/>\n</Scenario>");
    let file = elk.folder().join("mission.xml");
    let place = file.display();
    assert_eq!(
        said,
        format!(
            "elk: {place}:1:1: the Scenario has no <Map>; right is one\n\
             {place}:1:1: the Scenario has no <Explorer>; right is one\n\
             {place}:1:1: the Scenario has no <Controller>; right is one\n\
             {place}:2:15: Sensor has no type \"Simulatr\"; did you mean Simulator?\n"
        )
    );
    assert!(!elk.folder().join("logs").exists());
}

/// A mission with an app that starts, by `start`, two processes in sessions of their own; they do not listen to SIGTERM.
fn mission_with_escaped(elk: &Elk, kind: &str, start: &str) -> String {
    let (program, arguments) = elk.idle_client("Daemon");
    let escaped = "setsid sh -c 'trap \"\" TERM; echo $$ >>escaped; exec sleep 1000' &";
    let start = start.replace("ESCAPED", escaped);
    elk.script("daemon.sh", &format!("cd {}\n{start}\n{start}\nexec {program} {arguments}\n", elk.folder().display()));
    small(kind, "<App name=\"Daemon\" exec=\"./daemon.sh\"/>")
}

/// Those that have said that they run.
fn escaped(elk: &Elk) -> Vec<i32> {
    let said = std::fs::read_to_string(elk.folder().join("escaped")).unwrap_or_default();
    said.lines().filter_map(|line| line.parse().ok()).collect()
}

/// Regression: nobody knew of the orphaned processes of a launcher that was gone.
#[test]
fn what_an_app_has_started_ends_with_a_detached_mission_too_whoever_launches_it_by_then() {
    let elk = Elk::new("escaped-detached");
    // Their parent has ended by then.
    let mission = mission_with_escaped(&elk, "manual", "(ESCAPED)");
    let (code, said) = elk.launch_with(&mission, &["--detach"]).end();
    assert_eq!(code, Some(0), "{said}");
    elk.events().wait_until("two escaped processes", || escaped(&elk).len() == 2);
    let launcher = elk.process("launcher");
    kill(launcher, Signal::KILL);
    wait_until_gone("the launcher", || Some(launcher).filter(|id| alive(*id)));
    let mut attached = elk.attach();
    attached.wait_for("attached to run");
    elk.obeyed(&["step"]);
    assert!(escaped(&elk).into_iter().all(alive), "they go on with the mission");
    elk.obeyed(&["resume"]);
    let (code, said) = attached.end();
    assert_eq!(code, Some(0), "{said}");
    assert!(!escaped(&elk).into_iter().any(alive), "they outlive the mission");
}

#[test]
fn what_an_app_has_started_in_a_session_of_its_own_ends_with_the_mission() {
    for test in ["ends", "killed", "killed-with-guard"] {
        let elk = Elk::new(&format!("escaped-{test}"));
        let killed = test != "ends";
        let kind = if killed { "manual" } else { "auto" };
        let mut launcher = elk.launch(&mission_with_escaped(&elk, kind, "ESCAPED"));
        let escaped = || escaped(&elk);
        elk.events().wait_until("two escaped processes", || escaped().len() == 2);
        if killed {
            launcher.wait_for("Enter takes a step");
            elk.obeyed(&["step"]);
            if test == "killed-with-guard" {
                // Regression: nobody was left who knew of them.
                let words = |id: &i32| std::fs::read_to_string(format!("/proc/{id}/cmdline")).unwrap_or_default();
                let is_guard = |id: &i32| words(id).ends_with("\0guard\0");
                let guard = launcher.descendants().into_iter().find(is_guard).expect("a guard");
                kill(guard, Signal::KILL);
            }
            kill(launcher.id(), Signal::KILL);
        } else {
            let (code, said) = launcher.end();
            assert_eq!(code, Some(0), "{said}");
            assert!(!escaped().into_iter().any(alive), "they outlive the mission");
        }
        wait_until_gone("the escaped processes' end", || escaped().into_iter().find(|id| alive(*id)));
    }
}

/// Regression: with launcher, guard and broker nobody was left who knew of them, and they went on for ever.
#[test]
fn what_is_left_of_a_mission_whose_launcher_guard_and_broker_are_killed_at_once_ends_with_the_next_of_its_community() {
    for next in ["db", "launch"] {
        let elk = Elk::new(&format!("leftovers-{next}"));
        let mission = mission_with_escaped(&elk, "manual", "ESCAPED");
        let mut launcher = elk.launch(&mission);
        elk.events().wait_until("two escaped processes", || escaped(&elk).len() == 2);
        launcher.wait_for("Enter takes a step");
        let words = |id: &i32| std::fs::read_to_string(format!("/proc/{id}/cmdline")).unwrap_or_default();
        let knows_of_them = |id: &i32| words(id).ends_with("\0guard\0") || words(id).contains("\0db\0");
        let all: Vec<i32> = launcher.descendants().into_iter().filter(knows_of_them).collect();
        assert_eq!(all.len(), 2, "guard and broker");
        // None of them comes to act before all are killed.
        let all: Vec<i32> = all.into_iter().chain([launcher.id()]).collect();
        all.iter().for_each(|id| kill(*id, Signal::STOP));
        all.iter().for_each(|id| kill(*id, Signal::KILL));
        wait_until_gone("the three", || all.iter().copied().find(|id| alive(*id)));
        assert!(escaped(&elk).into_iter().all(alive), "nobody knows of them");
        launcher.end();
        let mut next = match next {
            "db" => elk.spawn("db.txt", elk.command(&["db", "--community", elk.community()])),
            _ => elk.launch(&mission),
        };
        wait_until_gone("the escaped processes' end", || escaped(&elk).into_iter().take(2).find(|id| alive(*id)));
        next.wait_for("whose launcher and guard were killed there was left, and is ended now: process ");
        kill(next.id(), Signal::INT);
        next.end();
    }
}
