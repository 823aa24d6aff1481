// The coarsest level, of at most 3 x 3 x 3 cells: many sweeps from zero by one workgroup.

@group(0) @binding(4) var<storage, read> b: array<f32>;
@group(0) @binding(5) var<storage, read_write> x: array<f32>;

/// Cells with their margin.
var<workgroup> values: array<f32, 125>;

/// Damping that smooths best in three dimensions.
const DAMPING = 6.0 / 7.0;
const SWEEPS = 24u;

@compute @workgroup_size(32)
fn main(@builtin(local_invocation_index) local: u32) {
    if state.done != 0u {
        return;
    }
    let at = vec3<u32>(local % 3u, local / 3u % 3u, local / 9u);
    let is_cell = at.x < 2u * level.pairs && at.y < level.rows && at.z < level.planes;
    let i = 2u * index(0u, at.y, at.z) + at.x;
    var own = vec4<f32>(0.0);
    var before = vec3<f32>(0.0);
    var load = 0.0;
    if is_cell {
        own = weights[i];
        before = vec3<f32>(weights[i - 1u].x, weights[i - 2u * level.row].y, weights[i - 2u * level.plane].z);
        load = b[i];
    }
    let inverse = select(0.0, 1.0 / own.w, own.w > 0.0);
    for (var v = local; v < 125u; v += 32u) {
        values[v] = 0.0;
    }
    let c = select(62u, (at.z + 1u) * 25u + (at.y + 1u) * 5u + at.x + 1u, is_cell);
    for (var sweep = 0u; sweep < SWEEPS; sweep++) {
        workgroupBarrier();
        let lower = vec3<f32>(values[c - 1u], values[c - 5u], values[c - 25u]);
        let upper = vec3<f32>(values[c + 1u], values[c + 5u], values[c + 25u]);
        let around = dot(before, lower) + dot(own.xyz, upper);
        let next = values[c] + DAMPING * inverse * (load - own.w * values[c] + around);
        workgroupBarrier();
        if is_cell {
            values[c] = next;
        }
    }
    if is_cell {
        x[i] = values[c];
    }
}
