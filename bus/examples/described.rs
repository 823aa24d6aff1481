//! A type that describes itself: who has never seen it reads its values field by field, with units, and is told what each is.

use std::error::Error;
use std::time::Duration;

use elk_bus::memory::MemoryBroker;
use elk_bus::{BrokerConfig, Client, Clock, Community, Key, ValueRef, any, payload};

/// How a battery is.
#[payload]
pub struct Battery {
    /// What is left in it.
    #[describe(unit = "%", range = 0.0..=100.0)]
    pub charge: f64,
    /// Its cells.
    pub cells: Vec<Cell>,
}

/// One cell of a battery.
#[payload]
pub struct Cell {
    /// Between its poles.
    #[describe(unit = "V")]
    pub voltage: f64,
}

const BATTERY: Key<Battery> = Key::new("BATTERY");

/// Runs it.
pub fn main() -> Result<(), Box<dyn Error>> {
    let community = Community::new("described")?;
    let broker = MemoryBroker::new(BrokerConfig::new("described"), Clock::new(1.0));
    let join = |name: &str| -> Result<_, Box<dyn Error>> { Ok(Client::over(broker.connect(name)?, name, &community)) };
    let (mut robot, mut stranger) = (join("robot")?, join("stranger")?);

    let cells = vec![Cell { voltage: 3.7 }, Cell { voltage: 3.6 }];
    robot.comms.publish(&BATTERY, &Battery { charge: 80.0, cells })?;
    robot.comms.flush()?;

    // From here on nobody knows `Battery`: what is shown came over the bus.
    stranger.comms.register(any("BAT*"))?;
    let mut seen = Vec::new();
    while seen.is_empty() {
        stranger.receive(Duration::from_secs(1), |mail| {
            if let ValueRef::Binary { type_, .. } = mail.value() {
                seen.push((type_.text(), mail.value().to_json(10).map(|value| value.to_string())));
            }
        })?;
    }
    let (description, value) = seen.remove(0);
    let value = value?;
    println!("{description}\n{value}");
    assert_eq!(value, r#"{"charge":80.0,"cells":[{"voltage":3.7},{"voltage":3.6}]}"#);
    assert!(description.contains("What is left in it.") && description.contains('%'));
    Ok(())
}
