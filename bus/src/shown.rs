//! What an app draws, and the keys that it takes, on the bus: Drawable and Keyhook of the thesis (4.4.1) in a line each.
//!
//! ```no_run
//! use elk_bus::drawing::{Drawing, drawing::rgb};
//! use elk_bus::{AppError, Comms, Handled, Handlers, text};
//!
//! #[derive(Default)]
//! struct Beacon {
//!     height_m: f32,
//! }
//!
//! impl Beacon {
//!     fn on_the_bus(self) -> Handled<Self> {
//!         Handlers::<Self>::new()
//!             .draw(Self::draw)
//!             .on_key("u", "a beacon that is higher", |beacon, comms, _| {
//!                 beacon.height_m += 0.5;
//!                 beacon.draw(comms)
//!             })
//!             .with(self)
//!     }
//!
//!     fn draw(&mut self, comms: &mut Comms) -> Result<(), AppError> {
//!         let ends = [[0.0; 3], [0.0, 0.0, self.height_m]];
//!         Ok(comms.draw(&Drawing::new("beacon").line_strip(ends, rgb(255, 160, 0)))?)
//!     }
//! }
//! # let _ = Beacon::default().on_the_bus();
//! ```

use elk_drawing::keyboard::Keyboard;
use elk_drawing::{Drawing, KeyTable, variables};
use elk_proto::broker::WANTED;

use crate::comms::{Comms, CommsError};
use crate::drawing_state::MAX_DRAWINGS;
use crate::mail::Mail;
use crate::rejection::REJECTED;
use crate::subscription::{any, number};
use crate::tell;

/// The broker's list of clients, by a pattern that nobody else registers: an app that waits for the same variable lets go of
/// it by its own.
const CLIENTS: (&str, &str) = ("DB_CLIENTS", "DB_CLIENT?");

impl Comms {
    /// Draws: whoever looks at the community sees it, and whoever comes late. It takes the place of what this client drew
    /// under the same name before; without primitives it takes that away. What nobody would believe, and one name too many
    /// ([`MAX_DRAWINGS`]), is not sent: that is said, and ends no app.
    ///
    /// What an app has drawn goes with it when it ends; what has a lifetime stays until that is over.
    pub fn draw(&mut self, drawing: &Drawing) -> Result<(), CommsError> {
        let Drawing { name, lifetime_s, primitives, .. } = drawing;
        if let Err(why) = drawing.checked() {
            return self.cannot_draw(name, &why);
        }
        if primitives.is_empty() {
            self.drawing.drawn.remove(name);
        } else if self.drawing.drawn.len() < MAX_DRAWINGS || self.drawing.drawn.contains_key(name) {
            self.drawing.drawn.insert(name.clone(), lifetime_s.is_some());
        } else {
            let why = format!("{MAX_DRAWINGS} others are there; take one away by drawing nothing under its name");
            return self.cannot_draw(name, &why);
        }
        self.publish(&variables::drawing(self.name(), name), drawing)
    }

    fn cannot_draw(&mut self, name: &str, why: &dyn std::fmt::Display) -> Result<(), CommsError> {
        let name: String = name.chars().take(40).collect();
        let Some(more) = self.refusals.note("DRAWING", "") else { return Ok(()) };
        self.say_trouble(&format!("{}: drawing {name:?} is not sent: {why}{more}", self.name().to_owned()))
    }

    /// Whether anybody looks at what this client draws: a view, or a log. What is dear to draw need not be drawn for nobody;
    /// what was drawn is there for whoever comes late, and [`App::draw`](crate::App::draw) is called when somebody begins to
    /// look. Until the broker has answered, somebody does.
    pub fn is_watched(&mut self) -> Result<bool, CommsError> {
        if !std::mem::replace(&mut self.drawing.asked, true) {
            let question = self.question();
            self.register_for_itself(number(&question))?;
        }
        Ok(self.drawing.watched != Some(false))
    }

    fn question(&self) -> String {
        format!("{WANTED}{}", variables::drawings_of(self.name()))
    }

    /// Declares the keys that this client takes, in place of those that it has declared before: whoever looks at the community
    /// is shown them, and one that is pressed comes as a message of [`variables::key_press`]. A key that is another's is not
    /// given: that is said under [`REJECTED`], and on the page.
    pub fn take_keys(&mut self, table: &KeyTable) -> Result<(), CommsError> {
        let name = self.name().to_owned();
        if self.drawing.keyboard.is_none() {
            self.drawing.keyboard = Some(Keyboard::default());
            self.register(&variables::key_press(&name))?;
            self.register_for_itself(any(CLIENTS.1))?;
            self.register_for_itself(any(variables::KEYS))?;
        }
        self.publish(&variables::keys_of(&name), table)
    }

    /// What this client has drawn goes with it, and so do its keys.
    pub(crate) fn take_down(&mut self) -> Result<(), CommsError> {
        for (name, _) in
            std::mem::take(&mut self.drawing.drawn).into_iter().filter(|(_, goes_by_itself)| !goes_by_itself)
        {
            self.draw(&Drawing::new(name))?;
        }
        if self.drawing.keyboard.take().is_some() {
            let keys = variables::keys_of(self.name());
            self.publish(&keys, &KeyTable::default())?;
        }
        Ok(())
    }

    /// Whether somebody has begun to look since this was asked last.
    pub(crate) fn take_newly_watched(&mut self) -> bool {
        std::mem::take(&mut self.drawing.newly_watched)
    }

    /// Takes note of what the client has asked for of itself; whether the message is for the app as well.
    pub(crate) fn note_word(&mut self, mail: &Mail<'_>) -> Result<bool, CommsError> {
        let may_be_ours = [WANTED, "KEYS/", CLIENTS.0].iter().any(|beginning| mail.key().starts_with(beginning));
        if !may_be_ours {
            // A key was pressed when it was pressed; who comes later does nothing about it.
            let is_late = mail.is_latest() && self.drawing.keyboard.is_some();
            return Ok(!(is_late && mail.key() == variables::key_press(self.name()).name()));
        }
        if self.drawing.asked && mail.key() == self.question() {
            let before = self.drawing.watched.replace(mail.as_double() == Some(1.0));
            self.drawing.newly_watched = before != Some(true) && self.drawing.watched == Some(true);
        } else if let Some(keyboard) = &mut self.drawing.keyboard {
            if mail.key() == CLIENTS.0 {
                keyboard.hear_of_clients(mail.as_text().unwrap_or_default());
                self.say_conflicts()?;
            } else if variables::is_keys(mail.key())
                // Who declares what is no table of keys has none; those who read it say why.
                && let Ok(table) = mail.decode(&variables::keys_of(mail.source()))
            {
                keyboard.declare(mail.source(), mail.time(), table);
                self.say_conflicts()?;
            }
        }
        Ok(self.is_registered_for(mail))
    }

    /// Says which of the client's own keys are another's, once each.
    fn say_conflicts(&mut self) -> Result<(), CommsError> {
        let Some(keyboard) = &self.drawing.keyboard else { return Ok(()) };
        let lost: Vec<(String, String)> = keyboard
            .declared()
            .filter(|declared| declared.app == self.name())
            .filter_map(|declared| Some((declared.key.to_owned(), declared.taken_by?.to_owned())))
            .collect();
        self.drawing.said.retain(|key| lost.iter().any(|(lost, _)| lost == key));
        for (key, owner) in lost {
            if self.drawing.said.insert(key.clone()) {
                let name = self.name().to_owned();
                self.say_trouble(&format!("{name}: key {key:?} is not {name}'s: {owner} has declared it already"))?;
            }
        }
        Ok(())
    }

    fn say_trouble(&mut self, words: &str) -> Result<(), CommsError> {
        tell(words);
        self.notify(REJECTED, words)
    }
}

#[cfg(test)]
mod tests;
