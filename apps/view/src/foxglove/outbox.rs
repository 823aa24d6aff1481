//! What waits for one client. A client that reads slowly loses messages of its own and nobody else's: of each channel it is
//! given the latest one at last, whatever else came meanwhile.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use axum::body::Bytes;
use axum::extract::ws::Message;
use tokio::sync::Notify;

use super::graph::Graph;
use super::protocol::{self, Level};

/// Bytes of channels' messages that wait; beyond them, messages are left out that newer ones of their channel replace.
const MOST_DATA: usize = 8 << 20;
/// Bytes of all else. It is little, so who lets so much wait does not read at all, and is given up.
const MOST_CONTROL: usize = 64 << 20;

/// Messages on their way to a client.
#[derive(Default)]
pub(super) struct Outbox {
    queue: Mutex<Queue>,
    news: Notify,
}

#[derive(Default)]
struct Queue {
    control: VecDeque<Message>,
    control_bytes: usize,
    data: VecDeque<Data>,
    data_bytes: usize,
    /// How many messages of each subscription are in `data`.
    waiting: BTreeMap<u32, usize>,
    /// Messages that were left out since that was last told.
    left_out: u64,
    time: Option<u64>,
    /// What the client is to know of the graph, and what it knows; `None`: it did not ask.
    graph: Option<(Arc<Graph>, Arc<Graph>)>,
}

/// A message of a channel.
struct Data {
    subscription: u32,
    received: u64,
    payload: Bytes,
}

/// The client does not read at all.
#[derive(Debug)]
pub(super) struct Deaf;

impl Outbox {
    fn queue(&self) -> MutexGuard<'_, Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn change(&self, change: impl FnOnce(&mut Queue)) {
        change(&mut self.queue());
        self.news.notify_one();
    }

    /// What is never left out.
    pub fn say(&self, message: Message) {
        self.change(|queue| {
            queue.control_bytes += length(&message);
            queue.control.push_back(message);
        });
    }

    /// A message of a channel, received then (ns since 1970).
    pub fn publish(&self, subscription: u32, received: u64, payload: Bytes) {
        self.change(|queue| queue.push(Data { subscription, received, payload }));
    }

    /// The community's time (ns since 1970); only the latest one counts.
    pub fn time(&self, nanoseconds: u64) {
        self.change(|queue| queue.time = Some(nanoseconds));
    }

    /// Whether the client wants the graph, which is this.
    pub fn wants_graph(&self, graph: Option<Arc<Graph>>) {
        self.change(|queue| queue.graph = graph.map(|graph| (graph, Arc::default())));
    }

    /// Another graph, if the client wants it.
    pub fn graph(&self, graph: &Arc<Graph>) {
        self.change(|queue| queue.graph.iter_mut().for_each(|(now, _)| *now = graph.clone()));
    }

    /// Forgets what waits of a subscription.
    pub fn forget(&self, subscription: u32) {
        self.change(|queue| {
            queue.data.retain(|data| data.subscription != subscription);
            queue.data_bytes = queue.data.iter().map(|data| data.payload.len()).sum();
            queue.waiting.remove(&subscription);
        });
    }

    /// The next message, when there is one.
    ///
    /// # Errors
    /// So much waits that nobody can be reading.
    pub async fn next(&self) -> Result<Message, Deaf> {
        loop {
            if let Some(message) = self.queue().pop()? {
                return Ok(message);
            }
            self.news.notified().await;
        }
    }
}

impl Queue {
    fn push(&mut self, data: Data) {
        self.data_bytes += data.payload.len();
        *self.waiting.entry(data.subscription).or_default() += 1;
        self.data.push_back(data);
        while self.data_bytes > MOST_DATA {
            let waiting = &self.waiting;
            let replaced = |data: &Data| waiting.get(&data.subscription).is_some_and(|count| *count > 1);
            // What is left is one message a channel, which the broker keeps as well.
            let Some(place) = self.data.iter().position(replaced) else { break };
            self.left_out += u64::from(self.take(place).is_some());
        }
    }

    fn take(&mut self, place: usize) -> Option<Data> {
        let data = self.data.remove(place)?;
        self.data_bytes -= data.payload.len();
        if let Some(count) = self.waiting.get_mut(&data.subscription) {
            *count -= 1;
            if *count == 0 {
                self.waiting.remove(&data.subscription);
            }
        }
        Some(data)
    }

    fn pop(&mut self) -> Result<Option<Message>, Deaf> {
        if self.control_bytes > MOST_CONTROL {
            return Err(Deaf);
        }
        if let Some(message) = self.control.pop_front() {
            self.control_bytes -= length(&message);
            return Ok(Some(message));
        }
        if let Some(time) = self.time.take() {
            return Ok(Some(protocol::time(time)));
        }
        if let Some((now, known)) = &mut self.graph
            && let Some(update) = now.update(known)
        {
            *known = now.clone();
            return Ok(Some(protocol::text(&update)));
        }
        if let Some(Data { subscription, received, payload }) = self.take(0) {
            return Ok(Some(protocol::message_data(subscription, received, &payload)));
        }
        let left_out = std::mem::take(&mut self.left_out);
        let words = format!("{left_out} messages were left out: newer ones came before this client had read them");
        Ok((left_out > 0).then(|| protocol::status(Level::Warning, &words, Some("slow"))))
    }
}

fn length(message: &Message) -> usize {
    match message {
        Message::Text(text) => text.len(),
        Message::Binary(bytes) => bytes.len(),
        _ => 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(outbox: &Outbox) -> Vec<Message> {
        std::iter::from_fn(|| outbox.queue().pop().unwrap()).collect()
    }

    #[test]
    fn a_client_that_does_not_read_loses_what_newer_messages_replace() {
        let outbox = Outbox::default();
        outbox.publish(1, 0, Bytes::from_static(b"rare"));
        let large = Bytes::from(vec![0; 1 << 20]);
        (0..100).for_each(|number| outbox.publish(2, number, large.clone()));
        assert!(outbox.queue().data_bytes <= MOST_DATA);
        let messages = all(&outbox);
        assert_eq!(messages[0], protocol::message_data(1, 0, b"rare"));
        assert_eq!(messages.len(), 1 + 7 + 1);
        assert_eq!(messages[7], protocol::message_data(2, 99, &large));
        assert!(matches!(&messages[8], Message::Text(text) if text.contains("93 messages were left out")));
    }

    #[test]
    fn one_message_of_each_channel_is_kept_however_large_it_is() {
        let outbox = Outbox::default();
        let large = Bytes::from(vec![0; MOST_DATA]);
        (0..3).for_each(|number| outbox.publish(number, 0, large.clone()));
        assert_eq!(outbox.queue().data.len(), 3);
        outbox.forget(1);
        let queue = outbox.queue();
        assert_eq!((queue.data.len(), queue.data_bytes), (2, 2 * MOST_DATA));
    }

    #[test]
    fn of_times_and_graphs_the_last_ones_are_told() {
        let outbox = Outbox::default();
        (0..5).for_each(|time| outbox.time(time));
        assert_eq!(all(&outbox), [protocol::time(4)]);
        outbox.graph(&Arc::default());
        assert_eq!(all(&outbox), []);
    }

    #[test]
    fn who_never_reads_is_given_up() {
        let outbox = Outbox::default();
        let long = protocol::status(Level::Warning, &"x".repeat(1 << 20), None);
        (0..65).for_each(|_| outbox.say(long.clone()));
        assert!(outbox.queue().pop().is_err());
    }
}
