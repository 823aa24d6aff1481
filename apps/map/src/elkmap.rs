//! A map's own file, `.elkmap`: all that a [`Snapshot`] has but its revision, which is of one run, to be written and read
//! fast.
//!
//! Little-endian: eight bytes that say what it is ([`MAGIC`]), the version of the format (u32), the number of bricks (u32),
//! the edge of a voxel (f64, m); each brick its position in bricks (three i16), the cells that are known and those that were
//! ever hit (eight u64 each, see [`elk_geometry::mask`]), the log-odds of the known ones (f32, ascending by cell); and, behind
//! all, a checksum (u64) of everything before it.

use elk_geometry::mask;

use crate::bytes::{Bytes, CutOff};
use crate::snapshot::{BrickSnapshot, Snapshot};

/// How a file begins. A transfer that changes ends of lines, or takes it for a text, spoils it here.
pub const MAGIC: [u8; 8] = *b"\x8belkmap\n";
/// The version that is written, and the only one that is read.
pub const VERSION: u32 = 1;

/// Bytes of a brick without its log-odds.
const BRICK: usize = 3 * 2 + 2 * 64;
/// Bytes before the bricks.
const HEADER: usize = MAGIC.len() + 4 + 4 + 8;

/// Why bytes are no map's file.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum ElkMapError {
    /// The first bytes are others.
    #[error("it does not begin as an .elkmap does: it is another kind of file")]
    Magic,
    /// It is of another version of the format.
    #[error(
        "it is an .elkmap of version {found}, and version {VERSION} is what can be read: save the map again, as an .ot if \
             need be, with the program that wrote it"
    )]
    Version {
        /// Its version.
        found: u32,
    },
    /// It ends too early.
    #[error("the file ends at byte {0} where there should be more: it is cut off")]
    Truncated(usize),
    /// Something is behind the last brick.
    #[error("{0} bytes lie between the last brick and the checksum: the file is damaged")]
    Trailing(usize),
    /// It is not what was written.
    #[error("its checksum is {found:016x}, and that of what is in it {right:016x}: the file is damaged")]
    Checksum {
        /// What stands at the end.
        found: u64,
        /// What should.
        right: u64,
    },
    /// The edge of a voxel is not one.
    #[error("at byte 16: voxels of {0} m; expected a length above 0: the file is damaged")]
    Resolution(f64),
}

impl From<CutOff> for ElkMapError {
    fn from(CutOff { end }: CutOff) -> Self {
        Self::Truncated(end)
    }
}

/// The file of a snapshot.
pub fn write(snapshot: &Snapshot) -> Vec<u8> {
    let log_odds: usize = snapshot.bricks.iter().map(|brick| brick.log_odds.len()).sum();
    let mut bytes = Vec::with_capacity(HEADER + BRICK * snapshot.bricks.len() + 4 * log_odds + 8);
    bytes.extend(MAGIC);
    bytes.extend(VERSION.to_le_bytes());
    bytes.extend((snapshot.bricks.len() as u32).to_le_bytes());
    bytes.extend(snapshot.resolution.to_le_bytes());
    for brick in &snapshot.bricks {
        // The indices of voxels have 16 bits, so those of bricks have fewer.
        brick.position.to_array().iter().for_each(|c| bytes.extend((*c as i16).to_le_bytes()));
        brick.known.iter().chain(&brick.ever_hit).for_each(|layer| bytes.extend(layer.to_le_bytes()));
        brick.log_odds.iter().for_each(|one| bytes.extend(one.to_le_bytes()));
    }
    let sum = checksum(&bytes);
    bytes.extend(sum.to_le_bytes());
    bytes
}

/// The snapshot in a file, at revision 1: whoever has a copy of the map that it was has it of another run. Never allocates more
/// than a fixed multiple of the bytes that are there.
///
/// # Errors
/// It is no such file, of another version, cut off, or not what was written. Whether the bricks are those of a map is seen by
/// who restores it.
pub fn read(bytes: &[u8]) -> Result<Snapshot, ElkMapError> {
    let mut all = Bytes::new(bytes, 0);
    if all.array() != Ok(MAGIC) {
        return Err(ElkMapError::Magic);
    }
    let version = all.u32()?;
    if version != VERSION {
        return Err(ElkMapError::Version { found: version });
    }
    let (body, sum) =
        bytes.split_last_chunk().filter(|(body, _)| body.len() >= HEADER).ok_or(CutOff { end: bytes.len() })?;
    let (found, right) = (u64::from_le_bytes(*sum), checksum(body));
    if found != right {
        return Err(ElkMapError::Checksum { found, right });
    }
    let mut rest = Bytes::new(&body[HEADER - 12..], HEADER - 12);
    let (bricks, resolution) = (rest.u32()?, rest.f64()?);
    if !(resolution.is_finite() && resolution > 0.0) {
        return Err(ElkMapError::Resolution(resolution));
    }
    let bricks = (0..bricks).map(|_| read_brick(&mut rest)).collect::<Result<_, _>>()?;
    match rest.left() {
        0 => Ok(Snapshot { revision: 1, resolution, bricks }),
        more => Err(ElkMapError::Trailing(more)),
    }
}

fn read_brick(bytes: &mut Bytes<'_>) -> Result<BrickSnapshot, ElkMapError> {
    let position = [bytes.i16()?, bytes.i16()?, bytes.i16()?].map(i32::from).into();
    let mut masks = [mask::NONE; 2];
    for layer in masks.iter_mut().flatten() {
        *layer = bytes.u64()?;
    }
    let [known, ever_hit] = masks;
    let log_odds = (0..mask::count(&known)).map(|_| bytes.f32()).collect::<Result<_, _>>()?;
    Ok(BrickSnapshot { position, known, ever_hit, log_odds })
}

/// What stands behind `bytes`: FNV-1a over words of 64 bits, the last filled up with zeros, and the number of bytes. Any change within one word changes it.
pub fn checksum(bytes: &[u8]) -> u64 {
    let step = |hash: u64, word: u64| (hash ^ word).wrapping_mul(0x0100_0000_01b3);
    let (words, rest) = bytes.as_chunks();
    let hash = words.iter().fold(0xcbf2_9ce4_8422_2325, |hash, word| step(hash, u64::from_le_bytes(*word)));
    let last = rest.iter().rev().fold(0, |word, byte| word << 8 | u64::from(*byte));
    step(step(hash, last), bytes.len() as u64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::occupancy::{MapConfig, OccupancyMap};
    use nalgebra::Point3;
    use proptest::prelude::*;

    fn snapshot(scans: &[(Point3<f64>, Vec<Point3<f64>>)]) -> Snapshot {
        let mut map = OccupancyMap::new(MapConfig::default()).unwrap();
        for (origin, points) in scans {
            map.insert(*origin, points.iter().copied());
        }
        Snapshot { revision: 1, ..map.snapshot() }
    }

    fn snapshots() -> impl Strategy<Value = Snapshot> {
        let point = || prop::array::uniform3(-1.5..1.5f64).prop_map(Point3::from);
        prop::collection::vec((point(), prop::collection::vec(point(), 1..20)), 0..4).prop_map(|scans| snapshot(&scans))
    }

    /// The file with something in it changed, and a checksum that fits.
    fn spoilt(file: &[u8], spoil: impl FnOnce(&mut Vec<u8>)) -> Result<Snapshot, ElkMapError> {
        let mut body = file[..file.len() - 8].to_vec();
        spoil(&mut body);
        let sum = checksum(&body);
        body.extend(sum.to_le_bytes());
        read(&body)
    }

    proptest! {
        #[test]
        fn what_was_written_is_read(snapshot in snapshots()) {
            prop_assert_eq!(read(&write(&snapshot)), Ok(snapshot));
        }

        #[test]
        fn every_flipped_bit_and_every_cut_is_found(snapshot in snapshots(), at in any::<prop::sample::Index>(), bit in 0..8u8) {
            let mut file = write(&snapshot);
            let at = at.index(file.len());
            prop_assert!(read(&file[..at]).is_err());
            file[at] ^= 1 << bit;
            prop_assert!(read(&file).is_err());
        }

        /// What was made to harm, its checksum with it, is a snapshot or an error.
        #[test]
        fn any_body_is_a_snapshot_or_an_error(body in prop::collection::vec(any::<u8>(), 0..600), bricks in any::<u32>()) {
            let file = write(&Snapshot { revision: 1, resolution: 0.1, bricks: Vec::new() });
            let _ = spoilt(&file, |file| file.extend(&body));
            let _ = spoilt(&file, |file| {
                file[12..16].copy_from_slice(&bricks.to_le_bytes());
                file.extend(&body);
            });
        }
    }

    #[test]
    fn every_kind_of_damage_has_its_error() {
        let file = write(&snapshot(&[(Point3::origin(), vec![Point3::new(0.3, 0.1, 0.2)])]));
        assert_eq!(read(b"# Octomap OcTree file\n"), Err(ElkMapError::Magic));
        assert_eq!(read(&file[..20]), Err(ElkMapError::Truncated(20)));
        assert!(matches!(read(&file[..file.len() - 1]), Err(ElkMapError::Checksum { .. })));
        let newer = spoilt(&file, |file| file[8] = 2).unwrap_err();
        assert_eq!(newer, ElkMapError::Version { found: 2 });
        assert!(newer.to_string().contains("of version 2, and version 1 is what can be read"), "{newer}");
        assert_eq!(spoilt(&file, |file| file[16..24].fill(0)), Err(ElkMapError::Resolution(0.0)));
        let end = file.len() - 8;
        assert_eq!(spoilt(&file, |file| file[12..16].fill(255)), Err(ElkMapError::Truncated(end)));
        assert_eq!(spoilt(&file, |file| file.push(0)), Err(ElkMapError::Trailing(1)));
    }
}
