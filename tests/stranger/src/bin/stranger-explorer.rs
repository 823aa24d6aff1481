//! A strategy of somebody else's: it prefers what it has not gone for before, and remembers that.

use elk_explorer::elk_geometry::Voxel;
use elk_explorer::{DecodeError, Journal, Kind, LeaveError, ParamSpec, Route, Strategy, StrategyMemory, View, payload};

const PARAMS: &[ParamSpec] = &[ParamSpec {
    name: "Boredom",
    kind: Kind::Number { unit: "m", min: 0.0, max: 100.0 },
    default: Some("0.5"),
    doc: "Length of way that it goes to see something else than what it went for before.",
}];

/// Targets that are remembered.
const MOST: usize = 32;

/// What it went for.
#[payload]
#[derive(Debug, Clone, Default, PartialEq)]
struct Been {
    /// Plans made, by itself and by those before it.
    #[describe(count)]
    plans: u64,
    /// The last targets.
    #[describe(longest = MOST)]
    targets: Vec<Voxel>,
}

struct Magpie {
    boredom: f64,
    been: Been,
}

impl Strategy for Magpie {
    fn describe(&self) -> String {
        format!("{} m for something new", self.boredom)
    }

    fn plan(&mut self, view: &View<'_>, journal: &mut Journal) -> Option<Route> {
        let known = |target: Voxel| self.been.targets.contains(&target);
        let cost =
            |goal: &elk_explorer::Goal, way_m: f64| way_m + if known(goal.target.voxel) { self.boredom } else { 0.0 };
        let route = view.cheapest(journal, cost)?;
        let target = view.goals.at(route.goal)?.target.voxel;
        journal.count("revisits", u64::from(known(target)));
        self.been.plans += 1;
        self.been.targets.push(target);
        let old = self.been.targets.len().saturating_sub(MOST);
        self.been.targets.drain(..old);
        Some(route)
    }

    fn memory(&self) -> Result<Option<StrategyMemory>, LeaveError> {
        StrategyMemory::of::<Been>(&self.been).map(Some)
    }

    fn recall(&mut self, left: &StrategyMemory) -> Result<(), DecodeError> {
        self.been = left.take::<Been>()?;
        Ok(())
    }
}

fn main() -> std::process::ExitCode {
    elk_explorer::main_with(PARAMS, |params| Magpie { boredom: params.number("Boredom"), been: Been::default() })
}
