//! What the community remembers of an app: its memory is a variable like any other.
//!
//! An app that has to go on where its predecessor stopped publishes what a successor needs, and asks for it when it
//! starts. The broker answers in order, so an app that first of all recalls its memory, and only then registers for
//! what it works on, has its memory before its work. What was never published is not answered at all; the mark behind
//! all answers ([`Mail::is_end_of_recall`]) tells that nothing more will come: there was no predecessor.

use crate::comms::{Comms, CommsError};
use crate::key::{Key, Payload};
use crate::mail::Mail;

/// A variable that always has a value, since the broker writes it for every client that it lets in: its answer is the mark.
const MARK: &str = "DB_CLIENTS";

impl Comms {
    /// Asks for the latest value of a variable, if it has one, and for no value after it.
    pub fn recall<T: Payload>(&mut self, key: &Key<T>) -> Result<(), CommsError> {
        self.recall_variable(key.name())
    }

    /// Asks for the mark behind all that was recalled, and registered for, before.
    pub fn end_recall(&mut self) -> Result<(), CommsError> {
        self.recall_variable(MARK)
    }

    fn recall_variable(&mut self, key: &str) -> Result<(), CommsError> {
        self.note_recall(key);
        self.register_variable(key, 0.0)?;
        self.unregister(key, "*")
    }
}

impl Mail<'_> {
    /// Whether it is the mark that [`Comms::end_recall`] asked for.
    pub fn is_end_of_recall(&self) -> bool {
        self.is_latest() && self.key() == MARK
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use crate::memory::MemoryBroker;
    use crate::{BrokerConfig, Client, Clock, Community, Key};

    crate::payload! {
        /// What an app was about.
        #[derive(Debug, PartialEq)]
        pub struct Errand {
            /// How far it was.
            pub steps: u64,
        }
    }

    const ERRAND: Key<Errand> = Key::new("ERRAND");

    fn join(broker: &MemoryBroker, name: &str) -> Client {
        Client::over(broker.connect(name).unwrap(), name, &Community::new("recall").unwrap())
    }

    fn recall(client: &mut Client) -> Vec<String> {
        client.comms.recall(&ERRAND).unwrap();
        client.comms.register_variable("WORK", 0.0).unwrap();
        client.comms.end_recall().unwrap();
        heard(client)
    }

    fn heard(client: &mut Client) -> Vec<String> {
        let mut heard = Vec::new();
        let note = |mail: &crate::Mail<'_>| {
            heard.push(if mail.is_end_of_recall() { "end".into() } else { mail.key().to_owned() });
        };
        client.receive(Duration::ZERO, note).unwrap();
        heard
    }

    #[test]
    fn memory_comes_before_work_then_the_mark_and_nothing_after_it() {
        let broker = MemoryBroker::new(BrokerConfig::new("recall"), Clock::new(1.0));
        let mut first = join(&broker, "first");
        assert_eq!(recall(&mut first), ["end"], "nobody was here before");
        first.comms.notify("WORK", 1.0).unwrap();
        first.comms.publish(&ERRAND, &Errand { steps: 3 }).unwrap();
        assert_eq!(heard(&mut first), ["WORK"], "its own memory does not come back to it");
        drop(first);
        let mut second = join(&broker, "first");
        assert_eq!(recall(&mut second), ["ERRAND", "WORK", "end"]);
        let _third = join(&broker, "third");
        assert!(heard(&mut second).is_empty(), "the mark is asked for once");
    }
}
