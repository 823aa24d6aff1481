//! What clients of MOOS' see of a broker that is killed.

use std::io::ErrorKind;
use std::net::{SocketAddr, TcpStream};

use elk_bus::moos::client::{ClientError, MoosClient};
use elk_bus::moos::hello::Manner;
use elk_bus::{Community, ConnectError};
use rustix::process::{Pid, Signal, kill_process};

use crate::common::broker_with_moos;
use crate::common::events::once_served;
use crate::server::wait_for_end;

/// Connects as soon as the broker serves: it listens before that.
fn connect(community: &Community, address: SocketAddr) -> MoosClient {
    let connect = || match MoosClient::connect(address, "nav", Manner::Asynchronous) {
        Err(ClientError::Io(_) | ClientError::Closed) => Err(ConnectError::NoBroker(community.clone())),
        connected => Ok(connected.unwrap()),
    };
    once_served(community, connect).unwrap()
}

/// Regression: the socket that a killed broker listened at ended after those of its clients. MOOS' own connect again in that
/// moment, are cut off in the midst of their handshake, and stop for good: half of them were lost with each broker.
#[test]
fn who_comes_back_at_once_is_refused_and_not_let_in_by_the_dead() {
    let community = Community::new(format!("moos-death-{}", std::process::id())).unwrap();
    for round in 0..20 {
        let (mut broker, address) = broker_with_moos(&community);
        let mut client = connect(&community, address);
        broker.kill().unwrap();
        wait_for_end(&mut client, "its broker is gone");
        let again = TcpStream::connect(address);
        broker.wait().unwrap();
        assert!(again.as_ref().is_err_and(|error| error.kind() == ErrorKind::ConnectionRefused), "{round}: {again:?}");
    }
    // The last one clears away what these have left.
    let (mut broker, address) = broker_with_moos(&community);
    drop(connect(&community, address));
    kill_process(Pid::from_child(&broker), Signal::TERM).unwrap();
    assert!(broker.wait().unwrap().success());
}
