//! What time it is in the community.

use crate::clock_setting::ClockSetting;
use crate::wire::ClientId;

/// Who drives the community's clock.
#[derive(Debug, Clone, Copy)]
struct Driver {
    client: ClientId,
    setting: ClockSetting,
}

/// The times that the broker goes by, all of its own clock (s), and who drives the community's.
#[derive(Debug)]
pub struct Time {
    pub started: f64,
    pub next_summary: f64,
    driver: Option<Driver>,
    /// Until then, whoever drove the clock under the broker before this one may come back and go on.
    pub driver_awaited_until: f64,
}

impl Time {
    /// A broker starts, and nobody drives.
    pub fn new(now: f64) -> Self {
        Self { started: now, next_summary: now, driver: None, driver_awaited_until: f64::INFINITY }
    }

    /// Whether somebody drives the community's clock.
    pub fn is_driven(&self) -> bool {
        self.driver.is_some()
    }

    /// Who drives it.
    pub fn driver(&self) -> Option<ClientId> {
        self.driver.map(|driver| driver.client)
    }

    /// What it is set to, if somebody drives it.
    pub fn clock_setting(&self) -> Option<ClockSetting> {
        self.driver.map(|driver| driver.setting)
    }

    /// The community's time (s) when the broker's own is `now`.
    pub fn of_community(&self, now: f64) -> f64 {
        self.clock_setting().map_or(now, |setting| setting.time(now))
    }

    /// A client drives it from now on.
    pub fn drive(&mut self, client: ClientId, setting: ClockSetting) {
        self.driver = Some(Driver { client, setting });
    }

    /// A client drives it no longer; whether it did.
    pub fn let_go(&mut self, client: ClientId) -> bool {
        self.driver.take_if(|driver| driver.client == client).is_some()
    }
}
