//! Two cameras in a rendered room, whose way is known.

#[path = "scenes/mod.rs"]
mod scenes;

use elk_geometry::Pose;
use elk_odometry::{Estimate, Lost, Odometry, OdometryConfig, PairError, SetupError, Tracked};
use elk_registration::Pose as _;
use elk_stereo::{Image, Rectification, Rig};
use nalgebra::{Isometry3, Vector3};
use scenes::{Cameras, blank};

const SIZE: [usize; 2] = [320, 240];

fn rig(cameras: &Cameras) -> Rig {
    *Rectification::new(&cameras.calibration).unwrap().rig()
}

/// Where the cameras begin.
fn start() -> Isometry3<f64> {
    Isometry3::new(Vector3::new(0.1, 0.0, -0.5), Vector3::new(0.0, 0.1, 0.0))
}

fn odometry(cameras: &Cameras, config: OdometryConfig) -> Odometry {
    Odometry::new(rig(cameras), SIZE, config, Pose(start())).unwrap()
}

/// A pose some steps on the way: so many metres and radians in each, along and about the axes of the cameras.
fn after(steps: usize, way: [f64; 3], turn: [f64; 3]) -> Isometry3<f64> {
    (0..steps).fold(start(), |pose, _| pose * Isometry3::new(way.into(), turn.into()))
}

fn found(tracked: Tracked) -> Estimate {
    match tracked {
        Tracked::Found(estimate) => *estimate,
        other => panic!("{other:?}"),
    }
}

/// By how much a pose is off: metres and radians.
fn off(pose: &Pose, truth: &Isometry3<f64>) -> [f64; 2] {
    let step = truth.step_to(&pose.0);
    [step.fixed_rows::<3>(0).norm(), step.fixed_rows::<3>(3).norm()]
}

/// The worst that poses are off on a way of equal steps, metres and radians.
fn worst(cameras: &Cameras, steps: usize, way: [f64; 3], turn: [f64; 3]) -> [f64; 2] {
    let mut odometry = odometry(cameras, OdometryConfig::default());
    let mut worst = [0.0f64; 2];
    for step in 0..steps {
        let truth = after(step, way, turn);
        let [left, right] = cameras.view(&truth, step as u64);
        let tracked = odometry.track(&left, &right).unwrap();
        if step == 0 {
            assert_eq!(tracked, Tracked::Started);
            continue;
        }
        let [metres, radians] = off(&found(tracked).pose, &truth);
        worst = [worst[0].max(metres), worst[1].max(radians)];
    }
    worst
}

#[test]
fn known_ways_are_followed() {
    let cameras = Cameras::small();
    for (way, turn) in [
        ([0.05, 0.0, 0.0], [0.0; 3]),
        ([0.0, 0.0, 0.06], [0.0; 3]),
        ([0.0, -0.02, -0.04], [0.0, 0.0, 0.02]),
        ([0.03, 0.0, 0.03], [0.004, -0.025, 0.01]),
    ] {
        let [metres, radians] = worst(&cameras, 16, way, turn);
        let gone = 15.0 * Vector3::from(way).norm();
        assert!(metres < 0.01 * gone && radians < 0.005, "{way:?}, {turn:?}: {metres} m of {gone} m, {radians}");
    }
}

#[test]
fn turning_on_the_spot_goes_nowhere() {
    let cameras = Cameras::small();
    for turn in [[0.0, 0.04, 0.0], [0.0, -0.12, 0.0], [0.03, 0.0, 0.0], [0.0, 0.0, 0.08]] {
        let steps = if turn[0] > 0.0 { 10 } else { 16 };
        let [metres, radians] = worst(&cameras, steps, [0.0; 3], turn);
        assert!(metres < 0.012 && radians < 0.008, "{turn:?}: {metres} m, {radians}");
    }
}

#[test]
fn standing_still_is_no_way_and_makes_no_keyframe() {
    let cameras = Cameras::small();
    let mut odometry = odometry(&cameras, OdometryConfig::default());
    for step in 0..15 {
        let [left, right] = cameras.view(&start(), step);
        let tracked = odometry.track(&left, &right).unwrap();
        if step > 0 {
            let estimate = found(tracked);
            let [metres, radians] = off(&estimate.pose, &start());
            assert!(metres < 1e-3 && radians < 5e-4, "{metres} m, {radians}");
            assert!(!estimate.health.is_keyframe && estimate.health.rms < 0.3, "{:?}", estimate.health);
        }
    }
}

/// Errors divided by the covariance have 6 degrees of freedom; of the first pairs after the start, in which the map has drifted nowhere.
#[test]
fn the_covariance_is_about_as_large_as_errors_are() {
    let cameras = Cameras::small();
    let mut sum = 0.0;
    let count = 24;
    for seed in 0..count {
        let mut odometry = odometry(&cameras, OdometryConfig::default());
        let truth = after(1, [0.02, 0.01, 0.01], [0.01, -0.01, 0.01]);
        for (step, pose) in [start(), truth].iter().enumerate() {
            let [left, right] = cameras.view(pose, 100 * seed + step as u64);
            let tracked = odometry.track(&left, &right).unwrap();
            if step == 1 {
                let estimate = found(tracked);
                let off = estimate.pose.0.step_to(&truth);
                sum += off.dot(&estimate.covariance.cholesky().unwrap().solve(&off));
            }
        }
    }
    // Points of the map err as those that are found do, so that more than 6 is right.
    let mean = sum / count as f64;
    assert!((2.0..30.0).contains(&mean), "{mean}");
}

#[test]
fn blank_pairs_are_lost_and_what_comes_after_is_found_again() {
    let cameras = Cameras::small();
    let mut odometry = odometry(&cameras, OdometryConfig::default());
    let (way, turn) = ([0.03, 0.0, 0.02], [0.0, 0.01, 0.0]);
    for step in 0..14 {
        let truth = after(step, way, turn);
        // Meanwhile the cameras go on.
        let is_blank = (6..10).contains(&step);
        let [left, right] = if is_blank { blank(SIZE) } else { cameras.view(&truth, step as u64) };
        let before = odometry.supposed();
        let tracked = odometry.track(&left, &right).unwrap();
        match (step, is_blank) {
            (0, _) => assert_eq!(tracked, Tracked::Started),
            (_, true) => {
                assert!(matches!(tracked, Tracked::Lost(Lost::Unseen { matched: 0, .. })), "{tracked:?}");
                assert_eq!(odometry.supposed(), before, "no pose is said as if nothing had happened");
            }
            (_, false) => {
                let [metres, radians] = off(&found(tracked).pose, &truth);
                assert!(metres < 0.01 && radians < 0.005, "step {step}: {metres} m, {radians}");
            }
        }
    }
}

#[test]
fn who_was_turned_away_is_found_where_it_was_before() {
    let cameras = Cameras::small();
    let mut odometry = odometry(&cameras, OdometryConfig::default());
    let behind = start() * Isometry3::rotation(Vector3::new(0.0, 3.0, 0.0));
    let near = start() * Isometry3::new(Vector3::new(0.05, -0.03, 0.04), Vector3::new(0.05, 0.2, -0.06));
    for (step, pose) in [start(), behind, behind, near].iter().enumerate() {
        let [left, right] = cameras.view(pose, step as u64);
        let tracked = odometry.track(&left, &right).unwrap();
        match step {
            0 => assert_eq!(tracked, Tracked::Started),
            1 | 2 => assert!(matches!(tracked, Tracked::Lost(_)), "{tracked:?}"),
            _ => {
                let [metres, radians] = off(&found(tracked).pose, &near);
                assert!(metres < 0.02 && radians < 0.01, "{metres} m, {radians}");
            }
        }
    }
}

/// Once around on the spot, on which the first keyframes leave the window, and then the first view again.
#[test]
fn with_a_memory_what_was_seen_long_ago_is_taken_up_again() {
    let cameras = Cameras::small();
    let (turn, steps) = ([0.0, 0.12, 0.0], 53);
    let around = |memory: usize| {
        let mut odometry = odometry(&cameras, OdometryConfig { memory, window: 4, ..OdometryConfig::for_images(SIZE) });
        let mut last = 0.0;
        for step in 0..steps {
            let truth = after(step, [0.0; 3], turn);
            let [left, right] = cameras.view(&truth, step as u64);
            if let Tracked::Found(estimate) = odometry.track(&left, &right).unwrap() {
                last = off(&estimate.pose, &truth)[1];
            }
        }
        // Nobody knows where it goes meanwhile.
        let [dark, darker] = blank(SIZE);
        assert!(matches!(odometry.track(&dark, &darker), Ok(Tracked::Lost(_))));
        let half = after(steps / 2, [0.0; 3], turn);
        let [left, right] = cameras.view(&half, 99);
        (last, odometry.track(&left, &right).unwrap(), half)
    };
    let (drifted, lost, _) = around(0);
    assert!(matches!(lost, Tracked::Lost(Lost::Unseen { .. })), "{lost:?}");
    let (closed, again, half) = around(100);
    assert!(closed < 0.5 * drifted, "{closed} rad off where it began, without a memory {drifted}");
    let [metres, radians] = off(&found(again).pose, &half);
    assert!(metres < 0.01 && radians < 0.01, "{metres} m, {radians}");
}

#[test]
fn small_images_have_as_many_cells_as_large_ones() {
    let cell = |size| OdometryConfig::for_images(size).cell;
    assert_eq!([cell([752, 480]), cell([320, 240]), cell([64, 64])], [32, 15, 8]);
}

#[test]
fn after_so_many_lost_pairs_the_map_begins_anew() {
    let cameras = Cameras::small();
    let mut odometry = odometry(&cameras, OdometryConfig { patience: Some(3), ..OdometryConfig::default() });
    let behind = start() * Isometry3::rotation(Vector3::new(0.0, 3.0, 0.0));
    let step = Isometry3::new(Vector3::new(0.0, 0.0, 0.03), Vector3::zeros());
    let said: Vec<Tracked> = [start(), behind, behind, behind, behind, behind * step]
        .iter()
        .enumerate()
        .map(|(i, pose)| {
            let [left, right] = cameras.view(pose, i as u64);
            odometry.track(&left, &right).unwrap()
        })
        .collect();
    assert!(said[1..4].iter().all(|tracked| matches!(tracked, Tracked::Lost(_))), "{said:?}");
    assert_eq!([&said[0], &said[4]], [&Tracked::Started; 2]);
    let [metres, _] = off(&found(said[5].clone()).pose, &(start() * step));
    assert!(metres < 0.005, "from where it was supposed to be: {metres} m");
}

#[test]
fn a_map_is_not_given_up_for_nothing() {
    let cameras = Cameras::small();
    let mut odometry = odometry(&cameras, OdometryConfig { patience: Some(2), ..OdometryConfig::default() });
    let [left, right] = cameras.view(&start(), 0);
    assert_eq!(odometry.track(&left, &right), Ok(Tracked::Started));
    let [dark, darker] = blank(SIZE);
    for _ in 0..5 {
        assert!(matches!(odometry.track(&dark, &darker), Ok(Tracked::Lost(Lost::Unseen { .. }))));
    }
    // By now a map would begin anew, with cameras that are swapped none.
    let before = format!("{odometry:?}");
    let behind = cameras.view(&(start() * Isometry3::rotation(Vector3::new(0.0, 3.0, 0.0))), 1);
    assert!(matches!(odometry.track(&behind[1], &behind[0]), Err(PairError::Swapped { .. })));
    assert!(before == format!("{odometry:?}"), "it is as if there had been none");
    let [left, right] = cameras.view(&start(), 2);
    assert!(off(&found(odometry.track(&left, &right).unwrap()).pose, &start())[0] < 1e-3);
}

#[test]
fn what_is_fixed_to_the_cameras_is_not_the_world() {
    let cameras = Cameras::small();
    let mut odometry = odometry(&cameras, OdometryConfig::default());
    let first = cameras.view(&start(), 99);
    // A third of both images shows the same all the time, as it does of a robot that sees itself.
    let with = |image: &Image, fixed: &Image| {
        let part = |row: usize, column: usize| if row >= 160 { fixed.row(row)[column] } else { image.row(row)[column] };
        Image::from_fn(SIZE[0], SIZE[1], part).unwrap()
    };
    for step in 0..12 {
        let truth = after(step, [0.03, 0.0, 0.03], [0.0, -0.01, 0.0]);
        let seen = cameras.view(&truth, step as u64);
        let [left, right] = [0, 1].map(|side| with(&seen[side], &first[side]));
        let tracked = odometry.track(&left, &right).unwrap();
        if step > 0 {
            let [metres, radians] = off(&found(tracked).pose, &truth);
            assert!(metres < 0.01 && radians < 0.006, "step {step}: {metres} m, {radians}");
        }
    }
}

#[test]
fn a_map_does_not_begin_with_what_shows_nothing_or_is_swapped() {
    let cameras = Cameras::small();
    let mut odometry = odometry(&cameras, OdometryConfig::default());
    let [left, right] = blank(SIZE);
    let least = OdometryConfig::default().inliers;
    assert_eq!(odometry.track(&left, &right), Ok(Tracked::Lost(Lost::Featureless { points: 0, least })));
    let [left, right] = cameras.view(&start(), 0);
    let error = odometry.track(&right, &left).unwrap_err();
    assert!(matches!(error, PairError::Swapped { swapped, .. } if swapped > 30), "{error}");
    assert!(error.to_string().ends_with("are the cameras swapped?"), "{error}");
    assert_eq!(odometry.track(&left, &right), Ok(Tracked::Started));
    let on_the_way = odometry.track(&right, &left).unwrap();
    assert!(matches!(on_the_way, Tracked::Lost(Lost::OneSided { .. })), "{on_the_way:?}");
    let [left, _] = cameras.view(&start(), 1);
    let half = odometry.track(&left, &blank(SIZE)[1]).unwrap();
    assert!(matches!(half, Tracked::Lost(Lost::OneSided { both: 0, .. })), "{half:?}");
}

#[test]
fn images_of_another_size_are_refused_and_change_nothing() {
    let cameras = Cameras::small();
    let [mut one, mut other] = [0, 1].map(|_| odometry(&cameras, OdometryConfig::default()));
    let small = blank([300, 240]);
    for step in 0..6 {
        let [left, right] = cameras.view(&after(step, [0.02, 0.0, 0.04], [0.0, 0.02, 0.0]), step as u64);
        let error = one.track(&left, &small[1]).unwrap_err();
        assert_eq!(
            error.to_string(),
            "a right image of [300, 240] pixels: [320, 240], as the odometry was set up for, would be right"
        );
        assert!(matches!(one.track(&small[0], &right), Err(PairError::Size { side: "left", .. })));
        assert_eq!(one.track(&left, &right), other.track(&left, &right));
    }
}

/// Twice the same, bit for bit; with random numbers of another seed it is nearly that.
#[test]
fn the_same_pairs_give_the_same_poses() {
    let cameras = Cameras::small();
    let pairs: Vec<_> = (0..14)
        .map(|step| match step {
            5 => blank(SIZE),
            _ => cameras.view(&after(step, [0.03, 0.01, 0.05], [0.01, 0.02, 0.0]), step as u64),
        })
        .collect();
    let run = |seed: u64| {
        let mut odometry = odometry(&cameras, OdometryConfig { seed, ..OdometryConfig::default() });
        pairs.iter().map(|[left, right]| odometry.track(left, right).unwrap()).collect::<Vec<_>>()
    };
    let (first, again) = (run(1), run(1));
    assert_eq!(format!("{first:?}"), format!("{again:?}"));
    assert_eq!(first, again);
    let [a, b] = [&first, &run(2)].map(|run| found(run[13].clone()).pose);
    assert!(off(&a, &b.0)[0] < 5e-3);
}

#[test]
fn the_start_is_where_all_poses_are_from() {
    let cameras = Cameras::small();
    let elsewhere = Pose(Isometry3::new(Vector3::new(50.0, -20.0, 3.0), Vector3::new(1.0, 2.0, -0.5)));
    let mut odometry = Odometry::new(rig(&cameras), SIZE, OdometryConfig::default(), elsewhere).unwrap();
    let mut last = elsewhere;
    for step in 0..6 {
        let [left, right] = cameras.view(&after(step, [0.04, 0.0, 0.0], [0.0, 0.02, 0.0]), step as u64);
        if let Tracked::Found(estimate) = odometry.track(&left, &right).unwrap() {
            last = estimate.pose;
        }
    }
    let motion = start().inverse() * after(5, [0.04, 0.0, 0.0], [0.0, 0.02, 0.0]);
    assert!(off(&last, &(elsewhere.0 * motion))[0] < 0.005);
}

#[test]
fn what_cannot_be_set_up_is_said() {
    let cameras = Cameras::small();
    let set_up = |size, config, start| Odometry::new(rig(&cameras), size, config, Pose(start)).map(|_| ());
    let good = OdometryConfig::default;
    let said = |result: Result<(), SetupError>| result.unwrap_err().to_string();
    assert_eq!(set_up(SIZE, good(), start()), Ok(()));
    assert_eq!(
        said(set_up([320, 60], good(), start())),
        "images of 320 × 60 pixels: each side has to be of 64 at least"
    );
    let far = Isometry3::translation(0.0, 1e9, 0.0);
    assert!(said(set_up(SIZE, good(), far)).starts_with("a pose at [0.0, 1000000000.0, 0.0]"));
    let config = OdometryConfig { similarity: f64::NAN, ..good() };
    assert_eq!(said(set_up(SIZE, config, start())), "similarity of NaN: 0.1 to 1 would be right");
    assert!(said(set_up(SIZE, OdometryConfig { window: 1, ..good() }, start())).starts_with("window of 1"));
    assert!(said(set_up(SIZE, OdometryConfig { cell: 0, ..good() }, start())).starts_with("cell of 0"));
    let config = OdometryConfig { memory: 10_000_000, ..good() };
    assert!(said(set_up(SIZE, config, start())).starts_with("memory of 10000000"));
}

#[test]
fn a_pose_that_is_not_known_well_enough_is_none() {
    let cameras = Cameras::small();
    let mut odometry = odometry(&cameras, OdometryConfig { deviation: 1e-5, ..OdometryConfig::default() });
    for step in 0..2 {
        let [left, right] = cameras.view(&start(), step);
        let tracked = odometry.track(&left, &right).unwrap();
        if step > 0 {
            assert!(
                matches!(tracked, Tracked::Lost(Lost::Vague { deviation, limit: 1e-5 }) if deviation > 1e-5),
                "{tracked:?}"
            );
        }
    }
}
