//! Bulk values: an iceoryx2 service per publishing client. A value is written once into the publisher's shared memory;
//! every attached receiver, the broker among them, reads it there.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::io::Write;
use std::mem::MaybeUninit;
use std::rc::Rc;
use std::time::Duration;

use elk_os::clock::Stopwatch;
use elk_os::tell;
use elk_proto::link::{Fill, Held, LinkError};
use iceoryx2::node::Node;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{AllocationStrategy, BackpressureStrategy};
use iceoryx2::sample::Sample;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use super::lane::Service;
use super::namespace::failed;
use super::scarce;

/// A received bulk value; its header is the sample's number, from 1.
pub type BulkSample = Sample<Service, [u8], u64>;

/// Values that a receiver's queue holds; then the oldest goes. Lossless receivers never let it come so far.
pub const QUEUE: usize = 8;
/// Values that a publisher may be ahead of its lossless receivers.
pub const DEPTH: u64 = 4;
/// Values that are kept in place at one end, for late registrants or to be sent again; beyond that they are copied.
pub const HELD: usize = 20;
/// Values of a publisher that a receiver's program may hold in place; beyond that it is given copies.
const HELD_BY_PROGRAM: usize = 8;
/// Chunks of a publisher's segment: queues and holders together never need more in practice, and a publisher that
/// finds none free sends by batch instead.
const CHUNKS: usize = 64;
const RECEIVERS: usize = 32;
/// How long a receiver waits until there is something to map a value's segment with.
const PATIENCE: Duration = Duration::from_secs(2);
/// How often it looks meanwhile.
const AGAIN_EVERY: Duration = Duration::from_millis(3);

fn open(node: &Node<Service>, name: &str) -> Result<PortFactory<Service, [u8], u64>, LinkError> {
    node.service_builder(&name.try_into().map_err(failed(name))?)
        .publish_subscribe::<[u8]>()
        .user_header::<u64>()
        .enable_safe_overflow(true)
        .subscriber_max_buffer_size(QUEUE)
        .subscriber_max_borrowed_samples(HELD + 4)
        .history_size(0)
        .max_publishers(1)
        .max_subscribers(RECEIVERS)
        .max_nodes(RECEIVERS + 4)
        .open_or_create()
        .map_err(failed(format_args!("opening bulk service {name}")))
}

/// The publishing end.
pub struct BulkWriter {
    publisher: Publisher<Service, [u8], u64>,
    /// The number of the last value.
    pub sent: u64,
    /// What was sent and may have to be sent again.
    pub kept: Samples,
}

impl BulkWriter {
    /// Opens a client's bulk service for values of about `len` bytes; it grows by powers of two.
    pub fn open(node: &Node<Service>, name: &str, len: usize) -> Result<Self, LinkError> {
        let publisher = open(node, name)?
            .publisher_builder()
            .initial_max_slice_len(len.next_power_of_two())
            .allocation_strategy(AllocationStrategy::PowerOfTwo)
            .override_sample_preallocation(|worst_case| worst_case.min(CHUNKS))
            .max_loaned_samples(1)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(failed(format_args!("writing to bulk service {name}")))?;
        Ok(Self { publisher, sent: 0, kept: Samples::open(node, name, &Budget::of(usize::MAX))? })
    }

    /// Has a value of `len` bytes written in place and sends it; answers its number, or `None` if all chunks are held
    /// by readers.
    pub fn send(&mut self, len: usize, fill: &mut Fill<'_>) -> Result<Option<u64>, LinkError> {
        let Ok(mut sample) = self.publisher.loan_slice_uninit(len) else {
            return Ok(None);
        };
        let mut slot = Slot { memory: sample.payload_mut(), written: 0 };
        fill(&mut slot).map_err(failed("writing a bulk value"))?;
        let (written, memory) = (slot.written, slot.memory);
        memory[written..].fill(MaybeUninit::new(0));
        self.sent += 1;
        *sample.user_header_mut() = self.sent;
        // SAFETY: `Slot` has written `..written` and the line above the rest.
        let sample = unsafe { sample.assume_init() };
        sample.send().map_err(failed("sending a bulk value"))?;
        self.kept.take_in();
        Ok(Some(self.sent))
    }
}

/// Memory that is written front to back.
struct Slot<'a> {
    memory: &'a mut [MaybeUninit<u8>],
    written: usize,
}

impl Write for Slot<'_> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let room = self.memory.get_mut(self.written..self.written + bytes.len());
        let room = room.ok_or_else(|| std::io::Error::other("the value is longer than announced"))?;
        room.write_copy_of_slice(bytes);
        self.written += bytes.len();
        Ok(bytes.len())
    }
    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

/// A receiving end.
pub struct BulkReader {
    subscriber: Subscriber<Service, [u8], u64>,
    current: Option<Current>,
    /// Values that the program holds in place, or has held.
    held: Vec<Held>,
    /// The number of the last value that was taken out of the queue; at least that, if it could not be read.
    reached: u64,
    name: String,
    /// The longest value that was read (bytes): longer ones lie in another segment, which has to be mapped.
    longest: usize,
    /// It was waited in vain for something to map a segment with: not again before one was mapped.
    gave_up: bool,
    /// It has been said that values cannot be read.
    said: Cell<bool>,
}

/// The value that was taken out of a receiver's queue last.
struct Current {
    number: u64,
    value: Held,
    is_in_place: bool,
}

/// What was taken out of a receiver's queue.
enum Taken {
    Value(BulkSample),
    /// A value that cannot be read.
    Lost,
    Nothing,
}

impl BulkReader {
    /// Opens a receiving end of a client's bulk service.
    pub fn open(node: &Node<Service>, name: &str) -> Result<Self, LinkError> {
        let subscriber = open(node, name)?
            .subscriber_builder()
            .create()
            .map_err(failed(format_args!("reading bulk service {name}")))?;
        let (name, said) = (name.to_owned(), Cell::new(false));
        Ok(Self { subscriber, current: None, held: Vec::new(), reached: 0, name, longest: 0, gave_up: false, said })
    }

    /// The next value that came and can be read, whichever it is.
    pub fn next(&self) -> Option<BulkSample> {
        loop {
            match self.take() {
                Taken::Value(sample) => return Some(sample),
                Taken::Lost => {}
                Taken::Nothing => return None,
            }
        }
    }

    /// Takes a value out of the queue. That one cannot be read is said once.
    fn take(&self) -> Taken {
        match self.subscriber.has_samples() {
            Ok(true) => {}
            Ok(false) => return Taken::Nothing,
            Err(error) => {
                self.say_lost(&format_args!("{error:?}"));
                return Taken::Nothing;
            }
        }
        match self.subscriber.receive() {
            Ok(Some(sample)) => Taken::Value(sample),
            // iceoryx2 lets go of a value whose segment it cannot map, and answers as if there were none.
            Ok(None) => {
                self.say_lost(&"its memory cannot be mapped");
                Taken::Lost
            }
            Err(error) => {
                self.say_lost(&format_args!("{error:?}"));
                Taken::Nothing
            }
        }
    }

    fn say_lost(&self, why: &dyn std::fmt::Display) {
        if !self.said.replace(true) {
            let (name, hint) = (&self.name, scarce::hint());
            tell(format_args!("a value of bulk service {name} is lost, it cannot be read: {why}{hint}"));
        }
    }

    /// Value number `wanted`, of `len` bytes, in place; lets go of all before it. `None` if it was overwritten, or if its
    /// segment cannot be mapped for longer than [`PATIENCE`].
    pub fn get(&mut self, wanted: u64, len: usize) -> Option<&Held> {
        if self.reached < wanted && (len > self.longest || self.reached + 1 < wanted) {
            self.wait_for_room(len);
        }
        while self.reached < wanted {
            self.let_go();
            match self.take() {
                Taken::Value(sample) => {
                    self.reached = *sample.user_header();
                    if sample.payload().len() > self.longest {
                        (self.longest, self.gave_up) = (sample.payload().len(), false);
                    }
                    self.current = Some(self.current_of(sample));
                }
                Taken::Lost => self.reached += 1,
                Taken::Nothing => return None,
            }
        }
        self.current.as_ref().filter(|current| current.number == wanted).map(|current| &current.value)
    }

    /// Lets go of the value that was taken out last, unless the program holds it.
    fn let_go(&mut self) {
        self.held.retain(|value| value.holders() > 1);
        let current = self.current.take().filter(|current| current.is_in_place && current.value.holders() > 1);
        self.held.extend(current.map(|current| current.value));
    }

    /// A value in place; or a copy of it, if the program holds so many that the publisher would soon have no room.
    fn current_of(&self, sample: BulkSample) -> Current {
        let (number, is_in_place) = (*sample.user_header(), self.held.len() < HELD_BY_PROGRAM);
        let value = if is_in_place { Held::new(sample) } else { Held::new(Vec::from(sample.payload())) };
        Current { number, value, is_in_place }
    }

    /// Waits until a segment for values of `len` bytes could be mapped: what is taken out of the queue and cannot be, is
    /// gone, while what stays there is kept by the broker as for any reader that is slow.
    fn wait_for_room(&mut self, len: usize) {
        let segment = len.checked_next_power_of_two().and_then(|len| len.checked_mul(CHUNKS)).unwrap_or(usize::MAX);
        let waited = Stopwatch::start();
        while !self.gave_up && !scarce::can_map(segment) {
            self.gave_up = waited.elapsed() > PATIENCE;
            std::thread::sleep(AGAIN_EVERY);
        }
    }
}

/// Room for copies of bulk values, of all publishers together.
pub struct Budget {
    limit: usize,
    used: Cell<usize>,
}

impl Budget {
    /// Room for so many bytes.
    pub fn of(limit: usize) -> Rc<Self> {
        Rc::new(Self { limit, used: Cell::new(0) })
    }

    /// Bytes that there is room for when nothing is copied.
    pub fn limit(&self) -> usize {
        self.limit
    }
}

/// A copied value; its room is free again when it is dropped.
struct Copied {
    bytes: Vec<u8>,
    budget: Rc<Budget>,
}

impl Copied {
    /// `None`: there is no room.
    fn of(bytes: &[u8], budget: &Rc<Budget>) -> Option<Self> {
        let used = budget.used.get().checked_add(bytes.len()).filter(|used| *used <= budget.limit)?;
        budget.used.set(used);
        Some(Self { bytes: bytes.to_vec(), budget: budget.clone() })
    }
}

impl Drop for Copied {
    fn drop(&mut self) {
        self.budget.used.set(self.budget.used.get() - self.bytes.len());
    }
}

/// Bulk values of one publisher that are still wanted.
pub struct Samples {
    reader: Option<BulkReader>,
    values: BTreeMap<u64, Kept>,
    budget: Rc<Budget>,
    /// Values that were wanted and had to be let go of, with their lengths (bytes).
    lost: Vec<(u64, usize)>,
}

/// A value that is kept: where it lies, or, so that its chunk can be used again, as a copy.
enum Kept {
    InPlace(BulkSample),
    Copied(Copied),
}

impl Kept {
    fn bytes(&self) -> &[u8] {
        match self {
            Kept::InPlace(sample) => sample.payload(),
            Kept::Copied(copy) => &copy.bytes,
        }
    }
}

impl Samples {
    /// None yet; for what is sent from now on over a client's bulk service.
    pub fn open(node: &Node<Service>, name: &str, budget: &Rc<Budget>) -> Result<Self, LinkError> {
        let reader = Some(BulkReader::open(node, name)?);
        Ok(Self { reader, values: BTreeMap::new(), budget: budget.clone(), lost: Vec::new() })
    }

    /// Takes in what has come.
    pub fn take_in(&mut self) {
        while let Some(sample) = self.reader.as_ref().and_then(BulkReader::next) {
            self.values.insert(*sample.user_header(), Kept::InPlace(sample));
        }
    }

    /// The value of this number.
    pub fn get(&self, number: u64) -> Option<&[u8]> {
        self.values.get(&number).map(Kept::bytes)
    }

    /// Lets go of all that is neither from `floor` on nor wanted; of what stays, too much to keep in place is copied.
    /// The less is kept, the sooner the publisher writes again into memory that is still in its cache.
    pub fn let_go(&mut self, floor: u64, wanted: impl Fn(u64) -> bool) {
        self.values.retain(|number, _| *number >= floor || wanted(*number));
        let in_place = self.values.values().filter(|k| matches!(k, Kept::InPlace(_))).count();
        self.copy_oldest(in_place.saturating_sub(HELD));
    }

    /// The publisher is gone: keeps copies of what is wanted, and nothing of its shared memory.
    pub fn part(&mut self, wanted: impl Fn(u64) -> bool) {
        self.take_in();
        self.values.retain(|number, _| wanted(*number));
        self.copy_oldest(usize::MAX);
        self.reader = None;
    }

    /// Copies so many of the values that lie in place; those for which there is no room are lost.
    fn copy_oldest(&mut self, count: usize) {
        let in_place = self.values.iter().filter(|(_, kept)| matches!(kept, Kept::InPlace(_)));
        let numbers: Vec<u64> = in_place.map(|(number, _)| *number).take(count).collect();
        for number in numbers {
            let Some(kept) = self.values.remove(&number) else { continue };
            match Copied::of(kept.bytes(), &self.budget) {
                Some(copy) => drop(self.values.insert(number, Kept::Copied(copy))),
                None => self.lost.push((number, kept.bytes().len())),
            }
        }
    }

    /// The values that were wanted and had to be let go of since the last call, with their lengths (bytes).
    pub fn take_lost(&mut self) -> Vec<(u64, usize)> {
        std::mem::take(&mut self.lost)
    }

    /// Whether nothing is kept.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty() && self.lost.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use std::fs::File;

    use rustix::process::{Resource, getrlimit, setrlimit};

    use super::super::{lane, leftovers, namespace::Namespace};
    use super::*;
    use crate::alone::run_test;
    use elk_proto::community::Community;

    const RUN_SHORT: &str = "ELK_TEST_RUNS_SHORT";

    /// Not a test by itself: a process of [`a_value_that_cannot_be_mapped_is_waited_for_or_said_to_be_lost`].
    #[test]
    fn runs_short_of_descriptors() {
        let Ok(comes_back) = std::env::var(RUN_SHORT) else { return };
        let community = Community::new(format!("short-{}", std::process::id())).unwrap();
        let namespace = Namespace::make(&community).unwrap();
        let node = lane::node(&namespace).unwrap();
        let mut writer = BulkWriter::open(&node, "bulk", 20).unwrap();
        let mut reader = BulkReader::open(&node, "bulk").unwrap();
        let mut send = |len: usize| writer.send(len, &mut |to| to.write_all(&vec![7; len])).unwrap().unwrap();
        send(10);
        assert_eq!(reader.get(1, 10).unwrap().len(), 10);
        // Each lies in a segment of its own.
        send(100_000);
        send(10);
        setrlimit(Resource::Nofile, rustix::process::Rlimit { current: Some(256), ..getrlimit(Resource::Nofile) })
            .unwrap();
        let mut taken: Vec<File> = std::iter::from_fn(|| File::open("/dev/null").ok()).collect();
        if comes_back == "yes" {
            let frees = std::thread::spawn(move || {
                std::thread::sleep(Duration::from_millis(50));
                drop(taken);
            });
            assert_eq!(reader.get(2, 100_000).unwrap().len(), 100_000);
            frees.join().unwrap();
        } else {
            assert!(reader.get(2, 100_000).is_none(), "there is nothing to map it with");
            taken.clear();
        }
        assert_eq!(reader.get(3, 10).unwrap().len(), 10, "nothing behind it is lost");
        drop((reader, writer, node));
        leftovers::remove(&namespace);
    }

    #[test]
    fn a_program_that_holds_many_values_has_the_first_in_place_and_copies_of_the_rest() {
        let community = Community::new(format!("holds-{}", std::process::id())).unwrap();
        let namespace = Namespace::make(&community).unwrap();
        let node = lane::node(&namespace).unwrap();
        let mut writer = BulkWriter::open(&node, "bulk", 1000).unwrap();
        let mut reader = BulkReader::open(&node, "bulk").unwrap();
        let mut read = |filled: u8| {
            let number = writer.send(1000, &mut |to| to.write_all(&[filled; 1000])).unwrap().unwrap();
            let newest = writer.sent;
            writer.kept.let_go(newest, |_| false);
            let value = reader.get(number, 1000).unwrap().clone();
            (value, reader.held.len())
        };
        let many: Vec<Held> = (0..100).map(|filled| read(filled).0).collect();
        for (filled, value) in (0_u8..).zip(&many) {
            assert!(value.len() == 1000 && value.iter().all(|byte| *byte == filled), "value {filled} was overwritten");
        }
        assert_eq!(read(100).1, HELD_BY_PROGRAM, "so many are held in place");
        drop(many);
        assert_eq!(read(101).1, 0, "nobody holds any of them");
        drop((reader, writer, node));
        leftovers::remove(&namespace);
    }

    /// Regression: iceoryx2 lets go of a value whose segment it cannot map without a word, and so did elk.
    #[test]
    fn a_value_that_cannot_be_mapped_is_waited_for_or_said_to_be_lost() {
        for comes_back in ["yes", "no"] {
            let ended = run_test("bulk::tests::runs_short_of_descriptors", RUN_SHORT, comes_back);
            let said = String::from_utf8_lossy(&ended.stderr).into_owned();
            assert!(ended.status.success(), "{comes_back}: {said}");
            let words =
                "is lost, it cannot be read: its memory cannot be mapped (256 descriptors are open and only 256";
            assert_eq!(said.contains(words), comes_back == "no", "{said}");
        }
    }
}
