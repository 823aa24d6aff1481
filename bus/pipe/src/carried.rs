//! What a variable carries, as the broker's table says it, and JSON as a value of that.

use std::borrow::Cow;

use elk_bus::broker::table::{CommunityTable, VariableKind};
use elk_bus::describe::shown;
use elk_bus::{Description, Type, Value as BusValue};
use serde_json::{Value, json};

use crate::arrays;
use crate::words::{Publish, number_of};

/// What a variable carries.
#[derive(Debug, Clone)]
pub enum Carried {
    /// Numbers.
    Number,
    /// Texts.
    Text,
    /// Values of this type.
    Typed(Type),
}

impl Carried {
    /// What a variable carries; if nobody has written it, what those who have registered for it by its name read there.
    pub fn of(table: &CommunityTable, variable: &str) -> Option<Self> {
        let written = table.variables.iter().find(|one| one.name == variable).map(|one| &one.kind);
        let registrations = || table.clients.iter().flat_map(|client| &client.registrations);
        let expected =
            || registrations().filter(|one| one.key_pattern == variable).find_map(|one| one.expects.as_ref());
        Some(match written.or_else(expected)? {
            VariableKind::Number => Self::Number,
            VariableKind::Text => Self::Text,
            VariableKind::Typed { name, layout } => Self::Typed(table.type_of(name, *layout)),
        })
    }

    /// What a value is to be of which nobody says what it carries.
    ///
    /// # Errors
    /// It is no number and no text, and of no type that anybody has described.
    pub fn guessed(table: &CommunityTable, said: &Publish) -> Result<Self, String> {
        match (&said.type_name, &said.value) {
            (Some(name), _) => match table.types.iter().find(|entry| entry.name == *name) {
                Some(entry) => Ok(Self::Typed(entry.to_type())),
                None => Err(format!("nobody in this community writes or reads a type {name}")),
            },
            (None, Value::Number(_)) => Ok(Self::Number),
            (None, Value::String(_)) => Ok(Self::Text),
            (None, _) => Err(format!(
                "nobody has written {0} or reads it, so that nobody knows its type; right is a number, a text, or \"type\": \"…\"",
                said.variable
            )),
        }
    }

    /// The name of what it carries.
    pub fn name(&self) -> &str {
        match self {
            Self::Number => "number",
            Self::Text => "text",
            Self::Typed(type_) => type_.as_ref().name(),
        }
    }

    /// The value that a program means.
    ///
    /// # Errors
    /// It is none of what the variable carries: which field, and what would be right.
    pub fn value(&self, said: &Publish) -> Result<BusValue, String> {
        let Publish { variable, value, .. } = said;
        self.check_type(said)?;
        let wrong = |right: &str| format!("{variable} is {}; it has to be a {right}", shown(value));
        match self {
            Self::Number => number_of(value).map(BusValue::Double).ok_or_else(|| wrong("number")),
            Self::Text => value.as_str().map(BusValue::from).ok_or_else(|| wrong("text")),
            Self::Typed(type_) => {
                let description = described(type_)?;
                let unpacked = match arrays::is_packed(value) {
                    true => Cow::Owned(arrays::unpacked(description.kind(), value.clone())?),
                    false => Cow::Borrowed(value),
                };
                let bytes = description.to_bytes(&unpacked).map_err(|error| error.to_string())?;
                Ok(BusValue::Binary { type_: type_.clone(), bytes })
            }
        }
    }

    /// Whether the type that a program names, if it does, is the one.
    ///
    /// # Errors
    /// It is another one.
    pub fn check_type(&self, said: &Publish) -> Result<(), String> {
        match said.type_name.as_deref().filter(|name| *name != self.name()) {
            Some(other) => Err(format!("{} carries {}, and not {other}", said.variable, self.name())),
            None => Ok(()),
        }
    }

    /// What it is, for a program that asks.
    pub fn as_json(&self) -> Value {
        match self {
            Self::Typed(type_) => match type_.as_ref().description() {
                Some(description) => {
                    json!({"type": self.name(), "example": description.example(), "description": *description})
                }
                None => json!({"type": self.name()}),
            },
            _ => json!({"type": self.name()}),
        }
    }
}

fn described(type_: &Type) -> Result<Cow<'_, Description>, String> {
    type_.as_ref().description().ok_or_else(|| format!("nobody has described {}", type_.as_ref().name()))
}
