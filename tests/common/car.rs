//! A mission that comes with elk.

/// The car, wherever it is launched. `kind`: `auto`, or `manual`.
pub fn car(kind: &str) -> String {
    let root = env!("CARGO_MANIFEST_DIR");
    let text = std::fs::read_to_string(format!("{root}/mission-files/car.xml")).unwrap();
    let text = text.replace("worlds/", &format!("{root}/mission-files/worlds/"));
    text.replace("type=\"auto\"", &format!("type=\"{kind}\""))
}
