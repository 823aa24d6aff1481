//! What an app that runs can be exchanged for.

use std::path::Path;

use elk_mission::{AppSpec, Exchange, Program, Via};

use crate::table::{LISTING_2, app, parse, registry};

fn exchange(said: &[&str]) -> Exchange {
    let mut wanted = Exchange { folder: "/".into(), ..Exchange::default() };
    for (name, text) in said.iter().map(|one| one.split_once('=').unwrap()) {
        match name {
            "type" => wanted.type_name = Some(text.to_owned()),
            "exec" | "pipe" => {
                wanted.exec = Some((text.to_owned(), vec!["-v".to_owned()]));
                wanted.via = if name == "pipe" { Via::Lines } else { Via::Itself };
            }
            _ => wanted.params.push((name.to_owned(), text.to_owned())),
        }
    }
    wanted
}

#[test]
fn an_exchanged_app_keeps_what_was_set_and_what_the_new_one_has() {
    let mission = parse(LISTING_2, &["Explorer.Policy=thesis"]).unwrap();
    let explorer = app(&mission, "Explorer");
    let swap = |said: &[&str]| explorer.exchange(&exchange(said), &registry()).unwrap();

    let closest = swap(&["type=ClosestFrontier", "res=0.2"]);
    assert_eq!((closest.app.type_name(), closest.app.name.as_str()), ("ClosestFrontier", "Explorer"));
    assert_eq!(closest.app.setting("Res"), Some("0.2"));
    assert_eq!(closest.app.setting("Dim"), Some("5.7; 4.3; 4.5"));
    assert_eq!(closest.app.setting("Policy"), Some("thesis"));
    assert_eq!(closest.dropped, [""; 0]);
    // Of the thesis' policy, the simple one knows nothing.
    let simple = swap(&["type=Simple"]);
    assert_eq!(simple.dropped, ["Policy=thesis"]);
    assert_eq!(simple.app.setting("Res"), Some("0.1"));

    let mine = swap(&["exec=/bin/sh", "K=1"]).app;
    let Program::Foreign { exec, args, via: Via::Itself } = &mine.program else { panic!("not foreign") };
    assert_eq!((exec.as_path(), args.as_slice()), (Path::new("/bin/sh"), ["-v".to_owned()].as_slice()));
    assert_eq!(mine.setting("Dim"), Some("5.7; 4.3; 4.5"));
    let piped = swap(&["pipe=/bin/sh"]).app;
    assert!(matches!(piped.program, Program::Foreign { via: Via::Lines, .. }) && piped.type_name() == "pipe");
    // Back again, what only a stranger understands is left behind.
    let back = mine.exchange(&exchange(&["type=Potential"]), &registry()).unwrap();
    assert_eq!(back.dropped, ["K=1"]);
    assert_eq!(back.app.setting("Policy"), Some("thesis"));
}

#[test]
fn an_exchange_that_is_wrong_says_what_would_be_right() {
    let explorer = app(&parse(LISTING_2, &[]).unwrap(), "Explorer");
    for (said, right) in [
        (vec!["type=Potentail"], r#"type=Potentail: Explorer has no type "Potentail"; did you mean Potential?"#),
        (
            vec!["type=ClosestFrontier", "Res=11"],
            r#"Res=11: Res: "11" is out of range; right is a number from 0.001 to 10, in m"#,
        ),
        (
            vec!["type=ClosestFrontier", "Polcy=elk"],
            "Polcy=elk: Explorer ClosestFrontier has no parameter Polcy; did you mean Policy?",
        ),
        (vec!["exec=/bin/sh", "type=Potential"], "exec=/bin/sh: type and exec are both said; one is right"),
        (vec!["pipe=/bin/sh", "type=Potential"], "pipe=/bin/sh: type and pipe are both said; one is right"),
        (vec!["exec=/"], "exec=/: / is no file; right is an executable"),
        (vec!["exec=./no/such"], "exec=./no/such: /./no/such cannot be run: No such file or directory (os error 2)"),
        (vec!["exec=/etc/passwd"], "exec=/etc/passwd: /etc/passwd is not executable; `chmod +x` makes a program of it"),
        (
            vec!["exec=no-such-program"],
            "exec=no-such-program: there is no no-such-program in PATH; right is an executable's name, or a path with a /",
        ),
    ] {
        let error = explorer.exchange(&exchange(&said), &registry()).unwrap_err().to_string();
        assert_eq!(error, right);
    }
}

/// Regression: an app was exchanged for one that nobody could read, or that read nobody, and the mission stood still.
#[test]
fn an_exchanged_app_goes_together_with_the_others() {
    let mission = parse(LISTING_2, &[]).unwrap();
    let swap = |name: &str, said: &[&str]| {
        let exchanged = app(&mission, name).exchange_among(&mission.apps, &exchange(said), &registry());
        exchanged.map(|exchanged| exchanged.app).map_err(|error| error.to_string())
    };
    let res = "right is the same";
    let voxels = |who: &str| format!("{who} is not the Map's \"0.1\"; {res}");
    for (name, said, wrong) in [
        ("Map", "Res=0.2", format!("Res=0.2: Res: {} while the mission runs", voxels("\"0.2\""))),
        ("Explorer", "res=0.2", format!("res=0.2: Res: {} for Map and Explorer", voxels("\"0.2\""))),
        (
            "Map",
            "Input=NOPE",
            "Input=NOPE: Input: nobody in the mission publishes NOPE; published are SCAN, SCAN_1".to_owned(),
        ),
        (
            "Filter",
            "Output=SCAN_9",
            "Map: Input: nobody in the mission publishes SCAN_1; published are SCAN, SCAN_9".to_owned(),
        ),
        (
            "Controller",
            "MOOSPoseVarName=ZZ",
            format!(
                "MOOSPoseVarName=ZZ: MOOSPoseVarName: \"ZZ\" is not the Sensor's \"SIM_SENSOR\"; {res} for Sensor and \
                 Controller"
            ),
        ),
    ] {
        assert_eq!(swap(name, &[said]).unwrap_err(), wrong);
    }
    // What nobody changes goes together, and so does the same in other words.
    for one in &mission.apps {
        swap(&one.name, &[]).unwrap();
    }
    assert_eq!(swap("Map", &["Res=1e-1 m"]).unwrap().setting("Res"), Some("0.1"));
    swap("Map", &["Input=SCAN"]).unwrap();
    swap("Explorer", &["type=Simple", "Res=0.1 m"]).unwrap();
}

#[test]
fn a_strangers_program_may_write_anything_but_shares_what_is_shared() {
    let mission = parse(LISTING_2, &[]).unwrap();
    let swap = |apps: &[AppSpec], at: usize, said: &[&str]| {
        let exchanged = apps[at].exchange_among(apps, &exchange(said), &registry());
        exchanged.map(|exchanged| exchanged.app).map_err(|error| error.to_string())
    };
    for at in 0..mission.apps.len() {
        let mut apps = mission.apps.clone();
        apps[at] = swap(&apps, at, &["exec=/bin/sh", "Output=MINE"]).unwrap();
        // Whoever else is exchanged then, and for whatever the stranger may publish.
        for other in 0..apps.len() {
            swap(&apps, other, &[]).unwrap();
        }
    }
    for name in ["Map", "Explorer"] {
        let at = mission.apps.iter().position(|app| app.name == name).unwrap();
        let error = swap(&mission.apps, at, &["exec=/bin/sh", "Res=0.2"]).unwrap_err();
        assert!(error.starts_with("Res=0.2: Res: \"0.2\" is not the Map's \"0.1\""), "{error}");
    }
    // Nobody's reader says otherwise, and yet the map is there.
    let mut apps = mission.apps.clone();
    apps.retain(|app| app.element != "Explorer");
    let at = apps.iter().position(|app| app.element == "Map").unwrap();
    assert!(swap(&apps, at, &["Res=0.2"]).unwrap_err().contains("while the mission runs"));
}
