//! Mailboxes: how much they hold, who waits for whom, and when a batch is handled.

use super::*;

#[test]
fn a_full_mailbox_drops_the_oldest_and_counts() {
    let b = &mut Broker::new(BrokerConfig { mailbox_bytes: 10 * 56, ..BrokerConfig::new("test") }, 0.0);
    let (mut a, mut c) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"));
    c.register(b, 0.0, "X", "*", 0.0);
    for i in 0..100 {
        a.text(b, 0.0, "X", &i.to_string());
    }
    let (heard, dropped, _) = c.hear(b, 0.0);
    assert_eq!((heard.len(), dropped), (10, 90));
    assert_eq!((&heard[0].value[..], &heard[9].value[..]), (&b"90"[..], &b"99"[..]));
    for i in 0..11 {
        a.text(b, 0.0, "X", &i.to_string());
    }
    assert_eq!(c.hear(b, 0.0).1, 91, "the count goes on");
}

#[test]
fn a_lossless_registrant_holds_its_publishers_back_as_long_as_patience_lasts() {
    let config = BrokerConfig { mailbox_bytes: 10 * 56, lossless_patience_secs: 5.0, ..BrokerConfig::new("test") };
    let b = &mut Broker::new(config, 0.0);
    let (mut a, mut c) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"));
    c.registration(b, 0.0, FrameKind::Register, "X", "*", 0.0, LOSSLESS);
    let mut sent = 0;
    while !b.holds_back(0.0, a.id) {
        a.text(b, 0.0, "X", &sent.to_string());
        sent += 1;
    }
    assert_eq!(sent, 10);
    assert_eq!(c.texts(b, 1.0).len(), 10);
    assert!(!b.holds_back(1.0, a.id));
    for i in 0..10 {
        a.text(b, 2.0, "X", &i.to_string());
    }
    assert!(b.holds_back(2.0, a.id) && !b.holds_back(8.0, a.id), "a reader that stopped is waited for 5 s");
    a.text(b, 8.0, "X", "late");
    let (heard, dropped, _) = c.hear(b, 8.0);
    assert_eq!((heard.len(), dropped), (10, 1));
}

/// Regression: what a slow reader had been given long ago counted for nothing, and its mail was dropped.
#[test]
fn a_lossless_registrant_that_reads_slowly_is_waited_for_and_one_that_stops_is_not() {
    let config = BrokerConfig { mailbox_bytes: 10 * 56, lossless_patience_secs: 5.0, ..BrokerConfig::new("test") };
    let b = &mut Broker::new(config, 0.0);
    let (mut a, c) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"));
    c.registration(b, 0.0, FrameKind::Register, "X", "*", 0.0, LOSSLESS);
    let fill = |b: &mut Broker, a: &mut Speaker| (0..10).for_each(|i| a.text(b, 0.0, "X", &i.to_string()));
    fill(b, &mut a);
    let mut batch = Vec::new();
    b.take_mail(c.id, usize::MAX, &mut batch, |_, _| {});
    b.keep_given(c.id, batch);
    fill(b, &mut a);
    for (handled, now) in [(1, 4.0), (2, 8.0), (3, 12.0)] {
        b.note_handled(now, c.id, handled, &mut Vec::new());
        assert!(b.holds_back(now + 4.5, a.id) && b.waits_for(now + 4.5, c.id), "it reads at {now} s");
    }
    b.note_handled(16.0, c.id, 3, &mut Vec::new());
    assert!(!b.holds_back(17.5, a.id) && !b.waits_for(17.5, c.id), "it stopped at 12 s");
    assert_eq!(b.mail_done(c.id), Some(0), "what it was given is not handled for that");
}

/// What the documents say of a lossless reader that is slow for ever.
#[test]
fn who_reads_slowly_sets_the_pace_of_its_publishers_without_end_and_of_nobody_else_within_its_mailbox() {
    const LIMIT: usize = 10 * 56;
    let config = BrokerConfig { mailbox_bytes: LIMIT, lossless_patience_secs: 5.0, ..BrokerConfig::new("test") };
    let b = &mut Broker::new(config, 0.0);
    let (mut a, c, mut d) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"), Speaker::new(b, 0.0, "d"));
    c.registration(b, 0.0, FrameKind::Register, "X", "*", 0.0, LOSSLESS);
    let (mut sent, mut heard) = (0_u64, Vec::new());
    for now in (0..3600).map(f64::from) {
        while !b.holds_back(now, a.id) {
            a.text(b, now, "X", &sent.to_string());
            sent += 1;
        }
        d.text(b, now, "Y", "nobody waited for hears this");
        assert!(!b.holds_back(now, d.id));
        assert!(
            b.sessions.clients[&c.id].mailbox.waiting() < LIMIT + 56,
            "a batch of each publisher comes on top, at most"
        );
        if now % 4.0 == 0.0 {
            let mut batch = Vec::new();
            b.take_mail(c.id, 1, &mut batch, |_, _| {});
            let messages = frames(&batch).map(Result::unwrap).filter(|frame| frame.header.kind == FrameKind::Notify);
            heard.extend(messages.map(|frame| String::from_utf8(frame.value.into()).unwrap().parse::<u64>().unwrap()));
            b.keep_given(c.id, batch);
            b.note_handled(now, c.id, heard.len() as u64, &mut Vec::new());
        }
    }
    assert_eq!(heard, (0..900).collect::<Vec<u64>>(), "one in four seconds, for an hour, and none is missing");
    assert!(sent - 900 <= 11 && b.holds_back(3600.0, a.id), "{sent} were taken of who has a thousand a second to say");
    assert!(!b.holds_back(3601.5, a.id), "it reads no more");
}

#[test]
fn a_batch_is_handled_when_everybody_it_reached_has_handled_it() {
    let b = &mut broker();
    let mut a = Speaker::new(b, 0.0, "a");
    let (mut c, mut d) = (join_ready(b, 0.0, &leased("c", 0.0)), join_ready(b, 0.0, &leased("d", 5.0)));
    a.text(b, 0.0, "X", "1");
    assert_eq!(b.handled_batches(a.id), 0);
    let handle = |b: &mut Broker, who: &mut Speaker, count: u64| {
        let mut batch = Vec::new();
        b.take_mail(who.id, usize::MAX, &mut batch, |_, _| {});
        b.keep_given(who.id, batch);
        b.note_handled(0.0, who.id, count, &mut Vec::new());
    };
    handle(b, &mut c, 1);
    assert_eq!(b.handled_batches(a.id), 0, "d has not");
    handle(b, &mut d, 0);
    b.disconnect(0.0, d.id, 0, false);
    assert_eq!(b.handled_batches(a.id), 0, "its session is kept, and its mail");
    let mut next = join_ready(b, 0.0, &leased("d", 5.0));
    assert_eq!(b.handled_batches(a.id), 0);
    handle(b, &mut next, 1);
    assert_eq!(b.handled_batches(a.id), 1);
}

/// Mail that leaves all at once leaves with its buffer, if it is long.
#[test]
fn long_mail_is_the_same_whether_it_leaves_at_once_or_with_something_before_it() {
    let b = &mut broker();
    let (mut a, c) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"));
    c.register(b, 0.0, "*", "a", 0.0);
    let long = |n: usize| ((b'a' + n as u8) as char).to_string().repeat(20_000 + n);
    let mut handled = 0;
    for n in 0..6 {
        // Every other time a variable's name comes first, or a second message behind.
        let key = if n % 2 == 0 { format!("LONG_{n}") } else { "LONG_0".to_owned() };
        a.text(b, 1.0, &key, &long(n));
        let also = (n % 3 == 0).then(|| a.text(b, 1.0, "LONG_0", "short"));
        let mut batch = vec![0; 50_000];
        batch.clear();
        b.take_mail(c.id, 1 << 16, &mut batch, |_, _| {});
        let mail: Vec<_> = frames(&batch).map(Result::unwrap).filter(|f| f.header.kind == FrameKind::Notify).collect();
        assert_eq!(mail[0].value, long(n).as_bytes(), "{n}");
        assert_eq!(
            (mail.len(), mail.last().unwrap().value == b"short"),
            (1 + usize::from(also.is_some()), also.is_some())
        );
        handled += mail.len() as u64;
        let given = batch.clone();
        b.keep_given(c.id, batch);
        assert_eq!((b.last_given(c.id), b.given_bytes()), (Some(&given[..]), given.len()));
        b.note_handled(1.0, c.id, handled, &mut Vec::new());
        assert!(b.is_idle(c.id) && b.last_given(c.id).is_none());
    }
}
