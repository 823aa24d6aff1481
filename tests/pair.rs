//! One pair of a stereo camera, without a mission: what comes of it, and what is said of one that is none.

#[path = "../apps/stereo/examples/rectified.rs"]
#[allow(dead_code)] // The example's own `main`.
mod rectified;

use std::path::{Path, PathBuf};
use std::process::Command;

use elk_stereo::{Image, calibration};
use rectified::CALIBRATION;
use tempfile::TempDir;

/// A folder with a pair of a wall 1.5 m ahead, as two cameras see it whose lenses bend it, and their calibration.
struct Case(TempDir);

impl Case {
    fn new() -> Self {
        let case = Self(tempfile::tempdir().unwrap());
        let [left, right] = rectified::wall(&calibration::opencv(CALIBRATION).unwrap()).unwrap();
        case.picture("left.png", &left);
        case.picture("right.png", &right);
        case.picture("small.png", &Image::from_fn(160, 120, |_, _| 7).unwrap());
        case.picture("black.png", &Image::from_fn(320, 240, |_, _| 0).unwrap());
        case.write("cameras.yaml", CALIBRATION.as_bytes());
        case
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, bytes: &[u8]) {
        std::fs::write(self.path(name), bytes).unwrap();
    }

    fn picture(&self, name: &str, image: &Image) {
        self.encoded(name, image, png::ColorType::Grayscale, png::BitDepth::Eight, image.pixels());
    }

    fn encoded(&self, name: &str, size: &Image, colour: png::ColorType, depth: png::BitDepth, bytes: &[u8]) {
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, size.width() as u32, size.height() as u32);
        encoder.set_color(colour);
        encoder.set_depth(depth);
        encoder.write_header().unwrap().write_image_data(bytes).unwrap();
        self.write(name, &file);
    }

    /// Whether it ended well, and what it said.
    fn elk(&self, arguments: &[&str]) -> (bool, String) {
        let all = [&["sensor", "--type", "Stereo"], arguments].concat();
        let out = Command::new(env!("CARGO_BIN_EXE_elk")).args(all).current_dir(self.0.path()).output().unwrap();
        let said = format!("{}{}", String::from_utf8_lossy(&out.stdout), String::from_utf8_lossy(&out.stderr));
        (out.status.success(), said)
    }

    /// What is said of a pair that is none; nothing is written then.
    fn refused(&self, arguments: &[&str]) -> String {
        let (well, said) = self.elk(arguments);
        assert!(!well && !said.contains("panicked"), "{arguments:?}: {said}");
        assert!(!self.path("out").exists(), "{arguments:?} left something behind");
        said
    }
}

/// The picture's columns, rows, colour, depth and bytes.
fn picture(path: &Path) -> (u32, u32, png::ColorType, png::BitDepth, Vec<u8>) {
    let bytes = std::fs::read(path).unwrap();
    let mut reader = png::Decoder::new(bytes.as_slice()).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size()];
    let info = reader.next_frame(&mut pixels).unwrap();
    (info.width, info.height, info.color_type, info.bit_depth, pixels)
}

#[test]
fn a_pair_is_disparities_points_and_a_picture() {
    let case = Case::new();
    let (well, said) = case.elk(&["left.png", "right.png", "--calibration", "cameras.yaml", "-o", "out"]);
    assert!(well && said.contains("pixels matched"), "{said}");
    let (width, height, colour, depth, pixels) = picture(&case.path("out/disparity.png"));
    assert_eq!((width, height, colour, depth), (320, 240, png::ColorType::Grayscale, png::BitDepth::Sixteen));
    let mut disparities: Vec<f64> = pixels
        .chunks_exact(2)
        .map(|pair| f64::from(u16::from_be_bytes([pair[0], pair[1]])) / 256.0)
        .filter(|&disparity| disparity > 0.0)
        .collect();
    disparities.sort_by(f64::total_cmp);
    assert!(disparities.len() > 320 * 240 / 2, "{}", disparities.len());
    // f b / z
    assert!((disparities[disparities.len() / 2] - 200.0 * 0.12 / 1.5).abs() < 0.3);
    let (width, height, colour, _, _) = picture(&case.path("out/picture.png"));
    assert_eq!((width, height, colour), (644, 240, png::ColorType::Rgb));

    let cloud = std::fs::read(case.path("out/cloud.ply")).unwrap();
    let end = cloud.windows(11).position(|bytes| bytes == b"end_header\n").unwrap() + 11;
    let header = String::from_utf8(cloud[..end].to_vec()).unwrap();
    assert!(header.contains(&format!("element vertex {}\n", disparities.len())), "{header}");
    let vertices: Vec<&[u8]> = cloud[end..].chunks_exact(19).collect();
    assert_eq!((vertices.len(), cloud[end..].len() % 19), (disparities.len(), 0));
    let number = |vertex: &[u8], at: usize| f32::from_le_bytes(vertex[4 * at..4 * at + 4].try_into().unwrap());
    let on_the_wall = vertices.iter().filter(|vertex| (number(vertex, 2) - 1.5).abs() < 0.05).count();
    assert!(on_the_wall * 10 > vertices.len() * 9, "{on_the_wall} of {}", vertices.len());
    // z² / (f b) σ_d
    assert!(
        vertices
            .iter()
            .all(|vertex| (number(vertex, 3) - 0.0234).abs() < 0.02 || (number(vertex, 2) - 1.5).abs() > 0.1)
    );

    // From above, the wall is a line across.
    let (width, height, colour, _, pixels) = picture(&case.path("out/plan.png"));
    assert_eq!((width, height, colour), (480, 480, png::ColorType::Rgb));
    let points: Vec<usize> =
        pixels.chunks_exact(3).enumerate().filter(|(_, rgb)| rgb[0] < 128).map(|(i, _)| i / 480).collect();
    let at = |row: usize| points.iter().filter(|other| other.abs_diff(row) <= 12).count();
    let most = (0..480).map(at).max().unwrap();
    assert!(most > 100 && most * 10 > points.len() * 8, "{most} of {}", points.len());

    let (again, said) = case.elk(&["left.png", "right.png", "--calibration", "cameras.yaml", "-o", "out"]);
    assert!(!again && said.contains("picture.png: it is there already"), "{said}");
    let (well, said) = case.elk(&[
        "left.png",
        "right.png",
        "Matcher=SemiGlobal",
        "Disparities=32",
        "--calibration",
        "cameras.yaml",
        "-o",
        "other",
    ]);
    assert!(well, "{said}");
    let bytes = |folder: &str| std::fs::read(case.path(folder).join("disparity.png")).unwrap();
    assert_ne!(bytes("out"), bytes("other"));
}

#[test]
fn images_that_are_no_pair_are_said_to_be_so_with_their_files() {
    let case = Case::new();
    let wall = Image::from_fn(320, 240, |_, _| 0).unwrap();
    case.encoded("colour.png", &wall, png::ColorType::Rgb, png::BitDepth::Eight, &[9; 320 * 240 * 3]);
    case.encoded("deep.png", &wall, png::ColorType::Grayscale, png::BitDepth::Sixteen, &[9; 320 * 240 * 2]);
    let whole = std::fs::read(case.path("left.png")).unwrap();
    case.write("cut.png", &whole[..whole.len() / 2]);
    for (left, right, words) in [
        ("small.png", "right.png", "small.png is of 160 × 120 pixels and right.png of 320 × 240"),
        ("small.png", "small.png", "cameras.yaml: a left image of [160, 120] pixels: [320, 240]"),
        ("colour.png", "right.png", "colour.png: it is in colour (RGB): grey would be right"),
        ("left.png", "deep.png", "deep.png: it has 16 bits a pixel: 8 would be right"),
        ("cut.png", "right.png", "cut.png: it cannot be read as a PNG"),
        ("cameras.yaml", "right.png", "cameras.yaml: it cannot be read as a PNG"),
        ("none.png", "right.png", "cannot read none.png: No such file"),
        (
            "black.png",
            "black.png",
            "of black.png (grey levels 0 to 0) and black.png (0 to 0) only 0.00 % of all pixels match (too little texture 100.0 %",
        ),
        ("right.png", "left.png", "the other way round in "),
    ] {
        let said = case.refused(&[left, right, "--calibration", "cameras.yaml", "-o", "out"]);
        assert!(said.contains(words), "{left} {right}: {said}");
    }
}

/// Regression: of such pairs one or two in a hundred pixels match by chance, by semi-global matching up to eight, and that was a scan.
#[test]
fn a_pair_of_which_one_image_is_turned_mirrored_or_inverted_is_none() {
    let case = Case::new();
    // A wall of waves looks much the same mirrored; a furnished room does not.
    for name in ["left.png", "right.png", "cameras.yaml"] {
        let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/seeing").join(name);
        case.write(name, &std::fs::read(shipped).unwrap());
    }
    let (.., pixels) = picture(&case.path("right.png"));
    let right = Image::from_fn(320, 240, |row, column| pixels[320 * row + column]).unwrap();
    type Pixel = fn(&Image, usize, usize) -> u8;
    let spoilt: [(&str, Pixel); 4] = [
        ("turned.png", |image, row, column| image.row(239 - row)[319 - column]),
        ("mirrored.png", |image, row, column| image.row(row)[319 - column]),
        ("upside-down.png", |image, row, column| image.row(239 - row)[column]),
        ("inverted.png", |image, row, column| 255 - image.row(row)[column]),
    ];
    for (name, pixel) in spoilt {
        case.picture(name, &Image::from_fn(320, 240, |row, column| pixel(&right, row, column)).unwrap());
        for matcher in ["Matcher=SAD5", "Matcher=SemiGlobal"] {
            let said = case.refused(&["left.png", name, matcher, "--calibration", "cameras.yaml", "-o", "out"]);
            let words = [
                &format!("of left.png and {name} only ")[..],
                "% of those that have a texture",
                "not turned, mirrored",
            ];
            assert!(words.iter().all(|words| said.contains(words)), "{matcher}: {said}");
        }
    }
    // A black image beside one that shows something is said by its grey levels.
    let said = case.refused(&["left.png", "black.png", "--calibration", "cameras.yaml", "-o", "out"]);
    assert!(said.contains(" and black.png (0 to 0) only 0.00 % of all pixels match"), "{said}");
}

#[test]
fn calibrations_that_are_none_are_said_to_be_so_with_their_files() {
    let case = Case::new();
    let with = |from: &str, to: &str| {
        assert!(CALIBRATION.contains(from));
        case.write("other.yaml", CALIBRATION.replace(from, to).as_bytes());
        case.refused(&["left.png", "right.png", "--calibration", "other.yaml", "-o", "out"])
    };
    for (from, to, words) in [
        ("T: !!opencv-matrix", "U: !!opencv-matrix", "other.yaml: there is no T"),
        ("data: [ 200., 0., 158., 0., 200.", "data: [ 0., 0., 158., 0., 200.", "without which the camera is singular"),
        ("[ -0.12, 0., 0. ]", "[ 0., 0., 0. ]", "other.yaml: a baseline of 0 m"),
        ("[ -0.12, 0., 0. ]", "[ 0.12, 0., 0. ]", "are the cameras swapped?"),
        ("[ -0.12, 0., 0. ]", "[ -120., 0., 0. ]", "a baseline of 120 m: the right camera"),
        ("data: [ 200., 0., 158.,", "data: [ 200., 0., 9000.,", "lens shows no ray in the middle of its image"),
        ("[ 1., 0., 0., 0., 1., 0., 0., 0., 1. ]", "[ 1., 0., 0., 0., 1., 0., 0., 0., 2. ]", "other.yaml: line "),
    ] {
        let said = with(from, to);
        assert!(said.contains(words), "{to}: {said}");
    }
    let one = "T_BS:\n  data: [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]\nresolution: [320, 240]\nintrinsics: [200, 200, 160, 120]\n\
               distortion_coefficients: [0, 0, 0, 0]\n";
    case.write("one.yaml", one.as_bytes());
    let said = case.refused(&["left.png", "right.png", "--calibration", "one.yaml", "-o", "out"]);
    assert!(said.contains("one.yaml: it is of one of EuRoC's cameras, of which two are given"), "{said}");
    let said = case.refused(&["left.png", "right.png", "-o", "out"]);
    assert!(said.contains("no calibrations; right is --calibration CAMERAS.yaml"), "{said}");
    let thrice = ["--calibration", "cameras.yaml"].repeat(3);
    let said = case.refused(&[&["left.png", "right.png", "-o", "out"], &thrice[..]].concat());
    assert!(said.contains("3 calibrations; right is --calibration CAMERAS.yaml"), "{said}");
    let said = case.refused(&["left.png", "right.png", "more.png", "--calibration", "cameras.yaml", "-o", "out"]);
    assert!(said.contains("\"more.png\" is no parameter: right is Param=Value"), "{said}");
    let said = case.refused(&["left.png", "right.png", "--calibration", "none.yaml", "-o", "out"]);
    assert!(said.contains("cannot read none.yaml: No such file"), "{said}");
    let said = case.refused(&["left.png", "--calibration", "cameras.yaml", "-o", "out"]);
    assert!(said.contains("a pair is two images"), "{said}");
    let said = case.refused(&["left.png", "right.png", "--calibration", "cameras.yaml"]);
    assert!(said.contains("right is -o FOLDER"), "{said}");
    let said = case.refused(&["left.png", "right.png", "Disparities=20", "--calibration", "cameras.yaml", "-o", "out"]);
    assert!(said.contains("a multiple of 16"), "{said}");
    let out = Command::new(env!("CARGO_BIN_EXE_elk"))
        .args(["sensor", "--type", "Simulator", "--calibration", "cameras.yaml"])
        .output()
        .unwrap();
    assert!(String::from_utf8_lossy(&out.stderr).contains("right is --type Stereo"));
}
