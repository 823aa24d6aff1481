//! Counts what each source writes to each variable, over the last seconds. Values are counted where they lie and never
//! decoded.

use std::collections::{BTreeMap, VecDeque};

use elk_bus::Mail;

use crate::spread::Spread;

/// What one source wrote to one variable.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Count {
    /// Times between one message and the next (s, the publisher's clock).
    pub intervals: Spread,
    /// Lengths of the values (bytes).
    pub sizes: Spread,
    /// Whole ticks since the last message.
    pub silent: usize,
}

/// One source of one variable.
#[derive(Debug, Default)]
struct Pair {
    /// When the last message was published (s).
    last: Option<f64>,
    now: Count,
    /// Ticks since a message came.
    silent: usize,
    /// What was counted between earlier ticks, the newest last.
    before: VecDeque<Count>,
}

/// Counts by variable and source.
#[derive(Debug)]
pub struct Meter {
    window: usize,
    ticks: usize,
    pairs: Vec<Pair>,
    /// Where in `pairs` each variable's sources are.
    places: BTreeMap<String, BTreeMap<String, usize>>,
}

impl Meter {
    /// A meter over the last `window` ticks.
    pub fn new(window: usize) -> Self {
        Self { window: window.max(1), ticks: 0, pairs: Vec::new(), places: BTreeMap::new() }
    }

    /// Counts a message.
    pub fn take(&mut self, mail: &Mail<'_>) {
        self.count(mail.key(), mail.source(), mail.time(), mail.value().byte_len());
    }

    /// Counts a message of `bytes` that was published at `time` (s).
    pub fn count(&mut self, key: &str, source: &str, time: f64, bytes: usize) {
        let place = self.place(key, source);
        let pair = &mut self.pairs[place];
        if let Some(last) = pair.last.replace(time) {
            pair.now.intervals.note(time - last);
        }
        pair.now.sizes.note(bytes as f64);
    }

    fn place(&mut self, key: &str, source: &str) -> usize {
        if let Some(place) = self.places.get(key).and_then(|sources| sources.get(source)) {
            return *place;
        }
        self.pairs.push(Pair::default());
        let place = self.pairs.len() - 1;
        self.places.entry(key.to_owned()).or_default().insert(source.to_owned(), place);
        place
    }

    /// Ends a tick: what was counted before the window is forgotten.
    pub fn tick(&mut self) {
        self.ticks += 1;
        for pair in &mut self.pairs {
            pair.silent = if pair.now.sizes.count == 0 { pair.silent + 1 } else { 0 };
            pair.before.push_back(std::mem::take(&mut pair.now));
            if pair.before.len() > self.window {
                pair.before.pop_front();
            }
        }
    }

    /// Ticks that the counts are of.
    pub fn ticks(&self) -> usize {
        self.ticks.min(self.window)
    }

    /// All pairs with their counts over the window, by variable and source.
    pub fn counts(&self) -> impl Iterator<Item = (&str, &str, Count)> {
        self.places.iter().flat_map(|(key, sources)| {
            let over_the_window = |place: &usize| self.pairs[*place].over_the_window();
            sources.iter().map(move |(source, place)| (key.as_str(), source.as_str(), over_the_window(place)))
        })
    }
}

impl Pair {
    fn over_the_window(&self) -> Count {
        let none = Count { silent: self.silent, ..Count::default() };
        self.before.iter().fold(none, |mut all, part| {
            all.intervals.merge(&part.intervals);
            all.sizes.merge(&part.sizes);
            all
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_source_is_counted_by_itself_and_what_is_older_than_the_window_is_forgotten() {
        let mut meter = Meter::new(2);
        for (tick, times) in [[0.0, 0.1], [0.3, 0.4], [0.8, 0.9]].iter().enumerate() {
            for time in times {
                meter.count("X", "a", *time, 10 * (tick + 1));
            }
            meter.count("X", "b", times[0], 1);
            meter.tick();
        }
        let counts: Vec<_> = meter.counts().collect();
        assert_eq!((counts.len(), meter.ticks()), (2, 2));
        let (key, source, count) = counts[0];
        assert_eq!((key, source, count.sizes.count, count.sizes.min, count.sizes.max), ("X", "a", 4, 20.0, 30.0));
        assert_eq!(count.intervals.count, 4, "0.2, 0.1, 0.4 and 0.1 s");
        assert!((count.intervals.max - 0.4).abs() < 1e-12 && (count.intervals.mean - 0.2).abs() < 1e-12);
        meter.tick();
        meter.tick();
        assert!(meter.counts().all(|(_, _, count)| count == Count { silent: 2, ..Count::default() }));
    }
}
