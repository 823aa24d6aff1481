//! The community's clock.

use std::time::Duration;

use elk_bus::broker::CLOCK;
use elk_bus::{Client, Drive, Origin, ValueRef};

use crate::common::events::Patience;
use crate::hearing::settle;
use crate::transport::Transport;

/// Waits until a client's clock shows a time that is right.
fn wait_for_time(client: &mut Client, right: impl Fn(f64) -> bool) {
    let patience = Patience::new();
    while !right(client.comms.time()) {
        patience.left(format_args!("another time than {}", client.comms.time()));
        client.receive(Duration::from_millis(10), |_| {}).unwrap();
    }
}

pub fn a_driven_clock_is_everybodys_through_a_brokers_death_and_ends_with_its_driver<T: Transport>() {
    let recorded = |time: f64| (1000.0..2000.0).contains(&time);
    let t = T::start("clock");
    let (mut a, mut driver) = (t.connect("a").unwrap(), t.connect("driver").unwrap());
    assert!(a.comms.time() > 1e9, "nobody drives it yet");
    driver.comms.drive_clock(Drive { time_secs: 1000.0, rate: 1.0 }).unwrap();
    driver.comms.flush().unwrap();
    wait_for_time(&mut a, recorded);
    let late = t.connect("late").unwrap();
    assert!(recorded(late.comms.time()), "whoever comes is told before it does anything");
    a.comms.register("SAID").unwrap();
    settle(&mut a);
    driver.comms.notify("SAID", "now").unwrap();
    let origin = Origin { source: Some("somebody"), time: Some(1234.5), ..Origin::default() };
    driver.comms.publish_value("SAID", ValueRef::Text("then"), origin).unwrap();
    driver.comms.flush().unwrap();
    let (mut times, patience) = (Vec::new(), Patience::new());
    while times.len() < 2 {
        a.receive(patience.left("two messages"), |mail| times.push(mail.time())).unwrap();
    }
    assert!(recorded(times[0]) && times[1] == 1234.5, "{times:?}");
    a.comms.drive_clock(Drive { time_secs: 9.0, rate: 1.0 }).unwrap();
    wait_for_time(&mut a, recorded);
    assert_eq!(a.inbox.take_refusals().iter().map(|refused| refused.key.as_str()).collect::<Vec<_>>(), [CLOCK]);
    t.replace_broker();
    settle(&mut a);
    assert!(recorded(a.comms.time()), "the next broker leaves it as it is");
    settle(&mut driver);
    assert!(recorded(t.connect("later").unwrap().comms.time()), "and is told what it is");
    drop(driver);
    wait_for_time(&mut a, |time| time > 1e9);
    drop((a, late));
    t.stop();
}
