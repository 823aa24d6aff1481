//! Which communities run on this machine: the kernel lists the sockets that brokers listen on.

use std::collections::BTreeSet;
use std::io::ErrorKind;

use elk_os::{Owner, own_user};
use elk_proto::community::Community;

use super::handshake;

/// A community that a broker of this machine serves.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Running {
    /// The community.
    pub community: Community,
    /// Who serves it; `None` if more connections wait than it takes in, so that nobody can ask.
    pub broker: Option<Owner>,
}

impl Running {
    /// Whether this process runs as the same user, and so can join.
    pub fn is_own(&self) -> bool {
        self.broker.is_some_and(|broker| broker.user == own_user())
    }
}

/// All communities that run on this machine (in this network namespace), by name.
pub fn running() -> std::io::Result<Vec<Running>> {
    let sockets = std::fs::read_to_string("/proc/net/unix")?;
    Ok(served(&sockets).into_iter().filter_map(ask).collect())
}

/// `None`: the broker has stopped since the kernel listed it.
fn ask(community: Community) -> Option<Running> {
    let broker = match handshake::connect_now(&community) {
        Ok(stream) => Some(Owner::at_other_end(&stream).ok()?),
        Err(error) if error.kind() == ErrorKind::WouldBlock => None,
        Err(_) => return None,
    };
    Some(Running { community, broker })
}

/// The communities whose brokers' sockets listen, from the text of `/proc/net/unix`: its columns are number, references,
/// protocol, flags, type, state, inode and path.
fn served(sockets: &str) -> BTreeSet<Community> {
    const LISTENS: &str = "00010000";
    let community = |line: &str| {
        let mut columns = line.split_whitespace();
        columns.nth(3).filter(|flags| *flags == LISTENS)?;
        Community::new(columns.nth(3)?.strip_prefix("@elk/")?).ok()
    };
    sockets.lines().filter_map(community).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn listening_sockets_of_brokers_are_found_among_all_others() {
        let sockets = "Num       RefCount Protocol Flags    Type St Inode Path\n\
             00000000c2: 00000002 00000000 00010000 0001 01 118 @elk/lab-1\n\
             00000000c3: 00000003 00000000 00000000 0001 03 119 @elk/lab-2\n\
             00000000c4: 00000002 00000000 00010000 0001 01 120 /run/elk/lab-3\n\
             00000000c5: 00000002 00000000 00010000 0001 01 121\n\
             00000000c6: 00000002 00000000 00010000 0001 01 122 @elk/no name\n\
             00000000c7: 00000002 00000000 00010000 0001 01 123 @elk/an.apartment\n";
        let found: Vec<String> = served(sockets).iter().map(ToString::to_string).collect();
        assert_eq!(found, ["an.apartment", "lab-1", "no"]);
    }

    #[test]
    fn a_broker_is_found_with_its_process_and_user() {
        let community = Community::new(format!("running-{}", std::process::id())).unwrap();
        let _socket = handshake::listen(&community).unwrap();
        let found = running().unwrap().into_iter().find(|one| one.community == community);
        let broker = Owner { process: std::process::id(), user: own_user() };
        assert_eq!(found, Some(Running { community, broker: Some(broker) }));
    }

    #[test]
    fn a_community_whose_door_is_full_is_there_and_holds_nobody_up() {
        let community = Community::new(format!("crowded-{}", std::process::id())).unwrap();
        let socket = handshake::listen(&community).unwrap();
        rustix::net::listen(&socket, 0).unwrap();
        let _queue: Vec<_> = std::iter::from_fn(|| handshake::connect_now(&community).ok()).collect();
        let found = running().unwrap().into_iter().find(|one| one.community == community);
        assert_eq!(found, Some(Running { community, broker: None }));
    }
}
