//! A suite as its file says it: which worlds, which strategies, how many starts, and what a run may take at most.

use std::collections::BTreeSet;
use std::fmt;
use std::path::{Path, PathBuf};

use elk_mission::{Override, crowded, instead};
use elk_outside::file;
use roxmltree::{Attribute, Document, Node};

/// The longest suite that is read (bytes).
const LONGEST: u64 = 512_000;
/// The most of worlds, strategies and starts.
const MOST: u64 = 10_000;
/// The most runs.
const MOST_RUNS: usize = 1_000_000;
/// Mistakes that are told; further ones are not looked up.
const MOST_TOLD: usize = 100;

/// What is to be evaluated.
#[derive(Debug, Clone)]
pub struct Suite {
    /// Its name: what the results' folder is called after.
    pub name: String,
    /// What it is for, for people.
    pub about: String,
    /// The file that it was read from.
    pub file: PathBuf,
    /// Seed of the starts.
    pub seed: u64,
    /// Starts in each world, the same for all strategies.
    pub starts: usize,
    /// What a run may take.
    pub limits: Limits,
    /// The worlds, in the order of the file.
    pub worlds: Vec<WorldEntry>,
    /// The strategies, in the order of the file; the others are compared with the first.
    pub strategies: Vec<StrategyEntry>,
}

/// What a run may take; one that takes more has failed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Scans.
    pub scans: u64,
    /// Length of the way (m).
    pub way_m: f64,
    /// Time that the robot would be on its way (s, computed from its speed and turn rate); infinite: as long as it likes.
    pub travel_secs: f64,
    /// Time (s, of the wall) in which an app has to answer a message: a strategy that does not is given up.
    pub answer_secs: f64,
}

impl Default for Limits {
    fn default() -> Self {
        Self { scans: 10_000, way_m: 100_000.0, travel_secs: f64::INFINITY, answer_secs: 120.0 }
    }
}

/// A world, and the mission that is run in it.
#[derive(Debug, Clone)]
pub struct WorldEntry {
    /// What its rows are called.
    pub name: String,
    /// Where the mission comes from.
    pub source: Source,
    /// What of the mission is said otherwise.
    pub sets: Vec<Override>,
    /// What others have measured in it.
    pub references: Vec<Reference>,
    /// Where it stands in the suite.
    pub at: Place,
}

/// Where a mission comes from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Source {
    /// A mission file, or one that is built in.
    Mission(String),
    /// A world's file, in the plainest of missions.
    World(String),
}

impl Source {
    /// The name of its file, without folder and ending.
    pub fn stem(&self) -> String {
        let (Self::Mission(from) | Self::World(from)) = self;
        Path::new(from).file_stem().unwrap_or_default().to_string_lossy().into_owned()
    }
}

/// A strategy with its parameters.
#[derive(Debug, Clone)]
pub struct StrategyEntry {
    /// What its rows are called.
    pub name: String,
    /// What runs.
    pub runs: Runs,
    /// Its parameters.
    pub settings: Vec<(String, String)>,
    /// Where it stands in the suite.
    pub at: Place,
}

/// What runs as a strategy.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Runs {
    /// An explorer of this type.
    Type(String),
    /// A program that reads and writes lines, with its arguments. A path with a folder is the suite's.
    Pipe(String),
    /// A program that is on the bus itself, with its arguments. A path with a folder is the suite's.
    Exec(String),
}

/// A length of way that somebody else has measured.
#[derive(Debug, Clone, PartialEq)]
pub struct Reference {
    /// The strategy, by the name that it has in this suite, or another one.
    pub strategy: String,
    /// Length of the way, on the mean (m).
    pub way_m: f64,
    /// Standard deviation (m), if it is said.
    pub sd_m: Option<f64>,
    /// Where it is published.
    pub source: String,
}

/// Line and column in the suite, from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// Line.
    pub line: u32,
    /// Column.
    pub column: u32,
}

/// Why there is no suite.
#[derive(Debug, thiserror::Error)]
pub enum SuiteError {
    /// The file cannot be read.
    #[error("cannot read the suite {}: {source}; right is an XML file as those of mission-files/suites", .file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Everything that is wrong with it.
    #[error("{}", Listed(.file, .problems))]
    Wrong {
        /// The file.
        file: PathBuf,
        /// What is wrong, and where.
        problems: Vec<(Place, String)>,
    },
}

struct Listed<'a>(&'a Path, &'a [(Place, String)]);

impl fmt::Display for Listed<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (n, (Place { line, column }, what)) in self.1.iter().enumerate() {
            let separator = if n > 0 { "\n" } else { "" };
            write!(f, "{separator}{}:{line}:{column}: {what}", self.0.display())?;
        }
        Ok(())
    }
}

impl Suite {
    /// Reads a suite.
    ///
    /// # Errors
    /// The file cannot be read, or everything that is wrong with it.
    pub fn load(path: &Path) -> Result<Self, SuiteError> {
        let text = file::read_text(path, LONGEST)
            .map_err(|source| SuiteError::Unreadable { file: path.to_owned(), source })?;
        Self::parse(&text, path)
    }

    /// Reads the text of a suite; `file` is named in errors, and files that it names are looked for beside it.
    ///
    /// # Errors
    /// Everything that is wrong with it.
    pub fn parse(text: &str, file: &Path) -> Result<Self, SuiteError> {
        let wrong = |problems| SuiteError::Wrong { file: file.to_owned(), problems };
        if let Some((byte, what)) = crowded(text) {
            let line = 1 + text[..byte].matches('\n').count() as u32;
            return Err(wrong(vec![(Place { line, column: 1 }, what)]));
        }
        let document = Document::parse(text).map_err(|error| {
            let at = Place { line: error.pos().row, column: error.pos().col };
            wrong(vec![(at, format!("this is no XML: {error}"))])
        })?;
        let mut reader = Reader { document: &document, problems: Vec::new() };
        let suite = reader.suite(document.root_element(), file);
        if reader.problems.is_empty() { Ok(suite) } else { Err(wrong(reader.problems)) }
    }
}

/// Reads elements, and collects what is wrong with them.
struct Reader<'a, 'input> {
    document: &'a Document<'input>,
    problems: Vec<(Place, String)>,
}

impl<'a, 'input> Reader<'a, 'input> {
    fn place(&self, byte: usize) -> Place {
        let at = self.document.text_pos_at(byte);
        Place { line: at.row, column: at.col }
    }

    fn wrong(&mut self, byte: usize, what: impl Into<String>) {
        if self.problems.len() >= MOST_TOLD {
            return;
        }
        let at = self.place(byte);
        self.problems.push((at, what.into()));
    }

    fn suite(&mut self, root: Node<'a, 'input>, file: &Path) -> Suite {
        if !root.has_tag_name("Suite") {
            self.wrong(root.range().start, format!("<{}> is no suite; right is <Suite>", root.tag_name().name()));
        }
        self.known(root, &["name", "about", "version", "seed", "starts"]);
        let stem = file.file_stem().unwrap_or_default().to_string_lossy();
        let mut suite = Suite {
            name: root.attribute("name").unwrap_or(&stem).to_owned(),
            about: root.attribute("about").unwrap_or_default().to_owned(),
            file: file.to_owned(),
            seed: self.count(root, "seed", 0..=u64::MAX).unwrap_or(1),
            starts: self.count(root, "starts", 1..=MOST).unwrap_or(30) as usize,
            limits: Limits::default(),
            worlds: Vec::new(),
            strategies: Vec::new(),
        };
        if let Some(version) = root.attribute_node("version").filter(|said| said.value().trim() != "1") {
            let what = format!("version is {}; this elk reads version 1", version.value());
            self.wrong(version.range_value().start, what);
        }
        self.name(root, &suite.name.clone());
        for child in root.children().filter(Node::is_element) {
            match child.tag_name().name() {
                "Limits" => suite.limits = self.limits(child),
                "World" => suite.worlds.extend(self.world(child)),
                "Explorer" => suite.strategies.extend(self.strategy(child)),
                other => {
                    let right = instead(other, &["Limits", "World", "Explorer"]);
                    self.wrong(child.range().start, format!("<{other}> is no part of a suite; {right}"));
                }
            }
        }
        self.loose_text(root);
        if suite.worlds.is_empty() {
            self.wrong(root.range().start, "the suite has no <World>");
        }
        if suite.strategies.is_empty() {
            self.wrong(root.range().start, "the suite has no <Explorer>");
        }
        let worlds: Vec<_> = suite.worlds.iter().map(|world| (world.name.clone(), world.at)).collect();
        let strategies: Vec<_> = suite.strategies.iter().map(|one| (one.name.clone(), one.at)).collect();
        self.once("world", &worlds);
        self.once("explorer", &strategies);
        for (what, count) in [("<World>", worlds.len()), ("<Explorer>", strategies.len())] {
            if count as u64 > MOST {
                self.wrong(root.range().start, format!("{count} times {what}; at most {MOST} are right"));
            }
        }
        let runs = suite.starts.saturating_mul(worlds.len()).saturating_mul(strategies.len());
        if runs > MOST_RUNS {
            self.wrong(
                root.range().start,
                format!("its starts, worlds and explorers make {runs} runs; at most {MOST_RUNS} are right"),
            );
        }
        suite
    }

    /// A name becomes part of file names and of tables.
    fn name(&mut self, node: Node<'a, 'input>, name: &str) {
        let is_name = !name.trim().is_empty() && name.len() <= 64 && !name.contains(['/', '|', '\n', '\0', '<', '>']);
        if !is_name || name.starts_with('.') {
            let at = node.attribute_node("name").map_or(node.range().start, |said| said.range_value().start);
            self.wrong(at, format!("{name:?} is no name; right is a short text without / | < >"));
        }
    }

    fn once(&mut self, what: &str, names: &[(String, Place)]) {
        let mut seen = BTreeSet::new();
        for (name, at) in names.iter().filter(|(name, _)| !seen.insert(name.clone())) {
            self.problems.push((*at, format!("there are two of the {what} {name}; give one of them another name")));
        }
    }

    fn limits(&mut self, node: Node<'a, 'input>) -> Limits {
        self.known(node, &["scans", "way", "travel", "answer"]);
        self.childless(node, &[]);
        let usual = Limits::default();
        Limits {
            scans: self.count(node, "scans", 1..=1_000_000_000).unwrap_or(usual.scans),
            way_m: self.number(node, "way", "m").unwrap_or(usual.way_m),
            travel_secs: self.number(node, "travel", "s").unwrap_or(usual.travel_secs),
            answer_secs: self.number(node, "answer", "s").unwrap_or(usual.answer_secs),
        }
    }

    fn world(&mut self, node: Node<'a, 'input>) -> Option<WorldEntry> {
        let said = |name: &str| node.attribute(name).map(|text| text.trim().to_owned());
        let source = match (said("mission"), said("file")) {
            (Some(mission), None) => Source::Mission(mission),
            (None, Some(file)) => Source::World(file),
            _ => {
                let right =
                    "right is either mission=\"…\" (a mission file, or a built-in one) or file=\"…\" (a world's file)";
                self.wrong(node.range().start, right);
                return None;
            }
        };
        let name = said("name").unwrap_or_else(|| source.stem());
        self.name(node, &name);
        let own = ["name", "mission", "file"];
        let sets = node.attributes().filter(|said| !own.contains(&said.name()));
        let sets = sets.filter_map(|said| self.set(&said)).collect();
        self.childless(node, &["Reference"]);
        let references = node.children().filter(|child| child.has_tag_name("Reference"));
        let references = references.filter_map(|child| self.reference(child)).collect();
        Some(WorldEntry { name, source, sets, references, at: self.place(node.range().start) })
    }

    /// `Map.Res="0.2"`
    fn set(&mut self, said: &Attribute<'a, 'input>) -> Option<Override> {
        let parsed = format!("{}={}", said.name(), said.value()).parse();
        if parsed.is_err() {
            let what =
                format!("{} is no attribute of <World>; right is name, mission, file, or App.Param=\"…\"", said.name());
            self.wrong(said.range().start, what);
        }
        parsed.ok()
    }

    fn reference(&mut self, node: Node<'a, 'input>) -> Option<Reference> {
        self.known(node, &["explorer", "way", "sd", "source"]);
        self.childless(node, &[]);
        let (strategy, way_m) = (node.attribute("explorer"), self.number(node, "way", "m"));
        if strategy.is_none() || node.attribute("way").is_none() {
            self.wrong(node.range().start, "a <Reference> says explorer=\"…\" and way=\"… m\"");
        }
        let source = node.attribute("source").unwrap_or_default().to_owned();
        Some(Reference { strategy: strategy?.to_owned(), way_m: way_m?, sd_m: self.number(node, "sd", "m"), source })
    }

    fn strategy(&mut self, node: Node<'a, 'input>) -> Option<StrategyEntry> {
        self.childless(node, &[]);
        let said = |name: &str| node.attribute(name).map(|text| text.trim().to_owned());
        let runs = match (said("type"), said("pipe"), said("exec")) {
            (Some(type_name), None, None) => Runs::Type(type_name),
            (None, Some(line), None) => Runs::Pipe(line),
            (None, None, Some(line)) => Runs::Exec(line),
            _ => {
                let right = "an <Explorer> says one of type=\"…\" (`elk types Explorer` lists them), pipe=\"…\", a program that reads and \
                             writes lines, and exec=\"…\", one that is on the bus itself";
                self.wrong(node.range().start, right);
                return None;
            }
        };
        let (Runs::Type(usual) | Runs::Pipe(usual) | Runs::Exec(usual)) = &runs;
        let name = node.attribute("name").unwrap_or(usual).to_owned();
        self.name(node, &name);
        let settings = node.attributes().filter(|said| !["name", "type", "pipe", "exec"].contains(&said.name()));
        let settings = settings.map(|said| (said.name().to_owned(), said.value().to_owned())).collect();
        Some(StrategyEntry { name, runs, settings, at: self.place(node.range().start) })
    }

    /// Complains of attributes that are none.
    fn known(&mut self, node: Node<'a, 'input>, names: &[&str]) {
        for said in node.attributes().filter(|said| !names.contains(&said.name())) {
            let what = format!(
                "{} is no attribute of <{}>; {}",
                said.name(),
                node.tag_name().name(),
                instead(said.name(), names)
            );
            self.wrong(said.range().start, what);
        }
    }

    /// Complains of elements and text that are out of place.
    fn childless(&mut self, node: Node<'a, 'input>, names: &[&str]) {
        for child in node.children().filter(Node::is_element) {
            let name = child.tag_name().name();
            if !names.contains(&name) {
                let what = format!("<{name}> is no part of <{}>: say it as an attribute", node.tag_name().name());
                self.wrong(child.range().start, what);
            }
        }
        self.loose_text(node);
    }

    fn loose_text(&mut self, node: Node<'a, 'input>) {
        for text in node.children().filter(Node::is_text) {
            let said = text.text().unwrap_or_default();
            if let Some(word) = said.split_whitespace().next() {
                let lead = said.len() - said.trim_start().len();
                let what = format!("{word:?} stands loose in <{}>; right is an attribute", node.tag_name().name());
                self.wrong(text.range().start + lead, what);
            }
        }
    }

    fn count(&mut self, node: Node<'a, 'input>, name: &str, range: std::ops::RangeInclusive<u64>) -> Option<u64> {
        let said = node.attribute_node(name)?;
        let count = said.value().trim().parse().ok().filter(|count| range.contains(count));
        if count.is_none() {
            let what = format!(
                "{name} is {:?}; right is a whole number from {} to {}",
                said.value(),
                range.start(),
                range.end()
            );
            self.wrong(said.range_value().start, what);
        }
        count
    }

    /// A positive number, with its unit or without.
    fn number(&mut self, node: Node<'a, 'input>, name: &str, unit: &str) -> Option<f64> {
        let said = node.attribute_node(name)?;
        let text = said.value().trim();
        let number = text.strip_suffix(unit).unwrap_or(text).trim().parse::<f64>().ok();
        let number = number.filter(|number| number.is_finite() && *number > 0.0);
        if number.is_none() {
            let what = format!("{name} is {:?}; right is a positive number of {unit}", said.value());
            self.wrong(said.range_value().start, what);
        }
        number
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Suite, String> {
        Suite::parse(text, Path::new("s.xml")).map_err(|error| error.to_string())
    }

    #[test]
    fn a_suite_says_worlds_strategies_starts_and_limits() {
        let suite = parse(
            "<Suite name='one' seed='7' starts='3'>\n<Limits scans='50' way='12.5 m' answer='3'/>\
             <World mission='../car.xml' Sensor.Width='24'><Reference explorer='A' way='9.78 m' sd='1.72'/></World>\
             <World name='b' file='$ELK_DATA/b.obj'/><Explorer name='A' type='ClosestFrontier' Policy='thesis'/></Suite>",
        )
        .unwrap();
        assert_eq!((suite.name.as_str(), suite.seed, suite.starts), ("one", 7, 3));
        assert_eq!((suite.limits.scans, suite.limits.way_m, suite.limits.answer_secs), (50, 12.5, 3.0));
        assert_eq!(suite.worlds[0].name, "car");
        assert_eq!(suite.worlds[0].sets[0].to_string(), "--set Sensor.Width=24");
        assert_eq!((suite.worlds[0].references[0].way_m, suite.worlds[0].references[0].sd_m), (9.78, Some(1.72)));
        assert_eq!(suite.worlds[1].source, Source::World("$ELK_DATA/b.obj".into()));
        assert_eq!(suite.strategies[0].settings, [("Policy".to_owned(), "thesis".to_owned())]);
    }

    #[test]
    fn thirty_starts_are_the_default() {
        let suite = parse("<Suite><World mission='car'/><Explorer type='A'/></Suite>").unwrap();
        assert_eq!((suite.name.as_str(), suite.starts), ("s", 30));
    }

    /// So many worlds and strategies, each by a name of its own.
    fn many(worlds: usize, strategies: usize) -> String {
        let worlds: String = (0..worlds).map(|i| format!("<World name='w{i}' mission='car'/>")).collect();
        let strategies = (0..strategies).map(|i| format!("<Explorer name='e{i}' type='A'/>"));
        worlds + &strategies.collect::<String>()
    }

    /// Regression: half a megabyte of attributes was looked at for half a minute, to tell each of its mistakes.
    #[test]
    fn of_many_mistakes_the_first_are_told() {
        let error = parse(&format!("<Suite>{}</Suite>", "<Wrold/>".repeat(60_000))).unwrap_err();
        assert_eq!(error.matches("<Wrold> is no part of a suite").count(), MOST_TOLD);
    }

    #[test]
    fn what_is_wrong_is_said_with_its_place() {
        let right = "<World mission='car'/><Explorer type='A'/>";
        for (text, said) in [
            (
                format!("<Suite strats='3'>{right}</Suite>"),
                "s.xml:1:8: strats is no attribute of <Suite>; did you mean starts?",
            ),
            (
                format!("<Suite starts='0'>{right}</Suite>"),
                "s.xml:1:16: starts is \"0\"; right is a whole number from 1",
            ),
            (format!("<Suite>\n {right}<World/></Suite>"), "s.xml:2:44: right is either mission="),
            (
                format!("<Suite>{right}<Explorer name='b' pipe='./mine' exec='./mine'/></Suite>"),
                "an <Explorer> says one of type=",
            ),
            (format!("<Suite>{right}<Explorer type='A'/></Suite>"), "there are two of the explorer A"),
            (format!("<Suite>{right}<Wrold/></Suite>"), "<Wrold> is no part of a suite; did you mean World?"),
            (format!("<Suite>{right}<Limits way='-1 m'/></Suite>"), "way is \"-1 m\"; right is a positive number of m"),
            (format!("<Suite name='a/b'>{right}</Suite>"), "\"a/b\" is no name"),
            (format!("<Suite version='2'>{right}</Suite>"), "version is 2; this elk reads version 1"),
            (format!("<Suite>word {right}</Suite>"), "s.xml:1:8: \"word\" stands loose in <Suite>"),
            ("<Suite><World mission='car'/></Suite>".to_owned(), "the suite has no <Explorer>"),
            (
                "<Suite><World mission='car' Res='1'/><Explorer type='A'/></Suite>".to_owned(),
                "Res is no attribute of <World>",
            ),
            (format!("<Suite starts='9999'>{}</Suite>", many(11, 10)), "make 1099890 runs; at most 1000000 are right"),
            (format!("<Suite starts='1'>{}</Suite>", many(10_001, 1)), "10001 times <World>; at most 10000 are right"),
            (format!("<Suite\n{}/>", "a='1' ".repeat(1001)), "s.xml:1:1: there are 2002 quotes in one element"),
            ("<Suite".to_owned(), "this is no XML"),
            ("<Scenario/>".to_owned(), "<Scenario> is no suite"),
        ] {
            let error = parse(&text).unwrap_err();
            assert!(error.contains(said), "{text}: {error}");
        }
    }
}
