//! Pairs of which is kept where they were taken and what they saw, and which of them are like another one.

use std::collections::VecDeque;

use elk_stereo::Rig;
use nalgebra::{Isometry3, Vector3};

use crate::reprojection::Observation;
use crate::turn::{self, Thumbnail};

/// Two views are alike where cameras are nearer to each other than this, in parts of the distance of what they see …
const NEAR: f64 = 0.5;
/// … and turned by less than this, radians: most of what the one shows the other shows, too.
const TURNED: f64 = 0.5;

/// A pair of which is kept where it was taken and what it saw.
#[derive(Clone, Debug)]
pub(crate) struct Keyframe {
    /// They are counted as they are taken.
    pub number: u64,
    pub pose: Isometry3<f64>,
    pub small: Thumbnail,
    /// The median distance ahead of what it saw, metres.
    pub depth: f64,
    /// Points of the map by their numbers, ascending.
    pub seen: Vec<(u64, Observation)>,
}

impl Keyframe {
    /// How unlike its view the one from a pose is: 0 where it is the same, 1 where it is just not alike.
    fn unlike(&self, pose: &Isometry3<f64>) -> f64 {
        let way = (self.pose.translation.vector - pose.translation.vector).norm();
        (way / (NEAR * self.depth)).max(self.pose.rotation.angle_to(&pose.rotation) / TURNED)
    }
}

/// The places of so many keyframes whose views are like that from a pose, the most alike last; so many at `least`, alike or not, if there are any.
pub(crate) fn alike(keyframes: &VecDeque<Keyframe>, pose: &Isometry3<f64>, [least, most]: [usize; 2]) -> Vec<usize> {
    let mut sorted: Vec<(usize, f64)> = keyframes.iter().map(|keyframe| keyframe.unlike(pose)).enumerate().collect();
    sorted.sort_by(|a, b| a.1.total_cmp(&b.1));
    let alike = sorted.iter().take_while(|(_, unlike)| *unlike < 1.0).count();
    sorted.truncate(alike.clamp(least, most));
    sorted.iter().rev().map(|(place, _)| *place).collect()
}

/// So many keyframes that are next to a place (metres, world), the nearest first.
pub(crate) fn nearest<'a>(keyframes: &'a VecDeque<Keyframe>, place: &Vector3<f64>, most: usize) -> Vec<&'a Keyframe> {
    let away = |keyframe: &Keyframe| (keyframe.pose.translation.vector - place).norm_squared();
    let mut nearest: Vec<(f64, &Keyframe)> = keyframes.iter().map(|keyframe| (away(keyframe), keyframe)).collect();
    nearest.sort_by(|a, b| a.0.total_cmp(&b.0));
    nearest.truncate(most);
    nearest.into_iter().map(|(_, keyframe)| keyframe).collect()
}

/// Where a pair was taken, were it where each keyframe was and turned as the image is, those first that look most like it.
pub(crate) fn most_alike<'a>(
    keyframes: impl Iterator<Item = &'a Keyframe>,
    rig: &Rig,
    small: &Thumbnail,
) -> Vec<Isometry3<f64>> {
    let turned = keyframes.filter_map(|keyframe| Some((turn::search(rig, &keyframe.small, small)?, keyframe)));
    let mut turned: Vec<_> = turned.collect();
    turned.sort_by(|a, b| a.0.difference.total_cmp(&b.0.difference));
    let there = turned.into_iter().filter_map(|(turn, keyframe)| {
        let turn = turn::turn(rig, &keyframe.small, small, turn.second_from_first)?;
        let rotation = keyframe.pose.rotation * turn.second_from_first.inverse();
        Some(Isometry3::from_parts(keyframe.pose.translation, rotation))
    });
    there.collect()
}

/// The numbers of all points that keyframes saw, ascending, each once.
pub(crate) fn seen<'a>(keyframes: impl Iterator<Item = &'a Keyframe>) -> Vec<u64> {
    let mut seen: Vec<u64> = keyframes.flat_map(|keyframe| keyframe.seen.iter().map(|(number, _)| *number)).collect();
    seen.sort_unstable();
    seen.dedup();
    seen
}

#[cfg(test)]
mod tests {
    use elk_stereo::Image;

    use super::*;
    use crate::pyramid::Pyramid;

    #[test]
    fn views_are_alike_that_are_near_and_turned_little() {
        let image = Image::from_fn(64, 64, |row, column| (row * column % 200) as u8).unwrap();
        let small = Thumbnail::new(&Pyramid::new(&image));
        let keyframes: VecDeque<Keyframe> = [(0.0, 0.0), (0.9, 0.0), (0.2, 0.0), (0.0, 0.6), (0.0, 0.4)]
            .into_iter()
            .zip(0..)
            .map(|((way, turn), number)| {
                let pose = Isometry3::new(Vector3::new(way, 0.0, 0.0), Vector3::new(0.0, turn, 0.0));
                Keyframe { number, pose, small: small.clone(), depth: 1.6, seen: Vec::new() }
            })
            .collect();
        let alike = |least, most| alike(&keyframes, &Isometry3::identity(), [least, most]);
        assert_eq!(alike(0, 9), [4, 2, 0], "of 0.8 m and 0.5 rad that they may be off by");
        assert_eq!(alike(0, 2), [2, 0]);
        let far = Isometry3::translation(5.0, 0.0, 0.0);
        assert!(super::alike(&keyframes, &far, [0, 9]).is_empty());
        assert_eq!(super::alike(&keyframes, &far, [1, 9]), [1]);
        let near = nearest(&keyframes, &Vector3::new(1.0, 0.0, 0.0), 2);
        assert_eq!(near.iter().map(|keyframe| keyframe.number).collect::<Vec<_>>(), [1, 2]);
    }
}
