//! Both matchers on scenes whose distances are known.

#[path = "scenes/mod.rs"]
mod scenes;

use elk_stereo::{
    Checks, Disparity, Image, MatchError, Matcher, Preprocessing, Sad5, Sad5Config, SemiGlobal, SemiGlobalConfig,
    Unmatched,
};
use scenes::{HEIGHT, Scene, WIDTH, ball, pair, rig, slanted_wall, truth, wall};

/// Both matchers, which look for disparities of 0 to 15.
fn matchers() -> [(&'static str, Box<dyn Matcher>); 2] {
    let (sad5, semi_global) = (Sad5Config::default(), SemiGlobalConfig::default());
    let few = |checks: Checks| Checks { levels: 16, ..checks };
    let sad5 = Sad5::new(Sad5Config { checks: few(sad5.checks.clone()), ..sad5 }).unwrap();
    let checks = few(semi_global.checks.clone());
    let semi_global = SemiGlobal::new(SemiGlobalConfig { checks, ..semi_global }).unwrap();
    [("SAD5", Box::new(sad5)), ("semi-global", Box::new(semi_global))]
}

/// The share of pixels that have a disparity, of those on the right of column 16; and the errors of those, in ascending order.
fn errors(disparity: &Disparity, scene: Scene) -> (f64, Vec<f64>) {
    let pixels = (0..HEIGHT).flat_map(|row| (16..WIDTH).map(move |column| (row, column)));
    let error = |(row, column)| Some((f64::from(disparity.get(row, column).ok()?) - truth(scene, row, column)).abs());
    let mut errors: Vec<f64> = pixels.filter_map(error).collect();
    errors.sort_by(f64::total_cmp);
    (errors.len() as f64 / (HEIGHT * (WIDTH - 16)) as f64, errors)
}

fn quantile(sorted: &[f64], part: f64) -> f64 {
    sorted[(part * (sorted.len() - 1) as f64) as usize]
}

#[test]
fn walls_are_where_they_are() {
    for scene in [wall as Scene, slanted_wall] {
        let [left, right] = pair(scene);
        for (name, mut matcher) in matchers() {
            let (density, errors) = errors(&matcher.disparity(&left, &right).unwrap(), scene);
            let [median, most] = [0.5, 0.99].map(|part| quantile(&errors, part));
            assert!(density > 0.97, "{name}: {density}");
            assert!(median < 0.12 && most < 0.5, "{name}: {median}, {most}");
        }
    }
}

#[test]
fn a_ball_stands_out_and_what_it_hides_is_not_guessed() {
    let [left, right] = pair(ball);
    for (name, mut matcher) in matchers() {
        let disparity = matcher.disparity(&left, &right).unwrap();
        let (density, errors) = errors(&disparity, ball);
        let [median, most] = [0.5, 0.95].map(|part| quantile(&errors, part));
        assert!(density > 0.9, "{name}: {density}");
        assert!(median < 0.15 && most < 1.0, "{name}: {median}, {most}");
        assert!(disparity.count(Unmatched::Inconsistent) > 30, "{name}: the wall on the left of the ball is hidden");
        let cloud = rig();
        let nearest = cloud.cloud(&disparity).map(|(_, _, point)| point.z).fold(f64::MAX, f64::min);
        assert!((nearest - 1.5).abs() < 0.1, "{name}: {nearest}");
    }
}

#[test]
fn every_filter_matches_a_wall() {
    let [left, right] = pair(slanted_wall);
    let filters = [
        Preprocessing::None,
        Preprocessing::default(),
        Preprocessing::DIFFERENCE_OF_GAUSSIANS,
        Preprocessing::BILATERAL,
    ];
    for preprocessing in filters {
        for radius in 1..=Sad5::MAX_RADIUS {
            let checks = Checks { levels: 16, ..Checks::default() };
            let mut sad5 = Sad5::new(Sad5Config { preprocessing, radius, checks }).unwrap();
            let (density, errors) = errors(&sad5.disparity(&left, &right).unwrap(), slanted_wall);
            assert!(density > 0.7, "{preprocessing:?}, radius {radius}: {density}");
            assert!(quantile(&errors, 0.95) < 1.0, "{preprocessing:?}, radius {radius}");
        }
    }
}

#[test]
fn a_black_pair_has_no_texture() {
    let black = Image::from_fn(WIDTH, HEIGHT, |_, _| 0).unwrap();
    for (name, mut matcher) in matchers() {
        let disparity = matcher.disparity(&black, &black).unwrap();
        assert_eq!(disparity.count(Unmatched::Textureless), WIDTH * HEIGHT, "{name}");
    }
}

#[test]
fn a_blank_patch_is_said_to_be_blank() {
    let blank = |image: &Image| {
        let inside = |row: usize, column: usize| (30..90).contains(&row) && (80..150).contains(&column);
        Image::from_fn(WIDTH, HEIGHT, |row, column| if inside(row, column) { 30 } else { image.row(row)[column] })
            .unwrap()
    };
    let [left, right] = pair(wall).map(|image| blank(&image));
    for (name, mut matcher) in matchers() {
        let disparity = matcher.disparity(&left, &right).unwrap();
        for (row, column) in [(60, 100), (50, 120), (70, 110)] {
            assert_eq!(disparity.get(row, column), Err(Unmatched::Textureless), "{name}: row {row}, column {column}");
        }
        assert!(disparity.get(15, 100).is_ok(), "{name}");
    }
}

#[test]
fn cameras_that_are_swapped_match_little() {
    let [left, right] = pair(slanted_wall);
    let densities = matchers().map(|(name, mut matcher)| (name, matcher.disparity(&right, &left).unwrap().density()));
    assert!(
        densities.iter().all(|&(_, density)| density < 0.3),
        "{densities:?}; the right way round it is more than 0.97"
    );
}

#[test]
fn images_of_different_size_are_refused() {
    let [a, b] = [(40, 30), (40, 31)].map(|(width, height)| Image::from_fn(width, height, |_, _| 0).unwrap());
    for (_, mut matcher) in matchers() {
        assert_eq!(matcher.disparity(&a, &b), Err(MatchError::Sizes { left: (40, 30), right: (40, 31) }));
    }
}

#[test]
fn images_of_few_pixels_are_matched_as_far_as_that_goes() {
    for (name, mut matcher) in matchers() {
        for (width, height) in [(1, 1), (1, 20), (20, 1), (2, 2), (3, 5), (17, 9), (64, 2)] {
            let image = Image::from_fn(width, height, |row, column| (row * 31 + column * 57) as u8).unwrap();
            let disparity = matcher.disparity(&image, &image).unwrap();
            assert_eq!((disparity.width(), disparity.height()), (width, height), "{name}");
        }
    }
}

#[test]
fn what_was_matched_before_does_not_matter() {
    let pairs = [pair(wall), pair(ball)];
    for (name, mut used) in matchers() {
        let fresh =
            matchers().into_iter().find(|(other, _)| *other == name).unwrap().1.disparity(&pairs[1][0], &pairs[1][1]);
        used.disparity(&pairs[0][0], &pairs[0][1]).unwrap();
        let small = Image::from_fn(50, 40, |row, column| (row * 7 + column * column) as u8).unwrap();
        used.disparity(&small, &small).unwrap();
        assert_eq!(used.disparity(&pairs[1][0], &pairs[1][1]), fresh, "{name}");
    }
}
