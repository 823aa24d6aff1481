//! The page's files, built into the program.

/// A file of the page.
pub(crate) struct File {
    /// Its path behind `/`.
    pub path: &'static str,
    /// What it is.
    pub media_type: &'static str,
    pub bytes: &'static [u8],
}

/// Makes the table of files.
macro_rules! files {
    ($($path:literal: $media_type:literal,)*) => {
        /// All of them; the first is what `/` shows.
        pub(crate) const FILES: &[File] = &[$(File {
            path: $path,
            media_type: $media_type,
            bytes: include_bytes!(concat!("../page/", $path)),
        }),*];
    };
}

files! {
    "index.html": "text/html; charset=utf-8",
}
