//! What of a client's words was not taken.

/// What of a client was not taken.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Refusal {
    /// The variable, or what else it named.
    pub key: String,
    /// Why.
    pub reason: String,
}
