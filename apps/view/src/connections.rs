//! Connections of which there are so many at a time, and none on which nothing is heard any more: a page that was left in
//! another network, or one that never was a page, takes nobody's place for long.

use std::io;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use axum::serve::Listener;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::{Instant, Sleep, sleep};

/// Connections at a time: those of as many pages as there may be, and of browsers that fetch its files. More wait.
const MOST: usize = 256;
/// How long nothing may be heard on a connection: a WebSocket is asked for a sign of life each [`PING_EVERY`].
const MOST_SILENCE: Duration = Duration::from_secs(60);
/// How often whoever is at the other end of a WebSocket is asked for a sign of life.
pub(crate) const PING_EVERY: Duration = Duration::from_secs(20);

/// A listener whose connections are bounded.
pub(crate) struct Bounded {
    listener: TcpListener,
    places: Arc<Semaphore>,
    most_silence: Duration,
}

impl Bounded {
    /// Of a socket that listens and does not block.
    ///
    /// # Errors
    /// The runtime cannot wait for it.
    pub fn of(listener: std::net::TcpListener) -> io::Result<Self> {
        Self::with(listener, MOST, MOST_SILENCE)
    }

    fn with(listener: std::net::TcpListener, most: usize, most_silence: Duration) -> io::Result<Self> {
        let listener = TcpListener::from_std(listener)?;
        Ok(Self { listener, places: Arc::new(Semaphore::new(most)), most_silence })
    }
}

impl Listener for Bounded {
    type Io = Connection;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Connection, SocketAddr) {
        // Nobody closes it.
        let place = self.places.clone().acquire_owned().await.ok();
        let (stream, address) = Listener::accept(&mut self.listener).await;
        let silence = Box::pin(sleep(self.most_silence));
        (Connection { stream, silence, most_silence: self.most_silence, _place: place }, address)
    }

    fn local_addr(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }
}

/// A connection that ends when nothing is heard on it.
pub(crate) struct Connection {
    stream: TcpStream,
    /// Ends when it has been silent for too long.
    silence: Pin<Box<Sleep>>,
    most_silence: Duration,
    _place: Option<OwnedSemaphorePermit>,
}

impl AsyncRead for Connection {
    fn poll_read(mut self: Pin<&mut Self>, context: &mut Context<'_>, into: &mut ReadBuf<'_>) -> Poll<io::Result<()>> {
        let read = Pin::new(&mut self.stream).poll_read(context, into);
        if read.is_ready() {
            let until = Instant::now() + self.most_silence;
            self.silence.as_mut().reset(until);
            return read;
        }
        self.silence.as_mut().poll(context).map(|()| Err(io::ErrorKind::TimedOut.into()))
    }
}

impl AsyncWrite for Connection {
    fn poll_write(mut self: Pin<&mut Self>, context: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write(context, bytes)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write_vectored(context, bytes)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }
}

#[cfg(test)]
mod tests {
    use std::io::{Read, Write};

    use super::*;

    /// Serves one word at a listener of so many connections, which may be silent for so long, while `visit` goes there.
    fn served(most: usize, most_silence: Duration, visit: impl FnOnce(SocketAddr) + Send + 'static) {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        listener.set_nonblocking(true).unwrap();
        let address = listener.local_addr().unwrap();
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        runtime.block_on(async {
            let router = axum::Router::new().route("/", axum::routing::get(async || "here"));
            let bounded = Bounded::with(listener, most, most_silence).unwrap();
            let visited = tokio::task::spawn_blocking(move || visit(address));
            tokio::select! {
                served = async { axum::serve(bounded, router).await } => panic!("{served:?}"),
                visited = visited => visited.unwrap(),
            }
        });
    }

    fn connected(address: SocketAddr) -> std::net::TcpStream {
        let stream = std::net::TcpStream::connect(address).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
        stream
    }

    #[test]
    fn who_is_silent_takes_nobodys_place_for_long() {
        served(2, Duration::from_millis(300), |address| {
            let mut silent: Vec<_> = (0..8).map(|_| connected(address)).collect();
            silent.iter_mut().for_each(|one| one.write_all(b"GET / HTTP/1.1\r\nHost: ").unwrap());
            // There are two places, and eight came before.
            let mut visitor = connected(address);
            visitor.write_all(b"GET / HTTP/1.1\r\nHost: here\r\nConnection: close\r\n\r\n").unwrap();
            let mut said = String::new();
            visitor.read_to_string(&mut said).unwrap();
            assert!(said.ends_with("here"), "{said}");
            assert_eq!(silent[0].read(&mut [0]).unwrap_or(0), 0, "it has ended");
        });
    }
}
