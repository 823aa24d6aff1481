//! A page of `elk view`, as its server sees it.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::net::TcpStream;
use std::process::{Child, Stdio};
use std::time::Duration;

use elk_bus::clock::Stopwatch;
use serde_json::{Value, json};
use tungstenite::client::IntoClientRequest;
use tungstenite::{Message, WebSocket};

use super::Elk;

/// How long anything may take on a machine that has much to do.
const PATIENCE: Duration = Duration::from_secs(60);

/// A view, and a page of it.
pub struct Page {
    view: Child,
    socket: WebSocket<TcpStream>,
    /// The last message of each type, other than frames.
    last: BTreeMap<String, Value>,
}

impl Page {
    /// Starts a view of the community, and opens its page.
    pub fn open(elk: &Elk) -> Self {
        let mut view = elk
            .command(&["view", "--port", "0", "--community", elk.community()])
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(view.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let address = line.trim().trim_start_matches("http://").trim_end_matches('/');
        let stream = TcpStream::connect(address).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let request = format!("ws://{address}/ws").into_client_request().unwrap();
        let (socket, _) = tungstenite::client(request, stream).unwrap();
        Self { view, socket, last: BTreeMap::new() }
    }

    /// Says something.
    pub fn say(&mut self, message: &Value) {
        self.socket.send(Message::text(message.to_string())).unwrap();
    }

    /// A message that is as wanted: the last one of its type, or the next; frames are acknowledged meanwhile.
    pub fn wait_for_message(&mut self, is_wanted: impl Fn(&Value) -> bool) -> Value {
        if let Some(last) = self.last.values().find(|last| is_wanted(last)) {
            return last.clone();
        }
        self.wait_for(|message| match message {
            Message::Text(text) => serde_json::from_str(text).ok().filter(&is_wanted),
            _ => None,
        })
    }

    /// What is said of a drawing, the next time it comes.
    pub fn wait_for_drawing(&mut self, app: &str, name: &str) -> Value {
        self.wait_for(|message| match message {
            Message::Binary(frame) if frame[0] == 3 => {
                let words = u32::from_le_bytes(frame[4..8].try_into().unwrap()) as usize;
                let said: Value = serde_json::from_slice(&frame[8..8 + words]).unwrap();
                (said["app"] == app && said["name"] == name).then_some(said)
            }
            _ => None,
        })
    }

    fn wait_for(&mut self, take: impl Fn(&Message) -> Option<Value>) -> Value {
        let waited = Stopwatch::start();
        while waited.elapsed() < PATIENCE {
            let message = self.socket.read().unwrap();
            if let Message::Text(text) = &message {
                let said: Value = serde_json::from_str(text).unwrap();
                if said["type"] == "frame" {
                    self.say(&json!({"type": "ack", "number": said["number"]}));
                }
                self.last.insert(said["type"].as_str().unwrap().to_owned(), said);
            }
            if let Some(taken) = take(&message) {
                return taken;
            }
        }
        panic!("it has not come");
    }
}

impl Drop for Page {
    fn drop(&mut self) {
        self.view.kill().and_then(|()| self.view.wait()).unwrap();
    }
}
