//! Notes which revision of the sources is built, so that a run can say by what it was made.

use std::path::Path;
use std::process::Command;

/// What is built.
const SOURCES: [&str; 5] = ["apps", "bus", "mission-files", "Cargo.toml", "Cargo.lock"];

fn main() {
    println!("cargo:rustc-env=ELK_REVISION={}", revision().unwrap_or_else(|| "unknown".to_owned()));
    let head = ["HEAD".to_owned()].into_iter().chain(git(&["symbolic-ref", "-q", "HEAD"]));
    let heads = head.filter_map(|name| git(&["rev-parse", "--path-format=absolute", "--git-path", &name]));
    for file in heads.chain(SOURCES.map(str::to_owned)).filter(|file| Path::new(file).exists()) {
        println!("cargo:rerun-if-changed={file}");
    }
}

/// The revision of a checkout; `None`: these sources are none, whatever repository they may lie in.
fn revision() -> Option<String> {
    let top = git(&["rev-parse", "--show-toplevel"])?;
    if Path::new(&top).canonicalize().ok()? != Path::new(".").canonicalize().ok()? {
        return None;
    }
    let revision = git(&["rev-parse", "HEAD"])?;
    match git(&[&["status", "--porcelain", "-uno", "--"][..], &SOURCES].concat())?.as_str() {
        "" => Some(revision),
        // What is built is not what the revision says.
        _ => Some(revision + "-changed"),
    }
}

/// What git answers; `None` where there is no git, or no repository.
fn git(arguments: &[&str]) -> Option<String> {
    let answer = Command::new("git").args(arguments).output().ok().filter(|answer| answer.status.success())?;
    Some(String::from_utf8(answer.stdout).ok()?.trim().to_owned())
}
