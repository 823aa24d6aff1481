//! A mission made of the `ANTLER` block of a `.moos` file, which is what pAntler launches:
//! `Run = PROGRAM @ Option = Value, … ~ NAME`.

use std::collections::BTreeMap;
use std::path::Path;

use elk_bus::Community;
use elk_bus::moos::gateway::Address;

use crate::bus;
use crate::draft::Draft;
use crate::moos::{self, Line, MoosFile, is_name};
use crate::name::{is_app_name, right_app_names};
use crate::nearest::nearest;
use crate::policy::SaidOfBroker;
use crate::problem::{At, Findings};
use crate::scenario::Scenario;
use crate::spec::{Mode, Via};

/// The block that is pAntler's; case does not count.
const BLOCK: &str = "Antler";
/// Where programs are looked for, said of one or of all: anywhere in `PATH`.
const SYSTEM: [&str; 2] = ["SYSTEM", "SYSTEMPATH"];
/// How long pAntler waits between two programs if the file does not say (ms).
const PAUSE_MS: f64 = 1000.0;
/// The longest such pause that is waited for (ms).
const LONGEST_PAUSE_MS: f64 = 60_000.0;

/// What a `Run` line can say of a program.
const OPTIONS: [&str; 7] =
    ["NewConsole", "Path", "XConfig", "Win32Config", "ExtraProcessParams", "InhibitMOOSParams", "AntlerID"];

/// What of a file is not as pAntler has it: in which lines, by what there is to be said of it.
#[derive(Default)]
struct Notes(BTreeMap<&'static str, Vec<usize>>);

impl Notes {
    fn add(&mut self, line: &Line<'_>, said: &'static str) {
        self.0.entry(said).or_default().push(line.at);
    }

    /// For people, each with the file and its lines.
    fn located(self, file: &Path, text: &str) -> Vec<String> {
        let row = |at: &usize| (text.get(..*at).unwrap_or_default().matches('\n').count() + 1).to_string();
        let mut notes: Vec<_> = self.0.into_iter().collect();
        notes.sort_by_key(|(_, lines)| lines.first().copied());
        let said = |(said, lines): (&str, Vec<usize>)| {
            let rows = lines.iter().map(row).collect::<Vec<_>>().join(", ");
            format!("{}:{rows}: {said}", file.display())
        };
        notes.into_iter().map(said).collect()
    }
}

const NO_CONSOLE: &str = "NewConsole: elk opens no window; what the program prints is in the run's folder, in NAME.log";
const NO_XTERM: &str = "XConfig and Win32Config are for windows, of which elk opens none";
const NO_DB: &str = "MOOSDB is not started: elk's broker is there in its place, at ServerHost and ServerPort";
const ELSEWHERE: &str = "it is for another machine's pAntler (AntlerID), and is not started here";
const UNTOLD: &str = "EnableDistributed: no other pAntler is told of the mission";
const NO_PAGE: &str = "WebServerPort: elk's broker serves no page of its own; `elk view` shows the community";

/// Reads the text of a `.moos` file. `None`: it launches nobody, and why is a problem.
pub(crate) fn read(text: &str, file: &Path, problems: &mut Findings) -> Option<Scenario> {
    let moos = MoosFile::read(text);
    let whole = At::Byte(0);
    let Some(block) = moos.block(BLOCK) else {
        let found =
            moos.lines.iter().find(|line| line.words.to_ascii_lowercase().contains(&BLOCK.to_ascii_lowercase()));
        let at = found.map_or(whole, |line| At::Byte(line.at));
        problems.add(
            &at,
            "there is no ANTLER block that pAntler would find; right is ProcessConfig = ANTLER, and below it { and } in \
             lines of their own",
        );
        return None;
    };
    let mut reader = Reader { file, moos: &moos, block, notes: Notes::default(), problems };
    let bus = reader.bus();
    let (community, broker) = (reader.community(), reader.broker());
    let launch_pause_secs = reader.pause_ms() / 1000.0;
    let drafts = reader.drafts();
    if let Some((line, _)) = moos.value("WebServerPort") {
        reader.notes.add(line, NO_PAGE);
    }
    let notes = reader.notes.located(file, text);
    if drafts.is_empty() {
        problems.add(&At::Byte(0), "its ANTLER block runs no program of MOOS'; right is Run = PROGRAM");
    }
    let stem = file.file_stem().map(|stem| stem.to_string_lossy().into_owned());
    let name = stem.unwrap_or_else(|| "mission".to_owned());
    let at = At::Byte(0);
    Some(Scenario { at, name, mode: Mode::Auto, broker, community, launch_pause_secs, drafts, bus, notes })
}

struct Reader<'a, 'b> {
    file: &'a Path,
    moos: &'a MoosFile<'a>,
    block: &'a [Line<'a>],
    notes: Notes,
    problems: &'b mut Findings,
}

/// A value of the file, and where it stands.
type Said = Option<(String, At)>;

impl<'a> Reader<'a, '_> {
    /// What the file says of the whole community.
    fn global(&mut self, name: &str) -> Said {
        let (line, value) = self.moos.value(name)?;
        self.expanded(line, value)
    }

    /// What the block says.
    fn param(&mut self, name: &str) -> Said {
        let pair =
            |line: &'a Line<'a>| line.pair().filter(|(key, _)| is_name(key, name)).map(|(_, value)| (line, value));
        let (line, value) = self.block.iter().find_map(pair)?;
        self.expanded(line, value)
    }

    fn expanded(&mut self, line: &Line<'_>, value: &str) -> Said {
        let at = At::Byte(line.at);
        let value = self.moos.expanded(value, &at, self.problems);
        (!value.is_empty()).then_some((value, at))
    }

    /// A number of the file; nothing if it is none, which is a problem.
    fn number(&mut self, said: Said, name: &str, max: f64) -> Option<f64> {
        let (value, at) = said?;
        let number = value.parse::<f64>().ok().filter(|number| (0.0..=max).contains(number));
        if number.is_none() {
            self.problems.add(&at, format!("{name} is {value:?}; right is a number from 0 to {max}"));
        }
        number
    }

    /// Where clients connect: on this machine, as a file has no word for who else may.
    fn bus(&mut self) -> Option<bus::Said> {
        let host = self.global(moos::HOST).unwrap_or_else(|| ("localhost".to_owned(), At::Byte(0)));
        let port = self.global(moos::PORT).unwrap_or_else(|| ("9000".to_owned(), host.1.clone()));
        let is_local = host.0.eq_ignore_ascii_case("localhost") || host.0.starts_with("127.");
        if !is_local {
            let said = format!(
                "{} is {:?}: the broker of a .moos file lets clients of this machine in; right is localhost, or a mission with \
                 <Bus moos=\"HOST:PORT\" from=\"NETWORK\"/>",
                moos::HOST,
                host.0
            );
            self.problems.add(&host.1, said);
            return None;
        }
        match format!("{}:{}", host.0, port.0).parse::<Address>() {
            Ok(address) => Some(bus::Said::at(host.1, address)),
            Err(error) => {
                self.problems.add(&port.1, format!("{} is {:?}: {error}", moos::PORT, port.0));
                None
            }
        }
    }

    fn community(&mut self) -> Option<Community> {
        let (value, at) = self.global(moos::COMMUNITY)?;
        Community::new(value).map_err(|error| self.problems.add(&at, format!("{}: {error}", moos::COMMUNITY))).ok()
    }

    fn broker(&mut self) -> SaidOfBroker {
        let mut broker = SaidOfBroker::default();
        if let Some((value, at)) = self.global(moos::TIME_WARP)
            && let Some(Err(error)) = broker.take("time-warp", &value)
        {
            self.problems.add(&at, format!("{} {error}", moos::TIME_WARP));
        }
        broker
    }

    fn pause_ms(&mut self) -> f64 {
        let said = self.param("MSBetweenLaunches");
        self.number(said, "MSBetweenLaunches", LONGEST_PAUSE_MS).unwrap_or(PAUSE_MS)
    }

    /// The programs that are to be started, in the order of the file.
    fn drafts(&mut self) -> Vec<Draft> {
        let distributed = self.param("EnableDistributed").is_some_and(|(value, _)| is_true(&value));
        let folder = self.param("ExecutablePath").map(|(folder, _)| folder);
        let mut drafts = Vec::new();
        for line in self.block {
            match line.pair() {
                Some((key, value)) if is_name(key, "Run") => {
                    drafts.extend(self.run(line, value, folder.as_deref(), distributed));
                }
                Some((key, _)) if is_name(key, "EnableDistributed") && distributed => self.notes.add(line, UNTOLD),
                _ => {}
            }
        }
        drafts
    }

    /// One `Run` line; nothing: it is not to be started here.
    fn run(&mut self, line: &Line<'_>, value: &str, folder: Option<&str>, distributed: bool) -> Option<Draft> {
        let (value, at) = self.expanded(line, value).or_else(|| {
            self.problems
                .add(&At::Byte(line.at), "Run says no program; right is Run = PROGRAM @ Option = Value ~ NAME");
            None
        })?;
        let (rest, name) = value.split_once('~').map_or((value.as_str(), ""), |(rest, name)| (rest, name.trim()));
        let (program, options) = rest.split_once('@').unwrap_or((rest, ""));
        let program = program.trim();
        let own = program.rsplit('/').next().unwrap_or(program);
        let name = if name.is_empty() { own } else { name };
        let options = self.options(line, &at, options);
        let says = |option: &str| options.get(option).is_some_and(|value| is_true(value));
        // In its place elk's broker is.
        if own == "MOOSDB" {
            self.notes.add(line, NO_DB);
            return None;
        }
        if distributed && options.contains_key("AntlerID") {
            self.notes.add(line, ELSEWHERE);
            return None;
        }
        if says("NewConsole") {
            self.notes.add(line, NO_CONSOLE);
        }
        if options.keys().any(|option| ["XConfig", "Win32Config"].contains(option)) {
            self.notes.add(line, NO_XTERM);
        }
        if says("InhibitMOOSParams") {
            let said = format!(
                "InhibitMOOSParams: {program} would not be told where the community is, and elk waits for every app to join it; \
                 right is to start it by hand, or a mission with <App name=\"{name}\" exec=…>"
            );
            self.problems.add(&at, said);
            return None;
        }
        if !is_app_name(name) {
            let said = format!("{name:?} is no name for an app; right are {}", right_app_names());
            self.problems.add(&at, said);
            return None;
        }
        let args = self.more_arguments(&at, options.get("ExtraProcessParams").map(String::as_str));
        let folder = options.get("Path").map(String::as_str).or(folder);
        let folder = folder.filter(|folder| !SYSTEM.iter().any(|system| system.eq_ignore_ascii_case(folder)));
        let exec = folder.map_or(program.to_owned(), |folder| format!("{}/{program}", folder.trim_end_matches('/')));
        Some(Draft::of_program(name, at, exec, args, Via::of_file(self.file)))
    }

    /// `Option = Value, …`, by the names that pAntler knows.
    fn options(&mut self, line: &Line<'_>, at: &At, said: &str) -> BTreeMap<&'static str, String> {
        let mut options = BTreeMap::new();
        for (name, value) in said.split(',').filter_map(|one| one.split_once('=')) {
            match OPTIONS.iter().find(|option| is_name(option, name)) {
                Some(option) => _ = options.insert(*option, value.trim().to_owned()),
                None => match nearest(name.trim(), OPTIONS) {
                    Some(meant) => {
                        self.problems.add(at, format!("{} is no option of Run; did you mean {meant}?", name.trim()));
                    }
                    None => self
                        .notes
                        .add(line, "Run has an option that pAntler does not know, and that means nothing here"),
                },
            }
        }
        options
    }

    /// What `ExtraProcessParams` names: a parameter of the block, whose words stand between commas.
    fn more_arguments(&mut self, at: &At, name: Option<&str>) -> Vec<String> {
        let Some(name) = name else { return Vec::new() };
        let Some((value, _)) = self.param(name) else {
            self.problems.add(at, format!("ExtraProcessParams names {name}, which the ANTLER block does not have"));
            return Vec::new();
        };
        value.split(',').map(|word| word.trim().to_owned()).filter(|word| !word.is_empty()).collect()
    }
}

/// As MOOS has it.
fn is_true(value: &str) -> bool {
    value.eq_ignore_ascii_case("true") || value.parse::<f64>().is_ok_and(|number| number > 0.0)
}
