//! What is done with bytes that are perhaps a map.

use elk_map::{Format, MapConfig, OccupancyMap, Saved};

/// What is a map is made one, of few bricks; and what that is written as is the same map.
pub fn go_on_from(bytes: &[u8]) {
    let Ok(saved) = Saved::read(bytes) else { return };
    let config = MapConfig { resolution: saved.resolution(), max_bricks: 256, ..MapConfig::default() };
    let Ok(map) = OccupancyMap::from_saved(config, &saved) else { return };
    for format in [Format::ElkMap, Format::Ot, Format::Bt] {
        let bytes = format.write(&map);
        let again = OccupancyMap::from_saved(config, &Saved::read(&bytes).unwrap()).unwrap();
        assert_eq!(again.occupancy_tree(), map.occupancy_tree());
        assert_eq!(again.frontier_len(), map.frontier_len());
    }
}
