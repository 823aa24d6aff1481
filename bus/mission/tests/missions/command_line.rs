//! What `--set` says in place of the file.

use std::path::Path;

use elk_mission::{Program, Via};

use crate::table::{LISTING_2, app, parse, settings};

#[test]
fn the_command_line_overrides_the_file_with_the_same_checks() {
    let sets = ["Map.Res=0.05 m", "Explorer.Res=0.05", "Explorer.type=ClosestFrontier", "Map.Res=0.2"];
    let said_twice = parse(LISTING_2, &sets).unwrap_err();
    assert_eq!(said_twice, "--set Map.Res=0.2: Res is said twice; once is enough");

    let mission = parse(LISTING_2, &sets[..3]).unwrap();
    assert_eq!(settings(&mission, "Map"), "Res=0.05 Input=SCAN_1");
    assert_eq!(mission.of_element("Explorer").next().unwrap().type_name(), "ClosestFrontier");

    for (set, said) in [
        ("Map.Res=1 cm", r#"--set Map.Res=1 cm: Res: "1 cm" is in cm; the unit must be m"#),
        ("Mop.Res=1", "--set Mop.Res=1: the mission has no app Mop; did you mean Map?"),
        ("Map.Rse=1", "--set Map.Rse=1: Map OctoMap has no parameter Rse; did you mean Res?"),
        (
            "Explorer.type=Potentail",
            r#"--set Explorer.type=Potentail: Explorer has no type "Potentail"; did you mean Potential?"#,
        ),
    ] {
        assert_eq!(parse(LISTING_2, &[set]).unwrap_err(), said);
    }
}

#[test]
fn setting_a_parameter_of_a_checked_app_checks_it_too() {
    let mut mission = parse(LISTING_2, &[]).unwrap();
    let map = mission.apps.iter_mut().find(|app| app.name == "Map").unwrap();
    map.set("Res", "0.25").unwrap();
    assert_eq!(map.setting("Res"), Some("0.25"));
    assert!(map.set("Res", "wide").is_err());
    assert_eq!(map.setting("Res"), Some("0.25"));
    assert!(map.takes("Input") && !map.takes("World"));
}

/// Regression: a mission that names an executable and says something to it alone was refused with any type in its place.
#[test]
fn a_type_that_takes_an_executables_place_is_not_told_what_it_has_no_word_for() {
    let text = LISTING_2.replace("<Explorer type=\"Potential\">", "<Explorer exec=\"/bin/sh\"><Climb> 2 </Climb>");
    assert_eq!(app(&parse(&text, &[]).unwrap(), "Explorer").setting("Climb"), Some("2"));
    let simple = app(&parse(&text, &["Explorer.type=Simple"]).unwrap(), "Explorer");
    assert_eq!((simple.setting("Climb"), simple.setting("Dim")), (None, Some("5.7; 4.3; 4.5")));
    let said = parse(&text, &["Explorer.type=Simple", "Explorer.Climb=3"]).unwrap_err();
    assert!(said.starts_with("--set Explorer.Climb=3: Explorer Simple has no parameter Climb"), "{said}");
}

#[test]
fn any_executable_takes_a_place_from_the_command_line() {
    let sets = ["Explorer.K=1", "Explorer.args=-v --fast", "Explorer.exec=/bin/sh"];
    let mine = app(&parse(LISTING_2, &sets).unwrap(), "Explorer");
    let Program::Foreign { exec, args, via: Via::Itself } = &mine.program else { panic!("not foreign") };
    assert_eq!((exec.as_path(), args.join(" ").as_str()), (Path::new("/bin/sh"), "-v --fast"));
    let piped = app(&parse(LISTING_2, &["Explorer.K=1", "Explorer.pipe=/bin/sh -c 'read line'"]).unwrap(), "Explorer");
    let Program::Foreign { exec, args, via: Via::Lines } = &piped.program else { panic!("not piped") };
    assert_eq!((exec.as_path(), args.join("|").as_str()), (Path::new("/bin/sh"), "-c|read line"));
    assert_eq!((piped.type_name(), piped.setting("K")), ("pipe", Some("1")));
    assert_eq!((mine.setting("K"), mine.setting("Dim")), (Some("1"), Some("5.7; 4.3; 4.5")));
    for (sets, said) in [
        (
            vec!["Explorer.exec=./no/such"],
            "--set Explorer.exec=./no/such: ./no/such cannot be run: No such file or directory (os error 2)",
        ),
        (vec!["Explorer.args=-v"], "--set Explorer.args=-v: args without exec; right is both or neither"),
        (
            vec!["Explorer.exec=/bin/sh", "Explorer.type=Simple"],
            "--set Explorer.type=Simple: what runs is said twice; one type, exec or pipe is right",
        ),
        (vec!["Explorer.pipe= "], "--set Explorer.pipe=: pipe is empty; right is a program with its arguments"),
        (
            vec!["Explorer.pipe=sh 'a"],
            "--set Explorer.pipe=sh 'a: pipe: the ' at letter 4 is not closed; right is one more ', or \\' for the letter itself",
        ),
    ] {
        assert_eq!(parse(LISTING_2, &sets).unwrap_err(), said);
    }
}

#[test]
fn what_the_file_says_to_one_type_alone_is_left_behind_when_the_command_line_names_another() {
    let said = LISTING_2.replace("<Dim>", "<Policy> thesis </Policy> <Dim>");
    let simple = app(&parse(&said, &["Explorer.type=Simple"]).unwrap(), "Explorer");
    assert_eq!((simple.setting("Policy"), simple.setting("Res")), (None, Some("0.1")));
    // What no type has is still a mistake, and so is what the command line says to the wrong one.
    let odd = said.replace("Policy>", "Polcy>");
    assert!(parse(&odd, &["Explorer.type=Simple"]).unwrap_err().contains("has no parameter Polcy"));
    let wrong = parse(LISTING_2, &["Explorer.type=Simple", "Explorer.Policy=elk"]).unwrap_err();
    assert!(wrong.contains("Explorer Simple has no parameter Policy"), "{wrong}");
}
