//! Where the pages lead: the files that they link to, or name in code, are there.

use std::path::{Path, PathBuf};

/// Folders whose files a page names by their path from the root.
const FOLDERS: [&str; 4] = ["apps/", "bus/", "docs/", "tests/"];

/// The pages below a folder; what is made lies elsewhere.
pub fn pages(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap());
    let is_kept = |name: &str| !name.starts_with('.') && name != "target" && name != "logs";
    let kept = entries.filter(|entry| entry.file_name().to_str().is_some_and(is_kept)).map(|entry| entry.path());
    kept.flat_map(|path| match path.is_dir() {
        true => pages(&path),
        false => Some(path).filter(|path| path.extension().is_some_and(|end| end == "md")).into_iter().collect(),
    })
    .collect()
}

/// The links of a page that lead to files, relative to it.
fn links(page: &str) -> impl Iterator<Item = &str> {
    let targets = page.split("](").skip(1).filter_map(|rest| rest.split([')', '#', ' ', '\n']).next());
    targets.filter(|target| !target.is_empty() && !target.contains(':'))
}

/// The files that stand in a page's code, as paths from the root; of `tests/a.rs::b` the file.
fn files(page: &str) -> impl Iterator<Item = &str> {
    let words = page.split('`').skip(1).step_by(2).filter(|code| !code.contains(char::is_whitespace));
    let paths = words.filter_map(|code| code.split("::").next()).filter(|code| !code.contains(['*', '{', '<']));
    paths.filter(|path| {
        let name = path.rsplit('/').next().unwrap_or_default();
        FOLDERS.iter().any(|folder| path.starts_with(folder)) && (name.is_empty() || name.contains('.'))
    })
}

/// What a page of the repository in `root` names that is not there.
pub fn missing(root: &Path, page: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(page).unwrap();
    let folder = page.parent().unwrap();
    let linked = links(&text).map(|link| (folder.join(link), link));
    let named = files(&text).map(|file| (root.join(file), file));
    let absent = linked.chain(named).filter(|(path, _)| !path.exists());
    absent.map(|(_, name)| format!("{}: {name}", page.strip_prefix(root).unwrap_or(page).display())).collect()
}

#[test]
fn a_link_and_a_file_in_code_are_found() {
    let page =
        "[a](b.md#c), [d](https://e.f), `bus/x.rs`, `tests/y.rs::z`, `bus/*.rs`, ```text\nbus/q.rs r\n``` and `apps/`";
    assert_eq!(links(page).collect::<Vec<_>>(), ["b.md"]);
    assert_eq!(files(page).collect::<Vec<_>>(), ["bus/x.rs", "tests/y.rs", "apps/"]);
}
