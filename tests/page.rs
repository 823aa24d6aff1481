//! The page in a real browser, before the real server, of a mission of processes and of a recorded run.

mod common;

use std::time::Duration;

use common::browser::Browser;
use common::car::car;
use common::events::Patience;
use common::lab::hear;
use common::skip::skip;
use common::{Elk, kill};
use elk_bus::{Client, Mail, ValueRef, codec};
use elk_geometry::{OccupancyGrid, State, Voxel};
use elk_log::LogReader;
use elk_spatial::checks::MAX_BRICKS;
use elk_spatial::keys::{MAP_KNOWN, MAP_PART, MAP_REQUEST, MAP_UPDATE, PROGRESS};
use elk_spatial::map::MapUpdate;
use elk_spatial::replica::Replica;
use rustix::process::Signal;
use serde_json::json;

/// How many voxels the page knows, and a number of each of its sets that no other set is likely to have: known, occupied.
const SHOWN: &str = "[elk.known, ...['known', 'occupied'].map(plane => {
    let digest = 0;
    for (const chunk of elk.world.voxels.chunks()) for (let i = 0; i < 1024; i++) for (let x = 0; x < 32; x++)
        if (chunk[plane][i] >>> x & 1) {
            const at = [32 * chunk.x + x, 32 * chunk.y + (i & 31), 32 * chunk.z + (i >> 5)];
            digest = digest + at.reduce((hash, part) => Math.imul(hash ^ part, 0x9e3779b1) >>> 0, 7) >>> 0;
        }
    return digest;
})]";

/// The bar says that the mission is paused.
const IS_PAUSED: &str = "document.querySelector('[aria-label=Steering] [aria-pressed=true]')";

fn digest(voxels: impl Iterator<Item = Voxel>) -> u32 {
    let of =
        |Voxel { x, y, z }| [x, y, z].iter().fold(7, |hash: u32, part| (hash ^ *part as u32).wrapping_mul(0x9e37_79b1));
    voxels.map(of).fold(0, u32::wrapping_add)
}

/// The page comes to have the voxels of this map, and no others.
fn assert_shows(browser: &mut Browser, grid: &OccupancyGrid) {
    let voxels = || grid.bricks().voxels();
    let known = voxels().filter(|(_, state)| *state != State::Unknown).map(|(voxel, _)| voxel);
    let occupied = voxels().filter(|(_, state)| *state == State::Occupied).map(|(voxel, _)| voxel);
    let wanted = json!([grid.free() + grid.occupied(), digest(known), digest(occupied)]);
    let patience = Patience::new();
    loop {
        let shown = browser.until(SHOWN);
        if shown == wanted {
            return;
        }
        patience.left(format_args!("{wanted} on the page, which shows {shown}"));
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// The map of the running mission, which stands still.
fn map_of(client: &mut Client) -> Replica {
    client.comms.register(&MAP_KNOWN).unwrap();
    let wanted = hear(client, "how much is known", |mail| Some(mail.decode(&MAP_KNOWN).unwrap().revision));
    client.comms.register(&MAP_PART).unwrap();
    client.comms.notify(MAP_REQUEST, 0.0).unwrap();
    let mut replica = Replica::new(None, MAX_BRICKS);
    // The latest part is of an answer to somebody else, and may be an older map's.
    hear(client, "the whole map", |mail| {
        let part = mail.is(&MAP_PART).then(|| mail.decode(&MAP_PART).unwrap())?;
        if part.revision == wanted {
            replica.take_part(&part).unwrap();
        }
        (replica.grid().revision() == wanted).then_some(())
    });
    replica
}

fn scans(mail: &Mail<'_>) -> u64 {
    mail.decode(&PROGRESS).unwrap().scans
}

/// The address that a command has printed.
fn address(said: &str) -> Option<&str> {
    said.split_whitespace().find(|word| word.starts_with("http://"))
}

#[test]
fn a_mission_is_watched_and_steered_by_clicks() {
    let mut browser = match Browser::start() {
        Ok(browser) => browser,
        Err(why) => return skip("a_mission_is_watched_and_steered_by_clicks", "chromium", why),
    };
    let elk = Elk::new("page");
    let mission = car("auto").replace("<Scenario", "<Scenario broker-restarts=\"100\"");
    let mut launcher = elk.launch_with(&mission, &["--view"]);
    let mut watcher = elk.join("watcher");
    watcher.comms.register(&PROGRESS).unwrap();
    hear(&mut watcher, "a few scans", |mail| (scans(mail) >= 3).then_some(()));
    elk.obeyed(&["pause"]);
    launcher.wait_until("an address", |said| address(said).is_some());
    browser.open(address(&launcher.said()).unwrap());

    browser.until(&format!("elk.known > 0 && {IS_PAUSED}"));
    let before = map_of(&mut elk.join("reader"));
    assert_shows(&mut browser, before.grid());

    browser.click_button("Step");
    hear(&mut watcher, "a scan more", |mail| (scans(mail) > before.scan()).then_some(()));
    let after = map_of(&mut elk.join("reader"));
    assert_eq!(after.scan(), before.scan() + 1);
    assert_shows(&mut browser, after.grid());

    // The space bar is the button of the moment.
    browser.press(" ");
    hear(&mut watcher, "more scans", |mail| (scans(mail) >= before.scan() + 3).then_some(()));
    browser.click_button("Pause");
    browser.until(IS_PAUSED);
    let paused = map_of(&mut elk.join("reader"));
    assert_shows(&mut browser, paused.grid());

    let others = if elk.row("Explorer")["type"] == "ClosestFrontier" { "Potential" } else { "ClosestFrontier" };
    browser.click_button("Apps");
    browser.click_button("Explorer");
    browser.click_button("Swap…");
    browser.until(&format!(
        "(document.querySelector('#swap-type').value = {}, \
         document.querySelector('#swap-type').dispatchEvent(new Event('change')), true)",
        json!(others)
    ));
    browser.click("dialog[open] [type=submit]");
    browser.until(&format!("document.querySelector('#panels').textContent.includes({})", json!(others)));
    let row = elk.row("Explorer");
    assert_eq!((&row["type"], &row["swaps"]), (&json!(others), &json!(1)));

    // A broker that is killed is back so soon that the page need not say a word.
    let broker = elk.process("db");
    kill(broker, Signal::KILL);
    browser.click_button("Step");
    hear(&mut watcher, "a scan more", |mail| (scans(mail) > paused.scan()).then_some(()));
    let after = map_of(&mut elk.join("reader"));
    assert_shows(&mut browser, after.grid());
    assert_ne!(elk.process("db"), broker);

    browser.click_button("Resume");
    let (code, said) = launcher.end();
    assert_eq!(code, Some(0), "{said}");
    assert_eq!(elk.summary()["complete"], true, "{said}");
    assert_eq!(browser.errors(), [""; 0]);
}

/// The map that a log leads to, scan by scan, with the time of each.
fn maps_of(log: &std::path::Path, times: usize) -> Vec<(f64, OccupancyGrid)> {
    let mut reader = LogReader::open(log).unwrap();
    let mut replica = Replica::new(None, MAX_BRICKS);
    let mut maps = Vec::new();
    while let Some(record) = reader.next_ref() {
        let record = record.unwrap();
        let ValueRef::Binary { bytes, .. } = record.value else { continue };
        if record.key == MAP_UPDATE.name() {
            replica.take(&codec::decode::<MapUpdate>(bytes).unwrap()).unwrap();
            maps.push((record.received, replica.grid().clone()));
        }
    }
    let every = maps.len().div_ceil(times);
    maps.into_iter().step_by(every).collect()
}

#[test]
fn a_recorded_run_is_sought_on_the_time_line() {
    let mut browser = match Browser::start() {
        Ok(browser) => browser,
        Err(why) => return skip("a_recorded_run_is_sought_on_the_time_line", "chromium", why),
    };
    let elk = Elk::new("line");
    let (code, said) = elk.launch(&car("auto")).end();
    assert_eq!(code, Some(0), "{said}");
    let run = elk.run();
    let mut view = elk.spawn("said-view.txt", elk.command(&["view", &run.display().to_string()]));
    view.wait_until("an address", |said| address(said).is_some());
    browser.open(address(&view.said()).unwrap());
    // It plays, and stops where the run ended.
    browser.until("elk.known > 0 && document.querySelector('.timeline button').textContent === 'Play'");
    let maps = maps_of(&run.join("log.mcap"), 5);
    assert!(maps.len() >= 4, "{}", maps.len());
    let (last, forwards) = maps.split_last().unwrap();
    for (time, grid) in forwards.iter().chain([last, &forwards[1], &forwards[0], last]) {
        // Just behind it: a slider knows no microseconds of times since 1970.
        let seek = format!(
            "((line) => (line.value = {}, line.dispatchEvent(new Event('input')), true))\
             (document.querySelector('[aria-label=\"Time\"]'))",
            time + 1e-3
        );
        browser.until(&seek);
        assert_shows(&mut browser, grid);
    }
    assert_eq!(browser.errors(), [""; 0]);
}
