//! MOOS' own clients before the real program.

mod common;

use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::time::Duration;

use common::Elk;
use common::events::{Patience, once_served};
use common::small::small;
use elk_bus::moos::client::{ClientError, MoosClient};
use elk_bus::moos::hello::Manner;
use elk_bus::{Community, ConnectError};
use rustix::process::Signal;

/// A port that nobody listens at now.
fn free_port() -> SocketAddr {
    TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap().local_addr().unwrap()
}

/// Connects as soon as the community's broker lets clients of MOOS' in.
fn connect(elk: &Elk, address: SocketAddr, name: &str) -> MoosClient {
    let community = Community::new(elk.community()).unwrap();
    // It listens, and then makes its first files.
    let connect = || match MoosClient::connect(address, name, Manner::Asynchronous) {
        Err(ClientError::Io(_) | ClientError::Closed) => Err(ConnectError::NoBroker(community.clone())),
        connected => Ok(connected.unwrap()),
    };
    once_served(&community, connect).unwrap()
}

#[test]
fn a_client_of_moos_follows_a_mission_and_its_broker_s_death() {
    let (elk, address) = (Elk::new("moos"), free_port());
    let bus = format!("<Bus moos=\"{address}\"/>");
    let mission = elk.launch(&small("manual", &bus));
    let patience = Patience::new();
    // It is registered before anybody has said anything, or is given what was said last.
    let hear = |client: &mut MoosClient, wanted: &str| {
        client.register(wanted, 0.0);
        let mut source = None;
        while source.is_none() {
            patience.left(format_args!("{wanted} is heard"));
            let mut note = |message: &elk_bus::moos::message::Message<'_>| {
                if message.key == wanted.as_bytes() {
                    source = Some(String::from_utf8_lossy(message.source).into_owned());
                }
            };
            client.receive(Duration::from_millis(100), &mut note).unwrap();
        }
        source.unwrap()
    };
    let mut client = connect(&elk, address, "uXMS");
    assert_eq!(hear(&mut client, "DB_CLIENTS"), format!("MOOSDB_{}", elk.community()));
    assert_eq!(hear(&mut client, "SENSOR_STATUS"), "Sensor");
    common::kill(mission.process_with("db\0--community\0"), Signal::KILL);
    while client.receive(Duration::from_millis(100), |_| {}).is_ok() {
        patience.left("the connection ends with the broker");
    }
    // As MOOS' clients do by themselves.
    let mut client = connect(&elk, address, "uXMS");
    assert_eq!(hear(&mut client, "SENSOR_STATUS"), "Sensor", "who was there has come back");
    drop(client);
    common::kill(mission.id(), Signal::TERM);
    mission.end();
    elk.wait_until_deserted();
}

#[test]
fn a_port_that_is_taken_ends_the_broker_with_what_to_do() {
    let elk = Elk::new("moos-taken");
    let taken = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let said = elk.refused(&["db", "--moos", &address]);
    assert!(said.contains("another program does already") && said.contains("choose another port"), "{said}");
    let said = elk.refused(&["db", "--moos", "0.0.0.0:0"]);
    assert!(said.contains("--moos-from"), "{said}");
    let (code, said) = elk.order(&["db", "--moos", "9000"]);
    assert!(code != Some(0) && said.contains("right is HOST:PORT"), "{said}");
}
