//! What elk does from anywhere: built-in missions, results into pipes, arguments with spaces, a robot's pace, pages for
//! shells and `man`.

mod common;

use std::path::Path;
use std::process::{Output, Stdio};

use common::Elk;
use common::skip::skip;
use common::small::small;
use elk_bus::Value;
use elk_log::{LogReader, LogWriter, Metadata, Record};

fn run(elk: &Elk, arguments: &[&str]) -> Output {
    elk.command(arguments).output().unwrap()
}

/// Standard output and standard error of a command that succeeds.
fn succeed(elk: &Elk, arguments: &[&str]) -> (String, String) {
    let Output { status, stdout, stderr } = run(elk, arguments);
    let said = [stdout, stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    assert!(status.success(), "{arguments:?}: {said:?}");
    said.into()
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        std::fs::read_dir(folder).unwrap().map(|one| one.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn missions_are_built_in_with_their_worlds() {
    let elk = Elk::new("built-in");
    let (listed, _) = succeed(&elk, &["missions"]);
    for name in ["apartment", "car", "garage", "hall", "hall-long", "kitchen"] {
        assert!(listed.contains(&format!("\n{name} ")), "{listed}");
        let (checked, _) = succeed(&elk, &["check", name]);
        assert!(checked.starts_with(&format!("{name}: ")), "{checked}");
    }
    let slip = run(&elk, &["check", "apartmnt"]);
    assert!(String::from_utf8_lossy(&slip.stderr).contains("did you mean apartment?"));
    assert_eq!(names(elk.folder()), [""; 0], "no file is needed, and none is left");

    let sets = ["Map.Res=0.25", "Explorer.Mid=0; 0; 0.5", "Explorer.Dim=3; 3; 3", "Explorer.type=ClosestFrontier"];
    // A folder of the same name is in nobody's way.
    std::fs::create_dir(elk.folder().join("car")).unwrap();
    let mut arguments = vec!["launch", "car", "--headless", "--community", elk.community()];
    arguments.extend(sets.iter().flat_map(|set| ["--set", set]));
    succeed(&elk, &arguments);
    let summary = elk.summary();
    assert_eq!((&summary["complete"], &summary["mission"]), (&true.into(), &"Car interior".into()), "{summary}");
    // What the run keeps is a mission that runs from anywhere, too.
    let run = elk.run();
    succeed(&elk, &["check", run.join("car.xml").to_str().unwrap()]);
}

#[test]
fn what_the_environment_says_is_heeded_or_an_error() {
    let elk = Elk::new("environment");
    for (variable, wrong) in [("ELK_LEASE_SECS", "soon"), ("ELK_LEASE_SECS", "-1"), ("ELK_SUCCEED", "yes")] {
        let mut logger = elk.command(&["logger", "--type", "Mcap", "File=x.mcap", "--community", elk.community()]);
        let Output { status, stderr, .. } = logger.env(variable, wrong).output().unwrap();
        let said = String::from_utf8_lossy(&stderr).into_owned();
        let right = said.starts_with(&format!("elk: {variable}={wrong}: right is "));
        assert!(status.code() == Some(1) && right, "{said}");
    }
}

/// Case: six arguments, two of them with spaces in quotes of either kind, one behind a backslash.
#[test]
fn arguments_of_an_executable_may_have_spaces() {
    let elk = Elk::new("arguments");
    std::fs::create_dir(elk.folder().join("my apps")).unwrap();
    let out = elk.folder().join("args.out");
    let (program, client) = elk.idle_client("Show");
    let script = format!("for a in \"$@\"; do echo \"[$a]\"; done > '{}'\nexec {program} {client}\n", out.display());
    elk.script("my apps/show args.sh", &script);
    let args = r#"args="--title 'Front camera' --pose &quot;1 2 3&quot; --out my\ file.txt""#;
    let app = format!("<App name=\"Show\" exec=\"./my apps/show args.sh\" {args}/>");
    let (code, said) = elk.launch(&small("auto", &app)).end();
    assert_eq!(code, Some(0), "{said}");
    let given = std::fs::read_to_string(&out).unwrap();
    let lines: Vec<&str> = given.lines().take(6).collect();
    assert_eq!(lines, ["[--title]", "[Front camera]", "[--pose]", "[1 2 3]", "[--out]", "[my file.txt]"], "{given}");
    let open = small("auto", "<App name=\"Show\" exec=\"./x\" args=\"--title 'Front\"/>");
    assert!(elk.launch_and_fail(&open).contains("args: the ' at letter 9 is not closed"));
}

#[test]
fn a_mission_file_in_another_encoding_is_read_and_a_document_type_is_named() {
    let elk = Elk::new("encodings");
    let with = |name: &str, head: &[u8], mission: &str| {
        let bytes = [head, mission.as_bytes()].concat();
        std::fs::write(elk.folder().join(name), bytes).unwrap();
        let Output { status, stdout, stderr } = run(&elk, &["check", name]);
        let said = [stdout, stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).concat();
        (status.success(), said)
    };
    let mission = small("auto", "");
    let latin1 = b"<?xml version=\"1.0\" encoding=\"ISO-8859-1\"?>\n<!-- K\xfcche -->\n";
    assert!(with("latin1.xml", latin1, &mission).0);
    let (right, said) = with("undeclared.xml", b"<!-- a -->\n<!-- K\xfcche -->\n", &mission);
    assert!(!right && said.starts_with("elk: undeclared.xml:2:7: the byte 0xfc is not UTF-8"), "{said}");
    let cdata = mission.replace("0.25 m", "<![CDATA[0.25 m]]>");
    let entities = mission.replace("0.25", "&#48;.2&#x35;");
    assert!(cdata != mission && entities != mission, "{mission}");
    for (name, head, mission) in [
        ("bom.xml", "\u{feff}", mission.as_str()),
        ("crlf.xml", "", &mission.replace('\n', "\r\n").replace("><", ">\r\n<")),
        ("cdata.xml", "", &cdata),
        ("entities.xml", "", &entities),
    ] {
        let (right, said) = with(name, head.as_bytes(), mission);
        assert!(right, "{said}");
    }
    let bomb = b"<!DOCTYPE Scenario [<!ENTITY a \"ha\"><!ENTITY b \"&a;&a;&a;&a;&a;&a;&a;&a;\">]>\n";
    let (right, said) = with("bomb.xml", bomb, &mission.replace("0.25", "&b;"));
    assert!(!right && said.contains("a mission has no <!DOCTYPE …>"), "{said}");
    let (right, said) = with("doctype.xml", b"<!-- a -->\n<!DOCTYPE Scenario>\n", &mission);
    assert!(!right && said.starts_with("elk: doctype.xml:2:1: a mission has no <!DOCTYPE …>"), "{said}");
}

/// The robot takes its time, and does the same.
#[test]
fn a_mission_at_a_robots_pace_has_the_same_result() {
    let summaries = [None, Some("20")].map(|pace| {
        let elk = Elk::new(&format!("pace-{}", pace.unwrap_or("none")));
        let more: Vec<&str> = pace.iter().flat_map(|pace| ["--pace", pace]).collect();
        let (code, said) = elk.launch_with(&small("auto", ""), &more).end();
        assert_eq!(code, Some(0), "{said}");
        elk.summary()
    });
    for field in ["scans", "path_length_m", "known_voxels", "accuracy", "frontiers_left"] {
        assert_eq!(summaries[0][field], summaries[1][field], "{field}");
    }
    let (way, secs) = (summaries[1]["path_length_m"].as_f64().unwrap(), summaries[1]["seconds"].as_f64().unwrap());
    assert!(way > 0.0 && secs > way / (0.5 * 20.0), "{way} m in {secs} s");
    let elk = Elk::new("pace-other");
    let (program, controller) = elk.idle_client("Controller");
    let other = format!("<Controller exec=\"{program}\" args=\"{controller}\"/>");
    let mission = small("auto", "").replace("<Controller type=\"MOOSSim\"/>", &other);
    let (code, said) = elk.launch_with(&mission, &["--pace", "1"]).end();
    assert!(code == Some(1) && said.contains("--pace 1: Controller has no parameter Pace"), "{said}");
}

/// A log of so many numbers.
fn write_log(path: &Path, count: u64) {
    let mut log = LogWriter::create(path, &Metadata::default()).unwrap();
    for number in 0..count {
        let record = Record {
            key: "COUNT".into(),
            source: "pCount".into(),
            source_aux: String::new(),
            community: "lab".into(),
            time: number as f64,
            sequence: number,
            received: number as f64,
            order: number,
            epoch: 1,
            value: Value::Double(number as f64),
        };
        log.append(&record.as_ref()).unwrap();
    }
    log.finish().unwrap();
}

#[test]
fn results_go_into_a_pipe() {
    let elk = Elk::new("pipes");
    write_log(&elk.folder().join("log.mcap"), 5);
    let (csv, said) = succeed(&elk, &["log", "export", "log.mcap", "--to", "csv", "-o", "-"]);
    assert!(csv.ends_with("4.000000,COUNT,pCount,4\n") && said.is_empty(), "{csv}{said}");
    let (alog, _) = succeed(&elk, &["log", "export", "log.mcap", "--to", "alog", "-o", "-"]);
    assert!(alog.starts_with("%%%") && alog.contains(" COUNT "), "{alog}");
    for command in ["cut", "recover"] {
        let output = run(&elk, &["log", command, "log.mcap", "-o", "-"]);
        assert!(output.status.success());
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(said, "5 messages in standard output\n");
        let copy = elk.folder().join("copy").with_extension("mcap");
        std::fs::write(&copy, output.stdout).unwrap();
        assert_eq!(LogReader::open(&copy).unwrap().map(Result::unwrap).count(), 5, "{command}");
        std::fs::remove_file(copy).unwrap();
    }
    assert_eq!(names(elk.folder()), ["log.mcap"]);
}

/// Regression: what was exported into a pipe was written to a file first, all of it.
#[test]
fn an_export_into_a_pipe_needs_no_disk() {
    let elk = Elk::new("no-disk");
    write_log(&elk.folder().join("log.mcap"), 20_000);
    for format in ["csv", "alog"] {
        // No file may have a byte.
        let command = ["log", "export", "log.mcap", "--to", format, "-o", "-"];
        let output = elk.limited("trap '' XFSZ; ulimit -f 0", &command).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success() && said.is_empty(), "{said}");
        let lines = String::from_utf8_lossy(&output.stdout).lines().filter(|line| line.contains("COUNT")).count();
        assert_eq!(lines, 20_000, "{format}");
    }
}

/// Regression: an export that failed left what it had written by then.
#[test]
fn an_export_that_fails_leaves_no_file() {
    let elk = Elk::new("no-file");
    let log = elk.folder().join("log.mcap");
    write_log(&log, 20_000);
    let whole = std::fs::metadata(&log).unwrap().len();
    for arguments in
        [["export", "log.mcap", "--to", "csv", "-o", "out"], ["export", "log.mcap", "--to", "alog", "-o", "out"]]
    {
        // A disk that is full, for who writes more than 64 blocks of 512 bytes.
        let command = [&["log"], &arguments[..]].concat();
        let output = elk.limited("trap '' XFSZ; ulimit -f 64", &command).stderr(Stdio::piped()).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(1) && said.contains("File too large"), "{said}");
        assert_eq!(names(elk.folder()), ["log.mcap"]);
    }
    let output = elk.limited("trap '' XFSZ; ulimit -f 64", &["log", "cut", "log.mcap", "-o", "out"]).output().unwrap();
    assert!(whole > 64 * 512 && output.status.code() == Some(1));
    assert_eq!(names(elk.folder()), ["log.mcap"]);
    std::fs::write(elk.folder().join("there.csv"), "mine").unwrap();
    let output = run(&elk, &["log", "export", "log.mcap", "--to", "csv", "-o", "there.csv"]);
    assert!(String::from_utf8_lossy(&output.stderr).contains("cannot write there.csv"));
    assert_eq!(std::fs::read_to_string(elk.folder().join("there.csv")).unwrap(), "mine");
}

#[test]
fn shells_and_man_know_every_command() {
    let elk = Elk::new("manual");
    for shell in ["bash", "zsh", "fish"] {
        let (script, _) = succeed(&elk, &["completions", shell]);
        for word in ["launch", "detach", "recover", "compression", "missions"] {
            assert!(script.contains(word), "{shell}: {word}");
        }
    }
    let (bash, _) = succeed(&elk, &["completions", "bash"]);
    std::fs::write(elk.folder().join("elk.bash"), bash).unwrap();
    let ask = "source ./elk.bash; COMP_WORDS=(elk lau); COMP_CWORD=1; _elk elk lau elk; echo \"${COMPREPLY[@]}\"";
    match std::process::Command::new("bash").args(["-c", ask]).current_dir(elk.folder()).output() {
        Ok(answer) => assert_eq!(String::from_utf8_lossy(&answer.stdout), "launch\n", "{answer:?}"),
        Err(error) => skip("completions by bash", "bash", &error.to_string()),
    }
    succeed(&elk, &["man", "man1"]);
    let pages = names(&elk.folder().join("man1"));
    for page in ["elk.1", "elk-launch.1", "elk-log.1", "elk-log-export.1", "elk-top.1"] {
        assert!(pages.iter().any(|name| name == page), "{pages:?}");
    }
    assert!(!pages.iter().any(|name| name.contains("guard")), "what nobody types has no page");
    let page = std::fs::read_to_string(elk.folder().join("man1/elk-launch.1")).unwrap();
    assert!(page.contains(".TH") && page.contains("ClosestFrontier") && !page.contains("background\\fR"), "{page}");
}
