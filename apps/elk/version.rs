//! Which elk this is.

/// The git revision that this was built from; `-changed` behind it: and from changes that no revision has.
pub const REVISION: &str = env!("ELK_REVISION");
/// What `elk --version` says.
pub const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), " (", env!("ELK_REVISION"), ")");
