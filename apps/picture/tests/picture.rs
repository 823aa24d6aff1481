//! A run of a made-up world, recorded and drawn.

use std::path::Path;

use elk_bus::{Key, Payload, TypeRef, Value, codec};
use elk_geometry::{OccupancyGrid, Pose, State, Voxel};
use elk_log::{LogWriter, Metadata, Record};
use elk_picture::{PictureError, draw_run};
use elk_spatial::map::MapUpdate;
use elk_spatial::messages::{ExplorationReport, FrontiersLeft, PoseCommand, Progress};
use elk_spatial::{Points, Scan, keys};
use nalgebra::{Point3, Vector3};

const RESOLUTION: f64 = 0.1;

/// A flat with three rooms, doors, a table, a shelf and a bed: 8 × 6 × 2.4 m (or 6 × 8 if `turned`).
fn is_solid(p: Point3<f64>) -> bool {
    let inside = |x: [f64; 2], y: [f64; 2], z: [f64; 2]| {
        (x[0]..x[1]).contains(&p.x) && (y[0]..y[1]).contains(&p.y) && (z[0]..z[1]).contains(&p.z)
    };
    let room = inside([0.1, 7.9], [0.1, 5.9], [0.1, 2.3]);
    let wall_across = inside([0.0, 8.0], [3.0, 3.1], [0.0, 2.4]);
    let doors = inside([1.2, 2.2], [2.9, 3.2], [0.0, 2.0]) || inside([6.0, 6.9], [2.9, 3.2], [0.0, 2.0]);
    let wall_along = inside([4.5, 4.6], [3.0, 6.0], [0.0, 2.4]) && !inside([4.4, 4.7], [4.2, 5.1], [0.0, 2.0]);
    let table = inside([3.4, 5.0], [0.9, 1.9], [0.7, 0.8]);
    let shelf = inside([0.1, 0.5], [0.4, 2.4], [0.0, 1.9]);
    let bed = inside([5.6, 7.4], [4.6, 5.9], [0.0, 0.6]);
    let sofa = inside([0.6, 2.6], [5.2, 5.9], [0.0, 0.8]) || inside([0.6, 2.6], [5.6, 5.9], [0.0, 1.1]);
    !room || (wall_across && !doors) || wall_along || table || shelf || bed || sofa
}

/// The flat as it is known after an exploration that left a corner out.
fn explored(stretch: f64) -> OccupancyGrid {
    let mut grid = OccupancyGrid::new(RESOLUTION);
    let flat = |v: Voxel| {
        let p = v.center(RESOLUTION);
        Point3::new(p.x / stretch, p.y, p.z)
    };
    let solid = |v: Voxel| is_solid(flat(v));
    let hidden = |v: Voxel| flat(v).x > 7.2 && flat(v).y < 0.9;
    for (x, y, z) in
        (0..(80.0 * stretch) as i32).flat_map(|x| (0..60).flat_map(move |y| (0..24).map(move |z| (x, y, z))))
    {
        let voxel = Voxel::new(x, y, z);
        let state = match (hidden(voxel), solid(voxel)) {
            (true, _) => continue,
            (_, false) => State::Free,
            (_, true) if voxel.neighbours().any(|n| !solid(n)) => State::Occupied,
            _ => continue,
        };
        grid.set(voxel, state);
    }
    grid
}

fn record<T: Payload>(key: &Key<T>, value: &T::View<'_>, at: u64) -> Record {
    let mut bytes = Vec::new();
    codec::encode_onto(value, &mut bytes).unwrap();
    Record {
        key: key.name().into(),
        source: "app".into(),
        source_aux: String::new(),
        community: "elk".into(),
        time: at as f64,
        sequence: at,
        received: at as f64,
        order: at,
        epoch: 1,
        value: Value::Binary { type_: TypeRef::of::<T>().to_type(), bytes },
    }
}

/// Poses every 0.4 m along corners, looking along the way and a little to the sides.
fn poses(corners: &[[f64; 2]], stretch: f64) -> Vec<Pose> {
    let mut poses = Vec::new();
    for leg in corners.windows(2) {
        let [from, to] = [leg[0], leg[1]].map(|[x, y]| Point3::new(x * stretch, y, 1.15));
        let count = ((to - from).norm() / 0.4).ceil() as usize;
        poses.extend((0..count).map(|i| {
            let along = (to - from).normalize();
            let swing = Vector3::new(-along.y, along.x, 0.0) * (i as f64 * 2.1).sin() * 0.7;
            Pose::looking(from + (to - from) * (i as f64 / count as f64), along + swing)
        }));
    }
    poses
}

const WAY: [[f64; 2]; 14] = [
    [2.9, 1.4],
    [1.7, 1.7],
    [1.7, 3.6],
    [1.4, 4.6],
    [3.3, 4.4],
    [3.8, 4.7],
    [5.2, 4.6],
    [5.2, 3.7],
    [6.4, 3.8],
    [6.45, 2.6],
    [6.3, 0.6],
    [5.4, 0.5],
    [3.0, 0.55],
    [2.2, 2.4],
];

fn write_run(run: &Path, stretch: f64) {
    let metadata =
        Metadata { mission_name: "apartment.xml".into(), mission: "<Mission/>".into(), ..Metadata::default() };
    let mut log = LogWriter::create(&run.join("log.mcap"), &metadata).unwrap();
    let mut put = |record: Record| log.append(&record.as_ref()).unwrap();
    let poses = poses(&WAY, stretch);
    for (i, &pose) in poses.iter().enumerate() {
        let id = i as u64 + 1;
        put(record(&keys::POSE_COMMAND, &PoseCommand { id, via: vec![], pose }, id));
        put(record(&keys::SCAN, &Scan::new(id, id, pose, Points::default()), id));
    }
    let scans = poses.len() as u64;
    put(record(&keys::MAP, &MapUpdate::new(explored(stretch).whole(), scans), scans));
    let length = poses.windows(2).map(|w| (w[1].position() - w[0].position()).norm()).sum();
    let progress = Progress { scan: scans, revision: 0, scans, path_length_m: length, free: 0, finished: true };
    put(record(&keys::PROGRESS, &progress, scans));
    let report = ExplorationReport {
        explorer: "ClosestFrontier".into(),
        policy: "elk".into(),
        settings: "as always".into(),
        complete: true,
        reason: "no frontier is left".into(),
        frontiers_left: FrontiersLeft::default(),
        plans: 13,
        counters: Vec::new(),
        cpu_secs: vec![],
    };
    put(record(&keys::EXPLORATION_REPORT, &report, scans));
    log.finish().unwrap();
}

/// Set `ELK_PICTURES` to a folder to keep the pictures there and look at them.
fn keep(picture: &Path, name: &str) {
    if let Some(folder) = std::env::var_os("ELK_PICTURES") {
        std::fs::copy(picture, Path::new(&folder).join(name)).unwrap();
    }
}

#[test]
fn a_run_is_drawn_the_same_way_twice() {
    for (name, stretch) in [("beside.png", 1.0), ("below.png", 2.0), ("turned.png", 0.5)] {
        let run = tempfile::tempdir().unwrap();
        write_run(run.path(), stretch);
        let picture = draw_run(run.path()).unwrap();
        let first = std::fs::read(&picture).unwrap();
        keep(&picture, name);
        assert_eq!(&first[..8], b"\x89PNG\r\n\x1a\n");
        let pixels = tiny_skia::Pixmap::decode_png(&first).unwrap();
        assert_eq!(pixels.width(), 1800);
        let count = |rgb: [u8; 3]| pixels.pixels().iter().filter(|p| [p.red(), p.green(), p.blue()] == rgb).count();
        assert!(count([30, 41, 59]) > 5_000, "{name}: walls that are cut");
        assert!(count([222, 226, 232]) > 1_000, "{name}: unknown space");
        draw_run(run.path()).unwrap();
        assert!(std::fs::read(&picture).unwrap() == first, "{name}: the same log gives the same picture");
    }
}

#[test]
fn what_is_missing_is_named() {
    let folder = tempfile::tempdir().unwrap();
    assert!(matches!(draw_run(&folder.path().join("no-run")), Err(PictureError::NoRun(_))));
    assert!(draw_run(folder.path()).unwrap_err().to_string().contains("log.mcap"));
    LogWriter::create(&folder.path().join("log.mcap"), &Metadata::default()).unwrap().finish().unwrap();
    assert!(draw_run(folder.path()).unwrap_err().to_string().contains("holds no map"));
}
