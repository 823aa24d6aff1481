//! What `elk log` is told: its commands, the parts of logs that they take, and how they write new ones.

use std::path::PathBuf;

use anyhow::Result;
use clap::{Args, Subcommand, ValueEnum};
use elk_log::{Compression, LogOptions, Selection};
use elk_outside::time;

use crate::arguments::CommunityArgs;
use crate::prune::PruneArgs;
use crate::target::{Target, not_to_a_terminal};

/// What can be done with logs.
#[derive(Debug, Subcommand)]
pub enum LogCommand {
    /// Say what is in a log
    #[command(after_help = "Example: elk log info logs/apartment-20261123-224512 --json")]
    Info {
        /// The log: a run's folder, or a file
        log: PathBuf,
        /// As JSON
        #[arg(long)]
        json: bool,
    },
    /// Read a log from end to end and say whether it is whole
    #[command(after_help = "Example: elk log check logs/apartment-20261123-224512")]
    Check {
        /// The log: a run's folder, or a file
        log: PathBuf,
    },
    /// Mend a log that was cut short or damaged: all that can be had, also behind and inside of what is damaged, in a new one
    #[command(after_help = "Example: elk log recover logs/apartment-20261123-224512/log.mcap -o mended.mcap")]
    Recover {
        /// The log: a run's folder, or a file
        log: PathBuf,
        /// How the new log is written
        #[command(flatten)]
        output: OutputArgs,
    },
    /// Print the messages of a log
    #[command(after_help = "Example: elk log cat logs/apartment-20261123-224512 --keys PROGRESS --from 1 --to 3")]
    Cat {
        /// The log: a run's folder, or a file
        log: PathBuf,
        /// Which of them
        #[command(flatten)]
        selection: SelectionArgs,
        /// One JSON object a line, values in full
        #[arg(long)]
        json: bool,
    },
    /// Make a shorter log of a part of one
    #[command(after_help = "Example: elk log cut logs/apartment-20261123-224512 --keys 'SCAN*' --to 10 -o scans.mcap")]
    Cut {
        /// The log: a run's folder, or a file
        log: PathBuf,
        /// Which part
        #[command(flatten)]
        selection: SelectionArgs,
        /// How the new log is written
        #[command(flatten)]
        output: OutputArgs,
    },
    /// Compare two logs message by message; ends with 1 if they differ
    #[command(after_help = "Example: elk log diff logs/apartment-1 logs/apartment-2 --keys MAP_UPDATE --keys PLAN\n\n\
        Messages are compared by variable and source, in order. Times are not compared, nor fields named cpu_secs \
        (measured anew in each run), nor the variables DB_* and *_STATUS, which tell of processes; --exact compares all \
        of these but the times.")]
    Diff {
        /// A log: a run's folder, or a file
        first: PathBuf,
        /// Another
        second: PathBuf,
        /// Which messages
        #[command(flatten)]
        selection: SelectionArgs,
        /// Compare measured times and the broker's own tables, too
        #[arg(long)]
        exact: bool,
    },
    /// Hand a log on: to MOOS' tools as .alog (with .blog), to spreadsheets as CSV
    #[command(after_help = "Example: elk log export logs/apartment-20261123-224512 --to alog -o apartment.alog\n\n\
        A message has the time at which its source has written it, in both. An .alog counts from the run's start, which \
        is its LOGSTART; CSV from the log's earliest message, as elk log cat does.")]
    Export {
        /// The log: a run's folder, or a file
        log: PathBuf,
        /// The format
        #[arg(long)]
        to: Format,
        /// The file to write; the log's name with another ending if not said; `-`: standard output
        #[arg(short, long, value_name = "FILE")]
        output: Option<PathBuf>,
        /// Which messages
        #[command(flatten)]
        patterns: PatternArgs,
    },
    /// Name old runs, or delete them with their logs
    #[command(after_help = "Example: elk log prune --keep 10 --older-than 7 --delete")]
    Prune(PruneArgs),
    /// Record a part of a running community until Ctrl-C
    #[command(after_help = "Example: elk log record 'SCAN*' MAP_UPDATE -o recorded.mcap")]
    Record {
        /// Patterns of the variables to record
        #[arg(default_value = "*")]
        patterns: Vec<String>,
        /// Which community
        #[command(flatten)]
        community: CommunityArgs,
        /// The log to write
        #[command(flatten)]
        output: OutputArgs,
    },
}

/// A part of a log.
#[derive(Debug, Args)]
pub struct SelectionArgs {
    /// By variable and source.
    #[command(flatten)]
    patterns: PatternArgs,
    /// Begin so many seconds after the earliest message
    #[arg(long, value_name = "S", value_parser = time::parse_seconds)]
    from: Option<f64>,
    /// End so many seconds after the earliest message
    #[arg(long, value_name = "S", value_parser = time::parse_seconds)]
    to: Option<f64>,
}

/// Some variables, some sources.
#[derive(Debug, Args)]
pub struct PatternArgs {
    /// Only variables that match (`*`: any characters, `?`: one); may be repeated
    #[arg(long, value_name = "PATTERN")]
    keys: Vec<String>,
    /// Only sources that match; may be repeated
    #[arg(long, value_name = "PATTERN")]
    source: Vec<String>,
    /// No variables that match; may be repeated
    #[arg(long, value_name = "PATTERN")]
    exclude: Vec<String>,
}

impl From<SelectionArgs> for Selection {
    fn from(said: SelectionArgs) -> Self {
        Selection { from_secs: said.from, to_secs: said.to, ..said.patterns.into() }
    }
}

impl From<PatternArgs> for Selection {
    fn from(said: PatternArgs) -> Self {
        let PatternArgs { keys, source, exclude } = said;
        Selection { keys, sources: source, exclude, ..Selection::default() }
    }
}

/// A log to write.
#[derive(Debug, Args)]
pub struct OutputArgs {
    /// The log to write; must not be there; `-`: standard output
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// How it is compressed
    #[arg(long, default_value = "zstd")]
    compression: Packing,
}

impl OutputArgs {
    /// Where it is written: not to a terminal.
    pub fn target(&self) -> Result<Target> {
        not_to_a_terminal(&self.output)?;
        Target::new(&self.output, "log.mcap")
    }

    /// How it is written.
    pub fn options(&self) -> LogOptions {
        let compression = match self.compression {
            Packing::None => Compression::None,
            Packing::Lz4 => Compression::Lz4,
            Packing::Zstd => Compression::Zstd,
        };
        LogOptions { compression, ..LogOptions::default() }
    }
}

/// How a log is compressed.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum Packing {
    /// Not at all
    None,
    /// A little, for little work
    Lz4,
    /// More, for more work
    Zstd,
}

/// What a log is exported to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// MOOS' text log
    Alog,
    /// Numbers: time, variable, source, value
    Csv,
}
