//! What a page can have done, behind a seam: this crate knows neither launchers nor missions.

use std::path::PathBuf;

use serde_json::Value;

use crate::words::Order;

/// Whoever does what pages say. Its functions may wait; they are called where that holds up nobody else.
pub trait Steering: Send + Sync {
    /// Has the launcher do it; what was done, in words. `on_progress` is told what happens meanwhile.
    ///
    /// # Errors
    /// It could not be done; in words why.
    fn order(&self, order: &Order, on_progress: &mut dyn FnMut(&str)) -> Result<String, String>;

    /// Writes a variable; what was done, in words.
    ///
    /// # Errors
    /// It could not be done; in words why.
    fn poke(&self, key: &str, value: &str) -> Result<String, String>;

    /// The mission's apps: rows, as `elk apps --json` has them; `None`: nobody launches the community.
    fn apps(&self) -> Option<Value>;

    /// The types of apps, by element: `[{"element", "types": [{"name", "summary", "params": […]}]}]`.
    fn types(&self) -> Value;

    /// The text log of an app of the mission; `None`: there is none.
    fn log(&self, app: &str) -> Option<PathBuf>;
}
