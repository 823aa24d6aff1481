//! Whether a field's number is in its range.

use serde_json::{Number, Value};

use crate::description::{Field, Kind};
use crate::json::float;
use crate::range::Range;

impl Field {
    /// This number, or one that it may be, if it may not be this one.
    pub(crate) fn or_within_range(&self, value: Value) -> Value {
        if self.may_be(&value) {
            return value;
        }
        let less = |end: &Number| match end.as_i64() {
            Some(end) => Number::from(end.saturating_sub(1)),
            None => end.as_f64().and_then(|end| Number::from_f64(end - 1.0)).unwrap_or(end.clone()),
        };
        let Range { least, most, below } = &self.range;
        let end = least.clone().or_else(|| most.clone()).or_else(|| below.as_ref().map(less));
        end.map_or(value, Value::Number)
    }

    /// Whether its number may be this one. What is no number, as an option without a value, is in any range.
    pub(crate) fn may_be(&self, value: &Value) -> bool {
        let Range { least, most, below } = &self.range;
        let Value::Number(number) = value else {
            // Infinities and NaN, as texts, are in no range.
            return self.range.is_all() || float(value).is_none();
        };
        let is_single = matches!(innermost(&self.kind), Kind::Float(4));
        let is_at_most = |one: &Number, other: &Number| match (one.as_i128(), other.as_i128()) {
            (Some(one), Some(other)) => one <= other,
            _ if is_single => one.as_f64().map(|one| one as f32) <= other.as_f64().map(|other| other as f32),
            _ => one.as_f64() <= other.as_f64(),
        };
        least.as_ref().is_none_or(|least| is_at_most(least, number))
            && most.as_ref().is_none_or(|most| is_at_most(number, most))
            && below.as_ref().is_none_or(|below| !is_at_most(below, number))
    }
}

/// The kind of the number of which a field's range is.
fn innermost(kind: &Kind) -> &Kind {
    match kind.plain() {
        Kind::Option(inner) => innermost(inner),
        kind => kind,
    }
}
