//! Brokers that die, and those that take over.

use elk_bus::any;
use std::sync::Barrier;
use std::time::Duration;

use elk_bus::Value;

use crate::blob::{BLOB, blob};
use crate::common::events::Patience;
use crate::count::Count;
use crate::hearing::{MOMENT, count_until_retired, hear, settle};
use crate::transport::Transport;

pub fn clients_are_told_that_the_broker_is_gone<T: Transport + Send>() {
    let t = T::start("gone");
    let mut a = t.connect("a").unwrap();
    settle(&mut a);
    std::thread::scope(|scope| {
        scope.spawn(|| t.stop());
        let patience = Patience::new();
        let said = loop {
            if let Err(error) = a.receive(patience.left("that the broker is gone"), |_| {}) {
                break error.to_string();
            }
        };
        assert!(said.contains("is gone"), "{said}");
        drop(a);
    });
}

pub fn a_broker_may_die_and_nothing_is_lost_or_heard_twice<T: Transport + Sync>() {
    const COUNT: u64 = 60_000;
    let t = T::start("broker-death");
    let counted = [Count::default(), Count::default()];
    let there = Barrier::new(3);
    std::thread::scope(|scope| {
        let (t, counted, there) = (&t, &counted, &there);
        for (name, counted) in ["b", "c"].into_iter().zip(counted) {
            scope.spawn(move || {
                let mut listener = t.connect(name).unwrap();
                listener.comms.register(any("N").lossless()).unwrap();
                settle(&mut listener);
                there.wait();
                count_until_retired(&mut listener, counted, COUNT);
            });
        }
        scope.spawn(move || {
            let mut a = t.connect("a").unwrap();
            a.comms.notify("SETTING", "still there").unwrap();
            a.comms.publish(&BLOB, &blob(7, 300_000)).unwrap();
            there.wait();
            for n in 1..=COUNT {
                a.comms.notify("N", n as f64).unwrap();
                if n % 100 == 0 {
                    a.comms.flush().unwrap();
                }
            }
            // Whoever has said the last word stays until it was heard.
            let patience = Patience::new();
            while counted.iter().any(|c| c.get() < COUNT) {
                patience.left("the last number");
                a.receive(Duration::from_millis(10), |_| {}).unwrap();
            }
            let mut late = t.connect("late").unwrap();
            late.comms.register("SETTING").unwrap();
            late.comms.register(&BLOB).unwrap();
            let mut heard: Vec<(String, Value)> = Vec::new();
            while heard.len() < 2 {
                patience.left("the latest values");
                late.receive(Duration::from_millis(10), |m| heard.push((m.key().into(), m.value().to_value())))
                    .unwrap();
                // The last broker may have come after all was said: whoever wants to be heard has to find it.
                a.receive(Duration::from_millis(1), |_| {}).unwrap();
            }
            let value = |wanted: &str| heard.iter().find(|(key, _)| key == wanted).unwrap().1.clone();
            assert_eq!(value("SETTING"), Value::from("still there"));
            assert!(
                value("BLOB").as_ref().decode(&BLOB).unwrap() == blob(7, 300_000),
                "a bulk value comes back as well"
            );
        });
        for share in 1..=4 {
            counted[0].wait_for(share * COUNT / 5);
            t.replace_broker();
        }
    });
    t.stop();
}

pub fn what_was_left_by_those_who_are_gone_outlives_brokers<T: Transport>() {
    let t = T::start("left-by-the-dead");
    let mut a = t.connect("a").unwrap();
    a.comms.notify("NUMBER", 1.0).unwrap();
    a.comms.notify("TEXT", "last will").unwrap();
    a.comms.publish(&BLOB, &blob(3, 200_000)).unwrap();
    settle(&mut a);
    let mut b = t.connect("b").unwrap();
    b.comms.notify("NUMBER", 2.0).unwrap();
    settle(&mut b);
    drop(a);
    for name in ["late", "later"] {
        // The broker has written down what a has left before it lets anybody in.
        let mut late = t.connect(name).unwrap();
        late.comms.register("NUMBER").unwrap();
        late.comms.register(any("TEXT").from("a")).unwrap();
        late.comms.register(&BLOB).unwrap();
        let heard = hear(&mut late, |h| h.len() == 3);
        let value = |wanted: &str| heard.iter().find(|(key, ..)| key == wanted).unwrap().2.clone();
        assert_eq!((value("NUMBER"), value("TEXT")), (2.0.into(), "last will".into()));
        assert!(value("BLOB").as_ref().decode(&BLOB).unwrap() == blob(3, 200_000));
        drop(late);
        settle(&mut b);
        t.replace_broker();
        settle(&mut b);
    }
    drop(b);
    t.stop();
}

pub fn bulk_values_survive_the_broker<T: Transport + Sync>() {
    const COUNT: u64 = 200;
    let t = T::start("bulk-death");
    let (heard, there) = (Count::default(), Barrier::new(2));
    std::thread::scope(|scope| {
        let (t, heard, there) = (&t, &heard, &there);
        scope.spawn(move || {
            let mut a = t.connect("a").unwrap();
            there.wait();
            (1..=COUNT).for_each(|number| a.comms.publish(&BLOB, &blob(number, 100_000)).unwrap());
            let patience = Patience::new();
            while heard.get() < COUNT {
                patience.left("the last value");
                a.receive(Duration::from_millis(10), |_| {}).unwrap();
            }
        });
        scope.spawn(move || {
            let mut b = t.connect("b").unwrap();
            b.comms.register(any("BLOB").lossless()).unwrap();
            settle(&mut b);
            there.wait();
            let patience = Patience::new();
            while heard.get() < COUNT {
                patience.left(format_args!("more than {} values", heard.get()));
                b.receive(MOMENT, |m| {
                    let (number, got) = (heard.add(), m.decode(&BLOB).unwrap());
                    assert!(got == blob(number, 100_000), "value {} in place of {number}", got.number);
                })
                .unwrap();
            }
            assert_eq!(b.inbox.dropped(), 0);
        });
        for share in 1..=3 {
            heard.wait_for(share * COUNT / 4);
            t.replace_broker();
        }
    });
    t.stop();
}
