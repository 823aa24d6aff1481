//! A wall with a blank door: matched by SAD5, and triangulated.

use elk_stereo::{Image, Matcher, Noise, Rig, Sad5, Sad5Config, Unmatched};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // A wall of speckles straight ahead, and a blank door in it: what the left camera sees at column c the right one sees at c − 12.
    let speckle = |row: usize, column: usize| ((row * 7919 + column * 104_729) ^ (row * column * 31)) as u8;
    let wall = |row: usize, column: usize| if (100..180).contains(&column) { 90 } else { speckle(row, column) };
    let left = Image::from_fn(240, 120, wall)?;
    let right = Image::from_fn(240, 120, |row, column| wall(row, column + 12))?;

    let disparity = Sad5::new(Sad5Config::default())?.disparity(&left, &right)?;
    assert!(disparity.get(60, 60).is_ok_and(|d| (d - 12.0).abs() < 0.1));
    assert_eq!(disparity.get(60, 140), Err(Unmatched::Textureless), "of the door nothing is guessed");

    // z = f b / d (thesis 3.9), known to z² / (f b) σ_d.
    let rig = Rig::new(600.0, [60.0, 120.0], 0.1)?;
    let cloud: Vec<_> = rig.cloud(&disparity).collect();
    assert!(cloud.iter().all(|(_, _, point)| (point.z - 5.0).abs() < 0.2));
    let covariance = rig.covariance(60.0, 60.0, 12.0, Noise::default()).ok_or("infinitely far")?;
    println!("{} points of a wall 5 m ahead, ± {:.2} m each", cloud.len(), covariance[(2, 2)].sqrt());
    Ok(())
}
