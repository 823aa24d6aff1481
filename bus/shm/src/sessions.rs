//! What outlives a broker's death: who was there, and what for; and what those have left who are gone.
//!
//! Two files in the community's folder, the one written anew whenever a client comes, goes or registers, the other when
//! one goes. They need not reach the disk: they outlive processes, not machines. A broker that finds a living process in
//! them takes over from a broker that died; any other is a leftover.

use elk_os::ProcessId;
use elk_proto::broker::{Retained, Session};
use elk_proto::codec;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::namespace;

/// A client's session, and the process that holds it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Held {
    pub session: Session,
    /// `None`: the client was gone already, or cannot be seen from here.
    pub process: Option<ProcessId>,
}

impl Held {
    /// Whether its process lives: that one, and not another that has its number by now.
    pub fn is_alive(&self) -> bool {
        self.process.is_some_and(|process| process.lives())
    }
}

const SESSIONS: &str = "sessions";
const RETAINED: &str = "retained";

/// Writes who is there.
pub fn write(at: &namespace::Namespace, all: &[Held]) -> std::io::Result<()> {
    write_file(at, SESSIONS, &all)
}

/// Writes what those have left who are gone.
pub fn write_retained(at: &namespace::Namespace, all: &[Retained]) -> std::io::Result<()> {
    write_file(at, RETAINED, &all)
}

/// Who was there when the last broker of the community died; nobody, if none of them lives.
pub fn read(at: &namespace::Namespace) -> Vec<Held> {
    let all: Vec<Held> = read_file(at, SESSIONS);
    if all.iter().any(Held::is_alive) { all } else { Vec::new() }
}

/// What those had left who were gone by then.
pub fn read_retained(at: &namespace::Namespace) -> Vec<Retained> {
    read_file(at, RETAINED)
}

fn write_file<T: Serialize>(at: &namespace::Namespace, name: &str, all: &T) -> std::io::Result<()> {
    let mut bytes = Vec::new();
    codec::encode_onto(all, &mut bytes).map_err(std::io::Error::other)?;
    at.folder().write(name, &bytes)
}

/// A file that cannot be read is of another version of elk, whose clients could not be served anyway.
fn read_file<T: DeserializeOwned + Default>(at: &namespace::Namespace, name: &'static str) -> T {
    let bytes = at.folder().read(name);
    bytes.ok().and_then(|bytes| codec::decode_owned(&bytes, name).ok()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::super::folder::Folder;
    use super::*;
    use elk_proto::community::Community;

    /// A container that was killed and started again over the same folder finds its own numbers in it.
    #[test]
    fn a_living_process_with_the_number_of_a_dead_one_holds_no_session() {
        let shared = tempfile::tempdir().unwrap();
        let home = Folder::make(&shared.path().join("home")).unwrap();
        let community = Community::new("lab").unwrap();
        home.make_child("lab").unwrap().write("made-by-elk", b"lab").unwrap();
        let at = namespace::Namespace::open_in(&home, &community).unwrap();
        let own = ProcessId::of(std::process::id() as i32).unwrap();
        let mut before = own;
        before.started -= 1;
        let launcher = |process| {
            let session = Session { name: "launcher".into(), lease_secs: 15.0, registrations: Vec::new() };
            vec![Held { session, process }]
        };
        for (process, found) in [(Some(own), 1), (Some(before), 0), (None, 0)] {
            write(&at, &launcher(process)).unwrap();
            assert_eq!(read(&at).len(), found, "{process:?}");
        }
    }
}
