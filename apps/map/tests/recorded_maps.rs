//! Maps that OctoMap wrote, read by us; skipped where the recorded data (`ELK_DATA`) are not there.

#[path = "../../../tests/common/skip.rs"]
mod skip;

use std::path::PathBuf;

use elk_map::octomap::bt::{read_bt, write_bt};

#[test]
fn maps_that_octomap_wrote_are_read_and_written_alike() {
    let beside = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
    let data = std::env::var_os("ELK_DATA").map_or_else(|| PathBuf::from(beside), PathBuf::from);
    // (file, nodes): the counts are those of the files' own headers.
    for (name, nodes) in [("octomap/geb079.bt", 532_566), ("scans/s100_r010.bt", 0)] {
        let Ok(bytes) = std::fs::read(data.join(name)) else {
            let why = format!("there is no {name} in {} (set ELK_DATA)", data.display());
            skip::skip("maps_that_octomap_wrote_are_read_and_written_alike", "data", &why);
            continue;
        };
        let file = read_bt(&bytes).unwrap();
        if nodes != 0 {
            assert_eq!(file.tree.count(), nodes, "{name}");
        }
        let mut ours = Vec::new();
        write_bt(&mut ours, &file.tree, file.resolution).unwrap();
        assert_eq!(read_bt(&ours).unwrap(), file, "{name}");
        let tail = |bytes: &[u8]| bytes[bytes.windows(5).position(|w| w == b"data\n").unwrap()..].to_vec();
        assert_eq!(tail(&ours), tail(&bytes), "{name}: the same tree has the same bytes");
        if name.starts_with("scans") {
            let count = |value| -> u64 {
                let cubes = file.tree.cubes().into_iter().filter(|c| c.value == value);
                cubes.map(|c| u64::from(c.edge).pow(3)).sum()
            };
            assert_eq!((count(true), count(false)), (44_016, 265_650), "what OctoMap's iterators count");
        }
    }
}
