//! An explorer of one's own: it goes where the way is short and leads neither up nor down.
//! `elk swap Explorer exec=./target/release/level Climb=2` puts it into a running mission.

use elk_explorer::{Journal, Kind, ParamSpec, Route, Strategy, View};

const PARAMS: &[ParamSpec] = &[ParamSpec {
    name: "Climb",
    kind: Kind::Number { unit: "", min: 0.0, max: 100.0 },
    default: Some("3"),
    doc: "Metres of way that a metre up or down is worth.",
}];

struct Level {
    climb: f64,
}

impl Strategy for Level {
    fn plan(&mut self, view: &View<'_>, journal: &mut Journal) -> Option<Route> {
        view.cheapest(journal, |goal, way_m| way_m + self.climb * (goal.position.z - view.from.z).abs())
    }
}

fn main() -> std::process::ExitCode {
    elk_explorer::main_with(PARAMS, |params| Level { climb: params.number("Climb") })
}
