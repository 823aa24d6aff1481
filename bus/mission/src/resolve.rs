//! What a mission says of an app, held against the table of its type.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::nearest::instead;
use crate::params::{ParamValue, Params};
use crate::problem::{At, Findings};
use crate::spec::{AppType, Kind, ParamSpec};

/// A parameter as it was said.
#[derive(Debug, Clone)]
pub(crate) struct Given {
    pub name: String,
    pub text: String,
    /// Where its name stands.
    pub place: At,
    /// Where its value stands.
    pub value_place: At,
    /// Where a relative file is looked for.
    pub folder: PathBuf,
}

impl Given {
    pub fn new(name: &str, text: &str, place: At, value_place: At, folder: &Path) -> Self {
        Self { name: name.to_owned(), text: text.trim().to_owned(), place, value_place, folder: folder.to_owned() }
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
pub(crate) fn resolve(app_type: &AppType, given: Vec<Given>, place: &At, problems: &mut Findings) -> Resolved {
    let mut said: BTreeMap<&str, &Given> = BTreeMap::new();
    for one in &given {
        match app_type.param(&one.name) {
            None => problems.add(&one.place, unknown(app_type, &one.name)),
            Some(param) if said.insert(param.name, one).is_some() => {
                problems.add(&one.place, format!("{} is said twice; once is enough", one.name));
            }
            Some(_) => {}
        }
    }
    let names = said.keys().map(|name| (*name).to_owned()).collect();
    let mut resolved = Resolved { said: names, ..Resolved::default() };
    for param in app_type.params {
        if let Some(value) = value_of(app_type, param, said.get(param.name).copied(), place, problems) {
            let text = as_text(&param.kind, &value);
            resolved.settings.push((param.name.to_owned(), text));
            resolved.params.values.insert(param.name, value);
        }
    }
    resolved
}

fn value_of(
    app_type: &AppType,
    param: &ParamSpec,
    said: Option<&Given>,
    place: &At,
    problems: &mut Findings,
) -> Option<ParamValue> {
    let (parsed, place) = match (said, param.default) {
        (Some(said), _) => (param.kind.parse(&said.text, &said.folder), &said.value_place),
        (None, Some(default)) => (param.kind.parse(default, Path::new("")), place),
        (None, None) => {
            let expected = param.kind.expected();
            let (who, name) = (title(app_type), param.name);
            problems.add(place, format!("{who} needs the parameter {name}; right is {expected}"));
            return None;
        }
    };
    parsed.map_err(|error| problems.add(place, format!("{}: {error}", param.name))).ok()
}

fn unknown(app_type: &AppType, name: &str) -> String {
    let known: Vec<&str> = app_type.params.iter().map(|param| param.name).collect();
    format!("{} has no parameter {name}; {}", title(app_type), instead(name, &known))
}

/// `Filter Distance`
fn title(app_type: &AppType) -> String {
    format!("{} {}", app_type.element, app_type.name)
}

/// The text that parses to this value, in any folder: numbers shortest, files absolute.
fn as_text(kind: &Kind, value: &ParamValue) -> String {
    match (value, kind) {
        (ParamValue::Number(value), _) => value.to_string(),
        (ParamValue::Integer(value), _) => value.to_string(),
        (ParamValue::Flag(value), _) => value.to_string(),
        (ParamValue::Point([x, y, z]), _) => format!("{x}; {y}; {z}"),
        (ParamValue::Text(value), Kind::File { builtin }) if !builtin.contains(&value.as_str()) => {
            let path = std::path::absolute(value).unwrap_or_else(|_| value.into());
            path.to_string_lossy().into_owned()
        }
        (ParamValue::Text(value), _) => value.clone(),
    }
}
