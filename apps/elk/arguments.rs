//! Arguments that several commands take, and those of the commands that run something.

use std::ffi::OsString;
use std::path::PathBuf;
use std::sync::LazyLock;

use clap::Args;
use elk_bus::Community;
use elk_bus::launched::{COMMUNITY, USUAL_COMMUNITY};
use elk_bus::moos::gateway::{Address, CONNECTIONS, GatewayOptions, MOST_CONNECTIONS, Network};
use elk_bus::moos::text::Texts;
use elk_mission::{Mission, Override};

/// The community of commands that say none. It is a default, and not the argument's variable, for commands that are of no
/// community at all.
static DEFAULT_COMMUNITY: LazyLock<OsString> =
    LazyLock::new(|| std::env::var_os(COMMUNITY).unwrap_or_else(|| USUAL_COMMUNITY.into()));

/// Which community.
#[derive(Debug, Args)]
pub struct CommunityArgs {
    /// The community's name, without it $ELK_COMMUNITY; communities of one machine do not hear each other
    #[arg(long, default_value = DEFAULT_COMMUNITY.as_os_str())]
    pub community: Community,
}

/// A broker.
#[derive(Debug, Args)]
pub struct BrokerArgs {
    /// Which community.
    #[command(flatten)]
    pub community: CommunityArgs,
    /// Mail that is kept for each client, and for one that died and is started again (MB)
    #[arg(long, value_name = "MB", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub mailbox: u32,
    /// How many times as fast as the wall's the community's clock runs, as MOOSTimeWarp has it
    #[arg(long, value_name = "N", default_value_t = 1.0, value_parser = time_warp)]
    pub time_warp: f64,
    /// Let MOOS' own clients in as well, as a MOOSDB does: where they connect
    #[arg(long, value_name = "HOST:PORT")]
    pub moos: Option<Address>,
    /// From where else than this machine they may connect; may be said several times
    #[arg(long, value_name = "NETWORK", requires = "moos")]
    pub moos_from: Vec<Network>,
    /// Let them publish under the names of others, as players of logs and bridges do
    #[arg(long, requires = "moos")]
    pub moos_any_source: bool,
    /// Variables whose typed values they hear and say as Key=Value texts; may be said several times
    #[arg(long, value_name = "PATTERN", requires = "moos")]
    pub moos_text: Vec<String>,
    /// The most of them at a time (1 to 1024)
    #[arg(long, value_name = "N", default_value_t = CONNECTIONS as u32, requires = "moos",
          value_parser = clap::value_parser!(u32).range(1..=MOST_CONNECTIONS as i64))]
    pub moos_connections: u32,
}

impl BrokerArgs {
    /// Where MOOS' clients may connect, if they may.
    pub fn gateway(&self) -> Option<GatewayOptions> {
        Some(GatewayOptions {
            address: self.moos.clone()?,
            networks: self.moos_from.clone(),
            any_source: self.moos_any_source,
            texts: Texts::new(self.moos_text.iter().cloned()),
            connections: self.moos_connections as usize,
        })
    }
}

/// Which mission, and what to change in it.
#[derive(Debug, Args)]
pub struct MissionArgs {
    /// The mission file, MOOS' own (`.moos`, whose ANTLER block says what to launch) as well, the name of a built-in one (`elk
    /// missions` lists them), or the folder of a run that is to be had again
    pub mission: PathBuf,
    /// Say a parameter here instead of in the file; `type` exchanges the app's type, `exec` (and `args`) or `pipe` puts
    /// another program in its place; files from the working directory
    #[arg(long = "set", value_name = "APP.PARAM=VALUE")]
    pub sets: Vec<Override>,
}

/// How to launch a mission.
#[derive(Debug, Args)]
pub struct LaunchArgs {
    /// Which mission.
    #[command(flatten)]
    pub mission: MissionArgs,
    /// Run a manual mission through, without waiting for Enter
    #[arg(long)]
    pub auto: bool,
    /// Where the run's folder is made
    #[arg(long, default_value = "logs", value_name = "DIR")]
    pub log_dir: PathBuf,
    /// Plain lines instead of one that changes
    #[arg(long)]
    pub headless: bool,
    /// Give the terminal back once the mission runs, which outlives its launcher; `elk attach` brings it back
    #[arg(long, conflicts_with = "in_process")]
    pub detach: bool,
    /// The launcher that gives the terminal back; `--detach` starts it itself
    #[arg(long, hide = true, requires = "detach")]
    pub background: bool,
    /// Move the robot so many times as fast as a robot goes (its controller's Speed and TurnRate), so that there is
    /// something to watch; 0: as fast as it can be
    #[arg(long, value_name = "N")]
    pub pace: Option<f64>,
    /// Show it in the browser meanwhile: the address is printed
    #[arg(long, conflicts_with = "in_process")]
    pub view: bool,
    /// Run everything in this one process, over a bus in memory
    #[arg(long)]
    pub in_process: bool,
    /// The community's name, without it $ELK_COMMUNITY, or what the mission says; communities of one machine do not hear each
    /// other
    #[arg(long)]
    pub community: Option<Community>,
}

impl LaunchArgs {
    /// The community that a mission is launched in.
    ///
    /// # Errors
    /// $ELK_COMMUNITY is no name for one.
    pub fn community_of(&self, mission: &Mission) -> anyhow::Result<Community> {
        let by_environment = || std::env::var(COMMUNITY).ok().map(Community::new).transpose();
        match self.community.clone() {
            Some(said) => Ok(said),
            None => Ok(match by_environment()?.or_else(|| mission.community.clone()) {
                Some(said) => said,
                None => Community::new(USUAL_COMMUNITY)?,
            }),
        }
    }
}

/// Which mission is to be picked up.
#[derive(Debug, Args)]
pub struct AttachArgs {
    /// Plain lines instead of one that changes
    #[arg(long)]
    pub headless: bool,
    /// Which community.
    #[command(flatten)]
    pub community: CommunityArgs,
}

/// One app by itself.
#[derive(Debug, Args)]
pub struct AppArgs {
    /// Its type; `elk types` lists them
    #[arg(long = "type", value_name = "TYPE")]
    pub type_name: String,
    /// Its name on the bus; its element's if not said
    #[arg(long)]
    pub name: Option<String>,
    /// Which community.
    #[command(flatten)]
    pub community: CommunityArgs,
    /// Its parameters
    #[arg(value_name = "PARAM=VALUE", value_parser = setting)]
    pub settings: Vec<(String, String)>,
}

fn time_warp(said: &str) -> Result<f64, String> {
    let warp = said.parse::<f64>().ok().filter(|warp| (0.01..=400.0).contains(warp));
    warp.ok_or_else(|| "right is a number from 0.01 to 400".to_owned())
}

/// `Param=Value`
pub fn setting(said: &str) -> Result<(String, String), String> {
    let wrong = || format!("{said:?} is no parameter: right is Param=Value, for example Res=0.05");
    let (name, text) = said.split_once('=').ok_or_else(wrong)?;
    Ok((name.trim().to_owned(), text.to_owned()))
}
