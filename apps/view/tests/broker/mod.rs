//! A broker as a process of its own: the test program once more, in its other role.

#[path = "../../../../bus/tests/common/events.rs"]
mod events;

use std::process::{Child, Command, Stdio};

use elk_bus::{BrokerConfig, Client, Clock, Community, serve_broker};
use events::once_served;

/// Names the community of a process that is a broker.
const ROLE: &str = "ELK_TEST_BROKER";

/// Starts one.
pub fn broker(community: &Community) -> Child {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["--exact", "broker::role"]).env(ROLE, community.as_str()).stdout(Stdio::null()).spawn().unwrap()
}

/// A client of a broker that was started.
pub fn client(community: &Community, name: &str) -> Client {
    once_served(community, || Client::connect(community, name)).unwrap()
}

/// The broker, if this process was started as one.
#[test]
fn role() {
    if let Ok(name) = std::env::var(ROLE) {
        let community = Community::new(name).unwrap();
        serve_broker(community.clone(), BrokerConfig::new(community.as_str()), Clock::new(1.0)).unwrap();
    }
}
