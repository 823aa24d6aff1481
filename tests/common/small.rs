//! A mission of a moment.

/// Three coarse apps explore a small world. `kind`: `auto`, or `manual`; `more`: what else is in the mission.
pub fn small(kind: &str, more: &str) -> String {
    format!(
        "<Scenario name=\"Small\" type=\"{kind}\"><Sensor type=\"Simulator\"/>\
         <Map type=\"OctoMap\"><Res>0.25 m</Res></Map>\
         <Explorer type=\"ClosestFrontier\"><Mid>0; 0; 0.5</Mid><Dim>3; 3; 3</Dim></Explorer>\
         <Controller type=\"MOOSSim\"/>{more}</Scenario>"
    )
}
