//! What a mission says of an app, held against the table of its type.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::kind::{Kind, ParamSpec};
use crate::nearest::instead;
use crate::params::{ParamValue, Params};
use crate::problem::{At, Findings, Problems};
use crate::spec::{AppSpec, AppType, Program};

/// A parameter as it was said.
#[derive(Debug, Clone)]
pub(crate) struct Given {
    pub name: String,
    pub text: String,
    /// Where its name stands.
    pub at: At,
    /// Where its value stands.
    pub value_at: At,
    /// Where a relative file is looked for.
    pub folder: PathBuf,
}

impl Given {
    pub fn new(name: &str, text: &str, at: At, value_at: At, folder: &Path) -> Self {
        Self { name: name.to_owned(), text: text.trim().to_owned(), at, value_at, folder: folder.to_owned() }
    }
}

/// What an app can be told.
pub(crate) struct Table<'a> {
    /// Whose table it is: `Filter Distance`.
    pub who: &'a str,
    pub params: &'static [ParamSpec],
}

impl Table<'_> {
    /// The parameter of this name. As in MOOS, case does not count.
    fn param(&self, name: &str) -> Option<&'static ParamSpec> {
        self.params.iter().find(|param| param.name.eq_ignore_ascii_case(name))
    }

    fn unknown(&self, name: &str) -> String {
        let known: Vec<&str> = self.params.iter().map(|param| param.name).collect();
        format!("{} has no parameter {name}; {}", self.who, instead(name, &known))
    }
}

/// An app's parameters: checked, and as text that says the same anywhere.
#[derive(Debug, Default)]
pub(crate) struct Resolved {
    pub params: Params,
    pub settings: Vec<(String, String)>,
    /// Names of the parameters that were given.
    pub said: BTreeSet<String>,
}

/// Checks what was given, fills in the defaults, and reports what is unknown, doubled, wrong or missing.
pub(crate) fn resolve(table: &Table<'_>, given: Vec<Given>, at: &At, problems: &mut Findings) -> Resolved {
    let mut said: BTreeMap<&str, &Given> = BTreeMap::new();
    for one in &given {
        match table.param(&one.name) {
            None => problems.add(&one.at, table.unknown(&one.name)),
            Some(param) if said.insert(param.name, one).is_some() => {
                problems.add(&one.at, format!("{} is said twice; once is enough", one.name));
            }
            Some(_) => {}
        }
    }
    let names = said.keys().map(|name| (*name).to_owned()).collect();
    let mut resolved = Resolved { said: names, ..Resolved::default() };
    for param in table.params {
        if let Some(value) = value_of(table, param, said.get(param.name).copied(), at, problems) {
            let text = as_text(&param.kind, &value);
            resolved.settings.push((param.name.to_owned(), text));
            resolved.params.values.insert(param.name, value);
        }
    }
    let value_at = |name: &str| said.get(name).map_or(at, |given| &given.value_at);
    for param in table.params {
        if let Some(wrong) = resolved.params.refines_nothing(param) {
            problems.add(value_at(param.name), wrong);
        }
    }
    resolved
}

impl Params {
    /// What is wrong with a parameter that refines what is not there.
    fn refines_nothing(&self, param: &ParamSpec) -> Option<String> {
        let Kind::Refinement { words: [nothing, ..], of } = param.kind else { return None };
        let (Some(ParamValue::Text(word)), Some(ParamValue::Text(other))) =
            (self.values.get(param.name), self.values.get(of))
        else {
            return None; // one of them is wrong, which is said
        };
        let name = param.name;
        (word != nothing && other == nothing).then(|| {
            let why = format!("{name} is {word}, and {of} is {other}, of which there is nothing to be made better");
            format!("{why}; right is {name} {nothing}, or a {of}")
        })
    }
}

fn value_of(
    table: &Table<'_>,
    param: &ParamSpec,
    said: Option<&Given>,
    at: &At,
    problems: &mut Findings,
) -> Option<ParamValue> {
    let (parsed, at) = match (said, param.default) {
        (Some(said), _) => (param.kind.parse(&said.text, &said.folder), &said.value_at),
        (None, Some(default)) => (param.kind.parse(default, Path::new("")), at),
        (None, None) => {
            let expected = param.kind.expected();
            let (who, name) = (table.who, param.name);
            problems.add(at, format!("{who} needs the parameter {name}; right is {expected}"));
            return None;
        }
    };
    parsed.map_err(|error| problems.add(at, format!("{}: {error}", param.name))).ok()
}

/// The text that parses to this value, in any folder: numbers shortest, files absolute.
fn as_text(kind: &Kind, value: &ParamValue) -> String {
    match (value, kind) {
        (ParamValue::Number(value), _) => value.to_string(),
        (ParamValue::Integer(value), _) => value.to_string(),
        (ParamValue::Flag(value), _) => value.to_string(),
        (ParamValue::Point([x, y, z]), _) => format!("{x}; {y}; {z}"),
        (ParamValue::Text(value), Kind::File { builtin, .. }) if !builtin.contains(&value.as_str()) => {
            let path = std::path::absolute(value).unwrap_or_else(|_| value.into());
            path.to_string_lossy().into_owned()
        }
        (ParamValue::Text(value), _) => value.clone(),
    }
}

impl AppType {
    /// Checks parameters as one app by itself is given them on its command line: `Param=Value`, files relative to `folder`.
    ///
    /// # Errors
    /// Everything that is wrong, each with the argument it was said in.
    pub fn check(&self, settings: &[(String, String)], folder: &Path) -> Result<Params, Problems> {
        let at = At::CommandLine(format!("--type {}", self.name));
        check(&Table { who: &self.title(), params: self.params }, settings, folder, &at)
    }
}

impl Params {
    /// Checks what an app was told, `Param=Value` each, against a table of its own; `who` it is stands in errors. Relative
    /// files are looked for in `folder`.
    ///
    /// # Errors
    /// Everything that is wrong, each with the argument it was said in.
    pub fn check(
        who: &str,
        table: &'static [ParamSpec],
        settings: &[(String, String)],
        folder: &Path,
    ) -> Result<Self, Problems> {
        check(&Table { who, params: table }, settings, folder, &At::CommandLine(who.to_owned()))
    }
}

fn check(table: &Table<'_>, settings: &[(String, String)], folder: &Path, at: &At) -> Result<Params, Problems> {
    let given = settings.iter().map(|(name, text)| {
        let said = At::CommandLine(format!("{name}={text}"));
        Given::new(name, text, said.clone(), said, folder)
    });
    let mut problems = Findings::default();
    let Resolved { params, .. } = resolve(table, given.collect(), at, &mut problems);
    match problems.is_empty() {
        true => Ok(params),
        false => Err(problems.located(folder, "")),
    }
}

impl AppSpec {
    /// Sets a parameter, checked as if it stood in the mission file.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn set(&mut self, name: &str, text: &str) -> Result<(), Problems> {
        let mut settings = self.settings.clone();
        match settings.iter_mut().find(|(key, _)| key == name) {
            Some((_, value)) => *value = text.to_owned(),
            None => settings.push((name.to_owned(), text.to_owned())),
        }
        if let Program::Builtin(app_type, params) = &mut self.program {
            *params = app_type.check(&settings, Path::new(""))?;
        }
        self.settings = settings;
        self.said.insert(name.to_owned());
        Ok(())
    }
}
