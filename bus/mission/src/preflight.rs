//! What a mission needs and its file cannot show: executables that run, files that hold what they should, apps that
//! agree.
//!
//! An [`AppType`](crate::AppType) may bring a look of its own at what it needs; of any other type it is seen that it
//! can be built. So what passes here starts.

use crate::spec::{AppSpec, Mission, PreflightReport, Program};

/// Why a mission that is well said could not be run; a line each, `App: why`.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}", .faults.join("\n"))]
pub struct NotReady {
    /// In the order of the mission's apps.
    pub faults: Vec<String>,
}

impl Mission {
    /// Looks at everything that its apps need, before any of them is started; what is worth a word, a line each.
    ///
    /// # Errors
    /// Everything that keeps it from running.
    pub fn preflight(&self) -> Result<Vec<String>, NotReady> {
        let (mut faults, mut warnings) = (Vec::new(), self.notes.clone());
        for app in &self.apps {
            let found = self.look_at(app);
            let named = |what: String| format!("{}: {what}", app.name);
            faults.extend(found.faults.into_iter().map(named));
            warnings.extend(found.warnings.into_iter().map(named));
        }
        if faults.is_empty() { Ok(warnings) } else { Err(NotReady { faults }) }
    }

    fn look_at(&self, app: &AppSpec) -> PreflightReport {
        match &app.program {
            Program::Builtin(app_type, params) => match app_type.preflight {
                Some(look) => look(params, self),
                None => (app_type.build)(params).map_or_else(PreflightReport::fault, |_| PreflightReport::default()),
            },
            program @ Program::Foreign { .. } => {
                program.executable().map_or_else(PreflightReport::fault, |_| PreflightReport::default())
            }
        }
    }
}
