//! From the text of a parameter to its checked value.

use std::num::IntErrorKind;
use std::path::Path;

use crate::kind::Kind;
use crate::nearest::instead;
use crate::params::ParamValue;

/// The longest name of a variable (bytes).
const LONGEST_VARIABLE: usize = 256;

/// What is wrong with a parameter's text: what was found, and what would be right.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{found}; {right}")]
pub struct ValueError {
    found: String,
    right: String,
}

impl ValueError {
    pub(crate) fn new(found: String, right: String) -> Self {
        Self { found, right }
    }

    /// A word would be right, too.
    pub(crate) fn or(self, word: &str) -> Self {
        Self { right: format!("{}, or {word}", self.right), ..self }
    }
}

impl Kind {
    /// Checks a text. A relative file is looked for in `folder`.
    ///
    /// # Errors
    /// What was found and what would be right.
    pub fn parse(&self, text: &str, folder: &Path) -> Result<ParamValue, ValueError> {
        let text = text.trim();
        match self {
            Kind::Number { unit, min, max } => number(text, unit, *min, *max, self).map(ParamValue::Number),
            Kind::Integer { min, max } => integer(text, *min, *max, self).map(ParamValue::Integer),
            Kind::Flag => flag(text, self).map(ParamValue::Flag),
            Kind::Point { unit } => point(text, unit, self).map(ParamValue::Point),
            Kind::Size { unit } => size(text, unit, self).map(ParamValue::Point),
            Kind::Choice(words) | Kind::Refinement { words, .. } => choice(text, words),
            Kind::Text => Ok(ParamValue::Text(text.to_owned())),
            Kind::Variable => variable(text, self),
            Kind::File { builtin, at_once } => file(text, builtin, *at_once, folder),
        }
    }

    /// What may be written, for people: `a number from 0 to 1, in m`.
    pub fn expected(&self) -> String {
        match self {
            Kind::Number { unit, min, max } => {
                format!("a number{}{}", range(*min, *max), in_unit(unit))
            }
            Kind::Integer { min, max } => {
                let bound = |value: i64| match value {
                    i64::MIN => f64::NEG_INFINITY,
                    i64::MAX => f64::INFINITY,
                    value => value as f64,
                };
                format!("a whole number{}", range(bound(*min), bound(*max)))
            }
            Kind::Flag => "true or false".to_owned(),
            Kind::Point { unit } => format!("three numbers \"x; y; z\"{}", in_unit(unit)),
            Kind::Size { unit } => format!("three numbers \"x; y; z\"{}, all positive or all 0", in_unit(unit)),
            Kind::Choice(words) => format!("one of {}", words.join(", ")),
            Kind::Refinement { words, of } => {
                format!("one of {}; all but {} only with a {of}", words.join(", "), words.first().unwrap_or(&""))
            }
            Kind::Text => "any text".to_owned(),
            Kind::Variable => "the name of a variable (no space, comma, '*' or '?')".to_owned(),
            Kind::File { builtin: [], .. } => "a file".to_owned(),
            Kind::File { builtin, .. } => format!("a file, or built in: {}", builtin.join(", ")),
        }
    }
}

fn wrong(found: impl Into<String>, right: &Kind) -> ValueError {
    ValueError { found: found.into(), right: format!("right is {}", right.expected()) }
}

fn range(min: f64, max: f64) -> String {
    match (min.is_finite(), max.is_finite()) {
        (true, true) => format!(" from {min} to {max}"),
        (true, false) => format!(" of at least {min}"),
        (false, true) => format!(" of at most {max}"),
        (false, false) => String::new(),
    }
}

fn in_unit(unit: &str) -> String {
    match unit {
        "" => String::new(),
        unit => format!(", in {unit}"),
    }
}

fn number(text: &str, unit: &str, min: f64, max: f64, kind: &Kind) -> Result<f64, ValueError> {
    let value = quantity(text, unit, kind)?;
    match value >= min && value <= max {
        true => Ok(value),
        false => Err(wrong(format!("{text:?} is out of range"), kind)),
    }
}

/// A finite number, alone or followed by `unit`.
fn quantity(text: &str, unit: &str, kind: &Kind) -> Result<f64, ValueError> {
    if let Some(value) = finite(text) {
        return Ok(value);
    }
    let digits = text.trim_end_matches(|c: char| c.is_alphabetic() || "%°/²".contains(c));
    let suffix = &text[digits.len()..];
    match finite(digits.trim_end()) {
        Some(value) if suffix == unit => Ok(value),
        Some(_) if unit.is_empty() => {
            Err(wrong(format!("{text:?} has the unit {suffix}, and this number has none"), kind))
        }
        Some(_) => {
            Err(ValueError { found: format!("{text:?} is in {suffix}"), right: format!("the unit must be {unit}") })
        }
        None => Err(wrong(format!("{text:?} is no number"), kind)),
    }
}

fn finite(text: &str) -> Option<f64> {
    text.parse().ok().filter(|value: &f64| value.is_finite())
}

fn integer(text: &str, min: i64, max: i64, kind: &Kind) -> Result<i64, ValueError> {
    match text.parse::<i64>() {
        Ok(value) if (min..=max).contains(&value) => Ok(value),
        Ok(_) => Err(wrong(format!("{text:?} is out of range"), kind)),
        Err(error) if *error.kind() == IntErrorKind::PosOverflow => {
            Err(wrong(format!("{text:?} is above {}, the largest whole number that is read", i64::MAX), kind))
        }
        Err(error) if *error.kind() == IntErrorKind::NegOverflow => {
            Err(wrong(format!("{text:?} is out of range"), kind))
        }
        Err(_) => Err(wrong(format!("{text:?} is no whole number"), kind)),
    }
}

fn flag(text: &str, kind: &Kind) -> Result<bool, ValueError> {
    match text {
        "true" => Ok(true),
        "false" => Ok(false),
        _ => Err(wrong(format!("{text:?} is neither true nor false"), kind)),
    }
}

fn point(text: &str, unit: &str, kind: &Kind) -> Result<[f64; 3], ValueError> {
    let values = text.split(';').map(|part| quantity(part.trim(), unit, kind)).collect::<Result<Vec<f64>, _>>()?;
    let count = values.len();
    values.try_into().map_err(|_| {
        let noun = if count == 1 { "number" } else { "numbers" };
        wrong(format!("{text:?} has {count} {noun}"), kind)
    })
}

fn size(text: &str, unit: &str, kind: &Kind) -> Result<[f64; 3], ValueError> {
    let size = point(text, unit, kind)?;
    match size.iter().all(|length| *length > 0.0) || size.iter().all(|length| *length == 0.0) {
        true => Ok(size),
        false => Err(wrong(format!("{text:?} is no size"), kind)),
    }
}

fn choice(text: &str, words: &[&str]) -> Result<ParamValue, ValueError> {
    match words.contains(&text) {
        true => Ok(ParamValue::Text(text.to_owned())),
        false => Err(ValueError { found: format!("{text:?} is not offered"), right: instead(text, words) }),
    }
}

fn variable(text: &str, kind: &Kind) -> Result<ParamValue, ValueError> {
    let odd = |c: char| c.is_whitespace() || c.is_control() || ",*?".contains(c);
    match text.is_empty() || text.contains(odd) || text.len() > LONGEST_VARIABLE {
        true => Err(wrong(format!("{text:?} is no name of a variable"), kind)),
        false if is_of_the_broker(text) => {
            let found = format!("{text} is a variable that the broker writes itself, as all of DB_*");
            Err(ValueError { found, right: "right is another name".to_owned() })
        }
        false => Ok(ParamValue::Text(text.to_owned())),
    }
}

fn file(text: &str, builtin: &[&str], at_once: bool, folder: &Path) -> Result<ParamValue, ValueError> {
    if builtin.contains(&text) {
        return Ok(ParamValue::Text(text.to_owned()));
    }
    let path = folder.join(expanded(text)?);
    match !at_once || path.is_file() {
        true => Ok(ParamValue::Text(path.to_string_lossy().into_owned())),
        false if path.is_dir() => {
            Err(ValueError { found: format!("{} is a folder", path.display()), right: "right is a file".to_owned() })
        }
        false if path.exists() => Err(ValueError {
            found: format!("{} is no ordinary file", path.display()),
            right: "right is a file".to_owned(),
        }),
        false => Err(ValueError {
            found: format!("there is no file {}", path.display()),
            right: instead_of_file(text, builtin, &path),
        }),
    }
}

/// A path that may begin with a variable of the environment, as `$ELK_DATA/worlds/house.obj` does; its value is taken from the working
/// directory.
///
/// # Errors
/// There is no such variable.
pub fn expanded(said: &str) -> Result<String, ValueError> {
    let Some(rest) = said.strip_prefix('$') else { return Ok(said.to_owned()) };
    let (name, behind) = rest.split_once('/').map_or((rest, String::new()), |(name, path)| (name, format!("/{path}")));
    match std::env::var(name) {
        Ok(value) if !value.is_empty() => {
            let folder = std::path::absolute(&value).unwrap_or_else(|_| value.into());
            Ok(folder.to_string_lossy().into_owned() + &behind)
        }
        _ => Err(ValueError {
            found: format!("{said}: the variable {name} is not set"),
            right: format!("right is the folder in it that has {}", behind.trim_start_matches('/')),
        }),
    }
}

/// What could have been meant: a built-in name, or a file beside the missing one.
fn instead_of_file(text: &str, builtin: &[&str], path: &Path) -> String {
    let folder = path.parent().unwrap_or(Path::new("."));
    let mut beside: Vec<String> = std::fs::read_dir(folder)
        .into_iter()
        .flatten()
        .flatten()
        .filter_map(|entry| entry.file_name().into_string().ok())
        .collect();
    beside.sort();
    let wanted = path.file_name().map(|name| name.to_string_lossy());
    let near = |wanted: &str| crate::nearest::nearest(wanted, beside.iter().map(String::as_str)).map(str::to_owned);
    match (wanted.and_then(|wanted| near(&wanted)), builtin) {
        (Some(name), _) => format!("did you mean {}?", folder.join(name).display()),
        (None, []) => "files are looked for from the mission file's folder".to_owned(),
        (None, names) => instead(text, names),
    }
}

/// Whether the broker writes a variable itself.
fn is_of_the_broker(name: &str) -> bool {
    name.starts_with("DB_")
}

#[cfg(test)]
mod tests {
    use super::*;

    const LENGTH: Kind = Kind::Number { unit: "m", min: 0.01, max: 1.0 };
    const PLACE: Kind = Kind::Point { unit: "m" };

    fn says(kind: &Kind, text: &str) -> String {
        match kind.parse(text, Path::new(".")) {
            Ok(value) => format!("{value:?}"),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn numbers_with_and_without_their_unit() {
        for good in ["0.1", " 0.1 m ", "0.1m", "1e-1", "1e-1 m"] {
            assert_eq!(says(&LENGTH, good), "Number(0.1)", "{good}");
        }
        assert_eq!(says(&LENGTH, "0.1 cm"), r#""0.1 cm" is in cm; the unit must be m"#);
        let right = "right is a number from 0.01 to 1, in m";
        assert_eq!(says(&LENGTH, "2"), format!(r#""2" is out of range; {right}"#));
        assert_eq!(says(&LENGTH, "ten"), format!(r#""ten" is no number; {right}"#));
        assert_eq!(says(&LENGTH, "NaN"), format!(r#""NaN" is no number; {right}"#));
        assert_eq!(says(&LENGTH, ""), format!(r#""" is no number; {right}"#));
    }

    #[test]
    fn a_number_without_unit_takes_none() {
        let kind = Kind::Number { unit: "", min: 0.0, max: f64::INFINITY };
        assert_eq!(
            says(&kind, "3 m"),
            r#""3 m" has the unit m, and this number has none; right is a number of at least 0"#
        );
    }

    #[test]
    fn points_have_three_numbers() {
        assert_eq!(says(&PLACE, "5.7; 4.3; 4.5"), "Point([5.7, 4.3, 4.5])");
        assert_eq!(says(&PLACE, "-1 m;0;2m"), "Point([-1.0, 0.0, 2.0])");
        assert_eq!(says(&PLACE, "1; 2"), r#""1; 2" has 2 numbers; right is three numbers "x; y; z", in m"#);
        assert_eq!(says(&PLACE, "1, 2, 3"), r#""1, 2, 3" is no number; right is three numbers "x; y; z", in m"#);
        assert_eq!(says(&PLACE, "1; 2 cm; 3"), r#""2 cm" is in cm; the unit must be m"#);
    }

    #[test]
    fn sizes_are_positive_or_none() {
        let size = Kind::Size { unit: "m" };
        assert_eq!(says(&size, "5.7; 4.3 m; 4.5"), "Point([5.7, 4.3, 4.5])");
        assert_eq!(says(&size, "0; 0; 0"), "Point([0.0, 0.0, 0.0])");
        let right = r#"right is three numbers "x; y; z", in m, all positive or all 0"#;
        assert_eq!(says(&size, "1; -2; 3"), format!(r#""1; -2; 3" is no size; {right}"#));
        assert_eq!(says(&size, "1; 0; 3"), format!(r#""1; 0; 3" is no size; {right}"#));
        assert_eq!(says(&size, "1; 2"), format!(r#""1; 2" has 2 numbers; {right}"#));
    }

    #[test]
    fn words_flags_and_whole_numbers() {
        let policy = Kind::Choice(&["elk", "thesis"]);
        assert_eq!(says(&policy, "thesis"), r#"Text("thesis")"#);
        assert_eq!(says(&policy, "tesis"), r#""tesis" is not offered; did you mean thesis?"#);
        assert_eq!(says(&policy, "other"), r#""other" is not offered; known: elk, thesis"#);
        assert_eq!(says(&Kind::Flag, "yes"), r#""yes" is neither true nor false; right is true or false"#);
        let count = Kind::Integer { min: 1, max: i64::MAX };
        assert_eq!(says(&count, "7"), "Integer(7)");
        assert_eq!(
            says(&count, "18446744073709551615"),
            "\"18446744073709551615\" is above 9223372036854775807, the largest whole number that is read; right is a whole \
             number of at least 1"
        );
        assert_eq!(says(&count, "1.5"), r#""1.5" is no whole number; right is a whole number of at least 1"#);
        assert_eq!(
            says(&Kind::Variable, "A B"),
            r#""A B" is no name of a variable; right is the name of a variable (no space, comma, '*' or '?')"#
        );
    }

    #[test]
    fn files_must_exist_or_be_built_in() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("hall.obj"), "").unwrap();
        let shown = folder.path().display();
        let kind = Kind::File { builtin: &["car-interior"], at_once: true };
        let says = |text: &str| match kind.parse(text, folder.path()) {
            Ok(value) => format!("{value:?}"),
            Err(error) => error.to_string(),
        };
        assert_eq!(says("hall.obj"), format!("Text(\"{shown}/hall.obj\")"));
        assert_eq!(says("car-interior"), r#"Text("car-interior")"#);
        assert_eq!(says("hal.obj"), format!("there is no file {shown}/hal.obj; did you mean {shown}/hall.obj?"));
        assert_eq!(says("moon.obj"), format!("there is no file {shown}/moon.obj; known: car-interior"));
        assert_eq!(says("."), format!("{shown}/. is a folder; right is a file"));
        let later = Kind::File { builtin: &["none"], at_once: false };
        let path = |text: &str| later.parse(text, folder.path()).map_err(|error| error.to_string());
        let [moon, none] = [format!("{shown}/moon.obj"), "none".to_owned()].map(|text| Ok(ParamValue::Text(text)));
        assert_eq!([path("moon.obj"), path("none")], [moon, none], "looked for by who needs it");
    }
}
