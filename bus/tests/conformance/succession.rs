//! Names that are taken, left, and taken over, and the mail that goes with them.

use std::sync::Barrier;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use elk_bus::{App, AppError, Comms, Introduction, Mail, Value, any, run_app_on};

use crate::blob::{BLOB, blob};
use crate::count::Count;
use crate::hearing::{count_until_retired, hear, settle};
use crate::transport::Transport;

/// Its session is kept for a while after its death.
fn leased(name: &str) -> Introduction<'_> {
    Introduction { lease_secs: 60.0, ..Introduction::new(name) }
}

/// Regression: bulk values that came for a dead reader were gone when its successor came, all but the last few.
pub fn bulk_values_for_the_dead_are_kept_for_the_next_of_the_name<T: Transport>() {
    const COUNT: u64 = 150;
    let t = T::start("estate");
    let (mut a, mut first) = (t.connect("a").unwrap(), t.join(&leased("reader")).unwrap());
    first.comms.register(&BLOB).unwrap();
    settle(&mut first);
    a.comms.publish(&BLOB, &blob(1, 20_000)).unwrap();
    a.comms.flush().unwrap();
    hear(&mut first, |h| h.iter().any(|(key, ..)| key == "BLOB"));
    drop(first);
    for number in 2..=COUNT {
        a.comms.publish(&BLOB, &blob(number, 20_000)).unwrap();
        a.comms.flush().unwrap();
    }
    settle(&mut a);
    let mut second = t.join(&leased("reader")).unwrap();
    second.comms.register(&BLOB).unwrap();
    second.comms.flush().unwrap();
    let heard = hear(&mut second, |h| h.len() as u64 >= COUNT - 1);
    let numbers = heard.iter().map(|(_, _, value, _)| value.as_ref().decode(&BLOB).unwrap().number);
    assert!(numbers.eq(2..=COUNT));
    assert_eq!(second.inbox.dropped(), 0);
    drop((a, second));
    t.stop();
}

pub fn a_name_is_taken_once_and_free_again_at_once<T: Transport>() {
    let t = T::start("names");
    let a = t.connect("a").unwrap();
    let refused = t.connect("a").err().unwrap();
    assert!(refused.contains("already connected"), "{refused}");
    drop(a);
    for _ in 0..10 {
        drop(t.connect("a").unwrap());
    }
    t.stop();
}

pub fn the_next_of_a_name_gets_what_the_dead_one_left<T: Transport>() {
    let t = T::start("lease");
    let (mut a, mut b) = (t.connect("a").unwrap(), t.join(&leased("b")).unwrap());
    b.comms.register("N").unwrap();
    b.comms.register("ONCE").unwrap();
    settle(&mut b);
    a.comms.notify("ONCE", "upon a time").unwrap();
    a.comms.notify("N", 1.0).unwrap();
    a.comms.flush().unwrap();
    hear(&mut b, |h| h.len() == 2);
    for n in 2..5 {
        a.comms.notify("N", f64::from(n)).unwrap();
        settle(&mut a);
    }
    drop(b); // without a goodbye
    a.comms.notify("N", 5.0).unwrap();
    settle(&mut a);
    let mut b = t.join(&leased("b")).unwrap();
    b.comms.register("N").unwrap();
    b.comms.register("ONCE").unwrap();
    let heard = hear(&mut b, |h| h.last().is_some_and(|(_, _, value, _)| *value == Value::Double(5.0)));
    let heard: Vec<_> = heard.into_iter().map(|(_, _, value, latest)| (value, latest)).collect();
    let mail = (2..=5).map(|n| (Value::Double(f64::from(n)), false));
    let expected: Vec<_> = std::iter::once(("upon a time".into(), true)).chain(mail).collect();
    assert_eq!(heard, expected, "latest values first, then the mail, nothing twice");
    drop((a, b));
    t.stop();
}

pub fn a_client_that_leaves_in_good_order_leaves_nothing<T: Transport>() {
    let t = T::start("goodbye");
    let (mut a, mut b) = (t.connect("a").unwrap(), t.join(&leased("b")).unwrap());
    b.comms.register("N").unwrap();
    settle(&mut b);
    struct Leaves;
    impl App for Leaves {
        fn on_start_up(&mut self, comms: &mut Comms) -> Result<(), AppError> {
            comms.stop();
            Ok(())
        }
        fn on_new_mail(&mut self, _: &mut Comms, _: &Mail<'_>) -> Result<(), AppError> {
            Ok(())
        }
    }
    run_app_on(&mut Leaves, &mut b, &AtomicBool::new(false)).unwrap();
    drop(b);
    a.comms.notify("N", 1.0).unwrap();
    a.comms.notify("N", 2.0).unwrap();
    settle(&mut a);
    let mut b = t.join(&leased("b")).unwrap();
    b.comms.register("N").unwrap();
    let heard = hear(&mut b, |h| !h.is_empty());
    assert_eq!(heard, [("N".into(), "a".into(), Value::Double(2.0), true)]);
    drop((a, b));
    t.stop();
}

pub fn mail_goes_on_with_a_successor_at_a_message_boundary<T: Transport + Sync>() {
    const COUNT: u64 = 20_000;
    const HOLDERS: u64 = 5;
    let t = T::start("handover");
    let mut watcher = t.connect("watcher").unwrap();
    watcher.comms.register("DB_EVENT").unwrap();
    settle(&mut watcher);
    let (counted, first_is_there) = (Count::default(), Barrier::new(2));
    std::thread::scope(|scope| {
        let (t, counted, first_is_there) = (&t, &counted, &first_is_there);
        // Each holder of the name comes when a share of the messages was heard by those before it.
        for holder in 0..HOLDERS {
            scope.spawn(move || {
                counted.wait_for(holder * COUNT / HOLDERS);
                let who = Introduction { succeeds: true, ..Introduction::new("b") };
                let mut client = loop {
                    match t.join(&who) {
                        Err(reason) if reason.contains("on its way") => std::thread::yield_now(),
                        joined => break joined.unwrap(),
                    }
                };
                client.comms.register(any("N").lossless()).unwrap();
                if holder == 0 {
                    settle(&mut client);
                    first_is_there.wait();
                }
                count_until_retired(&mut client, counted, COUNT);
                assert_eq!(client.inbox.dropped(), 0);
            });
        }
        first_is_there.wait();
        let taken = t.connect("b").err().unwrap();
        assert!(taken.contains("already connected") || taken.contains("on its way"), "{taken}");
        let mut a = t.connect("a").unwrap();
        let mut handovers = 0;
        for n in 1..=COUNT {
            a.comms.notify("N", n as f64).unwrap();
            // In a hurry, but for the time in which the next holder is to come.
            let awaited = n * HOLDERS / COUNT;
            if n % 50 == 0 || handovers < awaited {
                a.comms.flush().unwrap();
            }
            while handovers < awaited && n % 50 == 0 {
                let note = |m: &Mail<'_>| {
                    handovers += u64::from(m.as_text().is_some_and(|t| t.starts_with("handover=b gap_ms=")));
                };
                if watcher.receive(Duration::from_millis(20), note).unwrap() == 0 {
                    break; // the successor may wait for its first message
                }
            }
        }
        assert_eq!(handovers, HOLDERS - 1);
    });
    drop(watcher);
    t.stop();
}

pub fn a_successor_that_dies_before_it_is_ready_changes_nothing<T: Transport>() {
    let t = T::start("stillborn");
    let (mut a, mut b) = (t.connect("a").unwrap(), t.connect("b").unwrap());
    b.comms.register("N").unwrap();
    settle(&mut b);
    let mut successor = t.join(&Introduction { succeeds: true, ..Introduction::new("b") }).unwrap();
    successor.comms.register("N").unwrap();
    successor.comms.notify("N", 13.0).unwrap();
    drop(successor);
    a.comms.notify("N", 1.0).unwrap();
    settle(&mut a);
    let heard = hear(&mut b, |h| !h.is_empty());
    assert_eq!(heard, [("N".into(), "a".into(), Value::Double(1.0), false)]);
    assert!(!b.inbox.retiring());
    drop((a, b));
    t.stop();
}
