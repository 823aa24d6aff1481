//! `elk pipe`: programs in languages that have nothing of elk, as apps.

mod common;

use std::path::PathBuf;
use std::process::Command;

use common::events::{Patience, wait_until_gone};
use common::lab::{Lab, hear, wait_for_reader};
use common::skip::skip;
use common::{Elk, Launcher, alive, kill};
use elk_bus::{Client, Key, payload};
use rustix::process::Signal;
use serde_json::Value;

/// How a car is steered.
#[payload]
#[derive(Debug, Clone, PartialEq)]
pub struct Steering {
    /// Anticlockwise.
    #[describe(unit = "rad", range = -4.0..=4.0)]
    pub angle: f64,
    /// Where each wheel points.
    pub wheels: Vec<f32>,
}

const STEERING: Key<Steering> = Key::new("STEERING");
const STEERED: Key<Steering> = Key::new("STEERED");

/// Whether a program is there; the test is skipped by this name if not.
fn runs(program: &str, test: &str) -> bool {
    let found = Command::new(program).arg("--version").output().is_ok_and(|out| out.status.success());
    if !found {
        skip(test, program, &format!("{program} does not run"));
    }
    found
}

/// … Python.
fn python(test: &str) -> bool {
    runs("python3", test)
}

/// What every program here in Python begins with.
const PRELUDE: &str = "\
import json, os, signal, sys
def say(**line): print(json.dumps(line), flush=True)
def hear():
    for line in sys.stdin: yield json.loads(line)
";

/// A broker and a program that reads and writes lines.
struct Stage {
    lab: Lab,
    elk: Elk,
    app: Launcher,
}

impl Stage {
    /// `arguments` stand between `elk pipe Echo` and the program.
    fn new(test: &str, arguments: &[&str], program: &[&str]) -> Self {
        let elk = Elk::new(test);
        let lab = Lab::deaf(&elk);
        let app = Self::start(&elk, "app.txt", arguments, program);
        Self { lab, elk, app }
    }

    /// A program in Python.
    fn python(test: &str, arguments: &[&str], program: &str) -> Self {
        let program = format!("{PRELUDE}{program}");
        Self::new(test, arguments, &["python3", "-c", &program])
    }

    fn start(elk: &Elk, said: &str, arguments: &[&str], program: &[&str]) -> Launcher {
        let head = ["pipe", "Echo", "--community", elk.community()];
        elk.spawn(said, elk.command(&[&head, arguments, &["--"], program].concat()))
    }

    /// A client that hears these variables.
    fn reader(&self, name: &str, variables: &[&str]) -> Client {
        let mut reader = self.elk.join(name);
        variables.iter().for_each(|variable| reader.comms.register(*variable).unwrap());
        reader.comms.flush().unwrap();
        reader
    }

    fn wait_for_app(&mut self) {
        self.lab.wait_for_reader("Echo");
    }
}

/// The next text of a variable.
fn text(reader: &mut Client, variable: &str) -> String {
    hear(reader, variable, |mail| mail.as_text().filter(|_| mail.key() == variable).map(str::to_owned))
}

/// The next text of a variable, as JSON.
fn json(reader: &mut Client, variable: &str) -> Value {
    serde_json::from_str(&text(reader, variable)).unwrap()
}

/// The lines that it hears are taken apart by hand, and a number is said back: there is nothing of elk in it, nor of JSON.
const SHELL: &str = r#"
while read -r line; do
    case $line in *'"mail":"PING"'*)
        value=${line##*'"value":'}
        echo "{\"publish\":\"PONG\",\"value\":${value%%[,\}]*}}";;
    esac
done"#;

#[test]
fn a_program_in_a_shell_answers_and_outlives_the_broker() {
    let mut stage = Stage::new("pipe-shell", &["--subscribe", "PI*"], &["sh", "-c", SHELL]);
    stage.wait_for_app();
    let mut asker = stage.reader("asker", &["PONG"]);
    for number in [1.5, -7.0] {
        asker.comms.notify("PING", number).unwrap();
        asker.comms.flush().unwrap();
        let heard = hear(&mut asker, "PONG", |mail| mail.as_double().filter(|_| mail.key() == "PONG"));
        assert_eq!(heard, number);
    }
    // A client like any other: with its registration, and its word of itself.
    let client = common::lab::table(&mut asker).clients.into_iter().find(|client| client.name == "Echo").unwrap();
    assert_eq!(client.registrations[0].key_pattern, "PI*");

    let Stage { lab, elk, app } = stage;
    let _lab = lab.with_next_broker(&elk);
    asker.comms.notify("PING", 41.0).unwrap();
    asker.comms.flush().unwrap();
    hear(&mut asker, "an answer over the next broker", |mail| mail.as_double().filter(|number| *number == 41.0));
    kill(app.id(), Signal::TERM);
    assert_eq!(app.end().0, Some(0));
}

/// Each value comes back with the angle the other way round, every wheel twice as far.
const NODE: &str = r"
const lines = require('node:readline').createInterface({ input: process.stdin });
const say = line => process.stdout.write(JSON.stringify(line) + '\n');
lines.on('line', line => {
    const { mail, value } = JSON.parse(line);
    if (mail !== 'STEERING') return;
    say({ publish: 'STEERED', value: { angle: -value.angle, wheels: value.wheels.map(wheel => 2 * wheel) } });
});";

#[test]
fn a_program_in_node_answers_with_values_of_a_type() {
    if !runs("node", "pipe node") {
        return;
    }
    let mut stage = Stage::new("pipe-node", &["--subscribe", "STEERING"], &["node", "-e", NODE]);
    let mut asker = stage.elk.join("asker");
    asker.comms.register(&STEERED).unwrap();
    asker.comms.flush().unwrap();
    stage.wait_for_app();
    for angle in [0.1 + 0.2, -1e-300] {
        asker.comms.publish(&STEERING, &Steering { angle, wheels: vec![0.1, -1.5] }).unwrap();
        asker.comms.flush().unwrap();
        let heard = hear(&mut asker, "STEERED", |mail| mail.is(&STEERED).then(|| mail.decode(&STEERED).unwrap()));
        assert_eq!(heard, Steering { angle: -angle, wheels: vec![0.2, -3.0] }, "to the bit");
    }
    kill(stage.app.id(), Signal::TERM);
    assert_eq!(stage.app.end().0, Some(0));
}

#[test]
fn values_go_through_and_what_is_wrong_is_told_with_its_field() {
    if !python("pipe values") {
        return;
    }
    let program = r#"
hello = next(hear())["hello"]
say(register="STEERING", rate=1000)
say(publish="HELLO", value=json.dumps(hello))
for said in hear():
    if "mail" in said:
        value = said["value"]
        value["angle"] += 1
        say(publish="STEERED", value=value)
        for wrong in (dict(value, angle=5), dict(value, angle="far"), dict(value, speed=1), {"angle": 1}, 7):
            say(publish="STEERED", value=wrong)
        say(publish="STEERED", value=value, type="Speed")
        say(publish="NOBODYS", value={"a": 1})
        say(publish="DB_TIME", value=1)
        print("no JSON"); print("[1]"); print(""); say(publsh="X")
        os.write(1, b"\xff\n")
        say(describe="STEERED")
        say(describe="NOBODYS")
        say(publish="HELLO", value=7)
    else:
        say(publish="TOLD", value=json.dumps(said))
"#;
    let mut stage = Stage::python("pipe-values", &["Gain=4", "Who= Ann "], program);
    let mut reader = stage.reader("reader", &["HELLO", "TOLD"]);
    reader.comms.register(&STEERED).unwrap();
    reader.comms.flush().unwrap();
    let hello = json(&mut reader, "HELLO");
    assert_eq!(hello["name"], "Echo");
    assert_eq!(hello["community"], stage.elk.community());
    assert_eq!(hello["parameters"], serde_json::json!({"Gain": "4", "Who": " Ann "}));
    stage.wait_for_app();

    let steering = Steering { angle: 0.1 + 0.2, wheels: vec![0.1, -3.4e38] };
    reader.comms.publish(&STEERING, &steering).unwrap();
    reader.comms.flush().unwrap();
    let mut told = Vec::new();
    let mut steered = Vec::new();
    hear(&mut reader, "all of its words", |mail| {
        if mail.is(&STEERED) {
            steered.push(mail.decode(&STEERED).unwrap());
        } else if mail.key() == "TOLD" {
            told.push(serde_json::from_str::<Value>(mail.as_text().unwrap()).unwrap());
        }
        (told.len() == 16).then_some(())
    });
    // To the bit.
    assert_eq!(steered, [Steering { angle: 0.1 + 0.2 + 1.0, ..steering }]);
    let reasons = [
        ("STEERED", "angle is 5; it has to be -4 to 4 rad"),
        ("STEERED", r#"angle is "far"; it has to be a number"#),
        ("STEERED", "speed"),
        ("STEERED", "wheels is missing"),
        ("STEERED", "this is no Steering"),
        ("STEERED", "STEERED carries Steering, and not Speed"),
        ("NOBODYS", "nobody has written NOBODYS or reads it"),
        ("DB_TIME", "DB_TIME is the broker's own"),
        ("", "this is no JSON"),
        ("", "a line is one JSON object"),
        ("", "this is no JSON"),
        ("", "this one says publsh"),
        ("", "not UTF-8"),
    ];
    for ((what, reason), said) in reasons.iter().zip(&told) {
        assert_eq!(said["refused"].as_str().unwrap_or_default(), *what, "{said}");
        assert!(said["reason"].as_str().unwrap().contains(reason), "{reason}: {said}");
        assert!(said["line"].as_u64().unwrap() > 2, "{said}");
    }
    assert_eq!(told[13]["type"], "Steering", "{}", told[13]);
    assert_eq!(told[13]["example"], serde_json::json!({"angle": 0.0, "wheels": []}), "{}", told[13]);
    assert!(told[13]["description"].to_string().contains("Anticlockwise"), "{}", told[13]);
    assert_eq!(told[14], serde_json::json!({"described": "NOBODYS", "type": null}));
    assert_eq!(told[15]["reason"], "HELLO is 7; it has to be a text");
    // The log has the first ten reasons.
    let log = stage.app.said();
    assert!(log.contains("Echo: line 4 of python3, STEERED was not taken: "), "{log}");
    assert_eq!(log.matches("was not taken").count(), 10, "{log}");
}

#[test]
fn lists_of_numbers_go_both_ways_as_base64() {
    if !python("pipe arrays") {
        return;
    }
    let program = r#"
import base64, struct
say(arrays="base64")
say(register="STEERING")
say(ready=True)
for line in hear():
    if line.get("mail") == "STEERING":
        value, wheels = line["value"], line["value"]["wheels"]
        say(publish="TOLD", value=json.dumps([wheels["dtype"], wheels["shape"]]))
        numbers = struct.unpack("<%df" % wheels["shape"][0], base64.b64decode(wheels["base64"]))
        twice = struct.pack("<%df" % len(numbers), *[2 * one for one in numbers])
        say(publish="STEERED", value=dict(value, wheels=dict(wheels, base64=base64.b64encode(twice).decode())))
        say(publish="STEERED", value=dict(value, wheels=dict(wheels, dtype=">f4")))
        say(arrays="json")
    elif "refused" in line:
        say(publish="TOLD", value=json.dumps(line["reason"]))
"#;
    let mut stage = Stage::python("pipe-arrays", &[], program);
    let mut reader = stage.reader("reader", &["TOLD"]);
    reader.comms.register(&STEERED).unwrap();
    reader.comms.flush().unwrap();
    stage.wait_for_app();
    reader.comms.publish(&STEERING, &Steering { angle: 1.0, wheels: vec![0.1, -1.5e38, 7.0] }).unwrap();
    reader.comms.flush().unwrap();
    let (mut told, mut steered) = (Vec::new(), None);
    hear(&mut reader, "the doubled steering, and a refusal", |mail| {
        if mail.is(&STEERED) {
            steered = Some(mail.decode(&STEERED).unwrap());
        } else if mail.key() == "TOLD" {
            told.push(serde_json::from_str::<Value>(mail.as_text().unwrap()).unwrap());
        }
        (told.len() == 2).then_some(())
    });
    assert_eq!(told[0], serde_json::json!(["<f4", [3]]));
    assert_eq!(steered.unwrap(), Steering { angle: 1.0, wheels: vec![0.2, -3e38, 14.0] }, "to the bit");
    assert!(told[1].as_str().unwrap().starts_with("wheels: its dtype has to be one of"), "{}", told[1]);
}

#[test]
fn a_line_without_an_end_costs_no_memory_and_the_next_one_is_taken() {
    if !python("pipe long line") {
        return;
    }
    let program = r#"
next(hear())
say(register="END"); say(ready=True)
for _ in range(1024): sys.stdout.write("x" * (1 << 20))
print()
say(publish="SAID", value=json.dumps(next(hear())))
next(hear())
"#;
    let stage = Stage::python("pipe-long", &[], program);
    let mut reader = stage.reader("reader", &["SAID"]);
    let said = json(&mut reader, "SAID");
    assert!(said["reason"].as_str().unwrap().contains("longer than 8388608 bytes"), "{said}");
    let memory = peak_memory_mb(stage.app.id());
    assert!(memory < 200, "{memory} MB");
    reader.comms.notify("END", 1.0).unwrap();
    reader.comms.flush().unwrap();
    let (code, said) = stage.app.end();
    assert_eq!(code, Some(0), "{said}");
    drop(stage.lab);
}

/// A program that is given far more than its mailbox holds, and does not read.
#[test]
fn a_program_that_does_not_read_loses_its_own_mail_alone() {
    if !python("pipe deaf") {
        return;
    }
    let program = r#"
next(hear())
signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGUSR1])
say(register="LOAD"); say(register="LAST"); say(publish="READY", value=os.getpid())
signal.sigwait([signal.SIGUSR1])
heard = lost = 0
for said in hear():
    heard += said.get("mail") == "LOAD"
    lost += said.get("lost", 0)
    if said.get("mail") == "LAST": say(publish="COUNT", value=json.dumps([heard, lost]))
"#;
    let stage = Stage::python("pipe-deaf", &[], program);
    let mut reader = stage.reader("reader", &["READY", "COUNT"]);
    let program = hear(&mut reader, "its readiness", |mail| mail.as_double()) as i32;
    reader.comms.register(elk_bus::any("LOAD").lossless()).unwrap();
    reader.comms.flush().unwrap();
    let mut speaker = stage.elk.join("speaker");
    let load = "x".repeat(10_000);
    const MESSAGES: u64 = 3000;
    let mut heard = 0;
    for _ in 0..MESSAGES {
        speaker.comms.notify("LOAD", load.as_str()).unwrap();
        speaker.comms.flush().unwrap();
        reader.receive(std::time::Duration::ZERO, |mail| heard += u64::from(mail.key() == "LOAD")).unwrap();
    }
    let patience = Patience::new();
    while heard < MESSAGES {
        let left = patience.left("everybody else hears all of it");
        reader.receive(left, |mail| heard += u64::from(mail.key() == "LOAD")).unwrap();
    }
    let memory = peak_memory_mb(stage.app.id());
    assert!(memory < 200, "{memory} MB");
    kill(program, Signal::USR1);
    speaker.comms.notify("LAST", 1.0).unwrap();
    speaker.comms.flush().unwrap();
    let count = json(&mut reader, "COUNT");
    let [heard, lost] = [0, 1].map(|n| count[n].as_u64().unwrap());
    assert!(lost > 0 && heard > 0, "{count}");
    assert_eq!(heard + lost, MESSAGES, "{count}");
    kill(stage.app.id(), Signal::TERM);
    assert_eq!(stage.app.end().0, Some(0));
    drop(stage.lab);
}

/// The most memory that a process has had resident (MB).
fn peak_memory_mb(process: i32) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap();
    line.trim().trim_end_matches(" kB").parse::<u64>().unwrap() / 1024
}

#[test]
fn how_a_program_ends_is_how_its_app_ends() {
    if !python("pipe ends") {
        return;
    }
    let ended = |name: &str, program: &str| Stage::python(name, &[], program).app.end();
    assert_eq!(ended("pipe-ends-well", "say(log='goodbye')").0, Some(0));
    let (code, said) = ended("pipe-ends-badly", "say(ready=True); sys.exit('I give up')");
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("I give up") && said.contains("Echo: python3 ended with exit code 1"), "{said}");
    let (code, said) = ended("pipe-killed", "say(ready=True); os.kill(os.getpid(), signal.SIGKILL)");
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("ended with signal 9 (SIGKILL)"), "{said}");
    let stage = Stage::new("pipe-none", &[], &["./no-such-program"]);
    let (code, said) = stage.app.end();
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("./no-such-program cannot be started: No such file or directory"), "{said}");
}

/// It ignores SIGTERM and the end of its input, and so does the process that it has started.
const STUBBORN: &str = r#"
signal.signal(signal.SIGTERM, signal.SIG_IGN)
if os.fork() == 0:
    while True: signal.pause()
say(register="X"); say(publish="READY", value=1)
while True: signal.pause()
"#;

#[test]
fn no_process_is_left_of_a_program_that_does_not_want_to_end() {
    if !python("pipe stubborn") {
        return;
    }
    let mut stage = Stage::python("pipe-stubborn", &[], STUBBORN);
    let mut reader = stage.reader("reader", &["READY"]);
    hear(&mut reader, "its readiness", |mail| mail.as_double());
    stage.wait_for_app();
    let below = stage.app.descendants();
    assert_eq!(below.len(), 2, "{below:?}");
    kill(stage.app.id(), Signal::TERM);
    let (code, said) = stage.app.end();
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("Echo: python3 did not end within 5 s: it is killed"), "{said}");
    wait_until_gone("the end of what it had started", || {
        below.iter().copied().filter(|id| alive(*id)).collect::<Vec<_>>()
    });
    drop(stage.lab);
}

#[test]
fn a_program_whose_app_is_killed_ends_too() {
    if !python("pipe orphan") {
        return;
    }
    let mut stage = Stage::python("pipe-orphan", &["--subscribe", "X"], "for said in hear(): pass");
    stage.wait_for_app();
    let below = stage.app.descendants();
    // A `python3` that looks for the right one has processes of its own at first.
    assert!(!below.is_empty());
    kill(stage.app.id(), Signal::KILL);
    wait_until_gone("the program's end", || below.iter().copied().filter(|id| alive(*id)).collect::<Vec<_>>());
    drop(stage.lab);
}

/// A small mission with an app that counts, and is exchanged for one in another language.
#[test]
fn a_piped_app_of_a_mission_is_listed_swapped_and_kept_in_its_record() {
    if !python("pipe mission") {
        return;
    }
    let elk = Elk::new("pipe-mission");
    elk.script(
        "counter.sh",
        "echo '{\"register\":\"CALL\"}'; echo '{\"ready\":true}'\n\
         while read -r line; do case \"$line\" in *'\"mail\":\"CALL\"'*) echo '{\"publish\":\"ANSWER\",\"value\":\"sh\"}';; esac; done\n",
    );
    let mission =
        common::small::small("manual", "<App name=\"Counter\" pipe=\"./counter.sh 'two words'\"><Gain>4</Gain></App>");
    let mut launcher = elk.launch(&mission);
    launcher.wait_for("Enter takes a step");
    let mut caller = elk.join("caller");
    caller.comms.register("ANSWER").unwrap();
    wait_for_reader(&mut caller, |name| name == "Counter");
    let call = |caller: &mut Client, answer: &str| {
        caller.comms.notify("CALL", 1.0).unwrap();
        caller.comms.flush().unwrap();
        hear(caller, answer, |mail| mail.as_text().filter(|text| *text == answer).map(|_| ()));
    };
    call(&mut caller, "sh");
    assert_eq!(elk.row("Counter")["type"], "pipe");

    let program = format!(
        "{PRELUDE}next(hear()); say(register='CALL'); say(ready=True)\nfor said in hear():\n    if said.get('mail') == 'CALL': say(publish='ANSWER', value='python')\n"
    );
    std::fs::write(elk.folder().join("counter.py"), program).unwrap();
    let refused = elk.refused(&["swap", "Counter", "pipe=./no-such-program"]);
    assert!(refused.contains("no-such-program cannot be run"), "{refused}");
    let refused = elk.refused(&["swap", "Counter", "pipe=python3 counter.py", "exec=sh"]);
    assert!(refused.contains("exec and pipe are both said"), "{refused}");
    elk.obeyed(&["swap", "Counter", "pipe=python3 counter.py"]);
    call(&mut caller, "python");
    // Killed by hand, it is missed: nobody starts it again.
    drop(caller);
    elk.obeyed(&["resume"]);
    let (code, said) = launcher.end();
    assert_eq!(code, Some(0), "{said}");
    let record: PathBuf = elk.run().join("mission.effective.xml");
    let record = std::fs::read_to_string(record).unwrap();
    assert!(record.contains("counter.sh 'two words'\"") && record.contains("pipe=\""), "{record}");
    assert!(elk.run().join("Counter.log").exists());
}
