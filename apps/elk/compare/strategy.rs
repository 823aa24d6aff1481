//! A strategy as it is said: a type of explorer or an executable, and parameters of its own.

use std::path::Path;

use anyhow::{Context, Result, anyhow};
use elk_mission::{Override, element, instead, split_arguments};

use crate::arguments::setting;
use crate::registry::registry;

/// What runs as the mission's explorer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Strategy {
    /// As it was said: what its rows are called.
    pub words: String,
    /// `type` or `exec`, and its parameters.
    settings: Vec<(String, String)>,
}

impl Strategy {
    /// Takes `./mine Climb=2` apart, as a shell does: `'./my mine' Climb=2` has a space in its path.
    pub fn parse(words: &str) -> Result<Self> {
        // A path without parameters needs no quotes of its own.
        let words = words.trim();
        let mut parts = match Path::new(words).is_file() {
            true => vec![words.to_owned()],
            false => split_arguments(words).with_context(|| words.to_owned())?,
        };
        let program = if parts.is_empty() { String::new() } else { parts.remove(0) };
        let mut settings = vec![(what_runs(&program)?.to_owned(), program)];
        for part in parts {
            let parameter = setting(&part).map_err(|wrong| anyhow!("{words}: {wrong}"))?;
            settings.push(parameter);
        }
        Ok(Self { words: words.to_owned(), settings })
    }

    /// What changes a mission whose explorer is called `explorer` for this strategy: what is said `for_all`, and its own
    /// words, which count where both say the same parameter.
    pub fn sets(&self, explorer: &str, for_all: &[Override]) -> Vec<Override> {
        // Of its parameters alone: that what runs is said twice is a mistake, and stays one.
        let own = |set: &&Override| {
            set.app == explorer && self.settings[1..].iter().any(|(name, _)| name.eq_ignore_ascii_case(&set.param))
        };
        let set = |(param, text): &(String, String)| set(explorer, param, text);
        for_all.iter().filter(|set| !own(set)).cloned().chain(self.settings.iter().map(set)).collect()
    }
}

/// `--set APP.PARAM=TEXT`
pub fn set(app: &str, param: &str, text: &str) -> Override {
    Override { app: app.to_owned(), param: param.to_owned(), text: text.to_owned() }
}

/// Whether a program is a `type`, or an `exec`.
fn what_runs(program: &str) -> Result<&'static str> {
    let registry = registry();
    let known: Vec<&str> = registry.of_element(element::EXPLORER).map(|one| one.name).collect();
    let right = || instead(program, &known);
    match (known.contains(&program), program.contains('/')) {
        (true, _) => Ok("type"),
        _ if setting(program).is_ok_and(|(name, _)| !name.contains('/')) => {
            let right = format!("'{} {program}'", known.first().copied().unwrap_or_default());
            Err(anyhow!("{program} is no strategy; right is a parameter in quotes with its strategy, as {right}"))
        }
        (false, true) => Ok("exec"),
        (false, false) => {
            Err(anyhow!("{program} is no strategy; {}, or an executable's path with a /, as ./{program}", right()))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(words: &str) -> Vec<String> {
        let strategy = Strategy::parse(words).unwrap();
        let for_all = ["Map.Res=0.2", "Explorer.Climb=7"].map(|set| set.parse().unwrap());
        strategy
            .sets("Explorer", &for_all)
            .iter()
            .map(|set| format!("{}.{}={}", set.app, set.param, set.text))
            .collect()
    }

    #[test]
    fn a_strategy_is_a_type_or_an_executable_with_its_own_parameters() {
        assert_eq!(said("Potential"), ["Map.Res=0.2", "Explorer.Climb=7", "Explorer.type=Potential"]);
        assert_eq!(said(" ./mine  climb=2 "), ["Map.Res=0.2", "Explorer.exec=./mine", "Explorer.climb=2"]);
        assert_eq!(said("'./my mine' 'Words=a b'")[2..], ["Explorer.exec=./my mine", "Explorer.Words=a b"]);
        let folder = tempfile::tempdir().unwrap();
        let mine = folder.path().join("my own");
        std::fs::write(&mine, "").unwrap();
        assert_eq!(said(mine.to_str().unwrap())[2], format!("Explorer.exec={}", mine.display()));
    }

    #[test]
    fn what_is_no_strategy_is_answered_with_what_is_right() {
        for (words, right) in [
            ("Potental", "did you mean Potential?, or an executable's path with a /, as ./Potental"),
            (
                "Climb=2",
                "Climb=2 is no strategy; right is a parameter in quotes with its strategy, as 'ClosestFrontier Climb=2'",
            ),
            ("./mine Climb", "./mine Climb: \"Climb\" is no parameter: right is Param=Value"),
            ("./mine 'Climb=2", "is not closed"),
            ("", "is no strategy"),
        ] {
            let error = format!("{:#}", Strategy::parse(words).unwrap_err());
            assert!(error.contains(right), "{error}");
        }
    }
}
