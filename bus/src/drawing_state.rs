//! What a client has drawn and declared, as far as it has to know it itself.

use std::collections::{BTreeMap, BTreeSet};

use elk_drawing::keyboard::Keyboard;

/// Names of drawings that an app has at a time.
pub const MAX_DRAWINGS: usize = 64;

/// What a client has drawn and declared, and whether anybody looks.
#[derive(Default)]
pub(crate) struct DrawingState {
    /// What was drawn and not taken away, with whether it goes by itself.
    pub drawn: BTreeMap<String, bool>,
    /// Whether the broker was asked if anybody looks.
    pub asked: bool,
    /// What it has answered last.
    pub watched: Option<bool>,
    /// Whether it has begun to say that somebody does, and the app does not know yet.
    pub newly_watched: bool,
    /// What all apps have declared, once this one has.
    pub keyboard: Option<Keyboard>,
    /// Keys that are another's, as far as that was said.
    pub said: BTreeSet<String>,
}
