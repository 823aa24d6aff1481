// Walks a column of pairs through its planes: for each, `visit` with the kernel's `value` there and the sum around it.
// What `visit` answers is summed.

@compute @workgroup_size(32, 8, 1)
fn main(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    if state.done != 0u {
        return;
    }
    let first = id.z * PLANES;
    var product = 0.0;
    if id.x < level.pairs && id.y < level.rows && first < level.planes {
        var at = vec3<i32>(vec3<u32>(id.xy, first));
        var i = index(id.x, id.y, first);
        var below = value(i - level.plane, at - vec3<i32>(0, 0, 1));
        var here = value(i, at);
        for (var left = min(PLANES, level.planes - first); left > 0u; left--) {
            let above = value(i + level.plane, at + vec3<i32>(0, 0, 1));
            let front = value(i - level.row, at - vec3<i32>(0, 1, 0));
            let back = value(i + level.row, at + vec3<i32>(0, 1, 0));
            let before = value(i - 1u, at - vec3<i32>(1, 0, 0)).y;
            let after = value(i + 1u, at + vec3<i32>(1, 0, 0)).x;
            let around = sum(i, vec2<f32>(before, here.x), vec2<f32>(here.y, after), front, back, below, above);
            product += visit(i, here, around);
            below = here;
            here = above;
            i += level.plane;
            at.z += 1;
        }
    }
    finish(product, local, group.x + groups.x * (group.y + groups.y * group.z));
}
