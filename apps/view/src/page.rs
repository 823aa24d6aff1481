//! The page's files, built into the program.

/// A file of the page.
pub(crate) struct File {
    /// Its path behind `/`.
    pub path: &'static str,
    pub bytes: &'static [u8],
}

impl File {
    /// What it is.
    pub fn media_type(&self) -> &'static str {
        match self.path.rsplit_once('.').map(|(_, ending)| ending) {
            Some("html") => "text/html; charset=utf-8",
            Some("js") => "text/javascript; charset=utf-8",
            Some("css") => "text/css; charset=utf-8",
            Some("svg") => "image/svg+xml",
            _ => "application/octet-stream",
        }
    }
}

/// Makes the table of files.
macro_rules! files {
    ($($path:literal,)*) => {
        /// All of them; the first is what `/` shows.
        pub(crate) const FILES: &[File] = &[$(File {
            path: $path,
            bytes: include_bytes!(concat!("../page/", $path)),
        }),*];
    };
}

files! {
    "index.html",
    "appkeys.js",
    "binary.js",
    "camera.js",
    "chart.js",
    "chunks.js",
    "connection.js",
    "controls.js",
    "dom.js",
    "drawings.js",
    "drawn.js",
    "drawnflat.js",
    "favicon.svg",
    "ghost.js",
    "gl.js",
    "help.js",
    "link.js",
    "main.js",
    "mesh.js",
    "messages.js",
    "orders.js",
    "overlay.js",
    "palette.js",
    "panels/apps.js",
    "panels/events.js",
    "panels/logs.js",
    "panels/plots.js",
    "panels/run.js",
    "panels/steering.js",
    "panels/timeline.js",
    "panels/variables.js",
    "parameters.js",
    "plan2d.js",
    "robot.js",
    "scene.js",
    "shaders.js",
    "stage.js",
    "style.css",
    "tabs.js",
    "theme.js",
    "vectors.js",
    "viewbar.js",
    "voxels.js",
    "world.js",
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn all_files_of_the_page_are_served_as_what_they_are() {
        let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("page");
        let (mut folders, mut found) = (vec![page.clone()], Vec::new());
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                match path.is_dir() {
                    true => folders.push(path),
                    false => found.push(path.strip_prefix(&page).unwrap().to_str().unwrap().to_owned()),
                }
            }
        }
        let mut served: Vec<&str> = FILES.iter().map(|file| file.path).collect();
        found.sort();
        served.sort_unstable();
        assert_eq!(served, found);
        assert!(FILES.iter().all(|file| file.media_type() != "application/octet-stream"));
    }
}
