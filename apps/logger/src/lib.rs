//! Records every message of the community into a log.
