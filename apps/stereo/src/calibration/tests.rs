use super::*;

const LEFT: &str = "%YAML:1.0
# A camera.
sensor_type: camera
comment: a camera: of a kind
T_BS:
  cols: 4
  rows: 4
  data: [0.0, -1.0, 0.0, -0.02,
         1.0, 0.0, 0.0, -0.06,   # a comment
         0.0, 0.0, 1.0, 0.01,
         0.0, 0.0, 0.0, 1.0]
rate_hz: 20
resolution: [752, 480]
camera_model: pinhole
intrinsics: [458.654, 457.296, 367.215, 248.375] #fu, fv, cu, cv
distortion_model: radial-tangential
distortion_coefficients: [-0.28, 0.07, 0.0002, 1.7e-05]
";

fn right() -> String {
    LEFT.replace("-0.06", "0.05")
}

const OPENCV: &str = r#"%YAML:1.0
---
image_width: 640
image_height: 480
M1: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 500., 0., 320., 0., 501., 240., 0., 0., 1. ]
D1: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ -0.3, 0.1, 0.001, 0.002, 0.01 ]
M2: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 510., 0., 330., 0., 511., 250., 0., 0., 1. ]
D2: !!opencv-matrix
   rows: 1
   cols: 4
   dt: d
   data: [ -0.3, 0.1, 0.001, 0.002 ]
R: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 1., 0., 0., 0., 1., 0., 0., 0., 1. ]
T: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ -1.2000000000000000e-01, 0., 0. ]
"#;

#[test]
fn the_cameras_of_euroc_are_read() {
    let calibration = euroc(LEFT, &right()).unwrap();
    let left = calibration.left;
    assert_eq!((left.size, left.focal, left.center), ([752, 480], [458.654, 457.296], [367.215, 248.375]));
    assert_eq!(left.distortion, Distortion { radial: [-0.28, 0.07, 0.0], tangential: [0.0002, 1.7e-05] });
    // The body's y is the camera's x.
    assert!((calibration.right_center().coords - Vector3::new(0.11, 0.0, 0.0)).norm() < 1e-12);
}

#[test]
fn the_cameras_of_opencv_are_read() {
    let calibration = opencv(OPENCV).unwrap();
    assert_eq!((calibration.left.focal, calibration.left.center), ([500.0, 501.0], [320.0, 240.0]));
    assert_eq!(calibration.left.distortion, Distortion { radial: [-0.3, 0.1, 0.01], tangential: [0.001, 0.002] });
    assert_eq!((calibration.right.focal, calibration.right.size), ([510.0, 511.0], [640, 480]));
    assert!((calibration.right_center().coords - Vector3::new(0.12, 0.0, 0.0)).norm() < 1e-12);
}

/// Regression: of half a turn about y there came none.
#[test]
fn a_camera_that_is_turned_half_about_an_axis_is() {
    for (axis, turn) in [[1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]].into_iter().enumerate() {
        let [x, y, z] = turn;
        let text = LEFT.replace("0.0, -1.0, 0.0, -0.02", &format!("{x}, 0.0, 0.0, -0.02"));
        let text = text.replace("1.0, 0.0, 0.0, -0.06", &format!("0.0, {y}, 0.0, -0.06"));
        let text = text.replace("0.0, 0.0, 1.0, 0.01", &format!("0.0, 0.0, {z}, 0.01"));
        let turned = euroc_body_from_camera(&text).unwrap().rotation;
        assert!((turned * Vector3::new(1.0, 2.0, 3.0) - Vector3::new(x, 2.0 * y, 3.0 * z)).norm() < 1e-12, "{axis}");
    }
}

#[test]
fn what_is_wrong_is_said_with_its_line() {
    let of_euroc = |from: &str, to: &str| euroc(&LEFT.replace(from, to), &right()).unwrap_err().to_string();
    let singular = of_euroc("458.654", "0.0");
    assert!(singular.starts_with("line 15: intrinsics is [0.0, 457.296"), "{singular}");
    assert!(
        singular.ends_with("positive focal lengths, without which the camera is singular would be right"),
        "{singular}"
    );
    assert_eq!(
        of_euroc("radial-tangential", "equidistant"),
        "line 16: distortion_model is equidistant: radial-tangential would be right"
    );
    assert!(of_euroc("1.0, 0.0, 0.0, -0.06", "2.0, 0.0, 0.0, -0.06").contains("line 5: T_BS is [0.0, -1.0"));
    assert!(of_euroc("1.0, 0.0, 0.0, -0.06", "1.0, nan, 0.0, -0.06").contains("a 4 × 4 matrix"));
    assert!(of_euroc("0.0, 0.0, 0.0, 1.0]", "0.0, 0.0, 0.5, 1.0]").ends_with("and 0, 0, 0, 1 below would be right"));
    assert!(of_euroc("resolution", "size").starts_with("there is no resolution: two whole numbers"));
    assert!(of_euroc("752", "0").contains("columns and rows of 1 to 16384"));
    assert!(of_euroc("0.0, 0.0, 0.0, 1.0]", "").contains("line 8: the list that begins here does not end"));
    assert_eq!(of_euroc("rate_hz: 20", "rate 20"), "line 12: \"rate 20\" is no entry: `name: value` would be right");

    let of_opencv = |from: &str, to: &str| opencv(&OPENCV.replace(from, to)).unwrap_err().to_string();
    assert!(of_opencv("500., 0., 320.", "500., 3., 320.").contains("without skew"));
    assert!(of_opencv("T:", "U:").starts_with("there is no T"));
    assert!(of_opencv("0.002 ]", "0.002, 0., 7. ]").contains("D2 is"));
}

/// Regression: of a name that stood there twice the first counted, of a matrix with two `data` the last.
#[test]
fn what_stands_there_twice_is_said_with_both_lines() {
    let twice = format!("{LEFT}resolution: [640, 480]\n");
    assert_eq!(
        euroc(&twice, &right()).unwrap_err().to_string(),
        "line 18: resolution stands there again, after line 13: one of them would be right"
    );
    let twice = format!("{LEFT}camera_model: pinhole\n");
    assert!(euroc(LEFT, &twice).unwrap_err().to_string().starts_with("line 18: camera_model stands there again"));
    let twice = format!("{OPENCV}   data: [ -0.2, 0., 0. ]\n");
    assert_eq!(
        opencv(&twice).unwrap_err().to_string(),
        "line 35: data of T stands there again, after line 34: one of them would be right"
    );
    // What is of no camera may be what it likes.
    let others = format!("- note: one\n- note: two\n{OPENCV}F:\n  data: [1]\n  data: [2]\n");
    assert_eq!(opencv(&others), opencv(OPENCV));
}

#[test]
fn a_text_cut_off_anywhere_is_an_error_or_a_calibration_and_no_panic() {
    for text in [LEFT, OPENCV] {
        for end in 0..text.len() {
            let _ = euroc(&text[..end], text);
            let _ = opencv(&text[..end]);
        }
    }
}
