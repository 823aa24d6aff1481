//! Clients of MOOS' before elk's broker, as a way for messages.

use std::ffi::OsString;
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::os::unix::process::CommandExt;
use std::process::Command;
use std::time::Duration;

use elk_bus::clock::{Stopwatch, monotonic_nanos};
use elk_bus::moos::client::{ClientError, MoosClient};
use elk_bus::moos::gateway::{GatewayOptions, Listening};
use elk_bus::moos::hello::Manner;
use elk_bus::moos::message::Kind;
use elk_bus::{BrokerConfig, Clock, Community, ConnectError, serve_broker_at};

use crate::events::once_served;
use crate::transport::{BenchResult, Intake, Outlet};

/// The variable that is published.
const KEY: &str = "STAR";
/// How long the broker may take to answer.
const PATIENCE: Duration = Duration::from_secs(10);
/// What waits is sent once it is so long (bytes).
const PACKET_BYTES: usize = 32 << 10;

/// A port that nobody listens at, as the end of a namespace's name.
pub fn free_port() -> BenchResult<u16> {
    Ok(TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?.local_addr()?.port())
}

/// Where the broker of a namespace listens.
pub fn address(namespace: &str) -> BenchResult<SocketAddr> {
    let port = namespace.rsplit('-').next().and_then(|port| port.parse::<u16>().ok());
    Ok((Ipv4Addr::LOCALHOST, port.ok_or("the namespace names no port")?).into())
}

/// Serves clients of both kinds until SIGTERM.
pub fn broker(namespace: &str) -> BenchResult {
    let listening = Listening::at(GatewayOptions::new(address(namespace)?.to_string().parse()?))?;
    let config = BrokerConfig::new(namespace);
    Ok(serve_broker_at(Community::new(namespace)?, config, Clock::new(1.0), Some(listening))?)
}

/// The MOOSDB that stands beside elk's broker, if the environment names one.
pub fn moosdb() -> Option<OsString> {
    std::env::var_os("MOOSDB").filter(|program| !program.is_empty())
}

/// Becomes that MOOSDB, where clients of a namespace look for it.
pub fn become_moosdb(namespace: &str) -> BenchResult {
    let program = moosdb().ok_or("MOOSDB names no program")?;
    let port = format!("--moos_port={}", address(namespace)?.port());
    let failed = Command::new(&program).args([port, format!("--moos_community={namespace}")]).exec();
    Err(format!("{} cannot be started: {failed}", program.display()).into())
}

/// Waits until somebody listens for the clients of a namespace: a MOOSDB says to nobody that it does.
pub fn await_server(namespace: &str, patience: Duration) -> BenchResult {
    let (address, waited) = (address(namespace)?, Stopwatch::start());
    while let Err(error) = TcpStream::connect(address) {
        if waited.elapsed() > patience {
            return Err(format!("the program that MOOSDB names does not listen at {address}: {error}").into());
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    Ok(())
}

/// Connects as soon as the broker is there.
pub fn join(namespace: &str, name: &str) -> BenchResult<MoosClient> {
    let (community, address) = (Community::new(namespace)?, address(namespace)?);
    // It listens, and then makes its first files.
    let connect = || match MoosClient::connect(address, name, Manner::Asynchronous) {
        Err(ClientError::Io(_)) => Err(ConnectError::NoBroker(community.clone())),
        other => Ok(other),
    };
    Ok(once_served(&community, connect)??)
}

/// Connects a hundred clients, then one under the same name again and again; how long that takes (s).
pub fn connect(namespace: &str, clients: usize, reconnects: usize) -> BenchResult<(f64, f64)> {
    join(namespace, "first")?;
    let address = address(namespace)?;
    let since = |start: u64| (monotonic_nanos() - start) as f64 * 1e-9;
    let start = monotonic_nanos();
    let connected = std::thread::scope(|scope| {
        let connect = |i: usize| MoosClient::connect(address, &format!("client-{i}"), Manner::Asynchronous);
        let threads: Vec<_> = (0..clients).map(|i| scope.spawn(move || connect(i))).collect();
        threads.into_iter().map(|thread| thread.join().map_err(|_| "a client panicked")).collect::<Vec<_>>()
    });
    let all = since(start);
    for client in connected {
        client??;
    }
    let start = monotonic_nanos();
    for _ in 0..reconnects {
        MoosClient::connect(address, "swapped", Manner::Asynchronous)?;
    }
    Ok((all, since(start)))
}

/// Registers, and reads nothing, but gives its signs of life, for so long.
pub fn stay_deaf(namespace: &str, secs: u64, ready: impl Fn() -> BenchResult) -> BenchResult {
    let mut client = join(namespace, "deaf")?;
    client.register(KEY, 0.0);
    client.flush()?;
    ready()?;
    let waited = Stopwatch::start();
    while waited.elapsed() < Duration::from_secs(secs) {
        std::thread::sleep(Duration::from_millis(500));
        // It is let go of in the end; then it comes back, and is as deaf as before.
        if client.flush().is_err() {
            client = join(namespace, "deaf")?;
            client.register(KEY, 0.0);
        }
    }
    Ok(())
}

/// The publishing client.
pub struct MoosOutlet(MoosClient);

impl MoosOutlet {
    /// Connects as the publisher.
    pub fn open(namespace: &str) -> BenchResult<Self> {
        Ok(Self(join(namespace, "publisher")?))
    }
}

impl Outlet for MoosOutlet {
    fn send(&mut self, message: &[u8]) -> BenchResult {
        if message.len() >= PACKET_BYTES {
            return Ok(self.0.send_bytes(KEY, message)?);
        }
        self.0.notify_bytes(KEY, message);
        if self.0.waiting_bytes() >= PACKET_BYTES { Ok(self.0.flush()?) } else { Ok(()) }
    }

    fn flush(&mut self) -> BenchResult {
        Ok(self.0.flush()?)
    }
}

/// A registered client.
pub struct MoosIntake(MoosClient);

impl MoosIntake {
    /// Connects as a reader; returns when the broker knows the registration.
    pub fn open(namespace: &str, name: &str) -> BenchResult<Self> {
        let mut client = join(namespace, name)?;
        let mark = format!("MARK_{name}");
        client.register(KEY, 0.0);
        client.register(&mark, 0.0);
        client.notify_number(&mark, 1.0);
        let (waited, mut heard) = (Stopwatch::start(), false);
        while !heard {
            client.receive(Duration::from_millis(100), |mail| heard |= mail.key == mark.as_bytes())?;
            if waited.elapsed() > PATIENCE {
                return Err("the broker does not answer".into());
            }
        }
        Ok(Self(client))
    }
}

impl Intake for MoosIntake {
    fn receive(&mut self, timeout: Duration, on_message: &mut dyn FnMut(&[u8])) -> BenchResult {
        self.0.receive(timeout, |mail| {
            if mail.kind == Kind::NOTIFY && mail.key == KEY.as_bytes() {
                on_message(mail.value);
            }
        })?;
        Ok(())
    }
}
