//! What an app may fail with, and what its `main` returns, so that people read words.

use std::error::Error;
use std::fmt;

/// What an app may fail with.
pub type AppError = Box<dyn Error + Send + Sync>;

/// Any error, to be returned by `main`: that shows errors by their `Debug`, which is for programmers; this one shows itself
/// as its [`Display`](fmt::Display) does, with the causes that it does not name itself.
///
/// ```
/// use elk_bus::{Community, Failure};
///
/// fn main_of_an_app(community: &str) -> Result<(), Failure> {
///     Community::new(community)?;
///     Ok(())
/// }
///
/// let failure = main_of_an_app("a/b").unwrap_err();
/// assert!(format!("{failure:?}").starts_with("\"a/b\" is no name for a community"));
/// ```
pub struct Failure(AppError);

impl<E: Into<AppError>> From<E> for Failure {
    fn from(error: E) -> Self {
        Self(error.into())
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write_words(f, &*self.0)
    }
}

impl fmt::Debug for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// Writes an error and its causes, each once, for a terminal, whatever of somebody else's is in them. Errors that a `main` is
/// likely to return as they are have it as their `Debug`.
pub(crate) fn write_words(f: &mut fmt::Formatter<'_>, error: &(dyn Error + 'static)) -> fmt::Result {
    let mut said = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        let words = error.to_string();
        if !said.contains(&words) {
            said = format!("{said}: {words}");
        }
        cause = error.source();
    }
    f.write_str(&elk_outside::text::printable_lines(&said))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_run_app_returns_is_words_by_itself() {
        let error = crate::RunError::App { app: "Lamp".into(), source: "no oil".into() };
        assert_eq!(format!("{error:?}"), "Lamp: no oil");
        let boxed: Box<dyn Error> = crate::OptionError::Twice("Rate".into()).into();
        assert_eq!(format!("{boxed:?}"), "Rate is said twice; once is enough");
        let odd = crate::OptionError::Twice("Rate\x1b[2J".into());
        assert_eq!(format!("{odd:?}"), "Rate\\u{1b}[2J is said twice; once is enough", "a terminal only shows it");
        let dark = Dark("x".parse::<u8>().unwrap_err());
        let error = crate::RunError::App { app: "Lamp".into(), source: dark.into() };
        assert_eq!(format!("{error:?}"), "Lamp: the lamp is dark: invalid digit found in string", "with its causes");
    }

    #[derive(Debug, thiserror::Error)]
    #[error("the lamp is dark")]
    struct Dark(#[from] std::num::ParseIntError);

    #[test]
    fn what_main_returns_is_words_with_their_causes_each_once() {
        let dark = Dark("x".parse::<u8>().unwrap_err());
        assert_eq!(format!("{:?}", Failure::from(dark)), "the lamp is dark: invalid digit found in string");
        assert_eq!(format!("{:?}", Failure::from("no lamp\x1b[2J")), "no lamp\\u{1b}[2J");
    }
}
