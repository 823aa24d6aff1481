//! Programs of MOOS' in missions of the real program, started by the command line by which pAntler starts them. The one here is
//! this test program itself: it knows MOOS' protocol and its files from their specification, and nothing of elk's.

mod common;

use std::collections::{BTreeMap, VecDeque};
use std::net::ToSocketAddrs;
use std::path::Path;
use std::time::Duration;

use common::Elk;
use common::events::Patience;
use common::small::small;
use elk_bus::Client;
use elk_bus::moos::client::{ClientError, MoosClient};
use elk_bus::moos::hello::Manner;
use rustix::process::Signal;

/// The line by which a program of MOOS' was started: its arguments, each in a line.
const LINE: &str = "MOOS_PROGRAM_LINE";
/// How long the program waits before it connects again, as MOOS' own do.
const AGAIN: Duration = Duration::from_millis(200);

/// Not a test: what a script makes of this test program.
#[test]
fn a_program_of_moos() {
    let Ok(line) = std::env::var(LINE) else { return };
    let words: Vec<&str> = line.lines().collect();
    let [file, name, more @ ..] = words.as_slice() else { panic!("pAntler says FILE NAME …, and this is {words:?}") };
    let file = std::fs::read_to_string(file).unwrap();
    let (values, block) = (values(file.lines()), block(&file, name));
    let address = format!("{}:{}", values["ServerHost"], values["ServerPort"]);
    let said = format!("{} {block} {}", values["Community"], more.join(" "));
    loop {
        match serve(&address, name, &said) {
            // Who is refused stops for good.
            Err(error @ ClientError::Poisoned(_)) => panic!("{error}"),
            Err(_) => std::thread::sleep(AGAIN),
            Ok(()) => return,
        }
    }
}

/// Says what it was told, and answers each `ASK` with the same number, until it is asked to end.
fn serve(address: &str, name: &str, said: &str) -> Result<(), ClientError> {
    let address = address.to_socket_addrs()?.next().unwrap();
    let mut client = MoosClient::connect(address, name, Manner::Asynchronous)?;
    client.register("ASK", 0.0);
    client.notify_text(&format!("TOLD_{name}"), said);
    loop {
        let mut asked = Vec::new();
        client.receive(Duration::from_millis(100), |message| asked.push(message.number))?;
        if asked.contains(&-1.0) {
            return Ok(());
        }
        asked.into_iter().for_each(|number| client.notify_number("ANSWER", number));
    }
}

/// `Name = Value`, of which the first of a name counts.
fn values<'a>(lines: impl Iterator<Item = &'a str>) -> BTreeMap<String, String> {
    let mut values = BTreeMap::new();
    for (name, value) in lines.filter(|line| !line.trim().starts_with("//")).filter_map(|line| line.split_once('=')) {
        values.entry(name.trim().to_owned()).or_insert_with(|| value.trim().to_owned());
    }
    values
}

/// The parameters of a program's first block.
fn block(file: &str, name: &str) -> String {
    let (_, rest) = file.split_once(&format!("ProcessConfig = {name}\n{{\n")).unwrap();
    let lines = rest.lines().take_while(|line| !line.starts_with('}')).map(str::trim);
    lines.collect::<Vec<_>>().join(";")
}

/// Makes a program of MOOS' of this name in the test's folder.
fn program(elk: &Elk, name: &str) {
    let own = std::env::current_exe().unwrap();
    let text = format!(
        "{LINE}=$(printf '%s\\n' \"$@\") exec {} --exact a_program_of_moos --nocapture --test-threads=1\n",
        own.display()
    );
    elk.script(name, &text);
}

/// A client of elk's, and what it has heard and nobody has asked for.
struct Ear {
    client: Client,
    heard: VecDeque<(String, String)>,
}

impl Ear {
    /// Hears these variables.
    fn of(elk: &Elk, variables: &[&str]) -> Self {
        let mut client = elk.join("Tester");
        variables.iter().for_each(|variable| client.comms.register(*variable).unwrap());
        client.comms.flush().unwrap();
        Self { client, heard: VecDeque::new() }
    }

    /// What a variable says next, as text.
    fn next(&mut self, variable: &str) -> String {
        let patience = Patience::new();
        loop {
            if let Some(place) = self.heard.iter().position(|(key, _)| key == variable) {
                return self.heard.remove(place).unwrap().1;
            }
            patience.left(format_args!("{variable} is heard"));
            let heard = &mut self.heard;
            let mut note = |mail: &elk_bus::Mail<'_>| {
                let number = || mail.as_double().map(|number| number.to_string());
                heard.extend(
                    mail.as_text().map(str::to_owned).or_else(number).map(|text| (mail.key().to_owned(), text)),
                );
            };
            self.client.receive(Duration::from_millis(100), &mut note).unwrap();
        }
    }

    fn say(&mut self, variable: &str, number: f64) {
        self.client.comms.notify(variable, number).unwrap();
        self.client.comms.flush().unwrap();
    }
}

/// The test's folder at the head of `PATH`.
fn path(elk: &Elk) -> std::ffi::OsString {
    let path = std::env::var_os("PATH").unwrap();
    std::env::join_paths([elk.folder().to_owned()].into_iter().chain(std::env::split_paths(&path))).unwrap()
}

#[test]
fn a_program_of_moos_is_an_app_like_any() {
    let elk = Elk::new("moos-app");
    program(&elk, "pTest");
    let app = "<App name=\"pEcho\" exec=\"pTest\" moos=\"true\" args=\"--fast\" restart=\"on-failure\"><Colour>red</Colour>\
               <Page>http://there</Page></App>";
    std::fs::write(elk.folder().join("m.xml"), small("manual", app)).unwrap();
    let mut command = elk.command(&["launch", "m.xml", "--headless", "--community", elk.community()]);
    command.env("PATH", path(&elk));
    let mut mission = elk.spawn("said.txt", command);
    mission.wait_for("note: clients of MOOS' connect at 127.0.0.1:");
    let mut ear = Ear::of(&elk, &["TOLD_pEcho", "ANSWER"]);
    let told = |block: &str| format!("{} {block} --fast", elk.community());
    // What a swap says anew comes last.
    let red = told("Colour = red;Page = \"http://there\"");
    let blue = told("Page = \"http://there\";Colour = blue");
    assert_eq!(ear.next("TOLD_pEcho"), red);
    ear.say("ASK", 7.0);
    assert_eq!(ear.next("ANSWER"), "7");
    let row = elk.row("pEcho");
    assert_eq!((row["type"].as_str(), row["state"].as_str()), (Some("moos"), Some("running")));

    common::kill(elk.process("pEcho"), Signal::KILL);
    assert_eq!(ear.next("TOLD_pEcho"), red, "it is started again");
    mission.wait_for("pEcho is back");
    common::kill(elk.process("db"), Signal::KILL);
    assert_eq!(ear.next("TOLD_pEcho"), red, "it finds the next broker where the last one was");

    let said = elk.obeyed(&["swap", "pEcho", "Colour=blue"]);
    assert!(said.contains("pEcho is swapped") && said.contains("nobody was there for"), "{said}");
    while ear.next("TOLD_pEcho") != blue {}
    let said = elk.refused(&["swap", "pEcho", "exec=/bin/false", "moos=true"]);
    assert!(said.contains("ended before it registered") && said.contains("the old pEcho is started again"), "{said}");
    while ear.next("TOLD_pEcho") != blue {}
    let said = elk.refused(&["swap", "pEcho", "ServerPort=9000"]);
    assert!(said.contains("ServerPort is what the mission tells all of MOOS' programs"), "{said}");
    elk.obeyed(&["stop", "pEcho"]);
    elk.obeyed(&["start", "pEcho"]);
    drop(ear);
    common::kill(mission.id(), Signal::TERM);
    mission.end();
    elk.wait_until_deserted();
    let effective = std::fs::read_to_string(elk.run().join("m.effective.xml")).unwrap();
    assert!(effective.contains("<Bus moos=\"127.0.0.1:0\""), "the next run chooses its port: {effective}");
    assert!(Path::new(&elk.run().join("moos/pEcho.moos")).is_file());
}

#[test]
fn what_is_wrong_with_a_program_of_moos_is_said_before_anything_starts() {
    let elk = Elk::new("moos-wrong");
    let said = elk.launch_and_fail(&small("auto", "<App exec=\"pNowhere\" moos=\"true\"/>"));
    assert!(said.contains("there is no pNowhere in PATH"), "{said}");
    let file = elk.folder().join("mission.xml");
    let inside = elk.refused(&["launch", file.to_str().unwrap(), "--in-process", "--headless"]);
    assert!(inside.contains("there is no pNowhere in PATH"), "{inside}");
    let said = elk.launch_and_fail(&small("auto", "<App exec=\"/bin/true\" moos=\"maybe\"/>"));
    assert!(said.contains("moos \"maybe\" is not offered; right is true, false or a .moos file"), "{said}");
}

/// Such as pAntler launches.
const ANTLER: &str = "// A mission of MOOS'.
ServerHost = localhost
ServerPort = ${PORT}
Community = COMMUNITY
define: PORT = 0
Colour = none // only of all

ProcessConfig = ANTLER
{
  MSBetweenLaunches = 50
  Run = MOOSDB @ NewConsole = false
  Run = pTest  @ NewConsole = true, ExtraProcessParams = More ~ pOne
  Run = pTest  @ NewConsole = false ~ pTwo
  More = --fast, -v
}
ProcessConfig = pOne
{
  Colour = red // of one
}
ProcessConfig = pTwo
{
  Colour = blue
}
";

#[test]
fn a_mission_of_moos_is_launched_as_pantler_does() {
    let elk = Elk::new("moos-antler");
    program(&elk, "pTest");
    let file = ANTLER.replace("COMMUNITY", elk.community());
    std::fs::write(elk.folder().join("old.moos"), &file).unwrap();
    let mut command = elk.command(&["launch", "old.moos", "--headless"]);
    command.env("PATH", path(&elk)).env_remove("ELK_COMMUNITY");
    let mut mission = elk.spawn("said.txt", command);
    mission.wait_for("note: clients of MOOS' connect at localhost:");
    let mut ear = Ear::of(&elk, &["TOLD_pOne", "TOLD_pTwo"]);
    assert_eq!(ear.next("TOLD_pOne"), format!("{} Colour = red // of one --fast -v", elk.community()));
    assert_eq!(ear.next("TOLD_pTwo"), format!("{} Colour = blue ", elk.community()));
    assert_eq!(elk.row("pOne")["type"], "moos");
    let said = mission.said();
    assert!(
        said.contains("old.moos:12: NewConsole: elk opens no window") && !said.contains("old.moos:12, 13"),
        "{said}"
    );
    assert!(said.contains("old.moos:11: MOOSDB is not started"), "{said}");
    // They end of their own accord, and with them the mission.
    ear.say("ASK", -1.0);
    drop(ear);
    let (code, said) = mission.end();
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("old: complete: all its apps have ended"), "{said}");
    elk.wait_until_deserted();
    assert_eq!(std::fs::read_to_string(elk.run().join("old.moos")).unwrap(), file, "the run keeps it");
    let again = elk.command(&["check", elk.run().to_str().unwrap()]).env("PATH", path(&elk)).output().unwrap();
    assert!(again.status.success(), "{}", common::said(&again));
    assert!(common::said(&again).contains("App moos pOne"), "{}", common::said(&again));
}
