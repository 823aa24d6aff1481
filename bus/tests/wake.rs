//! An app that waits for a descriptor besides its mail.

use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use elk_bus::memory::MemoryBroker;
use elk_bus::{
    App, AppError, BrokerConfig, Client, Clock, Comms, Community, Mail, Refused, begin_app, run_app_on, take_turn,
    take_wake,
};
use rustix::event::{EventfdFlags, eventfd};

/// A device that is slow to be ready, and takes no mail before.
struct Device {
    fd: OwnedFd,
    ticks: u32,
    ready: bool,
    heard: Vec<f64>,
    refused: Vec<String>,
}

impl Device {
    fn new() -> Self {
        let fd = eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK).unwrap();
        Self { fd, ticks: 0, ready: false, heard: Vec::new(), refused: Vec::new() }
    }

    fn ring(&self) {
        rustix::io::write(&self.fd, &1_u64.to_ne_bytes()).unwrap();
    }
}

impl App for Device {
    fn on_start_up(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        comms.notify("NUMBER", "a text, by mistake")?;
        Ok(comms.register("NUMBER")?)
    }

    fn on_new_mail(&mut self, comms: &mut Comms, mail: &Mail<'_>) -> Result<(), AppError> {
        self.heard.push(mail.number()?);
        comms.stop();
        Ok(())
    }

    fn iterate(&mut self, _: &mut Comms) -> Result<(), AppError> {
        self.ticks += 1;
        if self.ticks == 5 {
            self.ring();
        }
        Ok(())
    }

    fn tick_period(&self) -> Option<Duration> {
        Some(Duration::from_millis(1))
    }

    fn wake_fd(&self) -> Option<BorrowedFd<'_>> {
        Some(self.fd.as_fd())
    }

    fn on_wake(&mut self, _: &mut Comms) -> Result<(), AppError> {
        rustix::io::read(&self.fd, &mut [0; 8])?;
        assert!(self.heard.is_empty(), "mail came before it was taken");
        self.ready = true;
        Ok(())
    }

    fn takes_mail(&self) -> bool {
        self.ready
    }

    fn on_refused(&mut self, _: &mut Comms, refused: &Refused) -> Result<(), AppError> {
        self.refused.push(refused.key.clone());
        Ok(())
    }
}

fn joined(broker: &MemoryBroker, name: &str) -> Client {
    Client::over(broker.connect(name).unwrap(), name, &Community::new("wake").unwrap())
}

fn broker_with_a_number() -> (MemoryBroker, Client) {
    let broker = MemoryBroker::new(BrokerConfig::new("wake"), Clock::new(1.0));
    let mut speaker = joined(&broker, "speaker");
    speaker.comms.notify("NUMBER", 7.0).unwrap();
    speaker.comms.flush().unwrap();
    (broker, speaker)
}

#[test]
fn an_app_is_woken_by_its_descriptor_and_its_mail_waits_for_it() {
    let (broker, _speaker) = broker_with_a_number();
    let mut device = Device::new();
    run_app_on(&mut device, &mut joined(&broker, "device"), &AtomicBool::new(false)).unwrap();
    assert!(device.ready);
    assert_eq!((device.heard, device.refused), (vec![7.0], vec!["NUMBER".to_owned()]));
}

#[test]
fn an_app_that_takes_turns_is_woken_when_it_is_let_wait() {
    let (broker, _speaker) = broker_with_a_number();
    let (mut device, mut client) = (Device::new(), joined(&broker, "device"));
    begin_app(&mut device, &mut client).unwrap();
    assert!(!take_wake(&mut device, &mut client, Duration::ZERO).unwrap());
    device.ring();
    assert!(take_wake(&mut device, &mut client, Duration::from_secs(60)).unwrap() && device.ready);
    assert!(!take_wake(&mut device, &mut client, Duration::ZERO).unwrap());
    while device.heard.is_empty() {
        take_turn(&mut device, &mut client).unwrap();
    }
    assert_eq!(device.refused, ["NUMBER"]);
}
