//! Why nothing of what a sensor saw came into the map, as far as the map has counted it.

use elk_geometry::voxel::reach_m;
use elk_mission::AppSpec;
use elk_spatial::messages::MapStatus;
use elk_spatial::rays::RayTally;

/// Why the map holds nothing of what was to be seen, `filters` being between it and the sensor; none: it holds something.
pub(crate) fn shortfall(filters: &[&AppSpec], map: &MapStatus) -> Option<String> {
    let RayTally { no_return, measured, received, pixels, .. } = map.rays;
    let known = map.free + map.occupied;
    if measured > 0 && received == 0 {
        return Some(filtered(filters, measured));
    }
    if received > 0 && map.rays.taken() == 0 {
        return Some(refused(map));
    }
    if known > 0 {
        return None;
    }
    Some(match no_return {
        0 if pixels.total() > 0 => {
            format!(
                "nothing that the cameras saw could be matched ({pixels}): is there a texture, and light (Sensor.Texture, BlankShare, ImageNoise)?"
            )
        }
        0 => "no scan had a point in it".to_owned(),
        _ => format!(
            "the sensor saw nothing: all {no_return} rays of its scans went without a return; is its start inside the world, \
             does it look at something (Sensor.Start, StartYaw, StartPitch), is that within its Range, and the world closed? \
             Map.FreeNoReturn lets such rays free what they pass"
        ),
    })
}

/// What is to be said of a map that was too small for what came to it; none: it was not.
pub(crate) fn overflow(map: &MapStatus) -> Option<String> {
    let RayTally { no_room, received, .. } = map.rays;
    (no_room > 0).then(|| format!("the map had no room for {no_room} of {received} points: {MORE_ROOM}"))
}

const MORE_ROOM: &str = "set a larger Map.MaxBricks, or a coarser Map.Res";

fn filtered(filters: &[&AppSpec], measured: u64) -> String {
    let names: Vec<String> = filters.iter().map(|app| named(app)).collect();
    let whose = match names.is_empty() {
        true => "none came to the map".to_owned(),
        false => format!("none came through {}; let it keep some of them", names.join(" and ")),
    };
    format!("of {measured} points that the sensor measured {whose}")
}

/// `Filter (Distance, Threshold 0.3)`, with what the mission says of it.
fn named(app: &AppSpec) -> String {
    let wiring = ["Input", "Output"];
    let said = app.settings.iter().filter(|(name, _)| app.said.contains(name) && !wiring.contains(&name.as_str()));
    let said = said.map(|(name, text)| format!(", {name} {text}"));
    format!("{} ({}{})", app.name, app.type_name(), said.collect::<String>())
}

/// Why the map took none of the points that came to it.
fn refused(map: &MapStatus) -> String {
    let (RayTally { received, invalid, outside, no_room, .. }, resolution) = (map.rays, map.resolution);
    let reach = (reach_m(resolution) * 100.0).round() / 100.0;
    let causes = [
        (
            outside,
            format!(
                "lie outside its 65536 voxels an axis, which end {reach} m from the origin at Res {resolution} m: move the world \
             nearer to the origin, or set a coarser Map.Res"
            ),
        ),
        (invalid, "are not finite, or at the camera itself: what does the sensor measure?".to_owned()),
        (no_room, format!("had no room in it: {MORE_ROOM}")),
    ];
    let causes = causes.into_iter().filter(|(count, _)| *count > 0).map(|(count, why)| format!("{count} {why}"));
    format!("the map took none of the {received} points that came to it: {}", causes.collect::<Vec<_>>().join("; "))
}

#[cfg(test)]
mod tests {
    use elk_spatial::CameraInfo;
    use elk_spatial::pixels::PixelTally;

    use super::*;

    fn map(free: u64, rays: RayTally) -> MapStatus {
        let camera = CameraInfo::default();
        MapStatus {
            revision: 1,
            free,
            occupied: 0,
            frontier: 0,
            resolution: 0.1,
            cpu_secs: 0.0,
            full: false,
            rays,
            camera,
        }
    }

    #[test]
    fn what_was_lost_on_the_way_is_said_where_it_was_lost() {
        let said = |free, rays| shortfall(&[], &map(free, rays)).unwrap_or_default();
        let seen = RayTally { measured: 9, received: 9, ..RayTally::default() };
        assert_eq!(said(5, seen), "");
        assert_eq!(said(5, RayTally { outside: 8, ..seen }), "", "some of it is known");
        assert!(said(0, RayTally::default()).contains("no scan had a point"));
        let blank = PixelTally { textureless: 9, ..PixelTally::default() };
        let blank = said(0, RayTally { pixels: blank, ..RayTally::default() });
        assert!(
            blank.starts_with("nothing that the cameras saw could be matched (too little texture 100.0 %"),
            "{blank}"
        );
        assert!(said(0, RayTally { no_return: 7, ..RayTally::default() }).contains("all 7 rays"));
        assert_eq!(said(5, RayTally { no_return: 7, ..RayTally::default() }), "", "FreeNoReturn");
        assert!(
            said(0, RayTally { received: 0, ..seen }).starts_with("of 9 points that the sensor measured none came to")
        );
        let outside = said(0, RayTally { outside: 9, ..seen });
        assert!(outside.contains("9 lie outside its 65536 voxels an axis, which end 3276.8 m from"), "{outside}");
        let both = said(0, RayTally { outside: 4, no_room: 5, ..seen });
        assert!(both.contains("4 lie outside") && both.contains("5 had no room in it"), "{both}");
        assert_eq!(overflow(&map(5, seen)), None);
        assert!(overflow(&map(5, RayTally { no_room: 3, ..seen })).unwrap().contains("3 of 9 points"));
    }
}
