//! What every transport has to do, run on each of them.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use elk_bus::clock::Stopwatch;
use elk_bus::memory::MemoryBroker;
use elk_bus::{BrokerConfig, Client, Clock, Community, Key, ServeError, Value, serve_broker_until};

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
    fn connect(&self, name: &str) -> Result<Client, String>;
    fn stop(self);
}

struct Memory(MemoryBroker, Community);

impl Transport for Memory {
    fn start(name: &str) -> Self {
        Memory(MemoryBroker::new(BrokerConfig::new(name), Clock::new(1.0)), Community::new(name).unwrap())
    }
    fn connect(&self, name: &str) -> Result<Client, String> {
        Ok(Client::over(self.0.connect(name).map_err(|e| e.to_string())?, name, &self.1))
    }
    fn stop(self) {
        self.0.stop();
    }
}

struct Shm {
    community: Community,
    stop: Arc<AtomicBool>,
    server: JoinHandle<Result<(), ServeError>>,
}

impl Transport for Shm {
    fn start(name: &str) -> Self {
        let community = Community::new(format!("{name}-{}", std::process::id())).unwrap();
        let stop = Arc::new(AtomicBool::new(false));
        let (c, s) = (community.clone(), stop.clone());
        let config = BrokerConfig::new(name);
        let server = std::thread::spawn(move || serve_broker_until(c, config, Clock::new(1.0), &s));
        Shm { community, stop, server }
    }
    fn connect(&self, name: &str) -> Result<Client, String> {
        let waited = Stopwatch::start();
        loop {
            match Client::connect(&self.community, name) {
                Err(elk_bus::ConnectError::NoBroker(_)) if waited.elapsed() < DEADLINE => std::thread::yield_now(),
                other => return other.map_err(|e| e.to_string()),
            }
        }
    }
    fn stop(self) {
        self.stop.store(true, Ordering::Relaxed);
        self.server.join().unwrap().unwrap();
        let prefix = format!("elk_{}_", self.community);
        let left: Vec<_> = std::fs::read_dir("/dev/shm").unwrap().flatten().map(|f| f.file_name()).collect();
        assert!(!left.iter().any(|f| f.to_string_lossy().starts_with(&prefix)), "left in /dev/shm: {left:?}");
    }
}

/// What was heard: (key, source, value, whether it was a latest value).
type Heard = (String, String, Value, bool);

fn hear(client: &mut Client, enough: impl Fn(&[Heard]) -> bool) -> Vec<Heard> {
    let (mut heard, waited) = (Vec::new(), Stopwatch::start());
    while !enough(&heard) {
        assert!(waited.elapsed() < DEADLINE, "heard only {} messages: {:?}", heard.len(), heard.last());
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

fn a_value_of_another_type_is_refused_to_its_writer_and_never_misread<T: Transport>() {
    let t = T::start("types");
    let (mut a, mut b) = (t.connect("a").unwrap(), t.connect("b").unwrap());
    b.comms.register(&BLOB).unwrap();
    settle(&mut b);
    a.comms.notify("BLOB", "not a blob").unwrap();
    a.comms.publish(&BLOB, &blob(1, 10)).unwrap();
    settle(&mut a);
    let refusals = a.inbox.take_refusals();
    assert_eq!(refusals.len(), 1);
    assert!(refusals[0].reason.contains("BLOB carries texts since its first write; Blob"), "{}", refusals[0].reason);
    let mut said = String::new();
    while said.is_empty() {
        b.receive(Duration::from_millis(100), |m| said = m.decode(&BLOB).unwrap_err().to_string()).unwrap();
    }
    assert_eq!(said, "BLOB carries a text, but Blob was expected: do writer and reader mean the same variable?");
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
    a_late_registrant_is_given_the_latest_value_however_large,
    a_value_of_another_type_is_refused_to_its_writer_and_never_misread,
    a_name_is_taken_once_and_free_again_at_once,
    clients_are_told_that_the_broker_is_gone,
);
