// The field by the problem's own voxels: what is given, and what was found. x still lacks its last step.

@group(0) @binding(2) var<storage, read> x: array<f32>;
@group(0) @binding(4) var<storage, read> even_p: array<f32>;
@group(0) @binding(5) var<storage, read> odd_p: array<f32>;
@group(0) @binding(6) var<storage, read_write> psi: array<f32>;

@compute @workgroup_size(64, 4, 1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let voxel = id.z * volume.plane + id.y * volume.row + id.x;
    if id.x >= volume.row || id.y * volume.row >= volume.plane || voxel >= volume.len {
        return;
    }
    var value = 0.0;
    let own = kind(voxel);
    if own == SOURCE {
        value = 1.0;
    } else if own == INSIDE {
        let i = 2u * index(0u, id.y - 1u, id.z - 1u) + id.x - 1u;
        value = x[i] + state.alpha * select(even_p[i], odd_p[i], (state.iterations & 1u) == 1u);
    }
    psi[voxel] = value;
}
