//! Walls that part space and bound none of it: those that two rooms share, drawn by both of them.
//!
//! They are in the file more often than what hangs together with them. So may an outer wall be that was exported with two
//! sides; but a surface that bounds something has two faces at each of its edges, or at least an even number: what is
//! missed at its edges bounds something. The tile of a floor on which a box stands, drawn by either, is a partition, too,
//! with free space on neither side of it.

use crate::topology::{Junction, Links, Topology};

/// The shells, as indices, that bound nothing. `copies` says of each triangle how often its face is in the file.
pub(crate) fn partitions(topology: &Topology, copies: &[u32]) -> Vec<usize> {
    let Topology { shells, junctions, .. } = topology;
    let mut bounds = drawn_as_often_as_others(topology, copies);
    let odd = |junction: &Junction| junction.shells.iter().filter(|&&shell| bounds[shell]).count() % 2 == 1;
    let mut is_odd: Vec<bool> = junctions.iter().map(odd).collect();
    let junctions_of = junctions_of(shells.len(), junctions);
    // By length: at which of its edges a shell is missed, more than at which it would be too much.
    let missed = |shell: usize, is_odd: &[bool]| -> f64 {
        let own = junctions_of[shell].iter();
        own.map(|&i| if is_odd[i] { junctions[i].length } else { -junctions[i].length }).sum()
    };
    let mut doubtful: Vec<(f64, usize)> =
        (0..shells.len()).filter(|&shell| !bounds[shell]).map(|shell| (missed(shell, &is_odd), shell)).collect();
    doubtful.sort_by(|a, b| b.0.total_cmp(&a.0));
    for (_, shell) in doubtful {
        if missed(shell, &is_odd) > 0.0 {
            bounds[shell] = true;
            junctions_of[shell].iter().for_each(|&i| is_odd[i] = !is_odd[i]);
        }
    }
    (0..shells.len()).filter(|&shell| !bounds[shell]).collect()
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
