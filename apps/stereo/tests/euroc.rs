//! Recorded pairs of a camera whose lenses bend and whose axes are not parallel; skipped where the recorded data (`ELK_DATA`) are not
//! there.

#[path = "../../../tests/common/data.rs"]
mod data;
mod picture;
#[path = "../../../tests/common/skip.rs"]
mod skip;

use nalgebra::{Matrix2, Vector2};

use elk_stereo::{Image, Matcher, Rectification, SemiGlobal, SemiGlobalConfig, calibration};

/// An image between its pixels, bilinearly.
fn at(image: &Image, row: f64, column: f64) -> f64 {
    let (y, x) = (row as usize, column as usize);
    let (dy, dx) = (row.fract(), column.fract());
    let along = |y: usize| f64::from(image.row(y)[x]) * (1.0 - dx) + f64::from(image.row(y)[x + 1]) * dx;
    along(y) * (1.0 - dy) + along(y + 1) * dy
}

/// By how many rows the match of a corner lies off its row: the shift of a window of 15 × 15 pixels at which it is most alike in the right
/// image, found from the disparity on (Lucas and Kanade, IJCAI 1981). None where there is no corner, or no match to be found so.
fn rows_off(left: &Image, right: &Image, row: usize, column: usize, disparity: f64) -> Option<f64> {
    let pixels =
        || (-7..=7).flat_map(|dy| (-7..=7).map(move |dx| (row as f64 + f64::from(dy), column as f64 + f64::from(dx))));
    let slope = |y: f64, x: f64| {
        Vector2::new(at(left, y, x + 1.0) - at(left, y, x - 1.0), at(left, y + 1.0, x) - at(left, y - 1.0, x)) / 2.0
    };
    let tensor: Matrix2<f64> = pixels().map(|(y, x)| slope(y, x)).map(|slope| slope * slope.transpose()).sum();
    let is_corner = tensor.symmetric_eigenvalues().min() > 225.0 * 30.0;
    let inverse = tensor.try_inverse().filter(|_| is_corner && column as f64 > disparity + 12.0)?;
    // Exposures differ: the means of both windows are taken off.
    let mean = |image: &Image, shift: Vector2<f64>| {
        pixels().map(|(y, x)| at(image, y + shift.y, x + shift.x)).sum::<f64>() / 225.0
    };
    let base = mean(left, Vector2::zeros());
    let mut shift = Vector2::new(-disparity, 0.0);
    for _ in 0..10 {
        let brighter = mean(right, shift) - base;
        let apart = |y: f64, x: f64| at(left, y, x) - (at(right, y + shift.y, x + shift.x) - brighter);
        let step = inverse * pixels().map(|(y, x)| slope(y, x) * apart(y, x)).sum::<Vector2<f64>>();
        shift += step;
        if (shift - Vector2::new(-disparity, 0.0)).norm() > 2.0 {
            return None;
        }
        if step.norm() < 0.01 {
            return Some(shift.y);
        }
    }
    None
}

#[test]
fn rectified_pairs_of_a_recording_match_row_by_row() {
    let data = data::folder().join("stereo_euroc");
    if !data.is_dir() {
        let test = "rectified_pairs_of_a_recording_match_row_by_row";
        return skip::skip(test, "data", &format!("there is no {} (set ELK_DATA)", data.display()));
    }
    let [left, right] = ["cam0.yaml", "cam1.yaml"].map(|name| std::fs::read_to_string(data.join(name)).unwrap());
    let rectification = Rectification::new(&calibration::euroc(&left, &right).unwrap()).unwrap();
    assert!((rectification.rig().baseline() - 0.11).abs() < 0.001, "{:?}", rectification.rig());
    let mut names: Vec<_> =
        std::fs::read_dir(data.join("cam0")).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    names.sort();
    let mut matcher = SemiGlobal::new(SemiGlobalConfig::default()).unwrap();
    let mut off = Vec::new();
    for name in names.iter().step_by(16) {
        let [left, right] = ["cam0", "cam1"].map(|camera| picture::read(&data.join(camera).join(name)));
        let [left, right] = rectification.rectify(&left, &right).unwrap();
        let disparity = matcher.disparity(&left, &right).unwrap();
        assert!(disparity.density() > 0.5, "{name:?}: {}", disparity.density());
        for row in (16..left.height() - 16).step_by(8) {
            for column in (16..left.width() - 16).step_by(8) {
                let matched = disparity.get(row, column).ok();
                off.extend(matched.and_then(|d| rows_off(&left, &right, row, column, d.into())));
            }
        }
    }
    let mean = off.iter().map(|off| off.abs()).sum::<f64>() / off.len() as f64;
    let bias = off.iter().sum::<f64>() / off.len() as f64;
    println!(
        "{} corners of {} pairs: {mean:.3} rows off in the mean, {bias:.3} to one side",
        off.len(),
        names.len().div_ceil(16)
    );
    assert!(off.len() > 500 && mean <= 0.3, "{} corners, {mean} rows off in the mean", off.len());
}
