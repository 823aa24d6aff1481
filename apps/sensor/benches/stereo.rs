//! What a scan of a simulated stereo camera costs, part by part, beside a depth camera of as many pixels:
//! `cargo bench -p elk-sensor --bench stereo`
//!
//! The way of `mission-files/stereo-apartment.xml`: a pair is matched, its points are thinned out by the filter, and the map
//! takes in what is left. Beside it the map takes in all points.
//!
//! CPU time of one thread, median, and least of so many scans (`ELK_TURNS`, 15) from places all over the apartment.

use elk_bus::clock::thread_cpu_secs;
use elk_filter::filters::voxel_grid;
use elk_map::{MapConfig, OccupancyMap};
use elk_sensor::simulated_stereo::{Eyes, Look, Settings, SimulatedStereo};
use elk_sensor::simulator::{self, Simulator};
use elk_sensor::surroundings::{Body, random_start};
use elk_sensor::{AppError, Camera, Capture, DepthSource, Pose};
use elk_stereo::{Matcher, Sad5, Sad5Config, SemiGlobal, SemiGlobalConfig};
use elk_world::{Placement, World};

/// Edge of the filter's cells (m), as in the mission.
const LEAF_M: f64 = 0.05;

fn main() -> Result<(), AppError> {
    let turns = std::env::var("ELK_TURNS").map_or(Ok(15), |said| said.parse::<u64>())?;
    let world = World::load("apartment", &Placement::default())?;
    let places: Vec<Pose> = (1..=turns).map(|seed| random_start(&world, seed)).collect::<Result<_, _>>()?;
    println!("{:44} {:>9} {:>9}", "CPU ms of a scan", "median", "least");
    for (width, height) in [(320, 240), (640, 480)] {
        let camera = Camera::new(width, height, 75_f64.to_radians());
        let body = || Body::new(world.clone(), places[0], 0.05);
        let mut exact = Simulator::new(body(), simulator::Settings { camera, ..simulator::Settings::default() });
        let mut times = Vec::new();
        for (i, &pose) in places.iter().enumerate() {
            timed(&mut times, || exact.scan(&capture(i, pose)))?;
        }
        say(&format!("{width} × {height}, depth camera"), times);
        for name in ["SAD5", "semi-global"] {
            let eyes = Eyes { camera, baseline_m: 0.12, noise: 1.0, seed: 1 };
            let settings = Settings { eyes, look: Look { contrast: 20.0, blank: 0.0, seed: 1 }, range: None };
            let mut stereo = SimulatedStereo::new(body(), settings, matcher(name)?)?;
            let [mut map, mut map_of_all] =
                [OccupancyMap::new(MapConfig::default())?, OccupancyMap::new(MapConfig::default())?];
            let (mut rendering, mut matching, mut filtering) = (Vec::new(), Vec::new(), Vec::new());
            let (mut mapping, mut mapping_all) = (Vec::new(), Vec::new());
            let mut density = 0.0;
            for (i, &pose) in places.iter().enumerate() {
                let pair = timed(&mut rendering, || Ok(stereo.render(&capture(i, pose))?))?;
                let points = timed(&mut matching, || Ok(stereo.matched(&pair)?))?.points;
                density += points.len() as f64 / f64::from(width * height) / turns as f64;
                let kept = timed(&mut filtering, || Ok(voxel_grid(&points, LEAF_M)))?;
                timed(&mut mapping, || {
                    map.insert(pose.position(), kept.iter().map(|point| pose.to_world(point.cast())));
                    Ok(())
                })?;
                timed(&mut mapping_all, || {
                    map_of_all.insert(pose.position(), points.iter().map(|point| pose.to_world(point.cast())));
                    Ok(())
                })?;
            }
            let all: Vec<f64> = (0..matching.len()).map(|i| matching[i] + filtering[i] + mapping[i]).collect();
            let of = |what: &str| format!("{width} × {height} × 64, {name}: {what}");
            say(&of("rendering"), rendering);
            say(&of("pair to scan"), matching);
            say(&of("filter"), filtering);
            say(&of("filtered scan into the map"), mapping);
            say(&of("pair to map"), all);
            say(&of("all points into the map"), mapping_all);
            println!("{:44} {:8.1} %", of("matched"), density * 100.0);
        }
    }
    Ok(())
}

fn capture(index: usize, pose: Pose) -> Capture {
    Capture { scan: index as u64 + 1, time_secs: 0.0, pose }
}

fn matcher(name: &str) -> Result<Box<dyn Matcher + Send>, AppError> {
    Ok(match name {
        "SAD5" => Box::new(Sad5::new(Sad5Config::default())?),
        _ => Box::new(SemiGlobal::new(SemiGlobalConfig::default())?),
    })
}

/// What comes of it; what it takes (CPU s) goes to the `times`.
fn timed<T>(times: &mut Vec<f64>, work: impl FnOnce() -> Result<T, AppError>) -> Result<T, AppError> {
    let before = thread_cpu_secs();
    let done = work()?;
    times.push(thread_cpu_secs() - before);
    Ok(done)
}

fn say(what: &str, mut times: Vec<f64>) {
    times.sort_by(f64::total_cmp);
    println!("{what:44} {:9.2} {:9.2}", times[times.len() / 2] * 1e3, times[0] * 1e3);
}
