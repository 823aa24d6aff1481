//! A community that runs, to the clients. It is a client of the bus like any other, registered for what they want alone.

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use elk_bus::broker::table::{CommunityTable, REQUEST, TABLE};
use elk_bus::clock::Stopwatch;
use elk_bus::{Client, CommsError, Community, any};
use elk_log::Reception;
use elk_spatial::keys::MAP_REQUEST;

use super::hub::Hub;
use crate::community;

/// How often the broker's table is asked for.
const TABLE_EVERY: Duration = Duration::from_secs(1);
/// How often clients are told the time, and the longest sleep without a look at what they want.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// Follows a community until `stop` is set, also through its end and the next one of its name.
pub(super) fn follow(community: &Community, hub: &Hub, stop: &AtomicBool) {
    let listen = |client: Client| {
        hub.joined();
        Following { client, hub, heard: BTreeSet::new(), reception: Reception::begun(f64::NEG_INFINITY) }.run(stop)
    };
    community::follow(community, "foxglove", stop, listen, |why| hub.left(why));
}

/// A client that listens.
struct Following<'a> {
    client: Client,
    hub: &'a Hub,
    /// What it is registered for.
    heard: BTreeSet<String>,
    reception: Reception,
}

impl Following<'_> {
    /// Listens until `stop` is set or the community ends.
    fn run(mut self, stop: &AtomicBool) -> Result<(), CommsError> {
        let mut asked: Option<Stopwatch> = None;
        let mut told = Stopwatch::start();
        while !stop.load(Ordering::Relaxed) {
            self.register_wanted()?;
            // Nobody pays for a table that nobody looks at; who comes has it at once.
            let is_due = asked.as_ref().is_none_or(|asked| asked.elapsed() >= TABLE_EVERY);
            if is_due && self.hub.is_watched() {
                self.client.comms.notify(REQUEST, "")?;
                self.client.comms.flush()?;
                asked = Some(Stopwatch::start());
            }
            if let Some(table) = self.listen()? {
                self.hub.table(&table);
            }
            if told.elapsed() >= LOOK_EVERY {
                self.hub.time(self.client.comms.time());
                told = Stopwatch::start();
            }
        }
        Ok(())
    }

    /// Hears what has come; the broker's table, if that has come.
    fn listen(&mut self) -> Result<Option<CommunityTable>, CommsError> {
        let (hub, reception, mut table) = (self.hub, &mut self.reception, None);
        let (epoch, clock) = (self.client.comms.epoch(), self.client.comms.clock());
        self.client.receive(LOOK_EVERY, |mail| {
            if mail.is(&TABLE) {
                table = mail.decode(&TABLE).ok();
                return;
            }
            hub.hear(&reception.record(mail, epoch, clock.now()));
        })?;
        Ok(table)
    }

    /// Registers for what clients want now, and no longer for what they do not.
    fn register_wanted(&mut self) -> Result<(), CommsError> {
        let wanted = self.hub.wanted();
        if self.hub.take_map_is_wanted() {
            self.client.comms.notify(MAP_REQUEST, 0.0)?;
        }
        for key in self.heard.difference(&wanted) {
            self.client.comms.unregister(any(key))?;
            self.hub.unheard(key);
        }
        for key in wanted.difference(&self.heard) {
            self.client.comms.register(any(key))?;
        }
        self.heard = wanted;
        self.client.comms.flush()
    }
}
