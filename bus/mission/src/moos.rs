//! Programs of MOOS' in a mission: the `.moos` file that each is told of, and what may stand in one.
//!
//! A file is lines, `Name = Value`, of which the first of a name counts wherever it stands, and blocks, `ProcessConfig = NAME`
//! and, in lines of their own, `{ … }`, of which the first of a name counts as well. So what elk says comes first, and what
//! another file says besides may follow as it is.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::io;
use std::path::Path;

use elk_outside::file;

use crate::problem::{At, Findings};
use crate::resolve::Given;
use crate::spec::{AppSpec, Mission, Program, Via};

/// What every program of MOOS' is told of the community, by the mission and not by its own parameters.
pub(crate) const HOST: &str = "ServerHost";
pub(crate) const PORT: &str = "ServerPort";
pub(crate) const COMMUNITY: &str = "Community";
pub(crate) const TIME_WARP: &str = "MOOSTimeWarp";

/// The longest line that MOOS' programs read (bytes): beyond it they read nothing more of the file.
const LONGEST_LINE: usize = 1998;
const COMMENT: &str = "//";
const DEFINE: &str = "define:";

/// Where clients of MOOS' find a community.
#[derive(Debug, Clone, Copy)]
pub struct MoosServer<'a> {
    /// The host at which its broker listens for them.
    pub host: &'a str,
    /// The port.
    pub port: &'a str,
    /// Its name.
    pub community: &'a str,
    /// How many times as fast as the wall's its clock runs.
    pub time_warp: f64,
}

impl AppSpec {
    /// The `.moos` file that a program of MOOS' is to be told of, which says where it finds `server` and what its parameters
    /// are; nothing of any other app.
    ///
    /// # Errors
    /// The mission names a `.moos` file for it that cannot be read.
    pub fn moos_text(&self, server: &MoosServer<'_>) -> io::Result<Option<String>> {
        let Program::Foreign { via: Via::Moos(besides), .. } = &self.program else { return Ok(None) };
        let besides = besides.as_deref().map(|file| file::read_text(file, Mission::LONGEST)).transpose()?;
        let MoosServer { host, port, community, time_warp } = server;
        let mut text = format!(
            "// What elk tells {}, written anew whenever it is started.\n{HOST} = {host}\n{PORT} = {port}\n{COMMUNITY} = {community}\n\
             {TIME_WARP} = {time_warp}\n",
            self.name
        );
        let besides = besides.as_deref().map(MoosFile::read);
        if !self.settings.is_empty() || besides.is_none() {
            self.put_block(besides.as_ref(), &mut text);
        }
        if let Some(besides) = besides {
            text += "\n// What the mission's file says besides.\n";
            text += besides.text;
        }
        Ok(Some(text))
    }

    /// Its own block: what the mission says, then what the file says of all else.
    fn put_block(&self, besides: Option<&MoosFile<'_>>, text: &mut String) {
        // Writing to a String cannot fail.
        let _ = write!(text, "\nProcessConfig = {}\n{{\n", self.name);
        for (name, value) in &self.settings {
            let _ = writeln!(text, "{}", line(name, value));
        }
        let said = |key: &str| self.settings.iter().any(|(name, _)| name.eq_ignore_ascii_case(key));
        for entry in besides.and_then(|file| file.block(&self.name)).into_iter().flatten() {
            if entry.pair().is_none_or(|(key, _)| !said(key)) {
                let _ = writeln!(text, "{}", entry.raw);
            }
        }
        *text += "}\n";
    }
}

/// A parameter's line. Within quotes, which are not part of the value, nothing is a comment.
fn line(name: &str, value: &str) -> String {
    if value.contains(COMMENT) { format!("{name} = \"{value}\"") } else { format!("{name} = {value}") }
}

/// Sees that a program of MOOS' can be told its parameters, and that `besides`, the file that the mission names for it, can be
/// read.
pub(crate) fn check(besides: Option<&Path>, given: &[Given], app: &At, problems: &mut Findings) {
    if let Some(Err(error)) = besides
        .map(|file| (file, file::read_text(file, Mission::LONGEST)))
        .map(|(file, read)| read.map_err(|error| format!("moos: {} cannot be read: {error}", file.display())))
    {
        problems.add(app, error);
    }
    for Given { name, text, at, value_at, .. } in given {
        let of_mission = [HOST, PORT, COMMUNITY, TIME_WARP].iter().any(|own| own.eq_ignore_ascii_case(name));
        if of_mission {
            let said = format!(
                "{name} is what the mission tells all of MOOS' programs; right is <Bus moos=\"HOST:PORT\">, --community, or the \
                 Scenario's time-warp"
            );
            problems.add(at, said);
        } else if text.is_empty() {
            problems.add(at, format!("{name} is empty, and MOOS passes over what is; right is a value"));
        } else if text.contains(['\n', '\r']) || line(name, text).len() > LONGEST_LINE {
            let said = format!(
                "{name}: MOOS reads a parameter from one line of at most {LONGEST_LINE} bytes; right is a shorter one"
            );
            problems.add(value_at, said);
        } else if text.contains(COMMENT) && text.contains('"') {
            let said = format!(
                "{name}: of {text:?} MOOS would read no more than what is before {COMMENT}; right is one without quotes"
            );
            problems.add(value_at, said);
        }
    }
}

/// A `.moos` file, line by line.
pub(crate) struct MoosFile<'a> {
    pub text: &'a str,
    pub lines: Vec<Line<'a>>,
    /// What `${NAME}` stands for, unless only the environment says so.
    defines: BTreeMap<String, String>,
}

/// A line of it that says something.
pub(crate) struct Line<'a> {
    /// The byte at which it begins.
    pub at: usize,
    /// As it stands there.
    pub raw: &'a str,
    /// Without its comment, and without the quotes that keep something from being one.
    pub words: String,
}

impl<'a> MoosFile<'a> {
    /// Takes a text apart.
    pub fn read(text: &'a str) -> Self {
        let mut at = 0;
        let mut lines = Vec::new();
        for raw in text.split_inclusive('\n') {
            let begin = at + (raw.len() - raw.trim_start().len());
            at += raw.len();
            let raw = raw.trim();
            let words = without_comment(raw);
            if !words.is_empty() {
                lines.push(Line { at: begin, raw, words });
            }
        }
        let defined = |line: &Line<'_>| {
            let (name, value) = line.words.strip_prefix(DEFINE)?.split_once('=')?;
            Some((name.trim().to_owned(), value.trim().to_owned()))
        };
        let defines = lines.iter().filter_map(defined).collect();
        Self { text, lines, defines }
    }

    /// The first line of this name, in whichever block, and its value.
    pub fn value(&self, name: &str) -> Option<(&Line<'a>, &str)> {
        self.lines.iter().find_map(|line| {
            let (key, value) = line.pair()?;
            is_name(key, name).then_some((line, value))
        })
    }

    /// The lines of an app's first block; `None`: it has none that MOOS would find.
    pub fn block(&self, app: &str) -> Option<&[Line<'a>]> {
        let is_head = |line: &Line<'a>| {
            line.pair().is_some_and(|(key, value)| is_name(key, "ProcessConfig") && is_name(value, app))
        };
        let head = self.lines.iter().position(is_head)?;
        let (bracket, rest) = self.lines.get(head + 1..)?.split_first()?;
        let end = rest.iter().position(|line| line.words.starts_with('}'))?;
        if bracket.words.starts_with('{') { rest.get(..end) } else { None }
    }

    /// A value with what its variables stand for, which the file or the environment says; what nobody says is a problem `at`
    /// where it stands.
    pub fn expanded(&self, value: &str, at: &At, problems: &mut Findings) -> String {
        let (mut done, mut rest) = (String::new(), value);
        while let Some((before, behind)) = rest.split_once("${")
            && let Some((name, after)) = behind.split_once('}')
        {
            done += before;
            match self.defines.get(name).cloned().or_else(|| std::env::var(name).ok()) {
                Some(value) => done += &value,
                None => problems.add(
                    at,
                    format!("${{{name}}} is defined neither here nor in the environment; right is {DEFINE} {name} = …"),
                ),
            }
            rest = after;
        }
        done + rest
    }
}

impl Line<'_> {
    /// Name and value, if it has them.
    pub fn pair(&self) -> Option<(&str, &str)> {
        self.words.split_once('=').map(|(name, value)| (name.trim(), value.trim()))
    }
}

/// Whether a name is this one: to MOOS neither case nor blanks count.
pub(crate) fn is_name(said: &str, name: &str) -> bool {
    let letters =
        |text: &str| text.chars().filter(|c| !c.is_whitespace()).map(|c| c.to_ascii_lowercase()).collect::<String>();
    letters(said) == letters(name)
}

fn without_comment(line: &str) -> String {
    let quoted = line.split_once('"').and_then(|(before, rest)| {
        let (inside, after) = rest.split_once('"')?;
        (!before.contains(COMMENT)).then_some((before, inside, after))
    });
    let plain = |text: &str| text.split(COMMENT).next().unwrap_or_default().to_owned();
    let words = match quoted {
        Some((before, inside, after)) => format!("{before}{inside}{}", plain(after)),
        None => plain(line),
    };
    words.trim().to_owned()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::policy::Policy;

    const FILE: &str = "// a mission\nServerHost = localhost // here\n  Web = \"http://there\" // a page\ndefine: RATE = 4\n\
                        ProcessConfig = pOne\n{\n  AppTick = ${RATE}\n  Log = A @ 0\n  Log = B @ 1 // slow\n}\n\
                        ProcessConfig=pTwo\n{\n}\nProcessConfig = pBad {\n}\n";

    fn app(name: &str, settings: &[(&str, &str)], besides: Option<&Path>) -> AppSpec {
        AppSpec {
            name: name.to_owned(),
            element: "App".to_owned(),
            program: Program::Foreign {
                exec: "x".into(),
                args: Vec::new(),
                via: Via::Moos(besides.map(Path::to_owned)),
            },
            policy: Policy::default(),
            said: BTreeSet::new(),
            settings: settings.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect(),
        }
    }

    #[test]
    fn a_file_is_read_as_moos_reads_it() {
        let file = MoosFile::read(FILE);
        assert_eq!(file.value("serverhost").map(|(line, value)| (line.at, value)), Some((13, "localhost")));
        assert_eq!(file.value("Web").unwrap().1, "http://there");
        let block: Vec<_> = file.block("PONE").unwrap().iter().map(|line| line.pair().unwrap()).collect();
        assert_eq!(block, [("AppTick", "${RATE}"), ("Log", "A @ 0"), ("Log", "B @ 1")]);
        assert!(
            file.block("pTwo").unwrap().is_empty() && file.block("pBad").is_none() && file.block("pNone").is_none()
        );
        let mut problems = Findings::default();
        assert_eq!(file.expanded("a${RATE}b${RATE}", &At::Byte(0), &mut problems), "a4b4");
        assert!(problems.is_empty());
        assert_eq!(file.expanded("${ELK_NOBODY_SAYS_THIS}", &At::Byte(0), &mut problems), "");
        let said = problems.located(Path::new("m.moos"), FILE).to_string();
        assert!(said.starts_with("m.moos:1:1: ${ELK_NOBODY_SAYS_THIS} is defined neither here"), "{said}");
    }

    #[test]
    fn an_app_s_file_says_where_the_community_is_and_what_its_parameters_are() {
        let server = MoosServer { host: "127.0.0.1", port: "9100", community: "sea", time_warp: 4.0 };
        let alone = app("pOne", &[("Log", "C @ 0"), ("Page", "http://x")], None).moos_text(&server).unwrap().unwrap();
        let read = MoosFile::read(&alone);
        for (name, value) in
            [("ServerHost", "127.0.0.1"), ("ServerPort", "9100"), ("Community", "sea"), ("MOOSTimeWarp", "4")]
        {
            assert_eq!(read.value(name).unwrap().1, value);
        }
        let pairs = |file: &MoosFile<'_>, name: &str| -> Vec<String> {
            file.block(name).unwrap().iter().map(|line| line.words.clone()).collect()
        };
        assert_eq!(pairs(&read, "pOne"), ["Log = C @ 0", "Page = http://x"]);
        let folder = tempfile::tempdir().unwrap();
        let besides = folder.path().join("m.moos");
        std::fs::write(&besides, FILE).unwrap();
        let both = app("pOne", &[("log", "C @ 0")], Some(&besides)).moos_text(&server).unwrap().unwrap();
        let read = MoosFile::read(&both);
        assert_eq!((read.value("ServerHost").unwrap().1, read.value("Web").unwrap().1), ("127.0.0.1", "http://there"));
        assert_eq!(
            pairs(&read, "pOne"),
            ["log = C @ 0", "AppTick = ${RATE}"],
            "what is said counts, the rest is the file's"
        );
        let plain = app("pOne", &[], Some(&besides)).moos_text(&server).unwrap().unwrap();
        assert_eq!(pairs(&MoosFile::read(&plain), "pOne").len(), 3, "the file's own block");
        assert!(app("pOne", &[], Some(&folder.path().join("none.moos"))).moos_text(&server).is_err());
    }
}
