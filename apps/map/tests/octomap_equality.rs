//! A map equals OctoMap's, voxel for voxel and log-odds for log-odds: as it was recorded for scans of our own, and as OctoMap
//! itself says it here, where it is installed.

mod octomap;
mod scans;
#[path = "../../../tests/common/skip.rs"]
mod skip;

use elk_geometry::Voxel;
use elk_map::{Integration, MapConfig, OccupancyMap};
use octomap::checksum;
use scans::Scan;

/// How the scans are taken, and how OctoMap calls that.
const MODES: [(Integration, &str); 2] = [(Integration::Rays, "plain"), (Integration::EndVoxels, "discretize")];

/// Voxels of the map of these scans, in lexicographic order, with the bits of their log-odds.
fn leaves(scans: &[Scan], config: MapConfig) -> Vec<(Voxel, u32)> {
    let mut map = OccupancyMap::new(config).unwrap();
    for scan in scans {
        map.insert(scan.origin(), scan.points());
    }
    let mut leaves: Vec<(Voxel, u32)> = map.known().map(|(voxel, log_odds)| (voxel, log_odds.to_bits())).collect();
    leaves.sort_unstable();
    leaves
}

/// What OctoMap 1.9.7 made of these scans at 0.1 m, and at 0.04 m with a largest range of 2.5 m.
#[test]
fn a_map_of_our_scans_is_what_octomap_made_of_them() {
    let scans = scans::mixed(20, 500);
    let of = |integration| {
        let coarse = MapConfig { integration, ..MapConfig::octomap(0.1) };
        let fine = MapConfig { integration, max_range: 2.5, ..MapConfig::octomap(0.04) };
        [coarse, fine].map(|config| format!("{:016x}", checksum(&leaves(&scans, config))))
    };
    assert_eq!(of(Integration::Rays), ["21650a19a42a0b5c", "4bd96183d79e6ab5"]);
    assert_eq!(of(Integration::EndVoxels), ["1eece12e1f3bbb99", "f56fd637cb157ddf"]);
}

#[test]
fn a_map_is_what_octomap_itself_makes_of_the_same_scans() {
    let folder = tempfile::tempdir().unwrap();
    let program = match octomap::build(folder.path()) {
        Ok(program) => program,
        Err(why) => return skip::skip("a_map_is_what_octomap_itself_makes_of_the_same_scans", "octomap", &why),
    };
    let mut all = vec![("mixed", scans::mixed(20, 500), vec![(0.1, 0.0), (0.04, 2.5)])];
    all.push(("room", scans::room(100, 100).drain(..12).collect(), vec![(0.1, 0.0), (0.05, 0.0), (0.1, 3.0)]));
    for (name, sizes) in [("s100.scn", [0.1, 0.05]), ("real7s.scn", [0.05, 0.02])] {
        let Some(scans) = scans::recorded(name) else {
            let why = format!("there is no {name} in {} (set ELK_DATA)", scans::data::folder().display());
            skip::skip("a_map_is_what_octomap_itself_makes_of_the_same_scans", "data", &why);
            continue;
        };
        all.push((name, scans, sizes.map(|size| (size, 0.0)).to_vec()));
    }
    for (name, scans, settings) in &all {
        let file = folder.path().join("scans.scn");
        scans::write(&file, scans).unwrap();
        for (resolution, max_range) in settings {
            for (integration, mode) in MODES {
                let into = folder.path().join("leaves");
                let theirs = octomap::run(&program, &file, *resolution, *max_range, mode, Some(&into));
                let config = MapConfig { integration, max_range: *max_range, ..MapConfig::octomap(*resolution) };
                let ours = leaves(scans, config);
                let case = format!("{name} {resolution} m, range {max_range} m, {mode}");
                assert_same(&case, &ours, &octomap::read_leaves(&into));
                assert_eq!(checksum(&ours), theirs.leaves, "{case}");
            }
        }
    }
}

fn assert_same(case: &str, ours: &[(Voxel, u32)], theirs: &[(Voxel, u32)]) {
    let only = |a: &[(Voxel, u32)], b: &[(Voxel, u32)]| {
        a.iter().filter(|leaf| b.binary_search(leaf).is_err()).copied().collect::<Vec<(Voxel, u32)>>()
    };
    let (more, less) = (only(ours, theirs), only(theirs, ours));
    assert!(
        more.is_empty() && less.is_empty(),
        "{case}: of {} voxels {} differ, of {} {}: {:?} {:?}",
        ours.len(),
        more.len(),
        theirs.len(),
        less.len(),
        &more[..more.len().min(5)],
        &less[..less.len().min(5)]
    );
}
