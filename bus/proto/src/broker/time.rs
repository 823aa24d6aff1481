//! What time it is in the community: the broker's own, or what a client drives it to.
//!
//! Whoever replays a run lets the community's time be that of the recording: it says what the clock is set to and how
//! fast it runs from there, and everybody is told. That is said of the clock, not of every tick of it, so nobody waits for
//! a tick. One client drives at a time; when it is gone, time is the broker's own again. What the broker itself has to
//! wait for (leases, patience, intervals of registrations) never goes by a driven clock, which may jump and stand still.

use super::table::ClockEntry;
use super::{Broker, ClientId};
use crate::clock_setting::ClockSetting;

/// Who drives the community's clock.
#[derive(Debug)]
pub(super) struct Driver {
    client: ClientId,
    setting: ClockSetting,
}

/// The times that the broker goes by, all of its own clock (s), and who drives the community's.
#[derive(Debug)]
pub(super) struct Time {
    pub started: f64,
    pub next_summary: f64,
    pub driver: Option<Driver>,
    /// Until then, whoever drove the clock under the broker before this one may come back and go on.
    pub driver_awaited_until: f64,
}

impl Time {
    /// A broker starts, and nobody drives.
    pub fn new(now: f64) -> Self {
        Self { started: now, next_summary: now, driver: None, driver_awaited_until: f64::INFINITY }
    }
}

/// What a refusal names when the clock could not be driven.
pub const CLOCK: &str = "the clock";

impl Broker {
    /// What the community's clock is set to, if somebody drives it.
    pub fn clock_setting(&self) -> Option<ClockSetting> {
        self.time.driver.as_ref().map(|driver| driver.setting)
    }

    /// The community's time (s) when the broker's own is `now`.
    pub(super) fn time(&self, now: f64) -> f64 {
        self.clock_setting().map_or(now, |setting| setting.time(now))
    }

    /// The client that drives the clock, and what that shows.
    pub(super) fn clock_entry(&self, now: f64) -> Option<ClockEntry> {
        let Driver { client, setting } = self.time.driver.as_ref()?;
        let driver = self.client_name(*client)?.to_owned();
        Some(ClockEntry { driver, time: setting.time(now), rate: setting.rate })
    }

    /// A client sets the clock, or leaves it to itself.
    pub(super) fn set_clock(
        &mut self,
        now: f64,
        from: ClientId,
        setting: Option<ClockSetting>,
    ) -> Result<(), &'static str> {
        let holder = self.time.driver.as_ref().map(|driver| driver.client);
        match setting {
            Some(_) if holder.is_some_and(|holder| holder != from) => {
                let driver = holder.and_then(|holder| self.client_name(holder)).unwrap_or_default();
                let reason = format!("{driver} drives the community's time already: end that first");
                self.tell_clock(|id| id == from);
                self.refuse(from, CLOCK, 0, &reason)
            }
            Some(setting) => {
                self.time.driver = Some(Driver { client: from, setting });
                self.tell_clock(|id| id != from);
                if holder.is_none() {
                    let name = self.client_name(from).unwrap_or_default().to_owned();
                    self.publish_event(now, &format!("clock={name}"));
                }
                Ok(())
            }
            None => {
                self.let_go_of_clock(now, from);
                Ok(())
            }
        }
    }

    /// A client drives no longer, if it did.
    pub(super) fn let_go_of_clock(&mut self, now: f64, id: ClientId) {
        if self.time.driver.take_if(|driver| driver.client == id).is_some() {
            self.tell_clock(|_| true);
            self.publish_event(now, "clock=");
        }
    }

    /// After the death of the broker before this one everybody's clock is as it was, since whoever drove it is about to
    /// drive on; if nobody is, it is left to itself.
    pub(super) fn await_driver(&mut self, now: f64) {
        if now >= self.time.driver_awaited_until {
            self.time.driver_awaited_until = f64::INFINITY;
            if self.time.driver.is_none() {
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
