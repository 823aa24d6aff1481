//! Recorded stereo cameras, played through the real program: the apartment as two cameras saw it, in the layouts of EuRoC and KITTI, at the
//! poses that were recorded and at those that the images say; with pairs in the midst that are none; and once more from the log.

mod common;

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use common::{Elk, said, summary_of};
use elk_log::LogReader;
use elk_map::comparison::compare;
use elk_map::{MapConfig, OccupancyMap, Saved};
use elk_sensor::simulated_stereo::{Eyes, Look, Texture};
use elk_sensor::{Camera, Pose};
use elk_spatial::Scan;
use elk_spatial::keys::{POSE_ESTIMATE, SCAN};
use elk_stereo::Image;
use elk_world::{Placement, World};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion};

const FRAMES: usize = 10;
const SIZE: [u32; 2] = [320, 240];
const BASELINE_M: f64 = 0.12;
/// When the first pair was taken (ns), and how long after each the next was.
const FIRST: u64 = 1_403_715_273_262_142_976;
const STEP: u64 = 50_000_000;

/// Where a pair is taken: by a camera that goes and turns through the apartment, by as much from pair to pair as one in a hand does.
fn place(frame: usize) -> Pose {
    let i = frame as f64;
    Pose::from_yaw_pitch(Point3::new(2.2 + 0.03 * i, 3.2 - 0.02 * i, 1.2), -2.1 + 0.02 * i, -0.15)
}

/// The cameras on the body that carries them, as EuRoC's are: turned and aside.
fn body_from_camera() -> Isometry3<f64> {
    let turn = UnitQuaternion::from_euler_angles(0.3, -0.2, 1.5);
    Isometry3::from_parts(Translation3::new(-0.02, -0.06, 0.01), turn)
}

fn camera() -> Camera {
    Camera::new(SIZE[0], SIZE[1], 75_f64.to_radians())
}

fn view(pose: &Pose, number: usize) -> [Image; 2] {
    static WORLD: LazyLock<(World, Texture)> = LazyLock::new(|| {
        let world = World::load("apartment", &Placement::default()).unwrap();
        let texture = Texture::new(&world, &Look { contrast: 20.0, blank: 0.0, seed: 1 });
        (world, texture)
    });
    let eyes = Eyes { camera: camera(), baseline_m: BASELINE_M, noise: 1.0, seed: 1 };
    eyes.render(&WORLD.0, &WORLD.1, pose, number as u64 + 1).unwrap()
}

static PAIRS: LazyLock<Vec<[Image; 2]>> = LazyLock::new(|| (0..FRAMES).map(|i| view(&place(i), i)).collect());

fn write(file: &Path, image: &Image) {
    let file = std::fs::File::create(file).unwrap();
    let mut encoder = png::Encoder::new(file, image.width() as u32, image.height() as u32);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.write_header().unwrap().write_image_data(image.pixels()).unwrap();
}

fn stamp(frame: usize) -> String {
    format!("{}.png", FIRST + STEP * frame as u64)
}

/// One of the two cameras as EuRoC describes it, `aside` (m) to the right of the left one on the body.
fn yaml(aside: f64) -> String {
    let pose = (body_from_camera() * Translation3::new(aside, 0.0, 0.0)).to_homogeneous();
    let numbers: Vec<String> = pose.transpose().iter().map(|number| format!("{number:.15}")).collect();
    let (focal, [width, height]) = (camera().focal_px, SIZE);
    let centre = SIZE.map(|side| f64::from(side) / 2.0 - 0.5);
    format!(
        "%YAML:1.0\nsensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: [{}]\nrate_hz: 20\nresolution: [{width}, {height}]\n\
         camera_model: pinhole\nintrinsics: [{focal}, {focal}, {}, {}]\ndistortion_model: radial-tangential\n\
         distortion_coefficients: [0.0, 0.0, 0.0, 0.0]\n",
        numbers.join(", "),
        centre[0],
        centre[1]
    )
}

/// A recording in EuRoC's layout, without the folders between.
fn euroc(folder: &Path) -> PathBuf {
    for (side, name) in ["cam0", "cam1"].into_iter().enumerate() {
        std::fs::create_dir_all(folder.join(name)).unwrap();
        std::fs::write(folder.join(format!("{name}.yaml")), yaml(BASELINE_M * side as f64)).unwrap();
        PAIRS.iter().enumerate().for_each(|(i, pair)| write(&folder.join(name).join(stamp(i)), &pair[side]));
    }
    let body = |frame: usize| place(frame).0 * body_from_camera().inverse();
    let line = |frame: usize| {
        let (body, secs) = (body(frame), (FIRST + STEP * frame as u64) as f64 * 1e-9);
        let ([x, y, z], q) = (<[f64; 3]>::from(body.translation.vector), body.rotation);
        format!("{secs:.5} {x} {y} {z} {} {} {} {}\n", q.i, q.j, q.k, q.w)
    };
    let lines: String = (0..FRAMES).map(line).collect();
    std::fs::write(folder.join("groundtruth.txt"), "# body in world\n".to_owned() + &lines).unwrap();
    folder.to_owned()
}

/// The same as EuRoC publishes it.
fn published(folder: &Path) -> PathBuf {
    let inner = folder.join("mav0");
    for (side, name) in ["cam0", "cam1"].into_iter().enumerate() {
        std::fs::create_dir_all(inner.join(name).join("data")).unwrap();
        std::fs::write(inner.join(name).join("sensor.yaml"), yaml(BASELINE_M * side as f64)).unwrap();
        let write = |(i, pair): (usize, &[Image; 2])| write(&inner.join(name).join("data").join(stamp(i)), &pair[side]);
        PAIRS.iter().enumerate().for_each(write);
    }
    let truth = inner.join("state_groundtruth_estimate0");
    std::fs::create_dir(&truth).unwrap();
    let line = |frame: usize| {
        let body = place(frame).0 * body_from_camera().inverse();
        let ([x, y, z], q) = (<[f64; 3]>::from(body.translation.vector), body.rotation);
        format!("{},{x},{y},{z},{},{},{},{},0.1,0.2,0.3\n", FIRST + STEP * frame as u64, q.w, q.i, q.j, q.k)
    };
    let lines: String = (0..FRAMES).map(line).collect();
    std::fs::write(truth.join("data.csv"), "#timestamp, p_RS_R_x [m]\n".to_owned() + &lines).unwrap();
    folder.to_owned()
}

/// The same in KITTI's layout, whose poses begin at the first camera.
fn kitti(folder: &Path) -> PathBuf {
    for (side, name) in ["image_0", "image_1"].into_iter().enumerate() {
        std::fs::create_dir_all(folder.join(name)).unwrap();
        let write =
            |(i, pair): (usize, &[Image; 2])| write(&folder.join(name).join(format!("{i:06}.png")), &pair[side]);
        PAIRS.iter().enumerate().for_each(write);
    }
    let (focal, [x, y]) = (camera().focal_px, SIZE.map(|side| f64::from(side) / 2.0 - 0.5));
    let projection = |name: &str, aside: f64| {
        format!("{name}: {focal:e} 0 {x:e} {:e} 0 {focal:e} {y:e} 0 0 0 1 0\n", -focal * aside)
    };
    std::fs::write(folder.join("calib.txt"), projection("P0", 0.0) + &projection("P1", BASELINE_M)).unwrap();
    let times: String = (0..FRAMES).map(|i| format!("{:e}\n", 0.05 * i as f64)).collect();
    std::fs::write(folder.join("times.txt"), times).unwrap();
    let pose = |frame: usize| {
        let pose = (place(0).0.inverse() * place(frame).0).to_homogeneous();
        let rows: Vec<String> = pose.fixed_rows::<3>(0).transpose().iter().map(|x| format!("{x:e}")).collect();
        rows.join(" ") + "\n"
    };
    std::fs::write(folder.join("poses.txt"), (0..FRAMES).map(pose).collect::<String>()).unwrap();
    folder.to_owned()
}

/// A mission that plays a recording; `more`: what else is said of the sensor.
fn mission(recording: &Path, more: &str) -> String {
    format!(
        "<Scenario name=\"Played\" type=\"auto\" version=\"1\">
            <Sensor type=\"Stereo\"> <Recording> {} </Recording> <Range> 3 m </Range> {more} </Sensor>
            <Map type=\"OctoMap\"> <Res> 0.1 m </Res> </Map>
            <Controller type=\"Playback\"/>
        </Scenario>",
        recording.display()
    )
}

const ODOMETRY: &str = "<PoseEstimator> VisualOdometry </PoseEstimator>";

/// Plays a mission to its end, with logs in the folder `logs`; whether that is a good one, and what it said, and the sensor.
fn play(elk: &Elk, mission: &str, logs: &str) -> (Option<i32>, String) {
    let (code, said) = elk.launch_with(mission, &["--log-dir", logs]).end();
    (code, said + &std::fs::read_to_string(elk.run_in(logs).join("Sensor.log")).unwrap())
}

fn map(elk: &Elk, logs: &str) -> Vec<u8> {
    std::fs::read(elk.run_in(logs).join("map.bt")).unwrap()
}

fn scans(elk: &Elk, logs: &str) -> Vec<Scan<'static>> {
    let mut log = LogReader::open(&elk.run_in(logs)).unwrap();
    let scans = log.by_ref().map(Result::unwrap).filter(|record| record.key == SCAN.name());
    scans.map(|record| record.value.as_ref().decode(&SCAN).unwrap().into_owned()).collect()
}

fn apart(one: &Pose, other: &Pose) -> f64 {
    (one.position() - other.position()).norm()
}

#[test]
fn pairs_are_matched_localised_and_mapped_and_the_map_is_had_again_byte_for_byte() {
    let elk = Elk::new("stereo-played");
    let recording = euroc(&elk.folder().join("pairs"));
    let (code, words) = play(&elk, &mission(&recording, ""), "given");
    assert!(code == Some(0) && words.contains("played to its end, 10 scans of 10 frames"), "{words}");
    let given = scans(&elk, "given");
    assert!(
        given.iter().enumerate().all(|(i, scan)| apart(&scan.pose, &place(i)) < 1e-3),
        "the poses are the cameras'"
    );
    let camera = given[0].camera;
    let per_pixel = 0.25 / (self::camera().focal_px * BASELINE_M);
    assert!((camera.inverse_depth_sigma - per_pixel).abs() < 1e-9 && camera.range_m == 3.0, "{camera:?}");
    assert_eq!((camera.columns, camera.rows), (SIZE[0], SIZE[1]));
    let seen = given[0].points.len() + given[0].no_return.len();
    assert!((20_000..76_800).contains(&seen), "{seen}: most is matched, and what is not is in neither list");

    let (code, words) = play(&elk, &mission(&recording, ODOMETRY), "estimated");
    assert!(code == Some(0) && words.contains("m off the recorded ones"), "{words}");
    let off = summary_of(&elk.run_in("estimated"))["position_error_m"].as_f64().unwrap();
    assert!(off > 0.0 && off < 0.01, "{off} m");
    let estimated = scans(&elk, "estimated");
    assert!(estimated.len() == FRAMES && estimated.iter().zip(&given).all(|(one, other)| one.points == other.points));
    let maps = ["given", "estimated"].map(|logs| {
        let config = MapConfig { resolution: 0.1, ..MapConfig::default() };
        OccupancyMap::from_saved(config, &Saved::read(&map(&elk, logs)).unwrap()).unwrap()
    });
    let shares = [compare(&maps[0], maps[1].grid(), 1), compare(&maps[1], maps[0].grid(), 1)];
    assert!(shares.iter().all(|one| one.shares()[1] > 0.95) && maps[0].grid().free() > 1000, "{shares:?}");

    let mut log = LogReader::open(&elk.run_in("estimated")).unwrap();
    let estimates = log.by_ref().map(Result::unwrap).filter(|record| record.key == POSE_ESTIMATE.name());
    let estimates: Vec<_> = estimates.map(|record| record.value.as_ref().decode(&POSE_ESTIMATE).unwrap()).collect();
    assert_eq!(estimates.len(), FRAMES);
    for (i, estimate) in estimates.iter().enumerate().skip(1) {
        assert_eq!((estimate.scan, estimate.pose), (i as u64 + 1, Some(estimated[i].pose)));
        assert!((estimate.secs - 0.05 * i as f64).abs() < 1e-4 && estimate.overlap > 0.5, "{estimate:?}");
        assert!((0..6).all(|axis| (1e-12..1e-3).contains(&estimate.covariance[7 * axis])), "{estimate:?}");
    }

    let old = elk.run_in("estimated").display().to_string();
    let replay =
        ["replay", &old, "--rate", "max", "--keys", "SCAN*", "--only", "Map", "--into", &old, "--log-dir", "again"];
    let out = elk.command(&replay).output().unwrap();
    assert!(out.status.success(), "{}", said(&out));
    assert!(map(&elk, "estimated") == map(&elk, "again"), "the map of the same scans is another one");
    // A run's folder is a mission: the same recording, from its images on.
    let out = elk.command(&["launch", &old, "--headless", "--community", elk.community(), "--log-dir", "anew"]);
    let out = { out }.output().unwrap();
    assert!(out.status.success(), "{}", said(&out));
    assert!(map(&elk, "estimated") == map(&elk, "anew"), "the map of the same images is another one");
}

#[test]
fn a_recording_is_the_same_in_every_layout() {
    let elk = Elk::new("stereo-layouts");
    let layouts = [
        ("euroc", euroc(&elk.folder().join("a"))),
        ("published", published(&elk.folder().join("b"))),
        ("kitti", kitti(&elk.folder().join("c"))),
    ];
    let played = layouts.map(|(name, recording)| {
        let (code, words) = play(&elk, &mission(&recording, "<Frames> 3 </Frames>"), name);
        assert_eq!(code, Some(0), "{name}: {words}");
        scans(&elk, name)
    });
    for scans in &played {
        assert_eq!(scans.len(), 3);
        let way = scans.iter().zip(&played[0]).map(|(scan, first)| {
            let [here, there] =
                [(scan, &scans[0]), (first, &played[0][0])].map(|(scan, first)| first.pose.0.inverse() * scan.pose.0);
            (here.inverse() * there).translation.vector.norm()
        });
        assert!(way.fold(0.0, f64::max) < 1e-5);
        // Rectification takes a pixel on a border for one that nobody sees, which differs by rounding.
        let points = |scan: &Scan<'_>| scan.points.len() as f64;
        assert!((points(&scans[0]) / points(&played[0][0]) - 1.0).abs() < 0.02, "{}", points(&scans[0]));
    }
    // KITTI's first camera is taken to be level.
    assert!(apart(&played[2][0].pose, &Pose::from_yaw_pitch(Point3::origin(), 0.0, 0.0)) < 1e-9);
    assert!(
        (played[2][0].pose.0.rotation.angle_to(&Pose::from_yaw_pitch(Point3::origin(), 0.0, 0.0).0.rotation)) < 1e-6
    );
}

#[test]
fn pairs_that_are_none_are_named_counted_and_passed_over() {
    let elk = Elk::new("stereo-bad");
    let recording = euroc(&elk.folder().join("pairs"));
    let file = |side: &str, frame: usize| recording.join(side).join(stamp(frame));
    std::fs::remove_file(file("cam1", 1)).unwrap();
    write(&file("cam1", 2), &Image::from_fn(160, 120, |_, _| 7).unwrap());
    let whole = std::fs::read(file("cam0", 3)).unwrap();
    std::fs::write(file("cam0", 3), &whole[..whole.len() / 2]).unwrap();
    ["cam0", "cam1"].iter().for_each(|side| write(&file(side, 5), &Image::from_fn(320, 240, |_, _| 0).unwrap()));
    write(&file("cam0", 6), &PAIRS[6][1]);
    write(&file("cam1", 6), &PAIRS[6][0]);
    let turned = |row: usize, column: usize| PAIRS[9][1].row(239 - row)[319 - column];
    write(&file("cam1", 9), &Image::from_fn(320, 240, turned).unwrap());
    std::fs::copy(file("cam0", 7), recording.join("cam0/today.png")).unwrap();
    std::fs::copy(file("cam1", 7), recording.join("cam1/today.png")).unwrap();
    spoil(&recording.join("groundtruth.txt"), 10, "1 2 3");
    let counted = [("", "given", "3 scans of 11 frames, 8"), (ODOMETRY, "estimated", "4 scans of 11 frames, 7")];
    for (how, logs, counted) in counted {
        let (code, words) = play(&elk, &mission(&recording, how), logs);
        for expected in [
            format!("{}: there is no {}: both images of a pair have one name", stamp(1), file("cam1", 1).display()),
            format!("is of 320 × 240 pixels and {} of 160 × 120: both images", file("cam1", 2).display()),
            format!("{}: it cannot be read as a PNG", file("cam0", 3).display()),
            format!("{}: of {}", stamp(5), file("cam0", 5).display()),
            "only 0.00 % of all pixels match (too little texture".to_owned(),
            "the other way round in".to_owned(),
            format!("{}: of {}", stamp(9), file("cam0", 9).display()),
            "both as they were taken (not turned, mirrored or inverted)".to_owned(),
            "today.png: its name is no time; nanoseconds, as EuRoC has them, would be right".to_owned(),
            "groundtruth.txt: line 10: 3 numbers: a time, a position and a quaternion, 8, would be right; it is left out"
                .to_owned(),
            format!("{counted} could not be used"),
        ] {
            assert!(words.contains(&expected), "{how}: {expected}: {words}");
        }
        // Only who goes by the recorded poses misses one.
        let missed = format!("{}: groundtruth.txt has no pose within 0.02 s of ", stamp(8));
        assert_eq!(words.contains(&missed) && words.contains("(line 10: 3 numbers: a time"), how.is_empty(), "{words}");
        assert_eq!(code, Some(0), "the others make a map: {words}");
    }
    let summary = summary_of(&elk.run_in("estimated"));
    assert!(summary["position_error_m"].as_f64().unwrap() < 0.02, "{summary:#}");
    let counted = ["frames", "unusable_frames", "lost_frames"].map(|count| summary[count].as_u64());
    assert_eq!(counted, [Some(11), Some(7), Some(0)], "{summary:#}");

    // KITTI's lists have a line for each pair, an empty one among them.
    let numbered = kitti(&elk.folder().join("numbered"));
    spoil(&numbered.join("poses.txt"), 2, "1 0 0 0 0 1 0 0 0 0 2 0");
    spoil(&numbered.join("poses.txt"), 4, "");
    spoil(&numbered.join("times.txt"), 3, "noon");
    for (how, logs, counted) in
        [("", "kitti-given", "2 scans of 5 frames, 3"), (ODOMETRY, "kitti-estimated", "4 scans of 5 frames, 1")]
    {
        let (code, words) = play(&elk, &mission(&numbered, &format!("<Frames> 5 </Frames> {how}")), logs);
        assert_eq!(code, Some(0), "{words}");
        assert!(words.contains("000002.png: times.txt: line 3: \"noon\" is no time"), "{words}");
        for line in ["000001.png: poses.txt: line 2: no pose: columns", "000003.png: poses.txt: line 4: 0 numbers"] {
            assert_eq!(words.contains(line), how.is_empty(), "{line}: {words}");
        }
        assert!(words.contains(&format!("{counted} could not be used")), "{words}");
        let wanted: &[usize] = if how.is_empty() { &[0, 4] } else { &[0, 1, 3, 4] };
        let scans = scans(&elk, logs);
        let off = wanted.iter().zip(&scans).map(|(i, scan)| {
            let way = |first: Isometry3<f64>, here: Isometry3<f64>| (first.inverse() * here).translation.vector;
            (way(place(0).0, place(*i).0) - way(scans[0].pose.0, scan.pose.0)).norm()
        });
        assert!(scans.len() == wanted.len() && off.fold(0.0, f64::max) < 0.02, "each scan has the pose of its pair");
    }
}

/// Writes `to` in place of a line of a list, counted from 1.
fn spoil(list: &Path, line: usize, to: &str) {
    let text = std::fs::read_to_string(list).unwrap();
    let lines = text.lines().enumerate().map(|(i, said)| if i + 1 == line { to } else { said });
    std::fs::write(list, lines.collect::<Vec<_>>().join("\n") + "\n").unwrap();
}

/// The second half is of another room: the odometry looks for what it knows, gives it up after a while, and then nothing tells where
/// that room is.
#[test]
fn a_recording_whose_place_is_lost_for_good_ends_there() {
    let elk = Elk::new("stereo-lost");
    let recording = euroc(&elk.folder().join("pairs"));
    for frame in 4..FRAMES {
        let elsewhere = Pose::from_yaw_pitch(Point3::new(2.2 + 0.03 * frame as f64, 3.2, 1.2), 1.2, 0.0);
        let pair = view(&elsewhere, frame);
        ["cam0", "cam1"]
            .into_iter()
            .zip(&pair)
            .for_each(|(side, image)| write(&recording.join(side).join(stamp(frame)), image));
    }
    let (code, words) = play(&elk, &mission(&recording, &format!("{ODOMETRY} <Patience> 2 </Patience>")), "short");
    let end = format!("{}: lost for good: 2 frames before it were lost", stamp(6));
    assert!(words.contains(&end) && words.contains("the recording ends here"), "{words}");
    assert!(words.contains("the recording is cut short, 4 scans of 7 frames, 3 with the sensor lost"), "{words}");
    assert_ne!(code, Some(0), "what was recorded is not all in the map");
    assert_eq!(summary_of(&elk.run_in("short"))["complete"], false);
    // With more patience it looks on to the end, says nothing of where it is, and the map has what it knew.
    let (code, words) = play(&elk, &mission(&recording, ODOMETRY), "long");
    assert!(words.contains("played to its end, 4 scans of 10 frames, 6 with the sensor lost"), "{words}");
    assert_eq!(code, Some(0));
    assert!(map(&elk, "short") == map(&elk, "long"));
    let mut log = LogReader::open(&elk.run_in("long")).unwrap();
    let estimates = log.by_ref().map(Result::unwrap).filter(|record| record.key == POSE_ESTIMATE.name());
    for (i, record) in estimates.enumerate() {
        let estimate = record.value.as_ref().decode(&POSE_ESTIMATE).unwrap();
        assert_eq!((estimate.pose.is_some(), estimate.lost.is_empty()), (i < 4, i < 4), "{estimate:?}");
    }
}

#[test]
fn recordings_that_are_none_start_nothing_and_say_what_would_be_right() {
    let elk = Elk::new("stereo-none");
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("mission-files/euroc.xml").display().to_string();
    let mut command = elk.command(&["launch", &root, "--headless", "--community", elk.community()]);
    let words = said(&command.env_remove("ELK_DATA").output().unwrap());
    assert!(words.contains("the variable ELK_DATA is not set; right is the folder in it that has"), "{words}");
    let words = said(&command.env("ELK_DATA", "no-such-folder").output().unwrap());
    assert!(
        words.contains("no-such-folder") && words.contains("ELK_DATA or Sensor.Recording has to name it"),
        "{words}"
    );

    let refused = |recording: &Path, expected: &str| {
        let words = elk.launch_and_fail(&mission(recording, ""));
        assert!(words.contains(expected), "{expected}: {words}");
    };
    let empty = elk.folder().join("empty");
    std::fs::create_dir(&empty).unwrap();
    refused(&empty, "neither a cam0 nor an image_0, nor a mav0 with a cam0 in it; right is a folder of cam0 and cam1");
    let pairs = euroc(&elk.folder().join("pairs"));
    let calibrate = |left: &str, right: &str| {
        std::fs::write(pairs.join("cam0.yaml"), left).unwrap();
        std::fs::write(pairs.join("cam1.yaml"), right).unwrap();
    };
    let focal = format!("[{},", camera().focal_px);
    calibrate(&yaml(0.0).replacen(&focal, "[0.0,", 1), &yaml(BASELINE_M));
    refused(&pairs, "/cam0.yaml: line 10: intrinsics is [0.0,");
    refused(&pairs, "positive focal lengths, without which the camera is singular would be right");
    calibrate(&yaml(0.0), &yaml(0.0));
    refused(&pairs, "a baseline of 0 m: the right camera has to be on the right of the left one");
    calibrate(&yaml(BASELINE_M), &yaml(0.0));
    refused(&pairs, "the right camera is -0.120 m right");
    std::fs::remove_file(pairs.join("cam1.yaml")).unwrap();
    refused(&pairs, "cam1.yaml: No such file or directory (os error 2); right is a folder of cam0 and cam1");
    for side in ["cam0", "cam1"] {
        std::fs::remove_dir_all(pairs.join(side)).unwrap();
        std::fs::create_dir(pairs.join(side)).unwrap();
    }
    calibrate(&yaml(0.0), &yaml(BASELINE_M));
    refused(&pairs, "no image of either camera in it; right is a folder of cam0 and cam1");

    let numbered = kitti(&elk.folder().join("numbered"));
    let calibration = std::fs::read_to_string(numbered.join("calib.txt")).unwrap();
    std::fs::write(numbered.join("calib.txt"), calibration.replacen("P1", "P2", 1)).unwrap();
    refused(&numbered, "calib.txt: there is no P1: 12 finite numbers, a projection of 3 rows of 4, would be right");
    let (_, second) = calibration.split_once('\n').unwrap();
    std::fs::write(numbered.join("calib.txt"), "P0: 0 0 1 0 0 1 1 0 0 0 1 0\n".to_owned() + second).unwrap();
    refused(
        &numbered,
        "line 1: P0: focal lengths of 0 and 1 px, with which it is singular: positive ones would be right",
    );
    std::fs::write(numbered.join("calib.txt"), calibration.clone() + &calibration).unwrap();
    refused(&numbered, "calib.txt: line 3: P0: stands there again, after line 1: one of them would be right");
    std::fs::write(numbered.join("calib.txt"), &calibration).unwrap();
    // Time goes forwards, and a pair without one is none.
    std::fs::write(numbered.join("times.txt"), "0\n0.05\n0.02\n0.1\n").unwrap();
    let (_, words) = play(&elk, &mission(&numbered, "<Frames> 5 </Frames>"), "backwards");
    for expected in [
        "000002.png: a time of 0.02 s after one of 0.05 s, as times.txt says: times go forwards",
        "000004.png: times.txt has no line for it",
        "3 scans of 5 frames, 2 could not be used",
    ] {
        assert!(words.contains(expected), "{expected}: {words}");
    }
}
