// What the voxels are becomes the finest level: the degrees of its cells, and the right-hand side as the first
// residual. An invocation makes a word of degrees, which is eight cells.

@group(0) @binding(2) var<storage, read_write> degrees: array<u32>;
@group(0) @binding(4) var<storage, read_write> r: array<f32>;

@compute @workgroup_size(8, 8, 4)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let x = 8u * id.x;
    if x >= 2u * level.pairs || id.y >= level.rows || id.z >= level.planes {
        return;
    }
    let first = 2u * index(0u, id.y, id.z) + x;
    let first_voxel = (id.z + 1u) * volume.plane + (id.y + 1u) * volume.row + x + 1u;
    var word = 0u;
    for (var k = 0u; k < 8u && x + k + 2u < volume.row; k++) {
        var degree = 0u;
        var sources = 0u;
        if kind(first_voxel + k) == INSIDE {
            var neighbours = around(first_voxel + k);
            for (var n = 0u; n < 6u; n++) {
                let neighbour = kind(neighbours[n]);
                degree += u32(neighbour != OUTSIDE);
                sources += u32(neighbour == SOURCE);
            }
        }
        word |= degree << (4u * k);
        r[first + k] = f32(sources);
    }
    degrees[first >> 3u] = word;
}
