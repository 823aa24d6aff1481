//! An app that draws and takes a key: a mast with a light, and whoever looks at the community makes it higher.
//! The broker is in this process; as a program, `run_app` of the same app joins one between processes.

use std::error::Error;
use std::time::Duration;

use elk_bus::drawing::drawing::rgb;
use elk_bus::drawing::variables::{self, DRAWINGS};
use elk_bus::drawing::{Drawing, KeyPress, Primitive};
use elk_bus::memory::MemoryBroker;
use elk_bus::{
    AppError, BrokerConfig, Client, Clock, Comms, Community, Handled, Handlers, begin_app, number, take_turn,
};

/// A mast somewhere.
struct Beacon {
    height_m: f32,
}

impl Beacon {
    fn on_the_bus(self) -> Handled<Self> {
        Handlers::<Self>::new()
            .on(number("TIDE"), |beacon, comms, metres| {
                beacon.height_m = metres as f32;
                beacon.draw(comms)
            })
            // Somebody begins to look.
            .draw(Self::draw)
            .on_key("u", "half a metre up; down with Shift", Self::move_by_hand)
            .with(self)
    }

    fn draw(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        let top = [2.0, 1.0, self.height_m];
        let drawing = Drawing::new("mast")
            .line_strip([[2.0, 1.0, 0.0], top], rgb(148, 163, 184))
            .points([top], rgb(255, 160, 0))
            .text([2.0, 1.0, self.height_m + 0.3], format!("{:.1} m", self.height_m), rgb(255, 160, 0));
        Ok(comms.draw(&drawing)?)
    }

    fn move_by_hand(&mut self, comms: &mut Comms, press: &KeyPress) -> Result<(), AppError> {
        self.height_m += if press.shift { -0.5 } else { 0.5 };
        self.draw(comms)
    }
}

/// Runs it.
pub fn main() -> Result<(), Box<dyn Error>> {
    let community = Community::new("harbour")?;
    let broker = MemoryBroker::new(BrokerConfig::new("harbour"), Clock::new(1.0));
    let join = |name: &str| -> Result<_, Box<dyn Error>> { Ok(Client::over(broker.connect(name)?, name, &community)) };
    let (mut app, mut beacon) = (Beacon { height_m: 3.0 }.on_the_bus(), join("beacon")?);
    begin_app(&mut app, &mut beacon)?;

    // What `elk view` does: it looks, and passes on what is pressed.
    let mut view = join("view")?;
    view.comms.register(DRAWINGS)?;
    let press = KeyPress { app: "beacon".into(), key: "u".into(), shift: false, alt: false };
    view.comms.publish(&variables::key_press("beacon"), &press)?;
    view.comms.flush()?;
    take_turn(&mut app, &mut beacon)?;

    let mut said = Vec::new();
    view.receive(Duration::from_secs(1), |mail| {
        let drawing = mail.decode(&variables::drawing("beacon", "mast")).ok();
        for primitive in drawing.into_iter().flat_map(|drawing| drawing.primitives) {
            if let Primitive::Text { text, .. } = primitive {
                said.push(text);
            }
        }
    })?;
    assert_eq!(said, ["3.0 m", "3.5 m"]);
    Ok(())
}
