//! What the broker knows of one client.

use std::collections::{BTreeSet, VecDeque};

use super::latency::Latency;
use super::mailbox::Mailbox;
use super::names::Names;
use super::reached::Reached;
use super::registration::Registration;
use crate::wire::{BULK, ClientId, Header, Named, RESENT, ValueKind};

/// What a client's number of a name stands for that the broker did not take.
pub const REFUSED: u32 = u32::MAX;

/// What a client's own number as a source stands for until it has written something.
pub const UNNAMED: u32 = u32::MAX - 1;

/// What a client inside says in the place of a source's number that means itself.
pub const ITSELF: u32 = u32::MAX;

/// How a client stands to the community.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Standing {
    /// It is there.
    Present,
    /// Its process is gone; its session is kept until then (s). `returns`: a client that lives and will be back.
    Disconnected { until: f64, returns: bool },
    /// It will take over the session of `predecessor`. `ready`: as soon as that one makes room.
    Joining { predecessor: ClientId, ready: bool },
}

/// A client.
pub struct Client {
    pub name: String,
    /// Which build of which program it is, as it says; empty: it has not said.
    pub build: String,
    /// The broker's number of the build, once the client has written something and if there was room for it.
    pub build_number: Option<u32>,
    pub standing: Standing,
    /// How long its session is kept after its death (s).
    pub lease_secs: f64,
    /// It is in the broker's process, and its frames are in the broker's numbers.
    pub is_inside: bool,
    /// The client's numbers, by [`Named`], to the broker's; of one inside there is none but that of itself as a source.
    pub numbers: [Vec<u32>; 4],
    /// It has given so many numbers that all further ones stand for names that are not taken.
    pub is_out_of_numbers: bool,
    /// Names that nobody had brought before it.
    pub brought: usize,
    pub registrations: Vec<Registration>,
    pub registered_bytes: usize,
    /// Registrations that are by pattern.
    pub registered_patterns: usize,
    /// Routes that it is in.
    pub deliveries: usize,
    pub mailbox: Mailbox,
    /// What it registered and took back, and what it published, before it had its session.
    pub asked: Vec<u8>,
    pub held: Vec<u8>,
    /// Batches taken from it.
    pub taken: u64,
    /// Those whose mail not everybody has handled: (batch, who got mail from it).
    pub unhandled: VecDeque<(u64, Box<[Reached]>)>,
    pub unhandled_bytes: usize,
    /// Lossless registrants that this client's messages went to.
    pub feeds: BTreeSet<ClientId>,
    pub published: BTreeSet<u32>,
    pub last_published: Option<u32>,
    pub latency: Latency,
}

/// What a client is told that uses a number before it says what that stands for.
pub const UNDEFINED: &str = "a number was used before its definition";

/// Why a client's number stands for none of the broker's.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unnumbered {
    /// It was never defined.
    Undefined,
    /// It was given to a name that the broker did not take.
    Refused,
}

impl Client {
    pub fn new(name: &str, lease_secs: f64, mailbox_bytes: usize, now: f64) -> Self {
        Self {
            name: name.into(),
            build: String::new(),
            build_number: None,
            standing: Standing::Present,
            lease_secs,
            is_inside: false,
            numbers: [vec![], vec![UNNAMED], vec![], vec![0]],
            is_out_of_numbers: false,
            brought: 0,
            registrations: Vec::new(),
            registered_bytes: 0,
            registered_patterns: 0,
            deliveries: 0,
            mailbox: Mailbox::new(mailbox_bytes, now),
            asked: Vec::new(),
            held: Vec::new(),
            taken: 0,
            unhandled: VecDeque::new(),
            unhandled_bytes: 0,
            feeds: BTreeSet::new(),
            published: BTreeSet::new(),
            last_published: None,
            latency: Latency::default(),
        }
    }

    /// The header of one of the client's messages in the broker's numbers.
    #[inline(always)]
    pub fn renumber(&self, header: &Header, names: &Names) -> Result<Header, Unnumbered> {
        let type_ = (header.value_kind == ValueKind::Binary).then_some(header.type_);
        let [key, source, type_, community] = match self.is_inside {
            true => self.checked(header, type_, names)?,
            false => [
                self.number(Named::Key, header.key)?,
                self.number(Named::Source, header.source)?,
                type_.map_or(Ok(0), |type_| self.number(Named::Type, type_))?,
                self.number(Named::Community, header.community)?,
            ],
        };
        Ok(Header { flags: header.flags & (BULK | RESENT), key, source, type_, community, ..*header })
    }

    /// The numbers of a message in which they are the broker's already, but for that of the client itself.
    fn checked(&self, header: &Header, type_: Option<u32>, names: &Names) -> Result<[u32; 4], Unnumbered> {
        let known = |what, number| match names.count(what) > number as usize {
            true => Ok(number),
            false => Err(Unnumbered::Undefined),
        };
        let source = match header.source {
            ITSELF => self.number(Named::Source, 0)?,
            other => known(Named::Source, other)?,
        };
        let type_ = type_.map_or(Ok(0), |type_| known(Named::Type, type_))?;
        Ok([known(Named::Key, header.key)?, source, type_, known(Named::Community, header.community)?])
    }

    /// The broker's number for one of the client's.
    #[inline]
    pub fn number(&self, what: Named, number: u32) -> Result<u32, Unnumbered> {
        match self.numbers[what as usize].get(number as usize) {
            Some(&REFUSED) => Err(Unnumbered::Refused),
            Some(known) => Ok(*known),
            None if self.is_out_of_numbers => Err(Unnumbered::Refused),
            None => Err(Unnumbered::Undefined),
        }
    }

    /// Numbers that it has given to names.
    pub fn given_numbers(&self) -> usize {
        self.numbers.iter().map(Vec::len).sum()
    }

    pub fn is_joining(&self) -> bool {
        matches!(self.standing, Standing::Joining { .. })
    }

    /// Whether it is gone and its session is kept.
    pub fn is_disconnected(&self) -> bool {
        matches!(self.standing, Standing::Disconnected { .. })
    }

    /// Whether its next batch has to wait until it has the session that it came for.
    pub fn waits_for_its_session(&self) -> bool {
        matches!(self.standing, Standing::Joining { ready: true, .. })
    }
}
