//! Small components (thesis 3.2.5.4): pixels whose neighbours have a similar disparity belong together, and what is small is more
//! often wrong than seen.

use crate::disparity::{Disparity, Unmatched};

/// A stretch of a row whose neighbours differ little: from a column to before another.
#[derive(Clone, Copy)]
struct Run {
    start: usize,
    end: usize,
}

/// Which runs belong together: a forest of which each root holds the number of pixels of its tree.
#[derive(Default)]
struct Forest {
    parents: Vec<u32>,
    sizes: Vec<u32>,
}

impl Forest {
    fn plant(&mut self, run: Run) {
        self.parents.push(self.parents.len() as u32);
        self.sizes.push((run.end - run.start) as u32);
    }

    fn root(&mut self, mut node: usize) -> usize {
        while self.parents[node] as usize != node {
            self.parents[node] = self.parents[self.parents[node] as usize];
            node = self.parents[node] as usize;
        }
        node
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        if a != b {
            let (kept, other) = (a.min(b), a.max(b));
            self.parents[other] = kept as u32;
            self.sizes[kept] += self.sizes[other];
        }
    }
}

/// Rejects 8-connected components of fewer than `least` pixels, of which neighbours differ by at most `similarity` pixels.
pub(crate) fn reject_small(disparity: &mut Disparity, least: usize, similarity: f32) {
    let width = disparity.width();
    let values = disparity.values_mut();
    let (mut runs, mut forest, mut rows) = (Vec::<Run>::new(), Forest::default(), vec![0]);
    for row in values.chunks_exact(width) {
        runs.extend(runs_of(row, similarity));
        runs[*rows.last().unwrap_or(&0)..].iter().for_each(|&run| forest.plant(run));
        rows.push(runs.len());
    }
    for (y, pair) in rows.windows(3).enumerate() {
        let [above, below] = [y, y + 1].map(|y| &values[y * width..][..width]);
        join_rows(&runs, &mut forest, [pair[0], pair[1], pair[2]], [above, below], similarity);
    }
    for (y, row) in rows.windows(2).enumerate() {
        for i in row[0]..row[1] {
            let root = forest.root(i);
            if (forest.sizes[root] as usize) < least {
                values[y * width..][runs[i].start..runs[i].end].fill(Unmatched::SmallComponent.code());
            }
        }
    }
}

/// The runs of a row.
fn runs_of(row: &[f32], similarity: f32) -> impl Iterator<Item = Run> + '_ {
    let mut start = 0;
    std::iter::from_fn(move || {
        start += row[start..].iter().position(|&value| value >= 0.0)?;
        let goes_on = |pair: &[f32]| pair[1] >= 0.0 && (pair[1] - pair[0]).abs() <= similarity;
        let end = start + 1 + row[start..].windows(2).take_while(|pair| goes_on(pair)).count();
        let run = Run { start, end };
        start = end;
        Some(run)
    })
}

/// Joins runs of two rows that touch, corner to corner included, at pixels that differ little.
fn join_rows(runs: &[Run], forest: &mut Forest, [first, middle, end]: [usize; 3], rows: [&[f32]; 2], similarity: f32) {
    let mut from = first;
    for below in middle..end {
        let run = runs[below];
        while from < middle && runs[from].end < run.start {
            from += 1;
        }
        let touching = (from..middle).take_while(|&above| runs[above].start <= run.end);
        for above in touching {
            if touch(runs[above], run, rows, similarity) {
                forest.join(above, below);
            }
        }
    }
}

/// Whether a pixel of one run has a neighbour of similar disparity in the other.
fn touch(above: Run, below: Run, [upper, lower]: [&[f32]; 2], similarity: f32) -> bool {
    let similar = |x: usize, other: usize| (upper[other] - lower[x]).abs() <= similarity;
    let mut columns = below.start.max(above.start.saturating_sub(1))..below.end.min(above.end + 1);
    columns.any(|x| (x.saturating_sub(1).max(above.start)..(x + 2).min(above.end)).any(|other| similar(x, other)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The components by a search from pixel to pixel.
    fn by_search(width: usize, values: &[f32], least: usize, similarity: f32) -> Vec<bool> {
        let height = values.len() / width;
        let mut kept = vec![false; values.len()];
        for start in (0..values.len()).filter(|&i| values[i] >= 0.0) {
            let (mut found, mut open) = (vec![start], vec![start]);
            while let Some(i) = open.pop() {
                let (y, x) = (i / width, i % width);
                for ny in y.saturating_sub(1)..(y + 2).min(height) {
                    for nx in x.saturating_sub(1)..(x + 2).min(width) {
                        let n = ny * width + nx;
                        let is_similar = values[n] >= 0.0 && (values[n] - values[i]).abs() <= similarity;
                        if is_similar && !found.contains(&n) {
                            found.push(n);
                            open.push(n);
                        }
                    }
                }
            }
            kept[start] = found.len() >= least;
        }
        kept
    }

    proptest! {
        #[test]
        fn what_is_left_is_what_a_search_from_pixel_to_pixel_leaves(
            width in 1usize..9,
            least in 0usize..12,
            values in proptest::collection::vec(prop_oneof![Just(-1.0f32), (0u8..4).prop_map(f32::from)], 1..80),
        ) {
            let height = values.len().div_ceil(width);
            let mut values = values;
            values.resize(width * height, -1.0);
            let expected = by_search(width, &values, least, 1.0);
            let mut disparity = Disparity::new(width, values.clone());
            reject_small(&mut disparity, least, 1.0);
            for (i, said) in disparity.iter().enumerate() {
                let right = match (values[i] >= 0.0, expected[i]) {
                    (false, _) => Err(Unmatched::Textureless),
                    (true, false) => Err(Unmatched::SmallComponent),
                    (true, true) => Ok(values[i]),
                };
                prop_assert_eq!(said, right, "pixel {} of {:?}", i, &values);
            }
        }
    }
}
