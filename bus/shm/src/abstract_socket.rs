//! Connecting to an abstract Unix socket without waiting for whoever listens there: anybody can take such a name, and let
//! its queue fill up.

use std::io::{Error, ErrorKind, Result};
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::time::Duration;

use rustix::io::Errno;
use rustix::net::sockopt::{Timeout, set_socket_timeout};
use rustix::net::{AddressFamily, SocketAddrUnix, SocketFlags, SocketType};

/// Connects to the abstract socket of this name, at once or not at all. The stream itself is blocking.
///
/// # Errors
/// [`ErrorKind::ConnectionRefused`]: nobody listens; [`ErrorKind::WouldBlock`]: somebody does, and more wait there than it
/// takes in.
pub fn connect_now(name: &str) -> Result<UnixStream> {
    let stream = connect_socket(socket(SocketFlags::NONBLOCK)?, name)?;
    stream.set_nonblocking(false)?;
    Ok(stream)
}

/// Connects like [`connect_now`], and waits for `patience` if the queue is full. Writing to the stream has the same
/// patience.
///
/// # Errors
/// Those of [`connect_now`].
pub fn connect(name: &str, patience: Duration) -> Result<UnixStream> {
    let socket = socket(SocketFlags::empty())?;
    set_socket_timeout(&socket, Timeout::Send, Some(patience))?;
    connect_socket(socket, name)
}

fn socket(flags: SocketFlags) -> Result<OwnedFd> {
    Ok(rustix::net::socket_with(AddressFamily::UNIX, SocketType::STREAM, flags | SocketFlags::CLOEXEC, None)?)
}

/// Connects as long as the socket itself waits: not at all, or until its timeout for sending.
fn connect_socket(socket: OwnedFd, name: &str) -> Result<UnixStream> {
    let address = SocketAddrUnix::new_abstract_name(name.as_bytes())?;
    match rustix::io::retry_on_intr(|| rustix::net::connect(&socket, &address)) {
        Ok(()) => Ok(UnixStream::from(socket)),
        Err(Errno::AGAIN) => {
            let full = "its queue is full: more wait there than it takes in; try again, and if that does not help, see \
                        with `ss -xlp` who listens, or choose another --community";
            Err(Error::new(ErrorKind::WouldBlock, full))
        }
        Err(other) => Err(other.into()),
    }
}

#[cfg(test)]
mod tests {
    use std::os::linux::net::SocketAddrExt;
    use std::os::unix::net::{SocketAddr, UnixListener};

    use super::*;

    #[test]
    fn a_full_queue_is_told_from_one_where_nobody_is() {
        let name = format!("elk-socket-test/{}", std::process::id());
        assert_eq!(connect_now(&name).unwrap_err().kind(), ErrorKind::ConnectionRefused);
        let listener = UnixListener::bind_addr(&SocketAddr::from_abstract_name(&name).unwrap()).unwrap();
        rustix::net::listen(&listener, 0).unwrap();
        let queue: Vec<UnixStream> = std::iter::from_fn(|| connect_now(&name).ok()).collect();
        assert!(!queue.is_empty());
        let error = connect(&name, Duration::from_millis(12)).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::WouldBlock);
        assert!(error.to_string().starts_with("its queue is full:"), "{error}");
        // Whoever waits comes in when one is let in.
        let waits = std::thread::spawn(move || connect(&name, Duration::from_secs(60)).is_ok());
        let _in = listener.accept().unwrap();
        assert!(waits.join().unwrap());
    }
}
