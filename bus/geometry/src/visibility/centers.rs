//! What is known of the lines between the centres of two voxels without walking them.

use super::sweep::{axes, first_face};
use crate::bricks::{BRICK, brick_of};
use crate::frontier::Faces;
use crate::set::Near;
use crate::voxel::Voxel;

/// The faces through which lines from the centre of `from` come to the centres of the voxels of a box (corners, both in it): each
/// through that of the axis along which it goes farthest. Of several such axes rounding may choose any.
pub fn entered(from: Voxel, [low, high]: [Voxel; 2]) -> Faces {
    let (least, most) = ((from - high).to_array(), (from - low).to_array());
    let farthest = (0..3).map(|axis| least[axis].max(-most[axis]).max(0)).fold(1, i32::max);
    Faces::of(from, |face, _| {
        let axis = face / 2;
        let along = if face % 2 == 0 { -least[axis] } else { most[axis] };
        along >= farthest
    })
}

/// What is known of a line between the centres of two voxels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Line {
    /// A voxel on it is not free, whatever rounding does.
    Hidden,
    /// All voxels on it are free, whatever rounding does.
    Clear,
    /// It has to be walked ([`in_sight`](super::in_sight)): it passes so near to a voxel that is not free that rounding decides.
    Unsure,
}

/// What is known of the line between the centres of `from` and `target`, before `target`, over voxels of which those of a set are
/// free. It is followed from `target` on: mostly what hides a voxel is next to it. Where a whole brick is free nothing is looked at.
pub fn line(free: &mut Near<'_>, from: Voxel, target: Voxel) -> Line {
    let way = from - target;
    let [along, aside, across] = axes(first_face(way));
    let way = way.to_array();
    let (layers, side) = (way[along].abs(), way[along].signum());
    let slope = |axis: usize| f64::from(way[axis]) / f64::from(layers.max(1));
    let (u, v) = (slope(aside), slope(across));
    let voxel = |layer: i32, y: i32, z: i32| {
        let mut voxel = target.to_array();
        voxel[along] += side * layer;
        voxel[aside] += y;
        voxel[across] += z;
        Voxel::from(voxel)
    };
    // Where it passes the face between a layer and the next; of the last one, where it begins.
    let passes = |layer: i32| {
        let at = (f64::from(layer) + 0.5).clamp(0.0, f64::from(layers));
        [around(u * at), around(v * at)]
    };
    let (mut layer, mut line, mut came) = (0, Line::Clear, passes(-1));
    while layer <= layers {
        let last = last_of_brick(target.to_array()[along], side, layer).min(layers);
        let went = passes(last);
        if !between(came, went)
            .bricks()
            .is_some_and(|mut all| all.all(|(y, z)| free.has_brick(brick_of(voxel(layer, y, z)))))
        {
            for layer in layer..=last {
                let went = passes(layer);
                let mut is_free = |(y, z)| voxel(layer, y, z) == target || free.contains(voxel(layer, y, z));
                if !between(came, went).voxels().all(&mut is_free) {
                    line = Line::Unsure;
                    if ![certain(came), certain(went)].into_iter().flatten().all(is_free) {
                        return Line::Hidden;
                    }
                }
                came = went;
            }
        }
        (layer, came) = (last + 1, went);
    }
    line
}

/// The last layer that is in the same brick as `layer`, at `side` of a voxel with this index.
fn last_of_brick(index: i32, side: i32, layer: i32) -> i32 {
    let within = (index + side * layer) & (BRICK - 1);
    layer + if side < 0 { within } else { BRICK - 1 - within }
}

/// The integers that a number may be rounded to: the same twice, but for one that is about as far from both.
type Around = [i32; 2];

fn around(number: f64) -> Around {
    // Larger than any offset in a map, so that cutting off digits rounds down.
    const SHIFT: f64 = 131_072.5;
    [number - 1e-6, number + 1e-6].map(|number| (number + SHIFT) as i32 - SHIFT as i32)
}

/// Where a line is for certain, aside and across.
fn certain([y, z]: [Around; 2]) -> Option<(i32, i32)> {
    (y[0] == y[1] && z[0] == z[1]).then_some((y[0], z[0]))
}

/// A rectangle aside and across, by its least and largest integers.
struct Rectangle {
    y: [i32; 2],
    z: [i32; 2],
}

/// The one that a line does not leave between two places.
fn between([y, z]: [Around; 2], [y_then, z_then]: [Around; 2]) -> Rectangle {
    let both = |a: Around, b: Around| [a[0].min(b[0]), a[1].max(b[1])];
    Rectangle { y: both(y, y_then), z: both(z, z_then) }
}

impl Rectangle {
    /// All in it.
    fn voxels(&self) -> impl Iterator<Item = (i32, i32)> + use<> {
        let ([y, y_last], [z, z_last]) = (self.y, self.z);
        (z..=z_last).flat_map(move |z| (y..=y_last).map(move |y| (y, z)))
    }

    /// One in each brick that any is in; `None`: it is wider than a brick, and those may be more than its corners are in.
    fn bricks(&self) -> Option<impl Iterator<Item = (i32, i32)> + use<>> {
        let ([y, y_last], [z, z_last]) = (self.y, self.z);
        let is_narrow = y_last - y <= BRICK && z_last - z <= BRICK;
        is_narrow.then(|| [(y, z), (y_last, z), (y, z_last), (y_last, z_last)].into_iter())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::bricks::{BRICK_CELLS, voxel_at};
    use crate::random::Random;
    use crate::ray::Traversal;
    use crate::set::VoxelSet;

    fn voxel(n: i32) -> impl Strategy<Value = Voxel> {
        prop::array::uniform3(-n..=n).prop_map(Voxel::from)
    }

    /// The line as it is walked.
    fn walked(from: Voxel, target: Voxel, resolution: f64) -> Vec<Voxel> {
        Traversal::new(from.center(resolution), target.center(resolution), resolution).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(1024))]
        /// Wherever a line comes from to a voxel of a box, it comes through one of these faces; and of each there is a line, or one
        /// that goes as far along another axis.
        #[test]
        fn lines_come_through_the_faces_that_are_said(
            from in voxel(12),
            (corner, size) in (voxel(9), prop::array::uniform3(0..3i32)),
            far in prop_oneof![Just(0), Just(-32_000), Just(31_900)],
        ) {
            let from = from + Voxel::new(far, far, far);
            let low = corner + Voxel::new(far, far, far);
            let high = low + Voxel::from(size);
            let said = entered(from, [low, high]);
            let side = |low: i32, high: i32| low..=high;
            let mut all = Faces::default();
            for x in side(low.x, high.x) {
                for y in side(low.y, high.y) {
                    for target in side(low.z, high.z).map(|z| Voxel::new(x, y, z)).filter(|target| *target != from) {
                        let way = walked(from, target, 0.1);
                        let last = way[way.len() - 2];
                        let face = Faces::of(target, |_, beside| beside == last);
                        let single = entered(from, [target; 2]);
                        prop_assert!(single.meets(face) && said.meets(face), "{target:?}");
                        all = all.or(single);
                    }
                }
            }
            prop_assert_eq!(said.or(all), said);
        }

        /// What is said to be hidden is not seen, and what is said to be clear is, wherever bricks are whole.
        #[test]
        fn what_is_hidden_is_not_seen_and_what_is_clear_is(
            (from, target) in (voxel(20), voxel(20)),
            seed in any::<u32>(),
            far in prop_oneof![Just(0), Just(-32_000), Just(31_900)],
            resolution in prop_oneof![Just(0.1), Just(0.05), Just(0.2)],
            is_wide in any::<bool>(),
        ) {
            let by = Voxel::new(far, far, far);
            let (from, target) = (from + by, target + by);
            let way = walked(from, target, resolution);
            let before = &way[..way.len() - 1];
            // One voxel of those around the line is not free, or none; or of those of all bricks that it passes.
            let around = way.iter().flat_map(|voxel| voxel.neighbours().chain([*voxel]));
            let near: VoxelSet = around.filter(|voxel| *voxel != target).collect();
            let whole = near.bricks().flat_map(|(brick, _)| (0..BRICK_CELLS).map(move |cell| voxel_at(brick, cell)));
            let mut free: VoxelSet = if is_wide { whole.filter(|voxel| *voxel != target).collect() } else { near.clone() };
            prop_assert_eq!(line(&mut free.near(), from, target), Line::Clear);
            let gone = near.iter().nth(seed as usize % near.len()).unwrap();
            free.remove(gone);
            let is_seen = !before.contains(&gone);
            let said = line(&mut free.near(), from, target);
            prop_assert!(said == Line::Unsure || (said == Line::Clear) == is_seen, "{:?}", said);
        }

        /// The same where much is not free.
        #[test]
        fn what_is_said_of_lines_through_scattered_voxels_is_so(
            (from, target) in (voxel(20), voxel(20)),
            seed in any::<u64>(),
            (share, far) in (0.02..0.2f64, prop_oneof![Just(0), Just(-32_000)]),
        ) {
            let by = Voxel::new(far, far, far);
            let (from, target) = (from + by, target + by);
            let way = walked(from, target, 0.1);
            let around: VoxelSet = way.iter().flat_map(|voxel| voxel.neighbours().chain([*voxel])).collect();
            let mut random = Random::new(seed, 0);
            let free: VoxelSet = around.iter().filter(|_| random.unit() >= share).collect();
            let is_seen = way[..way.len() - 1].iter().all(|voxel| free.contains(*voxel));
            let said = line(&mut free.near(), from, target);
            prop_assert!(said == Line::Unsure || (said == Line::Clear) == is_seen, "{:?}", said);
        }
    }

    #[test]
    fn of_most_lines_it_is_known_whether_they_are_clear() {
        let all = || (-6..=6).flat_map(|x| (-6..=6).flat_map(move |y| (-6..=6).map(move |z| Voxel::new(x, y, z))));
        let from = Voxel::new(9, -4, 2);
        let (mut blocked, mut hidden) = (0, 0);
        for target in all() {
            for gone in walked(from, target, 0.1).iter().filter(|voxel| **voxel != target) {
                let around = walked(from, target, 0.1).into_iter();
                let mut free: VoxelSet = around.flat_map(|voxel| voxel.neighbours().chain([voxel])).collect();
                free.remove(*gone);
                blocked += 1;
                hidden += usize::from(line(&mut free.near(), from, target) == Line::Hidden);
            }
        }
        assert!(hidden * 10 > blocked * 7, "{hidden} of {blocked}");
    }
}
