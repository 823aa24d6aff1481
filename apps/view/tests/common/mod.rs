//! What the tests of the view share.

use std::collections::BTreeMap;
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;

use elk_bus::clock::Stopwatch;
use elk_geometry::{OccupancyGrid, State, Voxel};
use elk_spatial::map::MapUpdate;
use serde_json::{Value, json};
use tungstenite::client::IntoClientRequest;
use tungstenite::{Message, WebSocket};

/// How long anything may take on a machine that has much to do.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// A page, as far as the server sees it.
pub struct Page {
    /// Its connection.
    pub socket: WebSocket<TcpStream>,
    /// Occupied voxels by brick.
    pub bricks: BTreeMap<[i16; 3], u32>,
    /// How often it was told to forget all.
    pub resets: u32,
    /// Drawings by app and name: what was said of each, as far as it is listed.
    pub drawings: BTreeMap<(String, String), Value>,
    /// How often it was sent the surfaces of a world.
    pub surfaces: u32,
    /// The last message of each kind.
    last: BTreeMap<String, Value>,
}

impl Page {
    /// Opens it.
    pub fn open(address: SocketAddr, query: &str) -> Self {
        let stream = TcpStream::connect(address).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let request = format!("ws://{address}/ws{query}").into_client_request().unwrap();
        let (socket, _) = tungstenite::client(request, stream).unwrap();
        Self {
            socket,
            bricks: BTreeMap::new(),
            resets: 0,
            drawings: BTreeMap::new(),
            surfaces: 0,
            last: BTreeMap::new(),
        }
    }

    /// Says something.
    pub fn say(&mut self, message: &Value) {
        self.socket.send(Message::text(message.to_string())).unwrap();
    }

    /// The next message of a kind; frames are taken and acknowledged meanwhile.
    pub fn next(&mut self, kind: &str) -> Value {
        let waited = Stopwatch::start();
        while waited.elapsed() < PATIENCE {
            match self.socket.read().unwrap() {
                Message::Text(text) => {
                    let message: Value = serde_json::from_str(&text).unwrap();
                    if message["type"] == "frame" {
                        self.say(&json!({"type": "ack", "number": message["number"]}));
                    }
                    if message["type"] == "reset" {
                        self.resets += 1;
                        self.bricks.clear();
                        self.drawings.clear();
                        self.last.remove("value");
                    }
                    if message["type"] == "drawings" {
                        let rows = message["rows"].as_array().unwrap().clone();
                        self.drawings.retain(|(app, name), _| rows.contains(&json!({"app": app, "name": name})));
                    }
                    self.last.insert(message["type"].as_str().unwrap().to_owned(), message.clone());
                    if message["type"] == kind {
                        return message;
                    }
                }
                Message::Binary(frame) if frame[0] == 1 => self.take(&frame),
                Message::Binary(frame) if frame[0] == 3 => {
                    let words = u32::from_le_bytes(frame[4..8].try_into().unwrap()) as usize;
                    let said: Value = serde_json::from_slice(&frame[8..8 + words]).unwrap();
                    let text = |field: &str| said[field].as_str().unwrap().to_owned();
                    self.drawings.insert((text("app"), text("name")), said);
                }
                Message::Binary(frame) if frame[0] == 4 => self.surfaces += 1,
                _ => {}
            }
        }
        panic!("no {kind} has come");
    }

    /// The last message of a kind, which may have come already.
    pub fn last(&mut self, kind: &str) -> Value {
        self.last.get(kind).cloned().unwrap_or_else(|| self.next(kind))
    }

    fn take(&mut self, frame: &[u8]) {
        let mut rest = &frame[12..];
        while !rest.is_empty() {
            let index = |i: usize| i16::from_le_bytes([rest[2 * i], rest[2 * i + 1]]);
            let (brick, planes) = ([index(0), index(1), index(2)], rest[6]);
            rest = &rest[8..];
            let mut occupied = 0;
            for bit in [1, 2, 4] {
                if planes & bit != 0 {
                    let (plane, behind) = rest.split_at(64);
                    occupied += if bit == 2 { plane.iter().map(|byte| byte.count_ones()).sum() } else { 0 };
                    rest = behind;
                }
            }
            self.bricks.insert(brick, occupied);
        }
    }

    /// Occupied voxels.
    pub fn occupied(&self) -> u32 {
        self.bricks.values().sum()
    }
}

/// A wall that grows, a row of voxels a scan.
pub fn wall(map: &mut OccupancyGrid, scan: i32) -> MapUpdate {
    let voxels: Vec<Voxel> = (0..40).map(|x| Voxel::new(x, scan, 3)).collect();
    voxels.iter().for_each(|voxel| {
        map.set(*voxel, State::Occupied);
    });
    MapUpdate::new(map.advance(&voxels), scan as u64)
}
