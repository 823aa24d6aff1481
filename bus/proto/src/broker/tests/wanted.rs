//! Who asks whether anybody listens is told, and told anew when that changes.

use super::*;

const ASKED: &str = "DB_WANTED/DRAWING/a/";

/// What a client was told of it since the last call.
fn told(client: &mut Speaker, broker: &mut Broker) -> Vec<f64> {
    let (heard, ..) = client.hear(broker, 0.0);
    let answers = heard.into_iter().filter(|heard| heard.key == ASKED);
    answers.map(|heard| f64::from_le_bytes(heard.value.try_into().unwrap())).collect()
}

fn unregister(client: &Speaker, broker: &mut Broker, key: &str) {
    client.registration(broker, 0.0, FrameKind::Unregister, key, "*", 0.0, 0);
}

#[test]
fn it_is_said_at_once_and_whenever_it_changes() {
    let b = &mut broker();
    let (mut a, c, d) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"), Speaker::new(b, 0.0, "d"));
    a.register(b, 0.0, ASKED, "*", 0.0);
    assert_eq!(told(&mut a, b), [0.0]);
    c.register(b, 0.0, "DRAWING/b/*", "*", 0.0);
    a.register(b, 0.0, "DRAWING/*", "*", 0.0);
    assert!(told(&mut a, b).is_empty(), "neither who listens to others, nor the one who asks");
    c.register(b, 0.0, "DRAWING/*", "*", 0.0);
    assert_eq!(told(&mut a, b), [1.0]);
    d.register(b, 0.0, "*", "*", 0.0);
    unregister(&c, b, "DRAWING/*");
    assert!(told(&mut a, b).is_empty(), "somebody still listens");
    b.disconnect(0.0, d.id, 0, true);
    assert_eq!(told(&mut a, b), [0.0]);
    c.register(b, 0.0, "DRAWING/a/field", "*", 0.0);
    assert_eq!(told(&mut a, b), [1.0]);
}

#[test]
fn who_listens_to_others_alone_does_not_listen() {
    let b = &mut broker();
    let (mut a, c) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"));
    c.register(b, 0.0, "*", "e*", 0.0);
    a.register(b, 0.0, ASKED, "*", 0.0);
    assert_eq!(told(&mut a, b), [0.0]);
    c.register(b, 0.0, "*_FIELD", "a", 0.0);
    assert_eq!(told(&mut a, b), [1.0], "DRAWING/a/_FIELD may yet come");
}

#[test]
fn a_session_that_is_kept_listens_until_it_is_let_go() {
    let b = &mut broker();
    let mut a = Speaker::new(b, 0.0, "a");
    let c = Speaker::with(b.connect(0.0, &leased("c", 5.0)).unwrap());
    c.register(b, 0.0, "DRAWING/*", "*", 0.0);
    a.register(b, 0.0, ASKED, "*", 0.0);
    assert_eq!(told(&mut a, b), [1.0]);
    b.disconnect(1.0, c.id, 0, false);
    assert!(told(&mut a, b).is_empty());
    b.tick(7.0);
    assert_eq!(told(&mut a, b), [0.0]);
}

#[test]
fn who_comes_to_ask_later_is_told_what_holds_then() {
    let b = &mut broker();
    let (mut a, c) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"));
    a.register(b, 0.0, ASKED, "*", 0.0);
    assert_eq!(told(&mut a, b), [0.0]);
    unregister(&a, b, ASKED);
    c.register(b, 0.0, "*", "*", 0.0);
    assert!(told(&mut a, b).is_empty());
    a.register(b, 0.0, ASKED, "*", 0.0);
    assert_eq!(told(&mut a, b), [1.0]);
}

#[test]
fn no_number_of_questions_fills_the_memory() {
    let b = &mut broker();
    let a = Speaker::new(b, 0.0, "a");
    (0..1000).for_each(|i| a.register(b, 0.0, &format!("DB_WANTED/{i}/"), "*", 0.0));
    assert_eq!(b.answers.len(), 64);
    (0..1000).for_each(|i| unregister(&a, b, &format!("DB_WANTED/{i}/")));
    assert!(b.answers.is_empty());
}
