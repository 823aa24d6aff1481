//! To the pose that is worth its way: much of the frontier seen, at a short way (thesis 6.5.1.4, after Gonzalez-Banos and Latombe).

use elk_geometry::Voxel;
use elk_mission::{AppType, Kind, ParamSpec, joined};

use super::candidates::{Candidates, SEED, Weight};
use crate::app::{COMMON, app, param};
use crate::journal::Journal;
use crate::strategy::{Route, Strategy, View};
use crate::ways::Lengths;

/// Its row in the table of explorers.
pub const TYPE: AppType = AppType {
    element: "Explorer",
    name: "WeightedInformationGain",
    summary: "Of poses drawn by lot goes to the one that sees most frontier voxels for its way, by A*.",
    params: &joined::<{ COMMON.len() + PARAMS.len() }>(COMMON, PARAMS),
    build: |params| {
        // The table keeps the seed from being negative.
        let seed = params.integer("Seed") as u64;
        app(params, Box::new(WeightedInformationGain::new(seed, params.number("Lambda"))))
    },
    preflight: None,
};

const PARAMS: &[ParamSpec] = &[
    SEED,
    param(
        "Lambda",
        Kind::Number { unit: "1/m", min: 0.0, max: 100.0 },
        "0.2",
        "How much less a view is worth for each metre of way to it (thesis 6.41): exp(-Lambda way).",
    ),
];

/// Goes to the candidate pose q of the largest g(q) = A(q) exp(−λ L(q)) (thesis 6.41, 2.18), A being the frontier voxels that it
/// sees, and L the way to it (m); of equals to the first by the order of its voxel. Where none sees anything it has no answer.
#[derive(Debug, Clone)]
pub struct WeightedInformationGain {
    candidates: Candidates,
    /// λ (1/m).
    lambda: f64,
}

impl WeightedInformationGain {
    /// What is drawn by lot follows from `seed`; `lambda` is λ (1/m).
    pub fn new(seed: u64, lambda: f64) -> Self {
        Self { candidates: Candidates::new(seed), lambda }
    }
}

/// exp(−λ L) (6.41).
struct Discount<'v, 'a> {
    lengths: &'v mut Lengths<'a>,
    /// λ (1/m).
    lambda: f64,
}

/// What a frontier voxel is worth that is seen at the end of `way_m` of way, at `lambda` (1/m).
fn discounted(lambda: f64, way_m: f64) -> f64 {
    (-lambda * way_m).exp()
}

impl Weight for Discount<'_, '_> {
    fn at_most(&self, place: Voxel) -> f64 {
        discounted(self.lambda, self.lengths.at_least_m(place))
    }

    fn of(&mut self, place: Voxel) -> Option<f64> {
        Some(discounted(self.lambda, self.lengths.to_m(place)?))
    }
}

impl Strategy for WeightedInformationGain {
    fn name(&self) -> &'static str {
        "WeightedInformationGain"
    }

    fn describe(&self) -> String {
        format!("seed {}, lambda {} 1/m", self.candidates.seed(), self.lambda)
    }

    fn plan(&mut self, view: &View<'_>, journal: &mut Journal) -> Option<Route> {
        let (candidates, mut looks, mut lengths) = (&mut self.candidates, 0, view.lengths());
        let mut discount = Discount { lengths: &mut lengths, lambda: self.lambda };
        let best = journal.time("gain", || candidates.best(view, &mut looks, &mut discount));
        journal.count("looks", looks);
        journal.count("searches", lengths.searches());
        let best = best?;
        journal.time("search", || lengths.route_by(best.place, best.goal))
    }
}

#[cfg(test)]
mod tests {
    use super::super::candidates::every;
    use super::*;
    use crate::{InformationGain, Room};

    /// 20 frontier voxels at 6 m against one at 0.5 m, as by hand: 20 e^(-6λ) = e^(-0.5λ) where λ = ln 20 / 5.5 = 0.54.
    #[test]
    fn how_far_it_goes_for_more_is_lambdas_business() {
        let near = |lambda: f64| discounted(lambda, 0.5) > 20.0 * discounted(lambda, 6.0);
        assert!(!near(0.54) && near(0.55));
    }

    /// Ten frontier voxels in a row 6.5 m away, and one 0.7 m beside the robot. With λ = 0 the way counts for nothing: it goes where
    /// most is seen, as does who has no λ, and that is the row. With λ = 5 a metre of way costs a factor of 150, and all eleven
    /// 2 m away are worth less than the near one where the robot is: 11 e⁻¹⁰ < 1.
    #[test]
    fn on_a_map_made_by_hand_it_chooses_as_by_hand() {
        let row = (0..10).map(|k| [7.55, 0.55 + 0.1 * f64::from(k), 1.25]);
        let goals: Vec<[f64; 3]> = std::iter::once([0.5, 1.5, 1.25]).chain(row).collect();
        let room = Room::new([8.0, 3.0, 2.5], [1.05, 1.05, 1.25], &goals);
        for seed in 0..5 {
            let route = |strategy: &mut dyn Strategy| strategy.plan(&room.view(), &mut Journal::new(|| 0.0)).unwrap();
            let weighted = |lambda| route(&mut WeightedInformationGain::new(seed, lambda));
            let drawn = every(&room.view(), seed);
            assert!(drawn.iter().any(|looked| looked.gain >= 10));
            assert_eq!(weighted(0.0).points.last(), route(&mut InformationGain::new(seed)).points.last());
            let points = weighted(5.0).points;
            let length: f64 = points.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum();
            assert!(length < 2.0, "{length} m");
        }
    }
}
