//! One parameter of an app: what it may be, in what unit, and what it is when nobody says it.

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
    /// One of these words, of which all but the first have a meaning only beside another parameter.
    Refinement {
        /// The words; the first is that for nothing.
        words: &'static [&'static str],
        /// The other parameter, a [`Kind::Choice`], whose word for nothing is the first as well.
        of: &'static str,
    },
    /// Any text.
    Text,
    /// The name of a variable of the community.
    Variable,
    /// A file to read, relative to the mission file, or below a variable of the environment: `$ELK_DATA/house.obj`. A name in `builtin` stands for itself.
    File {
        /// Names that are no files but built into the program.
        builtin: &'static [&'static str],
        /// Whether it has to be there whenever the parameter is read. If not, the app looks for it when it needs it.
        at_once: bool,
    },
}

/// Two tables of parameters as one: those of one type, and those that all types of its element share. `N` is the length of
/// both together.
pub const fn joined<const N: usize>(one: &[ParamSpec], other: &[ParamSpec]) -> [ParamSpec; N] {
    assert!(one.len() + other.len() == N);
    let mut all = [ParamSpec { name: "", kind: Kind::Flag, default: None, doc: "" }; N];
    let mut i = 0;
    while i < N {
        all[i] = if i < one.len() { one[i] } else { other[i - one.len()] };
        i += 1;
    }
    all
}
