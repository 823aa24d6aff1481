//! Those who carry out a mission: a broker and apps, whether they are processes or threads.

use elk_bus::Client;

use crate::error::LaunchError;

/// A broker and the apps of a mission.
pub(crate) trait Crew {
    /// Starts the broker and joins its community under `name`.
    fn start_broker(&mut self, name: &str) -> Result<Client, LaunchError>;

    /// Starts the apps whose elements `which` chooses; answers their names.
    fn start_apps(&mut self, which: &dyn Fn(&str) -> bool) -> Result<Vec<String>, LaunchError>;

    /// Sees that everyone who was started is still there. Whoever may be started again is; anyone else's end is the
    /// mission's.
    fn check(&mut self, when: &'static str) -> Result<(), LaunchError>;

    /// Ends the apps, in the order in which nobody misses anybody. Answers what there is to complain about.
    fn stop_apps(&mut self) -> Vec<String>;

    /// Ends the broker, once nobody needs it any more.
    fn stop_broker(&mut self) -> Vec<String>;
}

/// The place of an element in the order of stopping: who commands ends before who obeys, the logger hears them all.
pub(crate) fn stop_rank(element: &str) -> usize {
    const ORDER: [&str; 7] = ["Controller", "Explorer", "Map", "Filter", "Sensor", "App", "Logger"];
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
