//! The process around a filter: scans in under one variable, out under another.

use elk_bus::{App, AppError, Comms, Handlers, Key};
use elk_mission::{AppType, Kind, ParamSpec, Params};
use elk_spatial::Scan;

use crate::filters::{distance, voxel_grid};

/// The filters that a mission can name.
pub static TYPES: &[AppType] = &[
    AppType {
        element: "Filter",
        name: "Distance",
        summary: "Keeps the points of a scan that are near the camera.",
        params: &[number("Threshold", 1e4, "10", "Keeps points at most this far from the camera."), INPUT, OUTPUT],
        build: |params| {
            let threshold = params.number("Threshold");
            FilterApp::boxed(params, move |scan| scan.with_points(distance(&scan.points, threshold)))
        },
        preflight: None,
    },
    AppType {
        element: "Filter",
        name: "VoxelGrid",
        summary: "Thins a scan: one point, the centroid, for each cell of a grid.",
        params: &[number("Leaf", 100.0, "0.05", "Edge of a cell of the grid, in the camera frame."), INPUT, OUTPUT],
        build: |params| {
            let leaf = params.number("Leaf");
            FilterApp::boxed(params, move |scan| scan.with_points(voxel_grid(&scan.points, leaf)))
        },
        preflight: None,
    },
];

const INPUT: ParamSpec = variable("Input", "SCAN", "The variable of the scans to filter.");
const OUTPUT: ParamSpec = variable("Output", "SCAN_1", "The variable to publish the filtered scans under.");

const fn number(name: &'static str, max: f64, default: &'static str, doc: &'static str) -> ParamSpec {
    ParamSpec { name, kind: Kind::Number { unit: "m", min: 0.001, max }, default: Some(default), doc }
}

const fn variable(name: &'static str, default: &'static str, doc: &'static str) -> ParamSpec {
    ParamSpec { name, kind: Kind::Variable, default: Some(default), doc }
}

/// A filter as an app: `filter` makes of each scan the one to hand on, with its id, command and pose.
struct FilterApp<F> {
    output: Key<Scan<'static>>,
    filter: F,
}

impl<F: Fn(&Scan<'_>) -> Scan<'static> + Send + 'static> FilterApp<F> {
    fn boxed(params: &Params, filter: F) -> Result<Box<dyn App>, AppError> {
        let (input, output) = (params.text("Input"), params.text("Output"));
        if input == output {
            return Err(format!(
                "Input and Output are both {input}: the filter would read what it writes; name another Output"
            )
            .into());
        }
        let table = Handlers::<Self>::new().on(&Key::<Scan<'static>>::named(input), Self::on_scan);
        Ok(Box::new(table.with(Self { output: Key::named(output), filter })))
    }

    fn on_scan(&mut self, comms: &mut Comms, scan: Scan<'_>) -> Result<(), AppError> {
        Ok(comms.publish(&self.output, &(self.filter)(&scan))?)
    }
}
