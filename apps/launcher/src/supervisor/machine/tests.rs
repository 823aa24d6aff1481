use elk_mission::Restart::{Always, Never, OnFailure};

use super::*;

fn spec(name: &str, restart: elk_mission::Restart) -> UnitSpec {
    let policy = elk_mission::Policy { restart, restarts: 3, window_secs: 60.0, health_secs: Some(30.0) };
    UnitSpec::new(name, name, &policy)
}

const MAP: usize = 1;
const EXPLORER: usize = 2;

fn at(secs: f64) -> Duration {
    Duration::from_secs_f64(secs)
}

fn crash() -> Exit {
    Exit { how: "exit code 1".into(), tail: vec!["alas".into()], ..Exit::default() }
}

fn well() -> Exit {
    Exit { how: "exit code 0".into(), fine: true, ..Exit::default() }
}

fn killed() -> Exit {
    Exit { how: "signal 9 (SIGKILL)".into(), ..Exit::default() }
}

/// A broker, a map and an explorer that all run since time 0.
fn running(map: elk_mission::Restart) -> Supervisor {
    let broker = UnitSpec { urgent: true, health: None, ..spec("db", OnFailure) };
    let mut all = Supervisor::new(broker, [spec("Map", map), spec("Explorer", Never)]);
    for index in 0..3 {
        all.start(index, at(0.0));
    }
    all.broker_answers(at(0.0));
    all.arrived("Map", at(0.0));
    all.arrived("Explorer", at(0.0));
    all.when = "before the mission was over";
    all.take_actions();
    all
}

/// What is to be done, in short.
fn todo(all: &mut Supervisor) -> Vec<String> {
    all.take_actions().into_iter().map(in_short).collect()
}

fn in_short(action: Action) -> String {
    match action {
        Action::Say(words) => format!("say {words}"),
        Action::Tell(ticket, Word::Progress(words)) => format!("{ticket}… {words}"),
        Action::Tell(ticket, Word::Done(words)) => format!("{ticket}: {words}"),
        Action::Tell(ticket, Word::Failed(words)) => format!("{ticket}! {words}"),
        Action::Fail(error) => format!("fail {error}"),
        other => format!("{other:?}"),
    }
}

#[test]
fn whoever_may_not_be_restarted_fails_the_mission_with_its_reason() {
    let mut all = running(Never);
    all.ended(MAP, Role::Holder, crash(), at(1.0));
    let said = todo(&mut all);
    assert_eq!(said.len(), 1);
    assert!(said[0].starts_with("fail Map ended before the mission was over: exit code 1; the end of"), "{said:?}");
}

#[test]
fn it_is_not_restarted_before_it_has_registered() {
    let mut all = running(Always);
    all.ended(MAP, Role::Holder, crash(), at(1.0));
    assert_eq!(todo(&mut all), ["say Map ended: exit code 1; last line: alas; it is started again in 0.1 s"]);
    assert_eq!(all.deadline(), Some(at(1.1)));
    all.tick(at(1.05));
    assert_eq!(todo(&mut all), [""; 0]);
    all.tick(at(1.1));
    assert_eq!(todo(&mut all), ["Start(1, Holder)"]);
    assert_eq!(all.units[MAP].state.word(), "starting");
    all.arrived("Map", at(1.5));
    assert_eq!(todo(&mut all), ["say Map is back, restarted (1 of 3 in 60 s)"]);
    assert_eq!(
        (all.units[MAP].restarts, all.units[MAP].last_exit.as_deref()),
        (1, Some("exit code 1; last line: alas"))
    );
}

#[test]
fn pauses_double_and_the_limit_is_one_of_a_window() {
    let mut all = running(Always);
    let pauses: Vec<Duration> = [1.0, 2.0, 3.0]
        .map(|now| {
            all.ended(MAP, Role::Holder, crash(), at(now));
            let until = all.deadline().unwrap();
            all.tick(until);
            all.arrived("Map", until);
            until - at(now)
        })
        .into();
    assert_eq!(pauses, [0.1, 0.2, 0.4].map(at));
    // The first is out of the window by now.
    all.ended(MAP, Role::Holder, crash(), at(61.5));
    let until = all.deadline().unwrap();
    // And it had run well for so long that its pauses begin anew.
    assert_eq!(until - at(61.5), at(0.1));
    all.tick(until);
    all.take_actions();
    all.ended(MAP, Role::Holder, crash(), at(61.9));
    let said = todo(&mut all).pop().unwrap();
    assert!(said.starts_with("fail Map ended before the mission was over: exit code 1"), "{said}");
    assert!(said.ends_with("it had been started again 3 times in 60 s, which is its limit"), "{said}");
}

#[test]
fn on_failure_is_not_always() {
    let mut all = running(OnFailure);
    all.ended(MAP, Role::Holder, well(), at(1.0));
    assert!(todo(&mut all)[0].starts_with("fail Map"));
    let mut all = running(Always);
    all.ended(MAP, Role::Holder, well(), at(1.0));
    assert_eq!(todo(&mut all), ["say Map ended: exit code 0; it is started again in 0.1 s"]);
}

#[test]
fn a_broker_is_started_again_at_once_unless_it_was_ended_on_purpose() {
    let mut all = running(Never);
    all.ended(BROKER, Role::Holder, killed(), at(1.0));
    assert_eq!(todo(&mut all), ["say db ended: signal 9 (SIGKILL); it is started again", "Start(0, Holder)"]);
    all.arrived("Explorer", at(1.2));
    assert_eq!(todo(&mut all), ["say db is back, restarted (1 of 3 in 60 s)"]);
    all.ended(BROKER, Role::Holder, well(), at(2.0));
    assert!(todo(&mut all)[0].starts_with("fail db ended before the mission was over: exit code 0"));
}

#[test]
fn whoever_comes_while_there_is_no_broker_is_not_to_blame() {
    let mut all = running(Never);
    all.order_stop(7, MAP, at(1.0));
    all.ended(MAP, Role::Holder, well(), at(1.1));
    all.start(MAP, at(2.0));
    all.ended(BROKER, Role::Holder, crash(), at(2.1));
    all.take_actions();
    all.ended(MAP, Role::Holder, crash(), at(2.2));
    assert_eq!(todo(&mut all), ["say Map came while there was no broker (exit code 1); it is started again"]);
    all.tick(at(2.3));
    assert_eq!(todo(&mut all), ["Start(1, Holder)"]);
    // With a broker, it is.
    all.broker_answers(at(2.4));
    all.take_actions();
    all.ended(MAP, Role::Holder, crash(), at(2.5));
    assert!(todo(&mut all)[0].starts_with("fail Map ended"));
}

#[test]
fn a_broker_that_never_answered_is_not_started_again() {
    let broker = UnitSpec { urgent: true, ..spec("db", OnFailure) };
    let mut all = Supervisor::new(broker, []);
    all.start(BROKER, at(0.0));
    all.take_actions();
    all.ended(BROKER, Role::Holder, crash(), at(0.1));
    assert!(todo(&mut all)[0].starts_with("fail db ended before it registered: exit code 1"));
}

/// Somebody is heard every second, the map only until 5 s.
fn silence(all: &mut Supervisor, until: u32) -> Vec<String> {
    for now in 1..=until {
        let now = at(f64::from(now));
        all.sign("Explorer", now);
        if now <= at(5.0) {
            all.sign("Map", now);
        }
        all.tick(now);
    }
    todo(all)
}

#[test]
fn an_app_that_gives_no_sign_of_life_is_killed_and_the_reason_said() {
    let mut all = running(Always);
    assert_eq!(silence(&mut all, 35), [""; 0]);
    assert_eq!(silence(&mut all, 36), ["Kill(1)"]);
    all.ended(MAP, Role::Holder, killed(), at(36.1));
    assert_eq!(todo(&mut all), ["say Map ended: killed, no sign of life for 31 s; it is started again in 0.1 s"]);
}

#[test]
fn nobody_is_to_blame_for_a_silence_of_everybody() {
    let mut all = running(Always);
    // The bus is mute for minutes, whoever's fault that is.
    all.tick(at(300.0));
    all.sign("Explorer", at(300.0));
    all.tick(at(300.0));
    all.tick(at(304.0));
    assert_eq!(todo(&mut all), [""; 0]);
    // Nor for what a broker's outage took.
    all.ended(BROKER, Role::Holder, crash(), at(305.0));
    all.take_actions();
    all.sign("Explorer", at(334.0));
    all.tick(at(334.0));
    assert_eq!(todo(&mut all), [""; 0]);
}

#[test]
fn a_swap_hands_over_and_tells_the_gap() {
    let mut all = running(Never);
    all.order_swap(7, EXPLORER, at(20.0), false, at(1.0));
    assert_eq!(todo(&mut all), ["Start(2, Successor)"]);
    all.ready("Explorer", at(1.25));
    assert_eq!(todo(&mut all), ["7… the new Explorer is ready"]);
    all.handed_over("Explorer", 1.234, at(1.5));
    let done = "Explorer is swapped, in 500 ms: gap 1.2 ms";
    assert_eq!(todo(&mut all), ["TakeOver(2)".to_owned(), format!("say {done}"), format!("7: {done}")]);
    assert_eq!((all.units[EXPLORER].swaps, all.units[EXPLORER].state), (1, State::Running));
}

#[test]
fn a_swap_without_mail_succeeds_once_the_old_one_has_left() {
    let mut all = running(Never);
    all.order_swap(7, EXPLORER, at(20.0), false, at(1.0));
    all.ready("Explorer", at(1.2));
    all.take_actions();
    all.ended(EXPLORER, Role::Holder, well(), at(1.3));
    assert_eq!(todo(&mut all), ["TakeOver(2)"]);
    all.tick(at(2.3));
    let said = todo(&mut all);
    assert!(said[1].starts_with("7: Explorer is swapped, in 1300 ms: it had no message to handle yet"), "{said:?}");
}

#[test]
fn an_end_that_is_seen_before_the_word_of_it_is_heard_is_no_surprise() {
    let mut all = running(Never);
    all.order_swap(7, EXPLORER, at(20.0), false, at(1.0));
    all.take_actions();
    all.ended(EXPLORER, Role::Holder, well(), at(1.1));
    assert_eq!(todo(&mut all), ["TakeOver(2)"]);
    all.ready("Explorer", at(1.2));
    assert_eq!(todo(&mut all), ["7… the new Explorer is ready"]);
    all.handed_over("Explorer", 2.0, at(1.3));
    assert_eq!(todo(&mut all)[1], "7: Explorer is swapped, in 300 ms: gap 2.0 ms");
}

#[test]
fn a_successor_that_dies_or_dawdles_changes_nothing() {
    let mut all = running(Never);
    all.order_swap(7, EXPLORER, at(20.0), false, at(1.0));
    all.take_actions();
    all.ended(EXPLORER, Role::Successor, crash(), at(1.1));
    let failed = "7! the new Explorer ended before it was ready: exit code 1; it said:\n    alas\n\
                  nothing is changed: the old Explorer goes on";
    assert_eq!(todo(&mut all), [failed]);
    assert_eq!(all.units[EXPLORER].state, State::Running);

    all.order_swap(8, EXPLORER, at(20.0), false, at(2.0));
    all.take_actions();
    all.tick(at(22.0));
    let failed =
        "8! the new Explorer was not ready within 20 s\nnothing is changed: the old Explorer goes on".to_owned();
    assert_eq!(todo(&mut all), ["Discard(2)".to_owned(), failed]);
    // And if it cannot even be started:
    all.order_swap(9, EXPLORER, at(20.0), false, at(30.0));
    all.take_actions();
    all.not_started(EXPLORER, Role::Successor, LaunchError::Stopped, at(30.0));
    assert_eq!(todo(&mut all), ["9! stopped\nnothing is changed: the old Explorer goes on"]);
}

#[test]
fn a_holder_that_does_not_leave_is_killed() {
    let mut all = running(Never);
    all.order_swap(7, EXPLORER, at(20.0), false, at(1.0));
    all.ready("Explorer", at(2.0));
    all.take_actions();
    all.tick(at(7.0));
    assert_eq!(todo(&mut all), ["Kill(2)", "7… the old Explorer did not leave within 5 s and is killed"]);
    all.ended(EXPLORER, Role::Holder, killed(), at(7.1));
    assert_eq!(todo(&mut all), ["say Explorer ended before it was relieved: signal 9 (SIGKILL)", "TakeOver(2)"]);
    all.handed_over("Explorer", 5100.0, at(7.2));
    assert_eq!(todo(&mut all)[1], "7: Explorer is swapped, in 6200 ms: gap 5100.0 ms");
}

#[test]
fn a_holder_that_dies_before_its_successor_is_ready_is_followed_all_the_same() {
    let mut all = running(Never);
    all.order_swap(7, EXPLORER, at(20.0), false, at(1.0));
    all.take_actions();
    all.ended(EXPLORER, Role::Holder, crash(), at(1.1));
    assert_eq!(
        todo(&mut all),
        ["say Explorer ended before it was relieved: exit code 1; last line: alas", "TakeOver(2)"]
    );
    all.arrived("Explorer", at(1.5));
    all.handed_over("Explorer", 400.0, at(1.5));
    assert_eq!(todo(&mut all)[1], "7: Explorer is swapped, in 500 ms: gap 400.0 ms");
    // If that one dies as well, the policy says what happens.
    all.order_swap(8, EXPLORER, at(20.0), false, at(2.0));
    all.ended(EXPLORER, Role::Holder, crash(), at(2.1));
    all.take_actions();
    all.ended(EXPLORER, Role::Holder, crash(), at(2.2));
    let said = todo(&mut all);
    assert!(said[0].starts_with("8! the new Explorer took over, and ended: exit code 1"), "{said:?}");
    assert!(said[1].starts_with("fail Explorer ended"), "{said:?}");
}

#[test]
fn a_stopped_app_fails_nothing_and_starts_again() {
    let mut all = running(Never);
    all.order_stop(7, MAP, at(1.0));
    assert_eq!(todo(&mut all), ["Ask(1)"]);
    all.order_stop(8, MAP, at(1.1));
    assert_eq!(todo(&mut all), ["8! Map is stopping by another command"]);
    all.ended(MAP, Role::Holder, well(), at(1.2));
    assert_eq!(todo(&mut all), ["7: Map is stopped"]);
    all.order_stop(8, MAP, at(1.3));
    assert_eq!(todo(&mut all), ["8! Map is stopped already"]);
    all.order_swap(8, MAP, at(20.0), false, at(1.3));
    assert_eq!(todo(&mut all), ["8! Map is stopped: only an app that runs can be swapped"]);
    all.order_start(9, MAP, at(20.0), at(2.0));
    assert_eq!(todo(&mut all), ["Start(1, Holder)"]);
    all.arrived("Map", at(2.5));
    assert_eq!(todo(&mut all), ["9: Map runs"]);
    all.order_start(9, MAP, at(20.0), at(3.0));
    assert_eq!(todo(&mut all), ["9! Map is running, not stopped"]);
}

#[test]
fn a_start_that_fails_leaves_the_app_stopped() {
    let mut all = running(Never);
    all.order_stop(7, MAP, at(1.0));
    all.ended(MAP, Role::Holder, well(), at(1.2));
    all.order_start(8, MAP, at(20.0), at(2.0));
    all.take_actions();
    all.ended(MAP, Role::Holder, crash(), at(2.1));
    assert_eq!(todo(&mut all), ["8! Map ended before it registered: exit code 1; it said:\n    alas"]);
    assert_eq!(all.units[MAP].state, State::Stopped);
    // One that hangs is stopped when its time is up.
    all.order_start(9, MAP, at(20.0), at(3.0));
    all.take_actions();
    all.tick(at(23.0));
    assert_eq!(todo(&mut all), ["Ask(1)"]);
    all.ended(MAP, Role::Holder, Exit { asked: true, ..crash() }, at(23.1));
    assert_eq!(todo(&mut all), ["9! Map did not register in time and was stopped"]);
}

#[test]
fn an_app_is_stopped_out_of_its_pause() {
    let mut all = running(Always);
    all.ended(MAP, Role::Holder, crash(), at(1.0));
    all.take_actions();
    all.order_stop(7, MAP, at(1.05));
    assert_eq!(todo(&mut all), ["7: Map is stopped; it had ended before"]);
    all.tick(at(10.0));
    assert_eq!(todo(&mut all), [""; 0]);
}

#[test]
fn at_the_end_all_are_stopped_one_after_the_other_and_nobody_comes_back() {
    let mut all = running(Always);
    all.order_swap(7, EXPLORER, at(20.0), false, at(1.0));
    all.take_actions();
    all.end(at(2.0));
    let said = todo(&mut all);
    assert_eq!(said[0], "Discard(2)");
    assert!(said[1].starts_with("7! the mission is ending"), "{said:?}");
    assert_eq!(said[2], "Ask(2)");
    all.ended(EXPLORER, Role::Holder, well(), at(2.1));
    assert_eq!(todo(&mut all), ["Ask(1)"]);
    // The broker is still needed.
    all.ended(BROKER, Role::Holder, crash(), at(2.2));
    assert_eq!(todo(&mut all)[1], "Start(0, Holder)");
    all.tick(at(22.1));
    assert_eq!(todo(&mut all), ["Kill(1)"]);
    assert!(!all.all_ended());
    all.ended(MAP, Role::Holder, killed(), at(22.2));
    assert!(all.all_ended());
    let failed = "fail Map could not end in good order: killed, not stopped within 20 s";
    assert_eq!(todo(&mut all), [failed]);
    all.order_start(8, MAP, at(20.0), at(23.0));
    assert_eq!(todo(&mut all), ["8! the mission is ending"]);
}

/// Regression: a mission whose map nobody had written was called complete.
#[test]
fn whoever_is_dead_at_the_end_has_not_done_what_it_does_there() {
    let failed = |how: &str| format!("fail Map could not end in good order: {how}");
    // Killed before it was asked.
    let mut all = running(Always);
    all.end(at(1.0));
    assert_eq!(todo(&mut all), ["Ask(2)"]);
    all.ended(MAP, Role::Holder, killed(), at(1.1));
    assert_eq!(todo(&mut all), [failed("signal 9 (SIGKILL)")]);
    // Killed when it had been asked: told once.
    let mut all = running(Never);
    all.end(at(1.0));
    all.ended(EXPLORER, Role::Holder, Exit { asked: true, ..killed() }, at(1.1));
    assert_eq!(todo(&mut all), ["Ask(2)", "Ask(1)"]);
    all.ended(MAP, Role::Holder, killed(), at(1.2));
    assert_eq!(todo(&mut all), [failed("signal 9 (SIGKILL)")]);
    // It was to be started again, and the mission ended first.
    let mut all = running(Always);
    all.ended(MAP, Role::Holder, killed(), at(1.0));
    all.take_actions();
    all.end(at(1.05));
    all.ended(EXPLORER, Role::Holder, well(), at(1.06));
    assert_eq!(todo(&mut all), ["Ask(2)".to_owned(), failed("signal 9 (SIGKILL)")]);
    assert!(all.all_ended());
}

#[test]
fn of_a_name_that_two_cannot_have_the_old_one_leaves_first() {
    let mut all = running(Never);
    all.order_swap(7, EXPLORER, at(20.0), true, at(1.0));
    assert_eq!(todo(&mut all), ["Ask(2)"]);
    all.ended(EXPLORER, Role::Holder, killed(), at(1.5));
    assert_eq!(todo(&mut all), ["Exchange(2)", "Start(2, Holder)"]);
    all.arrived("Explorer", at(2.0));
    let done = "Explorer is swapped, in 1000 ms: nobody was there for 500 ms";
    assert_eq!(todo(&mut all), [format!("say {done}"), format!("7: {done}")]);
    assert_eq!((all.units[EXPLORER].swaps, all.units[EXPLORER].state), (1, State::Running));
    // One that ends, or does not come, makes room for the old one.
    all.order_swap(8, EXPLORER, at(20.0), true, at(3.0));
    all.ended(EXPLORER, Role::Holder, well(), at(3.1));
    all.take_actions();
    all.ended(EXPLORER, Role::Holder, crash(), at(3.2));
    let failed = "8! the new Explorer ended before it registered: exit code 1; it said:\n    alas\n\
                  the old Explorer is started again";
    assert_eq!(todo(&mut all), [failed, "Exchange(2)", "Start(2, Holder)"]);
    all.arrived("Explorer", at(3.3));
    all.order_swap(9, EXPLORER, at(20.0), true, at(4.0));
    all.ended(EXPLORER, Role::Holder, well(), at(4.1));
    all.take_actions();
    all.tick(at(24.2));
    assert_eq!(todo(&mut all), ["Kill(2)"]);
    all.ended(EXPLORER, Role::Holder, killed(), at(24.3));
    let said = todo(&mut all);
    assert!(said[0].starts_with("9! the new Explorer ended before it registered: killed, not registered within 20 s"));
    assert_eq!(said[1..], ["Exchange(2)", "Start(2, Holder)"]);
}
