//! Searches from several places at once, which are one when they meet: what they find apart is no longer connected.
//!
//! All go on in turns, so the smallest part is found at its own cost, however large the others are (after Even and Shiloach,
//! *An On-Line Edge-Deletion Problem*, 1981).

use std::collections::{BTreeSet, HashMap, VecDeque};
use std::hash::{BuildHasherDefault, Hash};

use crate::bricks::BrickHasher;

/// Searches over nodes `N`.
pub(crate) struct Searches<N> {
    /// Which search has been to a node.
    been: HashMap<N, usize, BuildHasherDefault<BrickHasher>>,
    searches: Vec<Search<N>>,
    /// Searches that go on.
    going: usize,
}

/// How one search stands.
enum Search<N> {
    /// It has these nodes to go on from, in the order in which it came there.
    Going(VecDeque<N>),
    /// It is a part of another one.
    Joined(usize),
    /// It had nowhere left to go, and was told.
    CutOff,
}

impl<N: Copy + Ord + Hash> Searches<N> {
    /// A search from each of `starts`.
    pub fn from(starts: BTreeSet<N>) -> Self {
        let going = starts.len();
        let been = starts.iter().copied().enumerate().map(|(search, node)| (node, search)).collect();
        let searches = starts.into_iter().map(|node| Search::Going(VecDeque::from([node]))).collect();
        Self { been, searches, going }
    }

    /// Searches until one of several has nowhere left to go: all nodes where it was, in order. `None`: all others are one. May
    /// be asked again, until it is.
    pub fn next_cut_off<I: IntoIterator<Item = N>>(&mut self, mut neighbours: impl FnMut(N) -> I) -> Option<Vec<N>> {
        while self.going > 1 {
            for search in 0..self.searches.len() {
                let Search::Going(front) = &mut self.searches[search] else { continue };
                if self.going == 1 {
                    return None;
                }
                let Some(node) = front.pop_front() else {
                    self.searches[search] = Search::CutOff;
                    self.going -= 1;
                    return Some(self.nodes_of(search));
                };
                neighbours(node).into_iter().for_each(|near| self.come_to(near, search));
            }
        }
        None
    }

    fn come_to(&mut self, node: N, search: usize) {
        let own = self.root(search);
        let other = self.been.insert(node, own).map(|other| self.root(other));
        let come_in = match other {
            None => VecDeque::from([node]),
            Some(other) if other == own => return,
            Some(other) => match std::mem::replace(&mut self.searches[other], Search::Joined(own)) {
                Search::Going(front) => {
                    self.going -= 1;
                    front
                }
                _ => return,
            },
        };
        if let Search::Going(front) = &mut self.searches[own] {
            front.extend(come_in);
        }
    }

    fn root(&self, mut search: usize) -> usize {
        while let Search::Joined(other) = self.searches[search] {
            search = other;
        }
        search
    }

    fn nodes_of(&self, search: usize) -> Vec<N> {
        let own = self.been.iter().filter(|(_, other)| self.root(**other) == search);
        let mut nodes: Vec<N> = own.map(|(node, _)| *node).collect();
        nodes.sort_unstable();
        nodes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of three rows of numbers, 0 to 9, 100 to 120 and 200 to 900, the smaller two are told, and nobody walks the largest.
    #[test]
    fn the_smaller_parts_are_told_in_turn() {
        let rows = [0..10, 100..121, 200..901];
        let near = |n: i32| [n - 1, n + 1].into_iter().filter(|n| rows.iter().any(|row| row.contains(n)));
        let mut searches = Searches::from(BTreeSet::from([3, 5, 101, 500]));
        for row in &rows[..2] {
            assert_eq!(searches.next_cut_off(near), Some(row.clone().collect()));
        }
        assert_eq!(searches.next_cut_off(near), None);
        assert!(searches.been.len() < 100);
    }
}
