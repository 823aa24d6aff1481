//! All app types that a program offers, looked up by element and type.

use std::path::Path;

use crate::params::Params;
use crate::problem::{At, Findings, Problems};
use crate::resolve::{Given, Resolved, Table, resolve};
use crate::spec::{AppType, ParamSpec};

/// The app types that mission files can name.
#[derive(Debug, Clone, Default)]
pub struct Registry {
    types: Vec<&'static AppType>,
}

impl Registry {
    /// The types of all `tables`, in their order.
    pub fn new(tables: &[&'static [AppType]]) -> Self {
        let types = tables.iter().flat_map(|table| table.iter()).collect();
        Self { types }
    }

    /// All types, in their order.
    pub fn types(&self) -> impl Iterator<Item = &'static AppType> {
        self.types.iter().copied()
    }

    /// The types of an element.
    pub fn of_element(&self, element: &str) -> impl Iterator<Item = &'static AppType> {
        self.types().filter(move |app_type| app_type.element == element)
    }

    /// One type.
    pub fn find(&self, element: &str, name: &str) -> Option<&'static AppType> {
        self.of_element(element).find(|app_type| app_type.name == name)
    }
}

impl FromIterator<&'static AppType> for Registry {
    fn from_iter<I: IntoIterator<Item = &'static AppType>>(types: I) -> Self {
        Self { types: types.into_iter().collect() }
    }
}

impl AppType {
    /// The parameter of this name. As in MOOS, case does not count.
    pub fn param(&self, name: &str) -> Option<&'static crate::ParamSpec> {
        self.params.iter().find(|param| param.name.eq_ignore_ascii_case(name))
    }

    /// Checks parameters as one app by itself is given them on its command line: `Param=Value`, files relative to `folder`.
    ///
    /// # Errors
    /// Everything that is wrong, each with the argument it was said in.
    pub fn check(&self, settings: &[(String, String)], folder: &Path) -> Result<Params, Problems> {
        let place = At::CommandLine(format!("--type {}", self.name));
        check(&Table { who: &self.title(), params: self.params }, settings, folder, &place)
    }

    /// `Filter Distance`
    pub(crate) fn title(&self) -> String {
        format!("{} {}", self.element, self.name)
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

fn check(table: &Table<'_>, settings: &[(String, String)], folder: &Path, place: &At) -> Result<Params, Problems> {
    let given = settings.iter().map(|(name, text)| {
        let said = At::CommandLine(format!("{name}={text}"));
        Given::new(name, text, said.clone(), said, folder)
    });
    let mut problems = Findings::default();
    let Resolved { params, .. } = resolve(table, given.collect(), place, &mut problems);
    match problems.is_empty() {
        true => Ok(params),
        false => Err(problems.located(folder, "")),
    }
}

impl std::fmt::Debug for AppType {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {}", self.element, self.name)
    }
}
