//! What outlives a broker's death: who was there, and what for.
//!
//! A file in the community's folder, written anew whenever a client comes, goes or registers. It need not reach the disk:
//! it outlives processes, not machines. A broker that finds one with a living process in it takes the place of a broker
//! that died; any other is a leftover.

use std::path::PathBuf;

use rustix::process::Pid;
use serde::{Deserialize, Serialize};

use super::place;
use crate::broker::Place;
use crate::codec;
use crate::community::Community;

/// A client's place and its process.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Occupied {
    pub place: Place,
    pub process: u32,
}

fn file(community: &Community) -> PathBuf {
    place::root(community).join("places")
}

/// Writes who is there.
pub fn write(community: &Community, all: &[Occupied]) -> std::io::Result<()> {
    let file = file(community);
    let mut bytes = Vec::new();
    codec::encode_onto(&all, &mut bytes).map_err(std::io::Error::other)?;
    let fresh = file.with_extension("new");
    std::fs::create_dir_all(place::root(community))?;
    std::fs::write(&fresh, bytes)?;
    std::fs::rename(fresh, file)
}

/// Who was there when the last broker of the community died; nobody, if none of them lives.
pub fn read(community: &Community) -> Vec<Occupied> {
    let Ok(bytes) = std::fs::read(file(community)) else { return Vec::new() };
    // A file that cannot be read is of another version of elk; its clients could not be served anyway.
    let all: Vec<Occupied> = codec::decode_owned(&bytes, "places").unwrap_or_default();
    if all.iter().any(|one| lives(one.process)) { all } else { Vec::new() }
}

/// Whether a process is there and has not ended.
pub fn lives(process: u32) -> bool {
    let Some(pid) = i32::try_from(process).ok().and_then(Pid::from_raw) else { return false };
    // One that nobody has waited for yet answers signals, but it is dead.
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
    let state = stat.rsplit_once(") ").and_then(|(_, rest)| rest.chars().next());
    rustix::process::test_kill_process(pid).is_ok() && !matches!(state, Some('Z' | 'X'))
}
