//! All app types that come with elk.

use elk_mission::Registry;

/// The tables of all apps, in the order in which a step passes through them.
pub fn registry() -> Registry {
    Registry::new(&[
        elk_sensor::TYPES,
        elk_filter::TYPES,
        elk_map_app::TYPES,
        elk_explorer::TYPES,
        elk_controller::TYPES,
        elk_logger::TYPES,
    ])
}
