//! A generated building is explored to the end.

#[allow(dead_code, reason = "the benchmarks use the rest")]
#[path = "../benches/run/mod.rs"]
mod run;

use elk_explorer::ClosestFrontier;
use elk_geometry::Bounds;
use elk_world::World;
use elk_world::scenery::Building;
use nalgebra::Vector3;
use run::Run;

#[test]
fn a_small_building_is_explored_completely() {
    let building = Building::new(2, 7);
    let world = World::from_triangles("building", building.scenery().triangles()).unwrap();
    let bounds = Bounds::from_mid_dim(building.extents().mid(), building.extents().dim() + Vector3::repeat(1.0));
    let mut run = Run::new(world, building.before(0), bounds, Box::new(ClosestFrontier));
    run.go(500);
    let report = run.explorer.report().expect("it has ended");
    assert!(report.complete, "{report:?}");
    assert_eq!(run.robot.contacts(), Some(0));
    // Air of rooms and corridors, less what furniture hides.
    let air = building.extents().dim().product() * 1e3;
    assert!(run.grid.free() as f64 > 0.6 * air, "{} of {air}", run.grid.free());
}
