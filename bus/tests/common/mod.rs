//! A broker in a process of its own, which is the test's program again.
#![allow(dead_code, reason = "each test program uses its part of it")]

pub mod events;

use std::io::{BufRead, BufReader, Read, Write};
use std::net::SocketAddr;
use std::process::{Child, Command, Stdio};

use elk_bus::moos::gateway::{GatewayOptions, Listening};
use elk_bus::{BrokerConfig, Clock, Community, serve_broker_at};

const SERVE: &str = "ELK_TEST_SERVES";
/// Set: clients of MOOS' may come, too.
const MOOS: &str = "ELK_TEST_SERVES_MOOS";
/// What stands before the address that they come to.
const LISTENS: &str = "listens at ";

/// What a test called `broker_process` does: serves, if this process was started by [`broker_of`].
pub fn serve_if_asked_to() {
    if let Ok(name) = std::env::var(SERVE) {
        let moos = std::env::var_os(MOOS).map(|_| {
            let listening = Listening::at(GatewayOptions::new("127.0.0.1:0".parse().unwrap())).unwrap();
            // Not by a macro, whose words the test's own program keeps to itself.
            let address = format!("{LISTENS}{}\n", listening.address().unwrap());
            std::io::stdout().write_all(address.as_bytes()).unwrap();
            listening
        });
        serve_broker_at(Community::new(&*name).unwrap(), BrokerConfig::new(name), Clock::new(1.0), moos).unwrap();
    }
}

/// Starts the broker of a community; the test's program needs a test called `broker_process` for it.
pub fn broker_of(community: &Community) -> Child {
    broker_that_says(community, Stdio::inherit())
}

/// … that clients of MOOS' may come to as well, and where to.
pub fn broker_with_moos(community: &Community) -> (Child, SocketAddr) {
    let mut command = serving(community);
    let mut child = command.env(MOOS, "").stdout(Stdio::piped()).spawn().unwrap();
    let mut said = BufReader::new(child.stdout.take().unwrap());
    let lines = said.by_ref().lines().map_while(Result::ok);
    let address = lines.filter_map(|line| Some(line.split_once(LISTENS)?.1.parse().unwrap())).next();
    child.stdout = Some(said.into_inner());
    (child, address.expect("it says where it listens"))
}

/// … that says there what it has to say.
pub fn broker_that_says(community: &Community, said: impl Into<Stdio>) -> Child {
    serving(community).stderr(said).spawn().unwrap()
}

fn serving(community: &Community) -> Command {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["--exact", "broker_process"]).env(SERVE, community.as_str()).stdout(Stdio::null());
    command
}
