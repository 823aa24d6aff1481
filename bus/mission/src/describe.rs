//! `elk types`: the table of app types, for people.

use std::fmt::Write;

use crate::registry::Registry;
use crate::spec::{AppType, ParamSpec};

/// Every app type with its parameters, units, defaults and meaning.
pub fn describe(registry: &Registry) -> String {
    let types: Vec<String> = registry.types().map(describe_type).collect();
    types.join("\n")
}

fn describe_type(app_type: &AppType) -> String {
    let AppType { element, name, summary, .. } = app_type;
    let mut text = format!("<{element} type=\"{name}\">  {summary}\n");
    let width = app_type.params.iter().map(|param| param.name.len()).max().unwrap_or(0);
    for param in app_type.params {
        describe_param(&mut text, param, width);
    }
    text
}

fn describe_param(text: &mut String, param: &ParamSpec, width: usize) {
    let ParamSpec { name, kind, default, doc } = param;
    let default = match default {
        Some("") => "default: empty".to_owned(),
        Some(default) => format!("default: {default}"),
        None => "must be said".to_owned(),
    };
    // Writing to a String cannot fail.
    let _ = writeln!(text, "    {name:width$}  {doc}");
    let _ = writeln!(text, "    {:width$}  ({}; {default})", "", kind.expected());
}
