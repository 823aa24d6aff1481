//! One app as the mission file says it, before it is held against its type.

use std::path::Path;

use roxmltree::{Attribute, Node};

use crate::arguments::split_arguments;
use crate::element::{self, ELEMENTS};
use crate::executable;
use crate::kind::ParamSpec;
use crate::moos;
use crate::name::{is_app_name, right_app_names};
use crate::nearest::{instead, nearest};
use crate::params::ParamValue;
use crate::policy::{self, Said};
use crate::problem::{At, Findings};
use crate::registry::Registry;
use crate::resolve::{Given, Table, resolve};
use crate::setting::Override;
use crate::spec::{AppSpec, AppType, Program, Via};
use crate::xml::{loose_text, own_text, value_at};

/// The type of an element that is supposed, for a mission without one: it is not recorded.
const NONE: &str = "none";

/// What every part of the check needs.
pub(crate) struct Context<'a> {
    pub registry: &'a Registry,
    /// Where relative files are looked for.
    pub folder: &'a Path,
}

/// One app as it was said.
pub(crate) struct Draft {
    pub element: String,
    /// Where its element stands.
    pub at: At,
    /// Its name, and where that stands.
    pub named: Option<(String, At)>,
    pub given: Vec<Given>,
    runs: Runs,
    /// Whether the command line says what runs.
    exchanged: bool,
    policy: Said,
}

/// What a draft says that is to run.
enum Runs {
    Builtin(&'static AppType),
    Foreign {
        exec: String,
        args: Vec<String>,
        via: Via,
    },
    /// `<Logger type="none"/>`
    Nothing,
    /// Nothing that could run; the problem is reported.
    Unknown,
}

impl Draft {
    /// Reads an app's element.
    pub fn read(context: &Context, node: Node, problems: &mut Findings) -> Self {
        let mut draft = Self {
            element: node.tag_name().name().to_owned(),
            at: At::Byte(node.range().start),
            named: None,
            given: Vec::new(),
            runs: Runs::Unknown,
            exchanged: false,
            policy: Said::default(),
        };
        draft.runs = draft.what_runs(context, node, problems);
        for attribute in node.attributes() {
            draft.read_attribute(context, attribute, problems);
        }
        draft.name_as_moos_does(problems);
        draft.check_policy(node, problems);
        loose_text(node, problems);
        for child in node.children().filter(Node::is_element) {
            draft.read_parameter(context, child, problems);
        }
        draft
    }

    /// A program of MOOS' is called as its executable is, unless somebody names it.
    fn name_as_moos_does(&mut self, problems: &mut Findings) {
        let (None, Runs::Foreign { exec, via: Via::Moos(_), .. }) = (&self.named, &self.runs) else { return };
        let name = exec.rsplit('/').next().unwrap_or(exec);
        match is_app_name(name) {
            true => self.named = Some((name.to_owned(), self.at.clone())),
            false => {
                let said = format!("{name:?} is no name for an app; right is name=\"…\" of {}", right_app_names());
                problems.add(&self.at, said);
            }
        }
    }

    /// A program that pAntler would start under this name; it is started again if it fails.
    pub fn of_program(name: &str, at: At, exec: String, args: Vec<String>, via: Via) -> Self {
        Self {
            element: element::APP.to_owned(),
            named: Some((name.to_owned(), at.clone())),
            at,
            given: Vec::new(),
            runs: Runs::Foreign { exec, args, via },
            exchanged: false,
            policy: Said::AGAIN,
        }
    }

    /// An app of a mission that runs: its defaults are said, too, for nobody can change them any more. Whatever is said
    /// of it stands under its name.
    pub fn of(app: &AppSpec) -> Self {
        let at = At::CommandLine(app.name.clone());
        let given = |(name, text): &(String, String)| Given::new(name, text, at.clone(), at.clone(), "".as_ref());
        let runs = match &app.program {
            Program::Builtin(app_type, _) => Runs::Builtin(app_type),
            Program::Foreign { exec, args, via } => {
                Runs::Foreign { exec: exec.to_string_lossy().into_owned(), args: args.clone(), via: via.clone() }
            }
        };
        Self {
            element: app.element.clone(),
            named: Some((app.name.clone(), at.clone())),
            given: app.settings.iter().map(given).collect(),
            runs,
            exchanged: false,
            policy: Said::default(),
            at,
        }
    }

    fn what_runs(&self, context: &Context, node: Node, problems: &mut Findings) -> Runs {
        let types = context.registry.of_element(&self.element);
        let known: Vec<&str> = types.map(|app_type| app_type.name).collect();
        let value_at = |name| {
            let value = node.attribute_node(name).map(|a| At::Byte(a.range_value().start));
            value.unwrap_or_else(|| self.at.clone())
        };
        if let Some(line) = node.attribute("pipe") {
            for other in ["type", "exec", "args", "moos"].into_iter().filter(|one| node.has_attribute(*one)) {
                problems.add(&value_at(other), format!("{other} and pipe are both said; one is right"));
            }
            return piped(line).map_or_else(
                |error| {
                    problems.add(&value_at("pipe"), error);
                    Runs::Unknown
                },
                |(exec, args)| Runs::Foreign { exec: executable(context, &exec), args, via: Via::Lines },
            );
        }
        match (node.attribute("type").map(str::trim), node.attribute("exec").map(str::trim)) {
            (Some(_), Some(_)) => {
                problems.add(&value_at("exec"), "type and exec are both said; one is right");
                Runs::Unknown
            }
            (None, Some("")) => {
                problems.add(&value_at("exec"), "exec is empty; right is an executable");
                Runs::Unknown
            }
            (None, Some(exec)) => {
                let exec = executable(context, exec);
                let args = split_arguments(node.attribute("args").unwrap_or_default());
                let via = Via::of_moos(node.attribute("moos").map_or("false", str::trim), context.folder);
                match (args, via) {
                    (Ok(args), Ok(via)) => Runs::Foreign { exec, args, via },
                    (Err(error), _) => {
                        problems.add(&value_at("args"), format!("args: {error}"));
                        Runs::Unknown
                    }
                    (_, Err(error)) => {
                        problems.add(&value_at("moos"), error);
                        Runs::Unknown
                    }
                }
            }
            (Some(name), None) => {
                for other in ["args", "moos"].into_iter().filter(|one| node.has_attribute(*one)) {
                    problems.add(&value_at(other), format!("{other} without exec; right is both or neither"));
                }
                self.type_called(name, &value_at("type"), context.registry, problems)
            }
            (None, None) if known.is_empty() => {
                let element = &self.element;
                problems.add(
                    &self.at,
                    format!("<{element}> has no exec; right is exec=\"program\", or pipe=\"program arguments\""),
                );
                Runs::Unknown
            }
            (None, None) => {
                let (at, said) = self.no_type(node, &known);
                problems.add(&at, said);
                Runs::Unknown
            }
        }
    }

    /// What to say of an element that has neither type nor exec, and where.
    fn no_type(&self, node: Node, known: &[&str]) -> (At, String) {
        let element = &self.element;
        match node.attributes().find(|one| nearest(one.name(), ["type"]).is_some()) {
            Some(slip) => {
                let said = format!("<{element}> has no attribute {}; did you mean type?", slip.name());
                (At::Byte(slip.range().start), said)
            }
            None => (self.at.clone(), format!("<{element}> has no type; known: {}", known.join(", "))),
        }
    }

    fn type_called(&self, name: &str, at: &At, registry: &Registry, problems: &mut Findings) -> Runs {
        let mut known: Vec<&str> = registry.of_element(&self.element).map(|t| t.name).collect();
        if element::named(&self.element).is_some_and(|element| element.supposed) {
            known.push(NONE);
            if name == NONE {
                return Runs::Nothing;
            }
        }
        if let Some(app_type) = registry.find(&self.element, name) {
            return Runs::Builtin(app_type);
        }
        let (element, right) = (&self.element, instead(name, &known));
        problems.add(at, format!("{element} has no type {name:?}; {right}"));
        Runs::Unknown
    }

    /// `name` and what makes up the policy; any other attribute is a parameter, as `PoseEstimator` is in the thesis' Listing 2.
    fn read_attribute(&mut self, context: &Context, attribute: Attribute, problems: &mut Findings) {
        let at = At::Byte(attribute.range().start);
        let value_at = At::Byte(attribute.range_value().start);
        let value = attribute.value().trim();
        match attribute.name() {
            "type" | "exec" | "args" | "pipe" | "moos" => {}
            "name" if is_app_name(value) => self.named = Some((value.to_owned(), value_at)),
            "name" => {
                problems.add(&value_at, format!("{value:?} is no name for an app; right are {}", right_app_names()))
            }
            name if policy::is_of_broker(name) => {
                let element = &self.element;
                let said = format!("<{element}> has no attribute {name}; it is one of the Scenario's");
                problems.add(&at, said);
            }
            name => match (self.policy.take(name, value), policy::meant(name)) {
                (Some(taken), _) => {
                    if let Err(error) = taken {
                        problems.add(&value_at, format!("{name} {error}"));
                    }
                }
                (None, Some(meant)) if self.is_builtin() && !self.takes(name) => {
                    problems.add(&at, format!("<{}> has no attribute {name}; did you mean {meant}?", self.element));
                }
                _ => self.given.push(Given::new(name, value, at, value_at, context.folder)),
            },
        }
    }

    /// A limit on what never happens is a mistake.
    fn check_policy(&self, node: Node, problems: &mut Findings) {
        if let Some(name) = self.policy.in_vain()
            && let Some(attribute) = node.attribute_node(name)
        {
            let said = format!("{name} without restart; right is restart=\"on-failure\" or \"always\" with it");
            problems.add(&At::Byte(attribute.range().start), said);
        }
    }

    fn read_parameter(&mut self, context: &Context, node: Node, problems: &mut Findings) {
        let at = At::Byte(node.range().start);
        let name = node.tag_name().name();
        if let Some(attribute) = node.attributes().next() {
            let said = format!("<{name}> has the attribute {}; a parameter has none", attribute.name());
            problems.add(&At::Byte(attribute.range().start), said);
        }
        if let Some(inner) = node.children().find(Node::is_element) {
            let inside = inner.tag_name().name();
            let said = format!("<{inside}> stands in the parameter <{name}>; right is its value alone");
            problems.add(&At::Byte(inner.range().start), said);
            return;
        }
        let said: String = node.children().filter_map(own_text).collect();
        let value_at = value_at(node).unwrap_or_else(|| at.clone());
        self.given.push(Given::new(name, &said, at, value_at, context.folder));
    }

    /// The app's name; empty before every app has one.
    pub fn name(&self) -> &str {
        self.named.as_ref().map_or("", |(name, _)| name)
    }

    /// Where its name stands.
    pub fn name_at(&self) -> &At {
        self.named.as_ref().map_or(&self.at, |(_, at)| at)
    }

    /// Whether it can be told this parameter: its type has it, or it takes anything.
    pub fn takes(&self, param: &str) -> bool {
        match &self.runs {
            Runs::Builtin(app_type) => app_type.param(param).is_some(),
            Runs::Foreign { .. } => true,
            Runs::Nothing | Runs::Unknown => false,
        }
    }

    /// Whether it comes as a client of MOOS'.
    pub fn is_moos(&self) -> bool {
        matches!(self.runs, Runs::Foreign { via: Via::Moos(_), .. })
    }

    /// Whether it is one of the registry's types.
    pub fn is_builtin(&self) -> bool {
        matches!(self.runs, Runs::Builtin(_))
    }

    /// Whether all that it can do is in the registry's table, or it does nothing.
    pub fn is_known(&self) -> bool {
        matches!(self.runs, Runs::Builtin(_) | Runs::Nothing)
    }

    fn given(&self, param: &str) -> Option<&Given> {
        self.given.iter().find(|given| given.name.eq_ignore_ascii_case(param))
    }

    /// Takes out all that was said of a parameter.
    pub fn take(&mut self, param: &str) -> Vec<Given> {
        let (taken, given) =
            std::mem::take(&mut self.given).into_iter().partition(|given| given.name.eq_ignore_ascii_case(param));
        self.given = given;
        taken
    }

    /// Where the value of a parameter is said; the app's own location, if it is not.
    pub fn value_at(&self, param: &str) -> &At {
        self.given(param).map_or(&self.at, |given| &given.value_at)
    }

    /// What was said of a parameter.
    pub fn said(&self, param: &str) -> Option<&str> {
        self.given(param).map(|given| given.text.as_str())
    }

    /// What was said of a parameter of its type, if that is right, and where.
    pub fn value(&self, param: &str) -> Option<(ParamValue, &Given)> {
        self.value_as(self.spec(param)?, param)
    }

    /// What was said of a parameter, if that is right by this table's row, and where.
    pub fn value_as(&self, spec: &ParamSpec, param: &str) -> Option<(ParamValue, &Given)> {
        let given = self.given(param)?;
        Some((spec.kind.parse(&given.text, &given.folder).ok()?, given))
    }

    /// The row of its type's table; another executable has none.
    pub fn spec(&self, param: &str) -> Option<&'static ParamSpec> {
        match &self.runs {
            Runs::Builtin(app_type) => app_type.param(param),
            _ => None,
        }
    }

    /// What was said of a parameter and can be handed on to others: what is wrong is reported where it stands.
    pub fn given_right(&self, param: &str) -> Option<&Given> {
        match self.spec(param) {
            Some(spec) => self.value_as(spec, param).map(|(_, given)| given),
            None => self.given(param).filter(|_| !self.is_builtin()),
        }
    }

    /// What was said of a parameter, or its type's default.
    pub fn said_or_default(&self, param: &str) -> Option<&str> {
        let default = match &self.runs {
            Runs::Builtin(app_type) => app_type.param(param).and_then(|spec| spec.default),
            _ => None,
        };
        self.said(param).or(default)
    }

    /// Says a parameter for it, if it can be told and nothing was said of it.
    pub fn suppose(&mut self, param: &str, text: &str) {
        if self.takes(param) && self.said(param).is_none() {
            let at = self.at.clone();
            self.given.push(Given::new(param, text, at.clone(), at, "".as_ref()));
        }
    }

    /// Tells it what was said of a parameter elsewhere, if it can be told and nothing was said of it.
    pub fn hand(&mut self, given: &Given) {
        if self.takes(&given.name) && self.said(&given.name).is_none() {
            self.given.push(given.clone());
        }
    }

    /// Takes what the command line says in place of what the file says.
    pub fn override_with(&mut self, said: &Override, at: At, registry: &Registry, problems: &mut Findings) {
        match said.param.as_str() {
            "type" | "exec" | "pipe" if std::mem::replace(&mut self.exchanged, true) => {
                problems.add(&at, "what runs is said twice; one type, exec or pipe is right");
            }
            "type" => self.become_type(&said.text, &at, registry, problems),
            "exec" => match found(&said.text) {
                Ok(exec) => self.runs = Runs::Foreign { exec, args: Vec::new(), via: Via::Itself },
                Err(message) => problems.add(&at, message),
            },
            "pipe" => match piped(&said.text).and_then(|(exec, args)| Ok((found(&exec)?, args))) {
                Ok((exec, args)) => self.runs = Runs::Foreign { exec, args, via: Via::Lines },
                Err(message) => problems.add(&at, message),
            },
            "args" => match (&mut self.runs, split_arguments(&said.text)) {
                (Runs::Foreign { via: Via::Lines, .. }, _) | (Runs::Builtin(_) | Runs::Nothing | Runs::Unknown, _) => {
                    problems.add(&at, "args without exec; right is both or neither");
                }
                (Runs::Foreign { args, .. }, Ok(said)) => *args = said,
                (_, Err(error)) => problems.add(&at, format!("args: {error}")),
            },
            "moos" => match (&mut self.runs, Via::of_moos(&said.text, Path::new(""))) {
                (Runs::Foreign { via: Via::Lines, .. }, _) | (Runs::Builtin(_) | Runs::Nothing | Runs::Unknown, _) => {
                    problems.add(&at, "moos without exec; right is both or neither");
                }
                (Runs::Foreign { via, .. }, Ok(said)) => *via = said,
                (_, Err(error)) => problems.add(&at, error),
            },
            _ => self.set(said, at),
        }
    }

    /// Exchanges its type. What the file says to the old one alone is left behind, as in a swap; of an executable that may be
    /// anything.
    fn become_type(&mut self, name: &str, at: &At, registry: &Registry, problems: &mut Findings) {
        let new = self.type_called(name, at, registry, problems);
        let old = std::mem::replace(&mut self.runs, new);
        let Runs::Builtin(new) = &self.runs else { return };
        self.given.retain(|given| match old {
            Runs::Builtin(old) => new.param(&given.name).is_some() || old.param(&given.name).is_none(),
            Runs::Foreign { .. } => new.param(&given.name).is_some(),
            Runs::Nothing | Runs::Unknown => true,
        });
    }

    fn set(&mut self, said: &Override, at: At) {
        self.given.retain(|given| !given.name.eq_ignore_ascii_case(&said.param) || is_command_line(&given.at));
        self.given.push(Given::new(&said.param, &said.text, at.clone(), at, "".as_ref()));
    }

    /// Holds it against its type.
    pub fn resolve(self, problems: &mut Findings) -> Option<AppSpec> {
        let name = self.name().to_owned();
        let policy = self.policy.policy(matches!(self.runs, Runs::Builtin(_)));
        let (program, settings, said) = match self.runs {
            Runs::Nothing | Runs::Unknown => return None,
            Runs::Builtin(app_type) => {
                let table = Table { who: &app_type.title(), params: app_type.params };
                let resolved = resolve(&table, self.given, &self.at, problems);
                (Program::Builtin(app_type, resolved.params), resolved.settings, resolved.said)
            }
            Runs::Foreign { exec, args, via } => {
                if let Via::Moos(file) = &via {
                    moos::check(file.as_deref(), &self.given, &self.at, problems);
                }
                let said = self.given.iter().map(|given| given.name.clone()).collect();
                let settings = self.given.into_iter().map(|given| (given.name, given.text));
                let exec = exec.into();
                (Program::Foreign { exec, args, via }, settings.collect(), said)
            }
        };
        Some(AppSpec { name, element: self.element, program, policy, said, settings })
    }
}

/// A mission that does not speak of an element that is supposed has the registry's first type of it.
pub(crate) fn suppose_elements(drafts: &mut Vec<Draft>, registry: &Registry, scenario: &At) {
    for element in ELEMENTS.iter().filter(|element| element.supposed) {
        let Some(app_type) = registry.of_element(element.name).next() else { continue };
        if drafts.iter().any(|draft| draft.element == element.name) {
            continue;
        }
        drafts.push(Draft {
            element: element.name.to_owned(),
            at: scenario.clone(),
            named: None,
            given: Vec::new(),
            runs: Runs::Builtin(app_type),
            exchanged: false,
            policy: Said::default(),
        });
    }
}

fn is_command_line(at: &At) -> bool {
    matches!(at, At::CommandLine(_))
}

/// The program and its arguments that `pipe` says.
fn piped(line: &str) -> Result<(String, Vec<String>), String> {
    let mut words = split_arguments(line).map_err(|error| format!("pipe: {error}"))?.into_iter();
    let exec = words.next().ok_or("pipe is empty; right is a program with its arguments")?;
    Ok((exec, words.collect()))
}

/// An executable of the command line, where it is.
fn found(exec: &str) -> Result<String, String> {
    let exec = executable::executable(exec, Path::new(""))?;
    Ok(std::path::absolute(&exec).unwrap_or(exec).to_string_lossy().into_owned())
}

/// A path with a folder is looked for from the mission's folder, a bare name in `PATH`.
fn executable(context: &Context, exec: &str) -> String {
    match exec.contains('/') {
        true => context.folder.join(exec).to_string_lossy().into_owned(),
        false => exec.to_owned(),
    }
}
