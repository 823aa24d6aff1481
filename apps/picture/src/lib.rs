//! Draws plan and section of an explored world into a PNG.
