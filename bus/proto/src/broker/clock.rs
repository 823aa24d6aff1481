//! What time it is in the community: the broker's own, or what a client drives it to.
//!
//! Whoever replays a run lets the community's time be that of the recording: it says what the clock is set to and how
//! fast it runs from there, and everybody is told. That is said of the clock, not of every tick of it, so nobody waits for
//! a tick. One client drives at a time; when it is gone, time is the broker's own again. What the broker itself has to
//! wait for (leases, patience, intervals of registrations) never goes by a driven clock, which may jump and stand still.

use super::state::Broker;
use super::table::ClockEntry;
use crate::clock_setting::ClockSetting;
use crate::wire::ClientId;

/// What a refusal names when the clock could not be driven.
pub const CLOCK: &str = "the clock";

impl Broker {
    /// What the community's clock is set to, if somebody drives it.
    pub fn clock_setting(&self) -> Option<ClockSetting> {
        self.time.clock_setting()
    }

    /// The client that drives the clock, and what that shows.
    pub(super) fn clock_entry(&self, now: f64) -> Option<ClockEntry> {
        let (client, setting) = (self.time.driver()?, self.time.clock_setting()?);
        let driver = self.client_name(client)?.to_owned();
        Some(ClockEntry { driver, time: setting.time(now), rate: setting.rate })
    }

    /// A client sets the clock, or leaves it to itself.
    pub(super) fn set_clock(
        &mut self,
        now: f64,
        from: ClientId,
        setting: Option<ClockSetting>,
    ) -> Result<(), &'static str> {
        match (setting, self.time.driver()) {
            (None, _) => self.let_go_of_clock(now, from),
            (Some(_), Some(holder)) if holder != from => return self.refuse_clock(from, holder),
            (Some(setting), holder) => {
                let name = self.client_name(from).ok_or("the client is not connected")?.to_owned();
                self.time.drive(from, setting);
                self.tell_clock(|id| id != from);
                if holder.is_none() {
                    self.publish_event(now, &format!("clock={name}"));
                }
            }
        }
        Ok(())
    }

    /// A client is told that another drives the clock, and what that is set to.
    fn refuse_clock(&mut self, from: ClientId, holder: ClientId) -> Result<(), &'static str> {
        let driver = self.client_name(holder);
        debug_assert!(driver.is_some(), "client {holder} is gone and drives the clock");
        let reason = format!("{} drives the community's time already: end that first", driver.unwrap_or("somebody"));
        self.tell_clock(|id| id == from);
        self.refuse(from, CLOCK, 0, &reason)
    }

    /// A client drives no longer, if it did.
    pub(super) fn let_go_of_clock(&mut self, now: f64, id: ClientId) {
        if self.time.let_go(id) {
            self.tell_clock(|_| true);
            self.publish_event(now, "clock=");
        }
    }

    /// After the death of the broker before this one everybody's clock is as it was, since whoever drove it is about to
    /// drive on; if nobody is, it is left to itself.
    pub(super) fn await_driver(&mut self, now: f64) {
        if now >= self.time.driver_awaited_until {
            self.time.driver_awaited_until = f64::INFINITY;
            if !self.time.is_driven() {
                self.tell_clock(|_| true);
            }
        }
    }

    fn tell_clock(&mut self, whom: impl Fn(ClientId) -> bool) {
        let setting = self.clock_setting();
        self.sessions
            .clients
            .iter_mut()
            .filter(|(id, _)| whom(**id))
            .for_each(|(_, client)| client.mailbox.tell_clock(setting));
    }
}
