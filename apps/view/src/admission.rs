//! Names of this machine, and tokens for whoever comes from another one.

use std::io::Read;
use std::net::SocketAddr;

use serde::Deserialize;

use crate::error::ViewError;

/// What an address says besides.
#[derive(Deserialize)]
pub(crate) struct Key {
    #[serde(default)]
    pub token: String,
}

/// Whether a `Host` is one under which only this machine is reached.
pub(crate) fn is_this_machine(host: &str) -> bool {
    if let Ok(address) = host.parse::<SocketAddr>() {
        return address.ip().is_loopback();
    }
    let name = host.rsplit_once(':').map_or(host, |(name, _)| name);
    name == "localhost" || name.parse::<std::net::Ipv4Addr>().is_ok_and(|ip| ip.is_loopback()) || host == "[::1]"
}

/// Whether two tokens are the same; how long that takes says nothing of where they differ.
pub(crate) fn same(one: &str, other: &str) -> bool {
    let differing = one.bytes().zip(other.bytes()).fold(0, |differing, (a, b)| differing | (a ^ b));
    one.len() == other.len() && differing == 0
}

/// 128 bits that nobody can guess.
pub(crate) fn token() -> Result<String, ViewError> {
    let mut bytes = [0u8; 16];
    std::fs::File::open("/dev/urandom").and_then(|mut source| source.read_exact(&mut bytes)).map_err(ViewError::Io)?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_names_of_this_machine_are_this_machine() {
        for host in ["127.0.0.1:8080", "localhost:8080", "localhost", "[::1]:8080", "127.0.0.1", "[::1]"] {
            assert!(is_this_machine(host), "{host}");
        }
        for host in [
            "",
            "evil.example:8080",
            "localhost.evil.example",
            "10.0.0.1:8080",
            "127.0.0.1.evil.example:80",
            "0.0.0.0:80",
        ] {
            assert!(!is_this_machine(host), "{host}");
        }
        assert!(same("abc", "abc") && !same("abc", "abd") && !same("abc", "ab") && !same("abc", ""));
    }
}
