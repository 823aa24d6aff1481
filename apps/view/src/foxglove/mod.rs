//! A community for Lichtblick, Foxglove, and whatever else speaks Foxglove's WebSocket protocol.
//!
//! | module | one idea |
//! |---|---|
//! | `protocol` | what clients and server say to each other |
//! | `outbox` | what waits for one client, and what of it is left out |
//! | `graph`, `services` | who writes and reads what; what can be called |
//! | `hub`, `feed` | the channels and who wants them; what of the bus is heard for them |
//! | `host`, `session` | what all clients have in common; one client |
//!
//! Messages of channels are byte for byte those of a log ([`elk_log::shown`]).

mod feed;
mod graph;
mod host;
mod hub;
mod outbox;
mod protocol;
mod services;
mod session;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::time::Duration;

use axum::Router;
use axum::extract::ws::WebSocketUpgrade;
use axum::extract::ws::rejection::WebSocketUpgradeRejection;
use axum::extract::{Query, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use elk_bus::Community;
use serde_json::{Value, json};

pub use host::{FoxgloveOptions, Mission};
pub use protocol::Parameter;

use crate::admission::{Key, is_this_machine, same, token};
use crate::connections::Bounded;
use crate::error::ViewError;
use crate::server::stopped;
use host::Host;
use hub::Hub;
use protocol::{JSON, SUBPROTOCOLS};

/// Clients at a time.
const MOST_CLIENTS: usize = 32;
/// The longest message that a client says (bytes).
const MOST_SAID: usize = 1 << 20;
/// How often it is looked whether parameters have changed.
const PARAMETERS_EVERY: Duration = Duration::from_secs(1);
/// Where pages come from that are part of a program of this machine: Electron's, as Lichtblick's are.
const OF_A_PROGRAM: &str = "file://";

/// Serves clients until `stop` is set; `on_ready` is told the address that they connect to.
///
/// # Errors
/// The port is taken, or the operating system refuses.
pub fn serve_foxglove(
    community: &Community,
    options: FoxgloveOptions,
    mission: Option<Arc<dyn Mission>>,
    on_ready: impl FnOnce(&str),
    stop: &AtomicBool,
) -> Result<(), ViewError> {
    let refused = |source| ViewError::ListenFoxglove { address: options.address, source };
    let listener = std::net::TcpListener::bind(options.address).map_err(refused)?;
    listener.set_nonblocking(true).map_err(ViewError::Io)?;
    let address = listener.local_addr().map_err(ViewError::Io)?;
    let wanted = if options.address.ip().is_loopback() { None } else { Some(token()?) };
    let query = wanted.as_ref().map_or(String::new(), |token| format!("/?token={token}"));
    let info = info(community, &token()?, !options.read_only && mission.is_some());
    let (clients, numbers) = (AtomicUsize::new(0), AtomicU64::new(1));
    let host = Arc::new(Host { hub: Hub::default(), mission, info, options, token: wanted, clients, numbers });
    std::thread::scope(|threads| {
        let named = |name: &str| std::thread::Builder::new().name(name.to_owned());
        let served = (|| {
            named("feed").spawn_scoped(threads, || feed::follow(community, &host.hub, stop)).map_err(ViewError::Io)?;
            named("parameters").spawn_scoped(threads, || watch_parameters(&host, stop)).map_err(ViewError::Io)?;
            let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(ViewError::Io)?;
            let served = runtime.block_on(async {
                let listener = Bounded::of(listener).map_err(ViewError::Io)?;
                on_ready(&format!("ws://{address}{query}"));
                let router = Router::new().fallback(connect).with_state(host.clone());
                let serving = async { axum::serve(listener, router).await.map_err(ViewError::Io) };
                tokio::select! { served = serving => served, () = stopped(stop) => Ok(()) }
            });
            runtime.shutdown_background();
            served
        })();
        // Whatever this ended with, the threads are not to go on alone.
        stop.store(true, Ordering::Relaxed);
        served
    })
}

fn info(community: &Community, session: &str, may_steer: bool) -> Value {
    let looking = ["time", "parameters", "parametersSubscribe", "connectionGraph"];
    let steering = if may_steer { &["clientPublish", "services"][..] } else { &[] };
    json!({
        "op": "serverInfo", "name": format!("elk: {community}"), "sessionId": session,
        "capabilities": looking.iter().chain(steering).collect::<Vec<_>>(), "supportedEncodings": [JSON],
        "metadata": {"elk": env!("CARGO_PKG_VERSION"), "community": community.as_str()},
    })
}

/// Tells who watches parameters what others have changed of them.
fn watch_parameters(host: &Host, stop: &AtomicBool) {
    while !stop.load(Ordering::Relaxed) {
        if host.hub.watches_parameters() {
            host.hub.parameters(host.parameters());
        }
        std::thread::sleep(PARAMETERS_EVERY);
    }
}

async fn connect(
    State(host): State<Arc<Host>>,
    Query(key): Query<Key>,
    headers: HeaderMap,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> Response {
    let refuse = |code: StatusCode, why: &str| (code, format!("{why}\n")).into_response();
    if let Err(why) = admit(&host, &headers, &key.token) {
        return refuse(StatusCode::FORBIDDEN, &why);
    }
    let Ok(upgrade) = upgrade else {
        let why = "this is Foxglove's WebSocket: open it in Lichtblick or Foxglove as a connection";
        return refuse(StatusCode::UPGRADE_REQUIRED, why);
    };
    let upgrade = upgrade.max_message_size(MOST_SAID).max_frame_size(MOST_SAID).protocols(SUBPROTOCOLS);
    if upgrade.selected_protocol().is_none() {
        let why = format!("a client has to offer the protocol {}", SUBPROTOCOLS.join(" or "));
        return refuse(StatusCode::BAD_REQUEST, &why);
    }
    let place = Place(host.clone());
    if host.clients.fetch_add(1, Ordering::Relaxed) >= MOST_CLIENTS {
        return refuse(StatusCode::SERVICE_UNAVAILABLE, "as many clients are there as may be: close one");
    }
    let number = host.numbers.fetch_add(1, Ordering::Relaxed);
    upgrade.on_upgrade(move |socket| async move {
        session::serve(number, socket, place.0.clone()).await;
        drop(place);
    })
}

/// A client's place among those that may be there; it is free again when this is dropped, also of one that never came.
struct Place(Arc<Host>);

impl Drop for Place {
    fn drop(&mut self) {
        self.0.clients.fetch_sub(1, Ordering::Relaxed);
    }
}

/// A page of somebody else's must not steer a robot, and Lichtblick is a page: it may come if this machine shows it, if it
/// was named, or if it knows the token, which no page can guess.
fn admit(host: &Host, headers: &HeaderMap, token: &str) -> Result<(), String> {
    if let Some(wanted) = &host.token {
        let wrong = "the token is missing or wrong: connect to the address that `elk view --foxglove` printed";
        return same(wanted, token).then_some(()).ok_or_else(|| wrong.to_owned());
    }
    let text = |name| headers.get(name).map(|value| value.to_str().unwrap_or_default());
    let name = text(header::HOST).unwrap_or_default();
    if !is_this_machine(name) {
        return Err(format!("{name:?} is no name of this machine alone: connect to ws://127.0.0.1 with the port"));
    }
    match text(header::ORIGIN) {
        Some(origin) if !is_welcome(origin, &host.options.origins) => {
            Err(format!("a page of {origin} may not come here; if it is to, say --origin {origin}"))
        }
        _ => Ok(()),
    }
}

fn is_welcome(origin: &str, named: &[String]) -> bool {
    let is_of_this_machine = origin.strip_prefix("http://").is_some_and(is_this_machine);
    origin == OF_A_PROGRAM || is_of_this_machine || named.iter().any(|one| one.trim_end_matches('/') == origin)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_of_this_machine_and_of_named_sites_are_welcome_and_no_others() {
        let named = ["https://app.foxglove.dev/".to_owned()];
        for origin in ["http://localhost:8080", "http://127.0.0.1:3000", "file://", "https://app.foxglove.dev"] {
            assert!(is_welcome(origin, &named), "{origin}");
        }
        for origin in [
            "null",
            "",
            "https://evil.example",
            "http://localhost.evil.example:8080",
            "https://app.foxglove.dev.evil.example",
            "file://evil",
        ] {
            assert!(!is_welcome(origin, &named), "{origin}");
        }
    }
}
