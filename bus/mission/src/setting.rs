//! `--set App.Param=V`: one parameter of a mission, said on the command line instead of in the file.

use std::fmt;
use std::str::FromStr;

/// One parameter said on the command line. The parameter `type` exchanges the app's type, `exec` puts any other executable
/// in its place, and `args` says that one's arguments.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Override {
    /// The app's name in the mission.
    pub app: String,
    /// The parameter.
    pub param: String,
    /// Its text.
    pub text: String,
}

/// What is no override.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0:?} sets nothing; right is App.Param=Value, for example Map.Res=0.05")]
pub struct OverrideError(String);

impl FromStr for Override {
    type Err = OverrideError;

    fn from_str(said: &str) -> Result<Self, OverrideError> {
        let parts = || {
            let (target, text) = said.split_once('=')?;
            let (app, param) = target.split_once('.')?;
            let (app, param) = (app.trim(), param.trim());
            (!app.is_empty() && is_name(param)).then(|| Self {
                app: app.to_owned(),
                param: param.to_owned(),
                text: text.trim().to_owned(),
            })
        };
        parts().ok_or_else(|| OverrideError(said.to_owned()))
    }
}

/// Whether a parameter can be called so: as an element of a mission file.
fn is_name(param: &str) -> bool {
    param.starts_with(|c: char| c.is_alphabetic() || c == '_')
        && param.chars().all(|c| c.is_alphanumeric() || "-_.".contains(c))
}

impl fmt::Display for Override {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "--set {}.{}={}", self.app, self.param, self.text)
    }
}

#[cfg(test)]
mod tests {
    use super::Override;

    #[test]
    fn reads_app_parameter_and_value() {
        let set: Override = "Map.Res = 0.05 m".parse().unwrap();
        assert_eq!((&*set.app, &*set.param, &*set.text), ("Map", "Res", "0.05 m"));
    }

    #[test]
    fn what_sets_nothing_is_said_so() {
        for wrong in ["Map.Res", "Res=1", ".Res=1", "Map.=1", "", "Mine.a<b=1", "Mine.2=1"] {
            let error = wrong.parse::<Override>().unwrap_err().to_string();
            assert_eq!(error, format!("{wrong:?} sets nothing; right is App.Param=Value, for example Map.Res=0.05"));
        }
    }
}
