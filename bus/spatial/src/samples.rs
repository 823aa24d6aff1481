//! A value of each type that the apps of an exploration exchange, as JSON, for tests, which spoil them (feature `samples`).

use elk_bus::codec::DecodeError;
use elk_bus::{Key, Payload, TypeRef, ValueRef};
use serde_json::Value;

use crate::candidates::Candidates;
use crate::keyframe::MapPart;
use crate::map::MapUpdate;
use crate::messages::{
    AccuracyReport, CameraPose, ExplorationReport, ExplorerMemory, ExplorerPast, MapMemory, MapStatus, MotionMemory,
    MotionReport, Plan, PlanRequest, PoseCommand, Progress, SensorReport,
};
use crate::playback::{Playback, PoseEstimate};
use crate::scan::Scan;
use crate::travel::TravelReport;

/// A value of a type.
#[derive(Debug, Clone, Copy)]
pub struct Sample {
    /// The type.
    pub type_: TypeRef<'static>,
    /// The value.
    pub json: &'static str,
    check: fn(&[u8]) -> Result<(), DecodeError>,
}

impl Sample {
    const fn of<T: Payload>(json: &'static str) -> Self {
        Self { type_: TypeRef::of::<T>(), json, check: check::<T> }
    }

    /// The type's name.
    pub fn name(&self) -> &'static str {
        self.type_.name()
    }

    /// The value, to be changed.
    pub fn value(&self) -> Value {
        serde_json::from_str(self.json).expect("a sample is JSON")
    }

    /// The bytes of a value of the type; `None`: it is none.
    pub fn bytes_of(&self, value: &Value) -> Option<Vec<u8>> {
        self.type_.description()?.to_bytes(value).ok()
    }

    /// The sample's bytes.
    pub fn bytes(&self) -> Vec<u8> {
        self.bytes_of(&self.value()).expect("a sample is a value of its type")
    }

    /// Whether a reader would believe a value of the type.
    ///
    /// # Errors
    /// The bytes are no value of the type, or one that cannot be true.
    pub fn check(&self, bytes: &[u8]) -> Result<(), DecodeError> {
        (self.check)(bytes)
    }
}

fn check<T: Payload>(bytes: &[u8]) -> Result<(), DecodeError> {
    ValueRef::Binary { type_: TypeRef::of::<T>(), bytes }.decode(&Key::<T>::new(T::NAME)).map(drop)
}

/// The sample of the type of this name.
pub fn named(name: &str) -> Option<&'static Sample> {
    SAMPLES.iter().find(|sample| sample.name() == name)
}

/// A value of each type.
pub const SAMPLES: &[Sample] = &[
    Sample::of::<Scan<'static>>(
        r#"{"id":1,"command":1,"pose":{"rotation":[0.0,0.0,0.0,1.0],"translation":[1.0,2.0,0.5]},"camera":{"columns":100,"rows":100,"fov_x":1.309,"fov_y":1.309,"range_m":5.0,"inverse_depth_sigma":0.0},"measured":1,"pixel_runs":[{"outcome":0,"pixels":2},{"outcome":1,"pixels":9998}],"no_return":[[0.0,0.0,1.0]],"points":[[0.1,-0.2,3.0]]}"#,
    ),
    Sample::of::<MapUpdate>(
        r#"{"revision":1,"since":0,"scan":1,"resolution":0.1,"bricks":[{"brick":[0,0,-1],"cells":"?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#"}]}"#,
    ),
    Sample::of::<MapPart>(
        r#"{"revision":1,"scan":1,"resolution":0.1,"first":0,"total":1,"bricks":[{"brick":[0,0,-1],"cells":"?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#?..#"}]}"#,
    ),
    Sample::of::<PoseCommand>(r#"{"id":1,"via":[],"pose":{"rotation":[0.0,0.0,0.0,1.0],"translation":[1.0,2.0,0.5]}}"#),
    Sample::of::<CameraPose>(r#"{"command":1,"pose":{"rotation":[0.0,0.0,0.0,1.0],"translation":[1.0,2.0,0.5]}}"#),
    Sample::of::<MapStatus>(
        r#"{"revision":1,"free":8,"occupied":2,"frontier":3,"resolution":0.1,"cpu_secs":0.01,"full":false,"rays":{"no_return":1,"measured":9,"received":9,"invalid":0,"outside":0,"too_far":0,"no_room":0,"pixels":{"matched":9,"textureless":1,"out_of_range":0,"ambiguous":0,"inconsistent":0,"small_component":0}},"camera":{"columns":100,"rows":100,"fov_x":1.309,"fov_y":1.309,"range_m":5.0,"inverse_depth_sigma":0.0}}"#,
    ),
    Sample::of::<PlanRequest>(
        r#"{"id":1,"pose":{"rotation":[0.0,0.0,0.0,1.0],"translation":[1.0,2.0,0.5]},"revision":1,"outcome":"First"}"#,
    ),
    Sample::of::<Plan>(
        r#"{"request":1,"revision":1,"decision":{"Go":{"points":[[1.0,2.0,0.5]],"target":{"x":1,"y":2,"z":3},"unknown":[],"looks":[],"again":false}},"motion":{"name":"elk","scan_spacing_m":0.5,"early_stop":true,"look_at_target":true,"clearance_m":0.2,"level":false},"cpu_secs":0.01}"#,
    ),
    Sample::of::<Progress>(r#"{"scan":1,"revision":1,"scans":1,"path_length_m":2.5,"free":8,"finished":false}"#),
    Sample::of::<MotionReport>(
        r#"{"scans":9,"path_length_m":2.5,"free":8,"marks":[{"share":0.95,"scans":7,"path_length_m":2.0}]}"#,
    ),
    Sample::of::<TravelReport>(r#"{"command":1,"secs":12.5,"stops":0}"#),
    Sample::of::<ExplorationReport>(
        r#"{"explorer":"Potential","policy":"elk","settings":"clearance 0.1 m","complete":true,"reason":"nothing is left","frontiers_left":{"unreachable":0,"invisible":1,"unresolved":0,"no_return":0,"too_small":2,"open":0,"map_edge":0,"no_room":0,"volume_edge":0},"plans":9,"counters":[["stalls",0]],"cpu_secs":[["solve",0.5]]}"#,
    ),
    Sample::of::<SensorReport>(r#"{"scans":9,"contacts":0,"scan":9,"cpu_secs":0.5}"#),
    Sample::of::<Playback>(
        r#"{"command":1,"frames":3,"scans":1,"bad":1,"lost":1,"path_length_m":2.5,"pose":{"rotation":[0.0,0.0,0.0,1.0],"translation":[1.0,2.0,0.5]},"next_secs":0.1,"off_m":0.01,"cut":""}"#,
    ),
    Sample::of::<PoseEstimate>(
        r#"{"scan":1,"frame":"frame-000002.depth.png","secs":0.1,"pose":{"rotation":[0.0,0.0,0.0,1.0],"translation":[1.0,2.0,0.5]},"recorded":null,"covariance":[0.0001,0.0,0.0,0.0,0.0001,0.0,0.0,0.0,0.0001],"overlap":0.9,"lost":""}"#,
    ),
    Sample::of::<AccuracyReport>(r#"{"revision":9,"accuracy":0.99,"voxels":1000}"#),
    Sample::of::<Candidates>(
        r#"{"request":1,"revision":1,"from":{"rotation":[0.0,0.0,0.0,1.0],"translation":[1.0,2.0,0.5]},"weighed":1,"goals":[{"position":[1.5,2.0,0.5],"target":{"x":17,"y":20,"z":5},"score":0.5,"chosen":true}]}"#,
    ),
    Sample::of::<MapMemory>(
        r#"{"revision":1,"scan":1,"resolution":0.1,"bricks":[{"brick":[0,0,-1],"known":[3,0,0,0,0,0,0,0],"ever_hit":[2,0,0,0,0,0,0,0],"log_odds":[-0.5,0.75]}]}"#,
    ),
    Sample::of::<MotionMemory>(
        r#"{"pose":{"rotation":[0.0,0.0,0.0,1.0],"translation":[1.0,2.0,0.5]},"awaited":{"Map":{"id":1,"via":[],"pose":{"rotation":[0.0,0.0,0.0,1.0],"translation":[1.0,2.0,0.5]}}},"commands":1,"allowed":1,"steps":0,"last_step":12.5,"requests":1,"path_length_m":2.5,"leg":{"plan":{"request":1,"revision":1,"decision":{"Go":{"points":[[1.0,2.0,0.5]],"target":{"x":1,"y":2,"z":3},"unknown":[],"looks":[],"again":false}},"motion":{"name":"elk","scan_spacing_m":0.5,"early_stop":true,"look_at_target":true,"clearance_m":0.2,"level":false},"cpu_secs":0.01},"resolution":0.1,"allowed":[],"done_m":2.5,"step_m":0.5,"ended":null,"looks":0},"drive":{"from":[1.0,2.0,0.5],"yaw":0.5,"pitch":0.0,"rates":[0.5,0.0,0.0,0.25,0.0],"secs":12.5,"stops":0},"samples":[{"scans":1,"free":8,"path_length_m":0.0}]}"#,
    ),
    Sample::of::<ExplorerMemory>(
        r#"{"plan":{"request":1,"revision":1,"decision":{"Go":{"points":[[1.0,2.0,0.5]],"target":{"x":1,"y":2,"z":3},"unknown":[],"looks":[],"again":false}},"motion":{"name":"elk","scan_spacing_m":0.5,"early_stop":true,"look_at_target":true,"clearance_m":0.2,"level":false},"cpu_secs":0.01},"ended":null,"plans":1,"fallbacks":0,"counters":[["iterations",14]],"strategy":"Level","cpu_secs":[["field",0.5]],"goes_on":false,"lists":{"trail":[{"x":1,"y":2,"z":3}],"targets":[{"target":{"x":1,"y":2,"z":4},"tried":[{"x":1,"y":2,"z":3}],"cuts":0,"planned":1,"no_return":false}],"hidden":[],"barred":[]},"standing":{"free":8,"occupied":2,"frontier":3,"attempts":1},"progress_at":1,"refused":0,"no_return":0}"#,
    ),
    Sample::of::<ExplorerPast>(
        r#"{"trail":[{"x":1,"y":2,"z":3}],"targets":[{"target":{"x":1,"y":2,"z":4},"tried":[{"x":1,"y":2,"z":3}],"cuts":0,"planned":1,"no_return":false}],"hidden":[{"x":1,"y":2,"z":5}],"barred":[{"x":1,"y":2,"z":6}]}"#,
    ),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_sample_goes_both_ways_and_is_believed() {
        for sample in SAMPLES {
            let bytes = sample.bytes();
            sample.check(&bytes).unwrap_or_else(|error| panic!("{}: {error}", sample.name()));
            let json = sample.type_.to_json(&bytes, usize::MAX).unwrap();
            assert_eq!(json.to_string(), sample.json, "the fields' order, too");
            assert!(sample.type_.to_json(&bytes[..bytes.len() - 1], 9).is_err() && sample.check(&[]).is_err());
            assert_eq!(SAMPLES.iter().filter(|other| other.name() == sample.name()).count(), 1, "{}", sample.name());
        }
    }
}
