//! A client under tokio: a stream of mail and a sink of publications (feature `tokio`).
//!
//! ```
//! use elk_bus::stream::{Publication, StreamClient};
//! use elk_bus::{BrokerConfig, Client, Clock, Community, memory::MemoryBroker};
//! use futures_util::{SinkExt, StreamExt};
//!
//! # #[tokio::main(flavor = "current_thread")]
//! # async fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let community = Community::new("doc")?;
//! # let broker = MemoryBroker::new(BrokerConfig::new("doc"), Clock::new(1.0));
//! # let join = |name: &str| Ok::<_, Box<dyn std::error::Error>>(Client::over(broker.connect(name)?, name, &community));
//! let (mut reader, writer) = (join("reader")?, join("writer")?);
//! reader.comms.register("GREETING")?;
//! let (mut reader, mut writer) = (StreamClient::new(reader)?, StreamClient::new(writer)?);
//! writer.send(Publication::new("GREETING", "hello")).await?;
//! let mail = reader.next().await.ok_or("the stream has ended")??;
//! assert_eq!(mail.value.as_ref().to_json(10)?, "hello");
//! # Ok(())
//! # }
//! ```

use std::collections::VecDeque;
use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::pin::Pin;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use futures_core::Stream;
use futures_sink::Sink;
use tokio::io::Interest;
use tokio::io::unix::AsyncFd;

use crate::client::Client;
use crate::codec::{self, DecodeError};
use crate::comms::{Comms, CommsError, Origin};
use crate::key::{Key, Payload};
use crate::mail::{self, Mail};
use crate::types::TypeRef;
use crate::value::Value;

/// A message that outlives the shared memory in which it came.
#[derive(Debug, Clone, PartialEq)]
pub struct OwnedMail {
    /// The variable's name.
    pub key: String,
    /// The name of the app that published it.
    pub source: String,
    /// Which build of which program that is, as it said; empty: it has not said.
    pub source_build: String,
    /// The client that was given it, with its build.
    pub reader: String,
    /// What the publisher said about the source; mostly empty.
    pub source_aux: String,
    /// The community that it was first published in.
    pub community: String,
    /// When it was published (s, the community's clock).
    pub time: f64,
    /// The publisher's count of its messages, from 1.
    pub sequence: u64,
    /// Whether it was published before this client registered.
    pub is_latest: bool,
    /// The value.
    pub value: Value,
}

impl OwnedMail {
    fn of(mail: &Mail<'_>) -> Self {
        Self {
            key: mail.key().to_owned(),
            source: mail.source().to_owned(),
            source_build: mail.source_build().to_owned(),
            reader: mail.reader().to_owned(),
            source_aux: mail.source_aux().to_owned(),
            community: mail.community().to_owned(),
            time: mail.time(),
            sequence: mail.sequence(),
            is_latest: mail.is_latest(),
            value: mail.value().to_value(),
        }
    }

    /// Decodes the value as what `key` carries.
    ///
    /// # Errors
    /// It is something else.
    pub fn decode<T: Payload>(&self, key: &Key<T>) -> Result<T::View<'_>, DecodeError> {
        self.value.as_ref().decode_as::<T>(key.name(), || mail::ends(&self.source, &self.source_build, &self.reader))
    }
}

/// What a client says of one variable.
#[derive(Debug, Clone, PartialEq)]
pub struct Publication {
    key: String,
    value: Value,
}

impl Publication {
    /// A number or a text.
    pub fn new(key: impl Into<String>, value: impl Into<Value>) -> Self {
        Self { key: key.into(), value: value.into() }
    }

    /// A typed value.
    ///
    /// # Errors
    /// It cannot be encoded.
    pub fn of<T: Payload>(key: &Key<T>, value: &T::View<'_>) -> Result<Self, CommsError> {
        let mut bytes = Vec::new();
        codec::encode_onto(value, &mut bytes)
            .map_err(|source| CommsError::Encode { key: key.name().to_owned(), source })?;
        Ok(Self { key: key.name().to_owned(), value: Value::Binary { type_: TypeRef::of::<T>().to_type(), bytes } })
    }
}

/// A client as a [`Stream`] of mail and a [`Sink`] of publications, on a tokio runtime with I/O enabled.
///
/// Mail is taken from the broker as the stream is polled: one that is not polled has the same bounded mailbox as any client.
/// The stream ends when a successor is ready, and behind an error: that the broker is gone for good, as the ordinary client
/// says. While the broker is behind, the sink is pending, and its task is woken when there is room; a value that lies in
/// shared memory waits for its readers, and its thread with it, as with the ordinary client, and so does a poll that finds the
/// broker dead until the next one is there.
///
/// A client stays on its thread, so this is no task for `tokio::spawn`, but one for
/// [`tokio::task::spawn_local`](https://docs.rs/tokio/latest/tokio/task/fn.spawn_local.html).
pub struct StreamClient {
    client: Client,
    wake: AsyncFd<OwnedFd>,
    /// What has come and was not asked for yet.
    waiting: VecDeque<OwnedMail>,
    ended: bool,
}

impl StreamClient {
    /// Puts a client on the runtime of the present task.
    ///
    /// # Errors
    /// There is no descriptor, or no thread, to wake it by.
    ///
    /// # Panics
    /// There is no tokio runtime, or one whose I/O is not enabled.
    pub fn new(mut client: Client) -> io::Result<Self> {
        let fd = client.wake_fd()?.as_fd().try_clone_to_owned()?;
        // SAFETY: the descriptor is this one's own, and stays open as long as it does.
        let wake = unsafe { AsyncFd::register_with_interest(fd, Interest::READABLE)? };
        Ok(Self { client, wake, waiting: VecDeque::new(), ended: false })
    }

    /// What the client says besides: registrations, typed values in place.
    pub fn comms(&mut self) -> &mut Comms {
        &mut self.client.comms
    }

    /// Takes in what has come.
    fn receive(&mut self) -> Result<(), CommsError> {
        let waiting = &mut self.waiting;
        let Client { comms, inbox } = &mut self.client;
        let note = |_: &mut Comms, mail: &Mail<'_>| -> Result<(), CommsError> {
            waiting.push_back(OwnedMail::of(mail));
            Ok(())
        };
        inbox.receive_alone(comms, Duration::ZERO, note).map(drop)
    }

    /// Ready once a batch can leave; the task is woken by then.
    fn poll_room(&self, context: &Context<'_>) -> Poll<()> {
        if self.client.comms.has_room() {
            return Poll::Ready(());
        }
        // Looked at once more, so that room that came before the task was there to be woken is seen.
        self.client.inbox.wake_task(context.waker());
        if self.client.comms.has_room() { Poll::Ready(()) } else { Poll::Pending }
    }
}

impl Stream for StreamClient {
    type Item = Result<OwnedMail, CommsError>;

    fn poll_next(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        let this = self.get_mut();
        loop {
            // What was registered for or published since the last poll must not wait for what this one waits for. Where
            // there is no room for it, the descriptor is ready as soon as there is, and it is tried again.
            if !this.ended && this.client.comms.has_room() {
                this.client.inbox.wake_waiting_task();
                if let Err(error) = this.client.comms.flush() {
                    this.ended = true;
                    return Poll::Ready(Some(Err(error)));
                }
            }
            if let Some(mail) = this.waiting.pop_front() {
                return Poll::Ready(Some(Ok(mail)));
            }
            if this.ended || this.client.inbox.retiring() {
                return Poll::Ready(None);
            }
            let mut tried = match ready!(this.wake.poll_read_ready(context)) {
                // Its descriptor is an eventfd, and the runtime is there: this is that one's end.
                Err(_) => return Poll::Ready(None),
                Ok(guard) => guard,
            };
            // Cleared first: what comes while it looks makes it ready again.
            tried.clear_ready();
            drop(tried);
            if let Err(error) = this.receive() {
                this.ended = true;
                return Poll::Ready(Some(Err(error)));
            }
        }
    }
}

impl Sink<Publication> for StreamClient {
    type Error = CommsError;

    fn poll_ready(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Result<(), CommsError>> {
        // A batch that is full leaves by itself.
        self.poll_room(context).map(Ok)
    }

    fn start_send(self: Pin<&mut Self>, said: Publication) -> Result<(), CommsError> {
        self.get_mut().client.comms.publish_value(&said.key, said.value.as_ref(), Origin::default())
    }

    fn poll_flush(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Result<(), CommsError>> {
        let this = self.get_mut();
        ready!(this.poll_room(context));
        Poll::Ready(this.client.comms.flush())
    }

    fn poll_close(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Result<(), CommsError>> {
        let this = self.get_mut();
        ready!(this.poll_room(context));
        Poll::Ready(this.client.comms.say_goodbye())
    }
}

#[cfg(test)]
mod tests {
    use futures_util::{SinkExt, StreamExt};

    use super::*;
    use crate::memory::MemoryBroker;
    use crate::{BrokerConfig, Clock, Community, any};

    /// A reader of whom publishers wait until it reads, in a community where they wait for ever.
    fn reader_and_writer() -> (MemoryBroker, [StreamClient; 2]) {
        let config = BrokerConfig { lossless_patience_secs: f64::INFINITY, ..BrokerConfig::new("full") };
        let broker = MemoryBroker::new(config.with_mailbox_bytes(4096), Clock::new(1.0));
        let community = Community::new("full").unwrap();
        let clients = ["reader", "writer"].map(|name| Client::over(broker.connect(name).unwrap(), name, &community));
        let [mut reader, writer] = clients.map(|client| StreamClient::new(client).unwrap());
        reader.comms().register(any("N").lossless()).unwrap();
        reader.comms().flush().unwrap();
        (broker, [reader, writer])
    }

    /// Says numbers from 0 until there is no room for more; how many.
    async fn fill(writer: &mut StreamClient) -> u32 {
        for number in 0.. {
            let ready = std::future::poll_fn(|context| Poll::Ready(writer.poll_ready_unpin(context))).await;
            if ready.is_pending() {
                return number;
            }
            writer.start_send_unpin(Publication::new("N", f64::from(number))).unwrap();
            let _ = std::future::poll_fn(|context| Poll::Ready(writer.poll_flush_unpin(context))).await;
        }
        unreachable!("there is an end to what fits")
    }

    #[tokio::test]
    async fn a_sink_is_pending_while_there_is_no_room_and_is_woken_when_there_is() {
        let (_broker, [mut reader, mut writer]) = reader_and_writer();
        let said = fill(&mut writer).await;
        assert!(said > 0);
        let say = async { writer.send(Publication::new("N", f64::from(said))).await.unwrap() };
        let hear = async {
            for number in 0..=said {
                let mail = reader.next().await.unwrap().unwrap();
                assert_eq!(mail.value, Value::Double(number.into()));
            }
        };
        futures_util::join!(say, hear);
    }
}
