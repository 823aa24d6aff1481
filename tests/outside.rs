//! What somebody made who knows no better, or means harm, given to the real program: files that are none, logs that are
//! traps, parameters that contradict each other.

mod common;

use std::path::{Path, PathBuf};

use common::car::car;
use common::{Elk, processes_of};

/// Runs the program with at most so much memory (MB) and for at most a minute; its exit code, and all that it said.
fn within(elk: &Elk, megabytes: u64, arguments: &[&str]) -> (Option<i32>, String) {
    let limited = format!("ulimit -v {}; exec timeout 60 \"$0\" \"$@\"", megabytes * 1000);
    let out = std::process::Command::new("bash")
        .args(["-c", &limited, env!("CARGO_BIN_EXE_elk")])
        .args(arguments)
        .current_dir(elk.folder())
        .output()
        .unwrap();
    let said = [out.stdout, out.stderr].map(|bytes| String::from_utf8(bytes).unwrap()).concat();
    assert_ne!(out.status.code(), Some(124), "{arguments:?} went on for ever: {said}");
    (out.status.code(), said)
}

/// A gigabyte of zeros in 33 kB of Zstandard: blocks of 128 KiB, each one byte that is repeated (RFC 8878, 3.1.1.2).
fn packed_zeros() -> Vec<u8> {
    let block = |last: u32| [&(last | 1 << 1 | 128 << 10 << 3).to_le_bytes()[..3], &[0]].concat();
    let head = [0x28, 0xb5, 0x2f, 0xfd, 0, 10 << 3].to_vec();
    [head, block(0).repeat(8191), block(1)].concat()
}

/// A log of a chunk that is a trap.
fn trap(folder: &Path) -> PathBuf {
    let packed = packed_zeros();
    let sizes = [0, 0, 1 << 30].map(u64::to_le_bytes).concat();
    let names =
        [&0_u32.to_le_bytes()[..], &4_u32.to_le_bytes(), b"zstd", &(packed.len() as u64).to_le_bytes()].concat();
    let chunk = [sizes, names, packed].concat();
    let record = [&[6], &(chunk.len() as u64).to_le_bytes()[..], &chunk].concat();
    let path = folder.join("trap.mcap");
    std::fs::write(&path, [&b"\x89MCAP0\r\n"[..], &record].concat()).unwrap();
    assert!(path.metadata().unwrap().len() < 34_000);
    path
}

#[test]
fn a_log_that_claims_to_be_a_gigabyte_costs_no_command_anything() {
    let elk = Elk::new("trap");
    let path = trap(elk.folder());
    let log = path.to_str().unwrap();
    let commands: [&[&str]; 8] = [
        &["log", "info", log],
        &["log", "check", log],
        &["log", "cat", log],
        &["log", "recover", log, "-o", "mended.mcap"],
        &["log", "cut", log, "-o", "cut.mcap"],
        &["log", "diff", log, log],
        &["log", "export", log, "--to", "csv", "-o", "trap.csv"],
        &["replay", log, "--community", elk.community()],
    ];
    for arguments in commands {
        let (code, said) = within(&elk, 300, arguments);
        assert!(matches!(code, Some(0 | 1)), "{arguments:?}: {code:?}, {said}");
        let meant = said.contains("claims 1073741824 bytes in 327") || said.contains("start one with `elk db`");
        assert!(meant, "{arguments:?}: {said}");
    }
}

#[test]
fn what_is_no_file_is_said_by_every_command_and_none_waits_for_it() {
    let elk = Elk::new("nofile");
    for name in ["fifo.xml", "fifo.obj", "fifo.mcap", "fifo.alog"] {
        assert!(std::process::Command::new("mkfifo").arg(elk.folder().join(name)).status().unwrap().success());
    }
    std::fs::write(elk.folder().join("car.xml"), car("auto")).unwrap();
    let commands: [&[&str]; 14] = [
        &["check", "fifo.xml"],
        &["launch", "fifo.xml"],
        &["check", "/dev/zero"],
        &["check", "."],
        &["check", "car.xml", "--set", "Sensor.World=fifo.obj"],
        &["launch", "car.xml", "--set", "Sensor.World=.", "--community", elk.community()],
        &["sensor", "--type", "Simulator", "World=fifo.obj"],
        &["log", "info", "fifo.mcap"],
        &["log", "cat", "/dev/zero"],
        &["log", "diff", "fifo.mcap", "fifo.mcap"],
        &["log", "recover", "fifo.mcap", "-o", "mended.mcap"],
        &["replay", "fifo.mcap"],
        &["replay", "fifo.alog"],
        &["logger", "--type", "Mcap", "File=fifo.mcap", "--community", elk.community()],
    ];
    for arguments in commands {
        let (code, said) = within(&elk, 8000, arguments);
        let meant = ["a FIFO", "a device", "a folder", "there is no file", "no ordinary file", "no broker serves"];
        assert_eq!(code, Some(1), "{arguments:?}: {said}");
        assert!(meant.iter().any(|words| said.contains(words)), "{arguments:?}: {said}");
    }
    assert_eq!(processes_of(&elk), [0; 0]);
}

#[test]
fn variables_that_cannot_be_are_found_before_anything_starts() {
    let elk = Elk::new("variables");
    std::fs::write(elk.folder().join("car.xml"), car("auto")).unwrap();
    for (set, words) in [
        ("Sensor.Output=DB_CLIENTS", "DB_CLIENTS is a variable that the broker writes itself"),
        ("Sensor.Output=PLAN", "PLAN carries Plan values in every mission"),
        ("Map.Input=SCAN_9", "nobody in the mission publishes SCAN_9; published are SCAN"),
    ] {
        for command in ["check", "launch"] {
            let out = elk.command(&[command, "car.xml", "--set", set]).output().unwrap();
            let said = String::from_utf8(out.stderr).unwrap();
            assert!(!out.status.success() && said.contains(words), "{command} {set}: {said}");
        }
    }
    assert!(!elk.folder().join("logs").exists(), "nothing was begun");
}

#[test]
fn a_controller_that_is_told_to_wait_can_be_told_to_go_on() {
    let elk = Elk::new("manual");
    let mut launcher = elk.launch_with(&car("auto"), &["--set", "Controller.Manual=true"]);
    launcher.wait_for("Enter takes a step");
    assert_eq!(elk.obeyed(&["step"]), "one step\n");
    assert_eq!(elk.obeyed(&["resume"]), "resumed\n");
    let (code, said) = launcher.end();
    assert_eq!((code, &elk.summary()["complete"]), (Some(0), &true.into()), "{said}");
}

#[test]
fn a_manual_mission_that_is_to_run_through_does_wherever_it_says_that_it_is_one() {
    let elk = Elk::new("auto");
    let (code, said) = elk.launch_with(&car("auto"), &["--auto", "--set", "Controller.Manual=true"]).end();
    assert_eq!(code, Some(0), "{said}");
}

#[test]
fn a_map_that_could_not_be_written_is_said_before_the_world_is_explored() {
    let elk = Elk::new("nomap");
    for file in ["/proc/self/map.bt", ".", "/dev/full"] {
        let set = format!("Map.File={file}");
        let (code, said) = elk.launch_with(&car("auto"), &["--set", &set]).end();
        assert_eq!(code, Some(1), "{said}");
        assert!(said.contains(&format!("Map cannot write File={file}: ")) && !said.contains("alive:"), "{said}");
    }
    assert_eq!(processes_of(&elk), [0; 0]);
}

#[test]
fn a_map_that_cannot_be_written_at_the_end_fails_its_mission() {
    let elk = Elk::new("lostmap");
    let file = elk.folder().join("maps/map.bt");
    let set = format!("Map.File={}", file.display());
    let mut launcher = elk.launch_with(&car("auto"), &["--set", "Controller.Manual=true", "--set", &set]);
    launcher.wait_for("Enter takes a step");
    // Meanwhile somebody puts something else there.
    std::fs::create_dir_all(&file).unwrap();
    elk.obeyed(&["resume"]);
    let (code, said) = launcher.end();
    assert_eq!(code, Some(1), "{said}");
    let summary = elk.summary();
    let reason = summary["reason"].as_str().unwrap();
    let words = format!("cannot write the map to {}", file.display());
    assert!(reason.contains("Map could not end in good order") && reason.contains(&words), "{reason}");
    // With the summary, and as the last word.
    assert_eq!((said.matches(&words).count(), &summary["complete"]), (2, &false.into()), "{said}");
    elk.wait_until_deserted();
}

/// A mission that plays what lies at `recording`.
fn player(kind: &str, recording: &str) -> String {
    format!(
        "<Scenario type=\"auto\"> <Sensor type=\"{kind}\"> <Recording> {recording} </Recording> </Sensor>
            <Map type=\"OctoMap\"> <Res> 0.1 m </Res> </Map> <Controller type=\"Playback\"/> </Scenario>"
    )
}

/// A file of 16 bits grey that says that it has `side` columns and rows, and has `depths`.
fn image(file: &Path, side: u32, depths: &[u8]) {
    let mut encoder = png::Encoder::new(std::fs::File::create(file).unwrap(), side, side);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    let mut writer = encoder.write_header().unwrap();
    if depths.is_empty() {
        writer.write_chunk(png::chunk::IDAT, &[0x78, 0x9c, 1, 0, 0, 0xff, 0xff, 0, 0, 0, 1]).unwrap();
    } else {
        writer.write_image_data(depths).unwrap();
    }
}

/// What may lie in a recording's place is answered in words, whatever it claims, in a gigabyte of memory.
#[test]
fn recordings_that_are_traps_start_nothing() {
    let elk = Elk::new("recordings");
    let at = |name: &str| elk.folder().join(name);
    let shell = "for d in fifo folder link vast list long outside; do mkdir $d; done
        mkfifo fifo/frame-0.depth.png fifo/frame-0.pose.txt list/depth.txt fifo.log
        mkdir folder/frame-0.depth.png folder/frame-0.pose.txt
        ln -s /dev/zero link/frame-0.depth.png
        yes '0 0 0 0 0 0 0 1' | head -n 16000000 > long/groundtruth.txt
        echo '0 a.png' > long/depth.txt
        echo '0 ../vast/frame-0.depth.png' > outside/depth.txt";
    let made = std::process::Command::new("bash").args(["-ec", shell]).current_dir(elk.folder()).status().unwrap();
    assert!(made.success());
    image(&at("vast/frame-0.depth.png"), 60_000, &[]);
    for (kind, recording, words) in [
        ("RGBD", "fifo", "it is a FIFO"),
        ("RGBD", "folder", "it is a folder"),
        ("RGBD", "link", "it is a device"),
        ("RGBD", "vast", "it is of 60000 × 60000 pixels: at most 4194304 would be right"),
        ("RGBD", "list", "depth.txt: it is a FIFO"),
        ("RGBD", "long", "longer than 134 MB"),
        ("RGBD", "outside", "is no file of this folder"),
        ("RGBD", "/dev/zero", "there is no folder /dev/zero"),
        ("Laser2D", "fifo.log", "it is a FIFO"),
        ("Laser2D", "folder", "it is a folder"),
        ("Laser2D", "/dev/zero", "it is a device"),
    ] {
        std::fs::write(at("m.xml"), player(kind, recording)).unwrap();
        let (code, said) = within(&elk, 1000, &["check", "m.xml"]);
        assert!(code == Some(1) && said.contains(words), "{recording}: {code:?}, {said}");
    }
}

/// Regression: a recording that began where nothing can be was waited for without end, as nobody believed where it began.
#[test]
fn a_recording_that_begins_nowhere_is_played_to_its_end() {
    let elk = Elk::new("nowhere");
    let folder = elk.folder().join("frames");
    std::fs::create_dir(&folder).unwrap();
    for (frame, x) in [(0, "1e300"), (1, "nan"), (2, "1")] {
        image(&folder.join(format!("frame-{frame}.depth.png")), 2, &[8; 8]);
        let pose = format!("1 0 0 {x} 0 1 0 0 0 0 1 0 0 0 0 1");
        std::fs::write(folder.join(format!("frame-{frame}.pose.txt")), pose).unwrap();
    }
    let launcher = elk.launch(&player("RGBD", &folder.display().to_string()));
    let (code, said) = launcher.end();
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("1 scans of 3 frames, 2 could not be used"), "{said}");
}

/// Regression: a picture was written over what a link in its place named, and waited for whoever would read a FIFO there.
#[test]
fn a_run_s_folder_from_elsewhere_leads_nowhere_else() {
    let elk = Elk::new("elsewhere");
    let (code, said) = elk.launch(&car("auto")).end();
    assert_eq!(code, Some(0), "{said}");
    let run = elk.run();
    let (picture, mine) = (run.join("picture.png"), elk.folder().join("mine"));
    let run = run.to_str().unwrap();
    std::fs::write(&mine, "mine").unwrap();
    std::fs::remove_file(&picture).unwrap();
    std::os::unix::fs::symlink(&mine, &picture).unwrap();
    let (code, said) = within(&elk, 2000, &["picture", run]);
    assert_eq!((code, std::fs::read_to_string(&mine).unwrap().as_str()), (Some(0), "mine"), "{said}");
    assert!(picture.symlink_metadata().unwrap().is_file());
    std::fs::remove_file(&picture).unwrap();
    assert!(std::process::Command::new("mkfifo").arg(&picture).status().unwrap().success());
    let (code, said) = within(&elk, 2000, &["picture", run]);
    assert!(code == Some(1) && said.contains("it is a FIFO; right is an ordinary file"), "{code:?}: {said}");
}
