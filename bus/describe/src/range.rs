//! What a number may be, where that is said as two numbers.

use std::fmt::{self, Display};

use serde::{Deserialize, Serialize};
use serde_json::Number;

use crate::json::shortest;
use crate::shape::{DefaultValue, Limit, RangeShape, Shape};

/// What a field's number may be. Of a field without a range nothing is said.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Range {
    /// The least that it may be.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub least: Option<Number>,
    /// The most that it may be.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub most: Option<Number>,
    /// What it has to be less than.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub below: Option<Number>,
}

impl Range {
    pub(crate) fn of(range: &RangeShape, shape: &Shape) -> Self {
        let number = |limit: Option<Limit>| limit.and_then(|limit| limit.to_number(shape));
        Self { least: number(range.least), most: number(range.most), below: number(range.below) }
    }

    /// Whether nothing is said.
    pub fn is_all(&self) -> bool {
        *self == Self::default()
    }
}

/// As people say it.
impl Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let said = |number: &Option<Number>| number.as_ref().map(plain);
        f.write_str(&words(said(&self.least), said(&self.most), said(&self.below)))
    }
}

/// A number as Rust writes it: 10 for 10.0.
fn plain(number: &Number) -> String {
    match (number.as_i128(), number.as_f64()) {
        (None, Some(float)) => float.to_string(),
        _ => number.to_string(),
    }
}

/// A range in words.
pub fn words<T: Display>(least: Option<T>, most: Option<T>, below: Option<T>) -> String {
    match (least, most, below) {
        (Some(least), Some(most), _) => format!("{least} to {most}"),
        (Some(least), None, Some(end)) => format!("{least} to less than {end}"),
        (Some(least), None, None) => format!("at least {least}"),
        (None, Some(most), _) => format!("at most {most}"),
        (None, None, Some(end)) => format!("less than {end}"),
        (None, None, None) => "anything".to_owned(),
    }
}

impl Limit {
    /// The end of a range of numbers of such a shape, which is written as the one or the other.
    pub const fn of(shape: &Shape, float: f64, integer: i128) -> Option<Self> {
        match shape {
            Shape::Float(_) if float.is_finite() => Some(Self::Float(float)),
            Shape::Float(_) => None,
            Shape::Unsigned(_) | Shape::Signed(_) => Some(Self::Integer(integer)),
            Shape::Unnamed(one) => Self::of(&one.shape, float, integer),
            _ => panic!("a range is of a number"),
        }
    }

    const fn float(self) -> f64 {
        match self {
            Self::Integer(number) => number as f64,
            Self::Float(number) => number,
        }
    }

    fn to_number(self, shape: &Shape) -> Option<Number> {
        match self {
            Self::Integer(number) => Number::from_i128(number),
            Self::Float(number) if matches!(shape, Shape::Float(4)) => Number::from_f64(shortest(number as f32)),
            Self::Float(number) => Number::from_f64(number),
        }
    }
}

/// A field's range and default, if there are numbers in the one and the other is in it; else its type does not compile.
pub const fn range_with(range: RangeShape, shape: &Shape, default: &Option<DefaultValue>) -> RangeShape {
    let single = matches!(shape, Shape::Float(4));
    if let Some(least) = range.least {
        let holds_least = RangeShape { least: None, ..range };
        assert!(is_in(&holds_least, least, single), "the field's range is empty");
    }
    let default = match default {
        Some(DefaultValue::Zero) => Limit::Integer(0),
        Some(DefaultValue::Integer(number)) => Limit::Integer(*number),
        Some(DefaultValue::Float(number)) => Limit::Float(*number),
        _ => return range,
    };
    let is_number = matches!(shape, Shape::Float(_) | Shape::Unsigned(_) | Shape::Signed(_));
    assert!(!is_number || is_in(&range, default, single), "the default is out of the field's range");
    range
}

const fn is_in(range: &RangeShape, number: Limit, single: bool) -> bool {
    let least = match range.least {
        Some(least) => is_at_most(least, number, single),
        None => true,
    };
    let most = match range.most {
        Some(most) => is_at_most(number, most, single),
        None => true,
    };
    let below = match range.below {
        Some(below) => !is_at_most(below, number, single),
        None => true,
    };
    least && most && below
}

const fn is_at_most(one: Limit, other: Limit, single: bool) -> bool {
    match (one, other) {
        (Limit::Integer(one), Limit::Integer(other)) => one <= other,
        _ if single => one.float() as f32 <= other.float() as f32,
        _ => one.float() <= other.float(),
    }
}
