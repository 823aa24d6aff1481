//! The page's server: files, and a WebSocket a page. It listens where only this machine comes, unless it is told another
//! address; then whoever comes needs a token.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::time::Duration;

use axum::Router;
use axum::extract::ws::{CloseFrame, Message, Utf8Bytes, WebSocket, WebSocketUpgrade};
use axum::extract::{Path, Query, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;

use crate::admission::{Key, is_this_machine, same};
use crate::page::{FILES, File};
use crate::session;
use crate::shared::Shared;

/// How often it is looked whether a server is to end.
const LOOK_EVERY: Duration = Duration::from_millis(50);
/// How often it is looked whether all pages have gone.
const GOODBYE_LOOK_EVERY: Duration = Duration::from_millis(5);
/// Pages at a time.
const MOST_PAGES: usize = 64;
/// The longest message that a page says (bytes).
const MOST_SAID: usize = 64 << 10;
/// What a page may load: its own files, and nothing from anywhere else.
const POLICY: &str = "default-src 'self'; frame-ancestors 'none'";
/// Why a page is not let in, as WebSocket says it: it breaks a rule.
const POLICY_VIOLATION: u16 = 1008;

/// Who may come, and what he is shown.
pub(crate) struct Door {
    pub shared: Arc<Shared>,
    /// What a page has to know; `None`: it has to come from this machine, under one of its own names.
    pub token: Option<String>,
    pages: AtomicUsize,
    numbers: AtomicU64,
}

impl Door {
    pub fn new(shared: Arc<Shared>, token: Option<String>) -> Self {
        Self { shared, token, pages: AtomicUsize::new(0), numbers: AtomicU64::new(1) }
    }

    /// Tells all pages that the view ends, and waits until they have gone.
    pub async fn say_goodbye(&self) {
        self.shared.end();
        while self.pages.load(Ordering::Relaxed) > 0 {
            tokio::time::sleep(GOODBYE_LOOK_EVERY).await;
        }
    }
}

/// The routes of a server.
pub(crate) fn router(door: Arc<Door>) -> Router {
    let index = |State(door): State<Arc<Door>>, headers: HeaderMap| async move {
        admit(&door, &headers).map_or_else(|why| refuse(&why), |()| shown(&FILES[0]))
    };
    let file = |State(door): State<Arc<Door>>, headers: HeaderMap, Path(path): Path<String>| async move {
        let found = FILES.iter().find(|file| file.path == path);
        let answer = || found.map_or_else(|| StatusCode::NOT_FOUND.into_response(), shown);
        admit(&door, &headers).map_or_else(|why| refuse(&why), |()| answer())
    };
    Router::new().route("/", get(index)).route("/ws", get(connect)).route("/{*path}", get(file)).with_state(door)
}

fn shown(file: &File) -> Response {
    let headers = [
        (header::CONTENT_TYPE, file.media_type()),
        (header::CACHE_CONTROL, "no-cache"),
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
    ];
    (headers, file.bytes).into_response()
}

async fn connect(
    State(door): State<Arc<Door>>,
    Query(key): Query<Key>,
    headers: HeaderMap,
    upgrade: WebSocketUpgrade,
) -> Response {
    if let Err(why) = admit(&door, &headers) {
        return refuse(&why);
    }
    let upgrade = upgrade.max_message_size(MOST_SAID).max_frame_size(MOST_SAID);
    if door.token.as_ref().is_some_and(|token| !same(token, &key.token)) {
        return turn_away(upgrade, "the token is missing or wrong: open the address that `elk view` printed");
    }
    let place = Place(door.clone());
    if door.pages.fetch_add(1, Ordering::Relaxed) >= MOST_PAGES {
        return turn_away(upgrade, "as many pages are open as may be: close one");
    }
    let number = door.numbers.fetch_add(1, Ordering::Relaxed);
    upgrade.on_upgrade(move |socket| async move {
        session::serve(number, socket, place.0.shared.clone()).await;
        drop(place);
    })
}

/// A page is only told what the WebSocket says, so that it has to be let in to be told why it is not.
fn turn_away(upgrade: WebSocketUpgrade, why: &'static str) -> Response {
    upgrade.on_upgrade(async move |mut socket: WebSocket| {
        let frame = CloseFrame { code: POLICY_VIOLATION, reason: Utf8Bytes::from_static(why) };
        // Who has gone need not be told.
        let _ = socket.send(Message::Close(Some(frame))).await;
    })
}

/// A page's place among those that may be open; it is free again when this is dropped, also of a page that never came.
struct Place(Arc<Door>);

impl Drop for Place {
    fn drop(&mut self) {
        self.0.pages.fetch_sub(1, Ordering::Relaxed);
    }
}

/// A page of somebody else's, or one that reached this machine under another's name, must not steer a robot.
fn admit(door: &Door, headers: &HeaderMap) -> Result<(), String> {
    let text = |name| headers.get(name).map(|value| value.to_str().unwrap_or_default());
    let host = text(header::HOST).unwrap_or_default();
    if door.token.is_none() && !is_this_machine(host) {
        return Err(format!("{host:?} is no name of this machine alone: open http://127.0.0.1 with the port"));
    }
    match text(header::ORIGIN) {
        Some(origin) if origin.split_once("://").is_none_or(|(_, from)| from != host) => {
            Err(format!("a page of {origin} may not talk to this one"))
        }
        _ => Ok(()),
    }
}

fn refuse(why: &str) -> Response {
    (StatusCode::FORBIDDEN, format!("{why}\n")).into_response()
}

/// Comes back when `stop` is set.
pub(crate) async fn stopped(stop: &AtomicBool) {
    while !stop.load(Ordering::Relaxed) {
        tokio::time::sleep(LOOK_EVERY).await;
    }
}
