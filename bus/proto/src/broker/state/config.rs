//! What a broker is told about itself.

use super::limits::Limits;

/// What a broker can be told about itself.
#[derive(Debug, Clone)]
pub struct BrokerConfig {
    /// The community's name: part of the broker's own name and of every message.
    pub community: String,
    /// The most that a client's mailbox holds (bytes); the oldest mail goes first.
    pub mailbox_bytes: usize,
    /// How long publishers wait for a lossless registrant that does not read (s, the wall's); then its mail is dropped as well.
    pub lossless_patience_secs: f64,
    /// How many times as fast as the wall's the clock runs that the broker is told the time of.
    pub time_warp: f64,
    /// What clients can make it hold.
    pub limits: Limits,
}

impl BrokerConfig {
    /// Mailboxes of 4 MiB, patience of 5 s, a clock that runs as the wall's.
    pub fn new(community: impl Into<String>) -> Self {
        Self {
            community: community.into(),
            mailbox_bytes: 4 << 20,
            lossless_patience_secs: 5.0,
            time_warp: 1.0,
            limits: Limits::default(),
        }
    }

    /// The same with mailboxes of so many bytes, and with room for eight that are full.
    pub fn with_mailbox_bytes(self, mailbox_bytes: usize) -> Self {
        let limits = Limits { mail_bytes: mailbox_bytes.saturating_mul(8), ..self.limits };
        Self { mailbox_bytes, limits, ..self }
    }

    /// So many seconds of the wall's in those of the broker's clock. How long a process takes to read, or to be started again,
    /// is a matter of the wall's time, however fast the community's passes.
    pub(crate) fn of_wall(&self, secs: f64) -> f64 {
        secs * self.time_warp
    }

    /// How long publishers wait for a lossless registrant (s, of the broker's clock).
    pub(crate) fn lossless_patience(&self) -> f64 {
        self.of_wall(self.lossless_patience_secs)
    }
}
