//! Names of apps: they are names of clients, begin those of log files, and stand before a `.` in `--set`.

/// The longest (bytes).
const LONGEST: usize = 48;
/// What may stand in them besides letters and digits, of which one comes first.
const MARKS: [char; 2] = ['-', '_'];

/// Whether an app can have this name: one step of a path, no hidden file, and no option of a command.
pub fn is_app_name(text: &str) -> bool {
    let good = |c: char| c.is_ascii_alphanumeric() || MARKS.contains(&c);
    text.starts_with(|c: char| c.is_ascii_alphanumeric()) && text.len() <= LONGEST && text.chars().all(good)
}

/// What is right, for people.
pub(crate) fn right_app_names() -> String {
    let [one, other] = MARKS;
    format!("1 to {LONGEST} letters, digits, {one:?} or {other:?}, the first a letter or a digit")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_no_paths_and_no_options() {
        let bad = [
            "",
            ".",
            "..",
            "a.b",
            "-x",
            "--set",
            "_x",
            "a/b",
            "/etc",
            "a b",
            "a\0b",
            "ä",
            "a\n",
            &"x".repeat(LONGEST + 1),
        ];
        assert_eq!(bad.into_iter().find(|name| is_app_name(name)), None);
        assert!(["Map", "Map2", "7", "a-b_c", &"x".repeat(LONGEST)].into_iter().all(is_app_name));
    }
}
