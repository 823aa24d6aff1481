//! Pages of a community that runs, over real sockets.

mod broker;
mod common;

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::PathBuf;
use std::process::Child;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use elk_bus::clock::Stopwatch;
use elk_bus::drawing::{Drawing, KeyPress, KeyTable, variables};
use elk_bus::{Client, Community};
use elk_geometry::{OccupancyGrid, Pose};
use elk_spatial::keys::{MAP, MAP_UPDATE, camera_pose};
use elk_spatial::map::MapUpdate;
use elk_spatial::messages::CameraPose;
use elk_view::{Options, Order, Scenery, Source, Steering, Surfaces, serve};
use nalgebra::{Point3, Vector3};
use serde_json::{Value, json};
use tungstenite::Message;

use broker::broker;
use common::{PATIENCE, Page, wall};

/// A community, its view, and what pages had done.
struct Lab {
    community: Community,
    broker: Child,
    view_stops: Arc<AtomicBool>,
    view: Option<std::thread::JoinHandle<()>>,
    address: SocketAddr,
    /// What is behind the address that is printed.
    query: String,
    orders: Arc<Mutex<Vec<Order>>>,
}

struct Hand(Arc<Mutex<Vec<Order>>>);

impl Steering for Hand {
    fn order(&self, order: &Order, on_progress: &mut dyn FnMut(&str)) -> Result<String, String> {
        on_progress("under way");
        self.0.lock().unwrap().push(order.clone());
        match order {
            Order::Stop { app } => Err(format!("there is no {app}")),
            _ => Ok("done".into()),
        }
    }

    fn poke(&self, key: &str, value: &str) -> Result<String, String> {
        Ok(format!("{key}={value}"))
    }

    fn apps(&self) -> Option<Value> {
        Some(json!([{"name": "Map", "state": "running"}]))
    }

    fn types(&self) -> Value {
        json!([])
    }

    /// Whoever knows is not asked in vain once something was ordered.
    fn log(&self, _: &str) -> Option<PathBuf> {
        let waited = Stopwatch::start();
        while self.0.lock().unwrap().is_empty() && waited.elapsed() < PATIENCE {
            std::thread::sleep(Duration::from_millis(5));
        }
        None
    }
}

impl Scenery for Hand {
    fn surfaces(&self) -> Result<Surfaces, String> {
        let corners = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        Ok(Surfaces { remark: "a floor".to_owned(), corners, triangles: vec![[0, 1, 2]] })
    }
}

impl Lab {
    fn new(name: &str, read_only: bool, listen: &str) -> Self {
        let community = Community::new(format!("view-{name}-{}", std::process::id())).unwrap();
        let view_stops = Arc::new(AtomicBool::new(false));
        let broker = broker(&community);
        let orders = Arc::new(Mutex::new(Vec::new()));
        let (ready, address) = channel();
        let options = Options { address: SocketAddr::new(listen.parse().unwrap(), 0), any_port: false, read_only };
        let source = Source::Community(community.clone());
        let (hand, stop) = (Arc::new(Hand(orders.clone())), view_stops.clone());
        let view = std::thread::spawn(move || {
            serve(source, &options, Some(hand.clone()), Some(hand), |url| ready.send(url.to_owned()).unwrap(), &stop)
                .unwrap();
        });
        let url: String = address.recv_timeout(PATIENCE).unwrap();
        let (address, query) = url.trim_start_matches("http://").split_once('/').unwrap();
        let (address, query) = (address.parse().unwrap(), query.to_owned());
        Self { community, broker, view_stops, view: Some(view), address, query, orders }
    }

    fn client(&self, name: &str) -> Client {
        broker::client(&self.community, name)
    }

    /// Somebody says a height, which the page comes to know.
    fn say_height(&self, height: f64, page: &mut Page) {
        let mut client = self.client(&format!("pilot{height}"));
        client.comms.notify("HEIGHT", height).unwrap();
        client.comms.flush().unwrap();
        while page.last("value")["value"] != height {
            page.next("value");
        }
    }

    fn page(&self) -> Page {
        Page::open(self.address, "")
    }

    /// The answer to a plain request, head and body.
    fn get(&self, path: &str, headers: &str) -> String {
        let mut stream = TcpStream::connect(self.address).unwrap();
        write!(stream, "GET {path} HTTP/1.1\r\nConnection: close, upgrade\r\n{headers}\r\n").unwrap();
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        String::from_utf8_lossy(&answer).into_owned()
    }
}

impl Drop for Lab {
    fn drop(&mut self) {
        self.view_stops.store(true, Ordering::Relaxed);
        let ended = self.view.take().map(std::thread::JoinHandle::join);
        self.broker.kill().and_then(|()| self.broker.wait()).unwrap();
        assert!(std::thread::panicking() || ended.is_none_or(|ended| ended.is_ok()));
    }
}

#[test]
fn a_page_has_the_map_the_robot_and_what_it_watches_however_late_it_comes() {
    let lab = Lab::new("map", false, "127.0.0.1");
    let (mut map, mut client) = (OccupancyGrid::new(0.1), lab.client("Map"));
    let mut first = lab.page();
    let hello = first.next("hello");
    assert_eq!((&hello["live"]["community"], &hello["read_only"]), (&json!(lab.community.as_str()), &json!(false)));
    first.say(&json!({"type": "watch", "keys": ["HEIGHT"]}));
    for scan in 1..=20 {
        client.comms.publish(&MAP_UPDATE, &wall(&mut map, scan)).unwrap();
        let pose = Pose::looking(Point3::new(f64::from(scan), 0.0, 1.0), Vector3::x());
        client.comms.publish(&camera_pose("NAV"), &CameraPose { command: scan as u64, pose }).unwrap();
        client.comms.notify("HEIGHT", f64::from(scan)).unwrap();
        client.comms.flush().unwrap();
    }
    // The map answers as a map does.
    client.comms.publish(&MAP, &MapUpdate::new(map.whole(), 20)).unwrap();
    client.comms.flush().unwrap();
    while first.occupied() < 800 {
        first.next("frame");
    }
    assert_eq!(first.occupied(), 800);
    let mut late = lab.page();
    while late.occupied() < 800 {
        late.next("frame");
    }
    assert_eq!((late.occupied(), late.bricks.len()), (800, first.bricks.len()));
    while first.last("value")["value"] != 20.0 {
        first.next("value");
    }
    // The camera's pose is found by its type, whatever the variable is called.
    client
        .comms
        .publish(
            &camera_pose("NAV"),
            &CameraPose { command: 21, pose: Pose::looking(Point3::new(5.0, 6.0, 7.0), Vector3::y()) },
        )
        .unwrap();
    client.comms.flush().unwrap();
    let robot = loop {
        let robot = late.next("robot");
        if robot["position"] == json!([5.0, 6.0, 7.0]) {
            break robot;
        }
    };
    // Looking along y is a quarter turn from looking along x.
    let quaternion: Vec<f64> =
        robot["quaternion"].as_array().unwrap().iter().map(|one| one.as_f64().unwrap()).collect();
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let off = quaternion.iter().zip([0.0, 0.0, half, half]).map(|(one, other)| (one - other).abs());
    assert!(off.fold(0.0, f64::max) < 1e-9, "{quaternion:?}");
    assert_eq!(late.last("apps")["rows"][0]["name"], "Map");
    // Times are those of the run, not of the world's clock.
    for (kind, message) in ["robot", "event"].map(|kind| (kind, late.last(kind))) {
        assert!((0.0..600.0).contains(&message["time"].as_f64().unwrap()), "{kind}: {message}");
    }
}

#[test]
fn a_broker_that_is_killed_or_ends_and_comes_back_is_gone_on_with() {
    let mut lab = Lab::new("back", false, "127.0.0.1");
    let mut page = lab.page();
    let wait_for = |page: &mut Page, connected: bool| {
        while page.last("status")["connected"] != connected {
            page.next("status");
        }
    };
    wait_for(&mut page, true);
    let watch = json!({"type": "watch", "keys": ["HEIGHT"]});
    page.say(&watch);
    lab.say_height(1.0, &mut page);
    // One that is killed, and started again at once as a launcher does it, is not even noticed.
    lab.broker.kill().and_then(|()| lab.broker.wait()).unwrap();
    lab.broker = broker(&lab.community);
    lab.say_height(2.0, &mut page);
    assert_eq!((page.last("status")["connected"].clone(), page.resets), (json!(true), 0));
    // One that has ended is told; with the next one of its name everything begins anew.
    rustix::process::kill_process(rustix::process::Pid::from_child(&lab.broker), rustix::process::Signal::TERM)
        .unwrap();
    lab.broker.wait().unwrap();
    wait_for(&mut page, false);
    lab.broker = broker(&lab.community);
    wait_for(&mut page, true);
    assert!(page.resets >= 1, "what was before is forgotten");
    lab.say_height(3.0, &mut page);
}

#[test]
fn orders_are_done_and_answered_unless_pages_only_look() {
    let lab = Lab::new("orders", false, "127.0.0.1");
    let mut page = lab.page();
    page.say(&json!({"type": "order", "id": 1, "order": {"command": "pause"}}));
    let answers = [page.next("answer"), page.next("answer")];
    assert_eq!(answers[0], json!({"type": "answer", "id": 1, "ok": null, "text": "under way"}));
    assert_eq!(answers[1], json!({"type": "answer", "id": 1, "ok": true, "text": "done"}));
    page.say(&json!({"type": "order", "id": 2, "order": {"command": "stop", "app": "Mapp"}}));
    page.next("answer");
    assert_eq!(page.next("answer"), json!({"type": "answer", "id": 2, "ok": false, "text": "there is no Mapp"}));
    assert_eq!(*lab.orders.lock().unwrap(), [Order::Pause, Order::Stop { app: "Mapp".into() }]);
    page.say(&json!({"type": "poke", "id": 3, "key": "A", "value": "1"}));
    assert_eq!(page.next("answer")["text"], "A=1");
    // What is no message is told, and the page is served on.
    page.socket.send(Message::text("{}")).unwrap();
    page.socket.send(Message::binary(vec![1, 2, 3])).unwrap();
    for _ in 0..2 {
        assert!(page.next("answer")["text"].as_str().unwrap().contains("not understood"));
    }
    drop(page);

    let lab = Lab::new("only-look", true, "127.0.0.1");
    let mut page = lab.page();
    page.say(&json!({"type": "order", "id": 1, "order": {"command": "pause"}}));
    page.say(&json!({"type": "poke", "id": 2, "key": "A", "value": "1"}));
    for id in [1, 2] {
        let answer = page.next("answer");
        assert_eq!((&answer["id"], &answer["ok"]), (&json!(id), &json!(false)), "{answer}");
    }
    assert_eq!(lab.orders.lock().unwrap().len(), 0);
}

/// Takes frames until a page has a drawing, or has not.
fn wait_for_drawing(page: &mut Page, app: &str, name: &str, is_there: bool) {
    let (title, waited) = ((app.to_owned(), name.to_owned()), Stopwatch::start());
    while page.drawings.contains_key(&title) != is_there {
        assert!(waited.elapsed() < PATIENCE, "{app}/{name} is there: {}; of {:?}", !is_there, page.drawings.keys());
        page.next("frame");
    }
}

fn line(name: &str) -> Drawing {
    Drawing::new(name).line_strip([[0.0; 3], [1.0, 0.0, 0.0]], [255, 0, 0, 255])
}

#[test]
fn what_apps_draw_is_there_however_late_a_page_comes_and_goes_when_it_is_over() {
    let lab = Lab::new("draw", false, "127.0.0.1");
    let mut painter = lab.client("painter");
    // Whether anybody looks depends on whether there is a page.
    let watched = |painter: &mut Client, is: bool| {
        let waited = Stopwatch::start();
        while painter.comms.is_watched().unwrap() != is {
            painter.receive(Duration::from_millis(20), |_| ()).unwrap();
            assert!(waited.elapsed() < PATIENCE, "watched: {}", !is);
        }
    };
    watched(&mut painter, false);
    painter.comms.draw(&line("before")).unwrap();
    painter.comms.flush().unwrap();
    let mut page = lab.page();
    wait_for_drawing(&mut page, "painter", "before", true);
    watched(&mut painter, true);
    painter.comms.draw(&line("mark").text([0.0; 3], "hall", [1; 4])).unwrap();
    painter.comms.draw(&line("brief").lasting(0.3)).unwrap();
    painter.comms.flush().unwrap();
    wait_for_drawing(&mut page, "painter", "mark", true);
    let said = &page.drawings[&("painter".to_owned(), "mark".to_owned())];
    assert_eq!(said["primitives"][1]["text"], "hall", "{said}");
    // One that is brief comes and goes; a page may have missed it.
    wait_for_drawing(&mut page, "painter", "brief", false);
    painter.comms.draw(&Drawing::new("mark")).unwrap();
    painter.comms.flush().unwrap();
    wait_for_drawing(&mut page, "painter", "mark", false);
    let mut late = lab.page();
    wait_for_drawing(&mut late, "painter", "before", true);
    // What is no drawing is an event, and the next one is taken.
    painter.comms.notify("DRAWING/painter/odd", "a line").unwrap();
    painter.comms.draw(&line("last")).unwrap();
    painter.comms.flush().unwrap();
    while !page.last("event")["text"].as_str().unwrap().contains("DRAWING/painter/odd by painter") {
        page.next("event");
    }
    wait_for_drawing(&mut page, "painter", "last", true);
    // An app that has gone leaves nothing, but what goes by itself.
    painter.comms.draw(&line("awhile").lasting(3600.0)).unwrap();
    drop(painter);
    wait_for_drawing(&mut page, "painter", "before", false);
    wait_for_drawing(&mut page, "painter", "awhile", true);
    let mut later = lab.page();
    wait_for_drawing(&mut later, "painter", "awhile", true);
    assert_eq!(later.drawings.len(), 1, "{:?}", later.drawings.keys());
}

#[test]
fn a_key_goes_to_the_app_that_has_it_and_none_goes_where_pages_only_look() {
    let lab = Lab::new("keys", false, "127.0.0.1");
    let (mut first, mut second) = (lab.client("first"), lab.client("second"));
    first.comms.take_keys(&KeyTable::new([("g", "grow"), ("v", "a vault")])).unwrap();
    first.comms.flush().unwrap();
    let mut page = lab.page();
    while page.last("keys")["rows"].as_array().unwrap().len() != 2 {
        page.next("keys");
    }
    second.comms.take_keys(&KeyTable::new([("g", "go"), ("k", "kneel")])).unwrap();
    second.comms.flush().unwrap();
    while page.last("keys")["rows"].as_array().unwrap().len() != 4 {
        page.next("keys");
    }
    let taken = |app: &str, key: &str, meaning: &str, by: Option<&str>| json!({"app": app, "key": key, "meaning": meaning, "taken_by": by});
    let rows = [
        taken("first", "g", "grow", None),
        taken("first", "v", "a vault", Some("the view")),
        taken("second", "g", "go", Some("first")),
        taken("second", "k", "kneel", None),
    ];
    assert_eq!(page.last("keys")["rows"], json!(rows));
    let mut press = |app: &str, key: &str| {
        page.say(&json!({"type": "press", "id": 1, "app": app, "key": key, "shift": true, "alt": false}));
        page.next("answer")
    };
    for (app, key, why) in
        [("second", "g", "it is first's"), ("first", "v", "it is the view's"), ("first", "x", "it is nobody's")]
    {
        let answer = press(app, key);
        assert!(answer["ok"] == false && answer["text"].as_str().unwrap().contains(why), "{answer}");
    }
    assert_eq!(press("first", "g")["ok"], true);
    let (mut pressed, waited) = (Vec::new(), Stopwatch::start());
    while pressed.is_empty() && waited.elapsed() < PATIENCE {
        let key = variables::key_press("first");
        first
            .receive(Duration::from_millis(50), |mail| {
                pressed.extend(mail.is(&key).then(|| mail.decode(&key).unwrap()))
            })
            .unwrap();
    }
    assert_eq!(pressed, [KeyPress { app: "first".into(), key: "g".into(), shift: true, alt: false }]);
    // Who has gone has no keys; his are the next one's.
    drop(first);
    while page.last("keys")["rows"] != json!([taken("second", "g", "go", None), taken("second", "k", "kneel", None)]) {
        page.next("keys");
    }

    let lab = Lab::new("no-keys", true, "127.0.0.1");
    let mut app = lab.client("app");
    app.comms.take_keys(&KeyTable::new([("g", "grow")])).unwrap();
    app.comms.flush().unwrap();
    let mut page = lab.page();
    while page.last("keys")["rows"] != json!([taken("app", "g", "grow", None)]) {
        page.next("keys");
    }
    page.say(&json!({"type": "press", "id": 1, "app": "app", "key": "g", "shift": false, "alt": false}));
    let answer = page.next("answer");
    assert!(answer["ok"] == false && answer["text"].as_str().unwrap().contains("--read-only"), "{answer}");
}

#[test]
fn a_page_of_somewhere_else_is_not_served() {
    let lab = Lab::new("origin", false, "127.0.0.1");
    let own = format!("Host: {}\r\n", lab.address);
    assert!(lab.get("/", &own).starts_with("HTTP/1.1 200"));
    assert!(lab.get("/nothing", &own).starts_with("HTTP/1.1 404"));
    assert!(lab.get("/../../Cargo.toml", &own).starts_with("HTTP/1.1 404"));
    assert!(lab.get("/", "Host: evil.example\r\n").starts_with("HTTP/1.1 403"));
    assert!(lab.get("/", &format!("{own}Origin: http://evil.example\r\n")).starts_with("HTTP/1.1 403"));
    let upgrade = "Upgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";
    let answer = lab.get("/ws", &format!("{own}{upgrade}Origin: http://evil.example\r\n"));
    assert!(answer.starts_with("HTTP/1.1 403") && answer.contains("evil.example"), "{answer}");
}

/// Why a page is not let in; the first word that it hears, if it is.
fn refusal(mut page: Page) -> String {
    loop {
        match page.socket.read().unwrap() {
            Message::Close(why) => return why.unwrap().reason.to_string(),
            Message::Text(word) => return word.to_string(),
            _ => {}
        }
    }
}

#[test]
fn who_may_come_from_other_machines_has_to_know_the_token() {
    let lab = Lab::new("token", false, "0.0.0.0");
    let address = SocketAddr::new([127, 0, 0, 1].into(), lab.address.port());
    for query in ["", "?token=", "?token=0123"] {
        let refused = refusal(Page::open(address, query));
        assert!(refused.starts_with("the token is missing or wrong"), "{query}: {refused}");
    }
    assert!(lab.query.starts_with("?token="), "{}", lab.query);
    Page::open(address, &lab.query).next("frame");
}

#[test]
fn so_many_pages_may_be_open_and_no_more() {
    let lab = Lab::new("full", false, "127.0.0.1");
    let mut pages: Vec<Page> = (0..64).map(|_| lab.page()).collect();
    assert_eq!(refusal(lab.page()), "as many pages are open as may be: close one");
    pages[63].next("frame");
}

#[test]
fn whoever_says_too_much_at_once_is_let_go_of() {
    let lab = Lab::new("wordy", false, "127.0.0.1");
    let mut page = lab.page();
    let said = |length: usize| Message::text(json!({"type": "x".repeat(length)}).to_string());
    page.socket.send(said(60_000)).unwrap();
    let answer = page.next("answer");
    assert!(answer["text"].as_str().unwrap().starts_with("not understood"), "{answer}");
    page.socket.send(said(70_000)).unwrap();
    while let Ok(word) = page.socket.read() {
        assert!(!word.to_text().unwrap_or_default().contains("not understood"), "it is listened to");
    }
}

#[test]
fn fifty_pages_of_which_some_never_read_hold_up_nobody() {
    let lab = Lab::new("many", false, "127.0.0.1");
    let mut deaf: Vec<Page> = (0..25).map(|_| lab.page()).collect();
    let (mut map, mut client) = (OccupancyGrid::new(0.1), lab.client("Map"));
    let mut pages: Vec<Page> = (0..25).map(|_| lab.page()).collect();
    for scan in 1..=50 {
        client.comms.publish(&MAP_UPDATE, &wall(&mut map, scan)).unwrap();
        client.comms.flush().unwrap();
    }
    client.comms.publish(&MAP, &MapUpdate::new(map.whole(), 50)).unwrap();
    client.comms.flush().unwrap();
    for page in &mut pages {
        while page.occupied() < 2_000 {
            page.next("frame");
        }
        assert_eq!(page.occupied(), 2_000);
    }
    // One that reads at last has all of it.
    let page = &mut deaf[7];
    while page.occupied() < 2_000 {
        page.next("frame");
    }
}

#[test]
fn the_world_is_sent_to_who_shows_it_and_to_nobody_else() {
    let lab = Lab::new("world", false, "127.0.0.1");
    let (mut map, mut client) = (OccupancyGrid::new(0.1), lab.client("Map"));
    let (mut looks, mut shows) = (lab.page(), lab.page());
    let show = |page: &mut Page, layers: &[&str]| page.say(&json!({"type": "show", "layers": layers}));
    let mut scan = 0;
    let mut say = |pages: [&mut Page; 2]| {
        scan += 1;
        client.comms.publish(&MAP_UPDATE, &wall(&mut map, scan)).unwrap();
        client.comms.flush().unwrap();
        for page in pages {
            while page.occupied() != 40 * scan as u32 {
                page.next("frame");
            }
        }
    };
    // The community is there by then, and its launcher.
    say([&mut looks, &mut shows]);
    looks.last("apps");
    show(&mut looks, &["scan"]);
    show(&mut shows, &["scan", "world"]);
    assert_eq!(shows.next("world"), json!({"type": "world", "ok": true, "text": "a floor"}));
    // Frames go on, and bring it to nobody a second time.
    (0..3).for_each(|_| say([&mut looks, &mut shows]));
    assert_eq!((looks.surfaces, shows.surfaces), (0, 1));
    // Who has hidden it has forgotten it.
    show(&mut shows, &[]);
    show(&mut shows, &["world"]);
    shows.next("world");
    say([&mut looks, &mut shows]);
    assert_eq!((looks.surfaces, shows.surfaces), (0, 2));
    // A page that switches it on and off without an end has as many answers under way as any.
    for _ in 0..200 {
        show(&mut shows, &["world"]);
        show(&mut shows, &[]);
    }
    say([&mut looks, &mut shows]);
    assert!(shows.surfaces <= 202, "{}", shows.surfaces);
}

#[test]
fn a_text_log_that_nobody_finds_holds_up_nothing() {
    let lab = Lab::new("log", false, "127.0.0.1");
    let mut page = lab.page();
    page.say(&json!({"type": "watch", "keys": ["HEIGHT"]}));
    // As many as may be; each would hold up a thread.
    (0..1_000).for_each(|_| page.say(&json!({"type": "logs", "app": "Map"})));
    lab.say_height(1.0, &mut page);
    page.say(&json!({"type": "order", "id": 1, "order": {"command": "pause"}}));
    assert_eq!(page.next("answer")["ok"], json!(null));
    assert_eq!(page.next("answer")["ok"], json!(true));
}

#[test]
fn a_value_that_is_too_long_is_cut() {
    let lab = Lab::new("long", false, "127.0.0.1");
    let mut page = lab.page();
    page.say(&json!({"type": "watch", "keys": ["NOTE"]}));
    let mut client = lab.client("writer");
    client.comms.notify("NOTE", "ä".repeat(5 << 20)).unwrap();
    client.comms.flush().unwrap();
    let value = page.next("value")["value"].as_str().unwrap().to_owned();
    assert!(value.len() < 5_000 && value.starts_with("ää") && value.ends_with("(10485760 bytes in all)"), "{value}");
}

#[test]
fn pages_are_told_that_the_view_ends() {
    let lab = Lab::new("end", false, "127.0.0.1");
    let mut page = lab.page();
    page.next("frame");
    lab.view_stops.store(true, Ordering::Relaxed);
    let reason = loop {
        if let Message::Close(frame) = page.socket.read().unwrap() {
            break frame.unwrap().reason;
        }
    };
    assert_eq!(reason, "the view has ended");
}
