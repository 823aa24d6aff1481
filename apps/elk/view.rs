//! `elk view`: a mission in the browser, or in Lichtblick. Its arguments, and what pages can have done; the rest is `elk_view`.

use std::io::{BufRead, BufReader};
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::process::{Child, Command, ExitCode, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use anyhow::{Context, Result, anyhow};
use clap::Args;
use elk_bus::child::{Bond, keep_to_itself};
use elk_bus::clock::Stopwatch;
use elk_bus::{Community, stop_on_signals, tell};
use elk_launcher::{Answer, Order, ask, run_folder, running_mission};
use elk_mission::{AppSpec, Kind, ParamSpec, Params, Program, Registry};
use elk_scope::{Output, Poke, Said, Scope, yield_to_others};
use elk_view::{FoxgloveOptions, Mission, Options, Parameter, Source, Steering};
use rustix::process::{Pid, Signal, kill_process};
use serde_json::{Value, json};

use crate::arguments::CommunityArgs;
use crate::registry::registry;
use crate::scenery;
use crate::terminal::say;

/// The port of a view that is told none; if it is taken, one of the next ones.
const PORT: u16 = 8080;
/// Where Foxglove's clients look for a robot.
const FOXGLOVE: &str = "127.0.0.1:8765";
/// How long a launcher may take to answer.
const PATIENCE: Duration = Duration::from_secs(30);
/// How long a successor, or an app that is started, may take to be ready (s).
const LIMIT_SECS: f64 = 20.0;

/// How long the view of a mission that is over may take to tell its pages, and how often it is looked whether it has.
const GOODBYE: Duration = Duration::from_millis(800);
const LOOK_EVERY: Duration = Duration::from_millis(5);

/// How many variables were written.
static POKES: AtomicU64 = AtomicU64::new(0);

/// What to show, and to whom.
#[derive(Debug, Args)]
pub struct ViewArgs {
    /// A recorded run, by its folder or its log, instead of a community that runs
    log: Option<PathBuf>,
    /// The port; without it 8080, or the next one that is free
    #[arg(long)]
    port: Option<u16>,
    /// Let other machines in, at this address of this one: whoever comes needs the token that is printed
    #[arg(long, value_name = "ADDRESS")]
    listen: Option<IpAddr>,
    /// Serve Lichtblick and Foxglove instead of pages, at this address of this machine
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, default_missing_value = FOXGLOVE, value_parser = foxglove_address)]
    #[arg(conflicts_with_all = ["port", "listen"])]
    foxglove: Option<SocketAddr>,
    /// Let pages of this site connect to --foxglove as well, such as <https://app.foxglove.dev>; repeat for more
    #[arg(long, value_name = "SITE", requires = "foxglove")]
    origin: Vec<String>,
    /// Pages and clients only look: they order and write nothing
    #[arg(long)]
    read_only: bool,
    /// Which community.
    #[command(flatten)]
    community: CommunityArgs,
}

/// Reads the address of `--foxglove`.
fn foxglove_address(text: &str) -> Result<SocketAddr, String> {
    let address = text.strip_prefix("ws://").unwrap_or(text).trim_end_matches('/');
    address.parse().map_err(|_| format!("right is an address with its port, for example {FOXGLOVE}"))
}

/// `elk view`
pub fn view(arguments: ViewArgs) -> Result<ExitCode> {
    if arguments.foxglove.is_some() {
        return view_in_foxglove(arguments);
    }
    let ip = arguments.listen.unwrap_or(IpAddr::V4(Ipv4Addr::LOCALHOST));
    let address = SocketAddr::new(ip, arguments.port.unwrap_or(PORT));
    let options = Options { address, any_port: arguments.port.is_none(), read_only: arguments.read_only };
    let community = arguments.community.community;
    let steering = Hand { community: community.clone(), registry: registry() };
    let scenery = scenery::of(arguments.log.as_deref(), &community);
    let source = arguments.log.map_or(Source::Community(community), Source::Log);
    let stop = stop_on_signals().context("signals cannot be caught")?;
    yield_to_others();
    let ready = |address: &str| ready(address, ip);
    elk_view::serve(source, &options, Some(Arc::new(steering)), Some(scenery), ready, &stop)?;
    Ok(ExitCode::SUCCESS)
}

/// Says where it is.
fn ready(url: &str, ip: IpAddr) {
    // Who does not read where it is has another way to know.
    let _ = say(&format!("{url}\n"));
    if ip.is_unspecified() {
        tell(format_args!(
            "elk: {ip} stands for all addresses of this machine: elsewhere, put one of them in its place"
        ));
    }
}

fn view_in_foxglove(arguments: ViewArgs) -> Result<ExitCode> {
    let ViewArgs { log, foxglove, origin, read_only, community, .. } = arguments;
    if let Some(log) = log {
        return Err(anyhow!(
            "--foxglove is for a community that runs; Lichtblick and Foxglove open {} as it is",
            if log.is_dir() { log.join("log.mcap") } else { log }.display()
        ));
    }
    let community = community.community;
    let address = foxglove.context("--foxglove has no address")?;
    let options = FoxgloveOptions { address, origins: origin, read_only };
    let hand = Hand { community: community.clone(), registry: registry() };
    let stop = stop_on_signals().context("signals cannot be caught")?;
    yield_to_others();
    let ready = |url: &str| ready(url, address.ip());
    elk_view::serve_foxglove(&community, options, Some(Arc::new(hand)), ready, &stop)?;
    Ok(ExitCode::SUCCESS)
}

/// The view of a mission that this process launches: a process of its own, which ends with this.
pub struct Companion(Child);

impl Companion {
    /// Starts it, and answers where it is to be seen.
    pub fn start(program: &std::path::Path, community: &Community) -> Result<(Self, String)> {
        let mut command = Command::new(program);
        command.arg("view").args(["--community", community.as_str()]).stdin(Stdio::null()).stdout(Stdio::piped());
        keep_to_itself(&mut command, Bond::Parent);
        let mut child = command.spawn().context("the view cannot be started")?;
        let out = child.stdout.take();
        let companion = Self(child);
        let mut address = String::new();
        out.map_or(Ok(0), |out| BufReader::new(out).read_line(&mut address)).context("the view does not answer")?;
        match address.trim() {
            "" => Err(anyhow!("--view: the view has ended at once; what it said stands above")),
            address => Ok((companion, address.to_owned())),
        }
    }
}

impl Drop for Companion {
    fn drop(&mut self) {
        // It tells its pages; then it holds nothing that would have to be put away.
        let _ = kill_process(Pid::from_child(&self.0), Signal::TERM);
        let waited = Stopwatch::start();
        while waited.elapsed() < GOODBYE && matches!(self.0.try_wait(), Ok(None)) {
            std::thread::sleep(LOOK_EVERY);
        }
        let _ = self.0.kill().and_then(|()| self.0.wait());
    }
}

/// What pages have done, as on the command line.
struct Hand {
    community: Community,
    registry: Registry,
}

impl Steering for Hand {
    fn order(&self, order: &elk_view::Order, on_progress: &mut dyn FnMut(&str)) -> Result<String, String> {
        let limit_secs = LIMIT_SECS;
        let order = match order.clone() {
            elk_view::Order::Pause => Order::Pause,
            elk_view::Order::Resume => Order::Resume,
            elk_view::Order::Step => Order::Step,
            elk_view::Order::Stop { app } => Order::Stop { app },
            elk_view::Order::Start { app } => Order::Start { app, limit_secs },
            elk_view::Order::Swap { app, type_name, params } => {
                let folder = std::env::current_dir().map_err(|error| error.to_string())?;
                Order::Swap { app, type_name, exec: None, via: elk_mission::Via::Itself, params, folder, limit_secs }
            }
        };
        match ask(&self.community, &order, PATIENCE, on_progress).map_err(|error| error.to_string())? {
            Answer::Done { text } | Answer::Progress { text } => Ok(text),
            Answer::Failed { text } => Err(text),
            Answer::Apps { .. } | Answer::Mission { .. } => Err("the launcher answered another question".to_owned()),
        }
    }

    fn poke(&self, key: &str, value: &str) -> Result<String, String> {
        let poke = Poke { name: key.to_owned(), value: value.to_owned(), said: Said::Nothing, json: false };
        let mut said = Vec::new();
        // Several may write at the same time, pages and clients of several views.
        let name = format!("view-poke-{}-{}", std::process::id(), POKES.fetch_add(1, Ordering::Relaxed));
        let mut scope = Scope::join(&self.community, &name).map_err(|error| error.to_string())?;
        poke.run(&mut scope, &mut Output::new(&mut said, None)).map_err(|error| error.to_string())?;
        Ok(String::from_utf8_lossy(&said).trim_end().to_owned())
    }

    fn apps(&self) -> Option<Value> {
        match ask(&self.community, &Order::Apps, PATIENCE, |_| {}) {
            Ok(Answer::Apps { rows }) => serde_json::to_value(rows).ok(),
            _ => None,
        }
    }

    fn types(&self) -> Value {
        let mut elements: Vec<&str> = self.registry.types().map(|one| one.element).collect();
        elements.dedup();
        let types = |element: &str| -> Vec<Value> {
            let type_ = |one: &elk_mission::AppType| {
                let params: Vec<Value> = one.params.iter().map(param).collect();
                json!({"name": one.name, "summary": one.summary, "params": params})
            };
            self.registry.of_element(element).map(type_).collect()
        };
        elements.iter().map(|element| json!({"element": element, "types": types(element)})).collect()
    }

    fn log(&self, app: &str) -> Option<PathBuf> {
        // An app that the mission does not have is no path.
        let known = self.apps()?.as_array()?.iter().any(|row| row["name"] == app);
        known.then(|| run_folder(&self.community)).flatten().map(|folder| folder.join(format!("{app}.log")))
    }
}

impl Mission for Hand {
    fn parameters(&self) -> Vec<Parameter> {
        let mission = running_mission(&self.community, &self.registry);
        mission.iter().flat_map(|mission| &mission.apps).flat_map(parameters).collect()
    }
}

/// The parameters of an app; of somebody else's program, what was set of them.
fn parameters(app: &AppSpec) -> Vec<Parameter> {
    let named = |name: &str, value: Value| Parameter { name: format!("{}.{name}", app.name), value };
    match &app.program {
        Program::Builtin(type_, params) => {
            type_.params.iter().map(|spec| named(spec.name, value_of(spec, params))).collect()
        }
        Program::Foreign { .. } => app.settings.iter().map(|(name, text)| named(name, text.as_str().into())).collect(),
    }
}

fn value_of(spec: &ParamSpec, params: &Params) -> Value {
    match spec.kind {
        Kind::Number { .. } => params.number(spec.name).into(),
        Kind::Integer { .. } => params.integer(spec.name).into(),
        Kind::Flag => params.flag(spec.name).into(),
        Kind::Point { .. } | Kind::Size { .. } => params.point(spec.name).to_vec().into(),
        Kind::Choice(_) | Kind::Refinement { .. } | Kind::Text | Kind::Variable | Kind::File { .. } => {
            params.text(spec.name).into()
        }
    }
}

fn param(spec: &ParamSpec) -> Value {
    let (kind, unit, choices, min, max) = match spec.kind {
        Kind::Number { unit, min, max } => ("number", unit, None, Some(json!(min)), Some(json!(max))),
        Kind::Integer { min, max } => ("integer", "", None, Some(json!(min)), Some(json!(max))),
        Kind::Flag => ("flag", "", None, None, None),
        Kind::Point { unit } => ("point", unit, None, None, None),
        Kind::Size { unit } => ("size", unit, None, None, None),
        Kind::Choice(choices) | Kind::Refinement { words: choices, .. } => ("choice", "", Some(choices), None, None),
        Kind::Text => ("text", "", None, None, None),
        Kind::Variable => ("variable", "", None, None, None),
        Kind::File { builtin, .. } => ("file", "", (!builtin.is_empty()).then_some(builtin), None, None),
    };
    json!({
        "name": spec.name, "kind": kind, "default": spec.default, "unit": Some(unit).filter(|unit| !unit.is_empty()),
        "summary": spec.doc, "choices": choices, "min": min, "max": max,
    })
}
