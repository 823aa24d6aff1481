//! Figures of several turns, and the table that they end in.

use std::collections::BTreeMap;

/// The figures of a turn, by name.
pub type Figures = BTreeMap<&'static str, f64>;

/// A figure that a table shows.
pub struct Column {
    /// The figure's name.
    pub figure: &'static str,
    /// Over the column, with its unit.
    pub heading: &'static str,
    /// Digits after the point.
    pub digits: usize,
}

/// Shorthand for a [`Column`].
pub const fn column(figure: &'static str, heading: &'static str, digits: usize) -> Column {
    Column { figure, heading, digits }
}

/// What the first column's figure is wanted to be.
#[derive(Debug, Clone, Copy)]
pub enum Wanted {
    /// Nothing: the row is there to compare with.
    Nothing,
    /// The figure itself, at most.
    AtMost(f64),
    /// The figure itself, at least.
    AtLeast(f64),
    /// The first row's figure, at most so many times this row's.
    RatioAtMost(f64),
}

/// What was measured, and in several turns.
pub struct Row {
    /// What was measured.
    title: String,
    /// What is wanted of it.
    wanted: Wanted,
    /// Its turns.
    pub turns: Vec<Figures>,
}

impl Row {
    /// A row without turns yet.
    pub fn new(title: impl Into<String>, wanted: Wanted) -> Self {
        Self { title: title.into(), wanted, turns: Vec::new() }
    }

    /// The sorted values of a figure, one a turn.
    fn values(&self, figure: &str) -> Vec<f64> {
        let mut values: Vec<f64> = self.turns.iter().filter_map(|turn| turn.get(figure).copied()).collect();
        values.sort_by(f64::total_cmp);
        values
    }

    /// The least and the most that a figure was.
    fn range(&self, column: &Column) -> String {
        let values = self.values(column.figure);
        let ends = values.first().zip(values.last());
        ends.map_or(String::new(), |(low, high)| format!("{low:.d$} … {high:.d$}", d = column.digits))
    }
}

/// The middle of sorted values; NaN if there are none.
pub fn median(sorted: &[f64]) -> f64 {
    let half = sorted.len() / 2;
    match (sorted.get(half), sorted.len() % 2) {
        (Some(upper), 0) => (sorted[half - 1] + upper) / 2.0,
        (Some(middle), _) => *middle,
        (None, _) => f64::NAN,
    }
}

/// Prints figures that have bars of their own and nothing beside them: the turns' median, and their range.
pub fn list(title: &str, rows: &[(Row, Column)]) {
    println!("\n## {title}\n\n| {:26} | {:>12} | {:>19} | wanted", "", "median", "range");
    println!("|{:-<28}|{:->13}:|{:->20}:|---", "", "", "");
    for (row, column) in rows {
        let (value, digits) = (median(&row.values(column.figure)), column.digits);
        let (range, verdict) = (row.range(column), wanted(row.wanted, value, f64::NAN));
        println!(
            "| {:26} | {value:>12.digits$} | {range:>19} | {verdict}",
            format!("{}, {}", row.title, column.heading)
        );
    }
}

/// Prints a comparison: medians over turns, the first column's range, and its ratio, first row over each other row.
pub fn print(title: &str, columns: &[Column], rows: &[Row]) {
    let Some((lead, first)) = columns.first().zip(rows.first()) else {
        return;
    };
    let turns = rows.iter().map(|r| r.turns.len()).max().unwrap_or(0);
    println!("\n## {title}\nmedian of {turns} turns; range and ratio are those of the first column\n");
    let headings: String = columns.iter().map(|c| format!(" {:>12} |", c.heading)).collect();
    println!("| {:26} |{headings} {:>19} | {:>9} | wanted", "", "range", "elk : row");
    let lines: String = columns.iter().map(|_| "-------------:|").collect();
    println!("|{:-<28}|{lines}{:->20}:|{:->10}:|---", "", "", "");
    let own = median(&first.values(lead.figure));
    for (number, row) in rows.iter().enumerate() {
        let ratio = (number > 0).then(|| own / median(&row.values(lead.figure)));
        println!("{}", line(columns, lead, row, ratio));
    }
}

fn line(columns: &[Column], lead: &Column, row: &Row, ratio: Option<f64>) -> String {
    let cell = |column: &Column| match median(&row.values(column.figure)) {
        value if value.is_nan() => format!(" {:>12} |", ""),
        value => format!(" {value:>12.digits$} |", digits = column.digits),
    };
    let cells: String = columns.iter().map(cell).collect();
    let range = row.range(lead);
    let shown = ratio.map_or(String::new(), |r| format!("{r:.2}"));
    let wanted = wanted(row.wanted, median(&row.values(lead.figure)), ratio.unwrap_or(f64::NAN));
    format!("| {:26} |{cells} {range:>19} | {shown:>9} | {wanted}", row.title)
}

fn wanted(wanted: Wanted, value: f64, ratio: f64) -> String {
    let (text, met) = match wanted {
        Wanted::Nothing => return String::new(),
        Wanted::AtMost(bar) => (format!("≤ {bar}"), value <= bar),
        Wanted::AtLeast(bar) => (format!("≥ {bar}"), value >= bar),
        Wanted::RatioAtMost(bar) => (format!("ratio ≤ {bar:.2}"), ratio <= bar),
    };
    format!("{text}: {}", if met { "met" } else { "MISSED" })
}
