//! The elements of a Scenario: what an app can be, how many of each there are, and who starts and stops before whom.

/// Where depth comes from.
pub const SENSOR: &str = "Sensor";
/// What to leave out of a scan.
pub const FILTER: &str = "Filter";
/// What is known of the world.
pub const MAP: &str = "Map";
/// Where to go next. A recording goes where it went, and a mission that plays one has none.
pub const EXPLORER: &str = "Explorer";
/// How to get there.
pub const CONTROLLER: &str = "Controller";
/// What was said.
pub const LOGGER: &str = "Logger";
/// Anything else, which may end of its own accord.
pub const APP: &str = "App";

/// An element.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Element {
    /// Its name, as mission files say it.
    pub name: &'static str,
    /// How many apps of it a mission has.
    pub count: Count,
    /// Its rank in the order of starting; those of one rank start together.
    pub start_rank: u8,
    /// Its rank in the order of stopping.
    pub stop_rank: u8,
    /// Whether an app of it may end of its own accord: a program of somebody else's may have done all that it was there for.
    pub may_finish: bool,
    /// A mission that does not speak of it has the registry's first type of it; `type="none"` says that there is none.
    pub supposed: bool,
}

/// How many apps of an element a mission has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Count {
    /// One, neither more nor less.
    One,
    /// One or none.
    AtMostOne,
    /// As many as it likes.
    Any,
}

/// All elements, in the order in which a step passes through them. Who commands ends before who obeys; the logger is there
/// before anybody has anything to say, and hears them all to the end.
pub static ELEMENTS: [Element; 7] = [
    row(SENSOR, Count::One, 4),
    row(FILTER, Count::Any, 3),
    row(MAP, Count::One, 2),
    row(EXPLORER, Count::AtMostOne, 1),
    row(CONTROLLER, Count::One, 0),
    Element { start_rank: 0, supposed: true, ..row(LOGGER, Count::AtMostOne, 6) },
    Element { may_finish: true, ..row(APP, Count::Any, 5) },
];

const fn row(name: &'static str, count: Count, stop_rank: u8) -> Element {
    Element { name, count, start_rank: 1, stop_rank, may_finish: false, supposed: false }
}

/// The element of this name.
pub fn named(name: &str) -> Option<&'static Element> {
    ELEMENTS.iter().find(|element| element.name == name)
}
