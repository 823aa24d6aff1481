//! What is done with bytes that are perhaps a world.

use elk_world::{Placement, World};
use nalgebra::{Point3, Vector3};

/// What loads can be looked into. The name's ending counts where the bytes do not tell the format.
pub fn look_into(name: &str, bytes: &[u8]) {
    let Ok(world) = World::from_bytes(name, bytes, &Placement::default()) else { return };
    let elk_geometry::Bounds { min, max } = world.extents();
    let middle = nalgebra::center(&min, &max);
    for direction in [Vector3::x(), Vector3::new(-0.3, 0.7, 0.2)] {
        let hit = world.cast(middle, direction);
        assert!(hit.is_none_or(|length| length >= 0.0), "{hit:?}");
    }
    let _ = world.is_free(middle);
    let _ = world.touches(middle, Point3::origin(), 0.1);
}
