//! Why an app cannot use a message.

/// Why an app cannot use a message although it decodes: it contradicts what the app knows. An app that fails with this,
/// or with a [`DecodeError`](crate::codec::DecodeError), while it handles mail goes on with the next message.
///
/// What the app had changed before it failed stays changed: look first, then act.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Rejection(String);

impl Rejection {
    /// A rejection for this reason, which names the field at fault.
    pub fn new(reason: impl std::fmt::Display) -> Self {
        Self(reason.to_string())
    }
}
