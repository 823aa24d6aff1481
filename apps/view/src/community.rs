//! A community that is followed through its end and through the next one of its name.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use elk_bus::clock::Stopwatch;
use elk_bus::{Client, CommsError, Community, ConnectError};

/// How long nobody tries again to join a community that has ended, or does not let anybody in.
const JOIN_EVERY: Duration = Duration::from_millis(500);
/// The longest sleep without a look at whether to stop, and whether a community is there that was not: a view that joins before
/// the first scan has the map from its beginning, and nobody has to say it whole.
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
    let mut said = String::new();
    while !stop.load(Ordering::Relaxed) {
        let (ended, again) = match Client::connect(community, &format!("{role}-{}", std::process::id())) {
            Ok(client) => {
                said.clear();
                (listen(client).err().map_or_else(|| "the view ends".to_owned(), |error| error.to_string()), JOIN_EVERY)
            }
            Err(ConnectError::NoBroker(_)) => {
                (format!("community {community} is not there; waiting for it"), LOOK_EVERY)
            }
            Err(error) => (error.to_string(), JOIN_EVERY),
        };
        if ended != said {
            left(&ended);
            said = ended;
        }
        let waited = Stopwatch::start();
        while waited.elapsed() < again && !stop.load(Ordering::Relaxed) {
            std::thread::sleep(LOOK_EVERY);
        }
    }
}
