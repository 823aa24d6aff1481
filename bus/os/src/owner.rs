//! Whose a process is.

use std::os::unix::net::UnixStream;

/// A process and its user, as the kernel knows them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Owner {
    /// The process' number.
    pub process: u32,
    /// The user that it runs as.
    pub user: u32,
}

impl Owner {
    /// Who is at the other end of a socket.
    ///
    /// # Errors
    /// The kernel does not say.
    pub fn at_other_end(stream: &UnixStream) -> std::io::Result<Self> {
        let found = rustix::net::sockopt::socket_peercred(stream)?;
        Ok(Self { process: found.pid.as_raw_nonzero().get().cast_unsigned(), user: found.uid.as_raw() })
    }
}

/// The user that this process runs as.
pub fn own_user() -> u32 {
    rustix::process::geteuid().as_raw()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn at_the_other_end_of_a_pair_is_this_process() {
        let (one, _other) = UnixStream::pair().unwrap();
        assert_eq!(Owner::at_other_end(&one).unwrap(), Owner { process: std::process::id(), user: own_user() });
    }
}
