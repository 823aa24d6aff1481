//! Connecting to an abstract Unix socket without waiting for whoever listens there: anybody can take such a name, and let
//! its queue fill up.

use std::io::{Error, ErrorKind, Result};
use std::os::unix::net::UnixStream;
use std::time::Duration;

use rustix::net::{AddressFamily, SocketAddrUnix, SocketFlags, SocketType};

use crate::clock::Stopwatch;

/// How often a full queue is tried again.
const AGAIN_EVERY: Duration = Duration::from_millis(3);

/// Connects to the abstract socket of this name, at once or not at all. The stream itself is blocking.
///
/// # Errors
/// [`ErrorKind::ConnectionRefused`]: nobody listens; [`ErrorKind::WouldBlock`]: somebody does, and more wait there than it
/// takes in.
pub fn knock(name: &str) -> Result<UnixStream> {
    let address = SocketAddrUnix::new_abstract_name(name.as_bytes())?;
    let flags = SocketFlags::CLOEXEC | SocketFlags::NONBLOCK;
    let socket = rustix::net::socket_with(AddressFamily::UNIX, SocketType::STREAM, flags, None)?;
    rustix::io::retry_on_intr(|| rustix::net::connect(&socket, &address)).map_err(|errno| match errno {
        rustix::io::Errno::AGAIN => {
            let full = "its door is full: more wait there than it takes in; try again, and if that does not help, see \
                        with `ss -xlp` who listens";
            Error::new(ErrorKind::WouldBlock, full)
        }
        other => other.into(),
    })?;
    let stream = UnixStream::from(socket);
    stream.set_nonblocking(false)?;
    Ok(stream)
}

/// Connects like [`knock`], and tries for `patience` if the queue is full.
///
/// # Errors
/// Those of [`knock`].
pub fn wait_at(name: &str, patience: Duration) -> Result<UnixStream> {
    let waited = Stopwatch::start();
    loop {
        match knock(name) {
            Err(error) if error.kind() == ErrorKind::WouldBlock && waited.elapsed() < patience => {
                std::thread::sleep(AGAIN_EVERY);
            }
            found => return found,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::os::linux::net::SocketAddrExt;
    use std::os::unix::net::{SocketAddr, UnixListener};

    use super::*;

    #[test]
    fn a_full_door_is_told_from_one_where_nobody_is() {
        let name = format!("elk-door-test/{}", std::process::id());
        assert_eq!(knock(&name).unwrap_err().kind(), ErrorKind::ConnectionRefused);
        let listener = UnixListener::bind_addr(&SocketAddr::from_abstract_name(&name).unwrap()).unwrap();
        rustix::net::listen(&listener, 0).unwrap();
        let queue: Vec<UnixStream> = std::iter::from_fn(|| knock(&name).ok()).collect();
        assert!(!queue.is_empty());
        let error = wait_at(&name, 4 * AGAIN_EVERY).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::WouldBlock);
        assert!(error.to_string().starts_with("its door is full:"), "{error}");
        // Whoever waits comes in when one is let in.
        let waits = std::thread::spawn(move || wait_at(&name, Duration::from_secs(60)).is_ok());
        let _in = listener.accept().unwrap();
        assert!(waits.join().unwrap());
    }
}
