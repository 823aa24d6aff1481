// Sums the residuals of each coarse cell's children: an invocation walks a column of coarse cells.

@group(0) @binding(4) var<storage, read> x: array<vec2<f32>>;
@group(0) @binding(5) var<storage, read> b: array<vec2<f32>>;
@group(0) @binding(6) var<storage, read_write> coarse: array<f32>;

/// The residual of a pair, summed.
fn residual(i: u32, here: vec2<f32>, front: vec2<f32>, back: vec2<f32>, below: vec2<f32>, above: vec2<f32>) -> f32 {
    let d = diagonal(i);
    let left = vec2<f32>(x[i - 1u].y, here.x);
    let right = vec2<f32>(here.y, x[i + 1u].x);
    let r = b[i] - d * here + sum(i, left, right, front, back, below, above);
    let inside = select(vec2<f32>(0.0), r, d > vec2<f32>(0.0));
    return inside.x + inside.y;
}

@compute @workgroup_size(32, 8, 1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let first = id.z * (PLANES / 2u);
    if state.done != 0u || id.x >= level.pairs || id.y >= level.coarse_rows || first >= level.coarse_planes {
        return;
    }
    // The lower row of the children, and the upper one.
    var i = index(id.x, 2u * id.y, 2u * first);
    var j = i + level.row;
    var parent = (first + 1u) * level.coarse_plane + id.y * level.coarse_row + id.x;
    var below_i = x[i - level.plane];
    var below_j = x[j - level.plane];
    var here_i = x[i];
    var here_j = x[j];
    for (var left = min(PLANES / 2u, level.coarse_planes - first); left > 0u; left--) {
        var total = 0.0;
        for (var half = 0u; half < 2u; half++) {
            let above_i = x[i + level.plane];
            let above_j = x[j + level.plane];
            total += residual(i, here_i, x[i - level.row], here_j, below_i, above_i);
            total += residual(j, here_j, here_i, x[j + level.row], below_j, above_j);
            below_i = here_i;
            below_j = here_j;
            here_i = above_i;
            here_j = above_j;
            i += level.plane;
            j += level.plane;
        }
        coarse[parent] = total;
        parent += level.coarse_plane;
    }
}
