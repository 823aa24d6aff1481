//! One app of a running mission exchanged for another: what is kept of it, and what is checked before anything starts.

use std::path::PathBuf;

use crate::draft::Draft;
use crate::executable::executable;
use crate::nearest::instead;
use crate::problem::{At, Findings, Problems};
use crate::registry::Registry;
use crate::resolve::{Given, Table, resolve};
use crate::spec::{AppSpec, AppType, Program, Via};
use crate::{moos, variables, wiring};

/// What is to be different about an app: `type=T`, `exec=FILE` or `pipe="PROGRAM ARGS"`, and parameters.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Exchange {
    /// Another type of the same element.
    pub type_name: Option<String>,
    /// Any executable instead, and its arguments.
    pub exec: Option<(String, Vec<String>)>,
    /// How that executable comes to the bus.
    pub via: Via,
    /// Parameters that are said anew.
    pub params: Vec<(String, String)>,
    /// Where relative files and executables are looked for.
    pub folder: PathBuf,
}

/// An app after an exchange.
#[derive(Debug, Clone)]
pub struct Exchanged {
    /// The app as it is to be.
    pub app: AppSpec,
    /// What was said of the old one and the new one has no word for: `Name=Value`.
    pub dropped: Vec<String>,
}

impl Exchange {
    /// An exchanged app; what was said anew stands where it was said.
    fn draft(&self, app: &AppSpec) -> Draft {
        let mut draft = Draft::of(app);
        for given in &mut draft.given {
            let mut params = self.params.iter();
            if let Some((name, text)) = params.find(|(name, _)| name.eq_ignore_ascii_case(&given.name)) {
                given.value_at = At::CommandLine(format!("{name}={text}"));
            }
        }
        draft
    }
}

impl AppSpec {
    /// This app, exchanged: it keeps its name, its policy, and the parameters that were set and that the new one has, too.
    ///
    /// # Errors
    /// Everything that is wrong with it, each with the argument it was said in.
    pub fn exchange(&self, wanted: &Exchange, registry: &Registry) -> Result<Exchanged, Problems> {
        let mut problems = Findings::default();
        let exchanged = match self.what_runs(wanted, registry, &mut problems) {
            Some(Program::Builtin(app_type, _)) => Some(self.as_type(app_type, wanted, &mut problems)),
            Some(program @ Program::Foreign { .. }) => Some(self.as_executable(program, wanted, &mut problems)),
            None => None,
        };
        match exchanged {
            Some(exchanged) if problems.is_empty() => Ok(exchanged),
            _ => Err(problems.located(&wanted.folder, "")),
        }
    }

    /// As [`AppSpec::exchange`], in the mission that runs, whose apps are `apps`, this one among them: what they read,
    /// write and have in common goes together as in a mission file, with this one exchanged.
    ///
    /// # Errors
    /// As there. What another app says is named after that app.
    pub fn exchange_among(&self, apps: &[Self], wanted: &Exchange, registry: &Registry) -> Result<Exchanged, Problems> {
        let exchanged = self.exchange(wanted, registry)?;
        let mut problems = Findings::default();
        wiring::keeps_resolution(&Draft::of(self), &wanted.draft(&exchanged.app), &mut problems);
        if problems.is_empty() {
            let after = |app: &Self| if app.name == self.name { wanted.draft(&exchanged.app) } else { Draft::of(app) };
            let mut drafts: Vec<Draft> = apps.iter().map(after).collect();
            wiring::connect(&mut drafts, &mut problems);
            variables::check(&drafts, &mut problems);
        }
        if problems.is_empty() { Ok(exchanged) } else { Err(problems.located(&wanted.folder, "")) }
    }

    /// The program of the new one; a built-in one's parameters are yet to be resolved.
    fn what_runs(&self, wanted: &Exchange, registry: &Registry, problems: &mut Findings) -> Option<Program> {
        let word = if wanted.via == Via::Lines { "pipe" } else { "exec" };
        match (&wanted.type_name, &wanted.exec) {
            (Some(_), Some((exec, _))) => {
                let at = At::CommandLine(format!("{word}={exec}"));
                problems.add(&at, format!("type and {word} are both said; one is right"));
                None
            }
            (None, None) => Some(self.program.clone()),
            (Some(name), None) => {
                let found = registry.find(&self.element, name);
                if found.is_none() {
                    let known: Vec<&str> = registry.of_element(&self.element).map(|one| one.name).collect();
                    let (element, right) = (&self.element, instead(name, &known));
                    let at = At::CommandLine(format!("type={name}"));
                    problems.add(&at, format!("{element} has no type {name:?}; {right}"));
                }
                found.map(|app_type| Program::Builtin(app_type, crate::Params::default()))
            }
            (None, Some((exec, args))) => {
                let found = executable(exec, &wanted.folder);
                let at = At::CommandLine(format!("{word}={exec}"));
                let exec = found.map_err(|message| problems.add(&at, message)).ok()?;
                Some(Program::Foreign { exec, args: args.clone(), via: wanted.via.clone() })
            }
        }
    }

    /// What was said of this app and is not said anew.
    fn kept<'a>(&'a self, wanted: &'a Exchange) -> impl Iterator<Item = &'a (String, String)> {
        let anew = |name: &str| wanted.params.iter().any(|(other, _)| other.eq_ignore_ascii_case(name));
        self.settings.iter().filter(move |(name, _)| self.said.contains(name) && !anew(name))
    }

    fn as_type(&self, app_type: &'static AppType, wanted: &Exchange, problems: &mut Findings) -> Exchanged {
        let (kept, lost): (Vec<_>, Vec<_>) = self.kept(wanted).partition(|(name, _)| app_type.param(name).is_some());
        let given = |(name, text): &(String, String)| {
            let said = At::CommandLine(format!("{name}={text}"));
            Given::new(name, text, said.clone(), said, &wanted.folder)
        };
        let all = kept.into_iter().chain(&wanted.params).map(given).collect();
        let at = At::CommandLine(format!("type={}", app_type.name));
        let table = Table { who: &app_type.title(), params: app_type.params };
        let resolved = resolve(&table, all, &at, problems);
        let program = Program::Builtin(app_type, resolved.params);
        let app = Self { program, settings: resolved.settings, said: resolved.said, ..self.clone() };
        Exchanged { app, dropped: lost.iter().map(|(name, text)| format!("{name}={text}")).collect() }
    }

    fn as_executable(&self, program: Program, wanted: &Exchange, problems: &mut Findings) -> Exchanged {
        let settings: Vec<_> = self.kept(wanted).chain(&wanted.params).cloned().collect();
        if let Program::Foreign { via: Via::Moos(file), .. } = &program {
            let given = |(name, text): &(String, String)| {
                let said = At::CommandLine(format!("{name}={text}"));
                Given::new(name, text, said.clone(), said, &wanted.folder)
            };
            let at = At::CommandLine("moos".to_owned());
            moos::check(file.as_deref(), &settings.iter().map(given).collect::<Vec<_>>(), &at, problems);
        }
        let said = settings.iter().map(|(name, _)| name.clone()).collect();
        Exchanged { app: Self { program, settings, said, ..self.clone() }, dropped: Vec::new() }
    }
}
