//! A laser in the corner of a room that has moved: found again, with how sure that is; and in a corridor.

use elk_registration::{Cloud, Icp, IcpConfig, Lost, Map, Resolution};
use nalgebra::{Isometry2, Point2, Vector2};

/// Points of walls along y = ±1 m, and of one across if there is one, as seen from a pose.
fn walls(has_end: bool, pose: &Isometry2<f64>) -> Vec<Point2<f32>> {
    let sides = (0..400).map(|i| Point2::new(f64::from(i) * 0.01 - 2.0, if i % 2 == 0 { 1.0 } else { -1.0 }));
    let end = (0..100).map(|i| Point2::new(2.0, f64::from(i) * 0.02 - 1.0)).filter(|_| has_end);
    sides.chain(end).map(|point| pose.inverse_transform_point(&point).cast()).collect()
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let resolution = Resolution::new(0.05, 4)?;
    let icp = Icp::new(IcpConfig::default())?;
    let moved = Isometry2::new(Vector2::new(0.15, -0.1), 0.1);
    for has_end in [true, false] {
        let mut map = Map::new(resolution);
        map.insert(&Cloud::new(&walls(has_end, &Isometry2::identity()), resolution)?, &Isometry2::identity(), 1)?;
        let scan = Cloud::new(&walls(has_end, &moved), resolution)?;
        let found = icp.register(&map, &scan, &Isometry2::identity())?;
        println!("found at {}, overlap {:.2}", found.pose.translation, found.health.overlap());
        let unknown: Vec<_> = found.health.unknown.iter().map(|direction| direction.x.abs() > 0.9).collect();
        // Where the walls go on and on, only the way across is known.
        assert_eq!(unknown, if has_end { vec![] } else { vec![true] });
        assert!((found.pose.translation.y + 0.1).abs() < 0.01);
        assert_eq!(found.covariance().is_some(), has_end);

        let elsewhere = icp.register(&map, &scan, &Isometry2::translation(20.0, 0.0));
        assert!(matches!(elsewhere, Err(Lost::Overlap { .. })));
    }
    Ok(())
}
