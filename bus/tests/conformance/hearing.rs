//! Waiting for mail.

use std::time::Duration;

use elk_bus::{Client, Value};

use crate::common::events::Patience;
use crate::count::Count;

/// How long a client that waits for more than mail (a sign that it is to retire, the news that something was dropped) looks
/// for mail before it looks for that.
pub const MOMENT: Duration = Duration::from_millis(100);

/// What was heard: (key, source, value, whether it was a latest value).
pub type Heard = (String, String, Value, bool);

pub fn hear(client: &mut Client, enough: impl Fn(&[Heard]) -> bool) -> Vec<Heard> {
    let (mut heard, patience) = (Vec::new(), Patience::new());
    while !enough(&heard) {
        let left = patience.left(format_args!("more than {} messages", heard.len()));
        client
            .receive(left, |m| heard.push((m.key().into(), m.source().into(), m.value().to_value(), m.is_latest())))
            .unwrap();
    }
    heard
}

/// Waits until the broker has done all that `client` asked of it so far.
pub fn settle(client: &mut Client) {
    let mark = format!("MARK_{}", client.comms.name());
    client.comms.register(&mark).unwrap();
    client.comms.notify(&mark, "done").unwrap();
    hear(client, |h| h.iter().any(|(k, ..)| *k == mark));
}

/// Hears numbers until it is to retire, or has heard the last one.
pub fn count_until_retired(client: &mut Client, counted: &Count, last: u64) {
    let patience = Patience::new();
    while !client.inbox.retiring() && counted.get() < last {
        patience.left(format_args!("{last} numbers: {} came", counted.get()));
        client
            .receive(MOMENT, |m| {
                if m.is_latest() {
                    return; // the holder before this one has heard it
                }
                assert_eq!(m.as_double(), Some(counted.add() as f64), "in order, nothing lost, nothing twice");
            })
            .unwrap();
    }
}
