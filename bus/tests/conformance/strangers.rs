//! Types that some of those who carry them have never seen.

use elk_bus::broker::table::{REQUEST, TABLE, VariableKind};
use elk_bus::{Client, Introduction, Key, Origin, Payload, TypeRef, Value, ValueRef, any, payload};
use serde_json::json;

use crate::hearing::{hear, settle};
use crate::transport::Transport;

/// How the car is steered.
#[payload]
#[derive(Debug, Clone, PartialEq)]
pub struct Steering {
    /// Anticlockwise.
    #[describe(unit = "rad", range = -4.0..=4.0)]
    pub angle: f64,
    /// Where each wheel points.
    pub wheels: Vec<Wheel>,
}

/// A wheel.
#[payload]
#[derive(Debug, Clone, PartialEq)]
pub struct Wheel {
    /// Which one.
    pub name: String,
    /// Whether it is driven.
    pub driven: bool,
}

mod other_build {
    /// The same as somebody else has it.
    #[elk_bus::payload]
    pub struct Steering {
        /// Anticlockwise.
        #[describe(unit = "deg")]
        pub angle: f64,
        /// Where each wheel points.
        pub wheels: Vec<super::Wheel>,
    }
}

mod newer_build {
    /// The same, with what was added.
    #[elk_bus::payload]
    #[derive(Debug, Clone, PartialEq)]
    pub struct Steering {
        /// How much of the angle is heeded.
        #[describe(default = 1.0, range = 0.0..=1.0)]
        pub share: f64,
        /// Anticlockwise.
        #[describe(unit = "rad", range = -4.0..=4.0)]
        pub angle: f64,
        /// Where each wheel points.
        pub wheels: Vec<Wheel>,
    }

    /// A wheel.
    #[elk_bus::payload]
    #[derive(Debug, Clone, PartialEq)]
    pub struct Wheel {
        /// Which one.
        pub name: String,
        /// Whether it is driven.
        pub driven: bool,
        /// What is on it.
        #[describe(default)]
        pub tyre: Option<String>,
    }
}

const NEWER: Key<newer_build::Steering> = Key::new("STEERING");
const STEERING: Key<Steering> = Key::new("STEERING");

fn steering(angle: f64, wheels: usize) -> Steering {
    let wheel = |i: usize| Wheel { name: format!("wheel {i}"), driven: i.is_multiple_of(2) };
    Steering { angle, wheels: (0..wheels).map(wheel).collect() }
}

/// What `client` hears of a type, as JSON.
fn json_of(client: &mut Client, key: &str) -> serde_json::Value {
    let heard = hear(client, |heard| heard.iter().any(|(name, ..)| name == key));
    let (_, _, value, _) = heard.iter().find(|(name, ..)| name == key).unwrap();
    value.as_ref().to_json(3).unwrap()
}

pub fn whoever_has_never_seen_a_type_reads_its_values<T: Transport>() {
    let t = T::start("stranger");
    let (mut car, mut viewer) = (t.connect("car").unwrap(), t.connect("viewer").unwrap());
    viewer.comms.register(any("*").from("car")).unwrap();
    settle(&mut viewer);
    car.comms.publish(&STEERING, &steering(0.5, 1)).unwrap();
    car.comms.flush().unwrap();
    let one = json!([{"name": "wheel 0", "driven": true}]);
    assert_eq!(json_of(&mut viewer, "STEERING"), json!({"angle": 0.5, "wheels": one}));
    // As a bulk value, too; and to whoever comes late.
    car.comms.publish(&STEERING, &steering(1.5, 5000)).unwrap();
    car.comms.flush().unwrap();
    assert_eq!(json_of(&mut viewer, "STEERING"), json!({"angle": 1.5, "wheels": "5000 wheels"}));
    let mut late = t.connect("late").unwrap();
    late.comms.register("STEERING").unwrap();
    assert_eq!(json_of(&mut late, "STEERING")["angle"], 1.5);
    // The table has what the variable carries, with units and docs, and what is only expected.
    late.comms.register(&Key::<Wheel>::new("SPARE")).unwrap();
    late.comms.notify(REQUEST, 1.0).unwrap();
    late.comms.flush().unwrap();
    let heard = hear(&mut late, |heard| heard.iter().any(|(key, ..)| key == TABLE.name()));
    let table = heard.iter().find(|(key, ..)| key == TABLE.name()).unwrap().2.as_ref().decode(&TABLE).unwrap();
    let described = table.type_of(Steering::NAME, Steering::LAYOUT);
    let description = described.as_ref().description().unwrap().to_text();
    assert!(description.contains(r#""docs":"Anticlockwise.","unit":"rad""#), "{description}");
    let late_client = table.clients.iter().find(|client| client.name == "late").unwrap();
    let spare = late_client.registrations.iter().find(|registration| registration.key_pattern == "SPARE").unwrap();
    assert_eq!(spare.expects, Some(VariableKind::Typed { name: "Wheel".into(), layout: Wheel::LAYOUT }));
    assert!(table.type_of(Wheel::NAME, Wheel::LAYOUT).as_ref().description().is_some());
    drop((car, viewer, late));
    t.stop();
}

pub fn a_description_that_comes_late_is_heard_of<T: Transport>() {
    let t = T::start("late-word");
    let (mut silent, mut car) = (t.connect("silent").unwrap(), t.connect("car").unwrap());
    let mut viewer = t.connect("viewer").unwrap();
    viewer.comms.register("STEERING*").unwrap();
    settle(&mut viewer);
    // A type by name alone, as a log of long ago may have it.
    let whole = Value::Binary { type_: TypeRef::of::<Steering>().to_type(), bytes: bytes(&steering(0.5, 0)) };
    let ValueRef::Binary { bytes, .. } = whole.as_ref() else { unreachable!() };
    let nameless = ValueRef::Binary { type_: TypeRef::undescribed(Steering::NAME, Steering::LAYOUT), bytes };
    silent.comms.publish_value("STEERING", nameless, Origin::default()).unwrap();
    silent.comms.flush().unwrap();
    let heard = hear(&mut viewer, |heard| heard.len() == 1);
    assert!(heard[0].2.as_ref().to_json(3).unwrap_err().to_string().contains("nobody has described Steering"));
    car.comms.publish(&STEERING, &steering(0.25, 0)).unwrap();
    car.comms.flush().unwrap();
    assert_eq!(json_of(&mut viewer, "STEERING")["angle"], 0.25);
    silent.comms.publish_value("STEERING", nameless, Origin::default()).unwrap();
    silent.comms.flush().unwrap();
    assert_eq!(json_of(&mut viewer, "STEERING")["angle"], 0.5, "a type is one type, whoever writes it");
    drop((silent, car, viewer));
    t.stop();
}

fn bytes(steering: &Steering) -> Vec<u8> {
    let mut bytes = Vec::new();
    elk_bus::codec::encode_onto(steering, &mut bytes).unwrap();
    bytes
}

pub fn two_builds_of_a_type_are_told_where_they_differ<T: Transport>() {
    let t = T::start("builds");
    let of = |name, build| t.join(&Introduction { build, ..Introduction::new(name) }).unwrap();
    let (mut car, mut viewer) = (of("car", "car-app 1.0"), of("viewer", "viewer 2.1"));
    car.comms.publish(&STEERING, &steering(0.5, 0)).unwrap();
    settle(&mut car);
    viewer.comms.register(&Key::<other_build::Steering>::new("STEERING")).unwrap();
    settle(&mut viewer);
    settle(&mut car);
    for told in [&mut car, &mut viewer] {
        let told: Vec<String> = told.inbox.take_refusals().into_iter().map(|refused| refused.reason).collect();
        let how =
            "(angle is in rad in car (car-app 1.0) and in deg in viewer (viewer 2.1)): this reader cannot read it";
        assert!(told.len() == 1 && told[0].contains(how), "{told:?}");
    }
    // The one who comes second may be the writer, too.
    viewer.comms.register(&Key::<other_build::Steering>::new("STEERING_2")).unwrap();
    settle(&mut viewer);
    car.comms.publish(&Key::<Steering>::new("STEERING_2"), &steering(0.5, 0)).unwrap();
    settle(&mut car);
    settle(&mut viewer);
    for told in [&mut car, &mut viewer] {
        let told: Vec<String> = told.inbox.take_refusals().into_iter().map(|refused| refused.reason).collect();
        let how = "cannot read it (angle is in rad in car (car-app 1.0) and in deg in viewer (viewer 2.1))";
        assert!(told.len() == 1 && told[0].contains(how), "{told:?}");
    }
    let other = Key::<other_build::Steering>::new("STEERING");
    let mut said = None;
    let mut late = of("other", "");
    late.comms.register("STEERING").unwrap();
    let patience = crate::common::events::Patience::new();
    while said.is_none() {
        let decode = |mail: &elk_bus::Mail<'_>| mail.decode(&other).map(drop).unwrap_err().to_string();
        late.receive(patience.left("a value"), |mail| said = Some(decode(mail))).unwrap();
    }
    let wrong = "STEERING carries another Steering than this reader's: angle is in rad in car (car-app 1.0) and in deg in \
                 other; \
                 build both from one version";
    assert_eq!(said.as_deref(), Some(wrong));
    drop((car, viewer, late));
    t.stop();
}

/// What `client` hears next of `STEERING`, decoded.
fn heard<T>(client: &mut Client, decode: impl Fn(ValueRef<'_>) -> T) -> T {
    let heard = hear(client, |heard| heard.iter().any(|(key, ..)| key == "STEERING"));
    decode(heard.iter().find(|(key, ..)| key == "STEERING").unwrap().2.as_ref())
}

pub fn versions_of_a_type_that_differ_in_defaults_are_read_by_each_other<T: Transport>() {
    let t = T::start("versions");
    let join = |name| t.connect(name).unwrap();
    let (mut car, mut old_viewer) = (join("car"), join("old-viewer"));
    let (mut new_car, mut viewer) = (join("new-car"), join("viewer"));
    old_viewer.comms.register(&STEERING).unwrap();
    viewer.comms.register(&NEWER).unwrap();
    settle(&mut old_viewer);
    settle(&mut viewer);
    let newer = |steering: &Steering| {
        let wheel = |one: &Wheel| newer_build::Wheel { name: one.name.clone(), driven: one.driven, tyre: None };
        let wheels = steering.wheels.iter().map(wheel).collect();
        newer_build::Steering { share: 1.0, angle: steering.angle, wheels }
    };
    // Few wheels travel in a batch, many lie in shared memory; and the writers take turns.
    for (angle, wheels) in [(0.5, 2), (1.5, 5000), (2.5, 1)] {
        let said = steering(angle, wheels);
        car.comms.publish(&STEERING, &said).unwrap();
        car.comms.flush().unwrap();
        assert_eq!(heard(&mut viewer, |value| value.decode(&NEWER).unwrap()), newer(&said));
        assert_eq!(heard(&mut old_viewer, |value| value.decode(&STEERING).unwrap()), said);
        let mut added = newer(&said);
        added.wheels[0].tyre = Some("snow".into());
        added.share = 0.25;
        new_car.comms.publish(&NEWER, &added).unwrap();
        new_car.comms.flush().unwrap();
        assert_eq!(heard(&mut viewer, |value| value.decode(&NEWER).unwrap()), added);
        assert_eq!(heard(&mut old_viewer, |value| value.decode(&STEERING).unwrap()), said);
    }
    // What it is read as has its limits, whoever wrote it.
    car.comms.publish(&STEERING, &steering(9.0, 0)).unwrap();
    car.comms.flush().unwrap();
    let wrong = heard(&mut viewer, |value| value.decode(&NEWER).map(drop).unwrap_err().to_string());
    assert_eq!(wrong, "Steering.angle is 9; it has to be -4 to 4 rad");
    // The table has what lies there, as its writer has it.
    new_car.comms.publish(&NEWER, &newer(&steering(0.0, 0))).unwrap();
    new_car.comms.notify(REQUEST, 1.0).unwrap();
    new_car.comms.flush().unwrap();
    let heard = hear(&mut new_car, |heard| heard.iter().any(|(key, ..)| key == TABLE.name()));
    let table = heard.iter().find(|(key, ..)| key == TABLE.name()).unwrap().2.as_ref().decode(&TABLE).unwrap();
    let variable = table.variables.iter().find(|variable| variable.name == "STEERING").unwrap();
    assert_eq!(variable.kind, VariableKind::Typed { name: "Steering".into(), layout: newer_build::Steering::LAYOUT });
    for client in [&mut car, &mut old_viewer, &mut new_car, &mut viewer] {
        settle(client);
        assert_eq!(client.inbox.take_refusals(), []);
    }
    drop((car, old_viewer, new_car, viewer));
    t.stop();
}

/// Versions of a type of which each can be read as the next, and not the other way round.
mod growing {
    /// How it goes.
    pub mod first {
        /// How it goes.
        #[elk_bus::payload]
        #[derive(Debug, Clone, PartialEq)]
        pub enum Mode {
            /// Nothing moves.
            Off,
            /// It moves.
            On,
        }
    }

    /// One variant more.
    pub mod second {
        /// How it goes.
        #[elk_bus::payload]
        #[derive(Debug, Clone, PartialEq)]
        pub enum Mode {
            /// Nothing moves.
            Off,
            /// It is about to move.
            Standby,
            /// It moves.
            On,
        }
    }
}

const NOTHING: [&str; 0] = [];

/// What a client was told meanwhile.
fn told(client: &mut Client) -> Vec<String> {
    settle(client);
    client.inbox.take_refusals().into_iter().map(|refused| refused.reason).collect()
}

pub fn a_newer_writer_of_an_old_name_is_heard_of_by_who_cannot_read_it<T: Transport>() {
    const OLD: Key<growing::first::Mode> = Key::new("MODE");
    const NEW: Key<growing::second::Mode> = Key::new("MODE");
    let t = T::start("growing");
    let of = |name, build| t.join(&Introduction { build, ..Introduction::new(name) }).unwrap();
    let mut viewer = of("viewer", "viewer 2.1");
    viewer.comms.register(&OLD).unwrap();
    settle(&mut viewer);
    let mut car = of("car", "car 1.0");
    car.comms.publish(&OLD, &growing::first::Mode::On).unwrap();
    settle(&mut car);
    let left = |viewer: &mut Client| {
        hear(viewer, |heard| heard.iter().any(|(key, _, value, _)| key == "DB_EVENT" && is_end_of_car(value)))
    };
    viewer.comms.register("DB_EVENT").unwrap();
    settle(&mut viewer);
    drop(car);
    left(&mut viewer);
    let mut car = of("car", "car 2.0");
    for _ in 0..3 {
        car.comms.publish(&NEW, &growing::second::Mode::Standby).unwrap();
    }
    // The build that wrote what lies there is gone; its name is another build's by now.
    let how = "(Standby is in car (car 2.0) and not in car (car 1.0))";
    let of_writer = told(&mut car);
    assert!(of_writer.len() == 3 && of_writer[0].contains("Mode") && of_writer[0].contains(how), "{of_writer:?}");
    let of_reader = told(&mut viewer);
    assert!(of_reader.len() == 1 && of_reader[0].contains(how), "{of_reader:?}");
    assert!(
        of_reader[0].contains("MODE carries Mode") && of_reader[0].contains("by car, was refused"),
        "{of_reader:?}"
    );
    // As soon as all who read there can read the new version, nothing holds the variable to the old one.
    viewer.comms.unregister(&OLD).unwrap();
    viewer.comms.register(&NEW).unwrap();
    settle(&mut viewer);
    car.comms.publish(&NEW, &growing::second::Mode::Standby).unwrap();
    assert_eq!(told(&mut car), NOTHING);
    let is_new = |(key, _, value, _): &crate::hearing::Heard| {
        key == "MODE" && value.as_ref().decode(&NEW).is_ok_and(|mode| mode == growing::second::Mode::Standby)
    };
    hear(&mut viewer, |heard| heard.iter().any(is_new));
    // An old writer beside it is another matter: the one that is there writes on.
    let mut old = of("old", "car 1.0");
    old.comms.publish(&OLD, &growing::first::Mode::On).unwrap();
    let of_old = told(&mut old);
    let how = "(Standby is in car (car 2.0) and not in old (car 1.0))";
    assert!(of_old.len() == 1 && of_old[0].contains(how), "{of_old:?}");
    drop((car, old, viewer));
    t.stop();
}

fn is_end_of_car(value: &Value) -> bool {
    matches!(value, Value::Text(event) if event == "disconnected=car")
}

mod third_build {
    /// The same, where what the second build adds is another thing.
    #[elk_bus::payload]
    #[derive(Debug, Clone, PartialEq)]
    pub struct Steering {
        /// How much of the angle is heeded.
        #[describe(default = 1, range = 0..=1)]
        pub share: u32,
        /// Anticlockwise.
        #[describe(unit = "rad", range = -4.0..=4.0)]
        pub angle: f64,
        /// Where each wheel points.
        pub wheels: Vec<super::Wheel>,
    }
}

pub fn a_reader_of_a_third_version_hears_once_of_the_one_that_it_cannot_read<T: Transport>() {
    const THIRD: Key<third_build::Steering> = Key::new("STEERING");
    let t = T::start("third");
    let of = |name, build| t.join(&Introduction { build, ..Introduction::new(name) }).unwrap();
    let (mut car, mut new_car, mut viewer) = (of("car", "car 1.0"), of("new-car", "car 2.0"), of("viewer", "viewer 3"));
    viewer.comms.register(&THIRD).unwrap();
    settle(&mut viewer);
    let newer = newer_build::Steering { share: 0.5, angle: 0.25, wheels: Vec::new() };
    for turn in 0..3 {
        car.comms.publish(&STEERING, &steering(0.5, 1)).unwrap();
        assert_eq!(told(&mut car), NOTHING, "the first version is read");
        new_car.comms.publish(&NEWER, &newer).unwrap();
        let how = "cannot read it (share is f64 in new-car (car 2.0) and u32 in viewer (viewer 3))";
        for client in [&mut new_car, &mut viewer] {
            let told = told(client);
            match turn {
                0 => assert!(told.len() == 1 && told[0].contains(how), "{told:?}"),
                _ => assert_eq!(told, NOTHING, "it was said"),
            }
        }
    }
    drop((car, new_car, viewer));
    t.stop();
}
