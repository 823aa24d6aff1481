//! What outlives a broker's death: who was there, and what for; and what those have left who are gone.
//!
//! Two files in the community's folder, the one written anew whenever a client comes, goes or registers, the other when
//! one goes. They need not reach the disk: they outlive processes, not machines. A broker that finds a living process in
//! them takes the place of a broker that died; any other is a leftover.

use rustix::process::Pid;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::place::Place as Home;
use crate::broker::{Legacy, Place};
use crate::codec;

/// A client's place and its process.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Occupied {
    pub place: Place,
    pub process: u32,
}

const PLACES: &str = "places";
const LEGACIES: &str = "legacies";

/// Writes who is there.
pub fn write(home: &Home, all: &[Occupied]) -> std::io::Result<()> {
    write_file(home, PLACES, &all)
}

/// Writes what those have left who are gone.
pub fn write_legacies(home: &Home, all: &[Legacy]) -> std::io::Result<()> {
    write_file(home, LEGACIES, &all)
}

/// Who was there when the last broker of the community died; nobody, if none of them lives.
pub fn read(home: &Home) -> Vec<Occupied> {
    let all: Vec<Occupied> = read_file(home, PLACES);
    if all.iter().any(|one| lives(one.process)) { all } else { Vec::new() }
}

/// What those had left who were gone by then.
pub fn read_legacies(home: &Home) -> Vec<Legacy> {
    read_file(home, LEGACIES)
}

fn write_file<T: Serialize>(home: &Home, name: &str, all: &T) -> std::io::Result<()> {
    let mut bytes = Vec::new();
    codec::encode_onto(all, &mut bytes).map_err(std::io::Error::other)?;
    home.folder().write(name, &bytes)
}

/// A file that cannot be read is of another version of elk, whose clients could not be served anyway.
fn read_file<T: DeserializeOwned + Default>(home: &Home, name: &'static str) -> T {
    let bytes = home.folder().read(name);
    bytes.ok().and_then(|bytes| codec::decode_owned(&bytes, name).ok()).unwrap_or_default()
}

/// Whether a process is there and has not ended.
pub fn lives(process: u32) -> bool {
    let Some(pid) = i32::try_from(process).ok().and_then(Pid::from_raw) else { return false };
    // One that nobody has waited for yet answers signals, but it is dead.
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
    let state = stat.rsplit_once(") ").and_then(|(_, rest)| rest.chars().next());
    rustix::process::test_kill_process(pid).is_ok() && !matches!(state, Some('Z' | 'X'))
}
