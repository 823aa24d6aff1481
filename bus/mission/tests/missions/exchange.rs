//! What an app that runs can be exchanged for.

use std::path::Path;

use elk_mission::{Exchange, Program};

use crate::table::{LISTING_2, app, parse, registry};

fn exchange(said: &[&str]) -> Exchange {
    let mut wanted = Exchange { folder: "/".into(), ..Exchange::default() };
    for (name, text) in said.iter().map(|one| one.split_once('=').unwrap()) {
        match name {
            "type" => wanted.type_name = Some(text.to_owned()),
            "exec" => wanted.exec = Some((text.to_owned(), vec!["-v".to_owned()])),
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
    let Program::Foreign { exec, args } = &mine.program else { panic!("not foreign") };
    assert_eq!((exec.as_path(), args.as_slice()), (Path::new("/bin/sh"), ["-v".to_owned()].as_slice()));
    assert_eq!(mine.setting("Dim"), Some("5.7; 4.3; 4.5"));
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
