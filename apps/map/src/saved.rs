//! A map in a file, of whichever kind it is: `.elkmap`, OctoMap's `.ot` or `.bt`.

use std::path::Path;

use elk_geometry::Voxel;
use elk_geometry::bricks::{BRICK, brick_of, cell_of};

use crate::elkmap::{self, ElkMapError};
use crate::occupancy::{MapConfig, OccupancyMap};
use crate::octomap::bt::{self, read_bt, write_bt};
use crate::octomap::graph::is_graph;
use crate::octomap::ot::{self, read_ot, write_ot};
use crate::octomap::{TreeFile, TreeFileError};
use crate::octree::Cube;
use crate::snapshot::{RestoreError, Snapshot};

/// The kinds of files that a map is written to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// `.elkmap`: all that a map knows.
    ElkMap,
    /// `.ot`: log-odds.
    Ot,
    /// `.bt`: occupied, free or unknown.
    Bt,
}

/// A map that was read from the bytes of a file. OctoMap's take no memory besides these, an `.elkmap` no more than half again as
/// much.
#[derive(Debug, Clone, PartialEq)]
pub enum Saved<'a> {
    /// All that the map knew.
    Snapshot(Snapshot),
    /// Log-odds.
    LogOdds(TreeFile<'a, f32>),
    /// Occupied (`true`) and free cubes.
    Occupancy(TreeFile<'a, bool>),
}

/// Why bytes are no map.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SavedError {
    /// They do not begin as any of the files does.
    #[error("it is no map: it begins neither as an .elkmap, nor as OctoMap's .ot or .bt")]
    Unknown,
    /// Scans and their poses.
    #[error("it is a .graph of OctoMap's, which holds scans and no map: make a map of them, and take that")]
    Graph,
    /// An `.elkmap` that cannot be read.
    #[error(transparent)]
    ElkMap(#[from] ElkMapError),
    /// A file of OctoMap's that cannot be read.
    #[error(transparent)]
    Tree(#[from] TreeFileError),
}

impl Format {
    /// That of a file of this name, by its ending.
    pub fn of(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()? {
            "elkmap" => Some(Self::ElkMap),
            "ot" => Some(Self::Ot),
            "bt" => Some(Self::Bt),
            _ => None,
        }
    }

    /// The file of a map.
    pub fn write(self, map: &OccupancyMap) -> Vec<u8> {
        let (mut bytes, resolution) = (Vec::new(), map.config().resolution);
        // Writing to a vector cannot fail.
        let _ = match self {
            Self::ElkMap => return elkmap::write(&map.snapshot()),
            Self::Ot => write_ot(&mut bytes, &map.log_odds_tree(), resolution),
            Self::Bt => write_bt(&mut bytes, &map.occupancy_tree(), resolution),
        };
        bytes
    }
}

impl<'a> Saved<'a> {
    /// The map in a file, whose first bytes tell of which kind it is.
    ///
    /// # Errors
    /// It is of no such kind, cut off or damaged.
    pub fn read(bytes: &'a [u8]) -> Result<Self, SavedError> {
        let begins = |magic: &[u8]| bytes.starts_with(magic);
        match () {
            () if begins(&elkmap::MAGIC) => Ok(Self::Snapshot(elkmap::read(bytes)?)),
            () if is_graph(bytes) => Err(SavedError::Graph),
            // The first line of an .ot is not the beginning of a .bt's, nor the other way round.
            () if begins(bt::MAGIC.as_bytes()) || begins(&bt::LEGACY_MAGIC) => Ok(Self::Occupancy(read_bt(bytes)?)),
            () if begins(ot::MAGIC.as_bytes()) => Ok(Self::LogOdds(read_ot(bytes)?)),
            () => Err(SavedError::Unknown),
        }
    }

    /// Edge of a voxel (m).
    pub fn resolution(&self) -> f64 {
        match self {
            Self::Snapshot(snapshot) => snapshot.resolution,
            Self::LogOdds(file) => file.resolution,
            Self::Occupancy(file) => file.resolution,
        }
    }
}

impl OccupancyMap {
    /// A map that goes on from a saved one, at revision 1. From a snapshot it is the same map. A file of OctoMap's does not say
    /// which voxels were ever hit; here those are that are occupied. A `.bt` does not say either how sure the map was: a voxel
    /// is as sure as if one scan had seen it (as in [`OccupancyMap::from_states`]).
    ///
    /// # Errors
    /// Its voxels are not of this size, it is larger than this map may be, or it is none of a map.
    pub fn from_saved(config: MapConfig, saved: &Saved<'_>) -> Result<Self, RestoreError> {
        match saved {
            Saved::Snapshot(snapshot) => Self::restore(config, snapshot),
            Saved::LogOdds(file) => Self::of_cubes(config, file, file.cubes()),
            Saved::Occupancy(file) => {
                let log_odds = |occupied| if occupied { config.hit } else { config.miss };
                let cubes = file.cubes().map(|Cube { min, edge, value }| Cube { min, edge, value: log_odds(value) });
                Self::of_cubes(config, file, cubes)
            }
        }
    }

    /// The map of a file, whose cubes have these log-odds.
    fn of_cubes<V>(
        config: MapConfig,
        file: &TreeFile<'_, V>,
        cubes: impl Iterator<Item = Cube<f32>>,
    ) -> Result<Self, RestoreError> {
        let mut map = Self::with_room_for(config, file.bricks, file.resolution)?;
        for Cube { min, edge, value } in cubes {
            let log_odds = value.clamp(config.clamp_min, config.clamp_max);
            for brick in cube((edge as i32 / BRICK).max(1)) {
                let offset = Voxel::from(brick.to_array().map(|c| c * BRICK));
                map.know_block(min + offset, (edge as i32).min(BRICK), log_odds);
            }
        }
        for brick in &mut map.bricks {
            brick.ever_hit = brick.occupied;
        }
        map.shown_at(1)
    }

    /// Gives the voxels of a cube within one brick, `min` being the lowest, these log-odds.
    fn know_block(&mut self, min: Voxel, edge: i32, log_odds: f32) {
        if let Some(i) = self.table.find_or_add(brick_of(min)) {
            self.grow();
            let (brick, codes, config) = (&mut self.bricks[i], &mut self.codes, &self.config);
            cube(edge).for_each(|offset| brick.know(cell_of(min + offset), log_odds, config, codes));
        }
    }
}

/// The places of a cube of this edge.
fn cube(edge: i32) -> impl Iterator<Item = Voxel> {
    (0..edge.pow(3)).map(move |i| Voxel::new(i % edge, i / edge % edge, i / edge / edge))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::octree::Node;
    use elk_geometry::State;
    use nalgebra::Point3;
    use proptest::prelude::*;

    const FORMATS: [Format; 3] = [Format::ElkMap, Format::Ot, Format::Bt];

    type Scans = Vec<(Point3<f64>, Vec<Point3<f64>>)>;

    fn scans() -> impl Strategy<Value = Scans> {
        let point = || prop::array::uniform3(-1.5..1.5f64).prop_map(Point3::from);
        prop::collection::vec((point(), prop::collection::vec(point(), 1..30)), 1..5)
    }

    fn map_of(scans: &Scans) -> OccupancyMap {
        let mut map = OccupancyMap::new(MapConfig::default()).unwrap();
        for (origin, points) in scans {
            let changed = map.insert(*origin, points.iter().copied()).changed;
            map.advance(&changed);
        }
        map
    }

    fn again(format: Format, map: &OccupancyMap) -> OccupancyMap {
        let bytes = format.write(map);
        let saved = Saved::read(&bytes).unwrap();
        assert_eq!(saved.resolution(), 0.1);
        OccupancyMap::from_saved(MapConfig::default(), &saved).unwrap()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        /// Whatever the file, the map that goes on from it shows what the map showed, and its frontier.
        #[test]
        fn a_saved_map_shows_what_it_showed(scans in scans()) {
            let map = map_of(&scans);
            for format in FORMATS {
                let again = again(format, &map);
                prop_assert_eq!(again.grid().revision(), 1);
                prop_assert_eq!(again.occupancy_tree(), map.occupancy_tree());
                prop_assert_eq!(again.frontier_len(), map.frontier_len());
                for (voxel, log_odds) in map.known().filter(|_| format != Format::Bt) {
                    prop_assert_eq!(again.log_odds(voxel), Some(log_odds));
                }
                let [ours, right] = [&again, &map].map(|map| format.write(map));
                prop_assert_eq!(Saved::read(&ours), Saved::read(&right));
            }
        }
    }

    #[test]
    fn a_file_s_kind_is_told_by_its_name_when_it_is_written_and_by_what_is_in_it_when_it_is_read() {
        let of = |name: &str| Format::of(Path::new(name));
        let kinds = ["a/b.elkmap", "b.ot", "b.bt"].map(of);
        assert_eq!(kinds, FORMATS.map(Some));
        assert_eq!([of("map"), of("map.ply"), of(".bt")], [None; 3]);
        assert_eq!(Saved::read(b"ply\n"), Err(SavedError::Unknown));
        assert!(matches!(Saved::read(&elkmap::MAGIC), Err(SavedError::ElkMap(ElkMapError::Truncated(8)))));
        assert!(matches!(Saved::read(b"# Octomap OcTree file"), Err(SavedError::Tree(TreeFileError::HeaderEnd))));
    }

    #[test]
    fn scans_are_no_map_however_many_they_are() {
        let graph =
            |scans: u32| [&scans.to_le_bytes()[..], &1u32.to_le_bytes(), &3u32.to_le_bytes(), &[0; 99]].concat();
        for scans in [1, 3, 7] {
            assert_eq!(Saved::read(&graph(scans)), Err(SavedError::Graph), "{scans}");
        }
    }

    /// A file of 30 bytes may call the whole world free.
    #[test]
    fn a_cube_that_no_map_holds_is_refused_before_it_is_made() {
        let config = MapConfig { max_bricks: 64, ..MapConfig::default() };
        let of = |tree: Node<f32>| {
            let mut bytes = Vec::new();
            write_ot(&mut bytes, &tree, 0.1).unwrap();
            OccupancyMap::from_saved(config, &Saved::read(&bytes).unwrap())
        };
        let world = of(Node::Leaf(-0.4)).unwrap_err();
        assert_eq!(world, RestoreError::TooMany { bricks: 1 << 39, most: 64 });
        // A cube of four bricks along each edge fits, and one more brick does not.
        let mut voxels: Vec<(Voxel, f32)> = cube(4 * BRICK).map(|voxel| (voxel, 0.85)).collect();
        let map = of(Node::from_voxels(voxels.iter().copied())).unwrap();
        assert_eq!((map.grid().occupied(), map.is_full()), (voxels.len(), true));
        voxels.extend([(Voxel::new(-1, 0, 0), 0.85), (Voxel::new(0, 0, -20), 0.85), (Voxel::new(3, 1, -18), 0.85)]);
        let said = of(Node::from_voxels(voxels)).unwrap_err();
        assert_eq!(said, RestoreError::TooMany { bricks: 66, most: 64 }, "all that there are");
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let map = map_of(&vec![([0.05; 3].into(), vec![[3.95, 0.05, 0.05].into()])]);
        for format in FORMATS {
            let bytes = format.write(&map);
            let saved = Saved::read(&bytes).unwrap();
            let finer = MapConfig { resolution: 0.05, ..MapConfig::default() };
            let smaller = MapConfig { max_bricks: 4, ..MapConfig::default() };
            let refused = [finer, smaller].map(|config| OccupancyMap::from_saved(config, &saved).unwrap_err());
            let [size, room] = refused;
            assert_eq!(size, RestoreError::Resolution { saved: 0.1, own: 0.05 });
            assert!(matches!(room, RestoreError::TooMany { bricks: 5, most: 4 }), "{format:?}: {room}");
        }
        assert_eq!(map.grid().state(Voxel::new(39, 0, 0)), State::Occupied);
    }
}
