//! From the XML of a Scenario to a checked mission, collecting everything that is wrong on the way.

use std::collections::BTreeMap;
use std::path::Path;

use elk_bus::Community;
use roxmltree::{Document, Node, ParsingOptions};

use crate::bus::{self, BUS};
use crate::draft::{self, Context, Draft};
use crate::element::{self, Count, ELEMENTS};
use crate::nearest::instead;
use crate::policy::{self, SaidOfBroker};
use crate::problem::{At, Findings};
use crate::registry::Registry;
use crate::setting::Override;
use crate::spec::{AppSpec, Mission, Mode};
use crate::xml::{crowded, loose_text};
use crate::{variables, wiring};

/// The most apps of a mission: each is a process.
const MOST_APPS: usize = 1000;
/// The most elements, texts and comments of a file.
const MOST_NODES: u32 = 100_000;

/// Names on the bus that no app can have: the broker's own, and the launcher's.
const RESERVED: [&str; 2] = ["db", "launcher"];

/// A sensor that has it plays a recording.
const RECORDING: &str = "Recording";
/// A controller that has it plays recordings.
const RATE: &str = "Rate";

/// A mission as a file says it, before its apps are held against their types.
pub(crate) struct Scenario {
    /// Where it stands.
    pub at: At,
    pub name: String,
    pub mode: Mode,
    pub broker: SaidOfBroker,
    /// The community that it is launched in, unless somebody says another.
    pub community: Option<Community>,
    /// How long the start of an app that may end of its own accord waits for the one before (s).
    pub launch_pause_secs: f64,
    pub drafts: Vec<Draft>,
    pub bus: Option<bus::Said>,
    /// What of the file is not as it says.
    pub notes: Vec<String>,
}

/// Reads the XML of a mission file; what is wrong goes to `problems`. `None`: not even a Scenario.
pub(crate) fn read(text: &str, file: &Path, registry: &Registry, problems: &mut Findings) -> Option<Scenario> {
    if let Some((at, what)) = crowded(text) {
        problems.add(&At::Byte(at.saturating_sub(1)), what);
        return None;
    }
    let options = ParsingOptions { nodes_limit: MOST_NODES, ..ParsingOptions::default() };
    let document = match Document::parse_with_options(text, options) {
        Ok(document) => document,
        Err(error) => {
            no_xml(&error, text, problems);
            return None;
        }
    };
    let folder = file.parent().unwrap_or(Path::new(""));
    let context = Context { registry, folder };
    let scenario = document.root_element();
    let at = At::Byte(scenario.range().start);
    if scenario.tag_name().name() != "Scenario" {
        let found = scenario.tag_name().name();
        problems.add(&at, format!("the mission is a <{found}>; right is <Scenario>"));
        return None;
    }
    let mut said = head(scenario, at, file, problems);
    (said.drafts, said.bus) = drafts(&context, scenario, problems);
    Some(said)
}

impl Scenario {
    /// The mission that it is, as far as nothing is wrong with it.
    pub fn settled(
        self,
        text: &str,
        file: &Path,
        registry: &Registry,
        overrides: &[Override],
        problems: &mut Findings,
    ) -> Mission {
        let Self { at, name, mode, broker, community, launch_pause_secs, mut drafts, bus, notes } = self;
        count(&drafts, &at, problems);
        draft::suppose_elements(&mut drafts, registry, &at);
        names(&mut drafts, problems);
        apply(overrides, &mut drafts, registry, problems);
        let moos = bus::gateway(bus, &mut drafts, problems);
        wiring::connect(&mut drafts, problems);
        variables::check(&drafts, problems);
        let mode = wiring::manual(&drafts).unwrap_or(mode);
        let apps: Vec<AppSpec> = drafts.into_iter().filter_map(|draft| draft.resolve(problems)).collect();
        let (file, bytes) = (file.to_owned(), text.as_bytes().to_vec());
        let (broker, mailbox_mb, time_warp) = (broker.policy(), broker.mailbox_mb(), broker.time_warp());
        Mission {
            name,
            file,
            bytes,
            mode,
            broker,
            mailbox_mb,
            time_warp,
            community,
            launch_pause_secs,
            moos,
            apps,
            notes,
        }
    }
}

fn no_xml(error: &roxmltree::Error, text: &str, problems: &mut Findings) {
    if matches!(error, roxmltree::Error::DtdDetected) {
        let said = "a mission has no <!DOCTYPE …>; right is to take it out, and what it defines along with it";
        return problems.add(&At::Byte(doctype(text)), said);
    }
    let position = error.pos();
    let at = At::Byte(byte_of(text, position));
    let said = error.to_string();
    let said = said.strip_suffix(&format!(" at {position}")).unwrap_or(&said);
    problems.add(&at, format!("this is no well-formed XML: {said}"));
}

/// Where the document type is declared: behind a declaration, comments and processing instructions only.
fn doctype(text: &str) -> usize {
    let mut rest = text;
    loop {
        rest = rest.trim_start_matches(|letter: char| letter.is_whitespace() || letter == '\u{feff}');
        let end = if rest.starts_with("<!--") { "-->" } else { "?>" };
        match rest.starts_with("<!--") || rest.starts_with("<?") {
            true => rest = rest.split_once(end).map_or("", |(_, behind)| behind),
            false => return text.len() - rest.len(),
        }
    }
}

/// The byte at a position whose line and column are counted from 1.
fn byte_of(text: &str, position: roxmltree::TextPos) -> usize {
    let (above, before) = (position.row.saturating_sub(1) as usize, position.col.saturating_sub(1) as usize);
    let start: usize = text.split_inclusive('\n').take(above).map(str::len).sum();
    let letters = text.get(start..).unwrap_or_default().chars().take(before);
    start + letters.map(char::len_utf8).sum::<usize>()
}

/// The Scenario's own attributes.
fn head(scenario: Node, at: At, file: &Path, problems: &mut Findings) -> Scenario {
    let (mut community, mut launch_pause_secs) = (None, 0.0);
    let stem = file.file_stem().map(|stem| stem.to_string_lossy().into_owned());
    let mut name = stem.unwrap_or_else(|| "mission".to_owned());
    let mut mode = Mode::Auto;
    let mut broker = SaidOfBroker::default();
    for attribute in scenario.attributes() {
        let at = At::Byte(attribute.range_value().start);
        match (attribute.name(), attribute.value().trim()) {
            ("name", "") => problems.add(&at, "the name is empty; right is a name for people"),
            ("name", value) => name = value.to_owned(),
            ("type", "auto") => mode = Mode::Auto,
            ("type", "manual") => mode = Mode::Manual,
            ("type", value) => {
                let right = instead(value, &["auto", "manual"]);
                problems.add(&at, format!("a Scenario of type {value:?} is unknown; {right}"));
            }
            ("version", "1") => {}
            ("version", value) => {
                problems.add(&at, format!("version {value:?} is unknown; right is \"1\""));
            }
            ("community", value) => match Community::new(value) {
                Ok(name) => community = Some(name),
                Err(error) => problems.add(&at, error.to_string()),
            },
            (policy::LAUNCH_PAUSE, value) => match policy::launch_pause(value) {
                Ok(secs) => launch_pause_secs = secs,
                Err(error) => problems.add(&at, format!("{} {error}", policy::LAUNCH_PAUSE)),
            },
            (other, value) if policy::is_of_broker(other) => {
                if let Some(Err(error)) = broker.take(other, value) {
                    problems.add(&at, format!("{other} {error}"));
                }
            }
            (other, _) => {
                let at = At::Byte(attribute.range().start);
                let mut known = vec!["name", "type", "version", "community", policy::LAUNCH_PAUSE];
                known.extend(policy::OF_BROKER.iter().map(|attribute| attribute.name));
                let right = instead(other, &known);
                problems.add(&at, format!("Scenario has no attribute {other}; {right}"));
            }
        }
    }
    let (drafts, bus, notes) = (Vec::new(), None, Vec::new());
    Scenario { at, name, mode, broker, community, launch_pause_secs, drafts, bus, notes }
}

/// The apps, and who else may come to the broker.
fn drafts(context: &Context, scenario: Node, problems: &mut Findings) -> (Vec<Draft>, Option<bus::Said>) {
    loose_text(scenario, problems);
    let (mut drafts, mut bus) = (Vec::new(), None);
    for node in scenario.children().filter(Node::is_element) {
        let element = node.tag_name().name();
        if drafts.len() == MOST_APPS {
            let at = At::Byte(node.range().start);
            problems.add(&at, format!("one app more than {MOST_APPS}; right is a mission of at most so many"));
            break;
        }
        if element::named(element).is_some() {
            drafts.push(Draft::read(context, node, problems));
        } else if element == BUS {
            if bus.is_some() {
                problems.add(&At::Byte(node.range().start), format!("a second <{BUS}>; one is right"));
            }
            bus = Some(bus::read(node, problems));
        } else {
            let known: Vec<&str> = ELEMENTS.iter().map(|one| one.name).chain([BUS]).collect();
            let at = At::Byte(node.range().start);
            let right = instead(element, &known);
            problems.add(&at, format!("<{element}> is no element of a Scenario; {right}"));
        }
    }
    (drafts, bus)
}

/// A mission explores, and has what that takes; or it is programs of somebody else's that only want a community.
fn count(drafts: &[Draft], scenario: &At, problems: &mut Findings) {
    let is_stage = |draft: &Draft| ![element::APP, element::LOGGER].contains(&draft.element.as_str());
    if drafts.iter().any(|draft| draft.element == element::APP) && !drafts.iter().any(is_stage) {
        return;
    }
    for element::Element { name: element, count, .. } in ELEMENTS {
        let mut of_element = drafts.iter().filter(|draft| draft.element == element);
        let first = of_element.next();
        if element == element::EXPLORER {
            played_or_explored(drafts, scenario, problems);
        }
        if first.is_none() && count == Count::One {
            problems.add(scenario, format!("the Scenario has no <{element}>; right is one"));
        }
        if count != Count::Any {
            for more in of_element {
                problems.add(&more.at, format!("a second <{element}>; one is right"));
            }
        }
    }
}

/// A recording goes where it went: it is played, by a controller that plays, and nobody explores. Any other sensor is sent where an
/// explorer says.
fn played_or_explored(drafts: &[Draft], scenario: &At, problems: &mut Findings) {
    let of = |element: &str| drafts.iter().find(|draft| draft.element == element);
    let (sensor, explorer, controller) =
        (of(element::SENSOR), of(element::EXPLORER), of(element::CONTROLLER).filter(|one| one.is_builtin()));
    let plays = |controller: &Draft| controller.spec(RATE).is_some();
    if sensor.is_some_and(|sensor| sensor.spec(RECORDING).is_some()) {
        let goes = "the Sensor is a recording, which goes where it went";
        if let Some(explorer) = explorer {
            problems.add(&explorer.at, format!("{goes}; right is no <{}>", element::EXPLORER));
        }
        if let Some(controller) = controller.filter(|controller| !plays(controller)) {
            problems.add(&controller.at, format!("{goes}; right is a <Controller type=\"Playback\">"));
        }
        return;
    }
    if let (Some(controller), Some(_)) = (controller.filter(|controller| plays(controller)), sensor) {
        let right = "the Sensor is no recording that this Controller could play; right is one with a parameter";
        problems.add(&controller.at, format!("{right} {RECORDING}, or another Controller"));
    } else if explorer.is_none() {
        problems.add(scenario, format!("the Scenario has no <{}>; right is one", element::EXPLORER));
    }
}

/// Names those that the file does not (`Filter`, `Filter2`, …), and sees that every name is the only one.
fn names(drafts: &mut [Draft], problems: &mut Findings) {
    let mut taken: BTreeMap<String, String> = BTreeMap::new();
    for draft in drafts.iter().filter(|draft| draft.named.is_some()) {
        let name = draft.name();
        if RESERVED.iter().any(|reserved| reserved.eq_ignore_ascii_case(name)) {
            let said = format!("the name {name} is taken by elk itself; choose another one");
            problems.add(draft.name_at(), said);
        } else if let Some(element) = taken.insert(name.to_owned(), draft.element.clone()) {
            let said = format!("the name {name} is already that of a <{element}>; names are unique");
            problems.add(draft.name_at(), said);
        }
    }
    for draft in drafts.iter_mut().filter(|draft| draft.named.is_none()) {
        let (mut name, mut number) = (draft.element.clone(), 1);
        while taken.contains_key(&name) {
            number += 1;
            name = format!("{}{number}", draft.element);
        }
        taken.insert(name.clone(), draft.element.clone());
        draft.named = Some((name, draft.at.clone()));
    }
}

fn apply(overrides: &[Override], drafts: &mut [Draft], registry: &Registry, problems: &mut Findings) {
    // What runs is said before what it is told, in whatever order they stand.
    let says_what_runs = |one: &&Override| matches!(one.param.as_str(), "type" | "exec" | "pipe");
    let (programs, params): (Vec<&Override>, Vec<&Override>) = overrides.iter().partition(says_what_runs);
    for one in programs.into_iter().chain(params) {
        let at = At::CommandLine(one.to_string());
        match drafts.iter_mut().find(|draft| draft.name() == one.app) {
            Some(draft) => draft.override_with(one, at, registry, problems),
            None => {
                let names: Vec<&str> = drafts.iter().map(Draft::name).collect();
                let right = instead(&one.app, &names);
                problems.add(&at, format!("the mission has no app {}; {right}", one.app));
            }
        }
    }
}
