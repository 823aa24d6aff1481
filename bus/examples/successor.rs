//! An app as one table, and the one after it: what the first has learned goes on.

use std::error::Error;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use elk_bus::app::run_app_on;
use elk_bus::comms::CommsError;
use elk_bus::memory::MemoryBroker;
use elk_bus::{App, AppError, BrokerConfig, Client, Clock, Comms, Community, Handlers, Key, number, payload};

/// What the app leaves to the next one of its name.
#[payload]
pub struct Memory {
    /// The highest temperature so far.
    #[describe(unit = "°C")]
    pub highest: f64,
}

const MEMORY: Key<Memory> = Key::new("HIGHEST_MEMORY");

/// Says the highest of all temperatures that anybody has said.
struct Highest(f64);

impl Highest {
    fn on_the_bus() -> impl App {
        Handlers::new()
            .recall(&MEMORY, Self::thaw)
            .on(number("TEMPERATURE"), Self::on_temperature)
            .on_stop(|app, comms| comms.publish(&MEMORY, &Memory { highest: app.0 }))
            .with(Self(f64::NEG_INFINITY))
    }

    fn thaw(&mut self, _: &mut Comms, memory: Memory) -> Result<(), AppError> {
        self.0 = memory.highest;
        Ok(())
    }

    /// The latest temperature comes to every app that starts: it has to do no harm twice.
    fn on_temperature(&mut self, comms: &mut Comms, temperature: f64) -> Result<(), AppError> {
        self.0 = self.0.max(temperature);
        Ok(comms.notify("HIGHEST", self.0)?)
    }
}

/// Runs it.
pub fn main() -> Result<(), Box<dyn Error>> {
    let community = Community::new("successor")?;
    let broker = MemoryBroker::new(BrokerConfig::new("successor"), Clock::new(1.0));
    let mut thermometer = Client::over(broker.connect("thermometer")?, "thermometer", &community);
    thermometer.comms.register(number("HIGHEST").from("highest"))?;
    for (temperature, highest) in [(21.0, 21.0), (19.0, 21.0), (23.0, 23.0)] {
        let stop = AtomicBool::new(false);
        std::thread::scope(|scope| -> Result<(), Box<dyn Error>> {
            let app = scope.spawn(|| {
                let link = broker.connect("highest").map_err(|error| error.to_string())?;
                let mut client = Client::over(link, "highest", &community);
                run_app_on(&mut Highest::on_the_bus(), &mut client, &stop).map_err(|error| error.to_string())
            });
            let heard = until(&mut thermometer, temperature, highest, || !app.is_finished());
            stop.store(true, Ordering::Relaxed);
            app.join().map_err(|_| "the app panicked")??;
            println!("{temperature} °C; the highest so far: {} °C", heard?);
            Ok(())
        })?;
    }
    Ok(())
}

/// Says a temperature and waits for the highest so far, as long as anybody is there to say it.
fn until(client: &mut Client, said: f64, wanted: f64, is_there: impl Fn() -> bool) -> Result<f64, CommsError> {
    client.comms.notify("TEMPERATURE", said)?;
    let mut heard = f64::NAN;
    while heard != wanted && is_there() {
        client.receive(Duration::from_millis(100), |mail| heard = mail.as_double().unwrap_or(f64::NAN))?;
    }
    Ok(heard)
}
