//! What somebody who translates a client's messages has to know of the community.

/// The type of bytes of which MOOS says nothing more.
pub const BYTES_TYPE: &str = "MOOS binary";

/// What the community's variables carry.
pub trait Table {
    /// Name and layout of the type that a variable carries; `None`: none of a name, or it carries nothing yet.
    fn type_of(&self, key: &str) -> Option<(&str, u64)>;
}
