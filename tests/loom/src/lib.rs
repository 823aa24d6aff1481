//! Every order in which two ends can touch a shared page.
//!
//! The bells and slots are those of the bus, the very file; only the atomics, the bytes and the futex below them are loom's,
//! which runs a test once for each order that the memory model allows. Nobody's sleep has a timeout here: a wake-up that
//! could be lost is a deadlock, and loom reports it.

#[allow(dead_code, reason = "a model needs no timeout and no second end")]
#[path = "../../../bus/shm/src/shared.rs"]
mod shared;
mod sync;

mod lane {
    /// Batches under way at most: one less than the models send, so that a slot is used twice.
    pub const DEPTH: u64 = 2;
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use loom::sync::Arc;
    use loom::sync::atomic::{AtomicU32, AtomicU64, Ordering};
    use loom::thread;

    use super::lane::DEPTH;
    use super::shared::{Bell, Slots};

    /// A model with at most so many changes of thread at places where none is needed: more of them find nothing here, and
    /// take hours.
    fn model(body: impl Fn() + Sync + Send + 'static) {
        let mut builder = loom::model::Builder::new();
        builder.preemption_bound = Some(3);
        builder.check(body);
    }

    /// Waits for work as every end does: the bell is looked at, then the work, then it sleeps.
    fn wait_for(bell: &Bell, is_there: impl Fn() -> bool) {
        loop {
            let rings = bell.rings();
            if is_there() {
                return;
            }
            bell.wait(rings, Duration::MAX);
        }
    }

    #[test]
    fn a_ring_between_looking_and_sleeping_is_not_missed() {
        model(|| {
            let (bell, work) = (Arc::new(Bell::default()), Arc::new(AtomicU32::new(0)));
            let (ringing, given) = (bell.clone(), work.clone());
            let ringer = thread::spawn(move || {
                given.store(1, Ordering::Release);
                ringing.ring();
            });
            wait_for(&bell, || work.load(Ordering::Acquire) == 1);
            ringer.join().unwrap();
        });
    }

    #[test]
    fn of_two_who_ring_both_are_heard() {
        model(|| {
            let (bell, work) = (Arc::new(Bell::default()), Arc::new(AtomicU32::new(0)));
            let ringers = [(); 2].map(|()| {
                let (bell, work) = (bell.clone(), work.clone());
                thread::spawn(move || {
                    work.fetch_add(1, Ordering::Release);
                    bell.ring();
                })
            });
            wait_for(&bell, || work.load(Ordering::Acquire) == 2);
            ringers.into_iter().for_each(|ringer| ringer.join().unwrap());
        });
    }

    /// One way of a lane, as client and broker use it: who writes waits for room and counts what is sent, who reads counts
    /// what is taken, and each rings the other's bell.
    #[derive(Default)]
    struct Way {
        slots: Slots,
        sent: AtomicU64,
        taken: AtomicU64,
        reader: Bell,
        writer: Bell,
    }

    #[test]
    fn a_slot_is_read_whole_and_written_again_only_when_it_was_taken() {
        const BATCHES: u64 = DEPTH + 1;
        model(|| {
            let way = Arc::new(Way::default());
            let of_writer = way.clone();
            let writer = thread::spawn(move || {
                let way = of_writer;
                for number in 0..BATCHES {
                    wait_for(&way.writer, || number - way.taken.load(Ordering::Acquire) < DEPTH);
                    assert!(way.slots.put(number, &[number as u8 + 1; 3]));
                    way.sent.store(number + 1, Ordering::Release);
                    way.reader.ring();
                }
            });
            for number in 0..BATCHES {
                wait_for(&way.reader, || way.sent.load(Ordering::Acquire) > number);
                assert_eq!(way.slots.get(number), Some(&[number as u8 + 1; 3][..]));
                way.taken.store(number + 1, Ordering::SeqCst);
                way.writer.ring();
            }
            writer.join().unwrap();
        });
    }
}
