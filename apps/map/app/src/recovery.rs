//! How a map goes on from a predecessor: what is known of it, and how far it has come to be there itself.

use elk_map::OccupancyMap;
use elk_spatial::checks::MAX_REVISIONS_AHEAD;

/// How far a map has come to be there.
pub enum Stage {
    /// It learns what its predecessor published last.
    Recalling(Past),
    /// It waits for a copy of `revision`, since a moment of the clock's own time (s): a driven one may stand still.
    /// `any`: an older one will do.
    Asking { revision: u64, since: f64, any: bool },
    /// It takes scans.
    Here,
}

/// What is known of a predecessor.
#[derive(Default)]
pub struct Past {
    /// What it left, and the last scan in it.
    pub memory: Option<(Box<OccupancyMap>, u64)>,
    /// Revisions that the map had, as its own last words and those of its readers have it.
    pub revisions: Vec<u64>,
}

impl Past {
    /// The revision that the map was at. Its own word of that may be lost, with a broker that died when the map was dead;
    /// a reader that lives says it again. A word that stands alone, further above all others than a map can have come
    /// meanwhile, is not believed.
    pub fn revision(&mut self) -> u64 {
        self.revisions.push(0);
        self.revisions.sort_unstable();
        let pairs = self.revisions.windows(2);
        pairs.filter(|pair| pair[1] - pair[0] <= MAX_REVISIONS_AHEAD).map(|pair| pair[1]).next_back().unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_revision_that_stands_alone_is_not_believed() {
        let of = |revisions: &[u64]| Past { memory: None, revisions: revisions.to_vec() }.revision();
        assert_eq!([of(&[]), of(&[7]), of(&[7, 9])], [0, 7, 9]);
        assert_eq!(of(&[1 << 40, 9]), 9);
        assert_eq!(of(&[1 << 40, 5000, 5001]), 5001, "two agree");
    }
}
