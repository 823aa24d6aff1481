//! What the community remembers of an app: its memory is a variable like any other.
//!
//! An app that has to go on where its predecessor stopped publishes what a successor needs, and asks for it when it
//! starts, before anything else. The broker gives latest values in the order in which they were asked for, and mail that
//! the predecessor had not handled after them, so memory comes before work. What was never published is not answered at
//! all: once the first message comes that is not memory, there is no more of it. For an app that would otherwise have to
//! wait for work, the broker always has one such message: the mark.

use crate::comms::{Comms, CommsError};
use crate::key::{Key, Payload};
use crate::mail::Mail;

/// A variable that always has a value, since the broker writes it for every client that it lets in.
const MARK: &str = "DB_CLIENTS";

/// An app's recollection. Ask for each variable of its memory, then for the mark, first of all when the app starts.
#[derive(Debug, Default)]
pub struct Recall {
    /// What was asked for and is not given up yet.
    keys: Vec<String>,
}

impl Recall {
    /// Asks for the latest value of a variable, if it has one.
    pub fn ask<T: Payload>(&mut self, comms: &mut Comms, key: &Key<T>) -> Result<(), CommsError> {
        comms.register(key)?;
        self.keys.push(key.name().to_owned());
        Ok(())
    }

    /// Asks for the mark.
    pub fn ask_for_mark(comms: &mut Comms) -> Result<(), CommsError> {
        comms.register_variable(MARK, 0.0)
    }

    /// Whether this message ends the recollection: it is the first that is not memory, and all memory is here. Ask this of
    /// every message, before anything is done with it. From then on what the app publishes does not come back to it.
    pub fn ends_with(&mut self, comms: &mut Comms, mail: &Mail<'_>) -> Result<bool, CommsError> {
        if self.keys.is_empty() || self.keys.iter().any(|key| key == mail.key()) {
            return Ok(false);
        }
        std::mem::take(&mut self.keys).iter().try_for_each(|key| comms.unregister(key, "*"))?;
        comms.unregister(MARK, "*")?;
        Ok(true)
    }

    /// Whether this message is the mark.
    pub fn is_mark(mail: &Mail<'_>) -> bool {
        mail.key() == MARK
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::memory::MemoryBroker;
    use crate::{BrokerConfig, Client, Clock, Community};

    /// What an app was about.
    #[crate::payload]
    #[derive(Debug, PartialEq)]
    pub struct Errand {
        /// How far it was.
        pub steps: u64,
    }

    const ERRAND: Key<Errand> = Key::new("ERRAND");
    const PAY: Key<Errand> = Key::new("PAY");

    /// An app that recalls two variables and works on a third.
    struct Worker {
        client: Client,
        recall: Recall,
    }

    impl Worker {
        fn new(broker: &MemoryBroker) -> Self {
            let community = Community::new("recall").unwrap();
            let mut client = Client::over(broker.connect("worker").unwrap(), "worker", &community);
            let mut recall = Recall::default();
            recall.ask(&mut client.comms, &ERRAND).unwrap();
            recall.ask(&mut client.comms, &PAY).unwrap();
            Recall::ask_for_mark(&mut client.comms).unwrap();
            client.comms.register_variable("WORK", 0.0).unwrap();
            Self { client, recall }
        }

        /// What it hears, each with whether the recollection ended with it; the mark once, whatever it was written for.
        fn heard(&mut self) -> Vec<(String, bool)> {
            let mut heard = Vec::new();
            let (comms, inbox) = (&mut self.client.comms, &mut self.client.inbox);
            let note = |comms: &mut Comms, mail: &Mail<'_>| {
                heard.push((mail.key().to_owned(), self.recall.ends_with(comms, mail)?));
                Ok::<(), CommsError>(())
            };
            inbox.receive(comms, Duration::ZERO, note).unwrap();
            comms.flush().unwrap();
            heard.retain(|(key, ends)| key != MARK || *ends);
            heard
        }

        fn say(&mut self) {
            self.client.comms.notify("WORK", 1.0).unwrap();
            self.client.comms.publish(&ERRAND, &Errand { steps: 3 }).unwrap();
            self.client.comms.flush().unwrap();
        }
    }

    fn words(words: &[(&str, bool)]) -> Vec<(String, bool)> {
        words.iter().map(|(key, ends)| ((*key).to_owned(), *ends)).collect()
    }

    #[test]
    fn memory_comes_before_work_and_does_not_come_back() {
        let broker = MemoryBroker::new(BrokerConfig::new("recall"), Clock::new(1.0));
        let mut first = Worker::new(&broker);
        assert_eq!(first.heard(), words(&[(MARK, true)]), "nobody was here before");
        first.say();
        assert_eq!(first.heard(), words(&[("WORK", false)]));
        drop(first);
        let mut second = Worker::new(&broker);
        assert_eq!(second.heard(), words(&[("ERRAND", false), (MARK, true), ("WORK", false)]));
        second.say();
        assert_eq!(second.heard(), words(&[("WORK", false)]));
    }
}
