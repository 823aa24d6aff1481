//! The world of a mission that runs, or ran, for the view's pages.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use elk_bus::Community;
use elk_launcher::running_mission;
use elk_log::Index;
use elk_mission::{Mission, Params, Program, Registry, element};
use elk_outside::checksum::fnv1a_of_file;
use elk_view::{Scenery, Surfaces};
use elk_world::{Mesh, Placement, World};

use crate::registry::registry;

/// Triangles that a page is sent at most, some 1 MB: those of a larger world are fewer and larger.
const MOST_TRIANGLES: usize = 50_000;

/// The world of the mission that was recorded in `log`, or else of the one that runs in `community`.
pub fn of(log: Option<&Path>, community: &Community) -> Arc<dyn Scenery> {
    match log {
        Some(log) => Arc::new(Recorded(log.to_owned())),
        None => Arc::new(Running(community.clone())),
    }
}

struct Running(Community);

impl Scenery for Running {
    fn surfaces(&self) -> Result<Surfaces, String> {
        let mission = running_mission(&self.0, &registry());
        let mission = mission.ok_or_else(|| format!("no launcher of community {} says which mission runs", self.0))?;
        surfaces(world_of(&mission)?, MOST_TRIANGLES)
    }
}

struct Recorded(PathBuf);

impl Scenery for Recorded {
    fn surfaces(&self) -> Result<Surfaces, String> {
        let index = Index::read(&self.0, &mut |_, _| {}).map_err(|error| error.to_string())?;
        let recorded = &index.metadata;
        if recorded.effective_mission.is_empty() {
            return Err("the log does not say in which world it was recorded".to_owned());
        }
        let mission = parse(&recorded.effective_mission, &self.0, &registry())?;
        let params = world_of(&mission)?;
        let file = Path::new(params.text("World"));
        // One that is built into the program has no file.
        let found = fnv1a_of_file(file).map(|sum| format!("{sum:016x}")).unwrap_or_default();
        let mut surfaces = surfaces(params, MOST_TRIANGLES)?;
        if found != recorded.world_checksum {
            let changed = format!("{} is not what it was when this was recorded", file.display());
            surfaces.remark =
                [changed, surfaces.remark].into_iter().filter(|words| !words.is_empty()).collect::<Vec<_>>().join("; ");
        }
        Ok(surfaces)
    }
}

/// The mission whose text a log holds; files that have gone since are named.
fn parse(text: &str, log: &Path, registry: &Registry) -> Result<Mission, String> {
    Mission::parse(text, log, registry, &[]).map_err(|problems| format!("its mission cannot be read here: {problems}"))
}

/// The parameters of the sensor that sees a world.
fn world_of(mission: &Mission) -> Result<&Params, String> {
    let seen = mission.of_element(element::SENSOR).find_map(|sensor| match &sensor.program {
        Program::Builtin(type_, params) if type_.param("World").is_some() => Some(params),
        _ => None,
    });
    seen.ok_or_else(|| "the mission's sensor sees no world that elk could read".to_owned())
}

/// The surfaces of the world that a sensor with these parameters sees, in at most `most` triangles.
fn surfaces(params: &Params, most: usize) -> Result<Surfaces, String> {
    let placement = Placement::new(params.number("Scale"), params.text("Up"))?;
    let world = World::load(params.text("World"), &placement).map_err(|error| error.to_string())?;
    let all = world.surfaces().triangles();
    let Mesh { corners, triangles, cell_m } = Mesh::of(all, most);
    let remark = cell_m.map_or(String::new(), |cell| {
        format!(
            "the world is simplified, to {} of {} triangles (what is smaller than {cell:.2} m is lost)",
            triangles.len(),
            all.len()
        )
    });
    Ok(Surfaces { remark, corners, triangles })
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use elk_log::{LogWriter, Metadata};

    use super::*;

    fn log_of(folder: &Path, name: &str, metadata: &Metadata) -> PathBuf {
        let log = folder.join(name).with_extension("mcap");
        LogWriter::create(&log, metadata).unwrap().finish().unwrap();
        log
    }

    fn shown(log: &Path) -> Result<Surfaces, String> {
        of(Some(log), &Community::new("nobody").unwrap()).surfaces()
    }

    #[test]
    fn the_world_of_a_log_is_shown_and_what_has_become_of_it_is_said() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("kitchen.obj");
        std::fs::copy(concat!(env!("CARGO_MANIFEST_DIR"), "/apps/world/worlds/kitchen.obj"), &file).unwrap();
        let mission = |world: &str| {
            format!(
                "<Scenario><Sensor type=\"Simulator\"><World>{world}</World></Sensor><Map type=\"OctoMap\"/>\
                 <Explorer type=\"Potential\"/><Controller type=\"MOOSSim\"/></Scenario>"
            )
        };
        let world_checksum = format!("{:016x}", fnv1a_of_file(&file).unwrap());
        let effective_mission = mission(&file.display().to_string());
        let of_file = Metadata { effective_mission, world_checksum, ..Metadata::default() };
        let log = log_of(folder.path(), "of-file", &of_file);
        let whole = shown(&log).unwrap();
        assert_eq!(whole.remark, "");
        let world = World::load("kitchen", &Placement::default()).unwrap();
        assert_eq!(whole.triangles.len(), world.surfaces().triangles().len());

        let mission_of_log = parse(&of_file.effective_mission, &log, &registry()).unwrap();
        let few = surfaces(world_of(&mission_of_log).unwrap(), 200).unwrap();
        let all = whole.triangles.len();
        assert!(few.triangles.len() <= 200 && few.remark.contains(&format!("of {all} triangles")), "{}", few.remark);

        std::fs::OpenOptions::new()
            .append(true)
            .open(&file)
            .and_then(|mut file| file.write_all(b"# changed\n"))
            .unwrap();
        let changed = shown(&log).unwrap();
        assert!(
            changed.remark.ends_with("kitchen.obj is not what it was when this was recorded"),
            "{}",
            changed.remark
        );
        assert_eq!(changed.triangles, whole.triangles);

        std::fs::remove_file(&file).unwrap();
        let gone = shown(&log).unwrap_err();
        assert!(gone.contains(&format!("there is no file {}", file.display())), "{gone}");

        let built_in = Metadata { effective_mission: mission("kitchen"), ..Metadata::default() };
        assert_eq!(shown(&log_of(folder.path(), "built-in", &built_in)).unwrap(), whole);
        let silent = shown(&log_of(folder.path(), "silent", &Metadata::default())).unwrap_err();
        assert!(silent.contains("does not say in which world"), "{silent}");
        assert!(of(None, &Community::new("nobody").unwrap()).surfaces().unwrap_err().contains("no launcher"));
    }
}
