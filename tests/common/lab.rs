//! A community of its own, and somebody who listens to all of it.

use std::time::Duration;

use elk_bus::broker::table::{ClientEntry, CommunityTable, REQUEST, TABLE};
use elk_bus::{Client, Community, Mail, Value, any, text};

use super::Elk;
use super::events::{Events, Patience, folders_of};
use super::running::Running;

/// A broker, and a client of it.
pub struct Lab {
    db: Running,
    pub listener: Client,
}

impl Lab {
    /// With a listener that hears everything.
    pub fn new(elk: &Elk) -> Self {
        let mut lab = Self::deaf(elk);
        lab.listener.comms.register(any("*").lossless()).unwrap();
        lab.listener.comms.flush().unwrap();
        lab
    }

    /// With a listener that is registered for nothing.
    pub fn deaf(elk: &Elk) -> Self {
        Self { db: broker(elk), listener: elk.join("listener") }
    }

    /// Kills the broker and starts another: whoever was there comes back by itself, the listener too. Under its name nobody
    /// else is let in, as long as the process that it was in lives.
    pub fn with_next_broker(self, elk: &Elk) -> Self {
        let Self { db, listener } = self;
        drop(db);
        Self { db: broker(elk), listener }
    }

    /// Waits until the client of this name is registered for something.
    pub fn wait_for_reader(&mut self, name: &str) {
        wait_for_reader(&mut self.listener, |client| client == name);
    }

    /// All messages of others than the broker and the listener, until `count` have come.
    pub fn hear(&mut self, count: usize) -> Vec<(String, String, Value)> {
        let (mut heard, patience) = (Vec::new(), Patience::new());
        while heard.len() < count {
            self.listen(patience.left("what is played"), &mut heard);
        }
        heard
    }

    /// All messages that have come by now.
    pub fn hear_rest(&mut self) -> Vec<(String, String, Value)> {
        let mut heard = Vec::new();
        while self.listen(Duration::ZERO, &mut heard) > 0 {}
        heard
    }

    fn listen(&mut self, timeout: Duration, heard: &mut Vec<(String, String, Value)>) -> usize {
        let note = |mail: &Mail<'_>| {
            if !mail.source().starts_with("MOOSDB") {
                heard.push((mail.key().into(), mail.source().into(), mail.value().to_value()));
            }
        };
        self.listener.receive(timeout, note).unwrap()
    }

    pub fn end(self) {
        let Self { db, listener } = self;
        // A broker that ends waits for those who do not look.
        drop(listener);
        db.stop();
    }
}

fn broker(elk: &Elk) -> Running {
    Running(elk.command(&["db", "--community", elk.community()]).spawn().unwrap())
}

/// Who is there, after all that this client has said was taken in.
pub fn table(client: &mut Client) -> CommunityTable {
    client.comms.notify(REQUEST, 1.0).unwrap();
    hear(client, "the broker's answer", |mail| mail.is(&TABLE).then(|| mail.decode(&TABLE).unwrap()))
}

/// Hears mail until `wanted` makes something of a message; of several that come at once, of the first.
pub fn hear<T>(client: &mut Client, what: &str, mut wanted: impl FnMut(&Mail<'_>) -> Option<T>) -> T {
    let (mut found, patience) = (None, Patience::new());
    loop {
        let note = |mail: &Mail<'_>| {
            let this = wanted(mail);
            found = found.take().or(this);
        };
        client.receive(patience.left(what), note).unwrap();
        if let Some(found) = found {
            return found;
        }
    }
}

/// Waits until a client whose name is right is registered for something: the broker notes that in a file.
pub fn wait_for_reader(witness: &mut Client, is_right: impl Fn(&str) -> bool) {
    let community = Community::new(witness.comms.community()).unwrap();
    let reads = |client: &ClientEntry| is_right(&client.name) && !client.registrations.is_empty();
    let events = Events::in_folders(folders_of(&community));
    events.wait_until("a reader", || table(witness).clients.iter().any(reads));
}

/// Waits until the right clients are there.
pub fn wait_for_clients(elk: &Elk, what: &str, are_right: impl Fn(&[&str]) -> bool) {
    let mut witness = elk.join("witness");
    witness.comms.register(text("DB_CLIENTS")).unwrap();
    hear(&mut witness, what, |mail| {
        let clients: Vec<&str> = mail.as_text()?.split(',').collect();
        are_right(&clients).then_some(())
    });
}

/// Waits until the community's time, as a client hears of it, is right.
pub fn wait_for_time(client: &mut Client, is_right: impl Fn(f64) -> bool) {
    let patience = Patience::new();
    while !is_right(client.comms.time()) {
        client.receive(patience.left("the community's time"), |_| {}).unwrap();
    }
}
