//! Clients under tokio, over shared memory: a stream and a sink, side by side on one thread.
#![cfg(feature = "tokio")]

mod common;

use elk_bus::stream::{Publication, StreamClient};
use elk_bus::{Client, Community, Key, payload};
use futures_util::{SinkExt, StreamExt};

/// A count.
#[payload]
#[derive(Debug, PartialEq)]
pub struct Count {
    /// Of something.
    pub count: u64,
}

mod other_build {
    /// The same, as somebody else has it.
    #[elk_bus::payload]
    #[derive(Debug)]
    pub struct Count {
        /// Of something.
        pub count: u32,
    }
}

const COUNT: Key<Count> = Key::new("COUNT");
const MESSAGES: u64 = 2000;

/// Not a test by itself: the broker's process.
#[test]
fn broker_process() {
    common::serve_if_asked_to();
}

#[test]
fn a_stream_hears_all_that_a_sink_says_through_a_brokers_death() {
    let community = Community::new(format!("tokio-{}", std::process::id())).unwrap();
    let said = tempfile::NamedTempFile::new().unwrap();
    let serve = || common::broker_that_says(&community, said.as_file().try_clone().unwrap());
    let mut broker = serve();
    let join = |name: &str| common::events::once_served(&community, || Client::connect(&community, name)).unwrap();
    let (mut reader, writer) = (join("reader"), join("writer"));
    reader.comms.register(&COUNT).unwrap();
    reader.comms.flush().unwrap();
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    runtime.block_on(async {
        let (mut reader, mut writer) = (StreamClient::new(reader).unwrap(), StreamClient::new(writer).unwrap());
        for part in 0..2 {
            let numbers = part * MESSAGES..(part + 1) * MESSAGES;
            let say = async {
                for count in numbers.clone() {
                    writer.send(Publication::of(&COUNT, &Count { count }).unwrap()).await.unwrap();
                    tokio::task::yield_now().await;
                }
            };
            let hear = async {
                for count in numbers.clone() {
                    let mail = reader.next().await.unwrap().unwrap();
                    assert_eq!(mail.decode(&COUNT).unwrap(), Count { count });
                    if count == 0 {
                        let other = mail.decode(&Key::<other_build::Count>::new("COUNT")).unwrap_err().to_string();
                        let ends = other.contains("in writer (") && other.contains("in reader (");
                        assert!(ends && other.contains("u32"), "{other}");
                    }
                }
            };
            // One of them ends first; the other goes on.
            let deadline = std::time::Duration::from_secs(100);
            let both = async { futures_util::join!(say, hear) };
            tokio::time::timeout(deadline, both).await.expect("all of it is heard");
            if part == 0 {
                broker.kill().unwrap();
                broker.wait().unwrap();
                broker = serve();
            }
        }
        writer.close().await.unwrap();
    });
    broker.kill().unwrap();
    broker.wait().unwrap();
}
