//! Where a single bit was flipped, by the checksum alone.
//!
//! A CRC is linear: what a flipped bit does to it depends on its distance from the end only, and since the polynomial of
//! CRC-32 is primitive, no two distances below 2³² − 1 bits do the same (Peterson and Brown, Cyclic Codes for Error
//! Detection, 1961). So a single flipped bit is found, and a larger damage passes for one with a probability of the
//! number of bits in 2³²: whoever uses the position looks for other evidence, too.

/// The polynomial of CRC-32, the lowest bit first.
const POLYNOMIAL: u32 = 0xedb8_8320;

/// Where a bit was flipped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Flip {
    /// In this byte of the data, which is put right by exclusive or with the mask.
    Data(u64, u8),
    /// In the checksum itself.
    Checksum,
}

/// The bit of `length` bytes that makes their checksum `found` instead of `said`; nothing: it is not one bit.
pub(crate) fn flipped(length: u64, found: u32, said: u32) -> Option<Flip> {
    let difference = found ^ said;
    if difference.is_power_of_two() {
        return Some(Flip::Checksum);
    }
    let mut trace = 1_u32;
    for behind in 0..length.checked_mul(8)? {
        trace = if trace & 1 == 1 { trace >> 1 ^ POLYNOMIAL } else { trace >> 1 };
        if trace == difference {
            let bit = length * 8 - 1 - behind;
            return Some(Flip::Data(bit / 8, 1 << (bit % 8)));
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_flipped_bit_is_found_and_nothing_else_is_taken_for_one() {
        let bytes: Vec<u8> = (0..=255).cycle().take(700).collect();
        let said = crc32fast::hash(&bytes);
        for bit in 0..bytes.len() * 8 {
            let (at, mask) = (bit / 8, 1 << (bit % 8));
            let mut damaged = bytes.clone();
            damaged[at] ^= mask;
            assert_eq!(flipped(700, crc32fast::hash(&damaged), said), Some(Flip::Data(at as u64, mask)));
        }
        for bit in 0..32 {
            assert_eq!(flipped(700, said, said ^ 1 << bit), Some(Flip::Checksum));
        }
        let mut hole = bytes.clone();
        hole[100..200].fill(0);
        assert_eq!(flipped(700, crc32fast::hash(&hole), said), None);
    }
}
