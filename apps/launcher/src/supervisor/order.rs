//! The order in which a mission's apps are stopped.

use elk_mission::element;

/// Numbers of `elements` in the order of stopping; of several filters the last one ends first.
pub(crate) fn stop_order<'a>(elements: impl Iterator<Item = &'a str>) -> Vec<usize> {
    let rank = |element: &str| element::named(element).map_or(u8::MAX, |element| element.stop_rank);
    let mut order: Vec<(u8, usize)> = elements.map(rank).zip(0..).collect();
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
