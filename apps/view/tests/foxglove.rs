//! Foxglove's clients of a community that runs, over real sockets. What they are told is read by Foxglove's own code.

mod broker;
mod viewer;

use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::Child;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::sync::{Arc, Mutex};

use elk_bus::broker::table::{CommunityTable, REQUEST, TABLE};
use elk_bus::clock::Stopwatch;
use elk_bus::{Client, Community, Key, number};
use elk_geometry::{OccupancyGrid, Pose, State, Voxel};
use elk_spatial::Scan;
use elk_spatial::keys::{MAP_REQUEST, MAP_UPDATE, PROGRESS};
use elk_spatial::map::MapUpdate;
use elk_spatial::messages::Progress;
use elk_view::{FoxgloveOptions, Mission, Order, Parameter, Steering, ViewError, serve_foxglove};
use foxglove::Decode;
use foxglove::messages::PointCloud;
use foxglove::protocol::v1::server::ServerMessage;
use nalgebra::{Isometry3, Point3};
use serde_json::{Value, json};

use broker::broker;
use viewer::{PATIENCE, Viewer};

const SCAN: Key<Scan<'static>> = Key::new("SCAN");

/// What clients had done, and the parameters of a mission.
struct Hand {
    done: Mutex<Vec<String>>,
    resolution: Mutex<f64>,
}

impl Steering for Hand {
    fn order(&self, order: &Order, on_progress: &mut dyn FnMut(&str)) -> Result<String, String> {
        on_progress("under way");
        self.done.lock().unwrap().push(format!("{order:?}"));
        match order {
            Order::Stop { app } => Err(format!("there is no {app}")),
            Order::Swap { params, .. } => {
                *self.resolution.lock().unwrap() = params[0].1.parse().map_err(|_| "Res is a number".to_owned())?;
                Ok("swapped".into())
            }
            _ => Ok("done".into()),
        }
    }

    fn poke(&self, key: &str, value: &str) -> Result<String, String> {
        self.done.lock().unwrap().push(format!("{key}={value}"));
        if value == "fast" { Err("it carries numbers".into()) } else { Ok(String::new()) }
    }

    fn apps(&self) -> Option<Value> {
        None
    }

    fn types(&self) -> Value {
        json!([])
    }

    fn log(&self, _: &str) -> Option<PathBuf> {
        None
    }
}

impl Mission for Hand {
    fn parameters(&self) -> Vec<Parameter> {
        let parameter = |name: &str, value: Value| Parameter { name: name.into(), value };
        let resolution = *self.resolution.lock().unwrap();
        vec![parameter("Map.Res", resolution.into()), parameter("Sensor.Start", json!([1.0, 2.0, 3.5]))]
    }
}

/// A community, its view, and what clients had done.
struct Lab {
    community: Community,
    broker: Child,
    stop: Arc<AtomicBool>,
    view: Option<std::thread::JoinHandle<()>>,
    address: SocketAddr,
    query: String,
    hand: Arc<Hand>,
}

fn options(listen: &str, read_only: bool) -> FoxgloveOptions {
    FoxgloveOptions { address: listen.parse().unwrap(), origins: vec!["https://site.example".into()], read_only }
}

impl Lab {
    fn new(name: &str, listen: &str, read_only: bool) -> Self {
        let community = Community::new(format!("foxglove-{name}-{}", std::process::id())).unwrap();
        let stop = Arc::new(AtomicBool::new(false));
        let broker = broker(&community);
        let hand = Arc::new(Hand { done: Mutex::default(), resolution: Mutex::new(0.1) });
        let (ready, address) = channel();
        let (of, mission, stops, options) = (community.clone(), hand.clone(), stop.clone(), options(listen, read_only));
        let view = std::thread::spawn(move || {
            serve_foxglove(&of, options, Some(mission), |url| ready.send(url.to_owned()).unwrap(), &stops).unwrap();
        });
        let url = address.recv_timeout(PATIENCE).unwrap();
        let (address, query) =
            url.strip_prefix("ws://").unwrap().split_once('/').unwrap_or((&url["ws://".len()..], ""));
        let (address, query) = (address.parse().unwrap(), query.to_owned());
        Self { community, broker, stop, view: Some(view), address, query, hand }
    }

    fn client(&self, name: &str) -> Client {
        broker::client(&self.community, name)
    }

    fn viewer(&self) -> Viewer {
        Viewer::open(self.address, "", &[]).unwrap()
    }

    fn done(&self) -> Vec<String> {
        self.hand.done.lock().unwrap().clone()
    }
}

impl Drop for Lab {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let ended = self.view.take().map(std::thread::JoinHandle::join);
        self.broker.kill().and_then(|()| self.broker.wait()).unwrap();
        assert!(std::thread::panicking() || ended.is_none_or(|ended| ended.is_ok()));
    }
}

/// Who is there.
fn table(client: &mut Client) -> CommunityTable {
    client.comms.notify(REQUEST, "").unwrap();
    client.comms.flush().unwrap();
    let mut table = None;
    while table.is_none() {
        client.receive(PATIENCE, |mail| table = table.take().or(mail.decode(&TABLE).ok())).unwrap();
    }
    table.unwrap()
}

/// What the view is registered for.
fn registered(client: &mut Client) -> Vec<String> {
    let view = table(client).clients.into_iter().find(|one| one.name.starts_with("foxglove-")).unwrap();
    view.registrations.into_iter().map(|one| one.key_pattern).collect()
}

#[test]
fn clients_have_the_latest_values_however_late_they_come() {
    let lab = Lab::new("latest", "127.0.0.1:0", false);
    let mut app = lab.client("App");
    app.comms.notify("HEIGHT", 1.5).unwrap();
    app.comms.notify("NOTE", "all is \"well\"").unwrap();
    let points = [Point3::new(1.0, 2.0, 3.0), Point3::new(4.0, 5.0, 6.0)].into_iter().collect();
    app.comms.publish(&SCAN, &Scan::new(1, 1, Pose(Isometry3::translation(7.0, 8.0, 9.0)), points)).unwrap();
    let progress = Progress { scan: 1, revision: 2, scans: 3, path_length_m: 4.5, free: 6, finished: false };
    app.comms.publish(&PROGRESS, &progress).unwrap();
    app.comms.flush().unwrap();
    let mut first = lab.viewer();
    let info = first.until("serverInfo", |said| match said {
        ServerMessage::ServerInfo(info) => Some(info.clone()),
        _ => None,
    });
    assert_eq!(info.name, format!("elk: {}", lab.community));
    assert_eq!((info.capabilities.len(), info.supported_encodings), (6, vec!["json".to_owned()]));
    let height = first.subscribe("HEIGHT");
    assert_eq!(first.next_json(height)["value"], 1.5);
    // Who comes when the value is known already has it as well.
    for mut viewer in [lab.viewer(), lab.viewer()] {
        let (height, note) = (viewer.subscribe("HEIGHT"), viewer.subscribe("NOTE"));
        let mut values = Vec::new();
        while values.len() < 2 {
            values.push(viewer.until("value", |said| match said {
                ServerMessage::MessageData(said) if [height, note].contains(&said.subscription_id) => {
                    Some(serde_json::from_slice::<Value>(&said.data).unwrap()["value"].clone())
                }
                _ => None,
            }));
        }
        values.sort_by_key(Value::is_string);
        assert_eq!(values, [json!(1.5), json!("all is \"well\"")]);
        assert_eq!(viewer.channels["SCAN"].1, "protobuf");
        let scan = viewer.subscribe("SCAN");
        let cloud = PointCloud::decode(viewer.next(scan).as_slice()).unwrap();
        assert_eq!((cloud.frame_id.as_str(), cloud.point_stride, cloud.data.len()), ("world", 12, 24));
        assert_eq!(cloud.pose.unwrap().position.unwrap().y, 8.0);
        assert_eq!(cloud.data[12..16], 4.0_f32.to_le_bytes());
        let progress = viewer.subscribe("PROGRESS");
        let (_, encoding, name, _) = &viewer.channels["PROGRESS"];
        assert_eq!((encoding.as_str(), name.as_str()), ("json", "Progress"));
        let told = viewer.next_json(progress);
        assert_eq!((&told["value"]["path_length_m"], &told["value"]["scans"]), (&json!(4.5), &json!(3)));
    }
    // What comes next reaches those who are there, with the community's time.
    app.comms.notify("HEIGHT", 2.5).unwrap();
    app.comms.flush().unwrap();
    first.until_value(height, &json!(2.5));
    let time =
        first.until("time", |said| if let ServerMessage::Time(said) = said { Some(said.timestamp) } else { None });
    assert!((time as f64 / 1e9 - app.comms.time()).abs() < PATIENCE.as_secs_f64());
    // A variable that comes later has a channel, too.
    app.comms.notify("LATER", 9.0).unwrap();
    app.comms.flush().unwrap();
    let later = first.subscribe("LATER");
    first.until_value(later, &json!(9.0));
}

#[test]
fn the_view_hears_what_somebody_looks_at_and_nothing_else() {
    let lab = Lab::new("heard", "127.0.0.1:0", false);
    let mut app = lab.client("App");
    app.comms.register(number(MAP_REQUEST)).unwrap();
    app.comms.notify("HEIGHT", 1.0).unwrap();
    let mut map = OccupancyGrid::new(0.1);
    map.set(Voxel::new(1, 2, 3), State::Occupied);
    app.comms.publish(&MAP_UPDATE, &MapUpdate::new(map.whole(), 1)).unwrap();
    app.comms.flush().unwrap();
    let mut viewer = lab.viewer();
    viewer.wait_for_channel("MAP_UPDATE");
    assert_eq!(registered(&mut app), [""; 0]);
    let height = viewer.subscribe("HEIGHT");
    viewer.next(height);
    assert_eq!(registered(&mut app), ["HEIGHT"]);
    // Who looks at what changes in a map needs the map.
    let update = viewer.subscribe("MAP_UPDATE");
    assert_eq!(PointCloud::decode(viewer.next(update).as_slice()).unwrap().data.len(), 12);
    let mut asked = false;
    while !asked {
        app.receive(PATIENCE, |mail| asked |= mail.key() == MAP_REQUEST).unwrap();
    }
    viewer.say(&json!({"op": "unsubscribe", "subscriptionIds": [height, update]}));
    let waited = Stopwatch::start();
    while !registered(&mut app).is_empty() {
        assert!(waited.elapsed() < PATIENCE, "it is registered still");
    }
    // Whoever goes wants nothing any more.
    let again = viewer.subscribe("HEIGHT");
    viewer.next(again);
    drop(viewer);
    while !registered(&mut app).is_empty() {
        assert!(waited.elapsed() < PATIENCE, "it is registered still");
    }
}

#[test]
fn clients_order_write_and_change_parameters() {
    let lab = Lab::new("steer", "127.0.0.1:0", false);
    let mut viewer = lab.viewer();
    viewer.until("services", |said| matches!(said, ServerMessage::AdvertiseServices(_)).then_some(()));
    assert_eq!(viewer.services.len(), 6);
    assert_eq!(viewer.call("pause", &json!({})), Ok("done".into()));
    assert_eq!(viewer.call("stop", &json!({"app": "Mapp"})), Err("there is no Mapp".into()));
    assert!(viewer.call("start", &json!({})).unwrap_err().contains("missing field `app`"));
    viewer.publish("SPEED", r#"{"value": 2.5}"#);
    viewer.publish("SPEED", r#"{"value": "fast"}"#);
    viewer.until_status("SPEED: it carries numbers");
    viewer.publish("SPEED", "2.5");
    viewer.until_status("right is an object as this channel's messages are");
    assert_eq!(viewer.parameters(&[]), json!({"Map.Res": 0.1, "Sensor.Start": [1.0, 2.0, 3.5]}));
    assert_eq!(viewer.parameters(&["Map.Res", "Nobody.Knows"]), json!({"Map.Res": 0.1}));
    // Whoever watches a parameter is told when another one changes it.
    let mut watcher = lab.viewer();
    watcher.say(&json!({"op": "subscribeParameterUpdates", "parameterNames": ["Map.Res"]}));
    assert_eq!(watcher.told_parameters(), json!({"Map.Res": 0.1}));
    let set =
        |value: Value| json!({"op": "setParameters", "id": "set", "parameters": [{"name": "Map.Res", "value": value}]});
    viewer.say(&set(json!(0.25)));
    assert_eq!(viewer.answered_parameters("set"), json!({"Map.Res": 0.25}));
    assert_eq!(watcher.told_parameters(), json!({"Map.Res": 0.25}));
    // What cannot be set is said, and the answer has what is so.
    viewer.say(&set(json!("wide")));
    assert_eq!(viewer.answered_parameters("set"), json!({"Map.Res": 0.25}));
    assert!(viewer.statuses.iter().any(|said| said == "Map: Res is a number"), "{:?}", viewer.statuses);
    viewer.say(&json!({"op": "setParameters", "parameters": [{"name": "Mapp.Res", "value": 1}]}));
    viewer.until_status("no parameter \"Mapp.Res\"");
    let done = lab.done();
    assert_eq!(done[..2], ["Pause", "Stop { app: \"Mapp\" }"]);
    assert_eq!(done[2..4], ["SPEED=2.5", "SPEED=fast"]);
    assert!(done[4].starts_with("Swap { app: \"Map\", type_name: None, params: [(\"Res\", \"0.25\")]"), "{}", done[4]);
    // What is no message is told, and the client is served on.
    viewer.say(&json!({"op": "explode"}));
    viewer.until_status("not understood: unknown variant `explode`");
    viewer.say(&json!({"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 4711}]}));
    viewer.until_status("there is no channel 4711");
    assert_eq!(viewer.call("resume", &json!({})), Ok("done".into()));
}

#[test]
fn who_may_only_look_changes_nothing() {
    let lab = Lab::new("look", "127.0.0.1:0", true);
    let mut viewer = lab.viewer();
    let info = viewer.until("info", |said| match said {
        ServerMessage::ServerInfo(info) => Some(info.clone()),
        _ => None,
    });
    assert_eq!(info.capabilities.len(), 4);
    viewer.services.insert("pause".into(), 1);
    assert_eq!(viewer.call("pause", &json!({})), Err("this view only looks (--read-only)".into()));
    viewer.publish("SPEED", r#"{"value": 2.5}"#);
    viewer.until_status("only looks");
    viewer.statuses.clear();
    viewer.say(&json!({"op": "setParameters", "parameters": [{"name": "Map.Res", "value": 1}]}));
    viewer.until_status("only looks");
    assert_eq!(viewer.parameters(&["Map.Res"]), json!({"Map.Res": 0.1}));
    assert_eq!(lab.done(), [""; 0]);
}

#[test]
fn clients_see_who_writes_what_and_who_reads_it() {
    let lab = Lab::new("graph", "127.0.0.1:0", false);
    let (mut writer, mut reader) = (lab.client("Writer"), lab.client("Reader"));
    reader.comms.register(number("HEIGHT")).unwrap();
    reader.comms.register(number("DEPTH")).unwrap();
    reader.comms.flush().unwrap();
    table(&mut reader);
    writer.comms.notify("HEIGHT", 1.0).unwrap();
    writer.comms.flush().unwrap();
    let mut viewer = lab.viewer();
    viewer.say(&json!({"op": "subscribeConnectionGraph"}));
    let (mut writers, mut readers, mut services) = (Value::Null, Value::Null, 0);
    while (&writers, &readers, services) != (&json!(["Writer"]), &json!(["Reader"]), 6) {
        viewer.until("graph", |said| {
            let ServerMessage::ConnectionGraphUpdate(said) = said else { return None };
            let published = said.published_topics.iter().find(|one| one.name == "HEIGHT");
            published.into_iter().for_each(|one| writers = json!(one.publisher_ids));
            let subscribed = said.subscribed_topics.iter().find(|one| one.name == "HEIGHT");
            subscribed.into_iter().for_each(|one| readers = json!(one.subscriber_ids));
            services += said.advertised_services.len();
            Some(())
        });
    }
    // Whoever goes is taken out of it, and so is what he alone waited for.
    drop(reader);
    let mut gone = Vec::new();
    while gone != ["DEPTH"] || readers != json!([]) {
        viewer.until("graph", |said| {
            let ServerMessage::ConnectionGraphUpdate(said) = said else { return None };
            let subscribed = said.subscribed_topics.iter().find(|one| one.name == "HEIGHT");
            subscribed.into_iter().for_each(|one| readers = json!(one.subscriber_ids));
            gone.extend(said.removed_topics.clone());
            Some(())
        });
    }
}

#[test]
fn a_client_that_does_not_read_holds_up_nobody_and_has_the_latest_value_at_last() {
    let lab = Lab::new("deaf", "127.0.0.1:0", false);
    let mut app = lab.client("App");
    let text = |number: u32| format!("{number:06}{}", "x".repeat(200_000));
    app.comms.notify("LONG", text(0).as_str()).unwrap();
    app.comms.flush().unwrap();
    let (mut deaf, mut viewer) = (lab.viewer(), lab.viewer());
    let waits = deaf.subscribe("LONG");
    let reads = viewer.subscribe("LONG");
    for number in 1..=300 {
        app.comms.notify("LONG", text(number).as_str()).unwrap();
        app.comms.flush().unwrap();
        // It reads on, whatever the other does.
        viewer.until_value(reads, &json!(text(number)));
    }
    let (mut read, last) = (0, json!(text(300)));
    while deaf.next_json(waits)["value"] != last {
        read += 1;
    }
    assert!(read < 299, "60 MB do not wait for it, but {read} messages came");
    deaf.until_status("messages were left out");
}

#[test]
fn a_broker_that_is_killed_or_ends_and_comes_back_is_gone_on_with() {
    let mut lab = Lab::new("back", "127.0.0.1:0", false);
    let mut viewer = lab.viewer();
    let say = |lab: &Lab, height: f64| {
        let mut app = lab.client(&format!("App{height}"));
        app.comms.notify("HEIGHT", height).unwrap();
        app.comms.flush().unwrap();
        app
    };
    let first = say(&lab, 1.0);
    let height = viewer.subscribe("HEIGHT");
    viewer.until_value(height, &json!(1.0));
    drop(first);
    // One that is killed, and started again at once as a launcher does it.
    lab.broker.kill().and_then(|()| lab.broker.wait()).unwrap();
    lab.broker = broker(&lab.community);
    let _second = say(&lab, 2.0);
    let mut height = height;
    let mut heard = false;
    while !heard {
        // The channel may have been taken back meanwhile, if the variable was not there for a while.
        let (told, retracted) = viewer.until("height", |said| match said {
            ServerMessage::MessageData(said) if said.subscription_id == height => {
                let value: Value = serde_json::from_slice(&said.data).unwrap();
                Some((value["value"] == 2.0, false))
            }
            ServerMessage::Unadvertise(_) => Some((false, true)),
            _ => None,
        });
        heard = told;
        if retracted {
            height = viewer.subscribe("HEIGHT");
        }
    }
    // One that has ended is told; with the next one of its name everything begins anew.
    rustix::process::kill_process(rustix::process::Pid::from_child(&lab.broker), rustix::process::Signal::TERM)
        .unwrap();
    lab.broker.wait().unwrap();
    viewer.until_status("waiting for it");
    lab.broker = broker(&lab.community);
    viewer.until("the community", |said| matches!(said, ServerMessage::RemoveStatus(_)).then_some(()));
    let _third = say(&lab, 3.0);
    viewer.until("a new channel", |said| match said {
        ServerMessage::Advertise(said) => said.channels.iter().any(|one| one.topic == "HEIGHT").then_some(()),
        _ => None,
    });
    let height = viewer.subscribe("HEIGHT");
    viewer.until_value(height, &json!(3.0));
}

#[test]
fn pages_of_somewhere_else_and_strangers_are_not_let_in() {
    let lab = Lab::new("door", "127.0.0.1:0", false);
    let open = |headers: &[(&'static str, &str)]| Viewer::open(lab.address, "", headers).err().unwrap_or_default();
    assert_eq!(open(&[("origin", "http://localhost:8080")]), "");
    assert_eq!(open(&[("origin", "https://site.example")]), "");
    let refused = open(&[("origin", "https://evil.example")]);
    assert!(refused.starts_with("403") && refused.contains("--origin https://evil.example"), "{refused}");
    assert!(open(&[("origin", "null")]).starts_with("403"));
    assert!(open(&[("host", "evil.example:8765")]).starts_with("403"));
    assert!(open(&[("sec-websocket-protocol", "chat")]).starts_with("400 a client has to offer"));
    let all: Vec<Viewer> = (0..32).map_while(|_| Viewer::open(lab.address, "", &[]).ok()).collect();
    assert!(open(&[]).starts_with("503"), "{}", all.len());

    let lab = Lab::new("token", "0.0.0.0:0", false);
    let address = SocketAddr::new([127, 0, 0, 1].into(), lab.address.port());
    assert!(Viewer::open(address, "", &[]).err().unwrap().contains("token"));
    assert!(Viewer::open(address, "?token=0123", &[]).err().unwrap().contains("token"));
    assert!(Viewer::open(address, &lab.query, &[("origin", "https://anywhere.example")]).is_ok());
}

#[test]
fn a_port_that_is_taken_is_said_with_what_to_do() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap();
    let community = Community::new("nobody").unwrap();
    let options = options(&address.to_string(), false);
    let error =
        serve_foxglove(&community, options, None, |_| panic!("it listens"), &AtomicBool::new(false)).unwrap_err();
    assert!(matches!(error, ViewError::ListenFoxglove { .. }));
    let words = error.to_string();
    assert!(words.starts_with(&format!("cannot listen at {address}: ")) && words.contains("--foxglove 127.0.0.1:8766"));
}
