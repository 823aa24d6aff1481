//! Where clients of MOOS' connect, and from where they may.

use std::fmt;
use std::io::ErrorKind;
use std::net::{IpAddr, SocketAddr, TcpListener, ToSocketAddrs};
use std::str::FromStr;

use crate::text::Texts;

/// The most clients of MOOS' at a time, if nobody says otherwise.
pub const CONNECTIONS: usize = 128;
/// The most that anybody can say: each may have a message of 1 MiB on its way in.
pub const MOST_CONNECTIONS: usize = 1024;

/// How a gateway is to be.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GatewayOptions {
    /// Where it listens.
    pub address: Address,
    /// From where clients may connect, beside this very machine.
    pub networks: Vec<Network>,
    /// Whether a client may publish under the names of others, as players of logs and bridges do.
    pub any_source: bool,
    /// Which variables' typed values clients hear and say as texts.
    pub texts: Texts,
    /// The most clients at a time.
    pub connections: usize,
}

impl GatewayOptions {
    /// A gateway for clients of this machine that publish under their own names.
    pub fn new(address: Address) -> Self {
        Self { address, networks: Vec::new(), any_source: false, texts: Texts::default(), connections: CONNECTIONS }
    }

    /// Whether a client may connect from there.
    pub fn admits(&self, from: IpAddr) -> bool {
        let from = from.to_canonical();
        from.is_loopback() || self.networks.iter().any(|network| network.has(from))
    }
}

/// An address to listen at, as it is said: `127.0.0.1:9000`, `localhost:9000`, `[::1]:9000`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Address(String);

/// What is no address to listen at, or no network.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum AddressError {
    /// No address.
    #[error("{0:?} is no address to listen at; right is HOST:PORT, such as 127.0.0.1:9000")]
    Address(String),
    /// No network.
    #[error("{0:?} is no network; right is an address, or an address and how many of its bits count: 192.168.1.0/24")]
    Network(String),
}

impl FromStr for Address {
    type Err = AddressError;

    fn from_str(said: &str) -> Result<Self, AddressError> {
        let bad = || AddressError::Address(said.to_owned());
        let (host, port) = said.rsplit_once(':').ok_or_else(bad)?;
        let is_host = !host.is_empty() && !host.contains(char::is_whitespace);
        if !is_host || port.parse::<u16>().is_err() {
            return Err(bad());
        }
        Ok(Self(said.to_owned()))
    }
}

impl Address {
    /// The host, as it was said.
    pub fn host(&self) -> &str {
        self.0.rsplit_once(':').map_or("", |(host, _)| host)
    }

    /// The host that a client of this machine connects to.
    pub fn host_to_connect_to(&self) -> &str {
        match self.host() {
            "0.0.0.0" | "[::]" => "localhost",
            host => host.trim_start_matches('[').trim_end_matches(']'),
        }
    }

    /// The same, with a port that is free now if any was right (`0`): for whoever has to name it before anybody listens there.
    ///
    /// # Errors
    /// There is none, or the host is nobody's.
    pub fn settled(&self) -> std::io::Result<Self> {
        if self.port() != "0" {
            return Ok(self.clone());
        }
        let port = TcpListener::bind(&self.0)?.local_addr()?.port();
        Ok(Self(format!("{}:{port}", self.host())))
    }

    /// The port, as it was said.
    pub fn port(&self) -> &str {
        self.0.rsplit_once(':').map_or("", |(_, port)| port)
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// Addresses whose first bits are the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Network {
    address: IpAddr,
    bits: u8,
}

impl Network {
    fn has(&self, other: IpAddr) -> bool {
        let (own, other, width): (u128, u128, u32) = match (self.address, other) {
            (IpAddr::V4(own), IpAddr::V4(other)) => (u32::from(own).into(), u32::from(other).into(), 32),
            (IpAddr::V6(own), IpAddr::V6(other)) => (own.into(), other.into(), 128),
            _ => return false,
        };
        let ignored = width - u32::from(self.bits);
        own.checked_shr(ignored).unwrap_or(0) == other.checked_shr(ignored).unwrap_or(0)
    }
}

impl FromStr for Network {
    type Err = AddressError;

    fn from_str(said: &str) -> Result<Self, AddressError> {
        let bad = || AddressError::Network(said.to_owned());
        let (address, bits) = said.split_once('/').map_or((said, None), |(address, bits)| (address, Some(bits)));
        let address: IpAddr = address.parse().map_err(|_| bad())?;
        let width = if address.is_ipv4() { 32 } else { 128 };
        let bits = bits.map_or(Ok(width), |bits| bits.parse().map_err(|_| bad()))?;
        if bits > width { Err(bad()) } else { Ok(Self { address, bits }) }
    }
}

impl fmt::Display for Network {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.address, self.bits)
    }
}

/// Why nobody can be listened for.
#[derive(Debug, thiserror::Error)]
pub enum GatewayError {
    /// The name of the host is nobody's.
    #[error("{address} is no address of this machine for clients of MOOS': {source}; 127.0.0.1:9000 is one")]
    Unknown {
        /// As it was said.
        address: Address,
        /// Why.
        source: std::io::Error,
    },
    /// Somebody else listens there.
    #[error(
        "clients of MOOS' cannot be listened for at {address}: another program does already (a MOOSDB, or another elk); \
         stop it, or choose another port; `ss -ltnp 'sport = :{}'` says which program it is",
        .address.port()
    )]
    Taken {
        /// Where.
        address: SocketAddr,
    },
    /// The operating system refused.
    #[error("clients of MOOS' cannot be listened for at {address}: {source}")]
    Io {
        /// Where.
        address: SocketAddr,
        /// Why.
        source: std::io::Error,
    },
    /// Other machines could connect, and none may.
    #[error(
        "{address} can be reached from other machines, and nobody has said from which clients may come: say so \
         (--moos-from 192.168.1.0/24; in a mission from=\"192.168.1.0/24\"), or listen at 127.0.0.1"
    )]
    NobodyMay {
        /// Where.
        address: SocketAddr,
    },
}

/// Listens as the options say.
///
/// # Errors
/// See [`GatewayError`].
pub(super) fn listen(options: &GatewayOptions) -> Result<TcpListener, GatewayError> {
    let unknown = |source| GatewayError::Unknown { address: options.address.clone(), source };
    let found: Vec<SocketAddr> = options.address.0.to_socket_addrs().map_err(unknown)?.collect();
    // MOOS' own clients speak the fourth version alone.
    let address = found.iter().find(|address| address.is_ipv4()).or(found.first()).copied();
    let address = address.ok_or_else(|| unknown(ErrorKind::NotFound.into()))?;
    if !address.ip().is_loopback() && options.networks.is_empty() {
        return Err(GatewayError::NobodyMay { address });
    }
    let refused = |source: std::io::Error| match source.kind() {
        ErrorKind::AddrInUse => GatewayError::Taken { address },
        _ => GatewayError::Io { address, source },
    };
    let listener = TcpListener::bind(address).map_err(refused)?;
    listener.set_nonblocking(true).map_err(refused)?;
    Ok(listener)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_has_a_host_and_a_port_and_a_network_so_many_bits() {
        for good in ["127.0.0.1:9000", "localhost:9000", "[::1]:9000", "0.0.0.0:0"] {
            assert_eq!(good.parse::<Address>().unwrap().to_string(), good);
        }
        let settled = |said: &str| said.parse::<Address>().unwrap().settled().unwrap();
        assert_eq!(settled("localhost:9000").to_string(), "localhost:9000");
        let any = settled("127.0.0.1:0");
        assert!(any.host() == "127.0.0.1" && any.port() != "0", "{any}");
        let connected = |said: &str| said.parse::<Address>().unwrap().host_to_connect_to().to_owned();
        assert_eq!(["0.0.0.0:1", "[::1]:1", "boat:1"].map(connected), ["localhost", "::1", "boat"]);
        for bad in ["", "9000", "127.0.0.1", ":9000", "a b:9000", "127.0.0.1:90000", "127.0.0.1:x"] {
            let said = bad.parse::<Address>().unwrap_err().to_string();
            assert!(said.contains("right is HOST:PORT"), "{said}");
        }
        for bad in ["", "192.168.1.0/33", "192.168.1/24", "::/129", "10.0.0.0/-1"] {
            assert!(bad.parse::<Network>().is_err(), "{bad}");
        }
    }

    #[test]
    fn who_may_connect_is_who_is_of_a_network_and_this_machine() {
        let networks = ["192.168.1.0/24", "10.0.0.7", "fd00::/8"].map(|said| said.parse().unwrap()).to_vec();
        let options = GatewayOptions { networks, ..GatewayOptions::new("0.0.0.0:9000".parse().unwrap()) };
        let admits = |from: &str| options.admits(from.parse().unwrap());
        for one in ["127.0.0.1", "::1", "192.168.1.255", "10.0.0.7", "fd12::1", "::ffff:192.168.1.3"] {
            assert!(admits(one), "{one}");
        }
        for one in ["192.168.2.1", "10.0.0.8", "fe80::1", "::ffff:10.0.0.8"] {
            assert!(!admits(one), "{one}");
        }
        let all = GatewayOptions { networks: vec!["0.0.0.0/0".parse().unwrap()], ..options };
        assert!(all.admits("8.8.8.8".parse().unwrap()) && !all.admits("fe80::1".parse().unwrap()));
    }

    #[test]
    fn a_port_that_is_taken_and_an_address_for_all_are_errors_that_say_what_to_do() {
        let other = TcpListener::bind("127.0.0.1:0").unwrap();
        let address: Address = other.local_addr().unwrap().to_string().parse().unwrap();
        let said = listen(&GatewayOptions::new(address)).unwrap_err().to_string();
        assert!(said.contains("another program") && said.contains("choose another port"), "{said}");
        let said = listen(&GatewayOptions::new("0.0.0.0:0".parse().unwrap())).unwrap_err().to_string();
        assert!(said.contains("--moos-from"), "{said}");
    }
}
