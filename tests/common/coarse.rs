//! A mission that takes no time.

/// How fast its clock runs, so that nobody has to wait for a patience to run out.
pub const WARP: f64 = 1000.0;

/// A second of that clock. All apps run on one thread, and none has anything to do: the time itself is what they wait for,
/// and no event can come of anything else.
pub fn let_time_pass() {
    std::thread::sleep(std::time::Duration::from_millis(1));
}

/// The middle of the car's interior, with few and coarse pixels and voxels: a mission of 17 scans.
pub const MISSION: &str = r#"
<Scenario name="Car, coarse">
    <Sensor type="Simulator">
        <Width>24</Width> <Height>24</Height> <Start> 0.0; 0.0; 0.8 </Start> <StartPitch> -15 deg </StartPitch>
    </Sensor>
    <Filter type="Distance"/>
    <Map type="OctoMap"> <Res> 0.25 m </Res> </Map>
    <Explorer type="ClosestFrontier"> <Res> 0.25 m </Res> <Mid> 0.0; 0.0; 0.5 </Mid> <Dim> 3; 3; 3 </Dim> </Explorer>
    <Controller type="MOOSSim"/>
</Scenario>"#;
