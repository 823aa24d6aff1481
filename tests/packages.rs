//! Each crate's package has in it all that the crate is built from: so it can be published.

use std::path::{Path, PathBuf};
use std::process::Command;

fn run(command: &mut Command) {
    let out = command.output().unwrap();
    assert!(out.status.success(), "{command:?}: {}", String::from_utf8_lossy(&out.stderr));
}

/// The files below a folder whose name ends so.
fn files(folder: &Path, ending: &str) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let below = |path: PathBuf| match path.is_dir() {
        true => files(&path, ending),
        false => Vec::from_iter(path.to_string_lossy().ends_with(ending).then_some(path.clone())),
    };
    entries.flat_map(below).collect()
}

/// What a source takes in as it is compiled. Of names that are put together, the folder.
fn included(source: &Path) -> Vec<PathBuf> {
    let text = std::fs::read_to_string(source).unwrap();
    let names = ["include_str!(", "include_bytes!(", "include!("].into_iter().flat_map(|word| text.split(word).skip(1));
    let names = names.filter_map(|rest| {
        let (put_together, rest) = rest.strip_prefix("concat!(").map_or((false, rest), |rest| (true, rest));
        let (name, _) = rest.strip_prefix('"')?.split_once('"')?;
        Some(if put_together { name.rsplit_once('/')?.0 } else { name })
    });
    let folder = source.parent().unwrap();
    names.map(|name| folder.join(name)).collect()
}

#[test]
fn a_package_has_all_that_its_crate_includes_and_the_licences() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = tempfile::tempdir().unwrap();
    run(Command::new(env!("CARGO"))
        .args(["package", "--workspace", "--no-verify", "--offline", "--allow-dirty", "--quiet", "--target-dir"])
        .arg(folder.path())
        .current_dir(root));
    let unpacked = folder.path().join("unpacked");
    std::fs::create_dir(&unpacked).unwrap();
    let packages = files(&folder.path().join("package"), ".crate");
    assert!(packages.len() > 20, "{packages:?}");
    for package in &packages {
        run(Command::new("tar").arg("xzf").arg(package).arg("-C").arg(&unpacked));
    }
    let mut looked_at = 0;
    for package in std::fs::read_dir(&unpacked).unwrap().map(|entry| entry.unwrap().path()) {
        for licence in ["LICENSE-MIT", "LICENSE-APACHE"] {
            let text = std::fs::read(package.join(licence)).unwrap_or_default();
            assert!(text == std::fs::read(root.join(licence)).unwrap(), "{} has not our {licence}", package.display());
        }
        let package = package.canonicalize().unwrap();
        let sources = ["src", "apps"].map(|folder| package.join(folder)).into_iter().filter(|folder| folder.is_dir());
        for source in sources.flat_map(|folder| files(&folder, ".rs")) {
            for name in included(&source) {
                let is_there = name.canonicalize().is_ok_and(|name| name.starts_with(&package));
                assert!(is_there, "{} includes {}, which is not in its package", source.display(), name.display());
                looked_at += 1;
            }
        }
    }
    assert!(looked_at > 30, "{looked_at}");
}

/// The worlds that are built in are those beside the missions, by links: a package cannot reach for what lies outside it, but
/// has in it what its links lead to.
#[test]
fn the_worlds_that_are_built_in_are_those_of_the_missions() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let [of_missions, built_in] = ["mission-files/worlds", "apps/world/worlds"].map(|folder| {
        let mut files = files(&root.join(folder), "");
        files.sort();
        files
            .iter()
            .map(|file| (file.file_name().unwrap().to_owned(), std::fs::read(file).unwrap()))
            .collect::<Vec<_>>()
    });
    assert!(!built_in.is_empty());
    assert!(of_missions == built_in, "link each of mission-files/worlds in apps/world/worlds");
}
