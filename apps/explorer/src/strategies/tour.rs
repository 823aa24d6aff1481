//! A tour past all that is left to be seen, planned anew with each plan (after FUEL, Zhou et al., RA-L 2021, and FALCON, Zhang et
//! al., T-RO 2024).
//!
//! As there, the frontier is grouped, each group has viewpoints from which it is seen, and the robot goes on to the first stop of
//! the shortest tour past all groups. Otherwise than there, groups are the cells of an octree (as in Dai et al., ICRA 2020), the
//! smaller the nearer, and as small as can be afforded: near the robot, and everywhere in the end, single voxels. So the tour knows of
//! the least thing that is left near by, and does not come back for it. A stop is for all groups that are seen from it; and its place
//! is chosen with the tour, so that what can be seen in passing costs a detour, and no way of its own.

mod itinerary;
mod roadmap;

use std::collections::{BTreeMap, BTreeSet};

use elk_geometry::Voxel;
use elk_geometry::bricks::brick_of;
use elk_mission::AppType;
use nalgebra::Point3;

use super::groups::{Group, VIEW_M, groups, in_sight};
use crate::app::{COMMON, app};
use crate::journal::Journal;
use crate::pictures;
use crate::strategy::{Route, Strategy, View};
use itinerary::itinerary;
use roadmap::{LATTICE, Roadmap};

/// Its row in the table of explorers.
pub const TYPE: AppType = AppType {
    element: "Explorer",
    name: "Tour",
    summary: "Goes along the shortest tour past all that is left to be seen, seeing in passing what it can.",
    params: COMMON,
    build: |params| app(params, Box::new(Tour)),
    preflight: None,
};

/// Groups of targets that a tour is made of at most, unless they are too far apart for that.
const MOST_GROUPS: usize = 64;
/// So many targets in a brick (8³ voxels) are much to be seen.
const MUCH: usize = 24;
/// As long as there is much to be seen anywhere, little is only seen to if it is so near (m).
const LITTLE_NEAR_M: f64 = 3.0;
/// Farther away than this viewpoints lie in a lattice twice as wide (m).
const NEAR_M: f64 = 2.0;

/// Goes to the first stop of the shortest tour that it finds.
#[derive(Debug, Clone, Copy, Default)]
pub struct Tour;

/// A place to look from.
#[derive(Debug, Clone, Copy)]
struct Place {
    voxel: Voxel,
    position: Point3<f64>,
    /// Way to it from where the route starts (m).
    way_m: f64,
}

impl Strategy for Tour {
    fn name(&self) -> &'static str {
        "Tour"
    }

    fn looks_from_afar(&self) -> bool {
        true
    }

    fn plan(&mut self, view: &View<'_>, journal: &mut Journal) -> Option<Route> {
        if let Some(goal) = journal.time("views", || in_sight(view)) {
            return Some(Route { points: vec![view.from], goal });
        }
        let groups = worthwhile(view, groups(view, MOST_GROUPS));
        let roadmap = journal.time("roadmap", || Roadmap::new(view.space, view.space.start()));
        let (places, sets) = journal.time("views", || viewpoints(view, &groups, &roadmap));
        journal.count("groups", groups.len() as u64);
        let goal = |group: usize| groups[group].goal.unwrap_or(groups[group].target.voxel);
        // What is seen from here costs no way.
        if let Some(group) = sets.iter().position(|set| set.contains(&0)) {
            return Some(Route { points: vec![view.from], goal: goal(group) });
        }
        let stops = journal.time("tour", || itinerary(0, &sets, |a, b| distance(&places[a], &places[b])));
        let place = |place: usize| places[place].position;
        journal.draw(|| pictures::tour(std::iter::once(0).chain(stops.iter().map(|stop| stop.place)).map(place)));
        let first = stops.first()?;
        let group = *first.sets.first()?;
        journal.time("search", || view.way_by(places[first.place].voxel, goal(group)))
    }
}

/// A bound on the way between two places (m): the straight line, and what is left of the one's way at the end of the other's.
fn distance(one: &Place, other: &Place) -> f64 {
    (one.position - other.position).norm().max((one.way_m - other.way_m).abs())
}

/// Those groups that the tour is to lead past: as long as there is much to be seen anywhere, what is little is left for later unless it
/// is near. Behind much there may be more, from where the little is seen in passing.
fn worthwhile<'a>(view: &View<'a>, mut groups: Vec<Group<'a>>) -> Vec<Group<'a>> {
    let near = view.goals.iter().map(|goal| goal.target.voxel);
    let targets: BTreeSet<Voxel> = view.open.iter().map(|target| target.voxel).chain(near).collect();
    let mut counts: BTreeMap<Voxel, usize> = BTreeMap::new();
    targets.iter().for_each(|target| *counts.entry(brick_of(*target)).or_default() += 1);
    let is_much = |group: &Group<'_>| counts.get(&brick_of(group.target.voxel)).is_some_and(|count| *count >= MUCH);
    if groups.iter().any(is_much) {
        let away_m = |group: &Group<'_>| group.target.voxel.distance(view.space.start()) * view.space.resolution();
        groups.retain(|group| is_much(group) || away_m(group) < LITTLE_NEAR_M);
    }
    groups
}

/// Places to look from, the first of them where the route starts, and those from which each group is seen.
fn viewpoints(view: &View<'_>, groups: &[Group<'_>], roadmap: &Roadmap<'_>) -> (Vec<Place>, Vec<Vec<usize>>) {
    let (space, resolution) = (view.space, view.space.resolution());
    let place = |voxel: Voxel| Place { voxel, position: space.center(voxel), way_m: roadmap.length_m(voxel) };
    let mut places = vec![Place { voxel: space.start(), position: view.from, way_m: 0.0 }];
    places.extend(roadmap.nodes().iter().copied().map(place));
    let (lattice, range_m) = (places.len(), VIEW_M.min(view.sight.range_m));
    let is_wide = |voxel: Voxel| voxel.to_array().iter().all(|c| c.rem_euclid(2 * LATTICE) == 0);
    let mut sets = Vec::new();
    for Group { target, goal, .. } in groups {
        let center = target.voxel.center(resolution);
        let sees = |place: &Place| {
            let away = (place.position - center).norm();
            away <= range_m && (away <= NEAR_M || is_wide(place.voxel)) && target.seen_from(space, place.position)
        };
        let mut set: Vec<usize> = (0..lattice).filter(|k| sees(&places[*k])).collect();
        if let Some(goal) = *goal {
            set.push(places.len());
            places.push(place(goal));
        }
        sets.push(set);
    }
    (places, sets)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ClosestFrontier, Room};

    /// A hall 40 m long, seen along from x = 8 m. To the right the next goal comes into sight after 0.45 m, and more behind it up to
    /// 34 m; to the left there is one, after 0.6 m. Right first costs 21.4 m there, and as much back.
    #[test]
    fn the_short_end_comes_first_though_the_other_is_closer() {
        let goals = [13.45, 20.05, 27.05, 34.05, 2.45].map(|x| [x, 1.55, 1.25]);
        let room = Room::new([40.0, 3.0, 2.5], [8.05, 1.55, 1.25], &goals);
        assert_eq!(room.choice(&mut ClosestFrontier), Some(0));
        assert_eq!(room.choice(&mut Tour), Some(4));
    }

    #[test]
    fn what_is_seen_from_here_is_looked_at_from_here() {
        let room = Room::new([8.0, 3.0, 2.5], [1.05, 1.55, 1.25], &[[7.55, 1.55, 1.25], [3.05, 1.55, 1.25]]);
        let route = Tour.plan(&room.view(), &mut Journal::new(|| 0.0)).unwrap();
        assert_eq!((route.points.len(), room.choice(&mut Tour)), (1, Some(1)));
    }

    #[test]
    fn many_targets_are_few_groups_and_few_are_one_each() {
        let goals = |count: u32| -> Vec<[f64; 3]> {
            (0..count).map(|k| [0.55 + 0.1 * f64::from(k % 70), 0.55 + 0.1 * f64::from(k / 70), 1.25]).collect()
        };
        let groups_of =
            |count| groups(&Room::new([8.0, 3.0, 2.5], [4.05, 2.55, 1.25], &goals(count)).view(), MOST_GROUPS).len();
        assert_eq!(groups_of(MOST_GROUPS as u32), MOST_GROUPS);
        let many = groups_of(1000);
        assert!(many <= MOST_GROUPS && many > MOST_GROUPS / 8, "{many}");
    }

    /// To the left a goal comes into sight after 0.5 m, to the right a wall after 1.6 m: of four voxels, or of 256.
    #[test]
    fn little_is_left_for_later_where_there_is_much() {
        let choice = |edge: u32| {
            let place = |k: u32| [12.55, 0.75 + 0.1 * f64::from(k % edge), 0.55 + 0.1 * f64::from(k / edge)];
            let goals: Vec<[f64; 3]> = std::iter::once([0.45, 1.55, 1.25]).chain((0..edge * edge).map(place)).collect();
            Room::new([13.0, 3.0, 2.5], [5.95, 1.55, 1.25], &goals).choice(&mut Tour)
        };
        assert_eq!(choice(2), Some(0));
        assert!(choice(16).is_some_and(|goal| goal > 0));
    }

    /// A wall of 700 targets 6 m away and three near the robot, 0.1 m from each other: those are groups of their own.
    #[test]
    fn what_is_left_near_by_is_a_group_of_its_own() {
        let wall = (0..700).map(|k| [7.05, 0.55 + 0.1 * f64::from(k % 35), 0.35 + 0.1 * f64::from(k / 35)]);
        let near = [[1.25, 2.55, 1.25], [1.35, 2.55, 1.25], [1.35, 2.65, 1.25]];
        let goals: Vec<[f64; 3]> = wall.chain(near).collect();
        let room = Room::new([8.0, 5.0, 2.9], [1.05, 2.05, 1.25], &goals);
        let view = room.view();
        let groups = groups(&view, MOST_GROUPS);
        let is_near = |group: &&Group<'_>| group.target.voxel.x < 20;
        assert_eq!(groups.iter().filter(is_near).count(), near.len());
        assert!(groups.len() <= MOST_GROUPS && groups.len() > near.len() + 3, "{}", groups.len());
    }
}
