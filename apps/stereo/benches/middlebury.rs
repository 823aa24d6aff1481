//! Bad pixels and time of the matchers on the four pairs of Middlebury's second evaluation, beside OpenCV's in the same run.
//!
//! `ELK_DATA=… cargo bench -p elk-stereo --bench middlebury`; OpenCV where the Python that `ELK_PYTHON`
//! names (`python3`) has it (`pip install opencv-python-headless`). A pixel is bad
//! whose disparity is off by more than 1; what has none is filled with the smaller one of its neighbours in the row, for all
//! matchers alike (Scharstein and Szeliski 2002). Times are CPU times of the whole way from two grey images to disparities, the least of
//! `ELK_TURNS` (15), on one thread.

#[path = "../../../tests/common/data.rs"]
mod data;
#[path = "../tests/picture/mod.rs"]
mod picture;
#[path = "../../../tests/common/stopwatch.rs"]
mod stopwatch;

use std::path::Path;
use std::process::Command;

use elk_stereo::{Checks, Image, Matcher, Preprocessing, Sad5, Sad5Config, SemiGlobal, SemiGlobalConfig};

/// One of the pairs: its files, grey levels a pixel of disparity in its truth, and how far is searched.
struct Named {
    name: &'static str,
    files: [&'static str; 3],
    scale: f32,
    levels: usize,
}

const PAIRS: [Named; 4] = [
    Named { name: "Tsukuba", files: ["img_left.png", "img_right.png", "disp_gt.pgm"], scale: 16.0, levels: 16 },
    Named { name: "Venus", files: ["img_left.png", "img_right.png", "disp_gt.png"], scale: 8.0, levels: 32 },
    Named { name: "Teddy", files: ["im2.png", "im6.png", "disp2.png"], scale: 4.0, levels: 64 },
    Named { name: "Cones", files: ["im2.png", "im6.png", "disp2.png"], scale: 4.0, levels: 64 },
];

/// What is evaluated of a pair.
struct Pair {
    name: &'static str,
    levels: usize,
    images: [Image; 2],
    truth: Vec<f32>,
    /// Pixels that both cameras see; all with a truth; those near a jump of disparity.
    masks: [Vec<bool>; 3],
}

/// A matcher's row: per cent of bad pixels (nonocc, all, disc), density and per cent of bad ones before filling (nonocc), ms.
type Row = [f64; 6];

fn load(folder: &Path, named: &Named) -> Pair {
    let file = |name: &str| picture::read(&folder.join(named.name).join(name));
    let mask = |kind: &str| file(&format!("mask_{kind}_derived.png")).pixels().iter().map(|&grey| grey > 0).collect();
    Pair {
        name: named.name,
        levels: named.levels,
        images: [file(named.files[0]), file(named.files[1])],
        truth: file(named.files[2]).pixels().iter().map(|&grey| f32::from(grey) / named.scale).collect(),
        masks: ["nonocc", "all", "disc"].map(mask),
    }
}

/// Disparities, with the smaller neighbour of the row where there is none.
fn filled(width: usize, disparity: &[Option<f32>]) -> Vec<f32> {
    let fill = |row: &[Option<f32>]| {
        let mut known: Vec<f32> = vec![f32::MAX; row.len()];
        let mut sweep = |columns: &mut dyn Iterator<Item = usize>| {
            let mut last = f32::MAX;
            for x in columns {
                last = row[x].unwrap_or(last);
                known[x] = known[x].min(last);
            }
        };
        sweep(&mut (0..row.len()));
        sweep(&mut (0..row.len()).rev());
        row.iter().zip(known).map(|(&value, known)| value.unwrap_or(known)).collect::<Vec<_>>()
    };
    disparity.chunks_exact(width).flat_map(fill).collect()
}

fn evaluate(pair: &Pair, disparity: &[Option<f32>], ms: f64) -> Row {
    let filled = filled(pair.images[0].width(), disparity);
    let share = |part: usize, of: usize| 100.0 * part as f64 / of.max(1) as f64;
    let is_bad = |i: usize, value: f32| (value - pair.truth[i]).abs() > 1.0;
    let of = |mask: &[bool]| {
        let pixels: Vec<usize> = (0..mask.len()).filter(|&i| mask[i]).collect();
        share(pixels.iter().filter(|&&i| is_bad(i, filled[i])).count(), pixels.len())
    };
    let seen: Vec<usize> = (0..disparity.len()).filter(|&i| pair.masks[0][i]).collect();
    let matched: Vec<(usize, f32)> = seen.iter().filter_map(|&i| Some((i, disparity[i]?))).collect();
    let bad = matched.iter().filter(|&&(i, value)| is_bad(i, value)).count();
    let [nonocc, all, disc] = [0, 1, 2].map(|kind| of(&pair.masks[kind]));
    [nonocc, all, disc, share(matched.len(), seen.len()), share(bad, matched.len()), ms]
}

/// The rows of one of our matchers, pair by pair.
fn ours(pairs: &[Pair], turns: usize, matcher: impl Fn(usize) -> Box<dyn Matcher>) -> Vec<Row> {
    let row = |pair: &Pair| {
        let mut matcher = matcher(pair.levels);
        let [left, right] = &pair.images;
        let (least, disparity) = stopwatch::least(turns, || matcher.disparity(left, right).unwrap());
        let found: Vec<_> = disparity.iter().map(Result::ok).collect();
        evaluate(pair, &found, least)
    };
    pairs.iter().map(row).collect()
}

/// The rows of OpenCV's matchers; nothing where it is not there.
fn opencv(pairs: &[Pair], turns: usize) -> Option<Vec<(String, Vec<Row>)>> {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: String| folder.path().join(name);
    let line =
        |pair: &Pair| format!("{} {} {} {}\n", pair.name, pair.images[0].width(), pair.images[0].height(), pair.levels);
    std::fs::write(at("pairs.txt".into()), pairs.iter().map(line).collect::<String>()).unwrap();
    for pair in pairs {
        for (side, image) in ["left", "right"].iter().zip(&pair.images) {
            std::fs::write(at(format!("{}.{side}", pair.name)), image.pixels()).unwrap();
        }
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/opencv.py");
    let python = std::env::var("ELK_PYTHON").unwrap_or_else(|_| "python3".into());
    let output = Command::new(python).arg(script).arg(folder.path()).arg(turns.to_string()).output().ok()?;
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    if !output.status.success() {
        return None;
    }
    let mut rows: Vec<(String, Vec<Row>)> = Vec::new();
    for line in said.lines() {
        let words: Vec<&str> = line.split(' ').collect();
        let Some(pair) = pairs.iter().find(|pair| pair.name == words[0]) else {
            println!("OpenCV {}", words[1]);
            continue;
        };
        let bytes = std::fs::read(at(format!("{}.{}.disparity", pair.name, words[1]))).unwrap();
        let sixteenths = bytes.as_chunks::<2>().0.iter().map(|&bytes| i16::from_le_bytes(bytes));
        let disparity: Vec<_> = sixteenths.map(|value| (value >= 0).then_some(f32::from(value) / 16.0)).collect();
        let row = evaluate(pair, &disparity, words[2].parse().unwrap());
        match rows.iter_mut().find(|(name, _)| name == words[1]) {
            Some((_, rows)) => rows.push(row),
            None => rows.push((words[1].to_owned(), vec![row])),
        }
    }
    Some(rows)
}

fn show(name: &str, pairs: &[Pair], rows: &[Row]) {
    let line = |of: &str, row: &Row| {
        let [nonocc, all, disc, density, bad, ms] = row;
        println!("| {name} | {of} | {nonocc:.2} | {all:.2} | {disc:.2} | {density:.1} | {bad:.2} | {ms:.1} |");
    };
    pairs.iter().zip(rows).for_each(|(pair, row)| line(pair.name, row));
    let mean: Row = std::array::from_fn(|i| rows.iter().map(|row| row[i]).sum::<f64>() / rows.len() as f64);
    line("**mean**", &mean);
}

fn sad5(preprocessing: Preprocessing, uniqueness: u16) -> impl Fn(usize) -> Box<dyn Matcher> {
    move |levels| {
        let checks = Checks { levels, uniqueness, ..Sad5Config::default().checks };
        Box::new(Sad5::new(Sad5Config { preprocessing, checks, ..Sad5Config::default() }).unwrap())
    }
}

fn semi_global(levels: usize) -> Box<dyn Matcher> {
    let config = SemiGlobalConfig::default();
    let checks = Checks { levels, ..config.checks };
    Box::new(SemiGlobal::new(SemiGlobalConfig { checks, ..config }).unwrap())
}

fn main() {
    let data = data::folder().join("middlebury");
    let turns = std::env::var("ELK_TURNS").ok().and_then(|turns| turns.parse().ok()).unwrap_or(15);
    if !data.is_dir() {
        println!("middlebury: skipped, there is no {} (set ELK_DATA)", data.display());
        return;
    }
    let pairs: Vec<Pair> = PAIRS.iter().map(|named| load(&data, named)).collect();
    println!("| matcher | pair | bad, nonocc % | all % | disc % | density % | bad of valid % | ms |");
    println!("|---|---|---|---|---|---|---|---|");
    let uniqueness = Checks::default().uniqueness;
    show("SAD5", &pairs, &ours(&pairs, turns, sad5(Preprocessing::default(), uniqueness)));
    show("SAD5, uniqueness 42", &pairs, &ours(&pairs, turns, sad5(Preprocessing::default(), 42)));
    show("SAD5, no filter", &pairs, &ours(&pairs, turns, sad5(Preprocessing::None, uniqueness)));
    show("SAD5, DoG", &pairs, &ours(&pairs, turns, sad5(Preprocessing::DIFFERENCE_OF_GAUSSIANS, uniqueness)));
    show("SAD5, bilateral", &pairs, &ours(&pairs, 1, sad5(Preprocessing::BILATERAL, uniqueness)));
    show("semi-global", &pairs, &ours(&pairs, turns, semi_global));
    match opencv(&pairs, turns) {
        Some(rows) => rows.iter().for_each(|(name, rows)| show(&format!("OpenCV {name}"), &pairs, rows)),
        None => println!(
            "OpenCV: skipped, no Python has it (pip install opencv-python-headless; ELK_PYTHON names the Python)"
        ),
    }
}
