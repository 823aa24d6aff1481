//! Names of apps: they are names of clients, begin those of log files, and stand before a `.` in `--set`.

/// What is right, for people.
pub(crate) const APP_NAMES: &str = "1 to 48 letters, digits, '-' or '_', the first a letter or a digit";

/// Whether an app can have this name: one step of a path, no hidden file, and no option of a command.
pub fn is_app_name(text: &str) -> bool {
    let good = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    text.starts_with(|c: char| c.is_ascii_alphanumeric()) && text.len() <= 48 && text.chars().all(good)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_no_paths_and_no_options() {
        let bad =
            ["", ".", "..", "a.b", "-x", "--set", "_x", "a/b", "/etc", "a b", "a\0b", "ä", "a\n", &"x".repeat(49)];
        assert_eq!(bad.into_iter().find(|name| is_app_name(name)), None);
        assert!(["Map", "Map2", "7", "a-b_c", &"x".repeat(48)].into_iter().all(is_app_name));
    }
}
