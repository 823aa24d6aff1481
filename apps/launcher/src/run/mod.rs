//! What a run leaves behind: for people, for whoever runs it again, and for a launcher that picks it up.
//!
//! | module | one idea |
//! |---|---|
//! | `files` | the files in which it is kept, and what its apps are told of them |
//! | `launch_state` | what another launcher has to know to pick the mission up |
//! | `provenance` | what a run was made of, so that it can be had again |
//! | `summary`, `shortfall` | what it came to, and why nothing of what was seen came into the map |
//! | `picture` | what it looks like, drawn by a process of its own |
//! | `folder` | the folder itself |

pub(crate) mod files;
pub(crate) mod folder;
pub(crate) mod launch_state;
pub(crate) mod picture;
pub(crate) mod provenance;
pub(crate) mod shortfall;
pub(crate) mod summary;
