//! Poses in texts.

use nalgebra::{Isometry3, Matrix4, Rotation3, UnitQuaternion};

/// A pose of sixteen numbers, row by row.
pub fn pose<'a>(words: impl Iterator<Item = &'a str>) -> Isometry3<f64> {
    let matrix = Matrix4::from_row_iterator(words.map(|word| word.parse::<f64>().unwrap()));
    let rotation = Rotation3::from_matrix(&matrix.fixed_view::<3, 3>(0, 0).into_owned());
    let position = matrix.fixed_view::<3, 1>(0, 3).into_owned();
    Isometry3::from_parts(position.into(), UnitQuaternion::from_rotation_matrix(&rotation))
}
