//! Types that some of those who carry them have never seen.

use elk_bus::broker::table::{REQUEST, TABLE, VariableKind};
use elk_bus::{Client, Key, Origin, Payload, TypeRef, Value, ValueRef, any, payload};
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
    let (mut car, mut viewer) = (t.connect("car").unwrap(), t.connect("viewer").unwrap());
    car.comms.publish(&STEERING, &steering(0.5, 0)).unwrap();
    settle(&mut car);
    viewer.comms.register(&Key::<other_build::Steering>::new("STEERING")).unwrap();
    settle(&mut viewer);
    settle(&mut car);
    for told in [&mut car, &mut viewer] {
        let told: Vec<String> = told.inbox.take_refusals().into_iter().map(|refused| refused.reason).collect();
        let how = "(angle is in rad in car's build and in deg in viewer's): this reader cannot read it";
        assert!(told.len() == 1 && told[0].contains(how), "{told:?}");
    }
    let other = Key::<other_build::Steering>::new("STEERING");
    let mut said = None;
    let mut late = t.connect("other").unwrap();
    late.comms.register("STEERING").unwrap();
    let patience = crate::common::events::Patience::new();
    while said.is_none() {
        let decode = |mail: &elk_bus::Mail<'_>| mail.decode(&other).map(drop).unwrap_err().to_string();
        late.receive(patience.left("a value"), |mail| said = Some(decode(mail))).unwrap();
    }
    let wrong = "STEERING carries another Steering than this reader's: angle is in rad there and in deg here; \
                 build both from one version";
    assert_eq!(said.as_deref(), Some(wrong));
    drop((car, viewer, late));
    t.stop();
}
