//! The bus itself as a way for messages: a broker's process between the publisher's and the readers'.

use std::time::Duration;

use elk_bus::clock::Stopwatch;
use elk_bus::{BrokerConfig, Client, Clock, Community, Origin, TypeRef, ValueRef, any, serve_broker};

use crate::events::once_served;
use crate::transport::{BenchResult, Intake, Outlet};

/// The variable that is published.
const KEY: &str = "STAR";
const TYPE: &str = "star::Message";
const LAYOUT: u64 = 1;
/// How long the broker may take to answer.
const PATIENCE: Duration = Duration::from_secs(10);

/// Serves until SIGTERM.
pub fn broker(community: &str) -> BenchResult {
    Ok(serve_broker(Community::new(community)?, BrokerConfig::new(community), Clock::new(1.0))?)
}

/// Joins the community as soon as its broker is there.
pub fn join(community: &str, name: &str) -> BenchResult<Client> {
    let community = Community::new(community)?;
    Ok(once_served(&community, || Client::connect(&community, name))?)
}

/// Waits until the broker has done all that the client asked of it so far.
pub fn settle(client: &mut Client) -> BenchResult {
    let mark = format!("MARK_{}", client.comms.name());
    client.comms.register(&mark)?;
    client.comms.notify(&mark, 1.0)?;
    let (waited, mut heard) = (Stopwatch::start(), false);
    while !heard {
        client.receive(Duration::from_millis(100), |mail| heard |= mail.key() == mark)?;
        if waited.elapsed() > PATIENCE {
            return Err("the broker does not answer".into());
        }
    }
    client.comms.unregister(&mark)?;
    Ok(client.comms.flush()?)
}

/// The publishing client.
pub struct ElkOutlet(Client);

impl ElkOutlet {
    /// Joins as the publisher.
    pub fn open(community: &str) -> BenchResult<Self> {
        Ok(Self(join(community, "publisher")?))
    }
}

impl Outlet for ElkOutlet {
    fn send(&mut self, message: &[u8]) -> BenchResult {
        let value = ValueRef::Binary { type_: TypeRef::undescribed(TYPE, LAYOUT), bytes: message };
        Ok(self.0.comms.publish_value(KEY, value, Origin::default())?)
    }

    fn flush(&mut self) -> BenchResult {
        Ok(self.0.comms.flush()?)
    }
}

/// A registered client.
pub struct ElkIntake(Client);

impl ElkIntake {
    /// Joins as a reader; returns when the broker knows the registration.
    pub fn open(community: &str, name: &str, lossless: bool) -> BenchResult<Self> {
        let mut client = join(community, name)?;
        match lossless {
            true => client.comms.register(any(KEY).lossless())?,
            false => client.comms.register(KEY)?,
        }
        settle(&mut client)?;
        Ok(Self(client))
    }
}

impl Intake for ElkIntake {
    fn receive(&mut self, timeout: Duration, on_message: &mut dyn FnMut(&[u8])) -> BenchResult {
        self.0.receive(timeout, |mail| {
            if let ValueRef::Binary { bytes, .. } = mail.value() {
                on_message(bytes);
            }
        })?;
        Ok(())
    }

    fn dropped(&self) -> u64 {
        self.0.inbox.dropped()
    }
}
