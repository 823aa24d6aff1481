//! What is known of the lines between the centres of two voxels without walking them.

use super::sweep::{axes, first_face};
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

/// Whether a voxel that is not free lies on the line between the centres of `from` and `target`, before `target`, whatever
/// rounding does. It is looked for from `target` on: mostly what hides a voxel is next to it. Else the line has to be walked
/// ([`in_sight`](super::in_sight)).
pub fn hidden(free: &mut Near<'_>, from: Voxel, target: Voxel) -> bool {
    let way = from - target;
    let [along, aside, across] = axes(first_face(way));
    let way = way.to_array();
    let (layers, side) = (way[along].abs(), way[along].signum());
    let slope = |axis: usize| f64::from(way[axis]) / f64::from(layers.max(1));
    let (u, v) = (slope(aside), slope(across));
    let mut is_free = |layer: i32, y: i32, z: i32| {
        let mut voxel = target.to_array();
        voxel[along] += side * layer;
        voxel[aside] += y;
        voxel[across] += z;
        free.contains(voxel.into())
    };
    // Where it passes the face between two layers, it has come from the voxel before it, and goes to the one behind.
    (0..layers).any(|layer| {
        let at = f64::from(layer) + 0.5;
        let voxels = nearest(u * at).zip(nearest(v * at));
        voxels.is_some_and(|(y, z)| layer > 0 && !is_free(layer, y, z) || !is_free(layer + 1, y, z))
    })
}

/// The number that is nearest; `None`: it is about as far to another.
fn nearest(number: f64) -> Option<i32> {
    // Larger than any offset in a map, so that cutting off digits rounds down.
    const SHIFT: f64 = 131_072.5;
    let nearest = (number + SHIFT) as i32 - SHIFT as i32;
    ((number - f64::from(nearest)).abs() < 0.5 - 1e-6).then_some(nearest)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::ray::Traversal;
    use crate::set::VoxelSet;

    fn voxel(n: i32) -> impl Strategy<Value = Voxel> {
        prop::array::uniform3(-n..=n).prop_map(Voxel::from)
    }

    /// The line as it is walked.
    fn line(from: Voxel, target: Voxel, resolution: f64) -> Vec<Voxel> {
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
                        let way = line(from, target, 0.1);
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

        /// What is said to be hidden is not seen; and most of what is not seen is said to be.
        #[test]
        fn what_is_hidden_is_not_seen(
            (from, target) in (voxel(20), voxel(20)),
            seed in any::<u32>(),
            far in prop_oneof![Just(0), Just(-32_000), Just(31_900)],
            resolution in prop_oneof![Just(0.1), Just(0.05), Just(0.2)],
        ) {
            let by = Voxel::new(far, far, far);
            let way = line(from + by, target + by, resolution);
            let before = &way[..way.len() - 1];
            // One voxel of those around the line is not free, or none.
            let around = way.iter().flat_map(|voxel| voxel.neighbours().chain([*voxel]));
            let mut free: VoxelSet = around.filter(|voxel| *voxel != target + by).collect();
            prop_assert!(!hidden(&mut free.near(), from + by, target + by));
            let gone = free.iter().nth(seed as usize % free.len()).unwrap();
            free.remove(gone);
            prop_assert!(!hidden(&mut free.near(), from + by, target + by) || before.contains(&gone));
        }
    }

    #[test]
    fn of_what_is_not_seen_most_is_hidden() {
        let all = || (-6..=6).flat_map(|x| (-6..=6).flat_map(move |y| (-6..=6).map(move |z| Voxel::new(x, y, z))));
        let from = Voxel::new(9, -4, 2);
        let (mut unseen, mut said) = (0, 0);
        for target in all() {
            for blocked in line(from, target, 0.1).iter().filter(|voxel| **voxel != target) {
                let mut free: VoxelSet =
                    line(from, target, 0.1).into_iter().flat_map(|voxel| voxel.neighbours().chain([voxel])).collect();
                free.remove(*blocked);
                unseen += 1;
                said += usize::from(hidden(&mut free.near(), from, target));
            }
        }
        assert!(said * 10 > unseen * 7, "{said} of {unseen}");
    }
}
