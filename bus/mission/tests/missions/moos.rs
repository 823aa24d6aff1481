//! Programs of MOOS' in missions, and missions of MOOS'.

use elk_mission::{Mission, Program, Restart, Via};

use crate::table::{app, parse, registry, with};

/// What is wrong with a file of this text.
fn wrong(text: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("old.moos");
    std::fs::write(&file, text).unwrap();
    let said = Mission::load(&file, &registry(), &[]).unwrap_err().to_string();
    said.replace(folder.path().to_str().unwrap(), "/m")
}

/// A file with these lines in its ANTLER block, which begins in line 5.
fn with_runs(runs: &str) -> String {
    format!("ServerHost = localhost\nServerPort = 9100\nCommunity = alpha\nProcessConfig = ANTLER\n{{\n{runs}\n}}\n")
}

#[test]
fn a_program_of_moos_needs_no_port_that_somebody_names() {
    let one = r#"<App exec="pLogger" moos="true"/>"#;
    let address = |text: &str| parse(text, &[]).unwrap().moos.unwrap().address.to_string();
    assert_eq!(address(&with(one)), "127.0.0.1:0", "any that is free, on this machine alone");
    assert_eq!(address(&with(&format!(r#"{one}<Bus moos="localhost:9001"/>"#))), "localhost:9001");
    assert_eq!(address(&with(&format!(r#"{one}<Bus texts="NAV_*"/>"#))), "127.0.0.1:0");
    let mission =
        parse(&with(r#"<App name="pLog" exec="pLogger" args="-v" moos="true"><Log>A</Log><Log>B</Log></App>"#), &[]);
    let mission = mission.unwrap();
    let log = app(&mission, "pLog");
    assert!(log.is_moos() && log.type_name() == "moos");
    assert!(parse(&with(one), &[]).unwrap().apps.iter().any(|app| app.name == "pLogger"), "as MOOS has it");
    assert_eq!(log.settings.len(), 2, "a parameter may be said twice");
    let again = parse(&mission.to_xml(&|_, _| false), &[]).unwrap();
    let (was, is) = (app(&mission, "pLog"), app(&again, "pLog"));
    assert!(is.is_moos() && is.settings == was.settings);
    let set = parse(&with(r#"<App name="pLog" exec="pLogger"/>"#), &["pLog.moos=true", "pLog.AppTick=4"]).unwrap();
    assert!(app(&set, "pLog").is_moos() && set.moos.is_some());
}

#[test]
fn what_a_program_of_moos_cannot_be_told_is_said_with_its_place() {
    let said = |inside: &str| {
        let text = with(&format!("\n<App exec=\"pLogger\" moos=\"true\">{inside}</App>"));
        parse(&text, &[]).unwrap_err().to_string()
    };
    assert!(
        said("<ServerPort>9000</ServerPort>").contains("ServerPort is what the mission tells all of MOOS' programs")
    );
    assert!(said("<MOOSTimeWarp>2</MOOSTimeWarp>").contains("MOOSTimeWarp is what the mission tells"));
    assert!(said("<Log/>").contains("Log is empty, and MOOS passes over what is"));
    assert!(said("<Log>a\nb</Log>").contains("MOOS reads a parameter from one line"));
    assert!(said(&format!("<Log>{}</Log>", "x".repeat(2000))).contains("of at most 1998 bytes"));
    assert!(said("<Log>say \"http://x\"</Log>").contains("MOOS would read no more than what is before //"));
    for (line, right) in [
        (r#"<App pipe="x" moos="true"/>"#, "moos and pipe are both said"),
        (r#"<App exec="./my.sh" moos="true"/>"#, "\"my.sh\" is no name for an app; right is name="),
        (r#"<App exec="x" moos="maybe"/>"#, "moos \"maybe\" is not offered; right is true, false or a .moos file"),
        (r#"<App exec="x" moos="/no/such.moos"/>"#, "moos: /no/such.moos cannot be read"),
        (r#"<Logger type="none" moos="true"/>"#, "moos without exec; right is both or neither"),
    ] {
        let error = parse(&with(line), &[]).unwrap_err().to_string();
        assert!(error.contains(right), "{error}");
    }
}

#[test]
fn a_mission_of_moos_is_what_its_antler_block_runs() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("old.moos");
    let runs = "  MSBetweenLaunches = 200\n  ExecutablePath = /opt/moos\n  Run = MOOSDB @ NewConsole = false\n\
                Run = pLogger @ NewConsole = true, XConfig = Big ~ pLog // the log\n\
                run=pHelm@Path=SYSTEM,ExtraProcessParams=More,NewConsole=TRUE\n  Run = ./pOwn\n  More = -v, --fast\n";
    let text = with_runs(runs) + "MOOSTimeWarp = 4\nWebServerPort = 9080\n";
    std::fs::write(&file, &text).unwrap();
    let mission = Mission::load(&file, &registry(), &[]).unwrap();
    assert_eq!((mission.name.as_str(), mission.bytes.as_slice()), ("old", text.as_bytes()));
    assert_eq!(mission.community.as_ref().map(|name| name.as_str()), Some("alpha"));
    assert_eq!((mission.time_warp, mission.launch_pause_secs), (4.0, 0.2));
    assert_eq!(mission.moos.as_ref().unwrap().address.to_string(), "localhost:9100");
    assert!(!mission.explores());
    let programs: Vec<_> =
        mission.of_element("App").map(|app| (app.name.as_str(), &app.program, app.policy.restart)).collect();
    let told = Via::of_file(&file);
    let named = |name: &str| programs.iter().find(|(other, ..)| *other == name).unwrap();
    for (name, right, arguments) in [
        ("pLog", "/opt/moos/pLogger", vec![]),
        ("pHelm", "pHelm", vec!["-v", "--fast"]),
        ("pOwn", "/opt/moos/./pOwn", vec![]),
    ] {
        let (_, Program::Foreign { exec, args, via }, Restart::OnFailure) = named(name) else { panic!("{name}") };
        let args: Vec<&str> = args.iter().map(String::as_str).collect();
        assert_eq!((exec.to_str().unwrap(), args, via), (right, arguments, &told));
    }
    assert_eq!(programs.len(), 3);
    let notes = mission.notes.join("\n").replace(file.to_str().unwrap(), "old.moos");
    assert_eq!(
        notes.lines().map(|line| line.split_once(": ").unwrap().0).collect::<Vec<_>>(),
        ["old.moos:8", "old.moos:9, 10", "old.moos:9", "old.moos:16"],
        "{notes}"
    );
    let again = parse(&mission.to_xml(&|_, _| false), &[]).unwrap();
    assert_eq!((again.community, again.time_warp, again.launch_pause_secs), (mission.community, 4.0, 0.2));
    assert_eq!(again.apps.len(), mission.apps.len());
}

#[test]
fn what_of_a_mission_of_moos_cannot_be_is_said_with_file_and_line() {
    for (text, right) in [
        (String::new(), "1:1: there is no ANTLER block that pAntler would find"),
        ("\nProcessConfig = ANTLER {\n}\n".to_owned(), "2:1: there is no ANTLER block"),
        (with_runs(""), "1:1: its ANTLER block runs no program of MOOS'"),
        (with_runs("Run = a b"), "6:1: \"a b\" is no name for an app"),
        (with_runs("Run = pA\nRun = pA"), "7:1: the name pA is already that of a <App>"),
        (with_runs("Run = pA @ InhibitMOOSParams = true"), "6:1: InhibitMOOSParams: pA would not be told"),
        (with_runs("Run = pA @ NewConsol = true"), "6:1: NewConsol is no option of Run; did you mean NewConsole?"),
        (with_runs("Run = pA @ ExtraProcessParams = None"), "6:1: ExtraProcessParams names None, which"),
        (with_runs("Run = ${ELK_NO_SUCH_NAME}"), "6:1: ${ELK_NO_SUCH_NAME} is defined neither here nor"),
        (with_runs("MSBetweenLaunches = soon\nRun = pA"), "6:1: MSBetweenLaunches is \"soon\"; right is a number"),
        (with_runs("Run = pA").replace("localhost", "boat"), "1:1: ServerHost is \"boat\""),
        (with_runs("Run = pA").replace("9100", "many"), "2:1: ServerPort is \"many\""),
        (with_runs("Run = pA").replace("alpha", "a/b"), "3:1: Community: \"a/b\" is no name for a community"),
        (with_runs("Run = pA") + "MOOSTimeWarp = 1000", "8:1: MOOSTimeWarp \"1000\" is out of range"),
    ] {
        let error = wrong(&text);
        assert!(error.contains(&format!("/m/old.moos:{right}")), "{right}: {error}");
    }
    let distributed = with_runs("EnableDistributed = true\nRun = pA @ AntlerID = buoy\nRun = pB");
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("far.moos");
    std::fs::write(&file, distributed).unwrap();
    let mission = Mission::load(&file, &registry(), &[]).unwrap();
    assert_eq!(mission.of_element("App").map(|app| app.name.as_str()).collect::<Vec<_>>(), ["pB"]);
    let notes = mission.notes.join("\n");
    assert!(
        notes.contains("far.moos:7: it is for another machine's pAntler") && notes.contains(":6: EnableDistributed"),
        "{notes}"
    );
}
