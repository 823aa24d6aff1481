//! Who is there: an abstract Unix socket named after the community. Its name is the community's lock, a connection is a
//! client's life, and nothing of it can be left behind.

use std::io::{ErrorKind, IoSliceMut, Read, Write};
use std::mem::MaybeUninit;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixListener, UnixStream};
use std::path::PathBuf;
use std::time::Duration;

use elk_proto::ClockSetting;
use elk_proto::codec;
use elk_proto::community::Community;
use rustix::net::{
    RecvAncillaryBuffer, RecvAncillaryMessage, RecvFlags, SendAncillaryBuffer, SendAncillaryMessage, SendFlags,
};
use serde::{Deserialize, Serialize, de::DeserializeOwned};

use super::abstract_socket;

/// Counts up whenever lanes, pages or frames change.
pub const PROTOCOL: u32 = 7;
/// How long a broker waits for a client's word.
pub const PATIENCE: Duration = Duration::from_secs(5);
/// How long a client waits for the broker's: it lets in one after the other, and where many come to a machine that has much else to
/// do, that takes seconds.
pub const ANSWER_PATIENCE: Duration = Duration::from_secs(20);
/// The longest message of the handshake (bytes).
const MAX_BYTES: usize = 64 << 10;

/// Client to broker.
#[derive(Debug, Serialize, Deserialize)]
pub struct Hello {
    pub protocol: u32,
    pub name: String,
    pub build: String,
    /// See [`elk_proto::broker::Introduction`].
    pub lease_secs: f64,
    pub succeeds: bool,
    pub returns: bool,
}

/// Broker to client; the pages' files come with an acceptance.
#[derive(Debug, Serialize, Deserialize)]
pub enum Answer {
    Welcome {
        id: u32,
        epoch: u64,
        warp: f64,
        /// What the community's clock is set to, if somebody drives it.
        clock_setting: Option<ClockSetting>,
        /// Where the community's files are, whatever the client's environment says of folders.
        folder: PathBuf,
    },
    Refused {
        reason: String,
    },
}

/// The name of the abstract socket that the broker of a community listens on.
fn name(community: &Community) -> String {
    format!("elk/{community}")
}

/// Takes the community's name, if nobody has it.
pub fn listen(community: &Community) -> std::io::Result<UnixListener> {
    UnixListener::bind_addr(&SocketAddr::from_abstract_name(name(community))?)
}

/// Connects to the community's broker, if it takes one more at once.
pub fn connect_now(community: &Community) -> std::io::Result<UnixStream> {
    abstract_socket::connect_now(&name(community))
}

/// Whether nobody has the community's name. Whoever has it need not take anybody in.
pub fn nobody_listens(community: &Community) -> bool {
    connect_now(community).is_err_and(|error| error.kind() == std::io::ErrorKind::ConnectionRefused)
}

/// Connects to the community's broker, and waits for a while if too many others do.
pub fn connect(community: &Community) -> std::io::Result<UnixStream> {
    let stream = abstract_socket::connect(&name(community), ANSWER_PATIENCE)?;
    stream.set_read_timeout(Some(ANSWER_PATIENCE))?;
    Ok(stream)
}

/// A handshake's error; of one that was waited for in vain what may be the reason.
pub fn failure(error: std::io::Error) -> std::io::Error {
    match error.kind() {
        ErrorKind::WouldBlock | ErrorKind::TimedOut => std::io::Error::new(
            ErrorKind::TimedOut,
            format!(
                "nothing for {} s; is its process stopped, or the machine much too busy?",
                ANSWER_PATIENCE.as_secs()
            ),
        ),
        _ => error,
    }
}

/// Sends a message, and files with it.
pub fn send<T: Serialize>(stream: &UnixStream, message: &T, files: &[BorrowedFd<'_>]) -> std::io::Result<()> {
    let mut bytes = vec![0; 4];
    codec::encode_onto(message, &mut bytes).map_err(std::io::Error::other)?;
    let len = (bytes.len() - 4) as u32;
    bytes[..4].copy_from_slice(&len.to_le_bytes());
    let mut space = [MaybeUninit::uninit(); rustix::cmsg_space!(ScmRights(2))];
    let mut ancillary = SendAncillaryBuffer::new(&mut space);
    if !files.is_empty() {
        ancillary.push(SendAncillaryMessage::ScmRights(files));
    }
    let sent = rustix::net::sendmsg(stream, &[std::io::IoSlice::new(&bytes)], &mut ancillary, SendFlags::NOSIGNAL)?;
    let mut stream = stream;
    stream.write_all(&bytes[sent..])
}

/// Receives a message, and the files that came with it.
pub fn receive<T: DeserializeOwned>(stream: &UnixStream) -> std::io::Result<(T, Vec<OwnedFd>)> {
    let mut len = [0; 4];
    let mut files = Vec::new();
    let mut space = [MaybeUninit::uninit(); rustix::cmsg_space!(ScmRights(2))];
    let mut ancillary = RecvAncillaryBuffer::new(&mut space);
    let flags = RecvFlags::CMSG_CLOEXEC;
    let got = rustix::io::retry_on_intr(|| {
        rustix::net::recvmsg(stream.as_fd(), &mut [IoSliceMut::new(&mut len)], &mut ancillary, flags)
    })?
    .bytes;
    for message in ancillary.drain() {
        if let RecvAncillaryMessage::ScmRights(rights) = message {
            files.extend(rights);
        }
    }
    if got == 0 {
        return Err(std::io::ErrorKind::UnexpectedEof.into());
    }
    let mut stream = stream;
    stream.read_exact(&mut len[got..])?;
    let len = u32::from_le_bytes(len) as usize;
    if len > MAX_BYTES {
        return Err(std::io::Error::other(format!("a message of {len} bytes is no handshake")));
    }
    let mut bytes = vec![0; len];
    stream.read_exact(&mut bytes)?;
    let message = codec::decode_owned(&bytes, "handshake message").map_err(std::io::Error::other)?;
    Ok((message, files))
}

/// Whether the other end has closed the connection.
pub fn hung_up(stream: &UnixStream) -> bool {
    let mut byte = [0; 1];
    let flags = RecvFlags::PEEK | RecvFlags::DONTWAIT;
    match rustix::net::recv(stream, &mut byte[..], flags) {
        Ok((n, _)) => n == 0,
        Err(e) => e != rustix::io::Errno::AGAIN && e != rustix::io::Errno::INTR,
    }
}

/// Returns when the other end is gone.
pub fn wait_for_end(mut stream: &UnixStream) {
    let mut byte = [0; 1];
    loop {
        match stream.read(&mut byte) {
            Ok(n) if n > 0 => {}
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
            _ => return,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_first_word_is_no_longer_than_a_handshake_s() {
        let (mut liar, broker) = UnixStream::pair().unwrap();
        liar.write_all(&(MAX_BYTES as u32 + 1).to_le_bytes()).unwrap();
        // Nothing of it is waited for.
        drop(liar);
        let said = receive::<Hello>(&broker).unwrap_err().to_string();
        assert_eq!(said, "a message of 65537 bytes is no handshake");
    }

    /// Regression: "Resource temporarily unavailable (os error 11)" was all that was said.
    #[test]
    fn of_a_broker_that_says_nothing_it_is_said_what_may_be_the_reason() {
        let (ours, _theirs) = UnixStream::pair().unwrap();
        ours.set_read_timeout(Some(Duration::from_millis(1))).unwrap();
        let error = failure(receive::<Answer>(&ours).unwrap_err());
        assert_eq!(error.kind(), ErrorKind::TimedOut);
        assert!(error.to_string().contains("is its process stopped, or the machine much too busy?"), "{error}");
        let other = failure(std::io::Error::other("odd"));
        assert_eq!(other.to_string(), "odd");
    }
}
