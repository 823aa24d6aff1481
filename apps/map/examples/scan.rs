//! A depth camera in the middle of a room turns around once: what it makes of the room, and the file that OctoMap's own tools
//! open.

use elk_map::octomap::bt::{read_bt, write_bt};
use elk_map::{MapConfig, OccupancyMap, Snapshot};
use nalgebra::{Point3, Vector3};

/// Half the edges of the room, from its middle (m).
const HALF: Vector3<f64> = Vector3::new(2.0, 1.5, 1.2);

/// Where a ray from the middle of the room ends: on the first wall.
fn wall(direction: Vector3<f64>) -> Point3<f64> {
    let range = (0..3).map(|axis| HALF[axis] / direction[axis].abs()).fold(f64::INFINITY, f64::min);
    Point3::from(direction * range)
}

/// What a camera of 60 × 60 pixels and 90° sees that looks along `yaw` (rad).
fn scan(yaw: f64) -> impl Iterator<Item = Point3<f64>> {
    let pixel = |i: i32| (f64::from(i) - 29.5) / 30.0;
    let ray = move |right: f64, down: f64| {
        Vector3::new(yaw.cos() + right * yaw.sin(), yaw.sin() - right * yaw.cos(), -down).normalize()
    };
    (0..3600).map(move |i| wall(ray(pixel(i % 60), pixel(i / 60))))
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let config = MapConfig { resolution: 0.1, max_range: 10.0, ..MapConfig::default() };
    let mut map = OccupancyMap::new(config)?;
    for quarter in 0..4 {
        let seen = map.insert(Point3::origin(), scan(f64::from(quarter) * std::f64::consts::FRAC_PI_2));
        println!("scan {quarter}: {} voxels changed", seen.changed.len());
    }
    let (free, occupied) = (map.grid().free(), map.grid().occupied());
    println!("{free} voxels free, {occupied} occupied, {} at the frontier", map.frontier_len());
    assert!(free > 20_000 && occupied > 1_000 && map.frontier_len() > 0, "it never looked straight up or down");

    // For OctoMap's tools: occupied, free or unknown. `write_ot` keeps the log-odds.
    let mut file = Vec::new();
    write_bt(&mut file, &map.occupancy_tree(), config.resolution)?;
    println!("{} bytes as a .bt file", file.len());
    assert!(read_bt(&file)?.cubes().eq(map.occupancy_tree().cubes()));

    // All of it, to go on with later.
    let snapshot: Snapshot = map.snapshot();
    let again = OccupancyMap::restore(config, &snapshot)?;
    assert_eq!(again.frontier_len(), map.frontier_len());
    Ok(())
}
