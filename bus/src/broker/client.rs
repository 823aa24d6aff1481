//! What the broker knows of one client.

use std::collections::{BTreeSet, VecDeque};

use super::handling::Reached;
use super::limits::UNNAMED;
use super::mailbox::Mailbox;
use super::membership::Standing;
use super::registration::Registration;
use super::{ClientId, summary};
use crate::wire::{BULK, Header, Named, RESENT, ValueKind};

/// A client.
pub(super) struct Client {
    pub name: String,
    pub standing: Standing,
    /// How long its session is kept after its death (s).
    pub lease_secs: f64,
    /// The client's numbers, by [`Named`], to the broker's.
    pub numbers: [Vec<u32>; 4],
    /// Names that nobody had brought before it.
    pub brought: usize,
    pub registrations: Vec<Registration>,
    pub registered_bytes: usize,
    pub mailbox: Mailbox,
    /// What it registered and took back, and what it published, before it had its session.
    pub asked: Vec<u8>,
    pub held: Vec<u8>,
    /// Batches taken from it.
    pub taken: u64,
    /// Those whose mail not everybody has handled: (batch, who got mail from it).
    pub unhandled: VecDeque<(u64, Vec<Reached>)>,
    /// Lossless registrants that this client's messages went to.
    pub feeds: BTreeSet<ClientId>,
    pub published: BTreeSet<u32>,
    pub last_published: Option<u32>,
    pub latency: summary::Latency,
}

impl Client {
    pub fn new(name: &str, lease_secs: f64, mailbox_bytes: usize, now: f64) -> Self {
        Self {
            name: name.into(),
            standing: Standing::Present,
            lease_secs,
            numbers: [vec![], vec![UNNAMED], vec![], vec![0]],
            brought: 0,
            registrations: Vec::new(),
            registered_bytes: 0,
            mailbox: Mailbox::new(mailbox_bytes, now),
            asked: Vec::new(),
            held: Vec::new(),
            taken: 0,
            unhandled: VecDeque::new(),
            feeds: BTreeSet::new(),
            published: BTreeSet::new(),
            last_published: None,
            latency: summary::Latency::default(),
        }
    }

    /// The header of one of the client's messages in the broker's numbers.
    pub fn renumber(&self, header: &Header) -> Result<Header, &'static str> {
        let number = |what: Named, number: u32| {
            self.numbers[what as usize].get(number as usize).copied().ok_or("a number was used before its definition")
        };
        Ok(Header {
            flags: header.flags & (BULK | RESENT),
            key: number(Named::Key, header.key)?,
            source: number(Named::Source, header.source)?,
            type_: if header.value_kind == ValueKind::Binary { number(Named::Type, header.type_)? } else { 0 },
            community: number(Named::Community, header.community)?,
            ..*header
        })
    }

    pub fn is_joining(&self) -> bool {
        matches!(self.standing, Standing::Joining { .. })
    }
}
