//! Clients that live in an event loop.

use std::time::Duration;

use elk_bus::Client;
use rustix::event::{PollFd, PollFlags, Timespec, poll};

use crate::common::events::Patience;
use crate::hearing::settle;
use crate::transport::Transport;

/// Waits, on the descriptor alone, until it has heard `count` numbers, and answers them.
fn heard(client: &mut Client, count: usize) -> Vec<f64> {
    let (mut numbers, patience) = (Vec::new(), Patience::new());
    while numbers.len() < count {
        let left = patience.left(format_args!("{count} numbers, of which came {numbers:?}"));
        let left = Timespec { tv_sec: left.as_secs() as i64, tv_nsec: i64::from(left.subsec_nanos()) };
        poll(&mut [PollFd::from_borrowed_fd(client.wake_fd().unwrap(), PollFlags::IN)], Some(&left)).unwrap();
        client.receive(Duration::ZERO, |mail| numbers.extend(mail.as_double())).unwrap();
    }
    numbers
}

pub fn who_sleeps_on_the_descriptor_hears_all_of_it_through_a_brokers_death<T: Transport + Sync>() {
    let t = T::start("event-loop");
    let (mut a, mut b) = (t.connect("a").unwrap(), t.connect("b").unwrap());
    a.comms.register("N").unwrap();
    settle(&mut a);
    let say = |b: &mut Client, numbers: std::ops::Range<u32>| {
        for n in numbers {
            b.comms.notify("N", f64::from(n)).unwrap();
            b.comms.flush().unwrap();
        }
    };
    // Before the first look, and while it sleeps.
    say(&mut b, 0..3);
    std::thread::scope(|scope| {
        // A thread of its own joins: clients stay where they are.
        let t = &t;
        scope.spawn(move || {
            let mut c = t.connect("c").unwrap();
            say(&mut c, 100..400);
            settle(&mut c);
        });
        let mut numbers = heard(&mut a, 303);
        numbers.retain(|number| *number >= 100.0);
        assert!(numbers.iter().copied().eq((100..400).map(f64::from)), "{numbers:?}");
    });
    t.replace_broker();
    // What it says may have gone to the broker that died: whoever says no more does not notice.
    say(&mut b, 3..4);
    settle(&mut b);
    let mut numbers = heard(&mut a, 1);
    numbers.retain(|number| *number < 100.0);
    assert_eq!(numbers.last(), Some(&3.0));
    drop(b);
    drop(a);
    t.stop();
}

pub fn the_descriptor_is_readable_only_while_there_is_something<T: Transport>() {
    let t = T::start("quiet-loop");
    let (mut a, mut b) = (t.connect("a").unwrap(), t.connect("b").unwrap());
    a.comms.register("N").unwrap();
    settle(&mut a);
    b.comms.notify("N", 1.0).unwrap();
    b.comms.flush().unwrap();
    assert_eq!(heard(&mut a, 1), [1.0]);
    let patience = Patience::new();
    let now = Timespec { tv_sec: 0, tv_nsec: 0 };
    // What was on its way may have set it once more.
    while poll(&mut [PollFd::from_borrowed_fd(a.wake_fd().unwrap(), PollFlags::IN)], Some(&now)).unwrap() > 0 {
        patience.left("quiet");
        a.receive(Duration::ZERO, |mail| panic!("{mail:?}")).unwrap();
    }
    b.comms.notify("N", 2.0).unwrap();
    b.comms.flush().unwrap();
    assert_eq!(heard(&mut a, 1), [2.0]);
    drop(a);
    drop(b);
    t.stop();
}
