//! Writes the worlds that come with elk to `mission-files/worlds/`: `cargo run -p elk-world --example worlds`

use std::path::Path;

use elk_world::scenery::SITES;

fn main() -> std::io::Result<()> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../mission-files/worlds");
    std::fs::create_dir_all(&folder)?;
    for site in &SITES {
        let scenery = (site.build)();
        let file = folder.join(format!("{}.obj", site.name));
        std::fs::write(&file, scenery.to_obj("cargo run -p elk-world --example worlds"))?;
        println!("{:10} {:4} triangles", site.name, scenery.triangles().len());
    }
    Ok(())
}
