// The problem as it is given: a byte for each voxel of its region, margin and all.

struct Volume {
    /// Voxels of a row, of a plane, and in all.
    row: u32,
    plane: u32,
    len: u32,
}

@group(0) @binding(8) var<uniform> volume: Volume;
@group(0) @binding(9) var<storage, read> cells: array<u32>;

const OUTSIDE = 0u;
const INSIDE = 1u;
const SOURCE = 2u;

fn kind(voxel: u32) -> u32 {
    return (cells[voxel >> 2u] >> ((voxel & 3u) * 8u)) & 255u;
}

/// The six voxels around one that is not on a face of the region.
fn around(voxel: u32) -> array<u32, 6> {
    return array<u32, 6>(
        voxel - 1u, voxel + 1u, voxel - volume.row, voxel + volume.row, voxel - volume.plane, voxel + volume.plane,
    );
}
