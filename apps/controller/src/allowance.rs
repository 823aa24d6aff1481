//! What a person lets the robot do: all commands, or while it is paused one for each step.

use elk_bus::{Mail, Rejection};
use elk_spatial::checks::MAX_COUNT;
use elk_spatial::messages::MotionMemory;

/// Which pose commands may be said.
#[derive(Debug, Clone, Copy, Default)]
pub struct Allowance {
    /// Whether each command waits for a step.
    pub paused: bool,
    /// The last command that was not held back.
    pub allowed: u64,
    /// Steps that were allowed and not taken yet.
    pub steps: u64,
    /// When the latest step was allowed (s, the community's clock).
    pub last_step: Option<f64>,
}

impl Allowance {
    /// Of a successor of one that left this memory.
    pub fn successor(&self, memory: &MotionMemory) -> Self {
        let MotionMemory { allowed, steps, last_step, .. } = *memory;
        Self { paused: self.paused, allowed, steps, last_step }
    }

    /// `mail` allows one more step. The latest that was ever allowed lies there for whoever starts: a successor may have
    /// heard of it from its predecessor, while it is news to one who starts after a person was quick.
    pub fn step(&mut self, mail: &Mail<'_>) {
        let at = mail.time();
        if mail.is_latest() && self.last_step.is_some_and(|last| at <= last) {
            return;
        }
        self.last_step = Some(at);
        if self.paused {
            self.steps = (self.steps + 1).min(MAX_COUNT);
        }
    }

    /// What a person says: `pause` or `run`.
    ///
    /// # Errors
    /// It is another word.
    pub fn obey(&mut self, word: &str) -> Result<(), Rejection> {
        match word {
            "pause" => self.paused = true,
            "run" => self.run(),
            _ => return Err(Rejection::new("it has to be the text pause or run")),
        }
        Ok(())
    }

    /// Runs on: steps that were not taken are forgotten.
    pub fn run(&mut self) {
        (self.paused, self.steps) = (false, 0);
    }

    /// Whether command `id` may be said; one that has to wait for a step takes one.
    pub fn allows(&mut self, id: u64) -> bool {
        let waits = self.paused && id > self.allowed;
        if waits && self.steps == 0 {
            return false;
        }
        self.steps -= u64::from(waits);
        self.allowed = id;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_word_than_pause_or_run_is_refused_and_changes_nothing() {
        let mut allowance = Allowance { paused: true, steps: 3, ..Allowance::default() };
        for word in ["", "walk", "Run", "pause "] {
            assert!(allowance.obey(word).is_err(), "{word:?}");
            assert_eq!((allowance.paused, allowance.steps), (true, 3));
        }
        allowance.obey("run").unwrap();
        assert_eq!((allowance.paused, allowance.steps), (false, 0));
    }
}
