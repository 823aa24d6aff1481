use super::*;

/// The scans of a log, and what was wrong with it.
fn read(log: &str) -> (Vec<LaserScan>, Vec<String>) {
    let (mut scans, mut errors) = (Vec::new(), Vec::new());
    for next in Reader::new("a.log", log.as_bytes()) {
        match next {
            Ok(scan) => scans.push(scan),
            Err(error) => errors.push(error.to_string()),
        }
    }
    (scans, errors)
}

#[test]
fn a_log_has_scans_poses_and_odometry() {
    let log = "# a comment\nPARAM robot_frontlaser_offset 0.0 nohost 0\n\
        ODOM 0 0 0 0 0 0 1.0 host 1.0\nODOM 1 0 0 0 0 0 2.0 host 2.0\n\
        FLASER 3 1.0 2.0 81.91 1.5 0.25 0.5 1.5 0.25 0.5 2.5 host 2.5\n\
        ODOM 1.5 0.25 0.5 0 0 0 0 host 0\nODOM 2.5 0.25 0.5 0 0 0 3.0 host 3.0\n\
        FLASER 2 1.0 2.0 2.4 0.3 0.5 2.4 0.3 0.5 3.5 host 3.5";
    let (scans, errors) = read(log);
    assert_eq!(errors, Vec::<String>::new());
    assert_eq!((scans.len(), scans[0].line, scans[1].line), (2, 5, 8));
    assert_eq!((scans[0].time, scans[0].ranges.as_slice()), (Some(2.5), &[1.0, 2.0, 81.91][..]));
    assert_eq!(scans[0].pose, Isometry2::new(Vector2::new(1.5, 0.25), 0.5));
    assert_eq!(scans[0].odometry, Isometry2::translation(1.0, 0.0));
    // A metre along x, from where it was said to be at an angle of 0.5.
    let moved = scans[1].odometry.translation.vector - Vector2::new(1.0 + 0.5f64.cos(), -(0.5f64.sin()));
    assert!(moved.norm() < 1e-12, "{}", scans[1].odometry);

    let points = scans[0].points(50.0);
    assert_eq!(points.len(), 2, "one beam came not back");
    assert!((points[0] - Point2::new(0.0, -1.0)).norm() < 1e-6 && (points[1] - Point2::new(2.0, 0.0)).norm() < 1e-6);
    let bearings = [0, 1].map(|beam| scans[1].bearing(beam).to_degrees());
    assert!((bearings[0] + 90.0).abs() < 1e-9 && bearings[1].abs() < 1e-9, "{bearings:?}");
}

/// Regression: whatever a laser saw was taken to lie over 180°.
#[test]
fn beams_lie_over_the_field_of_view_that_the_laser_has() {
    let scan = |beams: usize| format!("FLASER {beams}{} 0 0 0 0 0 0 0 host 0", " 1".repeat(beams));
    let bearings = |beams: usize, degrees: f64| {
        let log = scan(beams);
        let reader = Reader::new("a.log", log.as_bytes()).with_field_of_view(degrees.to_radians());
        let scan = reader.map(Result::unwrap).next().unwrap();
        [0, beams - 1].map(|beam| scan.bearing(beam).to_degrees())
    };
    for (beams, degrees, wanted) in
        [(1081, 270.0, [-135.0, 135.0]), (1080, 270.0, [-135.0, 134.75]), (360, 360.0, [-180.0, 179.0])]
    {
        let found = bearings(beams, degrees);
        assert!((0..2).all(|i| (found[i] - wanted[i]).abs() < 1e-9), "{beams} over {degrees}: {found:?}");
    }
}

/// A `ROBOTLASER1` of as many beams of 1 m, seen from (1, 2) by a laser that is 0.2 m ahead of the robot, `extra` remissions behind.
fn robot_laser(beams: usize, angles: &str, extra: usize) -> String {
    let (ranges, remissions) = (" 1.0".repeat(beams), " 7".repeat(extra));
    format!(
        "ROBOTLASER1 4 {angles} 20.0 0.01 0 {beams}{ranges} {extra}{remissions} 1.2 2 0 1 2 0 0 0 0.3 0.3 0 5.5 host 5.6\n"
    )
}

#[test]
fn a_newer_line_says_its_own_bearings_and_range() {
    let log = [
        robot_laser(1081, "-2.356194 4.712389 0.004363", 0),
        robot_laser(540, "-2.356194 4.712389 0.008727", 540),
        robot_laser(181, "-1.570796 3.141593 0.0175", 0),
        robot_laser(360, "-3.141593 6.283185 0.017453", 0),
        robot_laser(90, "0 1.570796 0.017453", 0),
    ];
    let (scans, errors) = read(&log.concat());
    assert_eq!(errors, Vec::<String>::new());
    let ends = scans.iter().map(|scan| [0, scan.ranges.len() - 1].map(|beam| scan.bearing(beam).to_degrees()));
    let wanted = [[-135.0, 135.0], [-135.0, 134.5], [-90.0, 90.0], [-180.0, 179.0], [0.0, 89.0]];
    for (found, wanted) in ends.zip(wanted) {
        assert!((0..2).all(|i| (found[i] - wanted[i]).abs() < 1e-4), "{found:?} is not {wanted:?}");
    }
    let LaserScan { pose, odometry, time, range_max, .. } = &scans[1];
    assert_eq!((*pose, *odometry), (Isometry2::translation(1.2, 2.0), Isometry2::translation(1.0, 2.0)));
    assert_eq!((*time, *range_max), (Some(5.5), Some(20.0)));
}

#[test]
fn newer_lines_that_are_none_are_said() {
    let whole = robot_laser(3, "-1.570796 3.141593 1.5708", 0);
    let log = [
        robot_laser(0, "-1.57 3.14 0.01", 0),
        robot_laser(181, "-1.570796 3.141593 0.008727", 0),
        robot_laser(3, "-1.570796 nan 1.5708", 0),
        robot_laser(3, "-1.570796 6.9 3.45", 0),
        whole.replace(" 20.0 ", " 0 "),
        whole.replace(" 0 1.2", " -1 1.2"),
        whole.replace(" 5.5 ", " "),
        whole.clone(),
    ];
    let (scans, errors) = read(&log.concat());
    let wanted = [
        "a.log:1: a scan of 0 beams",
        "a.log:2: 181 beams from -1.570796 rad on, 0.008727 rad from one to the next, over 3.141593 rad: a field of",
        "a.log:3: \"nan\" as an angle",
        "a.log:4: 3 beams from -1.570796 rad on, 3.45 rad",
        "a.log:5: a largest range of 0 m: one above 0 would be right",
        "a.log:6: \"-1\" remissions: 0 to 10000 would be right",
        "a.log:7: ROBOTLASER1 with 26 words: 27 would be right",
    ];
    assert!(
        errors.len() == 7 && errors.iter().zip(wanted).all(|(said, wanted)| said.starts_with(wanted)),
        "{errors:#?}"
    );
    assert_eq!(scans.len(), 1);
}

#[test]
fn a_log_without_odometry_has_that_of_its_scans() {
    let (scans, _) = read("FLASER 1 1.0 9 9 0 1 2 0 0 host 0");
    assert_eq!(scans[0].odometry, Isometry2::translation(1.0, 2.0));
    assert_eq!(scans[0].time, None);
}

/// Regression: one `ODOM` from nowhere made a NaN of where wheels said that the robot was, for the rest of the log.
#[test]
fn a_position_that_is_on_no_map_spoils_no_other() {
    let odom = |x: &str, time: f64| format!("ODOM {x} 0 0 0 0 0 {time} host {time}\n");
    let scan = |time: f64| format!("FLASER 1 1.0 0 0 0 0 0 0 {time} host {time}\n");
    let log = [odom("1", 1.0), scan(1.5), odom("1e308", 2.0), odom("-1e308", 3.0), odom("2", 4.0), scan(4.5)];
    let (scans, errors) = read(&log.concat());
    assert_eq!((scans.len(), errors.len()), (2, 2), "{errors:?}");
    assert_eq!(scans[1].odometry, Isometry2::translation(2.0, 0.0));
}

#[test]
fn bad_lines_are_said_and_passed_over() {
    let long = format!("FLASER 1 {}\n", "1".repeat(300_000));
    let log = [
        "FLASER 0 0 0 0 0 0 0 1.0 host 1.0\n",
        "FLASER 2 1.0 NaN 0 0 0 0 0 0 1.0 host 1.0\n",
        "FLASER 2 1.0 -2 0 0 0 0 0 0 1.0 host 1.0\n",
        "FLASER 2 1.0 2.0 0 0 0 0 0 0 5.0 host 5.0\n",
        "FLASER 2 1.0 2.0 0 0 0 0 0 0 4.0 host 4.0\n",
        "FLASER 3 1.0 2.0 0 0 0 0 0 0 6.0 host 6.0\n",
        "FLASER\n",
        &long,
        "ODOM 0 nan 0 0 0 0 1.0 host 1.0\n",
        "ODOM 0 0\n",
        "ODOM 0 -1e308 0 0 0 0 1.0 host 1.0\n",
        "FLASER 2 1.0 2.0 0 0 0 0 0 0 7.0 host 7.0\n",
    ];
    let (scans, errors) = read(&log.concat());
    let wanted = [
        "a.log:1: a scan of 0 beams: 1 to 10000 would be right",
        "a.log:2: beam 1 of NaN m: a finite range of at least 0 would be right",
        "a.log:3: beam 1 of -2 m: a finite range of at least 0 would be right",
        "a.log:5: a scan of 4 s after one of 5 s: times go forwards",
        "a.log:6: FLASER with 13 words: 14 would be right",
        "a.log:7: a scan of  beams: 1 to 10000 would be right",
        "a.log:8: a line of more than 262144 bytes: this is no CARMEN log",
        "a.log:9: \"nan\" as y: a finite number would be right",
        "a.log:10: ODOM with 3 words: 10 would be right",
        &format!("a.log:11: {} m as y: at most 10000000 m, either way, would be right", -1e308),
    ];
    assert_eq!(errors, wanted);
    assert_eq!(scans.iter().map(|scan| scan.line).collect::<Vec<_>>(), [4, 12]);
}

/// Regression: all scans behind one whose clock was ahead were passed over.
#[test]
fn one_time_that_is_none_costs_one_scan_more() {
    let scan = |time: f64| format!("FLASER 1 1.0 0 0 0 0 0 0 {time} host {time}\n");
    let (scans, errors) = read(&[1.0, 2.0, 1e9, 3.0, 0.5, 4.0].map(scan).concat());
    assert_eq!(scans.iter().map(|scan| scan.line).collect::<Vec<_>>(), [1, 2, 3, 6]);
    assert!(
        errors[0].contains("3 s after one of 1000000000 s") && errors[1].contains("0.5 s after one of 3"),
        "{errors:?}"
    );
}

/// Regression: two megabytes that gzip had made of empty lines were read for minutes, and those of one that only begins like a scan
/// took all memory.
#[test]
fn a_log_with_much_text_and_no_scan_is_not_read_to_its_end() {
    let scan = b"FLASER 1 1.0 9 9 0 1 2 0 0 host 0\n";
    for filling in ["\n", "FLASER\n", "# a comment\n", "x"] {
        let endless = std::io::BufReader::new(Filling(filling.as_bytes(), 0).take(2 * MAX_APART));
        let log = std::io::Read::chain(&scan[..], endless);
        let mut reader = Reader::new("a.log", std::io::BufReader::new(log));
        assert!(reader.next().unwrap().is_ok());
        let mut last = reader.next().unwrap().unwrap_err().to_string();
        for next in reader {
            last = next.unwrap_err().to_string();
        }
        assert!(last.contains("no scan in 16777216 bytes: this is no CARMEN log"), "{filling:?}: {last}");
    }
    // What is said between two scans counts for these two.
    let hours = [scan, &b"# a comment\n".repeat(100_000)[..]].concat().repeat(20);
    assert_eq!(Reader::new("a.log", hours.as_slice()).filter(Result::is_ok).count(), 20);
}

/// The same bytes, over and over.
struct Filling(&'static [u8], usize);

impl Read for Filling {
    fn read(&mut self, to: &mut [u8]) -> std::io::Result<usize> {
        for byte in &mut *to {
            *byte = self.0[self.1 % self.0.len()];
            self.1 += 1;
        }
        Ok(to.len())
    }
}

#[test]
fn a_log_that_breaks_off_ends() {
    struct Broken;
    impl Read for Broken {
        fn read(&mut self, _: &mut [u8]) -> std::io::Result<usize> {
            Err(std::io::Error::other("no disk"))
        }
    }
    let read: Vec<_> = Reader::new("a.log", std::io::BufReader::new(Broken)).take(9).collect();
    assert_eq!(read.len(), 1);
    assert_eq!(read[0].as_ref().unwrap_err().to_string(), "a.log:1: cannot be read on: no disk");
}
