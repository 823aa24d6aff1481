//! What every transport has to do, run on each of them.

mod common;

use std::process::Child;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Barrier, Mutex, PoisonError};
use std::time::Duration;

use common::{broker_of, serve_if_asked_to};
use elk_bus::broker::CLOCK;
use elk_bus::clock::Stopwatch;
use elk_bus::memory::MemoryBroker;
use elk_bus::{
    BrokerConfig, Client, Clock, Community, ConnectError, Introduction, Key, Origin, RunOptions, Value, ValueRef,
};
use rustix::process::{Pid, Signal};

/// Long enough for any machine; nothing waits for it unless something is broken.
const DEADLINE: Duration = Duration::from_secs(20);

elk_bus::payload! {
    /// A payload of any size.
    #[derive(Debug, Clone, PartialEq)]
    pub struct Blob {
        /// Which one it is.
        pub number: u64,
        /// Its bytes.
        pub bytes: Vec<u8>,
    }
}

const BLOB: Key<Blob> = Key::new("BLOB");

fn blob(number: u64, len: usize) -> Blob {
    Blob { number, bytes: (0..len).map(|i| (i as u64 * 31 + number) as u8).collect() }
}

/// A community on some transport.
trait Transport {
    fn start(name: &str) -> Self;
    fn join(&self, who: &Introduction<'_>) -> Result<Client, String>;
    /// The broker dies, and another takes its place.
    fn replace_broker(&self);
    fn stop(self);

    fn connect(&self, name: &str) -> Result<Client, String> {
        self.join(&Introduction::new(name))
    }
}

struct Memory(MemoryBroker, Community);

impl Transport for Memory {
    fn start(name: &str) -> Self {
        Memory(MemoryBroker::new(BrokerConfig::new(name), Clock::new(1.0)), Community::new(name).unwrap())
    }
    fn join(&self, who: &Introduction<'_>) -> Result<Client, String> {
        Ok(Client::over(self.0.join(who).map_err(|e| e.to_string())?, who.name, &self.1))
    }
    fn replace_broker(&self) {
        self.0.crash();
        self.0.recover();
    }
    fn stop(self) {
        self.0.stop();
    }
}

/// A broker in a process of its own, which is this very program again.
struct Shm {
    community: Community,
    broker: Mutex<Child>,
}

/// Not a test by itself: the broker's process.
#[test]
fn broker_process() {
    serve_if_asked_to();
}

impl Transport for Shm {
    fn start(name: &str) -> Self {
        let community = Community::new(format!("{name}-{}", std::process::id())).unwrap();
        Shm { broker: Mutex::new(broker_of(&community)), community }
    }
    fn join(&self, who: &Introduction<'_>) -> Result<Client, String> {
        let options = RunOptions {
            lease_secs: who.lease_secs,
            succeeds: who.succeeds,
            ..RunOptions::new(who.name, self.community.clone())
        };
        let waited = Stopwatch::start();
        loop {
            match Client::join(&options) {
                // None yet, or one that is dying.
                Err(ConnectError::NoBroker(_) | ConnectError::Handshake { .. }) if waited.elapsed() < DEADLINE => {
                    std::thread::yield_now();
                }
                other => return other.map_err(|e| e.to_string()),
            }
        }
    }
    fn replace_broker(&self) {
        let mut broker = self.broker.lock().unwrap();
        broker.kill().unwrap();
        broker.wait().unwrap();
        *broker = broker_of(&self.community);
    }
    fn stop(self) {
        // A broker that was started just now does not heed signals yet; one that lets somebody in does.
        drop(self.connect("usher"));
        let mut broker = self.broker.lock().unwrap();
        rustix::process::kill_process(Pid::from_child(&broker), Signal::TERM).unwrap();
        assert!(broker.wait().unwrap().success());
        let prefix = format!("elk_{}=", self.community);
        let left: Vec<_> = std::fs::read_dir("/dev/shm").unwrap().flatten().map(|f| f.file_name()).collect();
        assert!(!left.iter().any(|f| f.to_string_lossy().starts_with(&prefix)), "left in /dev/shm: {left:?}");
    }
}

impl Drop for Shm {
    fn drop(&mut self) {
        // Has ended already unless the test failed.
        let broker = self.broker.get_mut().unwrap_or_else(PoisonError::into_inner);
        let _ = broker.kill();
        let _ = broker.wait();
    }
}

/// What was heard: (key, source, value, whether it was a latest value).
type Heard = (String, String, Value, bool);

fn hear(client: &mut Client, enough: impl Fn(&[Heard]) -> bool) -> Vec<Heard> {
    let (mut heard, waited) = (Vec::new(), Stopwatch::start());
    while !enough(&heard) {
        assert!(
            waited.elapsed() < DEADLINE,
            "heard only {} messages: {:.500}",
            heard.len(),
            format!("{:?}", heard.last())
        );
        client
            .receive(Duration::from_millis(100), |m| {
                heard.push((m.key().into(), m.source().into(), m.value().to_value(), m.is_latest()));
            })
            .unwrap();
    }
    heard
}

/// Waits until the broker has done all that `client` asked of it so far.
fn settle(client: &mut Client) {
    let mark = format!("MARK_{}", client.comms.name());
    client.comms.register_variable(&mark, 0.0).unwrap();
    client.comms.notify(&mark, "done").unwrap();
    hear(client, |h| h.iter().any(|(k, ..)| *k == mark));
}

fn numbers_and_texts_arrive_as_sent<T: Transport>() {
    let t = T::start("arrive");
    let (mut a, mut b) = (t.connect("a").unwrap(), t.connect("b").unwrap());
    b.comms.register_wildcard("V_*", "a", 0.0).unwrap();
    settle(&mut b);
    a.comms.notify("V_NUMBER", 2.5).unwrap();
    a.comms.notify("V_TEXT", "elks can dance").unwrap();
    a.comms.notify("V_EMPTY", "").unwrap();
    a.comms.flush().unwrap();
    let heard = hear(&mut b, |h| h.len() == 3);
    let expected = [("V_NUMBER", Value::Double(2.5)), ("V_TEXT", "elks can dance".into()), ("V_EMPTY", "".into())];
    for ((key, source, value, _), (expected_key, expected_value)) in heard.iter().zip(&expected) {
        assert_eq!((key.as_str(), source.as_str(), value), (*expected_key, "a", expected_value));
    }
    drop((a, b));
    t.stop();
}

fn order_is_kept_and_nothing_lost_however_fast<T: Transport + Sync>() {
    const COUNT: u64 = 50_000;
    let t = T::start("order");
    std::thread::scope(|scope| {
        let mut b = t.connect("b").unwrap();
        b.comms.register_lossless("N", "*").unwrap();
        settle(&mut b);
        for name in ["a1", "a2"] {
            let t = &t;
            scope.spawn(move || {
                let mut a = t.connect(name).unwrap();
                (0..COUNT).for_each(|i| a.comms.notify("N", i as f64).unwrap());
                a.comms.flush().unwrap();
            });
        }
        let heard = hear(&mut b, |h| h.len() as u64 == 2 * COUNT);
        for name in ["a1", "a2"] {
            let of_one = heard.iter().filter(|(_, source, ..)| source == name).map(|(_, _, value, _)| value);
            assert!(of_one.eq((0..COUNT).map(|i| Value::Double(i as f64)).collect::<Vec<_>>().iter()));
        }
        assert_eq!(b.inbox.dropped(), 0);
    });
    t.stop();
}

fn a_client_that_never_reads_hurts_nobody<T: Transport>() {
    let t = T::start("slow");
    let (mut a, mut slow) = (t.connect("a").unwrap(), t.connect("slow").unwrap());
    slow.comms.register_variable("N", 0.0).unwrap();
    slow.comms.flush().unwrap();
    settle(&mut a);
    a.comms.register_variable("N", 0.0).unwrap();
    let count = 400_000;
    for i in 0..count {
        a.comms.notify("N", f64::from(i)).unwrap();
        if i % 1000 == 0 {
            a.comms.flush().unwrap();
        }
    }
    settle(&mut a);
    let heard = hear(&mut slow, |h| h.last().is_some_and(|(_, _, v, _)| *v == Value::Double(f64::from(count - 1))));
    assert!(slow.inbox.dropped() > 0, "its mailbox is bounded");
    assert_eq!(heard.len() as u64 + slow.inbox.dropped(), count as u64, "every drop is counted");
    drop((a, slow));
    t.stop();
}

fn values_of_any_size_arrive_whole_and_in_order<T: Transport>() {
    let t = T::start("bulk");
    let (mut a, mut b) = (t.connect("a").unwrap(), t.connect("b").unwrap());
    b.comms.register_lossless("*", "a").unwrap();
    settle(&mut b);
    let sizes = [0, 1, 100, 20_000, 1_000_000, 30, 3_000_000, 16_384, 17, 2_400_000, 2_400_000, 2_400_000];
    for (number, len) in (1..).zip(sizes) {
        a.comms.publish(&BLOB, &blob(number, len)).unwrap();
        a.comms.notify("BETWEEN", number as f64).unwrap();
        a.comms.flush().unwrap();
        let (mut got, waited) = (Vec::new(), Stopwatch::start());
        while got.len() < 2 {
            assert!(waited.elapsed() < DEADLINE, "value {number} of {len} bytes did not come");
            b.receive(Duration::from_millis(100), |m| {
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
fn bulk_values_flow_as_fast_as_a_lossless_reader_reads<T: Transport + Sync>() {
    const COUNT: u64 = 300;
    let t = T::start("flow");
    std::thread::scope(|scope| {
        let mut b = t.connect("b").unwrap();
        b.comms.register_lossless("BLOB", "*").unwrap();
        settle(&mut b);
        scope.spawn(|| {
            let mut a = t.connect("a").unwrap();
            (1..=COUNT).for_each(|number| a.comms.publish(&BLOB, &blob(number, 100_000)).unwrap());
        });
        let (mut next, waited) = (1, Stopwatch::start());
        while next <= COUNT {
            assert!(waited.elapsed() < DEADLINE, "only {next} values came");
            b.receive(Duration::from_millis(100), |m| {
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
fn bulk_values_wait_for_a_lossless_reader_that_hangs_only_so_long<T: Transport>() {
    const COUNT: u64 = 20;
    let t = T::start("hung");
    let (mut a, mut b) = (t.connect("a").unwrap(), t.connect("b").unwrap());
    b.comms.register_lossless("BLOB", "*").unwrap();
    settle(&mut b);
    // What b is not given by reference it is given as a copy, with the hint to open the way for references.
    a.comms.publish(&BLOB, &blob(0, 100_000)).unwrap();
    a.comms.flush().unwrap();
    b.receive(DEADLINE, |m| assert!(m.is(&BLOB))).unwrap();
    settle(&mut b);
    (1..=COUNT).for_each(|number| a.comms.publish(&BLOB, &blob(number, 100_000)).unwrap());
    settle(&mut a);
    let (mut numbers, waited) = (Vec::new(), Stopwatch::start());
    while numbers.len() as u64 + b.inbox.dropped() < COUNT {
        assert!(waited.elapsed() < DEADLINE, "{numbers:?} came");
        b.receive(Duration::from_millis(100), |m| numbers.push(m.decode(&BLOB).unwrap().number)).unwrap();
    }
    assert!(numbers.is_sorted() && numbers.last() == Some(&COUNT), "{numbers:?}");
    drop((a, b));
    t.stop();
}

fn a_late_registrant_is_given_the_latest_value_however_large<T: Transport>() {
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
        late.comms.register_variable("NUMBER", 0.0).unwrap();
        let mut got = Vec::new();
        let waited = Stopwatch::start();
        while got.len() < 2 && waited.elapsed() < DEADLINE {
            late.receive(Duration::from_millis(100), |m| {
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

/// Regression: bulk values that came for a dead reader were gone when its successor came, all but the last few.
fn bulk_values_for_the_dead_are_kept_for_the_next_of_the_name<T: Transport>() {
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

/// Regression: a quarter of them was dropped before the reader came to read them.
fn a_late_reader_of_100_000_variables_is_given_all_of_them<T: Transport>() {
    const COUNT: usize = 100_000;
    let t = T::start("many");
    let mut a = t.connect("a").unwrap();
    (0..COUNT).for_each(|i| a.comms.notify(&format!("VARIABLE_{i}"), i as f64).unwrap());
    settle(&mut a);
    assert!(a.inbox.take_refusals().is_empty());
    let mut late = t.connect("late").unwrap();
    late.comms.register_wildcard("VARIABLE_*", "*", 0.0).unwrap();
    let heard = hear(&mut late, |h| h.len() >= COUNT);
    let numbers: std::collections::BTreeSet<String> = heard.into_iter().map(|(key, ..)| key).collect();
    assert_eq!((numbers.len(), late.inbox.dropped()), (COUNT, 0));
    drop((a, late));
    t.stop();
}

/// Regression: a text of 1.1 GB was taken, and then the broker let go of its writer.
fn long_texts_arrive_and_what_is_too_long_is_refused_at_once<T: Transport>() {
    let t = T::start("texts");
    let (mut a, mut b) = (t.connect("a").unwrap(), t.connect("b").unwrap());
    b.comms.register_variable("TEXT", 0.0).unwrap();
    settle(&mut b);
    let text = "long ".repeat(1 << 20);
    for _ in 0..3 {
        a.comms.notify("TEXT", text.as_str()).unwrap();
        a.comms.flush().unwrap();
        let heard = hear(&mut b, |h| !h.is_empty());
        assert!(heard.iter().all(|(.., value, _)| matches!(value, Value::Text(got) if *got == text)));
    }
    let name = "N".repeat(300);
    let refused = a.comms.notify(&name, 1.0).unwrap_err().to_string();
    assert!(refused.contains("a name of 300 bytes; at most 256 are allowed"), "{refused}");
    let refused = a.comms.register_wildcard(&name, "*", 0.0).unwrap_err().to_string();
    assert!(refused.contains("at most 256"), "{refused}");
    a.comms.notify("TEXT", "short").unwrap();
    a.comms.flush().unwrap();
    hear(&mut b, |h| h.iter().any(|(.., value, _)| *value == Value::Text("short".into())));
    drop((a, b));
    t.stop();
}

fn whoever_hears_itself_is_heard_by_the_others_as_before<T: Transport>() {
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

fn a_value_of_another_type_is_refused_to_its_writer_and_never_misread<T: Transport>() {
    let t = T::start("types");
    let (mut a, mut b) = (t.connect("a").unwrap(), t.connect("b").unwrap());
    b.comms.register(&BLOB).unwrap();
    b.comms.register_variable("NUMBER", 0.0).unwrap();
    settle(&mut b);
    a.comms.notify("BLOB", "not a blob").unwrap();
    a.comms.publish(&BLOB, &blob(1, 10)).unwrap();
    a.comms.notify("NUMBER", 1.0).unwrap();
    a.comms.publish(&Key::<Blob>::named("NUMBER"), &blob(1, 20_000)).unwrap();
    settle(&mut a);
    let refusals: Vec<String> = a.inbox.take_refusals().into_iter().map(|refused| refused.reason).collect();
    assert_eq!(refusals.len(), 2, "{refusals:?}");
    assert!(refusals[0].contains("b reads BLOB as Blob (layout") && refusals[0].contains("texts was refused"));
    assert!(refusals[1].contains("NUMBER carries numbers since its first write; Blob"), "{refusals:?}");
    let mut said = Vec::new();
    while said.len() < 2 {
        let decode = |m: &elk_bus::Mail<'_>| m.decode(&Key::<Blob>::named(m.key().to_owned())).map(|blob| blob.number);
        b.receive(Duration::from_millis(100), |m| said.push(decode(m).map_err(|e| e.to_string()))).unwrap();
    }
    let wrong = "NUMBER carries the number 1, but Blob was expected: do writer and reader mean the same variable?";
    assert_eq!(said, [Ok(1), Err(wrong.to_owned())]);
    drop((a, b));
    t.stop();
}

fn a_name_is_taken_once_and_free_again_at_once<T: Transport>() {
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

fn clients_are_told_that_the_broker_is_gone<T: Transport + Send>() {
    let t = T::start("gone");
    let mut a = t.connect("a").unwrap();
    settle(&mut a);
    std::thread::scope(|scope| {
        scope.spawn(|| t.stop());
        let waited = Stopwatch::start();
        let said = loop {
            match a.receive(Duration::from_millis(100), |_| {}) {
                Err(error) => break error.to_string(),
                Ok(_) => assert!(waited.elapsed() < DEADLINE, "nobody said that the broker is gone"),
            }
        };
        assert!(said.contains("is gone"), "{said}");
        drop(a);
    });
}

/// Whose place is kept for a while after its death.
fn leased(name: &str) -> Introduction<'_> {
    Introduction { lease_secs: 60.0, ..Introduction::new(name) }
}

fn the_next_of_a_name_gets_what_the_dead_one_left<T: Transport>() {
    let t = T::start("lease");
    let (mut a, mut b) = (t.connect("a").unwrap(), t.join(&leased("b")).unwrap());
    b.comms.register_variable("N", 0.0).unwrap();
    b.comms.register_variable("ONCE", 0.0).unwrap();
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
    b.comms.register_variable("N", 0.0).unwrap();
    b.comms.register_variable("ONCE", 0.0).unwrap();
    let heard = hear(&mut b, |h| h.last().is_some_and(|(_, _, value, _)| *value == Value::Double(5.0)));
    let heard: Vec<_> = heard.into_iter().map(|(_, _, value, latest)| (value, latest)).collect();
    let mail = (2..=5).map(|n| (Value::Double(f64::from(n)), false));
    let expected: Vec<_> = std::iter::once(("upon a time".into(), true)).chain(mail).collect();
    assert_eq!(heard, expected, "latest values first, then the mail, nothing twice");
    drop((a, b));
    t.stop();
}

fn a_client_that_leaves_in_good_order_leaves_nothing<T: Transport>() {
    let t = T::start("goodbye");
    let (mut a, mut b) = (t.connect("a").unwrap(), t.join(&leased("b")).unwrap());
    b.comms.register_variable("N", 0.0).unwrap();
    settle(&mut b);
    struct Leaves;
    impl elk_bus::App for Leaves {
        fn on_start_up(&mut self, comms: &mut elk_bus::Comms) -> Result<(), elk_bus::AppError> {
            comms.stop();
            Ok(())
        }
        fn on_new_mail(&mut self, _: &mut elk_bus::Comms, _: &elk_bus::Mail<'_>) -> Result<(), elk_bus::AppError> {
            Ok(())
        }
    }
    elk_bus::run_app_on(&mut Leaves, &mut b, &AtomicBool::new(false)).unwrap();
    drop(b);
    a.comms.notify("N", 1.0).unwrap();
    a.comms.notify("N", 2.0).unwrap();
    settle(&mut a);
    let mut b = t.join(&leased("b")).unwrap();
    b.comms.register_variable("N", 0.0).unwrap();
    let heard = hear(&mut b, |h| !h.is_empty());
    assert_eq!(heard, [("N".into(), "a".into(), Value::Double(2.0), true)]);
    drop((a, b));
    t.stop();
}

/// Hears numbers until it is to retire, or has heard the last one.
fn count_until_retired(client: &mut Client, counted: &AtomicU64, last: u64) {
    let waited = Stopwatch::start();
    while !client.inbox.retiring() && counted.load(Ordering::SeqCst) < last {
        assert!(waited.elapsed() < DEADLINE, "only {} came", counted.load(Ordering::SeqCst));
        client
            .receive(Duration::from_millis(100), |m| {
                if m.is_latest() {
                    return; // the holder before this one has heard it
                }
                let expected = counted.fetch_add(1, Ordering::SeqCst) + 1;
                assert_eq!(m.as_double(), Some(expected as f64), "in order, nothing lost, nothing twice");
            })
            .unwrap();
    }
}

fn mail_goes_on_with_a_successor_at_a_message_boundary<T: Transport + Sync>() {
    const COUNT: u64 = 20_000;
    const HOLDERS: u64 = 5;
    let t = T::start("handover");
    let mut watcher = t.connect("watcher").unwrap();
    watcher.comms.register_variable("DB_EVENT", 0.0).unwrap();
    settle(&mut watcher);
    let (counted, first_is_there) = (AtomicU64::new(0), Barrier::new(2));
    std::thread::scope(|scope| {
        let (t, counted, first_is_there) = (&t, &counted, &first_is_there);
        // Each holder of the name comes when a share of the messages was heard by those before it.
        for holder in 0..HOLDERS {
            scope.spawn(move || {
                let waited = Stopwatch::start();
                while counted.load(Ordering::SeqCst) < holder * COUNT / HOLDERS {
                    assert!(waited.elapsed() < DEADLINE, "stuck at {}", counted.load(Ordering::SeqCst));
                    std::thread::yield_now();
                }
                let who = Introduction { succeeds: true, ..Introduction::new("b") };
                let mut client = loop {
                    match t.join(&who) {
                        Err(reason) if reason.contains("on its way") => std::thread::yield_now(),
                        joined => break joined.unwrap(),
                    }
                };
                client.comms.register_lossless("N", "*").unwrap();
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
                let note = |m: &elk_bus::Mail<'_>| {
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

fn a_successor_that_dies_before_it_is_ready_changes_nothing<T: Transport>() {
    let t = T::start("stillborn");
    let (mut a, mut b) = (t.connect("a").unwrap(), t.connect("b").unwrap());
    b.comms.register_variable("N", 0.0).unwrap();
    settle(&mut b);
    let mut successor = t.join(&Introduction { succeeds: true, ..Introduction::new("b") }).unwrap();
    successor.comms.register_variable("N", 0.0).unwrap();
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

fn a_broker_may_die_and_nothing_is_lost_or_heard_twice<T: Transport + Sync>() {
    const COUNT: u64 = 60_000;
    let t = T::start("broker-death");
    let counted = [AtomicU64::new(0), AtomicU64::new(0)];
    let there = Barrier::new(3);
    std::thread::scope(|scope| {
        let (t, counted, there) = (&t, &counted, &there);
        for (name, counted) in ["b", "c"].into_iter().zip(counted) {
            scope.spawn(move || {
                let mut listener = t.connect(name).unwrap();
                listener.comms.register_lossless("N", "*").unwrap();
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
            let waited = Stopwatch::start();
            while counted.iter().any(|c| c.load(Ordering::SeqCst) < COUNT) && waited.elapsed() < DEADLINE {
                a.receive(Duration::from_millis(10), |_| {}).unwrap();
            }
            let mut late = t.connect("late").unwrap();
            late.comms.register_variable("SETTING", 0.0).unwrap();
            late.comms.register(&BLOB).unwrap();
            let mut heard: Vec<(String, Value)> = Vec::new();
            while heard.len() < 2 {
                assert!(waited.elapsed() < 2 * DEADLINE, "late heard only {} messages", heard.len());
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
            let waited = Stopwatch::start();
            while counted[0].load(Ordering::SeqCst) < share * COUNT / 5 {
                assert!(waited.elapsed() < DEADLINE, "stuck at {}", counted[0].load(Ordering::SeqCst));
                std::thread::yield_now();
            }
            t.replace_broker();
        }
    });
    t.stop();
}

/// Waits until a client's clock shows a time that is right.
fn wait_for_time(client: &mut Client, right: impl Fn(f64) -> bool) {
    let waited = Stopwatch::start();
    while !right(client.comms.time()) {
        assert!(waited.elapsed() < DEADLINE, "it is {}", client.comms.time());
        client.receive(Duration::from_millis(10), |_| {}).unwrap();
    }
}

fn a_driven_clock_is_everybodys_through_a_brokers_death_and_ends_with_its_driver<T: Transport>() {
    let recorded = |time: f64| (1000.0..2000.0).contains(&time);
    let t = T::start("clock");
    let (mut a, mut driver) = (t.connect("a").unwrap(), t.connect("driver").unwrap());
    assert!(a.comms.time() > 1e9, "nobody drives it yet");
    driver.comms.drive_clock(1000.0, 1.0).unwrap();
    driver.comms.flush().unwrap();
    wait_for_time(&mut a, recorded);
    let late = t.connect("late").unwrap();
    assert!(recorded(late.comms.time()), "whoever comes is told before it does anything");
    a.comms.register_variable("SAID", 0.0).unwrap();
    settle(&mut a);
    driver.comms.notify("SAID", "now").unwrap();
    let origin = Origin { source: Some("somebody"), time: Some(1234.5), ..Origin::default() };
    driver.comms.publish_value("SAID", ValueRef::Text("then"), origin).unwrap();
    driver.comms.flush().unwrap();
    let (mut times, waited) = (Vec::new(), Stopwatch::start());
    while times.len() < 2 {
        assert!(waited.elapsed() < DEADLINE, "only {times:?}");
        a.receive(Duration::from_millis(100), |mail| times.push(mail.time())).unwrap();
    }
    assert!(recorded(times[0]) && times[1] == 1234.5, "{times:?}");
    a.comms.drive_clock(9.0, 1.0).unwrap();
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

fn what_was_left_by_those_who_are_gone_outlives_brokers<T: Transport>() {
    let t = T::start("legacy");
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
        late.comms.register_wildcard("NUMBER", "*", 0.0).unwrap();
        late.comms.register_wildcard("TEXT", "a", 0.0).unwrap();
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

fn bulk_values_survive_the_broker<T: Transport + Sync>() {
    const COUNT: u64 = 200;
    let t = T::start("bulk-death");
    let (heard, there) = (AtomicU64::new(0), Barrier::new(2));
    std::thread::scope(|scope| {
        let (t, heard, there) = (&t, &heard, &there);
        scope.spawn(move || {
            let mut a = t.connect("a").unwrap();
            there.wait();
            (1..=COUNT).for_each(|number| a.comms.publish(&BLOB, &blob(number, 100_000)).unwrap());
            let waited = Stopwatch::start();
            while heard.load(Ordering::SeqCst) < COUNT && waited.elapsed() < DEADLINE {
                a.receive(Duration::from_millis(10), |_| {}).unwrap();
            }
        });
        scope.spawn(move || {
            let mut b = t.connect("b").unwrap();
            b.comms.register_lossless("BLOB", "*").unwrap();
            settle(&mut b);
            there.wait();
            let waited = Stopwatch::start();
            while heard.load(Ordering::SeqCst) < COUNT {
                assert!(waited.elapsed() < DEADLINE, "only {} values came", heard.load(Ordering::SeqCst));
                b.receive(Duration::from_millis(100), |m| {
                    let number = heard.load(Ordering::SeqCst) + 1;
                    let got = m.decode(&BLOB).unwrap();
                    assert!(got == blob(number, 100_000), "value {} in place of {number}", got.number);
                    heard.store(number, Ordering::SeqCst);
                })
                .unwrap();
            }
            assert_eq!(b.inbox.dropped(), 0);
        });
        for share in 1..=3 {
            let waited = Stopwatch::start();
            while heard.load(Ordering::SeqCst) < share * COUNT / 4 {
                assert!(waited.elapsed() < DEADLINE, "stuck at {}", heard.load(Ordering::SeqCst));
                std::thread::yield_now();
            }
            t.replace_broker();
        }
    });
    t.stop();
}

macro_rules! conformance {
    ($($test:ident),* $(,)?) => {
        mod memory { $(#[test] fn $test() { super::$test::<super::Memory>() })* }
        mod shm { $(#[test] fn $test() { super::$test::<super::Shm>() })* }
    };
}

conformance!(
    numbers_and_texts_arrive_as_sent,
    order_is_kept_and_nothing_lost_however_fast,
    a_client_that_never_reads_hurts_nobody,
    values_of_any_size_arrive_whole_and_in_order,
    bulk_values_flow_as_fast_as_a_lossless_reader_reads,
    bulk_values_wait_for_a_lossless_reader_that_hangs_only_so_long,
    a_late_registrant_is_given_the_latest_value_however_large,
    bulk_values_for_the_dead_are_kept_for_the_next_of_the_name,
    a_late_reader_of_100_000_variables_is_given_all_of_them,
    long_texts_arrive_and_what_is_too_long_is_refused_at_once,
    whoever_hears_itself_is_heard_by_the_others_as_before,
    a_value_of_another_type_is_refused_to_its_writer_and_never_misread,
    a_name_is_taken_once_and_free_again_at_once,
    clients_are_told_that_the_broker_is_gone,
    the_next_of_a_name_gets_what_the_dead_one_left,
    a_client_that_leaves_in_good_order_leaves_nothing,
    mail_goes_on_with_a_successor_at_a_message_boundary,
    a_successor_that_dies_before_it_is_ready_changes_nothing,
    a_broker_may_die_and_nothing_is_lost_or_heard_twice,
    a_driven_clock_is_everybodys_through_a_brokers_death_and_ends_with_its_driver,
    what_was_left_by_those_who_are_gone_outlives_brokers,
    bulk_values_survive_the_broker,
);
