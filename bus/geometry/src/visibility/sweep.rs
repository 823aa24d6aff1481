//! Which of the rays from a voxel through one of its faces may come to a place: a sweep outwards, layer by layer, that asks of
//! a voxel once, for all rays through it.
//!
//! A ray leads from the voxel's centre to a voxel of a square `n` layers away, `u` and `v` voxels aside: so it passes the middle
//! of layer `x` at `u·x/n` and `v·x/n`, and one voxel there is in its way whatever rounding does, unless it passes just
//! between two. Between the middles of two layers it passes none that is not beside these two. So what is said of many rays at
//! once holds for each of them; those that may come to a place are walked one by one.

use std::ops::RangeInclusive;

use crate::set::Near;
use crate::voxel::Voxel;

/// Rays through a face, by `u` and `v`: a bit each.
#[derive(Debug, Clone)]
pub(super) struct Rays {
    /// The largest `u` and `v`; the smallest is its negative.
    n: i32,
    /// By `u`, so many words each with a bit for each `v`.
    rows: Vec<u64>,
    words: usize,
}

impl Rays {
    pub fn none(n: i32) -> Self {
        let words = (2 * n as usize + 1).div_ceil(64);
        Self { n, rows: vec![0; (2 * n as usize + 1) * words], words }
    }

    /// Those with `u` and `v` in these ranges, which have nothing beyond `n`.
    pub fn within(n: i32, u: RangeInclusive<i32>, v: RangeInclusive<i32>) -> Self {
        let mut rays = Self::none(n);
        if v.is_empty() {
            return rays;
        }
        let mut row = vec![0; rays.words];
        put(&mut row, v.start() + n, v.end() + n);
        u.for_each(|u| rays.row_mut(u).copy_from_slice(&row));
        rays
    }

    pub fn is_empty(&self) -> bool {
        self.rows.iter().all(|word| *word == 0)
    }

    pub fn contains(&self, [u, v]: [i32; 2]) -> bool {
        let v = (v + self.n) as usize;
        self.row(u)[v / 64] >> (v % 64) & 1 == 1
    }

    fn row(&self, u: i32) -> &[u64] {
        &self.rows[(u + self.n) as usize * self.words..][..self.words]
    }

    fn row_mut(&mut self, u: i32) -> &mut [u64] {
        &mut self.rows[(u + self.n) as usize * self.words..][..self.words]
    }
}

/// The words that bits `from` to `to` lie in, each with which of its bits those are.
fn parts(from: i32, to: i32) -> impl Iterator<Item = (usize, u64)> {
    let (from, to) = (from as usize, to as usize);
    (from / 64..=to / 64).map(move |word| {
        let low = from.saturating_sub(64 * word);
        let high = (to - 64 * word).min(63);
        (word, !0 >> (63 - high) & !0 << low)
    })
}

fn put(row: &mut [u64], from: i32, to: i32) {
    parts(from, to).for_each(|(word, bits)| row[word] |= bits);
}

fn has_any(row: &[u64], from: i32, to: i32) -> bool {
    parts(from, to).any(|(word, bits)| row[word] & bits != 0)
}

/// The rays that pass the middle of a layer in a voxel, of those aside along one axis.
#[derive(Debug, Clone, Copy)]
struct Share {
    /// The first and the last that are in it, or just between it and the next.
    touching: [i32; 2],
    /// Those that are inside, whatever rounding does; none if the first is larger.
    inside: [i32; 2],
}

/// The layers of voxels between a voxel and the square that the rays through one of its faces lead to.
#[derive(Debug, Clone)]
pub(super) struct Layers {
    n: i32,
    /// By layer, from 1, which rays pass its middle in which voxels, from as far to one side as layers away to the other.
    shares: Vec<Vec<Share>>,
}

impl Layers {
    pub fn new(n: i32) -> Self {
        let share = |x: i32, y: i32| {
            // Inside is |u·x/n − y| < 1/2.
            let (low, high) = ((2 * y - 1) * n, (2 * y + 1) * n);
            let (least, most) = (-(-low).div_euclid(2 * x), high.div_euclid(2 * x));
            Share {
                touching: [least.max(-n), most.min(n)],
                inside: [(low.div_euclid(2 * x) + 1).max(-n), (-(-high).div_euclid(2 * x) - 1).min(n)],
            }
        };
        Self { n, shares: (1..=n).map(|x| (-x..=x).map(|y| share(x, y)).collect()).collect() }
    }

    /// How many layers there are.
    pub fn n(&self) -> i32 {
        self.n
    }

    /// Those of `rays` from voxel `origin` through face `face` that come near to a voxel of the second set before they come to one
    /// that is not in the first: all that come to one, and some others. The box `within` is enlarged by where it was looked.
    pub fn lit(
        &self,
        (free, reach): &mut (Near, Near),
        (origin, face): (Voxel, Voxel),
        mut rays: Rays,
        within: &mut [Voxel; 2],
    ) -> Rays {
        let [along, aside, across] = axes(face);
        let side = face.to_array()[along];
        let at = |x: i32, y: i32, z: i32| {
            let mut voxel = origin.to_array();
            voxel[along] += side * x;
            voxel[aside] += y;
            voxel[across] += z;
            Voxel::from(voxel)
        };
        let n = self.n;
        let mut lit = Rays::none(n);
        let (mut any, mut near, mut blocked) = (vec![0; rays.words], vec![0; rays.words], vec![0; rays.words]);
        for (x, shares) in (1..).zip(&self.shares) {
            let mut looked = false;
            for (y, row) in (-x..=x).zip(shares) {
                any.fill(0);
                for u in row.touching[0]..=row.touching[1] {
                    any.iter_mut().zip(rays.row(u)).for_each(|(any, word)| *any |= word);
                }
                if any.iter().all(|word| *word == 0) {
                    continue;
                }
                looked = true;
                near.fill(0);
                blocked.fill(0);
                for (z, column) in (-x..=x).zip(shares) {
                    let [first, last] = column.touching.map(|v| v + n);
                    if first > last || !has_any(&any, first, last) {
                        continue;
                    }
                    let (own, before) = (at(x, y, z), at(x - 1, y - y.signum(), z - z.signum()));
                    *within = [within[0].inf(own).inf(before), within[1].sup(own).sup(before)];
                    let [inside, end] = column.inside.map(|v| v + n);
                    if any_around([x, y, z], |[x, y, z]| reach.contains(at(x, y, z))) {
                        put(&mut near, first, last);
                    } else if inside <= end && !free.contains(own) {
                        put(&mut blocked, inside, end);
                    }
                }
                for u in row.touching[0]..=row.touching[1] {
                    let (lit, rays) = (lit.row_mut(u), rays.row_mut(u));
                    for (word, near) in near.iter().enumerate() {
                        lit[word] |= rays[word] & near;
                        rays[word] &= !near;
                    }
                }
                for u in row.inside[0]..=row.inside[1] {
                    rays.row_mut(u).iter_mut().zip(&blocked).for_each(|(word, blocked)| *word &= !blocked);
                }
            }
            if !looked {
                break;
            }
        }
        lit
    }
}

/// Whether any is a place of what a ray may pass between the middle of layer `x − 1` and that of layer `x`, where it is in voxel
/// `y`, `z`.
fn any_around([x, y, z]: [i32; 3], mut is_place: impl FnMut([i32; 3]) -> bool) -> bool {
    let inward = |c: i32| [c, c - c.signum()];
    [x, x - 1].into_iter().any(|x| inward(y).into_iter().any(|y| inward(z).into_iter().any(|z| is_place([x, y, z]))))
}

/// The axis of a face, and the two others, those of `u` and of `v`.
pub(super) fn axes(face: Voxel) -> [usize; 3] {
    match face.to_array() {
        [0, 0, _] => [2, 0, 1],
        [0, _, _] => [1, 0, 2],
        _ => [0, 1, 2],
    }
}

/// The face through which the way from a voxel's centre in direction `d` leaves it: that of the largest component, of
/// equals the first.
pub(super) fn first_face(d: Voxel) -> Voxel {
    let components = d.to_array();
    let largest = (1..3).fold(0, |a, b| if components[b].abs() > components[a].abs() { b } else { a });
    let mut face = [0; 3];
    face[largest] = components[largest].signum();
    face.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_ray_passes_the_middle_of_a_layer_in_one_voxel_or_between_two() {
        for n in [1, 2, 7, 60, 64] {
            let layers = Layers::new(n);
            for (x, shares) in (1..).zip(&layers.shares) {
                for u in -n..=n {
                    let at = f64::from(u * x) / f64::from(n);
                    let in_it = |of: fn(&Share) -> [i32; 2]| {
                        (-x..=x)
                            .zip(shares)
                            .filter(move |(_, share)| (of(share)[0]..=of(share)[1]).contains(&u))
                            .map(|(y, _)| y)
                    };
                    let distance = |y: i32| (at - f64::from(y)).abs();
                    assert!(
                        in_it(|share| share.touching).eq((-x..=x).filter(|y| distance(*y) < 0.5 + 1e-9)),
                        "{n} {x} {u}"
                    );
                    assert!(
                        in_it(|share| share.inside).eq((-x..=x).filter(|y| distance(*y) < 0.5 - 1e-9)),
                        "{n} {x} {u}"
                    );
                }
            }
        }
    }

    #[test]
    fn what_is_put_into_a_row_is_in_it() {
        for (from, to) in [(0, 0), (63, 64), (5, 190), (64, 127), (128, 191)] {
            let mut row = [0; 3];
            put(&mut row, from, to);
            let is_in = |bit: i32| row[bit as usize / 64] >> (bit % 64) & 1 == 1;
            assert!((0..192).all(|bit| is_in(bit) == (from..=to).contains(&bit)));
            assert!((0..192).all(|bit| has_any(&row, bit, bit) == is_in(bit)));
        }
    }
}
