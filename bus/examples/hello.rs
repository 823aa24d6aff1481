//! Two clients of one broker: one says where it is, the other hears it, decoded.
//! The broker is in this process; `Client::connect` joins one between processes, which `elk db` serves.

use std::error::Error;
use std::time::Duration;

use elk_bus::memory::MemoryBroker;
use elk_bus::{BrokerConfig, Client, Clock, Community, Key, payload};

/// Where a robot is.
#[payload]
#[derive(Debug, Clone, PartialEq)]
pub struct Position {
    /// East of the start.
    #[describe(unit = "m")]
    pub x: f64,
    /// North of the start.
    #[describe(unit = "m")]
    pub y: f64,
}

const POSITION: Key<Position> = Key::new("POSITION");

/// Runs it.
pub fn main() -> Result<(), Box<dyn Error>> {
    let community = Community::new("hello")?;
    let broker = MemoryBroker::new(BrokerConfig::new("hello"), Clock::new(1.0));
    let join = |name: &str| -> Result<_, Box<dyn Error>> { Ok(Client::over(broker.connect(name)?, name, &community)) };
    let (mut robot, mut viewer) = (join("robot")?, join("viewer")?);

    viewer.comms.register(&POSITION)?;
    viewer.comms.flush()?;
    let here = Position { x: 1.0, y: 2.5 };
    robot.comms.publish(&POSITION, &here)?;
    robot.comms.flush()?;

    let mut heard = None;
    while heard.is_none() {
        viewer.receive(Duration::from_secs(1), |mail| heard = mail.decode(&POSITION).ok())?;
    }
    println!("{heard:?}");
    assert_eq!(heard, Some(here));
    Ok(())
}
