//! The command line: all commands, and what is said of each.

use std::path::PathBuf;

use clap::{Parser, Subcommand};

use crate::arguments::{AppArgs, AttachArgs, BrokerArgs, CommunityArgs, LaunchArgs, MissionArgs};
use crate::compare::CompareArgs;
use crate::control;
use crate::log::LogCommand;
use crate::new::NewArgs;
use crate::replay::ReplayArgs;
use crate::scope::ScopeCommand;
use crate::version::VERSION;
use crate::world::WorldCommand;

/// Explores worlds as mission files say, each app a process of its own.
#[derive(Debug, Parser)]
#[command(name = "elk", version, long_version = VERSION, arg_required_else_help = true)]
#[command(after_help = "Example: elk launch mission-files/apartment.xml")]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What elk can do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Run a mission: start its broker and apps, watch over them, sum up
    #[command(
        after_help = "Example: elk launch mission-files/apartment.xml --set Explorer.type=ClosestFrontier\n         \
                            elk launch car --set Explorer.exec=../mine/target/release/mine\n         \
                            elk launch logs/apartment-20261123-224512 --headless"
    )]
    Launch(LaunchArgs),
    /// Bring a mission that was launched with --detach back to this terminal, whether its launcher lives or not
    #[command(after_help = "Example: elk launch car --detach; elk attach")]
    Attach(AttachArgs),
    /// Show who runs in a mission: process, state, CPU, memory, mail dropped, restarts
    #[command(after_help = "Example: elk apps --json")]
    Apps(control::AppsArgs),
    /// Stop an app of a running mission
    #[command(after_help = "Example: elk stop Filter")]
    Stop(control::StopArgs),
    /// Start a stopped app of a running mission, and wait until it has registered
    #[command(after_help = "Example: elk start Filter")]
    Start(control::StartArgs),
    /// Exchange an app of a running mission: its mail goes on to the new one
    #[command(after_help = "Example: elk swap Explorer type=ClosestFrontier\n         \
                            elk swap Explorer exec=../mine/target/release/mine Climb=2")]
    Swap(control::SwapArgs),
    /// Hold the robot of a running mission before its next pose
    #[command(after_help = "Example: elk pause")]
    Pause(CommunityArgs),
    /// Let the robot of a paused or manual mission run on
    #[command(after_help = "Example: elk pause; elk resume")]
    Resume(CommunityArgs),
    /// Let the robot of a paused or manual mission take one pose
    #[command(after_help = "Example: elk pause; elk step; elk resume")]
    Step(CommunityArgs),
    /// Check a mission file, its world, its start and its executables, and start nothing
    #[command(after_help = "Example: elk check mission-files/apartment.xml --set Map.Res=0.05")]
    Check(MissionArgs),
    /// Run strategies against each other in one mission, over seeds: a table with mean and spread, and a CSV file
    #[command(override_usage = "elk compare [OPTIONS] STRATEGY… MISSION")]
    #[command(after_help = "Example: elk compare Potential ClosestFrontier ../mine/target/release/mine --seeds 1..3 \
                            -j 2 car\n         elk compare 'Potential Start=flux' \
                            'Potential Start=shortest' car\n\nA run that fails is a row that says why. Ends with 1 if a run is \
                            not complete.")]
    Compare(CompareArgs),
    /// Make a crate of your own that builds, runs and is tested: an app, or an explorer
    #[command(after_help = "Example: elk new explorer mine --path ../mine")]
    New(NewArgs),
    /// List the missions that are built in, with their worlds: they run from anywhere
    #[command(after_help = "Example: elk missions; elk launch car")]
    Missions,
    /// Print what makes a shell complete elk's commands
    #[command(after_help = "Example: source <(elk completions bash)\n         \
                            mkdir -p ~/.config/fish/completions; elk completions fish > ~/.config/fish/completions/elk.fish")]
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Write the manual's pages
    #[command(after_help = "Example: elk man ~/.local/share/man/man1")]
    Man {
        /// The folder to write them into
        folder: PathBuf,
    },
    /// List the app types with their parameters, units, defaults and meaning
    #[command(after_help = "Example: elk types Explorer")]
    Types {
        /// Only the types of this element: Sensor, Filter, Map, Explorer, Controller or Logger
        element: Option<String>,
    },
    /// Serve a community: the broker by itself
    #[command(after_help = "Example: elk db --mailbox 64")]
    Db(BrokerArgs),
    /// Run a sensor by itself
    #[command(after_help = "Example: elk sensor --type Simulator World=mission-files/worlds/car.obj")]
    Sensor(AppArgs),
    /// Run a filter by itself
    #[command(after_help = "Example: elk filter --type Distance Threshold=5 Input=SCAN Output=SCAN_1")]
    Filter(AppArgs),
    /// Run a map by itself
    #[command(after_help = "Example: elk map --type OctoMap Res=0.05 Input=SCAN_1")]
    Map(AppArgs),
    /// Run an explorer by itself
    #[command(after_help = "Example: elk explorer --type Potential 'Mid=0; 0; 0' 'Dim=5.7; 4.3; 4.5'")]
    Explorer(AppArgs),
    /// Run a controller by itself
    #[command(after_help = "Example: elk controller --type MOOSSim")]
    Controller(AppArgs),
    /// Run a logger by itself
    #[command(after_help = "Example: elk logger --type Mcap File=everything.mcap")]
    Logger(AppArgs),
    /// Looks into a running community, and pokes.
    #[command(flatten)]
    Scope(ScopeCommand),
    /// Look at a world before a robot is sent into it
    #[command(after_help = "Example: elk world info mission-files/worlds/car.obj\n         \
                            elk world check room.obj --scale 0.5 --start '0.5; 0.5; 0.4'")]
    World {
        /// What to do
        #[command(subcommand)]
        command: WorldCommand,
    },
    /// Draw plan and section of a run into its folder
    #[command(after_help = "Example: elk picture logs/apartment-20261123-224512")]
    Picture {
        /// The run's folder
        run: PathBuf,
    },
    /// Play a log back onto the bus, or into live apps
    #[command(after_help = crate::replay::HELP)]
    Replay(Box<ReplayArgs>),
    /// Look into logs: what is in them, are they whole, mend, shorten, compare, hand on
    #[command(after_help = "Example: elk log info logs/apartment-20261123-224512")]
    Log {
        /// What to do
        #[command(subcommand)]
        command: LogCommand,
    },
    /// End the processes of a launcher that is gone; the launcher starts this itself
    #[command(hide = true)]
    Guard,
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::Cli;

    #[test]
    fn the_command_line_is_consistent_and_every_command_has_an_example() {
        let command = Cli::command();
        command.clone().debug_assert();
        let log = command.find_subcommand("log").unwrap();
        let world = command.find_subcommand("world").unwrap();
        for (group, one) in
            [log, world].into_iter().flat_map(|group| group.get_subcommands().map(move |one| (group, one)))
        {
            let help = one.get_after_help().map(|help| help.to_string()).unwrap_or_default();
            let name = format!("elk {} {}", group.get_name(), one.get_name());
            assert!(help.contains(&name), "{name}");
        }
        for one in command.get_subcommands().filter(|one| !one.is_hide_set()) {
            let help = one.get_after_help().map(|help| help.to_string()).unwrap_or_default();
            assert!(help.contains(&format!("elk {}", one.get_name())), "{}", one.get_name());
        }
    }
}
