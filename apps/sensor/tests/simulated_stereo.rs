//! What two simulated cameras see of rooms whose depth is known.

use std::collections::BTreeMap;

use elk_geometry::Pose;
use elk_mission::Kind;
use elk_sensor::simulated_stereo::{Eyes, Look, Settings, SimulatedStereo, TYPE};
use elk_sensor::surroundings::Body;
use elk_sensor::{Camera, Capture, DepthSource, Seen};
use elk_spatial::pixels::{PixelOutcome, PixelTally};
use elk_stereo::{Checks, Matcher, Sad5, Sad5Config, SemiGlobal, SemiGlobalConfig};
use elk_world::World;
use elk_world::scenery::{Scenery, Solid};
use nalgebra::{Point3, Vector3};

/// 5×4×2.5 m, corner at the origin, with a cupboard from (3, 1, 0) to (4, 2, 1.5) in it.
fn room() -> World {
    let mut scenery = Scenery::within(Solid::block("room", [0.0; 3], [5.0, 4.0, 2.5]));
    scenery.block("cupboard", [3.0, 1.0, 0.0], [4.0, 2.0, 1.5]);
    World::from_triangles("room", scenery.triangles_at(Vector3::zeros())).unwrap()
}

fn sad5() -> Box<dyn Matcher + Send> {
    let checks = Checks { texture: 1.5, ..Sad5Config::default().checks };
    Box::new(Sad5::new(Sad5Config { checks, ..Sad5Config::default() }).unwrap())
}

fn semi_global() -> Box<dyn Matcher + Send> {
    let checks = Checks { texture: 1.5, ..SemiGlobalConfig::default().checks };
    Box::new(SemiGlobal::new(SemiGlobalConfig { checks, ..SemiGlobalConfig::default() }).unwrap())
}

fn settings() -> Settings {
    let camera = Camera::new(320, 240, 75_f64.to_radians());
    let eyes = Eyes { camera, baseline_m: 0.12, noise: 1.0, seed: 1 };
    Settings { eyes, look: Look { contrast: 20.0, blank: 0.0, seed: 1 }, range: None }
}

/// It looks past the cupboard into a corner, at slanted walls, floor and ceiling.
fn pose() -> Pose {
    Pose::from_yaw_pitch(Point3::new(0.8, 1.6, 1.3), 0.3, -0.15)
}

fn capture(scan: u64) -> Capture {
    Capture { scan, time_secs: 0.0, pose: pose() }
}

fn camera(settings: Settings, matcher: Box<dyn Matcher + Send>) -> SimulatedStereo {
    SimulatedStereo::new(Body::new(room(), pose(), 0.05), settings, matcher).unwrap()
}

fn scan(settings: Settings, matcher: Box<dyn Matcher + Send>) -> Seen {
    camera(settings, matcher).scan(&capture(1)).unwrap()
}

/// The true distance (m) in a direction of the camera's frame.
fn truth(world: &World, direction: Vector3<f64>) -> f64 {
    world.cast(pose().position(), pose().turn(direction.normalize())).unwrap()
}

/// By how many pixels the disparities of a scan's points are wrong, sorted.
fn errors(settings: &Settings, seen: &Seen) -> Vec<f64> {
    let world = room();
    let scale = settings.eyes.camera.focal_px * settings.eyes.baseline_m;
    let error = |point: Point3<f32>| {
        let point = point.cast::<f64>();
        let depth = truth(&world, point.coords) * point.z / point.coords.norm();
        (scale / point.z - scale / depth).abs()
    };
    let mut errors: Vec<f64> = seen.points.iter().map(error).collect();
    errors.sort_by(f64::total_cmp);
    errors
}

#[test]
fn what_is_matched_is_where_the_world_is() {
    for (name, matcher, density) in [("SAD5", sad5(), 0.55), ("semi-global", semi_global(), 0.7)] {
        let seen = scan(settings(), matcher);
        let errors = errors(&settings(), &seen);
        let at = |share: f64| errors[(share * errors.len() as f64) as usize];
        println!(
            "{name}: {:.1} % matched, off by {:.3} px at the median, {:.3} at 90 %, {:.3} at 98 %",
            errors.len() as f64 / 768.0,
            at(0.5),
            at(0.9),
            at(0.98)
        );
        assert!(errors.len() as f64 > density * 320.0 * 240.0, "{name}: {}", errors.len());
        assert!(at(0.5) < 0.15 && at(0.9) < 0.5 && at(0.98) < 1.5, "{name}: {} {} {}", at(0.5), at(0.9), at(0.98));
        assert_eq!(seen.no_return.len(), 0, "without a range all that is matched is a point");
    }
}

/// Blank walls say nothing: neither that something is there nor that nothing is.
#[test]
fn of_what_cannot_be_matched_nothing_is_known() {
    let blank = Settings { look: Look { blank: 1.0, ..settings().look }, range: Some(2.0), ..settings() };
    for matcher in [sad5(), semi_global()] {
        let seen = scan(blank, matcher);
        // Edges between planes of different grey are all that there is.
        let share = (seen.points.len() + seen.no_return.len()) as f64 / (320.0 * 240.0);
        assert!(share < 0.2, "{share}");
    }
    let one = Settings { look: Look { blank: 0.5, ..settings().look }, ..settings() };
    let (some, all) = (scan(one, sad5()).points.len(), scan(settings(), sad5()).points.len());
    assert!(some < all * 9 / 10, "half of the planes are blank: {some} of {all}");
}

/// Of each pixel, row by row, what became of it.
fn outcomes(seen: &Seen) -> Vec<u8> {
    seen.pixel_runs.iter().flat_map(|run| std::iter::repeat_n(run.outcome, run.pixels.into())).collect()
}

/// Of the walls, floor and ceiling of the room that a camera has much of in view, by axis and side, the share of pixels of this outcome.
fn shares_by_plane(seen: &Seen, outcome: u8) -> BTreeMap<(usize, bool), f64> {
    let (world, camera) = (room(), settings().eyes.camera);
    let mut planes: BTreeMap<(usize, bool), (f64, f64)> = BTreeMap::new();
    for ((u, v), said) in camera.pixels().zip(outcomes(seen)) {
        let direction = pose().turn(camera.direction(u, v));
        let place = pose().position() + direction * world.cast(pose().position(), direction).unwrap();
        let sides = [5.0, 4.0, 2.5].into_iter().enumerate();
        let plane = sides.filter_map(|(axis, far)| {
            let at = [0.0, far].map(|side: f64| (place[axis] - side).abs() < 1e-6);
            (at[0] || at[1]).then_some((axis, at[1]))
        });
        for plane in plane {
            let (these, all) = planes.entry(plane).or_default();
            (*these, *all) = (*these + f64::from(u8::from(said == outcome)), *all + 1.0);
        }
    }
    planes.into_iter().filter(|(_, (_, all))| *all > 5000.0).map(|(plane, (these, all))| (plane, these / all)).collect()
}

/// A scan knows which pixels saw nothing because nothing could be matched: those of plain walls, and not of others.
#[test]
fn pixels_of_plain_walls_say_that_there_is_too_little_texture() {
    const TEXTURELESS: u8 = PixelOutcome::Textureless as u8;
    for matcher in [sad5, semi_global] {
        let textured = scan(settings(), matcher());
        assert_eq!(outcomes(&textured).len(), 320 * 240);
        let matched = outcomes(&textured).iter().filter(|outcome| **outcome == PixelOutcome::Matched as u8).count();
        assert_eq!(matched, textured.points.len(), "without a range all that is matched is a point");
        let shares = shares_by_plane(&textured, TEXTURELESS);
        // Of what is seen at a slant the texture is too fine for pixels.
        assert!(shares.len() >= 3 && shares.values().all(|share| *share < 0.4), "{shares:?}");
        let half = Settings { look: Look { blank: 0.5, ..settings().look }, ..settings() };
        let shares = shares_by_plane(&scan(half, matcher()), TEXTURELESS);
        let plain = shares.values().filter(|share| **share > 0.8).count();
        let others = shares.values().filter(|share| **share < 0.4).count();
        assert!(plain > 0 && others > 0 && plain + others == shares.len(), "{shares:?}");
        let all = Settings { look: Look { blank: 1.0, ..settings().look }, ..settings() };
        let shares = shares_by_plane(&scan(all, matcher()), TEXTURELESS);
        assert!(shares.values().all(|share| *share > 0.8), "{shares:?}");
    }
}

/// Behind the cupboard's edge the right camera does not see what the left one does, and on the left border neither.
#[test]
fn other_pixels_say_why_they_were_not_matched_as_well() {
    let seen = scan(settings(), sad5());
    let tally = PixelTally::of(&seen.pixel_runs);
    assert_eq!(tally.total(), 320 * 240);
    assert!(tally.out_of_range > 100 && tally.inconsistent > 100, "{tally:?}");
    let [runs, rest] = [3 * seen.pixel_runs.len(), 12 * (seen.points.len() + seen.no_return.len())];
    println!("{runs} bytes of pixel runs beside {rest} of points and directions; {tally}");
    assert!(runs * 20 < rest, "{runs} {rest}");
    let left: Vec<u8> = outcomes(&seen).chunks_exact(320).map(|row| row[0]).collect();
    assert!(left.iter().all(|outcome| *outcome == PixelOutcome::OutOfRange as u8), "{left:?}");
}

#[test]
fn a_direction_without_a_return_was_seen_to_be_free_as_far_as_the_range() {
    let limited = Settings { range: Some(2.5), ..settings() };
    let (seen, all) = (scan(limited, sad5()), scan(settings(), sad5()));
    assert_eq!(seen.points.len() + seen.no_return.len(), all.points.len(), "unmatched pixels are in neither list");
    assert!(seen.points.len() > 5000 && seen.no_return.len() > 5000, "{} {}", seen.points.len(), seen.no_return.len());
    assert!(seen.points.iter().all(|point| point.coords.norm() <= 2.5 + 1e-6));
    let world = room();
    let nearer = seen.no_return.iter().filter(|way| truth(&world, way.coords.cast()) < 2.3).count();
    assert!(nearer * 50 < seen.no_return.len(), "{nearer} of {}", seen.no_return.len());
    assert_eq!(camera(limited, sad5()).camera().range_m, 2.5);
}

#[test]
fn a_scan_depends_on_its_number_its_pose_and_the_seed_alone() {
    let mut one = camera(settings(), sad5());
    let first = one.scan(&capture(1)).unwrap();
    let second = one.scan(&capture(2)).unwrap();
    assert_ne!(first, second, "noise is of the scan");
    assert_eq!(camera(settings(), sad5()).scan(&capture(2)).unwrap(), second, "and not of its history");
    let other = Settings { eyes: Eyes { seed: 2, ..settings().eyes }, ..settings() };
    assert_ne!(scan(other, sad5()), first);
}

#[test]
fn the_right_camera_is_on_the_right() {
    let noiseless = Settings { eyes: Eyes { noise: 0.0, ..settings().eyes }, ..settings() };
    let [left, right] = camera(noiseless, sad5()).render(&capture(1)).unwrap();
    // A pixel of the left image, and where its point is seen in the right one.
    let camera = noiseless.eyes.camera;
    let (row, column) = (100, 200);
    let depth = room().cast(pose().position(), pose().turn(camera.direction(200.5, 100.5))).unwrap();
    let shift = camera.focal_px * 0.12 / depth;
    let at = column as f64 - shift;
    let (before, share) = (at.floor() as usize, at.fract());
    let [a, b] = [right.row(row)[before], right.row(row)[before + 1]].map(f64::from);
    let there = a + (b - a) * share;
    assert!((there - f64::from(left.row(row)[column])).abs() < 12.0, "{there} {}", left.row(row)[column]);
    assert_ne!(left, right);
}

#[test]
fn a_camera_of_no_pixel_has_no_pair() {
    let rowless = Camera { height: 0, ..settings().eyes.camera };
    let settings = Settings { eyes: Eyes { camera: rowless, ..settings().eyes }, ..settings() };
    let error = camera(settings, sad5()).render(&capture(1)).unwrap_err();
    assert_eq!(error.to_string(), "an image of 320 × 0 pixels: each side has to be of 1 to 16384");
}

/// What is said of parameters with which nothing can be seen.
#[test]
fn what_cannot_be_a_stereo_camera_is_refused_with_what_would_be_right() {
    let said = |sets: &[(&str, &str)]| {
        let sets: Vec<(String, String)> = sets.iter().map(|(name, text)| ((*name).into(), (*text).into())).collect();
        let params = TYPE.check(&sets, std::path::Path::new("")).map_err(|error| error.to_string())?;
        (TYPE.build)(&params).map(|_| ()).map_err(|error| error.to_string())
    };
    assert_eq!(said(&[]), Ok(()));
    let refused = |sets: &[(&str, &str)], words: &str| {
        let error = said(sets).unwrap_err();
        assert!(error.contains(words), "{sets:?}: {error}");
    };
    refused(&[("Baseline", "0")], "0.001");
    refused(&[("Baseline", "-0.12")], "0.001");
    refused(
        &[("Disparities", "20")],
        "Disparities: 20 levels of disparity: a multiple of 16 from 16 to 256 would be right",
    );
    refused(&[("Disparities", "512")], "256");
    refused(&[("Width", "64")], "Width is 64 and Disparities 64");
    refused(&[("Width", "8")], "16");
    refused(&[("Width", "10000"), ("Height", "10000")], "Width times Height is 100000000");
    refused(&[("Matcher", "SAD")], "SAD5");
    refused(&[("Start", "100; 0; 0")], "Start");
    assert!(TYPE.params.iter().all(|one| matches!(one.kind, Kind::File { .. }) || !one.doc.is_empty()));
}
