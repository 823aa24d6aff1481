//! The slice of the map that a robot on the ground plane explores (thesis 6.5.4): the layer of voxels that it is in.

use elk_geometry::Bounds;
use elk_geometry::voxel::reach_m;
use nalgebra::Point3;

/// What of a volume to explore (`None`: everywhere) lies in a layer of voxels of `resolution` (m), by their index along z.
pub fn slab(volume: Option<Bounds>, layer: i32, resolution: f64) -> Bounds {
    let far = Point3::from([reach_m(resolution); 3]);
    let Bounds { min, max } = volume.unwrap_or(Bounds { min: -far, max: far });
    let [bottom, top] = [layer, layer + 1].map(|index| f64::from(index) * resolution);
    Bounds { min: [min.x, min.y, min.z.max(bottom)].into(), max: [max.x, max.y, max.z.min(top)].into() }
}

#[cfg(test)]
mod tests {
    use elk_geometry::Voxel;

    use super::*;

    #[test]
    fn of_a_volume_a_layer_is_left() {
        let within = |bounds: Bounds, z: i32| bounds.contains(Voxel::new(3, 4, z).center(0.1));
        let all = slab(None, 12, 0.1);
        assert_eq!([11, 12, 13].map(|z| within(all, z)), [false, true, false]);
        let volume = Bounds { min: [0.0; 3].into(), max: [1.0, 1.0, 0.5].into() };
        assert!(within(slab(Some(volume), 2, 0.1), 2) && !within(slab(Some(volume), 2, 0.1), 3));
        assert!(!(0..20).any(|z| within(slab(Some(volume), 9, 0.1), z)), "the robot is above the volume");
    }
}
