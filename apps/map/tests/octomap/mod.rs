//! OctoMap itself (Debian's liboctomap-dev), through a small program that is built here where it can be.
#![allow(dead_code, reason = "each takes what it needs")]

use std::path::{Path, PathBuf};
use std::process::Command;

use elk_geometry::Voxel;

/// What OctoMap made of scans.
pub struct Outcome {
    /// CPU time a scan (s).
    pub seconds: Vec<f64>,
    /// Bytes that the map takes.
    pub heap: usize,
    /// A checksum of all voxels and their log-odds, see [`checksum`].
    pub leaves: u64,
}

/// The program, built in `folder`; or why it cannot be.
pub fn build(folder: &Path) -> Result<PathBuf, String> {
    let (source, program) = (folder.join("octomap.cpp"), folder.join("octomap"));
    std::fs::write(&source, include_str!("octomap.cpp")).map_err(|e| e.to_string())?;
    let compiler = std::env::var_os("CXX").unwrap_or_else(|| "c++".into());
    let mut command = Command::new(&compiler);
    command.args(["-O3", "-DNDEBUG", "-o"]).args([&program, &source]).args(["-loctomap", "-loctomath"]);
    let output = command.output().map_err(|e| format!("{compiler:?} does not run: {e}"))?;
    match output.status.success() {
        true => Ok(program),
        false => Err(format!("{compiler:?} does not find it (Debian: liboctomap-dev)")),
    }
}

/// Has OctoMap insert the scans of a `SCN1` file; `leaves`: where to write all voxels.
pub fn run(
    program: &Path,
    scans: &Path,
    resolution: f64,
    max_range: f64,
    mode: &str,
    leaves: Option<&Path>,
) -> Outcome {
    let mut command = Command::new(program);
    command.arg(scans).args([resolution, max_range].map(|n| n.to_string())).arg(mode).args(leaves);
    let output = command.output().expect("it was built here");
    assert!(output.status.success(), "{command:?}: {output:?}");
    let said = String::from_utf8(output.stdout).unwrap();
    let of =
        |key: &str| said.lines().find_map(|line| line.strip_prefix(key)).unwrap_or_else(|| panic!("no {key}: {said}"));
    Outcome {
        seconds: said.lines().map_while(|line| line.parse::<f64>().ok()).map(|us| us * 1e-6).collect(),
        heap: of("heap ").parse().unwrap(),
        leaves: u64::from_str_radix(of("leaves "), 16).unwrap(),
    }
}

/// The voxels in a file of [`run`], and the bits of their log-odds, in lexicographic order.
pub fn read_leaves(path: &Path) -> Vec<(Voxel, u32)> {
    let bytes = std::fs::read(path).unwrap();
    let key = |b: &[u8]| i32::from(u16::from_le_bytes([b[0], b[1]])) - 32768;
    let leaf = |b: &[u8]| {
        let log_odds = u32::from_le_bytes([b[6], b[7], b[8], b[9]]);
        (Voxel::new(key(b), key(&b[2..]), key(&b[4..])), log_odds)
    };
    bytes.chunks_exact(10).map(leaf).collect()
}

/// FNV-1a over voxels in lexicographic order: OctoMap's keys and the log-odds, little endian.
pub fn checksum(leaves: &[(Voxel, u32)]) -> u64 {
    let bytes = leaves.iter().flat_map(|(voxel, log_odds)| {
        let keys = voxel.to_array().map(|k| ((k + 32768) as u16).to_le_bytes());
        keys.concat().into_iter().chain(log_odds.to_le_bytes())
    });
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash: u64, byte| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3))
}
