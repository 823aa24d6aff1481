// The first half of the cycle on a coarser level: two sweeps from zero.

@group(0) @binding(4) var<storage, read> b: array<vec2<f32>>;
@group(0) @binding(5) var<storage, read_write> x: array<vec2<f32>>;

fn value(i: u32, at: vec3<i32>) -> vec2<f32> {
    return inverse(diagonal(i)) * b[i];
}

fn visit(i: u32, here: vec2<f32>, around: vec2<f32>) -> f32 {
    x[i] = twice_from_zero(inverse(diagonal(i)), b[i], around);
    return 0.0;
}
