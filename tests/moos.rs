//! MOOS' own clients before the real program.

mod common;

use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use common::events::{Patience, once_served};
use common::small::small;
use common::{Elk, free_port};
use elk_bus::moos::client::{ClientError, MoosClient};
use elk_bus::moos::hello::Manner;
use elk_bus::{Community, ConnectError, any};
use rustix::process::Signal;

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
    let bus = format!("<Bus moos=\"{address}\" texts=\"SIM_*\"/>");
    let mission = elk.launch(&small("manual", &bus));
    let patience = Patience::new();
    // It is registered before anybody has said anything, or is given what was said last.
    let hear = |client: &mut MoosClient, wanted: &str| {
        client.register(wanted, 0.0);
        let mut heard = None;
        while heard.is_none() {
            patience.left(format_args!("{wanted} is heard"));
            let mut note = |message: &elk_bus::moos::message::Message<'_>| {
                if message.key == wanted.as_bytes() {
                    heard =
                        Some([message.source, message.value].map(|text| String::from_utf8_lossy(text).into_owned()));
                }
            };
            client.receive(Duration::from_millis(100), &mut note).unwrap();
        }
        heard.unwrap()
    };
    let mut client = connect(&elk, address, "uXMS");
    assert_eq!(hear(&mut client, "DB_CLIENTS")[0], format!("MOOSDB_{}", elk.community()));
    assert_eq!(hear(&mut client, "SENSOR_STATUS")[0], "Sensor");
    let [_, pose] = hear(&mut client, "SIM_SENSOR");
    let is_pose = |text: &str| text.starts_with("Name=SIM_SENSOR,Command=0,Pose.Rotation=[4x1]{");
    assert!(is_pose(&pose) && pose.contains("},Pose.Translation=[3x1]{"), "{pose}");
    common::kill(mission.process_with("db\0--community\0"), Signal::KILL);
    while client.receive(Duration::from_millis(100), |_| {}).is_ok() {
        patience.left("the connection ends with the broker");
    }
    // As MOOS' clients do by themselves.
    let mut client = connect(&elk, address, "uXMS");
    assert_eq!(hear(&mut client, "SENSOR_STATUS")[0], "Sensor", "who was there has come back");
    assert!(is_pose(&hear(&mut client, "SIM_SENSOR")[1]), "the next broker knows which values are texts");
    drop(client);
    common::kill(mission.id(), Signal::TERM);
    mission.end();
    elk.wait_until_deserted();
}

/// A client of MOOS' that hears numbers, and connects and registers again by itself, as MOOS' clients do.
struct Follower<'a> {
    elk: &'a Elk,
    address: SocketAddr,
    client: MoosClient,
    connections: usize,
    last: f64,
}

impl<'a> Follower<'a> {
    fn start(elk: &'a Elk, address: SocketAddr) -> Self {
        let mut client = connect(elk, address, "uXMS");
        client.register("N", 0.0);
        Self { elk, address, client, connections: 1, last: 0.0 }
    }

    fn look(&mut self) {
        let mut note = |message: &elk_bus::moos::message::Message<'_>| self.last = message.number;
        if self.client.receive(Duration::from_millis(1), &mut note).is_err() {
            let connections = self.connections + 1;
            *self = Self { connections, ..Self::start(self.elk, self.address) };
        }
    }
}

#[test]
fn what_elk_s_clients_say_outlives_the_broker_with_a_client_of_moos_beside_them() {
    const COUNT: u64 = 30_000;
    let (elk, address) = (Elk::new("moos-death"), free_port());
    let mission = elk.launch(&small("manual", &format!("<Bus moos=\"{address}\"/>")));
    let mut moos = Follower::start(&elk, address);
    let mut reader = elk.join("reader");
    reader.comms.register(any("N").lossless()).unwrap();
    // With the answer the registration was taken in.
    common::lab::table(&mut reader);
    let (is_killed, is_over) = (AtomicBool::new(false), AtomicBool::new(false));
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let patience = Patience::new();
            let mut writer = elk.join("writer");
            for n in 1..=COUNT {
                writer.comms.notify("N", n as f64).unwrap();
                if n % 100 == 0 {
                    writer.comms.flush().unwrap();
                }
                // Some is said before the broker's death, some while nobody is there, and some to the next one.
                while n == COUNT / 3 * 2 && !is_killed.load(Ordering::Relaxed) {
                    patience.left("the broker's death");
                    writer.receive(Duration::from_millis(1), |_| {}).unwrap();
                }
            }
            // Whoever has said the last word stays until it was heard.
            while !is_over.load(Ordering::Relaxed) {
                patience.left("the last number");
                writer.receive(Duration::from_millis(1), |_| {}).unwrap();
            }
        });
        let (patience, mut heard) = (Patience::new(), 0);
        while heard < COUNT || moos.last < COUNT as f64 {
            patience.left(format_args!("the last number, after {heard}, and of MOOS' client after {}", moos.last));
            let note = |mail: &elk_bus::Mail<'_>| {
                // The next broker is asked for its table once more.
                if mail.key() == "N" {
                    heard += 1;
                    assert_eq!(mail.as_double(), Some(heard as f64), "none is missing, and none comes twice");
                }
            };
            reader.receive(Duration::from_millis(1), note).unwrap();
            moos.look();
            if heard >= COUNT / 3 && !is_killed.load(Ordering::Relaxed) {
                common::kill(mission.process_with("db\0--community\0"), Signal::KILL);
                is_killed.store(true, Ordering::Relaxed);
            }
        }
        is_over.store(true, Ordering::Relaxed);
    });
    assert_eq!(moos.connections, 2, "it has connected again");
    drop((moos, reader));
    common::kill(mission.id(), Signal::TERM);
    mission.end();
    elk.wait_until_deserted();
}

#[test]
fn what_a_mission_says_to_moos_apps_is_where_they_find_it() {
    let (elk, address) = (Elk::new("moos-port"), free_port());
    let more = format!(
        "<Filter type=\"Distance\"><MOOSHost> localhost </MOOSHost><MOOSPort> {} </MOOSPort></Filter>",
        address.port()
    );
    let mission = elk.launch(&small("manual", &more));
    let client = connect(&elk, address, "uXMS");
    assert_eq!(client.welcomed().community, elk.community());
    drop(client);
    common::kill(mission.id(), Signal::TERM);
    mission.end();
    elk.wait_until_deserted();
    let file = elk.folder().join("small.xml");
    std::fs::write(&file, small("auto", &more)).unwrap();
    let said = elk.refused(&["launch", file.to_str().unwrap(), "--in-process", "--headless"]);
    assert!(said.contains("<Bus moos>, or MOOSHost and MOOSPort, let clients of MOOS' in"), "{said}");
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
