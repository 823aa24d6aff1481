//! Values as texts and back; and texts that say none.

use elk_describe::{Describe, Description};
use proptest::prelude::*;
use serde_json::{Value, json};

use super::*;

/// As in the thesis (4.3.2.2).
#[derive(Describe)]
struct PoseEstimate {
    /// x, y and heading.
    pose: [f64; 3],
}

/// What a way may come to.
#[derive(Describe)]
#[expect(dead_code, reason = "it is only described")]
enum Decision {
    /// There.
    Go {
        /// Corners.
        points: Vec<[f64; 3]>,
        /// The voxel that it is for.
        target: Voxel,
    },
    /// Turn by so much.
    Turn(f64),
    /// Several.
    Both(f64, bool),
    /// Nothing is left.
    Done,
}

/// A voxel.
#[derive(Describe)]
struct Voxel {
    /// Its place.
    x: i32,
    y: i32,
}

/// A counter.
#[derive(Describe)]
struct Counter {
    /// Its name.
    name: String,
    /// Its value.
    value: f64,
}

/// All kinds.
#[derive(Describe)]
struct Everything {
    /// A count.
    id: u64,
    /// Time of the processor.
    #[describe(unit = "s", range = 0.0..=10.0)]
    cpu_secs: f64,
    /// A flag.
    early_stop: bool,
    /// Words.
    words: String,
    /// Perhaps a count.
    contacts: Option<u64>,
    /// Perhaps a voxel.
    seen: Option<Voxel>,
    /// Rows.
    turn: [[f32; 2]; 2],
    /// Short numbers.
    small: Vec<i8>,
    /// Voxels.
    voxels: Vec<Voxel>,
    /// Things with words.
    counters: Vec<Counter>,
    /// What is decided.
    decision: Decision,
    /// Nested.
    within: Voxel,
    /// Two things.
    pair: (f64, String),
    /// New.
    #[describe(default = 4)]
    newer: u8,
}

fn form<T: Describe>(name: &str) -> Form {
    Form::of(Type::described(name, Description::of(&T::SHAPE))).unwrap()
}

fn bytes<T: Describe>(json: &Value) -> Vec<u8> {
    Description::of(&T::SHAPE).to_bytes(json).unwrap()
}

fn example() -> Value {
    json!({
        "id": u64::MAX, "cpu_secs": 0.1, "early_stop": true, "words": "plain words", "contacts": null,
        "seen": {"x": -3, "y": 4}, "turn": [[0.1, 1.0], [2.0, 3.5]], "small": [-128, 127],
        "voxels": [{"x": 1, "y": 2}, {"x": 3, "y": 4}], "counters": [{"name": "a,b", "value": 1.5}],
        "decision": {"Go": {"points": [[0.4, 1.9, 2.2], [1.0, 2.0, 3.0]], "target": {"x": 7, "y": 8}}},
        "within": {"x": 5, "y": 6}, "pair": [0.5, "two"], "newer": 9,
    })
}

#[test]
fn the_thesis_pose_estimate_goes_both_ways() {
    let (form, said) = (form::<PoseEstimate>("PoseEstimate"), "Name=POSE_ESTIMATE,Pose=[3x1]{0.4,1.9,2.2}");
    let value = bytes::<PoseEstimate>(&json!({"pose": [0.4, 1.9, 2.2]}));
    assert_eq!(form.text("POSE_ESTIMATE", &value, Poses::InSpace).unwrap(), said);
    let read = |said: &str| form.read("POSE_ESTIMATE", said).unwrap();
    assert_eq!(read(said), Read { bytes: value.clone(), time: None });
    // As it is printed there, with blanks and the time.
    let printed = "Name=POSE_ESTIMATE, Time=1308749109, Pose=[3x1]{0.4,1.9,2.2}";
    assert_eq!(read(printed), Read { bytes: value.clone(), time: Some(1_308_749_109.0) });
    for other in ["Pose=[3x1]{0.4,1.9,2.2}", " pose = [ 1X3 ] { 0.4 , 1.9 , 2.2 } ,"] {
        assert_eq!(read(other).bytes, value, "{other}");
    }
}

/// Where a camera of elk's is.
#[derive(Describe)]
struct CameraPose {
    /// The command.
    command: u64,
    /// The pose.
    pose: nalgebra::Isometry3<f64>,
}

#[test]
fn three_numbers_are_a_pose_in_the_plane() {
    let form = form::<CameraPose>("CameraPose");
    let said = "Name=SIM,Command=1,Pose=[3x1]{0.4,1.9,2.2}";
    let bytes = form.read("SIM", said).unwrap().bytes;
    assert_eq!(form.text("SIM", &bytes, Poses::InPlane).unwrap(), said, "both ways");
    let json = Description::of(&CameraPose::SHAPE).to_json(&bytes, usize::MAX).unwrap();
    let rotation: Vec<f64> = serde_json::from_value(json["pose"]["rotation"].clone()).unwrap();
    let turn =
        nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::from(<[f64; 4]>::try_from(rotation).unwrap()));
    let (sin, cos) = 2.2_f64.sin_cos();
    for (axis, points) in [
        (nalgebra::Vector3::z(), [cos, sin, 0.0]),
        (nalgebra::Vector3::x(), [sin, -cos, 0.0]),
        (nalgebra::Vector3::y(), [0.0, 0.0, -1.0]),
    ] {
        assert!((turn * axis - nalgebra::Vector3::from(points)).norm() < 1e-12, "x right, y down, z forward");
    }
    assert_eq!(json["pose"]["translation"], json!([0.4, 1.9, 0.0]));
    let whole = form.text("SIM", &bytes, Poses::InSpace).unwrap();
    assert!(whole.contains("Pose.Rotation=[4x1]{") && form.read("SIM", &whole).unwrap().bytes == bytes, "{whole}");
    let wrong = form.read("SIM", "Command=1,Pose=[2x1]{0.4,1.9}").unwrap_err();
    assert!(wrong.contains("[7x1]{…}, or [3x1]{x,y,heading}, or Pose.Rotation and Pose.Translation"), "{wrong}");
    assert!(form.read("SIM", "Command=1,Pose=[3x1]{0.4,x,2}").is_err());
    let texts = Texts::of("SIM_*:plane NAV");
    let told = ["SIM_POSE", "NAV", "OTHER"].map(|variable| texts.poses(variable));
    assert_eq!(told, [Some(Poses::InPlane), Some(Poses::InSpace), None]);
}

#[test]
fn every_kind_of_value_has_its_text() {
    let (form, value) = (form::<Everything>("Everything"), bytes::<Everything>(&example()));
    let text = form.text("ALL", &value, Poses::InSpace).unwrap();
    let expected = concat!(
        "Name=ALL,Id=18446744073709551615,CpuSecs=0.1,EarlyStop=true,Words=plain words,Seen.X=-3,Seen.Y=4,",
        "Turn=[2x2]{0.1,1.0,2.0,3.5},Small=[2x1]{-128,127},Voxels=[2x2]{1,2,3,4},",
        r#"Counters=[{"name":"a,b","value":1.5}],"#,
        "Decision=Go,Decision.Go.Points=[2x3]{0.4,1.9,2.2,1.0,2.0,3.0},Decision.Go.Target.X=7,Decision.Go.Target.Y=8,",
        r#"Within.X=5,Within.Y=6,Pair=[0.5,"two"],Newer=9"#,
    );
    assert_eq!(text, expected);
    assert_eq!(form.read("ALL", &text).unwrap().bytes, value);
    let other = text.replace("Within.X=5,Within.Y=6", "Within=[2x1]{5,6}").replace("CpuSecs", "cpu_secs");
    let other = other.replace(",Newer=9", "").replace("Id=18446744073709551615", "Id=2.000");
    let mut changed = example();
    (changed["id"], changed["newer"]) = (2.into(), 4.into());
    assert_eq!(form.read("ALL", &other).unwrap().bytes, bytes::<Everything>(&changed), "{other}");
    for (decision, said) in [
        (json!("Done"), "Decision=Done"),
        (json!({"Turn": 0.5}), "Decision=Turn,Decision.Turn=0.5"),
        (json!({"Both": [0.5, true]}), "Decision=Both,Decision.Both=[0.5,true]"),
    ] {
        changed["decision"] = decision;
        let value = bytes::<Everything>(&changed);
        let text = form.text("ALL", &value, Poses::InSpace).unwrap();
        assert!(text.contains(said), "{text}");
        assert_eq!(form.read("ALL", &text).unwrap().bytes, value);
    }
}

#[test]
fn a_wrong_text_is_told_its_key_and_what_would_be_right() {
    let form = form::<Everything>("Everything");
    let good = form.text("ALL", &bytes::<Everything>(&example()), Poses::InSpace).unwrap();
    let wrong = |from: &str, to: &str| {
        assert!(good.contains(from), "{from}");
        form.read("ALL", &good.replace(from, to)).unwrap_err()
    };
    for (from, to, said) in [
        ("Id=18446744073709551615", "Id=-1", "this is no Everything: id is -1; it has to be a number from 0 to"),
        ("Id=18446744073709551615", "Id=many", "Id is \"many\"; it has to be a whole number from 0 on"),
        ("Id=18446744073709551615", "Id=1.5", "Id is \"1.5\"; it has to be a whole number from 0 on"),
        ("CpuSecs=0.1", "CpuSecs=11", "cpu_secs is 11; it has to be 0 to 10 s"),
        ("CpuSecs=0.1,", "", "CpuSecs is missing; it has to be a number"),
        ("EarlyStop=true", "EarlyStop=1", "EarlyStop is \"1\"; it has to be true or false"),
        ("Turn=[2x2]", "Turn=[2x3]", "Turn is \"[2x3]{0.1,1.0,2.0,3.5}\", with 4 numbers; it has to be [4x1]{…}"),
        ("Turn=[2x2]{0.1,1.0,2.0,3.5}", "Turn=[3x1]{1,2,3}", "it has to be [4x1]{…}"),
        ("{0.1,1.0,", "{0.1,one,", "in which \"one\" is no such number"),
        ("Small=[2x1]{-128,127}", "Small=-128", "Small is \"-128\"; it has to be [Nx1]{…}, for N of them"),
        ("Small=[2x1]{-128", "Small=[2x1]{-129", "small[0] is -129; it has to be a number from -128 to 127"),
        ("Voxels=[2x2]", "Voxels=[4x1]", "it has to be [Nx2]{…}, for N of them"),
        ("Decision=Go,", "Decision=Stay,", "Decision is \"Stay\"; it has to be one of Go, Turn, Both, Done"),
        ("Decision=Go,", "", "Decision is missing; it has to be one of Go, Turn, Both, Done"),
        ("Decision=Go,", "Decision=Done,", "there is no \"Decision.Go.Points\"; its keys are Id, CpuSecs"),
        ("Within.X=5,Within.Y=6", "Within=[3x1]{5,6,7}", "it has to be [2x1]{…}, or Within.X and Within.Y"),
        ("Within.X=5", "Within.Z=5", "Within.X is missing"),
        ("Within.X=5", "Within.X=5,Within.Z=1", "there is no \"Within.Z\"; its keys are Id, CpuSecs"),
        ("\"value\":1.5}]", "\"value\":}]", "it has to be JSON: expected value"),
        ("\"value\":1.5}]", "\"value\":\"x\"}]", "counters[0].value is \"x\"; it has to be a number"),
        ("Name=ALL", "Name=SOME", "Name is \"SOME\"; the message is of ALL"),
        ("Name=ALL", "Time=now", "Time is \"now\"; it has to be a number, in s"),
        ("Name=ALL", "id=1", "is said twice"),
        ("Name=ALL", "hello", "Id is missing"),
    ] {
        let error = wrong(from, to);
        assert!(error.contains(said), "{from} → {to}: {error}");
    }
    assert!(form.read("ALL", "hello").unwrap_err().contains("\"hello\" is no Key=Value"));
    let many: String = (0..2000).map(|k| format!("K{k}=1,")).collect();
    assert!(form.read("ALL", &many).unwrap_err().contains("more than 1024 keys"));
}

#[test]
fn what_is_no_struct_and_what_has_a_name_of_its_own_have_texts_too() {
    let number = form::<f64>("Depth");
    let value = bytes::<f64>(&json!(1.5));
    assert_eq!(number.text("DEPTH", &value, Poses::InSpace).unwrap(), "Name=DEPTH,Value=1.5");
    assert_eq!(number.read("DEPTH", "Value=1.5").unwrap().bytes, value);
    let counter = form::<Counter>("Counter");
    let value = bytes::<Counter>(&json!({"name": "", "value": "inf"}));
    assert_eq!(counter.text("COUNT", &value, Poses::InSpace).unwrap(), "Name=\"\",Value=inf");
    assert_eq!(counter.read("COUNT", "Name=\"\",Value=inf").unwrap().bytes, value);
}

#[test]
fn what_cannot_be_a_text_is_said() {
    assert_eq!(Form::of(Type::undescribed("Secret", 7)).unwrap_err(), "nobody has described Secret");
    let odd = r#"{"struct":{"name":"Odd","fields":[{"name":"a=b","kind":"bool"}]}}"#;
    let odd = Type::described("Odd", Description::from_text(odd).unwrap());
    assert_eq!(Form::of(odd).unwrap_err(), "Odd is no text: \"a=b\" cannot be a key");
    let twin = r#"{"struct":{"name":"Twin","fields":[{"name":"a_b","kind":"bool"},{"name":"AB","kind":"bool"}]}}"#;
    let twin = Type::described("Twin", Description::from_text(twin).unwrap());
    assert_eq!(Form::of(twin).unwrap_err(), "Twin is no text: another name is the same key as AB");
    let form = form::<Counter>("Counter");
    assert!(form.text("X", &[1], Poses::InSpace).unwrap_err().starts_with("the bytes are no Counter"));
    assert!(
        form.text("X", &vec![0; LONGEST_VALUE + 1], Poses::InSpace)
            .unwrap_err()
            .contains("at most 65536 become a text")
    );
}

#[test]
fn patterns_stand_with_blanks_or_commas_between_them() {
    let texts = Texts::of(" SIM_SENSOR, PLAN\tNAV_* ");
    assert_eq!(texts.patterns().collect::<Vec<_>>(), ["SIM_SENSOR", "PLAN", "NAV_*"]);
    assert!(texts.poses("NAV_X").is_some() && texts.poses("PLAN").is_some() && texts.poses("PLAN_REQUEST").is_none());
    assert!(Texts::default().is_empty() && Texts::default().poses("X").is_none());
}

fn everything() -> impl Strategy<Value = Value> {
    let voxel = || (any::<i32>(), any::<i32>()).prop_map(|(x, y)| json!({"x": x, "y": y}));
    let number = || {
        prop_oneof![
            any::<f64>().prop_map(|number| match number.is_finite() {
                true => json!(number),
                false => json!(number.to_string()),
            }),
            Just(json!("NaN")),
            Just(json!(-0.0))
        ]
    };
    let decision = prop_oneof![
        Just(json!("Done")),
        number().prop_map(|turn| json!({"Turn": turn})),
        (number(), any::<bool>()).prop_map(|(number, flag)| json!({"Both": [number, flag]})),
        (prop::collection::vec([number(), number(), number()], 0..3), voxel())
            .prop_map(|(points, target)| json!({"Go": {"points": points, "target": target}})),
    ];
    let single = || any::<f32>().prop_map(|number| if number.is_finite() { json!(number) } else { json!("inf") });
    let some =
        (any::<u64>(), 0.0..10.0, any::<bool>(), ".{0,12}", prop::option::of(any::<u64>()), prop::option::of(voxel()));
    let lists = (
        [[single(), single()], [single(), single()]],
        prop::collection::vec(any::<i8>(), 0..4),
        prop::collection::vec(voxel(), 0..4),
        prop::collection::vec((".{0,6}", number()), 0..3),
    );
    (some, lists, decision, voxel(), (number(), "[a-z,={}\"\\\\\\[ ]{0,8}"), any::<u8>()).prop_map(
        |((id, secs, stop, words, contacts, seen), (turn, small, voxels, counters), decision, within, pair, newer)| {
            let counters: Vec<_> = counters.iter().map(|(name, value)| json!({"name": name, "value": value})).collect();
            json!({
                "id": id, "cpu_secs": secs, "early_stop": stop, "words": words, "contacts": contacts, "seen": seen,
                "turn": turn, "small": small, "voxels": voxels, "counters": counters, "decision": decision,
                "within": within, "pair": [pair.0, pair.1], "newer": newer,
            })
        },
    )
}

proptest! {
    #[test]
    fn values_come_back_from_their_texts(value in everything()) {
        let (form, value) = (form::<Everything>("Everything"), bytes::<Everything>(&value));
        let text = form.text("ALL", &value, Poses::InSpace).unwrap();
        let back = form.read("ALL", &text);
        prop_assert_eq!(back, Ok(Read { bytes: value, time: None }), "{}", text);
    }

    #[test]
    fn any_text_is_a_value_or_an_error(text in "([A-Za-z.]{0,8}=?[\\[{x,0-9}\\]\"\\\\]{0,8},?){0,9}|.{0,60}") {
        let _ = form::<Everything>("Everything").read("ALL", &text);
        let _ = form::<PoseEstimate>("PoseEstimate").read("ALL", &text);
    }
}
