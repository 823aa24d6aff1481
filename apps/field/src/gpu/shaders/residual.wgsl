// <r, r> for the residual r of a field by the problem's own voxels, from differences, which lose nothing.

@group(0) @binding(6) var<storage, read> psi: array<f32>;

@compute @workgroup_size(64, 4, 1)
fn main(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let voxel = id.z * volume.plane + id.y * volume.row + id.x;
    var r = 0.0;
    let is_voxel = id.x < volume.row && id.y * volume.row < volume.plane && voxel < volume.len;
    if is_voxel && kind(voxel) == INSIDE {
        var neighbours = around(voxel);
        for (var n = 0u; n < 6u; n++) {
            r += select(0.0, psi[neighbours[n]] - psi[voxel], kind(neighbours[n]) != OUTSIDE);
        }
    }
    finish(r * r, local, group.x + groups.x * (group.y + groups.y * group.z));
}
