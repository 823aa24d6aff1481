//! What a broker keeps at most, whatever its clients do. docs/security.md adds the bounds up.

use crate::wire;

/// Bounds on what clients can make a broker hold. Names and the table are refused beyond them, with a word to the client;
/// mail is dropped, oldest first, and counted.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Limits {
    /// Clients at a time, and sessions of clients that died. Each takes nearly a megabyte for its lanes alone.
    pub clients: usize,
    /// Bytes of one name: of a variable, source, type or community, and of one pattern.
    pub name_bytes: usize,
    /// Variables; a reader's pattern may match all of them.
    pub variables: usize,
    /// Names that one client brings: some are left for the others.
    pub names_of_a_client: usize,
    /// Sources, types and communities, each.
    pub other_names: usize,
    /// Bytes of all names together, of the descriptions of types and of the builds of sources.
    pub all_name_bytes: usize,
    /// Numbers that one client gives to names, its own and others'; and those of all clients.
    pub numbers_of_a_client: usize,
    /// See [`Limits::numbers_of_a_client`].
    pub numbers: usize,
    /// Pairs of a variable and a source that writes it.
    pub routes: usize,
    /// Readers of all these pairs together.
    pub deliveries: usize,
    /// Bytes of all registrations together.
    pub registration_bytes: usize,
    /// Registrations of all clients by pattern, of variables or of sources: each new variable is held against every one of them.
    pub patterns: usize,
    /// Bytes of one message that travels in a batch; larger values lie in their publisher's shared memory.
    pub message_bytes: usize,
    /// Bytes of all latest values that the broker holds itself.
    pub latest_bytes: usize,
    /// Bytes of the mail of all clients together: each has an equal share, and at most [`crate::broker::BrokerConfig::mailbox_bytes`].
    pub mail_bytes: usize,
    /// Bytes by which single messages may be larger than their readers' mailboxes, all together.
    pub oversize_bytes: usize,
    /// Bytes of messages that wait until their reader's interval is over; further ones do not wait.
    pub pending_bytes: usize,
    /// Bytes of what is remembered of batches that not everybody has handled; each client has an equal share.
    pub unhandled_bytes: usize,
    /// Bytes of values that are copied out of their publisher's shared memory: those of publishers that are gone, and of
    /// publishers with many latest values. A single value beyond it is not copied for who comes late, either. A transport
    /// heeds it.
    pub copied_bytes: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            clients: 96,
            name_bytes: wire::MAX_NAME,
            variables: 1 << 17,
            names_of_a_client: 7 << 14,
            other_names: 1 << 16,
            all_name_bytes: 8 << 20,
            numbers_of_a_client: 1 << 18,
            numbers: 1 << 22,
            routes: 1 << 18,
            deliveries: 1 << 20,
            registration_bytes: 8 << 20,
            patterns: 1 << 12,
            message_bytes: wire::MAX_MESSAGE,
            latest_bytes: 32 << 20,
            mail_bytes: 32 << 20,
            oversize_bytes: 32 << 20,
            pending_bytes: 16 << 20,
            unhandled_bytes: 32 << 20,
            copied_bytes: 48 << 20,
        }
    }
}
