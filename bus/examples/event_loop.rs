//! A client in somebody's event loop: mail, and what else the loop waits for, in one `poll`.

use std::collections::BTreeSet;
use std::error::Error;
use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::time::Duration;

use elk_bus::memory::MemoryBroker;
use elk_bus::{BrokerConfig, Client, Clock, Community};
use rustix::event::{PollFd, PollFlags, poll};

/// Runs it.
pub fn main() -> Result<(), Box<dyn Error>> {
    let community = Community::new("event-loop")?;
    let broker = MemoryBroker::new(BrokerConfig::new("event-loop"), Clock::new(1.0));
    let join = |name: &str| -> Result<_, Box<dyn Error>> { Ok(Client::over(broker.connect(name)?, name, &community)) };
    let (mut reader, mut writer) = (join("reader")?, join("writer")?);
    let (mut socket, mut other_end) = UnixStream::pair()?;

    reader.comms.register("GREETING")?;
    reader.comms.flush()?;
    writer.comms.notify("GREETING", "hello over the bus")?;
    writer.comms.flush()?;
    other_end.write_all(b"hello over a socket")?;

    let mut heard = BTreeSet::new();
    while heard.len() < 2 {
        let (mail_waits, socket_is_ready) = wait(&mut reader, &socket)?;
        if mail_waits {
            // Receiving, with no time to wait, is what makes the descriptor unreadable again.
            reader.receive(Duration::ZERO, |mail| heard.extend(mail.as_text().map(str::to_owned)))?;
        }
        if socket_is_ready {
            let mut bytes = [0; 64];
            let count = socket.read(&mut bytes)?;
            heard.insert(String::from_utf8(bytes[..count].to_vec())?);
        }
    }
    println!("{heard:?}");
    assert!(heard.iter().eq(["hello over a socket", "hello over the bus"]));
    Ok(())
}

/// Waits until there is something to read: mail, or bytes of the socket.
fn wait(client: &mut Client, socket: &UnixStream) -> Result<(bool, bool), Box<dyn Error>> {
    let mut waited_for =
        [PollFd::from_borrowed_fd(client.wake_fd()?, PollFlags::IN), PollFd::new(socket, PollFlags::IN)];
    poll(&mut waited_for, None)?;
    let [mail, socket] = waited_for.map(|fd| fd.revents().contains(PollFlags::IN));
    Ok((mail, socket))
}
