use elk_bus::{Describe, Description, Type, ValueRef};
use elk_geometry::{Pose, State};
use serde_json::{Value, json};

use super::*;
use crate::samples::{SAMPLES, Sample, named};

/// What no field of eight or of four bytes may take: as numbers NaN, infinities, far too much and the most negative, and
/// all of what is beyond 2^48.
fn hostile() -> Vec<Vec<u8>> {
    let doubles = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e300, -1.0, 0.0];
    let eight = doubles.into_iter().map(f64::to_bits).chain([u64::MAX, 1 << 63, 1 << 48]);
    let singles = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX];
    let four = singles.into_iter().map(f32::to_bits).chain([i32::MIN as u32, i32::MAX as u32, u32::MAX]);
    eight.map(|word| word.to_le_bytes().to_vec()).chain(four.map(|word| word.to_le_bytes().to_vec())).collect()
}

/// The example of a type with a hostile number at every place of its bytes in turn.
fn spoilt(sample: &Sample) -> impl Iterator<Item = Vec<u8>> {
    let bytes = sample.bytes();
    let words = hostile();
    (0..bytes.len()).flat_map(move |at| {
        let (bytes, words) = (bytes.clone(), words.clone());
        words.into_iter().filter_map(move |word| {
            let mut spoilt = bytes.clone();
            spoilt.get_mut(at..at + word.len())?.copy_from_slice(&word);
            Some(spoilt)
        })
    })
}

fn ends(value: &Value, each: &mut impl FnMut(&Value)) {
    match value {
        Value::Array(entries) => entries.iter().for_each(|entry| ends(entry, each)),
        Value::Object(fields) => fields.values().for_each(|field| ends(field, each)),
        end => each(end),
    }
}

/// Whatever stands where, what is believed is finite, and what is counted stays far from the end of its bits.
#[test]
fn what_is_believed_is_finite_and_within_what_a_mission_can_mean() {
    let (mut refused, mut believed) = (0, 0);
    // What a strategy scores its goals by has no limits.
    for sample in SAMPLES.iter().filter(|sample| !["Scan", "Candidates"].contains(&sample.name())) {
        for bytes in spoilt(sample) {
            if sample.check(&bytes).is_err() {
                refused += 1;
                continue;
            }
            believed += 1;
            let json = sample.type_.to_json(&bytes, usize::MAX).unwrap();
            // JSON has no NaN and no infinity: they would be texts. Null is what is not there at all.
            let optional = ["/leg", "/ended", "/last_step", "/leg/ended", "/pose", "/recorded", "/next_secs", "/off_m"];
            let absent = optional.iter().filter(|field| json.pointer(field) == Some(&Value::Null)).count();
            let mut nulls = 0;
            ends(&json, &mut |end| {
                nulls += usize::from(end.is_null());
                assert!(!["NaN", "inf", "-inf"].iter().any(|word| end == word), "{}: {json}", sample.name());
                // A map's log-odds, packed, are bits and no counts.
                let is_bits = sample.name() == "MapMemory";
                let bits = end.as_u64().is_some_and(|n| n > MAX_COUNT) && !is_bits;
                assert!(!bits && end.as_f64().is_none_or(|n| n.abs() < 1e20), "{}: {json}", sample.name());
            });
            assert_eq!(nulls, absent, "{}: {json}", sample.name());
        }
    }
    assert!(refused > 1000 && believed > 100, "{refused} refused, {believed} believed");
}

/// A type as somebody describes it who keeps to no range.
fn without_ranges(description: &mut Value) {
    match description {
        Value::Array(entries) => entries.iter_mut().for_each(without_ranges),
        Value::Object(fields) => {
            fields.remove("range");
            fields.values_mut().for_each(without_ranges);
        }
        _ => {}
    }
}

fn invalid(name: &str, change: impl Fn(&mut Value)) -> String {
    let sample = named(name).unwrap();
    let mut json = sample.value();
    change(&mut json);
    let mut description = serde_json::from_str(&sample.type_.text()).unwrap();
    without_ranges(&mut description);
    let bytes = Description::from_text(&description.to_string()).unwrap().to_bytes(&json).unwrap();
    sample.check(&bytes).unwrap_err().to_string()
}

#[test]
fn what_cannot_be_is_named_with_its_way_and_what_is_right() {
    let said = invalid("Plan", |plan| plan["motion"]["clearance_m"] = json!(100.0));
    assert_eq!(said, "Plan.motion.clearance_m is 100; it has to be 0 to 10 m");
    let said = invalid("Plan", |plan| plan["motion"]["scan_spacing_m"] = json!(0.0));
    assert_eq!(said, "Plan.motion.scan_spacing_m is 0; it has to be 0.01 to 1000 m");
    let said = invalid("Plan", |plan| plan["decision"]["Go"]["points"] = json!([[0.0, 0.0, 0.0], [1e9, 0.0, 0.0]]));
    assert_eq!(said, "Plan.decision.Go.points[1].x is 1000000000; it has to be -327680 to 327680 m");
    let said = invalid("ExplorerMemory", |memory| memory["lists"]["trail"][0]["y"] = json!(i32::MIN));
    assert!(said.starts_with("ExplorerMemory.lists.trail[0] is a voxel with index -2147483648"), "{said}");
    let said = invalid("SensorReport", |report| report["scans"] = json!(u64::MAX));
    assert_eq!(said, "SensorReport.scans is 18446744073709551615; it has to be below 2^48");
    let said = invalid("MapMemory", |memory| memory["bricks"][0]["known"][0] = json!(7));
    assert!(said.contains("MapMemory.bricks[0].log_odds is a list of 2"), "{said}");
    let said = invalid("CameraPose", |camera| camera["pose"]["rotation"] = json!([0.0, 0.0, 0.0, 2.0]));
    assert!(said.contains("CameraPose.pose.rotation is a quaternion of length 2"), "{said}");
    let said = invalid("ExplorationReport", |report| report["reason"] = json!("\u{1b}[2J"));
    assert!(said.contains("reason is a text with '\\u{1b}'"), "{said}");
}

#[test]
fn a_leg_is_looked_at_in_voxels_before_anybody_walks_it() {
    let said = invalid("MotionMemory", |memory| memory["leg"]["plan"]["motion"]["clearance_m"] = json!(9.0));
    assert!(
        said.contains("leg.plan.decision.Go.clearance_m is 90 voxels; it has to be at most 32 voxels of 0.1 m"),
        "{said}"
    );
    let far = json!([[0.0, 0.0, 0.0], [3e5, 0.0, 0.0]]);
    let said = invalid("MotionMemory", |memory| memory["leg"]["plan"]["decision"]["Go"]["points"] = far.clone());
    assert!(said.contains("leg.plan.decision.Go.points is 3000000"), "{said}");
}

/// Each number may be one, and all together cannot.
#[test]
fn what_contradicts_itself_is_not_believed() {
    let motion = |field: &str, wrong: Value| invalid("MotionMemory", |memory| memory[field] = wrong.clone());
    assert_eq!(motion("allowed", json!(2)), "MotionMemory.allowed is 2; it has to be no later than commands");
    assert_eq!(motion("last_step", json!(-1.0)), "MotionMemory.last_step is -1; it has to be a time of 0 to 1e12 s");
    let said = invalid("MotionMemory", |memory| memory["awaited"]["Map"]["id"] = json!(2));
    assert_eq!(said, "MotionMemory.awaited.Map.id is 2; it has to be the last of commands");
    let asked = named("PlanRequest").unwrap().value();
    let said = invalid("MotionMemory", |memory| {
        memory["awaited"] = json!({ "Plan": asked });
        memory["awaited"]["Plan"]["id"] = json!(2);
    });
    assert_eq!(said, "MotionMemory.awaited.Plan.id is 2; it has to be the last of requests");
    let said = invalid("MotionMemory", |memory| {
        memory["samples"] = json!([memory["samples"][0].clone(), memory["samples"][0].clone()]);
    });
    assert_eq!(said, "MotionMemory.samples is a list out of order; it has to be in the order of scans");
    let said = invalid("ExplorerMemory", |memory| memory["progress_at"] = json!(2));
    assert_eq!(said, "ExplorerMemory.progress_at is 2; it has to be no later than the plan's revision");
    let said = invalid("ExplorerMemory", |memory| memory["strategy"] = json!("\u{1b}[2J"));
    assert!(said.starts_with("ExplorerMemory.strategy is a text with '\\u{1b}'"), "{said}");
    let part = |field: &str, wrong: Value| invalid("MapPart", |part| part[field] = wrong.clone());
    assert!(part("first", json!(1)).starts_with("MapPart.total is 1; it has to be no less than what comes before"));
    assert!(part("bricks", json!([])).starts_with("MapPart.bricks is empty; it has to be at least one"));
}

/// A list that decodes and is longer than any that apps make, or empty where one is needed.
#[test]
fn lists_and_texts_have_their_lengths() {
    let go = |points: Value| invalid("Plan", |plan| plan["decision"]["Go"]["points"] = points.clone());
    assert_eq!(go(json!([])), "Plan.decision.Go.points is empty; it has to be at least one point");
    let long = json!(vec![[0.0, 0.0, 0.0]; MAX_CORNERS + 1]);
    assert_eq!(go(long), "Plan.decision.Go.points is 131073 long; it has to be at most 131072 long");
    let name = "x".repeat(MAX_TEXT + 1);
    let said = invalid("Plan", |plan| plan["motion"]["name"] = json!(name));
    assert_eq!(said, "Plan.motion.name is 4097 bytes long; it has to be at most 4096 bytes");
    let counters = |total: u64| invalid("ExplorationReport", |report| report["counters"] = json!([["stalls", total]]));
    assert!(counters(MAX_COUNT + 1).contains("counters[0] is 281474976710656; it has to be below 2^48"));
    let secs = |secs: f64| invalid("ExplorationReport", |report| report["cpu_secs"] = json!([["field", secs]]));
    assert!(secs(-1.0).contains("cpu_secs[0] is -1; it has to be 0 to 1000000000000 s"), "{}", secs(-1.0));
}

#[test]
fn a_scan_is_checked_where_it_lies() {
    let sample = named("Scan").unwrap();
    let bytes = sample.bytes();
    let mut spoilt = bytes.clone();
    spoilt[16..24].copy_from_slice(&f64::NAN.to_le_bytes());
    let value = |bytes| ValueRef::Binary { type_: sample.type_, bytes };
    assert!(value(&bytes).decode(&crate::keys::SCAN).is_ok());
    let said = value(&spoilt).decode(&crate::keys::SCAN).unwrap_err().to_string();
    assert!(said.starts_with("Scan.pose.rotation"), "{said}");
    let scan = crate::Scan::new(1, 1, Pose::looking(Point3::origin(), nalgebra::Vector3::x()), Default::default());
    let said = |scan: crate::Scan<'_>| scan.check().unwrap_err().to_string();
    assert_eq!(scan.check(), Ok(()));
    let camera = crate::CameraInfo { range_m: f64::NAN, ..scan.camera };
    assert!(said(crate::Scan { camera, ..scan.clone() }).starts_with("camera.range_m is NaN"));
    assert!(said(crate::Scan { measured: 1 << 40, ..scan.clone() }).starts_with("measured is 1099511627776"));
    let point = [Point3::origin()].into_iter().collect();
    assert!(
        said(crate::Scan { points: point, ..scan.clone() })
            .starts_with("measured is 0; it has to be at least the number of")
    );
    let camera = crate::CameraInfo { columns: 4, rows: 2, ..scan.camera };
    let pixels = |outcome, pixels| crate::Scan {
        camera,
        pixel_runs: vec![crate::pixels::PixelRun { outcome, pixels }],
        ..scan.clone()
    };
    assert_eq!(pixels(1, 8).check(), Ok(()));
    assert!(
        said(pixels(1, 7))
            .starts_with("pixel_runs is 7; it has to be as many pixels as the camera's columns times rows")
    );
    assert!(said(pixels(6, 8)).starts_with("pixel_runs[0].outcome is 6"), "{}", said(pixels(6, 8)));
}

/// A scan of the next version, which says one thing more, is read by this one: its points are copied.
#[test]
fn a_scan_with_a_field_more_is_read_without_it_and_keeps_to_its_limits() {
    let sample = named("Scan").unwrap();
    let mut newer: serde_json::Value = serde_json::from_str(&sample.type_.text()).unwrap();
    let fields = newer["struct"]["fields"].as_array_mut().unwrap();
    fields.insert(1, serde_json::json!({"name": "exposure", "unit": "s", "default": 0.01, "kind": {"float": 8}}));
    let type_ = Type::described("Scan", Description::from_text(&newer.to_string()).unwrap());
    let read = |json: &serde_json::Value| {
        let bytes = type_.as_ref().description().unwrap().to_bytes(json).unwrap();
        let value = ValueRef::Binary { type_: type_.as_ref(), bytes: &bytes };
        value.decode(&crate::keys::SCAN).map(crate::Scan::into_owned).map_err(|error| error.to_string())
    };
    let mut json = sample.value();
    let own = sample.bytes();
    let own = ValueRef::Binary { type_: sample.type_, bytes: &own }.decode(&crate::keys::SCAN).unwrap();
    assert_eq!(read(&json).unwrap(), own);
    json["exposure"] = 0.5.into();
    assert_eq!(read(&json).unwrap(), own);
    json["measured"] = 0.into();
    assert!(read(&json).unwrap_err().starts_with("Scan.measured is 0; it has to be at least the number of points"));
}

#[test]
fn a_path_is_held_against_the_map() {
    let mut grid = OccupancyGrid::new(0.1);
    (0..40).for_each(|x| assert!(grid.set(Voxel::new(x, 0, 0), State::Free)));
    let at = |x: f64| Point3::new(x, 0.05, 0.05);
    assert!(path_in(&grid, &[at(0.0), at(3.9)], 0.1).is_ok_and(|way| (way.length() - 3.9).abs() < 1e-9));
    let far = path_in(&grid, &[at(0.0), at(9.0)], 0.1).unwrap_err();
    assert_eq!(far.to_string(), "points[1] is (9.00; 0.05; 0.05); it has to be near what is known of the map");
    let wide = path_in(&grid, &[at(0.0)], 3.3).unwrap_err();
    assert_eq!(wide.to_string(), "clearance_m is 33 voxels; it has to be at most 32 voxels of 0.1 m");
    let zigzag: Vec<_> = (0..1000).map(|i| at(f64::from(i % 2) * 3.0)).collect();
    let long = path_in(&grid, &zigzag, 0.1).unwrap_err();
    assert!(long.to_string().contains("m of way in a map of this size"), "{long}");
}
