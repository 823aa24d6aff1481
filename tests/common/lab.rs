//! A community of its own, and somebody who listens to all of it.

use std::process::Child;
use std::time::Duration;

use elk_bus::broker::table::{ClientEntry, CommunityTable, REQUEST, TABLE};
use elk_bus::{Client, Community, Mail, Value};
use rustix::process::Signal;

use super::{Elk, kill, wait_until};

/// A broker, and a client of it.
pub struct Lab {
    db: Db,
    pub listener: Client,
}

impl Lab {
    /// With a listener that hears everything.
    pub fn new(elk: &Elk) -> Self {
        let mut lab = Self::deaf(elk);
        lab.listener.comms.register_lossless("*", "*").unwrap();
        lab.listener.comms.flush().unwrap();
        lab
    }

    /// With a listener that is registered for nothing.
    pub fn deaf(elk: &Elk) -> Self {
        let db = elk.command(&["db", "--community", elk.community()]).spawn().unwrap();
        let name = Community::new(elk.community()).unwrap();
        let mut joined = None;
        wait_until(Duration::from_secs(30), "a broker", || {
            joined = Client::connect(&name, "listener").ok();
            joined.is_some()
        });
        Self { db: Db(db), listener: joined.unwrap() }
    }

    /// Waits until the client of this name is registered for something.
    pub fn wait_for_reader(&mut self, name: &str) {
        let reads = |client: &ClientEntry| client.name == name && !client.registrations.is_empty();
        wait_until(Duration::from_secs(30), name, || table(&mut self.listener).clients.iter().any(reads));
    }

    /// All messages of others than the broker and the listener, until `count` have come.
    pub fn hear(&mut self, count: usize) -> Vec<(String, String, Value)> {
        let mut heard = Vec::new();
        wait_until(Duration::from_secs(30), "what is played", || {
            self.listen(Duration::from_millis(10), &mut heard);
            heard.len() >= count
        });
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
        let Self { mut db, listener } = self;
        // A broker that ends waits for those who do not look.
        drop(listener);
        kill(db.0.id() as i32, Signal::TERM);
        assert!(db.0.wait().unwrap().success());
    }
}

/// Who is there, after all that this client has said was taken in.
pub fn table(client: &mut Client) -> CommunityTable {
    client.comms.notify(REQUEST, 1.0).unwrap();
    let mut answer = None;
    wait_until(Duration::from_secs(30), "the broker's answer", || {
        let note = |mail: &Mail<'_>| answer = mail.is(&TABLE).then(|| mail.decode(&TABLE).unwrap()).or(answer.take());
        client.receive(Duration::from_millis(10), note).unwrap();
        answer.is_some()
    });
    answer.unwrap()
}

/// A broker. Killed, should the test fail before its end.
struct Db(Child);

impl Drop for Db {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}
