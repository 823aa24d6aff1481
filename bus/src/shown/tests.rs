use std::sync::atomic::AtomicBool;

use elk_drawing::drawing::rgb;
use elk_drawing::{Colours, KeyPress, Primitive};

use crate::memory::MemoryBroker;
use crate::{
    AppError, BrokerConfig, Client, Clock, Community, Handled, Handlers, Value, begin_app, run_app_on, take_turn,
};

use super::*;

const COLOUR: [u8; 4] = rgb(1, 2, 3);

fn broker() -> MemoryBroker {
    MemoryBroker::new(BrokerConfig::new("drawing"), Clock::new(1.0))
}

fn join(broker: &MemoryBroker, name: &str) -> Client {
    Client::over(broker.connect(name).unwrap(), name, &Community::new("drawing").unwrap())
}

/// Somebody who looks.
struct Looker(Client);

impl Looker {
    fn new(broker: &MemoryBroker, name: &str, keys: &[&str]) -> Self {
        let mut client = join(broker, name);
        keys.iter().for_each(|key| client.comms.register(*key).unwrap());
        client.comms.flush().unwrap();
        Self(client)
    }

    /// What it has heard by now: variable and primitives, or words.
    fn heard(&mut self) -> Vec<(String, Value)> {
        let mut heard = Vec::new();
        while self
            .0
            .receive(std::time::Duration::ZERO, |mail| heard.push((mail.key().to_owned(), mail.value().to_value())))
            .unwrap()
            > 0
        {}
        heard
    }

    fn keys(&mut self) -> Vec<String> {
        self.heard().into_iter().map(|(key, _)| key).collect()
    }

    fn words(&mut self) -> Vec<String> {
        let text = |(_, value)| if let Value::Text(text) = value { Some(text) } else { None };
        self.heard().into_iter().filter_map(text).collect()
    }
}

fn line(name: &str) -> Drawing {
    Drawing::new(name).line_strip([[0.0; 3], [1.0, 0.0, 0.0]], COLOUR)
}

#[test]
fn who_comes_late_sees_the_latest_drawing_of_each_name() {
    let broker = broker();
    let mut painter = join(&broker, "painter");
    for name in ["a", "b", "a"] {
        painter.comms.draw(&line(name)).unwrap();
    }
    painter.comms.draw(&line("b").points([[2.0; 3]], COLOUR)).unwrap();
    painter.comms.flush().unwrap();
    let mut looker = join(&broker, "looker");
    looker.comms.register(variables::DRAWINGS).unwrap();
    let mut seen = Vec::new();
    looker
        .receive(std::time::Duration::ZERO, |mail| {
            let drawing = mail.decode(&variables::drawing("painter", "?")).unwrap();
            seen.push((mail.key().to_owned(), drawing.primitives.len()));
        })
        .unwrap();
    assert_eq!(seen, [("DRAWING/painter/a".to_owned(), 1), ("DRAWING/painter/b".to_owned(), 2)]);
}

#[test]
fn what_nobody_would_believe_is_not_sent_and_said() {
    let broker = broker();
    let mut looker = Looker::new(&broker, "looker", &[variables::DRAWINGS, REJECTED]);
    let mut painter = join(&broker, "painter");
    let far = [[f32::INFINITY, 0.0, 0.0]];
    painter.comms.draw(&Drawing::new("far").points(far, COLOUR)).unwrap();
    painter.comms.draw(&Drawing::new("a/b").points([[0.0; 3]], COLOUR)).unwrap();
    painter.comms.draw(&Drawing::new("c").points([[0.0; 3]], Vec::new())).unwrap();
    painter.comms.flush().unwrap();
    let words = looker.words();
    assert_eq!(words.len(), 3, "{words:?}");
    assert!(words[0].contains("\"far\" is not sent: primitives[0].Points.at[0] is inf"), "{words:?}");
    assert!(words[1].contains("name is \"a/b\""), "{words:?}");
    assert!(words[2].contains("colours is 0 colours for 1 places"), "{words:?}");
}

#[test]
fn an_app_has_so_many_drawings_and_no_more() {
    let broker = broker();
    let mut looker = Looker::new(&broker, "looker", &[variables::DRAWINGS, REJECTED]);
    let mut painter = join(&broker, "painter");
    (0..=MAX_DRAWINGS).for_each(|i| painter.comms.draw(&line(&i.to_string())).unwrap());
    painter.comms.draw(&Drawing::new("0")).unwrap();
    painter.comms.draw(&line("new")).unwrap();
    painter.comms.flush().unwrap();
    let keys = looker.keys();
    assert_eq!(keys.iter().filter(|key| *key == REJECTED).count(), 1);
    assert!(keys.contains(&"DRAWING/painter/new".to_owned()) && !keys.contains(&"DRAWING/painter/64".to_owned()));
}

/// An app that counts its drawings, and the presses of its keys.
#[derive(Default)]
struct Painter {
    drawings: u32,
    presses: Vec<KeyPress>,
}

impl Painter {
    fn on_the_bus(self) -> Handled<Self> {
        Handlers::<Self>::new()
            .on("STOP", |_, comms: &mut Comms, _| {
                comms.stop();
                Ok::<(), AppError>(())
            })
            .draw(|painter, comms| {
                painter.drawings += 1;
                comms.draw(&line("late"))?;
                comms.draw(&line("brief").lasting(5.0))
            })
            .on_key("g", "more", |painter, _, press| {
                painter.presses.push(press.clone());
                Ok::<(), AppError>(())
            })
            .with(self)
    }
}

fn press(app: &str, key: &str) -> KeyPress {
    KeyPress { app: app.into(), key: key.into(), shift: true, alt: false }
}

#[test]
fn an_app_draws_for_nobody_once_and_when_somebody_begins_to_look() {
    let broker = broker();
    let (mut app, mut client) = (Painter::default().on_the_bus(), join(&broker, "painter"));
    begin_app(&mut app, &mut client).unwrap();
    assert!(client.comms.is_watched().unwrap(), "until the broker has answered");
    take_turn(&mut app, &mut client).unwrap();
    assert!(!client.comms.is_watched().unwrap());
    assert_eq!(app.state.drawings, 0);
    let mut looker = Looker::new(&broker, "looker", &[variables::DRAWINGS]);
    take_turn(&mut app, &mut client).unwrap();
    assert!(client.comms.is_watched().unwrap());
    assert_eq!(app.state.drawings, 1);
    assert_eq!(looker.keys(), ["DRAWING/painter/late", "DRAWING/painter/brief"]);
    // One more changes nothing; the last one that goes does.
    let other = Looker::new(&broker, "other", &["*"]);
    take_turn(&mut app, &mut client).unwrap();
    assert_eq!(app.state.drawings, 1);
    drop((looker, other));
    take_turn(&mut app, &mut client).unwrap();
    assert!(!client.comms.is_watched().unwrap());
}

#[test]
fn what_an_app_has_drawn_goes_with_it_but_what_goes_by_itself() {
    let broker = broker();
    let mut looker = Looker::new(&broker, "looker", &[variables::DRAWINGS, variables::KEYS]);
    let (mut app, mut client) = (Painter::default().on_the_bus(), join(&broker, "painter"));
    begin_app(&mut app, &mut client).unwrap();
    take_turn(&mut app, &mut client).unwrap();
    looker.0.comms.notify("STOP", 1.0).unwrap();
    looker.0.comms.flush().unwrap();
    run_app_on(&mut app, &mut client, &AtomicBool::new(false)).unwrap();
    let heard = looker.heard();
    let bytes = |value: &Value| if let Value::Binary { bytes, .. } = value { bytes.len() } else { 0 };
    let late: Vec<usize> =
        heard.iter().filter(|(key, _)| key == "DRAWING/painter/late").map(|(_, value)| bytes(value)).collect();
    assert!(late.first() > late.last(), "the last one is empty: {late:?}");
    let brief = heard.iter().filter(|(key, _)| key == "DRAWING/painter/brief").map(|(_, value)| bytes(value));
    assert!(brief.max() == heard.iter().filter(|(key, _)| key == "DRAWING/painter/brief").map(|(_, v)| bytes(v)).min());
    let keys = heard.iter().filter(|(key, _)| key == "KEYS/painter").count();
    assert!(keys >= 2, "declared, and taken back: {heard:?}");
}

#[test]
fn a_key_that_is_pressed_comes_to_its_app_and_no_press_of_before() {
    let broker = broker();
    let mut hand = join(&broker, "view");
    let mut say = |pressed: &KeyPress| {
        hand.comms.publish(&variables::key_press("painter"), pressed).unwrap();
        hand.comms.flush().unwrap();
    };
    say(&press("painter", "g"));
    let (mut app, mut client) = (Painter::default().on_the_bus(), join(&broker, "painter"));
    begin_app(&mut app, &mut client).unwrap();
    take_turn(&mut app, &mut client).unwrap();
    assert!(app.state.presses.is_empty(), "it was pressed before the app was there");
    say(&press("painter", "g"));
    say(&press("painter", "k"));
    take_turn(&mut app, &mut client).unwrap();
    assert_eq!(app.state.presses, [press("painter", "g")]);
    assert_eq!(client.comms.rejected(), 1, "k is no key of it");
}

#[test]
fn two_apps_that_declare_one_key_are_told() {
    let broker = broker();
    let mut looker = Looker::new(&broker, "looker", &[REJECTED]);
    let mut first = join(&broker, "zebra");
    first.comms.take_keys(&KeyTable::new([("g", "gallop")])).unwrap();
    first.comms.flush().unwrap();
    let (mut app, mut client) = (Painter::default().on_the_bus(), join(&broker, "painter"));
    begin_app(&mut app, &mut client).unwrap();
    take_turn(&mut app, &mut client).unwrap();
    first.receive(std::time::Duration::ZERO, |_| ()).unwrap();
    assert_eq!(looker.words(), ["painter: key \"g\" is not painter's: zebra has declared it already"]);
    // A key of the view's own is nobody's.
    first.comms.take_keys(&KeyTable::new([("v", "vault")])).unwrap();
    first.comms.flush().unwrap();
    first.receive(std::time::Duration::ZERO, |_| ()).unwrap();
    first.comms.flush().unwrap();
    assert_eq!(looker.words(), ["zebra: key \"v\" is not zebra's: the view has declared it already"]);
}

#[test]
fn limits_are_asked_at_the_decode() {
    let decodes = |drawing: &Drawing| {
        let mut bytes = Vec::new();
        crate::codec::encode_onto(drawing, &mut bytes).unwrap();
        let type_ = crate::TypeRef::of::<Drawing>();
        crate::ValueRef::Binary { type_, bytes: &bytes }
            .decode(&variables::drawing("a", "b"))
            .map_err(|e| e.to_string())
    };
    let image = |columns, count| Primitive::Image {
        corner: [0.0; 3],
        along: [1.0, 0.0, 0.0],
        across: [0.0, 1.0, 0.0],
        columns,
        pixels: vec![COLOUR; count],
    };
    let many = |count: usize| Drawing::new("m").points(vec![[0.0; 3]; count], COLOUR);
    let most = elk_drawing::limits::MAX_VERTICES;
    decodes(&many(most)).unwrap();
    decodes(&Drawing::new("i").with(image(4, 8))).unwrap();
    let colours = Colours(vec![COLOUR, COLOUR]);
    for (bad, why) in [
        (many(most + 1), "262145 long"),
        (many(most).points([[0.0; 3]], COLOUR), "262145 vertices"),
        (Drawing::new("i").with(image(3, 8)), "8 pixels in rows of 3"),
        (Drawing::new("i").with(image(0, 8)), "8 pixels in rows of 0"),
        (Drawing::new("l").lines([[0.0; 3]; 3], COLOUR), "3 places"),
        (Drawing::new("t").triangles([[0.0; 3]; 4], COLOUR), "4 places"),
        (Drawing::new("p").points([[0.0; 3]; 3], colours), "2 colours for 3 places"),
        (Drawing::new("t").text([0.0; 3], "a\u{1b}[2J", COLOUR), "control"),
        (Drawing::new("t").text([0.0; 3], "x".repeat(2000), COLOUR), "2000 bytes"),
        (Drawing::new("x".repeat(65)), "name"),
        (line("z").lasting(0.0), "lifetime_s is 0"),
        (line("z").lasting(f64::NAN), "lifetime_s is NaN"),
        (Drawing::new("v").voxels([[0.0; 3]], -1.0, COLOUR), "edge_m is -1"),
    ] {
        let error = decodes(&bad).unwrap_err();
        assert!(error.contains(why), "{why}: {error}");
    }
}
