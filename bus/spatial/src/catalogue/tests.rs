use std::collections::BTreeSet;

use nalgebra::{Point3, Vector3};
use proptest::prelude::*;
use serde_json::json;

use super::*;
use crate::map::{OccupancyGrid, State};
use crate::pose::Pose;
use crate::voxel::Voxel;

/// The types that `source` names behind `before`.
fn types_behind<'a>(source: &'a str, before: &str) -> BTreeSet<&'a str> {
    let names = source.split(before).skip(1).filter_map(|rest| rest.split(|c: char| !c.is_alphanumeric()).next());
    names.filter(|name| name.starts_with(char::is_uppercase)).collect()
}

#[test]
fn every_type_that_a_key_carries_is_in_the_catalogue() {
    let carried = types_behind(include_str!("../keys.rs"), "Key<");
    assert!(carried.len() > 10, "{carried:?}");
    for name in carried {
        assert!(named(name).is_some(), "{name} travels under a key, and CATALOGUE does not know it");
    }
}

#[test]
fn every_key_is_known_with_its_type() {
    let source = include_str!("../keys.rs");
    let keys = source.lines().filter_map(|line| line.split_once("Key::new(\""));
    let mut checked = 0;
    for (declared, name) in keys {
        let name = name.trim_end_matches("\");");
        let carried = carried_by(name).unwrap_or_else(|| panic!("CARRIED does not know {name}"));
        assert!(types_behind(declared, "Key<").contains(carried.name), "{name} does not carry {}", carried.name);
        checked += 1;
    }
    assert!(checked > 10);
    assert_eq!(carried_by("SCAN_1").unwrap().name, "Scan");
    assert!(carried_by("NAV_X").is_none());
}

#[test]
fn every_type_has_an_example_that_goes_both_ways() {
    for payload in CATALOGUE {
        let example: Value = serde_json::from_str(payload.example).unwrap();
        let bytes = payload.from_json(&example).unwrap();
        let json = to_json(payload.name, payload.layout, &bytes, usize::MAX).unwrap();
        assert_eq!(payload.from_json(&json).unwrap(), bytes, "{}", payload.name);
        if payload.name != MapUpdate::NAME {
            assert_eq!(json.to_string(), payload.example, "the fields' order, too");
        }
        assert_eq!(CATALOGUE.iter().filter(|other| other.name == payload.name).count(), 1, "{}", payload.name);
    }
}

#[test]
fn a_damaged_value_is_an_error() {
    for payload in CATALOGUE {
        let mut bytes = payload.from_json(&serde_json::from_str(payload.example).unwrap()).unwrap();
        bytes.pop();
        assert!(payload.to_json(&bytes, usize::MAX).is_err(), "{}", payload.name);
    }
}

#[test]
fn what_is_wrong_in_json_is_named_and_what_is_right_shown() {
    let say = |json: Value| named("Progress").unwrap().from_json(&json).unwrap_err().to_string();
    let right = named("Progress").unwrap().example;
    assert_eq!(
        say(json!({"scan": 1})),
        format!("this is no Progress: missing field `revision`; right is, for example, {right}")
    );
    let mut surplus: Value = serde_json::from_str(right).unwrap();
    surplus["scams"] = 2.into();
    assert!(say(surplus).contains("unknown field `scams`"));
    let mut deep: Value = serde_json::from_str(named("MotionReport").unwrap().example).unwrap();
    deep["marks"][0]["extra"] = 1.into();
    let deep = named("MotionReport").unwrap().from_json(&deep).unwrap_err().to_string();
    assert!(deep.contains("unknown field `marks.extra`"), "{deep}");
    assert!(say(json!(7)).contains("invalid type"));
}

#[test]
fn unknown_types_and_other_layouts_are_told_apart() {
    assert!(matches!(to_json("Whatever", 1, &[], 9), Err(ReadError::UnknownType { .. })));
    assert!(matches!(to_json("Plan", 1, &[], 9), Err(ReadError::OtherLayout { type_name: "Plan", .. })));
}

#[test]
fn a_map_is_written_a_character_a_cell() {
    let mut map = OccupancyGrid::new(0.1);
    map.set(Voxel::new(1, 0, 0), State::Free);
    map.set(Voxel::new(2, 0, 0), State::Occupied);
    let payload = named("MapUpdate").unwrap();
    let bytes = encoded(&map.whole(4)).unwrap();
    let json = payload.to_json(&bytes, usize::MAX).unwrap();
    let cells = json["bricks"][0]["cells"].as_str().unwrap();
    assert_eq!((&cells[..4], cells.len()), ("?.#?", 512));
    assert_eq!(payload.from_json(&json).unwrap(), bytes);
    assert_eq!(payload.to_json(&bytes, 0).unwrap()["bricks"], "1 bricks");
    assert_eq!(payload.to_json(&bytes, 8).unwrap()["bricks"][0]["cells"], "512 cells");
    for bad in ["x".to_owned(), ".".repeat(513)] {
        let json = json!({"revision": 1, "since": 0, "scan": 1, "resolution": 0.1,
                          "bricks": [{"brick": [0, 0, 0], "cells": bad}]});
        assert!(payload.from_json(&json).is_err());
    }
}

#[test]
fn long_lists_are_counted() {
    let points = (0..300).map(|i| Point3::new(i as f32, 0.0, 0.1)).collect();
    let scan = Scan::new(1, 1, Pose::looking(Point3::origin(), Vector3::x()), points);
    let bytes = encoded(&scan).unwrap();
    let short = to_json(Scan::NAME, Scan::LAYOUT, &bytes, 8).unwrap();
    assert_eq!(short["points"], "300 points");
    assert_eq!(short["pose"]["rotation"].as_array().unwrap().len(), 4, "short lists stay");
    let long = to_json(Scan::NAME, Scan::LAYOUT, &bytes, 300).unwrap();
    assert_eq!(long["points"][299].to_string(), "[299.0,0.0,0.1]", "as people write an f32");
    let mut lists = json!({"looks": [1, 2, 3]});
    shorten(&mut lists, "", 2);
    assert_eq!(lists, json!({"looks": "3 looks"}));
}

proptest! {
    #[test]
    fn points_come_back_bit_for_bit(points in prop::collection::vec(prop::array::uniform3(prop::num::f32::NORMAL | prop::num::f32::ZERO | prop::num::f32::SUBNORMAL), 0..20)) {
        let pose = Pose::looking(Point3::origin(), Vector3::x());
        let scan = Scan::new(1, 2, pose, points.into_iter().map(Point3::from).collect());
        let bytes = encoded(&scan).unwrap();
        let json = to_json(Scan::NAME, Scan::LAYOUT, &bytes, usize::MAX).unwrap();
        let read: Value = serde_json::from_str(&json.to_string()).unwrap();
        prop_assert_eq!(named("Scan").unwrap().from_json(&read).unwrap(), bytes);
    }
}
