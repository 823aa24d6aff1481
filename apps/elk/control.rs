//! Orders to a running mission: what a person types, turned into a question to its launcher, and the answer shown.

use std::process::ExitCode;
use std::time::Duration;

use anyhow::{Context, Result, bail};
use clap::Args;
use elk_bus::{Community, tell};
use elk_launcher::{Answer, AppRow, Request, ask};
use elk_outside::{text, time};

use crate::cli::{CommunityArgs, setting};
use crate::commands::say;

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
    /// `type=T` for another type, or `exec=FILE` (and `args="…"`) for any other program, and parameters that are to change;
    /// the others stay as the mission set them
    #[arg(value_name = "type=T | exec=FILE | PARAM=VALUE", value_parser = setting)]
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
    order(&arguments.community.community, &Request::Stop { app: arguments.app }, Duration::ZERO)
}

/// `elk start`
pub fn start(arguments: StartArgs) -> Result<ExitCode> {
    let StartArgs { app, limit: limit_secs, community } = arguments;
    order(&community.community, &Request::Start { app, limit_secs }, time::duration(limit_secs))
}

/// `elk swap`
pub fn swap(arguments: SwapArgs) -> Result<ExitCode> {
    let SwapArgs { app, changes, limit: limit_secs, community } = arguments;
    let (mut type_name, mut exec, mut args, mut params) = (None, None, None, Vec::new());
    for (name, text) in changes {
        let place = match name.as_str() {
            "type" => &mut type_name,
            "exec" => &mut exec,
            "args" => &mut args,
            _ => {
                params.push((name, text));
                continue;
            }
        };
        if place.replace(text).is_some() {
            bail!("{name} is said twice; once is enough");
        }
    }
    if args.is_some() && exec.is_none() {
        bail!("args without exec; right is both or neither");
    }
    let args: Vec<String> = args.unwrap_or_default().split_whitespace().map(str::to_owned).collect();
    let exec = exec.map(|exec| (exec, args));
    let folder = std::env::current_dir().context("files are looked for from the working directory, and it is gone")?;
    let wanted = Request::Swap { app, type_name, exec, params, folder, limit_secs };
    order(&community.community, &wanted, time::duration(limit_secs))
}

/// `elk pause`, `elk resume`, `elk step`
pub fn motion(community: &Community, wanted: &Request) -> Result<ExitCode> {
    order(community, wanted, Duration::ZERO)
}

fn order(community: &Community, wanted: &Request, limit: Duration) -> Result<ExitCode> {
    let answer = ask(community, wanted, PATIENCE + limit, |progress| tell(text::printable(progress)))?;
    match answer {
        Answer::Failed { text } => bail!(text),
        Answer::Done { text } | Answer::Progress { text } => say(&format!("{text}\n"))?,
        Answer::Apps { .. } => bail!("the launcher answered another question"),
    }
    Ok(ExitCode::SUCCESS)
}

/// `elk apps`
pub fn apps(arguments: &AppsArgs) -> Result<ExitCode> {
    let community = &arguments.community.community;
    match ask(community, &Request::Apps, PATIENCE, |_| {})? {
        Answer::Apps { rows } if arguments.json => {
            say(&(text::printable_json(&serde_json::to_string_pretty(&rows)?) + "\n"))?
        }
        Answer::Apps { rows } => say(&table(&rows))?,
        Answer::Failed { text } => bail!(text),
        Answer::Done { .. } | Answer::Progress { .. } => bail!("the launcher answered another question"),
    }
    Ok(ExitCode::SUCCESS)
}

const HEADS: [&str; 13] = [
    "NAME", "ELEMENT", "TYPE", "PID", "STATE", "SINCE", "CPU", "NOW", "MEMORY", "DROPPED", "REJECTED", "RESTARTS",
    "SWAPS",
];
/// Columns that are numbers, and so stand at the right.
const NUMBERS: std::ops::RangeInclusive<usize> = 5..=12;

/// The rows under their heads, each column as wide as it has to be; how an app last ended comes last.
fn table(rows: &[AppRow]) -> String {
    let cells: Vec<[String; 13]> = std::iter::once(HEADS.map(str::to_owned)).chain(rows.iter().map(cells)).collect();
    let width = |column: usize| cells.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..HEADS.len()).map(width).collect();
    let exits = std::iter::once("LAST EXIT").chain(rows.iter().map(|row| row.last_exit.as_deref().unwrap_or("-")));
    let mut table = String::new();
    for (row, exit) in cells.iter().zip(exits) {
        for (column, (cell, width)) in row.iter().zip(&widths).enumerate() {
            text::put_cell(&mut table, cell, *width, NUMBERS.contains(&column));
            table += "  ";
        }
        table += &text::printable(exit);
        table.push('\n');
    }
    table
}

fn cells(row: &AppRow) -> [String; 13] {
    let or_dash = |text: Option<String>| text.unwrap_or_else(|| "-".to_owned());
    let percent = |share: Option<f64>| or_dash(share.map(|share| format!("{share:.0} %")));
    let element = if row.element.is_empty() { "-".to_owned() } else { text::name(&row.element).into_owned() };
    [
        text::name(&row.name).into_owned(),
        element,
        text::name(&row.type_name).into_owned(),
        or_dash(row.pid.map(|pid| pid.to_string())),
        text::name(&row.state).into_owned(),
        span(row.state_secs),
        percent(row.cpu_percent),
        percent(row.cpu_percent_now),
        or_dash(row.resident_bytes.map(|bytes| format!("{:.1} MB", bytes as f64 / 1e6))),
        or_dash(row.dropped.map(|count| count.to_string())),
        or_dash(row.rejected.map(|count| count.to_string())),
        row.restarts.to_string(),
        row.swaps.to_string(),
    ]
}

/// `7 s`, `3 min`, `2.5 h`
fn span(secs: f64) -> String {
    match secs {
        secs if secs < 120.0 => format!("{secs:.0} s"),
        secs if secs < 7200.0 => format!("{:.0} min", secs / 60.0),
        secs => format!("{:.1} h", secs / 3600.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_has_its_columns_under_their_heads() {
        let row = AppRow {
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
        let text = table(&[row]);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(
            lines,
            [
                "NAME  ELEMENT  TYPE     PID   STATE    SINCE   CPU  NOW   MEMORY  DROPPED  REJECTED  RESTARTS  SWAPS  LAST EXIT",
                "Map   Map      OctoMap  4711  running  2 min  12 %    -  12.3 MB        3        12         1      0  signal 9 (SIGKILL)",
            ]
        );
    }

    #[test]
    fn spans_are_told_in_the_unit_that_fits() {
        assert_eq!([7.2, 150.0, 9000.0].map(span), ["7 s", "2 min", "2.5 h"]);
    }
}
