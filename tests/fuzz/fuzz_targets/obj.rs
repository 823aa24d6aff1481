//! Any bytes as a world: what loads can be looked into.
#![no_main]

use elk_world::{Placement, World};
use libfuzzer_sys::fuzz_target;
use nalgebra::{Point3, Vector3};

fuzz_target!(|bytes: &[u8]| {
    if let Ok(world) = World::from_bytes("fuzz.obj", bytes, &Placement::default()) {
        let elk_spatial::Bounds { min, max } = world.extents();
        let middle = nalgebra::center(&min, &max);
        for direction in [Vector3::x(), Vector3::new(-0.3, 0.7, 0.2)] {
            let hit = world.cast(middle, direction);
            assert!(hit.is_none_or(|length| length >= 0.0), "{hit:?}");
        }
        let _ = world.is_free(middle);
        let _ = world.touches(middle, Point3::origin(), 0.1);
    }
});
