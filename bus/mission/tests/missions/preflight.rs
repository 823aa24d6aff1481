//! What a file cannot show is looked at before anything starts.

use std::path::Path;

use elk_mission::{AppType, Kind, Mission, ParamSpec, Params, Preflight, PreflightReport, Registry};

use crate::table::{param, unbuilt};

/// What the file cannot show is looked at before anything starts, all of it at once.
#[test]
fn executables_and_what_apps_need_are_looked_at() {
    fn look(params: &Params, mission: &Mission) -> PreflightReport {
        let warnings = vec![format!("{} apps, K is {}", mission.apps.len(), params.number("K"))];
        let faults = if params.number("K") > 2.0 { vec!["K is too much".to_owned()] } else { Vec::new() };
        PreflightReport { faults, warnings }
    }
    const K: ParamSpec = param("K", Kind::Number { unit: "", min: 0.0, max: 9.0 }, Some("1"), "A number.");
    const fn row(name: &'static str, preflight: Option<Preflight>) -> AppType {
        AppType { element: "Filter", name, summary: "Looks around.", params: &[K], build: unbuilt, preflight }
    }
    static TYPES: &[AppType] = &[row("Looking", Some(look)), row("Plain", None)];
    let registry = Registry::new(&[TYPES]);
    let preflight = |filter: &str| {
        let text = format!(
            "<Scenario><Sensor exec=\"/bin/sh\"/><Map exec=\"sh\"/>{filter}<Explorer exec=\"sh\"/><Controller exec=\"sh\"/></Scenario>"
        );
        Mission::parse(&text, Path::new("m.xml"), &registry, &[])
            .unwrap()
            .preflight()
            .map_err(|error| error.to_string())
    };
    assert_eq!(preflight("<Filter type=\"Looking\"/>"), Ok(vec!["Filter: 5 apps, K is 1".to_owned()]));
    assert_eq!(
        preflight("<Filter type=\"Looking\" K=\"3\"/><App exec=\"/no/such\"/><App name=\"Odd\" exec=\"no-such\"/>"),
        Err("Filter: K is too much\n\
             App: /no/such cannot be run: No such file or directory (os error 2)\n\
             Odd: there is no no-such in PATH; right is an executable's name, or a path with a /"
            .to_owned())
    );
    let of_no_look = preflight("<Filter type=\"Plain\"/>");
    assert_eq!(of_no_look, Err("Filter: the types of these tests are only parsed".to_owned()), "it is built");
}
