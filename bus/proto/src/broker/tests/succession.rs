//! Names and their holders, one after the other.

use super::*;

#[test]
fn a_place_is_kept_as_long_as_its_lease() {
    let b = &mut broker();
    let mut a = Speaker::new(b, 0.0, "a");
    let dead = join_ready(b, 0.0, &leased("c", 5.0));
    b.disconnect(1.0, dead.id, 0, false);
    a.text(b, 2.0, "X", "kept");
    b.tick(5.9);
    assert!(b.next_deadline() <= 6.0);
    let mut next = join_ready(b, 5.9, &leased("c", 5.0));
    let heard = next.hear(b, 5.9).0;
    assert_eq!(heard, [Heard { key: "X".into(), source: "a".into(), value: b"kept".into(), latest: false }]);
    b.disconnect(7.0, next.id, 1, false);
    a.text(b, 8.0, "X", "late");
    b.tick(12.0);
    let mut last = join_ready(b, 12.1, &leased("c", 5.0));
    assert!(last.hear(b, 12.1).0[0].latest, "the lease was over: the latest value is all there is");
}

/// Regression: a lease, and how long a slow reader and clients of a broker that died are waited for, went by the community's
/// seconds, of which a time warp makes short ones.
#[test]
fn the_dead_the_slow_and_those_who_come_back_have_the_wall_s_time_whatever_the_warp() {
    let config = BrokerConfig { time_warp: 10.0, mailbox_bytes: 10 * 56, ..BrokerConfig::new("test") };
    let b = &mut Broker::new(config.clone(), 0.0);
    let dead = join_ready(b, 0.0, &leased("c", 5.0));
    b.disconnect(0.0, dead.id, 0, false);
    b.tick(49.9);
    assert!(b.is_expected("c"), "5 s are 50 of the clock's");
    b.tick(50.0);
    assert!(!b.is_expected("c"));

    let (mut a, slow) = (Speaker::new(b, 50.0, "a"), Speaker::new(b, 50.0, "slow"));
    slow.registration(b, 50.0, FrameKind::Register, "X", "*", 0.0, LOSSLESS);
    (0..10).for_each(|i| a.text(b, 50.0, "X", &i.to_string()));
    assert!(b.holds_back(99.9, a.id) && !b.holds_back(100.0, a.id));

    let held = (Session { name: "held".into(), lease_secs: 0.0, registrations: Vec::new() }, true);
    let b = &mut Broker::recover(config, 0.0, [held], 10.0);
    b.tick(99.9);
    assert!(b.is_expected("held"));
    b.tick(100.0);
    assert!(!b.is_expected("held"));
}

#[test]
fn who_takes_a_place_is_told_what_was_dropped_of_its_mail() {
    let config = BrokerConfig { mailbox_bytes: 10 * 56, ..BrokerConfig::new("test") };
    let b = &mut Broker::new(config, 0.0);
    let mut a = Speaker::new(b, 0.0, "a");
    let mut dead = join_ready(b, 0.0, &leased("c", 5.0));
    let say = |b: &mut Broker, a: &mut Speaker| (0..15).for_each(|i| a.text(b, 0.0, "X", &i.to_string()));
    say(b, &mut a);
    assert_eq!(dead.hear(b, 0.0).1, 5);
    b.disconnect(1.0, dead.id, 10, false);
    say(b, &mut a);
    let (heard, dropped, _) = join_ready(b, 2.0, &leased("c", 5.0)).hear(b, 2.0);
    assert_eq!((heard.len(), dropped), (10, 5), "its predecessor knew of the first five");
}

/// Regression: a map that was killed together with the broker began before its readers had said again what they had of it.
#[test]
fn who_comes_for_a_dead_ones_place_waits_until_the_living_have_said_again_what_they_know() {
    let session = |name: &str| Session { name: name.into(), lease_secs: 0.0, registrations: Vec::new() };
    let returns = |name| Introduction { returns: true, ..Introduction::new(name) };
    for (comes_back, seated_at) in [(true, 1.0), (false, 2.0)] {
        let sessions = [(session("reader"), true), (session("map"), false)];
        let b = &mut Broker::recover(BrokerConfig::new("test"), 0.0, sessions, 10.0);
        let mut map = join_ready(b, 0.5, &Introduction::new("map"));
        map.register(b, 0.5, "PLAN", "*", 0.0);
        if comes_back {
            let mut reader = Speaker::with(b.connect(0.6, &returns("reader")).unwrap());
            ready(b, 0.6, reader.id);
            b.tick(0.7);
            assert!(b.is_joining(map.id), "it is back, and has said nothing yet");
            reader.text(b, 0.8, "PLAN", "of revision 44");
            ready(b, 0.9, reader.id);
        }
        assert!(b.next_deadline() <= 2.0);
        b.tick(seated_at - 0.1);
        assert_eq!(b.is_joining(map.id), !comes_back);
        b.tick(seated_at);
        assert!(!b.is_joining(map.id));
        assert_eq!(map.texts(b, seated_at), if comes_back { vec!["of revision 44"] } else { vec![] });
    }
}

#[test]
fn a_name_has_one_holder_and_one_successor_and_only_a_successor_may_come_for_it() {
    let b = &mut broker();
    let holder = join_ready(b, 0.0, &leased("c", 5.0));
    assert_eq!(b.connect(0.0, &leased("c", 0.0)), Err(AdmissionError::NameTaken("c".into())));
    let successor = Introduction { succeeds: true, ..Introduction::new("c") };
    let next = b.connect(0.0, &successor).unwrap();
    assert_eq!(b.connect(0.0, &successor), Err(AdmissionError::SuccessorTaken("c".into())));
    assert!(retiring(b).is_empty() && !b.holds_back(0.0, next));
    ready(b, 0.0, next);
    assert_eq!(retiring(b), [holder.id]);
    assert!(b.holds_back(0.0, next), "what it says from now on waits until it has its session");
    b.disconnect(0.0, holder.id, 0, true);
    assert!(!b.holds_back(0.0, next));
    assert_eq!(b.client_named("c"), Some(next));
}

#[test]
fn a_recovered_broker_waits_for_those_who_live_and_gives_the_places_of_the_dead_away() {
    let b = &mut broker();
    join_ready(b, 0.0, &leased("lives", 0.0));
    join_ready(b, 0.0, &leased("dead", 5.0));
    assert!(actions(b).contains(&Action::KeepSessions));
    let sessions: Vec<Session> = b.sessions().into_iter().map(|(_, session)| session).collect();
    assert_eq!(sessions.iter().map(|p| p.name.as_str()).collect::<Vec<_>>(), ["dead", "lives"]);
    assert_eq!(actions(b), [], "they are the same as before");
    let sessions = sessions.into_iter().map(|session| (session.clone(), session.name == "lives"));
    let b = &mut Broker::recover(BrokerConfig::new("test"), 100.0, sessions, 10.0);
    let mut a = Speaker::new(b, 100.0, "a");
    a.text(b, 100.0, "X", "before they are back");
    assert_eq!(b.connect(100.0, &Introduction::new("lives")), Err(AdmissionError::NameTaken("lives".into())));
    let back = Introduction { returns: true, ..Introduction::new("lives") };
    for who in [back, Introduction::new("dead")] {
        let mut one = join_ready(b, 101.0, &who);
        assert_eq!(one.texts(b, 101.0), ["before they are back"], "{}", who.name);
        ready(b, 101.0, one.id); // it has nothing to say again
    }
}

/// What happens to a name whose holders come and go.
#[derive(Debug, Clone, Copy)]
enum Turn {
    /// So many messages for it are published.
    Say(u8),
    /// The holder is given what waits.
    Give,
    /// The holder handles so many messages of what it was given.
    Handle(u8),
    /// The holder dies; another one succeeds it.
    Die,
    /// A successor comes while the holder lives.
    Swap,
}

fn turn() -> impl Strategy<Value = Turn> {
    prop_oneof![
        (1..5_u8).prop_map(Turn::Say),
        Just(Turn::Give),
        (1..6_u8).prop_map(Turn::Handle),
        Just(Turn::Die),
        Just(Turn::Swap),
    ]
}

/// The holders of a name, one after the other, and what they have handled together.
struct Holders {
    speaker: Speaker,
    given: std::collections::VecDeque<String>,
    handled: u64,
    heard: Vec<String>,
}

impl Holders {
    fn give(&mut self, b: &mut Broker) {
        let mut batch = Vec::new();
        b.take_mail(self.speaker.id, usize::MAX, &mut batch, |_, _| {});
        let messages = frames(&batch).map(Result::unwrap).filter(|f| f.header.kind == FrameKind::Notify);
        self.given.extend(messages.map(|f| match f.header.flags & LATEST {
            0 => String::from_utf8(f.value.into()).unwrap(),
            _ => "latest".into(),
        }));
        b.keep_given(self.speaker.id, batch);
    }

    fn handle(&mut self, b: &mut Broker, count: usize) {
        for message in self.given.drain(..count.min(self.given.len())) {
            self.handled += 1;
            self.heard.extend(Some(message).filter(|m| m != "latest"));
        }
        b.note_handled(0.0, self.speaker.id, self.handled, &mut Vec::new());
    }

    fn replace(&mut self, b: &mut Broker, swap: bool) {
        let dead = self.speaker.id;
        let who = Introduction { succeeds: swap, ..leased("c", 5.0) };
        if swap {
            self.speaker = join_ready(b, 0.0, &who);
            assert_eq!(retiring(b), [dead]);
        }
        b.disconnect(0.0, dead, self.handled, swap);
        if !swap {
            self.speaker = join_ready(b, 0.0, &who);
        }
        (self.given, self.handled) = (Default::default(), 0);
    }
}

proptest! {
    /// However the holders of a name die or are exchanged, together they hear everything once and in order.
    #[test]
    fn holders_of_a_name_hear_everything_once(turns in prop::collection::vec(turn(), 1..60)) {
        let b = &mut broker();
        let mut a = Speaker::new(b, 0.0, "a");
        let speaker = join_ready(b, 0.0, &leased("c", 5.0));
        let mut holders = Holders { speaker, given: Default::default(), handled: 0, heard: Vec::new() };
        let mut said = 0;
        for turn in turns {
            match turn {
                Turn::Say(count) => for _ in 0..count {
                    said += 1;
                    a.text(b, 0.0, ["X", "Y"][said % 2], &said.to_string());
                },
                Turn::Give => holders.give(b),
                Turn::Handle(count) => holders.handle(b, count.into()),
                Turn::Die => holders.replace(b, false),
                Turn::Swap => holders.replace(b, true),
            }
        }
        holders.give(b);
        holders.handle(b, usize::MAX);
        prop_assert_eq!(holders.heard, (1..=said).map(|n| n.to_string()).collect::<Vec<_>>());
    }
}
