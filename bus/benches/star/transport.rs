//! What a way for messages offers to the two ends of it.

use std::time::Duration;

/// What anything here may fail with: it is told to the person who measures.
pub type BenchResult<T = ()> = Result<T, Box<dyn std::error::Error>>;

/// The publisher's end.
pub trait Outlet {
    /// Hands a message over; it may wait for others until [`Outlet::flush`].
    fn send(&mut self, message: &[u8]) -> BenchResult;
    /// Lets everything go.
    fn flush(&mut self) -> BenchResult;
}

/// A reader's end.
pub trait Intake {
    /// Sleeps until something comes, at most `timeout`, and hands over each message that has come.
    fn receive(&mut self, timeout: Duration, on_message: &mut dyn FnMut(&[u8])) -> BenchResult;
    /// Messages that the transport itself knows to have been dropped for this reader.
    fn dropped(&self) -> u64 {
        0
    }
}
