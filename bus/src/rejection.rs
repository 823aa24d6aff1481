//! Messages that an app cannot use: said, counted and passed over, so that no message ends whoever reads it.
//!
//! A message that ended its reader would end the next one of that name as well: as the variable's latest value it comes
//! to whoever registers.

use crate::codec::DecodeError;
use crate::comms::{Comms, CommsError};
use crate::failure::AppError;
use crate::inbox::Refused;
use crate::mail::Mail;
use crate::{Rejection, tell};

/// The variable under which every app says what it has rejected: a text for people, for the log and the launcher.
pub const REJECTED: &str = "MAIL_REJECTED";

impl Comms {
    /// Messages that this client's app has rejected.
    pub fn rejected(&self) -> u64 {
        self.rejections.count()
    }

    /// Passes over a message that the app failed with, if that is what it means; other failures are handed back.
    ///
    /// # Errors
    /// The app's own failure, or that of the bus over which the rejection is said.
    pub(crate) fn pass_over(&mut self, mail: &Mail<'_>, failure: AppError) -> Result<(), AppError> {
        if !failure.is::<DecodeError>() && !failure.is::<Rejection>() {
            return Err(failure);
        }
        Ok(self.reject(mail.key(), mail.source(), mail.sequence(), &failure)?)
    }

    /// Says that the broker has refused something of this client's.
    pub(crate) fn note_refused(&mut self, refused: &Refused) -> Result<(), CommsError> {
        let Refused { key, sequence, reason } = refused;
        let Some(more) = self.refusals.note(key, "") else { return Ok(()) };
        let number = sequence.map_or_else(String::new, |sequence| format!(" #{sequence}"));
        self.say(key, format!("{}: {key}{number} was refused: {reason}{more}", self.name()))
    }

    fn say(&mut self, key: &str, words: String) -> Result<(), CommsError> {
        tell(&words);
        // A word about this very variable would be answered by another one for ever.
        if key == REJECTED { Ok(()) } else { self.notify(REJECTED, words) }
    }

    /// Says and counts that a message is of no use, for who has taken it out of its callback. In a callback an app fails
    /// with a [`Rejection`] in place of that.
    ///
    /// # Errors
    /// The bus failed.
    pub fn reject(
        &mut self,
        key: &str,
        writer: &str,
        sequence: u64,
        why: &dyn std::fmt::Display,
    ) -> Result<(), CommsError> {
        let Some(more) = self.rejections.note(key, writer) else { return Ok(()) };
        self.say(key, format!("{} rejects {key} #{sequence} by {writer}: {why}{more}", self.name()))
    }
}
