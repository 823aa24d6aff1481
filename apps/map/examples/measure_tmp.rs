#[path = "../tests/scans/mod.rs"]
#[allow(dead_code)]
mod scans;
use elk_map::*;
use std::collections::BTreeMap;
use elk_geometry::bricks::brick_of;
fn look(name: &str, scans: &[scans::Scan], config: MapConfig) {
    let mut map = OccupancyMap::new(config).unwrap();
    let mut seen: BTreeMap<u32, usize> = BTreeMap::new();
    for s in scans { map.insert(s.origin(), s.points());
        for (_, l) in map.known() { let n = seen.len(); seen.entry(l.to_bits()).or_insert(n); } }
    let mut counts: BTreeMap<u32, usize> = BTreeMap::new();
    let mut bricks: BTreeMap<elk_geometry::Voxel, (usize, usize, usize, std::collections::BTreeSet<u32>)> = BTreeMap::new();
    let (mut known, mut clamp) = (0, 0);
    for (v, l) in map.known() {
        *counts.entry(l.to_bits()).or_default() += 1; known += 1;
        let at = l == config.clamp_min || l == config.clamp_max; clamp += at as usize;
        let b = bricks.entry(brick_of(v)).or_default();
        b.0 += 1; b.1 += (!at) as usize; if seen[&l.to_bits()] >= 256 { b.2 += 1 } b.3.insert(l.to_bits());
    }
    let n = bricks.len();
    let late = bricks.values().filter(|b| b.2 > 0).count();
    let m15 = bricks.values().filter(|b| b.3.len() > 15).count();
    let m255 = bricks.values().filter(|b| b.3.len() > 255).count();
    let mean_distinct = bricks.values().map(|b| b.3.len()).sum::<usize>() as f64 / n as f64;
    let all_clamped = bricks.values().filter(|b| b.1 == 0).count();
    println!("{name}: known {known} bricks {n} per brick {:.0}; ever distinct {} now {}; at clamp {:.2}; bricks with late values {:.3}; all clamped {:.3}; mean distinct {mean_distinct:.1}; >15 {:.3} >255 {:.4}; unsettled per brick {:.0}",
        known as f64 / n as f64, seen.len(), counts.len(), clamp as f64 / known as f64, late as f64 / n as f64, all_clamped as f64 / n as f64, m15 as f64/n as f64, m255 as f64/n as f64, (known-clamp) as f64 / n as f64);
}
fn main() {
    for (name, sizes) in [("s100.scn", [0.1, 0.05]), ("real7s.scn", [0.05, 0.02])] {
        if let Some(s) = scans::recorded(name) { for r in sizes {
            look(&format!("{name} {r} octomap"), &s, MapConfig::octomap(r));
            look(&format!("{name} {r} guard"), &s, MapConfig{resolution: r, ..MapConfig::default()});
        } }
    }
    let room = scans::room(100, 100);
    look("room guard", &room, MapConfig{resolution: 0.1, ..MapConfig::default()});
}
