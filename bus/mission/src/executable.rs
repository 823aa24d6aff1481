//! The file that an executable's name means, and whether it can be run.

use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

/// The executable that is meant: a path is looked for from `folder`, a bare name in `PATH`.
pub(crate) fn executable(exec: &str, folder: &Path) -> Result<PathBuf, String> {
    if exec.is_empty() {
        return Err("exec is empty; right is an executable".to_owned());
    }
    if exec.contains('/') {
        let path = folder.join(exec);
        return runs(&path).map(|()| path);
    }
    let path = std::env::var_os("PATH").unwrap_or_default();
    let found = std::env::split_paths(&path).map(|folder| folder.join(exec)).find(|file| runs(file).is_ok());
    found.ok_or_else(|| match runs(&folder.join(exec)) {
        Ok(()) => format!("there is no {exec} in PATH; did you mean ./{exec}?"),
        Err(_) => format!("there is no {exec} in PATH; right is an executable's name, or a path with a /"),
    })
}

/// Whether a file can be run.
fn runs(file: &Path) -> Result<(), String> {
    let shown = file.display();
    match std::fs::metadata(file) {
        Err(error) => Err(format!("{shown} cannot be run: {error}")),
        Ok(found) if !found.is_file() => Err(format!("{shown} is no file; right is an executable")),
        Ok(found) if found.permissions().mode() & 0o111 == 0 => {
            Err(format!("{shown} is not executable; `chmod +x` makes a program of it"))
        }
        Ok(_) => Ok(()),
    }
}
