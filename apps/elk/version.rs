//! Which elk this is.

/// The git revision that this was built from; `-changed` behind it: and from changes that no revision has.
pub const REVISION: &str = env!("ELK_REVISION");
/// What elk's apps say of themselves where they join.
pub const BUILD: &str = concat!("elk ", env!("CARGO_PKG_VERSION"), " ", env!("ELK_REVISION"));
/// What `elk --version` says.
pub const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), " (", env!("ELK_REVISION"), ")");
