//! A mission in the browser, live or recorded, and in Lichtblick: watched, and steered.
//!
//! | module | one idea |
//! |---|---|
//! | `model`, `world`, `journal`, `track` | what pages show, kept so that a late page skips what was overwritten |
//! | `drawings` | what apps draw, as long as it is to be seen |
//! | `community` | one community after the other of a name |
//! | `live`, `recorded` | where it comes from: a community, a log |
//! | `scenery` | the true world, for pages that show it |
//! | `admission`, `connections` | names of this machine, and tokens; how many may come, and how long they may be silent |
//! | `server`, `page`, `session`, `words`, `tail` | the page's server, its files, one page, what it says, a text log |
//! | `steering` | what pages can have done, behind a seam |
//! | `shared` | what feed and pages have in common |
//! | `foxglove` | the same community for Lichtblick and Foxglove |
//!
//! What page and server say to each other is written down in `PROTOCOL.md`.

mod admission;
mod community;
mod connections;
mod drawings;
mod error;
mod foxglove;
mod journal;
mod live;
mod model;
mod page;
mod recorded;
mod scenery;
mod server;
mod session;
mod shared;
mod steering;
mod table;
mod tail;
mod track;
mod words;
mod world;

use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use elk_bus::Community;
use elk_bus::clock::Stopwatch;
use serde_json::json;
use tokio::time::timeout;

pub use error::ViewError;
pub use foxglove::{FoxgloveOptions, Mission, Parameter, serve_foxglove};
pub use scenery::{Scenery, Surfaces};
pub use steering::Steering;
pub use words::Order;

use admission::token;
use connections::Bounded;
use recorded::Recording;
use server::{Door, router, stopped};
use shared::Shared;

/// How often the launcher is asked who runs.
const APPS_EVERY: Duration = Duration::from_secs(1);
/// The longest sleep without a look at whether to stop.
const LOOK_EVERY: Duration = Duration::from_millis(50);
/// How long pages may take to be told that the view ends.
const GOODBYE: Duration = Duration::from_millis(300);
/// Ports that are tried behind the one that was asked for, if nobody insists on it.
const PORTS: u16 = 20;

/// What is looked at.
#[derive(Debug, Clone)]
pub enum Source {
    /// A community that runs, or will.
    Community(Community),
    /// A recorded run: its folder, or a log.
    Log(PathBuf),
}

/// How to show it.
#[derive(Debug, Clone)]
pub struct Options {
    /// Where to listen. Whoever is let in from other machines needs a token.
    pub address: SocketAddr,
    /// Whether another port will do if that one is taken.
    pub any_port: bool,
    /// Whether pages only look.
    pub read_only: bool,
}

/// Serves pages until `stop` is set; `on_ready` is told the address to open. `steering` does what pages say, `scenery` knows
/// the world that they can show.
///
/// # Errors
/// The port is taken, or the log cannot be read.
pub fn serve(
    source: Source,
    options: &Options,
    steering: Option<Arc<dyn Steering>>,
    scenery: Option<Arc<dyn Scenery>>,
    on_ready: impl FnOnce(&str),
    stop: &AtomicBool,
) -> Result<(), ViewError> {
    let wanted = if options.address.ip().is_loopback() { None } else { Some(token()?) };
    let listener = listen(options)?;
    let address = listener.local_addr().map_err(ViewError::Io)?;
    let query = wanted.as_ref().map_or(String::new(), |token| format!("?token={token}"));
    let (hello, recording, steering) = match &source {
        Source::Community(community) => {
            (json!({"live": {"community": community.as_str()}, "recorded": null}), None, steering)
        }
        Source::Log(path) => {
            let recording = Recording::open(path)?;
            let (start, end) = recording.span();
            let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
            let recorded = json!({"log": name, "start": start, "end": end});
            (json!({"live": null, "recorded": recorded}), Some(recording), None)
        }
    };
    let mut hello = hello;
    hello["type"] = "hello".into();
    hello["version"] = 1.into();
    hello["read_only"] = (options.read_only || steering.is_none()).into();
    let shared = Arc::new(Shared::new(hello, steering, scenery, options.read_only));
    std::thread::scope(|threads| {
        let (feeding, source) = (&shared, &source);
        let feed = move || match (source, recording) {
            (Source::Community(community), _) => live::follow(community, feeding, stop),
            (Source::Log(_), Some(recording)) => recording.play(feeding, stop),
            (Source::Log(_), None) => {}
        };
        let named = |name: &str| std::thread::Builder::new().name(name.to_owned());
        named("feed").spawn_scoped(threads, feed).map_err(ViewError::Io)?;
        if let Some(steering) = &shared.steering {
            let ask = || {
                let mut is_launched = false;
                while !stop.load(Ordering::Relaxed) {
                    if shared.is_watched() {
                        let rows = steering.apps();
                        // Which mission it is, nobody could say before there was a launcher.
                        if !std::mem::replace(&mut is_launched, rows.is_some()) && is_launched {
                            shared.scene.begin();
                        }
                        if let Some(rows) = rows {
                            shared.change(|model| model.apps(&rows));
                        }
                    }
                    let slept = Stopwatch::start();
                    while slept.elapsed() < APPS_EVERY && !stop.load(Ordering::Relaxed) {
                        std::thread::sleep(LOOK_EVERY);
                    }
                }
            };
            named("apps").spawn_scoped(threads, ask).map_err(ViewError::Io)?;
        }
        let door = Arc::new(Door::new(shared.clone(), wanted));
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(ViewError::Io)?;
        let served = runtime.block_on(async {
            let listener = Bounded::of(listener).map_err(ViewError::Io)?;
            on_ready(&format!("http://{address}/{query}"));
            let serving = async { axum::serve(listener, router(door.clone())).await.map_err(ViewError::Io) };
            let ending = async {
                stopped(stop).await;
                // Who does not hear it finds out for himself.
                let _ = timeout(GOODBYE, door.say_goodbye()).await;
                Ok(())
            };
            tokio::select! { served = serving => served, ended = ending => ended }
        });
        // Whatever this ended with, the feed is not to go on alone.
        stop.store(true, Ordering::Relaxed);
        runtime.shutdown_background();
        served
    })
}

fn listen(options: &Options) -> Result<std::net::TcpListener, ViewError> {
    let mut address = options.address;
    let last = address.port().saturating_add(if options.any_port { PORTS } else { 0 });
    loop {
        match std::net::TcpListener::bind(address) {
            Ok(listener) => {
                listener.set_nonblocking(true).map_err(ViewError::Io)?;
                return Ok(listener);
            }
            Err(error) if error.kind() == std::io::ErrorKind::AddrInUse && address.port() < last => {
                address.set_port(address.port() + 1);
            }
            Err(source) => return Err(ViewError::Listen { address: options.address, source }),
        }
    }
}
