//! A community that is followed through its end and through the next one of its name.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use elk_bus::clock::Stopwatch;
use elk_bus::{Client, CommsError, Community, ConnectError};

/// How long nobody tries to join again.
const JOIN_EVERY: Duration = Duration::from_millis(500);
/// The longest sleep without a look at whether to stop.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// Joins `community` as `role` and this process' number, again and again until `stop` is set. `listen` is given each client, and
/// comes back when its community ends or `stop` is set; `left` is told why nobody is heard.
pub(crate) fn follow(
    community: &Community,
    role: &str,
    stop: &AtomicBool,
    mut listen: impl FnMut(Client) -> Result<(), CommsError>,
    left: impl Fn(&str),
) {
    while !stop.load(Ordering::Relaxed) {
        let ended = match Client::connect(community, &format!("{role}-{}", std::process::id())) {
            Ok(client) => listen(client).err().map_or_else(|| "the view ends".to_owned(), |error| error.to_string()),
            Err(ConnectError::NoBroker(_)) => format!("community {community} is not there; waiting for it"),
            Err(error) => error.to_string(),
        };
        left(&ended);
        let waited = Stopwatch::start();
        while waited.elapsed() < JOIN_EVERY && !stop.load(Ordering::Relaxed) {
            std::thread::sleep(LOOK_EVERY);
        }
    }
}
