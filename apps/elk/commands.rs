//! What each command does, once its arguments are checked.

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use anyhow::{Context, Result, anyhow, bail};
use elk_bus::moos::gateway::Listening;
use elk_bus::{BrokerConfig, Clock, Community, RunOptions, run_app, serve_broker_at, tell};
use elk_launcher::{AttachOptions, FinishedRun, LaunchOptions, StandbyGuard, end_leftovers};
use elk_mission::{AppType, Mission, Registry, describe, element, instead};
use elk_outside::colour::{self, Style};
use elk_outside::text;
use elk_scope::Table;

use crate::arguments::{AppArgs, AttachArgs, BrokerArgs, LaunchArgs, MissionArgs};
use crate::missions;
use crate::registry::registry;
use crate::terminal::{print_table, say, show};
use crate::version::{BUILD, REVISION};
use crate::view::Companion;

/// `elk launch`
pub fn launch(arguments: LaunchArgs) -> Result<ExitCode> {
    let (mut mission, notes) = missions::load(&arguments.mission.mission, &arguments.mission.sets)?;
    let community = arguments.community_of(&mission)?;
    if arguments.detach && !arguments.background {
        return launch_in_background(&community);
    }
    if arguments.community.is_none() && mission.community.as_ref() == Some(&community) {
        tell(format_args!(
            "its community is {community}, as the mission says: `elk apps --community {community}` shows who runs"
        ));
    }
    notes.into_iter().for_each(tell);
    if let Some(pace) = arguments.pace {
        set_pace(&mut mission, pace)?;
    }
    let program = itself()?;
    let _companion = match arguments.view {
        true => {
            let (companion, address) = Companion::start(&program, &community)?;
            say(&format!("watch it at {address}\n"))?;
            Some(companion)
        }
        false => None,
    };
    let options = LaunchOptions {
        program,
        revision: REVISION.to_owned(),
        community,
        log_dir: arguments.log_dir,
        headless: arguments.headless,
        auto: arguments.auto,
        in_process: arguments.in_process,
        detached: arguments.detach,
        background: arguments.background,
        registry: registry(),
    };
    conclude(elk_launcher::launch(mission, &options)?)
}

/// `elk launch --detach`: this same command again, by a launcher that gives the terminal back.
fn launch_in_background(community: &Community) -> Result<ExitCode> {
    let mut launcher = Command::new(itself()?);
    launcher.args(["launch", "--background"]).args(std::env::args_os().skip(2));
    match elk_launcher::wait_until_begun(launcher).context("the launcher cannot be started")? {
        Some(ended) => {
            Ok(ended.code().and_then(|code| u8::try_from(code).ok()).map_or(ExitCode::FAILURE, ExitCode::from))
        }
        None => {
            say(&format!(
                "it runs in the background: `elk attach --community {community}` brings it back, to watch or end it\n"
            ))?;
            Ok(ExitCode::SUCCESS)
        }
    }
}

/// Says to the mission's controllers how fast their robot goes.
fn set_pace(mission: &mut Mission, pace: f64) -> Result<()> {
    const PACE: &str = "Pace";
    let mut controllers: Vec<_> = mission.apps.iter_mut().filter(|app| app.element == element::CONTROLLER).collect();
    if let Some(other) = controllers.iter().find(|app| !(app.is_builtin() && app.takes(PACE))) {
        bail!("--pace {pace}: {} has no parameter {PACE}; right is a controller that has one", other.name);
    }
    for controller in &mut controllers {
        controller.set(PACE, &pace.to_string()).with_context(|| format!("--pace {pace}"))?;
    }
    Ok(())
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

fn conclude(run: FinishedRun) -> Result<ExitCode> {
    report(&run)?;
    if let Some(error) = run.unwritten {
        return Err(error.into());
    }
    Ok(if run.summary.complete { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn report(run: &FinishedRun) -> Result<()> {
    let (colours, summary) = (colour::on(&std::io::stdout()), run.summary.to_string());
    let (head, rest) = summary.split_once('\n').unwrap_or((&summary, ""));
    let style = if run.summary.complete { Style::Good } else { Style::Bad };
    show(&format!("{}\n{}", style.paint(&text::printable(head), colours), text::printable_lines(rest)))?;
    match &run.picture {
        Some(Ok(picture)) => say(&format!("  picture {}\n", picture.display()))?,
        Some(Err(error)) => say(&format!("  no picture: {error}\n"))?,
        None => {}
    }
    let elsewhere = run.elsewhere.iter().map(|(said, file)| format!("{} ({said})", file.display()));
    let elsewhere = elsewhere.collect::<Vec<_>>().join(" and ");
    let but = if elsewhere.is_empty() { String::new() } else { format!(", but {elsewhere}") };
    say(&format!("  all of it is in {}{but}\n", run.folder.display()))?;
    match &run.summary {
        summary if summary.complete => Ok(()),
        // What matters most comes last, where it is seen.
        summary => say(&format!("NOT complete: {}\n", summary.reason)),
    }
}

/// `elk check`
pub fn check(arguments: &MissionArgs) -> Result<ExitCode> {
    let (mission, notes) = missions::load(&arguments.mission, &arguments.sets)?;
    let warnings = mission.preflight()?;
    let mut text = format!("{}: {} is right\n", arguments.mission.display(), mission.name);
    for app in &mission.apps {
        text += &format!("  {} {} {}\n", app.element, app.type_name(), app.name);
    }
    for note in notes.iter().chain(&warnings) {
        text += &format!("  note: {note}\n");
    }
    say(&text)?;
    Ok(ExitCode::SUCCESS)
}

/// `elk missions`
pub fn missions() -> Result<ExitCode> {
    let rows: Vec<Vec<String>> = std::iter::once(["NAME", "EXPLORES"])
        .chain(missions::BUILT_IN.iter().map(|one| [one.name, one.about]))
        .map(|row| row.map(str::to_owned).to_vec())
        .collect();
    print_table(&Table { rows, ..Table::default() })?;
    Ok(ExitCode::SUCCESS)
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
    let community = arguments.community.community.clone();
    let config = BrokerConfig::new(community.as_str()).with_mailbox_bytes((arguments.mailbox as usize) << 20);
    let moos = arguments.gateway().map(Listening::at).transpose()?;
    let standby = StandbyGuard::of_launcher();
    end_leftovers(&community).into_iter().for_each(|said| tell(format_args!("elk db: {said}")));
    let served = serve_broker_at(community, config, Clock::new(arguments.time_warp), moos);
    // What is left is ended all the same.
    if let Some(standby) = standby {
        standby.take_over();
    }
    served?;
    Ok(ExitCode::SUCCESS)
}

/// `elk sensor`, `elk filter`, …
pub fn app(element: &str, arguments: AppArgs) -> Result<ExitCode> {
    let app_type = app_type(element, &arguments.type_name)?;
    let params = app_type.check(&arguments.settings, Path::new(""))?;
    let name = arguments.name.unwrap_or_else(|| element.to_owned());
    let app = (app_type.build)(&params).map_err(|error| anyhow!("{name}: {error}"))?;
    let options = RunOptions::new(name, arguments.community.community).of_build(BUILD);
    run_app(app, &options.as_launched()?)?;
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
