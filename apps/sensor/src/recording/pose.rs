//! Poses in texts.

use elk_geometry::Pose;
use nalgebra::{Isometry3, Matrix3, Matrix4, Quaternion, Rotation3, Translation3, UnitQuaternion, Vector3};

/// By so much the columns of a rotation may be off length 1 and a right angle: texts are rounded.
const ROUNDED: f64 = 0.01;

/// The numbers of a text.
fn numbers(text: &str) -> Result<Vec<f64>, String> {
    let number = |word: &str| match word.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err(format!("{word:?} is no finite number")),
    };
    text.split_ascii_whitespace().map(number).collect()
}

/// The pose (camera → world) of 16 numbers, row by row.
pub(crate) fn of_matrix(text: &str) -> Result<Pose, String> {
    let numbers = numbers(text)?;
    match <[f64; 16]>::try_from(numbers) {
        Ok(numbers) => of_numbers(numbers),
        Err(numbers) => Err(format!("{} numbers: 4 rows of 4 would be right", numbers.len())),
    }
}

/// The pose (camera → world) of 12 numbers, the upper 3 rows of 4.
pub(crate) fn of_rows(text: &str) -> Result<Pose, String> {
    let numbers = numbers(text)?;
    match <[f64; 12]>::try_from(numbers) {
        Ok(rows) => {
            let mut numbers = [0.0; 16];
            numbers[..12].copy_from_slice(&rows);
            numbers[15] = 1.0;
            of_numbers(numbers)
        }
        Err(numbers) => Err(format!("{} numbers: 3 rows of 4 would be right", numbers.len())),
    }
}

fn of_numbers(numbers: [f64; 16]) -> Result<Pose, String> {
    let matrix = Matrix4::from_row_iterator(numbers);
    let rotation = matrix.fixed_view::<3, 3>(0, 0).into_owned();
    let off = (rotation.transpose() * rotation - Matrix3::identity()).amax();
    let last = matrix.row(3) - nalgebra::RowVector4::new(0.0, 0.0, 0.0, 1.0);
    if off > ROUNDED || rotation.determinant() < 0.0 || last.amax() > ROUNDED {
        return Err(format!(
            "no pose: columns of its rotation are {off:.3} off length 1 and right angles, its determinant is {:.3}; a rotation beside a \
             position, and 0 0 0 1 below, would be right",
            rotation.determinant()
        ));
    }
    let position = matrix.fixed_view::<3, 1>(0, 3).into_owned();
    // The nearest rotation, looked for from one that is near: of half a turn, some are not found from the identity.
    let near = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    let rotation = UnitQuaternion::from_matrix_eps(&rotation, f64::EPSILON, 0, near);
    Ok(Pose(Isometry3::from_parts(position.into(), rotation)))
}

/// A time (s) and the pose (camera → world) of `tx ty tz qx qy qz qw` behind it.
pub(crate) fn of_line(line: &str) -> Result<(f64, Pose), String> {
    let numbers = numbers(line)?;
    let [time, x, y, z, i, j, k, w] = numbers[..] else {
        return Err(format!("{} numbers: a time, a position and a quaternion, 8, would be right", numbers.len()));
    };
    Ok((time, of_quaternion([x, y, z], [w, i, j, k])?))
}

/// A time (ns, taken to s) and the pose (body → world) of `px, py, pz, qw, qx, qy, qz` behind it, with commas between; what
/// comes then (velocity and biases) is left out. So EuRoC has them.
pub(crate) fn of_row_euroc(line: &str) -> Result<(f64, Pose), String> {
    let numbers = numbers(&line.replace(',', " "))?;
    let [time, x, y, z, w, i, j, k, ..] = numbers[..] else {
        return Err(format!(
            "{} numbers: a time, a position and a quaternion, 8 or more, would be right",
            numbers.len()
        ));
    };
    Ok((time * 1e-9, of_quaternion([x, y, z], [w, i, j, k])?))
}

fn of_quaternion(position: [f64; 3], [w, i, j, k]: [f64; 4]) -> Result<Pose, String> {
    let quaternion = Quaternion::new(w, i, j, k);
    if (quaternion.norm() - 1.0).abs() > ROUNDED {
        return Err(format!("a quaternion of length {:.3}: 1 would be right", quaternion.norm()));
    }
    let position = Translation3::from(Vector3::from(position));
    Ok(Pose(Isometry3::from_parts(position, UnitQuaternion::from_quaternion(quaternion))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_are_read_and_what_is_none_is_said() {
        let pose = of_matrix("0 0 1 1\n 1 0 0 2\n 0 1 0 3\n 0 0 0 1\n").unwrap();
        assert!((pose.forward() - Vector3::x()).norm() < 1e-12 && pose.position().z == 3.0);
        // Regression: of half a turn about y there came none.
        let back = of_matrix("-1 0 0 1  0 1 0 2  0 0 -1 3  0 0 0 1").unwrap();
        assert!((back.forward() + Vector3::z()).norm() < 1e-12, "{back:?}");
        let said = |text: &str| of_matrix(text).unwrap_err();
        assert_eq!(said("1 2 3"), "3 numbers: 4 rows of 4 would be right");
        assert_eq!(said("1 0 0 nan"), "\"nan\" is no finite number");
        for none in
            ["2 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1", "0 1 0 0 1 0 0 0 0 0 1 0 0 0 0 1", "1 0 0 0 0 1 0 0 0 0 1 0 5 0 0 1"]
        {
            assert!(said(none).starts_with("no pose: columns"), "{none}");
        }
        let (time, pose) = of_line("1305031102.1758 1.3 0.6 1.6 0 0 0.7071 0.7071").unwrap();
        assert!(time == 1305031102.1758 && (pose.0.rotation.angle().to_degrees() - 90.0).abs() < 1e-2);
        assert_eq!(of_line("1 0 0 0 0 0 0 0.5").unwrap_err(), "a quaternion of length 0.500: 1 would be right");
        assert!(of_line("1 0 0 0").unwrap_err().starts_with("4 numbers"));
    }
}
