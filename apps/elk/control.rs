//! Orders to a running mission: what a person types, turned into a question to its launcher, and the answer shown.

use std::process::ExitCode;
use std::time::Duration;

use anyhow::{Context, Result, anyhow, bail};
use clap::Args;
use elk_bus::{Community, tell};
use elk_launcher::{Answer, AppRow, Order, ask};
use elk_mission::{Via, split_arguments};
use elk_outside::{text, time};
use elk_scope::Table;
use elk_scope::show::duration;

use crate::arguments::{CommunityArgs, setting};
use crate::terminal::{print_table, say};

/// How long a launcher may take to answer, on top of what it was given to do it.
const PATIENCE: Duration = Duration::from_secs(30);

/// How to show who runs.
#[derive(Debug, Args)]
pub struct AppsArgs {
    /// JSON instead of a table
    #[arg(long)]
    json: bool,
    /// Which community.
    #[command(flatten)]
    community: CommunityArgs,
}

/// Which app is to be stopped.
#[derive(Debug, Args)]
pub struct StopArgs {
    /// Its name in the mission
    app: String,
    /// Which community.
    #[command(flatten)]
    community: CommunityArgs,
}

/// Which app is to be started.
#[derive(Debug, Args)]
pub struct StartArgs {
    /// Its name in the mission
    app: String,
    /// How long it may take to register (s)
    #[arg(long, default_value_t = 20.0, value_parser = limit, value_name = "SECONDS")]
    limit: f64,
    /// Which community.
    #[command(flatten)]
    community: CommunityArgs,
}

/// Which app is to be exchanged, and for what.
#[derive(Debug, Args)]
pub struct SwapArgs {
    /// Its name in the mission
    app: String,
    /// `type=T` for another type, `exec=FILE` (and `args="…"`; `moos=true` for one of MOOS') for any other program, or
    /// `pipe="PROGRAM ARGS"` for one that reads and writes lines, and parameters that are to change; the others stay as the
    /// mission set them
    #[arg(value_name = "type=T | exec=FILE | pipe=LINE | PARAM=VALUE", value_parser = setting)]
    changes: Vec<(String, String)>,
    /// How long the new one may take to be ready (s); after that, the old one goes on
    #[arg(long, default_value_t = 20.0, value_parser = limit, value_name = "SECONDS")]
    limit: f64,
    /// Which community.
    #[command(flatten)]
    community: CommunityArgs,
}

fn limit(said: &str) -> Result<f64, String> {
    let secs = said.parse::<f64>().ok().filter(|secs| (0.1..=86_400.0).contains(secs));
    secs.ok_or_else(|| "right is a number from 0.1 to 86400, in s".to_owned())
}

/// `elk stop`
pub fn stop(arguments: StopArgs) -> Result<ExitCode> {
    order(&arguments.community.community, &Order::Stop { app: arguments.app }, Duration::ZERO)
}

/// `elk start`
pub fn start(arguments: StartArgs) -> Result<ExitCode> {
    let StartArgs { app, limit: limit_secs, community } = arguments;
    order(&community.community, &Order::Start { app, limit_secs }, time::duration(limit_secs))
}

/// `elk swap`
pub fn swap(arguments: SwapArgs) -> Result<ExitCode> {
    let SwapArgs { app, changes, limit: limit_secs, community } = arguments;
    let (mut type_name, mut exec, mut args, mut pipe, mut moos, mut params) =
        (None, None, None, None, None, Vec::new());
    for (name, text) in changes {
        let place = match name.as_str() {
            "type" => &mut type_name,
            "exec" => &mut exec,
            "args" => &mut args,
            "pipe" => &mut pipe,
            "moos" => &mut moos,
            _ => {
                params.push((name, text));
                continue;
            }
        };
        if place.replace(text).is_some() {
            bail!("{name} is said twice; once is enough");
        }
    }
    let mut of_exec = [("args", args.is_some()), ("moos", moos.is_some())].into_iter();
    if let Some((word, _)) = of_exec.find(|(_, is_said)| *is_said && exec.is_none()) {
        bail!("{word} without exec; right is both or neither");
    }
    if pipe.is_some() && exec.is_some() {
        bail!("exec and pipe are both said; one is right");
    }
    let args = split_arguments(&args.unwrap_or_default()).map_err(|error| anyhow!("args: {error}"))?;
    let folder = std::env::current_dir().context("files are looked for from the working directory, and it is gone")?;
    let via = match pipe {
        Some(_) => Via::Lines,
        None => Via::of_moos(moos.as_deref().unwrap_or("false"), &folder).map_err(|error| anyhow!(error))?,
    };
    let exec = match pipe {
        None => exec.map(|exec| (exec, args)),
        Some(line) => {
            let mut words = split_arguments(&line).map_err(|error| anyhow!("pipe: {error}"))?.into_iter();
            let exec = words.next().context("pipe is empty; right is a program with its arguments")?;
            Some((exec, words.collect()))
        }
    };
    let wanted = Order::Swap { app, type_name, exec, via, params, folder, limit_secs };
    order(&community.community, &wanted, time::duration(limit_secs))
}

/// `elk pause`, `elk resume`, `elk step`
pub fn motion(community: &Community, wanted: &Order) -> Result<ExitCode> {
    order(community, wanted, Duration::ZERO)
}

fn order(community: &Community, wanted: &Order, limit: Duration) -> Result<ExitCode> {
    let answer = ask(community, wanted, PATIENCE + limit, |progress| tell(text::printable(progress)))?;
    match answer {
        Answer::Failed { text } => bail!(text),
        Answer::Done { text } | Answer::Progress { text } => say(&format!("{text}\n"))?,
        Answer::Apps { .. } | Answer::Mission { .. } => bail!("the launcher answered another question"),
    }
    Ok(ExitCode::SUCCESS)
}

/// `elk apps`
pub fn apps(arguments: &AppsArgs) -> Result<ExitCode> {
    let community = &arguments.community.community;
    match ask(community, &Order::Apps, PATIENCE, |_| {})? {
        Answer::Apps { rows } if arguments.json => {
            say(&(text::printable_json(&serde_json::to_string_pretty(&rows)?) + "\n"))?
        }
        Answer::Apps { rows } => print_table(&table(&rows))?,
        Answer::Failed { text } => bail!(text),
        Answer::Done { .. } | Answer::Progress { .. } | Answer::Mission { .. } => {
            bail!("the launcher answered another question")
        }
    }
    Ok(ExitCode::SUCCESS)
}

const HEADS: [&str; 14] = [
    "NAME",
    "ELEMENT",
    "TYPE",
    "PID",
    "STATE",
    "SINCE",
    "CPU",
    "NOW",
    "MEMORY",
    "DROPPED",
    "REJECTED",
    "RESTARTS",
    "SWAPS",
    "LAST EXIT",
];
/// Columns that are numbers, and so stand at the right: from SINCE to SWAPS.
const NUMBERS: [usize; 8] = [5, 6, 7, 8, 9, 10, 11, 12];

/// Columns that a narrow terminal does without, first ELEMENT, last MEMORY.
const SPARE: [usize; 10] = [1, 12, 7, 5, 3, 2, 11, 10, 9, 8];

/// The rows under their heads; how an app last ended comes last, as long as it is.
fn table(rows: &[AppRow]) -> Table<'static> {
    let heads = HEADS.map(str::to_owned).to_vec();
    let is_bad = |row: &AppRow| !["running", "starting", "ended"].contains(&row.state.as_str());
    let bad = rows.iter().zip(1..).filter(|(row, _)| is_bad(row)).map(|(_, number)| number).collect();
    let rows = std::iter::once(heads).chain(rows.iter().map(cells)).collect();
    Table { rows, right: &NUMBERS, spare: &SPARE, bad, ..Table::default() }
}

fn cells(row: &AppRow) -> Vec<String> {
    let or_dash = |text: Option<String>| text.unwrap_or_else(|| "-".to_owned());
    let percent = |share: Option<f64>| or_dash(share.map(|share| format!("{share:.0} %")));
    vec![
        row.name.clone(),
        or_dash(Some(row.element.clone()).filter(|element| !element.is_empty())),
        row.type_name.clone(),
        or_dash(row.pid.map(|pid| pid.to_string())),
        row.state.clone(),
        duration(row.state_secs),
        percent(row.cpu_percent),
        percent(row.cpu_percent_now),
        or_dash(row.resident_bytes.map(|bytes| format!("{:.1} MB", bytes as f64 / 1e6))),
        or_dash(row.dropped.map(|count| count.to_string())),
        or_dash(row.rejected.map(|count| count.to_string())),
        row.restarts.to_string(),
        row.swaps.to_string(),
        or_dash(row.last_exit.clone()),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_has_its_columns_under_their_heads() {
        let mut row = AppRow {
            name: "Map".into(),
            element: "Map".into(),
            type_name: "OctoMap".into(),
            pid: Some(4711),
            state: "running".into(),
            state_secs: 150.0,
            cpu_percent: Some(12.34),
            cpu_percent_now: None,
            resident_bytes: Some(12_345_678),
            dropped: Some(3),
            rejected: Some(12),
            restarts: 1,
            swaps: 0,
            last_exit: Some("signal 9 (SIGKILL)".into()),
        };
        let lines = table(std::slice::from_ref(&row)).lines(None);
        assert_eq!(
            lines,
            [
                "NAME  ELEMENT  TYPE     PID   STATE       SINCE   CPU  NOW   MEMORY  DROPPED  REJECTED  RESTARTS  SWAPS  LAST EXIT",
                "Map   Map      OctoMap  4711  running  2.50 min  12 %    -  12.3 MB        3        12         1      0  signal 9 (SIGKILL)",
            ]
        );
        // A name is cut to what people read of one, how an app ended is not; neither sends the terminal a command.
        let end = "x".repeat(100) + "\x1b[2J";
        (row.name, row.element, row.last_exit) = ("n".repeat(100), String::new(), Some(end));
        let text = &table(&[row]).lines(None)[1].text;
        assert!(text.starts_with(&format!("{}…  -        OctoMap  ", "n".repeat(63))), "{text}");
        assert!(text.ends_with(&format!("  {}\\u{{1b}}[2J", "x".repeat(100))), "{text}");
    }
}
