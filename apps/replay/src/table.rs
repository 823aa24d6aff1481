//! The broker's table: who is there, what they wait for, what they have lost.

use std::collections::BTreeMap;
use std::time::Duration;

use elk_bus::Client;
use elk_bus::broker::table::{CommunityTable, REQUEST, TABLE};
use elk_bus::clock::Stopwatch;

use crate::error::ReplayError;

/// How long the broker may take to answer.
const PATIENCE: Duration = Duration::from_secs(10);

/// Asks for the table. The answer also says that the broker has taken in all that was sent before.
pub(crate) fn table(client: &mut Client) -> Result<CommunityTable, ReplayError> {
    table_and(client, &mut |_| {})
}

/// As [`table`]; what else comes meanwhile goes to `on_mail`.
pub(crate) fn table_and(
    client: &mut Client,
    on_mail: &mut dyn FnMut(&elk_bus::Mail<'_>),
) -> Result<CommunityTable, ReplayError> {
    client.comms.notify(REQUEST, 1.0)?;
    let waited = Stopwatch::start();
    while waited.elapsed() < PATIENCE {
        let mut answer = None;
        client.receive(PATIENCE.saturating_sub(waited.elapsed()), |mail| match mail.is(&TABLE) {
            true => answer = Some(mail.decode(&TABLE)),
            false => on_mail(mail),
        })?;
        if let Some(answer) = answer {
            return Ok(answer?);
        }
    }
    Err(ReplayError::Silent { community: client.comms.community().into(), secs: PATIENCE.as_secs() })
}

/// Messages that clients have lost, by name, as of the last time that they were seen: who leaves takes its count along.
#[derive(Debug, Default)]
pub(crate) struct Losses(BTreeMap<String, u64>);

impl Losses {
    pub fn note(&mut self, table: &CommunityTable) {
        for client in &table.clients {
            let known = self.0.entry(client.name.clone()).or_default();
            *known = client.dropped.max(*known);
        }
    }

    /// Of all clients.
    pub fn total(&self) -> u64 {
        self.0.values().sum()
    }
}
