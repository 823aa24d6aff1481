//! A map's snapshot as the message that it leaves to its successor, and back.

use elk_map::Snapshot;
use elk_map::snapshot::BrickSnapshot;
use elk_spatial::messages::{BrickMemory, MapMemory};

/// The memory of a map, `scan` being the last one in it.
pub fn write(snapshot: Snapshot, scan: u64) -> MapMemory {
    let Snapshot { revision, resolution, bricks } = snapshot;
    let brick = |BrickSnapshot { position, known, ever_hit, log_odds }| BrickMemory {
        // The map's voxels have 16-bit indices, so its bricks have shorter ones.
        brick: position.to_array().map(|c| c as i16),
        known,
        ever_hit,
        log_odds,
    };
    MapMemory { revision, scan, resolution, bricks: bricks.into_iter().map(brick).collect() }
}

/// The map that left this memory, and the last scan in it.
pub fn read(memory: MapMemory) -> (Snapshot, u64) {
    let MapMemory { revision, scan, resolution, bricks } = memory;
    let brick = |BrickMemory { brick, known, ever_hit, log_odds }| BrickSnapshot {
        position: brick.map(i32::from).into(),
        known,
        ever_hit,
        log_odds,
    };
    (Snapshot { revision, resolution, bricks: bricks.into_iter().map(brick).collect() }, scan)
}

#[cfg(test)]
mod tests {
    use elk_map::{MapConfig, OccupancyMap};

    use super::*;

    #[test]
    fn a_memory_is_read_as_it_was_written() {
        let mut map = OccupancyMap::new(MapConfig::default()).unwrap();
        map.insert([-1.0, 0.05, 2.0].into(), [[3.0, -2.0, -2.5].into()]);
        let snapshot = map.snapshot();
        assert!(snapshot.bricks.len() > 3);
        assert_eq!(read(write(snapshot.clone(), 7)), (snapshot, 7));
    }
}
