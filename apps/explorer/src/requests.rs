//! Requests for a plan that wait for the map that they are about.

use std::collections::BTreeMap;

use elk_spatial::checks::MAX_REVISIONS_AHEAD;
use elk_spatial::messages::PlanRequest;

/// Clients that may wait for a plan at once.
pub const MOST_ASKERS: usize = 8;

/// The requests that wait, by who asks: nobody can take back what another one has asked.
#[derive(Debug, Default)]
pub struct Requests(BTreeMap<String, PlanRequest>);

/// A request, and who asks it.
pub type Asked = (String, PlanRequest);

impl Requests {
    /// Lets `asker` wait with `request`, instead of with what it asked before; the map is at `revision`.
    ///
    /// Only so many can wait. The one that goes is the one that would wait longest: whoever has the map asks about the next
    /// revisions of it, so nobody loses that place to others who make up later ones.
    ///
    /// Answers the request that has no place now, if there is one: that of another asker, while this one waits, or this one.
    pub fn add(&mut self, asker: &str, request: PlanRequest, revision: u64) -> Option<Asked> {
        let new = asker.to_owned();
        if self.0.len() < MOST_ASKERS || self.0.contains_key(asker) {
            self.0.insert(new, request);
            return None;
        }
        let waits = |request: &PlanRequest| if is_outdated(request, revision) { u64::MAX } else { request.revision };
        let longest = self.0.iter().max_by_key(|(_, other)| waits(other));
        let Some(longest) = longest.filter(|(_, other)| waits(other) > waits(&request)) else {
            return Some((new, request));
        };
        let pushed_out = (longest.0.clone(), longest.1.clone());
        self.0.remove(&pushed_out.0);
        self.0.insert(new, request);
        Some(pushed_out)
    }

    /// Takes out the requests that a map at `revision` is there for. One that is outdated goes on waiting: perhaps it is
    /// right, and the map is none.
    pub fn take_due(&mut self, revision: u64) -> Vec<PlanRequest> {
        let is_due = |request: &PlanRequest| request.revision <= revision && !is_outdated(request, revision);
        let all = std::mem::take(&mut self.0).into_iter();
        let (due, later): (BTreeMap<_, _>, _) = all.partition(|(_, request)| is_due(request));
        self.0 = later;
        due.into_values().collect()
    }
}

/// Whoever asks has the map, too: one that is far ahead of the request is not the map that it is about.
fn is_outdated(request: &PlanRequest, revision: u64) -> bool {
    request.revision + MAX_REVISIONS_AHEAD < revision
}

#[cfg(test)]
mod tests {
    use elk_geometry::Pose;
    use elk_spatial::messages::Outcome;
    use nalgebra::Point3;

    use super::*;

    fn of(revision: u64) -> PlanRequest {
        let pose = Pose::from_yaw_pitch(Point3::origin(), 0.0, 0.0);
        PlanRequest { id: 1, pose, revision, outcome: Outcome::First }
    }

    fn full(revision: u64) -> Requests {
        let mut requests = Requests::default();
        (0..MOST_ASKERS).for_each(|n| assert_eq!(requests.add(&format!("liar {n}"), of(revision), 2), None));
        requests
    }

    /// Regression: eight requests of a revision that never came, and nobody else was given a plan.
    #[test]
    fn whoever_makes_up_revisions_takes_no_place_from_who_has_the_map() {
        let mut requests = full(900);
        let (pushed_out, _) = requests.add("Controller", of(3), 2).unwrap();
        assert_eq!(pushed_out, "liar 7", "the one that goes is named");
        for revision in [900, 901] {
            assert_eq!(requests.add("another", of(revision), 2), Some(("another".into(), of(revision))), "first come");
        }
        assert_eq!(requests.take_due(3), [of(3)]);
    }

    /// Regression: they held their places for ever.
    #[test]
    fn a_request_that_the_map_has_left_behind_is_the_first_to_go() {
        let (mut requests, far) = (full(3), 4 + MAX_REVISIONS_AHEAD);
        assert_eq!(requests.add("liar 3", of(4), far), None);
        assert_eq!(requests.add("Controller", of(far + 1), far).unwrap().0, "liar 7");
        assert_eq!(requests.take_due(far), [of(4)]);
        assert_eq!(requests.take_due(far + 1), [of(far + 1)]);
        assert_eq!(requests.take_due(3).len(), MOST_ASKERS - 2, "the map was none, and they were right");
    }

    #[test]
    fn an_asker_waits_with_its_last_request() {
        let mut requests = full(900);
        assert_eq!(requests.add("liar 3", of(901), 2), None);
        assert_eq!(requests.take_due(900).len(), MOST_ASKERS - 1);
        assert_eq!(requests.take_due(901), [of(901)]);
    }
}
