//! What hangs together among voxels over faces, edges and corners, as the frontier does in clusters: kept up to date as voxels
//! come and go.
//!
//! What comes joins the clusters that it touches, at the cost of the smaller ones. Where something goes, all that lay around
//! it is searched from at once, until the searches have met, or one has nowhere left to go and is a cluster of its own: at the
//! cost of the smaller part.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::hash::BuildHasherDefault;

use nalgebra::Point3;

use crate::bricks::BrickHasher;
use crate::searches::Searches;
use crate::voxel::Voxel;

/// Clusters of voxels: two are in one if they share a face, an edge or a corner, or others lead from one to the other.
#[derive(Debug, Clone, Default)]
pub struct Clusters {
    /// The number of the cluster that a voxel is in.
    numbers: HashMap<Voxel, u32, BuildHasherDefault<BrickHasher>>,
    /// By number; an empty one is to be given out again.
    clusters: Vec<Cluster>,
    vacant: Vec<u32>,
}

/// What is known of a cluster as a whole.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Cluster {
    size: usize,
    /// Of all indices, along each axis.
    sum: [i64; 3],
    /// Voxels by index, along each axis.
    along: [BTreeMap<i32, u32>; 3],
}

impl Cluster {
    /// Number of voxels.
    pub fn size(&self) -> usize {
        self.size
    }

    /// The mean of its voxels' centres (m, world), which need not be one of them, or free.
    pub fn center(&self, resolution: f64) -> Point3<f64> {
        let size = self.size.max(1) as f64;
        self.sum.map(|sum| (sum as f64 / size + 0.5) * resolution).into()
    }

    /// Its smallest and largest index along each axis.
    pub fn bounds(&self) -> (Voxel, Voxel) {
        let first = self.along.each_ref().map(|along| along.keys().next().copied().unwrap_or_default());
        let last = self.along.each_ref().map(|along| along.keys().next_back().copied().unwrap_or_default());
        (first.into(), last.into())
    }

    fn add(&mut self, voxel: Voxel) {
        self.size += 1;
        for (axis, index) in voxel.to_array().into_iter().enumerate() {
            self.sum[axis] += i64::from(index);
            *self.along[axis].entry(index).or_default() += 1;
        }
    }

    fn remove(&mut self, voxel: Voxel) {
        self.size -= 1;
        for (axis, index) in voxel.to_array().into_iter().enumerate() {
            self.sum[axis] -= i64::from(index);
            let along = &mut self.along[axis];
            match along.get_mut(&index) {
                Some(count) if *count > 1 => *count -= 1,
                _ => drop(along.remove(&index)),
            }
        }
    }

    fn take_in(&mut self, other: Cluster) {
        self.size += other.size;
        for (axis, along) in other.along.into_iter().enumerate() {
            self.sum[axis] += other.sum[axis];
            along.into_iter().for_each(|(index, count)| *self.along[axis].entry(index).or_default() += count);
        }
    }
}

impl Clusters {
    /// Takes note that some of the voxels `turned` have come or gone: `is_in` says which are there now. All others are as they
    /// were. Answers those that have.
    pub fn update(
        &mut self,
        turned: impl IntoIterator<Item = Voxel>,
        is_in: impl Fn(Voxel) -> bool,
    ) -> BTreeSet<Voxel> {
        let turned: BTreeSet<Voxel> =
            turned.into_iter().filter(|v| is_in(*v) != self.numbers.contains_key(v)).collect();
        let (come, mut gone): (BTreeSet<Voxel>, BTreeSet<Voxel>) = turned.iter().partition(|v| is_in(**v));
        // Hole by hole, so that the searches around one of them meet near it.
        while let Some(first) = gone.pop_first() {
            self.remove(hole(first, &mut gone));
        }
        come.into_iter().for_each(|voxel| self.add(voxel));
        turned
    }

    /// The voxels that are at most `steps` steps within their cluster from one of `sources`, which need not be there themselves.
    pub fn within(&self, sources: impl IntoIterator<Item = Voxel>, steps: usize) -> BTreeSet<Voxel> {
        let mut front: Vec<Voxel> = sources.into_iter().collect();
        let mut found: BTreeSet<Voxel> = front.iter().copied().filter(|v| self.numbers.contains_key(v)).collect();
        for _ in 0..steps {
            let next = front.iter().flat_map(|voxel| self.beside(*voxel));
            let next: Vec<Voxel> = next.filter(|near| found.insert(*near)).collect();
            if next.is_empty() {
                break;
            }
            front = next;
        }
        found
    }

    /// The cluster that a voxel is in; `None`: it is not there.
    pub fn of(&self, voxel: Voxel) -> Option<&Cluster> {
        self.numbers.get(&voxel).map(|number| &self.clusters[*number as usize])
    }

    /// All clusters, in an order that is the same after the same updates.
    pub fn iter(&self) -> impl Iterator<Item = &Cluster> {
        self.clusters.iter().filter(|cluster| cluster.size > 0)
    }

    /// Number of clusters.
    pub fn len(&self) -> usize {
        self.clusters.len() - self.vacant.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.numbers.is_empty()
    }

    /// The neighbours of a voxel that are there.
    fn beside(&self, voxel: Voxel) -> impl Iterator<Item = Voxel> + '_ {
        voxel.neighbours().filter(|near| self.numbers.contains_key(near))
    }

    /// Takes out voxels that hang together.
    fn remove(&mut self, hole: Vec<Voxel>) {
        let Some(&number) = hole.first().and_then(|voxel| self.numbers.get(voxel)) else { return };
        for voxel in &hole {
            self.numbers.remove(voxel);
            self.clusters[number as usize].remove(*voxel);
        }
        if self.clusters[number as usize].size == 0 {
            return self.vacant.push(number);
        }
        let mut searches = Searches::from(hole.iter().flat_map(|voxel| self.beside(*voxel)).collect());
        while let Some(part) = searches.next_cut_off(|voxel| self.beside(voxel)) {
            let own = self.vacant_number();
            for voxel in part {
                self.numbers.insert(voxel, own);
                self.clusters[number as usize].remove(voxel);
                self.clusters[own as usize].add(voxel);
            }
        }
    }

    fn add(&mut self, voxel: Voxel) {
        let mut touched: Vec<(u32, Voxel)> = self.beside(voxel).map(|near| (self.numbers[&near], near)).collect();
        touched.sort_unstable();
        touched.dedup_by_key(|(number, _)| *number);
        let largest = touched.iter().map(|(number, _)| *number).max_by_key(|n| self.clusters[*n as usize].size);
        let own = largest.unwrap_or_else(|| self.vacant_number());
        self.numbers.insert(voxel, own);
        self.clusters[own as usize].add(voxel);
        for (number, near) in touched.into_iter().filter(|(number, _)| *number != own) {
            let joined = std::mem::take(&mut self.clusters[number as usize]);
            self.clusters[own as usize].take_in(joined);
            self.vacant.push(number);
            self.renumber(near, own);
        }
    }

    /// Gives the voxels of the cluster that `first` is in another number.
    fn renumber(&mut self, first: Voxel, number: u32) {
        let Some(before) = self.numbers.insert(first, number) else { return };
        let mut front = vec![first];
        while let Some(voxel) = front.pop() {
            for near in voxel.neighbours() {
                if let Some(own) = self.numbers.get_mut(&near).filter(|own| **own == before) {
                    *own = number;
                    front.push(near);
                }
            }
        }
    }

    fn vacant_number(&mut self) -> u32 {
        self.vacant.pop().unwrap_or_else(|| {
            self.clusters.push(Cluster::default());
            self.clusters.len() as u32 - 1
        })
    }
}

/// Takes the voxels out of `among` that hang together with `first`.
fn hole(first: Voxel, among: &mut BTreeSet<Voxel>) -> Vec<Voxel> {
    let mut found = vec![first];
    let mut next = 0;
    while let Some(voxel) = found.get(next).copied() {
        next += 1;
        found.extend(voxel.neighbours().filter(|near| among.remove(near)));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn voxel() -> impl Strategy<Value = Voxel> {
        // Flat, so that much hangs on single voxels; and over the border of indices below 0.
        (-6..6i32, -6..6i32, 0..2i32).prop_map(|(x, y, z)| Voxel::new(x, y, z))
    }

    /// The clusters of a set as floods find them.
    fn flooded(mut set: BTreeSet<Voxel>) -> BTreeSet<Vec<Voxel>> {
        let mut clusters = BTreeSet::new();
        while let Some(first) = set.pop_first() {
            let mut cluster = hole(first, &mut set);
            cluster.sort_unstable();
            clusters.insert(cluster);
        }
        clusters
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(512))]
        /// Kept up to date edit by edit, the clusters are what floods find, and are as large, and where, as their voxels say.
        #[test]
        fn incremental_equals_flooded(
            begin in prop::collection::btree_set(voxel(), 0..200),
            edits in prop::collection::vec(prop::collection::vec(voxel(), 0..40), 1..12),
        ) {
            let (mut set, mut clusters) = (begin.clone(), Clusters::default());
            clusters.update(begin, |v| set.contains(&v));
            for turned in edits {
                for voxel in &turned {
                    if !set.remove(voxel) {
                        set.insert(*voxel);
                    }
                }
                clusters.update(turned, |v| set.contains(&v));
                let mut kept: BTreeMap<u32, Vec<Voxel>> = BTreeMap::new();
                for voxel in &set {
                    kept.entry(clusters.numbers[voxel]).or_default().push(*voxel);
                }
                prop_assert_eq!(clusters.numbers.len(), set.len());
                prop_assert_eq!(clusters.len(), kept.len());
                prop_assert_eq!(clusters.iter().map(Cluster::size).sum::<usize>(), set.len());
                for voxels in kept.values() {
                    let mut own = Cluster::default();
                    voxels.iter().for_each(|voxel| own.add(*voxel));
                    prop_assert_eq!(clusters.of(voxels[0]), Some(&own));
                    let ends = voxels[1..].iter().fold((voxels[0], voxels[0]), |(low, high), v| (low.inf(*v), high.sup(*v)));
                    prop_assert_eq!(own.bounds(), ends);
                }
                prop_assert_eq!(kept.into_values().collect::<BTreeSet<_>>(), flooded(set.clone()));
            }
        }
    }

    #[test]
    fn within_so_many_steps_is_what_can_be_gone_to_in_the_cluster() {
        let at = |x: i32| Voxel::new(x, 0, 0);
        let mut clusters = Clusters::default();
        let turned = clusters.update([0, 1, 2, 3, 5, 6].map(at), |_| true);
        assert_eq!(turned.len(), 6);
        assert!(clusters.update([at(0)], |_| true).is_empty(), "it was there");
        assert_eq!(clusters.within([at(0)], 2), [0, 1, 2].map(at).into());
        assert_eq!(clusters.within([at(4)], 1), [3, 5].map(at).into(), "from where nothing is, too");
        assert_eq!(clusters.within([at(3)], 9), [0, 1, 2, 3].map(at).into(), "no farther than the cluster");
    }

    #[test]
    fn a_cluster_has_a_size_a_centre_and_a_box() {
        let row = |range: std::ops::Range<i32>| range.map(|x| Voxel::new(x, -1, 4));
        let mut clusters = Clusters::default();
        clusters.update(row(0..9), |_| true);
        let sizes = |clusters: &Clusters| clusters.iter().map(Cluster::size).collect::<Vec<_>>();
        assert_eq!((clusters.len(), sizes(&clusters)), (1, vec![9]));
        clusters.update([Voxel::new(2, -1, 4)], |_| false);
        assert_eq!((clusters.len(), sizes(&clusters)), (2, vec![6, 2]));
        let larger = clusters.of(Voxel::new(3, -1, 4)).unwrap();
        assert_eq!(larger.bounds(), (Voxel::new(3, -1, 4), Voxel::new(8, -1, 4)));
        assert_eq!(larger.center(0.5), Point3::new(3.0, -0.25, 2.25));
        assert_eq!(clusters.of(Voxel::new(2, -1, 4)), None);
        clusters.update([Voxel::new(2, 0, 5)], |_| true);
        assert_eq!((clusters.len(), sizes(&clusters)), (1, vec![9]), "over corners");
        clusters.update(row(0..9).chain([Voxel::new(2, 0, 5)]), |_| false);
        assert!(clusters.is_empty() && clusters.iter().next().is_none());
    }
}
