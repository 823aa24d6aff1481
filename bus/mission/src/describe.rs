//! `elk types`: the table of app types, for people.

use std::fmt::Write;

use crate::bus::OF_BUS;
use crate::kind::ParamSpec;
use crate::policy::{Attribute, OF_APP, OF_BROKER, OF_LAUNCH};
use crate::registry::Registry;
use crate::spec::AppType;

/// Every app type with its parameters, units, defaults and meaning.
pub fn describe(registry: &Registry) -> String {
    let types: Vec<String> = registry.types().map(describe_type).collect();
    format!("{}\n{}", types.join("\n"), describe_attributes())
}

/// What every app's element and the Scenario can say besides parameters.
fn describe_attributes() -> String {
    let mut text = "Attributes of every app's element: what happens when it dies or hangs.\n".to_owned();
    describe_policy(&mut text, &OF_APP);
    text += "\nAttributes of the Scenario: what its broker keeps, and what happens when it dies.\n";
    describe_policy(&mut text, &OF_BROKER);
    text += "\nAttributes of the Scenario: where it is launched, and how fast.\n";
    describe_policy(&mut text, &OF_LAUNCH);
    text += "\nAttributes of <Bus>: who may come to the broker beside the mission's apps.\n";
    describe_policy(&mut text, &OF_BUS);
    text
}

fn describe_policy(text: &mut String, attributes: &[Attribute]) {
    let width = attributes.iter().map(|attribute| attribute.name.len()).max().unwrap_or(0);
    for Attribute { name, kind, default, doc } in attributes {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "    {name:width$}  {doc}");
        let _ = writeln!(text, "    {:width$}  ({}; default: {default})", "", kind.expected());
    }
}

fn describe_type(app_type: &AppType) -> String {
    let AppType { element, name, summary, .. } = app_type;
    format!("<{element} type=\"{name}\">  {summary}\n{}", describe_params(app_type.params))
}

/// Parameters with their units, defaults and meaning.
pub fn describe_params(params: &[ParamSpec]) -> String {
    let mut text = String::new();
    let width = params.iter().map(|param| param.name.len()).max().unwrap_or(0);
    for param in params {
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
