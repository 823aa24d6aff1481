//! Writes a building of at least so many rooms, its doors and furniture drawn by a seed, as OBJ:
//! `cargo run -p elk-world --example building -- ROOMS [SEED] > building.obj`. Where a robot can start is said beside it.

use elk_world::scenery::Building;

fn main() {
    let numbers: Vec<u64> = std::env::args().skip(1).filter_map(|word| word.parse().ok()).collect();
    let [rooms, rest @ ..] = &numbers[..] else {
        eprintln!("which building? right is: ROOMS [SEED], two numbers");
        std::process::exit(2);
    };
    let seed = rest.first().copied().unwrap_or(1);
    let building = Building::new(*rooms as usize, seed);
    let (start, dim) = (building.before(0).position(), building.extents().dim());
    eprintln!(
        "{} rooms, {:.1} x {:.1} x {:.1} m; Start {}; {}; {}",
        building.rooms(),
        dim.x,
        dim.y,
        dim.z,
        start.x,
        start.y,
        start.z
    );
    print!("{}", building.scenery().to_obj(&format!("cargo run -p elk-world --example building -- {rooms} {seed}")));
}
