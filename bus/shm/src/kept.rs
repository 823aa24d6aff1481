//! What somebody leaves word of in a community's folder, for whoever comes when there is no broker left to ask.
//!
//! The folder goes with the community: its broker removes it when it stops, and the words with it.

use elk_proto::community::Community;

use super::folder::{Folder, FolderError};
use super::home::home;
use super::namespace::Namespace;

/// What begins the names of such files: the broker's own have another beginning.
const PREFIX: &str = "kept-";

/// Keeps `words` under `name`, one step of a path, in place of those that were kept there before. Only a community that a
/// broker has served has a folder.
///
/// # Errors
/// There is no such folder, it is not safe, or it cannot be written to.
pub fn keep(community: &Community, name: &str, words: &[u8]) -> Result<(), FolderError> {
    let namespace = Namespace::open_in(&Folder::open(&home())?, community)?;
    let folder = namespace.folder();
    folder.write(&file(name), words).map_err(failed(folder))
}

/// What was last kept under `name`.
///
/// # Errors
/// As of [`keep`]; nothing was kept is one as well, of the kind [`NotFound`](std::io::ErrorKind::NotFound).
pub fn kept(community: &Community, name: &str) -> Result<Vec<u8>, FolderError> {
    let namespace = Namespace::open_in(&Folder::open(&home())?, community)?;
    let folder = namespace.folder();
    folder.read(&file(name)).map_err(failed(folder))
}

fn file(name: &str) -> String {
    format!("{PREFIX}{name}")
}

fn failed(folder: &Folder) -> impl FnOnce(std::io::Error) -> FolderError {
    let folder = folder.path().to_owned();
    move |source| FolderError::Io { folder, source }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_kept_as_long_as_the_community_s_folder_is() {
        let community = Community::new(format!("kept-{}", std::process::id())).unwrap();
        assert!(keep(&community, "word", b"early").is_err(), "nobody has made the folder yet");
        let namespace = Namespace::make(&community).unwrap();
        assert!(kept(&community, "word").is_err());
        keep(&community, "word", b"first").unwrap();
        keep(&community, "word", b"second").unwrap();
        assert_eq!(kept(&community, "word").unwrap(), b"second");
        super::super::leftovers::remove(&namespace);
        assert!(kept(&community, "word").is_err());
    }
}
