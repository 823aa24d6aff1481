//! What a reader's copy of the map is told and does not believe.

use elk_geometry::{OccupancyGrid, State, Voxel};
use elk_spatial::Replica;
use elk_spatial::checks::MAX_REVISIONS_AHEAD;
use elk_spatial::keyframe::MapPart;
use elk_spatial::map::{MapUpdate, UpdateError};

/// A map that grows by a voxel a scan: the update, and the whole map after it.
fn publisher(resolution: f64) -> impl FnMut() -> (MapUpdate, MapUpdate) {
    let mut map = OccupancyGrid::new(resolution);
    move || {
        let voxel = Voxel::new(map.revision() as i32, 0, 0);
        map.set(voxel, State::Free);
        (MapUpdate::new(map.advance(&[voxel]), 0), MapUpdate::new(map.whole(), 0))
    }
}

/// A whole map is believed that was asked for; until then it is held against what is known, and so are its parts.
#[test]
fn a_whole_map_from_far_ahead_that_nobody_asked_for_is_not_taken() {
    let far = 1 + MAX_REVISIONS_AHEAD + 1;
    let known = || {
        let (mut replica, mut publish) = (Replica::new(None, 9), publisher(0.2));
        let (update, whole) = publish();
        replica.take(&update).unwrap();
        (replica, whole)
    };
    let refused = Err(UpdateError::Ahead { have: 1, update: far });
    let (mut replica, whole) = known();
    assert_eq!(replica.take(&MapUpdate { revision: far, ..whole.clone() }), refused);
    assert!(replica.is_doubtful() && replica.take_question());
    let (mut replica, whole) = known();
    let part = MapPart::of(replica.grid(), 0, 0, 9);
    assert_eq!(replica.take_part(&MapPart { revision: far, ..part }), refused);
    assert!(replica.is_doubtful() && replica.take_question());
    assert!(matches!(replica.take(&whole), Ok(Some(_))) && !replica.is_doubtful());
}

/// What a part says of the whole is held against what was agreed before anything of it is kept.
#[test]
fn a_part_of_a_map_of_too_many_bricks_is_refused_and_what_comes_in_parts_grows_no_further() {
    let mut map = OccupancyGrid::new(0.2);
    let mut grow = |bricks: std::ops::Range<i32>| {
        let voxels: Vec<Voxel> = bricks.map(|x| Voxel::new(8 * x, 0, 0)).collect();
        voxels.iter().for_each(|voxel| assert!(map.set(*voxel, State::Free)));
        let update = MapUpdate::new(map.advance(&voxels), 0);
        (update, MapPart::of(&map, 0, 0, 1))
    };
    let _lost = grow(0..1);
    let (gap, part) = grow(1..2);
    let mut replica = Replica::new(None, 2);
    assert_eq!((replica.take(&gap), replica.take_question()), (Ok(None), true));
    let too_many = Err(UpdateError::TooMany { bricks: 3, most: 2 });
    assert_eq!(replica.take_part(&MapPart { total: 3, ..part.clone() }), too_many);
    assert_eq!(replica.take_part(&part), Ok(None));
    // The map grows meanwhile beyond what was agreed: what has come of it is of no use.
    assert_eq!((replica.take(&grow(2..4).0), replica.take_question()), (Ok(None), true));
}
