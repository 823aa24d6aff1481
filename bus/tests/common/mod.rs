//! A broker in a process of its own, which is the test's program again.
#![allow(dead_code, reason = "each test program uses its part of it")]

pub mod events;

use std::process::{Child, Command, Stdio};

use elk_bus::{BrokerConfig, Clock, Community, serve_broker};

const SERVE: &str = "ELK_TEST_SERVES";

/// What a test called `broker_process` does: serves, if this process was started by [`broker_of`].
pub fn serve_if_asked_to() {
    if let Ok(name) = std::env::var(SERVE) {
        serve_broker(Community::new(&*name).unwrap(), BrokerConfig::new(name), Clock::new(1.0)).unwrap();
    }
}

/// Starts the broker of a community; the test's program needs a test called `broker_process` for it.
pub fn broker_of(community: &Community) -> Child {
    broker_that_says(community, Stdio::inherit())
}

/// … that says there what it has to say.
pub fn broker_that_says(community: &Community, said: impl Into<Stdio>) -> Child {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["--exact", "broker_process"]).env(SERVE, community.as_str()).stdout(Stdio::null()).stderr(said);
    command.spawn().unwrap()
}
