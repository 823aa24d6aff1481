//! A question and its answer: one serves, the other asks, and knows which answer is to its question.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use elk_bus::memory::MemoryBroker;
use elk_bus::{App, AppError, Asker, BrokerConfig, Client, Clock, Comms, Community, Handlers, Mail, Request};
use elk_bus::{payload, run_app_on};

/// Of which number is the square root wanted?
#[payload]
pub struct Square {
    /// The number.
    #[describe(unit = "m²", range = 0.0..=1e12)]
    pub area: f64,
}

/// The answer.
#[payload]
#[derive(Debug, PartialEq)]
pub struct Root {
    /// The square root.
    #[describe(unit = "m")]
    pub side: f64,
}

const ROOT: Request<Square, Root> = Request::new("ROOT_REQUEST", "ROOT");

/// Who answers needs one row.
struct Reckoner;

impl Reckoner {
    fn on_the_bus() -> impl App {
        Handlers::new().serve(&ROOT, Self::root).with(Self)
    }

    fn root(&mut self, _: &mut Comms, square: Square) -> Result<Root, AppError> {
        Ok(Root { side: square.area.sqrt() })
    }
}

/// Runs it.
pub fn main() -> Result<(), AppError> {
    let community = Community::new("question")?;
    let broker = MemoryBroker::new(BrokerConfig::new("question"), Clock::new(1.0));
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let reckoner = scope.spawn(|| {
            let link = broker.connect("reckoner").map_err(|error| error.to_string())?;
            let mut client = Client::over(link, "reckoner", &community);
            run_app_on(&mut Reckoner::on_the_bus(), &mut client, &stop).map_err(|error| error.to_string())
        });
        let mut asker = Client::over(broker.connect("asker")?, "asker", &community);
        let root = ask(&mut asker, 2.25, || !reckoner.is_finished());
        stop.store(true, Ordering::Relaxed);
        reckoner.join().map_err(|_| "the reckoner panicked")??;
        let root = root?;
        println!("{root:?}");
        assert_eq!(root, Some(Root { side: 1.5 }));
        Ok(())
    })
}

/// Asks, and waits for the answer, as long as anybody is there to give it. Answers to others, and late ones, are passed over.
fn ask(client: &mut Client, area: f64, is_there: impl Fn() -> bool) -> Result<Option<Root>, AppError> {
    let mut asker = Asker::new(ROOT, Duration::from_secs(5));
    client.comms.register(&ROOT.answer)?;
    asker.ask(&mut client.comms, &Square { area })?;
    let mut root = None;
    while root.is_none() && is_there() {
        let on_mail = |comms: &mut Comms, mail: &Mail<'_>| -> Result<(), AppError> {
            if asker.take_answer(comms, mail).is_some() {
                root = Some(mail.decode(&ROOT.answer)?);
            }
            Ok(())
        };
        client.inbox.receive(&mut client.comms, Duration::from_millis(100), on_mail)?;
    }
    Ok(root)
}
