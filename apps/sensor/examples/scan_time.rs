//! CPU time of a 100×100 scan in each world: `cargo run --release -p elk-sensor --example scan_time`

use elk_bus::clock::thread_cpu_secs;
use elk_sensor::simulator::{Settings, Simulator};
use elk_sensor::surroundings::{Body, random_start};
use elk_sensor::{Capture, DepthSource};
use elk_world::World;
use elk_world::scenery::SITES;

const SCANS: u64 = 100;

fn main() -> Result<(), elk_sensor::AppError> {
    for site in &SITES {
        let before = thread_cpu_secs();
        let world = World::from_triangles(site.name, (site.build)().triangles())?;
        let built = thread_cpu_secs() - before;
        let mut scanning = 0.0;
        let mut points = 0;
        for seed in 0..SCANS {
            let pose = random_start(&world, seed)?;
            let mut simulator = Simulator::new(Body::new(world.clone(), pose, 0.05), Settings::default());
            let before = thread_cpu_secs();
            points += simulator.scan(&Capture { scan: 1, time_secs: 0.0, pose })?.points.len();
            scanning += thread_cpu_secs() - before;
        }
        println!(
            "{:10} {:5} triangles: built in {:.2} ms, {:.2} ms a scan, {} of {} rays hit",
            site.name,
            world.surfaces().triangles().len(),
            built * 1e3,
            scanning * 1e3 / SCANS as f64,
            points,
            SCANS * 10_000,
        );
    }
    Ok(())
}
