//! The variables that drawings and keys travel under: each client has its own, so that the broker keeps the latest drawing
//! of each name for whoever comes late, and the log has a channel for each.

use elk_proto::Key;

use crate::drawing::Drawing;
use crate::keys::{KeyPress, KeyTable};

/// All drawings, of all clients.
pub const DRAWINGS: &str = "DRAWING/*";
/// The declared keys of all clients.
pub const KEYS: &str = "KEYS/*";

/// What the variables of a client's drawings begin with.
pub fn drawings_of(client: &str) -> String {
    format!("DRAWING/{client}/")
}

/// The drawing of this name of a client.
pub fn drawing(client: &str, name: &str) -> Key<Drawing> {
    Key::named(drawings_of(client) + name)
}

/// Whether a variable carries drawings.
pub fn is_drawing(variable: &str) -> bool {
    variable.starts_with("DRAWING/")
}

/// The keys that a client declares.
pub fn keys_of(client: &str) -> Key<KeyTable> {
    Key::named(format!("KEYS/{client}"))
}

/// Whether a variable carries the keys that somebody declares.
pub fn is_keys(variable: &str) -> bool {
    variable.starts_with("KEYS/")
}

/// Keys of a client that were pressed.
pub fn key_press(client: &str) -> Key<KeyPress> {
    Key::named(format!("KEY_PRESS/{client}"))
}
