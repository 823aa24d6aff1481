//! Short open tours past stops: the travelling salesman's problem without a way back, by local moves.

/// Less than this is no shorter.
const LEAST: f64 = 1e-6;
/// Stops in the longest stretch that is moved.
const LONGEST_STRETCH: usize = 3;

/// Tries all local moves of an open tour from `start` past `stops` once, and makes those by which it becomes shorter: stretches are
/// turned round (2-opt, Croes 1958) or put in elsewhere (Or-opt, Or 1976). `place` says where a stop is, `distance` how far it is
/// between two places, the same there and back. Answers whether the tour is shorter; if it is, trying again may help.
pub fn shorten<T>(
    start: usize,
    stops: &mut Vec<T>,
    place: impl Fn(&T) -> usize,
    distance: impl Fn(usize, usize) -> f64,
) -> bool {
    let mut tour = Tour { start, stops, place, distance };
    tour.turn_round() | tour.move_stretches()
}

struct Tour<'a, T, P, D> {
    start: usize,
    stops: &'a mut Vec<T>,
    place: P,
    distance: D,
}

impl<T, P: Fn(&T) -> usize, D: Fn(usize, usize) -> f64> Tour<'_, T, P, D> {
    /// The place before stop `k`.
    fn before(&self, k: usize) -> usize {
        k.checked_sub(1).map_or(self.start, |k| (self.place)(&self.stops[k]))
    }

    fn place(&self, k: usize) -> Option<usize> {
        self.stops.get(k).map(&self.place)
    }

    /// Length of the leg between two places, if there is one.
    fn leg(&self, from: usize, to: Option<usize>) -> f64 {
        to.map_or(0.0, |to| (self.distance)(from, to))
    }

    fn turn_round(&mut self) -> bool {
        let mut shorter = false;
        for i in 0..self.stops.len() {
            for j in i + 1..self.stops.len() {
                let (before, after) = (self.before(i), self.place(j + 1));
                let [first, last] = [i, j].map(|k| (self.place)(&self.stops[k]));
                let now = self.leg(before, Some(first)) + self.leg(last, after);
                if self.leg(before, Some(last)) + self.leg(first, after) < now - LEAST {
                    self.stops[i..=j].reverse();
                    shorter = true;
                }
            }
        }
        shorter
    }

    fn move_stretches(&mut self) -> bool {
        let mut shorter = false;
        for length in 1..=LONGEST_STRETCH {
            for i in 0..(self.stops.len() + 1).saturating_sub(length) {
                shorter |= self.move_stretch(i, length);
            }
        }
        shorter
    }

    fn move_stretch(&mut self, i: usize, length: usize) -> bool {
        let [first, last] = [i, i + length - 1].map(|k| (self.place)(&self.stops[k]));
        let (before, after) = (self.before(i), self.place(i + length));
        let saved = self.leg(before, Some(first)) + self.leg(last, after) - self.leg(before, after);
        let stretch: Vec<T> = self.stops.drain(i..i + length).collect();
        let cost = |k: usize| {
            let (from, to) = (self.before(k), self.place(k));
            self.leg(from, Some(first)) + self.leg(last, to) - self.leg(from, to)
        };
        let best = (0..=self.stops.len()).map(|k| (cost(k), k)).min_by(|a, b| a.0.total_cmp(&b.0));
        let (k, moved) = best.filter(|(cost, _)| *cost < saved - LEAST).map_or((i, false), |(_, k)| (k, true));
        self.stops.splice(k..k, stretch);
        moved
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// Tours past six places in a plane, drawn by lot: no move makes one longer, no stop is lost, and at last they are a twentieth
    /// longer on average than the best of all orders at most.
    #[test]
    fn tours_become_nearly_as_short_as_any() {
        let (mut found, mut least) = (0.0, 0.0);
        for k in 0..200 {
            let mut random = Random::new(2, k);
            let at: Vec<[f64; 2]> = (0..7).map(|_| [(); 2].map(|()| random.between(0.0, 9.0))).collect();
            let distance = |a: usize, b: usize| (at[a][0] - at[b][0]).hypot(at[a][1] - at[b][1]);
            let length = |stops: &[usize]| {
                let legs = std::iter::once(0).chain(stops.iter().copied()).zip(stops);
                legs.map(|(from, to)| distance(from, *to)).sum::<f64>()
            };
            let mut stops: Vec<usize> = (1..7).collect();
            loop {
                let before = length(&stops);
                let shorter = shorten(0, &mut stops, |stop| *stop, distance);
                assert_eq!(shorter, length(&stops) < before - LEAST / 2.0);
                if !shorter {
                    break;
                }
            }
            let mut sorted = stops.clone();
            sorted.sort_unstable();
            assert_eq!(sorted, [1, 2, 3, 4, 5, 6]);
            found += length(&stops);
            least += shortest(0, &[1, 2, 3, 4, 5, 6], &distance);
        }
        assert!(least <= found && found < 1.05 * least, "{found} for {least}");
    }

    /// The shortest of all tours, by trying all.
    fn shortest(from: usize, stops: &[usize], distance: &dyn Fn(usize, usize) -> f64) -> f64 {
        let by = |stop: usize| {
            let rest: Vec<usize> = stops.iter().copied().filter(|other| *other != stop).collect();
            distance(from, stop) + shortest(stop, &rest, distance)
        };
        stops.iter().map(|stop| by(*stop)).min_by(f64::total_cmp).unwrap_or(0.0)
    }
}
