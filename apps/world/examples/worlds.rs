//! Writes the worlds that come with elk to `mission-files/worlds/`, and those of its suites to `mission-files/suites/worlds/`:
//! `cargo run -p elk-world --example worlds`

use std::path::Path;

use elk_world::scenery::{OF_SUITES, SITES, Scenery};

fn main() -> std::io::Result<()> {
    for site in &SITES {
        write("worlds", site.name, &(site.build)())?;
    }
    for (name, build) in OF_SUITES {
        write("suites/worlds", name, &build())?;
    }
    Ok(())
}

fn write(folder: &str, name: &str, scenery: &Scenery) -> std::io::Result<()> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../mission-files").join(folder);
    std::fs::create_dir_all(&folder)?;
    std::fs::write(folder.join(format!("{name}.obj")), scenery.to_obj("cargo run -p elk-world --example worlds"))?;
    println!("{name:10} {:4} triangles", scenery.triangles().len());
    Ok(())
}
