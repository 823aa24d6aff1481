//! The command line: all commands, and what is said of each.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Result;
use clap::{Args, CommandFactory, Parser, Subcommand};
use elk_launcher::Order;

use crate::arguments::{AppArgs, AttachArgs, BrokerArgs, CommunityArgs, LaunchArgs, MissionArgs};
use crate::compare::{self, CompareArgs};
use crate::evaluate::{self, EvaluateArgs};
use crate::log::{self, LogCommand};
use crate::mapfile::{self, MapFileCommand};
use crate::new::{self, NewArgs};
use crate::pipe::{self, PipeArgs};
use crate::replay::{self, ReplayArgs};
use crate::scope::{self, ScopeCommand};
use crate::version::VERSION;
use crate::view::{self, ViewArgs};
use crate::world::{self, WorldCommand};
use crate::{commands, control, manual, sensor};

/// Explores worlds as mission files say, each app a process of its own.
#[derive(Debug, Parser)]
#[command(name = "elk", version, long_version = VERSION, arg_required_else_help = true)]
#[command(after_help = "Example: elk launch mission-files/apartment.xml")]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands, each an entry: its help and example, its arguments, and what it does.
macro_rules! commands {
    ($($(#[$meta:meta])* $name:ident($arguments:ident: $type:ty) => $run:expr;)*) => {
        /// What elk can do.
        #[derive(Debug, Subcommand)]
        pub enum Command {
            $($(#[$meta])* $name($type),)*
        }

        impl Command {
            /// Does it.
            pub fn run(self) -> Result<ExitCode> {
                match self {
                    $(Self::$name($arguments) => $run,)*
                }
            }
        }
    };
}

commands! {
    /// Run a mission: start its broker and apps, watch over them, sum up
    #[command(
        after_help = "Example: elk launch mission-files/apartment.xml --set Explorer.type=ClosestFrontier\n         \
                            elk launch car --set Explorer.exec=../mine/target/release/mine\n         \
                            elk launch logs/apartment-20261123-224512 --headless"
    )]
    Launch(arguments: LaunchArgs) => commands::launch(arguments);
    /// Bring a mission that was launched with --detach back to this terminal, whether its launcher lives or not
    #[command(after_help = "Example: elk launch car --detach; elk attach")]
    Attach(arguments: AttachArgs) => commands::attach(arguments);
    /// Show who runs in a mission: process, state, CPU, memory, mail dropped, restarts
    #[command(after_help = "Example: elk apps --json")]
    Apps(arguments: control::AppsArgs) => control::apps(&arguments);
    /// Stop an app of a running mission
    #[command(after_help = "Example: elk stop Filter")]
    Stop(arguments: control::StopArgs) => control::stop(arguments);
    /// Start a stopped app of a running mission, and wait until it has registered
    #[command(after_help = "Example: elk start Filter")]
    Start(arguments: control::StartArgs) => control::start(arguments);
    /// Exchange an app of a running mission: its mail goes on to the new one
    #[command(after_help = "Example: elk swap Explorer type=ClosestFrontier\n         \
                            elk swap Explorer exec=../mine/target/release/mine Climb=2")]
    Swap(arguments: control::SwapArgs) => control::swap(arguments);
    /// Hold the robot of a running mission before its next pose
    #[command(after_help = "Example: elk pause")]
    Pause(arguments: CommunityArgs) => control::motion(&arguments.community, &Order::Pause);
    /// Let the robot of a paused or manual mission run on
    #[command(after_help = "Example: elk pause; elk resume")]
    Resume(arguments: CommunityArgs) => control::motion(&arguments.community, &Order::Resume);
    /// Let the robot of a paused or manual mission take one pose
    #[command(after_help = "Example: elk pause; elk step; elk resume")]
    Step(arguments: CommunityArgs) => control::motion(&arguments.community, &Order::Step);
    /// Watch and steer a mission in the browser or in Lichtblick, or look at a recorded run
    #[command(after_help = "Example: elk view\n         elk view logs/apartment-20261123-224512")]
    View(arguments: ViewArgs) => view::view(arguments);
    /// Check a mission file, its world, its start and its executables, and start nothing
    #[command(after_help = "Example: elk check mission-files/apartment.xml --set Map.Res=0.05")]
    Check(arguments: MissionArgs) => commands::check(&arguments);
    /// Run strategies against each other in one mission, over seeds: a table with mean and spread, and a CSV file
    #[command(override_usage = "elk compare [OPTIONS] STRATEGY… MISSION")]
    #[command(after_help = "Example: elk compare Potential ClosestFrontier ../mine/target/release/mine --seeds 1..3 \
                            -j 2 car\n         elk compare 'Potential Start=flux' \
                            'Potential Start=shortest' car\n\nA run that fails is a row that says why. Ends with 1 if a run is \
                            not complete.")]
    Compare(arguments: CompareArgs) => compare::compare(&arguments);
    /// Run a suite: strategies × worlds × starts on equal terms, with tables, pictures and a report
    #[command(after_help = "Example: elk evaluate mission-files/suites/quick.xml\n\nAn evaluation that was stopped goes on \
                            with the same command. Ends with 1 if a run is not complete.")]
    Evaluate(arguments: EvaluateArgs) => evaluate::evaluate(&arguments);
    /// Make a crate of your own that builds, runs and is tested: an app, an explorer, or a sensor
    #[command(after_help = "Example: elk new explorer mine --path ../mine")]
    New(arguments: NewArgs) => new::new(&arguments);
    /// List the missions that are built in, with their worlds: they run from anywhere
    #[command(after_help = "Example: elk missions; elk launch car")]
    Missions(_arguments: NoArgs) => commands::missions();
    /// Print what makes a shell complete elk's commands
    #[command(after_help = "Example: source <(elk completions bash)\n         \
                            mkdir -p ~/.config/fish/completions; elk completions fish > ~/.config/fish/completions/elk.fish")]
    Completions(arguments: CompletionsArgs) => manual::completions(Cli::command(), arguments.shell);
    /// Write the manual's pages
    #[command(after_help = "Example: elk man ~/.local/share/man/man1")]
    Man(arguments: ManArgs) => manual::man(Cli::command(), &arguments.folder);
    /// List the app types with their parameters, units, defaults and meaning
    #[command(after_help = "Example: elk types Explorer")]
    Types(arguments: TypesArgs) => commands::types(arguments.element.as_deref());
    /// Serve a community: the broker by itself
    #[command(after_help = "Example: elk db --mailbox 64")]
    Db(arguments: BrokerArgs) => commands::db(arguments);
    /// Run a sensor by itself, or look at one pair of images of a stereo camera
    #[command(after_help = "Example: elk sensor --type Simulator World=mission-files/worlds/car.obj\n         \
                            elk sensor --type Stereo docs/seeing/left.png docs/seeing/right.png \
                            --calibration docs/seeing/cameras.yaml -o seen")]
    Sensor(arguments: sensor::SensorArgs) => sensor::run(arguments);
    /// Run a filter by itself
    #[command(after_help = "Example: elk filter --type Distance Threshold=5 Input=SCAN Output=SCAN_1")]
    Filter(arguments: AppArgs) => commands::app("Filter", arguments);
    /// Run a map by itself
    #[command(after_help = "Example: elk map --type OctoMap Res=0.05 Input=SCAN_1")]
    Map(arguments: AppArgs) => commands::app("Map", arguments);
    /// Run an explorer by itself
    #[command(after_help = "Example: elk explorer --type Potential 'Mid=0; 0; 0' 'Dim=5.7; 4.3; 4.5'")]
    Explorer(arguments: AppArgs) => commands::app("Explorer", arguments);
    /// Run a controller by itself
    #[command(after_help = "Example: elk controller --type MOOSSim")]
    Controller(arguments: AppArgs) => commands::app("Controller", arguments);
    /// Run a logger by itself
    #[command(after_help = "Example: elk logger --type Mcap File=everything.mcap")]
    Logger(arguments: AppArgs) => commands::app("Logger", arguments);
    /// Run a program in any language as an app: JSON lines on its standard input and output
    #[command(after_help = "Example: elk pipe Shouter --subscribe 'GREET*' -- sh -c 'cat >&2'\n\nIts lines are \
                            described in docs/pipe.md.")]
    Pipe(arguments: PipeArgs) => pipe::pipe(arguments);
    /// Looks into a running community, and pokes.
    #[command(flatten)]
    Scope(arguments: ScopeCommand) => scope::run(arguments);
    /// Look at a world before a robot is sent into it
    #[command(after_help = "Example: elk world info mission-files/worlds/car.obj\n         \
                            elk world check room.obj --scale 0.5 --start '0.5; 0.5; 0.4'")]
    #[command(subcommand)]
    World(arguments: WorldCommand) => world::run(arguments);
    /// Look into the files of maps, make one of another, and hold one against the true world
    #[command(after_help = "Example: elk mapfile info logs/apartment-20261123-224512/map.bt\n         \
                            elk mapfile convert logs/apartment-20261123-224512/map.bt -o apartment.ot")]
    #[command(subcommand)]
    Mapfile(arguments: MapFileCommand) => mapfile::run(arguments);
    /// Draw plan and section of a run into its folder
    #[command(after_help = "Example: elk picture logs/apartment-20261123-224512")]
    Picture(arguments: PictureArgs) => commands::picture(&arguments.run);
    /// Play a log back onto the bus, or into live apps
    #[command(after_help = crate::replay::HELP)]
    Replay(arguments: Box<ReplayArgs>) => replay::run(*arguments);
    /// Look into logs: what is in them, are they whole, mend, shorten, compare, hand on
    #[command(after_help = "Example: elk log info logs/apartment-20261123-224512")]
    #[command(subcommand)]
    Log(arguments: LogCommand) => log::run(arguments);
    /// End the processes of a launcher that is gone; the launcher starts this itself
    #[command(hide = true)]
    Guard(_arguments: NoArgs) => commands::guard();
}

/// Nothing to say.
#[derive(Debug, Args)]
pub struct NoArgs {}

/// Which shell.
#[derive(Debug, Args)]
pub struct CompletionsArgs {
    /// The shell
    shell: clap_complete::Shell,
}

/// Where to.
#[derive(Debug, Args)]
pub struct ManArgs {
    /// The folder to write them into
    folder: PathBuf,
}

/// Which types.
#[derive(Debug, Args)]
pub struct TypesArgs {
    /// Only the types of this element: Sensor, Filter, Map, Explorer, Controller or Logger
    element: Option<String>,
}

/// Which run.
#[derive(Debug, Args)]
pub struct PictureArgs {
    /// The run's folder
    run: PathBuf,
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
        let mapfile = command.find_subcommand("mapfile").unwrap();
        for (group, one) in
            [log, mapfile, world].into_iter().flat_map(|group| group.get_subcommands().map(move |one| (group, one)))
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
