//! The memory between the format and the disk: a disk that is full for a while costs no message.
//!
//! An MCAP writer whose file failed once refuses all further work. So it writes here, which never fails, and the file
//! is always a prefix of what it wrote: the rest waits for the disk to take it.

use std::io::{ErrorKind, Write};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Bytes on their way to the disk; clones share them.
#[derive(Debug, Clone, Default)]
pub(crate) struct Staging(Arc<Mutex<Vec<u8>>>);

impl Staging {
    fn bytes(&self) -> MutexGuard<'_, Vec<u8>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Number of bytes that wait.
    pub fn len(&self) -> usize {
        self.bytes().len()
    }

    /// Hands all that waits to `file`; what it does not take goes on waiting.
    pub fn drain_into(&self, file: &mut impl Write) -> std::io::Result<()> {
        let mut bytes = self.bytes();
        let mut written = 0;
        let outcome = loop {
            match file.write(&bytes[written..]) {
                _ if written == bytes.len() => break Ok(()),
                Ok(0) => break Err(ErrorKind::WriteZero.into()),
                Ok(count) => written += count,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => break Err(error),
            }
        };
        bytes.drain(..written);
        outcome
    }
}

impl Write for Staging {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.bytes().extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A disk with room for so many bytes more.
    struct Disk {
        room: usize,
        bytes: Vec<u8>,
    }

    impl Write for Disk {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            let taken = bytes.len().min(self.room);
            if taken == 0 && !bytes.is_empty() {
                return Err(ErrorKind::StorageFull.into());
            }
            self.room -= taken;
            self.bytes.extend_from_slice(&bytes[..taken]);
            Ok(taken)
        }

        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn what_a_full_disk_refuses_waits_for_room() {
        let mut staging = Staging::default();
        let mut disk = Disk { room: 4, bytes: Vec::new() };
        staging.write_all(b"elk stag").unwrap();
        let error = staging.drain_into(&mut disk).unwrap_err();
        assert_eq!((error.kind(), staging.len()), (ErrorKind::StorageFull, 4));
        staging.write_all(b" hind").unwrap();
        disk.room = 100;
        staging.drain_into(&mut disk).unwrap();
        assert_eq!((disk.bytes.as_slice(), staging.len()), (&b"elk stag hind"[..], 0));
    }
}
