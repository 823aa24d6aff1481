//! Typed values as MOOS writes them: `Name=POSE_ESTIMATE,Pose=[3x1]{0.4,1.9,2.2}`, by the description that travels with their
//! type.
//!
//! | what | how |
//! |---|---|
//! | a field | its name without `_`, each word with a capital: `cpu_secs` is `CpuSecs`. In either case, and with `_`, it is read as well |
//! | a struct in a struct | a key for each of its fields: `Pose.Translation` |
//! | a number, a flag, a text | as it is; a text that has a comma or the like in it, in quotes, as in JSON |
//! | numbers in an array, in a tuple, or of a rotation | `[3x1]{0.4,1.9,2.2}` |
//! | a list of numbers, or of what holds so many numbers and nothing else | a row for each: `[2x3]{0,0,0,1,0,0}` |
//! | a pose in space | as a struct; read also, and told of a variable of `:plane`, as the thesis has it: `[3x1]{0.4,1.9,2.2}`, x and y (m) and the heading (rad) |
//! | an option without a value | nothing |
//! | a variant | its name; what it holds stands under keys that go on from it: `Decision=Go,Decision.Go.Points=…` |
//! | anything else | JSON, as `elk echo NAME --json` shows it |
//!
//! `Name` is the variable, and `Time` the time of the message (s), unless the type has such a field of its own; neither has to be
//! there. What is no struct is a `Value`.

mod keys;
mod pose;
mod read;
mod write;

use std::collections::HashMap;

use elk_proto::broker::Broker;
use elk_proto::pattern;
use elk_proto::types::Type;
use elk_proto::wire::Named;

pub use pose::Poses;
pub use read::Read;

/// The longest value that becomes a text (bytes): it is made by whoever serves everybody.
pub const LONGEST_VALUE: usize = 64 << 10;

/// What stands behind the pattern of variables whose poses are told in the plane.
const PLANE: &str = ":plane";

/// Which variables' typed values are texts for clients of MOOS': patterns, with `:plane` behind one if poses are told in the plane.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Texts(Vec<String>);

impl Texts {
    /// The variables that these patterns name.
    pub fn new(patterns: impl IntoIterator<Item = String>) -> Self {
        Self(patterns.into_iter().collect())
    }

    /// Those of patterns with blanks or commas between them.
    pub fn of(said: &str) -> Self {
        let words = said.split(|letter: char| letter == ',' || letter.is_whitespace());
        Self::new(words.filter(|word| !word.is_empty()).map(str::to_owned))
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// How the poses of a variable are told, if it is one of them.
    pub fn poses(&self, variable: &str) -> Option<Poses> {
        let poses = |said: &String| match said.strip_suffix(PLANE) {
            Some(pattern) => pattern::matches(pattern, variable).then_some(Poses::InPlane),
            None => pattern::matches(said, variable).then_some(Poses::InSpace),
        };
        self.0.iter().filter_map(poses).max()
    }

    /// The patterns.
    pub fn patterns(&self) -> impl Iterator<Item = &str> {
        self.0.iter().map(String::as_str)
    }
}

/// A type whose values can be texts.
#[derive(Debug, Clone)]
pub struct Form(Type);

impl Form {
    /// The form of a type's values.
    ///
    /// # Errors
    /// Nobody has described the type, or its names cannot be keys.
    pub fn of(type_: Type) -> Result<Self, String> {
        let description = type_.as_ref().description();
        let description = description.ok_or_else(|| format!("nobody has described {}", type_.as_ref().name()))?;
        keys::check(description.kind()).map_err(|why| format!("{} is no text: {why}", type_.as_ref().name()))?;
        Ok(Self(type_))
    }

    /// A value of `variable` as text, its poses told so.
    ///
    /// # Errors
    /// The bytes are none of the type, or more than [`LONGEST_VALUE`].
    pub fn text(&self, variable: &str, bytes: &[u8], poses: Poses) -> Result<String, String> {
        if bytes.len() > LONGEST_VALUE {
            return Err(format!("its value has {} bytes; at most {LONGEST_VALUE} become a text", bytes.len()));
        }
        let description = self.0.as_ref().description().ok_or("nobody has described it")?;
        let json = description.to_json(bytes, usize::MAX).map_err(|error| error.to_string())?;
        Ok(write::text(description.kind(), variable, &json, poses))
    }

    /// What a text of `variable` says.
    ///
    /// # Errors
    /// It says no value of the type: which key, and what would be right.
    pub fn read(&self, variable: &str, text: &str) -> Result<Read, String> {
        let description = self.0.as_ref().description().ok_or("nobody has described it")?;
        let said = read::read(description.kind(), variable, text)
            .map_err(|reason| format!("this is no {}: {reason}", self.0.as_ref().name()))?;
        let bytes = description.to_bytes(&said.json).map_err(|error| error.to_string())?;
        Ok(Read { bytes, time: said.time })
    }
}

/// The forms of a broker's types, by its numbers, as far as somebody needed them: one of each, whoever hears or says values of it.
#[derive(Debug, Default)]
pub struct Forms(HashMap<u32, Result<Form, String>>);

impl Forms {
    /// The form of a type.
    ///
    /// # Errors
    /// See [`Form::of`].
    pub fn of(&mut self, type_: u32, broker: &Broker) -> Result<&Form, String> {
        let (name, layout, description) = broker.said(Named::Type, type_);
        if description.is_empty() {
            return Err(format!("nobody has described {name}"));
        }
        let form = self.0.entry(type_).or_insert_with(|| Form::of(Type::from_text(name, layout, description)?));
        form.as_ref().map_err(Clone::clone)
    }
}

#[cfg(test)]
mod tests;
