//! What the broker says of the community: the table and the `DB_*` variables.

use std::collections::BTreeSet;

use super::*;
use crate::broker::table::{CommunityTable, LatestValue, REQUEST, RouteEntry, TABLE, VariableKind};
use crate::codec;
use crate::wire::BULK;

#[test]
fn the_db_variables_are_there() {
    let b = &mut broker();
    let mut c = Speaker::new(b, 0.0, "c");
    c.register(b, 0.0, "DB_*", "*", 0.0);
    b.tick(0.0);
    let keys: BTreeSet<String> = c.hear(b, 0.0).0.into_iter().map(|h| h.key).collect();
    for key in ["DB_CLIENTS", "DB_EVENT", "DB_TIME", "DB_UPTIME", "DB_QOS", "DB_RWSUMMARY", "DB_VARSUMMARY", "DB_DROPS"]
    {
        assert!(keys.contains(key), "{key} is missing from {keys:?}");
    }
}

/// Asks for the table as `of` and reads the answer.
fn table_for(b: &mut Broker, now: f64, of: &mut Speaker) -> CommunityTable {
    of.text(b, now, REQUEST, "");
    let heard = of.hear(b, now).0.into_iter().find(|heard| heard.key == TABLE.name()).unwrap();
    codec::decode_owned(&heard.value, "CommunityTable").unwrap()
}

#[test]
fn the_table_says_who_is_there_and_what_was_said_to_whom() {
    let b = &mut Broker::new(BrokerConfig::new("test"), 1.0);
    let (mut a, mut c) = (Speaker::new(b, 1.0, "a"), Speaker::new(b, 1.0, "c"));
    c.register(b, 1.0, "X*", "*", 0.5);
    a.say(b, 2.0, "X1", ValueKind::Double, &7.0_f64.to_le_bytes());
    a.text(b, 3.0, "Y", &"y".repeat(3000));
    a.text(b, 3.5, "Y", "last");
    b.tick(4.0);
    let table = table_for(b, 4.0, &mut c);
    assert_eq!((table.community.as_str(), table.started, table.time), ("test", 1.0, 4.0));
    let names: Vec<&str> = table.clients.iter().map(|client| client.name.as_str()).collect();
    assert_eq!(names, ["a", "c"]);
    assert_eq!(
        (table.clients[0].writes.as_slice(), table.clients[0].messages),
        (&["X1".to_owned(), "Y".to_owned()][..], 3)
    );
    let registration = &table.clients[1].registrations[0];
    assert_eq!((registration.key_pattern.as_str(), registration.min_interval_secs), ("X*", 0.5));
    let find = |name: &str| table.variables.iter().find(|v| v.name == name).unwrap();
    let (x, y) = (find("X1"), find("Y"));
    assert_eq!((&x.kind, &x.latest, x.messages, x.bytes), (&VariableKind::Number, &LatestValue::Number(7.0), 1, 8));
    assert_eq!(x.routes, [RouteEntry { source: "a".into(), readers: vec!["c".into()] }]);
    assert_eq!((y.messages, y.bytes, y.latest_bytes, y.written, y.rate_hz), (2, 3004, 4, 3.5, 1.0));
    assert_eq!((y.writer.as_str(), &y.latest), ("a", &LatestValue::Text("last".into())));
    assert!(y.routes[0].readers.is_empty());
    assert!(table.variables.iter().all(|v| !v.name.starts_with("DB_TABLE")), "a question is no variable");
}

#[test]
fn the_table_goes_to_who_asked_alone_and_comes_after_what_was_refused_before() {
    let b = &mut broker();
    let (mut a, mut c) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"));
    c.register(b, 0.0, "*", "*", 0.0);
    c.hear(b, 0.0);
    a.text(b, 0.0, "X", "text");
    a.say(b, 0.0, "X", ValueKind::Double, &1.0_f64.to_le_bytes());
    a.text(b, 0.0, REQUEST, "");
    let (heard, _, refused) = a.hear(b, 0.0);
    assert_eq!((heard.len(), refused.len()), (1, 1));
    assert_eq!(c.texts(b, 0.0), ["text"], "a registrant of everything hears neither question nor answer");
}

#[test]
fn a_value_in_shared_memory_counts_with_its_length_and_stays_out_of_the_table() {
    let b = &mut broker();
    let mut a = Speaker::new(b, 0.0, "a");
    let mut batch = Vec::new();
    put_definition(&mut batch, Named::Key, 0, "SCAN", 0, "");
    put_definition(&mut batch, Named::Type, 0, "Scan", 5, "");
    let reference = wire::BulkRef { client: a.id, generation: 1, sample: 1, len: 123_456 };
    let header = Header { flags: BULK, value_kind: ValueKind::Binary, sequence: 1, ..Header::new(FrameKind::Notify) };
    put(&mut batch, &header, &[], &reference.to_bytes());
    b.receive(0.0, a.id, &batch).unwrap();
    a.keys.push("SCAN".into());
    let table = table_for(b, 0.0, &mut a);
    let scan = table.variables.iter().find(|v| v.name == "SCAN").unwrap();
    assert_eq!(scan.kind, VariableKind::Typed { name: "Scan".into(), layout: 5 });
    assert_eq!((&scan.latest, scan.bytes, scan.latest_bytes), (&LatestValue::Long, 123_456, 123_456));
}
