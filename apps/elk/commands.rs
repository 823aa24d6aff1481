//! What each command does, once its arguments are checked.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, anyhow, bail};
use elk_bus::{BrokerConfig, Clock, RunOptions, run_app, serve_broker};
use elk_launcher::{AttachOptions, LaunchOptions, Outcome};
use elk_mission::{AppType, Mission, Registry, describe, instead};
use elk_outside::text;

use crate::cli::{AppArgs, AttachArgs, BrokerArgs, LaunchArgs, MissionArgs};
use crate::registry::registry;

/// `elk launch`
pub fn launch(arguments: LaunchArgs) -> Result<ExitCode> {
    let mission = load(&arguments.mission)?;
    let options = LaunchOptions {
        program: itself()?,
        community: arguments.community.community,
        log_dir: arguments.log_dir,
        headless: arguments.headless,
        auto: arguments.auto,
        in_process: arguments.in_process,
        detached: arguments.detach,
        registry: registry(),
    };
    conclude(elk_launcher::launch(mission, &options)?)
}

/// `elk attach`
pub fn attach(arguments: AttachArgs) -> Result<ExitCode> {
    let options = AttachOptions {
        program: itself()?,
        community: arguments.community.community,
        headless: arguments.headless,
        registry: registry(),
    };
    conclude(elk_launcher::attach(&options)?)
}

fn itself() -> Result<PathBuf> {
    std::env::current_exe().context("elk does not know where it is itself")
}

fn conclude(outcome: Outcome) -> Result<ExitCode> {
    report(&outcome)?;
    if let Some(error) = outcome.unwritten {
        return Err(error.into());
    }
    Ok(if outcome.summary.complete { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn report(outcome: &Outcome) -> Result<()> {
    say(&outcome.summary.to_string())?;
    match &outcome.picture {
        Some(Ok(picture)) => say(&format!("  picture {}\n", picture.display()))?,
        Some(Err(error)) => say(&format!("  no picture: {error}\n"))?,
        None => {}
    }
    say(&format!("  all of it is in {}\n", outcome.folder.display()))?;
    match &outcome.summary {
        summary if summary.complete => Ok(()),
        // What matters most comes last, where it is seen.
        summary => say(&format!("NOT complete: {}\n", summary.reason)),
    }
}

/// `elk check`
pub fn check(arguments: &MissionArgs) -> Result<ExitCode> {
    let mission = load(arguments)?;
    let mut text = format!("{}: {} is right\n", arguments.mission.display(), mission.name);
    for app in &mission.apps {
        text += &format!("  {} {} {}\n", app.element, app.type_name(), app.name);
    }
    say(&text)?;
    Ok(ExitCode::SUCCESS)
}

fn load(arguments: &MissionArgs) -> Result<Mission> {
    Ok(Mission::load(&arguments.mission, &registry(), &arguments.sets)?)
}

/// `elk types`
pub fn types(element: Option<&str>) -> Result<ExitCode> {
    let registry = registry();
    let chosen = match element {
        None => registry,
        Some(element) => of_element(&registry, element)?,
    };
    say(&describe(&chosen))?;
    Ok(ExitCode::SUCCESS)
}

fn of_element(registry: &Registry, element: &str) -> Result<Registry> {
    let chosen: Registry = registry.of_element(element).collect();
    if chosen.types().next().is_none() {
        let mut known: Vec<&str> = registry.types().map(|one| one.element).collect();
        known.dedup();
        bail!("{element} is no element of a mission; {}", instead(element, &known));
    }
    Ok(chosen)
}

/// `elk db`
pub fn db(arguments: BrokerArgs) -> Result<ExitCode> {
    let community = arguments.community.community;
    let config = BrokerConfig::new(community.as_str()).with_mailboxes_of((arguments.mailbox as usize) << 20);
    serve_broker(community, config, Clock::new(1.0))?;
    Ok(ExitCode::SUCCESS)
}

/// `elk sensor`, `elk filter`, …
pub fn app(element: &str, arguments: AppArgs) -> Result<ExitCode> {
    let app_type = app_type(element, &arguments.type_name)?;
    let params = app_type.check(&arguments.settings, Path::new(""))?;
    let name = arguments.name.unwrap_or_else(|| element.to_owned());
    let app = (app_type.build)(&params).map_err(|error| anyhow!("{name}: {error}"))?;
    run_app(app, &RunOptions::new(name, arguments.community.community))?;
    Ok(ExitCode::SUCCESS)
}

fn app_type(element: &str, name: &str) -> Result<&'static AppType> {
    let registry = registry();
    registry.find(element, name).ok_or_else(|| {
        let known: Vec<&str> = registry.of_element(element).map(|one| one.name).collect();
        anyhow!("{element} has no type {name:?}; {}", instead(name, &known))
    })
}

/// `elk picture`
pub fn picture(run: &Path) -> Result<ExitCode> {
    let picture = elk_picture::draw_run(run)?;
    say(&format!("{}\n", picture.display()))?;
    Ok(ExitCode::SUCCESS)
}

/// `elk guard`
pub fn guard() -> Result<ExitCode> {
    elk_launcher::guard(std::io::stdin().lock()).context("the launcher cannot be followed")?;
    Ok(ExitCode::SUCCESS)
}

/// Writes lines to standard output, which the terminal only shows, whatever names are in them; a reader that has gone (`elk types | head`) is no failure.
pub fn say(text: &str) -> Result<()> {
    match std::io::stdout().write_all(text::printable_lines(text).as_bytes()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Err(error.into()),
        _ => Ok(()),
    }
}
