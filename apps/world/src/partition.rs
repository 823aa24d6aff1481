//! Walls that part space and bound none of it: a partition between two rooms, drawn by both of them, or once where floor
//! and ceiling are cut at it.
//!
//! A surface that bounds something has two faces at each of its edges, or at least an even number. Where three meet, one
//! is too many. It is the one that is drawn more often than what hangs together with it, as a wall that two rooms share;
//! else the flattest one, as no other surface with its rim is smaller. The tile of a floor on which a box stands, drawn
//! by either, is one, too, with free space on neither side of it.

use nalgebra::Vector3;

use crate::topology::{Junction, Links, Topology};
use crate::triangle::Triangle;

/// The shells, as indices, that bound nothing. `copies` says of each triangle how often its face is in the file.
pub(crate) fn partitions(topology: &Topology, triangles: &[Triangle], copies: &[u32]) -> Vec<usize> {
    let Topology { shells, junctions, .. } = topology;
    let mut bounds = drawn_as_often_as_others(topology, copies);
    let odd = |junction: &Junction| junction.shells.iter().filter(|&&shell| bounds[shell]).count() % 2 == 1;
    let mut is_odd: Vec<bool> = junctions.iter().map(odd).collect();
    let junctions_of = junctions_of(shells.len(), junctions);
    let all = (0..shells.len()).filter(|&shell| !junctions_of[shell].is_empty());
    let mut by_flatness: Vec<(f64, usize)> = all.map(|shell| (flatness(topology, shell, triangles), shell)).collect();
    by_flatness.sort_by(|a, b| b.0.total_cmp(&a.0));
    for (_, shell) in by_flatness {
        let own = &junctions_of[shell];
        let gained: f64 = own.iter().map(|&i| if is_odd[i] { junctions[i].length } else { -junctions[i].length }).sum();
        if gained > 0.0 {
            bounds[shell] = !bounds[shell];
            own.iter().for_each(|&i| is_odd[i] = !is_odd[i]);
        }
    }
    // Sheets that meet at an edge, some of them drawn twice: there is nothing else that could bound anything.
    let none_bounds = !bounds.contains(&true);
    (0..shells.len()).filter(|&shell| !bounds[shell] && !none_bounds).collect()
}

/// Of each shell: whether it is in the file no more often than any of those that it meets, by way of others, too.
fn drawn_as_often_as_others(topology: &Topology, copies: &[u32]) -> Vec<bool> {
    let least_of = |triangles: &[usize]| triangles.iter().map(|&i| copies[i]).min().unwrap_or(1);
    let own: Vec<u32> = topology.shells.iter().map(|shell| least_of(&shell.triangles)).collect();
    let mut links = Links::new(own.len());
    let meeting = topology.junctions.iter().flat_map(|junction| junction.shells.windows(2));
    meeting.for_each(|pair| links.join(pair[0], pair[1], false));
    let mut least = own.clone();
    for (shell, &copies) in own.iter().enumerate() {
        let root = links.root(shell).0;
        least[root] = least[root].min(copies);
    }
    own.iter().enumerate().map(|(shell, &copies)| copies == least[links.root(shell).0]).collect()
}

/// The junctions at which each shell has an odd number of triangles: those that change with it.
fn junctions_of(shells: usize, junctions: &[Junction]) -> Vec<Vec<usize>> {
    let mut junctions_of = vec![Vec::new(); shells];
    for (i, junction) in junctions.iter().enumerate() {
        let odd = junction.shells.chunk_by(|a, b| a == b).filter(|same| same.len() % 2 == 1);
        odd.for_each(|same| junctions_of[same[0]].push(i));
    }
    junctions_of
}

/// The least area that a surface with a shell's rim can have, as a share of the shell's: 1 if it is flat, 0 if it has no
/// rim.
fn flatness(topology: &Topology, shell: usize, triangles: &[Triangle]) -> f64 {
    let (mut vector, mut area) = (Vector3::zeros(), 0.0);
    for &i in &topology.shells[shell].triangles {
        let normal = triangles[i].normal();
        vector += if topology.against[i] { -normal } else { normal };
        area += normal.norm();
    }
    if area > 0.0 { vector.norm() / area } else { 0.0 }
}
