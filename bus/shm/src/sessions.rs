//! What outlives a broker's death: who was there, and what for; and what those have left who are gone.
//!
//! Two files in the community's folder, the one written anew whenever a client comes, goes or registers, the other when
//! one goes. They need not reach the disk: they outlive processes, not machines. A broker that finds a living process in
//! them takes over from a broker that died; any other is a leftover.

use std::io::ErrorKind;
use std::path::PathBuf;

use elk_os::{ProcessId, tell};
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

/// A file, and what is lost with it.
struct File {
    name: &'static str,
    lost: &'static str,
}

const SESSIONS: File = File {
    name: "sessions",
    lost: "the sessions of its clients are lost, and the values of those that are gone: what is said until a client is back \
           does not reach it",
};
const RETAINED: File = File { name: "retained", lost: "the latest values of clients that are gone are lost" };

/// A file of the broker before this one that is of no use.
#[derive(Debug, thiserror::Error)]
#[error("elk db: the file {} of the broker before this one cannot be read: {why}; {lost}", .file.display())]
struct Unreadable {
    file: PathBuf,
    why: String,
    lost: &'static str,
}

/// Writes who is there.
pub fn write(at: &namespace::Namespace, all: &[Held]) -> std::io::Result<()> {
    write_file(at, &SESSIONS, &all)
}

/// Writes what those have left who are gone.
pub fn write_retained(at: &namespace::Namespace, all: &[Retained]) -> std::io::Result<()> {
    write_file(at, &RETAINED, &all)
}

/// Who was there when the last broker of the community died; nobody, if none of them lives.
pub fn read(at: &namespace::Namespace) -> Vec<Held> {
    let all: Vec<Held> = read_or_tell(at, &SESSIONS);
    if all.iter().any(Held::is_alive) { all } else { Vec::new() }
}

/// What those had left who were gone by then.
pub fn read_retained(at: &namespace::Namespace) -> Vec<Retained> {
    read_or_tell(at, &RETAINED)
}

fn write_file<T: Serialize>(at: &namespace::Namespace, file: &File, all: &T) -> std::io::Result<()> {
    let mut bytes = Vec::new();
    codec::encode_onto(all, &mut bytes).map_err(std::io::Error::other)?;
    at.folder().write(file.name, &bytes)
}

/// What a file has; nothing, if it is damaged or of another version of elk, and that is told.
fn read_or_tell<T: DeserializeOwned>(at: &namespace::Namespace, file: &File) -> Vec<T> {
    read_file(at, file).unwrap_or_else(|unreadable| {
        tell(unreadable);
        Vec::new()
    })
}

/// What a file has; nothing, if there is none.
fn read_file<T: DeserializeOwned>(at: &namespace::Namespace, file: &File) -> Result<Vec<T>, Unreadable> {
    let unreadable = |why: String| Unreadable { file: at.folder().path().join(file.name), why, lost: file.lost };
    match at.folder().read(file.name) {
        Ok(bytes) => codec::decode_owned(&bytes, file.name).map_err(|error| unreadable(error.to_string())),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(Vec::new()),
        Err(error) => Err(unreadable(error.to_string())),
    }
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

    #[test]
    fn a_damaged_file_is_told_of_with_what_is_lost_and_one_that_is_not_there_is_no_damage() {
        let shared = tempfile::tempdir().unwrap();
        let home = Folder::make(&shared.path().join("home")).unwrap();
        let community = Community::new("lab").unwrap();
        let folder = home.make_child("lab").unwrap();
        folder.write("made-by-elk", b"lab").unwrap();
        let at = namespace::Namespace::open_in(&home, &community).unwrap();
        assert_eq!(read_file::<Held>(&at, &SESSIONS).unwrap(), []);
        folder.write("sessions", b"\xff\xff\xff").unwrap();
        let said = read_file::<Held>(&at, &SESSIONS).unwrap_err().to_string();
        let file = folder.path().join("sessions").display().to_string();
        assert!(said.contains(&file) && said.contains("the sessions of its clients are lost"), "{said}");
        assert_eq!(read(&at), [], "and the broker starts without them");
        folder.write("retained", b"\xff\xff\xff").unwrap();
        let said = read_file::<Retained>(&at, &RETAINED).unwrap_err().to_string();
        assert!(said.contains("the latest values of clients that are gone are lost"), "{said}");
    }
}
