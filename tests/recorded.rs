//! Recorded sensors, played through the real program: at the poses that were recorded, at those that their scans say, with frames in
//! the midst that are none, once more by a sensor that takes another one's place, and from the log.

mod common;

use std::f64::consts::PI;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

use common::{Elk, kill, said, summary_of};
use elk_bus::Mail;
use elk_bus::clock::Stopwatch;
use elk_log::LogReader;
use elk_map::comparison::compare;
use elk_map::{MapConfig, OccupancyMap, Saved};
use elk_sensor::simulator::{Settings, Simulator};
use elk_sensor::surroundings::Body;
use elk_sensor::{Camera, Capture, DepthSource, Pose};
use elk_spatial::keys::{PLAYBACK, POSE_ESTIMATE, PROGRESS, SCAN};
use elk_spatial::playback::Playback;
use elk_world::{Placement, World};
use nalgebra::{Isometry3, Point3};
use rustix::process::Signal;

const FRAMES: usize = 12;
const WIDTH: u32 = 160;
const HEIGHT: u32 = 120;

/// Where a frame is taken: a camera that goes and turns through the apartment, by as much from frame to frame as one in a hand does.
fn place(frame: usize) -> Pose {
    let i = frame as f64;
    Pose::from_yaw_pitch(Point3::new(2.2 + 0.03 * i, 3.2 - 0.02 * i, 1.2), -2.1 + 0.03 * i, -0.15)
}

/// A recording of the apartment, as 7-Scenes has them, in the folder `name`.
fn render(elk: &Elk, name: &str) -> PathBuf {
    let folder = elk.folder().join(name);
    std::fs::create_dir(&folder).unwrap();
    let world = World::load("apartment", &Placement::default()).unwrap();
    let camera = Camera::new(WIDTH, HEIGHT, 75_f64.to_radians());
    let mut simulator = Simulator::new(Body::new(world, place(0), 0.05), Settings { camera, ..Settings::default() });
    for frame in 0..FRAMES {
        let pose = place(frame);
        let seen = simulator.scan(&Capture { scan: frame as u64 + 1, time_secs: 0.0, pose }).unwrap();
        let mut depths = vec![0u16; (WIDTH * HEIGHT) as usize];
        for point in seen.points.iter() {
            let pixel = |along: f32, size: u32| {
                (f64::from(along / point.z) * camera.focal_px + f64::from(size) / 2.0 - 0.5).round() as u32
            };
            depths[(pixel(point.y, HEIGHT) * WIDTH + pixel(point.x, WIDTH)) as usize] =
                (point.z * 1000.0).round() as u16;
        }
        write_depths(&folder.join(format!("frame-{frame:06}.depth.png")), [WIDTH, HEIGHT], &depths);
        let rows: Vec<String> =
            pose.0.to_homogeneous().row_iter().map(|row| row.iter().map(|x| format!("{x:.17e} ")).collect()).collect();
        std::fs::write(folder.join(format!("frame-{frame:06}.pose.txt")), rows.join("\n")).unwrap();
    }
    folder
}

/// When TUM's clock stood at a frame (s): not as evenly as frames come.
fn tum_secs(frame: usize) -> f64 {
    1_305_031_102.0 + 0.1 * frame as f64 + 0.01 * (frame % 3) as f64
}

/// The recording in `frames` as TUM has it, in the folder `name`: with poses between those of the frames.
fn tum(elk: &Elk, frames: &Path, name: &str) -> PathBuf {
    let folder = elk.folder().join(name);
    std::fs::create_dir_all(folder.join("depth")).unwrap();
    let (mut images, mut poses) = (String::from("# time file\n"), String::from("# time pose\n"));
    for frame in 0..FRAMES {
        let image = format!("depth/{:.6}.png", tum_secs(frame));
        std::fs::copy(frames.join(format!("frame-{frame:06}.depth.png")), folder.join(&image)).unwrap();
        writeln!(images, "{:.6} {image}", tum_secs(frame)).unwrap();
        for (pose, late) in [(place(frame), 0.004), (place(frame + 100), 0.05)] {
            let ([x, y, z], q) = (<[f64; 3]>::from(pose.position().coords), pose.0.rotation);
            writeln!(poses, "{:.4} {x} {y} {z} {} {} {} {}", tum_secs(frame) + late, q.i, q.j, q.k, q.w).unwrap();
        }
    }
    std::fs::write(folder.join("depth.txt"), images).unwrap();
    std::fs::write(folder.join("groundtruth.txt"), poses).unwrap();
    folder
}

fn write_depths(file: &Path, [width, height]: [u32; 2], depths: &[u16]) {
    let mut encoder = png::Encoder::new(std::fs::File::create(file).unwrap(), width, height);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    let bytes: Vec<u8> = depths.iter().flat_map(|depth| depth.to_be_bytes()).collect();
    encoder.write_header().unwrap().write_image_data(&bytes).unwrap();
}

/// A mission that plays it; `more`: what else is said of the sensor.
fn mission(recording: &Path, more: &str) -> String {
    let focal = Camera::new(WIDTH, HEIGHT, 75_f64.to_radians()).focal_px;
    let centre = [WIDTH, HEIGHT].map(|size| f64::from(size) / 2.0 - 0.5);
    format!(
        "<Scenario name=\"Played\" type=\"auto\" version=\"1\">
            <Sensor type=\"RGBD\">
                <Recording> {} </Recording> <Stride> 1 </Stride> <Range> 20 m </Range> <MinRange> 0.05 m </MinRange>
                <FocalX> {focal} px </FocalX> <FocalY> {focal} px </FocalY>
                <CentreX> {} px </CentreX> <CentreY> {} px </CentreY> {more}
            </Sensor>
            <Map type=\"OctoMap\"> <Res> 0.1 m </Res> </Map>
            <Controller type=\"Playback\"/>
        </Scenario>",
        recording.display(),
        centre[0],
        centre[1]
    )
}

/// Plays a mission to its end, with logs in the folder `logs`; what it said, and the sensor.
fn play(elk: &Elk, mission: &str, logs: &str) -> String {
    let (code, said) = elk.launch_with(mission, &["--log-dir", logs]).end();
    assert_eq!(code, Some(0), "{said}");
    said + &std::fs::read_to_string(elk.run_in(logs).join("Sensor.log")).unwrap()
}

fn map(elk: &Elk, logs: &str) -> Vec<u8> {
    std::fs::read(elk.run_in(logs).join("map.bt")).unwrap()
}

fn occupancy(bytes: &[u8]) -> OccupancyMap {
    let config = MapConfig { resolution: 0.1, ..MapConfig::default() };
    OccupancyMap::from_saved(config, &Saved::read(bytes).unwrap()).unwrap()
}

/// Poses of a run's scans.
fn poses(elk: &Elk, logs: &str) -> Vec<Pose> {
    let mut log = LogReader::open(&elk.run_in(logs)).unwrap();
    let scans = log.by_ref().map(Result::unwrap).filter(|record| record.key == SCAN.name());
    scans.map(|record| record.value.as_ref().decode(&SCAN).unwrap().pose).collect()
}

fn apart(one: &Pose, other: &Pose) -> f64 {
    (one.position() - other.position()).norm()
}

#[test]
fn a_recording_is_played_to_its_end_at_its_poses_and_once_more_from_its_log() {
    let elk = Elk::new("recorded");
    let recording = render(&elk, "frames");
    let said_by = play(&elk, &mission(&recording, ""), "a");
    assert!(
        said_by.contains("Played: complete: the recording is played to its end, 12 scans of 12 frames"),
        "{said_by}"
    );
    let summary = summary_of(&elk.run_in("a"));
    assert_eq!((&summary["complete"], &summary["scans"]), (&true.into(), &12.into()), "{summary:#}");
    let way: f64 = (1..FRAMES).map(|frame| apart(&place(frame), &place(frame - 1))).sum();
    assert!((summary["path_length_m"].as_f64().unwrap() - way).abs() < 1e-6, "{summary:#}");
    let found = poses(&elk, "a");
    assert_eq!(found.len(), FRAMES);
    assert!(found.iter().enumerate().all(|(frame, pose)| apart(pose, &place(frame)) < 1e-9), "{found:?}");

    // The map is that of the scans at these poses, inserted here.
    let mut log = LogReader::open(&elk.run_in("a")).unwrap();
    let mut expected = OccupancyMap::new(MapConfig { resolution: 0.1, ..MapConfig::default() }).unwrap();
    for record in log.by_ref().map(Result::unwrap).filter(|record| record.key == SCAN.name()) {
        let scan = record.value.as_ref().decode(&SCAN).unwrap();
        assert_eq!(scan.points.len(), (WIDTH * HEIGHT) as usize, "every pixel sees a wall");
        expected.insert(scan.pose.position(), scan.world_points());
    }
    let made = occupancy(&map(&elk, "a"));
    let [same, _] = compare(&expected, made.grid(), 0).shares();
    assert!(same > 0.95 && made.grid().free() > 1000, "{same}: guards against grazing rays apart, it is one map");

    let old = elk.run_in("a").display().to_string();
    let replay =
        ["replay", &old, "--rate", "max", "--keys", "SCAN*", "--only", "Map", "--into", &old, "--log-dir", "b"];
    let out = elk.command(&replay).output().unwrap();
    assert!(out.status.success(), "{}", said(&out));
    assert!(map(&elk, "a") == map(&elk, "b"), "the map of the same scans is another one");
    // A run's folder is a mission, and its recording is still there.
    let out = elk
        .command(&["launch", &old, "--headless", "--community", elk.community(), "--log-dir", "c"])
        .output()
        .unwrap();
    assert!(out.status.success(), "{}", said(&out));
    assert!(map(&elk, "a") == map(&elk, "c"));
}

#[test]
fn poses_that_the_images_say_are_near_those_that_were_recorded() {
    let elk = Elk::new("recorded-icp");
    let recording = render(&elk, "frames");
    play(&elk, &mission(&recording, ""), "given");
    // After the first one, no pose is looked at.
    let said = play(&elk, &mission(&recording, "<PoseEstimator> ICP </PoseEstimator>"), "estimated");
    assert!(said.contains("m off the recorded ones"), "{said}");
    let off = summary_of(&elk.run_in("estimated"))["position_error_m"].as_f64().unwrap();
    assert!(off > 0.0 && off < 0.01, "{off} m");
    assert!(summary_of(&elk.run_in("given"))["position_error_m"].is_null(), "nothing is estimated");
    let found = poses(&elk, "estimated");
    assert!(
        found.len() == FRAMES && found.iter().enumerate().all(|(i, pose)| apart(pose, &place(i)) < 0.02),
        "{found:?}"
    );
    let [given, estimated] = ["given", "estimated"].map(|logs| occupancy(&map(&elk, logs)));
    let shares =
        [compare(&given, estimated.grid(), 1), compare(&estimated, given.grid(), 1)].map(|one| one.shares()[1]);
    assert!(shares.iter().all(|share| *share > 0.95), "{shares:?}");

    let mut log = LogReader::open(&elk.run_in("estimated")).unwrap();
    let said = log.by_ref().map(Result::unwrap).filter(|record| record.key == POSE_ESTIMATE.name());
    let said: Vec<_> = said.map(|record| record.value.as_ref().decode(&POSE_ESTIMATE).unwrap()).collect();
    assert_eq!(said.len(), FRAMES);
    for (i, estimate) in said.iter().enumerate().skip(1) {
        assert_eq!((estimate.scan, estimate.pose), (i as u64 + 1, Some(found[i])));
        let variance = |axis: usize| estimate.covariance[7 * axis];
        assert!(
            estimate.overlap > 0.5 && (0..3).all(|axis| variance(axis) > 0.0 && variance(axis) < 1e-4),
            "{estimate:?}"
        );
    }
}

#[test]
fn the_same_frames_are_the_same_scans_in_both_layouts() {
    let elk = Elk::new("recorded-layouts");
    let frames = render(&elk, "frames");
    let timed = tum(&elk, &frames, "tum");
    let scans = |recording: &Path, logs: &str| {
        let said = play(&elk, &mission(recording, ""), logs);
        assert!(said.contains("played to its end, 12 scans of 12 frames"), "{said}");
        let mut log = LogReader::open(&elk.run_in(logs)).unwrap();
        let scans = log.by_ref().map(Result::unwrap).filter(|record| record.key == SCAN.name());
        scans.map(|record| record.value.as_ref().decode(&SCAN).unwrap().into_owned()).collect::<Vec<_>>()
    };
    let [numbered, with_times] = [scans(&frames, "numbered"), scans(&timed, "timed")];
    assert_eq!(with_times.len(), FRAMES);
    for (one, other) in numbered.iter().zip(&with_times) {
        assert!(one.points == other.points && one.camera == other.camera, "scan {}", one.id);
        assert!(apart(&one.pose, &other.pose) < 1e-9 && one.pose.0.rotation.angle_to(&other.pose.0.rotation) < 1e-7);
    }

    // A line of either list that is none, a file that is not there: the others are played, at their times.
    let spoil = |list: &str, from: &str, to: &str| {
        let list = timed.join(list);
        let text = std::fs::read_to_string(&list).unwrap();
        assert!(text.contains(from));
        std::fs::write(&list, text.replacen(from, to, 1)).unwrap();
    };
    spoil("depth.txt", &format!("{:.6} depth", tum_secs(3)), "noon depth");
    spoil("groundtruth.txt", &format!("{:.4} ", tum_secs(5) + 0.004), "x ");
    std::fs::remove_file(timed.join(format!("depth/{:.6}.png", tum_secs(8)))).unwrap();
    let said = play(&elk, &mission(&timed, ""), "given");
    for words in [
        "groundtruth.txt: line 12: \"x\" is no finite number; it is left out",
        "depth.txt:5: \"noon\" is no time",
        &format!("depth/{:.6}.png: groundtruth.txt has no pose within 0.02 s of ", tum_secs(5)),
        "s (line 12: \"x\" is no finite number)",
        &format!("depth/{:.6}.png: No such file or directory (os error 2); right is a PNG of 16 bits", tum_secs(8)),
        "9 scans of 12 frames, 3 could not be used",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
    let said = play(&elk, &mission(&timed, "<PoseEstimator> ICP </PoseEstimator>"), "estimated");
    assert!(said.contains("10 scans of 12 frames, 2 could not be used"), "{said}");
    let mut log = LogReader::open(&elk.run_in("estimated")).unwrap();
    let estimates = log.by_ref().map(Result::unwrap).filter(|record| record.key == POSE_ESTIMATE.name());
    let times: Vec<f64> = estimates.map(|record| record.value.as_ref().decode(&POSE_ESTIMATE).unwrap().secs).collect();
    let wanted: Vec<f64> = (0..FRAMES).filter(|i| ![3, 8].contains(i)).map(|i| tum_secs(i) - tum_secs(0)).collect();
    assert!(times.len() == wanted.len() && times.iter().zip(&wanted).all(|(a, b)| (a - b).abs() < 1e-5), "{times:?}");
}

/// With a wall of images in the midst that are of another place, the sensor is lost there, and finds back.
#[test]
fn frames_that_are_none_and_frames_of_elsewhere_are_named_counted_and_passed_over() {
    let elk = Elk::new("recorded-bad");
    let recording = render(&elk, "frames");
    let depth = |frame: usize| recording.join(format!("frame-{frame:06}.depth.png"));
    let whole = std::fs::read(depth(2)).unwrap();
    std::fs::write(depth(2), &whole[..whole.len() / 2]).unwrap();
    write_depths(&depth(4), [80, 60], &[1000; 4800]);
    write_depths(&depth(10), [WIDTH, HEIGHT], &vec![0; (WIDTH * HEIGHT) as usize]);
    std::fs::write(recording.join("frame-000006.pose.txt"), "2 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n").unwrap();
    std::fs::remove_file(recording.join("frame-000008.pose.txt")).unwrap();
    let said = play(&elk, &mission(&recording, ""), "given");
    for words in [
        "frame-000002.depth.png: it cannot be read as a PNG",
        "frame-000004.depth.png: it is of 80 × 60 pixels: 160 × 120, as the others, would be right",
        "frame-000006.depth.png: its pose, frame-000006.pose.txt: no pose: columns of its rotation are 3.000 off",
        "frame-000008.depth.png: there is no frame-000008.pose.txt",
        "frame-000010.depth.png: none of its pixels has a depth, all are 0",
        "7 scans of 12 frames, 5 could not be used",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
    // Where poses are estimated, theirs need not be right; a frame with a ball before the lens is of no place that was seen.
    let ball: Vec<u16> = (0..WIDTH * HEIGHT)
        .map(|pixel| {
            let [x, y] = [pixel % WIDTH, pixel / WIDTH].map(|i| f64::from(i) - 60.0);
            300 + ((x * x + y * y) / 40.0) as u16
        })
        .collect();
    write_depths(&depth(5), [WIDTH, HEIGHT], &ball);
    let said = play(&elk, &mission(&recording, "<PoseEstimator> ICP </PoseEstimator>"), "estimated");
    assert!(said.contains("frame-000005.depth.png: lost: "), "{said}");
    assert!(said.contains("8 scans of 12 frames, 3 could not be used, 1 with the sensor lost"), "{said}");
    let summary = summary_of(&elk.run_in("estimated"));
    assert!(summary["position_error_m"].as_f64().unwrap() < 0.02, "{summary:#}");
    let counted = ["frames", "unusable_frames", "lost_frames"].map(|count| summary[count].as_u64());
    assert_eq!(counted, [Some(12), Some(3), Some(1)], "{summary:#}");
    // Regression: an estimate that begins where no pose is recorded is somewhere else, and by as much it was said to be off.
    std::fs::remove_file(recording.join("frame-000000.pose.txt")).unwrap();
    play(&elk, &mission(&recording, "<PoseEstimator> ICP </PoseEstimator>"), "unposed");
    let (found, summary) = (poses(&elk, "unposed"), summary_of(&elk.run_in("unposed")));
    assert!(apart(&found[0], &place(0)) > 1.0, "it begins at the origin: {found:?}");
    assert!(summary["position_error_m"].as_f64().unwrap() < 0.02, "{summary:#}");
}

/// The sensor goes through the frames again that the one before it has had, and nobody can tell from the map.
#[test]
fn a_sensor_that_is_killed_is_followed_by_one_that_goes_on_where_it_was() {
    let elk = Elk::new("recorded-killed");
    let recording = render(&elk, "frames");
    let icp = "<PoseEstimator> ICP </PoseEstimator>";
    play(&elk, &mission(&recording, icp), "whole");
    let by_hand = mission(&recording, icp).replace("\"auto\"", "\"manual\"");
    let by_hand = by_hand.replace("<Sensor type", "<Sensor restart=\"on-failure\" type");
    let mut launcher = elk.launch_with(&by_hand, &["--log-dir", "killed"]);
    launcher.wait_for("Enter takes a step");
    let mut probe = elk.join("probe");
    probe.comms.register(&PROGRESS).unwrap();
    for scans in 1..=4 {
        elk.obeyed(&["step"]);
        let mut seen = 0;
        let begun = Stopwatch::start();
        while seen < scans {
            assert!(begun.elapsed() < Duration::from_secs(60), "scan {scans} never came");
            let note = |mail: &Mail<'_>| seen = mail.decode(&PROGRESS).map_or(seen, |progress| progress.scans);
            probe.receive(Duration::from_millis(200), note).unwrap();
        }
    }
    kill(launcher.process_of("Sensor"), Signal::KILL);
    elk.obeyed(&["resume"]);
    let (code, said) = launcher.end();
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("12 scans of 12 frames"), "{said}");
    assert!(map(&elk, "whole") == map(&elk, "killed"));
}

/// Regression: one word that the recording was elsewhere, and its mission stood still for good.
#[test]
fn who_says_that_the_recording_is_elsewhere_stops_nobody() {
    let elk = Elk::new("recorded-lies");
    let recording = render(&elk, "frames");
    let mut launcher = elk.launch(&mission(&recording, "").replace("\"auto\"", "\"manual\""));
    launcher.wait_for("Enter takes a step");
    let mut liar = elk.join("liar");
    liar.comms.register(&PLAYBACK).unwrap();
    elk.obeyed(&["step"]);
    let begun = Stopwatch::start();
    for lie in 0..5 {
        // It is said again after each lie.
        let mut truth: Option<Playback> = None;
        while truth.as_ref().is_none_or(|truth| truth.scans < 1) {
            assert!(begun.elapsed() < Duration::from_secs(60), "the truth is not said after lie {lie}");
            let note = |mail: &Mail<'_>| {
                if mail.source() == "Sensor" {
                    truth = mail.decode(&PLAYBACK).ok();
                }
            };
            liar.receive(Duration::from_millis(200), note).unwrap();
        }
        let truth = truth.unwrap();
        let lie = match lie {
            0 => Playback { command: 1 << 40, ..truth },
            1 => Playback { scans: 1 << 40, ..truth },
            2 => Playback { command: 0, scans: 0, ..truth },
            3 => Playback { frames: 1 << 40, path_length_m: 1e6, ..truth },
            _ => break,
        };
        liar.comms.publish(&PLAYBACK, &lie).unwrap();
        liar.comms.flush().unwrap();
    }
    elk.obeyed(&["resume"]);
    let (code, said) = launcher.end();
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("12 scans of 12 frames"), "{said}");
    assert!(said.contains("PLAYBACK by liar: it is not the mission's, and counts for nothing"), "{said}");
}

#[test]
fn a_recording_that_is_not_there_or_a_mission_that_cannot_play_it_starts_nothing() {
    let elk = Elk::new("recorded-missing");
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("mission-files");
    let launch = |mission: &str, data: Option<&str>| {
        let file = root.join(mission).display().to_string();
        let mut command = elk.command(&["launch", &file, "--headless", "--community", elk.community()]);
        match data {
            Some(data) => command.env("ELK_DATA", data),
            None => command.env_remove("ELK_DATA"),
        };
        let out = command.output().unwrap();
        assert!(!out.status.success());
        said(&out)
    };
    for mission in ["7scenes.xml", "intel-lab.xml"] {
        let words = launch(mission, None);
        assert!(words.contains("the variable ELK_DATA is not set; right is the folder in it that has"), "{words}");
        let words = launch(mission, Some("no-such-folder"));
        assert!(
            words.contains("no-such-folder") && words.contains("ELK_DATA or Sensor.Recording has to name it"),
            "{words}"
        );
    }
    std::fs::create_dir(elk.folder().join("empty")).unwrap();
    let said = elk.launch_and_fail(&mission(&elk.folder().join("empty"), ""));
    assert!(said.contains("neither a depth.txt nor a frame-….depth.png in it; right is a folder of"), "{said}");
    let sent = mission(&elk.folder().join("empty"), "").replace("\"Playback\"", "\"MOOSSim\"");
    let said = elk.launch_and_fail(&sent.replace("</Scenario>", "<Explorer type=\"Potential\"/></Scenario>"));
    assert!(said.contains("the Sensor is a recording, which goes where it went; right is no <Explorer>"), "{said}");
    assert!(said.contains("right is a <Controller type=\"Playback\">"), "{said}");
    let small = common::small::small("auto", "").replace("\"MOOSSim\"", "\"Playback\"");
    assert!(elk.launch_and_fail(&small).contains("the Sensor is no recording that this Controller could play"));
    assert!(!elk.folder().join("logs").exists(), "nothing was started");
}

/// How far a beam of a laser at (x, y) in the direction `angle` goes in a room of 6 × 4 m with a pillar.
fn range([x, y]: [f64; 2], angle: f64) -> f64 {
    let walls = [[[0.0, 0.0], [6.0, 4.0]], [[2.6, 2.8], [3.1, 3.2]]];
    let (sin, cos) = angle.sin_cos();
    let mut nearest = f64::INFINITY;
    for [[left, low], [right, high]] in walls {
        for (wall, along, across, slope, at, ends) in [
            (left, x, y, cos, sin, [low, high]),
            (right, x, y, cos, sin, [low, high]),
            (low, y, x, sin, cos, [left, right]),
            (high, y, x, sin, cos, [left, right]),
        ] {
            let distance = (wall - along) / slope;
            let hit = across + distance * at;
            if distance > 0.0 && (ends[0]..=ends[1]).contains(&hit) {
                nearest = nearest.min(distance);
            }
        }
    }
    nearest
}

#[test]
fn a_log_of_a_laser_is_matched_in_the_plane() {
    let elk = Elk::new("recorded-laser");
    let truth = |i: usize| [1.0 + 0.1 * i as f64, 1.5 + 0.02 * i as f64, 0.3 + 0.03 * i as f64];
    let mut log = String::from("# a log\n");
    for i in 0..30 {
        let [x, y, angle] = truth(i);
        let beams = (0..180).map(|beam| range([x, y], angle + PI * (f64::from(beam) / 180.0 - 0.5)));
        let beams: Vec<String> = beams.map(|range| format!("{range:.4}")).collect();
        // Wheels that slip: they say a tenth more.
        let [a, b, c] = [1.1 * x, 1.1 * y, 1.1 * angle];
        let time = i as f64 * 0.2;
        writeln!(log, "ODOM {a} {b} {c} 0 0 0 {time} host {time}").unwrap();
        if i == 12 {
            writeln!(log, "FLASER 3 1.0 nan 2.0 0 0 0 0 0 0 {time} host {time}").unwrap();
        }
        writeln!(log, "FLASER 180 {} {x} {y} {angle} {x} {y} {angle} {time} host {time}", beams.join(" ")).unwrap();
    }
    let file = elk.folder().join("room.log");
    std::fs::write(&file, &log).unwrap();
    let mission = |more: &str| {
        format!(
            "<Scenario name=\"Room\" type=\"auto\" version=\"1\">
                <Sensor type=\"Laser2D\"> <Recording> {} </Recording> <Height> 0.25 m </Height> {more} </Sensor>
                <Map type=\"OctoMap\"> <Res> 0.1 m </Res> </Map> <Controller type=\"Playback\"/>
            </Scenario>",
            file.display()
        )
    };
    let said = play(&elk, &mission("<PoseEstimator> ICP </PoseEstimator>"), "estimated");
    assert!(said.contains("room.log:27: beam 1 of NaN m: a finite range of at least 0 would be right"), "{said}");
    assert!(said.contains("30 scans of 31 frames, 1 could not be used"), "{said}");
    let found = poses(&elk, "estimated");
    for (i, pose) in found.iter().enumerate() {
        let [x, y, angle] = truth(i);
        let wanted = Pose::from_yaw_pitch(Point3::new(x, y, 0.25), angle, 0.0);
        let Isometry3 { rotation, .. } = wanted.0.inverse() * pose.0;
        assert!(apart(pose, &wanted) < 0.03 && rotation.angle() < 0.01, "{i}: {pose:?} is not {wanted:?}");
    }
    play(&elk, &mission(""), "given");
    let [given, estimated] = ["given", "estimated"].map(|logs| occupancy(&map(&elk, logs)));
    assert!(compare(&given, estimated.grid(), 1).shares()[1] > 0.95);
    std::fs::write(&file, "no log\n").unwrap();
    let refused = elk.launch_and_fail(&mission(""));
    assert!(
        refused.contains("there is no scan in it; right is a CARMEN log with FLASER or ROBOTLASER1 lines"),
        "{refused}"
    );
}

/// Regression: whatever a laser saw was taken to lie over 180°, and mapped elsewhere than it was.
#[test]
fn a_laser_sees_as_far_around_as_it_says() {
    let elk = Elk::new("recorded-fan");
    let (beams, fov) = (1080, 1.5 * PI);
    let [x, y, angle] = [1.5, 1.5, 0.4];
    let ranges = (0..beams).map(|beam| range([x, y], angle + fov * (f64::from(beam) / f64::from(beams) - 0.5)));
    let ranges: Vec<String> = ranges.map(|range| format!("{range:.4}")).collect();
    let ranges = ranges.join(" ");
    let file = elk.folder().join("room.log");
    let mission = |more: &str| {
        format!(
            "<Scenario name=\"Room\" type=\"auto\" version=\"1\">
                <Sensor type=\"Laser2D\"> <Recording> {} </Recording> {more} </Sensor>
                <Map type=\"OctoMap\"> <Res> 0.1 m </Res> </Map> <Controller type=\"Playback\"/>
            </Scenario>",
            file.display()
        )
    };
    let older = format!("FLASER {beams} {ranges} {x} {y} {angle} {x} {y} {angle} 1 host 1\n");
    // What is as far away as this laser sees, it does not see.
    let newer = format!(
        "ROBOTLASER1 4 {} {fov} {} 4.0 0.01 0 {beams} {ranges} 0 {x} {y} {angle} {x} {y} {angle} 0 0 0.3 0.3 0 1 host 1\n",
        -fov / 2.0,
        fov / f64::from(beams)
    );
    for (log, more, logs, range_m) in [(older, "<Fov> 270 deg </Fov>", "older", 30.0), (newer, "", "newer", 4.0)] {
        std::fs::write(&file, log).unwrap();
        let said = play(&elk, &mission(more), logs);
        assert!(said.contains("1 scans of 1 frames"), "{said}");
        let mut log = LogReader::open(&elk.run_in(logs)).unwrap();
        let scan = log.by_ref().map(Result::unwrap).find(|record| record.key == SCAN.name()).unwrap();
        let scan = scan.value.as_ref().decode(&SCAN).unwrap();
        assert!((scan.camera.fov_x - fov).abs() < 1e-9 && (scan.camera.range_m - range_m).abs() < 1e-6);
        assert_eq!(scan.points.len() + scan.no_return.len(), beams as usize);
        assert_eq!(!scan.no_return.is_empty(), range_m < 5.0);
        let walls = |point: Point3<f64>| {
            let outer = [point.x, 6.0 - point.x, point.y, 4.0 - point.y].into_iter().fold(f64::INFINITY, f64::min);
            let pillar = (2.6 - point.x).max(point.x - 3.1).max(2.8 - point.y).max(point.y - 3.2).abs();
            outer.abs().min(pillar)
        };
        let off = scan.world_points().map(|point| walls(point.cast())).fold(0.0, f64::max);
        assert!(off < 1e-3, "{logs}: a point {off} m off every wall");
    }
    let refused = elk.launch_and_fail(&mission("<Fov> 400 deg </Fov>"));
    assert!(refused.contains("Fov") && refused.contains("360"), "{refused}");
}
