//! Two rooms and a door: what is left to look at, whether a robot fits through, and the way it takes.

use elk_geometry::{Clearance, FrontierSet, OccupancyGrid, State, Voxel, VoxelSet, astar};

/// Edge of a voxel (m).
const RESOLUTION: f64 = 0.1;

/// Two rooms of 2 × 2 × 1 m behind each other along x, walls around, and a door of 0.5 m in the wall between. Of the second
/// room's far wall a piece was never seen.
fn rooms() -> OccupancyGrid {
    let mut grid = OccupancyGrid::new(RESOLUTION);
    for voxel in (-1..42).flat_map(|x| (-1..21).flat_map(move |y| (-1..11).map(move |z| Voxel::new(x, y, z)))) {
        let between = voxel.x == 20 && !(8..13).contains(&voxel.y);
        let around = [-1, 41].contains(&voxel.x) || [-1, 20].contains(&voxel.y) || [-1, 10].contains(&voxel.z);
        let unseen = voxel.x == 41 && voxel.y < 4 && voxel.z < 4;
        let state = if unseen {
            State::Unknown
        } else if between || around {
            State::Occupied
        } else {
            State::Free
        };
        grid.set(voxel, state);
    }
    grid
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let grid = rooms();

    // What is left to look at: free voxels beside unknown ones.
    let mut frontier = FrontierSet::new(None);
    frontier.update(&grid, grid.bricks().voxels().map(|(voxel, _)| voxel));
    println!("{} frontier voxels", frontier.len());
    assert_eq!(frontier.len(), 16);

    // From here to there, for robots of several sizes.
    let (here, there) = (Voxel::new(4, 4, 5), Voxel::new(36, 4, 5));
    for radius_m in [0.0, 0.2, 0.3] {
        let clearance = Clearance::new(radius_m, RESOLUTION)?;
        let known = grid.bricks().voxels().map(|(voxel, _)| voxel);
        let passable: VoxelSet = known.filter(|voxel| clearance.allows(&grid, *voxel)).collect();
        let way = astar::shortest(&passable, here, there);
        match &way {
            Some(way) => println!("radius {radius_m} m: a way of {} voxels", way.len()),
            None => println!("radius {radius_m} m: it does not fit through the door"),
        }
        assert_eq!(way.is_some(), radius_m < 0.3);
    }
    Ok(())
}
