//! `elk hz` and `elk bw`: how often, and how much.

use std::sync::atomic::AtomicBool;
use std::time::Duration;

use elk_bus::clock::Stopwatch;
use serde_json::{Value, json};

use crate::echo::unwritten;
use crate::error::ScopeError;
use crate::meter::{Count, Meter};
use crate::output::{Line, Output, Table};
use crate::pattern::Pattern;
use crate::quit::Quit;
use crate::session::{LOOK_EVERY, Scope};
use crate::show;

/// Time between two pages.
pub(crate) const PERIOD: Duration = Duration::from_secs(1);

/// What is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// How often: rate, and the spread of the times between messages.
    Rate,
    /// How much: bytes per second, and the sizes.
    Bandwidth,
}

/// What to measure, and for how long.
#[derive(Debug, Clone)]
pub struct Rates {
    /// What is measured.
    pub quantity: Quantity,
    /// The variables.
    pub patterns: Vec<Pattern>,
    /// The figures are over the last so many seconds.
    pub window_secs: usize,
    /// End after so many pages, of which there is one a second.
    pub count: Option<u64>,
    /// Write JSON, an object a page.
    pub json: bool,
}

impl Rates {
    /// Variables that are named and that nobody has written so far: they may come, and may be misspelt.
    pub fn unwritten(&self, scope: &mut Scope) -> Result<Vec<ScopeError>, ScopeError> {
        unwritten(&self.patterns, scope)
    }

    /// Counts, and writes a page a second, until enough are written, or `stop` is set.
    pub fn run(&self, scope: &mut Scope, output: &mut Output<'_>, stop: &AtomicBool) -> Result<(), ScopeError> {
        scope.register(&self.patterns, &Pattern::any())?;
        let mut meter = Meter::new(self.window_secs);
        let (mut pages, mut next, clock) = (0, PERIOD, Stopwatch::start());
        let mut quit = Quit::new(stop, output);
        while !quit.is_asked_for() && self.count.is_none_or(|count| pages < count) {
            let left = next.saturating_sub(clock.elapsed());
            scope.receive(left.min(LOOK_EVERY), |mail| {
                if !mail.is_latest() {
                    meter.take(mail);
                }
            })?;
            if clock.elapsed() >= next {
                meter.tick();
                match self.json {
                    true => output.whole_json(&self.as_json(&meter, scope.client.comms.time(), scope.missed()))?,
                    false => {
                        output.look();
                        let page = self.as_text(&meter, scope.missed(), output.columns());
                        output.page(&page)?;
                    }
                }
                pages += 1;
                // A page that comes late is not made up for.
                next = (next + PERIOD).max(clock.elapsed());
            }
        }
        Ok(())
    }

    fn as_json(&self, meter: &Meter, time: f64, missed: u64) -> Value {
        let secs = meter.ticks() as f64 * PERIOD.as_secs_f64();
        let sources: Vec<Value> = meter.counts().map(|one| self.pair_as_json(secs, one)).collect();
        json!({"time": time, "window_secs": secs, "missed": missed, "sources": sources})
    }

    fn as_text(&self, meter: &Meter, missed: u64, columns: Option<usize>) -> Vec<Line> {
        let secs = meter.ticks() as f64 * PERIOD.as_secs_f64();
        let head: &[&str] = match self.quantity {
            Quantity::Rate => &["VARIABLE", "SOURCE", "MESSAGES", "RATE", "MIN", "MEAN", "MAX", "STD"],
            Quantity::Bandwidth => &["VARIABLE", "SOURCE", "MESSAGES", "BANDWIDTH", "MIN", "MEAN", "MAX"],
        };
        let mut rows = vec![head.iter().map(ToString::to_string).collect::<Vec<_>>()];
        rows.extend(meter.counts().map(|one| self.row(secs, one)));
        let mut lines = match rows.len() {
            1 => vec![format!("nothing was said in {secs} s").into()],
            _ => Table { rows, right: &[2, 3, 4, 5, 6, 7], spare: &[2, 7, 4, 6, 5], ..Table::default() }.lines(columns),
        };
        if missed > 0 {
            lines.push(format!("… {missed} messages missed: more is said than this command can read").into());
        }
        lines
    }

    fn row(&self, secs: f64, (key, source, count): (&str, &str, Count)) -> Vec<String> {
        let mut row = vec![key.to_owned(), source.to_owned(), count.sizes.count.to_string()];
        let known = |count: u64, figure: String| if count > 0 { figure } else { "-".to_owned() };
        match self.quantity {
            Quantity::Rate => {
                let times = count.intervals;
                let figures = [times.min, times.mean, times.max, times.deviation()];
                row.push(match silence(&count) {
                    Some(secs) => format!("silent {}", show::duration(secs)),
                    None => known(count.sizes.count, show::hertz(rate(secs, &count))),
                });
                row.extend(figures.map(|secs| known(times.count, show::duration(secs))));
            }
            Quantity::Bandwidth => {
                let sizes = count.sizes;
                row.push(match silence(&count) {
                    Some(secs) => format!("silent {}", show::duration(secs)),
                    None => format!("{}/s", show::bytes(sizes.sum() / secs)),
                });
                row.extend([sizes.min, sizes.mean, sizes.max].map(|size| known(sizes.count, show::bytes(size))));
            }
        }
        row
    }

    fn pair_as_json(&self, secs: f64, (key, source, count): (&str, &str, Count)) -> Value {
        let mut json = json!({"key": key, "source": source, "messages": count.sizes.count});
        let silence = silence(&count);
        json["silent_secs"] = silence.map_or(Value::Null, Value::from);
        let known = |count: u64, figure: f64| if count > 0 { json!(figure) } else { Value::Null };
        let now = |figure: f64| json!(if silence.is_some() { 0.0 } else { figure });
        match self.quantity {
            Quantity::Rate => {
                let times = count.intervals;
                json["rate_hz"] = now(rate(secs, &count));
                json["min_secs"] = known(times.count, times.min);
                json["mean_secs"] = known(times.count, times.mean);
                json["max_secs"] = known(times.count, times.max);
                json["std_secs"] = known(times.count, times.deviation());
            }
            Quantity::Bandwidth => {
                let sizes = count.sizes;
                json["bytes_per_sec"] = now(sizes.sum() / secs);
                json["min_bytes"] = known(sizes.count, sizes.min);
                json["mean_bytes"] = known(sizes.count, sizes.mean);
                json["max_bytes"] = known(sizes.count, sizes.max);
            }
        }
        json
    }
}

/// How long a source has said nothing (s), if that is longer than it ever waited twice within the window: whoever has
/// stopped has no rate any more.
fn silence(count: &Count) -> Option<f64> {
    let secs = count.silent as f64 * PERIOD.as_secs_f64();
    let expected = if count.intervals.count > 0 { 2.0 * count.intervals.max } else { 0.0 };
    (secs > expected && (count.intervals.count > 0 || count.sizes.count == 0)).then_some(secs)
}

/// Messages per second. While a source goes on, the times between its messages say it best; a source that has said one
/// message in the window has its share of the window.
fn rate(secs: f64, count: &Count) -> f64 {
    match count.intervals.count {
        0 => count.sizes.count as f64 / secs,
        _ => 1.0 / count.intervals.mean.max(1e-9),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured(quantity: Quantity) -> (Vec<Line>, Value) {
        let mut meter = Meter::new(10);
        for i in 0..5 {
            meter.count("SCAN", "Sensor", 0.25 * f64::from(i), 1000);
        }
        meter.count("ONCE", "Map", 1.0, 8);
        meter.tick();
        let patterns = vec![Pattern::any()];
        let rates = Rates { quantity, patterns, window_secs: 10, count: None, json: false };
        (rates.as_text(&meter, 7, None), rates.as_json(&meter, 2.0, 7))
    }

    #[test]
    fn rates_are_shown_by_source_with_the_spread_of_the_times_between() {
        let (page, json) = measured(Quantity::Rate);
        assert_eq!(
            page,
            [
                "VARIABLE  SOURCE  MESSAGES     RATE     MIN    MEAN     MAX   STD",
                "ONCE      Map            1  1.00 Hz       -       -       -     -",
                "SCAN      Sensor         5  4.00 Hz  250 ms  250 ms  250 ms  0 µs",
                "… 7 messages missed: more is said than this command can read",
            ]
        );
        assert_eq!((&json["sources"][1]["rate_hz"], &json["missed"]), (&json!(4.0), &json!(7)));
        assert_eq!(json["sources"][0]["mean_secs"], Value::Null);
    }

    #[test]
    fn whoever_has_stopped_has_no_rate_any_more() {
        let mut meter = Meter::new(10);
        for i in 0..10 {
            meter.count("FAST", "cam", 0.1 * f64::from(i), 8);
            meter.count("SLOW", "map", 5.0 * f64::from(i), 8);
        }
        let rates =
            |quantity| Rates { quantity, patterns: vec![Pattern::any()], window_secs: 10, count: None, json: false };
        meter.tick();
        assert!(rates(Quantity::Rate).as_text(&meter, 0, None)[1].text.contains("10.0 Hz"));
        meter.tick();
        let (page, json) =
            (rates(Quantity::Rate).as_text(&meter, 0, None), rates(Quantity::Rate).as_json(&meter, 2.0, 0));
        assert!(page[1].text.starts_with("FAST") && page[1].text.contains("silent 1.00 s"), "{page:?}");
        assert_eq!((&json["sources"][0]["rate_hz"], &json["sources"][0]["silent_secs"]), (&json!(0.0), &json!(1.0)));
        assert!(page[2].text.starts_with("SLOW") && !page[2].text.contains("silent"), "it may yet come: {page:?}");
        assert!(rates(Quantity::Bandwidth).as_text(&meter, 0, None)[1].text.contains("silent"));
        let json = rates(Quantity::Bandwidth).as_json(&meter, 2.0, 0);
        assert_eq!(json["sources"][0]["bytes_per_sec"], 0.0, "as many as the table for people says: {json}");
        assert_eq!(json["sources"][1]["bytes_per_sec"], 40.0, "{json}");
        (0..12).for_each(|_| meter.tick());
        assert!(rates(Quantity::Rate).as_text(&meter, 0, None)[1].text.contains("silent 13.0 s"), "and still");
    }

    #[test]
    fn bandwidth_is_bytes_of_values_over_the_window() {
        let (page, json) = measured(Quantity::Bandwidth);
        assert_eq!(page[2], "SCAN      Sensor         5  5.00 kB/s  1.00 kB  1.00 kB  1.00 kB");
        assert_eq!(json["sources"][1]["bytes_per_sec"], 5000.0);
    }
}
