// The last sweep of a level, and <b, out>, which the finest level asks for.

@group(0) @binding(4) var<storage, read> x: array<vec2<f32>>;
@group(0) @binding(5) var<storage, read> b: array<vec2<f32>>;
@group(0) @binding(6) var<storage, read_write> out: array<vec2<f32>>;

fn value(i: u32, at: vec3<i32>) -> vec2<f32> {
    return x[i];
}

fn visit(i: u32, here: vec2<f32>, around: vec2<f32>) -> f32 {
    let d = diagonal(i);
    let next = here + OMEGA.x * inverse(d) * (b[i] - d * here + around);
    out[i] = next;
    return dot(b[i], next);
}
