//! Turns paths into pose commands, scanning on the way.
