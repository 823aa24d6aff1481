//! One hop over a plain `AF_UNIX` stream socket: the floor.

use std::io::{ErrorKind, Read, Write};
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixListener, UnixStream};
use std::time::Duration;

use crate::load::Load;
use crate::transport::{BenchResult, Intake, Outlet};

/// What a reader takes from the socket at once (bytes).
const READ_AT_ONCE: usize = 64 << 10;

fn address(namespace: &str, reader: usize) -> BenchResult<SocketAddr> {
    Ok(SocketAddr::from_abstract_name(format!("{namespace}/{reader}"))?)
}

/// A stream to each reader.
pub struct StreamOutlet {
    streams: Vec<UnixStream>,
    gathered: Vec<u8>,
}

impl StreamOutlet {
    /// Connects to readers that listen already.
    pub fn open(namespace: &str, readers: usize) -> BenchResult<Self> {
        let connect = |reader| Ok(UnixStream::connect_addr(&address(namespace, reader)?)?);
        Ok(Self { streams: (0..readers).map(connect).collect::<BenchResult<_>>()?, gathered: Vec::new() })
    }
}

impl Outlet for StreamOutlet {
    fn send(&mut self, message: &[u8]) -> BenchResult {
        self.gathered.extend_from_slice(message);
        if self.gathered.len() >= READ_AT_ONCE { self.flush() } else { Ok(()) }
    }

    fn flush(&mut self) -> BenchResult {
        for stream in &mut self.streams {
            stream.write_all(&self.gathered)?;
        }
        self.gathered.clear();
        Ok(())
    }
}

/// The reading end; the publisher connects when it comes.
pub struct StreamIntake {
    listener: UnixListener,
    stream: Option<UnixStream>,
    message_bytes: usize,
    buffer: Vec<u8>,
    filled: usize,
}

impl StreamIntake {
    /// Listens.
    pub fn open(namespace: &str, reader: usize, load: &Load) -> BenchResult<Self> {
        let listener = UnixListener::bind_addr(&address(namespace, reader)?)?;
        let buffer = vec![0; load.bytes.max(READ_AT_ONCE)];
        Ok(Self { listener, stream: None, message_bytes: load.bytes, buffer, filled: 0 })
    }

    fn fill(&mut self, timeout: Duration) -> BenchResult {
        if self.stream.is_none() {
            let (stream, _) = self.listener.accept()?;
            stream.set_read_timeout(Some(timeout))?;
            self.stream = Some(stream);
        }
        let Some(stream) = &mut self.stream else { return Ok(()) };
        match stream.read(&mut self.buffer[self.filled..]) {
            Ok(0) => Err("the publisher hung up".into()),
            Ok(n) => {
                self.filled += n;
                Ok(())
            }
            Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => Ok(()),
            Err(e) => Err(e.into()),
        }
    }
}

impl Intake for StreamIntake {
    fn receive(&mut self, timeout: Duration, on_message: &mut dyn FnMut(&[u8])) -> BenchResult {
        self.fill(timeout)?;
        let whole = self.filled - self.filled % self.message_bytes;
        self.buffer[..whole].chunks_exact(self.message_bytes).for_each(on_message);
        self.buffer.copy_within(whole..self.filled, 0);
        self.filled -= whole;
        Ok(())
    }
}
