//! What is kept from plan to plan: the rest of the branch that was chosen, and places from which something was seen to be seen.

use elk_bus::payload;
use elk_geometry::Voxel;

/// Places that are kept at most.
pub const MOST_PLACES: usize = 256;
/// Nodes of a branch that are kept at most.
const MOST_BRANCH: usize = 1024;

/// What a plan leaves to the next one, and an explorer to its successor.
#[payload]
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Kept {
    /// The nodes of the branch that was chosen, from the robot on, without its root.
    #[describe(longest = MOST_BRANCH)]
    pub branch: Vec<Voxel>,
    /// Places of trees of before from which there was something to be seen, in lexicographic order.
    #[describe(longest = MOST_PLACES)]
    pub places: Vec<Place>,
}

/// A place from which there is something to be seen.
#[payload]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Where.
    pub voxel: Voxel,
    /// Frontier voxels that were to be seen when it was last looked at.
    #[describe(range = 0.0..=1e9)]
    pub gain: f64,
}

impl Kept {
    /// This is the branch now.
    pub fn keep_branch(&mut self, branch: impl IntoIterator<Item = Voxel>) {
        self.branch = branch.into_iter().take(MOST_BRANCH).collect();
    }

    /// From this place so much is to be seen: it is kept, unless that is less than `least`, or one is that is nearer than `apart`
    /// (voxels) and has as much. Of too many those with the least go.
    pub fn note(&mut self, place: Place, least: f64, apart: f64) {
        let is_worth_it = place.gain >= least;
        let covers = |other: &Place| {
            other.voxel != place.voxel && other.gain >= place.gain && other.voxel.distance(place.voxel) < apart
        };
        if !is_worth_it || self.places.iter().any(covers) {
            self.places.retain(|other| other.voxel != place.voxel);
            return;
        }
        self.places.retain(|other| other.voxel.distance(place.voxel) >= apart && other.voxel != place.voxel);
        let at = self.places.partition_point(|other| other.voxel < place.voxel);
        self.places.insert(at, place);
        if self.places.len() > MOST_PLACES {
            let least = self.places.iter().enumerate().min_by(|(_, one), (_, other)| one.gain.total_cmp(&other.gain));
            if let Some((least, _)) = least {
                self.places.remove(least);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place(x: i32, gain: f64) -> Place {
        Place { voxel: Voxel::new(x, 0, 0), gain }
    }

    #[test]
    fn of_places_beside_each_other_the_one_that_sees_most_is_kept() {
        let mut kept = Kept::default();
        let mut note = |x, gain| {
            kept.note(place(x, gain), 2.0, 5.0);
            kept.places.iter().map(|one| (one.voxel.x, one.gain)).collect::<Vec<_>>()
        };
        assert_eq!(note(10, 7.0), [(10, 7.0)]);
        assert_eq!(note(13, 6.0), [(10, 7.0)]);
        assert_eq!(note(15, 6.0), [(10, 7.0), (15, 6.0)]);
        assert_eq!(note(12, 8.0), [(12, 8.0)]);
        assert_eq!(note(0, 1.0), [(12, 8.0)], "that is too little");
        assert_eq!(note(12, 3.0), [(12, 3.0)], "it is as it was found last");
        assert_eq!(note(12, 0.0), []);
    }

    #[test]
    fn no_more_is_kept_than_a_memory_holds_and_what_is_least_goes() {
        let mut kept = Kept::default();
        let all = 2 * MOST_PLACES as i32;
        (0..all).for_each(|n| kept.note(place(20 * (37 * n % all), f64::from(n)), 0.0, 5.0));
        assert_eq!(kept.places.len(), MOST_PLACES);
        assert!(kept.places.iter().all(|one| one.gain >= MOST_PLACES as f64));
        assert!(kept.places.is_sorted_by(|one, next| one.voxel < next.voxel));
        kept.keep_branch((0..5000).map(|x| Voxel::new(x, 0, 0)));
        assert_eq!(kept.branch.len(), MOST_BRANCH);
        elk_bus::Describe::check(&kept).unwrap();
    }
}
