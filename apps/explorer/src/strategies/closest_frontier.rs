//! Always to the closest frontier (thesis 6.5.1.2, after Yamauchi 1997).

use elk_mission::AppType;

use crate::app::{COMMON, app};
use crate::journal::Journal;
use crate::pictures;
use crate::strategy::{Route, Strategy, View};

/// Its row in the table of explorers.
pub const TYPE: AppType = AppType {
    element: "Explorer",
    name: "ClosestFrontier",
    summary: "Goes to the closest frontier, by A*.",
    params: COMMON,
    build: |params| app(params, Box::new(ClosestFrontier)),
    preflight: None,
};

/// Goes to the goal with the shortest way.
#[derive(Debug, Clone, Copy, Default)]
pub struct ClosestFrontier;

impl Strategy for ClosestFrontier {
    fn name(&self) -> &'static str {
        "ClosestFrontier"
    }

    fn plan(&mut self, view: &View<'_>, journal: &mut Journal) -> Option<Route> {
        let route = view.closest(journal);
        journal.draw(|| pictures::search(view, route.as_ref()));
        route
    }
}
