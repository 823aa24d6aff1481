//! Versions of a type that differ in fields with defaults: values of the one are read as values of the other, bit for bit as
//! if they had been converted field by field.

use bincode::config::{Configuration, Fixint, LittleEndian};
use elk_describe::{Conversion, Describe, Description};
use proptest::prelude::*;
use serde::{Serialize, de::DeserializeOwned};
use serde_json::json;

const CONFIG: Configuration<LittleEndian, Fixint> = bincode::config::standard().with_fixed_int_encoding();

mod old {
    use super::*;
    use serde::Deserialize;

    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Describe)]
    pub struct Car {
        pub name: String,
        #[describe(default)]
        pub horn: Option<String>,
        pub spare: Option<Wheel>,
        pub wheels: Vec<Wheel>,
        pub doors: [Door; 2],
        pub driver: Driver,
        pub pair: (u8, Wheel),
    }
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Describe)]
    pub struct Wheel {
        #[describe(unit = "m", range = 0.1..=10.0)]
        pub radius: f64,
    }
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Describe)]
    pub struct Door {
        #[describe(default = -7)]
        pub angle: i32,
        pub open: bool,
    }
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Describe)]
    pub enum Driver {
        Nobody,
        Person { name: String },
        Robot(Wheel),
    }
}

mod new {
    use super::*;
    use serde::Deserialize;

    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Describe)]
    pub struct Car {
        #[describe(default = 2026)]
        pub year: u16,
        pub name: String,
        pub spare: Option<Wheel>,
        #[describe(default = ["red", "green"])]
        pub colours: Vec<String>,
        pub wheels: Vec<Wheel>,
        pub doors: [Door; 2],
        pub driver: Driver,
        pub pair: (u8, Wheel),
        #[describe(default)]
        pub gear: Gear,
        #[describe(default = "Second")]
        pub reverse: Option<Gear>,
        #[describe(default)]
        pub trailer: Door,
    }
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Describe)]
    pub struct Wheel {
        #[describe(unit = "m", range = 0.1..=10.0)]
        pub radius: f64,
        #[describe(unit = "Pa", default = 2.5e5, range = 0.0..=1e6)]
        pub pressure: f32,
    }
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Describe)]
    pub struct Door {
        pub open: bool,
        #[describe(default = true)]
        pub locked: bool,
    }
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Describe)]
    pub enum Gear {
        First,
        Second,
    }
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Describe)]
    pub enum Driver {
        Nobody,
        Person {
            name: String,
            #[describe(default = [1, 2])]
            seat: (u8, u8),
        },
        Robot(Wheel),
        Dog,
    }
}

fn newer_wheel(old: old::Wheel) -> new::Wheel {
    new::Wheel { radius: old.radius, pressure: 2.5e5 }
}

fn older_wheel(new: new::Wheel) -> old::Wheel {
    old::Wheel { radius: new.radius }
}

fn newer(old: old::Car) -> new::Car {
    new::Car {
        year: 2026,
        name: old.name,
        spare: old.spare.map(newer_wheel),
        colours: vec!["red".into(), "green".into()],
        wheels: old.wheels.into_iter().map(newer_wheel).collect(),
        doors: old.doors.map(|door| new::Door { open: door.open, locked: true }),
        driver: match old.driver {
            old::Driver::Nobody => new::Driver::Nobody,
            old::Driver::Person { name } => new::Driver::Person { name, seat: (1, 2) },
            old::Driver::Robot(wheel) => new::Driver::Robot(newer_wheel(wheel)),
        },
        pair: (old.pair.0, newer_wheel(old.pair.1)),
        gear: new::Gear::First,
        reverse: Some(new::Gear::Second),
        trailer: new::Door { open: false, locked: true },
    }
}

prop_compose! {
    fn wheel()(radius in 0.1..10.0, pressure in 0.0..1e6f32) -> new::Wheel {
        new::Wheel { radius, pressure }
    }
}

prop_compose! {
    fn driver()(which in 0..3, name in ".{0,5}", wheel in wheel()) -> old::Driver {
        match which {
            0 => old::Driver::Nobody,
            1 => old::Driver::Person { name },
            _ => old::Driver::Robot(older_wheel(wheel)),
        }
    }
}

prop_compose! {
    fn old_car()(
        name in ".{0,9}", horn in proptest::option::of(".{0,9}"), spare in proptest::option::of(wheel()),
        wheels in proptest::collection::vec(wheel(), 0..5), doors in any::<[(i32, bool); 2]>(), driver in driver(),
        first in any::<u8>(), second in wheel(),
    ) -> old::Car {
        old::Car {
            name, horn, spare: spare.map(older_wheel), wheels: wheels.into_iter().map(older_wheel).collect(),
            doors: doors.map(|(angle, open)| old::Door { angle, open }), driver, pair: (first, older_wheel(second)),
        }
    }
}

fn bytes_of<T: Serialize>(value: &T) -> Vec<u8> {
    bincode::serde::encode_to_vec(value, CONFIG).unwrap()
}

fn value_of<T: DeserializeOwned>(bytes: &[u8]) -> T {
    let (value, read) = bincode::serde::decode_from_slice(bytes, CONFIG).unwrap();
    assert_eq!(read, bytes.len());
    value
}

/// As the description arrives.
fn described<T: Describe>() -> Description {
    Description::from_text(&Description::of(&T::SHAPE).to_text()).unwrap()
}

fn conversion<A: Describe, B: Describe>() -> Conversion {
    described::<A>().conversion_to(&described::<B>()).unwrap_or_else(|differ| panic!("{}", differ.in_words(["A", "B"])))
}

fn differ<A: Describe, B: Describe>() -> String {
    described::<A>().conversion_to(&described::<B>()).unwrap_err().in_words(["there", "here"])
}

proptest! {
    #[test]
    fn an_old_value_is_read_as_a_new_one_with_defaults(old in old_car()) {
        let bytes = conversion::<old::Car, new::Car>().convert(&bytes_of(&old)).unwrap();
        let new: new::Car = value_of(&bytes);
        prop_assert_eq!(&new, &newer(old));
        prop_assert_eq!(new.check(), Ok(()));
    }

    #[test]
    fn bytes_that_are_none_are_an_error_and_ask_for_nothing(mut bytes in proptest::collection::vec(any::<u8>(), 0..200), old in old_car()) {
        let conversion = conversion::<old::Car, new::Car>();
        let _ = conversion.convert(&bytes);
        let right = bytes_of(&old);
        prop_assert!(conversion.convert(&right[..right.len() - 1]).is_err());
        bytes.splice(0..0, bytes_of(&(1u64 << 60)));
        let lists = described::<Vec<old::Wheel>>().conversion_to(&described::<Vec<new::Wheel>>()).unwrap();
        prop_assert!(lists.convert(&bytes).is_err());
    }
}

#[test]
fn a_new_value_is_read_as_an_old_one_without_what_that_does_not_have() {
    // Of the enum the old version has fewer variants: nothing says what a dog is there.
    assert_eq!(differ::<new::Car, old::Car>(), "driver.Dog is there and not here");
    type New = (new::Wheel, Vec<new::Door>, Option<new::Wheel>, String);
    type Old = (old::Wheel, Vec<old::Door>, Option<old::Wheel>, String);
    let wheel = new::Wheel { radius: 0.5, pressure: 1.0 };
    let door = |open| new::Door { open, locked: false };
    let new: New = (wheel.clone(), vec![door(true), door(false)], Some(wheel), "behind".into());
    let old: Old = value_of(&conversion::<New, Old>().convert(&bytes_of(&new)).unwrap());
    let door = |open| old::Door { angle: -7, open };
    let wheel = old::Wheel { radius: 0.5 };
    assert_eq!(old, (wheel.clone(), vec![door(true), door(false)], Some(wheel), "behind".into()));
}

#[test]
fn packed_values_are_converted_one_by_one() {
    let packed = |fields: serde_json::Value| {
        let of = json!({"packed": {"struct": {"name": "Pixel", "fields": fields}}});
        Description::from_text(&of.to_string()).unwrap()
    };
    let grey = json!({"name": "grey", "kind": {"unsigned": 1}});
    let alpha = json!({"name": "alpha", "default": 255, "kind": {"unsigned": 1}});
    let (old, new) = (packed(json!([grey])), packed(json!([grey, alpha])));
    let bytes = old.to_bytes(&json!([{"grey": 1}, {"grey": 2}])).unwrap();
    let converted = old.conversion_to(&new).unwrap().convert(&bytes).unwrap();
    assert_eq!(new.to_json(&converted, 9).unwrap(), json!([{"grey": 1, "alpha": 255}, {"grey": 2, "alpha": 255}]));
    assert_eq!(new.conversion_to(&old).unwrap().convert(&converted).unwrap(), bytes);
}

#[test]
fn what_has_no_default_or_stands_elsewhere_keeps_versions_apart() {
    mod other {
        use elk_describe::Describe;
        #[derive(Describe)]
        pub struct Wheel {
            #[describe(unit = "m")]
            pub radius: f64,
            pub pressure: f32,
        }
        #[derive(Describe)]
        pub struct Door {
            #[describe(default)]
            pub locked: bool,
            pub open: bool,
        }
    }
    assert_eq!(differ::<old::Wheel, other::Wheel>(), "pressure is here and not there");
    assert_eq!(differ::<other::Wheel, old::Wheel>(), "pressure is there and not here");
    assert_eq!(differ::<Option<other::Door>, Option<new::Door>>(), "field 1 of it is locked there and open here");
    assert_eq!(differ::<new::Wheel, other::Wheel>(), "pressure is in Pa there and without a unit here");
}

#[test]
fn a_default_travels_is_shown_and_may_be_left_out() {
    let wheel = described::<new::Wheel>();
    assert_eq!(wheel, Description::of(&new::Wheel::SHAPE));
    let bytes = wheel.to_bytes(&json!({"radius": 1.0})).unwrap();
    assert_eq!(value_of::<new::Wheel>(&bytes), new::Wheel { radius: 1.0, pressure: 2.5e5 });
    assert_eq!(described::<new::Car>().example()["reverse"], "Second");
    let json: serde_json::Value = serde_json::from_str(&described::<old::Car>().to_text()).unwrap();
    assert_eq!(json["struct"]["fields"][1]["default"], serde_json::Value::Null);
    assert!(json["struct"]["fields"][1].as_object().unwrap().contains_key("default"));
    assert_eq!(old::Wheel::SHAPE.layout(), {
        #[derive(Describe)]
        #[allow(dead_code)]
        struct Wheel {
            #[describe(unit = "m", default)]
            radius: f64,
        }
        Wheel::SHAPE.layout()
    });
}

#[test]
fn a_default_that_is_none_is_refused() {
    let refused = |kind: serde_json::Value, default: serde_json::Value| {
        let fields = json!([{"name": "odd", "default": default, "kind": kind}]);
        let described = json!({"struct": {"name": "Odd", "fields": fields}}).to_string();
        Description::from_text(&described).unwrap_err().to_string()
    };
    for (kind, default) in [
        (json!({"unsigned": 1}), json!(256)),
        (json!("text"), json!(null)),
        (json!({"symbols": {"bits": 2, "letters": "abcd", "least": 1 << 24}}), json!("")),
        (json!({"list": {"packed": {"float": 4}}}), json!([])),
    ] {
        assert!(refused(kind, default).contains("the default of odd is no value of its kind"));
    }
}

/// What is said of values without names, in the unit of one version and of another.
#[allow(dead_code)]
mod unnamed {
    pub mod metres {
        use elk_describe::Describe;
        #[derive(Describe)]
        pub struct Status(#[describe(unit = "m")] f64, #[describe(unit = "s")] f64);
        #[derive(Describe)]
        pub struct Length(#[describe(unit = "m")] f64);
        #[derive(Describe)]
        pub enum Event {
            Moved(#[describe(unit = "m")] f64),
            Turned(#[describe(unit = "rad")] f64, bool),
        }
        #[derive(Describe)]
        pub struct Path {
            length: Length,
        }
    }
    pub mod others {
        use elk_describe::Describe;
        #[derive(Describe)]
        pub struct Status(#[describe(unit = "m")] f64, #[describe(unit = "min")] f64);
        #[derive(Describe)]
        pub struct Length(f64);
        #[derive(Describe)]
        pub enum Event {
            Moved(#[describe(unit = "m")] f64),
            Turned(#[describe(unit = "deg")] f64, bool),
        }
        #[derive(Describe)]
        pub struct Path {
            length: Length,
        }
    }
    pub mod plain {
        use elk_describe::Describe;
        #[derive(Describe)]
        pub struct Status(
            /// How far.
            f64,
            f64,
        );
    }
}

#[test]
fn units_of_values_without_names_keep_versions_apart_and_travel() {
    use unnamed::{metres, others, plain};
    assert_eq!(differ::<metres::Status, others::Status>(), "[1] is in s there and in min here");
    assert_eq!(differ::<metres::Length, others::Length>(), "it is in m there and without a unit here");
    assert_eq!(differ::<others::Path, metres::Path>(), "length is without a unit there and in m here");
    assert_eq!(differ::<metres::Event, others::Event>(), "Turned[0] is in rad there and in deg here");
    assert_ne!(metres::Status::SHAPE.layout(), others::Status::SHAPE.layout());
    assert_eq!(described::<metres::Status>().layout(), metres::Status::SHAPE.layout());
    assert_eq!(described::<metres::Status>().kind().to_string(), "(f64 m, f64 s)");
    // Without units, layouts are what they were before anything could be said there, and logs of then are read.
    assert_eq!(plain::Status::SHAPE.layout(), <(f64, f64)>::SHAPE.layout());
    assert!(described::<plain::Status>().to_text().contains("How far."));
    let json = json!([1.0, 2.0]);
    let bytes = described::<metres::Status>().to_bytes(&json).unwrap();
    assert_eq!(bytes, bytes_of(&(1.0, 2.0)));
    assert_eq!(described::<metres::Status>().to_json(&bytes, 9).unwrap(), json);
    assert_eq!(described::<metres::Event>().example(), json!({"Moved": 0.0}));
}
