//! An app's parameters, after every check: what an app is built from.

use std::collections::BTreeMap;

/// An app's parameters, checked against its type's table: every parameter has a value of its kind.
///
/// The getters panic when asked for a parameter that the type's table does not have, or has with another kind: that is a
/// mistake in the program, which no mission file can bring about.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Params {
    pub(crate) values: BTreeMap<&'static str, ParamValue>,
}

/// A checked value.
#[derive(Debug, Clone, PartialEq)]
pub enum ParamValue {
    /// Of [`Kind::Number`](crate::Kind::Number).
    Number(f64),
    /// Of [`Kind::Integer`](crate::Kind::Integer).
    Integer(i64),
    /// Of [`Kind::Flag`](crate::Kind::Flag).
    Flag(bool),
    /// Of [`Kind::Point`](crate::Kind::Point).
    Point([f64; 3]),
    /// Of the kinds that are text.
    Text(String),
}

impl Params {
    /// The value of a [`Kind::Number`](crate::Kind::Number), in the unit of its table.
    #[track_caller]
    pub fn number(&self, name: &str) -> f64 {
        match self.value(name) {
            ParamValue::Number(value) => *value,
            other => mismatch(name, "a number", other),
        }
    }

    /// The value of a [`Kind::Integer`](crate::Kind::Integer).
    #[track_caller]
    pub fn integer(&self, name: &str) -> i64 {
        match self.value(name) {
            ParamValue::Integer(value) => *value,
            other => mismatch(name, "a whole number", other),
        }
    }

    /// The value of a [`Kind::Flag`](crate::Kind::Flag).
    #[track_caller]
    pub fn flag(&self, name: &str) -> bool {
        match self.value(name) {
            ParamValue::Flag(value) => *value,
            other => mismatch(name, "a flag", other),
        }
    }

    /// The value of a [`Kind::Point`](crate::Kind::Point): x, y, z in the unit of its table.
    #[track_caller]
    pub fn point(&self, name: &str) -> [f64; 3] {
        match self.value(name) {
            ParamValue::Point(value) => *value,
            other => mismatch(name, "a point", other),
        }
    }

    /// The value of a choice, text, variable or file. A file is a path that can be opened from the working directory.
    #[track_caller]
    pub fn text(&self, name: &str) -> &str {
        match self.value(name) {
            ParamValue::Text(value) => value,
            other => mismatch(name, "text", other),
        }
    }

    #[track_caller]
    fn value(&self, name: &str) -> &ParamValue {
        match self.values.get(name) {
            Some(value) => value,
            None => panic!("the app type's table has no parameter {name:?}"),
        }
    }
}

#[track_caller]
fn mismatch(name: &str, asked: &str, found: &ParamValue) -> ! {
    panic!("the app type's table does not have {name:?} as {asked}: it is {found:?}")
}
