use elk_geometry::ray::Traversal;

use super::super::groups::VIEW_M;
use super::*;
use crate::Room;

/// A hall 20 m long with the robot at 8 m: to the left a target comes into sight after 2 m, to the right a row of twenty after 4.5 m.
fn hall() -> Room {
    let row = (0..20).map(|k| [17.55, 0.55 + 0.1 * f64::from(k), 1.25]);
    let goals: Vec<[f64; 3]> = std::iter::once([1.05, 1.55, 1.25]).chain(row).collect();
    Room::new([20.0, 3.0, 2.5], [8.05, 1.55, 1.25], &goals)
}

fn journal() -> Journal {
    Journal::new(|| 0.0)
}

fn planned(settings: Settings, view: &View<'_>) -> (Route, RecedingHorizon) {
    let mut strategy = RecedingHorizon::new(settings);
    (strategy.plan(view, &mut journal()).unwrap(), strategy)
}

fn far_sighted() -> Settings {
    Settings { lambda: 0.1, horizon_m: 8.0, ..Settings::default() }
}

#[test]
fn a_route_stays_within_reach_and_ends_where_its_target_is_seen() {
    let room = hall();
    let view = room.view();
    for seed in 0..8 {
        let (route, _) = planned(Settings { seed, ..far_sighted() }, &view);
        assert!(route.points[0] == view.from && route.points.len() > 1);
        for pair in route.points.windows(2) {
            let mut way = Traversal::new(pair[0], pair[1], view.space.resolution());
            assert!(way.all(|voxel| view.space.reach.contains(voxel)), "{pair:?}");
        }
        let target = &view.goals.at(route.goal).unwrap().target;
        assert!(target.seen_from(view.space, *route.points.last().unwrap()), "{route:?}");
    }
}

#[test]
fn the_same_seed_plans_the_same_and_another_one_something_else() {
    let room = hall();
    let route = |seed: u64| planned(Settings { seed, ..far_sighted() }, &room.view()).0;
    assert_eq!(route(3), route(3));
    assert!((0..5).any(|seed| route(seed) != route(5)));
}

/// Twenty after 4.5 m against one after 2 m, as by hand: 20 e^(-4.5λ) = e^(-2λ) where λ = ln 20 / 2.5 = 1.2.
#[test]
fn how_far_it_goes_for_more_is_lambdas_business() {
    let room = hall();
    let x = |lambda: f64| {
        let (route, _) = planned(Settings { lambda, least_gain: 0.0, ..far_sighted() }, &room.view());
        route.points.last().unwrap().x
    };
    assert!(x(0.1) > 12.0 && x(4.0) < 6.5);
}

#[test]
fn a_place_that_sees_nothing_gains_nothing() {
    let room = hall();
    let view = room.view();
    let groups = groups(&view, MOST_GROUPS);
    let mut prospects = Prospects::new(&view, &groups);
    let mut of = |x: i32| gain(&prospects.seen_from(Voxel::new(x, 15, 12)), &groups);
    // The last one sees the row from 5.5 m, which is farther than a look is trusted.
    assert_eq!([40, 80, 150, 120].map(&mut of), [1.0, 0.0, 20.0, 0.0]);
    assert_eq!(gain(&prospects.seen_from_start(&view), &groups), 0.0);
}

/// As [`Target::seen_from`](crate::Target::seen_from) says, which walks all lines to their ends.
#[test]
fn what_is_seen_is_what_targets_say_that_they_are_seen_from() {
    let room = hall();
    let view = room.view();
    let groups = groups(&view, MOST_GROUPS);
    let mut prospects = Prospects::new(&view, &groups);
    for place in view.space.reach.iter().step_by(37) {
        let from = view.space.center(place);
        let near = |group: &Group<'_>| (view.space.center(group.target.voxel) - from).norm() <= VIEW_M;
        let sees = |group: &Group<'_>| near(group) && group.target.seen_from(view.space, from);
        let expected: Vec<usize> = (0..groups.len()).filter(|group| sees(&groups[*group])).collect();
        assert_eq!(prospects.seen_from(place).iter().collect::<Vec<_>>(), expected, "{place:?}");
    }
}

#[test]
fn what_a_node_before_sees_is_not_counted_again() {
    let room = hall();
    let view = room.view();
    let groups = groups(&view, MOST_GROUPS);
    let tree = RecedingHorizon::new(far_sighted()).grow(&view);
    let grown = Grown::of(tree, &mut Prospects::new(&view, &groups));
    let (mut seen, mut anew) = (0, 0);
    for node in 0..grown.sighted.len() {
        let branch = grown.tree.branch(node);
        let new: Vec<usize> = branch.iter().flat_map(|node| grown.new[*node].iter()).collect();
        let mut all: Vec<usize> = branch.iter().flat_map(|node| grown.sighted[*node].iter()).collect();
        (seen, anew) = (seen + all.len(), anew + new.len());
        all.sort_unstable();
        all.dedup();
        let mut once = new.clone();
        once.sort_unstable();
        assert_eq!(once, all, "each once");
    }
    assert!(anew > 0 && seen > anew, "{seen} {anew}");
}

#[test]
fn the_rest_of_the_branch_is_in_the_next_tree() {
    let room = hall();
    let view = room.view();
    let (route, strategy) = planned(far_sighted(), &view);
    let branch = strategy.kept.branch.clone();
    assert!(branch.len() >= route.points.len() - 1 && branch.len() > 2, "{branch:?}");
    let next = View { plan: 2, ..view };
    let has_all = |strategy: &RecedingHorizon| {
        let tree = strategy.grow(&next);
        branch.iter().all(|voxel| tree.nodes().iter().any(|node| node.voxel == *voxel))
    };
    assert!(has_all(&strategy) && !has_all(&RecedingHorizon::new(far_sighted())));
}

/// From the one place the target is to be seen, from the other there is nothing to be seen any more.
#[test]
fn where_nothing_is_near_it_goes_to_the_closest_place_that_is_kept_and_still_sees_something() {
    let room = hall();
    let view = room.view();
    let near_sighted = Settings { horizon_m: 0.5, ..Settings::default() };
    let (closest, mut strategy) = planned(near_sighted, &view);
    assert_eq!(Some(closest), view.closest(&mut journal()), "nothing is kept");
    let [sees, is_blind] = [Voxel::new(50, 15, 12), Voxel::new(75, 15, 12)];
    strategy.kept.places = [sees, is_blind].map(|voxel| Place { voxel, gain: 7.0 }).to_vec();
    let route = strategy.plan(&view, &mut journal()).unwrap();
    assert_eq!(route.points.last(), Some(&view.space.center(sees)));
    assert_eq!(view.goals.at(route.goal).unwrap().target.voxel, Voxel::new(10, 15, 12));
    let left: Vec<(Voxel, f64)> = strategy.kept.places.iter().map(|place| (place.voxel, place.gain)).collect();
    assert_eq!(left, [(sees, 1.0)]);
}

#[test]
fn what_it_leaves_is_what_the_next_one_goes_on_from() {
    let room = hall();
    let (_, mut strategy) = planned(far_sighted(), &room.view());
    strategy.kept.places = vec![Place { voxel: Voxel::new(50, 15, 12), gain: 7.0 }];
    let left = strategy.memory().unwrap().unwrap();
    let mut next = RecedingHorizon::new(far_sighted());
    next.recall(&left).unwrap();
    assert_eq!(next.kept, strategy.kept);
    let view = View { plan: 2, ..room.view() };
    let [alone, exchanged] = [strategy, next].map(|mut one| one.plan(&view, &mut journal()));
    assert_eq!(alone, exchanged);
}

#[test]
fn its_defaults_are_those_of_the_table() {
    let number = |name: &str| PARAMS.iter().find(|param| param.name == name).unwrap().default.unwrap().parse::<f64>();
    let Settings { seed, lambda, horizon_m, edge_m, nodes, least_gain } = Settings::default();
    let own = [seed as f64, lambda, horizon_m, edge_m, nodes as f64, least_gain];
    assert_eq!(["Seed", "Lambda", "Horizon", "Edge", "Nodes", "LeastGain"].map(|name| number(name).unwrap()), own);
}
