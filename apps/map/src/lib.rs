//! The occupancy map: log-odds voxels, scan insertion, and OctoMap's files.
