// Conjugate gradients: r - alpha Ap and its <r, r>; and the first half of the multigrid cycle on the finest level,
// which is two sweeps from zero on what has just become of r.

@group(0) @binding(4) var<storage, read> r: array<vec2<f32>>;
@group(0) @binding(5) var<storage, read> ap: array<vec2<f32>>;
@group(0) @binding(6) var<storage, read_write> next_r: array<vec2<f32>>;
@group(0) @binding(7) var<storage, read_write> z: array<vec2<f32>>;

fn residual(i: u32) -> vec2<f32> {
    return r[i] - state.alpha * ap[i];
}

fn value(i: u32, at: vec3<i32>) -> vec2<f32> {
    return inverse(diagonal(i)) * residual(i);
}

fn visit(i: u32, here: vec2<f32>, around: vec2<f32>) -> f32 {
    let own = residual(i);
    next_r[i] = own;
    z[i] = twice_from_zero(inverse(diagonal(i)), own, around);
    return dot(own, own);
}
