//! Checksums, that tell one file from another.

use std::io::{BufRead, BufReader};

/// FNV-1a of nothing.
const BASIS: u64 = 0xcbf2_9ce4_8422_2325;

/// Goes on with an FNV-1a whose value so far is `hash`, over more bytes: what is hashed in pieces is hashed as a whole.
fn fnv1a_on(hash: u64, bytes: &[u8]) -> u64 {
    bytes.iter().fold(hash, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3))
}

/// FNV-1a of a file's bytes, however many they are.
///
/// # Errors
/// It cannot be read, or is no ordinary file.
pub fn fnv1a_of_file(path: &std::path::Path) -> std::io::Result<u64> {
    let mut file = BufReader::new(crate::file::open(path)?);
    let mut hash = BASIS;
    loop {
        let bytes = file.fill_buf()?;
        if bytes.is_empty() {
            return Ok(hash);
        }
        hash = fnv1a_on(hash, bytes);
        let count = bytes.len();
        file.consume(count);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_of_a_file_is_fnv_1a() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("world.obj");
        std::fs::write(&path, "foobar").unwrap();
        assert_eq!(fnv1a_of_file(&path).unwrap(), 0x8594_4171_f739_67e8, "as its authors give it");
        // Longer than what is read at once.
        let long = "v 0 0 0\n".repeat(5000);
        std::fs::write(&path, &long).unwrap();
        assert_eq!(fnv1a_of_file(&path).unwrap(), fnv1a_on(BASIS, long.as_bytes()));
        assert!(fnv1a_of_file(folder.path()).is_err() && fnv1a_of_file(std::path::Path::new("/dev/zero")).is_err());
    }
}
