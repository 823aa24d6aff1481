//! Types of every kind, and what anybody can do with their bytes.

use bincode::config::{Configuration, Fixint, LittleEndian};
use elk_describe::{Describe, Description, Invalid, Shape};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion};
use proptest::prelude::*;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

const CONFIG: Configuration<LittleEndian, Fixint> = bincode::config::standard().with_fixed_int_encoding();

/// All that a field can be.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Describe)]
struct Everything {
    /// Small.
    small: (u8, i8, u16, i16),
    large: (u32, i32, u64, i64),
    /// How far.
    #[describe(unit = "m", any)]
    far: f64,
    #[describe(any)]
    near: f32,
    flag: bool,
    nothing: (),
    name: String,
    maybe: Option<Box<Inner>>,
    list: Vec<Inner>,
    corners: [Point3<f32>; 2],
    pose: Isometry3<f64>,
    what: What,
    r#type: Newtype,
    pair: Pair,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Describe)]
struct Inner {
    #[describe(unit = "m", range = 0.0..=10.0)]
    clearance_m: f64,
    scan_spacing_m: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Describe)]
enum What {
    Nothing,
    /// One.
    One(u32),
    Two(u8, String),
    Fields {
        #[describe(longest = 3)]
        list: Vec<u16>,
    },
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Describe)]
struct Newtype(u16);

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Describe)]
struct Pair(bool, i64);

fn bytes_of<T: Serialize>(value: &T) -> Vec<u8> {
    bincode::serde::encode_to_vec(value, CONFIG).unwrap()
}

fn value_of<T: DeserializeOwned>(bytes: &[u8]) -> T {
    bincode::serde::decode_from_slice(bytes, CONFIG).unwrap().0
}

fn inner() -> impl Strategy<Value = Inner> {
    (0.0..=10.0, -1e3..1e3).prop_map(|(clearance_m, scan_spacing_m)| Inner { clearance_m, scan_spacing_m })
}

fn what() -> impl Strategy<Value = What> {
    prop_oneof![
        Just(What::Nothing),
        any::<u32>().prop_map(What::One),
        any::<(u8, String)>().prop_map(|(a, b)| What::Two(a, b)),
        proptest::collection::vec(any::<u16>(), 0..=3).prop_map(|list| What::Fields { list }),
    ]
}

prop_compose! {
    fn everything()(
        small in any::<(u8, i8, u16, i16)>(), large in any::<(u32, i32, u64, i64)>(),
        far in any::<f64>().prop_filter("finite", |far| far.is_finite()), near in -1e6f32..1e6,
        flag in any::<bool>(), name in ".*", maybe in proptest::option::of(inner().prop_map(Box::new)),
        list in proptest::collection::vec(inner(), 0..4), at in any::<[i16; 3]>(), turn in -3.0..3.0,
        what in what(), tag in any::<u16>(), pair in any::<(bool, i64)>(),
    ) -> Everything {
        let corner = Point3::from(at.map(f32::from));
        let pose = Isometry3::from_parts(
            Translation3::new(turn, 2.0, -1.0), UnitQuaternion::from_euler_angles(turn, 0.3, -turn),
        );
        Everything {
            small, large, far, near, flag, nothing: (), name, maybe, list, corners: [corner, corner * 2.0], pose, what,
            r#type: Newtype(tag), pair: Pair(pair.0, pair.1),
        }
    }
}

proptest! {
    #[test]
    fn a_value_goes_through_json_as_its_own_serde_has_it(value in everything()) {
        let description = Description::from_text(&Description::of(&Everything::SHAPE).to_text()).unwrap();
        let bytes = bytes_of(&value);
        let json = description.to_json(&bytes, usize::MAX).unwrap();
        let mut own = serde_json::to_value(&value).unwrap();
        // serde_json writes an f32 as the f64 that it is; people read the short one.
        own["near"] = json["near"].clone();
        prop_assert_eq!(&json, &own);
        prop_assert_eq!(value_of::<Everything>(&description.to_bytes(&json).unwrap()), value.clone());
        prop_assert_eq!(description.to_bytes(&json).unwrap(), bytes);
        prop_assert_eq!(value.check(), Ok(()));
    }

    #[test]
    fn bytes_that_are_none_are_an_error_and_ask_for_nothing(mut bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
        let description = Description::of(&Everything::SHAPE);
        let _ = description.to_json(&bytes, usize::MAX);
        bytes.splice(0..0, bytes_of(&(1u64 << 60)));
        let list = Description::of(&Vec::<Inner>::SHAPE).to_json(&bytes, usize::MAX);
        prop_assert!(list.unwrap_err().to_string().contains("a list of 1152921504606846976, and there are bytes for"));
    }

    #[test]
    fn whatever_is_said_of_a_type_is_refused_or_can_be_read(text in ".{0,80}", bytes in proptest::collection::vec(any::<u8>(), 0..64)) {
        if let Ok(description) = Description::from_text(&text) {
            let _ = description.to_json(&bytes, 10);
            description.to_bytes(&description.example()).unwrap();
        }
    }
}

#[test]
fn the_layout_sees_every_nested_change_and_travels() {
    #[derive(Describe)]
    struct Outer {
        inner: Inner,
    }
    mod exchanged {
        use elk_describe::Describe;
        #[derive(Describe)]
        pub struct Inner {
            scan_spacing_m: f64,
            #[describe(unit = "m")]
            clearance_m: f64,
        }
        #[derive(Describe)]
        pub struct Outer {
            inner: Inner,
        }
    }
    mod in_millimetres {
        use elk_describe::Describe;
        #[derive(Describe)]
        pub struct Inner {
            #[describe(unit = "mm")]
            clearance_m: f64,
            scan_spacing_m: f64,
        }
    }
    const LAYOUT: u64 = Outer::SHAPE.layout();
    assert_ne!(LAYOUT, exchanged::Outer::SHAPE.layout());
    assert_ne!(Inner::SHAPE.layout(), in_millimetres::Inner::SHAPE.layout());
    for shape in [Outer::SHAPE, exchanged::Outer::SHAPE, Everything::SHAPE] {
        let travelled = Description::from_text(&Description::of(&shape).to_text()).unwrap();
        assert_eq!(travelled, Description::of(&shape));
        assert_eq!(travelled.layout(), shape.layout());
    }
}

#[test]
fn docs_and_units_are_there() {
    let json: Value = serde_json::from_str(&Description::of(&Everything::SHAPE).to_text()).unwrap();
    let fields = &json["struct"]["fields"];
    assert_eq!(fields[0], json!({"name": "small", "docs": "Small.", "kind": fields[0]["kind"]}));
    assert_eq!(fields[2], json!({"name": "far", "docs": "How far.", "unit": "m", "kind": {"float": 8}}));
    assert_eq!(fields[12]["name"], "type");
}

#[test]
fn what_is_not_true_is_named_with_its_way() {
    let right = Inner { clearance_m: 1.0, scan_spacing_m: 2.0 };
    let wrong = Inner { clearance_m: 11.0, ..right.clone() };
    let said = |error: Result<(), Invalid>| error.unwrap_err().to_string();
    assert_eq!(said(vec![right.clone(), wrong].check()), "[1].clearance_m is 11; it has to be 0 to 10 m");
    let endless = Inner { scan_spacing_m: f64::NAN, ..right.clone() };
    assert_eq!(said(Some(endless).check()), "scan_spacing_m is NaN; it has to be a finite number");
    assert_eq!(said(What::Fields { list: vec![0; 4] }.check()), "Fields.list is 4 long; it has to be at most 3 long");
    assert_eq!(right.check(), Ok(()));
    #[derive(Describe)]
    struct Two(bool, f64);
    assert_eq!(said(Two(true, f64::NAN).check()), "[1] is NaN; it has to be a finite number");
    let turned = Isometry3::from_parts(
        Translation3::identity(),
        UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(2.0, 0.0, 0.0, 0.0)),
    );
    assert_eq!(said(turned.check()), "rotation is a quaternion of length 2; it has to be of length 1");
}

#[test]
fn who_says_something_wrong_is_told_where() {
    let description = Description::of(&Inner::SHAPE);
    let said = |json: Value| description.to_bytes(&json).unwrap_err().to_string();
    assert_eq!(said(json!({"clearance_m": 1})), "this is no Inner: scan_spacing_m is missing");
    assert_eq!(
        said(json!({"clearance_m": "x", "scan_spacing_m": 1})),
        "this is no Inner: clearance_m is \"x\"; it has to be a number"
    );
    assert_eq!(
        said(json!({"clearanc_m": 1})),
        "this is no Inner: the value has no field clearanc_m; it has clearance_m, scan_spacing_m"
    );
    let list = Description::of(&Vec::<(u8, What)>::SHAPE);
    let said = |json: Value| list.to_bytes(&json).unwrap_err().reason;
    assert_eq!(said(json!([[256, "Nothing"]])), "[0][0] is 256; it has to be a number from 0 to 255");
    assert_eq!(said(json!([[1, "Nothin"]])), "[0][1] is \"Nothin\"; it has to be one of Nothing, One, Two, Fields");
    assert_eq!(said(json!([[1, {"Two": [1]}]])), "[0][1].Two holds a list of 2");
    let cut = description.to_json(&[0; 12], 9).unwrap_err().to_string();
    assert_eq!(cut, "the bytes are no Inner: 8 bytes are needed, and 4 are left (at scan_spacing_m)");
}

#[test]
fn packed_values_and_symbols_are_read_as_people_write_them() {
    let points = Description::of(&Shape::Packed(&Shape::Array(&Shape::Float(4), 3)));
    let bytes = points.to_bytes(&json!([[0.1, 2.0, 3.0], [4.0, 5.0, 6.0]])).unwrap();
    assert_eq!((bytes.len(), bytes[0]), (8 + 24, 24));
    assert_eq!(points.to_json(&bytes, 9).unwrap(), json!([[0.1, 2.0, 3.0], [4.0, 5.0, 6.0]]));
    assert_eq!(points.to_json(&bytes, 1).unwrap(), json!("2 values"));
    let cells = Description::of(&Shape::Symbols(2, "?.#!", 0));
    let bytes = cells.to_bytes(&json!("?.#?#")).unwrap();
    assert_eq!(bytes, [&2u64.to_le_bytes()[..], &[0b0010_0100, 0b10]].concat());
    assert_eq!(cells.to_json(&bytes, 9).unwrap(), json!("?.#?#???"));
    assert_eq!(cells.to_json(&bytes, 7).unwrap(), json!("8 values"));
    let brick = Description::of(&Shape::Symbols(2, "?.#!", 512));
    assert_eq!(brick.to_bytes(&json!("#")).unwrap(), [&128u64.to_le_bytes()[..], &[2], &[0; 127]].concat());
    assert_eq!(brick.to_bytes(&brick.example()).unwrap().len(), 8 + 128);
}

#[test]
fn what_no_bytes_can_be_is_refused() {
    let refused = |json: Value| Description::from_text(&json.to_string()).unwrap_err().to_string();
    let mut deep = json!("bool");
    for _ in 0..40 {
        deep = json!({ "option": deep });
    }
    assert!(refused(deep).contains("more than 32 deep"));
    assert!(refused(json!({"list": "unit"})).contains("takes no byte"));
    let array = |of: Value| json!({"array": {"of": of, "count": 1 << 20}});
    assert!(refused(array(json!("unit"))).contains("takes no byte"));
    assert!(refused(array(array(json!("bool")))).contains("an array of"));
    assert!(refused(json!({"unsigned": 3})).contains("a number of 3 bytes"));
    assert!(refused(json!({"packed": "text"})).contains("no fixed width"));
    assert!(refused(json!({"symbols": {"bits": 2, "letters": "ab", "least": 0}})).contains("2^2"));
    assert!(refused(json!({"enum": {"name": "None", "variants": []}})).contains("no variant"));
    assert!(Description::from_text(&" ".repeat(1 << 17)).unwrap_err().to_string().contains("bytes"));
}

#[test]
fn two_definitions_differ_in_a_place_that_is_named() {
    let struct_of = |fields: Value| json!({"struct": {"name": "Car", "fields": fields}});
    let field = |name: &str, unit: &str, kind: Value| json!({"name": name, "unit": unit, "kind": kind});
    let read = |json: Value| Description::from_text(&json.to_string()).unwrap();
    let differ = |one: Value, other: Value| {
        let (one, other) = (read(struct_of(one)), read(struct_of(other)));
        assert!(one.conversion_to(&one).is_ok());
        one.conversion_to(&other).unwrap_err().in_words(["there", "here"])
    };
    let speed = field("speed", "m/s", json!({"float": 8}));
    let gear = field("gear", "", json!({"unsigned": 1}));
    assert_eq!(differ(json!([speed, gear]), json!([speed])), "gear is there and not here");
    assert_eq!(differ(json!([speed]), json!([speed, gear])), "gear is here and not there");
    assert_eq!(differ(json!([speed, gear]), json!([gear, speed])), "field 1 of it is speed there and gear here");
    let knots = field("speed", "kn", json!({"float": 8}));
    assert_eq!(differ(json!([speed]), json!([knots])), "speed is in m/s there and in kn here");
    let single = field("speed", "m/s", json!({"list": {"float": 4}}));
    assert_eq!(differ(json!([speed]), json!([single])), "speed is f64 there and [f32] here");
    let inner = |kind: &str| field("wheels", "", json!({"list": struct_of(json!([field("hub", "", json!(kind))]))}));
    assert_eq!(differ(json!([inner("bool")]), json!([inner("text")])), "wheels[].hub is bool there and text here");
    let driver = |variants: Value| field("who", "", json!({"enum": {"name": "Driver", "variants": variants}}));
    let nobody = json!({"name": "Nobody"});
    let person = json!({"name": "Person", "content": {"one": "text"}});
    let more = differ(json!([driver(json!([nobody, person]))]), json!([driver(json!([nobody]))]));
    assert_eq!(more, "who.Person is there and not here");
    let robot = json!({"name": "Person", "content": {"one": {"unsigned": 4}}});
    let other = differ(json!([driver(json!([person]))]), json!([driver(json!([robot]))]));
    assert_eq!(other, "who.Person is text there and u32 here");
}

#[test]
fn a_walk_sees_every_value_with_its_bytes_and_goes_in_where_it_is_let() {
    let description = Description::of(&Everything::SHAPE);
    let value = Everything {
        small: (1, 2, 3, 4),
        large: (5, 6, 7, 8),
        far: 9.0,
        near: 10.0,
        flag: true,
        nothing: (),
        name: "name".into(),
        maybe: Some(Box::new(Inner { clearance_m: 1.5, scan_spacing_m: 2.5 })),
        list: vec![Inner { clearance_m: 3.5, scan_spacing_m: 4.5 }],
        corners: [Point3::new(1.0, 2.0, 3.0); 2],
        pose: Isometry3::translation(6.5, 7.5, 8.5),
        what: What::Fields { list: vec![7, 8] },
        r#type: Newtype(3),
        pair: Pair(true, 4),
    };
    let bytes = bytes_of(&value);
    let (mut doubles, mut texts) = (Vec::new(), Vec::new());
    let mut see = |kind: &elk_describe::Kind, bytes: &[u8]| {
        match kind {
            elk_describe::Kind::Float(8) => doubles.push(f64::from_le_bytes(bytes.try_into().unwrap())),
            elk_describe::Kind::Text => texts.push(bytes.to_vec()),
            _ => {}
        }
        *kind == elk_describe::Kind::Rotation
    };
    description.visit(&bytes, &mut see).unwrap();
    assert_eq!(doubles, [9.0, 1.5, 2.5, 3.5, 4.5, 6.5, 7.5, 8.5]);
    assert_eq!(texts, [b"name".to_vec()]);
    assert!(description.visit(&bytes[..bytes.len() - 1], &mut |_, _| true).is_err());
}

macro_rules! nested {
    ($name:ident: $($inner:ident),*) => {
        nested!(@ $name, u8, $($inner)*);
    };
    (@ $name:ident, $type:ty, $first:ident $($rest:ident)*) => {
        #[derive(Describe)]
        #[allow(dead_code)]
        struct $first {
            inner: $type,
        }
        nested!(@ $name, $first, $($rest)*);
    };
    (@ $name:ident, $type:ty,) => {
        type $name = $type;
    };
}

#[test]
fn what_compiles_at_its_limits_travels() {
    // 31 structs in each other: four levels of JSON each.
    nested!(Deep: A, B, C, D, E, F, G, H, I, J, K, L, M, N, O, P, Q, R, S, T, U, V, W, X, Y, Z, A1, B1, C1, D1, E1);
    Description::from_text(&Description::of(&Deep::SHAPE).to_text()).unwrap();
    #[derive(Describe)]
    #[doc = include_str!("../src/describe.rs")]
    #[allow(dead_code)]
    struct Long(
        #[doc = include_str!("../src/description.rs")]
        #[describe(unit = "\"\\\"")]
        f64,
    );
    Description::from_text(&Description::of(&Long::SHAPE).to_text()).unwrap();
}

#[derive(Serialize, Describe)]
struct Limits {
    #[describe(unit = "m", range = 0.1..=5.0, default = 0.1)]
    near: f32,
    #[describe(range = ..10)]
    tries: i16,
    #[describe(range = PORTS)]
    port: u16,
    #[describe(count)]
    revision: Option<u64>,
    #[describe(range = -1.0..)]
    least: f64,
    speed: Speed,
}

const PORTS: std::ops::RangeInclusive<u16> = 1024..=u16::MAX;

#[derive(Serialize, Describe)]
struct Speed(#[describe(unit = "m/s", range = 0.0..3.0)] f64);

#[test]
fn ranges_travel_and_what_is_written_keeps_to_them() {
    let description = Description::from_text(&Description::of(&Limits::SHAPE).to_text()).unwrap();
    assert_eq!(description, Description::of(&Limits::SHAPE));
    let value = |field: &str, value: Value| {
        let mut json = json!({"near": 0.1, "tries": -3, "port": 1024, "revision": null, "least": -1, "speed": 2.5});
        json[field] = value;
        description.to_bytes(&json).map_err(|error| error.reason)
    };
    let limits = Limits { near: 0.1, tries: -3, port: 1024, revision: None, least: -1.0, speed: Speed(2.5) };
    assert_eq!(value("tries", json!(-3)), Ok(bytes_of(&limits)));
    for (field, json, wanted) in [
        ("near", json!(0.09), "near is 0.09; it has to be 0.1 to 5 m"),
        ("near", json!(1e300), "near is 1e+300; it has to be 0.1 to 5 m"),
        ("tries", json!(10), "tries is 10; it has to be less than 10"),
        ("port", json!(80), "port is 80; it has to be 1024 to 65535"),
        ("revision", json!(1u64 << 48), "revision is 281474976710656; it has to be less than 281474976710656"),
        ("least", json!(-1.5), "least is -1.5; it has to be at least -1"),
        ("speed", json!(3), "speed is 3; it has to be 0 to less than 3 m/s"),
    ] {
        assert_eq!(value(field, json), Err(wanted.to_owned()));
    }
    let example = description.example();
    assert_eq!(example, json!({"near": 0.1, "tries": 0, "port": 1024, "revision": null, "least": 0.0, "speed": 0.0}));
    description.to_bytes(&example).unwrap();
    let single = Description::of(&f32::SHAPE).to_bytes(&json!(1e300)).unwrap_err().reason;
    assert_eq!(single, "the value is 1e+300; it has to be a number from -3.4028235e38 to 3.4028235e38");
    #[derive(Describe)]
    struct Unlimited(#[describe(unit = "m/s")] f64);
    assert_eq!(Unlimited::SHAPE.layout(), Speed::SHAPE.layout());
}

#[derive(Debug, PartialEq, Serialize, Deserialize, Describe)]
#[allow(non_camel_case_types)]
enum r#Attempt {
    r#Try(Option<Option<u32>>),
    r#Done(Option<()>, #[describe(any)] f64, #[describe(any)] f32),
}

#[test]
fn what_json_has_no_word_for_comes_back_too() {
    let description = Description::of(&Attempt::SHAPE);
    assert_eq!(description.name(), "Attempt");
    for (value, json) in [
        (Attempt::Try(Some(None)), json!({"Try": [null]})),
        (Attempt::Try(None), json!({"Try": null})),
        (Attempt::Try(Some(Some(3))), json!({"Try": [3]})),
        (Attempt::Done(Some(()), f64::INFINITY, f32::NEG_INFINITY), json!({"Done": [[null], "inf", "-inf"]})),
    ] {
        let bytes = bytes_of(&value);
        assert_eq!(description.to_json(&bytes, 9).unwrap(), json);
        assert_eq!(value_of::<Attempt>(&description.to_bytes(&json).unwrap()), value);
    }
    let endless = bytes_of(&Attempt::Done(None, f64::NAN, f32::NAN));
    let json = description.to_json(&endless, 9).unwrap();
    assert_eq!(json, json!({"Done": [null, "NaN", "NaN"]}));
    let Attempt::Done(None, double, single) = value_of(&description.to_bytes(&json).unwrap()) else { panic!("{json}") };
    assert!(double.is_nan() && single.is_nan());
    assert_eq!(description.to_finite_json(&endless, 9).unwrap(), json!({"Done": [null, null, null]}));
    let description = Description::of(&Speed::SHAPE);
    assert!(description.to_bytes(&json!("NaN")).unwrap_err().reason.contains("0 to less than 3 m/s"));
}
