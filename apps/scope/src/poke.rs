//! `elk poke`: a person writes a variable.
//!
//! A variable's first write fixes its type for good, so a slip must not: what is written has to be what the variable
//! carries; or, if nobody has written it, what those who have registered for it read there. The ranges of its fields are
//! kept, too; what else its type asks (`longest`, `check`) is in no description, and its readers tell of it.

use std::borrow::Cow;

use elk_bus::broker::table::{CommunityTable, REQUEST, TABLE, VariableKind};
use elk_bus::{Description, Origin, Type, Value as BusValue, ValueRef, pattern};
use elk_mission::instead;
use serde_json::json;

use crate::error::{PokeError, ScopeError};
use crate::output::Output;
use crate::session::Scope;
use crate::show;

/// What the person says about the type.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Said {
    /// Nothing: what the variable carries; if nobody has written it, a number if it reads as one, else a text.
    Nothing,
    /// A number.
    Number,
    /// A text.
    Text,
    /// A value of the type of this name.
    Type(String),
}

/// What to write.
#[derive(Debug, Clone)]
pub struct Poke {
    /// The variable.
    pub name: String,
    /// The value, as it was typed.
    pub value: String,
    /// What was said about its type.
    pub said: Said,
    /// Write one JSON object about what was done.
    pub json: bool,
}

impl Poke {
    /// Writes the variable, waits for the broker's word, and says what was done.
    ///
    /// # Errors
    /// The value is not what the variable carries, or the broker refused it.
    pub fn run(&self, scope: &mut Scope, output: &mut Output<'_>) -> Result<(), ScopeError> {
        self.check_name()?;
        let table = scope.table()?;
        let value = self.value(&table)?;
        let after = self.write(scope, &value)?;
        self.report(scope.name(), &after, value.as_ref(), output)?;
        output.flush()
    }

    /// Writes the variable; answers what is there afterwards.
    fn write(&self, scope: &mut Scope, value: &BusValue) -> Result<CommunityTable, ScopeError> {
        scope.take_refusals();
        scope.client.comms.publish_value(&self.name, value.as_ref(), Origin::default())?;
        // The answer comes behind the refusal, if there is one.
        let after = scope.table()?;
        match scope.take_refusals().into_iter().find(|refused| refused.key == self.name) {
            Some(refused) => Err(PokeError::Refused(refused.reason).into()),
            None => Ok(after),
        }
    }

    fn check_name(&self) -> Result<(), PokeError> {
        let name = &self.name;
        if name.trim().is_empty() || name.chars().any(char::is_control) || !pattern::is_literal(name) {
            return Err(PokeError::Name(name.clone()));
        }
        match name.starts_with("DB_") || [REQUEST, TABLE.name()].contains(&name.as_str()) {
            true => Err(PokeError::Brokers(name.clone())),
            false => Ok(()),
        }
    }

    /// The value that was typed, as what the variable carries.
    fn value(&self, table: &CommunityTable) -> Result<BusValue, PokeError> {
        let carried = table.variables.iter().find(|variable| variable.name == self.name).map(|found| &found.kind);
        match (carried.or_else(|| expected(table, &self.name)), &self.said) {
            (Some(kind), said) => self.as_carried(table, kind, said),
            (None, Said::Number) => self.number(),
            (None, Said::Text) => Ok(self.value.as_str().into()),
            (None, Said::Type(name)) => self.typed(type_named(table, name)?),
            (None, Said::Nothing) => self.as_guessed(),
        }
    }

    fn as_carried(&self, table: &CommunityTable, kind: &VariableKind, said: &Said) -> Result<BusValue, PokeError> {
        match (kind, said) {
            (VariableKind::Number, Said::Nothing | Said::Number) => self.number(),
            (VariableKind::Text, Said::Nothing | Said::Text) => Ok(self.value.as_str().into()),
            (VariableKind::Typed { name, layout }, Said::Nothing) => self.typed(table.type_of(name, *layout)),
            (VariableKind::Typed { name, layout }, Said::Type(said)) if name == said => {
                self.typed(table.type_of(name, *layout))
            }
            (kind, said) => Err(self.carries(table, kind, said)),
        }
    }

    /// Nobody has written it, nobody has said what he reads there, and nothing was said now.
    fn as_guessed(&self) -> Result<BusValue, PokeError> {
        match self.value.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(number.into()),
            _ if self.value.trim_start().starts_with(['{', '[']) => Err(PokeError::Undecided(self.name.clone())),
            _ => Ok(self.value.as_str().into()),
        }
    }

    fn number(&self) -> Result<BusValue, PokeError> {
        let wrong = || PokeError::Number { name: self.name.clone(), value: self.value.clone() };
        Ok(self.value.trim().parse::<f64>().map_err(|_| wrong())?.into())
    }

    fn typed(&self, type_: Type) -> Result<BusValue, PokeError> {
        let name = self.name.clone();
        let Some(description) = type_.as_ref().description().map(Cow::into_owned) else {
            return Err(PokeError::Undescribed { name, type_ });
        };
        let (type_name, example) = (type_.as_ref().name().to_owned(), description.example().to_string());
        let json = match serde_json::from_str(&self.value) {
            Ok(json) => json,
            Err(source) => return Err(PokeError::Json { name, type_name, source, example }),
        };
        let bytes = description.to_bytes(&json).map_err(|source| PokeError::Value { name, source, example })?;
        Ok(BusValue::Binary { type_, bytes })
    }

    fn carries(&self, table: &CommunityTable, kind: &VariableKind, said: &Said) -> PokeError {
        let (carries, value) = match kind {
            VariableKind::Number => ("numbers".to_owned(), "3.5".to_owned()),
            VariableKind::Text => ("texts".to_owned(), "'any words'".to_owned()),
            VariableKind::Typed { name, layout } => {
                let type_ = table.type_of(name, *layout);
                let example = |description: Cow<'_, Description>| format!("'{}'", description.example());
                let example = type_.as_ref().description().map_or("its JSON".to_owned(), example);
                (format!("{name} values"), example)
            }
        };
        let said = match said {
            Said::Nothing => self.value.clone(),
            Said::Number => "numbers".to_owned(),
            Said::Text => "texts".to_owned(),
            Said::Type(name) => format!("{name} values"),
        };
        PokeError::Carries {
            name: self.name.clone(),
            carries,
            said,
            example: format!("elk poke {} {value}", self.name),
        }
    }

    fn report(
        &self,
        own_name: &str,
        table: &CommunityTable,
        value: ValueRef<'_>,
        output: &mut Output<'_>,
    ) -> Result<(), ScopeError> {
        let variable = table.variables.iter().find(|variable| variable.name == self.name);
        let routes = variable.iter().flat_map(|variable| &variable.routes);
        let readers = routes.filter(|route| route.source == own_name).flat_map(|route| route.readers.clone());
        let readers: Vec<String> = readers.collect();
        if self.json {
            let value = (show::type_name(&value), show::value_for_programs(value));
            return output.json(&json!({"key": self.name, "type": value.0, "value": value.1, "readers": readers}));
        }
        let (type_name, value) = (show::type_name(&value), show::value_for_people(value));
        output.line(&format!("{} = {value} ({type_name}), heard by {}", self.name, show::or_nobody(&readers)))
    }
}

/// What those who have registered for a variable by its name read there, as far as they have said so.
fn expected<'a>(table: &'a CommunityTable, name: &str) -> Option<&'a VariableKind> {
    let registrations = table.clients.iter().flat_map(|client| &client.registrations);
    registrations.filter(|one| one.key_pattern == name).find_map(|one| one.expects.as_ref())
}

/// The type of this name that somebody writes or reads.
fn type_named(table: &CommunityTable, name: &str) -> Result<Type, PokeError> {
    match table.types.iter().find(|entry| entry.name == name) {
        Some(entry) => Ok(entry.to_type()),
        None => {
            let names: Vec<&str> = table.types.iter().map(|entry| entry.name.as_str()).collect();
            Err(PokeError::Type { type_name: name.to_owned(), instead: instead(name, &names) })
        }
    }
}

#[cfg(test)]
mod tests {
    use elk_bus::{Key, TypeRef, number};
    use elk_spatial::messages::{Plan, Progress};

    use super::*;
    use crate::tests::Lab;

    fn poke(name: &str, value: &str, said: Said) -> Poke {
        Poke { name: name.into(), value: value.into(), said, json: false }
    }

    /// What a poke says, or why it did not.
    fn poked(lab: &Lab, poke: &Poke) -> Result<String, String> {
        let mut to = Vec::new();
        let done = poke.run(&mut lab.scope("poke"), &mut Output::new(&mut to, None));
        done.map(|()| String::from_utf8(to).unwrap()).map_err(|error| error.to_string())
    }

    const PROGRESS: &str = r#"{"scan":1,"revision":1,"scans":1,"path_length_m":2.5,"free":8,"finished":false}"#;

    #[test]
    fn what_nobody_has_written_is_a_number_if_it_reads_as_one_and_else_a_text() {
        let lab = Lab::new();
        let mut reader = lab.client("reader");
        reader.comms.register("SPEED").unwrap();
        reader.comms.flush().unwrap();
        assert_eq!(
            poked(&lab, &poke("SPEED", "-2.5", Said::Nothing)).unwrap(),
            "SPEED = -2.5 (number), heard by reader\n"
        );
        assert_eq!(poked(&lab, &poke("NOTE", "nan", Said::Nothing)).unwrap(), "NOTE = nan (text), heard by nobody\n");
        assert_eq!(poked(&lab, &poke("CODE", "007", Said::Text)).unwrap(), "CODE = 007 (text), heard by nobody\n");
        assert!(poked(&lab, &poke("LEVEL", "high", Said::Number)).unwrap_err().contains("\"high\" is none"));
        assert!(poked(&lab, &poke("OBJECT", "{}", Said::Nothing)).unwrap_err().contains("--type TYPE, or --text"));
        let mut heard = None;
        while heard.is_none() {
            reader.receive(crate::session::LOOK_EVERY, |mail| heard = mail.as_double()).unwrap();
        }
        assert_eq!(heard, Some(-2.5));
    }

    #[test]
    fn what_a_variable_carries_it_goes_on_carrying() {
        let lab = Lab::new();
        poked(&lab, &poke("SPEED", "1", Said::Nothing)).unwrap();
        poked(&lab, &poke("NOTE", "one", Said::Nothing)).unwrap();
        let mut app = lab.client("app");
        app.comms.register(&Key::<Progress>::new("PROGRESS")).unwrap();
        app.comms.flush().unwrap();
        poked(&lab, &poke("DONE", PROGRESS, Said::Type("Progress".into()))).unwrap();
        let said = poked(&lab, &poke("SPEED", "fast", Said::Text)).unwrap_err();
        assert_eq!(said, "SPEED carries numbers, not texts; right is, for example, elk poke SPEED 3.5");
        assert!(poked(&lab, &poke("SPEED", "fast", Said::Nothing)).unwrap_err().contains("has to be a number"));
        assert_eq!(poked(&lab, &poke("NOTE", "2", Said::Nothing)).unwrap(), "NOTE = 2 (text), heard by nobody\n");
        assert!(poked(&lab, &poke("NOTE", "2", Said::Number)).is_err());
        let said = poked(&lab, &poke("DONE", "2", Said::Number)).unwrap_err();
        assert!(
            said.starts_with("DONE carries Progress values, not numbers; right is, for example, elk poke DONE '{"),
            "{said}"
        );
        assert!(
            poked(&lab, &poke("DONE", PROGRESS, Said::Nothing)).unwrap().starts_with("DONE = scan: 1, revision: 1,")
        );
        assert!(poked(&lab, &poke("DONE", "{", Said::Nothing)).unwrap_err().contains("no JSON: EOF while parsing"));
        assert!(poked(&lab, &poke("DONE", "{}", Said::Nothing)).unwrap_err().contains("scan is missing"));
        let mut backwards: serde_json::Value = serde_json::from_str(PROGRESS).unwrap();
        backwards["path_length_m"] = json!(-1);
        let said = poked(&lab, &poke("DONE", &backwards.to_string(), Said::Nothing)).unwrap_err();
        assert!(said.contains("path_length_m is -1; it has to be -0.000001 to"), "{said}");
    }

    #[test]
    fn what_nobody_has_written_is_what_its_readers_read() {
        let lab = Lab::new();
        let mut app = lab.client("app");
        app.comms.register(&Key::<Plan>::new("PLAN")).unwrap();
        app.comms.register(&Key::<Progress>::new("PROGRESS")).unwrap();
        app.comms.register(number("SPEED")).unwrap();
        app.comms.flush().unwrap();
        assert!(poked(&lab, &poke("PLAN", "go there", Said::Nothing)).unwrap_err().contains("PLAN carries Plan"));
        assert!(poked(&lab, &poke("PROGRESS", PROGRESS, Said::Nothing)).unwrap().contains("(Progress)"));
        assert!(poked(&lab, &poke("SPEED", "fast", Said::Nothing)).unwrap_err().contains("has to be a number"));
    }

    #[test]
    fn types_that_nobody_has_described_are_not_written() {
        let lab = Lab::new();
        let mut other = lab.client("other");
        let theirs =
            |type_name, layout| ValueRef::Binary { type_: TypeRef::undescribed(type_name, layout), bytes: &[1] };
        other.comms.publish_value("THEIRS", theirs("Theirs", 7), Origin::default()).unwrap();
        other.comms.flush().unwrap();
        assert!(poked(&lab, &poke("THEIRS", "{}", Said::Nothing)).unwrap_err().contains("nobody has described"));
        let said = poked(&lab, &poke("X", "{}", Said::Type("Their".into()))).unwrap_err();
        assert_eq!(said, "nobody in this community writes or reads a type \"Their\"; did you mean Theirs?");
    }

    #[test]
    fn names_that_are_none_and_the_brokers_own_are_refused() {
        let lab = Lab::new();
        for bad in ["", "X*", "A\n"] {
            assert!(poked(&lab, &poke(bad, "1", Said::Nothing)).unwrap_err().contains("is no variable's name"));
        }
        assert!(poked(&lab, &poke("DB_TIME", "1", Said::Nothing)).unwrap_err().contains("the broker's own"));
    }

    #[test]
    fn the_brokers_refusal_is_told() {
        let lab = Lab::new();
        poked(&lab, &poke("X", "1", Said::Nothing)).unwrap();
        // As if somebody had been first between the look and the write.
        let error = poke("X", "", Said::Text).write(&mut lab.scope("late"), &"text".into()).unwrap_err();
        let reason = "X carries numbers since its first write; texts was refused";
        assert_eq!(error.to_string(), format!("the broker refused it: {reason}"));
    }
}
