//! Messages for logs.

use elk_bus::Value;
use elk_log::Record;

/// The message of this number, said at as many seconds.
pub fn record(number: u64, key: &str, value: Value) -> Record {
    Record {
        key: key.into(),
        source: "app".into(),
        source_aux: String::new(),
        community: "elk".into(),
        time: number as f64,
        sequence: number,
        received: number as f64,
        order: number,
        epoch: 1,
        value,
    }
}
