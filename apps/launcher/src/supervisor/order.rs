//! The order in which a mission's apps are stopped.

use elk_mission::element;

/// The place of an element in the order of stopping: who commands ends before who obeys, the logger hears them all.
fn stop_rank(element: &str) -> usize {
    const ORDER: [&str; 7] = [
        element::CONTROLLER,
        element::EXPLORER,
        element::MAP,
        element::FILTER,
        element::SENSOR,
        element::APP,
        element::LOGGER,
    ];
    ORDER.iter().position(|other| *other == element).unwrap_or(ORDER.len())
}

/// Numbers of `elements` in the order of stopping; of several filters the last one ends first.
pub(crate) fn stop_order<'a>(elements: impl Iterator<Item = &'a str>) -> Vec<usize> {
    let mut order: Vec<(usize, usize)> = elements.map(stop_rank).zip(0..).collect();
    order.sort_by_key(|(rank, number)| (*rank, std::cmp::Reverse(*number)));
    order.into_iter().map(|(_, number)| number).collect()
}

#[cfg(test)]
mod tests {
    use super::stop_order;

    #[test]
    fn who_commands_ends_before_who_obeys_and_the_logger_is_last() {
        let elements = ["Logger", "Sensor", "Filter", "Filter", "Map", "App", "Controller", "Explorer"];
        assert_eq!(stop_order(elements.into_iter()), [6, 7, 4, 3, 2, 1, 5, 0]);
    }
}
