//! `elk list`, `echo`, `hz`, `bw`, `info`, `graph`, `poke`, `top`, `communities`: their arguments, and nothing else. What
//! they do is `elk_scope`.

use std::io::BufWriter;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::Result;
use clap::{Args, Subcommand};
use elk_scope::{
    Drawing, Echo, Info, List, Output, Pattern, Poke, Quantity, Rates, Said, Scope, ScopeError, Top, communities,
    graph, yield_to_others,
};
use signal_hook::iterator::Signals;

use crate::arguments::CommunityArgs;
use crate::terminal::complain;

/// What looks into a running community.
#[derive(Debug, Subcommand)]
pub enum ScopeCommand {
    /// List the clients and variables of a running community
    #[command(after_help = "Example: elk list 'MAP*' --json")]
    List {
        /// Only the variables that match: '*' is any run of characters, '?' a single one
        #[arg(default_value = "*")]
        pattern: Pattern,
        /// How to look.
        #[command(flatten)]
        look: LookArgs,
    },
    /// Show every message of the variables that match
    #[command(
        after_help = "Examples: elk echo PROGRESS    elk echo 'SCAN*' '*_STATUS' --json    elk echo SCAN --latest --count 1"
    )]
    Echo {
        /// The variables: '*' is any run of characters, '?' a single one
        #[arg(required = true)]
        patterns: Vec<Pattern>,
        /// End after so many messages
        #[arg(long, value_name = "N")]
        count: Option<u64>,
        /// Only messages of the sources that match
        #[arg(long, value_name = "PATTERN", default_value = "*")]
        source: Pattern,
        /// Begin with the variables' latest values, which were said before
        #[arg(long)]
        latest: bool,
        /// How to look.
        #[command(flatten)]
        look: LookArgs,
    },
    /// Measure how often each source writes the variables that match
    #[command(after_help = "Example: elk hz SCAN --window 5")]
    Hz(RatesArgs),
    /// Measure how many bytes each source writes to the variables that match
    #[command(after_help = "Example: elk bw 'SCAN*'")]
    Bw(RatesArgs),
    /// Say what is known of a client or a variable, whichever has the name
    #[command(after_help = "Examples: elk info Explorer    elk info 'MAP*' --json")]
    Info {
        /// The client's or the variable's name: '*' is any run of characters, '?' a single one
        pattern: Pattern,
        /// How to look.
        #[command(flatten)]
        look: LookArgs,
    },
    /// Show who says what to whom
    #[command(after_help = "Example: elk graph --dot | dot -Tsvg > graph.svg")]
    Graph {
        /// Write it for Graphviz
        #[arg(long, conflicts_with = "json")]
        dot: bool,
        /// How to look.
        #[command(flatten)]
        look: LookArgs,
    },
    /// Write a variable, if the value is what the variable carries
    #[command(after_help = "Examples: elk poke STEP 1    elk poke NOTE 'by hand'    \
        elk poke PROGRESS '{\"scan\":1,\"revision\":1,\"scans\":1,\"path_length_m\":2.5,\"free\":8,\"finished\":false}'")]
    Poke {
        /// The variable
        name: String,
        /// The value: a number, a text, or JSON for a typed variable
        #[arg(allow_hyphen_values = true)]
        value: String,
        /// It is a text, even if it reads as a number
        #[arg(long, conflicts_with_all = ["number", "type_name"])]
        text: bool,
        /// It is a number
        #[arg(long, conflicts_with = "type_name")]
        number: bool,
        /// It is JSON of this type, for a variable that nobody has written yet
        #[arg(long = "type", value_name = "TYPE")]
        type_name: Option<String>,
        /// How to look.
        #[command(flatten)]
        look: LookArgs,
    },
    /// Watch who says most and who is slow to read, refreshed each second; q ends it
    #[command(after_help = "Examples: elk top    elk top --count 3 --json")]
    Top {
        /// End after so many seconds
        #[arg(long, value_name = "N")]
        count: Option<u64>,
        /// How to look.
        #[command(flatten)]
        look: LookArgs,
    },
    /// List all communities of this machine
    #[command(after_help = "Example: elk communities --json")]
    Communities {
        /// Write JSON
        #[arg(long)]
        json: bool,
    },
}

/// How to look into a community.
#[derive(Debug, Args)]
pub struct LookArgs {
    /// Write JSON, an object a line
    #[arg(long)]
    pub json: bool,
    /// Which community.
    #[command(flatten)]
    pub community: CommunityArgs,
}

/// What to measure.
#[derive(Debug, Args)]
pub struct RatesArgs {
    /// The variables: '*' is any run of characters, '?' a single one
    #[arg(default_value = "*")]
    pub patterns: Vec<Pattern>,
    /// The figures are over the last so many seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 10, value_parser = clap::value_parser!(u16).range(1..=3600))]
    pub window: u16,
    /// End after so many seconds
    #[arg(long, value_name = "N")]
    pub count: Option<u64>,
    /// How to look.
    #[command(flatten)]
    pub look: LookArgs,
}

/// How long a command that was told to end may take, when nobody reads what it writes.
const FAREWELL: Duration = Duration::from_secs(1);

/// Runs one of the commands. A reader that has gone (`elk top | head`) is no failure.
pub fn run(command: ScopeCommand) -> Result<ExitCode> {
    yield_to_others();
    let mut out = BufWriter::new(std::io::stdout().lock());
    let mut output = Output::standard(&mut out);
    match look(command, &mut output) {
        Err(ScopeError::ReaderGone) => {}
        done => done?,
    }
    Ok(ExitCode::SUCCESS)
}

fn look(command: ScopeCommand, output: &mut Output<'_>) -> Result<(), ScopeError> {
    match command {
        ScopeCommand::List { pattern, look } => {
            List { pattern, json: look.json }.run(&mut join("list", &look)?, output)
        }
        ScopeCommand::Echo { patterns, count, source, latest, look } => {
            let echo = Echo { patterns, source, latest, count, json: look.json };
            let mut scope = join("echo", &look)?;
            echo.unwritten(&mut scope)?.iter().for_each(wait_for);
            echo.run(&mut scope, output, &*stop_on_signals()?)
        }
        ScopeCommand::Hz(arguments) => measure("hz", Quantity::Rate, arguments, output),
        ScopeCommand::Bw(arguments) => measure("bw", Quantity::Bandwidth, arguments, output),
        ScopeCommand::Info { pattern, look } => {
            Info { pattern, json: look.json }.run(&mut join("info", &look)?, output)
        }
        ScopeCommand::Graph { dot, look } => {
            let drawing = if look.json { Drawing::Json } else { Drawing::Text };
            graph(&mut join("graph", &look)?, output, if dot { Drawing::Dot } else { drawing })
        }
        ScopeCommand::Poke { name, value, text, number, type_name, look } => {
            let said = match (text, number, type_name) {
                (true, ..) => Said::Text,
                (_, true, _) => Said::Number,
                (.., Some(type_name)) => Said::Type(type_name),
                _ => Said::Nothing,
            };
            Poke { name, value, said, json: look.json }.run(&mut join("poke", &look)?, output)
        }
        ScopeCommand::Top { count, look } => {
            Top { count, json: look.json }.run(&mut join("top", &look)?, output, &*stop_on_signals()?)
        }
        ScopeCommand::Communities { json } => communities(output, json),
    }
}

fn measure(command: &str, quantity: Quantity, arguments: RatesArgs, output: &mut Output<'_>) -> Result<(), ScopeError> {
    let RatesArgs { patterns, window, count, look } = arguments;
    let rates = Rates { quantity, patterns, window_secs: window.into(), count, json: look.json };
    let mut scope = join(command, &look)?;
    rates.unwritten(&mut scope)?.iter().for_each(wait_for);
    rates.run(&mut scope, output, &*stop_on_signals()?)
}

fn join(command: &str, look: &LookArgs) -> Result<Scope, ScopeError> {
    Scope::join(&look.community.community, command)
}

/// A variable that nobody has written yet may still come.
fn wait_for(unwritten: &ScopeError) {
    complain(&format!("{unwritten} (waiting for it)"));
}

/// For a command that goes on until Ctrl-C: that is its good end, even while it cannot write because nobody reads.
fn stop_on_signals() -> Result<Arc<AtomicBool>, ScopeError> {
    let stop = Arc::new(AtomicBool::new(false));
    let mut signals = Signals::new(elk_bus::stop_signals()).map_err(ScopeError::Signals)?;
    let told = stop.clone();
    let wait = move || {
        signals.forever().next();
        told.store(true, Ordering::Relaxed);
        std::thread::sleep(FAREWELL);
        std::process::exit(0);
    };
    std::thread::Builder::new().spawn(wait).map_err(ScopeError::Signals)?;
    Ok(stop)
}
