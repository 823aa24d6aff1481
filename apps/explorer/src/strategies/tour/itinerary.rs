//! The shortest way past many sets of places: an open tour that comes to one place of each (the travelling salesman's problem with
//! neighbourhoods).
//!
//! The set that lies farthest off the tour so far is put in first, where that costs least (farthest insertion); so the ends of the
//! world make the tour, and what lies by the way is seen in passing. Stretches are then turned round or moved, and places exchanged,
//! as long as that makes it shorter.

use elk_geometry::tour::shorten;

/// Less than this is no shorter (m).
const LEAST_M: f64 = 1e-6;
/// How often all moves are tried.
const ROUNDS: usize = 8;

/// A stop of the tour.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Stop {
    /// Where it is.
    pub place: usize,
    /// The sets that it is for: the one that it was put in for is the first.
    pub sets: Vec<usize>,
}

/// A short open tour from `start` past one place of each of the `sets`; of those that have no place nothing is said.
pub fn itinerary(start: usize, sets: &[Vec<usize>], distance: impl Fn(usize, usize) -> f64) -> Vec<Stop> {
    let mut tour = Tour { start, sets, distance, stops: Vec::new() };
    tour.insert_all();
    for _ in 0..ROUNDS {
        if !(shorten(start, &mut tour.stops, |stop| stop.place, &tour.distance) | tour.exchange_places()) {
            break;
        }
    }
    tour.stops
}

/// Where a set is put in, and what that costs (m).
#[derive(Debug, Clone, Copy)]
struct Insertion {
    cost: f64,
    place: usize,
    /// The stop before it, by its place in the list of insertions; 0 is the start.
    after: usize,
}

struct Tour<'a, D> {
    start: usize,
    sets: &'a [Vec<usize>],
    distance: D,
    stops: Vec<Stop>,
}

impl<D: Fn(usize, usize) -> f64> Tour<'_, D> {
    /// Farthest insertion.
    fn insert_all(&mut self) {
        // What was put in, in that order, and what comes after each.
        let (mut stops, mut next) = (vec![Stop { place: self.start, sets: vec![] }], vec![None]);
        let mut best: Vec<Option<Insertion>> =
            self.sets.iter().map(|set| self.cheapest(set, &stops, &next, &[0])).collect();
        loop {
            let open = best.iter().enumerate().filter_map(|(set, best)| Some((set, (*best)?)));
            let farthest = open.rev().max_by(|(_, one), (_, other)| one.cost.total_cmp(&other.cost));
            let Some((set, Insertion { cost, place, after })) = farthest else { break };
            best[set] = None;
            // It may be that a stop is there.
            if let Some(stop) = stops.iter().skip(1).position(|stop| stop.place == place).filter(|_| cost < LEAST_M) {
                stops[stop + 1].sets.push(set);
                continue;
            }
            let new = stops.len();
            stops.push(Stop { place, sets: vec![set] });
            let beyond = next[after].replace(new);
            next.push(beyond);
            for (set, best) in best.iter_mut().enumerate() {
                let Some(known) = *best else { continue };
                // The stretch that it was to go into is two now.
                let anew = known.after == after;
                let after: Vec<usize> = if anew { (0..stops.len()).collect() } else { vec![after, new] };
                let found = self.cheapest(&self.sets[set], &stops, &next, &after);
                *best = found.into_iter().chain((!anew).then_some(known)).min_by(|a, b| a.cost.total_cmp(&b.cost));
            }
        }
        let order = std::iter::successors(next[0], |stop| next[*stop]);
        self.stops = order.map(|stop| stops[stop].clone()).collect();
    }

    /// Where it costs least to come to a set, of what follows the stops `after`.
    fn cheapest(&self, set: &[usize], stops: &[Stop], next: &[Option<usize>], after: &[usize]) -> Option<Insertion> {
        let costs = after.iter().flat_map(|&after| {
            let (from, to) = (stops[after].place, next[after].map(|next| stops[next].place));
            set.iter().map(move |&place| Insertion { cost: self.detour(from, place, to), place, after })
        });
        costs.min_by(|a, b| a.cost.total_cmp(&b.cost))
    }

    /// How much longer the way is over `by`.
    fn detour(&self, from: usize, by: usize, to: Option<usize>) -> f64 {
        let d = &self.distance;
        d(from, by) + to.map_or(0.0, |to| d(by, to) - d(from, to))
    }

    /// The place before stop `k`.
    fn before(&self, k: usize) -> usize {
        k.checked_sub(1).map_or(self.start, |k| self.stops[k].place)
    }

    /// Each stop to the place by which the way is shortest, of those that all its sets have; answers whether any moved.
    fn exchange_places(&mut self) -> bool {
        let mut shorter = false;
        for k in 0..self.stops.len() {
            let (before, after) = (self.before(k), self.stops.get(k + 1).map(|stop| stop.place));
            let Some((first, others)) = self.stops[k].sets.split_first() else { continue };
            let shared = |place: &&usize| others.iter().all(|set| self.sets[*set].contains(place));
            let cost = |place: usize| self.detour(before, place, after);
            let places = self.sets[*first].iter().filter(shared).map(|place| (cost(*place), *place));
            let best = places.min_by(|a, b| a.0.total_cmp(&b.0));
            if let Some((_, place)) = best.filter(|(new, _)| *new < cost(self.stops[k].place) - LEAST_M) {
                self.stops[k].place = place;
                shorter = true;
            }
        }
        shorter
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use elk_geometry::random::Random;

    /// On a line with a place at 2 and others at 3, 10 and −1: what is near the one end is seen first, whatever lies by the way to the
    /// other end is a stop on it, and a set with a place there needs none of its own.
    #[test]
    fn what_is_near_the_short_end_is_seen_first_and_the_rest_in_passing() {
        let at = [0.0f64, -1.0, 2.0, 3.0, 10.0, 50.0];
        let sets = [vec![4], vec![1], vec![2], vec![5, 3], vec![4, 5]];
        let stops = itinerary(0, &sets, |a, b| (at[a] - at[b]).abs());
        assert_eq!(stops.iter().map(|stop| stop.place).collect::<Vec<_>>(), [1, 2, 3, 4]);
        assert_eq!(stops[3].sets, [0, 4]);
        assert!(itinerary(0, &[vec![]], |_, _| 1.0).is_empty());
    }

    /// Few sets in a plane, drawn by lot: every set is come to, and the tours are on average a tenth longer at most than the best of
    /// all orders and places.
    #[test]
    fn it_is_nearly_the_shortest_of_all() {
        let (mut found_m, mut best_m) = (0.0, 0.0);
        for k in 0..300 {
            let mut random = Random::new(1, k);
            let at: Vec<(f64, f64)> = (0..8).map(|_| (random.between(0.0, 9.0), random.between(0.0, 9.0))).collect();
            let sets: Vec<Vec<usize>> = (0..4).map(|_| (0..2).map(|_| 1 + random.below(7)).collect()).collect();
            let distance = |a: usize, b: usize| (at[a].0 - at[b].0).hypot(at[a].1 - at[b].1);
            let stops = itinerary(0, &sets, distance);
            for (k, set) in sets.iter().enumerate() {
                assert!(stops.iter().any(|stop| stop.sets.contains(&k) && set.contains(&stop.place)));
            }
            let places: Vec<usize> = std::iter::once(0).chain(stops.iter().map(|stop| stop.place)).collect();
            found_m += places.windows(2).map(|pair| distance(pair[0], pair[1])).sum::<f64>();
            best_m += shortest(0, &sets, &distance);
        }
        assert!(best_m <= found_m && found_m < 1.1 * best_m, "{found_m} m, and {best_m} m is enough");
    }

    /// The shortest of all tours, by trying all.
    fn shortest(from: usize, sets: &[Vec<usize>], distance: &dyn Fn(usize, usize) -> f64) -> f64 {
        let rest =
            |k: usize| sets.iter().enumerate().filter(|(n, _)| *n != k).map(|(_, set)| set.clone()).collect::<Vec<_>>();
        let legs = sets.iter().enumerate().flat_map(|(k, set)| set.iter().map(move |place| (k, *place)));
        legs.map(|(k, place)| distance(from, place) + shortest(place, &rest(k), distance))
            .min_by(f64::total_cmp)
            .unwrap_or(0.0)
    }
}
