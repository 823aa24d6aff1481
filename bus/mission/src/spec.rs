//! The table of app types: what a mission file may say, in what units, and what it means when it says nothing.

use elk_bus::{App, AppError};

use crate::params::Params;
use crate::preflight::Preflight;

/// One type of app, as it is offered to mission files and to `elk types`.
pub struct AppType {
    /// The element that names it in a mission file: `Sensor`, `Filter`, `Map`, `Explorer`, `Controller`, `Logger`.
    pub element: &'static str,
    /// The value of the element's `type` attribute.
    pub name: &'static str,
    /// One sentence for people.
    pub summary: &'static str,
    /// Its parameters.
    pub params: &'static [ParamSpec],
    /// Makes the app from checked parameters; what the parameters cannot show (a file that does not parse) is an error.
    pub build: fn(&Params) -> Result<Box<dyn App>, AppError>,
    /// Looks at what an app needs before a mission is started; `None`: it is enough that it can be built.
    pub preflight: Option<Preflight>,
}

/// One parameter of an app type.
#[derive(Debug, Clone, Copy)]
pub struct ParamSpec {
    /// Its element's name in the mission file.
    pub name: &'static str,
    /// What it may be.
    pub kind: Kind,
    /// What it is if the mission does not say; `None`: it must be said.
    pub default: Option<&'static str>,
    /// What it means, in one sentence.
    pub doc: &'static str,
}

/// What a parameter may be.
#[derive(Debug, Clone, Copy)]
pub enum Kind {
    /// A number in `min..=max`, in `unit` (`m`, `rad`, `deg`, `s`, `Hz`, `px`, or empty).
    Number {
        /// The unit.
        unit: &'static str,
        /// The smallest value allowed.
        min: f64,
        /// The largest value allowed.
        max: f64,
    },
    /// A whole number in `min..=max`.
    Integer {
        /// The smallest value allowed.
        min: i64,
        /// The largest value allowed.
        max: i64,
    },
    /// `true` or `false`.
    Flag,
    /// Three numbers separated by semicolons: `x; y; z`, in `unit`.
    Point {
        /// The unit.
        unit: &'static str,
    },
    /// The edges of a box, as a point: all positive, or all 0 for none.
    Size {
        /// The unit.
        unit: &'static str,
    },
    /// One of these words.
    Choice(&'static [&'static str]),
    /// Any text.
    Text,
    /// The name of a variable of the community.
    Variable,
    /// A file to read, relative to the mission file; must exist. A name in `builtin` stands for itself.
    File {
        /// Names that are no files but built into the program.
        builtin: &'static [&'static str],
    },
}

/// Two tables of parameters as one: those of one type, and those that all types of its element share. `N` is the length of
/// both together.
pub const fn joined<const N: usize>(one: &[ParamSpec], other: &[ParamSpec]) -> [ParamSpec; N] {
    assert!(one.len() + other.len() == N);
    let mut all = [MOOS_HOST; N];
    let mut i = 0;
    while i < N {
        all[i] = if i < one.len() { one[i] } else { other[i - one.len()] };
        i += 1;
    }
    all
}

const FOR_MOOS: &str = "Accepted for MOOS' sake, without effect: the broker is found by the community's name.";

/// Where MOOS would look for its database.
pub const MOOS_HOST: ParamSpec =
    ParamSpec { name: "MOOSHost", kind: Kind::Text, default: Some("localhost"), doc: FOR_MOOS };

/// The port that MOOS would use.
pub const MOOS_PORT: ParamSpec =
    ParamSpec { name: "MOOSPort", kind: Kind::Integer { min: 1, max: 65_535 }, default: Some("9000"), doc: FOR_MOOS };
