//! A small client of a MOOSDB, or of what stands in its place: for tests and benchmarks. It has no thread: whoever uses it
//! has to receive, or to send, at least once a second.

use std::io::{self, ErrorKind, IoSlice, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;

use elk_os::clock::{Clock, Stopwatch};

use crate::hello::{Hello, Manner};
use crate::message::{Data, Kind, Message, REQUEST_ID};
use crate::packet::{Decoder, Event, HEADER, StreamError, greeting, header};

/// How long the server has to answer the first word.
const PATIENCE: Duration = Duration::from_secs(60);
/// How often an asynchronous client gives a sign of life.
const BEAT_EVERY: Duration = Duration::from_secs(1);
/// Bytes that are read at a time.
const READ_BYTES: usize = 256 << 10;
/// The longest message that is taken (bytes).
const LONGEST: usize = 1 << 30;

/// Why a client could not do what it was asked to.
#[derive(Debug, thiserror::Error)]
pub enum ClientError {
    /// It was not let in, for this reason.
    #[error("the server refuses this client: {0}")]
    Poisoned(String),
    /// The server ended the connection.
    #[error("the server has ended the connection")]
    Closed,
    /// The server says nothing.
    #[error("the server has not answered in {} s", PATIENCE.as_secs())]
    Silent,
    /// What the server says is no packet.
    #[error(transparent)]
    Stream(#[from] StreamError),
    /// The network failed.
    #[error(transparent)]
    Io(#[from] io::Error),
}

/// What a server has said of itself.
#[derive(Debug, Clone, PartialEq)]
pub struct Welcomed {
    /// Its community.
    pub community: String,
    /// What it says of its machine: `hostname=…`.
    pub hostname: String,
    /// Its time less this client's (s).
    pub skew: f64,
}

/// A client.
#[derive(Debug)]
pub struct MoosClient {
    socket: TcpStream,
    decoder: Decoder,
    /// How long a look into the socket waits.
    timeout: Option<Duration>,
    name: String,
    manner: Manner,
    clock: Clock,
    welcomed: Welcomed,
    /// Room for a packet's header, and the messages that wait to be sent.
    outbox: Vec<u8>,
    waiting: i32,
    next_id: i32,
    beaten: Option<Stopwatch>,
}

impl MoosClient {
    /// Connects, and waits to be let in.
    ///
    /// # Errors
    /// It is not let in, or there is no server.
    pub fn connect(address: SocketAddr, name: &str, manner: Manner) -> Result<Self, ClientError> {
        Self::connect_at(address, name, manner, Clock::new(1.0))
    }

    /// … with a clock that has the community's time warp, as MOOS' clients are told of it by their file.
    ///
    /// # Errors
    /// As there.
    pub fn connect_at(address: SocketAddr, name: &str, manner: Manner, clock: Clock) -> Result<Self, ClientError> {
        let mut socket = TcpStream::connect(address)?;
        socket.set_nodelay(true)?;
        let mut first = greeting().to_vec();
        Hello { name: name.to_owned(), manner, time: clock.now() }.put(&mut first);
        socket.write_all(&first)?;
        let mut client = Self {
            socket,
            decoder: Decoder::of_server(LONGEST),
            timeout: None,
            name: name.to_owned(),
            manner,
            clock,
            welcomed: Welcomed { community: String::new(), hostname: String::new(), skew: 0.0 },
            outbox: vec![0; HEADER],
            waiting: 0,
            next_id: 0,
            beaten: None,
        };
        client.welcomed = client.welcome()?;
        Ok(client)
    }

    fn welcome(&mut self) -> Result<Welcomed, ClientError> {
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        let mut welcomed = None;
        while welcomed.is_none() {
            let mut refused = None;
            let packets = self.read(PATIENCE, &mut |message| match message.kind {
                Kind::POISON => refused = Some(text(message.value)),
                _ => {
                    let (community, hostname) = (text(message.community), text(message.source_aux));
                    welcomed = Some(Welcomed { community, hostname, skew: message.number });
                }
            })?;
            if let Some(reason) = refused {
                return Err(ClientError::Poisoned(reason));
            }
            if packets.is_none() {
                return Err(ClientError::Silent);
            }
        }
        welcomed.ok_or(ClientError::Silent)
    }

    /// What the server has said of itself.
    pub fn welcomed(&self) -> &Welcomed {
        &self.welcomed
    }

    /// The client's own clock.
    pub fn time(&self) -> f64 {
        self.clock.now()
    }

    /// Puts a message behind those that wait to be sent, as it is.
    pub fn say(&mut self, message: &Message<'_>) {
        message.put(&mut self.outbox);
        self.waiting += 1;
    }

    /// Says that the client wants a variable, a message every `interval` s at most.
    pub fn register(&mut self, key: &str, interval: f64) {
        self.request(Kind::REGISTER, key, interval);
    }

    /// Takes that back.
    pub fn unregister(&mut self, key: &str) {
        self.request(Kind::UNREGISTER, key, -1.0);
    }

    fn request(&mut self, kind: Kind, key: &str, number: f64) {
        self.say_own(Message { key: key.as_bytes(), number, ..Message::new(kind, Data::DOUBLE) });
    }

    /// Asks the server something: `ALL`, `VAR_SUMMARY`, `PROC_SUMMARY`.
    pub fn ask(&mut self, what: &str) {
        let message = Message::new(Kind::SERVER_REQUEST, Data::STRING);
        self.say(&Message { id: REQUEST_ID, key: what.as_bytes(), ..message });
    }

    /// Publishes a number.
    pub fn notify_number(&mut self, key: &str, number: f64) {
        self.notify(Message { key: key.as_bytes(), number, ..Message::new(Kind::NOTIFY, Data::DOUBLE) });
    }

    /// Publishes a text.
    pub fn notify_text(&mut self, key: &str, text: &str) {
        let message = Message::new(Kind::NOTIFY, Data::STRING);
        self.notify(Message { key: key.as_bytes(), value: text.as_bytes(), ..message });
    }

    /// Publishes bytes.
    pub fn notify_bytes(&mut self, key: &str, bytes: &[u8]) {
        self.notify(Message { key: key.as_bytes(), value: bytes, ..Message::new(Kind::NOTIFY, Data::BINARY) });
    }

    /// Publishes bytes, which are not copied, and sends them at once with all that waits.
    ///
    /// # Errors
    /// The server is gone.
    pub fn send_bytes(&mut self, key: &str, bytes: &[u8]) -> Result<(), ClientError> {
        let name = std::mem::take(&mut self.name);
        let message = Message {
            id: self.next_id,
            source: name.as_bytes(),
            key: key.as_bytes(),
            time: self.time(),
            value: bytes,
            ..Message::new(Kind::NOTIFY, Data::BINARY)
        };
        message.put_without_value(&mut self.outbox);
        (self.name, self.waiting, self.next_id) = (name, self.waiting + 1, self.next_id + 1);
        self.flush_with(bytes)
    }

    fn notify(&mut self, message: Message<'_>) {
        self.say_own(Message { id: self.next_id, ..message });
        self.next_id += 1;
    }

    /// Says a message under the client's name, at its time.
    fn say_own(&mut self, message: Message<'_>) {
        let name = std::mem::take(&mut self.name);
        self.say(&Message { source: name.as_bytes(), time: self.time(), ..message });
        self.name = name;
    }

    /// Bytes that wait to be sent.
    pub fn waiting_bytes(&self) -> usize {
        self.outbox.len() - HEADER
    }

    /// Sends what waits, as one packet; an asynchronous client's sign of life with it, if it is time.
    ///
    /// # Errors
    /// The server is gone.
    pub fn flush(&mut self) -> Result<(), ClientError> {
        self.flush_with(&[])
    }

    /// … with the value of the last message, which is not in the outbox.
    fn flush_with(&mut self, value: &[u8]) -> Result<(), ClientError> {
        let is_due = self.beaten.as_ref().is_none_or(|last| last.elapsed() >= BEAT_EVERY);
        if self.manner == Manner::Asynchronous && is_due {
            self.beat();
        }
        if self.waiting > 0 {
            let header = header(self.outbox.len() + value.len(), self.waiting);
            self.outbox[..HEADER].copy_from_slice(&header);
            let mut pieces = &mut [IoSlice::new(&self.outbox), IoSlice::new(value)][..];
            while !pieces.is_empty() {
                match self.socket.write_vectored(pieces) {
                    Ok(0) => return Err(ClientError::Closed),
                    Ok(bytes) => IoSlice::advance_slices(&mut pieces, bytes),
                    Err(error) if error.kind() == ErrorKind::Interrupted => {}
                    Err(error) => return Err(error.into()),
                }
            }
            self.outbox.truncate(HEADER);
            self.waiting = 0;
        }
        Ok(())
    }

    /// Puts a sign of life in front of what waits.
    fn beat(&mut self) {
        let mut beat = vec![0; HEADER];
        let message = Message::new(Kind::TIMING, Data::DOUBLE);
        Message { key: b"_async_timing", time: self.time(), number: 0.0, ..message }.put(&mut beat);
        beat.extend_from_slice(&self.outbox[HEADER..]);
        self.outbox = beat;
        self.waiting += 1;
        self.beaten = Some(Stopwatch::start());
    }

    /// A synchronous client's turn: sends what waits, or an empty request, and waits for the packet that answers it. What
    /// comes is handed to `take`, the server's clock too.
    ///
    /// # Errors
    /// The server is gone, or does not answer.
    pub fn exchange(&mut self, mut take: impl FnMut(&Message<'_>)) -> Result<(), ClientError> {
        if self.waiting == 0 {
            self.say(&Message::new(Kind::NULL, Data::NOT_SET));
        }
        self.flush()?;
        let mut packets = 0;
        while packets == 0 {
            packets = self.read(PATIENCE, &mut take)?.ok_or(ClientError::Silent)?;
        }
        Ok(())
    }

    /// What has come, waiting at most `timeout` for it; answers whether anything has. Signs of life are given and answered
    /// here; all else is handed to `take`.
    ///
    /// # Errors
    /// The server is gone.
    pub fn receive(&mut self, timeout: Duration, mut take: impl FnMut(&Message<'_>)) -> Result<bool, ClientError> {
        self.flush()?;
        let mut any = false;
        self.read(timeout, &mut |message| {
            if message.kind != Kind::TIMING {
                any = true;
                take(message);
            }
        })?;
        Ok(any)
    }

    /// All that comes, signs of life and all, from one look into the socket; how many packets ended with it. `None`: nothing
    /// came in time.
    ///
    /// # Errors
    /// The server is gone.
    pub fn read(
        &mut self,
        timeout: Duration,
        take: &mut dyn FnMut(&Message<'_>),
    ) -> Result<Option<usize>, ClientError> {
        let timeout = Some(timeout.max(Duration::from_millis(1)));
        if self.timeout != timeout {
            self.socket.set_read_timeout(timeout)?;
            self.timeout = timeout;
        }
        match self.decoder.read_from(&self.socket, READ_BYTES) {
            Ok(0) => return Err(ClientError::Closed),
            Ok(_) => {}
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => return Ok(None),
            Err(error) if error.kind() == ErrorKind::Interrupted => return Ok(Some(0)),
            Err(error) => return Err(error.into()),
        }
        let mut packets = 0;
        while let Some(event) = self.decoder.next_event()? {
            match event {
                Event::Message { message, .. } => take(&message),
                Event::End => packets += 1,
                Event::Greeting | Event::TooLong { .. } => {}
            }
        }
        Ok(Some(packets))
    }

    /// The socket: to write what no client should.
    pub fn socket(&self) -> &TcpStream {
        &self.socket
    }
}
