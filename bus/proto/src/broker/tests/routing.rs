//! What is said reaches who asked for it, and only them.

use super::*;

#[test]
fn a_message_reaches_who_registered_and_only_them() {
    let b = &mut broker();
    let (mut a, mut c, mut d) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"), Speaker::new(b, 0.0, "d"));
    c.register(b, 0.0, "X", "*", 0.0);
    a.text(b, 0.0, "X", "1");
    let (heard, ..) = c.hear(b, 0.0);
    assert_eq!(heard, [Heard { key: "X".into(), source: "a".into(), value: b"1".into(), latest: false }]);
    assert!(d.hear(b, 0.0).0.is_empty());
}

#[test]
fn a_late_registrant_is_given_the_latest_value_once() {
    let b = &mut broker();
    let (mut a, mut c) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"));
    a.text(b, 0.0, "X", "old");
    a.text(b, 0.0, "X", "new");
    c.register(b, 0.0, "X", "*", 0.0);
    c.register(b, 0.0, "*", "a", 0.0);
    let (heard, ..) = c.hear(b, 0.0);
    assert_eq!(heard, [Heard { key: "X".into(), source: "a".into(), value: b"new".into(), latest: true }]);
}

#[test]
fn a_wildcard_matches_every_pair_of_variable_and_source_whenever_it_first_appears() {
    let b = &mut broker();
    let (mut a, mut c, mut d) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"), Speaker::new(b, 0.0, "d"));
    c.register(b, 0.0, "NAV_*", "d", 0.0);
    a.text(b, 0.0, "NAV_X", "from a");
    d.text(b, 0.0, "NAV_X", "from d");
    d.text(b, 0.0, "OTHER", "from d");
    assert_eq!(c.texts(b, 0.0), ["from d"], "MOOS tests a variable against its first writer only");
}

#[test]
fn a_throttled_registration_delivers_the_last_value_of_a_burst() {
    let b = &mut broker();
    let (mut a, mut c) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"));
    c.register(b, 0.0, "X", "*", 0.5);
    for i in 0..12 {
        let now = 1.0 + 0.1 * f64::from(i);
        b.tick(now);
        a.text(b, now, "X", &i.to_string());
    }
    assert!((b.next_deadline() - 2.0).abs() < 0.6, "{}", b.next_deadline());
    b.tick(1.6 + 1.0);
    assert_eq!(c.texts(b, 2.6), ["0", "4", "9", "11"], "every 0.5 s, and the last one");
    b.tick(9.0);
    assert!(c.texts(b, 9.0).is_empty());
}

/// Regression: what waited for a long interval was forgotten with it.
#[test]
fn whoever_changes_its_interval_has_what_waited_for_the_old_one() {
    let b = &mut broker();
    let (mut a, mut c) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"));
    c.register(b, 0.0, "X", "*", 1e6);
    (0..3).for_each(|i| a.text(b, 1.0, "X", &i.to_string()));
    assert_eq!(c.texts(b, 1.0), ["0"]);
    c.register(b, 2.0, "X", "*", 0.5);
    assert_eq!(c.texts(b, 2.0), ["2"]);
    a.text(b, 2.1, "X", "3");
    assert_eq!(c.texts(b, 2.1), Vec::<String>::new(), "its interval has begun");
    c.register(b, 2.2, "X", "*", 0.0);
    a.text(b, 2.2, "X", "4");
    assert_eq!(c.texts(b, 2.2), ["3", "4"]);
    c.register(b, 2.3, "X", "*", 0.0);
    assert_eq!(c.texts(b, 9e9), Vec::<String>::new(), "nothing comes twice");
}

#[test]
fn a_variable_that_somebody_waits_for_is_one_of_the_community_s() {
    let b = &mut broker();
    let (mut a, c) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"));
    c.register(b, 0.0, "X", "*", 0.0);
    c.register(b, 0.0, "Y*", "*", 0.0);
    let found =
        |b: &Broker| b.survey().filter(|one| one.key == "X").map(|one| one.latest.is_some()).collect::<Vec<_>>();
    let read = |b: &Broker| b.reads_and_writes().find(|(name, ..)| *name == "c").unwrap().1.join(" ");
    assert_eq!((found(b), read(b).as_str()), (vec![false], "X"));
    a.text(b, 0.0, "X", "there");
    assert_eq!((found(b), read(b).as_str()), (vec![true], "X"));
    assert!(b.survey().all(|one| one.key != "Y*"), "a pattern is no variable");
}

#[test]
fn a_write_of_the_wrong_type_is_answered_to_the_writer() {
    let b = &mut broker();
    let (mut a, mut c) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"));
    c.register(b, 0.0, "X", "*", 0.0);
    a.say(b, 0.0, "X", ValueKind::Double, &1.0_f64.to_le_bytes());
    a.text(b, 0.0, "X", "two");
    assert_eq!(a.hear(b, 0.0).2, ["X carries numbers since its first write; texts was refused"]);
    assert_eq!(c.hear(b, 0.0).0.len(), 1);
}

#[test]
fn a_name_is_unique_and_free_when_its_holder_is_gone() {
    let b = &mut broker();
    let a = Speaker::new(b, 0.0, "a");
    assert_eq!(b.connect(0.0, &Introduction::new("a")), Err(AdmissionError::NameTaken("a".into())));
    for bad in ["", "a,b", "a*", "a\n"] {
        assert_eq!(b.connect(0.0, &Introduction::new(bad)), Err(AdmissionError::BadName(bad.into())));
    }
    b.disconnect(0.0, a.id, 0, true);
    assert!(b.connect(0.0, &Introduction::new("a")).is_ok());
}

#[test]
fn what_an_app_published_outlives_it() {
    let b = &mut broker();
    let mut a = Speaker::new(b, 0.0, "a");
    a.text(b, 0.0, "X", "1");
    b.disconnect(0.0, a.id, 0, true);
    let mut c = Speaker::new(b, 0.0, "c");
    c.register(b, 0.0, "X", "*", 0.0);
    assert_eq!(c.texts(b, 0.0), ["1"]);
}

#[test]
fn unregistered_means_silence() {
    let b = &mut broker();
    let (mut a, mut c) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"));
    c.register(b, 0.0, "X*", "*", 0.0);
    a.text(b, 0.0, "X1", "1");
    c.registration(b, 0.0, FrameKind::Unregister, "X*", "*", 0.0, 0);
    a.text(b, 0.0, "X1", "2");
    a.text(b, 0.0, "X2", "3");
    assert_eq!(c.texts(b, 0.0), ["1"], "MOOS' wildcard unregister keeps the filter; ours does not");
}

#[test]
fn a_client_that_speaks_nonsense_is_an_error_not_a_panic() {
    let b = &mut broker();
    let a = Speaker::new(b, 0.0, "a");
    let mut batch = Vec::new();
    put(&mut batch, &Header::new(FrameKind::Notify), &[], &[]);
    assert!(b.receive(0.0, a.id, &batch).is_err(), "key 0 was never defined");
    let mut batch = Vec::new();
    put_definition(&mut batch, Named::Key, 7, "X", 0, "");
    assert!(b.receive(0.0, a.id, &batch).is_err(), "definitions come in order");
}

proptest! {
    #[test]
    fn any_bytes_from_a_client_leave_the_broker_standing(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let b = &mut broker();
        let a = Speaker::new(b, 0.0, "a");
        let _ = b.receive(0.0, a.id, &bytes);
        b.tick(10.0);
    }

    /// Whatever is published when, at whatever pace the throttle has: what is heard keeps the order of what was said,
    /// two messages are never closer than the interval, and the last one said is the last one heard.
    #[test]
    fn throttled_mail_is_ordered_spaced_and_complete_at_its_end(
        gaps in prop::collection::vec(0.0..0.4f64, 1..40),
        interval in 0.05..0.5f64,
    ) {
        let b = &mut broker();
        let (mut a, mut c) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"));
        c.register(b, 0.0, "X", "*", interval);
        let mut heard: Vec<(f64, usize)> = Vec::new();
        let mut listen = |b: &mut Broker, now: f64| {
            b.tick(now);
            heard.extend(c.texts(b, now).iter().map(|t| (now, t.parse::<usize>().unwrap())));
        };
        let mut now = 1.0;
        for (i, gap) in gaps.iter().enumerate() {
            let arrival = now + gap;
            while b.next_deadline() <= arrival {
                let due = b.next_deadline();
                listen(b, due);
            }
            now = arrival;
            a.text(b, now, "X", &i.to_string());
            listen(b, now);
        }
        listen(b, now + interval);
        prop_assert!(heard.windows(2).all(|w| w[0].1 < w[1].1 && w[1].0 - w[0].0 > interval - 1e-9), "{:?}", heard);
        prop_assert_eq!(heard.last().unwrap().1, gaps.len() - 1);
    }
}
