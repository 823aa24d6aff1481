//! Filters over scans: what to leave out before the map sees it.
