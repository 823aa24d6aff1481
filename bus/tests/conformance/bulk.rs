//! Bulk values: whole, in order, and as fast as they are read.

use crate::blob::{BLOB, blob};
use crate::common::events::{Patience, WATCHDOG};
use crate::hearing::{MOMENT, hear, settle};
use crate::transport::Transport;
use elk_bus::any;

pub fn values_of_any_size_arrive_whole_and_in_order<T: Transport>() {
    let t = T::start("bulk");
    let (mut a, mut b) = (t.connect("a").unwrap(), t.connect("b").unwrap());
    b.comms.register(any("*").from("a").lossless()).unwrap();
    settle(&mut b);
    let sizes = [0, 1, 100, 20_000, 1_000_000, 30, 3_000_000, 16_384, 17, 2_400_000, 2_400_000, 2_400_000];
    for (number, len) in (1..).zip(sizes) {
        a.comms.publish(&BLOB, &blob(number, len)).unwrap();
        a.comms.notify("BETWEEN", number as f64).unwrap();
        a.comms.flush().unwrap();
        let (mut got, patience) = (Vec::new(), Patience::new());
        while got.len() < 2 {
            b.receive(patience.left(format_args!("value {number} of {len} bytes")), |m| {
                if m.is(&BLOB) {
                    assert!(m.decode(&BLOB).unwrap() == blob(number, len), "value {number} of {len} bytes is damaged");
                }
                got.push(m.key().to_owned());
            })
            .unwrap();
        }
        assert_eq!(got, ["BLOB", "BETWEEN"]);
    }
    assert_eq!(b.inbox.dropped(), 0);
    drop((a, b));
    t.stop();
}

/// Regression: the broker slept on while a publisher waited for a lossless reader that had long read on, and bulk values
/// trickled at four a second.
pub fn bulk_values_flow_as_fast_as_a_lossless_reader_reads<T: Transport + Sync>() {
    const COUNT: u64 = 300;
    let t = T::start("flow");
    std::thread::scope(|scope| {
        let mut b = t.connect("b").unwrap();
        b.comms.register(any("BLOB").lossless()).unwrap();
        settle(&mut b);
        scope.spawn(|| {
            let mut a = t.connect("a").unwrap();
            (1..=COUNT).for_each(|number| a.comms.publish(&BLOB, &blob(number, 100_000)).unwrap());
        });
        let (mut next, patience) = (1, Patience::new());
        while next <= COUNT {
            b.receive(patience.left(format_args!("value {next}")), |m| {
                assert_eq!(m.decode(&BLOB).unwrap().number, next);
                next += 1;
            })
            .unwrap();
        }
        assert_eq!(b.inbox.dropped(), 0);
    });
    t.stop();
}

/// Regression: a publisher of bulk values waited for ever for a lossless reader that hung, and could not even be ended.
pub fn bulk_values_wait_for_a_lossless_reader_that_hangs_only_so_long<T: Transport>() {
    const COUNT: u64 = 20;
    let t = T::start("hung");
    let (mut a, mut b) = (t.connect("a").unwrap(), t.connect("b").unwrap());
    b.comms.register(any("BLOB").lossless()).unwrap();
    settle(&mut b);
    // What b is not given by reference it is given as a copy, with the hint to open the way for references.
    a.comms.publish(&BLOB, &blob(0, 100_000)).unwrap();
    a.comms.flush().unwrap();
    b.receive(WATCHDOG, |m| assert!(m.is(&BLOB))).unwrap();
    settle(&mut b);
    (1..=COUNT).for_each(|number| a.comms.publish(&BLOB, &blob(number, 100_000)).unwrap());
    settle(&mut a);
    let (mut numbers, patience) = (Vec::new(), Patience::new());
    while numbers.len() as u64 + b.inbox.dropped() < COUNT {
        patience.left(format_args!("more than {numbers:?}"));
        b.receive(MOMENT, |m| numbers.push(m.decode(&BLOB).unwrap().number)).unwrap();
    }
    assert!(numbers.is_sorted() && numbers.last() == Some(&COUNT), "{numbers:?}");
    drop((a, b));
    t.stop();
}

pub fn a_late_registrant_is_given_the_latest_value_however_large<T: Transport>() {
    let t = T::start("late");
    let mut a = t.connect("a").unwrap();
    for number in 1..=20 {
        a.comms.publish(&BLOB, &blob(number, 500_000)).unwrap();
    }
    a.comms.notify("NUMBER", 1.0).unwrap();
    settle(&mut a);
    for _ in 0..2 {
        let mut late = t.connect("late").unwrap();
        late.comms.register(&BLOB).unwrap();
        late.comms.register("NUMBER").unwrap();
        let (mut got, patience) = (Vec::new(), Patience::new());
        while got.len() < 2 {
            late.receive(patience.left("both"), |m| {
                assert!(m.is_latest() && (!m.is(&BLOB) || m.decode(&BLOB).unwrap() == blob(20, 500_000)));
                got.push(m.key().to_owned());
            })
            .unwrap();
        }
        assert_eq!(got, ["BLOB", "NUMBER"]);
    }
    drop(a);
    t.stop();
}

pub fn whoever_hears_itself_is_heard_by_the_others_as_before<T: Transport>() {
    let t = T::start("own-voice");
    let mut a = t.connect("a").unwrap();
    a.comms.register(&BLOB).unwrap();
    a.comms.publish(&BLOB, &blob(1, 100_000)).unwrap();
    hear(&mut a, |heard| heard.len() == 1);
    settle(&mut a);
    let mut late = t.connect("late").unwrap();
    late.comms.register(&BLOB).unwrap();
    let heard = hear(&mut late, |heard| heard.len() == 1);
    assert!(heard[0].2.as_ref().decode(&BLOB).unwrap() == blob(1, 100_000));
    a.comms.publish(&BLOB, &blob(2, 100_000)).unwrap();
    for client in [&mut a, &mut late] {
        let heard = hear(client, |heard| heard.len() == 1);
        assert!(heard[0].2.as_ref().decode(&BLOB).unwrap() == blob(2, 100_000));
    }
    drop((a, late));
    t.stop();
}
