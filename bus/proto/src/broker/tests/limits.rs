//! Bounds of a broker that few come near, each by itself: of names, pairs, sessions, and of what is remembered.

use super::*;

/// What one client brings leaves room for others.
#[test]
fn one_client_brings_only_so_many_names() {
    let b = &mut bounded(|limits| limits.names_of_a_client = 5);
    let (mut a, mut c) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"));
    // Its own name, under which it writes, is one of them.
    (0..10).for_each(|i| a.text(b, 0.0, &format!("K{i}"), "1"));
    assert_eq!(a.hear(b, 0.0).2, ["this client has brought 5 names already, and no more are allowed"; 6]);
    c.text(b, 0.0, "L", "1");
    a.text(b, 0.0, "L", "2");
    a.text(b, 0.0, "K0", "2");
    assert_eq!((a.hear(b, 0.0).2, c.hear(b, 0.0).2), (vec![], vec![]), "what is there is anybody's to write");
}

#[test]
fn pairs_of_variable_and_source_are_bounded() {
    let b = &mut bounded(|limits| limits.routes = 10);
    let mut a = Speaker::new(b, 0.0, "a");
    (0..20).for_each(|i| a.text(b, 0.0, &format!("K{i}"), "1"));
    let refused = a.hear(b, 0.0).2;
    assert!(b.variables.routes <= 10 && refused.len() >= 10, "{} pairs, {refused:?}", b.variables.routes);
    assert!(refused.iter().all(|reason| reason.contains("pairs of variable and source already")), "{refused:?}");
    a.text(b, 0.0, "K0", "2");
    assert_eq!(a.hear(b, 0.0).2, [""; 0]);
}

#[test]
fn a_session_is_kept_for_a_day_at_most() {
    let forever = [f64::INFINITY, f64::NAN, -5.0].map(|asked| (asked, 0.0));
    for (asked, kept) in forever.into_iter().chain([(1e300, 86_400.0), (15.0, 15.0)]) {
        let b = &mut broker();
        let id = b.connect(0.0, &Introduction { lease_secs: asked, ..Introduction::new("c") }).unwrap();
        assert_eq!(b.sessions.clients[&id].lease_secs, kept, "{asked}");
    }
}

/// A refusal is no longer for the name that it is about, and is still a text.
#[test]
fn what_is_too_long_is_refused_under_its_beginning() {
    let b = &mut broker();
    let mut a = Speaker::new(b, 0.0, "a");
    a.text(b, 0.0, &format!("x{}", "é".repeat(1000)), "1");
    let mut batch = Vec::new();
    b.take_mail(a.id, usize::MAX, &mut batch, |_, _| {});
    let refused = frames(&batch).map(Result::unwrap).find(|frame| frame.header.kind == FrameKind::Refused).unwrap();
    assert_eq!(refused.aux.len(), 255);
    assert!(std::str::from_utf8(refused.aux).is_ok());
}

#[test]
fn a_client_s_name_has_a_length() {
    let b = &mut broker();
    let name = "é".repeat(65);
    assert_eq!(b.connect(0.0, &Introduction::new(&name)), Err(AdmissionError::BadName(name.clone())));
    assert!(b.connect(0.0, &Introduction::new(&name[2..])).is_ok());
}

/// Mail that a client was given is kept until it has handled it: as much as its mailbox holds, and no more is given.
#[test]
fn whoever_handles_nothing_is_given_only_so_much() {
    let b = &mut Broker::new(BrokerConfig { mailbox_bytes: 10_000, ..BrokerConfig::new("test") }, 0.0);
    let (mut a, c) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"));
    c.register(b, 0.0, "X", "*", 0.0);
    let mut given = 0;
    for _ in 0..100 {
        a.text(b, 0.0, "X", &"x".repeat(1000));
        if b.may_give(c.id) {
            let mut batch = Vec::new();
            b.take_mail(c.id, usize::MAX, &mut batch, |_, _| {});
            given += batch.len();
            b.keep_given(c.id, batch);
        }
    }
    assert!((10_000..12_000).contains(&given), "{given} bytes");
    b.note_handled(0.0, c.id, 100, &mut Vec::new());
    assert!(b.may_give(c.id), "it has read on");
}

#[test]
fn batches_that_nobody_handles_are_remembered_up_to_a_number() {
    let b = &mut broker();
    let (mut a, c) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"));
    c.register(b, 0.0, "X", "*", 0.0);
    (0..5000).for_each(|_| a.text(b, 0.0, "X", "1"));
    assert_eq!(b.sessions.clients[&a.id].unhandled.len(), 4096);
}

/// Of which versions of types readers were told is forgotten when there are too many: then somebody is told again.
#[test]
fn who_was_told_of_which_type_is_remembered_up_to_a_number() {
    let b = &mut broker();
    assert!((0..1 << 14).all(|type_| b.variables.note_compared(0, 1, type_)));
    assert!(b.variables.note_compared(0, 1, 0) && !b.variables.note_compared(0, 1, 0));
}
